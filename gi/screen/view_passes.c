/* Which views the screen-space methods look into: layers peeled from the camera's, and further cameras (gi/screen/view_stack.h). */
#include "gi/kernel_table.h"
#include "gi/screen/passes.h"
#include "gi/screen/residual_pass.h"
#include "platform/maths.h"

/* Of a layer whose surfaces send light; of one that only hides. */
enum { LIT_PLANES = ES_GBUFFER_DEPTH | ES_GBUFFER_NORMAL | ES_GBUFFER_GEOMETRIC_NORMAL | ES_GBUFFER_ALBEDO | ES_GBUFFER_SURFACE | ES_GBUFFER_EMISSION };

static bool wanted(const es_renderer_settings* s, const es_frame_inputs* in)
{
    return in->has_geometry && (s->screen_bounce || s->screen_repair || !es_residual_nothing(s) || ((s->lamps == ES_LAMPS_SCREEN || s->lamps == ES_LAMPS_AMBIENT) && in->has_environment));
}

es_result es_screen_first_layer(es_renderer* r, es_depth_range* range, const es_depth_range** wanted_range)
{
    es_screen_buffers* b = &r->screen;
    *wanted_range = NULL;
    if (r->settings.screen_layers < 2) return ES_OK;
    const size_t floats = (size_t)r->gbuffer.stride * r->gbuffer.height;
    if (b->drawn_floats != floats) es_screen_free_drawn(r->context, b);
    b->drawn_floats = floats;
    for (uint32_t i = 0; i + 1 < r->settings.screen_layers; i++)
        if (!b->drawn[i] && !(b->drawn[i] = es_allocate_zero(r->context, floats * sizeof(float)))) return es_context_last_result(r->context);
    *range = (es_depth_range){.drawn = b->drawn[0], .stride = r->gbuffer.stride};
    *wanted_range = range;
    return ES_OK;
}

static es_result resize(es_context* context, es_screen_layer* layer, uint32_t width, uint32_t height, uint32_t planes)
{
    if (layer->gbuffer.memory && layer->gbuffer.width == width && layer->gbuffer.height == height && layer->gbuffer.planes == planes) return ES_OK;
    es_gbuffer_destroy(context, &layer->gbuffer);
    return es_gbuffer_create(context, width, height, planes, &layer->gbuffer);
}

typedef struct turning { const es_gi_kernels* kernels; const es_gbuffer* gbuffer; } turning;

static void turn_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const turning* t = user;
    t->kernels->turn_normals(t->gbuffer, begin, end);
}

/* Layers 1 … of the camera: back faces, whose outsides are turned away from the eye, then front faces again. */
static es_result peel(es_renderer* r, const es_frame_inputs* in, uint32_t planes, uint64_t* triangles)
{
    es_screen_buffers* b = &r->screen;
    es_result result = ES_OK;
    for (uint32_t i = 1; i < r->settings.screen_layers && !result; i++) {
        es_screen_layer* layer = &b->layers[0][i];
        es_raster_view view = r->view;
        es_raster_stats stats = {0};
        const bool back = i % 2 == 1;
        if (back) view.cull = ES_CULL_FRONT;
        const es_depth_range range = {.behind = b->drawn[i - 1], .drawn = i + 1 < r->settings.screen_layers ? b->drawn[i] : NULL, .stride = r->gbuffer.stride};
        result = resize(r->context, layer, r->gbuffer.width, r->gbuffer.height, planes);
        if (!result) result = es_draw_gbuffer_between(r->rasterizer, in->solid, &view, &range, &layer->gbuffer, &stats);
        *triangles += stats.triangles;
        if (result || !back || planes != LIT_PLANES) continue;
        turning t = {es_gi_kernel_table(es_context_isa(r->context)), &layer->gbuffer};
        es_parallel_for(r->context, layer->gbuffer.height, 32, turn_rows, &t);
    }
    return result;
}

/* Additional cameras: moved across the picture by half of the radius of the scene's bounding sphere, directed to the point of the camera's axis that is as deep as the middle
 * of the scene (thesis §4.3.3). */
static void aim(es_renderer* r, const es_frame_inputs* in)
{
    static const float moves[ES_SCREEN_MAX_CAMERAS][2] = {{1, 0.25f}, {-1, 0.25f}, {0, 1}, {0, -0.5f}};
    const float* m = r->view.view.m;
    const es_vec3 right = es_v3(m[0], m[4], m[8]), up = es_v3(m[1], m[5], m[9]), forward = es_v3(-m[2], -m[6], -m[10]);
    const es_vec3 eye = es_v3(-(m[0] * m[12] + m[1] * m[13] + m[2] * m[14]), -(m[4] * m[12] + m[5] * m[13] + m[6] * m[14]), -(m[8] * m[12] + m[9] * m[13] + m[10] * m[14]));
    const es_vec3 middle = es_v3_scale(es_v3_add(in->bounds_min, in->bounds_max), 0.5f);
    const float away = es_maxf(es_v3_dot(es_v3_sub(middle, eye), forward), 0.1f * in->extent), step = 0.25f * in->extent;
    const es_vec3 interest = es_v3_add(eye, es_v3_scale(forward, away));
    for (uint32_t v = 0; v < ES_SCREEN_MAX_CAMERAS; v++) {
        const es_vec3 at = es_v3_add(eye, es_v3_add(es_v3_scale(right, moves[v][0] * step), es_v3_scale(up, moves[v][1] * step)));
        es_raster_view* view = &r->screen.cameras[v + 1];
        *view = r->view;
        view->width = (r->view.width + 1) / 2;
        view->height = (r->view.height + 1) / 2;
        view->view = view->previous_view = es_mat4_look(at, es_v3_normalize(es_v3_sub(interest, at), forward), up);
        view->previous_projection = view->projection;
    }
}

static es_result look(es_renderer* r, const es_frame_inputs* in, uint32_t planes, uint64_t* triangles)
{
    es_result result = ES_OK;
    aim(r, in);
    for (uint32_t v = 1; v <= r->settings.screen_cameras && !result; v++) {
        const es_raster_view* view = &r->screen.cameras[v];
        es_screen_layer* layer = &r->screen.layers[v][0];
        es_raster_stats stats = {0};
        result = resize(r->context, layer, view->width, view->height, planes);
        if (!result) result = es_draw_gbuffer(r->rasterizer, in->solid, view, &layer->gbuffer, &stats);
        *triangles += stats.triangles;
    }
    return result;
}

es_result es_pass_screen_views(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    es_view_stack* stack = &r->screen.stack;
    const char* why = !wanted(s, in) ? "nothing is looked for in screen space" : s->screen_layers == 1 && !s->screen_cameras ? "the camera's picture is all" : NULL;
    *stack = (es_view_stack){.views = {es_screen_view_of(&r->view, &r->gbuffer)}, .view_count = 1};
    if (why) {
        es_plan_not_needed(plan, ES_PASS_SCREEN_VIEWS, why);
        return ES_OK;
    }
    const uint32_t planes = s->screen_bounce || !es_residual_nothing(s) ? (uint32_t)LIT_PLANES : (uint32_t)ES_GBUFFER_DEPTH;
    es_plan_begin(plan, ES_PASS_SCREEN_VIEWS);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    const uint32_t words[] = {s->screen_layers, s->screen_cameras, planes};
    es_plan_reads(plan, words, sizeof words);
    es_plan_reads(plan, &in->bounds_min, sizeof in->bounds_min);
    es_plan_reads(plan, &in->bounds_max, sizeof in->bounds_max);
    if (es_plan_run(plan, ES_PASS_SCREEN_VIEWS)) {
        uint64_t triangles = 0;
        es_result result = peel(r, in, planes, &triangles);
        if (!result) result = look(r, in, planes, &triangles);
        if (result) return result;
        es_plan_done(plan, ES_PASS_SCREEN_VIEWS, triangles);
    }
    stack->views[0].layer_count = s->screen_layers;
    for (uint32_t i = 1; i < s->screen_layers; i++) stack->views[0].layers[i] = &r->screen.layers[0][i].gbuffer;
    for (uint32_t v = 1; v <= s->screen_cameras; v++) stack->views[stack->view_count++] = es_screen_view_of(&r->screen.cameras[v], &r->screen.layers[v][0].gbuffer);
    return ES_OK;
}
