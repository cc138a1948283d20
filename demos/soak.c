/* `earthshine soak`: hours of the built-in scenes without a picture, and whether everything in them stays where and what it should be. */
#include "demo.h"
#include "energy_watch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LOOK = 8 /* steps between looks at every body */ };

typedef struct soak {
    const char* scene;
    double seconds;
    uint32_t threads;
    bool no_sleep;
    double peak;          /* J: most kinetic energy of bodies and cloth together, after the first half; negative: that was not reached */
    uint32_t bodies, softs;
    float low[3], high[3]; /* of what there was to see when it began */
    char trouble[256];
} soak;

static void trouble(soak* s, double time, const char* what, const char* name, uint32_t id)
{
    if (!s->trouble[0]) snprintf(s->trouble, sizeof s->trouble, "after %.1f s: %s %u%s%.64s %s", time, strncmp(what, "cloth", 5) ? "body" : "soft body", id, name[0] ? ", " : "", name, what);
}

/* What leaves the scene by more than its size, or falls below it by a metre, is lost. */
static bool is_lost(const soak* s, const double p[3])
{
    double size = 1;
    for (int k = 0; k < 3; k++) size = fmax(size, (double)(s->high[k] - s->low[k]));
    return p[1] < (double)s->low[1] - 1 || p[1] > (double)s->high[1] + 4 * size || p[0] < (double)s->low[0] - size || p[0] > (double)s->high[0] + size ||
           p[2] < (double)s->low[2] - size || p[2] > (double)s->high[2] + size;
}

static bool all_finite(const double* p, es_vec3 v, es_vec3 w)
{
    return isfinite(p[0] + p[1] + p[2]) && isfinite(v.x + v.y + v.z) && isfinite(w.x + w.y + w.z);
}

static double look_at_bodies(soak* s, const es_world* world, uint32_t* ids, double time)
{
    size_t count = s->bodies;
    double energy = 0;
    if (es_world_enumerate(world, ES_OBJECT_BODY, ids, &count) != ES_OK) return 0;
    for (size_t i = 0; i < count && i < s->bodies; i++) {
        es_body_state state;
        if (es_world_get_body(world, (es_body){ids[i]}, &state) != ES_OK || state.type != ES_BODY_DYNAMIC) continue;
        const char* name = es_world_name(world, ES_OBJECT_BODY, ids[i]);
        if (!all_finite(state.centre, state.velocity, state.angular_velocity)) trouble(s, time, "is no number", name ? name : "", ids[i]);
        else if (is_lost(s, state.centre)) trouble(s, time, "is lost", name ? name : "", ids[i]);
        energy += (double)state.kinetic_energy;
    }
    return energy;
}

static double look_at_softs(soak* s, const es_world* world, uint32_t* ids, double time)
{
    size_t count = s->softs;
    double energy = 0;
    if (es_world_enumerate(world, ES_OBJECT_SOFT, ids, &count) != ES_OK) return 0;
    for (size_t i = 0; i < count && i < s->softs; i++) {
        es_soft_state state;
        if (es_world_get_soft_state(world, (es_soft){ids[i]}, &state) != ES_OK) continue;
        const char* name = es_world_name(world, ES_OBJECT_SOFT, ids[i]);
        if (!isfinite(state.centre[0] + state.centre[1] + state.centre[2]) || !isfinite(state.kinetic_energy) || !isfinite(state.largest_stretch))
            trouble(s, time, "cloth is no number", name ? name : "", ids[i]);
        else if (is_lost(s, state.centre)) trouble(s, time, "cloth is lost", name ? name : "", ids[i]);
        else if (state.largest_stretch > 2) trouble(s, time, "cloth is stretched to more than twice its length", name ? name : "", ids[i]);
        energy += (double)state.kinetic_energy;
    }
    return energy;
}

static void look_at_instances(soak* s, const es_world* world, double time)
{
    const es_draw_list* list = es_world_draw_list(world);
    float low[3], high[3];
    es_vec3 minimum, maximum;
    if (!list || !es_world_bounds(world, &minimum, &maximum)) return;
    memcpy(low, &minimum, sizeof low);
    memcpy(high, &maximum, sizeof high);
    for (int k = 0; k < 3; k++)
        if ((!isfinite(low[k]) || !isfinite(high[k])) && !s->trouble[0]) snprintf(s->trouble, sizeof s->trouble, "after %.1f s: what is drawn has no bounds", time);
}

/* What energy_watch.h says of it. */
static void look_at_gain(soak* s, const es_world* world, const energy_watch* watch)
{
    const energy_gain gain = energy_watch_worst(watch);
    if (!gain.id || gain.joules <= gain.allowed || s->trouble[0]) return;
    const char* name = es_world_name(world, gain.kind, gain.id);
    snprintf(s->trouble, sizeof s->trouble, "after %.1f s: %s %u%s%.64s has gained %.3g J that nothing gave it, of %.3g J allowed", gain.time, gain.kind == ES_OBJECT_SOFT ? "soft body" : "body",
        gain.id, name && name[0] ? ", " : "", name ? name : "", gain.joules, gain.allowed);
}

/* `made` seconds took `spent`. */
static void report(const soak* s, const energy_gain* gain, double made, uint64_t steps, double spent)
{
    const double judged = (double)gain->judged / (double)(gain->judged + gain->driven ? gain->judged + gain->driven : 1);
    printf("%-14s %5u bodies %3u soft bodies, %.6g s, %.0f steps per second, ", s->scene, s->bodies, s->softs, made, (double)steps / spent);
    if (s->peak >= 0) printf("kinetic energy at most %.4g J in the second half, ", s->peak);
    if (gain->judged) printf("gained by nothing at most %.3g J (%.1f %% of what is allowed; judged %.1f %% of all)", gain->joules, 100 * gain->joules / gain->allowed, 100 * judged);
    else printf("everything driven or nothing there");
    printf(": %s\n", s->trouble[0] ? s->trouble : "good");
    fflush(stdout);
}

static uint32_t* count_objects(soak* s, const es_world* world)
{
    size_t bodies = 0, softs = 0;
    es_world_enumerate(world, ES_OBJECT_BODY, NULL, &bodies);
    es_world_enumerate(world, ES_OBJECT_SOFT, NULL, &softs);
    s->bodies = (uint32_t)bodies;
    s->softs = (uint32_t)softs;
    return malloc((bodies + softs + 1) * sizeof(uint32_t));
}

static int run(soak* s)
{
    const demo_options options = {.scene = s->scene, .threads = s->threads, .method = -1};
    demo_session session;
    int code = demo_session_open_context(&options, &session);
    if (code != DEMO_OK) return code;
    es_world_settings settings = es_default_world_settings();
    code = demo_apply_scene_settings(session.context, s->scene, &settings, NULL, NULL);
    if (s->no_sleep) settings.sleep = false;
    if (code == DEMO_OK && (es_world_open(session.context, s->scene, &settings, &session.world) != ES_OK || es_world_step(session.world, 0) != ES_OK))
        code = demo_refuse_context(session.context);
    uint32_t* ids = code == DEMO_OK ? count_objects(s, session.world) : NULL;
    energy_watch* watch = code == DEMO_OK ? energy_watch_open(session.world) : NULL;
    if (code == DEMO_OK && (!ids || !watch)) code = demo_refuse("out of memory");
    es_vec3 low = {0}, high = {0};
    if (code == DEMO_OK) es_world_bounds(session.world, &low, &high);
    memcpy(s->low, &low, sizeof s->low);
    memcpy(s->high, &high, sizeof s->high);
    const double begin = demo_seconds(), rate = 1 / (double)settings.step;
    const uint64_t steps = (uint64_t)(s->seconds * rate);
    uint64_t made = 0;
    s->peak = -1;
    for (uint64_t i = 0; i < steps && code == DEMO_OK && !s->trouble[0]; i++) {
        if (es_world_step(session.world, settings.step) != ES_OK) code = demo_refuse_context(session.context);
        else if (!energy_watch_step(watch, session.world)) code = demo_refuse("out of memory");
        made = code == DEMO_OK ? i + 1 : i;
        if (code != DEMO_OK || (i % LOOK && i + 1 < steps)) continue;
        const double time = (double)(i + 1) / rate;
        const double energy = look_at_bodies(s, session.world, ids, time) + look_at_softs(s, session.world, ids, time);
        if (i >= steps / 2) s->peak = fmax(s->peak, energy);
        look_at_instances(s, session.world, time);
        look_at_gain(s, session.world, watch);
    }
    free(ids);
    const energy_gain gain = watch ? energy_watch_worst(watch) : (energy_gain){0};
    energy_watch_close(watch);
    if (code == DEMO_OK) report(s, &gain, made == steps ? s->seconds : (double)made / rate, made, demo_seconds() - begin);
    demo_session_close(&session);
    return code == DEMO_OK && s->trouble[0] ? DEMO_EXCEEDED : code;
}

int demo_soak(int count, char** arguments)
{
    const char* scene = "all";
    soak asked = {.seconds = 3600};
    for (int i = 0; i < count; i++) {
        const char* value = i + 1 < count ? arguments[i + 1] : NULL;
        if (!strcmp(arguments[i], "--no-sleep")) {
            asked.no_sleep = true;
            continue;
        }
        if (!value) return demo_refuse("soak: %s: no such option, or its value is missing; --scene S|all --seconds S --threads N --no-sleep", arguments[i]);
        if (!strcmp(arguments[i], "--scene")) scene = value;
        else if (!strcmp(arguments[i], "--seconds")) {
            if (!demo_parse_double(value, 0.1, 1e6, &asked.seconds)) return demo_refuse("--seconds %s: a number from 0.1 to 1e6 is expected", value);
        } else if (!strcmp(arguments[i], "--threads")) {
            if (!demo_parse_uint(value, 1, 64, &asked.threads)) return demo_refuse("--threads %s: a number from 1 to 64 is expected", value);
        } else return demo_refuse("soak: unknown option %s; --scene S|all --seconds S --threads N --no-sleep", arguments[i]);
        i++;
    }
    int worst = DEMO_OK;
    bool all = !strcmp(scene, "all");
    for (size_t i = 0; i < (all ? es_scene_count() : 1); i++) {
        soak s = asked;
        s.scene = all ? es_scene_name(i) : scene;
        int code = run(&s);
        if (code == DEMO_BAD_INPUT) return code;
        if (code > worst) worst = code;
    }
    return worst;
}
