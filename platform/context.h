/* Inside of a context, for the floors above: memory, messages, parallel loops, scratch arenas. */
#ifndef EARTHSHINE_PLATFORM_CONTEXT_H
#define EARTHSHINE_PLATFORM_CONTEXT_H

#include "platform/platform.h"

/* ---- memory: every byte the library keeps goes through here, is counted and capped ------------------------------- */

/* 64-byte aligned, contents undefined; NULL after es_fail(OUT_OF_MEMORY or MEMORY_CAP). size 0 gives a unique pointer. */
void* es_allocate(es_context* context, size_t size);
void* es_allocate_zero(es_context* context, size_t size);
void es_release(es_context* context, void* pointer, size_t size);  /* NULL allowed */
/* count * size without overflow (fails with OUT_OF_MEMORY) */
void* es_allocate_array(es_context* context, size_t count, size_t size);

/* Counts what a library is about to allocate by itself, past the allocator, as if it came from it: false after es_fail(MEMORY_CAP). It is
 * given back with es_unreserve. */
bool es_reserve(es_context* context, size_t size);
void es_unreserve(es_context* context, size_t size);

/* Grows *pointer so that it holds `needed` elements, keeping the first `used`; *capacity is updated. False on failure,
 * with the old block untouched. New memory is undefined. */
bool es_grow(es_context* context, void** pointer, size_t* capacity, size_t used, size_t needed, size_t element_size);

/* ---- messages --------------------------------------------------------------------------------------------------------- */

/* Sets the last result and message, logs at error level, returns `result`. Call it once per failure, where it is known
 * what failed and what would be accepted. */
es_result es_fail(es_context* context, es_result result, const char* format, ...) ES_PRINTF(3, 4);
/* A misuse of the API: like es_fail, and calls the assert hook. */
es_result es_misuse(es_context* context, es_result result, const char* format, ...) ES_PRINTF(3, 4);
void es_log(es_context* context, es_log_level level, es_result item, const char* format, ...) ES_PRINTF(4, 5);

/* ---- parallel loops ------------------------------------------------------------------------------------------------------ */

/* body(user, begin, end, worker): called for the chunks [k * grain, min((k + 1) * grain, count)), each exactly once, on some
 * worker in [0, es_context_workers). Chunk borders depend on count and grain alone, so a body whose chunks write apart
 * gives the same bits for any number of threads. The floating-point environment is set for each worker and restored.
 * Chunks are handed out in their order: when one begins, each before it has begun, on this worker (and ended) or on one that is running.
 * So a chunk may wait for those before it, with es_wait_a_little, and for no others; on however few threads, one always gets on.
 * Does not nest: a body may not start another loop. */
typedef void (*es_loop_body)(void* user, uint32_t begin, uint32_t end, uint32_t worker);
void es_parallel_for(es_context* context, uint32_t count, uint32_t grain, es_loop_body body, void* user);
/* One turn of waiting for another worker; *turns, 0 before the first, counts them. A processor that others need is given away after
 * about 20 microseconds. */
void es_wait_a_little(uint32_t* turns);
uint32_t es_context_workers(const es_context* context);

/* Round to nearest, no flush to zero, no traps: on entry to every public call that computes; the caller's is put back. A build with
 * EARTHSHINE_TRAP_FP traps what makes a NaN or an infinity. */
typedef struct es_fp_environment { uint64_t saved; } es_fp_environment;
es_fp_environment es_fp_enter(void);
/* Never with traps: for numbers of files and pictures, which may be anything, and for libraries that read them. */
es_fp_environment es_fp_enter_untrapped(void);
void es_fp_leave(es_fp_environment environment);

/* Counts objects created from the context so that leaks are reported at its end: +1 and -1. */
void es_context_count_object(es_context* context, int change);

/* 1, 2, 3 …: never the same twice on one context. */
uint64_t es_context_next_serial(es_context* context);

/* ---- arena: memory for one frame or one task, released all at once ------------------------------------------------------- */

typedef struct es_arena_block es_arena_block;
typedef struct es_arena { es_context* context; es_arena_block* first; es_arena_block* current; size_t used; size_t block_size; } es_arena;

void es_arena_init(es_arena* arena, es_context* context, size_t block_size);
void es_arena_free(es_arena* arena);
/* 64-byte aligned; NULL after es_fail. Blocks are kept by es_arena_reset, so a steady frame allocates nothing. */
void* es_arena_allocate(es_arena* arena, size_t size);
void es_arena_reset(es_arena* arena);

double es_seconds(void);  /* monotonic clock, for statistics only: never in a result */

#endif
