/* Reflections edited by mouse and keyboard: constraints with a red and a green handle, regions with a blue one (Ritschel thesis §7.2). */
#ifndef EARTHSHINE_DEMO_PLAYER_EDITS_H
#define EARTHSHINE_DEMO_PLAYER_EDITS_H

#include "canvas.h"

#include <earthshine/sim.h>

typedef struct player player;

/* What a press of the mouse on a surface does. */
typedef enum edits_tool { TOOL_MOVE, TOOL_CONSTRAINT, TOOL_REGION, TOOL_BRUSH, TOOL_ERASER } edits_tool;
typedef enum edits_handle { HANDLE_NONE, HANDLE_RED, HANDLE_GREEN, HANDLE_BLUE } edits_handle;

typedef struct player_edits {
    bool shown;                  /* panel and handles */
    es_constraint constraint;    /* chosen; of a handle that is held the one it belongs to */
    es_region region;
    edits_tool tool;
    edits_handle held;
    bool by_keyboard;            /* it is, and moves from `x`, `y` */
    float x, y;                  /* pixels of the window */
    bool moved;                  /* … and has, since it was last committed */
    float distance;              /* of the held handle, ahead of the eye */
    bool painting;
    es_anchor last;              /* where the brush was */
    float brush;                 /* its radius, metres */
    es_edit_history* history;
} player_edits;

/* The mouse and keys that the interface leaves; true when they have the mouse. */
bool player_edits_update(player* p, const es_window_input* input);
void player_edits_draw(player* p);
void player_edits_panel(player* p, canvas_rect rect);
void player_edits_close(player* p);
/* With a key each. The first two in the middle of the picture. */
void player_add_constraint(player* p);
void player_add_region(player* p);
void player_hold_next_handle(player* p);
void player_delete_edit(player* p);
void player_freeze(player* p);
void player_return_to_view(player* p);
/* Before time is wound and after it: the edits stay as they are. */
void player_keep_edits(player* p, bool after);
void player_undo_edit(player* p);
void player_redo_edit(player* p);
void player_save_edits(player* p);
void player_save_edited_scene(player* p);
void player_load_edits(player* p);

#endif
