/* The world floor's kernels, one table per instruction set. */
#ifndef EARTHSHINE_SIM_KERNEL_TABLE_H
#define EARTHSHINE_SIM_KERNEL_TABLE_H

#include "platform/platform.h"
#include "sim/deform.h"
#include "sim/edits/geodesic.h"
#include "sim/rigid/solver.h"
#include "sim/soft/soft_kernels.h"

/* X(name, arguments) */
#define ES_SIM_KERNELS(X)                                                                                        \
    /* rigid bodies: records [begin, end), both multiples of 8 */                                                \
    X(rigid_accelerate, (const es_solver_job* job, uint32_t begin, uint32_t end))                                \
    X(rigid_move, (const es_solver_job* job, uint32_t begin, uint32_t end))                                      \
    /* contacts [begin, end), of one colour */                                                                   \
    X(contacts_prepare, (const es_solver_job* job, uint32_t begin, uint32_t end))                                \
    X(contacts_warm_start, (const es_solver_job* job, uint32_t begin, uint32_t end))                             \
    X(contacts_solve, (const es_solver_job* job, uint32_t begin, uint32_t end))                                  \
    X(contacts_relax, (const es_solver_job* job, uint32_t begin, uint32_t end))                                  \
    X(contacts_bounce, (const es_solver_job* job, uint32_t begin, uint32_t end))                                 \
    X(contacts_store, (const es_solver_job* job, uint32_t begin, uint32_t end))                                  \
    /* Cross products of triangles [begin, end) from vertices times `scale`, 4 floats each; begin a multiple of 8, and zeros are   \
     * written up to the next one after end. indices: 3 per triangle */                                          \
    X(face_normals, (const float* positions, const uint32_t* indices, uint32_t begin, uint32_t end, float scale, float* faces)) \
    /* normals of vertex blocks [begin, end) as sim/normals.h has them */                                        \
    X(vertex_normals, (const uint32_t* first_row, const uint32_t* rows, const float* faces, uint32_t begin, uint32_t end, float* normals)) \
    /* below: vertex blocks [begin, end) */                                                                      \
    X(skin, (const es_skin_job* job, uint32_t begin, uint32_t end))                                              \
    /* vertices += weight × displacement */                                                                      \
    X(morph, (float* vertices, const float* displacement, float weight, uint32_t begin, uint32_t end))           \
    /* makes directions unit; those without one become `otherwise`. The fourth float stays */                    \
    X(unit, (float* directions, const float* otherwise, uint32_t begin, uint32_t end))                           \
    /* at least one block; bounds: least x y z and a float left alone, then the most */                          \
    X(bounds, (const float* positions, uint32_t begin, uint32_t end, float* bounds)) \
    /* slots [begin, end), both multiples of 8: velocities of the last substep, gravity, damping, and on for one substep */ \
    X(soft_move, (const es_soft_motion* motion, uint32_t begin, uint32_t end))                                   \
    /* after the last substep: velocities, and the square of the largest */                                      \
    X(soft_settle, (const es_soft_motion* motion, uint32_t begin, uint32_t end, float* fastest))                 \
    X(soft_reach, (float* positions, const es_soft_reach* job, uint32_t begin, uint32_t end))                    \
    X(soft_links, (float* positions, const es_soft_links* batches, uint32_t count, float inverse_h2))            \
    /* length over rest length, 8 per batch; 0 where that is no number */                                        \
    X(soft_stretch, (const float* positions, const es_soft_links* batches, uint32_t count, float* ratio))        \
    /* compliance: over h² */                                                                                    \
    X(soft_volumes, (float* positions, const es_soft_volumes* batches, uint32_t count, float compliance))        \
    /* push: linear and angular momentum over h that the particles got are added to it */                        \
    X(soft_contact, (float* positions, const float* previous, const es_soft_surface* surface, uint32_t begin, uint32_t end, float push[6])) \
    /* blocks [begin, end) of eight slots */                                                                     \
    X(soft_air, (const es_soft_air* job, uint32_t begin, uint32_t end))                                          \
    /* entries [begin, end) of the job's list */                                                                 \
    X(geodesic_front, (const es_geodesic_job* job, uint32_t begin, uint32_t end))

struct es_sim_kernels {
#define ES_SIM_KERNEL_FIELD(name, arguments) void (*name) arguments;
    ES_SIM_KERNELS(ES_SIM_KERNEL_FIELD)
#undef ES_SIM_KERNEL_FIELD
};
typedef struct es_sim_kernels es_sim_kernels;

/* NULL when the ISA was not built; whether it runs here is es_isa_available_mask()'s to say */
const struct es_sim_kernels* es_sim_kernel_table(es_isa isa);

#endif
