#include "gi/light_view.h"

#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/view_content.h"

enum { LIGHT_PLANES = ES_GBUFFER_DEPTH | ES_GBUFFER_NORMAL | ES_GBUFFER_ALBEDO | ES_GBUFFER_SURFACE };

float es_light_cone(const es_light_state* light, es_vec3 towards_point)
{
    if (light->type != ES_LIGHT_SPOT) return 1.0f;
    /* KHR_lights_punctual: linear in the cosine between the cones, squared */
    float cosine = es_v3_dot(towards_point, light->direction);
    float width = es_maxf(light->cos_inner - light->cos_outer, 1e-6f);
    float t = es_clampf((cosine - light->cos_outer) / width, 0.0f, 1.0f);
    return t * t;
}

float es_light_falloff(const es_light_state* light, es_vec3 towards_point, float distance)
{
    float factor = es_light_cone(light, towards_point);
    if (light->type != ES_LIGHT_DIRECTIONAL && light->range > 0.0f) {
        float q = es_minf(distance / light->range, 2.0f), q2 = q * q;
        factor *= es_clampf(1.0f - q2 * q2, 0.0f, 1.0f);
    }
    return factor;
}

static float luminance(const float c[3]) { return 0.2126f * c[0] + 0.7152f * c[1] + 0.0722f * c[2]; }

static es_vec3 any_up(es_vec3 direction) { return es_absf(direction.y) < 0.9f ? es_v3(0, 1, 0) : es_v3(1, 0, 0); }

static void face_views(es_light_view* view, uint32_t size, es_vec3 low, es_vec3 high, bool shadow)
{
    const es_light_state* light = &view->light;
    es_raster_view views[6];
    es_vec3 centre = es_v3_scale(es_v3_add(low, high), 0.5f);
    float radius = es_maxf(0.5f * es_v3_length(es_v3_sub(high, low)), 1e-9f);
    if (view->orthographic) {
        /* one square over the bounding sphere: its size does not change while the light turns, so texels keep theirs */
        es_vec3 eye = es_v3_sub(centre, es_v3_scale(light->direction, radius * 1.01f));
        views[0] = es_orthographic_view(size, size, eye, light->direction, any_up(light->direction), radius, radius, 0.0f, radius * 2.02f);
    } else if (view->face_count == 6) {
        es_cube_views(size, light->position, view->near_plane, views);
    } else {
        float half_angle = es_acos(es_clampf(light->cos_outer, -1.0f, 1.0f));
        /* about two texels of margin on each side; wider filters repeat the map's border there */
        float margin = 1.0f + 4.0f / (float)size;
        float fov = 2.0f * es_clampf(half_angle * margin, 0.01f, 1.5f);
        views[0] = es_perspective_view(size, size, light->position, light->direction, any_up(light->direction), fov, view->near_plane);
    }
    for (uint32_t i = 0; i < view->face_count; i++) {
        /* closed meshes may be single-sided and open ones seen from behind: both block light */
        views[i].cull = ES_CULL_NONE;
        es_light_face* face = &view->faces[i];
        if (shadow) {
            face->shadow_view = views[i];
            face->world_to_clip = es_mat4_mul(views[i].projection, views[i].view);
            float side = view->orthographic ? 1.0f / views[i].projection.m[0] : 1.0f / views[i].projection.m[5];
            view->texel_slope = 2.0f * side / (float)size;
        } else {
            face->gbuffer_view = views[i];
            face->gbuffer_rays = es_pixel_rays_of_view(&views[i]);
        }
    }
}

es_result es_light_view_prepare(es_context* context, es_light_view* view, const es_light_state* light, es_light_view_sizes sizes, es_vec3 low, es_vec3 high)
{
    const uint32_t planes = LIGHT_PLANES | (sizes.ids ? ES_GBUFFER_INSTANCE | ES_GBUFFER_TRIANGLE : 0);
    view->light = *light;
    view->orthographic = light->type == ES_LIGHT_DIRECTIONAL;
    bool cube = light->type == ES_LIGHT_POINT || (light->type == ES_LIGHT_SPOT && light->cos_outer < es_cos(ES_SPOT_VIEW_MAX_ANGLE));
    uint32_t face_count = cube ? 6 : 1;
    float extent = es_v3_length(es_v3_sub(high, low));
    view->near_plane = es_maxf(extent * 1e-3f, 1e-9f);
    for (uint32_t i = 0; i < 6; i++) {
        es_light_face* face = &view->faces[i];
        bool wanted = i < face_count;
        size_t old_bytes = (size_t)face->shadow_view.width * face->shadow_view.width * sizeof(float);
        if (face->shadow_depth && (!wanted || face->shadow_view.width != sizes.shadow_size)) {
            es_release(context, face->shadow_depth, old_bytes);
            face->shadow_depth = NULL;
            face->drawn[ES_LIGHT_SHADOW].pose = 0;
        }
        if (face->gbuffer.memory && (!wanted || !sizes.gbuffers || face->gbuffer.width != sizes.light_size || face->gbuffer.planes != planes)) {
            es_gbuffer_destroy(context, &face->gbuffer);
            face->drawn[ES_LIGHT_GBUFFER].pose = 0;
        }
        if (!wanted) continue;
        if (!face->shadow_depth) {
            face->shadow_depth = es_allocate(context, (size_t)sizes.shadow_size * sizes.shadow_size * sizeof(float));
            if (!face->shadow_depth) return es_context_last_result(context);
            face->shadow_view.width = sizes.shadow_size;
        }
        if (sizes.gbuffers && !face->gbuffer.memory) {
            es_result result = es_gbuffer_create(context, sizes.light_size, sizes.light_size, planes, &face->gbuffer);
            if (result) return result;
        }
    }
    view->face_count = face_count;
    face_views(view, sizes.shadow_size, low, high, true);
    if (sizes.gbuffers) face_views(view, sizes.light_size, low, high, false);

    float strength = luminance(light->radiant);
    if (light->type == ES_LIGHT_POINT) {
        view->power = strength * 4.0f * (float)ES_PI;
    } else if (light->type == ES_LIGHT_SPOT) {
        /* the falloff's edge counts half */
        view->power = strength * 2.0f * (float)ES_PI * (1.0f - 0.5f * (light->cos_inner + light->cos_outer));
    } else {
        view->power = strength * (float)ES_PI * 0.25f * extent * extent;
    }
    view->power = es_minf(view->power, 1e30f); /* shares of lights are quotients of powers */
    return ES_OK;
}

es_result es_light_view_draw(es_rasterizer* rasterizer, const es_draw_list* list, uint64_t materials, bool keep, es_light_view* view, es_light_drawing what, es_light_drawn* drawn)
{
    for (uint32_t i = 0; i < view->face_count; i++) {
        es_light_face* face = &view->faces[i];
        const es_raster_view* seen = what == ES_LIGHT_SHADOW ? &face->shadow_view : &face->gbuffer_view;
        const uint64_t pose = es_hash_bytes(es_view_pose_hash(seen), &materials, sizeof materials) | 1;
        /* a light that moves is drawn whatever it sees: that is looked at once it stays */
        const bool stays = keep && face->drawn[what].pose == pose;
        const uint64_t content = stays ? es_view_content_hash(list, seen) : 0;
        if (stays && face->drawn[what].has_content && face->drawn[what].content == content) continue;
        face->drawn[what].pose = 0;
        es_raster_stats stats = {0};
        es_result result = what == ES_LIGHT_SHADOW ? es_draw_depth(rasterizer, list, seen, face->shadow_depth, seen->width, &stats) : es_draw_gbuffer(rasterizer, list, seen, &face->gbuffer, &stats);
        if (result) return result;
        face->drawn[what].pose = pose;
        face->drawn[what].content = content;
        face->drawn[what].has_content = stays;
        drawn->triangles += stats.triangles;
        drawn->faces++;
    }
    return ES_OK;
}

void es_light_view_free(es_context* context, es_light_view* view)
{
    for (uint32_t i = 0; i < 6; i++) {
        es_light_face* face = &view->faces[i];
        size_t bytes = (size_t)face->shadow_view.width * face->shadow_view.width * sizeof(float);
        if (face->shadow_depth) es_release(context, face->shadow_depth, bytes);
        es_gbuffer_destroy(context, &face->gbuffer);
    }
    *view = (es_light_view){0};
}
