/* Shapes of bodies from any numbers, and any two of them in any poses: what is accepted has a finite mass and bounds, and contact, distances
 * and rays are finite, of unit normals, and the same again. */
#include <math.h>
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/collision.h"
#include "tests/fuzz/fuzz.h"

enum { CAP = 48 << 20, POINTS = 40 };

/* Any bits now and then; mostly numbers of a usable size, coarse ones among them, so that things line up. */
static float take_number(fuzz_bytes* in)
{
    uint32_t kind = fuzz_take(in, 1), bits = fuzz_take(in, 2);
    if (kind == 255) {
        bits |= fuzz_take(in, 2) << 16;
        float any;
        memcpy(&any, &bits, sizeof any);
        return any;
    }
    float value = (float)bits / 32768.0f - 1;
    if (kind & 1) value = (float)(int)(value * 4) / 4;
    return kind & 2 ? value * 100 : value;
}
static es_vec3 take_vector(fuzz_bytes* in)
{
    float x = take_number(in), y = take_number(in), z = take_number(in);
    return (es_vec3){x, y, z};
}
static es_quat take_rotation(fuzz_bytes* in)
{
    float x = take_number(in), y = take_number(in), z = take_number(in), w = take_number(in);
    return (es_quat){x, y, z, w};
}

static es_shape_desc take_shape(fuzz_bytes* in, float points[3 * POINTS], es_mesh mesh)
{
    es_shape_desc d = es_default_shape_desc();
    uint32_t kind = fuzz_take(in, 1);
    d.type = (es_shape_type)(kind % 5);
    if (kind & 8) d.position = take_vector(in);
    if (kind & 16) d.rotation = take_rotation(in);
    if (kind & 32 || d.type == ES_SHAPE_SPHERE || d.type == ES_SHAPE_CAPSULE) d.radius = take_number(in);
    if (kind & 64) d.scale = take_vector(in);
    if (kind & 128) d.density = 1000 * take_number(in);
    d.half_height = take_number(in);
    d.half_extents = take_vector(in);
    d.mesh = mesh;
    if (d.type == ES_SHAPE_HULL) {
        d.points = points;
        d.point_count = fuzz_take(in, 1) % (POINTS + 1);
        for (uint32_t i = 0; i < 3 * d.point_count; i++) points[i] = take_number(in);
    }
    return d;
}

static bool finite3(es_vec3 v) { return isfinite(v.x) && isfinite(v.y) && isfinite(v.z); }
static bool unit(es_vec3 v) { return fabsf(v.x * v.x + v.y * v.y + v.z * v.z - 1) < 1e-3f; }

static void check_shape(const es_rigid_shape* shape)
{
    es_mass mass = es_rigid_shape_mass(shape);
    FUZZ_CHECK(mass.mass >= 0 && isfinite(mass.mass) && finite3(mass.centre), "mass %g", mass.mass);
    for (int k = 0; k < 6; k++) FUZZ_CHECK(isfinite(mass.inertia[k]) && (k > 2 || mass.inertia[k] >= 0), "inertia %d is %g", k, mass.inertia[k]);
    FUZZ_CHECK(finite3(shape->low) && finite3(shape->high) && isfinite(shape->outer_radius) && shape->inner_radius >= 0, "bounds");
    const es_hull* h = &shape->hull;
    if (h->vertex_count) FUZZ_CHECK(h->vertex_count + h->face_count == h->half_edge_count / 2 + 2, "not a sphere's surface");
    for (uint32_t f = 0; f < h->face_count; f++) {
        FUZZ_CHECK(unit(h->planes[f].normal), "face %u", f);
        for (uint32_t v = 0; v < h->vertex_count; v++) {
            es_vec3 p = h->vertices[v], n = h->planes[f].normal;
            float out = n.x * p.x + n.y * p.y + n.z * p.z - h->planes[f].offset;
            FUZZ_CHECK(out <= 2e-4f * shape->outer_radius, "vertex %u is %g outside of face %u", v, out, f);
        }
    }
}

static void check_pair(const es_rigid_shape* a, const es_pose* pa, const es_rigid_shape* b, const es_pose* pb, float margin)
{
    es_manifold m[ES_MESH_MANIFOLDS], again[ES_MESH_MANIFOLDS];
    uint32_t count = es_rigid_collide(a, pa, b, pb, margin, m, ES_MESH_MANIFOLDS);
    FUZZ_CHECK(count <= ES_MESH_MANIFOLDS && count == es_rigid_collide(a, pa, b, pb, margin, again, ES_MESH_MANIFOLDS), "%u manifolds", count);
    for (uint32_t i = 0; i < count; i++) {
        FUZZ_CHECK(unit(m[i].normal) && m[i].count >= 1 && m[i].count <= ES_MANIFOLD_POINTS && (i == 0 || m[i].key > m[i - 1].key), "manifold %u", i);
        for (uint32_t k = 0; k < m[i].count; k++) {
            const es_manifold_point* p = &m[i].points[k];
            FUZZ_CHECK(finite3(p->point) && isfinite(p->separation) && p->separation <= margin * 1.01f + 1e-3f * (a->outer_radius + b->outer_radius), "point %u", k);
            FUZZ_CHECK(memcmp(p, &again[i].points[k], sizeof *p) == 0, "not the same again");
            for (uint32_t j = 0; j < k; j++) FUZZ_CHECK(p->id != m[i].points[j].id, "two points of one id");
        }
    }
    es_vec3 on_a, on_b;
    float distance = es_rigid_distance(a, pa, b, pb, 1e6f, &on_a, &on_b);
    FUZZ_CHECK(distance >= 0 && distance <= 1e6f, "distance %g", distance);
}

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size)
{
    fuzz_bytes in = {bytes, size};
    fuzz_run run;
    fuzz_start(&run, CAP);
    es_world* world = NULL;
    if (fuzz_expect(&run, es_world_create(run.context, NULL, &world)) == ES_OK) {
        float corners[9 * 6], points[2][3 * POINTS];
        uint32_t indices[18], triangles = 1 + fuzz_take(&in, 1) % 6;
        for (uint32_t i = 0; i < 9 * triangles; i++) {
            float x = take_number(&in);
            corners[i] = isfinite(x) && fabsf(x) < 1e4f ? x : 0;
        }
        for (uint32_t i = 0; i < 3 * triangles; i++) indices[i] = i;
        es_mesh mesh = {0};
        es_mesh_desc desc = {.vertex_count = 3 * triangles, .triangle_count = triangles, .positions = corners, .indices = indices};
        fuzz_expect(&run, es_world_add_mesh(world, &desc, &mesh));
        es_rigid_shape shape[2];
        bool made[2];
        es_pose pose[2];
        for (int i = 0; i < 2; i++) {
            es_shape_desc d = take_shape(&in, points[i], mesh);
            made[i] = fuzz_expect(&run, es_rigid_shape_make(world, &d, "shape", &shape[i])) == ES_OK;
            if (made[i]) check_shape(&shape[i]);
            es_vec3 p = take_vector(&in), r = take_vector(&in);
            float w = take_number(&in);
            bool usable = finite3(p) && finite3(r) && isfinite(w) && fabsf(p.x) < 1e5f && fabsf(p.y) < 1e5f && fabsf(p.z) < 1e5f;
            pose[i] = (es_pose){usable ? p : (es_vec3){0, 0, 0}, usable ? es_quat_normalize((es_quat){r.x, r.y, r.z, w}) : es_quat_identity()};
        }
        for (int i = 0; i < 2; i++) {
            es_shape_hit hit;
            if (!made[i]) continue;
            if (es_rigid_shape_ray(&shape[i], &pose[i], pose[!i].position, (es_vec3){0.6f, 0.8f, 0}, 1e4f, &hit))
                FUZZ_CHECK(hit.distance >= 0 && hit.distance <= 1e4f && unit(hit.normal) && finite3(hit.point), "ray");
            if (es_rigid_shape_closest(&shape[i], &pose[i], pose[!i].position, 1e4f, &hit))
                FUZZ_CHECK(hit.distance <= 1e4f && unit(hit.normal) && finite3(hit.point), "nearest point");
        }
        if (made[0] && made[1]) {
            check_pair(&shape[0], &pose[0], &shape[1], &pose[1], 0.02f);
            check_pair(&shape[1], &pose[1], &shape[0], &pose[0], 0);
        }
        for (int i = 0; i < 2; i++) es_rigid_shape_free(run.context, &shape[i]);
        es_world_destroy(world);
    }
    fuzz_end(&run);
    return 0;
}
