/* The passes of anti-aliasing: where a frame's pixels are sampled, and how its pictures become one (gi/antialias.h). */
#include "gi/renderer.h"
#include "platform/maths.h"

uint32_t es_antialias_pictures(const es_renderer_settings* settings) { return settings->antialias == ES_ANTIALIAS_SUPERSAMPLE ? settings->antialias_samples : 1; }

void es_antialias_aim(es_renderer* r, uint32_t picture)
{
    es_history* h = &r->history;
    const es_renderer_settings* s = &r->settings;
    if (s->antialias == ES_ANTIALIAS_NONE) return;
    if (s->antialias == ES_ANTIALIAS_TEMPORAL && !h->settled) h->place = h->continuous ? (h->place + 1) % s->antialias_samples : 0;
    if (s->antialias == ES_ANTIALIAS_SUPERSAMPLE) h->place = picture;
    if (picture) { /* of the same moment as the one before */
        h->moving = false;
        h->view.previous_view = h->view.view;
        h->view.previous_projection = h->view.projection;
    }
    r->view = h->view;
    float place[2];
    es_antialias_place(h->place, place);
    es_antialias_jitter(&r->view, place);
}

static es_result resolve(es_renderer* r, uint32_t picture)
{
    es_history* h = &r->history;
    const es_renderer_settings* s = &r->settings;
    const bool over_frames = s->antialias == ES_ANTIALIAS_TEMPORAL;
    const uint32_t from = h->current_picture, to = 1 - from;
    es_result result = es_planes_resize(r->context, &h->fresh, &r->gbuffer);
    if (!result) result = es_planes_resize(r->context, &h->picture[to], &r->gbuffer);
    if (result) return result;
    es_compose_job compose = es_renderer_compose_job(r);
    for (int k = 0; k < 3; k++) {
        compose.finished[k] = NULL;
        compose.radiance[k] = h->fresh.at[k];
    }
    es_antialias_job job = {.gbuffer = &r->gbuffer, .compose = &compose, .moving = h->moving, .clamp = over_frames && h->still < ES_ANTIALIAS_STILL, .exposure_scale = es_exp2(s->exposure)};
    job.blend = over_frames ? 1.0f / (1.0f / s->antialias_blend + (float)h->still) : 1.0f / (1.0f + (float)picture);
    const bool goes_on = over_frames ? h->continuous && h->has_picture : picture > 0;
    for (int k = 0; k < 3; k++) {
        job.source[k] = h->fresh.at[k];
        if (goes_on) job.history[k] = h->picture[from].at[k];
        job.result[k] = h->picture[to].at[k];
    }
    es_antialias_resolve(r->context, &job);
    h->current_picture = to;
    h->has_picture = true;
    return ES_OK;
}

es_result es_pass_antialias(es_renderer* r, uint32_t picture)
{
    es_plan* plan = &r->plan;
    es_history* h = &r->history;
    const es_renderer_settings* s = &r->settings;
    if (s->antialias == ES_ANTIALIAS_NONE) {
        es_plan_not_needed(plan, ES_PASS_ANTIALIAS, "antialias is none");
        h->has_picture = false;
        return ES_OK;
    }
    /* what has settled over frames is no function of this frame: it is kept, whether work is skipped or not */
    if (s->antialias == ES_ANTIALIAS_TEMPORAL && h->settled && plan->valid[ES_PASS_ANTIALIAS]) {
        plan->stats[ES_PASS_ANTIALIAS].skipped = "the picture has settled";
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_ANTIALIAS);
    const uint64_t words[] = {r->frames, picture};
    es_plan_reads(plan, words, sizeof words);
    if (!es_plan_run(plan, ES_PASS_ANTIALIAS)) return ES_OK;
    es_result result = resolve(r, picture);
    if (!result) es_plan_done(plan, ES_PASS_ANTIALIAS, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    return result;
}
