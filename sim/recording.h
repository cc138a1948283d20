/* What is noted of a world that is being recorded: the calls by which its user changes it. Public functions that change what moves
 * call es_note once they have succeeded; what the world calls from inside of a step, or to restore a state, is no input. */
#ifndef EARTHSHINE_SIM_RECORDING_H
#define EARTHSHINE_SIM_RECORDING_H

#include "sim/state_io.h"
#include "sim/world.h"

typedef enum es_input_type {
    ES_INPUT_RESTORE,         /* a saved state */
    ES_INPUT_CONFIGURE,
    ES_INPUT_NODE,
    ES_INPUT_CAMERA,
    ES_INPUT_ACTIVE_CAMERA,
    ES_INPUT_LIGHT,
    ES_INPUT_MOVER,
    ES_INPUT_CLIP,
    ES_INPUT_PLAY_CLIP,
    ES_INPUT_STOP_CLIP,       /* number: the fade */
    ES_INPUT_MORPH_WEIGHTS,   /* state: the weights */
    ES_INPUT_INSTANCE,
    ES_INPUT_BODY_POSE,
    ES_INPUT_BODY_VELOCITY,
    ES_INPUT_IMPULSE,
    ES_INPUT_FORCE,
    ES_INPUT_WAKE,
    ES_INPUT_JOINT,
    ES_INPUT_GRAB_BODY,
    ES_INPUT_MOVE_HAND,
    ES_INPUT_RELEASE,
    ES_INPUT_SOFT,
    ES_INPUT_SOFT_ATTACH,
    ES_INPUT_SOFT_DETACH,
    ES_INPUT_SOFT_TEAR,       /* number: the radius */
    ES_INPUT_SOFT_IMPULSE,
    ES_INPUT_SOFT_WAKE,
    ES_INPUT_GRAB_SOFT,
    ES_INPUT_SKY,
    ES_INPUT_REGION,          /* state: the whole object under its handle; nothing: it is gone */
    ES_INPUT_CONSTRAINT,      /* the same */
    ES_INPUT_EDITS,           /* state: all regions and constraints */
    ES_INPUT_PARAMETER,       /* state: the name; number: the value */
    ES_INPUT_FREEZE,          /* flag: frozen, seen from `place` */
    ES_INPUT_TYPES
} es_input_type;

typedef struct es_input {
    es_input_type type;
    uint32_t id;              /* the object's handle, or the hand */
    uint32_t other;           /* GRAB_BODY: the body; GRAB_SOFT: the soft body */
    uint32_t vertex;          /* of a soft body, or ES_SOFT_ALL */
    bool flag;                /* CLIP: plays; IMPULSE, FORCE: `place` was given; FREEZE */
    double place[3];
    es_vec3 a, b;
    float number;
    union {
        es_transform transform;
        es_camera_desc camera;
        es_light_desc light;
        es_mover_desc mover;
        es_clip_play clip;
        es_instance_desc instance;
        es_joint_desc joint;
        es_world_settings settings;
        es_quat rotation;
        es_soft_desc soft;    /* its numbers */
        es_soft_attachment attachment;
        es_sky_desc sky;
        struct { const void* bytes; size_t size; } state;
    };
} es_input;

/* Does nothing while nothing is recorded. What does not fit into memory is told by the recording's next function. */
void es_note(es_world* world, const es_input* input);
/* For who had no memory for what is to be noted. */
void es_recording_fail(es_world* world);
/* At the end of a step. */
void es_recording_note_step(es_world* world, float dt);
/* Between them nothing is noted. */
es_recording* es_recording_pause(es_world* world);
static inline void es_recording_resume(es_world* world, es_recording* recording) { world->recording = recording; }

/* ---- shared by sim/recording.c and sim/recording_file.c ---------------------------------------------------------------- */

typedef struct es_recorded_step {
    float dt;
    uint32_t objects;         /* how many hashes */
    uint64_t inputs, input_end; /* in `inputs`: what was done before the step */
    uint64_t first_hash;      /* in `hashes` */
    uint64_t hash;            /* of the world after the step */
} es_recorded_step;

struct es_recording {
    es_context* context;
    es_world* world;          /* being recorded; NULL: loaded, or ended */
    es_result failed;         /* of a note that could not be taken */
    char *scene, *settings;   /* zero-terminated */
    char* first;              /* the state at the beginning */
    size_t first_size;
    uint64_t first_hash;
    es_recorded_step* steps;
    size_t step_count, step_capacity;
    char* inputs;
    size_t input_count, input_capacity, noted; /* bytes; `noted`: up to the last step */
    uint32_t* hashes;         /* of the objects, step after step */
    size_t hash_count, hash_capacity;
};

es_recording* es_recording_make(es_context* context, const char* scene, size_t scene_size, const char* settings, size_t settings_size);
/* Reads the input at *at, moving on; false when it is damaged. With `world` its handles and numbers are left to the world's functions. */
bool es_input_read(const es_recording* recording, size_t* at, size_t end, es_input* input);

#endif
