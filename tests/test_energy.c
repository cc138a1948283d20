/* Bodies gain no energy that nothing gave them, by the measure of `earthshine soak`; and that measure sees it when they do, and is not
 * misled by what drives them. */
#include "demos/energy_watch.h"
#include "platform/random.h"
#include "tests/rigid_tools.h"

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
#define SMALL 1
#else
#define SMALL 0
#endif

/* Steps and watches; `each` may act on the world before a step. */
static energy_gain watch(arena* a, energy_watch* w, int steps, void (*each)(arena* a, int step, void* user), void* user)
{
    for (int i = 0; i < steps; i++) {
        if (each) each(a, i, user);
        step(a, 1);
        assert_true(energy_watch_step(w, a->world));
    }
    return energy_watch_worst(w);
}

static energy_gain watch_all(arena* a, int steps, void (*each)(arena* a, int step, void* user), void* user)
{
    energy_watch* w = energy_watch_open(a->world);
    assert_non_null(w);
    energy_gain gain = watch(a, w, steps, each, user);
    energy_watch_close(w);
    return gain;
}

static void kick(arena* a, int i, void* user)
{
    const es_body_state s = state_of(a, *(es_body*)user);
    if (i % 90 == 89) assert_int_equal(es_world_apply_impulse(a->world, *(es_body*)user, (es_vec3){0, s.mass * 1.5f, 0}, NULL), ES_OK);
}

static void push(arena* a, int i, void* user)
{
    const es_body_state s = state_of(a, *(es_body*)user);
    assert_int_equal(es_world_apply_force(a->world, *(es_body*)user, (es_vec3){s.mass * 0.02f, 0, 0}, NULL), ES_OK);
}

/* A heap that falls, collides, comes to rest and trembles there, awake. */
static void falling_and_resting(void** unused)
{
    arena a = make_arena(1, 0, false);
    add_floor(&a);
    es_body top = {0};
    for (int i = 0; i < 12; i++) top = add_box(&a, 0.25f, 0.2 * (i % 3), 0.4 + 0.6 * i, 0.15 * (i % 2));
    energy_watch* w = energy_watch_open(a.world);
    assert_non_null(w);
    energy_gain gain = watch(&a, w, 600, NULL, NULL);
    assert_true(gain.judged == 12 * 20 && gain.driven == 0);
    assert_true(gain.joules < gain.allowed);
    /* the same, but it gets something from nowhere */
    gain = watch(&a, w, 600, kick, &top);
    assert_true(gain.joules > gain.allowed);
    energy_watch_close(w);
    free_arena(&a);
}

/* Less in each window than trembling is allowed, and yet always more. */
static void creeping(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    es_body body = add_box(&a, 0.25f, 0, 0, 0);
    energy_gain gain = watch_all(&a, 300, push, &body);
    assert_true(gain.joules < gain.allowed); /* 0.1 m/s: not yet */
    gain = watch_all(&a, 1500, push, &body);
    assert_true(gain.joules > gain.allowed);
    assert_true(gain.id == body.id && gain.kind == ES_OBJECT_BODY);
    free_arena(&a);
}

/* Six walls without friction that give everything back, a metre thick, their middles `middle` metres from the origin. */
static void add_smooth_walls(arena* a, double middle)
{
    for (int k = 0; k < 6; k++) {
        es_shape_desc wall = box_shape(k / 2 == 0 ? 0.5f : 2, k / 2 == 1 ? 0.5f : 2, k / 2 == 2 ? 0.5f : 2);
        wall.restitution = 1;
        wall.friction = 0;
        const double at = k % 2 ? middle : -middle;
        add_body(a, ES_BODY_STATIC, &wall, k / 2 == 0 ? at : 0, k / 2 == 1 ? at : 0, k / 2 == 2 ? at : 0, no_turn);
    }
}

/* Boxes and balls that lose nothing when they bounce, off walls and each other, fast and spinning. */
static void bouncing(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    add_smooth_walls(&a, 1.5);
    double before = 0, after = 0;
    es_body bodies[8];
    for (int i = 0; i < 8; i++) {
        es_shape_desc shape = i % 2 ? box_shape(0.12f, 0.12f, 0.12f) : ball_shape(0.13f);
        shape.restitution = 1;
        shape.friction = 0;
        es_body_desc desc = es_default_body_desc();
        desc.shapes = &shape;
        desc.shape_count = 1;
        desc.continuous = true;
        desc.position[0] = i % 2 - 0.5;
        desc.position[1] = i / 2 % 2 - 0.5;
        desc.position[2] = i / 4 - 0.5;
        desc.velocity = (es_vec3){4 - (float)i, 3.0f - (float)(i * i % 7), 2.0f + (float)(i % 3)};
        desc.angular_velocity = (es_vec3){(float)i, 3, 5 - (float)i};
        assert_int_equal(es_world_add_body(a.world, &desc, &bodies[i]), ES_OK);
        before += (double)state_of(&a, bodies[i]).kinetic_energy;
    }
    const energy_gain gain = watch_all(&a, 600, NULL, NULL);
    assert_int_equal(gain.judged, 8 * 20);
    assert_true(gain.joules < gain.allowed);
    for (int i = 0; i < 8; i++) after += (double)state_of(&a, bodies[i]).kinetic_energy;
    assert_true(after < 1.01 * before && after > 0.5 * before);
    free_arena(&a);
}

/* Three cubes that lose nothing fly at a point where they meet at once, again and again from new places; friction or none. What they have together
 * never rises: not by one of many contacts, and not by many of them. */
static void cubes_that_meet_at_once(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    uint32_t counter = 0;
    double worst = 0;
    int met = 0;
    for (int round = 0; round < (SMALL ? 20 : 400); round++) {
        es_body cubes[3];
        double before = 0;
        for (int i = 0; i < 3; i++) {
            es_shape_desc shape = box_shape(0.12f, 0.12f, 0.12f);
            shape.restitution = 1;
            shape.friction = round % 2 ? 0.5f : 0;
            es_body_desc desc = es_default_body_desc();
            desc.shapes = &shape;
            desc.shape_count = 1;
            float r[9];
            for (int k = 0; k < 9; k++) r[k] = 2 * es_unit_float(es_random_u32(71, counter++)) - 1;
            const double angle = 2.0943951 * i;
            const float x = (float)cos(angle), z = (float)sin(angle);
            desc.position[0] = 0.4 * (double)x + 0.01 * (double)r[0];
            desc.position[1] = 0.04 * (double)r[1];
            desc.position[2] = 0.4 * (double)z + 0.01 * (double)r[2];
            desc.velocity = (es_vec3){-5 * x + 0.3f * r[3], 0.3f * r[4], -5 * z + 0.3f * r[5]};
            if (round % 4 > 1) desc.angular_velocity = (es_vec3){5 * r[6], 5 * r[7], 5 * r[8]};
            assert_int_equal(es_world_add_body(a.world, &desc, &cubes[i]), ES_OK);
            before += (double)state_of(&a, cubes[i]).kinetic_energy;
        }
        for (int i = 0; i < 30; i++) {
            step(&a, 1);
            double now = 0;
            for (int k = 0; k < 3; k++) now += (double)state_of(&a, cubes[k]).kinetic_energy;
            if (now / before - 1 > worst) worst = now / before - 1;
        }
        for (int i = 0; i < 3; i++) {
            const es_body_state s = state_of(&a, cubes[i]);
            met += (double)s.velocity.x * s.centre[0] + (double)s.velocity.z * s.centre[2] > 0;
            assert_int_equal(es_world_destroy_body(a.world, cubes[i]), ES_OK);
        }
    }
    if (worst > 1e-4) fail_msg("they gained %.3g of what they had", worst);
    assert_true(met > (SMALL ? 50 : 1100)); /* and fly apart */
    free_arena(&a);
}

/* Many of them in a box that is too small for them to be apart, for as long as it takes to bounce some thousands of times. */
static void crowd(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    add_smooth_walls(&a, 1.0);
    es_body cubes[8];
    double before = 0, last = 0;
    for (int i = 0; i < 8; i++) {
        es_shape_desc shape = box_shape(0.1f, 0.1f, 0.1f);
        shape.restitution = 1;
        shape.friction = 0;
        es_body_desc desc = es_default_body_desc();
        desc.shapes = &shape;
        desc.shape_count = 1;
        desc.continuous = true;
        for (int k = 0; k < 3; k++) desc.position[k] = (i >> k & 1) ? 0.24 : -0.24;
        desc.velocity = (es_vec3){4 - (float)i, 3.0f - (float)(i * i % 7), 2.0f + (float)(i % 3)};
        desc.angular_velocity = (es_vec3){(float)i, 3, 5 - (float)i};
        assert_int_equal(es_world_add_body(a.world, &desc, &cubes[i]), ES_OK);
        before += (double)state_of(&a, cubes[i]).kinetic_energy;
    }
    energy_watch* w = energy_watch_open(a.world);
    assert_non_null(w);
    double most = 0;
    for (int i = 0; i < (SMALL ? 200 : 2000); i++) {
        step(&a, 1);
        assert_true(energy_watch_step(w, a.world));
        last = 0;
        for (int k = 0; k < 8; k++) last += (double)state_of(&a, cubes[k]).kinetic_energy;
        if (last > most) most = last;
    }
    const energy_gain gain = energy_watch_worst(w);
    assert_int_equal(gain.driven, 0);
    if (gain.joules > 0.001 * gain.allowed) fail_msg("one gained %.3g J of %.3g J", gain.joules, gain.allowed);
    if (most > 1.0001 * before) fail_msg("they gained %.3g of what they had", most / before - 1);
    energy_watch_close(w);
    free_arena(&a);
}

/* ---- driven ------------------------------------------------------------------------------------------------------------------------ */

typedef struct pusher { es_node node; es_body box; } pusher;

/* One metre along x and back in two seconds, for six; then it stands still. */
static void move_pusher(arena* a, int i, void* user)
{
    const pusher* p = user;
    const int t = i < 360 ? i % 120 : 0;
    es_transform transform = {{-1.2f + (t < 60 ? (float)t / 60 : (float)(120 - t) / 60), 0.25f, 0}, {0, 0, 0, 1}, {1, 1, 1}};
    assert_int_equal(es_world_set_node_transform(a->world, p->node, &transform), ES_OK);
}

static void kick_when_it_stands(arena* a, int i, void* user)
{
    pusher* p = user;
    move_pusher(a, 360, user);
    kick(a, i, &p->box);
}

static void pushed_by_what_moves(void** unused)
{
    arena a = make_arena(1, 0, false);
    add_floor(&a);
    pusher p;
    es_node_desc node = {.transform = {{-1.2f, 0.25f, 0}, {0, 0, 0, 1}, {1, 1, 1}}};
    assert_int_equal(es_world_add_node(a.world, &node, &p.node), ES_OK);
    es_shape_desc shape = box_shape(0.25f, 0.25f, 0.25f);
    es_body_desc desc = es_default_body_desc();
    desc.type = ES_BODY_KINEMATIC;
    desc.node = p.node;
    desc.shapes = &shape;
    desc.shape_count = 1;
    es_body mover;
    assert_int_equal(es_world_add_body(a.world, &desc, &mover), ES_OK);
    p.box = add_box(&a, 0.25f, -0.6, 0.25, 0);
    add_box(&a, 0.25f, -0.05, 0.25, 0.1); /* pushed by the box, not by the mover */
    energy_watch* w = energy_watch_open(a.world);
    assert_non_null(w);
    energy_gain gain = watch(&a, w, 480, move_pusher, &p);
    assert_true(gain.driven >= 2 && gain.judged >= 8 && gain.driven + gain.judged == 2 * 16);
    assert_true(gain.joules < gain.allowed);
    gain = watch(&a, w, 300, kick_when_it_stands, &p);
    assert_true(gain.joules > gain.allowed);
    energy_watch_close(w);
    free_arena(&a);
}

static void driven_by_joints_and_hands(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    es_body wheel = add_box(&a, 0.25f, 0, 0, 0), held = add_box(&a, 0.25f, 5, 0, 0), hanging = add_box(&a, 0.25f, 5, -1, 0);
    es_joint_desc motor = es_default_joint_desc(), rod = es_default_joint_desc();
    motor.type = ES_JOINT_HINGE;
    motor.b = wheel;
    motor.motor = true;
    motor.speed = 5;
    motor.max_torque = 100;
    rod.type = ES_JOINT_DISTANCE;
    rod.a = held;
    rod.b = hanging;
    es_joint joint;
    assert_int_equal(es_world_add_joint(a.world, &motor, &joint), ES_OK);
    assert_int_equal(es_world_add_joint(a.world, &rod, &joint), ES_OK);
    assert_int_equal(es_world_grab_body(a.world, 0, held, (es_vec3){0, 0, 0}, (const double[3]){5, 2, 1}, 0), ES_OK);
    energy_gain gain = watch_all(&a, 120, NULL, NULL);
    assert_true(gain.judged == 0 && gain.driven == 3 * 4);
    /* let go, what the hand gave stays */
    assert_int_equal(es_world_release(a.world, 0), ES_OK);
    gain = watch_all(&a, 120, NULL, NULL);
    assert_true(gain.judged == 2 * 4 && gain.driven == 4);
    assert_true(gain.joules < gain.allowed);
    free_arena(&a);
}

/* ---- cloth ------------------------------------------------------------------------------------------------------------------------- */

static es_soft add_cloth(arena* a, float height)
{
    enum { SIDE = 12 };
    float p[3 * SIDE * SIDE];
    uint32_t indices[6 * (SIDE - 1) * (SIDE - 1)], count = 0;
    for (uint32_t j = 0; j < SIDE; j++)
        for (uint32_t i = 0; i < SIDE; i++) {
            const float place[3] = {(float)i / (SIDE - 1) - 0.5f, height, (float)j / (SIDE - 1) - 0.5f};
            memcpy(p + 3 * (j * SIDE + i), place, sizeof place);
            if (i + 1 == SIDE || j + 1 == SIDE) continue;
            const uint32_t c = j * SIDE + i, corners[6] = {c, c + SIDE, c + SIDE + 1, c, c + SIDE + 1, c + 1};
            memcpy(indices + count, corners, sizeof corners);
            count += 6;
        }
    es_soft_desc desc = es_default_soft_desc();
    assert_int_equal(es_world_add_mesh(a->world, &(es_mesh_desc){.name = "sheet", .vertex_count = SIDE * SIDE, .triangle_count = count / 3, .positions = p, .indices = indices}, &desc.mesh), ES_OK);
    es_soft soft;
    assert_int_equal(es_world_add_soft(a->world, &desc, &soft), ES_OK);
    return soft;
}

static void blow_up(arena* a, int i, void* user)
{
    if (i % 60 == 59) assert_int_equal(es_world_soft_impulse(a->world, *(es_soft*)user, ES_SOFT_ALL, (es_vec3){0, 1.5f, 0}), ES_OK);
}

static void cloth_over_a_box(void** unused)
{
    arena a = make_arena(1, 0, false);
    add_floor(&a);
    es_shape_desc light = box_shape(0.25f, 0.25f, 0.25f);
    light.density = 8; /* 1 kg, as the cloth */
    add_body(&a, ES_BODY_DYNAMIC, &light, 0, 0.25, 0, no_turn);
    es_soft cloth = add_cloth(&a, 0.9f);
    energy_gain gain = watch_all(&a, 300, NULL, NULL);
    assert_true(gain.judged == 2 * 10 && gain.driven == 0);
    assert_true(gain.joules < gain.allowed);
    gain = watch_all(&a, 300, blow_up, &cloth);
    assert_true(gain.joules > gain.allowed);
    /* held, it can be swung, and the box it hangs about with it */
    assert_int_equal(es_world_soft_attach(a.world, cloth, &(es_soft_attachment){.vertex = 0, .in_place = true}), ES_OK);
    gain = watch_all(&a, 60, blow_up, &cloth);
    assert_true(gain.judged == 0 && gain.driven == 2 * 2);
    free_arena(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(falling_and_resting),
        cmocka_unit_test(creeping),
        cmocka_unit_test(bouncing),
        cmocka_unit_test(cubes_that_meet_at_once),
        cmocka_unit_test(crowd),
        cmocka_unit_test(pushed_by_what_moves),
        cmocka_unit_test(driven_by_joints_and_hands),
        cmocka_unit_test(cloth_over_a_box),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
