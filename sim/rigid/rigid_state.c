/* State of the rigid bodies: see rigid_state.h.
 *
 * Of contacts those are state that have manifolds or touch; the others are found anew. Which points of a manifold lie where is state too:
 * sleeping contacts are not computed again when they wake. The tree is not: it reports the same pairs whatever its shape. */
#include "sim/rigid/rigid_state.h"

#include "platform/maths.h"
#include "sim/rigid/hands.h"

static bool good_rotation(const es_quat* q)
{
    if (!es_all_within(&q->x, 4, 2.0f)) return false;
    float squared = q->x * q->x + q->y * q->y + q->z * q->z + q->w * q->w;
    return squared > 0.99f && squared < 1.01f;
}

void es_visit_body(es_world* world, state_io* io, es_body_object* body)
{
    es_body_object now = *body;
    visit_position(io, now.centre);
    visit_position(io, now.previous_centre);
    visit_position(io, now.seen_position);
    visit_floats(io, &now.rotation.x, 4);
    visit_floats(io, &now.previous_rotation.x, 4);
    visit_floats(io, &now.seen_rotation.x, 4);
    visit_floats(io, &now.velocity.x, 3);
    visit_floats(io, &now.angular_velocity.x, 3);
    visit_floats(io, &now.force.x, 3);
    visit_floats(io, &now.torque.x, 3);
    visit_floats(io, &now.still, 1);
    visit_u32(io, &now.island);
    visit_flag(io, &now.asleep);
    if (!reading(io) || !io->good) return;
    for (int k = 0; k < 3; k++) io->good &= __builtin_fabs(now.centre[k]) <= 4e9 && __builtin_fabs(now.previous_centre[k]) <= 4e9;
    io->good &= good_rotation(&now.rotation) && good_rotation(&now.previous_rotation) && good_rotation(&now.seen_rotation);
    io->good &= es_all_within(&now.velocity.x, 3, 1e9f) && es_all_within(&now.angular_velocity.x, 3, 1e9f);
    io->good &= es_all_within(&now.force.x, 3, 1e18f) && es_all_within(&now.torque.x, 3, 1e24f) && es_within(now.still, 0, 1e9f);
    io->good &= now.island <= ES_SLOT_LIMIT && (!now.asleep || body->type == ES_BODY_DYNAMIC);
    if (io->mode != APPLY || !io->good) return;
    now.index = UINT32_MAX;
    *body = now;
}

void es_body_signature(const es_body_object* body, uint32_t words[2])
{
    words[0] = (uint32_t)body->type | body->shape_count << 2;
    memcpy(&words[1], &body->mass, sizeof words[1]);
}

/* ---- contacts ------------------------------------------------------------------------------------------------------------------ */

static void visit_manifold(state_io* io, es_contact_manifold* m)
{
    visit_floats(io, &m->geometry.normal.x, 3);
    visit_u32(io, &m->geometry.key);
    visit_u32(io, &m->count);
    if (reading(io) && (!io->good || m->count < 1 || m->count > ES_MANIFOLD_POINTS)) {
        io->good = false;
        return;
    }
    m->geometry.count = m->count;
    for (uint32_t k = 0; k < m->count; k++) {
        es_manifold_point* point = &m->geometry.points[k];
        visit_floats(io, &point->point.x, 3);
        visit_floats(io, &point->separation, 1);
        visit_u32(io, &point->id);
        visit_floats(io, &point->normal_impulse, 1);
        if (reading(io)) io->good &= es_all_within(&point->point.x, 3, 1e9f) && es_within(point->separation, -1e9f, 1e9f) && es_within(point->normal_impulse, 0, 1e30f);
    }
    visit_floats(io, &m->apart.x, 3);
    visit_floats(io, &m->friction.x, 3);
    visit_floats(io, &m->twist, 1);
    visit_floats(io, &m->rolling.x, 3);
    if (reading(io))
        io->good &= es_all_within(&m->geometry.normal.x, 3, 1.01f) && es_all_within(&m->apart.x, 3, 1e9f) && es_all_within(&m->friction.x, 3, 1e30f) &&
                    es_within(m->twist, -1e30f, 1e30f) && es_all_within(&m->rolling.x, 3, 1e30f);
}

static bool is_state(const es_contact* contact) { return contact->count > 0 || contact->touching; }

static bool good_key(const es_world* world, uint32_t key)
{
    const es_body_object* body = es_body_of_key(world, key);
    return body && (key & (ES_SHAPES_PER_BODY - 1)) < body->shape_count;
}

static void save_contacts(state_io* io, es_contacts* contacts)
{
    uint32_t counts[2] = {0, 0};
    for (size_t i = 0; i < contacts->count; i++) {
        if (!is_state(&contacts->list[i])) continue;
        counts[0]++;
        counts[1] += contacts->list[i].count;
    }
    visit_u32(io, &counts[0]);
    visit_u32(io, &counts[1]);
    for (size_t i = 0; i < contacts->count; i++) {
        es_contact* contact = &contacts->list[i];
        if (!is_state(contact)) continue;
        visit_u32(io, &contact->a);
        visit_u32(io, &contact->b);
        visit_u32(io, &contact->count);
        visit_flag(io, &contact->touching);
        for (uint32_t k = 0; k < contact->count; k++) visit_manifold(io, &contacts->manifolds[contact->first + k]);
    }
}

/* Writes to `contacts` beyond what it holds when only checking. */
static void read_contacts(es_world* world, state_io* io, es_contacts* contacts)
{
    uint32_t counts[2] = {0, 0};
    visit_u32(io, &counts[0]);
    visit_u32(io, &counts[1]);
    if (!io->good) return;
    /* no more than the buffer could hold: a damaged count must not ask for memory */
    if (counts[0] > io->size / 16 || counts[1] > io->size / 64) {
        io->good = false;
        return;
    }
    /* twice: the larger of both lists is then room for the events of either's leaving */
    if (io->mode == CHECK && (!es_contacts_reserve(world->context, contacts, counts[0], counts[1]) || !es_events_reserve(world, 2 * (size_t)counts[0]))) {
        io->good = false;
        io->no_memory = true;
        return;
    }
    uint32_t manifolds = 0;
    es_contact last = {0};
    for (uint32_t i = 0; i < counts[0] && io->good; i++) {
        es_contact contact = {.first = manifolds};
        visit_u32(io, &contact.a);
        visit_u32(io, &contact.b);
        visit_u32(io, &contact.count);
        visit_flag(io, &contact.touching);
        io->good = io->good && contact.a < contact.b && good_key(world, contact.a) && good_key(world, contact.b) && contact.count <= ES_MESH_MANIFOLDS &&
                   contact.count <= counts[1] - manifolds && (i == 0 || contact.a > last.a || (contact.a == last.a && contact.b > last.b));
        if (!io->good) return;
        for (uint32_t k = 0; k < contact.count && io->good; k++) {
            es_contact_manifold manifold = {0};
            visit_manifold(io, &manifold);
            if (io->mode == APPLY) contacts->manifolds[manifolds + k] = manifold;
        }
        manifolds += contact.count;
        last = contact;
        es_contact_resolve(world, &contact);
        io->good = io->good && !(contact.sensor && contact.count); /* a sensor touches without manifolds: there is no room for any */
        if (io->mode == APPLY) contacts->list[i] = contact;
    }
    io->good = io->good && manifolds == counts[1];
    if (io->mode != APPLY) return;
    contacts->count = counts[0];
    contacts->manifold_count = manifolds;
}

static void visit_contacts(es_world* world, state_io* io, es_contacts* contacts)
{
    if (reading(io)) read_contacts(world, io, contacts);
    else save_contacts(io, contacts);
}

/* ---- the whole ------------------------------------------------------------------------------------------------------------------- */

static void boxes_anew(es_world* world, bool from_nothing)
{
    const es_slots* slots = &world->slots[ES_OBJECT_BODY];
    if (from_nothing) es_dynamic_tree_clear(&world->rigid->tree);
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_body_object* body = es_slots_at(slots, slot);
        if (!body) continue;
        if (from_nothing) es_body_enter_tree(world, body);
        else es_body_refresh_tree(world, body, es_v3(0, 0, 0));
    }
}

void es_visit_rigid(es_world* world, state_io* io)
{
    es_visit_hands(world, io);
    es_rigid* rigid = world->rigid;
    if (!rigid) return; /* restoring a world with bodies into one that never had any is refused by the content's signature */
    double origin[3];
    memcpy(origin, rigid->origin, sizeof origin);
    visit_position(io, origin);
    visit_contacts(world, io, &rigid->contacts);
    visit_contacts(world, io, &rigid->asleep);
    if (io->mode != APPLY || !io->good) return;
    bool elsewhere = memcmp(origin, rigid->origin, sizeof origin) != 0;
    memcpy(rigid->origin, origin, sizeof origin);
    rigid->unsorted = true;
    rigid->event_count = 0;
    boxes_anew(world, elsewhere);
}
