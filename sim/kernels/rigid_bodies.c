/* Rigid bodies, eight at a time: forces to velocities, velocities to positions (sim/rigid/solver.h). */
#include "platform/simd.h"
#include "sim/kernel_table.h"

/* vf_load4 and vf_store4 for records of eight floats: the first half of each at p, or the second at p + 4 */
VINL void load_half(const float* p, vf* x, vf* y, vf* z, vf* w) { vf_gather4(p, 32, vi_iota(), x, y, z, w); }
VINL void store_half(float* p, vf x, vf y, vf z, vf w)
{
    float rows[4 * VW];
    vf_store4(rows, x, y, z, w);
    for (int i = 0; i < VW; i++) memcpy(p + 8 * i, rows + 4 * i, 4 * sizeof(float));
}

/* Shortens (x, y, z) to `limit`. Speeds are below 1e18 before, so that squares stay finite. */
VINL void limit_length(vf* x, vf* y, vf* z, float limit)
{
    vf squared = *x * *x + *y * *y + *z * *z;
    vm over = vm_gt(squared, vf_set1(limit * limit));
    if (!vm_any(over)) return;
    vf scale = vf_select(over, vf_set1(limit) / vf_sqrt(vf_select(over, squared, vf_set1(1.0f))), vf_set1(1.0f));
    *x *= scale;
    *y *= scale;
    *z *= scale;
}

void ES_KERNEL(es_sim_rigid_accelerate)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i += VW) {
        float *velocity = job->bodies.velocity + 8 * i, *drive = job->bodies.drive + 8 * i;
        vf vx, vy, vz, wx, wy, wz, dx, dy, dz, factor, unused;
        load_half(velocity, &vx, &vy, &vz, &unused);
        load_half(drive, &dx, &dy, &dz, &factor);
        vx = (vx + dx) * factor;
        vy = (vy + dy) * factor;
        vz = (vz + dz) * factor;
        limit_length(&vx, &vy, &vz, ES_MAX_SPEED);
        load_half(velocity + 4, &wx, &wy, &wz, &unused);
        load_half(drive + 4, &dx, &dy, &dz, &factor);
        wx = (wx + dx) * factor;
        wy = (wy + dy) * factor;
        wz = (wz + dz) * factor;
        limit_length(&wx, &wy, &wz, job->max_turn * job->inverse_h);
        store_half(velocity, vx, vy, vz, vf_zero());
        store_half(velocity + 4, wx, wy, wz, vf_zero());
    }
}

void ES_KERNEL(es_sim_rigid_move)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    const vf h = vf_set1(job->h), half = vf_set1(0.5f * job->h), one = vf_set1(1.0f);
    for (uint32_t i = begin; i < end; i += VW) {
        float *velocity = job->bodies.velocity + 8 * i, *moved = job->bodies.moved + 8 * i, *rotation = job->bodies.rotation + 4 * i;
        vf vx, vy, vz, wx, wy, wz, px, py, pz, unused;
        load_half(velocity, &vx, &vy, &vz, &unused);
        load_half(moved, &px, &py, &pz, &unused);
        limit_length(&vx, &vy, &vz, ES_MAX_SPEED);
        store_half(moved, px + vx * h, py + vy * h, pz + vz * h, vf_zero());
        load_half(velocity + 4, &wx, &wy, &wz, &unused);
        load_half(moved + 4, &px, &py, &pz, &unused);
        limit_length(&wx, &wy, &wz, job->max_turn * job->inverse_h);
        store_half(moved + 4, px + wx * h, py + wy * h, pz + wz * h, vf_zero());
        store_half(velocity, vx, vy, vz, vf_zero());
        store_half(velocity + 4, wx, wy, wz, vf_zero());
        /* q + h/2 w q, made unit */
        vf qx, qy, qz, qw;
        vf_load4(rotation, &qx, &qy, &qz, &qw);
        vf ax = wx * half, ay = wy * half, az = wz * half;
        vf rx = qx + (ax * qw + ay * qz - az * qy);
        vf ry = qy + (ay * qw + az * qx - ax * qz);
        vf rz = qz + (az * qw + ax * qy - ay * qx);
        vf rw = qw - (ax * qx + ay * qy + az * qz);
        vf inverse = one / vf_sqrt(rx * rx + ry * ry + rz * rz + rw * rw);
        vf_store4(rotation, rx * inverse, ry * inverse, rz * inverse, rw * inverse);
    }
}
