/* Earthshine, floor 2: the world.
 *
 * What exists and how it moves: meshes, textures, materials, instances in a node tree, cameras, lights, animation clips;
 * built-in scenes; glTF 2.0 import. The world keeps last frame's pose and marks what changed, so that the light above
 * knows what it may keep.
 *
 * Everything created has a handle: a generation id by value, zero is null, a destroyed object's handle stays stale.
 * Getters copy out; pointers returned are valid until the next call that changes the world.
 */
#ifndef EARTHSHINE_SIM_H
#define EARTHSHINE_SIM_H

#include <earthshine/platform.h>
#include <earthshine/raster.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct es_world es_world;
typedef struct es_recording es_recording;
typedef struct es_edit_history es_edit_history;

typedef struct es_texture { uint32_t id; } es_texture;
typedef struct es_material { uint32_t id; } es_material;
typedef struct es_mesh { uint32_t id; } es_mesh;
typedef struct es_node { uint32_t id; } es_node;
typedef struct es_instance { uint32_t id; } es_instance;
typedef struct es_camera { uint32_t id; } es_camera;
typedef struct es_light { uint32_t id; } es_light;
typedef struct es_clip { uint32_t id; } es_clip;
typedef struct es_mover { uint32_t id; } es_mover;
typedef struct es_skin { uint32_t id; } es_skin;
typedef struct es_soft { uint32_t id; } es_soft;
typedef struct es_region { uint32_t id; } es_region;
typedef struct es_constraint { uint32_t id; } es_constraint;

/* ---- the world itself ------------------------------------------------------------------------------------------------------------ */

typedef struct es_world_settings {
    uint32_t triangles;      /* built-in scenes: triangles to aim at; 0: the scene's own number */
    float speed;             /* of time, 0 … 100; below 1 slow motion */
    float step;              /* seconds of one step of bodies and cloth, 1e-4 … 0.1 */
    uint32_t substeps;       /* parts it is solved in, 1 … 64 */
    bool interpolate;        /* show bodies and cloth between two steps, where time is; off: as of the last step */
    bool sleep;              /* bodies and cloth at rest fall asleep */
    es_vec3 gravity;         /* m/s², each within 1000 */
    uint32_t camera;         /* which of the file's or scene's cameras, counted from 0 */
    uint32_t clip;           /* which clip plays: 0 all that do not touch the same node, n the n-th */
    bool default_light;      /* files without lights get one */
} es_world_settings;

ES_API es_world_settings es_default_world_settings(void);
ES_API size_t es_world_setting_count(void);
ES_API const es_setting* es_world_setting(size_t index);
ES_API es_result es_world_settings_set(es_context* context, es_world_settings* settings, const char* name, const char* value);

ES_API es_result es_world_create(es_context* context, const es_world_settings* settings, es_world** world);
ES_API void es_world_destroy(es_world* world);
ES_API es_context* es_world_context(const es_world* world);

/* Built-in scenes: cornell, room, hall … */
ES_API size_t es_scene_count(void);
ES_API const char* es_scene_name(size_t index);
ES_API const char* es_scene_description(size_t index);
/* Settings that show a scene at its best: texts key=value, of es_world_settings_set and of the light's es_renderer_settings_set, NULL after
 * the last; none for a name that is not built in. es_world_create_scene does not apply them: programs do, before what their user asks for. */
ES_API const char* const* es_scene_settings(const char* name);
/* settings NULL: defaults. SCENE_UNKNOWN names the nearest. */
ES_API es_result es_world_create_scene(es_context* context, const char* name, const es_world_settings* settings, es_world** world);
/* .gltf or .glb by content. What is left out is warned of; what cannot be shown at all is refused. A file without a camera gets
 * one that frames it; without a light, a directional light of 3 W/m² from above the camera's left shoulder. EXT_lights_image_based of the
 * scene becomes the environment: the first level of its cube, RGBD or sRGB; the rest follows from that.
 *
 * Skins, morph targets and animations play, also of lights, cameras and nodes by KHR_animation_pointer. Bodies come from
 * KHR_physics_rigid_bodies with KHR_implicit_shapes, or, on nodes without it, from extras (all members optional, SI units, node's axes):
 *   "extras": {"earthshine": {
 *     "body": {"type": "dynamic" | "kinematic" | "static", "mass", "velocity": [x, y, z], "angularVelocity": [x, y, z], "linearDamping",
 *              "angularDamping", "gravityScale", "continuous": false, "asleep": false,
 *              "shapes": [SHAPE …], or one shape's members here},
 *     "joint": {"type": "ball" | "hinge" | "distance" | "fixed", "to": node number (absent: the world), "limit": [low, high], "speed",
 *               "maxForce", "maxTorque", "length", "hertz", "dampingRatio", "breakForce", "breakTorque", "collideConnected": false},
 *     "cloth": {"mass", "stretchCompliance", "shearCompliance", "bendCompliance", "volumeCompliance", "damping", "thickness", "friction", "drag",
 *               "wind": [x, y, z], "pressure", "gravityScale", "selfCollision": false, "tearStretch", "substeps", "solid": spacing of its
 *               tetrahedra (absent: a cloth), "pins": [vertex …], "pinsAbove": height in the node's axes, "to": node that holds the pins}}}
 *   SHAPE: {"shape": "sphere" | "box" | "capsule" | "hull" | "mesh", "size": [x, y, z] or "radius", "height" (between a capsule's centres),
 *           "position": [x, y, z], "rotation": [x, y, z, w], "density", "friction", "restitution", "rollingResistance", "sensor": false,
 *           "category", "mask"}
 * with the meanings and defaults of es_body_desc, es_shape_desc, es_joint_desc and es_soft_desc. The standard shape is the hull of the node's mesh, of static
 * bodies the mesh; spheres, boxes and capsules without size fit it. A joint is at its node's place, a hinge turns about its z. Animated
 * nodes are kinematic. What the solver does not have (of joints, inertia, combine modes) is left out with a warning. */
ES_API es_result es_world_import_gltf(es_context* context, const char* path, const es_world_settings* settings, es_world** world);
/* A built-in scene's name, or else a file. */
ES_API es_result es_world_open(es_context* context, const char* scene_or_path, const es_world_settings* settings, es_world** world);

ES_API es_world_settings es_world_get_settings(const es_world* world);
/* Takes effect with the next step and is part of the saved state; triangles, camera, clip and default_light are read when a scene or file is
 * opened and stay as they were. SETTING_VALUE when one is outside its range; nothing is changed then. */
ES_API es_result es_world_configure(es_world* world, const es_world_settings* settings);

/* Advances by dt seconds (0 … 10) times settings.speed: the present pose becomes the last one; bodies and cloth make as many steps of
 * settings.step as it takes to reach the new time, clips and motions go there, then the step function moves things; transforms, views
 * and marks are updated. dt = 0 keeps the pose and ends all motion.
 *
 * Bodies and cloth see clips and motions as of each of their own steps, so that what they do does not depend on how time is cut into
 * frames; shown are they as of the new time, between the two steps around it (Fiedler's fixed timestep, without its frame of delay: the
 * step ahead is made first). The cost grows with dt × speed / step, which nothing limits.
 *
 * INVALID_ARGUMENT: dt is outside its range; WRONG_STATE: called from the step function; nothing has moved then. OUT_OF_MEMORY, MEMORY_CAP: time,
 * clips, motions and the step function have gone to the new time all the same, so that the caller goes on with the next frame; bodies and cloth
 * stay behind, and the next call makes up for the fixed steps that are missing. Of the fixed step that failed, nothing has happened to bodies
 * nor cloth if it was bodies that found no memory; if it was a cloth, bodies and the other cloths have made it and that one has left it out for good. */
ES_API es_result es_world_step(es_world* world, float dt);
ES_API double es_world_time(const es_world* world);
/* Called by es_world_step after the clips, with the new time. It may use every function of the world but step and destroy. */
typedef void (*es_world_step_function)(es_world* world, void* user, double time, float dt);
ES_API void es_world_set_step_function(es_world* world, es_world_step_function function, void* user);

/* The state that moves (time, node transforms now and last, lights, cameras, deformed meshes), not the assets. NULL buffer: *size is set.
 * Restoring needs the same world content; a buffer that does not fit is refused, and so is one there is no memory for, with the world as it
 * was. Only a torn cloth finds out half-way: ES_OUT_OF_MEMORY then leaves a world that is neither, to be restored again or destroyed. */
ES_API es_result es_world_save(const es_world* world, void* buffer, size_t* size);
ES_API es_result es_world_restore(es_world* world, const void* buffer, size_t size);
ES_API uint64_t es_world_hash(const es_world* world); /* of the saved state */

/* ---- assets --------------------------------------------------------------------------------------------------------------------------- */

typedef struct es_texture_desc { const char* name; uint32_t width, height; const uint8_t* rgba; bool srgb; } es_texture_desc;
ES_API es_result es_world_add_texture(es_world* world, const es_texture_desc* desc, es_texture* texture);
/* For es_material_desc's texture uses; NULL for a stale handle. Valid while the texture exists. */
ES_API const es_texture_image* es_world_texture_image(const es_world* world, es_texture texture);

ES_API es_result es_world_add_material(es_world* world, const char* name, const es_material_desc* desc, es_material* material);
ES_API es_result es_world_set_material(es_world* world, es_material material, const es_material_desc* desc);
ES_API es_result es_world_get_material(const es_world* world, es_material material, es_material_desc* desc);

/* Arrays are copied. Triangles with an index out of range, or vertices that are not finite or beyond 1e9 m, are refused. */
typedef struct es_morph_target { const float *positions, *normals, *tangents; /* displacements, 3 per vertex each; NULL: none */ } es_morph_target;
typedef struct es_mesh_desc {
    const char* name;
    uint32_t vertex_count, triangle_count;
    const float* positions;   /* 3 per vertex */
    const float* normals;     /* 3 per vertex, or NULL: computed, smooth over shared vertices */
    const float* tangents;    /* 4 per vertex or NULL */
    const float* uv0;         /* 2 per vertex or NULL */
    const float* uv1;         /* 2 per vertex or NULL */
    const float* colors;      /* 4 per vertex, linear, or NULL */
    const uint32_t* indices;  /* 3 per triangle */
    uint32_t target_count;    /* up to 65535 morph targets */
    const es_morph_target* targets;
    const float* weights;     /* of the targets, within ±1e6, or NULL: zeros */
    bool flat_normals;        /* with normals NULL: none are stored and the triangle's own is used (glTF's rule) */
} es_mesh_desc;
ES_API es_result es_world_add_mesh(es_world* world, const es_mesh_desc* desc, es_mesh* mesh);
/* Moves the vertices (3 floats each): the old ones become last frame's. normals NULL: kept. Call it from the step function.
 * WRONG_STATE for a mesh with morph targets or a skin: its vertices follow these. */
ES_API es_result es_world_deform_mesh(es_world* world, es_mesh mesh, const float* positions, const float* normals);
/* Smooth normals of the present vertices, weighted by area. Vertices that had the same place and normal when the mesh was added share one.
 * Nothing happens to a mesh that stores no normals. Runs on the context's threads. */
ES_API es_result es_world_recompute_normals(es_world* world, es_mesh mesh);
ES_API const es_raster_mesh* es_world_mesh(const es_world* world, es_mesh mesh);

/* ---- what moves a mesh's vertices ------------------------------------------------------------------------------------------------------ */

/* Of a mesh's morph targets: vertex = base + sum of weight × displacement, in the targets' order, positions, normals and tangents alike
 * (glTF 2.0 §3.7.2.2); a target of weight zero costs nothing. `count` must be the number of targets, weights within ±1e6. */
ES_API es_result es_world_set_morph_weights(es_world* world, es_mesh mesh, const float* weights, uint32_t count);
/* *count: capacity in, number of targets out; weights NULL asks for it. */
ES_API es_result es_world_get_morph_weights(const es_world* world, es_mesh mesh, float* weights, uint32_t* count);

/* A skin moves the vertices of one mesh by linear blends of joints' matrices (glTF 2.0 §3.7.3): vertex = sum of weight × (joint to the node's axes) ×
 * (inverse bind matrix) × morphed vertex; normals by the cofactors of the blend. What hangs on it is computed when it is looked at, on the
 * context's threads. One mesh has one skin at most; instances of a skinned mesh belong on the skin's node. A joint whose matrix leaves 1e8 (its
 * translation: 1e9 m), or any while the node's axes have no inverse, stands in its bind pose. */
typedef struct es_skin_desc {
    const char* name;
    es_mesh mesh;
    es_node node;                  /* whose axes the vertices are written in; best the joints' nearest common ancestor. Null: the world's */
    uint32_t joint_count;          /* 1 … 65535 */
    const es_node* joints;
    const es_mat4* inverse_binds;  /* per joint: from the mesh as added to the joint's axes; NULL: identities */
    uint32_t influences;           /* per vertex, 1 … 16 */
    const uint32_t* vertex_joints; /* `influences` per vertex, indices into `joints`; not looked at where the weight is zero */
    const float* vertex_weights;   /* the same, not negative; made to sum to one. A vertex without weights stays where it is */
} es_skin_desc;
typedef struct es_skin_state { es_mesh mesh; es_node node; uint32_t joint_count; const es_node* joints; } es_skin_state;
/* Arrays are copied. */
ES_API es_result es_world_add_skin(es_world* world, const es_skin_desc* desc, es_skin* skin);
ES_API es_result es_world_get_skin(const es_world* world, es_skin skin, es_skin_state* state);

/* ---- the node tree ------------------------------------------------------------------------------------------------------------------------ */

typedef struct es_transform { es_vec3 translation; es_quat rotation; es_vec3 scale; } es_transform;
ES_API es_transform es_identity_transform(void);
/* Where a transform is set, an all-zero rotation counts as the identity, and with it an all-zero scale as 1: a zero-initialised
 * transform is the identity, and a scale of zero that is meant comes with a rotation. Rotations are made unit. */

typedef struct es_node_desc { const char* name; es_node parent; es_transform transform; } es_node_desc;
ES_API es_result es_world_add_node(es_world* world, const es_node_desc* desc, es_node* node);
ES_API es_result es_world_set_node_transform(es_world* world, es_node node, const es_transform* transform);
ES_API es_result es_world_get_node_transform(const es_world* world, es_node node, es_transform* transform);
ES_API es_result es_world_get_node_matrix(const es_world* world, es_node node, es_mat4* to_world);
ES_API es_node es_world_find_node(const es_world* world, const char* name);

/* A null node stands for the world's own axes (here, for cameras and for lights), a null material for the default one. */
typedef struct es_instance_desc {
    es_node node;
    es_mesh mesh;
    es_material material;
    bool hidden;
    float point_weight;       /* points per area in imperfect shadow maps, against other instances, up to 1e6 (Knecht §5.1, §6.1); 0: 1, negative: none */
} es_instance_desc;
ES_API es_result es_world_add_instance(es_world* world, const es_instance_desc* desc, es_instance* instance);
ES_API es_result es_world_set_instance(es_world* world, es_instance instance, const es_instance_desc* desc);
ES_API es_result es_world_get_instance(const es_world* world, es_instance instance, es_instance_desc* desc);

/* ---- cameras and lights: they sit on nodes and look along the node's -z --------------------------------------------------------------------- */

typedef struct es_camera_desc {
    const char* name;
    es_node node;
    bool orthographic;
    float fov_y;              /* radians, default 0.8 */
    float half_height;        /* orthographic, metres */
    float near_plane, far_plane; /* metres; far is used by orthographic cameras only */
} es_camera_desc;
ES_API es_camera_desc es_default_camera_desc(void);
ES_API es_result es_world_add_camera(es_world* world, const es_camera_desc* desc, es_camera* camera);
ES_API es_result es_world_set_camera(es_world* world, es_camera camera, const es_camera_desc* desc);
ES_API es_result es_world_get_camera(const es_world* world, es_camera camera, es_camera_desc* desc);
/* The camera that es_renderer_render looks through: the first one added, until another is set; null when the world has none. */
ES_API es_camera es_world_active_camera(const es_world* world);
ES_API es_result es_world_set_active_camera(es_world* world, es_camera camera);
/* This frame's and last frame's view of a camera, for drawing; what it transforms is relative to es_world_origin. */
ES_API es_result es_world_camera_view(const es_world* world, es_camera camera, uint32_t width, uint32_t height, es_raster_view* view);

typedef enum es_light_type { ES_LIGHT_SPOT, ES_LIGHT_POINT, ES_LIGHT_DIRECTIONAL } es_light_type;
typedef struct es_light_desc {
    const char* name;
    es_node node;
    es_light_type type;
    float color[3];           /* linear, times intensity */
    float intensity;          /* W/sr for spot and point, W/m² for directional; up to 1e20, also when multiplied with the colour */
    float inner_cone, outer_cone; /* spot: half angles, radians; glTF's falloff between them */
    float range;              /* metres; 0: unlimited (glTF's window otherwise) */
    bool off;
} es_light_desc;
ES_API es_light_desc es_default_light_desc(void);
ES_API es_result es_world_add_light(es_world* world, const es_light_desc* desc, es_light* light);
ES_API es_result es_world_set_light(es_world* world, es_light light, const es_light_desc* desc);
ES_API es_result es_world_get_light(const es_world* world, es_light light, es_light_desc* desc);

/* ---- area lights: things that glow ------------------------------------------------------------------------------------------------------------ */

typedef enum es_area_shape { ES_AREA_RECTANGLE, ES_AREA_DISC, ES_AREA_SPHERE } es_area_shape;

/* Flat ones lie in the node's xy plane about its origin and send along its -z, as other lights do. */
typedef struct es_area_light_desc {
    const char* name;
    es_node node;
    es_area_shape shape;
    float size[2];            /* width along x and height along y, or diameters; of a sphere the first alone. Metres where the node is not scaled */
    float color[3];           /* linear, times what follows */
    float radiance;           /* W/(m² sr) … */
    float flux;               /* … or, where that is 0, W that it sends in all, with a white texture and in a node that is not scaled */
    bool two_sided;           /* flat: sends along +z as well */
    es_texture_use texture;   /* by which the colour is multiplied: (0, 0) at a flat one's upper left as seen from where it shines; a sphere's as on a globe */
} es_area_light_desc;
ES_API es_area_light_desc es_default_area_light_desc(void); /* a white rectangle of 1 m × 1 m, 10 W/(m² sr) */

/* What an area light is: an instance of a mesh whose material glows, black otherwise. It is seen, traced and lit by as any such thing, and found,
 * moved, hidden, saved, changed (es_world_set_material, es_world_set_instance) as one. */
typedef struct es_area_light { es_mesh mesh; es_material material; es_instance instance; } es_area_light;
/* Triangles' area is that of the round shape, so that it sends what it should. INVALID_ARGUMENT when a number is negative or not finite, or the size is none;
 * nothing is added then. */
ES_API es_result es_world_add_area_light(es_world* world, const es_area_light_desc* desc, es_area_light* light);
/* All three. */
ES_API es_result es_world_destroy_area_light(es_world* world, const es_area_light* light);

/* ---- environment: light from everywhere, infinitely far away --------------------------------------------------------------------------------- */

/* A world has at most one. It lights the reference's paths and, with es_renderer_settings.lamps, real-time pictures; where nothing else is, it is what both see. */
typedef struct es_environment_desc {
    const es_image* image;    /* lat-long, linear radiance, three channels or more: the row's centre has the elevation, top +y; the middle
                               * column looks along -z, columns to the right turn towards +x. Copied. NULL: the same radiance everywhere */
    float radiance[3];        /* factor, W/(m² sr); all zero: no environment */
    float rotation;           /* radians about +y, counter-clockwise seen from above */
} es_environment_desc;
/* Larger images are brought down to this, each texel the mean by solid angle over what it covers, so that no power is lost; it takes 12 bytes a texel, at most
 * 100 MB, besides what the caller's image takes. */
enum { ES_ENVIRONMENT_MAX_WIDTH = 4096, ES_ENVIRONMENT_MAX_HEIGHT = 2048 };
/* NULL: none. INVALID_ARGUMENT when a number of `desc` is negative, beyond 1e12 or not finite, or the image has fewer than three channels. R, G and
 * B are found by their names, or else the first three are taken. Values of texels that are negative, beyond 1e12 or not finite become 0, which a warning says once, with
 * their number and the first one's place. Counts as a change of the lights. Radiance and rotation are part of the saved state; the image is an asset. */
ES_API es_result es_world_set_environment(es_world* world, const es_environment_desc* desc);
/* The same with the image of a file, EXR or HDR; desc's own is not read. NULL: as it is, not turned. What es_image_load returns, and FILE_UNSUPPORTED for what is no
 * lat-long picture of three channels, such as a cube map. */
ES_API es_result es_world_load_environment(es_world* world, const char* path, const es_environment_desc* desc);
/* False when there is none. The image is the world's own copy and valid until the next call that changes the world. */
ES_API bool es_world_get_environment(const es_world* world, es_environment_desc* desc);

/* ---- sky: sun and clear sky of a date and a place --------------------------------------------------------------------------------- */

/* The environment becomes the clear sky (Preetham et al. 1999) over a diffuse ground, and a directional light the sun, at a moment that goes on with the world's
 * time; both in W of visible light: at noon the sun has some 600 W/m² and the sky some tens of W/(m² sr), so that pictures want an exposure of about -6.
 * At night there is starlight only. The sun's disc is in the light, not in the environment.
 * The light moves with every step; the picture of the sky is drawn anew when the sun has moved by half a degree (pictures exist for every half degree of elevation
 * and azimuth, and the nearest is shown, so that they do not depend on how the moment was come by). */
typedef struct es_sky_desc {
    int32_t year, month, day; /* Gregorian, 1 … 9999; within 0.1 degrees for this and the last century */
    double seconds;           /* of universal time since that day's midnight, at the world's time now; may be negative or more than a day, up to 1e10 */
    float speed;              /* seconds of the sky per second of the world, 0 … 1e6 */
    float latitude, longitude; /* radians, north and east positive */
    float north;              /* where north is: -z turned by so much about +y, counter-clockwise seen from above, radians */
    float turbidity;          /* haze, 2 (clear) … 10 */
    float intensity;          /* factor of sky and sun, 0 … 1e6 */
    float ground_albedo[3];   /* 0 … 1 */
    es_light sun;             /* a directional light with a node, whose rotation, colour and intensity the sky sets; null: no sun */
} es_sky_desc;
/* Noon of the 21st of June 2024 where both coordinates are 0, at the world's own speed. */
ES_API es_sky_desc es_default_sky_desc(void);
/* NULL: none, and no environment. Takes the place of the environment; es_world_set_environment ends it. Its numbers are part of the saved state; that there is one is
 * content. INVALID_ARGUMENT when something is out of its range. */
ES_API es_result es_world_set_sky(es_world* world, const es_sky_desc* desc);
/* False when there is none. Its seconds are those of now. */
ES_API bool es_world_get_sky(const es_world* world, es_sky_desc* desc);
typedef struct es_sun {
    es_vec3 direction;        /* unit, towards its middle */
    float elevation, azimuth; /* radians, without refraction; from north to east */
    float irradiance[3];      /* W/m² on what faces it; 0 below the horizon */
} es_sun;
/* All zero when there is no sky. */
ES_API es_sun es_world_sun(const es_world* world);

/* ---- clips ------------------------------------------------------------------------------------------------------------------------------------ */

typedef enum es_clip_path {
    ES_CLIP_TRANSLATION, ES_CLIP_ROTATION, ES_CLIP_SCALE, /* of `node`: 3, 4, 3 numbers per key */
    ES_CLIP_WEIGHTS,                                      /* of the morph targets of `mesh`: as many as it has */
    ES_CLIP_LIGHT_COLOR, ES_CLIP_LIGHT_INTENSITY, ES_CLIP_LIGHT_INNER_CONE, ES_CLIP_LIGHT_OUTER_CONE, ES_CLIP_LIGHT_RANGE, /* of `light`: 3, then 1 each, as in es_light_desc */
    ES_CLIP_CAMERA_FOV, ES_CLIP_CAMERA_HALF_HEIGHT, ES_CLIP_CAMERA_NEAR, /* of `camera`: 1 each, as in es_camera_desc */
    ES_CLIP_PATHS
} es_clip_path;
typedef enum es_interpolation { ES_INTERPOLATE_STEP, ES_INTERPOLATE_LINEAR, ES_INTERPOLATE_CUBIC_SPLINE } es_interpolation;
typedef struct es_clip_channel {
    es_node node;
    es_clip_path path;
    es_interpolation interpolation;
    uint32_t key_count;
    const float* times;       /* seconds, strictly increasing */
    const float* values;      /* so many per key as the path has; cubic spline: in-tangents, values, out-tangents per key */
    es_mesh mesh;             /* what moves, where the path is none of a node's */
    es_light light;
    es_camera camera;
} es_clip_channel;
typedef struct es_clip_desc { const char* name; uint32_t channel_count; const es_clip_channel* channels; } es_clip_desc;
/* Copied, and not played before es_world_play_clip says so (opening a scene or file does, by the settings). Cones, ranges and the like that
 * leave what their setters accept are taken to the nearest that is accepted. */
ES_API es_result es_world_add_clip(es_world* world, const es_clip_desc* desc, es_clip* clip);
/* From the beginning, in a loop over its duration (the last key of all channels), at full weight; nothing happens to one that plays. false:
 * it stops at once and what it moved stays where it is. */
ES_API es_result es_world_play_clip(es_world* world, es_clip clip, bool play);

/* Clips that move the same thing are averaged by their weights. Where these sum to less than one, the rest is what the thing was before the
 * first clip for it was added (morph weights: those of the mesh's desc). To cross-fade, stop one and start the other with the same fade:
 * a clip alone at weight one, before and after, is taken exactly. */
typedef struct es_clip_play {
    float weight;             /* 0 … 1000; 0: it ends when it has faded */
    float speed;              /* -100 … 100 */
    float start;              /* seconds into the clip; negative: goes on from where it is, or begins at its beginning (its end, when speed is negative) */
    bool once;                /* stays at the end (or beginning) it reaches; else it loops */
    float fade;               /* seconds over which the weight goes, in a straight line, from what it is now to `weight`; 0: at once */
} es_clip_play;
ES_API es_clip_play es_default_clip_play(void); /* weight 1, speed 1, start -1, looping, no fade */
/* how NULL: the default. */
ES_API es_result es_world_play_clip_with(es_world* world, es_clip clip, const es_clip_play* how);
/* Fades it out; then it ends, and what it alone moved is as it was before clips. */
ES_API es_result es_world_stop_clip(es_world* world, es_clip clip, float fade);
typedef struct es_clip_state {
    bool playing, once;
    float weight, target_weight; /* now, and at the end of the fade; 0 when it does not play */
    float speed;
    double time;              /* seconds into the clip */
    float duration;
    uint32_t channel_count;
} es_clip_state;
ES_API es_result es_world_get_clip(const es_world* world, es_clip clip, es_clip_state* state);

/* ---- shapes of bodies --------------------------------------------------------------------------------------------------------------------------- */

typedef enum es_shape_type { ES_SHAPE_SPHERE, ES_SHAPE_BOX, ES_SHAPE_CAPSULE, ES_SHAPE_HULL, ES_SHAPE_MESH } es_shape_type;

/* What a body is made of, in the body's frame (its node's axes), and what queries are asked with. Lengths are metres, between 1e-4 and
 * 1e5; a shape reaches at most 1e5 m from its body's origin. Start with es_default_shape_desc. */
typedef struct es_shape_desc {
    es_shape_type type;
    es_vec3 position;         /* of its centre (hull, mesh: of its points' origin) in the body's frame */
    es_quat rotation;         /* all zero: none */
    float radius;             /* sphere, capsule; box: how much of its half extents is rounding, at most 0.9 of the smallest; hull: added all around it */
    float half_height;        /* capsule: half the distance between the centres of its caps, along its y; 0 … */
    es_vec3 half_extents;     /* box */
    const float* points;      /* hull: 3 floats each, at least four that span a volume; NULL: the vertices of `mesh` */
    uint32_t point_count;     /* hulls keep the 64 corners that reach out farthest */
    es_mesh mesh;             /* hull without points: its vertices as they are now; mesh: its triangles, for static and kinematic bodies
                               * only, solid on both sides, those without area left out */
    es_vec3 scale;            /* hull, mesh: of the points, before rotation; all zero: 1 */
    float density;            /* kg/m³; 0: 1000 */
    float friction;           /* 0 … 100, of two shapes their geometric mean; negative: 0.6 */
    float restitution;        /* 0 … 1, of two shapes the larger; negative: 0 */
    float rolling_resistance; /* m, 0 … : torque against rolling per newton of normal force */
    bool sensor;              /* reports who enters and leaves, pushes nothing */
    uint32_t category, mask;  /* two shapes meet when each one's category is in the other's mask; category 0: 1, mask 0: all */
} es_shape_desc;
/* A box of 1 m with every default written out. */
ES_API es_shape_desc es_default_shape_desc(void);

/* ---- movers: motion by a formula ----------------------------------------------------------------------------------------------------------------- */

typedef enum es_mover_type {
    ES_MOVER_ORBIT,     /* the node circles about `axis` through `centre`, once per period, and turns with it */
    ES_MOVER_SWING,     /* it swings about the same axis, amplitude × sin of the turn: a pendulum, a swaying lamp */
    ES_MOVER_AIM,       /* its -z looks at `target`, or at the place `centre` when that is null; its x stays level */
    ES_MOVER_FLICKER    /* the light gives 1 - amplitude × noise of its intensity: a flame; three octaves, from `seed` */
} es_mover_type;
typedef struct es_mover_desc {
    const char* name;
    es_mover_type type;
    es_node node;             /* ORBIT, SWING, AIM; what is attached to it goes along */
    es_node target;           /* AIM */
    es_light light;           /* FLICKER */
    es_vec3 centre;           /* ORBIT, SWING: in the axes of the node's parent, metres; AIM: in the world's */
    es_vec3 arm;              /* ORBIT, SWING: from the centre to the node where the angle is zero */
    es_vec3 axis;             /* made unit; the zero vector counts as +y */
    es_quat rotation;         /* ORBIT, SWING: of the node where the angle is zero; all zero: identity */
    bool keep_rotation;       /* ORBIT, SWING: leave the node's rotation to others */
    float period;             /* seconds, 1e-3 … 1e6; 0: 1. FLICKER: between two values of the slowest octave */
    float phase;              /* periods passed at time 0 */
    float amplitude;          /* SWING: radians; FLICKER: 0 … 1 */
    uint32_t seed;            /* FLICKER */
    bool off;                 /* the node stays where it is, the light at full intensity */
} es_mover_desc;
ES_API es_mover_desc es_default_mover_desc(void);
/* Movers play after the clips, from the next step on; several on one node or light: the last one added wins. */
ES_API es_result es_world_add_mover(es_world* world, const es_mover_desc* desc, es_mover* mover);
ES_API es_result es_world_set_mover(es_world* world, es_mover mover, const es_mover_desc* desc);
ES_API es_result es_world_get_mover(const es_world* world, es_mover mover, es_mover_desc* desc);
ES_API es_result es_world_destroy_mover(es_world* world, es_mover mover);

/* ---- rigid bodies ----------------------------------------------------------------------------------------------------------------------------- */

/* Bodies move in fixed steps of settings.step seconds, each solved in settings.substeps substeps as soft constraints: Catto, "Solver2D"
 * (2024), section Soft Step, in three dimensions. Lengths in metres, masses in kilograms; made for bodies of 0.01 … 100 m and
 * up to 500 m/s. Centres are kept in double, so a pile far from zero behaves like one at zero.
 *
 * What is survived: any dt that es_world_step takes; masses 1:1000 apart, the heavy one on the light one too (beyond that it presses it out;
 * more substeps hold more); bodies that begin deep inside each other (pushed apart at 3 m/s at most). What is refused, with a message: numbers that are not finite,
 * negative mass or density, shapes without volume where mass is asked of them. Speeds are limited to 1000 m/s, and to a turn by half a
 * circle per step. */

typedef struct es_body { uint32_t id; } es_body;
typedef enum es_body_type { ES_BODY_STATIC, ES_BODY_KINEMATIC, ES_BODY_DYNAMIC } es_body_type;
typedef struct es_body_desc {
    const char* name;
    es_body_type type;
    es_node node;             /* its axes are the body's. A dynamic body drives it; a kinematic one follows it with the speed that takes it
                               * there within a step; a static one jumps when it is set anew. Scale is not the body's: shapes have their
                               * own. A dynamic body's node must not be below a scaled one. Null: the body starts at `position` */
    double position[3];       /* without a node */
    es_quat rotation;         /* without a node; all zero counts as the identity */
    const es_shape_desc* shapes;
    uint32_t shape_count;     /* 0 … 4096; a dynamic body without shapes needs a mass, and turns as a sphere of radius 0.5 would */
    float mass;               /* kg, 0: by density; the inertia scales with it. 1e-6 … 1e9 */
    es_vec3 velocity, angular_velocity; /* of the centre of mass, m/s; rad/s */
    float linear_damping, angular_damping; /* 1/s: speed falls by v / (1 + damping t) */
    float gravity_scale;      /* 1 by es_default_body_desc */
    bool no_sleep;            /* never falls asleep, nor does what touches it */
    bool asleep;              /* begins asleep */
    bool continuous;          /* swept against dynamic bodies too; against static ones every fast body is */
} es_body_desc;
ES_API es_body_desc es_default_body_desc(void); /* dynamic, gravity_scale 1 */
ES_API es_result es_world_add_body(es_world* world, const es_body_desc* desc, es_body* body);
/* What touched it wakes up. WRONG_STATE while a joint refers to it. */
ES_API es_result es_world_destroy_body(es_world* world, es_body body);

typedef struct es_body_state {
    es_body_type type;
    es_node node;
    double position[3];       /* of the body's own axes, at the last fixed step; nodes show it between the last two */
    es_quat rotation;
    double centre[3];         /* of mass */
    es_vec3 local_centre;     /* the same in the body's axes */
    es_vec3 velocity, angular_velocity; /* of the centre of mass */
    float mass;               /* 0: static and kinematic */
    float kinetic_energy;     /* J, of motion and turning; 0: static and kinematic */
    float linear_damping, angular_damping, gravity_scale;
    uint32_t shape_count;
    bool no_sleep, asleep, continuous;
} es_body_state;
ES_API es_result es_world_get_body(const es_world* world, es_body body, es_body_state* state);
/* Sets it down elsewhere, without passing what is between; wakes it and what it touched. */
ES_API es_result es_world_set_body_pose(es_world* world, es_body body, const double position[3], es_quat rotation);
/* These four wake it; on static bodies they are refused, forces and impulses on kinematic ones do nothing. `at`: world coordinates, NULL: the
 * centre of mass. A force acts during the next fixed step only. */
ES_API es_result es_world_set_body_velocity(es_world* world, es_body body, es_vec3 velocity, es_vec3 angular_velocity);
ES_API es_result es_world_apply_impulse(es_world* world, es_body body, es_vec3 impulse, const double at[3]);
ES_API es_result es_world_apply_force(es_world* world, es_body body, es_vec3 force, const double at[3]);
ES_API es_result es_world_wake_body(es_world* world, es_body body);

/* What began and ended to touch during the last es_world_step, in the order of its fixed steps, within one by bodies and shapes. Touching is
 * predicted: a pair enters when its surfaces will meet within the fixed step, as far as can be told before it, so that the event may come before
 * they touch, and when another contact turns them aside they may not touch at all. Pairs that only the solver pressed together follow after
 * the others of that step. A pair that ends because one of them is destroyed is reported as left, with a stale handle. Valid until the next step or change of bodies. */
typedef struct es_contact_event {
    es_body a, b;
    uint32_t shape_a, shape_b; /* indices into the descs' shapes */
    bool enter;               /* else leave; then the normal, point and speed are zero */
    bool sensor;              /* one of the shapes is */
    es_vec3 normal;           /* from a to b */
    double point[3];
    float speed;              /* at which they approached, m/s */
} es_contact_event;
ES_API const es_contact_event* es_world_contact_events(const es_world* world, size_t* count);

/* ---- asking where bodies are --------------------------------------------------------------------------------------------------------------------- */

/* Against the shapes as they stand after the last fixed step (sensors too), those of whose categories one is in `mask` (0: all). World
 * coordinates. Several threads may ask while nothing changes the world. */

typedef struct es_ray_contact {
    es_body body;
    uint32_t shape;           /* index into its desc's shapes */
    uint32_t triangle;        /* of a mesh shape's mesh; else 0 */
    float distance;           /* m, along the ray */
    es_vec3 normal;           /* of the surface, towards the ray's origin */
    double point[3];
} es_ray_contact;
/* The first shape met within `max` metres; of equally near ones that of the lower body. The direction need not be unit. A ray that begins
 * inside a convex shape meets it at distance 0. False when there is none, or (with a message) when an argument is out of range. */
ES_API bool es_world_cast_ray(const es_world* world, const double origin[3], es_vec3 direction, float max, uint32_t mask, es_ray_contact* contact);

typedef struct es_closest {
    es_body body;
    uint32_t shape, triangle; /* as above */
    float distance;           /* m; negative: the point is so deep inside the shape */
    es_vec3 normal;           /* of the surface there; of a mesh: towards the point asked from */
    double point[3];          /* on the surface */
} es_closest;
/* The nearest surface within max_distance; inside of shapes the one that holds the point most deeply. False: as above. */
ES_API bool es_world_closest_point(const es_world* world, const double point[3], float max_distance, uint32_t mask, es_closest* closest);

/* The bodies that a shape touches or overlaps at a place, in slot order. *count is the capacity in, the number of bodies out (it may be larger);
 * bodies NULL asks for it. The desc's own position and rotation count, its filter and materials do not. A mesh is refused. */
ES_API es_result es_world_overlap(es_world* world, const es_shape_desc* shape, const double position[3], es_quat rotation, uint32_t mask,
    es_body* bodies, size_t* count);

/* ---- joints between bodies --------------------------------------------------------------------------------------------------------------------- */

typedef struct es_joint { uint32_t id; } es_joint;
typedef enum es_joint_type {
    ES_JOINT_BALL,            /* the frames' origins stay together */
    ES_JOINT_HINGE,           /* and so do their z axes, about which b turns: 0 where the x axes agree */
    ES_JOINT_DISTANCE,        /* the origins stay `length` apart, by a rod, a spring, or within limits */
    ES_JOINT_FIXED,           /* the frames stay together */
    ES_JOINT_MOTOR            /* the frames are pulled together by a spring, or b is driven relative to a, with limited force and torque */
} es_joint_type;

typedef struct es_joint_desc {
    const char* name;
    es_joint_type type;
    es_body a, b;             /* different; one may be null: the world's own axes */
    es_vec3 position_a, position_b; /* the joint's frame in each body's axes */
    es_quat rotation_a, rotation_b; /* all zero: none */
    bool collide_connected;   /* a and b may touch */
    bool limit;               /* HINGE: angle in [lower, upper], within -3.1 … 3.1; DISTANCE: length in [lower, upper] */
    float lower, upper;
    bool motor;               /* HINGE: turns at `speed` (b relative to a, rad/s) as far as `max_torque` (N m) allows; DISTANCE: grows at `speed` m/s with `max_force` */
    float speed;
    float length;             /* DISTANCE, m; negative: as they are when the joint is made */
    /* Softness: cycles per second of the spring, 1 is critical. hertz 0: rigid; HINGE: about its axis, to angle 0; MOTOR: no spring, the
     * velocities below drive */
    float hertz, damping_ratio;
    es_vec3 velocity, angular_velocity; /* MOTOR: of b relative to a, in a's frame */
    float max_force, max_torque; /* N, N m, 0 … 1e12 */
    float break_force, break_torque; /* above them the joint stops to hold, once and for all; 0: never */
} es_joint_desc;
ES_API es_joint_desc es_default_joint_desc(void); /* a ball joint, length -1 */
/* Sets both frames so that they lie at `point` (world coordinates), turned by `rotation`, as the bodies stand now. */
ES_API es_result es_world_place_joint(const es_world* world, es_joint_desc* desc, const double point[3], es_quat rotation);
/* Wakes both. INVALID_ARGUMENT when no side can move or a number is out of range. */
ES_API es_result es_world_add_joint(es_world* world, const es_joint_desc* desc, es_joint* joint);
/* Everything but name, type, a, b and collide_connected may change. */
ES_API es_result es_world_set_joint(es_world* world, es_joint joint, const es_joint_desc* desc);
ES_API es_result es_world_get_joint(const es_world* world, es_joint joint, es_joint_desc* desc);
/* What it does now: the force and torque on b in the last step (N, N m), the hinge's angle or the length, and whether
 * it broke. */
typedef struct es_joint_state { es_vec3 force, torque; float value; bool broken; } es_joint_state;
ES_API es_result es_world_get_joint_state(const es_world* world, es_joint joint, es_joint_state* state);
ES_API es_result es_world_destroy_joint(es_world* world, es_joint joint);

/* ---- hands: what a player holds --------------------------------------------------------------------------------------------------------------------- */

/* A hand pulls a point of a body to a place by a critically damped spring of 6 Hz. Hands belong to the world's state, not to its content: saving and
 * rewinding work while something is held. */
enum { ES_HANDS = 4 };
typedef struct es_hand_state {
    es_body body;             /* held, or null */
    uint32_t soft, vertex;    /* a soft body's handle and which of its vertices, or 0 */
    es_vec3 local_point;      /* in the body's axes */
    double target[3];
    float max_force;          /* N */
    es_vec3 impulse, turn;    /* of the last substep, N s and N m s */
} es_hand_state;
/* What the hand held before is let go. max_force 0: 1000 times the body's mass. */
ES_API es_result es_world_grab_body(es_world* world, uint32_t hand, es_body body, es_vec3 local_point, const double target[3], float max_force);
ES_API es_result es_world_move_hand(es_world* world, uint32_t hand, const double target[3]);
ES_API es_result es_world_release(es_world* world, uint32_t hand);
ES_API es_result es_world_get_hand(const es_world* world, uint32_t hand, es_hand_state* state);

/* ---- cloth and soft bodies ------------------------------------------------------------------------------------------------------------------ */

/* Particles under gravity, held together by constraints with compliances: extended position-based dynamics (Macklin, Müller, Chentanez 2016)
 * in small steps of one iteration each (Macklin et al. 2019). A cloth's particles are its mesh's vertices, those at one place welded; its
 * edges resist stretch, its diagonals shear, what lies across its edges bending. A solid's particles span tetrahedra, which keep their
 * volume, and carry a mesh inside them. Both collide with the shapes of bodies (and push dynamic ones), a cloth also with itself. They are
 * simulated along the world's axes, where the node stood when they were added, and written back into the mesh in the node's axes, normals
 * recomputed, so that they are where the simulation says wherever the node goes. The mesh is theirs: one soft body per mesh. */

/* Of a solid. Arrays belong to whoever made it: es_soft_fill's are freed with es_soft_solid_free. Places in the mesh's axes. */
typedef struct es_soft_solid {
    uint32_t particle_count, tetrahedron_count;
    float* particles;         /* 3 per particle */
    uint32_t* tetrahedra;     /* 4 particles each, either orientation */
} es_soft_solid;
/* Cubes of edge `spacing` (metres of the mesh) that meet the inside of a closed mesh, five tetrahedra each. INVALID_ARGUMENT when that would
 * be more than 2^18 cubes in the mesh's box, or none. A mesh that is not closed is filled where a line along x crosses it an odd number of times. */
ES_API es_result es_soft_fill(const es_world* world, es_mesh mesh, float spacing, es_soft_solid* solid);
ES_API void es_soft_solid_free(const es_world* world, es_soft_solid* solid); /* zeroes *solid; a zero one is allowed */

/* What holds a vertex: a node, a body (which feels the pull), or, both null, the world. */
typedef struct es_soft_attachment {
    uint32_t vertex;          /* of the mesh; a solid's: the particle's number */
    es_node node;
    es_body body;
    bool in_place;            /* held where it is now, `local` is not read */
    es_vec3 local;            /* in the axes of node, body or world */
} es_soft_attachment;

/* Start from es_default_soft_desc. Out of range is INVALID_ARGUMENT. */
typedef struct es_soft_desc {
    const char* name;
    es_mesh mesh;
    es_node node;             /* of the instance that shows the mesh; null: the world's axes */
    const es_soft_solid* solid; /* NULL: a cloth. Copied */
    float mass;               /* kg, of the whole, 1e-6 … 1e6, by area or volume over the particles. Default 1 */
    float stretch_compliance, shear_compliance; /* m/N, 0 … 1e6. Default 0: as stiff as the substeps make it. Edges of a solid: stretch */
    float bend_compliance;    /* m/N; negative: nothing resists bending. Default 0.1 */
    float volume_compliance;  /* m³·m³/J, of each tetrahedron. Default 0 */
    float damping;            /* share of the velocity lost per second, 1/s, 0 … 1e3. Default 0.3 */
    float thickness;          /* m, 0 … 10: kept from shapes, and between parts of itself. Default 0.02 */
    float friction;           /* 0 … 10, the larger of it and the shape's counts. Default 0.4 */
    float drag;               /* of air against the surface, kg/(m² s), 0 … 1e3. Default 0.1 */
    es_vec3 wind;             /* the air's velocity, m/s, up to 1e3 */
    float pressure;           /* Pa inside a closed cloth at its rest volume V₀, falling as V₀/V; -1e6 … 1e6 */
    float gravity_scale;      /* -100 … 100. Default 1 */
    bool self_collision;      /* cloth only */
    float tear_stretch;       /* cloth: an edge longer than this many times its rest length tears; 0: never, else 1.01 … 1e3 */
    bool tearable;            /* cloth: es_world_soft_tear may be called (vertices are kept in reserve); set by tear_stretch */
    uint32_t substeps;        /* per fixed step, 1 … 1024; 0: by the number of particles */
    const es_soft_attachment* attachments; uint32_t attachment_count;
} es_soft_desc;
ES_API es_soft_desc es_default_soft_desc(void);

/* The mesh must have no soft body or skin yet. Where the cloth may tear, its mesh gets more vertices (copies of others until they are needed);
 * where the reserve is used up, torn triangles vanish instead of parting. */
ES_API es_result es_world_add_soft(es_world* world, const es_soft_desc* desc, es_soft* soft);
/* The mesh stays as it is. */
ES_API es_result es_world_destroy_soft(es_world* world, es_soft soft);
/* The numbers in use; attachments and solid are NULL. */
ES_API es_result es_world_get_soft(const es_world* world, es_soft soft, es_soft_desc* desc);
/* Takes compliances, damping, friction, drag, wind, pressure, gravity_scale, tear_stretch, thickness and self_collision, leaves the rest; wakes it. */
ES_API es_result es_world_set_soft(es_world* world, es_soft soft, const es_soft_desc* desc);

typedef struct es_soft_state {
    uint32_t particles, triangles; /* torn: more particles, and perhaps fewer triangles, than at first */
    uint32_t attachments, torn;    /* held vertices; vertices that have parted */
    bool asleep;                   /* at rest: it is not computed, and its mesh keeps its bits */
    float largest_stretch;         /* length over rest length of the worst of the mesh's (a solid: of the tetrahedra's) edges */
    float volume, rest_volume;     /* of the tetrahedra; a cloth: enclosed by its triangles, of meaning only when they are closed */
    float kinetic_energy;          /* J */
    double centre[3];              /* of mass, world */
} es_soft_state;
ES_API es_result es_world_get_soft_state(const es_world* world, es_soft soft, es_soft_state* state);
/* Where the simulation has it (not interpolated), and its velocity (may be NULL). Solid: particle. INVALID_ARGUMENT when there is no such vertex. */
ES_API es_result es_world_get_soft_vertex(const es_world* world, es_soft soft, uint32_t vertex, double position[3], es_vec3* velocity);
/* N s, on the particle of the vertex, or with ES_SOFT_ALL shared by all by their mass. */
#define ES_SOFT_ALL 0xffffffffu
ES_API es_result es_world_soft_impulse(es_world* world, es_soft soft, uint32_t vertex, es_vec3 impulse);
/* A vertex that is held already is held anew. */
ES_API es_result es_world_soft_attach(es_world* world, es_soft soft, const es_soft_attachment* attachment);
/* OK also when nothing held the vertex. INVALID_ARGUMENT when there is no such vertex; OUT_OF_MEMORY, or MEMORY_CAP: held as before, and so above. */
ES_API es_result es_world_soft_detach(es_world* world, es_soft soft, uint32_t vertex_or_all);
/* Vertices within `radius` of `point` part into one for each of their triangles, edges that only pass through there tear. WRONG_STATE when it is
 * not tearable. */
ES_API es_result es_world_soft_tear(es_world* world, es_soft soft, const double point[3], float radius);
/* A hand (see above) holds the vertex (a solid's particle) and takes it along with up to 10 m/s. */
ES_API es_result es_world_grab_soft(es_world* world, uint32_t hand, es_soft soft, uint32_t vertex, const double target[3]);
ES_API es_result es_world_wake_soft(es_world* world, es_soft soft);

typedef struct es_soft_contact { es_soft soft; uint32_t vertex /* nearest of the triangle; solid: particle */; float distance; es_vec3 normal; double point[3]; } es_soft_contact;
/* The first triangle of any soft body that a ray from `origin` meets within `max` metres, from either side; soft null: none. */
ES_API es_result es_world_soft_pick(const es_world* world, const double origin[3], es_vec3 direction, float max, es_soft_contact* contact);

/* ---- reflection edits: what mirrors are to show instead --------------------------------------------------------------------------- */

/* Reflection editing (Ritschel, thesis, chapter 7): a constraint says what is to be seen in a mirror at one place of it, a region where in the scene
 * that may change anything. Both are data of the world: named, enumerated, part of the saved state and of recordings, in glTF files and undone; what is made
 * of them is for the light above to say. Other than the rest of the world's objects they are whole in the saved state: restoring one brings back the edits that
 * there were, under the handles they had.
 *
 * They hold on to surfaces without keeping them alive: where an instance or a triangle is gone, an edit has no effect, which es_world_get_constraint_state and
 * es_world_get_region_state tell with the reason. It takes effect again when what it needs is there again, as after undoing. */

typedef enum es_anchor_kind {
    ES_ANCHOR_NONE,
    ES_ANCHOR_POINT,          /* a place of the world, or, with an instance, of its node's axes */
    ES_ANCHOR_SURFACE         /* a place on a triangle, which it follows wherever node, skin, morph targets or cloth take it */
} es_anchor_kind;
typedef struct es_anchor {
    es_anchor_kind kind;
    es_instance instance;     /* SURFACE: whose surface; POINT: in whose node's axes, null: the world's */
    uint32_t triangle;        /* SURFACE: of its mesh … */
    float u, v;               /* … and where on it: (1 - u - v) · first + u · second + v · third vertex; neither negative, u + v at most 1 */
    double point[3];          /* POINT: metres */
} es_anchor;

/* On a triangle; u and v are taken to the nearest that lie on it. INVALID_ARGUMENT when the mesh has no such triangle. */
ES_API es_result es_world_anchor_of_triangle(const es_world* world, es_instance instance, uint32_t triangle, float u, float v, es_anchor* anchor);
/* The place of the instance's surface that is nearest to a point of the world. A kind of NONE when it has no surface. The first time for a mesh, and once after each
 * change of its vertices, that takes some milliseconds per 100 000 triangles; otherwise microseconds. OUT_OF_MEMORY, MEMORY_CAP. */
ES_API es_result es_world_anchor_of_point(const es_world* world, es_instance instance, const double point[3], es_anchor* anchor);
/* Where a ray first meets a surface that is not hidden, from either side, within `max` metres; a kind of NONE when it meets none. direction need not be unit. Costs
 * as the above for each instance whose box it passes. */
ES_API es_result es_world_anchor_of_ray(const es_world* world, const double origin[3], es_vec3 direction, float max, es_anchor* anchor);
/* Where it is now, in the world; and the unit normal that the surface has there, from its vertices' (0 of a POINT). Either may be NULL. False, and nothing is
 * written, for a kind of NONE, and where the instance is gone or has no such triangle. */
ES_API bool es_world_resolve_anchor(const es_world* world, const es_anchor* anchor, double position[3], es_vec3* normal);

typedef enum es_region_type {
    ES_REGION_EUCLIDEAN,      /* what lies within `radius` of `centre`, on whatever surface */
    ES_REGION_GEODESIC,       /* within `radius` over the surface that `centre` is on */
    ES_REGION_FREE_FORM       /* drawn on one surface: where strokes have been */
} es_region_type;
/* A round brush drawn from one place to another of the same instance: what lies within `radius` of the line between them is in the region, or, `erase`, no longer is.
 * The distance is taken through space: strokes are short. Later ones go over earlier ones. */
typedef struct es_region_stroke { es_anchor from, to; float radius; bool erase; } es_region_stroke;
typedef struct es_region_desc {
    const char* name;
    es_region_type type;
    es_anchor centre;         /* GEODESIC: on a surface; not read of FREE_FORM */
    float radius;             /* metres, 0 … 1e9; not read of FREE_FORM */
    float border;             /* metres, 0 … 1e9: over which, inwards from the edge, the region fades: 1 - smoothstep(radius - border, radius, distance) */
    const es_region_stroke* strokes; /* FREE_FORM: copied; anchors on surfaces of one instance */
    uint32_t stroke_count;    /* up to 4096 */
    bool off;
} es_region_desc;
ES_API es_region_desc es_default_region_desc(void); /* Euclidean, radius 0.5, border 0.2, without a centre */
/* INVALID_ARGUMENT when a number is not finite or outside its range. Anchors on what does not exist are accepted: the region has no effect. */
ES_API es_result es_world_add_region(es_world* world, const es_region_desc* desc, es_region* region);
/* The name stays. */
ES_API es_result es_world_set_region(es_world* world, es_region region, const es_region_desc* desc);
/* name and strokes belong to the world and are valid until the region is changed. */
ES_API es_result es_world_get_region(const es_world* world, es_region region, es_region_desc* desc);
ES_API es_result es_world_destroy_region(es_world* world, es_region region);

/* What the keys of a constraint go by. */
typedef enum es_edit_parameter_kind {
    ES_EDIT_TIME,             /* the world's, seconds */
    ES_EDIT_CAMERA,           /* a coordinate of a camera's place; null: of the active one */
    ES_EDIT_NODE,             /* of a node's */
    ES_EDIT_LIGHT,            /* a light's intensity; 0 while it is off */
    ES_EDIT_NAMED             /* a number of the world, es_world_set_parameter; 0 until it is set */
} es_edit_parameter_kind;
typedef struct es_edit_parameter {
    es_edit_parameter_kind kind;
    es_camera camera;
    es_node node;
    es_light light;
    uint32_t axis;            /* CAMERA, NODE: 0 x, 1 y, 2 z, in the world */
    const char* name;         /* NAMED: copied; 1 … 63 bytes */
} es_edit_parameter;
typedef struct es_constraint_key { float at; es_anchor reflecting, reflected; es_vec3 direction; } es_constraint_key;

typedef struct es_constraint_desc {
    const char* name;
    es_anchor reflecting;     /* the red handle: where in the mirror, on a surface … */
    es_anchor reflected;      /* … and the green one: what is to be seen there; not read of `refraction` */
    bool refraction;          /* where light leaves the thing is edited (§7.6.1): */
    es_vec3 direction;        /* refraction: the way it is to go on, in the axes of the reflecting instance's node; need not be unit */
    double eye[3];            /* the generating view: from where the mirror was looked into when the constraint was made … */
    es_quat orientation;      /* … and how, looking along -z: all zero: none. For going back to it; the light reads the place alone */
    float fov_y;              /* radians, 0 … 3.1; 0: that of the camera */
    bool follows_view;        /* holds for wherever the active camera is, instead of for the generating view */
    bool geodesic;            /* its weight falls with the distance over the surface instead of through space (§7.5.2) */
    es_edit_parameter parameter; /* what the keys go by */
    const es_constraint_key* keys; /* copied; `at` strictly increasing. Without keys: as above. Between two, places and direction go in a straight line, and the red handle
                               * from there to the nearest place of its surface; before the first and after the last they stay. Where the two keys' red handles are on
                               * different instances it changes over at the second */
    uint32_t key_count;       /* up to 4096 */
    bool off;
} es_constraint_desc;
ES_API es_constraint_desc es_default_constraint_desc(void);
/* As of regions. Refused too: keys whose `at` do not increase; a refraction without a direction. */
ES_API es_result es_world_add_constraint(es_world* world, const es_constraint_desc* desc, es_constraint* constraint);
ES_API es_result es_world_set_constraint(es_world* world, es_constraint constraint, const es_constraint_desc* desc);
/* name, parameter.name and keys belong to the world and are valid until the constraint is changed. */
ES_API es_result es_world_get_constraint(const es_world* world, es_constraint constraint, es_constraint_desc* desc);
ES_API es_result es_world_destroy_constraint(es_world* world, es_constraint constraint);

/* Is it in es_world_edits, and if not, why. */
typedef enum es_edit_effect {
    ES_EDIT_ACTIVE,
    ES_EDIT_OFF,              /* its desc says so */
    ES_EDIT_UNPLACED,         /* an anchor's kind is NONE, there are no strokes, or what must be on a surface is not */
    ES_EDIT_STALE,            /* an anchor's instance or triangle is gone */
    ES_EDIT_NO_PARAMETER,     /* the node, camera or light its keys go by is gone */
    ES_EDIT_NO_DIRECTION,     /* its two handles are at the same place */
    ES_EDIT_NO_MEMORY         /* for its distances over the surface */
} es_edit_effect;
ES_API const char* es_edit_effect_text(es_edit_effect effect); /* one clause, e.g. "the instance it is on is gone" */
typedef struct es_constraint_state {
    es_edit_effect effect;
    double position[3], target[3]; /* where its handles are now; 0 where they have no place. Refraction: target is position */
    es_vec3 normal;           /* of the surface at position */
    es_anchor reflecting;     /* where the red handle is now, between keys too */
    float influence;          /* the largest that a region has at it: 0, and the constraint is in none */
    float parameter;          /* what its keys go by is now; 0 without keys */
} es_constraint_state;
ES_API es_result es_world_get_constraint_state(const es_world* world, es_constraint constraint, es_constraint_state* state);
typedef struct es_region_state {
    es_edit_effect effect;
    double centre[3];         /* where it is now; of free forms the mean of their strokes' ends */
    es_vec3 normal;           /* of the surface there; 0 where it is on none */
} es_region_state;
ES_API es_result es_world_get_region_state(const es_world* world, es_region region, es_region_state* state);
/* Of one region at a place: 0 … 1; 0 where the place or the region has no effect. */
ES_API float es_world_region_influence(const es_world* world, es_region region, const es_anchor* anchor);

/* Numbers by name that edits may go by: up to 1024, names of 1 … 63 bytes, values within 1e9; state of the world. */
ES_API es_result es_world_set_parameter(es_world* world, const char* name, float value);
ES_API float es_world_get_parameter(const es_world* world, const char* name); /* 0 when it was never set */

/* §7.2.3: reflections as seen from `eye`, wherever the camera goes, until it is NULL. State of the world. INVALID_ARGUMENT when not finite or beyond 1e9. */
ES_API es_result es_world_freeze_reflections(es_world* world, const double eye[3]);
ES_API bool es_world_frozen_reflections(const es_world* world, double eye[3]); /* eye may be NULL; not written when they are not frozen */

/* Distances over a surface, in metres of the world (the node's scale counts, as of present vertices), from a place of it to each vertex of its mesh, by the vertices'
 * numbers; INFINITY beyond max_distance and where no way leads: meshes may consist of parts. Vertices at one place are one, so that seams are none. */
typedef enum es_geodesic_method {
    ES_GEODESIC_FRONT,        /* over the triangles: a wave front from a point source through unfolded triangles, until nothing becomes shorter. Exact on planes and what unrolls;
                        * on a sphere off by 1 % of the mean distance with 768 triangles and 0.03 % with 500,000 (`earthshine bench geodesic`) */
    ES_GEODESIC_EDGES         /* along edges (Dijkstra), from the source's nearest vertex: the thesis' (§7.5.2). Too long by 5 to 6 % in the mean however fine the mesh, across the
                               * diagonals of squares by 41 % */
} es_geodesic_method;
/* max_distance: 0 or less: all. distances: as many as the mesh has vertices. INVALID_ARGUMENT when there is no such triangle. */
ES_API es_result es_world_geodesic(const es_world* world, es_instance instance, uint32_t triangle, float u, float v, es_geodesic_method method, float max_distance, float* distances);
/* At a place of a triangle with edges of squared lengths |second - first|², |third - second|², |first - third|² from the distances of its corners:
 * d² = sum b_i d_i² - sum b_i b_j |v_i - v_j|², exact for a point source in its plane. INFINITY when a corner's is. */
ES_API float es_geodesic_between(const float corners[3], const float edges_squared[3], float u, float v);

/* Undo and redo of regions and constraints (parameters and frozen reflections stay): moments of a world, kept as copies. What comes back has the handle it had. A history
 * is destroyed before its world; several may watch one. max_bytes: of the copies, 0: 16 MB; the oldest are given up first. */
ES_API es_result es_edit_history_create(es_world* world, size_t max_bytes, es_edit_history** history);
ES_API void es_edit_history_destroy(es_edit_history* history); /* NULL: nothing */
/* The present is a moment to come back to, `label` (NULL: "") what led there; what was undone can no more be redone. Nothing happens where nothing has changed. */
ES_API es_result es_edit_history_commit(es_edit_history* history, const char* label);
/* One moment back, or on; what has changed since the last is committed first, so that it can be redone. OK, and nothing, at the end. */
ES_API es_result es_edit_history_undo(es_edit_history* history);
ES_API es_result es_edit_history_redo(es_edit_history* history);
/* What undo would take back and redo do again, as far as it has been committed; NULL: nothing. */
ES_API const char* es_edit_history_undo_label(const es_edit_history* history);
ES_API const char* es_edit_history_redo_label(const es_edit_history* history);

/* Edits in a glTF file: extras of its scene, which es_world_import_gltf reads too (SI units, members as in the descs, all optional where they have a default):
 *   "extras": {"earthshine": {"edits": {"version": 1, "parameters": {NAME: value …},
 *     "regions": [{"name", "type": "euclidean" | "geodesic" | "freeForm", "centre": ANCHOR, "radius", "border", "off",
 *                  "strokes": [{"from": ANCHOR, "to": ANCHOR, "radius", "erase"} …]} …],
 *     "constraints": [{"name", "reflecting": ANCHOR, "reflected": ANCHOR, "refraction", "direction": [x, y, z], "eye": [x, y, z],
 *                      "orientation": [x, y, z, w], "fovY", "followsView", "geodesic", "off",
 *                      "parameter": {"kind": "time" | "camera" | "node" | "light" | "named", "camera" or "node" or "light": NAME, "index", "axis": "x" | "y" | "z", "name"},
 *                      "keys": [{"at", "reflecting": ANCHOR, "reflected": ANCHOR, "direction"} …]} …]}}}
 *   ANCHOR: {"node": NAME, "instance": which of that node's (0), "index": which of all, "triangle", "u", "v"}, or {"point": [x, y, z]}, in a node's axes with "node".
 * An "index" says which of several things by one name is meant, and which of those without. */

/* Puts a file's regions and constraints in the place of those there are, and sets its parameters; what stood there before can be undone. A file of the edits alone, or the whole of a
 * glTF file. FILE_DAMAGED when something in it is wrong or names what the world does not have; nothing is changed then. Members that are not known are warned of. */
ES_API es_result es_world_load_edits(es_world* world, const char* path);
/* source NULL: a glTF file of the edits alone. Otherwise a copy of that .gltf or .glb file, from which the world was opened, with the edits in its scene's extras and
 * every other byte as it was. Reading them again gives the same bits. What is stale or has no place is left out with a warning. Whole or not at all; path may be that of
 * the source. FILE_UNSUPPORTED when the source has no scene, or files beside it that are not beside `path`. */
ES_API es_result es_world_save_edits(const es_world* world, const char* source, const char* path);

/* What the light reads of the edits: those in effect, in slot order, resolved; places relative to es_world_origin. */
#define ES_EVERY_INSTANCE 0xffffffffu
typedef struct es_resolved_stroke { es_vec3 from, to; float radius; bool erase; } es_resolved_stroke;
typedef struct es_resolved_region {
    es_region handle;
    es_region_type type;
    es_vec3 centre;
    float radius, border;
    uint32_t instance;        /* slot, as in the draw list's ids; EUCLIDEAN: ES_EVERY_INSTANCE */
    const es_resolved_stroke* strokes; /* FREE_FORM: distance = min over strokes of (distance to the line - radius), with erase max(distance, radius - …), in order */
    uint32_t stroke_count;
    const float* distances;   /* GEODESIC: per vertex of the instance's mesh; reaches at least as far as the radius, INFINITY beyond. Otherwise NULL */
} es_resolved_region;
typedef struct es_resolved_constraint {
    es_constraint handle;
    uint32_t instance, triangle; /* of the red handle */
    float u, v;
    es_vec3 position, normal; /* of the red handle */
    es_vec3 eye;              /* for which it holds: the generating view's, or the active camera's */
    es_vec3 target;           /* the green handle; refraction: position + direction */
    es_vec3 direction;        /* edited, unit */
    bool refraction;
    const float* distances;   /* with es_constraint_desc.geodesic: per vertex of the red handle's mesh. Otherwise NULL */
} es_resolved_constraint;
typedef struct es_edit_list {
    const es_resolved_region* regions;
    const es_resolved_constraint* constraints;
    uint32_t region_count, constraint_count;
    bool frozen;
    es_vec3 eye;              /* frozen: of the frozen view */
} es_edit_list;
/* Never NULL but for a NULL world; made anew only where something it depends on has changed, by the count of es_world_revisions.edits. Valid until the world changes. */
ES_API const es_edit_list* es_world_edits(const es_world* world);

/* ---- destroying and enumerating ----------------------------------------------------------------------------------------------------------------- */

/* Refused (WRONG_STATE) while something that exists refers to the object. */
ES_API es_result es_world_destroy_texture(es_world* world, es_texture texture);
ES_API es_result es_world_destroy_material(es_world* world, es_material material);
ES_API es_result es_world_destroy_mesh(es_world* world, es_mesh mesh);
ES_API es_result es_world_destroy_node(es_world* world, es_node node);
ES_API es_result es_world_destroy_instance(es_world* world, es_instance instance);
ES_API es_result es_world_destroy_camera(es_world* world, es_camera camera);
ES_API es_result es_world_destroy_light(es_world* world, es_light light);
ES_API es_result es_world_destroy_clip(es_world* world, es_clip clip);
/* The mesh goes back to its shape without it. */
ES_API es_result es_world_destroy_skin(es_world* world, es_skin skin);

typedef enum es_object_kind {
    ES_OBJECT_TEXTURE,
    ES_OBJECT_MATERIAL,
    ES_OBJECT_MESH,
    ES_OBJECT_NODE,
    ES_OBJECT_INSTANCE,
    ES_OBJECT_CAMERA,
    ES_OBJECT_LIGHT,
    ES_OBJECT_CLIP,
    ES_OBJECT_MOVER,
    ES_OBJECT_SKIN,
    ES_OBJECT_BODY,
    ES_OBJECT_JOINT,
    ES_OBJECT_SOFT,
    ES_OBJECT_REGION,
    ES_OBJECT_CONSTRAINT,
    ES_OBJECT_KINDS
} es_object_kind;
/* Handles of all objects of a kind in creation-slot order; *count is the capacity in, the number of objects out; ids NULL asks for it. */
ES_API es_result es_world_enumerate(const es_world* world, es_object_kind kind, uint32_t* ids, size_t* count);
/* "" when unnamed; NULL for a stale handle. */
ES_API const char* es_world_name(const es_world* world, es_object_kind kind, uint32_t id);
/* Of the object's part of the saved state: where two worlds differ, this says in which object. Textures and materials have none. 0 for a stale
 * handle. */
ES_API uint64_t es_world_object_hash(const es_world* world, es_object_kind kind, uint32_t id);

/* ---- recording and replay -------------------------------------------------------------------------------------------------------------------------- */

/* A recording notes what its world is told between steps (transforms, cameras, lights, movers, clips, settings, skies; poses, velocities, impulses,
 * forces and joints of bodies; hands; what is done to cloth; reflection edits, also new ones; restored states), each step's dt, and hashes of what came of it. It begins
 * with a saved state, so it may begin at any time. Objects are not to be made or destroyed meanwhile, nor meshes, materials or environments
 * changed, nor a sky ended; what a step function does is not noted, as it is there again on replay. One thread at a time uses a recording and its world.
 *
 * From the next step on. `scene` and `settings` are any texts by which the world can be opened again, NULL: "". WRONG_STATE while the world is
 * recorded already. The recording is destroyed by the caller, before or after its world. */
ES_API es_result es_recording_begin(es_world* world, const char* scene, const char* settings, es_recording** recording);
/* The world takes no more notes. Destroying the recording, and the world, do the same. */
ES_API void es_recording_end(es_recording* recording);
ES_API void es_recording_destroy(es_recording* recording); /* NULL: nothing */
/* Whole or not at all. */
ES_API es_result es_recording_save(const es_recording* recording, const char* path);
/* FILE_TYPE or FILE_DAMAGED when it is none. */
ES_API es_result es_recording_load(es_context* context, const char* path, es_recording** recording);
ES_API uint32_t es_recording_steps(const es_recording* recording);
ES_API float es_recording_dt(const es_recording* recording, uint32_t step);
ES_API const char* es_recording_scene(const es_recording* recording);    /* valid while the recording is */
ES_API const char* es_recording_settings(const es_recording* recording);

/* Where a replay went another way. */
typedef struct es_divergence {
    bool differs;
    uint32_t step;            /* counted from 0 */
    es_object_kind kind;      /* of the first object that differs, causes before consequences: bodies, joints, cloth, clips, movers, nodes, … */
                              /* ES_OBJECT_KINDS: none does (time or settings do), or there are other objects than there were */
    uint32_t id;              /* its handle */
} es_divergence;
/* Puts the world, opened as the recorded one was, into the recording's first state. WRONG_STATE when its content is another. */
ES_API es_result es_recording_rewind(const es_recording* recording, es_world* world);
/* Does what was done before step number `step` and steps. After es_recording_rewind, for 0, 1, … in order. A failure of an input is returned. */
ES_API es_result es_recording_replay(const es_recording* recording, uint32_t step, es_world* world, es_divergence* divergence);

/* ---- what the light reads ---------------------------------------------------------------------------------------------------------------------------- */

/* Draw list, camera views, lights and bounds are relative to an origin in world coordinates, so that what is small beside its distance
 * from zero keeps its precision (nodes are placed in double). It is zero while the active camera is within 32 diagonals of the world's
 * bounds from zero, and otherwise near the camera: a multiple of 64 diagonals, rounded up to a power of two. Where it changes, the
 * geometry counts as changed. */
ES_API void es_world_origin(const es_world* world, double origin[3]);

/* Visible instances in slot order, with their transforms now and last frame; G-buffer id = slot index. */
ES_API const es_draw_list* es_world_draw_list(const es_world* world);

typedef struct es_light_state {
    es_light handle;
    es_light_type type;
    es_vec3 position, direction;      /* position: relative to es_world_origin; direction: the way the light travels along its axis, unit */
    float radiant[3];                 /* color × intensity: W/sr, or W/m² for directional */
    float cos_inner, cos_outer;       /* spot */
    float range;
} es_light_state;
/* Lights that are on and not black, in slot order. */
ES_API const es_light_state* es_world_lights(const es_world* world, size_t* count);

/* Each number goes up when something of its kind changes; equal numbers mean the same content, bit for bit,
 * across all worlds of one context. */
typedef struct es_world_revisions {
    uint64_t geometry;    /* transforms, meshes, instances */
    uint64_t materials;   /* materials and textures */
    uint64_t lights;      /* the environment among them */
    uint64_t environment; /* by itself */
    uint64_t camera;      /* active camera: which, its pose, its lens */
    uint64_t edits;       /* what es_world_edits hands out */
    uint64_t steps;       /* up by one with each es_world_step, by two or more where what was last frame is not the frame before: es_world_restore */
    bool moving;          /* some previous transform, vertex or view differs from the present one */
} es_world_revisions;
ES_API es_world_revisions es_world_get_revisions(const es_world* world);
/* Bounds of everything visible along the world's axes; false when there is nothing. */
ES_API bool es_world_bounds(const es_world* world, es_vec3* minimum, es_vec3* maximum);

#ifdef __cplusplus
}
#endif
#endif
