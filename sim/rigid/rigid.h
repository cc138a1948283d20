/* Inside of the rigid bodies: objects, contacts, and what one fixed step passes from part to part.
 *
 *   bodies.c      objects and their public functions         body_mass.c  mass and inertia of a body
 *   broad_phase.c boxes in the tree, pairs, contacts         narrow_phase.c manifolds, warm starting by feature
 *   islands.c     what sleeps and wakes together             solver.c     constraints, colours, substeps
 *   joints.c, joint_solver.c                                 hands.c      what the player holds
 *   bounce_limit.h bounces gain no energy
 *   continuous.c  fast bodies stop at what they would pass   crew.h       threads that go through the solver's stages together
 *   rigid_state.h saving and restoring                       step.c       the order of all this
 *
 * Results depend on the state alone (sim/state.c saves it): contacts are kept and solved in the order of their keys, a key being the two
 * shapes' (body slot, shape index), lower first. */
#ifndef EARTHSHINE_SIM_RIGID_H
#define EARTHSHINE_SIM_RIGID_H

#include "sim/rigid/collision.h"
#include "sim/rigid/dynamic_tree.h"
#include "sim/world.h"

enum { ES_SHAPE_BITS = 12, ES_SHAPES_PER_BODY = 1 << ES_SHAPE_BITS };

#define ES_CONTACT_MARGIN 0.02f    /* m: how far apart surfaces may be and still have a contact */
#define ES_MAX_SPEED 1000.0f       /* m/s */
#define ES_PUSH_OUT_SPEED 3.0f     /* m/s: at which deep overlaps are resolved, at most */
#define ES_BOUNCE_SPEED 1.0f       /* m/s: slower contacts do not bounce */
#define ES_SLEEP_SPEED 0.05f       /* m/s of any point of a body: below, it counts as still */
#define ES_SLEEP_SECONDS 0.5f      /* still for so long, an island falls asleep */

typedef struct es_body_object {
    es_object object;
    es_body_type type;
    es_node node;
    es_rigid_shape* shapes;
    uint32_t* proxies;             /* per shape, in the tree */
    uint32_t shape_count;
    float mass, inverse_mass;      /* 0 unless dynamic */
    es_vec3 local_centre;          /* of mass, in the body's frame */
    float inertia[6], inverse_inertia[6]; /* about the centre, body's axes: xx yy zz xy xz yz */
    float reach;                   /* radius around the centre of mass that holds all shapes */
    float thickness;               /* the least inner radius of a shape; moving farther than that in a step can tunnel */
    float linear_damping, angular_damping, gravity_scale;
    uint32_t joints;               /* how many it has */
    bool no_sleep, continuous;
    /* state */
    double centre[3], previous_centre[3]; /* of mass, now and one fixed step ago */
    es_quat rotation, previous_rotation;
    es_vec3 velocity, angular_velocity, force, torque;
    double seen_position[3];       /* the node's pose when a static body was last put there */
    es_quat seen_rotation;
    float still;                   /* seconds for which it has been */
    uint32_t island;               /* asleep: which bodies wake with it, those with the same number */
    bool asleep;
    /* during a step */
    uint32_t index;                /* among the solver's bodies; kinematic: UINT32_MAX while it stands */
} es_body_object;

/* One pair of shapes whose boxes touch. */
typedef struct es_contact {
    uint32_t a, b;                 /* shape keys, a < b */
    uint32_t first, count;         /* manifolds */
    float friction, restitution, rolling; /* of the pair */
    bool touching, sensor;
} es_contact;

/* A manifold between steps: geometry relative to A's centre of mass, world axes. The kernels read it four words at a time. */
typedef struct es_contact_manifold {
    es_manifold geometry;          /* its points' normal_impulse is for warm starting */
    es_vec3 apart;                 /* from A's centre of mass to B's */
    uint32_t count;                /* geometry.count */
    es_vec3 friction;              /* impulse in the contact plane, from A on B */
    float twist;                   /* angular impulse about the normal */
    es_vec3 rolling;               /* angular impulse against rolling */
    float spare;
} es_contact_manifold;

typedef struct es_contacts {       /* sorted by (a, b) */
    es_contact* list;
    size_t count, capacity;
    es_contact_manifold* manifolds; /* those of a contact lie one after another, with gaps between contacts */
    size_t manifold_count, manifold_capacity;
} es_contacts;

typedef struct es_joint_frame {
    es_vec3 arm;                   /* from the body's centre of mass, in its axes; of the world: unused */
    double place[3];               /* of the world: where */
    es_quat rotation;
} es_joint_frame;

typedef struct es_joint_object {
    es_object object;
    es_joint_desc desc;            /* resolved; name NULL */
    es_joint_frame frame[2];
    /* state, besides the desc's numbers: impulses of the last substep, world axes */
    es_vec3 linear, angular;
    float lower_impulse, upper_impulse, motor_impulse, spring_impulse;
    es_vec3 force, torque;         /* of the last step */
    bool broken;
} es_joint_object;

struct es_solver;

typedef struct es_rigid {
    es_dynamic_tree tree;
    double origin[3];              /* the tree's boxes are relative to it; part of the state */
    es_contacts contacts, next;    /* of pairs of which one side is awake at least; room for the next ones */
    es_contacts asleep, next_asleep; /* of the others, as they fell asleep */
    bool unsorted;                 /* some contacts are on the wrong one of the two lists */
    uint32_t* starts;              /* of next's contacts: where their manifolds begin; one more at the end */
    size_t start_capacity;
    uint32_t* moving;              /* slots of bodies that are awake: dynamic, then kinematic */
    size_t moving_capacity;
    uint32_t dynamic_count, kinematic_count;
    es_contact_event* events;
    size_t event_count, event_capacity;
    uint32_t* parents;             /* of islands */
    float* stillness;
    size_t parent_capacity, stillness_capacity;
    struct es_joint_rows* joints;  /* during a step: those that take part */
    size_t joint_capacity, joint_count;
    struct es_solver* solver;
} es_rigid;

static inline uint32_t es_shape_key(uint32_t body_slot, uint32_t shape) { return body_slot << ES_SHAPE_BITS | shape; }
static inline es_body_object* es_body_of_key(const es_world* world, uint32_t key) { return es_slots_at(&world->slots[ES_OBJECT_BODY], key >> ES_SHAPE_BITS); }
static inline es_rigid_shape* es_shape_of_key(const es_world* world, uint32_t key)
{
    return &es_body_of_key(world, key)->shapes[key & (ES_SHAPES_PER_BODY - 1)];
}

/* The world's rigid bodies, made when first asked for; NULL after es_fail. */
es_rigid* es_rigid_of(es_world* world);
void es_rigid_free(es_world* world);
void es_body_free(es_world* world, es_body_object* body);
/* The pose of the body's frame, relative to `origin`. */
es_pose es_body_pose(const es_body_object* body, const double origin[3]);
/* Where the body's own axes are, from where its centre of mass is. */
void es_body_position(const es_body_object* body, const double centre[3], es_quat rotation, double position[3]);

/* mass.c: from the shapes and the desc's mass; false after es_fail when there is none. */
bool es_body_set_mass(es_world* world, es_body_object* body, float mass, const char* name);

/* bodies.c */
void es_body_place(es_body_object* body, const double position[3], es_quat rotation);
void es_body_push(es_body_object* body, es_vec3 impulse, es_vec3 angular_impulse); /* speeds stay within ES_MAX_SPEED */

/* broad_phase.c */
bool es_body_enter_tree(es_world* world, es_body_object* body); /* false after es_fail; what has entered may leave */
void es_body_leave_tree(es_world* world, es_body_object* body);
void es_body_refresh_tree(es_world* world, es_body_object* body, es_vec3 ahead);
/* Fills rigid->next with the pairs of which one side is awake, in order, with room for their manifolds. */
bool es_find_contacts(es_world* world);
bool es_contacts_reserve(es_context* context, es_contacts* contacts, size_t count, size_t manifolds);
/* Fills in what follows from the shapes. */
void es_contact_resolve(const es_world* world, es_contact* contact);
/* Forgets the body's contacts, with events of what it touched. */
void es_body_drop_contacts(es_world* world, es_body_object* body);

/* narrow_phase.c: manifolds of rigid->next, with the impulses of the same features in rigid->contacts. */
void es_collide_contacts(es_world* world);
/* Events of what began and ended to touch between rigid->contacts and rigid->next; room for them was made. */
void es_report_contacts(es_world* world);
/* After the solver: events of what it pressed together that was not expected to touch, and may be apart again when it is next looked at. */
void es_report_pressed(es_world* world);
/* Room for `more` events; false after es_fail. There is always room for the leaving of all contacts there are, so that a body can be destroyed
 * when memory has run out. */
bool es_events_reserve(es_world* world, size_t more);
void es_report_leaving(es_world* world, const es_contact* contact);

/* islands.c */
static inline bool es_body_is_awake(const es_body_object* body)
{
    return (body->type == ES_BODY_DYNAMIC && !body->asleep) || (body->type == ES_BODY_KINEMATIC && body->index != UINT32_MAX);
}
void es_body_wake(es_world* world, es_body_object* body); /* and its island */
void es_body_wake_neighbours(es_world* world, es_body_object* body);
/* Puts each contact on the list where it belongs. False after es_fail. */
bool es_sort_contacts(es_world* world);
/* Memory for rigid->parents and the next, before bodies move; false after es_fail. */
bool es_islands_reserve(es_world* world);
/* Of parents[i] = i first; the root of an island is its least number, in whatever order bodies were joined. */
uint32_t es_island_root(uint32_t* parents, uint32_t i);
void es_island_join(uint32_t* parents, uint32_t a, uint32_t b);
/* After a step: islands that have been still long enough fall asleep. */
void es_islands_sleep(es_world* world, float h);

/* continuous.c: between the solver and the boxes */
void es_stop_fast_bodies(es_world* world);

/* solver.c: forces, contacts and joints over h, in so many substeps. False after es_fail, with nothing moved. */
bool es_solve(es_world* world, float h, uint32_t substeps);
void es_solver_free(es_context* context, struct es_solver* solver);

#endif
