#include "gi/classic.h"

#include "platform/maths.h"
#include "raster/points.h"

enum { FACES = 5 };

/* At the map's centre a texel spans 4 / size radians, at its border 2 / size along the radius; a cube face of f texels has
 * 2 / f at its centre and half of that in its corners' direction. With f = 2 size every texel of the map has two or more of a face
 * across, up to maps of 512; larger ones come close to one. */
static uint32_t face_size(uint32_t size) { return 2 * size > 1024 ? 1024 : 2 * size; }

size_t es_classic_scratch_floats(uint32_t size) { return (size_t)FACES * face_size(size) * face_size(size); }

es_result es_classic_map_draw(es_rasterizer* rasterizer, const es_draw_list* list, const es_vpl_record* vpl, uint32_t size, float near_distance, float far_distance, float* scratch, uint16_t* map)
{
    es_vec3 position = es_v3(vpl->position[0], vpl->position[1], vpl->position[2]);
    es_vec3 n = es_v3(vpl->normal[0], vpl->normal[1], vpl->normal[2]), t = es_v3(vpl->tangent[0], vpl->tangent[1], vpl->tangent[2]), b = es_v3(vpl->bitangent[0], vpl->bitangent[1], vpl->bitangent[2]);
    const es_vec3 forward[FACES] = {n, t, es_v3_scale(t, -1.0f), b, es_v3_scale(b, -1.0f)};
    uint32_t side = face_size(size);
    es_mat4 to_clip[FACES];
    /* Depth must be cut closer than the nearest distance that counts, at a cube's corner 1/√3 of it. */
    float near_plane = near_distance * 0.5f;
    for (int f = 0; f < FACES; f++) {
        es_raster_view view = es_perspective_view(side, side, position, forward[f], f == 0 ? t : n, 0.5f * ES_PI, near_plane);
        view.cull = ES_CULL_NONE;
        to_clip[f] = es_mat4_mul(view.projection, view.view);
        es_result result = es_draw_depth(rasterizer, list, &view, scratch + (size_t)f * side * side, side, NULL);
        if (result) return result;
    }
    float scale = (float)ES_PARABOLIC_DEPTH_MAX / far_distance;
    for (uint32_t y = 0; y < size; y++)
        for (uint32_t x = 0; x < size; x++) {
            float u = ((float)x + 0.5f) * (2.0f / (float)size) - 1.0f, v = ((float)y + 0.5f) * (2.0f / (float)size) - 1.0f, q = u * u + v * v;
            uint16_t stored = ES_PARABOLIC_EMPTY;
            if (q < 1.0f) {
                /* (u, v) = (x, y) / (1 + z) of a unit direction, inverted */
                float s = 2.0f / (1.0f + q), qx = u * s, qy = v * s, qz = s - 1.0f;
                int face = 0;
                float major = qz;
                const float others[4] = {qx, -qx, qy, -qy};
                for (int f = 0; f < 4; f++)
                    if (others[f] > major) {
                        major = others[f];
                        face = f + 1;
                    }
                es_vec3 d = es_v3_add(es_v3_add(es_v3_scale(t, qx), es_v3_scale(b, qy)), es_v3_scale(n, qz));
                /* the light itself is at the centre of projection: of a point in this direction only the direction matters */
                es_vec4 clip = es_mat4_vec4(&to_clip[face], (es_vec4){d.x, d.y, d.z, 0.0f});
                float px = es_clampf((clip.x / clip.w * 0.5f + 0.5f) * (float)side, 0.0f, (float)(side - 1));
                float py = es_clampf((0.5f - clip.y / clip.w * 0.5f) * (float)side, 0.0f, (float)(side - 1));
                float depth = scratch[(size_t)face * side * side + (size_t)(uint32_t)py * side + (uint32_t)px];
                if (depth > 0.0f) {
                    float r = near_plane / depth / major;
                    if (r >= near_distance && r <= far_distance) stored = (uint16_t)(r * scale + 0.5f);
                }
            }
            map[(size_t)y * size + x] = stored;
        }
    return ES_OK;
}
