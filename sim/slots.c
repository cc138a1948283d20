/* Handle slots: see slots.h. */
#include "sim/slots.h"

#include <string.h>

enum { CHUNK = 64 };

void es_slots_init(es_slots* slots, size_t object_size, uint32_t limit)
{
    *slots = (es_slots){.object_size = object_size, .limit = limit < ES_SLOT_LIMIT ? limit : ES_SLOT_LIMIT};
}

void es_slots_free(es_context* context, es_slots* slots)
{
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_object* object = es_slots_at(slots, slot);
        if (object && object->name) es_release(context, object->name, strlen(object->name) + 1);
    }
    for (size_t i = 0; i < slots->chunk_count; i++) es_release(context, slots->chunks[i], CHUNK * slots->object_size);
    if (slots->chunks) es_release(context, slots->chunks, slots->chunk_capacity * sizeof *slots->chunks);
    if (slots->generations) es_release(context, slots->generations, slots->generation_capacity * sizeof *slots->generations);
    if (slots->free_slots) es_release(context, slots->free_slots, slots->free_capacity * sizeof *slots->free_slots);
    *slots = (es_slots){0};
}

static es_object* object_in(const es_slots* slots, uint32_t slot)
{
    return (es_object*)(slots->chunks[slot / CHUNK] + slot % CHUNK * slots->object_size);
}

/* Makes room for one more slot; the stack of free slots too, so that removing never allocates. */
static bool reserve_slot(es_context* context, es_slots* slots)
{
    size_t needed = (size_t)slots->slot_count + 1;
    if (!es_grow(context, (void**)&slots->generations, &slots->generation_capacity, slots->slot_count, needed, sizeof *slots->generations) ||
        !es_grow(context, (void**)&slots->free_slots, &slots->free_capacity, slots->free_count, needed, sizeof *slots->free_slots))
        return false;
    if (slots->slot_count < slots->chunk_count * CHUNK) return true;
    if (!es_grow(context, (void**)&slots->chunks, &slots->chunk_capacity, slots->chunk_count, slots->chunk_count + 1, sizeof *slots->chunks))
        return false;
    char* chunk = es_allocate_zero(context, CHUNK * slots->object_size);
    if (!chunk) return false;
    slots->chunks[slots->chunk_count++] = chunk;
    return true;
}

void* es_slots_add(es_context* context, es_slots* slots, const char* kind, const char* name)
{
    bool reuse = slots->free_count > 0;
    if (!reuse && slots->slot_count >= slots->limit) {
        es_fail(context, ES_INVALID_ARGUMENT, "%s: a world holds at most %u of them", kind, slots->limit);
        return NULL;
    }
    if (!reuse && !reserve_slot(context, slots)) return NULL;
    char* copy = NULL;
    if (name && *name) {
        size_t size = strlen(name) + 1;
        copy = es_allocate(context, size);
        if (!copy) return NULL;
        memcpy(copy, name, size);
    }
    uint32_t slot;
    if (reuse) {
        slot = slots->free_slots[--slots->free_count];
    } else {
        slot = slots->slot_count++;
        slots->generations[slot] = 1;
    }
    es_object* object = object_in(slots, slot);
    memset(object, 0, slots->object_size);
    object->id = slots->generations[slot] << ES_SLOT_BITS | slot;
    object->name = copy;
    slots->live++;
    return object;
}

void* es_slots_at(const es_slots* slots, uint32_t slot)
{
    if (slot >= slots->slot_count) return NULL;
    es_object* object = object_in(slots, slot);
    return object->id ? object : NULL;
}

void* es_slots_get(const es_slots* slots, uint32_t id)
{
    es_object* object = id ? es_slots_at(slots, es_slot_of(id)) : NULL;
    return object && object->id == id ? object : NULL;
}

void es_slots_remove(es_context* context, es_slots* slots, es_object* object)
{
    uint32_t slot = es_slot_of(object->id);
    if (object->name) es_release(context, object->name, strlen(object->name) + 1);
    object->name = NULL;
    object->id = 0;
    slots->live--;
    if (slots->generations[slot] < ES_GENERATION_LIMIT) {
        slots->generations[slot]++;
        slots->free_slots[slots->free_count++] = slot;
    }
}
