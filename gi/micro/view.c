#include "gi/micro/view.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"

static es_vec3 vector(const float v[3]) { return es_v3(v[0], v[1], v[2]); }

/* Row by row of the disc: which of the buffer's pixels each shows; UINT32_MAX: none. */
typedef struct view_loop {
    const es_micro_pixel* pixels;
    uint32_t size;
    es_vec3 right, up, normal;
    uint32_t* shown;
    float limit[ES_MICRO_MAX_SIZE * ES_MICRO_MAX_SIZE]; /* cosine of the angle from a pixel's middle up to which it is shown */
} view_loop;

static float cosine_between(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* A pixel at the edge of the square reaches to the horizon, or a lobe's to where there is next to nothing of it: so far as its farthest neighbour, and half as
 * far again. */
static void find_limits(view_loop* v)
{
    const es_micro_pixel* c = v->pixels;
    const uint32_t size = v->size;
    for (uint32_t i = 0; i < size * size; i++) {
        const uint32_t x = i % size, y = i / size;
        float least = 1;
        if (x > 0) least = es_minf(least, cosine_between(c[i].direction, c[i - 1].direction));
        if (x + 1 < size) least = es_minf(least, cosine_between(c[i].direction, c[i + 1].direction));
        if (y > 0) least = es_minf(least, cosine_between(c[i].direction, c[i - size].direction));
        if (y + 1 < size) least = es_minf(least, cosine_between(c[i].direction, c[i + size].direction));
        v->limit[i] = es_cos(es_minf(1.5f * es_acos(least), 0.5f * ES_PI));
    }
}

static void find_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const view_loop* v = user;
    const uint32_t count = v->size * v->size;
    for (uint32_t y = begin; y < end; y++)
        for (uint32_t x = 0; x < ES_MICRO_VIEW_SIZE; x++) {
            const float a = ((float)x + 0.5f) * (2.0f / ES_MICRO_VIEW_SIZE) - 1, b = 1 - ((float)y + 0.5f) * (2.0f / ES_MICRO_VIEW_SIZE), r = es_sqrt(a * a + b * b);
            uint32_t best = UINT32_MAX;
            if (r <= 1) {
                float sine, cosine, most = -1;
                es_sincos(0.5f * ES_PI * r, &sine, &cosine);
                const float across = r > 0 ? sine / r : 0;
                const es_vec3 d = es_v3_add(es_v3_scale(v->normal, cosine), es_v3_add(es_v3_scale(v->right, across * a), es_v3_scale(v->up, across * b)));
                for (uint32_t i = 0; i < count; i++) {
                    const float* middle = v->pixels[i].direction;
                    const float near = d.x * middle[0] + d.y * middle[1] + d.z * middle[2];
                    if (near > most) {
                        most = near;
                        best = i;
                    }
                }
                if (best != UINT32_MAX && most < v->limit[best]) best = UINT32_MAX;
            }
            v->shown[y * ES_MICRO_VIEW_SIZE + x] = best;
        }
}

static void put(const es_micro_pixel* pixels, const uint32_t* shown, uint32_t size, es_image* radiance, es_image* distance)
{
    for (size_t i = 0; i < (size_t)size * size; i++) {
        const uint32_t from = shown ? shown[i] : (uint32_t)i;
        if (from == UINT32_MAX) continue; /* images begin black */
        if (radiance) memcpy(radiance->pixels + 3 * i, pixels[from].radiance, 3 * sizeof(float));
        if (distance) distance->pixels[i] = pixels[from].distance;
    }
}

es_result es_micro_view(es_context* context, const es_micro_pixel* pixels, uint32_t size, const float normal[3], const float right[3], bool over_hemisphere, es_image* radiance, es_image* distance)
{
    const uint32_t side = over_hemisphere ? ES_MICRO_VIEW_SIZE : size;
    uint32_t* shown = NULL;
    if (radiance) *radiance = (es_image){0};
    if (distance) *distance = (es_image){0};
    es_result result = radiance ? es_image_create(context, side, side, 3, radiance) : ES_OK;
    if (!result && distance) result = es_image_create(context, side, side, 1, distance);
    if (!result && over_hemisphere) {
        shown = es_allocate_array(context, (size_t)side * side, sizeof *shown);
        if (!shown) result = es_context_last_result(context);
    }
    if (result) {
        if (radiance) es_image_destroy(context, radiance);
        if (distance) es_image_destroy(context, distance);
        return result;
    }
    if (shown) {
        const es_vec3 n = vector(normal), r = vector(right);
        es_vec3 t, b;
        es_orthonormal_basis(n, &t, &b);
        view_loop loop = {.pixels = pixels, .size = size, .normal = n, .right = es_v3_normalize(es_v3_sub(r, es_v3_scale(n, es_v3_dot(r, n))), t), .shown = shown};
        find_limits(&loop);
        loop.up = es_v3_cross(loop.right, n); /* seen from the point, out of the surface */
        es_parallel_for(context, side, 8, find_rows, &loop);
    }
    put(pixels, shown, side, radiance, distance);
    es_release(context, shown, (size_t)side * side * sizeof *shown);
    return ES_OK;
}
