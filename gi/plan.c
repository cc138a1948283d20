#include "gi/plan.h"

#include "platform/context.h"
#include "platform/random.h"

static const char* const pass_names[] = {
#define NAME(id, name, unit) name,
    ES_PASSES(NAME)
#undef NAME
};
static const char* const pass_units[] = {
#define UNIT(id, name, unit) unit,
    ES_PASSES(UNIT)
#undef UNIT
};

void es_plan_begin_frame(es_plan* plan, bool skip)
{
    plan->skip = skip;
    for (int i = 0; i < ES_PASS_COUNT; i++) plan->stats[i] = (es_pass_stats){.name = pass_names[i], .unit = pass_units[i], .skipped = "not reached"};
}

void es_plan_invalidate(es_plan* plan)
{
    for (int i = 0; i < ES_PASS_COUNT; i++) {
        plan->valid[i] = false;
        plan->version[i]++;
    }
}

void es_plan_begin(es_plan* plan, es_pass pass)
{
    plan->pending = (uint64_t)pass;
    plan->started = es_seconds();
}

void es_plan_reads(es_plan* plan, const void* bytes, size_t size) { plan->pending = es_hash_bytes(plan->pending, bytes, size); }

void es_plan_reads_pass(es_plan* plan, es_pass other) { es_plan_reads(plan, &plan->version[other], sizeof plan->version[other]); }

bool es_plan_run(es_plan* plan, es_pass pass)
{
    if (plan->skip && plan->valid[pass] && plan->signature[pass] == plan->pending) {
        plan->stats[pass].skipped = "inputs unchanged";
        return false;
    }
    plan->valid[pass] = false;
    plan->signature[pass] = plan->pending;
    plan->version[pass]++;
    plan->stats[pass].skipped = NULL;
    return true;
}

void es_plan_done(es_plan* plan, es_pass pass, uint64_t count)
{
    plan->valid[pass] = true;
    plan->stats[pass].count = count;
    plan->stats[pass].milliseconds = (es_seconds() - plan->started) * 1e3;
}

void es_plan_not_needed(es_plan* plan, es_pass pass, const char* why)
{
    if (plan->valid[pass]) plan->version[pass]++;
    plan->valid[pass] = false;
    plan->stats[pass].skipped = why;
}
