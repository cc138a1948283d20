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
VINL v3 v3_add(v3 a, v3 b) { return (v3){a.x + b.x, a.y + b.y, a.z + b.z}; }
VINL v3 v3_select(vm m, v3 yes, v3 no) { return (v3){vf_select(m, yes.x, no.x), vf_select(m, yes.y, no.y), vf_select(m, yes.z, no.z)}; }
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
/* Eight nodes. */
typedef struct nodes8 {
    v3 centre, axis;
    vf radius, sine, slab, cosine;
} nodes8;
/* n of a record: all from its first on, or some of one */
VINL nodes8 load_nodes(float* nodes, size_t first, uint32_t n)
{
    const float* p = es_node_value(nodes, first, 0);
    return (nodes8){{load_floats(p + 8 * ES_NODE_X, n), load_floats(p + 8 * ES_NODE_Y, n), load_floats(p + 8 * ES_NODE_Z, n)},
        {load_floats(p + 8 * ES_NODE_AXIS_X, n), load_floats(p + 8 * ES_NODE_AXIS_Y, n), load_floats(p + 8 * ES_NODE_AXIS_Z, n)}, load_floats(p + 8 * ES_NODE_RADIUS, n),
        load_floats(p + 8 * ES_NODE_SINE, n), load_floats(p + 8 * ES_NODE_SLAB, n), load_floats(p + 8 * ES_NODE_COSINE, n)};
}
VINL void store_nodes(float* nodes, size_t first, uint32_t n, nodes8 node)
{
    float* p = es_node_value(nodes, first, 0);
    store_floats(p + 8 * ES_NODE_X, n, node.centre.x);
    store_floats(p + 8 * ES_NODE_Y, n, node.centre.y);
    store_floats(p + 8 * ES_NODE_Z, n, node.centre.z);
    store_floats(p + 8 * ES_NODE_RADIUS, n, node.radius);
    store_floats(p + 8 * ES_NODE_AXIS_X, n, node.axis.x);
    store_floats(p + 8 * ES_NODE_AXIS_Y, n, node.axis.y);
    store_floats(p + 8 * ES_NODE_AXIS_Z, n, node.axis.z);
    store_floats(p + 8 * ES_NODE_SINE, n, node.sine);
    store_floats(p + 8 * ES_NODE_SLAB, n, node.slab);
    store_floats(p + 8 * ES_NODE_COSINE, n, node.cosine);
}
/* a value of n pairs of nodes: of two records, or of some of one */
VINL void load_children(const float* p, int value, uint32_t n, vf* left, vf* right)
{
    if (n == VW) vf_deinterleave(vf_load(p + 8 * value), vf_load(p + 8 * value + ES_NODE_RECORD), left, right);
    else load_pairs(p + 8 * value, n, left, right);
}
VINL nodes8 select_nodes(vm m, nodes8 yes, nodes8 no)
{
    return (nodes8){v3_select(m, yes.centre, no.centre), v3_select(m, yes.axis, no.axis), vf_select(m, yes.radius, no.radius), vf_select(m, yes.sine, no.sine),
        vf_select(m, yes.slab, no.slab), vf_select(m, yes.cosine, no.cosine)};
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

/* Vertices of neighbouring leaves are near each other in space, not in memory: they are asked for before they are needed. */
enum { AHEAD = 4 * VW };

void ES_KERNEL(es_gi_forest_vertices)(const float* positions, const float u[9], const uint32_t* vertices, uint32_t count, float* to)
{
    const float bound = bound_before(u);
    for (uint32_t i = 0; i < count; i += VW) {
        if (i + AHEAD < count)
            for (uint32_t k = 0; k < VW; k++) __builtin_prefetch(positions + 4 * (size_t)vertices[i + AHEAD + k]);
        const v3 p = corner(positions, vi_load(vertices + i), u, bound);
        vf_store4(to + 4 * (size_t)i, p.x, p.y, p.z, vf_zero());
    }
}

void ES_KERNEL(es_gi_forest_normals)(const float* from, const uint32_t* vertices, uint32_t count, float* to)
{
    for (uint32_t i = 0; i < count; i++) {
        if (i + AHEAD < count) __builtin_prefetch(from + 4 * (size_t)vertices[i + AHEAD]);
        memcpy(to + 4 * (size_t)i, from + 4 * (size_t)vertices[i], 4 * sizeof(float));
    }
}

typedef uint16_t half_words __attribute__((vector_size(16)));
VINL vi load_corners(const uint16_t* corners)
{
    half_words w;
    memcpy(&w, corners, sizeof w);
    return __builtin_convertvector(w, vi);
}
/* corners: twice the records' numbers */
VINL v3 record(const float* records, vi corners)
{
    v3 a;
    vf w;
    vf_gather4(records, 8, corners, &a.x, &a.y, &a.z, &w);
    return a;
}

/* Nodes of leaves and of the levels above them, which are written when a part is complete: by then they are in the cache. */
VINL void fetch_nodes(const es_leaf_job* job, uint32_t i)
{
    const uint32_t node = job->leaf_count + i;
    __builtin_prefetch(job->packed + node, 1);
    __builtin_prefetch(job->packed + node + VW / 2, 1);
    __builtin_prefetch(job->packed + node / 2, 1);
    __builtin_prefetch(job->packed + node / 4, 1);
    __builtin_prefetch(job->packed + node / 8, 1);
}

VINL void make_leaves(const es_leaf_job* job, uint32_t i, uint32_t node, uint32_t n)
{
    if (job->packed) fetch_nodes(job, i);
    const vf one = vf_set1(1.0f), side = vf_set1(job->side), magnify = vf_set1(job->magnify);
    const uint16_t* corners = job->corners + 3 * (size_t)i;
    const vi packed = load_words(job->barycentric + i, n), ia = load_corners(corners), ib = load_corners(corners + VW), ic = load_corners(corners + 2 * VW);
    const vf s = vf_from_int(packed & vi_set1(0xffff)) * vf_set1(1.0f / 65535.0f), t = vf_from_int(vi_shift_right_logical(packed, 16)) * vf_set1(1.0f / 65535.0f);
    const v3 a = record(job->vertices, ia), b = record(job->vertices, ib), c = record(job->vertices, ic);
    const v3 u = v3_sub(b, a), v = v3_sub(c, a), p = v3_add(v3_add(a, v3_scale(u, s)), v3_scale(v, t));

    /* the normal: of the corners, where the mesh has some, or the triangle's */
    v3 normal = v3_cross(v3_scale(u, magnify), v3_scale(v, magnify));
    vf square = v3_dot(normal, normal);
    if (job->normals) {
        const v3 na = v3_scale(record(job->normals, ia), one - s - t), nb = v3_scale(record(job->normals, ib), s), nc = v3_scale(record(job->normals, ic), t);
        const v3 smooth = by_matrix(job->cofactors, v3_bound(v3_add(v3_add(na, nb), nc)));
        const vf length = v3_dot(smooth, smooth);
        const vm some = vm_ge(length, vf_set1(1e-20f));
        normal = v3_select(some, smooth, normal);
        square = vf_select(some, length, square);
    }
    const vm none = vm_lt(square, vf_set1(1e-37f));
    normal = v3_select(none, (v3){vf_zero(), side, vf_zero()}, v3_scale(normal, side / vf_sqrt(vf_select(none, one, square))));

    if (job->x) {
        const v3 world = by_matrix(job->rotation, p), turned = by_matrix(job->rotation, normal);
        store_floats(job->x + i, n, world.x + vf_set1(job->translation[0]));
        store_floats(job->y + i, n, world.y + vf_set1(job->translation[1]));
        store_floats(job->z + i, n, world.z + vf_set1(job->translation[2]));
        store_words(job->normal + i, n, es_pack_normal_v(turned.x, turned.y, turned.z));
    }
    if (!job->nodes) return;

    /* the disc's axes */
    const vf along = load_floats(job->shapes.along + i, n), across = load_floats(job->shapes.across + i, n), shear = load_floats(job->shapes.shear + i, n);
    const vm hole = vm_lt(along, vf_zero());
    const v3 t1 = v3_bound(v3_scale(u, along)), t2 = v3_bound(v3_scale(v3_sub(v, v3_scale(u, shear)), across));
    const v3 cross = v3_cross(t1, t2);
    const vf circle = vf_sqrt(v3_dot(cross, cross));
    const vf g11 = v3_dot(t1, t1), g22 = v3_dot(t2, t2), g12 = v3_dot(t1, t2), difference = g11 - g22;
    const vf larger = vf_set1(0.5f) * (g11 + g22 + vf_sqrt(vf_min(difference * difference + vf_set1(4.0f) * (g12 * g12), vf_set1(1e37f))));
    const vf radius = vf_sqrt(vf_min(vf_min(larger, vf_set1(ES_POINT_STRETCH) * circle), vf_set1(1e18f)));
    store_nodes(job->nodes, node, n, (nodes8){.centre = p, .axis = normal, .radius = vf_select(hole, vf_set1(-1.0f), radius), .cosine = one});
    store_floats(job->area + i, n, vf_select(hole, vf_zero(), vf_min(circle * vf_set1(3.14159265f / (ES_POINT_OVERLAP * ES_POINT_OVERLAP)), vf_set1(1e18f))));
}

/* `begin` is a multiple of eight. */
void ES_KERNEL(es_gi_forest_leaves)(const es_leaf_job* job, uint32_t begin, uint32_t end)
{
    uint32_t i = begin;
    for (; i + VW <= end; i += VW) make_leaves(job, i, job->first + (i - begin), VW);
    if (i < end) make_leaves(job, i, job->first + (i - begin), end - i);
}

/* The smallest cone about two, of half angles below 90°: its axis is turned by (θ + α2 - α1) / 2 from the first's to the second's, θ being the angle between
 * them, and its half angle is (θ + α1 + α2) / 2. Halves by sin(x / 2) = sin x / √(2 + 2 cos x), which keeps small angles. turned: sines of the angles
 * between its axis and theirs. */
VINL void merge_cones(const nodes8* l, const nodes8* r, nodes8* node, vf turned[2])
{
    const vf one = vf_set1(1.0f), two = vf_set1(2.0f);
    const vf k1 = l->sine, k2 = r->sine, c1 = l->cosine, c2 = r->cosine;
    const v3 across = v3_cross(l->axis, r->axis);
    const vf st = vf_sqrt(v3_dot(across, across)), ct = vf_max(vf_min(v3_dot(l->axis, r->axis), one), vf_set1(-1.0f));
    /* θ + α2 - α1, θ + α1 - α2 and θ + α1 + α2 */
    const vf sd = k2 * c1 - c2 * k1, cd = c2 * c1 + k2 * k1;
    const vf s21 = st * cd + ct * sd, c21 = ct * cd - st * sd, s12 = st * cd - ct * sd, c12 = ct * cd + st * sd;
    const vf ss = k1 * c2 + c1 * k2, cs = c1 * c2 - k1 * k2, s = st * cs + ct * ss, c = ct * cs - st * ss;
    const vm first = vm_le(s21, vf_zero()) & vm_gt(c21, vf_zero()), second = vm_le(s12, vf_zero()) & vm_gt(c12, vf_zero());
    /* 180° and more: the sine is no longer positive, and from 270° on the axes are more than 90° apart; what is not much less counts as well, so that axes that are
     * summed are at least 8° from opposite */
    const vm wide = vm_gt(vf_max(k1, k2), one) | (vm_le(s, vf_zero()) & (vm_lt(c, vf_zero()) | vm_lt(ct, vf_zero()))) | vm_lt(c, vf_set1(-0.99f));
    /* one division for three: by √(2 + 2 cos) of the angle and of the turn, and by sin θ */
    const vf root = vf_sqrt(vf_max(two + two * c, vf_set1(1e-6f))), root21 = vf_sqrt(vf_max(two + two * c21, vf_set1(1e-6f))), st_least = vf_max(st, vf_set1(1e-12f));
    const vf root21_st = root21 * st_least, inverse = one / (root * root21_st);
    const vf half = s * root21_st * inverse, share = s21 * root * inverse;
    const vf ct_turn = vf_set1(0.5f) * root21, st_turn = share * st_least;
    const vm together = vm_lt(st, vf_set1(1e-6f));
    const vf share2 = vf_select(together, vf_zero(), share), share1 = vf_select(together, one, ct_turn - ct * share);
    const v3 turn = v3_add(v3_scale(l->axis, share1), v3_scale(r->axis, share2));
    const v3 axis = v3_scale(turn, vf_set1(1.5f) - vf_set1(0.5f) * v3_dot(turn, turn)); /* it is of unit length but for rounding */
    node->axis = v3_select(first | wide, l->axis, v3_select(second, r->axis, axis));
    turned[0] = vf_select(first, vf_zero(), vf_select(second, st, st_turn));
    turned[1] = vf_select(first, st, vf_select(second, vf_zero(), vf_max(st * ct_turn - ct * st_turn, vf_zero())));
    /* rounding: of sines and cosines about 1e-6 */
    const vf grown = vf_max(half, vf_max(k1, k2)) * vf_set1(1.0f + 4e-6f) + vf_set1(2e-6f);
    const vf sine = vf_select(first, k1, vf_select(second, k2, grown));
    node->sine = vf_select(wide | vm_gt(sine, one), two, sine);
}

/* The same about two directions: its axis is their mean. */
VINL void merge_axes(const nodes8* l, const nodes8* r, nodes8* node)
{
    const vf one = vf_set1(1.0f);
    const v3 sum = v3_add(l->axis, r->axis), way = v3_sub(r->axis, l->axis);
    const vf square = v3_dot(sum, sum), apart = v3_dot(way, way);
    const vm wide = vm_lt(square, vf_set1(0.02f)), same = vm_le(apart, vf_zero());
    node->axis = v3_select(wide | same, l->axis, v3_scale(sum, one / vf_sqrt(vf_max(square, vf_set1(0.01f)))));
    const vf sine = vf_sqrt(apart) * vf_set1(0.5f * (1.0f + 4e-6f)) + vf_set1(2e-6f);
    node->sine = vf_select(same, vf_zero(), vf_select(wide | vm_gt(sine, one), vf_set1(2.0f), sine));
}

/* How far from the plane through a node's centre across its axis leaves' centres of a child may be, its own being within its slab and its sphere. */
VINL vf reach_across(const nodes8* node, const nodes8* child, vf turned)
{
    return vf_abs(v3_dot(v3_sub(child->centre, node->centre), node->axis)) + vf_min(child->slab + child->radius * turned, child->radius);
}

VINL nodes8 merge_nodes(nodes8 l, nodes8 r, bool leaves)
{
    nodes8 node;
    const vm no_left = vm_lt(l.radius, vf_zero()), no_right = vm_lt(r.radius, vf_zero());
    if (vm_any(no_left | no_right)) { /* then it is the other */
        l = select_nodes(no_left, r, l);
        r = select_nodes(no_right, l, r);
    }
    const v3 way = v3_sub(r.centre, l.centre);
    const vf distance = vf_sqrt(v3_dot(way, way)), radius = vf_set1(0.5f) * (distance + l.radius + r.radius);
    const vm in_left = vm_le(distance + r.radius, l.radius), in_right = vm_le(distance + l.radius, r.radius);
    const vf share = vf_min(vf_max((radius - l.radius) / vf_max(distance, vf_set1(1e-30f)), vf_zero()), vf_set1(1.0f));
    node.centre = v3_select(in_left, l.centre, v3_select(in_right, r.centre, v3_add(l.centre, v3_scale(way, share))));
    /* rounding of the centre and of the sum */
    const vf grown = radius * vf_set1(1.0f + 1e-6f) + vf_set1(2e-7f) * (vf_abs(node.centre.x) + vf_abs(node.centre.y) + vf_abs(node.centre.z));
    node.radius = vf_select(in_left, l.radius, vf_select(in_right, r.radius, grown));
    vf slab;
    if (leaves) { /* flat, and in their own planes */
        merge_axes(&l, &r, &node);
        slab = vf_max(vf_abs(v3_dot(v3_sub(l.centre, node.centre), node.axis)), vf_abs(v3_dot(v3_sub(r.centre, node.centre), node.axis)));
    } else {
        vf turned[2];
        merge_cones(&l, &r, &node, turned);
        slab = vf_max(reach_across(&node, &l, turned[0]), reach_across(&node, &r, turned[1]));
    }
    node.cosine = vf_sqrt(vf_max(vf_set1(1.0f) - node.sine * node.sine, vf_zero()));
    /* rounding of angles */
    slab = slab * vf_set1(1.0f + 1e-6f) + node.radius * vf_set1(5e-7f);
    node.slab = vf_max(vf_min(vf_select(vm_gt(node.sine, vf_set1(1.0f)), node.radius, slab), node.radius), vf_zero()); /* of none: no negative one */
    return node;
}

/* Nodes [i, i + n) of a level; their squared radii. */
VINL vf merge_some(float* nodes, uint32_t level, uint32_t i, uint32_t n, bool leaves, const float* child_area, float* area)
{
    const float* child = es_node_value(nodes, 2 * (size_t)(level + i), 0);
    nodes8 l, r;
    vf left_area, right_area;
    load_children(child, ES_NODE_X, n, &l.centre.x, &r.centre.x);
    load_children(child, ES_NODE_Y, n, &l.centre.y, &r.centre.y);
    load_children(child, ES_NODE_Z, n, &l.centre.z, &r.centre.z);
    load_children(child, ES_NODE_RADIUS, n, &l.radius, &r.radius);
    load_children(child, ES_NODE_AXIS_X, n, &l.axis.x, &r.axis.x);
    load_children(child, ES_NODE_AXIS_Y, n, &l.axis.y, &r.axis.y);
    load_children(child, ES_NODE_AXIS_Z, n, &l.axis.z, &r.axis.z);
    l.sine = r.sine = l.slab = r.slab = vf_zero();
    l.cosine = r.cosine = vf_set1(1.0f);
    if (!leaves) {
        load_children(child, ES_NODE_SINE, n, &l.sine, &r.sine);
        load_children(child, ES_NODE_SLAB, n, &l.slab, &r.slab);
        load_children(child, ES_NODE_COSINE, n, &l.cosine, &r.cosine);
    }
    const nodes8 node = merge_nodes(l, r, leaves);
    store_nodes(nodes, level + i, n, node);
    load_pairs(child_area + 2 * (size_t)i, n, &left_area, &right_area);
    store_floats(area + i, n, left_area + right_area);
    return vf_and(vm_first((int32_t)n) & vm_gt(node.radius, vf_zero()), node.radius * node.radius);
}

VINL float merge_level(float* nodes, uint32_t level, bool leaves, const float* child_area, float* area)
{
    vf total = vf_zero();
    uint32_t i = 0;
    for (; i + VW <= level; i += VW) total = total + merge_some(nodes, level, i, VW, leaves, child_area, area);
    if (i < level) total = total + merge_some(nodes, level, i, level - i, leaves, child_area, area);
    return vf_sum(total);
}

/* The level of `level` nodes, from their children, which may be leaves: sphere, cone, slab and area (of the level's first, and of its children's first). *sum is the sum
 * of their squared radii. */
void ES_KERNEL(es_gi_forest_merge)(float* nodes, uint32_t level, bool leaves, const float* child_area, float* area, float* sum)
{
    *sum = leaves ? merge_level(nodes, level, true, child_area, area) : merge_level(nodes, level, false, child_area, area);
}

/* s of es_point_node.cone, of a cone about `axis`, which is decoded from the words but not yet of unit length. */
VINL vi cone_bits(v3 axis, vf sum, const nodes8* node, bool leaves)
{
    const vf one = vf_set1(1.0f);
    const v3 turned = v3_cross(axis, node->axis);
    const vf turned2 = v3_dot(turned, turned);
    if (leaves) { /* the turn itself, at most 0.24°: against the squares of (s / 62)² less 1e-6 */
        const vf length2 = v3_dot(axis, axis);
        vi s = vi_set1(1);
        const float step[4] = {1 / 3844.0f - 1e-6f, 4 / 3844.0f - 1e-6f, 9 / 3844.0f - 1e-6f, 16 / 3844.0f - 1e-6f};
        s = s - vm_gt(turned2, vf_set1(step[0] * step[0]) * length2) - vm_gt(turned2, vf_set1(step[1] * step[1]) * length2);
        return s - vm_gt(turned2, vf_set1(step[2] * step[2]) * length2) - vm_gt(turned2, vf_set1(step[3] * step[3]) * length2);
    }
    /* one over the axis' length is not above its sum by more than the turn */
    const vf error = vf_sqrt(turned2) * (sum * vf_set1(1.01f)) + vf_set1(1e-6f);
    const vf whole = vf_min(node->sine, one) + node->cosine * error;
    /* beyond 90° the sine falls again: α + ε passes it when the cosine of the sum is negative */
    const vm wide = vm_gt(node->sine, one) | vm_le(node->cosine * (one - error * error), node->sine * error);
    const vi s = vi_truncate(vf_sqrt(whole) * vf_set1(62.0f * (1.0f + 1e-6f))) + vi_set1(1);
    return vi_select(wide | vi_gt(s, vi_set1(62)), vi_set1(63), s);
}

typedef struct rounding { vf low[3], inverse[3], per_radius, error; } rounding;

VINL void quantise_some(const rounding* by, nodes8 node, uint32_t n, bool leaves, es_point_node* to)
{
    const vf one = vf_set1(1.0f), most = vf_set1(65535.0f);
    const vi x = vi_round(vf_min(vf_max((node.centre.x - by->low[0]) * by->inverse[0], vf_zero()), most));
    const vi y = vi_round(vf_min(vf_max((node.centre.y - by->low[1]) * by->inverse[1], vf_zero()), most));
    const vi z = vi_round(vf_min(vf_max((node.centre.z - by->low[2]) * by->inverse[2], vf_zero()), most));
    const vm absent = vm_lt(node.radius, vf_zero());
    const vi radius = ~absent & vi_min(vi_truncate(vf_clamp((node.radius + by->error) * by->per_radius, vf_zero(), most)) + vi_set1(1), vi_set1(65535));

    /* one division for two */
    const vf radius_least = vf_max(node.radius, vf_set1(1e-30f)), sum = vf_max(vf_abs(node.axis.x) + vf_abs(node.axis.y) + vf_abs(node.axis.z), vf_set1(0.5f));
    const vf both = one / (leaves ? sum : sum * radius_least), norm = leaves ? both : both * radius_least;
    const vf px = node.axis.x * norm, py = node.axis.y * norm;
    const vm below = vm_lt(node.axis.z, vf_zero());
    const vf ox = vf_select(below, vf_copysign(one - vf_abs(py), px), px), oy = vf_select(below, vf_copysign(one - vf_abs(px), py), py);
    const vi qx = vi_round(ox * vf_set1(511.0f)), qy = vi_round(oy * vf_set1(511.0f));
    v3 axis = {vf_from_int(qx) * vf_set1(1.0f / 511.0f), vf_from_int(qy) * vf_set1(1.0f / 511.0f), vf_zero()};
    axis.z = one - vf_abs(axis.x) - vf_abs(axis.y);
    const vf fold = vf_max(vf_neg(axis.z), vf_zero());
    axis.x = axis.x - vf_copysign(fold, axis.x);
    axis.y = axis.y - vf_copysign(fold, axis.y);
    vi cone = (qx + vi_set1(512)) | (qy + vi_set1(512)) << 10 | cone_bits(axis, sum, &node, leaves) << 20;
    if (!leaves) {
        /* rounding of what is flat is none */
        const vi thickness = vi_truncate(vf_min(node.slab * (both * sum), one) * vf_set1(63.0f * (1.0f - 1e-6f))) + vi_set1(1);
        cone = cone | (~vm_le(node.slab, node.radius * vf_set1(ES_POINT_FLAT)) & ~absent & thickness) << 26;
    }

    /* records of four words; their light is left as it is */
    const vi words[3] = {x | y << 16, z | radius << 16, cone};
    if (n == VW) {
        vf_store3((float*)to, vf_from_bits(words[0]), vf_from_bits(words[1]), vf_from_bits(words[2]));
        return;
    }
    for (uint32_t k = 0; k < n; k++)
        for (int w = 0; w < 3; w++) memcpy((char*)(to + k) + 4 * w, (const char*)&words[w] + 4 * k, 4);
}

VINL void quantise(const es_node_frame* frame, float* nodes, uint32_t first, uint32_t count, bool leaves, es_point_node* to)
{
    rounding by = {.per_radius = vf_set1(frame->radius_step > 0.0f ? 1.0f / frame->radius_step * (1.0f + 1e-6f) : 0.0f), .error = vf_set1(frame->error)};
    for (int k = 0; k < 3; k++) {
        by.inverse[k] = vf_set1(frame->step[k] > 0.0f ? 1.0f / frame->step[k] : 0.0f);
        by.low[k] = vf_set1(frame->low[k]);
    }
    uint32_t i = 0;
    for (; i + VW <= count; i += VW) quantise_some(&by, load_nodes(nodes, first + i, VW), VW, leaves, to + i);
    if (i < count) quantise_some(&by, load_nodes(nodes, first + i, count - i), count - i, leaves, to + i);
}

/* `count` nodes from `first` on, all of them leaves or none: whole records, or some of one. */
void ES_KERNEL(es_gi_forest_quantise)(const es_node_frame* frame, float* nodes, uint32_t first, uint32_t count, bool leaves, es_point_node* to)
{
    if (leaves) quantise(frame, nodes, first, count, true, to);
    else quantise(frame, nodes, first, count, false, to);
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
