/* What scenes give their objects to fall with: see body_tools.h. */
#include "sim/scenes/body_tools.h"

#include "platform/maths.h"

es_shape_desc es_box_shape(es_vec3 half)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.half_extents = half;
    return shape;
}

es_shape_desc es_sphere_shape(float radius)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.type = ES_SHAPE_SPHERE;
    shape.radius = radius;
    return shape;
}

es_shape_desc es_capsule_shape(float radius, float half_height)
{
    es_shape_desc shape = es_sphere_shape(radius);
    shape.type = ES_SHAPE_CAPSULE;
    shape.half_height = half_height;
    return shape;
}

es_shape_desc es_hull_shape(es_mesh mesh)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.type = ES_SHAPE_HULL;
    shape.radius = 0;
    shape.mesh = mesh;
    return shape;
}

es_body es_build_body(es_scene_builder* builder, es_node node, es_body_type type, const es_shape_desc* shape, const es_body_desc* desc)
{
    es_body body = {0};
    if (builder->result != ES_OK) return body;
    es_body_desc d = desc ? *desc : es_default_body_desc();
    d.name = es_world_name(builder->world, ES_OBJECT_NODE, node.id);
    d.node = node;
    d.type = type;
    d.shapes = shape;
    d.shape_count = 1;
    builder->result = es_world_add_body(builder->world, &d, &body);
    return body;
}

static es_shape_desc box_between(es_vec3 low, es_vec3 high)
{
    es_shape_desc shape = es_box_shape(es_v3_scale(es_v3_sub(high, low), 0.5f));
    shape.position = es_v3_scale(es_v3_add(low, high), 0.5f);
    return shape;
}

void es_build_hidden_wall(es_scene_builder* builder, es_vec3 low, es_vec3 high)
{
    es_shape_desc shape = box_between(low, high);
    es_body_desc desc = es_default_body_desc();
    desc.name = "hidden wall";
    desc.type = ES_BODY_STATIC;
    desc.shapes = &shape;
    desc.shape_count = 1;
    es_body body;
    if (builder->result == ES_OK) builder->result = es_world_add_body(builder->world, &desc, &body);
}

void es_build_static_box(es_scene_builder* builder, const char* name, es_vec3 low, es_vec3 high, es_material material)
{
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, low, high);
    es_node node = es_build_object(builder, name, &shape, material, es_v3(0, 0, 0));
    es_shape_desc body = box_between(low, high);
    es_build_body(builder, node, ES_BODY_STATIC, &body, NULL);
}

void es_build_static_mesh(es_scene_builder* builder, es_node node, es_mesh mesh)
{
    es_shape_desc shape = es_hull_shape(mesh);
    shape.type = ES_SHAPE_MESH;
    es_build_body(builder, node, ES_BODY_STATIC, &shape, NULL);
}

void es_build_mover(es_scene_builder* builder, const es_mover_desc* desc)
{
    es_mover mover;
    if (builder->result == ES_OK) builder->result = es_world_add_mover(builder->world, desc, &mover);
}

es_node es_build_child(es_scene_builder* builder, const char* name, es_node parent, es_vec3 translation, es_quat rotation)
{
    es_node node = {0};
    es_node_desc desc = {.name = name, .parent = parent, .transform = {translation, rotation, {1, 1, 1}}};
    if (builder->result == ES_OK) builder->result = es_world_add_node(builder->world, &desc, &node);
    return node;
}

es_light es_build_light(es_scene_builder* builder, const char* name, es_node node, const es_light_desc* desc)
{
    es_light light = {0};
    es_light_desc d = *desc;
    d.name = name;
    d.node = node;
    if (builder->result == ES_OK) builder->result = es_world_add_light(builder->world, &d, &light);
    return light;
}
