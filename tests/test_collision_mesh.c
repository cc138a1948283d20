/* Contact with triangle meshes: floors that do not bump, ridges, valleys and borders, both sides, distances and rays by brute force. */
#include "tests/collision_tools.h"

#include "sim/rigid/shape_mesh.h"

enum { MANY = 64 };

static es_rigid_shape make_mesh(fixture* f, const float* positions, uint32_t vertices, const uint32_t* indices, uint32_t triangles)
{
    es_mesh mesh;
    assert_int_equal(es_world_add_mesh(f->world, &(es_mesh_desc){.vertex_count = vertices, .triangle_count = triangles, .positions = positions, .indices = indices}, &mesh), ES_OK);
    es_shape_desc d = es_default_shape_desc();
    d.type = ES_SHAPE_MESH;
    d.mesh = mesh;
    return make(f, d);
}

/* n × n squares of 1 m in y = height(x, z), centred; the diagonals alternate; every triangle has its own corners, so they must be welded */
static es_rigid_shape make_grid(fixture* f, int n, float (*height)(float x, float z))
{
    float* p = malloc((size_t)n * n * 18 * sizeof *p);
    uint32_t* index = malloc((size_t)n * n * 6 * sizeof *index);
    uint32_t count = 0;
    for (int z = 0; z < n; z++)
        for (int x = 0; x < n; x++) {
            static const int corner[2][6][2] = {{{0, 0}, {0, 1}, {1, 1}, {0, 0}, {1, 1}, {1, 0}}, {{0, 0}, {0, 1}, {1, 0}, {1, 0}, {0, 1}, {1, 1}}};
            for (int k = 0; k < 6; k++) {
                const int* c = corner[(x + z) & 1][k];
                float px = (float)(x + c[0]) - 0.5f * (float)n, pz = (float)(z + c[1]) - 0.5f * (float)n;
                p[3 * count] = px;
                p[3 * count + 1] = height(px, pz);
                p[3 * count + 2] = pz;
                index[count] = count;
                count++;
            }
        }
    es_rigid_shape shape = make_mesh(f, p, count, index, count / 3);
    free(p);
    free(index);
    return shape;
}
static float flat(float x, float z) { return 0; }
static float ridge(float x, float z) { return -0.5f * fabsf(x); }
static float valley(float x, float z) { return 0.5f * fabsf(x); }

static void prepared(void** state)
{
    fixture* f = *state;
    es_rigid_shape grid = make_grid(f, 6, flat), roof = make_grid(f, 6, ridge);
    const es_shape_mesh* m = grid.mesh;
    assert_int_equal(m->triangle_count, 72);
    assert_int_equal(m->vertex_count, 49);
    uint32_t borders = 0;
    for (uint32_t t = 0; t < m->triangle_count; t++) {
        assert_true(m->triangles[t].normal.y > 0.9999f);
        assert_int_equal(m->triangles[t].facet, 0);
        for (int k = 0; k < 3; k++) {
            borders += m->triangles[t].kind[k] == ES_EDGE_BORDER;
            assert_true(m->triangles[t].kind[k] == ES_EDGE_BORDER || m->triangles[t].kind[k] == ES_EDGE_FLAT);
        }
    }
    assert_int_equal(borders, 24);
    uint32_t ridges = 0, facets = 0;
    for (uint32_t t = 0; t < roof.mesh->triangle_count; t++) {
        facets += roof.mesh->triangles[t].facet == t;
        for (int k = 0; k < 3; k++) ridges += roof.mesh->triangles[t].kind[k] == ES_EDGE_RIDGE;
    }
    assert_int_equal(ridges, 12);
    assert_int_equal(facets, 2);
    es_rigid_shape_free(f->context, &grid);
    es_rigid_shape_free(f->context, &roof);
}

static float deepest_of(const es_manifold* m, uint32_t count)
{
    float deepest = 3e38f;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < m[i].count; k++) deepest = fminf(deepest, m[i].points[k].separation);
    return deepest;
}

/* Whatever slides 1 mm deep over a flat floor meets one plane with the right depth, at every place and turn. */
static void no_bumps(void** state)
{
    fixture* f = *state;
    uint32_t s = 7;
    static const float tetrahedron[12] = {0.5f, 0.5f, 0.5f, -0.5f, -0.5f, 0.5f, 0.5f, -0.5f, -0.5f, -0.5f, 0.5f, -0.5f};
    es_shape_desc rounded = box_desc(0.5f, 0.3f, 0.4f);
    rounded.radius = 0.05f;
    es_rigid_shape grid = make_grid(f, 12, flat);
    es_rigid_shape shapes[5] = {make(f, sphere_desc(0.3f)), make(f, box_desc(0.5f, 0.3f, 0.4f)), make(f, capsule_desc(0.2f, 0.5f)), make(f, hull_desc(tetrahedron, 4)), make(f, rounded)};
    for (int round = 0; round < 4000 / SLOWER; round++) {
        const es_rigid_shape* shape = &shapes[round % 5];
        es_pose floor = {random_vector(&s, 1), random_rotation(&s)}, local = {{uniform(&s, -4, 4), 0, uniform(&s, -4, 4)}, random_rotation(&s)};
        if (round % 3) local.rotation = es_quat_from_axis_angle(es_v3(0, 1, 0), uniform(&s, -3, 3)); /* level */
        if (round % 10 == 2) local.rotation = es_quat_mul(local.rotation, es_quat_from_axis_angle(es_v3(0, 0, 1), ES_PI / 2)); /* capsules lying */
        exact_core core = exact_core_of(shape, &local);
        double lowest = 1e9;
        for (uint32_t i = 0; i < core.count; i++) lowest = fmin(lowest, core.v[i][1] - core.radius);
        float side = round & 1 ? 1.0f : -1.0f, depth = 1e-3f; /* above and below: the floor is solid from both sides */
        if (side > 0)
            local.position.y = (float)-lowest - depth;
        else {
            double highest = -1e9;
            for (uint32_t i = 0; i < core.count; i++) highest = fmax(highest, core.v[i][1] + core.radius);
            local.position.y = (float)-highest + depth;
        }
        es_mat3 turn = es_mat3_from_quat(floor.rotation);
        es_pose pose = {es_v3_add(floor.position, es_mat3_mul(&turn, local.position)), es_quat_mul(floor.rotation, local.rotation)};
        es_manifold m[ES_MESH_MANIFOLDS];
        uint32_t count = es_rigid_collide(&grid, &floor, shape, &pose, 0.002f, m, ES_MESH_MANIFOLDS);
        assert_int_equal(count, 1);
        assert_true(es_v3_dot(m[0].normal, turn.y) * side > 0.99999f);
        assert_float_equal(deepest_of(m, 1), -depth, 2e-5f);
        if (shape == &shapes[1] && round % 3) assert_int_equal(m[0].count, 4);
        assert_int_equal(m[0].key, 1);
        es_manifold back[ES_MESH_MANIFOLDS];
        assert_int_equal(es_rigid_collide(shape, &pose, &grid, &floor, 0.002f, back, ES_MESH_MANIFOLDS), 1);
        assert_true(es_v3_dot(back[0].normal, turn.y) * side < -0.99999f);
    }
    /* a box that slides keeps the ids of its corners from triangle to triangle */
    es_pose floor = pose_at(0, 0, 0);
    uint32_t ids[4] = {0};
    for (int step = 0; step < 200; step++) {
        es_pose pose = {{-3 + 0.03f * (float)step, 0.299f, 0.37f}, es_quat_from_axis_angle(es_v3(0, 1, 0), 0.3f)};
        es_manifold m[2];
        assert_int_equal(es_rigid_collide(&grid, &floor, &shapes[1], &pose, 0.002f, m, 2), 1);
        assert_int_equal(m[0].count, 4);
        for (int k = 0; k < 4; k++) {
            if (step) assert_int_equal(m[0].points[k].id, ids[k]);
            ids[k] = m[0].points[k].id;
        }
    }
    for (int i = 0; i < 5; i++) es_rigid_shape_free(f->context, &shapes[i]);
    es_rigid_shape_free(f->context, &grid);
}

static void ridges_and_valleys(void** state)
{
    fixture* f = *state;
    es_rigid_shape roof = make_grid(f, 6, ridge), ditch = make_grid(f, 6, valley), ball = make(f, sphere_desc(0.5f)), box = make(f, box_desc(0.5f, 0.5f, 0.5f));
    es_manifold m[ES_MESH_MANIFOLDS];
    es_pose origin = pose_at(0, 0, 0);
    /* a ball on the ridge: straight up; one in the valley: both slopes */
    uint32_t count = es_rigid_collide(&roof, &origin, &ball, &(es_pose){{0, 0.49f, 0.2f}, {0, 0, 0, 1}}, 0.01f, m, ES_MESH_MANIFOLDS);
    assert_int_equal(count, 1);
    assert_true(m[0].normal.y > 0.9999f);
    assert_float_equal(m[0].points[0].separation, -0.01f, 1e-5f);
    float up = 0.5f / 0.894427f;
    count = es_rigid_collide(&ditch, &origin, &ball, &(es_pose){{0, up - 0.01f, 0.2f}, {0, 0, 0, 1}}, 0.01f, m, ES_MESH_MANIFOLDS);
    assert_int_equal(count, 2);
    assert_float_equal(m[0].normal.x, -m[1].normal.x, 1e-5f);
    assert_float_equal(deepest_of(m, 2), -0.01f * 0.894427f, 1e-5f);
    assert_int_not_equal(m[0].key, m[1].key);
    /* a level box on the ridge: its lower face meets the line, straight up */
    count = es_rigid_collide(&roof, &origin, &box, &(es_pose){{0.1f, 0.49f, 0.2f}, {0, 0, 0, 1}}, 0.001f, m, ES_MESH_MANIFOLDS);
    assert_true(count >= 1);
    for (uint32_t i = 0; i < count; i++) assert_true(m[i].normal.y > 0.999f);
    assert_float_equal(deepest_of(m, count), -0.01f, 1e-4f);
    /* at the border: a ball beside it is pushed away from it */
    count = es_rigid_collide(&ditch, &origin, &ball, &(es_pose){{3.3f, 1.5f, 0.2f}, {0, 0, 0, 1}}, 0, m, ES_MESH_MANIFOLDS);
    /* so deep, the corners of the next triangles along the border are within reach too */
    assert_float_equal(deepest_of(m, count), -0.2f, 1e-5f);
    for (uint32_t i = 0; i < count; i++)
        if (deepest_of(&m[i], 1) < -0.1999f) assert_true(m[i].normal.x > 0.999f);
    count = es_rigid_collide(&ditch, &origin, &ball, &(es_pose){{3.495f, 1.5f, 0.2f}, {0, 0, 0, 1}}, 0, m, ES_MESH_MANIFOLDS);
    assert_int_equal(count, 1);
    assert_true(m[0].normal.x > 0.999f);
    /* out of reach */
    assert_int_equal(es_rigid_collide(&roof, &origin, &ball, &(es_pose){{0, 1, 0}, {0, 0, 0, 1}}, 0.01f, m, ES_MESH_MANIFOLDS), 0);
    assert_int_equal(es_rigid_collide(&roof, &origin, &ditch, &origin, 0.01f, m, ES_MESH_MANIFOLDS), 0);
    es_rigid_shape_free(f->context, &roof);
    es_rigid_shape_free(f->context, &ditch);
    es_rigid_shape_free(f->context, &ball);
    es_rigid_shape_free(f->context, &box);
}

/* Over triangles in any arrangement: no contact beyond the margin, none missed that the nearest triangle proves, all as deep at most. */
static void random_soup(void** state)
{
    fixture* f = *state;
    uint32_t s = 91;
    float points[3 * 24], p[9 * MANY];
    uint32_t index[3 * MANY];
    for (int round = 0; round < 16 / SLOWER; round++) {
        for (uint32_t i = 0; i < MANY; i++) {
            es_vec3 c = random_vector(&s, 3);
            for (uint32_t k = 0; k < 3; k++) {
                es_vec3 v = es_v3_add(c, random_vector(&s, 1));
                memcpy(p + 9 * i + 3 * k, &v.x, sizeof v);
                index[3 * i + k] = 3 * i + k;
            }
        }
        es_rigid_shape soup = make_mesh(f, p, 3 * MANY, index, MANY);
        es_pose origin = {random_vector(&s, 1), random_rotation(&s)};
        for (int k = 0; k < 16; k++) {
            es_rigid_shape shape = make(f, random_desc(&s, k % 4, points, k & 1, k & 2));
            es_pose pose = {random_vector(&s, 4), random_rotation(&s)};
            es_manifold m[ES_MESH_MANIFOLDS];
            const float margin = 0.02f;
            uint32_t count = es_rigid_collide(&soup, &origin, &shape, &pose, margin, m, ES_MESH_MANIFOLDS);
            es_vec3 on_a, on_b;
            float distance = es_rigid_distance(&soup, &origin, &shape, &pose, 1e9f, &on_a, &on_b), best = 3e38f;
            for (uint32_t t = 0; t < soup.mesh->triangle_count; t++) { /* each as a hull of its own, in double */
                exact_core c = exact_core_of(&shape, &pose), triangle = {.count = 3};
                for (int v = 0; v < 3; v++) exact_point(&origin, soup.mesh->vertices[soup.mesh->triangles[t].vertex[v]], triangle.v[v]);
                best = fminf(best, (float)(exact_distance(&triangle, &c) - c.radius));
            }
            if (best > 0) assert_true(distance >= best - 2e-4f); /* climbing gives a lower bound */
            if (distance > 0) assert_true(fabsf(es_v3_length(es_v3_sub(on_b, on_a)) - distance) < 1e-4f);
            if (distance > margin) assert_true(count == 0 || shape.radius == 0);
            if (distance == 0) assert_true(count >= 1);
            for (uint32_t i = 0; i < count; i++) {
                assert_float_equal(es_v3_length(m[i].normal), 1, 1e-5f);
                if (i) assert_true(m[i].key > m[i - 1].key);
                for (uint32_t q = 0; q < m[i].count; q++) {
                    assert_true(m[i].points[q].separation <= margin + 1e-5f);
                    assert_true(m[i].points[q].separation > -4);
                    for (uint32_t r = 0; r < q; r++) assert_int_not_equal(m[i].points[q].id, m[i].points[r].id);
                }
            }
            /* rays, triangle by triangle */
            es_vec3 o = random_vector(&s, 4), d = es_v3_normalize(random_vector(&s, 1), es_v3(0, 1, 0));
            es_shape_hit hit = {0};
            bool found = es_rigid_shape_ray(&soup, &origin, o, d, 20, &hit);
            double nearest = 1e9;
            for (uint32_t t = 0; t < MANY; t++) {
                double v[3][3], e1[3], e2[3], q[3], w[3], u[3];
                for (int c = 0; c < 3; c++) exact_point(&origin, es_v3(p[9 * t + 3 * c], p[9 * t + 3 * c + 1], p[9 * t + 3 * c + 2]), v[c]);
                for (int c = 0; c < 3; c++) {
                    e1[c] = v[1][c] - v[0][c];
                    e2[c] = v[2][c] - v[0][c];
                    u[c] = (&o.x)[c] - v[0][c];
                }
                const double dir[3] = {d.x, d.y, d.z};
                for (int c = 0; c < 3; c++) q[c] = dir[(c + 1) % 3] * e2[(c + 2) % 3] - dir[(c + 2) % 3] * e2[(c + 1) % 3];
                for (int c = 0; c < 3; c++) w[c] = u[(c + 1) % 3] * e1[(c + 2) % 3] - u[(c + 2) % 3] * e1[(c + 1) % 3];
                double det = e1[0] * q[0] + e1[1] * q[1] + e1[2] * q[2], a = (u[0] * q[0] + u[1] * q[1] + u[2] * q[2]) / det;
                double b = (dir[0] * w[0] + dir[1] * w[1] + dir[2] * w[2]) / det, along = (e2[0] * w[0] + e2[1] * w[1] + e2[2] * w[2]) / det;
                if (a >= 0 && b >= 0 && a + b <= 1 && along >= 0 && along < nearest) nearest = along;
            }
            if (nearest < 20 && found) assert_true(fabs(hit.distance - nearest) < 1e-3);
            else assert_int_equal(found, nearest < 20);
            es_rigid_shape_free(f->context, &shape);
        }
        es_rigid_shape_free(f->context, &soup);
    }
}

/* A hammer through the floor: never late. */
static void impact_on_mesh(void** state)
{
    fixture* f = *state;
    uint32_t s = 13;
    es_rigid_shape grid = make_grid(f, 8, ridge), box = make(f, box_desc(0.2f, 0.1f, 0.3f));
    es_sweep still = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0, 1}, {0, 0, 0, 1}};
    for (int round = 0; round < 40 / SLOWER; round++) {
        es_sweep fast = {{0, 0, 0}, {uniform(&s, -3, 3), 5, uniform(&s, -3, 3)}, {uniform(&s, -2, 2), -5, uniform(&s, -2, 2)}, random_rotation(&s), random_rotation(&s)};
        float t = es_rigid_time_of_impact(&grid, &still, &box, &fast, 0.01f);
        assert_true(t > 0 && t < 1);
        for (int i = 0; i <= 100; i++) {
            es_pose pose = es_sweep_pose(&fast, t * (float)i / 100), origin = pose_at(0, 0, 0);
            es_vec3 on_a, on_b;
            float distance = es_rigid_distance(&grid, &origin, &box, &pose, 1e9f, &on_a, &on_b);
            assert_true(distance >= 0.0099f);
            if (i == 100) assert_true(distance <= 0.013f);
        }
    }
    es_rigid_shape_free(f->context, &grid);
    es_rigid_shape_free(f->context, &box);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(prepared, set_up, tear_down),
        cmocka_unit_test_setup_teardown(no_bumps, set_up, tear_down),
        cmocka_unit_test_setup_teardown(ridges_and_valleys, set_up, tear_down),
        cmocka_unit_test_setup_teardown(random_soup, set_up, tear_down),
        cmocka_unit_test_setup_teardown(impact_on_mesh, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
