/* Shapes of bodies as particles meet them within one step.
 *
 * Spheres and capsules are met anew in every substep, where they are by then. Of other shapes each particle keeps up to four planes for the
 * step, from the nearest point of the shape at the step's begin, which move as the surface does there. */
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/random.h"
#include "sim/rigid/rigid.h"

typedef struct found { es_soft_object* soft; es_context* context; bool good; const es_world* world; } found;

static bool take_key(void* user, uint32_t key)
{
    found* f = user;
    es_soft_object* soft = f->soft;
    if (es_shape_of_key(f->world, key)->sensor) return true;
    f->good = f->good && es_grow(f->context, (void**)&soft->keys, &soft->key_capacity, soft->key_count, soft->key_count + (size_t)1, sizeof *soft->keys);
    if (!f->good) return false;
    uint32_t at = soft->key_count++;
    for (; at > 0 && soft->keys[at - 1] > key; at--) soft->keys[at] = soft->keys[at - 1];
    soft->keys[at] = key;
    return true;
}

static es_vec3 relative(const double position[3], const double origin[3])
{
    return es_v3((float)(position[0] - origin[0]), (float)(position[1] - origin[1]), (float)(position[2] - origin[2]));
}

static es_vec3 at_pose(const es_pose* pose, es_vec3 local) { return es_v3_add(pose->position, es_quat_rotate(pose->rotation, local)); }

/* The way from a to b as a rotation vector; turns of a step are far below half a circle. */
static es_vec3 turn_between(es_quat a, es_quat b)
{
    es_quat d = es_quat_mul(b, (es_quat){-a.x, -a.y, -a.z, a.w});
    float sign = d.w < 0 ? -2.0f : 2.0f;
    return es_v3(d.x * sign, d.y * sign, d.z * sign);
}

static void poses_of(const es_soft_object* soft, const es_body_object* body, es_pose pose[2])
{
    double position[3];
    es_body_position(body, body->previous_centre, body->previous_rotation, position);
    pose[0] = (es_pose){relative(position, soft->origin), body->previous_rotation};
    es_body_position(body, body->centre, body->rotation, position);
    pose[1] = (es_pose){relative(position, soft->origin), body->rotation};
}

static es_soft_obstacle make_obstacle(const es_soft_object* soft, es_body_object* body, const es_rigid_shape* shape)
{
    es_pose pose[2];
    poses_of(soft, body, pose);
    es_soft_obstacle o = {.body = body, .shape = shape, .radius = shape->radius, .friction = es_maxf(soft->desc.friction, shape->friction),
        .capsule = shape->type == ES_SHAPE_SPHERE || shape->type == ES_SHAPE_CAPSULE, .pushed = body->type == ES_BODY_DYNAMIC};
    es_vec3 low[2], high[2];
    for (int k = 0; k < 2; k++) {
        bool sphere = shape->type == ES_SHAPE_SPHERE;
        o.a[k] = at_pose(&pose[k], sphere ? shape->centre : shape->segment[0]);
        o.b[k] = at_pose(&pose[k], sphere ? shape->centre : shape->segment[1]);
        es_rigid_shape_bounds(shape, &pose[k], &low[k], &high[k]);
    }
    o.centre[0] = relative(body->previous_centre, soft->origin);
    o.centre[1] = relative(body->centre, soft->origin);
    o.turned = turn_between(body->previous_rotation, body->rotation);
    o.low = es_v3(es_minf(low[0].x, low[1].x), es_minf(low[0].y, low[1].y), es_minf(low[0].z, low[1].z));
    o.high = es_v3(es_maxf(high[0].x, high[1].x), es_maxf(high[0].y, high[1].y), es_maxf(high[0].z, high[1].z));
    return o;
}

typedef struct plane_job { es_soft_object* soft; float h; } plane_job;

static void plane_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const plane_job* job = user;
    es_soft_object* soft = job->soft;
    const float h = job->h;
    for (uint32_t s = begin; s < end; s++) {
        soft->plane_count[s] = 0;
        if (soft->layout.particle_of[s] == ES_SOFT_NONE) continue;
        const float *x = soft->x + 4 * (size_t)s, *v = soft->velocity + 4 * (size_t)s;
        const es_vec3 p = es_v3(x[0], x[1], x[2]);
        const float ahead = soft->desc.thickness + 0.01f + 1.5f * h * (es_v3_length(es_v3(v[0], v[1], v[2])) + 10.0f * h);
        for (uint32_t i = 0; i < soft->obstacle_count && soft->plane_count[s] < ES_SOFT_PLANES; i++) {
            const es_soft_obstacle* o = &soft->obstacles[i];
            if (o->capsule) continue;
            const es_vec3 moved = es_v3_sub(o->centre[1], o->centre[0]);
            const float margin = ahead + es_v3_length(moved);
            if (p.x < o->low.x - margin || p.y < o->low.y - margin || p.z < o->low.z - margin || p.x > o->high.x + margin || p.y > o->high.y + margin || p.z > o->high.z + margin) continue;
            es_pose pose[2];
            es_shape_hit hit;
            poses_of(soft, o->body, pose);
            if (!es_rigid_shape_closest(o->shape, &pose[0], p, margin, &hit)) continue;
            es_vec3 turning = es_v3_cross(o->turned, es_v3_sub(hit.point, o->centre[0]));
            soft->planes[(size_t)s * ES_SOFT_PLANES + soft->plane_count[s]++] =
                (es_soft_plane){.normal = hit.normal, .offset = es_v3_dot(hit.normal, hit.point), .velocity = es_v3_scale(es_v3_add(moved, turning), 1.0f / h), .obstacle = i};
        }
    }
}

/* Boxes round what moves, thickness included; relative to the rigid bodies' origin. */
static es_tree_box reach_of(const es_soft_object* soft, const double origin[3], float h)
{
    es_vec3 low = es_v3(3e38f, 3e38f, 3e38f), high = es_v3(-3e38f, -3e38f, -3e38f);
    for (uint32_t s = 0; s < soft->layout.slot_count; s++) {
        if (soft->layout.particle_of[s] == ES_SOFT_NONE) continue;
        const float *x = soft->x + 4 * (size_t)s, *v = soft->velocity + 4 * (size_t)s;
        for (int end = 0; end < 2; end++) {
            es_vec3 p = es_v3(x[0] + v[0] * h * (float)end, x[1] + v[1] * h * (float)end, x[2] + v[2] * h * (float)end);
            low = es_v3(es_minf(low.x, p.x), es_minf(low.y, p.y), es_minf(low.z, p.z));
            high = es_v3(es_maxf(high.x, p.x), es_maxf(high.y, p.y), es_maxf(high.z, p.z));
        }
    }
    const float margin = soft->desc.thickness + 0.02f + 10.0f * h * h;
    es_vec3 shift = es_v3((float)(soft->origin[0] - origin[0]), (float)(soft->origin[1] - origin[1]), (float)(soft->origin[2] - origin[2]));
    shift = es_v3(es_clampf(shift.x, -1e9f, 1e9f), es_clampf(shift.y, -1e9f, 1e9f), es_clampf(shift.z, -1e9f, 1e9f));
    return (es_tree_box){es_v3(low.x + shift.x - margin, low.y + shift.y - margin, low.z + shift.z - margin),
        es_v3(high.x + shift.x + margin, high.y + shift.y + margin, high.z + shift.z + margin)};
}

bool es_soft_gather_obstacles(es_world* world, es_soft_object* soft, float h)
{
    es_context* context = world->context;
    soft->obstacle_count = soft->key_count = 0;
    uint64_t seen = 0;
    if (world->rigid) {
        found f = {soft, context, true, world};
        es_dynamic_tree_query(&world->rigid->tree, reach_of(soft, world->rigid->origin, h), UINT32_MAX, take_key, &f);
        if (!f.good || !es_grow(context, (void**)&soft->obstacles, &soft->obstacle_capacity, 0, soft->key_count + (size_t)1, sizeof *soft->obstacles)) return false;
    }
    bool planes = false;
    for (uint32_t i = 0; i < soft->key_count && i < ES_SOFT_OBSTACLES; i++) {
        es_body_object* body = es_body_of_key(world, soft->keys[i]);
        soft->obstacles[soft->obstacle_count++] = make_obstacle(soft, body, es_shape_of_key(world, soft->keys[i]));
        planes |= !soft->obstacles[i].capsule;
        seen = es_hash_bytes(seen, &soft->keys[i], sizeof soft->keys[i]);
        seen = es_hash_bytes(seen, body->centre, sizeof body->centre);
        seen = es_hash_bytes(seen, &body->rotation, sizeof body->rotation);
    }
    if (seen != soft->seen && soft->asleep) es_soft_wake(soft);
    soft->seen = seen;
    if (soft->asleep || !planes) {
        soft->plane_slots = planes ? soft->plane_slots : 0;
        return true;
    }
    const size_t slots = soft->layout.slot_count;
    if (!es_grow(context, (void**)&soft->planes, &soft->plane_capacity, 0, slots * ES_SOFT_PLANES, sizeof *soft->planes) ||
        !es_grow(context, (void**)&soft->plane_count, &soft->plane_count_capacity, 0, slots, 1))
        return false;
    soft->plane_slots = (uint32_t)slots;
    plane_job job = {soft, h};
    es_parallel_for(context, (uint32_t)slots, 128, plane_body, &job);
    return true;
}

/* What a sleeping body feels of a cloth that lies on it still is what it felt when it fell asleep. */
static bool wakes(const es_body_object* body, es_vec3 impulse)
{
    return !body->asleep || es_v3_length(impulse) * body->inverse_mass > 0.05f;
}

void es_soft_push_bodies(es_world* world, es_soft_object* soft, float h)
{
    for (uint32_t i = 0; i < soft->obstacle_count; i++) {
        if (!soft->obstacles[i].pushed) continue;
        float sum[6] = {0};
        for (uint32_t b = 0; b < soft->layout.band_count; b++)
            for (int k = 0; k < 6; k++) sum[k] -= soft->pushes[6 * ((size_t)soft->obstacle_count * b + i) + k] / h;
        es_vec3 impulse = es_v3(sum[0], sum[1], sum[2]), turn = es_v3(sum[3], sum[4], sum[5]);
        if (!es_all_within(sum, 6, 1e12f) || (es_v3_dot(impulse, impulse) == 0 && es_v3_dot(turn, turn) == 0)) continue;
        es_body_object* body = soft->obstacles[i].body;
        if (!wakes(body, impulse)) continue;
        es_body_wake(world, body);
        es_body_push(body, impulse, turn);
    }
    for (uint32_t i = 0; i < soft->hold_count; i++) {
        es_body_object* body = soft->holds[i].body ? es_slots_get(&world->slots[ES_OBJECT_BODY], soft->holds[i].body) : NULL;
        if (!body || body->type != ES_BODY_DYNAMIC) continue;
        const float* p = soft->pulls + 3 * (size_t)i;
        es_vec3 impulse = es_v3(p[0] / h, p[1] / h, p[2] / h);
        const float* end = soft->anchors.end + 4 * (size_t)i;
        es_vec3 arm = es_v3_sub(es_v3(end[0], end[1], end[2]), relative(body->centre, soft->origin));
        if (!es_all_within(&impulse.x, 3, 1e12f) || !wakes(body, impulse)) continue;
        es_body_wake(world, body);
        es_body_push(body, impulse, es_v3_cross(arm, impulse));
    }
}
