/* Tetrahedra inside a closed mesh: a lattice of cubes, five each, mirrored in turn so that neighbours share their faces' diagonals. */
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"

enum { CUBES = 1 << 18 };

typedef struct lattice { double low[3], spacing; uint32_t size[3]; uint8_t* cubes; } lattice;

static uint8_t* cube_at(const lattice* l, uint32_t x, uint32_t y, uint32_t z) { return &l->cubes[((size_t)z * l->size[1] + y) * l->size[0] + x]; }

/* Cubes whose centre has an odd number of crossings beyond it along +x. A toggle at a crossing's cube and a running parity from the far end
 * do for all lines at once. Centres are shifted by a fraction that no tidy mesh has, so that lines miss edges. */
static void cross_lines(const lattice* l, const es_raster_mesh* mesh)
{
    static const double shift[2] = {0.00713, 0.00391};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        double p[3][3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) p[i][k] = ((double)mesh->positions[4 * (size_t)mesh->indices[3 * (size_t)t + i] + k] - l->low[k]) / l->spacing - (k ? 0.5 + shift[k - 1] : 0.5);
        double low[3], high[3];
        for (int k = 1; k < 3; k++) {
            low[k] = p[0][k] < p[1][k] ? p[0][k] : p[1][k];
            low[k] = low[k] < p[2][k] ? low[k] : p[2][k];
            high[k] = p[0][k] > p[1][k] ? p[0][k] : p[1][k];
            high[k] = high[k] > p[2][k] ? high[k] : p[2][k];
        }
        const double area = (p[1][1] - p[0][1]) * (p[2][2] - p[0][2]) - (p[1][2] - p[0][2]) * (p[2][1] - p[0][1]);
        if (area == 0) continue;
        for (int64_t y = (int64_t)low[1]; y <= (int64_t)high[1] && y < (int64_t)l->size[1]; y++)
            for (int64_t z = (int64_t)low[2]; z <= (int64_t)high[2] && z < (int64_t)l->size[2]; z++) {
                double w[3];
                for (int i = 0; i < 3; i++) {
                    const double *a = p[(i + 1) % 3], *b = p[(i + 2) % 3];
                    w[i] = ((a[1] - (double)y) * (b[2] - (double)z) - (a[2] - (double)z) * (b[1] - (double)y)) / area;
                }
                if (w[0] < 0 || w[1] < 0 || w[2] < 0 || y < 0 || z < 0) continue;
                double x = w[0] * p[0][0] + w[1] * p[1][0] + w[2] * p[2][0]; /* centres below x are before the crossing */
                int64_t last = x < 0 ? -1 : (int64_t)x < (int64_t)l->size[0] - 1 ? (int64_t)x : (int64_t)l->size[0] - 1;
                if (last >= 0) *cube_at(l, (uint32_t)last, (uint32_t)y, (uint32_t)z) ^= 2;
            }
    }
    for (uint32_t z = 0; z < l->size[2]; z++)
        for (uint32_t y = 0; y < l->size[1]; y++) {
            uint8_t parity = 0;
            for (uint32_t x = l->size[0]; x-- > 0;) {
                parity ^= *cube_at(l, x, y, z) >> 1 & 1;
                *cube_at(l, x, y, z) = parity;
            }
        }
}

/* Cubes that the surface itself passes through, by points on the triangles half a cube apart. */
static void touch_surface(const lattice* l, const es_raster_mesh* mesh)
{
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const float* p[3];
        double longest = 0;
        for (int i = 0; i < 3; i++) p[i] = mesh->positions + 4 * (size_t)mesh->indices[3 * (size_t)t + i];
        for (int i = 0; i < 3; i++) {
            double squared = 0;
            for (int k = 0; k < 3; k++) squared += ((double)p[i][k] - (double)p[(i + 1) % 3][k]) * ((double)p[i][k] - (double)p[(i + 1) % 3][k]);
            longest = squared > longest ? squared : longest;
        }
        const uint32_t steps = (uint32_t)(2 * __builtin_sqrt(longest) / l->spacing) + 1;
        for (uint32_t a = 0; a <= steps; a++)
            for (uint32_t b = 0; a + b <= steps; b++) {
                uint32_t at[3];
                for (int k = 0; k < 3; k++) {
                    double x = ((double)p[0][k] * (steps - a - b) + (double)p[1][k] * a + (double)p[2][k] * b) / steps;
                    x = (x - l->low[k]) / l->spacing;
                    at[k] = x < 0 ? 0 : x < l->size[k] ? (uint32_t)x : l->size[k] - 1;
                }
                *cube_at(l, at[0], at[1], at[2]) |= 1;
            }
    }
}

static const uint8_t split[2][5][4] = {{{0, 1, 3, 5}, {0, 3, 2, 6}, {0, 5, 4, 6}, {3, 5, 6, 7}, {0, 3, 5, 6}},
    {{1, 0, 2, 4}, {1, 2, 3, 7}, {1, 4, 5, 7}, {2, 4, 6, 7}, {1, 2, 4, 7}}};

static bool build(es_context* context, const lattice* l, uint32_t cubes, es_soft_solid* solid)
{
    const size_t corners = ((size_t)l->size[0] + 1) * ((size_t)l->size[1] + 1) * ((size_t)l->size[2] + 1);
    uint32_t* number = es_allocate_array(context, corners, sizeof *number);
    if (!number) return false;
    memset(number, 0xff, corners * sizeof *number);
    solid->tetrahedron_count = 5 * cubes;
    solid->tetrahedra = es_allocate_array(context, 4 * (size_t)solid->tetrahedron_count, sizeof(uint32_t));
    uint32_t tetrahedra = 0, particles = 0;
    for (int pass = 0; pass < 2 && solid->tetrahedra; pass++) {
        if (pass == 1) {
            solid->particles = es_allocate_array(context, 3 * (size_t)particles, sizeof(float));
            if (!solid->particles) break;
        }
        for (uint32_t z = 0; z < l->size[2]; z++)
            for (uint32_t y = 0; y < l->size[1]; y++)
                for (uint32_t x = 0; x < l->size[0]; x++) {
                    if (!*cube_at(l, x, y, z)) continue;
                    size_t at[8];
                    for (uint32_t c = 0; c < 8; c++) {
                        const uint32_t place[3] = {x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)};
                        at[c] = ((size_t)place[2] * (l->size[1] + 1) + place[1]) * (l->size[0] + 1) + place[0];
                        if (pass == 0 && number[at[c]] == UINT32_MAX) number[at[c]] = particles++;
                        for (int k = 0; k < 3 && pass == 1; k++) solid->particles[3 * (size_t)number[at[c]] + k] = (float)(l->low[k] + place[k] * l->spacing);
                    }
                    for (int i = 0; i < 5 && pass == 0; i++, tetrahedra++)
                        for (int k = 0; k < 4; k++) solid->tetrahedra[4 * (size_t)tetrahedra + k] = number[at[split[(x + y + z) & 1][i][k]]];
                }
    }
    solid->particle_count = particles;
    es_release(context, number, corners * sizeof *number);
    return solid->particles != NULL;
}

es_result es_soft_fill(const es_world* world, es_mesh handle, float spacing, es_soft_solid* solid)
{
    if (!world || !solid) return ES_INVALID_ARGUMENT;
    *solid = (es_soft_solid){0};
    es_context* context = world->context;
    const es_mesh_object* mesh = es_world_object(world, ES_OBJECT_MESH, handle.id);
    if (!mesh) return ES_STALE_HANDLE;
    if (!es_within(spacing, 1e-6f, 1e6f)) return es_fail(context, ES_INVALID_ARGUMENT, "es_soft_fill: spacing is %g m; it must lie in 1e-6 … 1e6", (double)spacing);
    lattice l = {.spacing = (double)spacing};
    const es_vec3 low = mesh->raster.bounds_min, high = mesh->raster.bounds_max;
    double cubes = 1;
    for (int k = 0; k < 3; k++) {
        double extent = (double)(&high.x)[k] - (double)(&low.x)[k], count = extent / (double)spacing;
        l.size[k] = count < CUBES ? (uint32_t)count + 1 : CUBES;
        l.low[k] = ((double)(&low.x)[k] + (double)(&high.x)[k]) / 2 - l.size[k] * l.spacing / 2;
        cubes *= l.size[k];
    }
    if (cubes > CUBES || mesh->raster.triangle_count == 0)
        return es_fail(context, ES_INVALID_ARGUMENT, "es_soft_fill: %.0f cubes of %g m in the box of mesh '%.64s'; 1 … %d are accepted, and a mesh with triangles", cubes, (double)spacing,
            mesh->object.name ? mesh->object.name : "", CUBES);
    const size_t bytes = (size_t)cubes;
    l.cubes = es_allocate_zero(context, bytes);
    if (!l.cubes) return es_context_last_result(context);
    es_fp_environment environment = es_fp_enter();
    cross_lines(&l, &mesh->raster);
    touch_surface(&l, &mesh->raster);
    uint32_t used = 0;
    for (size_t i = 0; i < bytes; i++) used += l.cubes[i];
    bool good = build(context, &l, used, solid);
    es_fp_leave(environment);
    es_release(context, l.cubes, bytes);
    if (good) return ES_OK;
    es_soft_solid_free(world, solid);
    return es_context_last_result(context);
}

void es_soft_solid_free(const es_world* world, es_soft_solid* solid)
{
    if (!world || !solid) return;
    es_release(world->context, solid->particles, 3 * (size_t)solid->particle_count * sizeof(float));
    es_release(world->context, solid->tetrahedra, 4 * (size_t)solid->tetrahedron_count * sizeof(uint32_t));
    *solid = (es_soft_solid){0};
}
