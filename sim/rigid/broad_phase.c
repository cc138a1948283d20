/* Which shapes may touch: boxes in the tree, and from its pairs the list of contacts.
 *
 * A shape's box reaches half the contact margin beyond it, so boxes of shapes closer than the margin touch. Pairs come from the tree in the
 * order of their keys; contacts that were there keep what they know. */
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/joints.h"
#include "sim/rigid/rigid.h"

static es_tree_box box_of(const es_rigid* rigid, const es_body_object* body, const es_rigid_shape* shape)
{
    es_pose pose = es_body_pose(body, rigid->origin);
    es_tree_box box;
    es_rigid_shape_bounds(shape, &pose, &box.low, &box.high);
    float* low = &box.low.x;
    float* high = &box.high.x;
    for (int k = 0; k < 3; k++) { /* the pose was rounded to float */
        low[k] -= 0.5f * ES_CONTACT_MARGIN + 0x1p-22f * es_absf(low[k]);
        high[k] += 0.5f * ES_CONTACT_MARGIN + 0x1p-22f * es_absf(high[k]);
    }
    return box;
}

/* How much the fat box adds: more for what moves and is large. */
static float fat_of(const es_body_object* body) { return body->type == ES_BODY_STATIC ? 0.0f : es_clampf(0.1f * body->reach, 0.02f, 0.2f); }

bool es_body_enter_tree(es_world* world, es_body_object* body)
{
    es_rigid* rigid = world->rigid;
    for (uint32_t i = 0; i < body->shape_count; i++) {
        const es_rigid_shape* shape = &body->shapes[i];
        body->proxies[i] = es_dynamic_tree_add(&rigid->tree, es_shape_key(es_slot_of(body->object.id), i), shape->category, box_of(rigid, body, shape), fat_of(body));
        if (body->proxies[i] == ES_NO_PROXY) return false;
    }
    return true;
}

void es_body_leave_tree(es_world* world, es_body_object* body)
{
    for (uint32_t i = 0; i < body->shape_count; i++) {
        if (body->proxies[i] != ES_NO_PROXY) es_dynamic_tree_remove(&world->rigid->tree, body->proxies[i]);
        body->proxies[i] = ES_NO_PROXY;
    }
}

void es_body_refresh_tree(es_world* world, es_body_object* body, es_vec3 ahead)
{
    es_rigid* rigid = world->rigid;
    float fat = fat_of(body);
    for (uint32_t i = 0; i < body->shape_count; i++)
        es_dynamic_tree_move(&rigid->tree, body->proxies[i], box_of(rigid, body, &body->shapes[i]), fat, ahead);
}

/* Depends on nothing that changes without es_dynamic_tree_touch. */
static bool wanted(void* user, uint32_t key_a, uint32_t key_b)
{
    const es_world* world = user;
    if (key_a >> ES_SHAPE_BITS == key_b >> ES_SHAPE_BITS) return false;
    const es_body_object *a = es_body_of_key(world, key_a), *b = es_body_of_key(world, key_b);
    const es_rigid_shape *s = es_shape_of_key(world, key_a), *t = es_shape_of_key(world, key_b);
    if (!(s->category & t->mask) || !(t->category & s->mask)) return false;
    if (s->sensor && t->sensor) return false;
    /* sensors see kinematic bodies too; otherwise one must be able to give way */
    bool sensor = s->sensor || t->sensor;
    if (a->type != ES_BODY_DYNAMIC && b->type != ES_BODY_DYNAMIC && !(sensor && (a->type == ES_BODY_KINEMATIC || b->type == ES_BODY_KINEMATIC))) return false;
    return !es_joint_keeps_apart(world, a, b);
}

bool es_contacts_reserve(es_context* context, es_contacts* contacts, size_t count, size_t manifolds)
{
    return es_grow(context, (void**)&contacts->list, &contacts->capacity, contacts->count, count, sizeof *contacts->list) &&
           es_grow(context, (void**)&contacts->manifolds, &contacts->manifold_capacity, contacts->manifold_count, manifolds, sizeof *contacts->manifolds);
}

void es_contact_resolve(const es_world* world, es_contact* contact)
{
    const es_rigid_shape *s = es_shape_of_key(world, contact->a), *t = es_shape_of_key(world, contact->b);
    contact->friction = es_sqrt(s->friction * t->friction);
    contact->restitution = es_maxf(s->restitution, t->restitution);
    contact->rolling = es_maxf(s->rolling_resistance, t->rolling_resistance);
    contact->sensor = s->sensor || t->sensor;
}

bool es_find_contacts(es_world* world)
{
    es_rigid* rigid = world->rigid;
    es_dynamic_tree* tree = &rigid->tree;
    if (!es_dynamic_tree_pairs(tree, wanted, world)) return false;
    es_contacts *next = &rigid->next, *now = &rigid->contacts;
    next->count = next->manifold_count = 0;
    if (!es_contacts_reserve(world->context, next, tree->pair_count, 0)) return false;
    if (!es_grow(world->context, (void**)&rigid->starts, &rigid->start_capacity, 0, tree->pair_count + 1, sizeof *rigid->starts)) return false;
    size_t old = 0, manifolds = 0;
    for (size_t i = 0; i < tree->pair_count; i++) {
        uint32_t a = tree->pairs[i].key_a, b = tree->pairs[i].key_b;
        if (!es_body_is_awake(es_body_of_key(world, a)) && !es_body_is_awake(es_body_of_key(world, b))) continue;
        while (old < now->count && (now->list[old].a < a || (now->list[old].a == a && now->list[old].b < b))) old++;
        rigid->starts[next->count] = (uint32_t)manifolds;
        es_contact* contact = &next->list[next->count++];
        if (old < now->count && now->list[old].a == a && now->list[old].b == b) {
            *contact = now->list[old];
        } else {
            *contact = (es_contact){.a = a, .b = b};
            es_contact_resolve(world, contact);
        }
        if (contact->sensor) continue;
        bool mesh = es_shape_of_key(world, a)->type == ES_SHAPE_MESH || es_shape_of_key(world, b)->type == ES_SHAPE_MESH;
        manifolds += mesh ? ES_MESH_MANIFOLDS : 1;
    }
    rigid->starts[next->count] = (uint32_t)manifolds;
    if (!es_contacts_reserve(world->context, next, next->count, manifolds)) return false;
    next->manifold_count = manifolds;
    return true;
}

static void drop(es_world* world, es_contacts* contacts, uint32_t body_slot)
{
    size_t kept = 0;
    for (size_t i = 0; i < contacts->count; i++) {
        es_contact* contact = &contacts->list[i];
        bool of_body = contact->a >> ES_SHAPE_BITS == body_slot || contact->b >> ES_SHAPE_BITS == body_slot;
        if (!of_body) contacts->list[kept++] = *contact;
        else if (contact->touching) es_report_leaving(world, contact);
    }
    contacts->count = kept;
}

void es_body_drop_contacts(es_world* world, es_body_object* body)
{
    drop(world, &world->rigid->contacts, es_slot_of(body->object.id));
    drop(world, &world->rigid->asleep, es_slot_of(body->object.id));
}
