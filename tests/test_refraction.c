/* Light through glass: Snell's law and total reflection, slabs, prisms and balls against what they do by hand, and pictures by maps and by rays against the reference. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "gi/reference/refraction.h"
#include "platform/context.h"
#include "platform/random.h"
#include "tests/races.h"
#include "tests/reference_runs.h"

static float some(uint32_t i, float low, float high) { return low + (high - low) * es_unit_float(es_random_u32(9, i)); }

static void test_snell(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < 20000; i++) {
        const es_vec3 n = es_v3_normalize(es_v3(some(8 * i, -1, 1), some(8 * i + 1, -1, 1), some(8 * i + 2, -1, 1)), es_v3(0, 1, 0));
        es_vec3 d = es_v3_normalize(es_v3(some(8 * i + 3, -1, 1), some(8 * i + 4, -1, 1), some(8 * i + 5, -1, 1)), es_v3(0, -1, 0));
        if (es_v3_dot(d, n) > 0) d = es_v3_scale(d, -1);
        const float ratio = i & 1 ? some(8 * i + 6, 0.2f, 1) : some(8 * i + 6, 1, 5);
        const double sine = sqrt(fmax(1 - pow((double)es_v3_dot(d, n), 2), 0)), behind = sine * (double)ratio;
        es_vec3 out;
        const bool passes = es_refract(d, n, ratio, &out);
        if (fabs(behind - 1) < 1e-4) continue;
        assert_int_equal(passes, behind < 1);
        if (!passes) continue;
        assert_float_equal(es_v3_length(out), 1, 1e-5);
        const es_vec3 across = es_v3_cross(n, out);
        assert_float_equal(es_v3_length(across), behind, 2e-3);
        assert_true(es_v3_dot(out, n) < 0);
        /* in the plane of d and n, on the side that d goes to */
        assert_float_equal(es_v3_dot(es_v3_cross(d, n), out), 0, 1e-5);
        assert_true(es_v3_dot(across, es_v3_cross(n, d)) > -1e-5f);
    }
}

static es_material_desc glass(float ior)
{
    es_material_desc d = es_default_material_desc();
    d.roughness = 0;
    d.transmission = 1;
    d.ior = ior;
    return d;
}

/* The box low … high, facing outside. */
static void add_glass_box(small_world* w, es_vec3 low, es_vec3 high, const es_material_desc* material)
{
    es_vec3 p[24];
    uint32_t indices[36];
    for (uint32_t f = 0; f < 6; f++) {
        const uint32_t axis = f / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (uint32_t i = 0; i < 4; i++) {
            const uint32_t at = f & 1 ? i : 3 - i;
            float c[3];
            const float *l = &low.x, *h = &high.x;
            c[axis] = f & 1 ? h[axis] : l[axis];
            c[u] = at == 1 || at == 2 ? h[u] : l[u];
            c[v] = at >= 2 ? h[v] : l[v];
            p[4 * f + i] = es_v3(c[0], c[1], c[2]);
        }
        const uint32_t quad[6] = {4 * f, 4 * f + 1, 4 * f + 2, 4 * f, 4 * f + 2, 4 * f + 3};
        memcpy(indices + 6 * f, quad, sizeof quad);
    }
    add_instance(w, &(es_mesh_desc){.vertex_count = 24, .triangle_count = 12, .positions = &p[0].x, .indices = indices, .flat_normals = true}, material);
}

static bool through(es_trace_scene* scene, es_vec3 from, es_vec3 d, es_refraction* r)
{
    es_hit hit;
    const es_ray ray = {{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, 3e38f};
    if (!es_trace_closest(scene, ray, true, &hit)) return false;
    es_trace_surface s;
    es_trace_surface_at(scene, &hit, es_v3_scale(d, -1), false, &s);
    *r = es_trace_refraction(scene, &s, d);
    return true;
}

static void test_slab(void** state)
{
    (void)state;
    small_world w = small_world_create();
    const es_material_desc crystal = glass(1.7f);
    add_glass_box(&w, es_v3(-50, -50, 0), es_v3(50, 50, 1), &crystal);
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    es_trace_scene scene = {0};
    assert_int_equal(es_trace_scene_take(&scene, w.world, false), ES_OK);
    for (uint32_t i = 0; i < 200; i++) {
        const double angle = (double)some(2 * i, 0, 1.4f), turn = (double)some(2 * i + 1, 0, 6);
        const es_vec3 d = es_v3((float)(sin(angle) * cos(turn)), (float)(sin(angle) * sin(turn)), (float)-cos(angle));
        es_refraction r;
        assert_true(through(&scene, es_v3_sub(es_v3(0, 0, 1), es_v3_scale(d, 2)), d, &r));
        /* out as it went in, shifted by the path inside */
        const double inside = asin(sin(angle) / 1.7), shift = tan(inside);
        assert_float_equal(r.direction.x, d.x, 1e-5);
        assert_float_equal(r.direction.y, d.y, 1e-5);
        assert_float_equal(r.position.x, shift * cos(turn), 1e-4);
        assert_float_equal(r.position.y, shift * sin(turn), 1e-4);
        assert_float_equal(r.position.z, 0, 1e-4);
        const double c = cos(angle), share = 1 - (0.04 + 0.96 * pow(1 - c, 5));
        assert_float_equal(r.weight.x, share * share, 1e-4);
        assert_int_equal(r.rays, 1);
    }
    es_trace_scene_free(&scene);
    small_world_destroy(&w);
}

/* Straight into the long side of a prism of a right angle, whose short ones reflect all of it: back as it came, on the other side. And light inside of a cube, whose walls never let it out,
 * stops after so many of them. */
static void test_total_reflection(void** state)
{
    (void)state;
    small_world w = small_world_create();
    const es_material_desc crystal = glass(1.5f);
    const es_vec3 p[6] = {{-1, 0, -1}, {1, 0, -1}, {0, -1, -1}, {-1, 0, 1}, {1, 0, 1}, {0, -1, 1}};
    static const uint32_t indices[24] = {0, 3, 4, 0, 4, 1, 0, 2, 5, 0, 5, 3, 1, 4, 5, 1, 5, 2, 0, 1, 2, 3, 5, 4};
    add_instance(&w, &(es_mesh_desc){.vertex_count = 6, .triangle_count = 8, .positions = &p[0].x, .indices = indices, .flat_normals = true}, &crystal);
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    es_trace_scene scene = {0};
    assert_int_equal(es_trace_scene_take(&scene, w.world, false), ES_OK);
    for (int i = 1; i < 10; i++) {
        es_refraction r;
        assert_true(through(&scene, es_v3(0.1f * (float)i, 1, 0.2f), es_v3(0, -1, 0), &r));
        assert_float_equal(r.direction.y, 1, 1e-5);
        assert_float_equal(r.position.x, -0.1f * (float)i, 1e-4);
        assert_float_equal(r.position.y, 0, 1e-4);
        assert_int_equal(r.rays, 3);
        assert_float_equal(r.weight.x, 0.96 * 0.96, 1e-4);
    }
    es_trace_scene_free(&scene);
    small_world_destroy(&w);
    w = small_world_create();
    const es_material_desc diamond = glass(2.4f);
    add_glass_box(&w, es_v3(-1, -1, -1), es_v3(1, 1, 1), &diamond);
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    assert_int_equal(es_trace_scene_take(&scene, w.world, false), ES_OK);
    es_refraction r;
    const es_vec3 d = es_v3_normalize(es_v3(0.9f, -0.8f, 0.1f), es_v3(1, 0, 0));
    assert_true(through(&scene, es_v3(-1.9f, 0.9f, 0.1f), d, &r));
    assert_true(r.rays <= ES_REFRACTION_MOST && r.rays >= 1);
    assert_float_equal(es_v3_length(r.direction), 1, 1e-4);
    es_trace_scene_free(&scene);
    small_world_destroy(&w);
}

/* ---- pictures ------------------------------------------------------------------------------------------------------------------------- */

enum { SIZE = 96 };

static es_renderer_settings settings_of(uint32_t reflections)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = s.height = SIZE;
    s.reflections = reflections;
    s.reflection_size = 256;
    s.method = ES_GI_NONE;
    s.lamps = ES_LAMPS_NONE;
    return s;
}

static es_image picture_of(small_world* w, const es_renderer_settings* settings, const char* name)
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w->context, settings, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    es_renderer_destroy(renderer);
    return image;
}

/* Colours of a room that change slowly, unlit. */
static void add_painted_rectangle(small_world* w, es_vec3 corner, es_vec3 u, es_vec3 v)
{
    const es_vec3 p[4] = {corner, es_v3_add(corner, u), es_v3_add(es_v3_add(corner, u), v), es_v3_add(corner, v)};
    float colors[16];
    for (int i = 0; i < 4; i++) {
        colors[4 * i] = 0.5f + 0.15f * p[i].x;
        colors[4 * i + 1] = 0.5f + 0.15f * p[i].y;
        colors[4 * i + 2] = 0.5f + 0.15f * p[i].z;
        colors[4 * i + 3] = 1;
    }
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    es_material_desc unlit = es_default_material_desc();
    unlit.model = ES_SURFACE_UNLIT;
    add_instance(w, &(es_mesh_desc){.vertex_count = 4, .triangle_count = 2, .positions = &p[0].x, .colors = colors, .indices = indices, .flat_normals = true}, &unlit);
}

static small_world ball_in_room(const es_material_desc* material, float roughness)
{
    small_world w = small_world_create();
    for (int k = 0; k < 3; k++)
        for (int side = -1; side <= 1; side += 2) {
            es_vec3 corner = es_v3(-3, -3, -3), u = es_v3(0, 0, 0), v = u;
            (&corner.x)[k] = 3 * (float)side;
            (&u.x)[(k + 1) % 3] = 6;
            (&v.x)[(k + 2) % 3] = 6;
            if (side < 0) add_painted_rectangle(&w, corner, u, v);
            else add_painted_rectangle(&w, corner, v, u);
        }
    es_material_desc m = *material;
    m.roughness = roughness;
    add_sphere(&w, es_v3(0, 0, 0), 1, 48, false, &m);
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 0.9f;
    look(&w, camera, es_v3(0.4f, 0.6f, 2.6f), es_v3(0, 0, 0));
    return w;
}

/* By maps and by rays as the reference has it, under a smooth environment. */
static void test_against_reference(void** state)
{
    (void)state;
    enum { COLUMNS = 256, ROWS = 128 };
    small_world w = small_world_create();
    es_image sky;
    assert_int_equal(es_image_create(w.context, COLUMNS, ROWS, 3, &sky), ES_OK);
    for (uint32_t y = 0; y < ROWS; y++)
        for (uint32_t x = 0; x < COLUMNS; x++) {
            const float theta = ES_PI * ((float)y + 0.5f) / ROWS, phi = 2 * ES_PI * ((float)x + 0.5f) / COLUMNS;
            const float d[3] = {es_sin(theta) * es_sin(phi - ES_PI), es_cos(theta), -es_sin(theta) * es_cos(phi - ES_PI)};
            for (uint32_t k = 0; k < 3; k++) sky.pixels[3 * ((size_t)y * COLUMNS + x) + k] = 1.0f + 0.8f * d[k];
        }
    assert_int_equal(es_world_set_environment(w.world, &(es_environment_desc){.image = &sky, .radiance = {1, 1, 1}}), ES_OK);
    const es_material_desc crystal = glass(1.5f);
    add_sphere(&w, es_v3(0, 0, 0), 1, 48, false, &crystal);
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 0.9f;
    look(&w, camera, es_v3(0.4f, 0.6f, 2.6f), es_v3(0, 0, 0));
    es_reference_settings rs = reference_settings(SIZE, SIZE, 1);
    rs.antialias = false;
    es_reference* reference = trace(&w, &rs, 256 / FEWER);
    es_image truth = traced(reference, "radiance");
    for (uint32_t method = ES_REFLECTIONS_MAPS; method <= ES_REFLECTIONS_TRACED; method++) {
        es_renderer_settings s = settings_of(method);
        es_image image = picture_of(&w, &s, "radiance");
        double error = 0, sum = 0;
        for (size_t i = 0; i < (size_t)SIZE * SIZE * 3; i++) {
            error += pow((double)(image.pixels[i] - truth.pixels[i]), 2);
            sum += (double)truth.pixels[i];
        }
        const double relative = sqrt(error / (SIZE * SIZE * 3)) / (sum / (SIZE * SIZE * 3));
        if (relative > 0.05) fail_msg("method %u is off by %g", method, relative);
        es_image_destroy(w.context, &image);
    }
    es_image_destroy(w.context, &truth);
    es_reference_destroy(reference);
    assert_int_equal(es_world_set_environment(w.world, NULL), ES_OK);
    es_image_destroy(w.context, &sky);
    small_world_destroy(&w);
}

/* Evenly bright surroundings: what is reflected and what goes through make up nearly all of it, and never more; half of it through glass that is half as clear, whose rest is dark here. */
static void test_furnace(void** state)
{
    (void)state;
    for (int trial = 0; trial < 4; trial++) {
        small_world w = small_world_create();
        const es_environment_desc sky = {.radiance = {1, 1, 1}};
        assert_int_equal(es_world_set_environment(w.world, &sky), ES_OK);
        es_material_desc crystal = glass(1.5f);
        if (trial & 1) crystal.transmission = 0.5f;
        add_sphere(&w, es_v3(0, 0, 0), 1, 32, false, &crystal);
        es_camera_desc camera = es_default_camera_desc();
        camera.fov_y = 0.6f;
        look(&w, camera, es_v3(0, 0, 5), es_v3(0, 0, 0));
        es_renderer_settings s = settings_of(trial & 2 ? ES_REFLECTIONS_TRACED : ES_REFLECTIONS_MAPS);
        es_image image = picture_of(&w, &s, "radiance");
        const float* middle = image.pixels + 3 * (SIZE / 2 * SIZE + SIZE / 2);
        const double share = trial & 1 ? 0.5 : 1;
        assert_float_equal(middle[0], 0.04 + share * 0.96 * 0.96, 0.005);
        for (size_t i = 0; i < (size_t)SIZE * SIZE * 3; i++) assert_true(image.pixels[i] <= 1.001f);
        es_image_destroy(w.context, &image);
        small_world_destroy(&w);
    }
}

/* Frames that skip what they can are as those that do not, whatever changes. */
static void test_skipping_changes_nothing(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 2; trial++) {
        const es_material_desc crystal = glass(1.4f);
        small_world w = ball_in_room(&crystal, 0.1f);
        es_renderer_settings s = settings_of(trial ? ES_REFLECTIONS_TRACED : ES_REFLECTIONS_MAPS);
        s.width = s.height = 48;
        s.reflection_size = 32;
        es_renderer* renderers[2];
        for (int k = 0; k < 2; k++) assert_int_equal(es_renderer_create(w.context, &s, &renderers[k]), ES_OK);
        es_camera_desc camera;
        assert_int_equal(es_world_get_camera(w.world, w.camera, &camera), ES_OK);
        for (uint32_t frame = 0; frame < 8; frame++) {
            if (frame == 2 || frame == 5) {
                es_transform t;
                assert_int_equal(es_world_get_node_transform(w.world, camera.node, &t), ES_OK);
                t.translation.x += 0.05f;
                assert_int_equal(es_world_set_node_transform(w.world, camera.node, &t), ES_OK);
            }
            if (frame == 4) s.reflection_roughness = 0.05f;
            if (frame == 6) s.reflections = ES_REFLECTIONS_NONE;
            if (frame == 7) s.reflections = ES_REFLECTIONS_MAPS;
            assert_int_equal(es_world_step(w.world, 0), ES_OK);
            es_image images[2];
            for (int k = 0; k < 2; k++) {
                s.skip = k == 0;
                assert_int_equal(es_renderer_configure(renderers[k], &s), ES_OK);
                assert_int_equal(es_renderer_render(renderers[k], w.world), ES_OK);
                assert_int_equal(es_renderer_image(renderers[k], "radiance", &images[k]), ES_OK);
            }
            assert_memory_equal(images[0].pixels, images[1].pixels, (size_t)48 * 48 * 3 * sizeof(float));
            for (int k = 0; k < 2; k++) es_image_destroy(w.context, &images[k]);
        }
        for (int k = 0; k < 2; k++) es_renderer_destroy(renderers[k]);
        small_world_destroy(&w);
    }
}

static void test_materials(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_material material;
    es_material_desc d = glass(0.5f);
    assert_int_equal(es_world_add_material(w.world, "", &d, &material), ES_INVALID_ARGUMENT);
    d = glass(0); /* 1.5 */
    assert_int_equal(es_world_add_material(w.world, "", &d, &material), ES_OK);
    d.transmission = 1.5f;
    assert_int_equal(es_world_add_material(w.world, "", &d, &material), ES_INVALID_ARGUMENT);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_snell),
        unit_test_without_races(test_slab),
        unit_test_without_races(test_total_reflection),
        cmocka_unit_test(test_against_reference),
        cmocka_unit_test(test_furnace),
        unit_test_without_races(test_skipping_changes_nothing),
        cmocka_unit_test(test_materials),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
