/* Energy out of nowhere: see energy_watch.h. */
#include "energy_watch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WINDOW = 30 /* fixed steps */ };

typedef struct member {
    uint32_t id;
    bool soft, dynamic;
    bool drives;             /* not dynamic: has moved in this window. Else: something in this window drove it */
    uint32_t parent;         /* of its group; the root is the group's number */
    double mass, energy;     /* J, at the window's beginning */
    double peak, gain;       /* J: most kinetic energy, and what was gained, since it was driven */
    double place[3];         /* not dynamic: one step ago */
    es_quat rotation;
} member;

/* How many pairs of shapes of two members touch; with none left it is forgotten at the window's end. */
typedef struct touch { uint32_t a, b; int32_t count; } touch;

struct energy_watch {
    member* members;         /* bodies, then soft bodies, each in order of their handles */
    uint32_t body_count, count;
    uint32_t* joints;
    uint32_t joint_count;
    touch* touches;          /* a hashed table; free where a == b */
    uint32_t capacity, used; /* capacity: a power of two */
    uint32_t steps;
    double* sums;            /* per group: energy before, after, what all are allowed */
    energy_gain worst;
};

/* ---- members ------------------------------------------------------------------------------------------------------------------ */

static int by_id(const void* a, const void* b)
{
    const uint32_t x = ((const member*)a)->id, y = ((const member*)b)->id;
    return x < y ? -1 : x > y;
}

/* Of a body; NULL for a null handle. */
static member* find_body(const energy_watch* w, uint32_t id)
{
    const member key = {.id = id};
    return id ? bsearch(&key, w->members, w->body_count, sizeof key, by_id) : NULL;
}

static double height_energy(const es_world* world, double mass, double scale, const double p[3])
{
    const es_vec3 g = es_world_get_settings(world).gravity;
    return -mass * scale * ((double)g.x * p[0] + (double)g.y * p[1] + (double)g.z * p[2]);
}

/* Kinetic and of height; *kinetic the first alone. */
static double energy_of(const es_world* world, member* m, double* kinetic)
{
    es_body_state body;
    es_soft_state soft;
    es_soft_desc desc;
    *kinetic = 0;
    if (m->soft) {
        if (es_world_get_soft_state(world, (es_soft){m->id}, &soft) != ES_OK || es_world_get_soft(world, (es_soft){m->id}, &desc) != ES_OK) return 0;
        m->mass = (double)desc.mass;
        *kinetic = (double)soft.kinetic_energy;
        return *kinetic + height_energy(world, m->mass, (double)desc.gravity_scale, soft.centre);
    }
    if (es_world_get_body(world, (es_body){m->id}, &body) != ES_OK || body.type != ES_BODY_DYNAMIC) return 0;
    m->mass = (double)body.mass;
    *kinetic = (double)body.kinetic_energy;
    return *kinetic + height_energy(world, m->mass, (double)body.gravity_scale, body.centre);
}

static void begin_window(energy_watch* w, const es_world* world)
{
    for (uint32_t i = 0; i < w->count; i++) {
        member* m = &w->members[i];
        double kinetic;
        m->energy = energy_of(world, m, &kinetic);
        if (kinetic > m->peak) m->peak = kinetic;
        m->drives = false;
        m->parent = i;
    }
}

energy_watch* energy_watch_open(const es_world* world)
{
    size_t bodies = 0, softs = 0, joints = 0;
    es_world_enumerate(world, ES_OBJECT_BODY, NULL, &bodies);
    es_world_enumerate(world, ES_OBJECT_SOFT, NULL, &softs);
    es_world_enumerate(world, ES_OBJECT_JOINT, NULL, &joints);
    energy_watch* w = calloc(1, sizeof *w);
    if (!w) return NULL;
    const size_t count = bodies + softs;
    uint32_t* ids = malloc((count + 1) * sizeof *ids);
    w->capacity = 256;
    w->members = calloc(count + 1, sizeof *w->members);
    w->joints = malloc((joints + 1) * sizeof *w->joints);
    w->sums = malloc((3 * count + 1) * sizeof *w->sums);
    w->touches = calloc(w->capacity, sizeof *w->touches);
    if (!ids || !w->members || !w->joints || !w->sums || !w->touches) {
        free(ids);
        energy_watch_close(w);
        return NULL;
    }
    es_world_enumerate(world, ES_OBJECT_BODY, ids, &bodies);
    es_world_enumerate(world, ES_OBJECT_SOFT, ids + bodies, &softs);
    es_world_enumerate(world, ES_OBJECT_JOINT, w->joints, &joints);
    w->body_count = (uint32_t)bodies;
    w->count = (uint32_t)count;
    w->joint_count = (uint32_t)joints;
    for (uint32_t i = 0; i < w->count; i++) w->members[i] = (member){.id = ids[i], .soft = i >= w->body_count};
    free(ids);
    qsort(w->members, w->body_count, sizeof *w->members, by_id);
    for (uint32_t i = 0; i < w->body_count; i++) {
        es_body_state state;
        member* m = &w->members[i];
        if (es_world_get_body(world, (es_body){m->id}, &state) != ES_OK) continue;
        m->dynamic = state.type == ES_BODY_DYNAMIC;
        memcpy(m->place, state.position, sizeof m->place);
        m->rotation = state.rotation;
    }
    for (uint32_t i = w->body_count; i < w->count; i++) w->members[i].dynamic = true;
    begin_window(w, world);
    return w;
}

void energy_watch_close(energy_watch* w)
{
    if (!w) return;
    free(w->members);
    free(w->joints);
    free(w->sums);
    free(w->touches);
    free(w);
}

energy_gain energy_watch_worst(const energy_watch* w) { return w->worst; }

/* ---- what touches ------------------------------------------------------------------------------------------------------------ */

static touch* find_touch(touch* table, uint32_t capacity, uint32_t a, uint32_t b)
{
    uint32_t at = (a * 0x9e3779b1u ^ b * 0x85ebca77u) >> 8 & (capacity - 1);
    while (table[at].a != table[at].b && (table[at].a != a || table[at].b != b)) at = (at + 1) & (capacity - 1);
    return &table[at];
}

static bool grow_touches(energy_watch* w)
{
    const uint32_t capacity = 2 * w->capacity;
    touch* table = calloc(capacity, sizeof *table);
    if (!table) return false;
    for (uint32_t i = 0; i < w->capacity; i++)
        if (w->touches[i].a != w->touches[i].b) *find_touch(table, capacity, w->touches[i].a, w->touches[i].b) = w->touches[i];
    free(w->touches);
    w->touches = table;
    w->capacity = capacity;
    return true;
}

static bool see_contacts(energy_watch* w, const es_world* world)
{
    size_t count;
    const es_contact_event* events = es_world_contact_events(world, &count);
    for (size_t i = 0; i < count; i++) {
        const member *a = find_body(w, events[i].a.id), *b = find_body(w, events[i].b.id);
        if (!a || !b || a == b || events[i].sensor) continue;
        if (2 * w->used + 2 > w->capacity && !grow_touches(w)) return false;
        uint32_t x = (uint32_t)(a - w->members), y = (uint32_t)(b - w->members);
        touch* t = find_touch(w->touches, w->capacity, x < y ? x : y, x < y ? y : x);
        if (t->a == t->b) {
            *t = (touch){x < y ? x : y, x < y ? y : x, 0};
            w->used++;
        }
        t->count += events[i].enter ? 1 : -1;
    }
    return true;
}

/* Forgets pairs that have parted. */
static void drop_touches(energy_watch* w)
{
    touch* kept = w->touches;
    uint32_t count = 0;
    for (uint32_t i = 0; i < w->capacity; i++)
        if (w->touches[i].a != w->touches[i].b && w->touches[i].count > 0) count++;
    if (count == w->used) return;
    touch* table = calloc(w->capacity, sizeof *table);
    if (!table) return; /* then they stay, and more is left out than need be */
    for (uint32_t i = 0; i < w->capacity; i++)
        if (kept[i].a != kept[i].b && kept[i].count > 0) *find_touch(table, w->capacity, kept[i].a, kept[i].b) = kept[i];
    free(kept);
    w->touches = table;
    w->used = count;
}

/* ---- groups ------------------------------------------------------------------------------------------------------------------- */

static uint32_t root_of(energy_watch* w, uint32_t i)
{
    while (w->members[i].parent != i) i = w->members[i].parent = w->members[w->members[i].parent].parent;
    return i;
}

/* A body that is not dynamic passes nothing on, but drives what it touches when it moves. */
static void join(energy_watch* w, member* a, member* b)
{
    if (a->dynamic && b->dynamic) w->members[root_of(w, (uint32_t)(a - w->members))].parent = root_of(w, (uint32_t)(b - w->members));
    else if (a->dynamic) a->drives |= b->drives;
    else if (b->dynamic) b->drives |= a->drives;
}

static void see_joints(energy_watch* w, const es_world* world)
{
    for (uint32_t i = 0; i < w->joint_count; i++) {
        es_joint_desc desc;
        es_joint_state state;
        if (es_world_get_joint(world, (es_joint){w->joints[i]}, &desc) != ES_OK || es_world_get_joint_state(world, (es_joint){w->joints[i]}, &state) != ES_OK || state.broken) continue;
        member *a = find_body(w, desc.a.id), *b = find_body(w, desc.b.id);
        const bool drives = desc.motor || desc.type == ES_JOINT_MOTOR || desc.hertz > 0;
        if (a && a->dynamic) a->drives |= drives;
        if (b && b->dynamic) b->drives |= drives;
        if (a && b) join(w, a, b);
    }
}

static void see_hands(energy_watch* w, const es_world* world)
{
    for (uint32_t hand = 0; hand < ES_HANDS; hand++) {
        es_hand_state state;
        if (es_world_get_hand(world, hand, &state) != ES_OK) continue;
        member* held = find_body(w, state.body.id);
        if (held) held->drives = true;
        for (uint32_t i = w->body_count; state.soft && i < w->count; i++) w->members[i].drives |= w->members[i].id == state.soft;
    }
}

/* Contacts of soft bodies are not reported: whatever is in a box about one counts as touched. */
static void see_softs(energy_watch* w, es_world* world)
{
    for (uint32_t i = w->body_count; i < w->count; i++) {
        member* m = &w->members[i];
        es_soft_state state;
        es_soft_desc desc;
        if (es_world_get_soft_state(world, (es_soft){m->id}, &state) != ES_OK || es_world_get_soft(world, (es_soft){m->id}, &desc) != ES_OK) continue;
        if (state.attachments || desc.pressure != 0 || desc.wind.x != 0 || desc.wind.y != 0 || desc.wind.z != 0) m->drives = true;
        double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, p[3];
        for (uint32_t v = 0; es_world_get_soft_vertex(world, (es_soft){m->id}, v, p, NULL) == ES_OK; v++)
            for (int k = 0; k < 3; k++) {
                low[k] = fmin(low[k], p[k]);
                high[k] = fmax(high[k], p[k]);
            }
        if (!isfinite(low[0])) continue;
        const float around = desc.thickness + 0.1f;
        es_shape_desc box = es_default_shape_desc();
        box.half_extents = (es_vec3){(float)(0.5 * (high[0] - low[0])) + around, (float)(0.5 * (high[1] - low[1])) + around, (float)(0.5 * (high[2] - low[2])) + around};
        const double centre[3] = {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])};
        es_body near[256];
        size_t count = sizeof near / sizeof near[0];
        const bool all = es_world_overlap(world, &box, centre, (es_quat){0, 0, 0, 1}, 0, near, &count) == ES_OK && count <= sizeof near / sizeof near[0];
        for (size_t n = 0; all && n < count; n++) {
            member* other = find_body(w, near[n].id);
            if (other) join(w, m, other);
        }
        for (uint32_t n = 0; !all && n < w->body_count; n++) join(w, m, &w->members[n]);
    }
}

/* ---- judging -------------------------------------------------------------------------------------------------------------------- */

static double allowed_of(const member* m) { return m->mass * 9.81 * (m->soft ? ENERGY_SOFT_HEIGHT : ENERGY_HEIGHT) + ENERGY_SHARE * m->peak; }

static void judge(energy_watch* w, es_world* world)
{
    for (uint32_t i = 0; i < w->capacity; i++)
        if (w->touches[i].a != w->touches[i].b) join(w, &w->members[w->touches[i].a], &w->members[w->touches[i].b]);
    see_joints(w, world);
    see_hands(w, world);
    see_softs(w, world);
    memset(w->sums, 0, 3 * (size_t)w->count * sizeof *w->sums);
    for (uint32_t i = 0; i < w->count; i++) {
        member* m = &w->members[i];
        if (!m->dynamic) continue;
        const uint32_t root = root_of(w, i);
        if (m->drives) w->members[root].drives = true;
        double kinetic, *sum = &w->sums[3 * (size_t)root];
        sum[0] += m->energy;
        sum[1] += energy_of(world, m, &kinetic);
        if (kinetic > m->peak) m->peak = kinetic;
        sum[2] += allowed_of(m);
    }
    for (uint32_t i = 0; i < w->count; i++) {
        member* m = &w->members[i];
        if (!m->dynamic) continue;
        const uint32_t root = root_of(w, i);
        const double* sum = &w->sums[3 * (size_t)root];
        if (w->members[root].drives) {
            m->gain = m->peak = 0;
            w->worst.driven++;
            continue;
        }
        w->worst.judged++;
        const double allowed = allowed_of(m);
        m->gain = fmax(0, m->gain + (sum[2] > 0 ? (sum[1] - sum[0]) * allowed / sum[2] : 0));
        if (w->worst.id && m->gain * w->worst.allowed <= w->worst.joules * allowed) continue;
        w->worst.joules = m->gain;
        w->worst.allowed = allowed;
        w->worst.time = es_world_time(world);
        w->worst.kind = m->soft ? ES_OBJECT_SOFT : ES_OBJECT_BODY;
        w->worst.id = m->id;
    }
}

bool energy_watch_step(energy_watch* w, es_world* world)
{
    if (!see_contacts(w, world)) return false;
    for (uint32_t i = 0; i < w->body_count; i++) {
        member* m = &w->members[i];
        es_body_state state;
        if (m->dynamic || es_world_get_body(world, (es_body){m->id}, &state) != ES_OK) continue;
        if (memcmp(m->place, state.position, sizeof m->place) != 0 || memcmp(&m->rotation, &state.rotation, sizeof m->rotation) != 0) m->drives = true;
        memcpy(m->place, state.position, sizeof m->place);
        m->rotation = state.rotation;
    }
    if (++w->steps % WINDOW) return true;
    judge(w, world);
    drop_touches(w);
    begin_window(w, world);
    return true;
}
