/* The passes of glare: the eye that looks at the picture, what its aperture makes of light, and the picture as that eye sees it.
 *
 * They come after the picture's radiance and its meter, whose mean luminance is the eye's field, and before the display: the image `radiance` is without
 * glare, `glare` and `display` are with it. The picture spans es_renderer_settings.glare_field degrees of the eye's view. Nothing runs again while neither the
 * picture nor anything in the eye has changed. */
#ifndef EARTHSHINE_GI_GLARE_GLARE_PASS_H
#define EARTHSHINE_GI_GLARE_GLARE_PASS_H

#include "gi/compose.h"
#include "gi/glare/billboards.h"
#include "gi/glare/convolution.h"
#include "gi/history.h"

/* Spectra of an eye at moments 1 / ES_GLARE_CYCLE_RATE s apart, there and back again, each made when it is first asked for: of an eye that has come to its moment from
 * rest, used to the picture of that frame. They stay until a setting of theirs changes. */
enum { ES_GLARE_MAX_CYCLE = 256, ES_GLARE_CYCLE_RATE = 30 };

typedef struct es_glare_moment { uint64_t made_with; es_glare_spectrum spectrum; } es_glare_moment;

/* Of a renderer; zero-initialised, nothing. What frames leave to later ones is the eye and the cycle. */
typedef struct es_glare {
    es_eye eye, moment;        /* `moment`: of the cycle's spectrum that is being made */
    es_aperture aperture;      /* as drawn last */
    es_diffraction diffraction;
    es_chromatic_blur blur;
    es_glare_spectrum spectrum;
    es_glare_moment* cycle;
    uint32_t cycle_count;
    const es_glare_spectrum* current; /* that the picture is seen by */
    es_glare_convolution convolution;
    es_glare_billboards billboards;
    es_planes picture;         /* what comes out */
} es_glare;

typedef struct es_renderer es_renderer;

es_result es_pass_glare(es_renderer* renderer, double time);
/* The display's picture becomes the one with glare, where there is one. */
void es_glare_compose(const es_renderer* renderer, es_compose_job* job);
/* Everything, and what has the picture's size. */
void es_glare_free(es_context* context, es_glare* glare);
void es_glare_free_planes(es_context* context, es_glare* glare);

#endif
