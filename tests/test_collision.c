/* Contact of convex shapes: against cases worked out by hand, and against separations found by trying every axis in double. */
#include "tests/collision_tools.h"

static uint32_t collide(const es_rigid_shape* a, es_pose pa, const es_rigid_shape* b, es_pose pb, float margin, es_manifold* m)
{
    return es_rigid_collide(a, &pa, b, &pb, margin, m, 1);
}

static void boxes_by_hand(void** state)
{
    fixture* f = *state;
    es_rigid_shape a = make(f, box_desc(1, 1, 1)), b = make(f, box_desc(0.5f, 0.5f, 0.5f));
    es_manifold m;

    /* on top, 1 cm deep: the four lower corners */
    assert_int_equal(collide(&a, pose_at(0, 0, 0), &b, pose_at(0.2f, 1.49f, 0), 0, &m), 1);
    assert_int_equal(m.count, 4);
    assert_true(m.normal.y > 0.99999f);
    for (uint32_t i = 0; i < 4; i++) {
        assert_float_equal(m.points[i].separation, -0.01f, 1e-6f);
        assert_float_equal(m.points[i].point.y, 0.995f, 1e-6f);
        assert_float_equal(fabsf(m.points[i].point.x - 0.2f), 0.5f, 1e-6f);
        assert_float_equal(fabsf(m.points[i].point.z), 0.5f, 1e-6f);
        for (uint32_t k = 0; k < i; k++) assert_int_not_equal(m.points[i].id, m.points[k].id);
    }
    /* the same ids after a small move */
    es_manifold later;
    assert_int_equal(collide(&a, pose_at(0, 0, 0), &b, pose_at(0.21f, 1.492f, 0.01f), 0, &later), 1);
    for (uint32_t i = 0; i < 4; i++) assert_int_equal(m.points[i].id, later.points[i].id);
    /* half over the edge: the part over it counts */
    assert_int_equal(collide(&a, pose_at(0, 0, 0), &b, pose_at(1, 1.49f, 0), 0, &m), 1);
    assert_int_equal(m.count, 4);
    for (uint32_t i = 0; i < 4; i++) assert_true(fabsf(m.points[i].point.x - 0.5f) < 1e-5f || fabsf(m.points[i].point.x - 1) < 1e-5f);
    /* apart by less and by more than the margin */
    assert_int_equal(collide(&a, pose_at(0, 0, 0), &b, pose_at(0, 1.52f, 0), 0.03f, &m), 1);
    assert_float_equal(m.points[0].separation, 0.02f, 1e-6f);
    assert_int_equal(collide(&a, pose_at(0, 0, 0), &b, pose_at(0, 1.52f, 0), 0.01f, &m), 0);
    assert_int_equal(collide(&a, pose_at(0, 0, 0), &b, pose_at(0, 1.52f, 0), 0.03f, &m), 1);
    assert_int_equal(es_rigid_collide(&a, &(es_pose){{0, 0, 0}, {0, 0, 0, 1}}, &b, &(es_pose){{0, 1.4f, 0}, {0, 0, 0, 1}}, 0, &m, 0), 0);

    /* two edges across: a cube on its edge along x under one on its edge along z */
    es_pose under = {{0, 0, 0}, es_quat_from_axis_angle(es_v3(1, 0, 0), ES_PI / 4)}, over = {{0, 1.4142135f + 0.7071068f - 0.01f, 0}, es_quat_from_axis_angle(es_v3(0, 0, 1), ES_PI / 4)};
    assert_int_equal(es_rigid_collide(&a, &under, &b, &over, 0, &m, 1), 1);
    assert_int_equal(m.count, 1);
    assert_float_equal(m.points[0].separation, -0.01f, 2e-6f);
    assert_float_equal(m.points[0].point.y, 1.4142135f - 0.005f, 2e-6f);
    assert_true(m.normal.y > 0.99999f);

    /* a corner on a face */
    es_quat on_corner = es_quat_mul(es_quat_from_axis_angle(es_v3(0, 0, 1), atanf(sqrtf(0.5f))), es_quat_from_axis_angle(es_v3(1, 0, 0), ES_PI / 4));
    es_pose tip = {{0.1f, 1 + 0.8660254f - 0.02f, 0.2f}, on_corner};
    assert_int_equal(es_rigid_collide(&a, &(es_pose){{0, 0, 0}, {0, 0, 0, 1}}, &b, &tip, 0, &m, 1), 1);
    assert_int_equal(m.count, 1);
    assert_float_equal(m.points[0].separation, -0.02f, 3e-6f);
    assert_float_equal(m.points[0].point.x, 0.1f, 1e-5f);
    assert_float_equal(m.points[0].point.z, 0.2f, 1e-5f);

    /* one place: apart along some axis, not NaN */
    assert_int_equal(collide(&a, pose_at(0, 0, 0), &a, pose_at(0, 0, 0), 0, &m), 1);
    assert_float_equal(es_v3_length(m.normal), 1, 1e-6f);
    assert_float_equal(m.points[0].separation, -2, 1e-5f);
    es_rigid_shape_free(f->context, &a);
    es_rigid_shape_free(f->context, &b);
}

static void round_ones_by_hand(void** state)
{
    fixture* f = *state;
    es_rigid_shape s = make(f, sphere_desc(0.5f)), c = make(f, capsule_desc(0.25f, 0.5f)), box = make(f, box_desc(1, 1, 1));
    es_manifold m;
    assert_int_equal(collide(&s, pose_at(0, 0, 0), &s, pose_at(0.6f, 0.8f, 0), 0.1f, &m), 1);
    assert_float_equal(m.points[0].separation, 0, 1e-6f);
    assert_float_equal(m.normal.x, 0.6f, 1e-6f);
    assert_float_equal(m.points[0].point.y, 0.4f, 1e-6f);
    assert_int_equal(collide(&s, pose_at(0, 0, 0), &s, pose_at(0, 0, 0), 0, &m), 1); /* one place */
    assert_float_equal(m.points[0].separation, -1, 1e-6f);
    assert_float_equal(es_v3_length(m.normal), 1, 1e-6f);
    /* a sphere over a face, an edge, a corner, inside */
    assert_int_equal(collide(&box, pose_at(0, 0, 0), &s, pose_at(0.3f, 1.4f, 0), 0, &m), 1);
    assert_float_equal(m.points[0].separation, -0.1f, 1e-6f);
    assert_float_equal(m.normal.y, 1, 1e-6f);
    assert_int_equal(collide(&s, pose_at(0.3f, 1.4f, 0), &box, pose_at(0, 0, 0), 0, &m), 1);
    assert_float_equal(m.normal.y, -1, 1e-6f);
    assert_int_equal(collide(&box, pose_at(0, 0, 0), &s, pose_at(1.3f, 1.3f, 0), 0, &m), 1);
    assert_float_equal(m.points[0].separation, 0.3f * sqrtf(2) - 0.5f, 1e-6f);
    assert_int_equal(collide(&box, pose_at(0, 0, 0), &s, pose_at(0.9f, 0, 0), 0, &m), 1);
    assert_float_equal(m.points[0].separation, -0.6f, 1e-6f);
    assert_float_equal(m.normal.x, 1, 1e-6f);
    /* a capsule lying on a box has two points, a standing one one; capsules side by side two, crossing one */
    es_pose lying = {{0, 1.24f, 0}, es_quat_from_axis_angle(es_v3(0, 0, 1), ES_PI / 2)};
    assert_int_equal(collide(&box, pose_at(0, 0, 0), &c, lying, 0, &m), 1);
    assert_int_equal(m.count, 2);
    for (uint32_t i = 0; i < 2; i++) {
        assert_float_equal(m.points[i].separation, -0.01f, 1e-5f);
        assert_float_equal(fabsf(m.points[i].point.x), 0.5f, 1e-5f);
    }
    assert_int_equal(collide(&c, lying, &box, pose_at(0, 0, 0), 0, &m), 1);
    assert_float_equal(m.normal.y, -1, 1e-5f);
    assert_int_equal(m.count, 2);
    assert_int_equal(collide(&box, pose_at(0, 0, 0), &c, pose_at(0, 1.74f, 0), 0, &m), 1);
    assert_int_equal(m.count, 1);
    assert_float_equal(m.points[0].separation, -0.01f, 1e-5f);
    assert_int_equal(collide(&c, pose_at(0, 0, 0), &c, pose_at(0.49f, 0.25f, 0), 0, &m), 1);
    assert_int_equal(m.count, 2);
    assert_float_equal(m.points[0].separation, -0.01f, 1e-6f);
    es_pose crossing = {{0.49f, 0, 0}, es_quat_from_axis_angle(es_v3(1, 0, 0), ES_PI / 2)};
    assert_int_equal(collide(&c, pose_at(0, 0, 0), &c, crossing, 0, &m), 1);
    assert_int_equal(m.count, 1);
    assert_float_equal(m.points[0].separation, -0.01f, 1e-6f);
    assert_float_equal(m.normal.x, 1, 1e-5f);
    crossing.position.x = 0; /* axes through each other */
    assert_int_equal(collide(&c, pose_at(0, 0, 0), &c, crossing, 0, &m), 1);
    assert_float_equal(m.points[0].separation, -0.5f, 1e-6f);
    /* deep in a box: out through the nearest side, wholly */
    assert_int_equal(collide(&box, pose_at(0, 0, 0), &c, pose_at(0.8f, 0, 0), 0, &m), 1);
    assert_float_equal(m.normal.x, 1, 1e-5f);
    assert_float_equal(m.points[0].separation, -0.45f, 1e-5f);
    es_rigid_shape_free(f->context, &s);
    es_rigid_shape_free(f->context, &c);
    es_rigid_shape_free(f->context, &box);
}

static void check_pair(const es_rigid_shape* a, const es_pose* pa, const es_rigid_shape* b, const es_pose* pb, float margin)
{
    es_manifold m, back;
    uint32_t count = es_rigid_collide(a, pa, b, pb, margin, &m, 1), other = es_rigid_collide(b, pb, a, pa, margin, &back, 1);
    exact_core ca = exact_core_of(a, pa), cb = exact_core_of(b, pb);
    double rounding = ca.radius + cb.radius, along = exact_separation(&ca, &cb), distance = exact_distance(&ca, &cb), truth = fmax(along, distance) - rounding;
    bool both_cores = fmax(along, distance) < 1.01e-3 * rounding || rounding == 0; /* then axes decide */
    if (truth > margin + 1e-4) {
        if (rounding > 0) assert_int_equal(count, 0);
        if (along > margin + 1e-4) assert_int_equal(count + other, 0);
    }
    if (truth < -1e-4) assert_int_equal(count, 1);
    if (truth < -1e-4) assert_int_equal(other, 1);
    if (!count) return;
    assert_in_range(m.count, 1, 4);
    assert_int_equal(m.key, 0);
    assert_float_equal(es_v3_length(m.normal), 1, 2e-6f);
    float deepest = 3e38f, deepest_back = 3e38f;
    for (uint32_t i = 0; i < m.count; i++) {
        assert_true(m.points[i].separation <= margin + 1e-5f);
        deepest = fminf(deepest, m.points[i].separation);
        for (uint32_t k = 0; k < i; k++) assert_int_not_equal(m.points[i].id, m.points[k].id);
        /* halfway between two surfaces is never farther from either than half the separation along the normal */
        es_shape_hit hit;
        for (int which = 0; which < 2; which++) {
            es_rigid_shape_closest(which ? b : a, which ? pb : pa, m.points[i].point, 1e9f, &hit);
            assert_true(hit.distance <= fabsf(m.points[i].separation) / 2 + 1e-3f);
        }
    }
    /* The normal is a separating axis nearly as good as the best one, and the separation is what it says it is. */
    double n[3] = {m.normal.x, m.normal.y, m.normal.z}, gap = exact_gap(&ca, &cb, n) - rounding;
    truth = fmax(truth, gap); /* a gap along any direction is a lower bound; the climb may have stopped on a ridge */
    /* by design: 5 % between faces and again between them and edges; rounded cores within 2.5° of a face are taken to lie on it, over up to 2.4 m of it */
    double slack = 0.11 * fabs(both_cores ? along : truth + rounding) + 2e-3 + (rounding > 0 && !both_cores ? 0.045 * 2.4 : 0);
    if (truth < 0) assert_true(gap >= (both_cores ? along - rounding : truth) - slack);
    assert_true(deepest >= gap - 1e-3);
    if (truth < -1e-3) assert_true(deepest <= (rounding > 0 && !both_cores ? truth + 0.012 * rounding : gap + 0.05 * fabs(gap)) + 3e-3);
    if (other && truth < -1e-3) {
        for (uint32_t i = 0; i < back.count; i++) deepest_back = fminf(deepest_back, back.points[i].separation);
        assert_float_equal(deepest, deepest_back, (float)slack + 0.05f * fabsf(deepest) + 1e-3f);
    }
}

static void random_pairs(void** state)
{
    fixture* f = *state;
    uint32_t s = 17;
    float points_a[3 * 24], points_b[3 * 24];
    for (int round = 0; round < 60 / SLOWER; round++)
        for (int ka = 0; ka < 4; ka++)
            for (int kb = 0; kb < 4; kb++) {
                bool placed = next_random(&s) & 1, rounded = next_random(&s) % 3 == 0;
                es_rigid_shape a = make(f, random_desc(&s, ka, points_a, placed, rounded)), b = make(f, random_desc(&s, kb, points_b, placed, rounded));
                for (int k = 0; k < 12; k++) {
                    es_pose pa = {random_vector(&s, 0.1f), random_rotation(&s)}, pb = {random_vector(&s, 1.3f), random_rotation(&s)};
                    check_pair(&a, &pa, &b, &pb, k & 1 ? 0.05f : 0);
                }
                es_rigid_shape_free(f->context, &a);
                es_rigid_shape_free(f->context, &b);
            }
}

/* A box and the hull of its corners are the same thing. */
static void boxes_as_hulls(void** state)
{
    fixture* f = *state;
    uint32_t s = 5;
    for (int round = 0; round < 300 / SLOWER; round++) {
        es_vec3 h[2] = {{uniform(&s, 0.2f, 1), uniform(&s, 0.2f, 1), uniform(&s, 0.2f, 1)}, {uniform(&s, 0.2f, 1), uniform(&s, 0.2f, 1), uniform(&s, 0.2f, 1)}};
        es_rigid_shape box[2], hull[2];
        for (int k = 0; k < 2; k++) {
            float p[24];
            for (int i = 0; i < 8; i++) {
                p[3 * i] = i & 1 ? h[k].x : -h[k].x;
                p[3 * i + 1] = i & 2 ? h[k].y : -h[k].y;
                p[3 * i + 2] = i & 4 ? h[k].z : -h[k].z;
            }
            box[k] = make(f, box_desc(h[k].x, h[k].y, h[k].z));
            hull[k] = make(f, hull_desc(p, 8));
            assert_int_equal(hull[k].hull.face_count, 6);
        }
        for (int k = 0; k < 10; k++) {
            es_pose pa = {random_vector(&s, 0.1f), random_rotation(&s)}, pb = {random_vector(&s, 1.2f), random_rotation(&s)};
            es_manifold m, g;
            uint32_t count = es_rigid_collide(&box[0], &pa, &box[1], &pb, 0.01f, &m, 1), same = es_rigid_collide(&hull[0], &pa, &hull[1], &pb, 0.01f, &g, 1);
            float deepest[2] = {3e38f, 3e38f};
            for (uint32_t i = 0; count && i < m.count; i++) deepest[0] = fminf(deepest[0], m.points[i].separation);
            for (uint32_t i = 0; same && i < g.count; i++) deepest[1] = fminf(deepest[1], g.points[i].separation);
            if (fminf(deepest[0], deepest[1]) < -2e-3f) {
                assert_int_equal(count, same);
                assert_float_equal(deepest[0], deepest[1], 0.06f * fabsf(deepest[0]) + 2e-3f);
            }
        }
        for (int k = 0; k < 2; k++) {
            es_rigid_shape_free(f->context, &box[k]);
            es_rigid_shape_free(f->context, &hull[k]);
        }
    }
}

/* Moving both shapes to where floats are coarser changes contact by no more than their coarseness. */
static void places(void** state)
{
    fixture* f = *state;
    uint32_t s = 99;
    float points[3 * 24];
    for (int round = 0; round < 40; round++) {
        es_rigid_shape a = make(f, random_desc(&s, 1 + round % 3, points, false, false)), b = make(f, random_desc(&s, 1 + round / 3 % 3, points, false, false));
        es_pose pa = {{0, 0, 0}, random_rotation(&s)}, pb = {random_vector(&s, 0.8f), random_rotation(&s)};
        es_vec3 far_away = {1024, -512, 2048};
        es_pose qa = pa, qb = {es_v3_add(pb.position, far_away), pb.rotation};
        qa.position = far_away;
        qb.position = es_v3_add(far_away, pb.position);
        pb.position = es_v3_sub(qb.position, far_away); /* the same offset, exactly */
        es_manifold m, n;
        uint32_t count = es_rigid_collide(&a, &pa, &b, &pb, 0.01f, &m, 1);
        assert_int_equal(es_rigid_collide(&a, &qa, &b, &qb, 0.01f, &n, 1), count);
        if (count) {
            assert_int_equal(m.count, n.count);
            for (uint32_t i = 0; i < m.count; i++) assert_float_equal(m.points[i].separation, n.points[i].separation, 5e-4f); /* 2048 has steps of 1.2e-4 */
        }
        es_rigid_shape_free(f->context, &a);
        es_rigid_shape_free(f->context, &b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(boxes_by_hand, set_up, tear_down),
        cmocka_unit_test_setup_teardown(round_ones_by_hand, set_up, tear_down),
        cmocka_unit_test_setup_teardown(random_pairs, set_up, tear_down),
        cmocka_unit_test_setup_teardown(boxes_as_hulls, set_up, tear_down),
        cmocka_unit_test_setup_teardown(places, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
