/* How an eye, or a display in its place, gets used to brightness: an exponential approach to the present level, in stops, faster where it becomes
 * brighter (Durand and Dorsey 2000, Interactive Tone Mapping, §3.3). */
#ifndef EARTHSHINE_GI_GLARE_ADAPTATION_H
#define EARTHSHINE_GI_GLARE_ADAPTATION_H

#include <stdbool.h>

/* Getting used to less light takes so many times as long. */
#define ES_ADAPTATION_DARKER 4.0f
/* Levels are kept within 2^±this. */
#define ES_ADAPTATION_RANGE 40.0f

typedef struct es_adaptation {
    bool there;                /* it has seen something */
    double level;              /* log2 of what it is used to */
} es_adaptation;

/* log2 of a quantity that may be anything: 0, negative, NaN and infinity give the ends of the range. */
double es_adaptation_level(float value);
/* One step of `dt` seconds towards `target`, in log2; `seconds` is the time constant towards brighter. The first step goes all the way, and so does the last
 * ten-thousandth of a stop: what is given the same target for long enough stands still, to the bit. */
void es_adaptation_step(es_adaptation* adaptation, double target, float seconds, float dt);
/* What it is used to. */
float es_adaptation_value(const es_adaptation* adaptation);

#endif
