/* The context itself, for the platform's own files; the floors above see platform/context.h. */
#ifndef EARTHSHINE_PLATFORM_CONTEXT_INTERNAL_H
#define EARTHSHINE_PLATFORM_CONTEXT_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "platform/context.h"

enum { ES_MAX_THREADS = 64, ES_MESSAGE_SIZE = 1024 };

typedef struct es_pool {
    pthread_mutex_t mutex; /* over everything below but the two atomics, which are written under it and spun upon outside */
    pthread_cond_t wake;   /* a job was posted, or the pool stops */
    pthread_cond_t done;   /* the last task of the job ended */
    void (*task)(void* data, uint32_t index);
    void* data;
    uint32_t count, next; /* tasks of the job, and the first not yet claimed */
    uint32_t sleeping;    /* threads waiting for `wake` */
    bool caller_waits, stop;
    atomic_uint generation; /* jobs posted so far */
    atomic_uint unfinished; /* tasks of the job that have not ended */
    uint32_t thread_count;  /* beside the caller's */
    pthread_t threads[ES_MAX_THREADS - 1];
} es_pool;

struct es_context {
    es_context_desc desc; /* resolved */
    es_isa isa;
    es_pool pool; /* thread_count 0 with threads = 1 or the user's tasks */
    atomic_bool in_loop;
    atomic_size_t bytes, peak_bytes;
    atomic_int objects;
    atomic_uint_least64_t serials;  /* handed out by es_context_next_serial */
    pthread_mutex_t message_mutex;
    es_result last_result;
    char message[ES_MESSAGE_SIZE];
};

/* Runs tasks on the context's pool; what es_context_desc.tasks resolves to. `user` is the context. */
void es_pool_run(void* user, uint32_t count, void (*task)(void* data, uint32_t index), void* data);
/* Starts `thread_count` threads; false, with none left running, when the system gives fewer. */
bool es_pool_start(es_pool* pool, uint32_t thread_count);
void es_pool_stop(es_pool* pool);
uint32_t es_usable_processors(void);

#endif
