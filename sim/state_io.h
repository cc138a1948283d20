/* What visiting the state is made of (sim/state.c): one function per kind of object counts, writes, hashes, checks or applies it. */
#ifndef EARTHSHINE_SIM_STATE_IO_H
#define EARTHSHINE_SIM_STATE_IO_H

#include <string.h>

#include "platform/random.h"
#include "sim/world.h"

typedef enum state_mode { COUNT, WRITE, HASH, CHECK, APPLY } state_mode;
typedef struct state_io {
    state_mode mode;
    char* bytes;        /* WRITE, CHECK, APPLY */
    size_t at, size;    /* size: CHECK, APPLY */
    uint64_t hash;
    bool good;
    bool no_memory;     /* and the context has said so */
} state_io;

static inline bool reading(const state_io* io) { return io->mode >= CHECK; }

static inline void transfer(state_io* io, void* data, size_t size)
{
    if (!size) return; /* of what has no elements there may be no array */
    if (reading(io) && (!io->good || size > io->size - io->at)) {
        io->good = false;
        return;
    }
    if (io->mode == WRITE) memcpy(io->bytes + io->at, data, size);
    else if (io->mode == HASH) io->hash = es_hash_bytes(io->hash, data, size);
    else if (reading(io)) memcpy(data, io->bytes + io->at, size);
    io->at += size;
}

static inline void visit_u32(state_io* io, uint32_t* value) { transfer(io, value, sizeof *value); }
static inline void visit_floats(state_io* io, float* values, size_t count) { transfer(io, values, count * sizeof *values); }

/* Within what a float holds: matrices are rounded from it. */
static inline void visit_position(state_io* io, double position[3])
{
    transfer(io, position, 3 * sizeof *position);
    if (!reading(io)) return;
    for (int k = 0; k < 3; k++) io->good &= position[k] >= -3e38 && position[k] <= 3e38;
}

static inline void visit_flag(state_io* io, bool* flag)
{
    uint32_t word = *flag;
    visit_u32(io, &word);
    if (reading(io)) io->good &= word <= 1;
    *flag = word == 1;
}

/* sim/sky.c */
void es_visit_sky(es_world* world, state_io* io);
void es_visit_sky_desc(state_io* io, es_sky_desc* desc);

/* sim/movers.c: a desc as a mover keeps it, its axis and rotation of unit length */
bool es_mover_is_resolved(const es_mover_desc* desc);
void es_mover_put(es_world* world, es_mover_object* mover, const es_mover_desc* resolved);

#endif
