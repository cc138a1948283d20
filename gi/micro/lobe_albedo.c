#include "gi/micro/lobe_albedo.h"

static float highest(es_vec3 a) { return es_maxf(a.x, es_maxf(a.y, a.z)); }

static float row_of(const es_surface* s)
{
    const float last = (float)(ES_LOBE_ROWS - 1);
    if (s->model == ES_SURFACE_PHONG) return last * es_sqrt(es_clampf(s->roughness * (1.0f / ES_LOBE_MAX_EXPONENT), 0.0f, 1.0f));
    return last * es_clampf(s->roughness, 0.0f, 1.0f);
}

static float between(const float* table, uint32_t stride, float row, float column, uint32_t columns)
{
    const uint32_t r = (uint32_t)es_minf(row, (float)(ES_LOBE_ROWS - 2)), c = columns > 1 ? (uint32_t)es_minf(column, (float)(columns - 2)) : 0, next = columns > 1;
    const float fr = row - (float)r, fc = column - (float)c;
    const float* p = table + (size_t)r * stride + c;
    const float near = p[0] + (p[next] - p[0]) * fc, far = p[stride] + (p[stride + next] - p[stride]) * fc;
    return near + (far - near) * fr;
}

es_vec3 es_lobe_albedo_at(const es_lobe_albedo* table, const es_surface* s, float cosine)
{
    if (s->model == ES_SURFACE_UNLIT) return es_v3(0, 0, 0);
    const float row = row_of(s), column = es_clampf(cosine, 0.0f, 1.0f) * (ES_LOBE_COLUMNS - 1);
    if (s->model == ES_SURFACE_PHONG) return es_v3_scale(s->specular, between(table->phong, ES_LOBE_COLUMNS, row, column, ES_LOBE_COLUMNS));
    const float f90 = es_minf(25.0f * highest(s->specular), 1.0f);
    const float low = between(table->low, ES_LOBE_COLUMNS, row, column, ES_LOBE_COLUMNS), high = f90 * between(table->high, ES_LOBE_COLUMNS, row, column, ES_LOBE_COLUMNS);
    return es_v3(s->specular.x * low + high, s->specular.y * low + high, s->specular.z * low + high);
}

es_vec3 es_surface_albedo(const es_lobe_albedo* table, const es_surface* s)
{
    if (s->model == ES_SURFACE_UNLIT) return es_v3(0, 0, 0);
    const float row = row_of(s);
    if (s->model == ES_SURFACE_PHONG) return es_v3_add(s->albedo, es_v3_scale(s->specular, between(table->mean_phong, 1, row, 0.0f, 1)));
    const float f90 = es_minf(25.0f * highest(s->specular), 1.0f), through = es_interface_mean(f90) * es_interface_mean(f90);
    const float low = between(table->mean_low, 1, row, 0.0f, 1), high = f90 * between(table->mean_high, 1, row, 0.0f, 1);
    return es_v3(s->albedo.x * through + s->specular.x * low + high, s->albedo.y * through + s->specular.y * low + high, s->albedo.z * through + s->specular.z * low + high);
}
