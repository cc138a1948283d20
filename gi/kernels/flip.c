/* ꟻLIP of one tile of a picture (Andersson et al. 2020, sections 4.1 and 4.2).
 *
 * Values: linear Rec.709 in [0, 1] after the tone map; YCxCz within [-16, 100], ±500 and ±200; errors in [0, 1]. The filters are sums of
 * products of one-dimensional ones (ibid., separated by the authors in 2022): first along rows, then down columns, with pairs of samples
 * at equal distance added or subtracted first. The weights of the point filter add up to 0, so it is applied to differences from the
 * middle: where nothing changes it is exactly 0, and the root taken of it does not magnify rounding errors. Equal pictures take the same
 * steps, so their error is exactly 0.
 */
#include "gi/error/flip.h"
#include "gi/kernel_table.h"
#include "platform/simd_maths.h"

typedef struct three { vf x, y, z; } three;

enum { LIGHT, RED_GREEN, BLUE_YELLOW, BLUE_YELLOW_2, EDGE, POINT, GAUSS }; /* filtered along rows */

/* D65; sums of the rows of the matrix, and their inverses */
static const float white_x = 0.950428545f, white_z = 1.088900371f, inverse_x = 1.052156925f, inverse_z = 0.918357670f;

static inline three xyz_by_white(three c)
{
    three r;
    r.x = (vf_set1(10135552.0f / 24577794.0f) * c.x + vf_set1(8788810.0f / 24577794.0f) * c.y + vf_set1(4435075.0f / 24577794.0f) * c.z) * vf_set1(inverse_x);
    r.y = vf_set1(2613072.0f / 12288897.0f) * c.x + vf_set1(8788810.0f / 12288897.0f) * c.y + vf_set1(887015.0f / 12288897.0f) * c.z;
    r.z = (vf_set1(1425312.0f / 73733382.0f) * c.x + vf_set1(8788810.0f / 73733382.0f) * c.y + vf_set1(70074185.0f / 73733382.0f) * c.z) * vf_set1(inverse_z);
    return r;
}

static inline vf unit(vf a) { return vf_min(vf_max(a, vf_zero()), vf_set1(1.0f)); }

/* Radiance, not negative, to the display. Above 1e4 the curves have long been at 1, and squares stay finite; what the scale would take
 * out of the range of floats is cut off before. */
static inline three shown(const es_flip_job* job, three c, float scale)
{
    const vf s = vf_set1(scale), high = vf_set1(1e4f), most = vf_set1(scale > 1.0f ? 2e4f / scale : 3e38f), one = vf_set1(1.0f);
    c = (three){vf_min(c.x, most), vf_min(c.y, most), vf_min(c.z, most)};
    if (job->tone == ES_FLIP_LINEAR) return (three){unit(c.x * s), unit(c.y * s), unit(c.z * s)};
    c = (three){vf_min(c.x * s, high), vf_min(c.y * s, high), vf_min(c.z * s, high)};
    if (job->tone == ES_FLIP_REINHARD) {
        vf l = vf_set1(0.2126f) * c.x + vf_set1(0.7152f) * c.y + vf_set1(0.0722f) * c.z;
        vf factor = (one + l * vf_set1(1.0f / (job->white * job->white))) / (one + l);
        return (three){unit(c.x * factor), unit(c.y * factor), unit(c.z * factor)};
    }
    /* the fit of ACES by Narkowicz (2016), its exposure of 0.6 taken back */
    vf* channel[3] = {&c.x, &c.y, &c.z};
    for (int k = 0; k < 3; k++) {
        vf x = *channel[k];
        *channel[k] = unit((x * x * vf_set1(0.36f * 2.51f) + x * vf_set1(0.6f * 0.03f)) / (x * x * vf_set1(0.36f * 2.43f) + x * vf_set1(0.6f * 0.59f) + vf_set1(0.14f)));
    }
    return c;
}

/* One row of the tile and its border to YCxCz. */
static void convert_row(const es_flip_job* job, const es_flip_scratch* s, uint32_t picture, uint32_t row, uint32_t columns, float scale)
{
    const size_t at = (size_t)row * s->stride;
    for (uint32_t x = 0; x < columns; x += VW) {
        three c = {vf_load(s->rgb[picture][0] + at + x), vf_load(s->rgb[picture][1] + at + x), vf_load(s->rgb[picture][2] + at + x)};
        c = xyz_by_white(shown(job, c, scale));
        vf_store(s->row[0] + x, vf_set1(116.0f) * c.y - vf_set1(16.0f));
        vf_store(s->row[1] + x, vf_set1(500.0f) * (c.x - c.y));
        vf_store(s->row[2] + x, vf_set1(200.0f) * (c.y - c.z));
    }
}

static void filter_along_row(const es_flip_filters* f, const es_flip_scratch* s, uint32_t picture, uint32_t row, uint32_t columns)
{
    const int radius = (int)f->radius;
    for (uint32_t x = 0; x < columns; x += VW) {
        const float *light = s->row[0] + x + radius, *rg = s->row[1] + x + radius, *by = s->row[2] + x + radius;
        vf l = vf_load(light), c = vf_load(rg), z = vf_load(by), sum[7];
        sum[LIGHT] = l * vf_set1(f->achromatic[0]);
        sum[RED_GREEN] = c * vf_set1(f->red_green[0]);
        sum[BLUE_YELLOW] = z * vf_set1(f->blue_yellow[0][0]);
        sum[BLUE_YELLOW_2] = z * vf_set1(f->blue_yellow[1][0]);
        sum[EDGE] = sum[POINT] = vf_zero();
        sum[GAUSS] = l * vf_set1(f->gauss[0]);
        const vf twice = l + l;
        for (int k = 1; k <= radius; k++) {
            vf left = vf_load(light - k), right = vf_load(light + k);
            l = left + right;
            c = vf_load(rg - k) + vf_load(rg + k);
            z = vf_load(by - k) + vf_load(by + k);
            sum[LIGHT] += l * vf_set1(f->achromatic[k]);
            sum[RED_GREEN] += c * vf_set1(f->red_green[k]);
            sum[BLUE_YELLOW] += z * vf_set1(f->blue_yellow[0][k]);
            sum[BLUE_YELLOW_2] += z * vf_set1(f->blue_yellow[1][k]);
            sum[EDGE] += (left - right) * vf_set1(f->edge[k]);
            sum[POINT] += (l - twice) * vf_set1(f->point[k]);
            sum[GAUSS] += l * vf_set1(f->gauss[k]);
        }
        for (int k = 0; k < 7; k++) vf_store(s->filtered[picture][k] + (size_t)row * ES_FLIP_TILE + x, sum[k]);
    }
}

typedef struct percept { three lab; vf edge, point; } percept;

static inline vf lab_curve(vf t)
{
    const float low = 216.0f / 24389.0f; /* (6/29)^3 */
    return vf_select(vm_gt(t, vf_set1(low)), vf_pow(t, vf_set1(1.0f / 3.0f)), t * vf_set1(841.0f / 108.0f) + vf_set1(4.0f / 29.0f));
}

/* What the eye resolves, to the display's range and to L*a*b*, chroma scaled by lightness (Hunt 1952). */
static inline three hunt_lab(vf light, vf rg, vf by)
{
    vf y = (light + vf_set1(16.0f)) * vf_set1(1.0f / 116.0f);
    vf x = (y + rg * vf_set1(1.0f / 500.0f)) * vf_set1(white_x), z = (y - by * vf_set1(1.0f / 200.0f)) * vf_set1(white_z);
    three rgb = {unit(vf_set1(3.241003275f) * x - vf_set1(1.537398934f) * y - vf_set1(0.498615861f) * z),
        unit(vf_set1(1.875930071f) * y - vf_set1(0.969224334f) * x + vf_set1(0.041554224f) * z),
        unit(vf_set1(0.055639423f) * x - vf_set1(0.204011202f) * y + vf_set1(1.057148933f) * z)};
    three t = xyz_by_white(rgb);
    t = (three){lab_curve(t.x), lab_curve(t.y), lab_curve(t.z)};
    vf lightness = vf_set1(116.0f) * t.y - vf_set1(16.0f);
    return (three){lightness, vf_set1(5.0f) * lightness * (t.x - t.y), vf_set1(2.0f) * lightness * (t.y - t.z)};
}

/* `row`, `x`: in the tile. */
static inline percept filter_down_column(const es_flip_filters* f, const es_flip_scratch* s, uint32_t picture, uint32_t row, uint32_t x)
{
    const int radius = (int)f->radius;
    const float* from[7];
    vf sum[7], edge_down = vf_zero(), point_down = vf_zero();
    for (int i = 0; i < 7; i++) {
        from[i] = s->filtered[picture][i] + (size_t)(row + f->radius) * ES_FLIP_TILE + x;
        sum[i] = vf_load(from[i]);
    }
    const vf twice = sum[GAUSS] + sum[GAUSS];
    sum[LIGHT] *= vf_set1(f->achromatic[0]);
    sum[RED_GREEN] *= vf_set1(f->red_green[0]);
    sum[BLUE_YELLOW] *= vf_set1(f->blue_yellow[0][0]);
    sum[BLUE_YELLOW_2] *= vf_set1(f->blue_yellow[1][0]);
    sum[EDGE] *= vf_set1(f->gauss[0]);
    sum[POINT] *= vf_set1(f->gauss[0]);
    for (int k = 1; k <= radius; k++) {
        const size_t step = (size_t)k * ES_FLIP_TILE;
        vf gauss = vf_set1(f->gauss[k]), above = vf_load(from[GAUSS] - step), below = vf_load(from[GAUSS] + step);
        sum[LIGHT] += (vf_load(from[LIGHT] - step) + vf_load(from[LIGHT] + step)) * vf_set1(f->achromatic[k]);
        sum[RED_GREEN] += (vf_load(from[RED_GREEN] - step) + vf_load(from[RED_GREEN] + step)) * vf_set1(f->red_green[k]);
        sum[BLUE_YELLOW] += (vf_load(from[BLUE_YELLOW] - step) + vf_load(from[BLUE_YELLOW] + step)) * vf_set1(f->blue_yellow[0][k]);
        sum[BLUE_YELLOW_2] += (vf_load(from[BLUE_YELLOW_2] - step) + vf_load(from[BLUE_YELLOW_2] + step)) * vf_set1(f->blue_yellow[1][k]);
        sum[EDGE] += (vf_load(from[EDGE] - step) + vf_load(from[EDGE] + step)) * gauss;
        sum[POINT] += (vf_load(from[POINT] - step) + vf_load(from[POINT] + step)) * gauss;
        edge_down += (above - below) * vf_set1(f->edge[k]);
        point_down += (above + below - twice) * vf_set1(f->point[k]);
    }
    percept p;
    p.lab = hunt_lab(sum[LIGHT], sum[RED_GREEN], sum[BLUE_YELLOW] + sum[BLUE_YELLOW_2]);
    /* Features are of Y in [0, 1], which is (Y + 16) / 116 here; the filters take no notice of the 16. */
    const vf share = vf_set1(1.0f / 116.0f);
    p.edge = vf_sqrt(sum[EDGE] * sum[EDGE] + edge_down * edge_down) * share;
    p.point = vf_sqrt(sum[POINT] * sum[POINT] + point_down * point_down) * share;
    return p;
}

static inline vf error_between(percept a, percept b)
{
    /* the distance of green and blue, the largest of two colours in the display's range, to the power of 0.7 */
    const float largest = 41.2760984f, knee = 0.4f * 41.2760984f;
    vf da = a.lab.y - b.lab.y, db = a.lab.z - b.lab.z;
    vf colour = vf_pow(vf_abs(a.lab.x - b.lab.x) + vf_sqrt(da * da + db * db), vf_set1(0.7f));
    colour = vf_select(vm_lt(colour, vf_set1(knee)), colour * vf_set1(0.95f / knee),
        vf_set1(0.95f) + (colour - vf_set1(knee)) * vf_set1(0.05f / (largest - knee)));
    vf feature = vf_max(vf_abs(a.edge - b.edge), vf_abs(a.point - b.point));
    feature = unit(vf_sqrt(feature * vf_set1(0.707106781f)));
    return unit(vf_pow(colour, vf_set1(1.0f) - feature));
}

void ES_KERNEL(es_gi_flip)(const es_flip_job* job, uint32_t x, uint32_t y, const es_flip_scratch* scratch)
{
    const es_flip_filters* f = job->filters;
    uint32_t columns = job->width - x < ES_FLIP_TILE ? job->width - x : ES_FLIP_TILE, rows = job->height - y < ES_FLIP_TILE ? job->height - y : ES_FLIP_TILE;
    for (uint32_t i = 0; i < job->scale_count; i++) {
        for (uint32_t picture = 0; picture < 2; picture++)
            for (uint32_t row = 0; row < rows + 2 * f->radius; row++) {
                convert_row(job, scratch, picture, row, (columns + VW - 1) / VW * VW + 2 * f->radius, job->scales[i]);
                filter_along_row(f, scratch, picture, row, columns);
            }
        for (uint32_t row = 0; row < rows; row++)
            for (uint32_t column = 0; column < columns; column += VW) {
                vf error = error_between(filter_down_column(f, scratch, 0, row, column), filter_down_column(f, scratch, 1, row, column));
                float* out = job->errors + (size_t)(y + row) * job->width + x + column;
                float lanes[VW];
                vf_store(lanes, error);
                for (uint32_t k = 0; k < VW && column + k < columns; k++) out[k] = i && out[k] > lanes[k] ? out[k] : lanes[k];
            }
    }
}
