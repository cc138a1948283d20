/* What the player adds to a world before it is shown: a camera that flies, and a node for each light that may be dragged. A recording made in
 * the window is of a world with them. */
#ifndef EARTHSHINE_DEMO_PLAYER_NODES_H
#define EARTHSHINE_DEMO_PLAYER_NODES_H

#include "fly_camera.h"

enum { PLAYER_MAX_LIGHTS = 16 };

typedef struct player_nodes {
    fly_camera fly;
    size_t light_count; /* lights of the scene that can be moved */
    struct { es_light light; es_node own, scenes; } lights[PLAYER_MAX_LIGHTS];
} player_nodes;

int player_nodes_add(es_world* world, player_nodes* nodes);

#endif
