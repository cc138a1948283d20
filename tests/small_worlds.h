/* Worlds of rectangles and spheres, for tests that know how much light there has to be. */
#ifndef EARTHSHINE_TESTS_SMALL_WORLDS_H
#define EARTHSHINE_TESTS_SMALL_WORLDS_H

#include <math.h>
#include <stdlib.h>

#include "gi/gi.h"
#include "platform/maths.h"

typedef struct small_world { es_context* context; es_world* world; es_camera camera; } small_world;

static inline small_world small_world_create(void)
{
    small_world w = {0};
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    assert_int_equal(es_context_create(&desc, &w.context), ES_OK);
    assert_int_equal(es_world_create(w.context, NULL, &w.world), ES_OK);
    return w;
}
static inline void small_world_destroy(small_world* w)
{
    es_world_destroy(w->world);
    assert_int_equal(es_context_bytes(w->context), 0);
    es_context_destroy(w->context);
}

/* Lambert, seen and lit from the side its triangles run counter-clockwise. */
static inline es_material_desc lambert(float albedo, float emission)
{
    es_material_desc d = es_default_material_desc();
    d.specular = 0;
    for (int c = 0; c < 3; c++) {
        d.base_color[c] = albedo;
        d.emission[c] = emission;
    }
    return d;
}

/* -z along `direction` */
static inline es_node node_towards(small_world* w, es_vec3 position, es_vec3 direction)
{
    es_vec3 d = es_v3_normalize(direction, es_v3(0, 0, -1));
    es_quat q = {d.y, -d.x, 0, 1 - d.z}; /* (0, 0, -1) × d and 1 + (0, 0, -1)·d */
    if (d.z > 0.9999f) q = es_quat_from_axis_angle(es_v3(0, 1, 0), ES_PI);
    es_node_desc desc = {.transform = {position, es_quat_normalize(q), {1, 1, 1}}};
    es_node node;
    assert_int_equal(es_world_add_node(w->world, &desc, &node), ES_OK);
    return node;
}

static inline void add_instance(small_world* w, const es_mesh_desc* mesh_desc, const es_material_desc* material_desc)
{
    es_mesh mesh;
    es_material material;
    es_instance instance;
    assert_int_equal(es_world_add_mesh(w->world, mesh_desc, &mesh), ES_OK);
    assert_int_equal(es_world_add_material(w->world, "", material_desc, &material), ES_OK);
    assert_int_equal(es_world_add_instance(w->world, &(es_instance_desc){.mesh = mesh, .material = material}, &instance), ES_OK);
}

/* A parallelogram facing u × v. */
static inline void add_rectangle(small_world* w, es_vec3 corner, es_vec3 u, es_vec3 v, const es_material_desc* material)
{
    es_vec3 p[4] = {corner, es_v3_add(corner, u), es_v3_add(es_v3_add(corner, u), v), es_v3_add(corner, v)};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    add_instance(w, &(es_mesh_desc){.vertex_count = 4, .triangle_count = 2, .positions = &p[0].x, .indices = indices, .flat_normals = true}, material);
}

/* 2 m × 2 m × 2 m about the origin, facing inside. */
static inline void add_closed_box(small_world* w, const es_material_desc* material)
{
    for (int k = 0; k < 3; k++)
        for (int side = -1; side <= 1; side += 2) {
            es_vec3 corner = es_v3(-1, -1, -1), u = es_v3(0, 0, 0), v = u;
            (&corner.x)[k] = (float)side;
            (&u.x)[(k + 1) % 3] = 2;
            (&v.x)[(k + 2) % 3] = 2;
            if (side < 0) add_rectangle(w, corner, u, v, material);
            else add_rectangle(w, corner, v, u, material);
        }
}

/* 2 segments × segments quads with smooth normals, inscribed in the sphere, facing its inside or its outside. */
static inline void add_sphere(small_world* w, es_vec3 centre, float radius, uint32_t segments, bool inside, const es_material_desc* material)
{
    uint32_t columns = 2 * segments, vertices = 0, count = 0;
    float* positions = malloc((columns + 1) * (segments + 1) * 3 * sizeof(float));
    float* normals = malloc((columns + 1) * (segments + 1) * 3 * sizeof(float));
    uint32_t* indices = malloc(columns * segments * 6 * sizeof(uint32_t));
    for (uint32_t v = 0; v <= segments; v++)
        for (uint32_t u = 0; u <= columns; u++) {
            float a = 2 * ES_PI * (float)(u % columns) / (float)columns, b = ES_PI * (float)v / (float)segments;
            const float n[3] = {v == segments ? 0 : es_sin(b) * es_cos(a), es_cos(b), v == segments ? 0 : -es_sin(b) * es_sin(a)}, c[3] = {centre.x, centre.y, centre.z};
            for (int k = 0; k < 3; k++) {
                positions[3 * vertices + (uint32_t)k] = c[k] + radius * n[k];
                normals[3 * vertices + (uint32_t)k] = inside ? -n[k] : n[k];
            }
            vertices++;
        }
    for (uint32_t v = 0; v < segments; v++)
        for (uint32_t u = 0; u < columns; u++) {
            uint32_t a = v * (columns + 1) + u, b = a + columns + 1;
            const uint32_t two[2][3] = {{a, b, b + 1}, {a, b + 1, a + 1}};
            for (int t = v == segments - 1 ? 1 : 0; t < (v == 0 ? 1 : 2); t++)
                for (int k = 0; k < 3; k++) indices[count++] = two[t][inside ? 2 - k : k];
        }
    add_instance(w, &(es_mesh_desc){.vertex_count = vertices, .triangle_count = count / 3, .positions = positions, .normals = normals, .indices = indices}, material);
    free(positions);
    free(normals);
    free(indices);
}

static inline es_light add_light(small_world* w, es_light_desc desc, es_vec3 position, es_vec3 direction)
{
    es_light light;
    desc.node = node_towards(w, position, direction);
    assert_int_equal(es_world_add_light(w->world, &desc, &light), ES_OK);
    return light;
}

static inline void look(small_world* w, es_camera_desc desc, es_vec3 eye, es_vec3 at)
{
    desc.node = node_towards(w, eye, es_v3_sub(at, eye));
    assert_int_equal(es_world_add_camera(w->world, &desc, &w->camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(w->world, w->camera), ES_OK);
    assert_int_equal(es_world_step(w->world, 0), ES_OK);
}

/* The point where the middle of pixel (x, y) meets the plane through `point` with normal n. */
static inline es_vec3 pixel_on_plane(const small_world* w, uint32_t width, uint32_t height, double x, double y, es_vec3 point, es_vec3 n)
{
    es_raster_view view;
    assert_int_equal(es_world_camera_view(w->world, w->camera, width, height, &view), ES_OK);
    es_mat4 clip = es_mat4_mul(view.projection, view.view), inverse;
    assert_true(es_mat4_inverse(&clip, &inverse));
    float cx = (float)(2 * (x + 0.5) / width - 1), cy = (float)(1 - 2 * (y + 0.5) / height);
    es_vec4 a = es_mat4_vec4(&inverse, (es_vec4){cx, cy, 1, 1}), b = es_mat4_vec4(&inverse, (es_vec4){cx, cy, 0.5f, 1});
    es_vec3 p = es_v3(a.x / a.w, a.y / a.w, a.z / a.w), q = es_v3(b.x / b.w, b.y / b.w, b.z / b.w), d = es_v3_sub(q, p);
    float t = es_v3_dot(es_v3_sub(point, p), n) / es_v3_dot(d, n);
    return es_v3_add(p, es_v3_scale(d, t));
}

#endif
