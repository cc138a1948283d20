/* Views from an eye point. */
#include "platform/maths.h"
#include "raster/raster.h"

static es_raster_view view_of(uint32_t width, uint32_t height, es_mat4 view, es_mat4 projection)
{
    return (es_raster_view){.width = width, .height = height, .view = view, .projection = projection, .previous_view = view, .previous_projection = projection, .cull = ES_CULL_BACK};
}

es_raster_view es_perspective_view(uint32_t width, uint32_t height, es_vec3 eye, es_vec3 direction, es_vec3 up, float fov_y, float near_plane)
{
    float aspect = (float)(width ? width : 1) / (float)(height ? height : 1);
    return view_of(width, height, es_mat4_look(eye, direction, up), es_mat4_perspective(fov_y, aspect, near_plane));
}

es_raster_view es_orthographic_view(uint32_t width, uint32_t height, es_vec3 eye, es_vec3 direction, es_vec3 up, float half_width, float half_height, float near_plane, float far_plane)
{
    return view_of(width, height, es_mat4_look(eye, direction, up), es_mat4_orthographic(half_width, half_height, near_plane, far_plane));
}

void es_cube_views(uint32_t size, es_vec3 eye, float near_plane, es_raster_view faces[6])
{
    /* Exactly orthogonal axes and a slope of exactly one: neighbouring faces meet at the cube's edges without rounding. */
    static const es_vec3 direction[6] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    static const es_vec3 up[6] = {{0, 1, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}, {0, 1, 0}, {0, 1, 0}};
    es_mat4 projection = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, -1, 0, 0, near_plane, 0}};
    for (int i = 0; i < 6; i++) faces[i] = view_of(size, size, es_mat4_look(eye, direction[i], up[i]), projection);
}
