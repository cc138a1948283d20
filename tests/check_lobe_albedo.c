/* The table of lobes' directional albedos (gi/micro/lobe_albedo_values.c): what the surface model comes to, to the bit.
 *
 * check_lobe_albedo --write prints the file anew. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

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

static void tabulate(es_lobe_albedo* table)
{
    for (uint32_t r = 0; r < ES_LOBE_ROWS; r++) {
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

static es_lobe_albedo made;

static void check_values(void** state)
{
    (void)state;
    tabulate(&made);
    assert_memory_equal(&made, &es_lobe_albedos, sizeof made);
}

static void print(const char* name, const float* values, uint32_t count)
{
    printf("    .%s = {", name);
    for (uint32_t i = 0; i < count; i++) printf("%s%af%s", i % 8 ? " " : "\n        ", (double)values[i], i + 1 < count ? "," : "");
    printf("},\n");
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--write") == 0) {
        tabulate(&made);
        printf("/* Directional albedos of lobes (gi/micro/lobe_albedo.h), printed by tests/check_lobe_albedo.c. */\n#include \"gi/micro/lobe_albedo.h\"\n\nconst es_lobe_albedo es_lobe_albedos = {\n");
        print("low", made.low, ES_LOBE_ROWS * ES_LOBE_COLUMNS);
        print("high", made.high, ES_LOBE_ROWS * ES_LOBE_COLUMNS);
        print("phong", made.phong, ES_LOBE_ROWS * ES_LOBE_COLUMNS);
        print("mean_low", made.mean_low, ES_LOBE_ROWS);
        print("mean_high", made.mean_high, ES_LOBE_ROWS);
        print("mean_phong", made.mean_phong, ES_LOBE_ROWS);
        printf("};\n");
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(check_values)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
