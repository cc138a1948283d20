/* Hands: see hands.h. */
#include "sim/rigid/hands.h"

#include "platform/maths.h"
#include "sim/recording.h"
#include "sim/rigid/rigid.h"

bool es_hand_holds_body(const es_world* world, uint32_t hand) { return es_slots_get(&world->slots[ES_OBJECT_BODY], world->hands[hand].body.id) != NULL; }

static bool good_place(const double place[3])
{
    bool good = true;
    for (int k = 0; k < 3; k++) good &= place[k] >= -(double)ES_WORLD_EXTENT && place[k] <= (double)ES_WORLD_EXTENT;
    return good;
}

static es_result bad_hand(es_world* world, uint32_t hand) { return es_fail(world->context, ES_INVALID_ARGUMENT, "hand %u: there are hands 0 … %d", hand, ES_HANDS - 1); }

es_result es_world_grab_body(es_world* world, uint32_t hand, es_body body, es_vec3 local_point, const double target[3], float max_force)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (hand >= ES_HANDS) return bad_hand(world, hand);
    es_body_object* object = es_world_object(world, ES_OBJECT_BODY, body.id);
    if (!object) return ES_STALE_HANDLE;
    const char* name = object->object.name ? object->object.name : "";
    if (object->type != ES_BODY_DYNAMIC) return es_fail(world->context, ES_WRONG_STATE, "body '%.64s' is not dynamic and cannot be held", name);
    if (!target || !good_place(target) || !es_all_within(&local_point.x, 3, ES_WORLD_EXTENT) || !es_within(max_force, 0, 1e12f))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "holding body '%.64s': places must be finite and within 1e9, the force in 0 … 1e12", name);
    es_hand_state* state = &world->hands[hand];
    *state = (es_hand_state){.body = body, .local_point = local_point, .target = {target[0], target[1], target[2]}, .max_force = max_force > 0 ? max_force : es_minf(1000.0f * object->mass, 1e12f)};
    es_body_wake(world, object);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_GRAB_BODY, .id = hand, .other = body.id, .a = local_point, .place = {target[0], target[1], target[2]}, .number = max_force});
    return ES_OK;
}

es_result es_world_move_hand(es_world* world, uint32_t hand, const double target[3])
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (hand >= ES_HANDS) return bad_hand(world, hand);
    if (!target || !good_place(target)) return es_fail(world->context, ES_INVALID_ARGUMENT, "hand %u: its place must be finite and within 1e9", hand);
    for (int k = 0; k < 3; k++) world->hands[hand].target[k] = target[k];
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_MOVE_HAND, .id = hand, .place = {target[0], target[1], target[2]}});
    return ES_OK;
}

es_result es_world_release(es_world* world, uint32_t hand)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (hand >= ES_HANDS) return bad_hand(world, hand);
    world->hands[hand] = (es_hand_state){0};
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_RELEASE, .id = hand});
    return ES_OK;
}

es_result es_world_get_hand(const es_world* world, uint32_t hand, es_hand_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    if (hand >= ES_HANDS) return bad_hand((es_world*)world, hand);
    *state = world->hands[hand];
    return ES_OK;
}

void es_hands_forget(es_world* world, es_object_kind kind, uint32_t id)
{
    for (uint32_t hand = 0; hand < ES_HANDS; hand++)
        if ((kind == ES_OBJECT_BODY ? world->hands[hand].body.id : world->hands[hand].soft) == id) world->hands[hand] = (es_hand_state){0};
}

void es_hands_wake(es_world* world)
{
    for (uint32_t hand = 0; hand < ES_HANDS; hand++)
        if (es_hand_holds_body(world, hand)) es_body_wake(world, es_slots_get(&world->slots[ES_OBJECT_BODY], world->hands[hand].body.id));
}

void es_visit_hands(es_world* world, state_io* io)
{
    for (uint32_t hand = 0; hand < ES_HANDS; hand++) {
        es_hand_state now = world->hands[hand];
        visit_u32(io, &now.body.id);
        visit_u32(io, &now.soft);
        visit_u32(io, &now.vertex);
        visit_floats(io, &now.local_point.x, 3);
        visit_position(io, now.target);
        visit_floats(io, &now.max_force, 1);
        visit_floats(io, &now.impulse.x, 3);
        visit_floats(io, &now.turn.x, 3);
        if (!reading(io) || !io->good) continue;
        const es_body_object* body = es_slots_get(&world->slots[ES_OBJECT_BODY], now.body.id);
        io->good = (!now.body.id || (body && body->type == ES_BODY_DYNAMIC)) && good_place(now.target) && es_all_within(&now.local_point.x, 3, ES_WORLD_EXTENT) &&
                   es_within(now.max_force, 0, 1e12f) && es_all_within(&now.impulse.x, 3, 1e30f) && es_all_within(&now.turn.x, 3, 1e30f);
        if (io->mode == APPLY && io->good) world->hands[hand] = now;
    }
}
