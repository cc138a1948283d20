/* A set of lights that stands for the environment (gi/environment.h). */
#include "gi/environment.h"
#include "gi/octahedral.h"
#include "platform/maths.h"
#include "platform/random.h"

enum { LARGEST = 256 }; /* texels along a side that are told apart */

/* Where the Hilbert curve over size² places is after `at` steps (Warren 2012, "Hacker's Delight" §16). It enters at one corner and leaves at
 * another, and both are the same direction, straight down. */
static void hilbert_place(uint32_t size, uint32_t at, uint32_t* x, uint32_t* y)
{
    uint32_t a = 0, b = 0;
    for (uint32_t s = 1; s < size; s *= 2, at /= 4) {
        const uint32_t right = 1 & (at / 2), down = 1 & (at ^ right);
        if (!down) {
            if (right) {
                a = s - 1 - a;
                b = s - 1 - b;
            }
            const uint32_t other = a;
            a = b;
            b = other;
        }
        a += s * right;
        b += s * down;
    }
    *x = a;
    *y = b;
}

typedef struct texels {
    const float* texels;
    uint32_t size;
} texels;

static const float* texel_at(const texels* t, uint32_t at, uint32_t* x, uint32_t* y)
{
    hilbert_place(t->size, at, x, y);
    return t->texels + 4 * ((size_t)(*y + 1) * (t->size + 2) + *x + 1);
}

static double strength_of(const float* texel) { return (double)(0.2126f * texel[0] + 0.7152f * texel[1] + 0.0722f * texel[2]) * (double)texel[3]; }

/* The share of a light, and how many lights are left to share what no texel has by itself; texels above the share are lights of their own. Each
 * round takes away more than a share for each texel it takes out, so that shares get smaller and rounds end. */
static double find_share(const texels* t, uint32_t count, uint32_t* sharing)
{
    const uint32_t texel_count = t->size * t->size;
    double share = __builtin_inf();
    for (;;) {
        double rest = 0.0;
        uint32_t alone = 0;
        for (uint32_t y = 1; y <= t->size; y++)
            for (uint32_t x = 1; x <= t->size; x++) {
                const double s = strength_of(t->texels + 4 * ((size_t)y * (t->size + 2) + x));
                if (s > share) alone++;
                else rest += s;
            }
        if (alone >= count || alone == texel_count || !(rest > 0.0)) {
            *sharing = 0;
            return share;
        }
        *sharing = count - alone;
        const double next = rest / *sharing;
        if (!(next < share * (1.0 - 1e-12))) return share;
        share = next;
    }
}

typedef struct cell { double light[3], moment[3], solid_angle; } cell;

static void add_share(cell* c, const float* texel, es_vec3 d, double share)
{
    const double s = strength_of(texel) * share;
    for (int k = 0; k < 3; k++) c->light[k] += (double)texel[k] * (double)texel[3] * share;
    c->moment[0] += (double)d.x * s;
    c->moment[1] += (double)d.y * s;
    c->moment[2] += (double)d.z * s;
    c->solid_angle += (double)texel[3] * share;
}

static void end_cell(cell* c, es_environment_light* out, uint32_t* written, uint32_t count)
{
    const double length = c->moment[0] * c->moment[0] + c->moment[1] * c->moment[1] + c->moment[2] * c->moment[2];
    if (*written < count && (c->light[0] > 0.0 || c->light[1] > 0.0 || c->light[2] > 0.0)) {
        const double scale = length > 0.0 ? 1.0 / __builtin_sqrt(length) : 0.0;
        const es_vec3 mean = es_v3((float)(c->moment[0] * scale), (float)(c->moment[1] * scale), (float)(c->moment[2] * scale));
        out[(*written)++] = (es_environment_light){es_v3_normalize(mean, es_v3(0, 1, 0)), {(float)c->light[0], (float)c->light[1], (float)c->light[2]}, (float)c->solid_angle};
    }
    *c = (cell){0};
}

uint32_t es_environment_sample(const es_environment_map* map, uint32_t count, uint32_t seed, es_environment_light* out)
{
    if (!map->memory || !count) return 0;
    uint32_t level = 0;
    while (map->means.size[level] > (float)LARGEST) level++;
    const texels t = {map->memory + 4 * (size_t)map->means.first[level], (uint32_t)map->means.size[level]};
    uint32_t sharing, written = 0;
    const double share = find_share(&t, count, &sharing);
    /* the first cell is a part of one, by the seed; what is left after the last whole one belongs to it, as both lie at the curve's ends */
    const double begun = sharing ? (double)es_random_float(0x534b59u, seed) : 0.0;
    double open = sharing ? share * begun : __builtin_inf();
    cell first = {0}, c = {0};
    bool in_first = sharing > 0;
    for (uint32_t at = 0; at < t.size * t.size; at++) {
        uint32_t x, y;
        const float* texel = texel_at(&t, at, &x, &y);
        const double s = strength_of(texel);
        const es_vec3 d = es_octahedral_direction(x, y, t.size);
        if (s > share) {
            cell alone = {0};
            add_share(&alone, texel, d, 1.0);
            end_cell(&alone, out, &written, count);
            continue;
        }
        double left = s;
        while (left > open) { /* a texel may end several cells only by rounding: it has no more than a share */
            add_share(in_first ? &first : &c, texel, d, open / s);
            if (!in_first) end_cell(&c, out, &written, count - (sharing > 0));
            in_first = false;
            left -= open;
            open = share;
        }
        if (s > 0.0) add_share(in_first ? &first : &c, texel, d, left / s);
        else add_share(in_first ? &first : &c, texel, d, 1.0);
        open -= left;
    }
    for (int k = 0; k < 3; k++) {
        first.light[k] += c.light[k];
        first.moment[k] += c.moment[k];
    }
    first.solid_angle += c.solid_angle;
    end_cell(&first, out, &written, count);
    return written;
}
