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
    size_t (*rows)(bench_row* rows, size_t capacity); /* for --only; NULL: all rows or none */
    bool by_default;
} benchmark;
/* In the order of the page. */
static const benchmark benchmarks[] = {
    {"error", bench_error, bench_error_rows, false},
    {"ledger", bench_ledger, NULL, false},
    {"bounces", bench_bounces, bench_bounces_rows, false},
    {"micro", bench_micro, bench_micro_rows, false},
    {"lamps", bench_lamps, bench_lamps_rows, false},
    {"screen", bench_screen, bench_screen_rows, false},
    {"compensation", bench_compensation, bench_compensation_rows, false},
    {"second-order", bench_second_order, bench_second_order_rows, false},
    {"edits", bench_edits, bench_edits_rows, false},
    {"reflections", bench_reflections, bench_reflections_rows, false},
    {"combinations", bench_combinations, bench_combinations_rows, false},
    {"glare", bench_glare, bench_glare_rows, false},
    {"scale", bench_scale, bench_scale_rows, false},
    {"speed", bench_speed, bench_speed_rows, true},
    {"frame", bench_frame, NULL, false},
    {"moving", bench_moving, bench_moving_rows, false},
    {"scenes", bench_scenes, bench_scenes_rows, false},
    {"time", bench_time, bench_time_rows, false},
    {"rays", bench_rays, bench_rays_rows, false},
    {"fft", bench_fft, bench_fft_rows, false},
    {"geodesic", bench_geodesic, bench_geodesic_rows, false},
    {"dynamics", bench_dynamics, bench_dynamics_rows, false},
};
enum { BENCHMARKS = sizeof benchmarks / sizeof benchmarks[0], MAX_ROWS = 384 };

const char* bench_name(size_t index) { return index < BENCHMARKS ? benchmarks[index].name : NULL; }

static const benchmark* find_benchmark(const char* name)
{
    for (int i = 0; i < BENCHMARKS; i++)
        if (!strcmp(benchmarks[i].name, name)) return &benchmarks[i];
    return NULL;
}

static int check_row_id(const char* id)
{
    static bench_row rows[MAX_ROWS];
    const char* ids[MAX_ROWS];
    size_t count = 0;
    for (int i = 0; i < BENCHMARKS; i++)
        if (benchmarks[i].rows) count += benchmarks[i].rows(rows + count, MAX_ROWS - count);
    for (size_t i = 0; i < count; i++) {
        if (!strcmp(rows[i].id, id)) return DEMO_OK;
        ids[i] = rows[i].id;
    }
    const char* nearest = demo_nearest(id, ids, count);
    return demo_refuse("--only %s: no such row%s%s%s", id, nearest ? "; did you mean " : "", nearest ? nearest : "", nearest ? "?" : "");
}

static int refuse_name(const char* name)
{
    demo_text known = {0};
    for (int i = 0; i < BENCHMARKS; i++) demo_text_add(&known, "%s, ", benchmarks[i].name);
    int code = demo_refuse("bench: unknown benchmark %s; %sand all are known", name, known.bytes ? known.bytes : "");
    demo_text_free(&known);
    return code;
}

static int prepare_directory(const char* path)
{
    if (mkdir(path, 0777) != 0 && errno != EEXIST)
        return demo_refuse("--out %s: no such directory, and none can be made: %s", path, strerror(errno));
    char probe[DEMO_PATH_SIZE];
    snprintf(probe, sizeof probe, "%s/index.html", path);
    return demo_check_writable(probe);
}

int demo_bench(int count, char** arguments)
{
    enum { OUT, RUNS, THREADS, ONLY, NO_PEER, QUICK, SCENE, SIZE, SPP, OPTIONS };
    static const char* const known[OPTIONS] = {"--out", "--runs", "--threads", "--only", "--no-peer", "--quick", "--scene", "--size", "--spp"};
    char program[DEMO_PATH_SIZE];
    ssize_t length = readlink("/proc/self/exe", program, sizeof program - 1);
    program[length > 0 ? length : 0] = 0;
    bench_options options = {.runs = 5, .threads = 2, .program = program};
    bool chosen[BENCHMARKS] = {false}, any = false;
    for (int i = 0; i < count; i++) {
        const char* argument = arguments[i];
        if (argument[0] != '-') {
            const benchmark* found = find_benchmark(argument);
            if (!found && strcmp(argument, "all") != 0) return refuse_name(argument);
            for (int k = 0; k < BENCHMARKS; k++) chosen[k] |= !found || found == &benchmarks[k];
            any = true;
            continue;
        }
        int option = 0;
        while (option < OPTIONS && strcmp(argument, known[option]) != 0) option++;
        if (option == OPTIONS) {
            const char* nearest = demo_nearest(argument, known, OPTIONS);
            return demo_refuse("bench: unknown option %s; %s%s%s", argument, nearest ? "did you mean " : "`earthshine help` lists all",
                nearest ? nearest : "", nearest ? "?" : "");
        }
        if (option == NO_PEER) options.no_peer = true;
        if (option == QUICK) options.quick = true;
        if (option == NO_PEER || option == QUICK) continue;
        if (++i == count) return demo_refuse("%s: a value must follow", argument);
        if (option == OUT) options.out = arguments[i];
        if (option == RUNS && !demo_parse_uint(arguments[i], 1, 50, &options.runs)) return demo_refuse("--runs %s: a number from 1 to 50 is expected", arguments[i]);
        if (option == THREADS && !demo_parse_uint(arguments[i], 1, 64, &options.threads))
            return demo_refuse("--threads %s: a number from 1 to 64 is expected", arguments[i]);
        if (option == SPP && !demo_parse_uint(arguments[i], 2, 1 << 20, &options.samples)) return demo_refuse("--spp %s: a number from 2 is expected", arguments[i]);
        if (option == SIZE && demo_parse_size(arguments[i], &options.width, &options.height) != DEMO_OK) return DEMO_BAD_INPUT;
        if (option == SCENE && options.scene_count == BENCH_MAX_SCENES) return demo_refuse("--scene: at most %d scenes", BENCH_MAX_SCENES);
        if (option == SCENE) options.scenes[options.scene_count++] = arguments[i];
        if (option != ONLY) continue;
        if (check_row_id(arguments[i]) != DEMO_OK) return DEMO_BAD_INPUT;
        if (options.only_count == 32) return demo_refuse("--only: at most 32 rows");
        options.only[options.only_count++] = arguments[i];
    }
    if (options.out && prepare_directory(options.out) != DEMO_OK) return DEMO_BAD_INPUT;
    int code = DEMO_OK;
    for (int i = 0; i < BENCHMARKS && code == DEMO_OK; i++)
        if (any ? chosen[i] : benchmarks[i].by_default) code = benchmarks[i].run(&options);
    return code;
}
