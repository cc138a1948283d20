/* The smallest embedding: three boxes and a lamp, one frame with indirect light, saved as a PNG.
 *   cc embed.c $(pkg-config --cflags --libs earthshine) && ./a.out embed.png */
#include <earthshine/gi.h>
#include <stdio.h>

/* A box around the origin with sides of one metre, scaled and placed by its node. */
static es_result add_box(es_world* world, es_mesh mesh, es_vec3 centre, es_vec3 size, float r, float g, float b)
{
    es_node_desc node_desc = {.transform = es_identity_transform()};
    node_desc.transform.translation = centre;
    node_desc.transform.scale = size;
    es_material_desc paint = es_default_material_desc();
    paint.base_color[0] = r, paint.base_color[1] = g, paint.base_color[2] = b;
    es_instance_desc box = {.mesh = mesh};
    es_result result = es_world_add_node(world, &node_desc, &box.node);
    if (result == ES_OK) result = es_world_add_material(world, "paint", &paint, &box.material);
    es_instance instance;
    return result == ES_OK ? es_world_add_instance(world, &box, &instance) : result;
}

static es_result build(es_world* world)
{
    float corners[24];
    for (int i = 0; i < 24; i++) corners[i] = (i / 3 >> i % 3 & 1) - 0.5f; /* corner k: bits of k are x, y, z */
    static const uint32_t faces[36] = {
        0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
    es_mesh_desc mesh_desc = {
        .name = "box", .vertex_count = 8, .triangle_count = 12, .positions = corners, .indices = faces, .flat_normals = true};
    es_mesh mesh;
    es_result result = es_world_add_mesh(world, &mesh_desc, &mesh);
    if (result == ES_OK) result = add_box(world, mesh, (es_vec3){0, -0.5f, 0}, (es_vec3){6, 1, 6}, 0.8f, 0.8f, 0.8f);
    if (result == ES_OK) result = add_box(world, mesh, (es_vec3){-1.5f, 1, 0}, (es_vec3){0.2f, 2, 3}, 0.8f, 0.15f, 0.1f);
    if (result == ES_OK) result = add_box(world, mesh, (es_vec3){0.4f, 0.5f, 0.2f}, (es_vec3){1, 1, 1}, 0.75f, 0.75f, 0.75f);

    es_node_desc node_desc = {.name = "camera", .transform = es_identity_transform()};
    node_desc.transform.translation = (es_vec3){0, 1.1f, 5};
    es_camera_desc camera_desc = es_default_camera_desc();
    es_camera camera;
    if (result == ES_OK) result = es_world_add_node(world, &node_desc, &camera_desc.node);
    if (result == ES_OK) result = es_world_add_camera(world, &camera_desc, &camera);
    if (result == ES_OK) result = es_world_set_active_camera(world, camera);

    node_desc.name = "lamp"; /* shines along its node's -z: turned 40° to the left, then it comes from the right */
    node_desc.transform.translation = (es_vec3){2.5f, 1.8f, 2.5f};
    node_desc.transform.rotation = (es_quat){-0.13f, 0.36f, 0.05f, 0.92f};
    es_light_desc lamp = es_default_light_desc();
    lamp.type = ES_LIGHT_SPOT;
    lamp.intensity = 60;
    lamp.inner_cone = 0.5f, lamp.outer_cone = 0.7f;
    es_light light;
    if (result == ES_OK) result = es_world_add_node(world, &node_desc, &lamp.node);
    return result == ES_OK ? es_world_add_light(world, &lamp, &light) : result;
}

int main(int count, char** arguments)
{
    es_context* context = NULL;
    es_world* world = NULL;
    es_renderer* renderer = NULL;
    es_image image = {0};
    es_result result = es_context_create(NULL, &context);
    if (result == ES_OK) result = es_world_create(context, NULL, &world);
    if (result == ES_OK) result = build(world);
    if (result == ES_OK) result = es_renderer_create(context, NULL, &renderer);
    if (result == ES_OK) result = es_world_step(world, 0);
    if (result == ES_OK) result = es_renderer_render(renderer, world);
    if (result == ES_OK) result = es_renderer_image(renderer, "display", &image);
    if (result == ES_OK) result = es_image_save(context, &image, count > 1 ? arguments[1] : "embed.png", NULL);
    if (result != ES_OK) fprintf(stderr, "%s\n", context ? es_context_message(context) : es_result_text(result));
    if (context) es_image_destroy(context, &image);
    if (renderer) es_renderer_destroy(renderer);
    if (world) es_world_destroy(world);
    if (context) es_context_destroy(context);
    return result == ES_OK ? 0 : 1;
}
