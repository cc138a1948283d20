/* The gallery and the tubes its dragon is made of: so many triangles, the same ones each time, closed, with unit normals that look outwards. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include <earthshine/sim.h>

#include "platform/maths.h"
#include "platform/random.h"
#include "sim/scenes/dragon.h"
#include "sim/scenes/sweep.h"

static es_world* open_gallery(es_context* context, uint32_t triangles)
{
    es_world_settings settings = es_default_world_settings();
    settings.triangles = triangles;
    es_world* world;
    assert_int_equal(es_world_create_scene(context, "gallery", &settings, &world), ES_OK);
    return world;
}

static const es_raster_mesh* mesh_named(const es_world* world, const char* name)
{
    uint32_t ids[128];
    size_t count = 128;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_MESH, ids, &count), ES_OK);
    for (size_t i = 0; i < count; i++)
        if (!strcmp(es_world_name(world, ES_OBJECT_MESH, ids[i]), name)) return es_world_mesh(world, (es_mesh){ids[i]});
    fail_msg("no mesh %s", name);
    return NULL;
}

static uint64_t hash_of(const es_raster_mesh* mesh)
{
    uint64_t hash = es_hash_bytes(0, mesh->positions, mesh->vertex_count * 16ull);
    hash = es_hash_bytes(hash, mesh->normals, mesh->vertex_count * 16ull);
    return es_hash_bytes(hash, mesh->indices, mesh->triangle_count * 12ull);
}

static void test_numbers_of_triangles(void** state)
{
    static const struct { uint32_t asked, least, most; } cases[] = {{0, 626304, 626304}, {100000, 85000, 115000}, {2500, 2500, 25000}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        es_world* world = open_gallery(*state, cases[i].asked);
        const es_draw_list* list = es_world_draw_list(world);
        uint32_t all = 0, dragon = mesh_named(world, "dragon")->triangle_count;
        for (uint32_t k = 0; k < list->instance_count; k++) all += list->instances[k].mesh->triangle_count;
        printf("%u asked for: %u triangles, %u and %u of them the dragon's\n", cases[i].asked, all, dragon, mesh_named(world, "horns and claws")->triangle_count + mesh_named(world, "eyes")->triangle_count);
        if (all < cases[i].least || all > cases[i].most) fail_msg("%u triangles", all);
        if (cases[i].asked == 0) {
            assert_true(dragon >= 500000);
            assert_int_equal(dragon + mesh_named(world, "horns and claws")->triangle_count + mesh_named(world, "eyes")->triangle_count, ES_DRAGON_TRIANGLES);
        }
        es_world_destroy(world);
    }
}

static void test_the_same_dragon_each_time(void** state)
{
    es_world *one = open_gallery(*state, 20000), *other = open_gallery(*state, 20000);
    const uint64_t hash = hash_of(mesh_named(one, "dragon"));
    assert_true(hash == hash_of(mesh_named(other, "dragon")));
    if (hash != 0xa4d272c2dea926c1) fail_msg("another dragon than every compiler and instruction set makes: %016llx", (unsigned long long)hash);
    es_world_destroy(one);
    es_world_destroy(other);
}

static es_vec3 at(const float* stream, uint32_t vertex) { return es_v3(stream[4 * (size_t)vertex], stream[4 * (size_t)vertex + 1], stream[4 * (size_t)vertex + 2]); }

static void test_normals_are_smooth_and_face_out(void** state)
{
    es_world* world = open_gallery(*state, 120000);
    const es_raster_mesh* mesh = mesh_named(world, "dragon");
    uint32_t against = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) assert_float_equal(es_v3_length(at(mesh->normals, v)), 1, 1e-4f);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t* i = mesh->indices + 3 * (size_t)t;
        const es_vec3 a = at(mesh->positions, i[0]), b = at(mesh->positions, i[1]), c = at(mesh->positions, i[2]);
        const es_vec3 geometric = es_v3_cross(es_v3_sub(b, a), es_v3_sub(c, a));
        for (int k = 0; k < 3; k++) against += es_v3_dot(geometric, at(mesh->normals, i[k])) < 0;
    }
    /* the steep ends of scales alone */
    if (against > 3 * mesh->triangle_count / 50) fail_msg("%u of %u corners turn from their triangles", against, 3 * mesh->triangle_count);
    es_world_destroy(world);
}

/* A sphere as a tube: stations on half a circle, every normal along its vertex. */
static void test_a_sphere_by_stations(void** state)
{
    enum { STATIONS = 65 };
    es_sweep_station stations[STATIONS];
    for (int i = 0; i < STATIONS; i++) {
        const float angle = ES_PI * (float)i / (STATIONS - 1), radius = i == 0 || i == STATIONS - 1 ? 0 : es_sin(angle);
        stations[i] = (es_sweep_station){es_v3(0, 0, -es_cos(angle)), radius, radius, es_v3(0, 1, 0)};
    }
    es_shape shape = es_shape_begin(*state);
    es_shape_sweep(&shape, &(es_sweep){.stations = stations, .count = STATIONS, .along = 64, .around = 48});
    assert_false(shape.failed);
    assert_int_equal(shape.triangle_count, 2 * 48 * 64 - 2 * 48);
    double volume = 0;
    for (size_t v = 0; v < shape.vertex_count; v++) {
        const es_vec3 p = {shape.positions[3 * v], shape.positions[3 * v + 1], shape.positions[3 * v + 2]}, n = {shape.normals[3 * v], shape.normals[3 * v + 1], shape.normals[3 * v + 2]};
        assert_float_equal(es_v3_length(p), 1, 1e-4f);
        if (es_v3_dot(p, n) < 0.995f) fail_msg("vertex %zu: normal %.4f off", v, (double)es_v3_dot(p, n));
    }
    for (size_t t = 0; t < shape.triangle_count; t++) {
        es_vec3 p[3];
        for (int k = 0; k < 3; k++) {
            const float* q = shape.positions + 3 * (size_t)shape.indices[3 * t + (size_t)k];
            p[k] = es_v3(q[0], q[1], q[2]);
        }
        volume += es_v3_dot(p[0], es_v3_cross(p[1], p[2])) / 6;
    }
    assert_float_equal(volume, 4.18879, 0.03); /* outwards, and as much as a sphere's */
    es_shape_free(&shape);
}

static int open_context(void** state)
{
    es_context* context;
    if (es_context_create(NULL, &context) != ES_OK) return 1;
    *state = context;
    return 0;
}

static int close_context(void** state)
{
    es_context_destroy(*state);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_numbers_of_triangles), cmocka_unit_test(test_the_same_dragon_each_time), cmocka_unit_test(test_normals_are_smooth_and_face_out),
        cmocka_unit_test(test_a_sphere_by_stations)};
    return cmocka_run_group_tests(tests, open_context, close_context);
}
