/* Along a meridian the octahedral place moves straight from the middle of the square to the edge of the diamond, and from there straight
 * to the square's corner. Where it crosses from texel to texel is a division and a root; the solid angle between two crossings is the meridian's share of
 * azimuth times the difference of the sines of elevation, and image rows end at sines of elevation as well. So along a meridian all overlaps are exact, and
 * those of all texels add up to the meridian's whole. */
#include "gi/octahedral.h"

#include "platform/maths.h"

es_vec3 es_octahedral_direction(uint32_t x, uint32_t y, uint32_t size)
{
    const float texel = 1.0f / (float)size;
    float a = 2.0f * ((float)x + 0.5f) * texel - 1.0f, b = 2.0f * ((float)y + 0.5f) * texel - 1.0f;
    const float up = 1.0f - es_absf(a) - es_absf(b), fold = es_maxf(-up, 0.0f);
    a -= a < 0.0f ? -fold : fold;
    b -= b < 0.0f ? -fold : fold;
    const float scale = 1.0f / es_sqrt(a * a + b * b + up * up);
    return es_v3(a * scale, up * scale, b * scale);
}

static double root(double x) { return __builtin_sqrt(x); }

/* Of what fits 64 bits. */
static double whole_below(double x)
{
    const double whole = (double)(int64_t)x;
    return whole > x ? whole - 1.0 : whole;
}

typedef struct meridian {
    const es_octahedral_job* job;
    double azimuth;             /* that it stands for, radians */
    double a, b;                /* |x| and |z| of its horizontal direction */
    bool left, back;            /* x < 0, z < 0 */
    const float* column;        /* of the image */
    size_t row_floats;
    uint32_t row;               /* of the image, at y */
    double y;                   /* the sine of elevation it has come to */
} meridian;

/* On to the sine of elevation `y`, in the texel (i, j), counted from the middle. */
static void go(meridian* m, uint32_t i, uint32_t j, double y)
{
    const es_octahedral_job* job = m->job;
    const uint32_t half = job->size / 2, x = m->left ? half - 1 - i : half + i, z = m->back ? half - 1 - j : half + j;
    float* texel = job->texels + 4 * ((size_t)(z + 1) * (job->size + 2) + x + 1);
    const float* factor = job->environment->radiance;
    while (m->y > y) {
        const double row_end = job->rows[m->row + 1], next = row_end > y ? row_end : y;
        const float part = (float)((m->y - next) * m->azimuth);
        const float* source = m->column + m->row * m->row_floats;
        for (int k = 0; k < 3; k++) texel[k] += source[k] * factor[k] * part;
        texel[3] += part;
        m->y = next;
        if (row_end >= y && m->row + 1 < job->environment->image->height) m->row++;
    }
}

static void follow(meridian* m)
{
    const uint32_t half = m->job->size / 2;
    const double step = 1.0 / half, end = 1.0 / (m->a + m->b);
    uint32_t i = 0, j = 0;
    /* up to r = end the place is r (a, b); tan of the angle from the pole = r / (1 - r (a + b)) */
    for (;;) {
        const double to_i = (i + 1) * step / m->a, to_j = (j + 1) * step / m->b, r = to_i < to_j ? to_i : to_j;
        if (!(r < end)) break;
        const double up = 1.0 - r * (m->a + m->b);
        go(m, i, j, up / root(up * up + r * r));
        if (to_i < to_j) i++;
        else j++;
    }
    /* and then (1 - r b, 1 - r a), r back to 0 */
    while (i + 1 < half || j + 1 < half) {
        const double to_i = (1.0 - (i + 1) * step) / m->b, to_j = (1.0 - (j + 1) * step) / m->a, r = to_i > to_j ? to_i : to_j;
        if (!(r > 0.0)) break;
        const double up = 1.0 - r * (m->a + m->b);
        go(m, i, j, -up / root(up * up + r * r));
        if (to_i > to_j) i++;
        else j++;
    }
    go(m, i, j, -1.0);
}

void es_octahedral_quarter(const es_octahedral_job* job, uint32_t quarter)
{
    const es_image* image = job->environment->image;
    const double width = image->width, turns = (double)job->environment->rotation * (0.5 / 3.14159265358979323846);
    /* in columns of the image: where the quarter begins, brought into its first turn */
    double first = 0.25 * quarter + 0.5 + turns;
    first = (first - whole_below(first)) * width;
    const double end = first + 0.25 * width;
    for (double at = first; at < end;) {
        double column = whole_below(at), next = column + 1.0 < end ? column + 1.0 : end;
        const uint32_t x = (uint32_t)column % image->width;
        uint32_t parts = (uint32_t)(4.0 * job->size * (next - at) / width) + 1;
        for (uint32_t k = 0; k < parts; k++) {
            const double place = at + (next - at) * (k + 0.5) / parts, turn = 0.25 * quarter + (place - first) / width;
            float sine, cosine;
            es_sincos((float)(2.0 * 3.14159265358979323846 * turn), &sine, &cosine);
            meridian m = {.job = job, .azimuth = 2.0 * 3.14159265358979323846 * (next - at) / (width * parts), .left = quarter >= 2, .back = quarter == 0 || quarter == 3,
                .column = image->pixels + (size_t)x * image->channels, .row_floats = (size_t)image->width * image->channels, .y = 1.0};
            m.a = (double)es_maxf(es_absf(sine), 1e-9f);
            m.b = (double)es_maxf(es_absf(cosine), 1e-9f);
            follow(&m);
        }
        at = next;
    }
}
