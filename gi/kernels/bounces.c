/* Where the light of a sender goes (gi/bounces.h): to points, or to the texels of a reflective map. */
#include "gi/bounces.h"
#include "gi/kernel_table.h"
#include "gi/kernels/surface_simd.h"
#include "raster/points.h"

/* Normal, and luminance's weights of what is reflected of each colour: summed over colours of `sent` by the caller. */
VINL void reflectance(vi rg, vi b, vi word, vf out[3])
{
    es_surface_v s = es_surface_of_gbuffer_v(rg, b, word);
    out[0] = vf_set1(0.2126f) * (s.albedo[0] + s.specular[0]);
    out[1] = vf_set1(0.7152f) * (s.albedo[1] + s.specular[1]);
    out[2] = vf_set1(0.0722f) * (s.albedo[2] + s.specular[2]);
}

/* Intensity over the cosine in the unit direction (wx, wy, wz). */
VINL void sent_towards(const es_bounce_sender* s, vf wx, vf wy, vf wz, vf sent[3])
{
    for (int k = 0; k < 3; k++) sent[k] = vf_set1(s->color[k]);
    if (!s->glossy) return;
    es_surface_v surface = {.roughness = vf_set1(s->roughness), .model = vi_set1((int32_t)s->model)};
    for (int k = 0; k < 3; k++) surface.specular[k] = vf_set1(s->specular_color[k]);
    vf pass, lobe[3];
    es_surface_parts_v(&surface, vf_set1(s->normal[0]), vf_set1(s->normal[1]), vf_set1(s->normal[2]), vf_set1(s->incident[0]), vf_set1(s->incident[1]), vf_set1(s->incident[2]),
        wx, wy, wz, &pass, lobe);
    for (int k = 0; k < 3; k++) sent[k] = sent[k] * pass + vf_set1(s->power[k]) * lobe[k];
}

/* Cosine at a receiver, from the dot product of its front's normal and the direction to the sender: fronts, and backs that count. */
VINL vf facing(const es_bounce_sender* s, vf cosine, vi albedo_b)
{
    vm backs = s->backs ? vm_all_lanes() : ~vi_eq(vi_shift_right_logical(albedo_b, 16), vi_zero());
    return vf_select(backs, vf_abs(cosine), vf_max(cosine, vf_zero()));
}

/* weights[i] = luminance of I(d) cos / r² a V (albedo + specular), V being 1 or `doubt`, sums[i / 8] the sum of eight. Both are written up to the next multiple of eight. */
VINL void weigh(const es_bounce_sender* s, const es_surfel_set* points, float* weights, float* sums, bool parallel)
{
    const vf zero = vf_zero(), half = vf_set1(0.5f * (float)s->map_size), last = vf_set1((float)s->map_size - 0.5f), near2 = vf_set1(s->near_distance * s->near_distance);
    const vf depth_scale = vf_set1((float)ES_PARABOLIC_DEPTH_MAX / s->far_distance);
    const vf bias = vf_set1(s->bias * ((float)ES_PARABOLIC_DEPTH_MAX / s->far_distance)), slope_bias = vf_set1(s->slope_bias * ((float)ES_PARABOLIC_DEPTH_MAX / s->far_distance));
    for (uint32_t i = 0; i < points->count; i += VW) {
        vf dx = vf_load(points->x + i) - vf_set1(s->position[0]), dy = vf_load(points->y + i) - vf_set1(s->position[1]), dz = vf_load(points->z + i) - vf_set1(s->position[2]);
        vf qz = dx * vf_set1(s->normal[0]) + dy * vf_set1(s->normal[1]) + dz * vf_set1(s->normal[2]);
        vf nx, ny, nz;
        es_unpack_normal_v(vi_load(points->normal + i), &nx, &ny, &nz);
        vi albedo_b = vi_load(points->albedo_b + i);
        vf received = parallel ? facing(s, vf_neg(vf_set1(s->normal[0]) * nx + vf_set1(s->normal[1]) * ny + vf_set1(s->normal[2]) * nz), albedo_b) : facing(s, vf_neg(dx * nx + dy * ny + dz * nz), albedo_b); /* times r */
        vm lit = parallel ? vm_gt(received, zero) : vm_gt(qz, zero) & vm_gt(received, zero);
        if (points->count - i < VW) lit &= vm_first((int32_t)(points->count - i));
        vf weight = zero;
        if (vm_any(lit)) {
            vf r2 = parallel ? vf_set1(1.0f) : vf_max(dx * dx + dy * dy + dz * dz, near2), r = vf_sqrt(r2), share = vf_set1(1.0f);
            if (s->map) {
                vf qx = dx * vf_set1(s->tangent[0]) + dy * vf_set1(s->tangent[1]) + dz * vf_set1(s->tangent[2]);
                vf qy = dx * vf_set1(s->bitangent[0]) + dy * vf_set1(s->bitangent[1]) + dz * vf_set1(s->bitangent[2]);
                vf to_texel = parallel ? vf_set1((float)s->map_size / s->far_distance) : half / (r + vf_max(qz, zero)), along = parallel ? qz : r;
                vi x = vi_truncate(vf_max(vf_min(qx * to_texel + half, last), zero)), y = vi_truncate(vf_max(vf_min(qy * to_texel + half, last), zero));
                vi at = y * vi_set1((int32_t)s->map_size) + x;
                uint32_t place[VW];
                vi depth;
                vi_store(place, at);
                for (int k = 0; k < VW; k++) depth[k] = s->map[place[k]];
                vm seen = vm_le((along * depth_scale - bias) * received - slope_bias * r, vf_from_int(depth) * received);
                share = vf_select(seen, share, vf_set1(s->doubt));
            }
            vf inverse = vf_set1(1.0f) / r, sent[3], reflected[3];
            if (parallel) for (int k = 0; k < 3; k++) sent[k] = vf_set1(s->color[k]);
            else sent_towards(s, dx * inverse, dy * inverse, dz * inverse, sent);
            reflectance(vi_load(points->albedo_rg + i), albedo_b, vi_load(points->surface + i), reflected);
            vf g = parallel ? vf_load(points->area + i) * received : vf_load(points->area + i) * (qz * inverse) * (received * inverse) * (inverse * inverse);
            weight = vf_and(lit, share * g * (sent[0] * reflected[0] + sent[1] * reflected[1] + sent[2] * reflected[2]));
        }
        vf_store(weights + i, weight);
        sums[i / VW] = vf_sum(weight);
    }
}

void ES_KERNEL(es_gi_bounce_weights)(const es_bounce_sender* s, const es_surfel_set* points, float* weights, float* sums)
{
    if (s->parallel) weigh(s, points, weights, sums, true);
    else weigh(s, points, weights, sums, false);
}

/* ---- reflective maps ------------------------------------------------------------------------------------------------------- */

/* Texels of a box's side: close by, points stand wide apart, and holes there would lose light. */
enum { MAX_WIDTH = 16 };

/* Points into keys, as raster/points.h has it but for wider boxes. The smaller key wins, so the order is free. What turns away is left out: closed
 * surfaces hide their backs, which would show through between the points of their fronts. */
void ES_KERNEL(es_gi_reflective_splat)(const es_bounce_sender* s, const es_surfel_set* points, const es_reflective_map* map)
{
    const uint32_t size = map->size;
    const float half = 0.5f * (float)size;
    const vf near2 = vf_set1(s->near_distance * s->near_distance), far2 = vf_set1(s->far_distance * s->far_distance);
    const vf scale = vf_set1((float)ES_PARABOLIC_DEPTH_MAX / s->far_distance), scale_of_width = vf_set1(half), corner = vf_set1(half + 0.5f), side = vf_set1((float)size);
    uint32_t* keys = map->keys;
    memset(keys, 0xff, (size_t)size * size * sizeof *keys);
    for (uint32_t i = 0; i < points->count; i += VW) {
        vf dx = vf_load(points->x + i) - vf_set1(s->position[0]), dy = vf_load(points->y + i) - vf_set1(s->position[1]), dz = vf_load(points->z + i) - vf_set1(s->position[2]);
        vf qx = dx * vf_set1(s->tangent[0]) + dy * vf_set1(s->tangent[1]) + dz * vf_set1(s->tangent[2]);
        vf qy = dx * vf_set1(s->bitangent[0]) + dy * vf_set1(s->bitangent[1]) + dz * vf_set1(s->bitangent[2]);
        vf qz = dx * vf_set1(s->normal[0]) + dy * vf_set1(s->normal[1]) + dz * vf_set1(s->normal[2]);
        vf r2 = dx * dx + dy * dy + dz * dz;
        vm drawn = vm_gt(qz, vf_zero()) & vm_ge(r2, near2) & vm_lt(r2, far2);
        if (points->count - i < VW) drawn &= vm_first((int32_t)(points->count - i));
        if (!vm_any(drawn)) continue;
        vf nx, ny, nz;
        es_unpack_normal_v(vi_load(points->normal + i), &nx, &ny, &nz);
        drawn &= vm_gt(facing(s, vf_neg(dx * nx + dy * ny + dz * nz), vi_load(points->albedo_b + i)), vf_zero());
        uint32_t bits = vm_bits(drawn);
        if (!bits) continue;
        vf r = vf_sqrt(r2), inverse = vf_set1(1.0f) / vf_select(drawn, r + qz, vf_set1(s->far_distance));
        vi width = vi_round(vf_clamp(vf_sqrt(vf_load(points->area + i)) * scale_of_width * inverse, vf_set1(1.0f), vf_set1((float)MAX_WIDTH)));
        vf w = vf_from_int(width), first = corner - vf_set1(0.5f) * w, last = side - w, step = inverse * vf_set1(half);
        vi x = vi_truncate(vf_min(vf_max(qx * step + first, vf_zero()), last)), y = vi_truncate(vf_min(vf_max(qy * step + first, vf_zero()), last));
        vi key = vi_truncate(r * scale + vf_set1(0.5f)) << 16 | (vi_set1((int32_t)i) + vi_iota());
        uint32_t at[VW], widths[VW], key_of[VW];
        vi_store(at, y * vi_set1((int32_t)size) + x);
        vi_store(widths, width);
        vi_store(key_of, key);
        for (; bits; bits &= bits - 1) {
            const uint32_t k = (uint32_t)__builtin_ctz(bits), n = widths[k], value = key_of[k];
            uint32_t* row = keys + at[k];
            for (uint32_t j = 0; j < n; j++, row += size)
                for (uint32_t c = 0; c < n; c++) row[c] = row[c] < value ? row[c] : value;
        }
    }
}

static inline uint32_t smaller(uint32_t a, uint32_t b) { return a < b ? a : b; }

/* Pull: the nearest of four. Push: a texel that is empty or `push` · 2^level behind the coarser one becomes it. */
void ES_KERNEL(es_gi_reflective_fill)(const es_reflective_map* map)
{
    uint32_t* level[ES_PULL_PUSH_MAX_LEVELS + 1];
    level[0] = map->keys;
    uint32_t* next = map->scratch;
    for (uint32_t l = 1; l <= map->levels; l++) {
        const uint32_t side = map->size >> l;
        level[l] = next;
        next += (size_t)side * side;
        for (uint32_t y = 0; y < side; y++) {
            const uint32_t *a = level[l - 1] + (size_t)(2 * y) * 2 * side, *b = a + 2 * side;
            uint32_t* out = level[l] + (size_t)y * side;
            for (uint32_t x = 0; x < side; x++) out[x] = smaller(smaller(a[2 * x], a[2 * x + 1]), smaller(b[2 * x], b[2 * x + 1]));
        }
    }
    for (uint32_t l = map->levels; l-- > 0;) {
        const uint32_t side = map->size >> l, limit = smaller(map->push << l, ES_PARABOLIC_THRESHOLD_MAX);
        for (uint32_t y = 0; y < side; y++) {
            const uint32_t* coarse = level[l + 1] + (size_t)(y / 2) * (side / 2);
            uint32_t* fine = level[l] + (size_t)y * side;
            for (uint32_t x = 0; x < side; x++) {
                /* what is empty lies beyond every threshold behind every depth (raster/points.h) */
                uint32_t c = coarse[x / 2], f = fine[x];
                fine[x] = (f >> 16) > (c >> 16) + limit ? c : f;
            }
        }
    }
}

/* weights of all texels: luminance of I(d) dΩ (albedo + specular), 0 where nothing is or where it turns away; sums of eight as above. */
void ES_KERNEL(es_gi_reflective_weights)(const es_bounce_sender* s, const es_surfel_set* points, const es_reflective_map* map, float* weights, float* sums)
{
    const uint32_t size = map->size;
    const vf zero = vf_zero(), one = vf_set1(1.0f), step = vf_set1(2.0f / (float)size);
    const vf texel = vf_set1(4.0f * (2.0f / (float)size) * (2.0f / (float)size));
    for (uint32_t y = 0; y < size; y++) {
        const vf v = vf_set1(((float)y + 0.5f) * (2.0f / (float)size) - 1.0f);
        for (uint32_t x = 0; x < size; x += VW) {
            const size_t at = (size_t)y * size + x;
            vi key = vi_load(map->keys + at);
            vf u = (vf_set1((float)x) + vf_iota() + vf_set1(0.5f)) * step - one, q = u * u + v * v;
            vm seen = ~vi_eq(key, vi_set1(-1)) & vm_lt(q, one);
            vf weight = zero;
            if (vm_any(seen)) {
                vi index = key & vi_set1(0xffff) & seen;
                vf nx, ny, nz;
                es_unpack_normal_v(vi_gather(points->normal, index), &nx, &ny, &nz);
                vi albedo_b = vi_gather(points->albedo_b, index);
                vf dx = vf_gather(points->x, index) - vf_set1(s->position[0]), dy = vf_gather(points->y, index) - vf_set1(s->position[1]), dz = vf_gather(points->z, index) - vf_set1(s->position[2]);
                seen &= vm_gt(facing(s, vf_neg(dx * nx + dy * ny + dz * nz), albedo_b), zero);
                /* (u, v) = (x, y) / (1 + z) of a unit direction, inverted */
                vf inverse = one / (one + q), cosine = (one - q) * inverse;
                vf sent[3], reflected[3], qx = vf_set1(2.0f) * u * inverse, qy = vf_set1(2.0f) * v * inverse;
                sent_towards(s, qx * vf_set1(s->tangent[0]) + qy * vf_set1(s->bitangent[0]) + cosine * vf_set1(s->normal[0]),
                    qx * vf_set1(s->tangent[1]) + qy * vf_set1(s->bitangent[1]) + cosine * vf_set1(s->normal[1]),
                    qx * vf_set1(s->tangent[2]) + qy * vf_set1(s->bitangent[2]) + cosine * vf_set1(s->normal[2]), sent);
                reflectance(vi_gather(points->albedo_rg, index), albedo_b, vi_gather(points->surface, index), reflected);
                weight = vf_and(seen, texel * inverse * inverse * cosine * (sent[0] * reflected[0] + sent[1] * reflected[1] + sent[2] * reflected[2]));
            }
            vf_store(weights + at, weight);
            sums[at / VW] = vf_sum(weight);
        }
    }
}
