/* Instances of a view: frustum culling by bounds, matrices in double rounded once, and the cutting into chunks and vertex blocks. */
#include <string.h>

#include "platform/random.h"
#include "raster/rasterizer.h"
#include "raster/view_content.h"

enum { VERTEX_BLOCK = 1024 };

/* row-major c = a * b */
static void multiply(double c[16], const double a[16], const double b[16])
{
    double r[16];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) r[4 * i + j] = ((a[4 * i] * b[j] + a[4 * i + 1] * b[4 + j]) + a[4 * i + 2] * b[8 + j]) + a[4 * i + 3] * b[12 + j];
    memcpy(c, r, sizeof r);
}

static void rows_of(double r[16], const es_mat4* m)
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) r[4 * i + j] = m->m[4 * j + i];
}

/* Gauss-Jordan with pivoting; false when singular */
static bool invert(double out[16], const double in[16])
{
    double a[4][8];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            a[i][j] = in[4 * i + j];
            a[i][4 + j] = i == j;
        }
    for (int c = 0; c < 4; c++) {
        int pivot = c;
        for (int r = c + 1; r < 4; r++)
            if (__builtin_fabs(a[r][c]) > __builtin_fabs(a[pivot][c])) pivot = r;
        if (!(__builtin_fabs(a[pivot][c]) > 1e-200)) return false;
        if (pivot != c)
            for (int j = 0; j < 8; j++) {
                double t = a[c][j];
                a[c][j] = a[pivot][j];
                a[pivot][j] = t;
            }
        double scale = 1.0 / a[c][c];
        for (int j = 0; j < 8; j++) a[c][j] *= scale;
        for (int r = 0; r < 4; r++) {
            double f = a[r][c];
            if (r == c || f == 0) continue;
            for (int j = 0; j < 8; j++) a[r][j] -= f * a[c][j];
        }
    }
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            if (!(__builtin_fabs(a[i][4 + j]) < 1e200)) return false;
            out[4 * i + j] = a[i][4 + j];
        }
    return true;
}

static void window_of(double out[16], const es_mat4* view, const es_mat4* projection, uint32_t width, uint32_t height)
{
    double v[16], p[16];
    rows_of(v, view);
    rows_of(p, projection);
    for (int j = 0; j < 4; j++) {
        p[j] *= 0.5 * width;
        p[4 + j] *= -0.5 * height;
    }
    multiply(out, p, v);
}

es_view_matrices es_view_matrices_of(const es_raster_view* view)
{
    es_view_matrices m;
    window_of(m.window, &view->view, &view->projection, view->width, view->height);
    window_of(m.previous_window, &view->previous_view, &view->previous_projection, view->width, view->height);
    const float* p = view->projection.m;
    m.orthographic = p[3] == 0 && p[7] == 0 && p[11] == 0;
    m.still = !memcmp(&view->view, &view->previous_view, sizeof view->view) && !memcmp(&view->projection, &view->previous_projection, sizeof view->projection);
    return m;
}

/* Wholly outside one plane of the frustum? One pixel of margin outweighs all rounding in the vertex stage. Bounds that are not finite
 * are never outside. */
static bool outside(const double window[16], const es_raster_mesh* mesh, uint32_t width, uint32_t height)
{
    const float low[3] = {mesh->bounds_min.x, mesh->bounds_min.y, mesh->bounds_min.z}, high[3] = {mesh->bounds_max.x, mesh->bounds_max.y, mesh->bounds_max.z};
    for (int i = 0; i < 3; i++)
        if (!__builtin_isfinite(low[i]) || !__builtin_isfinite(high[i])) return false;
    unsigned all = ~0u;
    double hw = 0.5 * width + 1, hh = 0.5 * height + 1;
    for (int corner = 0; corner < 8; corner++) {
        double p[3], r[4];
        for (int i = 0; i < 3; i++) p[i] = corner >> i & 1 ? high[i] : low[i];
        for (int i = 0; i < 4; i++) r[i] = window[4 * i] * p[0] + window[4 * i + 1] * p[1] + window[4 * i + 2] * p[2] + window[4 * i + 3];
        double near_margin = 1e-5 * (__builtin_fabs(r[2]) + __builtin_fabs(r[3]));
        unsigned out = (unsigned)(r[0] < -hw * r[3]) | (unsigned)(r[0] > hw * r[3]) << 1 | (unsigned)(r[1] < -hh * r[3]) << 2 |
                       (unsigned)(r[1] > hh * r[3]) << 3 | (unsigned)(r[2] > r[3] + near_margin) << 4 | (unsigned)(r[2] < -1e-5) << 5;
        all &= out;
    }
    return all != 0;
}

uint64_t es_view_pose_hash(const es_raster_view* view)
{
    const uint32_t words[] = {view->width, view->height, (uint32_t)view->cull};
    return es_hash_bytes(es_hash_bytes(es_hash_bytes(0, words, sizeof words), &view->view, sizeof view->view), &view->projection, sizeof view->projection);
}

uint64_t es_view_content_hash(const es_draw_list* list, const es_raster_view* view)
{
    double of_view[16], model[16], window[16];
    uint64_t hash = 0;
    window_of(of_view, &view->view, &view->projection, view->width, view->height);
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_instance* instance = &list->instances[i];
        const es_raster_mesh* mesh = instance->mesh;
        if (!mesh || !mesh->triangle_count || !mesh->vertex_count) continue;
        rows_of(model, &instance->transform);
        multiply(window, of_view, model);
        if (outside(window, mesh, view->width, view->height)) continue;
        const uint32_t words[] = {instance->id, instance->material};
        hash = es_hash_bytes(hash, words, sizeof words);
        hash = es_hash_bytes(hash, &instance->transform, sizeof instance->transform);
        hash = es_hash_bytes(hash, &mesh->revision, sizeof mesh->revision);
    }
    return hash;
}

static void normal_matrix_of(float out[9], const es_mat4* transform, bool* mirrored)
{
    double a[16], c[9], largest = 0;
    rows_of(a, transform);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            c[3 * i + j] = a[4 * i1 + j1] * a[4 * i2 + j2] - a[4 * i1 + j2] * a[4 * i2 + j1];
            double m = __builtin_fabs(c[3 * i + j]);
            if (m > largest) largest = m;
        }
    *mirrored = a[0] * c[0] + a[1] * c[1] + a[2] * c[2] < 0;
    /* cofactors are determinant times inverse transposed; only the sign and the ratios matter */
    double scale = largest > 0 ? (*mirrored ? -1.0 : 1.0) / largest : 0.0;
    for (int i = 0; i < 9; i++) out[i] = (float)(c[i] * scale);
}

static void motion_of(es_prepared_instance* p, const es_raster_instance* instance, const es_view_matrices* matrices, const double window[16])
{
    double previous_model[16], previous[16], inverse[16], change[16];
    rows_of(previous_model, &instance->previous_transform);
    multiply(previous, matrices->previous_window, previous_model);
    for (int i = 0; i < 16; i++) p->previous_window.m[i] = (float)previous[i];
    p->moving = !matrices->still || memcmp(&instance->transform, &instance->previous_transform, sizeof instance->transform);
    const es_raster_mesh* mesh = instance->mesh;
    p->has_deltas = mesh->previous_positions && mesh->previous_positions != mesh->positions;
    if (!p->moving || p->has_deltas) return;
    if (!invert(inverse, window)) {
        p->has_deltas = true;
        return;
    }
    multiply(change, previous, inverse);
    for (int i = 0; i < 4; i++) change[5 * i] -= 1;
    const int rows[3] = {0, 1, 3};
    for (int r = 0; r < 3; r++)
        for (int j = 0; j < 4; j++) p->motion[4 * r + j] = (float)change[4 * rows[r] + j];
}

bool es_prepare_instances(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, const es_view_matrices* matrices, uint32_t planes)
{
    es_context* context = rasterizer->context;
    rasterizer->instance_count = rasterizer->chunk_count = rasterizer->vertex_block_count = 0;
    rasterizer->vertex_count = rasterizer->delta_count = 0;
    rasterizer->instances_culled = rasterizer->triangle_count = 0;
    if (!es_grow(context, (void**)&rasterizer->instances, &rasterizer->instance_capacity, 0, list->instance_count, sizeof *rasterizer->instances)) return false;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_instance* instance = &list->instances[i];
        const es_raster_mesh* mesh = instance->mesh;
        if (!mesh || !mesh->triangle_count || !mesh->vertex_count) continue;
        double model[16], window[16];
        rows_of(model, &instance->transform);
        multiply(window, matrices->window, model);
        if (outside(window, mesh, view->width, view->height)) {
            rasterizer->instances_culled++;
            continue;
        }
        if (mesh->vertex_count > 1u << 27) {
            es_fail(context, ES_INVALID_ARGUMENT, "instance %u of the draw list: its mesh has %u vertices; 2^27 are supported", i, mesh->vertex_count);
            return false;
        }
        uint64_t chunks = ((uint64_t)mesh->triangle_count + ES_CHUNK_TRIANGLES - 1) >> ES_CHUNK_BITS;
        if (rasterizer->chunk_count + chunks > ES_CHUNKS_MAX || rasterizer->vertex_count + mesh->vertex_count > UINT32_MAX - VERTEX_BLOCK) {
            es_fail(context, ES_INVALID_ARGUMENT, "instance %u of the draw list: a view holds at most 2^32 triangles and 2^32 vertices", i);
            return false;
        }
        es_prepared_instance* p = &rasterizer->instances[rasterizer->instance_count];
        *p = (es_prepared_instance){.mesh = mesh, .material = &rasterizer->materials[instance->material], .material_index = instance->material,
            .instance_id = instance->id, .first_id = rasterizer->chunk_count << ES_CHUNK_BITS, .chunk_count = (uint32_t)chunks,
            .first_vertex = (uint32_t)rasterizer->vertex_count, .first_delta = (uint32_t)rasterizer->delta_count};
        for (int k = 0; k < 16; k++) p->window.m[k] = (float)window[k];
        for (int k = 0; k < 12; k++) p->world[k] = (float)model[k];
        normal_matrix_of(p->normal_matrix, &instance->transform, &p->mirrored);
        if (planes & ES_GBUFFER_MOTION) motion_of(p, instance, matrices, window);
        if (view->cull != ES_CULL_NONE && !p->material->double_sided) {
            /* front faces have negative window area, or positive when mirrored */
            bool cull_front = view->cull == ES_CULL_FRONT;
            p->cull_negative = cull_front != p->mirrored;
            p->cull_positive = !p->cull_negative;
        }
        if (!es_grow(context, (void**)&rasterizer->chunks, &rasterizer->chunk_capacity, rasterizer->chunk_count, rasterizer->chunk_count + chunks, sizeof *rasterizer->chunks) ||
            !es_grow(context, (void**)&rasterizer->chunk_instance, &rasterizer->chunk_instance_capacity, rasterizer->chunk_count, rasterizer->chunk_count + chunks, sizeof *rasterizer->chunk_instance))
            return false;
        for (uint32_t c = 0; c < chunks; c++) {
            uint32_t first = c << ES_CHUNK_BITS, left = mesh->triangle_count - first;
            rasterizer->chunks[rasterizer->chunk_count + c] = (es_chunk){.instance = rasterizer->instance_count, .first_triangle = first,
                .triangle_count = left < ES_CHUNK_TRIANGLES ? left : ES_CHUNK_TRIANGLES};
            rasterizer->chunk_instance[rasterizer->chunk_count + c] = rasterizer->instance_count;
        }
        size_t blocks = ((size_t)mesh->vertex_count + VERTEX_BLOCK - 1) / VERTEX_BLOCK;
        if (!es_grow(context, (void**)&rasterizer->vertex_blocks, &rasterizer->vertex_block_capacity, rasterizer->vertex_block_count, rasterizer->vertex_block_count + blocks, sizeof *rasterizer->vertex_blocks))
            return false;
        for (size_t b = 0; b < blocks; b++) {
            uint32_t first = (uint32_t)(b * VERTEX_BLOCK), left = mesh->vertex_count - first;
            rasterizer->vertex_blocks[rasterizer->vertex_block_count + b] = (es_vertex_block){rasterizer->instance_count, first, left < VERTEX_BLOCK ? left : VERTEX_BLOCK};
        }
        size_t padded = ((size_t)mesh->vertex_count + 7) / 8 * 8;
        rasterizer->chunk_count += (uint32_t)chunks;
        rasterizer->vertex_block_count += (uint32_t)blocks;
        rasterizer->vertex_count += padded;
        if (p->has_deltas) rasterizer->delta_count += padded;
        rasterizer->triangle_count += mesh->triangle_count;
        rasterizer->instance_count++;
    }
    return es_grow(context, (void**)&rasterizer->snapped, &rasterizer->snapped_capacity, 0, rasterizer->vertex_count, sizeof *rasterizer->snapped) &&
           (!planes || es_grow(context, (void**)&rasterizer->window, &rasterizer->window_capacity, 0, rasterizer->vertex_count, sizeof *rasterizer->window)) &&
           es_grow(context, (void**)&rasterizer->deltas, &rasterizer->delta_capacity, 0, rasterizer->delta_count, sizeof *rasterizer->deltas);
}
