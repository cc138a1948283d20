/* What benchmarks of rows begin and end with. */
#include "bench_sitting.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

bench_sitting* sitting_open(const bench_options* options, size_t (*rows)(bench_row* rows, size_t capacity), uint32_t width, uint32_t height)
{
    bench_sitting* sitting = calloc(1, sizeof *sitting);
    if (!sitting) {
        demo_refuse("out of memory");
        return NULL;
    }
    sitting->options = options;
    sitting->count = rows(sitting->rows, SITTING_MAX_ROWS);
    sitting->width = options->width ? options->width : options->quick ? 64 : width;
    sitting->height = options->height ? options->height : options->quick ? 48 : height;
    sitting->frames = options->quick ? 2 : 15;
    sitting->seconds = options->quick ? 1 : 8;
    sitting->truth_samples = options->samples ? options->samples : options->quick ? 4 : 256;
    sitting->truth_seconds = options->quick ? 2 : 120;
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    if (es_context_create(&desc, &sitting->context) == ES_OK) return sitting;
    demo_refuse("bench: no context can be made");
    free(sitting);
    return NULL;
}

int sitting_close(bench_sitting* sitting, bool works)
{
    int code = DEMO_BAD_INPUT;
    if (works) {
        static bench_row shown[SITTING_MAX_ROWS];
        size_t count = 0;
        for (size_t i = 0; i < sitting->count; i++)
            if (bench_wants(sitting->options, sitting->rows[i].id)) shown[count++] = sitting->rows[i];
        bench_print(shown, count);
        code = bench_report_write(&sitting->report, sitting->options, shown, count, sitting->context);
    } else {
        bench_report_free(&sitting->report);
    }
    es_context_destroy(sitting->context);
    free(sitting);
    return code;
}

bench_row* sitting_row(bench_sitting* sitting, const char* format, ...)
{
    char id[64];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(id, sizeof id, format, arguments);
    va_end(arguments);
    return bench_wants(sitting->options, id) ? bench_find_row(sitting->rows, sitting->count, id) : NULL;
}

es_world* sitting_open_scene(bench_sitting* sitting, const char* name)
{
    es_world* world = NULL;
    if (es_world_create_scene(sitting->context, name, NULL, &world) == ES_OK && es_world_step(world, 0) == ES_OK) return world;
    demo_refuse_context(sitting->context);
    if (world) es_world_destroy(world);
    return NULL;
}

es_renderer* sitting_open_renderer(bench_sitting* sitting, const char* text)
{
    es_renderer_settings settings = es_default_renderer_settings();
    es_renderer* renderer = NULL;
    settings.width = sitting->width;
    settings.height = sitting->height;
    settings.skip = false;
    if (!error_apply(sitting->context, &(error_setting){.settings = text}, &settings)) return NULL;
    if (es_renderer_create(sitting->context, &settings, &renderer) == ES_OK) return renderer;
    demo_refuse_context(sitting->context);
    return NULL;
}

double sitting_render(bench_sitting* sitting, es_renderer* renderer, es_world* world)
{
    const double start = demo_seconds();
    if (es_renderer_render(renderer, world) == ES_OK) return (demo_seconds() - start) * 1000;
    demo_refuse_context(sitting->context);
    return NAN;
}

double sitting_pass(const es_renderer* renderer, const char* name, uint64_t* count)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!strcmp(stats->passes[i].name, name)) {
            if (count) *count = stats->passes[i].skipped ? 0 : stats->passes[i].count;
            return stats->passes[i].skipped ? 0 : stats->passes[i].milliseconds;
        }
    return NAN;
}
