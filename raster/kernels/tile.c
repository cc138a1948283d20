/* Triangle records into one tile's depth and numbers.
 *
 * Small triangles: setup for eight at once, then columns of eight pixels, each row one vector. Large ones: setup once, then 8x8 blocks, eight
 * blocks at a time tested for being outside an edge, inside all edges, or behind everything drawn there. Depth is the plane through the
 * three vertices, kept within their range. All edge arithmetic is exact (raster/limits.h).
 */
#include "raster/kernel_table.h"
#include "raster/kernels/texture_sampling.h"
#include "platform/simd.h"

/* Eight pixels from `at` on; there are no numbers unless `numbered`, and there is no `ceiling` unless `peeled`, with numbers. Returns the depth left there. */
VINL vf put(float* depth, uint32_t* numbers, const float* ceiling, uint32_t at, vm covered, vf z, vi number, bool numbered, bool peeled)
{
    depth += at;
    if (peeled) covered = covered & vm_lt(z, vf_load(ceiling + at));
    vf old = vf_load(depth);
    if (!numbered) {
        vf left = vf_max(vf_and(covered, z), old);
        vf_store(depth, left);
        return left;
    }
    vm wins = covered & vm_gt(z, old);
    vf left = vf_select(wins, z, old);
    vf_store(depth, left);
    vi_store(numbers + at, vi_select(wins, number, vi_load(numbers + at)));
    return left;
}

/* ---- small --------------------------------------------------------------------------------------------------------------------- */

typedef struct small_setup {
    int32_t c[3][VW], a[3][VW], b[3][VW];
    float z[VW], zx[VW], zy[VW], z_low[VW], z_high[VW];
    int32_t start[VW], rows[VW], columns[VW]; /* columns: of eight pixels */
} small_setup;

VINL vi set_up_small(const es_tile* tile, const es_small_triangle* records, vi record, small_setup* s)
{
    vi v0, v1, v2, pixel, id, z0i, z1i, z2i;
    vi_gather4(records, sizeof *records, record, &v0, &v1, &v2, &pixel);
    vi_gather4((const char*)records + 16, sizeof *records, record, &id, &z0i, &z1i, &z2i);
    vi x[3] = {(v0 << 16) >> 16, (v1 << 16) >> 16, (v2 << 16) >> 16}, y[3] = {v0 >> 16, v1 >> 16, v2 >> 16};
    vf z0 = vf_from_bits(z0i), z1 = vf_from_bits(z1i), z2 = vf_from_bits(z2i);
    vi px = (pixel & vi_set1(0xffff)) - vi_set1(tile->x), py = vi_shift_right_logical(pixel, 16) - vi_set1(tile->y);
    vi skip_x = vi_max(vi_zero() - px, vi_zero()), skip_y = vi_max(vi_zero() - py, vi_zero());
    for (int i = 0; i < 3; i++) {
        int j = i < 2 ? i + 1 : 0;
        vi a = y[i] - y[j], b = x[j] - x[i];
        /* top-left: a left edge goes up (a > 0), a top edge to the right */
        vm inclusive = vi_gt(a, vi_zero()) | (vi_eq(a, vi_zero()) & vi_gt(b, vi_zero()));
        vi c = (~inclusive - (a * x[i] + b * y[i])) >> ES_SUBPIXEL_BITS;
        vi_store(s->c[i], c + a * skip_x + b * skip_y);
        vi_store(s->a[i], a);
        vi_store(s->b[i], b);
    }
    vi x10 = x[1] - x[0], y10 = y[1] - y[0], x20 = x[2] - x[0], y20 = y[2] - y[0];
    vf per_area = vf_set1(1.0f) / vf_from_int(x10 * y20 - x20 * y10); /* below 2^27 */
    vf z10 = z1 - z0, z20 = z2 - z0;
    /* per subpixel */
    vf zx = (z10 * vf_from_int(y20) - z20 * vf_from_int(y10)) * per_area, zy = (z20 * vf_from_int(x10) - z10 * vf_from_int(x20)) * per_area;
    vf z = z0 + (zx * vf_from_int((skip_x << ES_SUBPIXEL_BITS) - x[0]) + zy * vf_from_int((skip_y << ES_SUBPIXEL_BITS) - y[0]));
    vf_store(s->z, z);
    vf_store(s->zx, zx * vf_set1(ES_SUBPIXELS));
    vf_store(s->zy, zy * vf_set1(ES_SUBPIXELS));
    vf_store(s->z_low, vf_min(vf_min(z0, z1), z2));
    vf_store(s->z_high, vf_max(vf_max(z0, z1), z2));
    vi row = vi_max(py, vi_zero()), column = vi_max(px, vi_zero());
    /* rows reach to the last centre above the lowest vertex, within the tile */
    vi end = vi_min(py + ((vi_max(vi_max(y[0], y[1]), y[2]) - vi_set1(1)) >> ES_SUBPIXEL_BITS) + vi_set1(1), vi_set1(ES_TILE_SIZE));
    vi_store(s->start, row * vi_set1(ES_TILE_PITCH) + column);
    vi_store(s->rows, end - row);
    vi right = vi_min(px + ((vi_max(vi_max(x[0], x[1]), x[2]) - vi_set1(1)) >> ES_SUBPIXEL_BITS) + vi_set1(1), vi_set1(ES_TILE_SIZE));
    vi_store(s->columns, (right - column + vi_set1(7)) >> 3);
    return id;
}

VINL void draw_small(es_tile* tile, const es_segment* segment, bool numbered, bool peeled)
{
    const es_small_triangle* records = segment->records;
    float* const depth = tile->depth;
    const float* const ceiling = tile->ceiling;
    uint32_t* const numbers = tile->number;
    uint32_t next_number = tile->next_number;
    vi iota = vi_iota();
    vf iota_f = vf_iota();
    for (uint32_t first = 0; first < segment->count; first += VW) {
        uint32_t n = segment->count - first < VW ? segment->count - first : VW;
        small_setup s;
        /* lists are padded to eight; what is beyond the end is not an index */
        vi ids = set_up_small(tile, records, vm_first((int32_t)n) & vi_load(segment->list + first), &s);
        if (numbered) vi_store(tile->triangle_ids + next_number, ids);
        for (uint32_t t = 0; t < n; t++) {
            vi e0 = vi_set1(s.c[0][t]) + vi_set1(s.a[0][t]) * iota, b0 = vi_set1(s.b[0][t]);
            vi e1 = vi_set1(s.c[1][t]) + vi_set1(s.a[1][t]) * iota, b1 = vi_set1(s.b[1][t]);
            vi e2 = vi_set1(s.c[2][t]) + vi_set1(s.a[2][t]) * iota, b2 = vi_set1(s.b[2][t]);
            vf z = vf_set1(s.z[t]) + vf_set1(s.zx[t]) * iota_f, zy = vf_set1(s.zy[t]);
            vf low = vf_set1(s.z_low[t]), high = vf_set1(s.z_high[t]);
            vi number = vi_set1((int32_t)(next_number + t));
            uint32_t start = (uint32_t)s.start[t];
            for (int32_t column = s.columns[t]; column > 0; column--) {
                vi f0 = e0, f1 = e1, f2 = e2;
                vf d = z;
                uint32_t at = start;
                for (int32_t row = s.rows[t]; row > 0; row--) {
                    put(depth, numbers, ceiling, at, vi_gt(f0 | f1 | f2, vi_set1(-1)), vf_clamp(d, low, high), number, numbered, peeled);
                    f0 += b0;
                    f1 += b1;
                    f2 += b2;
                    d += zy;
                    at += ES_TILE_PITCH;
                }
                if (column == 1) break;
                e0 += vi_set1(8 * s.a[0][t]);
                e1 += vi_set1(8 * s.a[1][t]);
                e2 += vi_set1(8 * s.a[2][t]);
                z += vf_set1(8 * s.zx[t]);
                start += VW;
            }
        }
        next_number += n;
    }
    tile->next_number = next_number;
}

void ES_KERNEL(es_draw_small)(es_tile* tile, const es_segment* segment)
{
    if (tile->ceiling) draw_small(tile, segment, true, true);
    else if (tile->number) draw_small(tile, segment, true, false);
    else draw_small(tile, segment, false, false);
}

/* ---- large ---------------------------------------------------------------------------------------------------------------------- */

typedef struct large_setup {
    int32_t c[3], a[3], b[3];  /* edge functions at the tile's first pixel */
    float z, zx, zy, z_low, z_high;
    int32_t first_row, last_row; /* of pixels in the tile */
} large_setup;

static inline int32_t clamp_constant(int64_t c)
{
    return (int32_t)(c < -ES_EDGE_CONSTANT_MAX ? -ES_EDGE_CONSTANT_MAX : c > ES_EDGE_CONSTANT_MAX ? ES_EDGE_CONSTANT_MAX : c);
}

static inline large_setup set_up_large(const es_tile* tile, const es_large_triangle* r)
{
    large_setup s;
    /* the centre of the tile's first pixel */
    int32_t tx = tile->x * ES_SUBPIXELS + ES_SUBPIXELS / 2 - (int32_t)tile->width * (ES_SUBPIXELS / 2);
    int32_t ty = tile->y * ES_SUBPIXELS + ES_SUBPIXELS / 2 - (int32_t)tile->height * (ES_SUBPIXELS / 2);
    int32_t x[3] = {r->x0, r->x1, r->x2}, y[3] = {r->y0, r->y1, r->y2};
    for (int i = 0; i < 3; i++) {
        int j = i < 2 ? i + 1 : 0;
        int32_t a = y[i] - y[j], b = x[j] - x[i];
        int64_t bias = a > 0 || (a == 0 && b > 0) ? 0 : -1;
        s.a[i] = a;
        s.b[i] = b;
        s.c[i] = clamp_constant(((int64_t)a * (tx - x[i]) + (int64_t)b * (ty - y[i]) + bias) >> ES_SUBPIXEL_BITS);
    }
    double x10 = x[1] - x[0], y10 = y[1] - y[0], x20 = x[2] - x[0], y20 = y[2] - y[0];
    double per_area = 1.0 / (x10 * y20 - x20 * y10), z10 = (double)r->z1 - r->z0, z20 = (double)r->z2 - r->z0;
    double zx = (z10 * y20 - z20 * y10) * per_area, zy = (z20 * x10 - z10 * x20) * per_area;
    s.z = (float)(r->z0 + zx * (tx - x[0]) + zy * (ty - y[0]));
    s.zx = (float)(zx * ES_SUBPIXELS);
    s.zy = (float)(zy * ES_SUBPIXELS);
    s.z_low = r->z0 < r->z1 ? r->z0 : r->z1;
    s.z_low = s.z_low < r->z2 ? s.z_low : r->z2;
    s.z_high = r->z0 > r->z1 ? r->z0 : r->z1;
    s.z_high = s.z_high > r->z2 ? s.z_high : r->z2;
    int32_t y_low = y[0] < y[1] ? y[0] : y[1], y_high = y[0] > y[1] ? y[0] : y[1];
    if (y[2] < y_low) y_low = y[2];
    if (y[2] > y_high) y_high = y[2];
    s.first_row = (y_low - ty + 255) >> ES_SUBPIXEL_BITS;
    s.last_row = (y_high - ty - 1) >> ES_SUBPIXEL_BITS;
    if (s.first_row < 0) s.first_row = 0;
    if (s.last_row > ES_TILE_SIZE - 1) s.last_row = ES_TILE_SIZE - 1;
    return s;
}

/* Alpha at the pixels of a masked triangle: perspective-correct like the resolve stage, from vertices transformed here, since
 * depth-only views keep no homogeneous records. */
typedef struct masked_setup {
    float xw[3], yw[3], w[3], uv[3][4], alpha[3];
    const es_prepared_material* material;
} masked_setup;

static masked_setup set_up_masked(const es_tile* tile, uint32_t id)
{
    masked_setup s;
    const es_prepared_instance* instance = &tile->instances[tile->chunks[id >> ES_CHUNK_BITS].instance];
    const es_raster_mesh* mesh = instance->mesh;
    const uint32_t* index = mesh->indices + 3 * (size_t)(id - instance->first_id);
    const float* m = instance->window.m;
    s.material = instance->material;
    for (int k = 0; k < 3; k++) {
        const float* p = mesh->positions + 4 * (size_t)index[k];
        s.xw[k] = ((m[0] * p[0] + m[1] * p[1]) + m[2] * p[2]) + m[3];
        s.yw[k] = ((m[4] * p[0] + m[5] * p[1]) + m[6] * p[2]) + m[7];
        s.w[k] = ((m[12] * p[0] + m[13] * p[1]) + m[14] * p[2]) + m[15];
        for (int i = 0; i < 4; i++) s.uv[k][i] = mesh->uvs ? mesh->uvs[4 * (size_t)index[k] + i] : 0;
        s.alpha[k] = mesh->colors ? mesh->colors[4 * (size_t)index[k] + 3] : 1;
    }
    return s;
}

static vm alpha_passes(const es_tile* tile, const masked_setup* s, int32_t column, int32_t row, vm active)
{
    vf x = vf_set1((float)(tile->x + column) + 0.5f - 0.5f * (float)tile->width) + vf_iota();
    vf y = vf_set1((float)(tile->y + row) + 0.5f - 0.5f * (float)tile->height);
    vf w[3], xr[3], yr[3], b[3], bx[3], by[3];
    for (int k = 0; k < 3; k++) {
        w[k] = vf_set1(s->w[k]);
        xr[k] = vf_set1(s->xw[k]) - x * w[k];
        yr[k] = vf_set1(s->yw[k]) - y * w[k];
    }
    vf sum = vf_zero(), sum_x = vf_zero(), sum_y = vf_zero();
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        b[k] = xr[i] * yr[j] - xr[j] * yr[i];
        bx[k] = w[j] * yr[i] - w[i] * yr[j];
        by[k] = w[i] * xr[j] - w[j] * xr[i];
        sum = sum + b[k];
        sum_x = sum_x + bx[k];
        sum_y = sum_y + by[k];
    }
    vf inverse = vf_set1(1.0f) / vf_select(vm_eq(sum, vf_zero()), vf_set1(1.0f), sum);
    const es_prepared_texture* texture = &s->material->textures[ES_TEXTURE_BASE_COLOR];
    int set = texture->uv_set ? 2 : 0;
    es_uv uv = {vf_zero(), vf_zero(), vf_zero(), vf_zero(), vf_zero(), vf_zero()};
    vf alpha = vf_zero();
    for (int k = 0; k < 3; k++) {
        vf l = b[k] * inverse, lx = (bx[k] - l * sum_x) * inverse, ly = (by[k] - l * sum_y) * inverse;
        vf u = vf_set1(s->uv[k][set]), v = vf_set1(s->uv[k][set + 1]);
        uv.u = uv.u + l * u;
        uv.v = uv.v + l * v;
        uv.dudx = uv.dudx + lx * u;
        uv.dvdx = uv.dvdx + lx * v;
        uv.dudy = uv.dudy + ly * u;
        uv.dvdy = uv.dvdy + ly * v;
        alpha = alpha + l * vf_set1(s->alpha[k]);
    }
    alpha = alpha * vf_set1(s->material->base_color[3]);
    if (texture->image) alpha = alpha * es_sample_texture(texture, &uv, active).a;
    return active & ~vm_lt(alpha, vf_set1(s->material->alpha_cutoff));
}

VINL bool draw_blocks(es_tile* tile, const large_setup* s, const masked_setup* mask, bool numbered, bool peeled)
{
    vi iota = vi_iota(), zero = vi_zero();
    vi a0 = vi_set1(s->a[0]), a1 = vi_set1(s->a[1]), a2 = vi_set1(s->a[2]), b0 = vi_set1(s->b[0]), b1 = vi_set1(s->b[1]), b2 = vi_set1(s->b[2]);
    vi seven = vi_set1(7);
    /* from a block's first pixel to where the edge function is largest and smallest in it */
    vi up0 = vi_max(a0 * seven, zero) + vi_max(b0 * seven, zero), down0 = vi_min(a0 * seven, zero) + vi_min(b0 * seven, zero);
    vi up1 = vi_max(a1 * seven, zero) + vi_max(b1 * seven, zero), down1 = vi_min(a1 * seven, zero) + vi_min(b1 * seven, zero);
    vi up2 = vi_max(a2 * seven, zero) + vi_max(b2 * seven, zero), down2 = vi_min(a2 * seven, zero) + vi_min(b2 * seven, zero);
    vi step = iota << 3;
    vi ax0 = a0 * iota, ax1 = a1 * iota, ax2 = a2 * iota;
    vf zx = vf_set1(s->zx), zy = vf_set1(s->zy), low = vf_set1(s->z_low), high = vf_set1(s->z_high);
    vf zx_iota = zx * vf_iota();
    float steep_x = s->zx < 0 ? -s->zx : s->zx, steep_y = s->zy < 0 ? -s->zy : s->zy;
    /* the largest depth in a block, with more than the rounding errors of the sums below added: a block is skipped only when
     * every pixel would lose, so skipping cannot change a bit */
    float margin = 2e-6f * ((s->z < 0 ? -s->z : s->z) + 64.0f * (steep_x + steep_y));
    vf z_top = vf_set1((s->zx > 0 ? 7 * s->zx : 0) + (s->zy > 0 ? 7 * s->zy : 0) + margin);
    float* const depth = tile->depth;
    const float* const ceiling = tile->ceiling;
    uint32_t* const numbers = tile->number;
    vi number = vi_set1((int32_t)tile->next_number);
    bool any = false;
    for (int32_t by = s->first_row >> 3; by <= s->last_row >> 3; by++) {
        vi y8 = vi_set1(8 * by);
        vi e0 = vi_set1(s->c[0]) + (a0 * step + b0 * y8), e1 = vi_set1(s->c[1]) + (a1 * step + b1 * y8), e2 = vi_set1(s->c[2]) + (a2 * step + b2 * y8);
        vi touched = (e0 + up0) | (e1 + up1) | (e2 + up2), inside = (e0 + down0) | (e1 + down1) | (e2 + down2);
        vf z_block = (vf_set1(s->z) + zy * vf_from_int(y8)) + zx * vf_from_int(step);
        vf minimum = vf_load(tile->block_minimum + 8 * by);
        vm live = vi_gt(touched, vi_set1(-1)) & ~vm_lt(vf_min(z_block + z_top, high), minimum);
        uint32_t bits = vm_bits(live);
        if (!bits) continue;
        any = true;
        uint32_t inside_bits = vm_bits(vi_gt(inside, vi_set1(-1)));
        int32_t start[3][VW];
        float z_start[VW];
        vi_store(start[0], e0);
        vi_store(start[1], e1);
        vi_store(start[2], e2);
        vf_store(z_start, z_block);
        for (; bits; bits &= bits - 1) {
            int bx = __builtin_ctz(bits);
            uint32_t at = (uint32_t)(8 * by * ES_TILE_PITCH + 8 * bx);
            vf z = vf_set1(z_start[bx]) + zx_iota;
            vf least = vf_set1(2.0f);
            if (!mask && (inside_bits >> bx & 1)) {
                for (int row = 0; row < 8; row++, at += ES_TILE_PITCH) {
                    least = vf_min(least, put(depth, numbers, ceiling, at, vm_all_lanes(), vf_clamp(z, low, high), number, numbered, peeled));
                    z += zy;
                }
            } else {
                vi f0 = vi_set1(start[0][bx]) + ax0, f1 = vi_set1(start[1][bx]) + ax1, f2 = vi_set1(start[2][bx]) + ax2;
                for (int row = 0; row < 8; row++, at += ES_TILE_PITCH) {
                    vm covered = vi_gt(f0 | f1 | f2, vi_set1(-1));
                    vf d = vf_clamp(z, low, high);
                    if (mask) {
                        covered &= vm_gt(d, vf_load(depth + at));
                        if (vm_any(covered)) covered = alpha_passes(tile, mask, 8 * bx, 8 * by + row, covered);
                    }
                    least = vf_min(least, put(depth, numbers, ceiling, at, covered, d, number, numbered, peeled));
                    f0 += b0;
                    f1 += b1;
                    f2 += b2;
                    z += zy;
                }
            }
            float m[VW];
            vf_store(m, least);
            float m0 = m[0] < m[4] ? m[0] : m[4], m1 = m[1] < m[5] ? m[1] : m[5], m2 = m[2] < m[6] ? m[2] : m[6], m3 = m[3] < m[7] ? m[3] : m[7];
            m0 = m0 < m2 ? m0 : m2;
            m1 = m1 < m3 ? m1 : m3;
            tile->block_minimum[8 * by + bx] = m0 < m1 ? m0 : m1;
        }
    }
    return any;
}

void ES_KERNEL(es_draw_large)(es_tile* tile, const es_segment* segment)
{
    const es_large_triangle* records = segment->records;
    for (uint32_t i = 0; i < segment->count; i++) {
        const es_large_triangle* r = &records[segment->list[i]];
        large_setup s = set_up_large(tile, r);
        if (tile->number) tile->triangle_ids[tile->next_number] = r->id;
        bool any = tile->ceiling ? draw_blocks(tile, &s, NULL, true, true) : tile->number ? draw_blocks(tile, &s, NULL, true, false) : draw_blocks(tile, &s, NULL, false, false);
        tile->next_number++;
        tile->hidden += !any;
    }
}

void ES_KERNEL(es_draw_masked)(es_tile* tile, const es_segment* segment)
{
    const es_large_triangle* records = segment->records;
    for (uint32_t i = 0; i < segment->count; i++) {
        const es_large_triangle* r = &records[segment->list[i]];
        large_setup s = set_up_large(tile, r);
        masked_setup mask = set_up_masked(tile, r->id);
        if (tile->number) tile->triangle_ids[tile->next_number] = r->id;
        bool any = tile->ceiling ? draw_blocks(tile, &s, &mask, true, true) : tile->number ? draw_blocks(tile, &s, &mask, true, false) : draw_blocks(tile, &s, &mask, false, false);
        tile->next_number++;
        tile->hidden += !any;
    }
}
