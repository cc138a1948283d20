/* What the files of `earthshine play` share: one player, and what each file lets the others do with it. */
#ifndef EARTHSHINE_DEMO_PLAYER_H
#define EARTHSHINE_DEMO_PLAYER_H

#include "demo.h"
#include "player_edits.h"
#include "player_history.h"
#include "player_nodes.h"
#include "ui_plot.h"
#include "ui_widgets.h"

enum { PLAYER_MAX_SERIES = 40 };

/* The right side of the divider. */
typedef enum player_split_mode { SPLIT_OFF, SPLIT_FORMER, SPLIT_REFERENCE, SPLIT_MODES } player_split_mode;

typedef struct player_split {
    player_split_mode mode;
    float divider;               /* share of the width that is the left side's */
    bool dragging;
    es_renderer* renderer;       /* FORMER */
    es_renderer_settings former; /* what the settings were before the last change, or when they were kept */
    bool pinned;                 /* kept by hand: later changes leave it */
    es_reference* reference;     /* REFERENCE */
    es_reference_settings reference_settings;
    es_world_revisions seen;     /* what the reference was begun with */
    uint32_t part;               /* the reference has one pixel for part × part, so that a sample takes a fraction of a second */
    double sample_seconds;
    bool begun;
    uint32_t* pixels;            /* as displayed */
    uint32_t width, height;
    size_t capacity;
} player_split;

typedef struct player_graphs {
    ui_series frame, flicker, brightness, energy;
    struct { char name[40]; ui_series milliseconds; } passes[PLAYER_MAX_SERIES];
    size_t pass_count;
    float* luminance;            /* of a grid over the last two frames */
    uint32_t grid_width, grid_height, grids;
} player_graphs;

typedef struct player_capture {
    char directory[DEMO_PATH_SIZE];
    uint32_t picture;            /* number of the next screenshot */
    bool recording;              /* a sequence of frames */
    uint32_t sequence, frame;
    char wanted[DEMO_PATH_SIZE + 128], pattern[DEMO_PATH_SIZE + 128]; /* of the next screenshot; of the sequence, without number */
} player_capture;

/* What the mouse or the keyboard holds. */
typedef enum player_held { HELD_NOTHING, HELD_LIGHT, HELD_BODY, HELD_SOFT } player_held;
typedef struct player_hand {
    player_held what;
    bool by_keyboard;
    es_light light;
    double target[3];            /* where it is pulled to, world coordinates */
    float distance;              /* from the eye, along the view's axis */
    bool show_lights;
    double cross_until;          /* the middle of the picture is marked until then */
} player_hand;

struct player {
    demo_options options;
    char scene[DEMO_PATH_SIZE];  /* name or file */
    demo_session session;
    es_world_settings world;     /* as set; what only opening reads is taken at the next opening */
    es_world_settings opened;    /* as the world was opened with */
    es_window* window;
    es_window_input input;
    bool commanded[ES_KEY_ESCAPE]; /* keys that went down with Control */
    ui ui;
    demo_canvas canvas;
    size_t canvas_pixels;
    uint32_t divisor;            /* a rendered pixel is so many pixels of the window wide */
    player_nodes nodes;
    bool replaying;              /* a recording: what there is to do is in it */
    uint32_t replayed;           /* steps of it */
    float replay_time;           /* seconds that the next ones may take */
    bool differed, failed;       /* it went another way; a recording could not be written */
    size_t image;                /* index into the renderer's images; 0 is the displayed one */
    bool paused, quit;
    uint32_t steps;              /* single steps to make */
    bool show_vpls, show_points, hide_all;
    bool show_help, show_scenes, show_settings, show_graphs, show_timeline, show_micro;
    double frame_milliseconds, interface_milliseconds; /* smoothed */
    float seconds;               /* of the last loop */
    player_history history;
    player_split split;
    player_graphs graphs;
    player_capture capture;
    player_hand hand;
    player_edits edits;
    char notice[256];
    double notice_until;
    bool hint;                /* the notice is the one about keys, of the start */
    /* panels */
    ui_scroll scene_scroll, settings_scroll, help_scroll;
    char search[UI_EDIT_SIZE];
    bool only_changed;
    char wanted_scene[DEMO_PATH_SIZE]; /* to be opened at the frame's end; "" none */
};

/* A line that shows for a few seconds. */
void player_notice(player* p, const char* format, ...) ES_PRINTF(2, 3);

/* ---- player_scene.c ---- */
/* Opens p->scene with the options' settings, or with those that are set when `keep` says so. On failure what was open stays. */
int player_open_scene(player* p, const char* scene, bool keep);
void player_close_scene(player* p);
/* Ends the replay where it is: from there on the scene is the user's. */
void player_end_replay(player* p, const char* why);
/* The window says which scene it shows. */
void player_open_title(player* p);

/* ---- player_commands.c: everything that has a key ---- */
void player_take_keys(player* p, const es_window_input* input);
/* Control is held, or was when the poll that comes late would have seen it. */
bool player_with_control(const es_window_input* input);
/* Their list, group by group: false past the last. A command of no key only begins a group. */
bool player_command_text(size_t index, const char** key, const char** text);
/* Winds to a state of the history, and pauses. */
void player_wind(player* p, uint32_t at);

/* ---- player_panels.c ---- */
void player_build_panels(player* p);

/* ---- player_settings.c ---- */
void player_settings_panel(player* p, canvas_rect rect);
/* Applies settings of the renderer when it accepts them; the split's other side keeps the former. */
bool player_configure(player* p, const es_renderer_settings* settings);
/* key=value of all that differs from the defaults, each after `--set`, to stdout. */
void player_print_settings(const player* p);

/* ---- player_graphs.c ---- */
void player_graphs_add(player* p);
void player_graphs_panel(player* p, canvas_rect rect);

/* ---- player_micro.c ---- */
void player_micro_panel(player* p, int bottom);

/* ---- player_split.c ---- */
void player_next_split(player* p);
/* Renders or refines the other side. */
int player_split_update(player* p);
/* Puts it into the canvas, with the divider. */
void player_split_draw(player* p);
/* True while the divider has the mouse. */
bool player_split_drag(player* p, const es_window_input* input);
void player_split_close(player* p);

/* ---- player_capture.c ---- */
void player_screenshot(player* p, bool exr);
void player_toggle_sequence(player* p);
/* Writes the frame that was drawn when a sequence is being recorded. */
void player_capture_frame(player* p);
/* Seconds a frame of the sequence lasts, 0 when none is recorded. */
float player_capture_step(const player* p);

/* ---- player_hand.c ---- */
/* The mouse and keys that the interface leaves; true when it has the mouse, which then does not turn the camera. */
bool player_hand_update(player* p, const es_window_input* input);
/* Before the step: a body or cloth is pulled to where the hand is. After it: a light is there. */
int player_hand_pull(player* p);
int player_hand_apply(player* p);
void player_hand_draw(player* p);
void player_hold_next_light(player* p);
void player_release(player* p);
/* By the keyboard, in the middle of the picture: takes hold or lets go, throws what is held, tears cloth, takes it off its hooks. */
void player_grab(player* p);
void player_throw(player* p);
void player_tear(player* p);
void player_unhook(player* p);
void player_lights_home(player* p);

/* ---- play_files.c ---- */
/* `earthshine play` without a window. `why` begins the line that says where the frames are. */
int play_to_files(const demo_options* options, const char* why);
/* A scene's name or a file's stem, with letters that suit every file system. */
void play_stem(const char* scene, char stem[64]);
bool play_can_write_in(const char* directory);

#endif
