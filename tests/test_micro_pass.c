/* Whole frames of micro-buffers: that skipping, threads, instruction sets and what was rendered before change no bit, that what is interpolated is
 * close to what is gathered and what is gathered afresh is equal to it, that history settles on a mean, and that frames with next to nothing in them come out. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/gi.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "tests/races.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

#if defined(__SANITIZE_THREAD__)
enum { WIDTH = 22, HEIGHT = 14, POINTS = 256, VARIANTS = 1 };
#else
enum { WIDTH = 42, HEIGHT = 30, POINTS = 1024, VARIANTS = 4 };
#endif

typedef struct stage { es_context* context; es_world* world; es_renderer* renderer; es_renderer_settings settings; } stage;

static es_renderer_settings small_settings(uint32_t spacing)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.method = ES_GI_MICRO;
    s.shadow_size = 128;
    s.light_size = 64;
    s.vpls = 24;
    s.interleave = 2;
    s.ism_size = 32;
    s.ism_points = 256;
    s.ism_pool = 4096;
    s.micro_size = 8;
    s.micro_points = POINTS;
    s.micro_spacing = spacing;
    return s;
}

static stage open_stage(const char* scene, uint32_t threads, uint32_t isa_mask, const es_renderer_settings* settings)
{
    stage s = {.settings = *settings};
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    if (isa_mask) desc.isa_mask = isa_mask;
    assert_int_equal(es_context_create(&desc, &s.context), ES_OK);
    assert_int_equal(es_world_create_scene(s.context, scene, NULL, &s.world), ES_OK);
    assert_int_equal(es_renderer_create(s.context, &s.settings, &s.renderer), ES_OK);
    return s;
}
static void close_stage(stage* s)
{
    es_renderer_destroy(s->renderer);
    es_world_destroy(s->world);
    assert_int_equal(es_context_bytes(s->context), 0);
    es_context_destroy(s->context);
}
static void render(stage* s) { assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK); }
static void step(stage* s, float dt) { assert_int_equal(es_world_step(s->world, dt), ES_OK); }
static void configure(stage* s) { assert_int_equal(es_renderer_configure(s->renderer, &s->settings), ES_OK); }

static es_image image_of(stage* s, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(s->renderer, name, &image), ES_OK);
    return image;
}
static uint64_t hash_of(stage* s, const char* name)
{
    es_image image = image_of(s, name);
    uint64_t hash = es_image_hash(&image);
    es_image_destroy(s->context, &image);
    return hash;
}
static uint64_t all_of(stage* s) { return hash_of(s, "display") ^ hash_of(s, "irradiance") * 3 ^ hash_of(s, "indirect") * 5 ^ hash_of(s, "confidence") * 7; }

static const es_pass_stats* pass_of(stage* s, const char* name)
{
    const es_frame_stats* stats = es_renderer_stats(s->renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!strcmp(stats->passes[i].name, name)) return &stats->passes[i];
    fail_msg("there is no pass %s", name);
    return NULL;
}

static double difference(const es_image* a, const es_image* b)
{
    double squares = 0, sum = 0;
    const size_t count = (size_t)a->width * a->height * a->channels;
    for (size_t i = 0; i < count; i++) {
        const double d = (double)a->pixels[i] - (double)b->pixels[i];
        squares += d * d;
        sum += (double)b->pixels[i];
    }
    return sqrt(squares / (double)count) / (sum / (double)count);
}

static void move_camera(stage* s, float x)
{
    es_camera_desc camera;
    es_transform transform;
    assert_int_equal(es_world_get_camera(s->world, es_world_active_camera(s->world), &camera), ES_OK);
    assert_int_equal(es_world_get_node_transform(s->world, camera.node, &transform), ES_OK);
    transform.translation.x += x;
    assert_int_equal(es_world_set_node_transform(s->world, camera.node, &transform), ES_OK);
}
static void scale_light(stage* s, float factor)
{
    uint32_t id;
    size_t count = 1;
    assert_int_equal(es_world_enumerate(s->world, ES_OBJECT_LIGHT, &id, &count), ES_OK);
    es_light_desc light;
    assert_int_equal(es_world_get_light(s->world, (es_light){id}, &light), ES_OK);
    light.intensity *= factor;
    assert_int_equal(es_world_set_light(s->world, (es_light){id}, &light), ES_OK);
}

/* ---- the same bits --------------------------------------------------------------------------------------------------- */

enum { FRAMES = 14 };

/* Movement, standing still past settling, a moved camera, changed light, other settings, another method and back. */
static void run(const char* scene, uint32_t threads, uint32_t isa_mask, bool skip, uint32_t spacing, bool temporal, uint32_t antialias, uint64_t hashes[FRAMES])
{
    es_renderer_settings settings = small_settings(spacing);
    settings.skip = skip;
    settings.temporal = temporal;
    settings.temporal_settle = 3;
    settings.antialias = antialias;
    settings.antialias_samples = 3;
    stage s = open_stage(scene, threads, isa_mask, &settings);
    for (int i = 0; i < FRAMES; i++) {
        if (i > 0) step(&s, i < 3 || i == 13 ? 1.0f / 30 : 0.0f);
        if (i == 8) move_camera(&s, 0.02f);
        if (i == 9) scale_light(&s, 1.5f);
        if (i == 10) s.settings.method = ES_GI_ISM;
        if (i == 11) s.settings.method = ES_GI_MICRO;
        if (i == 12) s.settings.bounces = 2;
        if (i >= 10) configure(&s);
        render(&s);
        hashes[i] = all_of(&s);
    }
    close_stage(&s);
}

static void test_same_bits(void** state)
{
    (void)state;
    static const struct { const char* scene; uint32_t spacing; bool temporal; uint32_t antialias; } variants[] = {
        {"room", 4, true, ES_ANTIALIAS_NONE}, {"cornell", 1, false, ES_ANTIALIAS_NONE}, {"cornell", 2, false, ES_ANTIALIAS_TEMPORAL}, {"cornell", 4, false, ES_ANTIALIAS_SUPERSAMPLE}};
    for (size_t v = 0; v < VARIANTS; v++) {
        const uint32_t spacing = variants[v].spacing, antialias = variants[v].antialias;
        const bool temporal = variants[v].temporal;
        uint64_t expected[FRAMES], other[FRAMES];
        run(variants[v].scene, 1, 0, true, spacing, temporal, antialias, expected);
        run(variants[v].scene, 2, 0, false, spacing, temporal, antialias, other);
        for (int i = 0; i < FRAMES; i++)
            if (expected[i] != other[i]) fail_msg("variant %zu: frame %d differs without skipping and on two threads", v, i);
        for (int i = 8; i < 12; i++) assert_true(expected[i] != expected[i - 1]);
        if (v) continue; /* kernels are the same in all of them */
        run(variants[v].scene, 1, 1u << ES_ISA_SCALAR, true, spacing, temporal, antialias, other);
        for (int i = 0; i < FRAMES; i++)
            if (expected[i] != other[i]) fail_msg("variant %zu: frame %d differs with the scalar kernels", v, i);
    }
}

/* Other methods and settings in between leave nothing. */
static void test_switching(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings(1);
    stage s = open_stage("room", 1, 0, &settings);
    static const uint32_t methods[] = {ES_GI_MICRO, ES_GI_NONE, ES_GI_MICRO, ES_GI_ISM, ES_GI_MICRO};
    static const uint32_t spacings[] = {1, 2, 4, 1, 2};
    for (int i = 0; i < 5; i++) {
        s.settings.method = methods[i];
        s.settings.micro_spacing = spacings[i];
        s.settings.width = WIDTH + (i == 2 ? 9 : 0);
        s.settings.micro_points = i == 4 ? POINTS / 2 : POINTS;
        configure(&s);
        render(&s);
        stage fresh = open_stage("room", 1, 0, &s.settings);
        render(&fresh);
        if (all_of(&s) != all_of(&fresh)) fail_msg("frame %d is not what it is alone", i);
        close_stage(&fresh);
    }
    close_stage(&s);
}

static void test_two_renderers(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings(1), other = small_settings(4);
    stage s = open_stage("cornell", 1, 0, &settings);
    stage second = s;
    other.micro_points = POINTS / 4;
    assert_int_equal(es_renderer_create(s.context, &other, &second.renderer), ES_OK);
    render(&s);
    render(&second);
    const uint64_t first_hash = all_of(&s), second_hash = all_of(&second);
    assert_true(first_hash != second_hash);
    settings.skip = other.skip = false;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_OK);
    assert_int_equal(es_renderer_configure(second.renderer, &other), ES_OK);
    render(&second);
    render(&s);
    assert_true(all_of(&s) == first_hash && all_of(&second) == second_hash);
    es_renderer_destroy(second.renderer);
    close_stage(&s);
}

/* ---- as it is by default ------------------------------------------------------------------------------------------------------ */

/* Two polished balls in a closed box with a lamp: they throw its light on walls, and reflect each other. */
static small_world polished_world(es_context* context)
{
    small_world w = {.context = context};
    assert_int_equal(es_world_create(context, NULL, &w.world), ES_OK);
    const es_material_desc walls = lambert(0.6f, 0);
    es_material_desc metal = es_default_material_desc();
    metal.metallic = 1;
    metal.roughness = 0.15f;
    metal.base_color[1] = 0.7f;
    add_closed_box(&w, &walls);
    add_sphere(&w, es_v3(-0.35f, -0.6f, -0.2f), 0.4f, 12, false, &metal);
    add_sphere(&w, es_v3(0.5f, -0.8f, 0), 0.2f, 8, false, &metal);
    es_light_desc lamp = es_default_light_desc();
    lamp.type = ES_LIGHT_POINT;
    lamp.intensity = 6;
    add_light(&w, lamp, es_v3(0.4f, 0.6f, 0.3f), es_v3(0, -1, 0));
    look(&w, es_default_camera_desc(), es_v3(0.1f, 0.1f, 0.98f), es_v3(0, -0.4f, 0));
    return w;
}

static es_renderer_settings default_settings(void)
{
    const es_renderer_settings d = es_default_renderer_settings();
    es_renderer_settings s = small_settings(d.micro_spacing);
    s.micro_size = d.micro_size;
    s.micro_points = 16384;
    assert_true(s.micro_share > 0 && s.micro_lobes && s.micro_warp && s.micro_ray_cast);
    return s;
}

static stage open_polished(es_context* context, const es_renderer_settings* settings)
{
    stage s = {.context = context, .world = polished_world(context).world, .settings = *settings};
    assert_int_equal(es_renderer_create(context, settings, &s.renderer), ES_OK);
    return s;
}

static void assert_light(const es_image* image)
{
    double sum = 0;
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channels; i++) {
        assert_true(isfinite(image->pixels[i]) && image->pixels[i] >= 0.0f);
        sum += (double)image->pixels[i];
    }
    assert_true(sum > 0);
}

/* The same bits on one thread and several, on every instruction set, and where all work is done again; no light is negative, or no number. */
static void test_same_bits_by_default(void** state)
{
    (void)state;
    static const char* const names[] = {"irradiance", "indirect", "display"};
    es_renderer_settings settings = default_settings();
    settings.width = WIDTH * 3 / 4;
    settings.height = HEIGHT * 3 / 4;
    settings.micro_points = 2 * POINTS;
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        stage s = open_polished(context, &settings);
        render(&s);
        for (int k = 0; k < 3; k++) {
            es_image image = image_of(&s, names[k]);
            assert_light(&image);
            expect_same_bits(&same, image.pixels, (size_t)image.width * image.height * image.channels * sizeof(float));
            es_image_destroy(context, &image);
        }
        const uint64_t hash = all_of(&s);
        s.settings.skip = false;
        configure(&s);
        render(&s);
        assert_true(all_of(&s) == hash);
        close_stage(&s);
    }
}

/* What cells share is nearly what each point sees for itself, also where curved metal throws light about. The bounds are for what another seed changes as well, and for
 * cells that are wide in so small a picture; a block of pixels that sees something else, or a wall that takes another's light, is beyond them. */
static void test_shared_by_default(void** state)
{
    (void)state;
    es_renderer_settings settings = default_settings();
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    stage s = open_polished(context, &settings);
    render(&s);
    es_image shared = image_of(&s, "irradiance"), shared_light = image_of(&s, "indirect"), metal = image_of(&s, "metallic");
    s.settings.micro_share = 0;
    configure(&s);
    render(&s);
    es_image own = image_of(&s, "irradiance"), own_light = image_of(&s, "indirect");
    double off = 0, all = 0, sum = 0, metal_off = 0, metal_sum = 0;
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT * 3; i++) {
        off += fabs((double)shared.pixels[i] - (double)own.pixels[i]);
        all += (double)shared.pixels[i];
        sum += (double)own.pixels[i];
        if (!(metal.pixels[i / 3 * metal.channels] > 0)) continue;
        metal_off += fabs((double)shared_light.pixels[i] - (double)own_light.pixels[i]);
        metal_sum += (double)own_light.pixels[i];
    }
    print_message("shared: irradiance off by %.4f, mean %.4f; light of metal off by %.4f\n", off / sum, all / sum, metal_off / metal_sum);
    assert_true(sum > 0 && off < 0.08 * sum && fabs(all - sum) < 0.04 * sum);
    assert_true(metal_sum > 0 && metal_off < 0.12 * metal_sum);
    es_image* const images[] = {&shared, &shared_light, &metal, &own, &own_light};
    for (int i = 0; i < 5; i++) es_image_destroy(context, images[i]);
    close_stage(&s);
}

/* ---- interpolation ------------------------------------------------------------------------------------------------------ */

static void test_interpolation(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings(1);
    settings.width = 2 * WIDTH;
    settings.height = 2 * HEIGHT;
    settings.micro_size = 16; /* noise would be larger than what interpolation leaves out */
    settings.micro_points = 8192;
    settings.micro_filter = 1;
    settings.micro_cut = 1; /* the coarser cuts are, the more they differ between cells */
    settings.micro_lobes = false; /* what metal throws on a wall is as small as an edge */
    settings.micro_share = 0; /* cells of fewer points are wider, and what they share differs (test_micro_gather) */
    stage s = open_stage("cornell", 1, 0, &settings);
    render(&s);
    es_image full = image_of(&s, "irradiance");
    assert_int_equal(pass_of(&s, "micro-buffer upsampling")->skipped != NULL, 1);
    const uint64_t samples = pass_of(&s, "micro-buffers")->count;
    assert_true(samples > 0);
    for (uint32_t spacing = 2; spacing <= 4; spacing *= 2) {
        s.settings.micro_spacing = spacing;
        configure(&s);
        render(&s);
        es_image sparse = image_of(&s, "irradiance");
        const es_pass_stats* up = pass_of(&s, "micro-buffer upsampling");
        assert_null(up->skipped);
        double errors = 0, sum = 0, there_errors = 0, there_sum = 0;
        uint64_t lit = 0;
        for (uint32_t y = 0; y < settings.height; y++)
            for (uint32_t x = 0; x < settings.width; x++)
                for (uint32_t k = 0; k < 3; k++) {
                    const size_t i = ((size_t)y * settings.width + x) * 3 + k;
                    const double a = (double)sparse.pixels[i], b = (double)full.pixels[i], d = a - b;
                    lit += k == 0 && b > 0.0;
                    errors += fabs(d);
                    sum += b;
                    if (x % spacing || y % spacing) continue;
                    there_errors += fabs(d);
                    there_sum += b;
                }
        /* edges are there, and little else */
        assert_true(up->count > 0 && up->count < lit / 3);
        /* what was gathered at is the same but for cuts, which gather points share; single pixels in corners differ by more */
        if (!(there_errors < 0.05 * there_sum)) fail_msg("spacing %u: relative L1 %.4f where light was gathered", spacing, there_errors / there_sum);
        /* so wide as pixels and points are few here, and edges many */
        if (!(errors < (spacing == 2 ? 0.1 : 0.16) * sum)) fail_msg("spacing %u: relative L1 %.4f", spacing, errors / sum);
        assert_true(pass_of(&s, "micro-buffers")->count < samples / (spacing * spacing) * 5 / 4);
        es_image_destroy(s.context, &sparse);
    }
    es_image_destroy(s.context, &full);
    close_stage(&s);
}

/* ---- history ---------------------------------------------------------------------------------------------------------------- */

/* A settled picture is the mean over its still frames, whatever was before, and less noisy than one of them. */
static void test_settles(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings(1);
    settings.temporal = true;
    settings.temporal_settle = 9;
    settings.micro_lobes = false; /* single bright pixels of 64 are no noise to measure from two frames: rarely are any there */
    stage s = open_stage("cornell", 1, 0, &settings), moved = open_stage("cornell", 1, 0, &settings);
    render(&s);
    es_image single = image_of(&s, "irradiance");
    move_camera(&moved, 0.1f);
    render(&moved);
    move_camera(&moved, -0.1f);
    for (uint32_t i = 0; i < settings.temporal_settle + 3; i++) {
        render(&s);
        render(&moved);
    }
    const es_frame_stats* stats = es_renderer_stats(s.renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!stats->passes[i].skipped) fail_msg("%s runs though the picture has settled", stats->passes[i].name);
    es_image settled = image_of(&s, "irradiance");
    assert_true(hash_of(&s, "irradiance") == hash_of(&moved, "irradiance") && hash_of(&s, "display") == hash_of(&moved, "display"));

    /* of other random numbers: where there is no noise there is no difference */
    s.settings.seed = moved.settings.seed = 77;
    configure(&s);
    render(&s);
    es_image other = image_of(&s, "irradiance");
    configure(&moved);
    for (uint32_t i = 0; i < settings.temporal_settle + 2; i++) render(&moved);
    es_image other_settled = image_of(&moved, "irradiance");
    const double alone = difference(&single, &other), mean = difference(&settled, &other_settled);
    if (!(alone > 0.01 && mean < 0.45 * alone)) fail_msg("frames of two seeds differ by %.4f, settled ones by %.4f", alone, mean); /* 1/3, were they independent */
    es_image_destroy(s.context, &single);
    es_image_destroy(s.context, &settled);
    es_image_destroy(s.context, &other);
    es_image_destroy(moved.context, &other_settled);
    close_stage(&s);
    close_stage(&moved);
}

/* ---- next to nothing ---------------------------------------------------------------------------------------------------------- */

static void assert_finite(stage* s)
{
    es_image image = image_of(s, "radiance");
    for (size_t i = 0; i < (size_t)image.width * image.height * image.channels; i++) assert_true(isfinite(image.pixels[i]) && image.pixels[i] >= 0.0f);
    es_image_destroy(s->context, &image);
}

static void test_little(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < 6; i++) {
        es_renderer_settings settings = small_settings(i % 2 ? 4 : 1);
        if (i < 2) settings.width = settings.height = 1;
        if (i == 2 || i == 3) settings.micro_points = 1;
        stage s = open_stage("room", 1, 0, &settings);
        if (i >= 4) move_camera(&s, i == 4 ? 1e4f : 3.0f); /* away from everything, or into a wall */
        render(&s);
        assert_finite(&s);
        close_stage(&s);
    }
    /* nothing at all, and nothing that lights */
    es_renderer_settings settings = small_settings(2);
    stage s = open_stage("cornell", 1, 0, &settings);
    scale_light(&s, 0.0f);
    render(&s);
    assert_finite(&s);
    es_world_destroy(s.world);
    assert_int_equal(es_world_create(s.context, NULL, &s.world), ES_OK);
    es_node node;
    es_camera camera;
    assert_int_equal(es_world_add_node(s.world, &(es_node_desc){.transform = {.rotation = {0, 0, 0, 1}, .scale = {1, 1, 1}}}, &node), ES_OK);
    es_camera_desc desc = es_default_camera_desc();
    desc.node = node;
    assert_int_equal(es_world_add_camera(s.world, &desc, &camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(s.world, camera), ES_OK);
    render(&s);
    assert_finite(&s);
    assert_string_equal(pass_of(&s, "micro-buffers")->skipped, "nothing to light");
    close_stage(&s);
}

/* Light of bounces after the first lights the points; what single bounces bring adds up to all of it. */
static void test_bounces(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings(2);
    settings.micro_light = ES_MICRO_LIGHT_DIRECT;
    settings.bounces = 3;
    stage s = open_stage("cornell", 1, 0, &settings);
    render(&s);
    es_image one = image_of(&s, "indirect");
    assert_int_equal(es_renderer_vpls(s.renderer, NULL, 0), 0);
    s.settings.micro_light = ES_MICRO_LIGHT_VPLS;
    s.settings.bounce_vpls = 16;
    configure(&s);
    render(&s);
    assert_true(es_renderer_vpls(s.renderer, NULL, 0) > 0);
    es_image whole = image_of(&s, "indirect");
    const uint64_t hash = es_image_hash(&whole);
    static const char* const names[] = {"indirect-1", "indirect-2", "indirect-3", "indirect-4"};
    double sums[4] = {0}, before = 0, all = 0;
    float* added = calloc((size_t)WIDTH * HEIGHT * 3, sizeof *added);
    for (int b = 0; b < 4; b++) {
        es_image image = image_of(&s, names[b]);
        for (size_t i = 0; i < (size_t)WIDTH * HEIGHT * 3; i++) {
            sums[b] += (double)image.pixels[i];
            added[i] += image.pixels[i];
            if (b == 0) before += (double)one.pixels[i];
            if (b == 0) all += (double)whole.pixels[i];
        }
        if (b == 0) assert_true(difference(&image, &one) < 1e-6);
        es_image_destroy(s.context, &image);
    }
    assert_memory_equal(added, whole.pixels, (size_t)WIDTH * HEIGHT * 3 * sizeof *added);
    if (!(sums[1] > 0.05 * sums[0] && sums[1] < sums[0] && sums[2] > 0 && sums[2] < sums[1])) fail_msg("bounces bring %.3g, %.3g, %.3g", sums[0], sums[1], sums[2]);
    assert_true(sums[3] == 0.0 && fabs(sums[0] - before) < 1e-6 * before && all > before);
    /* and leave the points as they were */
    s.settings.skip = false;
    configure(&s);
    render(&s);
    assert_true(hash_of(&s, "indirect") == hash);
    s.settings.skip = true;
    configure(&s);
    assert_true(hash_of(&s, "indirect-2") != hash);
    s.settings.micro_cut = 0.99f; /* gathered again, of the points as the image left them */
    configure(&s);
    render(&s);
    s.settings.micro_cut = settings.micro_cut;
    configure(&s);
    render(&s);
    assert_true(hash_of(&s, "indirect") == hash);
    free(added);
    es_image_destroy(s.context, &one);
    es_image_destroy(s.context, &whole);
    close_stage(&s);
}

static void test_refused(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings(1);
    stage s = open_stage("cornell", 1, 0, &settings);
    s.settings.micro_spacing = 3;
    assert_int_equal(es_renderer_configure(s.renderer, &s.settings), ES_SETTING_VALUE);
    s.settings.micro_spacing = 4;
    s.settings.micro_size = 10;
    assert_int_equal(es_renderer_configure(s.renderer, &s.settings), ES_SETTING_VALUE);
    s.settings.micro_size = 36;
    assert_int_equal(es_renderer_configure(s.renderer, &s.settings), ES_SETTING_VALUE);
    s.settings.micro_size = 12;
    configure(&s);
    render(&s);
    /* one bounce is all there is, to the bit */
    assert_true(hash_of(&s, "indirect-1") == hash_of(&s, "indirect") && hash_of(&s, "indirect-unfiltered") == hash_of(&s, "indirect"));
    close_stage(&s);
}

/* The most points there may be, and too little memory for them: refused in one line, and smaller ones go on. */
static void test_too_many(void** state)
{
    (void)state;
    stage s = {.settings = small_settings(1)};
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.memory_cap = 48u << 20;
    assert_int_equal(es_context_create(&desc, &s.context), ES_OK);
    assert_int_equal(es_world_create_scene(s.context, "cornell", NULL, &s.world), ES_OK);
    assert_int_equal(es_renderer_create(s.context, &s.settings, &s.renderer), ES_OK);
    render(&s);
    const uint64_t hash = all_of(&s);
    s.settings.micro_points = 8388608;
    configure(&s);
    assert_int_equal(es_renderer_render(s.renderer, s.world), ES_MEMORY_CAP);
    s.settings.micro_points++;
    assert_int_equal(es_renderer_configure(s.renderer, &s.settings), ES_SETTING_VALUE);
    s.settings.micro_points = POINTS;
    configure(&s);
    render(&s);
    assert_true(all_of(&s) == hash);
    close_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bits),
        unit_test_without_races(test_switching),
        unit_test_without_races(test_two_renderers),
        cmocka_unit_test(test_same_bits_by_default),
        unit_test_without_races(test_shared_by_default),
        unit_test_without_races(test_interpolation),
        unit_test_without_races(test_settles),
        unit_test_without_races(test_bounces),
        unit_test_without_races(test_little),
        unit_test_without_races(test_refused),
        unit_test_without_races(test_too_many),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
