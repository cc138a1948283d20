/* What the stress tests share: a world whose whole scene hangs on one node, so that it can be scaled and moved, rendering to images, and
 * the measures the bounds are stated in. */
#ifndef EARTHSHINE_TESTS_STRESS_H
#define EARTHSHINE_TESTS_STRESS_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/gi.h"
#include "platform/maths.h"
#include "platform/random.h"

/* ---- worlds ---------------------------------------------------------------------------------------------------------------------- */

typedef struct stress { es_context* context; es_world* world; es_node root; es_camera camera; float scale; } stress;

/* The next of `count` cases that go from one extreme to the other. Sanitizers, under which they take ten times as long, see both ends. */
static inline size_t stress_next(size_t i, size_t count)
{
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return i + 1 < count ? count - 1 : count;
#else
    return i + 1;
#endif
}

/* Everything below is a child of a node that scales by `scale` and then moves by `offset`. */
static inline stress stress_open_in(const es_context_desc* desc, float scale, es_vec3 offset)
{
    stress s = {.scale = scale};
    assert_int_equal(es_context_create(desc, &s.context), ES_OK);
    assert_int_equal(es_world_create(s.context, NULL, &s.world), ES_OK);
    es_node_desc root = {.transform = {offset, {0, 0, 0, 1}, {scale, scale, scale}}};
    assert_int_equal(es_world_add_node(s.world, &root, &s.root), ES_OK);
    return s;
}

static inline stress stress_open(float scale, es_vec3 offset)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    return stress_open_in(&desc, scale, offset);
}

static inline void stress_close(stress* s)
{
    es_world_destroy(s->world);
    assert_int_equal(es_context_bytes(s->context), 0);
    es_context_destroy(s->context);
}

/* A child of the root with its -z along `direction`. */
static inline es_node stress_node(stress* s, es_vec3 position, es_vec3 direction)
{
    es_vec3 d = es_v3_normalize(direction, es_v3(0, 0, -1));
    es_quat q = {d.y, -d.x, 0, 1 - d.z}; /* (0, 0, -1) × d and 1 + (0, 0, -1)·d */
    if (d.z > 0.9999f) q = es_quat_from_axis_angle(es_v3(0, 1, 0), ES_PI);
    es_node_desc desc = {.parent = s->root, .transform = {position, es_quat_normalize(q), {1, 1, 1}}};
    es_node node;
    assert_int_equal(es_world_add_node(s->world, &desc, &node), ES_OK);
    return node;
}

static inline es_material_desc matte(float r, float g, float b)
{
    es_material_desc d = es_default_material_desc();
    d.specular = 0;
    d.base_color[0] = r;
    d.base_color[1] = g;
    d.base_color[2] = b;
    d.double_sided = true;
    return d;
}

static inline es_material_desc polished(float r, float g, float b, float roughness)
{
    es_material_desc d = matte(r, g, b);
    d.metallic = 1;
    d.roughness = roughness;
    return d;
}

static inline es_instance stress_mesh(stress* s, const es_mesh_desc* mesh_desc, const es_material_desc* material_desc, es_node node)
{
    es_mesh mesh;
    es_material material;
    es_instance instance;
    assert_int_equal(es_world_add_mesh(s->world, mesh_desc, &mesh), ES_OK);
    assert_int_equal(es_world_add_material(s->world, "", material_desc, &material), ES_OK);
    assert_int_equal(es_world_add_instance(s->world, &(es_instance_desc){.node = node, .mesh = mesh, .material = material}, &instance), ES_OK);
    return instance;
}

static const uint32_t quad_indices[6] = {0, 1, 2, 0, 2, 3};

/* A parallelogram facing u × v. */
static inline es_instance stress_rectangle(stress* s, es_vec3 corner, es_vec3 u, es_vec3 v, const es_material_desc* material)
{
    es_vec3 p[4] = {corner, es_v3_add(corner, u), es_v3_add(es_v3_add(corner, u), v), es_v3_add(corner, v)};
    return stress_mesh(s, &(es_mesh_desc){.vertex_count = 4, .triangle_count = 2, .positions = &p[0].x, .indices = quad_indices, .flat_normals = true}, material, s->root);
}

/* An axis-aligned box, faces outwards, or inwards where `inside`. */
static inline es_instance stress_box(stress* s, es_vec3 low, es_vec3 high, bool inside, const es_material_desc* material)
{
    const float c[2][3] = {{low.x, low.y, low.z}, {high.x, high.y, high.z}};
    float positions[24][3];
    uint32_t indices[36], vertices = 0, count = 0;
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            for (int k = 0; k < 4; k++) {
                positions[vertices + (uint32_t)k][axis] = c[side][axis];
                positions[vertices + (uint32_t)k][(axis + 1) % 3] = c[k == 1 || k == 2][(axis + 1) % 3];
                positions[vertices + (uint32_t)k][(axis + 2) % 3] = c[k >= 2][(axis + 2) % 3];
            }
            for (int k = 0; k < 6; k++) indices[count + (uint32_t)k] = vertices + quad_indices[(side == 1) != inside ? k : 5 - k];
            count += 6;
            vertices += 4;
        }
    return stress_mesh(s, &(es_mesh_desc){.vertex_count = 24, .triangle_count = 12, .positions = &positions[0][0], .indices = indices, .flat_normals = true}, material, s->root);
}

/* Rows × columns quads about the centre with smooth normals. */
static inline es_instance stress_ball(stress* s, es_vec3 centre, float radius, uint32_t rows, bool inside, const es_material_desc* material)
{
    uint32_t columns = 2 * rows, vertices = 0, count = 0;
    float* positions = malloc((columns + 1) * (rows + 1) * 3 * sizeof(float));
    float* normals = malloc((columns + 1) * (rows + 1) * 3 * sizeof(float));
    uint32_t* indices = malloc(columns * rows * 6 * sizeof(uint32_t));
    for (uint32_t v = 0; v <= rows; v++)
        for (uint32_t u = 0; u <= columns; u++, vertices++) {
            float a = 2 * ES_PI * (float)(u % columns) / (float)columns, b = ES_PI * (float)v / (float)rows;
            const float n[3] = {v == rows ? 0 : es_sin(b) * es_cos(a), es_cos(b), v == rows ? 0 : -es_sin(b) * es_sin(a)}, c[3] = {centre.x, centre.y, centre.z};
            for (uint32_t k = 0; k < 3; k++) {
                positions[3 * vertices + k] = c[k] + radius * n[k];
                normals[3 * vertices + k] = inside ? -n[k] : n[k];
            }
        }
    for (uint32_t v = 0; v < rows; v++)
        for (uint32_t u = 0; u < columns; u++) {
            uint32_t a = v * (columns + 1) + u, b = a + columns + 1;
            const uint32_t two[2][3] = {{a, b, b + 1}, {a, b + 1, a + 1}};
            for (int t = v == rows - 1 ? 1 : 0; t < (v == 0 ? 1 : 2); t++)
                for (int k = 0; k < 3; k++) indices[count++] = two[t][inside ? 2 - k : k];
        }
    es_instance instance = stress_mesh(s, &(es_mesh_desc){.vertex_count = vertices, .triangle_count = count / 3, .positions = positions, .normals = normals, .indices = indices}, material, s->root);
    free(positions);
    free(normals);
    free(indices);
    return instance;
}

/* Intensities and ranges are those of a scene of scale 1: W/sr grow with the square, so that surfaces receive the same. */
static inline es_light stress_light(stress* s, es_light_type type, float intensity, es_vec3 position, es_vec3 direction)
{
    es_light light;
    es_light_desc d = es_default_light_desc();
    d.type = type;
    d.intensity = type == ES_LIGHT_DIRECTIONAL ? intensity : intensity * s->scale * s->scale;
    d.inner_cone = 0.5f;
    d.outer_cone = 0.7f;
    d.node = stress_node(s, position, direction);
    assert_int_equal(es_world_add_light(s->world, &d, &light), ES_OK);
    return light;
}

static inline void stress_look(stress* s, es_vec3 eye, es_vec3 at, float fov_y, float near_plane)
{
    es_camera_desc d = es_default_camera_desc();
    d.fov_y = fov_y;
    d.near_plane = near_plane * s->scale;
    d.node = stress_node(s, eye, es_v3_sub(at, eye));
    assert_int_equal(es_world_add_camera(s->world, &d, &s->camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(s->world, s->camera), ES_OK);
    assert_int_equal(es_world_step(s->world, 0), ES_OK);
}

/* A room of 4 × 3 × 4 m with coloured walls, a matte ball, a polished one and a box, lit by a spot, a point and a directional light that
 * comes in where a wall is missing. */
static inline void stress_room(stress* s)
{
    const es_material_desc white = matte(0.75f, 0.75f, 0.75f), red = matte(0.7f, 0.1f, 0.1f), green = matte(0.1f, 0.6f, 0.15f), gold = polished(0.9f, 0.7f, 0.3f, 0.4f);
    stress_rectangle(s, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &white);
    stress_rectangle(s, es_v3(-2, 3, -2), es_v3(4, 0, 0), es_v3(0, 0, 4), &white);
    stress_rectangle(s, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 3, 0), &white);
    stress_rectangle(s, es_v3(-2, 0, 2), es_v3(0, 0, -4), es_v3(0, 3, 0), &red);
    stress_rectangle(s, es_v3(2, 0, -2), es_v3(0, 0, 4), es_v3(0, 3, 0), &green);
    stress_ball(s, es_v3(-0.8f, 0.7f, -0.6f), 0.7f, 16, false, &white);
    stress_ball(s, es_v3(1.1f, 0.4f, 0.3f), 0.4f, 16, false, &gold);
    stress_box(s, es_v3(0.3f, 0, -1.6f), es_v3(1.3f, 1.4f, -0.9f), false, &white);
    stress_light(s, ES_LIGHT_SPOT, 30, es_v3(0.3f, 2.8f, 0.9f), es_v3(-0.2f, -1, -0.5f));
    stress_light(s, ES_LIGHT_POINT, 2, es_v3(-1.4f, 2.1f, 1.1f), es_v3(0, -1, 0));
    stress_light(s, ES_LIGHT_DIRECTIONAL, 1.5f, es_v3(0, 0, 0), es_v3(-0.3f, -0.7f, -1));
    stress_look(s, es_v3(0.1f, 1.5f, 4.4f), es_v3(0, 1.2f, 0), 0.9f, 0.05f);
}

/* ---- pictures ---------------------------------------------------------------------------------------------------------------------- */

static inline es_renderer_settings stress_settings(uint32_t width, uint32_t height, uint32_t method)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = width;
    s.height = height;
    s.method = method;
    s.vpls = method == ES_GI_CLASSIC ? 64 : 256;
    s.light_size = 64;
    s.ism_points = 2048;
    s.ism_pool = 32768;
    s.shadow_size = 512;
    s.classic_size = 64;
    s.interleave = 4;
    s.lamps = ES_LAMPS_NONE; /* what glows is seen, and lights nothing: who wants it to says so */
    return s;
}

static inline es_renderer* stress_render(stress* s, const es_renderer_settings* settings)
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(s->context, settings, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, s->world), ES_OK);
    return renderer;
}

static inline es_image stress_image(es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static inline size_t values_of(const es_image* image) { return (size_t)image->width * image->height * image->channels; }

/* Every image that the renderer can give is finite. */
static inline void assert_all_finite(stress* s, es_renderer* renderer, const char* what)
{
    for (size_t i = 0; i < es_image_name_count(); i++) {
        es_image image;
        if (es_renderer_image(renderer, es_image_name(i), &image) != ES_OK) continue; /* of a pass that was not needed */
        for (size_t k = 0; k < values_of(&image); k++)
            if (!isfinite(image.pixels[k])) fail_msg("%s: %s is %g at value %zu", what, es_image_name(i), (double)image.pixels[k], k);
        es_image_destroy(s->context, &image);
    }
}

static inline double mean_of_image(const es_image* image)
{
    double sum = 0;
    for (size_t i = 0; i < values_of(image); i++) sum += (double)image->pixels[i];
    return sum / (double)values_of(image);
}

typedef struct difference { double relrmse; double max; } difference; /* both over the mean of b */

/* b is multiplied by `factor` first. */
static inline difference difference_of(const es_image* a, const es_image* b, double factor)
{
    assert_int_equal(values_of(a), values_of(b));
    difference d = {0, 0};
    double squares = 0, mean = mean_of_image(b) * factor;
    for (size_t i = 0; i < values_of(a); i++) {
        double delta = fabs((double)a->pixels[i] - factor * (double)b->pixels[i]);
        squares += delta * delta;
        d.max = fmax(d.max, delta);
    }
    d.relrmse = sqrt(squares / (double)values_of(a)) / mean;
    d.max /= mean;
    return d;
}

#endif
