/* Undo and redo: the edits as bytes, one after the other; as many as fit. */
#include "sim/edits/edit_state.h"

typedef struct es_edit_moment { char* bytes; size_t size; char label[ES_EDIT_NAME]; } es_edit_moment;

struct es_edit_history {
    es_world* world;
    es_edit_moment* moments;  /* oldest first; the label says what led there */
    size_t count, capacity, present; /* present: the moment the world is at, or was before what is not committed */
    size_t bytes, limit;
};

static void forget(es_edit_history* h, size_t first, size_t number)
{
    es_context* context = h->world->context;
    for (size_t i = first; i < first + number; i++) {
        h->bytes -= h->moments[i].size;
        es_release(context, h->moments[i].bytes, h->moments[i].size);
    }
    memmove(h->moments + first, h->moments + first + number, (h->count - first - number) * sizeof *h->moments);
    h->count -= number;
}

/* The world as it is, as a moment; false after es_fail. */
static bool record(es_edit_history* h, const char* label, es_edit_moment* m)
{
    memset(m, 0, sizeof *m);
    m->size = es_edits_write(h->world, false, NULL);
    m->bytes = es_allocate(h->world->context, m->size);
    if (!m->bytes) return false;
    es_edits_write(h->world, false, m->bytes);
    if (label) strncpy(m->label, label, sizeof m->label - 1);
    return true;
}

es_result es_edit_history_create(es_world* world, size_t max_bytes, es_edit_history** history)
{
    if (!world || !history) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    *history = NULL;
    es_edit_history* h = es_allocate_zero(context, sizeof *h);
    if (!h) return es_context_last_result(context);
    h->world = world;
    h->limit = max_bytes ? max_bytes : (size_t)16 << 20;
    es_edit_moment first;
    if (!es_grow(context, (void**)&h->moments, &h->capacity, 0, 1, sizeof *h->moments) || !record(h, NULL, &first)) {
        es_release(context, h->moments, h->capacity * sizeof *h->moments);
        es_release(context, h, sizeof *h);
        return es_context_last_result(context);
    }
    h->moments[h->count++] = first;
    h->bytes = first.size;
    es_context_count_object(context, 1);
    *history = h;
    return ES_OK;
}

void es_edit_history_destroy(es_edit_history* history)
{
    if (!history) return;
    es_context* context = history->world->context;
    forget(history, 0, history->count);
    es_release(context, history->moments, history->capacity * sizeof *history->moments);
    es_release(context, history, sizeof *history);
    es_context_count_object(context, -1);
}

es_result es_edit_history_commit(es_edit_history* h, const char* label)
{
    if (!h) return ES_INVALID_ARGUMENT;
    es_context* context = h->world->context;
    es_edit_moment now;
    if (!record(h, label, &now)) return es_context_last_result(context);
    const es_edit_moment* before = &h->moments[h->present];
    bool same = before->size == now.size && memcmp(before->bytes, now.bytes, now.size) == 0;
    if (same || !es_grow(context, (void**)&h->moments, &h->capacity, h->count, h->present + 2, sizeof *h->moments)) {
        es_release(context, now.bytes, now.size);
        return same ? ES_OK : es_context_last_result(context);
    }
    forget(h, h->present + 1, h->count - h->present - 1);
    h->moments[h->count++] = now;
    h->bytes += now.size;
    h->present++;
    size_t old = 0;
    for (size_t left = h->bytes; left > h->limit && old < h->present; old++) left -= h->moments[old].size;
    forget(h, 0, old);
    h->present -= old;
    return ES_OK;
}

static es_result go(es_edit_history* h, size_t to)
{
    es_edit_stage* stage;
    es_result result = es_edits_stage(h->world, false, h->moments[to].bytes, h->moments[to].size, &stage);
    if (result == ES_FILE_DAMAGED) return es_fail(h->world->context, result, "undoing: what was kept is damaged");
    if (result != ES_OK) return result;
    es_edits_take(h->world, stage);
    h->present = to;
    es_edits_note_all(h->world);
    return ES_OK;
}

es_result es_edit_history_undo(es_edit_history* history)
{
    if (!history) return ES_INVALID_ARGUMENT;
    es_result result = es_edit_history_commit(history, NULL);
    if (result != ES_OK || !history->present) return result;
    return go(history, history->present - 1);
}

es_result es_edit_history_redo(es_edit_history* history)
{
    if (!history) return ES_INVALID_ARGUMENT;
    es_result result = es_edit_history_commit(history, NULL);
    if (result != ES_OK || history->present + 1 >= history->count) return result;
    return go(history, history->present + 1);
}

const char* es_edit_history_undo_label(const es_edit_history* h) { return h && h->present ? h->moments[h->present].label : NULL; }
const char* es_edit_history_redo_label(const es_edit_history* h) { return h && h->present + 1 < h->count ? h->moments[h->present + 1].label : NULL; }
