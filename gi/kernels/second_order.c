/* Sums over lights without shadows, and interpolation of what they come to (gi/second_order.h). */
#include "gi/kernel_table.h"
#include "gi/second_order.h"
#include "platform/simd.h"
#include "raster/pack.h"

typedef struct surface_place { vm seen; vf x, y, z, nx, ny, nz, depth; } surface_place;

VINL surface_place place_of(const es_gbuffer* g, const es_pixel_rays* r, vi column, uint32_t row, vm inside)
{
    surface_place p;
    const vi at = vi_set1((int32_t)(row * g->stride)) + (inside & column);
    const vf x = vf_from_int(column), y = vf_set1((float)row);
    const vf depth = vf_gather(g->depth, at);
    p.seen = inside & vm_gt(depth, vf_zero()) & ~vi_eq(vi_shift_right_logical(vi_gather(g->surface, at), 24), vi_set1(ES_SURFACE_UNLIT));
    p.depth = vf_and(p.seen, depth);
    es_unpack_normal_v(vi_gather(g->normal, at), &p.nx, &p.ny, &p.nz);
    p.x = (vf_set1(r->base[0]) + x * vf_set1(r->base_dx[0]) + y * vf_set1(r->base_dy[0])) + p.depth * (vf_set1(r->dir[0]) + x * vf_set1(r->dir_dx[0]) + y * vf_set1(r->dir_dy[0]));
    p.y = (vf_set1(r->base[1]) + x * vf_set1(r->base_dx[1]) + y * vf_set1(r->base_dy[1])) + p.depth * (vf_set1(r->dir[1]) + x * vf_set1(r->dir_dx[1]) + y * vf_set1(r->dir_dy[1]));
    p.z = (vf_set1(r->base[2]) + x * vf_set1(r->base_dx[2]) + y * vf_set1(r->base_dy[2])) + p.depth * (vf_set1(r->dir[2]) + x * vf_set1(r->dir_dx[2]) + y * vf_set1(r->dir_dy[2]));
    if (r->found[0]) {
        const vi place = vi_set1((int32_t)(row * r->stride)) + (inside & column);
        p.x = vf_and(p.seen, vf_gather(r->found[0], place));
        p.y = vf_and(p.seen, vf_gather(r->found[1], place));
        p.z = vf_and(p.seen, vf_gather(r->found[2], place));
    }
    return p;
}

VINL vm mask_of(uint32_t bits) { return ~vi_eq(vi_set1((int32_t)bits) & (vi_set1(1) << vi_iota()), vi_zero()); }

/* One of two eights: a light's ten numbers are broadcast once for both. */
VINL void add_light(const es_open_light* l, vf bound, const surface_place* p, vf e[3])
{
    const vf zero = vf_zero();
    const vf dx = p->x - vf_set1(l->position[0]), dy = p->y - vf_set1(l->position[1]), dz = p->z - vf_set1(l->position[2]);
    const vf per = vf_set1(1.0f) / vf_max(dx * dx + dy * dy + dz * dz + vf_set1(l->softening), vf_set1(1e-18f));
    const vf sent = vf_max(dx * vf_set1(l->normal[0]) + dy * vf_set1(l->normal[1]) + dz * vf_set1(l->normal[2]), zero);
    const vf received = vf_max(vf_neg(dx * p->nx + dy * p->ny + dz * p->nz), zero);
    const vf geometry = vf_min((sent * per) * (received * per), bound);
    for (int k = 0; k < 3; k++) e[k] = e[k] + geometry * vf_set1(l->color[k]);
}

static void shade_pair(const es_open_job* job, const surface_place p[2], vf e[2][3])
{
    const vf bound = vf_set1(job->bound), zero = vf_zero();
    vf a[3] = {zero, zero, zero}, b[3] = {zero, zero, zero};
    for (uint32_t i = 0; i < job->light_count; i++) {
        add_light(&job->lights[i], bound, &p[0], a);
        add_light(&job->lights[i], bound, &p[1], b);
    }
    for (int k = 0; k < 3; k++) {
        e[0][k] = vf_and(p[0].seen, a[k]);
        e[1][k] = vf_and(p[1].seen, b[k]);
    }
}

void ES_KERNEL(es_gi_open_shade)(const es_open_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const vi width = vi_set1((int32_t)g->width);
    for (uint32_t y = row_begin; y < row_end; y++) {
        const uint8_t* listed = job->listed ? job->listed + (size_t)y * ((g->width + 7) / 8) : NULL;
        /* eights with work, two at a time */
        uint32_t columns[2], count = 0;
        for (uint32_t x = 0; x < g->width; x += VW) {
            if (!listed || listed[x / 8]) columns[count++] = x;
            if (count < 2 && x + VW < g->width) continue;
            if (!count) continue;
            surface_place p[2];
            vf e[2][3];
            for (uint32_t i = 0; i < 2; i++) {
                const uint32_t from = columns[i < count ? i : 0];
                const vi column = vi_set1((int32_t)from) + vi_iota();
                vm inside = vi_lt(column, width);
                if (listed) inside &= mask_of(listed[from / 8]);
                p[i] = place_of(g, &job->rays, column, y, inside);
            }
            shade_pair(job, p, e);
            for (uint32_t i = 0; i < count; i++) {
                const size_t at = (size_t)y * g->stride + columns[i];
                for (int k = 0; k < 3; k++) {
                    vf value = e[i][k];
                    if (listed) value = vf_select(mask_of(listed[columns[i] / 8]), value, vf_load(job->irradiance[k] + at));
                    vf_store(job->irradiance[k] + at, value);
                }
            }
            count = 0;
        }
    }
}

void ES_KERNEL(es_gi_open_upsample)(const es_open_upsample_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const vi width = vi_set1((int32_t)g->width), last = vi_set1((int32_t)job->half_width - 1);
    for (uint32_t y = row_begin; y < row_end; y++) {
        const uint32_t upper = y >> 1, lower = y & 1 && upper + 1 < job->half_height ? upper + 1 : upper;
        for (uint32_t x = 0; x < g->width; x += VW) {
            const vi column = vi_set1((int32_t)x) + vi_iota();
            const vm inside = vi_lt(column, width);
            const surface_place p = place_of(g, &job->rays, column, y, inside);
            vf sum[6] = {zero, zero, zero, zero, zero, zero};
            uint32_t differs = 0;
            if (vm_any(p.seen)) {
                const vi left = vi_min(column >> 1, last), right = vi_select(vi_eq(column & vi_set1(1), vi_set1(1)), vi_min(left + vi_set1(1), last), left);
                const vi columns[2] = {left, right};
                const uint32_t rows[2] = {upper, lower};
                const vf per_depth = vf_set1(10.0f) / vf_select(p.seen, p.depth, one);
                vm other = vi_zero();
                for (uint32_t j = 0; j < 2; j++)
                    for (uint32_t i = 0; i < 2; i++) {
                        const surface_place q = place_of(g, &job->rays, columns[i] << 1, rows[j] << 1, inside);
                        const vf off = vf_abs((q.x - p.x) * p.nx + (q.y - p.y) * p.ny + (q.z - p.z) * p.nz), turn = one - (p.nx * q.nx + p.ny * q.ny + p.nz * q.nz);
                        other |= ~q.seen | ~vm_lt(vf_max(turn, zero) + off * per_depth, vf_set1(job->threshold));
                        const vi at = vi_set1((int32_t)(rows[j] * job->half_stride)) + (inside & columns[i]);
                        for (uint32_t k = 0; k < job->plane_count; k++) sum[k] = sum[k] + vf_gather(job->source[k], at);
                    }
                /* one that is among them has its own: what it differs from are the others */
                const vm own = vi_eq(columns[0], columns[1]) & (rows[0] == rows[1] && !(y & 1) ? vi_eq(column & vi_set1(1), vi_zero()) : vi_zero());
                differs = vm_bits(p.seen & other & ~own);
                for (uint32_t k = 0; k < job->plane_count; k++) sum[k] = vf_and(p.seen, sum[k] * vf_set1(0.25f));
            }
            const size_t at = (size_t)y * g->stride + x;
            for (uint32_t k = 0; k < job->plane_count; k++) vf_store(job->result[k] + at, sum[k]);
            job->listed[(size_t)y * ((g->width + 7) / 8) + x / 8] = (uint8_t)differs;
        }
    }
}
