/* G-buffer planes in one block of memory. */
#include "platform/context.h"
#include "raster/raster.h"

es_result es_gbuffer_create(es_context* context, uint32_t width, uint32_t height, uint32_t planes, es_gbuffer* gbuffer)
{
    *gbuffer = (es_gbuffer){0};
    if (width < 1 || height < 1 || width > ES_RASTER_MAX_SIZE || height > ES_RASTER_MAX_SIZE)
        return es_misuse(context, ES_IMAGE_SIZE, "a G-buffer of %u x %u pixels; 1 to %d each way are supported", width, height, ES_RASTER_MAX_SIZE);
    const uint32_t known = (uint32_t)ES_GBUFFER_ALL | (uint32_t)ES_GBUFFER_ALPHA;
    if (!planes || (planes & ~known)) return es_misuse(context, ES_INVALID_ARGUMENT, "G-buffer planes %#x; one or more of %#x are accepted", planes, known);
    es_gbuffer g = {.width = width, .height = height, .stride = (width + 7) / 8 * 8, .planes = planes};
    void** slots[12];
    int count = 0;
    if (planes & ES_GBUFFER_DEPTH) slots[count++] = (void**)&g.depth;
    if (planes & ES_GBUFFER_NORMAL) slots[count++] = (void**)&g.normal;
    if (planes & ES_GBUFFER_GEOMETRIC_NORMAL) slots[count++] = (void**)&g.geometric_normal;
    if (planes & ES_GBUFFER_ALBEDO) slots[count++] = (void**)&g.albedo_rg, slots[count++] = (void**)&g.albedo_b;
    if (planes & ES_GBUFFER_SURFACE) slots[count++] = (void**)&g.surface;
    if (planes & ES_GBUFFER_EMISSION) slots[count++] = (void**)&g.emission;
    if (planes & ES_GBUFFER_MOTION) slots[count++] = (void**)&g.motion_x, slots[count++] = (void**)&g.motion_y;
    if (planes & ES_GBUFFER_INSTANCE) slots[count++] = (void**)&g.instance;
    if (planes & ES_GBUFFER_TRIANGLE) slots[count++] = (void**)&g.triangle;
    if (planes & ES_GBUFFER_ALPHA) slots[count++] = (void**)&g.alpha;
    /* Planes a multiple of 4096 bytes apart would fall into the same cache sets, and eleven are written side by side. */
    size_t plane = ((size_t)g.stride * height * 4 + 63) / 64 * 64;
    if (plane % 4096 < 256 || plane % 4096 > 4096 - 256) plane += 5 * 64 + 256;
    g.memory_bytes = plane * (size_t)count;
    g.memory = es_allocate_zero(context, g.memory_bytes);
    if (!g.memory) return es_context_last_result(context);
    for (int i = 0; i < count; i++) *slots[i] = (char*)g.memory + plane * (size_t)i;
    es_context_count_object(context, 1);
    *gbuffer = g;
    return ES_OK;
}

void es_gbuffer_destroy(es_context* context, es_gbuffer* gbuffer)
{
    if (gbuffer->memory) {
        es_release(context, gbuffer->memory, gbuffer->memory_bytes);
        es_context_count_object(context, -1);
    }
    *gbuffer = (es_gbuffer){0};
}
