/* One bounce of light in screen space (gi/screen/screen_bounce.h), eight neighbouring pixels at a time, each with its pattern of places. */
#include "gi/kernel_table.h"
#include "gi/kernels/screen_light_simd.h"
#include "gi/kernels/screen_test_simd.h"
#include "gi/screen/screen_bounce.h"
#include "raster/pack.h"

/* Eight receiving pixels: in the world, and as a view sees them. */
typedef struct receiver {
    vf p[3], n[3];            /* shading normal */
    es_screen_pixel_v pixel;  /* with the triangle's normal */
    vf v[3];                  /* ray of the pixel, per depth */
    vf inverse_depth;
} receiver;

/* Patches are seen at no less than this cosine when their area is found; times the ray's length it is 1 / |n · v| at the most. */
#define LEAST_COSINE 0.1f

/* Is the place q in the open as a view shows it, or where that shows nothing? */
VINL vm shown_by(const es_screen_view* view, const vf q[3])
{
    const vf half = vf_set1(0.5f), depth = es_screen_row_times_v(view->to_depth, q) + vf_set1(view->to_depth[3]), safe = vf_max(depth, vf_set1(1e-20f));
    vf x = es_screen_row_times_v(view->to_x, q) + vf_set1(view->to_x[3]), y = es_screen_row_times_v(view->to_y, q) + vf_set1(view->to_y[3]);
    if (!view->rays.orthographic) {
        x = x / safe;
        y = y / safe;
    }
    const vm inside = vm_gt(depth, vf_set1(1e-20f)) & vm_gt(x, vf_neg(half)) & vm_lt(x, vf_set1((float)view->width - 0.5f)) & vm_gt(y, vf_neg(half)) & vm_lt(y, vf_set1((float)view->height - 0.5f));
    const vi at = vi_truncate(vf_and(inside, y + half)) * vi_set1((int32_t)view->stride) + vi_truncate(vf_and(inside, x + half));
    vm shown = vi_zero();
    for (uint32_t layer = 0; layer < view->layer_count; layer++) {
        const vf d = vf_gather(view->layers[layer]->depth, at);
        shown = shown | (vm_gt(d, vf_zero()) & vm_le(vf_abs(d - depth), d * vf_set1(0.01f)));
    }
    return inside & shown;
}

/* Adds what a view's layer sends from where the places fall. `before`: views whose senders are counted already. */
VINL void add_patches(const es_screen_bounce_job* job, const es_screen_view* view, uint32_t layer, const receiver* r, const es_screen_place_v* at, vf place2, vf inverse_radius2, vf scale,
    const es_view_stack* before, uint32_t before_count, vf sum[3])
{
    const es_gbuffer* g = view->layers[layer];
    const es_pixel_rays* rays = &view->rays;
    const bool orthographic = rays->orthographic;
    const vf zero = vf_zero(), one = vf_set1(1.0f), least = vf_set1(1e-20f);
    const vf found = vf_gather(g->depth, at->at);
    /* of the picture's depth and not much more: what is further is too far away */
    const vf reach = vf_set1(2.0f * job->radius);
    const vm near = at->inside & vm_gt(found, zero) & vm_lt(vf_abs(found - r->pixel.depth), reach);
    if (!vm_any(near)) return;
    const vf d = vf_select(near, found, r->pixel.depth);
    /* what lies in the surface's own plane, which most does, is above or below it by a rounding */
    const vf step = d - r->pixel.depth, x = orthographic ? at->x : at->x * d, y = orthographic ? at->y : at->y * d;
    if (!vm_any(near & vm_gt(step * r->pixel.nv + (x * r->pixel.nx + y * r->pixel.ny), r->pixel.depth * vf_set1(1e-5f)))) return;
    vf rise, distance2 = es_screen_distance2_v(view, &r->pixel, at, d, &rise);
    vm lit = near & vm_gt(rise, r->pixel.depth * vf_set1(1e-5f)) & es_screen_rises_v(rise, distance2) & vm_lt(distance2 * inverse_radius2, one);
    if (!vm_any(lit)) return;
    /* from the pixel to the patch, and the patch's ray */
    vf to[3], v[3], received = zero;
    const float *bx = orthographic ? rays->base_dx : rays->dir_dx, *by = orthographic ? rays->base_dy : rays->dir_dy;
    for (int k = 0; k < 3; k++) {
        to[k] = step * r->v[k] + (x * vf_set1(bx[k]) + y * vf_set1(by[k]));
        v[k] = r->v[k];
        if (!orthographic) v[k] = v[k] + (at->x * vf_set1(bx[k]) + at->y * vf_set1(by[k]));
        received = received + r->n[k] * to[k];
    }
    vf n[3];
    es_unpack_normal_v(vi_gather(g->geometric_normal, at->at), &n[0], &n[1], &n[2]);
    const vf sent = vf_neg(n[0] * to[0] + n[1] * to[1] + n[2] * to[2]), facing = vf_abs(n[0] * v[0] + n[1] * v[1] + n[2] * v[2]);
    lit = lit & vm_gt(received, zero) & vm_gt(sent, zero);
    if (before_count) {
        const vf q[3] = {r->p[0] + to[0], r->p[1] + to[1], r->p[2] + to[2]};
        for (uint32_t i = 0; i < before_count; i++) lit = lit & ~shown_by(&before->views[i], q);
    }
    if (!vm_any(lit)) return;
    vf area = place2 * scale; /* of the disc */
    if (!orthographic) {
        const vf ratio = d * r->inverse_depth;
        area = area * (ratio * ratio);
        place2 = place2 * (ratio * ratio);
    }
    area = area / vf_max(facing, vf_set1(LEAST_COSINE));
    const vf inverse2 = one / vf_max(vf_max(distance2, place2), least), cosines = received * sent * inverse2;
    vf geometry = cosines * inverse2;
    if (job->geometry_bound > 0.0f) geometry = vf_max(geometry - vf_set1(job->geometry_bound), zero);
    const vf weight = vf_and(lit, geometry * area * es_screen_fade_v(distance2, inverse_radius2));
    vf light[3];
    es_unpack_light_v(vi_gather(view->light[layer], at->at), light);
    for (int k = 0; k < 3; k++) sum[k] = sum[k] + weight * light[k];
}

/* As it would lie in another view. */
VINL receiver seen_by(const es_screen_view* view, const receiver* r, const vf triangle[3])
{
    receiver s = *r;
    s.pixel = es_screen_pixel_at_v(view, r->p, triangle);
    for (int k = 0; k < 3; k++) s.v[k] = vf_set1(view->rays.dir[k]) + s.pixel.x * vf_set1(view->rays.dir_dx[k]) + s.pixel.y * vf_set1(view->rays.dir_dy[k]);
    s.inverse_depth = vf_set1(1.0f) / s.pixel.depth;
    return s;
}

/* `simple`: one layer of one view; a constant at every call. */
VINL void bounce_row(const es_screen_bounce_job* job, const es_screen_block* block, uint32_t y, bool simple)
{
    const es_screen_view* view = &job->stack->views[0];
    const es_gbuffer* g = view->layers[0];
    const vf zero = vf_zero(), one = vf_set1(1.0f), inverse_radius2 = vf_set1(1.0f / (job->radius * job->radius));
    const vf scale = vf_set1(2.0f * ES_PI * ES_SCREEN_DISC_LOG / (float)job->samples);
    const uint32_t first = y % job->sets * job->samples;
    for (uint32_t x = block->x0; x < block->x1; x += VW) {
        const size_t at = (size_t)y * g->stride + x;
        const vf depth = vf_load(g->depth + at);
        const vi word = vi_load(g->surface + at);
        const vm seen = vm_gt(depth, zero) & ~vi_eq(vi_shift_right_logical(word, 24), vi_set1(ES_SURFACE_UNLIT)) & vm_first((int32_t)(g->width - x));
        vf sum[3] = {zero, zero, zero};
        if (vm_any(seen)) {
            const vf fx = vf_set1((float)x) + vf_iota(), fy = vf_set1((float)y), d = vf_select(seen, depth, one);
            vf triangle[3];
            receiver receivers[ES_SCREEN_MAX_VIEWS], *r = &receivers[0];
            const vi shading = vi_load(g->normal + at), geometric = vi_load(g->geometric_normal + at);
            es_unpack_normal_v(shading, &r->n[0], &r->n[1], &r->n[2]);
            for (int k = 0; k < 3; k++) triangle[k] = r->n[k];
            if (!vm_all(vi_eq(shading, geometric))) es_unpack_normal_v(geometric, &triangle[0], &triangle[1], &triangle[2]);
            r->pixel = es_screen_pixel_of_v(view, fx, fy, d, triangle);
            r->inverse_depth = one / d;
            for (int k = 0; k < 3; k++) {
                r->v[k] = vf_set1(view->rays.dir[k]) + fx * vf_set1(view->rays.dir_dx[k]) + fy * vf_set1(view->rays.dir_dy[k]);
                r->p[k] = (vf_set1(view->rays.base[k]) + fx * vf_set1(view->rays.base_dx[k]) + fy * vf_set1(view->rays.base_dy[k])) + d * r->v[k];
            }
            for (uint32_t v = 1; v < job->stack->view_count && !simple; v++) receivers[v] = seen_by(&job->stack->views[v], r, triangle);
            const uint32_t column = x % job->sets;
            for (uint32_t v = 0; v < (simple ? 1 : job->stack->view_count); v++) {
                const es_screen_view* shown = &job->stack->views[v];
                for (uint32_t i = 0; i < job->samples; i++) {
                    const es_bounce_sample* s = &job->table[v][first + i];
                    const vf offset[3] = {vf_load(s->step[0] + column), vf_load(s->step[1] + column), zero};
                    const es_screen_place_v place = es_screen_place_of_v(shown, &receivers[v].pixel, offset);
                    for (uint32_t layer = 0; layer < (simple ? 1 : shown->layer_count); layer++)
                        if (shown->light[layer]) add_patches(job, shown, layer, &receivers[v], &place, vf_load(s->distance2 + column), inverse_radius2, scale, job->stack, simple ? 0 : v, sum);
                }
            }
        }
        for (int k = 0; k < 3; k++) vf_store(job->irradiance[k] + at, vf_and(seen, sum[k]));
    }
}

void ES_KERNEL(es_gi_screen_bounce)(const es_screen_bounce_job* job, const es_screen_block* block)
{
    const bool simple = job->stack->view_count == 1 && job->stack->views[0].layer_count == 1;
    for (uint32_t y = block->y0; y < block->y1; y++) {
        if (simple) bounce_row(job, block, y, true);
        else bounce_row(job, block, y, false);
    }
}

/* ---- what senders send, and what receivers reflect ------------------------------------------------------------------------- */

/* Share of light that the diffuse part reflects, over pi. */
VINL void diffuse_of(const es_gbuffer* g, size_t at, vf share[3])
{
    const vi rg = vi_load(g->albedo_rg + at), b = vi_load(g->albedo_b + at), word = vi_load(g->surface + at), model = vi_shift_right_logical(word, 24);
    const vm unlit = vi_eq(model, vi_set1(ES_SURFACE_UNLIT)) | vm_le(vf_load(g->depth + at), vf_zero());
    const vf metallic = vf_from_int(word & vi_set1(0xff)) * vf_set1(1.0f / 255.0f), diffuse = vf_and(~unlit, vf_set1(0.318309886f) * (vf_set1(1.0f) - metallic));
    share[0] = es_unpack_unorm16_v(rg) * diffuse;
    share[1] = es_unpack_unorm16_v(vi_shift_right_logical(rg, 16)) * diffuse;
    share[2] = es_unpack_unorm16_v(b) * diffuse;
}

void ES_KERNEL(es_gi_screen_light)(const es_screen_light_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < g->width; x += VW) {
            const size_t at = (size_t)y * g->stride + x;
            vf c[3] = {vf_zero(), vf_zero(), vf_zero()}, share[3];
            if (job->emission) es_unpack_rgb9e5_v(vi_load(g->emission + at), &c[0], &c[1], &c[2]);
            if (job->lamp_irradiance[0]) diffuse_of(g, at, share);
            for (int k = 0; k < 3; k++) {
                if (job->direct[k]) c[k] = c[k] + vf_load(job->direct[k] + at);
                if (job->lamp_irradiance[k]) c[k] = c[k] + share[k] * vf_load(job->lamp_irradiance[k] + at);
            }
            vi_store(job->light + at, es_pack_light_v(c));
        }
}

void ES_KERNEL(es_gi_screen_reflect)(const es_screen_reflect_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < g->width; x += VW) {
            const size_t at = (size_t)y * g->stride + x;
            vf share[3];
            diffuse_of(g, at, share);
            for (int k = 0; k < 3; k++) vf_store(job->radiance[k] + at, share[k] * vf_load(job->irradiance[k] + at));
        }
}

/* Both normals of what is seen, the other way round. */
void ES_KERNEL(es_gi_turn_normals)(const es_gbuffer* g, uint32_t row_begin, uint32_t row_end)
{
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < g->width; x += VW) {
            const size_t at = (size_t)y * g->stride + x;
            uint32_t* const planes[2] = {g->normal + at, g->geometric_normal + at};
            const vm seen = vm_gt(vf_load(g->depth + at), vf_zero());
            for (int i = 0; i < 2; i++) {
                vf n[3];
                es_unpack_normal_v(vi_load(planes[i]), &n[0], &n[1], &n[2]);
                vi_store(planes[i], seen & es_pack_normal_v(vf_neg(n[0]), vf_neg(n[1]), vf_neg(n[2])));
            }
        }
}
