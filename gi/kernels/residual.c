/* Light that pixels gather from the pyramid of patches around them (gi/screen/residual.h), eight pixels together: all of them go through the same nodes, each
 * with those that its own bounds and thresholds ask for, so that none depends on its neighbours. A node is the same for all eight; of level 0 it is made when
 * it is met, which is rarer than once a pixel. */
#include <math.h>
#include <string.h>

#include "gi/kernel_table.h"
#include "gi/kernels/residual_patch_simd.h"
#include "gi/kernels/surface_simd.h"
#include "gi/screen/residual.h"

/* Solid angle, without cosines, above which a node across an edge is opened: within about three of its widths. At 0.25 three steps in bunny-box bring 68 % of the energy
 * back in place of 76; at 0.06, which takes about twice the time, 79. */
#define CLOSE 0.12f
/* How far parts of a node close by must rise above a receiver for the node to be opened, in its widths. */
#define RISE 0.1f
#define HALF_PER_PI 0.159154943f /* 1 / 2 pi */

/* Eight pixels. */
typedef struct receivers {
    vm wanted;
    vf x, y, z, nx, ny, nz;
    vf irradiance[3], lobe[3];
    vm lobed;
    vf ox, oy, oz;                 /* unit, to the eye */
    es_surface_v surface;
    uint64_t samples;
} receivers;

/* Rows of the result that are gone through together, and eights of each. */
enum { TILE_ROWS = 4, TILE_EIGHTS = 4, TILE_GROUPS = TILE_ROWS * TILE_EIGHTS };

/* Neighbouring receivers: where they are, and pixels of a layer that may show what they are lit by. */
typedef struct tile {
    receivers* groups;
    uint32_t count;
    float low[3], high[3];
    int32_t left, right, top, bottom;
} tile;

/* Levels below 0 are parts of a pixel's patch, which is flat. */
enum { FINEST = -2 };
typedef struct place { int32_t level; uint32_t x, y, lanes; } place;

/* Where the layer shows what is within `reach` of the receivers: their places there, and a width of reach · slant · focal length / (distance - reach), slant
 * being the length of a ray at depth 1. Nearer than the reach, and beside or behind a camera that is not the receivers' own: everywhere. */
static void find_reach(const es_residual_layer* layer, float reach, const receivers* r, tile* t)
{
    const es_pixel_rays* rays = &layer->rays;
    const vf width = vf_set1((float)(layer->gbuffer->width - 1)), height = vf_set1((float)(layer->gbuffer->height - 1)), zero = vf_zero();
    const float *across = rays->orthographic ? rays->base_dx : rays->dir_dx, *down = rays->orthographic ? rays->base_dy : rays->dir_dy;
    const float across2 = across[0] * across[0] + across[1] * across[1] + across[2] * across[2], down2 = down[0] * down[0] + down[1] * down[1] + down[2] * down[2];
    /* along the view axis, which is at right angles to both */
    es_vec3 axis = es_v3_cross(es_v3(across[0], across[1], across[2]), es_v3(down[0], down[1], down[2]));
    const float along = axis.x * rays->dir[0] + axis.y * rays->dir[1] + axis.z * rays->dir[2];
    axis = es_v3_scale(axis, 1.0f / (along > 0.0f ? es_sqrt(es_v3_dot(axis, axis)) : -es_sqrt(es_v3_dot(axis, axis))));
    const vf px = r->x - vf_set1(rays->base[0]), py = r->y - vf_set1(rays->base[1]), pz = r->z - vf_set1(rays->base[2]);
    vm within = vi_zero();
    vf scale = vf_set1(1.0f), spread = vf_set1(reach);
    if (!rays->orthographic) {
        const vf depth = px * vf_set1(axis.x) + py * vf_set1(axis.y) + pz * vf_set1(axis.z);
        within = ~vm_gt(depth, vf_set1(reach * 1.01f));
        const vf rest = vf_select(within, vf_set1(1.0f), depth - vf_set1(reach));
        scale = vf_set1(1.0f) / vf_select(within, vf_set1(1.0f), depth);
        spread = vf_set1(reach) / rest * (vf_sqrt(px * px + py * py + pz * pz) * scale);
    }
    /* p = base + depth (dir + X across + Y down) */
    vf u = zero, v = zero;
    const vf p[3] = {px, py, pz};
    for (int k = 0; k < 3; k++) {
        const vf q = rays->orthographic ? p[k] : p[k] * scale - vf_set1(rays->dir[k]);
        u = u + q * vf_set1(across[k] / across2);
        v = v + q * vf_set1(down[k] / down2);
    }
    const vf du = spread * vf_set1(1.0f / es_sqrt(across2)), dv = spread * vf_set1(1.0f / es_sqrt(down2)), one = vf_set1(1.0f);
    /* clamped to one beyond the image, so that what is outside of it is empty */
    const vi left = vi_truncate(vf_select(within, zero, vf_clamp(u - du, vf_set1(-1.0f), width + one))), right = vi_truncate(vf_select(within, width, vf_clamp(u + du + one, vf_set1(-1.0f), width)));
    const vi top = vi_truncate(vf_select(within, zero, vf_clamp(v - dv, vf_set1(-1.0f), height + one))), bottom = vi_truncate(vf_select(within, height, vf_clamp(v + dv + one, vf_set1(-1.0f), height)));
    for (uint32_t bits = vm_bits(r->wanted); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        if (left[i] > right[i] || top[i] > bottom[i]) continue;
        if (left[i] < t->left) t->left = left[i];
        if (right[i] > t->right) t->right = right[i];
        if (top[i] < t->top) t->top = top[i];
        if (bottom[i] > t->bottom) t->bottom = bottom[i];
    }
}

static void load_node(const es_residual_layer* layer, float pixel_area, const place* at, es_residual_node* node, float sent[4])
{
    const es_residual_pyramid* p = layer->pyramid;
    if (at->level > 0) {
        const size_t i = (size_t)at->y * p->width[at->level] + at->x;
        *node = p->nodes[at->level][i];
        memcpy(sent, p->sent[at->level] + 4 * i, 4 * sizeof *sent);
        return;
    }
    const es_gbuffer* g = layer->gbuffer;
    const es_pixel_rays* rays = &layer->rays;
    const uint32_t parts = (uint32_t)-at->level, x = at->x >> parts, y = at->y >> parts;
    const size_t i = (size_t)y * g->stride + x;
    float depth = g->depth[i], column = (float)x, row = (float)y;
    if (parts && depth > 0.0f) {
        const float size = 1.0f / (float)(1u << parts);
        const es_vec3 n = es_unpack_normal(g->normal[i]), middle = es_pixel_rays_direction(rays, column, row);
        column = ((float)at->x + 0.5f) * size - 0.5f;
        row = ((float)at->y + 0.5f) * size - 0.5f;
        pixel_area = pixel_area * size * size;
        /* on the pixel's plane, which at most doubles or halves the distance */
        const es_vec3 d = es_pixel_rays_direction(rays, column, row);
        const float along = es_v3_dot(n, d);
        if (rays->orthographic) {
            const float dx = column - (float)x, dy = row - (float)y;
            const es_vec3 shift = es_v3(dx * rays->base_dx[0] + dy * rays->base_dy[0], dx * rays->base_dx[1] + dy * rays->base_dy[1], dx * rays->base_dx[2] + dy * rays->base_dy[2]);
            depth = depth - es_clampf(es_v3_dot(n, shift) / (layer->back ? es_maxf(along, 1e-3f) : es_minf(along, -1e-3f)), -0.5f * depth, 0.5f * depth);
        } else {
            depth = depth * es_clampf(es_v3_dot(n, middle) / (layer->back ? es_maxf(along, 1e-6f) : es_minf(along, -1e-6f)), 0.5f, 2.0f);
        }
    }
    const es_patch_v v = es_patch_of_pixel_v(rays, pixel_area, layer->back, vf_set1(column), vf_set1(row), vf_set1(depth), vi_set1((int32_t)g->normal[i]), vm_gt(vf_set1(depth), vf_zero()));
    *node = (es_residual_node){{v.x[0], v.y[0], v.z[0]}, v.area[0], {v.nx[0], v.ny[0], v.nz[0]}, v.radius[0]};
    for (int k = 0; k < 3; k++) sent[k] = node->area > 0.0f ? layer->radiance[k][i] * node->area : 0.0f;
}

/* What the lobe reflects of light from (wx, wy, wz), unit, and what passes to the diffuse part. */
VINL void add_light(receivers* r, bool lobes, vm lanes, vf weight, vf wx, vf wy, vf wz, const float sent[4])
{
    vf pass = vf_set1(1.0f), lobe[3];
    const bool lobed = lobes && vm_any(lanes & r->lobed);
    if (lobed) {
        es_surface_parts_v(&r->surface, r->nx, r->ny, r->nz, wx, wy, wz, r->ox, r->oy, r->oz, &pass, lobe);
        pass = vf_select(r->lobed, pass, vf_set1(1.0f));
    }
    for (int k = 0; k < 3; k++) {
        const vf light = weight * vf_set1(sent[k]);
        r->irradiance[k] = r->irradiance[k] + pass * light;
        if (lobed) r->lobe[k] = r->lobe[k] + vf_and(r->lobed, lobe[k] * light);
    }
}

/* A node and receivers. */
typedef struct pair {
    vf wx, wy, wz, d2;             /* from receiver to node */
    vf per;                        /* 1 / (d² + A / 2 pi) */
    vf height, emitted;            /* both distances times cosines, the second at least 0 */
    vf geometry, angle;            /* G', A G' */
    vm within;                     /* some of the node may be within the bound's reach: none of what is further away has a G above the bound */
} pair;

VINL pair meet(const es_residual_node* node, const receivers* r, float reach)
{
    pair p;
    const float limit = reach + es_absf(node->radius);
    p.wx = vf_set1(node->position[0]) - r->x;
    p.wy = vf_set1(node->position[1]) - r->y;
    p.wz = vf_set1(node->position[2]) - r->z;
    p.d2 = p.wx * p.wx + p.wy * p.wy + p.wz * p.wz;
    p.within = vm_lt(p.d2, vf_set1(limit * limit));
    p.per = vf_set1(1.0f) / (p.d2 + vf_set1(node->area * HALF_PER_PI));
    p.height = r->nx * p.wx + r->ny * p.wy + r->nz * p.wz;
    p.emitted = vf_max(vf_neg(vf_set1(node->normal[0]) * p.wx + vf_set1(node->normal[1]) * p.wy + vf_set1(node->normal[2]) * p.wz), vf_zero());
    p.geometry = (vf_max(p.height, vf_zero()) * p.per) * (p.emitted * p.per);
    p.angle = p.geometry * vf_set1(node->area);
    return p;
}

/* Receivers that want its parts in place of the node. */
VINL vm opened_by(const es_residual_job* job, const es_residual_node* node, const receivers* r, const pair* p, vm lanes)
{
    vm opened = vm_gt(p->angle, vf_set1(job->solid_angle));
    const vm close = lanes & vm_gt(p->per * vf_set1(node->area), vf_set1(CLOSE));
    if (node->radius < 0.0f) {
        /* the mean of two surfaces may look flat from either of them */
        opened = opened | vm_gt(p->angle, vf_set1(job->discontinuity)) | close;
    } else if (vm_any(close)) {
        /* close to the line where two surfaces meet each sees the other's middle at a slant, but not what is next to it: parts of the node rise above the receiver
         * by as much as its height and the sine between the two planes say */
        const vf cosine = r->nx * vf_set1(node->normal[0]) + r->ny * vf_set1(node->normal[1]) + r->nz * vf_set1(node->normal[2]), width = vf_sqrt(vf_set1(node->area));
        const vf rise = p->height + width * vf_sqrt(vf_max(vf_set1(1.0f) - cosine * cosine, vf_zero()));
        opened = opened | (close & vm_gt(p->emitted, vf_zero()) & vm_gt(rise, vf_set1(RISE) * width));
    }
    return opened & lanes;
}

/* What receivers get from a node and its parts. */
static void gather_node(const es_residual_job* job, const es_residual_layer* layer, float pixel_area, float reach, place from, receivers* r, bool lobes)
{
    const es_residual_pyramid* pyramid = layer->pyramid;
    place stack[4 * (ES_RESIDUAL_LEVELS - FINEST)];
    uint32_t depth = 0;
    stack[depth++] = from;
    while (depth) {
        const place at = stack[--depth];
        es_residual_node node;
        float sent[4];
        load_node(layer, pixel_area, &at, &node, sent);
        if (!(node.area > 0.0f)) continue;
        const pair p = meet(&node, r, reach);
        const vm lanes = p.within & vm_ne(vf_from_int(vi_set1((int32_t)at.lanes) & (vi_set1(1) << vi_iota())), vf_zero());
        const uint32_t some = vm_bits(lanes);
        if (!some) continue;
        r->samples += (uint64_t)__builtin_popcount(some);
        const vm opened = at.level > FINEST ? opened_by(job, &node, r, &p, lanes) : vi_zero(), taken = lanes & ~opened & vm_gt(p.geometry, vf_set1(job->bound));
        if (vm_any(taken)) {
            const vf unit = vf_set1(1.0f) / vf_sqrt(vf_select(taken, p.d2, vf_set1(1.0f)));
            add_light(r, lobes, taken, vf_and(taken, p.geometry - vf_set1(job->bound)), p.wx * unit, p.wy * unit, p.wz * unit, sent);
        }
        const uint32_t further = vm_bits(opened);
        if (!further) continue;
        const int32_t level = at.level - 1;
        /* the last is gone through first: rows from the top, columns from the left */
        for (uint32_t i = 4; i-- > 0;) {
            const uint32_t x = 2 * at.x + i % 2, y = 2 * at.y + i / 2;
            if (level < 0 || (x < pyramid->width[level] && y < pyramid->height[level])) stack[depth++] = (place){level, x, y, further};
        }
    }
}

/* Most nodes of the coarsest level send nothing that counts to most receivers: found out here, eight receivers after the other, so that the node stays in registers. */
static void gather_from(const es_residual_job* job, const es_residual_layer* layer, float pixel_area, float reach, place at, const es_residual_node* node, const tile* t, bool lobes)
{
    const vf least = vf_set1(es_minf(job->solid_angle, job->discontinuity)), bound = vf_set1(job->bound), close = vf_set1(CLOSE), area = vf_set1(node->area);
    for (uint32_t i = 0; i < t->count; i++) {
        receivers* r = &t->groups[i];
        const pair p = meet(node, r, reach);
        const vm lanes = r->wanted & p.within;
        if (vm_any(lanes & (vm_gt(p.angle, least) | vm_gt(p.per * area, close) | vm_gt(p.geometry, bound)))) {
            at.lanes = vm_bits(r->wanted);
            gather_node(job, layer, pixel_area, reach, at, r, lobes);
        } else {
            r->samples += (uint64_t)__builtin_popcount(vm_bits(lanes));
        }
    }
}

static void gather_layer(const es_residual_job* job, const es_residual_layer* layer, float reach, tile* t, bool lobes)
{
    const es_residual_pyramid* p = layer->pyramid;
    const int32_t coarsest = (int32_t)p->levels - 1;
    const float pixel_area = es_pixel_area(&layer->rays);
    t->left = t->top = INT32_MAX;
    t->right = t->bottom = -1;
    for (uint32_t i = 0; i < t->count; i++) find_reach(layer, reach, &t->groups[i], t);
    if (t->right < t->left || t->bottom < t->top) return;
    const uint32_t left = t->left > 0 ? (uint32_t)t->left >> coarsest : 0, top = t->top > 0 ? (uint32_t)t->top >> coarsest : 0;
    for (uint32_t y = top; y <= (uint32_t)t->bottom >> coarsest; y++)
        for (uint32_t x = left; x <= (uint32_t)t->right >> coarsest; x++) {
            const place at = {coarsest, x, y, 0};
            es_residual_node node;
            float sent[4], d2 = 0.0f;
            load_node(layer, pixel_area, &at, &node, sent);
            if (!(node.area > 0.0f)) continue;
            for (int k = 0; k < 3; k++) {
                const float d = es_maxf(es_maxf(t->low[k] - node.position[k], node.position[k] - t->high[k]), 0.0f);
                d2 += d * d;
            }
            const float limit = reach + es_absf(node.radius);
            if (d2 > limit * limit) continue;
            gather_from(job, layer, pixel_area, reach, at, &node, t, lobes);
        }
}

/* What pixels of a row are as receivers; false when none is one. */
static bool read_receivers(const es_residual_job* job, vi columns, uint32_t row, vm inside, receivers* r)
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* rays = &job->rays;
    const vi at = vi_set1((int32_t)(row * g->stride)) + (inside & columns);
    const vf depth = vf_gather(g->depth, at), zero = vf_zero();
    memset(r, 0, sizeof *r);
    const vi word = vi_gather(g->surface, at);
    r->wanted = inside & vm_gt(depth, zero) & ~vi_eq(vi_shift_right_logical(word, 24), vi_set1(ES_SURFACE_UNLIT));
    if (!vm_any(r->wanted)) return false;
    /* a tenth of a pixel's width off the surface, towards the eye: on the very line where two surfaces meet, neither sees the other */
    const float *step = rays->orthographic ? rays->base_dx : rays->dir_dx, width = 0.1f * es_sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]);
    const vf lifted = rays->orthographic ? depth - vf_set1(width) : depth * vf_set1(1.0f - es_minf(width, 0.5f));
    const es_patch_v p = es_patch_of_pixel_v(rays, 1.0f, false, vf_from_int(columns), vf_set1((float)row), lifted, vi_gather(g->normal, at), r->wanted);
    r->x = p.x;
    r->y = p.y;
    r->z = p.z;
    r->nx = p.nx;
    r->ny = p.ny;
    r->nz = p.nz;
    const bool lobes = job->specular[0] != NULL;
    if (lobes) {
        r->surface = es_surface_of_gbuffer_v(vi_gather(g->albedo_rg, at), vi_gather(g->albedo_b, at), word);
        const vm phong = vi_eq(r->surface.model, vi_set1(ES_SURFACE_PHONG));
        r->lobed = r->wanted & es_surface_has_lobe_v(&r->surface);
        /* as es_widened_lobe: Phong's exponent that is as wide as GGX of that roughness */
        const float alpha = job->lobe_roughness * job->lobe_roughness, exponent = 2.0f / es_maxf(alpha * alpha, 1e-6f) - 2.0f;
        r->surface.roughness = vf_select(phong, vf_min(r->surface.roughness, vf_set1(es_maxf(exponent, 1.0f))), vf_max(r->surface.roughness, vf_set1(job->lobe_roughness)));
        const vf column = vf_from_int(columns), y = vf_set1((float)row);
        vf d[3];
        for (int k = 0; k < 3; k++) d[k] = vf_neg(vf_set1(rays->dir[k]) + column * vf_set1(rays->dir_dx[k]) + y * vf_set1(rays->dir_dy[k]));
        const vf unit = vf_set1(1.0f) / vf_sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        r->ox = d[0] * unit;
        r->oy = d[1] * unit;
        r->oz = d[2] * unit;
        es_lift_to_horizon_v(r->nx, r->ny, r->nz, &r->ox, &r->oy, &r->oz);
    }
    return true;
}

static void store(const es_residual_job* job, const receivers* r, vm inside, size_t to)
{
    for (int k = 0; k < 3; k++) {
        vf e = r->irradiance[k], s = r->lobe[k];
        if (job->listed) {
            e = vf_select(inside, e, vf_load(job->irradiance[k] + to));
            if (job->specular[0]) s = vf_select(inside, s, vf_load(job->specular[k] + to));
        }
        vf_store(job->irradiance[k] + to, e);
        if (job->specular[0]) vf_store(job->specular[k] + to, s);
    }
}

static void gather_tile(const es_residual_job* job, uint32_t column, uint32_t row, uint32_t rows)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t width = (g->width + job->spacing - 1) / job->spacing;
    /* beyond it G is below the bound */
    const float reach = 1.0f / es_sqrt(job->bound);
    receivers groups[TILE_GROUPS];
    size_t to[TILE_GROUPS];
    vm insides[TILE_GROUPS];
    tile t = {.groups = groups, .low = {INFINITY, INFINITY, INFINITY}, .high = {-INFINITY, -INFINITY, -INFINITY}};
    bool lobes = false;
    for (uint32_t y = row; y < row + rows; y++)
        for (uint32_t x = column; x < column + TILE_EIGHTS * VW && x < width; x += VW) {
            const vi places = vi_set1((int32_t)x) + vi_iota();
            vm inside = vi_lt(places, vi_set1((int32_t)width));
            if (job->listed) {
                const uint32_t bits = job->listed[(size_t)y * ((g->width + 7) / 8) + x / 8];
                inside &= vm_ne(vf_from_int(vi_set1((int32_t)bits) & (vi_set1(1) << vi_iota())), vf_zero());
                if (!bits) continue;
            }
            receivers* r = &groups[t.count];
            to[t.count] = (size_t)y * job->stride + x;
            insides[t.count] = inside;
            if (!read_receivers(job, places * vi_set1((int32_t)job->spacing), y * job->spacing, inside, r)) {
                store(job, r, inside, to[t.count]);
                continue;
            }
            t.count++;
            lobes |= job->specular[0] && vm_any(r->lobed);
            const vf position[3] = {r->x, r->y, r->z};
            for (uint32_t bits = vm_bits(r->wanted); bits; bits &= bits - 1)
                for (int k = 0, i = __builtin_ctz(bits); k < 3; k++) {
                    t.low[k] = es_minf(t.low[k], position[k][i]);
                    t.high[k] = es_maxf(t.high[k], position[k][i]);
                }
        }
    if (!t.count) return;
    for (uint32_t l = 0; l < job->layer_count; l++) gather_layer(job, &job->layers[l], reach, &t, lobes);
    for (uint32_t i = 0; i < t.count; i++) {
        store(job, &groups[i], insides[i], to[i]);
        job->samples[row] += groups[i].samples;
    }
}

void ES_KERNEL(es_gi_residual_gather)(const es_residual_job* job, uint32_t row_begin, uint32_t row_end)
{
    const uint32_t width = (job->gbuffer->width + job->spacing - 1) / job->spacing;
    for (uint32_t y = row_begin; y < row_end; y += TILE_ROWS)
        for (uint32_t x = 0; x < width; x += TILE_EIGHTS * VW) gather_tile(job, x, y, row_end - y < TILE_ROWS ? row_end - y : TILE_ROWS);
}
