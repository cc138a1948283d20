/* Time and movers: fixed steps are counted the same however time is cut, formulas give their analytic poses, a flicker keeps its bounds
 * and its seed, an aim looks where it should whatever its parents do, and all of it survives saving and restoring. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "platform/maths.h"
#include "sim/dynamics.h"

static es_world* open_world(es_context** context)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    es_world* world;
    assert_int_equal(es_context_create(&desc, context), ES_OK);
    assert_int_equal(es_world_create(*context, NULL, &world), ES_OK);
    return world;
}

static void close_world(es_context* context, es_world* world)
{
    es_world_destroy(world);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static es_node add_node(es_world* world, es_node parent, es_transform transform)
{
    es_node node;
    assert_int_equal(es_world_add_node(world, &(es_node_desc){.parent = parent, .transform = transform}, &node), ES_OK);
    return node;
}

static es_mover add_mover(es_world* world, const es_mover_desc* desc)
{
    es_mover mover;
    assert_int_equal(es_world_add_mover(world, desc, &mover), ES_OK);
    return mover;
}

static void assert_near(es_vec3 a, es_vec3 b, float within)
{
    assert_true(fabsf(a.x - b.x) <= within && fabsf(a.y - b.y) <= within && fabsf(a.z - b.z) <= within);
}

static es_vec3 place_of(es_world* world, es_node node)
{
    es_mat4 m;
    assert_int_equal(es_world_get_node_matrix(world, node, &m), ES_OK);
    return es_v3(m.m[12], m.m[13], m.m[14]);
}

static void test_orbit_and_swing_are_where_the_formula_says(void** state)
{
    (void)state;
    es_context* context;
    es_world* world = open_world(&context);
    es_node orbiting = add_node(world, (es_node){0}, es_identity_transform()), swinging = add_node(world, (es_node){0}, es_identity_transform());
    es_mover_desc orbit = es_default_mover_desc();
    orbit.node = orbiting;
    orbit.centre = es_v3(1, 2, 3);
    orbit.arm = es_v3(2, 0, 0);
    orbit.period = 4;
    add_mover(world, &orbit);
    es_mover_desc swing = es_default_mover_desc();
    swing.type = ES_MOVER_SWING;
    swing.node = swinging;
    swing.arm = es_v3(0, -1, 0);
    swing.axis = es_v3(0, 0, 2);
    swing.period = 2;
    swing.amplitude = 0.5f;
    add_mover(world, &swing);
    for (int frame = 1; frame <= 40; frame++) {
        assert_int_equal(es_world_step(world, 0.125f), ES_OK);
        double t = 0.125 * frame, a = 2 * 3.14159265358979 * t / 4, b = 0.5 * sin(2 * 3.14159265358979 * t / 2);
        assert_near(place_of(world, orbiting), es_v3((float)(1 + 2 * cos(a)), 2, (float)(3 - 2 * sin(a))), 2e-6f);
        assert_near(place_of(world, swinging), es_v3((float)sin(b), (float)-cos(b), 0), 1e-6f);
    }
    /* an hour later it is as exact */
    for (int k = 0; k < 360; k++) assert_int_equal(es_world_step(world, 10), ES_OK);
    double a = 2 * 3.14159265358979 * (5.0 + 3600) / 4;
    assert_near(place_of(world, orbiting), es_v3((float)(1 + 2 * cos(a)), 2, (float)(3 - 2 * sin(a))), 2e-6f);
    close_world(context, world);
}

static void test_aim_looks_at_its_target_through_turned_parents(void** state)
{
    (void)state;
    es_context* context;
    es_world* world = open_world(&context);
    es_transform turned = {{1, 0, 2}, es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), 1.2f), es_quat_from_axis_angle(es_v3(1, 0, 0), -0.7f)), {1, 1, 1}};
    es_node parent = add_node(world, (es_node){0}, turned);
    es_node child = add_node(world, parent, (es_transform){{0.5f, 1, 0}, {0, 0, 0, 1}, {1, 1, 1}});
    es_node target = add_node(world, (es_node){0}, (es_transform){{-3, 4, -1}, {0, 0, 0, 1}, {1, 1, 1}});
    es_mover_desc orbit = es_default_mover_desc();
    orbit.node = target;
    orbit.arm = es_v3(3, 1, 0);
    orbit.period = 3;
    es_mover_desc aim = {.type = ES_MOVER_AIM, .node = child, .target = target};
    add_mover(world, &aim);
    add_mover(world, &orbit);
    for (int frame = 0; frame < 30; frame++) {
        assert_int_equal(es_world_step(world, 0.1f), ES_OK);
        es_mat4 m;
        es_world_get_node_matrix(world, child, &m);
        es_vec3 wanted = es_v3_normalize(es_v3_sub(place_of(world, target), place_of(world, child)), es_v3(0, 0, 0));
        assert_near(es_v3(-m.m[8], -m.m[9], -m.m[10]), wanted, 2e-6f);
        assert_true(fabsf(m.m[1]) < 2e-6f); /* x is level */
    }
    close_world(context, world);
}

static float flicker_of(uint32_t seed, int frame)
{
    es_context* context;
    es_world* world = open_world(&context);
    es_light light;
    es_light_desc lamp = es_default_light_desc();
    lamp.type = ES_LIGHT_POINT;
    lamp.intensity = 10;
    assert_int_equal(es_world_add_light(world, &lamp, &light), ES_OK);
    add_mover(world, &(es_mover_desc){.type = ES_MOVER_FLICKER, .light = light, .period = 0.25f, .amplitude = 0.4f, .seed = seed});
    float least = 1e9f, most = 0, last = 10, now = 0, jump = 0;
    for (int k = 0; k < frame; k++) {
        assert_int_equal(es_world_step(world, 1.0f / 60), ES_OK);
        size_t count;
        now = es_world_lights(world, &count)->radiant[0];
        assert_int_equal(count, 1);
        least = fminf(least, now);
        most = fmaxf(most, now);
        if (k) jump = fmaxf(jump, fabsf(now - last));
        last = now;
    }
    if (frame > 200) {
        assert_true(least >= 6 && most <= 10 && most - least > 1.5f);
        assert_true(jump < 2 && jump > 0); /* smooth: no frame jumps by half the range */
    }
    es_light_desc kept;
    es_world_get_light(world, light, &kept);
    assert_true(kept.intensity == 10);
    close_world(context, world);
    return now;
}

static void test_flicker_keeps_its_bounds_and_its_seed(void** state)
{
    (void)state;
    assert_true(flicker_of(1, 400) == flicker_of(1, 400));
    assert_true(flicker_of(1, 50) != flicker_of(2, 50));
}

static void test_fixed_steps_do_not_depend_on_the_frames(void** state)
{
    (void)state;
    es_context* context;
    es_world* world = open_world(&context);
    for (int frame = 1; frame <= 600; frame++) {
        assert_int_equal(es_world_step(world, 1.0f / 60), ES_OK);
        assert_int_equal(world->fixed_count, frame); /* one each: rounding makes no step more or less */
        assert_true(es_step_phase(world) == 1.0f);
    }
    es_world_settings slow = es_world_get_settings(world);
    slow.speed = 0.25f;
    assert_int_equal(es_world_configure(world, &slow), ES_OK);
    for (int frame = 1; frame <= 8; frame++) {
        assert_int_equal(es_world_step(world, 1.0f / 60), ES_OK);
        assert_int_equal(world->fixed_count, 600 + (frame + 3) / 4);
        float wanted = frame % 4 ? 0.25f * (float)(frame % 4) : 1.0f;
        assert_true(fabsf(es_step_phase(world) - wanted) < 1e-4f);
    }
    slow.step = 0.01f;
    double before = es_fixed_time(world);
    assert_int_equal(es_world_configure(world, &slow), ES_OK);
    assert_true(es_fixed_time(world) == before);
    slow.step = 0;
    assert_int_equal(es_world_configure(world, &slow), ES_SETTING_VALUE);
    assert_true(es_world_get_settings(world).step == 0.01f);
    close_world(context, world);
}

static void test_saved_movers_and_settings_come_back(void** state)
{
    (void)state;
    es_context* context;
    es_world* world = open_world(&context);
    es_node node = add_node(world, (es_node){0}, es_identity_transform());
    es_mover_desc orbit = es_default_mover_desc();
    orbit.node = node;
    orbit.arm = es_v3(1, 0, 0);
    es_mover mover = add_mover(world, &orbit);
    assert_int_equal(es_world_step(world, 0.3f), ES_OK);
    char saved[4096];
    size_t size = sizeof saved;
    assert_int_equal(es_world_save(world, saved, &size), ES_OK);
    uint64_t hash = es_world_hash(world);
    orbit.period = 7;
    assert_int_equal(es_world_set_mover(world, mover, &orbit), ES_OK);
    es_world_settings settings = es_world_get_settings(world);
    settings.speed = 3;
    settings.gravity = es_v3(0, 0, 0);
    assert_int_equal(es_world_configure(world, &settings), ES_OK);
    assert_int_equal(es_world_step(world, 0.3f), ES_OK);
    assert_true(es_world_hash(world) != hash);
    assert_int_equal(es_world_restore(world, saved, size), ES_OK);
    assert_true(es_world_hash(world) == hash);
    assert_true(es_world_get_settings(world).speed == 1 && es_world_get_settings(world).gravity.y == -9.81f);
    assert_int_equal(es_world_get_mover(world, mover, &orbit), ES_OK);
    assert_true(orbit.period == 1);
    close_world(context, world);
}

static void test_wrong_movers_are_refused(void** state)
{
    (void)state;
    es_context* context;
    es_world* world = open_world(&context);
    es_node node = add_node(world, (es_node){0}, es_identity_transform());
    es_mover mover;
    es_mover_desc good = es_default_mover_desc(), bad;
    good.node = node;
    bad = good, bad.period = -1;
    assert_int_equal(es_world_add_mover(world, &bad, &mover), ES_INVALID_ARGUMENT);
    bad = good, bad.axis.x = NAN;
    assert_int_equal(es_world_add_mover(world, &bad, &mover), ES_INVALID_ARGUMENT);
    bad = good, bad.type = (es_mover_type)9;
    assert_int_equal(es_world_add_mover(world, &bad, &mover), ES_INVALID_ARGUMENT);
    bad = good, bad.type = ES_MOVER_FLICKER;
    assert_int_equal(es_world_add_mover(world, &bad, &mover), ES_STALE_HANDLE);
    assert_int_equal(es_world_add_mover(world, &good, &mover), ES_OK);
    assert_int_equal(es_world_destroy_node(world, node), ES_WRONG_STATE); /* it is in use */
    assert_int_equal(es_world_destroy_mover(world, mover), ES_OK);
    assert_int_equal(es_world_destroy_node(world, node), ES_OK);
    close_world(context, world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_orbit_and_swing_are_where_the_formula_says), cmocka_unit_test(test_aim_looks_at_its_target_through_turned_parents),
        cmocka_unit_test(test_flicker_keeps_its_bounds_and_its_seed),      cmocka_unit_test(test_fixed_steps_do_not_depend_on_the_frames),
        cmocka_unit_test(test_saved_movers_and_settings_come_back),        cmocka_unit_test(test_wrong_movers_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
