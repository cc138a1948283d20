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

/* False after es_fail. */
static bool copy_name(es_context* context, const char* name, char** copy)
{
    *copy = NULL;
    if (!name || !*name) return true;
    size_t size = strlen(name) + 1;
    *copy = es_allocate(context, size);
    if (*copy) memcpy(*copy, name, size);
    return *copy != NULL;
}

static es_object* begin_object(es_slots* slots, uint32_t id, char* name)
{
    es_object* object = object_in(slots, es_slot_of(id));
    memset(object, 0, slots->object_size);
    object->id = id;
    object->name = name;
    slots->live++;
    return object;
}

void* es_slots_add(es_context* context, es_slots* slots, const char* kind, const char* name)
{
    bool reuse = slots->free_count > 0;
    if (!reuse && slots->slot_count >= slots->limit) {
        es_fail(context, ES_INVALID_ARGUMENT, "%s: a world holds at most %u of them", kind, slots->limit);
        return NULL;
    }
    if (!reuse && !reserve_slot(context, slots)) return NULL;
    char* copy;
    if (!copy_name(context, name, &copy)) return NULL;
    uint32_t slot;
    if (reuse) {
        slot = slots->free_slots[--slots->free_count];
    } else {
        slot = slots->slot_count++;
        slots->generations[slot] = 1;
    }
    return begin_object(slots, slots->generations[slot] << ES_SLOT_BITS | slot, copy);
}

void* es_slots_put(es_context* context, es_slots* slots, const char* kind, uint32_t id, const char* name)
{
    const uint32_t slot = es_slot_of(id), generation = id >> ES_SLOT_BITS;
    if (slot >= slots->limit) {
        es_fail(context, ES_INVALID_ARGUMENT, "%s: a world holds at most %u of them", kind, slots->limit);
        return NULL;
    }
    while (slots->slot_count <= slot) {
        if (!reserve_slot(context, slots)) return NULL;
        slots->generations[slots->slot_count] = 1;
        slots->free_slots[slots->free_count++] = slots->slot_count++;
    }
    char* copy;
    if (!copy_name(context, name, &copy)) return NULL;
    for (size_t i = slots->free_count; i-- > 0;) {
        if (slots->free_slots[i] != slot) continue;
        memmove(slots->free_slots + i, slots->free_slots + i + 1, (--slots->free_count - i) * sizeof *slots->free_slots);
        break;
    }
    if (slots->generations[slot] < generation) slots->generations[slot] = generation;
    return begin_object(slots, id, copy);
}

bool es_slots_succeed(es_context* context, es_slots* slots, const es_slots* others)
{
    for (uint32_t slot = 0; slot < others->slot_count; slot++) {
        if (!reserve_slot(context, slots)) return false;
        slots->generations[slots->slot_count++] = others->generations[slot];
    }
    for (uint32_t slot = others->slot_count; slot-- > 0;) { /* the first is to be taken first */
        bool used = es_slots_at(others, slot) != NULL;
        if (used && slots->generations[slot] == ES_GENERATION_LIMIT) continue;
        slots->generations[slot] += used;
        slots->free_slots[slots->free_count++] = slot;
    }
    /* those that others have retired stay so */
    for (uint32_t slot = 0; slot < others->slot_count && others->free_count + others->live < others->slot_count; slot++) {
        bool there = es_slots_at(others, slot) != NULL;
        for (size_t i = 0; i < others->free_count && !there; i++) there = others->free_slots[i] == slot;
        for (size_t i = 0; i < slots->free_count && !there; i++)
            if (slots->free_slots[i] == slot) {
                memmove(slots->free_slots + i, slots->free_slots + i + 1, (--slots->free_count - i) * sizeof *slots->free_slots);
                break;
            }
    }
    return true;
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
