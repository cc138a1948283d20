/* `bench rays`: rays through the peers' room beside Embree's, and building and refitting what they go through.
 *
 * The same rays as Embree's program casts: a camera's, then from each point it sees one over the hemisphere by a table of random numbers per
 * tile; two threads take tiles of 16 × 16 pixels; making the rays counts. Embree's rays one at a time (intersect1, occluded1) are what
 * is compared with; ours go one at a time too, but the camera's, which go by ES_RAYS_COHERENT. */
#include "bench.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 1024, HEIGHT = 768, TILE = 16, TILES_X = WIDTH / TILE, TILES = TILES_X * (HEIGHT / TILE), TILE_RAYS = TILE * TILE, REPETITIONS = 7, MAX_ROUNDS = 50, SCENES = 2 };
typedef enum ray_figure { PRIMARY, SHADOW, COSINE, BUILD, REFIT, FIGURES } ray_figure;

#define EMBREE "Embree, 2 threads: "
static const bench_row table[FIGURES * SCENES] = {
    {"rays-primary-70k", "camera rays, eight going together, closest hit, 70k triangles", "Mray/s", EMBREE "intersect1", BENCH_RATIO_AT_LEAST, 0.6, 1},
    {"rays-shadow-70k", "hemisphere rays of length 1, any hit, 70k triangles", "Mray/s", EMBREE "occluded1", BENCH_RATIO_AT_LEAST, 0.6, 1},
    {"rays-cosine-70k", "hemisphere rays, closest hit, 70k triangles", "Mray/s", EMBREE "intersect1", BENCH_RATIO_AT_LEAST, 0.6, 1},
    {"bvh-build-70k", "building the hierarchy of 70k triangles", "ms", EMBREE "medium quality", BENCH_RATIO_AT_LEAST, 0.5, 1},
    {"bvh-refit-70k", "refitting the hierarchy of 70k triangles", "ms", EMBREE "refit", BENCH_RATIO_AT_LEAST, 0.5, 1},
    {"rays-primary-1m", "camera rays, eight going together, closest hit, 1M triangles", "Mray/s", EMBREE "intersect1", BENCH_RATIO_AT_LEAST, 0.5, 1},
    {"rays-shadow-1m", "hemisphere rays of length 1, any hit, 1M triangles", "Mray/s", EMBREE "occluded1", BENCH_RATIO_AT_LEAST, 0.5, 1},
    {"rays-cosine-1m", "hemisphere rays, closest hit, 1M triangles", "Mray/s", EMBREE "intersect1", BENCH_RATIO_AT_LEAST, 0.5, 1},
    {"bvh-build-1m", "building the hierarchy of 1M triangles", "ms", EMBREE "medium quality", BENCH_RATIO_AT_LEAST, 0.5, 1},
    {"bvh-refit-1m", "refitting the hierarchy of 1M triangles", "ms", EMBREE "refit", BENCH_RATIO_AT_LEAST, 0.5, 1},
};
static const char* const peer_rows[FIGURES] = {"primary intersect1", "hemi occluded1 tfar=1", "hemi intersect1 tfar=inf", "BVH build medium", "BVH refit"};
static const char* const peer_scenes[SCENES] = {"70k", "1M"};
static const uint32_t scene_triangles[SCENES] = {70000, 1000000};

size_t bench_rays_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, FIGURES * SCENES, rows, capacity); }

/* ---- rays -------------------------------------------------------------------------------------------------------- */

typedef struct seen_point {
    float position[3], normal[3];
} seen_point;

typedef struct ray_bench {
    es_context* context;
    es_world* world;
    es_bvh* bvh;
    seen_point* seen; /* per pixel */
    float tangent;    /* of half the camera's angle */
    ray_figure figure;
    atomic_int next_tile;
    atomic_long hits;
} ray_bench;

static const float eye[3] = {0, 0.1f, 1.95f};
static const float nearest = 1e-3f;

static uint32_t scramble(uint32_t x)
{
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

static float next_random(uint32_t* state)
{
    uint32_t x = *state;
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    *state = x;
    return (float)(x >> 8) * (1.0f / 16777216.0f);
}

static void camera_direction(const ray_bench* b, int x, int y, float d[3])
{
    d[0] = (((float)x + 0.5f) * (2.0f / WIDTH) - 1) * b->tangent * WIDTH / HEIGHT;
    d[1] = (1 - ((float)y + 0.5f) * (2.0f / HEIGHT)) * b->tangent;
    d[2] = -1;
}

/* Cosine-distributed about n, in Duff's basis. */
static void cosine_direction(const float* n, float u, float v, float d[3])
{
    float radius = sqrtf(u), z = sqrtf(1 - u), x = radius * cosf(6.2831853f * v), y = radius * sinf(6.2831853f * v);
    float sign = copysignf(1, n[2]), a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
    d[0] = x * (1 + sign * n[0] * n[0] * a) + y * b + z * n[0];
    d[1] = x * sign * b + y * (sign + n[1] * n[1] * a) + z * n[1];
    d[2] = -x * sign * n[0] - y * n[1] + z * n[2];
}

/* The pixel of ray i of a tile. Eight neighbours are a block of 4 × 2, for rays that go together. */
static void pixel_of(int tile, int i, bool blocks, int* x, int* y)
{
    int column = i % TILE, line = i / TILE;
    if (blocks) {
        int block = i / 8, within = i % 8;
        column = block % (TILE / 4) * 4 + within % 4;
        line = block / (TILE / 4) * 2 + within / 4;
    }
    *x = tile % TILES_X * TILE + column;
    *y = tile / TILES_X * TILE + line;
}

static void make_rays(const ray_bench* b, int tile, es_ray rays[TILE_RAYS])
{
    uint32_t state = scramble((uint32_t)tile + 1) | 1;
    for (int i = 0; i < TILE_RAYS; i++) {
        int x, y;
        pixel_of(tile, i, b->figure == PRIMARY, &x, &y);
        es_ray* ray = &rays[i];
        ray->min = nearest;
        ray->max = b->figure == SHADOW ? 1 : 1e30f;
        if (b->figure == PRIMARY) {
            memcpy(ray->origin, eye, sizeof eye);
            camera_direction(b, x, y, ray->direction);
            continue;
        }
        const seen_point* from = &b->seen[y * WIDTH + x];
        float u = next_random(&state), v = next_random(&state);
        memcpy(ray->origin, from->position, sizeof from->position);
        cosine_direction(from->normal, u, v, ray->direction);
    }
}

static void* trace_tiles(void* user)
{
    ray_bench* b = user;
    es_ray rays[TILE_RAYS];
    es_hit hits[TILE_RAYS];
    uint8_t blocked[TILE_RAYS];
    long count = 0;
    for (int tile; (tile = atomic_fetch_add(&b->next_tile, 1)) < TILES;) {
        make_rays(b, tile, rays);
        if (b->figure == SHADOW) {
            es_bvh_any(b->bvh, ES_RAYS_SINGLE, rays, TILE_RAYS, blocked);
            for (int i = 0; i < TILE_RAYS; i++) count += blocked[i];
        } else {
            es_bvh_closest(b->bvh, b->figure == PRIMARY ? ES_RAYS_COHERENT : ES_RAYS_SINGLE, rays, TILE_RAYS, hits);
            for (int i = 0; i < TILE_RAYS; i++) count += hits[i].t < 1;
        }
    }
    atomic_fetch_add(&b->hits, count);
    return NULL;
}

static void trace_all(ray_bench* b, uint32_t threads)
{
    enum { MOST = 64 };
    pthread_t others[MOST];
    uint32_t started = 0;
    b->next_tile = 0;
    b->hits = 0;
    for (; started + 1 < threads && started < MOST; started++)
        if (pthread_create(&others[started], NULL, trace_tiles, b) != 0) break;
    trace_tiles(b);
    for (uint32_t i = 0; i < started; i++) pthread_join(others[i], NULL);
}

/* What the camera sees, with the normals of the meshes. */
static void find_points(ray_bench* b)
{
    const es_draw_list* list = es_world_draw_list(b->world);
    const es_bvh_primitive* primitives = es_bvh_primitives(b->bvh);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        es_ray ray = {.min = nearest, .max = 1e30f};
        es_hit hit;
        memcpy(ray.origin, eye, sizeof eye);
        camera_direction(b, i % WIDTH, i / WIDTH, ray.direction);
        es_bvh_closest(b->bvh, ES_RAYS_SINGLE, &ray, 1, &hit);
        if (hit.primitive == ES_NO_PRIMITIVE) continue; /* the room is closed */
        const es_raster_instance* instance = &list->instances[primitives[hit.primitive].instance];
        const uint32_t* corners = instance->mesh->indices + 3 * (size_t)primitives[hit.primitive].triangle;
        float weights[3] = {1 - hit.u - hit.v, hit.u, hit.v}, n[3] = {0, 0, 0}, world[3], length = 0;
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) n[k] += weights[c] * instance->mesh->normals[4 * (size_t)corners[c] + (size_t)k];
        const float* m = (const float*)&instance->transform; /* the room's are rigid */
        for (int k = 0; k < 3; k++) world[k] = m[k] * n[0] + m[4 + k] * n[1] + m[8 + k] * n[2];
        for (int k = 0; k < 3; k++) length += world[k] * world[k];
        for (int k = 0; k < 3; k++) {
            b->seen[i].normal[k] = world[k] / sqrtf(length);
            b->seen[i].position[k] = eye[k] + hit.t * ray.direction[k];
        }
    }
}

/* ---- rounds ------------------------------------------------------------------------------------------------------ */

static void ray_bench_close(ray_bench* b)
{
    if (b->bvh) es_bvh_destroy(b->bvh);
    if (b->world) es_world_destroy(b->world);
    if (b->context) es_context_destroy(b->context);
    free(b->seen);
    *b = (ray_bench){0};
}

static bool ray_bench_open(ray_bench* b, uint32_t threads, uint32_t triangles)
{
    *b = (ray_bench){.tangent = tanf(65 * 3.14159265f / 360)};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = threads;
    es_world_settings settings = es_default_world_settings();
    settings.triangles = triangles;
    b->seen = calloc(WIDTH * HEIGHT, sizeof *b->seen);
    if (!b->seen || es_context_create(&desc, &b->context) != ES_OK || es_world_create_scene(b->context, "room", &settings, &b->world) != ES_OK ||
        es_world_step(b->world, 0) != ES_OK || es_bvh_create(b->context, &b->bvh) != ES_OK || es_bvh_build(b->bvh, es_world_draw_list(b->world)) != ES_OK)
        return false;
    find_points(b);
    return true;
}

/* Every vertex a little up or down: what refitting has to follow. The draw list's instances and meshes, copied, so that they can be moved. */
typedef struct moving_list {
    es_draw_list list;
    es_raster_instance* instances;
    es_raster_mesh* meshes;
    float** positions;
} moving_list;

static void moving_list_free(moving_list* m)
{
    for (uint32_t i = 0; m->positions && i < m->list.instance_count; i++) free(m->positions[i]);
    free(m->positions);
    free(m->meshes);
    free(m->instances);
}

static bool moving_list_make(moving_list* m, const es_draw_list* from)
{
    uint32_t count = from->instance_count;
    m->list = *from;
    m->instances = malloc(count * sizeof *m->instances);
    m->meshes = malloc(count * sizeof *m->meshes);
    m->positions = calloc(count, sizeof *m->positions);
    if (!m->instances || !m->meshes || !m->positions) return false;
    for (uint32_t i = 0; i < count; i++) {
        m->instances[i] = from->instances[i];
        m->meshes[i] = *from->instances[i].mesh;
        size_t size = m->meshes[i].vertex_count * 4 * sizeof(float);
        m->positions[i] = malloc(size);
        if (!m->positions[i]) return false;
        memcpy(m->positions[i], m->meshes[i].positions, size);
        m->meshes[i].positions = m->positions[i];
        m->instances[i].mesh = &m->meshes[i];
    }
    m->list.instances = m->instances;
    return true;
}

static void moving_list_shift(moving_list* m, float up)
{
    for (uint32_t i = 0; i < m->list.instance_count; i++) {
        for (uint32_t v = 0; v < m->meshes[i].vertex_count; v++) m->positions[i][4 * (size_t)v + 1] += up;
        m->meshes[i].revision += (uint64_t)1 << 40; /* beside those that the world gives */
    }
}

/* Milliseconds, the median of several. NaN when it fails. */
static double time_build(ray_bench* b, bool refit)
{
    double times[REPETITIONS];
    const es_draw_list* list = es_world_draw_list(b->world);
    moving_list moving = {0};
    bool works = !refit || moving_list_make(&moving, list);
    for (int i = -1; i < REPETITIONS && works; i++) {
        if (refit) moving_list_shift(&moving, i & 1 ? -0.001f : 0.001f);
        double start = demo_seconds();
        works = (refit ? es_bvh_refit(b->bvh, &moving.list) : es_bvh_build(b->bvh, list)) == ES_OK;
        if (i >= 0) times[i] = (demo_seconds() - start) * 1000;
    }
    moving_list_free(&moving);
    return works ? bench_median(times, REPETITIONS) : NAN;
}

static double time_rays(ray_bench* b, uint32_t threads)
{
    double times[REPETITIONS];
    for (int i = -1; i < REPETITIONS; i++) {
        double start = demo_seconds();
        trace_all(b, threads);
        if (i >= 0) times[i] = demo_seconds() - start;
    }
    return (double)WIDTH * HEIGHT / bench_median(times, REPETITIONS) * 1e-6;
}

int bench_rays(const bench_options* options)
{
    ray_bench benches[SCENES] = {{0}};
    double values[SCENES * FIGURES][MAX_ROUNDS];
    bench_row rows[SCENES * FIGURES];
    bench_rays_rows(rows, SCENES * FIGURES);
    bench_peer* peer = calloc(1, sizeof *peer);
    if (!peer) return demo_refuse("out of memory");
    bool with_peer = bench_peer_open(peer, BENCH_EMBREE_RAYS, !options->no_peer), works = true;
    if (!with_peer) fprintf(stderr, "earthshine: %s\n", peer->why);
    for (int s = 0; s < SCENES && works; s++) {
        bool wanted = false;
        for (int f = 0; f < FIGURES; f++) wanted |= bench_wants(options, rows[s * FIGURES + f].id);
        if (wanted) works = ray_bench_open(&benches[s], options->threads, scene_triangles[s]);
    }
    for (uint32_t round = 0; round < options->runs && works; round++) {
        fprintf(stderr, "round %u of %u\n", round + 1, options->runs);
        for (int i = 0; i < SCENES * FIGURES; i++) {
            ray_bench* b = &benches[i / FIGURES];
            b->figure = (ray_figure)(i % FIGURES);
            if (!bench_wants(options, rows[i].id)) continue;
            if (b->figure == BUILD || b->figure == REFIT) {
                values[i][round] = time_build(b, b->figure == REFIT);
                works &= !isnan(values[i][round]);
            } else {
                values[i][round] = time_rays(b, options->threads);
                snprintf(rows[i].note, sizeof rows[i].note, "%.1f %% hit within a length of 1", 100.0 * (double)b->hits / (WIDTH * HEIGHT));
            }
        }
        if (with_peer && !bench_peer_run(peer, options->threads)) fprintf(stderr, "earthshine: %s\n", peer->why);
    }
    int code = DEMO_OK;
    if (!works) {
        for (int s = 0; s < SCENES && code == DEMO_OK; s++) code = benches[s].context ? demo_refuse_context(benches[s].context) : code;
        if (code == DEMO_OK) code = demo_refuse("out of memory");
    } else {
        bench_row shown[SCENES * FIGURES];
        size_t count = 0;
        for (int i = 0; i < SCENES * FIGURES; i++) {
            if (!bench_wants(options, rows[i].id)) continue;
            char name[96];
            snprintf(name, sizeof name, "%s %s", peer_rows[i % FIGURES], peer_scenes[i / FIGURES]);
            rows[i].value = bench_median(values[i], options->runs);
            rows[i].peer_value = bench_peer_value(peer, name);
            rows[i].ratio = i % FIGURES == BUILD || i % FIGURES == REFIT ? rows[i].peer_value / rows[i].value : rows[i].value / rows[i].peer_value;
            if (!with_peer && !rows[i].note[0]) snprintf(rows[i].note, sizeof rows[i].note, "%s", peer->why);
            shown[count++] = rows[i];
        }
        bench_print(shown, count);
        bench_report report = {.name = "rays", .title = "Rays beside Embree", .about = "Ours and Embree's, turn by turn in one sitting; medians over the rounds."};
        code = bench_report_write(&report, options, shown, count, benches[0].context ? benches[0].context : benches[1].context);
    }
    for (int s = 0; s < SCENES; s++) ray_bench_close(&benches[s]);
    bench_peer_close(peer);
    free(peer);
    return code;
}
