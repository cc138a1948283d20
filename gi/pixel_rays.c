#include "gi/pixel_rays.h"

#include "platform/maths.h"

/* The view matrix is rigid: its rows are the eye's right, up and backward axes, and the eye sits at -Rᵀ t. A pixel centre has
 * ndc x = 2 (X + ½) / width - 1 and y = 1 - 2 (Y + ½) / height; per unit of depth the perspective ray moves ndc / P_ii along
 * right and up and 1 forward; the orthographic ray starts at (ndc - P_i3) / P_ii. */
es_pixel_rays es_pixel_rays_of_view(const es_raster_view* view)
{
    const float* v = view->view.m;
    const float* p = view->projection.m;
    es_pixel_rays rays = {.orthographic = p[15] == 1.0f, .near_depth = p[14], .far_depth = 3e38f};
    if (rays.orthographic) { /* depth 1 and 0 of the reversed range */
        rays.near_depth = es_maxf((p[14] - 1.0f) / p[10], 0.0f);
        rays.far_depth = p[14] / p[10];
    }
    float step_x = 2.0f / (float)view->width, step_y = -2.0f / (float)view->height;
    float first_x = 0.5f * step_x - 1.0f, first_y = 1.0f + 0.5f * step_y;
    for (int k = 0; k < 3; k++) {
        float right = v[4 * k], up = v[4 * k + 1], back = v[4 * k + 2];
        float eye = -(v[4 * k] * v[12] + v[4 * k + 1] * v[13] + v[4 * k + 2] * v[14]);
        if (rays.orthographic) {
            rays.base[k] = eye + right * ((first_x - p[12]) / p[0]) + up * ((first_y - p[13]) / p[5]);
            rays.base_dx[k] = right * (step_x / p[0]);
            rays.base_dy[k] = up * (step_y / p[5]);
            rays.dir[k] = -back;
        } else {
            rays.base[k] = eye;
            rays.dir[k] = right * ((first_x + p[8]) / p[0]) + up * ((first_y + p[9]) / p[5]) - back;
            rays.dir_dx[k] = right * (step_x / p[0]);
            rays.dir_dy[k] = up * (step_y / p[5]);
        }
    }
    return rays;
}
