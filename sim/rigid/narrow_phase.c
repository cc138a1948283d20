/* Where shapes touch: manifolds of all pairs, in parallel, and what began and ended. */
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/rigid.h"

/* The manifolds' points keep the impulses of points with the same feature in the step before. */
static void carry_over(es_contact_manifold* m, const es_contact_manifold* old, uint32_t old_count)
{
    m->friction = m->rolling = es_v3(0, 0, 0);
    m->twist = m->spare = 0;
    m->count = m->geometry.count;
    for (uint32_t k = 0; k < m->geometry.count; k++) m->geometry.points[k].normal_impulse = 0;
    for (uint32_t i = 0; i < old_count; i++) {
        if (old[i].geometry.key != m->geometry.key) continue;
        m->friction = old[i].friction;
        m->rolling = old[i].rolling;
        m->twist = old[i].twist;
        for (uint32_t k = 0; k < m->geometry.count; k++)
            for (uint32_t j = 0; j < old[i].geometry.count; j++)
                if (m->geometry.points[k].id == old[i].geometry.points[j].id) m->geometry.points[k].normal_impulse = old[i].geometry.points[j].normal_impulse;
        return;
    }
}

static es_vec3 speed_at(const es_body_object* body, es_vec3 arm) { return es_v3_add(body->velocity, es_v3_cross(body->angular_velocity, arm)); }

/* At which a's point comes towards b's, m/s. */
static float approach(const es_body_object* a, const es_body_object* b, const es_contact_manifold* m, const es_manifold_point* at)
{
    return es_v3_dot(es_v3_sub(speed_at(a, at->point), speed_at(b, es_v3_sub(at->point, m->apart))), m->geometry.normal);
}

static void collide(es_world* world, es_contact* contact, es_contact_manifold* manifolds, uint32_t capacity, const es_contact_manifold* old)
{
    const es_body_object *a = es_body_of_key(world, contact->a), *b = es_body_of_key(world, contact->b);
    const es_rigid_shape *s = es_shape_of_key(world, contact->a), *t = es_shape_of_key(world, contact->b);
    es_pose pose_a = es_body_pose(a, a->centre), pose_b = es_body_pose(b, a->centre);
    if (contact->sensor) {
        contact->touching = es_rigid_overlap(s, &pose_a, t, &pose_b);
        return;
    }
    es_manifold found[ES_MESH_MANIFOLDS];
    uint32_t old_count = contact->count;
    contact->count = es_rigid_collide(s, &pose_a, t, &pose_b, ES_CONTACT_MARGIN, found, capacity);
    es_vec3 apart = es_v3((float)(b->centre[0] - a->centre[0]), (float)(b->centre[1] - a->centre[1]), (float)(b->centre[2] - a->centre[2]));
    bool meets = false;
    for (uint32_t i = 0; i < contact->count; i++) {
        manifolds[i].geometry = found[i];
        manifolds[i].apart = apart;
        carry_over(&manifolds[i], old, old_count);
        for (uint32_t k = 0; k < found[i].count; k++) {
            const es_manifold_point* point = &found[i].points[k];
            meets |= point->separation <= es_maxf(approach(a, b, &manifolds[i], point) * world->settings.step, 0.0f);
        }
    }
    /* begins with surfaces that meet, or will within the step as far as can be told, ends with none within the margin: what rests does not flicker */
    contact->touching = contact->count > 0 && (contact->touching || meets);
}

/* Sensors have no manifolds: where all contacts are theirs, the list has no memory to count from. */
static es_contact_manifold* from(es_contact_manifold* manifolds, uint32_t first) { return manifolds ? manifolds + first : NULL; }

static void collide_block(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    es_world* world = user;
    es_rigid* rigid = world->rigid;
    for (uint32_t i = begin; i < end; i++) {
        es_contact* contact = &rigid->next.list[i];
        const es_contact_manifold* old = from(rigid->contacts.manifolds, contact->first);
        contact->first = rigid->starts[i];
        collide(world, contact, from(rigid->next.manifolds, contact->first), rigid->starts[i + 1] - rigid->starts[i], old);
    }
}

void es_collide_contacts(es_world* world) { es_parallel_for(world->context, (uint32_t)world->rigid->next.count, 16, collide_block, world); }

/* ---- events -------------------------------------------------------------------------------------------------------------------- */

static es_contact_event event_of(const es_world* world, const es_contact* contact, bool enter)
{
    const es_body_object *a = es_body_of_key(world, contact->a), *b = es_body_of_key(world, contact->b);
    return (es_contact_event){
        .a = {a->object.id},
        .b = {b->object.id},
        .shape_a = contact->a & (ES_SHAPES_PER_BODY - 1),
        .shape_b = contact->b & (ES_SHAPES_PER_BODY - 1),
        .enter = enter,
        .sensor = contact->sensor,
    };
}

bool es_events_reserve(es_world* world, size_t more)
{
    es_rigid* rigid = world->rigid;
    return es_grow(world->context, (void**)&rigid->events, &rigid->event_capacity, rigid->event_count, rigid->event_count + more, sizeof *rigid->events);
}

void es_report_leaving(es_world* world, const es_contact* contact)
{
    es_rigid* rigid = world->rigid;
    if (rigid->event_count < rigid->event_capacity) rigid->events[rigid->event_count++] = event_of(world, contact, false);
}

static void report_entering(es_world* world, const es_contacts* contacts, const es_contact* contact)
{
    es_rigid* rigid = world->rigid;
    es_contact_event event = event_of(world, contact, true);
    const es_body_object *a = es_body_of_key(world, contact->a), *b = es_body_of_key(world, contact->b);
    if (contact->count) {
        /* the deepest point, the first of equals */
        const es_contact_manifold* m = &contacts->manifolds[contact->first];
        const es_contact_manifold* deepest = NULL;
        const es_manifold_point* at = NULL;
        for (uint32_t i = 0; i < contact->count; i++)
            for (uint32_t k = 0; k < m[i].geometry.count; k++) {
                const es_manifold_point* point = &m[i].geometry.points[k];
                if (at && !(point->separation < at->separation)) continue;
                at = point;
                deepest = &m[i];
            }
        event.normal = deepest->geometry.normal;
        event.point[0] = a->centre[0] + (double)at->point.x;
        event.point[1] = a->centre[1] + (double)at->point.y;
        event.point[2] = a->centre[2] + (double)at->point.z;
        event.speed = es_maxf(approach(a, b, deepest, at), 0.0f);
    } else {
        for (int k = 0; k < 3; k++) event.point[k] = a->centre[k];
    }
    rigid->events[rigid->event_count++] = event;
}

void es_report_contacts(es_world* world)
{
    es_rigid* rigid = world->rigid;
    const es_contacts *now = &rigid->contacts, *next = &rigid->next;
    size_t i = 0, j = 0;
    while (i < now->count || j < next->count) {
        const es_contact *old = i < now->count ? &now->list[i] : NULL, *new = j < next->count ? &next->list[j] : NULL;
        int order = !old ? 1 : !new ? -1 : old->a != new->a ? (old->a < new->a ? -1 : 1) : old->b != new->b ? (old->b < new->b ? -1 : 1) : 0;
        bool was = order <= 0 && old->touching, is = order >= 0 && new->touching;
        if (is && !was) report_entering(world, next, new);
        else if (was && !is) rigid->events[rigid->event_count++] = event_of(world, old, false);
        i += order <= 0;
        j += order >= 0;
    }
}

void es_report_pressed(es_world* world)
{
    es_contacts* contacts = &world->rigid->contacts;
    for (size_t i = 0; i < contacts->count; i++) {
        es_contact* contact = &contacts->list[i];
        if (contact->touching || contact->sensor) continue;
        bool pressed = false;
        for (uint32_t m = contact->first; m < contact->first + contact->count; m++)
            for (uint32_t k = 0; k < contacts->manifolds[m].geometry.count; k++) pressed |= contacts->manifolds[m].geometry.points[k].normal_impulse > 0;
        if (!pressed) continue;
        contact->touching = true;
        report_entering(world, contacts, contact);
    }
}
