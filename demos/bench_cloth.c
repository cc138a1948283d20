/* The cloth of `bench dynamics`: peers/rigid/bullet_cloth.cpp's patch of 2 by 2 m and 1 kg, held by two corners, that swings onto a sphere. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>

static bool add_sphere(es_world* world)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.type = ES_SHAPE_SPHERE;
    shape.radius = 0.5f;
    es_body_desc desc = es_default_body_desc();
    desc.type = ES_BODY_STATIC;
    desc.position[1] = -0.8;
    desc.position[2] = 0.2;
    desc.shapes = &shape;
    desc.shape_count = 1;
    es_body body;
    return es_world_add_body(world, &desc, &body) == ES_OK;
}

static bool add_patch(es_world* world, uint32_t n, es_soft* soft)
{
    float* positions = malloc((size_t)n * n * 3 * sizeof *positions);
    uint32_t* indices = malloc((size_t)(n - 1) * (n - 1) * 6 * sizeof *indices);
    bool works = positions && indices;
    for (uint32_t i = 0; i < n * n && works; i++) {
        positions[3 * i] = -1 + 2 * (float)(i % n) / (float)(n - 1);
        positions[3 * i + 1] = 0;
        positions[3 * i + 2] = -1 + 2 * (float)(i / n) / (float)(n - 1);
    }
    uint32_t count = 0;
    for (uint32_t z = 0; z + 1 < n && works; z++)
        for (uint32_t x = 0; x + 1 < n; x++) {
            const uint32_t a = z * n + x, corners[6] = {a, a + n, a + 1, a + 1, a + n, a + n + 1};
            for (int k = 0; k < 6; k++) indices[count++] = corners[k];
        }
    es_mesh mesh;
    const es_mesh_desc mesh_desc = {.vertex_count = n * n, .triangle_count = count / 3, .positions = positions, .indices = indices};
    works = works && es_world_add_mesh(world, &mesh_desc, &mesh) == ES_OK;
    if (works) {
        const es_soft_attachment held[2] = {{.vertex = 0, .in_place = true}, {.vertex = n - 1, .in_place = true}};
        es_soft_desc desc = es_default_soft_desc();
        desc.mesh = mesh;
        desc.mass = 1;
        desc.thickness = 0.02f;
        desc.attachments = held;
        desc.attachment_count = 2;
        works = es_world_add_soft(world, &desc, soft) == ES_OK;
    }
    free(positions);
    free(indices);
    return works;
}

bool bench_cloth(uint32_t n, uint32_t threads, uint32_t steps, double* milliseconds, double* stretch, double* deepest)
{
    enum { MOST = 600 };
    static double times[MOST];
    es_context* context = NULL;
    es_world* world = NULL;
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = threads;
    es_world_settings settings = es_default_world_settings();
    settings.sleep = false;
    es_soft soft;
    bool works = steps <= MOST && es_context_create(&desc, &context) == ES_OK && es_world_create(context, &settings, &world) == ES_OK && add_sphere(world) && add_patch(world, n, &soft);
    for (uint32_t i = 0; i < steps && works; i++) {
        double begin = demo_seconds();
        works = es_world_step(world, 1.0f / 60) == ES_OK;
        times[i] = (demo_seconds() - begin) * 1000;
    }
    es_soft_state state;
    works = works && es_world_get_soft_state(world, soft, &state) == ES_OK;
    if (works) {
        *milliseconds = bench_median(times, steps);
        *stretch = (double)state.largest_stretch;
        *deepest = -1e9;
        for (uint32_t v = 0; v < n * n && works; v++) {
            double p[3];
            works = es_world_get_soft_vertex(world, soft, v, p, NULL) == ES_OK;
            double d[3] = {p[0], p[1] + 0.8, p[2] - 0.2};
            *deepest = fmax(*deepest, 0.5 - sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
        }
    }
    if (!works && context) fprintf(stderr, "earthshine: %s\n", es_context_message(context));
    if (world) es_world_destroy(world);
    if (context) es_context_destroy(context);
    return works;
}
