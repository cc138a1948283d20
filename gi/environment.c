#include "gi/environment.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "gi/octahedral.h"
#include "platform/maths.h"
#include "sim/environment.h"

enum { MOST_TAPS = 256, SOURCES = 64 /* of irradiance, along a side */, LARGEST = 512, SMALLEST = 128 };

static const uint32_t lobe_sizes[ES_ENVIRONMENT_LOBES] = {128, 64, 32, 16, 16};
static const uint32_t lobe_taps[ES_ENVIRONMENT_LOBES] = {64, 128, 256, 256, 256};

/* ---- memory ------------------------------------------------------------------------------------------------------------ */

static uint32_t base_size(const es_environment_desc* environment)
{
    /* About as many texels as the image has, but no more than twice as coarse, so that pictures of middling size take the middle. */
    const float texels = environment->image ? 0.63661977f * (float)environment->image->width * (float)environment->image->height : 0.0f;
    uint32_t size = SMALLEST;
    while (size < LARGEST && texels > 2.0f * (float)size * (float)size) size *= 2;
    return size;
}

static float* level_texels(const es_environment_map* map, const es_environment_pyramid* p, uint32_t level) { return map->memory + 4 * (size_t)p->first[level]; }

static int32_t append_level(es_environment_pyramid* p, int32_t first, uint32_t size)
{
    p->first[p->levels] = first;
    p->size[p->levels++] = (float)size;
    return first + (int32_t)((size + 2) * (size + 2));
}

static es_result reserve(es_context* context, es_environment_map* map, uint32_t size)
{
    int32_t texels = 0;
    es_environment_pyramid means = {0}, lobes = {0}, irradiance = {0};
    for (uint32_t s = size; s >= 4; s /= 2) texels = append_level(&means, texels, s);
    append_level(&lobes, 0, size); /* both begin with the radiance itself */
    for (int i = 0; i < ES_ENVIRONMENT_LOBES; i++) texels = append_level(&lobes, texels, lobe_sizes[i]);
    texels = append_level(&irradiance, texels, ES_ENVIRONMENT_IRRADIANCE);
    const size_t bytes = (size_t)texels * 4 * sizeof(float);
    if (map->bytes != bytes) {
        es_environment_map_free(context, map);
        map->memory = es_allocate(context, bytes);
        if (!map->memory) return es_context_last_result(context);
        map->bytes = bytes;
    }
    means.texels = lobes.texels = irradiance.texels = map->memory;
    map->means = means;
    map->lookup = (es_environment_lookup){lobes, irradiance};
    memset(map->memory, 0, bytes);
    return ES_OK;
}

void es_environment_map_free(es_context* context, es_environment_map* map)
{
    es_release(context, map->memory, map->bytes);
    *map = (es_environment_map){0};
}

/* ---- levels ---------------------------------------------------------------------------------------------------------------- */

/* Over an edge the square goes on at the mirrored place of the same edge. */
static void fill_border(float* texels, uint32_t size)
{
    const size_t stride = size + 2, texel = 4 * sizeof(float), end = size + 1;
    for (uint32_t i = 1; i <= size; i++) {
        const size_t other = size + 1 - i;
        memcpy(texels + 4 * i, texels + 4 * (stride + other), texel);
        memcpy(texels + 4 * (end * stride + i), texels + 4 * (size * stride + other), texel);
        memcpy(texels + 4 * (i * stride), texels + 4 * (other * stride + 1), texel);
        memcpy(texels + 4 * (i * stride + end), texels + 4 * (other * stride + size), texel);
    }
    memcpy(texels, texels + 4 * (size * stride + size), texel);
    memcpy(texels + 4 * end, texels + 4 * (size * stride + 1), texel);
    memcpy(texels + 4 * (end * stride), texels + 4 * (stride + size), texel);
    memcpy(texels + 4 * (end * stride + end), texels + 4 * (stride + 1), texel);
}

/* Below, lookups times weights would be denormal. */
static float without_dust(float x) { return x > 1e-30f ? x : 0.0f; }

static void quarters(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    for (uint32_t q = begin; q < end; q++) es_octahedral_quarter(user, q);
}

static es_result make_base(es_context* context, const es_environment_desc* environment, es_environment_map* map)
{
    const uint32_t size = (uint32_t)map->means.size[0], height = environment->image ? environment->image->height : 1;
    float pixel[3] = {1, 1, 1};
    es_image white = {.width = 1, .height = 1, .channels = 3, .pixels = pixel};
    es_environment_desc with_image = *environment;
    if (!with_image.image) with_image.image = &white;
    double* rows = es_allocate_array(context, height + 1, sizeof *rows);
    if (!rows) return es_context_last_result(context);
    es_elevation_sines(height, rows);
    float* base = level_texels(map, &map->means, 0);
    es_octahedral_job job = {&with_image, rows, size, base};
    es_parallel_for(context, 4, 1, quarters, &job);
    es_release(context, rows, (height + 1) * sizeof *rows);
    for (uint32_t y = 1; y <= size; y++)
        for (uint32_t x = 1; x <= size; x++) {
            float* texel = base + 4 * ((size_t)y * (size + 2) + x);
            for (int k = 0; k < 3; k++) {
                map->power[k] += (double)texel[k];
                texel[k] = without_dust(environment->image ? texel[k] / texel[3] : environment->radiance[k]);
            }
        }
    fill_border(base, size);
    return ES_OK;
}

static void make_means(es_environment_map* map)
{
    for (uint32_t level = 1; level < map->means.levels; level++) {
        const uint32_t size = (uint32_t)map->means.size[level];
        const float* from = level_texels(map, &map->means, level - 1);
        float* to = level_texels(map, &map->means, level);
        for (uint32_t y = 0; y < size; y++)
            for (uint32_t x = 0; x < size; x++) {
                const float *a = from + 4 * ((size_t)(2 * y + 1) * (2 * size + 2) + 2 * x + 1), *b = a + 4 * (2 * size + 2);
                float* out = to + 4 * ((size_t)(y + 1) * (size + 2) + x + 1);
                const float solid_angle = (a[3] + a[7]) + (b[3] + b[7]);
                for (int k = 0; k < 3; k++) out[k] = without_dust(((a[k] * a[3] + a[4 + k] * a[7]) + (b[k] * b[3] + b[4 + k] * b[7])) / solid_angle);
                out[3] = solid_angle;
            }
        fill_border(to, size);
    }
}

/* Sum over the level's texels of value × solid angle; that of a level of lobes from the means of its own size. */
static void level_power(const es_environment_map* map, const float* texels, uint32_t size, double power[3])
{
    uint32_t level = 0;
    while ((uint32_t)map->means.size[level] != size) level++;
    const float* solid = level_texels(map, &map->means, level);
    power[0] = power[1] = power[2] = 0.0;
    for (uint32_t y = 1; y <= size; y++)
        for (uint32_t x = 1; x <= size; x++) {
            const size_t at = 4 * ((size_t)y * (size + 2) + x);
            for (int k = 0; k < 3; k++) power[k] += (double)texels[at + (size_t)k] * (double)solid[at + 3];
        }
}

/* A level whose exact sum over the sphere is known gets that sum. */
static void correct_power(const es_environment_map* map, float* texels, uint32_t size, double share)
{
    double power[3];
    level_power(map, texels, size, power);
    for (uint32_t y = 1; y <= size; y++)
        for (uint32_t x = 1; x <= size; x++)
            for (int k = 0; k < 3; k++) {
                float* value = texels + 4 * ((size_t)y * (size + 2) + x) + k;
                if (power[k] > 0.0) *value = without_dust((float)((double)*value * (share * map->power[k] / power[k])));
            }
    fill_border(texels, size);
}

/* ---- lobes ------------------------------------------------------------------------------------------------------------------- */

/* Half vectors by the density D cos, lights mirrored about them: tan² = alpha² u / (1 - u) (Walter et al. 2007, eq. 35). Their density is D / 4. */
static uint32_t make_taps(float alpha, uint32_t count, float base, uint32_t levels, es_environment_tap* taps)
{
    uint32_t kept = 0;
    double total = 0.0;
    for (uint32_t i = 0; i < count; i++) {
        const float u = ((float)i + 0.5f) / (float)count, turn = (float)i * 0.61803399f;
        const float cosine = es_sqrt((1.0f - u) / (1.0f + (alpha * alpha - 1.0f) * u)), sine = es_sqrt(es_maxf(1.0f - cosine * cosine, 0.0f));
        const float up = 2.0f * cosine * cosine - 1.0f;
        if (!(up > 0.0f)) continue;
        const float narrow = cosine * cosine * (alpha * alpha - 1.0f) + 1.0f, density = alpha * alpha / (4.0f * ES_PI * narrow * narrow);
        float s, c;
        es_sincos(2.0f * ES_PI * (turn - es_floor(turn)), &s, &c);
        es_environment_tap* tap = &taps[kept++];
        *tap = (es_environment_tap){{2.0f * cosine * sine * c, 2.0f * cosine * sine * s, up}, 0.0f, up};
        /* A wider texel would carry a small sun into tails where there is little else; between texels neighbours overlap as it is. */
        const float solid_angle = 1.0f / ((float)count * density), texel = 4.0f * ES_PI / (base * base);
        tap->level = es_clampf(0.5f * es_log2(solid_angle / texel), 0.0f, (float)(levels - 1));
        total += (double)up;
    }
    for (uint32_t i = 0; i < kept; i++) taps[i].weight = (float)((double)taps[i].weight / total);
    return kept;
}

typedef struct lobe_loop { const es_gi_kernels* kernels; const es_environment_lobe_job* job; } lobe_loop;
static void lobe_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const lobe_loop* loop = user;
    loop->kernels->environment_lobes(loop->job, begin, end);
}

static es_result make_lobes(es_context* context, es_environment_map* map)
{
    es_environment_tap* taps = es_allocate_array(context, MOST_TAPS, sizeof *taps);
    if (!taps) return es_context_last_result(context);
    for (uint32_t i = 0; i < ES_ENVIRONMENT_LOBES; i++) {
        es_environment_lobe_job job = {.means = &map->means, .taps = taps, .size = lobe_sizes[i], .texels = level_texels(map, &map->lookup.lobes, i + 1)};
        job.tap_count = make_taps(0x1p-4f * (float)(1u << i), lobe_taps[i], map->means.size[0], map->means.levels, taps);
        lobe_loop loop = {es_gi_kernel_table(es_context_isa(context)), &job};
        es_parallel_for(context, job.size, 4, lobe_rows, &loop);
        correct_power(map, job.texels, job.size, 1.0);
    }
    es_release(context, taps, MOST_TAPS * sizeof *taps);
    return ES_OK;
}

/* ---- irradiance --------------------------------------------------------------------------------------------------------------- */

typedef struct source_loop { const es_environment_map* map; es_environment_source* sources; } source_loop;

/* Of SOURCES² cells, rows [begin, end), from the texels of level 0. */
static void source_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const source_loop* loop = user;
    const uint32_t size = (uint32_t)loop->map->means.size[0], side = size / SOURCES;
    const float* base = level_texels(loop->map, &loop->map->means, 0);
    for (uint32_t y = begin * side; y < end * side; y++)
        for (uint32_t x = 0; x < size; x++) {
            const float* texel = base + 4 * ((size_t)(y + 1) * (size + 2) + x + 1);
            const es_vec3 d = es_octahedral_direction(x, y, size);
            es_environment_source* s = &loop->sources[y / side * SOURCES + x / side];
            for (int k = 0; k < 3; k++) {
                const float power = texel[k] * texel[3];
                s->moment[k][0] += power * d.x;
                s->moment[k][1] += power * d.y;
                s->moment[k][2] += power * d.z;
            }
        }
}

typedef struct irradiance_loop { const es_gi_kernels* kernels; const es_environment_irradiance_job* job; } irradiance_loop;
static void irradiance_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const irradiance_loop* loop = user;
    loop->kernels->environment_irradiance(loop->job, begin, end);
}

static es_result make_irradiance(es_context* context, es_environment_map* map)
{
    es_environment_source* sources = es_allocate_zero(context, SOURCES * SOURCES * sizeof *sources);
    if (!sources) return es_context_last_result(context);
    source_loop of_sources = {map, sources};
    es_parallel_for(context, SOURCES, 4, source_rows, &of_sources);
    es_environment_irradiance_job job = {sources, SOURCES * SOURCES, ES_ENVIRONMENT_IRRADIANCE, level_texels(map, &map->lookup.irradiance, 0)};
    irradiance_loop loop = {es_gi_kernel_table(es_context_isa(context)), &job};
    es_parallel_for(context, job.size, 4, irradiance_rows, &loop);
    es_release(context, sources, SOURCES * SOURCES * sizeof *sources);
    correct_power(map, job.texels, job.size, 3.14159265358979323846); /* each direction lights normals by pi in all */
    return ES_OK;
}

/* ---- all of it -------------------------------------------------------------------------------------------------------------------- */

es_result es_environment_map_build(es_context* context, const es_environment_desc* environment, es_environment_map* map)
{
    es_result result = reserve(context, map, base_size(environment));
    memset(map->power, 0, sizeof map->power);
    if (!result) result = make_base(context, environment, map);
    if (!result) make_means(map);
    if (!result) result = make_lobes(context, map);
    if (!result) result = make_irradiance(context, map);
    if (result) es_environment_map_free(context, map);
    return result;
}

void es_environment_ask(const es_context* context, const es_environment_lookup* lookup, const es_environment_question* question)
{
    es_gi_kernel_table(es_context_isa(context))->environment_ask(lookup, question);
}
