#include "sim/scenes/edit_tools.h"

static es_anchor on_surface(es_scene_builder* builder, es_instance thing, es_vec3 at)
{
    es_anchor anchor = {ES_ANCHOR_NONE};
    const double point[3] = {(double)at.x, (double)at.y, (double)at.z};
    if (builder->result == ES_OK) builder->result = es_world_anchor_of_point(builder->world, thing, point, &anchor);
    return anchor;
}

void es_build_region(es_scene_builder* builder, const char* name, es_region_type type, es_instance thing, es_vec3 at, float radius, float border)
{
    es_region_desc desc = es_default_region_desc();
    es_region region;
    desc.name = name;
    desc.type = type;
    desc.centre = on_surface(builder, thing, at);
    desc.radius = radius;
    desc.border = border;
    if (builder->result == ES_OK) builder->result = es_world_add_region(builder->world, &desc, &region);
}

static void add(es_scene_builder* builder, es_constraint_desc* desc, const char* name, es_vec3 eye)
{
    es_constraint constraint;
    desc->name = name;
    desc->eye[0] = (double)eye.x;
    desc->eye[1] = (double)eye.y;
    desc->eye[2] = (double)eye.z;
    if (builder->result == ES_OK) builder->result = es_world_add_constraint(builder->world, desc, &constraint);
}

void es_build_constraint(es_scene_builder* builder, const char* name, es_instance thing, es_vec3 at, es_vec3 target, es_vec3 eye)
{
    es_constraint_desc desc = es_default_constraint_desc();
    desc.reflecting = on_surface(builder, thing, at);
    desc.reflected = (es_anchor){.kind = ES_ANCHOR_POINT, .point = {(double)target.x, (double)target.y, (double)target.z}};
    add(builder, &desc, name, eye);
}

void es_build_refraction(es_scene_builder* builder, const char* name, es_instance thing, es_vec3 at, es_vec3 direction, es_vec3 eye)
{
    es_constraint_desc desc = es_default_constraint_desc();
    desc.reflecting = on_surface(builder, thing, at);
    desc.refraction = true;
    desc.direction = direction;
    add(builder, &desc, name, eye);
}
