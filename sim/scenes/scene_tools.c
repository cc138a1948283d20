/* What the built-in scenes are made with: see scene_tools.h. */
#include "sim/scenes/scene_tools.h"

#include <string.h>

#include "platform/maths.h"

es_material es_build_material(es_scene_builder* builder, const char* name, const es_material_desc* desc)
{
    es_material material = {0};
    if (builder->result == ES_OK) builder->result = es_world_add_material(builder->world, name, desc, &material);
    return material;
}

es_material es_build_lambert(es_scene_builder* builder, const char* name, float r, float g, float b)
{
    es_material_desc desc = es_default_material_desc();
    desc.base_color[0] = r;
    desc.base_color[1] = g;
    desc.base_color[2] = b;
    desc.specular = 0;
    return es_build_material(builder, name, &desc);
}

es_material es_build_gloss(es_scene_builder* builder, const char* name, float r, float g, float b, float metallic, float roughness)
{
    es_material_desc desc = es_default_material_desc();
    memcpy(desc.base_color, (const float[3]){r, g, b}, 3 * sizeof(float));
    desc.metallic = metallic;
    desc.roughness = roughness;
    return es_build_material(builder, name, &desc);
}

es_shape es_build_shape(es_scene_builder* builder)
{
    es_shape shape = es_shape_begin(es_world_context(builder->world));
    shape.stop = &builder->result;
    return shape;
}

es_mesh es_build_mesh(es_scene_builder* builder, const char* name, es_shape* shape)
{
    es_mesh mesh = {0};
    if (builder->result == ES_OK) builder->result = es_shape_add_mesh(shape, builder->world, name, &mesh);
    else es_shape_free(shape);
    return mesh;
}

es_node es_build_node(es_scene_builder* builder, const char* name, es_vec3 translation, es_quat rotation)
{
    es_node node = {0};
    es_node_desc desc = {.name = name, .transform = {translation, rotation, {1, 1, 1}}};
    if (builder->result == ES_OK) builder->result = es_world_add_node(builder->world, &desc, &node);
    return node;
}

es_instance es_build_instance(es_scene_builder* builder, es_node node, es_mesh mesh, es_material material)
{
    es_instance instance = {0};
    es_instance_desc desc = {.node = node, .mesh = mesh, .material = material};
    if (builder->result == ES_OK) builder->result = es_world_add_instance(builder->world, &desc, &instance);
    return instance;
}

es_node es_build_object(es_scene_builder* builder, const char* name, es_shape* shape, es_material material, es_vec3 translation)
{
    es_mesh mesh = es_build_mesh(builder, name, shape);
    es_node node = es_build_node(builder, name, translation, es_quat_identity());
    es_build_instance(builder, node, mesh, material);
    return node;
}

void es_build_slabs(es_scene_builder* builder, es_vec3 low, es_vec3 high, int columns, int rows, es_material light, es_material dark)
{
    const float tile_x = (high.x - low.x) / (float)columns, tile_z = (high.z - low.z) / (float)rows;
    es_shape floors[2] = {es_build_shape(builder), es_build_shape(builder)};
    for (int row = 0; row < rows; row++)
        for (int column = 0; column < columns; column++) {
            const float x = low.x + tile_x * (float)column, z = low.z + tile_z * (float)row;
            es_shape_quad(&floors[(row + column) % 2], es_v3(x, 0, z), es_v3(x + tile_x, 0, z), es_v3(x + tile_x, 0, z + tile_z), es_v3(x, 0, z + tile_z), es_v3(0, 1, 0));
        }
    es_build_object(builder, "light slabs", &floors[0], light, es_v3(0, 0, 0));
    es_build_object(builder, "dark slabs", &floors[1], dark, es_v3(0, 0, 0));
}

es_quat es_look_rotation(es_vec3 direction)
{
    float yaw = es_atan2(-direction.x, -direction.z);
    float pitch = es_atan2(direction.y, es_sqrt(direction.x * direction.x + direction.z * direction.z));
    return es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), yaw), es_quat_from_axis_angle(es_v3(1, 0, 0), pitch));
}

void es_build_camera(es_scene_builder* builder, es_vec3 eye, es_vec3 direction, float fov_y, float near_plane)
{
    es_node node = es_build_node(builder, "camera", eye, es_look_rotation(direction));
    es_camera camera;
    es_camera_desc desc = es_default_camera_desc();
    desc.name = "camera";
    desc.node = node;
    desc.fov_y = fov_y;
    desc.near_plane = near_plane;
    if (builder->result == ES_OK) builder->result = es_world_add_camera(builder->world, &desc, &camera);
}

es_node es_build_spot(es_scene_builder* builder, es_vec3 position, es_vec3 direction, const float color[3], float intensity, float inner_cone, float outer_cone)
{
    es_node node = es_build_node(builder, "spot", position, es_look_rotation(direction));
    es_light light;
    es_light_desc desc = es_default_light_desc();
    desc.name = "spot";
    desc.node = node;
    memcpy(desc.color, color, sizeof desc.color);
    desc.intensity = intensity;
    desc.inner_cone = inner_cone;
    desc.outer_cone = outer_cone;
    if (builder->result == ES_OK) builder->result = es_world_add_light(builder->world, &desc, &light);
    return node;
}

/* Rewrites `keys` values of n components as cubic-spline triples, last key = first key at the end of the loop. */
static void spline(const float* samples, uint32_t keys, uint32_t n, float step, float* values)
{
    for (uint32_t k = 0; k <= keys; k++) {
        const float *before = samples + n * ((k + keys - 1) % keys), *here = samples + n * (k % keys), *after = samples + n * ((k + 1) % keys);
        for (uint32_t c = 0; c < n; c++) {
            float slope = (after[c] - before[c]) / (2.0f * step);
            values[(3 * k) * n + c] = slope;
            values[(3 * k + 1) * n + c] = here[c];
            values[(3 * k + 2) * n + c] = slope;
        }
    }
}

enum { MAX_KEYS = 64, MAX_MOTIONS = 8 };
typedef struct motion_keys { float times[MAX_KEYS + 1], moved[MAX_MOTIONS][9 * (MAX_KEYS + 1)], turned[MAX_MOTIONS][12 * (MAX_KEYS + 1)], samples[4 * MAX_KEYS]; } motion_keys;

void es_build_clip(es_scene_builder* builder, const char* name, float period, uint32_t keys, const es_motion* motions, uint32_t count)
{
    if (builder->result != ES_OK) return;
    es_context* context = es_world_context(builder->world);
    if (keys > MAX_KEYS || count > MAX_MOTIONS) {
        builder->result = es_fail(context, ES_INVALID_ARGUMENT, "a scene's clip has at most %d keys and %d motions", MAX_KEYS, MAX_MOTIONS);
        return;
    }
    motion_keys* data = es_allocate(context, sizeof *data);
    if (!data) {
        builder->result = es_context_last_result(context);
        return;
    }
    float step = period / (float)keys;
    for (uint32_t k = 0; k <= keys; k++) data->times[k] = step * (float)k;
    es_clip_channel channels[2 * MAX_MOTIONS];
    for (uint32_t m = 0; m < count; m++) {
        es_vec3 translation;
        es_quat rotation, before = {0, 0, 0, 1};
        for (uint32_t k = 0; k < keys; k++) {
            motions[m].pose((float)k / (float)keys, &translation, &rotation);
            memcpy(data->samples + 3 * k, &translation, sizeof translation);
        }
        spline(data->samples, keys, 3, step, data->moved[m]);
        for (uint32_t k = 0; k < keys; k++) {
            motions[m].pose((float)k / (float)keys, &translation, &rotation);
            /* q and -q are the same rotation: neighbours must lie on the same side for the spline between them */
            if (k > 0 && rotation.x * before.x + rotation.y * before.y + rotation.z * before.z + rotation.w * before.w < 0)
                rotation = (es_quat){-rotation.x, -rotation.y, -rotation.z, -rotation.w};
            before = rotation;
            memcpy(data->samples + 4 * k, &rotation, sizeof rotation);
        }
        spline(data->samples, keys, 4, step, data->turned[m]);
        channels[2 * m] = (es_clip_channel){motions[m].node, ES_CLIP_TRANSLATION, ES_INTERPOLATE_CUBIC_SPLINE, keys + 1, data->times, data->moved[m]};
        channels[2 * m + 1] = (es_clip_channel){motions[m].node, ES_CLIP_ROTATION, ES_INTERPOLATE_CUBIC_SPLINE, keys + 1, data->times, data->turned[m]};
    }
    es_clip clip;
    builder->result = es_world_add_clip(builder->world, &(es_clip_desc){name, 2 * count, channels}, &clip);
    es_release(context, data, sizeof *data);
}
