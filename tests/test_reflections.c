/* Reflections by maps and by rays: mirrored points where the law of reflection has them, an environment as a chrome ball shows it, evenly bright surroundings, levels of lobes, what is
 * drawn again and when, and that skipping changes nothing. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/micro/lobe_albedo.h"
#include "gi/pixel_rays.h"
#include "gi/reflections/reflection_map.h"
#include "gi/surface.h"
#include "platform/context.h"
#include "platform/random.h"
#include "tests/pictures.h"
#include "tests/races.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

static es_renderer_settings settings_of(uint32_t width, uint32_t height)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = width;
    s.height = height;
    s.reflections = ES_REFLECTIONS_MAPS;
    s.reflection_size = 128;
    s.vpls = 64;
    s.light_size = 64;
    s.shadow_size = 256;
    s.ism_size = 32;
    s.ism_points = 256;
    s.ism_pool = 4096;
    s.interleave = 2;
    s.lamp_count = 32;
    s.lamp_vpls = 16;
    s.lamp_size = 32;
    s.lamp_interleave = 2;
    s.stable_vpls = true;
    return s;
}

static es_material_desc metal(float f0, float roughness)
{
    es_material_desc d = es_default_material_desc();
    for (int c = 0; c < 3; c++) d.base_color[c] = f0;
    d.metallic = 1;
    d.roughness = roughness;
    return d;
}

static es_camera_desc camera_of(float fov_y)
{
    es_camera_desc d = es_default_camera_desc();
    d.fov_y = fov_y;
    d.near_plane = 0.01f;
    return d;
}

static float some(uint32_t i, float low, float high) { return low + (high - low) * es_unit_float(es_random_u32(7, i)); }

/* ---- places -------------------------------------------------------------------------------------------------------------------------- */

/* Where a point is in the picture. */
static void pixel_of(const small_world* w, uint32_t width, uint32_t height, es_vec3 point, double pixel[2])
{
    es_raster_view view;
    assert_int_equal(es_world_camera_view(w->world, w->camera, width, height, &view), ES_OK);
    const es_mat4 clip = es_mat4_mul(view.projection, view.view);
    const es_vec4 p = es_mat4_vec4(&clip, (es_vec4){point.x, point.y, point.z, 1});
    pixel[0] = (0.5 + 0.5 * (double)p.x / (double)p.w) * width - 0.5;
    pixel[1] = (0.5 - 0.5 * (double)p.y / (double)p.w) * height - 0.5;
}

/* The middle of what is red in a picture, by its red. */
static double middle_of_red(const es_image* image, double middle[2])
{
    double sum = 0;
    middle[0] = middle[1] = 0;
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++) {
            const double red = (double)image->pixels[3 * ((size_t)y * image->width + x)];
            sum += red;
            middle[0] += red * x;
            middle[1] += red * y;
        }
    for (int k = 0; k < 2; k++) middle[k] /= sum;
    return sum;
}

/* Colours that say where a point of a room is: 0.1 + 0.2 (x + 2) and so on, unlit. */
static void add_painted_rectangle(small_world* w, es_vec3 corner, es_vec3 u, es_vec3 v)
{
    const es_vec3 p[4] = {corner, es_v3_add(corner, u), es_v3_add(es_v3_add(corner, u), v), es_v3_add(corner, v)};
    float colors[16];
    for (int i = 0; i < 4; i++) {
        const float at[3] = {p[i].x + 2, p[i].y + 2, p[i].z};
        for (int k = 0; k < 3; k++) colors[4 * i + k] = 0.1f + 0.2f * at[k];
        colors[4 * i + 3] = 1;
    }
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    es_material_desc unlit = es_default_material_desc();
    unlit.model = ES_SURFACE_UNLIT;
    add_instance(w, &(es_mesh_desc){.vertex_count = 4, .triangle_count = 2, .positions = &p[0].x, .colors = colors, .indices = indices, .flat_normals = true}, &unlit);
}

/* A mirror that is all of one wall of a room: each pixel of it shows the point of the room that the law of reflection says, within a pixel. */
static void test_plane(void** state)
{
    (void)state;
    enum { WIDTH = 160, HEIGHT = 120 };
    for (uint32_t trial = 0; trial < 16; trial++) {
        const bool traced = trial >= 12;
        small_world w = small_world_create();
        const es_material_desc mirror = metal(1, 0);
        add_rectangle(&w, es_v3(-2, -2, 0), es_v3(4, 0, 0), es_v3(0, 4, 0), &mirror);
        add_painted_rectangle(&w, es_v3(-2, -2, 4), es_v3(0, 4, 0), es_v3(4, 0, 0));
        add_painted_rectangle(&w, es_v3(-2, -2, 0), es_v3(0, 4, 0), es_v3(0, 0, 4));
        add_painted_rectangle(&w, es_v3(2, -2, 0), es_v3(0, 0, 4), es_v3(0, 4, 0));
        add_painted_rectangle(&w, es_v3(-2, -2, 0), es_v3(0, 0, 4), es_v3(4, 0, 0));
        add_painted_rectangle(&w, es_v3(-2, 2, 0), es_v3(4, 0, 0), es_v3(0, 0, 4));
        const es_vec3 eye = es_v3(some(6 * trial, -1.5f, 1.5f), some(6 * trial + 1, -1.5f, 1.5f), some(6 * trial + 2, 0.8f, 3.5f));
        look(&w, camera_of(0.9f), eye, es_v3(some(6 * trial + 3, -1, 1), some(6 * trial + 4, -1, 1), 0));
        es_renderer_settings s = settings_of(WIDTH, HEIGHT);
        s.method = ES_GI_NONE;
        s.lamps = ES_LAMPS_NONE;
        s.reflection_size = 512;
        if (traced) s.reflections = ES_REFLECTIONS_TRACED;
        es_image reflections = picture_of(&w, &s, "reflections");
        double sum = 0;
        uint32_t pixels = 0, beyond = 0;
        for (uint32_t y = 0; y < HEIGHT; y++)
            for (uint32_t x = 0; x < WIDTH; x++) {
                const float* c = reflections.pixels + 3 * ((size_t)y * WIDTH + x);
                if (!(c[0] > 0)) continue;
                const es_vec3 p = es_v3((c[0] - 0.1f) * 5 - 2, (c[1] - 0.1f) * 5 - 2, (c[2] - 0.1f) * 5);
                double at[2];
                pixel_of(&w, WIDTH, HEIGHT, es_v3(p.x, p.y, -p.z), at);
                const double off = fmax(fabs(at[0] - x), fabs(at[1] - y));
                sum += off;
                pixels++;
                beyond += off > 1;
            }
        /* along the room's edges two walls are mixed in a texel */
        if (pixels < 3000 || sum / pixels > (traced ? 0.005 : 0.2) || beyond > (traced ? 0 : pixels / 50)) fail_msg("trial %u: %u pixels are off by %.3f, %u of them by more than one", trial, pixels, pixels ? sum / pixels : 0, beyond);
        es_image_destroy(w.context, &reflections);
        small_world_destroy(&w);
    }
}

/* A square that hangs in a room, seen in a mirror at z = 0 from many places: its image is where its mirror image would be, though the wall behind it is not all in the map. */
static void test_square_in_mirror(void** state)
{
    (void)state;
    enum { WIDTH = 320, HEIGHT = 240, TRIALS = 24 };
    double off = 0;
    for (uint32_t trial = 0; trial < 2 * TRIALS; trial++) {
        const bool traced = trial >= TRIALS;
        small_world w = small_world_create();
        const es_material_desc mirror = metal(1, 0), glowing = lambert(0, 4), wall = lambert(0.5f, 0);
        add_rectangle(&w, es_v3(-1.5f, -1, 0), es_v3(3, 0, 0), es_v3(0, 2, 0), &mirror);
        const es_vec3 at = es_v3(some(100 + 6 * (trial % TRIALS), -1, 1), some(101 + 6 * (trial % TRIALS), -0.7f, 0.7f), some(102 + 6 * (trial % TRIALS), 0.6f, 3.4f));
        add_rectangle(&w, es_v3(at.x + 0.15f, at.y - 0.15f, at.z), es_v3(-0.3f, 0, 0), es_v3(0, 0.3f, 0), &glowing);
        add_rectangle(&w, es_v3(-3, -2, 4), es_v3(0, 4, 0), es_v3(6, 0, 0), &wall);
        const es_vec3 eye = es_v3(some(103 + 6 * (trial % TRIALS), -1, 1), some(104 + 6 * (trial % TRIALS), -0.6f, 0.6f), some(105 + 6 * (trial % TRIALS), 1.5f, 3));
        /* what is mirrored is seen where the line from its image to the eye goes through the mirror */
        const float share = eye.z / (eye.z + at.z);
        look(&w, camera_of(1.0f), eye, es_v3(eye.x + (at.x - eye.x) * share, eye.y + (at.y - eye.y) * share, 0));
        es_renderer_settings s = settings_of(WIDTH, HEIGHT);
        s.method = ES_GI_NONE;
        s.lamps = ES_LAMPS_NONE;
        s.reflection_size = 512;
        if (traced) s.reflections = ES_REFLECTIONS_TRACED;
        es_image reflections = picture_of(&w, &s, "reflections");
        double expected[2], found[2];
        pixel_of(&w, WIDTH, HEIGHT, es_v3(at.x, at.y, -at.z), expected);
        const double red = middle_of_red(&reflections, found), side = 0.3 * HEIGHT / (2 * tan(0.5) * (double)(eye.z + at.z));
        /* a rim is lost where rays enter and leave what the square hides within a step, or won where what it hides is met */
        if (fabs(found[0] - expected[0]) > 2 + 0.1 * side || fabs(found[1] - expected[1]) > 2 + 0.1 * side || fabs(red / (4 * side * side) - 1) > 0.25)
            fail_msg("trial %u: at (%.2f, %.2f), not at (%.2f, %.2f); %.1f of %.1f pixels", trial, found[0], found[1], expected[0], expected[1], red / 4, side * side);
        if (traced && (hypot(found[0] - expected[0], found[1] - expected[1]) > 1 || fabs(red / (4 * side * side) - 1) > 0.25)) fail_msg("traced, trial %u: at (%.3f, %.3f), not at (%.3f, %.3f); %.1f of %.1f pixels", trial, found[0], found[1], expected[0], expected[1], red / 4, side * side);
        if (!traced) off += hypot(found[0] - expected[0], found[1] - expected[1]) / TRIALS;
        es_image_destroy(w.context, &reflections);
        small_world_destroy(&w);
    }
    if (off > 1.5) fail_msg("off by %.2f pixels in the mean", off);
}

/* A chrome ball in the midst of a smooth environment, which is infinitely far away: each pixel shows the image in the mirrored direction. */
static void test_ball_under_environment(void** state)
{
    (void)state;
    enum { SIZE = 160, COLUMNS = 512, ROWS = 256 };
    small_world w = small_world_create();
    es_image image;
    assert_int_equal(es_image_create(w.context, COLUMNS, ROWS, 3, &image), ES_OK);
    for (uint32_t y = 0; y < ROWS; y++)
        for (uint32_t x = 0; x < COLUMNS; x++) {
            const float theta = ES_PI * ((float)y + 0.5f) / ROWS, phi = 2 * ES_PI * ((float)x + 0.5f) / COLUMNS;
            const float d[3] = {es_sin(theta) * es_sin(phi - ES_PI), es_cos(theta), -es_sin(theta) * es_cos(phi - ES_PI)};
            for (uint32_t k = 0; k < 3; k++) image.pixels[3 * ((size_t)y * COLUMNS + x) + k] = 1.0f + 0.8f * d[k];
        }
    const es_environment_desc sky = {.image = &image, .radiance = {1, 1, 1}};
    assert_int_equal(es_world_set_environment(w.world, &sky), ES_OK);
    const es_material_desc chrome = metal(1, 0);
    add_sphere(&w, es_v3(0, 0, 0), 1, 64, false, &chrome);
    look(&w, camera_of(0.8f), es_v3(0.3f, 0.7f, 3), es_v3(0, 0, 0));
    es_renderer_settings s = settings_of(SIZE, SIZE);
    s.method = ES_GI_NONE;
    s.lamps = ES_LAMPS_NONE;
    es_renderer* renderer = renderer_of(w.context, &s);
    render(renderer, w.world);
    es_image reflections = picture(renderer, "reflections"), normal = picture(renderer, "normal"), radiance = picture(renderer, "radiance");
    es_raster_view view;
    assert_int_equal(es_world_camera_view(w.world, w.camera, SIZE, SIZE, &view), ES_OK);
    uint32_t seen = 0;
    double worst = 0;
    for (uint32_t y = 0; y < SIZE; y++)
        for (uint32_t x = 0; x < SIZE; x++) {
            const size_t i = 3 * ((size_t)y * SIZE + x);
            const es_vec3 n = es_v3(normal.pixels[i], normal.pixels[i + 1], normal.pixels[i + 2]);
            if (!(es_v3_dot(n, n) > 0.0f)) continue;
            const es_vec3 on_plane = pixel_on_plane(&w, SIZE, SIZE, x, y, es_v3(0, 0, 1), es_v3(0, 0, 1)), d = es_v3_normalize(es_v3_sub(on_plane, es_v3(0.3f, 0.7f, 3)), es_v3(0, 0, -1));
            const float cosine = -es_v3_dot(n, d);
            if (cosine < 0.1f) continue;
            const es_vec3 r = es_v3_add(d, es_v3_scale(n, 2 * cosine));
            const float expected[3] = {1.0f + 0.8f * r.x, 1.0f + 0.8f * r.y, 1.0f + 0.8f * r.z};
            seen++;
            for (size_t k = 0; k < 3; k++) {
                worst = fmax(worst, fabs((double)(reflections.pixels[i + k] - expected[k])));
                /* nothing else lights it */
                assert_true(radiance.pixels[i + k] == reflections.pixels[i + k]);
            }
        }
    assert_true(seen > 3000);
    if (worst > 0.03) fail_msg("off by %g", worst); /* a texel of the image spans 0.012 */
    es_image_destroy(w.context, &reflections);
    es_image_destroy(w.context, &normal);
    es_image_destroy(w.context, &radiance);
    es_renderer_destroy(renderer);
    assert_int_equal(es_world_set_environment(w.world, NULL), ES_OK);
    es_image_destroy(w.context, &image);
    small_world_destroy(&w);
}

/* Surroundings of radiance 1 everywhere: what is reflected is the lobe's directional albedo, F0 seen straight on, whatever the roughness; and it comes in place of what the
 * environment's lights show in the lobe, not besides. */
static void test_furnace(void** state)
{
    (void)state;
    enum { SIZE = 64 };
    static const float roughness[] = {0, 0, 0.1f, 0.1f, 0.3f, 0.3f, 0.6f, 0.6f, 1, 1}; /* by maps, by rays */
    for (size_t i = 0; i < sizeof roughness / sizeof roughness[0]; i++) {
        small_world w = small_world_create();
        const es_environment_desc sky = {.radiance = {1, 1, 1}};
        assert_int_equal(es_world_set_environment(w.world, &sky), ES_OK);
        const es_material_desc m = metal(0.7f, roughness[i]);
        add_sphere(&w, es_v3(0, 0, 0), 1, 24, false, &m);
        look(&w, camera_of(0.8f), es_v3(0, 0, 3), es_v3(0, 0, 0));
        es_renderer_settings s = settings_of(SIZE, SIZE);
        s.reflection_roughness = 1;
        if (i & 1) s.reflections = ES_REFLECTIONS_TRACED;
        es_renderer* renderer = renderer_of(w.context, &s);
        render(renderer, w.world);
        es_image reflections = picture(renderer, "reflections"), radiance = picture(renderer, "radiance"), normal = picture(renderer, "normal");
        es_lobe_albedo* table = calloc(1, sizeof *table);
        *table = es_lobe_albedos;
        for (uint32_t y = 0; y < SIZE; y++)
            for (uint32_t x = 0; x < SIZE; x++) {
                const size_t at = 3 * ((size_t)y * SIZE + x);
                const es_vec3 n = es_v3(normal.pixels[at], normal.pixels[at + 1], normal.pixels[at + 2]);
                if (!(es_v3_dot(n, n) > 0.0f)) continue;
                const es_vec3 on_plane = pixel_on_plane(&w, SIZE, SIZE, x, y, es_v3(0, 0, 1), es_v3(0, 0, 1)), d = es_v3_normalize(es_v3_sub(on_plane, es_v3(0, 0, 3)), es_v3(0, 0, -1));
                const float cosine = es_maxf(-es_v3_dot(n, d), 1e-3f);
                const es_surface surface = es_surface_of(ES_SURFACE_METALLIC_ROUGHNESS, es_v3(0.7f, 0.7f, 0.7f), 1, es_floor(roughness[i] * 255 + 0.5f) / 255, 1);
                /* rays along the facets meet their neighbours */
                const bool traced = s.reflections == ES_REFLECTIONS_TRACED;
                if (!traced || cosine > 0.6f) assert_float_equal(reflections.pixels[at], es_lobe_albedo_at(table, &surface, cosine).x, traced ? 0.03f : 0.003f);
                /* a metal: nothing but the lobe */
                assert_true(radiance.pixels[at] == reflections.pixels[at]);
            }
        free(table);
        es_image_destroy(w.context, &reflections);
        es_image_destroy(w.context, &radiance);
        es_image_destroy(w.context, &normal);
        es_renderer_destroy(renderer);
        small_world_destroy(&w);
    }
}

/* ---- levels ------------------------------------------------------------------------------------------------------------------------------ */

typedef struct one_map { es_reflection_atlas atlas; float* texels; float centre[3], last_level; } one_map;

static void open_map(one_map* m, uint32_t size)
{
    *m = (one_map){.last_level = ES_REFLECTION_LEVELS - 1};
    m->atlas.layout = es_reflection_layout_of(size);
    m->texels = calloc((size_t)m->atlas.layout.texels * 4, sizeof(float));
    m->atlas.texels = m->texels;
    for (int k = 0; k < 3; k++) m->atlas.centre[k] = &m->centre[k];
    m->atlas.last_level = &m->last_level;
}

static void ask(const es_context* context, const one_map* m, es_vec3 position, es_vec3 direction, float alpha, float radiance[3], float met[3])
{
    int32_t map[8];
    float in[7][8], out[6][8];
    const float values[7] = {position.x, position.y, position.z, direction.x, direction.y, direction.z, alpha};
    for (int i = 0; i < 8; i++) {
        map[i] = 0;
        for (int k = 0; k < 7; k++) in[k][i] = values[k];
    }
    const es_reflection_question q = {.map = map, .position = {in[0], in[1], in[2]}, .direction = {in[3], in[4], in[5]}, .alpha = in[6], .radiance = {out[0], out[1], out[2]}, .met = {out[3], out[4], out[5]}, .count = 8};
    es_reflection_ask(context, &m->atlas, &q);
    for (int k = 0; k < 3; k++) {
        radiance[k] = out[k][0];
        if (met) met[k] = out[3 + k][0];
    }
}

static es_vec3 random_direction(uint32_t seed)
{
    const float z = 1 - 2 * es_unit_float(es_random_u32(11, 2 * seed)), phi = 2 * ES_PI * es_unit_float(es_random_u32(11, 2 * seed + 1)), r = es_sqrt(es_maxf(1 - z * z, 0));
    return es_v3(r * es_cos(phi), r * es_sin(phi), z);
}

/* Every level of evenly bright surroundings is as bright. A bright patch keeps its power in every level, roughly: means are not weighted by solid angle. */
static void test_levels(void** state)
{
    (void)state;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    for (uint32_t size = 16; size <= 256; size *= 4) {
        one_map m;
        open_map(&m, size);
        const size_t stride = size + 2;
        for (int turn = 0; turn < 2; turn++) {
            double power = 0;
            for (size_t f = 0; f < 6; f++)
                for (uint32_t y = 0; y < size; y++)
                    for (uint32_t x = 0; x < size; x++) {
                        float* t = m.texels + 4 * ((f * stride + y + 1) * stride + x + 1);
                        const double u = (2 * x + 1.0) / size - 1, v = (2 * y + 1.0) / size - 1, solid_angle = 4.0 / ((double)size * size) / pow(1 + u * u + v * v, 1.5);
                        const bool bright = turn == 0 || (f == 4 && u * u + v * v < 0.1);
                        t[0] = t[1] = t[2] = bright ? turn ? 10.0f : 1.0f : 0.0f;
                        t[3] = 0;
                        power += (double)t[0] * solid_angle;
                    }
            assert_int_equal(es_reflection_map_finish(context, &m.atlas.layout, m.texels, ES_REFLECTION_LEVELS - 1), ES_OK);
            for (int level = 0; level < ES_REFLECTION_LEVELS; level++) {
                const float alpha = level ? 1.0f / 64 * (float)(1 << (level - 1)) : 0;
                enum { DIRECTIONS = 20000 };
                double sum = 0;
                for (uint32_t i = 0; i < DIRECTIONS; i++) {
                    float seen[3];
                    const float z = 1 - (2 * (float)i + 1) / DIRECTIONS, r = es_sqrt(1 - z * z), turns = (float)i * 0.61803399f, phi = 2 * ES_PI * (turns - es_floor(turns));
                    ask(context, &m, es_v3(0, 0, 0), es_v3(r * es_cos(phi), r * es_sin(phi), z), alpha, seen, NULL);
                    if (!turn) assert_float_equal(seen[0], 1, 2e-6);
                    sum += (double)seen[0];
                }
                const double found = sum / DIRECTIONS * 4 * 3.14159265358979;
                if (turn && fabs(found / power - 1) > (level < 2 ? 0.12 : 0.2)) fail_msg("faces of %u, level %d: %g W instead of %g", size, level, found, power);
            }
        }
        free(m.texels);
    }
    es_context_destroy(context);
}

/* Over the cube's edges and corners nothing jumps: two directions a millionth apart show the same, at every level, on random texels. */
static void test_seams(void** state)
{
    (void)state;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    one_map m;
    open_map(&m, 32);
    const uint32_t size = m.atlas.layout.size;
    const size_t stride = size + 2;
    for (size_t f = 0; f < 6; f++)
        for (uint32_t y = 0; y < size; y++)
            for (uint32_t x = 0; x < size; x++) {
                float* t = m.texels + 4 * ((f * stride + y + 1) * stride + x + 1);
                for (uint32_t k = 0; k < 3; k++) t[k] = es_unit_float(es_random_u32(5, (uint32_t)(t - m.texels) + k));
            }
    assert_int_equal(es_reflection_map_finish(context, &m.atlas.layout, m.texels, ES_REFLECTION_LEVELS - 1), ES_OK);
    for (int level = 0; level < ES_REFLECTION_LEVELS; level++) {
        const float alpha = level ? 1.0f / 64 * (float)(1 << (level - 1)) : 0;
        for (uint32_t i = 0; i < 4000; i++) {
            float d[3], side[2][3];
            const uint32_t a = i % 3, b = (a + 1) % 3, c = (a + 2) % 3;
            d[c] = i % 50 == 0 ? 1.0f : 2 * es_unit_float(es_random_u32(6, i)) - 1;
            for (int k = 0; k < 2; k++) {
                d[a] = (i & 4 ? 1.0f : -1.0f) * (k ? 1.0f : 1 - 2e-6f);
                d[b] = (i & 8 ? 1.0f : -1.0f) * (k ? 1 - 2e-6f : 1.0f);
                ask(context, &m, es_v3(0, 0, 0), es_v3_normalize(es_v3(d[0], d[1], d[2]), es_v3(1, 0, 0)), alpha, side[k], NULL);
            }
            for (int k = 0; k < 3; k++) assert_float_equal(side[0][k], side[1][k], 2e-4f);
        }
    }
    free(m.texels);
    es_context_destroy(context);
}

/* In a box the point that a ray meets is found from anywhere in it. */
static void test_rays_in_a_box(void** state)
{
    (void)state;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    one_map m;
    open_map(&m, 64);
    const float half[3] = {2, 1.5f, 3};
    m.centre[0] = 0.4f, m.centre[1] = -0.3f, m.centre[2] = 0.9f;
    es_raster_view views[6];
    es_cube_views(64, es_v3(0, 0, 0), 0.01f, views);
    for (size_t f = 0; f < 6; f++) {
        const es_pixel_rays rays = es_pixel_rays_of_view(&views[f]);
        for (uint32_t y = 0; y < 64; y++)
            for (uint32_t x = 0; x < 64; x++) {
                const es_vec3 d = es_pixel_rays_direction(&rays, (float)x, (float)y);
                const float v[3] = {d.x, d.y, d.z};
                float t = 3e38f;
                for (int k = 0; k < 3; k++)
                    if (v[k] != 0.0f) t = es_minf(t, ((v[k] > 0 ? half[k] : -half[k]) - m.centre[k]) / v[k]);
                m.texels[4 * ((f * 66 + y + 1) * 66 + x + 1) + 3] = 1.0f / t; /* depth along the axis: d's component along it is 1 */
            }
    }
    assert_int_equal(es_reflection_map_finish(context, &m.atlas.layout, m.texels, 0), ES_OK);
    double sum = 0, worst = 0;
    enum { RAYS = 4000 };
    for (uint32_t i = 0; i < RAYS; i++) {
        float p[3];
        for (uint32_t k = 0; k < 3; k++) p[k] = half[k] * 0.95f * (2 * es_unit_float(es_random_u32(21, 3 * i + k)) - 1);
        const es_vec3 d = random_direction(i + 77);
        const float v[3] = {d.x, d.y, d.z};
        float t = 3e38f, radiance[3], met[3];
        for (int k = 0; k < 3; k++)
            if (v[k] != 0.0f) t = es_minf(t, ((v[k] > 0 ? half[k] : -half[k]) - p[k]) / v[k]);
        ask(context, &m, es_v3(p[0], p[1], p[2]), d, 0, radiance, met);
        double error = 0;
        for (int k = 0; k < 3; k++) error += pow((double)(met[k] + m.centre[k] - (p[k] + t * v[k])), 2);
        error = sqrt(error);
        sum += error;
        worst = fmax(worst, error);
    }
    if (sum / RAYS > 0.004 || worst > 0.4) fail_msg("rays miss by %g m, %g at the most", sum / RAYS, worst); /* a texel is 0.06 m wide; edges of the box are rounded by about that */
    free(m.texels);
    es_context_destroy(context);
}

/* ---- a room with reflecting things --------------------------------------------------------------------------------------------------------- */

typedef struct room { small_world w; es_node ball, lamp, matt, eye; es_light light; es_material chrome; } room;

static es_node add_ball(small_world* w, es_vec3 at, float radius, es_material material)
{
    es_node_desc node_desc = {.transform = {at, {0, 0, 0, 1}, {1, 1, 1}}};
    es_node node;
    assert_int_equal(es_world_add_node(w->world, &node_desc, &node), ES_OK);
    enum { N = 12 };
    float positions[(2 * N + 1) * (N + 1) * 3];
    uint32_t indices[2 * N * N * 6], vertices = 0, count = 0;
    for (uint32_t v = 0; v <= N; v++)
        for (uint32_t u = 0; u <= 2 * N; u++, vertices++) {
            const float a = 2 * ES_PI * (float)(u % (2 * N)) / (2 * N), b = ES_PI * (float)v / N;
            positions[3 * vertices] = radius * (v == N ? 0 : es_sin(b) * es_cos(a));
            positions[3 * vertices + 1] = radius * es_cos(b);
            positions[3 * vertices + 2] = radius * (v == N ? 0 : -es_sin(b) * es_sin(a));
        }
    for (uint32_t v = 0; v < N; v++)
        for (uint32_t u = 0; u < 2 * N; u++) {
            const uint32_t a = v * (2 * N + 1) + u, b = a + 2 * N + 1, quad[6] = {a, b, b + 1, a, b + 1, a + 1};
            memcpy(indices + count, quad, sizeof quad);
            count += 6;
        }
    es_mesh mesh;
    es_instance instance;
    assert_int_equal(es_world_add_mesh(w->world, &(es_mesh_desc){.vertex_count = vertices, .triangle_count = count / 3, .positions = positions, .indices = indices}, &mesh), ES_OK);
    assert_int_equal(es_world_add_instance(w->world, &(es_instance_desc){.node = node, .mesh = mesh, .material = material}, &instance), ES_OK);
    return node;
}

static es_material add_material(small_world* w, const es_material_desc* desc)
{
    es_material material;
    assert_int_equal(es_world_add_material(w->world, "", desc, &material), ES_OK);
    return material;
}

/* A closed box, a chrome ball, a glossy one, a matt one, a lamp of each kind. */
static room make_room_in(es_context* context)
{
    room r = {0};
    r.w.context = context;
    assert_int_equal(es_world_create(context, NULL, &r.w.world), ES_OK);
    const es_material_desc wall = lambert(0.6f, 0), glow = lambert(0, 3), chrome = metal(0.9f, 0), gloss = metal(0.8f, 0.2f), red = {.base_color = {0.7f, 0.1f, 0.1f, 1}, .roughness = 1, .normal_scale = 1};
    add_closed_box(&r.w, &wall);
    add_rectangle(&r.w, es_v3(-0.3f, 0.98f, -0.3f), es_v3(0.6f, 0, 0), es_v3(0, 0, 0.6f), &glow);
    r.chrome = add_material(&r.w, &chrome);
    r.ball = add_ball(&r.w, es_v3(-0.45f, -0.3f, -0.2f), 0.3f, r.chrome);
    add_ball(&r.w, es_v3(0.4f, -0.4f, 0), 0.28f, add_material(&r.w, &gloss));
    r.matt = add_ball(&r.w, es_v3(0, -0.7f, 0.4f), 0.15f, add_material(&r.w, &red));
    es_light_desc spot = es_default_light_desc();
    spot.intensity = 8;
    r.lamp = node_towards(&r.w, es_v3(0.5f, 0.8f, 0.6f), es_v3(-0.4f, -1, -0.5f));
    spot.node = r.lamp;
    assert_int_equal(es_world_add_light(r.w.world, &spot, &r.light), ES_OK);
    look(&r.w, camera_of(1.0f), es_v3(0.1f, 0.1f, 0.9f), es_v3(0, -0.3f, -0.2f));
    es_camera_desc camera;
    assert_int_equal(es_world_get_camera(r.w.world, r.w.camera, &camera), ES_OK);
    r.eye = camera.node;
    return r;
}

static room make_room(void)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return make_room_in(context);
}

static void move_node(es_world* world, es_node node, es_vec3 by)
{
    es_transform t;
    assert_int_equal(es_world_get_node_transform(world, node, &t), ES_OK);
    t.translation = es_v3_add(t.translation, by);
    assert_int_equal(es_world_set_node_transform(world, node, &t), ES_OK);
}

static void turn_node(es_world* world, es_node node, float angle)
{
    es_transform t;
    assert_int_equal(es_world_get_node_transform(world, node, &t), ES_OK);
    t.rotation = es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), angle), t.rotation);
    assert_int_equal(es_world_set_node_transform(world, node, &t), ES_OK);
}

static void step(es_world* world) { assert_int_equal(es_world_step(world, 0), ES_OK); }

/* Maps are drawn when what they see, their place, or light has changed, and not otherwise. */
static void test_drawn_when(void** state)
{
    (void)state;
    room r = make_room();
    es_world* world = r.w.world;
    es_renderer_settings s = settings_of(96, 72);
    s.method = ES_GI_NONE; /* of what moves, direct light's maps are the room's, whose shadows are drawn again */
    s.lamps = ES_LAMPS_NONE;
    s.reflection_size = 32;
    es_renderer* renderer = renderer_of(r.w.context, &s);
    render(renderer, world);
    assert_null(pass_of(renderer, "reflection maps")->skipped);
    assert_int_equal(pass_of(renderer, "reflection maps")->count, 2);
    step(world);
    render(renderer, world);
    assert_non_null(pass_of(renderer, "reflection maps")->skipped);
    assert_non_null(pass_of(renderer, "reflections")->skipped);
    /* the eye: other directions, the same maps */
    move_node(world, r.eye, es_v3(0.02f, 0, 0));
    step(world);
    render(renderer, world);
    assert_non_null(pass_of(renderer, "reflection maps")->skipped);
    assert_null(pass_of(renderer, "reflections")->skipped);
    /* what both see */
    move_node(world, r.matt, es_v3(0.05f, 0, 0));
    step(world);
    render(renderer, world);
    assert_int_equal(pass_of(renderer, "reflection maps")->count, 2);
    /* light */
    es_light_desc light;
    assert_int_equal(es_world_get_light(world, r.light, &light), ES_OK);
    light.intensity *= 2;
    assert_int_equal(es_world_set_light(world, r.light, &light), ES_OK);
    step(world);
    render(renderer, world);
    assert_int_equal(pass_of(renderer, "reflection maps")->count, 2);
    /* the thing itself: it has moved, and the other sees it */
    move_node(world, r.ball, es_v3(0, 0.1f, 0));
    step(world);
    render(renderer, world);
    assert_int_equal(pass_of(renderer, "reflection maps")->count, 2);
    /* the display */
    s.exposure = 1;
    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
    render(renderer, world);
    assert_non_null(pass_of(renderer, "reflection maps")->skipped);
    assert_non_null(pass_of(renderer, "reflections")->skipped);
    /* a rougher limit leaves the glossy one to lights */
    s.reflection_roughness = 0.1f;
    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
    render(renderer, world);
    assert_int_equal(pass_of(renderer, "reflection maps")->count, 1);
    s.reflections = ES_REFLECTIONS_NONE;
    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
    render(renderer, world);
    assert_non_null(pass_of(renderer, "reflections")->skipped);
    es_image none = picture(renderer, "reflections");
    for (size_t i = 0; i < (size_t)none.width * none.height * 3; i++) assert_true(none.pixels[i] == 0.0f);
    es_image_destroy(r.w.context, &none);
    es_renderer_destroy(renderer);
    small_world_destroy(&r.w);
}

static void change_something(room* r, es_renderer_settings* s, uint32_t what)
{
    es_world* world = r->w.world;
    const float a = es_unit_float(es_random_u32(3, what)) - 0.5f;
    switch (es_random_u32(4, what) % 12) {
    case 0: move_node(world, r->eye, es_v3(0.1f * a, 0.05f * a, 0)); break;
    case 1: move_node(world, r->matt, es_v3(0.2f * a, 0, 0.1f * a)); break;
    case 2: move_node(world, r->ball, es_v3(0.1f * a, 0.1f * a, 0)); break;
    case 3: turn_node(world, r->ball, a); break;
    case 4: turn_node(world, r->lamp, 0.3f * a); break;
    case 5: s->exposure = a; break;
    case 6: s->reflection_roughness = a > 0 ? 0.3f : 0.1f; break;
    case 7: s->reflection_maps = a > 0 ? 1 : 8; break;
    case 8: s->reflection_size = a > 0 ? 32 : 64; break;
    case 9: s->reflections = a > 0 ? ES_REFLECTIONS_MAPS : a > -0.35f ? ES_REFLECTIONS_TRACED : ES_REFLECTIONS_NONE; break;
    case 10: {
        es_material_desc m = metal(0.7f + 0.4f * a, a > 0 ? 0 : 0.15f);
        assert_int_equal(es_world_set_material(world, r->chrome, &m), ES_OK);
        break;
    }
    default: break;
    }
    if (es_random_u32(8, what) % 4) step(world);
}

/* Whatever changes from frame to frame, what a renderer shows that skips what it can is what one shows that skips nothing. */
static void test_skipping_changes_nothing(void** state)
{
    (void)state;
    static const uint32_t methods[] = {ES_GI_ISM, ES_GI_NONE, ES_GI_SECOND_ORDER, ES_GI_ISM, ES_GI_MICRO};
    for (uint32_t trial = 0; trial < 5; trial++) {
        room r = make_room();
        es_renderer_settings s = settings_of(61, 45);
        s.method = methods[trial];
        s.reflection_size = 32;
        s.temporal = trial == 0;
        s.second_lights = 20;
        s.second_negative = 10;
        s.micro_points = 1024;
        s.micro_size = 8;
        if (trial > 2) s.reflections = ES_REFLECTIONS_TRACED;
        es_renderer *skips = renderer_of(r.w.context, &s), *draws = renderer_of(r.w.context, &s);
        for (uint32_t frame = 0; frame < 24; frame++) {
            if (frame) change_something(&r, &s, 100 * trial + frame);
            s.skip = true;
            assert_int_equal(es_renderer_configure(skips, &s), ES_OK);
            s.skip = false;
            assert_int_equal(es_renderer_configure(draws, &s), ES_OK);
            render(skips, r.w.world);
            render(draws, r.w.world);
            static const char* const names[] = {"reflections", "radiance", "display"};
            for (int n = 0; n < 3; n++) {
                es_image a = picture(skips, names[n]), b = picture(draws, names[n]);
                if (memcmp(a.pixels, b.pixels, (size_t)a.width * a.height * 3 * sizeof(float))) fail_msg("method %u, frame %u: %s differs", methods[trial], frame, names[n]);
                es_image_destroy(r.w.context, &a);
                es_image_destroy(r.w.context, &b);
            }
        }
        es_renderer_destroy(skips);
        es_renderer_destroy(draws);
        small_world_destroy(&r.w);
    }
}

/* A skinned animal comes to rest with other bounds than it moved with, and then its surroundings are seen from another middle. */
static void test_deformed(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_world_destroy(w.world);
    es_world_settings settings = es_default_world_settings();
    settings.triangles = 5000;
    assert_int_equal(es_world_create_scene(w.context, "creature", &settings, &w.world), ES_OK);
    es_renderer_settings s = settings_of(32, 61);
    s.method = ES_GI_NONE;
    s.lamps = ES_LAMPS_NONE;
    s.reflection_size = 32;
    s.reflection_roughness = 1;
    s.reflection_maps = 1;
    es_renderer* skips = renderer_of(w.context, &s);
    s.skip = false;
    es_renderer* draws = renderer_of(w.context, &s);
    for (int frame = 0; frame < 4; frame++) {
        assert_int_equal(es_world_step(w.world, frame == 1 ? 1.0f / 30 : 0), ES_OK);
        render(skips, w.world);
        render(draws, w.world);
        es_image a = picture(skips, "reflections"), b = picture(draws, "reflections");
        if (memcmp(a.pixels, b.pixels, (size_t)a.width * a.height * 3 * sizeof(float))) fail_msg("frame %d differs", frame);
        es_image_destroy(w.context, &a);
        es_image_destroy(w.context, &b);
    }
    es_renderer_destroy(skips);
    es_renderer_destroy(draws);
    small_world_destroy(&w);
}

static void test_same_bits(void** state)
{
    (void)state;
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        room r = make_room_in(context);
        es_renderer_settings s = settings_of(61, 45);
        s.reflection_size = 32;
        for (s.reflections = ES_REFLECTIONS_MAPS; s.reflections <= ES_REFLECTIONS_TRACED; s.reflections++) {
            es_image image = picture_of(&r.w, &s, "radiance");
            expect_same_bits(&same, image.pixels, (size_t)image.width * image.height * 3 * sizeof(float));
            es_image_destroy(context, &image);
        }
        es_world_destroy(r.w.world);
        es_context_destroy(context);
    }
}

/* Two mirrors that face each other show each other once: in the first the second's picture of what is between them, red, beside the thing's own. */
static void test_second_reflections(void** state)
{
    (void)state;
    small_world w = small_world_create();
    const es_material_desc mirror = metal(1, 0), wall = lambert(0, 0.1f);
    es_material_desc glowing = lambert(0, 0);
    glowing.emission[0] = 5;
    add_rectangle(&w, es_v3(-1, -1, 0), es_v3(2, 0, 0), es_v3(0, 2, 0), &mirror);
    add_rectangle(&w, es_v3(1, -1, 4), es_v3(-2, 0, 0), es_v3(0, 2, 0), &mirror);
    /* faces the second mirror alone */
    add_rectangle(&w, es_v3(-0.25f, -0.25f, 1), es_v3(0.5f, 0, 0), es_v3(0, 0.5f, 0), &glowing);
    add_rectangle(&w, es_v3(-8, -8, 9), es_v3(0, 16, 0), es_v3(16, 0, 0), &wall);
    add_rectangle(&w, es_v3(-8, -8, -5), es_v3(16, 0, 0), es_v3(0, 16, 0), &wall);
    look(&w, camera_of(1.2f), es_v3(0.6f, 0.1f, 2.5f), es_v3(0, 0, 0));
    es_renderer_settings s = settings_of(160, 120);
    s.method = ES_GI_NONE;
    s.lamps = ES_LAMPS_NONE;
    s.reflection_size = 256;
    es_image reflections = picture_of(&w, &s, "reflections");
    /* the thing's back is not seen; what the second mirror shows of it to the first one's middle is at the second's middle, whose image in the first is at z = -4 */
    double expected[2];
    pixel_of(&w, 160, 120, es_v3(0, 0, -4), expected);
    const uint32_t x = (uint32_t)(expected[0] + 0.5), y = (uint32_t)(expected[1] + 0.5);
    const float* seen = reflections.pixels + 3 * ((size_t)y * 160 + x);
    assert_true(seen[0] > 4 && seen[1] < 0.5f);
    es_image_destroy(w.context, &reflections);
    /* rays show where it is */
    s.reflections = ES_REFLECTIONS_TRACED;
    reflections = picture_of(&w, &s, "reflections");
    pixel_of(&w, 160, 120, es_v3(0, 0, -7), expected);
    seen = reflections.pixels + 3 * ((size_t)(expected[1] + 0.5) * 160 + (size_t)(expected[0] + 0.5));
    assert_true(seen[0] > 4 && seen[1] < 0.5f);
    es_image_destroy(w.context, &reflections);
    small_world_destroy(&w);
}

/* ---- at the ends ----------------------------------------------------------------------------------------------------------------------------- */

static void expect_finite(small_world* w, es_renderer* renderer)
{
    render(renderer, w->world);
    es_image image = picture(renderer, "radiance");
    for (size_t i = 0; i < (size_t)image.width * image.height * 3; i++) assert_true(isfinite(image.pixels[i]) && image.pixels[i] >= 0.0f);
    es_image_destroy(w->context, &image);
}

static void test_ends(void** state)
{
    (void)state;
    /* nothing; one pixel; the eye inside of what reflects; things without a size, of one point, far away and very large; the camera's own place */
    for (int trial = 0; trial < 7; trial++) {
        small_world w = small_world_create();
        const es_material_desc chrome = metal(0.9f, trial & 1 ? 0.0f : 0.25f), wall = lambert(0.5f, 0.2f);
        const es_environment_desc sky = {.radiance = {0.3f, 0.4f, 0.6f}};
        if (trial & 2) assert_int_equal(es_world_set_environment(w.world, &sky), ES_OK);
        if (trial == 1 || trial == 2) add_sphere(&w, es_v3(0, 0, 0), 1, 12, trial == 2, &chrome);
        if (trial == 3) add_rectangle(&w, es_v3(0, 0, -2), es_v3(1, 0, 0), es_v3(2, 0, 0), &chrome);
        if (trial == 4) add_rectangle(&w, es_v3(0, 0, -2), es_v3(0, 0, 0), es_v3(0, 0, 0), &chrome);
        if (trial == 5) add_sphere(&w, es_v3(0, 0, -3e6f), 1e6f, 12, false, &chrome);
        if (trial == 6) {
            add_closed_box(&w, &wall);
            add_sphere(&w, es_v3(0, 0, 0), 1e-4f, 12, false, &chrome);
        }
        look(&w, camera_of(1.0f), trial == 1 ? es_v3(0, 0, 3) : es_v3(0, 0, 0), es_v3(0, 0, -1));
        for (uint32_t turn = 0; turn < 4; turn++) {
            const uint32_t size = turn & 1 ? 40 : 1;
            es_renderer_settings s = settings_of(size, size);
            s.reflection_size = 16;
            if (turn & 2) s.reflections = ES_REFLECTIONS_TRACED;
            es_renderer* renderer = renderer_of(w.context, &s);
            expect_finite(&w, renderer);
            expect_finite(&w, renderer);
            es_renderer_destroy(renderer);
        }
        small_world_destroy(&w);
    }
}

typedef struct scarce { int64_t left; } scarce; /* allocations until one fails; below 0: none does */

static void* allocate_scarce(void* user, size_t size, size_t alignment)
{
    scarce* s = user;
    if (s->left >= 0 && s->left-- == 0) return NULL;
    return aligned_alloc(64, (size + 63) / 64 * 64);
}
static void release_scarce(void* user, void* pointer, size_t size)
{
    (void)user, (void)size;
    free(pointer);
}

static void drop_message(void* user, es_log_level level, es_result item, const char* message) { (void)user, (void)level, (void)item, (void)message; }

/* Whichever allocation of the first frame by rays fails, the next one has the picture that it would have had. */
static void test_memory(void** state)
{
    (void)state;
    uint64_t whole = 0;
    bool failed = true;
    for (int64_t n = -1; failed; n++) {
        scarce memory = {-1};
        es_context_desc desc = es_default_context_desc();
        desc.allocator = (es_allocator){allocate_scarce, release_scarce, &memory};
        desc.logger.log = drop_message;
        desc.threads = 1;
        es_context* context;
        assert_int_equal(es_context_create(&desc, &context), ES_OK);
        room r = make_room_in(context);
        es_renderer_settings s = settings_of(24, 20);
        s.reflection_size = 16;
        s.method = ES_GI_NONE;
        es_renderer* renderer = renderer_of(context, &s);
        render(renderer, r.w.world);
        s.reflections = ES_REFLECTIONS_TRACED;
        assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
        memory.left = n;
        failed = es_renderer_render(renderer, r.w.world) != ES_OK || n < 0;
        memory.left = -1;
        render(renderer, r.w.world);
        es_image image = picture(renderer, "radiance");
        if (n < 0) whole = es_image_hash(&image);
        else if (es_image_hash(&image) != whole) fail_msg("another picture after allocation %d failed", (int)n);
        es_image_destroy(context, &image);
        es_renderer_destroy(renderer);
        small_world_destroy(&r.w);
    }
}

static void test_settings(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_renderer_settings s = settings_of(8, 8);
    es_renderer* renderer;
    s.reflection_size = 100;
    assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_SETTING_VALUE);
    s.reflection_size = 64;
    s.reflection_roughness = NAN;
    assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_SETTING_VALUE);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_plane),
        unit_test_without_races(test_square_in_mirror),
        unit_test_without_races(test_ball_under_environment),
        unit_test_without_races(test_furnace),
        cmocka_unit_test(test_levels),
        unit_test_without_races(test_seams),
        unit_test_without_races(test_rays_in_a_box),
        cmocka_unit_test(test_drawn_when),
        unit_test_without_races(test_skipping_changes_nothing),
        unit_test_without_races(test_deformed),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_second_reflections),
        unit_test_without_races(test_ends),
        unit_test_without_races(test_memory),
        cmocka_unit_test(test_settings),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
