/* Reflection edits in files: what is written is read again bit for bit, alone and in a copy of a glTF file, every other byte of which stays; what is wrong is refused with
 * one line, and nothing changes. */
#include <locale.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "platform/random.h"
#include "sim/edits/json.h"
#include "sim/sim.h"

static struct { es_context* context; char folder[64], log[4096]; int errors, warnings; } fixture;

static void keep_log(void* user, es_log_level level, es_result item, const char* message)
{
    fixture.errors += level == ES_LOG_ERROR;
    fixture.warnings += level == ES_LOG_WARNING && item == ES_ASSET_WARNING;
    snprintf(fixture.log + strlen(fixture.log), sizeof fixture.log - strlen(fixture.log), "%s\n", message);
    assert_null(strchr(message, '\n'));
}

static int set_up(void** state)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger.log = keep_log;
    desc.memory_cap = (size_t)1 << 30;
    strcpy(fixture.folder, "/tmp/earthshine-edits-XXXXXX");
    return mkdtemp(fixture.folder) && es_context_create(&desc, &fixture.context) == ES_OK ? 0 : -1;
}

static const char* path_of(const char* name)
{
    static char paths[4][128];
    static int turn;
    char* path = paths[turn++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", fixture.folder, name);
    return path;
}

static int tear_down(void** state)
{
    static const char* const names[] = {"a.gltf", "b.gltf", "a.glb", "b.glb", "data.bin"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) unlink(path_of(names[i]));
    rmdir(fixture.folder);
    es_context_destroy(fixture.context);
    return 0;
}

static void quiet(void)
{
    fixture.log[0] = 0;
    fixture.errors = fixture.warnings = 0;
}

static char* contents(const char* name, size_t* size)
{
    FILE* file = fopen(path_of(name), "rb");
    assert_non_null(file);
    char* bytes = malloc(1 << 20);
    *size = fread(bytes, 1, (1 << 20) - 1, file);
    bytes[*size] = 0;
    fclose(file);
    return bytes;
}

static void put(const char* name, const void* bytes, size_t size)
{
    FILE* file = fopen(path_of(name), "wb");
    assert_true(file && fwrite(bytes, 1, size, file) == size);
    fclose(file);
}

/* ' stands for " */
static void put_text(const char* name, const char* json)
{
    char* text = strdup(json);
    for (char* c = text; *c; c++)
        if (*c == '\'') *c = '"';
    put(name, text, strlen(text));
    free(text);
}

static es_world* scene(const char* name)
{
    es_world* world;
    es_world_settings settings = es_default_world_settings();
    settings.triangles = 500;
    assert_int_equal(es_world_create_scene(fixture.context, name, &settings, &world), ES_OK);
    return world;
}

static es_instance nth_instance(es_world* world, size_t n)
{
    uint32_t ids[256];
    size_t count = 256;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_INSTANCE, ids, &count), ES_OK);
    return (es_instance){ids[n % count]};
}

static float any(uint32_t seed, uint32_t i) { return (es_random_float(seed, i) - 0.5f) * (float)(1 << es_random_u32(seed + 1, i) % 20); }

static es_anchor surface(es_world* world, uint32_t i)
{
    es_anchor anchor;
    es_instance_desc on;
    assert_int_equal(es_world_get_instance(world, nth_instance(world, i), &on), ES_OK);
    assert_int_equal(es_world_anchor_of_triangle(world, nth_instance(world, i), i % es_world_mesh(world, on.mesh)->triangle_count, es_random_float(3, i) * 0.7f, es_random_float(4, i) * 0.3f, &anchor), ES_OK);
    return anchor;
}

static es_anchor place(uint32_t i) { return (es_anchor){.kind = ES_ANCHOR_POINT, .point = {(double)any(5, i) / 3, (double)any(6, i) * 1e-9, (double)any(7, i)}}; }

/* Something of everything, of numbers with all their digits. */
static void edit(es_world* world)
{
    uint32_t node, camera, light;
    size_t count = 256;
    uint32_t ids[256];
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_NODE, ids, &count), ES_OK);
    node = ids[count - 1];
    count = 256;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_CAMERA, ids, &count), ES_OK);
    camera = ids[0];
    count = 256;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_LIGHT, ids, &count), ES_OK);
    light = ids[0];
    static const char* const names[] = {"plain", "quoted \" and \\", "\tGr\xc3\xbc\xc3\x9f \xf0\x9f\x92\xa1\n", ""};
    for (uint32_t i = 0; i < 8; i++) {
        es_region_stroke strokes[3];
        for (uint32_t k = 0; k < 3; k++) strokes[k] = (es_region_stroke){surface(world, i), surface(world, i), es_random_float(8, i + k), k == 1};
        es_region_desc d = es_default_region_desc();
        d.name = names[i % 4];
        d.type = (es_region_type)(i % 3);
        d.centre = i & 1 ? surface(world, i) : place(i);
        d.radius = es_random_float(9, i);
        d.border = es_random_float(10, i);
        d.off = i == 5;
        d.strokes = i % 3 == 2 ? strokes : NULL;
        d.stroke_count = i % 3 == 2 ? 3 : 0;
        es_region region;
        assert_int_equal(es_world_add_region(world, &d, &region), ES_OK);
        es_constraint_key keys[2] = {{any(11, i), surface(world, i), place(i), {any(12, i), 1, any(13, i)}}, {any(11, i) + 1, surface(world, i + 1), surface(world, i), {1, 2, any(14, i)}}};
        es_constraint_desc c = es_default_constraint_desc();
        c.name = names[i % 4];
        c.reflecting = surface(world, i);
        c.reflected = i & 1 ? place(i) : surface(world, i + 3);
        if (i == 3) c.reflected.instance = nth_instance(world, 2);
        c.refraction = i == 2;
        c.direction = (es_vec3){any(15, i), 0, 1};
        for (int k = 0; k < 3; k++) c.eye[k] = (double)any(16 + (uint32_t)k, i) / 7;
        c.orientation = (es_quat){any(19, i), 0, any(20, i), 1};
        c.fov_y = es_random_float(21, i);
        c.follows_view = i == 1;
        c.geodesic = i == 4;
        c.off = i == 6;
        c.keys = i & 1 ? keys : NULL;
        c.key_count = i & 1 ? 2 : 0;
        c.parameter.kind = (es_edit_parameter_kind)(i % 5);
        if (i % 5 == ES_EDIT_CAMERA && i > 4) c.parameter.camera.id = camera;
        if (i % 5 == ES_EDIT_NODE) c.parameter.node.id = node;
        if (i % 5 == ES_EDIT_LIGHT) c.parameter.light.id = light;
        if (i % 5 == ES_EDIT_NAMED) c.parameter.name = "how \"far\"";
        c.parameter.axis = i % 5 == ES_EDIT_CAMERA || i % 5 == ES_EDIT_NODE ? i % 3 : 0;
        es_constraint constraint;
        assert_int_equal(es_world_add_constraint(world, &c, &constraint), ES_OK);
    }
    assert_int_equal(es_world_set_parameter(world, "how \"far\"", 0.1f), ES_OK);
}

static void test_alone_they_come_back_bit_for_bit(void** state)
{
    const bool comma = setlocale(LC_ALL, "de_DE.UTF-8") != NULL; /* where there is one: numbers have a comma for a point */
    es_world *world = scene("cornell"), *other = scene("cornell");
    edit(world);
    assert_int_equal(es_world_save_edits(world, NULL, path_of("a.gltf")), ES_OK);
    assert_true(es_world_hash(world) != es_world_hash(other));
    for (int turn = 0; turn < 2; turn++) {
        assert_int_equal(es_world_load_edits(other, path_of("a.gltf")), ES_OK);
        assert_true(es_world_hash(world) == es_world_hash(other));
    }
    size_t size, again;
    char* first = contents("a.gltf", &size);
    assert_int_equal(es_world_save_edits(other, NULL, path_of("b.gltf")), ES_OK);
    char* second = contents("b.gltf", &again);
    assert_true(size == again && memcmp(first, second, size) == 0);
    free(first);
    free(second);
    if (comma) setlocale(LC_ALL, "C");
    /* no edits at all are edits as well */
    es_world* empty = scene("cornell");
    assert_int_equal(es_world_save_edits(empty, NULL, path_of("b.gltf")), ES_OK);
    assert_int_equal(es_world_load_edits(world, path_of("b.gltf")), ES_OK);
    size_t count = 0;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_CONSTRAINT, NULL, &count), ES_OK);
    assert_int_equal(count, 0);
    es_world_destroy(empty);
    es_world_destroy(world);
    es_world_destroy(other);
}

static void test_what_is_gone_is_left_out(void** state)
{
    es_world* world = scene("cornell");
    edit(world);
    assert_int_equal(es_world_destroy_instance(world, nth_instance(world, 0)), ES_OK);
    quiet();
    assert_int_equal(es_world_save_edits(world, NULL, path_of("a.gltf")), ES_OK);
    assert_int_equal(fixture.warnings, 1);
    assert_int_equal(es_world_load_edits(world, path_of("a.gltf")), ES_OK);
    es_world_destroy(world);
}

#if ES_WITH_TINYGLTF
#define TRIANGLE                                                                                                                                                   \
    "'asset': {'version': '2.0'}, 'scene': 0, 'nodes': [{'name': 'pot', 'mesh': 0}], 'meshes': [{'primitives': [{'attributes': {'POSITION': 0}}]}], "               \
    "'accessors': [{'bufferView': 0, 'componentType': 5126, 'count': 3, 'type': 'VEC3', 'min': [0, 0, 0], 'max': [1, 1, 0]}], "                                    \
    "'bufferViews': [{'buffer': 0, 'byteLength': 36}], "
#define INLINE "'buffers': [{'byteLength': 36, 'uri': 'data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA'}]"

static es_world* import(const char* name)
{
    es_world* world;
    if (es_world_import_gltf(fixture.context, path_of(name), NULL, &world) != ES_OK) fail_msg("%s", es_context_message(fixture.context));
    return world;
}

/* Extras of every kind before; the rest of the text stays. */
static void test_copies_keep_every_other_byte(void** state)
{
    static const struct { const char *before, *after; } scenes[] = {{"{'nodes' : [0]", "\t}"}, {"{'nodes' : [0], 'extras': {}", "}"}, {"{'nodes' : [0], 'extras': {'mine': [1,2 , 3]", "}}"},
        {"{'nodes' : [0], 'extras': {'earthshine': {'other': true", "}}}"}, {"{'nodes' : [0], 'extras': {'earthshine': {'edits': {}, 'other': true", "}}}"}, {"{'extras': {'earthshine': {}}, 'nodes': [0]", "}"}};
    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        char json[2048];
        snprintf(json, sizeof json, "{" TRIANGLE INLINE ",\n 'scenes': [%s%s]}\n", scenes[i].before, scenes[i].after);
        put_text("a.gltf", json);
        es_world* world = import("a.gltf");
        edit(world);
        assert_int_equal(es_world_save_edits(world, path_of("a.gltf"), path_of("b.gltf")), ES_OK);
        es_world* copy = import("b.gltf");
        assert_true(es_world_hash(copy) == es_world_hash(world));
        size_t size[2];
        char *old = contents("a.gltf", &size[0]), *new = contents("b.gltf", &size[1]);
        size_t same = 0, same_end = 0;
        while (same < size[0] && old[same] == new[same]) same++;
        while (same_end < size[0] && old[size[0] - 1 - same_end] == new[size[1] - 1 - same_end]) same_end++;
        if (i != 4 && same + same_end < size[0]) fail_msg("of %zu bytes %zu and %zu are the same:\n%s", size[0], same, same_end, new);
        /* into itself, once more */
        assert_int_equal(es_world_save_edits(copy, path_of("b.gltf"), path_of("b.gltf")), ES_OK);
        size_t third;
        char* again = contents("b.gltf", &third);
        assert_true(third == size[1] && memcmp(again, new, third) == 0);
        free(old);
        free(new);
        free(again);
        es_world_destroy(world);
        es_world_destroy(copy);
    }
}

static void test_copies_of_glb_files(void** state)
{
    char json[1024];
    snprintf(json, sizeof json, "{" TRIANGLE "'buffers': [{'byteLength': 36}], 'scenes': [{'nodes': [0]}]}");
    size_t length = strlen(json);
    for (char* c = json; *c; c++)
        if (*c == '\'') *c = '"';
    while (length % 4) json[length++] = ' ';
    const float triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t header[5] = {0x46546c67, 2, (uint32_t)(20 + length + 8 + sizeof triangle + 12), (uint32_t)length, 0x4e4f534a}, chunk[2] = {sizeof triangle, 0x004e4942}, strange[3] = {4, 0x12345678, 77};
    char bytes[2048];
    memcpy(bytes, header, 20);
    memcpy(bytes + 20, json, length);
    memcpy(bytes + 20 + length, chunk, 8);
    memcpy(bytes + 28 + length, triangle, sizeof triangle);
    memcpy(bytes + 28 + length + sizeof triangle, strange, 12);
    put("a.glb", bytes, header[2]);
    es_world* world = import("a.glb");
    edit(world);
    assert_int_equal(es_world_save_edits(world, path_of("a.glb"), path_of("b.glb")), ES_OK);
    es_world* copy = import("b.glb");
    assert_true(es_world_hash(copy) == es_world_hash(world));
    size_t size;
    char* after = contents("b.glb", &size);
    assert_memory_equal(after + size - 56, bytes + 20 + length, 56); /* the chunks behind */
    free(after);
    es_world_destroy(copy);
    es_world_destroy(world);
}

static void test_copies_stay_with_their_files(void** state)
{
    const float triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    put("data.bin", triangle, sizeof triangle);
    put_text("a.gltf", "{" TRIANGLE "'buffers': [{'byteLength': 36, 'uri': 'data.bin'}], 'scenes': [{'nodes': [0]}]}");
    es_world* world = import("a.gltf");
    assert_int_equal(es_world_save_edits(world, path_of("a.gltf"), path_of("b.gltf")), ES_OK);
    es_world_destroy(import("b.gltf"));
    quiet();
    assert_int_equal(es_world_save_edits(world, path_of("a.gltf"), "/tmp/earthshine-edits-elsewhere.gltf"), ES_FILE_UNSUPPORTED);
    assert_true(fixture.errors == 1 && strstr(fixture.log, "'data.bin'") != NULL);
    assert_int_equal(access("/tmp/earthshine-edits-elsewhere.gltf", F_OK), -1);
    put_text("b.gltf", "{'asset': {'version': '2.0'}}");
    assert_int_equal(es_world_save_edits(world, path_of("b.gltf"), path_of("b.gltf")), ES_FILE_UNSUPPORTED);
    assert_int_equal(es_world_save_edits(world, path_of("none.gltf"), path_of("b.gltf")), ES_FILE_NOT_FOUND);
    assert_int_equal(es_world_save_edits(world, NULL, path_of("no/where.gltf")), ES_FILE_WRITE);
    es_world_destroy(world);
}

static void test_a_bad_file_is_refused_by_import_too(void** state)
{
    put_text("a.gltf", "{" TRIANGLE INLINE ", 'scenes': [{'nodes': [0], 'extras': {'earthshine': {'edits': {'constraints': [{'reflecting': {'node': 'pan', 'triangle': 0}}]}}}}]}");
    quiet();
    es_world* world;
    assert_int_equal(es_world_import_gltf(fixture.context, path_of("a.gltf"), NULL, &world), ES_FILE_DAMAGED);
    assert_true(fixture.errors == 1 && strstr(fixture.log, "constraints[0].reflecting: there is no node 'pan'") != NULL);
}
#endif

static void test_what_is_wrong_is_refused(void** state)
{
    static const struct { const char *edits, *message; } bad[] = {
        {"3", "extras.earthshine.edits: must be an object"},
        {"{'version': 2}", ".version: is 2, 1 is read"},
        {"{'regions': {}}", ".regions: must be an array"},
        {"{'regions': [{}, {'radius': -1}]}", "regions[1].radius: is -1, must lie in 0"},
        {"{'regions': [{'radius': 1e999}]}", "regions[0].radius: must be a number"},
        {"{'regions': [{'type': 'round'}]}", "regions[0].type: must be one of euclidean, geodesic, freeForm"},
        {"{'regions': [{'centre': {'point': [1, 2]}}]}", "regions[0].centre.point: must be an array of 3 numbers"},
        {"{'regions': [{'centre': {'u': 0.5}}]}", "regions[0].centre: needs a point, or a node and a triangle"},
        {"{'regions': [{'strokes': [{'radius': 1}]}]}", "regions[0].strokes[0]: must lead from one place of a surface to another"},
        {"{'constraints': [{'keys': [{'at': 1}, {'at': 1}]}]}", "constraints[0].keys[1]: must be at a number within 1e9, greater than the one before"},
        {"{'constraints': [{'reflecting': {'point': [0, 0, 0]}}]}", "constraints[0]: its reflecting handle must be on a surface"},
        {"{'constraints': [{'reflecting': {'index': 0, 'triangle': 1e6}}]}", "constraints[0].reflecting"},
        {"{'constraints': [{'reflecting': {'index': 0, 'triangle': 0.5}}]}", ".triangle: must be a whole number"},
        {"{'constraints': [{'refraction': true}]}", "constraints[0]: its direction must be finite, and a refraction must have one"},
        {"{'constraints': [{'parameter': {'kind': 'node', 'node': 'nobody'}}]}", "constraints[0].parameter: there is no node 'nobody'"},
        {"{'constraints': [{'parameter': {'kind': 'named'}}]}", "constraints[0]: the name of its parameter must have 1"},
        {"{'constraints': [{'off': 1}]}", "constraints[0].off: must be true or false"},
        {"{'parameters': {'x': 'y'}}", ".parameters.x: must be a number within 1e9"},
        {"{'parameters': {'': 1}}", ".parameters: names must have 1"},
        {"{'regions': [}", "JSON, line 1"},
        {"{'regions': [], }", "a member's name is needed"},
        {"[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[", "nested too deeply"},
    };
    es_world* world = scene("cornell");
    edit(world);
    const uint64_t hash = es_world_hash(world);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char json[2048];
        snprintf(json, sizeof json, "{'asset': {'version': '2.0'}, 'scenes': [{'extras': {'earthshine': {'edits': %s}}}]}", bad[i].edits);
        put_text("a.gltf", json);
        quiet();
        const size_t before = es_context_bytes(fixture.context);
        const es_result result = es_world_load_edits(world, path_of("a.gltf"));
        if (result != ES_FILE_DAMAGED || fixture.errors != 1 || !strstr(fixture.log, bad[i].message)) fail_msg("%s: %s, %d errors: %s", bad[i].edits, es_result_name(result), fixture.errors, fixture.log);
        assert_true(es_world_hash(world) == hash);
        assert_int_equal(es_context_bytes(fixture.context), before);
    }
    put_text("a.gltf", "{'asset': {'version': '2.0'}, 'scenes': [{}]}");
    assert_int_equal(es_world_load_edits(world, path_of("a.gltf")), ES_FILE_TYPE);
    assert_int_equal(es_world_load_edits(world, path_of("none.gltf")), ES_FILE_NOT_FOUND);
    assert_true(es_world_hash(world) == hash);
    es_world_destroy(world);
}

static void test_unknown_members_are_warned_of(void** state)
{
    put_text("a.gltf", "{'asset': {'version': '2.0'}, 'scenes': [{'extras': {'earthshine': {'edits': {'colour': 1, 'regions': [{'centre': {'point': [0, 1e0, 0], 'w': 0}, 'n\\u0061me': 'A'}]}}}}]}");
    es_world* world = scene("cornell");
    quiet();
    assert_int_equal(es_world_load_edits(world, path_of("a.gltf")), ES_OK);
    assert_true(fixture.warnings == 2 && strstr(fixture.log, "edits.colour") && strstr(fixture.log, "regions[0].centre.w"));
    uint32_t id;
    size_t count = 1;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_REGION, &id, &count), ES_OK);
    assert_string_equal(es_world_name(world, ES_OBJECT_REGION, id), "A");
    es_world_destroy(world);
}

static void test_numbers_have_their_bits(void** state)
{
    es_json_text text = {.context = fixture.context};
    for (uint32_t i = 0; i < 20000; i++) {
        float single;
        double whole;
        uint32_t bits = es_random_u32(1, i);
        uint64_t wide = (uint64_t)es_random_u32(2, i) << 32 | es_random_u32(3, i);
        memcpy(&single, &bits, 4);
        memcpy(&whole, &wide, 8);
        if (!(single - single == 0) || !(whole - whole == 0)) continue;
        text.size = 0;
        es_json_put(&text, "[", 1);
        es_json_write_float(&text, single);
        es_json_put(&text, ",", 1);
        es_json_write_double(&text, whole);
        es_json_put(&text, "]", 1);
        es_json json;
        double a, b;
        assert_int_equal(es_json_parse(fixture.context, "text", text.bytes, text.size, &json), ES_OK);
        assert_true(es_json_number(&json, es_json_element(&json, 0, 0), &a) && es_json_number(&json, es_json_element(&json, 0, 1), &b));
        float back = (float)a;
        assert_memory_equal(&back, &single, 4);
        assert_memory_equal(&b, &whole, 8);
        es_json_free(&json);
    }
    es_json_text_free(&text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_alone_they_come_back_bit_for_bit),
        cmocka_unit_test(test_what_is_gone_is_left_out),
#if ES_WITH_TINYGLTF
        cmocka_unit_test(test_copies_keep_every_other_byte),
        cmocka_unit_test(test_copies_of_glb_files),
        cmocka_unit_test(test_copies_stay_with_their_files),
        cmocka_unit_test(test_a_bad_file_is_refused_by_import_too),
#endif
        cmocka_unit_test(test_what_is_wrong_is_refused),
        cmocka_unit_test(test_unknown_members_are_warned_of),
        cmocka_unit_test(test_numbers_have_their_bits),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
