/* Textures: 16-bit linear texels and their mip chains. */
#include "platform/context.h"
#include "raster/raster.h"

/* 65535 * decode(i / 255) rounded to nearest, decode after IEC 61966-2-1: c / 12.92 up to 0.04045, ((c + 0.055) / 1.055)^2.4 above.
 * The smallest step is 19, so 16 bits keep all 8-bit values apart. */
static const uint16_t srgb_to_linear[256] = {
    0, 20, 40, 60, 80, 99, 119, 139, 159, 179, 199, 219, 241, 264, 288, 313,
    340, 367, 396, 427, 458, 491, 526, 562, 599, 637, 677, 718, 761, 805, 851, 898,
    947, 997, 1048, 1101, 1156, 1212, 1270, 1330, 1391, 1453, 1517, 1583, 1651, 1720, 1790, 1863,
    1937, 2013, 2090, 2170, 2250, 2333, 2418, 2504, 2592, 2681, 2773, 2866, 2961, 3058, 3157, 3258,
    3360, 3464, 3570, 3678, 3788, 3900, 4014, 4129, 4247, 4366, 4488, 4611, 4736, 4864, 4993, 5124,
    5257, 5392, 5530, 5669, 5810, 5953, 6099, 6246, 6395, 6547, 6700, 6856, 7014, 7174, 7335, 7500,
    7666, 7834, 8004, 8177, 8352, 8528, 8708, 8889, 9072, 9258, 9445, 9635, 9828, 10022, 10219, 10417,
    10619, 10822, 11028, 11235, 11446, 11658, 11873, 12090, 12309, 12530, 12754, 12980, 13209, 13440, 13673, 13909,
    14146, 14387, 14629, 14874, 15122, 15371, 15623, 15878, 16135, 16394, 16656, 16920, 17187, 17456, 17727, 18001,
    18277, 18556, 18837, 19121, 19407, 19696, 19987, 20281, 20577, 20876, 21177, 21481, 21787, 22096, 22407, 22721,
    23038, 23357, 23678, 24002, 24329, 24658, 24990, 25325, 25662, 26001, 26344, 26688, 27036, 27386, 27739, 28094,
    28452, 28813, 29176, 29542, 29911, 30282, 30656, 31033, 31412, 31794, 32179, 32567, 32957, 33350, 33745, 34143,
    34544, 34948, 35355, 35764, 36176, 36591, 37008, 37429, 37852, 38278, 38706, 39138, 39572, 40009, 40449, 40891,
    41337, 41785, 42236, 42690, 43147, 43606, 44069, 44534, 45002, 45473, 45947, 46423, 46903, 47385, 47871, 48359,
    48850, 49344, 49841, 50341, 50844, 51349, 51858, 52369, 52884, 53401, 53921, 54445, 54971, 55500, 56032, 56567,
    57105, 57646, 58190, 58737, 59287, 59840, 60396, 60955, 61517, 62082, 62650, 63221, 63795, 64372, 64952, 65535};

static es_result create(es_context* context, uint32_t width, uint32_t height, es_texture_image* image)
{
    *image = (es_texture_image){0};
    if (width < 1 || height < 1 || width > ES_TEXTURE_MAX_SIZE || height > ES_TEXTURE_MAX_SIZE)
        return es_fail(context, ES_IMAGE_SIZE, "a texture of %u x %u texels; 1 to %d each way are supported", width, height, ES_TEXTURE_MAX_SIZE);
    es_texture_image t = {.width = width, .height = height};
    size_t texels = 0;
    for (uint32_t w = width, h = height;; w = w > 1 ? w / 2 : 1, h = h > 1 ? h / 2 : 1) {
        t.level_offset[t.level_count++] = (uint32_t)texels;
        texels += (size_t)w * h;
        if (w == 1 && h == 1) break;
    }
    t.bytes = texels * 8;
    t.texels = es_allocate(context, t.bytes);
    if (!t.texels) return es_context_last_result(context);
    es_context_count_object(context, 1);
    *image = t;
    return ES_OK;
}

/* The taps of destination texel i when n texels become m = max(1, n / 2): [2i, 2i + 2) when n is even, and for odd n = 2m + 1 the
 * three that n / m source texels overlap, with weights m - i, m, i + 1 out of n. Returns their number. */
static uint32_t taps(uint32_t n, uint32_t m, uint32_t i, uint32_t weight[3])
{
    if (n == 1) {
        weight[0] = 1;
        return 1;
    }
    if (n % 2 == 0) {
        weight[0] = weight[1] = 1;
        return 2;
    }
    weight[0] = m - i;
    weight[1] = m;
    weight[2] = i + 1;
    return 3;
}

/* Each level from the one above, weighted by area: exact integer sums (below 2^16 * 2^28), rounded to nearest. */
static void build_levels(es_texture_image* image)
{
    uint32_t w = image->width, h = image->height;
    for (uint32_t l = 1; l < image->level_count; l++) {
        uint32_t dw = w > 1 ? w / 2 : 1, dh = h > 1 ? h / 2 : 1;
        const uint16_t* from = image->texels + 4 * (size_t)image->level_offset[l - 1];
        uint16_t* to = image->texels + 4 * (size_t)image->level_offset[l];
        for (uint32_t y = 0; y < dh; y++)
            for (uint32_t x = 0; x < dw; x++) {
                uint32_t wx[3], wy[3], nx = taps(w, dw, x, wx), ny = taps(h, dh, y, wy);
                uint32_t x0 = w == 1 ? 0 : 2 * x, y0 = h == 1 ? 0 : 2 * y;
                uint64_t sum[4] = {0}, total = 0;
                for (uint32_t j = 0; j < ny; j++)
                    for (uint32_t i = 0; i < nx; i++) {
                        const uint16_t* texel = from + 4 * ((size_t)(y0 + j) * w + x0 + i);
                        uint64_t weight = (uint64_t)wx[i] * wy[j];
                        total += weight;
                        for (int c = 0; c < 4; c++) sum[c] += weight * texel[c];
                    }
                for (int c = 0; c < 4; c++) to[4 * ((size_t)y * dw + x) + c] = (uint16_t)((sum[c] + total / 2) / total);
            }
        w = dw;
        h = dh;
    }
}

es_result es_texture_image_create(es_context* context, uint32_t width, uint32_t height, const uint8_t* rgba, bool srgb, es_texture_image* image)
{
    es_result result = create(context, width, height, image);
    if (result != ES_OK) return result;
    size_t texels = (size_t)width * height;
    for (size_t i = 0; i < texels; i++)
        for (int c = 0; c < 4; c++) image->texels[4 * i + c] = srgb && c < 3 ? srgb_to_linear[rgba[4 * i + c]] : (uint16_t)(rgba[4 * i + c] * 257);
    build_levels(image);
    return ES_OK;
}

static uint16_t unorm16(float a) { return a > 0 ? (a < 1 ? (uint16_t)(a * 65535.0f + 0.5f) : 65535) : 0; } /* NaN gives 0 */

es_result es_texture_image_from_float(es_context* context, const es_image* source, es_texture_image* image)
{
    *image = (es_texture_image){0};
    if (source->channels < 1 || source->channels > 4)
        return es_fail(context, ES_IMAGE_SIZE, "a texture from an image of %u channels; 1 to 4 are accepted", source->channels);
    es_result result = create(context, source->width, source->height, image);
    if (result != ES_OK) return result;
    size_t texels = (size_t)source->width * source->height;
    uint32_t n = source->channels;
    for (size_t i = 0; i < texels; i++) {
        const float* p = source->pixels + n * i;
        uint16_t* to = image->texels + 4 * i;
        /* Y, YA, RGB, RGBA */
        to[0] = unorm16(p[0]);
        to[1] = unorm16(n < 3 ? p[0] : p[1]);
        to[2] = unorm16(n < 3 ? p[0] : p[2]);
        to[3] = n == 2 ? unorm16(p[1]) : n == 4 ? unorm16(p[3]) : 65535;
    }
    build_levels(image);
    return ES_OK;
}

void es_texture_image_destroy(es_context* context, es_texture_image* image)
{
    if (image->texels) {
        es_release(context, image->texels, image->bytes);
        es_context_count_object(context, -1);
    }
    *image = (es_texture_image){0};
}
