/* One channel of numbers as a picture. */
#include <string.h>

#include "gi/error/error.h"
#include "platform/context.h"

/* "Magma" (S. van der Walt and N. Smith 2015, CC0): equal steps look equal, lightness rises all the way from black to pale
 * yellow. Every sixteenth of its 256 colours and the last, sRGB; straight lines between them stay within 0.01 of it. */
enum { MAGMA_STOPS = 17, SIDE_STOPS = 4 };
static const float magma[MAGMA_STOPS][3] = {
    {0.001462f, 0.000466f, 0.013866f}, {0.039608f, 0.031090f, 0.133515f}, {0.113094f, 0.065492f, 0.276784f}, {0.211718f, 0.061992f, 0.418647f},
    {0.316654f, 0.071690f, 0.485380f}, {0.414709f, 0.110431f, 0.504662f}, {0.512831f, 0.148179f, 0.507648f}, {0.613617f, 0.181811f, 0.498536f},
    {0.716387f, 0.214982f, 0.475290f}, {0.816914f, 0.255895f, 0.436461f}, {0.904281f, 0.319610f, 0.388137f}, {0.960949f, 0.418323f, 0.359630f},
    {0.986700f, 0.535582f, 0.382210f}, {0.996096f, 0.653659f, 0.446213f}, {0.996898f, 0.769591f, 0.534892f}, {0.992440f, 0.884330f, 0.640099f},
    {0.987053f, 0.991438f, 0.749504f}};

/* Two hues that red-blind and green-blind eyes keep apart, each stop of one as light as the other's (CIE L* 0, 30, 60, 90). */
static const float above[SIDE_STOPS][3] = {{0, 0, 0}, {0.537f, 0.117f, 0}, {0.923f, 0.417f, 0}, {1, 0.883f, 0.434f}};
static const float below[SIDE_STOPS][3] = {{0, 0, 0}, {0, 0.267f, 0.575f}, {0, 0.609f, 0.816f}, {0.654f, 0.932f, 1}};

static void colour_at(const float (*stops)[3], int count, float t, float rgb[3])
{
    float x = t * (float)(count - 1);
    int k = x < (float)(count - 2) ? (int)x : count - 2;
    for (int c = 0; c < 3; c++) rgb[c] = stops[k][c] + (x - (float)k) * (stops[k + 1][c] - stops[k][c]);
}

es_result es_image_false_colour(es_context* context, const es_image* values, float scale, bool is_signed, es_image* result)
{
    if (!context || !result) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_false_colour needs a context and a place for the picture");
    memset(result, 0, sizeof *result);
    if (!values || !values->pixels || values->channels != 1)
        return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_false_colour: an image of %u channels was given; one channel is accepted",
            values ? values->channels : 0);
    if (!(scale > 0) || !es_is_finite(scale))
        return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_false_colour: the scale is %g; a finite number above 0 is accepted", (double)scale);
    es_result code = es_image_create(context, values->width, values->height, 3, result);
    if (code) return code;
    es_fp_environment environment = es_fp_enter_untrapped();
    for (size_t i = 0; i < (size_t)values->width * values->height; i++) {
        float *rgb = result->pixels + 3 * i, t = values->pixels[i] / scale;
        if (es_is_nan(t)) {
            rgb[1] = 1; /* a green that no number has */
        } else if (is_signed) {
            float size = t < 0 ? -t : t;
            colour_at(t < 0 ? below : above, SIDE_STOPS, size < 1 ? size : 1, rgb);
        } else {
            colour_at(magma, MAGMA_STOPS, t < 0 ? 0 : t < 1 ? t : 1, rgb);
        }
    }
    es_fp_leave(environment);
    return ES_OK;
}
