/* Light of a picture on its way into glare and out of it (gi/glare/convolution.h, gi/glare/billboards.h). Any values in, finite light out. */
#include "gi/glare/billboards.h"
#include "gi/glare/convolution.h"
#include "gi/kernel_table.h"
#include "platform/simd.h"

/* By the bits: comparisons of what is no number may trap. */
VINL vm is_finite(vf a) { return ~vi_eq(vi_from_bits(a) & vi_set1(0x7f800000), vi_set1(0x7f800000)); }
/* What of a pixel counts as light. */
VINL vf light_of(vf a) { return vf_min(vf_max(vf_and(is_finite(a), a), vf_zero()), vf_set1(ES_GLARE_MOST)); }

void ES_KERNEL(es_gi_glare_load)(const es_glare_load_job* job, uint32_t row_begin, uint32_t row_end, uint8_t* dark)
{
    for (uint32_t strip = 0; strip < job->to_width / ES_GLARE_STRIP; strip++) dark[strip] = 1;
    for (uint32_t y = row_begin; y < row_end; y++) {
        const float* from = job->from + (size_t)y * job->from_stride;
        float* to = job->to + (size_t)y * job->to_width;
        for (uint32_t x = 0; x < job->to_width; x += VW) {
            if (x >= job->width) {
                vf_store(to + x, vf_zero());
                continue;
            }
            vf light = light_of(vf_load(from + x));
            if (x + VW > job->width) light = vf_and(vm_first((int32_t)(job->width - x)), light);
            vf_store(to + x, light);
            if (vm_any(vm_gt(light, vf_zero()))) dark[x / ES_GLARE_STRIP] = 0;
        }
    }
}

/* Share of the light of pixel x that stays there, of a row whose sums of the spectrum, column by column, are `above` and `below`. */
VINL float stays(const es_glare_finish_job* job, const double* above, const double* below, uint32_t x)
{
    const uint32_t left = x < job->reach_x ? x : job->reach_x, after = x < job->width ? job->width - 1 - x : 0, right = after < job->reach_x ? after : job->reach_x;
    const uint32_t a = job->reach_x - left, b = job->reach_x + right + 1;
    return (float)(1.0 - ((below[b] - above[b]) - (below[a] - above[a])));
}

void ES_KERNEL(es_gi_glare_finish)(const es_glare_finish_job* job, uint32_t row_begin, uint32_t row_end)
{
    const uint32_t columns = 2 * job->reach_x + 2;
    for (uint32_t y = row_begin; y < row_end; y++) {
        const uint32_t up = y < job->reach_y ? y : job->reach_y, after = job->height - 1 - y, down = after < job->reach_y ? after : job->reach_y;
        const double *above = job->prefix + (size_t)(job->reach_y - up) * columns, *below = job->prefix + (size_t)(job->reach_y + down + 1) * columns;
        const vf inside = vf_set1((float)(1.0 - ((below[columns - 1] - above[columns - 1]) - (below[0] - above[0]))));
        for (uint32_t x = 0; x < job->width; x += VW) {
            vf share = inside;
            if (x < job->reach_x || x + VW + job->reach_x > job->width) {
                float shares[VW];
                for (uint32_t k = 0; k < VW; k++) shares[k] = stays(job, above, below, x + k);
                share = vf_load(shares);
            }
            const size_t at = (size_t)y * job->stride + x;
            const vf was = vf_load(job->from + at), spread = vf_load(job->spread + y * job->spread_stride + x);
            vf_store(job->to + at, vf_select(is_finite(was), vf_max(spread + light_of(was) * share, vf_zero()), was));
        }
    }
}

/* ---- billboards ------------------------------------------------------------------------------------------------------------------------- */

VINL vf luminance_of(const vf light[3]) { return vf_set1(0.2126f) * light[0] + vf_set1(0.7152f) * light[1] + vf_set1(0.0722f) * light[2]; }
/* Share of a pixel's light that is above the threshold. */
VINL vf share_above(vf luminance, float threshold)
{
    const vm above = vm_gt(luminance, vf_set1(threshold));
    return vf_and(above, vf_set1(1.0f) - vf_set1(threshold) / vf_select(above, luminance, vf_set1(1.0f)));
}

void ES_KERNEL(es_gi_billboard_tiles)(const es_glare_billboard_job* job, uint32_t begin, uint32_t end)
{
    for (uint32_t line = begin; line < end; line++)
        for (uint32_t column = 0; column < job->tile_columns; column++) {
            es_glare_tile* tile = &job->tiles[(size_t)line * job->tile_columns + column];
            *tile = (es_glare_tile){0};
            vf sums[3] = {vf_zero(), vf_zero(), vf_zero()};
            const uint32_t bottom = (line + 1) * ES_GLARE_TILE < job->height ? (line + 1) * ES_GLARE_TILE : job->height;
            for (uint32_t y = line * ES_GLARE_TILE; y < bottom; y++)
                for (uint32_t x = column * ES_GLARE_TILE; x < (column + 1) * ES_GLARE_TILE && x < job->width; x += VW) {
                    const size_t at = (size_t)y * job->stride + x;
                    vf light[3] = {light_of(vf_load(job->from[0] + at)), light_of(vf_load(job->from[1] + at)), light_of(vf_load(job->from[2] + at))};
                    vf luminance = luminance_of(light);
                    if (x + VW > job->width) luminance = vf_and(vm_first((int32_t)(job->width - x)), luminance);
                    if (!vm_any(vm_gt(luminance, vf_set1(job->threshold)))) continue;
                    const vf share = share_above(luminance, job->threshold);
                    for (int k = 0; k < 3; k++) sums[k] = sums[k] + light[k] * share;
                    for (uint32_t k = 0; k < VW; k++)
                        if (luminance[k] > tile->brightest) {
                            tile->brightest = luminance[k];
                            tile->x = x + k;
                            tile->y = y;
                        }
                }
            for (int k = 0; k < 3; k++) tile->light[k] = vf_sum(sums[k]);
            tile->luminance = 0.2126f * tile->light[0] + 0.7152f * tile->light[1] + 0.0722f * tile->light[2];
        }
}

void ES_KERNEL(es_gi_billboard_rows)(const es_glare_billboard_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_glare_spectrum* s = job->spectrum;
    const size_t middle = s->reach_y * s->stride + s->reach_x;
    for (uint32_t y = row_begin; y < row_end; y++) {
        const es_glare_tile* tiles = job->tiles + (size_t)(y / ES_GLARE_TILE) * job->tile_columns;
        const size_t row = (size_t)y * job->stride;
        for (uint32_t x = 0; x < job->width; x += VW) {
            vf was[3], light[3];
            for (int k = 0; k < 3; k++) {
                was[k] = vf_load(job->from[k] + row + x);
                light[k] = light_of(was[k]);
            }
            const vf share = tiles[x / ES_GLARE_TILE].chosen ? share_above(luminance_of(light), job->threshold) : vf_zero();
            for (int k = 0; k < 3; k++) vf_store(job->to[k] + row + x, vf_select(is_finite(was[k]), light[k] - light[k] * share * vf_set1(1.0f - s->at[k][middle]), was[k]));
        }
        for (uint32_t i = 0; i < job->count; i++) {
            const es_glare_billboard* b = &job->billboards[i];
            if (y + s->reach_y < b->y || y > b->y + s->reach_y) continue;
            const uint32_t begin = b->x < s->reach_x ? 0 : b->x - s->reach_x, end = b->x + s->reach_x + 1 < job->width ? b->x + s->reach_x + 1 : job->width;
            for (int k = 0; k < 3; k++) {
                const float* from = s->at[k] + (y + s->reach_y - b->y) * s->stride + (begin + s->reach_x - b->x);
                float* to = job->to[k] + row + begin;
                /* the middle is what each pixel has kept already */
                const float kept = y == b->y ? to[b->x - begin] : 0.0f;
                const vf light = vf_set1(b->light[k]);
                uint32_t x = 0;
                for (; x + VW <= end - begin; x += VW) vf_store(to + x, vf_load(to + x) + vf_load(from + x) * light);
                for (; x < end - begin; x++) to[x] = to[x] + from[x] * b->light[k];
                if (y == b->y) to[b->x - begin] = kept + b->stays[k];
            }
        }
    }
}
