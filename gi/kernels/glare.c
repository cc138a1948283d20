/* Colours of a power spectrum, as pixels of a picture (gi/glare/diffraction.h).
 *
 * Eight rows of pixels together: for each wavelength the samples of a column are summed for each of the rows, transposed so that lanes are rows, and then
 * summed along these. Values: finite, not negative. */
#include "gi/glare/diffraction.h"
#include "gi/kernel_table.h"
#include "platform/simd.h"

void ES_KERNEL(es_gi_fade)(const es_fade_job* job, uint32_t row_begin, uint32_t row_end)
{
    const float radius = 0.5f * (float)job->size, scale = 1.0f / (radius * radius);
    for (uint32_t y = row_begin; y < row_end; y++) {
        float* row = job->power + y * job->stride;
        const vf down = vf_set1((float)y - radius);
        vf sum = vf_zero();
        for (uint32_t x = 0; x < job->size; x += VW) {
            const vf across = vf_from_int(vi_set1((int32_t)x) + vi_iota()) - vf_set1(radius);
            /* from a quarter of the squared radius to all of it */
            const vf t = vf_clamp((vf_set1(1.0f) - (across * across + down * down) * vf_set1(scale)) * vf_set1(4.0f / 3.0f), vf_zero(), vf_set1(1.0f));
            const vf faded = vf_load(row + x) * (t * t * (vf_set1(3.0f) - t - t));
            vf_store(row + x, faded);
            sum = sum + faded;
        }
        job->sums[y] = vf_sum(sum);
    }
}

/* Columns of the power spectrum, summed for rows first … first + 7 of the pixels: lanes are rows. */
VINL void sum_columns(const es_chromatic_job* job, const es_spectral_band* band, uint32_t first, uint32_t end, float* to)
{
    for (uint32_t x = job->column_begin; x < job->column_end; x += VW) {
        vf rows[VW];
        for (uint32_t i = 0; i < VW; i++) {
            vf sum = vf_zero();
            const uint32_t row = first + i, count = row < end ? band->count[row] : 0;
            if (count) {
                const float *weights = band->weights + (size_t)row * band->most, *from = job->power + band->first[row] * job->power_stride + x;
                for (uint32_t t = 0; t < count; t++) sum = sum + vf_load(from + t * job->power_stride) * vf_set1(weights[t]);
            }
            rows[i] = sum;
        }
        vf_transpose8(rows);
        for (uint32_t i = 0; i < VW; i++) vf_store(to + (size_t)(x + i) * VW, rows[i]);
    }
}

/* Sums along the lines, for columns of the pixels, and adds them in the channels that the wavelength has something in. */
VINL void sum_lines(const es_spectral_band* band, float scale, uint32_t first, uint32_t columns, const float* lines, float* sums, size_t plane, bool with_red, bool with_green, bool with_blue)
{
    const vf red = vf_set1(band->rgb[0] * scale), green = vf_set1(band->rgb[1] * scale), blue = vf_set1(band->rgb[2] * scale);
    for (uint32_t x = 0; x < columns; x++) {
        const uint32_t count = band->count[first + x];
        if (!count) continue;
        const float *weights = band->weights + (size_t)(first + x) * band->most, *from = lines + (size_t)band->first[first + x] * VW;
        vf sum = vf_zero();
        for (uint32_t t = 0; t < count; t++) sum = sum + vf_load(from + (size_t)t * VW) * vf_set1(weights[t]);
        float* to = sums + (size_t)x * VW;
        if (with_red) vf_store(to, vf_load(to) + sum * red);
        if (with_green) vf_store(to + plane, vf_load(to + plane) + sum * green);
        if (with_blue) vf_store(to + 2 * plane, vf_load(to + 2 * plane) + sum * blue);
    }
}

/* Rows on the other side of the middle are these, backwards; a whole row of floats is written. */
VINL void mirror(const es_chromatic_job* job, uint32_t row, uint32_t columns)
{
    const uint32_t last = 2 * job->blur->reach_y;
    if (row >= job->blur->reach_y) return;
    for (int k = 0; k < 3; k++) {
        const float* from = job->to[k] + row * job->stride;
        float* to = job->to[k] + (last - row) * job->stride;
        for (uint32_t x = 0; x < columns; x++) to[x] = from[columns - 1 - x];
        for (size_t x = columns; x < job->stride; x++) to[x] = 0.0f;
    }
}

void ES_KERNEL(es_gi_chromatic)(const es_chromatic_job* job, uint32_t begin, uint32_t end, float* scratch)
{
    const es_chromatic_blur* blur = job->blur;
    const uint32_t columns = 2 * blur->reach_x + 1, column_offset = blur->reach - blur->reach_x, row_offset = blur->reach - blur->reach_y, rows_made = job->symmetric ? blur->reach_y + 1 : 2 * blur->reach_y + 1;
    float *lines = scratch, *sums = scratch + (size_t)VW * blur->size;
    const size_t plane = VW * job->stride;
    for (uint32_t group = begin; group < end; group++) {
        for (size_t i = 0; i < 3 * plane; i += VW) vf_store(sums + i, vf_zero());
        for (uint32_t w = 0; w < blur->wavelengths; w++) {
            const es_spectral_band* band = &blur->bands[w];
            if (band->rgb[0] + band->rgb[1] + band->rgb[2] == 0.0f) continue;
            sum_columns(job, band, row_offset + group * VW, row_offset + rows_made, lines);
#define LINES(r, g, b) sum_lines(band, job->scale, column_offset, columns, lines, sums, plane, r, g, b)
            switch ((band->rgb[0] > 0) + 2 * (band->rgb[1] > 0) + 4 * (band->rgb[2] > 0)) {
            case 1: LINES(true, false, false); break;
            case 2: LINES(false, true, false); break;
            case 3: LINES(true, true, false); break;
            case 4: LINES(false, false, true); break;
            case 5: LINES(true, false, true); break;
            case 6: LINES(false, true, true); break;
            default: LINES(true, true, true); break;
            }
#undef LINES
        }
        for (int k = 0; k < 3; k++)
            for (size_t x = 0; x < job->stride; x += VW) {
                vf rows[VW];
                for (uint32_t i = 0; i < VW; i++) rows[i] = vf_load(sums + k * plane + (x + i) * VW);
                vf_transpose8(rows);
                for (uint32_t i = 0; i < VW; i++)
                    if (group * VW + i < rows_made) vf_store(job->to[k] + ((size_t)group * VW + i) * job->stride + x, rows[i]);
            }
        for (uint32_t i = 0; job->symmetric && i < VW; i++) mirror(job, group * VW + i, columns);
    }
}
