#include "gi/glare/eye.h"

#include <string.h>

#include "gi/glare/pupil.h"
#include "gi/glare/value_noise.h"
#include "platform/maths.h"
#include "platform/random.h"

/* mm: the hippus of a narrower one is no faster, nor does its phase leave what counts its steps */
#define LEAST_PUPIL 1e-3f

enum { BEFORE = 2 * ES_GRID_RATE }; /* steps from rest to the first time that is asked for */
static const float field_seconds = 0.5f; /* towards brighter; the pupil itself takes as long */

/* Seeds of the parts: each has its own, so that one without another is what it is with it. */
typedef enum part { CORNEA = 1, LENS, VITREOUS, LASHES, BLINK, SACCADES, HIPPUS, ACCOMMODATION } part;
static uint32_t seed_of(const es_eye* eye, part p) { return es_hash_u32(eye->subject.seed * 16 + (uint32_t)p); }

es_eye_subject es_eye_subject_of(const es_renderer_settings* s)
{
    return (es_eye_subject){.seed = s->glare_seed, .pupil = s->glare_pupil, .hippus = s->glare_hippus, .accommodation = s->glare_accommodation, .saccades = s->glare_saccades, .squint = s->glare_squint,
        .cornea = s->glare_cornea, .lens = s->glare_lens, .gratings = s->glare_gratings, .vitreous = s->glare_vitreous, .lids = s->glare_lids, .lashes = s->glare_lashes, .blink = s->glare_blink};
}

/* Flat cells: static, large, and few and far between (§8.2.1), uniform over the widest pupil. */
static void begin_cornea(es_eye* eye)
{
    const uint32_t seed = seed_of(eye, CORNEA);
    uint32_t counter = 0;
    for (uint32_t i = 0; i < ES_CORNEA_PARTICLES; i++) {
        const float radius = 0.5f * ES_PUPIL_MAX * es_sqrt(es_random_float(seed, counter++));
        float sine, cosine;
        es_sincos(2 * ES_PI * es_random_float(seed, counter++), &sine, &cosine);
        eye->cornea[i] = (es_eye_disc){radius * cosine, radius * sine, 0.035f + 0.040f * es_random_float(seed, counter++)};
    }
}

static float mean_pupil(const es_eye* eye) { return eye->subject.pupil >= 0 ? es_minf(eye->subject.pupil, ES_PUPIL_MAX) : es_pupil_mean(es_adaptation_value(&eye->field)); }

/* From rest, in the subject's own time: whatever follows from the time alone is set by the first step. */
static void begin(es_eye* eye, int64_t step)
{
    const es_eye_subject subject = eye->subject;
    memset(eye, 0, sizeof *eye);
    eye->subject = subject;
    eye->grid = (es_step_grid){true, step};
    begin_cornea(eye);
    es_lens_begin(&eye->lens, seed_of(eye, LENS));
    es_vitreous_begin(&eye->vitreous, seed_of(eye, VITREOUS));
    es_lids_begin(&eye->lids, seed_of(eye, LASHES));
}

static void set_pupil_and_lids(es_eye* eye, float mean)
{
    const es_eye_subject* s = &eye->subject;
    eye->pupil = es_pupil_hippus(mean, s->hippus > 0 ? s->hippus * es_value_noise(seed_of(eye, HIPPUS), eye->phase, 3) : 0);
    const float blink = s->blink ? es_blink(seed_of(eye, BLINK), eye->grid.step) : 0;
    eye->lids.shut = s->lids ? es_shut_both(blink, es_minf(s->squint, 1.2f) * es_squint(es_adaptation_value(&eye->field))) : 0;
}

static void step(es_eye* eye, double target)
{
    const es_eye_subject* s = &eye->subject;
    const float dt = 1.0f / ES_GRID_RATE;
    eye->grid.step++;
    es_adaptation_step(&eye->field, target, field_seconds, dt);
    const float mean = mean_pupil(eye);
    /* eq. 8.1 has noise(t / p); where p changes it is the rate that does, or a long time's phase would leap */
    if (mean > 0) eye->phase += (double)dt / (double)es_maxf(mean, LEAST_PUPIL);
    if (s->accommodation > 0 && (s->lens || s->gratings)) es_lens_step(&eye->lens, s->accommodation * es_lens_accommodation(seed_of(eye, ACCOMMODATION), es_grid_time(eye->grid.step), mean));
    if (s->vitreous) es_vitreous_step(&eye->vitreous, seed_of(eye, SACCADES), eye->grid.step, s->saccades);
    set_pupil_and_lids(eye, mean);
}

static bool same_subject(const es_eye_subject* a, const es_eye_subject* b)
{
    return a->seed == b->seed && a->pupil == b->pupil && a->hippus == b->hippus && a->accommodation == b->accommodation && a->saccades == b->saccades && a->squint == b->squint && a->cornea == b->cornea
        && a->lens == b->lens && a->gratings == b->gratings && a->vitreous == b->vitreous && a->lids == b->lids && a->lashes == b->lashes && a->blink == b->blink;
}

void es_eye_advance(es_eye* eye, const es_eye_subject* subject, double time, float luminance)
{
    const int64_t to = es_grid_step(time);
    const double target = es_adaptation_level(luminance);
    int64_t steps = same_subject(&eye->subject, subject) ? es_grid_steps(&eye->grid, to) : -1;
    if (steps < 0) {
        eye->subject = *subject;
        begin(eye, to - BEFORE);
        es_adaptation_step(&eye->field, target, 0, 0);
        const float mean = mean_pupil(eye);
        eye->phase = mean > 0 ? es_grid_time(eye->grid.step) / (double)es_maxf(mean, LEAST_PUPIL) : 0;
        steps = BEFORE;
    }
    for (int64_t i = 0; i < steps; i++) step(eye, target);
}

uint64_t es_eye_version(const es_eye* eye)
{
    const es_eye_subject* s = &eye->subject;
    const uint32_t parts[] = {s->seed, s->cornea, s->lens, s->gratings, s->vitreous, s->lids, s->lashes};
    uint64_t hash = es_hash_bytes(0, parts, sizeof parts);
    hash = es_hash_bytes(hash, &eye->pupil, sizeof eye->pupil);
    hash = es_hash_bytes(hash, &eye->lids.shut, sizeof eye->lids.shut);
    hash = es_hash_bytes(hash, eye->lens.moved, sizeof eye->lens.moved);
    return es_hash_bytes(hash, eye->vitreous.angle, sizeof eye->vitreous.angle);
}

void es_eye_get_shapes(const es_eye* eye, es_eye_shapes* shapes)
{
    const es_eye_subject* s = &eye->subject;
    shapes->pupil = 0.5f * eye->pupil;
    shapes->lids = false;
    shapes->disc_count = shapes->quad_count = 0;
    if (s->cornea)
        for (uint32_t i = 0; i < ES_CORNEA_PARTICLES; i++) es_eye_add_disc(shapes, eye->cornea[i].x, eye->cornea[i].y, eye->cornea[i].radius);
    if (s->lens) es_lens_add_particles(&eye->lens, shapes);
    if (s->gratings) es_lens_add_gratings(&eye->lens, shapes);
    if (s->vitreous) es_vitreous_add_particles(&eye->vitreous, shapes);
    if (s->lids) es_lids_add(&eye->lids, s->lashes, shapes);
}
