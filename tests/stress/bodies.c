/* Rigid bodies out of the ordinary: mass ratios, bullets, deep overlap, masses and hulls that must be refused, steps of 0, 1e-6 and 1 s, places far
 * from zero, random shapes in random poses. Whatever is accepted stays finite and where it can be. */
#include "tests/rigid_tools.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { SLOWER = 6 };
#else
enum { SLOWER = 1 };
#endif

static es_body_state sound_state(arena* a, es_body body)
{
    es_body_state s;
    assert_int_equal(es_world_get_body(a->world, body, &s), ES_OK);
    for (int k = 0; k < 3; k++) assert_true(isfinite(s.position[k]) && fabs(s.position[k]) < 1e10);
    const float all[] = {s.velocity.x, s.velocity.y, s.velocity.z, s.angular_velocity.x, s.angular_velocity.y, s.angular_velocity.z, s.rotation.x, s.rotation.y, s.rotation.z, s.rotation.w};
    for (size_t k = 0; k < sizeof all / sizeof all[0]; k++) assert_true(isfinite(all[k]));
    float unit = s.rotation.x * s.rotation.x + s.rotation.y * s.rotation.y + s.rotation.z * s.rotation.z + s.rotation.w * s.rotation.w;
    assert_true(fabsf(unit - 1) < 1e-4f);
    return s;
}

static void run(arena* a, int steps)
{
    for (int i = 0; i < steps; i++) assert_int_equal(es_world_step(a->world, 1.0f / 60), ES_OK);
}

static es_body add_ground(arena* a, double y)
{
    es_shape_desc floor = box_shape(50, 1, 50);
    return add_body(a, ES_BODY_STATIC, &floor, 0, y - 1, 0, no_turn);
}

/* 1000 : 1, heavy on light, on three light ones and light on heavy, put there and dropped from half a metre: all stay where they are and come to
 * rest, sunk in by little. */
static void mass_ratios(void** unused)
{
    for (int kind = 0; kind < 6; kind++) {
        arena a = make_arena(1, 0, false);
        add_ground(&a, 0);
        es_shape_desc light = box_shape(0.5f, 0.5f, 0.5f), heavy = light;
        light.density = 10;
        heavy.density = 10000;
        const int below = kind % 3 == 1 ? 3 : 1;
        const bool heavy_on_top = kind % 3 < 2, dropped = kind >= 3;
        es_body bodies[4];
        for (int i = 0; i <= below; i++)
            bodies[i] = add_body(&a, ES_BODY_DYNAMIC, heavy_on_top == (i == below) ? &heavy : &light, 0, i + 0.5 + (dropped && i == below ? 0.5 : 0), 0, no_turn);
        double lowest = 10;
        for (int i = 0; i < 600; i++) {
            run(&a, 1);
            lowest = fmin(lowest, sound_state(&a, bodies[below]).position[1]);
        }
        assert_true(lowest > below + 0.5 - (dropped ? 0.2 : 0.06));
        for (int i = 0; i <= below; i++) {
            es_body_state s = sound_state(&a, bodies[i]);
            assert_true(fabs(s.position[0]) < 0.25 && fabs(s.position[2]) < 0.25 && fabs(s.position[1] - i - 0.5) < 0.06);
            assert_true(length_of(s.velocity) < 0.01);
        }
        free_arena(&a);
    }
}

/* What is light and hits from below throws nothing heavy up: neither has more energy after than before, bouncing or not. */
static void light_below(void** unused)
{
    for (int kind = 0; kind < 4; kind++) {
        arena a = make_arena(1, 0, false);
        set_gravity(&a, 0, -1e-3f, 0);
        es_shape_desc light = ball_shape(0.5f), heavy = light;
        light.density = 1;
        heavy.density = kind % 2 ? 1000 : 50;
        light.restitution = heavy.restitution = kind < 2 ? 0 : 1;
        light.friction = heavy.friction = 0;
        es_body lower = add_body(&a, ES_BODY_DYNAMIC, &light, 0, 0, 0, no_turn), upper = add_body(&a, ES_BODY_DYNAMIC, &heavy, 0, 2, 0, no_turn);
        assert_int_equal(es_world_set_body_velocity(a.world, lower, (es_vec3){0, 8, 0}, (es_vec3){0, 0, 0}), ES_OK);
        run(&a, 60);
        es_body_state l = sound_state(&a, lower), u = sound_state(&a, upper);
        double before = 0.5 * l.mass * 64, after = 0.5 * l.mass * pow(length_of(l.velocity), 2) + 0.5 * u.mass * pow(length_of(u.velocity), 2);
        assert_true(u.velocity.y > 0.01f && u.velocity.y > l.velocity.y - 0.05f); /* they met */
        if (after > before * 1.01) fail_msg("kind %d: %g J of %g J", kind, after, before);
        free_arena(&a);
    }
}

/* Balls of 5 cm at 500 m/s, spinning or not, do not pass a wall of 4 cm. */
static void bullets(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    es_shape_desc wall = box_shape(0.02f, 5, 5), ball = ball_shape(0.05f);
    add_body(&a, ES_BODY_STATIC, &wall, 0, 0, 0, no_turn);
    es_body shot[6];
    for (int i = 0; i < 6; i++) {
        shot[i] = add_body(&a, ES_BODY_DYNAMIC, &ball, -3 - 0.731 * i, -2 + 0.8 * i, 0.3 * i, no_turn);
        assert_int_equal(es_world_set_body_velocity(a.world, shot[i], (es_vec3){500, 0, 0}, (es_vec3){0, 0, 20.0f * (float)i}), ES_OK);
    }
    run(&a, 60);
    for (int i = 0; i < 6; i++) assert_true(sound_state(&a, shot[i]).position[0] < 0); /* none came through */
    free_arena(&a);
}

/* Forty boxes, balls and capsules in one place come apart, without being shot away. */
static void deep_overlap(void** unused)
{
    arena a = make_arena(1, 0, false);
    add_ground(&a, 0);
    es_shape_desc shapes[3] = {box_shape(0.4f, 0.4f, 0.4f), ball_shape(0.4f), box_shape(0.2f, 0.2f, 0.2f)};
    shapes[2].type = ES_SHAPE_CAPSULE;
    shapes[2].radius = 0.3f;
    shapes[2].half_height = 0.3f;
    es_body bodies[40];
    for (int i = 0; i < 40; i++) bodies[i] = add_body(&a, ES_BODY_DYNAMIC, &shapes[i % 3], i < 3 ? 0 : 1e-3 * i, 1, 0, no_turn);
    run(&a, 120);
    for (int i = 0; i < 40; i++) {
        es_body_state s = sound_state(&a, bodies[i]);
        assert_true(fabs(s.position[0]) < 30 && fabs(s.position[2]) < 30 && s.position[1] > -0.1 && s.position[1] < 20);
        assert_true(length_of(s.velocity) < 30);
    }
    free_arena(&a);
}

static void refused(void** unused)
{
    arena a = make_arena(1, 0, false);
    es_shape_desc shape = box_shape(0.5f, 0.5f, 0.5f);
    es_body_desc desc = es_default_body_desc();
    es_body body;
    desc.shapes = &shape;
    desc.shape_count = 1;
    const float masses[] = {-1, NAN, INFINITY, 1e30f};
    for (size_t i = 0; i < sizeof masses / sizeof masses[0]; i++) {
        desc.mass = masses[i];
        assert_int_equal(es_world_add_body(a.world, &desc, &body), ES_INVALID_ARGUMENT);
    }
    desc.mass = 0; /* by density */
    assert_int_equal(es_world_add_body(a.world, &desc, &body), ES_OK);
    assert_true(fabsf(sound_state(&a, body).mass - 1000) < 0.1f);
    desc.shape_count = 0; /* no mass, and nothing to take it from */
    assert_int_not_equal(es_world_add_body(a.world, &desc, &body), ES_OK);
    desc.shape_count = 1;
    shape.density = -5;
    assert_int_equal(es_world_add_body(a.world, &desc, &body), ES_INVALID_ARGUMENT);
    shape = box_shape(0.5f, 0, 0.5f);
    assert_int_equal(es_world_add_body(a.world, &desc, &body), ES_INVALID_ARGUMENT);
    /* hulls without a volume: in a plane, on a line, in one place, with NaN, none at all */
    float points[3 * 12];
    shape.type = ES_SHAPE_HULL;
    shape.points = points;
    for (int kind = 0; kind < 5; kind++) {
        for (int i = 0; i < 12; i++) {
            points[3 * i] = kind == 2 ? 1 : (float)i;
            points[3 * i + 1] = kind == 0 ? (float)(i * i % 7) : 2;
            points[3 * i + 2] = kind == 3 && i == 5 ? NAN : 3;
        }
        shape.point_count = kind == 4 ? 0 : 12;
        assert_int_equal(es_world_add_body(a.world, &desc, &body), ES_INVALID_ARGUMENT);
        assert_true(es_context_message(a.context)[0] != 0);
    }
    run(&a, 10);
    free_arena(&a);
}

/* Whatever the frames' lengths: the same fixed steps. */
static void odd_steps(void** unused)
{
    const float dts[] = {0, 1e-6f, 1, 0.3f, 1.0f / 60};
    for (size_t d = 0; d < sizeof dts / sizeof dts[0]; d++) {
        arena a = make_arena(1, 0, true);
        add_ground(&a, 0);
        es_shape_desc box = box_shape(0.5f, 0.5f, 0.5f);
        es_body bodies[5];
        for (int i = 0; i < 5; i++) bodies[i] = add_body(&a, ES_BODY_DYNAMIC, &box, 0.1 * i, 0.5 + 1.01 * i, 0, no_turn);
        for (int i = 0; i < (dts[d] > 0.1f ? 10 : 120); i++) assert_int_equal(es_world_step(a.world, dts[d]), ES_OK);
        for (int i = 0; i < 5; i++) {
            es_body_state s = sound_state(&a, bodies[i]);
            assert_true(s.position[1] > 0.4 && s.position[1] < 0.6 + 1.01 * i);
            if (dts[d] == 0) assert_true(s.position[1] == 0.5 + 1.01 * i); /* nothing moves */
        }
        assert_int_not_equal(es_world_step(a.world, -1), ES_OK);
        assert_int_not_equal(es_world_step(a.world, NAN), ES_OK);
        free_arena(&a);
    }
}

/* A stack a million kilometres from zero stands like one at zero. */
static void far_away(void** unused)
{
    const double places[] = {0, 1e5, 1e8};
    for (int p = 0; p < 3; p++) {
        arena a = make_arena(1, 0, false);
        es_shape_desc floor = box_shape(50, 1, 50), box = box_shape(0.5f, 0.5f, 0.5f);
        double x = places[p], y = -places[p];
        add_body(&a, ES_BODY_STATIC, &floor, x, y - 1, x, no_turn);
        es_body bodies[8];
        for (int i = 0; i < 8; i++) bodies[i] = add_body(&a, ES_BODY_DYNAMIC, &box, x, y + 0.5 + i, x, no_turn);
        run(&a, 180);
        for (int i = 0; i < 8; i++) {
            es_body_state s = sound_state(&a, bodies[i]);
            assert_true(fabs(s.position[0] - x) < 0.01 && fabs(s.position[2] - x) < 0.01);
            assert_true(fabs(s.position[1] - (y + 0.5 + i)) < 0.03);
        }
        free_arena(&a);
    }
}

static float uniform(uint32_t* s, float low, float high)
{
    *s = *s * 1664525u + 1013904223u;
    return low + (high - low) * (float)(*s >> 8) / 16777216.0f;
}

/* Random shapes of 1 mm to 100 m, rounded or not, random poses and speeds, heaps of them in boxes of meshes and hulls. */
static void random_heaps(void** unused)
{
    uint32_t seed = 2024;
    for (int heap = 0; heap < 12 / SLOWER; heap++) {
        arena a = make_arena(1, 0, heap & 1);
        add_ground(&a, 0);
        float scale = heap % 3 == 0 ? 1 : heap % 3 == 1 ? 0.02f : 20;
        es_body bodies[60];
        for (int i = 0; i < 60; i++) {
            es_shape_desc shape = es_default_shape_desc();
            float points[3 * 16];
            shape.type = (es_shape_type)(i % 4);
            shape.radius = scale * uniform(&seed, 0.05f, 0.5f);
            shape.half_height = scale * uniform(&seed, 0, 0.5f);
            float x = scale * uniform(&seed, 0.05f, 0.5f), y = scale * uniform(&seed, 0.05f, 0.5f), z = scale * uniform(&seed, 0.05f, 0.5f);
            shape.half_extents = (es_vec3){x, y, z};
            if (shape.type == ES_SHAPE_BOX) shape.radius = i % 8 == 1 ? 0.5f * fminf(x, fminf(y, z)) : 0;
            if (shape.type == ES_SHAPE_HULL) {
                shape.radius = i % 8 == 3 ? 0.05f * scale : 0;
                for (int k = 0; k < 48; k++) points[k] = scale * uniform(&seed, -0.5f, 0.5f);
                shape.points = points;
                shape.point_count = 16;
            }
            shape.density = uniform(&seed, 100, 3000);
            shape.restitution = i % 7 == 0 ? 0.9f : 0;
            double px = scale * uniform(&seed, -1, 1), py = scale * uniform(&seed, 0.5f, 5), pz = scale * uniform(&seed, -1, 1);
            es_quat q = {uniform(&seed, -1, 1), uniform(&seed, -1, 1), uniform(&seed, -1, 1), uniform(&seed, 0.1f, 1)};
            bodies[i] = add_body(&a, ES_BODY_DYNAMIC, &shape, px, py, pz, q);
            es_vec3 v = {uniform(&seed, -9, 9), uniform(&seed, -9, 9), uniform(&seed, -9, 9)}, w = {uniform(&seed, -50, 50), uniform(&seed, -50, 50), uniform(&seed, -50, 50)};
            assert_int_equal(es_world_set_body_velocity(a.world, bodies[i], v, w), ES_OK);
        }
        for (int step = 0; step < 240; step++) {
            run(&a, 1);
            if (step % 40 == 0)
                for (int i = 0; i < 60; i++) sound_state(&a, bodies[i]);
        }
        for (int i = 0; i < 60; i++) {
            es_body_state s = sound_state(&a, bodies[i]);
            bool over_the_floor = fabs(s.position[0]) < 45 && fabs(s.position[2]) < 45;
            if (over_the_floor) assert_true(s.position[1] > -0.6 * scale); /* nothing sinks through */
        }
        free_arena(&a);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mass_ratios), cmocka_unit_test(light_below),
        cmocka_unit_test(bullets),
        cmocka_unit_test(deep_overlap),
        cmocka_unit_test(refused),
        cmocka_unit_test(odd_steps),
        cmocka_unit_test(far_away),
        cmocka_unit_test(random_heaps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
