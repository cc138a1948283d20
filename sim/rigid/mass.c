/* Mass, centre and inertia of shapes, in double: solids of constant density. */
#include "sim/rigid/collision.h"
#include "sim/rigid/frame.h"

/* about the centre of mass, in the shape's axes, turned into the body's: R diag R^T */
static void turn_diagonal(es_quat rotation, const double diagonal[3], float inertia[6])
{
    es_mat3 m = es_mat3_from_quat(rotation);
    const float r[3][3] = {{m.x.x, m.y.x, m.z.x}, {m.x.y, m.y.y, m.z.y}, {m.x.z, m.y.z, m.z.z}};
    static const int rows[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    for (int i = 0; i < 6; i++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) sum += diagonal[k] * r[rows[i][0]][k] * r[rows[i][1]][k];
        inertia[i] = (float)sum;
    }
}

/* Tetrahedra from the hull's centre to its faces' triangles. Of one with corners 0, a, b, c: the volume V = a·(b×c)/6, the centroid
 * (a+b+c)/4, the second moments V/20 (s s^T + a a^T + b b^T + c c^T) with s = a+b+c. Everything scaled by `grow` about the centre. */
static es_mass hull_mass(const es_hull* hull, float density, double grow)
{
    double volume = 0, first[3] = {0}, second[6] = {0}; /* xx yy zz xy xz yz */
    static const int pair[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    const float o[3] = {hull->centre.x, hull->centre.y, hull->centre.z};
    for (uint32_t face = 0; face < hull->face_count; face++) {
        uint32_t begin = hull->first[face], edge = hull->half_edges[begin].next;
        for (uint32_t next = hull->half_edges[edge].next; next != begin; edge = next, next = hull->half_edges[next].next) {
            const es_vec3* corner[3] = {&hull->vertices[hull->half_edges[begin].origin], &hull->vertices[hull->half_edges[edge].origin],
                &hull->vertices[hull->half_edges[next].origin]};
            double v[3][3], s[3];
            for (int k = 0; k < 3; k++) {
                for (int i = 0; i < 3; i++) v[i][k] = grow * ((double)(&corner[i]->x)[k] - o[k]);
                s[k] = v[0][k] + v[1][k] + v[2][k];
            }
            double six = v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) - v[0][1] * (v[1][0] * v[2][2] - v[1][2] * v[2][0]) +
                         v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
            volume += six / 6;
            for (int k = 0; k < 3; k++) first[k] += six / 24 * s[k];
            for (int k = 0; k < 6; k++) {
                int i = pair[k][0], j = pair[k][1];
                second[k] += six / 120 * (s[i] * s[j] + v[0][i] * v[0][j] + v[1][i] * v[1][j] + v[2][i] * v[2][j]);
            }
        }
    }
    es_mass mass = {.mass = (float)(density * volume)};
    if (!(volume > 0)) return (es_mass){0};
    double c[3] = {first[0] / volume, first[1] / volume, first[2] / volume};
    for (int k = 0; k < 6; k++) second[k] -= volume * c[pair[k][0]] * c[pair[k][1]];
    mass.centre = es_v3((float)(o[0] + c[0]), (float)(o[1] + c[1]), (float)(o[2] + c[2]));
    double d = density;
    mass.inertia[0] = (float)(d * (second[1] + second[2]));
    mass.inertia[1] = (float)(d * (second[0] + second[2]));
    mass.inertia[2] = (float)(d * (second[0] + second[1]));
    for (int k = 3; k < 6; k++) mass.inertia[k] = (float)(-d * second[k]);
    return mass;
}

es_mass es_rigid_shape_mass(const es_rigid_shape* shape)
{
    const double pi = 3.14159265358979323846, r = shape->radius, density = shape->density;
    es_mass mass = {.centre = shape->centre};
    switch (shape->type) {
    case ES_SHAPE_SPHERE: {
        double m = density * pi * 4 / 3 * r * r * r;
        mass.mass = (float)m;
        for (int k = 0; k < 3; k++) mass.inertia[k] = (float)(0.4 * m * r * r);
        return mass;
    }
    case ES_SHAPE_CAPSULE: {
        /* a cylinder of height 2 l along y and two half spheres whose centroids are 3/8 r from their flat sides */
        es_vec3 along = es_v3_sub(shape->segment[1], shape->segment[0]);
        double ax = along.x, ay = along.y, az = along.z, l = 0.5 * __builtin_sqrt(ax * ax + ay * ay + az * az);
        double cylinder = density * pi * r * r * 2 * l, caps = density * pi * 4 / 3 * r * r * r;
        double axial = 0.5 * cylinder * r * r + 0.4 * caps * r * r;
        double across = cylinder * (r * r / 4 + l * l / 3) + caps * (0.4 * r * r + l * l + 0.75 * l * r);
        mass.mass = (float)(cylinder + caps);
        /* axial along u, across in the plane: across (1 - u u^T) + axial u u^T */
        double length = 2 * l, u[3] = {0, 1, 0};
        if (l > 0) {
            u[0] = ax / length;
            u[1] = ay / length;
            u[2] = az / length;
        }
        static const int rows[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
        for (int k = 0; k < 6; k++) mass.inertia[k] = (float)((k < 3 ? across : 0) + (axial - across) * u[rows[k][0]] * u[rows[k][1]]);
        return mass;
    }
    case ES_SHAPE_BOX: {
        double x = shape->half_extents.x + r, y = shape->half_extents.y + r, z = shape->half_extents.z + r, m = density * 8 * x * y * z;
        mass.mass = (float)m;
        turn_diagonal(shape->rotation, (const double[3]){m / 3 * (y * y + z * z), m / 3 * (x * x + z * z), m / 3 * (x * x + y * y)}, mass.inertia);
        return mass;
    }
    case ES_SHAPE_HULL: return hull_mass(&shape->hull, shape->density, shape->inner_radius > r ? shape->inner_radius / (shape->inner_radius - r) : 1);
    default: return (es_mass){0};
    }
}

es_mass es_mass_add(const es_mass* a, const es_mass* b)
{
    if (!(a->mass > 0)) return *b;
    if (!(b->mass > 0)) return *a;
    double ma = a->mass, mb = b->mass, m = ma + mb;
    double d[3] = {(double)b->centre.x - a->centre.x, (double)b->centre.y - a->centre.y, (double)b->centre.z - a->centre.z};
    double share = mb / m, reduced = ma * share, dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    es_mass sum = {.mass = (float)m};
    sum.centre = es_v3((float)(a->centre.x + share * d[0]), (float)(a->centre.y + share * d[1]), (float)(a->centre.z + share * d[2]));
    static const int rows[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    for (int k = 0; k < 6; k++) /* the two as points about their common centre: reduced mass times (d² - d d^T) */
        sum.inertia[k] = (float)((double)a->inertia[k] + b->inertia[k] + reduced * ((k < 3 ? dd : 0) - d[rows[k][0]] * d[rows[k][1]]));
    return sum;
}
