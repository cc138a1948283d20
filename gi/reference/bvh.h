/* The hierarchy of gi/gi.h as the library itself sees it. */
#ifndef EARTHSHINE_GI_REFERENCE_BVH_H
#define EARTHSHINE_GI_REFERENCE_BVH_H

#include "gi/gi.h"
#include "platform/maths.h"

/* Expected cost of a random ray that meets the root's box: sum over nodes of area, and of leaves of area × triangles, over the root's area. */
float es_bvh_cost(const es_bvh* bvh);

/* The hit that comes after `passed`, a hit of the same ray at a distance above 0, by distance and then by primitive: from hit to hit a ray meets all of
 * its triangles, those in one plane too. */
void es_bvh_beyond(const es_bvh* bvh, const es_ray* ray, const es_hit* passed, es_hit* hit);

#endif
