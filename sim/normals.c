/* Fans of triangles round vertices, and the two loops over them. */
#include "sim/normals.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/random.h"
#include "sim/kernel_table.h"

static uint32_t block_count(uint32_t vertex_count) { return (vertex_count + 7) / 8; }
/* one number more than there are triangles, in whole blocks of eight */
static size_t face_floats(uint32_t triangle_count) { return ((size_t)triangle_count / 8 + 1) * 8 * 4; }

bool es_vertex_fans_make(es_context* context, const uint32_t* indices, uint32_t triangle_count, uint32_t vertex_count, const uint32_t* welded, es_vertex_fans* fans)
{
    const uint32_t blocks = block_count(vertex_count);
    *fans = (es_vertex_fans){.vertex_count = vertex_count, .triangle_count = triangle_count};
    fans->first_row = es_allocate_array(context, blocks + (size_t)1, sizeof *fans->first_row);
    uint32_t* degree = fans->first_row ? es_allocate_zero(context, ((size_t)vertex_count + 1) * sizeof *degree) : NULL;
    if (!degree) {
        es_vertex_fans_free(context, fans);
        return false;
    }
    for (size_t i = 0; i < (size_t)triangle_count * 3; i++) degree[welded ? welded[indices[i]] : indices[i]]++;
#define OWNER(v) ((v) < vertex_count ? welded ? welded[v] : (v) : welded ? welded[0] : 0) /* vertices past the end are vertex 0 */
    size_t row_count = 0;
    bool fits = true;
    for (uint32_t b = 0; b < blocks; b++) {
        uint32_t most = 0;
        for (uint32_t lane = 0; lane < 8; lane++) {
            uint32_t own = degree[OWNER(8 * b + lane)];
            if (own > most) most = own;
        }
        fans->first_row[b] = (uint32_t)row_count;
        row_count += most;
        fits &= row_count <= UINT32_MAX;
    }
    fans->first_row[blocks] = (uint32_t)row_count;
    fans->row_count = row_count;
    if (!fits) es_fail(context, ES_OUT_OF_MEMORY, "normals: too many triangles meet at vertices that lie side by side");
    fans->rows = fits ? es_allocate_array(context, row_count + 1, 8 * sizeof *fans->rows) : NULL;
    if (fans->rows) fans->faces = es_allocate_zero(context, face_floats(triangle_count) * sizeof *fans->faces);
    if (!fans->faces) {
        es_release(context, degree, ((size_t)vertex_count + 1) * sizeof *degree);
        es_vertex_fans_free(context, fans);
        return false;
    }
    for (size_t i = 0; i < row_count * 8; i++) fans->rows[i] = triangle_count;
    memset(degree, 0, ((size_t)vertex_count + 1) * sizeof *degree);
    /* the owners' own lanes first, in triangle order; then everyone else copies his owner's */
    for (uint32_t t = 0; t < triangle_count; t++)
        for (uint32_t corner = 0; corner < 3; corner++) {
            uint32_t v = OWNER(indices[3 * (size_t)t + corner]);
            fans->rows[(fans->first_row[v / 8] + (size_t)degree[v]++) * 8 + v % 8] = t;
        }
    for (uint32_t v = 0; v < blocks * 8; v++) {
        uint32_t owner = OWNER(v);
        for (uint32_t k = 0; owner != v && k < degree[owner]; k++)
            fans->rows[(fans->first_row[v / 8] + (size_t)k) * 8 + v % 8] = fans->rows[(fans->first_row[owner / 8] + (size_t)k) * 8 + owner % 8];
    }
#undef OWNER
    es_release(context, degree, ((size_t)vertex_count + 1) * sizeof *degree);
    return true;
}

void es_vertex_fans_free(es_context* context, es_vertex_fans* fans)
{
    es_release(context, fans->first_row, (block_count(fans->vertex_count) + (size_t)1) * sizeof *fans->first_row);
    es_release(context, fans->rows, (fans->row_count + 1) * 8 * sizeof *fans->rows);
    es_release(context, fans->faces, face_floats(fans->triangle_count) * sizeof *fans->faces);
    *fans = (es_vertex_fans){0};
}

bool es_weld_vertices(es_context* context, const float* positions, const float* normals, uint32_t vertex_count, uint32_t* welded)
{
    uint64_t capacity = 16;
    while (capacity < 2 * (uint64_t)vertex_count) capacity *= 2;
    uint32_t* table = es_allocate_zero(context, capacity * sizeof *table); /* vertex + 1 */
    if (!table) return false;
    for (uint32_t v = 0; v < vertex_count; v++) {
        float key[6];
        memcpy(key, positions + 4 * (size_t)v, 3 * sizeof(float));
        memcpy(key + 3, normals + 4 * (size_t)v, 3 * sizeof(float));
        uint64_t at = es_hash_bytes(0, key, sizeof key) & (capacity - 1);
        for (; table[at]; at = (at + 1) & (capacity - 1)) {
            size_t other = table[at] - 1;
            if (memcmp(positions + 4 * other, key, 3 * sizeof(float)) == 0 && memcmp(normals + 4 * other, key + 3, 3 * sizeof(float)) == 0) break;
        }
        if (!table[at]) table[at] = v + 1;
        welded[v] = table[at] - 1;
    }
    es_release(context, table, capacity * sizeof *table);
    return true;
}

typedef struct normals_loop {
    const es_sim_kernels* kernels;
    const es_vertex_fans* fans;
    const uint32_t* indices;
    const float* positions;
    float scale;
    float* normals;
} normals_loop;

static void faces_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const normals_loop* loop = user;
    loop->kernels->face_normals(loop->positions, loop->indices, begin, end, loop->scale, loop->fans->faces);
}

static void vertices_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const normals_loop* loop = user;
    loop->kernels->vertex_normals(loop->fans->first_row, loop->fans->rows, loop->fans->faces, begin, end, loop->normals);
}

void es_normals_recompute(es_context* context, const es_vertex_fans* fans, const uint32_t* indices, const float* positions, es_vec3 low, es_vec3 high, float* normals)
{
    float extent = es_maxf(high.x - low.x, es_maxf(high.y - low.y, high.z - low.z)), scale = 1;
    while (extent * scale > 1 && scale > 0x1p-40f) scale *= 0.5f;
    while (extent > 0 && extent * scale <= 0.5f && scale < 0x1p80f) scale *= 2;
    normals_loop loop = {es_sim_kernel_table(es_context_isa(context)), fans, indices, positions, scale, normals};
    es_parallel_for(context, fans->triangle_count, 4096, faces_body, &loop);
    es_parallel_for(context, block_count(fans->vertex_count), 512, vertices_body, &loop);
}
