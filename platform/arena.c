/* Arenas: memory handed out from a chain of blocks and taken back all at once.
 *
 * Reset rewinds to the first block and keeps the chain, so a frame that asks for the same as the one before walks the same
 * blocks and allocates nothing. A request no block ahead can hold gets a block of its own, linked in where it is needed. */
#include "platform/context.h"

struct es_arena_block {
    es_arena_block* next;
    size_t size; /* after the header */
};

enum { HEADER_SIZE = 64 }; /* keeps what follows 64-byte aligned */

static char* block_memory(es_arena_block* block) { return (char*)block + HEADER_SIZE; }

void es_arena_init(es_arena* arena, es_context* context, size_t block_size)
{
    *arena = (es_arena){.context = context, .block_size = block_size};
}

void es_arena_free(es_arena* arena)
{
    es_arena_block* block = arena->first;
    while (block) {
        es_arena_block* next = block->next;
        es_release(arena->context, block, HEADER_SIZE + block->size);
        block = next;
    }
    arena->first = arena->current = NULL;
    arena->used = 0;
}

void es_arena_reset(es_arena* arena)
{
    arena->current = arena->first;
    arena->used = 0;
}

void* es_arena_allocate(es_arena* arena, size_t size)
{
    if (size > SIZE_MAX - 2 * HEADER_SIZE - 63) {
        es_fail(arena->context, ES_OUT_OF_MEMORY, "%zu bytes of scratch memory do not fit the address space", size);
        return NULL;
    }
    size = (size + 63) / 64 * 64;
    if (size == 0) size = 64;
    es_arena_block* current = arena->current;
    if (!current || current->size - arena->used < size) {
        es_arena_block* next = current ? current->next : NULL;
        if (!next || next->size < size) {
            size_t block_size = size > arena->block_size ? size : arena->block_size;
            es_arena_block* block = es_allocate(arena->context, HEADER_SIZE + block_size);
            if (!block) return NULL;
            block->size = block_size;
            block->next = next;
            if (current)
                current->next = block;
            else
                arena->first = block;
            next = block;
        }
        arena->current = current = next;
        arena->used = 0;
    }
    void* pointer = block_memory(current) + arena->used;
    arena->used += size;
    return pointer;
}
