/* Splitting of points into a complete tree. */
#include "gi/micro/forest_parts.h"
#include "platform/context.h"

static bool before(const es_split_point* a, const es_split_point* b, int axis)
{
    return a->position[axis] < b->position[axis] || (a->position[axis] == b->position[axis] && a->index < b->index);
}

/* Never the first of all, and with more than two never the last, so that both sides of it are smaller. About the point of rank `middle` of many: of a sample of them that of the same rank, and a little to the side on which the more of them are left then. */
static es_split_point pivot_of(const es_split_point* points, uint32_t count, uint32_t middle, int axis)
{
    enum { SAMPLE = 33 };
    es_split_point sample[SAMPLE];
    const uint32_t size = count < 512 ? 3 : SAMPLE;
    for (uint32_t i = 0; i < size; i++) {
        const es_split_point point = points[((uint64_t)i * (count - 1) + size / 2) / (size - 1)];
        uint32_t at = i;
        for (; at && before(&point, &sample[at - 1], axis); at--) sample[at] = sample[at - 1];
        sample[at] = point;
    }
    if (size == 3) return sample[1];
    uint32_t rank = (uint32_t)((uint64_t)middle * size / count);
    rank = middle < count / 2 ? rank + 2 : rank < 2 ? 0 : rank - 2;
    return sample[rank < 1 ? 1 : rank > SAMPLE - 2 ? SAMPLE - 2 : rank];
}

/* The `middle` smallest of all come to stand before the others (Hoare's selection; keys are all different). */
static void select_half(es_split_point* points, uint32_t count, uint32_t middle, int axis)
{
    uint32_t begin = 0, end = count;
    while (end - begin > 1) {
        const es_split_point pivot = pivot_of(points + begin, end - begin, middle - begin, axis);
        uint32_t i = begin, j = end - 1;
        for (;;) {
            while (before(&points[i], &pivot, axis)) i++;
            while (before(&pivot, &points[j], axis)) j--;
            if (i >= j) break;
            const es_split_point swap = points[i];
            points[i++] = points[j];
            points[j--] = swap;
        }
        /* points before i are not after the pivot, those from i on not before it */
        if (middle <= i) end = i;
        if (middle >= i) begin = i;
        if (begin == middle || end == middle) break;
    }
}

static void split_at(es_split_point* points, uint32_t count, uint32_t half)
{
    float low[3], high[3];
    for (int k = 0; k < 3; k++) low[k] = high[k] = points[0].position[k];
    for (uint32_t i = 1; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const float p = points[i].position[k];
            low[k] = p < low[k] ? p : low[k];
            high[k] = p > high[k] ? p : high[k];
        }
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    select_half(points, count, half, axis);
}

static void split_all(es_split_point* points, uint32_t count, uint32_t part)
{
    if (count <= part) return;
    split_at(points, count, count / 2);
    split_all(points, count / 2, part);
    split_all(points + count / 2, count / 2, part);
}

void es_tree_split_any(es_split_point* points, uint32_t count)
{
    if (count < 2) return;
    const uint32_t half = count - count / 2;
    split_at(points, count, half);
    es_tree_split_any(points, half);
    es_tree_split_any(points + half, count - half);
}

typedef struct splitting { es_split_point* points; uint32_t size, part; bool whole; } splitting;

static void split_some(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const splitting* s = user;
    for (uint32_t i = begin; i < end; i++) {
        es_split_point* points = s->points + (size_t)i * s->size;
        if (s->whole) split_all(points, s->size, s->part);
        else split_at(points, s->size, s->size / 2);
    }
}

enum { LEAST_PARALLEL = 16384, PARTS = 64 };

void es_tree_split(es_context* context, es_split_point* points, uint32_t count, uint32_t part)
{
    splitting s = {points, count, part, false};
    if (count < LEAST_PARALLEL) {
        split_all(points, count, part);
        return;
    }
    uint32_t parts = 1;
    for (; parts < PARTS; parts *= 2, s.size /= 2) es_parallel_for(context, parts, 1, split_some, &s);
    s.whole = true;
    es_parallel_for(context, parts, 1, split_some, &s);
}
