/* Hulls that are not searched for: boxes; moving and freeing them. */
#include "sim/rigid/hull.h"

#include "sim/rigid/frame.h"

static size_t bytes_of(uint32_t vertices, uint32_t faces, uint32_t half_edges)
{
    return vertices * sizeof(es_vec3) + faces * (sizeof(es_plane) + sizeof(uint16_t)) + half_edges * sizeof(es_half_edge);
}

bool es_hull_allocate(es_context* context, uint32_t vertices, uint32_t faces, uint32_t half_edges, es_hull* hull)
{
    *hull = (es_hull){0};
    char* block = es_allocate_zero(context, bytes_of(vertices, faces, half_edges));
    if (!block) return false;
    hull->vertex_count = vertices;
    hull->face_count = faces;
    hull->half_edge_count = half_edges;
    hull->vertices = (es_vec3*)block;
    hull->planes = (es_plane*)(hull->vertices + vertices);
    hull->half_edges = (es_half_edge*)(hull->planes + faces);
    hull->first = (uint16_t*)(hull->half_edges + half_edges);
    return true;
}

void es_hull_free(es_context* context, es_hull* hull)
{
    es_release(context, hull->vertices, bytes_of(hull->vertex_count, hull->face_count, hull->half_edge_count));
    *hull = (es_hull){0};
}

/* Vertex i has +x where bit 0 is set, +y where bit 1, +z where bit 2. Face 2 k + s looks along axis k, backwards for s = 0. */
es_result es_hull_box(es_context* context, es_vec3 centre, es_quat rotation, es_vec3 h, es_hull* hull)
{
    static const uint8_t loops[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    if (!es_hull_allocate(context, 8, 6, 24, hull)) return ES_OUT_OF_MEMORY;
    es_mat3 m = es_mat3_from_quat(rotation);
    for (uint32_t i = 0; i < 8; i++) {
        es_vec3 v = es_v3(i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z);
        hull->vertices[i] = es_v3_add(centre, es_mat3_mul(&m, v));
    }
    uint32_t edge_count = 0;
    uint8_t number[8][8]; /* of the half edge from one vertex to another */
    for (uint32_t face = 0; face < 6; face++)
        for (uint32_t k = 0; k < 4; k++) {
            uint32_t from = loops[face][k], to = loops[face][(k + 1) % 4];
            if (from < to) { /* both directions are met once, in different faces */
                number[from][to] = (uint8_t)edge_count;
                number[to][from] = (uint8_t)(edge_count + 1);
                edge_count += 2;
            }
        }
    for (uint32_t face = 0; face < 6; face++) {
        es_vec3 axis = face / 2 == 0 ? m.x : face / 2 == 1 ? m.y : m.z;
        es_vec3 normal = es_v3_normalize(face & 1 ? axis : es_v3_neg(axis), es_v3(0, 1, 0));
        hull->planes[face] = (es_plane){normal, es_v3_dot(normal, hull->vertices[loops[face][0]])};
        hull->first[face] = number[loops[face][0]][loops[face][1]];
        for (uint32_t k = 0; k < 4; k++) {
            uint32_t a = loops[face][k], b = loops[face][(k + 1) % 4], c = loops[face][(k + 2) % 4];
            hull->half_edges[number[a][b]] = (es_half_edge){(uint8_t)a, (uint8_t)face, number[b][c]};
        }
    }
    hull->centre = centre;
    return ES_OK;
}

void es_hull_place(es_hull* hull, es_vec3 position, es_quat rotation)
{
    es_mat3 m = es_mat3_from_quat(rotation);
    for (uint32_t i = 0; i < hull->vertex_count; i++) hull->vertices[i] = es_v3_add(position, es_mat3_mul(&m, hull->vertices[i]));
    for (uint32_t i = 0; i < hull->face_count; i++) {
        es_plane* plane = &hull->planes[i];
        plane->normal = es_v3_normalize(es_mat3_mul(&m, plane->normal), es_v3(0, 1, 0));
        plane->offset = -3e38f; /* the face's outermost corner, so that rounding puts none outside */
        uint32_t edge = hull->first[i];
        do {
            plane->offset = es_maxf(plane->offset, es_v3_dot(plane->normal, hull->vertices[hull->half_edges[edge].origin]));
            edge = hull->half_edges[edge].next;
        } while (edge != hull->first[i]);
    }
    hull->centre = es_v3_add(position, es_mat3_mul(&m, hull->centre));
}
