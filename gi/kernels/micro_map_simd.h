/* From directions to a micro-buffer's pixels and back, eight at a time (Ritschel thesis §6.2.3).
 *
 * Three steps. A distribution that is known in closed form takes directions to the unit disc, areas of which are probabilities:
 *   cosine  the projection to the surface's plane (Nusselt);
 *   GGX     reflection at visible normals, which on a hemisphere stretched to by alpha is uniform over a cap;
 *   Phong   azimuth about the mirror direction, and rho² = 1 - cos^(e + 1).
 * The disc is mapped to the square [-1, 1]² by Shirley and Chiu's concentric map, which keeps areas. For lobes what is left to do is tabulated, as the thesis does
 * with the whole of the slice: f cos over the density so far, which is smooth and at most 1, on a grid of ES_MICRO_GRID² cells, gives a marginal distribution
 * M over columns and a conditional one C over the rows of each, linear within cells:
 *   pixel = size · (M(u), C(v | u)).
 * Tabulating the slice itself in the thesis' (x, y) gives out where a lobe is as narrow as a cell; here the cell shrinks with the lobe, down to the model's
 * own sharpest (ES_SURFACE_MIN_ALPHA2).
 * Then all pixels are worth the same: the sum of f cos, channel by channel, over size². */
#ifndef EARTHSHINE_GI_MICRO_MAP_SIMD_H
#define EARTHSHINE_GI_MICRO_MAP_SIMD_H

#include "gi/micro/gather.h"
#include "platform/simd.h"
#include "platform/simd_maths.h"

/* Eight points, and how each sees: axes t, b, a of the mapping; a is the normal, or Phong's mirror direction. */
typedef struct lanes {
    es_micro_mapping mapping;
    vf p[3], n[3], t[3], b[3], a[3];
    vf turn_cosine, turn_sine;          /* of the disc; for the cosine t and b are turned */
    vf shift[2];                        /* of the rays from the pixels' middles, pixels */
    vf alpha, alpha2, view_x, view_z, bent_x, bent_z; /* GGX: the view in the axes, y 0; the same stretched */
    vf bound, cap;                      /* k and 1 + k v_z, below */
    vf exponent, normal_t, normal_b, normal_a;        /* Phong: the normal in the axes */
    vf f0[3], f90, total[3];            /* lobes: what the whole lobe reflects */
} lanes;

/* Disc to square, both about 0 and of half side 1; rho is the length of (a, b). */
VINL void square_of(vf a, vf b, vf rho, vf* u, vf* v)
{
    const vf x = vf_abs(a), y = vf_abs(b), q = vf_min(x, y) / vf_max(vf_max(x, y), vf_set1(1e-30f)), q2 = q * q;
    /* 4 / pi atan q, 7·10^-5 off at most */
    const vf less = rho * vf_min(q * (vf_set1(1.27224016f) + q2 * (vf_set1(-0.40894144f) + q2 * (vf_set1(0.18624514f) + q2 * vf_set1(-0.04964730f)))), vf_set1(1.0f));
    const vm wide = vm_ge(x, y);
    *u = vf_copysign(vf_select(wide, rho, less), a);
    *v = vf_copysign(vf_select(wide, less, rho), b);
}

VINL void disc_of_square(vf u, vf v, vf* a, vf* b)
{
    const vm wide = vm_ge(vf_abs(u), vf_abs(v));
    const vf rho = vf_select(wide, u, v), other = vf_select(wide, v, u), safe = vf_copysign(vf_max(vf_abs(rho), vf_set1(1e-30f)), rho);
    const vf angle = vf_set1(0.78539816f) * (other / safe), sine = vf_sin(angle), cosine = vf_cos(angle);
    *a = rho * vf_select(wide, cosine, sine);
    *b = rho * vf_select(wide, sine, cosine);
}

/* In the order of memory. |u|, |v| may be 1 and a rounding more, which the scale takes back. */
/* Pixels from their rays: the one whose ray is nearest, of a place in [-1, 1]². */
VINL vi pixel_at(const es_micro_table* table, const lanes* l, vf u, vf v, vf* off_u, vf* off_v)
{
    const float size = (float)table->size;
    const vf half = vf_set1(0.5f * size), scale = vf_set1(0.4999998f * size), x = u * scale + half - l->shift[0], y = v * scale + half - l->shift[1];
    const vf last = vf_set1(size - 1.0f), column = vf_min(vf_max(vf_floor(x), vf_zero()), last), row = vf_min(vf_max(vf_floor(y), vf_zero()), last);
    *off_u = x - column - vf_set1(0.5f);
    *off_v = y - row - vf_set1(0.5f);
    return vi_truncate(row * vf_set1((float)table->stride) + column);
}

/* The pixel whose ray is nearest, and the squared distances from it: across the rings that the map makes of circles, and along them on the disc, both over the disc's
 * radius. */
VINL vi pixel_of(const es_micro_table* table, const lanes* l, vf u, vf v, vf* across, vf* along)
{
    const float size = (float)table->size;
    vf dx, dy;
    const vi pixel = pixel_at(table, l, u, v, &dx, &dy);
    const vf x2 = dx * dx, y2 = dy * dy;
    const vm wide = vm_ge(vf_abs(u), vf_abs(v));
    *across = vf_select(wide, x2, y2) * vf_set1(4.0f / (size * size));
    *along = vf_select(wide, y2, x2) * vf_set1(4.0f * 0.61685028f / (size * size));
    return pixel;
}

/* ---- lobes: between directions in the axes and the disc ---------------------------------------------------------------------------- */

/* Stretched to a hemisphere, the normal h turns the view v to c, and visible normals are those with which c is uniform over the cap z > -v_z (Dupuy and Benyoub
 * 2023). Of it the part z > -k v_z is all that is reflected above the surface, and little else (Eto and Tokuyoshi 2023):
 *     rho² = (1 - z) / (1 + k v_z), in c's azimuth; the density is D / (2 (k NV + √(NV² (1 - alpha²) + alpha²))). */
VINL void ggx_to_disc(const lanes* l, vf x, vf y, vf z, vf* a, vf* b)
{
    const vf one = vf_set1(1.0f), inverse = one / l->alpha, tiny = vf_set1(1e-30f);
    vf hx = (x + l->view_x) * inverse, hy = y * inverse, hz = z + l->view_z;
    const vf square = vf_max(hx * hx + hy * hy + hz * hz, tiny), twice = (vf_set1(2.0f) * (hx * l->bent_x + hz * l->bent_z)) / square;
    const vf cz = twice * hz - l->bent_z, scale = one / vf_sqrt(vf_max((one + cz) * l->cap, tiny));
    *a = (twice * hx - l->bent_x) * scale;
    *b = twice * hy * scale;
}

VINL void ggx_from_disc(const lanes* l, vf a, vf b, vf* x, vf* y, vf* z)
{
    const vf one = vf_set1(1.0f), cz = one - (a * a + b * b) * l->cap, scale = vf_sqrt(vf_max((one + cz) * l->cap, vf_zero()));
    vf hx = l->alpha * (a * scale + l->bent_x), hy = l->alpha * (b * scale), hz = vf_max(cz + l->bent_z, vf_set1(1e-6f));
    const vf inverse = one / vf_sqrt(vf_max(hx * hx + hy * hy + hz * hz, vf_set1(1e-30f)));
    hx = hx * inverse;
    hy = hy * inverse;
    hz = hz * inverse;
    const vf twice = vf_set1(2.0f) * (l->view_x * hx + l->view_z * hz);
    *x = twice * hx - l->view_x;
    *y = twice * hy;
    *z = twice * hz - l->view_z;
}

VINL void phong_to_disc(const lanes* l, vf x, vf y, vf z, vf* a, vf* b)
{
    const vf one = vf_set1(1.0f), cosine = vf_min(vf_max(z, vf_set1(1e-6f)), one);
    const vf rho = vf_sqrt(vf_max(one - vf_pow(cosine, l->exponent + one), vf_zero())), scale = rho / vf_sqrt(vf_max(x * x + y * y, vf_set1(1e-30f)));
    *a = x * scale;
    *b = y * scale;
}

VINL void phong_from_disc(const lanes* l, vf a, vf b, vf* x, vf* y, vf* z)
{
    const vf one = vf_set1(1.0f), square = a * a + b * b;
    const vf cosine = vf_min(vf_pow(vf_max(one - square, vf_set1(1e-30f)), one / (l->exponent + one)), one);
    const vf scale = vf_sqrt(vf_max((one - cosine) * (one + cosine), vf_zero())) / vf_sqrt(vf_max(square, vf_set1(1e-30f)));
    *x = a * scale;
    *y = b * scale;
    *z = cosine;
}

VINL void lobe_to_disc(const lanes* l, vf x, vf y, vf z, vf* a, vf* b)
{
    vf c, d;
    if (l->mapping == ES_MICRO_GGX) ggx_to_disc(l, x, y, z, &c, &d);
    else phong_to_disc(l, x, y, z, &c, &d);
    *a = l->turn_cosine * c - l->turn_sine * d;
    *b = l->turn_sine * c + l->turn_cosine * d;
}

VINL void lobe_from_disc(const lanes* l, vf a, vf b, vf* x, vf* y, vf* z)
{
    const vf c = l->turn_cosine * a + l->turn_sine * b, d = l->turn_cosine * b - l->turn_sine * a;
    if (l->mapping == ES_MICRO_GGX) ggx_from_disc(l, c, d, x, y, z);
    else phong_from_disc(l, c, d, x, y, z);
}

/* pi times the largest density, per steradian, that lanes' lobes have towards a sphere in direction (x, y, z) of the axes, by the bound of micro_cut_simd.h. */
VINL vf lane_bound(const lanes* l, vf x, vf z, vf sphere_sine)
{
    const vf one = vf_set1(1.0f), zero = vf_zero(), c = vf_sqrt(vf_max(one - sphere_sine * sphere_sine, zero));
    const vf cosine = l->mapping == ES_MICRO_GGX ? vf_min(z * l->view_z - x * l->view_x, one) : z, sine = vf_sqrt(vf_max(one - cosine * cosine, zero));
    const vf nearest = vf_select(vm_ge(cosine, c), one, vf_min(cosine * c + sine * sphere_sine, one));
    if (l->mapping == ES_MICRO_PHONG) return vf_set1(0.5f) * (l->exponent + one) * vf_pow(vf_max(nearest, vf_set1(1e-6f)), l->exponent);
    const vf rest = one - l->alpha2, d = one - (vf_set1(0.5f) + vf_set1(0.5f) * nearest) * rest;
    return vf_set1(0.5f) * l->alpha2 / ((l->view_z + vf_sqrt(l->alpha2 + rest * l->view_z * l->view_z)) * d * d);
}

/* ---- lobes: what is left, tabulated ------------------------------------------------------------------------------------------------- */

/* f cos over the density, of F0 = 1, and the share of F90 in Fresnel's part. */
VINL void lobe_weight(const lanes* l, vf x, vf y, vf z, vf* weight, vf* rise)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    if (l->mapping == ES_MICRO_PHONG) {
        *weight = vf_max(l->normal_t * x + l->normal_b * y + l->normal_a * z, zero) * ((l->exponent + vf_set1(2.0f)) / (l->exponent + one));
        *rise = zero;
        return;
    }
    const vf nl = vf_max(z, zero), nv = l->view_z, rest = one - l->alpha2;
    const vf light = vf_sqrt(nl * nl * rest + l->alpha2), view = vf_sqrt(nv * nv * rest + l->alpha2);
    *weight = nl * (l->bound * nv + view) / (nl * view + nv * light);
    const vf hx = x + l->view_x, hz = z + l->view_z, half = vf_set1(0.5f) * vf_sqrt(vf_max(hx * hx + y * y + hz * hz, zero));
    const vf m = vf_max(one - half, zero), m2 = m * m;
    *rise = m2 * m2 * m;
}

static void tabulate_lobe(const es_micro_table* table, lanes* l, es_micro_scratch* s)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), cells = vf_set1(1.0f / (ES_MICRO_GRID * ES_MICRO_GRID)), largest = vf_max(l->f0[0], vf_max(l->f0[1], l->f0[2]));
    vf plain = zero, risen = zero, sum = zero;
    for (uint32_t i = 0; i < ES_MICRO_GRID; i++) {
        vf column = zero;
        vf_store(s->marginal[i], sum);
        vf_store(s->conditional[i][0], zero);
        for (uint32_t j = 0; j < ES_MICRO_GRID; j++) {
            const uint32_t at = i * ES_MICRO_GRID + j, count = table->grid[at].count;
            const vf part = vf_set1(1.0f / (float)count);
            for (uint32_t k = 0; k < count; k++) {
                vf x, y, z, weight, rise;
                lobe_from_disc(l, vf_set1(table->grid[at].x[k]), vf_set1(table->grid[at].y[k]), &x, &y, &z);
                lobe_weight(l, x, y, z, &weight, &rise);
                weight = weight * part;
                plain = plain + weight * (one - rise);
                risen = risen + weight * rise;
                column = column + weight * (largest + (l->f90 - largest) * rise);
            }
            vf_store(s->conditional[i][j + 1], column);
        }
        const vf scale = one / vf_max(column, vf_set1(1e-30f));
        for (uint32_t j = 1; j <= ES_MICRO_GRID; j++) vf_store(s->conditional[i][j], vf_load(s->conditional[i][j]) * scale);
        sum = sum + column;
    }
    const vf scale = one / vf_max(sum, vf_set1(1e-30f));
    vf_store(s->marginal[ES_MICRO_GRID], sum);
    for (uint32_t i = 1; i <= ES_MICRO_GRID; i++) vf_store(s->marginal[i], vf_load(s->marginal[i]) * scale);
    for (int k = 0; k < 3; k++) l->total[k] = (l->f0[k] * plain + l->f90 * risen) * cells;
}

/* A running sum at a place in [-1, 1], linear between its entries, which lie `step` floats apart. */
VINL vf table_at(const float* sums, vi offset, int32_t step, vf place, vi* cell)
{
    const vf scaled = (place + vf_set1(1.0f)) * vf_set1(0.5f * ES_MICRO_GRID);
    const vi i = vi_min(vi_max(vi_truncate(scaled), vi_zero()), vi_set1(ES_MICRO_GRID - 1)), at = offset + i * vi_set1(step);
    const vf low = vf_gather(sums, at), high = vf_gather(sums, at + vi_set1(step));
    *cell = i;
    return low + (high - low) * vf_min(scaled - vf_from_int(i), vf_set1(1.0f));
}

VINL vi lobe_pixel(const es_micro_table* table, const lanes* l, const es_micro_scratch* s, vf x, vf y, vf z)
{
    vf a, b, u, v;
    lobe_to_disc(l, x, y, z, &a, &b);
    square_of(a, b, vf_min(vf_sqrt(a * a + b * b), vf_set1(1.0f)), &u, &v);
    vi column, row;
    const vf across = table_at(&s->marginal[0][0], vi_iota(), VW, u, &column);
    const vf along = table_at(&s->conditional[0][0][0], column * vi_set1((ES_MICRO_GRID + 1) * VW) + vi_iota(), VW, v, &row);
    const vf two = vf_set1(2.0f), one = vf_set1(1.0f);
    vf off_u, off_v;
    return pixel_at(table, l, vf_min(across * two - one, one), vf_min(along * two - one, one), &off_u, &off_v);
}

/* The place in [-1, 1] of a running sum's share; *cell is where it is, or before. */
VINL float table_place(const float* sums, float share, uint32_t* cell)
{
    uint32_t i = *cell;
    while (i + 1 < ES_MICRO_GRID && sums[(i + 1) * VW] <= share) i++;
    *cell = i;
    const float low = sums[i * VW], high = sums[(i + 1) * VW];
    return ((float)i + (high > low ? es_clampf((share - low) / (high - low), 0.0f, 1.0f) : 0.5f)) * (2.0f / ES_MICRO_GRID) - 1.0f;
}

static lanes lane_alone(const lanes* l, uint32_t lane)
{
    lanes one = *l;
    vf* const fields[] = {&one.turn_cosine, &one.turn_sine, &one.alpha, &one.alpha2, &one.view_x, &one.view_z, &one.bent_x, &one.bent_z, &one.bound, &one.cap, &one.exponent, &one.normal_t, &one.normal_b, &one.normal_a};
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++) *fields[i] = vf_set1((*fields[i])[lane]);
    return one;
}

/* Of one lane. What a cell at the horizon sends below it is bent up to it. */
static void find_lobe_rays(const es_micro_table* table, const lanes* l, uint32_t lane, es_micro_scratch* s)
{
    const lanes alone = lane_alone(l, lane);
    es_micro_lobe_rays* rays = &s->lobes[lane];
    const uint32_t size = table->size;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const float share = 1.0f / (float)size;
    for (uint32_t column = 0, across = 0; column < size; column++) {
        const float u = table_place(&s->marginal[0][lane], ((float)column + 0.5f + l->shift[0][lane]) * share, &across);
        const uint32_t cell = (uint32_t)es_clampf((u + 1.0f) * (0.5f * ES_MICRO_GRID), 0.0f, ES_MICRO_GRID - 1);
        for (uint32_t row = 0, along = 0; row < size; row++) {
            rays->at[0][row * table->stride + column] = u;
            rays->at[1][row * table->stride + column] = table_place(&s->conditional[cell][0][lane], ((float)row + 0.5f + l->shift[1][lane]) * share, &along);
        }
        for (uint32_t pad = size; column + 1 == size && pad < table->stride; pad++)
            for (uint32_t row = 0; row < size; row++) rays->at[0][row * table->stride + pad] = u, rays->at[1][row * table->stride + pad] = rays->at[1][row * table->stride + column];
    }
    for (uint32_t at = 0; at < table->stride * size; at += VW) {
        vf a, b, x, y, z;
        disc_of_square(vf_load(rays->at[0] + at), vf_load(rays->at[1] + at), &a, &b);
        lobe_from_disc(&alone, a, b, &x, &y, &z);
        const vf height = alone.normal_t * x + alone.normal_b * y + alone.normal_a * z, lift = vf_max(vf_set1(2e-3f) - height, zero);
        x = x + lift * alone.normal_t;
        y = y + lift * alone.normal_b;
        z = z + lift * alone.normal_a;
        const vf scale = one / vf_sqrt(vf_max(x * x + y * y + z * z, vf_set1(1e-30f)));
        x = x * scale;
        y = y * scale;
        z = z * scale;
        vf_store(rays->at[0] + at, x);
        vf_store(rays->at[1] + at, y);
        vf_store(rays->at[2] + at, z);
        const float mx = vf_sum(x), my = vf_sum(y), mz = vf_sum(z), inverse = 1.0f / es_sqrt(es_maxf(mx * mx + my * my + mz * mz, 1e-30f));
        const vf cosines = x * vf_set1(mx * inverse) + y * vf_set1(my * inverse) + z * vf_set1(mz * inverse);
        float least = cosines[0];
        for (int i = 1; i < VW; i++) least = es_minf(least, cosines[i]);
        rays->axis[0][at / VW] = mx * inverse;
        rays->axis[1][at / VW] = my * inverse;
        rays->axis[2][at / VW] = mz * inverse;
        rays->cosine[at / VW] = es_minf(least - 1e-6f, 1.0f);
    }
    for (uint32_t at = table->stride * size / VW; at % VW; at++) rays->cosine[at] = rays->axis[0][at] = rays->axis[1][at] = rays->axis[2][at] = 0.0f; /* cones are read eight at a time */
}

#endif
