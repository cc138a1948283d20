/* Nodes of the hierarchy of points (gi/micro/forest.h), eight at a time: leaves from their triangles, parents from their children, places in the world,
 * quantised nodes, light.
 *
 * Coordinates are within ±1e9 and radii below 1e10, so that nothing overflows; a node of negative radius is not there. */
#include "gi/kernel_table.h"
#include "platform/simd.h"
#include "raster/pack.h"

VINL uint32_t lanes_left(uint32_t i, uint32_t end) { return end - i < VW ? end - i : VW; }

VINL vi load_words(const uint32_t* words, uint32_t n)
{
    uint32_t w[VW];
    if (n == VW) return vi_load(words);
    for (uint32_t k = 0; k < VW; k++) w[k] = words[k < n ? k : 0];
    return vi_load(w);
}
VINL void store_words(uint32_t* words, uint32_t n, vi v)
{
    uint32_t w[VW];
    if (n == VW) {
        vi_store(words, v);
        return;
    }
    vi_store(w, v);
    for (uint32_t k = 0; k < n; k++) words[k] = w[k];
}
VINL vf load_floats(const float* values, uint32_t n)
{
    float w[VW];
    if (n == VW) return vf_load(values);
    for (uint32_t k = 0; k < VW; k++) w[k] = values[k < n ? k : 0];
    return vf_load(w);
}
/* words of n pairs */
VINL void load_pairs(const void* words, uint32_t n, vf* left, vf* right)
{
    const char* p = words;
    float l[VW], r[VW];
    if (n == VW) {
        vf a, b;
        memcpy(&a, p, sizeof a);
        memcpy(&b, p + sizeof a, sizeof b);
        vf_deinterleave(a, b, left, right);
        return;
    }
    for (uint32_t k = 0; k < VW; k++) {
        memcpy(&l[k], p + (k < n ? 8 * k : 0), 4);
        memcpy(&r[k], p + (k < n ? 8 * k : 0) + 4, 4);
    }
    *left = vf_load(l);
    *right = vf_load(r);
}
VINL void store_floats(float* values, uint32_t n, vf v)
{
    float w[VW];
    if (n == VW) {
        vf_store(values, v);
        return;
    }
    vf_store(w, v);
    for (uint32_t k = 0; k < n; k++) values[k] = w[k];
}

typedef struct v3 { vf x, y, z; } v3;
VINL v3 v3_sub(v3 a, v3 b) { return (v3){a.x - b.x, a.y - b.y, a.z - b.z}; }
VINL vf v3_dot(v3 a, v3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
VINL v3 v3_cross(v3 a, v3 b) { return (v3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
VINL v3 v3_scale(v3 a, vf s) { return (v3){a.x * s, a.y * s, a.z * s}; }
VINL v3 v3_bound_by(v3 a, float bound)
{
    const vf most = vf_set1(bound), least = vf_set1(-bound);
    return (v3){vf_min(vf_max(a.x, least), most), vf_min(vf_max(a.y, least), most), vf_min(vf_max(a.z, least), most)};
}
VINL v3 v3_bound(v3 a) { return v3_bound_by(a, ES_POINT_FARTHEST); }
VINL v3 by_matrix(const float m[9], v3 a)
{
    return (v3){vf_set1(m[0]) * a.x + vf_set1(m[3]) * a.y + vf_set1(m[6]) * a.z, vf_set1(m[1]) * a.x + vf_set1(m[4]) * a.y + vf_set1(m[7]) * a.z,
        vf_set1(m[2]) * a.x + vf_set1(m[5]) * a.y + vf_set1(m[8]) * a.z};
}
/* The first two rows and columns of an upper triangular matrix hold zeros below the diagonal. */
VINL v3 by_upper(const float m[9], v3 a)
{
    return (v3){vf_set1(m[0]) * a.x + vf_set1(m[3]) * a.y + vf_set1(m[6]) * a.z, vf_set1(m[4]) * a.y + vf_set1(m[7]) * a.z, vf_set1(m[8]) * a.z};
}
/* Vertices are bound so that they are within ±ES_POINT_FARTHEST after u, too. */
VINL float bound_before(const float u[9])
{
    float most = 1.0f;
    for (int k = 0; k < 3; k++) {
        const float sum = (u[k] < 0.0f ? -u[k] : u[k]) + (u[3 + k] < 0.0f ? -u[3 + k] : u[3 + k]) + (u[6 + k] < 0.0f ? -u[6 + k] : u[6 + k]);
        most = sum > most ? sum : most;
    }
    return ES_POINT_FARTHEST / most;
}
VINL v3 corner(const float* positions, vi index, const float u[9], float bound)
{
    v3 p;
    vf w;
    vf_gather4(positions, 16, index, &p.x, &p.y, &p.z, &w);
    return by_upper(u, v3_bound_by(p, bound));
}

/* The box of vertices [begin, end) after u. */
void ES_KERNEL(es_gi_forest_box)(const float* positions, const float u[9], uint32_t begin, uint32_t end, float low[3], float high[3])
{
    vf least[3], most[3];
    const float bound = bound_before(u);
    for (int k = 0; k < 3; k++) {
        least[k] = vf_set1(ES_POINT_FARTHEST);
        most[k] = vf_set1(-ES_POINT_FARTHEST);
    }
    for (uint32_t i = begin; i < end; i += VW) {
        const v3 p = corner(positions, vi_min(vi_set1((int32_t)i) + vi_iota(), vi_set1((int32_t)end - 1)), u, bound);
        const vf at[3] = {p.x, p.y, p.z};
        for (int k = 0; k < 3; k++) {
            least[k] = vf_min(least[k], at[k]);
            most[k] = vf_max(most[k], at[k]);
        }
    }
    for (int k = 0; k < 3; k++) {
        low[k] = least[k][0];
        high[k] = most[k][0];
        for (int lane = 1; lane < VW; lane++) {
            low[k] = least[k][lane] < low[k] ? least[k][lane] : low[k];
            high[k] = most[k][lane] > high[k] ? most[k][lane] : high[k];
        }
    }
}

/* Triangles of neighbouring leaves are near each other in space, not in memory: each is asked for before it is needed, corners after their indices. */
VINL void fetch_ahead(const es_leaf_job* job, uint32_t i, uint32_t end)
{
    const uint32_t* indices = job->mesh->indices;
    if (i + 6 * VW <= end)
        for (uint32_t k = 0; k < VW; k++) __builtin_prefetch(indices + 3 * (size_t)job->triangle[i + 5 * VW + k]);
    if (i + 3 * VW <= end)
        for (uint32_t k = 0; k < VW; k++) {
            const uint32_t* index = indices + 3 * (size_t)job->triangle[i + 2 * VW + k];
            for (int c = 0; c < 3; c++) __builtin_prefetch(job->positions + 4 * (size_t)index[c]);
        }
}

void ES_KERNEL(es_gi_forest_leaves)(const es_leaf_job* job, uint32_t begin, uint32_t end)
{
    const es_raster_mesh* mesh = job->mesh;
    const vf one = vf_set1(1.0f), side = vf_set1(job->side), magnify = vf_set1(job->magnify);
    const float bound = bound_before(job->u);
    for (uint32_t i = begin; i < end; i += VW) {
        const uint32_t n = lanes_left(i, end);
        fetch_ahead(job, i, end);
        const vi triangle = load_words(job->triangle + i, n), packed = load_words(job->barycentric + i, n);
        const vf s = vf_from_int(packed & vi_set1(0xffff)) * vf_set1(1.0f / 65535.0f), t = vf_from_int(vi_shift_right_logical(packed, 16)) * vf_set1(1.0f / 65535.0f);
        vi ia, ib, ic, unused;
        vi_gather4(mesh->indices, 12, triangle, &ia, &ib, &ic, &unused);
        const v3 a = corner(job->positions, ia, job->u, bound), b = corner(job->positions, ib, job->u, bound), c = corner(job->positions, ic, job->u, bound);
        const v3 u = v3_sub(b, a), v = v3_sub(c, a), p = {a.x + s * u.x + t * v.x, a.y + s * u.y + t * v.y, a.z + s * u.z + t * v.z};

        /* the normal: of the corners, where the mesh has some, or the triangle's */
        v3 normal = v3_cross(v3_scale(u, magnify), v3_scale(v, magnify));
        vf square = v3_dot(normal, normal);
        if (mesh->normals) {
            v3 na, nb, nc;
            vf w;
            vf_gather4(mesh->normals, 16, ia, &na.x, &na.y, &na.z, &w);
            vf_gather4(mesh->normals, 16, ib, &nb.x, &nb.y, &nb.z, &w);
            vf_gather4(mesh->normals, 16, ic, &nc.x, &nc.y, &nc.z, &w);
            const vf r = one - s - t;
            v3 smooth = v3_bound((v3){r * na.x + s * nb.x + t * nc.x, r * na.y + s * nb.y + t * nc.y, r * na.z + s * nb.z + t * nc.z});
            smooth = by_matrix(job->cofactors, smooth);
            const vf length = v3_dot(smooth, smooth);
            const vm some = vm_ge(length, vf_set1(1e-20f));
            normal = (v3){vf_select(some, smooth.x, normal.x), vf_select(some, smooth.y, normal.y), vf_select(some, smooth.z, normal.z)};
            square = vf_select(some, length, square);
        }
        const vm none = vm_lt(square, vf_set1(1e-37f));
        const vf scale = side / vf_sqrt(vf_select(none, one, square));
        normal = (v3){vf_select(none, vf_zero(), normal.x * scale), vf_select(none, side, normal.y * scale), vf_select(none, vf_zero(), normal.z * scale)};

        if (job->x) {
            const v3 world = by_matrix(job->rotation, p), turned = by_matrix(job->rotation, normal);
            store_floats(job->x + i, n, world.x + vf_set1(job->translation[0]));
            store_floats(job->y + i, n, world.y + vf_set1(job->translation[1]));
            store_floats(job->z + i, n, world.z + vf_set1(job->translation[2]));
            store_words(job->normal + i, n, es_pack_normal_v(turned.x, turned.y, turned.z));
        }
        if (!job->columns.of[0]) continue;

        /* the disc's axes */
        const vf along = load_floats(job->shapes.along + i, n), across = load_floats(job->shapes.across + i, n), shear = load_floats(job->shapes.shear + i, n);
        const vm hole = vm_lt(along, vf_zero());
        const v3 t1 = v3_bound(v3_scale(u, along));
        const v3 t2 = v3_bound(v3_scale((v3){v.x - shear * u.x, v.y - shear * u.y, v.z - shear * u.z}, across));
        const v3 cross = v3_cross(t1, t2);
        const vf circle = vf_sqrt(v3_dot(cross, cross));
        const vf g11 = v3_dot(t1, t1), g22 = v3_dot(t2, t2), g12 = v3_dot(t1, t2), difference = g11 - g22;
        const vf larger = vf_set1(0.5f) * (g11 + g22 + vf_sqrt(vf_min(difference * difference + vf_set1(4.0f) * (g12 * g12), vf_set1(1e37f))));
        const vf radius = vf_sqrt(vf_min(vf_min(larger, vf_set1(ES_POINT_STRETCH) * circle), vf_set1(1e18f)));
        const vf node[ES_NODE_COLUMNS] = {p.x, p.y, p.z, vf_select(hole, vf_set1(-1.0f), radius), normal.x, normal.y, normal.z, vf_zero(), vf_zero()};
        for (int k = 0; k < ES_NODE_COLUMNS; k++) store_floats(job->columns.of[k] + job->first + (i - begin), n, node[k]);
        store_floats(job->area + i, n, vf_select(hole, vf_zero(), vf_min(circle * vf_set1(3.14159265f / (ES_POINT_OVERLAP * ES_POINT_OVERLAP)), vf_set1(1e18f))));
    }
}

/* The smallest cone about two, of half angles below 90°: its axis is turned by (θ + α2 - α1) / 2 from the first's to the second's, θ being the angle between
 * them, and its half angle is (θ + α1 + α2) / 2. Halves by sin(x / 2) = sin x / √(2 + 2 cos x), which keeps small angles. */
VINL void merge_cones(const v3 axis1, vf s1, const v3 axis2, vf s2, v3* axis, vf* sine)
{
    const vf one = vf_set1(1.0f), two = vf_set1(2.0f);
    const vm any = vm_gt(s1, one) | vm_gt(s2, one);
    const vf k1 = vf_min(s1, one), k2 = vf_min(s2, one);
    const vf c1 = vf_sqrt(vf_max(one - k1 * k1, vf_zero())), c2 = vf_sqrt(vf_max(one - k2 * k2, vf_zero()));
    const v3 across = v3_cross(axis1, axis2);
    const vf st = vf_sqrt(v3_dot(across, across)), ct = vf_max(vf_min(v3_dot(axis1, axis2), one), vf_set1(-1.0f));
    /* θ + α2 - α1, θ + α1 - α2 and θ + α1 + α2 */
    const vf sd = k2 * c1 - c2 * k1, cd = c2 * c1 + k2 * k1;
    const vf s21 = st * cd + ct * sd, c21 = ct * cd - st * sd, s12 = st * cd - ct * sd, c12 = ct * cd + st * sd;
    const vf ss = k1 * c2 + c1 * k2, cs = c1 * c2 - k1 * k2, s = st * cs + ct * ss, c = ct * cs - st * ss;
    const vm first = vm_le(s21, vf_zero()) & vm_gt(c21, vf_zero()), second = vm_le(s12, vf_zero()) & vm_gt(c12, vf_zero());
    const vf half = s / vf_sqrt(vf_max(two + two * c, vf_set1(1e-6f)));
    /* 180° and more: the sine is no longer positive, and from 270° on the axes are more than 90° apart */
    const vm wide = any | (vm_le(s, vf_zero()) & (vm_lt(c, vf_zero()) | vm_lt(ct, vf_zero()))) | vm_lt(c, vf_set1(-0.99f));
    /* the turn's sine and cosine */
    const vf root = vf_sqrt(vf_max(two + two * c21, vf_set1(1e-6f))), st_turn = s21 / root, ct_turn = vf_set1(0.5f) * root;
    const vf share = st_turn / vf_max(st, vf_set1(1e-12f));
    const vm together = vm_lt(st, vf_set1(1e-6f));
    const vf share2 = vf_select(together, vf_zero(), share), share1 = vf_select(together, one, ct_turn - ct * share);
    v3 a = {axis1.x * share1 + axis2.x * share2, axis1.y * share1 + axis2.y * share2, axis1.z * share1 + axis2.z * share2};
    a.x = vf_select(first, axis1.x, vf_select(second, axis2.x, a.x));
    a.y = vf_select(first, axis1.y, vf_select(second, axis2.y, a.y));
    a.z = vf_select(first, axis1.z, vf_select(second, axis2.z, a.z));
    const vf square = v3_dot(a, a);
    const vm lost = vm_lt(square, vf_set1(1e-12f)); /* opposite axes: any way */
    const vf scale = one / vf_sqrt(vf_select(lost, one, square));
    axis->x = vf_select(lost, axis1.x, a.x * scale);
    axis->y = vf_select(lost, axis1.y, a.y * scale);
    axis->z = vf_select(lost, axis1.z, a.z * scale);
    /* rounding: of sines and cosines about 1e-6 */
    const vf grown = vf_max(half, vf_max(k1, k2)) * vf_set1(1.0f + 4e-6f) + vf_set1(2e-6f);
    *sine = vf_select(first, k1, vf_select(second, k2, grown));
    *sine = vf_select(wide | lost | vm_gt(*sine, one), two, *sine);
}

/* How far from the plane through `centre` across `axis` leaves' centres of a child may be, its own being within its slab and its sphere. */
VINL vf reach_across(const vf centre[3], v3 axis, const vf child[ES_NODE_COLUMNS])
{
    const v3 own = {child[4], child[5], child[6]}, way = {child[0] - centre[0], child[1] - centre[1], child[2] - centre[2]}, across = v3_cross(axis, own);
    const vf turned = vf_sqrt(v3_dot(across, across));
    return vf_abs(v3_dot(way, axis)) + vf_min(child[ES_NODE_SLAB] + child[ES_NODE_RADIUS] * turned, child[ES_NODE_RADIUS]);
}

/* The level of `level` nodes, from their children: sphere, cone, slab and area (of the level's first, and of its children's first). *sum is the sum of their
 * squared radii. */
void ES_KERNEL(es_gi_forest_merge)(const es_node_columns* columns, uint32_t level, const float* child_area, float* area, float* sum)
{
    vf total = vf_zero();
    for (uint32_t i = 0; i < level; i += VW) {
        const uint32_t n = lanes_left(i, level);
        vf l[ES_NODE_COLUMNS], r[ES_NODE_COLUMNS], node[ES_NODE_COLUMNS], left_area, right_area;
        for (int k = 0; k < ES_NODE_COLUMNS; k++) load_pairs(columns->of[k] + 2 * (size_t)(level + i), n, &l[k], &r[k]);
        const v3 way = {r[0] - l[0], r[1] - l[1], r[2] - l[2]};
        const vf distance = vf_sqrt(v3_dot(way, way));
        const vm no_left = vm_lt(l[3], vf_zero()), no_right = vm_lt(r[3], vf_zero());
        const vm left = no_right | (~no_left & vm_le(distance + r[3], l[3])), right = ~left & (no_left | vm_le(distance + l[3], r[3]));
        const vf radius = vf_set1(0.5f) * (distance + l[3] + r[3]);
        const vf share = vf_min(vf_max((radius - l[3]) / vf_max(distance, vf_set1(1e-30f)), vf_zero()), vf_set1(1.0f));
        for (int k = 0; k < 3; k++) node[k] = vf_select(left, l[k], vf_select(right, r[k], l[k] + (r[k] - l[k]) * share));
        /* rounding of the centre and of the sum */
        const vf grown = radius * vf_set1(1.0f + 1e-6f) + vf_set1(2e-7f) * (vf_abs(node[0]) + vf_abs(node[1]) + vf_abs(node[2]));
        node[3] = vf_select(left, l[3], vf_select(right, r[3], grown));
        const v3 axis1 = {l[4], l[5], l[6]}, axis2 = {r[4], r[5], r[6]};
        v3 axis;
        vf sine;
        merge_cones(axis1, l[7], axis2, r[7], &axis, &sine);
        node[4] = vf_select(no_right, axis1.x, vf_select(no_left, axis2.x, axis.x));
        node[5] = vf_select(no_right, axis1.y, vf_select(no_left, axis2.y, axis.y));
        node[6] = vf_select(no_right, axis1.z, vf_select(no_left, axis2.z, axis.z));
        node[7] = vf_select(no_right, l[7], vf_select(no_left, r[7], sine));
        vf slab = vf_max(reach_across(node, axis, l), reach_across(node, axis, r)) * vf_set1(1.0f + 1e-6f);
        slab = vf_min(vf_select(vm_gt(sine, vf_set1(1.0f)), node[3], slab), node[3]);
        node[8] = vf_select(no_right, l[8], vf_select(no_left, r[8], slab));
        total = total + vf_and(vm_first((int32_t)n) & vm_gt(node[3], vf_zero()), node[3] * node[3]);
        for (int k = 0; k < ES_NODE_COLUMNS; k++) store_floats(columns->of[k] + level + i, n, node[k]);
        load_pairs(child_area + 2 * (size_t)i, n, &left_area, &right_area);
        store_floats(area + i, n, left_area + right_area);
    }
    *sum = vf_sum(total);
}

/* `count` nodes of the columns from `first` on. */
void ES_KERNEL(es_gi_forest_quantise)(const es_node_frame* frame, const es_node_columns* columns, uint32_t first, uint32_t count, es_point_node* nodes)
{
    const vf one = vf_set1(1.0f), most = vf_set1(65535.0f);
    vf inverse[3];
    for (int k = 0; k < 3; k++) inverse[k] = vf_set1(frame->step[k] > 0.0f ? 1.0f / frame->step[k] : 0.0f);
    const vf per_radius = vf_set1(frame->radius_step > 0.0f ? 1.0f / frame->radius_step : 0.0f), error = vf_set1(frame->error);
    for (uint32_t i = 0; i < count; i += VW) {
        const uint32_t n = lanes_left(i, count);
        vf node[ES_NODE_COLUMNS];
        for (int k = 0; k < ES_NODE_COLUMNS; k++) node[k] = load_floats(columns->of[k] + first + i, n);
        vi q[3];
        for (int k = 0; k < 3; k++) q[k] = vi_round(vf_min(vf_max((node[k] - vf_set1(frame->low[k])) * inverse[k], vf_zero()), most));
        const vm absent = vm_lt(node[3], vf_zero());
        vi radius = vi_truncate(vf_min(vf_max((node[3] + error) * per_radius * vf_set1(1.0f + 1e-6f), vf_zero()), most)) + vi_set1(1);
        radius = vi_select(absent, vi_zero(), vi_min(radius, vi_set1(65535)));

        const vf norm = one / vf_max(vf_abs(node[4]) + vf_abs(node[5]) + vf_abs(node[6]), vf_set1(1e-30f));
        const vf px = node[4] * norm, py = node[5] * norm;
        const vm below = vm_lt(node[6], vf_zero());
        const vf ox = vf_select(below, vf_copysign(one - vf_abs(py), px), px), oy = vf_select(below, vf_copysign(one - vf_abs(px), py), py);
        const vi qx = vi_round(ox * vf_set1(511.0f)) + vi_set1(512);
        const vi qy = vi_round(oy * vf_set1(511.0f)) + vi_set1(512);
        v3 axis = {vf_from_int(qx - vi_set1(512)) * vf_set1(1.0f / 511.0f), vf_from_int(qy - vi_set1(512)) * vf_set1(1.0f / 511.0f), vf_zero()};
        axis.z = one - vf_abs(axis.x) - vf_abs(axis.y);
        const vf fold = vf_max(vf_neg(axis.z), vf_zero());
        axis.x = axis.x - vf_copysign(fold, axis.x);
        axis.y = axis.y - vf_copysign(fold, axis.y);
        axis = v3_scale(axis, one / vf_sqrt(v3_dot(axis, axis)));
        const v3 turned = v3_cross(axis, (v3){node[4], node[5], node[6]});
        const vf error = vf_sqrt(v3_dot(turned, turned)) + vf_set1(1e-6f), sine = vf_min(node[7], one);
        const vf whole = sine * vf_sqrt(vf_max(one - error * error, vf_zero())) + vf_sqrt(vf_max(one - sine * sine, vf_zero())) * error;
        /* beyond 90° the sine falls again: α + ε passes it when the cosine of the sum is negative */
        const vf cosine = vf_sqrt(vf_max(one - sine * sine, vf_zero())) * vf_sqrt(vf_max(one - error * error, vf_zero())) - sine * error;
        vi cone = vi_truncate(vf_sqrt(vf_max(whole, vf_zero())) * vf_set1(62.0f * (1.0f + 1e-6f))) + vi_set1(1);
        cone = vi_select(vm_gt(node[7], one) | vm_le(cosine, vf_zero()) | vi_gt(cone, vi_set1(62)), vi_set1(63), cone);
        /* rounding of what is flat is none */
        vi thickness = vi_truncate(vf_min(node[8] / vf_max(node[3], vf_set1(1e-30f)), one) * vf_set1(63.0f * (1.0f - 1e-6f))) + vi_set1(1);
        thickness = vi_select(vm_le(node[8], node[3] * vf_set1(ES_POINT_FLAT)) | absent, vi_zero(), thickness);

        /* records of four words; their light is left as it is */
        if (n == VW) {
            vi w[4];
            vi_gather4(nodes + i, 16, vi_iota(), &w[0], &w[1], &w[2], &w[3]);
            vf_store4((float*)(nodes + i), vf_from_bits(q[0] | q[1] << 16), vf_from_bits(q[2] | radius << 16), vf_from_bits(qx | qy << 10 | cone << 20 | thickness << 26), vf_from_bits(w[3]));
        } else {
            uint32_t words[3][VW];
            vi_store(words[0], q[0] | q[1] << 16);
            vi_store(words[1], q[2] | radius << 16);
            vi_store(words[2], qx | qy << 10 | cone << 20 | thickness << 26);
            for (uint32_t k = 0; k < n; k++)
                for (int w = 0; w < 3; w++) memcpy((char*)(nodes + i + k) + 4 * w, &words[w][k], 4);
        }
    }
}

/* Light of parents [begin, end) from their children's, by area. */
void ES_KERNEL(es_gi_forest_pull)(const es_node_light* light, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i += VW) {
        const uint32_t n = lanes_left(i, end);
        vf a, b;
        load_pairs(light->area + 2 * (size_t)i, n, &a, &b);
        const vf share = b / vf_max(a + b, vf_set1(1e-30f));
        for (int c = 0; c < 3; c++) {
            vf left, right;
            load_pairs(light->radiance[c] + 2 * (size_t)i, n, &left, &right);
            store_floats(light->radiance[c] + i, n, left + (right - left) * share);
        }
    }
}

/* Light of nodes [begin, end) into the quantised ones. */
void ES_KERNEL(es_gi_forest_pack)(const es_node_light* light, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i += VW) {
        const uint32_t n = lanes_left(i, end);
        uint32_t words[VW];
        vi_store(words, es_pack_rgb9e5_v(load_floats(light->radiance[0] + i, n), load_floats(light->radiance[1] + i, n), load_floats(light->radiance[2] + i, n)));
        for (uint32_t k = 0; k < n; k++) light->packed[i + k].radiance = words[k];
    }
}

/* What parents [begin, end) reflect and emit, by area. */
void ES_KERNEL(es_gi_forest_blend)(const es_node_looks* looks, uint32_t begin, uint32_t end)
{
    uint32_t* const words[2] = {looks->albedo, looks->emission};
    for (uint32_t i = begin; i < end; i += VW) {
        const uint32_t n = lanes_left(i, end);
        vf a, b;
        load_pairs(looks->area + 2 * (size_t)i, n, &a, &b);
        const vf share = b / vf_max(a + b, vf_set1(1e-30f));
        for (int k = 0; k < 2; k++) {
            vf l, r, lr, lg, lb, rr, rg, rb;
            load_pairs(words[k] + 2 * (size_t)i, n, &l, &r);
            es_unpack_rgb9e5_v(vi_from_bits(l), &lr, &lg, &lb);
            es_unpack_rgb9e5_v(vi_from_bits(r), &rr, &rg, &rb);
            store_words(words[k] + i, n, es_pack_rgb9e5_v(lr + (rr - lr) * share, lg + (rg - lg) * share, lb + (rb - lb) * share));
        }
    }
}
