/* The player's additions to a world. */
#include "player_nodes.h"

static int add_light_nodes(es_world* world, player_nodes* nodes)
{
    uint32_t ids[256];
    size_t count = sizeof ids / sizeof ids[0];
    if (es_world_enumerate(world, ES_OBJECT_LIGHT, ids, &count) != ES_OK) return DEMO_BAD_INPUT;
    if (count > sizeof ids / sizeof ids[0]) count = sizeof ids / sizeof ids[0];
    for (size_t i = 0; i < count && nodes->light_count < PLAYER_MAX_LIGHTS; i++) {
        es_light_desc desc;
        es_light light = {ids[i]};
        es_node_desc node = {.name = "dragged light", .transform = es_identity_transform()};
        es_node* own = &nodes->lights[nodes->light_count].own;
        if (es_world_get_light(world, light, &desc) != ES_OK || es_world_add_node(world, &node, own) != ES_OK) return DEMO_BAD_INPUT;
        nodes->lights[nodes->light_count].light = light;
        nodes->lights[nodes->light_count++].scenes = desc.node;
    }
    return DEMO_OK;
}

int player_nodes_add(es_world* world, player_nodes* nodes)
{
    *nodes = (player_nodes){0};
    int code = fly_camera_init(&nodes->fly, world);
    return code == DEMO_OK ? add_light_nodes(world, nodes) : code;
}
