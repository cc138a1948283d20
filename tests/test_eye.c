/* The living eye of glare against what Ritschel's thesis says of it (§8.2, table 8.1): the pupil's diameter, the spectrum of accommodation, the lens' springs, the
 * vitreous humour's damping, blinks; each part by its switch; time cut into frames, leaping and standing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gi/glare/eye.h"
#include "gi/glare/pupil.h"
#include "gi/glare/value_noise.h"
#include "platform/random.h"
#include "tests/races.h"

static void assert_near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%.9g, expected %.9g within %g", value, expected, tolerance);
}

static es_eye_subject usual(void)
{
    es_renderer_settings settings = es_default_renderer_settings();
    return es_eye_subject_of(&settings);
}

/* ---- pupil -------------------------------------------------------------------------------------------------------------------------- */

static void test_pupil(void** state)
{
    (void)state;
    /* eq. 8.2 */
    for (int i = -60; i <= 60; i++) assert_near((double)es_pupil_mean(powf(10, 0.1f * (float)i)), 4.9 - 3 * tanh(0.4 * (0.1 * i + 1)), 2e-5);
    assert_near((double)es_pupil_mean(0.1f), 4.9, 1e-5);
    static const float dark[] = {0, -1, NAN, -INFINITY};
    for (int i = 0; i < 4; i++) assert_near((double)es_pupil_mean(dark[i]), 7.9, 1e-5);
    assert_near((double)es_pupil_mean(INFINITY), 1.9, 1e-5);
    /* eq. 8.1: with bright fields more (figure 8.3) */
    double last = 10;
    for (int i = 1; i <= 9; i++) {
        const double p = i, swing = (double)(es_pupil_hippus((float)p, 0.05f) - es_pupil_hippus((float)p, -0.05f));
        assert_near(swing, 0.1 * 9 / p * sqrt(1 - p / 9), 1e-5);
        assert_true(swing < last);
        assert_near((double)es_pupil_hippus((float)p, 0), p, 1e-6);
        last = swing;
    }
    /* never less than shut, never more than there is */
    for (float noise = -1; noise <= 1; noise += 0.25f) {
        assert_true(es_pupil_hippus(0, noise) == 0);
        assert_true(es_pupil_hippus(9, noise) == 9);
        assert_true(es_pupil_hippus(20, noise) == 9);
        const float h = es_pupil_hippus(0.1f, noise);
        assert_true(h >= 0 && h <= 9);
    }
}

static void test_value_noise(void** state)
{
    (void)state;
    double sum = 0, most = 0;
    float last = es_value_noise(5, -50, 3);
    for (int i = 1; i <= 100000; i++) {
        const float v = es_value_noise(5, -50 + 0.001 * i, 3);
        assert_true(v >= -1 && v <= 1);
        assert_true(fabsf(v - last) < 0.02f); /* steep at the most by three times the octaves' slopes */
        sum += (double)v;
        most = fmax(most, fabs((double)v));
        last = v;
    }
    assert_near(sum / 1e5, 0, 0.15);
    assert_true(most > 0.5);
    /* at whole places the first octave is what the counter says, whichever side it is seen from */
    for (int i = -3; i <= 3; i++) assert_near((double)es_value_noise(7, i, 1), 2 * (double)es_random_float(7, (uint32_t)i) - 1, 1e-6);
    assert_true(es_value_noise(1, 1e14, 3) >= -1);
}

/* ---- lens --------------------------------------------------------------------------------------------------------------------------- */

/* Mean power of a signal of 256 s at 16 Hz within bands of Hz, by its Fourier transform under a Hann window. */
enum { SAMPLES = 4096, SAMPLE_RATE = 16 };
static double band(const double* signal, double from, double to)
{
    static double wave[SAMPLES];
    double power = 0;
    for (int i = 0; i < SAMPLES; i++) wave[i] = sin(2 * M_PI * i / SAMPLES);
    for (int k = (int)ceil(from * SAMPLES / SAMPLE_RATE); k < to * SAMPLES / SAMPLE_RATE; k++) {
        double re = 0, im = 0;
        for (int i = 0; i < SAMPLES; i++) {
            re += signal[i] * wave[(k * i + SAMPLES / 4) % SAMPLES];
            im += signal[i] * wave[k * i % SAMPLES];
        }
        power += re * re + im * im;
    }
    return power;
}

static void sample_accommodation(uint32_t seed, float pupil, double* signal)
{
    for (int i = 0; i < SAMPLES; i++) signal[i] = (double)es_lens_accommodation(seed, 1000 + (double)i / SAMPLE_RATE, pupil) * (0.5 - 0.5 * cos(2 * M_PI * i / SAMPLES));
}

static void test_accommodation(void** state)
{
    (void)state;
    static double signal[SAMPLES];
    double low[2], high[2];
    for (int p = 0; p < 2; p++) {
        sample_accommodation(3, p ? 8.0f : 2.0f, signal);
        low[p] = band(signal, 0, 0.6);
        high[p] = band(signal, 1.3, 2.1);
        const double between = band(signal, 0.6, 1.3), above = band(signal, 2.1, 8);
        assert_true(between + above < 0.02 * (low[p] + high[p]));
        assert_true(high[p] > 0.02 * low[p]);
    }
    /* the low component's power goes with the pupil's size, the high one's does not */
    assert_near(low[1] / low[0], 4, 0.1);
    assert_near(high[1] / high[0], 1, 0.05);
}

static double farthest(const es_lens* lens)
{
    double most = 0;
    for (int i = 0; i < ES_LENS_GRID; i++)
        for (int j = 0; j < ES_LENS_GRID; j++) most = fmax(most, hypot((double)lens->moved[i][j][0], (double)lens->moved[i][j][1]));
    return most;
}

static void test_lens_springs(void** state)
{
    (void)state;
    static es_lens lens, half;
    es_lens_begin(&lens, 1);
    es_lens_begin(&half, 1);
    es_lens_step(&lens, 0);
    assert_true(es_lens_energy(&lens) == 0);
    for (int i = 0; i < 480; i++) {
        es_lens_step(&lens, 0.1f);
        es_lens_step(&half, 0.05f);
    }
    /* held, it stands: the axis where it was, all else stretched outwards, the more the further out; front and back alike; in proportion to the pull */
    const es_lens held = lens;
    es_lens_step(&lens, 0.1f);
    for (int i = 0; i < ES_LENS_GRID; i++)
        for (int j = 0; j < ES_LENS_GRID; j++) {
            assert_near((double)lens.moved[i][j][0], (double)held.moved[i][j][0], 1e-5);
            assert_near((double)lens.moved[i][j][0], (double)lens.moved[i][ES_LENS_GRID - 1 - j][0], 1e-5);
            assert_near((double)lens.moved[i][j][0], 2 * (double)half.moved[i][j][0], 2e-5);
            if (i == 0) assert_true(lens.moved[i][j][0] == 0);
            else assert_true(lens.moved[i][j][0] > 0);
        }
    const int middle = ES_LENS_GRID / 2;
    for (int i = 1; i < ES_LENS_GRID; i++) assert_true(lens.moved[i][middle][0] > lens.moved[i - 1][middle][0]);
    assert_near((double)lens.moved[ES_LENS_GRID - 1][middle][0], 0.1, 1e-6);
    assert_near((double)es_lens_radius_at(&lens, (es_lens_place){1, 0.5f}), (double)ES_LENS_RADIUS + 0.1, 1e-5);
    assert_near((double)es_lens_radius_at(&lens, (es_lens_place){(float)5 / 16, 0.25f}), 1.5 + (double)lens.moved[5][4][0], 1e-5);
    assert_near((double)es_lens_radius_at(&lens, (es_lens_place){5.5f / 16, 0.25f}), 1.65 + 0.5 * (double)(lens.moved[5][4][0] + lens.moved[6][4][0]), 1e-5);

    /* let go, it comes back, and its energy falls; in the end it is at rest, to the bit */
    es_lens_step(&lens, 0);
    double energy = es_lens_energy(&lens);
    const double first = energy;
    for (int i = 0; i < 2400; i++) {
        es_lens_step(&lens, 0);
        const double now = es_lens_energy(&lens);
        assert_true(now <= energy * 1.001 + 1e-20);
        energy = now;
        if (i == 60) assert_true(energy < 0.02 * first);
    }
    assert_true(farthest(&lens) < 1e-10);
    /* whatever the muscle does, it stays bounded by that: a minute of random jerks */
    double most = 0;
    for (uint32_t i = 0; i < 240 * 60; i++) {
        es_lens_step(&lens, 0.1f * (2 * es_random_float(3, i) - 1));
        if (i % 16 == 0) most = fmax(most, farthest(&lens));
    }
    assert_true(most < 0.2);
}

/* ---- vitreous humour ----------------------------------------------------------------------------------------------------------------- */

static void test_vitreous(void** state)
{
    (void)state;
    static es_vitreous v;
    es_vitreous_begin(&v, 2);
    for (int64_t i = 0; i < 1000; i++) es_vitreous_step(&v, 2, i, 0);
    for (int k = 0; k < 3; k++) assert_true(v.angle[k] == 0 && v.speed[k] == 0);
    /* saccades: some 1.4 a second, that turn it by some hundredths of a radian */
    int saccades = 0;
    double most = 0;
    for (int64_t i = -24000; i < 24000; i++) {
        const float before = v.torque[0];
        es_vitreous_step(&v, 2, i, 1);
        saccades += fabsf(v.torque[0]) > fabsf(before) + 1e-6f || v.torque[0] * before < 0;
        for (int k = 0; k < 3; k++) most = fmax(most, fabs((double)v.angle[k]));
    }
    assert_true(saccades > 200 && saccades < 300);
    assert_true(most > 0.02 && most < 0.5);
    /* strongly damped: once its torque has faded it returns without swinging through, by 98 % in 2 s, and then it rests, to the bit */
    v.torque[0] = 10;
    v.angle[0] = v.speed[0] = 0;
    float top = 0;
    bool back = false;
    for (int i = 0; i < 24000; i++) {
        const float before = v.angle[0];
        es_vitreous_step(&v, 2, i, 0);
        assert_true(v.angle[0] >= 0);
        if (v.angle[0] < before) back = true;
        if (back) assert_true(v.angle[0] <= before);
        top = fmaxf(top, v.angle[0]);
        if (i == 480) assert_true(v.angle[0] < 0.02f * top);
    }
    assert_true(v.angle[0] == 0 && v.speed[0] == 0 && v.torque[0] == 0);
    /* one body: distances stay, seen along the axis they shrink at the most */
    static es_eye_shapes shapes;
    v.angle[2] = 0.3f;
    shapes.disc_count = 0;
    es_vitreous_add_particles(&v, &shapes);
    assert_int_equal(shapes.disc_count, ES_VITREOUS_PARTICLES);
    for (uint32_t i = 0; i < ES_VITREOUS_PARTICLES; i++) { /* about the axis: a turn of the picture */
        const es_vec3 p = v.particles[i];
        assert_near((double)shapes.discs[i].x, (double)p.x * cos(0.3) - (double)p.y * sin(0.3), 1e-5);
        assert_near((double)shapes.discs[i].y, (double)p.x * sin(0.3) + (double)p.y * cos(0.3), 1e-5);
        assert_true(hypot(hypot((double)p.x, (double)p.y), (double)p.z) <= (double)ES_VITREOUS_RADIUS * 1.00001);
    }
}

/* ---- lids ---------------------------------------------------------------------------------------------------------------------------- */

static void test_lids(void** state)
{
    (void)state;
    int blinks = 0, shut = 0, moving = 0;
    float last = 0;
    for (int64_t i = -240 * 300; i < 240 * 300; i++) {
        const float b = es_blink(9, i);
        assert_true(b >= 0 && b <= 1);
        assert_true(fabsf(b - last) < 0.08f);
        if (b == 0 && last > 0) {
            blinks++;
            assert_near(moving / 240.0, 0.28, 0.01); /* 83 + 33 + 167 ms */
            assert_near(shut / 240.0, 0.035, 0.006);
            moving = shut = 0;
        }
        moving += b > 0;
        shut += b == 1;
        last = b;
    }
    assert_true(blinks > 90 && blinks < 150); /* in ten minutes */
    last = 0;
    for (float l = 1; l < 1e6f; l *= 1.1f) {
        const float s = es_squint(l);
        assert_true(s >= last && s <= 0.8f);
        if (l < 300) assert_true(s == 0);
        last = s;
    }
    assert_near((double)es_squint(1e4f), 0.8, 1e-4);
    assert_true(es_squint(NAN) == 0 && es_squint(0) == 0 && es_squint(INFINITY) == 0.8f);
    /* shut, what is left is a slit through the middle */
    static es_lids lids;
    static es_eye_shapes shapes;
    es_lids_begin(&lids, 4);
    lids.shut = 1;
    shapes.quad_count = 0;
    es_lids_add(&lids, true, &shapes);
    assert_true(shapes.lids && shapes.upper > 0 && shapes.lower < 0 && shapes.upper - shapes.lower < 0.3f);
    assert_int_equal(shapes.quad_count, (ES_UPPER_LASHES + ES_LOWER_LASHES) * ES_LASH_SEGMENTS);
}

/* ---- the whole eye ------------------------------------------------------------------------------------------------------------------- */

/* Blocked areas over the widest pupil, as if nothing lay over anything. */
static double disc_area(const es_eye_disc* discs, uint32_t count)
{
    double area = 0;
    for (uint32_t i = 0; i < count; i++)
        if (hypot((double)discs[i].x, (double)discs[i].y) < 4.5) area += M_PI * (double)discs[i].radius * (double)discs[i].radius;
    return area;
}

static void test_shares(void** state)
{
    (void)state;
    for (uint32_t seed = 0; seed < 5; seed++) {
        static es_eye eye;
        static es_eye_shapes shapes;
        es_eye_subject s = usual();
        s.seed = seed;
        s.lids = false;
        es_eye_advance(&eye, &s, 0, 1);
        es_eye_get_shapes(&eye, &shapes);
        assert_int_equal(shapes.disc_count, ES_CORNEA_PARTICLES + ES_LENS_PARTICLES + ES_VITREOUS_PARTICLES);
        assert_int_equal(shapes.quad_count, ES_LENS_GRATINGS * ES_GRATING_LINES);
        double gratings = 0;
        for (uint32_t i = 0; i < shapes.quad_count; i++) {
            const es_vec2* c = shapes.quads[i].corner;
            double twice = 0;
            for (int k = 0; k < 4; k++) twice += (double)c[k].x * (double)c[(k + 1) % 4].y - (double)c[(k + 1) % 4].x * (double)c[k].y;
            if (hypot((double)c[0].x, (double)c[0].y) < 4.5) gratings += 0.5 * fabs(twice);
        }
        const double cornea = disc_area(shapes.discs, ES_CORNEA_PARTICLES), lens = gratings + disc_area(shapes.discs + ES_CORNEA_PARTICLES, ES_LENS_PARTICLES);
        const double vitreous = disc_area(shapes.discs + ES_CORNEA_PARTICLES + ES_LENS_PARTICLES, ES_VITREOUS_PARTICLES);
        /* table 8.1: cornea 25-30 %, lens 40 %, vitreous 10 % */
        assert_near(cornea / lens, 27.5 / 40, 0.12);
        assert_near(vitreous / lens, 10.0 / 40, 0.05);
    }
}

static bool same_shapes(const es_eye_shapes* a, const es_eye_shapes* b)
{
    return a->pupil == b->pupil && a->lids == b->lids && (!a->lids || (a->upper == b->upper && a->lower == b->lower)) && a->disc_count == b->disc_count && a->quad_count == b->quad_count
        && memcmp(a->discs, b->discs, a->disc_count * sizeof *a->discs) == 0 && memcmp(a->quads, b->quads, a->quad_count * sizeof *a->quads) == 0;
}

typedef struct shapes_at { es_eye_shapes* shapes; uint64_t version; } shapes_at;

static shapes_at shapes_of(es_eye_subject subject, double time, float luminance)
{
    static es_eye eye;
    memset(&eye, 0, sizeof eye);
    es_eye_advance(&eye, &subject, time, luminance);
    shapes_at at = {malloc(sizeof(es_eye_shapes)), es_eye_version(&eye)};
    assert_non_null(at.shapes);
    es_eye_get_shapes(&eye, at.shapes);
    return at;
}

/* Without `count` discs from `first` on, and likewise quads. */
static void leave_out(es_eye_shapes* s, uint32_t first, uint32_t count, uint32_t first_quad, uint32_t quads)
{
    memmove(s->discs + first, s->discs + first + count, (s->disc_count - first - count) * sizeof *s->discs);
    memmove(s->quads + first_quad, s->quads + first_quad + quads, (s->quad_count - first_quad - quads) * sizeof *s->quads);
    s->disc_count -= count;
    s->quad_count -= quads;
}

/* Each switch changes its part, and leaves the others as they are, to the bit. */
static void test_switches(void** state)
{
    (void)state;
    const double time = 3.3;
    const float bright = 3000;
    enum { GRATING_QUADS = ES_LENS_GRATINGS * ES_GRATING_LINES, LASH_QUADS = (ES_UPPER_LASHES + ES_LOWER_LASHES) * ES_LASH_SEGMENTS };
    for (int which = 0; which < 12; which++) {
        shapes_at all = shapes_of(usual(), time, bright);
        es_eye_subject s = usual();
        es_eye_shapes* expected = all.shapes;
        switch (which) {
        case 0: s.cornea = false; leave_out(expected, 0, ES_CORNEA_PARTICLES, 0, 0); break;
        case 1: s.lens = false; leave_out(expected, ES_CORNEA_PARTICLES, ES_LENS_PARTICLES, 0, 0); break;
        case 2: s.gratings = false; leave_out(expected, 0, 0, 0, GRATING_QUADS); break;
        case 3: s.vitreous = false; leave_out(expected, ES_CORNEA_PARTICLES + ES_LENS_PARTICLES, ES_VITREOUS_PARTICLES, 0, 0); break;
        case 4: s.lashes = false; leave_out(expected, 0, 0, GRATING_QUADS, LASH_QUADS); break;
        case 5: s.lids = false; leave_out(expected, 0, 0, GRATING_QUADS, LASH_QUADS); expected->lids = false; break;
        case 6: s.hippus = 0; expected->pupil = 0.5f * es_pupil_mean(bright); break;
        case 7: s.pupil = 0; expected->pupil = 0; break;
        case 8: s.accommodation = 0; break;
        case 9: s.saccades = 0; break;
        case 10: s.squint = 0; break;
        default: s.seed = 1; break;
        }
        shapes_at without = shapes_of(s, time, bright);
        assert_true(without.version != all.version);
        if (which < 6) assert_true(same_shapes(expected, without.shapes));
        if (which == 6) {
            assert_near((double)without.shapes->pupil, (double)expected->pupil, 1e-4);
            expected->pupil = without.shapes->pupil;
            assert_true(same_shapes(expected, without.shapes));
        }
        if (which == 7) {
            assert_true(without.shapes->pupil == 0);
            /* the accommodation's power goes with the pupil: the lens may move otherwise, the rest does not */
            assert_memory_equal(expected->discs, without.shapes->discs, ES_CORNEA_PARTICLES * sizeof(es_eye_disc));
        }
        if (which == 8) { /* lens and gratings alone */
            assert_true(memcmp(expected->discs + ES_CORNEA_PARTICLES, without.shapes->discs + ES_CORNEA_PARTICLES, ES_LENS_PARTICLES * sizeof(es_eye_disc)) != 0);
            assert_true(memcmp(expected->quads, without.shapes->quads, GRATING_QUADS * sizeof(es_eye_quad)) != 0);
            memcpy(expected->discs + ES_CORNEA_PARTICLES, without.shapes->discs + ES_CORNEA_PARTICLES, ES_LENS_PARTICLES * sizeof(es_eye_disc));
            memcpy(expected->quads, without.shapes->quads, GRATING_QUADS * sizeof(es_eye_quad));
            assert_true(same_shapes(expected, without.shapes));
        }
        if (which == 9) { /* the vitreous humour alone */
            const uint32_t first = ES_CORNEA_PARTICLES + ES_LENS_PARTICLES;
            assert_true(memcmp(expected->discs + first, without.shapes->discs + first, ES_VITREOUS_PARTICLES * sizeof(es_eye_disc)) != 0);
            memcpy(expected->discs + first, without.shapes->discs + first, ES_VITREOUS_PARTICLES * sizeof(es_eye_disc));
            assert_true(same_shapes(expected, without.shapes));
        }
        if (which == 10) {
            assert_true(without.shapes->upper > expected->upper && without.shapes->lower < expected->lower);
            assert_memory_equal(expected->discs, without.shapes->discs, expected->disc_count * sizeof(es_eye_disc));
        }
        free(all.shapes);
        free(without.shapes);
    }
    /* blinking: over ten seconds some frames differ, and only in their lids */
    int differ = 0;
    static es_eye eye, unblinking;
    es_eye_subject s = usual();
    const es_eye_subject with = s;
    s.blink = false;
    for (int i = 0; i < 600; i++) {
        es_eye_advance(&eye, &with, i / 60.0, 1);
        es_eye_advance(&unblinking, &s, i / 60.0, 1);
        assert_true(unblinking.lids.shut == 0);
        assert_true(eye.pupil == unblinking.pupil);
        assert_memory_equal(&eye.lens, &unblinking.lens, sizeof eye.lens);
        differ += eye.lids.shut != 0;
    }
    assert_true(differ >= 15 && differ < 120);
}

/* Nothing that moves: nothing changes, and the version says so. */
static void test_still(void** state)
{
    (void)state;
    static es_eye eye;
    es_eye_subject s = usual();
    s.hippus = s.accommodation = s.saccades = 0;
    s.blink = false;
    es_eye_advance(&eye, &s, 10, 5);
    const uint64_t version = es_eye_version(&eye);
    for (int i = 1; i < 100; i++) {
        es_eye_advance(&eye, &s, 10 + i / 24.0, 5);
        assert_true(es_eye_version(&eye) == version);
    }
    /* it gets used to another luminance, and then stands again */
    es_eye_advance(&eye, &s, 15, 50);
    assert_true(es_eye_version(&eye) != version);
    for (int i = 0; i < 100; i++) es_eye_advance(&eye, &s, 15 + i, 50);
    const uint64_t used = es_eye_version(&eye);
    es_eye_advance(&eye, &s, 115, 50);
    assert_true(es_eye_version(&eye) == used);
    assert_near((double)eye.pupil, (double)es_pupil_mean(50), 1e-4);
    /* and so it does after a bright one */
    for (int i = 0; i < 100; i++) es_eye_advance(&eye, &s, 115 + i, 5);
    assert_true(es_eye_version(&eye) == version);
    /* time that stands moves nothing, alive or not */
    const es_eye_subject alive = usual();
    es_eye_advance(&eye, &alive, 200, 5);
    const uint64_t held = es_eye_version(&eye);
    es_eye_advance(&eye, &alive, 200, 5);
    assert_true(es_eye_version(&eye) == held);
    es_eye_advance(&eye, &alive, 200.02, 5);
    assert_true(es_eye_version(&eye) != held);
}

static void test_time(void** state)
{
    (void)state;
    static es_eye a, b;
    const es_eye_subject s = usual();
    /* however it is cut into frames */
    es_eye_advance(&a, &s, 1, 2);
    es_eye_advance(&b, &s, 1, 2);
    es_eye_advance(&a, &s, 4, 20);
    double time = 1;
    for (uint32_t i = 0; time < 4; i++) {
        time = fmin(4, time + 0.05 * (double)es_random_float(1, i));
        es_eye_advance(&b, &s, time, 20);
    }
    assert_memory_equal(&a, &b, sizeof a);
    /* sums of times in float come to the same as their exact values */
    memset(&a, 0, sizeof a);
    memset(&b, 0, sizeof b);
    double sum = 0;
    for (int i = 0; i <= 600; i++) {
        es_eye_advance(&a, &s, sum, 1);
        es_eye_advance(&b, &s, i / 60.0, 1);
        assert_true(es_eye_version(&a) == es_eye_version(&b));
        sum += (double)(1.0f / 60);
    }
    /* a world restored, a day later: as an eye that begins there */
    static const double times[] = {3, 3.5, 86403.5, 0, -1e9, 1e300, INFINITY, -INFINITY, NAN, 50};
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        es_eye_advance(&a, &s, times[i], 7);
        memset(&b, 0, sizeof b);
        es_eye_advance(&b, &s, times[i], 7);
        if (i != 1) assert_true(es_eye_version(&a) == es_eye_version(&b));
        assert_true(a.pupil > 0 && a.pupil <= 9);
    }
}

static void test_any_luminance(void** state)
{
    (void)state;
    static es_eye eye;
    static es_eye_shapes shapes;
    static const float luminances[] = {0, -1, NAN, INFINITY, -INFINITY, 1e-38f, 1e38f, 1e6f};
    static const float pupils[] = {-1, 0, 0.01f, 9};
    for (int p = 0; p < 4; p++)
        for (int i = 0; i < 8; i++) {
            es_eye_subject s = usual();
            s.pupil = pupils[p];
            s.hippus = 1;
            s.accommodation = s.saccades = 20;
            s.squint = 1.2f;
            for (int k = 0; k < 60; k++) es_eye_advance(&eye, &s, i + k / 60.0, luminances[(i + k / 30) % 8]);
            es_eye_get_shapes(&eye, &shapes);
            assert_true(shapes.pupil >= 0 && shapes.pupil <= 4.5f);
            assert_true(p != 1 || shapes.pupil == 0);
            assert_true(p != 3 || shapes.pupil == 4.5f);
            for (uint32_t k = 0; k < shapes.disc_count; k++) assert_true(isfinite(shapes.discs[k].x) && isfinite(shapes.discs[k].y) && fabsf(shapes.discs[k].x) < 100);
            for (uint32_t k = 0; k < shapes.quad_count; k++)
                for (int c = 0; c < 4; c++) assert_true(isfinite(shapes.quads[k].corner[c].x) && isfinite(shapes.quads[k].corner[c].y));
            assert_true(shapes.upper > shapes.lower);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_pupil),
        unit_test_without_races(test_value_noise),
        unit_test_without_races(test_accommodation),
        unit_test_without_races(test_lens_springs),
        unit_test_without_races(test_vitreous),
        unit_test_without_races(test_lids),
        unit_test_without_races(test_shares),
        unit_test_without_races(test_switches),
        unit_test_without_races(test_still),
        unit_test_without_races(test_time),
        unit_test_without_races(test_any_luminance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
