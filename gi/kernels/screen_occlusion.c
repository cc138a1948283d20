/* Which share of the surroundings' light arrives at each pixel (gi/screen/directional_occlusion.h): eight neighbours at a time, each with its pattern.
 *
 * Directions of a pattern are the world's, not the surface's: turned round where they lie below it. So a sample's step in the picture and its light are
 * constants, and a sample costs one division and one look-up. */
#include "gi/kernel_table.h"
#include "gi/kernels/screen_test_simd.h"
#include "gi/screen/directional_occlusion.h"
#include "raster/pack.h"

/* Bits of the sign where a lane's direction is to be turned. */
VINL vf turned(vf a, vi sign) { return vf_from_bits(vi_from_bits(a) ^ sign); }

/* By one layer of one view, by all of its layers, or by all. */
VINL vf blocked_at(const es_occlusion_job* job, const es_screen_pixel_v* pixels, uint32_t record, uint32_t column, vi sign, vf inverse_radius2, bool simple, bool single)
{
    vf most = vf_zero();
    vm free = vi_zero();
    const uint32_t views = single ? 1 : job->stack->view_count;
    for (uint32_t v = 0; v < views; v++) {
        const es_sample_offset* o = &job->offsets[v][record];
        const vf offset[3] = {turned(vf_load(o->window[0] + column), sign), turned(vf_load(o->window[1] + column), sign), turned(vf_load(o->window[2] + column), sign)};
        vm here;
        most = vf_max(most, es_screen_blocked_v(&job->stack->views[v], &pixels[v], offset, inverse_radius2, simple, &here));
        free = free | here;
    }
    /* what any view shows to be in the open is not inside of anything */
    return views == 1 ? most : vf_and(~free, most);
}

/* The three switches are constants at every call. `single`: one view; `simple`: of one layer. */
VINL void occlude_row(const es_occlusion_job* job, const es_screen_block* block, uint32_t y, bool simple, bool single, bool directional)
{
    const es_screen_view* view = &job->stack->views[0];
    const es_gbuffer* g = view->layers[0];
    const vf zero = vf_zero(), one = vf_set1(1.0f), inverse_radius2 = vf_set1(1.0f / (job->radius * job->radius));
    const uint32_t first = y % job->sets * job->samples;
    for (uint32_t x = block->x0; x < block->x1; x += VW) {
        const size_t at = (size_t)y * g->stride + x;
        const vf depth = vf_load(g->depth + at);
        const vm seen = vm_gt(depth, zero) & vm_first((int32_t)(g->width - x));
        if (!vm_any(seen)) {
            for (int k = 0; k < (directional ? 3 : 1); k++) vf_store(job->share[k] + at, one);
            continue;
        }
        const vi shading = vi_load(g->normal + at), geometric = vi_load(g->geometric_normal + at);
        const vf fx = vf_set1((float)x) + vf_iota(), fy = vf_set1((float)y), d = vf_select(seen, depth, one);
        vf n[3], t[3];
        es_unpack_normal_v(shading, &n[0], &n[1], &n[2]);
        for (int k = 0; k < 3; k++) t[k] = n[k];
        if (!vm_all(vi_eq(shading, geometric))) es_unpack_normal_v(geometric, &t[0], &t[1], &t[2]);
        es_screen_pixel_v pixels[ES_SCREEN_MAX_VIEWS];
        pixels[0] = es_screen_pixel_of_v(view, fx, fy, d, t);
        for (uint32_t v = 1; !single && v < job->stack->view_count; v++) {
            const es_screen_view* other = &job->stack->views[v];
            vf p[3], base[3], dir[3];
            for (int k = 0; k < 3; k++) {
                base[k] = vf_set1(view->rays.base[k]) + fx * vf_set1(view->rays.base_dx[k]) + fy * vf_set1(view->rays.base_dy[k]);
                dir[k] = vf_set1(view->rays.dir[k]) + fx * vf_set1(view->rays.dir_dx[k]) + fy * vf_set1(view->rays.dir_dy[k]);
                p[k] = base[k] + d * dir[k];
            }
            pixels[v] = es_screen_pixel_at_v(other, p, t);
        }
        vf hidden[3] = {zero, zero, zero}, all[3] = {zero, zero, zero};
        const uint32_t column = x % job->sets;
        for (uint32_t i = 0; i < job->samples; i++) {
            const es_occlusion_sample* s = &job->table[first + i];
            const vf cosine = n[0] * vf_load(s->direction[0] + column) + n[1] * vf_load(s->direction[1] + column) + n[2] * vf_load(s->direction[2] + column);
            const vi sign = vi_from_bits(cosine) & vi_set1(INT32_MIN);
            const vf c = vf_abs(cosine), blocked = blocked_at(job, pixels, first + i, column, sign, inverse_radius2, simple, single);
            const bool any = vm_any(vm_gt(blocked, zero));
            if (!directional) {
                all[0] = all[0] + c;
                if (any) hidden[0] = hidden[0] + c * blocked;
                continue;
            }
            const vm below = vi_lt(sign, vi_zero());
            vf light[3];
            for (int k = 0; k < 3; k++) {
                light[k] = c * vf_select(below, vf_load(s->light[1][k] + column), vf_load(s->light[0][k] + column));
                all[k] = all[k] + light[k];
            }
            for (int k = 0; k < 3 && any; k++) hidden[k] = hidden[k] + light[k] * blocked;
        }
        for (int k = 0; k < (directional ? 3 : 1); k++) {
            const vm lit = seen & vm_gt(all[k], vf_set1(1e-20f));
            vf_store(job->share[k] + at, vf_max(one - vf_and(lit, hidden[k]) / vf_select(lit, all[k], one), zero));
        }
    }
}

void ES_KERNEL(es_gi_screen_occlusion)(const es_occlusion_job* job, const es_screen_block* block)
{
    const bool single = job->stack->view_count == 1, simple = single && job->stack->views[0].layer_count == 1;
    for (uint32_t y = block->y0; y < block->y1; y++) {
        if (simple && job->directional) occlude_row(job, block, y, true, true, true);
        else if (simple) occlude_row(job, block, y, true, true, false);
        else if (single) occlude_row(job, block, y, false, true, job->directional);
        else occlude_row(job, block, y, false, false, job->directional);
    }
}
