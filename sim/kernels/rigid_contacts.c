/* Contacts of rigid bodies, eight manifolds at a time (sim/rigid/solver.h).
 *
 * With J = (-n, -r_a × n, n, r_b × n) a point's relative speed is J v; an impulse λ changes velocities by M⁻¹ Jᵀ λ. The arms r × n and the turns
 * I⁻¹ (r × n) are made once per step. As separations are linear in how bodies moved, s = s₀ + J · moved. */
#include "platform/simd.h"
#include "sim/kernel_table.h"

typedef struct v3 { vf x, y, z; } v3;
typedef struct motion { v3 v, w; } motion;

VINL v3 load3(const es_lanes3* p) { return (v3){vf_load(p->x), vf_load(p->y), vf_load(p->z)}; }
VINL void store3(es_lanes3* p, v3 a)
{
    vf_store(p->x, a.x);
    vf_store(p->y, a.y);
    vf_store(p->z, a.z);
}
VINL vf dot(v3 a, v3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
VINL v3 cross(v3 a, v3 b) { return (v3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
VINL v3 add(v3 a, v3 b) { return (v3){a.x + b.x, a.y + b.y, a.z + b.z}; }
VINL v3 sub(v3 a, v3 b) { return (v3){a.x - b.x, a.y - b.y, a.z - b.z}; }
VINL v3 scale(v3 a, vf s) { return (v3){a.x * s, a.y * s, a.z * s}; }

VINL motion gather(const float* records, vi index)
{
    motion m;
    vf unused;
    vf_gather4(records, 32, index, &m.v.x, &m.v.y, &m.v.z, &unused);
    vf_gather4(records + 4, 32, index, &m.w.x, &m.w.y, &m.w.z, &unused);
    return m;
}

/* Bodies beyond the dynamic ones do not change and are shared with other threads: not written. */
VINL void scatter(float* records, const uint32_t* index, uint32_t dynamic, motion m)
{
    float v[4 * VW], w[4 * VW];
    vf_store4(v, m.v.x, m.v.y, m.v.z, vf_zero());
    vf_store4(w, m.w.x, m.w.y, m.w.z, vf_zero());
    for (int i = 0; i < VW; i++) {
        if (index[i] >= dynamic) continue;
        memcpy(records + 8 * (size_t)index[i], v + 4 * i, 4 * sizeof(float));
        memcpy(records + 8 * (size_t)index[i] + 4, w + 4 * i, 4 * sizeof(float));
    }
}

typedef struct inertia { vf xx, yy, zz, xy, xz, yz; } inertia;
VINL v3 turn(inertia i, v3 a)
{
    return (v3){i.xx * a.x + i.xy * a.y + i.xz * a.z, i.xy * a.x + i.yy * a.y + i.yz * a.z, i.xz * a.x + i.yz * a.y + i.zz * a.z};
}
VINL inertia load_inertia(const float* mass, vi index, vf* inverse_mass)
{
    inertia i;
    vf unused;
    vf_gather4(mass, 32, index, &i.xx, &i.yy, &i.zz, &i.xy);
    vf_gather4(mass + 4, 32, index, &i.xz, &i.yz, inverse_mass, &unused);
    return i;
}

/* 1 / a where a is above zero, else 0 */
VINL vf inverse_or_zero(vf a)
{
    vm good = vm_gt(a, vf_zero());
    return vf_and(good, vf_set1(1.0f) / vf_select(good, a, vf_set1(1.0f)));
}

/* Duff et al. 2017, as es_orthonormal_basis */
VINL void basis(v3 n, v3* t, v3* b)
{
    const vf one = vf_set1(1.0f);
    vf sign = vf_copysign(one, n.z), p = vf_set1(-1.0f) / (sign + n.z), q = n.x * n.y * p;
    *t = (v3){one + sign * n.x * n.x * p, sign * q, vf_neg(sign) * n.x};
    *b = (v3){q, sign + n.y * n.y * p, vf_neg(n.y)};
}

/* ---- preparing --------------------------------------------------------------------------------------------------------------- */

/* The manifold's fields by their offset, transposed. */
VINL void fields(const es_solver_job* job, vi index, size_t offset, vf* a, vf* b, vf* c, vf* d)
{
    vf_gather4((const char*)job->manifolds + offset, sizeof(es_contact_manifold), index, a, b, c, d);
}

/* What bears something heavier acts on it as if it had more mass itself: the geometric mean of both. Else an impulse would pass to what is below
 * in steps as small as the light body's share, and the heavy one would have sunk in long before their sum holds it. With that mean a light body
 * moving up gives a heavy one at rest no more energy than it had; what bounces back of it, by restitution e, has its share.
 *
 * The factor of the inverse mass of a body under one of inverse mass `over`; above: how much the other is above it, cosine. */
VINL vf bearing(vf inverse, vf over, vf above, vf e)
{
    const vf one = vf_set1(1.0f), zero = vf_zero();
    vm both = vm_gt(over, zero) & vm_gt(inverse, over) & vm_gt(above, zero);
    vf ratio = vf_select(both, inverse, one) / vf_select(both, over, one), more = vf_max(vf_sqrt(ratio * vf_max(one - e, zero) / (one + e)), one);
    return one / (one + vf_and(both, vf_min(above, one) * (more - one)));
}

VINL inertia lighter(inertia i, vf s) { return (inertia){i.xx * s, i.yy * s, i.zz * s, i.xy * s, i.xz * s, i.yz * s}; }

/* Against what does not give way the spring is twice as stiff. One that bears far more than its bodies' own weight is damped more, or what it bears
 * would swing. burden: m/s, of the last substep's impulses. */
VINL void soften(const es_solver_job* job, es_wide_contact* c, vf burden)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const vm firm = vm_eq(vf_load(c->mass_a), zero) | vm_eq(vf_load(c->mass_b), zero);
    const vf share = vf_clamp(burden * vf_set1(job->burden_scale) - one, zero, one);
    float* const to[3] = {c->bias_rate, c->mass_scale, c->impulse_scale};
    for (int k = 0; k < 3; k++) {
        const vf usual = vf_select(firm, vf_set1(job->soft[1][k]), vf_set1(job->soft[0][k])), damped = vf_select(firm, vf_set1(job->soft[3][k]), vf_set1(job->soft[2][k]));
        vf_store(to[k], usual + share * (damped - usual));
    }
}

VINL void prepare(const es_solver_job* job, es_wide_contact* c)
{
    const vf zero = vf_zero();
    const vm used = vm_first((int32_t)c->used);
    const vi a = vi_load(c->a), b = vi_load(c->b), manifold = vi_load(c->manifold);
    motion ma = gather(job->bodies.velocity, a), mb = gather(job->bodies.velocity, b);
    vf mass_a, mass_b;
    inertia ia = load_inertia(job->bodies.mass, a, &mass_a), ib = load_inertia(job->bodies.mass, b, &mass_b);
    const vf rolling_inertia = ia.xx + ia.yy + ia.zz + ib.xx + ib.yy + ib.zz;
    v3 n, apart, friction, roll;
    vf unused, twist, count_bits, mean;
    fields(job, manifold, offsetof(es_contact_manifold, geometry.normal), &n.x, &n.y, &n.z, &unused);
    fields(job, manifold, offsetof(es_contact_manifold, apart), &apart.x, &apart.y, &apart.z, &count_bits);
    fields(job, manifold, offsetof(es_contact_manifold, friction), &friction.x, &friction.y, &friction.z, &twist);
    fields(job, manifold, offsetof(es_contact_manifold, rolling), &roll.x, &roll.y, &roll.z, &unused);
    const vi count = vi_select(used, (vi)count_bits, vi_zero());
    const vf above = dot(n, (v3){vf_set1(job->up[0]), vf_set1(job->up[1]), vf_set1(job->up[2])}); /* B over A */
    const vf restitution = vf_load(c->restitution), scale_a = bearing(mass_a, mass_b, above, restitution), scale_b = bearing(mass_b, mass_a, vf_neg(above), restitution);
    ia = lighter(ia, scale_a);
    ib = lighter(ib, scale_b);
    mass_a = mass_a * scale_a;
    mass_b = mass_b * scale_b;
    mean = inverse_or_zero(vf_from_int(count));
    vf_store(c->mass_a, mass_a);
    vf_store(c->mass_b, mass_b);
    store3(&c->normal, n);
    vf burden = zero;
    v3 middle = {zero, zero, zero}, places[ES_MANIFOLD_POINTS];
    for (uint32_t k = 0; k < c->point_count; k++) {
        es_wide_point* p = &c->points[k];
        const size_t at = offsetof(es_contact_manifold, geometry.points) + k * sizeof(es_manifold_point);
        v3 r;
        vf separation, impulse;
        fields(job, manifold, at, &r.x, &r.y, &r.z, &separation);
        fields(job, manifold, at + 16, &unused, &impulse, &unused, &unused);
        vm there = vi_lt(vi_set1((int32_t)k), count);
        r = (v3){vf_and(there, r.x), vf_and(there, r.y), vf_and(there, r.z)};
        places[k] = r;
        middle = add(middle, r);
        v3 arm_a = cross(r, n), arm_b = cross(sub(r, apart), n);
        v3 turn_a = turn(ia, arm_a), turn_b = turn(ib, arm_b);
        vf k_normal = mass_a + mass_b + dot(turn_a, arm_a) + dot(turn_b, arm_b);
        store3(&p->arm_a, arm_a);
        store3(&p->arm_b, arm_b);
        store3(&p->turn_a, turn_a);
        store3(&p->turn_b, turn_b);
        vf_store(p->separation, vf_and(there, separation));
        vf_store(p->mass, vf_and(there, inverse_or_zero(k_normal)));
        vf_store(p->impulse, vf_and(there, impulse));
        burden = burden + vf_and(there, impulse) * k_normal;
        vf_store(p->peak, zero);
        vf approach = dot(n, sub(mb.v, ma.v)) + dot(arm_b, mb.w) - dot(arm_a, ma.w);
        vf_store(p->approach, vf_and(there, approach));
    }
    soften(job, c, vf_abs(burden));

    middle = scale(middle, mean);
    vf radius = zero;
    for (uint32_t k = 0; k < c->point_count; k++) {
        v3 r = sub(places[k], middle);
        radius = radius + vf_and(vi_lt(vi_set1((int32_t)k), count), vf_sqrt(dot(r, r)));
    }
    vf_store(c->twist_radius, radius * mean);

    v3 t[2];
    basis(n, &t[0], &t[1]);
    v3 arm_a[2], arm_b[2], turn_a[2], turn_b[2];
    for (int k = 0; k < 2; k++) {
        arm_a[k] = cross(middle, t[k]);
        arm_b[k] = cross(sub(middle, apart), t[k]);
        turn_a[k] = turn(ia, arm_a[k]);
        turn_b[k] = turn(ib, arm_b[k]);
        store3(&c->tangent[k], t[k]);
        store3(&c->slide_arm_a[k], arm_a[k]);
        store3(&c->slide_arm_b[k], arm_b[k]);
        store3(&c->slide_turn_a[k], turn_a[k]);
        store3(&c->slide_turn_b[k], turn_b[k]);
        vf_store(c->slide[k], vf_and(used, dot(friction, t[k])));
    }
    vf both = mass_a + mass_b;
    vf xx = both + dot(turn_a[0], arm_a[0]) + dot(turn_b[0], arm_b[0]), yy = both + dot(turn_a[1], arm_a[1]) + dot(turn_b[1], arm_b[1]);
    vf xy = dot(turn_a[0], arm_a[1]) + dot(turn_b[0], arm_b[1]);
    vf inverse = vf_and(used, inverse_or_zero(xx * yy - xy * xy));
    vf_store(c->slide_mass[0], yy * inverse);
    vf_store(c->slide_mass[1], vf_neg(xy) * inverse);
    vf_store(c->slide_mass[2], xx * inverse);
    v3 twist_a = turn(ia, n), twist_b = turn(ib, n);
    store3(&c->twist_turn_a, twist_a);
    store3(&c->twist_turn_b, twist_b);
    vf_store(c->twist_mass, vf_and(used, inverse_or_zero(dot(twist_a, n) + dot(twist_b, n))));
    vf_store(c->twist, vf_and(used, twist));
    store3(&c->roll, (v3){vf_and(used, roll.x), vf_and(used, roll.y), vf_and(used, roll.z)});
    /* the trace is at least the largest of the three: a little soft, never too much */
    vf_store(c->roll_mass, vf_and(used, inverse_or_zero(rolling_inertia)));
}

void ES_KERNEL(es_sim_contacts_prepare)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i++) prepare(job, &job->contacts[i]);
}

/* ---- solving ----------------------------------------------------------------------------------------------------------------- */

/* The rolling impulse changes w by I⁻¹ roll; bodies' inertia is fetched again, as few contacts roll. */
VINL void apply_roll(const es_solver_job* job, const es_wide_contact* c, v3 impulse, motion* a, motion* b)
{
    vf unused;
    inertia ia = load_inertia(job->bodies.mass, vi_load(c->a), &unused), ib = load_inertia(job->bodies.mass, vi_load(c->b), &unused);
    a->w = sub(a->w, turn(ia, impulse));
    b->w = add(b->w, turn(ib, impulse));
}

void ES_KERNEL(es_sim_contacts_warm_start)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    float* records = job->bodies.velocity;
    for (uint32_t i = begin; i < end; i++) {
        es_wide_contact* c = &job->contacts[i];
        motion a = gather(records, vi_load(c->a)), b = gather(records, vi_load(c->b));
        vf sum = vf_zero();
        for (uint32_t k = 0; k < c->point_count; k++) {
            const es_wide_point* p = &c->points[k];
            vf impulse = vf_load(p->impulse);
            sum = sum + impulse;
            a.w = sub(a.w, scale(load3(&p->turn_a), impulse));
            b.w = add(b.w, scale(load3(&p->turn_b), impulse));
        }
        v3 push = scale(load3(&c->normal), sum);
        for (int k = 0; k < 2; k++) {
            vf impulse = vf_load(c->slide[k]);
            push = add(push, scale(load3(&c->tangent[k]), impulse));
            a.w = sub(a.w, scale(load3(&c->slide_turn_a[k]), impulse));
            b.w = add(b.w, scale(load3(&c->slide_turn_b[k]), impulse));
        }
        vf twist = vf_load(c->twist);
        a.w = sub(a.w, scale(load3(&c->twist_turn_a), twist));
        b.w = add(b.w, scale(load3(&c->twist_turn_b), twist));
        a.v = sub(a.v, scale(push, vf_load(c->mass_a)));
        b.v = add(b.v, scale(push, vf_load(c->mass_b)));
        if (c->rolls) apply_roll(job, c, load3(&c->roll), &a, &b);
        scatter(records, c->a, job->bodies.dynamic, a);
        scatter(records, c->b, job->bodies.dynamic, b);
    }
}

/* m/s: how much speed the springs' softness may give way to, so that what is heavily loaded sinks in no deeper */
#define LEAK 0.5f

/* Friction first, non-penetration last: what is solved last holds best. */
VINL void solve(const es_solver_job* job, es_wide_contact* c, bool push)
{
    const vf zero = vf_zero(), inverse_h = vf_set1(job->inverse_h), most = vf_set1(-ES_PUSH_OUT_SPEED);
    float* records = job->bodies.velocity;
    const vi index_a = vi_load(c->a), index_b = vi_load(c->b);
    motion a = gather(records, index_a), b = gather(records, index_b);
    const vf mass_a = vf_load(c->mass_a), mass_b = vf_load(c->mass_b);
    vf pressing = zero;
    for (uint32_t k = 0; k < c->point_count; k++) pressing = pressing + vf_load(c->points[k].impulse);

    if (c->rolls) {
        v3 old = load3(&c->roll), now = sub(old, scale(sub(b.w, a.w), vf_load(c->roll_mass)));
        vf limit = vf_load(c->rolling) * pressing, squared = dot(now, now);
        vm over = vm_gt(squared, limit * limit);
        vf factor = vf_select(over, limit / vf_sqrt(vf_select(over, squared, vf_set1(1.0f))), vf_set1(1.0f));
        now = scale(now, factor);
        store3(&c->roll, now);
        apply_roll(job, c, sub(now, old), &a, &b);
    }

    const vf friction = vf_load(c->friction);
    {
        v3 turn_a = load3(&c->twist_turn_a), turn_b = load3(&c->twist_turn_b);
        vf old = vf_load(c->twist), limit = friction * vf_load(c->twist_radius) * pressing;
        vf now = vf_clamp(old - vf_load(c->twist_mass) * dot(load3(&c->normal), sub(b.w, a.w)), vf_neg(limit), limit);
        vf_store(c->twist, now);
        a.w = sub(a.w, scale(turn_a, now - old));
        b.w = add(b.w, scale(turn_b, now - old));
    }
    {
        v3 between = sub(b.v, a.v), t0 = load3(&c->tangent[0]), t1 = load3(&c->tangent[1]);
        vf speed0 = dot(t0, between) + dot(load3(&c->slide_arm_b[0]), b.w) - dot(load3(&c->slide_arm_a[0]), a.w);
        vf speed1 = dot(t1, between) + dot(load3(&c->slide_arm_b[1]), b.w) - dot(load3(&c->slide_arm_a[1]), a.w);
        vf xy = vf_load(c->slide_mass[1]);
        vf old0 = vf_load(c->slide[0]), old1 = vf_load(c->slide[1]);
        vf now0 = old0 - (vf_load(c->slide_mass[0]) * speed0 + xy * speed1), now1 = old1 - (xy * speed0 + vf_load(c->slide_mass[2]) * speed1);
        vf limit = friction * pressing, squared = now0 * now0 + now1 * now1;
        vm over = vm_gt(squared, limit * limit);
        vf factor = vf_select(over, limit / vf_sqrt(vf_select(over, squared, vf_set1(1.0f))), vf_set1(1.0f));
        now0 = now0 * factor;
        now1 = now1 * factor;
        vf_store(c->slide[0], now0);
        vf_store(c->slide[1], now1);
        vf d0 = now0 - old0, d1 = now1 - old1;
        v3 impulse = add(scale(t0, d0), scale(t1, d1));
        a.v = sub(a.v, scale(impulse, mass_a));
        b.v = add(b.v, scale(impulse, mass_b));
        a.w = sub(a.w, add(scale(load3(&c->slide_turn_a[0]), d0), scale(load3(&c->slide_turn_a[1]), d1)));
        b.w = add(b.w, add(scale(load3(&c->slide_turn_b[0]), d0), scale(load3(&c->slide_turn_b[1]), d1)));
    }

    const v3 n = load3(&c->normal);
    const motion da = gather(job->bodies.moved, index_a), db = gather(job->bodies.moved, index_b);
    const vf apart = dot(n, sub(db.v, da.v));
    const vf bias_rate = vf_load(c->bias_rate), mass_scale = vf_load(c->mass_scale), impulse_scale = vf_load(c->impulse_scale);
    const vf push_a = mass_a, push_b = mass_b;
    vf along = dot(n, sub(b.v, a.v)), total = zero; /* the points' common part, and their sum: applied to v once */
    const vf both = mass_a + mass_b;
    for (uint32_t k = 0; k < c->point_count; k++) {
        es_wide_point* p = &c->points[k];
        v3 arm_a = load3(&p->arm_a), arm_b = load3(&p->arm_b);
        vf separation = vf_load(p->separation) + apart + dot(arm_b, db.w) - dot(arm_a, da.w);
        vf speed = along + dot(arm_b, b.w) - dot(arm_a, a.w);
        vf old = vf_load(p->impulse), mass = vf_load(p->mass), now;
        vm open = vm_gt(separation, zero);
        if (push) {
            vf bias = vf_select(open, separation * inverse_h, vf_max(separation * bias_rate, most));
            vf soft = vf_select(open, vf_set1(1.0f), mass_scale), leak = vf_select(open, zero, impulse_scale);
            now = old - mass * soft * (speed + bias) - vf_min(leak * old, mass * soft * vf_set1(LEAK));
        } else {
            now = old - mass * (speed + vf_and(open, separation * inverse_h));
        }
        now = vf_max(now, zero);
        vf_store(p->impulse, now);
        vf_store(p->peak, vf_max(vf_load(p->peak), now));
        vf change = now - old;
        total = total + change;
        along = along + both * change;
        a.w = sub(a.w, scale(load3(&p->turn_a), change));
        b.w = add(b.w, scale(load3(&p->turn_b), change));
    }
    v3 impulse = scale(n, total);
    a.v = sub(a.v, scale(impulse, push_a));
    b.v = add(b.v, scale(impulse, push_b));
    scatter(records, c->a, job->bodies.dynamic, a);
    scatter(records, c->b, job->bodies.dynamic, b);
}

void ES_KERNEL(es_sim_contacts_solve)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i++) solve(job, &job->contacts[i], true);
}

void ES_KERNEL(es_sim_contacts_relax)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i++) solve(job, &job->contacts[i], false);
}

/* Where bodies met fast enough and pressed: they part at `restitution` times that speed. One point's impulse changes the speed of the others
 * of its manifold, so they take turns, a fixed number: they come close to their speeds, no more, and what that would gain in energy is taken off
 * afterwards (sim/rigid/bounce_limit.h). */
enum { POINT_ROUNDS = 4 };

void ES_KERNEL(es_sim_contacts_bounce)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    const vf zero = vf_zero();
    float* records = job->bodies.velocity;
    for (uint32_t i = begin; i < end; i++) {
        es_wide_contact* c = &job->contacts[i];
        if (!c->bouncy) continue;
        motion a = gather(records, vi_load(c->a)), b = gather(records, vi_load(c->b));
        const vf mass_a = vf_load(c->mass_a), mass_b = vf_load(c->mass_b), restitution = vf_load(c->restitution);
        const v3 n = load3(&c->normal);
        const uint32_t turns = c->point_count > 1 ? c->point_count * POINT_ROUNDS : 1;
        for (uint32_t turn = 0; turn < turns; turn++) {
            es_wide_point* p = &c->points[turn % c->point_count];
            vf approach = vf_load(p->approach), old = vf_load(p->impulse);
            vm bounces = vm_gt(restitution, zero) & vm_lt(approach, vf_set1(-ES_BOUNCE_SPEED)) & vm_gt(vf_load(p->peak), zero);
            vf speed = dot(n, sub(b.v, a.v)) + dot(load3(&p->arm_b), b.w) - dot(load3(&p->arm_a), a.w);
            vf now = vf_select(bounces, vf_max(old - vf_load(p->mass) * (speed + restitution * approach), zero), old);
            vf change = now - old;
            vf_store(p->impulse, now);
            v3 impulse = scale(n, change);
            a.v = sub(a.v, scale(impulse, mass_a));
            b.v = add(b.v, scale(impulse, mass_b));
            a.w = sub(a.w, scale(load3(&p->turn_a), change));
            b.w = add(b.w, scale(load3(&p->turn_b), change));
        }
        scatter(records, c->a, job->bodies.dynamic, a);
        scatter(records, c->b, job->bodies.dynamic, b);
    }
}

/* ---- storing ------------------------------------------------------------------------------------------------------------------ */

void ES_KERNEL(es_sim_contacts_store)(const es_solver_job* job, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i++) {
        const es_wide_contact* c = &job->contacts[i];
        es_lanes3 friction;
        store3(&friction, add(scale(load3(&c->tangent[0]), vf_load(c->slide[0])), scale(load3(&c->tangent[1]), vf_load(c->slide[1]))));
        for (uint32_t lane = 0; lane < c->used; lane++) {
            es_contact_manifold* m = &job->manifolds[c->manifold[lane]];
            for (uint32_t k = 0; k < m->geometry.count; k++) m->geometry.points[k].normal_impulse = c->points[k].impulse[lane];
            m->friction = (es_vec3){friction.x[lane], friction.y[lane], friction.z[lane]};
            m->twist = c->twist[lane];
            m->rolling = (es_vec3){c->roll.x[lane], c->roll.y[lane], c->roll.z[lane]};
        }
    }
}
