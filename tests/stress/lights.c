/* Lamps where they should not be: on, in and behind surfaces, inside of things, in the eye, in each other; and virtual lights on the
 * very points they light. Nothing is infinite, a surface takes no light from behind, and a closed box lets none through. */
#include "tests/stress/stress.h"

enum { WIDTH = 64, HEIGHT = 48 };

typedef struct setting { const char* name; uint32_t method, bias; } setting;
static const setting methods[] = {{"ism", ES_GI_ISM, 0}, {"classic", ES_GI_CLASSIC, 0}, {"traced", ES_GI_VPL_TRACED, ES_TRACED_BOUNDED}, {"unbounded", ES_GI_VPL_TRACED, ES_TRACED_UNBOUNDED},
    {"compensated", ES_GI_VPL_TRACED, ES_TRACED_COMPENSATED}};
enum { METHODS = sizeof methods / sizeof *methods };

static es_renderer_settings settings_of(size_t method)
{
    es_renderer_settings settings = stress_settings(WIDTH, HEIGHT, methods[method].method);
    settings.vpls = 64;
    settings.traced_bias = methods[method].bias;
    settings.traced_samples = 2;
    return settings;
}

static const es_light_type types[] = {ES_LIGHT_SPOT, ES_LIGHT_POINT, ES_LIGHT_DIRECTIONAL};
static const char* const type_names[] = {"spot", "point", "directional"};

/* Means of an image's channels over the pixels whose instance is `number` (all for 0). */
static double mean_over(stress* s, es_renderer* renderer, const char* name, uint32_t number)
{
    es_image image = stress_image(renderer, name), instance = stress_image(renderer, "instance");
    double sum = 0;
    size_t count = 0;
    for (size_t i = 0; i < values_of(&instance); i++) {
        if (number && (uint32_t)instance.pixels[i] != number) continue;
        count++;
        for (uint32_t k = 0; k < image.channels; k++) sum += (double)image.pixels[i * image.channels + k] / image.channels;
    }
    es_image_destroy(s->context, &image);
    es_image_destroy(s->context, &instance);
    return count ? sum / (double)count : 0;
}

/* A floor at y = 0 that is instance 1, seen from above, and a wall. */
static stress floor_and_wall(bool double_sided)
{
    stress s = stress_open(1, es_v3(0, 0, 0));
    es_material_desc white = matte(0.8f, 0.8f, 0.8f);
    white.double_sided = double_sided;
    stress_rectangle(&s, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &white);
    stress_rectangle(&s, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 2, 0), &white);
    stress_look(&s, es_v3(0, 1.8f, 3), es_v3(0, 0.3f, 0), 0.9f, 0.05f);
    return s;
}

/* ---- at a surface ------------------------------------------------------------------------------------------------------------------- */

static void on_in_and_behind_a_surface(void** state)
{
    (void)state;
    const float heights[] = {1, 1e-2f, 1e-4f, 1e-6f, 1e-12f, 0, -1e-12f, -1e-6f, -1e-4f, -1e-2f, -1};
    const es_vec3 directions[] = {{0, -1, 0}, {0, 1, 0}, {1, 0, 0}, {0.3f, -1e-4f, -1}};
    for (int type = 0; type < 3; type++)
        for (size_t h = 0; h < sizeof heights / sizeof *heights; h++)
            for (int d = 0; d < (type == 1 ? 1 : 4); d++)
                for (size_t method = 0; method < METHODS; method += h % 2 ? METHODS - 1 : 1) {
                    char what[80];
                    snprintf(what, sizeof what, "%s, %s light %g m above the floor, direction %d", methods[method].name, type_names[type], (double)heights[h], d);
                    stress s = floor_and_wall(true);
                    stress_light(&s, types[type], type == 2 ? 2 : 5, es_v3(0.1f, heights[h], 0.2f), directions[d]);
                    assert_int_equal(es_world_step(s.world, 0), ES_OK);
                    es_renderer_settings settings = settings_of(method);
                    es_renderer* renderer = stress_render(&s, &settings);
                    assert_all_finite(&s, renderer, what);
                    double floor = mean_over(&s, renderer, "direct", 1);
                    /* the eye sees the upper side; within rounding of the plane a pixel may lie below the light */
                    if (type < 2 && heights[h] <= 0 && !(floor <= (heights[h] < -1e-5f ? 0 : 1e-4))) fail_msg("%s: the floor shines with %g, lit from below", what, floor);
                    if (type == 2 && (d == 1 || d == 2) && floor != 0) fail_msg("%s: the floor shines with %g, lit from below or along itself", what, floor);
                    if (type == 1 && heights[h] == 1 && !(floor > 0.1)) fail_msg("%s: the floor is dark", what);
                    es_renderer_destroy(renderer);
                    stress_close(&s);
                    if (type == 2 && h > 0) break;
                }
}

/* ---- inside --------------------------------------------------------------------------------------------------------------------------- */

/* A lamp in a closed box of single sheets, in a closed ball, and in both. Whether from inside or outside, the other side stays black: to rays
 * exactly, to shadow maps but for the contact with the floor, where a texel of the map reaches across (tests/stress/bias.c measures it). */
static void inside_of_things(void** state)
{
    (void)state;
    const es_material_desc white = matte(0.8f, 0.8f, 0.8f), gold = polished(0.9f, 0.7f, 0.3f, 0.2f);
    for (int shape = 0; shape < 2; shape++)
        for (size_t method = 0; method < METHODS; method++)
            for (int type = 0; type < 2; type++) {
                stress s = stress_open(1, es_v3(0, 0, 0));
                stress_rectangle(&s, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &white);
                if (shape) stress_ball(&s, es_v3(0, 0.8f, 0), 0.6f, 16, false, method & 1 ? &gold : &white);
                else stress_box(&s, es_v3(-0.5f, 0.3f, -0.5f), es_v3(0.5f, 1.3f, 0.5f), false, method & 1 ? &gold : &white);
                stress_light(&s, types[type], 5, es_v3(0.1f, 0.9f, -0.1f), es_v3(0.2f, -1, 0.1f));
                stress_look(&s, es_v3(0, 1.8f, 3), es_v3(0, 0.3f, 0), 0.9f, 0.05f);
                es_renderer_settings settings = settings_of(method);
                es_renderer* renderer = stress_render(&s, &settings);
                assert_all_finite(&s, renderer, methods[method].name);
                double direct = mean_over(&s, renderer, "direct", 0), indirect = mean_over(&s, renderer, "indirect", 0);
                if (direct != 0) fail_msg("%s: a %s light in a closed %s gives %g outside", methods[method].name, type_names[type], shape ? "ball" : "box", direct);
                bool traced = methods[method].method == ES_GI_VPL_TRACED;
                if (traced && indirect != 0) fail_msg("%s: a %s light in a closed %s gives %g outside", methods[method].name, type_names[type], shape ? "ball" : "box", indirect);
                /* beside 5 W/sr in the open: 0.8² · 5 / (pi h)²-like radiances of some tenths */
                if (!traced) printf("    %s, %s light in a closed %s: %.2g W/(m² sr) of indirect light outside\n", methods[method].name, type_names[type], shape ? "ball" : "box", indirect);
                es_renderer_destroy(renderer);
                stress_close(&s);
            }
}

static void at_the_camera(void** state)
{
    (void)state;
    for (size_t method = 0; method < METHODS; method++)
        for (int type = 0; type < 2; type++) {
            stress s = floor_and_wall(true);
            es_light light = stress_light(&s, types[type], 5, es_v3(0, 1.8f, 3), es_v3_sub(es_v3(0, 0.3f, 0), es_v3(0, 1.8f, 3)));
            (void)light;
            assert_int_equal(es_world_step(s.world, 0), ES_OK);
            es_renderer_settings settings = settings_of(method);
            es_renderer* renderer = stress_render(&s, &settings);
            assert_all_finite(&s, renderer, methods[method].name);
            /* what the eye sees the lamp sees: there is no shadow */
            es_image direct = stress_image(renderer, "direct"), depth = stress_image(renderer, "depth");
            size_t dark = 0;
            for (size_t i = 0; i < values_of(&depth); i++) dark += depth.pixels[i] > 0 && direct.pixels[3 * i] <= 0;
            if (type == 1) assert_int_equal(dark, 0);
            es_image_destroy(s.context, &direct);
            es_image_destroy(s.context, &depth);
            es_renderer_destroy(renderer);
            stress_close(&s);
        }
}

/* ---- together ------------------------------------------------------------------------------------------------------------------------- */

/* Two halves in one place are a whole: exactly for direct light; of the indirect light each half has its own virtual lights. */
static void coincident(void** state)
{
    (void)state;
    for (size_t method = 0; method < METHODS; method++)
        for (int type = 0; type < 3; type++) {
            double direct[2], indirect[2];
            uint64_t hash[2];
            for (int halves = 0; halves < 2; halves++) {
                stress s = floor_and_wall(true);
                for (int i = 0; i <= halves; i++) stress_light(&s, types[type], halves ? 2 : 4, es_v3(0.1f, 1.2f, 0.2f), es_v3(0.1f, -1, -0.4f));
                assert_int_equal(es_world_step(s.world, 0), ES_OK);
                es_renderer_settings settings = settings_of(method);
                settings.vpls = 512;
                if (methods[method].method == ES_GI_CLASSIC) settings.vpls = 128;
                es_renderer* renderer = stress_render(&s, &settings);
                assert_all_finite(&s, renderer, methods[method].name);
                direct[halves] = mean_over(&s, renderer, "direct", 0);
                indirect[halves] = mean_over(&s, renderer, "indirect", 0);
                es_image image = stress_image(renderer, "direct");
                hash[halves] = es_image_hash(&image);
                es_image_destroy(s.context, &image);
                es_renderer_destroy(renderer);
                stress_close(&s);
            }
            assert_true(direct[0] > 0 && hash[0] == hash[1]);
            if (!(fabs(indirect[1] / indirect[0] - 1) < 0.1)) fail_msg("%s: two halves of a %s light give %g times the whole's indirect light", methods[method].name, type_names[type], indirect[1] / indirect[0]);
        }
}

/* ---- ranges --------------------------------------------------------------------------------------------------------------------------- */

static void ranges(void** state)
{
    (void)state;
    const float all[] = {0, 1e-30f, 1e-6f, 0.5f, 1e4f, 1e12f};
    for (size_t method = 0; method < METHODS; method++)
        for (int type = 0; type < 2; type++) {
            double direct[6], indirect[6];
            for (int r = 0; r < 6; r++) {
                stress s = floor_and_wall(true);
                es_light light = stress_light(&s, types[type], 4, es_v3(0.1f, 1.2f, 0.2f), es_v3(0.1f, -1, -0.4f));
                es_light_desc desc;
                assert_int_equal(es_world_get_light(s.world, light, &desc), ES_OK);
                desc.range = all[r];
                assert_int_equal(es_world_set_light(s.world, light, &desc), ES_OK);
                assert_int_equal(es_world_step(s.world, 0), ES_OK);
                es_renderer_settings settings = settings_of(method);
                es_renderer* renderer = stress_render(&s, &settings);
                assert_all_finite(&s, renderer, methods[method].name);
                direct[r] = mean_over(&s, renderer, "direct", 0);
                indirect[r] = mean_over(&s, renderer, "indirect", 0);
                es_renderer_destroy(renderer);
                stress_close(&s);
            }
            /* 0 is no limit; what ends before the nearest surface lights nothing; 1e4 m is 1 - (1.2e-4)^4 of no limit here, which is 1 */
            assert_true(direct[0] > 0 && indirect[0] > 0);
            for (int r = 1; r < 4; r++) assert_true(direct[r] == 0 && indirect[r] == 0);
            for (int r = 4; r < 6; r++) assert_true(direct[r] == direct[0] && indirect[r] == indirect[0]);
        }
}

/* ---- on a shading point ------------------------------------------------------------------------------------------------------------- */

static void look_from_the_lamp(stress* s, float outer, uint32_t size)
{
    /* the light's G-buffer has a margin of two texels on each side; seen upright with the same opening, its texels are the camera's pixels */
    es_light_desc desc = es_default_light_desc();
    desc.intensity = 20;
    desc.outer_cone = outer;
    desc.node = stress_node(s, es_v3(0.2f, 1.6f, 2), es_v3(0, -0.6f, -1));
    es_light light;
    assert_int_equal(es_world_add_light(s->world, &desc, &light), ES_OK);
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 2 * outer * (1 + 4.0f / (float)size);
    camera.near_plane = 0.01f;
    camera.node = desc.node;
    es_camera eye;
    assert_int_equal(es_world_add_camera(s->world, &camera, &eye), ES_OK);
    assert_int_equal(es_world_set_active_camera(s->world, eye), ES_OK);
    assert_int_equal(es_world_step(s->world, 0), ES_OK);
}

static void virtual_light_on_a_pixel(void** state)
{
    (void)state;
    enum { SIZE = 64 };
    for (size_t method = 0; method < METHODS; method++) {
        stress s = floor_and_wall(true);
        const es_material_desc gold = polished(0.9f, 0.7f, 0.3f, 0.1f);
        stress_ball(&s, es_v3(-0.4f, 0.5f, 0), 0.5f, 16, false, &gold);
        look_from_the_lamp(&s, 0.5f, SIZE);
        es_renderer_settings settings = settings_of(method);
        settings.width = settings.height = settings.light_size = SIZE;
        settings.vpls = 256;
        settings.interleave = 1;
        settings.spread = 0;
        settings.lobe_roughness = 0;
        settings.geometry_bound = 1e9f;
        settings.traced_samples = 1;
        es_renderer* renderer = stress_render(&s, &settings);
        assert_all_finite(&s, renderer, methods[method].name);
        /* that they do sit on pixels: each within a thousandth of a pixel's width of a pixel's position */
        static es_vpl vpls[256];
        size_t count = es_renderer_vpls(renderer, vpls, 256), on = 0;
        assert_int_equal(count, 256);
        es_image depth = stress_image(renderer, "depth");
        es_mat4 to_world;
        es_light_desc lamp;
        uint32_t id;
        size_t lights = 1;
        assert_int_equal(es_world_enumerate(s.world, ES_OBJECT_LIGHT, &id, &lights), ES_OK);
        assert_int_equal(es_world_get_light(s.world, (es_light){id}, &lamp), ES_OK);
        assert_int_equal(es_world_get_node_matrix(s.world, lamp.node, &to_world), ES_OK);
        const float* m = to_world.m;
        const double half = tan(0.5 * 2 * 0.5 * (1 + 4.0 / SIZE));
        for (size_t i = 0; i < count; i++) {
            const double d[3] = {(double)(vpls[i].position.x - m[12]), (double)(vpls[i].position.y - m[13]), (double)(vpls[i].position.z - m[14])};
            double c[3];
            for (int k = 0; k < 3; k++) c[k] = d[0] * (double)m[4 * k] + d[1] * (double)m[4 * k + 1] + d[2] * (double)m[4 * k + 2];
            double x = (c[0] / -c[2] / half + 1) * 0.5 * SIZE - 0.5, y = (1 - c[1] / -c[2] / half) * 0.5 * SIZE - 0.5;
            double px = floor(x + 0.5), py = floor(y + 0.5);
            if (!(px >= 0 && px < SIZE && py >= 0 && py < SIZE)) continue;
            double there = (double)depth.pixels[(size_t)py * SIZE + (size_t)px];
            on += fabs(x - px) < 1e-3 && fabs(y - py) < 1e-3 && fabs(there + c[2]) < 1e-4;
        }
        if (on < 250) fail_msg("%s: %zu of 256 virtual lights sit on pixels", methods[method].name, on);
        es_image_destroy(s.context, &depth);
        es_renderer_destroy(renderer);
        stress_close(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_in_and_behind_a_surface),
        cmocka_unit_test(inside_of_things),
        cmocka_unit_test(at_the_camera),
        cmocka_unit_test(coincident),
        cmocka_unit_test(ranges),
        cmocka_unit_test(virtual_light_on_a_pixel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
