#include "gi/glare/lens.h"

#include <string.h>

#include "gi/glare/step_grid.h"
#include "gi/glare/value_noise.h"
#include "platform/maths.h"
#include "platform/random.h"

enum { N = ES_LENS_GRID, SUBSTEPS = 4, RIM = N - 1, MIDDLE = N / 2 };
static const float stiffness = 1e5f, drag = 60.0f; /* 1/s², 1/s: it settles in some 0.1 s, so it follows the muscle's 2 Hz */

/* ---- anatomy --------------------------------------------------------------------------------------------------------------------------- */

void es_lens_begin(es_lens* lens, uint32_t seed)
{
    memset(lens, 0, sizeof *lens);
    uint32_t counter = 0;
    for (uint32_t i = 0; i < ES_LENS_PARTICLES; i++) {
        float x, y, z;
        do {
            x = 2 * es_random_float(seed, counter++) - 1;
            y = 2 * es_random_float(seed, counter++) - 1;
            z = 2 * es_random_float(seed, counter++) - 1;
        } while (x * x + y * y + z * z > 1 || x * x + y * y < 1e-6f);
        const float r = es_sqrt(x * x + y * y);
        lens->particles[i] = (es_lens_particle){{r, 0.5f + 0.5f * z}, x / r, y / r, 0.5e-3f * (20.0f + 50.0f * es_random_float(seed, counter++))};
    }
    /* Fibres are 10 µm apart and their halo is at 3.3 degrees; a picture in which a spectrum of 512² of 9 mm is seen ends at 0.9. They are drawn wider. */
    lens->period = 0.050f * (0.9f + 0.2f * es_random_float(seed, counter++));
    for (uint32_t i = 0; i < ES_LENS_GRATINGS; i++) {
        es_lens_grating* g = &lens->gratings[i];
        const float inner = (0.9f + 3.3f * es_random_float(seed, counter++)) / ES_LENS_RADIUS, outer = inner + 0.18f / ES_LENS_RADIUS;
        /* in the cortex: next to the surface in front or behind */
        const float depth = 0.5f * es_sqrt(1.0f - inner * inner) * (0.8f + 0.2f * es_random_float(seed, counter++));
        const float v = es_random_float(seed, counter++) < 0.5f ? 0.5f - depth : 0.5f + depth;
        g->inner = (es_lens_place){inner, v};
        g->outer = (es_lens_place){outer, v};
        es_sincos(2 * ES_PI * es_random_float(seed, counter++), &g->sine, &g->cosine);
    }
}

/* ---- accommodation --------------------------------------------------------------------------------------------------------------------- */

/* sin of so many turns */
static float sine_of_turns(double turns)
{
    const double whole = (double)(int64_t)turns;
    return es_sin((float)(turns - whole) * (2 * ES_PI));
}

float es_lens_accommodation(uint32_t seed, double time, float pupil)
{
    enum { TONES = 6 };
    /* Dioptres' tenths move the rim by hundredths of a millimetre, which at the fibres' true distance is much; here they are five times as far apart, and it is to be seen. */
    const float low = 0.5f * es_sqrt(es_maxf(pupil, 0) * 0.25f) * es_value_noise(seed, 0.08 * time, 3);
    float high = 0;
    for (uint32_t i = 0; i < TONES; i++) { /* between 1.4 and 2.0 Hz: their beats stay inside of the band */
        const double frequency = 1.4 + 0.6 * ((double)i + (double)es_random_float(seed ^ 0x51u, i)) / TONES;
        high += sine_of_turns(frequency * time + (double)es_random_float(seed ^ 0x52u, i));
    }
    return low + 0.05f * high;
}

/* ---- mass-spring system ---------------------------------------------------------------------------------------------------------------- */

static const int8_t springs[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};

/* Unit directions of the four springs at rest, radial and axial. */
static void directions(float d[4][2])
{
    const float h[2] = {ES_LENS_RADIUS / (N - 1), ES_LENS_THICKNESS / (N - 1)};
    for (uint32_t k = 0; k < 4; k++) {
        const float x = (float)springs[k][0] * h[0], y = (float)springs[k][1] * h[1], length = es_sqrt(x * x + y * y);
        d[k][0] = x / length;
        d[k][1] = y / length;
    }
}

static void forces(const es_lens* lens, const float d[4][2], float force[N][N][2])
{
    memset(force, 0, sizeof(float) * N * N * 2);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            for (int k = 0; k < 4; k++) {
                const int a = i + springs[k][0], b = j + springs[k][1];
                if (a >= N || b < 0 || b >= N) continue;
                const float longer = (lens->moved[a][b][0] - lens->moved[i][j][0]) * d[k][0] + (lens->moved[a][b][1] - lens->moved[i][j][1]) * d[k][1];
                const float fx = stiffness * longer * d[k][0], fy = stiffness * longer * d[k][1];
                force[i][j][0] += fx;
                force[i][j][1] += fy;
                force[a][b][0] -= fx;
                force[a][b][1] -= fy;
            }
}

/* What comes to rest does so before numbers lose their bits. */
static float settled(float x) { return x < 1e-15f && x > -1e-15f ? 0 : x; }

void es_lens_step(es_lens* lens, float drive)
{
    const float dt = 1.0f / (ES_GRID_RATE * SUBSTEPS), slower = 1.0f / (1.0f + drag * dt);
    const float from = lens->moved[RIM][MIDDLE][0];
    float d[4][2], force[N][N][2];
    directions(d);
    for (uint32_t step = 1; step <= SUBSTEPS; step++) {
        forces(lens, (const float(*)[2])d, force);
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++)
                for (int c = 0; c < 2; c++) {
                    if (i == 0 && c == 0) continue; /* on the axis */
                    lens->speed[i][j][c] = settled((lens->speed[i][j][c] + force[i][j][c] * dt) * slower);
                    lens->moved[i][j][c] = settled(lens->moved[i][j][c] + lens->speed[i][j][c] * dt);
                }
        lens->moved[RIM][MIDDLE][0] = settled(from + (drive - from) * ((float)step / SUBSTEPS));
        lens->moved[RIM][MIDDLE][1] = 0;
        lens->speed[RIM][MIDDLE][0] = lens->speed[RIM][MIDDLE][1] = 0;
    }
}

double es_lens_energy(const es_lens* lens)
{
    float d[4][2];
    double energy = 0;
    directions(d);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            for (int c = 0; c < 2; c++) energy += 0.5 * (double)lens->speed[i][j][c] * (double)lens->speed[i][j][c];
            for (int k = 0; k < 4; k++) {
                const int a = i + springs[k][0], b = j + springs[k][1];
                if (a >= N || b < 0 || b >= N) continue;
                const float longer = (lens->moved[a][b][0] - lens->moved[i][j][0]) * d[k][0] + (lens->moved[a][b][1] - lens->moved[i][j][1]) * d[k][1];
                energy += 0.5 * (double)stiffness * (double)longer * (double)longer;
            }
        }
    return energy;
}

/* ---- what is drawn --------------------------------------------------------------------------------------------------------------------- */

float es_lens_radius_at(const es_lens* lens, es_lens_place p)
{
    const float u = es_clampf(p.u, 0, 1) * (N - 1), v = es_clampf(p.v, 0, 1) * (N - 1);
    uint32_t i = (uint32_t)u, j = (uint32_t)v;
    if (i > N - 2) i = N - 2;
    if (j > N - 2) j = N - 2;
    const float s = u - (float)i, t = v - (float)j;
    const float low = lens->moved[i][j][0] + (lens->moved[i][j + 1][0] - lens->moved[i][j][0]) * t;
    const float high = lens->moved[i + 1][j][0] + (lens->moved[i + 1][j + 1][0] - lens->moved[i + 1][j][0]) * t;
    return p.u * ES_LENS_RADIUS + low + (high - low) * s;
}

void es_lens_add_particles(const es_lens* lens, es_eye_shapes* shapes)
{
    for (uint32_t i = 0; i < ES_LENS_PARTICLES; i++) {
        const es_lens_particle* p = &lens->particles[i];
        const float r = es_lens_radius_at(lens, p->place);
        es_eye_add_disc(shapes, r * p->cosine, r * p->sine, p->radius);
    }
}

void es_lens_add_gratings(const es_lens* lens, es_eye_shapes* shapes)
{
    const float half = 0.16f * lens->period;
    for (uint32_t i = 0; i < ES_LENS_GRATINGS; i++) {
        const es_lens_grating* g = &lens->gratings[i];
        const float inner = es_lens_radius_at(lens, g->inner), outer = es_lens_radius_at(lens, g->outer);
        for (uint32_t k = 0; k < ES_GRATING_LINES; k++) {
            const float aside = ((float)k - 0.5f * (ES_GRATING_LINES - 1)) * lens->period;
            es_eye_add_line(shapes, (es_vec2){inner * g->cosine - aside * g->sine, inner * g->sine + aside * g->cosine}, (es_vec2){outer * g->cosine - aside * g->sine, outer * g->sine + aside * g->cosine}, half, half);
        }
    }
}
