/* The surface model, for one direction at a time; gi/kernels/surface_simd.h has the same operations on eight lanes.
 *
 * f(wi, wo) = albedo / pi · pass + lobe, symmetric in wi and wo.
 *
 * METALLIC_ROUGHNESS (glTF 2.0): albedo = base (1 - metallic), lobe = D V F with alpha = roughness²,
 *     D = alpha² / (pi (NH² (alpha² - 1) + 1)²)                                                 Trowbridge and Reitz, GGX
 *     V = 1/2 / (NL √(NV² (1 - alpha²) + alpha²) + NV √(NL² (1 - alpha²) + alpha²))             Smith, height-correlated
 *     F = F0 + (F90 - F0) (1 - VH)^5                                                            Schlick
 *     F0 = base · metallic + 0.04 · specular (1 - metallic),  F90 = min(1, 25 max F0)
 * F90 is 1 for metals and plain dielectrics and equals `specular` for a dielectric with a lower weight (KHR_materials_specular), so
 * the three numbers of F0 say all there is to know about F, and specular 0 is exactly Lambert.
 *     pass = (1 - Fd(NL)) (1 - Fd(NV)), Fd(c) = F90 (0.04 + 0.96 (1 - c)^5)
 * lets through to the diffuse part what the dielectric interface does not reflect, on the way in and on the way out. glTF's own
 * mix, 1 - Fd(VH), sends back up to 1.6 times the incoming light near grazing angles; this one never more than it received.
 *
 * PHONG: albedo = base, pass = 1, lobe = specular (e + 2) / (2 pi) (R·wo)^e, R being wi mirrored: `specular` is the albedo of
 * the lobe at normal incidence and an upper bound elsewhere. Base and specular are the author's to keep below 1 together.
 */
#ifndef EARTHSHINE_GI_SURFACE_H
#define EARTHSHINE_GI_SURFACE_H

#include "platform/maths.h"
#include "raster/raster.h"

/* alpha² of a mirror: D stays below 5·10^4 and NH² (alpha² - 1) + 1 above the rounding error of its terms */
#define ES_SURFACE_MIN_ALPHA2 6.25e-6f

typedef struct es_surface {
    es_vec3 albedo;      /* of the diffuse part */
    es_vec3 specular;    /* F0 (GGX), albedo of the lobe (Phong) */
    float roughness;     /* GGX roughness; Phong: exponent */
    uint32_t model;      /* es_surface_model; UNLIT reflects nothing */
} es_surface;

static inline es_surface es_surface_of(uint32_t model, es_vec3 base, float metallic, float roughness, float specular)
{
    if (model == ES_SURFACE_PHONG) return (es_surface){base, es_v3(specular, specular, specular), roughness, model};
    if (model == ES_SURFACE_UNLIT) return (es_surface){es_v3(0, 0, 0), es_v3(0, 0, 0), 1.0f, model};
    float dielectric = 0.04f * specular * (1.0f - metallic);
    return (es_surface){es_v3_scale(base, 1.0f - metallic),
        es_v3(base.x * metallic + dielectric, base.y * metallic + dielectric, base.z * metallic + dielectric), roughness, model};
}

/* What G-buffer words say (raster/raster.h). */
static inline es_surface es_surface_of_gbuffer(uint32_t albedo_rg, uint32_t albedo_b, uint32_t word)
{
    const float u16 = 1.0f / 65535.0f, u8 = 1.0f / 255.0f;
    es_vec3 base = es_v3((float)(albedo_rg & 0xffff) * u16, (float)(albedo_rg >> 16) * u16, (float)(albedo_b & 0xffff) * u16);
    uint32_t model = word >> 24;
    float second = (float)(word >> 8 & 0xff);
    return es_surface_of(model, base, (float)(word & 0xff) * u8, model == ES_SURFACE_PHONG ? second * 0.2f : second * u8, (float)(word >> 16 & 0xff) * u8);
}

/* Is the lobe worth evaluating for each of many lights? When its peak, F0 / (4 alpha²) for GGX, reaches a tenth of a white diffuse
 * surface's; below that, leaving it out changes less than the lights' own sampling error. */
static inline bool es_surface_has_lobe(const es_surface* s)
{
    if (s->model == ES_SURFACE_UNLIT) return false;
    float f0 = es_maxf(s->specular.x, es_maxf(s->specular.y, s->specular.z)), alpha = s->roughness * s->roughness;
    return s->model == ES_SURFACE_PHONG ? f0 > 0.0f : f0 > 0.4f * alpha * alpha;
}

/* Reflected by the diffuse part: *pass; by the lobe: *lobe (per steradian, without the cosine). n, wi, wo are unit; both are 0 unless wi
 * and wo are above the surface. */
static inline void es_surface_parts(const es_surface* s, es_vec3 n, es_vec3 wi, es_vec3 wo, float* pass, es_vec3* lobe)
{
    float nl = es_v3_dot(n, wi), nv = es_v3_dot(n, wo), c = es_v3_dot(wi, wo);
    *pass = 0.0f;
    *lobe = es_v3(0, 0, 0);
    if (!(nl > 0.0f && nv > 0.0f)) return;
    nl = es_clampf(nl, 1e-20f, 1.0f);
    nv = es_clampf(nv, 1e-20f, 1.0f);
    if (s->model == ES_SURFACE_PHONG) {
        float r = es_minf(es_maxf(2.0f * nl * nv - c, 0.0f), 1.0f);
        *pass = 1.0f;
        *lobe = es_v3_scale(s->specular, (s->roughness + 2.0f) * 0.159154943f * es_pow(r, s->roughness));
        return;
    }
    float f90 = es_minf(25.0f * es_maxf(s->specular.x, es_maxf(s->specular.y, s->specular.z)), 1.0f);
    float a = 1.0f - nl, b = 1.0f - nv;
    float a2 = a * a, b2 = b * b;
    *pass = (1.0f - f90 * (0.04f + 0.96f * (a2 * a2 * a))) * (1.0f - f90 * (0.04f + 0.96f * (b2 * b2 * b)));
    /* by its components: 2 + 2 wi·wo cancels where both directions graze the surface */
    es_vec3 half = es_v3_add(wi, wo);
    float h = es_sqrt(es_maxf(es_v3_dot(half, half), 1e-12f));
    float nh = es_minf((nl + nv) / h, 1.0f), m = es_maxf(1.0f - 0.5f * h, 0.0f);
    float alpha = s->roughness * s->roughness, alpha2 = es_maxf(alpha * alpha, ES_SURFACE_MIN_ALPHA2), rest = 1.0f - alpha2;
    float d = 1.0f - nh * nh * rest;
    float v = nl * es_sqrt(nv * nv * rest + alpha2) + nv * es_sqrt(nl * nl * rest + alpha2);
    float dv = alpha2 * 0.159154943f / (d * d * v);
    float m2 = m * m, fresnel = m2 * m2 * m;
    lobe->x = dv * (s->specular.x + (f90 - s->specular.x) * fresnel);
    lobe->y = dv * (s->specular.y + (f90 - s->specular.y) * fresnel);
    lobe->z = dv * (s->specular.z + (f90 - s->specular.z) * fresnel);
}

/* f(wi, wo), 1/sr */
static inline es_vec3 es_surface_evaluate(const es_surface* s, es_vec3 n, es_vec3 wi, es_vec3 wo)
{
    float pass;
    es_vec3 lobe;
    es_surface_parts(s, n, wi, wo, &pass, &lobe);
    pass = pass * 0.318309886f;
    return es_v3(s->albedo.x * pass + lobe.x, s->albedo.y * pass + lobe.y, s->albedo.z * pass + lobe.z);
}

/* ---- sampling -------------------------------------------------------------------------------------------------------------------- */

typedef struct es_surface_sample {
    es_vec3 wi;       /* unit */
    es_vec3 weight;   /* f(wi, wo) cos / density */
    float density;    /* of wi, 1/sr, over both parts */
} es_surface_sample;

/* A direction from three numbers in [0, 1): the cosine hemisphere for the diffuse part, visible normals for the GGX lobe (Heitz 2018),
 * the power cosine about the mirror direction for Phong's; the part is chosen by its share of the albedo at wo. False when the surface
 * reflects nothing towards wo or the sample falls below the surface. */
bool es_surface_sample_direction(const es_surface* s, es_vec3 n, es_vec3 wo, const float u[3], es_surface_sample* sample);
/* The density with which the above returns wi, 1/sr; integrates to 1 or less (what falls below the surface is lost). */
float es_surface_density(const es_surface* s, es_vec3 n, es_vec3 wi, es_vec3 wo);

#endif
