/* Areas of triangles, by numbers that do not change while a thing moves and turns, so that what is spread by area stays where it is. */
#ifndef EARTHSHINE_GI_REST_AREA_H
#define EARTHSHINE_GI_REST_AREA_H

#include "platform/platform.h"

/* Products of the transform's axes, x·x, y·y, z·z, x·y, x·z, y·z, which is all that areas depend on. The sum of squares keeps 7 bits, the parts
 * are multiples of 1/3072 of it: the third that each has where nothing is stretched is one. */
void es_gram_of(const es_mat4* transform, double gram[6]);
/* m², of three of the records of four floats at `positions`, transformed by what gave `gram`; 0 where it is out of range. */
double es_area_by_gram(const float* positions, const uint32_t* index, const double gram[6]);

#endif
