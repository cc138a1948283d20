#include "gi/glare/glare_pass.h"

#include <string.h>

#include "gi/renderer.h"
#include "platform/maths.h"
#include "platform/random.h"

static void free_cycle(es_context* context, es_glare* g)
{
    for (uint32_t i = 0; i < g->cycle_count; i++) es_glare_spectrum_free(context, &g->cycle[i].spectrum);
    es_release(context, g->cycle, g->cycle_count * sizeof *g->cycle);
    g->cycle = NULL;
    g->cycle_count = 0;
    if (g->current != &g->spectrum) g->current = NULL;
}

void es_glare_free_planes(es_context* context, es_glare* g)
{
    es_planes_free(context, &g->picture);
    es_glare_convolution_free(context, &g->convolution);
    es_glare_billboards_free(context, &g->billboards);
}

void es_glare_free(es_context* context, es_glare* g)
{
    es_glare_free_planes(context, g);
    free_cycle(context, g);
    es_aperture_free(context, &g->aperture);
    es_diffraction_free(context, &g->diffraction);
    es_chromatic_blur_free(context, &g->blur);
    es_glare_spectrum_free(context, &g->spectrum);
    *g = (es_glare){0};
}

/* ---- the eye's spectrum ------------------------------------------------------------------------------------------------------------------ */

static es_result draw_aperture(es_renderer* r, const es_eye* eye)
{
    const es_renderer_settings* s = &r->settings;
    return es_aperture_draw(r->context, eye, s->glare_size, s->glare_width * 1e-3f, s->glare_supersample, &r->glare.aperture);
}

static es_result make_spectrum(es_renderer* r, es_glare_spectrum* spectrum)
{
    const es_renderer_settings* s = &r->settings;
    es_glare* g = &r->glare;
    const uint32_t width = r->gbuffer.width, height = r->gbuffer.height;
    es_result result = es_diffraction_update(r->context, &g->aperture, s->glare_defocus, &g->diffraction);
    if (!result) es_diffraction_fade(r->context, &g->diffraction);
    const float pixel = s->glare_field * (ES_PI / 180.0f) / (float)width;
    if (!result) result = es_chromatic_blur_prepare(r->context, &g->diffraction, pixel, s->glare_wavelengths, width - 1, height - 1, &g->blur);
    if (!result) result = es_glare_spectrum_update(r->context, &g->diffraction, &g->blur, spectrum);
    return result;
}

/* What a spectrum depends on but the aperture. */
static void reads_spectrum_settings(es_plan* plan, const es_renderer* r)
{
    const es_renderer_settings* s = &r->settings;
    const uint32_t words[] = {s->glare_wavelengths, r->gbuffer.width, r->gbuffer.height, s->glare == ES_GLARE_CONVOLUTION};
    const float numbers[] = {s->glare_defocus, s->glare_field};
    es_plan_reads(plan, words, sizeof words);
    es_plan_reads(plan, numbers, sizeof numbers);
}

static es_result take_spectrum(es_renderer* r, const es_glare_spectrum* spectrum)
{
    es_glare* g = &r->glare;
    g->current = spectrum;
    if (r->settings.glare == ES_GLARE_CONVOLUTION) return es_glare_convolution_take(r->context, spectrum, r->gbuffer.width, r->gbuffer.height, &g->convolution);
    es_glare_convolution_free(r->context, &g->convolution);
    return ES_OK;
}

/* Each frame its own. */
static es_result pass_living_eye(es_renderer* r, double time)
{
    es_plan* plan = &r->plan;
    es_glare* g = &r->glare;
    const es_renderer_settings* s = &r->settings;
    free_cycle(r->context, g);
    const es_eye_subject subject = es_eye_subject_of(s);
    es_plan_begin(plan, ES_PASS_APERTURE);
    es_eye_advance(&g->eye, &subject, time, r->metered.luminance);
    const uint64_t version = es_eye_version(&g->eye);
    const uint32_t words[] = {s->glare_size, s->glare_supersample};
    es_plan_reads(plan, &version, sizeof version);
    es_plan_reads(plan, words, sizeof words);
    es_plan_reads(plan, &s->glare_width, sizeof s->glare_width);
    if (es_plan_run(plan, ES_PASS_APERTURE)) {
        es_result result = draw_aperture(r, &g->eye);
        if (result) return result;
        es_plan_done(plan, ES_PASS_APERTURE, (uint64_t)s->glare_size * s->glare_size);
    }
    es_plan_begin(plan, ES_PASS_GLARE_SPECTRUM);
    es_plan_reads_pass(plan, ES_PASS_APERTURE);
    reads_spectrum_settings(plan, r);
    if (!es_plan_run(plan, ES_PASS_GLARE_SPECTRUM)) return ES_OK;
    es_result result = make_spectrum(r, &g->spectrum);
    if (!result) result = take_spectrum(r, &g->spectrum);
    if (!result) es_plan_done(plan, ES_PASS_GLARE_SPECTRUM, (uint64_t)s->glare_size * s->glare_size);
    return result;
}

/* Which of a cycle's moments it is: there and back again. */
static uint32_t moment_of(double time, uint32_t count)
{
    const int64_t period = count > 1 ? 2 * ((int64_t)count - 1) : 1, each = ES_GRID_RATE / ES_GLARE_CYCLE_RATE, step = es_grid_step(time);
    const int64_t within = (((step - (step % each + each) % each) / each) % period + period) % period;
    return (uint32_t)(within < (int64_t)count ? within : period - within);
}

static es_result pass_cycle(es_renderer* r, double time)
{
    es_plan* plan = &r->plan;
    es_glare* g = &r->glare;
    const es_renderer_settings* s = &r->settings;
    if (g->cycle_count != s->glare_cycle) {
        free_cycle(r->context, g);
        g->cycle = es_allocate_zero(r->context, s->glare_cycle * sizeof *g->cycle);
        if (!g->cycle) return es_context_last_result(r->context);
        g->cycle_count = s->glare_cycle;
    }
    es_plan_not_needed(plan, ES_PASS_APERTURE, "of the cycle");
    const uint32_t moment = moment_of(time, s->glare_cycle);
    const es_eye_subject subject = es_eye_subject_of(s);
    const uint32_t words[] = {s->glare_size, s->glare_supersample, s->glare_wavelengths, r->gbuffer.width, r->gbuffer.height};
    const float numbers[] = {s->glare_width, s->glare_defocus, s->glare_field};
    const float strengths[] = {subject.pupil, subject.hippus, subject.accommodation, subject.saccades, subject.squint};
    const uint32_t parts[] = {subject.seed, subject.cornea, subject.lens, subject.gratings, subject.vitreous, subject.lids, subject.lashes, subject.blink};
    uint64_t settings = es_hash_bytes(1, strengths, sizeof strengths);
    settings = es_hash_bytes(settings, parts, sizeof parts);
    settings = es_hash_bytes(settings, words, sizeof words);
    settings = es_hash_bytes(settings, numbers, sizeof numbers) | 1; /* 0: not made */
    es_plan_begin(plan, ES_PASS_GLARE_SPECTRUM);
    es_plan_reads(plan, &settings, sizeof settings);
    es_plan_reads(plan, &moment, sizeof moment);
    es_plan_reads(plan, &s->glare_cycle, sizeof s->glare_cycle); /* another length starts without spectra */
    reads_spectrum_settings(plan, r);
    if (!es_plan_run(plan, ES_PASS_GLARE_SPECTRUM)) return ES_OK;
    es_glare_moment* m = &g->cycle[moment];
    es_result result = ES_OK;
    if (m->made_with != settings) {
        memset(&g->moment, 0, sizeof g->moment);
        es_eye_advance(&g->moment, &subject, (double)moment / ES_GLARE_CYCLE_RATE, r->metered.luminance);
        m->made_with = 0;
        result = draw_aperture(r, &g->moment);
        if (!result) result = make_spectrum(r, &m->spectrum);
        if (!result) m->made_with = settings;
    }
    if (!result) result = take_spectrum(r, &m->spectrum);
    if (!result) es_plan_done(plan, ES_PASS_GLARE_SPECTRUM, (uint64_t)s->glare_size * s->glare_size);
    return result;
}

/* ---- the picture ------------------------------------------------------------------------------------------------------------------------- */

static es_result pass_picture(es_renderer* r)
{
    es_plan* plan = &r->plan;
    es_glare* g = &r->glare;
    const es_renderer_settings* s = &r->settings;
    es_plan_begin(plan, ES_PASS_GLARE);
    es_plan_reads_pass(plan, ES_PASS_RADIANCE);
    es_plan_reads_pass(plan, ES_PASS_ANTIALIAS);
    es_plan_reads_pass(plan, ES_PASS_GLARE_SPECTRUM);
    const uint32_t words[] = {s->glare, s->glare_billboards};
    es_plan_reads(plan, words, sizeof words);
    es_plan_reads(plan, &s->glare_threshold, sizeof s->glare_threshold);
    if (!es_plan_run(plan, ES_PASS_GLARE)) return ES_OK;
    es_result result = es_planes_resize(r->context, &g->picture, &r->gbuffer);
    if (result) return result;
    const es_compose_job job = es_renderer_compose_job(r);
    if (s->glare == ES_GLARE_CONVOLUTION) es_glare_convolve(r->context, &g->convolution, job.finished, g->picture.at, r->gbuffer.stride);
    else result = es_glare_add_billboards(r->context, g->current, s->glare_threshold, s->glare_billboards, job.finished, g->picture.at, r->gbuffer.width, r->gbuffer.height, r->gbuffer.stride, &g->billboards);
    if (!result) es_plan_done(plan, ES_PASS_GLARE, s->glare == ES_GLARE_CONVOLUTION ? (uint64_t)r->gbuffer.width * r->gbuffer.height : g->billboards.count);
    return result;
}

es_result es_pass_glare(es_renderer* r, double time)
{
    es_plan* plan = &r->plan;
    if (r->settings.glare == ES_GLARE_OFF) {
        es_plan_not_needed(plan, ES_PASS_APERTURE, "glare is off");
        es_plan_not_needed(plan, ES_PASS_GLARE_SPECTRUM, "glare is off");
        es_plan_not_needed(plan, ES_PASS_GLARE, "glare is off");
        es_glare_free(r->context, &r->glare);
        return ES_OK;
    }
    const es_result result = r->settings.glare_cycle ? pass_cycle(r, time) : pass_living_eye(r, time);
    return result ? result : pass_picture(r);
}

void es_glare_compose(const es_renderer* r, es_compose_job* job)
{
    if (!r->plan.valid[ES_PASS_GLARE]) return;
    for (int k = 0; k < 3; k++) job->finished[k] = r->glare.picture.at[k];
}
