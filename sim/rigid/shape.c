/* Making shapes: descriptions checked, placed in their body's frame, bounded. */
#include "sim/rigid/collision.h"

#include "sim/rigid/frame.h"
#include "sim/rigid/shape_mesh.h"

es_shape_desc es_default_shape_desc(void)
{
    return (es_shape_desc){
        .type = ES_SHAPE_BOX,
        .rotation = {0, 0, 0, 1},
        .half_extents = {0.5f, 0.5f, 0.5f},
        .scale = {1, 1, 1},
        .density = 1000,
        .friction = 0.6f,
        .category = 1,
        .mask = UINT32_MAX,
    };
}

static bool length_usable(float x) { return es_within(x, ES_SHAPE_SMALLEST, ES_SHAPE_EXTENT); }

static es_result check_numbers(es_context* context, const es_shape_desc* d, const char* what)
{
    if ((unsigned)d->type > ES_SHAPE_MESH) return es_misuse(context, ES_INVALID_ARGUMENT, "%s: there is no shape type %d", what, (int)d->type);
    if (!es_all_within(&d->position.x, 3, ES_SHAPE_EXTENT) || !es_all_within(&d->rotation.x, 4, 1e6f) || !es_all_within(&d->scale.x, 3, 1e6f))
        return es_fail(context, ES_INVALID_ARGUMENT, "%s: a shape's position must be within 1e5 m, its rotation and scale finite", what);
    if (!es_within(d->density, 0, 1e9f)) return es_fail(context, ES_INVALID_ARGUMENT, "%s: a shape's density must be 0 … 1e9 kg/m³", what);
    if (!es_within(d->friction, -1e9f, 100) || !es_within(d->restitution, -1e9f, 1) || !es_within(d->rolling_resistance, 0, 1e3f))
        return es_fail(context, ES_INVALID_ARGUMENT,
            "%s: a shape's friction must be at most 100, its restitution at most 1, its rolling resistance 0 … 1000 m", what);
    if ((d->type == ES_SHAPE_SPHERE || d->type == ES_SHAPE_CAPSULE) && !length_usable(d->radius))
        return es_fail(context, ES_INVALID_ARGUMENT, "%s: a %s's radius must be 1e-4 … 1e5 m", what, d->type == ES_SHAPE_SPHERE ? "sphere" : "capsule");
    if (d->type == ES_SHAPE_CAPSULE && !es_within(d->half_height, 0, ES_SHAPE_EXTENT))
        return es_fail(context, ES_INVALID_ARGUMENT, "%s: a capsule's half height must be 0 … 1e5 m", what);
    if (d->type == ES_SHAPE_BOX) {
        const es_vec3 h = d->half_extents;
        if (!length_usable(h.x) || !length_usable(h.y) || !length_usable(h.z))
            return es_fail(context, ES_INVALID_ARGUMENT, "%s: a box's half extents must be 1e-4 … 1e5 m", what);
        if (!es_within(d->radius, 0, 0.9f * es_minf(h.x, es_minf(h.y, h.z))))
            return es_fail(context, ES_INVALID_ARGUMENT, "%s: a box's rounding must be 0 … 0.9 of its smallest half extent", what);
    }
    if (d->type == ES_SHAPE_HULL && !es_within(d->radius, 0, ES_SHAPE_EXTENT))
        return es_fail(context, ES_INVALID_ARGUMENT, "%s: a hull's rounding must be 0 … 1e5 m", what);
    return ES_OK;
}

static es_result make_hull(es_world* world, const es_shape_desc* desc, es_vec3 scale, es_vec3 position, es_quat rotation, const char* what, es_hull* hull)
{
    const float* points = desc->points;
    uint32_t count = desc->point_count, stride = 3;
    if (!points && desc->mesh.id) {
        const es_raster_mesh* mesh = es_world_mesh(world, desc->mesh);
        if (!mesh) return ES_STALE_HANDLE;
        points = mesh->positions;
        count = mesh->vertex_count;
        stride = 4;
    }
    if (!points || !count) return es_fail(world->context, ES_INVALID_ARGUMENT, "%s: a hull needs points or a mesh", what);
    for (size_t i = 0; i < count; i++)
        if (!es_all_within(points + i * stride, 3, ES_WORLD_EXTENT))
            return es_fail(world->context, ES_INVALID_ARGUMENT, "%s: point %zu of the hull must be finite and within 1e9", what, i);
    es_result result = es_hull_build(world->context, points, count, stride, scale, what, hull);
    if (result == ES_OK) es_hull_place(hull, position, rotation);
    return result;
}

/* The least of the core's distances from its centre to a face. */
static float inner_distance(const es_hull* hull)
{
    float least = 3e38f;
    for (uint32_t i = 0; i < hull->face_count; i++) least = es_minf(least, hull->planes[i].offset - es_v3_dot(hull->planes[i].normal, hull->centre));
    return es_maxf(least, 0);
}

static void bound_points(es_rigid_shape* shape, const es_vec3* points, uint32_t count)
{
    shape->low = shape->high = points[0];
    float squared = 0;
    for (uint32_t i = 0; i < count; i++) {
        shape->low = es_v3_min(shape->low, points[i]);
        shape->high = es_v3_max(shape->high, points[i]);
        squared = es_maxf(squared, es_v3_dot(points[i], points[i]));
    }
    float r = shape->radius;
    shape->low = es_v3_sub(shape->low, es_v3(r, r, r));
    shape->high = es_v3_add(shape->high, es_v3(r, r, r));
    shape->outer_radius = es_sqrt(squared) * 1.00001f + r;
}

es_result es_rigid_shape_make(es_world* world, const es_shape_desc* desc, const char* what, es_rigid_shape* shape)
{
    es_context* context = world->context;
    *shape = (es_rigid_shape){0};
    es_result result = check_numbers(context, desc, what);
    if (result != ES_OK) return result;
    es_vec3 scale = desc->scale, p = desc->position;
    if (scale.x == 0 && scale.y == 0 && scale.z == 0) scale = es_v3(1, 1, 1);
    es_quat q = es_quat_normalize(desc->rotation); /* all zero: the identity */

    shape->type = desc->type;
    shape->rotation = es_quat_identity();
    shape->centre = p;
    shape->radius = desc->type == ES_SHAPE_MESH ? 0 : desc->radius;
    shape->density = desc->density == 0 ? 1000 : desc->density;
    shape->friction = desc->friction < 0 ? 0.6f : desc->friction;
    shape->restitution = desc->restitution < 0 ? 0 : desc->restitution;
    shape->rolling_resistance = desc->rolling_resistance;
    shape->sensor = desc->sensor;
    shape->category = desc->category ? desc->category : 1;
    shape->mask = desc->mask ? desc->mask : UINT32_MAX;

    switch (desc->type) {
    case ES_SHAPE_SPHERE:
        bound_points(shape, &p, 1);
        shape->inner_radius = shape->radius;
        break;
    case ES_SHAPE_CAPSULE: {
        es_vec3 half = es_quat_rotate(q, es_v3(0, desc->half_height, 0));
        shape->segment[0] = es_v3_sub(p, half);
        shape->segment[1] = es_v3_add(p, half);
        bound_points(shape, shape->segment, 2);
        shape->inner_radius = shape->radius;
        break;
    }
    case ES_SHAPE_BOX: {
        float r = shape->radius;
        shape->half_extents = es_v3_sub(desc->half_extents, es_v3(r, r, r));
        shape->rotation = q;
        result = es_hull_box(context, p, q, shape->half_extents, &shape->hull);
        if (result != ES_OK) return result;
        bound_points(shape, shape->hull.vertices, 8);
        shape->inner_radius = es_minf(desc->half_extents.x, es_minf(desc->half_extents.y, desc->half_extents.z));
        break;
    }
    case ES_SHAPE_HULL:
        result = make_hull(world, desc, scale, p, q, what, &shape->hull);
        if (result != ES_OK) return result;
        shape->centre = shape->hull.centre;
        bound_points(shape, shape->hull.vertices, shape->hull.vertex_count);
        shape->inner_radius = inner_distance(&shape->hull) + shape->radius;
        break;
    case ES_SHAPE_MESH:
        result = es_shape_mesh_make(world, desc->mesh, scale, p, q, what, &shape->mesh);
        if (result != ES_OK) return result;
        bound_points(shape, shape->mesh->vertices, shape->mesh->vertex_count);
        shape->centre = es_v3_scale(es_v3_add(shape->low, shape->high), 0.5f);
        break;
    }
    if (!(shape->outer_radius <= ES_SHAPE_EXTENT * 1.8f))
        return es_fail(context, ES_INVALID_ARGUMENT, "%s: a shape reaches beyond 1e5 m from its body's origin", what);
    return ES_OK;
}

void es_rigid_shape_free(es_context* context, es_rigid_shape* shape)
{
    if (shape->hull.vertices) es_hull_free(context, &shape->hull);
    es_shape_mesh_free(context, shape->mesh);
    shape->mesh = NULL;
}

/* Coordinates may be of the size of the sum of position and extent, each rounded a few times in units of 2^-24. */
void es_rigid_shape_bounds(const es_rigid_shape* shape, const es_pose* pose, es_vec3* low, es_vec3* high)
{
    es_mat3 m = es_mat3_from_quat(pose->rotation);
    es_vec3 half, middle;
    switch (shape->type) {
    case ES_SHAPE_SPHERE:
        middle = es_mat3_mul(&m, shape->centre);
        half = es_v3(0, 0, 0);
        break;
    case ES_SHAPE_CAPSULE: {
        es_vec3 a = es_mat3_mul(&m, shape->segment[0]), b = es_mat3_mul(&m, shape->segment[1]);
        middle = es_v3_scale(es_v3_add(a, b), 0.5f);
        half = es_v3_abs(es_v3_scale(es_v3_sub(a, b), 0.5f));
        break;
    }
    case ES_SHAPE_HULL: {
        es_vec3 least = es_mat3_mul(&m, shape->hull.vertices[0]), most = least;
        for (uint32_t i = 1; i < shape->hull.vertex_count; i++) {
            es_vec3 v = es_mat3_mul(&m, shape->hull.vertices[i]);
            least = es_v3_min(least, v);
            most = es_v3_max(most, v);
        }
        middle = es_v3_scale(es_v3_add(least, most), 0.5f);
        half = es_v3_scale(es_v3_sub(most, least), 0.5f);
        break;
    }
    default: { /* a box about its centre, turned */
        es_vec3 h = shape->half_extents;
        es_mat3 axes = m;
        if (shape->type == ES_SHAPE_MESH)
            h = es_v3_scale(es_v3_sub(shape->high, shape->low), 0.5f);
        else if (shape->rotation.w != 1)
            axes = es_mat3_from_quat(es_quat_mul(pose->rotation, shape->rotation));
        middle = es_mat3_mul(&m, shape->centre);
        half = es_v3(es_absf(axes.x.x) * h.x + es_absf(axes.y.x) * h.y + es_absf(axes.z.x) * h.z,
            es_absf(axes.x.y) * h.x + es_absf(axes.y.y) * h.y + es_absf(axes.z.y) * h.z,
            es_absf(axes.x.z) * h.x + es_absf(axes.y.z) * h.y + es_absf(axes.z.z) * h.z);
        break;
    }
    }
    middle = es_v3_add(middle, pose->position);
    float r = shape->radius + 1e-6f * (shape->outer_radius + es_absf(pose->position.x) + es_absf(pose->position.y) + es_absf(pose->position.z));
    half = es_v3_add(half, es_v3(r, r, r));
    *low = es_v3_sub(middle, half);
    *high = es_v3_add(middle, half);
}
