#include "gi/micro/point_vpls.h"

es_result es_points_light_vpls(es_context* context, es_arena* arena, es_point_forest* forest, const es_shade_job* lights, uint32_t depth, const es_lobe_albedo* lobes)
{
    if (!forest->leaf_count || lights->vpl_count == lights->dark_count) return ES_OK;
    es_point_level level;
    es_result result = es_point_level_make(arena, forest, depth, &level);
    es_point_push push = {.level = &level, .lobes = lobes};
    if (!result) result = es_point_level_values(arena, &level, push.values);
    if (result) return result;
    const es_shade_points points = {level.x, level.y, level.z, level.nx, level.ny, level.nz, level.count, {push.values[0], push.values[1], push.values[2]}};
    result = es_shade_at_points(context, arena, lights, &points);
    if (!result) es_points_push(context, forest, &push);
    return result;
}
