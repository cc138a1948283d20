/* Joints and hands hold what they should, within what they may. */
#include "tests/rigid_tools.h"

static double distance_between(const arena* a, es_body p, es_body q)
{
    es_body_state s = state_of(a, p), t = state_of(a, q);
    return sqrt(pow(s.position[0] - t.position[0], 2) + pow(s.position[1] - t.position[1], 2) + pow(s.position[2] - t.position[2], 2));
}

static es_joint join(arena* a, es_joint_desc desc, double x, double y, double z)
{
    es_joint joint;
    assert_int_equal(es_world_place_joint(a->world, &desc, (double[]){x, y, z}, no_turn), ES_OK);
    assert_int_equal(es_world_add_joint(a->world, &desc, &joint), ES_OK);
    return joint;
}

/* A bob on a ball joint keeps its distance and its energy, and swings with the period of a physical pendulum. */
static void a_pendulum_swings(void** unused)
{
    arena a = make_arena(1, 0, false);
    es_shape_desc ball = ball_shape(0.1f);
    es_body bob = add_body(&a, ES_BODY_DYNAMIC, &ball, 0.2, -1.9899748742, 0, no_turn); /* 2 m below zero, 0.1 rad aside */
    es_joint_desc desc = es_default_joint_desc();
    desc.b = bob;
    join(&a, desc, 0, 0, 0);
    int crossings = 0;
    double last = 0.2, first_time = 0, last_time = 0;
    for (int i = 1; i <= 900; i++) {
        step(&a, 1);
        es_body_state s = state_of(&a, bob);
        assert_true(fabs(hypot(s.position[0], s.position[1]) - 2) < 0.004);
        if (last > 0 && s.position[0] <= 0) {
            last_time = (i - 1 + last / (last - s.position[0])) / 60;
            if (!crossings++) first_time = last_time;
        }
        last = s.position[0];
    }
    double period = (last_time - first_time) / (crossings - 1), expected = 2 * 3.14159265 * sqrt((2 * 2 + 0.4 * 0.01) / (2 * 9.81)) * (1 + 0.01 / 16);
    assert_true(fabs(period - expected) < 0.01 * expected);
    free_arena(&a);
}

static void a_hinge_turns_within_its_limits(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    es_body wheel = add_box(&a, 0.5f, 0, 0, 0);
    es_joint_desc desc = es_default_joint_desc();
    desc.type = ES_JOINT_HINGE;
    desc.b = wheel;
    desc.motor = true;
    desc.speed = 2;
    desc.max_torque = 1e4f;
    es_joint hinge = join(&a, desc, 0, 0, 0);
    step(&a, 60);
    es_body_state s = state_of(&a, wheel);
    assert_true(fabs(s.angular_velocity.z - 2) < 1e-3 && fabs(s.angular_velocity.x) < 1e-3);
    assert_int_equal(es_world_get_joint(a.world, hinge, &desc), ES_OK);
    desc.limit = true;
    desc.lower = -1;
    desc.upper = 2.5f;
    assert_int_equal(es_world_set_joint(a.world, hinge, &desc), ES_OK);
    step(&a, 60);
    es_joint_state j;
    assert_int_equal(es_world_get_joint_state(a.world, hinge, &j), ES_OK);
    assert_true(fabs(j.value - 2.5f) < 0.02);
    assert_true(length_of(state_of(&a, wheel).angular_velocity) < 0.02);
    desc.speed = -2;
    assert_int_equal(es_world_set_joint(a.world, hinge, &desc), ES_OK);
    step(&a, 180);
    assert_int_equal(es_world_get_joint_state(a.world, hinge, &j), ES_OK);
    assert_true(fabs(j.value + 1) < 0.02);
    s = state_of(&a, wheel);
    assert_true(fabs(s.position[0]) < 1e-3 && fabs(s.position[1]) < 1e-3);
    free_arena(&a);
}

/* A motor that lifts a weight of 1000 kg at 1 m needs 9810 N m. */
static void a_motor_is_as_strong_as_it_says(void** unused)
{
    for (int strong = 0; strong < 2; strong++) {
        arena a = make_arena(1, 0, false);
        es_body arm = add_box(&a, 0.5f, 1, 0, 0);
        es_joint_desc desc = es_default_joint_desc();
        desc.type = ES_JOINT_HINGE;
        desc.b = arm;
        desc.motor = true;
        desc.max_torque = strong ? 10500.0f : 9000.0f;
        join(&a, desc, 0, 0, 0);
        step(&a, 60);
        double y = state_of(&a, arm).position[1];
        if (strong) assert_true(fabs(y) < 0.005);
        else assert_true(y < -0.1);
        free_arena(&a);
    }
}

static void distances_hold_spring_and_end(void** unused)
{
    arena a = make_arena(1, 0, false);
    es_body rod = add_box(&a, 0.1f, 0, -1, 0), spring = add_box(&a, 0.1f, 3, -1, 0), rope = add_box(&a, 0.1f, 6, -1, 0);
    es_joint_desc desc = es_default_joint_desc();
    desc.type = ES_JOINT_DISTANCE;
    es_joint joint;
    desc.b = rod;
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_OK);
    desc.b = spring;
    desc.position_a = (es_vec3){3, 0, 0};
    desc.hertz = 2;
    desc.damping_ratio = 0.5f;
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_OK);
    desc.b = rope;
    desc.position_a = (es_vec3){6, 0, 0};
    desc.hertz = 0;
    desc.limit = true;
    desc.upper = 1.5f;
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_OK);
    step(&a, 300);
    assert_true(fabs(state_of(&a, rod).position[1] + 1) < 0.002);
    assert_true(fabs(state_of(&a, spring).position[1] + 1 + 9.81 / (4 * 3.14159265 * 3.14159265 * 4)) < 0.003); /* g / ω² lower */
    assert_true(fabs(state_of(&a, rope).position[1] + 1.5) < 0.005);
    free_arena(&a);
}

static void a_bridge_of_planks_hangs_and_breaks(void** unused)
{
    arena a = make_arena(1, 0, true);
    es_body planks[8];
    es_joint joints[9];
    es_shape_desc plank = box_shape(0.25f, 0.05f, 0.4f);
    for (int i = 0; i < 8; i++) planks[i] = add_body(&a, ES_BODY_DYNAMIC, &plank, 0.25 + 0.5 * i, 0, 0, no_turn);
    for (int i = 0; i < 9; i++) {
        es_joint_desc desc = es_default_joint_desc();
        desc.type = ES_JOINT_HINGE;
        if (i > 0) desc.a = planks[i - 1];
        if (i < 8) desc.b = planks[i];
        if (i == 4) desc.break_force = 1e5f;
        joints[i] = join(&a, desc, 0.5 * i, 0, 0);
    }
    step(&a, 240);
    for (int i = 0; i < 7; i++) assert_true(fabs(distance_between(&a, planks[i], planks[i + 1]) - 0.5) < 0.03);
    es_joint_state state;
    assert_int_equal(es_world_get_joint_state(a.world, joints[4], &state), ES_OK);
    assert_false(state.broken);
    assert_int_equal(es_world_destroy_body(a.world, planks[0]), ES_WRONG_STATE);
    for (int i = 0; i < 10; i++) {
        es_world_apply_force(a.world, planks[4], (es_vec3){0, -2e6f, 0}, NULL);
        step(&a, 1);
    }
    assert_int_equal(es_world_get_joint_state(a.world, joints[4], &state), ES_OK);
    assert_true(state.broken);
    for (int i = 0; i < 9; i++) assert_int_equal(es_world_destroy_joint(a.world, joints[i]), ES_OK);
    assert_int_equal(es_world_destroy_body(a.world, planks[0]), ES_OK);
    free_arena(&a);
}

static void fixed_things_stay_and_motors_follow(void** unused)
{
    arena a = make_arena(1, 0, false);
    es_body held = add_box(&a, 0.25f, 0, 0, 0), driven = add_box(&a, 0.25f, 5, 0, 0);
    es_joint_desc desc = es_default_joint_desc();
    desc.type = ES_JOINT_FIXED;
    desc.b = held;
    join(&a, desc, -1, 0, 0); /* a metre beside it */
    desc.type = ES_JOINT_MOTOR;
    desc.b = driven;
    desc.velocity = (es_vec3){0, 1, 0};
    desc.max_force = 5000;
    desc.max_torque = 1000;
    join(&a, desc, 5, 0, 0);
    step(&a, 120);
    es_body_state s = state_of(&a, held);
    assert_true(fabs(s.position[1]) < 0.01 && fabs(s.rotation.z) < 0.01);
    assert_true(fabs(state_of(&a, driven).velocity.y - 1) < 0.02);
    free_arena(&a);
}

static void joined_bodies_pass_through_each_other_if_so_told(void** unused)
{
    for (int collide = 0; collide < 2; collide++) {
        arena a = make_arena(1, 0, false);
        set_gravity(&a, 0, 0, 0);
        es_body p = add_box(&a, 0.5f, 0, 0, 0), q = add_box(&a, 0.5f, 0.8, 0, 0);
        es_joint_desc desc = es_default_joint_desc();
        desc.type = ES_JOINT_DISTANCE;
        desc.a = p;
        desc.b = q;
        desc.hertz = 0.2f;
        desc.collide_connected = collide;
        es_joint joint;
        assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_OK);
        step(&a, 60);
        if (collide) assert_true(distance_between(&a, p, q) > 0.9);
        else assert_true(fabs(distance_between(&a, p, q) - 0.8) < 1e-4);
        free_arena(&a);
    }
}

static void hands_carry_and_let_go(void** unused)
{
    arena a = make_arena(1, 0, true);
    add_floor(&a);
    es_body box = add_box(&a, 0.25f, 0, 0.25, 0);
    step(&a, 200);
    assert_true(state_of(&a, box).asleep);
    assert_int_equal(es_world_grab_body(a.world, 0, box, (es_vec3){0, 0.25f, 0}, (double[]){1, 2, 0}, 0), ES_OK);
    step(&a, 120);
    es_body_state s = state_of(&a, box);
    /* it may still swing; what is held is where the hand is */
    double up[3] = {2 * (s.rotation.x * s.rotation.y - s.rotation.z * s.rotation.w), 1 - 2 * (s.rotation.x * s.rotation.x + s.rotation.z * s.rotation.z), 0};
    assert_true(fabs(s.position[0] + 0.25 * up[0] - 1) < 0.05 && fabs(s.position[1] + 0.25 * up[1] - 2) < 0.05);
    es_hand_state hand;
    assert_int_equal(es_world_get_hand(a.world, 0, &hand), ES_OK);
    assert_int_equal(hand.body.id, box.id);
    for (int i = 0; i < 20; i++) { /* a throw */
        assert_int_equal(es_world_move_hand(a.world, 0, (double[]){1 + 0.1 * i, 2, 0}), ES_OK);
        step(&a, 1);
    }
    assert_int_equal(es_world_release(a.world, 0), ES_OK);
    step(&a, 1);
    assert_true(state_of(&a, box).velocity.x > 3);
    assert_int_equal(es_world_grab_body(a.world, ES_HANDS, box, (es_vec3){0}, (double[3]){0}, 0), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_grab_body(a.world, 0, box, (es_vec3){0}, (double[3]){NAN, 0, 0}, 0), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_grab_body(a.world, 0, box, (es_vec3){0}, (double[3]){0, 1, 0}, 0), ES_OK);
    assert_int_equal(es_world_destroy_body(a.world, box), ES_OK); /* the hand is empty then */
    assert_int_equal(es_world_get_hand(a.world, 0, &hand), ES_OK);
    assert_int_equal(hand.body.id, 0);
    free_arena(&a);
}

static void senseless_joints_are_refused(void** unused)
{
    arena a = make_arena(1, 0, false);
    es_body floor = add_floor(&a), box = add_box(&a, 0.5f, 0, 3, 0);
    es_joint joint;
    es_joint_desc good = es_default_joint_desc(), desc;
    good.a = floor;
    good.b = box;
    desc = good;
    desc.a = box;
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_INVALID_ARGUMENT);
    desc = good;
    desc.b = (es_body){0};
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_INVALID_ARGUMENT);
    desc = good;
    desc.hertz = NAN;
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_INVALID_ARGUMENT);
    desc = good;
    desc.limit = true;
    desc.lower = 1;
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_INVALID_ARGUMENT);
    desc = good;
    desc.max_force = -1;
    assert_int_equal(es_world_add_joint(a.world, &desc, &joint), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_destroy_joint(a.world, joint), ES_STALE_HANDLE);
    free_arena(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pendulum_swings),
        cmocka_unit_test(a_hinge_turns_within_its_limits),
        cmocka_unit_test(a_motor_is_as_strong_as_it_says),
        cmocka_unit_test(distances_hold_spring_and_end),
        cmocka_unit_test(a_bridge_of_planks_hangs_and_breaks),
        cmocka_unit_test(fixed_things_stay_and_motors_follow),
        cmocka_unit_test(joined_bodies_pass_through_each_other_if_so_told),
        cmocka_unit_test(hands_carry_and_let_go),
        cmocka_unit_test(senseless_joints_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
