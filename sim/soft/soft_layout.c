/* From triangles and tetrahedra to what the kernels run over.
 *
 * Links are a cloth's edges, and across each edge the other two corners of its triangles. An edge much longer than the four around it is a
 * quadrilateral's diagonal: it and the one across it resist shear, other edges stretch, what lies across those bending.
 * Breadth-first levels of the links from a far end put particles in an order in which links reach no farther than the next level; bands are
 * runs of two levels or more. Within a band and within a seam links get colours, first fit, and each colour becomes batches of
 * eight. What has no colour left among 64 is solved one by one.
 *
 * The order matters beyond determinism: a sweep along a chain moves an error on with every link and is unstable in small steps, coloured
 * sweeps treat both ends of a link alike. */
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"

enum { COLOURS = 64, BAND_PARTICLES = 160, BAND_SHARE = 12 };

typedef struct link_ends { uint32_t a, b; uint8_t kind, edge; } link_ends;

typedef struct builder {
    es_soft_object* soft;
    es_arena* scratch;
    uint32_t particles;
    link_ends* links;
    size_t link_count;
    uint32_t *first, *next;        /* CSR: links round particles, the other end */
    uint32_t* level;
    uint32_t* band;                /* per particle */
} builder;

static float rest_distance(const es_soft_object* soft, uint32_t a, uint32_t b)
{
    const float *p = soft->rest + 3 * (size_t)a, *q = soft->rest + 3 * (size_t)b;
    float x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return es_sqrt(x * x + y * y + z * z);
}

/* ---- links --------------------------------------------------------------------------------------------------------- */

typedef struct half_edge { uint32_t high, opposite; } half_edge;

/* Half edges in buckets of their lower particle, in each by the higher one and then in the order of triangles. */
static bool sort_edges(const builder* b, const uint32_t* corners, uint32_t count, uint32_t sides, uint32_t** first_out, half_edge** edges_out)
{
    static const uint8_t pairs[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
    uint32_t* first = es_soft_room(b->scratch, (size_t)b->particles + 2, sizeof *first);
    half_edge* edges = es_soft_room(b->scratch, (size_t)count * (sides == 3 ? 3 : 6), sizeof *edges);
    if (!first || !edges) return false;
    memset(first, 0, ((size_t)b->particles + 2) * sizeof *first);
    const uint32_t edge_count = sides == 3 ? 3 : 6;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t t = 0; t < count; t++) {
            const uint32_t* c = corners + sides * (size_t)t;
            if (c[0] == ES_SOFT_NONE) continue;
            for (uint32_t k = 0; k < edge_count; k++) {
                uint32_t p = c[pairs[k][0]], q = c[pairs[k][1]], low = p < q ? p : q, high = p < q ? q : p;
                if (p == q) continue;
                if (pass == 0) first[low + 2]++;
                else edges[first[low + 1]++] = (half_edge){high, c[pairs[k][2]]};
            }
        }
        for (uint32_t p = 0; p < b->particles && pass == 0; p++) first[p + 2] += first[p + 1];
    }
    for (uint32_t p = 0; p < b->particles; p++)
        for (uint32_t i = first[p] + 1; i < first[p + 1]; i++) {
            half_edge moving = edges[i];
            uint32_t at = i;
            for (; at > first[p] && edges[at - 1].high > moving.high; at--) edges[at] = edges[at - 1];
            edges[at] = moving;
        }
    *first_out = first;
    *edges_out = edges;
    return true;
}

static bool has_edge(const uint32_t* first, const half_edge* edges, uint32_t a, uint32_t b)
{
    uint32_t low = a < b ? a : b, high = a < b ? b : a;
    for (uint32_t i = first[low]; i < first[low + 1]; i++)
        if (edges[i].high == high) return true;
    return false;
}

static bool is_diagonal(const es_soft_object* soft, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    float around = es_maxf(es_maxf(rest_distance(soft, a, c), rest_distance(soft, b, c)), es_maxf(rest_distance(soft, a, d), rest_distance(soft, b, d)));
    return rest_distance(soft, a, b) > 1.05f * around;
}

static bool make_links(builder* b)
{
    const es_soft_object* soft = b->soft;
    const bool cloth = soft->tetrahedron_count == 0;
    uint32_t* first;
    half_edge* edges;
    if (!sort_edges(b, cloth ? soft->corners : soft->tetrahedra, cloth ? soft->triangle_count : soft->tetrahedron_count, cloth ? 3 : 4, &first, &edges)) return false;
    const uint32_t total = first[b->particles];
    b->links = es_soft_room(b->scratch, 2 * (size_t)total, sizeof *b->links);
    if (!b->links) return false;
    for (uint32_t p = 0; p < b->particles; p++)
        for (uint32_t i = first[p], end = i; i < first[p + 1]; i = end) {
            while (end < first[p + 1] && edges[end].high == edges[i].high) end++;
            const uint32_t q = edges[i].high;
            const bool diagonal = cloth && end - i == 2 && is_diagonal(soft, p, q, edges[i].opposite, edges[i + 1].opposite);
            b->links[b->link_count++] = (link_ends){p, q, diagonal ? ES_SOFT_SHEAR : ES_SOFT_STRETCH, 1};
            if (!cloth || (!diagonal && soft->desc.bend_compliance < 0)) continue;
            for (uint32_t k = i; k + 1 < end; k++) {
                uint32_t c = edges[k].opposite, d = edges[k + 1].opposite;
                if (c == d || has_edge(first, edges, c, d)) continue;
                b->links[b->link_count++] = (link_ends){c, d, diagonal ? ES_SOFT_SHEAR : ES_SOFT_BEND, 0};
            }
        }
    return true;
}

/* ---- bands --------------------------------------------------------------------------------------------------------- */

static bool make_graph(builder* b)
{
    b->first = es_soft_room(b->scratch, (size_t)b->particles + 2, sizeof *b->first);
    b->next = es_soft_room(b->scratch, 2 * b->link_count, sizeof *b->next);
    if (!b->first || !b->next) return false;
    memset(b->first, 0, ((size_t)b->particles + 2) * sizeof *b->first);
    for (size_t i = 0; i < b->link_count; i++) {
        b->first[b->links[i].a + 2]++;
        b->first[b->links[i].b + 2]++;
    }
    for (uint32_t p = 0; p < b->particles; p++) b->first[p + 2] += b->first[p + 1];
    for (size_t i = 0; i < b->link_count; i++) {
        b->next[b->first[b->links[i].a + 1]++] = b->links[i].b;
        b->next[b->first[b->links[i].b + 1]++] = b->links[i].a;
    }
    return true;
}

/* Levels from `from` in its component; queue holds the component afterwards. Visited are those with level < limit's mark. */
static uint32_t flood(const builder* b, uint32_t from, uint32_t* level, uint32_t* queue)
{
    uint32_t count = 0;
    level[from] = 0;
    queue[count++] = from;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = b->first[queue[i]]; k < b->first[queue[i] + 1]; k++)
            if (level[b->next[k]] == ES_SOFT_NONE) {
                level[b->next[k]] = level[queue[i]] + 1;
                queue[count++] = b->next[k];
            }
    return count;
}

static bool make_bands(builder* b, es_soft_layout* layout)
{
    b->level = es_soft_room(b->scratch, b->particles, sizeof *b->level);
    b->band = es_soft_room(b->scratch, b->particles, sizeof *b->band);
    uint32_t* queue = es_soft_room(b->scratch, b->particles, sizeof *queue);
    if (!b->level || !b->band || !queue) return false;
    for (uint32_t p = 0; p < b->particles; p++) b->level[p] = ES_SOFT_NONE;
    uint32_t levels = 1;
    for (uint32_t p = 0; p < b->particles; p++) {
        if (b->level[p] != ES_SOFT_NONE) continue;
        uint32_t count = flood(b, p, b->level, queue), far = queue[count - 1];
        for (uint32_t i = 0; i < count; i++) b->level[queue[i]] = ES_SOFT_NONE;
        flood(b, far, b->level, queue);
        if (b->level[queue[count - 1]] >= levels) levels = b->level[queue[count - 1]] + 1;
    }
    uint32_t *size = es_soft_room(b->scratch, levels, sizeof *size), *band_of = es_soft_room(b->scratch, levels, sizeof *band_of);
    if (!size || !band_of) return false;
    memset(size, 0, levels * sizeof *size);
    for (uint32_t p = 0; p < b->particles; p++) size[b->level[p]]++;
    const uint32_t share = b->particles / BAND_SHARE, wanted = share > BAND_PARTICLES ? share : BAND_PARTICLES;
    uint32_t bands = 0, begin = 0, held = 0;
    for (uint32_t l = 0; l < levels; l++) {
        held += size[l];
        band_of[l] = bands;
        if (held < wanted || l - begin < 1) continue;
        bands++;
        begin = l + 1;
        held = 0;
    }
    if (begin < levels) { /* what is left is a band of its own if it is thick enough */
        if (bands > 0 && (levels - begin < 2 || held < wanted / 2))
            for (uint32_t l = begin; l < levels; l++) band_of[l] = bands - 1;
        else bands++;
    }
    layout->band_count = bands ? bands : 1;
    layout->bands = es_soft_room(&layout->arena, layout->band_count, sizeof *layout->bands);
    layout->slot_of = es_soft_room(&layout->arena, b->particles, sizeof *layout->slot_of);
    if (!layout->bands || !layout->slot_of) return false;
    memset(layout->bands, 0, layout->band_count * sizeof *layout->bands);
    for (uint32_t p = 0; p < b->particles; p++) {
        b->band[p] = band_of[b->level[p]];
        layout->bands[b->band[p]].end++;
    }
    uint32_t slots = 0;
    for (uint32_t i = 0; i < layout->band_count; i++) {
        uint32_t count = layout->bands[i].end;
        layout->bands[i].begin = layout->bands[i].end = slots;
        slots += (count + 7) / 8 * 8;
    }
    layout->slot_count = slots;
    layout->particle_of = es_soft_room(&layout->arena, slots, sizeof *layout->particle_of);
    if (!layout->particle_of) return false;
    for (uint32_t s = 0; s < slots; s++) layout->particle_of[s] = ES_SOFT_NONE;
    for (uint32_t p = 0; p < b->particles; p++) {
        uint32_t s = layout->bands[b->band[p]].end++;
        layout->slot_of[p] = s;
        layout->particle_of[s] = p;
    }
    for (uint32_t i = 0; i < layout->band_count; i++) layout->bands[i].end = (layout->bands[i].end + 7) / 8 * 8;
    return true;
}

/* ---- batches ------------------------------------------------------------------------------------------------------- */

/* Order of `count` constraints of `corners` particles each: by band, own before seam, colour. starts has one number per (band, seam, colour) and
 * one more. */
static uint32_t* sort_by_colour(const builder* b, uint32_t bands, const uint32_t* ends, uint32_t corners, size_t count, uint32_t** starts_out)
{
    const size_t groups = (size_t)bands * 2 * (COLOURS + 1);
    uint64_t* used[2] = {es_soft_room(b->scratch, b->particles, sizeof **used), es_soft_room(b->scratch, b->particles, sizeof **used)};
    uint32_t *group = es_soft_room(b->scratch, count, sizeof *group), *starts = es_soft_room(b->scratch, groups + 2, sizeof *starts), *order = es_soft_room(b->scratch, count, sizeof *order);
    if (!used[0] || !used[1] || !group || !starts || !order) return NULL;
    memset(used[0], 0, b->particles * sizeof **used);
    memset(used[1], 0, b->particles * sizeof **used);
    memset(starts, 0, (groups + 2) * sizeof *starts);
    for (size_t i = 0; i < count; i++) {
        const uint32_t* p = ends + corners * i;
        uint32_t low = b->band[p[0]], high = low;
        for (uint32_t k = 1; k < corners; k++) {
            low = b->band[p[k]] < low ? b->band[p[k]] : low;
            high = b->band[p[k]] > high ? b->band[p[k]] : high;
        }
        uint32_t seam = low != high, colour = COLOURS;
        uint64_t taken = 0;
        for (uint32_t k = 0; k < corners; k++) taken |= used[seam][p[k]];
        if (~taken) {
            colour = (uint32_t)__builtin_ctzll(~taken);
            for (uint32_t k = 0; k < corners; k++) used[seam][p[k]] |= 1ull << colour;
        }
        group[i] = (high * 2 + seam) * (COLOURS + 1) + colour;
        starts[group[i] + 2]++;
    }
    for (size_t g = 0; g < groups; g++) starts[g + 2] += starts[g + 1];
    for (size_t i = 0; i < count; i++) order[starts[group[i] + 1]++] = (uint32_t)i;
    *starts_out = starts;
    return order;
}

/* Batches that the groups make; `ranges` gets the four borders of each band. */
static uint32_t count_batches(const uint32_t* starts, es_soft_band* bands, uint32_t band_count, bool volumes)
{
    uint32_t total = 0;
    for (uint32_t i = 0; i < band_count; i++) {
        uint32_t* range = volumes ? bands[i].volumes : bands[i].links;
        for (uint32_t seam = 0; seam < 2; seam++) {
            range[2 * seam] = total;
            for (uint32_t c = 0; c <= COLOURS; c++) {
                const uint32_t* s = starts + ((size_t)i * 2 + seam) * (COLOURS + 1) + c;
                total += c < COLOURS ? (s[1] - s[0] + 7) / 8 : s[1] - s[0];
            }
            range[2 * seam + 1] = total;
        }
    }
    return total;
}

/* The next batch's first constraint and size, walking through all groups in order. */
static uint32_t next_batch(const uint32_t* starts, size_t* group, uint32_t* at)
{
    while (*at == starts[*group + 1]) ++*group;
    uint32_t left = starts[*group + 1] - *at, size = *group % (COLOURS + 1) == COLOURS ? 1 : left < 8 ? left : 8;
    *at += size;
    return size;
}

static bool make_link_batches(const builder* b, es_soft_layout* layout)
{
    uint32_t *ends = es_soft_room(b->scratch, 2 * b->link_count, sizeof *ends), *starts = NULL;
    if (!ends) return false;
    for (size_t i = 0; i < b->link_count; i++) {
        ends[2 * i] = b->links[i].a;
        ends[2 * i + 1] = b->links[i].b;
    }
    const uint32_t* order = sort_by_colour(b, layout->band_count, ends, 2, b->link_count, &starts);
    if (!order) return false;
    layout->link_count = count_batches(starts, layout->bands, layout->band_count, false);
    layout->links = es_soft_room(&layout->arena, layout->link_count, sizeof *layout->links);
    layout->kinds = es_soft_room(&layout->arena, (size_t)layout->link_count * 8, 1);
    layout->edges = es_soft_room(&layout->arena, (size_t)layout->link_count * 8, 1);
    if (!layout->links || !layout->kinds || !layout->edges) return false;
    size_t group = 0;
    uint32_t at = 0;
    for (uint32_t k = 0; k < layout->link_count; k++) {
        uint32_t size = next_batch(starts, &group, &at), begin = at - size;
        es_soft_links* batch = &layout->links[k];
        batch->count = size;
        for (uint32_t lane = 0; lane < 8; lane++) {
            const link_ends* link = &b->links[order[begin + (lane < size ? lane : 0)]];
            batch->a[lane] = layout->slot_of[link->a];
            batch->b[lane] = layout->slot_of[link->b];
            batch->rest[lane] = rest_distance(b->soft, link->a, link->b);
            batch->compliance[lane] = 0;
            layout->kinds[8 * (size_t)k + lane] = link->kind;
            layout->edges[8 * (size_t)k + lane] = lane < size && link->edge;
        }
    }
    return true;
}

static void volume_of(const es_soft_object* soft, const uint32_t c[4], float* rest, float* least)
{
    double e[3][3], g[4][3], volume = 0, sum = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) e[i][k] = (double)soft->rest[3 * (size_t)c[i + 1] + k] - (double)soft->rest[3 * (size_t)c[0] + k];
    for (int k = 0; k < 3; k++) g[0][k] = 0;
    for (int i = 0; i < 3; i++) {
        const double *p = e[(i + 1) % 3], *q = e[(i + 2) % 3];
        g[i + 1][0] = (p[1] * q[2] - p[2] * q[1]) / 6;
        g[i + 1][1] = (p[2] * q[0] - p[0] * q[2]) / 6;
        g[i + 1][2] = (p[0] * q[1] - p[1] * q[0]) / 6;
        for (int k = 0; k < 3; k++) g[0][k] -= g[i + 1][k];
    }
    for (int k = 0; k < 3; k++) volume += e[0][k] * g[1][k];
    for (int i = 0; i < 4; i++) sum += (g[i][0] * g[i][0] + g[i][1] * g[i][1] + g[i][2] * g[i][2]) / (double)soft->mass[c[i]];
    *rest = (float)volume;
    *least = (float)(0.05 * sum);
}

static bool make_volume_batches(const builder* b, es_soft_layout* layout)
{
    const es_soft_object* soft = b->soft;
    uint32_t* starts = NULL;
    const uint32_t* order = sort_by_colour(b, layout->band_count, soft->tetrahedra, 4, soft->tetrahedron_count, &starts);
    if (!order) return false;
    layout->volume_count = count_batches(starts, layout->bands, layout->band_count, true);
    layout->volumes = es_soft_room(&layout->arena, layout->volume_count, sizeof *layout->volumes);
    if (!layout->volumes) return false;
    size_t group = 0;
    uint32_t at = 0;
    for (uint32_t k = 0; k < layout->volume_count; k++) {
        uint32_t size = next_batch(starts, &group, &at), begin = at - size;
        es_soft_volumes* batch = &layout->volumes[k];
        batch->count = size;
        for (uint32_t lane = 0; lane < 8; lane++) {
            const uint32_t* c = soft->tetrahedra + 4 * (size_t)order[begin + (lane < size ? lane : 0)];
            for (int i = 0; i < 4; i++) batch->corner[i][lane] = layout->slot_of[c[i]];
            volume_of(soft, c, &batch->rest[lane], &batch->floor[lane]);
        }
    }
    return true;
}

/* ---- all of it ------------------------------------------------------------------------------------------------------ */

static bool make_triangles(const es_soft_object* soft, es_soft_layout* layout, es_context* context)
{
    layout->indices = es_soft_room(&layout->arena, 3 * (size_t)soft->triangle_count, sizeof *layout->indices);
    if (!layout->indices) return false;
    for (uint32_t t = 0; t < soft->triangle_count; t++) {
        const uint32_t* c = soft->corners + 3 * (size_t)t;
        if (c[0] == ES_SOFT_NONE) continue;
        for (int k = 0; k < 3; k++) layout->indices[3 * (size_t)layout->triangle_count + k] = layout->slot_of[c[k]];
        layout->triangle_count++;
    }
    return es_vertex_fans_make(context, layout->indices, layout->triangle_count, layout->slot_count, NULL, &layout->fans);
}

static bool make(builder* b, es_soft_layout* layout, es_context* context)
{
    return make_links(b) && make_graph(b) && make_bands(b, layout) && make_link_batches(b, layout) && make_volume_batches(b, layout) &&
           make_triangles(b->soft, layout, context);
}

void es_soft_layout_free(es_soft_layout* layout)
{
    if (!layout->arena.context) return;
    if (layout->fans.first_row) es_vertex_fans_free(layout->arena.context, &layout->fans);
    es_arena_free(&layout->arena);
    *layout = (es_soft_layout){0};
}

void es_soft_set_compliances(es_soft_object* soft)
{
    const float of[3] = {soft->desc.stretch_compliance, soft->desc.shear_compliance, soft->desc.bend_compliance};
    for (size_t i = 0; i < (size_t)soft->layout.link_count * 8; i++) soft->layout.links[i / 8].compliance[i % 8] = of[soft->layout.kinds[i]];
}

bool es_soft_lay_out(es_context* context, es_soft_object* soft, es_soft_layout* replaced)
{
    es_soft_layout layout = {0}, *old = &soft->layout;
    es_arena scratch;
    es_arena_init(&layout.arena, context, 1 << 16);
    es_arena_init(&scratch, context, 1 << 16);
    builder b = {.soft = soft, .scratch = &scratch, .particles = soft->particle_count};
    bool good = make(&b, &layout, context);
    es_arena_free(&scratch);
    float* streams[5] = {0};
    for (int k = 0; k < 5 && good; k++) {
        streams[k] = es_soft_room(&layout.arena, 4 * (size_t)layout.slot_count, sizeof(float));
        good = streams[k] != NULL;
        if (good) memset(streams[k], 0, 4 * (size_t)layout.slot_count * sizeof(float));
    }
    float* ratio = good ? es_soft_room(&layout.arena, 8 * (size_t)layout.link_count, sizeof(float)) : NULL;
    if (!ratio) {
        es_soft_layout_free(&layout);
        return false;
    }
    const float* from[3] = {soft->x, soft->velocity, soft->before};
    for (uint32_t p = 0; p < soft->particle_count && old->made; p++) {
        if (p >= soft->carried) break;
        for (int k = 0; k < 3; k++) memcpy(streams[k] + 4 * (size_t)layout.slot_of[p], from[k] + 4 * (size_t)old->slot_of[p], 4 * sizeof(float));
    }
    soft->carried = soft->particle_count;
    if (replaced) *replaced = *old;
    else es_soft_layout_free(old);
    layout.made = true;
    *old = layout;
    soft->x = streams[0];
    soft->velocity = streams[1];
    soft->before = streams[2];
    soft->previous = streams[3];
    soft->acceleration = streams[4];
    soft->ratio = ratio;
    es_soft_set_compliances(soft);
    return true;
}
