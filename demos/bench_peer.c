/* llvmpipe, Mesa's software renderer: what one would use instead. Its program comes from the folder of peers beside the
 * repository (or where EARTHSHINE_SHARED points), is built here and run in the same sitting. */
#include "bench.h"
#include "demo_build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static bool try_folder(bench_peer* peer, const char* shared)
{
    char source[DEMO_PATH_SIZE + 64];
    snprintf(peer->folder, sizeof peer->folder, "%s/peers", shared);
    snprintf(source, sizeof source, "%s/llvmpipe/gl_peer.c", peer->folder);
    if (access(source, R_OK) == 0) return true;
    peer->folder[0] = 0;
    return false;
}

static bool compile(bench_peer* peer, const char* source, const char* program)
{
    char from[2 * DEMO_PATH_SIZE], to[2 * DEMO_PATH_SIZE], include[2 * DEMO_PATH_SIZE];
    snprintf(from, sizeof from, "%s", source);
    snprintf(to, sizeof to, "%s/%s", peer->build, program);
    snprintf(include, sizeof include, "-I%s/llvmpipe", peer->folder);
    const char* arguments[] = {"gcc", "-O2", "-w", include, "-o", to, from, "-lEGL", "-lGL", "-lm", NULL};
    bench_child child = bench_run_child(arguments, NULL, NULL, true);
    free(child.output);
    return child.status == 0;
}

bool bench_peer_open(bench_peer* peer, bool build)
{
    *peer = (bench_peer){0};
    const char* shared = getenv("EARTHSHINE_SHARED");
    if (!(shared && shared[0] ? try_folder(peer, shared)
                              : try_folder(peer, DEMO_SOURCE_DIR "/../shared") || try_folder(peer, "../shared"))) {
        snprintf(peer->why, sizeof peer->why, "no peers: neither EARTHSHINE_SHARED nor ../shared holds peers/llvmpipe");
        return false;
    }
    if (!build) {
        snprintf(peer->why, sizeof peer->why, "left out with --no-peer");
        return false;
    }
    char source[DEMO_PATH_SIZE + 64];
    const char* temporary = getenv("TMPDIR");
    snprintf(peer->build, sizeof peer->build, "%s/earthshine-peer-XXXXXX", temporary && temporary[0] ? temporary : "/tmp");
    snprintf(source, sizeof source, "%s/llvmpipe/gl_peer.c", peer->folder);
    if (mkdtemp(peer->build) && compile(peer, source, "gl_peer")) {
        compile(peer, DEMO_SOURCE_DIR "/demos/bench_start_peer.c", "start_peer");
        return true;
    }
    snprintf(peer->why, sizeof peer->why,
        "llvmpipe's program could not be built; `demos/install-packages bench` installs what it needs");
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

void bench_peer_run(bench_peer* peer)
{
    static const char* const programs[] = {"gl_peer", "start_peer"};
    for (int i = 0; i < 2; i++) {
        char path[DEMO_PATH_SIZE + 32];
        snprintf(path, sizeof path, "%s/%s", peer->build, programs[i]);
        const char* arguments[] = {path, "all", NULL};
        if (!peer->build[0] || access(path, X_OK) != 0) continue;
        bench_child child = bench_run_child(arguments, "LP_NUM_THREADS", "2", true);
        if (child.status == 0 && child.output)
            take_rows(peer, child.output);
        else
            snprintf(peer->why, sizeof peer->why, "llvmpipe's program ended with %d", child.status);
        free(child.output);
    }
}

double bench_peer_value(bench_peer* peer, const char* name)
{
    for (size_t i = 0; i < peer->row_count; i++)
        if (!strcmp(peer->rows[i].name, name)) return bench_median(peer->rows[i].values, peer->rows[i].count);
    return NAN;
}

void bench_peer_close(bench_peer* peer)
{
    static const char* const programs[] = {"gl_peer", "start_peer"};
    for (int i = 0; i < 2 && peer->build[0]; i++) {
        char path[DEMO_PATH_SIZE + 32];
        snprintf(path, sizeof path, "%s/%s", peer->build, programs[i]);
        unlink(path);
    }
    if (peer->build[0]) rmdir(peer->build);
    peer->build[0] = 0;
}
