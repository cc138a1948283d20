#include "ledger_pictures.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct job {
    es_context* context;
    es_world* world;
    const ledger_effort* effort;
    es_renderer_settings method;
    ledger_frame* frame;
    bool out_of_memory;
} job;

/* Two halves, with memory of their own. */
typedef struct halves { float* at[2]; } halves;

static float* take(job* j)
{
    ledger_frame* f = j->frame;
    float* plane = f->plane_count < sizeof f->planes / sizeof f->planes[0] ? calloc(f->floats, sizeof *plane) : NULL;
    if (plane) f->planes[f->plane_count++] = plane;
    else j->out_of_memory = true;
    return plane;
}

static bool take_halves(job* j, halves* h)
{
    h->at[0] = take(j);
    h->at[1] = h->at[0] ? take(j) : NULL;
    return h->at[1] != NULL;
}

static ledger_picture both(const halves* h) { return (ledger_picture){{h->at[0], h->at[1]}}; }
static ledger_picture certain(const float* plane) { return (ledger_picture){{plane, plane}}; }

static void say(const char* what)
{
    if (isatty(STDERR_FILENO)) fprintf(stderr, "\r\033[K%s", what);
}

/* ---- one picture --------------------------------------------------------------------------------------------------- */

/* Adds weight times the image to the plane. */
static bool add_image(const job* j, es_image* image, float weight, float* plane)
{
    bool fits = (size_t)image->width * image->height * image->channels == j->frame->floats;
    for (size_t k = 0; k < j->frame->floats && fits; k++) plane[k] += weight * image->pixels[k];
    es_image_destroy(j->context, image);
    return fits;
}

static bool add_rendered(const job* j, es_renderer* renderer, const char* name, float weight, float* plane)
{
    es_image image;
    return es_renderer_image(renderer, name, &image) == ES_OK && add_image(j, &image, weight, plane);
}

/* A frame that knows of none before it. */
static bool add_frame(const job* j, const es_renderer_settings* settings, const char* name, float weight, float* plane)
{
    es_renderer* renderer;
    if (es_renderer_create(j->context, settings, &renderer) != ES_OK) return false;
    bool works = es_renderer_render(renderer, j->world) == ES_OK && add_rendered(j, renderer, name, weight, plane);
    es_renderer_destroy(renderer);
    return works;
}

static es_renderer_settings without_pattern(es_renderer_settings s)
{
    s.interleave = 1;
    s.filter_passes = 0;
    return s;
}

static es_renderer_settings with_rays(es_renderer_settings s)
{
    s.method = ES_GI_VPL_TRACED;
    s.traced_interleave = true;
    return s;
}

static es_renderer_settings with_fine_lights(es_renderer_settings s)
{
    s.light_size = LEDGER_FINE_LIGHT_SIZE;
    return s;
}

/* ---- many sets of lights --------------------------------------------------------------------------------------------- */

/* Sets are runs of one sequence of points; the method's own begins at 0. Where the others begin is drawn at random, or the sets of the two
 * halves would make up for each other's gaps and not be independent. */
static uint32_t seed_of(uint32_t set)
{
    uint32_t x = (set + 1) * 0x9e3779b9u;
    x = (x ^ x >> 16) * 0x85ebca6bu;
    x = (x ^ x >> 13) * 0xc2b2ae35u;
    return 10000 + (x ^ x >> 16) % 900000;
}

/* Means over sets, those of the one parity for each half. An interleaved picture without its filter has at every pixel as many lights
 * as the pattern leaves it; over many sets it is the picture of all lights at all pixels. `first`: the same of the first of the sets,
 * as many as there are also taken from fine light G-buffers. NULL: not asked for. */
static bool add_sets(const job* j, const es_renderer_settings* settings, uint32_t sets, const halves* filtered, const halves* unfiltered, const halves* first)
{
    es_renderer* renderer;
    es_renderer_settings s = *settings;
    if (es_renderer_create(j->context, &s, &renderer) != ES_OK) return false;
    bool works = true;
    for (uint32_t k = 0; k < 2 * sets && works; k++) {
        s.seed = seed_of(k);
        works = es_renderer_configure(renderer, &s) == ES_OK && es_renderer_render(renderer, j->world) == ES_OK;
        float weight = 1.0f / (float)sets;
        if (works && filtered) works = add_rendered(j, renderer, "indirect", weight, filtered->at[k % 2]);
        if (works && unfiltered) works = add_rendered(j, renderer, "indirect-unfiltered", weight, unfiltered->at[k % 2]);
        if (works && first && k < 2 * j->effort->fine_sets) works = add_rendered(j, renderer, "indirect-unfiltered", 1.0f / (float)j->effort->fine_sets, first->at[k % 2]);
    }
    es_renderer_destroy(renderer);
    return works;
}

/* What the bounds on a pair's light leave out. */
static bool add_compensation(const job* j, es_renderer_settings settings, float weight, const halves* result)
{
    settings.traced_bias = ES_TRACED_COMPENSATED;
    settings.traced_samples = j->effort->compensation_samples;
    bool works = true;
    for (uint32_t h = 0; h < 2 && works; h++) {
        settings.seed = seed_of(h);
        works = add_frame(j, &settings, "compensation", weight, result->at[h]);
    }
    return works;
}

/* ---- the causes --------------------------------------------------------------------------------------------------------- */

static bool measure_temporal(job* j, const es_image* after, float** alone)
{
    float *method = take(j), *part = take(j);
    *alone = take(j);
    if (!method || !part || !*alone || !add_frame(j, &j->method, "indirect", 1, *alone)) return false;
    if ((size_t)after->width * after->height * after->channels != j->frame->floats) return false;
    memcpy(method, after->pixels, j->frame->floats * sizeof *method);
    for (size_t k = 0; k < j->frame->floats; k++) part[k] = method[k] - (*alone)[k];
    j->frame->method = certain(method);
    j->frame->parts[LEDGER_TEMPORAL] = j->frame->lost[LEDGER_TEMPORAL] = certain(part);
    return true;
}

static bool subtract(job* j, const float* from, const ledger_picture* what, ledger_picture* difference)
{
    halves d;
    if (!take_halves(j, &d)) return false;
    for (int h = 0; h < 2; h++)
        for (size_t k = 0; k < j->frame->floats; k++) d.at[h][k] = from[k] - what->half[h][k];
    *difference = both(&d);
    return true;
}

/* The three causes that act on each other, over all orders. */
static bool measure_lights(job* j, const float* alone, const halves* first)
{
    static const ledger_cause causes[] = {LEDGER_NUMBER, LEDGER_INTERLEAVE, LEDGER_VISIBILITY};
    enum { NUMBER = 1, PATTERN = 2, RAYS = 4, SETS = 8 };
    halves filtered[2], unfiltered[2], found[3];
    float *no_pattern = take(j), *rays = take(j), *neither = take(j), *parts[3][2];
    es_renderer_settings traced = with_rays(j->method), maps_only = without_pattern(j->method), exact = without_pattern(traced);
    bool works = no_pattern && rays && neither;
    for (int i = 0; i < 2; i++) works = works && take_halves(j, &filtered[i]) && take_halves(j, &unfiltered[i]);
    for (int i = 0; i < 3; i++) {
        works = works && take_halves(j, &found[i]);
        for (int h = 0; h < 2; h++) parts[i][h] = works ? found[i].at[h] : NULL;
    }
    if (!works) return false;
    say("every light at every pixel");
    works = add_frame(j, &maps_only, "indirect", 1, no_pattern) && add_frame(j, &traced, "indirect", 1, rays) && add_frame(j, &exact, "indirect", 1, neither);
    say("many sets of lights, shadow maps");
    works = works && add_sets(j, &j->method, j->effort->sets, &filtered[0], &unfiltered[0], NULL);
    say("many sets of lights, rays");
    works = works && add_sets(j, &traced, j->effort->sets, &filtered[1], &unfiltered[1], first);
    if (!works) return false;
    ledger_picture of_sets[SETS];
    for (int s = 0; s < SETS; s++) {
        const int r = s & RAYS ? 1 : 0;
        const float* once[2][2] = {{alone, no_pattern}, {rays, neither}};
        of_sets[s] = !(s & NUMBER) ? certain(once[r][s & PATTERN ? 1 : 0]) : s & PATTERN ? both(&unfiltered[r]) : both(&filtered[r]);
    }
    ledger_average_orders(of_sets, 3, j->frame->floats, parts);
    for (int i = 0; i < 3; i++) {
        j->frame->parts[causes[i]] = both(&found[i]);
        if (!subtract(j, alone, &of_sets[1 << i], &j->frame->lost[causes[i]])) return false;
    }
    return true;
}

static bool measure_bound(job* j)
{
    halves part;
    say("what the bounds leave out");
    if (!take_halves(j, &part) || !add_compensation(j, with_rays(j->method), -1, &part)) return false;
    j->frame->parts[LEDGER_BOUND] = j->frame->lost[LEDGER_BOUND] = both(&part);
    return true;
}

/* `coarse`: the sets that are taken again, from the method's own light G-buffers. What the bounds leave out depends on these too. */
static bool measure_light_view(job* j, const float* alone, const halves* coarse)
{
    halves fine, part;
    float* once = take(j);
    es_renderer_settings method = with_fine_lights(j->method), traced = with_rays(method);
    say("fine light G-buffers");
    if (!once || !take_halves(j, &fine) || !take_halves(j, &part)) return false;
    bool works = add_frame(j, &method, "indirect", 1, once);
    works = works && add_sets(j, &traced, j->effort->fine_sets, NULL, &fine, NULL) && add_compensation(j, traced, 1, &fine);
    const ledger_picture* bound = &j->frame->parts[LEDGER_BOUND];
    for (int h = 0; h < 2 && works; h++)
        for (size_t k = 0; k < j->frame->floats; k++) part.at[h][k] = coarse->at[h][k] - bound->half[h][k] - fine.at[h][k];
    j->frame->parts[LEDGER_LIGHT_VIEW] = both(&part);
    ledger_picture with = certain(once);
    return works && subtract(j, alone, &with, &j->frame->lost[LEDGER_LIGHT_VIEW]);
}

/* ---- the reference --------------------------------------------------------------------------------------------------------- */

static es_reference* open_reference(const job* j, uint32_t half, bool quantised, uint32_t bounces)
{
    es_reference_settings s = es_default_reference_settings();
    s.width = j->effort->width;
    s.height = j->effort->height;
    s.bounces = bounces;
    s.seed = half + 1;
    s.antialias = s.emission = false; /* as the method, which samples centres and is lit by lamps */
    s.quantised = quantised;
    es_reference* reference;
    if (es_reference_create(j->context, &s, &reference) != ES_OK) return NULL;
    if (es_reference_begin(reference, j->world) == ES_OK) return reference;
    es_reference_destroy(reference);
    return NULL;
}

static bool add_reference(const job* j, es_reference* reference, const char* name, float weight, float* plane)
{
    es_image image;
    return es_reference_image(reference, name, &image) == ES_OK && add_image(j, &image, weight, plane);
}

/* The picture from `samples` samples, less what rounding makes of the first of them. */
static bool measure_reference_half(job* j, uint32_t half, float* result, float* rounding)
{
    const ledger_effort* e = j->effort;
    uint32_t first = e->quantised_samples < e->samples ? e->quantised_samples : e->samples;
    es_reference *exact = open_reference(j, half, false, 1), *rounded = open_reference(j, half, true, 1);
    bool works = exact && rounded && es_reference_add(exact, first) == ES_OK && es_reference_add(rounded, first) == ES_OK;
    works = works && add_reference(j, rounded, "indirect", 1, rounding) && add_reference(j, exact, "indirect", -1, rounding);
    works = works && es_reference_add(exact, e->samples - first) == ES_OK && add_reference(j, exact, "indirect", 1, result);
    es_reference_destroy(exact);
    es_reference_destroy(rounded);
    return works;
}

static bool measure_reference(job* j)
{
    halves reference, rounding;
    say("the reference");
    bool works = take_halves(j, &reference) && take_halves(j, &rounding);
    for (uint32_t h = 0; h < 2 && works; h++) works = measure_reference_half(j, h, reference.at[h], rounding.at[h]);
    if (!works) return false;
    j->frame->reference = both(&reference);
    j->frame->parts[LEDGER_QUANTISATION] = j->frame->lost[LEDGER_QUANTISATION] = both(&rounding);
    return true;
}

/* What the ledger is not about: later bounces and direct light. */
static bool measure_besides(job* j)
{
    halves later;
    float* direct = take(j);
    say("further bounces");
    bool works = direct && take_halves(j, &later) && add_frame(j, &j->method, "direct", 1, direct);
    for (uint32_t h = 0; h < 2 && works; h++) {
        es_reference* reference = open_reference(j, h, false, LEDGER_BOUNCES);
        works = reference && es_reference_add(reference, j->effort->bounce_samples) == ES_OK;
        works = works && add_reference(j, reference, "indirect", 1, later.at[h]) && add_reference(j, reference, "bounce-1", -1, later.at[h]);
        if (works && h == 0) works = add_reference(j, reference, "direct", -1, direct);
        es_reference_destroy(reference);
    }
    for (size_t k = 0; k < j->frame->floats && works; k++) {
        j->frame->further += (double)later.at[0][k] * (double)later.at[1][k];
        j->frame->direct += (double)direct[k] * (double)direct[k];
    }
    return works;
}

/* ---- the frame ------------------------------------------------------------------------------------------------------------- */

es_renderer_settings ledger_method(const ledger_effort* effort)
{
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = effort->width;
    settings.height = effort->height;
    return settings;
}

int ledger_frame_measure(es_world* world, const ledger_effort* effort, const es_image* method, ledger_frame* frame)
{
    job j = {.context = es_world_context(world), .world = world, .effort = effort, .method = ledger_method(effort), .frame = frame};
    float* alone;
    halves first;
    *frame = (ledger_frame){.floats = (size_t)effort->width * effort->height * 3};
    bool works = take_halves(&j, &first) && measure_temporal(&j, method, &alone) && measure_lights(&j, alone, &first) && measure_bound(&j);
    works = works && measure_light_view(&j, alone, &first) && measure_reference(&j) && measure_besides(&j);
    say("");
    if (works) return DEMO_OK;
    return j.out_of_memory ? demo_refuse("bench ledger: out of memory") : demo_refuse_context(j.context);
}

void ledger_frame_free(ledger_frame* frame)
{
    for (size_t i = 0; i < frame->plane_count; i++) free(frame->planes[i]);
    *frame = (ledger_frame){0};
}
