/* What es_scene_settings recommends is known to the world or the renderer, and within its range. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include <earthshine/gi.h>

static bool is_world_setting(const char* name)
{
    for (size_t i = 0; i < es_world_setting_count(); i++)
        if (!strcmp(es_world_setting(i)->name, name)) return true;
    return false;
}

static void test_every_scene(void** state)
{
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    for (size_t i = 0; i < es_scene_count(); i++) {
        es_world_settings world = es_default_world_settings();
        es_renderer_settings renderer = es_default_renderer_settings();
        const char* const* settings = es_scene_settings(es_scene_name(i));
        assert_non_null(settings);
        for (const char* const* text = settings; *text; text++) {
            char name[128];
            const char* equals = strchr(*text, '=');
            if (!equals || (size_t)(equals - *text) >= sizeof name) fail_msg("%s: '%s' is not key=value", es_scene_name(i), *text);
            memcpy(name, *text, (size_t)(equals - *text));
            name[equals - *text] = 0;
            es_result result = is_world_setting(name) ? es_world_settings_set(context, &world, name, equals + 1)
                                                      : es_renderer_settings_set(context, &renderer, name, equals + 1);
            if (result != ES_OK) fail_msg("%s: %s", es_scene_name(i), es_context_message(context));
        }
    }
    es_context_destroy(context);
}

static void test_none_for_others(void** state)
{
    assert_non_null(es_scene_settings("no such scene"));
    assert_null(es_scene_settings("no such scene")[0]);
    assert_non_null(es_scene_settings(NULL));
    assert_null(es_scene_settings(NULL)[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_scene), cmocka_unit_test(test_none_for_others)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
