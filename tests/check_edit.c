/* Edited directions: every instruction set against scalar, bit for bit, on random G-buffers of odd sizes, regions of all shapes and constraints near and far, with guards
 * round what is written.
 *
 * check_edit --time prints pixels per second for 1280 × 960 pixels that one region covers, with 1, 4 and 32 constraints. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"
#include "tests/guarded_planes.h"

enum { TRIANGLES = 64, VERTICES = 40, CONSTRAINTS = 33, STROKES = 5, REGIONS = 4 };

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(31, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }
static es_vec3 direction(void) { return es_v3_normalize(es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), es_v3(0, 1, 0)); }

typedef struct content {
    float positions[VERTICES * 4];
    uint32_t indices[TRIANGLES * 3 + 4];
    float fields[4][VERTICES];
    es_edit_stroke strokes[STROKES];
    es_edit_constraint constraints[CONSTRAINTS];
    es_edit_region regions[REGIONS];
} content;

static void fill(content* c)
{
    for (int i = 0; i < VERTICES * 4; i++) c->positions[i] = uniform(-2, 2);
    for (int i = 0; i < TRIANGLES * 3; i++) c->indices[i] = random_bits() % VERTICES;
    for (int f = 0; f < 4; f++)
        for (int i = 0; i < VERTICES; i++) c->fields[f][i] = random_bits() % 20 ? uniform(0, 3) : random_bits() % 2 ? 0.0f : INFINITY;
    for (int i = 0; i < STROKES; i++) {
        es_edit_stroke* s = &c->strokes[i];
        for (int k = 0; k < 3; k++) s->to[k] = (s->from[k] = uniform(-1, 1)) + (random_bits() % 4 ? uniform(-1, 1) : 0.0f);
        s->radius = uniform(0, 1);
        s->erases = random_bits() % 4 == 0;
    }
    for (int i = 0; i < CONSTRAINTS; i++) {
        es_edit_constraint* n = &c->constraints[i];
        const es_vec3 r = direction(), e = random_bits() % 8 ? direction() : es_v3_scale(r, random_bits() % 2 ? 1.0f : -1.0f);
        for (int k = 0; k < 3; k++) n->position[k] = random_bits() % 30 ? uniform(-1, 1) : uniform(-1e12f, 1e12f);
        n->distances = random_bits() % 2 ? c->fields[random_bits() % 4] : NULL;
        es_edit_constraint_matrix(r, e, n->matrix);
    }
    for (int i = 0; i < REGIONS; i++) {
        es_edit_region* region = &c->regions[i];
        const uint32_t first = random_bits() % CONSTRAINTS;
        *region = (es_edit_region){.shape = random_bits() % 3, .instance = random_bits() % 3, .centre = {uniform(-1, 1), uniform(-1, 1), uniform(-2, 0)}, .radius = uniform(0.01f, 3), .border = random_bits() % 4 ? uniform(0, 1) : 0.0f, .strokes = c->strokes,
            .stroke_count = random_bits() % (STROKES + 1), .distances = c->fields[i], .mesh = {1 + random_bits() % 2, c->positions, c->indices, es_mat4_identity()}, .constraints = c->constraints + first, .constraint_count = 1 + random_bits() % (CONSTRAINTS - first)};
        if (region->shape == ES_EDIT_GEODESIC) region->instance = region->mesh.instance;
        memcpy(region->ball, region->centre, sizeof region->centre);
        region->ball[3] = random_bits() % 3 ? 1e4f : region->radius * region->radius;
    }
}

static es_gbuffer new_gbuffer(uint32_t width, uint32_t height)
{
    es_gbuffer g = {.width = width, .height = height, .stride = (width + 7) / 8 * 8};
    const size_t count = (size_t)g.stride * height;
    g.depth = malloc(count * 4);
    g.normal = malloc(count * 4);
    g.instance = malloc(count * 4);
    g.triangle = malloc(count * 4);
    for (size_t i = 0; i < count; i++) {
        const uint32_t r = random_bits();
        g.depth[i] = r % 16 == 0 ? 0.0f : r % 16 == 1 ? uniform(0.1f, 1e6f) : uniform(0.5f, 2);
        g.normal[i] = random_bits();
        g.instance[i] = 1 + random_bits() % 3;
        g.triangle[i] = 1 + random_bits() % TRIANGLES;
    }
    return g;
}
static void free_gbuffer(es_gbuffer* g)
{
    free(g->depth);
    free(g->normal);
    free(g->instance);
    free(g->triangle);
}

static es_pixel_rays rays_of(uint32_t width, uint32_t height)
{
    return (es_pixel_rays){.dir = {-1, 1, -1}, .dir_dx = {2.0f / (float)width, 0, 0}, .dir_dy = {0, -2.0f / (float)height, 0}};
}

static void check_directions(void** state)
{
    (void)state;
    content* c = malloc(sizeof *c);
    for (uint32_t trial = 0; trial < 120; trial++) {
        const uint32_t width = 1 + random_bits() % 90, height = 1 + random_bits() % 30;
        es_gbuffer g = new_gbuffer(width, height);
        const size_t count = (size_t)g.stride * height;
        fill(c);
        es_edit_job job = {.gbuffer = &g, .rays = rays_of(width, height), .regions = c->regions, .region_count = random_bits() % (REGIONS + 1), .frozen = trial % 3 == 0, .eye = {0.3f, 0.2f, 1}};
        float* original[3];
        plane expected[3], result[3];
        for (int k = 0; k < 3; k++) {
            original[k] = malloc(count * 4);
            for (size_t i = 0; i < count; i++) original[k][i] = i % 5 ? uniform(-1, 1) : 0.0f;
            job.original[k] = trial % 4 == 1 ? original[k] : NULL;
            expected[k] = new_plane(count);
            result[k] = new_plane(count);
        }
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            plane* to = isa == ES_ISA_SCALAR ? expected : result;
            for (int k = 0; k < 3; k++) job.edited[k] = at(to[k]);
            es_gi_kernel_table((es_isa)isa)->edit_directions(&job, 0, height);
            for (int k = 0; k < 3; k++) {
                check_guards(to[k]);
                for (uint32_t y = 0; y < height; y++)
                    for (uint32_t x = 0; x < width; x++) {
                        const size_t i = (size_t)y * g.stride + x;
                        assert_memory_equal(at(to[k]) + i, at(expected[k]) + i, 4);
                        assert_true(at(to[k])[i] >= -1.00001f && at(to[k])[i] <= 1.00001f);
                    }
            }
        }
        for (int k = 0; k < 3; k++) {
            free(original[k]);
            free(expected[k].memory);
            free(result[k].memory);
        }
        free_gbuffer(&g);
    }
    free(c);
}

static void time_all(void)
{
    enum { WIDTH = 1280, HEIGHT = 960, RUNS = 9 };
    es_gbuffer g = new_gbuffer(WIDTH, HEIGHT);
    content* c = malloc(sizeof *c);
    fill(c);
    float* planes[3];
    for (int k = 0; k < 3; k++) planes[k] = malloc((size_t)WIDTH * HEIGHT * 4);
    static const uint32_t counts[] = {1, 4, 32};
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
            for (uint32_t k = 0; k < counts[i]; k++) c->constraints[k].distances = NULL;
            const es_edit_region region = {.shape = ES_EDIT_BALL, .radius = 1e3f, .border = 1, .ball = {0, 0, 0, 1e6f}, .constraints = c->constraints, .constraint_count = counts[i]};
            const es_edit_job job = {.gbuffer = &g, .rays = rays_of(WIDTH, HEIGHT), .regions = &region, .region_count = 1, .edited = {planes[0], planes[1], planes[2]}};
            double best = 1e9;
            for (int run = 0; run < RUNS; run++) {
                const double start = es_seconds();
                es_gi_kernel_table((es_isa)isa)->edit_directions(&job, 0, HEIGHT);
                best = es_seconds() - start < best ? es_seconds() - start : best;
            }
            printf("%-8s %2u constraints: %.1f Mpixel/s on one thread\n", es_isa_name((es_isa)isa), counts[i], WIDTH * HEIGHT / best * 1e-6);
        }
    }
    for (int k = 0; k < 3; k++) free(planes[k]);
    free(c);
    free_gbuffer(&g);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(check_directions)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
