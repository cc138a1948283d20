/* The world's settings: names, ranges, defaults. */
#include "sim/recording.h"

#include "platform/settings.h"

#define AT(field) offsetof(es_world_settings, field)

static const es_setting world_table[] = {
    {"world.triangles", ES_SETTING_INT, "0", 0, 20000000, NULL, "triangles a built-in scene aims at; 0: its own number", AT(triangles)},
    {"world.speed", ES_SETTING_FLOAT, "1", 0, 100, NULL, "seconds of the world per second", AT(speed)},
    {"world.step", ES_SETTING_FLOAT, "0.016666667", 1e-4, 0.1, NULL, "seconds of one step of bodies and cloth", AT(step)},
    {"world.substeps", ES_SETTING_INT, "4", 1, 64, NULL, "parts a step is solved in", AT(substeps)},
    {"world.interpolate", ES_SETTING_BOOL, "true", 0, 1, NULL, "show bodies and cloth between two steps where time is; off: as of the last step", AT(interpolate)},
    {"world.sleep", ES_SETTING_BOOL, "true", 0, 1, NULL, "let what rests fall asleep", AT(sleep)},
    {"world.gravity-x", ES_SETTING_FLOAT, "0", -1000, 1000, NULL, "gravity, m/s²", AT(gravity.x)},
    {"world.gravity-y", ES_SETTING_FLOAT, "-9.81", -1000, 1000, NULL, "the same, upwards", AT(gravity.y)},
    {"world.gravity-z", ES_SETTING_FLOAT, "0", -1000, 1000, NULL, "the same, towards +z", AT(gravity.z)},
    {"world.camera", ES_SETTING_INT, "0", 0, 65535, NULL, "which of the scene's cameras, counted from 0", AT(camera)},
    {"world.clip", ES_SETTING_INT, "0", 0, 65535, NULL, "which clip plays; 0: all that do not touch the same node", AT(clip)},
    {"world.default-light", ES_SETTING_BOOL, "true", 0, 1, NULL, "give files without lights one", AT(default_light)},
};

size_t es_world_setting_count(void) { return sizeof world_table / sizeof world_table[0]; }

const es_setting* es_world_setting(size_t index) { return index < es_world_setting_count() ? &world_table[index] : NULL; }

es_world_settings es_default_world_settings(void)
{
    es_world_settings settings = {0};
    es_settings_defaults(world_table, es_world_setting_count(), &settings);
    return settings;
}

es_result es_world_settings_set(es_context* context, es_world_settings* settings, const char* name, const char* value)
{
    return es_settings_set(context, world_table, es_world_setting_count(), settings, name, value);
}

es_world_settings es_world_get_settings(const es_world* world) { return world ? world->settings : es_default_world_settings(); }

es_result es_world_configure(es_world* world, const es_world_settings* settings)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_world_settings resolved;
    es_result result = es_world_settings_resolve(world->context, settings, &resolved);
    if (result != ES_OK) return result;
    if (resolved.step != world->settings.step) {
        world->fixed_base = es_fixed_time(world);
        world->fixed_count = 0;
    }
    /* what only opening reads stays as it was opened with */
    resolved.triangles = world->settings.triangles;
    resolved.camera = world->settings.camera;
    resolved.clip = world->settings.clip;
    resolved.default_light = world->settings.default_light;
    world->settings = resolved;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_CONFIGURE, .settings = resolved});
    return ES_OK;
}

es_result es_world_settings_resolve(es_context* context, const es_world_settings* settings, es_world_settings* resolved)
{
    *resolved = settings ? *settings : es_default_world_settings();
    return es_settings_check(context, world_table, es_world_setting_count(), resolved);
}
