/* Rays through the hierarchy (gi/reference/bvh_nodes.h).
 *
 * Boxes: eight children of a node against one ray, slabs of distances (plane - origin) / direction. The sign of the direction says which
 * plane comes first, so no minimum or maximum of the two is needed. Each distance carries up to 3 roundings; far distances are widened
 * by 2 gamma(3) (Ize 2013), so no triangle that the test below accepts lies in a box that is passed by.
 *
 * Triangles: eight of a block against one ray, watertight (Woop, Benthin and Wald 2013): corners are moved to the ray's origin and sheared so
 * that the ray is the axis of largest direction; the three edge functions are exact in sign up to one rounding that is the same from both
 * sides of an edge, and where one is zero it is found again in double, in which the products are exact.
 *
 * A hit counts when it is nearer than the nearest so far, or as near with a lower primitive. Boxes are passed by only when they begin
 * beyond the nearest hit, so the order of traversal does not matter.
 *
 * Rays that go together: eight of one octant share a traversal. A node's boxes are met with the intervals of their origins and inverses, whose
 * distances enclose each ray's, as subtraction and multiplication round monotonically; a block's box is then met with each ray, by the
 * operations it would meet alone, and its triangles with the rays that meet the box. Thus every ray looks at the blocks it could hit and
 * has the same hits as alone.
 */
#include "gi/kernel_table.h"
#include "gi/reference/bvh_nodes.h"
#include "platform/simd.h"

/* 1 + 2 gamma(3) is 1.00000072; the rest leaves room for NEAR_MARGIN */
#define FAR_MARGIN 1.0000305f
/* By rounding alone a hit may be nearer than its block's box begins, mostly by a few units in the last place. Hits are compared by the greater of
 * their distance and begin · NEAR_MARGIN: then what lies in a box that begins beyond nearest · FAR_MARGIN is farther than nearest whatever
 * its rounding, as (1 + 30.5e-6) (1 - 29e-6) less two roundings of 6e-8 is above 1 by more than a unit in the last place. So which boxes were
 * looked at before, and in what order, decides nothing. */
#define NEAR_MARGIN 0.999971f
/* stands for the inverse of a direction component of zero: finite, so that a plane through the origin gives 0
 * and not NaN, and so small that the distance to any plane stays finite */
#define STEEP 1e28f

typedef struct ray_setup {
    vf origin[3], far_origin[3], inverse[3];
    int near_plane[3], far_plane[3];  /* index of the plane that is met first, last */
    int kx, ky, kz;                   /* kz: axis of the largest direction component */
    vf sx, sy, sz;                    /* shear and scale */
} ray_setup;

VINL void prepare(const es_ray* ray, ray_setup* s)
{
    for (int k = 0; k < 3; k++) {
        float d = ray->direction[k];
        bool steep = d <= 1e-28f && d >= -1e-28f, negative = d < 0.0f && !steep;
        float origin = ray->origin[k], inverse = steep ? STEEP : 1.0f / d;
        s->origin[k] = vf_set1(origin);
        /* a ray within the plane of a box's far side would leave it at 0 · STEEP */
        s->far_origin[k] = vf_set1(steep ? origin - (1.2e-7f * __builtin_fabsf(origin) + 1e-20f) : origin);
        s->inverse[k] = vf_set1(inverse);
        s->near_plane[k] = negative ? 3 + k : k;
        s->far_plane[k] = negative ? k : 3 + k;
    }
    float ax = __builtin_fabsf(ray->direction[0]), ay = __builtin_fabsf(ray->direction[1]), az = __builtin_fabsf(ray->direction[2]);
    s->kz = ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
    s->kx = s->kz == 2 ? 0 : s->kz + 1;
    s->ky = s->kx == 2 ? 0 : s->kx + 1;
    float scale = 1.0f / ray->direction[s->kz];
    s->sx = vf_set1(ray->direction[s->kx] * scale);
    s->sy = vf_set1(ray->direction[s->ky] * scale);
    s->sz = vf_set1(scale);
}

/* The edge functions where they are zero, again: products of two floats are exact in double. */
static void repair_edges(vf ax, vf ay, vf bx, vf by, vf cx, vf cy, vf* u, vf* v, vf* w)
{
    for (int i = 0; i < VW; i++) {
        if ((*u)[i] != 0.0f && (*v)[i] != 0.0f && (*w)[i] != 0.0f) continue;
        (*u)[i] = (float)((double)cx[i] * (double)by[i] - (double)cy[i] * (double)bx[i]);
        (*v)[i] = (float)((double)ax[i] * (double)cy[i] - (double)ay[i] * (double)cx[i]);
        (*w)[i] = (float)((double)bx[i] * (double)ay[i] - (double)by[i] * (double)ax[i]);
    }
}

/* Which of the block's triangles the ray meets beyond low and up to high, which is included so that ties can be told apart; distance and
 * weights are valid there. */
VINL vm meet_block(const es_bvh_block* block, const ray_setup* s, vf low, vf high, vf* t, vf* v, vf* w)
{
    const vf zero = vf_zero();
    vf az = vf_load(block->corner[0][s->kz]) - s->origin[s->kz], bz = vf_load(block->corner[1][s->kz]) - s->origin[s->kz], cz = vf_load(block->corner[2][s->kz]) - s->origin[s->kz];
    vf ax = (vf_load(block->corner[0][s->kx]) - s->origin[s->kx]) - s->sx * az, ay = (vf_load(block->corner[0][s->ky]) - s->origin[s->ky]) - s->sy * az;
    vf bx = (vf_load(block->corner[1][s->kx]) - s->origin[s->kx]) - s->sx * bz, by = (vf_load(block->corner[1][s->ky]) - s->origin[s->ky]) - s->sy * bz;
    vf cx = (vf_load(block->corner[2][s->kx]) - s->origin[s->kx]) - s->sx * cz, cy = (vf_load(block->corner[2][s->ky]) - s->origin[s->ky]) - s->sy * cz;
    vf eu = cx * by - cy * bx, ev = ax * cy - ay * cx, ew = bx * ay - by * ax;
    vm used = ~vi_eq(vi_load(block->primitive), vi_set1(-1));
    vm zeros = used & (vm_eq(eu, zero) | vm_eq(ev, zero) | vm_eq(ew, zero));
    if (vm_any(zeros)) repair_edges(ax, ay, bx, by, cx, cy, &eu, &ev, &ew);
    vm inside = (vm_ge(eu, zero) & vm_ge(ev, zero) & vm_ge(ew, zero)) | (vm_le(eu, zero) & vm_le(ev, zero) & vm_le(ew, zero));
    vf det = eu + ev + ew;
    vm hit = used & inside & vm_ne(det, zero);
    if (!vm_any(hit)) return hit;
    vf inverse = vf_set1(1.0f) / vf_select(hit, det, vf_set1(1.0f));
    vf scaled = vf_and(hit, (eu * az + ev * bz + ew * cz) * s->sz);
    *t = scaled * inverse;
    *v = vf_and(hit, ev) * inverse;
    *w = vf_and(hit, ew) * inverse;
    return hit & vm_gt(*t, low) & vm_le(*t, high);
}

typedef struct entry { uint32_t child; float distance; } entry;

/* Children the ray meets, as bits; their distances. */
VINL uint32_t meet_node(const es_bvh_node* node, const ray_setup* s, vf low, float nearest, vf* distance)
{
    vf nx = (vf_load(node->plane[s->near_plane[0]]) - s->origin[0]) * s->inverse[0], fx = (vf_load(node->plane[s->far_plane[0]]) - s->far_origin[0]) * s->inverse[0];
    vf ny = (vf_load(node->plane[s->near_plane[1]]) - s->origin[1]) * s->inverse[1], fy = (vf_load(node->plane[s->far_plane[1]]) - s->far_origin[1]) * s->inverse[1];
    vf nz = (vf_load(node->plane[s->near_plane[2]]) - s->origin[2]) * s->inverse[2], fz = (vf_load(node->plane[s->far_plane[2]]) - s->far_origin[2]) * s->inverse[2];
    vf begin = vf_max(vf_max(nx, ny), vf_max(nz, low));
    vf end = vf_min(vf_min(fx, fy), vf_min(fz, vf_set1(nearest))) * vf_set1(FAR_MARGIN);
    *distance = begin;
    return vm_bits(vm_le(begin, end));
}

/* Pushes the children in `bits`, the nearest on top, which it returns popped. */
VINL entry push(const uint32_t* child, uint32_t bits, vf distance, entry* stack, uint32_t* size)
{
    float distances[VW];
    vf_store(distances, distance);
    uint32_t first = (uint32_t)__builtin_ctz(bits);
    entry near = {child[first], distances[first]};
    bits &= bits - 1;
    if (!bits) return near;
    uint32_t second = (uint32_t)__builtin_ctz(bits), base = *size, top = base;
    bits &= bits - 1;
    entry other = {child[second], distances[second]};
    bool swap = other.distance < near.distance;
    stack[top++] = swap ? near : other;
    near = swap ? other : near;
    if (!bits) {
        *size = top;
        return near;
    }
    stack[top++] = near;
    /* few, so they are sorted by insertion */
    while (bits) {
        uint32_t i = (uint32_t)__builtin_ctz(bits), place = top++;
        bits &= bits - 1;
        entry e = {child[i], distances[i]};
        for (; place > base && stack[place - 1].distance < e.distance; place--) stack[place] = stack[place - 1];
        stack[place] = e;
    }
    *size = top - 1;
    return stack[top - 1];
}

/* The nearest of the block's hits, if it is nearer than what there is; the block's box begins at `begin`. passed: of hits at its distance only those of
 * later primitives count; a constant NULL at calls where speed matters. */
VINL void take_nearest(const es_bvh_block* block, const ray_setup* s, vf low, float begin, const es_hit* passed, float* nearest, es_hit* hit)
{
    vf t = vf_zero(), v = vf_zero(), w = vf_zero();
    uint32_t bits = vm_bits(meet_block(block, s, low, vf_set1(*nearest), &t, &v, &w));
    if (!bits) return;
    vf key = vf_max(t, vf_set1(begin * NEAR_MARGIN));
    for (; bits; bits &= bits - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(bits);
        if (passed && t[i] == passed->t && block->primitive[i] <= passed->primitive) continue;
        /* the ray's own end is excluded, a hit at the nearest so far is not */
        if (key[i] < *nearest || (key[i] == *nearest && hit->primitive != ES_NO_PRIMITIVE && block->primitive[i] < hit->primitive)) {
            *nearest = key[i];
            *hit = (es_hit){t[i], v[i], w[i], block->primitive[i]};
        }
    }
}

/* ---- single rays, some at a time --------------------------------------------------------------------------------------------- */

/* A ray on its way. Several take turns, a node or a block each, so that what one needs next is fetched while others go on. */
typedef struct walk {
    ray_setup s;
    entry at;
    uint32_t size, ray;
    float nearest;
    vf low;
    entry stack[ES_BVH_STACK];
} walk;
enum { WALKS = 6, FEW_WALKS = 2, FEW_NODES = 16384 }; /* a small hierarchy is in the near caches anyway */

static inline void fetch(const es_bvh* bvh, uint32_t child)
{
    const char* p = child & ES_BVH_BLOCK ? (const char*)&bvh->blocks[child & ~ES_BVH_BLOCK] : (const char*)&bvh->nodes[child];
    for (int i = 0; i < 5; i++) __builtin_prefetch(p + 64 * i);
}

static inline void start(walk* w, const es_ray* ray, uint32_t index)
{
    prepare(ray, &w->s);
    w->at = (entry){0, ray->min};
    w->size = 0;
    w->ray = index;
    w->nearest = ray->max;
    w->low = vf_set1(ray->min);
}

static inline void move_to(walk* to, const walk* from)
{
    to->s = from->s;
    to->at = from->at;
    to->size = from->size;
    to->ray = from->ray;
    to->nearest = from->nearest;
    to->low = from->low;
    memcpy(to->stack, from->stack, from->size * sizeof from->stack[0]);
}

/* One node or block; false when there are no more. */
static inline bool step_closest(const es_bvh* bvh, walk* w, es_hit* hit)
{
    if (w->at.child & ES_BVH_BLOCK) {
        take_nearest(&bvh->blocks[w->at.child & ~ES_BVH_BLOCK], &w->s, w->low, w->at.distance, NULL, &w->nearest, hit);
    } else {
        const es_bvh_node* node = &bvh->nodes[w->at.child];
        vf distance;
        uint32_t bits = meet_node(node, &w->s, w->low, w->nearest, &distance);
        if (bits) {
            w->at = push(node->child, bits, distance, w->stack, &w->size);
            fetch(bvh, w->at.child);
            return true;
        }
    }
    do {
        if (!w->size) return false;
        w->size--;
    } while (w->stack[w->size].distance > w->nearest * FAR_MARGIN);
    w->at = w->stack[w->size];
    fetch(bvh, w->at.child);
    return true;
}

static inline bool step_any(const es_bvh* bvh, walk* w, uint8_t* blocked)
{
    if (w->at.child & ES_BVH_BLOCK) {
        vf t = vf_zero(), v = vf_zero(), u = vf_zero(), high = vf_set1(w->nearest);
        vm hit = meet_block(&bvh->blocks[w->at.child & ~ES_BVH_BLOCK], &w->s, w->low, high, &t, &u, &v);
        if (vm_any(hit & vm_lt(t, high))) {
            *blocked = 1;
            return false;
        }
    } else {
        vf distance;
        uint32_t bits = meet_node(&bvh->nodes[w->at.child], &w->s, w->low, w->nearest, &distance);
        const uint32_t* child = bvh->nodes[w->at.child].child;
        for (; bits; bits &= bits - 1) w->stack[w->size++].child = child[__builtin_ctz(bits)];
    }
    if (!w->size) return false;
    w->at.child = w->stack[--w->size].child;
    fetch(bvh, w->at.child);
    return true;
}

/* nearest: into hits, blocked is NULL; otherwise the other way round */
VINL void by_turns(const es_bvh* bvh, bool nearest, const es_ray* rays, uint32_t count, es_hit* hits, uint8_t* blocked)
{
    walk walks[WALKS];
    const uint32_t most_walks = bvh->node_count < FEW_NODES ? FEW_WALKS : WALKS;
    uint32_t next = 0, under_way = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (nearest)
            hits[i] = (es_hit){rays[i].max, 0.0f, 0.0f, ES_NO_PRIMITIVE};
        else
            blocked[i] = 0;
    }
    for (; next < count && under_way < most_walks; next++) start(&walks[under_way++], &rays[next], next);
    while (under_way)
        for (uint32_t i = 0; i < under_way; i++) {
            walk* w = &walks[i];
            if (nearest ? step_closest(bvh, w, &hits[w->ray]) : step_any(bvh, w, &blocked[w->ray])) continue;
            if (next < count) {
                start(w, &rays[next], next);
                next++;
            } else if (i < --under_way) {
                move_to(w, &walks[under_way]);
                i--;
            }
        }
}

/* ---- eight rays of one octant ----------------------------------------------------------------------------------------------------- */

typedef struct ray_packet {
    ray_setup rays[VW];
    vf origin[3], far_origin[3], inverse[3], low; /* a ray per lane */
    ray_setup all;                                /* origins of the intervals' ends that meet the planes first, last */
    vf inverse_low[3], inverse_high[3];           /* the same in all lanes */
    float lowest;
} ray_packet;

static float least(vf a)
{
    float m = a[0];
    for (int i = 1; i < VW; i++) m = a[i] < m ? a[i] : m;
    return m;
}
static float most(vf a)
{
    float m = a[0];
    for (int i = 1; i < VW; i++) m = a[i] > m ? a[i] : m;
    return m;
}

/* False when the rays are not of one octant, or some are not finite. */
static bool gather(ray_packet* p, const es_ray* rays)
{
    for (int i = 0; i < VW; i++) prepare(&rays[i], &p->rays[i]);
    for (int i = 0; i < VW; i++) {
        const ray_setup* s = &p->rays[i];
        for (int k = 0; k < 3; k++) {
            if (s->near_plane[k] != p->rays[0].near_plane[k]) return false;
            float finite = rays[i].origin[k] + rays[i].direction[k];
            if (!(finite - finite == 0.0f)) return false;
            p->origin[k][i] = s->origin[k][0];
            p->far_origin[k][i] = s->far_origin[k][0];
            p->inverse[k][i] = s->inverse[k][0];
        }
        p->low[i] = rays[i].min;
    }
    for (int k = 0; k < 3; k++) {
        int near = p->rays[0].near_plane[k];
        bool negative = near != k;
        p->all.near_plane[k] = near;
        p->all.far_plane[k] = p->rays[0].far_plane[k];
        p->all.origin[k] = vf_set1(negative ? least(p->origin[k]) : most(p->origin[k]));
        p->all.far_origin[k] = vf_set1(negative ? most(p->far_origin[k]) : least(p->far_origin[k]));
        p->inverse_low[k] = vf_set1(least(p->inverse[k]));
        p->inverse_high[k] = vf_set1(most(p->inverse[k]));
    }
    p->lowest = least(p->low);
    return true;
}

/* Children that some ray may meet; distances before which none does. */
VINL uint32_t meet_node_together(const es_bvh_node* node, const ray_packet* p, float farthest, vf* distance)
{
    vf begin = vf_set1(p->lowest), end = vf_set1(farthest);
    for (int k = 0; k < 3; k++) {
        vf near = vf_load(node->plane[p->all.near_plane[k]]) - p->all.origin[k], far = vf_load(node->plane[p->all.far_plane[k]]) - p->all.far_origin[k];
        begin = vf_max(begin, vf_min(near * p->inverse_low[k], near * p->inverse_high[k]));
        end = vf_min(end, vf_max(far * p->inverse_low[k], far * p->inverse_high[k]));
    }
    *distance = begin;
    return vm_bits(vm_le(begin, end * vf_set1(FAR_MARGIN)));
}

/* Rays that meet the block's box before `nearest`, each as it would alone. */
VINL uint32_t meet_box(const es_bvh_box* box, const ray_packet* p, vf nearest, vf* distance)
{
    vf near[3], far[3];
    for (int k = 0; k < 3; k++) {
        bool negative = p->all.near_plane[k] != k;
        near[k] = (vf_set1(negative ? box->max[k] : box->min[k]) - p->origin[k]) * p->inverse[k];
        far[k] = (vf_set1(negative ? box->min[k] : box->max[k]) - p->far_origin[k]) * p->inverse[k];
    }
    vf begin = vf_max(vf_max(near[0], near[1]), vf_max(near[2], p->low));
    vf end = vf_min(vf_min(far[0], far[1]), vf_min(far[2], nearest)) * vf_set1(FAR_MARGIN);
    *distance = begin;
    return vm_bits(vm_le(begin, end));
}

static void closest_together(const es_bvh* bvh, const es_ray* rays, es_hit* hits)
{
    ray_packet p;
    if (!gather(&p, rays)) {
        by_turns(bvh, true, rays, VW, hits, NULL);
        return;
    }
    float nearest[VW], farthest = rays[0].max;
    for (int i = 0; i < VW; i++) {
        hits[i] = (es_hit){rays[i].max, 0.0f, 0.0f, ES_NO_PRIMITIVE};
        nearest[i] = rays[i].max;
        farthest = nearest[i] > farthest ? nearest[i] : farthest;
    }
    entry stack[ES_BVH_STACK], at = {0, p.lowest};
    uint32_t size = 0;
    for (;;) {
        if (at.child & ES_BVH_BLOCK) {
            uint32_t block = at.child & ~ES_BVH_BLOCK;
            vf begin;
            uint32_t bits = meet_box(&bvh->boxes[block], &p, vf_load(nearest), &begin);
            if (bits) {
                for (; bits; bits &= bits - 1) {
                    int i = __builtin_ctz(bits);
                    take_nearest(&bvh->blocks[block], &p.rays[i], vf_set1(rays[i].min), begin[i], NULL, &nearest[i], &hits[i]);
                }
                farthest = most(vf_load(nearest));
            }
        } else {
            const es_bvh_node* node = &bvh->nodes[at.child];
            vf distance;
            uint32_t bits = meet_node_together(node, &p, farthest, &distance);
            if (bits) {
                at = push(node->child, bits, distance, stack, &size);
                continue;
            }
        }
        do {
            if (!size) return;
            size--;
        } while (stack[size].distance > farthest * FAR_MARGIN);
        at = stack[size];
    }
}

static void any_together(const es_bvh* bvh, const es_ray* rays, uint8_t* blocked)
{
    ray_packet p;
    if (!gather(&p, rays)) {
        by_turns(bvh, false, rays, VW, NULL, blocked);
        return;
    }
    vf nearest;
    for (int i = 0; i < VW; i++) nearest[i] = rays[i].max;
    float farthest = most(nearest);
    uint32_t stack[ES_BVH_STACK], size = 0, at = 0, open = 0xffu;
    for (;;) {
        if (at & ES_BVH_BLOCK) {
            uint32_t block = at & ~ES_BVH_BLOCK;
            vf begin;
            uint32_t bits = meet_box(&bvh->boxes[block], &p, nearest, &begin) & open;
            for (; bits; bits &= bits - 1) {
                int i = __builtin_ctz(bits);
                vf t = vf_zero(), v = vf_zero(), w = vf_zero(), high = vf_set1(rays[i].max);
                vm hit = meet_block(&bvh->blocks[block], &p.rays[i], vf_set1(rays[i].min), high, &t, &v, &w);
                if (vm_any(hit & vm_lt(t, high))) open &= ~(1u << i);
            }
        } else {
            vf distance;
            uint32_t bits = meet_node_together(&bvh->nodes[at], &p, farthest, &distance);
            const uint32_t* child = bvh->nodes[at].child;
            for (; bits; bits &= bits - 1) stack[size++] = child[__builtin_ctz(bits)];
        }
        if (!size || !open) break;
        at = stack[--size];
    }
    for (int i = 0; i < VW; i++) blocked[i] = !(open >> i & 1);
}

void ES_KERNEL(es_gi_trace_closest)(const es_bvh* bvh, bool coherent, const es_ray* rays, uint32_t count, es_hit* hits)
{
    uint32_t i = 0;
    for (; coherent && i + VW <= count; i += VW) closest_together(bvh, rays + i, hits + i);
    if (i < count) by_turns(bvh, true, rays + i, count - i, hits + i, NULL);
}

void ES_KERNEL(es_gi_trace_any)(const es_bvh* bvh, bool coherent, const es_ray* rays, uint32_t count, uint8_t* blocked)
{
    uint32_t i = 0;
    for (; coherent && i + VW <= count; i += VW) any_together(bvh, rays + i, blocked + i);
    if (i < count) by_turns(bvh, false, rays + i, count - i, NULL, blocked + i);
}

/* Triangles in one plane are hit at one distance: going on beyond that distance would pass by those not looked at yet. So the ray goes on from the
 * float before it, and what has been passed is told by its primitive. */
void ES_KERNEL(es_gi_trace_beyond)(const es_bvh* bvh, const es_ray* ray, const es_hit* passed, es_hit* hit)
{
    ray_setup s;
    prepare(ray, &s);
    const vf low = vf_from_bits(vi_from_bits(vf_set1(passed->t)) - vi_set1(1));
    float nearest = ray->max;
    *hit = (es_hit){ray->max, 0.0f, 0.0f, ES_NO_PRIMITIVE};
    entry stack[ES_BVH_STACK], at = {0, low[0]};
    uint32_t size = 0;
    for (;;) {
        if (at.child & ES_BVH_BLOCK) {
            take_nearest(&bvh->blocks[at.child & ~ES_BVH_BLOCK], &s, low, at.distance, passed, &nearest, hit);
        } else {
            const es_bvh_node* node = &bvh->nodes[at.child];
            vf distance;
            uint32_t bits = meet_node(node, &s, low, nearest, &distance);
            if (bits) {
                at = push(node->child, bits, distance, stack, &size);
                continue;
            }
        }
        do {
            if (!size) return;
            size--;
        } while (stack[size].distance > nearest * FAR_MARGIN);
        at = stack[size];
    }
}
