/* Winding a world back. */
#include "player_history.h"

#include <stdlib.h>

static history_state* state_at(player_history* h, uint32_t at) { return &h->states[(h->first + at) % HISTORY_STATES]; }

static void drop(player_history* h, history_state* state)
{
    h->bytes -= state->size;
    free(state->bytes);
    *state = (history_state){0};
}

static void drop_oldest(player_history* h)
{
    drop(h, state_at(h, 0));
    h->first = (h->first + 1) % HISTORY_STATES;
    h->count--;
    if (h->at) h->at--;
}

static void forget_after(player_history* h, uint32_t at)
{
    while (h->count > at + 1) drop(h, state_at(h, --h->count));
}

void history_add(player_history* h, const es_world* world)
{
    double time = es_world_time(world);
    if (h->count && history_time(h, h->at) == time) return;
    if (h->count) forget_after(h, h->at);
    size_t size = 0, limit = h->limit ? h->limit : (size_t)256 << 20;
    if (es_world_save(world, NULL, &size) != ES_OK || size > limit) return;
    while (h->count && (h->count == HISTORY_STATES || h->bytes + size > limit)) drop_oldest(h);
    void* bytes = malloc(size ? size : 1);
    if (!bytes) return;
    if (es_world_save(world, bytes, &size) != ES_OK) {
        free(bytes);
        return;
    }
    *state_at(h, h->count) = (history_state){time, size, bytes};
    h->at = h->count++;
    h->bytes += size;
}

es_result history_go(player_history* h, es_world* world, uint32_t at)
{
    if (!h->count) return ES_WRONG_STATE;
    if (at >= h->count) at = h->count - 1;
    const history_state* state = state_at(h, at);
    es_result result = es_world_restore(world, state->bytes, state->size);
    if (result == ES_OK) h->at = at;
    return result;
}

double history_time(const player_history* h, uint32_t at)
{
    return at < h->count ? h->states[(h->first + at) % HISTORY_STATES].time : 0;
}

void history_clear(player_history* h)
{
    for (uint32_t i = 0; i < h->count; i++) drop(h, state_at(h, i));
    h->first = h->count = h->at = 0;
}
