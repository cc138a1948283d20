/* When memory or disk is short: every operation that allocates or writes, with every allocation failing in turn, under caps from next to
 * nothing to ample, and on a full disk.
 *
 * Whatever fails says so once, with the right result, leaves no file behind and none changed, gives everything back, and when it is tried
 * again with enough it gives the same bits as if nothing had been. What third parties allocate by themselves does not go through a context
 * and cannot be made to fail here: tinygltf's structures, which are counted by an estimate, and OpenEXRCore's headers and buffers of one
 * chunk. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dirent.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "gi/gi.h"
#include "gi/reference/bvh.h"
#include "platform/random.h"
#include "platform/maths.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { MOST_FAILURES = 24, CAPS = 12 };
#else
enum { MOST_FAILURES = 160, CAPS = 40 };
#endif
enum { WIDTH = 20, HEIGHT = 12 };

/* ---- scarce memory ------------------------------------------------------------------------------------------------------------------- */

/* `left` allocations succeed, then all fail, or only the next; -1: none does. */
static struct { long left, seen; bool once; size_t live, most; int messages; es_result item; } memory;

static void* scarce_allocate(void* user, size_t size, size_t alignment)
{
    memory.seen++;
    if (memory.left == 0) {
        if (memory.once) memory.left = -1;
        return NULL;
    }
    if (memory.left > 0) memory.left--;
    void* pointer;
    if (posix_memalign(&pointer, alignment, size)) return NULL;
    memory.live += size;
    if (memory.live > memory.most) memory.most = memory.live;
    return pointer;
}

static void scarce_release(void* user, void* pointer, size_t size)
{
    memory.live -= size;
    free(pointer);
}

static void count_errors(void* user, es_log_level level, es_result item, const char* message)
{
    if (!message[0] || strpbrk(message, "\r\n")) fail_msg("not one line: '%s'", message);
    if (level != ES_LOG_ERROR) return;
    memory.messages++;
    memory.item = item;
}

/* ---- what the operations work on -------------------------------------------------------------------------------------------------------- */

typedef struct bench {
    es_context* context;
    es_world* world;
    es_node node;         /* of the sphere */
    es_mesh sphere;
    es_material painted;  /* its */
    es_image a, b;        /* two pictures of one size */
    es_renderer* renderer;
    uint64_t result;      /* of an operation that keeps nothing */
} bench;

static char folder[64];

static const char* path_of(const char* name)
{
    static char paths[4][512];
    static unsigned turn;
    char* path = paths[turn++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static uint64_t hash_of_file(const char* path)
{
    FILE* file = fopen(path, "rb");
    if (!file) return 0;
    char bytes[4096];
    uint64_t hash = 1;
    for (size_t n; (n = fread(bytes, 1, sizeof bytes, file)) > 0;) hash = es_hash_bytes(hash, bytes, n);
    fclose(file);
    return hash;
}

/* Names and contents of all files there are. */
static uint64_t hash_of_folder(void)
{
    struct dirent** entries;
    uint64_t hash = 0;
    int count = scandir(folder, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        const char* name = entries[i]->d_name;
        if (name[0] != '.') {
            uint64_t content = hash_of_file(path_of(name));
            hash = es_hash_bytes(es_hash_bytes(hash, name, strlen(name)), &content, sizeof content);
        }
        free(entries[i]);
    }
    free(entries);
    return hash;
}

static es_result add_object(bench* w, const es_mesh_desc* mesh, const es_material_desc* material, es_node node, es_mesh* made, es_material* used)
{
    es_material m = {0};
    es_instance instance;
    es_result result = es_world_add_mesh(w->world, mesh, made);
    if (!result) result = es_world_add_material(w->world, "m", material, &m);
    if (used) *used = m;
    return result ? result : es_world_add_instance(w->world, &(es_instance_desc){.mesh = *made, .material = m, .node = node}, &instance);
}

/* An open box with a ball of some triangles in it, textured, lit by a spot and by its ceiling. */
static es_result make_world(bench* w)
{
    static const float box[8][3] = {{-2, 0, -2}, {2, 0, -2}, {2, 0, 2}, {-2, 0, 2}, {-2, 3, -2}, {2, 3, -2}, {2, 3, 2}, {-2, 3, 2}};
    static const uint32_t sides[] = {0, 2, 1, 0, 3, 2, 0, 1, 5, 0, 5, 4, 0, 4, 7, 0, 7, 3, 1, 2, 6, 1, 6, 5};
    static const uint32_t ceiling[] = {4, 5, 6, 4, 6, 7};
    enum { SEGMENTS = 8 };
    float ball[(SEGMENTS + 1) * (SEGMENTS + 1)][3], uvs[(SEGMENTS + 1) * (SEGMENTS + 1)][2];
    uint32_t indices[SEGMENTS * SEGMENTS * 6], n = 0;
    for (int i = 0; i <= SEGMENTS; i++)
        for (int j = 0; j <= SEGMENTS; j++) {
            float a = 6.2831853f * (float)j / SEGMENTS, b = 3.1415927f * (float)i / SEGMENTS, *p = ball[i * (SEGMENTS + 1) + j];
            p[0] = 0.7f * es_sin(b) * es_cos(a), p[1] = 0.7f * es_cos(b), p[2] = -0.7f * es_sin(b) * es_sin(a);
            uvs[i * (SEGMENTS + 1) + j][0] = (float)j / SEGMENTS, uvs[i * (SEGMENTS + 1) + j][1] = (float)i / SEGMENTS;
        }
    for (uint32_t i = 0; i < SEGMENTS; i++)
        for (uint32_t j = 0; j < SEGMENTS; j++) {
            uint32_t a = i * (SEGMENTS + 1) + j, b = a + SEGMENTS + 1;
            const uint32_t two[6] = {a, b, b + 1, a, b + 1, a + 1};
            memcpy(indices + n, two, sizeof two);
            n += 6;
        }
    static const uint8_t texels[4 * 4 * 4] = {255, 0, 0, 255, 9, 200, 9, 255, 30, 40, 250, 255, 255, 255, 255, 255};
    es_texture texture = {0};
    es_mesh mesh;
    es_camera camera;
    es_light light;
    es_material_desc gray = es_default_material_desc(), lamp = gray, painted = gray;
    lamp.emission[0] = lamp.emission[1] = lamp.emission[2] = 2;
    painted.roughness = 0.4f;
    es_node_desc middle = {.transform = {.translation = {0, 1, 0}}}, front = {.transform = {.translation = {0, 1.5f, 5}}};
    es_camera_desc lens = es_default_camera_desc();
    es_light_desc spot = es_default_light_desc();
    spot.type = ES_LIGHT_POINT;
    spot.intensity = 20;
    es_result result = es_world_create(w->context, NULL, &w->world);
    if (!result) result = es_world_add_node(w->world, &middle, &w->node);
    if (!result) result = es_world_add_texture(w->world, &(es_texture_desc){"t", 4, 4, texels, true}, &texture);
    if (!result) {
        painted.base_color_texture = (es_texture_use){.image = es_world_texture_image(w->world, texture), .matrix = {1, 0, 0, 1}};
        result = add_object(w, &(es_mesh_desc){.name = "ball", .vertex_count = (SEGMENTS + 1) * (SEGMENTS + 1), .triangle_count = n / 3, .positions = ball[0], .uv0 = uvs[0],
                                   .indices = indices}, &painted, w->node, &w->sphere, &w->painted);
    }
    if (!result) result = add_object(w, &(es_mesh_desc){.vertex_count = 8, .triangle_count = 8, .positions = box[0], .indices = sides, .flat_normals = true}, &gray, (es_node){0}, &mesh, NULL);
    if (!result) result = add_object(w, &(es_mesh_desc){.vertex_count = 8, .triangle_count = 2, .positions = box[0], .indices = ceiling, .flat_normals = true}, &lamp, (es_node){0}, &mesh, NULL);
    if (!result) result = es_world_add_node(w->world, &front, &lens.node);
    if (!result) result = es_world_add_camera(w->world, &lens, &camera);
    if (!result) result = es_world_add_node(w->world, &(es_node_desc){.transform = {.translation = {1, 2.6f, 1}}}, &spot.node);
    if (!result) result = es_world_add_light(w->world, &spot, &light);
    return result ? result : es_world_step(w->world, 0);
}

static es_result make_images(bench* w)
{
    es_result result = es_image_create(w->context, WIDTH, HEIGHT, 3, &w->a);
    if (!result) result = es_image_create(w->context, WIDTH, HEIGHT, 3, &w->b);
    for (uint32_t i = 0; i < WIDTH * HEIGHT * 3 && !result; i++) {
        w->a.pixels[i] = (float)(i * 37 % 101) / 60.0f;
        w->b.pixels[i] = (float)(i * 53 % 103) / 70.0f;
    }
    return result;
}

static es_renderer_settings small_settings(void)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.shadow_size = 64;
    s.light_size = 32;
    s.vpls = 16;
    s.ism_size = 32;
    s.ism_points = 64;
    s.ism_pool = 1024;
    s.classic_size = 32;
    s.traced_samples = 1;
    s.interleave = 2;
    s.lamps = ES_LAMPS_NONE; /* but for a frame of them alone, and one of the sky's: each makes tables anew */
    s.lamp_count = 24;
    s.lamp_size = 32;
    s.lamp_vpls = 8;
    s.lamp_interleave = 2;
    return s;
}

/* ---- operations ---------------------------------------------------------------------------------------------------------------------- */

enum { WORLD = 1, IMAGES = 2, RENDERER = 4 };

/* prepare makes what the attempt needs and nothing fails in it but for a cap. An attempt makes *object, or goes on with the one that an
 * attempt before it left. */
typedef struct operation {
    const char* name;
    int needs;
    es_result (*prepare)(bench* w, const struct operation* o, void** object);
    es_result (*attempt)(bench* w, const struct operation* o, void** object);
    uint64_t (*hash)(bench* w, const struct operation* o, void* object);
    void (*destroy)(bench* w, const struct operation* o, void* object);
    const char* file;     /* what is read or written */
    int kind;             /* of several */
} operation;

static uint64_t result_hash(bench* w, const operation* o, void* object) { return w->result; }

/* -- images: object: an es_image */

static void image_destroy(bench* w, const operation* o, void* object)
{
    if (object) es_image_destroy(w->context, object);
    free(object);
}

static uint64_t image_hash(bench* w, const operation* o, void* object) { return es_image_hash(object); }

static es_result keep_image(es_result result, const es_image* image, void** object)
{
    if (result) {
        assert_null(image->pixels);
        assert_null(image->channel_names);
        return result;
    }
    *object = malloc(sizeof *image);
    memcpy(*object, image, sizeof *image);
    return ES_OK;
}

static es_result load(bench* w, const operation* o, void** object)
{
    es_image image;
    es_result result = es_image_load(w->context, o->file[0] == '/' ? o->file : path_of(o->file), &image);
    return keep_image(result, &image, object);
}

static es_result map(bench* w, const operation* o, void** object)
{
    es_image image = {0};
    es_result result = o->kind < 5 ? es_image_error_map(w->context, &w->a, &w->b, (es_error_map)o->kind, NULL, &image) : ES_OK;
    if (o->kind == 5) {
        es_image values;
        result = es_image_create(w->context, WIDTH, HEIGHT, 1, &values);
        if (result) return result;
        result = es_image_false_colour(w->context, &values, 1, false, &image);
        es_image_destroy(w->context, &values);
    }
    return keep_image(result, &image, object);
}

static es_result compare(bench* w, const operation* o, void** object)
{
    es_image_error error;
    es_result result = es_image_compare(w->context, &w->a, &w->b, NULL, &error);
    const double numbers[] = {error.rmse, error.relrmse, error.relmse, error.rell1, error.flip, error.hdr_flip, error.max};
    if (!result) w->result = es_hash_bytes(0, numbers, sizeof numbers);
    return result;
}

static es_result save(bench* w, const operation* o, void** object)
{
    return es_image_save(w->context, &w->a, path_of(o->file), &(es_image_save_desc){.sample_type = (es_sample_type)o->kind});
}

static uint64_t file_hash(bench* w, const operation* o, void* object) { return hash_of_file(path_of(o->file)); }

/* -- flicker: object: an es_flicker; only its first frame takes memory */

static es_result flicker_add(bench* w, const operation* o, void** object)
{
    es_flicker* flicker = *object;
    es_result result = flicker ? ES_OK : es_flicker_create(w->context, &flicker);
    *object = flicker;
    return result ? result : es_flicker_add(flicker, &w->b, &w->a);
}

static uint64_t flicker_hash(bench* w, const operation* o, void* object)
{
    assert_int_equal(es_flicker_add(object, &w->a, &w->b), ES_OK);
    es_flicker_error error = es_flicker_result(object);
    return es_hash_bytes(error.frames, (double[]){error.flicker, error.worst, error.change}, 3 * sizeof(double));
}

static void flicker_destroy(bench* w, const operation* o, void* object) { es_flicker_destroy(object); }

/* -- worlds: object: an es_world */

static void world_destroy(bench* w, const operation* o, void* object) { es_world_destroy(object); }

/* What is drawn, but for the handles. */
static uint64_t content_hash(void* object)
{
    uint64_t hash = 0;
    uint32_t ids[256];
    size_t count = 256;
    assert_int_equal(es_world_enumerate(object, ES_OBJECT_MESH, ids, &count), ES_OK);
    for (size_t i = 0; i < count; i++) {
        const es_raster_mesh* mesh = es_world_mesh(object, (es_mesh){ids[i]});
        hash = es_hash_bytes(hash, mesh->positions, (size_t)mesh->vertex_count * 4 * sizeof(float));
        hash = es_hash_bytes(hash, mesh->indices, (size_t)mesh->triangle_count * 3 * sizeof(uint32_t));
    }
    count = 256;
    assert_int_equal(es_world_enumerate(object, ES_OBJECT_TEXTURE, ids, &count), ES_OK);
    for (size_t i = 0; i < count; i++) {
        const es_texture_image* image = es_world_texture_image(object, (es_texture){ids[i]});
        hash = es_hash_bytes(hash, image->texels, (size_t)image->width * image->height * 4 * sizeof *image->texels);
    }
    const es_draw_list* list = es_world_draw_list(object);
    for (uint32_t i = 0; i < list->instance_count; i++) hash = es_hash_bytes(hash, &list->instances[i].transform, sizeof list->instances[i].transform);
    const es_light_state* lights = es_world_lights(object, &count);
    for (size_t i = 0; i < count; i++) hash = es_hash_bytes(hash, lights[i].radiant, sizeof lights[i].radiant);
    return hash;
}

static uint64_t world_hash(bench* w, const operation* o, void* object) { return content_hash(object) ^ es_world_hash(object); }

static es_result import(bench* w, const operation* o, void** object)
{
    es_world* world;
    es_result result = es_world_import_gltf(w->context, o->file[0] == '/' ? o->file : path_of(o->file), NULL, &world);
    assert_true(!result == (world != NULL));
    *object = world;
    return result;
}

static es_result scene(bench* w, const operation* o, void** object)
{
    es_world_settings settings = es_default_world_settings();
    settings.triangles = 300;
    es_world* world;
    es_result result = es_world_create_scene(w->context, o->file, &settings, &world);
    assert_true(!result == (world != NULL));
    *object = world;
    return result;
}

/* A world made from nothing, each object of it again and again until there is memory. */
typedef struct making { bench made; int stage; es_camera camera; es_light light; es_texture texture; es_material material; es_mesh mesh; es_node node; es_instance instance; es_clip clip; es_mesh morphed; es_skin skin; } making;

static es_result make_step(making* m, es_context* context)
{
    static const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1}, tangents[] = {1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}, colors[12] = {1, 1, 1, 1};
    static const uint32_t indices[] = {0, 1, 2};
    static const uint8_t texel[4] = {1, 2, 3, 255};
    static const float times[] = {0, 1}, values[] = {0, 0, 0, 1, 2, 3};
    es_world* world = m->made.world;
    switch (m->stage) {
    case 0: return es_world_create(context, NULL, &m->made.world);
    case 1: return es_world_add_texture(world, &(es_texture_desc){"a texture", 1, 1, texel, true}, &m->texture);
    case 2: return es_world_add_material(world, "a material", &(es_material_desc){.roughness = 1}, &m->material);
    case 3: return es_world_add_mesh(world, &(es_mesh_desc){"a mesh", 3, 1, corners, normals, tangents, corners, corners, colors, indices, false}, &m->mesh);
    case 4: return es_world_add_node(world, &(es_node_desc){.name = "a node"}, &m->node);
    case 5: return es_world_add_instance(world, &(es_instance_desc){.mesh = m->mesh, .material = m->material, .node = m->node}, &m->instance);
    case 6: {
        es_camera_desc desc = es_default_camera_desc();
        desc.name = "a camera";
        return es_world_add_camera(world, &desc, &m->camera);
    }
    case 7: {
        es_light_desc desc = es_default_light_desc();
        desc.name = "a light";
        return es_world_add_light(world, &desc, &m->light);
    }
    case 8: return es_world_add_clip(world, &(es_clip_desc){"a clip", 1, &(es_clip_channel){m->node, ES_CLIP_TRANSLATION, ES_INTERPOLATE_LINEAR, 2, times, values}}, &m->clip);
    case 9: return es_world_play_clip(world, m->clip, true);
    case 10:
        return es_world_add_mesh(world, &(es_mesh_desc){.name = "a morphed mesh", .vertex_count = 3, .triangle_count = 1, .positions = corners, .normals = normals, .tangents = tangents,
            .indices = indices, .target_count = 1, .targets = &(es_morph_target){corners, normals, corners}, .weights = times + 1}, &m->morphed);
    case 11:
        return es_world_add_skin(world, &(es_skin_desc){"a skin", m->morphed, m->node, 1, &m->node, NULL, 1, (const uint32_t[]){0, 0, 0}, (const float[]){1, 1, 1}}, &m->skin);
    case 12: return es_world_recompute_normals(world, m->mesh);
    case 13: {
        es_area_light_desc desc = es_default_area_light_desc();
        es_area_light light;
        desc.name = "an area light";
        desc.shape = ES_AREA_SPHERE;
        return es_world_add_area_light(world, &desc, &light);
    }
    default: return es_world_step(world, 0.5f);
    }
}

static es_result make(bench* w, const operation* o, void** object)
{
    making* m = *object ? *object : calloc(1, sizeof *m);
    *object = m;
    for (; m->stage < 15; m->stage++) {
        es_result result = make_step(m, w->context);
        if (result) return result;
    }
    return ES_OK;
}

static uint64_t make_hash(bench* w, const operation* o, void* object) { return content_hash(((making*)object)->made.world); } /* a handle that was taken back has another generation */

static void make_destroy(bench* w, const operation* o, void* object)
{
    if (object) es_world_destroy(((making*)object)->made.world);
    free(object);
}

/* -- changes of one world. They end with the bench's world, so that none sees what another left. */

static es_result deform(bench* w, const operation* o, void** object)
{
    const es_raster_mesh* mesh = es_world_mesh(w->world, w->sphere);
    float* moved = malloc(mesh->vertex_count * 3 * sizeof(float));
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (uint32_t k = 0; k < 3; k++) moved[3 * v + k] = mesh->positions[4 * v + k];
    moved[4] += 0.25f;
    es_result result = es_world_deform_mesh(w->world, w->sphere, moved, NULL);
    free(moved);
    return result;
}

static es_result environment(bench* w, const operation* o, void** object)
{
    return es_world_set_environment(w->world, &(es_environment_desc){.image = &w->a, .radiance = {1, 1, 1}});
}

static uint64_t environment_hash(bench* w, const operation* o, void* object)
{
    es_environment_desc desc;
    assert_true(es_world_get_environment(w->world, &desc));
    return es_hash_bytes(es_world_hash(w->world), desc.image->pixels, WIDTH * HEIGHT * 3 * sizeof(float));
}

static uint64_t bench_hash(bench* w, const operation* o, void* object) { return world_hash(w, o, w->world); }

/* A state in which the ball is deformed goes back to a world in which it is not: that takes memory. object: the state */
typedef struct saved { size_t size; char bytes[]; } saved;

static es_result restore_prepare(bench* w, const operation* o, void** object)
{
    bench other = {.context = w->context};
    es_result result = make_world(&other);
    if (!result) result = deform(&other, o, NULL);
    size_t size = 0;
    if (!result) result = es_world_save(other.world, NULL, &size);
    if (!result) {
        saved* state = malloc(sizeof *state + size);
        state->size = size;
        result = es_world_save(other.world, state->bytes, &size);
        *object = state;
    }
    es_world_destroy(other.world);
    return result;
}

static es_result restore(bench* w, const operation* o, void** object)
{
    saved* state = *object;
    uint64_t before = es_world_hash(w->world);
    es_result result = es_world_restore(w->world, state->bytes, state->size);
    if (result) assert_true(es_world_hash(w->world) == before);
    return result;
}

static void free_object(bench* w, const operation* o, void* object) { free(object); }

/* -- bodies, cloth, a hand and a recording: object: a dynamic, each part of it made again and again until there is memory */

typedef struct dynamic {
    es_world* world;
    int stage;
    es_mesh sheet;
    es_body floor, box, ball;
    es_joint joint;
    es_soft cloth;
    es_recording* recording;
    saved* state;
} dynamic;

enum { SHEET = 7 };

static es_result add_sheet(es_world* world, es_mesh* mesh)
{
    float places[SHEET * SHEET * 3];
    uint32_t indices[(SHEET - 1) * (SHEET - 1) * 6], *index = indices;
    for (uint32_t v = 0; v < SHEET * SHEET; v++) {
        places[3 * v] = 0.15f * (float)(v % SHEET);
        places[3 * v + 1] = 2;
        places[3 * v + 2] = 0.15f * (float)(v / SHEET);
    }
    for (uint32_t j = 0; j + 1 < SHEET; j++)
        for (uint32_t i = 0; i + 1 < SHEET; i++) {
            const uint32_t a = j * SHEET + i, corners[6] = {a, a + SHEET, a + 1, a + 1, a + SHEET, a + SHEET + 1};
            memcpy(index, corners, sizeof corners);
            index += 6;
        }
    return es_world_add_mesh(world, &(es_mesh_desc){.name = "a sheet", .vertex_count = SHEET * SHEET, .triangle_count = (SHEET - 1) * (SHEET - 1) * 2, .positions = places, .indices = indices}, mesh);
}

static es_result add_body(es_world* world, es_body_type type, const char* name, es_shape_desc shape, double height, es_body* body)
{
    es_body_desc desc = es_default_body_desc();
    desc.name = name;
    desc.type = type;
    desc.shapes = &shape;
    desc.shape_count = 1;
    desc.position[1] = height;
    return es_world_add_body(world, &desc, body);
}

static es_result dynamic_step(dynamic* d, es_context* context)
{
    es_shape_desc shape = es_default_shape_desc();
    switch (d->stage) {
    case 0: return es_world_create(context, NULL, &d->world);
    case 1: return add_sheet(d->world, &d->sheet);
    case 2: {
        es_material material;
        es_instance instance;
        es_result result = es_world_add_material(d->world, "cloth", &(es_material_desc){.roughness = 1}, &material);
        return result ? result : es_world_add_instance(d->world, &(es_instance_desc){.mesh = d->sheet, .material = material}, &instance);
    }
    case 3: shape.half_extents = es_v3(3, 0.5f, 3); return add_body(d->world, ES_BODY_STATIC, "floor", shape, -0.5, &d->floor);
    case 4: return add_body(d->world, ES_BODY_DYNAMIC, "box", shape, 0.45, &d->box);
    case 5: {
        static const float points[] = {-0.3f, 0, -0.3f, 0.3f, 0, -0.3f, 0, 0, 0.4f, 0, 0.5f, 0};
        shape.type = ES_SHAPE_HULL;
        shape.points = points;
        shape.point_count = 4;
        return add_body(d->world, ES_BODY_DYNAMIC, "hull", shape, 1.2, &d->ball);
    }
    case 6: {
        es_joint_desc desc = es_default_joint_desc();
        desc.name = "joint";
        desc.a = d->box;
        desc.b = d->ball;
        return es_world_add_joint(d->world, &desc, &d->joint);
    }
    case 7: {
        const es_soft_attachment held[] = {{.vertex = 0, .in_place = true}, {.vertex = SHEET - 1, .in_place = true}, {.vertex = SHEET * SHEET - 1, .in_place = true}};
        es_soft_desc desc = es_default_soft_desc();
        desc.name = "sheet";
        desc.mesh = d->sheet;
        desc.tear_stretch = 3;
        desc.self_collision = true;
        desc.drag = 0.1f;
        desc.attachments = held;
        desc.attachment_count = 3;
        return es_world_add_soft(d->world, &desc, &d->cloth);
    }
    case 8: return es_world_grab_body(d->world, 0, d->box, es_v3(0.1f, 0.2f, 0), (const double[3]){0.2, 1, 0}, 100);
    default: return es_recording_begin(d->world, "a scene", "settings", &d->recording);
    }
}

enum { TEAR = 1, LET_GO, LET_ALL_GO, HOLD, HOLD_ANEW, SOFTEN, STEP, RECORDED, TO_TORN, TO_WHOLE };

static es_result make_dynamic(bench* w, const operation* o, void** object)
{
    dynamic* d = *object ? *object : calloc(1, sizeof *d);
    *object = d;
    /* a recording has failures of its own, of which it says that it goes no further: what fails otherwise is not recorded */
    for (const int stages = o->kind == 0 || o->kind == RECORDED ? 10 : 9; d->stage < stages; d->stage++) {
        es_result result = dynamic_step(d, w->context);
        if (result) return result;
    }
    return ES_OK;
}

static void dynamic_destroy(bench* w, const operation* o, void* object)
{
    dynamic* d = object;
    if (!d) return;
    if (d->recording) es_recording_end(d->recording);
    es_recording_destroy(d->recording);
    es_world_destroy(d->world);
    free(d->state);
    free(d);
}

/* A hundred milliseconds on, all that is allocated for a step is there. */
static es_result dynamic_moving(bench* w, const operation* o, void** object)
{
    es_result result = make_dynamic(w, o, object);
    return result ? result : es_world_step(((dynamic*)*object)->world, 0.1f);
}

static es_result keep_state(dynamic* d)
{
    size_t size = 0;
    es_result result = es_world_save(d->world, NULL, &size);
    if (result) return result;
    d->state = malloc(sizeof *d->state + size);
    d->state->size = size;
    return es_world_save(d->world, d->state->bytes, &size);
}

/* A cloth that is whole in the world and torn in the state, or the other way round. */
static es_result dynamic_torn(bench* w, const operation* o, void** object)
{
    es_result result = dynamic_moving(w, o, object);
    dynamic* d = *object;
    if (!result) result = keep_state(d);
    if (!result) result = es_world_soft_tear(d->world, d->cloth, (const double[3]){0.45, 2, 0.45}, 0.3f);
    if (!result) result = es_world_step(d->world, 0.1f);
    if (result || o->kind == TO_WHOLE) return result;
    saved* whole = d->state;
    result = keep_state(d);
    if (!result) result = es_world_restore(d->world, whole->bytes, whole->size);
    free(whole);
    return result;
}

/* What memory ran out for half-way may be no state that ever was, but it can go on, and be restored. */
static es_result dynamic_restore(bench* w, const operation* o, void** object)
{
    dynamic* d = *object;
    es_result result = es_world_restore(d->world, d->state->bytes, d->state->size);
    if (result != ES_OUT_OF_MEMORY) return result;
    memory.left = -1;
    for (int i = 0; i < 3; i++) assert_int_equal(es_world_step(d->world, 0.05f), ES_OK);
    return es_context_last_result(w->context);
}

/* What finds no memory leaves the vertex held as it was, or free. */
static es_result hold(dynamic* d, const es_soft_attachment* attachment)
{
    const uint64_t before = es_world_hash(d->world);
    es_result result = es_world_soft_attach(d->world, d->cloth, attachment);
    if (result) assert_true(es_world_hash(d->world) == before);
    return result;
}

static es_result dynamic_change(bench* w, const operation* o, void** object)
{
    dynamic* d = *object;
    switch (o->kind) {
    case TEAR: return es_world_soft_tear(d->world, d->cloth, (const double[3]){0.45, 2, 0.45}, 0.3f);
    case LET_GO: return es_world_soft_detach(d->world, d->cloth, SHEET - 1);
    case LET_ALL_GO: return es_world_soft_detach(d->world, d->cloth, ES_SOFT_ALL);
    case HOLD: return hold(d, &(es_soft_attachment){.vertex = 3 * SHEET, .in_place = true});
    case HOLD_ANEW: return hold(d, &(es_soft_attachment){.vertex = SHEET - 1, .body = d->box, .local = {0.1f, 0.2f, 0.3f}});
    case SOFTEN: {
        es_soft_desc desc;
        assert_int_equal(es_world_get_soft(d->world, d->cloth, &desc), ES_OK);
        desc.stretch_compliance = 1e-5f;
        return es_world_set_soft(d->world, d->cloth, &desc);
    }
    case RECORDED: return es_recording_save(d->recording, path_of(o->file));
    default: return es_world_step(d->world, 0.1f);
    }
}

static uint64_t dynamic_hash(bench* w, const operation* o, void* object)
{
    dynamic* d = object;
    if (o->kind == 0) return content_hash(d->world); /* a handle that was taken back has another generation */
    if (o->kind == RECORDED) return hash_of_file(path_of(o->file));
    if (o->kind == STEP) { /* what failed has taken its time: it is another step that succeeds, of a world that is still one */
        double place[3];
        es_body_state body;
        for (uint32_t v = 0; v < SHEET * SHEET; v++) {
            assert_int_equal(es_world_get_soft_vertex(d->world, d->cloth, v, place, NULL), ES_OK);
            for (int k = 0; k < 3; k++) assert_true(place[k] > -10 && place[k] < 10);
        }
        assert_int_equal(es_world_get_body(d->world, d->box, &body), ES_OK);
        assert_true(body.position[1] > -0.1 && body.position[1] < 2);
        assert_int_equal(es_world_step(d->world, 0.1f), ES_OK);
        return 1;
    }
    return es_world_hash(d->world) ^ content_hash(d->world);
}

/* -- frames: object: an es_renderer */

static void renderer_destroy(bench* w, const operation* o, void* object) { es_renderer_destroy(object); }

/* Kinds beyond the methods: light that is kept in time, with three bounces by the one-pass method or by reflective maps; micro-buffers. */
enum { IN_TIME = 6, MICRO = IN_TIME + 2 };

static es_result frame(bench* w, const operation* o, void** object)
{
    es_renderer_settings settings = small_settings();
    if (o->kind == ES_GI_NONE) settings.lamps = ES_LAMPS_MAPS;
    settings.method = (uint32_t)(o->kind < 4 ? o->kind : o->kind < IN_TIME ? ES_GI_VPL_TRACED : ES_GI_ISM);
    settings.traced_bias = (uint32_t)(o->kind < 4 || o->kind >= IN_TIME ? 0 : o->kind - 3);
    if (o->kind >= MICRO) {
        settings.method = ES_GI_MICRO;
        settings.micro_spacing = 2;
        settings.micro_points = 256;
        settings.micro_size = 8;
        settings.temporal = o->kind > MICRO;
        settings.bounces = o->kind > MICRO ? 3 : 1;
        settings.bounce_vpls = 8;
    } else if (o->kind >= IN_TIME) {
        settings.temporal = settings.stable_vpls = true;
        settings.antialias = ES_ANTIALIAS_TEMPORAL;
        settings.bounces = 3;
        settings.bounce_vpls = 8;
        settings.bounce_method = o->kind == IN_TIME ? ES_BOUNCE_ONE_PASS : ES_BOUNCE_REFLECTIVE;
    }
    es_renderer* renderer = *object;
    es_result result = renderer ? ES_OK : es_renderer_create(w->context, &settings, &renderer);
    assert_true(!result == (renderer != NULL));
    *object = renderer;
    return result ? result : es_renderer_render(renderer, w->world);
}

/* Under a sky, which lights by rays; the hash of the frame is what is compared. */
static es_result frame_under_sky(bench* w, const operation* o, void** object)
{
    es_result result = *object ? ES_OK : es_world_set_environment(w->world, &(es_environment_desc){.radiance = {0.2f, 0.3f, 0.4f}});
    es_renderer_settings settings = small_settings();
    settings.method = ES_GI_NONE;
    settings.lamps = ES_LAMPS_TRACED;
    if (!result && !*object) result = es_renderer_create(w->context, &settings, (es_renderer**)object);
    return result ? result : es_renderer_render(*object, w->world);
}

/* A ball that is seen through, lit by all that lights the picture. */
static es_result frame_blended(bench* w, const operation* o, void** object)
{
    es_material_desc material;
    es_result result = es_world_get_material(w->world, w->painted, &material);
    material.blend = true;
    material.base_color[3] = 0.6f;
    if (!result) result = es_world_set_material(w->world, w->painted, &material);
    es_renderer_settings settings = small_settings();
    settings.lamps = ES_LAMPS_MAPS;
    settings.blend_layers = 3;
    settings.bounces = 2;
    settings.bounce_vpls = 8;
    if (!result && !*object) result = es_renderer_create(w->context, &settings, (es_renderer**)object);
    return result ? result : es_renderer_render(*object, w->world);
}

/* After a frame everything has its memory; another size and a moved ball want more of it. */
static es_result next_frame_prepare(bench* w, const operation* o, void** object)
{
    es_result result = frame(w, o, object);
    if (!result) result = es_world_set_node_transform(w->world, w->node, &(es_transform){.translation = {0.3f, 1.2f, 0.1f}});
    if (!result) result = es_world_step(w->world, 0);
    es_renderer_settings settings = *object ? es_renderer_get_settings(*object) : small_settings();
    settings.width = 33;
    settings.vpls = 40;
    settings.shadow_size = 96;
    settings.ism_points = 128;
    return result ? result : es_renderer_configure(*object, &settings);
}

static es_result next_frame(bench* w, const operation* o, void** object) { return es_renderer_render(*object, w->world); }

static es_result hash_images(bench* w, es_renderer* renderer, uint64_t* hash)
{
    *hash = 0;
    for (size_t i = 0; i < es_image_name_count(); i++) {
        es_image image;
        es_result result = es_renderer_image(renderer, es_image_name(i), &image);
        if (result == ES_WRONG_STATE) { /* this method has no such image */
            memory.messages = 0;
            continue;
        }
        if (result) {
            assert_null(image.pixels);
            return result;
        }
        uint64_t one = es_image_hash(&image);
        *hash = es_hash_bytes(*hash, &one, sizeof one);
        es_image_destroy(w->context, &image);
    }
    return ES_OK;
}

static uint64_t frame_hash(bench* w, const operation* o, void* object)
{
    uint64_t hash;
    assert_int_equal(hash_images(w, object, &hash), ES_OK);
    return hash;
}

static es_result images(bench* w, const operation* o, void** object) { return hash_images(w, w->renderer, &w->result); }

/* -- reference: object: an es_reference */

static void reference_destroy(bench* w, const operation* o, void* object) { es_reference_destroy(object); }

static es_result reference(bench* w, const operation* o, void** object)
{
    es_reference_settings settings = es_default_reference_settings();
    settings.width = 6;
    settings.height = 5;
    settings.bounces = 2;
    es_reference* r = *object;
    es_result result = r ? ES_OK : es_reference_create(w->context, &settings, &r);
    assert_true(!result == (r != NULL));
    *object = r;
    if (!result) result = es_reference_begin(r, w->world);
    return result ? result : es_reference_add(r, 2);
}

static es_result reference_save(bench* w, const operation* o, void** object) { return es_reference_save(*object, path_of(o->file)); }

static uint64_t reference_hash(bench* w, const operation* o, void* object)
{
    static const char* const names[] = {"radiance", "direct", "indirect-error", "bounce-2", "emission"};
    uint64_t hash = es_reference_get_stats(object).samples;
    for (int i = 0; i < 5; i++) {
        es_image image;
        assert_int_equal(es_reference_image(object, names[i], &image), ES_OK);
        uint64_t one = es_image_hash(&image);
        hash = es_hash_bytes(hash, &one, sizeof one);
        es_image_destroy(w->context, &image);
    }
    return hash;
}

static es_result reference_resume(bench* w, const operation* o, void** object)
{
    bool capped = es_context_resolved_desc(w->context).memory_cap != SIZE_MAX;
    long left = memory.left, seen = memory.seen;
    memory.left = -1;
    uint64_t before = capped ? 0 : reference_hash(w, o, *object);
    memory.left = left, memory.seen = seen;
    es_result result = es_reference_resume(*object, path_of(o->file));
    left = memory.left, seen = memory.seen;
    memory.left = -1;
    if (result && !capped) assert_true(reference_hash(w, o, *object) == before);
    memory.left = left, memory.seen = seen;
    return result;
}

static es_result reference_image(bench* w, const operation* o, void** object)
{
    es_image image;
    es_result result = es_reference_image(*object, "indirect", &image);
    if (!result) w->result = es_image_hash(&image);
    es_image_destroy(w->context, &image);
    return result;
}

/* -- hierarchy: object: an es_bvh */

static es_result hierarchy(bench* w, const operation* o, void** object)
{
    es_bvh* bvh = *object;
    es_result result = bvh ? ES_OK : es_bvh_create(w->context, &bvh);
    *object = bvh;
    return result ? result : es_bvh_update(bvh, es_world_draw_list(w->world));
}

/* A hierarchy of fewer triangles has to grow. */
static es_result hierarchy_prepare(bench* w, const operation* o, void** object)
{
    es_bvh* bvh;
    es_draw_list list = *es_world_draw_list(w->world);
    list.instance_count = 1;
    es_result result = es_bvh_create(w->context, &bvh);
    if (result) return result;
    *object = bvh;
    return es_bvh_build(bvh, &list);
}

static uint64_t hierarchy_hash(bench* w, const operation* o, void* object)
{
    es_ray rays[64];
    es_hit hits[64];
    for (int i = 0; i < 64; i++)
        rays[i] = (es_ray){{(float)(i % 8) * 0.3f - 1, (float)(i / 8) * 0.3f + 0.2f, 4}, 0, {(float)(i % 5) * 0.1f - 0.2f, (float)(i % 7) * 0.1f - 0.3f, -1}, 100};
    es_bvh_closest(object, ES_RAYS_SINGLE, rays, 64, hits);
    return es_hash_bytes(es_bvh_primitive_count(object), hits, sizeof hits);
}

static void hierarchy_destroy(bench* w, const operation* o, void* object) { es_bvh_destroy(object); }

static const operation operations[] = {
    {"load EXR", 0, NULL, load, image_hash, image_destroy, "in.exr"},
    {"load EXR of floats", 0, NULL, load, image_hash, image_destroy, "float.exr"},
    {"load PNG", 0, NULL, load, image_hash, image_destroy, "in.png"},
    {"load HDR", 0, NULL, load, image_hash, image_destroy, "in.hdr"},
    {"save EXR", IMAGES, NULL, save, file_hash, NULL, "out.exr", ES_SAMPLE_HALF},
    {"save EXR of floats", IMAGES, NULL, save, file_hash, NULL, "out.exr", ES_SAMPLE_FLOAT},
    {"save PNG", IMAGES, NULL, save, file_hash, NULL, "out.png"},
    {"save HDR", IMAGES, NULL, save, file_hash, NULL, "out.hdr"},
    {"compare", IMAGES, NULL, compare, result_hash, NULL},
    {"map of absolute error", IMAGES, NULL, map, image_hash, image_destroy, NULL, ES_ERROR_MAP_ABSOLUTE},
    {"map of signed error", IMAGES, NULL, map, image_hash, image_destroy, NULL, ES_ERROR_MAP_SIGNED},
    {"map of FLIP", IMAGES, NULL, map, image_hash, image_destroy, NULL, ES_ERROR_MAP_FLIP},
    {"map of HDR-FLIP", IMAGES, NULL, map, image_hash, image_destroy, NULL, ES_ERROR_MAP_HDR_FLIP},
    {"false colour", 0, NULL, map, image_hash, image_destroy, NULL, 5},
    {"flicker", IMAGES, NULL, flicker_add, flicker_hash, flicker_destroy},
    {"import with textures", 0, NULL, import, world_hash, world_destroy, "quad.gltf"},
    {"import with animation", 0, NULL, import, world_hash, world_destroy, "moving.gltf"},
    {"cornell", 0, NULL, scene, world_hash, world_destroy, "cornell"},
    {"room", 0, NULL, scene, world_hash, world_destroy, "room"},
    {"hall", 0, NULL, scene, world_hash, world_destroy, "hall"},
    {"make a world", 0, NULL, make, make_hash, make_destroy},
    {"make bodies and cloth", 0, NULL, make_dynamic, dynamic_hash, dynamic_destroy},
    {"step, the first", 0, make_dynamic, dynamic_change, dynamic_hash, dynamic_destroy, NULL, STEP},
    {"tear a cloth", 0, dynamic_moving, dynamic_change, dynamic_hash, dynamic_destroy, NULL, TEAR},
    {"let go of a vertex", 0, dynamic_moving, dynamic_change, dynamic_hash, dynamic_destroy, NULL, LET_GO},
    {"let go of all", 0, dynamic_moving, dynamic_change, dynamic_hash, dynamic_destroy, NULL, LET_ALL_GO},
    {"hold a vertex", 0, dynamic_moving, dynamic_change, dynamic_hash, dynamic_destroy, NULL, HOLD},
    {"hold a held vertex anew", 0, dynamic_moving, dynamic_change, dynamic_hash, dynamic_destroy, NULL, HOLD_ANEW},
    {"soften a cloth", 0, dynamic_moving, dynamic_change, dynamic_hash, dynamic_destroy, NULL, SOFTEN},
    {"restore a torn cloth", 0, dynamic_torn, dynamic_restore, dynamic_hash, dynamic_destroy, NULL, TO_TORN},
    {"restore a whole cloth", 0, dynamic_torn, dynamic_restore, dynamic_hash, dynamic_destroy, NULL, TO_WHOLE},
    {"save a recording", 0, make_dynamic, dynamic_change, dynamic_hash, dynamic_destroy, "out.hdr", RECORDED},
    {"deform a mesh", WORLD, NULL, deform, bench_hash, NULL},
    {"set an environment", WORLD | IMAGES, NULL, environment, environment_hash, NULL},
    {"restore a world", WORLD, restore_prepare, restore, bench_hash, free_object},
    {"frame, none", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, ES_GI_NONE},
    {"frame, sky", WORLD, NULL, frame_under_sky, frame_hash, renderer_destroy, NULL},
    {"frame, blended", WORLD, NULL, frame_blended, frame_hash, renderer_destroy, NULL},
    {"frame, ism", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, ES_GI_ISM},
    {"frame, classic", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, ES_GI_CLASSIC},
    {"frame, vpl-traced", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, ES_GI_VPL_TRACED},
    {"frame, unbounded", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, 4},
    {"frame, compensated", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, 5},
    {"frame, in time", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, IN_TIME},
    {"frame, reflective", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, IN_TIME + 1},
    {"frame, micro", WORLD, NULL, frame, frame_hash, renderer_destroy, NULL, MICRO + 1},
    {"next frame, micro", WORLD, next_frame_prepare, next_frame, frame_hash, renderer_destroy, NULL, MICRO},
    {"next frame, in time", WORLD, next_frame_prepare, next_frame, frame_hash, renderer_destroy, NULL, IN_TIME},
    {"next frame, ism", WORLD, next_frame_prepare, next_frame, frame_hash, renderer_destroy, NULL, ES_GI_ISM},
    {"next frame, compensated", WORLD, next_frame_prepare, next_frame, frame_hash, renderer_destroy, NULL, 5},
    {"images of a frame", WORLD | RENDERER, NULL, images, result_hash, NULL},
    {"reference", WORLD, NULL, reference, reference_hash, reference_destroy},
    {"image of a reference", WORLD, reference, reference_image, result_hash, reference_destroy},
    {"save a reference", WORLD, reference, reference_save, file_hash, reference_destroy, "out.exr"},
    {"resume a reference", WORLD, reference, reference_resume, reference_hash, reference_destroy, "reference.exr"},
    {"hierarchy", WORLD, NULL, hierarchy, hierarchy_hash, hierarchy_destroy},
    {"hierarchy that grows", WORLD, hierarchy_prepare, hierarchy, hierarchy_hash, hierarchy_destroy},
};
enum { OPERATIONS = sizeof operations / sizeof operations[0] };

/* ---- running them ------------------------------------------------------------------------------------------------------------------------ */

static es_context* scarce_context(size_t cap)
{
    es_context_desc desc = es_default_context_desc();
    desc.allocator = (es_allocator){scarce_allocate, scarce_release, NULL};
    desc.logger.log = count_errors;
    desc.threads = 1;
    desc.memory_cap = cap;
    es_context* context;
    memset(&memory, 0, sizeof memory);
    memory.left = -1;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    memory.live = memory.most = 0; /* the context's own block is not part of what it counts */
    return context;
}

static void end_context(es_context* context)
{
    assert_int_equal(es_context_bytes(context), 0);
    assert_int_equal(memory.live, 0);
    memory.live = 1 << 20; /* its own block */
    es_context_destroy(context);
}

static es_result set_up(bench* w, int needs)
{
    es_result result = needs & WORLD ? make_world(w) : ES_OK;
    if (!result && (needs & IMAGES)) result = make_images(w);
    if (!result && (needs & RENDERER)) {
        es_renderer_settings settings = small_settings();
        settings.method = ES_GI_ISM;
        result = es_renderer_create(w->context, &settings, &w->renderer);
        if (!result) result = es_renderer_render(w->renderer, w->world);
    }
    return result;
}

static void tear_down(bench* w)
{
    es_renderer_destroy(w->renderer);
    es_image_destroy(w->context, &w->a);
    es_image_destroy(w->context, &w->b);
    es_world_destroy(w->world);
    *w = (bench){.context = w->context};
}

/* Names the operation that fails. */
#define HOLDS(condition, o, ...)                                                                                                       \
    do {                                                                                                                               \
        if (!(condition)) {                                                                                                            \
            char detail[1024];                                                                                                         \
            snprintf(detail, sizeof detail, __VA_ARGS__);                                                                              \
            fail_msg("%s: not so: %s: %s", (o)->name, #condition, detail);                                                             \
        }                                                                                                                              \
    } while (0)

static void clean_up(bench* w, const operation* o, void* object)
{
    if (o->destroy) o->destroy(w, o, object);
    tear_down(w);
    HOLDS(es_context_bytes(w->context) == 0 && memory.live == 0, o, "%zu bytes are not given back", es_context_bytes(w->context));
}

/* The files an operation finds where it writes: they are those of before when it fails. */
static void write_old(void)
{
    static const char* const names[] = {"out.exr", "out.png", "out.hdr"};
    for (int i = 0; i < 3; i++) {
        FILE* file = fopen(path_of(names[i]), "wb");
        assert_non_null(file);
        fputs("what was there before", file);
        fclose(file);
    }
}

/* Without any failure: the hash, and how often memory was asked for in the attempt. */
static bool run_fresh(bench* w, const operation* o, uint64_t* hash, long* allocations)
{
    void* object = NULL;
    assert_int_equal(set_up(w, o->needs), ES_OK);
    if (o->prepare) assert_int_equal(o->prepare(w, o, &object), ES_OK);
    memory.seen = memory.messages = 0;
    es_result result = o->attempt(w, o, &object);
    *allocations = memory.seen;
    if (result == ES_NOT_BUILT) {
        clean_up(w, o, object);
        return false;
    }
    HOLDS(result == ES_OK, o, "%s", es_context_message(w->context));
    *hash = o->hash(w, o, object);
    clean_up(w, o, object);
    return true;
}

/* The n-th allocation of the attempt fails, and all after it or none. */
static void run_failing(bench* w, const operation* o, uint64_t expected, long n, bool once)
{
    void* object = NULL;
    write_old();
    assert_int_equal(set_up(w, o->needs), ES_OK);
    if (o->prepare) assert_int_equal(o->prepare(w, o, &object), ES_OK);
    uint64_t files = hash_of_folder();
    memory.messages = 0;
    memory.once = once;
    memory.left = n;
    es_result result = o->attempt(w, o, &object);
    memory.left = -1;
    HOLDS(result == ES_OUT_OF_MEMORY, o, "allocation %ld fails%s: %s", n, once ? " alone" : "", es_result_name(result));
    HOLDS(memory.messages == 1 && memory.item == result, o, "allocation %ld fails%s: %d messages, the last: %s", n, once ? " alone" : "", memory.messages, es_context_message(w->context));
    HOLDS(es_context_last_result(w->context) == result, o, "%s", es_result_name(es_context_last_result(w->context)));
    HOLDS(hash_of_folder() == files, o, "allocation %ld fails: files are not as they were", n);
    memory.messages = 0;
    result = o->attempt(w, o, &object);
    HOLDS(result == ES_OK, o, "after allocation %ld has failed: %s", n, es_context_message(w->context));
    HOLDS(memory.messages == 0, o, "%d messages of nothing", memory.messages);
    HOLDS(o->hash(w, o, object) == expected, o, "after allocation %ld has failed the result is another one", n);
    clean_up(w, o, object);
}

static void every_allocation_fails_once(void** state)
{
    bench w = {.context = scarce_context(0)};
    for (int i = 0; i < OPERATIONS; i++) {
        const operation* o = &operations[i];
        uint64_t hash;
        long allocations;
        if (!run_fresh(&w, o, &hash, &allocations)) continue;
        HOLDS(allocations > 0, o, "it needs no memory");
        /* all of them, or the first, the last and a spread of those between */
        for (long n = 0; n < allocations; n++) {
            long spread = allocations / MOST_FAILURES + 1, edge = MOST_FAILURES / 4;
            if (n >= edge && n < allocations - edge && n % spread) continue;
            run_failing(&w, o, hash, n, n % 2);
            if (allocations <= MOST_FAILURES) run_failing(&w, o, hash, n, n % 2 == 0);
        }
    }
    end_context(w.context);
}

static void contexts_without_memory(void** state)
{
    memset(&memory, 0, sizeof memory);
    es_context_desc desc = es_default_context_desc();
    desc.allocator = (es_allocator){scarce_allocate, scarce_release, NULL};
    desc.logger.log = count_errors;
    desc.threads = 1;
    es_context* context = (es_context*)folder;
    assert_int_equal(es_context_create(&desc, &context), ES_OUT_OF_MEMORY);
    assert_null(context);
    assert_int_equal(memory.messages, 1);
    assert_int_equal(memory.live, 0);
}

/* ---- caps --------------------------------------------------------------------------------------------------------------------------------- */

/* The most the allocator ever held stays within the cap; what fails says how much was asked for and what the cap is. */
static bool run_capped(const operation* o, size_t cap, uint64_t expected)
{
    bench w = {.context = scarce_context(cap)};
    void* object = NULL;
    char number[32];
    snprintf(number, sizeof number, "%zu", cap);
    write_old();
    uint64_t files = hash_of_folder();
    es_result result = set_up(&w, o->needs);
    if (!result && o->prepare) result = o->prepare(&w, o, &object);
    if (!result) result = o->attempt(&w, o, &object);
    if (result) {
        HOLDS(result == ES_MEMORY_CAP, o, "under a cap of %zu bytes: %s", cap, es_context_message(w.context));
        HOLDS(memory.messages == 1, o, "under a cap of %zu bytes: %d messages, the last: %s", cap, memory.messages, es_context_message(w.context));
        HOLDS(strstr(es_context_message(w.context), number) && strstr(es_context_message(w.context), "bytes"), o, "the cap of %zu is not named: %s", cap, es_context_message(w.context));
        HOLDS(hash_of_folder() == files, o, "under a cap of %zu bytes files are not as they were", cap);
    } else if (memory.most + (1 << 20) < cap) {
        HOLDS(o->hash(&w, o, object) == expected, o, "under a cap of %zu bytes the result is another one", cap);
    }
    HOLDS(memory.most <= cap, o, "%zu bytes were held under a cap of %zu", memory.most, cap);
    HOLDS(es_context_peak_bytes(w.context) >= memory.most && es_context_peak_bytes(w.context) <= cap, o, "the peak of %zu bytes is said to be %zu, the cap is %zu", memory.most,
        es_context_peak_bytes(w.context), cap);
    clean_up(&w, o, object);
    end_context(w.context);
    return result == ES_OK;
}

static void caps_hold(void** state)
{
    for (int i = 0; i < OPERATIONS; i++) {
        const operation* o = &operations[i];
        bench w = {.context = scarce_context(0)};
        uint64_t hash;
        long allocations;
        bool built = run_fresh(&w, o, &hash, &allocations);
        size_t most = es_context_peak_bytes(w.context); /* with what libraries allocate by themselves */
        end_context(w.context);
        if (!built) continue;
        int refused = 0;
        for (int c = 0; c < CAPS; c++) {
            /* from 64 bytes to all that is needed, in equal ratios, with the last few close to it */
            double share = (double)c / (CAPS - 1), cap = 64;
            for (double low = 64, k = 0; k < share * 20; k++) cap = low *= (double)1 + ((double)most / 64 > 1e5 ? 0.85 : 0.45);
            if (c >= CAPS - 4) cap = (double)most * (0.9 + 0.03 * (c - CAPS + 4));
            if (cap < (double)most) refused += !run_capped(o, (size_t)cap, hash);
        }
        HOLDS(refused > 3, o, "%d caps refused", refused);
        HOLDS(run_capped(o, most, hash), o, "under a cap of the %zu bytes that it takes it fails", most);
        HOLDS(run_capped(o, 2 * most + (4 << 20), hash), o, "an ample cap refuses");
    }
}

/* ---- disk ------------------------------------------------------------------------------------------------------------------------------- */

/* Writing beyond `bytes` fails as on a full disk; 0 takes the limit away. */
static void limit_file_size(rlim_t bytes)
{
    struct rlimit limit;
    getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = bytes ? bytes : limit.rlim_max;
    signal(SIGXFSZ, bytes ? SIG_IGN : SIG_DFL);
    setrlimit(RLIMIT_FSIZE, &limit);
}

static es_result try_save(bench* w, const operation* o, void* object, const char* path)
{
    memory.messages = 0;
    es_result result = o->attempt == reference_save ? es_reference_save(object, path) : es_image_save(w->context, &w->a, path, &(es_image_save_desc){.sample_type = (es_sample_type)o->kind});
    if (result) {
        HOLDS(memory.messages == 1, o, "%s: %d messages, the last: %s", path, memory.messages, es_context_message(w->context));
        HOLDS(strstr(es_context_message(w->context), path), o, "%s is not named: %s", path, es_context_message(w->context));
    }
    return result;
}

static void disks_without_room(void** state)
{
    bench w = {.context = scarce_context(0)};
    for (int i = 0; i < OPERATIONS; i++) {
        const operation* o = &operations[i];
        uint64_t hash;
        long allocations;
        if ((o->attempt != save && o->attempt != reference_save) || !run_fresh(&w, o, &hash, &allocations)) continue;
        struct stat written;
        assert_int_equal(stat(path_of(o->file), &written), 0);
        void* object = NULL;
        assert_int_equal(set_up(&w, o->needs), ES_OK);
        if (o->prepare) assert_int_equal(o->prepare(&w, o, &object), ES_OK);
        write_old();
        uint64_t files = hash_of_folder();
        for (off_t room = 1; room < written.st_size; room += 1 + written.st_size / 23) {
            limit_file_size((rlim_t)room);
            es_result result = try_save(&w, o, object, path_of(o->file));
            limit_file_size(0);
            HOLDS(result == ES_FILE_WRITE, o, "with room for %ld of %ld bytes: %s", (long)room, (long)written.st_size, es_result_name(result));
            HOLDS(hash_of_folder() == files, o, "with room for %ld bytes files are not as they were", (long)room);
        }
        /* nowhere to write to */
        char path[600];
        const char* ending = strrchr(o->file, '.');
        snprintf(path, sizeof path, "%s/no/where%s", folder, ending);
        HOLDS(try_save(&w, o, object, path) == ES_FILE_WRITE, o, "%s", path);
        snprintf(path, sizeof path, "%s/in.hdr/below%s", folder, ending);
        HOLDS(try_save(&w, o, object, path) == ES_FILE_WRITE, o, "%s", path);
        snprintf(path, sizeof path, "%s/a-folder%s", folder, ending);
        assert_int_equal(mkdir(path, 0777), 0);
        HOLDS(try_save(&w, o, object, path) == ES_FILE_WRITE, o, "%s", path);
        assert_int_equal(rmdir(path), 0);
        if (access("/proc/self", W_OK) == 0 || geteuid() == 0) {
            snprintf(path, sizeof path, "/proc/picture%s", ending);
            HOLDS(try_save(&w, o, object, path) == ES_FILE_WRITE, o, "%s", path);
        }
        HOLDS(hash_of_folder() == files, o, "files are not as they were");
        HOLDS(try_save(&w, o, object, path_of(o->file)) == ES_OK, o, "%s", es_context_message(w.context));
        clean_up(&w, o, object);
    }
    end_context(w.context);
}

/* ---- files that are read ---------------------------------------------------------------------------------------------------------------- */

static void copy_seed(const char* name)
{
    char path[600], bytes[8192];
    snprintf(path, sizeof path, ES_TEST_SOURCE_DIR "/tests/fuzz/seeds/gltf/%s", name);
    FILE *from = fopen(path, "rb"), *to = fopen(path_of(name), "wb");
    assert_true(from && to);
    size_t n = fread(bytes, 1, sizeof bytes, from);
    assert_int_equal(fwrite(bytes, 1, n, to), n);
    fclose(from);
    fclose(to);
}

static int make_files(void** state)
{
    strcpy(folder, "/tmp/earthshine-scarcity-XXXXXX");
    if (!mkdtemp(folder)) return -1;
    bench w = {.context = scarce_context(0)};
    void* object = NULL;
    bool good = set_up(&w, WORLD | IMAGES) == ES_OK;
    static const char* const names[] = {"in.exr", "in.png", "in.hdr", "image.png"};
    for (int i = 0; i < 4; i++) es_image_save(w.context, &w.a, path_of(names[i]), NULL);
    es_image_save(w.context, &w.b, path_of("float.exr"), &(es_image_save_desc){.sample_type = ES_SAMPLE_FLOAT});
    good = good && reference(&w, NULL, &object) == ES_OK && es_reference_add(object, 1) == ES_OK;
    if (good) es_reference_save(object, path_of("reference.exr"));
    es_reference_destroy(object);
    tear_down(&w);
    end_context(w.context);
    copy_seed("quad.gltf");
    copy_seed("moving.gltf");
    return good ? 0 : -1;
}

static int remove_files(void** state)
{
    DIR* list = opendir(folder);
    for (struct dirent* entry; (entry = readdir(list));)
        if (entry->d_name[0] != '.') unlink(path_of(entry->d_name));
    closedir(list);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_allocation_fails_once),
        cmocka_unit_test(contexts_without_memory),
        cmocka_unit_test(caps_hold),
        cmocka_unit_test(disks_without_room),
    };
    return cmocka_run_group_tests(tests, make_files, remove_files);
}
