/* What a shape is when nothing is said about it. */
#include "sim/sim.h"

es_shape_desc es_default_shape_desc(void)
{
    return (es_shape_desc){
        .type = ES_SHAPE_BOX,
        .rotation = {0, 0, 0, 1},
        .radius = 0,
        .half_extents = {0.5f, 0.5f, 0.5f},
        .scale = {1, 1, 1},
        .density = 1000,
        .friction = 0.6f,
        .category = 1,
        .mask = UINT32_MAX,
    };
}
