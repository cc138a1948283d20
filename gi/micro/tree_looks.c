/* What a tree's leaves reflect and emit, from the instance's material. */
#include "gi/micro/forest_parts.h"
#include "gi/surface.h"
#include "gi/surfels.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "raster/pack.h"

typedef struct reading { es_point_forest* forest; const es_draw_list* list; uint32_t tree; } reading;

/* The same everywhere on the mesh? */
static bool is_plain(const es_raster_mesh* mesh, const es_material_desc* m)
{
    return !mesh->colors && !m->base_color_texture.image && !m->metallic_roughness_texture.image && !m->specular_texture.image && !m->emission_texture.image;
}

static void read_some(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const reading* r = user;
    es_point_forest* f = r->forest;
    const es_point_tree* tree = &f->trees[r->tree];
    const es_raster_instance* instance = &r->list->instances[tree->instance];
    const es_raster_mesh* mesh = instance->mesh;
    const es_material_desc* material = &r->list->materials[instance->material];
    const bool plain = is_plain(mesh, material);
    es_surfel_words words = {0};
    uint32_t albedo = 0, emission = 0;
    for (uint32_t k = begin; k < end; k++) {
        const size_t leaf = tree->first_leaf + k, node = tree->first + tree->leaf_count + k;
        if (k == begin || !plain) {
            words = es_surfel_read(mesh, material, f->triangle[leaf], f->barycentric[leaf]);
            const es_surface surface = es_surface_of_gbuffer(words.albedo_rg, words.albedo_b, words.surface);
            albedo = es_pack_rgb9e5(es_v3(es_minf(surface.albedo.x + surface.specular.x, 1.0f), es_minf(surface.albedo.y + surface.specular.y, 1.0f),
                es_minf(surface.albedo.z + surface.specular.z, 1.0f)));
            emission = words.hole ? 0 : es_pack_rgb9e5(es_surfel_emission(mesh, material, f->triangle[leaf], f->barycentric[leaf]));
        }
        f->albedo_rg[leaf] = words.albedo_rg;
        f->albedo_b[leaf] = words.albedo_b;
        f->surface[leaf] = words.surface;
        f->albedo[node] = albedo;
        f->emission[node] = emission;
        float* along = &f->own->shapes.along[leaf];
        *along = words.hole ? -es_maxf(es_absf(*along), 1e-30f) : es_absf(*along);
    }
}

static bool all_equal(const uint32_t* words, size_t count)
{
    for (size_t i = 1; i < count; i++)
        if (words[i] != words[0]) return false;
    return true;
}

/* Where all leaves look alike, so do all nodes. */
static void note_plain(es_point_forest* forest, uint32_t index)
{
    const es_point_tree* tree = &forest->trees[index];
    uint32_t *albedo = forest->albedo + tree->first, *emission = forest->emission + tree->first;
    const uint32_t leaves = tree->leaf_count;
    forest->own->states[index].plain = all_equal(albedo + leaves, leaves) && all_equal(emission + leaves, leaves);
    if (!forest->own->states[index].plain) return;
    for (uint32_t i = 1; i < leaves; i++) {
        albedo[i] = albedo[leaves];
        emission[i] = emission[leaves];
    }
}

/* Lobes are there for glossy trees and no others. */
static void note_glossy(es_context* context, es_point_forest* forest, uint32_t index)
{
    es_point_tree* tree = &forest->trees[index];
    bool glossy = false;
    for (size_t i = tree->first_leaf; i < tree->first_leaf + tree->leaf_count && !glossy; i++) {
        if (i > tree->first_leaf && forest->surface[i] == forest->surface[i - 1] && forest->albedo_rg[i] == forest->albedo_rg[i - 1] && forest->albedo_b[i] == forest->albedo_b[i - 1]) continue;
        const es_surface surface = es_surface_of_gbuffer(forest->albedo_rg[i], forest->albedo_b[i], forest->surface[i]);
        glossy = es_surface_has_lobe(&surface);
    }
    if (glossy != tree->glossy) es_forest_drop_lobes(context, forest);
    tree->glossy = glossy;
}

void es_forest_read_looks(es_context* context, es_point_forest* forest, const es_draw_list* list, uint32_t tree)
{
    reading r = {forest, list, tree};
    es_parallel_for(context, forest->trees[tree].leaf_count, 1024, read_some, &r);
    note_plain(forest, tree);
    note_glossy(context, forest, tree);
}
