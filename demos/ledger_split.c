#include "ledger_split.h"

#include <math.h>
#include <string.h>

static double factorial(uint32_t n) { return n < 2 ? 1 : n * factorial(n - 1); }

static uint32_t bits_of(uint32_t set) { return set ? (set & 1) + bits_of(set >> 1) : 0; }

void ledger_average_orders(const ledger_picture* pictures, uint32_t causes, size_t floats, float* (*parts)[2])
{
    const uint32_t sets = 1u << causes;
    for (uint32_t i = 0; i < causes; i++) {
        double weights[1 << LEDGER_MAX_CAUSES];
        for (uint32_t s = 0; s < sets; s++) {
            /* of the orders in which i comes right after the causes of s, in any order, and before the others */
            uint32_t before = bits_of(s & ~(1u << i));
            double weight = factorial(before) * factorial(causes - before - 1) / factorial(causes);
            weights[s] = s >> i & 1 ? -weight : weight;
        }
        for (int h = 0; h < 2; h++)
            for (size_t k = 0; k < floats; k++) {
                double sum = 0;
                for (uint32_t s = 0; s < sets; s++) sum += weights[s] * (double)pictures[s].half[h][k];
                parts[i][h][k] = (float)sum;
            }
    }
}

void ledger_add(ledger_sums* sums, const ledger_picture* method, const ledger_picture* reference, const ledger_picture* d, const ledger_picture* lost, size_t part_count, const float* weights,
    size_t floats)
{
    sums->part_count = part_count + 1;
    for (size_t i = 0; i < part_count; i++) sums->parts[i].switched |= lost[i].half[0] != NULL;
    for (size_t k = 0; k < floats; k++) {
        const double weight = weights ? (double)weights[k] : 1;
        double total[2], rest[2];
        for (int h = 0; h < 2; h++) rest[h] = total[h] = (double)method->half[h][k] - (double)reference->half[h][k];
        double noise = ((double)reference->half[0][k] - (double)reference->half[1][k]) / 2;
        sums->total += weight * total[0] * total[1];
        sums->noise += weight * noise * noise;
        sums->reference += ((double)reference->half[0][k] + (double)reference->half[1][k]) / 2;
        for (size_t i = 0; i <= part_count; i++) {
            ledger_part_sums* part = &sums->parts[i];
            double values[2];
            for (int h = 0; h < 2; h++) {
                values[h] = i < part_count ? (double)d[i].half[h][k] : rest[h];
                rest[h] -= values[h];
            }
            part->share[0] += weight * values[0] * total[1];
            part->share[1] += weight * values[1] * total[0];
            part->own += weight * values[0] * values[1];
            if (i < part_count && lost[i].half[0]) part->alone += weight * (total[0] - (double)lost[i].half[0][k]) * (total[1] - (double)lost[i].half[1][k]);
        }
    }
    sums->values += (double)floats;
}

void ledger_relative_weights(const ledger_picture* reference, uint32_t width, uint32_t height, uint32_t channels, float* weights)
{
    enum { REACH = 2 };
    const size_t floats = (size_t)width * height * channels;
    double mean = 0;
    for (size_t k = 0; k < floats; k++) mean += ((double)reference->half[0][k] + (double)reference->half[1][k]) / 2;
    mean /= (double)floats;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            for (uint32_t c = 0; c < channels; c++) {
                double sum = 0;
                int count = 0;
                for (uint32_t v = y > REACH ? y - REACH : 0; v <= y + REACH && v < height; v++)
                    for (uint32_t u = x > REACH ? x - REACH : 0; u <= x + REACH && u < width; u++, count++) {
                        size_t k = ((size_t)v * width + u) * channels + c;
                        sum += ((double)reference->half[0][k] + (double)reference->half[1][k]) / 2;
                    }
                double bright = sum / count;
                weights[((size_t)y * width + x) * channels + c] = mean > 0 ? (float)(mean * mean / (bright * bright + 0.1 * mean * mean)) : 1.0f;
            }
}

/* As a share of the reference's mean. */
static double size_of(const ledger_sums* sums, double square) { return sqrt(fmax(square, 0) / sums->values) / (sums->reference / sums->values); }

double ledger_total(const ledger_sums* sums) { return size_of(sums, sums->total); }
double ledger_noise(const ledger_sums* sums) { return size_of(sums, sums->noise); }
double ledger_share(const ledger_sums* sums, size_t part) { return 50 * (sums->parts[part].share[0] + sums->parts[part].share[1]) / sums->total; }
double ledger_share_noise(const ledger_sums* sums, size_t part) { return 50 * fabs(sums->parts[part].share[0] - sums->parts[part].share[1]) / sums->total; }
double ledger_own(const ledger_sums* sums, size_t part) { return size_of(sums, sums->parts[part].own); }
double ledger_gain(const ledger_sums* sums, size_t part) { return sums->parts[part].switched ? 100 * (sums->total - sums->parts[part].alone) / sums->total : NAN; }

double ledger_gains_missing(const ledger_sums* sums)
{
    double missing = 100;
    for (size_t i = 0; i < sums->part_count; i++)
        if (sums->parts[i].switched) missing -= ledger_gain(sums, i);
    return missing;
}

size_t ledger_costliest(const ledger_sums* sums)
{
    size_t most = 0;
    for (size_t i = 1; i + 1 < sums->part_count; i++)
        if (ledger_share(sums, i) > ledger_share(sums, most)) most = i;
    return most;
}
