#include "gi/micro/lobe_albedo.h"

/* Midpoints of this square grid stand for all directions. Drawn by visible normals they leave little to sum: the masking of what was drawn. */
enum { GRID = 12 };

/* The mean weight of the model's own samples is its directional albedo; f is linear in the specular colour, and so are weights at one density. */
static void sample_lobe(uint32_t model, float roughness, float cosine, float* white, float* dark)
{
    const es_surface s = {.specular = es_v3(1, 1, 1), .roughness = roughness, .model = model}, low = {.specular = es_v3(0.04f, 0.04f, 0.04f), .roughness = roughness, .model = model};
    const es_vec3 n = es_v3(0, 0, 1), wo = es_v3(es_sqrt(es_maxf(1.0f - cosine * cosine, 0.0f)), 0, cosine);
    float sums[2] = {0, 0};
    for (int y = 0; y < GRID; y++)
        for (int x = 0; x < GRID; x++) {
            const float u[3] = {0.0f, ((float)x + 0.5f) / GRID, ((float)y + 0.5f) / GRID};
            es_surface_sample sample;
            if (!es_surface_sample_direction(&s, n, wo, u, &sample)) continue;
            sums[0] += sample.weight.x;
            sums[1] += es_surface_evaluate(&low, n, sample.wi, wo).x * sample.wi.z / sample.density;
        }
    *white = sums[0] / (GRID * GRID);
    *dark = sums[1] / (GRID * GRID);
}

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    es_lobe_albedo* table = user;
    (void)worker;
    for (uint32_t r = begin; r < end; r++) {
        const float roughness = (float)r / (ES_LOBE_ROWS - 1), exponent = ES_LOBE_MAX_EXPONENT * roughness * roughness;
        float means[3] = {0, 0, 0}, weights = 0.0f;
        for (uint32_t c = 0; c < ES_LOBE_COLUMNS; c++) {
            const uint32_t at = r * ES_LOBE_COLUMNS + c;
            /* light along the surface is not reflected; from a millimetre over a metre of it, it is */
            const float cosine = es_maxf((float)c / (ES_LOBE_COLUMNS - 1), 1e-3f);
            float white, dark;
            sample_lobe(ES_SURFACE_METALLIC_ROUGHNESS, roughness, cosine, &white, &dark);
            /* F90 is 1 for both: white = low + high, dark = 0.04 low + high */
            table->low[at] = es_maxf((white - dark) / 0.96f, 0.0f);
            table->high[at] = es_maxf(white - table->low[at], 0.0f);
            sample_lobe(ES_SURFACE_PHONG, exponent, cosine, &table->phong[at], &dark);
            /* by trapezoids, of the linear interpolation times the cosine near enough */
            const float weight = (c == ES_LOBE_COLUMNS - 1 ? 0.5f : 1.0f) * (float)c;
            weights += weight;
            means[0] += weight * table->low[at];
            means[1] += weight * table->high[at];
            means[2] += weight * table->phong[at];
        }
        table->mean_low[r] = means[0] / weights;
        table->mean_high[r] = means[1] / weights;
        table->mean_phong[r] = means[2] / weights;
    }
}

void es_lobe_albedo_fill(es_context* context, es_lobe_albedo* table)
{
    if (table->filled) return;
    es_parallel_for(context, ES_LOBE_ROWS, 1, rows, table);
    table->filled = true;
}

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
