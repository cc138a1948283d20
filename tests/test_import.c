/* The glTF importer: every feature on files written here, every refusal by its name, the shared assets where present, and
 * a few thousand damaged files.
 *
 * JSON is written with ' for ". Buffers are given as bytes and land in model.bin beside model.gltf. */
#include <dirent.h>
#include <inttypes.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include <earthshine/sim.h>

/* ---- fixture ------------------------------------------------------------------------------------------------------------ */

static struct { es_context* context; char folder[64]; char log[16384]; } fixture;

static void keep_log(void* user, es_log_level level, es_result item, const char* message)
{
    size_t used = strlen(fixture.log);
    snprintf(fixture.log + used, sizeof fixture.log - used, "%s: %s\n", es_result_name(item), message);
    if (strchr(message, '\n')) { fail_msg("a message of several lines: %s", message); }
}

static es_context* new_context(size_t cap)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger.log = keep_log;
    desc.memory_cap = cap;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static int setup(void** state)
{
    strcpy(fixture.folder, "/tmp/earthshine-import-XXXXXX");
    if (!mkdtemp(fixture.folder)) { return -1; }
    fixture.context = new_context(0);
    return 0;
}

static int teardown(void** state)
{
    char path[512];
    DIR* folder = opendir(fixture.folder);
    for (struct dirent* entry; (entry = readdir(folder));) {
        snprintf(path, sizeof path, "%s/%s", fixture.folder, entry->d_name);
        if (entry->d_name[0] != '.') { remove(path); }
    }
    closedir(folder);
    rmdir(fixture.folder);
    es_context_destroy(fixture.context);
    return 0;
}

static const char* path_of(const char* name)
{
    static char path[512];
    snprintf(path, sizeof path, "%s/%s", fixture.folder, name);
    return path;
}

static void write_file(const char* name, const void* bytes, size_t size)
{
    FILE* file = fopen(path_of(name), "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    fclose(file);
}

static char* quoted(const char* json)
{
    char* text = strdup(json);
    for (char* c = text; *c; c++) {
        if (*c == '\'') { *c = '"'; }
    }
    return text;
}

static void write_gltf(const char* name, const char* json)
{
    char* text = quoted(json);
    write_file(name, text, strlen(text));
    free(text);
}

/* Imports and checks that a failure leaves nothing behind. */
static es_result import(const char* name, const es_world_settings* settings, es_world** world)
{
    size_t before = es_context_bytes(fixture.context);
    fixture.log[0] = 0;
    *world = (es_world*)fixture.folder;
    es_result result = es_world_import_gltf(fixture.context, path_of(name), settings, world);
    if (result != ES_OK) {
        assert_null(*world);
        assert_int_equal(es_context_bytes(fixture.context), before);
        assert_int_equal(es_context_last_result(fixture.context), result);
    } else {
        assert_non_null(*world);
    }
    return result;
}

static es_world* load_with(const char* json, const void* bytes, size_t size, const es_world_settings* settings)
{
    write_gltf("model.gltf", json);
    if (bytes) { write_file("model.bin", bytes, size); }
    es_world* world;
    es_result result = import("model.gltf", settings, &world);
    if (result != ES_OK) { fail_msg("%s: %s", es_result_name(result), es_context_message(fixture.context)); }
    return world;
}

static es_world* load(const char* json, const void* bytes, size_t size) { return load_with(json, bytes, size, NULL); }

static void refuse(es_result expected, const char* part, const char* json, const void* bytes, size_t size)
{
    write_gltf("model.gltf", json);
    if (bytes) { write_file("model.bin", bytes, size); }
    es_world* world;
    es_result result = import("model.gltf", NULL, &world);
    es_world_destroy(world);
    if (result != expected || !strstr(es_context_message(fixture.context), part)) {
        fail_msg("wanted %s with '%s', got %s: %s\n%s", es_result_name(expected), part, es_result_name(result),
            es_context_message(fixture.context), json);
    }
}

static uint32_t triangles(const es_world* world)
{
    const es_draw_list* list = es_world_draw_list(world);
    uint32_t count = 0;
    for (uint32_t i = 0; i < list->instance_count; i++) { count += list->instances[i].mesh->triangle_count; }
    return count;
}

static const es_raster_mesh* mesh_at(const es_world* world, uint32_t i)
{
    const es_draw_list* list = es_world_draw_list(world);
    assert_true(i < list->instance_count);
    return list->instances[i].mesh;
}

static const es_material_desc* material_at(const es_world* world, uint32_t i)
{
    const es_draw_list* list = es_world_draw_list(world);
    assert_true(i < list->instance_count);
    return &list->materials[list->instances[i].material];
}

static size_t object_count(const es_world* world, es_object_kind kind)
{
    size_t count = 0;
    assert_int_equal(es_world_enumerate(world, kind, NULL, &count), ES_OK);
    return count;
}

static void near(float value, float expected)
{
    if (!(fabsf(value - expected) <= 1e-5f * (1 + fabsf(expected)))) { fail_msg("%g, expected %g", (double)value, (double)expected); }
}

static void position_is(const es_raster_mesh* mesh, uint32_t vertex, float x, float y, float z)
{
    near(mesh->positions[4 * vertex], x);
    near(mesh->positions[4 * vertex + 1], y);
    near(mesh->positions[4 * vertex + 2], z);
}

static bool logged(const char* part) { return strstr(fixture.log, part) != NULL; }

static uint64_t hash_bytes(uint64_t hash, const void* bytes, size_t size)
{
    const uint8_t* b = bytes;
    for (size_t i = 0; i < size; i++) { hash = (hash ^ b[i]) * 0x100000001b3ull; }
    return hash;
}

/* Of what is drawn and of the state, but for addresses. */
static uint64_t world_hash(const es_world* world)
{
    uint64_t hash = hash_bytes(0xcbf29ce484222325ull, &(uint64_t){es_world_hash(world)}, 8);
    const es_draw_list* list = es_world_draw_list(world);
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_instance* instance = &list->instances[i];
        const es_raster_mesh* mesh = instance->mesh;
        size_t stream = (size_t)mesh->vertex_count * 16;
        hash = hash_bytes(hash, mesh->positions, stream);
        if (mesh->normals) { hash = hash_bytes(hash, mesh->normals, stream); }
        if (mesh->tangents) { hash = hash_bytes(hash, mesh->tangents, stream); }
        if (mesh->uvs) { hash = hash_bytes(hash, mesh->uvs, stream); }
        if (mesh->colors) { hash = hash_bytes(hash, mesh->colors, stream); }
        hash = hash_bytes(hash, mesh->indices, (size_t)mesh->triangle_count * 12);
        hash = hash_bytes(hash, &instance->transform, sizeof instance->transform);
        const es_material_desc* m = &list->materials[instance->material];
        hash = hash_bytes(hash, m->base_color, sizeof m->base_color);
        hash = hash_bytes(hash, m->emission, sizeof m->emission);
        if (m->base_color_texture.image) { hash = hash_bytes(hash, m->base_color_texture.image->texels, m->base_color_texture.image->bytes); }
    }
    return hash;
}

/* ---- small files ----------------------------------------------------------------------------------------------------------- */

#define ASSET "'asset':{'version':'2.0'}"
#define SCENE1 "'scene':0,'scenes':[{'nodes':[0]}]"
#define BUFFER(size) "'buffers':[{'uri':'model.bin','byteLength':" #size "}]"

static const float triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};

/* One triangle, 36 bytes; `more` is put at the end of the document, `node` and `primitive` into their objects. */
static const char* one_triangle(const char* node, const char* primitive, const char* more)
{
    static char json[8192];
    snprintf(json, sizeof json,
        "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0%s}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}%s}]}]," BUFFER(36) ","
        "'bufferViews':[{'buffer':0,'byteLength':36}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}]%s}",
        node, primitive, more);
    return json;
}

static const uint8_t png_2x2[76] = {137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 2, 0, 0, 0, 2, 8, 6, 0, 0, 0, 114, 182,
    13, 36, 0, 0, 0, 19, 73, 68, 65, 84, 120, 218, 99, 248, 207, 192, 240, 31, 12, 129, 52, 8, 48, 0, 0, 72, 201, 8, 248, 197, 52, 253, 5, 0, 0, 0,
    0, 73, 69, 78, 68, 174, 66, 96, 130};

static void a_triangle_gets_camera_and_light(void** state)
{
    es_world* world = load(one_triangle(",'name':'tri','translation':[5,0,0]", "", ""), triangle, sizeof triangle);
    assert_int_equal(triangles(world), 1);
    position_is(mesh_at(world, 0), 1, 1, 0, 0);
    assert_null(mesh_at(world, 0)->normals); /* flat */
    assert_int_not_equal(es_world_find_node(world, "tri").id, 0);
    assert_true(logged("NOTE") && logged("has no camera") && logged("has no light"));
    /* the default material is glTF's */
    near(material_at(world, 0)->metallic, 1);
    near(material_at(world, 0)->roughness, 1);
    /* the camera sees all of it */
    es_raster_view view;
    assert_int_equal(es_world_camera_view(world, es_world_active_camera(world), 64, 64, &view), ES_OK);
    for (uint32_t v = 0; v < 3; v++) {
        float p[4] = {triangle[3 * v] + 5, triangle[3 * v + 1], triangle[3 * v + 2], 1}, e[4] = {0}, c[4] = {0};
        for (int r = 0; r < 4; r++) for (int k = 0; k < 4; k++) e[r] += view.view.m[4 * k + r] * p[k];
        for (int r = 0; r < 4; r++) for (int k = 0; k < 4; k++) c[r] += view.projection.m[4 * k + r] * e[k];
        assert_true(c[3] > 0 && fabsf(c[0]) < c[3] && fabsf(c[1]) < c[3] && c[2] < c[3]);
    }
    /* the light comes from above and from the camera's side */
    size_t count;
    const es_light_state* light = es_world_lights(world, &count);
    assert_int_equal(count, 1);
    assert_int_equal(light->type, ES_LIGHT_DIRECTIONAL);
    near(light->radiant[0], 3);
    assert_true(light->direction.y < -0.3f && light->direction.z < 0);
    es_world_destroy(world);

    es_world_settings settings = es_default_world_settings();
    settings.default_light = false;
    world = load_with(one_triangle("", "", ""), triangle, sizeof triangle, &settings);
    es_world_lights(world, &count);
    assert_int_equal(count, 0);
    es_world_destroy(world);
}

static size_t make_glb(uint8_t* out, const char* json, const void* binary, uint32_t binary_size)
{
    char* text = quoted(json);
    uint32_t length = (uint32_t)strlen(text), padded = (length + 3) / 4 * 4, total = 12 + 8 + padded + (binary ? 8 + binary_size : 0);
    uint32_t head[5] = {0x46546c67, 2, total, padded, 0x4e4f534a}, second[2] = {binary_size, 0x004e4942};
    memcpy(out, head, 20);
    memset(out + 20, ' ', padded);
    memcpy(out + 20, text, length);
    if (binary) {
        memcpy(out + 20 + padded, second, 8);
        memcpy(out + 28 + padded, binary, binary_size);
    }
    free(text);
    return total;
}

#define TRIANGLE_GLB \
    "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],'buffers':[{'byteLength':36}]," \
    "'bufferViews':[{'buffer':0,'byteLength':36}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}]}"

static void containers_give_the_same_world(void** state)
{
    es_world* world = load(one_triangle("", "", ""), triangle, sizeof triangle);
    uint64_t expected = world_hash(world);
    es_world_destroy(world);

    uint8_t glb[2048];
    write_file("odd name.txt", glb, make_glb(glb, TRIANGLE_GLB, triangle, 36)); /* by content, not by name */
    assert_int_equal(import("odd name.txt", NULL, &world), ES_OK);
    assert_true(world_hash(world) == expected);
    es_world_destroy(world);

    /* base64 of the 36 bytes; '/' may be escaped, parameters may stand before */
    world = load("{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],"
                 "'buffers':[{'uri':'data:application\\/x;charset=utf-8;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA','byteLength':36}],"
                 "'bufferViews':[{'buffer':0,'byteLength':36}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}]}", NULL, 0);
    assert_true(world_hash(world) == expected);
    es_world_destroy(world);

    /* percent encoding and a folder that is left and entered again; a longer file than the buffer says */
    uint8_t longer[64] = {0};
    memcpy(longer, triangle, 36);
    write_file("a +b.bin", longer, sizeof longer);
    world = load("{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],"
                 "'buffers':[{'uri':'.%2fa%20+b.bin','byteLength':36}],"
                 "'bufferViews':[{'buffer':0,'byteLength':36}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}]}", NULL, 0);
    assert_true(world_hash(world) == expected);
    es_world_destroy(world);
}

/* Every component type, normalised and not, through POSITION of two vertices and a third at zero. */
static void component_types(void** state)
{
    static const struct { int type; bool normalized; uint8_t bytes[24]; float first, second; } cases[] = {
        {5120, false, {5, 0, 0, 0, 0xfb}, 5, -5}, {5120, true, {127, 0, 0, 0, 0x80}, 1, -1},
        {5121, false, {200, 0, 0, 0, 10}, 200, 10}, {5121, true, {255, 0, 0, 0, 51}, 1, 0.2f},
        {5122, false, {0, 1, 0, 0, 0, 0, 0, 0, 0xff, 0xff}, 256, -1}, {5122, true, {0xff, 0x7f, 0, 0, 0, 0, 0, 0, 0, 0x80}, 1, -1},
        {5123, false, {0, 1, 0, 0, 0, 0, 0, 0, 0xff, 0xff}, 256, 65535}, {5123, true, {0xff, 0xff, 0, 0, 0, 0, 0, 0, 0x33, 0x33}, 1, 0.2f},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int stride = cases[i].type < 5122 ? 4 : 8;
        char json[1024];
        snprintf(json, sizeof json,
            "{" ASSET ",'extensionsRequired':['KHR_mesh_quantization']," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],"
            BUFFER(24) ",'bufferViews':[{'buffer':0,'byteLength':24,'byteStride':%d}],"
            "'accessors':[{'bufferView':0,'componentType':%d,'normalized':%s,'count':3,'type':'VEC3'}]}",
            stride, cases[i].type, cases[i].normalized ? "true" : "false");
        es_world* world = load(json, cases[i].bytes, 24);
        position_is(mesh_at(world, 0), 0, cases[i].first, 0, 0);
        position_is(mesh_at(world, 0), 1, cases[i].second, 0, 0);
        es_world_destroy(world);
    }
}

/* All attributes interleaved in one view of 44 bytes a vertex. */
static void interleaved_attributes(void** state)
{
    struct vertex { float position[3]; float normal[3]; uint16_t uv0[2]; uint8_t uv1[2], pad[2]; uint8_t color[4]; int8_t tangent[4]; uint8_t rest[4]; };
    assert_int_equal(sizeof(struct vertex), 44);
    struct vertex v[3] = {{{0, 0, 0}, {0, 0, 2}, {0xffff, 0}, {255, 51}, {0}, {255, 0, 51, 0}, {127, 0, 0, -127}, {0}},
        {{1, 0, 0}, {0, 0, 1}, {0, 0xffff}, {0, 0}, {0}, {255, 255, 255, 0}, {127, 0, 0, 127}, {0}},
        {{0, 1, 0}, {0, 0, 1}, {0, 0}, {0, 0}, {0}, {0, 0, 0, 0}, {127, 0, 0, 127}, {0}}};
    es_world* world = load("{" ASSET ",'extensionsRequired':['KHR_mesh_quantization']," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':"
        "{'POSITION':0,'NORMAL':1,'TEXCOORD_0':2,'TEXCOORD_1':3,'COLOR_0':4,'TANGENT':5,'_MINE':0}}]}]," BUFFER(132) ","
        "'bufferViews':[{'buffer':0,'byteLength':132,'byteStride':44}],'accessors':["
        "{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
        "{'bufferView':0,'byteOffset':12,'componentType':5126,'count':3,'type':'VEC3'},"
        "{'bufferView':0,'byteOffset':24,'componentType':5123,'normalized':true,'count':3,'type':'VEC2'},"
        "{'bufferView':0,'byteOffset':28,'componentType':5121,'normalized':true,'count':3,'type':'VEC2'},"
        "{'bufferView':0,'byteOffset':32,'componentType':5121,'normalized':true,'count':3,'type':'VEC3'},"
        "{'bufferView':0,'byteOffset':36,'componentType':5120,'normalized':true,'count':3,'type':'VEC4'}]}", v, sizeof v);
    const es_raster_mesh* mesh = mesh_at(world, 0);
    position_is(mesh, 2, 0, 1, 0);
    assert_true(mesh->normals && mesh->normals[2] > 0);
    near(mesh->uvs[0], 1), near(mesh->uvs[1], 0), near(mesh->uvs[2], 1), near(mesh->uvs[3], 0.2f);
    near(mesh->colors[0], 1), near(mesh->colors[1], 0), near(mesh->colors[2], 0.2f), near(mesh->colors[3], 1);
    near(mesh->tangents[0], 1), near(mesh->tangents[3], -1), near(mesh->tangents[7], 1);
    es_world_destroy(world);
}

static void colors_of_four(void** state)
{
    struct { float p[9]; uint16_t c16[12]; float cf[12]; } data = {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {65535, 0, 0, 13107}, {0.25f, 3, -1, 0.5f}};
    for (int kind = 0; kind < 2; kind++) {
        char json[1024];
        snprintf(json, sizeof json, "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0,'COLOR_0':1}}]}]," BUFFER(108) ","
            "'bufferViews':[{'buffer':0,'byteLength':108}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
            "{'bufferView':0,'byteOffset':%d,'componentType':%d,'normalized':%s,'count':3,'type':'VEC4'}]}", kind ? 60 : 36, kind ? 5126 : 5123, kind ? "false" : "true");
        es_world* world = load(json, &data, sizeof data);
        const float* color = mesh_at(world, 0)->colors;
        if (kind) {
            near(color[0], 0.25f), near(color[1], 3), near(color[2], 0), near(color[3], 0.5f);
        } else {
            near(color[0], 1), near(color[1], 0), near(color[3], 0.2f);
        }
        es_world_destroy(world);
    }
}

static void sparse_and_viewless_accessors(void** state)
{
    /* positions zero but for vertices 1 and 2; indices zero but for corners 1 and 2 */
    struct { uint16_t at[2]; float values[6]; uint8_t corner_at[2]; uint8_t corners[2]; } data = {{1, 2}, {1, 0, 0, 0, 1, 0}, {1, 2}, {1, 2}};
    es_world* world = load("{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0,'NORMAL':2},'indices':1}]}]," BUFFER(32) ","
        "'bufferViews':[{'buffer':0,'byteLength':4},{'buffer':0,'byteOffset':4,'byteLength':24},{'buffer':0,'byteOffset':28,'byteLength':4}],'accessors':["
        "{'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':2,'indices':{'bufferView':0,'componentType':5123},'values':{'bufferView':1}}},"
        "{'componentType':5121,'count':3,'type':'SCALAR','sparse':{'count':2,'indices':{'bufferView':2,'componentType':5121},'values':{'bufferView':2,'byteOffset':2}}},"
        "{'componentType':5126,'count':3,'type':'VEC3'}]}", &data, 32);
    const es_raster_mesh* mesh = mesh_at(world, 0);
    position_is(mesh, 0, 0, 0, 0), position_is(mesh, 1, 1, 0, 0), position_is(mesh, 2, 0, 1, 0);
    assert_int_equal(mesh->indices[0], 0), assert_int_equal(mesh->indices[1], 1), assert_int_equal(mesh->indices[2], 2);
    es_world_destroy(world);
}

static void primitive_modes(void** state)
{
    static const float five[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0};
    static const struct { int mode; uint32_t count; uint32_t corners[9]; } cases[] = {
        {4, 1, {0, 1, 2}}, {5, 3, {0, 1, 2, 1, 3, 2, 2, 3, 4}}, {6, 3, {1, 2, 0, 2, 3, 0, 3, 4, 0}}, {0, 0, {0}}, {1, 0, {0}}, {2, 0, {0}}, {3, 0, {0}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char json[1024];
        snprintf(json, sizeof json, "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0},'mode':%d}]}]," BUFFER(60) ","
            "'bufferViews':[{'buffer':0,'byteLength':60}],'accessors':[{'bufferView':0,'componentType':5126,'count':5,'type':'VEC3'}]}", cases[i].mode);
        es_world* world = load(json, five, sizeof five);
        assert_int_equal(triangles(world), cases[i].count);
        if (cases[i].count) { assert_memory_equal(mesh_at(world, 0)->indices, cases[i].corners, cases[i].count * 12); }
        assert_int_equal(logged("points or lines are left out"), cases[i].mode < 4);
        assert_int_equal(logged("incomplete triangle"), cases[i].mode == 4);
        es_world_destroy(world);
    }
}

/* ---- EXT_lights_image_based ---------------------------------------------------------------------------------------------------- */

#ifdef ES_WITH_PNG
#define IBL(scene, light, images) \
    "{" ASSET ",'extensionsUsed':['EXT_lights_image_based'],'extensionsRequired':['EXT_lights_image_based'],'scene':0,'scenes':[{'nodes':[0],'extensions':{'EXT_lights_image_based':" scene "}}]," \
    "'extensions':{'EXT_lights_image_based':{'lights':[" light "]}},'images':[" images "]," \
    "'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]," BUFFER(36) ",'bufferViews':[{'buffer':0,'byteLength':36}]," \
    "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}]}"
#define FACES "{'uri':'f0.png'},{'uri':'f1.png'},{'uri':'f2.png'},{'uri':'f3.png'},{'uri':'f4.png'},{'uri':'f5.png'}"

/* What the environment has towards a direction, red and green. */
static void environment_is(const es_world* world, float x, float y, float z, double red, double green)
{
    es_environment_desc e;
    assert_true(es_world_get_environment(world, &e) && e.image);
    double length = sqrt((double)(x * x + y * y + z * z)), u = atan2((double)x, -(double)z) / 6.283185307179586 + 0.5, v = acos((double)y / length) / 3.141592653589793;
    const float* texel = e.image->pixels + 3 * ((uint32_t)fmin(v * e.image->height, e.image->height - 1) * e.image->width + (uint32_t)((u - floor(u)) * e.image->width));
    if (!(fabs((double)(texel[0] * e.radiance[0]) - red) < 0.01 && fabs((double)(texel[1] * e.radiance[1]) - green) < 0.01))
        fail_msg("towards (%g, %g, %g): %g and %g, not %g and %g", (double)x, (double)y, (double)z, (double)(texel[0] * e.radiance[0]), (double)(texel[1] * e.radiance[1]), red, green);
}

/* Faces of a red of their own, whose green is the half to the right as seen from the middle. */
static void image_based_light(void** state)
{
    for (uint32_t f = 0; f < 6; f++) {
        es_image face;
        assert_int_equal(es_image_create(fixture.context, 8, 8, 3, &face), ES_OK);
        for (uint32_t i = 0; i < 64; i++) {
            face.pixels[3 * i] = (float)(f + 1) / 8;
            face.pixels[3 * i + 1] = i % 8 >= 4;
        }
        char name[16];
        snprintf(name, sizeof name, "f%u.png", f);
        assert_int_equal(es_image_save(fixture.context, &face, path_of(name), NULL), ES_OK);
        es_image_destroy(fixture.context, &face);
    }
    es_world* world = load(IBL("{'light':0}", "{'intensity':2,'specularImageSize':8,'irradianceCoefficients':[],'specularImages':[[0,1,2,3,4,5]]}", FACES), triangle, 36);
    size_t count;
    es_world_lights(world, &count);
    assert_int_equal(count, 0); /* there is light, so none is made up */
    environment_is(world, 1, 0.2f, 0.5f, 2.0 / 8, 2);
    environment_is(world, 1, 0.2f, -0.5f, 2.0 / 8, 0);
    environment_is(world, -1, 0.2f, -0.5f, 4.0 / 8, 2);
    environment_is(world, 0.2f, 1, 0.2f, 6.0 / 8, 0);
    environment_is(world, -0.4f, 1, 0.2f, 6.0 / 8, 2);
    environment_is(world, -0.4f, -1, 0.2f, 8.0 / 8, 2);
    environment_is(world, -0.5f, 0, 1, 10.0 / 8, 2);
    environment_is(world, 0.5f, 0, -1, 12.0 / 8, 2);
    es_world_destroy(world);
    /* a quarter turn about y takes what was at +x to -z */
    world = load(IBL("{'light':0}", "{'rotation':[0,0.70710678,0,0.70710678],'specularImages':[[0,1,2,3,4,5]]}", FACES), triangle, 36);
    environment_is(world, 0.5f, 0.2f, -1, 1.0 / 8, 1);
    es_world_destroy(world);

    refuse(ES_FILE_DAMAGED, "light: must be a whole number", IBL("{}", "{}", FACES), triangle, 36);
    refuse(ES_FILE_DAMAGED, "light", IBL("{'light':1}", "{}", FACES), triangle, 36);
    refuse(ES_FILE_DAMAGED, "must be an array of levels", IBL("{'light':0}", "{}", FACES), triangle, 36);
    refuse(ES_FILE_DAMAGED, "must be an array of six images", IBL("{'light':0}", "{'specularImages':[[0,1]]}", FACES), triangle, 36);
    refuse(ES_FILE_DAMAGED, "must be the number of an image", IBL("{'light':0}", "{'specularImages':[[0,1,2,3,4,'a']]}", FACES), triangle, 36);
    refuse(ES_FILE_DAMAGED, "[5]", IBL("{'light':0}", "{'specularImages':[[0,1,2,3,4,6]]}", FACES), triangle, 36);
    refuse(ES_FILE_DAMAGED, "rotation", IBL("{'light':0}", "{'rotation':[1],'specularImages':[[0,1,2,3,4,5]]}", FACES), triangle, 36);
    refuse(ES_FILE_DAMAGED, "intensity", IBL("{'light':0}", "{'intensity':-1,'specularImages':[[0,1,2,3,4,5]]}", FACES), triangle, 36);
    for (uint32_t f = 0; f < 6; f++) {
        char name[16];
        snprintf(name, sizeof name, "f%u.png", f);
        remove(path_of(name));
    }
}
#endif

/* ---- materials ------------------------------------------------------------------------------------------------------------- */

static void materials(void** state)
{
    write_file("im ge.png", png_2x2, sizeof png_2x2);
    es_world* world = load(one_triangle("", ",'material':0",
        ",'extensionsUsed':['KHR_texture_transform','KHR_materials_emissive_strength','KHR_materials_specular','ACME_optional'],"
        "'images':[{'uri':'im%20ge.png'}],'samplers':[{'magFilter':9728,'minFilter':9986,'wrapS':33071,'wrapT':33648},{'minFilter':9729}],"
        "'textures':[{'source':0,'sampler':0},{'source':0,'sampler':1},{'source':0}],"
        "'materials':[{'name':'paint','doubleSided':true,'alphaMode':'MASK','alphaCutoff':0.25,'emissiveFactor':[0.5,0.25,1],"
        "'pbrMetallicRoughness':{'baseColorFactor':[0.1,0.2,0.3,0.4],'metallicFactor':0.75,'roughnessFactor':0.5,"
        "'baseColorTexture':{'index':0,'texCoord':0,'extensions':{'KHR_texture_transform':{'offset':[0.5,0.25],'rotation':1.5707963,'scale':[2,3],'texCoord':1}}},"
        "'metallicRoughnessTexture':{'index':1}},'normalTexture':{'index':1,'scale':0.5},'emissiveTexture':{'index':2},"
        "'extensions':{'KHR_materials_emissive_strength':{'emissiveStrength':8},"
        "'KHR_materials_specular':{'specularFactor':0.5,'specularColorFactor':[1,0,0],'specularTexture':{'index':2,'texCoord':1}}}}]"), triangle, 36);
    const es_material_desc* m = material_at(world, 0);
    near(m->base_color[1], 0.2f), near(m->base_color[3], 0.4f), near(m->metallic, 0.75f), near(m->roughness, 0.5f);
    near(m->emission[0], 4), near(m->emission[1], 2), near(m->emission[2], 8);
    assert_true(m->alpha_mask && m->double_sided);
    near(m->alpha_cutoff, 0.25f), near(m->normal_scale, 0.5f), near(m->specular, 0.5f * 0.2126f);
    assert_true(logged("specular colour") && logged("ACME_optional"));
    assert_int_equal(m->base_color_texture.uv_set, 1);
    near(m->base_color_texture.matrix[0], 0), near(m->base_color_texture.matrix[1], 3);
    near(m->base_color_texture.matrix[2], -2), near(m->base_color_texture.matrix[3], 0);
    near(m->base_color_texture.offset[0], 0.5f), near(m->base_color_texture.offset[1], 0.25f);
    assert_int_equal(m->base_color_texture.wrap_u, ES_WRAP_CLAMP);
    assert_int_equal(m->base_color_texture.wrap_v, ES_WRAP_MIRROR);
    assert_int_equal(m->base_color_texture.magnify, ES_FILTER_NEAREST);
    assert_int_equal(m->base_color_texture.minify, ES_FILTER_NEAREST);
    assert_int_equal(m->base_color_texture.mip, ES_MIP_LINEAR);
    assert_int_equal(m->metallic_roughness_texture.mip, ES_MIP_NONE);
    assert_int_equal(m->specular_texture.uv_set, 1);
    /* one image decoded twice: as sRGB for colour and emission, linear for the rest */
    assert_int_equal(object_count(world, ES_OBJECT_TEXTURE), 2);
    assert_ptr_equal(m->base_color_texture.image, m->emission_texture.image);
    assert_ptr_equal(m->normal_texture.image, m->specular_texture.image);
    assert_ptr_not_equal(m->normal_texture.image, m->emission_texture.image);
    assert_int_equal(m->normal_texture.image->width, 2);
    const uint16_t* texels = m->base_color_texture.image->texels;
    assert_true(texels[0] == 65535 && texels[1] == 0 && texels[5] == 65535 && texels[15] == 0);
    es_world_destroy(world);

    /* glass; volume is not known: what is inside is clear, and the warning names it */
    world = load(one_triangle("", ",'material':0", ",'extensionsUsed':['KHR_materials_transmission','KHR_materials_ior','KHR_materials_volume'],'materials':[{'extensions':{'KHR_materials_transmission':{'transmissionFactor':0.75},"
        "'KHR_materials_ior':{'ior':1.33},'KHR_materials_volume':{'thicknessFactor':1}}}]"), triangle, 36);
    m = material_at(world, 0);
    near(m->transmission, 0.75f), near(m->ior, 1.33f);
    assert_true(logged("KHR_materials_volume"));
    es_world_destroy(world);

    world = load(one_triangle("", ",'material':0", ",'extensionsRequired':['KHR_materials_unlit'],'materials':[{'alphaMode':'BLEND','extensions':{'KHR_materials_unlit':{}}}]"), triangle, 36);
    m = material_at(world, 0);
    assert_int_equal(m->model, ES_SURFACE_UNLIT);
    assert_true(m->blend && !m->alpha_mask);
    near(m->alpha_cutoff, 0.5f);
    es_world_destroy(world);

    /* an image in a buffer view */
    uint8_t bytes[112];
    memcpy(bytes, triangle, 36);
    memcpy(bytes + 36, png_2x2, 76);
    world = load("{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0},'material':0}]}]," BUFFER(112) ","
        "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':76}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}],"
        "'images':[{'bufferView':1,'mimeType':'image/png'}],'textures':[{'source':0}],'materials':[{'pbrMetallicRoughness':{'baseColorTexture':{'index':0}}}]}", bytes, 112);
    assert_int_equal(material_at(world, 0)->base_color_texture.image->height, 2);
    es_world_destroy(world);
}

static void bad_images(void** state)
{
    const char* json = one_triangle("", ",'material':0",
        ",'images':[{'uri':'bad.png'}],'textures':[{'source':0}],'materials':[{'normalTexture':{'index':0}}]");
    char kept[8192];
    strcpy(kept, json);
    remove(path_of("bad.png"));
    refuse(ES_FILE_NOT_FOUND, "images[0].uri", kept, triangle, 36);
    uint8_t bytes[76];
    memcpy(bytes, png_2x2, 76);
    for (size_t size = 1; size < 65; size += 3) { /* what follows is only checksums and the end mark */
        write_file("bad.png", bytes, size < 60 ? size : 50);
        refuse(ES_FILE_DAMAGED, "images[0].uri", kept, triangle, 36);
    }
    bytes[18] = 0x4e, bytes[19] = 0x20, bytes[22] = 0x4e, bytes[23] = 0x20; /* 20000 x 20000 */
    write_file("bad.png", bytes, 76);
    refuse(ES_IMAGE_SIZE, "20000 x 20000", kept, triangle, 36);
    bytes[18] = bytes[19] = 0;
    write_file("bad.png", bytes, 76);
    refuse(ES_IMAGE_SIZE, "0 x 20000", kept, triangle, 36);
    write_file("bad.png", "GIF89a and more than that", 25);
    refuse(ES_FILE_DAMAGED, "neither a PNG nor a JPEG", kept, triangle, 36);
    refuse(ES_FILE_UNSUPPORTED, "leads out of the file's folder", one_triangle("", ",'material':0",
        ",'images':[{'uri':'../../etc/passwd'}],'textures':[{'source':0}],'materials':[{'normalTexture':{'index':0}}]"), triangle, 36);
}

/* ---- nodes, lights, cameras ---------------------------------------------------------------------------------------------------- */

static void node_transforms(void** state)
{
    static const struct { const char* node; float x[3], y[3], z[3]; bool shear; } cases[] = {
        {",'matrix':[0,2,0,0, -3,0,0,0, 0,0,4,0, 5,6,7,1]", {0, 2, 0}, {-3, 0, 0}, {0, 0, 4}, false},
        {",'matrix':[-1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]", {-1, 0, 0}, {0, 1, 0}, {0, 0, 1}, false},
        {",'matrix':[0,0,-2,0, 0,3,0,0, -1,0,0,0, 5,6,7,1]", {0, 0, -2}, {0, 3, 0}, {-1, 0, 0}, false},
        {",'matrix':[1,0,0,0, 0,0,0,0, 0,0,1,0, 5,6,7,1]", {1, 0, 0}, {0, 0, 0}, {0, 0, 1}, false},
        {",'matrix':[0,0,0,0, 0,0,2,0, 0,0,0,0, 5,6,7,1]", {0, 0, 0}, {0, 0, 2}, {0, 0, 0}, false},
        {",'matrix':[0,0,0,0, 0,0,0,0, 0,0,0,0, 5,6,7,1]", {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, false},
        {",'translation':[5,6,7],'scale':[-1,0,2]", {-1, 0, 0}, {0, 0, 0}, {0, 0, 2}, false},
        {",'translation':[5,6,7],'rotation':[0,0,0.70710678,0.70710678]", {0, 1, 0}, {-1, 0, 0}, {0, 0, 1}, false},
        {",'translation':[5,6,7],'rotation':[0,0,0,0],'scale':[0,0,0]", {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, false},
        {",'matrix':[1,0,0,0, 1,1,0,0, 0,0,1,0, 5,6,7,1]", {1, 0, 0}, {0, 1.41421356f, 0}, {0, 0, 1}, true},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        es_world* world = load(one_triangle(cases[i].node, "", ""), triangle, 36);
        const float* m = es_world_draw_list(world)->instances[0].transform.m;
        for (int r = 0; r < 3; r++) { near(m[r], cases[i].x[r]), near(m[4 + r], cases[i].y[r]), near(m[8 + r], cases[i].z[r]), near(m[12 + r], 5 + (float)r); }
        assert_int_equal(logged("have shear"), cases[i].shear);
        es_world_destroy(world);
    }
}

static void scenes(void** state)
{
    const char* parts = ",'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]," BUFFER(36) ",'bufferViews':[{'buffer':0,'byteLength':36}],"
                        "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}]";
    static const struct { const char* scenes; uint32_t triangles; } cases[] = {
        {"'scenes':[{'nodes':[0]},{'nodes':[2,1]}]", 1}, {"'scene':1,'scenes':[{'nodes':[0]},{'nodes':[2,1]}]", 3}, {"'scenes':[]", 4}, {"'x':0", 4}, {"'scenes':[{}]", 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char json[1024];
        snprintf(json, sizeof json, "{" ASSET ",%s,'nodes':[{'mesh':0},{'mesh':0,'children':[3]},{'mesh':0},{'mesh':0}]%s}", cases[i].scenes, parts);
        es_world* world = load(json, triangle, 36);
        assert_int_equal(triangles(world), cases[i].triangles);
        assert_int_equal(object_count(world, ES_OBJECT_MESH), cases[i].triangles > 0); /* shared */
        assert_int_equal(logged("nothing to see"), cases[i].triangles == 0);
        es_world_destroy(world);
    }
}

static void lights_and_cameras(void** state)
{
    const char* text = "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0,'children':[1,2,3,4,5]},{'extensions':{'KHR_lights_punctual':{'light':0}}},"
        "{'translation':[1,2,3],'extensions':{'KHR_lights_punctual':{'light':1}}},{'rotation':[1,0,0,0],'extensions':{'KHR_lights_punctual':{'light':2}}},"
        "{'camera':1,'translation':[0,0,9]},{'camera':0,'translation':[0,0,8]}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]," BUFFER(36) ","
        "'bufferViews':[{'buffer':0,'byteLength':36}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}],"
        "'extensionsRequired':['KHR_lights_punctual'],'extensions':{'KHR_lights_punctual':{'lights':["
        "{'type':'directional','intensity':2,'color':[1,0.5,0.25]},{'type':'point','range':7},"
        "{'type':'spot','name':'lamp','intensity':100,'spot':{'innerConeAngle':0.25,'outerConeAngle':0.5}}]}},"
        "'cameras':[{'type':'perspective','perspective':{'yfov':0.5,'znear':0.25}},{'type':'orthographic','orthographic':{'xmag':1,'ymag':2,'znear':0,'zfar':50}}]}";
    es_world* world = load(text, triangle, 36);
    size_t count;
    const es_light_state* lights = es_world_lights(world, &count);
    assert_int_equal(count, 3);
    assert_int_equal(lights[0].type, ES_LIGHT_DIRECTIONAL);
    near(lights[0].radiant[1], 1), near(lights[0].radiant[2], 0.5f), near(lights[0].direction.z, -1);
    assert_int_equal(lights[1].type, ES_LIGHT_POINT);
    near(lights[1].range, 7), near(lights[1].position.y, 2), near(lights[1].radiant[0], 1);
    assert_int_equal(lights[2].type, ES_LIGHT_SPOT);
    near(lights[2].radiant[0], 100), near(lights[2].cos_outer, cosf(0.5f)), near(lights[2].cos_inner, cosf(0.25f)), near(lights[2].direction.z, 1);
    assert_false(logged("has no"));
    /* cameras are numbered as in the file, not as the nodes come */
    es_camera_desc camera;
    assert_int_equal(es_world_get_camera(world, es_world_active_camera(world), &camera), ES_OK);
    assert_false(camera.orthographic);
    near(camera.fov_y, 0.5f), near(camera.near_plane, 0.25f);
    es_world_destroy(world);

    es_world_settings settings = es_default_world_settings();
    settings.camera = 1;
    world = load_with(text, triangle, 36, &settings);
    assert_int_equal(es_world_get_camera(world, es_world_active_camera(world), &camera), ES_OK);
    assert_true(camera.orthographic);
    near(camera.half_height, 2), near(camera.far_plane, 50);
    es_world_destroy(world);
    settings.camera = 2;
    assert_int_equal(import("model.gltf", &settings, &world), ES_SETTING_VALUE);
}

/* ---- skins, morphs, animations --------------------------------------------------------------------------------------------------- */

static void skins_follow_their_joints(void** state)
{
    struct { float p[9]; uint8_t joints[12]; float weights[12]; float bind[32]; } data = {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 9},
        {0.5f, 0.5f, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0}, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1}};
    /* joint 0 at x = 10 below a moved root, joint 1 turned by 90° about z; the mesh node's own transform must not count */
    #define SKIN_JSON(nodes) "{" ASSET ",'scenes':[{'nodes':[0,1]}],'nodes':[{'mesh':0,'skin':0,'translation':[99,0,0]},{'translation':[10,0,0],'children':[2,3]}," nodes "]," \
        "'skins':[{'joints':[2,3],'inverseBindMatrices':3}],'meshes':[{'primitives':[{'attributes':{'POSITION':0,'JOINTS_0':1,'WEIGHTS_0':2}}]}]," BUFFER(224) "," \
        "'bufferViews':[{'buffer':0,'byteLength':224}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}," \
        "{'bufferView':0,'byteOffset':36,'componentType':5121,'count':3,'type':'VEC4'},{'bufferView':0,'byteOffset':48,'componentType':5126,'count':3,'type':'VEC4'}," \
        "{'bufferView':0,'byteOffset':96,'componentType':5126,'count':2,'type':'MAT4'}]}"
    const char* json = SKIN_JSON("{},{'rotation':[0,0,0.70710678,0.70710678]}");
    es_world* world = load(json, &data, sizeof data);
    const es_raster_mesh* mesh = mesh_at(world, 0);
    /* in the axes of the joints' common parent, which stands at x = 10 */
    position_is(mesh, 0, 0, -0.5f, 0);  /* half of (0, 0, 0) and half of (0, -1, 0) */
    position_is(mesh, 1, 0, 0, 0);
    position_is(mesh, 2, 0, 1, 0);      /* weight 2 is made one; joint 9 has weight 0 */
    near(es_world_draw_list(world)->instances[0].transform.m[12], 10);
    assert_int_equal(object_count(world, ES_OBJECT_SKIN), 1);
    es_world_destroy(world);
    data.joints[4] = 2;
    refuse(ES_FILE_DAMAGED, "joint 2", json, &data, sizeof data);
    data.joints[4] = 1;
    data.weights[4] = NAN;
    refuse(ES_FILE_DAMAGED, "WEIGHTS_0", json, &data, sizeof data);
}

static void morphs_begin_with_their_default_weights(void** state)
{
    struct { float p[9], n[9], dp[9], dn[9]; } data = {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 0, 1, 0, 0, 1, 0, 0, 1}, {0, 0, 4, 0, 0, 4, 0, 0, 4}, {0, 2, 0, 0, 0, 0, 0, 0, 0}};
    static const struct { const char *mesh, *node; float z; } cases[] = {{"", "", 0}, {",'weights':[0.5]", "", 2}, {",'weights':[0.5]", ",'weights':[0.25]", 1}};
    for (size_t i = 0; i < 3; i++) {
        char json[2048];
        snprintf(json, sizeof json, "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0%s}],'meshes':[{'primitives':[{'attributes':{'POSITION':0,'NORMAL':1},'targets':[{'POSITION':2,'NORMAL':3}]}]%s}]," BUFFER(144) ","
            "'bufferViews':[{'buffer':0,'byteLength':144}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},{'bufferView':0,'byteOffset':36,'componentType':5126,'count':3,'type':'VEC3'},"
            "{'bufferView':0,'byteOffset':72,'componentType':5126,'count':3,'type':'VEC3'},{'bufferView':0,'byteOffset':108,'componentType':5126,'count':3,'type':'VEC3'}]}", cases[i].node, cases[i].mesh);
        es_world* world = load(json, &data, sizeof data);
        position_is(mesh_at(world, 0), 1, 1, 0, cases[i].z);
        const float* n = mesh_at(world, 0)->normals;
        near(n[1] / n[2], cases[i].z / 2);
        uint32_t count = 1;
        float weight;
        es_mesh handle;
        size_t one = 1;
        assert_int_equal(es_world_enumerate(world, ES_OBJECT_MESH, &handle.id, &one), ES_OK);
        assert_int_equal(es_world_get_morph_weights(world, handle, &weight, &count), ES_OK);
        near(weight, cases[i].z / 4);
        es_world_destroy(world);
    }
}

/* Morph weights by their own path and by a pointer, one mesh for each of the nodes that share a primitive; lights and cameras by pointers. */
static void animations_move_weights_lights_and_cameras(void** state)
{
    struct { float p[9], moved[9], times[2], weights[2], colors[6], numbers[2]; } data = {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 0, 1, 0, 0, 1, 0, 0, 1}, {0, 2}, {0, 4}, {1, 0, 0, 0, 1, 0}, {0.5f, 0.25f}};
    #define POINTER_JSON(pointer) "{" ASSET ",'extensionsUsed':['KHR_lights_punctual','KHR_animation_pointer'],'scenes':[{'nodes':[0,1,2,3]}]," \
        "'nodes':[{'mesh':0},{'mesh':0},{'camera':0},{'extensions':{'KHR_lights_punctual':{'light':0}}}]," \
        "'extensions':{'KHR_lights_punctual':{'lights':[{'type':'spot','spot':{'outerConeAngle':0.7}}]}},'cameras':[{'type':'perspective','perspective':{'yfov':0.8,'znear':0.1}}]," \
        "'meshes':[{'weights':[0.5],'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':1}]}]}]," BUFFER(120) ",'bufferViews':[{'buffer':0,'byteLength':120}]," \
        "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},{'bufferView':0,'byteOffset':36,'componentType':5126,'count':3,'type':'VEC3'}," \
        "{'bufferView':0,'byteOffset':72,'componentType':5126,'count':2,'type':'SCALAR'},{'bufferView':0,'byteOffset':80,'componentType':5126,'count':2,'type':'SCALAR'}," \
        "{'bufferView':0,'byteOffset':88,'componentType':5126,'count':2,'type':'VEC3'},{'bufferView':0,'byteOffset':112,'componentType':5126,'count':2,'type':'SCALAR'}],'animations':[" \
        "{'samplers':[{'input':2,'output':3},{'input':2,'output':4},{'input':2,'output':5}],'channels':[{'sampler':0,'target':{'node':1,'path':'weights'}}," \
        "{'sampler':1,'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'/extensions/KHR_lights_punctual/lights/0/color'}}}}," \
        "{'sampler':2,'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'/extensions/KHR_lights_punctual/lights/0/spot/innerConeAngle'}}}}," \
        "{'sampler':2,'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'/cameras/0/perspective/yfov'}}}}," \
        "{'sampler':0,'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{" pointer "}}}}]}]}"
    const char* json = POINTER_JSON("'pointer':'/extensions/KHR_lights_punctual/lights/0/intensity'");
    es_world* world = load(json, &data, sizeof data);
    assert_int_equal(object_count(world, ES_OBJECT_MESH), 2);
    assert_int_equal(es_world_step(world, 1.5f), ES_OK);
    near(mesh_at(world, 0)->positions[6], 0.5f); /* not animated: its default */
    near(mesh_at(world, 1)->positions[6], 3);
    near(mesh_at(world, 1)->previous_positions[6], 0);
    size_t count = 1;
    es_light light;
    es_light_desc desc;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_LIGHT, &light.id, &count), ES_OK);
    assert_int_equal(es_world_get_light(world, light, &desc), ES_OK);
    near(desc.color[0], 0.25f), near(desc.color[1], 0.75f), near(desc.inner_cone, 0.3125f), near(desc.outer_cone, 0.7f), near(desc.intensity, 3);
    es_camera_desc camera;
    assert_int_equal(es_world_get_camera(world, es_world_active_camera(world), &camera), ES_OK);
    near(camera.fov_y, 0.3125f);
    es_world_destroy(world);

    world = load(POINTER_JSON("'pointer':'/nodes/0/weights'"), &data, sizeof data);
    assert_int_equal(es_world_step(world, 1.0f), ES_OK);
    near(mesh_at(world, 0)->positions[6], 2);
    es_world_destroy(world);
    world = load(POINTER_JSON("'pointer':'/materials/0/emissiveFactor'"), &data, sizeof data);
    assert_true(logged("/materials/0/emissiveFactor"));
    es_world_destroy(world);
    refuse(ES_FILE_DAMAGED, "names number 7", POINTER_JSON("'pointer':'/nodes/7/weights'"), &data, sizeof data);
    refuse(ES_FILE_DAMAGED, "names no object", POINTER_JSON("'pointer':'/nodes/x/weights'"), &data, sizeof data);
    refuse(ES_FILE_DAMAGED, "must begin with a slash", POINTER_JSON("'pointer':'nodes/0/weights'"), &data, sizeof data);
    refuse(ES_FILE_DAMAGED, "absent or no string", POINTER_JSON("'pointer':3"), &data, sizeof data);
    refuse(ES_FILE_DAMAGED, "same target", POINTER_JSON("'pointer':'/nodes/1/weights'"), &data, sizeof data);
    refuse(ES_FILE_DAMAGED, "components", POINTER_JSON("'pointer':'/nodes/1/scale'"), &data, sizeof data);
}

static void animations_move_nodes(void** state)
{
    struct { float p[9], times[2], moves[6], turns[8]; } data = {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 2}, {0, 0, 0, 4, 0, 0}, {0, 0, 0, 1, 0, 0, 1, 0}};
    const char* json = "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0},{}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]," BUFFER(100) ","
        "'bufferViews':[{'buffer':0,'byteLength':100}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
        "{'bufferView':0,'byteOffset':36,'componentType':5126,'count':2,'type':'SCALAR'},{'bufferView':0,'byteOffset':44,'componentType':5126,'count':2,'type':'VEC3'},"
        "{'bufferView':0,'byteOffset':68,'componentType':5126,'count':2,'type':'VEC4'}],'animations':["
        "{'name':'move','samplers':[{'input':1,'output':2}],'channels':[{'sampler':0,'target':{'node':0,'path':'translation'}},{'sampler':0,'target':{'node':1,'path':'translation'}},"
        "{'sampler':0,'target':{'path':'scale'}}]},"
        "{'name':'turn','samplers':[{'input':1,'output':3,'interpolation':'STEP'}],'channels':[{'sampler':0,'target':{'node':0,'path':'rotation'}},{'sampler':0,'target':{'node':0,'path':'weights'}}]}]}";
    static const struct { uint32_t clip; float x; float axis; } cases[] = {{0, 2, 1}, {1, 2, 1}, {2, 0, 1}};
    for (size_t i = 0; i < 3; i++) {
        es_world_settings settings = es_default_world_settings();
        settings.clip = cases[i].clip;
        es_world* world = load_with(json, &data, sizeof data, &settings);
        assert_int_equal(object_count(world, ES_OBJECT_CLIP), 2);
        assert_true(logged("morph weights"));
        assert_int_equal(es_world_step(world, 1.0f), ES_OK);
        const float* m = es_world_draw_list(world)->instances[0].transform.m;
        near(m[12], cases[i].x), near(m[0], cases[i].axis);
        es_world_destroy(world);
    }
    es_world_settings settings = es_default_world_settings();
    settings.clip = 3;
    es_world* world;
    assert_int_equal(import("model.gltf", &settings, &world), ES_SETTING_VALUE);
    data.times[1] = 0;
    refuse(ES_FILE_DAMAGED, "times must increase", json, &data, sizeof data);
    data.times[1] = 2;
    data.moves[4] = INFINITY;
    refuse(ES_FILE_DAMAGED, "samplers[0].output", json, &data, sizeof data);
}

/* ---- refusals ----------------------------------------------------------------------------------------------------------------------- */

static void refusals_of_the_container(void** state)
{
    es_world* world;
    remove(path_of("absent.glb"));
    assert_int_equal(import("absent.glb", NULL, &world), ES_FILE_NOT_FOUND);
    assert_int_equal(import(".", NULL, &world), ES_FILE_TYPE);
    write_file("empty.glb", "", 0);
    assert_int_equal(import("empty.glb", NULL, &world), ES_FILE_EMPTY);
    write_file("model.gltf", png_2x2, sizeof png_2x2);
    assert_int_equal(import("model.gltf", NULL, &world), ES_FILE_TYPE);
    write_file("model.gltf", "  \n", 3);
    assert_int_equal(import("model.gltf", NULL, &world), ES_FILE_TYPE);
    assert_int_equal(es_world_import_gltf(fixture.context, NULL, NULL, &world), ES_INVALID_ARGUMENT);

    uint8_t glb[2048];
    size_t size = make_glb(glb, TRIANGLE_GLB, triangle, 36);
    for (size_t cut = 4; cut < size; cut++) {
        write_file("cut.glb", glb, cut);
        assert_int_equal(import("cut.glb", NULL, &world), ES_FILE_DAMAGED);
    }
    uint32_t words[5];
    memcpy(words, glb, 20);
    static const struct { int word; uint32_t value; es_result result; } lies[] = {{1, 1, ES_FILE_UNSUPPORTED}, {1, 3, ES_FILE_UNSUPPORTED}, {2, 0, ES_FILE_DAMAGED},
        {2, UINT32_MAX, ES_FILE_DAMAGED}, {3, 0, ES_FILE_DAMAGED}, {3, UINT32_MAX, ES_FILE_DAMAGED}, {3, UINT32_MAX - 19, ES_FILE_DAMAGED}, {4, 0x004e4942, ES_FILE_DAMAGED}};
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        uint8_t copy[2048];
        memcpy(copy, glb, size);
        memcpy(copy + 4 * lies[i].word, &lies[i].value, 4);
        write_file("lie.glb", copy, size);
        assert_int_equal(import("lie.glb", NULL, &world), lies[i].result);
    }
}

static void refusals_of_the_text(void** state)
{
    static const struct { es_result result; const char *part, *json; } cases[] = {
        {ES_FILE_DAMAGED, "JSON, line 1", "{]"},
        {ES_FILE_DAMAGED, "JSON, line 2", "{" ASSET ",\n'nodes':[{},]}"},
        {ES_FILE_DAMAGED, "the text ends", "{" ASSET ",'nodes':[{"},
        {ES_FILE_DAMAGED, "follow", "{" ASSET "} {}"},
        {ES_FILE_DAMAGED, "JSON", "{" ASSET ",'x':01}"},
        {ES_FILE_DAMAGED, "JSON", "{" ASSET ",'x':1.}"},
        {ES_FILE_DAMAGED, "JSON", "{" ASSET ",'x':nul}"},
        {ES_FILE_DAMAGED, "JSON", "{" ASSET ",'x':'\\q'}"},
        {ES_FILE_DAMAGED, "JSON", "{" ASSET ",'x':'\\u12g4'}"},
        {ES_FILE_DAMAGED, "", "{" ASSET ",'x':1e999}"},
        {ES_FILE_DAMAGED, "", "{" ASSET ",'x':'\xff\xfe'}"},
        {ES_FILE_DAMAGED, "asset.version", "{}"},
        {ES_FILE_DAMAGED, "asset.version", "{'asset':{'version':2.0}}"},
        {ES_FILE_UNSUPPORTED, "is glTF 1.0", "{'asset':{'version':'1.0'},'meshes':{'a':{}},'accessors':{'b':{'bufferView':'c'}}}"},
        {ES_FILE_UNSUPPORTED, "is glTF 3.0", "{'asset':{'version':'3.0'}}"},
        {ES_FILE_UNSUPPORTED, "glTF 2.1", "{'asset':{'version':'2.1','minVersion':'2.1'}}"},
        {ES_FILE_UNSUPPORTED, "ACME_gizmo", "{" ASSET ",'extensionsRequired':['KHR_materials_unlit','ACME_gizmo'],'nodes':7}"},
        {ES_FILE_DAMAGED, "nodes: must be an array", "{" ASSET ",'nodes':{}}"},
        {ES_FILE_DAMAGED, "nodes[0].mesh", "{" ASSET ",'nodes':[{'mesh':-1}]}"},
        {ES_FILE_DAMAGED, "nodes[0].mesh", "{" ASSET ",'nodes':[{'mesh':0.5}]}"},
        {ES_FILE_DAMAGED, "nodes[0].mesh", "{" ASSET ",'nodes':[{'mesh':4294967296}]}"},
        {ES_FILE_DAMAGED, "nodes[0].mesh", "{" ASSET ",'nodes':[{'mesh':null}]}"},
        {ES_FILE_DAMAGED, "nodes[0].mesh", "{" ASSET ",'nodes':[{'mesh':0}]}"},
        {ES_FILE_DAMAGED, "nodes[0].children[1]", "{" ASSET ",'nodes':[{'children':[1,'2']},{}]}"},
        {ES_FILE_DAMAGED, "nodes[0].children", "{" ASSET ",'nodes':[{'children':[1]}]}"},
        {ES_FILE_DAMAGED, "loop", "{" ASSET ",'nodes':[{'children':[1]},{'children':[0]}]}"},
        {ES_FILE_DAMAGED, "loop", "{" ASSET ",'nodes':[{'children':[0]}]}"},
        {ES_FILE_DAMAGED, "one parent", "{" ASSET ",'nodes':[{'children':[2]},{'children':[2]},{}]}"},
        {ES_FILE_DAMAGED, "named twice", "{" ASSET ",'scenes':[{'nodes':[0,0]}],'nodes':[{}]}"},
        {ES_FILE_DAMAGED, "scene", "{" ASSET ",'scene':3,'scenes':[{'nodes':[0]}],'nodes':[{}]}"},
        {ES_FILE_DAMAGED, "nodes[0].translation", "{" ASSET ",'nodes':[{'translation':[1,2]}]}"},
        {ES_FILE_DAMAGED, "nodes[0].scale", "{" ASSET ",'nodes':[{'scale':[1,2,1e30]}]}"},
        {ES_FILE_DAMAGED, "last row", "{" ASSET ",'nodes':[{'matrix':[1,0,0,1,0,1,0,0,0,0,1,0,0,0,0,1]}]}"},
        {ES_FILE_DAMAGED, "given twice", "{" ASSET ",'buffers':[],'buffers':[]}"},
        {ES_FILE_DAMAGED, "without escapes", "{" ASSET ",'b\\u0075ffers':[]}"},
        {ES_FILE_DAMAGED, "buffers[0].byteLength", "{" ASSET ",'buffers':[{'uri':'model.bin','byteLength':-1}]}"},
        {ES_FILE_DAMAGED, "buffers[0].byteLength", "{" ASSET ",'buffers':[{'uri':'model.bin'}]}"},
        {ES_FILE_DAMAGED, "buffers[0].uri", "{" ASSET ",'buffers':[{'uri':7,'byteLength':1}]}"},
        {ES_FILE_DAMAGED, "buffers[0].uri", "{" ASSET ",'buffers':[{'byteLength':1}]}"},
        {ES_FILE_DAMAGED, "has 36 bytes", "{" ASSET ",'buffers':[{'uri':'model.bin','byteLength':37}]}"},
        {ES_FILE_DAMAGED, "has 36 bytes", "{" ASSET ",'buffers':[{'uri':'model.bin','byteLength':9007199254740992}]}"},
        {ES_FILE_NOT_FOUND, "no.bin", "{" ASSET ",'buffers':[{'uri':'no.bin','byteLength':1}]}"},
        {ES_FILE_UNSUPPORTED, "folder", "{" ASSET ",'buffers':[{'uri':'/etc/passwd','byteLength':1}]}"},
        {ES_FILE_UNSUPPORTED, "folder", "{" ASSET ",'buffers':[{'uri':'%2fetc/passwd','byteLength':1}]}"},
        {ES_FILE_UNSUPPORTED, "folder", "{" ASSET ",'buffers':[{'uri':'x/../../model.bin','byteLength':1}]}"},
        {ES_FILE_UNSUPPORTED, "folder", "{" ASSET ",'buffers':[{'uri':'%2e%2e/model.bin','byteLength':1}]}"},
        {ES_FILE_UNSUPPORTED, "folder", "{" ASSET ",'buffers':[{'uri':'file:///etc/passwd','byteLength':1}]}"},
        {ES_FILE_DAMAGED, "%", "{" ASSET ",'buffers':[{'uri':'a%0','byteLength':1}]}"},
        {ES_FILE_DAMAGED, "%", "{" ASSET ",'buffers':[{'uri':'model.bin%00.x','byteLength':1}]}"},
        {ES_FILE_DAMAGED, "3 bytes", "{" ASSET ",'buffers':[{'uri':'data:;base64,AAAA','byteLength':4}]}"},
        {ES_FILE_DAMAGED, "alphabet", "{" ASSET ",'buffers':[{'uri':'data:;base64,AA*A','byteLength':3}]}"},
        {ES_FILE_DAMAGED, "length", "{" ASSET ",'buffers':[{'uri':'data:;base64,AAAAA','byteLength':3}]}"},
        {ES_FILE_DAMAGED, "','", "{" ASSET ",'buffers':[{'uri':'data:base64','byteLength':3}]}"},
        {ES_FILE_DAMAGED, "primitives", "{" ASSET ",'meshes':[{'primitives':[{'mode':4}]}]}"},
        {ES_FILE_DAMAGED, "alphaMode", NULL},
    };
    write_file("model.bin", triangle, 36);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        refuse(cases[i].result, cases[i].part, cases[i].json ? cases[i].json : one_triangle("", ",'material':0", ",'materials':[{'alphaMode':'GLASS'}]"), NULL, 0);
    }
    /* nesting: within the limit and far beyond it */
    for (int depth = 100; depth <= 1000000; depth *= 100) {
        size_t length = (size_t)depth * 2 + 64;
        char* text = malloc(length);
        int used = sprintf(text, "{\"asset\":{\"version\":\"2.0\"},\"extras\":");
        memset(text + used, '[', (size_t)depth);
        memset(text + used + depth, ']', (size_t)depth);
        text[used + 2 * depth] = '}';
        write_file("model.gltf", text, (size_t)used + 2 * (size_t)depth + 1);
        free(text);
        es_world* world;
        assert_int_equal(import("model.gltf", NULL, &world), depth <= 100 ? ES_OK : ES_FILE_DAMAGED);
        es_world_destroy(world);
    }
}

/* Views and accessors that lie about their size: `view` and `accessor` replace the triangle's. */
static void refusals_of_accessors(void** state)
{
    static const struct { const char *part, *view, *accessor; } cases[] = {
        {"bufferViews[0].buffer", "{'buffer':1,'byteLength':36}", ""},
        {"bufferViews[0]", "{'buffer':0,'byteLength':37}", ""},
        {"bufferViews[0]", "{'buffer':0,'byteOffset':36,'byteLength':1}", ""},
        {"bufferViews[0]", "{'buffer':0,'byteOffset':9007199254740991,'byteLength':36}", ""},
        {"bufferViews[0].byteOffset", "{'buffer':0,'byteOffset':18446744073709551615,'byteLength':36}", ""},
        {"", "{'buffer':0,'byteLength':36,'byteStride':3}", ""},
        {"byteStride is 8", "{'buffer':0,'byteLength':36,'byteStride':8}", ""},
        {"accessors[0]: needs 252 bytes", "{'buffer':0,'byteLength':36,'byteStride':120}", ""},
        {"accessors[0].bufferView", "", "'bufferView':1,'componentType':5126,'count':3,'type':'VEC3'"},
        {"accessors[0]: needs", "", "'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'"},
        {"accessors[0]: needs", "", "'bufferView':0,'componentType':5126,'count':2147483647,'type':'MAT4'"},
        {"accessors[0]: needs", "", "'bufferView':0,'byteOffset':4,'componentType':5126,'count':3,'type':'VEC3'"},
        {"accessors[0].count", "", "'bufferView':0,'componentType':5126,'count':0,'type':'VEC3'"},
        {"accessors[0].count", "", "'bufferView':0,'componentType':5126,'count':2147483648,'type':'VEC3'"},
        {"accessors[0].componentType", "", "'bufferView':0,'componentType':5124,'count':3,'type':'VEC3'"},
        {"accessors[0].componentType", "", "'bufferView':0,'componentType':5130,'count':1,'type':'VEC3'"},
        {"components", "", "'bufferView':0,'componentType':5126,'count':3,'type':'VEC2'"},
        {"components", "", "'bufferView':0,'componentType':5125,'count':3,'type':'VEC3'"},
        {"type", "", "'bufferView':0,'componentType':5126,'count':3,'type':'VEC5'"},
        {"sparse", "", "'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':4,'indices':{'bufferView':0,'componentType':5121},'values':{'bufferView':0}}"},
        {"sparse.indices", "", "'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':2,'indices':{'bufferView':0,'componentType':5121},'values':{'bufferView':0}}"},
        {"sparse.values", "", "'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':1,'indices':{'bufferView':0,'componentType':5121},'values':{'bufferView':0,'byteOffset':30}}"},
        {"sparse.indices", "", "'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':1,'indices':{'bufferView':9,'componentType':5121},'values':{'bufferView':0}}"},
        {"sparse.indices.componentType", "", "'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':1,'indices':{'bufferView':0,'componentType':5126},'values':{'bufferView':0}}"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char json[2048];
        snprintf(json, sizeof json, "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]," BUFFER(36) ",'bufferViews':[%s],'accessors':[{%s}]}",
            *cases[i].view ? cases[i].view : "{'buffer':0,'byteLength':36}", *cases[i].accessor ? cases[i].accessor : "'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'");
        refuse(ES_FILE_DAMAGED, cases[i].part, json, triangle, 36);
    }
    refuse(ES_FILE_UNSUPPORTED, "accessors[0].count",
        "{" ASSET ",'accessors':[{'componentType':5126,'count':2147483647,'type':'VEC3'}]}", NULL, 0);
}

static void refusals_of_geometry(void** state)
{
    static const float wrong[] = {NAN, INFINITY, -INFINITY, 1e30f, -2e9f};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        float bad[9];
        memcpy(bad, triangle, sizeof bad);
        bad[5] = wrong[i];
        refuse(ES_FILE_DAMAGED, "meshes[0].primitives[0].attributes.POSITION: element 1 of accessors[0]", one_triangle("", "", ""), bad, sizeof bad);
    }
    /* indices: beyond the vertices, restart values, of a wrong type */
    struct { float p[9]; uint8_t indices[4]; } data = {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 1, 2, 0}};
    const char* json = "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}]," BUFFER(40) ","
        "'bufferViews':[{'buffer':0,'byteLength':40}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},{'bufferView':0,'byteOffset':36,'componentType':5121,'count':3,'type':'SCALAR'}]}";
    es_world_destroy(load(json, &data, sizeof data));
    data.indices[2] = 3;
    refuse(ES_FILE_DAMAGED, "vertex 3", json, &data, sizeof data);
    data.indices[2] = 255;
    refuse(ES_FILE_DAMAGED, "vertex 255", json, &data, sizeof data);
    refuse(ES_FILE_DAMAGED, "indices", one_triangle("", ",'indices':0", ""), triangle, 36);
    refuse(ES_FILE_DAMAGED, "indices", one_triangle("", ",'indices':5", ""), triangle, 36);
    refuse(ES_FILE_DAMAGED, "material", one_triangle("", ",'material':0", ""), triangle, 36);
    refuse(ES_FILE_DAMAGED, "mode", one_triangle("", ",'mode':7", ""), triangle, 36);
    /* the same defects in a mesh that nothing shows */
    refuse(ES_FILE_DAMAGED, "COLOR_0", "{" ASSET ",'meshes':[{'primitives':[{'attributes':{'POSITION':0,'COLOR_0':1}}]}],'accessors':["
        "{'componentType':5126,'count':3,'type':'VEC3'},{'componentType':5126,'count':4,'type':'VEC3'}]}", NULL, 0);
    /* what is odd but fine: no area, normals of no length */
    float nothing[9] = {0};
    es_world* world = load(one_triangle("", "", ""), nothing, sizeof nothing);
    assert_int_equal(triangles(world), 1);
    es_world_destroy(world);
}

static void the_memory_cap_holds(void** state)
{
    es_context* normal = fixture.context;
    write_file("bad.png", png_2x2, sizeof png_2x2);
    write_gltf("model.gltf", one_triangle("", "", ",'images':[{'uri':'bad.png'}],'textures':[{'source':0}],'materials':[{'normalTexture':{'index':0}}]"));
    write_file("model.bin", triangle, 36);
    es_world* world;
    assert_int_equal(import("model.gltf", NULL, &world), ES_OK);
    size_t enough = es_context_peak_bytes(normal);
    es_world_destroy(world);
    /* at every cap the answer is a world or a refusal, and nothing is lost */
    size_t refused = 0, accepted = 0;
    for (size_t cap = 4096; cap < 2 * enough + 65536; cap += 1021) {
        fixture.context = new_context(cap);
        es_result result = import("model.gltf", NULL, &world);
        assert_true(result == ES_OK || result == ES_MEMORY_CAP);
        *(result == ES_OK ? &accepted : &refused) += 1;
        es_world_destroy(world);
        es_context_destroy(fixture.context);
    }
    fixture.context = normal;
    assert_true(refused > 0 && accepted > 0);
    /* 60 kB that become structures of some 80 MB: they are counted before they are made */
    enum { MATERIALS = 20000 };
    char* many = malloc(3 * MATERIALS + 100);
    int used = sprintf(many, "{\"asset\":{\"version\":\"2.0\"},\"materials\":[{}");
    for (int i = 1; i < MATERIALS; i++) { used += sprintf(many + used, ",{}"); }
    used += sprintf(many + used, "]}");
    write_file("many.gltf", many, (size_t)used);
    free(many);
    fixture.context = new_context(16u << 20);
    assert_int_equal(import("many.gltf", NULL, &world), ES_MEMORY_CAP);
    es_context_destroy(fixture.context);
    /* a file larger than the cap is not even read */
    char* large = malloc(1 << 20);
    memset(large, ' ', 1 << 20);
    large[0] = '{';
    write_file("large.gltf", large, 1 << 20);
    free(large);
    fixture.context = new_context(1 << 19);
    assert_int_equal(import("large.gltf", NULL, &world), ES_MEMORY_CAP);
    es_context_destroy(fixture.context);
    fixture.context = normal;
}

/* A few kilobytes that name the same sixteen million elements a hundred times: an end within the bound on time. */
static void small_files_cannot_ask_for_much(void** state)
{
    char json[16384];
    int used = sprintf(json, "{" ASSET "," SCENE1 ",'nodes':[{'mesh':0}],'accessors':[{'componentType':5126,'count':16777216,'type':'VEC3'}],"
        "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':0}");
    for (int i = 0; i < 100; i++) { used += sprintf(json + used, ",{'POSITION':0}"); }
    sprintf(json + used, "]}]}]}");
    es_context* normal = fixture.context;
    fixture.context = new_context(1u << 30);
    refuse(ES_FILE_UNSUPPORTED, "accessor elements", json, NULL, 0);
    es_context_destroy(fixture.context);
    fixture.context = new_context(1u << 26);
    refuse(ES_MEMORY_CAP, "", json, NULL, 0);
    es_context_destroy(fixture.context);
    fixture.context = normal;
}

/* ---- damaged at random ------------------------------------------------------------------------------------------------------------- */

static uint64_t random_state = 0x9e3779b97f4a7c15ull;
static uint32_t random_number(void) { /* xorshift64*: the same cases on every run */
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return (uint32_t)((random_state * 0x2545f4914f6cdd1dull) >> 32);
}

static void damaged_files_do_no_harm(void** state)
{
    /* a bit of everything: skin, morph, sparse, animation, image, camera, light, material extensions */
    const char* json = "{" ASSET ",'extensionsUsed':['KHR_lights_punctual','KHR_texture_transform'],'scene':0,'scenes':[{'nodes':[0,1,3]}],"
        "'nodes':[{'mesh':0,'skin':0},{'children':[2],'matrix':[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]},{'rotation':[0,0,0,1],'camera':0,'extensions':{'KHR_lights_punctual':{'light':0}}},{'mesh':1,'weights':[0.5]}],"
        "'skins':[{'joints':[1,2],'inverseBindMatrices':3}],'cameras':[{'type':'perspective','perspective':{'yfov':0.8,'znear':0.1}}],"
        "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'JOINTS_0':1,'WEIGHTS_0':2},'material':0}]},"
        "{'primitives':[{'attributes':{'POSITION':0,'NORMAL':0,'COLOR_0':2},'indices':4,'mode':5,'targets':[{'POSITION':5}]}]}],"
        "'buffers':[{'byteLength':340}],'bufferViews':[{'buffer':0,'byteLength':224},{'buffer':0,'byteOffset':224,'byteLength':40},{'buffer':0,'byteOffset':264,'byteLength':76}],"
        "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},{'bufferView':0,'byteOffset':36,'componentType':5121,'count':3,'type':'VEC4'},"
        "{'bufferView':0,'byteOffset':48,'componentType':5126,'count':3,'type':'VEC4'},{'bufferView':0,'byteOffset':96,'componentType':5126,'count':2,'type':'MAT4'},"
        "{'bufferView':1,'componentType':5123,'count':4,'type':'SCALAR'},"
        "{'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':1,'indices':{'bufferView':1,'byteOffset':2,'componentType':5121},'values':{'bufferView':1,'byteOffset':16}}},"
        "{'bufferView':1,'byteOffset':8,'componentType':5126,'count':2,'type':'SCALAR'},{'bufferView':1,'byteOffset':16,'componentType':5126,'count':2,'type':'VEC3'}],"
        "'animations':[{'samplers':[{'input':6,'output':7}],'channels':[{'sampler':0,'target':{'node':2,'path':'translation'}}]}],"
        "'images':[{'bufferView':2,'mimeType':'image/png'}],'samplers':[{'wrapS':33071}],'textures':[{'source':0,'sampler':0}],"
        "'materials':[{'alphaMode':'MASK','pbrMetallicRoughness':{'baseColorTexture':{'index':0,'extensions':{'KHR_texture_transform':{'offset':[0,1]}}}}}],"
        "'extensions':{'KHR_lights_punctual':{'lights':[{'type':'spot','spot':{'outerConeAngle':0.5},'color':[1,1,1]}]}}}";
    uint8_t bytes[340] = {0};
    float weights[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, times[2] = {0, 1};
    uint16_t strip[4] = {0, 1, 2, 0};
    memcpy(bytes, triangle, 36);
    memcpy(bytes + 48, weights, 48);
    for (int j = 0; j < 2; j++) {
        for (int i = 0; i < 4; i++) { memcpy(bytes + 96 + 64 * j + 20 * i, &weights[0], 4); }
    }
    memcpy(bytes + 224, strip, 8);
    memcpy(bytes + 232, times, 8);
    memcpy(bytes + 264, png_2x2, 76);
    static uint8_t glb[16384], copy[16384];
    size_t size = make_glb(glb, json, bytes, sizeof bytes);
    es_world* world;
    write_file("fuzz.glb", glb, size);
    es_result whole = import("fuzz.glb", NULL, &world);
    if (whole != ES_OK) { fail_msg("%s", es_context_message(fixture.context)); }
    assert_int_equal(triangles(world), 3);
    es_world_destroy(world);

    es_context* normal = fixture.context;
    fixture.context = new_context(64u << 20); /* what a damaged size may ask for is bounded */
    size_t text_end = size - 340 - 8, accepted = 0, total = 3000;
    for (size_t i = 0; i < total; i++) {
        memcpy(copy, glb, size);
        size_t length = size, begin = 0;
        bool as_text = i % 3 == 2; /* the same text without its container: buffers[0] has no uri then, so a late refusal at best */
        switch (i % 4) {
        case 0: length = 1 + random_number() % size; break;
        case 1: copy[random_number() % size] ^= (uint8_t)(1u << random_number() % 8); break;
        case 2:
            for (uint32_t flips = 1 + random_number() % 8; flips; flips--) { copy[20 + random_number() % (text_end - 20)] = (uint8_t)(32 + random_number() % 96); }
            break;
        default: /* another digit where a digit is: the text stays JSON and lies */
            for (uint32_t flips = 1 + random_number() % 4; flips;) {
                size_t at = 20 + random_number() % (size - 20);
                if (at >= text_end) {
                    copy[at] = (uint8_t)random_number();
                    flips--;
                } else if (copy[at] >= '0' && copy[at] <= '9') {
                    copy[at] = (uint8_t)('0' + random_number() % 10);
                    flips--;
                }
            }
            break;
        }
        if (as_text && length > text_end) {
            begin = 20;
            length = text_end - 20;
        }
        write_file("fuzz.glb", copy + begin, length);
        if (import("fuzz.glb", NULL, &world) == ES_OK) {
            accepted++;
            es_world_step(world, 0.1f);
            es_world_draw_list(world);
        }
        es_world_destroy(world);
    }
    es_context_destroy(fixture.context);
    fixture.context = normal;
    assert_true(accepted > 0 && accepted < total);
    print_message("%zu of %zu damaged files load\n", accepted, total);
}

/* ---- the shared assets --------------------------------------------------------------------------------------------------------------- */

static const char* shared_folder(void)
{
    static char path[4096];
    const char* given = getenv("EARTHSHINE_SHARED");
#ifdef ES_TEST_SOURCE_DIR
    snprintf(path, sizeof path, "%s/assets", given ? given : ES_TEST_SOURCE_DIR "/../shared");
#else
    snprintf(path, sizeof path, "%s/assets", given ? given : "../shared");
#endif
    return path;
}

/* INDEX.md's number of triangles, those of all instances where it gives both; -1 when it gives none. */
static long indexed_triangles(const char* index, const char* name)
{
    char key[512];
    snprintf(key, sizeof key, "`%s`", name);
    const char* line = strstr(index, key);
    if (!line) { return -1; }
    const char* end = strchr(line, '\n');
    long count = -1;
    for (const char* c = line; c < end; c++) {
        if (strncmp(c, " tri", 4) == 0 && (c[4] == ',' || c[4] == ' ')) {
            const char* digits = c;
            while (digits[-1] >= '0' && digits[-1] <= '9') { digits--; }
            count = strtol(digits, NULL, 10);
            const char* instanced = strstr(c, "tri (");
            if (instanced && instanced < end) { count = strtol(instanced + 5, NULL, 10); }
            break;
        }
    }
    return count;
}

static char* whole_file(const char* path)
{
    FILE* file = fopen(path, "rb");
    if (!file) { return NULL; }
    fseek(file, 0, SEEK_END);
    size_t size = (size_t)ftell(file);
    rewind(file);
    char* text = malloc(size + 1);
    text[fread(text, 1, size, file)] = 0;
    fclose(file);
    return text;
}

static void shared_assets(void** state)
{
    char path[8192];
    snprintf(path, sizeof path, "%s/EXPECTED.tsv", shared_folder());
    char* expected = whole_file(path);
    snprintf(path, sizeof path, "%s/INDEX.md", shared_folder());
    char* index = whole_file(path);
    if (!expected || !index) {
        free(expected);
        free(index);
        print_message("no shared assets in %s\n", shared_folder());
        skip();
    }
    uint32_t count = 0, compared = 0;
    char* rest = NULL;
    for (char* line = strtok_r(expected, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) {
        char* tab = strchr(line, '\t');
        if (!tab || strncmp(line, "gltf", 4) != 0) { continue; }
        *tab = 0;
        char* outcome = strchr(tab + 1, '\t') + 1;
        *strchr(outcome, '\t') = 0;
        snprintf(path, sizeof path, "%s/%s", shared_folder(), line);
        fixture.log[0] = 0;
        es_world* world;
        es_result result = es_world_import_gltf(fixture.context, path, NULL, &world);
        if (strcmp(outcome, "load") == 0 && result != ES_OK) { fail_msg("%s: %s", line, es_context_message(fixture.context)); }
        if (strncmp(outcome, "reject", 6) == 0 && result != ES_FILE_UNSUPPORTED) { fail_msg("%s is not refused but %s", line, es_result_name(result)); }
        if (result == ES_OK) {
            long wanted = indexed_triangles(index, line);
            if (wanted >= 0) {
                if ((long)triangles(world) != wanted) { fail_msg("%s: %u triangles, %ld expected", line, triangles(world), wanted); }
                compared++;
            }
            assert_int_equal(es_world_step(world, 0.05f), ES_OK);
        }
        es_world_destroy(world);
        count++;
    }
    free(expected);
    free(index);
    print_message("%u files, triangles compared in %u\n", count, compared);
    assert_true(count > 0);
}

static void the_same_world_every_time(void** state)
{
    static const char* const names[] = {"gltf/CesiumMan/glTF-Binary/CesiumMan.glb", "gltf/InterpolationTest/glTF-Binary/InterpolationTest.glb",
        "gltf/AnimatedMorphCube/glTF-Quantized/AnimatedMorphCube.gltf", "gltf/NegativeScaleTest/glTF-Binary/NegativeScaleTest.glb"};
    uint32_t found = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char path[8192];
        snprintf(path, sizeof path, "%s/%s", shared_folder(), names[i]);
        if (access(path, R_OK) != 0) { continue; }
        uint64_t hashes[3];
        for (int run = 0; run < 3; run++) {
            es_context* context = new_context(0);
            es_world* world;
            assert_int_equal(es_world_import_gltf(context, path, NULL, &world), ES_OK);
            assert_int_equal(es_world_step(world, 0.25f), ES_OK);
            hashes[run] = world_hash(world);
            es_world_destroy(world);
            es_context_destroy(context);
        }
        assert_true(hashes[0] == hashes[1] && hashes[1] == hashes[2]);
        found++;
    }
    if (!found) {
        print_message("no shared assets in %s\n", shared_folder());
        skip();
    }
}

int main(void)
{
#ifndef ES_WITH_TINYGLTF
    printf("this build has no glTF importer\n");
    return 77;
#endif
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_triangle_gets_camera_and_light),
        cmocka_unit_test(containers_give_the_same_world),
        cmocka_unit_test(component_types),
        cmocka_unit_test(interleaved_attributes),
        cmocka_unit_test(colors_of_four),
        cmocka_unit_test(sparse_and_viewless_accessors),
        cmocka_unit_test(primitive_modes),
        cmocka_unit_test(materials),
        cmocka_unit_test(bad_images),
        cmocka_unit_test(node_transforms),
        cmocka_unit_test(scenes),
        cmocka_unit_test(lights_and_cameras),
        cmocka_unit_test(skins_follow_their_joints),
        cmocka_unit_test(morphs_begin_with_their_default_weights),
        cmocka_unit_test(animations_move_weights_lights_and_cameras),
        cmocka_unit_test(animations_move_nodes),
        cmocka_unit_test(refusals_of_the_container),
        cmocka_unit_test(refusals_of_the_text),
        cmocka_unit_test(refusals_of_accessors),
        cmocka_unit_test(refusals_of_geometry),
#ifdef ES_WITH_PNG
        cmocka_unit_test(image_based_light),
#endif
        cmocka_unit_test(the_memory_cap_holds),
        cmocka_unit_test(small_files_cannot_ask_for_much),
        cmocka_unit_test(damaged_files_do_no_harm),
        cmocka_unit_test(shared_assets),
        cmocka_unit_test(the_same_world_every_time),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
