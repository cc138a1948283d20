/* The pupil's diameter (Ritschel thesis §8.2.2). */
#ifndef EARTHSHINE_GI_GLARE_PUPIL_H
#define EARTHSHINE_GI_GLARE_PUPIL_H

/* mm, the widest there is (eq. 8.1) */
#define ES_PUPIL_MAX 9.0f

/* Mean diameter in mm, 7.9 … 1.9, for a field luminance in cd/m² (eq. 8.2, Moon and Spencer 1944). 0 and less, and NaN: that of the dark. */
float es_pupil_mean(float luminance);
/* Diameter in mm, 0 … ES_PUPIL_MAX, at a value of the noise, for a mean of `mean` mm (eq. 8.1); a mean of 0 stays 0. */
float es_pupil_hippus(float mean, float noise);

#endif
