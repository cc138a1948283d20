/* Rigid bodies give the same bits for every number of threads and instruction set, and after saving and restoring; they sleep and wake. */
#include "demos/piles.h"
#include "tests/rigid_tools.h"

#if defined(__SANITIZE_THREAD__)
enum { STEPS = 12, COLUMNS = 3 };
#elif defined(__SANITIZE_ADDRESS__)
enum { STEPS = 30, COLUMNS = 4 };
#else
enum { STEPS = 90, COLUMNS = 5 };
#endif

/* Boxes, balls and capsules in a heap, with a hinge, a rope and a hand: 60 … 150 bodies. */
static void make_heap(arena* a, es_body* held)
{
    add_floor(a);
    es_body last = {0};
    for (int y = 0; y < 6; y++)
        for (int z = 0; z < COLUMNS; z++)
            for (int x = 0; x < COLUMNS; x++) {
                int n = x + 7 * z + 3 * y;
                es_shape_desc shape = n % 3 == 0 ? ball_shape(0.3f) : box_shape(0.25f + 0.02f * (float)(n % 5), 0.3f, 0.2f + 0.03f * (float)(n % 4));
                if (n % 7 == 5) {
                    shape.type = ES_SHAPE_CAPSULE;
                    shape.radius = 0.15f;
                    shape.half_height = 0.3f;
                }
                shape.restitution = n % 4 ? 0 : 0.4f;
                shape.rolling_resistance = n % 3 ? 0 : 0.02f;
                es_body body = add_body(a, ES_BODY_DYNAMIC, &shape, 0.7 * x + 0.05 * y, 0.5 + 0.8 * y, 0.7 * z - 0.03 * y, (es_quat){0.1f * (float)(n % 5), 0.3f, 0.2f, 0.9f});
                if (n % 11 == 4 && last.id) {
                    es_joint_desc joint = es_default_joint_desc();
                    joint.type = n % 2 ? ES_JOINT_DISTANCE : ES_JOINT_BALL;
                    joint.a = last;
                    joint.b = body;
                    joint.position_a = (es_vec3){0.4f, 0.1f, 0};
                    joint.position_b = (es_vec3){-0.4f, 0, 0};
                    es_joint handle;
                    assert_int_equal(es_world_add_joint(a->world, &joint, &handle), ES_OK);
                }
                last = body;
            }
    *held = last;
    assert_int_equal(es_world_grab_body(a->world, 1, last, (es_vec3){0.1f, 0.2f, 0}, (double[]){1, 3, 1}, 0), ES_OK);
}

static void threads_and_instruction_sets_agree(void** unused)
{
    uint64_t expected = 0;
    const uint32_t thread_counts[] = {1, 2, 3};
    for (uint32_t isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() & 1u << isa)) continue;
        for (int t = 0; t < 3; t++) {
            uint32_t threads = thread_counts[t];
            arena a = make_arena(threads, 1u << isa, true);
            es_body held;
            make_heap(&a, &held);
            step(&a, STEPS);
            uint64_t hash = es_world_hash(a.world);
            if (!expected) expected = hash;
            assert_true(hash == expected);
            free_arena(&a);
        }
    }
}

/* Save in the middle, go on, go back, go on: the same. Into a second world that was built alike, too. */
static void restoring_gives_the_same_bits(void** unused)
{
    arena a = make_arena(1, 0, true), b = make_arena(2, 0, true);
    es_body held;
    make_heap(&a, &held);
    make_heap(&b, &held);
    step(&a, STEPS / 2);
    size_t size = 0;
    assert_int_equal(es_world_save(a.world, NULL, &size), ES_OK);
    char* saved = malloc(size);
    assert_int_equal(es_world_save(a.world, saved, &size), ES_OK);
    uint64_t then = es_world_hash(a.world), later[3];
    step(&a, STEPS);
    later[0] = es_world_hash(a.world);
    assert_int_equal(es_world_release(a.world, 1), ES_OK);
    step(&a, 5);
    assert_int_equal(es_world_restore(a.world, saved, size), ES_OK);
    assert_true(es_world_hash(a.world) == then);
    step(&a, STEPS);
    later[1] = es_world_hash(a.world);
    step(&b, 3);
    assert_int_equal(es_world_restore(b.world, saved, size), ES_OK);
    step(&b, STEPS);
    later[2] = es_world_hash(b.world);
    assert_true(later[0] == later[1] && later[0] == later[2]);
    /* one object's part */
    assert_true(es_world_object_hash(a.world, ES_OBJECT_BODY, held.id) == es_world_object_hash(b.world, ES_OBJECT_BODY, held.id));
    step(&b, 1);
    assert_true(es_world_object_hash(a.world, ES_OBJECT_BODY, held.id) != es_world_object_hash(b.world, ES_OBJECT_BODY, held.id));
    free(saved);
    free_arena(&a);
    free_arena(&b);
}

/* However time is cut into frames, the fixed steps are the same. */
static void frames_do_not_matter(void** unused)
{
    double positions[2][3];
    for (int i = 0; i < 2; i++) {
        arena a = make_arena(1, 0, true);
        es_body held;
        make_heap(&a, &held);
        for (int k = 0; k < (i ? 12 : 30); k++) assert_int_equal(es_world_step(a.world, i ? 1.0f / 24 : 1.0f / 60), ES_OK);
        memcpy(positions[i], state_of(&a, held).position, sizeof positions[i]);
        free_arena(&a);
    }
    assert_memory_equal(positions[0], positions[1], sizeof positions[0]);
}

static void what_rests_sleeps_and_wakes_by_touch(void** unused)
{
    arena a = make_arena(1, 0, true);
    add_floor(&a);
    es_body near_by[3], apart = add_box(&a, 0.5f, 10, 0.5, 0);
    for (int i = 0; i < 3; i++) near_by[i] = add_box(&a, 0.5f, 0, 0.5 + i, 0);
    step(&a, 400);
    for (int i = 0; i < 3; i++) assert_true(state_of(&a, near_by[i]).asleep);
    assert_true(state_of(&a, apart).asleep);
    es_body_state lying = state_of(&a, near_by[2]);
    step(&a, 30);
    es_body_state still = state_of(&a, near_by[2]);
    assert_memory_equal(lying.position, still.position, sizeof lying.position);
    /* saved and restored asleep, they go on alike */
    es_body ball_body;
    es_shape_desc ball = ball_shape(0.3f);
    ball_body = add_body(&a, ES_BODY_DYNAMIC, &ball, 0, 4.2, 0, no_turn);
    size_t size = 0;
    assert_int_equal(es_world_save(a.world, NULL, &size), ES_OK);
    char* saved = malloc(size);
    assert_int_equal(es_world_save(a.world, saved, &size), ES_OK);
    step(&a, 35);
    uint64_t hash = es_world_hash(a.world);
    for (int i = 0; i < 3; i++) assert_false(state_of(&a, near_by[i]).asleep); /* all of the stack */
    assert_true(state_of(&a, apart).asleep);
    assert_int_equal(es_world_restore(a.world, saved, size), ES_OK);
    assert_true(state_of(&a, near_by[0]).asleep);
    step(&a, 35);
    assert_true(es_world_hash(a.world) == hash);
    free(saved);
    /* what carries them is gone: they fall */
    step(&a, 400);
    assert_true(state_of(&a, near_by[1]).asleep);
    assert_int_equal(es_world_destroy_body(a.world, near_by[0]), ES_OK);
    assert_false(state_of(&a, near_by[1]).asleep);
    step(&a, 120);
    assert_true(state_of(&a, near_by[1]).position[1] < 0.7);
    assert_int_equal(es_world_apply_impulse(a.world, apart, (es_vec3){2000, 0, 0}, NULL), ES_OK);
    assert_false(state_of(&a, apart).asleep);
    step(&a, 2);
    assert_true(state_of(&a, apart).velocity.x > 0.5f);
    assert_int_equal(es_world_destroy_body(a.world, ball_body), ES_OK);
    free_arena(&a);
}

/* The pyramid of the benchmark stays where it is. */
static void a_pyramid_stands(void** unused)
{
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    const int seconds = 2;
#else
    const int seconds = 20;
#endif
    arena a = make_arena(1, 0, false);
    static es_body boxes[PILE_PYRAMID];
    assert_int_equal(pile_make_pyramid(a.world, boxes), ES_OK);
    step(&a, 60);
    static double from[PILE_PYRAMID][3];
    for (int i = 0; i < PILE_PYRAMID; i++) memcpy(from[i], state_of(&a, boxes[i]).position, sizeof from[i]);
    double most = 0;
    for (int second = 1; second < seconds; second++) {
        step(&a, 60);
        for (int i = 0; i < PILE_PYRAMID; i++) {
            es_body_state s = state_of(&a, boxes[i]);
            double way = 0;
            for (int k = 0; k < 3; k++) way += (s.position[k] - from[i][k]) * (s.position[k] - from[i][k]);
            if (sqrt(way) > most) most = sqrt(way);
        }
    }
    assert_true(most < 0.03);
    free_arena(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(threads_and_instruction_sets_agree),
        cmocka_unit_test(restoring_gives_the_same_bits),
        cmocka_unit_test(frames_do_not_matter),
        cmocka_unit_test(what_rests_sleeps_and_wakes_by_touch),
        cmocka_unit_test(a_pyramid_stands),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
