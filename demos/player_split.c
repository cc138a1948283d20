/* The other side of a divider: the frame with the settings as they were, or a path-traced reference that refines while the scene rests. */
#include "font.h"
#include "player.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void drop_reference(player_split* s)
{
    if (s->reference) es_reference_destroy(s->reference);
    s->reference = NULL;
    s->begun = false;
}

void player_split_close(player* p)
{
    player_split* s = &p->split;
    drop_reference(s);
    if (s->renderer) es_renderer_destroy(s->renderer);
    free(s->pixels);
    s->renderer = NULL;
    s->pixels = NULL;
    s->capacity = 0;
    s->width = s->height = 0;
}

void player_next_split(player* p)
{
    player_split* s = &p->split;
    player_split_close(p);
    s->mode = (s->mode + 1) % SPLIT_MODES;
    s->part = 4;
    s->sample_seconds = 0;
    if (s->mode == SPLIT_REFERENCE && !p->paused) player_notice(p, "the reference refines while the scene is paused: Space");
}

static bool fit_pixels(player_split* s, uint32_t width, uint32_t height)
{
    size_t pixels = (size_t)width * height;
    if (pixels > s->capacity) {
        uint32_t* grown = realloc(s->pixels, pixels * sizeof *grown);
        if (!grown) return false;
        s->pixels = grown;
        s->capacity = pixels;
    }
    s->width = width;
    s->height = height;
    return true;
}

/* ---- former settings ---------------------------------------------------------------------------------------------------------------- */

static int update_former(player* p)
{
    player_split* s = &p->split;
    es_renderer_settings settings = s->former;
    settings.width = p->session.settings.width;
    settings.height = p->session.settings.height;
    if (!s->renderer && es_renderer_create(p->session.context, &settings, &s->renderer) != ES_OK) return demo_refuse_context(p->session.context);
    if (es_renderer_configure(s->renderer, &settings) != ES_OK || es_renderer_render(s->renderer, p->session.world) != ES_OK)
        return demo_refuse_context(p->session.context);
    uint32_t width, height;
    const uint32_t* display = es_renderer_display(s->renderer, &width, &height);
    if (!display || !fit_pixels(s, width, height)) return DEMO_OK;
    memcpy(s->pixels, display, (size_t)width * height * sizeof *display);
    return DEMO_OK;
}

/* ---- reference ------------------------------------------------------------------------------------------------------------------------ */

static bool same_revisions(const es_world_revisions* a, const es_world_revisions* b)
{
    return a->geometry == b->geometry && a->materials == b->materials && a->lights == b->lights && a->camera == b->camera;
}

static es_reference_settings wanted_settings(const player* p)
{
    es_reference_settings settings = es_default_reference_settings();
    uint32_t part = p->split.part;
    settings.width = (p->session.settings.width + part - 1) / part;
    settings.height = (p->session.settings.height + part - 1) / part;
    settings.bounces = p->session.settings.method == ES_GI_NONE ? 0 : p->session.settings.bounces;
    settings.max_samples = 0;
    return settings;
}

/* Begins anew when the world, its camera or what the reference has to show is another. */
static int begin_reference(player* p, const es_world_revisions* now)
{
    player_split* s = &p->split;
    es_reference_settings settings = wanted_settings(p);
    bool same = s->reference && !memcmp(&settings, &s->reference_settings, sizeof settings);
    if (same && s->begun && same_revisions(now, &s->seen)) return DEMO_OK;
    if (!same) {
        drop_reference(s);
        if (es_reference_create(p->session.context, &settings, &s->reference) != ES_OK) return demo_refuse_context(p->session.context);
        s->reference_settings = settings;
    }
    if (es_reference_begin(s->reference, p->session.world) != ES_OK) return demo_refuse_context(p->session.context);
    s->seen = *now;
    s->begun = true;
    return DEMO_OK;
}

/* The finest picture of which a sample takes a fraction of a second, by the quickest one so far: the window must answer meanwhile, and one
 * that the machine was busy elsewhere during says little. */
static void choose_part(player_split* s, double seconds)
{
    if (!(s->sample_seconds > 0) || seconds < s->sample_seconds) s->sample_seconds = seconds;
    uint64_t samples = es_reference_get_stats(s->reference).samples;
    uint32_t part = s->part;
    if (samples >= 3 && s->sample_seconds > 0.5 && part < 4) part *= 2;
    else if (s->sample_seconds * 4 < 0.4 && part > 1) part /= 2;
    if (part == s->part) return;
    s->part = part;
    s->sample_seconds = 0;
}

static int update_reference(player* p)
{
    player_split* s = &p->split;
    es_world_revisions now = es_world_get_revisions(p->session.world);
    if (!p->paused || now.moving) {
        s->begun = false;
        return DEMO_OK; /* the last one stays to be seen, marked as old */
    }
    if (begin_reference(p, &now) != DEMO_OK) return DEMO_BAD_INPUT;
    double start = demo_seconds();
    if (es_reference_add(s->reference, 1) != ES_OK) {
        s->begun = false;
        return DEMO_OK;
    }
    double seconds = demo_seconds() - start;
    es_image radiance;
    if (es_reference_image(s->reference, "radiance", &radiance) != ES_OK) return demo_refuse_context(p->session.context);
    if (fit_pixels(s, radiance.width, radiance.height)) es_tone_map_image(p->session.context, &p->session.settings, &radiance, s->pixels);
    es_image_destroy(p->session.context, &radiance);
    choose_part(s, seconds);
    return DEMO_OK;
}

int player_split_update(player* p)
{
    if (p->split.mode == SPLIT_FORMER) return update_former(p);
    return p->split.mode == SPLIT_REFERENCE ? update_reference(p) : DEMO_OK;
}

/* ---- on the canvas ---------------------------------------------------------------------------------------------------------------------- */

static int divider_x(const player* p) { return (int)(p->split.divider * (float)p->canvas.width); }

/* What differs between the sides, to be read without the panel. */
static void describe_difference(const player* p, char* text, size_t size)
{
    const player_split* s = &p->split;
    size_t differences = 0;
    snprintf(text, size, "the same settings");
    for (size_t i = 0; i < es_renderer_setting_count(); i++) {
        const es_setting* setting = es_renderer_setting(i);
        size_t bytes = setting->type == ES_SETTING_BOOL ? sizeof(bool) : sizeof(uint32_t);
        if (!strcmp(setting->name, "width") || !strcmp(setting->name, "height")) continue;
        if (!memcmp((const char*)&s->former + setting->offset, (const char*)&p->session.settings + setting->offset, bytes)) continue;
        if (!differences++) snprintf(text, size, "former %s", setting->name);
    }
    if (differences > 1) snprintf(text + strlen(text), size - strlen(text), " and %zu more", differences - 1);
}

static void describe_reference(const player* p, char* text, size_t size)
{
    const player_split* s = &p->split;
    if (!s->begun || !s->reference) {
        snprintf(text, size, "reference: %s", p->paused ? "waits" : "pause to refine");
        return;
    }
    es_reference_stats stats = es_reference_get_stats(s->reference);
    snprintf(text, size, "reference: %llu samples, error %.3g%s", (unsigned long long)stats.samples, stats.error, s->part > 1 ? ", coarse" : "");
}

void player_split_draw(player* p)
{
    player_split* s = &p->split;
    demo_canvas* canvas = &p->canvas;
    if (s->mode == SPLIT_OFF) return;
    int from = divider_x(p), scale = p->ui.scale > 0 ? p->ui.scale : 1;
    for (uint32_t y = 0; s->pixels && s->width && y < canvas->height; y++) {
        const uint32_t* row = s->pixels + (size_t)((uint64_t)y * s->height / canvas->height) * s->width;
        uint32_t* to = canvas->pixels + (size_t)y * canvas->width;
        for (uint32_t x = (uint32_t)from; x < canvas->width; x++) to[x] = row[(uint64_t)x * s->width / canvas->width];
    }
    if (p->hide_all) return;
    canvas_fill(canvas, (canvas_rect){from - scale / 2, 0, scale, (int)canvas->height}, s->dragging ? UI_FOCUS : UI_TEXT);
    char text[160];
    if (s->mode == SPLIT_FORMER) describe_difference(p, text, sizeof text);
    else describe_reference(p, text, sizeof text);
    canvas_label(canvas, from + 6 * scale, p->ui.row + 12 * scale, scale, UI_TEXT, text);
    canvas_label(canvas, from - 24 * scale - 6 * scale, p->ui.row + 12 * scale, scale, UI_TEXT, "now");
}

bool player_split_drag(player* p, const es_window_input* input)
{
    player_split* s = &p->split;
    if (s->mode == SPLIT_OFF || !p->canvas.width) return s->dragging = false;
    if (input->mouse_pressed[0] && fabsf(input->press_x[0] - (float)divider_x(p)) <= (float)(6 * p->ui.scale)) s->dragging = true;
    bool moves = s->dragging;
    if (s->dragging) s->divider = fminf(fmaxf(input->mouse_x / (float)p->canvas.width, 0.02f), 0.98f);
    if (!input->mouse_down[0]) s->dragging = false;
    return moves;
}
