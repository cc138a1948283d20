#include "player_eye.h"

#include <math.h>

bool player_look(const player* p, player_eye* e)
{
    if (!p->canvas.width || !p->canvas.height) return false;
    e->width = (float)p->canvas.width;
    e->height = (float)p->canvas.height;
    es_world_origin(p->session.world, e->origin);
    return es_world_camera_view(p->session.world, es_world_active_camera(p->session.world), p->canvas.width, p->canvas.height, &e->view) == ES_OK;
}

es_vec3 eye_of_world(const player_eye* e, const double position[3])
{
    const float* m = e->view.view.m;
    float x = (float)(position[0] - e->origin[0]), y = (float)(position[1] - e->origin[1]), z = (float)(position[2] - e->origin[2]);
    return (es_vec3){m[0] * x + m[4] * y + m[8] * z + m[12], m[1] * x + m[5] * y + m[9] * z + m[13], m[2] * x + m[6] * y + m[10] * z + m[14]};
}

void world_of_eye(const player_eye* e, es_vec3 v, double position[3])
{
    const float* m = e->view.view.m;
    float x = v.x - m[12], y = v.y - m[13], z = v.z - m[14];
    position[0] = e->origin[0] + (double)(m[0] * x + m[1] * y + m[2] * z);
    position[1] = e->origin[1] + (double)(m[4] * x + m[5] * y + m[6] * z);
    position[2] = e->origin[2] + (double)(m[8] * x + m[9] * y + m[10] * z);
}

bool eye_to_pixel(const player_eye* e, es_vec3 v, float* x, float* y)
{
    const float* m = e->view.projection.m;
    float w = m[3] * v.x + m[7] * v.y + m[11] * v.z + m[15];
    if (!(w > 1e-6f)) return false;
    *x = ((m[0] * v.x + m[4] * v.y + m[8] * v.z + m[12]) / w * 0.5f + 0.5f) * e->width;
    *y = (0.5f - (m[1] * v.x + m[5] * v.y + m[9] * v.z + m[13]) / w * 0.5f) * e->height;
    return true;
}

es_vec3 eye_of_pixel(const player_eye* e, float x, float y, float distance)
{
    const float* m = e->view.projection.m;
    float w = m[11] * -distance + m[15]; /* perspective: the distance; orthographic: 1 */
    float nx = (2 * x / e->width - 1) * w, ny = (1 - 2 * y / e->height) * w;
    return (es_vec3){(nx + m[8] * distance - m[12]) / m[0], (ny + m[9] * distance - m[13]) / m[5], -distance};
}

void eye_pixel_ray(const player_eye* e, float x, float y, double origin[3], es_vec3* direction)
{
    double far[3];
    bool parallel = e->view.projection.m[11] == 0;
    world_of_eye(e, parallel ? eye_of_pixel(e, x, y, 0) : (es_vec3){0, 0, 0}, origin);
    world_of_eye(e, eye_of_pixel(e, x, y, 1), far);
    float d[3], length = 0;
    for (int k = 0; k < 3; k++) d[k] = (float)(far[k] - origin[k]), length += d[k] * d[k];
    length = sqrtf(length);
    *direction = length > 0 ? (es_vec3){d[0] / length, d[1] / length, d[2] / length} : (es_vec3){0, 0, -1};
}
