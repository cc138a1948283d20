/* Worlds that methods are judged in, with the path tracer's picture of each and what is special about its pixels. */
#include "bench_sitting.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* ---- the ring ----------------------------------------------------------------------------------------------------------------- */

static bool hide_silk(es_world* world)
{
    uint32_t ids[64];
    size_t count = 64;
    const es_node silk = es_world_find_node(world, "silk");
    if (es_world_enumerate(world, ES_OBJECT_INSTANCE, ids, &count) != ES_OK) return false;
    for (size_t i = 0; i < count; i++) {
        es_instance_desc desc;
        if (es_world_get_instance(world, (es_instance){ids[i]}, &desc) != ES_OK || desc.node.id != silk.id) continue;
        desc.hidden = true;
        return es_world_set_instance(world, (es_instance){ids[i]}, &desc) == ES_OK;
    }
    return false;
}

/* "phong-N": another exponent; "ggx-R": bronze of that roughness. */
static bool polish_ring(es_world* world, const char* surface)
{
    uint32_t ids[64];
    size_t count = 64;
    if (es_world_enumerate(world, ES_OBJECT_MATERIAL, ids, &count) != ES_OK) return false;
    for (size_t i = 0; i < count; i++) {
        es_material_desc desc;
        if (strcmp(es_world_name(world, ES_OBJECT_MATERIAL, ids[i]), "polished bronze") != 0 || es_world_get_material(world, (es_material){ids[i]}, &desc) != ES_OK) continue;
        if (!strncmp(surface, "phong-", 6)) {
            desc.exponent = strtof(surface + 6, NULL);
        } else {
            desc = es_default_material_desc();
            memcpy(desc.base_color, (const float[3]){0.88f, 0.70f, 0.45f}, 3 * sizeof(float));
            desc.metallic = 1;
            desc.roughness = strtof(surface + 4, NULL);
        }
        return es_world_set_material(world, (es_material){ids[i]}, &desc) == ES_OK;
    }
    return false;
}

static bool open_world(bench_sitting* bench, const char* name, es_world** world)
{
    const bool ring = !strncmp(name, "ring-", 5);
    if (es_world_create_scene(bench->context, ring ? "ring" : name, NULL, world) != ES_OK) return false;
    if (ring && !(hide_silk(*world) && polish_ring(*world, name + 5))) {
        demo_refuse("bench: the scene ring has no silk or no bronze");
        return false;
    }
    return es_world_step(*world, 0) == ES_OK;
}

/* ---- its pixels ----------------------------------------------------------------------------------------------------------------- */

static float radical_inverse(uint32_t base, uint32_t i)
{
    float result = 0, part = 1;
    for (; i; i /= base) {
        part /= (float)base;
        result += part * (float)(i % base);
    }
    return result;
}

/* World place of a pixel at a depth along the view's axis. */
static es_vec3 place_of(const es_raster_view* view, uint32_t x, uint32_t y, float depth)
{
    const float *v = view->view.m, *p = view->projection.m;
    const float e[3] = {(2 * ((float)x + 0.5f) / (float)view->width - 1) / p[0] * depth - v[12], (1 - 2 * ((float)y + 0.5f) / (float)view->height) / p[5] * depth - v[13], -depth - v[14]};
    return (es_vec3){v[0] * e[0] + v[1] * e[1] + v[2] * e[2], v[4] * e[0] + v[5] * e[1] + v[6] * e[2], v[8] * e[0] + v[9] * e[1] + v[10] * e[2]};
}

/* Of rays by the cosine, the share that meets something within `reach`. */
static float near_share(const es_bvh* bvh, es_vec3 place, const float* n, float reach)
{
    enum { RAYS = 16 };
    es_ray rays[RAYS];
    uint8_t blocked[RAYS];
    const float sign = copysignf(1, n[2]), a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
    const es_vec3 from = es_offset_origin(place, (es_vec3){n[0], n[1], n[2]});
    int count = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        const float u = ((float)i + 0.5f) / RAYS, angle = 6.2831853f * radical_inverse(2, i), r = sqrtf(u), z = sqrtf(1 - u), x = r * cosf(angle), y = r * sinf(angle);
        rays[i] = (es_ray){{from.x, from.y, from.z}, 1e-4f * reach,
            {x * (1 + sign * n[0] * n[0] * a) + y * b + z * n[0], x * sign * b + y * (sign + n[1] * n[1] * a) + z * n[1], -x * sign * n[0] - y * n[1] + z * n[2]}, reach};
    }
    es_bvh_any(bvh, ES_RAYS_SINGLE, rays, RAYS, blocked);
    for (int i = 0; i < RAYS; i++) count += blocked[i];
    return (float)count / RAYS;
}

/* Near: a quarter of the hemisphere ends within 3 % of the scene's extent, or one ray of it within contact_reach. */
static bool mark_pixels(bench_sitting* bench, sitting_stage* stage)
{
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = bench->width;
    settings.height = bench->height;
    settings.method = ES_GI_NONE;
    es_renderer* renderer = NULL;
    es_bvh* bvh = NULL;
    es_raster_view view;
    es_image depth = {0}, normal = {0}, specular = {0};
    es_vec3 low, high;
    bool works = es_renderer_create(bench->context, &settings, &renderer) == ES_OK && es_renderer_render(renderer, stage->world) == ES_OK && es_renderer_image(renderer, "depth", &depth) == ES_OK &&
                 es_renderer_image(renderer, "geometric-normal", &normal) == ES_OK && es_renderer_image(renderer, "specular", &specular) == ES_OK && es_bvh_create(bench->context, &bvh) == ES_OK &&
                 es_bvh_build(bvh, es_world_draw_list(stage->world)) == ES_OK &&
                 es_world_camera_view(stage->world, es_world_active_camera(stage->world), bench->width, bench->height, &view) == ES_OK && es_world_bounds(stage->world, &low, &high);
    const size_t pixels = (size_t)bench->width * bench->height;
    stage->contact = works ? calloc(pixels, 1) : NULL;
    const bool any = bench->contact_reach > 0;
    const float share = any ? 0.01f : 0.25f, reach = any ? bench->contact_reach : works ? 0.03f * sqrtf((high.x - low.x) * (high.x - low.x) + (high.y - low.y) * (high.y - low.y) + (high.z - low.z) * (high.z - low.z)) : 0;
    for (size_t i = 0; stage->contact && i < pixels; i++) {
        if (!(depth.pixels[i] > 0)) continue;
        const es_vec3 place = place_of(&view, (uint32_t)(i % bench->width), (uint32_t)(i / bench->width), depth.pixels[i]);
        stage->contact[i] = (uint8_t)((near_share(bvh, place, normal.pixels + 3 * i, reach) >= share) | (specular.pixels[i * specular.channels] > 0) << 1);
    }
    es_image_destroy(bench->context, &depth);
    es_image_destroy(bench->context, &normal);
    es_image_destroy(bench->context, &specular);
    if (bvh) es_bvh_destroy(bvh);
    es_renderer_destroy(renderer);
    return stage->contact != NULL;
}

bool sitting_open_stage(bench_sitting* bench, const char* name, sitting_stage* stage)
{
    char cache[DEMO_PATH_SIZE];
    *stage = (sitting_stage){0};
    error_effort effort = {.width = bench->width, .height = bench->height, .samples = bench->truth_samples, .seconds = bench->truth_seconds};
    if (bench->options->out) {
        snprintf(cache, sizeof cache, "%.3900s/references", bench->options->out);
        if (mkdir(cache, 0777) == 0 || errno == EEXIST) {
            snprintf(cache, sizeof cache, "%.3900s/references/stage-%.64s-%ux%u", bench->options->out, name, bench->width, bench->height);
            effort.cache = cache;
        }
    }
    fprintf(stderr, "%s: the truth, %u samples or %.0f s\n", name, effort.samples, effort.seconds);
    if (open_world(bench, name, &stage->world) && mark_pixels(bench, stage)) return error_trace_truth(bench->context, stage->world, &effort, &stage->truth);
    demo_refuse_context(bench->context);
    return false;
}

void sitting_close_stage(bench_sitting* bench, sitting_stage* stage)
{
    if (stage->world) es_world_destroy(stage->world);
    error_truth_free(bench->context, &stage->truth);
    free(stage->contact);
    *stage = (sitting_stage){0};
}

/* ---- a picture's error -------------------------------------------------------------------------------------------------------------- */

/* As error_measure has relrmse: by the truth's two halves, so that its noise does not count. mask 0: all pixels. */
static double relrmse(const es_image* image, const sitting_stage* stage, uint8_t mask)
{
    double squares = 0, light = 0;
    size_t values = 0;
    for (size_t i = 0; i < (size_t)image->width * image->height * 3; i++) {
        if (mask && !(stage->contact[i / 3] & mask)) continue;
        const double a = (double)image->pixels[i];
        squares += (a - (double)stage->truth.halves[0].pixels[i]) * (a - (double)stage->truth.halves[1].pixels[i]);
        light += (double)stage->truth.indirect.pixels[i];
        values++;
    }
    return values && squares > 0 ? sqrt(squares / (double)values) / (light / (double)values) : NAN;
}

bool sitting_measure(bench_sitting* bench, const sitting_stage* stage, const char* text, sitting_error* error)
{
    enum { MOST = 8 };
    double times[MOST];
    uint32_t frames = bench->frames < MOST ? bench->frames : MOST;
    es_renderer_settings settings = es_default_renderer_settings();
    const error_setting setting = {.settings = text};
    es_renderer* renderer = NULL;
    es_image indirect = {0};
    settings.width = bench->width;
    settings.height = bench->height;
    settings.skip = false;
    settings.lamps = ES_LAMPS_NONE; /* nor has the truth the light of what glows */
    settings.micro_emission = false;
    if (!error_apply(bench->context, &setting, &settings)) return false;
    bool works = es_renderer_create(bench->context, &settings, &renderer) == ES_OK;
    const double begun = demo_seconds();
    for (int i = -1; i < (int)frames && works; i++) {
        if (i > 0 && demo_seconds() - begun > bench->seconds) frames = (uint32_t)i; /* enough */
        if (i == (int)frames) break;
        const double start = demo_seconds();
        works = es_renderer_render(renderer, stage->world) == ES_OK;
        if (i >= 0) times[i] = (demo_seconds() - start) * 1000;
    }
    works = works && es_renderer_image(renderer, "indirect", &indirect) == ES_OK;
    if (works) {
        *error = (sitting_error){relrmse(&indirect, stage, 0), relrmse(&indirect, stage, 1), relrmse(&indirect, stage, 2), bench_median(times, frames)};
        fprintf(stderr, "  %s: %.4g ms, relRMSE %.4f, %.4f in contact, %.4f glossy\n", text, error->milliseconds, error->all, error->contact, error->glossy);
    } else {
        demo_refuse_context(bench->context);
    }
    es_image_destroy(bench->context, &indirect);
    es_renderer_destroy(renderer);
    return works;
}
