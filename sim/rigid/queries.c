/* Rays, overlaps and nearest points in the world: candidates from the tree, then each shape relative to what is asked, so that precision is the same
 * far from zero. Answers do not depend on the order in which the tree hands out candidates. */
#include <stdlib.h>
#include <string.h>

#include "platform/context.h"
#include "sim/rigid/frame.h"
#include "sim/rigid/rigid.h"

/* Where the tree's boxes have their zero, and what a float loses on the way there. */
static es_vec3 in_tree(const es_rigid* rigid, const double p[3], float* slack)
{
    es_vec3 v = es_v3((float)(p[0] - rigid->origin[0]), (float)(p[1] - rigid->origin[1]), (float)(p[2] - rigid->origin[2]));
    *slack = 0x1p-22f * (es_absf(v.x) + es_absf(v.y) + es_absf(v.z));
    return v;
}

static bool place_usable(const double p[3])
{
    for (int k = 0; k < 3; k++)
        if (!(p[k] >= -ES_WORLD_EXTENT && p[k] <= ES_WORLD_EXTENT)) return false;
    return true;
}

/* ---- rays ------------------------------------------------------------------------------------------------------------------------- */

typedef struct ray {
    const es_world* world;
    const double* origin;
    es_vec3 direction;
    float slack;
    uint32_t key;            /* of the nearest so far; UINT32_MAX: none */
    es_shape_hit hit;
} ray;

static float ray_meets(void* user, uint32_t key, float max)
{
    ray* r = user;
    const es_body_object* body = es_body_of_key(r->world, key);
    es_pose pose = es_body_pose(body, r->origin);
    es_shape_hit hit;
    float limit = r->key == UINT32_MAX ? max - r->slack : r->hit.distance;
    if (!es_rigid_shape_ray(es_shape_of_key(r->world, key), &pose, es_v3(0, 0, 0), r->direction, limit, &hit)) return max;
    if (r->key != UINT32_MAX && (hit.distance > r->hit.distance || (hit.distance == r->hit.distance && key > r->key))) return max;
    r->key = key;
    r->hit = hit;
    return hit.distance + r->slack;
}

bool es_world_cast_ray(const es_world* world, const double origin[3], es_vec3 direction, float max, uint32_t mask, es_ray_contact* contact)
{
    *contact = (es_ray_contact){{0}};
    float length = es_v3_length(direction);
    if (!place_usable(origin) || !es_within(length, 1e-18f, 1e18f) || !es_within(max, 0, 3e9f)) {
        es_misuse(world->context, ES_INVALID_ARGUMENT, "a ray must begin within 1e9, have a direction, and a length of 0 … 3e9 m");
        return false;
    }
    const es_rigid* rigid = world->rigid;
    if (!rigid) return false;
    es_fp_environment environment = es_fp_enter();
    ray r = {.world = world, .origin = origin, .direction = es_v3_normalize(direction, es_v3(0, 0, -1)), .key = UINT32_MAX};
    es_vec3 from = in_tree(rigid, origin, &r.slack);
    es_dynamic_tree_ray(&rigid->tree, from, r.direction, max + r.slack, mask ? mask : UINT32_MAX, ray_meets, &r);
    if (r.key != UINT32_MAX) {
        contact->body.id = es_body_of_key(world, r.key)->object.id;
        contact->shape = r.key & (ES_SHAPES_PER_BODY - 1);
        contact->triangle = r.hit.triangle;
        contact->distance = r.hit.distance;
        contact->normal = r.hit.normal;
        for (int k = 0; k < 3; k++) contact->point[k] = origin[k] + (double)r.hit.distance * (double)(&r.direction.x)[k];
    }
    es_fp_leave(environment);
    return r.key != UINT32_MAX;
}

/* ---- nearest points ------------------------------------------------------------------------------------------------------------------ */

static float nearer(void* user, uint32_t key, float max)
{
    ray* r = user;
    const es_body_object* body = es_body_of_key(r->world, key);
    es_pose pose = es_body_pose(body, r->origin);
    es_shape_hit hit;
    float limit = r->key == UINT32_MAX ? max - r->slack : r->hit.distance;
    if (!es_rigid_shape_closest(es_shape_of_key(r->world, key), &pose, es_v3(0, 0, 0), limit, &hit)) return max;
    if (r->key != UINT32_MAX && (hit.distance > r->hit.distance || (hit.distance == r->hit.distance && key > r->key))) return max;
    r->key = key;
    r->hit = hit;
    return es_maxf(hit.distance, 0) + r->slack; /* inside of one, others may hold the point more deeply */
}

bool es_world_closest_point(const es_world* world, const double point[3], float max_distance, uint32_t mask, es_closest* closest)
{
    *closest = (es_closest){{0}};
    if (!place_usable(point) || !es_within(max_distance, 0, 3e9f)) {
        es_misuse(world->context, ES_INVALID_ARGUMENT, "the nearest point is looked for from within 1e9, over 0 … 3e9 m");
        return false;
    }
    const es_rigid* rigid = world->rigid;
    if (!rigid) return false;
    es_fp_environment environment = es_fp_enter();
    ray r = {.world = world, .origin = point, .key = UINT32_MAX};
    es_vec3 from = in_tree(rigid, point, &r.slack);
    es_dynamic_tree_near(&rigid->tree, from, max_distance + r.slack, mask ? mask : UINT32_MAX, nearer, &r);
    if (r.key != UINT32_MAX) {
        closest->body.id = es_body_of_key(world, r.key)->object.id;
        closest->shape = r.key & (ES_SHAPES_PER_BODY - 1);
        closest->triangle = r.hit.triangle;
        closest->distance = r.hit.distance;
        closest->normal = r.hit.normal;
        for (int k = 0; k < 3; k++) closest->point[k] = point[k] + (double)(&r.hit.point.x)[k];
    }
    es_fp_leave(environment);
    return r.key != UINT32_MAX;
}

/* ---- overlaps --------------------------------------------------------------------------------------------------------------------------- */

typedef struct overlap {
    es_world* world;
    const es_rigid_shape* shape;
    const double* position;
    es_quat rotation;
    uint32_t* found;         /* body slots */
    size_t count, capacity;
    bool failed;
} overlap;

static bool overlaps(void* user, uint32_t key)
{
    overlap* o = user;
    const es_body_object* body = es_body_of_key(o->world, key);
    es_pose pose = es_body_pose(body, o->position), own = {{0, 0, 0}, o->rotation};
    if (!es_rigid_overlap(es_shape_of_key(o->world, key), &pose, o->shape, &own)) return true;
    if (!es_grow(o->world->context, (void**)&o->found, &o->capacity, o->count, o->count + 1, sizeof *o->found)) {
        o->failed = true;
        return false;
    }
    o->found[o->count++] = key >> ES_SHAPE_BITS;
    return true;
}

static int by_number(const void* a, const void* b)
{
    uint32_t x = *(const uint32_t*)a, y = *(const uint32_t*)b;
    return x < y ? -1 : x > y;
}

es_result es_world_overlap(es_world* world, const es_shape_desc* desc, const double position[3], es_quat rotation, uint32_t mask, es_body* bodies, size_t* count)
{
    es_context* context = world->context;
    if (!place_usable(position) || !es_all_within(&rotation.x, 4, 1e6f))
        return es_misuse(context, ES_INVALID_ARGUMENT, "overlaps are looked for within 1e9, with a finite rotation");
    if (desc->type == ES_SHAPE_MESH) return es_misuse(context, ES_INVALID_ARGUMENT, "overlaps are looked for with a sphere, box, capsule or hull, not with a mesh");
    es_fp_environment environment = es_fp_enter();
    es_rigid_shape shape;
    overlap o = {.world = world, .shape = &shape, .position = position, .rotation = es_quat_normalize(rotation)};
    es_result result = es_rigid_shape_make(world, desc, "a shape to overlap with", &shape);
    if (result == ES_OK && world->rigid) {
        float slack;
        es_pose pose = {in_tree(world->rigid, position, &slack), o.rotation};
        es_tree_box box;
        es_rigid_shape_bounds(&shape, &pose, &box.low, &box.high);
        box.low = es_v3_sub(box.low, es_v3(slack, slack, slack));
        box.high = es_v3_add(box.high, es_v3(slack, slack, slack));
        es_dynamic_tree_query(&world->rigid->tree, box, mask ? mask : UINT32_MAX, overlaps, &o);
        if (o.failed) result = ES_OUT_OF_MEMORY;
    }
    if (result == ES_OK) { /* each body once, in the order of their slots */
        if (o.count > 1) qsort(o.found, o.count, sizeof *o.found, by_number);
        size_t kept = 0;
        for (size_t i = 0; i < o.count; i++)
            if (i == 0 || o.found[i] != o.found[i - 1]) o.found[kept++] = o.found[i];
        for (size_t i = 0; bodies && i < kept && i < *count; i++) bodies[i].id = es_body_of_key(world, o.found[i] << ES_SHAPE_BITS)->object.id;
        *count = kept;
    }
    es_release(context, o.found, o.capacity * sizeof *o.found);
    es_rigid_shape_free(context, &shape);
    es_fp_leave(environment);
    return result;
}
