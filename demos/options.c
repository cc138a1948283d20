/* Arguments of `render`, `play` and `reference`. Every refusal is one line that says which argument, why, and what would do. */
#include "demo.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

bool demo_parse_uint(const char* text, uint32_t minimum, uint32_t maximum, uint32_t* value)
{
    if (!text[0] || strlen(text) > 10 || strspn(text, "0123456789") != strlen(text)) return false;
    unsigned long long number = strtoull(text, NULL, 10);
    if (number < minimum || number > maximum) return false;
    *value = (uint32_t)number;
    return true;
}

bool demo_parse_double(const char* text, double minimum, double maximum, double* value)
{
    char* end;
    errno = 0;
    double number = strtod(text, &end);
    if (end == text || *end || errno == ERANGE || !isfinite(number) || number < minimum || number > maximum) return false;
    *value = number;
    return true;
}

static const char* const method_names[] = {"none", "ism", "classic", "vpl-traced", "vpl-sampled", "micro", "second-order"};
enum { METHODS = sizeof method_names / sizeof method_names[0] };

const char* demo_method_name(uint32_t method) { return method < METHODS ? method_names[method] : "?"; }

int demo_parse_size(const char* text, uint32_t* out_width, uint32_t* out_height)
{
    char copy[32];
    snprintf(copy, sizeof copy, "%s", text);
    char* x = strchr(copy, 'x');
    if (strlen(text) >= sizeof copy || !x) return demo_refuse("--size %s: WIDTHxHEIGHT is expected, such as 1024x768", text);
    *x = 0;
    uint32_t width, height;
    if (!demo_parse_uint(copy, 0, UINT32_MAX, &width) || !demo_parse_uint(x + 1, 0, UINT32_MAX, &height))
        return demo_refuse("--size %s: WIDTHxHEIGHT is expected, such as 1024x768", text);
    if (width < 1 || height < 1 || width > ES_RASTER_MAX_SIZE || height > ES_RASTER_MAX_SIZE)
        return demo_refuse("--size %s: from 1x1 to %dx%d is accepted", text, ES_RASTER_MAX_SIZE, ES_RASTER_MAX_SIZE);
    *out_width = width;
    *out_height = height;
    return DEMO_OK;
}

int demo_parse_frames(const char* text, uint32_t* first, uint32_t* end)
{
    char copy[32];
    snprintf(copy, sizeof copy, "%s", text);
    char* colon = strchr(copy, ':');
    if (colon) *colon = 0;
    if (strlen(text) >= sizeof copy || !colon || !demo_parse_uint(copy, 0, DEMO_MAX_FRAMES, first) || !demo_parse_uint(colon + 1, 0, DEMO_MAX_FRAMES, end))
        return demo_refuse("--frames %s: A:B is expected, frames A to B - 1, at most %d", text, DEMO_MAX_FRAMES);
    if (*first >= *end) return demo_refuse("--frames %s: holds no frame; A:B is A to B - 1", text);
    return DEMO_OK;
}

static int parse_isa(const char* text, demo_options* options)
{
    es_isa isa;
    if (!es_isa_from_name(text, &isa)) return demo_refuse("--isa %s: scalar, sse4, avx2, avx512 or neon is expected", text);
    uint32_t available = es_isa_available_mask();
    if (!(available >> isa & 1)) {
        char names[128] = "";
        for (int i = 0; i < ES_ISA_COUNT; i++)
            if (available >> i & 1) snprintf(names + strlen(names), sizeof names - strlen(names), " %s", es_isa_name((es_isa)i));
        return demo_refuse("--isa %s: not available here; there is%s", text, names);
    }
    options->isa_mask = 1u << isa;
    return DEMO_OK;
}

static int parse_method(const char* text, demo_options* options)
{
    for (int i = 0; i < METHODS; i++)
        if (!strcmp(text, method_names[i])) {
            options->method = i;
            return DEMO_OK;
        }
    return demo_refuse("--gi %s: none, ism, classic, vpl-traced, vpl-sampled, micro or second-order is expected", text);
}

enum option_id { OUT, SIZE, FRAMES, FPS, THREADS, ISA, NO_SKIP, GI, SET, IMAGE, HASH, STATS, RECORD, REPLAY, ENVIRONMENT, ROTATION, INTENSITY, EDITS, SPP, SECONDS, ERROR, BOUNCES, RESUME, OPTION_COUNT };
static const char* const option_names[OPTION_COUNT] = {"--out", "--size", "--frames", "--fps", "--threads", "--isa", "--no-skip", "--gi", "--set",
    "--image", "--hash", "--stats", "--record", "--replay", "--environment", "--environment-rotation", "--environment-intensity", "--edits", "--spp", "--seconds", "--error", "--bounces", "--resume"};

static bool belongs_to(enum option_id id, bool reference)
{
    if (id == NO_SKIP || id == GI || id == RECORD || id == REPLAY) return !reference;
    return id < SPP || reference;
}

static int apply_option(enum option_id id, const char* value, demo_options* options)
{
    switch (id) {
    case OUT:
        options->out = value;
        return DEMO_OK;
    case SIZE:
        options->size_given = true;
        return demo_parse_size(value, &options->width, &options->height);
    case FRAMES:
        options->frames_given = true;
        return demo_parse_frames(value, &options->first, &options->end);
    case FPS:
        options->fps_given = true;
        if (demo_parse_double(value, 0.1, 10000, &options->fps)) return DEMO_OK;
        return demo_refuse("--fps %s: a number from 0.1 to 10000 is expected", value);
    case THREADS:
        if (demo_parse_uint(value, 1, 64, &options->threads)) return DEMO_OK;
        return demo_refuse("--threads %s: a number from 1 to 64 is expected", value);
    case ISA:
        return parse_isa(value, options);
    case NO_SKIP:
        options->no_skip = true;
        return DEMO_OK;
    case GI:
        return parse_method(value, options);
    case SET:
        if (!strchr(value, '='))
            return demo_refuse("--set %s: key=value is expected; `earthshine settings` lists the keys", value);
        if (options->set_count == DEMO_MAX_SETS) return demo_refuse("--set %s: at most %d settings", value, DEMO_MAX_SETS);
        options->sets[options->set_count++] = value;
        return DEMO_OK;
    case IMAGE:
        if (!options->reference && demo_find_image(value) < 0) return DEMO_BAD_INPUT;
        if (options->image_count == DEMO_MAX_IMAGES) return demo_refuse("--image %s: at most %d images", value, DEMO_MAX_IMAGES);
        options->images[options->image_count++] = value;
        return DEMO_OK;
    case HASH:
        options->hash = true;
        return DEMO_OK;
    case STATS:
        options->stats = value;
        return DEMO_OK;
    case RECORD:
        options->record = value;
        return DEMO_OK;
    case REPLAY:
        options->replay = value;
        return DEMO_OK;
    case ENVIRONMENT:
        options->environment = value;
        return DEMO_OK;
    case ROTATION:
        if (demo_parse_double(value, -1000, 1000, &options->environment_rotation)) return DEMO_OK;
        return demo_refuse("--environment-rotation %s: radians from -1000 to 1000 are expected", value);
    case INTENSITY:
        if (demo_parse_double(value, 0, 1e6, &options->environment_intensity)) return DEMO_OK;
        return demo_refuse("--environment-intensity %s: a factor from 0 to 1e6 is expected", value);
    case EDITS:
        options->edits = value;
        return DEMO_OK;
    case SPP:
        options->spp = value;
        return DEMO_OK;
    case SECONDS:
        options->seconds = value;
        return DEMO_OK;
    case ERROR:
        options->error = value;
        return DEMO_OK;
    case BOUNCES:
        options->bounces = value;
        return DEMO_OK;
    case RESUME:
        options->resume = value;
        return DEMO_OK;
    case OPTION_COUNT:
        break;
    }
    return DEMO_BAD_INPUT;
}

int demo_parse_options(const char* command, int count, char** arguments, demo_options* options)
{
    *options = (demo_options){.end = 1, .fps = 30, .method = -1, .environment_intensity = 1, .reference = !strcmp(command, "reference")};
    bool only_names = false;
    for (int i = 0; i < count; i++) {
        const char* argument = arguments[i];
        if (only_names || argument[0] != '-' || !argument[1]) {
            if (!argument[0]) return demo_refuse("%s: the scene's name is empty", command);
            if (options->scene)
                return demo_refuse("%s: one scene or file is expected, there are two: %s, %s", command, options->scene, argument);
            options->scene = argument;
            continue;
        }
        if (!strcmp(argument, "--")) {
            only_names = true;
            continue;
        }
        const char* equals = strchr(argument, '=');
        size_t length = equals ? (size_t)(equals - argument) : strlen(argument);
        int id = 0;
        while (id < OPTION_COUNT && (strlen(option_names[id]) != length || strncmp(option_names[id], argument, length) != 0))
            id++;
        if (id == OPTION_COUNT) {
            const char* nearest = demo_nearest(argument, option_names, OPTION_COUNT);
            return demo_refuse("%s: unknown option %s; %s%s%s", command, argument,
                nearest ? "did you mean " : "`earthshine help` lists all", nearest ? nearest : "", nearest ? "?" : "");
        }
        if (!belongs_to((enum option_id)id, options->reference))
            return demo_refuse("%s: %s is an option of %s", command, option_names[id], options->reference ? "render and play" : "reference");
        bool takes_value = id != NO_SKIP && id != HASH;
        if (!takes_value && equals) return demo_refuse("%s: takes no value", option_names[id]);
        const char* value = equals ? equals + 1 : NULL;
        if (takes_value && !value) {
            if (++i == count) return demo_refuse("%s: a value must follow", option_names[id]);
            value = arguments[i];
        }
        if (apply_option((enum option_id)id, value, options) != DEMO_OK) return DEMO_BAD_INPUT;
    }
    if (options->fps_given && options->replay) return demo_refuse("%s: --fps and --replay exclude each other; a replay's steps last as long as the recorded ones", command);
    if (!options->environment && (options->environment_rotation != 0 || options->environment_intensity != 1))
        return demo_refuse("%s: --environment-rotation and --environment-intensity need --environment FILE", command);
    if (options->record && options->replay) return demo_refuse("%s: --record and --replay exclude each other", command);
    return DEMO_OK;
}
