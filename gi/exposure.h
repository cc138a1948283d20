/* Exposure that gets used to what is shown (es_renderer_settings.exposure_adapt): what is between two frames, and the pass that looks at the picture.
 *
 * The display's luminance is adapted to as an eye adapts to a scene's (Durand and Dorsey 2000): to the logarithmic mean of the picture, along the grid of
 * gi/glare/step_grid.h, from the first frame on; after time has gone back or leapt it begins anew, used to what is there. */
#ifndef EARTHSHINE_GI_EXPOSURE_H
#define EARTHSHINE_GI_EXPOSURE_H

#include "gi/glare/adaptation.h"
#include "gi/glare/step_grid.h"

typedef struct es_exposure {
    es_step_grid grid;
    es_adaptation adaptation;  /* of the logarithmic mean, W/(m² sr) */
    float seconds;             /* that it was begun with */
} es_exposure;

/* To `time`, in seconds of the world, while the picture's logarithmic mean is that. `seconds` is the time constant towards brighter, above 0; another one begins
 * anew. */
void es_exposure_advance(es_exposure* exposure, float seconds, double time, float log_average);
/* What radiance is multiplied by so that what it is used to becomes `key`: within 2^±20. */
float es_exposure_scale(const es_exposure* exposure, float key);

#endif
