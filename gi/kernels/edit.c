/* Edited directions, eight pixels at a time (gi/edit/edit.h). */
#include "gi/edit/edit.h"
#include "gi/kernel_table.h"
#include "gi/kernels/edit_influence_simd.h"
#include "gi/kernels/rotation_simd.h"
#include "platform/simd.h"
#include "raster/pack.h"

typedef struct edit_pixels { vm seen; vf p[3], r[3]; vi instance, triangle; } edit_pixels;

VINL void normalise(vf a[3])
{
    const vf inverse = vf_set1(1.0f) / vf_sqrt(vf_max(a[0] * a[0] + a[1] * a[1] + a[2] * a[2], vf_set1(1e-30f)));
    for (int k = 0; k < 3; k++) a[k] = a[k] * inverse;
}

VINL edit_pixels load_pixels(const es_edit_job* job, uint32_t x, uint32_t y)
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* rays = &job->rays;
    const size_t at = (size_t)y * g->stride + x;
    edit_pixels pixels;
    const vf depth = vf_load(g->depth + at), fx = vf_set1((float)x) + vf_iota();
    pixels.seen = vm_gt(depth, vf_zero()) & vm_first((int32_t)(g->width - x));
    pixels.instance = vi_load(g->instance + at);
    pixels.triangle = vi_load(g->triangle + at) - vi_set1(1);
    vf d[3];
    for (int k = 0; k < 3; k++) {
        d[k] = vf_set1(rays->dir[k] + (float)y * rays->dir_dy[k]) + fx * vf_set1(rays->dir_dx[k]);
        pixels.p[k] = vf_set1(rays->base[k] + (float)y * rays->base_dy[k]) + fx * vf_set1(rays->base_dx[k]) + depth * d[k];
    }
    if (job->original[0]) {
        for (int k = 0; k < 3; k++) pixels.r[k] = vf_load(job->original[k] + at);
        const vf square = pixels.r[0] * pixels.r[0] + pixels.r[1] * pixels.r[1] + pixels.r[2] * pixels.r[2];
        pixels.seen = pixels.seen & vm_gt(square, vf_zero());
        return pixels;
    }
    if (job->frozen)
        for (int k = 0; k < 3; k++) d[k] = pixels.p[k] - vf_set1(job->eye[k]);
    normalise(d);
    vf n[3];
    es_unpack_normal_v(vi_load(g->normal + at), &n[0], &n[1], &n[2]);
    const vf twice = vf_set1(2.0f) * (d[0] * n[0] + d[1] * n[1] + d[2] * n[2]); /* eq. 7.1 */
    for (int k = 0; k < 3; k++) pixels.r[k] = d[k] - twice * n[k];
    return pixels;
}

/* R of one region. */
VINL es_matrix3_v region_rotation(const es_edit_region* region, const edit_pixels* pixels, const es_edit_place_v* place)
{
    const vf per = vf_set1(1.0f / (region->radius * region->radius)), one = vf_set1(1.0f);
    es_matrix3_v sum;
    for (int i = 0; i < 9; i++) sum.at[i] = vf_zero();
    for (uint32_t n = 0; n < region->constraint_count; n++) {
        const es_edit_constraint* c = &region->constraints[n];
        const vf at[3] = {vf_set1(c->position[0]), vf_set1(c->position[1]), vf_set1(c->position[2])};
        vf square = es_edit_square_v(pixels->p, at);
        if (c->distances) square = vf_select(place->lanes, es_edit_geodesic_square_v(place, c->distances), square);
        const vf weight = one / (vf_min(square * per, vf_set1(1e12f)) + vf_set1(1e-12f));
        for (int i = 0; i < 9; i++) sum.at[i] = sum.at[i] + weight * vf_set1(c->matrix[i]);
    }
    return es_nearest_rotation_v(&sum);
}

/* The sum over regions of a R, and of a, so far. */
typedef struct edit_sum { es_matrix3_v rotation; vf share; } edit_sum;

VINL void add_region(const es_edit_region* region, const edit_pixels* pixels, edit_sum* sum)
{
    const vf ball[3] = {vf_set1(region->ball[0]), vf_set1(region->ball[1]), vf_set1(region->ball[2])};
    vm lanes = pixels->seen & vm_le(es_edit_square_v(pixels->p, ball), vf_set1(region->ball[3]));
    if (region->instance) lanes = lanes & vi_eq(pixels->instance, vi_set1((int32_t)region->instance));
    if (!vm_any(lanes)) return;
    es_edit_place_v place = {.lanes = vi_zero()};
    if (region->mesh.positions) place = es_edit_place_of_v(&region->mesh, lanes & vi_eq(pixels->instance, vi_set1((int32_t)region->mesh.instance)), pixels->triangle, pixels->p);
    const vf influence = es_edit_influence_v(region, lanes, pixels->p, &place);
    if (!vm_any(vm_gt(influence, vf_zero()))) return;
    const es_matrix3_v rotation = region_rotation(region, pixels, &place);
    for (int i = 0; i < 9; i++) sum->rotation.at[i] = sum->rotation.at[i] + influence * rotation.at[i];
    sum->share = sum->share + influence;
}

VINL void edit_pixels_of(const es_edit_job* job, uint32_t x, uint32_t y)
{
    const size_t at = (size_t)y * job->gbuffer->stride + x;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const edit_pixels pixels = load_pixels(job, x, y);
    edit_sum sum = {.share = zero};
    for (int i = 0; i < 9; i++) sum.rotation.at[i] = zero;
    if (vm_any(pixels.seen))
        for (uint32_t i = 0; i < job->region_count; i++) add_region(&job->regions[i], &pixels, &sum);
    const vm edited = vm_gt(sum.share, zero);
    vf e[3];
    for (int k = 0; k < 3; k++) e[k] = vf_and(pixels.seen & vi_set1(job->frozen ? -1 : 0), pixels.r[k]);
    if (vm_any(edited)) {
        es_matrix3_v rotation = sum.rotation;
        /* one region's middle needs no second decomposition: the sum is its rotation to the bit */
        const vm whole = ~edited | vm_eq(sum.share, one);
        if (!vm_all(whole)) {
            const vf rest = vf_max(one - sum.share, zero);
            es_matrix3_v blended = sum.rotation;
            for (int i = 0; i < 3; i++)
                for (int k = 0; k < 3; k++) blended.at[3 * i + k] = blended.at[3 * i + k] + rest * pixels.r[i] * pixels.r[k];
            blended = es_nearest_rotation_v(&blended);
            for (int i = 0; i < 9; i++) rotation.at[i] = vf_select(whole, rotation.at[i], blended.at[i]);
        }
        vf turned[3];
        es_matrix3_apply_v(&rotation, pixels.r, turned);
        normalise(turned);
        for (int k = 0; k < 3; k++) e[k] = vf_select(edited, turned[k], e[k]);
    }
    for (int k = 0; k < 3; k++) vf_store(job->edited[k] + at, e[k]);
}

void ES_KERNEL(es_gi_edit_directions)(const es_edit_job* job, uint32_t row_begin, uint32_t row_end)
{
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < job->gbuffer->width; x += VW) edit_pixels_of(job, x, y);
}
