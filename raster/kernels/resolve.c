/* Depth and record numbers of a tile to the G-buffer's planes: every visible pixel once, eight at a time.
 *
 * Attributes are interpolated with homogeneous edge functions (Olano and Greer 1997, "Triangle Scan Conversion using 2D
 * Homogeneous Coordinates"). With x_i = (window x * w)_i - X w_i relative to the pixel (X, Y), and y_i likewise,
 *
 *   b_0 = x_1 y_2 - x_2 y_1 (cyclic),  S = b_0 + b_1 + b_2,  lambda_i = b_i / S
 *
 * are perspective-correct barycentric coordinates, without clipping even where vertices lie behind the eye, and precise for tiny
 * triangles because everything is relative to the pixel. S is linear in X and Y: with D = sum of b_i w_i, constant over the triangle,
 * 1 / w = S / D, so the gradient of S is the plane's: the geometric normal comes without another fetch (es_resolve_job rows):
 *
 *   n = S_X (row_x - X row_w) + S_Y (row_y - Y row_w) + S row_w,   n · (eye - p) = -D
 *
 * Any attribute a is sum of lambda_i a_i, so a / w = (sum of b_i a_i) / D is linear in X and Y as well. A tile therefore
 *   1. finds its visible triangles, and one pixel of each;
 *   2. sets each up once: planes for 1 / w and attributes / w about that pixel (es_visible_triangle);
 *   3. evaluates the planes per pixel: one 128-byte record a lane instead of three vertices of three streams.
 * Triangles with textures or moving vertices, and all where alpha is wanted ("complex"), are interpolated per pixel from their vertices instead.
 *
 * Visibility is decided on snapped vertices, so a pixel centre can lie outside the unsnapped triangle; where lambda is computed, negative
 * ones become zero, and 1 / w is kept within the vertices' range. Of a sliver not much wider than that distance, the negative part is as
 * large as the rest, and without it the others would say a place far along the triangle: there the nearest point of the triangle is taken.
 */
#include "raster/kernel_table.h"
#include "raster/kernels/texture_sampling.h"
#include "raster/pack.h"
#include "platform/simd.h"

typedef struct v3 { vf x, y, z; } v3;
/* Where eight pixels' results go: pixel `at` of the planes. Lanes of `mask` are written; the others become zero the first time and keep
 * what they have afterwards. */
typedef struct target { const es_gbuffer* planes; size_t at; vm mask; bool first; } target;

VINL void put(const target* t, uint32_t* plane, vi value)
{
    if (t->first) vi_store(plane + t->at, t->mask & value);
    else vi_store(plane + t->at, vi_select(t->mask, value, vi_load(plane + t->at)));
}
VINL void put_float(const target* t, float* plane, vf value) { put(t, (uint32_t*)plane, vi_from_bits(value)); }

VINL vf dot(v3 a, v3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
VINL v3 cross(v3 a, v3 b) { return (v3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
VINL v3 scale(v3 a, vf s) { return (v3){a.x * s, a.y * s, a.z * s}; }
VINL v3 flip(v3 a, vi sign) { return (v3){vf_from_bits(vi_from_bits(a.x) ^ sign), vf_from_bits(vi_from_bits(a.y) ^ sign), vf_from_bits(vi_from_bits(a.z) ^ sign)}; }
VINL v3 select3(vm m, v3 a, v3 b) { return (v3){vf_select(m, a.x, b.x), vf_select(m, a.y, b.y), vf_select(m, a.z, b.z)}; }
/* has a direction: the sum of magnitudes is neither zero, too small or large, nor NaN */
VINL vm directed(v3 a)
{
    vf s = vf_abs(a.x) + vf_abs(a.y) + vf_abs(a.z);
    return vm_gt(s, vf_set1(1e-30f)) & vm_lt(s, vf_set1(1e30f));
}
/* unit; squares of what is directed may leave the range of floats, so the largest component is divided out first */
VINL v3 unit(v3 a)
{
    vf largest = vf_max(vf_max(vf_abs(a.x), vf_abs(a.y)), vf_abs(a.z));
    a = scale(a, vf_set1(1.0f) / vf_select(vm_gt(largest, vf_zero()), largest, vf_set1(1.0f)));
    vf length = vf_sqrt(dot(a, a));
    return scale(a, vf_set1(1.0f) / vf_select(vm_gt(length, vf_zero()), length, vf_set1(1.0f)));
}

/* The interpolation at eight pixels of one instance. */
typedef struct surface8 {
    const es_prepared_instance* instance;
    vm active, back;             /* back: seen from the side where the winding is clockwise */
    vi index[3];
    uint32_t offset[3][VW];      /* of the vertices in a stream, bytes: kept in memory, from where loads take them */
    vi triangle, sign;           /* sign: the sign bit of S */
    vf w[3], z[3], lambda[3];
    vf bx[3], by[3], sum_x, sum_y; /* derivatives of b and S in X and Y */
    vf sum, inverse;             /* 1 / S */
    vf here_w, here_z;           /* at the pixel */
} surface8;

/* Makes loads take the offsets from memory; compilers otherwise move each out of a vector register, at twice the instructions. */
VINL void keep_in_memory(const uint32_t offset[VW]) { __asm__ volatile("" : : "r"(offset) : "memory"); }

VINL void gather_vertex(const void* stream, const uint32_t offset[VW], vf* a, vf* b, vf* c, vf* d)
{
    const char* p = stream;
#if defined(ES_SIMD_256)
#define ES_LOAD_PAIR_(i, j) _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps((const float*)(p + offset[i]))), _mm_loadu_ps((const float*)(p + offset[j])), 1)
    __m256 r0 = ES_LOAD_PAIR_(0, 4), r1 = ES_LOAD_PAIR_(1, 5), r2 = ES_LOAD_PAIR_(2, 6), r3 = ES_LOAD_PAIR_(3, 7);
#undef ES_LOAD_PAIR_
    __m256 t0 = _mm256_unpacklo_ps(r0, r1), t1 = _mm256_unpackhi_ps(r0, r1), t2 = _mm256_unpacklo_ps(r2, r3), t3 = _mm256_unpackhi_ps(r2, r3);
    *a = (vf)_mm256_shuffle_ps(t0, t2, 0x44);
    *b = (vf)_mm256_shuffle_ps(t0, t2, 0xee);
    *c = (vf)_mm256_shuffle_ps(t1, t3, 0x44);
    *d = (vf)_mm256_shuffle_ps(t1, t3, 0xee);
#else
    vf_gather4(p, 1, vi_load(offset), a, b, c, d);
#endif
}

VINL v3 interpolate3(const surface8* s, const float* stream, vf* fourth)
{
    vf a[4], b[4], c[4];
    gather_vertex(stream, s->offset[0], &a[0], &a[1], &a[2], &a[3]);
    gather_vertex(stream, s->offset[1], &b[0], &b[1], &b[2], &b[3]);
    gather_vertex(stream, s->offset[2], &c[0], &c[1], &c[2], &c[3]);
    if (fourth) *fourth = a[3] * s->lambda[0] + b[3] * s->lambda[1] + c[3] * s->lambda[2];
    return (v3){a[0] * s->lambda[0] + b[0] * s->lambda[1] + c[0] * s->lambda[2], a[1] * s->lambda[0] + b[1] * s->lambda[1] + c[1] * s->lambda[2],
        a[2] * s->lambda[0] + b[2] * s->lambda[1] + c[2] * s->lambda[2]};
}

VINL v3 transform3(const float m[9], v3 a)
{
    return (v3){vf_set1(m[0]) * a.x + vf_set1(m[1]) * a.y + vf_set1(m[2]) * a.z, vf_set1(m[3]) * a.x + vf_set1(m[4]) * a.y + vf_set1(m[5]) * a.z,
        vf_set1(m[6]) * a.x + vf_set1(m[7]) * a.y + vf_set1(m[8]) * a.z};
}

/* Texture coordinates of a set with their exact derivatives: d(lambda_i) = (d(b_i) - lambda_i d(S)) / S. */
static es_uv interpolate_uv(const surface8* s, uint32_t set)
{
    es_uv uv = {vf_zero(), vf_zero(), vf_zero(), vf_zero(), vf_zero(), vf_zero()};
    const float* stream = s->instance->mesh->uvs;
    if (!stream) return uv;
    for (int k = 0; k < 3; k++) {
        vf a[4];
        vf_gather4(stream, 16, s->index[k], &a[0], &a[1], &a[2], &a[3]);
        vf u = set ? a[2] : a[0], v = set ? a[3] : a[1];
        vf l = s->lambda[k], lx = (s->bx[k] - l * s->sum_x) * s->inverse, ly = (s->by[k] - l * s->sum_y) * s->inverse;
        uv.u = uv.u + l * u;
        uv.v = uv.v + l * v;
        uv.dudx = uv.dudx + lx * u;
        uv.dvdx = uv.dvdx + lx * v;
        uv.dudy = uv.dudy + ly * u;
        uv.dvdy = uv.dvdy + ly * v;
    }
    return uv;
}

/* The normal map's normal in the frame of `normal` (unit). Tangents come from the mesh; without them from the directions in which
 * u and v grow over the triangle, as the glTF sample viewer does; without texture coordinates the normal stays. */
static v3 map_normal(const surface8* s, v3 normal, const es_rgba* texel)
{
    const es_prepared_instance* instance = s->instance;
    const es_raster_mesh* mesh = instance->mesh;
    v3 tangent;
    vf handedness;
    if (mesh->tangents) {
        tangent = interpolate3(s, mesh->tangents, &handedness);
        const float* m = instance->world;
        tangent = (v3){vf_set1(m[0]) * tangent.x + vf_set1(m[1]) * tangent.y + vf_set1(m[2]) * tangent.z,
            vf_set1(m[4]) * tangent.x + vf_set1(m[5]) * tangent.y + vf_set1(m[6]) * tangent.z,
            vf_set1(m[8]) * tangent.x + vf_set1(m[9]) * tangent.y + vf_set1(m[10]) * tangent.z};
        handedness = vf_copysign(vf_set1(instance->mirrored ? -1.0f : 1.0f), instance->mirrored ? vf_neg(handedness) : handedness);
    } else {
        if (!mesh->uvs) return normal;
        v3 p[3];
        vf u[3], v[3];
        int set = instance->material->textures[ES_TEXTURE_NORMAL].uv_set ? 1 : 0;
        for (int k = 0; k < 3; k++) {
            vf a[4];
            vf_gather4(mesh->positions, 16, s->index[k], &p[k].x, &p[k].y, &p[k].z, &a[3]);
            vf_gather4(mesh->uvs, 16, s->index[k], &a[0], &a[1], &a[2], &a[3]);
            u[k] = set ? a[2] : a[0];
            v[k] = set ? a[3] : a[1];
        }
        v3 e1 = {p[1].x - p[0].x, p[1].y - p[0].y, p[1].z - p[0].z}, e2 = {p[2].x - p[0].x, p[2].y - p[0].y, p[2].z - p[0].z};
        vf u1 = u[1] - u[0], v1 = v[1] - v[0], u2 = u[2] - u[0], v2 = v[2] - v[0];
        vf determinant = u1 * v2 - u2 * v1, sign = vf_copysign(vf_set1(1.0f), determinant);
        v3 along_u = scale((v3){e1.x * v2 - e2.x * v1, e1.y * v2 - e2.y * v1, e1.z * v2 - e2.z * v1}, sign);
        v3 along_v = scale((v3){e2.x * u1 - e1.x * u2, e2.y * u1 - e1.y * u2, e2.z * u1 - e1.z * u2}, sign);
        const float* m = instance->world;
        const float linear[9] = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
        tangent = transform3(linear, along_u);
        along_v = transform3(linear, along_v);
        /* images have v down, normal maps y up: the bitangent is against v */
        handedness = vf_copysign(vf_set1(1.0f), vf_neg(dot(cross(normal, tangent), along_v)));
    }
    tangent = unit(tangent);
    vf along = dot(tangent, normal);
    tangent = (v3){tangent.x - normal.x * along, tangent.y - normal.y * along, tangent.z - normal.z * along};
    vm usable = vm_gt(dot(tangent, tangent), vf_set1(1e-8f)); /* neither zero, NaN, nor along the normal */
    tangent = unit(tangent);
    v3 bitangent = scale(cross(normal, tangent), handedness);
    vf two = vf_set1(2.0f), one = vf_set1(1.0f), strength = vf_set1(instance->material->normal_scale);
    vf tx = (texel->r * two - one) * strength, ty = (texel->g * two - one) * strength, tz = texel->b * two - one;
    v3 mapped = {tangent.x * tx + bitangent.x * ty + normal.x * tz, tangent.y * tx + bitangent.y * ty + normal.y * tz,
        tangent.z * tx + bitangent.z * ty + normal.z * tz};
    return select3(usable & vm_gt(dot(mapped, mapped), vf_set1(1e-8f)), mapped, normal);
}

/* Out of line: five copies of it would take compilers most of a minute where a lane is many instructions. */
static __attribute__((noinline)) void sample(const es_prepared_texture* texture, const es_uv* uv, const vm* active, es_rgba* texel)
{
    *texel = es_sample_texture(texture, uv, *active);
}

/* The planes that textures change. Out of line: most pixels of untextured scenes never come here. */
static __attribute__((noinline)) void resolve_textures(const surface8* s, uint32_t planes, v3* normal, v3 geometric, es_rgba* color, vi* surface, vi* emission)
{
    const es_prepared_material* material = s->instance->material;
    const es_prepared_texture* textures = material->textures;
    es_uv uv[2];
    for (uint32_t set = 0; set < 2; set++) {
        bool used = false;
        for (int i = 0; i < ES_TEXTURE_COUNT; i++) used |= textures[i].image && (textures[i].uv_set != 0) == (set != 0);
        if (used) uv[set] = interpolate_uv(s, set);
    }
#define ES_SAMPLE_(which) sample(&textures[which], &uv[textures[which].uv_set ? 1 : 0], &s->active, &texel)
    es_rgba texel;
    if ((planes & ES_GBUFFER_NORMAL) && textures[ES_TEXTURE_NORMAL].image) {
        ES_SAMPLE_(ES_TEXTURE_NORMAL);
        v3 n = select3(directed(*normal), *normal, geometric);
        *normal = map_normal(s, unit(n), &texel);
    }
    if ((planes & (ES_GBUFFER_ALBEDO | ES_GBUFFER_ALPHA)) && textures[ES_TEXTURE_BASE_COLOR].image) {
        ES_SAMPLE_(ES_TEXTURE_BASE_COLOR);
        color->a = color->a * texel.a;
        color->r = color->r * texel.r;
        color->g = color->g * texel.g;
        color->b = color->b * texel.b;
    }
    if ((planes & ES_GBUFFER_SURFACE) && (textures[ES_TEXTURE_METALLIC_ROUGHNESS].image || textures[ES_TEXTURE_SPECULAR].image)) {
        vf metallic = vf_set1(material->metallic), roughness = vf_set1(material->roughness), specular = vf_set1(material->specular);
        if (textures[ES_TEXTURE_METALLIC_ROUGHNESS].image) {
            ES_SAMPLE_(ES_TEXTURE_METALLIC_ROUGHNESS);
            roughness = roughness * texel.g;
            metallic = metallic * texel.b;
        }
        if (textures[ES_TEXTURE_SPECULAR].image) {
            ES_SAMPLE_(ES_TEXTURE_SPECULAR);
            specular = specular * texel.a;
        }
        vi second = material->model == ES_SURFACE_PHONG ? vi_set1((int32_t)(material->surface_word >> 8 & 0xff)) : es_pack_unorm8_v(roughness);
        *surface = es_pack_unorm8_v(metallic) | (second << 8) | (es_pack_unorm8_v(specular) << 16) | vi_set1((int32_t)(material->model << 24));
    }
    if ((planes & ES_GBUFFER_EMISSION) && textures[ES_TEXTURE_EMISSION].image) {
        ES_SAMPLE_(ES_TEXTURE_EMISSION);
        *emission = es_pack_rgb9e5_v(vf_set1(material->emission[0]) * texel.r, vf_set1(material->emission[1]) * texel.g, vf_set1(material->emission[2]) * texel.b);
    }
#undef ES_SAMPLE_
}

/* Barycentric coordinates, perspective-correct, of the point of the triangle's border nearest to the pixel; x, y: window coordinates
 * times w relative to the pixel, w > 0. */
VINL void nearest_on_border(const vf x[3], const vf y[3], const vf w[3], vf lambda[3])
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    vf px[3], py[3], best = vf_set1(3e38f);
    for (int k = 0; k < 3; k++) {
        vf inverse = one / w[k];
        px[k] = x[k] * inverse;
        py[k] = y[k] * inverse;
    }
    for (int k = 0; k < 3; k++) {
        int i = k < 2 ? k + 1 : 0, j = i < 2 ? i + 1 : 0; /* the edge across from k */
        vf ex = px[j] - px[i], ey = py[j] - py[i], length2 = ex * ex + ey * ey;
        vf t = vf_clamp(vf_neg(px[i] * ex + py[i] * ey) / vf_select(vm_gt(length2, zero), length2, one), zero, one);
        vf qx = px[i] + t * ex, qy = py[i] + t * ey, d2 = qx * qx + qy * qy;
        vm nearer = vm_lt(d2, best);
        /* 1 - t and t, each over its vertex's w */
        vf a = (one - t) * w[j], b = t * w[i], inverse = one / (a + b);
        best = vf_select(nearer, d2, best);
        lambda[k] = vf_select(nearer, zero, lambda[k]);
        lambda[i] = vf_select(nearer, a * inverse, lambda[i]);
        lambda[j] = vf_select(nearer, b * inverse, lambda[j]);
    }
}

/* Edge functions at the pixel (x, y) and what follows from them. */
VINL void start_surface(const es_resolve_job* job, const es_prepared_instance* instance, vm active, vi id, vf x, vf y, bool gradients, surface8* s)
{
    s->instance = instance;
    s->active = active;
    s->triangle = active & (id - vi_set1((int32_t)instance->first_id));
    vi unused;
    vi_gather4(instance->mesh->indices, 12, s->triangle, &s->index[0], &s->index[1], &s->index[2], &unused);

    vf xr[3], yr[3], b[3];
    for (int k = 0; k < 3; k++) {
        vi_store(s->offset[k], s->index[k] << 4);
        keep_in_memory(s->offset[k]);
        gather_vertex(job->vertices + instance->first_vertex, s->offset[k], &xr[k], &yr[k], &s->z[k], &s->w[k]);
        xr[k] = xr[k] - x * s->w[k];
        yr[k] = yr[k] - y * s->w[k];
    }
    b[0] = xr[1] * yr[2] - xr[2] * yr[1];
    b[1] = xr[2] * yr[0] - xr[0] * yr[2];
    b[2] = xr[0] * yr[1] - xr[1] * yr[0];
    vf sum = b[0] + b[1] + b[2], zero = vf_zero(), one = vf_set1(1.0f);
    vi sign = vi_from_bits(sum) & vi_set1(INT32_MIN);
    vf c0 = vf_max(vf_from_bits(vi_from_bits(b[0]) ^ sign), zero), c1 = vf_max(vf_from_bits(vi_from_bits(b[1]) ^ sign), zero);
    vf c2 = vf_max(vf_from_bits(vi_from_bits(b[2]) ^ sign), zero);
    vf total = c0 + c1 + c2;
    vm solid = vm_gt(total, zero);
    vf inverse = one / vf_select(solid, total, one);
    s->sum = sum;
    s->sign = sign;
    s->lambda[0] = vf_select(solid, c0 * inverse, one);
    s->lambda[1] = c1 * inverse;
    s->lambda[2] = c2 * inverse;
    vm sliver = active & vm_gt(total, vf_abs(sum) * vf_set1(1.0f + 0x1p-10f)) & vm_gt(vf_min(s->w[0], vf_min(s->w[1], s->w[2])), zero);
    if (vm_any(sliver)) {
        vf wide[3], xs[3], ys[3], nearest[3] = {one, zero, zero};
        for (int k = 0; k < 3; k++) {
            wide[k] = vf_select(sliver, s->w[k], one);
            xs[k] = vf_and(sliver, xr[k]);
            ys[k] = vf_and(sliver, yr[k]);
        }
        nearest_on_border(xs, ys, wide, nearest);
        for (int k = 0; k < 3; k++) s->lambda[k] = vf_select(sliver, nearest[k], s->lambda[k]);
        /* S at that point is D / w, not what is left of it at the pixel */
        vf d = vf_abs(b[0] * s->w[0] + b[1] * s->w[1] + b[2] * s->w[2]), w = s->lambda[0] * s->w[0] + s->lambda[1] * s->w[1] + s->lambda[2] * s->w[2];
        vm flat = sliver & vm_gt(d, w * vf_set1(1e-20f));
        inverse = vf_select(flat, vf_select(flat, w, one) / vf_select(flat, d, one), inverse);
    }
    s->inverse = vf_from_bits(vi_from_bits(inverse) | sign);
    /* window y is down: counter-clockwise triangles have negative S */
    if (instance->cull_positive == instance->cull_negative)
        s->back = vm_lt(vf_from_bits(sign | vi_set1(0x3f800000)), zero) ^ (instance->mirrored ? vi_zero() : vm_all_lanes());
    else /* one side is culled by the snapped area, which decides even where S rounds to the other sign */
        s->back = instance->cull_positive == instance->mirrored ? vm_all_lanes() : vi_zero();
    s->here_w = s->lambda[0] * s->w[0] + s->lambda[1] * s->w[1] + s->lambda[2] * s->w[2];
    s->here_z = s->lambda[0] * s->z[0] + s->lambda[1] * s->z[1] + s->lambda[2] * s->z[2];
    if (!gradients) return;
    for (int k = 0; k < 3; k++) {
        int i = k < 2 ? k + 1 : 0, j = i < 2 ? i + 1 : 0;
        s->bx[k] = s->w[j] * yr[i] - s->w[i] * yr[j];
        s->by[k] = s->w[i] * xr[j] - s->w[j] * xr[i];
    }
    s->sum_x = s->bx[0] + s->bx[1] + s->bx[2];
    s->sum_y = s->by[0] + s->by[1] + s->by[2];
}

/* Turned to the eye, any length. */
VINL v3 geometric_normal(const es_resolve_job* job, const surface8* s, vf x, vf y)
{
    v3 n;
    if (job->orthographic) {
        /* the plane of z over the window, times S; row_z points to the eye */
        vf zx = s->bx[0] * s->z[0] + s->bx[1] * s->z[1] + s->bx[2] * s->z[2], zy = s->by[0] * s->z[0] + s->by[1] * s->z[1] + s->by[2] * s->z[2];
        n = (v3){s->sum * vf_set1(job->row_z[0]) - zx * vf_set1(job->row_x[0]) - zy * vf_set1(job->row_y[0]),
            s->sum * vf_set1(job->row_z[1]) - zx * vf_set1(job->row_x[1]) - zy * vf_set1(job->row_y[1]),
            s->sum * vf_set1(job->row_z[2]) - zx * vf_set1(job->row_x[2]) - zy * vf_set1(job->row_y[2])};
    } else {
        vf along = s->sum_x * x + s->sum_y * y - s->sum;
        n = (v3){along * vf_set1(job->row_w[0]) - s->sum_x * vf_set1(job->row_x[0]) - s->sum_y * vf_set1(job->row_y[0]),
            along * vf_set1(job->row_w[1]) - s->sum_x * vf_set1(job->row_x[1]) - s->sum_y * vf_set1(job->row_y[1]),
            along * vf_set1(job->row_w[2]) - s->sum_x * vf_set1(job->row_x[2]) - s->sum_y * vf_set1(job->row_y[2])};
    }
    n = flip(n, s->sign);
    vf toward = job->orthographic ? vf_set1(1.0f) : vf_set1(-1.0f);
    const float* eye = job->orthographic ? job->row_z : job->row_w;
    v3 fallback = {vf_set1(eye[0]) * toward, vf_set1(eye[1]) * toward, vf_set1(eye[2]) * toward};
    return select3(directed(n), n, fallback);
}

VINL vf distance_of(const es_resolve_job* job, const surface8* s)
{
    vf distance = job->orthographic ? vf_set1(job->distance_offset) + vf_set1(job->distance_scale) * s->here_z : s->here_w;
    return vf_max(distance, vf_set1(1e-30f)); /* zero would say that nothing is seen */
}

/* From the change (dx, dy, dw) of the homogeneous window position since last frame, so that what stands still has motion zero
 * exactly: X - (X w + dx) / (w + dw) = (X dw - dx) / (w + dw). */
VINL void motion_of(vf x, vf y, vf w, vf dx, vf dy, vf dw, vf* motion_x, vf* motion_y)
{
    vf then = w + dw, away = vf_set1(ES_MOTION_BEHIND);
    vm before = vm_gt(then, vf_zero());
    vf inverse = vf_set1(1.0f) / vf_select(before, then, vf_set1(1.0f));
    *motion_x = vf_select(before, vf_clamp((x * dw - dx) * inverse, vf_neg(away), away), away);
    *motion_y = vf_select(before, vf_clamp((y * dw - dy) * inverse, vf_neg(away), away), away);
}
VINL void rigid_motion(const es_prepared_instance* instance, vf x, vf y, vf z, vf w, vf* motion_x, vf* motion_y)
{
    const float* m = instance->motion;
    vf xw = x * w, yw = y * w;
    vf dx = vf_set1(m[0]) * xw + vf_set1(m[1]) * yw + vf_set1(m[2]) * z + vf_set1(m[3]) * w;
    vf dy = vf_set1(m[4]) * xw + vf_set1(m[5]) * yw + vf_set1(m[6]) * z + vf_set1(m[7]) * w;
    vf dw = vf_set1(m[8]) * xw + vf_set1(m[9]) * yw + vf_set1(m[10]) * z + vf_set1(m[11]) * w;
    motion_of(x, y, w, dx, dy, dw, motion_x, motion_y);
}

/* ---- complex triangles: pixel by pixel ----------------------------------------------------------------------------------- */

static void resolve_complex(const es_resolve_job* job, const es_prepared_instance* instance, const target* t, vi id, vf x, vf y)
{
    const es_raster_mesh* mesh = instance->mesh;
    const es_prepared_material* material = instance->material;
    const es_gbuffer* g = &job->gbuffer;
    const uint32_t planes = g->planes;
    surface8 s;
    start_surface(job, instance, t->mask, id, x, y, true, &s);
    if (planes & ES_GBUFFER_TRIANGLE) put(t, g->triangle, s.triangle + vi_set1(1));
    if (planes & ES_GBUFFER_INSTANCE) put(t, g->instance, vi_set1((int32_t)(instance->instance_id + 1)));
    if (planes & ES_GBUFFER_DEPTH) put_float(t, g->depth, distance_of(job, &s));
    v3 geometric = geometric_normal(job, &s, x, y);
    if (planes & ES_GBUFFER_GEOMETRIC_NORMAL) put(t, g->geometric_normal, es_pack_normal_v(geometric.x, geometric.y, geometric.z));

    vi backward = s.back & vi_set1(INT32_MIN);
    v3 normal;
    if (mesh->normals) normal = transform3(instance->normal_matrix, interpolate3(&s, mesh->normals, NULL));
    else normal = flip(geometric, backward); /* geometric normals point to the eye, the frame of a normal map to the front */

    es_rgba color = {vf_set1(material->base_color[0]), vf_set1(material->base_color[1]), vf_set1(material->base_color[2]), vf_set1(material->base_color[3])};
    if ((planes & (ES_GBUFFER_ALBEDO | ES_GBUFFER_ALPHA)) && mesh->colors) {
        vf a;
        v3 c = interpolate3(&s, mesh->colors, &a);
        color.a = color.a * a;
        color.r = color.r * c.x;
        color.g = color.g * c.y;
        color.b = color.b * c.z;
    }
    vi surface = vi_set1((int32_t)material->surface_word), emission = vi_set1((int32_t)material->emission_word);
    if (material->any_texture) resolve_textures(&s, planes, &normal, geometric, &color, &surface, &emission);
    if (planes & ES_GBUFFER_SURFACE) put(t, g->surface, surface);
    if (planes & ES_GBUFFER_EMISSION) put(t, g->emission, emission);
    if (planes & ES_GBUFFER_NORMAL) {
        normal = flip(normal, backward);
        normal = select3(directed(normal), normal, geometric);
        put(t, g->normal, es_pack_normal_v(normal.x, normal.y, normal.z));
    }
    if (planes & ES_GBUFFER_ALBEDO) {
        put(t, g->albedo_rg, es_pack_unorm16_v(color.r) | (es_pack_unorm16_v(color.g) << 16));
        put(t, g->albedo_b, es_pack_unorm16_v(color.b) | vi_set1((int32_t)(instance->material_index << 16)));
    }
    if (planes & ES_GBUFFER_ALPHA) put_float(t, g->alpha, vf_and(vm_gt(color.a, vf_zero()), vf_min(color.a, vf_set1(1.0f)))); /* what is not a number is 0 */
    if (!(planes & ES_GBUFFER_MOTION)) return;
    vf motion_x = vf_zero(), motion_y = vf_zero();
    if (instance->has_deltas) {
        vf dw;
        v3 d = interpolate3(&s, &job->deltas[instance->first_delta].xw, &dw);
        motion_of(x, y, s.here_w, d.x, d.y, dw, &motion_x, &motion_y);
    } else if (instance->moving) {
        rigid_motion(instance, x, y, s.here_z, s.here_w, &motion_x, &motion_y);
    }
    put_float(t, g->motion_x, motion_x);
    put_float(t, g->motion_y, motion_y);
}

/* ---- the others: planes, once per triangle and tile ---------------------------------------------------------------------- */

/* words[i] of lane l goes to float i of record l */
VINL void store_visible(es_visible_triangle* records, vm mask, const vf words[32])
{
    for (int group = 0; group < 8; group++) {
        float quads[4 * VW];
        vf_store4(quads, words[4 * group], words[4 * group + 1], words[4 * group + 2], words[4 * group + 3]);
        for (uint32_t bits = vm_bits(mask); bits; bits &= bits - 1) {
            uint32_t lane = (uint32_t)__builtin_ctz(bits);
            memcpy((char*)&records[lane] + 16 * group, &quads[4 * lane], 16);
        }
    }
}

typedef struct plane8 { vf x, y, c; } plane8;

/* of an attribute with the values a, b, c at the vertices */
VINL plane8 plane_of(const surface8* s, vf a, vf b, vf c, vf inverse_d, vf inverse_w)
{
    return (plane8){(s->bx[0] * a + s->bx[1] * b + s->bx[2] * c) * inverse_d, (s->by[0] * a + s->by[1] * b + s->by[2] * c) * inverse_d,
        (s->lambda[0] * a + s->lambda[1] * b + s->lambda[2] * c) * inverse_w};
}

VINL void gather_corners(const surface8* s, const float* stream, v3 corner[3])
{
    vf unused;
    for (int k = 0; k < 3; k++) gather_vertex(stream, s->offset[k], &corner[k].x, &corner[k].y, &corner[k].z, &unused);
}

static void set_up_visible(const es_resolve_job* job, uint32_t which, vm mask, vi id, vf x, vf y, es_visible_triangle* records)
{
    const es_prepared_instance* instance = &job->instances[which];
    const es_prepared_material* material = instance->material;
    const es_raster_mesh* mesh = instance->mesh;
    const uint32_t planes = job->gbuffer.planes;
    /* records have no room for alpha, which few views want */
    bool complex = material->any_texture || ((planes & ES_GBUFFER_MOTION) && instance->has_deltas) || (planes & ES_GBUFFER_ALPHA);
    uint32_t tag = which | (complex ? (uint32_t)ES_VISIBLE_COMPLEX : 0u) | (instance->moving ? (uint32_t)ES_VISIBLE_MOVING : 0u);
    vf words[32];
    for (int i = 0; i < 32; i++) words[i] = vf_zero();
    words[7] = vf_from_bits(vi_set1((int32_t)tag));
    if (complex) {
        words[4] = words[5] = vf_set1(1.0f); /* a distance to divide by until the pixel has its own */
        store_visible(records, mask, words);
        return;
    }
    surface8 s;
    start_surface(job, instance, mask, id, x, y, true, &s);
    vf one = vf_set1(1.0f), tiny = vf_set1(1e-30f), inverse_d = s.inverse, inverse_w = one;
    plane8 distance;
    vf low, high;
    if (job->orthographic) {
        vf d[3];
        for (int k = 0; k < 3; k++) d[k] = vf_max(vf_set1(job->distance_offset) + vf_set1(job->distance_scale) * s.z[k], tiny);
        distance = plane_of(&s, d[0], d[1], d[2], inverse_d, one);
        low = vf_min(vf_min(d[0], d[1]), d[2]);
        high = vf_max(vf_max(d[0], d[1]), d[2]);
    } else {
        inverse_w = one / vf_max(s.here_w, tiny);
        inverse_d = s.inverse * inverse_w;
        distance = (plane8){s.sum_x * inverse_d, s.sum_y * inverse_d, inverse_w};
        vf nearest = vf_min(vf_min(s.w[0], s.w[1]), s.w[2]), farthest = vf_max(vf_max(s.w[0], s.w[1]), s.w[2]);
        vm before = vm_gt(nearest, tiny);
        high = vf_select(before, one / vf_select(before, nearest, one), vf_set1(1e30f));
        low = vf_select(before, one / vf_select(before, farthest, one), tiny);
    }
    words[0] = distance.x, words[1] = distance.y, words[2] = distance.c, words[3] = x;
    words[4] = low, words[5] = high, words[6] = y;

    v3 geometric = geometric_normal(job, &s, x, y);
    words[11] = vf_from_bits(es_pack_normal_v(geometric.x, geometric.y, geometric.z));
    if (planes & ES_GBUFFER_NORMAL) {
        if (mesh->normals) {
            v3 n[3];
            gather_corners(&s, mesh->normals, n);
            for (int k = 0; k < 3; k++) n[k] = flip(transform3(instance->normal_matrix, n[k]), s.back & vi_set1(INT32_MIN));
            plane8 px = plane_of(&s, n[0].x, n[1].x, n[2].x, inverse_d, inverse_w), py = plane_of(&s, n[0].y, n[1].y, n[2].y, inverse_d, inverse_w);
            plane8 pz = plane_of(&s, n[0].z, n[1].z, n[2].z, inverse_d, inverse_w);
            words[8] = px.x, words[9] = px.y, words[10] = px.c;
            words[12] = py.x, words[13] = py.y, words[14] = py.c;
            words[16] = pz.x, words[17] = pz.y, words[18] = pz.c;
        } /* else zero: not directed, so the geometric normal is taken */
    }
    words[15] = vf_from_bits(s.triangle + vi_set1(1));
    words[19] = vf_from_bits(vi_set1((int32_t)(instance->instance_id + 1)));
    if (planes & ES_GBUFFER_ALBEDO) {
        v3 c[3];
        vf base[3];
        for (int i = 0; i < 3; i++) base[i] = vf_set1(material->base_color[i]);
        if (mesh->colors) {
            gather_corners(&s, mesh->colors, c);
            for (int k = 0; k < 3; k++) c[k] = (v3){c[k].x * base[0], c[k].y * base[1], c[k].z * base[2]};
        } else {
            c[0] = c[1] = c[2] = (v3){base[0], base[1], base[2]};
        }
        plane8 r = plane_of(&s, c[0].x, c[1].x, c[2].x, inverse_d, inverse_w), g = plane_of(&s, c[0].y, c[1].y, c[2].y, inverse_d, inverse_w);
        plane8 b = plane_of(&s, c[0].z, c[1].z, c[2].z, inverse_d, inverse_w);
        words[20] = r.x, words[21] = r.y, words[22] = r.c;
        words[24] = g.x, words[25] = g.y, words[26] = g.c;
        words[28] = b.x, words[29] = b.y, words[30] = b.c;
    }
    words[23] = vf_from_bits(vi_set1((int32_t)material->surface_word));
    words[27] = vf_from_bits(vi_set1((int32_t)material->emission_word));
    words[31] = vf_from_bits(vi_set1((int32_t)(instance->material_index << 16)));
    store_visible(records, mask, words);
}

/* Steps 1 and 2: slots for the triangles seen. A pixel needs a look only when neither its left nor its upper neighbour shows the same. */
static uint32_t find_visible(es_resolve_job* job, const es_tile* tile, uint32_t rows, uint32_t columns)
{
    uint32_t count = 1;
    job->slot[0] = 1;
    for (uint32_t row = 0; row < rows; row++)
        for (uint32_t column = 0; column < columns; column += VW) {
            const uint32_t* here = tile->number + row * ES_TILE_PITCH + column;
            vi now = vi_load(here), left = vi_load(here - 1), up = row ? vi_load(here - ES_TILE_PITCH) : vi_set1(-1);
            vm same = vi_eq(now, up) | vi_eq(now, vi_zero());
            /* what lies left of the first column is not this row's */
            same |= vi_eq(now, left) & (column ? vm_all_lanes() : ~vm_first(1));
            for (uint32_t bits = ~vm_bits(same) & 0xff; bits; bits &= bits - 1) {
                uint32_t lane = (uint32_t)__builtin_ctz(bits), number = here[lane], slot = job->slot[number];
                bool fresh = slot == 0;
                job->slot_number[count] = number;
                job->slot_pixel[count] = row << 16 | (column + lane);
                count += fresh;
                job->slot[number] = fresh ? count : slot;
            }
        }
    for (uint32_t first = 1; first < count; first += VW) {
        uint32_t n = count - first < VW ? count - first : VW;
        vm used = vm_first((int32_t)n);
        vi number = used & vi_load(job->slot_number + first), pixel = used & vi_load(job->slot_pixel + first);
        vi id = used & vi_gather(tile->triangle_ids, number), instance = vi_gather(job->chunk_instance, vi_shift_right_logical(id, ES_CHUNK_BITS));
        vf x = vf_from_int((pixel & vi_set1(0xffff)) + vi_set1(tile->x)) + vf_set1(0.5f - 0.5f * (float)tile->width);
        vf y = vf_from_int((pixel >> 16) + vi_set1(tile->y)) + vf_set1(0.5f - 0.5f * (float)tile->height);
        for (uint32_t pending = vm_bits(used); pending;) {
            int32_t which = instance[__builtin_ctz(pending)];
            vm mask = used & vi_eq(instance, vi_set1(which));
            set_up_visible(job, (uint32_t)which, mask, id, x, y, job->visible + first);
            pending &= ~vm_bits(mask);
        }
    }
    return count;
}

/* Four numbers of eight pixels' records, which are one and the same when `one`: a constant at every call. */
VINL void read_record(const char* record, const uint32_t offset[VW], bool one, vf* a, vf* b, vf* c, vf* d)
{
    if (!one) {
        gather_vertex(record, offset, a, b, c, d);
        return;
    }
    float words[4];
    memcpy(words, record + offset[0], sizeof words);
    *a = vf_set1(words[0]);
    *b = vf_set1(words[1]);
    *c = vf_set1(words[2]);
    *d = vf_set1(words[3]);
}

/* Step 3 for eight pixels. The masks of `t` are the pixels seen; `one`: they show one triangle. */
VINL void resolve_pixels(const es_resolve_job* job, const target* t, vi slot, vi id_numbers, const uint32_t* triangle_ids, vf x, vf y, bool one)
{
    const es_gbuffer* g = &job->gbuffer;
    const uint32_t planes = g->planes;
    const char* records = (const char*)job->visible;
    uint32_t offset[VW];
    vi_store(offset, slot << 7);
    if (!one) keep_in_memory(offset);
    vf px, py, pc, ox, oy, low, high, word;
    read_record(records, offset, one, &px, &py, &pc, &ox);
    read_record(records + 16, offset, one, &low, &high, &oy, &word);
    vi tag = vi_from_bits(word);
    ox = x - ox;
    oy = y - oy;
    vf value = vf_clamp(px * ox + py * oy + pc, low, high);
    vf distance, w;
    if (job->orthographic) distance = value, w = vf_set1(1.0f);
    else distance = w = vf_set1(1.0f) / value;
    if (planes & ES_GBUFFER_DEPTH) put_float(t, g->depth, distance);
    if (planes & (ES_GBUFFER_NORMAL | ES_GBUFFER_GEOMETRIC_NORMAL | ES_GBUFFER_TRIANGLE | ES_GBUFFER_INSTANCE)) {
        v3 n;
        vf geometric, triangle, instance_id;
        read_record(records + 32, offset, one, &px, &py, &pc, &geometric);
        n.x = px * ox + py * oy + pc;
        read_record(records + 48, offset, one, &px, &py, &pc, &triangle);
        n.y = px * ox + py * oy + pc;
        read_record(records + 64, offset, one, &px, &py, &pc, &instance_id);
        n.z = px * ox + py * oy + pc;
        if (planes & ES_GBUFFER_GEOMETRIC_NORMAL) put(t, g->geometric_normal, vi_from_bits(geometric));
        if (planes & ES_GBUFFER_TRIANGLE) put(t, g->triangle, vi_from_bits(triangle));
        if (planes & ES_GBUFFER_INSTANCE) put(t, g->instance, vi_from_bits(instance_id));
        if (planes & ES_GBUFFER_NORMAL) put(t, g->normal, vi_select(directed(n), es_pack_normal_v(n.x, n.y, n.z), vi_from_bits(geometric)));
    }
    if (planes & (ES_GBUFFER_ALBEDO | ES_GBUFFER_SURFACE | ES_GBUFFER_EMISSION)) {
        vf surface, emission, material;
        read_record(records + 80, offset, one, &px, &py, &pc, &surface);
        vf red = (px * ox + py * oy + pc) * w;
        read_record(records + 96, offset, one, &px, &py, &pc, &emission);
        vf green = (px * ox + py * oy + pc) * w;
        read_record(records + 112, offset, one, &px, &py, &pc, &material);
        vf blue = (px * ox + py * oy + pc) * w;
        if (planes & ES_GBUFFER_SURFACE) put(t, g->surface, vi_from_bits(surface));
        if (planes & ES_GBUFFER_EMISSION) put(t, g->emission, vi_from_bits(emission));
        if (planes & ES_GBUFFER_ALBEDO) {
            put(t, g->albedo_rg, es_pack_unorm16_v(red) | (es_pack_unorm16_v(green) << 16));
            put(t, g->albedo_b, es_pack_unorm16_v(blue) | vi_from_bits(material));
        }
    }
    vm complex = t->mask & vi_lt(tag, vi_zero()), moving = t->mask & ~complex & ~vi_eq(tag & vi_set1(ES_VISIBLE_MOVING), vi_zero());
    vi instance = tag & vi_set1(ES_VISIBLE_INSTANCE);
    if (planes & ES_GBUFFER_MOTION) {
        vf motion_x = vf_zero(), motion_y = vf_zero();
        vf z = vf_set1(job->z_offset) + vf_set1(job->z_scale) * distance;
        for (uint32_t pending = vm_bits(moving); pending;) {
            int32_t which = instance[__builtin_ctz(pending)];
            vm mask = moving & vi_eq(instance, vi_set1(which));
            vf mx, my;
            rigid_motion(&job->instances[which], x, y, z, w, &mx, &my);
            motion_x = vf_select(mask, mx, motion_x);
            motion_y = vf_select(mask, my, motion_y);
            pending &= ~vm_bits(mask);
        }
        put_float(t, g->motion_x, motion_x);
        put_float(t, g->motion_y, motion_y);
    }
    if (planes & ES_GBUFFER_ALPHA) put_float(t, g->alpha, vf_zero()); /* all are complex then; what they do not cover is zero */
    uint32_t pending = vm_bits(complex);
    if (!pending) return;
    vi id = vi_gather(triangle_ids, id_numbers);
    while (pending) {
        int32_t which = instance[__builtin_ctz(pending)];
        target part = {t->planes, t->at, complex & vi_eq(instance, vi_set1(which)), false};
        resolve_complex(job, &job->instances[which], &part, id, x, y);
        pending &= ~vm_bits(part.mask);
    }
}

static void clear_pixels(const es_gbuffer* g, size_t at)
{
    float* const floats[] = {g->depth, g->motion_x, g->motion_y, g->alpha};
    uint32_t* const words[] = {g->normal, g->geometric_normal, g->albedo_rg, g->albedo_b, g->surface, g->emission, g->instance, g->triangle};
    for (size_t i = 0; i < sizeof floats / sizeof *floats; i++)
        if (floats[i]) vf_store(floats[i] + at, vf_zero());
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (words[i]) vi_store(words[i] + at, vi_zero());
}

void ES_KERNEL(es_resolve_tile)(es_resolve_job* job, const es_tile* tile)
{
    const es_gbuffer* g = &job->gbuffer;
    const uint32_t columns = g->width - (uint32_t)tile->x < ES_TILE_SIZE ? g->width - (uint32_t)tile->x : ES_TILE_SIZE;
    const uint32_t rows = g->height - (uint32_t)tile->y < ES_TILE_SIZE ? g->height - (uint32_t)tile->y : ES_TILE_SIZE;
    uint64_t pixels = 0;
    uint32_t visible = find_visible(job, tile, rows, columns);
    for (uint32_t row = 0; row < rows; row++) {
        size_t line = (size_t)((uint32_t)tile->y + row) * g->stride + (uint32_t)tile->x;
        vf y = vf_set1((float)(tile->y + (int32_t)row) + 0.5f - 0.5f * (float)tile->height);
        for (uint32_t column = 0; column < columns; column += VW) {
            vi number = vi_load(tile->number + row * ES_TILE_PITCH + column);
            vm seen = ~vi_eq(number, vi_zero()) & vm_first((int32_t)(columns - column));
            uint32_t bits = vm_bits(seen);
            if (!bits) {
                clear_pixels(g, line + column);
                continue;
            }
            pixels += (uint32_t)__builtin_popcount(bits);
            vf x = vf_set1((float)(tile->x + (int32_t)column) + 0.5f - 0.5f * (float)tile->width) + vf_iota();
            target t = {g, line + column, seen, true};
            const int32_t first = number[0];
            if (vm_all(seen & vi_eq(number, vi_set1(first)))) resolve_pixels(job, &t, vi_set1((int32_t)job->slot[first] - 1), number, tile->triangle_ids, x, y, true);
            else resolve_pixels(job, &t, vi_gather(job->slot, number) - vi_set1(1), number, tile->triangle_ids, x, y, false);
        }
    }
    for (uint32_t i = 1; i < visible; i++) job->slot[job->slot_number[i]] = 0;
    job->pixels += pixels;
}
