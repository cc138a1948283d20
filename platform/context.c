/* The context: memory that is counted and capped, messages, and what was chosen for every default. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#if defined(__linux__)
#include <sys/mman.h>
#endif

#include "platform/context_internal.h"

enum { LARGE_PAGE = 2 << 20 };

/* ---- defaults ------------------------------------------------------------------------------------------------- */

static void* default_allocate(void* user, size_t size, size_t alignment)
{
    (void)user;
    if (size > SIZE_MAX - alignment) return NULL;
#if defined(MADV_HUGEPAGE)
    /* Planes and maps are walked end to end: large pages spare most of the faults of a first frame. */
    if (size >= 2 * LARGE_PAGE) {
        void* pointer = NULL;
        if (posix_memalign(&pointer, LARGE_PAGE, size)) return NULL;
        madvise(pointer, size / LARGE_PAGE * LARGE_PAGE, MADV_HUGEPAGE); /* a wish: without it all is as well, but slower */
        return pointer;
    }
#endif
    return aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

static void default_release(void* user, void* pointer, size_t size)
{
    (void)user;
    (void)size;
    free(pointer);
}

static void default_log(void* user, es_log_level level, es_result item, const char* message)
{
    (void)user;
    (void)item;
    if (level > ES_LOG_WARNING) return;
    fprintf(stderr, "earthshine: %s: %s\n", level == ES_LOG_ERROR ? "error" : "warning", message);
}

static void default_assert_failed(void* user, es_result item, const char* message)
{
    (void)user;
    (void)item;
    (void)message;
}

/* ---- messages --------------------------------------------------------------------------------------------------- */

/* One line: a file name may hold control characters, a log line may not. */
static void format_line(char line[ES_MESSAGE_SIZE], const char* format, va_list arguments)
{
    if (vsnprintf(line, ES_MESSAGE_SIZE, format, arguments) < 0) line[0] = 0;
    for (char* c = line; *c; c++) {
        if ((unsigned char)*c < ' ' || *c == 127) *c = ' ';
    }
}

/* The logger is called outside the mutex, so that it may ask the context for anything. */
static void fail_line(es_context* context, es_result result, const char* line)
{
    pthread_mutex_lock(&context->message_mutex);
    context->last_result = result;
    memcpy(context->message, line, strlen(line) + 1);
    pthread_mutex_unlock(&context->message_mutex);
    context->desc.logger.log(context->desc.logger.user, ES_LOG_ERROR, result, line);
}

es_result es_fail(es_context* context, es_result result, const char* format, ...)
{
    if (!context) return result;
    char line[ES_MESSAGE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    format_line(line, format, arguments);
    va_end(arguments);
    fail_line(context, result, line);
    return result;
}

es_result es_misuse(es_context* context, es_result result, const char* format, ...)
{
    if (!context) return result;
    char line[ES_MESSAGE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    format_line(line, format, arguments);
    va_end(arguments);
    fail_line(context, result, line);
    context->desc.assert_hook.failed(context->desc.assert_hook.user, result, line);
    return result;
}

void es_log(es_context* context, es_log_level level, es_result item, const char* format, ...)
{
    if (!context) return;
    char line[ES_MESSAGE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    format_line(line, format, arguments);
    va_end(arguments);
    context->desc.logger.log(context->desc.logger.user, level, item, line);
}

const char* es_context_message(const es_context* context) { return context ? context->message : ""; }
es_result es_context_last_result(const es_context* context) { return context ? context->last_result : ES_INVALID_ARGUMENT; }

/* ---- memory --------------------------------------------------------------------------------------------------------- */

/* Adds to the count unless the cap stands against it; *in_use: what was before. */
static bool count_in(es_context* context, size_t size, size_t* in_use)
{
    /* compare-and-swap rather than add and undo: an attempt that fails must not make another thread's fail */
    size_t before = atomic_load_explicit(&context->bytes, memory_order_relaxed);
    do {
        if (size > context->desc.memory_cap || before > context->desc.memory_cap - size) {
            es_fail(context, ES_MEMORY_CAP, "%zu bytes asked for with %zu in use; the memory cap is %zu bytes", size, before,
                context->desc.memory_cap);
            return false;
        }
    } while (!atomic_compare_exchange_weak_explicit(
        &context->bytes, &before, before + size, memory_order_relaxed, memory_order_relaxed));
    *in_use = before;
    return true;
}

static void raise_peak(es_context* context, size_t now)
{
    size_t peak = atomic_load_explicit(&context->peak_bytes, memory_order_relaxed);
    while (now > peak &&
           !atomic_compare_exchange_weak_explicit(&context->peak_bytes, &peak, now, memory_order_relaxed, memory_order_relaxed)) {
    }
}

void* es_allocate(es_context* context, size_t size)
{
    size_t before;
    if (size == 0) size = 1;
    if (!count_in(context, size, &before)) return NULL;
    void* pointer = context->desc.allocator.allocate(context->desc.allocator.user, size, 64);
    if (!pointer) {
        atomic_fetch_sub_explicit(&context->bytes, size, memory_order_relaxed);
        es_fail(context, ES_OUT_OF_MEMORY, "the allocator returned nothing for %zu bytes, with %zu in use", size, before);
        return NULL;
    }
    raise_peak(context, before + size);
    return pointer;
}

bool es_reserve(es_context* context, size_t size)
{
    size_t before;
    if (!count_in(context, size, &before)) return false;
    raise_peak(context, before + size);
    return true;
}

void es_unreserve(es_context* context, size_t size) { atomic_fetch_sub_explicit(&context->bytes, size, memory_order_relaxed); }

void* es_allocate_zero(es_context* context, size_t size)
{
    void* pointer = es_allocate(context, size);
    if (pointer) memset(pointer, 0, size);
    return pointer;
}

void* es_allocate_array(es_context* context, size_t count, size_t size)
{
    size_t total;
    if (__builtin_mul_overflow(count, size, &total)) {
        es_fail(context, ES_OUT_OF_MEMORY, "%zu elements of %zu bytes do not fit the address space", count, size);
        return NULL;
    }
    return es_allocate(context, total);
}

void es_release(es_context* context, void* pointer, size_t size)
{
    if (!pointer) return;
    if (size == 0) size = 1;
    context->desc.allocator.release(context->desc.allocator.user, pointer, size);
    atomic_fetch_sub_explicit(&context->bytes, size, memory_order_relaxed);
}

bool es_grow(es_context* context, void** pointer, size_t* capacity, size_t used, size_t needed, size_t element_size)
{
    if (needed <= *capacity) return true;
    /* half as much again keeps the copying linear in the final size; 16 spares the first few steps */
    size_t wanted = *capacity + *capacity / 2;
    if (wanted < needed) wanted = needed;
    if (wanted < 16) wanted = 16;
    void* grown = es_allocate_array(context, wanted, element_size);
    if (!grown) return false;
    if (used > 0) memcpy(grown, *pointer, used * element_size);
    es_release(context, *pointer, *capacity * element_size);
    *pointer = grown;
    *capacity = wanted;
    return true;
}

size_t es_context_bytes(const es_context* context)
{
    return context ? atomic_load_explicit(&context->bytes, memory_order_relaxed) : 0;
}
size_t es_context_peak_bytes(const es_context* context)
{
    return context ? atomic_load_explicit(&context->peak_bytes, memory_order_relaxed) : 0;
}

void es_context_count_object(es_context* context, int change)
{
    atomic_fetch_add_explicit(&context->objects, change, memory_order_relaxed);
}

uint64_t es_context_next_serial(es_context* context) { return atomic_fetch_add_explicit(&context->serials, 1, memory_order_relaxed) + 1; }

/* ---- life -------------------------------------------------------------------------------------------------------------- */

es_context_desc es_default_context_desc(void) { return (es_context_desc){0}; }

/* Fills every zero but tasks.user, which needs the context's address. */
static es_context_desc resolve(const es_context_desc* given)
{
    es_context_desc desc = given ? *given : es_default_context_desc();
    if (!desc.allocator.allocate && !desc.allocator.release) {
        desc.allocator = (es_allocator){default_allocate, default_release, NULL};
    }
    if (!desc.logger.log) desc.logger = (es_logger){default_log, NULL};
    if (!desc.assert_hook.failed) desc.assert_hook = (es_assert_hook){default_assert_failed, NULL};
    /* a resolved desc handed to a second context must not bring the first one's pool along */
    if (!desc.tasks.run || desc.tasks.run == es_pool_run) desc.tasks = (es_task_callbacks){es_pool_run, NULL};
    if (desc.threads == 0) desc.threads = es_usable_processors();
    if (desc.isa_mask == 0) desc.isa_mask = es_isa_available_mask();
    if (desc.memory_cap == 0) desc.memory_cap = SIZE_MAX;
    return desc;
}

es_result es_context_create(const es_context_desc* given, es_context** out)
{
    if (!out) return ES_INVALID_ARGUMENT;
    *out = NULL;

    /* what fails before there is a context is reported through this one */
    es_context draft = {.desc = resolve(given), .message_mutex = PTHREAD_MUTEX_INITIALIZER};
    es_context_desc* desc = &draft.desc;
    if (!desc->allocator.allocate || !desc->allocator.release) {
        return es_fail(
            &draft, ES_INVALID_ARGUMENT, "es_context_desc.allocator has one of its two functions; give both or neither");
    }
    if (desc->threads > ES_MAX_THREADS) {
        return es_fail(&draft, ES_INVALID_ARGUMENT, "es_context_desc.threads is %u; 1 to %d, or 0 for all, are accepted",
            desc->threads, ES_MAX_THREADS);
    }
    uint32_t usable = desc->isa_mask & es_isa_available_mask();
    if (usable == 0) {
        return es_fail(&draft, ES_ISA_UNAVAILABLE,
            "es_context_desc.isa_mask is 0x%x; the instruction sets available here are 0x%x", desc->isa_mask,
            es_isa_available_mask());
    }
    desc->isa_mask = usable;

    es_context* context = desc->allocator.allocate(desc->allocator.user, sizeof *context, 64);
    if (!context) {
        return es_fail(&draft, ES_OUT_OF_MEMORY, "the allocator returned nothing for the context's %zu bytes", sizeof *context);
    }
    memset(context, 0, sizeof *context);
    context->desc = *desc;
    context->isa = (es_isa)(31 - __builtin_clz(usable));
    pthread_mutex_init(&context->message_mutex, NULL);
    bool own_pool = desc->tasks.run == es_pool_run;
    if (own_pool) context->desc.tasks.user = context;
    if (!es_pool_start(&context->pool, own_pool ? desc->threads - 1 : 0)) {
        pthread_mutex_destroy(&context->message_mutex);
        desc->allocator.release(desc->allocator.user, context, sizeof *context);
        return es_fail(&draft, ES_OUT_OF_MEMORY, "the system did not start %u threads; es_context_desc.threads = 1 needs none",
            desc->threads - 1);
    }
    *out = context;
    return ES_OK;
}

void es_context_destroy(es_context* context)
{
    if (!context) return;
    es_pool_stop(&context->pool);
    int objects = atomic_load(&context->objects);
    size_t bytes = atomic_load(&context->bytes);
    if (objects != 0 || bytes != 0) {
        es_log(context, ES_LOG_WARNING, ES_WRONG_STATE,
            "the context ends while %d objects and %zu bytes created from it exist; destroy them first", objects, bytes);
    }
    pthread_mutex_destroy(&context->message_mutex);
    es_allocator allocator = context->desc.allocator;
    allocator.release(allocator.user, context, sizeof *context);
}

es_context_desc es_context_resolved_desc(const es_context* context)
{
    return context ? context->desc : es_default_context_desc();
}
es_isa es_context_isa(const es_context* context) { return context ? context->isa : ES_ISA_SCALAR; }
uint32_t es_context_workers(const es_context* context) { return context->desc.threads; }

double es_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
