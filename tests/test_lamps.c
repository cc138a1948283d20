/* Light of glowing surfaces and of the environment by sets of lights: form factors in closed form, where the lights stand, and what may be skipped. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "gi/lamps.h"
#include "gi/plan.h"
#include "tests/form_factors.h"
#include "tests/reference_runs.h"

enum { SIZE = 16 };
static const float radiance = 3, albedo = 0.6f;

static es_renderer_settings settings_of(uint32_t lamps)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.method = ES_GI_NONE;
    s.width = s.height = SIZE;
    s.lamps = lamps;
    s.lamp_count = 256;
    s.lamp_size = 64;
    s.lamp_interleave = 1;
    s.ism_points = 1024;
    s.ism_pool = 16384;
    s.lamp_slope_bias = 0.026f; /* of so few points */
    return s;
}

static es_renderer* renderer_of(const small_world* w, const es_renderer_settings* s)
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w->context, s, &renderer), ES_OK);
    return renderer;
}

static es_image image_of(const small_world* w, es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static es_image rendered(const small_world* w, const es_renderer_settings* s, const char* name)
{
    es_renderer* renderer = renderer_of(w, s);
    es_image image = image_of(w, renderer, name);
    es_renderer_destroy(renderer);
    return image;
}

static void assert_same_image(const es_image* a, const es_image* b)
{
    assert_int_equal(a->width * a->height * a->channels, b->width * b->height * b->channels);
    assert_memory_equal(a->pixels, b->pixels, (size_t)a->width * a->height * a->channels * sizeof(float));
}

static double brightness(const es_image* image)
{
    double sum = 0;
    for (size_t i = 0; i < (size_t)image->width * image->height * 3; i++) sum += (double)image->pixels[i];
    return sum;
}

/* ---- form factors ----------------------------------------------------------------------------------------------------------------- */

/* A floor of 3 m, seen from above through the backs of what glows. */
static void add_floor(small_world* w)
{
    es_material_desc grey = lambert(albedo, 0);
    add_rectangle(w, es_v3(-1.5f, 0, 1.5f), es_v3(3, 0, 0), es_v3(0, 0, -3), &grey);
}

typedef double (*form_factor)(es_vec3 point);

static double of_rectangle(es_vec3 p)
{
    static const es_vec3 corners[4] = {{-0.4f, 0.8f, -0.25f}, {0.4f, 0.8f, -0.25f}, {0.4f, 0.8f, 0.25f}, {-0.4f, 0.8f, 0.25f}};
    return point_to_polygon(p, es_v3(0, 1, 0), corners, 4);
}

/* Howell's B-13, a disc of radius R parallel to a plane element at height h and distance a from its axis. */
static double of_disc(es_vec3 p)
{
    const double h = 0.7, r = 0.45, a = sqrt((double)p.x * (double)p.x + (double)p.z * (double)p.z), H = h * h + a * a + r * r;
    return 0.5 * (1 - (H - 2 * r * r) / sqrt(H * H - 4 * a * a * r * r));
}

static double of_sphere(es_vec3 p)
{
    const double x = (double)p.x, z = (double)p.z, h = 0.9, d = sqrt(x * x + z * z + h * h);
    return point_to_sphere(0.3, d, acos(h / d));
}

static void add_disc(small_world* w, float height, float radius, const es_material_desc* material)
{
    enum { SIDES = 96 };
    float p[3 * (SIDES + 1)] = {0, height, 0};
    uint32_t index[3 * SIDES];
    for (uint32_t i = 0; i < SIDES; i++) {
        const float a = 2 * ES_PI * (float)i / SIDES;
        p[3 * i + 3] = radius * es_cos(a);
        p[3 * i + 4] = height;
        p[3 * i + 5] = radius * es_sin(a);
        index[3 * i] = 0; /* facing down */
        index[3 * i + 1] = 1 + i;
        index[3 * i + 2] = 1 + (i + 1) % SIDES;
    }
    add_instance(w, &(es_mesh_desc){.vertex_count = SIDES + 1, .triangle_count = SIDES, .positions = p, .indices = index, .flat_normals = true}, material);
}

static void check_floor(small_world* w, form_factor factor, double share, double worst, const char* what)
{
    static const uint32_t ways[] = {ES_LAMPS_TRACED, ES_LAMPS_MAPS};
    es_camera_desc camera = es_default_camera_desc();
    camera.orthographic = true;
    camera.half_height = 1.4f;
    camera.near_plane = 0.01f;
    camera.far_plane = 0.4f;
    look(w, camera, es_v3(0, 0.3f, 0), es_v3(0, 0, 0));
    for (size_t k = 0; k < 2; k++) {
        es_renderer_settings s = settings_of(ways[k]);
        es_image image = rendered(w, &s, "lamps");
        double sum = 0, all = 0;
        for (uint32_t y = 0; y < SIZE; y++)
            for (uint32_t x = 0; x < SIZE; x++) {
                const double expected = factor(pixel_on_plane(w, SIZE, SIZE, x, y, es_v3(0, 0, 0), es_v3(0, 1, 0))) * (double)(radiance * albedo) * share, found = (double)image.pixels[3 * (y * SIZE + x)];
                sum += found;
                all += expected;
                if (!(fabs(found - expected) <= worst * expected)) fail_msg("%s, lamps %u, pixel %u %u: %.6f, expected %.6f", what, ways[k], x, y, found, expected);
            }
        if (!(fabs(sum - all) <= 5e-3 * all)) fail_msg("%s, lamps %u: %.6f in all, expected %.6f", what, ways[k], sum, all);
        es_image_destroy(w->context, &image);
    }
}

/* Lights are discs of their share of the area, which is what differs from the form factor near them; the horizon of a sphere cuts through some. */
static void test_form_factors(void** state)
{
    (void)state;
    es_material_desc glowing = lambert(0, radiance);
    small_world w = small_world_create();
    add_floor(&w);
    add_rectangle(&w, es_v3(-0.4f, 0.8f, -0.25f), es_v3(0.8f, 0, 0), es_v3(0, 0, 0.5f), &glowing);
    check_floor(&w, of_rectangle, 1, 0.02, "rectangle");
    small_world_destroy(&w);

    w = small_world_create();
    add_floor(&w);
    add_disc(&w, 0.7f, 0.45f, &glowing);
    check_floor(&w, of_disc, 1, 0.03, "disc");
    small_world_destroy(&w);

    w = small_world_create();
    add_floor(&w);
    add_sphere(&w, es_v3(0, 0.9f, 0), 0.3f, 32, false, &glowing);
    check_floor(&w, of_sphere, 1, 0.03, "sphere");
    small_world_destroy(&w);

    /* its back lights the floor as its front does where both sides glow, and not where one does */
    w = small_world_create();
    add_floor(&w);
    glowing.double_sided = true;
    add_rectangle(&w, es_v3(-0.4f, 0.8f, 0.25f), es_v3(0.8f, 0, 0), es_v3(0, 0, -0.5f), &glowing);
    check_floor(&w, of_rectangle, 1, 0.02, "back of a rectangle");
    small_world_destroy(&w);
    w = small_world_create();
    add_floor(&w);
    glowing.double_sided = false;
    add_rectangle(&w, es_v3(-0.4f, 0.8f, 0.25f), es_v3(0.8f, 0, 0), es_v3(0, 0, -0.5f), &glowing);
    check_floor(&w, of_rectangle, 0, 0, "dark side of a rectangle");
    small_world_destroy(&w);
}

/* The same shapes as es_world_add_area_light makes them, by radiance or by what they send in all. */
static void test_area_lights(void** state)
{
    (void)state;
    static const struct { es_area_shape shape; float size[2], height; double area; form_factor factor; const char* name; } shapes[] = {
        {ES_AREA_RECTANGLE, {0.8f, 0.5f}, 0.8f, 0.4, of_rectangle, "rectangle"}, {ES_AREA_DISC, {0.9f, 0.9f}, 0.7f, 0.6361725, of_disc, "disc"}, {ES_AREA_SPHERE, {0.6f, 0}, 0.9f, 1.1309734, of_sphere, "sphere"}};
    for (size_t i = 0; i < 3; i++)
        for (int by_flux = 0; by_flux < 2; by_flux++) {
            small_world w = small_world_create();
            add_floor(&w);
            es_area_light_desc desc = es_default_area_light_desc();
            desc.shape = shapes[i].shape;
            memcpy(desc.size, shapes[i].size, sizeof desc.size);
            desc.radiance = by_flux ? 0 : radiance;
            desc.flux = by_flux ? (float)(pi * shapes[i].area * (double)radiance) : 0;
            desc.node = node_towards(&w, es_v3(0, shapes[i].height, 0), es_v3(0, -1, 0));
            es_area_light light;
            assert_int_equal(es_world_add_area_light(w.world, &desc, &light), ES_OK);
            check_floor(&w, shapes[i].factor, 1, 0.03, shapes[i].name);
            if (by_flux) {
                assert_int_equal(es_world_destroy_area_light(w.world, &light), ES_OK);
                check_floor(&w, shapes[i].factor, 0, 0, "no light");
                assert_int_not_equal(es_world_destroy_area_light(w.world, &light), ES_OK);
            }
            small_world_destroy(&w);
        }
    small_world w = small_world_create();
    es_area_light_desc bad = es_default_area_light_desc();
    es_area_light light;
    bad.size[1] = 0;
    assert_int_equal(es_world_add_area_light(w.world, &bad, &light), ES_INVALID_ARGUMENT);
    bad = es_default_area_light_desc();
    bad.radiance = NAN;
    assert_int_equal(es_world_add_area_light(w.world, &bad, &light), ES_INVALID_ARGUMENT);
    bad = es_default_area_light_desc();
    bad.node.id = 12345;
    assert_int_not_equal(es_world_add_area_light(w.world, &bad, &light), ES_OK);
    assert_int_equal(es_world_draw_list(w.world)->instance_count, 0);
    small_world_destroy(&w);
}

/* ---- the set ------------------------------------------------------------------------------------------------------------------------ */

static es_lamp_request request_of(small_world* w, uint32_t count)
{
    return (es_lamp_request){.list = es_world_draw_list(w->world), .materials = es_world_get_revisions(w->world).materials, .count = count, .subsets = 16, .extent = 3};
}

/* A sheet of which the left half is red and the right one green and twice as bright, stretched over an area of 2 m². */
static void add_two_colours(small_world* w, es_node* node)
{
    const uint8_t texels[2 * 4] = {100, 0, 0, 255, 0, 200, 0, 255};
    es_texture texture;
    assert_int_equal(es_world_add_texture(w->world, &(es_texture_desc){.width = 2, .height = 1, .rgba = texels}, &texture), ES_OK);
    es_material_desc desc = lambert(0, 5);
    desc.emission_texture.image = es_world_texture_image(w->world, texture);
    desc.emission_texture.magnify = desc.emission_texture.minify = ES_FILTER_NEAREST;
    static const float positions[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, uvs[8] = {0, 0, 1, 0, 1, 1, 0, 1};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    es_mesh mesh;
    es_material material;
    es_instance instance;
    assert_int_equal(es_world_add_mesh(w->world, &(es_mesh_desc){.vertex_count = 4, .triangle_count = 2, .positions = positions, .uv0 = uvs, .indices = indices, .flat_normals = true}, &mesh), ES_OK);
    assert_int_equal(es_world_add_material(w->world, "", &desc, &material), ES_OK);
    assert_int_equal(es_world_add_node(w->world, &(es_node_desc){.transform = {{0, 1, 0}, {0, 0, 0, 1}, {2, 1, 1}}}, node), ES_OK);
    assert_int_equal(es_world_add_instance(w->world, &(es_instance_desc){.mesh = mesh, .material = material, .node = *node}, &instance), ES_OK);
}

static void test_places(void** state)
{
    (void)state;
    enum { LIGHTS = 64 };
    small_world w = small_world_create();
    es_node node;
    add_two_colours(&w, &node);
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    es_lamps lamps = {0};
    es_lamp_request request = request_of(&w, LIGHTS);
    assert_int_equal(es_lamps_update(w.context, &lamps, &request), ES_OK);
    assert_int_equal(lamps.count, LIGHTS);
    double sum[3] = {0, 0, 0};
    es_vec3 before[LIGHTS];
    for (uint32_t v = 0; v < LIGHTS; v++) {
        const es_vpl_record* r = &lamps.records[v];
        /* its colour is that of its place */
        if (r->position[0] < 0.99f) assert_true(r->flux[0] > 0 && r->flux[1] == 0);
        if (r->position[0] > 1.01f) assert_true(r->flux[1] > 0 && r->flux[0] == 0);
        assert_true(r->normal[2] > 0.999f && r->position[2] > 0 && r->position[2] < 1e-3f);
        for (int k = 0; k < 3; k++) sum[k] += (double)r->flux[k];
        before[v] = es_v3(r->position[0], r->position[1], r->position[2]);
    }
    /* pi L A of each half; green has 0.7152 · 200 of 0.2126 · 100 + 0.7152 · 200 of the luminance, to a light */
    assert_true(fabs(sum[0] - pi * 5 * 100 / 255) < 0.07 * pi * 5 * 100 / 255);
    assert_true(fabs(sum[1] - pi * 5 * 200 / 255) < 0.02 * pi * 5 * 200 / 255);
    assert_true(sum[2] == 0);

    /* they go along, and each subset of the pattern has both colours' share */
    assert_int_equal(es_world_set_node_transform(w.world, node, &(es_transform){{0.5f, 2, 1}, es_quat_from_axis_angle(es_v3(0, 0, 1), ES_PI / 2), {2, 1, 1}}), ES_OK);
    assert_int_equal(es_world_step(w.world, 0.1), ES_OK);
    request = request_of(&w, LIGHTS);
    assert_int_equal(es_lamps_update(w.context, &lamps, &request), ES_OK);
    for (uint32_t v = 0; v < LIGHTS; v++) {
        const es_vpl_record* r = &lamps.records[v];
        assert_true(fabsf(r->position[0] - (0.5f - (before[v].y - 1))) < 1e-5f && fabsf(r->position[1] - (2 + before[v].x)) < 1e-5f);
    }
    for (uint32_t subset = 0; subset < 16; subset++) {
        uint32_t green = 0;
        for (uint32_t v = subset; v < LIGHTS; v += 16) green += lamps.records[v].flux[1] > 0;
        assert_true(green >= 2);
    }
    es_lamps_free(w.context, &lamps);
    small_world_destroy(&w);
}

/* ---- frames ------------------------------------------------------------------------------------------------------------------------- */

static void add_scene(small_world* w, es_node* node)
{
    add_floor(w);
    if (node) add_two_colours(w, node);
    es_material_desc grey = lambert(0.5f, 0);
    add_sphere(w, es_v3(0.4f, 0.3f, 0.6f), 0.3f, 8, false, &grey);
    look(w, es_default_camera_desc(), es_v3(0, 1.5f, 4), es_v3(0, 0.7f, 0));
}

/* What a renderer shows after a lamp has moved is what one shows that never saw it elsewhere, whether it skips work or not. */
static void test_moving_lamp(void** state)
{
    (void)state;
    static const uint32_t ways[] = {ES_LAMPS_MAPS, ES_LAMPS_TRACED};
    for (size_t k = 0; k < 2; k++) {
        small_world w = small_world_create();
        es_node node;
        add_scene(&w, &node);
        es_renderer_settings s = settings_of(ways[k]);
        s.method = k ? ES_GI_NONE : ES_GI_MICRO;
        s.micro_points = 4096;
        s.lamp_interleave = 4;
        es_renderer* skips = renderer_of(&w, &s);
        s.skip = false;
        es_renderer* repeats = renderer_of(&w, &s);
        for (int frame = 0; frame < 4; frame++) {
            if (frame % 2) assert_int_equal(es_world_set_node_transform(w.world, node, &(es_transform){{-1, 1 + 0.2f * (float)frame, 0}, {0, 0, 0, 1}, {2, 1, 1}}), ES_OK);
            assert_int_equal(es_world_step(w.world, 0), ES_OK);
            es_image a = image_of(&w, skips, "radiance"), b = image_of(&w, repeats, "radiance"), c = rendered(&w, &s, "radiance");
            assert_same_image(&a, &b);
            assert_same_image(&a, &c);
            assert_true(brightness(&a) > 0);
            es_image_destroy(w.context, &a);
            es_image_destroy(w.context, &b);
            es_image_destroy(w.context, &c);
        }
        es_renderer_destroy(skips);
        es_renderer_destroy(repeats);
        small_world_destroy(&w);
    }
}

/* Other settings may want room for more lights of bounces, which begins empty: what lamps' bounce had put there is made again, where there is no other light as well. */
static void test_more_lights(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_node node;
    add_scene(&w, &node);
    es_renderer_settings s = settings_of(ES_LAMPS_MAPS);
    s.method = ES_GI_ISM;
    s.vpls = 64;
    s.lamp_vpls = 64;
    s.interleave = 1;
    es_renderer* renderer = renderer_of(&w, &s);
    for (s.bounces = 1; s.bounces <= 3; s.bounces++) {
        assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
        es_image a = image_of(&w, renderer, "radiance"), b = rendered(&w, &s, "radiance");
        assert_same_image(&a, &b);
        es_image_destroy(w.context, &a);
        es_image_destroy(w.context, &b);
    }
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

/* Where nothing glows, or only blackly, the passes are skipped and say why, and the picture has the bits that it has without them. */
static void test_nothing_glows(void** state)
{
    (void)state;
    small_world w = small_world_create();
    add_scene(&w, NULL);
    es_light_desc lamp = es_default_light_desc();
    add_light(&w, lamp, es_v3(0, 2, 1), es_v3(0, -1, 0));
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    es_renderer_settings s = settings_of(ES_LAMPS_MAPS), none = settings_of(ES_LAMPS_NONE);
    es_renderer* renderer = renderer_of(&w, &s);
    es_image a = image_of(&w, renderer, "radiance"), b = rendered(&w, &none, "radiance");
    assert_same_image(&a, &b);
    const es_frame_stats* stats = es_renderer_stats(renderer);
    assert_string_equal(stats->passes[ES_PASS_LAMPS].skipped, "nothing glows");
    assert_string_equal(stats->passes[ES_PASS_LAMP_MAPS].skipped, "nothing glows");
    assert_string_equal(stats->passes[ES_PASS_LAMP_LIGHT].skipped, "nothing glows");
    es_renderer_destroy(renderer);
    es_image_destroy(w.context, &a);
    es_image_destroy(w.context, &b);
    small_world_destroy(&w);
}

/* ---- the environment ---------------------------------------------------------------------------------------------------------------- */

static void set_environment(small_world* w, const es_image* image, float radiance_of_it)
{
    assert_int_equal(es_world_set_environment(w->world, &(es_environment_desc){.image = image, .radiance = {radiance_of_it, radiance_of_it, radiance_of_it}}), ES_OK);
}

/* Of pixels where a surface is seen; red. */
static double mean_seen(const small_world* w, es_renderer* renderer, const char* name, double* worst, double expected)
{
    es_image image = image_of(w, renderer, name), depth;
    assert_int_equal(es_renderer_image(renderer, "depth", &depth), ES_OK);
    double sum = 0, count = 0;
    *worst = 0;
    for (size_t i = 0; i < (size_t)image.width * image.height; i++) {
        if (!(depth.pixels[i] > 0)) continue;
        const double value = (double)image.pixels[3 * i];
        sum += value;
        count++;
        if (fabs(value - expected) > *worst) *worst = fabs(value - expected);
    }
    es_image_destroy(w->context, &image);
    es_image_destroy(w->context, &depth);
    assert_true(count > 0);
    return sum / count;
}

/* What is convex and stands alone reflects albedo · L everywhere under L from everywhere. */
static void test_furnace(void** state)
{
    (void)state;
    static const uint32_t ways[] = {ES_LAMPS_TRACED, ES_LAMPS_MAPS};
    small_world w = small_world_create();
    es_material_desc grey = lambert(albedo, 0);
    add_sphere(&w, es_v3(0, 0, 0), 1, 32, false, &grey);
    look(&w, es_default_camera_desc(), es_v3(0.5f, 2, 3), es_v3(0, 0, 0));
    set_environment(&w, NULL, radiance);
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    for (size_t k = 0; k < 2; k++)
        for (uint32_t n = 1; n <= 4; n += 3) {
            es_renderer_settings s = settings_of(ways[k]);
            s.lamp_interleave = n;
            s.lamp_count = 512;
            es_renderer* renderer = renderer_of(&w, &s);
            const double expected = (double)(albedo * radiance);
            double worst, mean = mean_seen(&w, renderer, "lamps", &worst, expected);
            /* a shadow map's grazing texels hide some of the horizon's light */
            if (!(fabs(mean - expected) < (k ? 0.03 : 0.01) * expected && worst < (n > 1 ? 0.2 : k ? 0.1 : 0.05) * expected)) fail_msg("lamps %u, interleave %u: %.4f, at worst %.4f off, expected %.4f", ways[k], n, mean, worst, expected);
            es_renderer_destroy(renderer);
        }
    small_world_destroy(&w);
}

/* In a box without a lid, as the path tracer has it: direct light, and its first bounce by virtual point lights and by micro-buffers. Maps of 64² texels and 4096 points
 * widen the rims by a splat, which hides a tenth. */
static void test_open_box(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_material_desc grey = lambert(albedo, 0);
    grey.double_sided = true;
    add_rectangle(&w, es_v3(-1, 0, 1), es_v3(2, 0, 0), es_v3(0, 0, -2), &grey);
    add_rectangle(&w, es_v3(-1, 0, -1), es_v3(2, 0, 0), es_v3(0, 1, 0), &grey);
    add_rectangle(&w, es_v3(-1, 0, 1), es_v3(0, 0, -2), es_v3(0, 1, 0), &grey);
    add_rectangle(&w, es_v3(1, 0, -1), es_v3(0, 0, 2), es_v3(0, 1, 0), &grey);
    add_rectangle(&w, es_v3(1, 0, 1), es_v3(-2, 0, 0), es_v3(0, 1, 0), &grey);
    look(&w, es_default_camera_desc(), es_v3(0, 3.2f, 1.2f), es_v3(0, 0, 0));
    set_environment(&w, NULL, radiance);
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    es_reference_settings rs = reference_settings(SIZE, SIZE, 1);
    es_reference* reference = trace(&w, &rs, 256 / FEWER);
    const measured direct = mean_of_reference(&w, reference, "direct"), bounce = mean_of_reference(&w, reference, "bounce-1");
    es_reference_destroy(reference);
    static const struct { uint32_t lamps, method; double direct, bounce; } ways[] = {
        {ES_LAMPS_TRACED, ES_GI_VPL_TRACED, 0.02, 0.06}, {ES_LAMPS_MAPS, ES_GI_ISM, 0.12, 0.2}, {ES_LAMPS_TRACED, ES_GI_MICRO, 0.02, 0.12}, {ES_LAMPS_MAPS, ES_GI_CLASSIC, 0.12, 0.25}};
    for (size_t k = 0; k < sizeof ways / sizeof ways[0]; k++) {
        es_renderer_settings s = settings_of(ways[k].lamps);
        s.method = ways[k].method;
        s.lamp_count = 512;
        s.ism_points = 4096;
        s.ism_pool = 65536;
        s.lamp_slope_bias = s.ism_slope_bias = 0.01f;
        s.micro_points = 16384;
        s.classic_size = 32;
        s.interleave = 1;
        s.lamp_vpls = 2048; /* most stand outside */
        es_renderer* renderer = renderer_of(&w, &s);
        es_image image = image_of(&w, renderer, "lamps"), indirect;
        assert_int_equal(es_renderer_image(renderer, "indirect", &indirect), ES_OK);
        const double d = mean_of_block(&image, NULL, 0, 0, SIZE, SIZE).value, i = mean_of_block(&indirect, NULL, 0, 0, SIZE, SIZE).value;
        if (!(fabs(d - direct.value) < ways[k].direct * direct.value)) fail_msg("lamps %u, gi %u: direct %.4f, expected %.4f ± %.4f", ways[k].lamps, ways[k].method, d, direct.value, direct.error);
        if (!(fabs(i - bounce.value) < ways[k].bounce * bounce.value)) fail_msg("lamps %u, gi %u: a bounce of %.4f, expected %.4f ± %.4f", ways[k].lamps, ways[k].method, i, bounce.value, bounce.error);
        es_image_destroy(w.context, &image);
        es_image_destroy(w.context, &indirect);
        es_renderer_destroy(renderer);
    }
    small_world_destroy(&w);
}

/* One texel a million times as bright as the rest: it is one light, in every subset of the pattern, so that no pixel sparkles. */
static void test_one_bright_texel(void** state)
{
    (void)state;
    enum { WIDTH = 64, HEIGHT = 32, ROW = 5 };
    small_world w = small_world_create();
    add_floor(&w);
    look(&w, es_default_camera_desc(), es_v3(0, 2, 1.2f), es_v3(0, 0, 0));
    es_image sky;
    assert_int_equal(es_image_create(w.context, WIDTH, HEIGHT, 3, &sky), ES_OK);
    for (size_t i = 0; i < WIDTH * HEIGHT * 3; i++) sky.pixels[i] = i / 3 == ROW * WIDTH + 20 ? 1000.0f : 0.001f;
    set_environment(&w, &sky, 1);
    es_image_destroy(w.context, &sky);
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    const double polar = pi * (ROW + 0.5) / HEIGHT, solid_angle = 2 * pi / WIDTH * (cos(pi * ROW / HEIGHT) - cos(pi * (ROW + 1) / HEIGHT));
    const double expected = (double)albedo / pi * (1000 * solid_angle * cos(polar) + pi * 0.001);
    static const uint32_t ways[] = {ES_LAMPS_TRACED, ES_LAMPS_MAPS};
    for (size_t k = 0; k < 2; k++) {
        es_renderer_settings s = settings_of(ways[k]);
        s.lamp_interleave = 4;
        s.filter_passes = 0;
        es_renderer* renderer = renderer_of(&w, &s);
        double worst, mean = mean_seen(&w, renderer, "lamps", &worst, expected);
        if (!(fabs(mean - expected) < 0.02 * expected && worst < 0.15 * expected)) fail_msg("lamps %u: %.5f, at worst %.5f off, expected %.5f", ways[k], mean, worst, expected);
        es_renderer_destroy(renderer);
    }
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_form_factors),
        cmocka_unit_test(test_area_lights),
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_moving_lamp),
        cmocka_unit_test(test_more_lights),
        cmocka_unit_test(test_nothing_glows),
        cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_open_box),
        cmocka_unit_test(test_one_bright_texel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
