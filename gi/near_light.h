/* Light from nearby surfaces, found by rays: what bounding a pair's geometry term G by 1 / distance² leaves out (Kollig and Keller 2004),
 * demodulated as shading has it, so that it goes through the same filter.
 *
 * From each pixel goes one ray of that length, distributed as the cosine. What it hits is lit by every lamp and reflects towards the pixel with
 * max(0, 1 - 1 / (G distance²)) of its radiance; virtual point lights send the rest. The closer a surface the more directions meet it, so
 * few rays will do exactly where virtual point lights would need to be many. */
#ifndef EARTHSHINE_GI_NEAR_LIGHT_H
#define EARTHSHINE_GI_NEAR_LIGHT_H

#include "gi/reference/scene.h"
#include "gi/shade.h"

typedef struct es_near_light {
    es_shade_near shade;           /* for es_shade_job.near; first, so that a pointer to it is one to this */
    const es_trace_scene* scene;
    float distance;                /* metres, more than 0 */
} es_near_light;

es_near_light es_near_light_of(const es_trace_scene* scene, float distance, float offset);

#endif
