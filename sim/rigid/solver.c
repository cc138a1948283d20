/* One fixed step of the bodies that are awake: what the kernels work on is laid out, the stages run, the result goes back (sim/rigid/solver.h).
 *
 * Colours: manifolds in the order of their contacts take the first colour that neither of their dynamic bodies has yet; what finds none of
 * ES_COLOURS is solved one after another. */
#include <string.h>

#include "platform/maths.h"
#include "sim/kernel_table.h"
#include "sim/rigid/bounce_limit.h"
#include "sim/rigid/crew.h"
#include "sim/rigid/joints.h"

enum { RECORD_GRAIN = 64, CONTACT_GRAIN = 4, CONTACT_HERTZ = 30, CONTACT_DAMPING = 1, BURDEN_DAMPING = 4, BURDEN = 60, BOUNCE_SWEEPS = 4 };

typedef enum stage_kind { LOAD, PREPARE, PREPARE_JOINTS, ACCELERATE, WARM_JOINTS, WARM, SOLVE_JOINTS, SOLVE, MOVE, RELAX_JOINTS, RELAX, KEEP, BOUNCE, LIMIT_BOUNCES, STORE_JOINTS, STORE, UNLOAD } stage_kind;

typedef struct entry { uint32_t contact, manifold, a, b, colour; } entry;

typedef struct es_solver {
    es_solver_job job;
    float *velocity, *moved, *mass, *drive, *rotation;
    size_t velocity_capacity, moved_capacity, mass_capacity, drive_capacity, rotation_capacity;
    float* unbounced;              /* velocities before the bounces */
    size_t unbounced_capacity;
    es_bounce_island* islands;
    size_t island_capacity;
    es_wide_contact* wide;
    size_t wide_capacity;
    entry* entries;
    size_t entry_capacity, entry_count;
    uint32_t* colours;             /* per dynamic body: bit per colour it has */
    size_t colour_capacity;
    uint32_t first[ES_COLOURS + 2]; /* of each colour's wide contacts; last the ones without a colour */
    es_stage* stages;
    size_t stage_capacity;
    uint32_t stage_count;
    const es_sim_kernels* kernels;
    es_world* world;
    float h;                       /* of the whole step */
    bool bouncy;
} es_solver;

void es_solver_free(es_context* context, es_solver* solver)
{
    if (!solver) return;
    es_release(context, solver->velocity, solver->velocity_capacity * sizeof(float));
    es_release(context, solver->moved, solver->moved_capacity * sizeof(float));
    es_release(context, solver->mass, solver->mass_capacity * sizeof(float));
    es_release(context, solver->drive, solver->drive_capacity * sizeof(float));
    es_release(context, solver->rotation, solver->rotation_capacity * sizeof(float));
    es_release(context, solver->unbounced, solver->unbounced_capacity * sizeof(float));
    es_release(context, solver->islands, solver->island_capacity * sizeof *solver->islands);
    es_release(context, solver->wide, solver->wide_capacity * sizeof *solver->wide);
    es_release(context, solver->entries, solver->entry_capacity * sizeof *solver->entries);
    es_release(context, solver->colours, solver->colour_capacity * sizeof *solver->colours);
    es_release(context, solver->stages, solver->stage_capacity * sizeof *solver->stages);
    es_release(context, solver, sizeof *solver);
}

/* ---- bodies --------------------------------------------------------------------------------------------------------------- */

/* R M Rᵀ of a symmetric matrix. */
static void turned(es_quat q, const float m[6], float out[6])
{
    float xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z, xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z, wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
    const float r[3][3] = {{1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy)}, {2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx)}, {2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy)}};
    const float s[3][3] = {{m[0], m[3], m[4]}, {m[3], m[1], m[5]}, {m[4], m[5], m[2]}};
    float t[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) t[i][k] = r[i][0] * s[0][k] + r[i][1] * s[1][k] + r[i][2] * s[2][k];
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    for (int k = 0; k < 6; k++) out[k] = t[row[k]][0] * r[column[k]][0] + t[row[k]][1] * r[column[k]][1] + t[row[k]][2] * r[column[k]][2];
}

static es_vec3 times(const float m[6], es_vec3 v)
{
    return es_v3(m[0] * v.x + m[3] * v.y + m[4] * v.z, m[3] * v.x + m[1] * v.y + m[5] * v.z, m[4] * v.x + m[5] * v.y + m[2] * v.z);
}

static void put3(float* record, es_vec3 v, float w)
{
    record[0] = v.x;
    record[1] = v.y;
    record[2] = v.z;
    record[3] = w;
}

static void load_body(es_solver* solver, uint32_t i)
{
    es_world* world = solver->world;
    float *velocity = solver->velocity + 8 * i, *moved = solver->moved + 8 * i, *mass = solver->mass + 8 * i, *drive = solver->drive + 8 * i;
    memset(velocity, 0, 8 * sizeof(float));
    memset(moved, 0, 8 * sizeof(float));
    memset(mass, 0, 8 * sizeof(float));
    put3(drive, es_v3(0, 0, 0), 1);
    put3(drive + 4, es_v3(0, 0, 0), 1);
    es_quat q = es_quat_identity();
    if (i < solver->job.bodies.count) {
        const es_body_object* body = es_slots_at(&world->slots[ES_OBJECT_BODY], world->rigid->moving[i]);
        q = body->rotation;
        put3(velocity, body->velocity, 0);
        put3(velocity + 4, body->angular_velocity, 0);
        if (body->type == ES_BODY_DYNAMIC) {
            turned(q, body->inverse_inertia, mass);
            mass[6] = body->inverse_mass;
            float h = solver->job.h;
            es_vec3 turn = times(mass, body->torque);
            for (int k = 0; k < 3; k++) {
                float push = (&body->force.x)[k] * body->inverse_mass + (&world->settings.gravity.x)[k] * body->gravity_scale;
                drive[k] = es_clampf(push * h, -ES_MAX_SPEED, ES_MAX_SPEED);
                drive[4 + k] = es_clampf((&turn.x)[k] * h, -ES_MAX_SPEED, ES_MAX_SPEED);
            }
            drive[3] = 1.0f / (1.0f + h * body->linear_damping);
            drive[7] = 1.0f / (1.0f + h * body->angular_damping);
        }
    }
    memcpy(solver->rotation + 4 * i, &q, sizeof q);
}

/* Free rotation keeps the angular momentum R I Rᵀ w as R changes; where that, in steps as coarse as these, would gain energy, w is shortened
 * so that it does not. */
static es_vec3 precess(const es_body_object* body, es_quat from, es_quat to, es_vec3 w)
{
    const float* i = body->inertia;
    if (i[0] == i[1] && i[1] == i[2] && i[3] == 0 && i[4] == 0 && i[5] == 0) return w;
    es_quat back = {-from.x, -from.y, -from.z, from.w}, into = {-to.x, -to.y, -to.z, to.w};
    es_vec3 momentum = es_quat_rotate(from, times(i, es_quat_rotate(back, w)));
    es_vec3 now = es_quat_rotate(to, times(body->inverse_inertia, es_quat_rotate(into, momentum)));
    float before = es_v3_dot(w, momentum), after = es_v3_dot(now, momentum);
    if (!(after > 0) || !(before > 0)) return w;
    return after > before ? es_v3_scale(now, es_sqrt(before / after)) : now;
}

/* Speeds too small to matter would end as denormals. */
static es_vec3 settled(es_vec3 v) { return es_v3_dot(v, v) > 1e-24f ? v : es_v3(0, 0, 0); }

static void unload_body(es_solver* solver, uint32_t i)
{
    es_world* world = solver->world;
    es_body_object* body = es_slots_at(&world->slots[ES_OBJECT_BODY], world->rigid->moving[i]);
    if (body->type != ES_BODY_DYNAMIC) return;
    const float *v = solver->velocity + 8 * i, *moved = solver->moved + 8 * i;
    es_quat q;
    memcpy(&q, solver->rotation + 4 * i, sizeof q);
    es_vec3 velocity = es_v3(v[0], v[1], v[2]), w = es_v3(v[4], v[5], v[6]);
    body->force = body->torque = es_v3(0, 0, 0);
    /* what numbers cannot say stays where it was, at rest */
    if (!es_all_within(v, 8, 1e9f) || !es_all_within(moved, 8, 1e9f) || !es_all_within(&q.x, 4, 1.01f)) {
        body->velocity = body->angular_velocity = es_v3(0, 0, 0);
        return;
    }
    for (int k = 0; k < 3; k++) {
        double to = body->centre[k] + (double)moved[k];
        body->centre[k] = to > 2e9 ? 2e9 : to < -2e9 ? -2e9 : to;
    }
    body->velocity = settled(velocity);
    body->angular_velocity = settled(precess(body, body->rotation, q, w));
    body->rotation = q;
}

/* ---- contacts --------------------------------------------------------------------------------------------------------------- */

/* What takes part, in which colour; how many wide contacts each colour takes. */
static void colour(es_solver* solver)
{
    es_world* world = solver->world;
    es_rigid* rigid = world->rigid;
    const es_solver_bodies* bodies = &solver->job.bodies;
    uint32_t counts[ES_COLOURS + 1] = {0};
    memset(solver->colours, 0, bodies->dynamic * sizeof *solver->colours);
    solver->entry_count = 0;
    for (uint32_t i = 0; i < rigid->contacts.count; i++) {
        const es_contact* contact = &rigid->contacts.list[i];
        if (contact->count == 0) continue;
        const es_body_object *a = es_body_of_key(world, contact->a), *b = es_body_of_key(world, contact->b);
        uint32_t index_a = a->index, index_b = b->index;
        if (index_a == UINT32_MAX) index_a = bodies->still;
        if (index_b == UINT32_MAX) index_b = bodies->still;
        bool dynamic_a = index_a < bodies->dynamic, dynamic_b = index_b < bodies->dynamic;
        for (uint32_t k = 0; k < contact->count; k++) {
            uint32_t taken = (dynamic_a ? solver->colours[index_a] : 0) | (dynamic_b ? solver->colours[index_b] : 0);
            uint32_t c = (uint32_t)__builtin_ctz(~taken);
            if (c > ES_COLOURS) c = ES_COLOURS;
            if (c < ES_COLOURS) {
                if (dynamic_a) solver->colours[index_a] |= 1u << c;
                if (dynamic_b) solver->colours[index_b] |= 1u << c;
            }
            counts[c]++;
            solver->entries[solver->entry_count++] = (entry){i, contact->first + k, index_a, index_b, c};
        }
    }
    uint32_t wide = 0;
    for (uint32_t c = 0; c < ES_COLOURS; c++) {
        solver->first[c] = wide;
        wide += (counts[c] + ES_LANES - 1) / ES_LANES;
    }
    /* without a colour: one each */
    solver->first[ES_COLOURS] = wide;
    solver->first[ES_COLOURS + 1] = wide + counts[ES_COLOURS];
}

static void place(es_solver* solver)
{
    const es_rigid* rigid = solver->world->rigid;
    uint32_t still = solver->job.bodies.still, filled[ES_COLOURS + 1] = {0};
    solver->bouncy = false;
    for (uint32_t i = 0; i < solver->first[ES_COLOURS + 1]; i++) solver->wide[i].used = solver->wide[i].point_count = solver->wide[i].bouncy = solver->wide[i].rolls = 0;
    for (size_t i = 0; i < solver->entry_count; i++) {
        const entry* e = &solver->entries[i];
        const es_contact* contact = &rigid->contacts.list[e->contact];
        uint32_t n = filled[e->colour]++;
        es_wide_contact* c = &solver->wide[solver->first[e->colour] + (e->colour < ES_COLOURS ? n / ES_LANES : n)];
        uint32_t lane = c->used++, points = rigid->contacts.manifolds[e->manifold].geometry.count;
        c->a[lane] = e->a;
        c->b[lane] = e->b;
        c->manifold[lane] = e->manifold;
        c->friction[lane] = contact->friction;
        c->restitution[lane] = contact->restitution;
        c->rolling[lane] = contact->rolling;
        if (points > c->point_count) c->point_count = points;
        c->bouncy |= contact->restitution > 0;
        c->rolls |= contact->rolling > 0;
        solver->bouncy |= contact->restitution > 0;
    }
    for (uint32_t i = 0; i < solver->first[ES_COLOURS + 1]; i++) {
        es_wide_contact* c = &solver->wide[i];
        for (uint32_t lane = c->used; lane < ES_LANES; lane++) {
            c->a[lane] = c->b[lane] = still;
            c->manifold[lane] = c->manifold[0];
            c->friction[lane] = c->restitution[lane] = c->rolling[lane] = 0;
        }
    }
}

/* ---- stages ------------------------------------------------------------------------------------------------------------------ */

static void add_stage(es_solver* solver, stage_kind kind, uint32_t begin, uint32_t end, uint32_t grain)
{
    if (end > begin) solver->stages[solver->stage_count++] = (es_stage){kind, begin, end, grain};
}

/* What has no colour goes first, so that what is solved side by side has the last word. */
static void add_contacts(es_solver* solver, stage_kind kind)
{
    const uint32_t* first = solver->first;
    add_stage(solver, kind, first[ES_COLOURS], first[ES_COLOURS + 1], UINT32_MAX);
    for (uint32_t c = 0; c < ES_COLOURS; c++) add_stage(solver, kind, first[c], first[c + 1], CONTACT_GRAIN);
}

static void plan(es_solver* solver, uint32_t substeps)
{
    const es_solver_bodies* bodies = &solver->job.bodies;
    uint32_t records = (bodies->still + ES_LANES) / ES_LANES * ES_LANES, wide = solver->first[ES_COLOURS + 1], joints = es_joint_solver_count(solver->world) > 0;
    solver->stage_count = 0;
    add_stage(solver, LOAD, 0, records, RECORD_GRAIN);
    add_stage(solver, PREPARE, 0, wide, CONTACT_GRAIN);
    add_stage(solver, PREPARE_JOINTS, 0, joints, 1);
    for (uint32_t i = 0; i < substeps; i++) {
        add_stage(solver, ACCELERATE, 0, records, RECORD_GRAIN);
        add_stage(solver, WARM_JOINTS, 0, joints, 1);
        add_contacts(solver, WARM);
        add_stage(solver, SOLVE_JOINTS, 0, joints, 1);
        add_contacts(solver, SOLVE);
        add_stage(solver, MOVE, 0, records, RECORD_GRAIN);
        add_stage(solver, RELAX_JOINTS, 0, joints, 1);
        add_contacts(solver, RELAX);
    }
    if (solver->bouncy) {
        add_stage(solver, KEEP, 0, bodies->dynamic, RECORD_GRAIN);
        for (uint32_t sweep = 0; sweep < BOUNCE_SWEEPS; sweep++) add_contacts(solver, BOUNCE);
        add_stage(solver, LIMIT_BOUNCES, 0, 1, 1);
    }
    add_stage(solver, STORE_JOINTS, 0, joints, 1);
    add_stage(solver, STORE, 0, wide, CONTACT_GRAIN);
    add_stage(solver, UNLOAD, 0, bodies->count, RECORD_GRAIN);
}

static void run_block(void* user, uint32_t kind, uint32_t begin, uint32_t end)
{
    es_solver* solver = user;
    const es_solver_job* job = &solver->job;
    const es_sim_kernels* kernels = solver->kernels;
    switch ((stage_kind)kind) {
    case LOAD:
        for (uint32_t i = begin; i < end; i++) load_body(solver, i);
        break;
    case PREPARE: kernels->contacts_prepare(job, begin, end); break;
    case PREPARE_JOINTS: es_joints_prepare(solver->world, job); break;
    case ACCELERATE: kernels->rigid_accelerate(job, begin, end); break;
    case WARM_JOINTS: es_joints_warm_start(solver->world, job); break;
    case WARM: kernels->contacts_warm_start(job, begin, end); break;
    case SOLVE_JOINTS: es_joints_solve(solver->world, job, true); break;
    case SOLVE: kernels->contacts_solve(job, begin, end); break;
    case MOVE: kernels->rigid_move(job, begin, end); break;
    case RELAX_JOINTS: es_joints_solve(solver->world, job, false); break;
    case RELAX: kernels->contacts_relax(job, begin, end); break;
    case KEEP: memcpy(solver->unbounced + 8 * (size_t)begin, solver->velocity + 8 * (size_t)begin, 8 * (size_t)(end - begin) * sizeof(float)); break;
    case BOUNCE: kernels->contacts_bounce(job, begin, end); break;
    case LIMIT_BOUNCES: es_limit_bounces(solver->world, job, solver->first[ES_COLOURS + 1], solver->unbounced, solver->islands, solver->h); break;
    case STORE_JOINTS: es_joints_store(solver->world, job); break;
    case STORE: kernels->contacts_store(job, begin, end); break;
    case UNLOAD:
        for (uint32_t i = begin; i < end; i++) unload_body(solver, i);
        break;
    }
}

/* A spring of that frequency and damping, integrated implicitly over h: Catto, "Soft Constraints", GDC 2011. */
static void soften(float h, float hertz, float damping, float soft[3])
{
    float omega = 2.0f * ES_PI * hertz, a1 = 2.0f * damping + h * omega, a2 = h * omega * a1, a3 = 1.0f / (1.0f + a2);
    soft[0] = omega / a1;
    soft[1] = a2 * a3;
    soft[2] = a3;
}

static bool reserve(es_solver* solver, uint32_t substeps)
{
    es_world* world = solver->world;
    es_context* context = world->context;
    const es_rigid* rigid = world->rigid;
    size_t records = ((size_t)solver->job.bodies.still + ES_LANES) / ES_LANES * ES_LANES, manifolds = 0;
    for (size_t i = 0; i < rigid->contacts.count; i++) manifolds += rigid->contacts.list[i].count;
    size_t stages = 16 + (size_t)(substeps + 1) * (5 + 3 * (ES_COLOURS + 1)) + (size_t)BOUNCE_SWEEPS * (ES_COLOURS + 1);
    return es_grow(context, (void**)&solver->velocity, &solver->velocity_capacity, 0, 8 * records, sizeof(float)) &&
           es_grow(context, (void**)&solver->moved, &solver->moved_capacity, 0, 8 * records, sizeof(float)) &&
           es_grow(context, (void**)&solver->mass, &solver->mass_capacity, 0, 8 * records, sizeof(float)) &&
           es_grow(context, (void**)&solver->drive, &solver->drive_capacity, 0, 8 * records, sizeof(float)) &&
           es_grow(context, (void**)&solver->rotation, &solver->rotation_capacity, 0, 4 * records, sizeof(float)) &&
           es_grow(context, (void**)&solver->unbounced, &solver->unbounced_capacity, 0, 8 * records, sizeof(float)) &&
           es_grow(context, (void**)&solver->islands, &solver->island_capacity, 0, records, sizeof *solver->islands) &&
           es_grow(context, (void**)&solver->colours, &solver->colour_capacity, 0, records, sizeof *solver->colours) &&
           es_grow(context, (void**)&solver->entries, &solver->entry_capacity, 0, manifolds, sizeof *solver->entries) &&
           es_grow(context, (void**)&solver->stages, &solver->stage_capacity, 0, stages, sizeof *solver->stages);
}

bool es_solve(es_world* world, float h, uint32_t substeps)
{
    es_rigid* rigid = world->rigid;
    if (!rigid->solver && !(rigid->solver = es_allocate_zero(world->context, sizeof *rigid->solver))) return false;
    es_solver* solver = rigid->solver;
    solver->world = world;
    solver->kernels = es_sim_kernel_table(es_context_isa(world->context));
    es_solver_job* job = &solver->job;
    job->bodies.dynamic = rigid->dynamic_count;
    job->bodies.count = job->bodies.still = rigid->dynamic_count + rigid->kinematic_count;
    if (!reserve(solver, substeps) || !es_joints_reserve(world)) return false;
    job->bodies.velocity = solver->velocity;
    job->bodies.moved = solver->moved;
    job->bodies.mass = solver->mass;
    job->bodies.drive = solver->drive;
    job->bodies.rotation = solver->rotation;
    colour(solver);
    if (!es_grow(world->context, (void**)&solver->wide, &solver->wide_capacity, 0, solver->first[ES_COLOURS + 1], sizeof *solver->wide)) return false;
    place(solver);
    job->contacts = solver->wide;
    job->manifolds = rigid->contacts.manifolds;
    solver->h = h;
    job->h = h / (float)substeps;
    job->inverse_h = 1.0f / job->h;
    job->max_turn = 0.25f * ES_PI;
    es_vec3 gravity = world->settings.gravity;
    float pull = es_v3_length(gravity);
    for (int k = 0; k < 3; k++) job->up[k] = pull > 1e-6f ? -(&gravity.x)[k] / pull : 0;
    float hertz = es_minf((float)CONTACT_HERTZ, 0.25f * job->inverse_h);
    for (int k = 0; k < 2; k++) {
        soften(job->h, (float)(k + 1) * hertz, (float)CONTACT_DAMPING, job->soft[k]);
        soften(job->h, (float)(k + 1) * hertz, (float)BURDEN_DAMPING, job->soft[2 + k]);
    }
    job->burden_scale = pull > 1e-6f ? 1.0f / ((float)BURDEN * pull * job->h) : 0;
    plan(solver, substeps);
    es_crew_run(world->context, solver->stages, solver->stage_count, run_block, solver);
    return true;
}
