/* Parallel loops, and the built-in pool that runs them.
 *
 * A loop becomes at most one task per worker; tasks take chunks from one atomic counter until none is left. Chunk borders do
 * not depend on who takes them, which is all that determinism asks of this file.
 *
 * The pool hands out task indices under its mutex: a loop costs two lockings per task, and tasks are as few as the threads.
 * The caller takes indices too, so a thread that wakes late finds its index taken and delays nothing.
 * A thread that runs out of work watches for the next job for SPIN_SECONDS, about what waking through the kernel costs, and
 * then sleeps: consecutive loops of a frame find it awake, and an idle program burns nothing. */
#if !defined(_GNU_SOURCE)
#define _GNU_SOURCE 1 /* sched_getaffinity */
#endif
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include "platform/context_internal.h"

#define SPIN_SECONDS 40e-6

uint32_t es_usable_processors(void)
{
    long count = 0;
#if defined(__linux__)
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0) count = CPU_COUNT(&set);
#endif
    if (count < 1) count = sysconf(_SC_NPROCESSORS_ONLN);
    return count < 1 ? 1 : count > ES_MAX_THREADS ? ES_MAX_THREADS : (uint32_t)count;
}

static void relax(void)
{
#if defined(__x86_64__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

/* Watches until *value differs from `old` or the time is up. */
static void spin_while(atomic_uint* value, unsigned old)
{
    double end = es_seconds() + SPIN_SECONDS;
    do {
        for (int i = 0; i < 16; i++) {
            if (atomic_load_explicit(value, memory_order_relaxed) != old) return;
            relax();
        }
    } while (es_seconds() < end);
}

/* Takes and runs tasks of the current job until none is left. The mutex is held on entry and exit. */
static void run_tasks(es_pool* pool)
{
    while (pool->next < pool->count) {
        uint32_t index = pool->next++;
        void (*task)(void*, uint32_t) = pool->task;
        void* data = pool->data;
        pthread_mutex_unlock(&pool->mutex);
        task(data, index);
        pthread_mutex_lock(&pool->mutex);
        if (atomic_fetch_sub_explicit(&pool->unfinished, 1, memory_order_relaxed) == 1 && pool->caller_waits) {
            pthread_cond_signal(&pool->done);
        }
    }
}

static void* thread_main(void* data)
{
    es_pool* pool = data;
    unsigned seen = 0;
    for (;;) {
        spin_while(&pool->generation, seen);
        pthread_mutex_lock(&pool->mutex);
        while (!pool->stop && atomic_load_explicit(&pool->generation, memory_order_relaxed) == seen) {
            pool->sleeping++;
            pthread_cond_wait(&pool->wake, &pool->mutex);
            pool->sleeping--;
        }
        bool stop = pool->stop;
        seen = atomic_load_explicit(&pool->generation, memory_order_relaxed);
        if (!stop) run_tasks(pool);
        pthread_mutex_unlock(&pool->mutex);
        if (stop) return NULL;
    }
}

void es_pool_run(void* user, uint32_t count, void (*task)(void* data, uint32_t index), void* data)
{
    es_pool* pool = &((es_context*)user)->pool;
    if (pool->thread_count == 0 || count <= 1) {
        for (uint32_t i = 0; i < count; i++) task(data, i);
        return;
    }
    pthread_mutex_lock(&pool->mutex);
    pool->task = task;
    pool->data = data;
    pool->count = count;
    pool->next = 0;
    atomic_store_explicit(&pool->unfinished, count, memory_order_relaxed);
    atomic_fetch_add_explicit(&pool->generation, 1, memory_order_relaxed);
    /* those that spin need no signal; the caller takes one task */
    uint32_t wake = pool->sleeping < count - 1 ? pool->sleeping : count - 1;
    for (uint32_t i = 0; i < wake; i++) pthread_cond_signal(&pool->wake);
    run_tasks(pool);
    pthread_mutex_unlock(&pool->mutex);

    unsigned left;
    double end = es_seconds() + SPIN_SECONDS;
    while ((left = atomic_load_explicit(&pool->unfinished, memory_order_relaxed)) != 0 && es_seconds() < end) {
        spin_while(&pool->unfinished, left);
    }
    pthread_mutex_lock(&pool->mutex);
    pool->caller_waits = true;
    while (atomic_load_explicit(&pool->unfinished, memory_order_relaxed) != 0) pthread_cond_wait(&pool->done, &pool->mutex);
    pool->caller_waits = false;
    pthread_mutex_unlock(&pool->mutex);
}

bool es_pool_start(es_pool* pool, uint32_t thread_count)
{
    pthread_mutex_init(&pool->mutex, NULL);
    pthread_cond_init(&pool->wake, NULL);
    pthread_cond_init(&pool->done, NULL);
    /* the program's signals are for the program's threads; faults and the profiler's clock strike where they belong */
    static const int own[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGABRT, SIGPROF};
    sigset_t blocked, old;
    sigfillset(&blocked);
    for (unsigned i = 0; i < sizeof own / sizeof own[0]; i++) sigdelset(&blocked, own[i]);
    pthread_sigmask(SIG_SETMASK, &blocked, &old);
    bool complete = true;
    while (complete && pool->thread_count < thread_count) {
        complete = pthread_create(&pool->threads[pool->thread_count], NULL, thread_main, pool) == 0;
        if (complete) pool->thread_count++;
    }
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    if (!complete) es_pool_stop(pool);
    return complete;
}

void es_pool_stop(es_pool* pool)
{
    pthread_mutex_lock(&pool->mutex);
    pool->stop = true;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->mutex);
    for (uint32_t i = 0; i < pool->thread_count; i++) pthread_join(pool->threads[i], NULL);
    pool->thread_count = 0;
    pthread_cond_destroy(&pool->done);
    pthread_cond_destroy(&pool->wake);
    pthread_mutex_destroy(&pool->mutex);
}

/* ---- loops -------------------------------------------------------------------------------------------------------- */

typedef struct loop {
    es_loop_body body;
    void* user;
    uint32_t count, grain, workers;
    uint64_t chunks;
    _Atomic uint64_t next; /* 64 bits: each worker adds one beyond the last chunk */
} loop;

static void run_chunks(void* data, uint32_t worker)
{
    loop* l = data;
    if (worker >= l->workers) return;
    es_fp_environment environment = es_fp_enter();
    for (;;) {
        uint64_t chunk = atomic_fetch_add_explicit(&l->next, 1, memory_order_relaxed);
        if (chunk >= l->chunks) break;
        uint64_t begin = chunk * l->grain, end = begin + l->grain;
        l->body(l->user, (uint32_t)begin, end < l->count ? (uint32_t)end : l->count, worker);
    }
    es_fp_leave(environment);
}

void es_wait_a_little(uint32_t* turns)
{
    if (++*turns % 1024 == 0) sched_yield();
    else relax();
}

void es_parallel_for(es_context* context, uint32_t count, uint32_t grain, es_loop_body body, void* user)
{
    if (count == 0) return;
    if (grain == 0) grain = 1;
    if (atomic_exchange(&context->in_loop, true)) {
        es_misuse(context, ES_WRONG_STATE, "a parallel loop was started inside another; loops do not nest");
        return;
    }
    loop l = {.body = body, .user = user, .count = count, .grain = grain, .workers = context->desc.threads};
    l.chunks = ((uint64_t)count + grain - 1) / grain;
    uint32_t tasks = l.chunks < l.workers ? (uint32_t)l.chunks : l.workers;
    if (tasks > 1) context->desc.tasks.run(context->desc.tasks.user, tasks, run_chunks, &l);
    run_chunks(&l, 0); /* all of it when serial; nothing is left otherwise, unless the user's runner dropped every task */
    atomic_store(&context->in_loop, false);
}
