/* --record and --replay: what happened to a world, kept in a file, and done again with every step compared. */
#include "demo.h"
#include "player_nodes.h"

#include <inttypes.h>
#include <string.h>

/* First word of a recording's settings that was made in the window: there are nodes of the player's in its world. */
static const char window_word[] = "window";

bool demo_recorded_in_window(const es_recording* recording)
{
    const char* settings = es_recording_settings(recording);
    size_t length = strlen(window_word);
    return !strncmp(settings, window_word, length) && (settings[length] == ' ' || !settings[length]);
}

int demo_record_begin(demo_session* session, const char* scene, bool window)
{
    demo_text settings = {0};
    es_world_settings world = es_world_get_settings(session->world);
    demo_text_add(&settings, "%s", window ? window_word : "");
    demo_text_add_settings(&settings, &world, &session->settings);
    int code = settings.failed ? demo_refuse("out of memory") : DEMO_OK;
    if (code == DEMO_OK && es_recording_begin(session->world, scene, settings.bytes ? settings.bytes : "", &session->recording) != ES_OK)
        code = demo_refuse_context(session->context);
    demo_text_free(&settings);
    return code;
}

int demo_record_end(demo_session* session, const char* path)
{
    if (!session->recording) return DEMO_OK;
    es_recording_end(session->recording);
    int code = es_recording_save(session->recording, path) == ES_OK ? DEMO_OK : demo_refuse_context(session->context);
    if (code == DEMO_OK) fprintf(stderr, "earthshine: %u steps recorded: %s\n", es_recording_steps(session->recording), path);
    es_recording_destroy(session->recording);
    session->recording = NULL;
    return code;
}

int demo_replay_load(demo_session* session, demo_options* options)
{
    es_recording* recording;
    if (es_recording_load(session->context, options->replay, &recording) != ES_OK) return demo_refuse_context(session->context);
    session->replay = recording;
    const char* scene = es_recording_scene(recording);
    if (options->scene && strcmp(options->scene, scene) != 0) return demo_refuse("--replay %s: is a recording of %s, not of %s", options->replay, scene, options->scene);
    options->scene = scene;
    options->recorded_settings = es_recording_settings(recording) + (demo_recorded_in_window(recording) ? strlen(window_word) : 0);
    return DEMO_OK;
}

int demo_replay_begin(demo_session* session)
{
    player_nodes nodes;
    if (demo_recorded_in_window(session->replay) && player_nodes_add(session->world, &nodes) != DEMO_OK) return demo_refuse_context(session->context);
    return es_recording_rewind(session->replay, session->world) == ES_OK ? DEMO_OK : demo_refuse_context(session->context);
}

static const char* kind_name(es_object_kind kind)
{
    switch (kind) {
    case ES_OBJECT_MESH: return "mesh";
    case ES_OBJECT_NODE: return "node";
    case ES_OBJECT_INSTANCE: return "instance";
    case ES_OBJECT_CAMERA: return "camera";
    case ES_OBJECT_LIGHT: return "light";
    case ES_OBJECT_CLIP: return "clip";
    case ES_OBJECT_BODY: return "body";
    case ES_OBJECT_JOINT: return "joint";
    case ES_OBJECT_SOFT: return "soft body";
    case ES_OBJECT_MOVER: return "mover";
    case ES_OBJECT_REGION: return "region";
    case ES_OBJECT_CONSTRAINT: return "constraint";
    default: return "object";
    }
}

static void describe_divergence(const es_world* world, const es_divergence* d, char* text, size_t size)
{
    if (d->kind == ES_OBJECT_KINDS) {
        snprintf(text, size, "differs at step %u, in time, settings or which objects there are", d->step);
        return;
    }
    const char* name = es_world_name(world, d->kind, d->id);
    snprintf(text, size, "differs at step %u, first in %s %u%s%s", d->step, kind_name(d->kind), d->id, name && name[0] ? ", " : "", name ? name : "");
}

int demo_replay_step(demo_session* session, uint32_t step)
{
    es_divergence divergence = {0};
    if (es_recording_replay(session->replay, step, session->world, &divergence) != ES_OK) return demo_refuse_context(session->context);
    if (!divergence.differs) return DEMO_OK;
    describe_divergence(session->world, &divergence, session->difference, sizeof session->difference);
    fprintf(stderr, "earthshine: the replay %s\n", session->difference);
    return DEMO_EXCEEDED;
}
