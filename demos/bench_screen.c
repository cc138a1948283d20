/* `bench screen`: light found in screen space as Ritschel's thesis measures it (§4.4): what occlusion per direction, a bounce, layers and further cameras add to a frame, at
 * 1024 × 768; and what a bounce and repaired shadows take from the error of virtual point lights where surfaces are close together. */
#include <math.h>
#include <string.h>

#include "bench_sitting.h"

#define OVERHEAD(id, work, must, aim) {id, work, "%", NULL, BENCH_VALUE_AT_MOST, must, aim}

static const bench_row table[] = {
    {"screen-occlusion-8", "hall under a sky of a gradient: directional occlusion, 8 samples, added to the frame", "ms", NULL, BENCH_VALUE_AT_MOST, 25, 12},
    OVERHEAD("screen-bounce", "the same: a bounce on top, of the frame", 46, 19),
    OVERHEAD("screen-over-ambient", "the same: directional instead of ambient occlusion, of the frame", 20, 5),
    OVERHEAD("screen-layers-2", "the same: two layers of depth, of the frame", 30, 30),
    OVERHEAD("screen-cameras-4", "the same: four further cameras, of the frame", 160, 58),
    {"screen-contact-crease", "crease: indirect light within 5 cm of another surface, 1024 lights with repair, compensation and three layers in screen space", "relRMSE", "the lights alone", BENCH_RATIO_AT_LEAST, 2, 4},
};
enum { ROWS = sizeof table / sizeof table[0] };

size_t bench_screen_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, ROWS, rows, capacity); }

/* ---- time ---------------------------------------------------------------------------------------------------------------- */

enum { NOTHING, AMBIENT, SCREEN, BOUNCE, LAYERS, CAMERAS, KINDS };
static const char* const kinds[KINDS] = {"lamps=none", "lamps=ambient", "lamps=screen", "lamps=screen screen.bounce=true", "lamps=screen screen.layers=2", "lamps=screen screen.cameras=4"};

/* Brighter and bluer upwards, a warm horizon on one side. */
static bool add_sky(es_context* context, es_world* world)
{
    es_image image;
    if (es_image_create(context, 64, 32, 3, &image) != ES_OK) return false;
    for (uint32_t y = 0; y < image.height; y++)
        for (uint32_t x = 0; x < image.width; x++) {
            const float up = 1 - (float)y / 31, side = fabsf((float)x / 32 - 1);
            const float sky[3] = {0.4f + 0.6f * side * (1 - up), 0.5f + 0.2f * up, 0.4f + 0.8f * up};
            for (int k = 0; k < 3; k++) image.pixels[3 * (y * image.width + x) + (uint32_t)k] = y < 16 ? sky[k] : 0.1f;
        }
    const bool works = es_world_set_environment(world, &(es_environment_desc){.image = &image, .radiance = {1, 1, 1}}) == ES_OK;
    es_image_destroy(context, &image);
    if (!works) demo_refuse_context(context);
    return works;
}

/* Medians over frames that take turns, so that what else the machine does falls on all kinds alike. */
static bool measure_time(bench_sitting* bench)
{
    bool any = false;
    for (size_t i = 0; i + 1 < bench->count; i++) any |= sitting_row(bench, "%s", bench->rows[i].id) != NULL;
    if (!any) return true;
    enum { MOST = 32 };
    es_world* world = sitting_open_scene(bench, "hall");
    es_renderer* renderers[KINDS] = {NULL};
    double frame[KINDS][MOST], pass[KINDS][MOST];
    bool works = world && add_sky(bench->context, world);
    for (int k = 0; k < KINDS && works; k++) {
        char text[96];
        snprintf(text, sizeof text, "gi=none %s", kinds[k]);
        works = (renderers[k] = sitting_open_renderer(bench, text)) != NULL;
    }
    for (int i = -1; i < (int)bench->frames && works; i++)
        for (int k = 0; k < KINDS && works; k++) {
            const double time = sitting_render(bench, renderers[k], world);
            works = time > 0;
            if (i < 0 || !works) continue;
            frame[k][i] = time - sitting_pass(renderers[k], "environment", NULL); /* that is not made anew while it stands */
            pass[k][i] = sitting_pass(renderers[k], k == BOUNCE ? "screen-space bounce" : k == LAYERS || k == CAMERAS ? "screen-space views" : "screen-space occlusion", NULL);
        }
    if (works) {
        double whole[KINDS], part[KINDS];
        for (int k = 0; k < KINDS; k++) {
            whole[k] = bench_median(frame[k], bench->frames);
            part[k] = bench_median(pass[k], bench->frames);
        }
        const struct { const char* id; int kind, base; } overheads[] = {{"screen-occlusion-8", SCREEN, NOTHING}, {"screen-bounce", BOUNCE, SCREEN}, {"screen-over-ambient", SCREEN, AMBIENT}, {"screen-layers-2", LAYERS, SCREEN}, {"screen-cameras-4", CAMERAS, SCREEN}};
        for (size_t i = 0; i < sizeof overheads / sizeof overheads[0]; i++) {
            bench_row* row = sitting_row(bench, "%s", overheads[i].id);
            if (!row) continue;
            const double a = whole[overheads[i].kind], b = whole[overheads[i].base];
            row->value = overheads[i].base == NOTHING ? a - b : 100 * (a / b - 1);
            snprintf(row->note, sizeof row->note, "%.4g ms a frame against %.4g; the pass takes %.4g", a, b, part[overheads[i].kind]);
        }
    }
    for (int k = 0; k < KINDS; k++) es_renderer_destroy(renderers[k]);
    if (world) es_world_destroy(world);
    return works;
}

/* ---- error --------------------------------------------------------------------------------------------------------------- */

static bool measure_contact(bench_sitting* bench)
{
    bench_row* row = sitting_row(bench, "screen-contact-crease");
    bool exists = false;
    for (size_t i = 0; i < es_scene_count(); i++) exists |= !strcmp(es_scene_name(i), "crease");
    if (!row || !exists) return true;
    bench_sitting near = *bench;
    near.width = bench->options->width ? bench->options->width : bench->options->quick ? 64 : 512;
    near.height = bench->options->height ? bench->options->height : bench->options->quick ? 48 : 384;
    near.contact_reach = 0.05f;
    sitting_stage stage;
    sitting_error alone, with;
    bool works = sitting_open_stage(&near, "crease", &stage) && sitting_measure(&near, &stage, "gi=ism vpl.count=1024", &alone) &&
                 sitting_measure(&near, &stage, "gi=ism vpl.count=1024 vpl.bound=100 screen.repair=8 screen.layers=3 compensation.steps=1", &with);
    if (works) {
        row->value = with.contact;
        row->peer_value = alone.contact;
        row->ratio = alone.contact / with.contact;
        snprintf(row->note, sizeof row->note, "of all pixels %.3f against %.3f; %.4g ms against %.4g", with.all, alone.all, with.milliseconds, alone.milliseconds);
    }
    sitting_close_stage(&near, &stage);
    return works;
}

/* ---- all of it ----------------------------------------------------------------------------------------------------------- */

int bench_screen(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_screen_rows, 1024, 768);
    if (!bench) return DEMO_BAD_INPUT;
    bench->report = (bench_report){.name = "screen", .title = "Screen space", .about = "Direct light of a sky with occlusion per direction, one bounce, layers and further cameras, found in the picture: what each adds to a frame of 1024 × 768 pixels."};
    return sitting_close(bench, measure_time(bench) && measure_contact(bench));
}
