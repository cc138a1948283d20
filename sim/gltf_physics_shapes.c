/* Shapes of bodies: implicit ones, meshes, and what extras say. */
#include "sim/gltf_physics_parts.h"

#include <stdio.h>
#include <string.h>

#include "sim/world.h"

/* ---- shapes ---------------------------------------------------------------------------------------------------------------------- */

/* Rounded ends of two radii about the y axis, `height` between their centres, or flat ends: rings of points on either. */
static uint32_t ring_points(float bottom, float top, float height, bool rounded, es_vec3 scale, float* points)
{
    static const float slopes[2][3] = {{0, 0, 0}, {0, 0.62f, 0.92f}}; /* sines above the equator; flat ends have the equator alone */
    uint32_t rings = rounded ? 3 : 1, around = rounded ? 9 : 24, count = 0;
    for (int end = 0; end < 2; end++)
        for (uint32_t ring = 0; ring < rings; ring++)
            for (uint32_t k = 0; k < around; k++) {
                float radius = end ? top : bottom, sine = slopes[rounded][ring], angle = 2 * ES_PI * (float)k / (float)around;
                float out = radius * es_sqrt(1 - sine * sine), y = (end ? 0.5f : -0.5f) * height + (end ? radius : -radius) * sine;
                points[3 * count] = out * es_cos(angle) * scale.x;
                points[3 * count + 1] = y * scale.y;
                points[3 * count++ + 2] = out * es_sin(angle) * scale.z;
            }
    for (int end = 0; rounded && end < 2; end++, count++) {
        points[3 * count] = points[3 * count + 2] = 0;
        points[3 * count + 1] = ((end ? 0.5f : -0.5f) * height + (end ? top : -bottom)) * scale.y;
    }
    return count;
}

static void make_hull(es_shape_desc* shape, float* points, float bottom, float top, float height, bool rounded, es_vec3 scale)
{
    shape->type = ES_SHAPE_HULL;
    shape->points = points;
    shape->point_count = ring_points(bottom, top, height, rounded, scale, points);
}

static bool nearly(float a, float b) { return es_absf(a - b) <= 0.01f * es_maxf(a, b); }

/* An implicit shape under a scale. Spheres and capsules that are squeezed, or have two radii, become hulls. */
static es_result implicit_shape(const es_gltf_loader* l, int32_t number, const char* where, es_vec3 scale, es_shape_desc* shape, float* points)
{
    static const char* const types[] = {"sphere", "box", "capsule", "cylinder", NULL};
    const void* value;
    uint32_t type = UINT32_MAX;
    char place[96];
    ES_GLTF_TRY(es_gltf_listed(l, l->in->shapes, "shapes", number, where, &value));
    snprintf(place, sizeof place, "extensions.KHR_implicit_shapes.shapes[%d]", number);
    ES_GLTF_TRY(es_gltf_word(l, value, "type", types, place, &type));
    if (type == UINT32_MAX) return es_gltf_damaged_member(l, place, "type", "is absent");
    const void* sizes = es_gltf_member(l, value, types[type]);
    if (sizes && !l->in->values->is_object(sizes)) return es_gltf_damaged_member(l, place, types[type], "must be an object");
    strncat(place, ".", sizeof place - strlen(place) - 1);
    strncat(place, types[type], sizeof place - strlen(place) - 1);
    scale = es_v3(es_absf(scale.x), es_absf(scale.y), es_absf(scale.z));
    bool round = nearly(scale.x, scale.z), even = round && nearly(scale.x, scale.y);
    if (type == 0) {
        float radius = 0.5f;
        ES_GLTF_TRY(es_gltf_number(l, sizes, "radius", 1e-6, 1e5, place, &radius));
        shape->type = ES_SHAPE_SPHERE;
        shape->radius = radius * scale.x;
        if (!even) make_hull(shape, points, radius, radius, 0, true, scale);
    } else if (type == 1) {
        float size[3] = {1, 1, 1};
        ES_GLTF_TRY(es_gltf_numbers(l, sizes, "size", 3, 1e-6, 1e5, place, size));
        shape->type = ES_SHAPE_BOX;
        shape->half_extents = es_v3(0.5f * size[0] * scale.x, 0.5f * size[1] * scale.y, 0.5f * size[2] * scale.z);
    } else {
        float height = 0.5f, bottom = 0.25f, top = 0.25f;
        ES_GLTF_TRY(es_gltf_number(l, sizes, "height", 1e-6, 1e5, place, &height));
        ES_GLTF_TRY(es_gltf_number(l, sizes, "radiusBottom", 0, 1e5, place, &bottom));
        ES_GLTF_TRY(es_gltf_number(l, sizes, "radiusTop", 0, 1e5, place, &top));
        if (bottom == 0 && top == 0) return es_gltf_damaged(l, place, "must have a radius that is not zero");
        if (type == 2 && even && nearly(bottom, top)) {
            shape->type = ES_SHAPE_CAPSULE;
            shape->radius = bottom * scale.x;
            shape->half_height = 0.5f * height * scale.y;
        } else {
            make_hull(shape, points, bottom, top, height, type == 2, scale);
        }
    }
    return ES_OK;
}

/* Bits of the systems that a list names, numbered as they come up; bit 0 is for colliders of no system. */
static es_result system_bits(es_gltf_loader* l, const void* filter, const char* name, const char* where, uint32_t* bits, bool* given)
{
    const void* list = es_gltf_member(l, filter, name);
    size_t length = 0;
    *bits = 0;
    *given = list != NULL;
    if (!list) return ES_OK;
    if (!l->in->values->array_length(list, &length)) return es_gltf_damaged_member(l, where, name, "must be an array of strings");
    for (size_t i = 0; i < length; i++) {
        const char* text = l->in->values->string(l->in->values->element(list, i));
        uint32_t k = 0;
        if (!text) return es_gltf_damaged_member(l, where, name, "must be an array of strings");
        while (k < l->system_count && strcmp(l->systems[k], text) != 0) k++;
        if (k == ES_GLTF_SYSTEMS) return es_fail(l->in->context, ES_FILE_UNSUPPORTED, "%s: %s.%s: at most %d collision systems are told apart", l->in->path, where, name, ES_GLTF_SYSTEMS);
        if (k == l->system_count) l->systems[l->system_count++] = text;
        *bits |= 2u << k;
    }
    return ES_OK;
}

static es_result apply_filter(es_gltf_loader* l, int32_t number, const char* where, es_shape_desc* shape)
{
    const void* filter;
    uint32_t own, with, without;
    bool has_own, has_with, has_without;
    char place[96];
    if (number < 0) return ES_OK;
    ES_GLTF_TRY(es_gltf_listed(l, l->in->rigid, "collisionFilters", number, where, &filter));
    snprintf(place, sizeof place, "extensions.KHR_physics_rigid_bodies.collisionFilters[%d]", number);
    ES_GLTF_TRY(system_bits(l, filter, "collisionSystems", place, &own, &has_own));
    ES_GLTF_TRY(system_bits(l, filter, "collideWithSystems", place, &with, &has_with));
    ES_GLTF_TRY(system_bits(l, filter, "notCollideWithSystems", place, &without, &has_without));
    shape->category = own ? own : 1;
    shape->mask = (has_with ? with | 1 : UINT32_MAX) & ~without;
    return ES_OK;
}

static es_result apply_material(es_gltf_loader* l, int32_t number, const char* where, es_shape_desc* shape)
{
    static const char* const ways[] = {"average", "minimum", "maximum", "multiply", NULL};
    const void* material;
    char place[96];
    uint32_t way = 0;
    float unused = 0;
    if (number < 0) return ES_OK;
    ES_GLTF_TRY(es_gltf_listed(l, l->in->rigid, "physicsMaterials", number, where, &material));
    snprintf(place, sizeof place, "extensions.KHR_physics_rigid_bodies.physicsMaterials[%d]", number);
    shape->friction = 0.6f;
    shape->restitution = 0;
    ES_GLTF_TRY(es_gltf_number(l, material, "staticFriction", 0, 100, place, &unused));
    ES_GLTF_TRY(es_gltf_number(l, material, "dynamicFriction", 0, 100, place, &shape->friction));
    ES_GLTF_TRY(es_gltf_number(l, material, "restitution", 0, 1, place, &shape->restitution));
    ES_GLTF_TRY(es_gltf_word(l, material, "frictionCombine", ways, place, &way));
    ES_GLTF_TRY(es_gltf_word(l, material, "restitutionCombine", ways, place, &way));
    l->left.combine += es_gltf_member(l, material, "frictionCombine") || es_gltf_member(l, material, "restitutionCombine");
    return ES_OK;
}

/* Shapes of a collider or trigger, appended. `frame`: the body's. */
es_result es_gltf_add_collider(es_gltf_loader* l, uint32_t n, const void* collider, const char* where, bool sensor, const es_gltf_place* frame, bool moves, es_gltf_shape_list* list)
{
    int32_t material, filter, shape_number, mesh_node;
    const void* geometry = es_gltf_member(l, collider, "geometry");
    char geometry_place[128];
    bool hull = false;
    if (!l->in->values->is_object(collider)) return es_gltf_damaged(l, where, "must be an object");
    if (!geometry) geometry = collider; /* an earlier draft had its members here */
    snprintf(geometry_place, sizeof geometry_place, "%s%s", where, geometry == collider ? "" : ".geometry");
    if (!l->in->values->is_object(geometry)) return es_gltf_damaged(l, geometry_place, "must be an object");
    ES_GLTF_TRY(es_gltf_index(l, collider, "physicsMaterial", INT32_MAX, where, &material));
    ES_GLTF_TRY(es_gltf_index(l, collider, "collisionFilter", INT32_MAX, where, &filter));
    ES_GLTF_TRY(es_gltf_index(l, geometry, "shape", INT32_MAX, geometry_place, &shape_number));
    ES_GLTF_TRY(es_gltf_index(l, geometry, "node", l->in->node_count, geometry_place, &mesh_node));
    ES_GLTF_TRY(es_gltf_flag(l, geometry, "convexHull", geometry_place, &hull));
    if (sensor && shape_number < 0 && mesh_node < 0) return ES_OK; /* a compound of other nodes' triggers */
    if ((shape_number < 0) == (mesh_node < 0)) return es_gltf_damaged(l, geometry_place, "must have either a shape or a node");
    es_gltf_place from = es_gltf_place_of(l->in->world, l->in->nodes[n].node);
    if (from.scale.x == 0 && from.scale.y == 0 && from.scale.z == 0) return ES_OK; /* disabled */
    if (from.scale.x == 0 || from.scale.y == 0 || from.scale.z == 0) return es_gltf_damaged(l, where, "is flat: its node has a scale of zero");
    const es_gltf_physics_node* source = mesh_node < 0 ? NULL : &l->in->nodes[mesh_node];
    if (source && (!source->mesh_count || source->skinned)) return es_gltf_damaged_member(l, geometry_place, "node", source->skinned ? "its mesh is skinned, which is not supported" : "has no mesh of triangles in the scene");
    uint32_t parts = source ? source->mesh_count : 1;
    for (uint32_t i = 0; i < parts; i++) {
        if (list->count == ES_GLTF_SHAPES) return es_fail(l->in->context, ES_FILE_UNSUPPORTED, "%s: %s: its body has more than %d shapes", l->in->path, where, ES_GLTF_SHAPES);
        es_shape_desc* shape = &list->shapes[list->count];
        *shape = es_default_shape_desc();
        ES_GLTF_TRY(apply_material(l, material, where, shape));
        ES_GLTF_TRY(apply_filter(l, filter, where, shape));
        shape->sensor = sensor;
        es_gltf_seen_from(frame, &from, &shape->position, &shape->rotation);
        if (source) {
            shape->type = hull || moves ? ES_SHAPE_HULL : ES_SHAPE_MESH;
            shape->mesh = source->meshes[i];
            shape->scale = from.scale;
        } else {
            ES_GLTF_TRY(implicit_shape(l, shape_number, geometry_place, from.scale, shape, list->points + (size_t)list->count * ES_GLTF_HULL_POINTS * 3));
        }
        list->count++;
    }
    return ES_OK;
}

/* A box round the vertices of a node's meshes, in its axes. */
static bool fitted_box(const es_gltf_loader* l, uint32_t n, es_vec3* middle, es_vec3* half)
{
    const es_gltf_physics_node* node = &l->in->nodes[n];
    es_vec3 low = {0, 0, 0}, high = {0, 0, 0};
    for (uint32_t i = 0; i < node->mesh_count; i++) {
        const es_raster_mesh* mesh = es_world_mesh(l->in->world, node->meshes[i]);
        low = i ? es_v3(es_minf(low.x, mesh->bounds_min.x), es_minf(low.y, mesh->bounds_min.y), es_minf(low.z, mesh->bounds_min.z)) : mesh->bounds_min;
        high = i ? es_v3(es_maxf(high.x, mesh->bounds_max.x), es_maxf(high.y, mesh->bounds_max.y), es_maxf(high.z, mesh->bounds_max.z)) : mesh->bounds_max;
    }
    *middle = es_v3_scale(es_v3_add(low, high), 0.5f);
    *half = es_v3_scale(es_v3_sub(high, low), 0.5f);
    return node->mesh_count > 0 && !node->skinned;
}

/* One shape of extras: sizes that are not given are those of the node's meshes. Lengths are in the node's axes and scale with it. */
es_result es_gltf_add_extras_shape(es_gltf_loader* l, uint32_t n, const void* from, const char* where, bool moves, const es_gltf_place* frame, es_gltf_shape_list* list)
{
    static const char* const types[] = {"sphere", "box", "capsule", "hull", "mesh", NULL};
    if (!l->in->values->is_object(from)) return es_gltf_damaged(l, where, "must be an object");
    uint32_t type = moves ? ES_SHAPE_HULL : ES_SHAPE_MESH, parts = 1;
    es_shape_desc shape = es_default_shape_desc();
    es_vec3 middle, half, scale = frame->scale;
    bool fitted = fitted_box(l, n, &middle, &half);
    float category = 1, mask = 0, size[3], radius = 0, height = -1;
    ES_GLTF_TRY(es_gltf_word(l, from, "shape", types, where, &type));
    scale = es_v3(es_absf(scale.x), es_absf(scale.y), es_absf(scale.z));
    if (type >= ES_SHAPE_HULL) middle = es_v3(0, 0, 0);
    bool sized = es_gltf_member(l, from, type == ES_SHAPE_BOX ? "size" : "radius") != NULL;
    if (sized) middle = es_v3(0, 0, 0);
    else if (!fitted) return es_gltf_damaged(l, where, type >= ES_SHAPE_HULL ? "needs a mesh of triangles on its node" : "needs its size, or a mesh on its node to take it from");
    size[0] = 2 * half.x, size[1] = 2 * half.y, size[2] = 2 * half.z;
    if (!sized && type == ES_SHAPE_SPHERE) radius = es_maxf(half.x, es_maxf(half.y, half.z));
    if (!sized && type == ES_SHAPE_CAPSULE) {
        radius = es_maxf(half.x, half.z);
        height = es_maxf(2 * (half.y - radius), 0);
    }
    ES_GLTF_TRY(es_gltf_numbers(l, from, "size", 3, 1e-6, 1e5, where, size));
    ES_GLTF_TRY(es_gltf_number(l, from, "radius", 0, 1e5, where, &radius));
    ES_GLTF_TRY(es_gltf_number(l, from, "height", 0, 1e5, where, &height));
    ES_GLTF_TRY(es_gltf_numbers(l, from, "position", 3, -1e5, 1e5, where, &middle.x));
    ES_GLTF_TRY(es_gltf_numbers(l, from, "rotation", 4, -1, 1, where, &shape.rotation.x));
    ES_GLTF_TRY(es_gltf_number(l, from, "density", 1e-6, 1e9, where, &shape.density));
    ES_GLTF_TRY(es_gltf_number(l, from, "friction", 0, 100, where, &shape.friction));
    ES_GLTF_TRY(es_gltf_number(l, from, "restitution", 0, 1, where, &shape.restitution));
    ES_GLTF_TRY(es_gltf_number(l, from, "rollingResistance", 0, 1e3, where, &shape.rolling_resistance));
    ES_GLTF_TRY(es_gltf_flag(l, from, "sensor", where, &shape.sensor));
    ES_GLTF_TRY(es_gltf_number(l, from, "category", 0, 16777215, where, &category));
    ES_GLTF_TRY(es_gltf_number(l, from, "mask", 0, 16777215, where, &mask));
    shape.type = (es_shape_type)type;
    shape.position = es_v3_mul(middle, frame->scale);
    shape.category = (uint32_t)category;
    shape.mask = (uint32_t)mask;
    if (type == ES_SHAPE_BOX) {
        shape.half_extents = es_v3(0.5f * size[0] * scale.x, 0.5f * size[1] * scale.y, 0.5f * size[2] * scale.z);
        shape.radius = radius * scale.x;
    } else if (type == ES_SHAPE_CAPSULE || type == ES_SHAPE_SPHERE) {
        if (type == ES_SHAPE_CAPSULE && height < 0) return es_gltf_damaged_member(l, where, "height", "is absent");
        shape.radius = radius * es_maxf(scale.x, scale.z);
        shape.half_height = 0.5f * height * scale.y;
    } else {
        parts = l->in->nodes[n].mesh_count;
        shape.radius = 0;
        shape.scale = frame->scale;
    }
    for (uint32_t i = 0; i < parts; i++) {
        if (list->count == ES_GLTF_SHAPES) return es_fail(l->in->context, ES_FILE_UNSUPPORTED, "%s: %s: its body has more than %d shapes", l->in->path, where, ES_GLTF_SHAPES);
        if (type >= ES_SHAPE_HULL) shape.mesh = l->in->nodes[n].meshes[i];
        list->shapes[list->count++] = shape;
    }
    return ES_OK;
}

