/* What the files of the earthshine program share: options, messages, output names, listings. */
#ifndef EARTHSHINE_DEMO_H
#define EARTHSHINE_DEMO_H

#include <earthshine/gi.h>
#include <stdio.h>

/* Exit codes of every command. */
enum { DEMO_OK = 0, DEMO_EXCEEDED = 1, DEMO_BAD_INPUT = 2 };

/* ---- messages (messages.c): one line on stderr, results alone go to stdout --------------------------------------- */

/* Prints "earthshine: …" and returns DEMO_BAD_INPUT. */
int demo_refuse(const char* format, ...) ES_PRINTF(1, 2);
/* The same with the context's last message. */
int demo_refuse_context(const es_context* context);
/* Warnings to stderr; errors are left to demo_refuse_context, which knows that the command ends. */
es_logger demo_logger(void);
/* The candidate with the least edit distance to `name`, NULL when none is within a third of its length. */
const char* demo_nearest(const char* name, const char* const* candidates, size_t count);

/* ---- options (options.c) ----------------------------------------------------------------------------------------- */

enum { DEMO_MAX_SETS = 64, DEMO_MAX_IMAGES = 32, DEMO_MAX_FRAMES = 1000000 };

typedef struct demo_options {
    const char* scene; /* built-in name or file; NULL when not given */
    const char* out;   /* pattern; NULL */
    const char* images[DEMO_MAX_IMAGES];
    size_t image_count;
    uint32_t width, height;
    bool size_given, frames_given, fps_given;
    uint32_t first, end; /* frames [first, end) */
    double fps;
    uint32_t threads;  /* 0: all */
    uint32_t isa_mask; /* 0: best */
    bool no_skip, hash;
    int method;                      /* es_gi_method; -1: the setting's default */
    const char* sets[DEMO_MAX_SETS]; /* key=value */
    size_t set_count;
    const char* stats;
    const char *record, *replay; /* files */
    const char* environment;     /* file; NULL */
    double environment_rotation, environment_intensity;
    const char* edits;               /* file; NULL: those the scene has */
    const char* recorded_settings; /* of the file that is replayed: key=value between blanks, in place of the scene's own; NULL */
    bool reference; /* the command is `reference`; the texts below are values of its settings, NULL when not given */
    const char *spp, *seconds, *error, *bounces;
    const char* resume; /* file */
} demo_options;

/* Parses what follows the command's name. DEMO_OK, or DEMO_BAD_INPUT after one line on stderr. */
int demo_parse_options(const char* command, int count, char** arguments, demo_options* options);
/* Whole-string numbers within a range; false otherwise. */
bool demo_parse_uint(const char* text, uint32_t minimum, uint32_t maximum, uint32_t* value);
bool demo_parse_double(const char* text, double minimum, double maximum, double* value);
/* "WIDTHxHEIGHT", and below "A:B", B > A; DEMO_BAD_INPUT after one line on stderr. */
int demo_parse_size(const char* text, uint32_t* width, uint32_t* height);
int demo_parse_frames(const char* text, uint32_t* first, uint32_t* end);
const char* demo_method_name(uint32_t method);

/* ---- text that grows (text.c) ------------------------------------------------------------------------------------ */

typedef struct demo_text {
    char* bytes;
    size_t size, capacity;
    bool failed;
} demo_text;
void demo_text_add(demo_text* text, const char* format, ...) ES_PRINTF(2, 3);
/* With the quotation marks and JSON's escapes. */
void demo_text_add_json_string(demo_text* text, const char* string);
void demo_text_free(demo_text* text);

/* ---- settings (settings.c) --------------------------------------------------------------------------------------- */

/* The scene's own settings, then --size, --gi, --no-skip and every --set. One of `renderer` and `reference` is NULL: its settings are refused. */
int demo_apply_settings(es_context* context, const demo_options* options, es_world_settings* world, es_renderer_settings* renderer,
    es_reference_settings* reference);
/* What es_scene_settings recommends, over what the structs hold; `renderer` or `reference` is NULL, and what is not theirs is left out. */
int demo_apply_scene_settings(es_context* context, const char* scene, es_world_settings* world, es_renderer_settings* renderer,
    es_reference_settings* reference);
/* Adds " key=value" for each setting that is not its default, but for the picture's size. */
void demo_text_add_settings(demo_text* text, const es_world_settings* world, const es_renderer_settings* renderer);
int demo_settings(int count, char** arguments);
int demo_scenes(int count, char** arguments);
int demo_images(int count, char** arguments);
/* Index of an image's name; -1 after a line that suggests the nearest. */
int demo_find_image(const char* name);

/* ---- a world and its renderer, opened as the options say (session.c) --------------------------------------------- */

typedef struct demo_session {
    es_context* context;
    es_world* world;
    es_renderer* renderer;
    es_renderer_settings settings;
    es_recording *recording, *replay; /* being made; being done again */
    char difference[160];             /* how the replay differs from the recording */
} demo_session;

int demo_session_open(const demo_options* options, demo_session* session);
/* es_world_open, and what --environment and, of the scene that was asked for, --edits say; the message is the context's. */
es_result demo_open_world(es_context* context, const demo_options* options, const char* scene, const es_world_settings* settings, es_world** world);
/* The context alone. */
int demo_session_open_context(const demo_options* options, demo_session* session);
void demo_session_close(demo_session* session);
/* Brings the world to frame `frame`, which lies at frame / fps seconds: the first call begins at 0. */
int demo_session_step(demo_session* session, uint32_t frame, double fps);

/* ---- recordings (recording.c) ------------------------------------------------------------------------------------- */

/* From the next step on. `window`: the world has the player's nodes. */
int demo_record_begin(demo_session* session, const char* scene, bool window);
/* Writes what was recorded; nothing when nothing was. */
int demo_record_end(demo_session* session, const char* path);
/* Loads options->replay; scene and recorded settings become the options'. */
int demo_replay_load(demo_session* session, demo_options* options);
/* After the world is opened: adds what the recorded one had, and goes to where the recording begins. */
int demo_replay_begin(demo_session* session);
bool demo_recorded_in_window(const es_recording* recording);
/* DEMO_EXCEEDED after a line that says where it differs. */
int demo_replay_step(demo_session* session, uint32_t step);

/* ---- output (output.c) ------------------------------------------------------------------------------------------- */

enum { DEMO_PATH_SIZE = 4096 };

/* The name of an image's file with at most one frame number, %d or %0Nd; %% stands for a percent sign. `option` begins a refusal. */
int demo_check_pattern(const char* option, const char* pattern, uint32_t frames);
/* The number alone, of a file that is read too: adds to `numbers` how many there are. */
int demo_check_numbers(const char* option, const char* pattern, unsigned* numbers);
/* The name of one frame's file; the pattern was checked. */
void demo_expand_pattern(const char* pattern, uint32_t frame, char path[DEMO_PATH_SIZE]);
/* Tries to make a file where `path` will be, and removes it: refusals come before the work. */
int demo_check_writable(const char* path);
bool demo_has_image_ending(const char* path);
/* How an image of the renderer is written: all are linear, and EXR files keep all their bits. */
es_image_save_desc demo_save_desc(void);
/* Writes text to a temporary name and renames it: never a half-written file. */
int demo_write_text(const char* path, const char* text, size_t size);

/* ---- images in a file (image_layer.c) ---------------------------------------------------------------------------- */

/* Keeps the channels of the image `name` of a file with several ("name.R" …; "radiance" is also a reference's main image), or
 * without a name those of the main image where there is one. An image alone in its file is kept as it is. Refuses a name that the
 * file does not have, and says which it has. */
int demo_select_layer(es_context* context, es_image* image, const char* path, const char* name);

/* ---- machine (machine.c) ----------------------------------------------------------------------------------------- */

/* {"processor":…,"isa":…,"threads":…,"compiler":…,"commit":…,"flags":…,"version":…} */
void demo_text_add_machine(demo_text* text, const es_context* context);
/* The same in a line for people, with the time of day: a page that is kept says when it was made. */
void demo_text_add_machine_line(demo_text* text, const es_context* context);
/* "2026-11-25 16:02 UTC" */
void demo_date(char date[32]);
void demo_processor_name(char* name, size_t size);
double demo_seconds(void);

/* ---- commands ---------------------------------------------------------------------------------------------------- */
int demo_render(int count, char** arguments);
int demo_play(int count, char** arguments);
int demo_reference(int count, char** arguments);
int demo_compare(int count, char** arguments);
int demo_bench(int count, char** arguments);
int demo_soak(int count, char** arguments);

/* Renders the options' frames without a window: files, hashes, statistics. */
int demo_render_frames(const demo_options* options, bool show_progress);

#endif
