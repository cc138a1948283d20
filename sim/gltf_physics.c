/* From the file's words to bodies and joints.
 *
 * A collider belongs to the body of its nearest ancestor with motion, or to a static body of its own. Its place in the body comes from the
 * nodes' matrices as the file poses them; the body's frame is its node's without scale. Where the drafts allow more than the solver has
 * (joints of any combination of limits, combine modes, given inertia), the nearest it has is taken or the part is left out, with a warning. */
#include "sim/gltf_physics_parts.h"

#include <stdio.h>
#include <string.h>

#include "sim/world.h"

/* ---- bodies ---------------------------------------------------------------------------------------------------------------------- */

static es_result make_list(const es_gltf_loader* l, uint32_t capacity, es_gltf_shape_list* list)
{
    *list = (es_gltf_shape_list){.shapes = es_allocate_array(l->in->context, capacity, sizeof(es_shape_desc))};
    if (list->shapes) list->points = es_allocate_array(l->in->context, capacity, ES_GLTF_HULL_POINTS * 3 * sizeof(float));
    return list->points ? ES_OK : es_context_last_result(l->in->context);
}

static void free_list(const es_gltf_loader* l, uint32_t capacity, es_gltf_shape_list* list)
{
    es_release(l->in->context, list->shapes, capacity * sizeof(es_shape_desc));
    es_release(l->in->context, list->points, (size_t)capacity * ES_GLTF_HULL_POINTS * 3 * sizeof(float));
}

static const char* const body_types[] = {"static", "kinematic", "dynamic", NULL};

static es_result read_extras_body(es_gltf_loader* l, uint32_t n, const void* from, const char* where, es_body_desc* desc, const es_gltf_place* frame, es_gltf_shape_list* list)
{
    uint32_t type = desc->type;
    const void* shapes = es_gltf_member(l, from, "shapes");
    size_t length = 0;
    ES_GLTF_TRY(es_gltf_word(l, from, "type", body_types, where, &type)); /* checked before */
    ES_GLTF_TRY(es_gltf_number(l, from, "mass", 1e-6, 1e9, where, &desc->mass));
    ES_GLTF_TRY(es_gltf_numbers(l, from, "velocity", 3, -1e3, 1e3, where, &desc->velocity.x));
    ES_GLTF_TRY(es_gltf_numbers(l, from, "angularVelocity", 3, -1e3, 1e3, where, &desc->angular_velocity.x));
    ES_GLTF_TRY(es_gltf_number(l, from, "linearDamping", 0, 1e3, where, &desc->linear_damping));
    ES_GLTF_TRY(es_gltf_number(l, from, "angularDamping", 0, 1e3, where, &desc->angular_damping));
    ES_GLTF_TRY(es_gltf_number(l, from, "gravityScale", -100, 100, where, &desc->gravity_scale));
    ES_GLTF_TRY(es_gltf_flag(l, from, "continuous", where, &desc->continuous));
    ES_GLTF_TRY(es_gltf_flag(l, from, "asleep", where, &desc->asleep));
    bool moves = desc->type != ES_BODY_STATIC;
    if (!shapes) return es_gltf_add_extras_shape(l, n, from, where, moves, frame, list);
    if (!l->in->values->array_length(shapes, &length)) return es_gltf_damaged_member(l, where, "shapes", "must be an array");
    for (size_t i = 0; i < length; i++) {
        char place[128];
        snprintf(place, sizeof place, "%s.shapes[%zu]", where, i);
        ES_GLTF_TRY(es_gltf_add_extras_shape(l, n, l->in->values->element(shapes, i), place, moves, frame, list));
    }
    return ES_OK;
}

static es_result read_motion(es_gltf_loader* l, uint32_t n, const void* motion, const char* where, es_body_desc* desc, const es_gltf_place* frame)
{
    float unused[4], mass = -1;
    bool kinematic = false;
    if (!l->in->values->is_object(motion)) return es_gltf_damaged(l, where, "must be an object");
    ES_GLTF_TRY(es_gltf_flag(l, motion, "isKinematic", where, &kinematic));
    desc->type = kinematic || l->in->nodes[n].animated ? ES_BODY_KINEMATIC : ES_BODY_DYNAMIC;
    ES_GLTF_TRY(es_gltf_number(l, motion, "mass", 0, 1e9, where, &mass));
    ES_GLTF_TRY(es_gltf_numbers(l, motion, "linearVelocity", 3, -1e3, 1e3, where, &desc->velocity.x));
    ES_GLTF_TRY(es_gltf_numbers(l, motion, "angularVelocity", 3, -1e3, 1e3, where, &desc->angular_velocity.x));
    ES_GLTF_TRY(es_gltf_number(l, motion, "gravityFactor", -100, 100, where, &desc->gravity_scale));
    ES_GLTF_TRY(es_gltf_numbers(l, motion, "centerOfMass", 3, -1e9, 1e9, where, unused));
    ES_GLTF_TRY(es_gltf_numbers(l, motion, "inertiaDiagonal", 3, 0, 1e12, where, unused));
    ES_GLTF_TRY(es_gltf_numbers(l, motion, "inertiaOrientation", 4, -1, 1, where, unused));
    l->left.inertia += es_gltf_member(l, motion, "centerOfMass") || es_gltf_member(l, motion, "inertiaDiagonal") || es_gltf_member(l, motion, "inertiaOrientation");
    if (mass == 0) mass = 1e9f; /* stands for infinity */
    desc->mass = mass > 0 ? es_maxf(mass, 1e-6f) : 0;
    desc->velocity = es_quat_rotate(frame->rotation, desc->velocity);
    desc->angular_velocity = es_quat_rotate(frame->rotation, desc->angular_velocity);
    return ES_OK;
}

/* The colliders and triggers of one node. */
static es_result add_node_shapes(es_gltf_loader* l, uint32_t n, const es_gltf_place* frame, bool moves, es_gltf_shape_list* list)
{
    char where[96];
    const void *collider = es_gltf_rigid_part(l, n, "collider"), *trigger = es_gltf_rigid_part(l, n, "trigger");
    snprintf(where, sizeof where, "nodes[%u].extensions.KHR_physics_rigid_bodies.collider", n);
    if (collider) ES_GLTF_TRY(es_gltf_add_collider(l, n, collider, where, false, frame, moves, list));
    snprintf(where, sizeof where, "nodes[%u].extensions.KHR_physics_rigid_bodies.trigger", n);
    if (trigger) ES_GLTF_TRY(es_gltf_add_collider(l, n, trigger, where, true, frame, moves, list));
    return ES_OK;
}

static es_result unscaled_parents(const es_gltf_loader* l, uint32_t n, const char* where)
{
    int32_t parent = l->in->nodes[n].parent;
    if (parent < 0) return ES_OK;
    es_vec3 scale = es_gltf_place_of(l->in->world, l->in->nodes[parent].node).scale;
    const float each[3] = {scale.x, scale.y, scale.z};
    for (int k = 0; k < 3; k++)
        if (!(es_absf(each[k] - 1) < 1e-3f)) return es_gltf_damaged(l, where, "moves by physics below a node that is scaled; put the scale on its own node or below it");
    return ES_OK;
}

/* The body of node n with all that belongs to it: `next` links the nodes that n owns, n itself first. */
static es_result add_body(es_gltf_loader* l, uint32_t n, const int32_t* next, es_gltf_shape_list* list)
{
    const es_gltf_physics_node* node = &l->in->nodes[n];
    const void *motion = es_gltf_rigid_part(l, n, "motion"), *extras = es_gltf_extras_part(l, n, "body");
    char where[96];
    es_body_desc desc = es_default_body_desc();
    es_gltf_place frame = es_gltf_place_of(l->in->world, node->node);
    desc.node = node->node;
    desc.name = es_world_name(l->in->world, ES_OBJECT_NODE, node->node.id);
    desc.type = ES_BODY_STATIC;
    list->count = 0;
    snprintf(where, sizeof where, "nodes[%u].%s", n, extras ? "extras.earthshine.body" : "extensions.KHR_physics_rigid_bodies.motion");
    if (motion) ES_GLTF_TRY(read_motion(l, n, motion, where, &desc, &frame));
    if (extras) {
        uint32_t type = ES_BODY_DYNAMIC;
        if (!l->in->values->is_object(extras)) return es_gltf_damaged(l, where, "must be an object");
        ES_GLTF_TRY(es_gltf_word(l, extras, "type", body_types, where, &type));
        desc.type = (es_body_type)type;
        if (desc.type == ES_BODY_DYNAMIC && node->animated) desc.type = ES_BODY_KINEMATIC;
        ES_GLTF_TRY(read_extras_body(l, n, extras, where, &desc, &frame, list));
    }
    bool moves = desc.type != ES_BODY_STATIC;
    if (moves) {
        for (int32_t each = (int32_t)n; each >= 0; each = next[each]) ES_GLTF_TRY(add_node_shapes(l, (uint32_t)each, &frame, moves, list));
    } else {
        ES_GLTF_TRY(add_node_shapes(l, n, &frame, node->animated, list));
        if (node->animated) desc.type = ES_BODY_KINEMATIC;
    }
    if (desc.type == ES_BODY_DYNAMIC) {
        ES_GLTF_TRY(unscaled_parents(l, n, where));
        if (list->count == 0 && desc.mass == 0) desc.mass = 1;
    } else if (list->count == 0 && !moves) {
        return ES_OK;
    }
    desc.shapes = list->shapes;
    desc.shape_count = list->count;
    return es_world_add_body(l->in->world, &desc, &l->bodies[n]);
}

static bool moves_by_itself(const es_gltf_loader* l, uint32_t n)
{
    const void* extras = es_gltf_extras_part(l, n, "body");
    const void* type = extras ? es_gltf_member(l, extras, "type") : NULL;
    const char* text = type ? l->in->values->string(type) : NULL;
    return es_gltf_rigid_part(l, n, "motion") || (extras && !(text && strcmp(text, "static") == 0));
}

static es_result add_bodies(es_gltf_loader* l)
{
    const es_gltf_physics* in = l->in;
    size_t bytes = (in->node_count + (size_t)1) * sizeof(int32_t);
    int32_t *next = es_allocate(in->context, bytes), *last = next ? es_allocate(in->context, bytes) : NULL;
    if (!last) {
        es_release(in->context, next, bytes);
        return es_context_last_result(in->context);
    }
    for (uint32_t n = 0; n < in->node_count; n++) l->owner[n] = next[n] = last[n] = -1;
    for (uint32_t i = 0; i < in->order_count; i++) {
        uint32_t n = in->order[i];
        int32_t parent = in->nodes[n].parent;
        l->owner[n] = moves_by_itself(l, n) ? (int32_t)n : parent >= 0 ? l->owner[parent] : -1;
        if (l->owner[n] < 0) continue;
        if (l->owner[n] != (int32_t)n && (es_gltf_rigid_part(l, n, "collider") || es_gltf_rigid_part(l, n, "trigger"))) {
            next[last[l->owner[n]]] = (int32_t)n;
            last[l->owner[n]] = (int32_t)n;
        } else if (l->owner[n] == (int32_t)n) {
            last[n] = (int32_t)n;
        }
    }
    es_gltf_shape_list list;
    es_result result = make_list(l, ES_GLTF_SHAPES, &list);
    for (uint32_t i = 0; i < in->order_count && result == ES_OK; i++) {
        uint32_t n = in->order[i];
        bool own = l->owner[n] == (int32_t)n;
        bool lone = l->owner[n] < 0 && (es_gltf_rigid_part(l, n, "collider") || es_gltf_rigid_part(l, n, "trigger") || es_gltf_extras_part(l, n, "body"));
        if (l->owner[n] >= 0 && !own && es_gltf_extras_part(l, n, "body")) lone = true; /* a static body below a moving one */
        if (own || lone) result = add_body(l, n, next, &list);
    }
    free_list(l, ES_GLTF_SHAPES, &list);
    es_release(in->context, last, bytes);
    es_release(in->context, next, bytes);
    return result;
}

/* ---- the whole ------------------------------------------------------------------------------------------------------------------- */

static void warn(const es_gltf_loader* l, uint32_t count, const char* what)
{
    if (count) es_log(l->in->context, ES_LOG_WARNING, ES_ASSET_WARNING, "%s: %u %s", l->in->path, count, what);
}

es_result es_gltf_physics_add(const es_gltf_physics* physics)
{
    bool any = false;
    for (uint32_t i = 0; i < physics->order_count && !any; i++) any = physics->nodes[physics->order[i]].rigid || physics->nodes[physics->order[i]].extras;
    if (!any) return ES_OK;
    es_world_refresh(physics->world); /* nodes' matrices */
    es_gltf_loader l = {.in = physics};
    size_t count = physics->node_count + (size_t)1;
    l.bodies = es_allocate_zero(physics->context, count * sizeof *l.bodies);
    l.owner = l.bodies ? es_allocate_zero(physics->context, count * sizeof *l.owner) : NULL;
    es_result result = l.owner ? add_bodies(&l) : es_context_last_result(physics->context);
    if (result == ES_OK) result = es_gltf_add_joints(&l);
    if (result == ES_OK) result = es_gltf_add_soft(&l);
    es_release(physics->context, l.owner, count * sizeof *l.owner);
    es_release(physics->context, l.bodies, count * sizeof *l.bodies);
    if (result != ES_OK) return result; /* which is what matters then */
    warn(&l, l.left.inertia, "bodies have a given centre of mass or inertia, which follow from their shapes here");
    warn(&l, l.left.combine, "physics materials say how to combine with others, here it is the geometric mean of frictions and the larger restitution");
    warn(&l, l.left.joints, "joints are left out, their limits leave other freedoms than those of balls, hinges, distances and fixed joints");
    warn(&l, l.left.limits, "joints have further limits, which are left out");
    warn(&l, l.left.drives, "drives of joints are left out, only those that turn a hinge at a speed are used");
    return result;
}
