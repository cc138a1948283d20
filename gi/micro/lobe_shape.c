#include "gi/micro/lobe_shape.h"

/* Samples: of the model's lobe, the square of it; of what stands for it, at so many angles from its axis, so many about it. */
enum { MODEL = 12, ACROSS = 20, AROUND = 6, STEPS = 14 };
#define WIDE 0.25f

typedef struct drawn { uint32_t count; es_vec3 w[MODEL * MODEL]; float weight[MODEL * MODEL]; float sum; } drawn;

/* The model's own samples, weighted: together they are f cos. */
static void draw(const es_surface* s, es_vec3 light, drawn* d)
{
    d->count = 0;
    d->sum = 0.0f;
    for (int y = 0; y < MODEL; y++)
        for (int x = 0; x < MODEL; x++) {
            const float u[3] = {0.0f, ((float)x + 0.5f) / MODEL, ((float)y + 0.5f) / MODEL};
            es_surface_sample sample;
            if (!es_surface_sample_direction(s, es_v3(0, 0, 1), light, u, &sample)) continue;
            d->w[d->count] = sample.wi;
            d->weight[d->count++] = sample.weight.x;
            d->sum += sample.weight.x;
        }
}

typedef struct shape { es_vec3 mu; float a, gain; } shape;

/* x: 1 - mu · w */
static float density(bool phong, float a, float x)
{
    if (!phong) {
        const float t = 1.0f + (0.5f - 0.5f * a) / a * x;
        return 0.0795774715f / (a * t * t);
    }
    const float b = 1.0f / (14.0f * a), t = 1.0f + b * x, t2 = t * t, t4 = t2 * t2, s = 1.0f + 2.0f * b, s2 = s * s;
    return 1.11408460f * b / ((1.0f - 1.0f / (s2 * s2 * s2 * s)) * (t4 * t4));
}

/* The share u of its power is within this 1 - mu · w. */
static float within(bool phong, float a, float u)
{
    if (!phong) {
        const float b = (0.5f - 0.5f * a) / a;
        return b < 1e-4f ? 2.0f * u : es_minf((1.0f / (1.0f - u * 2.0f * b / (1.0f + 2.0f * b)) - 1.0f) / b, 2.0f);
    }
    const float b = 1.0f / (14.0f * a), s = 1.0f + 2.0f * b, s2 = s * s, all = 1.0f - 1.0f / (s2 * s2 * s2 * s);
    return es_minf((es_pow(1.0f - u * all, -1.0f / 7.0f) - 1.0f) / b, 2.0f);
}

static float apart(es_vec3 a, es_vec3 b)
{
    const es_vec3 d = es_v3_sub(a, b);
    return 0.5f * es_v3_dot(d, d);
}

/* Directions about an axis, of which every other ring of samples is turned by half a step. */
typedef struct around { float sine[2][AROUND], cosine[2][AROUND]; } around;

static around turn_around(void)
{
    around a;
    for (int turned = 0; turned < 2; turned++)
        for (int j = 0; j < AROUND; j++) es_sincos(2.0f * ES_PI * ((float)j + 0.5f * (float)(1 + turned)) / AROUND, &a.sine[turned][j], &a.cosine[turned][j]);
    return a;
}

/* Sets its gain; returns the square of its distance from the model less what does not depend on it. */
static float distance(bool phong, const drawn* model, const around* turns, shape* s)
{
    es_vec3 t, b;
    float kept = 0.0f, square = 0.0f, common = 0.0f;
    es_orthonormal_basis(s->mu, &t, &b);
    for (int i = 0; i < ACROSS; i++) {
        /* closer towards the rim: what is below the horizon is mostly there */
        const float left = ((float)i + 0.5f) / ACROSS, weight = 2.0f * left / (ACROSS * AROUND), x = within(phong, s->a, 1.0f - left * left), z = 1.0f - x, r = es_sqrt(es_maxf(x * (2.0f - x), 0.0f)), p = density(phong, s->a, x);
        for (int j = 0; j < AROUND; j++) {
            const float c = s->mu.z * z + (t.z * turns->cosine[i % 2][j] + b.z * turns->sine[i % 2][j]) * r, share = es_clampf(c * (1.0f / ES_LOBE_HORIZON), 0.0f, 1.0f);
            kept += weight * share;
            square += weight * p * share * share;
        }
    }
    for (uint32_t i = 0; i < model->count; i++)
        common += model->weight[i] * density(phong, s->a, apart(model->w[i], s->mu)) * es_minf(model->w[i].z * (1.0f / ES_LOBE_HORIZON), 1.0f);
    s->gain = 1.0f / es_maxf(kept, 0.02f);
    return s->gain * (s->gain * square - 2.0f * common / model->sum);
}

/* The best width about mu, by golden section over its logarithm. */
static float widen(bool phong, const drawn* model, const around* turns, float typical, shape* s)
{
    const float ratio = 0.618033989f;
    float low = es_log2(es_maxf(typical * 0.2f, ES_LOBE_LEAST_WIDTH)), high = es_log2(es_minf(typical * 12.0f, 1.0f));
    float x[2] = {high - ratio * (high - low), low + ratio * (high - low)}, at[2];
    for (int k = 0; k < 2; k++) {
        s->a = es_exp2(x[k]);
        at[k] = distance(phong, model, turns, s);
    }
    for (int i = 0; i < STEPS; i++) {
        const int next = at[0] < at[1] ? 0 : 1;
        if (next == 0) {
            high = x[1];
            x[1] = x[0];
            at[1] = at[0];
            x[0] = high - ratio * (high - low);
        } else {
            low = x[0];
            x[0] = x[1];
            at[0] = at[1];
            x[1] = low + ratio * (high - low);
        }
        s->a = es_exp2(x[next]);
        at[next] = distance(phong, model, turns, s);
    }
    s->a = es_exp2(at[0] < at[1] ? x[0] : x[1]);
    return distance(phong, model, turns, s);
}

/* Between the mean direction of what is reflected and the mirror direction. */
static shape fit(bool phong, const es_surface* s, float c, float own, const around* turns)
{
    enum { DIRECTIONS = 4 };
    /* a lobe that wide has no other peak than its mean */
    const int directions = own > WIDE ? 1 : DIRECTIONS;
    const float sine = es_sqrt(1.0f - c * c), typical = phong ? own : own * c;
    const es_vec3 mirror = es_v3(-sine, 0, c);
    drawn model;
    es_vec3 mean = es_v3(0, 0, 0);
    shape best = {.mu = mirror, .a = typical, .gain = 1.0f};
    draw(s, es_v3(sine, 0, c), &model);
    if (!(model.sum > 0.0f)) return best;
    for (uint32_t i = 0; i < model.count; i++) mean = es_v3_add(mean, es_v3_scale(model.w[i], model.weight[i]));
    mean = es_v3_normalize(es_v3(mean.x, 0, mean.z), mirror);
    float least = 3e38f;
    for (int i = 0; i < directions; i++) {
        shape here = {.mu = es_v3_normalize(es_v3_add(es_v3_scale(mean, (float)(DIRECTIONS - 1 - i)), es_v3_scale(mirror, (float)i)), mirror)};
        const float found = widen(phong, &model, turns, typical, &here);
        if (!(found < least)) continue;
        least = found;
        best = here;
    }
    return best;
}

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    es_lobe_shapes* shapes = user;
    const around turns = turn_around();
    (void)worker;
    for (uint32_t row = begin; row < end; row++)
        for (int phong = 0; phong < 2; phong++)
            for (uint32_t column = 0; column < ES_SHAPE_COLUMNS; column++) {
                const uint32_t at = row * ES_SHAPE_COLUMNS + column;
                const float share = (float)row / (ES_SHAPE_ROWS - 1), roughness = phong ? ES_SHAPE_MAX_EXPONENT * share * share : share, c = es_maxf((float)column / (ES_SHAPE_COLUMNS - 1), 0.02f);
                const es_surface s = {.specular = es_v3(1, 1, 1), .roughness = roughness, .model = phong ? ES_SURFACE_PHONG : ES_SURFACE_METALLIC_ROUGHNESS};
                const float own = phong ? 0.5f / (roughness + 1.0f) : es_maxf(roughness * roughness * roughness * roughness, ES_SURFACE_MIN_ALPHA2);
                const shape found = fit(phong, &s, c, own, &turns);
                const float sine = es_sqrt(1.0f - c * c);
                shapes->lean[phong][at] = sine > 0.0f ? -found.mu.x / sine : 1.0f;
                shapes->lift[phong][at] = found.mu.z - c;
                shapes->width[phong][at] = es_sqrt(found.a / own);
                shapes->gain[phong][at] = found.gain;
            }
}

void es_lobe_shapes_fill(es_context* context, es_lobe_shapes* shapes)
{
    if (shapes->filled) return;
    es_parallel_for(context, ES_SHAPE_ROWS, 1, rows, shapes);
    shapes->filled = true;
}
