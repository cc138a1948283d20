/* Cloth and soft bodies: motion, distances, volumes, reach, contact with capsules, eight lanes at a time.
 *
 * Macklin, Müller, Chentanez, "XPBD" 2016, eq. 17 and 18 with λ = 0, for there is one iteration per substep (Macklin et al. 2019, alg. 1).
 * Places lie within 1e7 m and moves within 1e4 m, so squares stay far from overflow; lengths below 1e-12 have no direction. */
#include "sim/kernel_table.h"
#include "platform/simd.h"

/* vf_gather4 with its indices in memory: as addresses they need no way through a vector register. */
VINL void gather4(const float* base, const uint32_t* index, vf* a, vf* b, vf* c, vf* d)
{
#if defined(ES_SIMD_256)
#define ES_PAIR_(i, j) _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(base + 4 * (size_t)index[i])), _mm_loadu_ps(base + 4 * (size_t)index[j]), 1)
    __m256 r0 = ES_PAIR_(0, 4), r1 = ES_PAIR_(1, 5), r2 = ES_PAIR_(2, 6), r3 = ES_PAIR_(3, 7);
#undef ES_PAIR_
    __m256 t0 = _mm256_unpacklo_ps(r0, r1), t1 = _mm256_unpackhi_ps(r0, r1);
    __m256 t2 = _mm256_unpacklo_ps(r2, r3), t3 = _mm256_unpackhi_ps(r2, r3);
    *a = (vf)_mm256_shuffle_ps(t0, t2, 0x44);
    *b = (vf)_mm256_shuffle_ps(t0, t2, 0xee);
    *c = (vf)_mm256_shuffle_ps(t1, t3, 0x44);
    *d = (vf)_mm256_shuffle_ps(t1, t3, 0xee);
#else
    vf_gather4(base, 16, vi_load(index), a, b, c, d);
#endif
}

/* Eight records back to where vf_gather4 found them; lanes from `count` on are left alone. */
VINL void scatter4(float* base, const uint32_t* index, uint32_t count, vf a, vf b, vf c, vf d)
{
#if defined(ES_SIMD_256)
    __m256 t0 = _mm256_unpacklo_ps((__m256)a, (__m256)b), t1 = _mm256_unpackhi_ps((__m256)a, (__m256)b);
    __m256 t2 = _mm256_unpacklo_ps((__m256)c, (__m256)d), t3 = _mm256_unpackhi_ps((__m256)c, (__m256)d);
    __m256 r0 = _mm256_shuffle_ps(t0, t2, 0x44), r1 = _mm256_shuffle_ps(t0, t2, 0xee);
    __m256 r2 = _mm256_shuffle_ps(t1, t3, 0x44), r3 = _mm256_shuffle_ps(t1, t3, 0xee);
    if (count == VW) {
        _mm_storeu_ps(base + 4 * (size_t)index[0], _mm256_castps256_ps128(r0));
        _mm_storeu_ps(base + 4 * (size_t)index[1], _mm256_castps256_ps128(r1));
        _mm_storeu_ps(base + 4 * (size_t)index[2], _mm256_castps256_ps128(r2));
        _mm_storeu_ps(base + 4 * (size_t)index[3], _mm256_castps256_ps128(r3));
        _mm_storeu_ps(base + 4 * (size_t)index[4], _mm256_extractf128_ps(r0, 1));
        _mm_storeu_ps(base + 4 * (size_t)index[5], _mm256_extractf128_ps(r1, 1));
        _mm_storeu_ps(base + 4 * (size_t)index[6], _mm256_extractf128_ps(r2, 1));
        _mm_storeu_ps(base + 4 * (size_t)index[7], _mm256_extractf128_ps(r3, 1));
        return;
    }
    __m128 rows[VW] = {_mm256_castps256_ps128(r0), _mm256_castps256_ps128(r1), _mm256_castps256_ps128(r2), _mm256_castps256_ps128(r3),
        _mm256_extractf128_ps(r0, 1), _mm256_extractf128_ps(r1, 1), _mm256_extractf128_ps(r2, 1), _mm256_extractf128_ps(r3, 1)};
    for (uint32_t i = 0; i < count; i++) _mm_storeu_ps(base + 4 * (size_t)index[i], rows[i]);
#else
    for (uint32_t i = 0; i < count; i++) {
        float* p = base + 4 * (size_t)index[i];
        p[0] = a[i];
        p[1] = b[i];
        p[2] = c[i];
        p[3] = d[i];
    }
#endif
}

void ES_KERNEL(es_sim_soft_move)(const es_soft_motion* m, uint32_t begin, uint32_t end)
{
    const vf h = vf_set1(m->h), inverse_h = vf_set1(m->inverse_h), keep = vf_set1(m->keep), limit = vf_set1(m->limit), zero = vf_zero();
    const vf gx = vf_set1(m->gravity.x), gy = vf_set1(m->gravity.y), gz = vf_set1(m->gravity.z);
    for (size_t i = begin; i < end; i += VW) {
        vf x, y, z, w, vx, vy, vz, unused, ax = gx, ay = gy, az = gz;
        vf_load4(m->x + 4 * i, &x, &y, &z, &w);
        if (m->first) {
            vf_load4(m->velocity + 4 * i, &vx, &vy, &vz, &unused);
        } else {
            vf_load4(m->previous + 4 * i, &vx, &vy, &vz, &unused);
            vx = (x - vx) * inverse_h;
            vy = (y - vy) * inverse_h;
            vz = (z - vz) * inverse_h;
        }
        if (m->acceleration) {
            vf px, py, pz;
            vf_load4(m->acceleration + 4 * i, &px, &py, &pz, &unused);
            ax = ax + px;
            ay = ay + py;
            az = az + pz;
        }
        vm free = vm_gt(w, zero);
        vf_store4(m->previous + 4 * i, x, y, z, zero);
        vx = vf_and(free, vf_clamp((vx + ax * h) * keep, vf_neg(limit), limit));
        vy = vf_and(free, vf_clamp((vy + ay * h) * keep, vf_neg(limit), limit));
        vz = vf_and(free, vf_clamp((vz + az * h) * keep, vf_neg(limit), limit));
        vf_store4(m->x + 4 * i, x + vx * h, y + vy * h, z + vz * h, w);
    }
}

void ES_KERNEL(es_sim_soft_settle)(const es_soft_motion* m, uint32_t begin, uint32_t end, float* fastest)
{
    const vf inverse_h = vf_set1(m->inverse_h), limit = vf_set1(m->limit);
    vf most = vf_zero();
    for (size_t i = begin; i < end; i += VW) {
        vf x, y, z, w, vx, vy, vz, unused;
        vf_load4(m->x + 4 * i, &x, &y, &z, &w);
        vf_load4(m->previous + 4 * i, &vx, &vy, &vz, &unused);
        vx = vf_clamp((x - vx) * inverse_h, vf_neg(limit), limit);
        vy = vf_clamp((y - vy) * inverse_h, vf_neg(limit), limit);
        vz = vf_clamp((z - vz) * inverse_h, vf_neg(limit), limit);
        vf_store4(m->velocity + 4 * i, vx, vy, vz, vf_zero());
        most = vf_max(most, vx * vx + vy * vy + vz * vz);
    }
    float best = 0;
    for (int k = 0; k < VW; k++) best = best > most[k] ? best : most[k];
    *fastest = best;
}

void ES_KERNEL(es_sim_soft_links)(float* x, const es_soft_links* batches, uint32_t count, float inverse_h2)
{
    const vf tiny = vf_set1(1e-12f), scale = vf_set1(inverse_h2), one = vf_set1(1.0f);
    for (uint32_t k = 0; k < count; k++) {
        const es_soft_links* batch = &batches[k];
        vf ax, ay, az, aw, bx, by, bz, bw;
        gather4(x, batch->a, &ax, &ay, &az, &aw);
        gather4(x, batch->b, &bx, &by, &bz, &bw);
        vf dx = ax - bx, dy = ay - by, dz = az - bz;
        vf length = vf_sqrt(dx * dx + dy * dy + dz * dz), masses = aw + bw;
        vm good = vm_gt(length, tiny) & vm_gt(masses, vf_zero());
        vf divisor = length * (masses + vf_load(batch->compliance) * scale);
        vf lambda = vf_and(good, (length - vf_load(batch->rest)) / vf_select(good, divisor, one));
        vf sa = lambda * aw, sb = lambda * bw;
        scatter4(x, batch->a, batch->count, ax - sa * dx, ay - sa * dy, az - sa * dz, aw);
        scatter4(x, batch->b, batch->count, bx + sb * dx, by + sb * dy, bz + sb * dz, bw);
    }
}

void ES_KERNEL(es_sim_soft_stretch)(const float* x, const es_soft_links* batches, uint32_t count, float* ratio)
{
    const vf tiny = vf_set1(1e-12f), one = vf_set1(1.0f);
    for (uint32_t k = 0; k < count; k++) {
        const es_soft_links* batch = &batches[k];
        vf ax, ay, az, aw, bx, by, bz, bw, rest = vf_load(batch->rest);
        gather4(x, batch->a, &ax, &ay, &az, &aw);
        gather4(x, batch->b, &bx, &by, &bz, &bw);
        vf dx = ax - bx, dy = ay - by, dz = az - bz;
        vm good = vm_gt(rest, tiny);
        vf_store(ratio + (size_t)VW * k, vf_and(good, vf_sqrt(dx * dx + dy * dy + dz * dz) / vf_select(good, rest, one)));
    }
}

void ES_KERNEL(es_sim_soft_volumes)(float* x, const es_soft_volumes* batches, uint32_t count, float compliance)
{
    const vf sixth = vf_set1(1.0f / 6.0f), alpha = vf_set1(compliance), one = vf_set1(1.0f);
    for (uint32_t k = 0; k < count; k++) {
        const es_soft_volumes* batch = &batches[k];
        vf px[4], py[4], pz[4], w[4], gx[4], gy[4], gz[4];
        for (int i = 0; i < 4; i++) gather4(x, batch->corner[i], &px[i], &py[i], &pz[i], &w[i]);
        vf ex[4], ey[4], ez[4];
        for (int i = 1; i < 4; i++) {
            ex[i] = px[i] - px[0];
            ey[i] = py[i] - py[0];
            ez[i] = pz[i] - pz[0];
        }
        for (int i = 1; i < 4; i++) { /* the product of the other two edges, in turn */
            int j = i % 3 + 1, l = j % 3 + 1;
            gx[i] = (ey[j] * ez[l] - ez[j] * ey[l]) * sixth;
            gy[i] = (ez[j] * ex[l] - ex[j] * ez[l]) * sixth;
            gz[i] = (ex[j] * ey[l] - ey[j] * ex[l]) * sixth;
        }
        gx[0] = vf_neg(gx[1] + gx[2] + gx[3]);
        gy[0] = vf_neg(gy[1] + gy[2] + gy[3]);
        gz[0] = vf_neg(gz[1] + gz[2] + gz[3]);
        vf volume = gx[1] * ex[1] + gy[1] * ey[1] + gz[1] * ez[1], sum = vf_zero();
        for (int i = 0; i < 4; i++) sum = sum + w[i] * (gx[i] * gx[i] + gy[i] * gy[i] + gz[i] * gz[i]);
        vf divisor = vf_max(sum, vf_load(batch->floor)) + alpha;
        vm good = vm_gt(divisor, vf_zero());
        vf lambda = vf_and(good, (vf_load(batch->rest) - volume) / vf_select(good, divisor, one));
        for (int i = 0; i < 4; i++) {
            vf s = lambda * w[i];
            scatter4(x, batch->corner[i], batch->count, px[i] + s * gx[i], py[i] + s * gy[i], pz[i] + s * gz[i], w[i]);
        }
    }
}

void ES_KERNEL(es_sim_soft_reach)(float* positions, const es_soft_reach* job, uint32_t begin, uint32_t end)
{
    const vf share = vf_set1(job->share), one = vf_set1(1.0f);
    for (size_t i = begin; i < end; i += VW) {
        vf x, y, z, w;
        vf_load4(positions + 4 * i, &x, &y, &z, &w);
        for (int k = 0; k < 2; k++) {
            vi anchor = vi_load(job->anchor[k] + i);
            vf sx, sy, sz, ex, ey, ez, unused, reach = vf_load(job->reach[k] + i);
            vf_gather4(job->start, 16, anchor, &sx, &sy, &sz, &unused);
            vf_gather4(job->end, 16, anchor, &ex, &ey, &ez, &unused);
            sx = sx + (ex - sx) * share;
            sy = sy + (ey - sy) * share;
            sz = sz + (ez - sz) * share;
            vf dx = x - sx, dy = y - sy, dz = z - sz, squared = dx * dx + dy * dy + dz * dz;
            vm beyond = vm_gt(squared, reach * reach) & vm_gt(w, vf_zero());
            vf ratio = reach / vf_sqrt(vf_select(beyond, squared, one));
            x = vf_select(beyond, sx + dx * ratio, x);
            y = vf_select(beyond, sy + dy * ratio, y);
            z = vf_select(beyond, sz + dz * ratio, z);
        }
        vf_store4(positions + 4 * i, x, y, z, w);
    }
}

void ES_KERNEL(es_sim_soft_contact)(float* positions, const float* previous, const es_soft_surface* s, uint32_t begin, uint32_t end, float push[6])
{
    const vf one = vf_set1(1.0f), zero = vf_zero(), radius = vf_set1(s->radius), friction = vf_set1(s->friction), tiny = vf_set1(1e-12f);
    const vf ax = vf_set1(s->a.x), ay = vf_set1(s->a.y), az = vf_set1(s->a.z), lx = vf_set1(s->along.x), ly = vf_set1(s->along.y), lz = vf_set1(s->along.z);
    const vf cx = vf_set1(s->centre.x), cy = vf_set1(s->centre.y), cz = vf_set1(s->centre.z), per_length2 = vf_set1(s->inverse_length2);
    const vf tx = vf_set1(s->turned.x), ty = vf_set1(s->turned.y), tz = vf_set1(s->turned.z);
    vf sums[6] = {zero, zero, zero, zero, zero, zero};
    for (size_t i = begin; i < end; i += VW) {
        vf x, y, z, w;
        vf_load4(positions + 4 * i, &x, &y, &z, &w);
        vf dx = x - ax, dy = y - ay, dz = z - az;
        vf t = vf_clamp((dx * lx + dy * ly + dz * lz) * per_length2, zero, one);
        dx = dx - lx * t;
        dy = dy - ly * t;
        dz = dz - lz * t;
        vf squared = dx * dx + dy * dy + dz * dz;
        vm inside = vm_lt(squared, radius * radius) & vm_gt(w, zero);
        if (!vm_any(inside)) continue;
        vf length = vf_sqrt(squared);
        vm there = vm_gt(length, tiny);
        vf inverse = one / vf_select(there, length, one);
        vf nx = vf_and(there, dx * inverse), ny = vf_select(there, dy * inverse, one), nz = vf_and(there, dz * inverse);
        vf depth = radius - length;
        vf qx = x + nx * depth, qy = y + ny * depth, qz = z + nz * depth;
        vf ox, oy, oz, unused;
        vf_load4(previous + 4 * i, &ox, &oy, &oz, &unused);
        vf rx = qx - cx, ry = qy - cy, rz = qz - cz;
        /* the particle's way less the surface's, along the surface */
        vf mx = qx - ox - (vf_set1(s->moved.x) + ty * rz - tz * ry), my = qy - oy - (vf_set1(s->moved.y) + tz * rx - tx * rz);
        vf mz = qz - oz - (vf_set1(s->moved.z) + tx * ry - ty * rx), along = mx * nx + my * ny + mz * nz;
        mx = mx - nx * along;
        my = my - ny * along;
        mz = mz - nz * along;
        vf slip = vf_sqrt(mx * mx + my * my + mz * mz), held = friction * depth;
        vf share = vf_select(vm_gt(slip, held), held / vf_max(slip, tiny), one);
        qx = vf_select(inside, qx - mx * share, x);
        qy = vf_select(inside, qy - my * share, y);
        qz = vf_select(inside, qz - mz * share, z);
        vf_store4(positions + 4 * i, qx, qy, qz, w);
        vf mass = one / vf_select(inside, w, one);
        vf jx = vf_and(inside, (qx - x) * mass), jy = vf_and(inside, (qy - y) * mass), jz = vf_and(inside, (qz - z) * mass);
        sums[0] = sums[0] + jx;
        sums[1] = sums[1] + jy;
        sums[2] = sums[2] + jz;
        sums[3] = sums[3] + vf_and(inside, ry * jz - rz * jy);
        sums[4] = sums[4] + vf_and(inside, rz * jx - rx * jz);
        sums[5] = sums[5] + vf_and(inside, rx * jy - ry * jx);
    }
    for (int k = 0; k < 6; k++) push[k] += vf_sum(sums[k]);
}

/* Area vectors of particles: a third of the incident triangles', from their cross products. first_row and rows as sim/normals.h has them. */
void ES_KERNEL(es_sim_soft_air)(const es_soft_air* job, uint32_t begin, uint32_t end)
{
    const vf sixth = vf_set1(1.0f / 6.0f), one = vf_set1(1.0f), zero = vf_zero(), most = vf_set1(1e6f);
    const vf pressure = vf_set1(job->pressure), drag = vf_set1(job->drag_h), per_h = vf_set1(job->inverse_h);
    for (uint32_t block = begin; block < end; block++) {
        vf nx = zero, ny = zero, nz = zero;
        for (uint32_t row = job->first_row[block]; row < job->first_row[block + 1]; row++) {
            vf fx, fy, fz, unused;
            vf_gather4(job->faces, 16, vi_load(job->rows + (size_t)row * VW), &fx, &fy, &fz, &unused);
            nx = nx + fx;
            ny = ny + fy;
            nz = nz + fz;
        }
        nx = nx * sixth;
        ny = ny * sixth;
        nz = nz * sixth;
        vf x, y, z, w, vx, vy, vz, unused;
        vf_load4(job->x + (size_t)block * 4 * VW, &x, &y, &z, &w);
        vf_load4(job->velocity + (size_t)block * 4 * VW, &vx, &vy, &vz, &unused);
        vf area = vf_sqrt(nx * nx + ny * ny + nz * nz);
        vm good = vm_gt(area, vf_set1(1e-15f));
        vf inverse = vf_and(good, one / vf_select(good, area, one));
        vf ux = nx * inverse, uy = ny * inverse, uz = nz * inverse;
        vf relative = ux * (vf_set1(job->wind.x) - vx) + uy * (vf_set1(job->wind.y) - vy) + uz * (vf_set1(job->wind.z) - vz);
        vf c = vf_min(drag * area * w, most); /* implicit: however strong, the air cannot take a particle beyond its own speed */
        vf gain = relative * (c / (one + c)) * per_h, p = pressure * w;
        x = vf_clamp(ux * gain + p * nx, vf_neg(most), most);
        y = vf_clamp(uy * gain + p * ny, vf_neg(most), most);
        z = vf_clamp(uz * gain + p * nz, vf_neg(most), most);
        vf_store4(job->acceleration + (size_t)block * 4 * VW, x, y, z, zero);
    }
}
