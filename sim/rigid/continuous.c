/* Fast bodies stop at what they would pass: continuous collision.
 *
 * A body that moved farther in a step than it is thick is swept from where it was to where it is; it is set back to the first time at which it
 * comes close to something. What was close already when the step began is the contacts' to keep out, but for the body's middle. There it has a contact in the next step, and its speed is the
 * solver's. What it loses is the rest of that step's way. Static and kinematic bodies stop every fast body, dynamic ones those with `continuous`. */
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/joints.h"
#include "sim/rigid/rigid.h"

#define ES_TOUCHING_DISTANCE 0.005f /* m: less than the contact margin */

typedef struct flight {
    es_world* world;
    const es_body_object* body;
    es_sweep sweep;                 /* relative to where the body's centre was */
    float first;                    /* share of the way */
} flight;

static es_vec3 difference(const double a[3], const double b[3]) { return es_v3((float)(a[0] - b[0]), (float)(a[1] - b[1]), (float)(a[2] - b[2])); }

static es_sweep sweep_of(const es_body_object* body, const double origin[3], bool moves)
{
    return (es_sweep){
        .local_centre = body->local_centre,
        .from = difference(moves ? body->previous_centre : body->centre, origin),
        .to = difference(body->centre, origin),
        .rotation_from = moves ? body->previous_rotation : body->rotation,
        .rotation_to = body->rotation,
    };
}

/* A ball in the middle of the shape: what is close to an obstacle when it starts may turn into it, but its middle may not pass. */
static es_rigid_shape core_of(const es_rigid_shape* shape)
{
    float r = es_maxf(0.25f * shape->inner_radius, ES_SHAPE_SMALLEST);
    es_vec3 c = shape->centre, around = es_v3(r, r, r);
    return (es_rigid_shape){
        .type = ES_SHAPE_SPHERE,
        .radius = r,
        .centre = c,
        .rotation = es_quat_identity(),
        .low = es_v3_sub(c, around),
        .high = es_v3_add(c, around),
        .inner_radius = r,
        .outer_radius = es_v3_length(c) + r,
    };
}

/* The least over all that are met, so their order does not matter. */
static bool meet(void* user, uint32_t key)
{
    flight* f = user;
    const es_body_object *other = es_body_of_key(f->world, key), *body = f->body;
    const es_rigid_shape* obstacle = es_shape_of_key(f->world, key);
    if (other == body || obstacle->sensor || (other->type == ES_BODY_DYNAMIC && !body->continuous) || es_joint_keeps_apart(f->world, body, other)) return true;
    es_sweep path = sweep_of(other, body->previous_centre, other->type != ES_BODY_STATIC);
    for (uint32_t i = 0; i < body->shape_count; i++) {
        const es_rigid_shape* shape = &body->shapes[i];
        if (shape->sensor || !(shape->category & obstacle->mask) || !(obstacle->category & shape->mask)) continue;
        float t = es_rigid_time_of_impact(obstacle, &path, shape, &f->sweep, ES_TOUCHING_DISTANCE);
        if (t <= 0) {
            const es_rigid_shape core = core_of(shape);
            t = es_rigid_time_of_impact(obstacle, &path, &core, &f->sweep, ES_TOUCHING_DISTANCE);
        }
        if (t > 0 && t < f->first) f->first = t;
    }
    return true;
}

/* Both ends' bounds around all shapes; straight between, so nothing on the way is outside, but for the corners of what turns. */
static es_tree_box way_box(const es_rigid* rigid, const es_body_object* body)
{
    es_tree_box box;
    for (int k = 0; k < 3; k++) {
        float from = (float)(body->previous_centre[k] - rigid->origin[k]), to = (float)(body->centre[k] - rigid->origin[k]);
        float around = body->reach + ES_CONTACT_MARGIN + 0x1p-22f * (es_absf(from) + es_absf(to));
        (&box.low.x)[k] = es_minf(from, to) - around;
        (&box.high.x)[k] = es_maxf(from, to) + around;
    }
    return box;
}

void es_stop_fast_bodies(es_world* world)
{
    es_rigid* rigid = world->rigid;
    for (uint32_t i = 0; i < rigid->dynamic_count; i++) {
        es_body_object* body = es_slots_at(&world->slots[ES_OBJECT_BODY], rigid->moving[i]);
        if (body->shape_count == 0) continue;
        es_vec3 way = difference(body->centre, body->previous_centre);
        if (!(es_v3_length(way) > 0.5f * body->thickness)) continue;
        flight f = {world, body, sweep_of(body, body->previous_centre, true), 1.0f};
        es_dynamic_tree_query(&rigid->tree, way_box(rigid, body), UINT32_MAX, meet, &f);
        if (f.first >= 1.0f) continue;
        for (int k = 0; k < 3; k++) body->centre[k] = body->previous_centre[k] + (double)f.first * (double)(&way.x)[k];
        body->rotation = es_sweep_pose(&f.sweep, f.first).rotation;
    }
}
