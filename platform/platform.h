/* Earthshine, floor 0: the machine.
 *
 * Context (memory, log, threads, instruction set), small vectors, float images and their files, a window.
 * Everything above reaches memory, threads, files and the display through this header alone.
 *
 * Threads: a context and what is created from it may be used by one thread at a time; two contexts never meet.
 * Errors: functions that can fail return es_result; es_context_message() says what, where, and what would be accepted.
 */
#ifndef EARTHSHINE_PLATFORM_H
#define EARTHSHINE_PLATFORM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define ES_API __attribute__((visibility("default")))
#define ES_PRINTF(format_index, first) __attribute__((format(printf, format_index, first)))
#else
#define ES_API
#define ES_PRINTF(format_index, first)
#endif

#define ES_VERSION_MAJOR 0
#define ES_VERSION_MINOR 1
#define ES_VERSION_PATCH 0

/* ---- results: each message of the library has one entry here; tests ask for them by name -------------------- */

#define ES_RESULTS(X)                                                                                            \
    X(OK, "success")                                                                                             \
    X(OUT_OF_MEMORY, "the allocator returned no memory")                                                         \
    X(MEMORY_CAP, "the context's memory cap would be exceeded")                                                  \
    X(INVALID_ARGUMENT, "an argument is outside its stated range")                                               \
    X(STALE_HANDLE, "a handle names nothing that exists")                                                        \
    X(WRONG_STATE, "the call does not fit the object's state")                                                   \
    X(FILE_NOT_FOUND, "the file does not exist or cannot be opened")                                             \
    X(FILE_READ, "reading the file failed")                                                                      \
    X(FILE_WRITE, "writing the file failed")                                                                     \
    X(FILE_EMPTY, "the file is empty")                                                                           \
    X(FILE_TYPE, "the file is not of a known type")                                                              \
    X(FILE_DAMAGED, "the file contradicts its format")                                                           \
    X(FILE_UNSUPPORTED, "the file uses a feature that is not supported")                                         \
    X(IMAGE_SIZE, "an image size is outside the supported range")                                                \
    X(SETTING_UNKNOWN, "no setting has this name")                                                               \
    X(SETTING_VALUE, "a setting's value is outside its range")                                                   \
    X(SCENE_UNKNOWN, "no built-in scene has this name")                                                          \
    X(IMAGE_UNKNOWN, "no image has this name")                                                                   \
    X(NO_DISPLAY, "no window can be opened")                                                                     \
    X(NOT_BUILT, "this build lacks the optional library for it")                                                 \
    X(ISA_UNAVAILABLE, "the instruction set is not available here")                                              \
    X(ASSET_WARNING, "an asset was loaded with something left out")                                              \
    X(NOTE, "information")

typedef enum es_result {
#define ES_RESULT_ENUM(name, text) ES_##name,
    ES_RESULTS(ES_RESULT_ENUM)
#undef ES_RESULT_ENUM
        ES_RESULT_COUNT
} es_result;

/* The enumerator's name without its prefix, e.g. "FILE_DAMAGED"; "?" when out of range. Static storage. */
ES_API const char* es_result_name(es_result result);
ES_API const char* es_result_text(es_result result);

/* ---- context ------------------------------------------------------------------------------------------------ */

typedef enum es_log_level { ES_LOG_ERROR, ES_LOG_WARNING, ES_LOG_INFO } es_log_level;

/* Allocate must return memory aligned to `alignment` (a power of two, at most 64) or NULL. May be called from any of
 * the context's threads. `size` at release is the size that was asked for. */
typedef struct es_allocator {
    void* (*allocate)(void* user, size_t size, size_t alignment);
    void (*release)(void* user, void* pointer, size_t size);
    void* user;
} es_allocator;

/* `message` is one line without a line feed, valid during the call. May be called from any of the context's threads. */
typedef struct es_logger {
    void (*log)(void* user, es_log_level level, es_result item, const char* message);
    void* user;
} es_logger;

/* Bring your own job system: run task(data, i) once for every i in [0, count), in any order, on any threads, and
 * return when all are done. `count` is at most es_context_desc.threads. Running them one after another is allowed. */
typedef struct es_task_callbacks {
    void (*run)(void* user, uint32_t count, void (*task)(void* data, uint32_t index), void* data);
    void* user;
} es_task_callbacks;

/* Misuse of the API (a stale handle, a null pointer) calls this after logging; NULL continues with an error result. */
typedef struct es_assert_hook {
    void (*failed)(void* user, es_result item, const char* message);
    void* user;
} es_assert_hook;

typedef enum es_isa { ES_ISA_SCALAR, ES_ISA_SSE4, ES_ISA_AVX2, ES_ISA_AVX512, ES_ISA_NEON, ES_ISA_COUNT } es_isa;

typedef struct es_context_desc {
    es_allocator allocator;      /* zero: malloc family */
    es_logger logger;            /* zero: warnings and errors to stderr */
    es_task_callbacks tasks;     /* zero: the built-in pool */
    es_assert_hook assert_hook;  /* zero: none */
    uint32_t threads;            /* 1 … 64, the caller's included; 0: the processors this process may use; 1 creates no thread */
    uint32_t isa_mask;           /* bit per es_isa that may be used; 0: all that were built and the processor has */
    size_t memory_cap;           /* bytes through the allocator at any time; 0: no cap */
} es_context_desc;

typedef struct es_context es_context;

ES_API es_context_desc es_default_context_desc(void);
/* desc NULL: all defaults. On failure *context is NULL. ISA_UNAVAILABLE when the mask leaves none. */
ES_API es_result es_context_create(const es_context_desc* desc, es_context** context);
/* Everything created from the context must have been destroyed; what was not is reported through the logger. */
ES_API void es_context_destroy(es_context* context);
/* The desc with every zero replaced by the value in use. */
ES_API es_context_desc es_context_resolved_desc(const es_context* context);
/* Last failure on this context, one line, never NULL; "" before the first. Valid until the next failure. */
ES_API const char* es_context_message(const es_context* context);
ES_API es_result es_context_last_result(const es_context* context);
/* Bytes allocated through the context now, and the most there ever were. What a library allocates by itself to import a glTF file counts
 * too, by an upper estimate, as long as the import lasts. */
ES_API size_t es_context_bytes(const es_context* context);
ES_API size_t es_context_peak_bytes(const es_context* context);
ES_API es_isa es_context_isa(const es_context* context);
ES_API const char* es_isa_name(es_isa isa);                    /* "scalar" "sse4" "avx2" "avx512" "neon" */
ES_API bool es_isa_from_name(const char* name, es_isa* isa);   /* false: no such name */
ES_API uint32_t es_isa_available_mask(void);                   /* built in and runnable here */

/* ---- small vectors: right-handed, y up, metres, radians; matrices column-major, column vectors ----------------- */

typedef struct es_vec2 { float x, y; } es_vec2;
typedef struct es_vec3 { float x, y, z; } es_vec3;
typedef struct es_vec4 { float x, y, z, w; } es_vec4;
typedef struct es_quat { float x, y, z, w; } es_quat;  /* unit, w real */
typedef struct es_mat4 { float m[16]; } es_mat4;       /* m[4 * column + row] */

/* ---- images ------------------------------------------------------------------------------------------------------- */

enum { ES_IMAGE_MAX_SIZE = 16384, ES_IMAGE_MAX_CHANNELS = 1024, ES_CHANNEL_NAME_SIZE = 64 };

/* Float image, row-major, top row first, channels interleaved: pixels[(y * width + x) * channels + c].
 * Colour is linear Rec.709 unless said otherwise. Owned by whoever created it; freed with es_image_destroy. */
typedef struct es_image {
    uint32_t width, height, channels;
    float* pixels;
    char (*channel_names)[ES_CHANNEL_NAME_SIZE];  /* `channels` names; "R" "G" "B" "A" for the common ones, "part.R" in multi-part files */
} es_image;

/* All pixels zero; channels named Y, YA, RGB, RGBA or C0…; sizes 1 … ES_IMAGE_MAX_SIZE. */
ES_API es_result es_image_create(es_context* context, uint32_t width, uint32_t height, uint32_t channels, es_image* image);
ES_API void es_image_destroy(es_context* context, es_image* image);  /* zeroes *image; a zero image is allowed */
/* Index of a channel by name, -1 when absent. */
ES_API int es_image_channel(const es_image* image, const char* name);
/* 64-bit hash of size, channel count and pixel bits; equal images, equal hash, on every machine. */
ES_API uint64_t es_image_hash(const es_image* image);

/* By content, not by name: OpenEXR (scan-line, tiled, multi-part; half, float, uint; luminance-chroma converted to RGB;
 * deep refused), PNG (8 and 16 bit, decoded from sRGB to linear; alpha as it is), Radiance HDR (RGBE, flat and RLE).
 * Multi-part files with equal windows give one image with prefixed names; otherwise the first flat part, and a warning. */
ES_API es_result es_image_load(es_context* context, const char* path, es_image* image);
ES_API es_result es_image_load_memory(es_context* context, const void* bytes, size_t size, const char* label, es_image* image);

typedef enum es_sample_type { ES_SAMPLE_HALF, ES_SAMPLE_FLOAT } es_sample_type;
typedef struct es_image_save_desc {
    es_sample_type sample_type;  /* EXR only; default half */
    bool already_srgb;           /* PNG: values are display values in [0, 1], do not encode again */
} es_image_save_desc;

/* By the name's ending: .exr (ZIP, channel names kept), .png (1–4 channels, 8 bit, sRGB-encoded), .hdr (3 channels).
 * Written to a temporary name beside `path` and renamed, so a failure leaves nothing behind. desc NULL: defaults. */
ES_API es_result es_image_save(es_context* context, const es_image* image, const char* path, const es_image_save_desc* desc);

/* ---- settings: typed values with a name, a range and a default, listed, read and written as text ------------------------ */

typedef enum es_setting_type { ES_SETTING_BOOL, ES_SETTING_INT, ES_SETTING_FLOAT, ES_SETTING_CHOICE } es_setting_type;

typedef struct es_setting {
    const char* name;          /* lower case, words joined by '-' , grouped by a prefix and '.' */
    es_setting_type type;
    const char* default_text;  /* as es_settings_set takes it */
    double minimum, maximum;   /* INT, FLOAT */
    const char* choices;       /* CHOICE: names separated by '|'; the value is the index */
    const char* help;          /* one line, with the unit */
    size_t offset;             /* of a bool, uint32_t, float or uint32_t in the settings struct */
} es_setting;

/* ---- window --------------------------------------------------------------------------------------------------------- */

typedef struct es_window es_window;
typedef struct es_window_desc { const char* title; uint32_t width, height; } es_window_desc;

/* Keys are ASCII upper case or one of these; they are named by their place on a US keyboard. */
enum {
    ES_KEY_BACKSPACE = 8, ES_KEY_TAB = 9, ES_KEY_ENTER = 13, ES_KEY_SPACE = 32, ES_KEY_DELETE = 127,
    ES_KEY_ESCAPE = 256, ES_KEY_LEFT, ES_KEY_RIGHT, ES_KEY_UP, ES_KEY_DOWN, ES_KEY_PAGE_UP, ES_KEY_PAGE_DOWN, ES_KEY_HOME, ES_KEY_END,
    ES_KEY_SHIFT = 270, ES_KEY_CONTROL, ES_KEY_ALT, ES_KEY_F1 = 290
};
enum { ES_WINDOW_KEYS = 512, ES_WINDOW_TEXT = 32 };

/* A poll goes no further than one key press (or repeat) or button press, so that none is lost and each is seen with what was held then;
 * `more` says that others wait. A program that is slower than the keyboard polls on until there are none. */
typedef struct es_window_input {
    bool down[ES_WINDOW_KEYS];       /* held now */
    bool pressed[ES_WINDOW_KEYS];    /* went down since the last poll */
    bool repeated[ES_WINDOW_KEYS];   /* went down since the last poll, or was repeated because it is held */
    uint32_t text[ES_WINDOW_TEXT];   /* characters typed since the last poll, Unicode, as the keyboard's layout has them */
    uint32_t text_count;             /* further ones are lost */
    float mouse_x, mouse_y;          /* pixels of the window, origin top left */
    float mouse_dx, mouse_dy;        /* since the last poll */
    float scroll;
    bool mouse_down[3], mouse_pressed[3], mouse_released[3];  /* left, right, middle */
    float press_x[3], press_y[3];    /* where the pointer was when the button went down: the poll may come late */
    bool more;                       /* further events wait for the next poll */
    bool close;                      /* the user asked to close the window */
    uint32_t width, height;          /* of the drawable */
} es_window_input;

/* NO_DISPLAY when there is none, NOT_BUILT without GLFW. Presents through X11 shared memory where it can, else OpenGL. */
ES_API es_result es_window_create(es_context* context, const es_window_desc* desc, es_window** window);
ES_API void es_window_destroy(es_window* window);
ES_API void es_window_poll(es_window* window, es_window_input* input);
/* xrgb: width × height words 0x00RRGGBB, top row first; scaled (nearest) to the window when sizes differ. */
ES_API void es_window_present(es_window* window, const uint32_t* xrgb, uint32_t width, uint32_t height);
ES_API void es_window_set_title(es_window* window, const char* title);
ES_API const char* es_window_backend(const es_window* window);  /* "x11-shm", "x11" (no shared memory with the server) or "opengl" */

#ifdef __cplusplus
}
#endif
#endif
