/* What is held, and how far from there the rest may be.
 *
 * Long-range attachments (Kim, Chentanez, Müller-Fischer, "Long Range Attachments", 2012): a particle is never farther from a held one than
 * the way along the cloth at rest. Each gets the two nearest held ones, which is what makes small steps of one iteration enough: links
 * alone carry a pull one sweep at a time. Ways are the shortest along links; on a cloth that is flat at rest and where they nearly
 * are straight, the straight distance, for links make a way up to 8 % longer than it is.
 * Only for what is held by nodes and the world (a body must feel the pull of links), and only where nothing may stretch. */
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/rigid.h"

es_vec3 es_soft_hold_place(const es_world* world, const es_soft_object* soft, const es_soft_hold* hold)
{
    const es_vec3 l = hold->local;
    double place[3] = {(double)l.x, (double)l.y, (double)l.z};
    const es_body_object* body = hold->body ? es_slots_get(&world->slots[ES_OBJECT_BODY], hold->body) : NULL;
    if (body) {
        double position[3];
        es_vec3 turned = es_quat_rotate(body->rotation, l);
        es_body_position(body, body->centre, body->rotation, position);
        place[0] = position[0] + (double)turned.x;
        place[1] = position[1] + (double)turned.y;
        place[2] = position[2] + (double)turned.z;
    } else if (hold->node) {
        const es_mat4* m = es_node_world(world, (es_node){hold->node});
        const double* position = es_node_position(world, (es_node){hold->node});
        for (int k = 0; k < 3; k++) place[k] = position[k] + (double)m->m[k] * (double)l.x + (double)m->m[4 + k] * (double)l.y + (double)m->m[8 + k] * (double)l.z;
    }
    float p[3];
    for (int k = 0; k < 3; k++) p[k] = es_clampf((float)(place[k] - soft->origin[k]), -1e7f, 1e7f);
    return es_v3(p[0], p[1], p[2]);
}

es_vec3 es_soft_local_place(const es_world* world, const es_soft_object* soft, const es_soft_hold* hold)
{
    const float* x = soft->x + 4 * (size_t)soft->layout.slot_of[hold->particle];
    double place[3];
    for (int k = 0; k < 3; k++) place[k] = soft->origin[k] + (double)x[k];
    const es_body_object* body = hold->body ? es_slots_get(&world->slots[ES_OBJECT_BODY], hold->body) : NULL;
    if (body) {
        double position[3];
        const es_quat q = body->rotation;
        es_body_position(body, body->centre, body->rotation, position);
        return es_quat_rotate((es_quat){-q.x, -q.y, -q.z, q.w}, es_v3((float)(place[0] - position[0]), (float)(place[1] - position[1]), (float)(place[2] - position[2])));
    }
    if (!hold->node) return es_v3((float)place[0], (float)place[1], (float)place[2]);
    es_mat4 turned = *es_node_world(world, (es_node){hold->node}), inverse;
    const double* position = es_node_position(world, (es_node){hold->node});
    turned.m[12] = turned.m[13] = turned.m[14] = 0;
    es_mat4_inverse(&turned, &inverse);
    return es_mat4_direction(&inverse, es_v3((float)(place[0] - position[0]), (float)(place[1] - position[1]), (float)(place[2] - position[2])));
}

/* ---- the nearest two ---------------------------------------------------------------------------------------------------- */

typedef struct arrival { float way; uint32_t particle, hold; } arrival;

static bool sooner(const arrival* a, const arrival* b)
{
    if (a->way != b->way) return a->way < b->way;
    return a->particle != b->particle ? a->particle < b->particle : a->hold < b->hold;
}

static void push(arrival* heap, size_t* count, arrival new)
{
    size_t at = (*count)++;
    for (; at > 0 && sooner(&new, &heap[(at - 1) / 2]); at = (at - 1) / 2) heap[at] = heap[(at - 1) / 2];
    heap[at] = new;
}

static arrival pop(arrival* heap, size_t* count)
{
    arrival first = heap[0], last = heap[--*count];
    size_t at = 0;
    for (size_t child; (child = 2 * at + 1) < *count; at = child) {
        if (child + 1 < *count && sooner(&heap[child + 1], &heap[child])) child++;
        if (!sooner(&heap[child], &last)) break;
        heap[at] = heap[child];
    }
    heap[at] = last;
    return first;
}

/* Dijkstra's algorithm with two labels per slot, of different holds. */
static bool reach_out(es_soft_object* soft, es_soft_anchors* anchors, es_arena* scratch)
{
    const es_soft_layout* layout = &soft->layout;
    const size_t lanes = (size_t)layout->link_count * 8, slots = layout->slot_count;
    uint32_t *first = es_soft_room(scratch, slots + 2, sizeof *first), *next = es_soft_room(scratch, 2 * lanes, sizeof *next);
    float* length = es_soft_room(scratch, 2 * lanes, sizeof *length);
    arrival* heap = es_soft_room(scratch, 4 * lanes + soft->hold_count, sizeof *heap);
    if (!first || !next || !length || !heap) return false;
    memset(first, 0, (slots + 2) * sizeof *first);
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t k = 0; k < layout->link_count; k++)
            for (uint32_t lane = 0; lane < layout->links[k].count; lane++) {
                uint32_t a = layout->links[k].a[lane], b = layout->links[k].b[lane];
                if (pass == 0) {
                    first[a + 2]++;
                    first[b + 2]++;
                    continue;
                }
                length[first[a + 1]] = length[first[b + 1]] = layout->links[k].rest[lane];
                next[first[a + 1]++] = b;
                next[first[b + 1]++] = a;
            }
        for (size_t s = 0; s < slots && pass == 0; s++) first[s + 2] += first[s + 1];
    }
    size_t count = 0;
    for (uint32_t i = 0; i < soft->hold_count; i++)
        if (!soft->holds[i].body) push(heap, &count, (arrival){0, layout->slot_of[soft->holds[i].particle], i});
    while (count) {
        arrival a = pop(heap, &count);
        int label = anchors->index[0][a.particle] == ES_SOFT_NONE ? 0 : anchors->index[0][a.particle] != a.hold && anchors->index[1][a.particle] == ES_SOFT_NONE ? 1 : -1;
        if (label < 0) continue;
        anchors->index[label][a.particle] = a.hold;
        anchors->reach[label][a.particle] = a.way;
        anchors->active = true;
        for (uint32_t k = first[a.particle]; k < first[a.particle + 1]; k++) {
            uint32_t to = next[k];
            if (anchors->index[0][to] == a.hold || anchors->index[1][to] != ES_SOFT_NONE) continue;
            push(heap, &count, (arrival){a.way + length[k], to, a.hold});
        }
    }
    return true;
}

static float straight(const es_soft_object* soft, uint32_t a, uint32_t b)
{
    const float *p = soft->rest + 3 * (size_t)a, *q = soft->rest + 3 * (size_t)b;
    float x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return es_sqrt(x * x + y * y + z * z);
}

bool es_soft_make_anchors(es_context* context, es_soft_object* soft)
{
    const es_soft_layout* layout = &soft->layout;
    es_soft_anchors anchors = {0};
    es_arena scratch;
    es_arena_init(&anchors.arena, context, 1 << 12);
    es_arena_init(&scratch, context, 1 << 16);
    bool good = true;
    const size_t ends = 4 * ((size_t)soft->hold_count + ES_HANDS);
    anchors.start = es_soft_room(&anchors.arena, ends, sizeof(float));
    anchors.end = es_soft_room(&anchors.arena, ends, sizeof(float));
    good = anchors.start && anchors.end;
    if (good) {
        memset(anchors.start, 0, ends * sizeof(float));
        memset(anchors.end, 0, ends * sizeof(float));
    }
    bool wanted = soft->tetrahedron_count == 0 && soft->desc.stretch_compliance == 0 && soft->hold_count > 0;
    for (int k = 0; k < 2 && good && wanted; k++) {
        anchors.index[k] = es_soft_room(&anchors.arena, layout->slot_count, sizeof(uint32_t));
        anchors.reach[k] = es_soft_room(&anchors.arena, layout->slot_count, sizeof(float));
        good = anchors.index[k] && anchors.reach[k];
        if (good) memset(anchors.index[k], 0xff, layout->slot_count * sizeof(uint32_t));
    }
    if (good && wanted) good = reach_out(soft, &anchors, &scratch);
    es_arena_free(&scratch);
    if (!good) {
        es_arena_free(&anchors.arena);
        return false;
    }
    for (uint32_t s = 0; s < layout->slot_count && wanted; s++)
        for (int k = 0; k < 2; k++) {
            if (anchors.index[k][s] == ES_SOFT_NONE) {
                anchors.index[k][s] = 0;
                anchors.reach[k][s] = 1e15f;
                continue;
            }
            float line = straight(soft, layout->particle_of[s], soft->holds[anchors.index[k][s]].particle);
            if (soft->planar && anchors.reach[k][s] <= 1.09f * line) anchors.reach[k][s] = line;
        }
    if (soft->anchors.arena.context) es_arena_free(&soft->anchors.arena);
    soft->anchors = anchors;
    soft->anchors.made = true;
    for (uint32_t p = 0; p < soft->particle_count; p++) soft->x[4 * (size_t)layout->slot_of[p] + 3] = 1.0f / soft->mass[p];
    for (uint32_t i = 0; i < soft->hold_count; i++)
        if (!soft->holds[i].body) soft->x[4 * (size_t)layout->slot_of[soft->holds[i].particle] + 3] = 0;
    return true;
}
