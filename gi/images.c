/* Named images of the last frame, made on request from the planes the passes left. */
#include <string.h>

#include "gi/bounce_pass.h"
#include "gi/micro_view.h"
#include "gi/renderer.h"
#include "gi/screen/passes.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/settings.h"
#include "raster/pack.h"

typedef enum image_kind {
    IMAGE_DISPLAY, IMAGE_RADIANCE, IMAGE_DIRECT, IMAGE_LAMPS, IMAGE_INDIRECT, IMAGE_BOUNDED, IMAGE_BOUNCE, IMAGE_INDIRECT_UNFILTERED, IMAGE_IRRADIANCE, IMAGE_COMPENSATION, IMAGE_NEGATIVE, IMAGE_RESIDUAL, IMAGE_SCREEN_BOUNCE, IMAGE_REFLECTIONS, IMAGE_ALBEDO, IMAGE_NORMAL, IMAGE_GEOMETRIC_NORMAL, IMAGE_DEPTH,
    IMAGE_MOTION, IMAGE_EMISSION, IMAGE_BACKGROUND, IMAGE_METALLIC, IMAGE_ROUGHNESS, IMAGE_SPECULAR, IMAGE_INSTANCE, IMAGE_MATERIAL, IMAGE_TRIANGLE, IMAGE_SHADOW_MAP, IMAGE_LIGHT_ALBEDO, IMAGE_LIGHT_NORMAL,
    IMAGE_IMPORTANCE, IMAGE_ISM, IMAGE_CONFIDENCE, IMAGE_OCCLUSION, IMAGE_OPACITY, IMAGE_GLARE, IMAGE_GLARE_SPECTRUM, IMAGE_APERTURE, IMAGE_MICRO, IMAGE_MICRO_UNWARPED, IMAGE_MICRO_DISTANCE
} image_kind;

static const struct { image_kind kind; const char *name, *description; } images[] = {
    {IMAGE_DISPLAY, "display", "what the window shows: tone-mapped, linear 0 to 1"},
    {IMAGE_RADIANCE, "radiance", "(emission + direct) + indirect, to the bit without anti-aliasing, W/(m² sr)"},
    {IMAGE_DIRECT, "direct", "reflected direct light, W/(m² sr)"},
    {IMAGE_LAMPS, "lamps", "of the direct light, that of glowing surfaces and of the environment"},
    {IMAGE_INDIRECT, "indirect", "reflected indirect light, W/(m² sr): indirect-bounded and what is added to it, to the bit in the order of this list"},
    {IMAGE_BOUNDED, "indirect-bounded", "of the indirect light, what virtual point lights or micro-buffers send"},
    {IMAGE_BOUNCE, "indirect-1", "of the indirect light, the first bounce; indirect-2 … indirect-16 likewise; their sum is it to the bit, before history"},
    {IMAGE_INDIRECT_UNFILTERED, "indirect-unfiltered", "indirect light with the interleaved pattern still in it"},
    {IMAGE_IRRADIANCE, "irradiance", "indirect irradiance, filtered, W/m²"},
    {IMAGE_CONFIDENCE, "confidence", "in last frame's indirect light, 0 to 1 (Knecht eq. 3.4)"},
    {IMAGE_COMPENSATION, "compensation", "of the indirect light, what traced.bias compensated finds by rays, W/(m² sr), of either sign"},
    {IMAGE_NEGATIVE, "negative", "of the indirect light, what the negative lights of gi second-order take away, W/(m² sr), not above 0"},
    {IMAGE_RESIDUAL, "compensation-1", "of the indirect light, what the first of compensation.steps finds, W/(m² sr); compensation-2 … compensation-4 likewise"},
    {IMAGE_OCCLUSION, "occlusion", "share of the environment's light that lamps screen or ambient find to be kept away, mean over channels, 0 to 1"},
    {IMAGE_SCREEN_BOUNCE, "screen-bounce", "of the indirect light, what screen.bounce finds in screen space, W/(m² sr)"},
    {IMAGE_REFLECTIONS, "reflections", "of the indirect light, what reflecting surfaces see, W/(m² sr): lamps and the environment are in it as well"},
    {IMAGE_ALBEDO, "albedo", "base colour, linear"},
    {IMAGE_NORMAL, "normal", "world shading normal"},
    {IMAGE_GEOMETRIC_NORMAL, "geometric-normal", "world normal of the triangle, turned to the eye"},
    {IMAGE_DEPTH, "depth", "distance along the view axis, metres; 0 where nothing is"},
    {IMAGE_MOTION, "motion", "pixel position now minus last frame's"},
    {IMAGE_EMISSION, "emission", "emitted radiance, the colour of what is unlit and the background, W/(m² sr)"},
    {IMAGE_BACKGROUND, "background", "the environment where nothing is seen, W/(m² sr)"},
    {IMAGE_METALLIC, "metallic", "0 to 1"},
    {IMAGE_ROUGHNESS, "roughness", "0 to 1; Phong surfaces: exponent / 50"},
    {IMAGE_SPECULAR, "specular", "weight of the specular lobe, 0 to 1"},
    {IMAGE_INSTANCE, "instance", "instance id + 1; 0 where nothing is"},
    {IMAGE_MATERIAL, "material", "material index + 1; 0 where nothing is"},
    {IMAGE_TRIANGLE, "triangle", "triangle index in its mesh + 1; 0 where nothing is"},
    {IMAGE_SHADOW_MAP, "shadow-map", "reversed depth of the first light; a cube's faces side by side"},
    {IMAGE_LIGHT_ALBEDO, "light-albedo", "base colour in the first light's G-buffer; a cube's faces side by side"},
    {IMAGE_LIGHT_NORMAL, "light-normal", "normal in the first light's G-buffer"},
    {IMAGE_IMPORTANCE, "importance", "where the first light's virtual point lights go (Knecht eq. 4.3)"},
    {IMAGE_ISM, "ism", "the first 64 shadow maps of the virtual point lights, 0 near, 1 far or empty"},
    {IMAGE_OPACITY, "opacity", "share of what is behind blended surfaces that they hide, 0 to 1; 0 where there are none"},
    {IMAGE_GLARE, "glare", "radiance as the eye sees it that looks at the picture, W/(m² sr); without glare that itself"},
    {IMAGE_GLARE_SPECTRUM, "glare-spectrum", "where light of a pixel goes in that eye, as pixels of the picture; each channel sums to 1"},
    {IMAGE_APERTURE, "aperture", "the plane of that eye's pupil: the share of light that each place lets through, 0 to 1"},
    {IMAGE_MICRO, "micro-buffer", "of the pixel in the middle: its lobe's where it has one"},
    {IMAGE_MICRO_UNWARPED, "micro-buffer-unwarped", "the same laid out over the hemisphere, the normal in the middle"},
    {IMAGE_MICRO_DISTANCE, "micro-buffer-distance", "how far away is what the micro-buffer shows, metres; 0 where nothing is"},
};
enum { IMAGE_COUNT = sizeof images / sizeof images[0] };

size_t es_image_name_count(void) { return IMAGE_COUNT; }
const char* es_image_name(size_t index) { return index < IMAGE_COUNT ? images[index].name : NULL; }
const char* es_image_description(size_t index) { return index < IMAGE_COUNT ? images[index].description : NULL; }

/* n of a name that is the prefix and n, 1 … most; 0: another name. */
static uint32_t number_of(const char* name, const char* prefix, uint32_t most)
{
    const size_t length = strlen(prefix);
    if (strncmp(name, prefix, length) != 0) return 0;
    uint32_t n = 0;
    for (const char* c = name + length; *c; c++) {
        if (*c < '0' || *c > '9' || (!n && *c == '0')) return 0;
        n = 10 * n + (uint32_t)(*c - '0');
        if (n > most) return 0;
    }
    return n;
}
static uint32_t bounce_of(const char* name) { return number_of(name, "indirect-", ES_MAX_BOUNCES); }
static uint32_t step_of(const char* name) { return number_of(name, "compensation-", ES_RESIDUAL_STEPS); }

/* ---- from packed planes --------------------------------------------------------------------------------------------------- */

static void put_normal(const uint32_t* plane, const float* depth, uint32_t stride, es_image* image)
{
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++) {
            size_t at = (size_t)y * stride + x;
            float* out = image->pixels + ((size_t)y * image->width + x) * 3;
            es_vec3 n = depth[at] > 0.0f ? es_unpack_normal(plane[at]) : (es_vec3){0, 0, 0};
            out[0] = n.x;
            out[1] = n.y;
            out[2] = n.z;
        }
}

static void put_albedo(const es_gbuffer* g, uint32_t first_column, es_image* image)
{
    const float unit = 1.0f / 65535.0f;
    for (uint32_t y = 0; y < g->height; y++)
        for (uint32_t x = 0; x < g->width; x++) {
            size_t at = (size_t)y * g->stride + x;
            float* out = image->pixels + ((size_t)y * image->width + first_column + x) * 3;
            out[0] = (float)(g->albedo_rg[at] & 0xffff) * unit;
            out[1] = (float)(g->albedo_rg[at] >> 16) * unit;
            out[2] = (float)(g->albedo_b[at] & 0xffff) * unit;
        }
}

/* How much of what is behind blended layers shows. */
static float transmittance_at(const es_compose_layers* l, uint32_t stride, uint32_t x, uint32_t y)
{
    const bool layered = l->transmittance && x >= l->column_begin && x < l->column_end && y >= l->row_begin && y < l->row_end;
    return layered ? l->transmittance[(size_t)y * stride + x] : 1.0f;
}

static void put_opacity(const es_compose_layers* l, uint32_t stride, es_image* image)
{
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++) image->pixels[(size_t)y * image->width + x] = 1.0f - transmittance_at(l, stride, x, y);
}

/* A summand of the indirect light, as much of it as shows. */
static void put_behind(const float* const planes[3], const es_compose_layers* l, uint32_t stride, es_image* image)
{
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++)
            for (int k = 0; k < 3; k++) image->pixels[((size_t)y * image->width + x) * 3 + k] = planes[k][(size_t)y * stride + x] * transmittance_at(l, stride, x, y);
}

static void put_planes(const float* const planes[3], uint32_t stride, es_image* image)
{
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++)
            for (int k = 0; k < 3; k++) image->pixels[((size_t)y * image->width + x) * 3 + k] = planes[k][(size_t)y * stride + x];
}

static float channel_value(const es_gbuffer* g, image_kind kind, size_t at)
{
    uint32_t surface = g->surface[at];
    bool seen = g->depth[at] > 0.0f;
    switch (kind) {
    case IMAGE_DEPTH: return g->depth[at];
    case IMAGE_METALLIC: return (float)(surface & 0xff) * (1.0f / 255.0f);
    case IMAGE_ROUGHNESS: return (float)(surface >> 8 & 0xff) * (surface >> 24 == ES_SURFACE_PHONG ? 1.0f / 250.0f : 1.0f / 255.0f);
    case IMAGE_SPECULAR: return (float)(surface >> 16 & 0xff) * (1.0f / 255.0f);
    case IMAGE_INSTANCE: return (float)g->instance[at];
    case IMAGE_MATERIAL: return seen ? (float)((g->albedo_b[at] >> 16) + 1) : 0.0f;
    case IMAGE_TRIANGLE: return (float)g->triangle[at];
    default: return 0.0f;
    }
}

static void put_channel(const es_gbuffer* g, image_kind kind, es_image* image)
{
    for (uint32_t y = 0; y < g->height; y++)
        for (uint32_t x = 0; x < g->width; x++) image->pixels[(size_t)y * g->width + x] = channel_value(g, kind, (size_t)y * g->stride + x);
}

/* ---- from the composing kernel, with other outputs --------------------------------------------------------------------------- */

/* Planes at half the resolution, each value over its 2 × 2 pixels. */
static es_result repeat_planes(es_renderer* renderer, const es_planes* half, es_planes* whole)
{
    es_result result = es_planes_resize(renderer->context, whole, &renderer->gbuffer);
    if (result) return result;
    const es_gbuffer* g = &renderer->gbuffer;
    for (int k = 0; k < 3; k++)
        for (uint32_t y = 0; y < g->height; y++)
            for (uint32_t x = 0; x < g->stride; x++)
                whole->at[k][(size_t)y * g->stride + x] = x < g->width ? half->at[k][(size_t)(y / 2) * renderer->half.stride + x / 2] : 0.0f;
    return ES_OK;
}

static es_result put_composed(es_renderer* renderer, image_kind kind, es_image* image)
{
    es_planes planes = {0};
    es_result result = es_planes_resize(renderer->context, &planes, &renderer->gbuffer);
    if (result) return result;
    es_compose_job job = es_renderer_compose_job(renderer);
    es_planes irradiance = {0}, specular = {0};
    if (kind == IMAGE_INDIRECT_UNFILTERED && renderer->plan.valid[ES_PASS_UPSAMPLE]) {
        result = repeat_planes(renderer, &renderer->irradiance, &irradiance);
        if (!result && renderer->has_specular) result = repeat_planes(renderer, &renderer->specular, &specular);
        if (result) {
            es_planes_free(renderer->context, &planes);
            es_planes_free(renderer->context, &irradiance);
            return result;
        }
    } else {
        irradiance = renderer->irradiance;
        specular = renderer->specular;
    }
    if (kind == IMAGE_INDIRECT_UNFILTERED) job.lit = NULL;
    if (kind == IMAGE_LAMPS) {
        memset(job.direct, 0, sizeof job.direct);
        memset(job.layers.direct, 0, sizeof job.layers.direct);
    }
    if (kind == IMAGE_DISPLAY || kind == IMAGE_GLARE) es_glare_compose(renderer, &job);
    if (kind != IMAGE_DISPLAY && kind != IMAGE_RADIANCE && kind != IMAGE_GLARE) memset(job.finished, 0, sizeof job.finished);
    float** target = kind == IMAGE_DISPLAY ? job.display : kind == IMAGE_RADIANCE || kind == IMAGE_GLARE ? job.radiance : kind == IMAGE_DIRECT || kind == IMAGE_LAMPS ? job.whole_direct : kind == IMAGE_EMISSION ? job.emitted : kind == IMAGE_BOUNDED ? job.bounded : job.indirect;
    for (int k = 0; k < 3; k++) {
        target[k] = planes.at[k];
        if (kind == IMAGE_INDIRECT_UNFILTERED) {
            if (job.irradiance[k]) job.irradiance[k] = irradiance.at[k];
            if (job.specular[k]) job.specular[k] = specular.at[k];
        }
    }
    es_compose(renderer->context, &job);
    const float* const from[3] = {planes.at[0], planes.at[1], planes.at[2]};
    put_planes(from, renderer->gbuffer.stride, image);
    es_planes_free(renderer->context, &planes);
    if (irradiance.memory != renderer->irradiance.memory) es_planes_free(renderer->context, &irradiance);
    if (specular.memory != renderer->specular.memory) es_planes_free(renderer->context, &specular);
    return ES_OK;
}

static es_result put_confidence(es_renderer* renderer, es_image* image)
{
    const es_gbuffer* g = renderer->history.job.gbuffer ? renderer->history.job.gbuffer : &renderer->gbuffer;
    const size_t floats = (size_t)g->stride * g->height;
    const uint32_t step = g->width < image->width || g->height < image->height ? 2 : 1; /* at half the resolution */
    float* confidence = es_allocate_array(renderer->context, floats, sizeof *confidence);
    if (!confidence) return es_context_last_result(renderer->context);
    es_result result = es_temporal_confidence(renderer, confidence);
    for (uint32_t y = 0; y < image->height && !result; y++)
        for (uint32_t x = 0; x < image->width; x++) image->pixels[(size_t)y * image->width + x] = confidence[(size_t)(y / step) * g->stride + x / step];
    es_release(renderer->context, confidence, floats * sizeof *confidence);
    return result;
}

/* ---- of the light ---------------------------------------------------------------------------------------------------------------- */

static void put_shadow_map(const es_light_view* view, es_image* image)
{
    uint32_t size = image->height;
    for (uint32_t f = 0; f < view->face_count; f++)
        for (uint32_t y = 0; y < size; y++) memcpy(image->pixels + (size_t)y * image->width + f * size, view->faces[f].shadow_depth + (size_t)y * size, size * sizeof(float));
}

static void put_importance(const es_importance* importance, es_image* image)
{
    uint32_t size = importance->size;
    for (uint32_t f = 0; f < importance->face_count; f++)
        for (uint32_t y = 0; y < size; y++)
            memcpy(image->pixels + (size_t)y * image->width + f * size, importance->sums + f * importance->face_floats + (size_t)y * size, size * sizeof(float));
}

static void put_light_normal(const es_light_view* view, es_image* image)
{
    for (uint32_t f = 0; f < view->face_count; f++) {
        const es_gbuffer* g = &view->faces[f].gbuffer;
        for (uint32_t y = 0; y < g->height; y++)
            for (uint32_t x = 0; x < g->width; x++) {
                size_t at = (size_t)y * g->stride + x;
                float* out = image->pixels + ((size_t)y * image->width + f * g->width + x) * 3;
                es_vec3 n = g->depth[at] > 0.0f ? es_unpack_normal(g->normal[at]) : (es_vec3){0, 0, 0};
                out[0] = n.x;
                out[1] = n.y;
                out[2] = n.z;
            }
    }
}

enum { ISM_COLUMNS = 8 };

static void put_maps(const es_ism_maps* maps, uint32_t shown, es_image* image)
{
    uint32_t size = maps->size;
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) image->pixels[i] = 1.0f;
    for (uint32_t m = 0; m < shown; m++)
        for (uint32_t y = 0; y < size; y++)
            for (uint32_t x = 0; x < size; x++)
                image->pixels[(size_t)(m / ISM_COLUMNS * size + y) * image->width + m % ISM_COLUMNS * size + x] = (float)maps->texels[((size_t)m * size + y) * size + x] * (1.0f / 65535.0f);
}

/* ---- by name ------------------------------------------------------------------------------------------------------------------------ */

static es_result unknown_image(es_renderer* renderer, const char* name)
{
    es_setting table[IMAGE_COUNT];
    memset(table, 0, sizeof table);
    for (int i = 0; i < IMAGE_COUNT; i++) table[i].name = images[i].name;
    const es_setting* tables[] = {table};
    const size_t counts[] = {IMAGE_COUNT};
    return es_fail(renderer->context, ES_IMAGE_UNKNOWN, "there is no image \"%s\"; the nearest is \"%s\"", name, es_settings_nearest(tables, counts, 1, name));
}

es_result es_renderer_image(es_renderer* renderer, const char* name, es_image* image)
{
    es_context* context = renderer->context;
    *image = (es_image){0};
    if (!renderer->complete) return es_misuse(context, ES_WRONG_STATE, "image \"%s\": no frame has been rendered, or the last one failed", name);
    int index = -1;
    for (int i = 0; i < IMAGE_COUNT; i++)
        if (strcmp(images[i].name, name) == 0 || (images[i].kind == IMAGE_BOUNCE && bounce_of(name)) || (images[i].kind == IMAGE_RESIDUAL && step_of(name))) index = i;
    if (index < 0) return unknown_image(renderer, name);
    image_kind kind = images[index].kind;
    if (kind >= IMAGE_MICRO) return es_micro_image(renderer, kind != IMAGE_MICRO_UNWARPED, kind == IMAGE_MICRO_DISTANCE, image);

    const es_gbuffer* g = &renderer->gbuffer;
    const es_light_view* light = renderer->light_count ? &renderer->light_views[0] : NULL;
    uint32_t width = g->width, height = g->height, channels = 3;
    bool has_maps = renderer->plan.valid[ES_PASS_ISM] || renderer->plan.valid[ES_PASS_CLASSIC];
    uint32_t shown_maps = !has_maps ? 0 : renderer->maps.count < 64 ? renderer->maps.count : 64;
    bool of_light = kind == IMAGE_LIGHT_ALBEDO || kind == IMAGE_LIGHT_NORMAL || kind == IMAGE_IMPORTANCE;
    if (kind == IMAGE_SHADOW_MAP && light) {
        width = light->faces[0].shadow_view.width * light->face_count;
        height = light->faces[0].shadow_view.width;
    } else if (of_light && light && light->faces[0].gbuffer.memory) {
        width = light->faces[0].gbuffer.width * light->face_count;
        height = light->faces[0].gbuffer.width;
    } else if (kind == IMAGE_ISM && shown_maps) {
        width = renderer->maps.size * ISM_COLUMNS;
        height = renderer->maps.size * ((shown_maps + ISM_COLUMNS - 1) / ISM_COLUMNS);
    } else if (kind == IMAGE_APERTURE && renderer->glare.aperture.transmittance) {
        width = height = renderer->glare.aperture.size;
    } else if (kind == IMAGE_GLARE_SPECTRUM && renderer->glare.current) {
        width = 2 * renderer->glare.current->reach_x + 1;
        height = 2 * renderer->glare.current->reach_y + 1;
    } else if (of_light || kind == IMAGE_SHADOW_MAP || kind == IMAGE_ISM || kind == IMAGE_APERTURE || kind == IMAGE_GLARE_SPECTRUM) {
        width = height = 8; /* a black image: the frame has no such thing */
        light = NULL;
    }
    bool single = kind == IMAGE_DEPTH || (kind >= IMAGE_METALLIC && kind <= IMAGE_SHADOW_MAP) || kind == IMAGE_IMPORTANCE || kind == IMAGE_ISM || kind == IMAGE_CONFIDENCE || kind == IMAGE_OCCLUSION || kind == IMAGE_OPACITY || kind == IMAGE_APERTURE;
    if (single) channels = 1;
    if (kind == IMAGE_MOTION) channels = 2;
    es_result result = es_image_create(context, width, height, channels, image);
    if (result) return result;
    es_fp_environment environment = es_fp_enter();

    switch (kind) {
    case IMAGE_DISPLAY:
    case IMAGE_RADIANCE:
    case IMAGE_GLARE:
    case IMAGE_EMISSION:
    case IMAGE_DIRECT:
    case IMAGE_LAMPS:
    case IMAGE_BOUNDED:
    case IMAGE_INDIRECT:
    case IMAGE_INDIRECT_UNFILTERED: result = put_composed(renderer, kind, image); break;
    case IMAGE_BOUNCE: result = es_bounce_image(renderer, bounce_of(name), image); break;
    case IMAGE_IRRADIANCE:
    case IMAGE_BACKGROUND:
    case IMAGE_COMPENSATION:
    case IMAGE_NEGATIVE:
    case IMAGE_RESIDUAL:
    case IMAGE_REFLECTIONS:
    case IMAGE_SCREEN_BOUNCE: {
        es_compose_job job = es_renderer_compose_job(renderer);
        const float* const* planes = kind == IMAGE_REFLECTIONS ? job.mirrored : kind == IMAGE_IRRADIANCE ? job.irradiance : kind == IMAGE_BACKGROUND ? job.background : job.further[kind == IMAGE_COMPENSATION ? ES_FURTHER_RAYS : kind == IMAGE_NEGATIVE ? ES_FURTHER_NEGATIVE : kind == IMAGE_RESIDUAL ? ES_FURTHER_RESIDUAL + step_of(name) - 1 : ES_FURTHER_BOUNCE];
        const bool summand = kind != IMAGE_IRRADIANCE && kind != IMAGE_BACKGROUND;
        if (planes[0] && summand) put_behind(planes, &job.layers, g->stride, image);
        else if (planes[0]) put_planes(planes, g->stride, image);
        break;
    }
    case IMAGE_OPACITY: {
        const es_compose_job job = es_renderer_compose_job(renderer);
        put_opacity(&job.layers, g->stride, image);
        break;
    }
    case IMAGE_APERTURE:
        if (renderer->glare.aperture.transmittance) memcpy(image->pixels, renderer->glare.aperture.transmittance, (size_t)width * height * sizeof(float));
        break;
    case IMAGE_GLARE_SPECTRUM:
        if (renderer->glare.current) put_planes((const float* const*)renderer->glare.current->at, (uint32_t)renderer->glare.current->stride, image);
        break;
    case IMAGE_OCCLUSION: es_screen_occlusion_image(renderer, image->pixels); break;
    case IMAGE_CONFIDENCE: result = put_confidence(renderer, image); break;
    case IMAGE_ALBEDO: put_albedo(g, 0, image); break;
    case IMAGE_NORMAL: put_normal(g->normal, g->depth, g->stride, image); break;
    case IMAGE_GEOMETRIC_NORMAL: put_normal(g->geometric_normal, g->depth, g->stride, image); break;
    case IMAGE_MOTION:
        for (uint32_t y = 0; y < height; y++)
            for (uint32_t x = 0; x < width; x++) {
                image->pixels[((size_t)y * width + x) * 2] = g->motion_x[(size_t)y * g->stride + x];
                image->pixels[((size_t)y * width + x) * 2 + 1] = g->motion_y[(size_t)y * g->stride + x];
            }
        break;
    case IMAGE_SHADOW_MAP: if (light) put_shadow_map(light, image); break;
    case IMAGE_LIGHT_ALBEDO:
        for (uint32_t f = 0; light && f < light->face_count; f++) put_albedo(&light->faces[f].gbuffer, f * light->faces[f].gbuffer.width, image);
        break;
    case IMAGE_LIGHT_NORMAL: if (light) put_light_normal(light, image); break;
    case IMAGE_IMPORTANCE: if (light) put_importance(&renderer->importances[0], image); break;
    case IMAGE_ISM: if (shown_maps) put_maps(&renderer->maps, shown_maps, image); break;
    default: put_channel(g, kind, image); break;
    }
    es_fp_leave(environment);
    if (result) es_image_destroy(context, image);
    return result;
}
