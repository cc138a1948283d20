/* Virtual point lights with visibility by rays: against sums over all pairs, against maps where nothing hides, and, with their bias
 * compensated, against the path tracer. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/renderer.h"
#include "tests/small_worlds.h"
#include "tests/statistics.h"
#include "tests/races.h"

enum { WIDTH = 24, HEIGHT = 18, PIXELS = WIDTH * HEIGHT };

typedef enum surfaces { DIFFUSE, GLOSSY } surfaces;

static const es_vec3 plate_corner = {-0.8f, 0.9f, 0.6f}, plate_u = {1.4f, 0, 0}, plate_v = {0, 0.3f, -1.2f};

static void say_nothing(void* user, es_log_level level, es_result item, const char* message) {}

#define EXTENT2 41.0f /* m², of the world below */

/* A floor and two walls lit by a spot; with `plates` one that both sides of are seen and one that the lamp sees the back of. */
static small_world corner(surfaces kind, bool plates, uint32_t threads, uint32_t isa_mask, size_t memory_cap)
{
    small_world w = {0};
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    if (isa_mask) desc.isa_mask = isa_mask;
    desc.memory_cap = memory_cap;
    if (memory_cap) desc.logger.log = say_nothing;
    assert_int_equal(es_context_create(&desc, &w.context), ES_OK);
    assert_int_equal(es_world_create(w.context, NULL, &w.world), ES_OK);
    es_material_desc grey = lambert(0.7f, 0), red = lambert(0.4f, 0), other = lambert(0.5f, 0);
    red.base_color[0] = 0.9f;
    if (kind == GLOSSY) {
        grey.specular = 1;
        grey.roughness = 0.35f;
        red.model = ES_SURFACE_PHONG;
        red.specular = 0.3f;
        red.exponent = 40;
        red.base_color[0] = 0.5f;
    }
    add_rectangle(&w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
    add_rectangle(&w, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 3, 0), &red);
    add_rectangle(&w, es_v3(-2, 0, 2), es_v3(0, 0, -4), es_v3(0, 3, 0), &other);
    if (plates) {
        other.double_sided = true;
        add_rectangle(&w, plate_corner, plate_u, plate_v, &other);
    }
    es_light_desc spot = es_default_light_desc();
    spot.type = ES_LIGHT_SPOT;
    spot.intensity = 30;
    spot.inner_cone = 0.3f;
    spot.outer_cone = 0.6f;
    add_light(&w, spot, es_v3(1.2f, 2.6f, 1.4f), es_v3(-1.7f, -2.1f, -1.8f));
    if (kind == GLOSSY) {
        es_light_desc sun = es_default_light_desc();
        sun.type = ES_LIGHT_DIRECTIONAL;
        sun.intensity = 2;
        add_light(&w, sun, es_v3(0, 3, 0), es_v3(-0.4f, -1, -0.5f));
    }
    if (kind == GLOSSY && plates) {
        /* seen through by the camera, lit on its back by the spot */
        es_material_desc away = lambert(0.8f, 0);
        add_rectangle(&w, es_v3(-1.2f, 0.2f, -1.2f), es_v3(0, 0.9f, 0), es_v3(0.9f, 0, -0.2f), &away);
    }
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 1.0f;
    look(&w, camera, es_v3(1.4f, 1.7f, 3.4f), es_v3(-0.6f, 0.7f, -0.6f));
    return w;
}

static es_renderer_settings settings_of(uint32_t bias)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.method = ES_GI_VPL_TRACED;
    s.traced_bias = bias;
    s.width = WIDTH;
    s.height = HEIGHT;
    s.vpls = 64;
    s.light_size = 256;
    s.shadow_size = 64;
    s.interleave = 4;
    return s;
}

static es_renderer* create(es_context* context, const es_renderer_settings* s)
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, s, &renderer), ES_OK);
    return renderer;
}

static es_image picture(es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static es_image render(small_world* w, const es_renderer_settings* s, const char* name)
{
    es_renderer* renderer = create(w->context, s);
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    es_image image = picture(renderer, name);
    es_renderer_destroy(renderer);
    return image;
}

static const es_pass_stats* pass(const es_renderer* renderer, const char* name)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (strcmp(stats->passes[i].name, name) == 0) return &stats->passes[i];
    fail_msg("no pass %s", name);
    return NULL;
}

/* ---- visibility ------------------------------------------------------------------------------------------------------------------------ */

/* Where the segment from a to b meets the plate: 1 it does, 0 it does not, -1 too near to an edge to say. */
static int meets_plate(es_vec3 a, es_vec3 b)
{
    es_vec3 d = es_v3_sub(b, a), n = es_v3_cross(plate_u, plate_v), from = es_v3_sub(plate_corner, a);
    float along = es_v3_dot(d, n);
    if (es_absf(along) < 1e-6f) return 0;
    float t = es_v3_dot(from, n) / along;
    if (t < 1e-3f || t > 1 - 1e-3f) return 0; /* an end lies on it: the cosines say which side is lit */
    es_vec3 p = es_v3_sub(es_v3_add(a, es_v3_scale(d, t)), plate_corner);
    float u = es_v3_dot(p, plate_u) / es_v3_dot(plate_u, plate_u), v = es_v3_dot(p, plate_v) / es_v3_dot(plate_v, plate_v);
    const float edge = 2e-3f;
    if (u < -edge || v < -edge || u > 1 + edge || v > 1 + edge) return 0;
    return u > edge && v > edge && u < 1 - edge && v < 1 - edge ? 1 : -1;
}

/* Every pixel is the sum over its lights of flux / pi · min(cos cos / d², bound), where the plate does not come between. Interleaved, those
 * are the lights of its phase, each n² times as bright. */
static void check_all_pairs(bool interleaved)
{
    const uint32_t side = interleaved ? 4 : 1;
    small_world w = corner(DIFFUSE, true, 2, 0, 0);
    es_renderer_settings s = settings_of(ES_TRACED_BOUNDED);
    s.spread = 0;
    s.geometry_bound = 4 * EXTENT2;
    s.traced_interleave = interleaved;
    if (interleaved) s.filter_passes = 0; /* and otherwise it does not matter */
    es_renderer* renderer = create(w.context, &s);
    assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
    assert_string_equal(pass(renderer, "filter")->skipped, interleaved ? "filter.passes is 0" : "gi is vpl-traced: every pixel has every light");
    assert_int_equal(pass(renderer, "shading")->count, PIXELS * 64 / (side * side));
    es_image irradiance = picture(renderer, "irradiance"), depth = picture(renderer, "depth"), normal = picture(renderer, "normal");
    static es_vpl vpls[64];
    size_t count = es_renderer_vpls(renderer, vpls, 64);
    assert_int_equal(count, 64);
    es_raster_view view;
    assert_int_equal(es_world_camera_view(w.world, w.camera, WIDTH, HEIGHT, &view), ES_OK);
    es_pixel_rays rays = es_pixel_rays_of_view(&view);
    int hidden = 0, bounded = 0, seen = 0;
    for (uint32_t i = 0; i < PIXELS; i++) {
        if (!(depth.pixels[i] > 0)) continue;
        seen++;
        es_vec3 p = es_pixel_rays_position(&rays, (float)(i % WIDTH), (float)(i / WIDTH), depth.pixels[i]), n = es_v3(normal.pixels[3 * i], normal.pixels[3 * i + 1], normal.pixels[3 * i + 2]);
        double low = 0, high = 0;
        for (size_t v = i % WIDTH % side + side * (i / WIDTH % side); v < count; v += side * side) {
            es_vec3 d = es_v3_sub(vpls[v].position, p);
            double cosines = fmax((double)es_v3_dot(d, n), 0) * fmax(-(double)es_v3_dot(d, vpls[v].normal), 0), d2 = (double)es_v3_dot(d, d);
            double geometry = fmin(cosines / (d2 * d2), 4), e = geometry * side * side * (double)vpls[v].flux[0] / pi;
            int met = e > 0 ? meets_plate(p, vpls[v].position) : 0;
            hidden += met == 1;
            bounded += geometry == 4;
            if (met == 0) low += e;
            if (met != 1) high += e;
        }
        double found = (double)irradiance.pixels[3 * i];
        if (!(found >= low * 0.9999 - 1e-9 && found <= high * 1.0001 + 1e-9)) fail_msg("pixel %u: %.6g, expected %.6g to %.6g", i, found, low, high);
    }
    if (!(seen > PIXELS / 2 && hidden > (interleaved ? 12 : 200) && bounded > (interleaved ? 0 : 10))) fail_msg("%d pixels, %d pairs hidden, %d bounded", seen, hidden, bounded);
    es_image_destroy(w.context, &irradiance);
    es_image_destroy(w.context, &depth);
    es_image_destroy(w.context, &normal);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}
static void test_all_pairs(void** state) { check_all_pairs(false); }
static void test_interleaved_pairs(void** state) { check_all_pairs(true); }

/* Where nothing hides anything, rays and maps that hide nothing give the same bits. */
static void test_open_world(void** state)
{
    for (surfaces kind = DIFFUSE; kind <= GLOSSY; kind++) {
        small_world w = corner(kind, false, 2, 0, 0);
        es_renderer_settings s = settings_of(ES_TRACED_BOUNDED);
        s.interleave = 1; /* so that sums have one order */
        es_image traced = render(&w, &s, "indirect");
        s.ism_bias = 1;
        s.ism_points = 64;
        s.ism_pool = 64;
        s.classic_size = 32;
        static const uint32_t methods[] = {ES_GI_ISM, ES_GI_CLASSIC};
        for (int m = 0; m < 2; m++) {
            s.method = methods[m];
            es_image mapped = render(&w, &s, "indirect");
            double sum = 0;
            for (int i = 0; i < PIXELS * 3; i++) {
                if (traced.pixels[i] != mapped.pixels[i]) fail_msg("method %d, pixel %d: %.8g by rays, %.8g by maps", m, i / 3, (double)traced.pixels[i], (double)mapped.pixels[i]);
                sum += (double)mapped.pixels[i];
            }
            assert_true(sum > 1);
            es_image_destroy(w.context, &mapped);
        }
        es_image_destroy(w.context, &traced);
        small_world_destroy(&w);
    }
}

static void assert_same(const es_image* a, const es_image* b, const char* what)
{
    double sum = 0;
    for (int i = 0; i < PIXELS * 3; i++) {
        if (a->pixels[i] != b->pixels[i]) fail_msg("%s: pixel %d is %.8g and %.8g", what, i / 3, (double)a->pixels[i], (double)b->pixels[i]);
        sum += (double)a->pixels[i];
    }
    assert_true(sum > 1);
}

/* The method of visibility alone changes: interleaved and filtered, rays and maps that hide nothing give the same bits, and where there is
 * something to hide, they do not. */
static void test_visibility_alone(void** state)
{
#if defined(__SANITIZE_THREAD__)
    skip(); /* about what comes out; the passes are also those of test_interleaved_pairs and test_determinism */
#endif
    for (surfaces kind = DIFFUSE; kind <= GLOSSY; kind++)
        for (int plates = 0; plates < 2; plates++) {
            small_world w = corner(kind, plates, 2, 0, 0);
            es_renderer_settings s = settings_of(ES_TRACED_BOUNDED);
            s.traced_interleave = true;
            s.filter_passes = 2;
            s.ism_bias = 1;
            s.ism_points = s.ism_pool = 64;
            for (int unbounded = 0; unbounded < 2; unbounded++) {
                s.traced_bias = unbounded ? ES_TRACED_UNBOUNDED : ES_TRACED_BOUNDED;
                s.method = ES_GI_VPL_TRACED;
                es_image traced = render(&w, &s, "indirect"), unfiltered = render(&w, &s, "indirect-unfiltered");
                s.method = ES_GI_ISM;
                es_image mapped = render(&w, &s, "indirect"), mapped_unfiltered = render(&w, &s, "indirect-unfiltered");
                if (plates) {
                    assert_int_not_equal(es_image_hash(&traced), es_image_hash(&mapped));
                } else {
                    assert_same(&traced, &mapped, "filtered");
                    assert_same(&unfiltered, &mapped_unfiltered, "unfiltered");
                    assert_int_not_equal(es_image_hash(&traced), es_image_hash(&unfiltered));
                }
                es_image* all[] = {&traced, &unfiltered, &mapped, &mapped_unfiltered};
                for (int i = 0; i < 4; i++) es_image_destroy(w.context, all[i]);
            }
            small_world_destroy(&w);
        }
}

/* Without a pattern to interleave by, the switch for it changes nothing. */
static void test_pattern_of_one(void** state)
{
    small_world w = corner(GLOSSY, true, 2, 0, 0);
    es_renderer_settings s = settings_of(ES_TRACED_COMPENSATED);
    s.traced_samples = 2;
    s.interleave = 1;
    es_image alone = render(&w, &s, "indirect");
    s.traced_interleave = true;
    es_image switched = render(&w, &s, "indirect");
    s.filter_passes = 0;
    es_image unfiltered = render(&w, &s, "indirect");
    assert_same(&alone, &switched, "interleave 1");
    assert_same(&alone, &unfiltered, "interleave 1, no filter");
    es_image_destroy(w.context, &alone);
    es_image_destroy(w.context, &switched);
    es_image_destroy(w.context, &unfiltered);
    small_world_destroy(&w);
}

/* With maps too, compensation is what rays find, added to what is gathered. */
static void test_compensation_alone(void** state)
{
    small_world w = corner(GLOSSY, true, 2, 0, 0);
    es_renderer_settings s = settings_of(ES_TRACED_COMPENSATED);
    s.traced_samples = 3;
    s.ism_points = s.ism_pool = 1024;
    s.filter_passes = 2;
    es_image compensation = render(&w, &s, "compensation");
    s.method = ES_GI_ISM;
    es_renderer* renderer = create(w.context, &s);
    assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
    es_image compensated = picture(renderer, "indirect"), of_maps = picture(renderer, "compensation");
    assert_same(&compensation, &of_maps, "compensation");
    s.traced_bias = ES_TRACED_BOUNDED;
    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
    assert_string_equal(pass(renderer, "ray hierarchy")->skipped, "nothing is found by rays");
    assert_null(renderer->trace_scene.bvh);
    es_image bounded = picture(renderer, "indirect");
    for (int i = 0; i < PIXELS * 3; i++) bounded.pixels[i] += compensation.pixels[i];
    assert_same(&bounded, &compensated, "bounded and compensation");
    es_renderer_destroy(renderer);
    es_image* all[] = {&compensation, &compensated, &of_maps, &bounded};
    for (int i = 0; i < 4; i++) es_image_destroy(w.context, all[i]);
    small_world_destroy(&w);
}

/* ---- bias -------------------------------------------------------------------------------------------------------------------------------- */

/* Bounding, spreading and widening lobes of Lambertian surfaces only take light away, at every pixel. */
static void test_bounding_takes_away(void** state)
{
    small_world w = corner(DIFFUSE, true, 2, 0, 0);
    es_renderer_settings s = settings_of(ES_TRACED_UNBOUNDED);
    s.geometry_bound = 1 * EXTENT2;
    es_image all = render(&w, &s, "indirect");
    s.traced_bias = ES_TRACED_BOUNDED;
    es_image bounded = render(&w, &s, "indirect");
    s.geometry_bound = 1e8f;
    es_image spread = render(&w, &s, "indirect");
    s.spread = 0;
    es_image neither = render(&w, &s, "indirect");
    int lost = 0;
    for (int i = 0; i < PIXELS * 3; i++) {
        assert_true(bounded.pixels[i] <= spread.pixels[i] && spread.pixels[i] <= all.pixels[i]);
        lost += bounded.pixels[i] < 0.9f * all.pixels[i];
        assert_true(neither.pixels[i] == all.pixels[i]);
    }
    assert_true(lost > PIXELS / 10);
    es_image_destroy(w.context, &all);
    es_image_destroy(w.context, &bounded);
    es_image_destroy(w.context, &spread);
    es_image_destroy(w.context, &neither);
    small_world_destroy(&w);
}

enum { BLOCK = 6, BLOCKS_X = WIDTH / BLOCK, BLOCKS = BLOCKS_X * (HEIGHT / BLOCK) };

/* Means over blocks of pixels. */
static void block_means(const es_image* image, double means[BLOCKS])
{
    for (int b = 0; b < BLOCKS; b++) means[b] = 0;
    for (int i = 0; i < PIXELS; i++) means[i / WIDTH / BLOCK * BLOCKS_X + i % WIDTH / BLOCK] += ((double)image->pixels[3 * i] + (double)image->pixels[3 * i + 1]) / (2.0 * BLOCK * BLOCK);
}

/* The largest |deviation| from the reference over the blocks in standard errors of both, and the sum's. `sets` sets of lights are runs of
 * one Halton sequence, which err less than independent ones would. */
static void deviation(small_world* w, es_renderer_settings s, uint32_t sets, const double reference[BLOCKS], const double reference_error[BLOCKS], double* worst, double* all)
{
    running_mean blocks[BLOCKS] = {0}, sums = {0};
    es_renderer* renderer = create(w->context, &s);
    for (uint32_t k = 0; k < sets; k++) {
        s.seed = k * 89; /* every lamp takes its points from here on: a step of 64 would leave gaps at the same bits in all sets */
        assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
        assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
        es_image image = picture(renderer, "indirect");
        double means[BLOCKS], sum = 0;
        block_means(&image, means);
        for (int b = 0; b < BLOCKS; b++) {
            mean_add(&blocks[b], means[b]);
            sum += means[b];
        }
        mean_add(&sums, sum);
        es_image_destroy(w->context, &image);
    }
    es_renderer_destroy(renderer);
    double expected = 0, variance = 0;
    *worst = 0;
    for (int b = 0; b < BLOCKS; b++) {
        /* what the texels of the lamps' G-buffers may make of it: half a percent */
        double error = hypot(hypot(standard_error_of(&blocks[b]), reference_error[b]), 0.005 * reference[b]);
        *worst = fmax(*worst, fabs(mean_of(&blocks[b]) - reference[b]) / error);
        expected += reference[b];
        variance += reference_error[b] * reference_error[b];
    }
    *all = (mean_of(&sums) - expected) / hypot(hypot(standard_error_of(&sums), sqrt(variance)), 0.003 * expected);
}

/* Compensated or unbounded, the mean over sets of lights is the truth; bounded, it is far from it. */
static void check_bias(surfaces kind)
{
#if defined(__SANITIZE_THREAD__)
    skip(); /* means over many seeds, whose threads do what those of the other tests do */
#endif
    small_world w = corner(kind, true, 2, 0, 0);
    es_reference_settings rs = es_default_reference_settings();
    rs.width = WIDTH;
    rs.height = HEIGHT;
    rs.bounces = 1;
    rs.emission = false;
    rs.quantised = true;
    es_reference* reference;
    assert_int_equal(es_reference_create(w.context, &rs, &reference), ES_OK);
    assert_int_equal(es_reference_begin(reference, w.world), ES_OK);
    assert_int_equal(es_reference_add(reference, 512), ES_OK);
    es_image truth, error;
    assert_int_equal(es_reference_image(reference, "bounce-1", &truth), ES_OK);
    assert_int_equal(es_reference_image(reference, "bounce-1-error", &error), ES_OK);
    double expected[BLOCKS], tolerance[BLOCKS] = {0};
    block_means(&truth, expected);
    for (int i = 0; i < PIXELS; i++) {
        double e = fmax((double)error.pixels[3 * i], (double)error.pixels[3 * i + 1]) / (BLOCK * BLOCK);
        tolerance[i / WIDTH / BLOCK * BLOCKS_X + i % WIDTH / BLOCK] += e * e;
    }
    for (int b = 0; b < BLOCKS; b++) tolerance[b] = sqrt(tolerance[b]);

    es_renderer_settings s = settings_of(ES_TRACED_COMPENSATED);
    s.geometry_bound = 1 * EXTENT2;
    double worst, all;
    deviation(&w, s, 32, expected, tolerance, &worst, &all);
    if (!(worst < 3.5 && fabs(all) < 2.5)) fail_msg("compensated: %.1f standard errors in one block, %+.1f in all", worst, all);
    s.view_importance = false;
    s.spread = 10;
    deviation(&w, s, 32, expected, tolerance, &worst, &all);
    if (!(worst < 3.5 && fabs(all) < 2.5)) fail_msg("compensated, more spread: %.1f standard errors in one block, %+.1f in all", worst, all);
    s = settings_of(ES_TRACED_UNBOUNDED);
    deviation(&w, s, 32, expected, tolerance, &worst, &all);
    if (!(worst < 3.5 && fabs(all) < 2.5)) fail_msg("unbounded: %.1f standard errors in one block, %+.1f in all", worst, all);
    s.traced_bias = ES_TRACED_BOUNDED;
    s.geometry_bound = 1 * EXTENT2;
    deviation(&w, s, 32, expected, tolerance, &worst, &all);
    if (!(worst > 8)) fail_msg("bounded: only %.1f standard errors", worst);
    es_image_destroy(w.context, &truth);
    es_image_destroy(w.context, &error);
    es_reference_destroy(reference);
    small_world_destroy(&w);
}
static void test_bias_of_diffuse_surfaces(void** state) { check_bias(DIFFUSE); }
static void test_bias_of_lobes(void** state) { check_bias(GLOSSY); }

/* ---- frames ------------------------------------------------------------------------------------------------------------------------------ */

/* The same bits for any number of threads and instruction set. */
static void test_determinism(void** state)
{
    es_renderer_settings s = settings_of(ES_TRACED_COMPENSATED);
    s.width = 29;
    s.height = 11;
    s.traced_samples = 3;
    uint64_t expected = 0;
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        for (uint32_t threads = 1; threads <= 3; threads += 2) {
            small_world w = corner(GLOSSY, true, threads, 1u << isa, 0);
            es_image image = render(&w, &s, "indirect");
            uint64_t hash = es_image_hash(&image);
            if (!expected) expected = hash;
            assert_int_equal(hash, expected);
            es_image_destroy(w.context, &image);
            small_world_destroy(&w);
        }
    }
}

/* What is unchanged is not done again, and the bits are those of doing it; another method gives the hierarchy's memory back. */
static void test_skipping(void** state)
{
    small_world w = corner(GLOSSY, true, 2, 0, 0);
    es_material_desc material = lambert(0.5f, 0);
    add_rectangle(&w, es_v3(-1, 0.1f, 0), es_v3(0.5f, 0, 0), es_v3(0, 0, -0.5f), &material);
    es_renderer_settings s = settings_of(ES_TRACED_COMPENSATED);
    es_renderer *with = create(w.context, &s), *without = create(w.context, &s);
    es_node node = node_towards(&w, es_v3(0, 0, 0), es_v3(0, 0, -1));
    uint32_t ids[16];
    size_t count = 16;
    assert_int_equal(es_world_enumerate(w.world, ES_OBJECT_INSTANCE, ids, &count), ES_OK);
    for (int frame = 0; frame < 6; frame++) {
        if (frame == 2) s.traced_samples = 5;
        if (frame == 3) s.exposure = 1;
        if (frame == 4) {
            es_instance_desc instance;
            assert_int_equal(es_world_get_instance(w.world, (es_instance){ids[count - 1]}, &instance), ES_OK);
            instance.node = node;
            assert_int_equal(es_world_set_instance(w.world, (es_instance){ids[count - 1]}, &instance), ES_OK);
            es_transform moved = es_identity_transform();
            moved.translation = es_v3(0.3f, 0.4f, 0);
            assert_int_equal(es_world_set_node_transform(w.world, node, &moved), ES_OK);
        }
        if (frame == 5) s.traced_bias = ES_TRACED_BOUNDED;
        assert_int_equal(es_world_step(w.world, 0), ES_OK);
        s.skip = true;
        assert_int_equal(es_renderer_configure(with, &s), ES_OK);
        s.skip = false;
        assert_int_equal(es_renderer_configure(without, &s), ES_OK);
        assert_int_equal(es_renderer_render(with, w.world), ES_OK);
        assert_int_equal(es_renderer_render(without, w.world), ES_OK);
        static const char* const names[] = {"display", "indirect", "compensation"};
        for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
            es_image a = picture(with, names[i]), b = picture(without, names[i]);
            assert_int_equal(es_image_hash(&a), es_image_hash(&b));
            es_image_destroy(w.context, &a);
            es_image_destroy(w.context, &b);
        }
        const char *hierarchy = pass(with, "ray hierarchy")->skipped, *shading = pass(with, "shading")->skipped, *compensation = pass(with, "bias compensation")->skipped;
        assert_int_equal(hierarchy == NULL, frame == 0 || frame == 4);
        assert_int_equal(shading == NULL, frame == 0 || frame == 4);
        assert_int_equal(compensation == NULL, frame == 0 || frame == 2 || frame == 4);
        if (frame == 5) assert_string_equal(compensation, "traced.bias is not compensated");
        assert_null(pass(without, "shading")->skipped);
    }
    s.method = ES_GI_NONE;
    assert_int_equal(es_renderer_configure(with, &s), ES_OK);
    assert_int_equal(es_renderer_render(with, w.world), ES_OK);
    assert_string_equal(pass(with, "ray hierarchy")->skipped, "nothing is found by rays");
    assert_null(with->trace_scene.bvh);
    es_renderer_destroy(with);
    es_renderer_destroy(without);
    small_world_destroy(&w);
}

/* A frame that fails for want of memory leaves no image to read, and one that has enough is whole. */
static void test_memory_cap(void** state)
{
    es_renderer_settings s = settings_of(ES_TRACED_COMPENSATED);
    s.traced_samples = 1;
    small_world w = corner(DIFFUSE, true, 1, 0, 0);
    size_t least = es_context_peak_bytes(w.context);
    es_image image = render(&w, &s, "indirect");
    uint64_t expected = es_image_hash(&image);
    es_image_destroy(w.context, &image);
    size_t most = es_context_peak_bytes(w.context);
    small_world_destroy(&w);
    int failed = 0;
    for (size_t step = 0; step <= 40; step++) {
        w = corner(DIFFUSE, true, 1, 0, least + (most - least) * step / 40);
        es_renderer* renderer;
        es_result result = es_renderer_create(w.context, &s, &renderer);
        if (!result) {
            result = es_renderer_render(renderer, w.world);
            assert_int_equal(es_renderer_image(renderer, "indirect", &image), result ? ES_WRONG_STATE : ES_OK);
            if (!result) assert_int_equal(es_image_hash(&image), expected);
            es_image_destroy(w.context, &image);
            es_renderer_destroy(renderer);
        }
        assert_int_equal(result, step == 40 ? ES_OK : result ? ES_MEMORY_CAP : ES_OK);
        failed += result != ES_OK;
        small_world_destroy(&w);
    }
    assert_true(failed > 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_all_pairs),
        unit_test_without_races(test_interleaved_pairs),
        unit_test_without_races(test_open_world),
        unit_test_without_races(test_visibility_alone),
        unit_test_without_races(test_pattern_of_one),
        unit_test_without_races(test_compensation_alone),
        unit_test_without_races(test_bounding_takes_away),
        unit_test_without_races(test_bias_of_diffuse_surfaces),
        unit_test_without_races(test_bias_of_lobes),
        cmocka_unit_test(test_determinism),
        cmocka_unit_test(test_skipping),
        unit_test_without_races(test_memory_cap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
