/* The last pass: radiance from its parts, tone map, sRGB.
 *
 * Indirect light arrives as irradiance so that the filter before this pass does not blur the albedo; it is multiplied in here:
 * albedo · (1 - metallic) / pi (Lambert). Reinhard is the luminance operator with a white point (Reinhard et al. 2002, eq. 4),
 * PBR Neutral the Khronos tone mapper (specification of 2024). Both are applied to linear Rec.709.
 */
#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "platform/simd.h"
#include "raster/pack.h"

typedef struct rgb_v { vf r, g, b; } rgb_v;

static inline vf luminance(rgb_v c) { return vf_set1(0.2126f) * c.r + vf_set1(0.7152f) * c.g + vf_set1(0.0722f) * c.b; }
static inline rgb_v scaled(rgb_v c, vf s) { return (rgb_v){c.r * s, c.g * s, c.b * s}; }

static inline rgb_v reinhard(rgb_v c, float white)
{
    vf l = luminance(c);
    vf factor = (vf_set1(1.0f) + l * vf_set1(1.0f / (white * white))) / (vf_set1(1.0f) + l);
    return scaled(c, factor);
}

static inline rgb_v pbr_neutral(rgb_v c)
{
    const vf start = vf_set1(0.8f - 0.04f), rest = vf_set1(1.0f - (0.8f - 0.04f));
    vf low = vf_min(c.r, vf_min(c.g, c.b));
    vf small = vf_min(low, vf_set1(0.08f)); /* the square of what is bright leaves the range of floats */
    vf offset = vf_select(vm_lt(low, vf_set1(0.08f)), small - vf_set1(6.25f) * small * small, vf_set1(0.04f));
    c = (rgb_v){c.r - offset, c.g - offset, c.b - offset};
    vf peak = vf_max(c.r, vf_max(c.g, c.b));
    vm compress = vm_ge(peak, start);
    vf safe = vf_select(compress, peak, vf_set1(1.0f));
    vf new_peak = vf_set1(1.0f) - rest * rest / (safe + rest - start);
    vf g = vf_set1(1.0f) / (vf_set1(0.15f) * (safe - new_peak) + vf_set1(1.0f));
    rgb_v s = scaled(c, new_peak / safe);
    vf grey = new_peak * (vf_set1(1.0f) - g);
    return (rgb_v){vf_select(compress, s.r * g + grey, c.r), vf_select(compress, s.g * g + grey, c.g), vf_select(compress, s.b * g + grey, c.b)};
}

static inline vf display_range(vf a) { return vf_min(vf_max(a, vf_zero()), vf_set1(1.0f)); }

/* a in [0, 1]; with a power instead of the table the pass took more than twice as long */
static inline vi srgb8(const es_srgb_table* table, vf a) { return vi_gather(table->code, vi_round(vf_sqrt(a) * vf_set1((float)(ES_SRGB_TABLE_SIZE - 1)))); }

VINL void store_rgb(float* const to[3], size_t at, rgb_v c)
{
    if (!to[0]) return;
    vf_store(to[0] + at, c.r);
    vf_store(to[1] + at, c.g);
    vf_store(to[2] + at, c.b);
}

VINL rgb_v load_rgb(const float* const from[3], size_t at) { return (rgb_v){vf_load(from[0] + at), vf_load(from[1] + at), vf_load(from[2] + at)}; }
VINL rgb_v sum(rgb_v a, rgb_v b) { return (rgb_v){a.r + b.r, a.g + b.g, a.b + b.b}; }

/* Reflected by the diffuse part, `diffuse` being what albedo is multiplied by, and by the lobe, but in `mirrors`. */
VINL rgb_v reflected(const float* const irradiance[3], const float* const specular[3], bool lobes, vm mirrors, rgb_v albedo, vf diffuse, size_t at)
{
    rgb_v c = {vf_zero(), vf_zero(), vf_zero()};
    if (irradiance[0]) c = (rgb_v){albedo.r * diffuse * vf_load(irradiance[0] + at), albedo.g * diffuse * vf_load(irradiance[1] + at), albedo.b * diffuse * vf_load(irradiance[2] + at)};
    if (!lobes) return c;
    const rgb_v lobe = load_rgb(specular, at);
    return sum(c, (rgb_v){vf_and(~mirrors, lobe.r), vf_and(~mirrors, lobe.g), vf_and(~mirrors, lobe.b)});
}

VINL rgb_v behind(rgb_v c, vf transmittance, const float* const layers[3], size_t at)
{
    c = scaled(c, transmittance);
    return layers[0] ? sum(c, load_rgb(layers, at)) : c;
}

/* From its parts; stores those that are wanted. `layered`: behind blended layers. */
VINL rgb_v radiance_at(const es_compose_job* job, uint32_t x, uint32_t y, bool layered)
{
    const es_compose_layers* layers = &job->layers;
    const es_gbuffer* g = job->gbuffer;
    const size_t at = (size_t)y * g->stride + x, chunk = (size_t)y * es_lit_chunks(g->stride) + x / ES_LIT_COLUMNS;
    vi rg = vi_load(g->albedo_rg + at), b = vi_load(g->albedo_b + at), surface = vi_load(g->surface + at);
    rgb_v albedo = {es_unpack_unorm16_v(rg), es_unpack_unorm16_v(vi_shift_right_logical(rg, 16)), es_unpack_unorm16_v(b)};
    rgb_v c;
    es_unpack_rgb9e5_v(vi_load(g->emission + at), &c.r, &c.g, &c.b);
    vm unlit = vi_eq(vi_shift_right_logical(surface, 24), vi_set1(ES_SURFACE_UNLIT)) & vm_gt(vf_load(g->depth + at), vf_zero());
    c = sum(c, (rgb_v){vf_and(unlit, albedo.r), vf_and(unlit, albedo.g), vf_and(unlit, albedo.b)});
    if (job->background[0]) c = sum(c, load_rgb(job->background, at));
    const vf transmittance = layered ? vf_load(layers->transmittance + at) : vf_set1(1.0f);
    if (layered) c = behind(c, transmittance, layers->emitted, at);
    store_rgb(job->emitted, at, c);
    const bool reflects = job->mirrors && (!job->mirrors_any || job->mirrors_any[chunk] & 1);
    const vm mirrors = reflects ? ~vi_eq(vi_load(job->mirrors + at), vi_zero()) : vi_zero();
    const bool lamps = job->lamp_irradiance[0] || job->lamp_specular[0];
    vf diffuse = vf_zero();
    if (job->irradiance[0] || job->lamp_irradiance[0]) diffuse = vf_set1(0.318309886f) * (vf_set1(1.0f) - vf_from_int(surface & vi_set1(0xff)) * vf_set1(1.0f / 255.0f));

    rgb_v direct = {vf_zero(), vf_zero(), vf_zero()}, by_lamps = direct;
    if (job->direct[0]) direct = load_rgb(job->direct, at);
    if (lamps) {
        const rgb_v lit = reflected(job->lamp_irradiance, job->lamp_specular, job->lamp_specular[0] && (!job->lamp_lit || job->lamp_lit[chunk] & 1), mirrors, albedo, diffuse, at);
        by_lamps = (rgb_v){vf_and(~unlit, lit.r), vf_and(~unlit, lit.g), vf_and(~unlit, lit.b)};
    }
    const rgb_v here = lamps ? sum(direct, by_lamps) : direct;
    direct = layered ? sum(behind(direct, transmittance, layers->direct, at), behind(by_lamps, transmittance, layers->lamps, at)) : here;
    store_rgb(job->whole_direct, at, direct);
    c = sum(c, direct);

    rgb_v indirect = reflected(job->irradiance, job->specular, job->specular[0] && (!job->lit || job->lit[chunk] & 1), mirrors, albedo, diffuse, at);
    indirect = (rgb_v){vf_and(~unlit, indirect.r), vf_and(~unlit, indirect.g), vf_and(~unlit, indirect.b)};
    store_rgb(job->reflected, at, sum(here, indirect));
    if (layered) indirect = behind(indirect, transmittance, layers->bounded, at);
    store_rgb(job->bounded, at, indirect);
    for (int i = 0; i < ES_FURTHER_LIGHTS; i++) {
        if (!job->further[i][0]) continue;
        const rgb_v further = load_rgb(job->further[i], at);
        indirect = sum(indirect, layered ? scaled(further, transmittance) : further);
    }
    if (reflects && job->mirrored[0]) {
        const rgb_v mirrored = load_rgb(job->mirrored, at);
        indirect = sum(indirect, layered ? scaled(mirrored, transmittance) : mirrored);
    }
    store_rgb(job->indirect, at, indirect);
    return sum(c, indirect);
}

void ES_KERNEL(es_gi_compose)(const es_compose_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    for (uint32_t y = row_begin; y < row_end; y++) {
        const bool layered_row = job->layers.transmittance && y >= job->layers.row_begin && y < job->layers.row_end;
        for (uint32_t x = 0; x < g->width; x += VW) {
            size_t at = (size_t)y * g->stride + x;
            const bool layered = layered_row && x >= job->layers.column_begin && x < job->layers.column_end;
            rgb_v c = job->finished[0] ? load_rgb(job->finished, at) : layered ? radiance_at(job, x, y, true) : radiance_at(job, x, y, false);
            store_rgb(job->radiance, at, c);
            if (!job->xrgb && !job->display[0]) continue;
            c = scaled(c, vf_set1(job->exposure_scale));
            if (job->tone_map == ES_TONE_MAP_REINHARD) c = reinhard(c, job->white);
            else if (job->tone_map == ES_TONE_MAP_PBR_NEUTRAL) c = pbr_neutral(c);
            c = (rgb_v){display_range(c.r), display_range(c.g), display_range(c.b)};
            store_rgb(job->display, at, c);
            if (job->xrgb) {
                vi word = (srgb8(job->srgb, c.r) << 16) | (srgb8(job->srgb, c.g) << 8) | srgb8(job->srgb, c.b);
                uint32_t* out = job->xrgb + (size_t)y * g->width + x;
                if (x + VW <= g->width) vi_store(out, word);
                else
                    for (uint32_t k = 0; x + k < g->width; k++) out[k] = (uint32_t)word[k];
            }
        }
    }
}
