/* State of cloth and soft bodies: see soft_state.h.
 *
 * Places and velocities go by particle, so that the layout, which follows from the topology, is no part of it. The topology is state where
 * the cloth may tear; it comes first, so that applying it makes the layout that the rest is put into. */
#include "sim/soft/soft_state.h"

#include "platform/maths.h"

static void visit_numbers(es_soft_object* soft, state_io* io)
{
    es_soft_desc now = soft->desc;
    visit_floats(io, &now.stretch_compliance, 1);
    visit_floats(io, &now.shear_compliance, 1);
    visit_floats(io, &now.bend_compliance, 1);
    visit_floats(io, &now.volume_compliance, 1);
    visit_floats(io, &now.damping, 1);
    visit_floats(io, &now.thickness, 1);
    visit_floats(io, &now.friction, 1);
    visit_floats(io, &now.drag, 1);
    visit_floats(io, &now.wind.x, 3);
    visit_floats(io, &now.pressure, 1);
    visit_floats(io, &now.gravity_scale, 1);
    visit_floats(io, &now.tear_stretch, 1);
    visit_flag(io, &now.self_collision);
    if (!reading(io) || !io->good) return;
    io->good = es_soft_numbers_valid(&now) && (now.tear_stretch == 0 || now.tearable) && (!now.self_collision || soft->tetrahedron_count == 0) &&
               (now.bend_compliance < 0) == (soft->desc.bend_compliance < 0);
    if (io->mode == APPLY && io->good) es_soft_take_numbers(&soft->desc, &now);
}

/* Corners, and of the particles that tearing made where they come from. */
static uint32_t visit_topology(es_soft_object* soft, state_io* io)
{
    uint32_t count = soft->particle_count, torn = soft->torn;
    bool cut = soft->cut;
    visit_u32(io, &count);
    visit_u32(io, &torn);
    visit_flag(io, &cut);
    if (reading(io) && io->good) io->good = count >= soft->first_particles && count <= soft->particle_room && (cut ? soft->desc.tearable : count == soft->first_particles);
    if (reading(io) && !io->good) return 0;
    const bool apply = io->mode == APPLY;
    if (apply) {
        soft->particle_count = count;
        soft->torn = torn;
        if (!cut && soft->cut) es_soft_mend(soft);
        soft->cut = cut;
    }
    if (!cut) return count;
    bool gone = false; /* the triangle: all of its corners */
    for (size_t i = 0; i < 3 * (size_t)soft->triangle_count && (io->good || !reading(io)); i++) {
        uint32_t corner = soft->corners[i];
        visit_u32(io, &corner);
        if (i % 3 == 0) gone = corner == ES_SOFT_NONE;
        if (reading(io)) io->good = io->good && (gone ? corner == ES_SOFT_NONE : corner < count);
        if (apply && io->good) soft->corners[i] = corner;
    }
    for (uint32_t p = 0; p < count && (io->good || !reading(io)); p++) {
        float mass = soft->mass[p], rest[3];
        visit_floats(io, &mass, 1);
        if (reading(io)) io->good = io->good && es_within(mass, 1e-20f, 1e7f);
        if (apply && io->good) soft->mass[p] = mass;
        if (p < soft->first_particles) continue;
        const uint32_t new = p - soft->first_particles;
        uint32_t parent = soft->parent[new], vertex = soft->first_vertex[p];
        for (int k = 0; k < 3; k++) rest[k] = soft->rest[3 * (size_t)p + k];
        visit_u32(io, &parent);
        visit_u32(io, &vertex);
        visit_floats(io, rest, 3);
        if (reading(io)) io->good = io->good && parent < p && vertex < soft->first_vertices && es_all_within(rest, 3, 1e7f);
        if (!apply || !io->good) continue;
        soft->parent[new] = parent;
        soft->first_vertex[p] = vertex;
        for (int k = 0; k < 3; k++) soft->rest[3 * (size_t)p + k] = rest[k];
    }
    return count;
}

static void visit_holds(es_world* world, es_soft_object* soft, state_io* io, uint32_t particles)
{
    uint32_t count = soft->hold_count, last = 0;
    visit_u32(io, &count);
    if (reading(io) && (!io->good || count > particles)) {
        io->good = false;
        return;
    }
    if (reading(io) && !es_grow(world->context, (void**)&soft->holds, &soft->hold_capacity, soft->hold_count, count, sizeof *soft->holds)) {
        io->good = false;
        io->no_memory = true;
        return;
    }
    if (io->mode == APPLY)
        for (uint32_t i = 0; i < soft->hold_count; i++) {
            es_world_rereference(world, ES_OBJECT_NODE, soft->holds[i].node, 0);
            es_world_rereference(world, ES_OBJECT_BODY, soft->holds[i].body, 0);
        }
    for (uint32_t i = 0; i < count && (io->good || !reading(io)); i++) {
        es_soft_hold hold = {0};
        if (!reading(io)) hold = soft->holds[i];
        visit_u32(io, &hold.particle);
        visit_u32(io, &hold.node);
        visit_u32(io, &hold.body);
        visit_floats(io, &hold.local.x, 3);
        if (!reading(io) || !io->good) continue;
        io->good = hold.particle < particles && (i == 0 || hold.particle > last) && (!hold.node || es_slots_get(&world->slots[ES_OBJECT_NODE], hold.node)) &&
                   (!hold.body || es_slots_get(&world->slots[ES_OBJECT_BODY], hold.body)) && !(hold.node && hold.body) && es_all_within(&hold.local.x, 3, 1e10f);
        last = hold.particle;
        if (io->mode != APPLY || !io->good) continue;
        soft->holds[i] = hold;
        es_world_rereference(world, ES_OBJECT_NODE, 0, hold.node);
        es_world_rereference(world, ES_OBJECT_BODY, 0, hold.body);
    }
    if (io->mode == APPLY) soft->hold_count = count;
}

/* There was no memory to lay out what was read: of the particles only the first remain, which any layout has places for, and none is held. The
 * next restore lays out anew. */
static void lie_untorn(es_world* world, es_soft_object* soft)
{
    for (uint32_t i = 0; i < soft->hold_count; i++) {
        es_world_rereference(world, ES_OBJECT_NODE, soft->holds[i].node, 0);
        es_world_rereference(world, ES_OBJECT_BODY, soft->holds[i].body, 0);
    }
    soft->hold_count = 0;
    soft->particle_count = soft->first_particles;
    es_soft_mend(soft);
    soft->cut = true;
}

void es_visit_soft(es_world* world, state_io* io, es_soft_object* soft)
{
    const bool was_cut = soft->cut;
    visit_numbers(soft, io);
    uint32_t count = visit_topology(soft, io);
    visit_holds(world, soft, io, count);
    if (io->mode == APPLY && io->good) {
        bool good = !(was_cut || soft->cut) || es_soft_relay(world, soft);
        if (!good) lie_untorn(world, soft);
        if (!good || !es_soft_make_anchors(world->context, soft)) {
            soft->anchors.active = false; /* those there are may be of another layout */
            io->good = false;
            io->no_memory = true;
            return;
        }
        es_soft_set_compliances(soft);
    }
    double origin[3] = {soft->origin[0], soft->origin[1], soft->origin[2]};
    visit_position(io, origin);
    bool asleep = soft->asleep;
    float still = soft->still;
    uint64_t seen = soft->seen;
    visit_flag(io, &asleep);
    visit_floats(io, &still, 1);
    transfer(io, &seen, sizeof seen);
    if (reading(io)) io->good = io->good && es_within(still, 0, 1e9f);
    for (uint32_t p = 0; p < count && (io->good || !reading(io)); p++) {
        float now[9];
        const bool known = io->mode != CHECK;
        const size_t at = known ? 4 * (size_t)soft->layout.slot_of[p] : 0;
        for (int k = 0; k < 3 && known; k++) {
            now[k] = soft->x[at + k];
            now[3 + k] = soft->velocity[at + k];
            now[6 + k] = soft->before[at + k];
        }
        visit_floats(io, now, 9);
        if (reading(io)) io->good = io->good && es_all_within(now, 9, 1e8f);
        if (io->mode != APPLY || !io->good) continue;
        for (int k = 0; k < 3; k++) {
            soft->x[at + k] = now[k];
            soft->velocity[at + k] = now[3 + k];
            soft->before[at + k] = now[6 + k];
        }
    }
    if (io->mode != APPLY || !io->good) return;
    memcpy(soft->origin, origin, sizeof origin);
    soft->asleep = asleep;
    soft->still = still;
    soft->seen = seen;
    soft->posed = false;
}

void es_soft_signature(const es_soft_object* soft, uint32_t words[2])
{
    words[0] = soft->first_particles;
    words[1] = soft->tetrahedron_count ? soft->tetrahedron_count : soft->triangle_count | 0x80000000u;
}
