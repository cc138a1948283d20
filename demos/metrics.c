/* Error metrics; their definitions stand in metrics.h. */
#include "metrics.h"

#include <math.h>
#include <string.h>

static bool is_alpha(const char* name) { return !strcmp(name, "A"); }

static void match_by_name(const es_image* a, const es_image* b, bool alpha, demo_channels* channels)
{
    channels->count = 0;
    for (uint32_t i = 0; i < a->channels; i++) {
        int j = es_image_channel(b, a->channel_names[i]);
        if (j < 0 || is_alpha(a->channel_names[i]) != alpha) continue;
        channels->a[channels->count] = i;
        channels->b[channels->count++] = (uint32_t)j;
    }
}

bool demo_match_channels(const es_image* a, const es_image* b, demo_channels* channels)
{
    match_by_name(a, b, false, channels);
    if (!channels->count) match_by_name(a, b, true, channels);
    if (!channels->count && a->channels == b->channels)
        for (uint32_t i = 0; i < a->channels; i++) {
            channels->a[i] = channels->b[i] = i;
            channels->count = i + 1;
        }
    return channels->count > 0;
}

demo_metrics demo_measure(const es_image* a, const es_image* b, const demo_channels* channels, const uint8_t* mask)
{
    double squares = 0, relative = 0, sum = 0, largest = 0;
    uint64_t samples = 0;
    size_t pixels = (size_t)a->width * a->height;
    for (size_t i = 0; i < pixels; i++) {
        if (mask && !mask[i]) continue;
        for (uint32_t k = 0; k < channels->count; k++) {
            double x = a->pixels[i * a->channels + channels->a[k]], y = b->pixels[i * b->channels + channels->b[k]];
            bool same = x == y || (isnan(x) && isnan(y));
            double d = same ? 0 : isfinite(x) && isfinite(y) ? fabs(x - y) : INFINITY;
            squares += d * d;
            relative += d == 0 ? 0 : d * d / (y * y + 0.01);
            if (isfinite(y)) sum += y;
            if (d > largest) largest = d;
            samples++;
        }
    }
    demo_metrics m = {.max = largest, .samples = samples};
    if (!samples) return m;
    m.mean = sum / (double)samples;
    m.rmse = sqrt(squares / (double)samples);
    m.relrmse = m.rmse == 0 ? 0 : m.rmse / fabs(m.mean);
    m.relmse = isnan(relative) ? INFINITY : relative / (double)samples;
    return m;
}
