/* Surfaces at hits: what raster/kernels/resolve.c finds per pixel, for one ray at a time and without mip levels. */
#include "gi/reference/scene.h"

#include <string.h>

#include "gi/blend_lists.h"
#include "platform/context.h"
#include "raster/pack.h"
#include "raster/solid_share.h"

/* ---- textures -------------------------------------------------------------------------------------------------------------------- */

static int32_t wrap_texel(int32_t i, int32_t size, es_wrap wrap)
{
    if (wrap == ES_WRAP_CLAMP) return i < 0 ? 0 : i >= size ? size - 1 : i;
    int32_t period = wrap == ES_WRAP_MIRROR ? 2 * size : size;
    i %= period;
    if (i < 0) i += period;
    return i >= size ? 2 * size - 1 - i : i;
}

static float wrap_coordinate(float u, es_wrap wrap)
{
    if (!(es_absf(u) < 1e9f)) return 0.0f;
    if (wrap == ES_WRAP_REPEAT) return u - es_floor(u);
    if (wrap == ES_WRAP_MIRROR) return u - 2.0f * es_floor(u * 0.5f);
    return es_clampf(u, -1.0f, 2.0f);
}

static void add_texel(const es_texture_image* image, int32_t x, int32_t y, float weight, float rgba[4])
{
    const uint16_t* t = image->texels + ((size_t)image->level_offset[0] + (size_t)y * image->width + (size_t)x) * 4;
    for (int k = 0; k < 4; k++) rgba[k] += (float)t[k] * (weight * (1.0f / 65535.0f));
}

void es_trace_sample_texture(const es_texture_use* use, const float uvs[4], float rgba[4])
{
    const es_texture_image* image = use->image;
    const float* m = use->matrix;
    const float identity[4] = {1, 0, 0, 1};
    if (m[0] == 0.0f && m[1] == 0.0f && m[2] == 0.0f && m[3] == 0.0f) m = identity;
    const float* uv = uvs + (use->uv_set ? 2 : 0);
    float u = wrap_coordinate(m[0] * uv[0] + m[1] * uv[1] + use->offset[0], use->wrap_u), v = wrap_coordinate(m[2] * uv[0] + m[3] * uv[1] + use->offset[1], use->wrap_v);
    int32_t w = (int32_t)image->width, h = (int32_t)image->height;
    bool linear = use->magnify == ES_FILTER_LINEAR;
    float x = u * (float)w - (linear ? 0.5f : 0.0f), y = v * (float)h - (linear ? 0.5f : 0.0f);
    float fx = es_floor(x), fy = es_floor(y), tx = linear ? x - fx : 0.0f, ty = linear ? y - fy : 0.0f;
    int32_t ix = (int32_t)fx, iy = (int32_t)fy;
    int32_t x0 = wrap_texel(ix, w, use->wrap_u), x1 = wrap_texel(ix + 1, w, use->wrap_u), y0 = wrap_texel(iy, h, use->wrap_v), y1 = wrap_texel(iy + 1, h, use->wrap_v);
    memset(rgba, 0, 4 * sizeof *rgba);
    add_texel(image, x0, y0, (1.0f - tx) * (1.0f - ty), rgba);
    add_texel(image, x1, y0, tx * (1.0f - ty), rgba);
    add_texel(image, x0, y1, (1.0f - tx) * ty, rgba);
    add_texel(image, x1, y1, tx * ty, rgba);
}

/* ---- the triangle that was hit ----------------------------------------------------------------------------------------------------- */

typedef struct corner_weights { uint32_t vertex[3]; float weight[3]; } corner_weights;

static corner_weights weights_of(const es_raster_mesh* mesh, uint32_t triangle, float v, float w)
{
    corner_weights c;
    memcpy(c.vertex, mesh->indices + (size_t)triangle * 3, sizeof c.vertex);
    c.weight[0] = 1.0f - v - w;
    c.weight[1] = v;
    c.weight[2] = w;
    return c;
}

static void interpolate(const float* stream, const corner_weights* c, float out[4])
{
    for (int k = 0; k < 4; k++)
        out[k] = c->weight[0] * stream[(size_t)c->vertex[0] * 4 + (size_t)k] + c->weight[1] * stream[(size_t)c->vertex[1] * 4 + (size_t)k] +
                 c->weight[2] * stream[(size_t)c->vertex[2] * 4 + (size_t)k];
}

static es_vec3 by_matrix3(const float* m, es_vec3 v)
{
    return es_v3(m[0] * v.x + m[3] * v.y + m[6] * v.z, m[1] * v.x + m[4] * v.y + m[7] * v.z, m[2] * v.x + m[5] * v.y + m[8] * v.z);
}

static es_vec3 at_corner(const float* stream, uint32_t vertex) { return es_v3(stream[(size_t)vertex * 4], stream[(size_t)vertex * 4 + 1], stream[(size_t)vertex * 4 + 2]); }

static es_vec3 map_normal(const es_raster_instance* instance, const es_material_desc* material, const corner_weights* c, es_vec3 normal, const float texel[4])
{
    const es_raster_mesh* mesh = instance->mesh;
    es_vec3 tangent;
    float handedness;
    if (mesh->tangents) {
        float t[4];
        interpolate(mesh->tangents, c, t);
        tangent = es_mat4_direction(&instance->transform, es_v3(t[0], t[1], t[2]));
        handedness = t[3] < 0.0f ? -1.0f : 1.0f;
        if (es_mat4_determinant3(&instance->transform) < 0.0f) handedness = -handedness;
    } else {
        if (!mesh->uvs) return normal;
        size_t set = material->normal_texture.uv_set ? 2 : 0;
        es_vec3 p[3];
        float u[3], v[3];
        for (int k = 0; k < 3; k++) {
            p[k] = at_corner(mesh->positions, c->vertex[k]);
            u[k] = mesh->uvs[(size_t)c->vertex[k] * 4 + set];
            v[k] = mesh->uvs[(size_t)c->vertex[k] * 4 + set + 1];
        }
        es_vec3 e1 = es_v3_sub(p[1], p[0]), e2 = es_v3_sub(p[2], p[0]);
        float u1 = u[1] - u[0], v1 = v[1] - v[0], u2 = u[2] - u[0], v2 = v[2] - v[0], sign = u1 * v2 - u2 * v1 < 0.0f ? -1.0f : 1.0f;
        tangent = es_mat4_direction(&instance->transform, es_v3_scale(es_v3_sub(es_v3_scale(e1, v2), es_v3_scale(e2, v1)), sign));
        es_vec3 along_v = es_mat4_direction(&instance->transform, es_v3_scale(es_v3_sub(es_v3_scale(e2, u1), es_v3_scale(e1, u2)), sign));
        handedness = es_v3_dot(es_v3_cross(normal, tangent), along_v) > 0.0f ? -1.0f : 1.0f; /* images have v down, normal maps y up */
    }
    tangent = es_v3_normalize(tangent, es_v3(0, 0, 0));
    tangent = es_v3_sub(tangent, es_v3_scale(normal, es_v3_dot(tangent, normal)));
    if (!(es_v3_dot(tangent, tangent) > 1e-8f)) return normal;
    tangent = es_v3_normalize(tangent, normal);
    es_vec3 bitangent = es_v3_scale(es_v3_cross(normal, tangent), handedness);
    float x = (texel[0] * 2.0f - 1.0f) * material->normal_scale, y = (texel[1] * 2.0f - 1.0f) * material->normal_scale, z = texel[2] * 2.0f - 1.0f;
    return es_v3_normalize(es_v3_add(es_v3_add(es_v3_scale(tangent, x), es_v3_scale(bitangent, y)), es_v3_scale(normal, z)), normal);
}

static bool faces(const es_trace_scene* scene, const es_raster_instance* instance, uint32_t primitive, es_vec3 towards, es_vec3* geometric)
{
    es_vec3 c[3];
    es_bvh_triangle(scene->bvh, primitive, c);
    es_vec3 n = es_v3_normalize(es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0])), towards);
    bool winding = es_v3_dot(n, towards) >= 0.0f;
    *geometric = winding ? n : es_v3_scale(n, -1.0f);
    return winding == !(es_mat4_determinant3(&instance->transform) < 0.0f);
}

void es_trace_surface_at(const es_trace_scene* scene, const es_hit* hit, es_vec3 wo, bool quantised, es_trace_surface* s)
{
    const es_bvh_primitive* primitive = &es_bvh_primitives(scene->bvh)[hit->primitive];
    const es_raster_instance* instance = &scene->instances[primitive->instance];
    const es_raster_mesh* mesh = instance->mesh;
    const es_material_desc* m = &scene->materials[instance->material];
    corner_weights c = weights_of(mesh, primitive->triangle, hit->u, hit->v);
    es_vec3 corner[3];
    es_bvh_triangle(scene->bvh, hit->primitive, corner);
    s->primitive = hit->primitive;
    s->position = es_v3_add(es_v3_add(es_v3_scale(corner[0], c.weight[0]), es_v3_scale(corner[1], c.weight[1])), es_v3_scale(corner[2], c.weight[2]));
    bool front = faces(scene, instance, hit->primitive, wo, &s->geometric);
    es_vec3 normal = front ? s->geometric : es_v3_scale(s->geometric, -1.0f); /* of the front */
    if (mesh->normals) {
        float n[4];
        interpolate(mesh->normals, &c, n);
        es_vec3 smooth = by_matrix3(scene->normal_matrices[primitive->instance], es_v3(n[0], n[1], n[2]));
        normal = es_v3_normalize(smooth, normal);
    }
    float color[4] = {1, 1, 1, 1}, uvs[4] = {0, 0, 0, 0}, texel[4];
    if (mesh->colors) interpolate(mesh->colors, &c, color);
    if (mesh->uvs) interpolate(mesh->uvs, &c, uvs);
    const float solid = es_solid_share(m), through = es_transmitted_share(m);
    s->base = es_v3(color[0] * (m->base_color[0] * solid), color[1] * (m->base_color[1] * solid), color[2] * (m->base_color[2] * solid));
    s->tint = through > 0.0f ? es_v3(color[0] * m->base_color[0], color[1] * m->base_color[1], color[2] * m->base_color[2]) : es_v3(0, 0, 0);
    if (m->base_color_texture.image) {
        es_trace_sample_texture(&m->base_color_texture, uvs, texel);
        s->base = es_v3_mul(s->base, es_v3(texel[0], texel[1], texel[2]));
        s->tint = es_v3_mul(s->tint, es_v3(texel[0], texel[1], texel[2]));
    }
    s->tint = es_v3_scale(es_v3(es_clampf(s->tint.x, 0, 1), es_clampf(s->tint.y, 0, 1), es_clampf(s->tint.z, 0, 1)), through);
    s->base = es_v3(es_clampf(s->base.x, 0, 1), es_clampf(s->base.y, 0, 1), es_clampf(s->base.z, 0, 1));
    float metallic = m->metallic, roughness = m->model == ES_SURFACE_PHONG ? m->exponent : m->roughness, specular = m->specular;
    if (m->metallic_roughness_texture.image) {
        es_trace_sample_texture(&m->metallic_roughness_texture, uvs, texel);
        metallic *= texel[2];
        if (m->model != ES_SURFACE_PHONG) roughness *= texel[1];
    }
    if (m->specular_texture.image) {
        es_trace_sample_texture(&m->specular_texture, uvs, texel);
        specular *= texel[3];
    }
    s->emission = es_v3(m->emission[0], m->emission[1], m->emission[2]);
    if (m->emission_texture.image) {
        es_trace_sample_texture(&m->emission_texture, uvs, texel);
        s->emission = es_v3_mul(s->emission, es_v3(texel[0], texel[1], texel[2]));
    }
    if (m->normal_texture.image) {
        es_trace_sample_texture(&m->normal_texture, uvs, texel);
        normal = map_normal(instance, m, &c, normal, texel);
    }
    s->normal = front ? normal : es_v3_scale(normal, -1.0f);
    s->reflects = m->model != ES_SURFACE_UNLIT;
    if (!front && !m->double_sided) s->emission = es_v3(0, 0, 0);
    s->surface = es_surface_of(m->model, s->base, metallic, roughness, specular);
    s->metallic = metallic;
    s->roughness = roughness;
    s->specular = specular;
    if (!quantised) return;
    s->normal = es_unpack_normal(es_pack_normal(s->normal));
    uint32_t rg = es_pack_unorm16(s->base.x) | es_pack_unorm16(s->base.y) << 16, b = es_pack_unorm16(s->base.z);
    uint32_t second = m->model == ES_SURFACE_PHONG ? es_pack_unorm8(roughness * (5.0f / 255.0f)) : es_pack_unorm8(roughness);
    s->surface = es_surface_of_gbuffer(rg, b, es_pack_unorm8(metallic) | second << 8 | es_pack_unorm8(specular) << 16 | (uint32_t)m->model << 24);
    s->emission = es_unpack_rgb9e5(es_pack_rgb9e5(s->emission));
}

/* ---- rays ------------------------------------------------------------------------------------------------------------------------------ */

static const es_material_desc* material_of(const es_trace_scene* scene, const es_hit* hit)
{
    return &scene->materials[scene->instances[es_bvh_primitives(scene->bvh)[hit->primitive].instance].material];
}

static float alpha_at(const es_trace_scene* scene, const es_hit* hit)
{
    const es_bvh_primitive* primitive = &es_bvh_primitives(scene->bvh)[hit->primitive];
    const es_raster_instance* instance = &scene->instances[primitive->instance];
    const es_material_desc* m = &scene->materials[instance->material];
    corner_weights c = weights_of(instance->mesh, primitive->triangle, hit->u, hit->v);
    float alpha = m->base_color[3], color[4], uvs[4] = {0, 0, 0, 0}, texel[4];
    if (instance->mesh->colors) {
        interpolate(instance->mesh->colors, &c, color);
        alpha *= color[3];
    }
    if (instance->mesh->uvs) interpolate(instance->mesh->uvs, &c, uvs);
    if (m->base_color_texture.image) {
        es_trace_sample_texture(&m->base_color_texture, uvs, texel);
        alpha *= texel[3];
    }
    return alpha;
}

bool es_trace_is_hole(const es_trace_scene* scene, const es_hit* hit)
{
    const es_material_desc* m = material_of(scene, hit);
    return (m->alpha_mask || m->blend) && alpha_at(scene, hit) < m->alpha_cutoff;
}

static bool shows_its_back(const es_trace_scene* scene, const es_hit* hit, const es_ray* ray)
{
    const es_raster_instance* instance = &scene->instances[es_bvh_primitives(scene->bvh)[hit->primitive].instance];
    es_vec3 unused;
    return !scene->materials[instance->material].double_sided && !faces(scene, instance, hit->primitive, es_v3(-ray->direction[0], -ray->direction[1], -ray->direction[2]), &unused);
}

static bool lets_through(const es_trace_scene* scene, const es_hit* hit, const es_ray* ray, bool camera)
{
    return (camera && shows_its_back(scene, hit, ray)) || es_trace_is_hole(scene, hit);
}

bool es_trace_closest(const es_trace_scene* scene, es_ray ray, bool camera, es_hit* hit)
{
    es_bvh_closest(scene->bvh, ES_RAYS_SINGLE, &ray, 1, hit);
    while (hit->primitive != ES_NO_PRIMITIVE) {
        if ((!camera && !scene->has_masks) || !lets_through(scene, hit, &ray, camera)) return true;
        const es_hit passed = *hit;
        es_bvh_beyond(scene->bvh, &ray, &passed, hit);
    }
    return false;
}

/* A ray through the edge of two triangles meets both (gi/kernels/trace.c), but there is one surface. */
static bool on_edge(const es_hit* hit) { return es_minf(es_minf(hit->u, hit->v), 1.0f - hit->u - hit->v) < 1e-6f; }
static bool same_surface(const es_trace_scene* scene, const es_hit* a, const es_hit* b)
{
    const es_bvh_primitive* p = es_bvh_primitives(scene->bvh);
    return a->primitive != ES_NO_PRIMITIVE && p[a->primitive].instance == p[b->primitive].instance && on_edge(a) && on_edge(b) && b->t - a->t <= 1e-5f * b->t;
}

bool es_trace_seen(const es_trace_scene* scene, es_ray ray, float u, es_hit* hit)
{
    es_hit layer = {.primitive = ES_NO_PRIMITIVE}; /* the last that was seen through */
    es_bvh_closest(scene->bvh, ES_RAYS_SINGLE, &ray, 1, hit);
    while (hit->primitive != ES_NO_PRIMITIVE) {
        const bool blended = material_of(scene, hit)->blend;
        if (!shows_its_back(scene, hit, &ray) && !(blended && same_surface(scene, &layer, hit))) {
            if (!blended && !es_trace_is_hole(scene, hit)) return true;
            const float alpha = blended ? alpha_at(scene, hit) : 0.0f;
            if (alpha >= ES_BLEND_MOST || (alpha >= ES_BLEND_LEAST && u < alpha)) return true;
            if (alpha >= ES_BLEND_LEAST) {
                u = (u - alpha) / (1.0f - alpha); /* the rest of the interval is the next surface's */
                layer = *hit;
            }
        }
        const es_hit passed = *hit;
        es_bvh_beyond(scene->bvh, &ray, &passed, hit);
    }
    return false;
}

bool es_trace_blocked(const es_trace_scene* scene, es_ray ray)
{
    es_hit hit;
    if (scene->has_masks) return es_trace_closest(scene, ray, false, &hit);
    uint8_t blocked;
    es_bvh_any(scene->bvh, ES_RAYS_SINGLE, &ray, 1, &blocked);
    return blocked;
}

/* ---- taking ------------------------------------------------------------------------------------------------------------------------------ */

static es_result copy_array(es_context* context, const void* from, uint32_t count, size_t size, void** to)
{
    *to = es_allocate_array(context, count, size);
    if (!*to) return es_context_last_result(context);
    if (count) memcpy(*to, from, count * size);
    return ES_OK;
}

static float luminance(const float* c) { return 0.2126f * c[0] + 0.7152f * c[1] + 0.0722f * c[2]; }

static es_result gather_emitters(es_trace_scene* scene)
{
    const es_bvh_primitive* primitives = es_bvh_primitives(scene->bvh);
    uint32_t n = es_bvh_primitive_count(scene->bvh), count = 0;
    for (uint32_t p = 0; p < n; p++) count += luminance(scene->materials[scene->instances[primitives[p].instance].material].emission) > 0.0f;
    scene->emitter_count = count;
    bool all = (scene->emitters = es_allocate_array(scene->context, count, sizeof *scene->emitters)) &&
        (scene->emitter_sums = es_allocate_array(scene->context, count, sizeof *scene->emitter_sums));
    if (!all) return es_context_last_result(scene->context);
    for (int pass = 0; pass < 2; pass++) {
        double sum = 0.0;
        uint32_t at = 0;
        for (uint32_t p = 0; p < n; p++) {
            const es_material_desc* m = &scene->materials[scene->instances[primitives[p].instance].material];
            float strength = luminance(m->emission);
            if (!(strength > 0.0f)) continue;
            es_vec3 c[3];
            es_bvh_triangle(scene->bvh, p, c);
            sum += 0.5 * (double)es_v3_length(es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0]))) * (double)strength;
            scene->emitters[at] = p;
            if (pass && scene->emitter_total > 0.0) scene->emitter_sums[at] = (float)(sum / scene->emitter_total);
            at++;
        }
        scene->emitter_total = sum;
    }
    if (!(scene->emitter_total > 0.0)) {
        es_release(scene->context, scene->emitters, count * sizeof *scene->emitters);
        es_release(scene->context, scene->emitter_sums, count * sizeof *scene->emitter_sums);
        scene->emitters = NULL;
        scene->emitter_sums = NULL;
        scene->emitter_count = 0;
    }
    return ES_OK;
}

/* Running sums of luminance × sine of the polar angle; rows as a whole, and columns within each row. */
static es_result sum_environment(es_trace_scene* scene)
{
    const es_image* image = scene->environment.image;
    if (!image) return ES_OK;
    scene->environment_height = image->height;
    scene->environment_texels = (size_t)image->width * image->height;
    bool all = (scene->environment_rows = es_allocate_array(scene->context, scene->environment_height, sizeof(float))) &&
        (scene->environment_columns = es_allocate_array(scene->context, scene->environment_texels, sizeof(float)));
    if (!all) return es_context_last_result(scene->context);
    double total = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        double rows = 0.0;
        for (uint32_t y = 0; y < image->height; y++) {
            const float* texel = image->pixels + (size_t)y * image->width * image->channels;
            double row = 0.0, sine = (double)es_sin(ES_PI * ((float)y + 0.5f) / (float)image->height), sum = 0.0;
            for (uint32_t x = 0; x < image->width; x++) row += (double)luminance(texel + (size_t)x * image->channels);
            for (uint32_t x = 0; x < image->width && pass; x++) {
                sum += (double)luminance(texel + (size_t)x * image->channels);
                scene->environment_columns[(size_t)y * image->width + x] = row > 0.0 ? (float)(sum / row) : (float)(x + 1) / (float)image->width;
            }
            rows += row * sine;
            if (pass) scene->environment_rows[y] = total > 0.0 ? (float)(rows / total) : (float)(y + 1) / (float)image->height;
        }
        total = rows;
    }
    if (!(total > 0.0)) scene->has_environment = false;
    return ES_OK;
}

es_result es_trace_scene_take(es_trace_scene* scene, es_world* world, bool emission)
{
    es_context* context = es_world_context(world);
    es_bvh* kept = scene->context == context ? scene->bvh : NULL;
    if (kept) scene->bvh = NULL;
    es_trace_scene_free(scene);
    *scene = (es_trace_scene){.context = context, .bvh = kept};
    const es_draw_list* list = es_world_draw_list(world);
    es_result result = kept ? ES_OK : es_bvh_create(context, &scene->bvh);
    if (!result) result = es_bvh_update(scene->bvh, list);
    if (!result) result = copy_array(context, list->instances, list->instance_count, sizeof *list->instances, (void**)&scene->instances);
    if (!result) scene->instance_count = list->instance_count;
    if (!result) result = copy_array(context, list->materials, list->material_count, sizeof *list->materials, (void**)&scene->materials);
    if (!result) scene->material_count = list->material_count;
    size_t light_count;
    const es_light_state* lights = es_world_lights(world, &light_count);
    if (!result) result = copy_array(context, lights, (uint32_t)light_count, sizeof *lights, (void**)&scene->lights);
    if (!result) scene->light_count = (uint32_t)light_count;
    if (!result) {
        scene->normal_matrices = es_allocate_array(context, scene->instance_count, sizeof *scene->normal_matrices);
        if (!scene->normal_matrices) result = es_context_last_result(context);
    }
    if (result) return result;
    for (uint32_t i = 0; i < scene->instance_count; i++) {
        /* scaled to about one first: cofactors of a tiny scene would underflow */
        es_mat4 m = scene->instances[i].transform;
        float largest = 0.0f;
        for (int k = 0; k < 12; k++) largest = k % 4 < 3 ? es_maxf(largest, es_absf(m.m[k])) : largest;
        for (int k = 0; k < 12; k++) m.m[k] = largest > 0.0f ? m.m[k] / largest : 0.0f;
        es_mat4_normal_matrix(&m, scene->normal_matrices[i]);
        if (es_mat4_determinant3(&m) < 0.0f)
            for (int k = 0; k < 9; k++) scene->normal_matrices[i][k] = -scene->normal_matrices[i][k];
        const es_material_desc* material = &scene->materials[scene->instances[i].material];
        scene->has_glass |= es_transmitted_share(material) > 0.0f;
        scene->has_masks |= material->alpha_mask || material->blend;
        scene->has_blended |= material->blend;
    }
    if (!emission) return ES_OK;
    result = gather_emitters(scene);
    scene->has_environment = es_world_get_environment(world, &scene->environment);
    if (!result && scene->has_environment) result = sum_environment(scene);
    return result;
}

void es_trace_scene_free(es_trace_scene* scene)
{
    if (!scene->context) return;
    es_context* context = scene->context;
    es_bvh_destroy(scene->bvh);
    es_release(context, scene->instances, scene->instance_count * sizeof *scene->instances);
    es_release(context, scene->materials, scene->material_count * sizeof *scene->materials);
    es_release(context, scene->normal_matrices, scene->instance_count * sizeof *scene->normal_matrices);
    es_release(context, scene->lights, scene->light_count * sizeof *scene->lights);
    es_release(context, scene->emitters, scene->emitter_count * sizeof *scene->emitters);
    es_release(context, scene->emitter_sums, scene->emitter_count * sizeof *scene->emitter_sums);
    es_release(context, scene->environment_rows, scene->environment_height * sizeof(float));
    es_release(context, scene->environment_columns, scene->environment_texels * sizeof(float));
    *scene = (es_trace_scene){0};
}
