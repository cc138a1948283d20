/* The micro-buffers of the pixel under the mouse: for what it reflects in all directions and for its lobe, what they hold and how far away that is, as they
 * are and laid out over the hemisphere. */
#include "font.h"
#include "player.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

typedef struct micro_pictures { es_image radiance[2], distance[2]; } micro_pictures; /* [0] as the buffer is, [1] over the hemisphere */

/* False where nothing of the kind is gathered, or no frame has micro-buffers. */
static bool take(player* p, uint32_t x, uint32_t y, bool lobe, micro_pictures* pictures)
{
    bool some = true;
    for (int k = 0; k < 2; k++) some &= es_renderer_micro_buffer(p->session.renderer, x, y, lobe, k == 0, &pictures->radiance[k], &pictures->distance[k]) == ES_OK;
    return some && pictures->radiance[0].width > 1;
}

static void put(demo_canvas* canvas, canvas_rect rect, const es_image* image, const uint32_t* words)
{
    const canvas_rect shown = canvas_intersect(rect, canvas->clip);
    for (int y = shown.y; y < shown.y + shown.height; y++)
        for (int x = shown.x; x < shown.x + shown.width; x++) {
            const uint32_t column = (uint32_t)(x - rect.x) * image->width / (uint32_t)rect.width, row = (uint32_t)(y - rect.y) * image->height / (uint32_t)rect.height;
            canvas->pixels[(size_t)y * canvas->width + (size_t)x] = words[(size_t)row * image->width + column];
        }
}

static void put_radiance(player* p, canvas_rect rect, const es_image* image)
{
    uint32_t* words = malloc((size_t)image->width * image->height * sizeof *words);
    if (words && es_tone_map_image(p->session.context, &p->session.settings, image, words) == ES_OK) put(&p->canvas, rect, image, words);
    free(words);
}

static void put_distance(player* p, canvas_rect rect, const es_image* image)
{
    float farthest = 0;
    const size_t pixels = (size_t)image->width * image->height;
    es_image colours = {0};
    uint32_t* words = malloc(pixels * sizeof *words);
    for (size_t i = 0; i < pixels; i++)
        if (image->pixels[i] > farthest) farthest = image->pixels[i];
    if (words && es_image_false_colour(p->session.context, image, farthest > 0 ? farthest : 1, false, &colours) == ES_OK) {
        for (size_t i = 0; i < pixels; i++) {
            words[i] = 0;
            for (int c = 0; c < 3; c++) words[i] = words[i] << 8 | (uint32_t)(colours.pixels[3 * i + (size_t)c] * 255 + 0.5f);
        }
        put(&p->canvas, rect, image, words);
    }
    es_image_destroy(p->session.context, &colours);
    free(words);
}

static void row_of_pictures(player* p, const micro_pictures* pictures, int side)
{
    ui* u = &p->ui;
    for (int k = 0; k < 4; k++) {
        const canvas_rect rect = {u->left + k * (side + 4 * u->scale), u->y, side, side};
        if (k < 2) put_radiance(p, rect, &pictures->radiance[k]);
        else put_distance(p, rect, &pictures->distance[k - 2]);
    }
    u->y += side + 2 * u->scale;
}

static void text(player* p, uint32_t colour, const char* line)
{
    ui* u = &p->ui;
    canvas_text(u->canvas, u->left, u->y, u->scale, colour, line, INT_MAX);
    u->y += (FONT_HEIGHT + 2) * u->scale;
}

void player_micro_panel(player* p, int bottom)
{
    ui* u = &p->ui;
    const es_renderer_settings* s = &p->session.settings;
    const int side = 64 * u->scale, line = (FONT_HEIGHT + 2) * u->scale, width = 4 * (side + 4 * u->scale) + 12 * u->scale, height = 2 * (side + line + 2 * u->scale) + line + u->row + 12 * u->scale;
    canvas_rect rect = {(int)p->canvas.width - width, bottom - height, width, height};
    if (rect.x < 0) rect.x = 0;
    if (!ui_panel_begin(u, "micro-buffers", rect, "Micro-buffers")) p->show_micro = false;
    const float fx = p->input.mouse_x / (float)(p->input.width ? p->input.width : 1), fy = p->input.mouse_y / (float)(p->input.height ? p->input.height : 1);
    const bool inside = fx >= 0 && fx < 1 && fy >= 0 && fy < 1;
    if (s->method != ES_GI_MICRO) {
        text(p, UI_DIM, "gi is not micro (key G)");
    } else if (inside) {
        const uint32_t x = (uint32_t)(fx * (float)s->width), y = (uint32_t)(fy * (float)s->height);
        char note[64];
        snprintf(note, sizeof note, "pixel %u, %u: light, distance", x, y);
        text(p, UI_DIM, note);
        for (int lobe = 0; lobe < 2; lobe++) {
            micro_pictures pictures = {0};
            const bool some = take(p, x, y, lobe != 0, &pictures);
            text(p, UI_TEXT, lobe ? some ? "lobe" : "no lobe" : some ? "all directions" : "reflects nothing in all directions");
            if (some) row_of_pictures(p, &pictures, side);
            for (int k = 0; k < 2; k++) {
                es_image_destroy(p->session.context, &pictures.radiance[k]);
                es_image_destroy(p->session.context, &pictures.distance[k]);
            }
        }
    }
    ui_panel_end(u);
}
