/* Objects by generation handle: a handle is generation << 20 | slot, generations count from 1, zero is null.
 *
 * Objects never move in memory. A freed slot is used again with the next generation; after the last one it is retired,
 * so a stale handle stays stale for ever. Every kind of object starts with an es_object. */
#ifndef EARTHSHINE_SIM_SLOTS_H
#define EARTHSHINE_SIM_SLOTS_H

#include "platform/context.h"

enum { ES_SLOT_BITS = 20, ES_SLOT_LIMIT = (1 << ES_SLOT_BITS) - 1, ES_GENERATION_LIMIT = (1 << (32 - ES_SLOT_BITS)) - 1 };

typedef struct es_object {
    uint32_t id;
    uint32_t references;  /* objects of the world that hold this handle */
    char* name;           /* NULL: unnamed */
} es_object;

typedef struct es_slots {
    size_t object_size;
    uint32_t limit;                 /* slots at most */
    uint32_t slot_count;            /* slots ever used: dead ones included */
    uint32_t live;
    char** chunks;                  /* of 64 objects */
    size_t chunk_count, chunk_capacity;
    uint32_t* generations;          /* per slot, of its present or next object */
    size_t generation_capacity;
    uint32_t* free_slots;           /* a stack */
    size_t free_count, free_capacity;
} es_slots;

void es_slots_init(es_slots* slots, size_t object_size, uint32_t limit);
/* The objects' own memory must have been released. */
void es_slots_free(es_context* context, es_slots* slots);
/* A zeroed object with its handle and a copy of `name` (NULL allowed); NULL after es_fail. `kind` is for the message. */
void* es_slots_add(es_context* context, es_slots* slots, const char* kind, const char* name);
void* es_slots_get(const es_slots* slots, uint32_t id);    /* NULL: stale or null */
void* es_slots_at(const es_slots* slots, uint32_t slot);   /* NULL: nothing there */
void es_slots_remove(es_context* context, es_slots* slots, es_object* object);
/* An object under a handle that is known, which must name no object nor share its slot with one: as es_slots_add, but that what was stale comes back. */
void* es_slots_put(es_context* context, es_slots* slots, const char* kind, uint32_t id, const char* name);
/* Makes initialised slots continue others: as many, all free, the next handle of each one that the others never gave out. False after es_fail. */
bool es_slots_succeed(es_context* context, es_slots* slots, const es_slots* others);
static inline uint32_t es_slot_of(uint32_t id) { return id & ES_SLOT_LIMIT; }

#endif
