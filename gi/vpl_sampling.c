#include "gi/vpl_sampling.h"

#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "gi/kernel_table.h"
#include "gi/surface.h"
#include "raster/pack.h"

static float luminance(es_vec3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

static es_surface surface_at(const es_gbuffer* gbuffer, size_t at) { return es_surface_of_gbuffer(gbuffer->albedo_rg[at], gbuffer->albedo_b[at], gbuffer->surface[at]); }

/* Power that a face's texel receives per unit of the light's intensity: solid angle (perspective, sr) or area (orthographic, m²),
 * times the falloff. A perspective texel at tangent coordinates (a, b) spans step² / (1 + a² + b²)^(3/2). */
float es_light_texel_share(const es_light_view* view, const es_light_face* face, float x, float y, float depth)
{
    const es_pixel_rays* rays = &face->gbuffer_rays;
    if (view->orthographic) {
        es_vec3 dx = es_v3(rays->base_dx[0], rays->base_dx[1], rays->base_dx[2]), dy = es_v3(rays->base_dy[0], rays->base_dy[1], rays->base_dy[2]);
        return es_v3_length(dx) * es_v3_length(dy);
    }
    es_vec3 d = es_pixel_rays_direction(rays, x, y);
    es_vec3 dx = es_v3(rays->dir_dx[0], rays->dir_dx[1], rays->dir_dx[2]), dy = es_v3(rays->dir_dy[0], rays->dir_dy[1], rays->dir_dy[2]);
    float length = es_v3_length(d);
    float solid_angle = es_sqrt(es_v3_dot(dx, dx) * es_v3_dot(dy, dy)) / (length * length * length);
    return solid_angle * es_light_falloff(&view->light, es_v3_scale(d, 1.0f / length), depth * length);
}

float es_importance_of(const es_light_view* view, const es_surface* surface, float share)
{
    const es_vec3 light = es_v3(view->light.radiant[0], view->light.radiant[1], view->light.radiant[2]);
    if (surface->model == ES_SURFACE_UNLIT) return 0.0f;
    /* eq. 4.3; SP runs from 0 (diffuse) to 1 (mirror-like): the exponent / 50, or 1 - roughness, by the lobe's weight */
    const float gloss = (surface->model == ES_SURFACE_PHONG ? surface->roughness * 0.02f : 1.0f - surface->roughness) * luminance(surface->specular);
    const float reflected = luminance(es_v3_mul(es_v3_add(surface->albedo, surface->specular), light));
    return share * reflected * (0.5f + gloss);
}

/* Surface that a texel covers, m²: solid angle times distance² (perspective), cross-section (orthographic), over the cosine. */
float es_light_texel_area(const es_light_view* view, const es_light_face* face, float x, float y, float depth, es_vec3 normal)
{
    const es_pixel_rays* rays = &face->gbuffer_rays;
    es_vec3 d = es_pixel_rays_direction(rays, x, y);
    float length = es_v3_length(d), cosine = es_maxf(es_absf(es_v3_dot(d, normal)) / length, 0.05f);
    const float* sx = view->orthographic ? rays->base_dx : rays->dir_dx;
    const float* sy = view->orthographic ? rays->base_dy : rays->dir_dy;
    float step = es_v3_length(es_v3(sx[0], sx[1], sx[2])) * es_v3_length(es_v3(sy[0], sy[1], sy[2]));
    return view->orthographic ? step / cosine : step * depth * depth / (length * cosine);
}

typedef struct importance_job { const es_light_view* view; es_importance* importance; } importance_job;

static void importance_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    importance_job* job = user;
    uint32_t size = job->importance->size;
    for (uint32_t row = begin; row < end; row++) {
        uint32_t f = row / size, y = row % size;
        const es_light_face* face = &job->view->faces[f];
        float* out = job->importance->sums + f * job->importance->face_floats + (size_t)y * size;
        for (uint32_t x = 0; x < size; x++) {
            size_t at = (size_t)y * face->gbuffer.stride + x;
            float depth = face->gbuffer.depth[at], value = 0.0f;
            if (depth > 0.0f) {
                es_surface surface = surface_at(&face->gbuffer, at);
                if (surface.model != ES_SURFACE_UNLIT) value = es_importance_of(job->view, &surface, es_light_texel_share(job->view, face, (float)x, (float)y, depth));
            }
            out[x] = value;
        }
    }
}

/* ---- the picture's share ------------------------------------------------------------------------------------------------ */

/* The picture's factor is found per block of texels. A share of its mean is added everywhere: what the estimate overlooks (it knows
 * neither visibility nor what lies between the grid's pixels) still gets lights. */
enum { BLOCK = 2, BLOCKS_MAX = 1024 };
#define VIEW_FLOOR 0.1

typedef struct view_job {
    const es_light_view* view;
    es_importance* importance;
    const es_receivers* receivers;
    const es_gi_kernels* kernels;
    float* factor;      /* per block: rows of size / BLOCK, faces one after another */
    double (*sums)[2];  /* per row of blocks: of importance, of importance times factor */
    float floor;
} view_job;

static void view_factor_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    view_job* job = user;
    uint32_t size = job->importance->size, blocks = size / BLOCK;
    es_sender senders[BLOCKS_MAX];
    uint32_t column[BLOCKS_MAX];
    float found[BLOCKS_MAX];
    for (uint32_t row = begin; row < end; row++) {
        uint32_t f = row / blocks, y = row % blocks * BLOCK, count = 0;
        const es_light_face* face = &job->view->faces[f];
        const float* importance = job->importance->sums + f * job->importance->face_floats + (size_t)y * size;
        float* factor = job->factor + (size_t)row * blocks;
        for (uint32_t b = 0; b < blocks; b++) {
            factor[b] = 0.0f;
            /* the block stands at its brightest texel: it has one, and on the surface that matters */
            uint32_t best_x = 0, best_y = 0;
            float best = 0.0f;
            for (uint32_t k = 0; k < BLOCK * BLOCK; k++) {
                float value = importance[(size_t)(k / BLOCK) * size + b * BLOCK + k % BLOCK];
                if (value > best) {
                    best = value;
                    best_x = b * BLOCK + k % BLOCK;
                    best_y = y + k / BLOCK;
                }
            }
            if (!(best > 0.0f)) continue;
            size_t at = (size_t)best_y * face->gbuffer.stride + best_x;
            es_vec3 p = es_pixel_rays_position(&face->gbuffer_rays, (float)best_x, (float)best_y, face->gbuffer.depth[at]), n = es_unpack_normal(face->gbuffer.normal[at]);
            column[count] = b;
            senders[count++] = (es_sender){{p.x, p.y, p.z}, {n.x, n.y, n.z}};
        }
        job->kernels->view_importance(job->receivers, senders, count, found);
        for (uint32_t k = 0; k < count; k++) factor[column[k]] = found[k];
        double sum = 0.0, weighted = 0.0;
        for (uint32_t b = 0; b < blocks; b++) {
            double block = 0.0;
            for (uint32_t k = 0; k < BLOCK * BLOCK; k++) block += importance[(size_t)(k / BLOCK) * size + b * BLOCK + k % BLOCK];
            sum += block;
            weighted += block * factor[b];
        }
        job->sums[row][0] = sum;
        job->sums[row][1] = weighted;
    }
}

static void view_weight_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    view_job* job = user;
    uint32_t size = job->importance->size, blocks = size / BLOCK;
    for (uint32_t row = begin; row < end; row++) {
        uint32_t f = row / size, y = row % size;
        float* importance = job->importance->sums + f * job->importance->face_floats + (size_t)y * size;
        const float* factor = job->factor + ((size_t)f * blocks + y / BLOCK) * blocks;
        for (uint32_t x = 0; x < size; x++) importance[x] *= job->floor + factor[x / BLOCK];
    }
}

static es_result weigh_by_view(es_context* context, es_importance* importance, const es_light_view* view, const es_receivers* receivers)
{
    uint32_t blocks = importance->size / BLOCK, rows = blocks * importance->face_count;
    view_job job = {.view = view, .importance = importance, .receivers = receivers, .kernels = es_gi_kernel_table(es_context_isa(context))};
    es_arena scratch;
    es_arena_init(&scratch, context, 1 << 16);
    job.factor = es_arena_allocate(&scratch, (size_t)rows * blocks * sizeof *job.factor);
    job.sums = job.factor ? es_arena_allocate(&scratch, rows * sizeof *job.sums) : NULL;
    es_result result = job.sums ? ES_OK : es_context_last_result(context);
    if (!result) {
        es_parallel_for(context, rows, 4, view_factor_rows, &job);
        double sum = 0.0, weighted = 0.0;
        for (uint32_t row = 0; row < rows; row++) {
            sum += job.sums[row][0];
            weighted += job.sums[row][1];
        }
        /* nothing the light reaches can light what is seen: then eq. 4.3 alone decides */
        job.floor = weighted > 0.0 && sum > 0.0 ? (float)(VIEW_FLOOR * weighted / sum) : 1.0f;
        es_parallel_for(context, importance->size * importance->face_count, 16, view_weight_rows, &job);
    }
    es_arena_free(&scratch);
    return result;
}

es_result es_importance_build(es_context* context, es_importance* importance, const es_light_view* view, const es_receivers* receivers)
{
    uint32_t size = view->faces[0].gbuffer.width;
    if (importance->size != size || importance->face_count != view->face_count) {
        es_importance_free(context, importance);
        size_t total = 0;
        uint32_t levels = 0;
        for (uint32_t s = size; s >= 1; s /= 2) {
            importance->level_offset[levels++] = total;
            total += (size_t)s * s;
        }
        importance->sums = es_allocate_array(context, total * view->face_count, sizeof(float));
        if (!importance->sums) return es_context_last_result(context);
        importance->size = size;
        importance->level_count = levels;
        importance->face_count = view->face_count;
        importance->face_floats = total;
    }
    importance_job job = {view, importance};
    es_parallel_for(context, size * view->face_count, 8, importance_rows, &job);
    if (receivers && receivers->count) {
        es_result result = weigh_by_view(context, importance, view, receivers);
        if (result) return result;
    }
    for (uint32_t f = 0; f < view->face_count; f++) {
        float* sums = importance->sums + f * importance->face_floats;
        for (uint32_t l = 1; l < importance->level_count; l++) {
            uint32_t s = size >> l;
            const float* fine = sums + importance->level_offset[l - 1];
            float* coarse = sums + importance->level_offset[l];
            for (uint32_t y = 0; y < s; y++)
                for (uint32_t x = 0; x < s; x++) {
                    const float* p = fine + (size_t)(2 * y) * (2 * s) + 2 * x;
                    coarse[(size_t)y * s + x] = (p[0] + p[1]) + (p[2 * s] + p[2 * s + 1]);
                }
        }
    }
    return ES_OK;
}

void es_importance_free(es_context* context, es_importance* importance)
{
    if (importance->sums) es_release(context, importance->sums, importance->face_floats * importance->face_count * sizeof(float));
    *importance = (es_importance){0};
}

/* Splits [0, 1) at `share`, says on which side u lies and stretches that side back to [0, 1). */
static bool split(float* u, float share)
{
    const float below_one = 0.99999994f;
    if (*u < share) {
        *u = es_minf(*u / share, below_one);
        return false;
    }
    *u = es_minf((*u - share) / (1.0f - share), below_one);
    return true;
}

bool es_importance_warp(const es_importance* importance, float u, float v, uint32_t* face, uint32_t* x, uint32_t* y, float* probability)
{
    float total = 0.0f, top[6];
    for (uint32_t f = 0; f < importance->face_count; f++) {
        top[f] = importance->sums[f * importance->face_floats + importance->level_offset[importance->level_count - 1]];
        total += top[f];
    }
    if (!(total > 0.0f)) return false;
    /* several faces: one more splitting step, along u */
    float left = total;
    uint32_t f = 0;
    for (; f + 1 < importance->face_count; f++) {
        if (top[f] > 0.0f && (left <= top[f] || !split(&u, top[f] / left))) break;
        left -= top[f];
    }
    while (!(top[f] > 0.0f)) f = f ? f - 1 : importance->face_count - 1; /* rounding led past the last lit face */

    const float* sums = importance->sums + f * importance->face_floats;
    uint32_t cx = 0, cy = 0;
    for (int l = (int)importance->level_count - 2; l >= 0; l--) {
        uint32_t size = importance->size >> l;
        const float* p = sums + importance->level_offset[l] + (size_t)(2 * cy) * size + 2 * cx;
        float upper = p[0] + p[1], lower = p[size] + p[size + 1];
        uint32_t row = !(lower > 0.0f) ? 0 : !(upper > 0.0f) ? 1 : (uint32_t)split(&v, upper / (upper + lower));
        const float* q = p + (row ? size : 0);
        uint32_t column = !(q[1] > 0.0f) ? 0 : !(q[0] > 0.0f) ? 1 : (uint32_t)split(&u, q[0] / (q[0] + q[1]));
        cx = 2 * cx + column;
        cy = 2 * cy + row;
    }
    *face = f;
    *x = cx;
    *y = cy;
    *probability = sums[(size_t)cy * importance->size + cx] / total;
    return *probability > 0.0f;
}

void es_vpl_make(const es_light_view* view, const es_vpl_place* place, const es_surface* surface, bool glossy, es_vpl_record* record)
{
    es_vec3 tangent, bitangent;
    es_orthonormal_basis(place->normal, &tangent, &bitangent);
    es_vec3 power = es_v3_scale(es_v3(view->light.radiant[0], view->light.radiant[1], view->light.radiant[2]), place->share);
    es_vec3 flux = es_v3_mul(power, surface->albedo);
    *record = (es_vpl_record){
        .position = {place->position.x, place->position.y, place->position.z},
        .normal = {place->normal.x, place->normal.y, place->normal.z},
        .tangent = {tangent.x, tangent.y, tangent.z},
        .bitangent = {bitangent.x, bitangent.y, bitangent.z},
        .flux = {flux.x, flux.y, flux.z},
        .power = {power.x, power.y, power.z},
        .incident = {place->incident.x, place->incident.y, place->incident.z},
        .specular_color = {surface->specular.x, surface->specular.y, surface->specular.z},
        .area = place->area,
        .roughness = surface->roughness,
        .model = surface->model,
        .glossy = glossy && es_surface_has_lobe(surface),
    };
}

static void make_record(const es_light_view* view, const es_light_face* face, uint32_t x, uint32_t y, float weight, bool glossy, es_vpl_record* record)
{
    const es_gbuffer* gbuffer = &face->gbuffer;
    size_t at = (size_t)y * gbuffer->stride + x;
    float depth = gbuffer->depth[at];
    es_vec3 position = es_pixel_rays_position(&face->gbuffer_rays, (float)x, (float)y, depth), normal = es_unpack_normal(gbuffer->normal[at]);
    es_vec3 incident = view->orthographic ? es_v3_scale(view->light.direction, -1.0f) : es_v3_normalize(es_v3_sub(view->light.position, position), normal);
    es_surface surface = surface_at(gbuffer, at);
    es_vpl_place place = {position, normal, incident, es_light_texel_share(view, face, (float)x, (float)y, depth) * weight, es_light_texel_area(view, face, (float)x, (float)y, depth, normal) * weight};
    es_vpl_make(view, &place, &surface, glossy, record);
}

/* VPLs of each light by emitted power: rounded down, the remainder to the lights in order. */
static void share_out(const es_light_view* views, uint32_t view_count, uint32_t count, uint32_t* shares)
{
    double total = 0.0;
    for (uint32_t i = 0; i < view_count; i++) total += views[i].power;
    uint32_t given = 0;
    for (uint32_t i = 0; i < view_count; i++) {
        shares[i] = total > 0.0 ? (uint32_t)((double)count * views[i].power / total) : 0;
        given += shares[i];
    }
    for (uint32_t i = 0; given < count && i < view_count; i = (i + 1) % view_count, given++)
        if (views[i].power > 0.0f) shares[i]++;
        else given--;
}

float es_importance_total(const es_importance* importance)
{
    float total = 0.0f;
    for (uint32_t f = 0; f < importance->face_count; f++) total += importance->sums[f * importance->face_floats + importance->level_offset[importance->level_count - 1]];
    return total;
}

void es_vpl_shares(const es_light_view* views, uint32_t view_count, const es_importance* importances, uint32_t count, uint32_t* shares)
{
    share_out(views, view_count, count, shares);
    for (uint32_t i = 0; i < view_count; i++)
        if (!(es_importance_total(&importances[i]) > 0.0f)) shares[i] = 0; /* lights nothing */
}

bool es_light_texel_of(const es_light_view* view, const es_light_face* face, es_vec3 position, float* x, float* y, float* depth)
{
    const es_pixel_rays* r = &face->gbuffer_rays;
    es_vec3 v = es_v3_sub(position, es_v3(r->base[0], r->base[1], r->base[2])), d = es_v3(r->dir[0], r->dir[1], r->dir[2]);
    const float *sx = view->orthographic ? r->base_dx : r->dir_dx, *sy = view->orthographic ? r->base_dy : r->dir_dy;
    es_vec3 dx = es_v3(sx[0], sx[1], sx[2]), dy = es_v3(sy[0], sy[1], sy[2]), forward = es_v3_normalize(es_v3_cross(dx, dy), d);
    *depth = es_v3_dot(v, forward) / es_v3_dot(d, forward);
    if (!(*depth > 0.0f)) return false;
    /* orthographic: v - depth · d lies in the plane of dx and dy; perspective: v / depth - d does */
    es_vec3 q = view->orthographic ? es_v3_sub(v, es_v3_scale(d, *depth)) : es_v3_sub(es_v3_scale(v, 1.0f / *depth), d);
    float u = es_v3_dot(q, dx) / es_v3_dot(dx, dx) + 0.5f, w = es_v3_dot(q, dy) / es_v3_dot(dy, dy) + 0.5f;
    float size = (float)face->gbuffer.width;
    if (!(u >= 0.0f && u < size && w >= 0.0f && w < size)) return false;
    *x = u - 0.5f;
    *y = w - 0.5f;
    return true;
}

float es_vpl_area_at(const es_light_view* view, const es_importance* importance, uint32_t share, es_vec3 position, es_vec3 normal)
{
    uint32_t f = 0;
    float depth = 0.0f, fx = 0.0f, fy = 0.0f, total = es_importance_total(importance);
    while (f < view->face_count && !es_light_texel_of(view, &view->faces[f], position, &fx, &fy, &depth)) f++;
    if (f == view->face_count || !share || !(total > 0.0f)) return __builtin_inff();
    const uint32_t x = (uint32_t)(fx + 0.5f), y = (uint32_t)(fy + 0.5f), last = importance->size - 1; /* rounding may lead past it */
    float probability = importance->sums[f * importance->face_floats + (size_t)(y < last ? y : last) * importance->size + (x < last ? x : last)] / total;
    return probability > 1e-20f ? es_light_texel_area(view, &view->faces[f], (float)x, (float)y, depth, normal) / (probability * (float)share) : __builtin_inff();
}

es_result es_vpls_sample(es_context* context, const es_light_view* views, uint32_t view_count, const es_importance* importances, const es_vpl_request* request,
    es_vpl_record* records, uint32_t* count)
{
    *count = 0;
    double total_power = 0.0;
    for (uint32_t i = 0; i < view_count; i++) total_power += views[i].power;
    if (!(total_power > 0.0) || !request->count) return ES_OK;

    uint32_t* shares = es_allocate_array(context, view_count, sizeof *shares);
    uint32_t* next = shares ? es_allocate_array(context, view_count, sizeof *next) : NULL;
    if (!next) {
        es_release(context, shares, view_count * sizeof *shares);
        return es_context_last_result(context);
    }
    es_vpl_shares(views, view_count, importances, request->count, shares);
    uint32_t drawn = 0;
    for (uint32_t i = 0; i < view_count; i++) {
        next[i] = 0;
        drawn += shares[i];
    }

    /* Samples of all lights in the order of (i + ½) / share: each subset, a run of this order, has its share of every light.
     * The k-th of subset s becomes record s + k · subsets; the first drawn % subsets subsets have one more. */
    uint32_t subset = 0, in_subset = 0;
    for (uint32_t made = 0; made < drawn; made++) {
        uint32_t chosen = 0;
        float lowest = 2.0f;
        for (uint32_t i = 0; i < view_count; i++) {
            if (next[i] >= shares[i]) continue;
            float key = ((float)next[i] + 0.5f) / (float)shares[i];
            if (key < lowest) {
                lowest = key;
                chosen = i;
            }
        }
        uint32_t index = request->seed + next[chosen]++;
        uint32_t face, x, y;
        float probability;
        uint32_t size_of_subset = drawn / request->subsets + (subset < drawn % request->subsets);
        while (size_of_subset == 0 || in_subset >= size_of_subset) {
            subset++;
            in_subset = 0;
            size_of_subset = drawn / request->subsets + (subset < drawn % request->subsets);
        }
        es_vpl_record* record = &records[subset + in_subset++ * request->subsets];
        /* the sequence's first point is the origin itself: start at 1 */
        if (!es_importance_warp(&importances[chosen], es_halton(0, index + 1), es_halton(1, index + 1), &face, &x, &y, &probability)) {
            *record = (es_vpl_record){.normal = {0, 1, 0}, .tangent = {0, 0, 1}, .bitangent = {1, 0, 0}, .incident = {0, 1, 0}, .roughness = 1.0f};
            continue; /* underflowed importance: a light that sends nothing */
        }
        make_record(&views[chosen], &views[chosen].faces[face], x, y, 1.0f / (probability * (float)shares[chosen]), request->glossy, record);
    }
    *count = drawn;
    es_release(context, shares, view_count * sizeof *shares);
    es_release(context, next, view_count * sizeof *next);
    return ES_OK;
}
