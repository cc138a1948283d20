#include "gi/glare/adaptation.h"

#include "platform/maths.h"

double es_adaptation_level(float value)
{
    if (!(value > 0)) return -ES_ADAPTATION_RANGE; /* NaN too: nothing is known to be bright */
    return es_clampf(es_log2(value), -ES_ADAPTATION_RANGE, ES_ADAPTATION_RANGE);
}

void es_adaptation_step(es_adaptation* a, double target, float seconds, float dt)
{
    const double distance = target - a->level;
    if (!a->there || !(seconds > 0) || (distance < 1e-4 && distance > -1e-4)) {
        *a = (es_adaptation){true, target};
        return;
    }
    const float constant = distance > 0 ? seconds : seconds * ES_ADAPTATION_DARKER;
    a->level += distance * (1.0 - (double)es_exp(-dt / constant));
}

float es_adaptation_value(const es_adaptation* a) { return es_exp2((float)a->level); }
