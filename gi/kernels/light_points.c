/* Direct light of leaves (gi/micro/light.h), eight at a time, a few hundred for all lights one after another. Leaves that face away from a light, or
 * are beyond its cone or range, cost no look-up; as they stand in the order of a tree, whole eights do. */
#include "gi/kernel_table.h"
#include "gi/kernels/light_strength_simd.h"
#include "gi/kernels/lobe_albedo_simd.h"
#include "gi/kernels/lobe_shape_simd.h"
#include "gi/kernels/node_lobe_simd.h"
#include "gi/kernels/shadow_map_simd.h"
#include "gi/kernels/surface_simd.h"
#include "raster/pack.h"

enum { STRETCH = 256 };

typedef struct leaf_stretch {
    uint32_t count, vectors;       /* leaves, and eights of them */
    float p[3][STRETCH], n[3][STRETCH], sums[3][STRETCH]; /* radiance times pi */
    int32_t rg[STRETCH], b[STRETCH], word[STRETCH];
    bool apart;                    /* lobes, to `of_lobes`: W/m²; sums of directions and of widths, by the luminance of these */
    float of_lobes[3][STRETCH], axes[3][STRETCH], widths[STRETCH], powers[STRETCH];
} leaf_stretch;

/* Lanes past the end are copies of the first leaf. */
static void take_words(void* to, const void* from, uint32_t count)
{
    uint32_t* words = to;
    memcpy(words, from, count * sizeof *words);
    for (uint32_t i = count; i % VW; i++) words[i] = words[0];
}

static void take_leaves(const es_point_forest* f, size_t leaf, uint32_t count, leaf_stretch* s)
{
    s->count = count;
    s->vectors = (count + VW - 1) / VW;
    int32_t normals[STRETCH];
    take_words(s->p[0], f->x + leaf, count);
    take_words(s->p[1], f->y + leaf, count);
    take_words(s->p[2], f->z + leaf, count);
    take_words(normals, f->normal + leaf, count);
    take_words(s->rg, f->albedo_rg + leaf, count);
    take_words(s->b, f->albedo_b + leaf, count);
    take_words(s->word, f->surface + leaf, count);
    for (uint32_t i = 0; i < s->vectors * VW; i += VW) {
        vf nx, ny, nz;
        es_unpack_normal_v(vi_load(normals + i), &nx, &ny, &nz);
        vf_store(s->n[0] + i, nx);
        vf_store(s->n[1] + i, ny);
        vf_store(s->n[2] + i, nz);
        for (int k = 0; k < 3; k++) vf_store(s->sums[k] + i, vf_zero());
    }
}

static void clear_lobes(leaf_stretch* s)
{
    for (uint32_t i = 0; i < s->vectors * VW; i += VW) {
        for (int k = 0; k < 3; k++) {
            vf_store(s->of_lobes[k] + i, vf_zero());
            vf_store(s->axes[k] + i, vf_zero());
        }
        vf_store(s->widths + i, vf_zero());
        vf_store(s->powers + i, vf_zero());
    }
}

/* `lobe`: of the irradiance e, whose direction is `towards`. */
VINL void add_lobe(const es_lobe_shapes* shapes, const es_surface_v* surface, const vf towards[3], vf cosine, const vf power[3], leaf_stretch* s, uint32_t i)
{
    const vf n[3] = {vf_load(s->n[0] + i), vf_load(s->n[1] + i), vf_load(s->n[2] + i)};
    vf axis[3], width, gain;
    es_lobe_shape_v(shapes, surface, n, towards, cosine, axis, &width, &gain);
    vf sum = vf_zero();
    const float weights[3] = {0.2126f, 0.7152f, 0.0722f};
    for (int k = 0; k < 3; k++) {
        const vf gained = power[k] * gain;
        vf_store(s->of_lobes[k] + i, vf_load(s->of_lobes[k] + i) + gained);
        sum = sum + vf_set1(weights[k]) * gained;
    }
    for (int k = 0; k < 3; k++) vf_store(s->axes[k] + i, vf_load(s->axes[k] + i) + axis[k] * sum);
    vf_store(s->widths + i, vf_load(s->widths + i) + width * sum);
    vf_store(s->powers + i, vf_load(s->powers + i) + sum);
}

/* What a light brought is a lobe of its own only in the sum's spread. */
static void keep_lobes(const leaf_stretch* s, es_point_lobe* lobes)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), half = vf_set1(0.5f);
    for (uint32_t i = 0; i < s->count; i += VW) {
        const vf power = vf_load(s->powers + i);
        const vm any = vm_gt(power, vf_set1(1e-8f)); /* RGB9E5 has nothing below */
        const vf inverse = one / vf_select(any, power, one);
        es_node_lobe_v lobe = {.length = one, .phong = vi_eq(vi_shift_right_logical(vi_load(s->word + i), 24), vi_set1(ES_SURFACE_PHONG))};
        for (int k = 0; k < 3; k++) {
            lobe.light[k] = vf_and(any, vf_load(s->of_lobes[k] + i));
            lobe.axis[k] = vf_select(any, vf_load(s->axes[k] + i) * inverse, zero);
            lobe.normal[k] = vf_load(s->n[k] + i);
        }
        const vf together = vf_min(vf_sqrt(lobe.axis[0] * lobe.axis[0] + lobe.axis[1] * lobe.axis[1] + lobe.axis[2] * lobe.axis[2]), one);
        lobe.width = vf_min(vf_and(any, vf_load(s->widths + i) * inverse + half * (one - together) / vf_max(together, vf_set1(1e-3f))), one);
        vi words[4];
        es_node_lobe_pack_v(&lobe, words);
        const uint32_t lanes = s->count - i < VW ? s->count - i : VW;
        for (uint32_t k = 0; k < lanes; k++) lobes[i + k] = (es_point_lobe){(uint32_t)words[0][k], (uint32_t)words[1][k], (uint32_t)words[2][k], (uint32_t)words[3][k]};
    }
}

static void add_light(const es_point_light_job* job, const es_light_view* view, leaf_stretch* s)
{
    const es_light_strength light = es_light_strength_of(view);
    const es_shadow_lookup lookup = {view, (int)job->shadow_filter, job->shadow_bias, job->shadow_slope_bias};
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const float* radiant = view->light.radiant;
    for (uint32_t i = 0; i < s->vectors * VW; i += VW) {
        const vf p[3] = {vf_load(s->p[0] + i), vf_load(s->p[1] + i), vf_load(s->p[2] + i)};
        vf towards[3], strength;
        es_light_strength_v(&light, p, towards, &strength);
        const vf cosine = vf_load(s->n[0] + i) * towards[0] + vf_load(s->n[1] + i) * towards[1] + vf_load(s->n[2] + i) * towards[2];
        const vi word = vi_load(s->word + i);
        const vm lanes = vm_gt(cosine, zero) & vm_gt(strength, zero) & ~vi_eq(vi_shift_right_logical(word, 24), vi_set1(ES_SURFACE_UNLIT));
        if (!vm_any(lanes)) continue;
        const vf e = vf_and(lanes, strength * es_shadow_share_v(&lookup, lanes, p, towards, cosine) * cosine);
        if (!vm_any(vm_gt(e, zero))) continue;
        const es_surface_v surface = es_surface_of_gbuffer_v(vi_load(s->rg + i), vi_load(s->b + i), word);
        vf reflected[3] = {surface.albedo[0], surface.albedo[1], surface.albedo[2]};
        if (!vm_all(~lanes | es_surface_word_is_diffuse_v(word))) {
            const vf f90 = vf_min(vf_set1(25.0f) * vf_max(surface.specular[0], vf_max(surface.specular[1], surface.specular[2])), one);
            const vf a = one - vf_clamp(cosine, zero, one), a2 = a * a;
            vf through = (one - f90 * (vf_set1(0.04f) + vf_set1(0.96f) * (a2 * a2 * a))) * (one - f90 * vf_set1(0.04f + 0.96f / 21.0f)), lobe[3];
            through = vf_select(vi_eq(surface.model, vi_set1(ES_SURFACE_PHONG)), one, through);
            es_lobe_albedo_v(job->lobes, &surface, cosine, lobe);
            if (s->apart) {
                const vm is = lanes & es_surface_has_lobe_v(&surface);
                if (vm_any(is)) {
                    vf power[3];
                    for (int k = 0; k < 3; k++) {
                        power[k] = vf_and(is, e * vf_set1(radiant[k]) * lobe[k]);
                        lobe[k] = vf_and(~is, lobe[k]);
                    }
                    add_lobe(job->shapes, &surface, towards, cosine, power, s, i);
                }
            }
            for (int k = 0; k < 3; k++) reflected[k] = reflected[k] * through + lobe[k];
        }
        for (int k = 0; k < 3; k++) vf_store(s->sums[k] + i, vf_load(s->sums[k] + i) + e * vf_set1(radiant[k]) * reflected[k]);
    }
}

void ES_KERNEL(es_gi_light_points)(const es_point_light_job* job, const es_point_forest* forest, const es_leaf_range* range)
{
    leaf_stretch s;
    for (uint32_t begin = 0; begin < range->count; begin += STRETCH) {
        const uint32_t count = range->count - begin < STRETCH ? range->count - begin : STRETCH;
        take_leaves(forest, range->leaf + begin, count, &s);
        s.apart = forest->lobes && forest->trees[range->tree].glossy;
        if (s.apart) clear_lobes(&s);
        for (uint32_t v = 0; v < job->view_count; v++) add_light(job, &job->views[v], &s);
        const size_t node = range->node + begin;
        if (s.apart) keep_lobes(&s, forest->lobes + node);
        for (uint32_t i = 0; i < count; i += VW) {
            vf sent[3];
            for (int k = 0; k < 3; k++) sent[k] = vf_load(s.sums[k] + i) * vf_set1(0.318309886f);
            const uint32_t lanes = count - i < VW ? count - i : VW;
            if (job->emission) {
                vi words = vi_zero();
                memcpy(&words, forest->emission + node + i, lanes * sizeof(uint32_t));
                vf glow[3];
                es_unpack_rgb9e5_v(words, &glow[0], &glow[1], &glow[2]);
                for (int k = 0; k < 3; k++) sent[k] = sent[k] + glow[k];
            }
            for (int k = 0; k < 3; k++) memcpy(forest->radiance[k] + node + i, &sent[k], lanes * sizeof(float));
        }
    }
}
