/* Triangles to records: eight at a time.
 *
 * Dropped are: wholly outside one plane of the frustum, zero area, facing away, covering no pixel centre. What crosses the near
 * plane or the guard band goes through es_clip_triangle; the rest becomes a small or a large record, with positive area.
 */
#include "raster/kernel_table.h"
#include "platform/simd.h"

typedef double vd4_ __attribute__((vector_size(32)));
typedef int64_t vl4_ __attribute__((vector_size(32)));

typedef struct triangle8 { vi x[3], y[3], flags[3]; vf z[3]; } triangle8;

/* -1, 0 or 1 per lane: the sign of (x1 - x0)(y2 - y0) - (x2 - x0)(y1 - y0); products reach 2^44, exact in double */
static inline vi area_sign(vi ax, vi ay, vi bx, vi by)
{
    union { vi v; vi4_ h[2]; } a = {.v = ax}, b = {.v = ay}, c = {.v = bx}, d = {.v = by}, sign;
    for (int h = 0; h < 2; h++) {
        vd4_ p = __builtin_convertvector(a.h[h], vd4_) * __builtin_convertvector(d.h[h], vd4_);
        vd4_ q = __builtin_convertvector(c.h[h], vd4_) * __builtin_convertvector(b.h[h], vd4_);
        vl4_ s = (p < q) - (p > q);
        sign.h[h] = __builtin_convertvector(s, vi4_);
    }
    return sign.v;
}

void ES_KERNEL(es_bin_triangles)(es_bin_job* job)
{
    const es_prepared_instance* instance = job->instance;
    /* the centre of pixel (0, 0) */
    vi ox = vi_set1(ES_SUBPIXELS / 2 - (int32_t)job->width * (ES_SUBPIXELS / 2)), oy = vi_set1(ES_SUBPIXELS / 2 - (int32_t)job->height * (ES_SUBPIXELS / 2));
    vi last_x = vi_set1((int32_t)job->width - 1), last_y = vi_set1((int32_t)job->height - 1);
    vm cull_positive = instance->cull_positive ? vm_all_lanes() : vi_zero(), cull_negative = instance->cull_negative ? vm_all_lanes() : vi_zero();
    vi small_limit = job->all_large ? vi_set1(-1) : vi_set1(ES_SMALL_WIDTH);
    for (uint32_t first = 0; first < job->count; first += VW) {
        uint32_t n = job->count - first < VW ? job->count - first : VW;
        vm active = vm_first((int32_t)n);
        vi triangle = vi_set1((int32_t)first) + (active & vi_iota());
        vi index[3], next;
        /* offsets are multiplied by the stride here, in one go: lane by lane it costs eight shifts a gather */
        vi_gather4(job->indices, 1, triangle * vi_set1(12), &index[0], &index[1], &index[2], &next);
        triangle8 t;
        for (int k = 0; k < 3; k++) {
            vi z;
            vi_gather4(job->vertices, 1, index[k] << 4, &t.x[k], &t.y[k], &z, &t.flags[k]);
            t.z[k] = vf_from_bits(z);
        }
        vi any = t.flags[0] | t.flags[1] | t.flags[2], all = t.flags[0] & t.flags[1] & t.flags[2];
        vm seen = active & vi_eq((all & vi_set1(ES_OUT_REJECT)) | (any & vi_set1(ES_OUT_BAD)), vi_zero());
        vm clip = seen & vi_gt(any & vi_set1(ES_OUT_CLIP), vi_zero());
        vi sign = area_sign(t.x[1] - t.x[0], t.y[1] - t.y[0], t.x[2] - t.x[0], t.y[2] - t.y[0]);
        vm negative = vi_lt(sign, vi_zero());
        vm draw = seen & ~clip & ~vi_eq(sign, vi_zero()) & ~(negative & cull_negative) & ~(vi_gt(sign, vi_zero()) & cull_positive);
        vi x_low = vi_min(vi_min(t.x[0], t.x[1]), t.x[2]), x_high = vi_max(vi_max(t.x[0], t.x[1]), t.x[2]);
        vi y_low = vi_min(vi_min(t.y[0], t.y[1]), t.y[2]), y_high = vi_max(vi_max(t.y[0], t.y[1]), t.y[2]);
        /* first and last pixel centre in [low, high): the right and bottom ends belong to the neighbours */
        vi px0 = vi_max((x_low - ox + vi_set1(255)) >> ES_SUBPIXEL_BITS, vi_zero()), px1 = vi_min((x_high - ox - vi_set1(1)) >> ES_SUBPIXEL_BITS, last_x);
        vi py0 = vi_max((y_low - oy + vi_set1(255)) >> ES_SUBPIXEL_BITS, vi_zero()), py1 = vi_min((y_high - oy - vi_set1(1)) >> ES_SUBPIXEL_BITS, last_y);
        draw &= ~(vi_gt(px0, px1) | vi_gt(py0, py1));
        uint32_t draw_bits = vm_bits(draw), clip_bits = vm_bits(clip);
        job->culled += n - (uint32_t)__builtin_popcount(draw_bits | clip_bits);
        if (draw_bits) {
            vi x1 = vi_select(negative, t.x[2], t.x[1]), x2 = vi_select(negative, t.x[1], t.x[2]);
            vi y1 = vi_select(negative, t.y[2], t.y[1]), y2 = vi_select(negative, t.y[1], t.y[2]);
            vf z1 = vf_select(negative, t.z[2], t.z[1]), z2 = vf_select(negative, t.z[1], t.z[2]);
            vi id = vi_set1((int32_t)(job->first_id + first)) + vi_iota();
            vi rect = (px0 >> ES_TILE_BITS) | ((py0 >> ES_TILE_BITS) << 8) | ((px1 >> ES_TILE_BITS) << 16) | ((py1 >> ES_TILE_BITS) << 24);
            uint32_t rects[VW];
            memcpy(rects, &rect, sizeof rects);
            vm small = draw & ~vi_gt(x_high - x_low, small_limit) & ~vi_gt(y_high - y_low, vi_set1(ES_SMALL_HEIGHT));
            uint32_t small_bits = vm_bits(small);
            if (small_bits) {
                vi cx = (px0 << ES_SUBPIXEL_BITS) + ox, cy = (py0 << ES_SUBPIXEL_BITS) + oy, low = vi_set1(0xffff);
                float words[2][4 * VW];
                vf_store4(words[0], vf_from_bits(((t.x[0] - cx) & low) | ((t.y[0] - cy) << 16)), vf_from_bits(((x1 - cx) & low) | ((y1 - cy) << 16)),
                    vf_from_bits(((x2 - cx) & low) | ((y2 - cy) << 16)), vf_from_bits(px0 | (py0 << 16)));
                vf_store4(words[1], vf_from_bits(id), t.z[0], z1, z2);
                for (uint32_t bits = small_bits; bits; bits &= bits - 1) {
                    uint32_t lane = (uint32_t)__builtin_ctz(bits);
                    char* record = (char*)&job->small[job->small_count];
                    memcpy(record, &words[0][4 * lane], 16);
                    memcpy(record + 16, &words[1][4 * lane], 16);
                    memcpy(&job->small_rects[job->small_count++], &rects[lane], 4);
                }
            }
            if (draw_bits & ~small_bits) {
                float words[3][4 * VW];
                vf_store4(words[0], vf_from_bits(t.x[0]), vf_from_bits(t.y[0]), vf_from_bits(x1), vf_from_bits(y1));
                vf_store4(words[1], vf_from_bits(x2), vf_from_bits(y2), t.z[0], z1);
                vf_store4(words[2], z2, vf_from_bits(id), vf_zero(), vf_zero());
                for (uint32_t bits = draw_bits & ~small_bits; bits; bits &= bits - 1) {
                    uint32_t lane = (uint32_t)__builtin_ctz(bits);
                    char* record = (char*)&job->large[job->large_count];
                    for (int k = 0; k < 3; k++) memcpy(record + 16 * k, &words[k][4 * lane], 16);
                    memcpy(&job->large_rects[job->large_count++], &rects[lane], 4);
                }
            }
        }
        for (; clip_bits; clip_bits &= clip_bits - 1) es_clip_triangle(job, first + (uint32_t)__builtin_ctz(clip_bits));
    }
}
