/* Meshes that morph targets and skins move.
 *
 * Such a mesh is driven: its vertices follow from what does not move (rest streams, displacements, weights per joint) and from what does
 * (morph weights, the joints' nodes), and are computed when somebody looks after these have changed. So its vertices are no state; what is saved are
 * the weights and, for last frame's vertices, last frame's weights and joint matrices. */
#ifndef EARTHSHINE_SIM_DEFORM_H
#define EARTHSHINE_SIM_DEFORM_H

#include "platform/context.h"
#include "platform/platform.h"

struct es_mesh_object;

enum { ES_STREAM_POSITIONS, ES_STREAM_NORMALS, ES_STREAM_TANGENTS, ES_STREAMS };
enum { ES_MORPH_TARGETS = 65535, ES_SKIN_JOINTS = 65535, ES_SKIN_INFLUENCES = 16 };
/* vertices of one task: what it reads and writes stays in the caches near it */
enum { ES_DEFORM_GRAIN = 512 };

/* One target's displacements of one stream: 4 floats per vertex, the last zero, of vertices [begin, end), multiples of eight; none outside. */
typedef struct es_morph_stream { float* displacement; uint32_t begin, end; } es_morph_stream;

/* Weights of joints per vertex: rows of eight, one per vertex of a block of eight; block b has the rows first_row[b] … first_row[b + 1] - 1. */
typedef struct es_skin_weights {
    uint32_t* first_row;   /* blocks + 1 */
    uint32_t* joints;      /* 8 per row, 0 … joint_count (the last is the identity) */
    float* weights;        /* 8 per row; a vertex's sum to one */
    size_t row_count;
    uint32_t blocks;
} es_skin_weights;

enum { ES_JOINT_FLOATS = 12 };  /* three rows of four: of the matrix from the bind pose to the mesh's axes */

/* For kernels: vertices in blocks of eight, streams of 4 floats per vertex, NULL where there is none. `to` may be `from`. */
typedef struct es_skin_job {
    const es_skin_weights* weights;
    const float* palette;
    const float* from[ES_STREAMS];
    float* to[ES_STREAMS];
} es_skin_job;

typedef struct es_mesh_drive {
    uint32_t target_count;
    es_morph_stream* targets[ES_STREAMS];    /* target_count each */
    float *weights, *posed_weights, *previous_weights, *default_weights; /* posed: those of the present vertices */
    float* blended;                          /* of playing clips */
    float blended_share;                     /* of the weights of the clips in `blended` */
    bool blending;
    uint32_t played_by;                      /* the clip that took the mesh when the world was opened */
    uint32_t skin;                           /* handle; 0: none */
    float* chunk_bounds;                     /* 8 floats per task */
    bool stale;                              /* the vertices were never computed or belong to another state */
} es_mesh_drive;

#endif
