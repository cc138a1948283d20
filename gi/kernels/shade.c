/* Interleaved shading (gi/shade.h): one block of the image, all phases of one phase row.
 *
 * What the G-buffer's rows hold is split into phases; of each, a batch is made (position, unit normal, sums), all lights of the phase are
 * applied to it one after another, and the sums are put together to rows again. A light's constants stay in registers and its map in
 * the caches while it passes over the batch. Eight pixels that the light cannot reach (behind it, or facing away) cost nine
 * multiplications and a branch.
 */
#include <stddef.h>

#include "gi/kernel_table.h"
#include "gi/kernels/edited_lobe_simd.h"
#include "gi/kernels/lobe_albedo_simd.h"
#include "gi/kernels/phases_simd.h"
#include "gi/kernels/screen_test_simd.h"
#include "gi/kernels/surface_simd.h"
#include "gi/lit.h"
#include "gi/shade.h"
#include "platform/simd16.h"
#include "raster/pack.h"
#include "raster/points.h"

/* m²: the square of what is closer would leave the range of floats */
#define NEAREST2 0x1p-62f

/* lanes: of a row in the batch, the columns of the widest phase rounded up to VW */
typedef struct lanes_of_phase { uint32_t x0, columns, lanes, y0, rows, phase_x; } lanes_of_phase;

static void ray_origins(const uint32_t* geometric_normals, vi x, const vf p[3], float offset, es_shade_batch* batch, uint32_t at)
{
    vf nx, ny, nz;
    es_unpack_normal_v(vi_gather(geometric_normals, x), &nx, &ny, &nz);
    vf step = vf_max(vf_abs(p[0]), vf_max(vf_abs(p[1]), vf_abs(p[2]))) * vf_set1(7.6293945e-6f) + vf_set1(offset);
    vf_store(batch->ox + at, p[0] + step * nx);
    vf_store(batch->oy + at, p[1] + step * ny);
    vf_store(batch->oz + at, p[2] + step * nz);
}

/* Bits of x and y in turns: pixels of a square block of any power of two follow one another. */
static vi interleave_zeros(vi a)
{
    a = (a | a << 8) & vi_set1(0x00ff00ff);
    a = (a | a << 4) & vi_set1(0x0f0f0f0f);
    a = (a | a << 2) & vi_set1(0x33333333);
    return (a | a << 1) & vi_set1(0x55555555);
}
static vi morton(vi x, uint32_t y) { return interleave_zeros(x) | interleave_zeros(vi_set1((int32_t)y)) << 1; }

/* Fractions of multiples of 2^32 / step, for steps that are powers of one number (Roberts 2018): together they fill the cube evenly, and so
 * does any run of them. The seed shifts them. */
static vf spread_number(const es_shade_job* job, vi index, uint32_t shift, uint32_t step)
{
    vu bits = (vu)index * (vu)vi_set1((int32_t)step) + (vu)vi_set1((int32_t)((job->seed + 1u) * shift)); /* modulo 2^32 */
    return vf_from_int(vi_shift_right_logical((vi)bits, 8)) * vf_set1(1.0f / 16777216.0f);
}

/* Into the batch; false where none of the eight is edited. */
static bool load_edited(const es_shade_job* job, uint32_t y, vi x, es_shade_batch* batch, uint32_t at)
{
    const size_t row = (size_t)y * job->edited_spacing * job->edited_stride;
    const vi column = x * vi_set1((int32_t)job->edited_spacing);
    vm any = vi_zero();
    for (int k = 0; k < 3; k++) {
        const vf e = vf_gather(job->edited[k] + row, column);
        vf_store(batch->turned[k] + at, e);
        any |= vm_ne(e, vf_zero());
    }
    return vm_any(any);
}

static void gather(const es_shade_job* job, const lanes_of_phase* p, es_shade_batch* batch, bool with_lobes, bool* any_lobe)
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* rays = &job->rays;
    const uint32_t n = job->interleave;
    const vf zero = vf_zero();
    const float alpha = job->lobe_roughness * job->lobe_roughness, alpha2 = alpha * alpha;
    const float most_exponent = alpha2 > 0.6f ? 1.0f : 2.0f / (alpha2 > 1e-6f ? alpha2 : 1e-6f) - 2.0f; /* as in shade.c */
    vm lobes = vi_zero();
    for (uint32_t j = 0; j < p->rows; j++) {
        uint32_t y = p->y0 + j * n;
        size_t row = (size_t)y * g->stride;
        vf fy = vf_set1((float)y), base[3], dir[3];
        for (int k = 0; k < 3; k++) {
            base[k] = vf_set1(rays->base[k]) + fy * vf_set1(rays->base_dy[k]);
            dir[k] = vf_set1(rays->dir[k]) + fy * vf_set1(rays->dir_dy[k]);
        }
        for (uint32_t i = 0; i < p->lanes; i += VW) {
            uint32_t at = j * p->lanes + i;
            vm inside = vm_first((int32_t)p->columns - (int32_t)i);
            /* lanes past the end read the block's first column */
            vi x = vi_set1((int32_t)p->x0) + (inside & ((vi_iota() + vi_set1((int32_t)i)) * vi_set1((int32_t)n)));
            vf fx = vf_from_int(x);
            const vf depth = vf_from_bits(vi_load(batch->words[0][p->phase_x] + at));
            const vi normal = vi_load(batch->words[1][p->phase_x] + at), word = vi_load(batch->words[2][p->phase_x] + at);
            vf nx, ny, nz, q[3];
            es_unpack_normal_v(normal, &nx, &ny, &nz);
            vm seen = inside & vm_gt(depth, zero);
            for (int k = 0; k < 3; k++) {
                vf d = dir[k] + fx * vf_set1(rays->dir_dx[k]);
                q[k] = (base[k] + fx * vf_set1(rays->base_dx[k])) + depth * d;
            }
            for (int k = 0; k < 3 && rays->found[0]; k++) q[k] = vf_and(seen, vf_gather(rays->found[k] + (size_t)y * rays->stride, x));
            vf_store(batch->px + at, q[0]);
            vf_store(batch->py + at, q[1]);
            vf_store(batch->pz + at, q[2]);
            vf_store(batch->nx + at, vf_and(seen, nx));
            vf_store(batch->ny + at, vf_and(seen, ny));
            vf_store(batch->nz + at, vf_and(seen, nz));
            for (int k = 0; k < 3; k++) vf_store(batch->e[k] + at, zero);
            if (job->visibility || job->near) ray_origins(g->geometric_normal + row, x, q, job->visibility ? job->visibility->offset : job->near->offset, batch, at);
            if (job->repair) {
                vf t[3];
                es_unpack_normal_v(vi_gather(g->geometric_normal + row, x), &t[0], &t[1], &t[2]);
                const es_screen_pixel_v s = es_screen_pixel_at_v(job->repair, q, t);
                const vf numbers[9] = {s.x, s.y, s.depth, s.nv, s.nx, s.ny, s.vv, s.vx, s.vy};
                for (int k = 0; k < 9; k++) vf_store(batch->screen[k] + at, numbers[k]);
            }
            vi index = morton(x, y);
            if (job->sampled) vf_store(batch->choice + at, spread_number(job, index, 0x9e3779b9u, 3518319155u));
            if (job->near) {
                vf_store(batch->direction[0] + at, spread_number(job, index, 0x85ebca6bu, 2882110345u));
                vf_store(batch->direction[1] + at, spread_number(job, index, 0xc2b2ae35u, 2360945575u));
            }
            batch->wide[at / VW] = false;
            if (!with_lobes) continue;
            if (vm_all(~seen | es_surface_word_is_diffuse_v(word))) {
                batch->lobed[at / VW] = false; /* nor is anything read of what follows, but these */
                for (int k = 0; k < 3; k++) vf_store(batch->s[k] + at, zero);
                continue;
            }
            vf v[3];
            for (int k = 0; k < 3; k++) v[k] = rays->orthographic ? vf_set1(-rays->dir[k]) : rays->found[0] ? vf_neg(vf_and(seen, vf_gather(rays->along[k] + (size_t)y * rays->stride, x))) : vf_set1(rays->base[k]) - q[k];
            vf s = vf_set1(1.0f) / vf_sqrt(vf_max(v[0] * v[0] + v[1] * v[1] + v[2] * v[2], vf_set1(1e-30f))); /* unseen pixels lie in the eye */
            for (int k = 0; k < 3; k++) v[k] = v[k] * s;
            es_lift_to_horizon_v(nx, ny, nz, &v[0], &v[1], &v[2]);
            vf_store(batch->vx + at, vf_and(seen, v[0]));
            vf_store(batch->vy + at, vf_and(seen, v[1]));
            vf_store(batch->vz + at, vf_and(seen, v[2]));
            es_surface_v surface = es_surface_of_gbuffer_v(vi_gather(g->albedo_rg + row, x), vi_gather(g->albedo_b + row, x), word);
            vm lobed = vi_zero();
            for (int k = 0; k < 3; k++) {
                lobed |= seen & vm_gt(surface.specular[k], zero);
                vf_store(batch->f0[k] + at, surface.specular[k]);
                vf_store(batch->s[k] + at, zero);
            }
            batch->wide[at / VW] = job->wide && vm_any(lobed) && !vm_any(lobed & es_surface_has_lobe_v(&surface));
            if (batch->wide[at / VW]) lobed = vi_zero();
            lobes |= lobed;
            batch->lobed[at / VW] = vm_any(lobed);
            batch->edited[at / VW] = job->edited[0] && batch->lobed[at / VW] && load_edited(job, y, x, batch, at);
            vm phong = vi_eq(surface.model, vi_set1(ES_SURFACE_PHONG));
            vf_store(batch->roughness + at, vf_select(phong, vf_min(surface.roughness, vf_set1(most_exponent)), vf_max(surface.roughness, vf_set1(job->lobe_roughness))));
            vi_store(batch->model + at, surface.model);
        }
    }
    *any_lobe = vm_any(lobes);
}

/* What a pixel's lobe reflects of light from -w (unit), and what its interface lets through to the diffuse part. */
VINL void reflect_light(const es_shade_batch* batch, uint32_t i, vf wx, vf wy, vf wz, vf* pass, vf lobe[3])
{
    const es_surface_v surface = {.specular = {vf_load(batch->f0[0] + i), vf_load(batch->f0[1] + i), vf_load(batch->f0[2] + i)}, .roughness = vf_load(batch->roughness + i), .model = vi_load(batch->model + i)};
    const vf n[3] = {vf_load(batch->nx + i), vf_load(batch->ny + i), vf_load(batch->nz + i)}, l[3] = {vf_neg(wx), vf_neg(wy), vf_neg(wz)}, v[3] = {vf_load(batch->vx + i), vf_load(batch->vy + i), vf_load(batch->vz + i)};
    es_surface_parts_v(&surface, n[0], n[1], n[2], l[0], l[1], l[2], v[0], v[1], v[2], pass, lobe);
    if (!batch->edited[i / VW]) return;
    const vf e[3] = {vf_load(batch->turned[0] + i), vf_load(batch->turned[1] + i), vf_load(batch->turned[2] + i)};
    es_edited_lobe_v(&surface, n, l, v, e, lobe);
}

/* The share of light from `-d` (unit times r) that screen space leaves of what the map lets through. `cosine`: at the pixel. */
static __attribute__((noinline)) vf repaired(const es_shade_job* job, const es_shade_batch* batch, uint32_t i, const vf d[3], vf r, vf cosine)
{
    es_screen_pixel_v s;
    vf* const numbers[9] = {&s.x, &s.y, &s.depth, &s.nv, &s.nx, &s.ny, &s.vv, &s.vx, &s.vy};
    for (int k = 0; k < 9; k++) *numbers[k] = vf_load(batch->screen[k] + i);
    const vf inverse = vf_set1(-1.0f) / r, towards[3] = {d[0] * inverse, d[1] * inverse, d[2] * inverse};
    vf length = vf_set1(job->bias) + vf_set1(job->slope_bias) / vf_max(cosine, vf_set1(0.02f));
    length = vf_max(vf_min(vf_min(length, vf_set1(job->repair_most)), r * vf_set1(0.5f)), vf_set1(1e-6f));
    return es_screen_segment_share_v(job->repair, &s, towards, length, job->repair_samples);
}

enum shadow { NO_SHADOW, SHADOW_BY_MAP, SHADOW_BY_RAYS };

enum which { ALL_PIXELS, PIXELS_WITH_LOBES };

/* The four switches are constants at every call. */
VINL void apply_light(const es_shade_job* job, const es_shade_light* light, const uint16_t* map, es_shade_batch* batch, uint32_t lanes, enum shadow shadow, bool glossy_light, bool lobes, enum which which)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const vf ox = vf_set1(light->position[0]), oy = vf_set1(light->position[1]), oz = vf_set1(light->position[2]);
    const vf nx = vf_set1(light->normal[0]), ny = vf_set1(light->normal[1]), nz = vf_set1(light->normal[2]);
    const vf tx = vf_set1(light->tangent[0]), ty = vf_set1(light->tangent[1]), tz = vf_set1(light->tangent[2]);
    const vf bx = vf_set1(light->bitangent[0]), by = vf_set1(light->bitangent[1]), bz = vf_set1(light->bitangent[2]);
    const vf red = vf_set1(light->color[0]), green = vf_set1(light->color[1]), blue = vf_set1(light->color[2]);
    const vf bound = vf_set1(job->geometry_bound), spread = vf_set1(light->spread);
    const vf half = vf_set1(0.5f * (float)job->map_size), last = vf_set1((float)job->map_size - 0.5f);
    const vf depth_scale = vf_set1((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance);
    const vf bias = vf_set1(job->bias * ((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance)), slope_bias = vf_set1(job->slope_bias * ((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance));
    const vi size = vi_set1((int32_t)job->map_size);

    for (uint32_t i = 0; i < lanes; i += VW) {
        if (which == PIXELS_WITH_LOBES && !batch->lobed[i / VW]) continue;
        vf dx = vf_load(batch->px + i) - ox, dy = vf_load(batch->py + i) - oy, dz = vf_load(batch->pz + i) - oz;
        vf qz = dx * nx + dy * ny + dz * nz;
        vf pixel_cos = dx * vf_load(batch->nx + i) + dy * vf_load(batch->ny + i) + dz * vf_load(batch->nz + i); /* times -r */
        vm lit = vm_gt(qz, zero) & vm_lt(pixel_cos, zero);
        if (shadow == SHADOW_BY_RAYS) lit &= vi_load(batch->visible + i);
        if (!vm_any(lit)) continue;
        vf r2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(NEAREST2));
        vf r = vf_sqrt(r2);
        if (shadow == SHADOW_BY_MAP) {
            vf qx = dx * tx + dy * ty + dz * tz, qy = dx * bx + dy * by + dz * bz;
            /* |u|, |v| <= 1 up to rounding; what lies behind the light reads a texel of this side */
            vf s = half / (r + vf_max(qz, zero));
            vi x = vi_truncate(vf_max(vf_min(qx * s + half, last), zero)), y = vi_truncate(vf_max(vf_min(qy * s + half, last), zero));
            vf depth = vf_from_int(vi_gather16(map, y * size + x));
            /* r - bias - slope_bias / cos <= depth, times r cos */
            lit &= vm_le((r * depth_scale - bias) * vf_neg(pixel_cos) - slope_bias * r, depth * vf_neg(pixel_cos));
        }
        vf g = vf_and(lit, vf_min(vf_neg(qz * pixel_cos) / (r2 * (r2 + spread)), bound));
        if (shadow == SHADOW_BY_MAP && job->repair && vm_any(lit)) {
            const vf d[3] = {dx, dy, dz};
            g = g * repaired(job, batch, i, d, r, vf_neg(pixel_cos) / r);
        }
        /* without F0 a lobe is 0 and lets everything pass: the same bits for less */
        const bool lobed = lobes && batch->lobed[i / VW];
        if (!glossy_light && !lobed) {
            vf_store(batch->e[0] + i, vf_load(batch->e[0] + i) + g * red);
            vf_store(batch->e[1] + i, vf_load(batch->e[1] + i) + g * green);
            vf_store(batch->e[2] + i, vf_load(batch->e[2] + i) + g * blue);
            continue;
        }
        if (!vm_any(lit)) continue;
        vf inverse = one / r;
        vf wx = dx * inverse, wy = dy * inverse, wz = dz * inverse;
        vf sent[3] = {red, green, blue};
        if (glossy_light) {
            es_surface_v surface = {.specular = {vf_set1(light->specular_color[0]), vf_set1(light->specular_color[1]), vf_set1(light->specular_color[2])},
                .roughness = vf_set1(light->roughness), .model = vi_set1((int32_t)light->model)};
            vf pass, lobe[3];
            es_surface_parts_v(&surface, nx, ny, nz, vf_set1(light->incident[0]), vf_set1(light->incident[1]), vf_set1(light->incident[2]), wx, wy, wz, &pass, lobe);
            for (int k = 0; k < 3; k++) sent[k] = sent[k] * pass + vf_set1(light->power[k]) * lobe[k];
        }
        vf pass = one;
        if (lobed) {
            vf lobe[3];
            reflect_light(batch, i, wx, wy, wz, &pass, lobe);
            for (int k = 0; k < 3; k++) vf_store(batch->s[k] + i, vf_load(batch->s[k] + i) + vf_and(lit, g * sent[k] * lobe[k]));
        }
        for (int k = 0; k < 3; k++) vf_store(batch->e[k] + i, vf_load(batch->e[k] + i) + vf_and(lit, g * sent[k] * pass));
    }
}

/* Diffuse light, diffuse pixels: nearly all of the work, so in three short loops over a stretch of the batch. The first lists the vectors
 * the light can reach, without a branch; the second computes geometry and place in the map, the third looks up and sums. In one
 * loop the chain of square root, division, look-up and comparison is longer than what a processor keeps in flight. */
enum { STRETCH = 512 };

VINL void apply_diffuse(const es_shade_job* job, const es_shade_light* light, const uint16_t* map, const uint16_t* next_map, es_shade_batch* batch, uint32_t lanes, bool shadowed, bool but_lobes)
{
    const vf zero = vf_zero();
    const vf ox = vf_set1(light->position[0]), oy = vf_set1(light->position[1]), oz = vf_set1(light->position[2]);
    const vf nx = vf_set1(light->normal[0]), ny = vf_set1(light->normal[1]), nz = vf_set1(light->normal[2]);
    const vf tx = vf_set1(light->tangent[0]), ty = vf_set1(light->tangent[1]), tz = vf_set1(light->tangent[2]);
    const vf bx = vf_set1(light->bitangent[0]), by = vf_set1(light->bitangent[1]), bz = vf_set1(light->bitangent[2]);
    const vf red = vf_set1(light->color[0]), green = vf_set1(light->color[1]), blue = vf_set1(light->color[2]);
    const vf bound = vf_set1(job->geometry_bound), spread = vf_set1(light->spread);
    const vf half = vf_set1(0.5f * (float)job->map_size), last = vf_set1((float)job->map_size - 0.5f);
    const vf depth_scale = vf_set1((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance);
    const vf bias = vf_set1(job->bias * ((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance)), slope_bias = vf_set1(job->slope_bias * ((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance));
    const vi size = vi_set1((int32_t)job->map_size);
    uint32_t listed[STRETCH / VW + 1];
    float geometry[STRETCH], nearest[STRETCH], cosine[STRETCH];
    int32_t place[STRETCH];
    /* the next light's map comes into the second-level cache meanwhile, a line for each vector of the batch */
    const uint32_t lines = (uint32_t)(((size_t)job->map_size * job->map_size * sizeof *map + 63) / 64);

    for (uint32_t begin = 0; begin < lanes; begin += STRETCH) {
        const uint32_t end = lanes - begin < STRETCH ? lanes : begin + STRETCH;
        uint32_t count = 0;
        for (uint32_t i = begin; i < end; i += VW) {
            if (shadowed && i / VW < lines) __builtin_prefetch(next_map + (size_t)(i / VW) * 32, 0, 2);
            vf dx = vf_load(batch->px + i) - ox, dy = vf_load(batch->py + i) - oy, dz = vf_load(batch->pz + i) - oz;
            vf qz = dx * nx + dy * ny + dz * nz;
            vf pixel_cos = dx * vf_load(batch->nx + i) + dy * vf_load(batch->ny + i) + dz * vf_load(batch->nz + i); /* times -r */
            listed[count] = i;
            count += vm_any(vm_gt(qz, zero) & vm_lt(pixel_cos, zero)) && !(but_lobes && batch->lobed[i / VW]);
        }
        for (uint32_t k = 0; k < count; k++) {
            const uint32_t i = listed[k];
            vf dx = vf_load(batch->px + i) - ox, dy = vf_load(batch->py + i) - oy, dz = vf_load(batch->pz + i) - oz;
            vf qz = dx * nx + dy * ny + dz * nz;
            vf pixel_cos = dx * vf_load(batch->nx + i) + dy * vf_load(batch->ny + i) + dz * vf_load(batch->nz + i);
            vm lit = vm_gt(qz, zero) & vm_lt(pixel_cos, zero);
            vf r2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(NEAREST2));
            vf_store(geometry + k * VW, vf_and(lit, vf_min(vf_neg(qz * pixel_cos) / (r2 * (r2 + spread)), bound)));
            if (!shadowed) continue;
            vf r = vf_sqrt(r2);
            vf qx = dx * tx + dy * ty + dz * tz, qy = dx * bx + dy * by + dz * bz;
            /* |u|, |v| <= 1 up to rounding; what lies behind the light reads a texel of this side */
            vf s = half / (r + vf_max(qz, zero));
            vi x = vi_truncate(vf_max(vf_min(qx * s + half, last), zero)), y = vi_truncate(vf_max(vf_min(qy * s + half, last), zero));
            vi_store(place + k * VW, y * size + x);
            /* r - bias - slope_bias / cos <= depth, times r cos, which is what pixel_cos holds with its sign turned */
            vf facing = vf_neg(pixel_cos);
            vf_store(cosine + k * VW, facing);
            vf_store(nearest + k * VW, (r * depth_scale - bias) * facing - slope_bias * r);
        }
        for (uint32_t k = 0; k < count; k++) {
            const uint32_t i = listed[k];
            vf g = vf_load(geometry + k * VW);
            if (shadowed) {
                vf depth = vf_from_int(vi_gather16_at(map, place + k * VW));
                g = vf_and(vm_le(vf_load(nearest + k * VW), depth * vf_load(cosine + k * VW)), g);
                if (job->repair && vm_any(vm_gt(g, zero))) {
                    const vf d[3] = {vf_load(batch->px + i) - ox, vf_load(batch->py + i) - oy, vf_load(batch->pz + i) - oz};
                    const vf r = vf_sqrt(vf_max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], vf_set1(NEAREST2)));
                    g = g * repaired(job, batch, i, d, r, vf_load(cosine + k * VW) / r);
                }
            }
            vf_store(batch->e[0] + i, vf_load(batch->e[0] + i) + g * red);
            vf_store(batch->e[1] + i, vf_load(batch->e[1] + i) + g * green);
            vf_store(batch->e[2] + i, vf_load(batch->e[2] + i) + g * blue);
        }
    }
}

/* Light from infinitely far away. No distance is found and nothing divided: one loop does. */
VINL void apply_parallel(const es_shade_job* job, const es_shade_light* light, const uint16_t* map, es_shade_batch* batch, uint32_t lanes, enum shadow shadow, bool lobes)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const vf ox = vf_set1(light->position[0]), oy = vf_set1(light->position[1]), oz = vf_set1(light->position[2]);
    const vf nx = vf_set1(light->normal[0]), ny = vf_set1(light->normal[1]), nz = vf_set1(light->normal[2]);
    const vf tx = vf_set1(light->tangent[0]), ty = vf_set1(light->tangent[1]), tz = vf_set1(light->tangent[2]);
    const vf bx = vf_set1(light->bitangent[0]), by = vf_set1(light->bitangent[1]), bz = vf_set1(light->bitangent[2]);
    const vf sent[3] = {vf_set1(light->color[0]), vf_set1(light->color[1]), vf_set1(light->color[2])};
    const vf half = vf_set1(0.5f * (float)job->map_size), last = vf_set1((float)job->map_size - 0.5f), step = vf_set1((float)job->map_size / job->far_distance);
    const vf depth_scale = vf_set1((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance);
    const vf bias = vf_set1(job->bias * ((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance)), slope_bias = vf_set1(job->slope_bias * ((float)ES_PARABOLIC_DEPTH_MAX / job->far_distance));
    const vi size = vi_set1((int32_t)job->map_size);
    for (uint32_t i = 0; i < lanes; i += VW) {
        vf cosine = vf_neg(nx * vf_load(batch->nx + i) + ny * vf_load(batch->ny + i) + nz * vf_load(batch->nz + i));
        vm lit = vm_gt(cosine, zero);
        if (shadow == SHADOW_BY_RAYS) lit &= vi_load(batch->visible + i);
        if (!vm_any(lit)) continue;
        if (shadow == SHADOW_BY_MAP) {
            vf dx = vf_load(batch->px + i) - ox, dy = vf_load(batch->py + i) - oy, dz = vf_load(batch->pz + i) - oz;
            vf qx = dx * tx + dy * ty + dz * tz, qy = dx * bx + dy * by + dz * bz, qz = dx * nx + dy * ny + dz * nz;
            vi x = vi_truncate(vf_max(vf_min(qx * step + half, last), zero)), y = vi_truncate(vf_max(vf_min(qy * step + half, last), zero));
            vf depth = vf_from_int(vi_gather16(map, y * size + x));
            lit &= vm_le((qz * depth_scale - bias) * cosine - slope_bias, depth * cosine);
        }
        const vf g = vf_and(lit, cosine);
        vf pass = one;
        if (lobes && batch->lobed[i / VW]) {
            if (!vm_any(lit)) continue;
            vf lobe[3];
            reflect_light(batch, i, nx, ny, nz, &pass, lobe);
            for (int k = 0; k < 3; k++) vf_store(batch->s[k] + i, vf_load(batch->s[k] + i) + vf_and(lit, g * sent[k] * lobe[k]));
            for (int k = 0; k < 3; k++) vf_store(batch->e[k] + i, vf_load(batch->e[k] + i) + vf_and(lit, g * sent[k] * pass));
            continue;
        }
        for (int k = 0; k < 3; k++) vf_store(batch->e[k] + i, vf_load(batch->e[k] + i) + g * sent[k]);
    }
}

static void apply_from_infinity(const es_shade_job* job, const es_shade_light* light, uint32_t vpl, const uint16_t* map, es_shade_batch* batch, uint32_t lanes, bool lobes)
{
    if (job->visibility) job->visibility->test(job->visibility, vpl, batch, lanes);
    if (job->visibility && lobes) apply_parallel(job, light, NULL, batch, lanes, SHADOW_BY_RAYS, true);
    else if (job->visibility) apply_parallel(job, light, NULL, batch, lanes, SHADOW_BY_RAYS, false);
    else if (map && lobes) apply_parallel(job, light, map, batch, lanes, SHADOW_BY_MAP, true);
    else if (map) apply_parallel(job, light, map, batch, lanes, SHADOW_BY_MAP, false);
    else if (lobes) apply_parallel(job, light, NULL, batch, lanes, NO_SHADOW, true);
    else apply_parallel(job, light, NULL, batch, lanes, NO_SHADOW, false);
}

/* ---- sampled lights -------------------------------------------------------------------------------------------------- */

/* What a light would send to eight pixels, as luminance: G times its weight. */
VINL vf light_weight(const es_shade_light* light, const vf p[3], const vf n[3], vf bound)
{
    vf dx = p[0] - vf_set1(light->position[0]), dy = p[1] - vf_set1(light->position[1]), dz = p[2] - vf_set1(light->position[2]);
    vf qz = dx * vf_set1(light->normal[0]) + dy * vf_set1(light->normal[1]) + dz * vf_set1(light->normal[2]);
    vf pixel_cos = dx * n[0] + dy * n[1] + dz * n[2]; /* times -r */
    vm lit = vm_gt(qz, vf_zero()) & vm_lt(pixel_cos, vf_zero());
    vf r2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(NEAREST2));
    return vf_and(lit, vf_min(vf_neg(qz * pixel_cos) / (r2 * (r2 + vf_set1(light->spread))), bound) * vf_set1(light->weight));
}

enum { KEPT_WEIGHTS = 64 };

/* One light of the phase for each pixel. The weights of the first KEPT_WEIGHTS lights are kept, the others are computed twice. */
static void choose_lights(const es_shade_job* job, const es_shade_light* lights, uint32_t phase, es_shade_batch* batch, uint32_t lanes)
{
    const uint32_t step = job->interleave * job->interleave, count = phase < job->vpl_count ? (job->vpl_count - phase + step - 1) / step : 0;
    const vf zero = vf_zero(), bound = vf_set1(job->geometry_bound);
    const vi none = vi_set1(-1);
    for (uint32_t i = 0; i < lanes; i += VW) {
        const vf p[3] = {vf_load(batch->px + i), vf_load(batch->py + i), vf_load(batch->pz + i)}, n[3] = {vf_load(batch->nx + i), vf_load(batch->ny + i), vf_load(batch->nz + i)};
        vf kept[KEPT_WEIGHTS], total = zero;
        for (uint32_t k = 0; k < count; k++) {
            vf weight = light_weight(&lights[phase + k * step], p, n, bound);
            if (k < KEPT_WEIGHTS) kept[k] = weight;
            total = total + weight;
        }
        vi light = none, record = none;
        vf share = zero;
        if (vm_any(vm_gt(total, zero))) {
            vf threshold = vf_load(batch->choice + i) * total, sum = zero, weight = vf_set1(1.0f);
            vm open = vm_gt(total, zero);
            for (uint32_t k = 0; k < count && vm_any(open); k++) {
                const es_shade_light* l = &lights[phase + k * step];
                vf w = k < KEPT_WEIGHTS ? kept[k] : light_weight(l, p, n, bound);
                sum = sum + w;
                vm here = open & vm_gt(sum, threshold) & vm_gt(w, zero);
                light = vi_select(here, vi_set1((int32_t)(phase + k * step)), light);
                record = vi_select(here, vi_set1((int32_t)l->record), record);
                weight = vf_select(here, vf_set1(l->weight), weight);
                open &= ~here;
            }
            share = vf_and(~vi_eq(light, none), total / weight);
        }
        vi_store(batch->light + i, light);
        vi_store(batch->chosen + i, record);
        vf_store(batch->share + i, share);
    }
}

enum { LIGHT_WORDS = sizeof(es_shade_light) / sizeof(float) };
_Static_assert(sizeof(es_shade_light) % sizeof(float) == 0, "lights are gathered word by word");

/* A field of each pixel's own light: `field` is the first light's. */
VINL void gather_vector(const float field[3], vi at, vf out[3])
{
    for (int k = 0; k < 3; k++) out[k] = vf_gather(field + k, at);
}

static void apply_chosen(const es_shade_job* job, const es_shade_light* lights, es_shade_batch* batch, uint32_t lanes, bool lobes)
{
    for (uint32_t i = 0; i < lanes; i += VW) {
        vm lit = vi_load(batch->visible + i) & ~vi_eq(vi_load(batch->chosen + i), vi_set1(-1));
        if (!vm_any(lit)) continue;
        const vi at = (vi_load(batch->light + i) & lit) * vi_set1(LIGHT_WORDS);
        vf share = vf_and(lit, vf_load(batch->share + i)), sent[3];
        gather_vector(lights->color, at, sent);
        if (!lobes) {
            for (int k = 0; k < 3; k++) vf_store(batch->e[k] + i, share * sent[k]);
            continue;
        }
        vf p[3], n[3], w[3], pass = vf_set1(1.0f), lobe[3];
        gather_vector(lights->position, at, p);
        w[0] = vf_load(batch->px + i) - p[0];
        w[1] = vf_load(batch->py + i) - p[1];
        w[2] = vf_load(batch->pz + i) - p[2];
        vf inverse = vf_set1(1.0f) / vf_sqrt(vf_max(w[0] * w[0] + w[1] * w[1] + w[2] * w[2], vf_set1(NEAREST2)));
        for (int k = 0; k < 3; k++) w[k] = w[k] * inverse;
        vi flags = vi_gather((const char*)lights + offsetof(es_shade_light, glossy), at) & vi_set1(0xff);
        vm glossy = lit & ~vi_eq(flags, vi_zero());
        if (vm_any(glossy)) {
            es_surface_v surface = {.roughness = vf_gather(&lights->roughness, at), .model = vi_gather(&lights->model, at)};
            vf incident[3], power[3];
            gather_vector(lights->specular_color, at, surface.specular);
            gather_vector(lights->incident, at, incident);
            gather_vector(lights->power, at, power);
            gather_vector(lights->normal, at, n);
            es_surface_parts_v(&surface, n[0], n[1], n[2], incident[0], incident[1], incident[2], w[0], w[1], w[2], &pass, lobe);
            for (int k = 0; k < 3; k++) sent[k] = vf_select(glossy, sent[k] * pass + power[k] * lobe[k], sent[k]);
            pass = vf_set1(1.0f);
        }
        if (batch->lobed[i / VW]) {
            reflect_light(batch, i, w[0], w[1], w[2], &pass, lobe);
            for (int k = 0; k < 3; k++) vf_store(batch->s[k] + i, vf_and(lit, share * sent[k] * lobe[k]));
        }
        for (int k = 0; k < 3; k++) vf_store(batch->e[k] + i, vf_and(lit, share * sent[k] * pass));
    }
}

static void apply_traced(const es_shade_job* job, const es_shade_light* light, uint32_t vpl, es_shade_batch* batch, uint32_t lanes, bool lobes)
{
    job->visibility->test(job->visibility, vpl, batch, lanes);
    if (lobes && light->glossy) apply_light(job, light, NULL, batch, lanes, SHADOW_BY_RAYS, true, true, ALL_PIXELS);
    else if (lobes) apply_light(job, light, NULL, batch, lanes, SHADOW_BY_RAYS, false, true, ALL_PIXELS);
    else if (light->glossy) apply_light(job, light, NULL, batch, lanes, SHADOW_BY_RAYS, true, false, ALL_PIXELS);
    else apply_light(job, light, NULL, batch, lanes, SHADOW_BY_RAYS, false, false, ALL_PIXELS);
}

static void scatter(const es_gbuffer* g, const lanes_of_phase* p, uint32_t n, float (*from)[ES_SHADE_LANES], float* const to[3])
{
    for (uint32_t j = 0; j < p->rows; j++) {
        size_t row = (size_t)(p->y0 + j * n) * g->stride + p->x0;
        for (int k = 0; k < 3; k++) {
            const float* source = from[k] + j * p->lanes;
            float* result = to[k] + row;
            for (uint32_t i = 0; i < p->columns; i++) result[(size_t)i * n] = source[i];
        }
    }
}

/* Where planes of specular radiance may be lit, bit 1 says whether they were before this block began: zeros are not written over zeros. */
static uint8_t* lit_at(const es_shade_job* job, uint32_t x, uint32_t y) { return job->lit + (size_t)y * es_lit_chunks(job->gbuffer->stride) + x / ES_LIT_COLUMNS; }

static void begin_lit(const es_shade_job* job, const es_shade_block* block)
{
    const uint32_t n = job->interleave, end = es_lit_chunks(job->gbuffer->stride), first = block->column * n / ES_LIT_COLUMNS;
    for (uint32_t y = block->phase_y + block->row * n; y < job->gbuffer->height && y < (block->row + block->rows) * n; y += n)
        for (uint32_t c = first; c < end && c < first + ES_SHADE_COLUMNS * n / ES_LIT_COLUMNS; c++) {
            uint8_t* lit = lit_at(job, c * ES_LIT_COLUMNS, y);
            *lit = (uint8_t)((*lit & 1) << 1);
        }
}

static void scatter_lobes(const es_shade_job* job, const lanes_of_phase* p, const es_shade_batch* batch)
{
    const uint32_t n = job->interleave;
    for (uint32_t j = 0; j < p->rows; j++) {
        const uint32_t y = p->y0 + j * n;
        const size_t row = (size_t)y * job->gbuffer->stride + p->x0;
        for (uint32_t i = 0; i < p->columns; i += VW) {
            const uint32_t end = p->columns - i < VW ? p->columns : i + VW, at = j * p->lanes;
            uint8_t *first = lit_at(job, p->x0 + i * n, y), *last = lit_at(job, p->x0 + (end - 1) * n, y);
            if (batch->lobed[(at + i) / VW]) {
                *first |= 1;
                *last |= 1;
            } else if (!((*first | *last) & 2)) {
                continue;
            }
            for (int k = 0; k < 3; k++)
                for (uint32_t x = i; x < end; x++) job->specular[k][row + (size_t)x * n] = batch->s[k][at + x];
        }
    }
}

/* What wide lobes make of the irradiance that has come. */
static void reflect_wide(const es_shade_job* job, es_shade_batch* batch, uint32_t lanes)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), inverse_pi = vf_set1(0.318309886f);
    for (uint32_t i = 0; i < lanes; i += VW) {
        if (!batch->wide[i / VW]) continue;
        es_surface_v surface = {.specular = {vf_load(batch->f0[0] + i), vf_load(batch->f0[1] + i), vf_load(batch->f0[2] + i)},
            .roughness = vf_load(batch->roughness + i), .model = vi_load(batch->model + i)};
        const vf cosine = vf_clamp(vf_load(batch->vx + i) * vf_load(batch->nx + i) + vf_load(batch->vy + i) * vf_load(batch->ny + i) + vf_load(batch->vz + i) * vf_load(batch->nz + i), zero, one);
        const vf f90 = vf_min(vf_set1(25.0f) * vf_max(surface.specular[0], vf_max(surface.specular[1], surface.specular[2])), one), m = one - cosine, m2 = m * m;
        const vf through = (one - f90 * (vf_set1(0.04f) + vf_set1(0.96f) * (m2 * m2 * m))) * (one - f90 * vf_set1(0.04f + 0.96f / 21.0f));
        const vf pass = vf_select(vi_eq(surface.model, vi_set1(ES_SURFACE_METALLIC_ROUGHNESS)), through, one);
        vf albedo[3];
        es_lobe_albedo_v(job->wide, &surface, cosine, albedo);
        for (int k = 0; k < 3; k++) {
            const vf e = vf_load(batch->e[k] + i);
            vf_store(batch->s[k] + i, e * inverse_pi * albedo[k]);
            vf_store(batch->e[k] + i, e * pass);
        }
        batch->lobed[i / VW] = true;
    }
}

/* A phase without lights; whole_row: as are all of its row, which is not put together from phases. */
static void darken(const es_shade_job* job, const lanes_of_phase* p, es_shade_batch* batch, bool whole_row)
{
    for (int k = 0; k < 3 && !whole_row; k++) memset(batch->words[k][p->phase_x], 0, (size_t)p->lanes * p->rows * sizeof(uint32_t));
    for (uint32_t j = 0; j < p->rows && job->specular[0]; j++) {
        const size_t row = (size_t)(p->y0 + j * job->interleave) * job->gbuffer->stride + p->x0;
        for (int k = 0; k < 3; k++)
            for (uint32_t i = 0; i < p->columns; i++)
                if (!job->lit || *lit_at(job, p->x0 + i * job->interleave, p->y0 + j * job->interleave) & 2) job->specular[k][row + (size_t)i * job->interleave] = 0.0f;
    }
}

static inline const uint16_t* map_of(const es_shade_job* job, uint32_t light, size_t texels)
{
    return job->maps ? job->maps + (job->map_of ? job->map_of[light] : light) * texels : NULL;
}

static void shade_phase(const es_shade_job* job, const es_shade_light* lights, const lanes_of_phase* p, uint32_t phase, es_shade_batch* batch)
{
    const uint32_t n = job->interleave, lanes = p->lanes * p->rows;
    const size_t map_texels = (size_t)job->map_size * job->map_size;
    const uint32_t lit = job->vpl_count - job->dark_count;
    bool lobes = false;
    for (int k = 0; k < 3; k++) batch->e[k] = (float*)batch->words[k][p->phase_x];
    gather(job, p, batch, job->specular[0] != NULL, &lobes);
    if (job->sampled) {
        choose_lights(job, lights, phase, batch, lanes);
        job->visibility->test_chosen(job->visibility, batch, lanes);
        bool glossy = lobes;
        for (uint32_t v = phase; v < job->vpl_count && !glossy; v += n * n) glossy = lights[v].glossy;
        apply_chosen(job, lights, batch, lanes, glossy);
    }
    for (uint32_t v = phase; v < lit && !job->sampled; v += n * n) {
        const es_shade_light* light = &lights[v];
        const uint16_t* map = map_of(job, v, map_texels);
        const enum shadow shadow = map ? SHADOW_BY_MAP : NO_SHADOW;
        if (light->parallel) {
            apply_from_infinity(job, light, v, map, batch, lanes, lobes);
            continue;
        }
        if (job->visibility) apply_traced(job, light, v, batch, lanes, lobes);
        else if (lobes && light->glossy) apply_light(job, light, map, batch, lanes, shadow, true, true, ALL_PIXELS);
        else if (light->glossy) apply_light(job, light, map, batch, lanes, shadow, true, false, ALL_PIXELS);
        else if (map) apply_diffuse(job, light, map, v + n * n < lit ? map_of(job, v + n * n, map_texels) : map, batch, lanes, true, lobes);
        else apply_diffuse(job, light, NULL, NULL, batch, lanes, false, lobes);
        /* a batch has few pixels with lobes, if any: they are apart, so that the others keep their short loops */
        if (lobes && !job->visibility && !light->glossy) apply_light(job, light, map, batch, lanes, shadow, false, true, PIXELS_WITH_LOBES);
    }
    if (job->near) job->near->add(job->near, batch, lanes, lobes);
    if (job->wide && job->specular[0]) reflect_wide(job, batch, lanes);
    if (job->specular[0] && job->lit) scatter_lobes(job, p, batch);
    else if (job->specular[0]) scatter(job->gbuffer, p, n, batch->s, job->specular);
}

void ES_KERNEL(es_gi_shade)(const es_shade_job* job, const es_shade_light* lights, const es_shade_block* block, es_shade_batch* batch)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t n = job->interleave, x0 = block->column * n, y0 = block->phase_y + block->row * n;
    if (x0 >= g->width || y0 >= g->height) return;
    const uint32_t most = ES_SHADE_COLUMNS * n, width = g->width - x0 < most ? g->width - x0 : most; /* pixels of the block's rows */
    const uint32_t rows_left = (g->height - y0 + n - 1) / n, rows = rows_left < block->rows ? rows_left : block->rows;
    const uint32_t lanes = ((width + n - 1) / n + VW - 1) / VW * VW;
    if (job->lit) begin_lit(job, block);
    const bool any = n * block->phase_y < job->vpl_count || job->near; /* light in any phase of this row */
    for (uint32_t j = 0; j < rows && any; j++) {
        const size_t row = (size_t)(y0 + j * n) * g->stride + x0;
        es_split_row(g->depth + row, width, n, batch->words[0][0] + j * lanes, ES_SHADE_PHASE_STRIDE);
        es_split_row(g->normal + row, width, n, batch->words[1][0] + j * lanes, ES_SHADE_PHASE_STRIDE);
        es_split_row(g->surface + row, width, n, batch->words[2][0] + j * lanes, ES_SHADE_PHASE_STRIDE);
    }
    for (uint32_t phase_x = 0; phase_x < n && phase_x < width; phase_x++) {
        const lanes_of_phase p = {.x0 = x0 + phase_x, .columns = (width - phase_x + n - 1) / n, .lanes = lanes, .y0 = y0, .rows = rows, .phase_x = phase_x};
        if (phase_x + n * block->phase_y >= job->vpl_count && !job->near) darken(job, &p, batch, !any);
        else shade_phase(job, lights, &p, phase_x + n * block->phase_y, batch);
    }
    for (uint32_t j = 0; j < rows; j++)
        for (int k = 0; k < 3; k++) {
            float* row = job->irradiance[k] + (size_t)(y0 + j * n) * g->stride + x0;
            if (any) es_merge_row(batch->words[k][0] + j * lanes, ES_SHADE_PHASE_STRIDE, width, n, row);
            else memset(row, 0, width * sizeof *row);
        }
}

void ES_KERNEL(es_gi_shade_points)(const es_shade_job* job, const es_shade_light* lights, uint32_t begin, uint32_t end, es_shade_batch* batch, uint32_t lanes)
{
    const size_t map_texels = (size_t)job->map_size * job->map_size;
    for (uint32_t v = begin; v < end; v++) {
        const uint16_t* map = map_of(job, v, map_texels);
        if (lights[v].parallel) apply_from_infinity(job, &lights[v], v, map, batch, lanes, false);
        else if (lights[v].glossy) apply_light(job, &lights[v], map, batch, lanes, map ? SHADOW_BY_MAP : NO_SHADOW, true, false, ALL_PIXELS);
        else if (map) apply_diffuse(job, &lights[v], map, v + 1 < end ? map_of(job, v + 1, map_texels) : map, batch, lanes, true, false);
        else apply_diffuse(job, &lights[v], NULL, NULL, batch, lanes, false, false);
    }
}
