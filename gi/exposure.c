#include "gi/exposure.h"

#include "platform/maths.h"

void es_exposure_advance(es_exposure* e, float seconds, double time, float log_average)
{
    const int64_t to = es_grid_step(time);
    const double target = es_adaptation_level(log_average);
    const int64_t steps = e->seconds == seconds ? es_grid_steps(&e->grid, to) : -1;
    if (steps < 0) {
        *e = (es_exposure){.seconds = seconds};
        es_adaptation_step(&e->adaptation, target, 0, 0);
    }
    for (int64_t i = 0; i < steps; i++) es_adaptation_step(&e->adaptation, target, seconds, 1.0f / ES_GRID_RATE);
    e->grid = (es_step_grid){true, to};
}

float es_exposure_scale(const es_exposure* e, float key) { return key * es_exp2(es_clampf(-(float)e->adaptation.level, -20.0f, 20.0f)); }
