/* Tearing: a particle parts into two, and the triangles on one side of it go with the new one.
 *
 * An edge that is too long pulls two particles apart; the crack goes through one of them, at right angles to the edge. Where that
 * parts nothing (a corner, a strip of one triangle) or nothing is left in reserve, the edge's triangles vanish. */
#include "sim/soft/soft.h"
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/kernel_table.h"

enum { TEARS_PER_STEP = 64 };

static bool held(const es_soft_object* soft, uint32_t particle)
{
    for (uint32_t i = 0; i < soft->hold_count; i++)
        if (soft->holds[i].particle == particle) return true;
    return false;
}

static const float* place(const es_soft_object* soft, uint32_t particle)
{
    return soft->x + 4 * (size_t)soft->layout.slot_of[particle < soft->carried ? particle : soft->parent[particle - soft->first_particles]];
}

static float along(const es_soft_object* soft, const uint32_t* c, const float* p, es_vec3 axis)
{
    es_vec3 centre = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        const float* q = place(soft, c[k]);
        centre = es_v3_add(centre, es_v3((q[0] - p[0]) / 3, (q[1] - p[1]) / 3, (q[2] - p[2]) / 3));
    }
    return es_v3_dot(centre, axis);
}

/* Parts particle p towards q; false when all its triangles are on one side. */
static bool part(es_soft_object* soft, uint32_t p, uint32_t q)
{
    if (soft->particle_count >= soft->particle_room) return false;
    const float *from = place(soft, p), *to = place(soft, q);
    const es_vec3 axis = es_v3(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
    uint32_t sides[2] = {0, 0};
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t t = 0; t < soft->triangle_count; t++) {
            uint32_t* c = soft->corners + 3 * (size_t)t;
            if (c[0] == ES_SOFT_NONE || (c[0] != p && c[1] != p && c[2] != p)) continue;
            bool beyond = along(soft, c, from, axis) > 0;
            if (pass == 0) sides[beyond]++;
            for (int k = 0; k < 3 && pass == 1 && beyond; k++)
                if (c[k] == p) c[k] = soft->particle_count;
        }
        if (pass == 0 && (sides[0] == 0 || sides[1] == 0)) return false;
    }
    const uint32_t added = soft->particle_count++;
    const float share = (float)sides[1] / (float)(sides[0] + sides[1]);
    memcpy(soft->rest + 3 * (size_t)added, soft->rest + 3 * (size_t)p, 3 * sizeof(float));
    soft->mass[added] = soft->mass[p] * share;
    soft->mass[p] -= soft->mass[added];
    soft->first_vertex[added] = soft->first_vertex[p];
    soft->parent[added - soft->first_particles] = p < soft->carried ? p : soft->parent[p - soft->first_particles];
    soft->torn++;
    return true;
}

static void drop(es_soft_object* soft, uint32_t a, uint32_t b)
{
    for (uint32_t t = 0; t < soft->triangle_count; t++) {
        uint32_t* c = soft->corners + 3 * (size_t)t;
        if (c[0] == ES_SOFT_NONE) continue;
        int both = 0;
        for (int k = 0; k < 3; k++) both += (c[k] == a) + (c[k] == b);
        if (both < 2) continue;
        c[0] = c[1] = c[2] = ES_SOFT_NONE;
        soft->torn++;
    }
}

/* Does a triangle still have the edge? What tore before in this step may have taken it. */
static bool joined(const es_soft_object* soft, uint32_t a, uint32_t b)
{
    for (uint32_t t = 0; t < soft->triangle_count; t++) {
        const uint32_t* c = soft->corners + 3 * (size_t)t;
        int both = 0;
        for (int k = 0; k < 3; k++) both += (c[k] == a) + (c[k] == b);
        if (both >= 2) return true;
    }
    return false;
}

/* Each triangle round the particle gets one of its own. */
static void explode(es_soft_object* soft, uint32_t p)
{
    uint32_t count = 0, seen = 0;
    for (uint32_t t = 0; t < soft->triangle_count; t++) {
        const uint32_t* c = soft->corners + 3 * (size_t)t;
        count += c[0] != ES_SOFT_NONE && (c[0] == p || c[1] == p || c[2] == p);
    }
    const float mass = soft->mass[p] / (float)(count ? count : 1);
    for (uint32_t t = 0; t < soft->triangle_count && count > 1; t++) {
        uint32_t* c = soft->corners + 3 * (size_t)t;
        if (c[0] == ES_SOFT_NONE || (c[0] != p && c[1] != p && c[2] != p) || seen++ == 0) continue; /* the first one keeps it */
        soft->torn++;
        if (soft->particle_count >= soft->particle_room) {
            c[0] = c[1] = c[2] = ES_SOFT_NONE;
            continue;
        }
        const uint32_t added = soft->particle_count++;
        for (int k = 0; k < 3; k++)
            if (c[k] == p) c[k] = added;
        memcpy(soft->rest + 3 * (size_t)added, soft->rest + 3 * (size_t)p, 3 * sizeof(float));
        soft->mass[added] = mass;
        soft->mass[p] -= mass;
        soft->first_vertex[added] = soft->first_vertex[p];
        soft->parent[added - soft->first_particles] = p;
    }
}

static void tear(es_soft_object* soft, uint32_t a, uint32_t b)
{
    if (!joined(soft, a, b)) return;
    if (held(soft, a) || (!held(soft, b) && a > b)) {
        uint32_t other = a;
        a = b;
        b = other;
    }
    if (!part(soft, a, b) && !part(soft, b, a)) drop(soft, a, b);
}

/* ---- what follows from the topology ------------------------------------------------------------------------------------------- */

/* The mesh that shows the corners, made apart from the one that is shown. */
typedef struct torn_mesh { es_arena arena; uint32_t *indices, *particle_at, *source, *weld, used; es_vertex_fans fans; } torn_mesh;

static void* copy_of(es_arena* arena, const void* from, size_t bytes)
{
    void* copy = es_soft_room(arena, bytes, 1);
    if (copy) memcpy(copy, from, bytes);
    return copy;
}

/* Vertices of one particle share their normal. */
static void weld_vertices(const uint32_t* particle_at, uint32_t count, uint32_t* first, uint32_t* weld)
{
    for (uint32_t v = 0; v < count; v++) {
        uint32_t p = particle_at[v];
        if (first[p] == ES_SOFT_NONE) first[p] = v;
        weld[v] = first[p];
    }
}

/* A corner whose particle is no longer its vertex's gets a vertex of the reserve, one per (vertex, particle), in the order of triangles. */
static void show_corners(const es_soft_object* soft, torn_mesh* m, uint32_t* chain)
{
    m->used = soft->first_vertices;
    for (uint32_t t = 0; t < soft->triangle_count; t++) {
        const uint32_t *c = soft->corners + 3 * (size_t)t, *from = soft->mesh_indices + 3 * (size_t)t;
        uint32_t v[3];
        bool there = c[0] != ES_SOFT_NONE;
        for (int k = 0; k < 3 && there; k++) {
            v[k] = from[k];
            uint32_t end = v[k];
            while (v[k] != ES_SOFT_NONE && m->particle_at[v[k]] != c[k]) {
                end = v[k];
                v[k] = chain[v[k]];
            }
            if (v[k] != ES_SOFT_NONE) continue;
            there = m->used < soft->vertex_count;
            if (!there) break;
            v[k] = chain[end] = m->used++;
            m->particle_at[v[k]] = c[k];
            m->source[v[k]] = from[k];
        }
        for (int k = 0; k < 3; k++) m->indices[3 * (size_t)t + k] = there ? v[k] : from[0];
    }
    for (uint32_t v = m->used; v < soft->vertex_count; v++) m->particle_at[v] = m->source[v] = 0;
}

static bool make_torn_mesh(es_world* world, const es_soft_object* soft, const es_mesh_object* mesh, torn_mesh* m)
{
    const size_t vertices = soft->vertex_count * sizeof(uint32_t), particles = soft->particle_room * sizeof(uint32_t);
    *m = (torn_mesh){0};
    es_arena_init(&m->arena, world->context, 1 << 16);
    m->indices = copy_of(&m->arena, mesh->indices, 3 * (size_t)mesh->raster.triangle_count * sizeof *m->indices);
    m->particle_at = copy_of(&m->arena, soft->particle_at, vertices);
    m->source = copy_of(&m->arena, soft->vertex_source, vertices);
    m->weld = es_soft_room(&m->arena, vertices, 1);
    uint32_t *chain = es_soft_room(&m->arena, vertices, 1), *first = es_soft_room(&m->arena, particles, 1); /* vertex, or its copies: the next copy */
    bool good = m->indices && m->particle_at && m->source && m->weld && chain && first;
    if (good) {
        memset(chain, 0xff, vertices);
        memset(first, 0xff, particles);
        show_corners(soft, m, chain);
        weld_vertices(m->particle_at, soft->vertex_count, first, m->weld);
        good = es_vertex_fans_make(world->context, m->indices, mesh->raster.triangle_count, soft->vertex_count, m->weld, &m->fans);
    }
    if (!good) es_arena_free(&m->arena);
    return good;
}

static void show_torn_mesh(es_world* world, es_soft_object* soft, es_mesh_object* mesh, torn_mesh* m)
{
    const size_t vertices = soft->vertex_count * sizeof(uint32_t);
    memcpy(mesh->indices, m->indices, 3 * (size_t)mesh->raster.triangle_count * sizeof *m->indices);
    memcpy(soft->particle_at, m->particle_at, vertices);
    memcpy(soft->vertex_source, m->source, vertices);
    memcpy(soft->weld, m->weld, vertices);
    soft->vertex_used = m->used;
    for (uint32_t v = soft->first_vertices; v < m->used; v++) es_mesh_copy_vertex(mesh, v, m->source[v]);
    if (soft->mesh_fans.first_row) es_vertex_fans_free(world->context, &soft->mesh_fans);
    soft->mesh_fans = m->fans;
    es_arena_free(&m->arena);
    soft->posed = false;
    es_mesh_reindexed(world, mesh);
}

/* Everything that follows from the topology, anew; when memory does not suffice, it is all as it was. */
static bool retopologize(es_world* world, es_soft_object* soft)
{
    es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], soft->desc.mesh.id);
    const es_soft_object before = *soft;
    torn_mesh shown;
    es_soft_layout replaced;
    if (!make_torn_mesh(world, soft, mesh, &shown)) return false;
    bool good = es_soft_lay_out(world->context, soft, &replaced);
    if (good) {
        for (uint32_t p = before.carried; p < soft->particle_count; p++) {
            size_t to = 4 * (size_t)soft->layout.slot_of[p], from = 4 * (size_t)soft->layout.slot_of[soft->parent[p - soft->first_particles]];
            memcpy(soft->x + to, soft->x + from, 4 * sizeof(float));
            memcpy(soft->velocity + to, soft->velocity + from, 4 * sizeof(float));
            memcpy(soft->before + to, soft->before + from, 4 * sizeof(float));
        }
        good = es_soft_make_anchors(world->context, soft);
        es_soft_layout_free(good ? &replaced : &soft->layout);
    }
    if (!good) {
        *soft = before;
        es_vertex_fans_free(world->context, &shown.fans);
        es_arena_free(&shown.arena);
        return false;
    }
    es_soft_wake(soft);
    show_torn_mesh(world, soft, mesh, &shown);
    return true;
}

void es_soft_mend(es_soft_object* soft)
{
    for (size_t i = 0; i < 3 * (size_t)soft->triangle_count; i++) soft->corners[i] = soft->particle_at[soft->mesh_indices[i]];
    memcpy(soft->mass, soft->first_mass, soft->first_particles * sizeof *soft->mass);
}

bool es_soft_relay(es_world* world, es_soft_object* soft)
{
    es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], soft->desc.mesh.id);
    torn_mesh shown;
    soft->carried = 0;
    if (!make_torn_mesh(world, soft, mesh, &shown)) return false;
    if (!es_soft_lay_out(world->context, soft, NULL)) {
        es_vertex_fans_free(world->context, &shown.fans);
        es_arena_free(&shown.arena);
        return false;
    }
    show_torn_mesh(world, soft, mesh, &shown);
    return true;
}

typedef struct torn_edge { uint32_t a, b; } torn_edge; /* b ES_SOFT_NONE: all round a */

static bool tear_edges(es_world* world, es_soft_object* soft, const torn_edge* edges, uint32_t count)
{
    if (count == 0) return true;
    /* corners and masses, to be put back if the rest finds no memory */
    es_arena kept;
    es_arena_init(&kept, world->context, 1 << 16);
    const size_t corner_bytes = 3 * (size_t)soft->triangle_count * sizeof *soft->corners, mass_bytes = soft->particle_count * sizeof *soft->mass;
    const uint32_t *corners = copy_of(&kept, soft->corners, corner_bytes), before = soft->torn, particles = soft->particle_count;
    const float* masses = copy_of(&kept, soft->mass, mass_bytes);
    if (!corners || !masses) {
        es_arena_free(&kept);
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (edges[i].b == ES_SOFT_NONE) explode(soft, edges[i].a);
        else tear(soft, edges[i].a, edges[i].b);
    }
    const bool was_cut = soft->cut;
    soft->cut |= soft->torn != before;
    const bool good = soft->torn == before || retopologize(world, soft);
    if (!good) {
        memcpy(soft->corners, corners, corner_bytes);
        memcpy(soft->mass, masses, mass_bytes);
        soft->particle_count = particles;
        soft->torn = before;
        soft->cut = was_cut;
    }
    es_arena_free(&kept);
    return good;
}

bool es_soft_tear_stretched(es_world* world, es_soft_object* soft)
{
    const es_soft_layout* layout = &soft->layout;
    es_sim_kernel_table(es_context_isa(world->context))->soft_stretch(soft->x, layout->links, layout->link_count, soft->ratio);
    torn_edge edges[TEARS_PER_STEP];
    uint32_t count = 0;
    /* those that tear anyway also tear when a few fewer do at once; the worst of all is always among them */
    size_t worst = 0;
    float most = 0;
    for (size_t i = 0; i < 8 * (size_t)layout->link_count; i++) {
        if (!layout->edges[i] || !(soft->ratio[i] > soft->desc.tear_stretch)) continue;
        torn_edge edge = {layout->particle_of[layout->links[i / 8].a[i % 8]], layout->particle_of[layout->links[i / 8].b[i % 8]]};
        if (soft->ratio[i] > most) {
            most = soft->ratio[i];
            worst = i;
        }
        if (count < TEARS_PER_STEP) edges[count++] = edge;
    }
    if (count == TEARS_PER_STEP) edges[0] = (torn_edge){layout->particle_of[layout->links[worst / 8].a[worst % 8]], layout->particle_of[layout->links[worst / 8].b[worst % 8]]};
    return tear_edges(world, soft, edges, count);
}

static float distance_to_segment(const float* a, const float* b, es_vec3 p)
{
    es_vec3 d = es_v3(b[0] - a[0], b[1] - a[1], b[2] - a[2]), from = es_v3(p.x - a[0], p.y - a[1], p.z - a[2]);
    float squared = es_v3_dot(d, d), t = squared > 0 ? es_clampf(es_v3_dot(d, from) / squared, 0, 1) : 0;
    return es_v3_length(es_v3_sub(from, es_v3_scale(d, t)));
}

es_result es_world_soft_tear(es_world* world, es_soft soft_handle, const double point[3], float radius)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = es_world_object(world, ES_OBJECT_SOFT, soft_handle.id);
    if (!soft) return ES_STALE_HANDLE;
    if (!soft->desc.tearable) return es_fail(world->context, ES_WRONG_STATE, "soft body '%.64s' cannot tear: tearable was not set when it was added", soft->object.name ? soft->object.name : "");
    if (!point || !es_within(radius, 0, 1e6f)) return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_soft_tear: a point and a radius of 0 … 1e6 m are needed");
    es_vec3 p = es_v3((float)(point[0] - soft->origin[0]), (float)(point[1] - soft->origin[1]), (float)(point[2] - soft->origin[2]));
    if (!es_all_within(&p.x, 3, 1e9f)) return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_soft_tear: the point must be finite and within 1e9 m");
    const es_soft_layout* layout = &soft->layout;
    const size_t lanes = 8 * (size_t)layout->link_count, most = lanes + soft->particle_count;
    torn_edge* edges = es_allocate_array(world->context, most, sizeof *edges);
    if (!edges) return es_context_last_result(world->context);
    uint32_t count = 0;
    es_fp_environment environment = es_fp_enter();
    for (uint32_t i = 0; i < soft->particle_count; i++) {
        const float* x = soft->x + 4 * (size_t)layout->slot_of[i];
        if (distance_to_segment(x, x, p) <= radius) edges[count++] = (torn_edge){i, ES_SOFT_NONE};
    }
    for (size_t i = 0; i < lanes; i++) {
        if (!layout->edges[i]) continue;
        uint32_t a = layout->links[i / 8].a[i % 8], b = layout->links[i / 8].b[i % 8];
        const float *from = soft->x + 4 * (size_t)a, *to = soft->x + 4 * (size_t)b;
        if (distance_to_segment(from, to, p) > radius || distance_to_segment(from, from, p) <= radius || distance_to_segment(to, to, p) <= radius) continue;
        edges[count++] = (torn_edge){layout->particle_of[a], layout->particle_of[b]};
    }
    bool good = tear_edges(world, soft, edges, count);
    es_fp_leave(environment);
    es_release(world->context, edges, most * sizeof *edges);
    if (good && world->recording) es_note(world, &(es_input){.type = ES_INPUT_SOFT_TEAR, .id = soft_handle.id, .place = {point[0], point[1], point[2]}, .number = radius});
    return good ? ES_OK : es_context_last_result(world->context);
}

bool es_soft_make_mesh_fans(es_world* world, es_soft_object* soft, const es_mesh_object* mesh)
{
    uint32_t* first = es_allocate_array(world->context, soft->particle_room, sizeof *first);
    if (!first) return false;
    memset(first, 0xff, soft->particle_room * sizeof *first);
    weld_vertices(soft->particle_at, soft->vertex_count, first, soft->weld);
    es_release(world->context, first, soft->particle_room * sizeof *first);
    es_vertex_fans fans;
    if (!es_vertex_fans_make(world->context, mesh->indices, mesh->raster.triangle_count, soft->vertex_count, soft->weld, &fans)) return false;
    if (soft->mesh_fans.first_row) es_vertex_fans_free(world->context, &soft->mesh_fans);
    soft->mesh_fans = fans;
    return true;
}
