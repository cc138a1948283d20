/* `bench glare`: how long glare takes beside the thesis' table 8.2 and figure 8.10, how far its spectra are from what is known of them, and what it keeps of a picture's light. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench_sitting.h"

static const bench_row table[] = {
    {"glare-spectrum-256", "aperture of 256² pixels at 2 × 2 places each, its spectrum in 32 wavelengths, no convolution (table 8.2)", "ms", NULL, BENCH_VALUE_AT_MOST, 9.0, 4.5},
    {"glare-spectrum-512", "the same, 512²", "ms", NULL, BENCH_VALUE_AT_MOST, 18.4, 9.2},
    {"glare-spectrum-1024", "the same, 1024²", "ms", NULL, BENCH_VALUE_AT_MOST, 55.1, 27.5},
    {"glare-aperture-256", "of these, drawing the aperture (table 8.2), 256²", "ms", NULL, BENCH_VALUE_AT_MOST, 5.2, 2.6},
    {"glare-aperture-512", "the same, 512²", "ms", NULL, BENCH_VALUE_AT_MOST, 11.8, 5.9},
    {"glare-aperture-1024", "the same, 1024²", "ms", NULL, BENCH_VALUE_AT_MOST, 36.5, 18.2},
    {"glare-convolved-512", "aperture and spectrum, 512², and a picture of 512² convolved with it (fig. 8.10)", "ms", NULL, BENCH_VALUE_AT_MOST, 33, 16},
    {"glare-billboards-512", "the same with billboards (fig. 8.10: 19.1 ms with what else the frame is)", "ms", NULL, BENCH_NONE, 0, 0},
    {"glare-share", "lamp-shop, 1024×768, moving: glare's share of the frame, by convolution, its spectrum made each frame", "%", NULL, BENCH_VALUE_AT_MOST, 25, 8},
    {"glare-cycle-share", "the same with a cycle of 16 spectra, once they are made", "%", NULL, BENCH_NONE, 0, 0},
    {"glare-held", "lamp-shop, a held frame while nothing in the eye moves: passes of glare that run", "passes", NULL, BENCH_VALUE_AT_MOST, 0, 0},
    {"glare-energy", "lamp-shop: how much the mean of a channel is changed by glare, at the most", "%", NULL, BENCH_VALUE_AT_MOST, 0.1, 0.001},
    {"glare-airy-zero", "disc: the first dark ring's radius beside 1.2197 lambda / D", "%", NULL, BENCH_VALUE_AT_MOST, 1, 0.2},
    {"glare-airy-ring-1", "disc: the first bright ring's height beside 0.017498 of the middle's", "%", NULL, BENCH_VALUE_AT_MOST, 1, 0.2},
    {"glare-airy-ring-2", "disc: the second one's beside 0.004158", "%", NULL, BENCH_VALUE_AT_MOST, 1, 0.2},
    {"glare-grating", "bars: the first order's angle beside lambda / spacing", "%", NULL, BENCH_VALUE_AT_MOST, 1, 0.1},
    {"glare-parseval", "bars: light in the whole spectrum beside what comes through", "%", NULL, BENCH_VALUE_AT_MOST, 1, 0.1},
    {"glare-fraunhofer", "a thousandth of a dioptre off: light that is elsewhere than with none", "%", NULL, BENCH_VALUE_AT_MOST, 1, 0.1},
    {"glare-fresnel", "disc, 0.2 dioptres off: the middle's height beside (sin u / u)² of the sharp one's", "%", NULL, BENCH_VALUE_AT_MOST, 1, 0.1},
};

size_t bench_glare_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, sizeof table / sizeof table[0], rows, capacity); }

/* ---- spectra of what is known ------------------------------------------------------------------------------------------------------------ */

enum { SIZE = 2048, RADIUS = 128, SPACING = 24, SUB = 16 };
static const double width = 9e-3, wavelength = 575e-9; /* m */

/* A disc about the middle, each pixel the share of it that is inside. */
static void draw_disc(es_image* a, double radius)
{
    for (uint32_t y = 0; y < a->height; y++)
        for (uint32_t x = 0; x < a->width; x++) {
            const double u = x + 0.5 - a->width / 2.0, v = y + 0.5 - a->height / 2.0, distance = sqrt(u * u + v * v);
            uint32_t inside = distance < radius ? SUB * SUB : 0;
            if (fabs(distance - radius) < 1) {
                inside = 0;
                for (int i = 0; i < SUB * SUB; i++) {
                    const double p = u - 0.5 + (i % SUB + 0.5) / SUB, q = v - 0.5 + (i / SUB + 0.5) / SUB;
                    inside += p * p + q * q < radius * radius;
                }
            }
            a->pixels[(size_t)y * a->width + x] = (float)inside / (SUB * SUB);
        }
}

static double at(const es_image* power, int x, int y) { return (double)power->pixels[(size_t)((int)power->height / 2 + y) * power->width + (size_t)((int)power->width / 2 + x)]; }

static double percent_off(double value, double expected) { return 100 * fabs(value / expected - 1); }

static void set(bench_sitting* bench, const char* id, double value)
{
    bench_row* row = sitting_row(bench, "%s", id);
    if (row) row->value = value;
}

/* In samples: where the amplitude, which is real about the middle, changes its sign, on the parabola through the darkest sample and its neighbours. */
static double first_zero(const es_image* power)
{
    int k = 1;
    while (at(power, k + 1, 0) < at(power, k, 0)) k++;
    const double p = sqrt(at(power, k - 1, 0)), r = -sqrt(at(power, k + 1, 0)), darkest = sqrt(at(power, k, 0));
    const double q = fabs(p + r - 2 * darkest) < fabs(p + r + 2 * darkest) ? darkest : -darkest; /* whichever side makes it smoother */
    double t = 0;
    for (int i = 0; i < 20; i++) t -= (q + t * (r - p) / 2 + t * t * (p + r - 2 * q) / 2) / ((r - p) / 2 + t * (p + r - 2 * q));
    return k + t;
}

static double ring_height(const es_image* power, double about)
{
    double top = 0;
    for (int i = (int)about - 3; i <= (int)about + 3; i++) {
        const double p = at(power, i - 1, 0), q = at(power, i, 0), r = at(power, i + 1, 0);
        if (q >= p && q >= r) top = q + (p - r) * (p - r) / (8 * (2 * q - p - r));
    }
    return top / at(power, 0, 0);
}

static double first_order(const es_image* power, double expected)
{
    double sum = 0, weight = 0;
    for (int x = (int)expected - 4; x <= (int)expected + 5; x++)
        for (int y = -4; y <= 4; y++) {
            sum += x * at(power, x, y);
            weight += at(power, x, y);
        }
    return sum / weight;
}

static bool measure_spectra(bench_sitting* bench)
{
    es_context* context = bench->context;
    es_image aperture = {0}, sharp = {0}, other = {0};
    bool works = es_image_create(context, SIZE, SIZE, 1, &aperture) == ES_OK;
    if (works) {
        draw_disc(&aperture, RADIUS);
        works = es_diffraction_image(context, &aperture, (float)width, 0, &sharp) == ES_OK;
    }
    if (works) {
        const double sample = (double)SIZE / (2 * RADIUS); /* of lambda / D */
        set(bench, "glare-airy-zero", percent_off(first_zero(&sharp) / sample, 1.219669891));
        set(bench, "glare-airy-ring-1", percent_off(ring_height(&sharp, 1.634719 * sample), 0.017498));
        set(bench, "glare-airy-ring-2", percent_off(ring_height(&sharp, 2.679293 * sample), 0.004158));
        const float defocus = 0.2f;
        works = es_diffraction_image(context, &aperture, (float)width, defocus, &other) == ES_OK;
        const double radius = RADIUS * width / SIZE, u = 3.14159265358979323846 * (double)defocus * radius * radius / (2 * wavelength), expected = sin(u) * sin(u) / (u * u);
        if (works) set(bench, "glare-fresnel", percent_off(at(&other, 0, 0) / at(&sharp, 0, 0), expected));
        es_image_destroy(context, &other);
    }
    es_image_destroy(context, &sharp);
    if (works) {
        draw_disc(&aperture, 400);
        for (uint32_t i = 0; i < SIZE * SIZE; i++)
            if (i % SIZE % SPACING < 6) aperture.pixels[i] *= 0.5f;
        works = es_diffraction_image(context, &aperture, (float)width, 0, &sharp) == ES_OK;
    }
    if (works) {
        set(bench, "glare-grating", percent_off(first_order(&sharp, (double)SIZE / SPACING), (double)SIZE / SPACING));
        works = es_diffraction_image(context, &aperture, (float)width, 1e-3f, &other) == ES_OK;
    }
    if (works) {
        double elsewhere = 0;
        for (size_t i = 0; i < (size_t)SIZE * SIZE; i++) elsewhere += fabs((double)sharp.pixels[i] - (double)other.pixels[i]) / 2;
        set(bench, "glare-fraunhofer", 100 * elsewhere);
        es_image_destroy(context, &other);
        /* it sums to 1; by how much it was divided tells the middle, where |X|² is the square of all that comes through */
        double through = 0, squares = 0;
        for (size_t i = 0; i < (size_t)SIZE * SIZE; i++) {
            through += (double)aperture.pixels[i];
            squares += (double)aperture.pixels[i] * (double)aperture.pixels[i];
        }
        set(bench, "glare-parseval", percent_off(through * through / at(&sharp, 0, 0), squares * SIZE * SIZE));
    }
    es_image_destroy(context, &sharp);
    es_image_destroy(context, &aperture);
    if (!works) demo_refuse_context(context);
    return works;
}

/* ---- time -------------------------------------------------------------------------------------------------------------------------------- */

enum { MOST = 32 };
static const char* const passes[] = {"aperture of the eye", "spectrum of glare", "glare"};

/* Milliseconds of glare in a frame. */
static double glare_time(const es_renderer* renderer)
{
    double sum = 0;
    for (int i = 0; i < 3; i++) sum += sitting_pass(renderer, passes[i], NULL);
    return sum;
}

/* As the scene recommends, with these on top; NULL after a message. */
static es_renderer* open_renderer(bench_sitting* bench, const char* scene, uint32_t w, uint32_t h, const char* const* more)
{
    es_renderer_settings settings = es_default_renderer_settings();
    es_renderer* renderer = NULL;
    bool works = true;
    const char* const* lists[] = {es_scene_settings(scene), more};
    for (int list = 0; list < 2; list++)
        for (const char* const* text = lists[list]; *text && works; text++) {
            char name[64];
            const char* equals = strchr(*text, '=');
            snprintf(name, sizeof name, "%.*s", (int)(equals - *text), *text);
            works = es_renderer_settings_set(bench->context, &settings, name, equals + 1) == ES_OK;
        }
    settings.width = w;
    settings.height = h;
    if (!works || es_renderer_create(bench->context, &settings, &renderer) != ES_OK) demo_refuse_context(bench->context);
    return renderer;
}

/* Frames of a moving world, the first of which, and `before` more, count for nothing: medians of glare's time, of its share, and of the aperture's time. */
static bool measure_frames(bench_sitting* bench, es_world* world, uint32_t w, uint32_t h, const char* const* settings, int before, double* milliseconds, double* share, double* aperture, char* note, size_t note_size)
{
    double times[MOST], shares[MOST], parts[3][MOST];
    es_renderer* renderer = open_renderer(bench, "lamp-shop", w, h, settings);
    bool works = renderer != NULL;
    const int frames = (int)bench->frames;
    for (int i = -1 - before; i < frames && works; i++) {
        works = es_world_step(world, 1.0f / 30) == ES_OK;
        if (!works) demo_refuse_context(bench->context);
        const double frame = works ? sitting_render(bench, renderer, world) : NAN;
        works = works && frame > 0;
        if (i < 0 || !works) continue;
        times[i] = glare_time(renderer);
        shares[i] = 100 * times[i] / frame;
        for (int k = 0; k < 3; k++) parts[k][i] = sitting_pass(renderer, passes[k], NULL);
    }
    if (works) {
        *milliseconds = bench_median(times, bench->frames);
        *share = bench_median(shares, bench->frames);
        *aperture = bench_median(parts[0], bench->frames);
        snprintf(note, note_size, "aperture %.3g, spectrum %.3g, picture %.3g ms", bench_median(parts[0], bench->frames), bench_median(parts[1], bench->frames), bench_median(parts[2], bench->frames));
    }
    es_renderer_destroy(renderer);
    return works;
}

typedef struct timed { const char *id, *aperture_id /* NULL: no row */; uint32_t width, height; int before; bool share; const char* settings[8]; } timed;
static const timed times[] = {
    /* no billboards: nothing but the spectrum */
    {"glare-spectrum-256", "glare-aperture-256", 512, 512, 0, false, {"glare=billboards", "glare.billboards=0", "glare.size=256", "glare.width=9", "glare.supersample=2", "skip=false", NULL}},
    {"glare-spectrum-512", "glare-aperture-512", 512, 512, 0, false, {"glare=billboards", "glare.billboards=0", "glare.size=512", "glare.width=9", "glare.supersample=2", "skip=false", NULL}},
    {"glare-spectrum-1024", "glare-aperture-1024", 512, 512, 0, false, {"glare=billboards", "glare.billboards=0", "glare.size=1024", "glare.width=9", "glare.supersample=2", "skip=false", NULL}},
    {"glare-convolved-512", NULL, 512, 512, 0, false, {"glare=convolution", "glare.size=512", "glare.width=9", "glare.supersample=2", "skip=false", NULL}},
    {"glare-billboards-512", NULL, 512, 512, 0, false, {"glare=billboards", "glare.size=512", "glare.width=9", "glare.supersample=2", "skip=false", NULL}},
    {"glare-share", NULL, 1024, 768, 0, true, {"glare=convolution", "glare.cycle=0", NULL}},
    {"glare-cycle-share", NULL, 1024, 768, 60, true, {"glare=convolution", "glare.cycle=16", NULL}},
};

static bool measure_times(bench_sitting* bench, es_world* world)
{
    bool works = true;
    for (size_t i = 0; i < sizeof times / sizeof times[0] && works; i++) {
        bench_row *row = sitting_row(bench, "%s", times[i].id), *aperture_row = times[i].aperture_id ? sitting_row(bench, "%s", times[i].aperture_id) : NULL;
        if (!row && !aperture_row) continue;
        double milliseconds, share, aperture;
        char note[160];
        works = measure_frames(bench, world, bench->options->quick ? 64 : times[i].width, bench->options->quick ? 48 : times[i].height, times[i].settings, bench->options->quick ? 0 : times[i].before, &milliseconds, &share, &aperture, note, sizeof note);
        if (!works) break;
        if (aperture_row) aperture_row->value = aperture;
        if (!row) continue;
        row->value = times[i].share ? share : milliseconds;
        snprintf(row->note, sizeof row->note, "%s%s", note, times[i].share ? ", as the scene recommends" : "");
    }
    return works;
}

/* ---- what is kept ------------------------------------------------------------------------------------------------------------------------ */

static double worst_change(const es_image* before, const es_image* after)
{
    double worst = 0;
    for (uint32_t k = 0; k < 3; k++) {
        double sums[2] = {0};
        for (size_t i = k; i < (size_t)before->width * before->height * 3; i += 3) {
            sums[0] += (double)before->pixels[i];
            sums[1] += (double)after->pixels[i];
        }
        worst = fmax(worst, percent_off(sums[1], sums[0]));
    }
    return worst;
}

static bool measure_kept(bench_sitting* bench, es_world* world)
{
    bench_row *held = sitting_row(bench, "glare-held"), *energy = sitting_row(bench, "glare-energy");
    if (!held && !energy) return true;
    static const char* const still[] = {"glare=convolution", "glare.hippus=0", "glare.accommodation=0", "glare.saccades=0", "glare.blink=false", "temporal=false", "antialias=none", NULL}; /* history has something new for many frames */
    es_renderer* renderer = open_renderer(bench, "lamp-shop", bench->width, bench->height, still);
    bool works = renderer != NULL;
    for (int i = 0; i < 4 && works; i++) { /* the frame after the last that moved shows how it had moved */
        works = es_world_step(world, 0) == ES_OK && es_renderer_render(renderer, world) == ES_OK;
        if (!works) demo_refuse_context(bench->context);
    }
    if (works && held) {
        const es_frame_stats* stats = es_renderer_stats(renderer);
        held->value = 0;
        for (size_t i = 0; i < stats->pass_count; i++)
            for (int k = 0; k < 3; k++) held->value += !strcmp(stats->passes[i].name, passes[k]) && !stats->passes[i].skipped;
    }
    es_image before = {0}, after = {0};
    if (works && energy) {
        works = es_renderer_image(renderer, "radiance", &before) == ES_OK && es_renderer_image(renderer, "glare", &after) == ES_OK;
        if (works) energy->value = worst_change(&before, &after);
        else demo_refuse_context(bench->context);
    }
    es_image_destroy(bench->context, &before);
    es_image_destroy(bench->context, &after);
    es_renderer_destroy(renderer);
    return works;
}

int bench_glare(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_glare_rows, 1024, 768);
    if (!bench) return DEMO_BAD_INPUT;
    bench->report = (bench_report){.name = "glare", .title = "Temporal glare", .about = "An eye's aperture, its spectrum and the picture seen by it: times, and errors beside what is known of discs and bars."};
    es_world* world = sitting_open_scene(bench, "lamp-shop");
    const bool works = world && measure_times(bench, world) && measure_kept(bench, world) && measure_spectra(bench);
    if (world) es_world_destroy(world);
    return sitting_close(bench, works);
}
