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
 */
#include "gi/kernel_table.h"
#include "gi/reference/bvh_nodes.h"
#include "platform/simd.h"

/* 1 + 2 gamma(3), rounded up */
#define FAR_MARGIN 1.00000072f
/* stands for the inverse of a direction component of zero: finite, so that a plane through the origin gives 0
 * and not NaN, and so small that the distance to any plane stays finite */
#define STEEP 1e28f

typedef struct ray_setup {
    vf origin[3], far_origin[3], inverse[3];
    int near_plane[3], far_plane[3];  /* index of the plane that is met first, last */
    int kx, ky, kz;                   /* kz: axis of the largest direction component */
    vf sx, sy, sz;                    /* shear and scale */
} ray_setup;

static inline ray_setup prepare(const es_ray* ray)
{
    ray_setup s;
    for (int k = 0; k < 3; k++) {
        float d = ray->direction[k];
        bool steep = d <= 1e-28f && d >= -1e-28f, negative = d < 0.0f && !steep;
        float origin = ray->origin[k], inverse = steep ? STEEP : 1.0f / d;
        s.origin[k] = vf_set1(origin);
        /* a ray within the plane of a box's far side would leave it at 0 · STEEP */
        s.far_origin[k] = vf_set1(steep ? origin - (1.2e-7f * __builtin_fabsf(origin) + 1e-20f) : origin);
        s.inverse[k] = vf_set1(inverse);
        s.near_plane[k] = negative ? 3 + k : k;
        s.far_plane[k] = negative ? k : 3 + k;
    }
    float ax = __builtin_fabsf(ray->direction[0]), ay = __builtin_fabsf(ray->direction[1]), az = __builtin_fabsf(ray->direction[2]);
    s.kz = ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
    s.kx = s.kz == 2 ? 0 : s.kz + 1;
    s.ky = s.kx == 2 ? 0 : s.kx + 1;
    float scale = 1.0f / ray->direction[s.kz];
    s.sx = vf_set1(ray->direction[s.kx] * scale);
    s.sy = vf_set1(ray->direction[s.ky] * scale);
    s.sz = vf_set1(scale);
    return s;
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

/* Which of the block's triangles the ray meets between low and high, ends excluded (a hit at high counts for `ties`); distance and weights
 * are valid there. */
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

static void closest(const es_bvh* bvh, const es_ray* ray, es_hit* hit)
{
    *hit = (es_hit){ray->max, 0.0f, 0.0f, ES_NO_PRIMITIVE};
    const ray_setup s = prepare(ray);
    const vf low = vf_set1(ray->min);
    /* the ray's own end is excluded, a hit at the nearest so far is not */
    entry stack[ES_BVH_STACK];
    uint32_t size = 0, at = 0;
    float nearest = ray->max;
    for (;;) {
        if (!(at & ES_BVH_BLOCK)) {
            float distances[VW];
            vf distance;
            uint32_t bits = meet_node(&bvh->nodes[at], &s, low, nearest, &distance);
            if (bits) {
                const uint32_t* child = bvh->nodes[at].child;
                uint32_t first = (uint32_t)__builtin_ctz(bits);
                bits &= bits - 1;
                if (!bits) {
                    at = child[first];
                    continue;
                }
                /* all go on the stack, the nearest on top: few, so they are sorted by insertion */
                vf_store(distances, distance);
                uint32_t base = size;
                stack[size++] = (entry){child[first], distances[first]};
                while (bits) {
                    uint32_t i = (uint32_t)__builtin_ctz(bits), place = size++;
                    bits &= bits - 1;
                    entry e = {child[i], distances[i]};
                    for (; place > base && stack[place - 1].distance < e.distance; place--) stack[place] = stack[place - 1];
                    stack[place] = e;
                }
                at = stack[--size].child;
                continue;
            }
        } else {
            const es_bvh_block* block = &bvh->blocks[at & ~ES_BVH_BLOCK];
            vf t = vf_zero(), v = vf_zero(), w = vf_zero();
            uint32_t bits = vm_bits(meet_block(block, &s, low, vf_set1(nearest), &t, &v, &w));
            while (bits) {
                uint32_t i = (uint32_t)__builtin_ctz(bits);
                bits &= bits - 1;
                if (t[i] < nearest || (t[i] == nearest && hit->primitive != ES_NO_PRIMITIVE && block->primitive[i] < hit->primitive)) {
                    nearest = t[i];
                    *hit = (es_hit){t[i], v[i], w[i], block->primitive[i]};
                }
            }
        }
        do {
            if (!size) return;
            size--;
        } while (stack[size].distance > nearest * FAR_MARGIN);
        at = stack[size].child;
    }
}

static bool any(const es_bvh* bvh, const es_ray* ray)
{
    const ray_setup s = prepare(ray);
    const vf low = vf_set1(ray->min), high = vf_set1(ray->max);
    uint32_t stack[ES_BVH_STACK], size = 0, at = 0;
    for (;;) {
        if (!(at & ES_BVH_BLOCK)) {
            vf distance;
            uint32_t bits = meet_node(&bvh->nodes[at], &s, low, ray->max, &distance);
            const uint32_t* child = bvh->nodes[at].child;
            for (; bits; bits &= bits - 1) stack[size++] = child[__builtin_ctz(bits)];
        } else {
            vf t = vf_zero(), v = vf_zero(), w = vf_zero();
            vm hit = meet_block(&bvh->blocks[at & ~ES_BVH_BLOCK], &s, low, high, &t, &v, &w);
            if (vm_any(hit & vm_lt(t, high))) return true;
        }
        if (!size) return false;
        at = stack[--size];
    }
}

void ES_KERNEL(es_gi_trace_closest)(const es_bvh* bvh, bool coherent, const es_ray* rays, uint32_t count, es_hit* hits)
{
    for (uint32_t i = 0; i < count; i++) closest(bvh, &rays[i], &hits[i]);
}

void ES_KERNEL(es_gi_trace_any)(const es_bvh* bvh, bool coherent, const es_ray* rays, uint32_t count, uint8_t* blocked)
{
    for (uint32_t i = 0; i < count; i++) blocked[i] = any(bvh, &rays[i]);
}
