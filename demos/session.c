/* A world and a renderer in one context, opened as the options say, and stepped frame by frame. */
#include "demo.h"

#include <string.h>

int demo_session_open_context(const demo_options* options, demo_session* session)
{
    *session = (demo_session){0};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    desc.isa_mask = options->isa_mask;
    es_result result = es_context_create(&desc, &session->context);
    return result == ES_OK ? DEMO_OK : demo_refuse("%s", es_result_text(result));
}

es_result demo_open_world(es_context* context, const demo_options* options, const char* scene, const es_world_settings* settings, es_world** world)
{
    es_result result = es_world_open(context, scene, settings, world);
    if (result != ES_OK) return result;
    if (options->environment) {
        const float factor = (float)options->environment_intensity;
        es_environment_desc desc = {.radiance = {factor, factor, factor}, .rotation = (float)options->environment_rotation};
        result = es_world_load_environment(*world, options->environment, &desc);
    }
    const bool asked_for = !options->scene || !strcmp(scene, options->scene); /* the player opens others later */
    if (result == ES_OK && options->edits && asked_for) result = es_world_load_edits(*world, options->edits);
    if (result == ES_OK) return ES_OK;
    es_world_destroy(*world);
    *world = NULL;
    return result;
}

int demo_session_open(const demo_options* given, demo_session* session)
{
    demo_options options_in_use = *given, *options = &options_in_use;
    int code = demo_session_open_context(options, session);
    if (code != DEMO_OK) return code;
    es_world_settings world_settings;
    if (options->replay) code = demo_replay_load(session, options);
    if (code == DEMO_OK) code = demo_apply_settings(session->context, options, &world_settings, &session->settings, NULL);
    if (code == DEMO_OK && demo_open_world(session->context, options, options->scene, &world_settings, &session->world) != ES_OK)
        code = demo_refuse_context(session->context);
    if (code == DEMO_OK && es_renderer_create(session->context, &session->settings, &session->renderer) != ES_OK)
        code = demo_refuse_context(session->context);
    if (code == DEMO_OK && options->replay) code = demo_replay_begin(session);
    if (code == DEMO_OK && options->record) code = demo_record_begin(session, options->scene, false);
    if (code != DEMO_OK) demo_session_close(session);
    return code;
}

void demo_session_close(demo_session* session)
{
    es_recording_destroy(session->recording);
    es_recording_destroy(session->replay);
    if (session->renderer) es_renderer_destroy(session->renderer);
    if (session->world) es_world_destroy(session->world);
    if (session->context) es_context_destroy(session->context);
    *session = (demo_session){0};
}

int demo_session_step(demo_session* session, uint32_t frame, double fps)
{
    if (session->replay) return demo_replay_step(session, frame);
    float dt = frame ? (float)(1.0 / fps) : 0.0f; /* frame 0 is the world as it was made */
    return es_world_step(session->world, dt) == ES_OK ? DEMO_OK : demo_refuse_context(session->context);
}
