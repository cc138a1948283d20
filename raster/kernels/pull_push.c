/* Fills the holes of a parabolic map and removes what shines through between its points (raster/points.h).
 *
 * Sixteen texels a step. The margins of the coarse levels, and what lies right of a level narrower than sixteen texels, are
 * EMPTY and stay so: four EMPTY texels pull to EMPTY, and nothing is within a threshold of EMPTY but EMPTY. So no border needs a
 * case of its own.
 */
#include "raster/kernel_table.h"
#include "raster/points.h"
#include "platform/simd16.h"

typedef struct level { uint16_t* texels; uint32_t stride, width, height; } level;

static uint16_t threshold(uint32_t at_level_0, uint32_t l)
{
    uint64_t scaled = (uint64_t)at_level_0 << l;
    return (uint16_t)(scaled < ES_PARABOLIC_THRESHOLD_MAX ? scaled : ES_PARABOLIC_THRESHOLD_MAX);
}

static void pull(const level* fine, const level* coarse, uint16_t limit)
{
    const vh near = vh_set1(limit);
    for (uint32_t y = 0; y < coarse->height; y++) {
        const uint16_t* row0 = fine->texels + (size_t)(2 * y) * fine->stride;
        const uint16_t* row1 = row0 + fine->stride;
        uint16_t* result = coarse->texels + (size_t)y * coarse->stride;
        for (uint32_t x = 0; x < coarse->width; x += VHW) {
            vh a, b, c, d;
            vh_split(vh_load(row0 + 2 * x), vh_load(row0 + 2 * x + VHW), &a, &b);
            vh_split(vh_load(row1 + 2 * x), vh_load(row1 + 2 * x + VHW), &c, &d);
            vh nearest = vh_min(vh_min(a, b), vh_min(c, d));
            a -= nearest;
            b -= nearest;
            c -= nearest;
            d -= nearest;
            vh in_a = vh_le(a, near), in_b = vh_le(b, near), in_c = vh_le(c, near), in_d = vh_le(d, near);
            /* at most three of them, each at most THRESHOLD_MAX: below 2^16. One count is always there, with sum 0. */
            vh sum = ((a & in_a) + (b & in_b)) + ((c & in_c) + (d & in_d));
            vh minus_count = (in_a + in_b) + (in_c + in_d);
            vh share = vh_select(vh_eq(minus_count, vh_set1((uint16_t)-4)), vh_set1(16384), vh_set1(32768));
            share = vh_select(vh_eq(minus_count, vh_set1((uint16_t)-3)), vh_set1(21846), share);
            vh_store(result + x, nearest + vh_multiply_high(sum, share));
        }
    }
}

/* a quarter of the way from c to x where they are close, else c */
VINL vh towards(vh c, vh x, vh near)
{
    vh distance = vh_subtract_saturated(c, x) | vh_subtract_saturated(x, c);
    x = vh_select(vh_le(distance, near), x, c);
    return vh_average(c, vh_average(c, x));
}

/* Rows of `out` get fine texels replaced from `coarse`; out and fine->texels may be the same. `row`: a coarse row with its margins. */
static void push(const level* coarse, const level* fine, uint16_t* out, uint32_t out_stride, uint16_t pull_limit, uint16_t push_limit, uint16_t* row)
{
    const vh near = vh_set1(pull_limit), behind = vh_set1(push_limit), empty = vh_set1(ES_PARABOLIC_EMPTY);
    vh_store(row, empty);
    for (uint32_t y = 0; y < fine->height; y++) {
        const uint16_t* centre = coarse->texels + (size_t)(y >> 1) * coarse->stride;
        const uint16_t* other = y & 1 ? centre + coarse->stride : centre - coarse->stride;
        uint32_t x;
        for (x = 0; x < coarse->width; x += VHW) vh_store(row + VHW + x, towards(vh_load(centre + x), vh_load(other + x), near));
        vh_store(row + VHW + x, empty);
        const uint16_t* source = fine->texels + (size_t)y * fine->stride;
        uint16_t* result = out + (size_t)y * out_stride;
        for (x = 0; x < coarse->width; x += VHW) {
            const uint16_t* at = row + VHW + x;
            vh c = vh_load(at), f0, f1;
            vh_join(towards(c, vh_load(at - 1), near), towards(c, vh_load(at + 1), near), &f0, &f1);
            vh x0 = vh_load(source + 2 * x), x1 = vh_load(source + 2 * x + VHW);
            /* EMPTY lies more than any threshold behind every depth */
            vh_store(result + 2 * x, vh_select(vh_le(vh_subtract_saturated(x0, f0), behind), x0, f0));
            vh_store(result + 2 * x + VHW, vh_select(vh_le(vh_subtract_saturated(x1, f1), behind), x1, f1));
        }
    }
}

void ES_KERNEL(es_pull_push)(const es_pull_push_parameters* p, uint16_t* work, uint16_t* scratch, uint16_t* out)
{
    level levels[ES_PULL_PUSH_MAX_LEVELS + 1];
    levels[0] = (level){work, p->size, p->size, p->size};
    uint16_t* row = scratch;
    uint16_t* next = scratch + es_pull_push_stride(p->size, 1);
    for (uint32_t l = 1; l <= p->levels; l++) {
        uint32_t stride = es_pull_push_stride(p->size, l), side = p->size >> l;
        size_t texels = (size_t)stride * (side + 2);
        memset(next, 0xff, texels * sizeof *next);
        levels[l] = (level){next + stride + VHW, stride, side, side};
        next += texels;
        pull(&levels[l - 1], &levels[l], threshold(p->pull, l - 1));
    }
    for (uint32_t l = p->levels; l-- > 0;) {
        uint16_t* result = l == 0 ? out : levels[l].texels;
        push(&levels[l + 1], &levels[l], result, levels[l].stride, threshold(p->pull, l + 1), threshold(p->push, l), row);
    }
}
