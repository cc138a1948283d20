/* From a mesh to particles: a cloth's vertices, those at one place welded; a solid's mesh carried by tetrahedra. */
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/random.h"

/* Per vertex the first one at the same place, to the bit (-0 counts as 0). */
static uint32_t* find_welds(es_arena* arena, es_context* context, const float* positions, uint32_t count)
{
    uint32_t* weld = es_soft_room(arena, count, sizeof *weld);
    size_t size = 16;
    while (size < 2 * (size_t)count) size *= 2;
    uint32_t* table = weld ? es_allocate(context, size * sizeof *table) : NULL;
    if (!table) return NULL;
    memset(table, 0xff, size * sizeof *table);
    for (uint32_t v = 0; v < count; v++) {
        const float p[3] = {positions[4 * (size_t)v] + 0.0f, positions[4 * (size_t)v + 1] + 0.0f, positions[4 * (size_t)v + 2] + 0.0f};
        size_t at = es_hash_bytes(0, p, sizeof p) & (size - 1);
        for (;; at = (at + 1) & (size - 1)) {
            if (table[at] == UINT32_MAX) {
                table[at] = weld[v] = v;
                break;
            }
            const float* q = positions + 4 * (size_t)table[at];
            if (q[0] == p[0] && q[1] == p[1] && q[2] == p[2]) {
                weld[v] = table[at];
                break;
            }
        }
    }
    es_release(context, table, size * sizeof *table);
    return weld;
}

/* A place of the mesh in the world's axes and size, relative to where the node is. */
static void to_rest(const es_mat4* m, const float* p, float* rest)
{
    for (int k = 0; k < 3; k++) rest[k] = (float)((double)m->m[k] * (double)p[0] + (double)m->m[4 + k] * (double)p[1] + (double)m->m[8 + k] * (double)p[2]);
}

/* Shares `total` by `weight`, nobody less than a hundredth of the mean: what has no area still has a mass. */
static void share_mass(float* mass, const double* weight, uint32_t count, double total)
{
    double sum = 0, least, shared = 0;
    for (uint32_t p = 0; p < count; p++) sum += weight[p];
    least = sum > 0 ? 0.01 * sum / count : 1.0;
    for (uint32_t p = 0; p < count; p++) shared += weight[p] > least ? weight[p] : least;
    for (uint32_t p = 0; p < count; p++) mass[p] = (float)((weight[p] > least ? weight[p] : least) / shared * total);
}

static void cross_of(const float* a, const float* b, const float* c, double n[3])
{
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = (double)b[k] - (double)a[k];
        v[k] = (double)c[k] - (double)a[k];
    }
    n[0] = u[1] * v[2] - u[2] * v[1];
    n[1] = u[2] * v[0] - u[0] * v[2];
    n[2] = u[0] * v[1] - u[1] * v[0];
}

static double length_of(const double n[3]) { return __builtin_sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]); }

static void weigh_triangles(es_soft_object* soft, double* area)
{
    double best = -1, normal[3] = {0, 1, 0}, volume = 0, extent = 0, off = 0, edges = 0;
    const float* base = soft->rest;
    for (uint32_t t = 0; t < soft->triangle_count; t++) {
        const uint32_t* c = soft->corners + 3 * (size_t)t;
        const float *p = soft->rest + 3 * (size_t)c[0], *q = soft->rest + 3 * (size_t)c[1], *r = soft->rest + 3 * (size_t)c[2];
        double n[3];
        cross_of(p, q, r, n);
        double size = length_of(n);
        for (int k = 0; k < 3; k++) {
            area[c[k]] += size / 6;
            volume += n[k] * ((double)p[k] - (double)base[k]) / 6;
        }
        for (int i = 0; i < 3; i++) {
            const float *a = soft->rest + 3 * (size_t)c[i], *b = soft->rest + 3 * (size_t)c[(i + 1) % 3];
            const double d[3] = {(double)a[0] - (double)b[0], (double)a[1] - (double)b[1], (double)a[2] - (double)b[2]};
            edges += length_of(d);
        }
        if (size <= best || !(size > 0)) continue;
        best = size;
        for (int k = 0; k < 3; k++) normal[k] = n[k] / size;
    }
    soft->spacing = (float)(edges / 3 / soft->triangle_count);
    const float* origin = soft->rest + 3 * (size_t)soft->corners[0];
    for (uint32_t p = 0; p < soft->particle_count; p++) {
        double d[3], along = 0;
        for (int k = 0; k < 3; k++) {
            d[k] = (double)soft->rest[3 * (size_t)p + k] - (double)origin[k];
            along += d[k] * normal[k];
        }
        double size = length_of(d);
        extent = size > extent ? size : extent;
        off = along > off ? along : -along > off ? -along : off;
    }
    soft->planar = off <= 1e-4 * extent;
    soft->rest_volume = (float)volume;
}

bool es_soft_weld(es_world* world, es_soft_object* soft, const es_mesh_object* mesh)
{
    es_context* context = world->context;
    es_arena* arena = &soft->arena;
    const uint32_t vertices = soft->vertex_used, triangles = mesh->raster.triangle_count;
    const es_mat4* matrix = es_node_world(world, soft->desc.node);
    uint32_t* weld = find_welds(arena, context, mesh->positions, vertices);
    if (!weld) return false;
    soft->triangle_count = triangles;
    soft->corners = es_soft_room(arena, 3 * (size_t)triangles, sizeof *soft->corners);
    soft->mesh_indices = es_soft_room(arena, 3 * (size_t)triangles, sizeof *soft->mesh_indices);
    soft->particle_at = es_soft_room(arena, soft->vertex_count, sizeof *soft->particle_at);
    soft->vertex_source = es_soft_room(arena, soft->vertex_count, sizeof *soft->vertex_source);
    if (!soft->corners || !soft->mesh_indices || !soft->particle_at || !soft->vertex_source) return false;
    memcpy(soft->mesh_indices, mesh->indices, 3 * (size_t)triangles * sizeof(uint32_t));
    /* vertices that no triangle has are no particles: nothing would hold them */
    for (uint32_t v = 0; v < soft->vertex_count; v++) soft->particle_at[v] = ES_SOFT_NONE;
    for (size_t i = 0; i < 3 * (size_t)triangles; i++) soft->particle_at[weld[mesh->indices[i]]] = 0;
    uint32_t particles = 0;
    for (uint32_t v = 0; v < vertices; v++)
        if (soft->particle_at[v] != ES_SOFT_NONE) soft->particle_at[v] = particles++;
    for (uint32_t v = 0; v < vertices; v++)
        if (weld[v] != v) soft->particle_at[v] = soft->particle_at[weld[v]];
    soft->particle_count = soft->first_particles = particles;
    soft->particle_room = particles + (soft->vertex_count - vertices);
    soft->rest = es_soft_room(arena, 3 * (size_t)soft->particle_room, sizeof(float));
    soft->mass = es_soft_room(arena, soft->particle_room, sizeof(float));
    soft->first_vertex = es_soft_room(arena, soft->particle_room, sizeof(uint32_t));
    soft->first_mass = es_soft_room(arena, particles, sizeof(float));
    if (!soft->rest || !soft->mass || !soft->first_vertex || !soft->first_mass) return false;
    for (uint32_t v = vertices; v-- > 0;) {
        soft->vertex_source[v] = v;
        if (soft->particle_at[v] == ES_SOFT_NONE) continue;
        soft->first_vertex[soft->particle_at[v]] = v;
        to_rest(matrix, mesh->positions + 4 * (size_t)v, soft->rest + 3 * (size_t)soft->particle_at[v]);
    }
    for (uint32_t v = 0; v < soft->vertex_count; v++) {
        if (v >= vertices) soft->vertex_source[v] = 0;
        if (soft->particle_at[v] == ES_SOFT_NONE) soft->particle_at[v] = 0;
    }
    for (size_t i = 0; i < 3 * (size_t)triangles; i++) soft->corners[i] = soft->particle_at[mesh->indices[i]];
    double* area = es_allocate_zero(context, (size_t)particles * sizeof *area);
    if (!area) return false;
    weigh_triangles(soft, area);
    share_mass(soft->mass, area, particles, (double)soft->desc.mass);
    memcpy(soft->first_mass, soft->mass, particles * sizeof *soft->mass);
    es_release(context, area, (size_t)particles * sizeof *area);
    return true;
}

/* ---- a mesh inside tetrahedra -------------------------------------------------------------------------------------------- */

static void corner_weights(const es_soft_object* soft, uint32_t t, const float* p, double w[4])
{
    const uint32_t* c = soft->tetrahedra + 4 * (size_t)t;
    const float* q[4];
    for (int i = 0; i < 4; i++) q[i] = soft->rest + 3 * (size_t)c[i];
    double n[3], whole = 0, sum = 0;
    cross_of(q[1], q[2], q[3], n);
    for (int k = 0; k < 3; k++) whole += n[k] * ((double)q[0][k] - (double)q[1][k]);
    for (int i = 0; i < 3; i++) {
        /* the face opposite to corner i, and the corner itself on its positive side */
        const float *a = q[(i + 1) & 3], *b = q[(i + 2) & 3], *d = q[(i + 3) & 3];
        double part = 0, side = 0;
        cross_of(a, b, d, n);
        for (int k = 0; k < 3; k++) {
            part += n[k] * ((double)p[k] - (double)a[k]);
            side += n[k] * ((double)q[i][k] - (double)a[k]);
        }
        w[i] = side * side > 0 ? part / side : -1e9;
        sum += w[i];
    }
    w[3] = 1 - sum;
    if (!(whole * whole > 0)) w[0] = -1e9;
}

static double least_of(const double w[4])
{
    double least = w[0];
    for (int i = 1; i < 4; i++) least = w[i] < least ? w[i] : least;
    return least;
}

/* Tetrahedra by the cells of a grid that their boxes meet. */
typedef struct cell_grid { uint32_t size; float low[3], per_cell[3]; uint32_t *first, *list; size_t list_size; } cell_grid;

static uint32_t cell_of(const cell_grid* grid, const float* p, int k)
{
    float at = (p[k] - grid->low[k]) * grid->per_cell[k];
    return at > 0 ? at < (float)grid->size ? (uint32_t)at : grid->size - 1 : 0;
}

static bool make_grid(es_context* context, const es_soft_object* soft, cell_grid* grid)
{
    float high[3] = {-1e30f, -1e30f, -1e30f};
    for (int k = 0; k < 3; k++) grid->low[k] = 1e30f;
    for (uint32_t p = 0; p < soft->particle_count; p++)
        for (int k = 0; k < 3; k++) {
            grid->low[k] = es_minf(grid->low[k], soft->rest[3 * (size_t)p + k]);
            high[k] = es_maxf(high[k], soft->rest[3 * (size_t)p + k]);
        }
    grid->size = 1;
    while (grid->size < 48 && grid->size * grid->size * grid->size < soft->tetrahedron_count) grid->size++;
    for (int k = 0; k < 3; k++) grid->per_cell[k] = high[k] > grid->low[k] ? (float)grid->size / (high[k] - grid->low[k]) : 0;
    const size_t cells = (size_t)grid->size * grid->size * grid->size;
    grid->first = es_allocate_zero(context, (cells + 2) * sizeof(uint32_t));
    if (!grid->first) return false;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t t = 0; t < soft->tetrahedron_count; t++) {
            float box[2][3];
            for (int k = 0; k < 3; k++) {
                box[0][k] = 1e30f;
                box[1][k] = -1e30f;
                for (int i = 0; i < 4; i++) {
                    float at = soft->rest[3 * (size_t)soft->tetrahedra[4 * (size_t)t + i] + k];
                    box[0][k] = es_minf(box[0][k], at);
                    box[1][k] = es_maxf(box[1][k], at);
                }
            }
            for (uint32_t z = cell_of(grid, box[0], 2); z <= cell_of(grid, box[1], 2); z++)
                for (uint32_t y = cell_of(grid, box[0], 1); y <= cell_of(grid, box[1], 1); y++)
                    for (uint32_t x = cell_of(grid, box[0], 0); x <= cell_of(grid, box[1], 0); x++) {
                        size_t cell = ((size_t)z * grid->size + y) * grid->size + x;
                        if (pass == 0) grid->first[cell + 2]++;
                        else grid->list[grid->first[cell + 1]++] = t;
                    }
        }
        if (pass == 1) break;
        for (size_t c = 0; c < cells; c++) grid->first[c + 2] += grid->first[c + 1];
        grid->list_size = grid->first[cells + 1];
        grid->list = es_allocate_array(context, grid->list_size + 1, sizeof(uint32_t));
        if (!grid->list) {
            es_release(context, grid->first, (cells + 2) * sizeof(uint32_t));
            return false;
        }
    }
    return true;
}

static void bind_vertex(es_soft_object* soft, const cell_grid* grid, uint32_t v, const float* p)
{
    size_t cell = ((size_t)cell_of(grid, p, 2) * grid->size + cell_of(grid, p, 1)) * grid->size + cell_of(grid, p, 0);
    double best[4] = {1, 0, 0, 0}, w[4], least = -1e30;
    uint32_t in = 0;
    for (int pass = 0; pass < 2 && least < -0.5; pass++) { /* the cell's; when none is near, all */
        uint32_t count = pass ? soft->tetrahedron_count : grid->first[cell + 1] - grid->first[cell];
        for (uint32_t i = 0; i < count; i++) {
            uint32_t t = pass ? i : grid->list[grid->first[cell] + i];
            corner_weights(soft, t, p, w);
            if (least_of(w) <= least) continue;
            least = least_of(w);
            in = t;
            memcpy(best, w, sizeof best);
        }
    }
    soft->inside[v] = in;
    for (int i = 0; i < 4; i++) soft->weights[4 * (size_t)v + i] = es_clampf((float)best[i], -1e3f, 1e3f);
}

bool es_soft_embed(es_world* world, es_soft_object* soft, const es_mesh_object* mesh, const es_soft_solid* solid)
{
    es_context* context = world->context;
    es_arena* arena = &soft->arena;
    const es_mat4* matrix = es_node_world(world, soft->desc.node);
    soft->particle_count = soft->first_particles = soft->particle_room = solid->particle_count;
    soft->tetrahedron_count = solid->tetrahedron_count;
    soft->rest = es_soft_room(arena, 3 * (size_t)solid->particle_count, sizeof(float));
    soft->mass = es_soft_room(arena, solid->particle_count, sizeof(float));
    soft->tetrahedra = es_soft_room(arena, 4 * (size_t)solid->tetrahedron_count, sizeof(uint32_t));
    soft->inside = es_soft_room(arena, soft->vertex_count, sizeof(uint32_t));
    soft->weights = es_soft_room(arena, 4 * (size_t)soft->vertex_count, sizeof(float));
    soft->weld = find_welds(arena, context, mesh->positions, soft->vertex_count);
    if (!soft->rest || !soft->mass || !soft->tetrahedra || !soft->inside || !soft->weights || !soft->weld) return false;
    for (uint32_t p = 0; p < solid->particle_count; p++) to_rest(matrix, solid->particles + 3 * (size_t)p, soft->rest + 3 * (size_t)p);
    memcpy(soft->tetrahedra, solid->tetrahedra, 4 * (size_t)solid->tetrahedron_count * sizeof(uint32_t));
    double *volume = es_allocate_zero(context, (size_t)solid->particle_count * sizeof *volume), whole = 0;
    if (!volume) return false;
    for (uint32_t t = 0; t < solid->tetrahedron_count; t++) {
        const uint32_t* c = soft->tetrahedra + 4 * (size_t)t;
        double n[3], v = 0;
        cross_of(soft->rest + 3 * (size_t)c[0], soft->rest + 3 * (size_t)c[1], soft->rest + 3 * (size_t)c[2], n);
        for (int k = 0; k < 3; k++) v += n[k] * ((double)soft->rest[3 * (size_t)c[3] + k] - (double)soft->rest[3 * (size_t)c[0] + k]) / 6;
        v = v < 0 ? -v : v;
        whole += v;
        for (int i = 0; i < 4; i++) volume[c[i]] += v / 4;
    }
    soft->rest_volume = (float)whole;
    share_mass(soft->mass, volume, solid->particle_count, (double)soft->desc.mass);
    es_release(context, volume, (size_t)solid->particle_count * sizeof *volume);
    cell_grid grid = {0};
    if (!make_grid(context, soft, &grid)) return false;
    for (uint32_t v = 0; v < soft->vertex_count; v++) {
        float p[3];
        to_rest(matrix, mesh->positions + 4 * (size_t)v, p);
        bind_vertex(soft, &grid, v, p);
    }
    es_release(context, grid.first, ((size_t)grid.size * grid.size * grid.size + 2) * sizeof(uint32_t));
    es_release(context, grid.list, (grid.list_size + 1) * sizeof(uint32_t));
    return es_vertex_fans_make(context, mesh->indices, mesh->raster.triangle_count, soft->vertex_count, soft->weld, &soft->mesh_fans);
}
