/* Rays, nearest points and overlaps in worlds of bodies, against each shape asked by itself. */
#include "tests/collision_tools.h"

enum { BODIES = 60 };

typedef struct crowd { es_body body[BODIES]; es_rigid_shape shape[BODIES]; es_pose pose[BODIES]; float points[BODIES][3 * 24]; } crowd;

/* `away`: where the whole crowd is */
static void add_crowd(fixture* f, crowd* c, const double away[3])
{
    uint32_t s = 4;
    for (int i = 0; i < BODIES; i++) {
        es_shape_desc d = random_desc(&s, i % 4, c->points[i], i & 1, i & 2);
        d.category = 1u << (i % 3);
        c->shape[i] = make(f, d);
        c->pose[i] = (es_pose){random_vector(&s, 5), random_rotation(&s)};
        es_body_desc desc = es_default_body_desc();
        desc.type = i % 5 ? ES_BODY_STATIC : ES_BODY_DYNAMIC;
        desc.shapes = &d;
        desc.shape_count = 1;
        for (int k = 0; k < 3; k++) desc.position[k] = away[k] + (double)(&c->pose[i].position.x)[k];
        desc.rotation = c->pose[i].rotation;
        assert_int_equal(es_world_add_body(f->world, &desc, &c->body[i]), ES_OK);
    }
}

static void ask(fixture* f, const crowd* c, const double away[3], float slack)
{
    uint32_t s = 8;
    for (int round = 0; round < 600 / SLOWER; round++) {
        es_vec3 o = random_vector(&s, 7), d = random_vector(&s, 3);
        double from[3] = {away[0] + (double)o.x, away[1] + (double)o.y, away[2] + (double)o.z};
        uint32_t mask = round % 4 ? UINT32_MAX : 1u << (round / 4 % 3);
        es_ray_contact contact;
        es_closest closest;
        bool hit = es_world_cast_ray(f->world, from, d, 10, mask, &contact), near_one = es_world_closest_point(f->world, from, 1.5f, mask, &closest);
        float best = 10, nearest = 1.5f;
        bool truth = false, near_truth = false;
        for (int i = 0; i < BODIES; i++) {
            if (!(1u << (i % 3) & mask)) continue;
            es_shape_hit h;
            if (es_rigid_shape_ray(&c->shape[i], &c->pose[i], o, d, best, &h)) {
                best = h.distance;
                truth = true;
            }
            if (es_rigid_shape_closest(&c->shape[i], &c->pose[i], o, nearest, &h)) {
                nearest = h.distance;
                near_truth = true;
            }
        }
        assert_int_equal(hit, truth);
        assert_int_equal(near_one, near_truth);
        if (hit) {
            assert_float_equal(contact.distance, best, slack);
            double step = 0;
            for (int k = 0; k < 3; k++) step += (contact.point[k] - from[k]) * (contact.point[k] - from[k]);
            assert_true(fabs(sqrt(step) - (double)contact.distance) < 1e-5);
            assert_int_equal(contact.shape, 0);
        }
        if (near_one) {
            assert_float_equal(closest.distance, nearest, slack);
            double step = 0;
            for (int k = 0; k < 3; k++) step += (closest.point[k] - from[k]) * (closest.point[k] - from[k]);
            assert_true(fabs(sqrt(step) - fabs((double)closest.distance)) < 1e-3);
        }
        es_shape_desc probe = random_desc(&s, round % 4, (float[3 * 24]){0}, false, false);
        float points[3 * 24];
        probe = random_desc(&s, round % 4, points, round & 4, false);
        es_quat turn = random_rotation(&s);
        es_body found[BODIES];
        size_t count = BODIES, needed = 0;
        assert_int_equal(es_world_overlap(f->world, &probe, from, turn, mask, found, &count), ES_OK);
        assert_int_equal(es_world_overlap(f->world, &probe, from, turn, mask, NULL, &needed), ES_OK);
        assert_int_equal(count, needed);
        es_rigid_shape shape = make(f, probe);
        size_t at = 0;
        for (int i = 0; i < BODIES; i++) {
            es_pose own = {o, turn};
            es_vec3 on_a, on_b;
            if (!(1u << (i % 3) & mask)) continue;
            float distance = es_rigid_distance(&c->shape[i], &c->pose[i], &shape, &own, 1, &on_a, &on_b);
            bool is_found = at < count && found[at].id == c->body[i].id;
            if (distance > 1e-3f) assert_false(is_found);
            if (distance <= 0 && slack < 1e-3f) assert_true(is_found || distance == 0);
            at += is_found;
        }
        assert_int_equal(at, count);
        es_rigid_shape_free(f->context, &shape);
    }
}

static void against_each_shape(void** state)
{
    fixture* f = *state;
    crowd* c = calloc(1, sizeof *c);
    const double here[3] = {0, 0, 0};
    add_crowd(f, c, here);
    ask(f, c, here, 1e-4f);
    for (int i = 0; i < BODIES; i++) es_rigid_shape_free(f->context, &c->shape[i]);
    free(c);
}

/* The same crowd 10⁷ m away: places are doubles, and nothing is lost. */
static void far_from_zero(void** state)
{
    fixture* f = *state;
    crowd* c = calloc(1, sizeof *c);
    const double there[3] = {1e7, -2e7, 3e7};
    add_crowd(f, c, there);
    ask(f, c, there, 1e-4f);
    for (int i = 0; i < BODIES; i++) es_rigid_shape_free(f->context, &c->shape[i]);
    free(c);
}

static void refusals(void** state)
{
    fixture* f = *state;
    const double here[3] = {0, 0, 0}, nowhere[3] = {NAN, 0, 0};
    es_ray_contact contact;
    es_closest closest;
    assert_false(es_world_cast_ray(f->world, here, (es_vec3){0, 1, 0}, 10, 0, &contact)); /* an empty world */
    assert_false(es_world_closest_point(f->world, here, 10, 0, &closest));
    assert_false(es_world_cast_ray(f->world, nowhere, (es_vec3){0, 1, 0}, 10, 0, &contact));
    assert_false(es_world_cast_ray(f->world, here, (es_vec3){0, 0, 0}, 10, 0, &contact));
    assert_false(es_world_cast_ray(f->world, here, (es_vec3){0, NAN, 0}, 10, 0, &contact));
    assert_false(es_world_cast_ray(f->world, here, (es_vec3){0, 1, 0}, -1, 0, &contact));
    assert_false(es_world_closest_point(f->world, nowhere, 1, 0, &closest));
    assert_false(es_world_closest_point(f->world, here, NAN, 0, &closest));
    size_t count = 0;
    es_shape_desc d = es_default_shape_desc();
    assert_int_equal(es_world_overlap(f->world, &d, nowhere, (es_quat){0, 0, 0, 1}, 0, NULL, &count), ES_INVALID_ARGUMENT);
    d.half_extents.x = -1;
    assert_int_equal(es_world_overlap(f->world, &d, here, (es_quat){0, 0, 0, 1}, 0, NULL, &count), ES_INVALID_ARGUMENT);
    d.type = ES_SHAPE_MESH;
    assert_int_equal(es_world_overlap(f->world, &d, here, (es_quat){0, 0, 0, 1}, 0, NULL, &count), ES_INVALID_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(against_each_shape, set_up, tear_down),
        cmocka_unit_test_setup_teardown(far_from_zero, set_up, tear_down),
        cmocka_unit_test_setup_teardown(refusals, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
