#include "gi/reflections/map_faces.h"

#include <string.h>

#include "gi/background.h"
#include "gi/lit.h"
#include "gi/reflections/found_light.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/view_content.h"

enum { FACE_PLANES = ES_GBUFFER_DEPTH | ES_GBUFFER_NORMAL | ES_GBUFFER_GEOMETRIC_NORMAL | ES_GBUFFER_ALBEDO | ES_GBUFFER_SURFACE | ES_GBUFFER_EMISSION | ES_GBUFFER_INSTANCE };

/* ---- memory -------------------------------------------------------------------------------------------------------------------- */

void es_reflecting_buffers_free(es_context* context, es_reflecting_buffers* b)
{
    es_planes_free(context, &b->direction);
    es_planes_free(context, &b->albedo);
    es_release(context, b->planes.map, b->pixels * sizeof *b->planes.map);
    es_release(context, b->planes.alpha, b->pixels * sizeof *b->planes.alpha);
    es_release(context, b->planes.any, b->chunks);
    *b = (es_reflecting_buffers){0};
}

es_result es_reflecting_buffers_resize(es_context* context, es_reflecting_buffers* b, const es_gbuffer* g)
{
    const size_t pixels = (size_t)g->stride * g->height, chunks = (size_t)es_lit_chunks(g->stride) * g->height;
    if (b->pixels == pixels && b->chunks == chunks) return ES_OK;
    es_reflecting_buffers_free(context, b);
    es_result result = es_planes_resize(context, &b->direction, g);
    if (!result) result = es_planes_resize(context, &b->albedo, g);
    if (result) return result;
    b->pixels = pixels;
    b->chunks = chunks;
    const bool all = (b->planes.map = es_allocate_zero(context, pixels * sizeof *b->planes.map)) && (b->planes.alpha = es_allocate_zero(context, pixels * sizeof *b->planes.alpha)) &&
        (b->planes.any = es_allocate_zero(context, chunks));
    if (!all) {
        es_reflecting_buffers_free(context, b);
        return es_context_last_result(context);
    }
    for (int k = 0; k < 3; k++) {
        b->planes.direction[k] = b->direction.at[k];
        b->planes.albedo[k] = b->albedo.at[k];
    }
    return ES_OK;
}

void es_second_reflections_free(es_context* context, es_second_reflections* s)
{
    es_release(context, s->memory, s->bytes);
    *s = (es_second_reflections){0};
}

enum { SECOND_WORDS = 2 + 3 * 5 + 1 };

/* Room for `count`, a multiple of eight; what is there stays. */
static es_result reserve_second(es_context* context, es_second_reflections* s, uint32_t count)
{
    if (count <= s->capacity) return ES_OK;
    const uint32_t capacity = count > 2 * s->capacity ? count : 2 * s->capacity;
    const size_t bytes = (size_t)capacity * SECOND_WORDS * sizeof(float);
    float* memory = es_allocate(context, bytes);
    if (!memory) return es_context_last_result(context);
    for (uint32_t i = 0; i < SECOND_WORDS && s->count; i++) memcpy(memory + (size_t)i * capacity, (float*)s->memory + (size_t)i * s->capacity, s->count * sizeof(float));
    es_release(context, s->memory, s->bytes);
    s->memory = memory;
    s->bytes = bytes;
    s->capacity = capacity;
    float* at = memory;
    s->texel = (int32_t*)at;
    s->map = (int32_t*)(at += capacity);
    s->alpha = at += capacity;
    float** const of[] = {s->position, s->direction, s->albedo, s->base, s->seen};
    for (size_t i = 0; i < 5; i++)
        for (int k = 0; k < 3; k++) of[i][k] = at += capacity;
    return ES_OK;
}

/* ---- what a map sees ----------------------------------------------------------------------------------------------------------------- */

static bool list_others(es_renderer* r, const es_frame_inputs* in, const es_reflection_map* map)
{
    es_reflections* f = &r->reflections;
    const es_draw_list* list = in->list;
    if (!es_grow(r->context, (void**)&f->instances, &f->instance_capacity, 0, list->instance_count, sizeof *f->instances)) return false;
    const uint32_t place = map->place, after = list->instance_count - place - 1;
    memcpy(f->instances, list->instances, place * sizeof *f->instances);
    memcpy(f->instances + place, list->instances + place + 1, after * sizeof *f->instances);
    f->others = (es_draw_list){f->instances, list->materials, list->instance_count - 1, list->material_count};
    return true;
}

uint64_t es_reflection_content(es_renderer* r, const es_frame_inputs* in, const es_reflection_map* map)
{
    es_raster_view views[6];
    if (!list_others(r, in, map)) return 0;
    es_cube_views(r->settings.reflection_size, map->centre, map->near_plane, views);
    uint64_t hash = 0;
    for (int i = 0; i < 6; i++) {
        const uint64_t of_face[2] = {es_view_pose_hash(&views[i]), es_view_content_hash(&r->reflections.others, &views[i])};
        hash = es_hash_bytes(hash, of_face, sizeof of_face);
    }
    return hash | 1;
}

/* ---- its light -------------------------------------------------------------------------------------------------------------------------- */

static es_result light_face(es_renderer* r, const es_frame_inputs* in, const es_pixel_rays* rays)
{
    es_reflections* f = &r->reflections;
    es_found_surfaces of = {.gbuffer = &f->face, .rays = *rays, .mirrors = f->on_face.planes.map};
    es_result result = es_planes_resize(r->context, &f->radiance, &f->face);
    if (!result && in->has_environment) result = es_planes_resize(r->context, &f->background, &f->face);
    if (result) return result;
    const es_background_job behind = {.gbuffer = &f->face, .rays = *rays, .environment = &in->environment, .out = {f->background.at[0], f->background.at[1], f->background.at[2]}};
    if (in->has_environment) es_background_fill(r->context, &behind);
    for (int k = 0; k < 3; k++) {
        if (in->has_environment) of.background[k] = f->background.at[k];
        of.radiance[k] = f->radiance.at[k];
    }
    return es_light_found(r, in, &of, &f->face_light);
}

/* ---- drawing ------------------------------------------------------------------------------------------------------------------------------- */

/* Texels of the face that reflect, to the map's list. `first`: the face's first texel in the map. */
static es_result list_second(es_renderer* r, es_reflection_map* map, const es_pixel_rays* rays, int32_t first)
{
    const es_reflections* f = &r->reflections;
    const es_reflecting_planes* p = &f->on_face.planes;
    const es_gbuffer* g = &f->face;
    es_second_reflections* s = &map->second;
    const uint32_t chunks = es_lit_chunks(g->stride);
    for (uint32_t y = 0; y < g->height; y++)
        for (uint32_t c = 0; c < chunks; c++) {
            if (!(p->any[(size_t)y * chunks + c] & 1)) continue;
            es_result result = reserve_second(r->context, s, (s->count + ES_LIT_COLUMNS + 7) / 8 * 8);
            if (result) return result;
            for (uint32_t x = c * ES_LIT_COLUMNS; x < g->width && x < (c + 1) * ES_LIT_COLUMNS; x++) {
                const size_t at = (size_t)y * g->stride + x;
                if (!p->map[at]) continue;
                const uint32_t i = s->count++;
                const es_vec3 position = es_pixel_rays_position(rays, (float)x, (float)y, g->depth[at]);
                const float place[3] = {position.x, position.y, position.z};
                s->texel[i] = first + (int32_t)((y + 1) * (g->width + 2) + x + 1);
                s->map[i] = (int32_t)p->map[at] - 1;
                s->alpha[i] = p->alpha[at];
                for (int k = 0; k < 3; k++) {
                    s->position[k][i] = place[k];
                    s->direction[k][i] = p->direction[k][at];
                    s->albedo[k][i] = p->albedo[k][at];
                }
            }
        }
    return ES_OK;
}

static float* map_texels(const es_reflections* f, uint32_t map) { return f->texels + 4 * (size_t)map * (size_t)f->layout.texels; }

/* The list's last eight are filled up with what reflects nothing; what its texels show without is noted. */
static es_result close_second(es_context* context, const float* texels, es_second_reflections* s)
{
    const uint32_t end = (s->count + 7) / 8 * 8;
    es_result result = reserve_second(context, s, end);
    if (result) return result;
    for (uint32_t i = s->count; i < end; i++) {
        s->texel[i] = 0;
        s->map[i] = -1;
        s->alpha[i] = 0.0f;
        for (int k = 0; k < 3; k++) s->position[k][i] = s->direction[k][i] = s->albedo[k][i] = 0.0f;
    }
    for (uint32_t i = 0; i < s->count; i++)
        for (int k = 0; k < 3; k++) s->base[k][i] = texels[4 * (size_t)s->texel[i] + (size_t)k];
    return ES_OK;
}

es_result es_reflection_draw(es_renderer* r, const es_frame_inputs* in, uint32_t which, uint64_t* triangles)
{
    es_reflections* f = &r->reflections;
    es_reflection_map* map = &f->maps[which];
    const uint32_t size = f->layout.size;
    es_raster_view views[6];
    if (!list_others(r, in, map)) return es_context_last_result(r->context);
    es_result result = f->face.memory ? ES_OK : es_gbuffer_create(r->context, size, size, FACE_PLANES, &f->face);
    if (!result) result = es_reflecting_buffers_resize(r->context, &f->on_face, &f->face);
    es_cube_views(size, map->centre, map->near_plane, views);
    map->drawn = 0;
    map->second.count = 0;
    float* texels = map_texels(f, which);
    for (int32_t i = 0; i < 6 && !result; i++) {
        const es_pixel_rays rays = es_pixel_rays_of_view(&views[i]);
        const int32_t first = i * (int32_t)((size + 2) * (size + 2));
        es_raster_stats stats = {0};
        result = es_draw_gbuffer(r->rasterizer, &f->others, &views[i], &f->face, &stats);
        if (result) return result;
        *triangles += stats.triangles;
        const es_reflecting_job reflecting = {.gbuffer = &f->face, .rays = rays, .map_of = f->map_of, .roughness = r->settings.reflection_roughness, .lobes = &es_lobe_albedos, .out = f->on_face.planes};
        es_reflecting_find(r->context, &reflecting);
        result = light_face(r, in, &rays);
        if (!result) result = list_second(r, map, &rays, first);
        if (result) return result;
        const es_reflection_face_job job = {.radiance = {f->radiance.at[0], f->radiance.at[1], f->radiance.at[2]}, .depth = f->face.depth, .size = size, .stride = f->face.stride, .out = texels + 4 * (size_t)first};
        es_reflection_face(r->context, &job);
    }
    return result ? result : close_second(r->context, texels, &map->second);
}

/* ---- second reflections ---------------------------------------------------------------------------------------------------------------------- */

typedef struct ask_loop { es_context* context; const es_reflection_atlas* atlas; const es_second_reflections* second; } ask_loop;

static void ask_range(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const ask_loop* loop = user;
    const es_second_reflections* s = loop->second;
    const uint32_t first = 8 * begin;
    es_reflection_question q = {.map = s->map + first, .alpha = s->alpha + first, .count = 8 * (end - begin)};
    for (int k = 0; k < 3; k++) {
        q.position[k] = s->position[k] + first;
        q.direction[k] = s->direction[k] + first;
        q.radiance[k] = s->seen[k] + first;
    }
    es_reflection_ask(loop->context, loop->atlas, &q);
}

/* What its texels show, with what they reflect or without. */
static void put_second(float* texels, const es_second_reflections* s, bool with)
{
    for (uint32_t i = 0; i < s->count; i++)
        for (int k = 0; k < 3; k++) texels[4 * (size_t)s->texel[i] + (size_t)k] = with ? s->base[k][i] + s->albedo[k][i] * s->seen[k][i] : s->base[k][i];
}

static es_result finish(es_renderer* r, uint32_t map, uint32_t last_level)
{
    es_reflections* f = &r->reflections;
    return es_reflection_map_finish(r->context, &f->layout, map_texels(f, map), last_level < f->maps[map].last_level ? last_level : f->maps[map].last_level);
}

es_result es_reflection_finish_all(es_renderer* r)
{
    es_reflections* f = &r->reflections;
    bool any = false;
    for (uint32_t i = 0; i < f->map_count; i++) any |= f->maps[i].wanted && f->maps[i].second.count;
    es_result result = ES_OK;
    if (any) {
        for (uint32_t i = 0; i < f->map_count && !result; i++) {
            if (!f->maps[i].wanted) continue;
            put_second(map_texels(f, i), &f->maps[i].second, false);
            result = finish(r, i, 1);
        }
        float last[ES_REFLECTION_MOST_MAPS];
        for (uint32_t i = 0; i < f->map_count; i++) last[i] = es_minf(f->last_level[i], 1.0f);
        const es_reflection_atlas atlas = {f->texels, f->layout, {f->centre[0], f->centre[1], f->centre[2]}, last};
        for (uint32_t i = 0; i < f->map_count && !result; i++) {
            if (!f->maps[i].wanted || !f->maps[i].second.count) continue;
            ask_loop loop = {r->context, &atlas, &f->maps[i].second};
            es_parallel_for(r->context, (f->maps[i].second.count + 7) / 8, 64, ask_range, &loop);
        }
    }
    for (uint32_t i = 0; i < f->map_count && !result; i++) {
        if (!f->maps[i].wanted) continue;
        if (any) put_second(map_texels(f, i), &f->maps[i].second, true);
        result = finish(r, i, ES_REFLECTION_LEVELS);
    }
    return result;
}
