/* What `bench error` tries: one line each, easily added to. */
#include "bench_error.h"

#include <string.h>

#define ISM_8 "imperfect maps, 8×8 interleaved", 0, true
#define ISM_4 "imperfect maps, 4×4 interleaved", 5, true
#define ISM_1 "imperfect maps, every light at every pixel", 3, true
#define OTHER "imperfect maps, 1024 lights, one thing changed", 2, false
#define CLASSIC "accurate maps, 8×8 interleaved", 4, true
#define HALF "imperfect maps, half resolution", 2, true
#define HALF_6 "half resolution, 6×6 interleaved, less bounded", 3, true
#define SAMPLED "one light a pixel, tested by a ray, half resolution", 4, true
#define MICRO "micro-buffers at every pixel", 7, true
#define MICRO_4 "micro-buffers at one pixel of 4", 0, true
#define MICRO_16 "micro-buffers at one pixel of 16", 1, true
#define MICRO_OTHER "micro-buffers at every pixel, one thing changed", 7, false
#define RAYS "rays to the lights, 8×8 interleaved", 6, false

static const error_setting table[] = {
    {"direct light only", 6, false, "no indirect light", "gi=none", true},

    {ISM_8, "64 lights", "gi=ism vpl.count=64", true},
    {ISM_8, "128 lights", "gi=ism vpl.count=128", false},
    {ISM_8, "256 lights", "gi=ism vpl.count=256", true},
    {ISM_8, "512 lights", "gi=ism vpl.count=512", false},
    {ISM_8, "1024 lights", "gi=ism vpl.count=1024", true},
    {ISM_8, "2048 lights", "gi=ism vpl.count=2048", false},
    {ISM_8, "4096 lights", "gi=ism vpl.count=4096", false},

    {ISM_4, "64 lights", "gi=ism interleave=4 vpl.count=64", false},
    {ISM_4, "256 lights", "gi=ism interleave=4 vpl.count=256", true},
    {ISM_4, "1024 lights", "gi=ism interleave=4 vpl.count=1024", false},
    {ISM_4, "4096 lights", "gi=ism interleave=4 vpl.count=4096", false},

    {ISM_1, "64 lights", "gi=ism interleave=1 filter.passes=0 vpl.count=64", true},
    {ISM_1, "256 lights", "gi=ism interleave=1 filter.passes=0 vpl.count=256", false},
    {ISM_1, "1024 lights", "gi=ism interleave=1 filter.passes=0 vpl.count=1024", false},

    {OTHER, "2048 points a map", "gi=ism vpl.count=1024 ism.points=2048", true},
    {OTHER, "4096 points a map", "gi=ism vpl.count=1024 ism.points=4096", false},
    {OTHER, "16384 points a map", "gi=ism vpl.count=1024 ism.points=16384", false},
    {OTHER, "maps of 64²", "gi=ism vpl.count=1024 ism.size=64", true},
    {OTHER, "maps of 64², 2048 points", "gi=ism vpl.count=1024 ism.size=64 ism.points=2048", true},
    {OTHER, "maps of 256², 32768 points", "gi=ism vpl.count=1024 ism.size=256 ism.points=32768", false},
    {OTHER, "no pull-push", "gi=ism vpl.count=1024 ism.pull-push=false", false},
    {OTHER, "no filter", "gi=ism vpl.count=1024 filter.passes=0", false},
    {OTHER, "one filter pass", "gi=ism vpl.count=1024 filter.passes=1", true},
    {OTHER, "four filter passes", "gi=ism vpl.count=1024 filter.passes=4", false},
    {OTHER, "16×16 interleaved", "gi=ism vpl.count=1024 interleave=16", false},
    {OTHER, "lights wherever light falls", "gi=ism vpl.count=1024 vpl.view-importance=false", false},
    {OTHER, "lights without extent", "gi=ism vpl.count=1024 vpl.spread=0", false},
    {OTHER, "bias compensated by 4 rays", "gi=ism vpl.count=1024 traced.bias=compensated traced.samples=4", false},

    {HALF, "256 lights", "gi=ism half-resolution=true vpl.count=256", false},
    {HALF, "512 lights", "gi=ism half-resolution=true vpl.count=512", false},
    {HALF, "1024 lights", "gi=ism half-resolution=true vpl.count=1024", true},
    {HALF, "2048 lights", "gi=ism half-resolution=true vpl.count=2048", false},
    {HALF_6, "384 lights", "gi=ism half-resolution=true interleave=6 ism.levels=1 vpl.count=384 vpl.bound=50000 vpl.spread=1", false},
    {HALF_6, "512 lights", "gi=ism half-resolution=true interleave=6 ism.levels=1 vpl.count=512 vpl.bound=50000 vpl.spread=1", true},

    {SAMPLED, "1024 lights", "gi=vpl-sampled half-resolution=true vpl.near=0.08", true},
    {SAMPLED, "4096 lights", "gi=vpl-sampled half-resolution=true vpl.near=0.04 vpl.count=4096", false},

    {MICRO, "every pixel, 24²", "gi=micro micro.emission=false", true},
    {MICRO, "every pixel, 8²", "gi=micro micro.emission=false micro.size=8", false},
    {MICRO, "every pixel, 16²", "gi=micro micro.emission=false micro.size=16", false},
    {MICRO, "every pixel, 32²", "gi=micro micro.emission=false micro.size=32", false},
    {MICRO, "every pixel, 24², 256k points", "gi=micro micro.emission=false micro.points=262144", false},
    {MICRO_4, "8²", "gi=micro micro.emission=false micro.spacing=2 micro.size=8", false},
    {MICRO_4, "16²", "gi=micro micro.emission=false micro.spacing=2 micro.size=16", false},
    {MICRO_4, "24²", "gi=micro micro.emission=false micro.spacing=2", true},
    {MICRO_16, "8², 64k points", "gi=micro micro.emission=false micro.spacing=4 micro.size=8 micro.points=65536", false},
    {MICRO_16, "8²", "gi=micro micro.emission=false micro.spacing=4 micro.size=8", true},
    {MICRO_16, "12²", "gi=micro micro.emission=false micro.spacing=4 micro.size=12", false},
    {MICRO_16, "16²", "gi=micro micro.emission=false micro.spacing=4 micro.size=16", false},
    {MICRO_16, "24²", "gi=micro micro.emission=false micro.spacing=4", true},
    {MICRO_OTHER, "no rays to large points", "gi=micro micro.emission=false micro.ray-cast=false", false},
    {MICRO_OTHER, "not warped", "gi=micro micro.emission=false micro.warp=false", false},
    {MICRO_OTHER, "nodes of floats", "gi=micro micro.emission=false micro.nodes=float", false},

    {CLASSIC, "256 lights", "gi=classic vpl.count=256", false},
    {CLASSIC, "1024 lights", "gi=classic vpl.count=1024", false},

    {RAYS, "1024 lights, bounded", "gi=vpl-traced traced.interleave=true vpl.count=1024", true},
    {RAYS, "1024 lights, unbounded", "gi=vpl-traced traced.interleave=true vpl.count=1024 traced.bias=unbounded", false},
    {RAYS, "1024 lights, compensated by 16 rays", "gi=vpl-traced traced.interleave=true vpl.count=1024 traced.bias=compensated", false},
    {RAYS, "4096 lights, bounded", "gi=vpl-traced traced.interleave=true vpl.count=4096", false},
    {"rays to every light at every pixel", 6, false, "64 lights, bounded", "gi=vpl-traced vpl.count=64", false},
};

const error_setting* error_setting_at(size_t index) { return index < sizeof table / sizeof table[0] ? &table[index] : NULL; }

bool error_apply(es_context* context, const error_setting* setting, es_renderer_settings* settings)
{
    char copy[256], *state = NULL;
    snprintf(copy, sizeof copy, "%s", setting->settings);
    for (char* word = strtok_r(copy, " ", &state); word; word = strtok_r(NULL, " ", &state)) {
        char* value = strchr(word, '=');
        if (value) *value++ = 0;
        if (!value || es_renderer_settings_set(context, settings, word, value) != ES_OK) {
            demo_refuse_context(context);
            return false;
        }
    }
    return true;
}
