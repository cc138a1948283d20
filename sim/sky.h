/* Sun and sky: where the sun stands, and how bright and of what colour the clear sky is around it. */
#ifndef EARTHSHINE_SIM_SKY_H
#define EARTHSHINE_SIM_SKY_H

#include "sim/sim.h"

/* Degrees of elevation and azimuth between pictures of the sky: the sun itself moves in between. */
#define ES_SKY_STEP 0.5

enum { ES_SKY_WIDTH = 512, ES_SKY_HEIGHT = 256 };

/* East, up and north of the direction towards the sun's middle, unit, without refraction; `days`: since noon, universal time, of 1 January 2000. Radians. */
void es_sun_position(double days, double latitude, double longitude, double east_up_north[3]);
/* Noon, universal time, of 1 January 2000 until a day's beginning; the Gregorian calendar, also before it was. */
double es_days_since_2000(int year, int month, int day);

/* W/m² in each channel of linear Rec.709 on a surface that faces the sun; 0 from -0.27 degrees of elevation down, where the last of its disc has set. */
void es_sun_irradiance(double elevation, float turbidity, float rgb[3]);

/* The sky around a sun in the picture's middle column, radiance in W/(m² sr), ES_SKY_WIDTH × ES_SKY_HEIGHT × 3. */
typedef struct es_sky_picture { float elevation, turbidity, ground_albedo[3]; } es_sky_picture;
void es_sky_draw(es_context* context, const es_sky_picture* picture, float* pixels);

#endif
