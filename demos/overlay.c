/* Overlays of `play`: where the virtual point lights and the shadow maps' points are; images of the renderer to look at. */
#include "overlay.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static es_vec4 transform(const es_mat4* m, es_vec4 v)
{
    return (es_vec4){m->m[0] * v.x + m->m[4] * v.y + m->m[8] * v.z + m->m[12] * v.w,
        m->m[1] * v.x + m->m[5] * v.y + m->m[9] * v.z + m->m[13] * v.w,
        m->m[2] * v.x + m->m[6] * v.y + m->m[10] * v.z + m->m[14] * v.w,
        m->m[3] * v.x + m->m[7] * v.y + m->m[11] * v.z + m->m[15] * v.w};
}

/* Pixel of a world position; false behind the eye, outside the picture, or behind what is seen there. */
static bool project(
    const demo_canvas* canvas, const es_raster_view* view, const es_image* depth, es_vec3 position, int* x, int* y)
{
    es_vec4 eye = transform(&view->view, (es_vec4){position.x, position.y, position.z, 1});
    es_vec4 clip = transform(&view->projection, eye);
    if (!(clip.w > 1e-6f)) return false;
    float px = (clip.x / clip.w * 0.5f + 0.5f) * (float)canvas->width,
          py = (0.5f - clip.y / clip.w * 0.5f) * (float)canvas->height;
    if (!(px >= 0 && py >= 0 && px < (float)canvas->width && py < (float)canvas->height)) return false;
    *x = (int)px;
    *y = (int)py;
    if (!depth->pixels || depth->width != canvas->width || depth->height != canvas->height) return true;
    float seen = depth->pixels[((size_t)*y * depth->width + (size_t)*x) * depth->channels];
    return !(seen > 0) || -eye.z <= seen * 1.02f + 0.01f; /* points lie on surfaces: a share of slack */
}

static uint32_t pack_colour(float r, float g, float b)
{
    float rgb[3] = {r, g, b};
    uint32_t word = 0;
    for (int c = 0; c < 3; c++) word = word << 8 | (uint32_t)(fminf(fmaxf(rgb[c], 0), 1) * 255 + 0.5f);
    return word;
}

void demo_draw_vpls(demo_canvas* canvas, es_renderer* renderer, const es_raster_view* view, const es_image* depth)
{
    size_t count = es_renderer_vpls(renderer, NULL, 0);
    es_vpl* vpls = count ? malloc(count * sizeof *vpls) : NULL;
    if (!vpls) return;
    size_t held = es_renderer_vpls(renderer, vpls, count);
    if (held < count) count = held;
    for (size_t i = 0; i < count; i++) {
        int x, y;
        if (!project(canvas, view, depth, vpls[i].position, &x, &y)) continue;
        const float* flux = vpls[i].flux;
        float most = fmaxf(fmaxf(flux[0], flux[1]), fmaxf(flux[2], 1e-20f));
        canvas_dot(canvas, x - 3, y - 3, 6, 0);
        canvas_dot(canvas, x - 2, y - 2, 4, pack_colour(flux[0] / most, flux[1] / most, flux[2] / most));
    }
    free(vpls);
}

void demo_draw_points(demo_canvas* canvas, es_renderer* renderer, const es_raster_view* view, const es_image* depth, uint32_t map)
{
    size_t count = es_renderer_points(renderer, map, NULL, 0);
    float* positions = count ? malloc(count * 3 * sizeof *positions) : NULL;
    if (!positions) return;
    size_t held = es_renderer_points(renderer, map, positions, count);
    if (held < count) count = held;
    for (size_t i = 0; i < count; i++) {
        int x, y;
        es_vec3 position = {positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]};
        if (project(canvas, view, depth, position, &x, &y)) canvas_dot(canvas, x, y, 2, 0x40ff90);
    }
    free(positions);
}

static float encode_srgb(float x)
{
    x = fminf(fmaxf(x, 0), 1);
    return x <= 0.0031308f ? 12.92f * x : 1.055f * powf(x, 1 / 2.4f) - 0.055f;
}

static uint32_t scramble(uint32_t x)
{
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

static float largest_finite(const es_image* image)
{
    float largest = 0;
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channels; i++)
        if (isfinite(image->pixels[i]) && fabsf(image->pixels[i]) > largest) largest = fabsf(image->pixels[i]);
    return largest > 0 ? largest : 1;
}

void demo_draw_image(demo_canvas* canvas, const es_image* image, const char* name, float exposure)
{
    bool displayed = !strcmp(name, "display"), normals = strstr(name, "normal") != NULL;
    bool ids = !strcmp(name, "instance") || !strcmp(name, "triangle") || !strcmp(name, "material");
    bool motion = !strcmp(name, "motion");
    /* Shadow maps and their like have a size of their own: they are scaled to fit. */
    float fit = fmaxf((float)image->width / (float)canvas->width, (float)image->height / (float)canvas->height);
    float gain = exp2f(exposure), scale = image->channels == 1 ? 1 / largest_finite(image) : 1;
    for (size_t i = 0; i < (size_t)canvas->width * canvas->height; i++) {
        uint32_t sx = (uint32_t)((float)(i % canvas->width) * fit), sy = (uint32_t)((float)(i / canvas->width) * fit);
        if (sx >= image->width || sy >= image->height) {
            canvas->pixels[i] = 0x202020;
            continue;
        }
        const float* p = image->pixels + ((size_t)sy * image->width + sx) * image->channels;
        float rgb[3] = {p[0], image->channels > 1 ? p[1] : p[0], image->channels > 2 ? p[2] : image->channels > 1 ? 0 : p[0]};
        if (ids && image->channels == 1) {
            uint32_t hash = p[0] > 0 ? scramble((uint32_t)p[0]) : 0;
            canvas->pixels[i] = hash & 0xffffff;
            continue;
        }
        for (int c = 0; c < 3; c++) {
            if (normals)
                rgb[c] = rgb[c] * 0.5f + 0.5f;
            else if (motion) /* pixels a frame: grey is rest, 16 either way */
                rgb[c] = rgb[c] / 32 + 0.5f;
            else if (displayed || image->channels == 1)
                rgb[c] = encode_srgb(fmaxf(rgb[c], 0) * scale);
            else
                rgb[c] = encode_srgb(fmaxf(rgb[c], 0) * gain / (1 + fmaxf(rgb[c], 0) * gain));
        }
        canvas->pixels[i] = pack_colour(rgb[0], rgb[1], rgb[2]);
    }
}
