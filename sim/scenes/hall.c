/* A colonnade: two rows of fluted columns carry arcades and a coffered barrel vault; banners hang in the left arcade.
 *
 *      y  6.6 |        .-´´´´-.            The one light, a swaying spot, stands high in the right aisle and shines across
 *             |_______/        \______     the nave between the columns. It reaches part of the floor, the left columns and
 *         6.0 |  |   |          |   | |    the banners; vault, right aisle and far end are lit by what these give back.
 *             |  |  [ ]        [ ]  *´|
 *             |  |  | |   ..   | | ´  |    Eight bays of 3.2 m along z between end walls at ±12.8 m; column axes at
 *         0.3 |__|__|_|_      _|_|____|    x = ±2.6 m, aisle walls at x = ±5.4 m; the aisles lie two steps above the nave.
 *            -5.4  -2.6   0    2.6  5.4
 *
 * Shell, columns, arcades, vault, beams and banners are closed solids that overlap where they meet, so no light slips
 * through a joint. */
#include "sim/scenes/hall.h"

#include "platform/maths.h"

static const float turn = 6.2831853f;

enum { BAYS = 8, PERIOD = 24, KEYS = 48, FIXED_TRIANGLES = 17000, SCALED_TRIANGLES = 91500, FLUTES = 20 };
static const float bay = 3.2f, half_length = 12.8f, axis_x = 2.6f, aisle_x = 5.4f, wall = 0.4f;
static const float aisle_ceiling = 6.0f, spring = 4.5f, arcade_top = 6.4f, vault_spring = 6.6f, vault_radius = 2.35f;
static const float arch_radius = 1.2f, arcade_half = 0.3f;

/* Tessellation: counts for the scene's own number of triangles times `scale`. */
typedef struct detail { float scale; } detail;

static uint32_t steps(const detail* d, float count, uint32_t least)
{
    uint32_t n = (uint32_t)(count * d->scale + 0.5f);
    return n < least ? least : n;
}

static es_shape begin(es_scene_builder* builder) { return es_build_shape(builder); }
static float bay_line(int k) { return -half_length + bay * (float)k; }

/* ---- columns ---------------------------------------------------------------------------------------------------------------- */

static const float shaft_low = 0.62f, shaft_high = 4.02f, shaft_radius = 0.335f, shaft_taper = 0.055f, flute_depth = 0.026f;

/* One flute of the shaft: u across it, v up. The radius shrinks upwards along a parabola (entasis); the flute is a parabola
 * across that fades out at both ends. */
typedef struct flute_parameters { uint32_t index; } flute_parameters;

static void flute_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const flute_parameters* f = parameters;
    const float width = turn / (float)FLUTES;
    uint32_t arris = u == 1.0f ? (f->index + 1) % FLUTES : f->index; /* neighbours compute their common arris alike */
    float angle = width * ((float)arris + (u == 1.0f ? 0.0f : u));
    float t = u == 1.0f ? 0.0f : u;
    float fade = es_clampf(12.0f * es_minf(v, 1.0f - v), 0.0f, 1.0f);
    float depth = flute_depth * es_sqrt(fade * (2.0f - fade)); /* a quarter circle at each end */
    float radius = shaft_radius - shaft_taper * v * v - 4.0f * depth * t * (1.0f - t);
    float slope_around = -4.0f * depth * (1.0f - 2.0f * u) / width;
    float slope_up = -2.0f * shaft_taper * v / (shaft_high - shaft_low);
    float c = es_cos(angle), s = es_sin(angle);
    *position = es_v3(radius * c, shaft_low + (shaft_high - shaft_low) * v, radius * s);
    /* e_r - (r'/r) e_θ - slope e_y, from the cross product of the two tangents */
    float across = slope_around / radius;
    *normal = es_v3_normalize(es_v3(c + across * s, -slope_up, s - across * c), es_v3(c, 0, s));
}

static void add_disc_fan(es_shape* shape, float y, float radius_bottom, uint32_t facets, bool up)
{
    /* closes the shaft at v = 0 or 1, where flutes have no depth: the rim is the polygon of the flutes' facets */
    es_vec3 normal = es_v3(0, up ? 1.0f : -1.0f, 0), middle = es_v3(0, y, 0);
    for (uint32_t flute = 0; flute < FLUTES; flute++)
        for (uint32_t i = 0; i < facets; i++) {
            es_vec3 a, b, ignored;
            flute_surface(&(flute_parameters){flute}, (float)i / (float)facets, up ? 1.0f : 0.0f, &a, &ignored);
            flute_surface(&(flute_parameters){flute}, i + 1 == facets ? 1.0f : (float)(i + 1) / (float)facets, up ? 1.0f : 0.0f, &b, &ignored);
            es_shape_facet(shape, middle, a, b, normal);
        }
}

/* A half-round moulding between two profile points, bulging outwards. */
static uint32_t bulge(es_vec2* profile, uint32_t count, float radius, float low, float high, uint32_t n)
{
    float half = 0.5f * (high - low);
    for (uint32_t i = 0; i <= n; i++) {
        float a = ES_PI * ((float)i / (float)n - 0.5f);
        profile[count++] = (es_vec2){radius + half * es_cos(a), 0.5f * (low + high) + half * es_sin(a)};
    }
    return count;
}

/* Attic base (plinth, two tori about a hollow), fluted shaft, Doric capital (neck ring, echinus, abacus). */
static es_mesh build_column(es_scene_builder* builder, const detail* d)
{
    es_shape shape = begin(builder);
    uint32_t round = steps(d, 40, 8), moulding = steps(d, 5, 2), facets = steps(d, 4, 1), rows = steps(d, 12, 4);
    if (moulding > 24) moulding = 24;
    es_shape_box(&shape, es_v3(-0.46f, 0.25f, -0.46f), es_v3(0.46f, 0.39f, 0.46f));
    es_vec2 profile[96];
    uint32_t count = 0;
    profile[count++] = (es_vec2){0, 0.38f};
    count = bulge(profile, count, 0.39f, 0.38f, 0.50f, moulding);
    profile[count++] = (es_vec2){0.365f, 0.51f};
    profile[count++] = (es_vec2){0.355f, 0.54f};
    profile[count++] = (es_vec2){0.365f, 0.57f};
    count = bulge(profile, count, 0.355f, 0.57f, 0.64f, moulding);
    profile[count++] = (es_vec2){0, 0.64f};
    es_shape_lathe(&shape, es_v3(0, 0, 0), profile, count, round);

    for (uint32_t flute = 0; flute < FLUTES; flute++) es_shape_patch(&shape, flute_surface, &(flute_parameters){flute}, facets, rows, false, false);
    add_disc_fan(&shape, shaft_low, shaft_radius, facets, false);
    add_disc_fan(&shape, shaft_high, shaft_radius - shaft_taper, facets, true);

    count = 0;
    profile[count++] = (es_vec2){0, 3.96f};
    count = bulge(profile, count, 0.285f, 3.96f, 4.03f, moulding);
    profile[count++] = (es_vec2){0.285f, 4.10f};
    for (uint32_t i = 0; i <= moulding; i++) { /* echinus: a quarter ellipse */
        float a = 0.5f * ES_PI * (float)i / (float)moulding;
        profile[count++] = (es_vec2){0.29f + 0.13f * es_sin(a), 4.32f - 0.20f * es_cos(a)};
    }
    profile[count++] = (es_vec2){0, 4.32f};
    es_shape_lathe(&shape, es_v3(0, 0, 0), profile, count, round);
    es_shape_box(&shape, es_v3(-0.45f, 4.31f, -0.45f), es_v3(0.45f, 4.52f, 0.45f));
    return es_build_mesh(builder, "column", &shape);
}

/* ---- arcades ----------------------------------------------------------------------------------------------------------------- */

/* The wall over one bay, centred on x = z = 0, with its arch cut out: a closed solid from the springing to the cornice. */
static es_mesh build_arch(es_scene_builder* builder, const detail* d)
{
    es_shape shape = begin(builder);
    const float h = 0.5f * bay, t = arcade_half;
    uint32_t n = steps(d, 28, 6), tube = steps(d, 6, 3);
    for (uint32_t i = 0; i < n; i++) {
        float a = ES_PI * (float)i / (float)n, b = ES_PI * (float)(i + 1) / (float)n;
        /* the springing points are computed once so that the arch meets the flat underside exactly */
        float za = i == 0 ? arch_radius : arch_radius * es_cos(a), zb = i + 1 == n ? -arch_radius : arch_radius * es_cos(b);
        float ya = i == 0 ? spring : spring + arch_radius * es_sin(a), yb = i + 1 == n ? spring : spring + arch_radius * es_sin(b);
        for (int side = -1; side <= 1; side += 2) {
            float x = t * (float)side;
            es_shape_quad(&shape, es_v3(x, ya, za), es_v3(x, yb, zb), es_v3(x, arcade_top, zb), es_v3(x, arcade_top, za), es_v3((float)side, 0, 0));
        }
        es_vec3 na = es_v3(0, -es_sin(a), -es_cos(a)), nb = es_v3(0, -es_sin(b), -es_cos(b));
        uint32_t p = es_shape_vertex(&shape, es_v3(-t, ya, za), na), q = es_shape_vertex(&shape, es_v3(t, ya, za), na);
        uint32_t r = es_shape_vertex(&shape, es_v3(t, yb, zb), nb), s = es_shape_vertex(&shape, es_v3(-t, yb, zb), nb);
        es_shape_triangle(&shape, p, q, r);
        es_shape_triangle(&shape, p, r, s);
        es_shape_quad(&shape, es_v3(-t, arcade_top, za), es_v3(t, arcade_top, za), es_v3(t, arcade_top, zb), es_v3(-t, arcade_top, zb), es_v3(0, 1, 0));
    }
    for (int end = -1; end <= 1; end += 2) {
        float z0 = arch_radius * (float)end, z1 = h * (float)end;
        for (int side = -1; side <= 1; side += 2) {
            float x = t * (float)side;
            es_shape_quad(&shape, es_v3(x, spring, z0), es_v3(x, spring, z1), es_v3(x, arcade_top, z1), es_v3(x, arcade_top, z0), es_v3((float)side, 0, 0));
        }
        es_shape_quad(&shape, es_v3(-t, spring, z0), es_v3(t, spring, z0), es_v3(t, spring, z1), es_v3(-t, spring, z1), es_v3(0, -1, 0));
        es_shape_quad(&shape, es_v3(-t, arcade_top, z0), es_v3(t, arcade_top, z0), es_v3(t, arcade_top, z1), es_v3(-t, arcade_top, z1), es_v3(0, 1, 0));
        es_shape_quad(&shape, es_v3(-t, spring, z1), es_v3(t, spring, z1), es_v3(t, arcade_top, z1), es_v3(-t, arcade_top, z1), es_v3(0, 0, (float)end));
    }
    /* archivolt: a half ring of round moulding on both faces, its ends closed */
    for (int side = -1; side <= 1; side += 2)
        for (uint32_t i = 0; i < n; i++)
            for (uint32_t j = 0; j < tube; j++) {
                es_vec3 p[4], m[4];
                for (int corner = 0; corner < 4; corner++) {
                    uint32_t ii = i + (corner == 1 || corner == 2), jj = (j + (corner >= 2)) % tube;
                    float a = ES_PI * (float)ii / (float)n, b = turn * (float)jj / (float)tube;
                    float ring = arch_radius + 0.10f + 0.06f * es_cos(b), x = (float)side * t + 0.06f * es_sin(b);
                    p[corner] = es_v3(x, spring + ring * es_sin(a), ring * es_cos(a));
                    m[corner] = es_v3(es_sin(b), es_cos(b) * es_sin(a), es_cos(b) * es_cos(a));
                }
                uint32_t v[4];
                for (int corner = 0; corner < 4; corner++) v[corner] = es_shape_vertex(&shape, p[corner], m[corner]);
                es_shape_triangle(&shape, v[0], v[1], v[2]);
                es_shape_triangle(&shape, v[0], v[2], v[3]);
                for (int end = 0; end < 2; end++) {
                    if ((end == 0 && i != 0) || (end == 1 && i + 1 != n)) continue;
                    es_vec3 middle = es_v3((float)side * t, p[end].y, 0);
                    float a = end ? ES_PI : 0.0f;
                    middle.y = spring + (arch_radius + 0.10f) * es_sin(a);
                    middle.z = (arch_radius + 0.10f) * es_cos(a);
                    es_shape_facet(&shape, middle, end ? p[1] : p[0], end ? p[2] : p[3], es_v3(0, -1, 0));
                }
            }
    return es_build_mesh(builder, "arch", &shape);
}

/* ---- vault --------------------------------------------------------------------------------------------------------------------- */

static es_vec3 vault_point(float radius, float angle, float z) { return es_v3(radius * es_cos(angle), vault_spring + radius * es_sin(angle), z); }
static es_vec3 vault_normal(float angle) { return es_v3(-es_cos(angle), -es_sin(angle), 0); }

/* Where the ray from the vault's axis at `angle` leaves the block around the vault. */
static es_vec3 block_point(float angle, float z)
{
    const float half = 3.2f, height = 2.9f;
    float c = es_cos(angle), s = es_sin(angle), along = 1e9f;
    if (es_absf(c) > 1e-4f) along = es_minf(along, half / es_absf(c));
    if (s > 1e-4f) along = es_minf(along, height / s);
    return es_v3(along * c, vault_spring + along * s, z);
}

static void vault_quad(es_shape* shape, float radius, float a0, float a1, float z0, float z1)
{
    uint32_t p = es_shape_vertex(shape, vault_point(radius, a0, z0), vault_normal(a0)), q = es_shape_vertex(shape, vault_point(radius, a1, z0), vault_normal(a1));
    uint32_t r = es_shape_vertex(shape, vault_point(radius, a1, z1), vault_normal(a1)), s = es_shape_vertex(shape, vault_point(radius, a0, z1), vault_normal(a0));
    es_shape_triangle(shape, p, q, r);
    es_shape_triangle(shape, p, r, s);
}

/* A block with a half cylinder cut out, the cut coffered: each cell is a frame about a panel set back by two steps. Its grid
 * runs through to the outside, so that the solid is closed edge by edge. */
static es_mesh build_vault(es_scene_builder* builder, const detail* d)
{
    es_shape shape = begin(builder);
    uint32_t around = steps(d, 11, 5) | 1u, along = BAYS * steps(d, 4, 1); /* odd: a row of coffers runs along the crown */
    const float z_low = -half_length - 0.2f, length = 2 * (half_length + 0.2f);
    for (uint32_t i = 0; i < along; i++)
        for (uint32_t j = 0; j < around; j++) {
            float a[6], z[6];
            static const float cuts[6] = {0, 0.16f, 0.26f, 0.74f, 0.84f, 1};
            for (int k = 0; k < 6; k++) {
                /* cell borders are computed as their neighbours compute them */
                a[k] = k == 5 ? ES_PI * (float)(j + 1) / (float)around : ES_PI * ((float)j + cuts[k]) / (float)around;
                z[k] = k == 5 ? z_low + length * (float)(i + 1) / (float)along : z_low + length * ((float)i + cuts[k]) / (float)along;
            }
            for (int ring = 0; ring < 2; ring++) {
                float radius = vault_radius + 0.10f * (float)ring, deeper = vault_radius + 0.10f * (float)(ring + 1);
                int lo = ring == 0 ? 0 : 1, hi = 5 - lo, in = lo + 1, out = hi - 1;
                /* frame: corners shared, four trapezoids */
                const float fa[4][2] = {{a[lo], z[lo]}, {a[hi], z[lo]}, {a[hi], z[hi]}, {a[lo], z[hi]}};
                const float ia[4][2] = {{a[in], z[in]}, {a[out], z[in]}, {a[out], z[out]}, {a[in], z[out]}};
                for (int k = 0; k < 4; k++) {
                    int m = (k + 1) & 3;
                    uint32_t p = es_shape_vertex(&shape, vault_point(radius, fa[k][0], fa[k][1]), vault_normal(fa[k][0]));
                    uint32_t q = es_shape_vertex(&shape, vault_point(radius, fa[m][0], fa[m][1]), vault_normal(fa[m][0]));
                    uint32_t r = es_shape_vertex(&shape, vault_point(radius, ia[m][0], ia[m][1]), vault_normal(ia[m][0]));
                    uint32_t s = es_shape_vertex(&shape, vault_point(radius, ia[k][0], ia[k][1]), vault_normal(ia[k][0]));
                    es_shape_triangle(&shape, p, q, r);
                    es_shape_triangle(&shape, p, r, s);
                    /* riser from this step to the next, facing the cell's middle */
                    es_vec3 b0 = vault_point(radius, ia[k][0], ia[k][1]), b1 = vault_point(radius, ia[m][0], ia[m][1]);
                    es_vec3 t0 = vault_point(deeper, ia[k][0], ia[k][1]), t1 = vault_point(deeper, ia[m][0], ia[m][1]);
                    es_vec3 middle = vault_point(radius, 0.5f * (a[0] + a[5]), 0.5f * (z[0] + z[5]));
                    es_vec3 face = es_v3_normalize(es_v3_cross(es_v3_sub(b1, b0), es_v3_sub(t0, b0)), es_v3(0, 1, 0));
                    if (es_v3_dot(face, es_v3_sub(middle, b0)) < 0) face = es_v3_scale(face, -1);
                    es_shape_quad(&shape, b0, b1, t1, t0, face);
                }
                if (ring == 1) vault_quad(&shape, deeper, a[in], a[out], z[in], z[out]);
            }
            /* outside */
            es_vec3 o0 = block_point(a[0], z[0]), o1 = block_point(a[5], z[0]), o2 = block_point(a[5], z[5]), o3 = block_point(a[0], z[5]);
            es_vec3 face = es_v3_normalize(es_v3_cross(es_v3_sub(o1, o0), es_v3_sub(o3, o0)), es_v3(0, 1, 0));
            if (face.x * (o0.x + o1.x) + face.y < 0) face = es_v3_scale(face, -1);
            es_shape_quad(&shape, o0, o1, o2, o3, face);
            if (j == 0 || j + 1 == around) {
                float angle = j == 0 ? a[0] : a[5];
                es_shape_quad(&shape, vault_point(vault_radius, angle, z[0]), block_point(angle, z[0]), block_point(angle, z[5]),
                    vault_point(vault_radius, angle, z[5]), es_v3(0, -1, 0));
                if (j == 0 && around == 1) continue;
            }
            if (i == 0 || i + 1 == along) {
                float end = i == 0 ? z[0] : z[5];
                es_shape_quad(&shape, vault_point(vault_radius, a[0], end), vault_point(vault_radius, a[5], end), block_point(a[5], end), block_point(a[0], end),
                    es_v3(0, 0, i == 0 ? -1.0f : 1.0f));
            }
        }
    return es_build_mesh(builder, "vault", &shape);
}

/* ---- banners -------------------------------------------------------------------------------------------------------------------- */

typedef struct cloth_parameters { float width, height, offset, phase; } cloth_parameters;

/* Hangs in the plane x = 0 from y = 0 down, with folds along z that deepen downwards; the lower edge is a shallow swallowtail. */
static void cloth_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const cloth_parameters* c = parameters;
    float z = (u - 0.5f) * c->width, wave = turn * 2.5f * u + c->phase;
    float deep = 0.012f + 0.05f * v;
    float drop = c->height * (1.0f - 0.10f * (1.0f - es_absf(2.0f * u - 1.0f)));
    float x = deep * es_sin(wave) + 0.04f * v * es_sin(3.0f * v + c->phase);
    *position = es_v3(x + c->offset, -drop * v, z);
    es_vec3 slope = es_v3(1, 0, -deep * es_cos(wave) * turn * 2.5f / c->width);
    *normal = es_v3_scale(es_v3_normalize(slope, es_v3(1, 0, 0)), c->offset < 0 ? -1.0f : 1.0f);
}

static es_mesh build_banner(es_scene_builder* builder, const detail* d, float phase)
{
    es_shape shape = begin(builder);
    uint32_t nu = 2 * steps(d, 12, 4), nv = steps(d, 18, 3); /* even: the swallowtail's tip is a vertex */
    cloth_parameters front = {1.35f, 2.9f, 0.008f, phase}, back = front;
    back.offset = -front.offset;
    es_shape_patch(&shape, cloth_surface, &front, nu, nv, false, false);
    es_shape_patch(&shape, cloth_surface, &back, nu, nv, false, false);
    for (uint32_t edge = 0; edge < 4; edge++) {
        uint32_t n = edge < 2 ? nu : nv;
        static const es_vec3 normals[4] = {{0, 1, 0}, {0, -1, 0}, {0, 0, -1}, {0, 0, 1}};
        for (uint32_t i = 0; i < n; i++) {
            es_vec3 p[4], ignored;
            for (int corner = 0; corner < 4; corner++) {
                float s = (float)(i + (corner == 1 || corner == 2)) / (float)n, fixed = (float)(edge & 1);
                cloth_surface(corner < 2 ? &front : &back, edge < 2 ? s : fixed, edge < 2 ? fixed : s, &p[corner], &ignored);
            }
            es_shape_quad(&shape, p[0], p[1], p[2], p[3], normals[edge]);
        }
    }
    return es_build_mesh(builder, "banner", &shape);
}

/* ---- the shell and what stands in it ----------------------------------------------------------------------------------------------- */

static void add_shell(es_scene_builder* builder, es_material stone, es_material plaster, es_material dark)
{
    const float end = half_length + wall, side = aisle_x + wall;
    es_shape floor = begin(builder);
    es_shape_box(&floor, es_v3(-side, -0.5f, -end), es_v3(side, -0.01f, end));
    es_build_object(builder, "foundation", &floor, dark, es_v3(0, 0, 0));

    es_shape aisles = begin(builder), walls = begin(builder), wainscot = begin(builder), beams = begin(builder);
    for (int s = -1; s <= 1; s += 2) {
        float f = (float)s, inner, outer;
        /* two steps up to the aisle */
        for (int step = 0; step < 2; step++) {
            inner = f * (1.72f + 0.30f * (float)step);
            outer = f * (side - 0.01f);
            es_shape_box(&aisles, es_v3(es_minf(inner, outer), -0.05f, -end + 0.01f), es_v3(es_maxf(inner, outer), 0.15f * (float)(step + 1), end - 0.01f));
        }
        es_shape_box(&walls, es_v3(s < 0 ? -side : aisle_x, -0.5f, -end), es_v3(s < 0 ? -aisle_x : side, 9.6f, end));
        es_shape_box(&walls, es_v3(s < 0 ? -side : 2.75f, aisle_ceiling, -end), es_v3(s < 0 ? -2.75f : side, 9.6f, end));
        float w = f * (aisle_x - 0.05f);
        es_shape_box(&wainscot, es_v3(es_minf(w, f * (side - 0.02f)), 0.2f, -end + 0.02f), es_v3(es_maxf(w, f * (side - 0.02f)), 1.55f, end - 0.02f));
        w = f * (aisle_x - 0.11f);
        es_shape_box(&beams, es_v3(es_minf(w, f * (side - 0.03f)), 1.53f, -end + 0.03f), es_v3(es_maxf(w, f * (side - 0.03f)), 1.65f, end - 0.03f));
        for (int k = 0; k <= BAYS; k++) {
            float z = bay_line(k), x0 = f * 2.5f, x1 = f * (aisle_x + 0.1f);
            es_shape_box(&beams, es_v3(es_minf(x0, x1), aisle_ceiling - 0.42f, z - 0.17f), es_v3(es_maxf(x0, x1), aisle_ceiling + 0.05f, z + 0.17f));
            /* wall pilasters carry them; those of the first and last bay line merge with the end walls */
            x0 = f * (aisle_x - 0.16f);
            es_shape_box(&walls, es_v3(es_minf(x0, x1), 0.2f, z - 0.22f), es_v3(es_maxf(x0, x1), aisle_ceiling - 0.3f, z + 0.22f));
        }
        /* cornice under the vault, in three steps */
        for (int step = 0; step < 3; step++) {
            float reach = 0.04f + 0.07f * (float)step, low = 6.34f + 0.10f * (float)step;
            float a = f * (axis_x - arcade_half - reach), b = f * (axis_x + arcade_half);
            es_shape_box(&beams, es_v3(es_minf(a, b), low, -end + 0.05f), es_v3(es_maxf(a, b), low + (step == 2 ? 0.09f : 0.11f), end - 0.05f));
        }
        /* responds: half piers at the end walls under the last arches */
        for (int e = -1; e <= 1; e += 2) {
            float z0 = (float)e * (half_length - 0.40f), z1 = (float)e * (half_length + 0.1f);
            es_shape_box(&walls, es_v3(f * axis_x - 0.32f, 0.2f, es_minf(z0, z1)), es_v3(f * axis_x + 0.32f, spring + 0.02f, es_maxf(z0, z1)));
        }
    }
    for (int e = -1; e <= 1; e += 2) {
        float z0 = (float)e * half_length, z1 = (float)e * end;
        es_shape_box(&walls, es_v3(-side, -0.5f, es_minf(z0, z1)), es_v3(side, 9.6f, es_maxf(z0, z1)));
    }
    es_shape_box(&walls, es_v3(-side, 9.45f, -end), es_v3(side, 9.8f, end));
    es_build_object(builder, "aisles", &aisles, stone, es_v3(0, 0, 0));
    es_build_object(builder, "walls", &walls, plaster, es_v3(0, 0, 0));
    es_build_object(builder, "beams", &beams, stone, es_v3(0, 0, 0));
    es_material clay = es_build_lambert(builder, "clay", 0.52f, 0.23f, 0.14f);
    es_build_object(builder, "wainscot", &wainscot, clay, es_v3(0, 0, 0));
}

/* A chequer of marble slabs on the foundation. */
static void add_floor(es_scene_builder* builder)
{
    enum { ACROSS = 8, ALONG = 60 };
    const float width = 2 * 1.74f / (float)ACROSS, length = 2 * half_length / (float)ALONG;
    es_shape slabs[2] = {begin(builder), begin(builder)};
    for (int j = 0; j < ALONG; j++)
        for (int i = 0; i < ACROSS; i++) {
            es_vec3 low = es_v3(-1.74f + width * (float)i, 0, -half_length + length * (float)j);
            es_shape_plane(&slabs[(i + j) & 1], low, es_v3(width, 0, 0), es_v3(0, 0, length), es_v3(0, 1, 0), 1, 1);
        }
    es_material_desc marble = es_default_material_desc();
    marble.roughness = 0.35f;
    marble.specular = 1.0f;
    for (int c = 0; c < 3; c++) marble.base_color[c] = (const float[3]){0.74f, 0.71f, 0.64f}[c];
    es_material light = es_build_material(builder, "light marble", &marble);
    for (int c = 0; c < 3; c++) marble.base_color[c] = (const float[3]){0.30f, 0.17f, 0.13f}[c];
    es_material dark = es_build_material(builder, "dark marble", &marble);
    es_build_object(builder, "light slabs", &slabs[0], light, es_v3(0, 0, 0));
    es_build_object(builder, "dark slabs", &slabs[1], dark, es_v3(0, 0, 0));
}

/* At the far end: three steps, a pedestal with an urn, a gilt disc on the wall behind it. */
static void add_far_end(es_scene_builder* builder, const detail* d, es_material stone)
{
    uint32_t round = steps(d, 56, 12);
    es_shape dais = begin(builder);
    for (int step = 0; step < 3; step++) {
        float reach = 0.4f * (float)step;
        es_shape_box(&dais, es_v3(-1.95f + reach, -0.02f, -half_length - 0.1f), es_v3(1.95f - reach, 0.15f * (float)(step + 1), -half_length + 3.4f - reach));
    }
    es_shape_box(&dais, es_v3(-0.5f, 0.4f, -half_length + 0.9f), es_v3(0.5f, 0.58f, -half_length + 1.9f));
    es_shape_box(&dais, es_v3(-0.40f, 0.57f, -half_length + 1.0f), es_v3(0.40f, 1.30f, -half_length + 1.8f));
    es_shape_box(&dais, es_v3(-0.48f, 1.29f, -half_length + 0.92f), es_v3(0.48f, 1.42f, -half_length + 1.88f));
    es_build_object(builder, "dais", &dais, stone, es_v3(0, 0, 0));

    es_material_desc bronze = es_default_material_desc();
    for (int c = 0; c < 3; c++) bronze.base_color[c] = (const float[3]){0.95f, 0.68f, 0.32f}[c];
    bronze.metallic = 1;
    bronze.roughness = 0.35f;
    es_material gilt = es_build_material(builder, "gilt bronze", &bronze);
    static const es_vec2 outline[] = {{0, 0}, {0.20f, 0}, {0.20f, 0.04f}, {0.10f, 0.10f}, {0.07f, 0.18f}, {0.12f, 0.22f}, {0.24f, 0.30f}, {0.335f, 0.42f}, {0.38f, 0.56f},
        {0.385f, 0.68f}, {0.35f, 0.82f}, {0.27f, 0.93f}, {0.19f, 0.99f}, {0.17f, 1.05f}, {0.21f, 1.12f}, {0.27f, 1.16f}, {0.27f, 1.19f}, {0.23f, 1.19f}, {0.15f, 1.06f}, {0, 1.0f}};
    es_shape urn = begin(builder);
    es_shape_lathe(&urn, es_v3(0, 1.41f, -half_length + 1.4f), outline, sizeof outline / sizeof outline[0], round);
    es_build_object(builder, "urn", &urn, gilt, es_v3(0, 0, 0));

    es_shape disc = begin(builder);
    es_shape_torus(&disc, es_v3(0, 0, 0), 1.0f, 0.09f, 0.5f * ES_PI, round, steps(d, 10, 4));
    es_shape_torus(&disc, es_v3(0, 0, 0), 0.62f, 0.05f, 0.5f * ES_PI, round, steps(d, 8, 4));
    for (int ray = 0; ray < 16; ray++) {
        float a = turn * (float)ray / 16.0f, r = ray & 1 ? 0.74f : 0.86f;
        es_shape_sphere(&disc, es_v3(r * es_cos(a), r * es_sin(a), 0.02f), 0.055f, steps(d, 10, 5), steps(d, 6, 3));
    }
    es_shape_sphere(&disc, es_v3(0, 0, 0), 0.34f, steps(d, 32, 8), steps(d, 16, 5));
    es_build_object(builder, "disc", &disc, gilt, es_v3(0, 5.1f, -half_length + 0.05f));
}

/* From high in the right aisle across the nave; the aim wanders along the hall and back. */
static void spot_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(4.9f, 5.0f, 9.0f);
    es_vec3 target = es_v3(-2.4f, 1.1f + 0.4f * es_cos(turn * phase), 3.6f + 2.6f * es_sin(turn * phase));
    *rotation = es_look_rotation(es_v3_sub(target, *translation));
}

void es_build_hall(es_scene_builder* builder, uint32_t triangles)
{
    /* boxes and slabs stay as they are; everything curved is scaled */
    float scaled = es_maxf((float)triangles - (float)FIXED_TRIANGLES, 1000.0f);
    detail d = {triangles ? es_sqrt(scaled / (float)SCALED_TRIANGLES) : 1.0f};
    es_material stone = es_build_lambert(builder, "limestone", 0.70f, 0.64f, 0.54f);
    es_material plaster = es_build_lambert(builder, "plaster", 0.78f, 0.73f, 0.64f);
    es_material dark = es_build_lambert(builder, "mortar", 0.30f, 0.27f, 0.24f);
    es_material vault_paint = es_build_lambert(builder, "vault", 0.72f, 0.70f, 0.66f);
    add_shell(builder, stone, plaster, dark);
    add_floor(builder);
    add_far_end(builder, &d, stone);

    es_mesh column = build_column(builder, &d), arch = build_arch(builder, &d), vault = build_vault(builder, &d);
    es_build_instance(builder, es_build_node(builder, "vault", es_v3(0, 0, 0), es_quat_identity()), vault, vault_paint);
    for (int side = -1; side <= 1; side += 2)
        for (int k = 0; k <= BAYS; k++) {
            float x = axis_x * (float)side;
            if (k > 0 && k < BAYS) es_build_instance(builder, es_build_node(builder, "column", es_v3(x, 0, bay_line(k)), es_quat_identity()), column, stone);
            if (k < BAYS) es_build_instance(builder, es_build_node(builder, "arch", es_v3(x, 0, bay_line(k) + 0.5f * bay), es_quat_identity()), arch, plaster);
        }

    const es_material dyes[3] = {es_build_lambert(builder, "madder red", 0.60f, 0.05f, 0.04f), es_build_lambert(builder, "woad blue", 0.06f, 0.13f, 0.42f),
        es_build_lambert(builder, "weld yellow", 0.72f, 0.47f, 0.08f)};
    for (int k = 1; k < BAYS - 1; k++) {
        es_mesh banner = build_banner(builder, &d, 1.7f * (float)k);
        es_build_instance(builder, es_build_node(builder, "banner", es_v3(-axis_x, 5.55f, bay_line(k) + 0.5f * bay), es_quat_identity()), banner, dyes[k % 3]);
    }
    es_shape rods = begin(builder);
    for (int k = 1; k < BAYS - 1; k++) {
        float z = bay_line(k) + 0.5f * bay;
        es_shape_box(&rods, es_v3(-axis_x - 0.025f, 5.53f, z - 0.9f), es_v3(-axis_x + 0.025f, 5.58f, z + 0.9f));
    }
    es_build_object(builder, "rods", &rods, dark, es_v3(0, 0, 0));
}

es_result es_scene_hall(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    es_build_hall(&builder, triangles);
    es_build_camera(&builder, es_v3(0.55f, 1.75f, 11.6f), es_v3(-0.09f, 0.13f, -1), 1.02f, 0.1f);
    es_node spot = es_build_spot(&builder, es_v3(4.9f, 5.0f, 9.0f), es_v3(-1, -1, -1), (const float[3]){1.0f, 0.90f, 0.74f}, 1200.0f, 0.30f, 0.48f);
    es_build_clip(&builder, "light", PERIOD, KEYS, &(es_motion){spot, spot_pose}, 1);
    return builder.result;
}
