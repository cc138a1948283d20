/* `earthshine compare A B`: the error of A against the reference B, of a picture or of a sequence, limits for tests, and pictures of
 * where the error lies. */
#include "demo.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

enum { RMSE, RELRMSE, RELMSE, RELL1, FLIP, HDR_FLIP, MAX, FLICKER, METRICS };
static const char* const metric_names[METRICS] = {"rmse", "relrmse", "relmse", "rell1", "flip", "hdr_flip", "max", "flicker"};

enum { MAPS = 5 };
static const char* const map_names[MAPS] = {"absolute", "relative", "signed", "flip", "hdr-flip"};
static const es_error_map maps[MAPS] = {ES_ERROR_MAP_ABSOLUTE, ES_ERROR_MAP_RELATIVE, ES_ERROR_MAP_SIGNED, ES_ERROR_MAP_FLIP, ES_ERROR_MAP_HDR_FLIP};

typedef struct comparison {
    const char *a, *b;       /* files, or patterns when there are frames */
    const char *image, *diff;
    bool sequence, each, display_referred;
    uint32_t first, end;
    uint32_t threads;
    int map;                 /* index */
    double scale;            /* of the maps of all frames; 0: chosen by the first that differs */
    bool scale_told;
    double limits[METRICS];  /* NaN: none */
    es_flicker* flicker;
    double sums[METRICS];    /* over the frames; of MAX the largest */
    demo_text lines;         /* what will be printed when all has gone well */
} comparison;

/* ---- options ----------------------------------------------------------------------------------------------------- */

enum option_id { DIFF, MAP, SCALE, IMAGE, FRAMES, THREADS, EACH, DISPLAY_REFERRED, OPTIONS };
static const char* const option_names[OPTIONS] = {"--diff", "--map", "--scale", "--image", "--frames", "--threads", "--each", "--display-referred"};

static int refuse_option(const char* argument)
{
    char limits[METRICS][24];
    const char* known[OPTIONS + METRICS];
    for (int i = 0; i < OPTIONS; i++) known[i] = option_names[i];
    for (int i = 0; i < METRICS; i++) {
        snprintf(limits[i], sizeof limits[i], "--max-%s", metric_names[i]);
        known[OPTIONS + i] = limits[i];
    }
    const char* nearest = demo_nearest(argument, known, OPTIONS + METRICS);
    return demo_refuse("compare: unknown option %s; %s%s%s", argument, nearest ? "did you mean " : "`earthshine help` lists all", nearest ? nearest : "", nearest ? "?" : "");
}

static int apply_limit(const char* argument, const char* value, comparison* what)
{
    int metric = 0;
    while (metric < METRICS && strcmp(argument + strlen("--max-"), metric_names[metric]) != 0) metric++;
    if (metric == METRICS) return refuse_option(argument);
    if (!value) return demo_refuse("%s: a value must follow", argument);
    if (!demo_parse_double(value, 0, 1e30, &what->limits[metric])) return demo_refuse("%s %s: a number from 0 is expected", argument, value);
    return DEMO_OK;
}

static int apply_option(enum option_id option, const char* value, comparison* what)
{
    switch (option) {
    case DIFF:
        what->diff = value;
        return DEMO_OK;
    case MAP:
        for (what->map = 0; what->map < MAPS; what->map++)
            if (!strcmp(value, map_names[what->map])) return DEMO_OK;
        return demo_refuse("--map %s: absolute, relative, signed, flip or hdr-flip is expected", value);
    case SCALE:
        if (demo_parse_double(value, 1e-30, 1e30, &what->scale)) return DEMO_OK;
        return demo_refuse("--scale %s: a number above 0 is expected, the error that is shown brightest", value);
    case IMAGE:
        what->image = value;
        return value[0] ? DEMO_OK : demo_refuse("--image: the name is empty");
    case FRAMES:
        what->sequence = true;
        return demo_parse_frames(value, &what->first, &what->end);
    case THREADS:
        if (demo_parse_uint(value, 1, 64, &what->threads)) return DEMO_OK;
        return demo_refuse("--threads %s: a number from 1 to 64 is expected", value);
    case EACH:
        what->each = true;
        return DEMO_OK;
    case DISPLAY_REFERRED:
        what->display_referred = true;
        return DEMO_OK;
    case OPTIONS:
        break;
    }
    return DEMO_BAD_INPUT;
}

/* Before any work: names make sense, and what is to be read and written can be. */
static int check(const comparison* what)
{
    char path[DEMO_PATH_SIZE];
    uint32_t frames = what->end - what->first;
    const char* names[2] = {what->a, what->b};
    if (!what->b) return demo_refuse("compare: two images are expected: the one in question, then the reference");
    if (!isnan(what->limits[FLICKER]) && frames < 2) return demo_refuse("--max-flicker: needs --frames A:B with two frames or more");
    if (what->diff && demo_check_pattern("--diff", what->diff, frames) != DEMO_OK) return DEMO_BAD_INPUT;
    if (what->diff) {
        demo_expand_pattern(what->diff, what->first, path);
        if (demo_check_writable(path) != DEMO_OK) return DEMO_BAD_INPUT;
    }
    if (!what->sequence) return DEMO_OK;
    unsigned numbers = 0;
    for (int i = 0; i < 2; i++)
        if (demo_check_numbers("compare", names[i], &numbers) != DEMO_OK) return DEMO_BAD_INPUT;
    if (!numbers) return demo_refuse("--frames: neither %s nor %s holds a frame's number; put %%04d into the name", what->a, what->b);
    for (uint32_t frame = what->first; frame < what->end; frame++)
        for (int i = 0; i < 2; i++) {
            demo_expand_pattern(names[i], frame, path);
            if (access(path, R_OK) != 0) return demo_refuse("compare: frame %u of %s: there is no file %s", frame, names[i], path);
        }
    return DEMO_OK;
}

static int parse(int count, char** arguments, comparison* what)
{
    *what = (comparison){.end = 1};
    for (int i = 0; i < METRICS; i++) what->limits[i] = NAN;
    for (int i = 0; i < count; i++) {
        const char* argument = arguments[i];
        if (strncmp(argument, "--", 2) != 0) {
            if (what->b) return demo_refuse("compare: two images are expected, %s is a third", argument);
            *(what->a ? &what->b : &what->a) = argument;
            continue;
        }
        if (!strncmp(argument, "--max-", 6)) {
            if (apply_limit(argument, i + 1 < count ? arguments[i + 1] : NULL, what) != DEMO_OK) return DEMO_BAD_INPUT;
            i++;
            continue;
        }
        int option = 0;
        while (option < OPTIONS && strcmp(argument, option_names[option]) != 0) option++;
        if (option == OPTIONS) return refuse_option(argument);
        bool takes_value = option != EACH && option != DISPLAY_REFERRED;
        if (takes_value && ++i == count) return demo_refuse("%s: a value must follow", argument);
        if (apply_option((enum option_id)option, takes_value ? arguments[i] : NULL, what) != DEMO_OK) return DEMO_BAD_INPUT;
    }
    return check(what);
}

/* ---- one frame --------------------------------------------------------------------------------------------------- */

/* By content, as es_image_load tells: a PNG holds what a display shows. */
static bool is_png(const char* path)
{
    static const unsigned char signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    unsigned char bytes[8] = {0};
    FILE* file = fopen(path, "rb");
    size_t got = file ? fread(bytes, 1, sizeof bytes, file) : 0;
    if (file) fclose(file);
    return got == sizeof bytes && !memcmp(bytes, signature, sizeof signature);
}

static void name_of_frame(const comparison* what, const char* name, uint32_t frame, char path[DEMO_PATH_SIZE])
{
    if (what->sequence) demo_expand_pattern(name, frame, path);
    else snprintf(path, DEMO_PATH_SIZE, "%s", name);
}

static int load(es_context* context, const comparison* what, const char* path, es_image* image)
{
    if (es_image_load(context, path, image) != ES_OK) return demo_refuse_context(context);
    return demo_select_layer(context, image, path, what->image);
}

/* By the map's own mean: single outliers would leave a picture scaled to the largest error black. 0 when there is no error. */
static double choose_scale(const es_image* map, es_error_map kind)
{
    if (kind == ES_ERROR_MAP_FLIP || kind == ES_ERROR_MAP_HDR_FLIP) return 1;
    double sum = 0;
    size_t finite = 0, pixels = (size_t)map->width * map->height;
    for (size_t i = 0; i < pixels; i++)
        if (isfinite(map->pixels[i])) {
            sum += fabs((double)map->pixels[i]);
            finite++;
        }
    return sum > 0 ? fmax(4 * sum / (double)finite, 1e-30) : 0;
}

static int write_map(es_context* context, comparison* what, const es_image* a, const es_image* b, const es_error_desc* desc, uint32_t frame)
{
    es_image map, picture = {0};
    char path[DEMO_PATH_SIZE];
    demo_expand_pattern(what->diff, frame, path);
    if (es_image_error_map(context, a, b, maps[what->map], desc, &map) != ES_OK) return demo_refuse_context(context);
    bool is_signed = maps[what->map] == ES_ERROR_MAP_SIGNED, told = what->scale_told;
    if (what->scale == 0) what->scale = choose_scale(&map, maps[what->map]);
    double scale = what->scale > 0 ? what->scale : 1;
    es_image_save_desc save = {.already_srgb = true};
    int code = es_image_false_colour(context, &map, (float)scale, is_signed, &picture) == ES_OK && es_image_save(context, &picture, path, &save) == ES_OK
                   ? DEMO_OK
                   : demo_refuse_context(context);
    es_image_destroy(context, &picture);
    es_image_destroy(context, &map);
    what->scale_told = told || what->scale > 0 || frame + 1 == what->end;
    if (code == DEMO_OK && what->scale_told && !told) {
        if (is_signed) fprintf(stderr, "%s: black is no difference, light blue %.6g less and more, yellow %.6g more and more\n", path, scale, scale);
        else fprintf(stderr, "%s: black is no difference, pale yellow %.6g and more\n", path, scale);
    }
    return code;
}

static int measure(es_context* context, comparison* what, const es_image* a, const es_image* b, bool display_referred, uint32_t frame)
{
    es_error_desc desc = {.flip = true, .display_referred = display_referred};
    es_image_error error;
    if (es_image_compare(context, a, b, &desc, &error) != ES_OK) return demo_refuse_context(context);
    if (what->flicker && es_flicker_add(what->flicker, a, b) != ES_OK) return demo_refuse_context(context);
    double values[METRICS] = {error.rmse, error.relrmse, error.relmse, error.rell1, error.flip, error.hdr_flip, error.max, NAN};
    for (int i = 0; i < METRICS; i++) {
        if (i == MAX) what->sums[i] = fmax(what->sums[i], values[i]);
        else what->sums[i] += values[i];
        if (what->each && i != FLICKER) demo_text_add(&what->lines, "frame %u %s %.9g\n", frame, metric_names[i], values[i]);
    }
    return what->diff ? write_map(context, what, a, b, &desc, frame) : DEMO_OK;
}

static int compare_frame(es_context* context, comparison* what, uint32_t frame)
{
    char a_path[DEMO_PATH_SIZE], b_path[DEMO_PATH_SIZE];
    es_image a = {0}, b = {0};
    name_of_frame(what, what->a, frame, a_path);
    name_of_frame(what, what->b, frame, b_path);
    int code = load(context, what, a_path, &a);
    if (code == DEMO_OK) code = load(context, what, b_path, &b);
    if (code == DEMO_OK && (a.width != b.width || a.height != b.height))
        code = demo_refuse("compare: %s is %ux%u, %s is %ux%u; equal sizes are expected", a_path, a.width, a.height, b_path, b.width, b.height);
    if (code == DEMO_OK) code = measure(context, what, &a, &b, what->display_referred || is_png(a_path) || is_png(b_path), frame);
    es_image_destroy(context, &a);
    es_image_destroy(context, &b);
    return code;
}

/* ---- the result -------------------------------------------------------------------------------------------------- */

static int judge(comparison* what)
{
    double values[METRICS];
    int code = DEMO_OK;
    for (int i = 0; i < METRICS; i++) values[i] = i == MAX ? what->sums[i] : what->sums[i] / (what->end - what->first);
    values[FLICKER] = what->flicker ? es_flicker_result(what->flicker).flicker : NAN;
    for (int i = 0; i < METRICS; i++)
        if (!isnan(what->limits[i]) && isnan(values[i]))
            return demo_refuse("--max-%s: there is no such number here: %s", metric_names[i],
                i == HDR_FLIP ? "it is defined for colours in radiance, three channels that are not display-referred" : "it is defined for colours, three channels");
    if (what->lines.failed) return demo_refuse("out of memory");
    if (what->lines.bytes) fputs(what->lines.bytes, stdout);
    for (int i = 0; i < METRICS; i++)
        if (i != FLICKER || what->flicker) printf("%s %.9g\n", metric_names[i], values[i]);
    for (int i = 0; i < METRICS; i++)
        if (!isnan(what->limits[i]) && !(values[i] <= what->limits[i])) {
            fprintf(stderr, "earthshine: %s is %.6g, above the limit of %.6g\n", metric_names[i], values[i], what->limits[i]);
            code = DEMO_EXCEEDED;
        }
    return fflush(stdout) == 0 ? code : demo_refuse("standard output cannot be written");
}

int demo_compare(int count, char** arguments)
{
    comparison what;
    if (parse(count, arguments, &what) != DEMO_OK) return DEMO_BAD_INPUT;
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = what.threads;
    es_context* context = NULL;
    es_result result = es_context_create(&desc, &context);
    if (result != ES_OK) return demo_refuse("%s", es_result_text(result));
    int code = DEMO_OK;
    if (what.end - what.first > 1 && es_flicker_create(context, &what.flicker) != ES_OK) code = demo_refuse_context(context);
    for (uint32_t frame = what.first; frame < what.end && code == DEMO_OK; frame++) code = compare_frame(context, &what, frame);
    if (code == DEMO_OK) code = judge(&what);
    demo_text_free(&what.lines);
    es_flicker_destroy(what.flicker);
    es_context_destroy(context);
    return code;
}
