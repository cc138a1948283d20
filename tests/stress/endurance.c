/* A hundred thousand frames: a picture depends on the world as it is, not on how long the renderer has been at it.
 *
 * A small world moves by a clip and a step function, its lamp and settings change now and then, so that passes are skipped and run in all
 * orders. At some frames a fresh renderer draws the same; all images are equal bit for bit. Memory reaches its peak in the first thousandth
 * and returns to the same number of bytes. The clock is a sum in double: equal steps add up exactly, their 24 bits times the number fit. */
#include "tests/stress/stress.h"

#if defined(__SANITIZE_THREAD__)
enum { FRAMES = 1000 };
#elif defined(__SANITIZE_ADDRESS__)
enum { FRAMES = 5000 };
#else
enum { FRAMES = 100000 };
#endif

enum { WIDTH = 32, HEIGHT = 24 };
#define DURATION 1.7f

typedef struct actors { es_node box, lamp; } actors;

static void step(es_world* world, void* user, double time, float dt)
{
    const actors* a = user;
    es_transform t;
    assert_int_equal(es_world_get_node_transform(world, a->lamp, &t), ES_OK);
    float sine, cosine;
    es_sincos((float)(time - 6.0 * (double)(int64_t)(time / 6.0)), &sine, &cosine);
    t.translation.x = 0.5f * sine;
    assert_int_equal(es_world_set_node_transform(world, a->lamp, &t), ES_OK);
}

/* A floor, a wall and a box that a clip carries round. */
static stress moving_world(actors* a)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1; /* handing out work would be most of a frame of 32 × 24 pixels; tests/frame_hashes.c compares thread counts */
    stress s = stress_open_in(&desc, 1, es_v3(0, 0, 0));
    const es_material_desc white = matte(0.75f, 0.75f, 0.75f), red = matte(0.7f, 0.1f, 0.1f);
    stress_rectangle(&s, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &white);
    stress_rectangle(&s, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 2, 0), &red);
    es_instance box = stress_box(&s, es_v3(-0.3f, 0.1f, -0.3f), es_v3(0.3f, 0.7f, 0.3f), false, &white);
    es_node_desc node = {.parent = s.root, .transform = {{0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1}}};
    es_instance_desc instance;
    assert_int_equal(es_world_add_node(s.world, &node, &a->box), ES_OK);
    assert_int_equal(es_world_get_instance(s.world, box, &instance), ES_OK);
    instance.node = a->box;
    assert_int_equal(es_world_set_instance(s.world, box, &instance), ES_OK);
    es_light_desc lamp = es_default_light_desc();
    lamp.intensity = 20;
    lamp.node = a->lamp = stress_node(&s, es_v3(0, 2.5f, 1), es_v3(0, -1, -0.4f));
    es_light light;
    assert_int_equal(es_world_add_light(s.world, &lamp, &light), ES_OK);
    static const float times[3] = {0, 0.9f, DURATION}, places[9] = {-0.8f, 0, 0, 0.8f, 0.2f, 0.5f, -0.8f, 0, 0}, turns[12] = {0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0, -1};
    const es_clip_channel channels[2] = {{a->box, ES_CLIP_TRANSLATION, ES_INTERPOLATE_LINEAR, 3, times, places}, {a->box, ES_CLIP_ROTATION, ES_INTERPOLATE_LINEAR, 3, times, turns}};
    es_clip clip;
    assert_int_equal(es_world_add_clip(s.world, &(es_clip_desc){.channel_count = 2, .channels = channels}, &clip), ES_OK);
    assert_int_equal(es_world_play_clip(s.world, clip, true), ES_OK);
    es_world_set_step_function(s.world, step, a);
    stress_look(&s, es_v3(0, 1.5f, 3.4f), es_v3(0, 0.4f, 0), 0.9f, 0.05f);
    return s;
}

static es_renderer_settings settings_at(uint32_t frame)
{
    es_renderer_settings settings = stress_settings(WIDTH, HEIGHT, ES_GI_ISM);
    settings.shadow_size = 32;
    settings.light_size = 8;
    settings.vpls = 8;
    settings.interleave = 2;
    settings.ism_size = 32;
    settings.ism_points = 64;
    settings.ism_pool = 256;
    settings.exposure = (float)(frame / 7 % 3) * 0.5f;
    settings.seed = frame / 11 % 5;
    if (frame % 97 == 13) settings.method = ES_GI_CLASSIC;
    if (frame % 101 == 17) settings.method = ES_GI_VPL_TRACED;
    if (frame % 103 == 19) settings.method = ES_GI_NONE;
    settings.classic_size = 32;
    return settings;
}

static void assert_as_fresh(stress* s, es_renderer* old, uint32_t frame)
{
    es_renderer_settings settings = es_renderer_get_settings(old);
    es_renderer* fresh = stress_render(s, &settings);
    for (size_t i = 0; i < es_image_name_count(); i++) {
        es_image a = {0}, b = {0};
        es_result have = es_renderer_image(old, es_image_name(i), &a);
        assert_int_equal(have, es_renderer_image(fresh, es_image_name(i), &b));
        if (have == ES_OK && es_image_hash(&a) != es_image_hash(&b)) fail_msg("frame %u: %s is not what a fresh renderer draws", frame, es_image_name(i));
        es_image_destroy(s->context, &a);
        es_image_destroy(s->context, &b);
    }
    es_renderer_destroy(fresh);
}

static void a_hundred_thousand_frames(void** state)
{
    (void)state;
    actors a;
    stress s = moving_world(&a);
    es_renderer_settings settings = settings_at(0);
    es_renderer* renderer = stress_render(&s, &settings);
    const float dt = 1.0f / 60;
    size_t peak_limit = 0, first_bytes = 0;
    uint64_t distinct = 0, last = 0;
    for (uint32_t frame = 1; frame <= FRAMES; frame++) {
        settings = settings_at(frame);
        assert_int_equal(es_renderer_configure(renderer, &settings), ES_OK);
        /* one of nine frames stands still */
        assert_int_equal(es_world_step(s.world, frame % 9 ? dt : 0), ES_OK);
        assert_int_equal(es_renderer_render(renderer, s.world), ES_OK);
        uint32_t width, height;
        const uint32_t* shown = es_renderer_display(renderer, &width, &height);
        uint64_t sum = 0;
        for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) sum = sum * 31 + shown[i];
        distinct += sum != last;
        last = sum;
        /* all methods have been on by frame 300; the memory in use then is the same a multiple of their periods later */
        if (frame == 300) {
            first_bytes = es_context_bytes(s.context);
            peak_limit = es_context_peak_bytes(s.context) / 100 * 101; /* lists of what moves in a frame have the size it takes */
        }
        if (frame > 300 && (frame - 300) % (97 * 101) == 0) {
            assert_int_equal(es_context_bytes(s.context), first_bytes);
            assert_true(es_context_peak_bytes(s.context) <= peak_limit);
        }
    }
    assert_true(es_context_peak_bytes(s.context) <= peak_limit);
    assert_true(distinct > FRAMES / 2); /* the picture moved */
    /* a few more in a row, so that what is compared comes from every method */
    for (uint32_t frame = FRAMES + 1; frame <= FRAMES + 110; frame++) {
        settings = settings_at(frame);
        assert_int_equal(es_renderer_configure(renderer, &settings), ES_OK);
        assert_int_equal(es_world_step(s.world, dt), ES_OK);
        assert_int_equal(es_renderer_render(renderer, s.world), ES_OK);
        if (frame > FRAMES + 108 || settings.method != ES_GI_ISM) assert_as_fresh(&s, renderer, frame);
    }

    /* and the world: another one put into the same state draws the same */
    size_t size;
    assert_int_equal(es_world_save(s.world, NULL, &size), ES_OK);
    void* saved = malloc(size);
    assert_int_equal(es_world_save(s.world, saved, &size), ES_OK);
    es_image image = stress_image(renderer, "display");
    uint64_t shown = es_image_hash(&image);
    es_image_destroy(s.context, &image);
    actors b;
    stress other = moving_world(&b);
    assert_int_equal(es_world_restore(other.world, saved, size), ES_OK);
    assert_true(es_world_hash(other.world) == es_world_hash(s.world));
    es_renderer* fresh = stress_render(&other, &settings);
    image = stress_image(fresh, "display");
    assert_true(es_image_hash(&image) == shown);
    es_image_destroy(other.context, &image);
    free(saved);
    es_renderer_destroy(fresh);
    stress_close(&other);
    es_renderer_destroy(renderer);
    stress_close(&s);
}

/* The time is the exact sum, and the clip stands where its phase then puts it. */
static void the_clock(void** state)
{
    (void)state;
    const float dts[] = {1.0f / 60, 1e-3f, 0.1f, 1.0f / 3};
    for (int i = 0; i < 4; i++) {
        actors a;
        stress s = moving_world(&a);
        double worst_place = 0;
        for (uint32_t n = 1; n <= FRAMES; n++) {
            assert_int_equal(es_world_step(s.world, dts[i]), ES_OK);
            /* n ≤ 2^17 times a float of 24 bits is exact in double */
            double exact = (double)n * (double)dts[i];
            if (es_world_time(s.world) != exact) fail_msg("%u steps of %g s are %.17g s, not %.17g", n, (double)dts[i], es_world_time(s.world), exact);
            if (n % 97) continue;
            double t = fmod(exact, (double)DURATION);
            double x = t < (double)0.9f ? -0.8 + 1.6 * t / (double)0.9f : 0.8 - 1.6 * (t - (double)0.9f) / ((double)DURATION - (double)0.9f);
            es_transform transform;
            assert_int_equal(es_world_get_node_transform(s.world, a.box, &transform), ES_OK);
            worst_place = fmax(worst_place, fabs((double)transform.translation.x - x));
        }
        printf("    %d steps of %g s: %.6g s, the clip within %.1e m\n", FRAMES, (double)dts[i], es_world_time(s.world), worst_place);
        assert_true(worst_place < 1e-6);
        stress_close(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_hundred_thousand_frames),
        cmocka_unit_test(the_clock),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
