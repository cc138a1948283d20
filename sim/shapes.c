/* Procedural shapes: see shapes.h. */
#include "sim/shapes.h"

#include <string.h>

#include "platform/maths.h"

static const float two_pi = 6.2831853f;

es_shape es_shape_begin(es_context* context) { return (es_shape){.context = context}; }

static bool stopped(const es_shape* shape) { return shape->failed || (shape->stop && *shape->stop != ES_OK); }

/* The context has said what failed. */
static void fail(es_shape* shape)
{
    shape->failed = true;
    if (shape->stop) *shape->stop = es_context_last_result(shape->context);
}

void es_shape_free(es_shape* shape)
{
    es_release(shape->context, shape->positions, shape->position_capacity * sizeof(float));
    es_release(shape->context, shape->normals, shape->normal_capacity * sizeof(float));
    es_release(shape->context, shape->indices, shape->index_capacity * sizeof(uint32_t));
    *shape = (es_shape){.context = shape->context, .keep_degenerate = shape->keep_degenerate};
}

es_result es_shape_add_mesh(es_shape* shape, es_world* world, const char* name, es_mesh* mesh)
{
    es_result result = es_context_last_result(shape->context);
    if (!stopped(shape)) {
        es_mesh_desc desc = {.name = name, .vertex_count = (uint32_t)shape->vertex_count, .triangle_count = (uint32_t)shape->triangle_count,
            .positions = shape->positions, .normals = shape->normals, .indices = shape->indices};
        result = es_world_add_mesh(world, &desc, mesh);
    }
    es_shape_free(shape);
    return result;
}

uint32_t es_shape_vertex(es_shape* shape, es_vec3 position, es_vec3 normal)
{
    size_t used = 3 * shape->vertex_count;
    if (stopped(shape)) return 0;
    if (used > 3 * ((size_t)1 << 28)) {
        es_fail(shape->context, ES_INVALID_ARGUMENT, "a shape has at most 2^28 vertices");
        fail(shape);
        return 0;
    }
    if (!es_grow(shape->context, (void**)&shape->positions, &shape->position_capacity, used, used + 3, sizeof(float)) ||
        !es_grow(shape->context, (void**)&shape->normals, &shape->normal_capacity, used, used + 3, sizeof(float))) {
        fail(shape);
        return 0;
    }
    memcpy(shape->positions + used, &position, sizeof position);
    memcpy(shape->normals + used, &normal, sizeof normal);
    return (uint32_t)shape->vertex_count++;
}

static es_vec3 at(const float* values, uint32_t index) { return es_v3(values[3 * (size_t)index], values[3 * (size_t)index + 1], values[3 * (size_t)index + 2]); }
static bool same(es_vec3 a, es_vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

void es_shape_wound_triangle(es_shape* shape, uint32_t a, uint32_t b, uint32_t c)
{
    size_t used = 3 * shape->triangle_count;
    if (stopped(shape)) return;
    es_vec3 pa = at(shape->positions, a), pb = at(shape->positions, b), pc = at(shape->positions, c);
    if (!shape->keep_degenerate && (same(pa, pb) || same(pb, pc) || same(pc, pa))) return;
    if (!es_grow(shape->context, (void**)&shape->indices, &shape->index_capacity, used, used + 3, sizeof(uint32_t))) {
        fail(shape);
        return;
    }
    shape->indices[used] = a;
    shape->indices[used + 1] = b;
    shape->indices[used + 2] = c;
    shape->triangle_count++;
}

void es_shape_triangle(es_shape* shape, uint32_t a, uint32_t b, uint32_t c)
{
    if (stopped(shape)) return;
    es_vec3 pa = at(shape->positions, a), pb = at(shape->positions, b), pc = at(shape->positions, c);
    es_vec3 n = es_v3_add(es_v3_add(at(shape->normals, a), at(shape->normals, b)), at(shape->normals, c));
    bool turn = es_v3_dot(es_v3_cross(es_v3_sub(pb, pa), es_v3_sub(pc, pa)), n) < 0;
    es_shape_wound_triangle(shape, a, turn ? c : b, turn ? b : c);
}

void es_shape_facet(es_shape* shape, es_vec3 a, es_vec3 b, es_vec3 c, es_vec3 normal)
{
    uint32_t i = es_shape_vertex(shape, a, normal), j = es_shape_vertex(shape, b, normal), k = es_shape_vertex(shape, c, normal);
    es_shape_triangle(shape, i, j, k);
}

void es_shape_quad(es_shape* shape, es_vec3 a, es_vec3 b, es_vec3 c, es_vec3 d, es_vec3 normal)
{
    uint32_t i = es_shape_vertex(shape, a, normal), j = es_shape_vertex(shape, b, normal);
    uint32_t k = es_shape_vertex(shape, c, normal), l = es_shape_vertex(shape, d, normal);
    es_shape_triangle(shape, i, j, k);
    es_shape_triangle(shape, i, k, l);
}

void es_shape_patch(es_shape* shape, es_shape_surface surface, const void* parameters, uint32_t nu, uint32_t nv, bool closed_u, bool closed_v)
{
    uint32_t base = (uint32_t)shape->vertex_count;
    for (uint32_t j = 0; j <= nv; j++)
        for (uint32_t i = 0; i <= nu; i++) {
            es_vec3 position, normal;
            surface(parameters, closed_u && i == nu ? 0.0f : (float)i / (float)nu, closed_v && j == nv ? 0.0f : (float)j / (float)nv, &position, &normal);
            es_shape_vertex(shape, position, normal);
        }
    for (uint32_t j = 0; j < nv; j++)
        for (uint32_t i = 0; i < nu; i++) {
            uint32_t a = base + j * (nu + 1) + i, b = a + 1, d = a + nu + 1, e = d + 1;
            es_shape_triangle(shape, a, b, e);
            es_shape_triangle(shape, a, e, d);
        }
}

void es_shape_box(es_shape* shape, es_vec3 low, es_vec3 high)
{
    for (int face = 0; face < 6; face++) {
        int axis = face >> 1, u = (axis + 1) % 3, v = (axis + 2) % 3;
        float l[3] = {low.x, low.y, low.z}, h[3] = {high.x, high.y, high.z}, p[4][3], n[3] = {0, 0, 0};
        n[axis] = face & 1 ? 1.0f : -1.0f;
        for (int corner = 0; corner < 4; corner++) {
            p[corner][axis] = face & 1 ? h[axis] : l[axis];
            p[corner][u] = corner == 1 || corner == 2 ? h[u] : l[u];
            p[corner][v] = corner >= 2 ? h[v] : l[v];
        }
        es_shape_quad(shape, es_v3(p[0][0], p[0][1], p[0][2]), es_v3(p[1][0], p[1][1], p[1][2]), es_v3(p[2][0], p[2][1], p[2][2]),
            es_v3(p[3][0], p[3][1], p[3][2]), es_v3(n[0], n[1], n[2]));
    }
}

typedef struct plane_parameters { es_vec3 origin, du, dv, normal; } plane_parameters;

static void plane_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const plane_parameters* q = parameters;
    *position = es_v3_add(es_v3_add(q->origin, es_v3_scale(q->du, u)), es_v3_scale(q->dv, v));
    *normal = q->normal;
}

void es_shape_plane(es_shape* shape, es_vec3 origin, es_vec3 du, es_vec3 dv, es_vec3 normal, uint32_t nu, uint32_t nv)
{
    es_shape_patch(shape, plane_surface, &(plane_parameters){origin, du, dv, normal}, nu, nv, false, false);
}

typedef struct round_parameters { es_vec3 centre; float radius, tube, sin_tilt, cos_tilt; uint32_t p, q; } round_parameters;

static void sphere_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const round_parameters* s = parameters;
    float a = two_pi * u, b = ES_PI * v;
    float ring = v == 1.0f ? 0.0f : es_sin(b), height = v == 1.0f ? -1.0f : es_cos(b); /* a pole is one point */
    *normal = es_v3(ring * es_cos(a), height, ring * es_sin(a));
    *position = es_v3_add(s->centre, es_v3_scale(*normal, s->radius));
}

void es_shape_sphere(es_shape* shape, es_vec3 centre, float radius, uint32_t nu, uint32_t nv)
{
    es_shape_patch(shape, sphere_surface, &(round_parameters){.centre = centre, .radius = radius}, nu, nv, true, false);
}

static void torus_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const round_parameters* t = parameters;
    float a = two_pi * u, b = two_pi * v, ring = t->radius + t->tube * es_cos(b);
    es_vec3 p = es_v3(ring * es_cos(a), t->tube * es_sin(b), ring * es_sin(a));
    es_vec3 n = es_v3(es_cos(b) * es_cos(a), es_sin(b), es_cos(b) * es_sin(a));
    *position = es_v3_add(t->centre, es_v3(p.x, t->cos_tilt * p.y - t->sin_tilt * p.z, t->sin_tilt * p.y + t->cos_tilt * p.z));
    *normal = es_v3(n.x, t->cos_tilt * n.y - t->sin_tilt * n.z, t->sin_tilt * n.y + t->cos_tilt * n.z);
}

void es_shape_torus(es_shape* shape, es_vec3 centre, float radius, float tube, float tilt, uint32_t nu, uint32_t nv)
{
    round_parameters parameters = {.centre = centre, .radius = radius, .tube = tube, .sin_tilt = es_sin(tilt), .cos_tilt = es_cos(tilt)};
    es_shape_patch(shape, torus_surface, &parameters, nu, nv, true, true);
}

/* Tube around the curve c(φ) with φ = 2πu p: the frame is the curve's tangent and two normals made from the radial direction,
 * which no tangent of a knot with q > 0 is parallel to. */
static void knot_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const round_parameters* k = parameters;
    float phi = two_pi * u, b = two_pi * v;
    float cp = es_cos((float)k->p * phi), sp = es_sin((float)k->p * phi), cq = es_cos((float)k->q * phi), sq = es_sin((float)k->q * phi);
    float third = k->radius / 3.0f, ring = third * (2.0f + cq), ring_rate = -third * (float)k->q * sq;
    es_vec3 curve = es_v3(ring * cp, third * sq, ring * sp), radial = es_v3(cp, 0, sp);
    es_vec3 tangent = es_v3(ring_rate * cp - ring * (float)k->p * sp, third * (float)k->q * cq, ring_rate * sp + ring * (float)k->p * cp);
    tangent = es_v3_normalize(tangent, es_v3(0, 1, 0));
    es_vec3 side = es_v3_normalize(es_v3_cross(tangent, radial), es_v3(0, 1, 0)), out = es_v3_cross(side, tangent);
    *normal = es_v3_add(es_v3_scale(out, es_cos(b)), es_v3_scale(side, es_sin(b)));
    *position = es_v3_add(k->centre, es_v3_add(curve, es_v3_scale(*normal, k->tube)));
}

void es_shape_torus_knot(es_shape* shape, es_vec3 centre, uint32_t p, uint32_t q, float radius, float tube, uint32_t along, uint32_t around)
{
    es_shape_patch(shape, knot_surface, &(round_parameters){.centre = centre, .radius = radius, .tube = tube, .p = p, .q = q}, along, around, true, true);
}

typedef struct segment_parameters { es_vec3 base; es_vec2 from, to, normal; } segment_parameters;

static void segment_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const segment_parameters* s = parameters;
    es_vec2 at_profile = v == 0.0f ? s->from : s->to;
    float c = es_cos(two_pi * u), d = es_sin(two_pi * u);
    *position = es_v3_add(s->base, es_v3(at_profile.x * c, at_profile.y, at_profile.x * d));
    *normal = es_v3(s->normal.x * c, s->normal.y, s->normal.x * d);
}

void es_shape_lathe(es_shape* shape, es_vec3 base, const es_vec2* profile, uint32_t count, uint32_t n)
{
    for (uint32_t i = 0; i + 1 < count; i++) {
        es_vec3 out = es_v3_normalize(es_v3(profile[i + 1].y - profile[i].y, profile[i].x - profile[i + 1].x, 0), es_v3(1, 0, 0));
        es_shape_patch(shape, segment_surface, &(segment_parameters){base, profile[i], profile[i + 1], {out.x, out.y}}, n, 1, true, false);
    }
}

void es_shape_cylinder(es_shape* shape, es_vec3 base, float radius, float height, uint32_t n)
{
    const es_vec2 profile[] = {{0, 0}, {radius, 0}, {radius, height}, {0, height}};
    es_shape_lathe(shape, base, profile, 4, n);
}

void es_shape_smooth_lathe(es_shape* shape, es_vec3 base, const es_vec2* profile, uint32_t count, uint32_t between, uint32_t n)
{
    enum { MOST = 256 };
    es_vec2 fine[MOST];
    uint32_t points = 0;
    for (uint32_t i = 0; i + 1 < count; i++) {
        const es_vec2 a = profile[i ? i - 1 : 0], b = profile[i], c = profile[i + 1], e = profile[i + 2 < count ? i + 2 : count - 1];
        for (uint32_t k = 0; k < between && points + 1 < MOST; k++) {
            /* Catmull and Rom's spline */
            const float t = (float)k / (float)between, t2 = t * t, t3 = t2 * t;
            const float wa = 0.5f * (-t3 + 2 * t2 - t), wb = 0.5f * (3 * t3 - 5 * t2 + 2), wc = 0.5f * (-3 * t3 + 4 * t2 + t), we = 0.5f * (t3 - t2);
            fine[points].x = es_maxf(wa * a.x + wb * b.x + wc * c.x + we * e.x, 0.0f);
            fine[points++].y = wa * a.y + wb * b.y + wc * c.y + we * e.y;
        }
    }
    fine[points++] = profile[count - 1];
    for (uint32_t i = 0; i < points; i++)
        for (uint32_t k = 0; k <= n; k++) {
            const es_vec2 p = fine[i], low = fine[i ? i - 1 : 0], high = fine[i + 1 < points ? i + 1 : i];
            const float angle = 2.0f * ES_PI * (float)(k % n) / (float)n, dx = high.x - low.x, dy = high.y - low.y, length = es_maxf(es_sqrt(dx * dx + dy * dy), 1e-9f);
            float sine, cosine;
            es_sincos(angle, &sine, &cosine);
            es_shape_vertex(shape, es_v3(base.x + p.x * cosine, base.y + p.y, base.z + p.x * sine), es_v3(dy / length * cosine, -dx / length, dy / length * sine));
        }
    const uint32_t first = (uint32_t)(shape->vertex_count - (size_t)points * (n + 1));
    for (uint32_t i = 0; i + 1 < points; i++)
        for (uint32_t k = 0; k < n; k++) {
            const uint32_t a = first + i * (n + 1) + k, b = a + n + 1;
            es_shape_triangle(shape, a, b, b + 1);
            es_shape_triangle(shape, a, b + 1, a + 1);
        }
}
