/* The raster floor's triangle kernels: every instruction set against scalar, bit for bit, on random and near-extreme input, with guard
 * words round every output.
 *
 * check_raster --time prints nanoseconds per element of every kernel and instruction set instead. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "platform/context.h"
#include "platform/random.h"
#include "raster/kernel_table.h"
#include "raster/pack.h"

static uint32_t seed_state = 1;
static uint32_t random_bits(void) { return es_random_u32(11, seed_state++); }
static double uniform(double low, double high) { return low + (high - low) * (random_bits() / 4294967296.0); }

enum { GUARD = 64 };
static const uint32_t guard_word = 0xdeadbeef;

/* words with guards on both sides */
typedef struct buffer { uint32_t* memory; size_t words; } buffer;
static buffer new_buffer(size_t bytes)
{
    buffer b = {NULL, (bytes + 3) / 4};
    b.memory = aligned_alloc(64, (b.words * 4 + 2 * GUARD * 4 + 63) / 64 * 64);
    for (size_t i = 0; i < b.words + 2 * GUARD; i++) b.memory[i] = guard_word;
    return b;
}
static void* data(buffer b) { return b.memory + GUARD; }
static void check_guards(buffer b)
{
    for (size_t i = 0; i < GUARD; i++) {
        assert_int_equal(b.memory[i], guard_word);
        assert_int_equal(b.memory[GUARD + b.words + i], guard_word);
    }
}
/* NaNs compare equal: which of two NaN operands survives is not fixed */
static bool is_nan_word(uint32_t w) { return (w & 0x7fffffff) > 0x7f800000; }
static void check_equal(buffer a, buffer b, bool floats)
{
    for (size_t i = 0; i < a.words; i++) {
        uint32_t x = a.memory[GUARD + i], y = b.memory[GUARD + i];
        if (x != y && !(floats && is_nan_word(x) && is_nan_word(y))) fail_msg("word %zu: scalar %08x, here %08x", i, x, y);
    }
}
static void free_buffer(buffer b) { free(b.memory); }

static const es_raster_kernels* scalar(void) { return es_raster_kernels_of(ES_ISA_SCALAR); }
#define FOR_EACH_ISA(kernels)                                                            \
    for (int isa_ = 0; isa_ < ES_ISA_COUNT; isa_++)                                       \
        for (const es_raster_kernels* kernels = es_isa_available_mask() >> isa_ & 1 ? es_raster_kernels_of((es_isa)isa_) : NULL; kernels; kernels = NULL)

/* mostly tame, now and then anything a float can be */
static float wild_float(double scale)
{
    static const float odd[] = {0.0f, -0.0f, 1e30f, -1e30f, 3e38f, 1e-38f, 1e-45f, INFINITY, -INFINITY, NAN, 1.0f, -1.0f};
    uint32_t r = random_bits();
    if (r % 16 == 0) return odd[r / 16 % 12];
    if (r % 64 == 1) {
        float f;
        uint32_t bits = random_bits();
        memcpy(&f, &bits, 4);
        return f;
    }
    return (float)uniform(-scale, scale);
}

static void test_transform(void** state)
{
    enum { N = 1000 };
    float *positions = malloc(16 * N), *previous = malloc(16 * N);
    for (int trial = 0; trial < 20; trial++) {
        for (int i = 0; i < 4 * N; i++) positions[i] = trial < 4 ? (float)uniform(-4, 4) : wild_float(4), previous[i] = wild_float(4);
        es_window_matrix m = {{512, 3, 1, 2, 4, -384, 2, 1, 0, 0, 0, 0.1f, 0, 0, -1, 0.5f}}, p = m;
        if (trial % 3 == 2)
            for (int i = 0; i < 16; i++) m.m[i] = wild_float(100);
        uint32_t count = trial % 5 == 0 ? N : 8 * (1 + random_bits() % (N / 8 - 1));
        buffer snapped = new_buffer(16 * count), window = new_buffer(16 * count), deltas = new_buffer(16 * count);
        scalar()->transform_vertices(positions, count, &m, 512, 384, data(snapped), data(window));
        scalar()->transform_deltas(positions, previous, count, &m, &p, data(deltas));
        FOR_EACH_ISA(k)
        {
            buffer s = new_buffer(16 * count), w = new_buffer(16 * count), d = new_buffer(16 * count), s2 = new_buffer(16 * count);
            k->transform_vertices(positions, count, &m, 512, 384, data(s), data(w));
            k->transform_vertices(positions, count, &m, 512, 384, data(s2), NULL);
            k->transform_deltas(positions, previous, count, &m, &p, data(d));
            check_equal(snapped, s, true);
            check_equal(snapped, s2, true);
            check_equal(window, w, true);
            check_equal(deltas, d, true);
            check_guards(s);
            check_guards(w);
            check_guards(d);
            free_buffer(s);
            free_buffer(s2);
            free_buffer(w);
            free_buffer(d);
        }
        /* what is not flagged is inside the limits */
        const es_snapped_vertex* v = data(snapped);
        for (uint32_t i = 0; i < count; i++)
            if (!(v[i].flags & (ES_OUT_CLIP | ES_OUT_BAD))) {
                assert_true(abs(v[i].x) <= ES_SNAPPED_MAX && abs(v[i].y) <= ES_SNAPPED_MAX);
                assert_true(v[i].depth <= 1.0f);
            }
        free_buffer(snapped);
        free_buffer(window);
        free_buffer(deltas);
    }
    free(positions);
    free(previous);
}

/* ---- binning ------------------------------------------------------------------------------------------------------------ */

typedef struct bin_out { buffer small, small_rects, large, large_rects; es_bin_job job; } bin_out;
static bin_out run_bin(const es_raster_kernels* k, const es_bin_job* job)
{
    bin_out o = {new_buffer(ES_CHUNK_TRIANGLES * sizeof(es_small_triangle)), new_buffer(ES_CHUNK_TRIANGLES * 4),
        new_buffer(ES_CHUNK_TRIANGLES * ES_CLIP_PIECES_MAX * sizeof(es_large_triangle)), new_buffer(ES_CHUNK_TRIANGLES * ES_CLIP_PIECES_MAX * 4), *job};
    o.job.small = data(o.small);
    o.job.small_rects = data(o.small_rects);
    o.job.large = data(o.large);
    o.job.large_rects = data(o.large_rects);
    k->bin_triangles(&o.job);
    return o;
}
static void free_bin(bin_out* o)
{
    free_buffer(o->small);
    free_buffer(o->small_rects);
    free_buffer(o->large);
    free_buffer(o->large_rects);
}

static void test_bin(void** state)
{
    enum { V = 600 };
    float* positions = calloc(V + 8, 16);
    es_snapped_vertex* snapped = calloc(V + 8, sizeof *snapped);
    uint32_t* indices = malloc((3 * ES_CHUNK_TRIANGLES + 1) * 4);
    uint64_t smalls = 0, larges = 0, clipped = 0;
    for (int trial = 0; trial < 60; trial++) {
        uint32_t width = 1 + random_bits() % (trial % 2 ? 300 : 8192), height = 1 + random_bits() % (trial % 2 ? 300 : 8192);
        double spread = trial % 4 == 0 ? 40 : trial % 4 == 1 ? 3 : trial % 4 == 2 ? 0.2 : 0.02;
        for (int i = 0; i < V; i++) {
            positions[4 * i] = trial % 7 == 6 ? wild_float(spread) : (float)uniform(-spread, spread);
            positions[4 * i + 1] = trial % 7 == 6 ? wild_float(spread) : (float)uniform(-spread, spread);
            positions[4 * i + 2] = (float)(trial % 4 == 0 ? uniform(-4, 4) : uniform(-4, -1));
            positions[4 * i + 3] = 1;
        }
        es_raster_mesh mesh = {.positions = positions, .indices = indices, .vertex_count = V};
        es_prepared_instance instance = {.mesh = &mesh, .cull_positive = trial % 3 == 1, .cull_negative = trial % 3 == 2};
        instance.window = (es_window_matrix){{0.5f * (float)width, 0, 0, 0, 0, -0.5f * (float)height, 0, 0, 0, 0, 0, 0.05f, 0, 0, -1, 0}};
        scalar()->transform_vertices(positions, V, &instance.window, 0.5f * (float)width, 0.5f * (float)height, snapped, NULL);
        for (uint32_t i = 0; i < 3 * ES_CHUNK_TRIANGLES + 1; i++) indices[i] = i % 3 && random_bits() % 4 == 0 ? indices[i - 1] : random_bits() % V;
        es_bin_job job = {.vertices = snapped, .indices = indices, .instance = &instance, .count = trial % 5 ? ES_CHUNK_TRIANGLES : random_bits() % ES_CHUNK_TRIANGLES,
            .first_id = random_bits() & ~1023u, .width = width, .height = height, .all_large = trial % 6 == 5};
        bin_out expected = run_bin(scalar(), &job);
        smalls += expected.job.small_count;
        larges += expected.job.large_count;
        clipped += expected.job.clipped;
        if (job.all_large) assert_int_equal(expected.job.small_count, 0);
        uint32_t tiles_x = (width + 63) / 64, tiles_y = (height + 63) / 64;
        for (uint32_t i = 0; i < expected.job.large_count; i++) {
            const es_large_triangle* t = &expected.job.large[i];
            int64_t area = (int64_t)(t->x1 - t->x0) * (t->y2 - t->y0) - (int64_t)(t->x2 - t->x0) * (t->y1 - t->y0);
            assert_true(area > 0);
            es_tile_rect r = expected.job.large_rects[i];
            assert_true(r.x0 <= r.x1 && r.y0 <= r.y1 && r.x1 < tiles_x && r.y1 < tiles_y);
        }
        for (uint32_t i = 0; i < expected.job.small_count; i++) {
            const es_small_triangle* t = &expected.job.small[i];
            assert_true((t->x1 - t->x0) * (t->y2 - t->y0) - (t->x2 - t->x0) * (t->y1 - t->y0) > 0);
            assert_true(t->px < width && t->py < height);
        }
        FOR_EACH_ISA(k)
        {
            bin_out o = run_bin(k, &job);
            assert_int_equal(o.job.small_count, expected.job.small_count);
            assert_int_equal(o.job.large_count, expected.job.large_count);
            assert_int_equal(o.job.culled, expected.job.culled);
            assert_int_equal(o.job.clipped, expected.job.clipped);
            check_equal(expected.small, o.small, false);
            check_equal(expected.small_rects, o.small_rects, false);
            check_equal(expected.large, o.large, false);
            check_equal(expected.large_rects, o.large_rects, false);
            check_guards(o.small);
            check_guards(o.large);
            check_guards(o.small_rects);
            check_guards(o.large_rects);
            free_bin(&o);
        }
        free_bin(&expected);
    }
    assert_true(smalls > 1000 && larges > 1000 && clipped > 100);
    free(positions);
    free(snapped);
    free(indices);
}

/* ---- tiles ----------------------------------------------------------------------------------------------------------------- */

enum { RECORDS = 200 };
typedef struct tile_input {
    es_small_triangle small[RECORDS];
    es_large_triangle large[RECORDS];
    uint32_t list[RECORDS + 8];
    es_tile tile;
} tile_input;

static void random_records(tile_input* in)
{
    in->tile.width = 1 + random_bits() % ES_RASTER_MAX_SIZE;
    in->tile.height = 1 + random_bits() % ES_RASTER_MAX_SIZE;
    in->tile.x = (int32_t)(random_bits() % ((in->tile.width + 63) / 64)) * 64;
    in->tile.y = (int32_t)(random_bits() % ((in->tile.height + 63) / 64)) * 64;
    int32_t cx = in->tile.x * 256 + 128 - (int32_t)in->tile.width * 128, cy = in->tile.y * 256 + 128 - (int32_t)in->tile.height * 128;
    for (int i = 0; i < RECORDS; i++) {
        in->list[i] = random_bits() % RECORDS;
        float z[3];
        for (int k = 0; k < 3; k++) z[k] = random_bits() % 8 ? (float)uniform(0, 1) : random_bits() % 2 ? 1.0f : -1e20f;
        /* small: as the bin stage makes them, straddling the tile's borders */
        for (;;) {
            es_small_triangle t = {.id = random_bits(), .z0 = z[0], .z1 = z[1], .z2 = z[2]};
            int32_t w = 1 + (int32_t)(random_bits() % ES_SMALL_WIDTH), h = 1 + (int32_t)(random_bits() % (i % 4 ? 2048 : ES_SMALL_HEIGHT));
            int32_t x[3], y[3], px = in->tile.x + (int32_t)(random_bits() % 95) - 31, py = in->tile.y + (int32_t)(random_bits() % 95) - 31, dx = (int32_t)(random_bits() % 256), dy = (int32_t)(random_bits() % 256);
            for (int k = 0; k < 3; k++) x[k] = (int32_t)(random_bits() % (uint32_t)(w + 1)) - dx, y[k] = (int32_t)(random_bits() % (uint32_t)(h + 1)) - dy;
            int32_t area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
            int32_t lowest = y[0] > y[1] ? y[0] : y[1];
            lowest = lowest > y[2] ? lowest : y[2];
            int32_t rightmost = x[0] > x[1] ? x[0] : x[1];
            rightmost = rightmost > x[2] ? rightmost : x[2];
            if (area <= 0 || px < 0 || py < 0 || lowest <= 0 || rightmost <= 0 || py + ((lowest - 1) >> 8) < in->tile.y || px + ((rightmost - 1) >> 8) < in->tile.x) continue;
            if (px >= in->tile.x + 64 || py >= in->tile.y + 64) continue;
            t.x0 = (int16_t)x[0], t.x1 = (int16_t)x[1], t.x2 = (int16_t)x[2];
            t.y0 = (int16_t)y[0], t.y1 = (int16_t)y[1], t.y2 = (int16_t)y[2];
            t.px = (uint16_t)px, t.py = (uint16_t)py;
            in->small[i] = t;
            break;
        }
        for (;;) {
            int32_t x[3], y[3], spread = i % 3 == 0 ? 2 * ES_SNAPPED_MAX : i % 3 == 1 ? 64 * 256 : 2000;
            for (int k = 0; k < 3; k++) {
                x[k] = cx + 32 * 256 + (int32_t)uniform(-spread, spread), y[k] = cy + 32 * 256 + (int32_t)uniform(-spread, spread);
                if (random_bits() % 8 == 0) x[k] = random_bits() % 2 ? ES_SNAPPED_MAX : -ES_SNAPPED_MAX;
                x[k] = x[k] < -ES_SNAPPED_MAX ? -ES_SNAPPED_MAX : x[k] > ES_SNAPPED_MAX ? ES_SNAPPED_MAX : x[k];
                y[k] = y[k] < -ES_SNAPPED_MAX ? -ES_SNAPPED_MAX : y[k] > ES_SNAPPED_MAX ? ES_SNAPPED_MAX : y[k];
            }
            int64_t area = (int64_t)(x[1] - x[0]) * (y[2] - y[0]) - (int64_t)(x[2] - x[0]) * (y[1] - y[0]);
            if (area <= 0) continue;
            in->large[i] = (es_large_triangle){x[0], y[0], x[1], y[1], x[2], y[2], z[0], z[1], z[2], random_bits() % RECORDS, {0, 0}};
            break;
        }
    }
    for (int i = 0; i < 8; i++) in->list[RECORDS + i] = 0xffffffff; /* padding is loaded, never used */
}

typedef struct tile_out { buffer depth, id, ids, minimum; uint64_t hidden; } tile_out;
/* kind: 0 small, 1 large, 2 masked */
static tile_out run_tile(const es_raster_kernels* k, const tile_input* in, int kind, bool ids, uint32_t count)
{
    tile_out o = {new_buffer((ES_TILE_WORDS + 8) * 4), new_buffer((ES_TILE_WORDS + 8) * 4), new_buffer((RECORDS + 16) * 4), new_buffer(256), 0};
    memset(data(o.ids), 0, (RECORDS + 16) * 4);
    memset(data(o.depth), 0, (ES_TILE_WORDS + 8) * 4);
    memset(data(o.id), 0, (ES_TILE_WORDS + 8) * 4);
    memset(data(o.minimum), 0, 256);
    es_tile tile = in->tile;
    tile.depth = data(o.depth);
    tile.number = ids ? data(o.id) : NULL;
    tile.triangle_ids = data(o.ids);
    tile.next_number = 1;
    tile.block_minimum = data(o.minimum);
    es_segment segment = {in->list, kind == 0 ? (const void*)in->small : in->large, count, 0};
    if (kind == 0) k->draw_small(&tile, &segment);
    if (kind == 1) k->draw_large(&tile, &segment);
    if (kind == 2) k->draw_masked(&tile, &segment);
    assert_int_equal(tile.next_number, 1 + count);
    o.hidden = tile.hidden;
    return o;
}
static void free_tile(tile_out* o)
{
    free_buffer(o->depth);
    free_buffer(o->id);
    free_buffer(o->ids);
    free_buffer(o->minimum);
}

/* the definition, pixel by pixel in 64 bits; only coverage, and of the tile proper */
static void check_coverage(const tile_input* in, int kind, uint32_t count, const float* depth)
{
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++) {
            bool covered = false, unsure = false;
            for (uint32_t i = 0; i < count && !covered; i++) {
                int64_t vx[3], vy[3], cx, cy;
                float low;
                if (kind == 0) {
                    const es_small_triangle* t = &in->small[in->list[i]];
                    vx[0] = t->x0, vx[1] = t->x1, vx[2] = t->x2, vy[0] = t->y0, vy[1] = t->y1, vy[2] = t->y2;
                    cx = ((int64_t)in->tile.x + x - t->px) * 256, cy = ((int64_t)in->tile.y + y - t->py) * 256;
                    low = fminf(fminf(t->z0, t->z1), t->z2);
                } else {
                    const es_large_triangle* t = &in->large[in->list[i]];
                    vx[0] = t->x0, vx[1] = t->x1, vx[2] = t->x2, vy[0] = t->y0, vy[1] = t->y1, vy[2] = t->y2;
                    cx = ((int64_t)in->tile.x + x) * 256 + 128 - (int64_t)in->tile.width * 128, cy = ((int64_t)in->tile.y + y) * 256 + 128 - (int64_t)in->tile.height * 128;
                    low = fminf(fminf(t->z0, t->z1), t->z2);
                }
                if (!(low > 0)) { /* partly beyond the far plane: depth decides too */
                    unsure = true;
                    continue;
                }
                covered = true;
                for (int k = 0; k < 3; k++) {
                    int j = (k + 1) % 3;
                    int64_t dx = vx[j] - vx[k], dy = vy[j] - vy[k], e = dx * (cy - vy[k]) - dy * (cx - vx[k]);
                    covered &= e > 0 || (e == 0 && (dy < 0 || (dy == 0 && dx > 0)));
                }
            }
            if (covered || !unsure) assert_true((depth[y * ES_TILE_PITCH + x] > 0) == covered);
        }
}

static void test_tiles(void** state)
{
    tile_input* in = calloc(1, sizeof *in);
    /* what masked triangles look up: one mesh whose triangle i is record i's id */
    float* positions = calloc(3 * RECORDS + 8, 16);
    float* uvs = calloc(3 * RECORDS + 8, 16);
    uint32_t* indices = malloc((3 * RECORDS + 1) * 4);
    for (int i = 0; i < 3 * RECORDS; i++) {
        indices[i] = (uint32_t)i;
        for (int k = 0; k < 4; k++) positions[4 * i + k] = k < 2 ? wild_float(60) : (float)uniform(-3, -0.1), uvs[4 * i + k] = wild_float(5);
    }
    uint16_t* texels = malloc(8 * 400);
    for (int i = 0; i < 4 * 400; i++) texels[i] = (uint16_t)random_bits();
    es_texture_image image = {.width = 16, .height = 15, .level_count = 5, .level_offset = {0, 240, 296, 308, 310}, .texels = texels};
    es_raster_mesh mesh = {.positions = positions, .uvs = uvs, .indices = indices, .vertex_count = 3 * RECORDS, .triangle_count = RECORDS};
    es_prepared_material material = {.base_color = {1, 1, 1, 1}, .alpha_mask = true, .alpha_cutoff = 0.5f};
    es_prepared_instance instance = {.mesh = &mesh, .material = &material, .window = {{64, 0, 0, 0, 0, -64, 0, 0, 0, 0, 0, 0.05f, 0, 0, -1, 0}}};
    es_chunk chunk = {.triangle_count = RECORDS};
    for (int trial = 0; trial < 60; trial++) {
        random_records(in);
        in->tile.chunks = &chunk;
        in->tile.instances = &instance;
        material.textures[0] = (es_prepared_texture){.image = trial % 5 ? &image : NULL, .matrix = {1, 0, 0, 1}, .wrap_u = (uint32_t)trial % 3, .wrap_v = (uint32_t)trial / 3 % 3,
            .magnify = (uint32_t)trial / 2 % 2, .minify = (uint32_t)trial / 4 % 2, .mip = (uint32_t)trial / 5 % 3};
        for (int kind = 0; kind < 3; kind++)
            for (int ids = 0; ids < 2; ids++) {
                uint32_t count = kind == 2 ? 40 : trial % 3 ? 3 + random_bits() % 20 : RECORDS;
                tile_out expected = run_tile(scalar(), in, kind, ids, count);
                if (kind < 2 && count < 24) check_coverage(in, kind, count, data(expected.depth));
                FOR_EACH_ISA(k)
                {
                    tile_out o = run_tile(k, in, kind, ids, count);
                    check_equal(expected.depth, o.depth, true);
                    check_equal(expected.id, o.id, false);
                    check_equal(expected.ids, o.ids, false);
                    check_equal(expected.minimum, o.minimum, true);
                    assert_true(o.hidden == expected.hidden);
                    check_guards(o.depth);
                    check_guards(o.id);
                    check_guards(o.ids);
                    check_guards(o.minimum);
                    free_tile(&o);
                }
                free_tile(&expected);
            }
    }
    free(in);
    free(positions);
    free(uvs);
    free(indices);
    free(texels);
}

/* Depth does not depend on the order in which records come; nor does the triangle, but for equal depths. */
static void test_order(void** state)
{
    tile_input* in = calloc(1, sizeof *in);
    for (int trial = 0; trial < 30; trial++) {
        random_records(in);
        for (int i = 0; i < RECORDS; i++) in->list[i] = (uint32_t)i, in->large[i].id = (uint32_t)i * 7 + 1;
        for (int kind = 0; kind < 2; kind++) {
            tile_out a = run_tile(es_raster_kernels_of(ES_ISA_SCALAR), in, kind, true, RECORDS);
            for (int i = RECORDS - 1; i > 0; i--) {
                uint32_t j = random_bits() % (uint32_t)(i + 1), t = in->list[i];
                in->list[i] = in->list[j];
                in->list[j] = t;
            }
            tile_out c = run_tile(es_raster_kernels_of(ES_ISA_SCALAR), in, kind, true, RECORDS);
            for (int y = 0; y < 64; y++)
                for (int x = 0; x < 64; x++) {
                    assert_int_equal(((uint32_t*)data(a.depth))[y * ES_TILE_PITCH + x], ((uint32_t*)data(c.depth))[y * ES_TILE_PITCH + x]);
                    uint32_t at = (uint32_t)(y * ES_TILE_PITCH + x), first = ((uint32_t*)data(a.id))[at], second = ((uint32_t*)data(c.id))[at];
                    float z = ((float*)data(a.depth))[at];
                    if (z > 0 && z < 1) assert_int_equal(((uint32_t*)data(a.ids))[first], ((uint32_t*)data(c.ids))[second]);
                }
            free_tile(&a);
            free_tile(&c);
        }
    }
    free(in);
}

/* ---- resolve ------------------------------------------------------------------------------------------------------------------ */

enum { WIDTH = 61, HEIGHT = 23, STRIDE = 64, PLANES = 11, NUMBERS = 600 };

static buffer run_resolve(const es_raster_kernels* k, es_resolve_job job, const es_tile* tile)
{
    buffer b = new_buffer(4 * STRIDE * HEIGHT * PLANES);
    buffer scratch[4] = {new_buffer(ES_TILE_VISIBLE_MAX * sizeof(es_visible_triangle)), new_buffer(4 * (NUMBERS + 16)), new_buffer(4 * ES_TILE_VISIBLE_MAX), new_buffer(4 * ES_TILE_VISIBLE_MAX)};
    job.visible = data(scratch[0]);
    job.slot = data(scratch[1]);
    job.slot_number = data(scratch[2]);
    job.slot_pixel = data(scratch[3]);
    memset(job.visible, 0, ES_TILE_VISIBLE_MAX * sizeof(es_visible_triangle));
    memset(job.slot, 0, 4 * (NUMBERS + 16));
    uint32_t* p = data(b);
    memset(p, 0, 4 * STRIDE * HEIGHT * PLANES);
    void** slots[PLANES] = {(void**)&job.gbuffer.depth, (void**)&job.gbuffer.motion_x, (void**)&job.gbuffer.motion_y, (void**)&job.gbuffer.normal,
        (void**)&job.gbuffer.geometric_normal, (void**)&job.gbuffer.albedo_rg, (void**)&job.gbuffer.albedo_b, (void**)&job.gbuffer.surface,
        (void**)&job.gbuffer.emission, (void**)&job.gbuffer.instance, (void**)&job.gbuffer.triangle};
    for (int i = 0; i < PLANES; i++) *slots[i] = p + STRIDE * HEIGHT * i;
    k->resolve_tile(&job, tile);
    for (uint32_t i = 1; i < NUMBERS + 16; i++) assert_int_equal(job.slot[i], 0);
    for (int i = 0; i < 4; i++) {
        check_guards(scratch[i]);
        free_buffer(scratch[i]);
    }
    return b;
}

static void test_resolve(void** state)
{
    enum { V = 256, T = 200, INSTANCES = 3 };
    float* streams[6];
    for (int i = 0; i < 6; i++) streams[i] = calloc(V + 8, 16);
    uint32_t* indices = malloc((3 * T + 1) * 4);
    es_window_vertex* window = calloc(INSTANCES * V, sizeof *window);
    es_window_vertex* deltas = calloc(INSTANCES * V, sizeof *deltas);
    float* depth = calloc(ES_TILE_WORDS + 8, 4);
    uint32_t* number_memory = calloc(ES_TILE_FRONT + ES_TILE_WORDS + 8, 4);
    uint32_t* number = number_memory + ES_TILE_FRONT;
    uint32_t* ids = calloc(NUMBERS + 16, 4);
    uint16_t* texels = malloc(8 * 400);
    for (int i = 0; i < 4 * 400; i++) texels[i] = (uint16_t)random_bits();
    es_texture_image image = {.width = 16, .height = 15, .level_count = 5, .level_offset = {0, 240, 296, 308, 310}, .texels = texels};
    for (int trial = 0; trial < 48; trial++) {
        bool wild = trial % 4 == 3;
        for (int s = 0; s < 6; s++)
            for (int i = 0; i < 4 * V; i++) streams[s][i] = wild ? wild_float(3) : (float)uniform(-3, 3);
        for (int i = 0; i < 3 * T + 1; i++) indices[i] = random_bits() % V;
        for (int i = 0; i < 4 * INSTANCES * V; i++) {
            ((float*)window)[i] = wild ? wild_float(100) : i % 4 == 3 ? (float)uniform(0.1, 9) : (float)uniform(-60, 60);
            ((float*)deltas)[i] = wild ? wild_float(1) : (float)uniform(-1, 1);
        }
        es_raster_mesh mesh = {.positions = streams[0], .indices = indices, .vertex_count = V, .triangle_count = T};
        if (trial % 2) mesh.normals = streams[1];
        if (trial % 3) mesh.uvs = streams[2];
        if (trial % 5) mesh.colors = streams[3];
        if (trial % 4 == 1) mesh.tangents = streams[4];
        es_prepared_material materials[2] = {{.base_color = {0.5f, 1, 0.25f, 1}, .normal_scale = 1, .surface_word = 77, .emission_word = 99}};
        materials[1] = materials[0];
        materials[1].any_texture = true;
        materials[1].roughness = materials[1].metallic = materials[1].specular = 1;
        materials[1].emission[0] = materials[1].emission[2] = 1e6f;
        materials[1].emission[1] = 1e-6f;
        materials[1].model = (uint32_t)trial % 3;
        for (int i = 0; i < ES_TEXTURE_COUNT; i++)
            materials[1].textures[i] = (es_prepared_texture){.image = (trial >> i & 1) ? NULL : &image, .matrix = {1, 0.5f, 0, 1}, .uv_set = (uint32_t)i & 1, .wrap_u = (uint32_t)(trial + i) % 3,
                .wrap_v = (uint32_t)i % 3, .magnify = (uint32_t)i & 1, .minify = (uint32_t)trial & 1, .mip = (uint32_t)(trial + i) % 3};
        es_prepared_instance instances[INSTANCES] = {0};
        uint32_t chunk_instance[INSTANCES];
        for (int i = 0; i < INSTANCES; i++) {
            chunk_instance[i] = (uint32_t)i;
            instances[i] = (es_prepared_instance){.mesh = &mesh, .material = &materials[(i + trial) % 2], .material_index = (uint32_t)i, .instance_id = 5 + (uint32_t)i,
                .first_id = (uint32_t)i << ES_CHUNK_BITS, .first_vertex = (uint32_t)i * V, .first_delta = (uint32_t)i * V, .mirrored = random_bits() & 1,
                .moving = i == 1, .has_deltas = i == 2, .cull_positive = random_bits() & 1, .cull_negative = random_bits() & 1};
            for (int k = 0; k < 12; k++) {
                instances[i].motion[k] = (float)uniform(-0.1, 0.1);
                instances[i].world[k] = (float)uniform(-1, 1);
                if (k < 9) instances[i].normal_matrix[k] = (float)uniform(-1, 1);
            }
        }
        for (int i = 0; i < ES_TILE_WORDS; i++) {
            depth[i] = random_bits() % 5 ? 0.5f : 0;
            number[i] = depth[i] > 0 ? 1 + (trial % 3 ? random_bits() : (uint32_t)i / 13) % NUMBERS : 0;
        }
        for (uint32_t i = 1; i <= NUMBERS; i++) ids[i] = random_bits() % INSTANCES << ES_CHUNK_BITS | random_bits() % T;
        es_tile tile = {.depth = depth, .number = number, .triangle_ids = ids, .next_number = NUMBERS + 1, .x = 0, .y = 0, .width = WIDTH, .height = HEIGHT};
        es_resolve_job job = {.instances = instances, .chunk_instance = chunk_instance, .vertices = window, .deltas = deltas, .orthographic = trial % 6 == 5,
            .row_x = {30, 0, 0, 0}, .row_y = {0, -11, 1, 0}, .row_z = {0, 0, 0.1f, 0.1f}, .row_w = {0, 0, -1, 0}, .distance_scale = -9, .distance_offset = 9, .z_scale = -0.1f, .z_offset = 0.1f,
            .gbuffer = {.width = WIDTH, .height = HEIGHT, .stride = STRIDE, .planes = ES_GBUFFER_ALL}};
        buffer expected = run_resolve(scalar(), job, &tile);
        FOR_EACH_ISA(k)
        {
            buffer b = run_resolve(k, job, &tile);
            check_equal(expected, b, false);
            check_guards(b);
            free_buffer(b);
        }
        free_buffer(expected);
    }
    for (int i = 0; i < 6; i++) free(streams[i]);
    free(indices);
    free(window);
    free(deltas);
    free(depth);
    free(number_memory);
    free(ids);
    free(texels);
}

/* ---- packing -------------------------------------------------------------------------------------------------------------------- */

static void test_packing(void** state)
{
    double worst = 0;
    for (int i = 0; i < 100000; i++) {
        double n[3], l = 0;
        for (int k = 0; k < 3; k++) n[k] = i % 10 == k ? (random_bits() % 3) - 1.0 : uniform(-1, 1), l += n[k] * n[k];
        if (l < 1e-6) continue;
        l = sqrt(l);
        double length = pow(10, uniform(-20, 20)) / l;
        es_vec3 v = {(float)(n[0] * length), (float)(n[1] * length), (float)(n[2] * length)};
        es_vec3 u = es_unpack_normal(es_pack_normal(v));
        double c[3] = {n[1] * u.z - n[2] * u.y, n[2] * u.x - n[0] * u.z, n[0] * u.y - n[1] * u.x};
        double angle = atan2(sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]), n[0] * u.x + n[1] * u.y + n[2] * u.z);
        if (angle > worst) worst = angle;
    }
    assert_true(worst < 0.004 * 3.14159265 / 180);
    for (int i = 0; i < 100000; i++) {
        double scale = pow(2, uniform(-20, 16));
        es_vec3 c = {(float)uniform(0, scale), (float)uniform(0, scale), (float)uniform(0, scale)};
        es_vec3 d = es_unpack_rgb9e5(es_pack_rgb9e5(c));
        double top = fmax(c.x, fmax(c.y, c.z)), step = fmax(top / 256, 1.0 / (1 << 24));
        if (top > ES_RGB9E5_MAX) continue;
        assert_true(fabs(c.x - d.x) <= step / 2 * 1.0001 && fabs(c.y - d.y) <= step / 2 * 1.0001 && fabs(c.z - d.z) <= step / 2 * 1.0001);
        assert_int_equal(es_pack_rgb9e5(d), es_pack_rgb9e5(es_unpack_rgb9e5(es_pack_rgb9e5(d))));
    }
    es_vec3 extreme = es_unpack_rgb9e5(es_pack_rgb9e5((es_vec3){1e30f, NAN, -5}));
    assert_true(extreme.x == ES_RGB9E5_MAX && extreme.y == 0 && extreme.z == 0);
    assert_int_equal(es_pack_rgb9e5((es_vec3){0, 0, 0}), 0);
    for (uint32_t i = 0; i < 65536; i++) assert_int_equal(es_pack_unorm16(es_unpack_unorm16(i)), i);
    assert_int_equal(es_pack_unorm16(NAN), 0);
    assert_int_equal(es_pack_unorm16(2), 65535);
    assert_int_equal(es_pack_unorm16(-1), 0);
}

/* ---- time ------------------------------------------------------------------------------------------------------------------------- */

static void print_times(void)
{
    tile_input* in = calloc(1, sizeof *in);
    random_records(in);
    enum { N = 1024 };
    float* positions = calloc(N, 16);
    for (int i = 0; i < 4 * N; i++) positions[i] = (float)uniform(-4, 4);
    es_snapped_vertex* snapped = calloc(N, sizeof *snapped);
    es_window_vertex* window = calloc(N, sizeof *window);
    es_window_matrix m = {{512, 3, 1, 2, 4, -384, 2, 1, 0, 0, 0, 0.1f, 0, 0, -1, 0.5f}};
    printf("%-8s %20s %20s %20s\n", "ns per", "vertex", "small record", "large record");
    FOR_EACH_ISA(k)
    {
        double best[3] = {1e9, 1e9, 1e9};
        for (int run = 0; run < 30; run++) {
            double t = es_seconds();
            for (int i = 0; i < 20; i++) k->transform_vertices(positions, N, &m, 512, 384, snapped, window);
            t = (es_seconds() - t) / (20 * N);
            best[0] = t < best[0] ? t : best[0];
            for (int kind = 0; kind < 2; kind++) {
                t = es_seconds();
                tile_out o = run_tile(k, in, kind, true, RECORDS);
                t = (es_seconds() - t) / RECORDS;
                free_tile(&o);
                best[1 + kind] = t < best[1 + kind] ? t : best[1 + kind];
            }
        }
        printf("%-8s %20.2f %20.2f %20.2f\n", es_isa_name((es_isa)isa_), best[0] * 1e9, best[1] * 1e9, best[2] * 1e9);
    }
    free(in);
    free(positions);
    free(snapped);
    free(window);
}

int main(int argc, char** argv)
{
    if (argc > 1 && !strcmp(argv[1], "--time")) {
        print_times();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_transform), cmocka_unit_test(test_bin),     cmocka_unit_test(test_tiles),
        cmocka_unit_test(test_order),     cmocka_unit_test(test_resolve), cmocka_unit_test(test_packing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
