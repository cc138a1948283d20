/* What sleeps and wakes together.
 *
 * An island is what hangs together by contacts and joints between dynamic bodies. When all of it has been still for a while it falls asleep:
 * it is no longer computed, and its contacts are put aside as they are. It wakes as a whole, when something that moves touches
 * one of its bodies or when a public function says so, and goes on with the same impulses. */
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/joints.h"

void es_body_wake(es_world* world, es_body_object* body)
{
    body->still = 0;
    if (!body->asleep) return;
    const es_slots* slots = &world->slots[ES_OBJECT_BODY];
    uint32_t island = body->island;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_body_object* other = es_slots_at(slots, slot);
        if (!other || !other->asleep || other->island != island) continue;
        other->asleep = false;
        other->still = 0;
    }
    world->rigid->unsorted = true;
}

static void wake_other(es_world* world, const es_contacts* contacts, uint32_t slot)
{
    for (size_t i = 0; i < contacts->count; i++) {
        const es_contact* contact = &contacts->list[i];
        uint32_t a = contact->a >> ES_SHAPE_BITS, b = contact->b >> ES_SHAPE_BITS;
        if (a == slot) es_body_wake(world, es_body_of_key(world, contact->b));
        else if (b == slot) es_body_wake(world, es_body_of_key(world, contact->a));
    }
}

void es_body_wake_neighbours(es_world* world, es_body_object* body)
{
    if (!world->rigid) return;
    wake_other(world, &world->rigid->contacts, es_slot_of(body->object.id));
    wake_other(world, &world->rigid->asleep, es_slot_of(body->object.id));
}

static void append(es_contacts* to, const es_contacts* from, const es_contact* contact)
{
    es_contact* copy = &to->list[to->count++];
    *copy = *contact;
    copy->first = (uint32_t)to->manifold_count;
    if (contact->count) memcpy(to->manifolds + to->manifold_count, from->manifolds + contact->first, contact->count * sizeof *to->manifolds);
    to->manifold_count += contact->count;
}

static void swap(es_contacts* a, es_contacts* b)
{
    es_contacts c = *a;
    *a = *b;
    *b = c;
}

bool es_sort_contacts(es_world* world)
{
    es_rigid* rigid = world->rigid;
    if (!rigid->unsorted) return true;
    es_contacts *awake = &rigid->contacts, *asleep = &rigid->asleep, *to_awake = &rigid->next, *to_asleep = &rigid->next_asleep;
    size_t count = awake->count + asleep->count, manifolds = awake->manifold_count + asleep->manifold_count;
    to_awake->count = to_awake->manifold_count = to_asleep->count = to_asleep->manifold_count = 0;
    if (!es_contacts_reserve(world->context, to_awake, count, manifolds) || !es_contacts_reserve(world->context, to_asleep, count, manifolds)) return false;
    for (size_t i = 0, j = 0; i < awake->count || j < asleep->count;) {
        bool first = j == asleep->count ||
                     (i < awake->count && (awake->list[i].a != asleep->list[j].a ? awake->list[i].a < asleep->list[j].a : awake->list[i].b < asleep->list[j].b));
        const es_contacts* from = first ? awake : asleep;
        const es_contact* contact = first ? &awake->list[i++] : &asleep->list[j++];
        bool is_awake = es_body_is_awake(es_body_of_key(world, contact->a)) || es_body_is_awake(es_body_of_key(world, contact->b));
        append(is_awake ? to_awake : to_asleep, from, contact);
    }
    swap(awake, to_awake);
    swap(asleep, to_asleep);
    rigid->unsorted = false;
    return true;
}

/* ---- falling asleep --------------------------------------------------------------------------------------------------------- */

/* Roots are the least of their island, so that the numbering depends on who is joined alone. */
uint32_t es_island_root(uint32_t* parents, uint32_t i)
{
    while (parents[i] != i) {
        parents[i] = parents[parents[i]];
        i = parents[i];
    }
    return i;
}

void es_island_join(uint32_t* parents, uint32_t a, uint32_t b)
{
    a = es_island_root(parents, a);
    b = es_island_root(parents, b);
    if (a < b) parents[b] = a;
    else parents[a] = b;
}

bool es_islands_reserve(es_world* world)
{
    es_rigid* rigid = world->rigid;
    const uint32_t count = rigid->dynamic_count;
    return es_grow(world->context, (void**)&rigid->parents, &rigid->parent_capacity, 0, count, sizeof *rigid->parents) &&
           es_grow(world->context, (void**)&rigid->stillness, &rigid->stillness_capacity, 0, count, sizeof *rigid->stillness);
}

void es_islands_sleep(es_world* world, float h)
{
    es_rigid* rigid = world->rigid;
    const es_slots* slots = &world->slots[ES_OBJECT_BODY];
    bool any = false;
    for (uint32_t i = 0; i < rigid->dynamic_count; i++) {
        es_body_object* body = es_slots_at(slots, rigid->moving[i]);
        float speed = es_v3_length(body->velocity) + es_v3_length(body->angular_velocity) * body->reach;
        body->still = speed < ES_SLEEP_SPEED && !body->no_sleep ? body->still + h : 0.0f;
        any |= body->still >= ES_SLEEP_SECONDS;
    }
    if (!any || !world->settings.sleep) return;
    const uint32_t count = rigid->dynamic_count;
    uint32_t* parents = rigid->parents;
    float* stillness = rigid->stillness;
    for (uint32_t i = 0; i < count; i++) parents[i] = i;
    for (size_t i = 0; i < rigid->contacts.count; i++) {
        const es_contact* contact = &rigid->contacts.list[i];
        if (!contact->count) continue;
        const es_body_object *a = es_body_of_key(world, contact->a), *b = es_body_of_key(world, contact->b);
        if (a->type == ES_BODY_DYNAMIC && b->type == ES_BODY_DYNAMIC) es_island_join(parents, a->index, b->index);
    }
    es_joints_unite(world, parents, es_island_join);
    for (uint32_t i = 0; i < count; i++) stillness[i] = 1e30f;
    for (uint32_t i = 0; i < count; i++) {
        const es_body_object* body = es_slots_at(slots, rigid->moving[i]);
        uint32_t root = es_island_root(parents, i);
        stillness[root] = es_minf(stillness[root], body->still);
    }
    for (uint32_t i = 0; i < count; i++) {
        es_body_object* body = es_slots_at(slots, rigid->moving[i]);
        uint32_t root = es_island_root(parents, i);
        if (stillness[root] < ES_SLEEP_SECONDS) continue;
        body->asleep = true;
        body->island = rigid->moving[root];
        body->velocity = body->angular_velocity = es_v3(0, 0, 0);
        rigid->unsorted = true;
    }
}
