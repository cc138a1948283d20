/* Whole frames of small worlds: what each pass has to give, skip and refuse. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "gi/gi.h"
#include "gi/light_view.h"
#include "gi/vpl_sampling.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"

static es_context* context_of(uint32_t threads)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

typedef struct room { es_world* world; es_light light; es_material ball_material; es_node ball; } room;

/* a floor, a ball above it and a light; the camera looks at both */
static room make_room(es_context* context, es_light_type type)
{
    room r = {0};
    assert_int_equal(es_world_create(context, NULL, &r.world), ES_OK);
    es_material_desc white = es_default_material_desc();
    white.specular = 0.0f;
    white.base_color[0] = white.base_color[1] = white.base_color[2] = 0.8f;
    white.double_sided = true;
    es_material floor_material;
    assert_int_equal(es_world_add_material(r.world, "floor", &white, &floor_material), ES_OK);
    assert_int_equal(es_world_add_material(r.world, "ball", &white, &r.ball_material), ES_OK);

    static const float corners[] = {-2, 0, 2, 2, 0, 2, 2, 0, -2, -2, 0, -2};
    static const uint32_t quad[] = {0, 1, 2, 0, 2, 3};
    es_mesh_desc floor_desc = {.name = "floor", .vertex_count = 4, .triangle_count = 2, .positions = corners, .indices = quad};
    es_mesh floor_mesh, ball_mesh;
    assert_int_equal(es_world_add_mesh(r.world, &floor_desc, &floor_mesh), ES_OK);

    /* a coarse ball: its interpolated normals pass the horizon at every silhouette */
    enum { U = 12, V = 8 };
    float positions[(U + 1) * (V + 1) * 3];
    uint32_t indices[U * V * 6], vertices = 0, count = 0;
    for (int v = 0; v <= V; v++)
        for (int u = 0; u <= U; u++) {
            float a = 2 * ES_PI * (float)u / U, b = ES_PI * (float)v / V;
            positions[3 * vertices] = 0.5f * es_sin(b) * es_cos(a);
            positions[3 * vertices + 1] = 0.5f * es_cos(b);
            positions[3 * vertices++ + 2] = -0.5f * es_sin(b) * es_sin(a);
        }
    for (uint32_t v = 0; v < V; v++)
        for (uint32_t u = 0; u < U; u++) {
            uint32_t a = v * (U + 1) + u, b = a + U + 1;
            const uint32_t two[6] = {a, b, b + 1, a, b + 1, a + 1};
            memcpy(indices + count, two, sizeof two);
            count += 6;
        }
    float normals[(U + 1) * (V + 1) * 3];
    for (uint32_t i = 0; i < 3 * vertices; i++) normals[i] = 2 * positions[i];
    es_mesh_desc ball_desc = {.name = "ball", .vertex_count = vertices, .triangle_count = count / 3, .positions = positions, .normals = normals, .indices = indices};
    assert_int_equal(es_world_add_mesh(r.world, &ball_desc, &ball_mesh), ES_OK);

    es_node_desc node = {.transform = es_identity_transform()};
    es_node ground, eye, lamp;
    assert_int_equal(es_world_add_node(r.world, &node, &ground), ES_OK);
    node.transform.translation = (es_vec3){0, 0.8f, 0};
    assert_int_equal(es_world_add_node(r.world, &node, &r.ball), ES_OK);
    node.transform.translation = (es_vec3){0, 1.0f, 3.5f};
    assert_int_equal(es_world_add_node(r.world, &node, &eye), ES_OK);
    node.transform.translation = (es_vec3){0, 2.5f, 2.0f};
    node.transform.rotation = es_quat_from_axis_angle((es_vec3){1, 0, 0}, -0.9f);
    assert_int_equal(es_world_add_node(r.world, &node, &lamp), ES_OK);
    es_instance instance;
    assert_int_equal(es_world_add_instance(r.world, &(es_instance_desc){.node = ground, .mesh = floor_mesh, .material = floor_material}, &instance), ES_OK);
    assert_int_equal(es_world_add_instance(r.world, &(es_instance_desc){.node = r.ball, .mesh = ball_mesh, .material = r.ball_material}, &instance), ES_OK);
    es_camera_desc camera_desc = es_default_camera_desc();
    camera_desc.node = eye;
    es_camera camera;
    assert_int_equal(es_world_add_camera(r.world, &camera_desc, &camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(r.world, camera), ES_OK);
    es_light_desc light = es_default_light_desc();
    light.node = lamp;
    light.type = type;
    light.intensity = type == ES_LIGHT_DIRECTIONAL ? 3.0f : 20.0f;
    light.inner_cone = 0.6f;
    light.outer_cone = 0.7f;
    assert_int_equal(es_world_add_light(r.world, &light, &r.light), ES_OK);
    assert_int_equal(es_world_step(r.world, 0.0f), ES_OK);
    return r;
}

static es_renderer_settings small(void)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = 160;
    s.height = 120;
    s.vpls = 128;
    s.light_size = 64;
    s.ism_points = 1024;
    s.ism_pool = 16384;
    s.shadow_size = 512;
    s.classic_size = 64;
    return s;
}

static es_image picture(es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static double mean(const es_image* image)
{
    double sum = 0;
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channels; i++) sum += (double)image->pixels[i];
    return sum / ((double)image->width * image->height * image->channels);
}

static const char* skipped(const es_renderer* renderer, const char* pass)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (strcmp(stats->passes[i].name, pass) == 0) return stats->passes[i].skipped;
    fail_msg("no pass %s", pass);
    return NULL;
}

/* Lambert under a light at distance d and angle a: albedo / pi · I cos a / d², wherever no shadow is near. */
static void test_direct_light_follows_the_laws(void** state)
{
    (void)state;
    for (int type = ES_LIGHT_SPOT; type <= ES_LIGHT_DIRECTIONAL; type++) {
        es_context* context = context_of(2);
        room r = make_room(context, (es_light_type)type);
        es_renderer_settings s = small();
        s.method = ES_GI_NONE;
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
        assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
        es_image direct = picture(renderer, "direct"), depth = picture(renderer, "depth"), instance = picture(renderer, "instance"), albedo = picture(renderer, "albedo");
        es_raster_view view;
        assert_int_equal(es_world_camera_view(r.world, es_world_active_camera(r.world), s.width, s.height, &view), ES_OK);
        es_pixel_rays rays = es_pixel_rays_of_view(&view);
        size_t lights;
        const es_light_state* light = es_world_lights(r.world, &lights);
        assert_int_equal(lights, 1);
        float floor_id = instance.pixels[(size_t)118 * 160 + 80];
        int compared = 0, shaded = 0;
        for (uint32_t y = 90; y < 119; y++)
            for (uint32_t x = 40; x < 120; x++) {
                size_t at = (size_t)y * 160 + x;
                if (instance.pixels[at] != floor_id) continue;
                es_vec3 p = es_pixel_rays_position(&rays, (float)x, (float)y, depth.pixels[at]);
                es_vec3 d = es_v3_sub(p, light->position);
                float length = es_v3_length(d), expected;
                if (type == ES_LIGHT_DIRECTIONAL) {
                    expected = -light->direction.y * light->radiant[0];
                } else {
                    float cone = es_light_falloff(light, es_v3_scale(d, 1 / length), length);
                    if (cone < 1.0f) continue;
                    expected = light->radiant[0] * -d.y / (length * length * length);
                }
                expected *= albedo.pixels[3 * at] / ES_PI;
                float got = direct.pixels[3 * at];
                assert_true(got <= expected * 1.002f);
                shaded += got < expected * 0.998f; /* the ball's shadow and its edge */
                compared++;
            }
        assert_true(compared > 300);
        if (shaded > compared / 3 || (type == ES_LIGHT_DIRECTIONAL && shaded == 0)) fail_msg("light type %d: %d of %d pixels shaded", type, shaded, compared);
        es_image_destroy(context, &direct);
        es_image_destroy(context, &depth);
        es_image_destroy(context, &instance);
        es_image_destroy(context, &albedo);
        es_renderer_destroy(renderer);
        es_world_destroy(r.world);
        es_context_destroy(context);
    }
}

/* The lit side of a coarse ball has no black rim where interpolated normals turn away from the eye. */
static void test_silhouettes_are_lit(void** state)
{
    (void)state;
    es_context* context = context_of(1);
    room r = make_room(context, ES_LIGHT_POINT);
    es_renderer_settings s = small();
    s.method = ES_GI_NONE;
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
    es_image direct = picture(renderer, "direct"), instance = picture(renderer, "instance"), normal = picture(renderer, "normal");
    float ball_id = instance.pixels[(size_t)60 * 160 + 80];
    int rim = 0;
    for (uint32_t y = 1; y < 60; y++)
        for (uint32_t x = 1; x < 159; x++) {
            size_t at = (size_t)y * 160 + x;
            /* upper rim, facing the lamp above the eye by a wide margin */
            bool edge = instance.pixels[at - 160] != ball_id || instance.pixels[at - 1] != ball_id || instance.pixels[at + 1] != ball_id;
            if (instance.pixels[at] != ball_id || !edge || normal.pixels[3 * at + 1] < 0.5f) continue;
            assert_true(direct.pixels[3 * at] > 0.05f);
            rim++;
        }
    assert_true(rim > 10);
    es_image_destroy(context, &direct);
    es_image_destroy(context, &instance);
    es_image_destroy(context, &normal);
    es_renderer_destroy(renderer);
    es_world_destroy(r.world);
    es_context_destroy(context);
}

/* An unlit surface shows its base colour and takes no light, direct or indirect. */
static void test_unlit_takes_no_light(void** state)
{
    (void)state;
    es_context* context = context_of(2);
    room r = make_room(context, ES_LIGHT_SPOT);
    es_material_desc unlit = es_default_material_desc();
    unlit.model = ES_SURFACE_UNLIT;
    unlit.base_color[0] = 0.25f;
    assert_int_equal(es_world_set_material(r.world, r.ball_material, &unlit), ES_OK);
    es_renderer_settings s = small();
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
    es_image direct = picture(renderer, "direct"), indirect = picture(renderer, "indirect"), radiance = picture(renderer, "radiance");
    size_t at = ((size_t)60 * 160 + 80) * 3;
    assert_true(direct.pixels[at] == 0.0f && indirect.pixels[at] == 0.0f);
    assert_true(fabsf(radiance.pixels[at] - 0.25f) < 1e-4f);
    es_image_destroy(context, &direct);
    es_image_destroy(context, &indirect);
    es_image_destroy(context, &radiance);
    es_renderer_destroy(renderer);
    es_world_destroy(r.world);
    es_context_destroy(context);
}

/* Imperfect maps agree with accurate ones about how much light bounces; a black world bounces none. */
static void test_indirect_light(void** state)
{
    (void)state;
    es_context* context = context_of(2);
    double means[2];
    for (int classic = 0; classic < 2; classic++) {
        room r = make_room(context, ES_LIGHT_SPOT);
        es_renderer_settings s = small();
        s.method = classic ? ES_GI_CLASSIC : ES_GI_ISM;
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
        assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
        es_image indirect = picture(renderer, "indirect");
        means[classic] = mean(&indirect);
        es_image_destroy(context, &indirect);
        es_renderer_destroy(renderer);
        es_world_destroy(r.world);
    }
    assert_true(means[1] > 1e-3);
    assert_true(fabs(means[0] - means[1]) < 0.15 * means[1]);
    es_context_destroy(context);
}

/* A still world's second frame does nothing; each change runs just what reads it; skipping changes no bit. */
static void test_skipping(void** state)
{
    (void)state;
    es_context* context = context_of(2);
    room r = make_room(context, ES_LIGHT_SPOT);
    es_renderer_settings s = small();
    es_renderer *with, *without;
    assert_int_equal(es_renderer_create(context, &s, &with), ES_OK);
    s.skip = false;
    assert_int_equal(es_renderer_create(context, &s, &without), ES_OK);
    s.skip = true;
    for (int frame = 0; frame < 6; frame++) {
        if (frame == 2) s.exposure = 1.0f;
        if (frame == 3) {
            es_light_desc light;
            assert_int_equal(es_world_get_light(r.world, r.light, &light), ES_OK);
            light.color[1] = 0.5f;
            assert_int_equal(es_world_set_light(r.world, r.light, &light), ES_OK);
        }
        assert_int_equal(es_world_step(r.world, 0.1f), ES_OK);
        if (frame == 4) {
            es_transform moved = es_identity_transform();
            moved.translation = (es_vec3){0.3f, 0.9f, 0};
            assert_int_equal(es_world_set_node_transform(r.world, r.ball, &moved), ES_OK);
        }
        es_renderer_settings off = s;
        off.skip = false;
        assert_int_equal(es_renderer_configure(with, &s), ES_OK);
        assert_int_equal(es_renderer_configure(without, &off), ES_OK);
        assert_int_equal(es_renderer_render(with, r.world), ES_OK);
        assert_int_equal(es_renderer_render(without, r.world), ES_OK);
        static const char* const names[] = {"display", "direct", "indirect", "motion", "depth", "ism", "importance"};
        for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
            es_image a = picture(with, names[i]), b = picture(without, names[i]);
            assert_int_equal(es_image_hash(&a), es_image_hash(&b));
            es_image_destroy(context, &a);
            es_image_destroy(context, &b);
        }
        assert_null(skipped(without, "shading"));
        if (frame == 0) assert_null(skipped(with, "shading"));
        if (frame == 1) {
            const es_frame_stats* stats = es_renderer_stats(with);
            for (size_t i = 0; i < stats->pass_count; i++) assert_non_null(stats->passes[i].skipped);
        }
        if (frame == 2) {
            assert_null(skipped(with, "compose"));
            assert_string_equal(skipped(with, "filter"), "inputs unchanged");
        }
        if (frame == 3) {
            assert_string_equal(skipped(with, "shadow maps"), "inputs unchanged");
            assert_string_equal(skipped(with, "points"), "inputs unchanged");
            assert_null(skipped(with, "direct"));
        }
        if (frame == 4) assert_null(skipped(with, "points"));
    }
    es_renderer_destroy(with);
    es_renderer_destroy(without);
    es_world_destroy(r.world);
    es_context_destroy(context);
}

/* Worlds that lack something are black, not a failure; without a camera nothing can be drawn. */
static void test_empty_worlds(void** state)
{
    (void)state;
    es_context* context = context_of(1);
    es_renderer_settings s = small();
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    es_world* empty;
    assert_int_equal(es_world_create(context, NULL, &empty), ES_OK);
    assert_int_equal(es_renderer_render(renderer, empty), ES_WRONG_STATE);
    es_node_desc node = {.transform = es_identity_transform()};
    es_node eye;
    assert_int_equal(es_world_add_node(empty, &node, &eye), ES_OK);
    es_camera_desc camera_desc = es_default_camera_desc();
    camera_desc.node = eye;
    es_camera camera;
    assert_int_equal(es_world_add_camera(empty, &camera_desc, &camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(empty, camera), ES_OK);
    assert_int_equal(es_renderer_render(renderer, empty), ES_OK);
    for (size_t i = 0; i < es_image_name_count(); i++) {
        es_image image = picture(renderer, es_image_name(i));
        for (size_t k = 0; k < (size_t)image.width * image.height * image.channels; k++) assert_true(image.pixels[k] == 0.0f);
        es_image_destroy(context, &image);
    }
    es_image none;
    assert_int_equal(es_renderer_image(renderer, "indirekt", &none), ES_IMAGE_UNKNOWN);
    assert_non_null(strstr(es_context_message(context), "\"indirect\""));
    es_renderer_destroy(renderer);
    es_world_destroy(empty);

    room r = make_room(context, ES_LIGHT_SPOT);
    es_light_desc light;
    assert_int_equal(es_world_get_light(r.world, r.light, &light), ES_OK);
    light.off = true;
    assert_int_equal(es_world_set_light(r.world, r.light, &light), ES_OK);
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
    assert_string_equal(skipped(renderer, "direct"), "no light is on");
    es_image image = picture(renderer, "radiance");
    assert_true(mean(&image) == 0.0);
    es_image_destroy(context, &image);
    es_renderer_destroy(renderer);
    es_world_destroy(r.world);
    es_context_destroy(context);
}

/* how many of the first map's points lie higher than y */
static int points_above(const es_renderer* renderer, float y)
{
    static float p[3 * 1024];
    size_t count = es_renderer_points(renderer, 0, p, 1024);
    int above = 0;
    for (size_t i = 0; i < count; i++) above += p[3 * i + 1] > y;
    return above;
}

/* The points that stand for the scene follow meshes that move and deform, and are shared out anew when one grows. */
static void test_points_follow(void** state)
{
    (void)state;
    es_context* context = context_of(2);
    room r = make_room(context, ES_LIGHT_SPOT);
    es_transform t = es_identity_transform();
    t.translation = (es_vec3){0, 0.8f, 0};
    t.scale = (es_vec3){0.02f, 0.02f, 0.02f};
    assert_int_equal(es_world_set_node_transform(r.world, r.ball, &t), ES_OK);
    es_renderer_settings s = small();
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
    assert_true(points_above(renderer, 0.2f) < 5);
    t.scale = (es_vec3){1, 1, 1};
    assert_int_equal(es_world_set_node_transform(r.world, r.ball, &t), ES_OK);
    assert_int_equal(es_world_step(r.world, 0.1f), ES_OK);
    assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
    /* the ball has pi of pi + 16 m² */
    int grown = points_above(renderer, 0.2f);
    assert_in_range(grown, 120, 210);
    assert_int_equal(points_above(renderer, 1.4f), 0);

    uint32_t ids[4];
    size_t count = 4;
    assert_int_equal(es_world_enumerate(r.world, ES_OBJECT_MESH, ids, &count), ES_OK);
    es_mesh ball = {ids[1]};
    const es_raster_mesh* mesh = es_world_mesh(r.world, ball);
    static float moved[3 * 4096];
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (int k = 0; k < 3; k++) moved[3 * v + (uint32_t)k] = mesh->positions[4 * v + (uint32_t)k] + (k == 1 ? 1.0f : 0.0f);
    assert_int_equal(es_world_deform_mesh(r.world, ball, moved, NULL), ES_OK);
    assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
    assert_int_equal(points_above(renderer, 1.2f), grown);
    es_renderer_destroy(renderer);
    es_world_destroy(r.world);
    es_context_destroy(context);
}

/* A frame that fails for want of memory leaves no image to read, and the next one that has it is whole. */
static void test_memory_cap(void** state)
{
    (void)state;
    int failed = 0, whole = 0;
    uint64_t expected = 0;
    for (size_t cap = 32 << 20; cap >= 1 << 20; cap = cap * 4 / 5) {
        es_context_desc desc = es_default_context_desc();
        desc.threads = 2;
        desc.memory_cap = cap;
        es_context* context;
        assert_int_equal(es_context_create(&desc, &context), ES_OK);
        room r = make_room(context, ES_LIGHT_SPOT);
        es_renderer_settings s = small();
        es_renderer* renderer;
        es_result created = es_renderer_create(context, &s, &renderer);
        es_image image;
        if (created) assert_int_equal(created, ES_MEMORY_CAP);
        for (int frame = 0; frame < 2 && !created; frame++) {
            es_result result = es_renderer_render(renderer, r.world);
            if (result == ES_OK) {
                if (es_renderer_image(renderer, "direct", &image) == ES_OK) {
                    uint64_t hash = es_image_hash(&image);
                    if (!whole++) expected = hash;
                    assert_int_equal(hash, expected);
                    es_image_destroy(context, &image);
                }
            } else {
                assert_int_equal(result, ES_MEMORY_CAP);
                assert_int_equal(es_renderer_image(renderer, "importance", &image), ES_WRONG_STATE);
                assert_int_equal(es_renderer_vpls(renderer, NULL, 0), 0);
                failed++;
            }
        }
        es_renderer_destroy(renderer);
        es_world_destroy(r.world);
        assert_int_equal(es_context_bytes(context), 0);
        es_context_destroy(context);
    }
    assert_true(failed > 4 && whole > 0);
}

/* Settings outside their range are refused by name; sizes change between frames. */
static void test_settings(void** state)
{
    (void)state;
    es_context* context = context_of(1);
    es_renderer_settings s = small();
    es_renderer* renderer;
    s.light_size = 100;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_SETTING_VALUE);
    assert_non_null(strstr(es_context_message(context), "vpl.light-size"));
    assert_null(renderer);
    s = small();
    assert_int_equal(es_renderer_settings_set(context, &s, "interleav", "4"), ES_SETTING_UNKNOWN);
    assert_non_null(strstr(es_context_message(context), "interleave"));
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    room r = make_room(context, ES_LIGHT_SPOT);
    static const uint32_t sizes[][2] = {{160, 120}, {33, 7}, {1, 1}, {200, 100}};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        s.width = sizes[i][0];
        s.height = sizes[i][1];
        s.interleave = 1 + 5 * (uint32_t)i;
        assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
        assert_int_equal(es_renderer_render(renderer, r.world), ES_OK);
        es_image image = picture(renderer, "display");
        assert_int_equal(image.width, sizes[i][0]);
        es_image_destroy(context, &image);
    }
    es_renderer_destroy(renderer);
    es_world_destroy(r.world);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* Hierarchical warping draws each texel as often as its importance says: chi-square over a 8 × 8 map. */
static void test_warping(void** state)
{
    (void)state;
    es_context* context = context_of(1);
    float sums[64 + 16 + 4 + 1];
    es_importance importance = {.size = 8, .level_count = 4, .face_count = 1, .level_offset = {0, 64, 80, 84}, .face_floats = 85, .sums = sums};
    for (uint32_t i = 0; i < 64; i++) sums[i] = i % 5 == 0 ? 0.0f : es_random_float(7, i);
    for (uint32_t l = 1, size = 4; l < 4; l++, size /= 2)
        for (uint32_t y = 0; y < size; y++)
            for (uint32_t x = 0; x < size; x++) {
                const float* p = sums + importance.level_offset[l - 1] + 2 * y * 2 * size + 2 * x;
                sums[importance.level_offset[l] + y * size + x] = (p[0] + p[1]) + (p[2 * size] + p[2 * size + 1]);
            }
    enum { N = 200000 };
    int seen[64] = {0};
    for (uint32_t i = 0; i < N; i++) {
        uint32_t face, x, y;
        float probability;
        assert_true(es_importance_warp(&importance, es_random_float(1, 2 * i), es_random_float(1, 2 * i + 1), &face, &x, &y, &probability));
        assert_true(fabsf(probability - sums[y * 8 + x] / sums[84]) < 1e-6f);
        seen[y * 8 + x]++;
    }
    double chi2 = 0;
    int cells = 0;
    for (int i = 0; i < 64; i++) {
        double expected = (double)N * (double)(sums[i] / sums[84]);
        if (expected == 0) {
            assert_int_equal(seen[i], 0);
            continue;
        }
        chi2 += (seen[i] - expected) * (seen[i] - expected) / expected;
        cells++;
    }
    /* 50 degrees of freedom: 86.7 is exceeded once in a thousand */
    assert_true(cells == 51 && chi2 < 86.7);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_direct_light_follows_the_laws),
        cmocka_unit_test(test_silhouettes_are_lit),
        cmocka_unit_test(test_unlit_takes_no_light),
        cmocka_unit_test(test_indirect_light),
        cmocka_unit_test(test_skipping),
        cmocka_unit_test(test_empty_worlds),
        cmocka_unit_test(test_points_follow),
        cmocka_unit_test(test_memory_cap),
        cmocka_unit_test(test_settings),
        cmocka_unit_test(test_warping),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
