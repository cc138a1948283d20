/* Directions towards glowing triangles and the environment, with their densities. */
#include "gi/reference/scene.h"

/* The first index whose running sum exceeds u; u becomes its place within the step. */
static uint32_t find_step(const float* sums, uint32_t count, float* u, float* probability)
{
    uint32_t low = 0, high = count - 1;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        if (*u < sums[middle])
            high = middle;
        else
            low = middle + 1;
    }
    float before = low ? sums[low - 1] : 0.0f;
    *probability = sums[low] - before;
    *u = *probability > 0.0f ? es_clampf((*u - before) / *probability, 0.0f, 0.99999994f) : 0.0f;
    return low;
}

static float environment_share(const es_trace_scene* scene) { return !scene->has_environment ? 0.0f : scene->emitter_count ? 0.5f : 1.0f; }

/* ---- the environment ------------------------------------------------------------------------------------------------------------- */

/* u runs to the right from the middle of the image's back: its middle column looks along -z, right of it is +x. */
static es_vec3 direction_of(const es_trace_scene* scene, float u, float v)
{
    float s, c, sine, cosine;
    es_sincos(ES_PI * v, &s, &c);
    es_sincos(2.0f * ES_PI * (u - 0.5f) - scene->environment.rotation, &sine, &cosine);
    return es_v3(s * sine, c, -s * cosine);
}

static void texel_of(const es_trace_scene* scene, es_vec3 d, uint32_t* x, uint32_t* y)
{
    const es_image* image = scene->environment.image;
    float u = (es_atan2(d.x, -d.z) + scene->environment.rotation) * (0.5f / ES_PI) + 0.5f, v = es_acos(d.y) * (1.0f / ES_PI);
    u = u - es_floor(u);
    *x = (uint32_t)(u * (float)image->width);
    *y = (uint32_t)(v * (float)image->height);
    if (*x >= image->width) *x = image->width - 1;
    if (*y >= image->height) *y = image->height - 1;
}

static es_vec3 texel_radiance(const es_trace_scene* scene, uint32_t x, uint32_t y)
{
    const es_image* image = scene->environment.image;
    const float *p = image->pixels + ((size_t)y * image->width + x) * image->channels, *f = scene->environment.radiance;
    return es_v3(p[0] * f[0], p[1] * f[1], p[2] * f[2]);
}

es_vec3 es_trace_environment(const es_trace_scene* scene, es_vec3 direction)
{
    if (!scene->has_environment) return es_v3(0, 0, 0);
    if (!scene->environment.image) return es_v3(scene->environment.radiance[0], scene->environment.radiance[1], scene->environment.radiance[2]);
    uint32_t x, y;
    texel_of(scene, direction, &x, &y);
    return texel_radiance(scene, x, y);
}

/* Within a texel directions are even in u and v, so the density over the sphere is probability / (2 pi² area in uv, sine). */
static float texel_density(const es_trace_scene* scene, uint32_t x, uint32_t y, float polar_sine)
{
    const es_image* image = scene->environment.image;
    const float *rows = scene->environment_rows, *columns = scene->environment_columns + (size_t)y * image->width;
    float row = rows[y] - (y ? rows[y - 1] : 0.0f), column = columns[x] - (x ? columns[x - 1] : 0.0f);
    return row * column * (float)image->width * (float)image->height / (2.0f * ES_PI * ES_PI * es_maxf(polar_sine, 1e-6f));
}

static float environment_density(const es_trace_scene* scene, es_vec3 d)
{
    if (!scene->environment.image) return 0.25f / ES_PI;
    uint32_t x, y;
    texel_of(scene, d, &x, &y);
    return texel_density(scene, x, y, es_sqrt(es_maxf(1.0f - d.y * d.y, 0.0f)));
}

static bool sample_environment(const es_trace_scene* scene, float u, float v, es_light_sample* sample)
{
    sample->distance = __builtin_inff();
    if (!scene->environment.image) {
        float z = 1.0f - 2.0f * u, r = es_sqrt(es_maxf(1.0f - z * z, 0.0f)), sine, cosine;
        es_sincos(2.0f * ES_PI * v, &sine, &cosine);
        sample->direction = es_v3(r * cosine, z, r * sine);
        sample->density = 0.25f / ES_PI;
        sample->radiance = es_trace_environment(scene, sample->direction);
        return true;
    }
    const es_image* image = scene->environment.image;
    float row, column;
    uint32_t y = find_step(scene->environment_rows, image->height, &v, &row);
    uint32_t x = find_step(scene->environment_columns + (size_t)y * image->width, image->width, &u, &column);
    float polar = ((float)y + v) / (float)image->height;
    sample->direction = direction_of(scene, ((float)x + u) / (float)image->width, polar);
    sample->radiance = texel_radiance(scene, x, y);
    sample->density = texel_density(scene, x, y, es_sin(ES_PI * polar));
    return sample->density > 0.0f;
}

/* ---- glowing triangles --------------------------------------------------------------------------------------------------------------- */

static float mean_strength(const es_trace_scene* scene, uint32_t primitive)
{
    const float* e = scene->materials[scene->instances[es_bvh_primitives(scene->bvh)[primitive].instance].material].emission;
    return 0.2126f * e[0] + 0.7152f * e[1] + 0.0722f * e[2];
}

static bool sample_emitter(const es_trace_scene* scene, es_vec3 point, const float u[3], es_light_sample* sample)
{
    float choice = u[0], probability;
    uint32_t primitive = scene->emitters[find_step(scene->emitter_sums, scene->emitter_count, &choice, &probability)];
    es_vec3 c[3];
    es_bvh_triangle(scene->bvh, primitive, c);
    float root = es_sqrt(u[1]);
    es_hit hit = {0.0f, root * (1.0f - u[2]), root * u[2], primitive};
    if (scene->has_masks && es_trace_is_hole(scene, &hit)) return false;
    es_vec3 p = es_v3_add(es_v3_add(es_v3_scale(c[0], 1.0f - root), es_v3_scale(c[1], hit.u)), es_v3_scale(c[2], hit.v));
    es_vec3 d = es_v3_sub(p, point);
    float distance = es_v3_length(d);
    if (!(distance > 0.0f)) return false;
    sample->direction = es_v3_scale(d, 1.0f / distance);
    sample->distance = distance;
    es_trace_surface s;
    es_trace_surface_at(scene, &hit, es_v3_scale(sample->direction, -1.0f), false, &s);
    sample->radiance = s.emission;
    float cosine = -es_v3_dot(s.geometric, sample->direction);
    sample->density = cosine > 0.0f ? mean_strength(scene, primitive) / (float)scene->emitter_total * distance * distance / cosine : 0.0f;
    return sample->density > 0.0f;
}

bool es_trace_sample_light(const es_trace_scene* scene, es_vec3 point, const float u[3], es_light_sample* sample)
{
    float share = environment_share(scene), v[3] = {u[0], u[1], u[2]};
    bool found;
    if (v[0] < share) {
        found = sample_environment(scene, v[1], v[2], sample);
    } else {
        if (!scene->emitter_count) return false;
        v[0] = es_minf((v[0] - share) / (1.0f - share), 0.99999994f);
        found = sample_emitter(scene, point, v, sample);
        share = 1.0f - share;
    }
    sample->density *= share;
    return found;
}

float es_trace_light_density(const es_trace_scene* scene, es_vec3 direction, float distance, const es_trace_surface* hit)
{
    float share = environment_share(scene);
    if (!hit) return share * environment_density(scene, direction);
    float cosine = -es_v3_dot(hit->geometric, direction);
    if (!scene->emitter_count || !(cosine > 0.0f)) return 0.0f;
    return (1.0f - share) * mean_strength(scene, hit->primitive) / (float)scene->emitter_total * distance * distance / cosine;
}
