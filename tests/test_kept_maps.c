/* Maps that are kept between frames, in part or whole: the bits of frames drawn from nothing, for less. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/small_worlds.h"

enum { VPLS = 48, FRAMES = 44, POINTS = 512 };

typedef struct stage { small_world w; es_node ball, lamp, eye; es_light light; es_instance plate; } stage;

static stage open_stage(uint32_t workers)
{
    stage s = {0};
    es_context_desc context_desc = es_default_context_desc();
    context_desc.threads = workers;
    assert_int_equal(es_context_create(&context_desc, &s.w.context), ES_OK);
    assert_int_equal(es_world_create(s.w.context, NULL, &s.w.world), ES_OK);
    es_material_desc grey = lambert(0.7f, 0);
    add_rectangle(&s.w, es_v3(-2, 0, -2), es_v3(0, 0, 4), es_v3(4, 0, 0), &grey);
    add_rectangle(&s.w, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 3, 0), &grey);
    add_rectangle(&s.w, es_v3(-1.5f, 0.4f, -1), es_v3(0, 0, 0.6f), es_v3(0.7f, 0, 0), &grey);
    add_sphere(&s.w, es_v3(0, 0, 0), 0.4f, 6, false, &grey);
    uint32_t ids[8];
    size_t count = 8;
    assert_int_equal(es_world_enumerate(s.w.world, ES_OBJECT_INSTANCE, ids, &count), ES_OK);
    s.plate = (es_instance){ids[2]};
    es_instance_desc ball;
    es_node_desc node = {.transform = {es_v3(0, 0.6f, 0.4f), es_quat_identity(), es_v3(1, 1, 1)}};
    assert_int_equal(es_world_add_node(s.w.world, &node, &s.ball), ES_OK);
    assert_int_equal(es_world_get_instance(s.w.world, (es_instance){ids[3]}, &ball), ES_OK);
    ball.node = s.ball;
    assert_int_equal(es_world_set_instance(s.w.world, (es_instance){ids[3]}, &ball), ES_OK);
    es_light_desc light = es_default_light_desc();
    light.intensity = 12;
    light.node = s.lamp = node_towards(&s.w, es_v3(0.2f, 2.4f, 1.5f), es_v3(-0.1f, -1, -0.6f));
    assert_int_equal(es_world_add_light(s.w.world, &light, &s.light), ES_OK);
    es_camera_desc camera = es_default_camera_desc();
    look(&s.w, camera, es_v3(1.6f, 1.6f, 3.4f), es_v3(-0.2f, 0.5f, -0.5f));
    assert_int_equal(es_world_get_camera(s.w.world, s.w.camera, &camera), ES_OK);
    s.eye = camera.node;
    return s;
}

static void set_position(stage* s, es_node node, es_vec3 at)
{
    es_transform t;
    assert_int_equal(es_world_get_node_transform(s->w.world, node, &t), ES_OK);
    t.translation = at;
    assert_int_equal(es_world_set_node_transform(s->w.world, node, &t), ES_OK);
}

/* The ball moves, rests long, moves again; the light changes its colour, moves, rests; the plate is weighted anew, hidden, shown; the ball
 * leaves the others' bounds; the camera turns. */
static void script(stage* s, int frame)
{
    if (frame < 10 || (frame >= 24 && frame < 34)) set_position(s, s->ball, es_v3(0.02f * (float)frame, 0.6f, 0.4f));
    if (frame == 13) {
        es_light_desc light;
        assert_int_equal(es_world_get_light(s->w.world, s->light, &light), ES_OK);
        light.color[2] = 0.5f;
        assert_int_equal(es_world_set_light(s->w.world, s->light, &light), ES_OK);
    }
    if (frame >= 15 && frame < 17) set_position(s, s->lamp, es_v3(0.2f + 0.05f * (float)(frame - 14), 2.4f, 1.5f));
    es_instance_desc plate;
    assert_int_equal(es_world_get_instance(s->w.world, s->plate, &plate), ES_OK);
    plate.hidden = frame >= 28 && frame < 30;
    plate.point_weight = frame >= 36 ? 3 : 0;
    assert_int_equal(es_world_set_instance(s->w.world, s->plate, &plate), ES_OK);
    if (frame == 38) set_position(s, s->ball, es_v3(0.3f, 3.2f, 0.4f));
    if (frame == 41) set_position(s, s->eye, es_v3(1.4f, 1.6f, 3.4f));
    assert_int_equal(es_world_step(s->w.world, 1.0f / 30), ES_OK);
}

static es_renderer_settings settings_of(bool skip, bool stable)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = 64;
    s.height = 48;
    s.vpls = VPLS;
    s.interleave = 4;
    s.light_size = s.shadow_size = 64;
    s.ism_size = 32;
    s.ism_points = POINTS;
    s.ism_pool = 4096;
    s.view_importance = false;
    s.stable_vpls = stable;
    s.skip = skip;
    return s;
}

static uint64_t hash_of(stage* s, es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    uint64_t hash = es_image_hash(&image);
    es_image_destroy(s->w.context, &image);
    return hash;
}

static const es_pass_stats* pass_of(const es_renderer* renderer, const char* name)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t p = 0; p < stats->pass_count; p++)
        if (strcmp(stats->passes[p].name, name) == 0) return &stats->passes[p];
    fail();
    return NULL;
}

typedef struct frames { uint64_t ism[FRAMES], indirect[FRAMES], count[FRAMES]; bool skipped[FRAMES]; } frames;

/* `fresh`: a renderer of its own for each frame */
static void run(frames* f, uint32_t workers, bool skip, bool stable, uint32_t kept, bool fresh)
{
    stage s = open_stage(workers);
    es_renderer_settings settings = settings_of(skip, stable);
    settings.ism_kept = kept;
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(s.w.context, &settings, &renderer), ES_OK);
    for (int frame = 0; frame < FRAMES; frame++) {
        script(&s, frame);
        if (fresh) {
            es_renderer_destroy(renderer);
            assert_int_equal(es_renderer_create(s.w.context, &settings, &renderer), ES_OK);
        }
        assert_int_equal(es_renderer_render(renderer, s.w.world), ES_OK);
        f->ism[frame] = hash_of(&s, renderer, "ism");
        f->indirect[frame] = hash_of(&s, renderer, "indirect");
        f->count[frame] = pass_of(renderer, "imperfect shadow maps")->count;
        f->skipped[frame] = pass_of(renderer, "imperfect shadow maps")->skipped != NULL;
    }
    es_renderer_destroy(renderer);
    small_world_destroy(&s.w);
}

static void compare(const frames* a, const frames* b, const char* what)
{
    for (int frame = 0; frame < FRAMES; frame++) {
        if (a->ism[frame] != b->ism[frame]) fail_msg("%s: maps differ in frame %d", what, frame);
        if (a->indirect[frame] != b->indirect[frame]) fail_msg("%s: light differs in frame %d", what, frame);
    }
}

static void test_kept_maps_have_the_same_bits(void** state)
{
    (void)state;
    static frames kept, other;
    for (int stable = 0; stable < 2; stable++) {
        run(&kept, 3, true, stable, 64, false);
        run(&other, 3, false, stable, 64, false);
        compare(&kept, &other, "drawn from nothing");
        for (int frame = 0; frame < FRAMES; frame++) assert_int_equal(other.count[frame], VPLS * POINTS);
#if !defined(__SANITIZE_THREAD__) /* the same passes again */
        run(&other, 1, true, stable, 64, false);
        compare(&kept, &other, "one thread");
        run(&other, 3, true, stable, 0, false);
        compare(&kept, &other, "no layers");
        if (!stable) {
            run(&other, 3, true, false, 64, true);
            compare(&kept, &other, "each frame alone");
        }
#endif
        /* while the ball moves, its points and what sits on it are drawn; at rest, nothing is, though the light changes its colour */
        const uint64_t all = VPLS * POINTS;
        for (int frame = 4; frame < 10; frame++)
            if (stable && !(kept.count[frame] < all / 2)) fail_msg("frame %d: %u of %u points drawn", frame, (unsigned)kept.count[frame], (unsigned)all);
        for (int frame = 20; frame < 24; frame++) assert_true(kept.skipped[frame]);
        assert_true(kept.skipped[11] && kept.skipped[13]);
    }
}

/* A ball beside the lamp's cone: the lamp's views stand. With a second lamp that shines all around, the faces that see the ball are drawn, and no
 * others. The same bits as when all are. */
static void test_views_of_lights_stand(void** state)
{
    (void)state;
    stage s = open_stage(2);
    es_renderer_settings settings[2] = {settings_of(true, true), settings_of(false, true)};
    es_renderer* renderers[2];
    for (int i = 0; i < 2; i++) assert_int_equal(es_renderer_create(s.w.context, &settings[i], &renderers[i]), ES_OK);
    for (int frame = 0; frame < 16; frame++) {
        set_position(&s, s.ball, es_v3(1.5f - 0.01f * (float)frame, 2.5f, 1.5f));
        if (frame == 8) {
            es_light_desc light = es_default_light_desc();
            light.type = ES_LIGHT_POINT;
            light.node = node_towards(&s.w, es_v3(-1, 2, 0), es_v3(0, 0, -1));
            es_light added;
            assert_int_equal(es_world_add_light(s.w.world, &light, &added), ES_OK);
        }
        assert_int_equal(es_world_step(s.w.world, 1.0f / 30), ES_OK);
        for (int i = 0; i < 2; i++) assert_int_equal(es_renderer_render(renderers[i], s.w.world), ES_OK);
        if (hash_of(&s, renderers[0], "radiance") != hash_of(&s, renderers[1], "radiance")) fail_msg("frame %d: another picture than when all is drawn", frame);
        static const char* const names[] = {"shadow maps", "light views"};
        for (int k = 0; k < 2; k++) {
            const es_pass_stats *kept = pass_of(renderers[0], names[k]), *all = pass_of(renderers[1], names[k]);
            assert_true(!all->skipped && all->count > 0);
            if (frame > 2 && frame < 8) assert_true(kept->skipped && kept->count == 0);
            if (frame > 10 && !(!kept->skipped && kept->count > 0 && kept->count < all->count))
                fail_msg("frame %d: %u of %u triangles in the %s", frame, (unsigned)kept->count, (unsigned)all->count, names[k]);
        }
    }
    for (int i = 0; i < 2; i++) es_renderer_destroy(renderers[i]);
    small_world_destroy(&s.w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_kept_maps_have_the_same_bits), cmocka_unit_test(test_views_of_lights_stand)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
