/* Rectangles, discs and spheres that glow, made of what worlds have: a mesh, a material, an instance. */
#include "sim/world.h"

#include "platform/context.h"
#include "platform/maths.h"

/* Of a disc: rings of quadrilaterals about triangles. Of a sphere: rows from pole to pole. */
enum { SIDES = 48, RINGS = 6, ROWS = 24, MOST_VERTICES = (ROWS + 1) * (SIDES + 1), MOST_TRIANGLES = 2 * ROWS * SIDES };

typedef struct area_mesh {
    float positions[3 * MOST_VERTICES], normals[3 * MOST_VERTICES], uvs[2 * MOST_VERTICES];
    uint32_t indices[3 * MOST_TRIANGLES], vertex_count, triangle_count;
} area_mesh;

es_area_light_desc es_default_area_light_desc(void) { return (es_area_light_desc){.size = {1, 1}, .color = {1, 1, 1}, .radiance = 10}; }

static void add_vertex(area_mesh* m, es_vec3 position, es_vec3 normal, float u, float v)
{
    const uint32_t i = m->vertex_count++;
    const float p[3] = {position.x, position.y, position.z}, n[3] = {normal.x, normal.y, normal.z};
    for (int k = 0; k < 3; k++) {
        m->positions[3 * i + (uint32_t)k] = p[k];
        m->normals[3 * i + (uint32_t)k] = n[k];
    }
    m->uvs[2 * i] = u;
    m->uvs[2 * i + 1] = v;
}

static void add_triangle(area_mesh* m, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t* index = m->indices + 3 * (size_t)m->triangle_count++;
    index[0] = a;
    index[1] = b;
    index[2] = c;
}

/* At (x, y) of a unit square or disc about the origin; who looks along +z, at what shines along -z, has +x to the left. */
static void add_flat_vertex(area_mesh* m, float x, float y, const float size[2])
{
    add_vertex(m, es_v3(0.5f * x * size[0], 0.5f * y * size[1], 0), es_v3(0, 0, -1), 0.5f - 0.5f * x, 0.5f - 0.5f * y);
}

static void make_rectangle(area_mesh* m, const float size[2])
{
    static const float corners[4][2] = {{-1, -1}, {-1, 1}, {1, 1}, {1, -1}};
    for (int k = 0; k < 4; k++) add_flat_vertex(m, corners[k][0], corners[k][1], size);
    add_triangle(m, 0, 1, 2);
    add_triangle(m, 0, 2, 3);
}

static void make_disc(area_mesh* m, const float size[2])
{
    /* the polygon has the disc's area */
    const float angle = 2.0f * ES_PI / SIDES, reach = es_sqrt(angle / es_sin(angle));
    add_flat_vertex(m, 0, 0, size);
    for (uint32_t ring = 1; ring <= RINGS; ring++)
        for (uint32_t k = 0; k < SIDES; k++) {
            const float r = reach * (float)ring / RINGS;
            add_flat_vertex(m, r * es_cos(angle * (float)k), r * es_sin(angle * (float)k), size);
        }
    for (uint32_t ring = 0; ring < RINGS; ring++)
        for (uint32_t k = 0; k < SIDES; k++) {
            const uint32_t next = (k + 1) % SIDES, inner = 1 + (ring - 1) * SIDES, outer = 1 + ring * SIDES;
            if (ring == 0) {
                add_triangle(m, 0, outer + next, outer + k);
                continue;
            }
            add_triangle(m, inner + k, outer + next, outer + k);
            add_triangle(m, inner + k, inner + next, outer + next);
        }
}

static float area_of(const area_mesh* m)
{
    float sum = 0.0f;
    for (uint32_t t = 0; t < m->triangle_count; t++) {
        es_vec3 c[3];
        for (int k = 0; k < 3; k++) {
            const float* p = m->positions + 3 * (size_t)m->indices[3 * t + (uint32_t)k];
            c[k] = es_v3(p[0], p[1], p[2]);
        }
        sum += 0.5f * es_v3_length(es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0])));
    }
    return sum;
}

static void make_sphere(area_mesh* m, float radius)
{
    for (uint32_t row = 0; row <= ROWS; row++)
        for (uint32_t k = 0; k <= SIDES; k++) {
            const float u = (float)k / SIDES, v = (float)row / ROWS, sine = row == ROWS ? 0.0f : es_sin(ES_PI * v), a = k == SIDES ? 0.0f : 2.0f * ES_PI * u;
            const es_vec3 n = es_v3(sine * es_cos(a), es_cos(ES_PI * v), -sine * es_sin(a));
            add_vertex(m, n, n, u, v);
        }
    for (uint32_t row = 0; row < ROWS; row++)
        for (uint32_t k = 0; k < SIDES; k++) {
            const uint32_t a = row * (SIDES + 1) + k, b = a + SIDES + 1;
            if (row + 1 < ROWS) add_triangle(m, a, b, b + 1);
            if (row) add_triangle(m, a, b + 1, a + 1);
        }
    const float scale = radius * es_sqrt(4.0f * ES_PI / area_of(m));
    for (uint32_t i = 0; i < 3 * m->vertex_count; i++) m->positions[i] *= scale;
}

static bool good(float a) { return a >= 0.0f && a <= 1e9f; }

static const char* what_is_wrong(const es_area_light_desc* d)
{
    if (d->shape > ES_AREA_SPHERE) return "its shape is none of rectangle, disc and sphere";
    const bool round = d->shape == ES_AREA_SPHERE;
    if (!(d->size[0] >= 1e-6f && d->size[0] <= 1e6f) || (!round && !(d->size[1] >= 1e-6f && d->size[1] <= 1e6f))) return "its size must lie in 1e-6 … 1e6 m";
    if (!good(d->color[0]) || !good(d->color[1]) || !good(d->color[2])) return "its colour must lie in 0 … 1e9";
    return good(d->radiance) && good(d->flux) ? NULL : "its radiance and flux must lie in 0 … 1e9";
}

es_result es_world_add_area_light(es_world* world, const es_area_light_desc* desc, es_area_light* light)
{
    es_context* context = es_world_context(world);
    if (!desc || !light) return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_add_area_light: desc and light must not be NULL");
    *light = (es_area_light){0};
    const char* wrong = what_is_wrong(desc);
    if (wrong) return es_misuse(context, ES_INVALID_ARGUMENT, "area light \"%s\": %s", desc->name ? desc->name : "", wrong);
    area_mesh* m = es_allocate(context, sizeof *m);
    if (!m) return es_context_last_result(context);
    m->vertex_count = m->triangle_count = 0;
    if (desc->shape == ES_AREA_RECTANGLE) make_rectangle(m, desc->size);
    else if (desc->shape == ES_AREA_DISC) make_disc(m, desc->size);
    else make_sphere(m, 0.5f * desc->size[0]);

    const bool both = desc->two_sided && desc->shape != ES_AREA_SPHERE;
    const float radiance = desc->radiance > 0.0f ? desc->radiance : desc->flux / (ES_PI * area_of(m) * (both ? 2.0f : 1.0f));
    es_material_desc material = es_default_material_desc();
    material.specular = 0.0f;
    material.double_sided = both;
    material.emission_texture = desc->texture;
    for (int k = 0; k < 3; k++) {
        material.base_color[k] = 0.0f;
        material.emission[k] = desc->color[k] * radiance;
    }
    const es_mesh_desc mesh = {.name = desc->name, .vertex_count = m->vertex_count, .triangle_count = m->triangle_count, .positions = m->positions, .normals = m->normals, .uv0 = m->uvs, .indices = m->indices};
    es_area_light made = {0};
    es_result result = es_world_add_mesh(world, &mesh, &made.mesh);
    if (!result) result = es_world_add_material(world, desc->name, &material, &made.material);
    if (!result) result = es_world_add_instance(world, &(es_instance_desc){.node = desc->node, .mesh = made.mesh, .material = made.material}, &made.instance);
    es_release(context, m, sizeof *m);
    if (!result) {
        *light = made;
        return ES_OK;
    }
    if (made.material.id) es_world_destroy_material(world, made.material);
    if (made.mesh.id) es_world_destroy_mesh(world, made.mesh);
    return result;
}

es_result es_world_destroy_area_light(es_world* world, const es_area_light* light)
{
    es_result result = es_world_destroy_instance(world, light->instance);
    if (!result) result = es_world_destroy_material(world, light->material);
    return result ? result : es_world_destroy_mesh(world, light->mesh);
}
