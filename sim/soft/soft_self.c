/* A cloth against itself: particles that are not neighbours at rest keep a distance.
 *
 * Pairs that may come close within the step are found once, by cells of a hashed grid; they are parted one after another in the order
 * of their slots, a few times per step, between rounds of substeps. The distance is the thickness, or three quarters of the mean edge where
 * that is more, so that no particle slips through between three others. */
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/random.h"

/* Half a gigabyte of them. A cloth has some tens a particle; one that lies in a point has half the square of its particles, and parting those
 * one after another would take longer than anyone waits. */
enum { MOST_PAIRS = 1 << 26 };

typedef struct pair_search {
    es_soft_object* soft;
    float cell, reach2, rest2;
    uint32_t mask;
    uint32_t *first, *sorted;      /* of buckets; slots */
    uint32_t* count;               /* per slot: how many, then where */
    bool fill;
} pair_search;

typedef struct cell { int32_t x, y, z; } cell;

float es_soft_own_distance(const es_soft_object* soft) { return es_maxf(soft->desc.thickness, 0.75f * soft->spacing); }

static cell cell_of(const float* x, float size)
{
    return (cell){(int32_t)es_floor(es_clampf(x[0] / size, -1e9f, 1e9f)), (int32_t)es_floor(es_clampf(x[1] / size, -1e9f, 1e9f)), (int32_t)es_floor(es_clampf(x[2] / size, -1e9f, 1e9f))};
}

/* Cells in a row along x have buckets in a row, so that three of them are read at once. */
static uint32_t bucket_of(int32_t x, int32_t y, int32_t z) { return (uint32_t)x + es_hash_u32((uint32_t)y * 0x85ebca77u ^ (uint32_t)z * 0xc2b2ae3du); }

/* Of those in the buckets [begin, end) the ones in row (y, z), three cells about x, that come near enough. Other cells have the same buckets;
 * what is in them is left to its own row, so that none is found twice. */
static uint32_t search_buckets(const pair_search* search, uint32_t s, uint32_t begin, uint32_t end, cell at, uint32_t pairs, uint32_t found)
{
    es_soft_object* soft = search->soft;
    const float *x = soft->x + 4 * (size_t)s, *rest = soft->rest + 3 * (size_t)soft->layout.particle_of[s];
    for (uint32_t i = search->first[begin]; i < search->first[end]; i++) {
        const uint32_t t = search->sorted[i];
        if (t <= s) continue;
        const float* y = soft->x + 4 * (size_t)t;
        float dx = x[0] - y[0], dy = x[1] - y[1], dz = x[2] - y[2];
        if (!(dx * dx + dy * dy + dz * dz < search->reach2) || !(x[3] + y[3] > 0)) continue;
        const float* other = soft->rest + 3 * (size_t)soft->layout.particle_of[t];
        float rx = rest[0] - other[0], ry = rest[1] - other[1], rz = rest[2] - other[2];
        if (rx * rx + ry * ry + rz * rz < search->rest2) continue;
        const cell there = cell_of(y, search->cell);
        if (there.y != at.y || there.z != at.z || there.x < at.x - 1 || there.x > at.x + 1) continue;
        if (search->fill) {
            uint32_t place = pairs + found;
            for (; place > pairs && soft->pairs[2 * (size_t)place - 1] > t; place--) soft->pairs[2 * (size_t)place + 1] = soft->pairs[2 * (size_t)place - 1];
            soft->pairs[2 * (size_t)place + 1] = t;
            soft->pairs[2 * (size_t)(pairs + found)] = s;
        }
        found++;
    }
    return found;
}

static void search_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const pair_search* search = user;
    es_soft_object* soft = search->soft;
    const uint32_t buckets = search->mask + 1;
    for (uint32_t s = begin; s < end; s++) {
        uint32_t found = 0, pairs = search->fill ? search->count[s] : 0;
        if (soft->layout.particle_of[s] != ES_SOFT_NONE) {
            const cell own = cell_of(soft->x + 4 * (size_t)s, search->cell);
            for (int32_t n = 0; n < 9; n++) {
                const cell row = {own.x, own.y + n % 3 - 1, own.z + n / 3 - 1};
                const uint32_t first = bucket_of(row.x - 1, row.y, row.z) & search->mask;
                const uint32_t end_of_row = first + 3 < buckets ? first + 3 : buckets;
                found = search_buckets(search, s, first, end_of_row, row, pairs, found);
                if (first + 3 > buckets) found = search_buckets(search, s, 0, first + 3 - buckets, row, pairs, found); /* the row goes on at the front */
            }
        }
        if (!search->fill) search->count[s] = found;
    }
}

bool es_soft_find_pairs(es_context* context, es_soft_object* soft, float h)
{
    const uint32_t slots = soft->layout.slot_count;
    const float distance = es_soft_own_distance(soft);
    float fastest = 0;
    for (uint32_t s = 0; s < slots; s++) {
        const float* v = soft->velocity + 4 * (size_t)s;
        fastest = es_maxf(fastest, v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    }
    soft->pair_count = 0;
    if (!(distance > 1e-6f)) return true;
    const float reach = distance + es_minf(es_sqrt(fastest) * h, distance);
    uint32_t buckets = 64;
    while (buckets < slots) buckets *= 2;
    if (!es_grow(context, (void**)&soft->cells, &soft->cell_capacity, 0, (size_t)buckets + 2 + 2 * (size_t)slots, sizeof *soft->cells)) return false;
    pair_search search = {soft, reach, reach * reach, 4 * distance * distance, buckets - 1, soft->cells, soft->cells + buckets + 2, soft->cells + buckets + 2 + slots, false};
    memset(search.first, 0, ((size_t)buckets + 2) * sizeof *search.first);
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t s = 0; s < slots; s++) {
            if (soft->layout.particle_of[s] == ES_SOFT_NONE) continue;
            const cell at = cell_of(soft->x + 4 * (size_t)s, reach);
            const uint32_t bucket = bucket_of(at.x, at.y, at.z) & search.mask;
            if (pass == 0) search.first[bucket + 2]++;
            else search.sorted[search.first[bucket + 1]++] = s;
        }
        for (uint32_t b = 0; b < buckets && pass == 0; b++) search.first[b + 2] += search.first[b + 1];
    }
    es_parallel_for(context, slots, 256, search_body, &search);
    uint64_t total = 0;
    for (uint32_t s = 0; s < slots; s++) {
        uint32_t own = search.count[s];
        search.count[s] = (uint32_t)total;
        total += own;
    }
    if (total <= MOST_PAIRS) soft->crumpled = false;
    if (total == 0) return true;
    if (total > MOST_PAIRS) {
        if (!soft->crumpled)
            es_log(context, ES_LOG_WARNING, ES_OK, "soft body '%.64s': %llu pairs of its particles are close, more than %u: it passes through itself until they part", soft->object.name ? soft->object.name : "",
                (unsigned long long)total, MOST_PAIRS);
        soft->crumpled = true;
        return true;
    }
    if (!es_grow(context, (void**)&soft->pairs, &soft->pair_capacity, 0, 2 * (size_t)total, sizeof *soft->pairs)) return false;
    search.fill = true;
    es_parallel_for(context, slots, 256, search_body, &search);
    soft->pair_count = (size_t)total;
    return true;
}

void es_soft_part_pairs(es_soft_object* soft)
{
    const float distance = es_soft_own_distance(soft), friction = soft->desc.friction;
    for (size_t i = 0; i < soft->pair_count; i++) {
        float *a = soft->x + 4 * (size_t)soft->pairs[2 * i], *b = soft->x + 4 * (size_t)soft->pairs[2 * i + 1];
        float dx = a[0] - b[0], dy = a[1] - b[1], dz = a[2] - b[2], squared = dx * dx + dy * dy + dz * dz;
        if (!(squared < distance * distance)) continue;
        const float *p = soft->previous + 4 * (size_t)soft->pairs[2 * i], *q = soft->previous + 4 * (size_t)soft->pairs[2 * i + 1];
        float length = es_sqrt(squared), inverse = length > 1e-9f ? 1.0f / length : 0;
        es_vec3 n = es_v3(dx * inverse, length > 1e-9f ? dy * inverse : 1.0f, dz * inverse);
        float depth = distance - length, masses = a[3] + b[3], sa = a[3] / masses, sb = b[3] / masses;
        es_vec3 slip = es_v3(a[0] - p[0] - (b[0] - q[0]), a[1] - p[1] - (b[1] - q[1]), a[2] - p[2] - (b[2] - q[2]));
        slip = es_v3_sub(slip, es_v3_scale(n, es_v3_dot(slip, n)));
        float way = es_v3_length(slip), held = friction * depth;
        es_vec3 move = es_v3_sub(es_v3_scale(n, depth), es_v3_scale(slip, way > held ? held / way : 1.0f));
        a[0] += move.x * sa;
        a[1] += move.y * sa;
        a[2] += move.z * sa;
        b[0] -= move.x * sb;
        b[1] -= move.y * sb;
        b[2] -= move.z * sb;
    }
}
