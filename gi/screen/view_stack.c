#include "gi/screen/view_stack.h"

#include "platform/maths.h"

static float squared(const float v[3]) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

/* With eye coordinates e = V p, the pixel's column is (ndc x + 1) width / 2 - 1/2, its row (1 - ndc y) height / 2 - 1/2, and ndc x times -e_z (perspective)
 * or ndc x itself is P_00 e_x + P_02 e_z + P_03. */
es_screen_view es_screen_view_of(const es_raster_view* view, const es_gbuffer* gbuffer)
{
    es_screen_view s = {.width = view->width, .height = view->height, .stride = gbuffer->stride, .layer_count = 1, .layers = {gbuffer}, .rays = es_pixel_rays_of_view(view)};
    const float *v = view->view.m, *p = view->projection.m;
    const float half_width = 0.5f * (float)view->width, half_height = 0.5f * (float)view->height;
    for (int k = 0; k < 4; k++) {
        const float right = v[4 * k], up = v[4 * k + 1], back = v[4 * k + 2], one = k == 3 ? 1.0f : 0.0f, w = s.rays.orthographic ? one : -back;
        s.to_depth[k] = -back;
        s.to_x[k] = half_width * (p[0] * right + p[8] * back + p[12] * one + w) - 0.5f * w;
        s.to_y[k] = half_height * (w - (p[5] * up + p[9] * back + p[13] * one)) - 0.5f * w;
    }
    s.xx = squared(s.rays.orthographic ? s.rays.base_dx : s.rays.dir_dx);
    s.yy = squared(s.rays.orthographic ? s.rays.base_dy : s.rays.dir_dy);
    return s;
}

uint32_t es_screen_block_count(uint32_t width, uint32_t height)
{
    return (width + ES_SCREEN_BLOCK_COLUMNS - 1) / ES_SCREEN_BLOCK_COLUMNS * ((height + ES_SCREEN_BLOCK_ROWS - 1) / ES_SCREEN_BLOCK_ROWS);
}

es_screen_block es_screen_block_at(uint32_t width, uint32_t height, uint32_t index)
{
    const uint32_t columns = (width + ES_SCREEN_BLOCK_COLUMNS - 1) / ES_SCREEN_BLOCK_COLUMNS, x0 = index % columns * ES_SCREEN_BLOCK_COLUMNS, y0 = index / columns * ES_SCREEN_BLOCK_ROWS;
    return (es_screen_block){x0, width - x0 < ES_SCREEN_BLOCK_COLUMNS ? width : x0 + ES_SCREEN_BLOCK_COLUMNS, y0, height - y0 < ES_SCREEN_BLOCK_ROWS ? height : y0 + ES_SCREEN_BLOCK_ROWS};
}
