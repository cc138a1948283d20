/* Bounces give bodies no energy that they had not.
 *
 * Newton's law of restitution says at what speed each point of contact parts. Met by several points at once, solved one after another in a fixed
 * number of rounds, it can leave bodies with more kinetic energy than they came with (Stronge, "Impact Mechanics", 2000, chapter 3), by a few per
 * cent a step when three cubes meet that lose nothing. So, after the bounces, each island is looked at as a whole: it may have as much as when the
 * step began and what forces have done since, or what contacts left it if that is more. If its bounces made it more, all their changes of velocity
 * are shortened by the same factor s, along which energy is a quadratic. Momentum stays as it is, for any s.
 *
 * Energy is measured against what the island touches that is not dynamic; where this moves in more than one way, it may do work that is not known
 * here, and nothing is shortened.
 *
 * One thread does this, in the order of bodies: sums do not depend on how many there are. */
#include "sim/rigid/bounce_limit.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/joints.h"

typedef struct motion { double v[3], w[3]; } motion; /* w along the body's own axes */

static bool is_round(const float i[6]) { return i[0] == i[1] && i[1] == i[2] && i[3] == 0 && i[4] == 0 && i[5] == 0; }

static motion motion_of(const es_body_object* body, const float* v, const float* w)
{
    es_vec3 own = es_v3(w[0], w[1], w[2]);
    if (!is_round(body->inertia)) own = es_quat_rotate((es_quat){-body->rotation.x, -body->rotation.y, -body->rotation.z, body->rotation.w}, own);
    return (motion){{(double)v[0], (double)v[1], (double)v[2]}, {(double)own.x, (double)own.y, (double)own.z}};
}

/* x M y */
static double product(const es_body_object* body, const motion* x, const motion* y)
{
    const float* i = body->inertia;
    const double *a = x->w, *b = y->w;
    const double turning = (double)i[0] * a[0] * b[0] + (double)i[1] * a[1] * b[1] + (double)i[2] * a[2] * b[2] + (double)i[3] * (a[0] * b[1] + a[1] * b[0]) +
                           (double)i[4] * (a[0] * b[2] + a[2] * b[0]) + (double)i[5] * (a[1] * b[2] + a[2] * b[1]);
    return (double)body->mass * (x->v[0] * y->v[0] + x->v[1] * y->v[1] + x->v[2] * y->v[2]) + turning;
}

static bool has_bounced(const es_solver_bodies* bodies, const float* before, uint32_t i)
{
    return memcmp(bodies->velocity + 8 * (size_t)i, before + 8 * (size_t)i, 8 * sizeof(float)) != 0;
}

/* What an island touches that contacts do not move. */
static void meet_wall(const es_solver_bodies* bodies, es_bounce_island* island, uint32_t wall)
{
    const float* v = bodies->velocity + 8 * (size_t)wall;
    const float* frame = island->frame;
    const bool turns = v[4] != 0 || v[5] != 0 || v[6] != 0, other = v[0] != frame[0] || v[1] != frame[1] || v[2] != frame[2];
    if (turns || (island->walled && other)) island->driven = true;
    memcpy(island->frame, v, sizeof island->frame);
    island->walled = true;
}

/* Islands from the solver's own list of who touches whom, which is shorter to go through than the world's; the walls of each after all have joined. */
static void find_islands(es_world* world, const es_solver_job* job, uint32_t contact_count, es_bounce_island* islands)
{
    const es_solver_bodies* bodies = &job->bodies;
    uint32_t* parents = world->rigid->parents;
    for (uint32_t i = 0; i < bodies->dynamic; i++) parents[i] = i;
    for (uint32_t i = 0; i < contact_count; i++) {
        const es_wide_contact* c = &job->contacts[i];
        for (uint32_t lane = 0; lane < c->used; lane++)
            if (c->a[lane] < bodies->dynamic && c->b[lane] < bodies->dynamic) es_island_join(parents, c->a[lane], c->b[lane]);
    }
    es_joints_unite(world, parents, es_island_join);
    for (uint32_t i = 0; i < bodies->dynamic; i++) parents[i] = es_island_root(parents, i);
    memset(islands, 0, bodies->dynamic * sizeof *islands);
    for (uint32_t i = 0; i < contact_count; i++) {
        const es_wide_contact* c = &job->contacts[i];
        for (uint32_t lane = 0; lane < c->used; lane++) {
            const uint32_t a = c->a[lane], b = c->b[lane];
            if (a < bodies->dynamic && b >= bodies->dynamic) meet_wall(bodies, &islands[parents[a]], b);
            if (b < bodies->dynamic && a >= bodies->dynamic) meet_wall(bodies, &islands[parents[b]], a);
        }
    }
}

/* Twice the body's energies, and of what forces did. h: s, of the step */
static void sum(const es_world* world, const es_solver_bodies* bodies, const float* before, uint32_t i, float h, es_bounce_island* island)
{
    const es_body_object* body = es_slots_at(&world->slots[ES_OBJECT_BODY], world->rigid->moving[i]);
    const float *kept = before + 8 * (size_t)i, *now = bodies->velocity + 8 * (size_t)i, *moved = bodies->moved + 8 * (size_t)i;
    const bool bounced = has_bounced(bodies, before, i);
    motion first = motion_of(body, &body->velocity.x, &body->angular_velocity.x), from = motion_of(body, kept, kept + 4), to = bounced ? motion_of(body, now, now + 4) : from, change;
    for (int k = 0; k < 3; k++) {
        const double frame = (double)island->frame[k], force = (double)(&body->force.x)[k] + (double)body->mass * (double)(&world->settings.gravity.x)[k] * (double)body->gravity_scale;
        change.v[k] = to.v[k] - from.v[k];
        change.w[k] = to.w[k] - from.w[k];
        first.v[k] -= frame;
        from.v[k] -= frame;
        island->allowed += 2 * (force * ((double)moved[k] - frame * (double)h) + (double)(&body->torque.x)[k] * (double)moved[4 + k]);
    }
    island->allowed += product(body, &first, &first);
    island->constant += product(body, &from, &from);
    if (!bounced) return;
    island->linear += 2 * product(body, &from, &change);
    island->square += product(body, &change, &change);
}

/* Of constant + linear s + square s² ≤ the larger of allowed and constant, the largest s in [0, 1]. */
static double largest_share(const es_bounce_island* island)
{
    const double room = island->allowed > island->constant ? island->allowed - island->constant : 0;
    if (island->driven || !(island->linear + island->square > room) || !(island->square > 0) || !(island->square < 1e100)) return 1;
    const double root = __builtin_sqrt(island->linear * island->linear + 4 * island->square * room), share = (root - island->linear) / (2 * island->square);
    return share > 0 ? share < 1 ? share : 1 : 0;
}

void es_limit_bounces(es_world* world, const es_solver_job* job, uint32_t contact_count, const float* before, es_bounce_island* islands, float h)
{
    const es_solver_bodies* bodies = &job->bodies;
    const uint32_t* parents = world->rigid->parents;
    uint32_t first = 0;
    while (first < bodies->dynamic && !has_bounced(bodies, before, first)) first++;
    if (first == bodies->dynamic) return;
    find_islands(world, job, contact_count, islands);
    for (uint32_t i = first; i < bodies->dynamic; i++)
        if (has_bounced(bodies, before, i)) islands[parents[i]].bounced = true;
    for (uint32_t i = 0; i < bodies->dynamic; i++) {
        es_bounce_island* island = &islands[parents[i]];
        if (island->bounced && !island->driven) sum(world, bodies, before, i, h, island);
    }
    for (uint32_t i = 0; i < bodies->dynamic; i++) islands[i].share = islands[i].bounced ? largest_share(&islands[i]) : 1;
    for (uint32_t i = first; i < bodies->dynamic; i++) {
        const double share = islands[parents[i]].share;
        if (share == 1 || !has_bounced(bodies, before, i)) continue;
        float* now = bodies->velocity + 8 * (size_t)i;
        const float* from = before + 8 * (size_t)i;
        for (int k = 0; k < 8; k++) now[k] = (float)((double)from[k] + share * ((double)now[k] - (double)from[k]));
    }
}
