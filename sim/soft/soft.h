/* Inside of cloth and soft bodies: the object, and what one fixed step passes from part to part.
 *
 *   soft_bodies.c   objects and their public functions      soft_welding.c  from a mesh's vertices to particles, and to tetrahedra
 *   soft_layout.c   particles into bands, constraints into batches: everything that follows from the topology
 *   soft_anchors.c  what is held, and how far from it the others may be
 *   soft_step.c     one fixed step                          soft_obstacles.c shapes of bodies as the particles meet them
 *   soft_self.c     a cloth against itself                  soft_tear.c     topology changes
 *   soft_pose.c     back into the mesh                      soft_query.c    picking, state
 *   soft_fill.c     tetrahedra inside a closed mesh
 *
 * State are the topology (which particle is at which corner of which triangle), places, velocities and attachments, by particle. All else,
 * slots, bands, batches and anchors, is a function of the topology and the attachments alone, made anew where those change. */
#ifndef EARTHSHINE_SIM_SOFT_H
#define EARTHSHINE_SIM_SOFT_H

#include "platform/context.h"
#include "sim/normals.h"
#include "sim/soft/soft_kernels.h"
#include "sim/world.h"

#define ES_SOFT_SPEED 1000.0f      /* m/s: of each component of a particle's velocity */
#define ES_SOFT_SLEEP_SPEED 0.015f /* m/s: slower than that everywhere counts as still */
#define ES_SOFT_SLEEP_SECONDS 0.5f
#define ES_SOFT_NONE UINT32_MAX
enum { ES_SOFT_PLANES = 4, ES_SOFT_VERTICES = 1 << 20, ES_SOFT_OBSTACLES = 256 };

typedef enum es_soft_class { ES_SOFT_STRETCH, ES_SOFT_SHEAR, ES_SOFT_BEND } es_soft_class;

/* Neighbouring levels of the graph of constraints. A constraint reaches from its band into the next one at most, so all bands can
 * be solved at once, and then all seams between them. */
typedef struct es_soft_band {
    uint32_t begin, end;           /* slots, multiples of 8 */
    uint32_t links[4];             /* batches: own [0, 1), seam with the band before [2, 3) */
    uint32_t volumes[4];
} es_soft_band;

typedef struct es_soft_layout {
    es_arena arena;                /* of all below, and of the state by slot */
    uint32_t slot_count;           /* particles and padding */
    uint32_t* slot_of;             /* per particle */
    uint32_t* particle_of;         /* per slot; padding: ES_SOFT_NONE */
    es_soft_band* bands;
    uint32_t band_count;
    es_soft_links* links;
    uint32_t link_count;           /* batches */
    uint8_t *kinds, *edges;        /* per batch lane: es_soft_class; is it an edge of the mesh, which can stretch and tear? */
    es_soft_volumes* volumes;
    uint32_t volume_count;
    uint32_t* indices;             /* of the triangles that are there, in slots */
    uint32_t triangle_count;
    es_vertex_fans fans;           /* over slots */
    bool made;
} es_soft_layout;

typedef struct es_soft_hold {      /* an attachment as it is kept */
    uint32_t particle;
    uint32_t node, body;
    es_vec3 local;
} es_soft_hold;

typedef struct es_soft_anchors {
    es_arena arena;
    uint32_t* index[2];            /* per slot: of holds */
    float* reach[2];
    float *start, *end;            /* 4 per hold, then per hand */
    bool active;                   /* some particle is within reach of one */
    bool made;
} es_soft_anchors;

typedef struct es_soft_plane {     /* contact of one particle with one shape for one step */
    es_vec3 normal;
    float offset;                  /* normal · x >= offset, relative to the body's origin */
    es_vec3 velocity;              /* of the shape's surface there */
    uint32_t obstacle;
} es_soft_plane;

struct es_body_object;
struct es_rigid_shape;
typedef struct es_soft_obstacle {
    struct es_body_object* body;   /* NULL: for tests, a capsule that belongs to nobody */
    const struct es_rigid_shape* shape;
    es_vec3 a[2], b[2];            /* capsule: its ends at the begin and the end of the step */
    es_vec3 centre[2];             /* of mass */
    es_vec3 turned;                /* rotation vector over the step */
    es_vec3 low, high;             /* over the whole step, thickness included */
    float radius, friction;
    bool capsule;                  /* else by planes */
    bool pushed;                   /* dynamic */
} es_soft_obstacle;

typedef struct es_soft_object {
    es_object object;
    es_arena arena;                /* of what it is made of */
    es_soft_desc desc;             /* resolved; name, solid, attachments NULL */
    /* what it is made of: assets */
    uint32_t particle_count, particle_room; /* now; with reserve */
    uint32_t first_particles;      /* when added */
    float* rest;                   /* 3 per particle, metres at the world's scale: lengths are taken from it */
    float* mass;                   /* per particle, kg */
    uint32_t triangle_count;       /* cloth: the mesh's; those with a corner ES_SOFT_NONE are gone */
    uint32_t* corners;             /* particles, 3 per triangle: state when it may tear */
    uint32_t tetrahedron_count;
    uint32_t* tetrahedra;
    /* mesh */
    uint32_t vertex_count, vertex_used; /* the mesh's, of which used */
    uint32_t first_vertices;       /* when added: without the reserve */
    uint32_t* particle_at;         /* cloth: per vertex */
    uint32_t* first_vertex;        /* cloth: per particle, the vertex that stands for it */
    uint32_t* parent;              /* of particles that tearing made, from first_particles on: whose place they took */
    uint32_t* vertex_source;       /* per vertex: whose attributes it has */
    uint32_t* mesh_indices;        /* as added, 3 per triangle */
    float* first_mass;             /* as added */
    uint32_t* weld;                /* solid: per vertex, the first at its place */
    uint32_t* inside;              /* solid: per vertex, its tetrahedron */
    float* weights;                /* solid: 4 per vertex */
    es_vertex_fans mesh_fans;
    /* state, by slot: 4 floats each */
    double origin[3];
    float *x, *velocity, *before;  /* before: a fixed step ago */
    es_soft_hold* holds;
    uint32_t hold_count;
    size_t hold_capacity;
    float still;                   /* seconds */
    bool asleep;
    uint32_t torn;
    uint64_t seen;                 /* hash of the shapes in reach and their poses: what else can wake a sleeping cloth */
    /* derived */
    es_soft_layout layout;
    es_soft_anchors anchors;
    float rest_volume, spacing;    /* mean edge */
    bool cut;                      /* the topology is not the one it was added with */
    bool planar;                   /* at rest */
    uint32_t carried;              /* particles that the layout knows */
    bool crumpled;                 /* too many pairs to part, and the logger knows */
    /* scratch of a step, by slot */
    float *previous, *acceleration;
    float* ratio;                  /* per link lane */
    es_soft_plane* planes;         /* ES_SOFT_PLANES per slot; NULL: never needed one */
    uint8_t* plane_count;
    size_t plane_capacity, plane_count_capacity;
    uint32_t plane_slots;          /* 0: no planes in this step */
    uint32_t* keys;                /* of shapes in reach */
    size_t key_capacity;
    uint32_t key_count;
    es_soft_obstacle* obstacles;
    size_t obstacle_capacity;
    uint32_t obstacle_count;
    es_soft_surface* surfaces;     /* per substep and obstacle */
    size_t surface_capacity;
    float* pushes;                 /* 6 per band and obstacle */
    size_t push_capacity;
    float* pulls;                  /* 3 per hold */
    size_t pull_capacity;
    uint32_t* pairs;               /* of particles, slots */
    size_t pair_capacity, pair_count;
    uint32_t* cells;
    size_t cell_capacity;
    float* shown;                  /* 4 per vertex */
    size_t shown_capacity;
    uint32_t grabbed[ES_HANDS], grab_count; /* particles that hands hold */
    void* progress;                /* per band */
    size_t progress_capacity;
    /* what the mesh shows */
    float posed_alpha;
    es_mat4 posed_matrix;
    double posed_position[3];
    bool posed;                    /* and is still so */
} es_soft_object;

/* One of several arrays of an arena that its maker frees when any is missing: the first that finds no memory says so, and no more is asked for. */
static inline void* es_soft_room(es_arena* arena, size_t count, size_t size)
{
    void* memory = arena->block_size ? es_arena_allocate(arena, (count ? count : 1) * size) : NULL;
    if (!memory) arena->block_size = 0;
    return memory;
}

/* soft_welding.c: particles, corners, masses or tetrahedra's bindings from the mesh and the desc; false after es_fail */
bool es_soft_weld(es_world* world, es_soft_object* soft, const es_mesh_object* mesh);
bool es_soft_embed(es_world* world, es_soft_object* soft, const es_mesh_object* mesh, const es_soft_solid* solid);

/* soft_layout.c: from corners and tetrahedra; places, velocities are carried over by particle. False after es_fail, with the old one kept.
 * replaced: gets the old one, in whose arena the old places and velocities are, to be freed or put back; NULL: it is freed. */
bool es_soft_lay_out(es_context* context, es_soft_object* soft, es_soft_layout* replaced);
void es_soft_layout_free(es_soft_layout* layout);
void es_soft_set_compliances(es_soft_object* soft);

/* soft_anchors.c: false after es_fail, with those there were kept */
bool es_soft_make_anchors(es_context* context, es_soft_object* soft);
/* Where a hold is now, relative to the body's origin. */
es_vec3 es_soft_hold_place(const es_world* world, const es_soft_object* soft, const es_soft_hold* hold);

/* The other way: the hold's `local` for where its particle is. */
es_vec3 es_soft_local_place(const es_world* world, const es_soft_object* soft, const es_soft_hold* hold);

/* soft_bodies.c */
bool es_soft_numbers_valid(const es_soft_desc* desc);
void es_soft_take_numbers(es_soft_desc* now, const es_soft_desc* desc); /* what es_world_set_soft changes */
void es_soft_free(es_world* world, es_soft_object* soft);
void es_soft_wake(es_soft_object* soft);

/* soft_obstacles.c: fills soft->obstacles, sorted by body and shape. False after es_fail. */
bool es_soft_gather_obstacles(es_world* world, es_soft_object* soft, float h);
void es_soft_push_bodies(es_world* world, es_soft_object* soft, float h);

/* soft_step.c */
es_result es_soft_step_one(es_world* world, es_soft_object* soft, float h, uint32_t substeps);
uint32_t es_soft_substeps(const es_soft_object* soft, uint32_t world_substeps);

/* soft_self.c */
float es_soft_own_distance(const es_soft_object* soft);
bool es_soft_find_pairs(es_context* context, es_soft_object* soft, float h);
void es_soft_part_pairs(es_soft_object* soft);

/* soft_tear.c: false after es_fail, with all as it was */
bool es_soft_tear_stretched(es_world* world, es_soft_object* soft);
bool es_soft_make_mesh_fans(es_world* world, es_soft_object* soft, const es_mesh_object* mesh);
void es_soft_mend(es_soft_object* soft); /* corners and masses as they were added; what follows from them must be made anew */
/* Layout and mesh for the present corners; places are not carried over. False after es_fail; then only part of it may be made. */
bool es_soft_relay(es_world* world, es_soft_object* soft);

#endif
