/* Inside of a world, for the files of this floor.
 *
 * Setters change objects and raise marks; es_world_refresh turns the marks into what the getters hand out (world matrices,
 * draw list, lights, the active camera) and counts revisions up where the content really differs. Everything refresh
 * writes into was sized when objects were added, so it cannot fail and getters may call it. */
#ifndef EARTHSHINE_SIM_WORLD_H
#define EARTHSHINE_SIM_WORLD_H

#include "sim/deform.h"
#include "sim/sim.h"
#include "sim/slots.h"

#ifdef __cplusplus
extern "C" {
#endif

/* |coordinate|, |scale| and the like at most: squares of differences stay finite in float */
#define ES_WORLD_EXTENT 1e9f
/* |weight of a morph target| at most */
#define ES_MORPH_WEIGHT 1e6f

/* What playing clips add up to for one value of up to four numbers, see sim/clip_targets.c. */
typedef struct es_clip_sum { float value[4], share; bool touched; } es_clip_sum;
typedef struct es_clip_sums {
    es_clip_sum sums[ES_CLIP_LIGHT_RANGE - ES_CLIP_LIGHT_COLOR + 1]; /* by path, from the first that the kind of object has */
    uint32_t played_by;      /* the clip that took the object when the world was opened */
    bool kept;               /* `rest` is what the object was before the first clip for it was added */
} es_clip_sums;

typedef struct es_texture_object { es_object object; es_texture_image image; } es_texture_object;

typedef struct es_material_object { es_object object; es_material_desc desc; } es_material_object;

typedef struct es_mesh_object {
    es_object object;
    es_raster_mesh raster;   /* previous_positions is set only while it differs from positions */
    float *positions, *previous, *normals, *tangents, *uvs, *colors;
    float *rest, *rest_normals, *rest_tangents; /* as added; kept from the first deformation on, for restoring */
    es_vec3 box[2], previous_box[2]; /* of positions and, while there are any, of previous_positions */
    struct es_vertex_fans* fans;     /* from the first recomputed normals on */
    es_mesh_drive* drive;    /* NULL: no skin or morph target moves it */
    uint32_t* indices;
    bool deformed;           /* ever, by es_world_deform_mesh: its vertices are state, not an asset */
    bool moving;             /* deformed since the step began or at the one before */
    uint32_t soft;           /* the soft body whose mesh it is, or 0 */
} es_mesh_object;

typedef struct es_skin_object {
    es_object object;
    es_mesh mesh;
    es_node node;
    uint32_t joint_count;
    es_node* joints;
    uint8_t* ways;           /* parents between joint and node, see sim/skins.c */
    es_mat4* inverse_binds;
    float *palette, *next_palette, *previous_palette; /* joint_count + 1 matrices of the present vertices, of those being made, of last frame's */
    es_skin_weights weights;
} es_skin_object;

typedef struct es_node_object {
    es_object object;
    es_node parent;
    es_transform transform;
    es_mat4 local, world, previous;
    double position[3], previous_position[3]; /* translations of `world` and `previous` before they are rounded */
    uint32_t depth;          /* of the root's children: 0 */
    es_transform rest;       /* what clips that weigh less than one leave something of */
    es_clip_sums clip_sums;
    bool dirty;              /* `transform` changed since the last refresh */
    bool fresh;              /* created since then: has no last frame */
    bool changed;            /* `world` changed in this refresh */
} es_node_object;

typedef struct es_instance_object { es_object object; es_instance_desc desc; bool warned; } es_instance_object;

typedef struct es_camera_object {
    es_object object;
    es_camera_desc desc;     /* name NULL */
    es_camera_desc previous;
    es_camera_desc rest;
    es_clip_sums clip_sums;
    es_mat4 previous_world;
    double previous_position[3];
    bool fresh;
} es_camera_object;

typedef struct es_light_object {
    es_object object;
    es_light_desc desc, rest;
    es_clip_sums clip_sums;
    float dimmed;            /* share of the intensity that a flicker takes away now */
} es_light_object;

typedef struct es_mover_object { es_object object; es_mover_desc desc; } es_mover_object; /* name NULL */

typedef struct es_clip_track { es_clip_channel channel; uint32_t components; } es_clip_track;

/* How a clip plays; its weight goes from `from` to `to` while it fades. */
typedef struct es_clip_playing {
    double start, offset;    /* world time at which it stood at `offset` seconds */
    double fade_start;
    float speed, from, to, fade;
    bool once;
} es_clip_playing;

typedef struct es_clip_object {
    es_object object;
    es_clip_track* tracks;
    uint32_t track_count;
    float* data;             /* the channels' times and values, one after another */
    size_t data_count;
    float duration;
    bool playing;
    es_clip_playing play;
} es_clip_object;

/* What a camera revision stands for. No padding: compared as bytes. */
typedef struct es_camera_state { uint32_t id, orthographic; float fov_y, half_height, near_plane, far_plane; es_mat4 world; } es_camera_state;

typedef struct es_sky {
    bool on;
    es_sky_desc desc;
    double since;            /* the world's time at which desc's moment was */
    bool drawn;              /* the environment's picture is that of this: */
    int32_t drawn_step;      /* elevation / ES_SKY_STEP */
} es_sky;

struct es_world {
    es_context* context;
    es_world_settings settings;
    es_slots slots[ES_OBJECT_KINDS];
    double time;
    double fixed_base;             /* dynamics stand at fixed_base + fixed_count × settings.step seconds, at or after `time` */
    uint64_t fixed_count;
    bool in_step;
    bool stepped;                  /* before the first step there is no last frame */
    es_world_step_function step_function;
    void* step_user;
    es_camera active_camera;

    uint32_t* order;               /* node slots, parents before children: by depth, then by slot */
    size_t order_capacity, order_count;
    bool order_dirty, nodes_dirty, nodes_moving;

    uint32_t driven_meshes;        /* that skins or morph targets move */
    bool poses_dirty;              /* a node, a morph weight or a skin differs since their vertices were computed */

    es_raster_instance* drawn;     /* of list */
    size_t drawn_capacity;
    es_material_desc* materials;   /* [0] the default material, [slot + 1] the others */
    size_t material_capacity;
    es_draw_list list;
    bool list_dirty;               /* entries or their transforms may differ */
    bool geometry_touched;         /* an instance or mesh certainly differs */
    bool instances_moving;
    bool has_bounds;
    es_vec3 bounds_min, bounds_max; /* relative to the origin */

    double origin[3];              /* what the light reads is relative to it */
    double cell;                   /* the origin is a multiple of it; 0 without geometry */

    es_light_state* lights;
    size_t light_capacity, light_count;
    bool lights_dirty;

    es_image environment_image;    /* three channels; no pixels: the same radiance everywhere */
    float environment_radiance[3], environment_rotation;

    es_sky sky;

    es_camera_state camera_state;
    bool camera_dirty, camera_moving;

    es_recording* recording;       /* that takes notes; NULL: none */

    es_world_revisions revisions;
    uint64_t pose_changes;         /* of nodes: times that one's matrix changed */

    struct es_edits* edits;        /* NULL: there never were any */

    es_hand_state hands[ES_HANDS];
    struct es_rigid* rigid;        /* bodies' common parts (sim/rigid/rigid.h); NULL: there never were any */
};

/* ---- asking about arguments: OK, or a failure with its message ---------------------------------------------------- */

/* False for NaN, and quietly: a caller's NaN is an argument to refuse, which `>=` would make an invalid operation of. */
static inline bool es_within(float x, float low, float high) { return __builtin_isgreaterequal(x, low) && __builtin_islessequal(x, high); }
bool es_all_within(const float* values, size_t count, float limit);
/* The object or NULL after a message. */
void* es_world_object(const es_world* world, es_object_kind kind, uint32_t id);
/* Moves one reference from handle `from` to handle `to`; null handles are skipped. */
void es_world_rereference(es_world* world, es_object_kind kind, uint32_t from, uint32_t to);

/* ---- refreshing ------------------------------------------------------------------------------------------------------- */

void es_world_refresh(const es_world* world);
void es_nodes_refresh(es_world* world);
void es_draw_list_refresh(es_world* world);
void es_lights_refresh(es_world* world);
void es_camera_refresh(es_world* world);
/* The present pose becomes the last one. */
void es_world_settle(es_world* world);
void es_meshes_settle(es_world* world);
bool es_draw_list_reserve(es_world* world);
void es_node_settle(es_node_object* node);
/* Puts the origin near the active camera; false when it stays where it was. */
bool es_origin_refresh(es_world* world);
/* The null handle stands for the world's own axes. */
const es_mat4* es_node_world(const es_world* world, es_node node);
const es_mat4* es_node_previous(const es_world* world, es_node node);
const double* es_node_position(const es_world* world, es_node node);
const double* es_node_previous_position(const es_world* world, es_node node);
/* The matrix with its translation `position` relative to the world's origin. */
es_mat4 es_relative_matrix(const es_world* world, const es_mat4* matrix, const double position[3]);
/* The transform with zero-initialised parts replaced and the rotation made unit; false when a number is out of range. */
bool es_transform_resolve(const es_transform* transform, es_transform* resolved);

/* Poses what playing clips move as it is at `time`. */
void es_clips_play(es_world* world, double time);
/* The same for movers; refreshes the nodes when one aims. */
void es_movers_play(es_world* world, double time);
bool es_mover_numbers_valid(const es_mover_desc* desc);
/* Ends those that have faded out. */
void es_clips_retire(es_world* world);
bool es_clip_playing_valid(const es_clip_playing* playing);

/* Two keys and the place between them. */
typedef struct es_clip_segment { size_t key; bool hold; float u, length; } es_clip_segment;
es_clip_segment es_clip_find(const es_clip_track* track, double time);
/* Components [first, first + count) of the track's value; a rotation has all four at once. */
void es_clip_value(const es_clip_track* track, const es_clip_segment* segment, uint32_t first, uint32_t count, float* value);
/* sim/clip_targets.c: false after a message */
bool es_clip_target_exists(es_world* world, const es_clip_channel* channel);
uint32_t es_clip_components(const es_world* world, const es_clip_channel* channel);
void es_clip_hold_target(es_world* world, const es_clip_channel* channel, bool hold);
uint32_t* es_clip_played_by(es_world* world, const es_clip_channel* channel);
void es_clip_add_value(es_world* world, const es_clip_track* track, double time, float weight);
/* Sets the channel's target to what was added up for it. */
void es_clip_apply(es_world* world, const es_clip_channel* channel);
bool es_mesh_make_deformable(es_world* world, es_mesh_object* mesh);
void es_mesh_restored(es_world* world, es_mesh_object* mesh);  /* after its streams were replaced */
/* Room for `extra` more vertices, copies of the first one. False after es_fail. */
bool es_mesh_reserve(es_world* world, es_mesh_object* mesh, uint32_t extra);
/* Gives vertex `to` what vertex `from` has besides its place and normal. */
void es_mesh_copy_vertex(es_mesh_object* mesh, uint32_t to, uint32_t from);
void es_mesh_reindexed(es_world* world, es_mesh_object* mesh); /* after its indices were changed */
/* es_world_deform_mesh for positions of 4 floats per vertex, without normals. False after es_fail. */
bool es_mesh_take_positions(es_world* world, es_mesh_object* mesh, const float* positions, bool* changed);
void es_mesh_object_free(es_world* world, es_mesh_object* mesh);
size_t es_mesh_stream_bytes(uint32_t vertex_count);
/* Of a deformable mesh that has normals, from its present positions; false after es_fail. */
bool es_mesh_recompute_normals(es_world* world, es_mesh_object* mesh);
void es_mesh_join_boxes(es_mesh_object* mesh);
bool es_mesh_make_driven(es_world* world, es_mesh_object* mesh);
void es_mesh_drive_free(es_world* world, es_mesh_object* mesh);
es_result es_morph_desc_check(es_world* world, const es_mesh_desc* desc);
bool es_morphs_fill(es_world* world, es_mesh_object* mesh, const es_mesh_desc* desc);
void es_skin_object_free(es_world* world, es_skin_object* skin);
/* Vertices of the driven meshes; nodes must have been refreshed. */
void es_meshes_refresh(es_world* world);
bool es_camera_desc_resolve(es_world* world, const es_camera_desc* desc, es_camera_desc* resolved);
/* Of a saved state: does it hold what es_world_set_environment would take? */
bool es_environment_numbers_valid(const float radiance[3], float rotation);
void es_environment_free(es_world* world);
/* Brings environment and sun to where they are at the world's time. */
void es_sky_refresh(es_world* world);
bool es_light_desc_resolve(es_world* world, const es_light_desc* desc, es_light_desc* resolved);

/* Where bodies and cloth stand, seconds. */
double es_fixed_time(const es_world* world);

/* Last act of opening a scene or file: chooses camera and clips by the settings, poses the clips at time 0, makes that
 * pose the last one too. SETTING_VALUE when the settings name a camera or clip that is not there. */
es_result es_world_finish_opening(es_world* world);

es_result es_world_settings_resolve(es_context* context, const es_world_settings* settings, es_world_settings* resolved);

#ifdef __cplusplus
}
#endif
#endif
