/* Where the lights stand; rows for the workers (gi/second_order.h; the sums are in kernels/second_order.c). */
#include "gi/second_order.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "gi/kernels/residual_patch_simd.h"
#include "gi/vpl_sampling.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"

#define INV_PI 0.318309886f
/* Cones that hold fewer of the sphere's points than this have points of their own. */
#define LEAST_SHARE (1.0f / 256.0f)

/* ---- lights ---------------------------------------------------------------------------------------------------------------------- */

/* Point `index` of the sequence on the unit sphere. */
static es_vec3 on_sphere(uint32_t index)
{
    float sine, cosine;
    es_sincos(2.0f * ES_PI * es_halton(0, index), &sine, &cosine);
    const float z = 2.0f * es_halton(1, index) - 1.0f, r = es_sqrt(es_maxf(1.0f - z * z, 0.0f));
    return es_v3(sine * r, cosine * r, z);
}

static es_vec3 in_cone(es_vec3 axis, float cos_outer, uint32_t index)
{
    es_vec3 t, b;
    float sine, cosine;
    es_orthonormal_basis(axis, &t, &b);
    es_sincos(2.0f * ES_PI * es_halton(0, index), &sine, &cosine);
    const float z = 1.0f - (1.0f - cos_outer) * es_halton(1, index), r = es_sqrt(es_maxf(1.0f - z * z, 0.0f));
    return es_v3_add(es_v3_scale(axis, z), es_v3_add(es_v3_scale(t, sine * r), es_v3_scale(b, cosine * r)));
}

/* What the light's view shows in a direction, or at a point of its square; false: nothing. */
static bool look(const es_light_view* view, const es_light_face* face, float x, float y, float solid_angle, es_vpl_record* record)
{
    const es_gbuffer* g = &face->gbuffer;
    const uint32_t last = g->width - 1, column = (uint32_t)es_clampf(x + 0.5f, 0.0f, (float)last), row = (uint32_t)es_clampf(y + 0.5f, 0.0f, (float)last);
    const size_t at = (size_t)row * g->stride + column;
    if (!(g->depth[at] > 0.0f) || g->surface[at] >> 24 == ES_SURFACE_UNLIT) return false;
    const es_vec3 normal = es_unpack_normal(g->normal[at]), position = es_pixel_rays_position(&face->gbuffer_rays, (float)column, (float)row, g->depth[at]);
    const es_vec3 away = view->orthographic ? view->light.direction : es_v3_sub(position, view->light.position);
    const float distance = view->orthographic ? 1.0f : es_v3_length(away);
    const es_vec3 incident = es_v3_normalize(es_v3_scale(away, -1.0f), normal);
    const es_surface surface = es_surface_of_gbuffer(g->albedo_rg[at], g->albedo_b[at], g->surface[at]);
    const float falloff = es_light_falloff(&view->light, es_v3_scale(incident, -1.0f), distance), facing = es_maxf(es_v3_dot(normal, incident), 0.05f);
    const es_vpl_place place = {position, normal, incident, solid_angle * falloff, solid_angle * distance * distance / facing};
    es_vpl_make(view, &place, &surface, false, record);
    return true;
}

static uint32_t place_of_view(const es_light_view* view, uint32_t count, uint32_t seed, es_vpl_record* records)
{
    uint32_t placed = 0;
    if (view->orthographic) {
        const es_pixel_rays* r = &view->faces[0].gbuffer_rays;
        const es_vec3 c = es_v3_cross(es_v3(r->base_dx[0], r->base_dx[1], r->base_dx[2]), es_v3(r->base_dy[0], r->base_dy[1], r->base_dy[2]));
        const float size = (float)view->faces[0].gbuffer.width, area = es_v3_length(c) * size * size / (float)count;
        for (uint32_t i = 0; i < count; i++)
            placed += look(view, &view->faces[0], size * es_halton(0, seed + i + 1) - 0.5f, size * es_halton(1, seed + i + 1) - 0.5f, area, &records[placed]);
        return placed;
    }
    const bool spot = view->light.type == ES_LIGHT_SPOT;
    const float cos_outer = spot ? view->light.cos_outer : -1.0f, share = 0.5f * (1.0f - cos_outer), solid_angle = 4.0f * ES_PI * share / (float)count;
    uint32_t taken = 0;
    for (uint32_t i = 0; taken < count; i++) {
        es_vec3 d;
        if (share < LEAST_SHARE) d = in_cone(view->light.direction, cos_outer, seed + i + 1);
        else {
            d = on_sphere(seed + i + 1);
            /* a share of 1/256 at the least: the sequence comes by before long */
            if (spot && es_v3_dot(d, view->light.direction) < cos_outer) continue;
        }
        taken++;
        for (uint32_t f = 0; f < view->face_count; f++) {
            float x, y, depth;
            if (!es_light_texel_of(view, &view->faces[f], es_v3_add(view->light.position, d), &x, &y, &depth)) continue;
            placed += look(view, &view->faces[f], x, y, solid_angle, &records[placed]);
            break;
        }
    }
    return placed;
}

es_result es_open_lights_place(es_context* context, const es_light_view* views, uint32_t view_count, uint32_t count, uint32_t seed, es_vpl_record* records, uint32_t* placed)
{
    *placed = 0;
    double total = 0.0, sum = 0.0;
    for (uint32_t i = 0; i < view_count; i++) total += (double)views[i].power;
    if (!(total > 0.0)) return ES_OK;
    uint32_t before = 0;
    for (uint32_t i = 0; i < view_count; i++) {
        sum += (double)views[i].power;
        const uint32_t end = i + 1 == view_count ? count : (uint32_t)((double)count * (sum / total) + 0.5);
        if (end > before) *placed += place_of_view(&views[i], end - before, seed, records + *placed);
        before = end > before ? end : before;
    }
    return ES_OK;
}

es_open_light es_open_light_of(const es_vpl_record* v, float spread)
{
    es_open_light light = {.softening = 0.5f * INV_PI * spread * v->area};
    memcpy(light.position, v->position, sizeof light.position);
    memcpy(light.normal, v->normal, sizeof light.normal);
    for (int k = 0; k < 3; k++) light.color[k] = v->flux[k] * INV_PI;
    return light;
}

/* ---- negative lights ----------------------------------------------------------------------------------------------------------------- */

static es_vec3 vector_of(const float v[3]) { return es_v3(v[0], v[1], v[2]); }

static bool try_pixel(const es_negative_job* job, uint32_t index, es_open_light* light)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t x = (uint32_t)(es_halton(0, index) * (float)g->width), y = (uint32_t)(es_halton(1, index) * (float)g->height);
    if (x >= g->width || y >= g->height) return false;
    const size_t at = (size_t)y * g->stride + x;
    const vf depth = vf_set1(g->depth[at]);
    if (!(g->depth[at] > 0.0f)) return false;
    const es_patch_v patch = es_patch_of_pixel_v(&job->rays, es_pixel_area(&job->rays), false, vf_set1((float)x), vf_set1((float)y), depth, vi_set1((int32_t)g->normal[at]), vm_gt(depth, vf_zero()));
    const es_vec3 p = es_v3(patch.x[0], patch.y[0], patch.z[0]), n = es_v3(patch.nx[0], patch.ny[0], patch.nz[0]);
    es_vec3 sum = es_v3(0, 0, 0), direction = es_v3(0, 0, 0);
    for (uint32_t i = 0; i < job->light_count; i++) {
        const es_open_light* l = &job->lights[i];
        const es_vec3 d = es_v3_sub(p, vector_of(l->position));
        const float away = es_v3_dot(n, d), sent = es_v3_dot(vector_of(l->normal), d), d2 = es_v3_dot(d, d);
        if (!(away > 0.0f && sent > 0.0f && d2 > 1e-18f)) continue;
        const float per = 1.0f / (d2 + l->softening), geometry = es_minf((away * per) * (sent * per), job->bound);
        const es_vec3 e = es_v3_scale(vector_of(l->color), geometry);
        sum = es_v3_add(sum, e);
        direction = es_v3_add(direction, es_v3_scale(vector_of(l->normal), e.x + e.y + e.z));
    }
    if (!(sum.x + sum.y + sum.z > 0.0f)) return false;
    direction = es_v3_normalize(direction, n);
    const float area = patch.area[0] * INV_PI;
    *light = (es_open_light){{p.x, p.y, p.z}, {direction.x, direction.y, direction.z}, {sum.x * area, sum.y * area, sum.z * area}, 0.5f * job->spread * area};
    return true;
}

typedef struct try_loop { const es_negative_job* job; es_open_light* tries; } try_loop;

static void try_pixels(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const try_loop* loop = user;
    for (uint32_t i = begin; i < end; i++)
        if (!try_pixel(loop->job, loop->job->seed + i + 1, &loop->tries[i])) loop->tries[i] = (es_open_light){.normal = {0, 0, 0}};
}

void es_negative_lights_place(es_context* context, const es_negative_job* job, es_open_light* tries, es_open_light* lights, uint32_t* placed)
{
    try_loop loop = {job, tries};
    const uint32_t most = ES_NEGATIVE_TRIES * job->count;
    es_parallel_for(context, most, 16, try_pixels, &loop);
    uint32_t used = 0;
    *placed = 0;
    while (used < most && *placed < job->count) {
        const es_open_light* t = &tries[used++];
        if (t->normal[0] != 0.0f || t->normal[1] != 0.0f || t->normal[2] != 0.0f) lights[(*placed)++] = *t;
    }
    /* each stands for as many pixels as there are for a point that was tried */
    const float pixels = used ? (float)job->gbuffer->width * (float)job->gbuffer->height / (float)used : 0.0f;
    for (uint32_t i = 0; i < *placed; i++) {
        for (int k = 0; k < 3; k++) lights[i].color[k] *= pixels;
        lights[i].softening *= pixels;
    }
}

/* ---- rows ------------------------------------------------------------------------------------------------------------------------- */

typedef struct shade_loop { const es_gi_kernels* kernels; const es_open_job* job; } shade_loop;

static void shade_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const shade_loop* loop = user;
    loop->kernels->open_shade(loop->job, begin, end);
}

void es_open_shade(es_context* context, const es_open_job* job)
{
    shade_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 4, shade_rows, &loop);
}

typedef struct upsample_loop { const es_gi_kernels* kernels; const es_open_upsample_job* job; } upsample_loop;

static void upsample_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const upsample_loop* loop = user;
    loop->kernels->open_upsample(loop->job, begin, end);
}

void es_open_upsample(es_context* context, const es_open_upsample_job* job)
{
    upsample_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, upsample_rows, &loop);
}

typedef struct subtract_loop { const es_gbuffer* gbuffer; float* const* a; const float* const* b; } subtract_loop;

static void subtract_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const subtract_loop* loop = user;
    const size_t from = (size_t)begin * loop->gbuffer->stride, to = (size_t)end * loop->gbuffer->stride;
    for (int k = 0; k < 3; k++) {
        float* a = loop->a[k];
        const float* b = loop->b[k];
        for (size_t i = from; i < to; i++) a[i] = -(a[i] < b[i] ? a[i] : b[i]);
    }
}

void es_open_subtract(es_context* context, const es_gbuffer* gbuffer, float* const a[3], const float* const b[3])
{
    subtract_loop loop = {gbuffer, a, b};
    es_parallel_for(context, gbuffer->height, 32, subtract_rows, &loop);
}
