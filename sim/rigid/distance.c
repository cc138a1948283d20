/* GJK. The simplex of differences a - b is kept at its smallest face that holds the point nearest to zero (Ericson, "Real-Time Collision
 * Detection", 5.1 and 9.5). Doubles leave enough bits that thin simplices need no special care: what a step cannot improve ends it. */
#include "sim/rigid/distance.h"

typedef struct vertex { double p[3]; uint8_t a, b; double weight; } vertex;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static void subtract(const double a[3], const double b[3], double c[3])
{
    for (int k = 0; k < 3; k++) c[k] = a[k] - b[k];
}
static void cross(const double a[3], const double b[3], double c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static void keep(vertex* s, uint32_t* count, const uint32_t which[], const double weight[], uint32_t kept)
{
    vertex out[3];
    for (uint32_t i = 0; i < kept; i++) {
        out[i] = s[which[i]];
        out[i].weight = weight[i];
    }
    for (uint32_t i = 0; i < kept; i++) s[i] = out[i];
    *count = kept;
}

static void nearest_on_segment(vertex* s, uint32_t* count, uint32_t i, uint32_t j)
{
    double d[3];
    subtract(s[j].p, s[i].p, d);
    double t = -dot(s[i].p, d), dd = dot(d, d);
    if (t <= 0 || !(dd > 0))
        keep(s, count, (uint32_t[]){i}, (double[]){1}, 1);
    else if (t >= dd)
        keep(s, count, (uint32_t[]){j}, (double[]){1}, 1);
    else
        keep(s, count, (uint32_t[]){i, j}, (double[]){1 - t / dd, t / dd}, 2);
}

static void nearest_on_triangle(vertex* s, uint32_t* count, uint32_t i, uint32_t j, uint32_t k)
{
    const double *a = s[i].p, *b = s[j].p, *c = s[k].p;
    double ab[3], ac[3], n[3];
    subtract(b, a, ab);
    subtract(c, a, ac);
    cross(ab, ac, n);
    double nn = dot(n, n);
    double d1 = -dot(ab, a), d2 = -dot(ac, a), d3 = -dot(ab, b), d4 = -dot(ac, b), d5 = -dot(ab, c), d6 = -dot(ac, c);
    if (d1 <= 0 && d2 <= 0) { keep(s, count, (uint32_t[]){i}, (double[]){1}, 1); return; }
    if (d3 >= 0 && d4 <= d3) { keep(s, count, (uint32_t[]){j}, (double[]){1}, 1); return; }
    if (d6 >= 0 && d5 <= d6) { keep(s, count, (uint32_t[]){k}, (double[]){1}, 1); return; }
    double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) { nearest_on_segment(s, count, i, j); return; }
    if (vb <= 0 && d2 >= 0 && d6 <= 0) { nearest_on_segment(s, count, i, k); return; }
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) { nearest_on_segment(s, count, j, k); return; }
    double sum = va + vb + vc;
    if (!(nn > 0) || !(sum > 0)) { nearest_on_segment(s, count, i, j); return; }
    keep(s, count, (uint32_t[]){i, j, k}, (double[]){va / sum, vb / sum, vc / sum}, 3);
}

static void point_of(const vertex* s, uint32_t count, double p[3])
{
    for (int k = 0; k < 3; k++) {
        p[k] = 0;
        for (uint32_t i = 0; i < count; i++) p[k] += s[i].weight * s[i].p[k];
    }
}

/* True when zero is inside. */
static bool nearest_on_tetrahedron(vertex* s, uint32_t* count)
{
    static const uint8_t face[4][4] = {{0, 1, 2, 3}, {0, 3, 1, 2}, {0, 2, 3, 1}, {1, 3, 2, 0}};
    vertex best[3];
    uint32_t best_count = 0;
    double best_squared = 0;
    for (int f = 0; f < 4; f++) {
        const double *a = s[face[f][0]].p, *b = s[face[f][1]].p, *c = s[face[f][2]].p, *d = s[face[f][3]].p;
        double ab[3], ac[3], ad[3], n[3];
        subtract(b, a, ab);
        subtract(c, a, ac);
        subtract(d, a, ad);
        cross(ab, ac, n);
        double apex = dot(n, ad), zero = -dot(n, a);
        /* zero strictly on the apex's side of a face that has a thickness: not beyond it */
        if (apex * zero > 0 && apex * apex > 1e-22 * dot(n, n) * dot(ad, ad)) continue;
        vertex part[4] = {s[0], s[1], s[2], s[3]};
        uint32_t part_count = 4;
        double p[3];
        nearest_on_triangle(part, &part_count, face[f][0], face[f][1], face[f][2]);
        point_of(part, part_count, p);
        double squared = dot(p, p);
        if (best_count == 0 || squared < best_squared) {
            best_squared = squared;
            best_count = part_count;
            for (uint32_t i = 0; i < part_count; i++) best[i] = part[i];
        }
    }
    if (best_count == 0) return true;
    for (uint32_t i = 0; i < best_count; i++) s[i] = best[i];
    *count = best_count;
    return false;
}

static uint32_t farthest(const es_vec3* points, uint32_t count, const double d[3])
{
    uint32_t best = 0;
    double most = -1e300;
    for (uint32_t i = 0; i < count; i++) {
        double along = points[i].x * d[0] + points[i].y * d[1] + points[i].z * d[2];
        if (along > most) {
            most = along;
            best = i;
        }
    }
    return best;
}

void es_nearest_points(const es_vec3* a, uint32_t a_count, const es_vec3* b, uint32_t b_count, es_nearest* nearest)
{
    vertex s[4];
    uint32_t count = 1;
    s[0] = (vertex){{(double)a[0].x - b[0].x, (double)a[0].y - b[0].y, (double)a[0].z - b[0].z}, 0, 0, 1};
    double v[3] = {s[0].p[0], s[0].p[1], s[0].p[2]}, size = dot(v, v);
    *nearest = (es_nearest){0};
    for (int iteration = 0; iteration < 64; iteration++) {
        double squared = dot(v, v);
        if (squared <= 1e-14 * size) return;
        double towards[3] = {-v[0], -v[1], -v[2]};
        uint32_t ia = farthest(a, a_count, towards), ib = farthest(b, b_count, v);
        vertex w = {{(double)a[ia].x - b[ib].x, (double)a[ia].y - b[ib].y, (double)a[ia].z - b[ib].z}, (uint8_t)ia, (uint8_t)ib, 0};
        double ww = dot(w.p, w.p);
        size = ww > size ? ww : size;
        if (squared - dot(v, w.p) <= 1e-12 * squared + 1e-16 * __builtin_sqrt(squared * size)) break;
        bool known = false;
        for (uint32_t i = 0; i < count; i++) known |= s[i].a == w.a && s[i].b == w.b;
        if (known) break;
        vertex before[3];
        uint32_t before_count = count;
        for (uint32_t i = 0; i < count; i++) before[i] = s[i];
        s[count++] = w;
        if (count == 2)
            nearest_on_segment(s, &count, 0, 1);
        else if (count == 3)
            nearest_on_triangle(s, &count, 0, 1, 2);
        else if (nearest_on_tetrahedron(s, &count))
            return;
        double next[3];
        point_of(s, count, next);
        if (!(dot(next, next) < squared)) { /* no nearer: the step was lost in rounding */
            count = before_count;
            for (uint32_t i = 0; i < count; i++) s[i] = before[i];
            break;
        }
        for (int k = 0; k < 3; k++) v[k] = next[k];
    }
    double distance = __builtin_sqrt(dot(v, v)), pa[3] = {0}, pb[3] = {0};
    nearest->distance = distance;
    nearest->count = count;
    nearest->normal = es_v3((float)(-v[0] / distance), (float)(-v[1] / distance), (float)(-v[2] / distance));
    for (uint32_t i = 0; i < count; i++) {
        nearest->a[i] = s[i].a;
        nearest->b[i] = s[i].b;
        const es_vec3 *p = &a[s[i].a], *q = &b[s[i].b];
        pa[0] += s[i].weight * p->x, pa[1] += s[i].weight * p->y, pa[2] += s[i].weight * p->z;
        pb[0] += s[i].weight * q->x, pb[1] += s[i].weight * q->y, pb[2] += s[i].weight * q->z;
    }
    nearest->on_a = es_v3((float)pa[0], (float)pa[1], (float)pa[2]);
    nearest->on_b = es_v3((float)pb[0], (float)pb[1], (float)pb[2]);
}
