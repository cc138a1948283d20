/* One shape against a point and against a ray. */
#include "sim/rigid/collision.h"

#include "sim/rigid/distance.h"
#include "sim/rigid/shape_mesh.h"
#include "sim/rigid/shape_query.h"

/* ---- nearest point, in the body's frame ----------------------------------------------------------------------------------- */

/* Around a core: from its nearest point `on` at `distance` (> 0) along `normal`, or inside by the signed one. */
static void grow(es_shape_hit* hit, es_vec3 on, float distance, es_vec3 normal, float radius)
{
    hit->distance = distance - radius;
    hit->normal = normal;
    hit->point = es_v3_mad(on, normal, radius);
    hit->triangle = 0;
}

static void nearest_on_point(es_vec3 centre, float radius, es_vec3 p, es_shape_hit* hit)
{
    es_vec3 d = es_v3_sub(p, centre);
    grow(hit, centre, es_v3_length(d), es_v3_normalize(d, es_v3(0, 1, 0)), radius);
}

static es_vec3 on_segment(es_vec3 a, es_vec3 b, es_vec3 p)
{
    es_vec3 d = es_v3_sub(b, a);
    float along = es_v3_dot(es_v3_sub(p, a), d), dd = es_v3_dot(d, d);
    return along <= 0 || !(dd > 0) ? a : along >= dd ? b : es_v3_mad(a, d, along / dd);
}

static void nearest_on_box(const es_rigid_shape* shape, es_vec3 p, es_shape_hit* hit)
{
    es_vec3 h = shape->half_extents, d = es_v3_sub(p, shape->centre);
    es_mat3 m = es_mat3_from_quat(shape->rotation);
    es_vec3 local = es_mat3_into(&m, d), on = es_v3_max(es_v3_min(local, h), es_v3_neg(h));
    es_vec3 away = es_v3_sub(local, on), normal = {0, 0, 0};
    float distance = es_v3_length(away);
    if (distance > 1e-6f * (h.x + h.y + h.z)) {
        normal = es_v3_scale(away, 1 / distance);
    } else { /* inside: out through the nearest side */
        es_vec3 depth = es_v3_sub(h, es_v3_abs(local));
        int axis = depth.x <= depth.y && depth.x <= depth.z ? 0 : depth.y <= depth.z ? 1 : 2;
        distance = -es_v3_axis(depth, axis);
        float s = es_v3_axis(local, axis) < 0 ? -1.0f : 1.0f;
        (&normal.x)[axis] = s;
        on = local;
        (&on.x)[axis] = s * es_v3_axis(h, axis);
    }
    grow(hit, es_v3_add(shape->centre, es_mat3_mul(&m, on)), distance, es_mat3_mul(&m, normal), shape->radius);
}

static void nearest_on_hull(const es_hull* hull, float radius, es_vec3 p, es_shape_hit* hit)
{
    float most = -3e38f;
    uint32_t face = 0;
    for (uint32_t i = 0; i < hull->face_count; i++) {
        float s = es_v3_dot(hull->planes[i].normal, p) - hull->planes[i].offset;
        if (s > most) most = s, face = i;
    }
    es_nearest nearest = {0};
    if (most > 0) es_nearest_points(hull->vertices, hull->vertex_count, &p, 1, &nearest);
    if (nearest.distance > 0)
        grow(hit, nearest.on_a, (float)nearest.distance, nearest.normal, radius);
    else
        grow(hit, es_v3_mad(p, hull->planes[face].normal, -most), most, hull->planes[face].normal, radius);
}

es_vec3 es_nearest_on_triangle(es_vec3 a, es_vec3 b, es_vec3 c, es_vec3 p)
{
    es_vec3 ab = es_v3_sub(b, a), ac = es_v3_sub(c, a), ap = es_v3_sub(p, a), bp = es_v3_sub(p, b), cp = es_v3_sub(p, c);
    float d1 = es_v3_dot(ab, ap), d2 = es_v3_dot(ac, ap), d3 = es_v3_dot(ab, bp), d4 = es_v3_dot(ac, bp), d5 = es_v3_dot(ab, cp), d6 = es_v3_dot(ac, cp);
    if (d1 <= 0 && d2 <= 0) return a;
    if (d3 >= 0 && d4 <= d3) return b;
    if (d6 >= 0 && d5 <= d6) return c;
    float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return d1 > d3 ? es_v3_mad(a, ab, d1 / (d1 - d3)) : a;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return d2 > d6 ? es_v3_mad(a, ac, d2 / (d2 - d6)) : a;
    float e4 = d4 - d3, e5 = d5 - d6;
    if (va <= 0 && e4 >= 0 && e5 >= 0) return e4 + e5 > 0 ? es_v3_mad(b, es_v3_sub(c, b), e4 / (e4 + e5)) : b;
    float sum = va + vb + vc;
    return sum > 0 ? es_v3_mad(es_v3_mad(a, ab, vb / sum), ac, vc / sum) : a;
}

static float box_distance_squared(const es_mesh_node* node, es_vec3 p)
{
    es_vec3 zero = {0, 0, 0}, d = es_v3_max(es_v3_max(es_v3_sub(node->low, p), es_v3_sub(p, node->high)), zero);
    return es_v3_dot(d, d);
}

/* At equal distances the lowest triangle: the order of the tree does not matter. */
static bool nearest_on_mesh(const es_shape_mesh* mesh, es_vec3 p, float max, es_shape_hit* hit)
{
    float best = max * max * 1.000001f;
    uint32_t found = UINT32_MAX, stack[ES_MESH_STACK], depth = 0;
    es_vec3 on = {0, 0, 0};
    stack[depth++] = 0;
    while (depth) {
        uint32_t at = stack[--depth];
        const es_mesh_node* node = &mesh->nodes[at];
        if (box_distance_squared(node, p) > best * 1.000001f) continue;
        if (node->count == 0) {
            uint32_t near_child = at + 1, far_child = node->first;
            if (box_distance_squared(&mesh->nodes[far_child], p) < box_distance_squared(&mesh->nodes[near_child], p)) {
                near_child = node->first;
                far_child = at + 1;
            }
            stack[depth++] = far_child;
            stack[depth++] = near_child;
            continue;
        }
        for (uint32_t i = node->first; i < node->first + node->count; i++) {
            const es_mesh_triangle* t = &mesh->triangles[i];
            es_vec3 q = es_nearest_on_triangle(mesh->vertices[t->vertex[0]], mesh->vertices[t->vertex[1]], mesh->vertices[t->vertex[2]], p), d = es_v3_sub(p, q);
            float squared = es_v3_dot(d, d);
            if (squared > best || (squared == best && i > found)) continue;
            best = squared;
            found = i;
            on = q;
        }
    }
    if (found == UINT32_MAX) return false;
    const es_mesh_triangle* t = &mesh->triangles[found];
    es_vec3 d = es_v3_sub(p, on);
    float side = es_v3_dot(t->normal, d) < 0 ? -1.0f : 1.0f;
    *hit = (es_shape_hit){es_v3_length(d), on, es_v3_normalize(d, es_v3_scale(t->normal, side)), t->source};
    return hit->distance <= max;
}

bool es_shape_nearest(const es_rigid_shape* shape, es_vec3 p, float max, es_shape_hit* hit)
{
    switch (shape->type) {
    case ES_SHAPE_SPHERE: nearest_on_point(shape->centre, shape->radius, p, hit); break;
    case ES_SHAPE_CAPSULE: nearest_on_point(on_segment(shape->segment[0], shape->segment[1], p), shape->radius, p, hit); break;
    case ES_SHAPE_BOX: nearest_on_box(shape, p, hit); break;
    case ES_SHAPE_HULL: nearest_on_hull(&shape->hull, shape->radius, p, hit); break;
    default: return nearest_on_mesh(shape->mesh, p, max, hit);
    }
    return hit->distance <= max;
}

bool es_rigid_shape_closest(const es_rigid_shape* shape, const es_pose* pose, es_vec3 point, float max_distance, es_shape_hit* hit)
{
    es_mat3 m = es_mat3_from_quat(pose->rotation);
    if (!es_shape_nearest(shape, es_mat3_into(&m, es_v3_sub(point, pose->position)), max_distance, hit)) return false;
    hit->point = es_v3_add(pose->position, es_mat3_mul(&m, hit->point));
    hit->normal = es_mat3_mul(&m, hit->normal);
    return true;
}

/* ---- rays, in the body's frame -------------------------------------------------------------------------------------------- */

/* Where the ray enters a sphere; -1 when it does not. From inside: 0. */
static float enter_sphere(es_vec3 centre, float radius, es_vec3 o, es_vec3 d)
{
    double x = (double)o.x - centre.x, y = (double)o.y - centre.y, z = (double)o.z - centre.z;
    double b = x * d.x + y * d.y + z * d.z, c = x * x + y * y + z * z - (double)radius * radius;
    if (c <= 0) return 0;
    double px = x - b * d.x, py = y - b * d.y, pz = z - b * d.z, gap = (double)radius * radius - (px * px + py * py + pz * pz);
    if (b > 0 || gap < 0) return -1;
    double t = -b - __builtin_sqrt(gap);
    return t > 0 ? (float)t : 0;
}

/* Conservative steps towards a rounded core: the distance to it can be gone safely. Used where no formula is at hand; converges like the
 * distance itself, which shrinks by the angle of incidence; grazing rays stop short by 1e-6 of the shape's size. */
static bool march(const es_rigid_shape* shape, es_vec3 o, es_vec3 d, float max, es_shape_hit* hit)
{
    float t = 0, size = shape->outer_radius;
    for (int i = 0; i < 256; i++) {
        es_vec3 p = es_v3_mad(o, d, t);
        es_shape_nearest(shape, p, 3e38f, hit);
        if (hit->distance <= 1e-6f * size) {
            if (i == 0 && hit->distance <= 0) *hit = (es_shape_hit){0, o, es_v3_neg(d), 0};
            hit->distance = t;
            return true;
        }
        /* nothing is nearer in the half space behind the plane at the nearest point: go to where the ray meets that plane */
        float closing = -es_v3_dot(hit->normal, d);
        if (!(closing * (max - t) >= hit->distance)) return false;
        t += hit->distance / closing;
        if (!(t <= max)) return false;
    }
    return false;
}

static bool ray_planes(const es_hull* hull, es_vec3 o, es_vec3 d, float max, es_shape_hit* hit)
{
    float enter = 0, leave = max;
    int face = -1;
    for (uint32_t i = 0; i < hull->face_count; i++) {
        float height = es_v3_dot(hull->planes[i].normal, o) - hull->planes[i].offset, speed = es_v3_dot(hull->planes[i].normal, d);
        if (es_absf(speed) < 1e-12f) {
            if (height > 0) return false;
            continue;
        }
        float t = -height / speed;
        if (speed < 0 && t > enter) enter = t, face = (int)i;
        if (speed > 0 && t < leave) leave = t;
    }
    if (enter > leave) return false;
    if (face < 0) {
        if (leave < 0) return false;
        *hit = (es_shape_hit){0, o, es_v3_neg(d), 0};
    } else
        *hit = (es_shape_hit){enter, es_v3_mad(o, d, enter), hull->planes[face].normal, 0};
    return true;
}

static float enter_box(const es_mesh_node* node, const float o[3], const float inverse[3], float max)
{
    const float *low = &node->low.x, *high = &node->high.x;
    float near_t = 0, far_t = max;
    for (int k = 0; k < 3; k++) {
        float a = (low[k] - o[k]) * inverse[k], b = (high[k] - o[k]) * inverse[k];
        near_t = es_maxf(near_t, es_minf(a, b) * 0.9999996f); /* three roundings */
        far_t = es_minf(far_t, es_maxf(a, b) * 1.0000004f);
    }
    return near_t <= far_t ? near_t : -1;
}

/* Edges by the signs of volumes in double (Möller and Trumbore 1997, arranged so that a shared edge is hit by one side at least). */
static bool ray_mesh(const es_shape_mesh* mesh, es_vec3 o, es_vec3 d, float max, es_shape_hit* hit)
{
    const float origin[3] = {o.x, o.y, o.z};
    const float inverse[3] = {1 / (es_absf(d.x) > 1e-20f ? d.x : 1e-20f), 1 / (es_absf(d.y) > 1e-20f ? d.y : 1e-20f), 1 / (es_absf(d.z) > 1e-20f ? d.z : 1e-20f)};
    uint32_t stack[ES_MESH_STACK], depth = 0, found = UINT32_MAX;
    double best = max;
    stack[depth++] = 0;
    while (depth) {
        uint32_t at = stack[--depth];
        const es_mesh_node* node = &mesh->nodes[at];
        if (enter_box(node, origin, inverse, (float)best * 1.000001f) < 0) continue;
        if (node->count == 0) {
            stack[depth++] = node->first;
            stack[depth++] = at + 1;
            continue;
        }
        for (uint32_t i = node->first; i < node->first + node->count; i++) {
            const es_mesh_triangle* t = &mesh->triangles[i];
            double v[3][3], w[3];
            for (int c = 0; c < 3; c++) {
                es_vec3 p = mesh->vertices[t->vertex[c]];
                v[c][0] = (double)p.x - o.x, v[c][1] = (double)p.y - o.y, v[c][2] = (double)p.z - o.z;
            }
            for (int c = 0; c < 3; c++) { /* (q × p) · d for the edge opposite of corner c */
                const double *p = v[(c + 1) % 3], *q = v[(c + 2) % 3];
                w[c] = (q[1] * p[2] - q[2] * p[1]) * d.x + (q[2] * p[0] - q[0] * p[2]) * d.y + (q[0] * p[1] - q[1] * p[0]) * d.z;
            }
            bool front = w[0] >= 0 && w[1] >= 0 && w[2] >= 0, back = w[0] <= 0 && w[1] <= 0 && w[2] <= 0;
            double sum = w[0] + w[1] + w[2];
            if (!(front || back) || sum == 0) continue;
            double along = 0;
            for (int c = 0; c < 3; c++) along += w[c] / sum * (v[c][0] * d.x + v[c][1] * d.y + v[c][2] * d.z);
            if (along < 0 || along > best || (along == best && i > found)) continue;
            best = along;
            found = i;
        }
    }
    if (found == UINT32_MAX) return false;
    es_vec3 n = mesh->triangles[found].normal;
    *hit = (es_shape_hit){(float)best, es_v3_mad(o, d, (float)best), es_v3_dot(n, d) > 0 ? es_v3_neg(n) : n, mesh->triangles[found].source};
    return true;
}

bool es_rigid_shape_ray(const es_rigid_shape* shape, const es_pose* pose, es_vec3 origin, es_vec3 direction, float max, es_shape_hit* hit)
{
    es_mat3 m = es_mat3_from_quat(pose->rotation);
    es_vec3 o = es_mat3_into(&m, es_v3_sub(origin, pose->position)), d = es_v3_normalize(es_mat3_into(&m, direction), es_v3(0, 0, -1));
    bool found = false;
    switch (shape->type) {
    case ES_SHAPE_SPHERE: {
        float t = enter_sphere(shape->centre, shape->radius, o, d);
        found = t >= 0 && t <= max;
        es_vec3 p = es_v3_mad(o, d, t);
        if (found) *hit = (es_shape_hit){t, p, t > 0 ? es_v3_normalize(es_v3_sub(p, shape->centre), es_v3_neg(d)) : es_v3_neg(d), 0};
        break;
    }
    case ES_SHAPE_MESH: found = ray_mesh(shape->mesh, o, d, max, hit); break;
    default: found = shape->radius > 0 ? march(shape, o, d, max, hit) : ray_planes(&shape->hull, o, d, max, hit); break;
    }
    if (!found) return false;
    hit->point = es_v3_add(pose->position, es_mat3_mul(&m, hit->point));
    hit->normal = es_mat3_mul(&m, hit->normal);
    return true;
}
