/* The built-in scenes: one file each, one table. */
#ifndef EARTHSHINE_SIM_SCENES_H
#define EARTHSHINE_SIM_SCENES_H

#include "sim/world.h"

typedef struct es_scene {
    const char* name;
    const char* description;
    /* Fills an empty world; `triangles` is what to aim at, 0 the scene's own number. */
    es_result (*build)(es_world* world, uint32_t triangles);
    const char* const* settings; /* what es_scene_settings gives: key=value …, NULL after the last; NULL: none */
} es_scene;

es_result es_scene_cornell(es_world* world, uint32_t triangles);
es_result es_scene_room(es_world* world, uint32_t triangles);
es_result es_scene_hall(es_world* world, uint32_t triangles);
es_result es_scene_cornell_stack(es_world* world, uint32_t triangles);
es_result es_scene_rain_of_things(es_world* world, uint32_t triangles);
es_result es_scene_stress(es_world* world, uint32_t triangles);
es_result es_scene_ring(es_world* world, uint32_t triangles);
es_result es_scene_curtain(es_world* world, uint32_t triangles);
es_result es_scene_creature(es_world* world, uint32_t triangles);
es_result es_scene_lantern_walk(es_world* world, uint32_t triangles);
es_result es_scene_maze(es_world* world, uint32_t triangles);
es_result es_scene_courtyard(es_world* world, uint32_t triangles);
es_result es_scene_crease(es_world* world, uint32_t triangles);
es_result es_scene_lamp_shop(es_world* world, uint32_t triangles);
es_result es_scene_bunny_box(es_world* world, uint32_t triangles);
es_result es_scene_night_street(es_world* world, uint32_t triangles);
es_result es_scene_rokeby(es_world* world, uint32_t triangles);
es_result es_scene_lens(es_world* world, uint32_t triangles);
es_result es_scene_ring_face(es_world* world, uint32_t triangles);
es_result es_scene_kitchen(es_world* world, uint32_t triangles);
es_result es_scene_gallery(es_world* world, uint32_t triangles);

#endif
