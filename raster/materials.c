/* Materials as the kernels want them: clamped factors, resolved texture transforms, packed words that no texture changes. */
#include "raster/pack.h"
#include "raster/rasterizer.h"
#include "raster/solid_share.h"

es_material_desc es_default_material_desc(void)
{
    return (es_material_desc){.base_color = {1, 1, 1, 1}, .roughness = 1, .specular = 1, .ior = 1.5f, .exponent = 20, .normal_scale = 1, .alpha_cutoff = 0.5f};
}

static float clamp_finite(float a, float low, float high) { return a > low ? (a < high ? a : high) : low; } /* NaN gives low */

static es_prepared_texture prepare_texture(const es_texture_use* use)
{
    es_prepared_texture t = {.uv_set = use->uv_set, .wrap_u = use->wrap_u, .wrap_v = use->wrap_v, .magnify = use->magnify, .minify = use->minify, .mip = use->mip};
    if (use->image && use->image->texels && use->image->level_count) t.image = use->image;
    bool zero = true;
    for (int i = 0; i < 4; i++) {
        t.matrix[i] = use->matrix[i];
        zero &= use->matrix[i] == 0;
    }
    if (zero) t.matrix[0] = t.matrix[3] = 1;
    t.offset[0] = use->offset[0];
    t.offset[1] = use->offset[1];
    return t;
}

static es_prepared_material prepare_material(const es_material_desc* desc)
{
    es_prepared_material m = {0};
    for (int i = 0; i < 4; i++) m.base_color[i] = clamp_finite(desc->base_color[i], 0, 1);
    for (int i = 0; i < 3; i++) m.base_color[i] *= es_solid_share(desc);
    m.metallic = clamp_finite(desc->metallic, 0, 1);
    m.roughness = clamp_finite(desc->roughness, 0, 1);
    m.specular = clamp_finite(desc->specular, 0, 1);
    m.exponent = clamp_finite(desc->exponent, 1, 50);
    for (int i = 0; i < 3; i++) m.emission[i] = clamp_finite(desc->emission[i], 0, 1e30f);
    m.normal_scale = desc->normal_scale;
    m.alpha_cutoff = desc->alpha_cutoff;
    m.alpha_mask = desc->alpha_mask || desc->blend;
    m.double_sided = desc->double_sided;
    m.model = (uint32_t)desc->model;
    uint32_t second = desc->model == ES_SURFACE_PHONG ? (uint32_t)(m.exponent * 5 + 0.5f) : es_pack_unorm8(m.roughness);
    m.surface_word = es_pack_unorm8(m.metallic) | second << 8 | es_pack_unorm8(m.specular) << 16 | m.model << 24;
    m.emission_word = es_pack_rgb9e5((es_vec3){m.emission[0], m.emission[1], m.emission[2]});
    const es_texture_use* uses[ES_TEXTURE_COUNT] = {[ES_TEXTURE_BASE_COLOR] = &desc->base_color_texture,
        [ES_TEXTURE_METALLIC_ROUGHNESS] = &desc->metallic_roughness_texture, [ES_TEXTURE_NORMAL] = &desc->normal_texture,
        [ES_TEXTURE_EMISSION] = &desc->emission_texture, [ES_TEXTURE_SPECULAR] = &desc->specular_texture};
    for (int i = 0; i < ES_TEXTURE_COUNT; i++) {
        m.textures[i] = prepare_texture(uses[i]);
        m.any_texture |= m.textures[i].image != NULL;
    }
    return m;
}

bool es_prepare_materials(es_rasterizer* rasterizer, const es_draw_list* list)
{
    if (!es_grow(rasterizer->context, (void**)&rasterizer->materials, &rasterizer->material_capacity, 0, list->material_count, sizeof *rasterizer->materials)) return false;
    for (uint32_t i = 0; i < list->material_count; i++) rasterizer->materials[i] = prepare_material(&list->materials[i]);
    return true;
}
