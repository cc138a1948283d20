/* A window that shows a picture made in memory, and its keyboard and mouse; the only file that knows GLFW.
 *
 * Two ways to the screen. On X11 with a 24-bit true-colour visual the picture goes through shared memory (MIT-SHM), or
 * through the connection when the server cannot share memory with us, and OpenGL is never touched. Everywhere else
 * (Wayland, unusual visuals) it becomes the texture of a rectangle, with the functions of OpenGL 1.1 taken from GLFW.
 *
 * GLFW's state belongs to the process and to the main thread. It is started here only if nobody has, and ended by the
 * window that started it; that window must be destroyed last, so a program with several windows starts GLFW itself.
 * Errors are asked for after the fact (glfwGetError), so a callback that the program set stays in place.
 */
#include "platform/context.h"

#if ES_WITH_GLFW

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <X11/extensions/XShm.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ipc.h>
#include <sys/shm.h>

/* Absent from a GLFW built for Wayland alone, and NULL from one that runs on Wayland. */
extern Display* glfwGetX11Display(void) __attribute__((weak));
extern Window glfwGetX11Window(GLFWwindow* window) __attribute__((weak));

typedef struct gl_functions {
    void (*Viewport)(int x, int y, int width, int height);
    void (*Enable)(unsigned what);
    void (*GenTextures)(int count, unsigned* textures);
    void (*BindTexture)(unsigned target, unsigned texture);
    void (*TexParameteri)(unsigned target, unsigned name, int value);
    void (*TexImage2D)(unsigned target, int level, int internal, int width, int height, int border, unsigned format, unsigned type,
        const void* pixels);
    void (*Begin)(unsigned mode);
    void (*End)(void);
    void (*TexCoord2f)(float s, float t);
    void (*Vertex2f)(float x, float y);
} gl_functions;

enum {
    GL_TEXTURE_2D_ = 0x0de1, GL_TEXTURE_MAG_FILTER_ = 0x2800, GL_TEXTURE_MIN_FILTER_ = 0x2801, GL_NEAREST_ = 0x2600, GL_RGB_ = 0x1907,
    GL_BGRA_ = 0x80e1, GL_UNSIGNED_INT_8_8_8_8_REV_ = 0x8367, GL_TRIANGLE_FAN_ = 6
};

typedef enum event_kind { EVENT_KEY, EVENT_CHARACTER, EVENT_BUTTON } event_kind;
typedef struct window_event {
    event_kind kind;
    int what;                 /* key, character, button */
    int action, modifiers;
    float x, y;               /* the pointer, when a button changed */
} window_event;
enum { EVENTS = 512, RING = 1024 }; /* a minute of a key held down; beyond EVENTS presses and characters are lost, releases are not */

struct es_window {
    es_context* context;
    GLFWwindow* glfw;
    bool owns_glfw;
    const char* backend;
    es_window_input input;
    float cursor_x, cursor_y; /* as of the last event taken */
    window_event events[RING]; /* a ring of what polls have not told yet */
    uint32_t first_event, event_count;
    /* X11 */
    Display* display;
    Window window;
    GC gc;
    Visual* visual;
    int depth;
    bool shared_refused;   /* the server could not attach; not tried again */
    XImage* image;         /* of the window's size */
    XShmSegmentInfo segment;
    bool image_shared;
    uint8_t* plain;        /* its pixels when they are not shared */
    size_t plain_size;
    /* OpenGL */
    gl_functions gl;
    unsigned texture;
};

/* ---- input ------------------------------------------------------------------------------------------------------------ */

static int key_of(int key)
{
    if (key >= 32 && key < 128) return key;  /* GLFW names these by their ASCII upper case */
    if (key >= GLFW_KEY_F1 && key <= GLFW_KEY_F12) return ES_KEY_F1 + (key - GLFW_KEY_F1);
    switch (key) {
    case GLFW_KEY_ESCAPE: return ES_KEY_ESCAPE;
    case GLFW_KEY_LEFT: return ES_KEY_LEFT;
    case GLFW_KEY_RIGHT: return ES_KEY_RIGHT;
    case GLFW_KEY_UP: return ES_KEY_UP;
    case GLFW_KEY_DOWN: return ES_KEY_DOWN;
    case GLFW_KEY_TAB: return ES_KEY_TAB;
    case GLFW_KEY_ENTER: case GLFW_KEY_KP_ENTER: return ES_KEY_ENTER;
    case GLFW_KEY_BACKSPACE: return ES_KEY_BACKSPACE;
    case GLFW_KEY_DELETE: return ES_KEY_DELETE;
    case GLFW_KEY_PAGE_UP: return ES_KEY_PAGE_UP;
    case GLFW_KEY_PAGE_DOWN: return ES_KEY_PAGE_DOWN;
    case GLFW_KEY_HOME: return ES_KEY_HOME;
    case GLFW_KEY_END: return ES_KEY_END;
    case GLFW_KEY_KP_ADD: return '+';
    case GLFW_KEY_KP_SUBTRACT: return '-';
    case GLFW_KEY_LEFT_ALT: case GLFW_KEY_RIGHT_ALT: return ES_KEY_ALT;
    case GLFW_KEY_LEFT_SHIFT: case GLFW_KEY_RIGHT_SHIFT: return ES_KEY_SHIFT;
    case GLFW_KEY_LEFT_CONTROL: case GLFW_KEY_RIGHT_CONTROL: return ES_KEY_CONTROL;
    default: return -1;
    }
}

/* Is the key or button down once all that is kept has been told? */
static bool will_be_down(const es_window* window, const window_event* event)
{
    for (uint32_t i = window->event_count; i-- > 0;) {
        const window_event* earlier = &window->events[(window->first_event + i) % RING];
        if (earlier->kind == event->kind && earlier->what == event->what && earlier->action != GLFW_REPEAT) return earlier->action == GLFW_PRESS;
    }
    return event->kind == EVENT_KEY ? window->input.down[event->what] : window->input.mouse_down[event->what];
}

/* No key stays down because its release was one too many: beyond EVENTS there is room for one of each press that is kept, or was told. */
static void keep_event(es_window* window, window_event event)
{
    const bool release = event.kind != EVENT_CHARACTER && event.action == GLFW_RELEASE;
    if (window->event_count >= EVENTS && !(release && will_be_down(window, &event))) return;
    if (window->event_count < RING) window->events[(window->first_event + window->event_count++) % RING] = event;
}

static void on_key(GLFWwindow* glfw, int key, int scan_code, int action, int modifiers)
{
    const int index = key_of(key);
    if (index >= 0) keep_event(glfwGetWindowUserPointer(glfw), (window_event){EVENT_KEY, index, action, modifiers, 0, 0});
}

static void on_character(GLFWwindow* glfw, unsigned character) { keep_event(glfwGetWindowUserPointer(glfw), (window_event){EVENT_CHARACTER, (int)character, 0, 0, 0, 0}); }

/* On screens with a scale (Wayland) the pointer is told in larger units than the drawable's pixels. */
static void to_pixels(const es_window* window, double* x, double* y)
{
    int width, height, pixels_wide, pixels_high;
    glfwGetWindowSize(window->glfw, &width, &height);
    glfwGetFramebufferSize(window->glfw, &pixels_wide, &pixels_high);
    if (width > 0 && height > 0 && (width != pixels_wide || height != pixels_high)) {
        *x *= (double)pixels_wide / width;
        *y *= (double)pixels_high / height;
    }
}

/* Also called while events are taken in turn, so that a button's press knows where the pointer was then. */
static void on_cursor(GLFWwindow* glfw, double x, double y)
{
    es_window* window = glfwGetWindowUserPointer(glfw);
    to_pixels(window, &x, &y);
    window->cursor_x = (float)x;
    window->cursor_y = (float)y;
}

static void on_button(GLFWwindow* glfw, int button, int action, int modifiers)
{
    es_window* window = glfwGetWindowUserPointer(glfw);
    if (button < 0 || button > 2) return;  /* GLFW counts left, right, middle too */
    keep_event(window, (window_event){EVENT_BUTTON, button, action, modifiers, window->cursor_x, window->cursor_y});
}

/* Is it a press that has a poll to itself? */
static bool is_press(const window_event* event)
{
    if (event->kind == EVENT_KEY) return event->action != GLFW_RELEASE && event->what != ES_KEY_SHIFT && event->what != ES_KEY_CONTROL && event->what != ES_KEY_ALT;
    return event->kind == EVENT_BUTTON && event->action == GLFW_PRESS;
}

static void tell_event(es_window_input* input, const window_event* event)
{
    const int what = event->what;
    switch (event->kind) {
    case EVENT_KEY:
        /* a poll may come after the modifier was let go again: what a key was pressed with counts as pressed with it */
        if (event->action == GLFW_PRESS && (event->modifiers & GLFW_MOD_CONTROL)) input->pressed[ES_KEY_CONTROL] = true;
        if (event->action == GLFW_PRESS && (event->modifiers & GLFW_MOD_SHIFT)) input->pressed[ES_KEY_SHIFT] = true;
        if (event->action != GLFW_RELEASE) input->repeated[what] = true;
        if (event->action == GLFW_REPEAT) break;
        input->down[what] = event->action == GLFW_PRESS;
        if (event->action == GLFW_PRESS) input->pressed[what] = true;
        break;
    case EVENT_CHARACTER:
        if (input->text_count < ES_WINDOW_TEXT) input->text[input->text_count++] = (uint32_t)what;
        break;
    case EVENT_BUTTON:
        input->mouse_down[what] = event->action == GLFW_PRESS;
        if (event->action == GLFW_PRESS) {
            input->mouse_pressed[what] = true;
            input->press_x[what] = event->x;
            input->press_y[what] = event->y;
        } else {
            input->mouse_released[what] = true;
        }
        break;
    }
}

static void tell_events(es_window* window)
{
    for (bool pressed = false; window->event_count;) {
        const window_event* event = &window->events[window->first_event];
        if (is_press(event) && pressed) break;
        pressed |= is_press(event);
        tell_event(&window->input, event);
        window->first_event = (window->first_event + 1) % RING;
        window->event_count--;
    }
    window->input.more = window->event_count > 0;
}

static void on_scroll(GLFWwindow* glfw, double x, double y)
{
    es_window* window = glfwGetWindowUserPointer(glfw);
    window->input.scroll += (float)y;
}

void es_window_poll(es_window* window, es_window_input* input)
{
    if (!window) {
        if (input) memset(input, 0, sizeof *input);
        return;
    }
    es_window_input* state = &window->input;
    memset(state->pressed, 0, sizeof state->pressed);
    memset(state->repeated, 0, sizeof state->repeated);
    memset(state->mouse_pressed, 0, sizeof state->mouse_pressed);
    memset(state->mouse_released, 0, sizeof state->mouse_released);
    state->text_count = 0;
    state->scroll = 0;
    glfwPollEvents();
    tell_events(window);
    double x, y;
    int width, height;
    glfwGetCursorPos(window->glfw, &x, &y);
    glfwGetFramebufferSize(window->glfw, &width, &height);
    to_pixels(window, &x, &y);
    state->mouse_dx = (float)x - state->mouse_x;
    state->mouse_dy = (float)y - state->mouse_y;
    state->mouse_x = (float)x;
    state->mouse_y = (float)y;
    state->close = glfwWindowShouldClose(window->glfw);
    state->width = width > 0 ? (uint32_t)width : 0;
    state->height = height > 0 ? (uint32_t)height : 0;
    if (input) *input = *state;
}

/* ---- X11 -------------------------------------------------------------------------------------------------------------- */

static int ignore_x_error(Display* display, XErrorEvent* event) { return 0; }

static void free_image(es_window* window)
{
    if (!window->image) return;
    if (window->image_shared) {
        XShmDetach(window->display, &window->segment);
        XSync(window->display, False);
        shmdt(window->segment.shmaddr);
    }
    window->image->data = NULL;  /* the pixels are not Xlib's */
    XDestroyImage(window->image);
    window->image = NULL;
    es_release(window->context, window->plain, window->plain_size);
    window->plain = NULL;
}

/* A shared image, or false. Whether the server attached is asked of the kernel, which counts who did: an error handler
 * could only tell through a global. The segment is marked for removal at once, so that none outlives both processes. */
static bool make_shared_image(es_window* window, uint32_t width, uint32_t height)
{
    if (window->shared_refused || !XShmQueryExtension(window->display)) return false;
    XImage* image = XShmCreateImage(window->display, window->visual, (unsigned)window->depth, ZPixmap, NULL, &window->segment, width, height);
    if (!image) return false;
    size_t size = (size_t)image->bytes_per_line * height;
    window->segment.shmid = image->bits_per_pixel == 32 ? shmget(IPC_PRIVATE, size, IPC_CREAT | 0600) : -1;
    if (window->segment.shmid < 0) {
        XDestroyImage(image);
        return false;
    }
    window->segment.shmaddr = shmat(window->segment.shmid, NULL, 0);
    bool attached = false;
    if (window->segment.shmaddr != (char*)-1) {
        window->segment.readOnly = True;
        XSync(window->display, False);
        XErrorHandler previous = XSetErrorHandler(ignore_x_error);
        struct shmid_ds status = {0};
        attached = XShmAttach(window->display, &window->segment) != 0;
        XSync(window->display, False);
        XSetErrorHandler(previous);
        attached = attached && shmctl(window->segment.shmid, IPC_STAT, &status) == 0 && status.shm_nattch >= 2;
        if (!attached) shmdt(window->segment.shmaddr);
    }
    shmctl(window->segment.shmid, IPC_RMID, NULL);
    if (!attached) {
        window->shared_refused = true;
        XDestroyImage(image);
        return false;
    }
    image->data = window->segment.shmaddr;
    window->image = image;
    window->image_shared = true;
    return true;
}

static bool make_plain_image(es_window* window, uint32_t width, uint32_t height)
{
    window->plain_size = (size_t)width * height * 4;
    window->plain = es_allocate(window->context, window->plain_size);
    if (!window->plain) return false;
    window->image = XCreateImage(window->display, window->visual, (unsigned)window->depth, ZPixmap, 0, (char*)window->plain, width, height, 32,
        (int)(width * 4));
    window->image_shared = false;
    if (window->image && window->image->bits_per_pixel == 32) return true;
    if (window->image) window->image->data = NULL, XDestroyImage(window->image);
    window->image = NULL;
    es_release(window->context, window->plain, window->plain_size);
    window->plain = NULL;
    return false;
}

/* An image of the drawable's size; what there was is kept when the size is. */
static bool fit_image(es_window* window, uint32_t width, uint32_t height)
{
    if (window->image && (uint32_t)window->image->width == width && (uint32_t)window->image->height == height) return true;
    free_image(window);
    bool made = make_shared_image(window, width, height) || make_plain_image(window, width, height);
    window->backend = window->image_shared ? "x11-shm" : "x11";
    return made;
}

static bool little_endian(void)
{
    uint32_t one = 1;
    uint8_t first;
    memcpy(&first, &one, 1);
    return first == 1;
}

/* Whether the window's pixels are 0x00RRGGBB words in our byte order, and a picture can be made for it. */
static bool begin_x11(es_window* window, uint32_t width, uint32_t height)
{
    if (!glfwGetX11Display || !glfwGetX11Window) return false;
    window->display = glfwGetX11Display();
    if (!window->display) {
        glfwGetError(NULL);
        return false;
    }
    window->window = glfwGetX11Window(window->glfw);
    XWindowAttributes attributes;
    if (!XGetWindowAttributes(window->display, window->window, &attributes)) return false;
    window->visual = attributes.visual;
    window->depth = attributes.depth;
    if ((attributes.depth != 24 && attributes.depth != 32) || attributes.visual->red_mask != 0xff0000 ||
        attributes.visual->green_mask != 0xff00 || attributes.visual->blue_mask != 0xff ||
        (ImageByteOrder(window->display) == LSBFirst) != little_endian()) {
        return false;
    }
    window->gc = XCreateGC(window->display, window->window, 0, NULL);
    return window->gc && fit_image(window, width, height);
}

static void end_x11(es_window* window)
{
    if (!window->display) return;
    free_image(window);
    if (window->gc) XFreeGC(window->display, window->gc);
    window->gc = NULL;
    window->display = NULL;
}

/* Nearest: the source pixel under the centre of each pixel of the window. */
static void scale_row(uint32_t* out, uint32_t out_width, const uint32_t* in, uint32_t in_width)
{
    if (in_width == out_width) {
        for (uint32_t x = 0; x < out_width; x++) out[x] = in[x] | 0xff000000u;
        return;
    }
    for (uint32_t x = 0; x < out_width; x++) out[x] = in[((uint64_t)2 * x + 1) * in_width / (2 * (uint64_t)out_width)] | 0xff000000u;
}

static void present_x11(es_window* window, const uint32_t* xrgb, uint32_t width, uint32_t height)
{
    uint32_t out_width = window->input.width, out_height = window->input.height;
    if (!fit_image(window, out_width, out_height)) return;
    for (uint32_t y = 0; y < out_height; y++) {
        uint32_t from = (uint32_t)(((uint64_t)2 * y + 1) * height / (2 * (uint64_t)out_height));
        uint32_t* row = (uint32_t*)(void*)(window->image->data + (size_t)y * (size_t)window->image->bytes_per_line);
        scale_row(row, out_width, xrgb + (size_t)from * width, width);
    }
    if (window->image_shared) {
        XShmPutImage(window->display, window->window, window->gc, window->image, 0, 0, 0, 0, out_width, out_height, False);
    } else {
        XPutImage(window->display, window->window, window->gc, window->image, 0, 0, 0, 0, out_width, out_height);
    }
    /* The server reads shared pixels when it gets to the request: wait, or the next frame would tear into this one. */
    XSync(window->display, False);
}

/* ---- OpenGL ----------------------------------------------------------------------------------------------------------- */

static bool begin_opengl(es_window* window)
{
    gl_functions* gl = &window->gl;
    const struct { void* slot; const char* name; } functions[] = {{&gl->Viewport, "glViewport"}, {&gl->Enable, "glEnable"},
        {&gl->GenTextures, "glGenTextures"}, {&gl->BindTexture, "glBindTexture"}, {&gl->TexParameteri, "glTexParameteri"},
        {&gl->TexImage2D, "glTexImage2D"}, {&gl->Begin, "glBegin"}, {&gl->End, "glEnd"}, {&gl->TexCoord2f, "glTexCoord2f"},
        {&gl->Vertex2f, "glVertex2f"}};
    GLFWwindow* previous = glfwGetCurrentContext();
    glfwMakeContextCurrent(window->glfw);
    bool complete = true;
    for (size_t i = 0; i < sizeof functions / sizeof *functions; i++) {
        GLFWglproc address = glfwGetProcAddress(functions[i].name);
        memcpy(functions[i].slot, &address, sizeof address);
        complete = complete && address;
    }
    if (complete) {
        gl->GenTextures(1, &window->texture);
        gl->BindTexture(GL_TEXTURE_2D_, window->texture);
        gl->TexParameteri(GL_TEXTURE_2D_, GL_TEXTURE_MAG_FILTER_, GL_NEAREST_);
        gl->TexParameteri(GL_TEXTURE_2D_, GL_TEXTURE_MIN_FILTER_, GL_NEAREST_);
        gl->Enable(GL_TEXTURE_2D_);
        glfwSwapInterval(0);  /* the caller paces itself; its frames are slower than the display's */
    }
    glfwMakeContextCurrent(previous);
    window->backend = "opengl";
    return complete;
}

static void present_opengl(es_window* window, const uint32_t* xrgb, uint32_t width, uint32_t height)
{
    const gl_functions* gl = &window->gl;
    GLFWwindow* previous = glfwGetCurrentContext();
    glfwMakeContextCurrent(window->glfw);
    gl->Viewport(0, 0, (int)window->input.width, (int)window->input.height);
    gl->BindTexture(GL_TEXTURE_2D_, window->texture);
    gl->TexImage2D(GL_TEXTURE_2D_, 0, GL_RGB_, (int)width, (int)height, 0, GL_BGRA_, GL_UNSIGNED_INT_8_8_8_8_REV_, xrgb);
    gl->Begin(GL_TRIANGLE_FAN_);
    gl->TexCoord2f(0, 1), gl->Vertex2f(-1, -1);
    gl->TexCoord2f(1, 1), gl->Vertex2f(1, -1);
    gl->TexCoord2f(1, 0), gl->Vertex2f(1, 1);
    gl->TexCoord2f(0, 0), gl->Vertex2f(-1, 1);
    gl->End();
    glfwSwapBuffers(window->glfw);
    if (previous != window->glfw) glfwMakeContextCurrent(previous);
}

/* ---- window ----------------------------------------------------------------------------------------------------------- */

static GLFWwindow* open_window(const es_window_desc* desc, bool opengl)
{
    glfwDefaultWindowHints();
    if (opengl) {
        glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 2);
        glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 1);
        glfwWindowHint(GLFW_DEPTH_BITS, 0);
    } else {
        glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
    }
    GLFWwindow* glfw = glfwCreateWindow((int)desc->width, (int)desc->height, desc->title ? desc->title : "Earthshine", NULL, NULL);
    glfwDefaultWindowHints();
    return glfw;
}

static bool open_backend(es_window* window, const es_window_desc* desc)
{
    if (glfwGetX11Display && glfwGetX11Window) {
        window->glfw = open_window(desc, false);
        if (window->glfw) {
            int width, height;
            glfwGetFramebufferSize(window->glfw, &width, &height);
            if (width > 0 && height > 0 && begin_x11(window, (uint32_t)width, (uint32_t)height)) return true;
            end_x11(window);
            glfwDestroyWindow(window->glfw);
        }
    }
    window->glfw = open_window(desc, true);
    return window->glfw && begin_opengl(window);
}

es_result es_window_create(es_context* context, const es_window_desc* desc, es_window** out)
{
    if (out) *out = NULL;
    if (!context) return ES_INVALID_ARGUMENT;
    if (!desc || !out) return es_misuse(context, ES_INVALID_ARGUMENT, "es_window_create: desc and window must not be NULL");
    if (desc->width < 1 || desc->height < 1 || desc->width > ES_IMAGE_MAX_SIZE || desc->height > ES_IMAGE_MAX_SIZE) {
        return es_fail(context, ES_IMAGE_SIZE, "a window of %u x %u cannot be opened; 1 to %d are accepted", desc->width, desc->height,
            ES_IMAGE_MAX_SIZE);
    }
    const char* reason = NULL;
    glfwGetError(NULL);
    glfwGetPrimaryMonitor();
    bool running = glfwGetError(NULL) != GLFW_NOT_INITIALIZED;
    if (!running && !glfwInit()) {
        glfwGetError(&reason);
        return es_fail(context, ES_NO_DISPLAY, "no window can be opened: %s", reason ? reason : "GLFW does not start");
    }
    es_window* window = es_allocate_zero(context, sizeof *window);
    if (!window) {
        if (!running) glfwTerminate();
        return es_context_last_result(context);
    }
    window->context = context;
    window->owns_glfw = !running;
    if (!open_backend(window, desc)) {
        glfwGetError(&reason);
        es_result result = es_fail(context, ES_NO_DISPLAY, "no window can be opened: %s", reason ? reason : "neither X11 nor OpenGL serves");
        if (window->glfw) glfwDestroyWindow(window->glfw);
        if (!running) glfwTerminate();
        es_release(context, window, sizeof *window);
        return result;
    }
    glfwSetWindowUserPointer(window->glfw, window);
    glfwSetKeyCallback(window->glfw, on_key);
    glfwSetMouseButtonCallback(window->glfw, on_button);
    glfwSetScrollCallback(window->glfw, on_scroll);
    glfwSetCharCallback(window->glfw, on_character);
    glfwSetCursorPosCallback(window->glfw, on_cursor);
    double x, y;
    glfwGetCursorPos(window->glfw, &x, &y);
    window->input.mouse_x = (float)x;
    window->input.mouse_y = (float)y;
    window->cursor_x = (float)x;
    window->cursor_y = (float)y;
    es_context_count_object(context, 1);
    *out = window;
    return ES_OK;
}

void es_window_destroy(es_window* window)
{
    if (!window) return;
    es_context* context = window->context;
    end_x11(window);
    glfwDestroyWindow(window->glfw);
    if (window->owns_glfw) glfwTerminate();
    es_release(context, window, sizeof *window);
    es_context_count_object(context, -1);
}

void es_window_present(es_window* window, const uint32_t* xrgb, uint32_t width, uint32_t height)
{
    if (!window || !xrgb || width < 1 || height < 1) return;
    int now_width, now_height;
    glfwGetFramebufferSize(window->glfw, &now_width, &now_height);
    if (now_width < 1 || now_height < 1) return;  /* minimised */
    window->input.width = (uint32_t)now_width;
    window->input.height = (uint32_t)now_height;
    if (window->display) present_x11(window, xrgb, width, height);
    else present_opengl(window, xrgb, width, height);
}

void es_window_set_title(es_window* window, const char* title)
{
    if (window && title) glfwSetWindowTitle(window->glfw, title);
}

const char* es_window_backend(const es_window* window) { return window ? window->backend : ""; }

#else

es_result es_window_create(es_context* context, const es_window_desc* desc, es_window** window)
{
    if (window) *window = NULL;
    if (!context) return ES_INVALID_ARGUMENT;
    return es_fail(context, ES_NOT_BUILT, "no window can be opened: this build has no GLFW");
}

void es_window_destroy(es_window* window) {}
void es_window_poll(es_window* window, es_window_input* input)
{
    if (input) *input = (es_window_input){0};
}
void es_window_present(es_window* window, const uint32_t* xrgb, uint32_t width, uint32_t height) {}
void es_window_set_title(es_window* window, const char* title) {}
const char* es_window_backend(const es_window* window) { return ""; }

#endif
