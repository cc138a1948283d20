/* Prints the hash of every image of a few small frames, one per line: SCENE FRAME IMAGE HASH.
 *
 * The same lines must come out for any number of threads, instruction set, compiler and optimisation level, and with or
 * without skipping: tests/determinism.sh compares them; tests/goldens.sh compares them with tests/goldens.txt, so that a
 * change names the image it reached. The built-in scenes are drawn with few triangles; `parts` is a world made here, of what
 * those lack: point and directional light, textures, alpha mask, mirrored instances, Phong and unlit surfaces, a deformed mesh.
 *
 * The frames are chosen for what may be skipped in them: `unchanged` follows a frame whose every pass can be kept, `camera`
 * moves only the eye, `exposure` only the display, `seed` only the virtual lights; `classic` draws accurate shadow maps;
 * `half-temporal` and `temporal` blend light with that of the frame before, `antialiased` the picture as well;
 * `bounces`, `one-pass` and `reflective` have three bounces by rays, by maps and by reflective maps after a step; `moving` are the scenes
 * that move by themselves, with the hash of the world's state after a second; `blended` and `micro-blended` see through three materials of
 * `parts`, and `glare` and `billboards` look at that with an eye; `traced` and `unbounded` trace rays to the virtual lights, `compensated` does after a step that the hierarchy is refit for.
 *
 * usage: frame_hashes [--threads N] [--isa NAME] [--no-skip] [--write DIR] [SCENE …]
 *        frame_hashes --isas | --scenes
 *   --write  also keeps every image as DIR/SCENE-FRAME-IMAGE.exr, to look at what changed
 *   --isas   prints the instruction sets at hand; --scenes all scenes' names
 */
#include <earthshine/gi.h>

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void stop(const es_context* context, const char* what)
{
    fprintf(stderr, "frame_hashes: %s failed: %s\n", what, context ? es_context_message(context) : "");
    exit(1);
}

static void check(const es_context* context, es_result result, const char* what)
{
    if (result != ES_OK) stop(context, what);
}

/* ---- the world of parts ------------------------------------------------------------------------------------------------ */

enum { GRID = 12, FACE_VERTICES = (GRID + 1) * (GRID + 1), SPHERE_VERTICES = 6 * FACE_VERTICES, SPHERE_TRIANGLES = 6 * GRID * GRID * 2 };

typedef struct sphere {
    float positions[SPHERE_VERTICES * 3], uvs[SPHERE_VERTICES * 2], colors[SPHERE_VERTICES * 4];
    uint32_t indices[SPHERE_TRIANGLES * 3];
} sphere;

/* A cube's six gridded faces drawn out to the unit sphere: only sqrt, so the vertices are the same everywhere. */
static void make_sphere(sphere* s)
{
    static const float axes[6][3][3] = {
        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},  {{-1, 0, 0}, {0, 0, 1}, {0, 1, 0}}, {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
        {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}, {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},  {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}}};
    uint32_t vertex = 0, index = 0;
    for (int face = 0; face < 6; face++) {
        uint32_t first = vertex;
        for (int j = 0; j <= GRID; j++) {
            for (int i = 0; i <= GRID; i++, vertex++) {
                float u = (float)i / GRID * 2 - 1, v = (float)j / GRID * 2 - 1;
                float scale = 1.0f / sqrtf(1.0f + u * u + v * v);
                for (int k = 0; k < 3; k++)
                    s->positions[3 * vertex + k] = (axes[face][0][k] + axes[face][1][k] * u + axes[face][2][k] * v) * scale;
                s->uvs[2 * vertex] = (float)i / GRID * 1.5f;
                s->uvs[2 * vertex + 1] = (float)j / GRID * 1.5f;
                for (int k = 0; k < 4; k++) s->colors[4 * vertex + k] = k < 3 ? 0.5f + 0.5f * (float)((face >> k) & 1) : 1.0f;
            }
        }
        for (uint32_t j = 0; j < GRID; j++) {
            for (uint32_t i = 0; i < GRID; i++) {
                uint32_t a = first + j * (GRID + 1) + i, b = a + 1, c = a + GRID + 1, d = c + 1;
                const uint32_t corners[6] = {a, b, d, a, d, c};
                memcpy(s->indices + index, corners, sizeof corners);
                index += 6;
            }
        }
    }
}

typedef struct parts {
    es_node ball, lamp;
    es_material blended[3]; /* in the last frames */
    es_mesh mesh;
    sphere shape;
} parts;

static void move_parts(es_world* world, void* user, double time, float dt)
{
    parts* p = user;
    es_context* context = es_world_context(world);
    float t = (float)time;
    es_transform transform;
    check(context, es_world_get_node_transform(world, p->ball, &transform), "reading a node");
    transform.translation.x = -0.8f + 1.5f * t;
    check(context, es_world_set_node_transform(world, p->ball, &transform), "moving a node");
    check(context, es_world_get_node_transform(world, p->lamp, &transform), "reading the lamp's node");
    transform.translation.z = 0.6f - t;
    check(context, es_world_set_node_transform(world, p->lamp, &transform), "moving the lamp");
    float* positions = malloc(sizeof p->shape.positions);
    if (!positions) stop(context, "memory");
    for (uint32_t i = 0; i < SPHERE_VERTICES; i++) {
        const float* from = p->shape.positions + 3 * i;
        float squeeze = 1.0f + 0.5f * t * from[1];
        positions[3 * i] = from[0] * squeeze;
        positions[3 * i + 1] = from[1];
        positions[3 * i + 2] = from[2] * squeeze;
    }
    check(context, es_world_deform_mesh(world, p->mesh, positions, NULL), "deforming a mesh");
    free(positions);
}

static es_node add_node(es_world* world, const char* name, es_vec3 at, es_quat rotation, es_vec3 scale)
{
    es_node node;
    es_node_desc desc = {.name = name, .transform = {at, rotation, scale}};
    check(es_world_context(world), es_world_add_node(world, &desc, &node), "adding a node");
    return node;
}

static void add_instance(es_world* world, es_node node, es_mesh mesh, es_material material)
{
    es_instance instance;
    es_instance_desc desc = {.node = node, .mesh = mesh, .material = material};
    check(es_world_context(world), es_world_add_instance(world, &desc, &instance), "adding an instance");
}

static es_material add_material(es_world* world, const char* name, const es_material_desc* desc)
{
    es_material material;
    check(es_world_context(world), es_world_add_material(world, name, desc, &material), "adding a material");
    return material;
}

static const es_quat upright = {0, 0, 0, 1};

static void make_parts(es_context* context, const es_world_settings* settings, es_world** result, parts* p)
{
    es_world* world;
    check(context, es_world_create(context, settings, &world), "creating a world");
    *result = world;
    make_sphere(&p->shape);

    /* a picture of 48 × 32 texels, not powers of two: colours in squares, alpha in stripes */
    enum { WIDTH = 48, HEIGHT = 32 };
    static const uint8_t levels[4] = {40, 110, 180, 250};
    uint8_t* rgba = malloc(WIDTH * HEIGHT * 4);
    if (!rgba) stop(context, "memory");
    for (uint32_t y = 0; y < HEIGHT; y++) {
        for (uint32_t x = 0; x < WIDTH; x++) {
            uint8_t* texel = rgba + 4 * (y * WIDTH + x);
            texel[0] = levels[(x / 8 + y / 8) & 3];
            texel[1] = levels[(x / 4) & 3];
            texel[2] = levels[(y / 4) & 3];
            texel[3] = (x / 6) & 1 ? 255 : 20;
        }
    }
    es_texture colors, bumps;
    es_texture_desc texture = {.name = "colours", .width = WIDTH, .height = HEIGHT, .rgba = rgba, .srgb = true};
    check(context, es_world_add_texture(world, &texture, &colors), "adding a texture");
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        uint8_t* texel = rgba + 4 * i;
        texel[0] = (uint8_t)(96 + 64 * ((i / 5) & 1));
        texel[1] = (uint8_t)(96 + 64 * ((i / (WIDTH * 5)) & 1));
        texel[2] = 240;
        texel[3] = 255;
    }
    texture.name = "bumps";
    texture.srgb = false;
    check(context, es_world_add_texture(world, &texture, &bumps), "adding a texture");
    free(rgba);

    es_texture_use use = {.image = es_world_texture_image(world, colors)};
    es_material_desc desc = es_default_material_desc();
    desc.base_color_texture = use;
    desc.normal_texture = use;
    desc.normal_texture.image = es_world_texture_image(world, bumps);
    desc.normal_texture.wrap_u = ES_WRAP_MIRROR;
    desc.roughness = 0.6f;
    es_material ground = add_material(world, "ground", &desc);

    desc = es_default_material_desc();
    desc.base_color_texture = use;
    desc.base_color_texture.magnify = ES_FILTER_NEAREST;
    desc.base_color_texture.wrap_v = ES_WRAP_CLAMP;
    desc.alpha_mask = true;
    desc.double_sided = true;
    es_material fence = add_material(world, "fence", &desc);

    desc = es_default_material_desc();
    desc.model = ES_SURFACE_PHONG;
    desc.base_color[1] = 0.3f;
    desc.base_color[2] = 0.2f;
    desc.specular = 0.4f;
    desc.exponent = 30;
    es_material phong = add_material(world, "phong", &desc);

    desc = es_default_material_desc();
    desc.metallic = 1;
    desc.roughness = 0.35f;
    desc.base_color[2] = 0.4f;
    es_material metal = add_material(world, "metal", &desc);

    desc = es_default_material_desc();
    desc.model = ES_SURFACE_UNLIT;
    desc.base_color[0] = 0.1f;
    desc.emission[1] = 0.5f;
    es_material unlit = add_material(world, "unlit", &desc);

    const es_material through[3] = {fence, metal, unlit};
    memcpy(p->blended, through, sizeof through);

    es_mesh_desc ball = {.name = "ball", .vertex_count = SPHERE_VERTICES, .triangle_count = SPHERE_TRIANGLES,
        .positions = p->shape.positions, .uv0 = p->shape.uvs, .colors = p->shape.colors, .indices = p->shape.indices};
    es_mesh steady;
    check(context, es_world_add_mesh(world, &ball, &p->mesh), "adding a mesh");
    ball.name = "facets";
    ball.flat_normals = true;
    ball.colors = NULL;
    check(context, es_world_add_mesh(world, &ball, &steady), "adding a mesh");
    static const float corners[12] = {-1, 0, 1, 1, 0, 1, 1, 0, -1, -1, 0, -1}, uvs[8] = {0, 2, 3, 2, 3, 0, 0, 0};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    es_mesh_desc square = {.name = "square", .vertex_count = 4, .triangle_count = 2, .positions = corners, .uv0 = uvs, .indices = indices};
    es_mesh plane;
    check(context, es_world_add_mesh(world, &square, &plane), "adding a mesh");

    const float half = sqrtf(0.5f);
    const es_vec3 one = {1, 1, 1};
    add_instance(world, add_node(world, "ground", (es_vec3){0, 0, 0}, upright, (es_vec3){3, 1, 3}), plane, ground);
    add_instance(world, add_node(world, "wall", (es_vec3){0, 1.5f, -2}, (es_quat){half, 0, 0, half}, (es_vec3){3, 1, 1.5f}), plane, phong);
    add_instance(world, add_node(world, "fence", (es_vec3){1.2f, 0.7f, 0.4f}, (es_quat){0, 0, half, half}, (es_vec3){0.7f, 1, 0.9f}), plane, fence);
    p->ball = add_node(world, "ball", (es_vec3){-0.8f, 0.6f, 0}, upright, (es_vec3){0.6f, 0.6f, 0.6f});
    add_instance(world, p->ball, p->mesh, phong);
    add_instance(world, add_node(world, "mirrored", (es_vec3){0.5f, 0.5f, -0.8f}, upright, (es_vec3){-0.5f, 0.5f, 0.5f}), steady, metal);
    add_instance(world, add_node(world, "sign", (es_vec3){-1.6f, 0.3f, 0.8f}, upright, (es_vec3){0.2f, 0.3f, 0.2f}), steady, unlit);

    es_light_desc light = es_default_light_desc();
    es_light added;
    light.name = "lamp";
    light.type = ES_LIGHT_POINT;
    light.intensity = 6;
    light.color[2] = 0.6f;
    light.node = p->lamp = add_node(world, "lamp", (es_vec3){0.2f, 2.2f, 0.6f}, upright, one);
    check(context, es_world_add_light(world, &light, &added), "adding a light");
    light = es_default_light_desc();
    light.name = "sun";
    light.type = ES_LIGHT_DIRECTIONAL;
    light.intensity = 1.5f;
    light.color[0] = 0.7f;
    light.node = add_node(world, "sun", (es_vec3){-2, 4, 2}, (es_quat){-0.6f, 0, 0, 0.8f}, one);
    check(context, es_world_add_light(world, &light, &added), "adding a light");

    es_camera_desc camera = es_default_camera_desc();
    es_camera eye;
    camera.node = add_node(world, "eye", (es_vec3){0, 1.1f, 4}, upright, one);
    camera.near_plane = 0.05f;
    check(context, es_world_add_camera(world, &camera, &eye), "adding a camera");
    check(context, es_world_set_active_camera(world, eye), "choosing a camera");
    es_world_set_step_function(world, move_parts, p);
    check(context, es_world_step(world, 0), "the first step");
}

/* ---- frames ----------------------------------------------------------------------------------------------------------------- */

typedef struct plan {
    const char* name;
    uint32_t triangles, width, height, light_size, vpls, interleave, ism_size, ism_points, tone_map;
    bool glossy;
} plan;

/* Odd sizes leave partial tiles and partial vectors. */
static const plan plans[] = {
    {"cornell", 0, 160, 120, 128, 64, 4, 64, 1024, ES_TONE_MAP_REINHARD, false},
    {"room", 4000, 157, 119, 128, 128, 8, 128, 1024, ES_TONE_MAP_PBR_NEUTRAL, false},
    {"hall", 8000, 131, 97, 128, 50, 3, 32, 448, ES_TONE_MAP_LINEAR, false},
    {"parts", 0, 144, 96, 128, 48, 2, 64, 1024, ES_TONE_MAP_REINHARD, true},
    {"parts-small", 0, 65, 43, 64, 24, 2, 32, 512, ES_TONE_MAP_REINHARD, true}, /* for processors that are imitated */
};

static void print_images(es_context* context, es_renderer* renderer, es_world* world, const char* scene, const char* frame, const char* folder)
{
    check(context, es_renderer_render(renderer, world), "rendering");
    for (size_t i = 0; i < es_image_name_count(); i++) {
        es_image image = {0};
        check(context, es_renderer_image(renderer, es_image_name(i), &image), es_image_name(i));
        printf("%s %s %s %016" PRIx64 "\n", scene, frame, es_image_name(i), es_image_hash(&image));
        char path[1024];
        if (folder && snprintf(path, sizeof path, "%s/%s-%s-%s.exr", folder, scene, frame, es_image_name(i)) < (int)sizeof path)
            check(context, es_image_save(context, &image, path, NULL), path);
        es_image_destroy(context, &image);
    }
}

static void move_eye(es_context* context, es_world* world)
{
    es_camera_desc camera;
    es_transform transform;
    check(context, es_world_get_camera(world, es_world_active_camera(world), &camera), "reading the camera");
    check(context, es_world_get_node_transform(world, camera.node, &transform), "reading the camera's node");
    transform.translation.x += 0.0625f;
    check(context, es_world_set_node_transform(world, camera.node, &transform), "moving the camera");
}

static void print_frames(es_context* context, const plan* p, bool skip, const char* folder)
{
    es_world_settings world_settings = es_default_world_settings();
    world_settings.triangles = p->triangles;
    es_world* world = NULL;
    parts* made = NULL;
    if (strncmp(p->name, "parts", 5) == 0) {
        made = calloc(1, sizeof *made);
        if (!made) stop(context, "memory");
        make_parts(context, &world_settings, &world, made);
    } else {
        check(context, es_world_create_scene(context, p->name, &world_settings, &world), p->name);
    }

    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = p->width;
    settings.height = p->height;
    settings.skip = skip;
    settings.shadow_size = 2 * p->light_size;
    settings.light_size = p->light_size;
    settings.vpls = p->vpls;
    settings.glossy_vpls = p->glossy;
    settings.interleave = p->interleave;
    settings.ism_size = p->ism_size;
    settings.ism_points = p->ism_points;
    settings.ism_pool = 256 * p->light_size;
    settings.classic_size = p->light_size / 2;
    settings.tone_map = p->tone_map;
    es_renderer* renderer;
    check(context, es_renderer_create(context, &settings, &renderer), "creating a renderer");

    print_images(context, renderer, world, p->name, "first", folder);
    check(context, es_world_step(world, 1.0f / 30), "a step");
    print_images(context, renderer, world, p->name, "second", folder);
    check(context, es_world_step(world, 1.0f / 30), "a step");
    print_images(context, renderer, world, p->name, "third", folder);
    check(context, es_world_step(world, 0), "a step of no time");
    print_images(context, renderer, world, p->name, "still", folder);
    print_images(context, renderer, world, p->name, "unchanged", folder);
    move_eye(context, world);
    print_images(context, renderer, world, p->name, "camera", folder);
    settings.exposure += 0.5f;
    check(context, es_renderer_configure(renderer, &settings), "changing the exposure");
    print_images(context, renderer, world, p->name, "exposure", folder);
    settings.seed += 1;
    check(context, es_renderer_configure(renderer, &settings), "changing the seed");
    print_images(context, renderer, world, p->name, "seed", folder);
    settings.method = ES_GI_CLASSIC;
    settings.vpls = 16;
    check(context, es_renderer_configure(renderer, &settings), "changing the method");
    print_images(context, renderer, world, p->name, "classic", folder);
    settings.method = ES_GI_VPL_TRACED;
    check(context, es_renderer_configure(renderer, &settings), "changing the method");
    print_images(context, renderer, world, p->name, "traced", folder);
    settings.traced_bias = ES_TRACED_UNBOUNDED;
    check(context, es_renderer_configure(renderer, &settings), "leaving out the bound");
    print_images(context, renderer, world, p->name, "unbounded", folder);
    settings.traced_bias = ES_TRACED_COMPENSATED;
    settings.traced_samples = 2;
    check(context, es_renderer_configure(renderer, &settings), "compensating");
    check(context, es_world_step(world, 1.0f / 30), "a step");
    print_images(context, renderer, world, p->name, "compensated", folder);
    settings.traced_bias = ES_TRACED_BOUNDED;
    settings.method = ES_GI_VPL_SAMPLED;
    settings.near_distance = 0.05f;
    settings.vpls = p->vpls;
    check(context, es_renderer_configure(renderer, &settings), "sampling");
    print_images(context, renderer, world, p->name, "sampled", folder);
    settings.half_resolution = true;
    check(context, es_renderer_configure(renderer, &settings), "halving the resolution");
    print_images(context, renderer, world, p->name, "half", folder);
    settings.temporal = true;
    check(context, es_renderer_configure(renderer, &settings), "keeping history");
    check(context, es_renderer_render(renderer, world), "rendering");
    check(context, es_world_step(world, 1.0f / 30), "a step");
    print_images(context, renderer, world, p->name, "half-temporal", folder);
    settings.half_resolution = false;
    settings.method = ES_GI_ISM;
    settings.vpls = p->vpls / 2;
    settings.near_distance = 0;
    settings.temporal_clamp = 0.5f;
    check(context, es_renderer_configure(renderer, &settings), "keeping history");
    check(context, es_renderer_render(renderer, world), "rendering");
    check(context, es_world_step(world, 1.0f / 30), "a step");
    print_images(context, renderer, world, p->name, "temporal", folder);
    settings.antialias = ES_ANTIALIAS_TEMPORAL;
    check(context, es_renderer_configure(renderer, &settings), "smoothing edges over frames");
    check(context, es_renderer_render(renderer, world), "rendering");
    check(context, es_world_step(world, 1.0f / 30), "a step");
    print_images(context, renderer, world, p->name, "antialiased", folder);
    settings.temporal = false;
    settings.antialias = ES_ANTIALIAS_SUPERSAMPLE;
    settings.antialias_samples = 3;
    check(context, es_renderer_configure(renderer, &settings), "smoothing edges by several pictures");
    print_images(context, renderer, world, p->name, "supersampled", folder);

    settings.antialias = ES_ANTIALIAS_NONE;
    settings.method = ES_GI_VPL_SAMPLED;
    settings.half_resolution = true;
    settings.bounce_method = ES_BOUNCE_ONE_PASS;
    settings.bounces = 3;
    settings.bounce_vpls = p->vpls / 2;
    check(context, es_renderer_configure(renderer, &settings), "more bounces");
    print_images(context, renderer, world, p->name, "bounces", folder);
    settings.half_resolution = false;
    settings.method = ES_GI_ISM;
    check(context, es_renderer_configure(renderer, &settings), "bounces by maps");
    print_images(context, renderer, world, p->name, "one-pass", folder);
    settings.bounce_method = ES_BOUNCE_REFLECTIVE;
    check(context, es_world_step(world, 1.0f / 30), "a step");
    check(context, es_renderer_configure(renderer, &settings), "bounces by reflective maps");
    print_images(context, renderer, world, p->name, "reflective", folder);

    settings.method = ES_GI_MICRO;
    settings.bounces = 1;
    settings.width = p->width / 2;
    settings.height = p->height / 2;
    settings.micro_size = 12;
    settings.micro_points = 32 * p->light_size;
    check(context, es_renderer_configure(renderer, &settings), "micro-buffers");
    print_images(context, renderer, world, p->name, "micro", folder);
    settings.micro_spacing = 4;
    settings.micro_light = p->interleave % 2 ? ES_MICRO_LIGHT_RADIOSITY : p->glossy ? ES_MICRO_LIGHT_PHOTONS : ES_MICRO_LIGHT_VPLS;
    settings.micro_level = 8;
    settings.micro_photons = 32 * p->light_size;
    settings.bounces = 3;
    settings.temporal = true;
    check(context, es_renderer_configure(renderer, &settings), "fewer micro-buffers");
    check(context, es_renderer_render(renderer, world), "rendering");
    check(context, es_world_step(world, 1.0f / 30), "a step");
    print_images(context, renderer, world, p->name, "micro-sparse", folder);

    for (int i = 0; made && i < 3; i++) {
        es_material_desc material;
        check(context, es_world_get_material(world, made->blended[i], &material), "reading a material");
        material.blend = true;
        material.alpha_mask = false;
        material.base_color[3] = 0.75f - 0.125f * (float)i;
        check(context, es_world_set_material(world, made->blended[i], &material), "blending a material");
    }
    if (made) {
        print_images(context, renderer, world, p->name, "micro-blended", folder);
        settings.method = ES_GI_ISM;
        settings.bounces = 2;
        settings.temporal = false;
        settings.blend_layers = 2;
        settings.width = p->width;
        settings.height = p->height;
        check(context, es_renderer_configure(renderer, &settings), "blending");
        print_images(context, renderer, world, p->name, "blended", folder);
        settings.glare = ES_GLARE_CONVOLUTION;
        settings.glare_size = 128;
        settings.glare_field = 3;
        check(context, es_renderer_configure(renderer, &settings), "looking at it with an eye");
        print_images(context, renderer, world, p->name, "glare", folder);
        settings.glare = ES_GLARE_BILLBOARDS;
        settings.glare_cycle = 3;
        settings.glare_defocus = 0.25f;
        settings.glare_threshold = 0.5f;
        settings.glare_billboards = 5;
        check(context, es_renderer_configure(renderer, &settings), "billboards");
        check(context, es_world_step(world, 1.0f / 30), "a step");
        print_images(context, renderer, world, p->name, "billboards", folder);
    }

    es_renderer_destroy(renderer);
    es_world_destroy(world);
    free(made);
}

/* ---- scenes that move by themselves --------------------------------------------------------------------------------------------- */

static bool moves_by_itself(const char* scene)
{
    for (size_t i = 0; i < sizeof plans / sizeof *plans; i++)
        if (strcmp(scene, plans[i].name) == 0) return false;
    return true;
}

/* Bodies, cloth, skins and movers for a second, pictures of three frames of it with what the scene recommends, made small. */
static void print_moving(es_context* context, const char* scene, bool skip, const char* folder)
{
    es_world_settings world_settings = es_default_world_settings();
    world_settings.triangles = 2500;
    es_renderer_settings settings = es_default_renderer_settings();
    for (const char* const* text = es_scene_settings(scene); *text; text++) {
        char name[64];
        const char* equals = strchr(*text, '=');
        snprintf(name, sizeof name, "%.*s", (int)(equals - *text), *text);
        check(context, es_renderer_settings_set(context, &settings, name, equals + 1), *text);
    }
    settings.width = 97;
    settings.height = 71;
    settings.skip = skip;
    settings.shadow_size = 64;
    settings.light_size = 32;
    settings.vpls = 48;
    settings.interleave = 4;
    settings.ism_size = 32;
    settings.ism_points = 512;
    settings.ism_pool = 8192;
    es_world* world;
    es_renderer* renderer;
    check(context, es_world_create_scene(context, scene, &world_settings, &world), scene);
    check(context, es_renderer_create(context, &settings, &renderer), "creating a renderer");
    for (int frame = 1; frame <= 30; frame++) {
        check(context, es_world_step(world, 1.0f / 30), "a step");
        if (frame == 10 || frame == 11) check(context, es_renderer_render(renderer, world), "rendering");
        if (frame == 12) print_images(context, renderer, world, scene, "moving", folder);
    }
    printf("%s moving world %016" PRIx64 "\n", scene, es_world_hash(world));
    es_renderer_destroy(renderer);
    es_world_destroy(world);
}

int main(int argc, char** argv)
{
    es_context_desc desc = es_default_context_desc();
    bool skip = true;
    const char *chosen[32], *folder = NULL;
    int chosen_count = 0;
    for (int i = 1; i < argc; i++) {
        es_isa isa;
        if (strcmp(argv[i], "--isas") == 0) {
            for (int k = 0; k < ES_ISA_COUNT; k++)
                if (es_isa_available_mask() >> k & 1) puts(es_isa_name((es_isa)k));
            return 0;
        } else if (strcmp(argv[i], "--scenes") == 0) {
            for (size_t k = 0; k < es_scene_count(); k++)
                if (moves_by_itself(es_scene_name(k))) printf("%s ", es_scene_name(k));
            for (size_t k = 0; k < sizeof plans / sizeof *plans; k++) printf("%s%s", plans[k].name, k + 1 < sizeof plans / sizeof *plans ? " " : "\n");
            return 0;
        } else if (strcmp(argv[i], "--threads") == 0 && i + 1 < argc) {
            desc.threads = (uint32_t)strtoul(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--isa") == 0 && i + 1 < argc && es_isa_from_name(argv[i + 1], &isa)) {
            desc.isa_mask = 1u << isa;
            i++;
        } else if (strcmp(argv[i], "--no-skip") == 0) {
            skip = false;
        } else if (strcmp(argv[i], "--write") == 0 && i + 1 < argc) {
            folder = argv[++i];
        } else if (argv[i][0] != '-' && chosen_count < 32) {
            chosen[chosen_count++] = argv[i];
        } else {
            fprintf(stderr, "frame_hashes: %s: not understood; [--threads N] [--isa NAME] [--no-skip] [--write DIR] [SCENE …], --isas or --scenes\n", argv[i]);
            return 2;
        }
    }

    es_context* context = NULL;
    if (es_context_create(&desc, &context) != ES_OK) stop(NULL, "creating a context");
    for (size_t i = 0; i < sizeof plans / sizeof *plans; i++) {
        bool wanted = chosen_count == 0;
        for (int k = 0; k < chosen_count; k++) wanted |= strcmp(chosen[k], plans[i].name) == 0;
        if (wanted) print_frames(context, &plans[i], skip, folder);
    }
    for (size_t i = 0; i < es_scene_count(); i++) {
        const char* scene = es_scene_name(i);
        bool wanted = chosen_count == 0;
        for (int k = 0; k < chosen_count; k++) wanted |= strcmp(chosen[k], scene) == 0;
        if (wanted && moves_by_itself(scene)) print_moving(context, scene, skip, folder);
    }
    es_context_destroy(context);
    return fflush(stdout) == 0 && !ferror(stdout) ? 0 : 1;
}
