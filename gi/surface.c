/* Directions as the surface model scatters them, and the density with which they come. */
#include "gi/surface.h"

/* Closer to the horizon no direction is drawn: where both directions have such a cosine the lobe is the quotient of two rounding
 * errors. Of a Lambertian surface's light 10^-12 is lost. */
#define HORIZON 1e-6f

static float sum(es_vec3 v) { return v.x + v.y + v.z; }

static float fifth_power(float x) { return x * x * x * x * x; }

static float alpha2_of(const es_surface* s)
{
    float alpha = s->roughness * s->roughness;
    return es_maxf(alpha * alpha, ES_SURFACE_MIN_ALPHA2);
}

/* The probability that the lobe is sampled, from estimates of what each part reflects of a uniform light; -1 when neither does. The
 * lobe's is Fresnel's reflectance at the mirror direction, the grazing rise of which fades as roughness bends half vectors away. */
static float lobe_share(const es_surface* s, float nv)
{
    float lobe = sum(s->specular), diffuse = sum(s->albedo);
    if (s->model != ES_SURFACE_PHONG) {
        float f90 = es_minf(25.0f * es_maxf(s->specular.x, es_maxf(s->specular.y, s->specular.z)), 1.0f), rise = fifth_power(1.0f - nv);
        diffuse = diffuse * (1.0f - f90 * (0.04f + 0.96f * rise));
        float smooth = es_maxf(1.0f - s->roughness * s->roughness, 0.0f);
        lobe = lobe + es_maxf(3.0f * f90 - lobe, 0.0f) * rise * smooth;
    }
    float all = lobe + diffuse;
    return s->model != ES_SURFACE_UNLIT && all > 0.0f ? lobe / all : -1.0f;
}

/* h = (wi + wo) / |wi + wo|; visible normals have the density G1 D (wo·h) / nv, their reflections 1 / (4 wo·h) of it:
 * G1 D / (4 nv) with G1 = 2 nv / (nv + √(alpha² + (1 - alpha²) nv²)). D in the operations of es_surface_parts, so that the weights of
 * samples hold no difference of two roundings. */
static float visible_normal_density(float alpha2, es_vec3 wi, es_vec3 wo, float nl, float nv)
{
    es_vec3 half = es_v3_add(wi, wo);
    float h = es_sqrt(es_maxf(es_v3_dot(half, half), 1e-12f)), nh = es_minf((nl + nv) / h, 1.0f), rest = 1.0f - alpha2;
    float d = 1.0f - nh * nh * rest;
    return alpha2 * 0.159154943f / (d * d * (nv + es_sqrt(alpha2 + rest * nv * nv)));
}

static float density(const es_surface* s, float share, es_vec3 wi, es_vec3 wo, float nl, float nv)
{
    float lobe;
    if (s->model == ES_SURFACE_PHONG) {
        float r = es_minf(es_maxf(2.0f * nl * nv - es_v3_dot(wi, wo), 0.0f), 1.0f);
        lobe = (s->roughness + 1.0f) * 0.159154943f * es_pow(r, s->roughness);
    } else {
        lobe = visible_normal_density(alpha2_of(s), wi, wo, nl, nv);
    }
    return share * lobe + (1.0f - share) * 0.318309886f * nl;
}

static es_vec3 in_frame(es_vec3 t, es_vec3 b, es_vec3 n, float x, float y, float z)
{
    return es_v3_add(es_v3_add(es_v3_scale(t, x), es_v3_scale(b, y)), es_v3_scale(n, z));
}

static es_vec3 sample_cosine(es_vec3 n, float u, float v)
{
    es_vec3 t, b;
    float sine, cosine, r = es_sqrt(u);
    es_orthonormal_basis(n, &t, &b);
    es_sincos(2.0f * ES_PI * v, &sine, &cosine);
    return in_frame(t, b, n, r * cosine, r * sine, es_sqrt(1.0f - u));
}

static es_vec3 sample_power_cosine(es_vec3 axis, float exponent, float u, float v)
{
    es_vec3 t, b;
    float sine, cosine, c = es_minf(es_pow(u, 1.0f / (exponent + 1.0f)), 1.0f), r = es_sqrt((1.0f - c) * (1.0f + c));
    es_orthonormal_basis(axis, &t, &b);
    es_sincos(2.0f * ES_PI * v, &sine, &cosine);
    return in_frame(t, b, axis, r * cosine, r * sine, c);
}

/* Heitz 2018: scaled by alpha the distribution is a hemisphere, whose visible normals are a disc and half a disc seen obliquely. */
static es_vec3 sample_visible_normal(es_vec3 n, es_vec3 wo, float alpha, float u, float v)
{
    es_vec3 t, b;
    es_orthonormal_basis(n, &t, &b);
    es_vec3 eye = es_v3_normalize(es_v3(alpha * es_v3_dot(t, wo), alpha * es_v3_dot(b, wo), es_v3_dot(n, wo)), es_v3(0, 0, 1));
    float across = eye.x * eye.x + eye.y * eye.y, scale = across > 1e-12f ? 1.0f / es_sqrt(across) : 0.0f;
    es_vec3 first = scale > 0.0f ? es_v3(-eye.y * scale, eye.x * scale, 0) : es_v3(1, 0, 0), second = es_v3_cross(eye, first);
    float r = es_sqrt(u), sine, cosine, visible = 0.5f * (1.0f + eye.z);
    es_sincos(2.0f * ES_PI * v, &sine, &cosine);
    float x = r * cosine, y = (1.0f - visible) * es_sqrt(es_maxf(1.0f - x * x, 0.0f)) + visible * r * sine;
    float z = es_sqrt(es_maxf(1.0f - x * x - y * y, 0.0f));
    es_vec3 m = in_frame(first, second, eye, x, y, z);
    return in_frame(t, b, n, alpha * m.x, alpha * m.y, es_maxf(m.z, 0.0f));
}

bool es_surface_sample_direction(const es_surface* s, es_vec3 n, es_vec3 wo, const float u[3], es_surface_sample* sample)
{
    float nv = es_minf(es_v3_dot(n, wo), 1.0f);
    if (!(nv > HORIZON)) return false;
    float share = lobe_share(s, nv);
    if (share < 0.0f) return false;
    es_vec3 wi;
    if (!(u[0] < share)) {
        wi = sample_cosine(n, u[1], u[2]);
    } else if (s->model == ES_SURFACE_PHONG) {
        wi = sample_power_cosine(es_v3_sub(es_v3_scale(n, 2.0f * nv), wo), s->roughness, u[1], u[2]);
    } else {
        es_vec3 h = es_v3_normalize(sample_visible_normal(n, wo, es_sqrt(alpha2_of(s)), u[1], u[2]), n);
        wi = es_v3_sub(es_v3_scale(h, 2.0f * es_v3_dot(wo, h)), wo);
    }
    wi = es_v3_normalize(wi, n);
    float nl = es_minf(es_v3_dot(n, wi), 1.0f);
    if (!(nl > HORIZON)) return false;
    sample->wi = wi;
    sample->density = density(s, share, wi, wo, nl, nv);
    sample->weight = es_v3(0, 0, 0);
    if (!(sample->density > 0.0f)) return false;
    sample->weight = es_v3_scale(es_surface_evaluate(s, n, wi, wo), nl / sample->density);
    return true;
}

float es_surface_density(const es_surface* s, es_vec3 n, es_vec3 wi, es_vec3 wo)
{
    float nl = es_minf(es_v3_dot(n, wi), 1.0f), nv = es_minf(es_v3_dot(n, wo), 1.0f);
    if (!(nl > HORIZON && nv > HORIZON)) return 0.0f;
    float share = lobe_share(s, nv);
    return share < 0.0f ? 0.0f : density(s, share, wi, wo, nl, nv);
}
