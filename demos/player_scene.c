/* Scenes opened and closed while the window stays. */
#include "player.h"

#include <string.h>

/* What is shown on the way: world, renderer, the camera that flies, nodes for lights that are dragged. */
static int open_parts(player* p, demo_session* fresh, const char* scene, const es_world_settings* world, const es_renderer_settings* renderer)
{
    fresh->context = p->session.context;
    fresh->settings = *renderer;
    if (demo_open_world(fresh->context, &p->options, scene, world, &fresh->world) != ES_OK) return DEMO_BAD_INPUT;
    return es_renderer_create(fresh->context, renderer, &fresh->renderer) == ES_OK ? DEMO_OK : DEMO_BAD_INPUT;
}

static void close_parts(demo_session* session)
{
    if (session->renderer) es_renderer_destroy(session->renderer);
    if (session->world) es_world_destroy(session->world);
    session->renderer = NULL;
    session->world = NULL;
}

int player_open_scene(player* p, const char* scene, bool keep)
{
    bool first = !p->session.world;
    es_world_settings world = p->world;
    es_renderer_settings renderer = p->session.settings;
    if (!keep || first) {
        demo_options options = p->options;
        options.scene = scene;
        if (demo_apply_settings(p->session.context, &options, &world, &renderer, NULL) != DEMO_OK) return DEMO_BAD_INPUT;
        if (!first) renderer.width = p->session.settings.width, renderer.height = p->session.settings.height;
    }
    demo_session fresh = {0};
    if (open_parts(p, &fresh, scene, &world, &renderer) != DEMO_OK) {
        close_parts(&fresh);
        return first ? demo_refuse_context(p->session.context) : DEMO_BAD_INPUT;
    }
    player_close_scene(p);
    p->session.world = fresh.world;
    p->session.renderer = fresh.renderer;
    p->session.settings = renderer;
    p->world = p->opened = world;
    p->split.former = renderer;
    if (p->scene != scene) snprintf(p->scene, sizeof p->scene, "%s", scene);
    if (player_nodes_add(p->session.world, &p->nodes) != DEMO_OK) return demo_refuse_context(p->session.context);
    if (first && p->options.record && demo_record_begin(&p->session, p->scene, true) != DEMO_OK) return DEMO_BAD_INPUT;
    if (first && p->session.replay) {
        if (es_recording_rewind(p->session.replay, p->session.world) != ES_OK) return demo_refuse_context(p->session.context);
        p->replaying = true;
    }
    history_add(&p->history, p->session.world);
    if (p->window) player_open_title(p);
    return DEMO_OK;
}

void player_open_title(player* p)
{
    char title[256];
    snprintf(title, sizeof title, "Earthshine: %.200s", p->scene);
    es_window_set_title(p->window, title);
}

void player_end_replay(player* p, const char* why)
{
    if (!p->replaying) return;
    p->replaying = false;
    player_release(p);
    fly_camera_adopt(&p->nodes.fly, p->session.world);
    p->world = es_world_get_settings(p->session.world);
    player_notice(p, "the replay %s after %u steps; from here on it is yours", why, p->replayed);
}

void player_close_scene(player* p)
{
    player_end_replay(p, "ends");
    if (p->session.recording && demo_record_end(&p->session, p->options.record) != DEMO_OK) p->failed = true;
    player_edits_close(p);
    player_split_close(p);
    history_clear(&p->history);
    memset(&p->hand, 0, sizeof p->hand);
    p->graphs.grids = 0;
    close_parts(&p->session);
}
