#include "gi/glare/lids.h"

#include <string.h>

#include "gi/glare/step_grid.h"
#include "platform/maths.h"
#include "platform/random.h"

enum { BLINK_SLOT = 4 * ES_GRID_RATE, SHUTTING = 20, SHUT = 8, OPENING = 40 }; /* steps */
static const float slit = 0.12f, upper_rest = 3.1f, lower_rest = -3.7f, rest_bend = 0.03f; /* mm, 1/mm */

static es_lash grow(uint32_t seed, uint32_t number, uint32_t count, float half_width, float length)
{
    const uint32_t c = 8 * number;
    const float across = 2 * ((float)number + 0.2f + 0.6f * es_random_float(seed, c)) / (float)count - 1;
    es_lash lash = {.root = half_width * across, .width = 0.022f + 0.016f * es_random_float(seed, c + 1)};
    lash.fan = 1.1f * across + 0.5f * (es_random_float(seed, c + 2) - 0.5f);
    lash.sag = length * (0.7f + 0.6f * es_random_float(seed, c + 3));
    lash.rise = length * (1.6f + 0.8f * es_random_float(seed, c + 4));
    return lash;
}

void es_lids_begin(es_lids* lids, uint32_t seed)
{
    memset(lids, 0, sizeof *lids);
    for (uint32_t i = 0; i < ES_UPPER_LASHES; i++) lids->upper[i] = grow(seed, i, ES_UPPER_LASHES, 7.5f, 1.9f);
    for (uint32_t i = 0; i < ES_LOWER_LASHES; i++) lids->lower[i] = grow(seed ^ 0x10e5u, i, ES_LOWER_LASHES, 7.0f, 0.9f);
}

static float smooth(float t)
{
    t = es_clampf(t, 0, 1);
    return t * t * (3.0f - 2.0f * t);
}

float es_blink(uint32_t seed, int64_t step)
{
    const int64_t slot = step >= 0 ? step / BLINK_SLOT : -((-step + BLINK_SLOT - 1) / BLINK_SLOT);
    const uint32_t number = 4 * (uint32_t)slot;
    if (es_random_float(seed, number) < 0.2f) return 0; /* none this time */
    const float since = (float)(step - slot * BLINK_SLOT) - (float)(uint32_t)(es_random_float(seed, number + 1) * (BLINK_SLOT - SHUTTING - SHUT - OPENING));
    return since < SHUTTING + SHUT ? smooth(since / SHUTTING) : 1.0f - smooth((since - SHUTTING - SHUT) / OPENING);
}

float es_squint(float luminance)
{
    if (!(luminance > 0)) return 0;
    return 0.8f * smooth((es_log2(es_minf(luminance, 1e12f)) - 8.2288187f) / 5.0588937f); /* log2 of 300 and of 10,000 / 300 */
}

/* `up`: 1 for the upper lid, -1 for the lower. */
static void add_lash(const es_lash* lash, float edge, float bend, float shut, float up, es_eye_shapes* shapes)
{
    const float root = edge - up * bend * lash->root * lash->root;
    const es_vec2 at[3] = {{lash->root, root}, {lash->root + 0.4f * lash->fan, root - up * lash->sag}, {lash->root + lash->fan, root + up * (lash->rise * (1 - shut) - lash->sag * shut)}};
    es_vec2 last = at[0];
    for (uint32_t i = 1; i <= ES_LASH_SEGMENTS; i++) {
        const float t = (float)i / ES_LASH_SEGMENTS, s = 1 - t;
        const es_vec2 next = {s * s * at[0].x + 2 * s * t * at[1].x + t * t * at[2].x, s * s * at[0].y + 2 * s * t * at[1].y + t * t * at[2].y};
        es_eye_add_line(shapes, last, next, lash->width * (1 - 0.7f * (float)(i - 1) / ES_LASH_SEGMENTS), lash->width * (1 - 0.7f * t));
        last = next;
    }
}

void es_lids_add(const es_lids* lids, bool lashes, es_eye_shapes* shapes)
{
    const float shut = es_clampf(lids->shut, 0, 1);
    shapes->lids = true;
    shapes->upper = upper_rest + (slit - upper_rest) * shut;
    shapes->lower = lower_rest + (-slit - lower_rest) * shut;
    shapes->upper_bend = shapes->lower_bend = rest_bend * (1 - shut);
    if (!lashes) return;
    for (uint32_t i = 0; i < ES_UPPER_LASHES; i++) add_lash(&lids->upper[i], shapes->upper, shapes->upper_bend, shut, 1, shapes);
    for (uint32_t i = 0; i < ES_LOWER_LASHES; i++) add_lash(&lids->lower[i], shapes->lower, shapes->lower_bend, shut, -1, shapes);
}
