/* Triangles that cross the near plane or the guard band: homogeneous clipping (Blinn and Newell 1978), one polygon at a time.
 *
 * Every cut is computed from the vertex inside to the vertex outside, so two triangles that share an edge get the same new vertex
 * there; a vertex that is kept has the snapped record it has in unclipped triangles. The polygon is drawn as a fan whose pieces
 * keep the triangle's id.
 */
#include "raster/stages.h"

typedef struct clip_vertex {
    es_window_vertex v;
    const es_snapped_vertex* snapped;  /* NULL: made by a cut */
} clip_vertex;

enum { PLANE_NEAR, PLANE_LEFT, PLANE_RIGHT, PLANE_TOP, PLANE_BOTTOM, PLANES };

static float distance_to(const es_window_vertex* v, int plane)
{
    const float guard = (float)ES_GUARD_BAND;
    switch (plane) {
    case PLANE_NEAR: return v->w - v->z;
    case PLANE_LEFT: return guard * v->w + v->xw;
    case PLANE_RIGHT: return guard * v->w - v->xw;
    case PLANE_TOP: return guard * v->w + v->yw;
    default: return guard * v->w - v->yw;
    }
}

static es_window_vertex cut(const es_window_vertex* inside, float d_inside, const es_window_vertex* outside, float d_outside)
{
    float t = d_inside / (d_inside - d_outside);
    return (es_window_vertex){inside->xw + t * (outside->xw - inside->xw), inside->yw + t * (outside->yw - inside->yw),
        inside->z + t * (outside->z - inside->z), inside->w + t * (outside->w - inside->w)};
}

/* Rounds half to even as the vertex kernel does; |a| <= 2^21 */
static int32_t round_even(float a)
{
    const float magic = 12582912.0f; /* 1.5 * 2^23 */
    volatile float shifted = a + magic;
    return (int32_t)(shifted - magic);
}

static bool snap(const clip_vertex* c, es_snapped_vertex* out)
{
    if (c->snapped) {
        *out = *c->snapped;
        return true;
    }
    if (!(c->v.w > 0)) return false; /* a near plane at distance zero, or below what a float keeps */
    float inverse_w = 1.0f / c->v.w, px = c->v.xw * inverse_w, py = c->v.yw * inverse_w;
    /* a cut lies on its plane up to rounding, which at 8192 is a fraction of a subpixel */
    const float guard = (float)ES_GUARD_BAND;
    if (!(px >= -2 * guard && px <= 2 * guard && py >= -2 * guard && py <= 2 * guard)) return false;
    px = px < -guard ? -guard : px > guard ? guard : px;
    py = py < -guard ? -guard : py > guard ? guard : py;
    float depth = c->v.z * inverse_w;
    *out = (es_snapped_vertex){round_even(px * ES_SUBPIXELS), round_even(py * ES_SUBPIXELS), depth < 1.0f ? depth : 1.0f, 0};
    return true;
}

static int32_t min3(int32_t a, int32_t b, int32_t c) { int32_t m = a < b ? a : b; return m < c ? m : c; }
static int32_t max3(int32_t a, int32_t b, int32_t c) { int32_t m = a > b ? a : b; return m > c ? m : c; }

bool es_append_large(es_bin_job* job, const es_snapped_vertex* a, const es_snapped_vertex* b, const es_snapped_vertex* c, uint32_t id)
{
    int64_t area = (int64_t)(b->x - a->x) * (c->y - a->y) - (int64_t)(c->x - a->x) * (b->y - a->y);
    if (area == 0 || (area > 0 ? job->instance->cull_positive : job->instance->cull_negative)) return false;
    if (area < 0) {
        const es_snapped_vertex* swap = b;
        b = c;
        c = swap;
    }
    int32_t ox = ES_SUBPIXELS / 2 - (int32_t)job->width * (ES_SUBPIXELS / 2), oy = ES_SUBPIXELS / 2 - (int32_t)job->height * (ES_SUBPIXELS / 2);
    int32_t px0 = (min3(a->x, b->x, c->x) - ox + 255) >> ES_SUBPIXEL_BITS, px1 = (max3(a->x, b->x, c->x) - ox - 1) >> ES_SUBPIXEL_BITS;
    int32_t py0 = (min3(a->y, b->y, c->y) - oy + 255) >> ES_SUBPIXEL_BITS, py1 = (max3(a->y, b->y, c->y) - oy - 1) >> ES_SUBPIXEL_BITS;
    if (px0 < 0) px0 = 0;
    if (py0 < 0) py0 = 0;
    if (px1 > (int32_t)job->width - 1) px1 = (int32_t)job->width - 1;
    if (py1 > (int32_t)job->height - 1) py1 = (int32_t)job->height - 1;
    if (px0 > px1 || py0 > py1) return false;
    job->large_rects[job->large_count] = (es_tile_rect){(uint8_t)(px0 >> ES_TILE_BITS), (uint8_t)(py0 >> ES_TILE_BITS), (uint8_t)(px1 >> ES_TILE_BITS), (uint8_t)(py1 >> ES_TILE_BITS)};
    job->large[job->large_count++] = (es_large_triangle){a->x, a->y, b->x, b->y, c->x, c->y, a->depth, b->depth, c->depth, id, {0, 0}};
    return true;
}

void es_clip_triangle(es_bin_job* job, uint32_t triangle)
{
    clip_vertex polygon[2][ES_CLIP_VERTICES_MAX];
    uint32_t count = 3, flags = 0;
    int current = 0;
    const float* m = job->instance->window.m;
    for (int k = 0; k < 3; k++) {
        uint32_t index = job->indices[3 * (size_t)triangle + k];
        const float* p = job->instance->mesh->positions + 4 * (size_t)index;
        float r[4];
        for (int i = 0; i < 4; i++) r[i] = ((m[4 * i] * p[0] + m[4 * i + 1] * p[1]) + m[4 * i + 2] * p[2]) + m[4 * i + 3];
        const es_snapped_vertex* snapped = &job->vertices[index];
        polygon[0][k] = (clip_vertex){{r[0], r[1], r[2], r[3]}, snapped->flags & ES_OUT_CLIP ? NULL : snapped};
        flags |= snapped->flags;
    }
    job->clipped++;
    for (int plane = flags & ES_OUT_NEAR ? PLANE_NEAR : PLANE_LEFT; plane < PLANES && count >= 3; plane++) {
        const clip_vertex* in = polygon[current];
        clip_vertex* out = polygon[current ^= 1];
        uint32_t out_count = 0;
        for (uint32_t i = 0; i < count; i++) {
            const clip_vertex *a = &in[i], *b = &in[i + 1 < count ? i + 1 : 0];
            float da = distance_to(&a->v, plane), db = distance_to(&b->v, plane);
            /* a vertex with a valid snapped record counts as inside, whatever rounding says here */
            bool a_in = a->snapped || da >= 0, b_in = b->snapped || db >= 0;
            if (a_in && out_count < ES_CLIP_VERTICES_MAX) out[out_count++] = *a;
            if (a_in != b_in && out_count < ES_CLIP_VERTICES_MAX) {
                if (a_in) out[out_count++] = (clip_vertex){cut(&a->v, da > 0 ? da : 0, &b->v, db), NULL};
                else out[out_count++] = (clip_vertex){cut(&b->v, db > 0 ? db : 0, &a->v, da), NULL};
            }
        }
        count = out_count;
    }
    if (count < 3) return;
    es_snapped_vertex snapped[ES_CLIP_VERTICES_MAX];
    for (uint32_t i = 0; i < count; i++)
        if (!snap(&polygon[current][i], &snapped[i])) return;
    for (uint32_t i = 1; i + 1 < count; i++) es_append_large(job, &snapped[0], &snapped[i], &snapped[i + 1], job->first_id + triangle);
}
