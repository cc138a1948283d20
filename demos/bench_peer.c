/* The peers: what one would use instead. Their programs come from the folder of peers beside the repository (or where
 * EARTHSHINE_SHARED points), are built here and run in the same sitting. */
#include "bench.h"
#include "demo_build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct peer_program {
    const char* name;
    const char* source; /* in the kind's folder, or below demos/ when `ours` */
    bool ours;
} peer_program;

enum { MAX_PROGRAMS = 2, MAX_FLAGS = 8 };
typedef struct peer_kind {
    const char *name, *folder, *probe; /* for people; below peers/; a file that must be there */
    peer_program programs[MAX_PROGRAMS];
    const char* flags[MAX_FLAGS];
    const char* libraries[MAX_FLAGS];
    const char *variable, *argument; /* the environment variable that takes the threads, else they follow the argument */
} peer_kind;

/* Flags as in the peers' own run.sh. */
static const peer_kind kinds[] = {
    [BENCH_LLVMPIPE] = {"llvmpipe", "llvmpipe", "gl_peer.c", {{"gl_peer", "gl_peer.c", false}, {"start_peer", "bench_start_peer.c", true}}, {"-O2"}, {"-lEGL", "-lGL", "-lm"},
        "LP_NUM_THREADS", "all"},
    [BENCH_EMBREE_RAYS] = {"Embree", "embree", "embree_peer.c", {{"embree_peer", "embree_peer.c", false}}, {"-O3", "-march=native", "-ffast-math"}, {"-lembree3", "-lpthread", "-lm"},
        NULL, "rays"},
    [BENCH_EMBREE_PATHS] = {"Embree", "embree", "embree_peer.c", {{"embree_paths", "bench_embree_paths.c", true}}, {"-O3", "-march=native", "-ffast-math"},
        {"-lembree3", "-lpthread", "-lm"}, NULL, NULL},
    [BENCH_BULLET] = {"Bullet", "rigid", "bullet_peer.cpp", {{"bullet_peer", "bullet_peer.cpp", false}, {"bullet_cloth", "bullet_cloth.cpp", false}},
        {"-O2", "-I/usr/include/bullet"}, {"-lBulletSoftBody", "-lBulletDynamics", "-lBulletCollision", "-lLinearMath", "-lstdc++", "-lm"}, NULL, NULL},
    [BENCH_FFT] = {"FFTW's and KissFFT", "fft", "fft_peer.c", {{"fft_peer", "fft_peer.c", false}}, {"-O2"}, {"-lfftw3f_threads", "-lfftw3f", "-lkissfft-float", "-lpthread", "-lm"}, NULL, NULL},
};

static bool try_folder(bench_peer* peer, const char* shared)
{
    const peer_kind* kind = &kinds[peer->kind];
    char source[DEMO_PATH_SIZE + 64];
    snprintf(peer->folder, sizeof peer->folder, "%s/peers", shared);
    snprintf(source, sizeof source, "%s/%s/%s", peer->folder, kind->folder, kind->probe);
    if (access(source, R_OK) == 0) return true;
    peer->folder[0] = 0;
    return false;
}

static void program_path(const bench_peer* peer, const peer_program* program, char path[DEMO_PATH_SIZE + 32])
{
    snprintf(path, DEMO_PATH_SIZE + 32, "%s/%s", peer->build, program->name);
}

static bool compile(const bench_peer* peer, const peer_program* program)
{
    const peer_kind* kind = &kinds[peer->kind];
    char from[2 * DEMO_PATH_SIZE], to[DEMO_PATH_SIZE + 32], include[2 * DEMO_PATH_SIZE];
    if (program->ours)
        snprintf(from, sizeof from, "%s/demos/%s", DEMO_SOURCE_DIR, program->source);
    else
        snprintf(from, sizeof from, "%s/%s/%s", peer->folder, kind->folder, program->source);
    program_path(peer, program, to);
    snprintf(include, sizeof include, "-I%s/%s", peer->folder, kind->folder);
    const char* arguments[8 + 2 * MAX_FLAGS] = {"gcc", "-w", include, "-o", to};
    size_t count = 5;
    for (size_t i = 0; i < MAX_FLAGS && kind->flags[i]; i++) arguments[count++] = kind->flags[i];
    arguments[count++] = from;
    for (size_t i = 0; i < MAX_FLAGS && kind->libraries[i]; i++) arguments[count++] = kind->libraries[i];
    bench_child child = bench_run_child(arguments, NULL, NULL, true);
    free(child.output);
    return child.status == 0;
}

bool bench_peer_open(bench_peer* peer, bench_peer_kind which, bool build)
{
    memset(peer, 0, sizeof *peer);
    peer->kind = which;
    const peer_kind* kind = &kinds[which];
    const char* shared = getenv("EARTHSHINE_SHARED");
    if (!(shared && shared[0] ? try_folder(peer, shared)
                              : try_folder(peer, DEMO_SOURCE_DIR "/../shared") || try_folder(peer, "../shared"))) {
        snprintf(peer->why, sizeof peer->why, "no peers: neither EARTHSHINE_SHARED nor ../shared holds peers/%s", kind->folder);
        return false;
    }
    if (!build) {
        snprintf(peer->why, sizeof peer->why, "left out with --no-peer");
        return false;
    }
    const char* temporary = getenv("TMPDIR");
    snprintf(peer->build, sizeof peer->build, "%s/earthshine-peer-XXXXXX", temporary && temporary[0] ? temporary : "/tmp");
    if (!mkdtemp(peer->build)) peer->build[0] = 0;
    if (peer->build[0] && compile(peer, &kind->programs[0])) {
        for (size_t i = 1; i < MAX_PROGRAMS && kind->programs[i].name; i++) compile(peer, &kind->programs[i]);
        return true;
    }
    snprintf(peer->why, sizeof peer->why,
        "%s's program could not be built; `demos/install-packages bench` installs what it needs", kind->name);
    return false;
}

static void add_value(bench_peer* peer, const char* name, double value)
{
    size_t i = 0, most_rows = sizeof peer->rows / sizeof peer->rows[0],
           most_values = sizeof peer->rows[0].values / sizeof peer->rows[0].values[0];
    while (i < peer->row_count && strcmp(peer->rows[i].name, name) != 0) i++;
    if (i == peer->row_count) {
        if (i == most_rows) return;
        snprintf(peer->rows[i].name, sizeof peer->rows[i].name, "%s", name);
        peer->row_count++;
    }
    if (peer->rows[i].count < most_values) peer->rows[i].values[peer->rows[i].count++] = value;
}

/* "ROW<tab>name<tab>value<tab>unit" */
static void take_rows(bench_peer* peer, char* output)
{
    char* line_state = NULL;
    for (char* line = strtok_r(output, "\n", &line_state); line; line = strtok_r(NULL, "\n", &line_state)) {
        char* state = NULL;
        char* tag = strtok_r(line, "\t", &state);
        char* name = strtok_r(NULL, "\t", &state);
        char* value = strtok_r(NULL, "\t", &state);
        if (tag && name && value && !strcmp(tag, "ROW")) add_value(peer, name, strtod(value, NULL));
    }
}

bool bench_peer_run_program(bench_peer* peer, size_t program, const char* const* arguments, const char* threads)
{
    char path[DEMO_PATH_SIZE + 32];
    const peer_kind* kind = &kinds[peer->kind];
    const char* all[8] = {path};
    for (size_t i = 0; i < 6 && arguments[i]; i++) all[i + 1] = arguments[i];
    program_path(peer, &kind->programs[program], path);
    if (!peer->build[0] || access(path, X_OK) != 0) return false;
    bench_child child = bench_run_child(all, kind->variable, threads, true);
    if (child.status == 0 && child.output)
        take_rows(peer, child.output);
    else
        snprintf(peer->why, sizeof peer->why, "%s's program ended with %d", kind->name, child.status);
    free(child.output);
    return child.status == 0;
}

bool bench_peer_run(bench_peer* peer, uint32_t threads)
{
    char thread_text[16];
    snprintf(thread_text, sizeof thread_text, "%u", threads);
    const char* arguments[] = {kinds[peer->kind].argument, kinds[peer->kind].variable ? NULL : thread_text, NULL};
    bool works = true;
    for (size_t i = 0; i < MAX_PROGRAMS && kinds[peer->kind].programs[i].name; i++) works &= bench_peer_run_program(peer, i, arguments, thread_text);
    return works;
}

double bench_peer_value(bench_peer* peer, const char* name)
{
    for (size_t i = 0; i < peer->row_count; i++)
        if (!strcmp(peer->rows[i].name, name)) return bench_median(peer->rows[i].values, peer->rows[i].count);
    return NAN;
}

void bench_peer_close(bench_peer* peer)
{
    for (size_t i = 0; i < MAX_PROGRAMS && peer->build[0] && kinds[peer->kind].programs[i].name; i++) {
        char path[DEMO_PATH_SIZE + 32];
        program_path(peer, &kinds[peer->kind].programs[i], path);
        unlink(path);
    }
    if (peer->build[0]) rmdir(peer->build);
    peer->build[0] = 0;
}
