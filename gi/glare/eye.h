/* One eye, alive: what of it scatters light, and how that moves (Ritschel thesis §8.2, table 8.1).
 *
 * The subject is a seed and a few strengths. The state moves on the grid of gi/glare/step_grid.h. It begins at rest two seconds before the first time it
 * is asked for, used to what it sees then, and so it does after time has gone back or has leapt. Blocked areas of cornea, lens and vitreous are to
 * each other as their shares in table 8.1. */
#ifndef EARTHSHINE_GI_GLARE_EYE_H
#define EARTHSHINE_GI_GLARE_EYE_H

#include "gi/gi.h"
#include "gi/glare/adaptation.h"
#include "gi/glare/eye_shapes.h"
#include "gi/glare/lens.h"
#include "gi/glare/lids.h"
#include "gi/glare/step_grid.h"
#include "gi/glare/vitreous.h"

enum { ES_CORNEA_PARTICLES = 250 };

/* Every strength may be 0, every part off. */
typedef struct es_eye_subject {
    uint32_t seed;
    float pupil;               /* mm, mean diameter, 0 … ES_PUPIL_MAX; below 0: by the field's luminance */
    float hippus;              /* amplitude of the noise of eq. 8.1 */
    float accommodation, saccades, squint; /* 1: as usual */
    bool cornea, lens, gratings, vitreous, lids, lashes, blink; /* lashes, blinking and squinting want lids */
} es_eye_subject;

/* Plain data without pointers, some 40 KiB; zero-initialised it is no eye yet. */
typedef struct es_eye {
    es_eye_subject subject;
    es_step_grid grid;
    es_adaptation field;       /* field luminance, cd/m² */
    double phase;              /* of the hippus: ∫ dt / p */
    float pupil;               /* diameter, mm */
    es_eye_disc cornea[ES_CORNEA_PARTICLES];
    es_lens lens;
    es_vitreous vitreous;
    es_lids lids;
} es_eye;

es_eye_subject es_eye_subject_of(const es_renderer_settings* settings); /* glare.* */
/* Brings the eye to `time`, in seconds of the world, while it looks at a picture of a mean luminance in cd/m² (anything, NaN included). Another subject than
 * before is another eye. */
void es_eye_advance(es_eye* eye, const es_eye_subject* subject, double time, float luminance);
/* Equal where what is drawn of the eye is the same, to the bit. */
uint64_t es_eye_version(const es_eye* eye);
void es_eye_get_shapes(const es_eye* eye, es_eye_shapes* shapes);

#endif
