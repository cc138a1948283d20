/* Shapes: what is refused, hulls and their invariants, masses against formulas, the tree against brute force, rays, nearest points, times of
 * impact. */
#include "tests/collision_tools.h"

#include "sim/rigid/dynamic_tree.h"
#include "sim/rigid/shape_mesh.h"

static void refuse(fixture* f, es_shape_desc d, const char* says)
{
    es_rigid_shape shape;
    assert_int_not_equal(es_rigid_shape_make(f->world, &d, "crate", &shape), ES_OK);
    const char* message = es_context_message(f->context);
    if (!strstr(message, says) || !strstr(message, "crate")) fail_msg("'%s' instead of '%s'", message, says);
    es_rigid_shape_free(f->context, &shape);
}

static void refusals(void** state)
{
    fixture* f = *state;
    const float bad[] = {0, -1, 1e-6f, 1e6f, NAN, INFINITY};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        refuse(f, sphere_desc(bad[i]), "radius");
        refuse(f, capsule_desc(bad[i], 1), "radius");
        refuse(f, box_desc(1, bad[i], 1), "half extents");
    }
    refuse(f, capsule_desc(1, -1), "half height");
    refuse(f, capsule_desc(1, NAN), "half height");
    es_shape_desc d = box_desc(1, 1, 1);
    d.radius = 0.95f;
    refuse(f, d, "rounding");
    d = box_desc(1, 1, 1);
    d.density = -1;
    refuse(f, d, "density");
    d = box_desc(1, 1, 1);
    d.friction = NAN;
    refuse(f, d, "friction");
    d = box_desc(1, 1, 1);
    d.position.x = INFINITY;
    refuse(f, d, "position");
    refuse(f, hull_desc(NULL, 0), "points");

    /* hulls without a volume */
    float p[3 * 64];
    uint32_t s = 3;
    for (int kind = 0; kind < 4; kind++) {
        for (int i = 0; i < 64; i++) {
            float x = uniform(&s, -1, 1), y = uniform(&s, -1, 1);
            p[3 * i] = kind == 0 ? 0.3f : x;
            p[3 * i + 1] = kind <= 1 ? 0.2f : kind == 2 ? y : 0.4f * x - 0.7f * y;
            p[3 * i + 2] = kind <= 1 ? -0.1f : kind == 2 ? 0.5f : y;
        }
        refuse(f, hull_desc(p, 64), "volume");
        refuse(f, hull_desc(p, 3), "four points");
    }
    p[5] = NAN;
    refuse(f, hull_desc(p, 64), "point 1");
    es_shape_desc mesh = es_default_shape_desc();
    mesh.type = ES_SHAPE_MESH;
    es_rigid_shape shape;
    assert_int_equal(es_rigid_shape_make(f->world, &mesh, "crate", &shape), ES_STALE_HANDLE);
}

static void check_hull(const es_hull* h, const float* points, uint32_t count, es_vec3 scale, double tolerance)
{
    assert_int_equal(h->vertex_count + h->face_count, h->half_edge_count / 2 + 2); /* Euler */
    for (uint32_t i = 0; i < h->half_edge_count; i++) {
        const es_half_edge *e = &h->half_edges[i], *twin = &h->half_edges[i ^ 1];
        assert_int_equal(h->half_edges[e->next].origin, twin->origin);
        assert_int_equal(h->half_edges[e->next].face, e->face);
        assert_int_not_equal(e->face, twin->face);
    }
    for (uint32_t face = 0; face < h->face_count; face++) {
        assert_float_equal(es_v3_length(h->planes[face].normal), 1, 1e-6f);
        uint32_t sides = 0, e = h->first[face];
        do {
            assert_int_equal(h->half_edges[e].face, face);
            /* flat */
            assert_true(fabsf(es_v3_dot(h->planes[face].normal, h->vertices[h->half_edges[e].origin]) - h->planes[face].offset) <= (float)(4 * tolerance));
            e = h->half_edges[e].next;
        } while (e != h->first[face] && ++sides < 100);
        assert_in_range(sides + 1, 3, ES_HULL_VERTICES);
        for (uint32_t v = 0; v < h->vertex_count; v++) /* convex */
            assert_true(es_v3_dot(h->planes[face].normal, h->vertices[v]) <= h->planes[face].offset + 1e-6f);
        assert_true(es_v3_dot(h->planes[face].normal, h->centre) < h->planes[face].offset);
        for (uint32_t i = 0; i < count; i++) { /* holds all points */
            es_vec3 p = {points[3 * i] * scale.x, points[3 * i + 1] * scale.y, points[3 * i + 2] * scale.z};
            assert_true(es_v3_dot(h->planes[face].normal, p) <= h->planes[face].offset + (float)(4 * tolerance));
        }
    }
}

static void hulls(void** state)
{
    fixture* f = *state;
    uint32_t s = 11;
    enum { MANY = 400 };
    static float p[3 * MANY];
    for (int round = 0; round < 400 / SLOWER; round++) {
        uint32_t count = 4 + next_random(&s) % (round % 4 == 0 ? 8 : 40);
        int kind = round % 8;
        if (kind >= 4) count = MANY;
        float size = kind == 6 ? 1e-3f : kind == 7 ? 5e4f : 1;
        for (uint32_t i = 0; i < count; i++) {
            es_vec3 v = random_vector(&s, size);
            if (kind == 1) v = es_v3(roundf(v.x * 2) / 2, roundf(v.y * 2) / 2, roundf(v.z * 2) / 2); /* many in common planes and lines */
            if (kind == 2) v.y *= 1e-3f;                                                              /* a thin plate */
            if (kind == 3) v.x *= 1e-3f, v.z *= 1e-3f;                                                /* a needle */
            if (kind == 4) v = i % 50 ? es_v3(roundf(v.x * 3) / 3, roundf(v.y * 3) / 3, roundf(v.z * 3) / 3) : es_v3(i / 50 & 1 ? 1 : -1.0f, i / 50 & 2 ? 1 : -1.0f, i / 50 & 4 ? 1 : -1.0f);
            memcpy(p + 3 * i, &v.x, sizeof v);
        }
        es_hull h;
        es_vec3 scale = {1, 1, 1};
        if (round & 1) scale = es_v3(-1, 1, 1); /* mirrored */
        es_result result = es_hull_build(f->context, p, count, 3, scale, "test", &h);
        if (result != ES_OK) {
            assert_true(kind == 1 || kind == 3 || count < 8); /* few points of a coarse grid may lie in a plane */
            continue;
        }
        bool all_kept = h.vertex_count < ES_HULL_VERTICES;
        check_hull(&h, p, all_kept ? count : 0, scale, 2e-5 * 2 * size);
        if (kind == 4) assert_int_equal(h.face_count, 6); /* 400 points of a 7³ grid, its corners among them */
        es_hull_free(f->context, &h);
    }
    /* a sphere of many points keeps its farthest 64 and stays round */
    for (uint32_t i = 0; i < MANY; i++) {
        es_vec3 v = es_v3_normalize(random_vector(&s, 1), es_v3(0, 1, 0));
        memcpy(p + 3 * i, &v.x, sizeof v);
    }
    es_rigid_shape ball = make(f, hull_desc(p, MANY));
    assert_true(ball.hull.vertex_count > 48);
    check_hull(&ball.hull, p, 0, es_v3(1, 1, 1), 1e-5);
    assert_true(ball.inner_radius > 0.8f);
    es_rigid_shape_free(f->context, &ball);
    /* a cube with doubles, midpoints and inner points */
    uint32_t count = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < 27; i++) {
            p[3 * count] = (float)(i % 3) - 1;
            p[3 * count + 1] = (float)(i / 3 % 3) - 1;
            p[3 * count + 2] = (float)(i / 9) - 1;
            count++;
        }
    es_rigid_shape cube = make(f, hull_desc(p, count));
    assert_int_equal(cube.hull.vertex_count, 8);
    assert_int_equal(cube.hull.face_count, 6);
    es_rigid_shape_free(f->context, &cube);
}

static void assert_mass(const es_mass* m, float mass, const float inertia[6], float tolerance)
{
    assert_float_equal(m->mass, mass, tolerance * mass);
    for (int k = 0; k < 6; k++) assert_float_equal(m->inertia[k], inertia[k], tolerance * inertia[0]);
}

static void masses(void** state)
{
    fixture* f = *state;
    es_shape_desc d = sphere_desc(0.5f);
    d.density = 3;
    d.position = es_v3(1, 2, 3);
    es_rigid_shape shape = make(f, d);
    es_mass m = es_rigid_shape_mass(&shape);
    float sphere = 3 * ES_PI * 4 / 3 * 0.125f, i = 0.4f * sphere * 0.25f;
    assert_mass(&m, sphere, (float[]){i, i, i, 0, 0, 0}, 1e-6f);
    assert_float_equal(m.centre.y, 2, 0);
    es_rigid_shape_free(f->context, &shape);

    d = box_desc(0.5f, 1, 1.5f);
    d.density = 1;
    shape = make(f, d);
    m = es_rigid_shape_mass(&shape);
    float box[6] = {6.0f / 12 * (4 + 9), 6.0f / 12 * (1 + 9), 6.0f / 12 * (1 + 4), 0, 0, 0};
    assert_mass(&m, 6, box, 1e-6f);
    es_rigid_shape_free(f->context, &shape);
    /* turned by a quarter about z, x and y change places; by an eighth they mix */
    d.rotation = es_quat_from_axis_angle(es_v3(0, 0, 1), ES_PI / 4);
    shape = make(f, d);
    m = es_rigid_shape_mass(&shape);
    assert_mass(&m, 6, (float[]){(box[0] + box[1]) / 2, (box[0] + box[1]) / 2, box[2], (box[0] - box[1]) / 2, 0, 0}, 1e-6f);
    es_rigid_shape_free(f->context, &shape);
    /* the same box as a hull, off its origin */
    float p[24];
    for (int k = 0; k < 8; k++) {
        p[3 * k] = 2 + (k & 1 ? 0.5f : -0.5f);
        p[3 * k + 1] = k & 2 ? 1 : -1.0f;
        p[3 * k + 2] = k & 4 ? 1.5f : -1.5f;
    }
    es_shape_desc hull = hull_desc(p, 8);
    hull.density = 1;
    shape = make(f, hull);
    m = es_rigid_shape_mass(&shape);
    assert_mass(&m, 6, box, 1e-5f);
    assert_float_equal(m.centre.x, 2, 1e-5f);
    es_rigid_shape_free(f->context, &shape);
    /* a tetrahedron at the axes: V = 1/6, centroid 1/4, xx = 2 (1/60 - 1/96), xy = 1/480 about the centroid */
    static const float corner[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    hull = hull_desc(corner, 4);
    hull.density = 1;
    shape = make(f, hull);
    m = es_rigid_shape_mass(&shape);
    float xx = 2 * (1.0f / 60 - 1.0f / 96), xy = -(1.0f / 120 - 1.0f / 96);
    assert_mass(&m, 1.0f / 6, (float[]){xx, xx, xx, xy, xy, xy}, 1e-5f);
    assert_float_equal(m.centre.x, 0.25f, 1e-6f);
    es_rigid_shape_free(f->context, &shape);
    /* a capsule without height is a sphere; a long one along x has the cylinder's and caps' sums */
    shape = make(f, capsule_desc(0.5f, 0));
    m = es_rigid_shape_mass(&shape);
    assert_float_equal(m.inertia[0], m.inertia[1], 1e-5f * m.inertia[0]);
    assert_float_equal(m.mass, 1000 * ES_PI / 6, 1e-3f);
    es_rigid_shape_free(f->context, &shape);
    d = capsule_desc(0.5f, 2);
    d.density = 1;
    d.rotation = es_quat_from_axis_angle(es_v3(0, 0, 1), ES_PI / 2);
    shape = make(f, d);
    m = es_rigid_shape_mass(&shape);
    float cylinder = ES_PI * 0.25f * 4, caps = ES_PI / 6;
    float axial = cylinder * 0.125f + caps * 0.1f, half = caps / 2, own = 83.0f / 320 * half * 0.25f, arm = 2 + 0.375f * 0.5f;
    float across = cylinder * (3 * 0.25f + 16) / 12 + 2 * (own + half * arm * arm);
    assert_mass(&m, cylinder + caps, (float[]){axial, across, across, 0, 0, 0}, 1e-5f);
    es_rigid_shape_free(f->context, &shape);
    /* two half boxes make the box */
    d = box_desc(0.25f, 1, 1.5f);
    d.density = 1;
    es_mass sum = {0};
    for (int k = -1; k <= 1; k += 2) {
        d.position = es_v3(0.25f * (float)k, 0, 0);
        shape = make(f, d);
        es_mass part = es_rigid_shape_mass(&shape);
        sum = es_mass_add(&sum, &part);
        es_rigid_shape_free(f->context, &shape);
    }
    assert_mass(&sum, 6, box, 1e-6f);
    assert_float_equal(sum.centre.x, 0, 1e-7f);
}

static void bounds_hold(void** state)
{
    fixture* f = *state;
    uint32_t s = 31;
    float points[3 * 24];
    for (int round = 0; round < 200; round++) {
        es_rigid_shape shape = make(f, random_desc(&s, round % 4, points, round & 1, round & 2));
        es_pose pose = {random_vector(&s, 100), random_rotation(&s)};
        es_vec3 low, high;
        es_rigid_shape_bounds(&shape, &pose, &low, &high);
        exact_core core = exact_core_of(&shape, &pose);
        double slack = 0;
        for (uint32_t i = 0; i < core.count; i++)
            for (int k = 0; k < 3; k++) {
                assert_true(core.v[i][k] - core.radius >= (&low.x)[k]);
                assert_true(core.v[i][k] + core.radius <= (&high.x)[k]);
                slack = fmax(slack, (&high.x)[k] - core.v[i][k] - core.radius);
            }
        assert_true(slack < 6);
        es_rigid_shape_free(f->context, &shape);
    }
}

/* ---- the tree -------------------------------------------------------------------------------------------------------------------- */

enum { PROXIES = 300 };
typedef struct crowd { es_dynamic_tree tree; es_tree_box box[PROXIES]; uint32_t proxy[PROXIES]; bool there[PROXIES]; } crowd;

static bool boxes_touch(const es_tree_box* a, const es_tree_box* b)
{
    return a->low.x <= b->high.x && a->low.y <= b->high.y && a->low.z <= b->high.z && a->high.x >= b->low.x && a->high.y >= b->low.y && a->high.z >= b->low.z;
}
static es_tree_box random_box(uint32_t* s, float spread)
{
    es_vec3 c = random_vector(s, spread), h = {uniform(s, 0.1f, 0.6f), uniform(s, 0.1f, 0.6f), uniform(s, 0.1f, 0.6f)};
    return (es_tree_box){es_v3_sub(c, h), es_v3_add(c, h)};
}
static bool wants_unlike(void* user, uint32_t a, uint32_t b) { return a % 5 != b % 5; }
static uint32_t height_of(const es_dynamic_tree* tree, uint32_t at, uint32_t parent)
{
    const es_tree_node* n = &tree->nodes[at];
    assert_int_equal(n->parent, parent);
    if (n->child[0] == ES_NO_PROXY) return 0;
    uint32_t a = height_of(tree, n->child[0], at), b = height_of(tree, n->child[1], at);
    assert_in_range((int)a - (int)b + 1, 0, 2);
    assert_int_equal(n->height, 1 + (a > b ? a : b));
    for (int k = 0; k < 2; k++) {
        const es_tree_box* c = &tree->nodes[n->child[k]].fat;
        assert_true(n->fat.low.x <= c->low.x && n->fat.low.y <= c->low.y && n->fat.low.z <= c->low.z);
        assert_true(n->fat.high.x >= c->high.x && n->fat.high.y >= c->high.y && n->fat.high.z >= c->high.z);
    }
    return n->height;
}
static void check_pairs(crowd* c)
{
    assert_true(es_dynamic_tree_pairs(&c->tree, wants_unlike, NULL));
    size_t at = 0;
    for (uint32_t i = 0; i < PROXIES; i++)
        for (uint32_t k = i + 1; k < PROXIES; k++) {
            if (!c->there[i] || !c->there[k] || i % 5 == k % 5 || !boxes_touch(&c->box[i], &c->box[k])) continue;
            assert_true(at < c->tree.pair_count);
            assert_int_equal(c->tree.pairs[at].key_a, i);
            assert_int_equal(c->tree.pairs[at].key_b, k);
            assert_int_equal(c->tree.pairs[at].a, c->proxy[i]);
            at++;
        }
    assert_int_equal(at, c->tree.pair_count);
}
typedef struct tally { uint32_t count; uint64_t sum; } tally;
static bool tally_found(void* user, uint32_t key)
{
    tally* t = user;
    t->count++;
    t->sum += (uint64_t)key * key + 1;
    return true;
}
static float tally_ray(void* user, uint32_t key, float max)
{
    tally_found(user, key);
    return max;
}

static void tree_against_brute_force(void** state)
{
    fixture* f = *state;
    crowd* c = calloc(1, sizeof *c);
    uint32_t s = 77;
    es_dynamic_tree_init(&c->tree, f->context);
    for (int round = 0; round < 120 / SLOWER; round++) {
        for (uint32_t i = 0; i < PROXIES; i++) {
            uint32_t dice = next_random(&s) % 100;
            if (!c->there[i] && dice < 50) {
                c->box[i] = random_box(&s, 3);
                c->proxy[i] = es_dynamic_tree_add(&c->tree, i, 1u << (i % 3), c->box[i], 0.1f);
                assert_int_not_equal(c->proxy[i], ES_NO_PROXY);
                c->there[i] = true;
            } else if (c->there[i] && dice < 5) {
                es_dynamic_tree_remove(&c->tree, c->proxy[i]);
                c->there[i] = false;
            } else if (c->there[i] && dice < 70) {
                es_vec3 step = random_vector(&s, dice < 10 ? 3 : 0.05f);
                c->box[i].low = es_v3_add(c->box[i].low, step);
                c->box[i].high = es_v3_add(c->box[i].high, step);
                es_dynamic_tree_move(&c->tree, c->proxy[i], c->box[i], 0.1f, step);
            }
        }
        check_pairs(c);
        height_of(&c->tree, c->tree.root, ES_NO_PROXY);
        es_tree_box ask = random_box(&s, 3);
        tally found = {0}, truth = {0};
        es_dynamic_tree_query(&c->tree, ask, 5, tally_found, &found);
        for (uint32_t i = 0; i < PROXIES; i++)
            if (c->there[i] && i % 3 != 1 && boxes_touch(&c->box[i], &ask)) tally_found(&truth, i);
        assert_memory_equal(&found, &truth, sizeof found);
        /* rays along and across the axes */
        es_vec3 o = random_vector(&s, 4), d = es_v3_normalize(random_vector(&s, 1), es_v3(0, 1, 0));
        if (round % 4 == 0) d = es_v3(0, round & 4 ? 1 : -1.0f, 0);
        found = truth = (tally){0};
        tally ample = {0};
        es_dynamic_tree_ray(&c->tree, o, d, 5, UINT32_MAX, tally_ray, &found);
        for (uint32_t i = 0; i < PROXIES; i++) {
            if (!c->there[i]) continue;
            double near_t = 0, far_t = 5, gap = 0;
            for (int k = 0; k < 3; k++) {
                double low = (&c->box[i].low.x)[k], high = (&c->box[i].high.x)[k], x = (&o.x)[k], v = (&d.x)[k];
                if (v == 0) {
                    gap = fmax(gap, fmax(low - x, x - high));
                    continue;
                }
                near_t = fmax(near_t, fmin((low - x) / v, (high - x) / v));
                far_t = fmin(far_t, fmax((low - x) / v, (high - x) / v));
            }
            if (gap <= 0 && near_t <= far_t) tally_found(&truth, i);
            if (gap <= 1e-4 && near_t <= far_t + 1e-4) tally_found(&ample, i);
        }
        assert_true(found.count >= truth.count && found.count <= ample.count);
        if (truth.count == ample.count) assert_memory_equal(&found, &truth, sizeof found);
        found = truth = (tally){0};
        es_dynamic_tree_near(&c->tree, o, 1.5f, UINT32_MAX, tally_ray, &found);
        for (uint32_t i = 0; i < PROXIES; i++) {
            es_vec3 zero = {0, 0, 0}, gap = es_v3_max(es_v3_max(es_v3_sub(c->box[i].low, o), es_v3_sub(o, c->box[i].high)), zero);
            if (c->there[i] && es_v3_length(gap) <= 1.5f) tally_found(&truth, i);
        }
        assert_in_range(found.count, truth.count, truth.count + 1);
    }
    /* built anew in another order, the same pairs */
    es_dynamic_tree other;
    es_dynamic_tree_init(&other, f->context);
    for (uint32_t i = PROXIES; i-- > 0;)
        if (c->there[i]) es_dynamic_tree_add(&other, i, 1, c->box[i], 0.01f);
    assert_true(es_dynamic_tree_pairs(&other, wants_unlike, NULL));
    assert_int_equal(other.pair_count, c->tree.pair_count);
    for (size_t i = 0; i < other.pair_count; i++) {
        assert_int_equal(other.pairs[i].key_a, c->tree.pairs[i].key_a);
        assert_int_equal(other.pairs[i].key_b, c->tree.pairs[i].key_b);
    }
    es_dynamic_tree_free(&other);
    es_dynamic_tree_free(&c->tree);
    free(c);
}

/* ---- queries --------------------------------------------------------------------------------------------------------------------- */

/* Nearest points against the distance of a tiny sphere's core, rays against steps along them. */
static void rays_and_points(void** state)
{
    fixture* f = *state;
    uint32_t s = 123;
    float points[3 * 24];
    for (int round = 0; round < 400 / SLOWER; round++) {
        es_rigid_shape shape = make(f, random_desc(&s, round % 4, points, round & 1, round & 2));
        es_pose pose = {random_vector(&s, 2), random_rotation(&s)};
        exact_core core = exact_core_of(&shape, &pose);
        for (int k = 0; k < 8; k++) {
            es_vec3 p = es_v3_add(pose.position, random_vector(&s, 2));
            es_shape_hit hit;
            assert_true(es_rigid_shape_closest(&shape, &pose, p, 1e9f, &hit));
            exact_core point = {.v = {{p.x, p.y, p.z}}, .count = 1};
            double n[3] = {hit.normal.x, hit.normal.y, hit.normal.z}, gap = exact_gap(&core, &point, n) - core.radius;
            assert_float_equal(es_v3_length(hit.normal), 1, 2e-6f);
            assert_float_equal(hit.distance, (float)gap, 1e-4f); /* the plane through the nearest point holds the shape back */
            es_vec3 there = es_v3_mad(hit.point, hit.normal, hit.distance);
            assert_true(es_v3_length(es_v3_sub(there, p)) < 1e-4f);
            if (hit.distance > 0.1f) assert_false(es_rigid_shape_closest(&shape, &pose, p, hit.distance * 0.99f, &hit));

            es_vec3 d = es_v3_normalize(random_vector(&s, 1), es_v3(1, 0, 0));
            bool found = es_rigid_shape_ray(&shape, &pose, p, d, 10, &hit);
            float t = 0;
            es_shape_hit at;
            bool truth = false;
            for (int i = 0; i < 4000 && t <= 10; i++) {
                es_rigid_shape_closest(&shape, &pose, es_v3_mad(p, d, t), 1e9f, &at);
                if (at.distance < 1e-4f) {
                    truth = true;
                    break;
                }
                t += at.distance;
            }
            if (found) {
                assert_float_equal(es_v3_length(hit.normal), 1, 2e-6f);
                es_rigid_shape_closest(&shape, &pose, hit.point, 1e9f, &at);
                if (hit.distance > 0) assert_true(fabsf(at.distance) < 1e-4f);
                if (hit.distance > 0) assert_true(es_v3_dot(hit.normal, d) < 1e-3f);
                for (int i = 0; i < 50 && hit.distance > 0; i++) { /* nothing before it */
                    es_rigid_shape_closest(&shape, &pose, es_v3_mad(p, d, hit.distance * (float)i / 50), 1e9f, &at);
                    assert_true(at.distance > -2e-4f);
                }
            } else if (truth) { /* grazing: the least distance is hardly negative */
                float least = 3e38f;
                for (float u = t; u < t + 0.5f; u += 1e-3f) {
                    es_rigid_shape_closest(&shape, &pose, es_v3_mad(p, d, u), 1e9f, &at);
                    least = fminf(least, at.distance);
                }
                assert_true(least > -2e-4f);
            }
        }
        es_rigid_shape_free(f->context, &shape);
    }
}

static void distances(void** state)
{
    fixture* f = *state;
    uint32_t s = 321;
    float points_a[3 * 24], points_b[3 * 24];
    for (int round = 0; round < 600 / SLOWER; round++) {
        es_rigid_shape a = make(f, random_desc(&s, round % 4, points_a, round & 1, round & 2)), b = make(f, random_desc(&s, round / 4 % 4, points_b, round & 1, round & 2));
        es_pose pa = {random_vector(&s, 0.2f), random_rotation(&s)}, pb = {random_vector(&s, 2.5f), random_rotation(&s)};
        es_vec3 on_a, on_b;
        float distance = es_rigid_distance(&a, &pa, &b, &pb, 1e9f, &on_a, &on_b), other = es_rigid_distance(&b, &pb, &a, &pa, 1e9f, &on_b, &on_a);
        assert_float_equal(distance, other, 1e-5f);
        distance = es_rigid_distance(&a, &pa, &b, &pb, 1e9f, &on_a, &on_b);
        exact_core ca = exact_core_of(&a, &pa), cb = exact_core_of(&b, &pb);
        double bound = fmax(exact_separation(&ca, &cb), exact_distance(&ca, &cb)) - ca.radius - cb.radius;
        assert_true(distance >= bound - 1e-4);
        if (distance > 0) { /* and the points prove it from the other side */
            es_vec3 d = es_v3_sub(on_b, on_a);
            assert_float_equal(es_v3_length(d), distance, 2e-5f);
            double n[3] = {d.x, d.y, d.z};
            if (distance > 1e-2f) assert_float_equal(exact_gap(&ca, &cb, n) - ca.radius - cb.radius, distance, 2e-4f);
            es_shape_hit hit;
            es_rigid_shape_closest(&a, &pa, on_a, 1e9f, &hit);
            assert_true(fabsf(hit.distance) < 1e-4f);
            es_rigid_shape_closest(&b, &pb, on_b, 1e9f, &hit);
            assert_true(fabsf(hit.distance) < 1e-4f);
        }
        assert_int_equal(es_rigid_overlap(&a, &pa, &b, &pb), distance <= 0);
        es_rigid_shape_free(f->context, &a);
        es_rigid_shape_free(f->context, &b);
    }
}

/* ---- time of impact ---------------------------------------------------------------------------------------------------------------- */

static void times_of_impact(void** state)
{
    fixture* f = *state;
    uint32_t s = 55, hits = 0;
    float points_a[3 * 24], points_b[3 * 24];
    const float target = 0.01f;
    for (int round = 0; round < 300 / SLOWER; round++) {
        es_rigid_shape a = make(f, random_desc(&s, round % 4, points_a, round & 1, false)), b = make(f, random_desc(&s, round / 4 % 4, points_b, round & 1, false));
        es_sweep sa = {random_vector(&s, 0.2f), random_vector(&s, 1), random_vector(&s, 1), random_rotation(&s), random_rotation(&s)};
        es_sweep sb = {random_vector(&s, 0.2f), es_v3_add(random_vector(&s, 1), es_v3(6, 0, 0)), es_v3_add(random_vector(&s, 2), es_v3(round & 8 ? -6 : 1.0f, 0, 0)),
            random_rotation(&s), random_rotation(&s)};
        float t = es_rigid_time_of_impact(&a, &sa, &b, &sb, target);
        assert_true(t >= 0 && t <= 1);
        for (int i = 0; i <= 200; i++) { /* never late: nowhere before it are they within the target */
            float u = t * (float)i / 200;
            es_pose pa = es_sweep_pose(&sa, u), pb = es_sweep_pose(&sb, u);
            es_vec3 on_a, on_b;
            float distance = es_rigid_distance(&a, &pa, &b, &pb, 1e9f, &on_a, &on_b);
            if (t > 0) assert_true(distance >= target - 1e-4f);
            if (i == 200 && t < 1) {
                assert_true(distance <= 1.26f * target + 1e-4f);
                hits++;
            }
        }
        es_rigid_shape_free(f->context, &a);
        es_rigid_shape_free(f->context, &b);
    }
    assert_true(hits > 20 / SLOWER);
    /* 500 m/s through a thin wall */
    es_rigid_shape wall = make(f, box_desc(0.01f, 5, 5)), bullet = make(f, sphere_desc(0.05f));
    es_sweep still = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0, 1}, {0, 0, 0, 1}}, fast = {{0, 0, 0}, {-4, 0, 0}, {4.333f, 0, 0}, {0, 0, 0, 1}, {0, 0, 0, 1}};
    float t = es_rigid_time_of_impact(&wall, &still, &bullet, &fast, 0.005f), x = -4 + t * 8.333f;
    assert_true(x < -0.06f && x > -0.068f);
    es_rigid_shape_free(f->context, &wall);
    es_rigid_shape_free(f->context, &bullet);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(refusals, set_up, tear_down),
        cmocka_unit_test_setup_teardown(hulls, set_up, tear_down),
        cmocka_unit_test_setup_teardown(masses, set_up, tear_down),
        cmocka_unit_test_setup_teardown(bounds_hold, set_up, tear_down),
        cmocka_unit_test_setup_teardown(tree_against_brute_force, set_up, tear_down),
        cmocka_unit_test_setup_teardown(rays_and_points, set_up, tear_down),
        cmocka_unit_test_setup_teardown(distances, set_up, tear_down),
        cmocka_unit_test_setup_teardown(times_of_impact, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
