/* Triangles by neighbourhood and by place. */
#include "sim/edits/surface.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "sim/soft/soft.h"

/* ---- fans ------------------------------------------------------------------------------------------------------------ */

static void fans_free(es_context* context, es_surface_fans* f)
{
    es_release(context, f->point_of, (f->vertex_count + (size_t)1) * sizeof(uint32_t));
    es_release(context, f->vertex_of, (f->vertex_count + (size_t)1) * sizeof(uint32_t));
    es_release(context, f->first_row, (f->vertex_count + (size_t)1) * sizeof(uint32_t));
    es_release(context, f->first_neighbour, (f->vertex_count + (size_t)1) * sizeof(uint32_t));
    es_release(context, f->rows, (f->row_count + 1) * 2 * ES_SURFACE_ROW * sizeof(uint32_t));
    es_release(context, f->neighbours, (f->neighbour_count + 1) * sizeof(uint32_t));
    *f = (es_surface_fans){0};
}

/* As a cloth's particles are: where it is torn, vertices that were at one place are no longer one. */
static bool weld_particles(es_context* context, const es_soft_object* soft, es_surface_fans* f)
{
    const size_t bytes = (soft->particle_count + (size_t)1) * sizeof(uint32_t);
    uint32_t* point = es_allocate_zero(context, bytes); /* of each particle, + 1; past them, of vertices that wait to be used */
    if (!point) return false;
    for (uint32_t v = 0; v < f->vertex_count; v++) {
        const uint32_t particle = soft->particle_at[v] < soft->particle_count ? soft->particle_at[v] : soft->particle_count;
        if (!point[particle]) {
            f->vertex_of[f->point_count] = v;
            point[particle] = ++f->point_count;
        }
        f->point_of[v] = point[particle] - 1;
    }
    es_release(context, point, bytes);
    return true;
}

/* By the bits of the places at rest, with -0 as 0. */
static bool weld(es_context* context, const es_raster_mesh* mesh, es_surface_fans* f)
{
    const float* rest = mesh->rest_positions ? mesh->rest_positions : mesh->positions;
    uint64_t capacity = 16;
    while (capacity < 2 * (uint64_t)mesh->vertex_count) capacity *= 2;
    uint32_t* table = es_allocate_zero(context, capacity * sizeof *table); /* point + 1 */
    if (!table) return false;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const float key[3] = {rest[4 * (size_t)v] + 0.0f, rest[4 * (size_t)v + 1] + 0.0f, rest[4 * (size_t)v + 2] + 0.0f};
        uint64_t at = es_hash_bytes(0, key, sizeof key) & (capacity - 1);
        for (; table[at]; at = (at + 1) & (capacity - 1)) {
            const float* other = rest + 4 * (size_t)f->vertex_of[table[at] - 1];
            if (other[0] == key[0] && other[1] == key[1] && other[2] == key[2]) break;
        }
        if (!table[at]) {
            f->vertex_of[f->point_count] = v;
            table[at] = ++f->point_count;
        }
        f->point_of[v] = table[at] - 1;
    }
    es_release(context, table, capacity * sizeof *table);
    return true;
}

static bool corners_of(const es_surface_fans* f, const uint32_t* indices, uint32_t p[3])
{
    for (int i = 0; i < 3; i++) p[i] = f->point_of[indices[i]];
    return p[0] != p[1] && p[1] != p[2] && p[2] != p[0];
}

static bool make_rows(es_context* context, const es_raster_mesh* mesh, es_surface_fans* f)
{
    const size_t points = f->point_count;
    uint32_t* degree = es_allocate_zero(context, (points + 1) * sizeof *degree);
    if (!degree) return false;
    uint32_t p[3];
    for (size_t t = 0; t < mesh->triangle_count; t++)
        if (corners_of(f, mesh->indices + 3 * t, p)) degree[p[0]]++, degree[p[1]]++, degree[p[2]]++;
    size_t rows = 0;
    for (size_t i = 0; i < points; i++) {
        f->first_row[i] = (uint32_t)rows;
        rows += (degree[i] + ES_SURFACE_ROW - 1) / ES_SURFACE_ROW;
    }
    f->first_row[points] = (uint32_t)rows;
    f->row_count = rows;
    f->rows = es_allocate_array(context, rows + 1, 2 * ES_SURFACE_ROW * sizeof *f->rows);
    if (f->rows) {
        for (size_t i = 0; i < points; i++)
            for (size_t k = (size_t)f->first_row[i] * 2 * ES_SURFACE_ROW; k < (size_t)f->first_row[i + 1] * 2 * ES_SURFACE_ROW; k++) f->rows[k] = (uint32_t)i;
        memset(degree, 0, (points + 1) * sizeof *degree);
        for (size_t t = 0; t < mesh->triangle_count; t++) {
            if (!corners_of(f, mesh->indices + 3 * t, p)) continue;
            for (int i = 0; i < 3; i++) {
                uint32_t at = degree[p[i]]++;
                uint32_t* row = f->rows + ((size_t)f->first_row[p[i]] + at / ES_SURFACE_ROW) * 2 * ES_SURFACE_ROW + at % ES_SURFACE_ROW;
                row[0] = p[(i + 1) % 3];
                row[ES_SURFACE_ROW] = p[(i + 2) % 3];
            }
        }
    }
    es_release(context, degree, (points + 1) * sizeof *degree);
    return f->rows != NULL;
}

/* Each neighbour once, in the order in which the rows have them. */
static bool make_neighbours(es_context* context, es_surface_fans* f)
{
    const size_t points = f->point_count;
    uint32_t* seen = es_allocate_zero(context, (points + 1) * sizeof *seen); /* point + 1 that saw it last */
    if (!seen) return false;
    for (int pass = 0; pass < 2; pass++) {
        size_t count = 0;
        for (size_t i = 0; i < points; i++) {
            f->first_neighbour[i] = (uint32_t)count;
            const uint32_t *row = f->rows + (size_t)f->first_row[i] * 2 * ES_SURFACE_ROW, *end = f->rows + (size_t)f->first_row[i + 1] * 2 * ES_SURFACE_ROW;
            const uint32_t mark = (uint32_t)(2 * i + pass) + 1;
            for (; row < end; row++) {
                if (*row == i || seen[*row] == mark) continue;
                seen[*row] = mark;
                if (pass) f->neighbours[count] = *row;
                count++;
            }
        }
        f->first_neighbour[points] = (uint32_t)count;
        if (pass) break;
        f->neighbour_count = count;
        f->neighbours = es_allocate_array(context, count + 1, sizeof *f->neighbours);
        if (!f->neighbours) break;
    }
    es_release(context, seen, (points + 1) * sizeof *seen);
    return f->neighbours != NULL;
}

static bool fans_make(const es_world* world, const es_mesh_object* object, es_surface_fans* f)
{
    es_context* context = world->context;
    const es_raster_mesh* mesh = &object->raster;
    const es_soft_object* soft = es_slots_get(&world->slots[ES_OBJECT_SOFT], object->soft);
    const bool cloth = soft && soft->particle_at;
    const size_t size = mesh->vertex_count + (size_t)1;
    *f = (es_surface_fans){.vertex_count = mesh->vertex_count};
    f->point_of = es_allocate_array(context, size, sizeof(uint32_t));
    if (f->point_of) f->vertex_of = es_allocate_array(context, size, sizeof(uint32_t));
    if (f->vertex_of) f->first_row = es_allocate_array(context, size, sizeof(uint32_t));
    if (f->first_row) f->first_neighbour = es_allocate_array(context, size, sizeof(uint32_t));
    if (f->first_neighbour && (cloth ? weld_particles(context, soft, f) : weld(context, mesh, f)) && make_rows(context, mesh, f) && make_neighbours(context, f)) return true;
    fans_free(context, f);
    return false;
}

/* ---- tree -------------------------------------------------------------------------------------------------------------- */

static void tree_free(es_context* context, es_surface_tree* t)
{
    es_release(context, t->order, (size_t)t->leaf_count * ES_SURFACE_LEAF * sizeof *t->order);
    es_release(context, t->boxes, (size_t)t->leaf_count * 2 * 6 * sizeof *t->boxes);
    *t = (es_surface_tree){0};
}

static uint32_t spread(uint32_t x)
{
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

/* Triangles in Morton order of their corners' means: sorted by 30-bit codes in three passes of ten bits. */
static bool sort_triangles(es_context* context, const es_raster_mesh* mesh, es_surface_tree* t)
{
    const size_t count = mesh->triangle_count;
    uint32_t* memory = es_allocate_array(context, count + 1, 3 * sizeof(uint32_t));
    if (!memory) return false;
    uint32_t *codes = memory, *from = memory + count, *to = memory + 2 * count;
    const float low[3] = {mesh->bounds_min.x, mesh->bounds_min.y, mesh->bounds_min.z};
    const float extent = es_maxf(mesh->bounds_max.x - low[0], es_maxf(mesh->bounds_max.y - low[1], mesh->bounds_max.z - low[2]));
    const float scale = extent > 1e-30f ? 1023.0f / extent : 0;
    for (size_t i = 0; i < count; i++) {
        uint32_t cell[3];
        for (int k = 0; k < 3; k++) {
            const uint32_t* v = mesh->indices + 3 * i;
            float mean = (mesh->positions[4 * (size_t)v[0] + k] * 0.25f + mesh->positions[4 * (size_t)v[1] + k] * 0.25f + mesh->positions[4 * (size_t)v[2] + k] * 0.5f - low[k]) * scale;
            cell[k] = (uint32_t)es_clampf(mean, 0, 1023);
        }
        codes[i] = spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2;
        from[i] = (uint32_t)i;
    }
    for (int shift = 0; shift < 30; shift += 10) {
        uint32_t starts[1025] = {0};
        for (size_t i = 0; i < count; i++) starts[(codes[i] >> shift & 1023) + 1]++;
        for (int d = 0; d < 1024; d++) starts[d + 1] += starts[d];
        for (size_t i = 0; i < count; i++) to[starts[codes[from[i]] >> shift & 1023]++] = from[i];
        uint32_t* swap = from;
        from = to;
        to = swap;
    }
    for (size_t i = 0, end = (size_t)t->leaf_count * ES_SURFACE_LEAF; i < end; i++) t->order[i] = i < count ? from[i] : UINT32_MAX;
    es_release(context, memory, (count + 1) * 3 * sizeof(uint32_t));
    return true;
}

static bool tree_make(es_context* context, const es_raster_mesh* mesh, es_surface_tree* t)
{
    *t = (es_surface_tree){.triangle_count = mesh->triangle_count, .leaf_count = 1};
    while ((size_t)t->leaf_count * ES_SURFACE_LEAF < mesh->triangle_count) t->leaf_count *= 2;
    t->order = es_allocate_array(context, (size_t)t->leaf_count * ES_SURFACE_LEAF, sizeof *t->order);
    if (t->order) t->boxes = es_allocate_array(context, (size_t)t->leaf_count * 2, 6 * sizeof *t->boxes);
    if (t->boxes && sort_triangles(context, mesh, t)) return true;
    tree_free(context, t);
    return false;
}

typedef struct tree_loop { const es_raster_mesh* mesh; es_surface_tree* tree; } tree_loop;

static void leaves_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const tree_loop* loop = user;
    const es_surface_tree* t = loop->tree;
    for (uint32_t leaf = begin; leaf < end; leaf++) {
        float low[3] = {3e38f, 3e38f, 3e38f}, high[3] = {-3e38f, -3e38f, -3e38f};
        for (uint32_t i = 0; i < ES_SURFACE_LEAF; i++) {
            uint32_t triangle = t->order[(size_t)leaf * ES_SURFACE_LEAF + i];
            if (triangle == UINT32_MAX) continue;
            for (int c = 0; c < 3; c++) {
                const float* p = loop->mesh->positions + 4 * (size_t)loop->mesh->indices[3 * (size_t)triangle + c];
                for (int k = 0; k < 3; k++) {
                    low[k] = es_minf(low[k], p[k]);
                    high[k] = es_maxf(high[k], p[k]);
                }
            }
        }
        float* box = t->boxes + 6 * ((size_t)t->leaf_count + leaf);
        memcpy(box, low, sizeof low);
        memcpy(box + 3, high, sizeof high);
    }
}

static void tree_fit(es_context* context, const es_raster_mesh* mesh, es_surface_tree* t)
{
    tree_loop loop = {mesh, t};
    es_parallel_for(context, t->leaf_count, 2048, leaves_body, &loop);
    for (uint32_t node = t->leaf_count - 1; node > 0; node--) {
        float* box = t->boxes + 6 * (size_t)node;
        const float *a = box + 6 * (size_t)node, *b = a + 6; /* of 2 node and 2 node + 1 */
        for (int k = 0; k < 3; k++) {
            box[k] = es_minf(a[k], b[k]);
            box[3 + k] = es_maxf(a[3 + k], b[3 + k]);
        }
    }
    t->revision = mesh->revision;
}

/* ---- kept -------------------------------------------------------------------------------------------------------------- */

static void surface_free(es_context* context, es_surface* surface)
{
    if (surface->parts & ES_SURFACE_FANS) fans_free(context, &surface->fans);
    if (surface->parts & ES_SURFACE_TREE) tree_free(context, &surface->tree);
    *surface = (es_surface){0};
}

void es_surfaces_free(es_context* context, es_surfaces* surfaces)
{
    for (int i = 0; i < ES_SURFACES_KEPT; i++) surface_free(context, &surfaces->kept[i]);
}

const es_surface* es_surface_of(const es_world* world, es_surfaces* surfaces, const es_mesh_object* mesh, uint32_t parts)
{
    es_context* context = world->context;
    es_surface *surface = NULL, *oldest = &surfaces->kept[0];
    for (int i = 0; i < ES_SURFACES_KEPT; i++) {
        es_surface* s = &surfaces->kept[i];
        if (s->mesh && !es_slots_get(&world->slots[ES_OBJECT_MESH], s->mesh)) surface_free(context, s);
        if (s->mesh == mesh->object.id) surface = s;
        if (s->used < oldest->used) oldest = s;
    }
    if (surface && surface->rest_revision != mesh->raster.rest_revision) surface_free(context, surface);
    if (!surface) {
        surface_free(context, oldest);
        surface = oldest;
    }
    surface->mesh = mesh->object.id;
    surface->rest_revision = mesh->raster.rest_revision;
    surface->raster = &mesh->raster;
    surface->used = ++surfaces->calls;
    if ((parts & ES_SURFACE_FANS) && !(surface->parts & ES_SURFACE_FANS)) {
        if (!fans_make(world, mesh, &surface->fans)) return NULL;
        surface->parts |= ES_SURFACE_FANS;
    }
    if ((parts & ES_SURFACE_TREE) && !(surface->parts & ES_SURFACE_TREE)) {
        if (!tree_make(context, &mesh->raster, &surface->tree)) return NULL;
        surface->parts |= ES_SURFACE_TREE;
    }
    if ((parts & ES_SURFACE_TREE) && surface->tree.revision != mesh->raster.revision) tree_fit(context, &mesh->raster, &surface->tree);
    return surface;
}

/* ---- asking -------------------------------------------------------------------------------------------------------------- */

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void corner(const es_raster_mesh* mesh, uint32_t triangle, int c, double out[3])
{
    const float* p = mesh->positions + 4 * (size_t)mesh->indices[3 * (size_t)triangle + c];
    for (int k = 0; k < 3; k++) out[k] = (double)p[k];
}

/* Nearest point of a triangle by Voronoi regions of its corners, edges and face (Ericson 2005, §5.1.5); what has no area is taken as its edges. */
static double nearest_on(const es_raster_mesh* mesh, uint32_t triangle, const double p[3], double* u, double* v)
{
    double a[3], b[3], c[3], ab[3], ac[3], ap[3], bp[3], cp[3];
    corner(mesh, triangle, 0, a);
    corner(mesh, triangle, 1, b);
    corner(mesh, triangle, 2, c);
    for (int k = 0; k < 3; k++) {
        ab[k] = b[k] - a[k];
        ac[k] = c[k] - a[k];
        ap[k] = p[k] - a[k];
        bp[k] = p[k] - b[k];
        cp[k] = p[k] - c[k];
    }
    const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
    const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2, sum = va + vb + vc;
    if (d1 <= 0 && d2 <= 0) *u = 0, *v = 0;
    else if (d3 >= 0 && d4 <= d3) *u = 1, *v = 0;
    else if (d6 >= 0 && d5 <= d6) *u = 0, *v = 1;
    else if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 - d3 > 0) *u = d1 / (d1 - d3), *v = 0;
    else if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 - d6 > 0) *u = 0, *v = d2 / (d2 - d6);
    else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0 && (d4 - d3) + (d5 - d6) > 0) *v = (d4 - d3) / ((d4 - d3) + (d5 - d6)), *u = 1 - *v;
    else if (sum > 0) *u = vb / sum, *v = vc / sum;
    else *u = 0, *v = 0;
    double squared = 0;
    for (int k = 0; k < 3; k++) {
        double x = ap[k] - *u * ab[k] - *v * ac[k];
        squared += x * x;
    }
    return squared;
}

static double to_box(const float* box, const double p[3])
{
    double squared = 0;
    for (int k = 0; k < 3; k++) {
        double x = p[k] < (double)box[k] ? (double)box[k] - p[k] : p[k] > (double)box[3 + k] ? p[k] - (double)box[3 + k] : 0;
        squared += x * x;
    }
    return squared;
}

bool es_surface_closest(const es_surface* surface, const float place[3], uint32_t* triangle, float* u, float* v)
{
    const es_surface_tree* t = &surface->tree;
    const double p[3] = {(double)place[0], (double)place[1], (double)place[2]};
    double best = 1e300, best_u = 0, best_v = 0;
    uint32_t best_triangle = UINT32_MAX, stack[64], depth = 0;
    if (t->triangle_count) stack[depth++] = 1;
    while (depth) {
        uint32_t node = stack[--depth];
        if (to_box(t->boxes + 6 * (size_t)node, p) > best) continue;
        if (node < t->leaf_count) {
            uint32_t near = 2 * node, far = near + 1;
            if (to_box(t->boxes + 6 * (size_t)far, p) < to_box(t->boxes + 6 * (size_t)near, p)) near = far, far = 2 * node;
            stack[depth++] = far;
            stack[depth++] = near;
            continue;
        }
        for (uint32_t i = 0; i < ES_SURFACE_LEAF; i++) {
            uint32_t each = t->order[(size_t)(node - t->leaf_count) * ES_SURFACE_LEAF + i];
            double at_u, at_v;
            if (each == UINT32_MAX) break;
            double squared = nearest_on(surface->raster, each, p, &at_u, &at_v);
            if (squared > best || (squared == best && each > best_triangle)) continue;
            best = squared;
            best_triangle = each;
            best_u = at_u;
            best_v = at_v;
        }
    }
    *triangle = best_triangle;
    *u = es_clampf((float)best_u, 0, 1);
    *v = es_clampf((float)best_v, 0, 1.0f - *u);
    return best_triangle != UINT32_MAX;
}

static bool box_met(const float* box, const double o[3], const double inverse[3], double t)
{
    double near = 0, far = t;
    for (int k = 0; k < 3; k++) {
        double a = ((double)box[k] - o[k]) * inverse[k], b = ((double)box[3 + k] - o[k]) * inverse[k];
        if (a > b) {
            double swap = a;
            a = b;
            b = swap;
        }
        near = near > a ? near : a;
        far = far < b ? far : b;
    }
    return near <= far * (1 + 1e-12);
}

/* Möller and Trumbore 1997. */
static bool triangle_met(const es_raster_mesh* mesh, uint32_t triangle, const double o[3], const double d[3], double* t, double* u, double* v)
{
    double a[3], b[3], c[3];
    corner(mesh, triangle, 0, a);
    corner(mesh, triangle, 1, b);
    corner(mesh, triangle, 2, c);
    double e[3], f[3], s[3];
    for (int k = 0; k < 3; k++) {
        e[k] = b[k] - a[k];
        f[k] = c[k] - a[k];
        s[k] = o[k] - a[k];
    }
    const double q[3] = {d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]};
    const double r[3] = {s[1] * e[2] - s[2] * e[1], s[2] * e[0] - s[0] * e[2], s[0] * e[1] - s[1] * e[0]};
    const double determinant = dot(e, q);
    if (determinant == 0) return false;
    *u = dot(s, q) / determinant;
    *v = dot(d, r) / determinant;
    *t = dot(f, r) / determinant;
    return *u >= 0 && *v >= 0 && *u + *v <= 1 && *t >= 0;
}

static void inverse_direction(const double d[3], double inverse[3])
{
    for (int k = 0; k < 3; k++) inverse[k] = d[k] > 1e-30 || d[k] < -1e-30 ? 1.0 / d[k] : d[k] < 0 ? -1e30 : 1e30;
}

bool es_box_met(const es_vec3* low, const es_vec3* high, const double origin[3], const double direction[3], double t)
{
    const float box[6] = {low->x, low->y, low->z, high->x, high->y, high->z};
    double inverse[3];
    inverse_direction(direction, inverse);
    return box_met(box, origin, inverse, t);
}

bool es_surface_hit(const es_surface* surface, const double origin[3], const double direction[3], double* t, uint32_t* triangle, float* u, float* v)
{
    const es_surface_tree* tree = &surface->tree;
    double inverse[3];
    inverse_direction(direction, inverse);
    uint32_t best = UINT32_MAX, stack[64], depth = 0;
    if (tree->triangle_count) stack[depth++] = 1;
    while (depth) {
        uint32_t node = stack[--depth];
        if (!box_met(tree->boxes + 6 * (size_t)node, origin, inverse, *t)) continue;
        if (node < tree->leaf_count) {
            stack[depth++] = 2 * node + 1;
            stack[depth++] = 2 * node;
            continue;
        }
        for (uint32_t i = 0; i < ES_SURFACE_LEAF; i++) {
            uint32_t each = tree->order[(size_t)(node - tree->leaf_count) * ES_SURFACE_LEAF + i];
            double at, at_u, at_v;
            if (each == UINT32_MAX) break;
            if (!triangle_met(surface->raster, each, origin, direction, &at, &at_u, &at_v) || at > *t || (at == *t && each > best)) continue;
            *t = at;
            best = *triangle = each;
            *u = es_clampf((float)at_u, 0, 1);
            *v = es_clampf((float)at_v, 0, 1.0f - *u);
        }
    }
    return best != UINT32_MAX;
}
