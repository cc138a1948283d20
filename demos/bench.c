/* `earthshine bench [NAME …]`: finds the benchmarks and their options. */
#include "bench.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

bool bench_wants(const bench_options* options, const char* id)
{
    for (size_t i = 0; i < options->only_count; i++)
        if (!strcmp(options->only[i], id)) return true;
    return options->only_count == 0;
}

static int ascending(const void* a, const void* b)
{
    double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

double bench_median(double* values, size_t count)
{
    if (!count) return NAN;
    qsort(values, count, sizeof *values, ascending);
    return count % 2 ? values[count / 2] : (values[count / 2 - 1] + values[count / 2]) / 2;
}

typedef struct benchmark {
    const char* name;
    int (*run)(const bench_options*);
    bool by_default;
} benchmark;
static const benchmark benchmarks[] = {{"speed", bench_speed, true}, {"frame", bench_frame, false}};
enum { BENCHMARKS = sizeof benchmarks / sizeof benchmarks[0] };

static const benchmark* find_benchmark(const char* name)
{
    for (int i = 0; i < BENCHMARKS; i++)
        if (!strcmp(benchmarks[i].name, name)) return &benchmarks[i];
    return NULL;
}

static int check_row_id(const char* id)
{
    bench_row rows[64];
    size_t count = bench_speed_rows(rows, 64);
    if (bench_find_row(rows, count, id)) return DEMO_OK;
    const char* ids[64];
    for (size_t i = 0; i < count; i++) ids[i] = rows[i].id;
    const char* nearest = demo_nearest(id, ids, count);
    return demo_refuse("--only %s: no such row%s%s", id, nearest ? "; did you mean " : "", nearest ? nearest : "");
}

static int prepare_directory(const char* path)
{
    if (mkdir(path, 0777) != 0 && errno != EEXIST)
        return demo_refuse("--out %s: no such directory, and none can be made: %s", path, strerror(errno));
    char probe[DEMO_PATH_SIZE];
    snprintf(probe, sizeof probe, "%s/speed.json", path);
    return demo_check_writable(probe);
}

int demo_bench(int count, char** arguments)
{
    static const char* const known[] = {"--out", "--runs", "--threads", "--only", "--no-peer"};
    char program[DEMO_PATH_SIZE];
    ssize_t length = readlink("/proc/self/exe", program, sizeof program - 1);
    program[length > 0 ? length : 0] = 0;
    bench_options options = {.runs = 5, .threads = 2, .program = program};
    const benchmark* chosen[BENCHMARKS] = {0};
    size_t chosen_count = 0;
    for (int i = 0; i < count; i++) {
        const char* argument = arguments[i];
        if (argument[0] != '-') {
            const benchmark* found = find_benchmark(argument);
            if (!found) return demo_refuse("bench: unknown benchmark %s; speed and frame are known", argument);
            bool again = false;
            for (size_t k = 0; k < chosen_count; k++) again |= chosen[k] == found;
            if (!again) chosen[chosen_count++] = found;
            continue;
        }
        if (!strcmp(argument, "--no-peer")) {
            options.no_peer = true;
            continue;
        }
        bool is_known = false;
        for (size_t k = 0; k < 4; k++) is_known |= !strcmp(argument, known[k]);
        if (!is_known) {
            const char* nearest = demo_nearest(argument, known, 5);
            return demo_refuse("bench: unknown option %s; %s", argument,
                nearest ? nearest : "--out, --runs, --threads, --only and --no-peer are known");
        }
        if (++i == count) return demo_refuse("%s: a value must follow", argument);
        if (!strcmp(argument, "--out"))
            options.out = arguments[i];
        else if (!strcmp(argument, "--runs") && !demo_parse_uint(arguments[i], 1, 50, &options.runs))
            return demo_refuse("--runs %s: a number from 1 to 50 is expected", arguments[i]);
        else if (!strcmp(argument, "--threads") && !demo_parse_uint(arguments[i], 1, 64, &options.threads))
            return demo_refuse("--threads %s: a number from 1 to 64 is expected", arguments[i]);
        else if (!strcmp(argument, "--only")) {
            if (check_row_id(arguments[i]) != DEMO_OK) return DEMO_BAD_INPUT;
            if (options.only_count == 32) return demo_refuse("--only: at most 32 rows");
            options.only[options.only_count++] = arguments[i];
        }
    }
    if (options.out && prepare_directory(options.out) != DEMO_OK) return DEMO_BAD_INPUT;
    if (!chosen_count)
        for (int i = 0; i < BENCHMARKS; i++)
            if (benchmarks[i].by_default) chosen[chosen_count++] = &benchmarks[i];
    int code = DEMO_OK;
    for (size_t i = 0; i < chosen_count && code == DEMO_OK; i++) code = chosen[i]->run(&options);
    return code;
}
