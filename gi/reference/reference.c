/* The reference's life: settings, the film, adding samples, images of what has been summed. */
#include "gi/reference/refraction.h"
#include "gi/reference/reference.h"

#include <string.h>

#include "platform/context.h"
#include "platform/random.h"
#include "platform/settings.h"

#define AT(field) offsetof(es_reference_settings, field)
enum { MAX_BOUNCES = ES_PATH_MAX_BOUNCES };
/* Tiles of pixels that share their paths lie elsewhere after this many samples, so that none of their borders stays visible. */
enum { SAMPLES_OF_TILING = 4, MAX_SHARE = 8, MAX_SAMPLES = 1 << 26 };

static const es_setting reference_table[] = {
    {"reference.width", ES_SETTING_INT, "1024", 1, ES_RASTER_MAX_SIZE, NULL, "pixels", AT(width)},
    {"reference.height", ES_SETTING_INT, "768", 1, ES_RASTER_MAX_SIZE, NULL, "pixels", AT(height)},
    {"reference.bounces", ES_SETTING_INT, "1", 0, MAX_BOUNCES, NULL, "indirect bounces", AT(bounces)},
    {"reference.seed", ES_SETTING_INT, "0", 0, 1000000, NULL, "of the random numbers", AT(seed)},
    {"reference.antialias", ES_SETTING_BOOL, "false", 0, 1, NULL, "rays over the pixel's area instead of through its centre", AT(antialias)},
    {"reference.emission", ES_SETTING_BOOL, "true", 0, 1, NULL, "glowing surfaces and the environment light others", AT(emission)},
    {"reference.quantised", ES_SETTING_BOOL, "false", 0, 1, NULL, "first hits are rounded as the G-buffer stores them", AT(quantised)},
    {"reference.share", ES_SETTING_INT, "8", 1, MAX_SHARE, NULL, "pixels, side of the tiles that share their paths; 1: the noise of pixels is independent", AT(share)},
    {"reference.samples", ES_SETTING_INT, "0", 0, 16777216, NULL, "per pixel at most, 0 no limit", AT(max_samples)},
    {"reference.seconds", ES_SETTING_FLOAT, "0", 0, 1e9, NULL, "at most, 0 no limit", AT(max_seconds)},
    {"reference.error", ES_SETTING_FLOAT, "0", 0, 1000, NULL, "relRMSE of the radiance by its own estimate to stop at, 0 no limit", AT(max_error)},
};
enum { SETTINGS = sizeof reference_table / sizeof reference_table[0] };

size_t es_reference_setting_count(void) { return SETTINGS; }
const es_setting* es_reference_setting(size_t index) { return index < SETTINGS ? &reference_table[index] : NULL; }

es_reference_settings es_default_reference_settings(void)
{
    es_reference_settings settings = {0};
    es_settings_defaults(reference_table, SETTINGS, &settings);
    return settings;
}

es_result es_reference_settings_set(es_context* context, es_reference_settings* settings, const char* name, const char* value)
{
    return es_settings_set(context, reference_table, SETTINGS, settings, name, value);
}

/* ---- life ----------------------------------------------------------------------------------------------------------------------------- */

es_result es_reference_create(es_context* context, const es_reference_settings* settings, es_reference** out)
{
    *out = NULL;
    es_reference_settings resolved = settings ? *settings : es_default_reference_settings();
    es_result result = es_settings_check(context, reference_table, SETTINGS, &resolved);
    if (result) return result;
    es_reference* r = es_allocate_zero(context, sizeof *r);
    if (!r) return es_context_last_result(context);
    r->context = context;
    r->settings = resolved;
    es_context_count_object(context, 1);
    *out = r;
    return ES_OK;
}

uint32_t es_reference_image_count(const es_reference* r) { return r->bounces + 2; }
uint32_t es_reference_square_count(const es_reference* r) { return r->bounces + 3; }

static size_t value_count(const es_reference* r) { return (size_t)r->width * r->height * 3; }

static void free_film(es_reference* r)
{
    es_release(r->context, r->sums, value_count(r) * es_reference_image_count(r) * sizeof *r->sums);
    es_release(r->context, r->squares, value_count(r) * es_reference_square_count(r) * sizeof *r->squares);
    es_release(r->context, r->first_hits, (size_t)r->width * r->height * sizeof *r->first_hits);
    r->sums = NULL;
    r->squares = NULL;
    r->first_hits = NULL;
    r->width = r->height = 0;
}

static void free_content(es_reference* r)
{
    es_light_emissions_free(&r->emissions);
    es_trace_scene_free(&r->scene);
    free_film(r);
}

void es_reference_destroy(es_reference* r)
{
    if (!r) return;
    es_context* context = r->context;
    free_content(r);
    es_release(context, r, sizeof *r);
    es_context_count_object(context, -1);
}

void es_reference_forget(es_reference* r)
{
    memset(r->sums, 0, value_count(r) * es_reference_image_count(r) * sizeof *r->sums);
    memset(r->squares, 0, value_count(r) * es_reference_square_count(r) * sizeof *r->squares);
    r->stats = (es_reference_stats){.build_seconds = r->stats.build_seconds, .error = __builtin_inf(), .seconds_left = __builtin_inf()};
    r->resumed_samples = 0;
}

static float largest_of(const float c[3]) { return es_maxf(c[0], es_maxf(c[1], c[2])); }

/* Squares of light that is very strong or weak would leave the range of floats: they are kept in a unit of the strongest source's own, a power
 * of two, and of 1 within 1e9 of it. */
static float unit_of(const es_trace_scene* scene)
{
    es_vec3 low, high;
    es_bvh_bounds(scene->bvh, &low, &high);
    float extent = es_maxf(es_v3_length(es_v3_sub(high, low)), 1e-9f), strongest = 0.0f;
    for (uint32_t i = 0; i < scene->light_count; i++) {
        const es_light_state* light = &scene->lights[i];
        float radiant = largest_of(light->radiant);
        if (light->type != ES_LIGHT_DIRECTIONAL) radiant = es_minf(radiant / extent, 1e28f * extent) / extent;
        strongest = es_maxf(strongest, radiant);
    }
    for (uint32_t i = 0; i < scene->material_count; i++) strongest = es_maxf(strongest, largest_of(scene->materials[i].emission));
    if (scene->has_environment) strongest = es_maxf(strongest, largest_of(scene->environment.radiance));
    if (!(strongest > 1e9f || (strongest > 1e-30f && strongest < 1e-9f))) return 1.0f;
    union { float f; uint32_t u; } unit = {strongest};
    unit.u &= 0x7f800000u;
    return unit.f;
}

static es_result begin(es_reference* r, es_world* world)
{
    es_camera camera = es_world_active_camera(world);
    if (!camera.id) return es_misuse(r->context, ES_WRONG_STATE, "the world has no active camera; es_world_set_active_camera chooses one");
    es_result result = es_world_camera_view(world, camera, r->settings.width, r->settings.height, &r->view);
    if (result) return result;
    r->rays = es_pixel_rays_of_view(&r->view);
    double start = es_seconds();
    es_light_emissions_free(&r->emissions);
    result = es_trace_scene_take(&r->scene, world, r->settings.emission);
    if (!result) result = es_light_emissions_create(&r->emissions, &r->scene);
    if (result) return result;
    double built = es_seconds() - start;
    free_film(r);
    r->width = r->settings.width;
    r->height = r->settings.height;
    r->bounces = r->settings.bounces;
    r->sums = es_allocate_array(r->context, value_count(r) * es_reference_image_count(r), sizeof *r->sums);
    if (r->sums) r->squares = es_allocate_array(r->context, value_count(r) * es_reference_square_count(r), sizeof *r->squares);
    /* what is seen through blended surfaces and glass differs from sample to sample */
    const bool same_hits = !r->settings.antialias && !r->scene.has_blended && !r->scene.has_glass;
    if (r->squares && same_hits) r->first_hits = es_allocate_array(r->context, (size_t)r->width * r->height, sizeof *r->first_hits);
    if (!r->squares || (!r->first_hits && same_hits)) return es_context_last_result(r->context);
    r->looked = false;
    r->world = world;
    r->revisions = es_world_get_revisions(world);
    r->stats.build_seconds = built;
    es_reference_forget(r);
    r->fingerprint = es_reference_fingerprint(r);
    r->unit = unit_of(&r->scene);
    r->begun = true;
    return ES_OK;
}

es_result es_reference_begin(es_reference* r, es_world* world)
{
    if (!world || es_world_context(world) != r->context) return es_misuse(r->context, ES_INVALID_ARGUMENT, "the reference and the world must share one context");
    r->begun = false;
    es_fp_environment environment = es_fp_enter();
    es_result result = begin(r, world);
    es_fp_leave(environment);
    if (!result) return ES_OK;
    free_content(r);
    return result;
}

/* ---- samples ---------------------------------------------------------------------------------------------------------------------------- */

static void add(es_film_sum* s, float value)
{
    float sum = s->sum + value;
    s->lost += es_absf(s->sum) >= es_absf(value) ? (s->sum - sum) + value : (value - sum) + s->sum;
    s->sum = sum;
}

/* First hits and what lights them, where they do not change from sample to sample. */
typedef struct look_job { es_reference* r; uint64_t rays; } look_job;

static void look(void* user, uint32_t begin_row, uint32_t end_row, uint32_t worker)
{
    look_job* job = user;
    es_reference* r = job->r;
    uint32_t rays = 0;
    for (uint32_t y = begin_row; y < end_row; y++)
        for (uint32_t x = 0; x < r->width; x++) {
            es_first_hit* first = &r->first_hits[(size_t)y * r->width + x];
            es_path_start start;
            es_ray ray = es_path_ray(&r->rays, (float)x, (float)y);
            rays++;
            es_trace_closest(&r->scene, ray, true, &first->hit);
            es_path_begin(&r->scene, &ray, &first->hit, r->settings.quantised, &start);
            es_vec3 direct = es_path_direct(&r->scene, &start, &rays);
            first->direct[0] = direct.x;
            first->direct[1] = direct.y;
            first->direct[2] = direct.z;
        }
    __atomic_fetch_add(&job->rays, rays, __ATOMIC_RELAXED);
}

static void add_sample(es_reference* r, size_t pixel, es_vec3 emission, es_vec3 direct, const es_vec3* bounce)
{
    const size_t plane = value_count(r);
    const float per_unit = 1.0f / r->unit;
    float total[3] = {emission.x, emission.y, emission.z}, indirect[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) add(&r->sums[pixel * 3 + (size_t)k], total[k]);
    for (uint32_t b = 0; b <= r->bounces; b++) {
        es_vec3 of = b ? bounce[b] : es_v3_add(direct, bounce[0]);
        const float value[3] = {of.x, of.y, of.z};
        for (int k = 0; k < 3; k++) {
            size_t at = pixel * 3 + (size_t)k;
            add(&r->sums[(b + 1) * plane + at], value[k]);
            r->squares[b * plane + at] += (value[k] * per_unit) * (value[k] * per_unit);
            total[k] += value[k];
            if (b) indirect[k] += value[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        size_t at = pixel * 3 + (size_t)k;
        r->squares[(r->bounces + 1) * plane + at] += (indirect[k] * per_unit) * (indirect[k] * per_unit);
        r->squares[(r->bounces + 2) * plane + at] += (total[k] * per_unit) * (total[k] * per_unit);
    }
}

/* Some samples of all pixels, in one tiling of the film. */
typedef struct sample_job { es_reference* r; uint32_t first, count, left, top, across; uint64_t rays; } sample_job;

typedef struct tile_pixels {
    es_path_start starts[ES_PATH_GROUP];
    es_vec3 direct[ES_PATH_GROUP];
    uint32_t pixel[ES_PATH_GROUP];
    es_vec3 bounce[ES_PATH_GROUP * (MAX_BOUNCES + 1)];
} tile_pixels;

/* Pairs of numbers that no vertex of a path uses (gi/reference/path.c). */
enum { PAIR_PIXEL = 0xffff, PAIR_LAYER = 0xfffd, PAIR_GLASS = 0xfff0 /* and the one before, and so on: one for each thing of glass */, MOST_GLASS = 8 };

/* A sample goes through glass or stays at its surface, by chance, as much as goes through; from thing to thing. */
static uint32_t see_through(const es_reference* r, uint32_t seed, uint32_t sample, es_ray* ray, es_path_start* start)
{
    uint32_t rays = 0;
    es_vec3 weight = es_v3(1, 1, 1);
    for (uint32_t i = 0; i < MOST_GLASS && start->seen; i++) {
        const es_trace_surface* s = &start->surface;
        const float most = es_maxf(s->tint.x, es_maxf(s->tint.y, s->tint.z));
        if (!(most > 0.0f)) break;
        const es_refraction through = es_trace_refraction(&r->scene, s, es_v3_normalize(es_v3(ray->direction[0], ray->direction[1], ray->direction[2]), es_v3(0, 0, -1)));
        rays += through.rays;
        const float share = es_maxf(through.weight.x, es_maxf(through.weight.y, through.weight.z));
        float u[2];
        es_path_numbers(seed, PAIR_GLASS - i, sample, u);
        if (!(u[0] < share)) {
            weight = es_v3_scale(weight, 1.0f / (1.0f - share));
            break;
        }
        weight = es_v3_scale(es_v3_mul(weight, through.weight), 1.0f / share);
        *ray = (es_ray){{through.position.x, through.position.y, through.position.z}, 0.0f, {through.direction.x, through.direction.y, through.direction.z}, 3e38f};
        es_hit hit;
        rays++;
        es_trace_closest(&r->scene, *ray, true, &hit);
        es_path_begin(&r->scene, ray, &hit, r->settings.quantised, start);
    }
    start->weight = weight;
    return rays;
}

static uint32_t begin_path(const es_reference* r, uint32_t pixel, uint32_t seed, uint32_t sample, es_path_start* start, es_vec3* direct)
{
    uint32_t rays = 0, x = pixel % r->width, y = pixel / r->width;
    if (r->first_hits) {
        const es_first_hit* first = &r->first_hits[pixel];
        es_ray ray = es_path_ray(&r->rays, (float)x, (float)y);
        es_path_begin(&r->scene, &ray, &first->hit, r->settings.quantised, start);
        *direct = es_v3(first->direct[0], first->direct[1], first->direct[2]);
        return 0;
    }
    float u[2] = {0.5f, 0.5f}, layer[2] = {0, 0};
    if (r->settings.antialias) es_path_numbers(seed, PAIR_PIXEL, sample, u);
    if (r->scene.has_blended) es_path_numbers(seed, PAIR_LAYER, sample, layer);
    es_ray ray = es_path_ray(&r->rays, (float)x + u[0] - 0.5f, (float)y + u[1] - 0.5f);
    es_hit hit;
    es_trace_seen(&r->scene, ray, layer[0], &hit);
    es_path_begin(&r->scene, &ray, &hit, r->settings.quantised, start);
    if (r->scene.has_glass) rays += see_through(r, seed, sample, &ray, start);
    *direct = es_path_direct(&r->scene, start, &rays);
    return rays + 1;
}

static void sample_tiles(void* user, uint32_t begin_tile, uint32_t end_tile, uint32_t worker)
{
    sample_job* job = user;
    es_reference* r = job->r;
    const uint32_t side = r->settings.share;
    const es_path_job path = {&r->scene, &r->emissions, r->bounces, r->techniques};
    tile_pixels tile;
    uint64_t rays = 0;
    for (uint32_t t = begin_tile; t < end_tile; t++) {
        /* the first tiles may begin before the film's edge */
        const uint32_t right = (t % job->across + 1) * side - job->left, bottom = (t / job->across + 1) * side - job->top;
        es_path_group group = {.seed = es_random_u32(r->settings.seed ^ 0x2545f491u, t), .light_vertices = side * side < 32 ? 1 : side * side / 16, .bounce = tile.bounce};
        for (uint32_t y = bottom < side ? 0 : bottom - side; y < bottom && y < r->height; y++)
            for (uint32_t x = right < side ? 0 : right - side; x < right && x < r->width; x++) {
                tile.pixel[group.count] = y * r->width + x;
                group.seeds[group.count] = es_random_u32(r->settings.seed, y * r->width + x);
                group.starts[group.count] = &tile.starts[group.count];
                group.count++;
            }
        for (uint32_t i = 0; i < job->count; i++) {
            for (uint32_t k = 0; k < group.count && (!i || !r->first_hits); k++)
                rays += begin_path(r, tile.pixel[k], group.seeds[k], job->first + i, &tile.starts[k], &tile.direct[k]);
            rays += es_path_trace(&path, &group, job->first + i);
            for (uint32_t k = 0; k < group.count; k++) {
                es_vec3* bounce = tile.bounce + k * (r->bounces + 1);
                const es_vec3 weight = tile.starts[k].weight;
                for (uint32_t b = 0; b <= r->bounces && r->scene.has_glass; b++) bounce[b] = es_v3_mul(bounce[b], weight);
                add_sample(r, tile.pixel[k], r->scene.has_glass ? es_v3_mul(tile.starts[k].emission, weight) : tile.starts[k].emission, r->scene.has_glass ? es_v3_mul(tile.direct[k], weight) : tile.direct[k], bounce);
            }
        }
    }
    __atomic_fetch_add(&job->rays, rays, __ATOMIC_RELAXED);
}

static void add_samples(es_reference* r, uint32_t samples)
{
    if (r->first_hits && !r->looked) {
        look_job job = {r, 0};
        es_parallel_for(r->context, r->height, 4, look, &job);
        r->stats.rays += job.rays;
        r->looked = true;
    }
    const uint32_t side = r->settings.share;
    for (uint32_t count; samples; samples -= count) {
        uint32_t first = (uint32_t)r->stats.samples, tiling = first / SAMPLES_OF_TILING, left = (tiling + 1) * SAMPLES_OF_TILING - first;
        count = samples < left ? samples : left;
        sample_job job = {r, first, count, es_random_u32(r->settings.seed, 2 * tiling) % side, es_random_u32(r->settings.seed, 2 * tiling + 1) % side, 0, 0};
        job.across = (r->width + job.left + side - 1) / side;
        es_parallel_for(r->context, job.across * ((r->height + job.top + side - 1) / side), side < 4 ? 256 : 16, sample_tiles, &job);
        r->stats.rays += job.rays;
        r->stats.samples += count;
    }
}

float es_reference_mean(const es_reference* r, uint32_t image, size_t at)
{
    const es_film_sum* s = &r->sums[image * value_count(r) + at];
    return (s->sum + s->lost) / (float)r->stats.samples;
}

/* Variance of the mean from that of single samples. Stratified samples do better than independent ones, so this errs on the safe side. */
double es_reference_variance(const es_reference* r, uint32_t square, size_t at, float mean)
{
    double n = (double)r->stats.samples, unit = r->unit;
    if (n < 2) return __builtin_inf();
    double v = ((double)r->squares[square * value_count(r) + at] * (unit * unit) / n - (double)mean * mean) / (n - 1);
    return v > 0.0 ? v : 0.0;
}

static float radiance_mean(const es_reference* r, size_t at, uint32_t first_image)
{
    float mean = 0.0f;
    for (uint32_t i = first_image; i < es_reference_image_count(r); i++) mean += es_reference_mean(r, i, at);
    return mean;
}

static void estimate_error(es_reference* r)
{
    if (r->stats.samples < 2) {
        r->stats.error = __builtin_inf();
        return;
    }
    double variance = 0.0, mean = 0.0;
    for (size_t at = 0; at < value_count(r); at++) {
        float m = radiance_mean(r, at, 0);
        variance += es_reference_variance(r, r->bounces + 2, at, m);
        mean += m;
    }
    double n = (double)value_count(r);
    r->stats.error = variance > 0.0 ? __builtin_sqrt(variance / n) / (mean / n) : 0.0;
}

static void estimate_time(es_reference* r)
{
    es_reference_stats* s = &r->stats;
    const es_reference_settings* limit = &r->settings;
    double fresh = (double)(s->samples - r->resumed_samples), each = fresh > 0 ? s->seconds / fresh : 0.0, left = __builtin_inf();
    if (limit->max_samples) left = each * ((double)limit->max_samples - (double)s->samples);
    if (limit->max_seconds > 0.0f && (double)limit->max_seconds - s->seconds < left) left = (double)limit->max_seconds - s->seconds;
    if (limit->max_error > 0.0f && s->error < __builtin_inf()) {
        double ratio = s->error / (double)limit->max_error, more = each * (double)s->samples * (ratio * ratio - 1.0);
        if (more < left) left = more;
    }
    s->seconds_left = left > 0.0 ? left : 0.0;
    s->done = (limit->max_samples && s->samples >= limit->max_samples) || (limit->max_seconds > 0.0f && s->seconds >= (double)limit->max_seconds) ||
              (limit->max_error > 0.0f && s->error <= (double)limit->max_error);
}

void es_reference_estimate(es_reference* r)
{
    estimate_error(r);
    estimate_time(r);
}

es_result es_reference_add(es_reference* r, uint32_t samples)
{
    if (!r->begun) return es_misuse(r->context, ES_WRONG_STATE, "es_reference_begin comes before es_reference_add");
    es_world_revisions now = es_world_get_revisions(r->world);
    if (now.geometry != r->revisions.geometry || now.materials != r->revisions.materials || now.lights != r->revisions.lights)
        return es_misuse(r->context, ES_WRONG_STATE, "the world has changed since es_reference_begin; begin again");
    if (r->stats.done || !samples) return ES_OK;
    if (r->settings.max_samples && samples > r->settings.max_samples - r->stats.samples) samples = (uint32_t)(r->settings.max_samples - r->stats.samples);
    if (r->stats.samples + samples > MAX_SAMPLES) return es_fail(r->context, ES_WRONG_STATE, "2^26 samples per pixel are the most there can be");
    double start = es_seconds();
    es_fp_environment environment = es_fp_enter();
    add_samples(r, samples);
    r->stats.seconds += es_seconds() - start;
    es_reference_estimate(r);
    es_fp_leave(environment);
    return ES_OK;
}

es_reference_stats es_reference_get_stats(const es_reference* r) { return r->stats; }
