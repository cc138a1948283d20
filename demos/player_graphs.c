/* Graphs of the last frames: milliseconds of each pass, flicker, light, and the bodies' energy. */
#include "font.h"
#include "player.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static ui_series* series_of_pass(player_graphs* g, const char* name)
{
    for (size_t i = 0; i < g->pass_count; i++)
        if (!strncmp(g->passes[i].name, name, sizeof g->passes[i].name - 1)) return &g->passes[i].milliseconds;
    if (g->pass_count == PLAYER_MAX_SERIES) return NULL;
    snprintf(g->passes[g->pass_count].name, sizeof g->passes[g->pass_count].name, "%s", name);
    return &g->passes[g->pass_count++].milliseconds;
}

/* ---- flicker ---------------------------------------------------------------------------------------------------------------------- */

enum { GRID_STEP = 4 }; /* pixels between the samples of the picture, each way */

static float luminance(uint32_t xrgb)
{
    return 0.2126f * (float)(xrgb >> 16 & 255) + 0.7152f * (float)(xrgb >> 8 & 255) + 0.0722f * (float)(xrgb & 255);
}

/* What of the picture's change is not steady: the root mean square over a grid of pixels of L(t-1) - (L(t) + L(t-2)) / 2, the displayed
 * luminance, over its mean. A light that fades or a body that slides past leaves little of it, what jumps to and fro all. */
static float measure_flicker(player* p)
{
    player_graphs* g = &p->graphs;
    uint32_t width, height;
    const uint32_t* pixels = es_renderer_display(p->session.renderer, &width, &height);
    uint32_t columns = width / GRID_STEP, rows = height / GRID_STEP;
    size_t samples = (size_t)columns * rows;
    if (!samples) return NAN;
    if (columns != g->grid_width || rows != g->grid_height) {
        float* grown = realloc(g->luminance, 2 * samples * sizeof *grown);
        if (!grown) return NAN;
        g->luminance = grown;
        g->grid_width = columns;
        g->grid_height = rows;
        g->grids = 0;
    }
    double sum = 0, mean = 0;
    float *last = g->luminance, *before = g->luminance + samples;
    for (uint32_t y = 0; y < rows; y++)
        for (uint32_t x = 0; x < columns; x++) {
            size_t i = (size_t)y * columns + x;
            float now = luminance(pixels[(size_t)y * GRID_STEP * width + (size_t)x * GRID_STEP]);
            float jump = last[i] - 0.5f * (now + before[i]);
            sum += (double)(jump * jump);
            mean += (double)last[i];
            before[i] = last[i];
            last[i] = now;
        }
    if (g->grids < 2) {
        g->grids++;
        return NAN;
    }
    ui_series_add(&g->brightness, (float)(mean / (double)samples / 255));
    return mean > 0 ? (float)(sqrt(sum / (double)samples) / (mean / (double)samples)) : 0;
}

/* ---- bodies --------------------------------------------------------------------------------------------------------------------------------- */

/* Times gravity: J/kg. */
static double height_over(const double p[3], es_vec3 low, es_vec3 g)
{
    return -(double)g.x * (p[0] - (double)low.x) - (double)g.y * (p[1] - (double)low.y) - (double)g.z * (p[2] - (double)low.z);
}

/* Mechanical energy: of the motion and the height over the scene's floor of bodies and cloth, joules. Where nothing pushes it may not rise; what
 * springs and stretched cloth store is not in it. NaN without any. */
static float measure_energy(const player* p)
{
    enum { MOST = 4096 };
    static const es_object_kind kinds[] = {ES_OBJECT_BODY, ES_OBJECT_SOFT};
    const es_world* world = p->session.world;
    es_world_settings settings = es_world_get_settings(world);
    es_vec3 low = {0, 0, 0}, high;
    uint32_t* ids = malloc(MOST * sizeof *ids);
    double sum = 0;
    size_t moving = 0;
    es_world_bounds(world, &low, &high);
    for (size_t k = 0; ids && k < sizeof kinds / sizeof kinds[0]; k++) {
        size_t count = MOST;
        if (es_world_enumerate(world, kinds[k], ids, &count) != ES_OK) continue;
        for (size_t i = 0; i < count && i < MOST; i++) {
            es_body_state body;
            es_soft_state soft;
            if (kinds[k] == ES_OBJECT_SOFT) {
                es_soft_desc desc;
                if (es_world_get_soft_state(world, (es_soft){ids[i]}, &soft) != ES_OK || es_world_get_soft(world, (es_soft){ids[i]}, &desc) != ES_OK) continue;
                sum += (double)soft.kinetic_energy + (double)(desc.mass * desc.gravity_scale) * height_over(soft.centre, low, settings.gravity);
                moving++;
                continue;
            }
            if (es_world_get_body(world, (es_body){ids[i]}, &body) != ES_OK || body.type != ES_BODY_DYNAMIC) continue;
            sum += (double)body.kinetic_energy + (double)(body.mass * body.gravity_scale) * height_over(body.centre, low, settings.gravity);
            moving++;
        }
    }
    free(ids);
    return moving ? (float)sum : NAN;
}

/* ---- all of a frame ------------------------------------------------------------------------------------------------------------------ */

void player_graphs_add(player* p)
{
    player_graphs* g = &p->graphs;
    const es_frame_stats* stats = es_renderer_stats(p->session.renderer);
    ui_series_add(&g->frame, (float)stats->milliseconds);
    for (size_t i = 0; i < stats->pass_count; i++) {
        ui_series* series = series_of_pass(g, stats->passes[i].name);
        if (series) ui_series_add(series, stats->passes[i].skipped ? 0 : (float)stats->passes[i].milliseconds);
    }
    if (!p->show_graphs) {
        g->grids = 0;
        return;
    }
    ui_series_add(&g->flicker, measure_flicker(p));
    ui_series_add(&g->energy, measure_energy(p));
}

/* ---- panel ------------------------------------------------------------------------------------------------------------------------------ */

static const uint32_t colours[] = {0x66b2ff, 0xffb454, 0x7fd962, 0xf07178, 0xd2a6ff, 0x5ccfe6, 0xffd173, 0xc0c8d0};
enum { COLOURS = sizeof colours / sizeof colours[0] };

/* A plot with its upper edge's value and its newest. */
static void plot(player* p, int height, const char* title, const char* format, const ui_series* series, uint32_t colour)
{
    ui* u = &p->ui;
    char line[96], number[32], edge[32];
    float top = ui_plot_top(ui_series_largest(series));
    ui_series_text(series, format, number, sizeof number);
    snprintf(edge, sizeof edge, format, (double)top);
    snprintf(line, sizeof line, "%s %s, top of scale %s", title, number, edge);
    ui_label(u, 0, colour, line);
    ui_next_row(u);
    canvas_rect rect = {u->left, u->y, u->right - u->left, height};
    canvas_fill(u->canvas, rect, 0x05070a);
    ui_plot(u->canvas, rect, series, top, u->scale, colour);
    u->y += height + 2 * u->scale;
}

/* The passes that took the most in the mean, and their curves over each other. */
static void plot_passes(player* p, int height)
{
    enum { SHOWN = 8 };
    ui* u = &p->ui;
    player_graphs* g = &p->graphs;
    size_t order[PLAYER_MAX_SERIES], count = g->pass_count;
    for (size_t i = 0; i < count; i++) {
        size_t at = i;
        float mean = ui_series_mean(&g->passes[i].milliseconds);
        for (; at > 0 && ui_series_mean(&g->passes[order[at - 1]].milliseconds) < mean; at--) order[at] = order[at - 1];
        order[at] = i;
    }
    if (count > SHOWN) count = SHOWN;
    float largest = 0;
    for (size_t i = 0; i < count; i++) largest = fmaxf(largest, ui_series_largest(&g->passes[order[i]].milliseconds));
    float top = ui_plot_top(largest);
    canvas_rect rect = {u->left, u->y, u->right - u->left, height};
    canvas_fill(u->canvas, rect, 0x05070a);
    for (size_t i = count; i-- > 0;) ui_plot(u->canvas, rect, &g->passes[order[i]].milliseconds, top, u->scale, colours[i % COLOURS]);
    char line[96];
    snprintf(line, sizeof line, "%g ms", (double)top);
    canvas_text(u->canvas, rect.x + 2 * u->scale, rect.y + 2 * u->scale, u->scale, UI_DIM, line, 16);
    u->y += height + 2 * u->scale;
    for (size_t i = 0; i < count; i++) {
        const ui_series* series = &g->passes[order[i]].milliseconds;
        snprintf(line, sizeof line, "%-24.24s %7.2f  mean %6.2f", g->passes[order[i]].name, (double)ui_series_at(series, 0), (double)ui_series_mean(series));
        canvas_text(u->canvas, u->left, u->y, u->scale, colours[i % COLOURS], line, 60);
        u->y += FONT_HEIGHT * u->scale;
    }
}

void player_graphs_panel(player* p, canvas_rect rect)
{
    ui* u = &p->ui;
    player_graphs* g = &p->graphs;
    if (!ui_panel_begin(u, "graphs", rect, "Graphs")) p->show_graphs = false;
    const int curves = isfinite(ui_series_at(&g->energy, 0)) ? 4 : 3;
    int text = curves * (u->row + 2 * u->scale) + 8 * FONT_HEIGHT * u->scale, left = rect.y + rect.height - u->y - text - 6 * u->scale;
    int height = left / (curves + 2) > 12 * u->scale ? left / (curves + 2) : 12 * u->scale;
    char title[64];
    snprintf(title, sizeof title, "interface %.2f ms, frame", p->interface_milliseconds);
    plot(p, height, title, "%.2f ms", &g->frame, UI_TEXT);
    plot(p, height, "flicker", "%.4f", &g->flicker, colours[3]);
    plot(p, height, "brightness", "%.3f", &g->brightness, colours[1]);
    if (isfinite(ui_series_at(&g->energy, 0))) plot(p, height, "mechanical energy", "%.4g J", &g->energy, colours[2]);
    plot_passes(p, 2 * height);
    ui_panel_end(u);
}
