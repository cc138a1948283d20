/* Every scene that moves by itself, recorded by one thread of scalar code and replayed by three threads of the best; and gone through again
 * from a state saved on the way. With --steps N it does so for N steps. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sim/sim.h"

#if defined __SANITIZE_THREAD__
static uint32_t step_count = 3;
#elif defined __SANITIZE_ADDRESS__
static uint32_t step_count = 12;
#else
static uint32_t step_count = 45;
#endif

static es_context* open_context(uint32_t threads, uint32_t isa_mask)
{
    es_context* context;
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.isa_mask = isa_mask;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static es_world* open_scene(es_context* context, const char* scene)
{
    es_world* world;
    es_world_settings settings = es_default_world_settings();
    settings.triangles = 2500;
    assert_int_equal(es_world_create_scene(context, scene, &settings, &world), ES_OK);
    return world;
}

/* Steps of a frame's length and of others. */
static float dt_of(uint32_t step) { return step % 5 == 4 ? 0.011f : 1.0f / 60; }

static void replay_scene(const char* scene)
{
    const char* path = "replay-test.es";
    es_context *first = open_context(1, 1u << ES_ISA_SCALAR), *second = open_context(3, 0);
    es_world *world = open_scene(first, scene), *other = open_scene(second, scene);
    es_recording* recording;
    assert_int_equal(es_recording_begin(world, scene, NULL, &recording), ES_OK);
    char* saved = NULL;
    size_t size = 0;
    for (uint32_t step = 0; step < step_count; step++) {
        if (step == step_count / 2) {
            assert_int_equal(es_world_save(world, NULL, &size), ES_OK);
            saved = malloc(size);
            assert_int_equal(es_world_save(world, saved, &size), ES_OK);
        }
        assert_int_equal(es_world_step(world, dt_of(step)), ES_OK);
    }
    const uint64_t end = es_world_hash(world);
    es_recording_end(recording);
    assert_int_equal(es_recording_save(recording, path), ES_OK);
    es_recording_destroy(recording);

    assert_int_equal(es_recording_load(second, path, &recording), ES_OK);
    assert_int_equal(es_recording_rewind(recording, other), ES_OK);
    for (uint32_t step = 0; step < step_count; step++) {
        es_divergence divergence;
        assert_int_equal(es_recording_replay(recording, step, other, &divergence), ES_OK);
        if (divergence.differs) fail_msg("%s: step %u differs, first in an object of kind %d, handle %08x", scene, step, (int)divergence.kind, divergence.id);
    }
    assert_true(es_world_hash(other) == end);
    es_recording_destroy(recording);
    remove(path);

    /* back to the middle, in the world that has been on and in the one that replayed */
    assert_int_equal(es_world_restore(world, saved, size), ES_OK);
    assert_int_equal(es_world_restore(other, saved, size), ES_OK);
    for (uint32_t step = step_count / 2; step < step_count; step++) {
        assert_int_equal(es_world_step(world, dt_of(step)), ES_OK);
        assert_int_equal(es_world_step(other, dt_of(step)), ES_OK);
    }
    assert_true(es_world_hash(world) == end);
    assert_true(es_world_hash(other) == end);
    free(saved);
    es_world_destroy(world);
    es_world_destroy(other);
    es_context_destroy(first);
    es_context_destroy(second);
}

static void test_every_scene_replays_to_the_same_bits(void** state)
{
    (void)state;
    for (size_t i = 0; i < es_scene_count(); i++) {
        const char* scene = es_scene_name(i);
#if defined __SANITIZE_THREAD__
        if (strcmp(scene, "cornell-stack") != 0 && strcmp(scene, "curtain") != 0) continue;
#endif
        replay_scene(scene);
    }
}

int main(int argc, char** argv)
{
    if (argc == 3 && strcmp(argv[1], "--steps") == 0) step_count = (uint32_t)strtoul(argv[2], NULL, 10);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_scene_replays_to_the_same_bits)};
    return cmocka_run_group_tests(tests, NULL, NULL); /* the second context has several threads: threads = 3 */
}
