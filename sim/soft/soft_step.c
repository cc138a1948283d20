/* One fixed step of a cloth or soft body: small steps of one iteration (Macklin et al. 2019, alg. 1).
 *
 * A substep of a band is: contact and velocities of the substep before, motion, what is held, reach, its own links and volumes, then the seam
 * with the band before it. All bands of all substeps are the tasks of one parallel loop, which hands them out in order (es_parallel_for), substep by substep; a task
 * waits until those before it that it needs are done:
 *
 *     own part of (s, b)    needs (s - 1, b) and (s - 1, b + 1), which solved the seams of b
 *     seam of (s, b)        needs (s, b - 1)
 *
 * A waiting task needs only tasks that were handed out before it, so some thread is always getting on, even if one thread runs them all
 * after one another; and what a task reads does not depend on who runs it. Two threads follow each other through the bands without barriers,
 * of which there would be two per substep. */
#include "sim/soft/soft.h"

#include <stdatomic.h>
#include <string.h>

#include "platform/maths.h"
#include "sim/dynamics.h"
#include "sim/kernel_table.h"
#include "sim/rigid/rigid.h"

#define HAND_SPEED 10.0 /* m/s */

typedef struct step_job {
    es_soft_object* soft;
    const es_sim_kernels* kernels;
    es_soft_motion motion;
    es_soft_reach reach;
    uint32_t substeps;             /* of the whole step */
    uint32_t first, count;         /* of this loop */
    bool last;                     /* ends with contact and velocities */
    float inverse_h2, volume_compliance;
    atomic_uint* done;             /* per band: substeps of this loop */
    float* fastest;                /* per band */
} step_job;

static void wait_for(atomic_uint* done, uint32_t least)
{
    for (uint32_t turns = 0; atomic_load_explicit(done, memory_order_acquire) < least;) es_wait_a_little(&turns);
}

/* Planes hold for the whole step; their shape's surface moves on with `velocity`. */
static void meet_planes(es_soft_object* soft, const es_soft_band* band, uint32_t substep, float h, float* pushes)
{
    const float thickness = soft->desc.thickness;
    for (uint32_t s = band->begin; s < band->end; s++) {
        float* x = soft->x + 4 * (size_t)s;
        if (!(x[3] > 0)) continue;
        for (uint32_t k = 0; k < soft->plane_count[s]; k++) {
            const es_soft_plane* plane = &soft->planes[(size_t)s * ES_SOFT_PLANES + k];
            const es_soft_obstacle* obstacle = &soft->obstacles[plane->obstacle];
            const es_vec3 n = plane->normal, v = plane->velocity;
            float moved = es_v3_dot(n, v) * h * (float)(substep + 1);
            float depth = plane->offset + moved + thickness - es_v3_dot(n, es_v3(x[0], x[1], x[2]));
            if (!(depth > 0)) continue;
            es_vec3 to = es_v3(x[0] + n.x * depth, x[1] + n.y * depth, x[2] + n.z * depth);
            const float* o = soft->previous + 4 * (size_t)s;
            es_vec3 slip = es_v3(to.x - o[0] - v.x * h, to.y - o[1] - v.y * h, to.z - o[2] - v.z * h);
            slip = es_v3_sub(slip, es_v3_scale(n, es_v3_dot(slip, n)));
            float length = es_v3_length(slip), held = obstacle->friction * depth;
            to = es_v3_sub(to, es_v3_scale(slip, length > held ? held / length : 1.0f));
            float mass = 1.0f / x[3];
            es_vec3 got = es_v3((to.x - x[0]) * mass, (to.y - x[1]) * mass, (to.z - x[2]) * mass);
            x[0] = to.x;
            x[1] = to.y;
            x[2] = to.z;
            if (!obstacle->pushed) continue;
            float* push = pushes + 6 * (size_t)plane->obstacle;
            es_vec3 turn = es_v3_cross(es_v3_sub(to, obstacle->centre[1]), got);
            push[0] += got.x;
            push[1] += got.y;
            push[2] += got.z;
            push[3] += turn.x;
            push[4] += turn.y;
            push[5] += turn.z;
        }
    }
}

/* Contact after substep `substep`. */
static void meet(const step_job* job, uint32_t band_index, uint32_t substep)
{
    es_soft_object* soft = job->soft;
    const es_soft_band* band = &soft->layout.bands[band_index];
    float* pushes = soft->pushes + 6 * (size_t)soft->obstacle_count * band_index;
    for (uint32_t i = 0; i < soft->obstacle_count; i++) {
        if (!soft->obstacles[i].capsule) continue;
        job->kernels->soft_contact(soft->x, soft->previous, &soft->surfaces[(size_t)substep * soft->obstacle_count + i], band->begin, band->end, pushes + 6 * (size_t)i);
    }
    if (soft->plane_slots) meet_planes(soft, band, substep, job->motion.h, pushes);
}

/* Holds, then what hands hold. */
static uint32_t held_particle(const es_soft_object* soft, uint32_t i) { return i < soft->hold_count ? soft->holds[i].particle : soft->grabbed[i - soft->hold_count]; }

/* What is held by a body has a mass, which is put back to where it belongs: the momentum that takes is the body's. */
static void hold(const step_job* job, const es_soft_band* band, uint32_t substep)
{
    es_soft_object* soft = job->soft;
    const float share = (float)(substep + 1) / (float)job->substeps, before = (float)substep / (float)job->substeps;
    for (uint32_t i = 0; i < soft->hold_count + soft->grab_count; i++) {
        uint32_t slot = soft->layout.slot_of[held_particle(soft, i)];
        if (slot < band->begin || slot >= band->end) continue;
        float *x = soft->x + 4 * (size_t)slot, *previous = soft->previous + 4 * (size_t)slot, *start = soft->anchors.start + 4 * (size_t)i;
        const float* end = soft->anchors.end + 4 * (size_t)i;
        for (int k = 0; k < 3; k++) {
            previous[k] = start[k] + (end[k] - start[k]) * before;
            x[k] = substep + 1 == job->substeps ? end[k] : start[k] + (end[k] - start[k]) * share;
        }
    }
}

static void feel(const step_job* job, const es_soft_band* band, uint32_t substep)
{
    es_soft_object* soft = job->soft;
    const float share = (float)(substep + 1) / (float)job->substeps;
    for (uint32_t i = 0; i < soft->hold_count + soft->grab_count; i++) {
        uint32_t slot = soft->layout.slot_of[held_particle(soft, i)];
        if (slot < band->begin || slot >= band->end) continue;
        float *x = soft->x + 4 * (size_t)slot, *start = soft->anchors.start + 4 * (size_t)i, *end = soft->anchors.end + 4 * (size_t)i;
        for (int k = 0; k < 3; k++) {
            float place = substep + 1 == job->substeps ? end[k] : start[k] + (end[k] - start[k]) * share;
            if (i < soft->hold_count && soft->holds[i].body) soft->pulls[3 * (size_t)i + k] += (x[k] - place) * soft->mass[soft->holds[i].particle];
            x[k] = place;
        }
    }
}

static void own_part(const step_job* job, uint32_t b, uint32_t substep)
{
    es_soft_object* soft = job->soft;
    const es_soft_layout* layout = &soft->layout;
    const es_soft_band* band = &layout->bands[b];
    es_soft_motion motion = job->motion;
    if (substep > 0) {
        feel(job, band, substep - 1);
        meet(job, b, substep - 1);
    }
    motion.first = substep == 0;
    job->kernels->soft_move(&motion, band->begin, band->end);
    hold(job, band, substep);
    if (soft->anchors.active) {
        es_soft_reach reach = job->reach;
        reach.share = (float)(substep + 1) / (float)job->substeps;
        job->kernels->soft_reach(soft->x, &reach, band->begin, band->end);
    }
    job->kernels->soft_links(soft->x, layout->links + band->links[0], band->links[1] - band->links[0], job->inverse_h2);
    job->kernels->soft_volumes(soft->x, layout->volumes + band->volumes[0], band->volumes[1] - band->volumes[0], job->volume_compliance);
}

static void seam(const step_job* job, uint32_t b)
{
    const es_soft_layout* layout = &job->soft->layout;
    const es_soft_band* band = &layout->bands[b];
    job->kernels->soft_links(job->soft->x, layout->links + band->links[2], band->links[3] - band->links[2], job->inverse_h2);
    job->kernels->soft_volumes(job->soft->x, layout->volumes + band->volumes[2], band->volumes[3] - band->volumes[2], job->volume_compliance);
}

static void run_tasks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const step_job* job = user;
    const uint32_t bands = job->soft->layout.band_count;
    for (uint32_t task = begin; task < end; task++) {
        const uint32_t s = task / bands, b = task % bands;
        wait_for(&job->done[b], s);
        if (b + 1 < bands) wait_for(&job->done[b + 1], s);
        if (s == job->count) {
            const es_soft_band* band = &job->soft->layout.bands[b];
            feel(job, band, job->substeps - 1);
            meet(job, b, job->substeps - 1);
            job->kernels->soft_settle(&job->motion, band->begin, band->end, &job->fastest[b]);
        } else {
            own_part(job, b, job->first + s);
            if (b > 0) {
                wait_for(&job->done[b - 1], s + 1);
                seam(job, b);
            }
        }
        atomic_store_explicit(&job->done[b], s + 1, memory_order_release);
    }
}

/* Substeps [first, first + count) of all bands. */
static void run_substeps(es_context* context, step_job* job, uint32_t first, uint32_t count, bool last)
{
    const uint32_t bands = job->soft->layout.band_count;
    job->first = first;
    job->count = count;
    job->last = last;
    for (uint32_t b = 0; b < bands; b++) atomic_store_explicit(&job->done[b], 0, memory_order_relaxed);
    const uint32_t tasks = bands * (count + (last ? 1 : 0));
    /* a body of one band has no two tasks that could run at once */
    es_parallel_for(context, tasks, bands == 1 ? tasks : 1, run_tasks, job);
}

/* ---- air ---------------------------------------------------------------------------------------------------------------- */

typedef struct air_job { const es_sim_kernels* kernels; es_soft_air air; es_soft_object* soft; } air_job;

static void face_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const air_job* job = user;
    const es_soft_layout* layout = &job->soft->layout;
    job->kernels->face_normals(job->soft->x, layout->indices, begin, end, 1.0f, layout->fans.faces);
}

static void air_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const air_job* job = user;
    job->kernels->soft_air(&job->air, begin, end);
}

static double enclosed(const es_soft_object* soft)
{
    const es_soft_layout* layout = &soft->layout;
    const float* base = soft->x;
    double volume = 0;
    for (uint32_t t = 0; t < layout->triangle_count; t++) {
        const float *p = soft->x + 4 * (size_t)layout->indices[3 * (size_t)t], *f = layout->fans.faces + 4 * (size_t)t;
        for (int k = 0; k < 3; k++) volume += (double)f[k] * ((double)p[k] - (double)base[k]) / 6;
    }
    return volume;
}

static bool blow(es_world* world, es_soft_object* soft, const es_sim_kernels* kernels, float h)
{
    if (soft->tetrahedron_count || (soft->desc.pressure == 0 && soft->desc.drag == 0) || soft->layout.triangle_count == 0) return false;
    const es_soft_layout* layout = &soft->layout;
    air_job job = {kernels, {layout->fans.first_row, layout->fans.rows, layout->fans.faces, soft->x, soft->velocity, soft->acceleration, soft->desc.wind, 0, soft->desc.drag * h, 1.0f / h}, soft};
    es_parallel_for(world->context, layout->triangle_count, 4096, face_body, &job);
    if (soft->desc.pressure != 0) {
        double volume = enclosed(soft), rest = (double)soft->rest_volume, least = 0.05 * __builtin_fabs(rest);
        /* the sign: outside is where the triangles of a mesh with a positive volume face */
        double ratio = rest / (__builtin_fabs(volume) > least ? volume : rest > 0 ? least : -least);
        job.air.pressure = rest == 0 ? 0 : (float)((double)soft->desc.pressure * (ratio < 0 ? 0 : ratio) * (rest > 0 ? 1 : -1));
    }
    es_parallel_for(world->context, layout->slot_count / 8, 256, air_body, &job);
    return true;
}

/* ---- the step -------------------------------------------------------------------------------------------------------------- */

/* Twice as many particles along an edge need twice as many substeps for the same stretch. */
uint32_t es_soft_substeps(const es_soft_object* soft, uint32_t world_substeps)
{
    uint32_t count = soft->desc.substeps;
    if (count) return count;
    float side = es_sqrt((float)soft->first_particles);
    if (soft->tetrahedron_count) side = 2 * es_exp2(es_log2((float)soft->first_particles + 1.0f) / 3);
    count = (uint32_t)(side * 0.075f * (float)world_substeps + 0.5f);
    return count < 2 * world_substeps ? 2 * world_substeps : count > 1024 ? 1024 : count;
}

void es_soft_wake(es_soft_object* soft)
{
    soft->asleep = false;
    soft->still = 0;
}

/* Far from its origin a float has no millimetres left: the origin follows, by whole metres. */
static void follow(es_soft_object* soft)
{
    double shift[3];
    bool far = false;
    for (int k = 0; k < 3; k++) {
        shift[k] = (double)(int64_t)soft->x[k];
        far |= shift[k] > 512 || shift[k] < -512;
    }
    if (!far) return;
    for (int k = 0; k < 3; k++) {
        soft->origin[k] += shift[k];
        for (uint32_t s = 0; s < soft->layout.slot_count; s++) {
            if (soft->layout.particle_of[s] == ES_SOFT_NONE) continue;
            soft->x[4 * (size_t)s + k] = (float)((double)soft->x[4 * (size_t)s + k] - shift[k]);
            soft->before[4 * (size_t)s + k] = (float)((double)soft->before[4 * (size_t)s + k] - shift[k]);
        }
    }
}

/* Places of what is held at the step's begin and end. Did any move? */
static bool aim(const es_world* world, es_soft_object* soft, float h)
{
    bool moves = false;
    for (uint32_t i = 0; i < soft->hold_count; i++) {
        const float* x = soft->x + 4 * (size_t)soft->layout.slot_of[soft->holds[i].particle];
        es_vec3 to = es_soft_hold_place(world, soft, &soft->holds[i]);
        const float end[3] = {to.x, to.y, to.z};
        for (int k = 0; k < 3; k++) {
            soft->anchors.start[4 * (size_t)i + k] = x[k];
            soft->anchors.end[4 * (size_t)i + k] = end[k];
            moves |= x[k] != end[k];
        }
    }
    soft->grab_count = 0;
    for (uint32_t hand = 0; hand < ES_HANDS; hand++) {
        const es_hand_state* state = &world->hands[hand];
        if (state->soft != soft->object.id) continue;
        const uint32_t count = soft->tetrahedron_count ? soft->particle_count : soft->first_vertices;
        if (state->vertex >= count) continue;
        const uint32_t particle = soft->tetrahedron_count ? state->vertex : soft->particle_at[state->vertex], i = soft->hold_count + soft->grab_count;
        const float* x = soft->x + 4 * (size_t)soft->layout.slot_of[particle];
        if (!(x[3] > 0)) continue; /* what holds it is stronger */
        double way[3], length = 0;
        for (int k = 0; k < 3; k++) {
            way[k] = state->target[k] - soft->origin[k] - (double)x[k];
            length += way[k] * way[k];
        }
        length = __builtin_sqrt(length);
        const double share = length > HAND_SPEED * (double)h ? HAND_SPEED * (double)h / length : 1;
        soft->grabbed[soft->grab_count++] = particle;
        for (int k = 0; k < 3; k++) {
            soft->anchors.start[4 * (size_t)i + k] = x[k];
            soft->anchors.end[4 * (size_t)i + k] = (float)((double)x[k] + way[k] * share);
        }
        moves |= length > 1e-6;
    }
    return moves;
}

static bool reserve(es_world* world, es_soft_object* soft, uint32_t substeps)
{
    es_context* context = world->context;
    const uint32_t bands = soft->layout.band_count;
    const size_t pushes = 6 * (size_t)soft->obstacle_count * bands + 1, surfaces = (size_t)substeps * soft->obstacle_count + 1;
    const size_t progress = bands * (sizeof(atomic_uint) + sizeof(float));
    if (!es_grow(context, (void**)&soft->pushes, &soft->push_capacity, 0, pushes, sizeof *soft->pushes) ||
        !es_grow(context, (void**)&soft->surfaces, &soft->surface_capacity, 0, surfaces, sizeof *soft->surfaces) ||
        !es_grow(context, &soft->progress, &soft->progress_capacity, 0, progress, 1) ||
        !es_grow(context, (void**)&soft->pulls, &soft->pull_capacity, 0, 3 * (size_t)soft->hold_count + 1, sizeof *soft->pulls))
        return false;
    memset(soft->pushes, 0, pushes * sizeof *soft->pushes);
    memset(soft->pulls, 0, (3 * (size_t)soft->hold_count + 1) * sizeof *soft->pulls);
    return true;
}

/* Where each capsule is in each substep. */
static void place_surfaces(es_soft_object* soft, uint32_t substeps)
{
    for (uint32_t s = 0; s < substeps; s++)
        for (uint32_t i = 0; i < soft->obstacle_count; i++) {
            const es_soft_obstacle* o = &soft->obstacles[i];
            if (!o->capsule) continue;
            const float t = (float)(s + 1) / (float)substeps, part = 1.0f / (float)substeps;
            es_vec3 a = es_v3_add(o->a[0], es_v3_scale(es_v3_sub(o->a[1], o->a[0]), t)), b = es_v3_add(o->b[0], es_v3_scale(es_v3_sub(o->b[1], o->b[0]), t));
            es_vec3 along = es_v3_sub(b, a);
            float squared = es_v3_dot(along, along);
            es_vec3 centre = es_v3_add(o->centre[0], es_v3_scale(es_v3_sub(o->centre[1], o->centre[0]), t));
            soft->surfaces[(size_t)s * soft->obstacle_count + i] = (es_soft_surface){.a = a, .along = along, .inverse_length2 = squared > 1e-12f ? 1.0f / squared : 0,
                .radius = o->radius + soft->desc.thickness, .friction = o->friction, .centre = centre,
                .moved = es_v3_scale(es_v3_sub(o->centre[1], o->centre[0]), part), .turned = es_v3_scale(o->turned, part)};
        }
}

es_result es_soft_step_one(es_world* world, es_soft_object* soft, float h, uint32_t world_substeps)
{
    es_context* context = world->context;
    const size_t bytes = 4 * (size_t)soft->layout.slot_count * sizeof(float);
    follow(soft);
    const bool held_moves = aim(world, soft, h);
    if (soft->asleep && (held_moves || !world->settings.sleep)) es_soft_wake(soft);
    if (!es_soft_gather_obstacles(world, soft, h)) return es_context_last_result(context); /* may wake it */
    if (soft->asleep) return ES_OK;

    const uint32_t substeps = es_soft_substeps(soft, world_substeps);
    if (!reserve(world, soft, substeps)) return es_context_last_result(context);
    if (soft->desc.self_collision && !es_soft_find_pairs(context, soft, h)) return es_context_last_result(context);
    memcpy(soft->before, soft->x, bytes);
    soft->posed = false;
    place_surfaces(soft, substeps);

    const float part = h / (float)substeps, squared = 1.0f / (part * part);
    const es_vec3 g = world->settings.gravity;
    step_job job = {.soft = soft, .kernels = es_sim_kernel_table(es_context_isa(context)), .substeps = substeps, .inverse_h2 = squared};
    job.done = soft->progress;
    job.fastest = (float*)(job.done + soft->layout.band_count);
    job.volume_compliance = soft->desc.volume_compliance * squared;
    job.motion = (es_soft_motion){.x = soft->x, .previous = soft->previous, .velocity = soft->velocity, .gravity = es_v3_scale(g, soft->desc.gravity_scale), .h = part,
        .inverse_h = 1.0f / part, .keep = 1.0f / (1.0f + soft->desc.damping * part), .limit = ES_SOFT_SPEED};
    if (blow(world, soft, job.kernels, h)) job.motion.acceleration = soft->acceleration;
    job.reach = (es_soft_reach){{soft->anchors.index[0], soft->anchors.index[1]}, {soft->anchors.reach[0], soft->anchors.reach[1]}, soft->anchors.start, soft->anchors.end, 0};
    if (soft->pair_count && soft->desc.self_collision) {
        const uint32_t round = substeps < 4 ? 1 : substeps / 4;
        for (uint32_t first = 0; first < substeps; first += round) {
            bool last = first + round >= substeps;
            run_substeps(context, &job, first, last ? substeps - first : round, last);
            es_soft_part_pairs(soft);
        }
        /* the last parting counts as motion too */
        for (uint32_t b = 0; b < soft->layout.band_count; b++) job.kernels->soft_settle(&job.motion, soft->layout.bands[b].begin, soft->layout.bands[b].end, &job.fastest[b]);
    } else {
        run_substeps(context, &job, 0, substeps, true);
    }
    es_soft_push_bodies(world, soft, part);

    float fastest = 0;
    for (uint32_t b = 0; b < soft->layout.band_count; b++) fastest = es_maxf(fastest, job.fastest[b]);
    soft->still = fastest < ES_SOFT_SLEEP_SPEED * ES_SOFT_SLEEP_SPEED ? soft->still + h : 0;
    if (world->settings.sleep && soft->still >= ES_SOFT_SLEEP_SECONDS && !held_moves) {
        soft->asleep = true;
        memset(soft->velocity, 0, bytes);
        memcpy(soft->before, soft->x, bytes);
    }
    if (soft->desc.tear_stretch > 0 && !es_soft_tear_stretched(world, soft)) return es_context_last_result(context);
    return ES_OK;
}

es_result es_soft_step(es_world* world, float h, uint32_t substeps)
{
    const es_slots* slots = &world->slots[ES_OBJECT_SOFT];
    es_result first = ES_OK; /* what one cloth has no memory for the others do not miss */
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_soft_object* soft = es_slots_at(slots, slot);
        es_result result = soft ? es_soft_step_one(world, soft, h, substeps) : ES_OK;
        if (first == ES_OK) first = result;
    }
    return first;
}
