/* Numbers by name, and reflections frozen in a view. */
#include "sim/edits/edits.h"
#include "sim/recording.h"

#include <string.h>

static es_parameter* find(const es_edits* edits, const char* name)
{
    for (size_t i = 0; edits && i < edits->parameter_count; i++)
        if (strcmp(edits->parameters[i].name, name) == 0) return &edits->parameters[i];
    return NULL;
}

es_result es_world_set_parameter(es_world* world, const char* name, float value)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    size_t length = name ? strlen(name) : 0;
    if (!length || length >= ES_EDIT_NAME) return es_fail(context, ES_INVALID_ARGUMENT, "a parameter's name must have 1 … %d bytes", ES_EDIT_NAME - 1);
    if (!es_within(value, -ES_WORLD_EXTENT, ES_WORLD_EXTENT)) return es_fail(context, ES_INVALID_ARGUMENT, "parameter '%s': its value must be finite and within 1e9", name);
    es_edits* edits = es_edits_of(world);
    if (!edits) return es_context_last_result(context);
    es_parameter* parameter = find(edits, name);
    if (!parameter) {
        if (edits->parameter_count == ES_EDIT_PARAMETERS) return es_fail(context, ES_INVALID_ARGUMENT, "parameter '%s': a world has at most %d", name, ES_EDIT_PARAMETERS);
        if (!es_grow(context, (void**)&edits->parameters, &edits->parameter_capacity, edits->parameter_count, edits->parameter_count + 1, sizeof *parameter)) return es_context_last_result(context);
        /* by name, so that the order in which they came makes no difference to the saved state */
        size_t at = edits->parameter_count++;
        for (; at > 0 && strcmp(edits->parameters[at - 1].name, name) > 0; at--) edits->parameters[at] = edits->parameters[at - 1];
        parameter = &edits->parameters[at];
        memset(parameter, 0, sizeof *parameter);
        memcpy(parameter->name, name, length + 1);
    }
    parameter->value = value;
    edits->changes++;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_PARAMETER, .number = value, .state = {name, length}});
    return ES_OK;
}

float es_world_get_parameter(const es_world* world, const char* name)
{
    const es_parameter* parameter = world && name ? find(world->edits, name) : NULL;
    return parameter ? parameter->value : 0;
}

es_result es_world_freeze_reflections(es_world* world, const double eye[3])
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!eye && !world->edits) return ES_OK;
    es_anchor place = {.kind = ES_ANCHOR_POINT};
    if (eye) memcpy(place.point, eye, sizeof place.point);
    if (!es_anchor_valid(&place)) return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_freeze_reflections: the eye must be finite and within 1e9");
    es_edits* edits = es_edits_of(world);
    if (!edits) return es_context_last_result(world->context);
    edits->frozen = eye != NULL;
    memcpy(edits->eye, place.point, sizeof edits->eye);
    edits->changes++;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_FREEZE, .flag = eye != NULL, .place = {place.point[0], place.point[1], place.point[2]}});
    return ES_OK;
}

bool es_world_frozen_reflections(const es_world* world, double eye[3])
{
    if (!world || !world->edits || !world->edits->frozen) return false;
    if (eye) memcpy(eye, world->edits->eye, sizeof world->edits->eye);
    return true;
}
