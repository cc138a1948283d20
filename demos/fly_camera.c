/* Fly camera: yaw about the world's y, pitch about the camera's x, moves along the camera's axes. */
#include "fly_camera.h"

#include <math.h>

int fly_camera_init(fly_camera* fly, es_world* world)
{
    *fly = (fly_camera){.scenes = es_world_active_camera(world), .speed = 1};
    es_vec3 low, high;
    if (es_world_bounds(world, &low, &high)) {
        float extent = fmaxf(high.x - low.x, fmaxf(high.y - low.y, high.z - low.z));
        if (isfinite(extent) && extent > 0) fly->speed = extent / 6; /* across the scene in six seconds */
    }
    es_camera_desc camera = es_default_camera_desc();
    if (fly->scenes.id) es_world_get_camera(world, fly->scenes, &camera);
    es_node_desc node = {.name = "fly camera", .transform = es_identity_transform()};
    if (es_world_add_node(world, &node, &fly->node) != ES_OK) return DEMO_BAD_INPUT;
    camera.name = "fly camera";
    camera.node = fly->node;
    if (es_world_add_camera(world, &camera, &fly->own) != ES_OK) return DEMO_BAD_INPUT;
    return fly_camera_reset(fly, world);
}

int fly_camera_reset(fly_camera* fly, es_world* world)
{
    fly->flying = !fly->scenes.id;
    return es_world_set_active_camera(world, fly->flying ? fly->own : fly->scenes) == ES_OK ? DEMO_OK : DEMO_BAD_INPUT;
}

/* Takes position and direction from a camera as it is now, roll left out. */
static void take_over(fly_camera* fly, es_world* world, es_camera from)
{
    es_camera_desc camera;
    es_mat4 pose;
    if (es_world_get_camera(world, from, &camera) == ES_OK &&
        es_world_get_node_matrix(world, camera.node, &pose) == ES_OK) {
        fly->position = (es_vec3){pose.m[12], pose.m[13], pose.m[14]};
        fly->yaw = atan2f(pose.m[8], pose.m[10]);
        fly->pitch = atan2f(-pose.m[9], hypotf(pose.m[8], pose.m[10]));
    }
    fly->flying = true;
}

void fly_camera_adopt(fly_camera* fly, es_world* world)
{
    bool own = es_world_active_camera(world).id == fly->own.id;
    if (own) take_over(fly, world, fly->own);
    fly->flying = own;
}

int fly_camera_place(fly_camera* fly, es_world* world)
{
    if (!fly->flying) return es_world_set_active_camera(world, fly->scenes) == ES_OK ? DEMO_OK : DEMO_BAD_INPUT;
    float hy = sinf(fly->yaw / 2), wy = cosf(fly->yaw / 2), hp = sinf(fly->pitch / 2), wp = cosf(fly->pitch / 2);
    es_transform transform = es_identity_transform();
    transform.translation = fly->position;
    transform.rotation = (es_quat){wy * hp, hy * wp, -hy * hp, wy * wp}; /* yaw about y after pitch about x */
    if (es_world_set_node_transform(world, fly->node, &transform) != ES_OK) return DEMO_BAD_INPUT;
    return es_world_set_active_camera(world, fly->own) == ES_OK ? DEMO_OK : DEMO_BAD_INPUT;
}

int fly_camera_go(fly_camera* fly, es_world* world, const double position[3], es_vec3 direction, float fov_y)
{
    es_camera_desc camera;
    fly->position = (es_vec3){(float)position[0], (float)position[1], (float)position[2]};
    fly->yaw = atan2f(-direction.x, -direction.z);
    fly->pitch = atan2f(direction.y, hypotf(direction.x, direction.z));
    fly->flying = true;
    if (fov_y > 0 && es_world_get_camera(world, fly->own, &camera) == ES_OK) {
        camera.fov_y = fov_y;
        if (es_world_set_camera(world, fly->own, &camera) != ES_OK) return DEMO_BAD_INPUT;
    }
    return fly_camera_place(fly, world);
}

static float held(const es_window_input* input, int forward, int backward)
{
    return (float)input->down[forward] - (float)input->down[backward];
}

int fly_camera_update(fly_camera* fly, es_world* world, const es_window_input* input, float seconds)
{
    float ahead = held(input, 'W', 'S'), right = held(input, 'D', 'A'), up = held(input, 'E', 'Q');
    float turn = held(input, ES_KEY_LEFT, ES_KEY_RIGHT) * 1.5f * seconds,
          tilt = held(input, ES_KEY_UP, ES_KEY_DOWN) * 1.5f * seconds;
    if (input->mouse_down[0] || input->mouse_down[1]) {
        turn -= input->mouse_dx * 0.005f;
        tilt -= input->mouse_dy * 0.005f;
    }
    if (ahead == 0 && right == 0 && up == 0 && turn == 0 && tilt == 0) return DEMO_OK;
    if (!fly->flying) take_over(fly, world, fly->scenes);
    fly->yaw = remainderf(fly->yaw + turn, 6.2831853f);
    fly->pitch = fminf(fmaxf(fly->pitch + tilt, -1.55f), 1.55f);
    float step = fly->speed * seconds * (input->down[ES_KEY_SHIFT] ? 4.0f : 1.0f);
    float sy = sinf(fly->yaw), cy = cosf(fly->yaw), sp = sinf(fly->pitch), cp = cosf(fly->pitch);
    fly->position.x += step * (-sy * cp * ahead + cy * right);
    fly->position.y += step * (sp * ahead + up);
    fly->position.z += step * (-cy * cp * ahead - sy * right);
    return fly_camera_place(fly, world);
}
