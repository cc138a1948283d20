/* Closed tubes swept along a curve: see sweep.h. */
#include "sim/scenes/sweep.h"

#include "platform/context.h"
#include "platform/maths.h"

static float catmull(float a, float b, float c, float d, float t) { return b + 0.5f * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))); }

static es_vec3 catmull3(es_vec3 a, es_vec3 b, es_vec3 c, es_vec3 d, float t)
{
    return es_v3(catmull(a.x, b.x, c.x, d.x, t), catmull(a.y, b.y, c.y, d.y, t), catmull(a.z, b.z, c.z, d.z, t));
}

static es_sweep_station station_at(const es_sweep* sweep, float share)
{
    const es_sweep_station* all = sweep->stations;
    if (share <= 0) return all[0];
    if (share >= 1) return all[sweep->count - 1];
    const float place = share * (float)(sweep->count - 1);
    uint32_t i = (uint32_t)place;
    if (i > sweep->count - 2) i = sweep->count - 2;
    const float t = place - (float)i;
    const es_sweep_station *b = &all[i], *c = b + 1, *a = i ? b - 1 : b, *d = i + 2 < sweep->count ? c + 1 : c;
    return (es_sweep_station){catmull3(a->at, b->at, c->at, d->at, t), es_maxf(0, catmull(a->wide, b->wide, c->wide, d->wide, t)),
        es_maxf(0, catmull(a->deep, b->deep, c->deep, d->deep, t)), catmull3(a->back, b->back, c->back, d->back, t)};
}

es_sweep_frame es_sweep_at(const es_sweep* sweep, float share)
{
    const float step = 0.05f / (float)(sweep->count - 1);
    const es_sweep_station here = station_at(sweep, share), before = station_at(sweep, share - step), after = station_at(sweep, share + step);
    es_sweep_frame frame = {.at = here.at, .wide = here.wide, .deep = here.deep};
    frame.along = es_v3_normalize(es_v3_sub(after.at, before.at), es_v3(0, 0, 1));
    frame.side = es_v3_normalize(es_v3_cross(here.back, frame.along), es_v3(1, 0, 0));
    frame.back = es_v3_cross(frame.along, frame.side);
    return frame;
}

static es_vec3 at(const float* values, size_t index) { return es_v3(values[3 * index], values[3 * index + 1], values[3 * index + 2]); }

/* A ring of vertices; the angle grows from the side towards the back. */
static void place_ring(const es_sweep* sweep, const es_sweep_frame* frame, float lengths, const float* turns, float* places)
{
    const float radius = 0.5f * (frame->wide + frame->deep);
    for (uint32_t i = 0; i < sweep->around; i++) {
        const float cosine = turns[2 * i], sine = turns[2 * i + 1];
        const es_vec3 out = es_v3_add(es_v3_scale(frame->side, frame->wide * cosine), es_v3_scale(frame->back, frame->deep * sine));
        es_vec3 place = es_v3_add(frame->at, out);
        if (sweep->relief && radius > 0) {
            const float stands_out = sweep->relief(sweep->parameters, lengths, 6.2831853f * (float)i / (float)sweep->around, radius);
            place = es_v3_add(place, es_v3_scale(es_v3_normalize(out, frame->back), stands_out));
        }
        places[3 * i] = place.x;
        places[3 * i + 1] = place.y;
        places[3 * i + 2] = place.z;
    }
}

static void place_rings(const es_sweep* sweep, float* places, const float* turns)
{
    float lengths = 0;
    es_vec3 before = sweep->stations[0].at;
    for (uint32_t j = 0; j <= sweep->along; j++) {
        const es_sweep_frame frame = es_sweep_at(sweep, (float)j / (float)sweep->along);
        lengths += es_v3_length(es_v3_sub(frame.at, before)) / es_maxf(0.5f * (frame.wide + frame.deep), 1e-3f);
        before = frame.at;
        place_ring(sweep, &frame, lengths, turns, places + 3 * (size_t)j * sweep->around);
    }
}

/* From the neighbours' places; at the ends, where a ring is one point, along the curve. */
static es_vec3 normal_at(const es_sweep* sweep, const float* places, uint32_t j, uint32_t i)
{
    const uint32_t n = sweep->around;
    const size_t ring = (size_t)j * n;
    if (j == 0 || j == sweep->along) return es_v3_scale(es_sweep_at(sweep, j ? 1 : 0).along, j ? 1.0f : -1.0f);
    const es_vec3 across = es_v3_sub(at(places, ring + (i + 1) % n), at(places, ring + (i + n - 1) % n));
    const es_vec3 along = es_v3_sub(at(places, ring + n + i), at(places, ring - n + i));
    return es_v3_normalize(es_v3_cross(across, along), es_v3_sub(at(places, ring + i), es_sweep_at(sweep, (float)j / (float)sweep->along).at));
}

static void append(es_shape* shape, const es_sweep* sweep, const float* places)
{
    const uint32_t n = sweep->around, base = (uint32_t)shape->vertex_count;
    for (uint32_t j = 0; j <= sweep->along; j++)
        for (uint32_t i = 0; i < n; i++) es_shape_vertex(shape, at(places, (size_t)j * n + i), normal_at(sweep, places, j, i));
    for (uint32_t j = 0; j < sweep->along; j++)
        for (uint32_t i = 0; i < n; i++) {
            const uint32_t a = base + j * n + i, b = base + j * n + (i + 1) % n;
            es_shape_wound_triangle(shape, a, b, b + n);
            es_shape_wound_triangle(shape, a, b + n, a + n);
        }
}

void es_shape_sweep(es_shape* shape, const es_sweep* sweep)
{
    if (shape->failed || (shape->stop && *shape->stop != ES_OK)) return;
    const size_t vertices = ((size_t)sweep->along + 1) * sweep->around, floats = 3 * vertices + 2 * (size_t)sweep->around;
    float* places = es_allocate_array(shape->context, floats, sizeof *places);
    if (!places) {
        shape->failed = true;
        if (shape->stop) *shape->stop = es_context_last_result(shape->context);
        return;
    }
    float* turns = places + 3 * vertices;
    for (uint32_t i = 0; i < sweep->around; i++) es_sincos(6.2831853f * (float)i / (float)sweep->around, &turns[2 * i + 1], &turns[2 * i]);
    place_rings(sweep, places, turns);
    append(shape, sweep, places);
    es_release(shape->context, places, floats * sizeof *places);
}
