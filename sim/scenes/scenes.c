/* The table of built-in scenes, and opening worlds by name. */
#include "sim/scenes/scenes.h"

#include <string.h>

#include "platform/settings.h"

/* Settings a scene is shown best with stand behind its builder: SETTINGS("temporal=true", "bounces=3"). */
#define SETTINGS(...) ((const char* const[]){__VA_ARGS__, NULL})

/* Nothing flickers: history, lights that stay on their surfaces, smooth edges. */
#define STEADY "temporal=true", "vpl.stable=true", "antialias=temporal"

/* As the eye sees what is bright. */
#define SEEN "glare=convolution", "glare.supersample=4"

static const es_scene scenes[] = {
    {"cornell", "a Cornell box with four moving objects under a moving spot light (3,372 triangles)", es_scene_cornell},
    {"room", "a closed room of 40 spheres and 20 tori under a spot light (69,552 triangles)", es_scene_room},
    {"hall", "a colonnade lit from its side aisle, for the most part by what the walls give back (108,516 triangles)", es_scene_hall},
    {"cornell-stack", "a stack of cubes in a Cornell box, a ball that brings it down, a lamp that sways (3,372 triangles)", es_scene_cornell_stack, SETTINGS(STEADY, "vpl.count=256", "ism.points=2048")},
    {"courtyard", "a court with arcades under sun and sky; a day takes forty seconds (56,886 triangles)", es_scene_courtyard, SETTINGS(STEADY, "vpl.count=512", "ism.points=4096", "exposure=-5.5", "shadow.size=1024")},
    {"bunny-box", "a rabbit floats in an open box under a spot light (72,128 triangles)", es_scene_bunny_box, SETTINGS(STEADY, "gi=second-order", "vpl.count=512", "ism.points=4096")},
    {"crease", "stairs, folds and toys on a floor, close to each other, under a spot light and a dim sky (72,676 triangles)", es_scene_crease, SETTINGS(STEADY, "vpl.count=512", "ism.points=4096", "compensation.steps=1", "screen.repair=4")},
    {"lamp-shop", "an animal walks about among lamps that all have a size (115,432 triangles)", es_scene_lamp_shop, SETTINGS(STEADY, "ism.points=4096", SEEN, "glare.field=8")},
    {"creature", "an animal walks past a curved light of many colours and kicks balls about", es_scene_creature, SETTINGS(STEADY, "vpl.count=512", "ism.points=2048", "vpl.light-size=64", "shadow.size=192", "shadow.filter=3", "exposure=0.9")},
    {"curtain", "a curtain in a doorway opens and closes the light of a room", es_scene_curtain, SETTINGS(STEADY, "vpl.count=512", "ism.points=4096", "vpl.bound=40", "exposure=0.7")},
    {"gallery", "a museum's hall of glossy and diffuse things about a turning dragon (626,304 triangles)", es_scene_gallery, SETTINGS(STEADY, "vpl.count=512", "ism.points=4096", "micro.points=1048576", "micro.spacing=4")},
    {"lantern-walk", "a swinging lantern is carried through the dark hall", es_scene_lantern_walk, SETTINGS(STEADY, "vpl.count=512", "ism.points=4096", "filter.depth=0.1", "shadow.size=512", "vpl.light-size=128")},
    {"kitchen", "pots on a turning tray and pans that swing reflect a kitchen (300,000 triangles)", es_scene_kitchen, SETTINGS(STEADY, "half-resolution=true", "shadow.size=1024", "vpl.count=256", "ism.points=2048", "lamps.count=128", "lamps.vpls=128", "reflections=maps", "reflections.size=128")},
    {"lens", "a crystal ball and a burning glass before a picture, which they turn over", es_scene_lens, SETTINGS(STEADY, "shadow.size=1024", "vpl.count=256", "ism.points=2048", "reflections=maps", "reflections.size=512")},
    {"maze", "a torch carried round a maze lights the chamber in its middle by three bounces (12,720 triangles)", es_scene_maze, SETTINGS(STEADY, "vpl.count=512", "ism.points=4096", "bounces=3", "exposure=1.5", "filter.depth=0.1", "shadow.size=512", "vpl.light-size=128")},
    {"night-street", "headlights come up a street between lamps, lit windows and a moon", es_scene_night_street, SETTINGS(STEADY, "vpl.count=256", "ism.points=4096", "exposure=5", "shadow.size=1024", SEEN)},
    {"rain-of-things", "six hundred things rain into a yard and pile up under two turning beams", es_scene_rain_of_things, SETTINGS(STEADY, "vpl.count=256", "ism.points=4096")},
    {"ring", "silk is let down into a polished ring, lifted and let down again", es_scene_ring, SETTINGS(STEADY, "vpl.count=1024", "vpl.roughness=0.65", "vpl.bound=300", "ism.size=64", "ism.points=2048")},
    {"ring-face", "a ring of brushed gold turns beside a head and shows it at its rim", es_scene_ring_face, SETTINGS(STEADY, "shadow.size=1024", "vpl.count=256", "ism.points=2048", "reflections=maps")},
    {"rokeby", "a dragon before a mirror that is edited to show its face, where the law of reflection shows its tail", es_scene_rokeby, SETTINGS(STEADY, "half-resolution=true", "shadow.size=1024", "vpl.count=256", "ism.points=2048", "reflections=maps", "reflections.size=512", "exposure=0.5")},
    {"stress", "everything fast: bodies that bounce without loss, a light that sweeps and flickers", es_scene_stress, SETTINGS(STEADY, "vpl.count=256", "ism.points=2048")},
};

size_t es_scene_count(void) { return sizeof scenes / sizeof scenes[0]; }
const char* es_scene_name(size_t index) { return index < es_scene_count() ? scenes[index].name : NULL; }
const char* es_scene_description(size_t index) { return index < es_scene_count() ? scenes[index].description : NULL; }

static const es_scene* find(const char* name)
{
    for (size_t i = 0; i < es_scene_count(); i++)
        if (strcmp(scenes[i].name, name) == 0) return &scenes[i];
    return NULL;
}

const char* const* es_scene_settings(const char* name)
{
    static const char* const none[] = {NULL};
    const es_scene* scene = name ? find(name) : NULL;
    return scene && scene->settings ? scene->settings : none;
}

es_result es_world_create_scene(es_context* context, const char* name, const es_world_settings* settings, es_world** world)
{
    if (!context || !world) return ES_INVALID_ARGUMENT;
    *world = NULL;
    if (!name) return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_create_scene: name must not be NULL");
    const es_scene* scene = find(name);
    if (!scene) {
        es_setting names[sizeof scenes / sizeof scenes[0]] = {0};
        const es_setting* table = names;
        size_t count = es_scene_count();
        for (size_t i = 0; i < count; i++) names[i].name = scenes[i].name;
        return es_fail(context, ES_SCENE_UNKNOWN, "no built-in scene is named '%.64s'; the nearest is '%s'", name, es_settings_nearest(&table, &count, 1, name));
    }
    es_world* w;
    es_result result = es_world_create(context, settings, &w);
    if (result != ES_OK) return result;
    es_fp_environment environment = es_fp_enter();
    result = scene->build(w, w->settings.triangles);
    es_fp_leave(environment);
    if (result == ES_OK) result = es_world_finish_opening(w);
    if (result != ES_OK) {
        es_world_destroy(w);
        return result;
    }
    *world = w;
    return ES_OK;
}

/* A name with a point or a slash in it is a file's, so a mistyped scene is told from a missing file. */
es_result es_world_open(es_context* context, const char* scene_or_path, const es_world_settings* settings, es_world** world)
{
    if (!context || !world) return ES_INVALID_ARGUMENT;
    *world = NULL;
    if (!scene_or_path) return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_open: the scene or path must not be NULL");
    bool file = !find(scene_or_path) && strpbrk(scene_or_path, "./\\");
    return file ? es_world_import_gltf(context, scene_or_path, settings, world) : es_world_create_scene(context, scene_or_path, settings, world);
}
