/* From every second pixel to all of them, along surfaces (gi/half_resolution.h). */
#include "gi/half_resolution.h"
#include "gi/kernel_table.h"
#include "platform/simd.h"
#include "raster/pack.h"

/* Eight pixels from x on, a multiple of eight, have their left and right neighbours among the smaller image's columns x/2 … x/2 + 4. */
typedef struct columns { vi left, right; bool inner; uint32_t first; } columns;

VINL void take(const float* row, const columns* c, vf* left, vf* right)
{
    if (c->inner) {
        vf a = vf_load(row + c->first);
        *left = __builtin_shufflevector(a, a, 0, 0, 1, 1, 2, 2, 3, 3);
        *right = __builtin_shufflevector(a, a, 0, 1, 1, 2, 2, 3, 3, 4);
    } else {
        *left = vf_gather(row, c->left);
        *right = vf_gather(row, c->right);
    }
}

VINL void take_words(const uint32_t* row, const columns* c, vi* left, vi* right)
{
    if (c->inner) {
        vi a = vi_load(row + c->first);
        *left = __builtin_shufflevector(a, a, 0, 0, 1, 1, 2, 2, 3, 3);
        *right = __builtin_shufflevector(a, a, 0, 1, 1, 2, 2, 3, 3, 4);
    } else {
        *left = vi_gather(row, c->left);
        *right = vi_gather(row, c->right);
    }
}

/* `planes` is a constant at every call */
VINL void upsample_row(const es_upsample_job* job, uint32_t y, uint32_t planes)
{
    const es_gbuffer *g = job->gbuffer, *half = job->half;
    const vf zero = vf_zero(), one = vf_set1(1.0f), normal_threshold = vf_set1(job->normal_threshold);
    /* a threshold of zero lets nothing but equals count, and then the distances below are infinite, which compares as it should */
    const vf per_depth = vf_set1(1.0f / (job->depth_threshold > 1e-6f ? job->depth_threshold : 1e-6f)), per_normal = vf_set1(1.0f / (1.0f - job->normal_threshold > 1e-6f ? 1.0f - job->normal_threshold : 1e-6f));
    const uint32_t upper = y / 2, lower = (y + 1) / 2 < half->height ? (y + 1) / 2 : half->height - 1;
    for (uint32_t x = 0; x < g->width; x += VW) {
        const size_t at = (size_t)y * g->stride + x;
        vf depth = vf_load(g->depth + at);
        vm seen = vm_gt(depth, zero);
        vf sum[6];
        for (uint32_t k = 0; k < planes; k++) sum[k] = zero;
        if (vm_any(seen)) {
            vf nx, ny, nz, count = zero, best = vf_set1(3e38f);
            es_unpack_normal_v(vi_load(g->normal + at), &nx, &ny, &nz);
            vf limit = depth * vf_set1(job->depth_threshold), inverse = per_depth / vf_select(seen, depth, one);
            vi whole = vi_iota() + vi_set1((int32_t)x), last = vi_set1((int32_t)half->width - 1);
            const columns c = {vi_min(vi_shift_right_logical(whole, 1), last), vi_min(vi_shift_right_logical(whole + vi_set1(1), 1), last), x / 2 + VW <= half->width, x / 2};
            const size_t rows[2] = {(size_t)upper * half->stride, (size_t)lower * half->stride};
            vm counts[4];
            vi nearest = vi_zero();
            for (int i = 0; i < 4; i += 2) {
                vf depths[2];
                vi words[2];
                take(half->depth + rows[i / 2], &c, &depths[0], &depths[1]);
                take_words(half->normal + rows[i / 2], &c, &words[0], &words[1]);
                for (int j = 0; j < 2; j++) {
                    vf tx, ty, tz, difference = vf_abs(depths[j] - depth);
                    es_unpack_normal_v(words[j], &tx, &ty, &tz);
                    vf dot = nx * tx + ny * ty + nz * tz;
                    /* where nothing is seen there is no light to take: next to a far wall it would count as near */
                    vm there = vm_gt(depths[j], zero);
                    counts[i + j] = there & vm_ge(dot, normal_threshold) & vm_le(difference, limit);
                    count = count + vf_and(counts[i + j], one);
                    vf distance = difference * inverse + (one - dot) * per_normal;
                    vm nearer = there & vm_lt(distance, best);
                    best = vf_select(nearer, distance, best);
                    nearest = vi_select(nearer, vi_set1(i + j), nearest);
                }
            }
            /* none like it: the least unlike of those seen; without any it stays dark, for planes hold anything where nothing is seen */
            vm alone = vm_eq(count, zero) & vm_lt(best, vf_set1(3e38f));
            for (int i = 0; i < 4; i++) counts[i] |= alone & vi_eq(nearest, vi_set1(i));
            vf share = one / vf_max(count, one);
            for (int i = 0; i < 4; i += 2)
                for (uint32_t k = 0; k < planes; k++) {
                    vf left, right;
                    take(job->source[k] + rows[i / 2], &c, &left, &right);
                    sum[k] = sum[k] + vf_and(counts[i], left);
                    sum[k] = sum[k] + vf_and(counts[i + 1], right);
                }
            for (uint32_t k = 0; k < planes; k++) sum[k] = vf_and(seen, sum[k] * share);
        }
        for (uint32_t k = 0; k < planes; k++) vf_store(job->result[k] + at, sum[k]);
    }
}

void ES_KERNEL(es_gi_upsample)(const es_upsample_job* job, uint32_t row_begin, uint32_t row_end)
{
    for (uint32_t y = row_begin; y < row_end; y++) {
        if (job->plane_count == 3) upsample_row(job, y, 3);
        else if (job->plane_count == 6) upsample_row(job, y, 6);
        else upsample_row(job, y, job->plane_count);
    }
}
