/* Two boxes: the fifteen separating axes, then a face clipped against a face or the nearest points of two edges.
 *
 * Everything is in the first box's axes. C has the second one's axes as columns. Edges within half a degree of parallel are left out: their cross
 * product is noise, and a face's axis is as good. Ericson, "Real-Time Collision Detection", 4.4.1; Gottschalk 1996. */
#include "sim/rigid/manifold.h"

typedef struct clip_point { float u, v, w; uint32_t label; /* of the side that begins here */ } clip_point;

/* A convex polygon grows by one corner per side, to eight; rounding in needle-like ones may cut every other corner: 4, 6, 9, 13, 19. */
enum { CLIPPED = 20 };

/* The polygon's part with sign * coordinate <= limit. Labels: 0 … 3 sides of the incident face, 4 … 7 of the reference face. */
static uint32_t clip(const clip_point* in, uint32_t count, int axis, float sign, float limit, uint32_t label, clip_point* out)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        const clip_point *p = &in[i], *q = &in[i + 1 < count ? i + 1 : 0];
        float dp = sign * (axis ? p->v : p->u) - limit, dq = sign * (axis ? q->v : q->u) - limit;
        bool p_inside = dp <= 0, q_inside = dq <= 0;
        if (p_inside) out[kept++] = *p;
        if (p_inside != q_inside) {
            float t = dp / (dp - dq);
            out[kept++] = (clip_point){p->u + t * (q->u - p->u), p->v + t * (q->v - p->v), p->w + t * (q->w - p->w), p_inside ? label : p->label};
        }
    }
    return kept;
}

/* The face of `reference` along `axis`, on the side of `sign`, against the other's most opposed one. c[i][j]: the other's axis j along the
 * reference's axis i; t: the other's centre in the reference's axes. */
static uint32_t face_contact(const es_placed_box* reference, const es_placed_box* other, float c[3][3], const float t[3], int axis, float sign,
    bool flipped, float margin, es_manifold* manifold)
{
    const int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    const float *h = &reference->half.x, *g = &other->half.x;
    int j = 0;
    for (int k = 1; k < 3; k++)
        if (es_absf(c[axis][k]) > es_absf(c[axis][j])) j = k;
    const int k = j == 2 ? 0 : j + 1, l = j == 0 ? 2 : j - 1;
    float facing = c[axis][j] * sign > 0 ? -g[j] : g[j];
    float centre[3], sk[3], sl[3];
    for (int i = 0; i < 3; i++) {
        centre[i] = t[i] + facing * c[i][j];
        sk[i] = g[k] * c[i][k];
        sl[i] = g[l] * c[i][l];
    }
    clip_point a[CLIPPED], b[CLIPPED], *polygon = a;
    static const float corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    float most_u = 0, most_v = 0;
    for (uint32_t i = 0; i < 4; i++) {
        float x = corner[i][0], y = corner[i][1];
        a[i] = (clip_point){centre[u] + x * sk[u] + y * sl[u], centre[v] + x * sk[v] + y * sl[v],
            sign * (centre[axis] + x * sk[axis] + y * sl[axis]) - h[axis], i};
        most_u = es_maxf(most_u, es_absf(a[i].u));
        most_v = es_maxf(most_v, es_absf(a[i].v));
    }
    uint32_t count = 4;
    if (most_u > h[u]) {
        count = clip(a, count, 0, 1, h[u], 4, b);
        count = clip(b, count, 0, -1, h[u], 5, a);
    }
    if (most_v > h[v]) {
        count = clip(a, count, 1, 1, h[v], 6, b);
        count = clip(b, count, 1, -1, h[v], 7, a);
    }
    es_vec3 axes[3] = {reference->axes.x, reference->axes.y, reference->axes.z};
    es_vec3 n = es_v3_scale(axes[axis], sign);
    manifold->normal = flipped ? es_v3_neg(n) : n;
    uint32_t faces = ((uint32_t)flipped << 6 | (uint32_t)(axis * 2 + (sign > 0)) << 3 | (uint32_t)(j * 2 + (facing > 0))) << 6;
    es_contact_point points[CLIPPED];
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (polygon[i].w > margin) continue;
        es_vec3 p = es_v3_mad(reference->centre, n, h[axis] + 0.5f * polygon[i].w);
        p = es_v3_mad(es_v3_mad(p, axes[u], polygon[i].u), axes[v], polygon[i].v);
        points[kept++] = (es_contact_point){p, polygon[i].w, faces | polygon[i ? i - 1 : count - 1].label << 3 | polygon[i].label};
    }
    es_manifold_choose(manifold, points, kept);
    return kept > 0;
}

static uint32_t edge_contact(const es_placed_box* a, const es_placed_box* b, float c[3][3], const float t[3], int i, int j, const float n[3],
    float separation, es_manifold* manifold)
{
    const float *h = &a->half.x, *g = &b->half.x;
    float pa[3], pb[3] = {t[0], t[1], t[2]};
    uint32_t id = 1u << 16 | (uint32_t)(i * 3 + j) << 8;
    for (int k = 0; k < 3; k++) {
        float s = n[k] < 0 ? -1.0f : 1.0f;
        pa[k] = k == i ? 0 : s * h[k];
        if (k != i && s > 0) id |= 1u << k;
    }
    for (int k = 0; k < 3; k++) {
        if (k == j) continue;
        float along = n[0] * c[0][k] + n[1] * c[1][k] + n[2] * c[2][k], s = along > 0 ? -g[k] : g[k];
        for (int m = 0; m < 3; m++) pb[m] += s * c[m][k];
        if (s > 0) id |= 8u << k;
    }
    /* lines pa + x e_i and pb + y c_j: nearest where the difference is perpendicular to both */
    float d[3] = {pb[0] - pa[0], pb[1] - pa[1], pb[2] - pa[2]};
    float f = c[i][j], dj = d[0] * c[0][j] + d[1] * c[1][j] + d[2] * c[2][j], denominator = 1 - f * f;
    float x = es_clampf((d[i] - f * dj) / denominator, -h[i], h[i]), y = es_clampf((f * d[i] - dj) / denominator, -g[j], g[j]);
    es_vec3 middle;
    float* m = &middle.x;
    for (int k = 0; k < 3; k++) m[k] = 0.5f * (pa[k] + (k == i ? x : 0) + pb[k] + y * c[k][j]);
    es_vec3 point = es_v3_add(a->centre, es_mat3_mul(&a->axes, middle));
    es_vec3 normal = es_v3_normalize(es_mat3_mul(&a->axes, es_v3(n[0], n[1], n[2])), es_v3(0, 1, 0));
    return es_manifold_single(manifold, normal, point, separation, id);
}

uint32_t es_collide_boxes(const es_placed_box* a, const es_placed_box* b, float margin, es_manifold* manifold)
{
    const float *h = &a->half.x, *g = &b->half.x;
    const es_vec3 a_axes[3] = {a->axes.x, a->axes.y, a->axes.z}, b_axes[3] = {b->axes.x, b->axes.y, b->axes.z};
    es_vec3 d = es_v3_sub(b->centre, a->centre);
    float c[3][3], m[3][3], t[3], r[3];
    manifold->key = 0;
    for (int i = 0; i < 3; i++) {
        t[i] = es_v3_dot(a_axes[i], d);
        for (int j = 0; j < 3; j++) {
            c[i][j] = es_v3_dot(a_axes[i], b_axes[j]);
            m[i][j] = es_absf(c[i][j]);
        }
    }
    for (int j = 0; j < 3; j++) r[j] = t[0] * c[0][j] + t[1] * c[1][j] + t[2] * c[2][j];

    float best_a = -3e38f, best_b = -3e38f;
    int axis_a = 0, axis_b = 0;
    for (int i = 0; i < 3; i++) {
        float s = es_absf(t[i]) - (h[i] + m[i][0] * g[0] + m[i][1] * g[1] + m[i][2] * g[2]);
        if (s > best_a) best_a = s, axis_a = i;
    }
    if (best_a > margin) return 0;
    for (int j = 0; j < 3; j++) {
        float s = es_absf(r[j]) - (g[j] + m[0][j] * h[0] + m[1][j] * h[1] + m[2][j] * h[2]);
        if (s > best_b) best_b = s, axis_b = j;
    }
    if (best_b > margin) return 0;

    /* The first box's faces are preferred to the second's and faces to edges, unless those are clearly better: more points, and no flicker
     * between nearly equal axes. */
    const float slack = 1e-3f * es_minf(es_minf(h[0], es_minf(h[1], h[2])), es_minf(g[0], es_minf(g[1], g[2])));
    const bool use_b = best_b > best_a + 0.05f * es_absf(best_a) + slack;
    const float best_face = use_b ? best_b : best_a, to_beat = best_face + 0.05f * es_absf(best_face) + slack;

    float best_edge = to_beat, length_edge = 1, side_edge = 1;
    int edge_i = -1, edge_j = 0;
    for (int i = 0; i < 3; i++) {
        const int i1 = i == 2 ? 0 : i + 1, i2 = i == 0 ? 2 : i - 1;
        for (int j = 0; j < 3; j++) {
            const int j1 = j == 2 ? 0 : j + 1, j2 = j == 0 ? 2 : j - 1;
            float squared = 1 - m[i][j] * m[i][j]; /* of the cross product's length */
            if (squared < 1e-4f) continue;
            float along = t[i2] * c[i1][j] - t[i1] * c[i2][j];
            float reach = h[i1] * m[i2][j] + h[i2] * m[i1][j] + g[j1] * m[i][j2] + g[j2] * m[i][j1];
            float over = es_absf(along) - reach;
            if (over <= 0 && over <= to_beat) continue; /* divided by a length below one it only falls */
            float length = es_sqrt(squared), s = over / length;
            if (s > margin) return 0;
            if (s > best_edge) {
                best_edge = s;
                length_edge = length;
                side_edge = along < 0 ? -1.0f : 1.0f;
                edge_i = i;
                edge_j = j;
            }
        }
    }

    if (edge_i >= 0) {
        const int i = edge_i, j = edge_j, i1 = i == 2 ? 0 : i + 1, i2 = i == 0 ? 2 : i - 1;
        float n[3] = {0}, scale = side_edge / length_edge; /* e_i × c_j, towards the second box */
        n[i1] = -c[i2][j] * scale;
        n[i2] = c[i1][j] * scale;
        return edge_contact(a, b, c, t, i, j, n, best_edge, manifold);
    }
    if (!use_b) return face_contact(a, b, c, t, axis_a, t[axis_a] < 0 ? -1.0f : 1.0f, false, margin, manifold);
    float transposed[3][3], back[3];
    for (int i = 0; i < 3; i++) {
        back[i] = -r[i];
        for (int j = 0; j < 3; j++) transposed[i][j] = c[j][i];
    }
    return face_contact(b, a, transposed, back, axis_b, r[axis_b] > 0 ? -1.0f : 1.0f, true, margin, manifold);
}
