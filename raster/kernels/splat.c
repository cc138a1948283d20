/* Points into a parabolic map (raster/points.h).
 *
 * Eight points are projected at once; those that fall into the map are packed into two queues, by the rows their box has. A
 * queue is then drawn point by point without branches: a row of the box is one load, minimum and store of four texels, the
 * texels beyond the box's width being EMPTY, the identity of the minimum. So a row may hang over the map's edge into the next
 * row, and a box of 3 rows may be drawn as 4. The minimum commutes: the order of points is free.
 *
 * Scalar reading, for each point p: d = p - position; q = (d·t, d·b, d·n); r = |d|; drawn when q.z > 0 and near <= r < far;
 *   s = clamp(round(splat_width · size / 2 / (r + q.z)), 1, 4); x0 = clamp(floor(u + (1 - s) / 2), 0, size - s), u = the texel
 *   coordinate, y0 likewise; map[y0 … y0 + s)[x0 … x0 + s) = min(itself, floor(r · DEPTH_MAX / far + 0.5)).
 */
#include "raster/kernel_table.h"
#include "raster/points.h"
#include "platform/simd16.h"

enum { STREAMS = 64, BLOCK = STREAMS * VW };

/* at: place | (width - 1) << 20; written eight at a time, hence the slack */
typedef struct splat_queue { uint32_t count, at[BLOCK + VW], depth[BLOCK + VW]; } splat_queue;

static const uint16_t beyond[4][4] = {{0, 65535, 65535, 65535}, {0, 0, 65535, 65535}, {0, 0, 0, 65535}, {0, 0, 0, 0}};
/* the last row of a two-row or four-row box whose width is one less than its rows is not drawn */
static const uint16_t beyond_last[4][4] = {{65535, 65535, 65535, 65535}, {0, 0, 65535, 65535}, {65535, 65535, 65535, 65535}, {0, 0, 0, 0}};

static void draw_small(const splat_queue* queue, uint16_t* work, uint32_t size)
{
    for (uint32_t first = 0; first < VW; first++) {
        for (uint32_t i = first; i < queue->count; i += VW) {
            uint32_t at = queue->at[i], width = at >> 20;
            uint16_t depth = (uint16_t)queue->depth[i];
            uint16_t* p = work + (at & 0xfffffu);
            vh4_store_min(p, vh4_set1_or(depth, beyond[width]));
            vh4_store_min(p + size, vh4_set1_or(depth, beyond_last[width]));
        }
    }
}

static void draw_large(const splat_queue* queue, uint16_t* work, uint32_t size)
{
    for (uint32_t first = 0; first < VW; first++) {
        for (uint32_t i = first; i < queue->count; i += VW) {
            uint32_t at = queue->at[i], width = at >> 20;
            uint16_t depth = (uint16_t)queue->depth[i];
            uint16_t* p = work + (at & 0xfffffu);
            vh4 row = vh4_set1_or(depth, beyond[width]);
            vh4_store_min(p, row);
            vh4_store_min(p + size, row);
            vh4_store_min(p + 2 * size, row);
            vh4_store_min(p + 3 * size, vh4_set1_or(depth, beyond_last[width]));
        }
    }
}

VINL void splat(const es_parabolic_map* map, const es_point_set* points, uint16_t* work, bool parallel)
{
    const float *t = map->tangent, *b = map->bitangent, *n = map->normal, *o = map->position;
    const vf tx = vf_set1(t[0]), ty = vf_set1(t[1]), tz = vf_set1(t[2]);
    const vf bx = vf_set1(b[0]), by = vf_set1(b[1]), bz = vf_set1(b[2]);
    const vf nx = vf_set1(n[0]), ny = vf_set1(n[1]), nz = vf_set1(n[2]);
    const vf ox = vf_set1(o[0]), oy = vf_set1(o[1]), oz = vf_set1(o[2]);
    const float half = 0.5f * (float)map->size;
    const vf near2 = vf_set1(map->near_distance * map->near_distance), far2 = vf_set1(map->far_distance * map->far_distance);
    const vf scale = vf_set1((float)ES_PARABOLIC_DEPTH_MAX / map->far_distance), width_scale = vf_set1(map->splat_width * half);
    const vf centre = vf_set1(half), corner = vf_set1(half + 0.5f), side = vf_set1((float)map->size);
    const vi side_int = vi_set1((int32_t)map->size);
    splat_queue small, large;

    const uint32_t vectors = (points->count + VW - 1) / VW, step = (vectors + STREAMS - 1) / STREAMS;
    for (uint32_t begin = 0; begin < step; begin++) {
        small.count = large.count = 0;
        for (uint32_t vector = begin; vector < vectors; vector += step) {
            const uint32_t i = vector * VW;
            vf dx = vf_load(points->x + i) - ox, dy = vf_load(points->y + i) - oy, dz = vf_load(points->z + i) - oz;
            vf qx = dx * tx + dy * ty + dz * tz, qy = dx * bx + dy * by + dz * bz, qz = dx * nx + dy * ny + dz * nz;
            vf r2 = dx * dx + dy * dy + dz * dz;
            /* false for NaN and infinity, too */
            vm drawn = parallel ? vm_gt(qz, vf_zero()) & vm_lt(qz, vf_set1(map->far_distance)) : vm_gt(qz, vf_zero()) & vm_ge(r2, near2) & vm_lt(r2, far2);
            if (points->count - i < VW) drawn &= vm_first((int32_t)(points->count - i));
            vf r = parallel ? vf_and(drawn, qz) : vf_sqrt(r2);
            vf s = parallel ? vf_set1(2.0f / map->far_distance) : vf_set1(1.0f) / vf_select(drawn, r + qz, vf_set1(map->far_distance));
            vi width = vi_round(vf_clamp(width_scale * s, vf_set1(1.0f), vf_set1(4.0f)));
            vf w = vf_from_int(width);
            vf first = corner - vf_set1(0.5f) * w, last = side - w;
            s = s * centre;
            /* every lane has a place in the map, those that are not drawn too */
            vi x = vi_truncate(vf_min(vf_max(qx * s + first, vf_zero()), last));
            vi y = vi_truncate(vf_min(vf_max(qy * s + first, vf_zero()), last));
            vi at = (y * side_int + x) | ((width - vi_set1(1)) << 20);
            vi depth = vi_truncate(r * scale + vf_set1(0.5f));
            vm is_large = vi_gt(width, vi_set1(2));
            small.count += vi_store_packed2(small.at + small.count, small.depth + small.count, at, depth, drawn & ~is_large);
            large.count += vi_store_packed2(large.at + large.count, large.depth + large.count, at, depth, drawn & is_large);
        }
        draw_small(&small, work, map->size);
        draw_large(&large, work, map->size);
    }
}

void ES_KERNEL(es_splat_parabolic_map)(const es_parabolic_map* map, const es_point_set* points, uint16_t* work)
{
    if (map->parallel) splat(map, points, work, true);
    else splat(map, points, work, false);
}
