/* The error rows of `bench speed`: the peers' room against references that share no code with this project, and imperfect
 * against accurate shadow maps. Errors do not depend on the machine, so they are measured once. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* One image of the room's frame; a zero image after a line on stderr when it fails. */
static es_image room_image(es_context* context, const bench_peer* peer, es_gi_method method, const char* name)
{
    char path[DEMO_PATH_SIZE + 64];
    es_world* world = NULL;
    es_renderer* renderer = NULL;
    es_image image = {0};
    es_renderer_settings settings = bench_settings();
    settings.method = method;
    snprintf(path, sizeof path, "%s/room_70k.glb", peer->folder);
    es_result result = es_world_open(context, peer->folder[0] ? path : "room", NULL, &world);
    if (result == ES_OK) result = es_world_step(world, 0);
    if (result == ES_OK) result = es_renderer_create(context, &settings, &renderer);
    if (result == ES_OK) result = es_renderer_render(renderer, world);
    if (result == ES_OK) result = es_renderer_image(renderer, name, &image);
    if (result != ES_OK) demo_refuse_context(context);
    if (renderer) es_renderer_destroy(renderer);
    if (world) es_world_destroy(world);
    return image;
}

static es_image reference_image(es_context* context, const bench_peer* peer, const char* name)
{
    char path[DEMO_PATH_SIZE + 64];
    es_image image = {0};
    snprintf(path, sizeof path, "%s/%s", peer->folder, name);
    if (peer->folder[0] && es_image_load(context, path, &image) != ES_OK) demo_refuse_context(context);
    return image;
}

static bool lit(const es_image* image, int x, int y)
{
    const float* p = image->pixels + ((size_t)y * image->width + (size_t)x) * image->channels;
    return p[0] > 0 || p[1] > 0 || p[2] > 0;
}

/* Leaves out the pixels within 2 px of where the reference changes between lit and unlit: cast shadows, attached ones, and the
 * cone's edge. There a pixel's centre decides everything, and a shadow map has texels. */
static uint8_t* shadow_edge_mask(const es_image* reference, double* share)
{
    enum { REACH = 2 };
    int width = (int)reference->width, height = (int)reference->height;
    uint8_t* mask = malloc((size_t)width * (size_t)height);
    if (!mask) return NULL;
    size_t kept = 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            bool here = lit(reference, x, y), edge = false;
            for (int dy = -REACH; dy <= REACH && !edge; dy++)
                for (int dx = -REACH; dx <= REACH && !edge; dx++)
                    if (dx * dx + dy * dy <= REACH * REACH && x + dx >= 0 && y + dy >= 0 && x + dx < width && y + dy < height)
                        edge = lit(reference, x + dx, y + dy) != here;
            mask[(size_t)y * (size_t)width + (size_t)x] = !edge;
            kept += !edge;
        }
    *share = (double)kept / ((double)width * (double)height);
    return mask;
}

static void fill_error(es_context* context, bench_row* row, const es_image* image, const es_image* reference, const uint8_t* mask)
{
    es_error_desc desc = {.mask = mask};
    es_image_error error;
    if (image->pixels && reference->pixels && es_image_compare(context, image, reference, &desc, &error) == ES_OK) row->value = error.relrmse;
    else snprintf(row->note, sizeof row->note, "no picture or no reference to compare");
}

void bench_measure_errors(const bench_options* options, const bench_peer* peer, bench_row* rows, size_t count)
{
    bool indirect_wanted = bench_wants(options, "indirect-room"), classic_wanted = bench_wants(options, "ism-vs-classic");
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    es_context* context = NULL;
    if (es_context_create(&desc, &context) != ES_OK) return;
    if (indirect_wanted || classic_wanted) {
        es_image indirect = room_image(context, peer, ES_GI_ISM, "indirect");
        if (indirect_wanted) {
            es_image reference = reference_image(context, peer, "room_indirect_reference.exr");
            fill_error(context, bench_find_row(rows, count, "indirect-room"), &indirect, &reference, NULL);
            es_image_destroy(context, &reference);
        }
        if (classic_wanted) {
            fputs("an accurate shadow map for each light\n", stderr);
            es_image classic = room_image(context, peer, ES_GI_CLASSIC, "indirect");
            fill_error(context, bench_find_row(rows, count, "ism-vs-classic"), &indirect, &classic, NULL);
            es_image_destroy(context, &classic);
        }
        es_image_destroy(context, &indirect);
    }
    if (bench_wants(options, "direct-room")) {
        es_image direct = room_image(context, peer, ES_GI_NONE, "direct"),
                 reference = reference_image(context, peer, "room_direct_reference.exr");
        bench_row* row = bench_find_row(rows, count, "direct-room");
        double share = 0;
        uint8_t* mask = reference.pixels && reference.channels >= 3 ? shadow_edge_mask(&reference, &share) : NULL;
        fill_error(context, row, &direct, mask ? &reference : &(es_image){0}, mask);
        if (mask && !isnan(row->value)) snprintf(row->note, sizeof row->note, "over %.1f %% of the pixels", share * 100);
        free(mask);
        es_image_destroy(context, &direct);
        es_image_destroy(context, &reference);
    }
    es_context_destroy(context);
}
