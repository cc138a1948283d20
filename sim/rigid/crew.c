/* See crew.h. */
#include "sim/rigid/crew.h"

#include <stdatomic.h>

typedef struct crew {
    const es_stage* stages;
    uint32_t count;
    es_crew_body body;
    void* user;
    atomic_flag led;
    /* stage << 32 | next block; each on its own cache line, or all threads would wait for all of them */
    _Alignas(64) _Atomic uint64_t claim;
    _Alignas(64) atomic_uint done;
    _Alignas(64) atomic_bool over;
} crew;

static uint32_t blocks_of(const es_stage* stage) { return stage->end > stage->begin ? (stage->end - stage->begin + stage->grain - 1) / stage->grain : 0; }

static void run_block(const crew* c, const es_stage* stage, uint32_t block)
{
    uint32_t begin = stage->begin + block * stage->grain, left = stage->end - begin;
    c->body(c->user, stage->kind, begin, left > stage->grain ? begin + stage->grain : stage->end);
}

static void lead(crew* c)
{
    for (uint32_t s = 0; s < c->count; s++) {
        const es_stage* stage = &c->stages[s];
        uint32_t blocks = blocks_of(stage), turns = 0;
        if (blocks <= 1) { /* not worth telling anyone; the other threads still see the stage before, with no block left */
            if (blocks) run_block(c, stage, 0);
            continue;
        }
        atomic_store_explicit(&c->done, 0, memory_order_relaxed);
        atomic_store_explicit(&c->claim, (uint64_t)s << 32, memory_order_release);
        for (;;) {
            uint32_t block = (uint32_t)atomic_fetch_add_explicit(&c->claim, 1, memory_order_acq_rel);
            if (block >= blocks) break;
            run_block(c, stage, block);
            atomic_fetch_add_explicit(&c->done, 1, memory_order_release);
        }
        while (atomic_load_explicit(&c->done, memory_order_acquire) != blocks) es_wait_a_little(&turns);
    }
    atomic_store_explicit(&c->over, true, memory_order_release);
}

static void follow(crew* c)
{
    uint32_t turns = 0;
    while (!atomic_load_explicit(&c->over, memory_order_acquire)) {
        uint64_t seen = atomic_load_explicit(&c->claim, memory_order_acquire);
        const es_stage* stage = &c->stages[seen >> 32];
        if ((uint32_t)seen >= blocks_of(stage)) {
            es_wait_a_little(&turns);
            continue;
        }
        uint64_t claim = atomic_fetch_add_explicit(&c->claim, 1, memory_order_acq_rel);
        stage = &c->stages[claim >> 32];
        if ((uint32_t)claim >= blocks_of(stage)) continue;
        run_block(c, stage, (uint32_t)claim);
        atomic_fetch_add_explicit(&c->done, 1, memory_order_release);
    }
}

static void join(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    crew* c = user;
    if (!atomic_flag_test_and_set_explicit(&c->led, memory_order_acq_rel)) lead(c);
    else follow(c);
}

void es_crew_run(es_context* context, const es_stage* stages, uint32_t count, es_crew_body body, void* user)
{
    if (count == 0) return;
    crew c = {.stages = stages, .count = count, .body = body, .user = user, .led = ATOMIC_FLAG_INIT};
    /* before the first stage opens there is nothing to claim: its number of blocks, or more */
    atomic_init(&c.claim, (uint64_t)blocks_of(&stages[0]));
    atomic_init(&c.done, 0);
    atomic_init(&c.over, false);
    es_parallel_for(context, es_context_workers(context), 1, join, &c);
}
