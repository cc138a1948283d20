#include "gi/stable_vpls.h"

#include <string.h>

#include "gi/light_change.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"

enum { GRID_MAX = 64 };

/* Of one light, while the frame's set is made. */
typedef struct light_work {
    const es_light_view* view;
    const es_importance* importance;
    float total;                   /* importance */
    uint32_t side;                 /* of its grid; one grid a face */
    float *target, *mass;          /* smoothed: what importance asks for and what there is, each of sum 1 where anything is */
    float* cells;                  /* before smoothing */
    uint32_t wanted, owned, seen;  /* places; seen: those that send something */
    es_stable_light* kept;
    bool renewed;                  /* has lost so many that all missing ones come at once */
    bool jumped;                   /* since the last update */
} light_work;

/* A place as the light sees it now. */
typedef struct seen_place {
    es_vec3 position, normal, incident;
    float share, area, seen, importance;
    uint32_t face;
    float x, y;                    /* texels; centres are whole numbers */
    float density, weight;
} seen_place;

typedef struct work {
    es_context* context;
    es_stable_vpls* stable;
    const es_stable_vpl_request* request;
    light_work* lights;
    uint32_t light_count;
    seen_place* seen;
    uint32_t *order, *planned;     /* places in the order in which a fresh set is drawn, and whose they would be */
} work;

static light_work* light_of(const work* w, uint32_t id)
{
    for (uint32_t i = 0; i < w->light_count && id; i++)
        if (w->lights[i].view->light.handle.id == id) return &w->lights[i];
    return NULL;
}

/* ---- places -------------------------------------------------------------------------------------------------------------- */

static const es_raster_instance* find_instance(const es_draw_list* list, uint32_t id)
{
    uint32_t low = 0, high = list->instance_count;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        if (list->instances[middle].id < id) low = middle + 1;
        else high = middle;
    }
    return low < list->instance_count && list->instances[low].id == id ? &list->instances[low] : NULL;
}

/* Corners in the world, and the frame: first edge, across it, normal. False for what has no area. */
static bool triangle_of(const es_draw_list* list, uint32_t id, uint32_t triangle, es_vec3 corners[3], es_vec3 frame[3])
{
    const es_raster_instance* instance = find_instance(list, id);
    if (!instance || triangle >= instance->mesh->triangle_count) return false;
    for (int c = 0; c < 3; c++) {
        const float* p = instance->mesh->positions + 4 * (size_t)instance->mesh->indices[3 * (size_t)triangle + (uint32_t)c];
        corners[c] = es_mat4_point(&instance->transform, es_v3(p[0], p[1], p[2]));
    }
    const es_vec3 along = es_v3_sub(corners[1], corners[0]), zero = {0, 0, 0};
    frame[0] = es_v3_normalize(along, zero);
    frame[2] = es_v3_normalize(es_v3_cross(along, es_v3_sub(corners[2], corners[0])), zero);
    frame[1] = es_v3_cross(frame[2], frame[0]);
    return es_v3_dot(frame[0], frame[0]) > 0.5f && es_v3_dot(frame[2], frame[2]) > 0.5f;
}

/* What of the place the light sees, 0 … 1: of the four texels around it, by nearness, those that show it or nothing before it. A texel's own
 * point is before it when it rises from the triangle's plane by more than the plane may, between texels. */
static float visible_share(const es_light_view* view, const es_light_face* face, const es_stable_vpl* place, es_vec3 position, es_vec3 normal, float x, float y, float depth)
{
    const es_gbuffer* g = &face->gbuffer;
    const float* step = view->orthographic ? face->gbuffer_rays.base_dx : face->gbuffer_rays.dir_dx;
    const float texel = es_v3_length(es_v3(step[0], step[1], step[2])) * (view->orthographic ? 1.0f : depth), least = 1.5f * texel;
    const float fx = es_floor(x), fy = es_floor(y), wx = x - fx, wy = y - fy;
    float share = 0.0f;
    for (int k = 0; k < 4; k++) {
        const float cx = es_clampf(fx + (float)(k & 1), 0.0f, (float)(g->width - 1)), cy = es_clampf(fy + (float)(k >> 1), 0.0f, (float)(g->height - 1));
        const size_t at = (size_t)(uint32_t)cy * g->stride + (uint32_t)cx;
        const float there = g->depth[at];
        bool lit = !(there > 0.0f) || there >= depth || (g->instance[at] == place->instance + 1 && g->triangle[at] == place->triangle + 1);
        if (!lit) lit = es_v3_dot(es_v3_sub(es_pixel_rays_position(&face->gbuffer_rays, cx, cy, there), position), normal) <= least;
        if (lit) share += (k & 1 ? wx : 1.0f - wx) * (k >> 1 ? wy : 1.0f - wy);
    }
    return share;
}

/* A surface that changed its material is looked up again where the light shows it. */
static void refresh_surface(const work* w, const es_light_face* face, es_stable_vpl* place, float x, float y)
{
    const es_gbuffer* g = &face->gbuffer;
    const size_t at = (size_t)es_minf(es_maxf(y + 0.5f, 0.0f), (float)(g->height - 1)) * g->stride + (size_t)es_minf(es_maxf(x + 0.5f, 0.0f), (float)(g->width - 1));
    if (g->instance[at] != place->instance + 1) return;
    place->surface = es_surface_of_gbuffer(g->albedo_rg[at], g->albedo_b[at], g->surface[at]);
    place->materials = w->request->materials;
}

static void look_at(const work* w, const light_work* light, es_stable_vpl* place, seen_place* seen)
{
    *seen = (seen_place){.seen = 0.0f};
    es_vec3 corners[3], frame[3];
    if (!place->placed || !triangle_of(w->request->list, place->instance, place->triangle, corners, frame)) return;
    seen->position = es_v3_add(corners[0], es_v3_add(es_v3_scale(es_v3_sub(corners[1], corners[0]), place->u), es_v3_scale(es_v3_sub(corners[2], corners[0]), place->v)));
    seen->normal = es_v3_add(es_v3_add(es_v3_scale(frame[0], place->normal[0]), es_v3_scale(frame[1], place->normal[1])), es_v3_scale(frame[2], place->normal[2]));
    if (!light || !(light->total > 0.0f)) return;
    const es_light_view* view = light->view;
    es_vec3 side = es_v3_dot(frame[2], seen->normal) < 0.0f ? es_v3_scale(frame[2], -1.0f) : frame[2];
    seen->incident = view->orthographic ? es_v3_scale(view->light.direction, -1.0f) : es_v3_normalize(es_v3_sub(view->light.position, seen->position), seen->normal);
    if (!(es_v3_dot(seen->incident, seen->normal) > 0.0f) || !(es_v3_dot(seen->incident, side) > 0.0f)) return;
    float depth = 0.0f;
    uint32_t f = 0;
    while (f < view->face_count && !es_light_texel_of(view, &view->faces[f], seen->position, &seen->x, &seen->y, &depth)) f++;
    if (f == view->face_count) return;
    const es_light_face* face = &view->faces[f];
    seen->face = f;
    if (place->materials != w->request->materials) refresh_surface(w, face, place, seen->x, seen->y);
    seen->share = es_light_texel_share(view, face, seen->x, seen->y, depth);
    seen->area = es_light_texel_area(view, face, seen->x, seen->y, depth, seen->normal);
    seen->importance = es_importance_of(view, &place->surface, seen->share);
    if (!(seen->importance > light->total * 1e-12f)) return;
    seen->seen = visible_share(view, face, place, seen->position, side, seen->x, seen->y, depth);
}

/* ---- how many places there are, and should be -------------------------------------------------------------------------------- */

static void smooth(const float* from, float* to, uint32_t side)
{
    for (uint32_t y = 0; y < side; y++)
        for (uint32_t x = 0; x < side; x++) {
            float sum = 0.0f;
            for (int j = -1; j <= 1; j++)
                for (int i = -1; i <= 1; i++) {
                    const int cx = (int)x + i, cy = (int)y + j;
                    if (cx < 0 || cy < 0 || cx >= (int)side || cy >= (int)side) continue;
                    sum += from[cy * (int)side + cx] * (float)((2 - i * i) * (2 - j * j));
                }
            to[(size_t)y * side + x] = sum * (1.0f / 16.0f);
        }
}

typedef struct four_cells { uint32_t at[4]; float weight[4]; } four_cells;

static four_cells cells_at(const light_work* light, uint32_t face, float x, float y)
{
    const float scale = (float)light->side / (float)light->importance->size, last = (float)(light->side - 1);
    const float gx = es_clampf((x + 0.5f) * scale - 0.5f, 0.0f, last), gy = es_clampf((y + 0.5f) * scale - 0.5f, 0.0f, last), fx = es_floor(gx), fy = es_floor(gy), wx = gx - fx, wy = gy - fy;
    const uint32_t x0 = (uint32_t)fx, y0 = (uint32_t)fy, x1 = x0 + 1 < light->side ? x0 + 1 : x0, y1 = y0 + 1 < light->side ? y0 + 1 : y0, first = face * light->side * light->side;
    return (four_cells){{first + y0 * light->side + x0, first + y0 * light->side + x1, first + y1 * light->side + x0, first + y1 * light->side + x1},
        {(1.0f - wx) * (1.0f - wy), wx * (1.0f - wy), (1.0f - wx) * wy, wx * wy}};
}

static float look_up(const light_work* light, const float* grid, uint32_t face, float x, float y)
{
    const four_cells c = cells_at(light, face, x, y);
    return (grid[c.at[0]] * c.weight[0] + grid[c.at[1]] * c.weight[1]) + (grid[c.at[2]] * c.weight[2] + grid[c.at[3]] * c.weight[3]);
}

/* Places over what importance asks for; 1 where they agree. */
static float density_at(const light_work* light, uint32_t face, float x, float y)
{
    return look_up(light, light->mass, face, x, y) / es_maxf(look_up(light, light->target, face, x, y), 1e-12f);
}

static void smooth_faces(const light_work* light, float* to)
{
    const size_t cells = (size_t)light->side * light->side;
    for (uint32_t f = 0; f < light->view->face_count; f++) smooth(light->cells + f * cells, to + f * cells, light->side);
}

static void set_target(light_work* light)
{
    const es_importance* importance = light->importance;
    uint32_t level = 0;
    while (importance->size >> level > light->side) level++;
    const size_t cells = (size_t)light->side * light->side;
    for (uint32_t f = 0; f < light->view->face_count; f++)
        for (size_t i = 0; i < cells; i++) light->cells[f * cells + i] = importance->sums[f * importance->face_floats + importance->level_offset[level] + i] / light->total;
    smooth_faces(light, light->target);
}

/* From the presence of what is seen; `arrived` counts newcomers as if they were there. */
static void weigh_places(work* w, bool arrived)
{
    for (uint32_t l = 0; l < w->light_count; l++) {
        light_work* light = &w->lights[l];
        if (!(light->total > 0.0f)) continue;
        memset(light->cells, 0, (size_t)light->side * light->side * light->view->face_count * sizeof *light->cells);
        const uint32_t id = light->view->light.handle.id;
        float sum = 0.0f;
        for (uint32_t v = 0; v < w->stable->count; v++) {
            const es_stable_vpl* place = &w->stable->places[v];
            const seen_place* seen = &w->seen[v];
            const float mass = seen->seen * (arrived && !place->leaving ? 1.0f : place->presence);
            if (place->light != id || !(mass > 0.0f)) continue;
            const four_cells c = cells_at(light, seen->face, seen->x, seen->y);
            for (int k = 0; k < 4; k++) light->cells[c.at[k]] += mass * c.weight[k];
            sum += mass;
        }
        const size_t cells = (size_t)light->side * light->side * light->view->face_count;
        for (size_t i = 0; i < cells && sum > 0.0f; i++) light->cells[i] /= sum;
        smooth_faces(light, light->mass);
        float weights = 0.0f;
        for (uint32_t v = 0; v < w->stable->count; v++) {
            seen_place* seen = &w->seen[v];
            if (w->stable->places[v].light != id) continue;
            seen->density = seen->seen > 0.0f ? density_at(light, seen->face, seen->x, seen->y) : 0.0f;
            seen->weight = w->stable->places[v].presence * seen->seen / es_maxf(seen->density, 0.25f);
            weights += seen->weight;
        }
        for (uint32_t v = 0; v < w->stable->count && weights > 0.0f; v++)
            if (w->stable->places[v].light == id) w->seen[v].weight /= weights;
    }
}

/* ---- newcomers ---------------------------------------------------------------------------------------------------------------------- */

static bool place_at(const work* w, const light_work* light, uint32_t f, uint32_t x, uint32_t y, es_stable_vpl* place, seen_place* seen)
{
    const es_light_face* face = &light->view->faces[f];
    const es_gbuffer* g = &face->gbuffer;
    const size_t at = (size_t)y * g->stride + x;
    if (!(g->depth[at] > 0.0f) || !g->instance[at] || !g->triangle[at]) return false;
    es_vec3 c[3], frame[3];
    place->instance = g->instance[at] - 1;
    place->triangle = g->triangle[at] - 1;
    if (!triangle_of(w->request->list, place->instance, place->triangle, c, frame)) return false;
    const es_vec3 p = es_v3_sub(es_pixel_rays_position(&face->gbuffer_rays, (float)x, (float)y, g->depth[at]), c[0]), b = es_v3_sub(c[1], c[0]), d = es_v3_sub(c[2], c[0]);
    /* in the triangle's plane: p = u b + v d */
    const float along = es_v3_length(b), dx = es_v3_dot(d, frame[0]), dy = es_v3_dot(d, frame[1]);
    place->v = es_clampf(es_v3_dot(p, frame[1]) / dy, 0.0f, 1.0f);
    place->u = es_clampf((es_v3_dot(p, frame[0]) - place->v * dx) / along, 0.0f, 1.0f - place->v);
    const es_vec3 normal = es_unpack_normal(g->normal[at]);
    for (int k = 0; k < 3; k++) place->normal[k] = es_v3_dot(normal, frame[k]);
    place->surface = es_surface_of_gbuffer(g->albedo_rg[at], g->albedo_b[at], g->surface[at]);
    place->materials = w->request->materials;
    place->placed = true;
    look_at(w, light, place, seen);
    return seen->seen > 0.0f;
}

/* Draws a place for number v; false when none of the candidates is seen. */
static bool settle(work* w, light_work* light, uint32_t v, uint32_t candidates, float presence)
{
    es_stable_vpl best = {0};
    seen_place best_seen = {0};
    float scarcest = 0.0f;
    for (uint32_t k = 0; k < candidates; k++) {
        /* the sequence's first point is the origin itself; a float has 24 bits for its numbers */
        const uint32_t index = (w->request->sample.seed + light->kept->drawn++) % 0xfffffu + 1;
        uint32_t f, x, y;
        float probability;
        es_stable_vpl place = {.light = light->view->light.handle.id, .presence = presence};
        seen_place seen;
        if (!es_importance_warp(light->importance, es_halton(0, index), es_halton(1, index), &f, &x, &y, &probability) || !place_at(w, light, f, x, y, &place, &seen)) continue;
        const float density = candidates > 1 ? density_at(light, f, seen.x, seen.y) : 0.0f;
        if (best.placed && density >= scarcest) continue;
        scarcest = density;
        best = place;
        best_seen = seen;
    }
    if (!best.placed) return false;
    w->stable->places[v] = best;
    w->seen[v] = best_seen;
    if (candidates > 1) { /* the next one sees it: unsmoothed mass of one place, over all cells around */
        const four_cells c = cells_at(light, best_seen.face, best_seen.x, best_seen.y);
        for (int i = 0; i < 4; i++) light->mass[c.at[i]] += c.weight[i] * 0.25f / (float)(light->wanted ? light->wanted : 1);
    }
    return true;
}

/* The order and owners that es_vpls_sample has: lights take turns by (i + ½) / share, and a subset is a run of that order. */
static uint32_t plan(work* w)
{
    const uint32_t count = w->stable->count, subsets = w->request->sample.subsets;
    uint32_t subset = 0, in_subset = 0, made = 0, drawn = 0;
    for (uint32_t l = 0; l < w->light_count; l++) drawn += w->lights[l].wanted;
    for (uint32_t l = 0; l < w->light_count; l++) w->lights[l].owned = 0; /* here: planned so far */
    for (; made < drawn; made++) {
        uint32_t chosen = 0;
        float lowest = 2.0f;
        for (uint32_t l = 0; l < w->light_count; l++) {
            if (w->lights[l].owned >= w->lights[l].wanted) continue;
            const float key = ((float)w->lights[l].owned + 0.5f) / (float)w->lights[l].wanted;
            if (key < lowest) {
                lowest = key;
                chosen = l;
            }
        }
        w->lights[chosen].owned++;
        uint32_t size = drawn / subsets + (subset < drawn % subsets);
        while (size == 0 || in_subset >= size) {
            subset++;
            in_subset = 0;
            size = drawn / subsets + (subset < drawn % subsets);
        }
        const uint32_t v = subset + in_subset++ * subsets;
        w->order[made] = v;
        w->planned[v] = chosen;
    }
    return made < count ? made : count;
}

static light_work* neediest(const work* w)
{
    light_work* best = NULL;
    float most = 0.0f;
    for (uint32_t l = 0; l < w->light_count; l++) {
        light_work* light = &w->lights[l];
        const float missing = ((float)light->wanted - (float)light->owned) / (float)(light->wanted ? light->wanted : 1);
        if (light->wanted > light->owned && missing > most) {
            most = missing;
            best = light;
        }
    }
    return best;
}

/* ---- the update ---------------------------------------------------------------------------------------------------------------------- */

static es_result prepare_lights(work* w, const es_light_view* views, uint32_t view_count, const es_importance* importances, es_arena* arena)
{
    es_stable_vpls* stable = w->stable;
    w->lights = es_arena_allocate(arena, (size_t)view_count * sizeof *w->lights + 1);
    uint32_t* shares = w->lights ? es_arena_allocate(arena, (size_t)view_count * sizeof *shares + 1) : NULL;
    if (!shares) return es_context_last_result(w->context);
    if (!es_grow(w->context, (void**)&stable->lights, &stable->light_capacity, stable->light_count, (size_t)stable->light_count + view_count, sizeof *stable->lights)) return es_context_last_result(w->context);
    es_vpl_shares(views, view_count, importances, w->request->sample.count, shares);
    /* sequences of lights that are gone are forgotten */
    uint32_t kept = 0;
    for (uint32_t i = 0; i < stable->light_count; i++) {
        bool there = false;
        for (uint32_t l = 0; l < view_count; l++) there |= views[l].light.handle.id == stable->lights[i].light;
        if (there) stable->lights[kept++] = stable->lights[i];
    }
    stable->light_count = kept;
    w->light_count = view_count;
    const double *from = stable->origin, *to = w->request->origin;
    const es_vec3 shift = es_v3((float)(from[0] - to[0]), (float)(from[1] - to[1]), (float)(from[2] - to[2]));
    memcpy(stable->origin, to, sizeof stable->origin);
    for (uint32_t l = 0; l < view_count; l++) {
        light_work* light = &w->lights[l];
        *light = (light_work){.view = &views[l], .importance = &importances[l], .total = es_importance_total(&importances[l]), .wanted = shares[l], .side = 1};
        while (light->side < importances[l].size && light->side < GRID_MAX && (uint64_t)4 * light->side * light->side * views[l].face_count <= light->wanted) light->side *= 2;
        const size_t cells = (size_t)light->side * light->side * views[l].face_count;
        light->cells = es_arena_allocate(arena, 3 * cells * sizeof(float));
        if (!light->cells) return es_context_last_result(w->context);
        light->target = light->cells + cells;
        light->mass = light->target + cells;
        if (light->total > 0.0f) set_target(light);
        uint32_t k = 0;
        while (k < stable->light_count && stable->lights[k].light != views[l].light.handle.id) k++;
        if (k == stable->light_count) stable->lights[stable->light_count++] = (es_stable_light){views[l].light.handle.id, 0, views[l].light};
        light->kept = &stable->lights[k];
        light->jumped = light->kept->then.type != views[l].light.type || es_light_movement(&light->kept->then, &views[l].light, shift, w->request->extent) >= ES_LIGHT_JUMP;
        light->kept->then = views[l].light;
        if (light->jumped) light->kept->drawn = 0; /* as a new one */
    }
    return ES_OK;
}

/* Presence goes on; what has left is nobody's. True when anything did. */
static bool go_on(es_stable_vpls* stable)
{
    const float step = 1.0f / (float)ES_VPL_ARRIVAL;
    bool changed = false;
    for (uint32_t v = 0; v < stable->count; v++) {
        es_stable_vpl* place = &stable->places[v];
        if (!place->placed || (!place->leaving && place->presence >= 1.0f)) continue;
        changed = true;
        place->presence = es_clampf(place->presence + (place->leaving ? -step : step), 0.0f, 1.0f);
        if (place->leaving && place->presence <= 0.0f) *place = (es_stable_vpl){0};
    }
    return changed;
}

/* Sends away the places of one light that stand closest, `count` of them and no denser ones than `least`. */
static uint32_t send_away(work* w, const light_work* light, uint32_t count, float least)
{
    uint32_t sent = 0;
    for (; sent < count; sent++) {
        uint32_t densest = w->stable->count;
        for (uint32_t v = 0; v < w->stable->count; v++) {
            const es_stable_vpl* place = &w->stable->places[v];
            if (place->light != light->view->light.handle.id || place->leaving || place->presence < 1.0f || !(w->seen[v].density >= least)) continue;
            if (densest == w->stable->count || w->seen[v].density > w->seen[densest].density) densest = v;
        }
        if (densest == w->stable->count) break;
        w->stable->places[densest].leaving = true;
        w->seen[densest].density = -1.0f;
    }
    return sent;
}

static void renew(work* w, uint32_t planned, uint32_t budget, bool scene_changed, bool* changed)
{
    es_stable_vpls* stable = w->stable;
    /* who is there; a place whose light is gone, has jumped, or does not see it, is free */
    for (uint32_t l = 0; l < w->light_count; l++) w->lights[l].owned = w->lights[l].seen = 0;
    for (uint32_t v = 0; v < stable->count; v++) {
        light_work* light = light_of(w, stable->places[v].light);
        if (!light || !light->wanted || light->jumped) {
            if (stable->places[v].light) *changed = true;
            stable->places[v] = (es_stable_vpl){0};
            continue;
        }
        light->owned++;
        light->seen += w->seen[v].seen > 0.0f && !stable->places[v].leaving;
    }
    for (uint32_t l = 0; l < w->light_count; l++) w->lights[l].renewed = 2 * w->lights[l].seen < w->lights[l].wanted;

    /* one that has come on, or got much brighter, does not wait for the others' to leave: first those that would be its own in a new set */
    for (uint32_t l = 0; l < w->light_count; l++) {
        uint32_t free = w->lights[l].owned;
        for (int any = 0; any < 2 && w->lights[l].renewed; any++)
            for (uint32_t k = 0; k < planned && free < w->lights[l].wanted; k++) {
                es_stable_vpl* place = &stable->places[w->order[k]];
                light_work* owner = light_of(w, place->light);
                if (!owner || owner->owned <= owner->wanted || !place->placed || (!any && w->planned[w->order[k]] != l)) continue;
                owner->owned--;
                *place = (es_stable_vpl){0};
                *changed = true;
                free++;
            }
    }

    uint32_t moved = 0;
    for (uint32_t k = 0; k < planned; k++) {
        const uint32_t v = w->order[k];
        es_stable_vpl* place = &stable->places[v];
        if (place->placed && w->seen[v].seen > 0.0f) continue;
        light_work *light = light_of(w, place->light), *own = &w->lights[w->planned[v]];
        if (light) light->owned--;
        if (!light || light->owned >= light->wanted) light = own->owned < own->wanted ? own : neediest(w);
        if (!light) { /* every light has its share */
            if (place->light) *changed = true;
            *place = (es_stable_vpl){0};
            continue;
        }
        const bool whole = light->renewed && light->seen == 0;
        if (!light->renewed && moved >= budget) { /* it waits for a later frame */
            if (place->light) light_of(w, place->light)->owned++;
            *changed = true;
            continue;
        }
        *changed = true;
        const uint32_t id = light->view->light.handle.id;
        *place = (es_stable_vpl){.light = id};
        light->owned++;
        if (!(light->total > 0.0f) || !settle(w, light, v, whole ? 1 : ES_VPL_CANDIDATES, light->renewed ? 1.0f : 1.0f / (float)ES_VPL_ARRIVAL)) continue;
        moved++;
    }
    for (uint32_t l = 0; l < w->light_count; l++) {
        const light_work* light = &w->lights[l];
        uint32_t leaving = 0;
        for (uint32_t v = 0; v < stable->count; v++) leaving += stable->places[v].leaving && stable->places[v].light == light->view->light.handle.id;
        const uint32_t most = light->wanted + light->wanted / 10 + 1, left = light->owned - (leaving < light->owned ? leaving : light->owned);
        uint32_t sent = 0;
        if (left > most && moved < budget) moved += sent = send_away(w, light, left - most < budget - moved ? left - most : budget - moved, 0.0f);
        if (!sent && scene_changed && light->side > 1 && leaving < 1 + light->wanted / 64 && moved < budget) moved += sent = send_away(w, light, 1, 2.0f);
        *changed |= sent > 0;
    }
    stable->moved = moved;
}

static void write_records(const work* w, es_vpl_record* records)
{
    for (uint32_t v = 0; v < w->stable->count; v++) {
        const es_stable_vpl* place = &w->stable->places[v];
        const seen_place* seen = &w->seen[v];
        const light_work* light = light_of(w, place->light);
        if (!light || !place->placed || !(es_v3_dot(seen->normal, seen->normal) > 0.5f)) {
            records[v] = (es_vpl_record){.normal = {0, 1, 0}, .tangent = {0, 0, 1}, .bitangent = {1, 0, 0}, .incident = {0, 1, 0}, .roughness = 1.0f};
            continue;
        }
        const float weight = seen->seen > 0.0f ? light->total / seen->importance * seen->weight : 0.0f;
        es_vpl_place at = {seen->position, es_v3_normalize(seen->normal, es_v3(0, 1, 0)), seen->seen > 0.0f ? seen->incident : es_v3_normalize(seen->normal, es_v3(0, 1, 0)), seen->share * weight, seen->area * weight};
        es_vpl_make(light->view, &at, &place->surface, w->request->sample.glossy, &records[v]);
    }
}

static es_result start(es_context* context, es_stable_vpls* stable, const es_vpl_request* sample)
{
    if (stable->count == sample->count && stable->subsets == sample->subsets && stable->seed == sample->seed) return ES_OK;
    es_stable_vpls_free(context, stable);
    stable->places = es_allocate_zero(context, (size_t)sample->count * sizeof *stable->places);
    if (!stable->places) return es_context_last_result(context);
    stable->count = sample->count;
    stable->subsets = sample->subsets;
    stable->seed = sample->seed;
    return ES_OK;
}

es_result es_stable_vpls_update(es_context* context, es_stable_vpls* stable, const es_light_view* views, uint32_t view_count, const es_importance* importances,
    const es_stable_vpl_request* request, es_vpl_record* records, uint32_t* count)
{
    *count = 0;
    es_result result = start(context, stable, &request->sample);
    if (result || !stable->count) return result;
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    work w = {.context = context, .stable = stable, .request = request};
    result = prepare_lights(&w, views, view_count, importances, &arena);
    if (!result) {
        w.seen = es_arena_allocate(&arena, stable->count * sizeof *w.seen);
        w.order = w.seen ? es_arena_allocate(&arena, 2 * (size_t)stable->count * sizeof *w.order) : NULL;
        if (!w.order) result = es_context_last_result(context);
        w.planned = w.order + stable->count;
    }
    if (!result) {
        const uint32_t planned = plan(&w);
        bool changed = go_on(stable);
        for (uint32_t v = 0; v < stable->count; v++) look_at(&w, light_of(&w, stable->places[v].light), &stable->places[v], &w.seen[v]);
        weigh_places(&w, true);
        const float budget = request->renew * (float)stable->count;
        renew(&w, planned, (uint32_t)budget + ((float)(uint32_t)budget < budget), stable->scene != request->scene, &changed);
        weigh_places(&w, false);
        write_records(&w, records);
        stable->settled = !changed && stable->scene == request->scene;
        stable->scene = request->scene;
        if (planned) *count = stable->count;
    }
    es_arena_free(&arena);
    return result;
}

void es_stable_vpls_free(es_context* context, es_stable_vpls* stable)
{
    es_release(context, stable->places, (size_t)stable->count * sizeof *stable->places);
    es_release(context, stable->lights, stable->light_capacity * sizeof *stable->lights);
    *stable = (es_stable_vpls){0};
}
