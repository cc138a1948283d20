#include "gi/glare/pupil.h"

#include "platform/maths.h"

float es_pupil_mean(float luminance)
{
    const float log_luminance = luminance > 0 ? es_clampf(es_log2(luminance) * 0.301029996f, -30.0f, 30.0f) : -30.0f;
    const float x = 0.4f * (log_luminance + 1.0f), tanh = 1.0f - 2.0f / (es_exp(2.0f * x) + 1.0f);
    return 4.9f - 3.0f * tanh;
}

float es_pupil_hippus(float mean, float noise)
{
    if (!(mean > 0)) return 0;
    const float p = es_minf(mean, ES_PUPIL_MAX);
    return es_clampf(p + noise * (ES_PUPIL_MAX / p) * es_sqrt(1.0f - p / ES_PUPIL_MAX), 0, ES_PUPIL_MAX);
}
