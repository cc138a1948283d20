/* Image files: what is written comes back, the shared assets load or are refused as they should be, and nothing that a
 * damaged file says makes the readers crash, leak, or take more memory than allowed. */
#include <dirent.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "platform/image_files.h"

static char folder[64];

static void no_log(void* user, es_log_level level, es_result item, const char* message)
{
    assert_null(strchr(message, '\n'));
    if (user) ++*(int*)user;
}

static es_context* make_context(size_t cap, int* messages)
{
    es_context_desc desc = es_default_context_desc();
    desc.logger = (es_logger){no_log, messages};
    desc.threads = 1;
    desc.memory_cap = cap;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static void end_context(es_context* context)
{
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static const char* path_of(const char* name)
{
    static char path[2][256];
    static int turn;
    turn ^= 1;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

static uint32_t random_bits(uint64_t* state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 33);
}

static float random_float(uint64_t* state) { return (float)random_bits(state) * 0x1p-31f; }

static uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    return bits;
}

static float float_of(uint32_t bits)
{
    float value;
    memcpy(&value, &bits, 4);
    return value;
}

/* Skips the test when the build lacks the library for `ending`. */
static void need(es_context* context, const char* ending)
{
    es_image image;
    char name[32];
    snprintf(name, sizeof name, "probe%s", ending);
    assert_int_equal(es_image_create(context, 1, 1, 3, &image), ES_OK);
    es_result result = es_image_save(context, &image, path_of(name), NULL);
    es_image_destroy(context, &image);
    unlink(path_of(name));
    if (result != ES_NOT_BUILT) return;
    end_context(context);
    skip();
}

/* ---- sample encodings ------------------------------------------------------------------------------------------------- */

static void halves(void** state)
{
    for (uint32_t h = 0; h < 65536; h++) {
        float value = es_half_to_float((uint16_t)h);
        assert_int_equal(es_float_to_half(value), h);  /* NaN payloads included */
        int exponent = (int)(h >> 10 & 31);
        if (exponent == 31) continue;
        double want = ldexp(exponent ? 1024 + (h & 1023) : (h & 1023), (exponent ? exponent : 1) - 25);
        assert_true(fabs((double)value) == want && !signbit(value) == !(h & 0x8000u));
    }
    uint64_t seed = 1;
    for (int i = 0; i < 400000; i++) {
        float value = float_of((random_bits(&seed) << 1 ^ random_bits(&seed)) & 0x7fffffffu);
        uint16_t half = es_float_to_half(value);
        if (isnan(value)) {
            assert_true((half & 0x7c00) == 0x7c00 && (half & 1023));
            continue;
        }
        if (half == 0x7c00) {
            assert_true(value >= 65520.0f);
            continue;
        }
        double here = fabs((double)es_half_to_float(half) - value);
        double above = half == 0x7bff ? 65536.0 - (double)value : fabs((double)es_half_to_float((uint16_t)(half + 1)) - value);
        double below = half ? fabs((double)es_half_to_float((uint16_t)(half - 1)) - value) : INFINITY;
        assert_true(here <= above && here <= below);
        if (here == above || here == below) assert_int_equal(half & 1, 0);
    }
}

static void srgb_curve(void** state)
{
    double thresholds[255];
    es_srgb_thresholds(thresholds);
    for (int code = 0; code < 65536; code++) {
        double encoded = code / 65535.0, want = encoded <= 0.04045 ? encoded / 12.92 : pow((encoded + 0.055) / 1.055, 2.4);
        assert_true(fabs(es_srgb_decode(encoded) - want) <= 2e-15);
    }
    for (int code = 0; code < 256; code++) assert_int_equal(es_srgb_encode8(thresholds, (float)es_srgb_decode(code / 255.0)), code);
    for (int k = 0; k < 255; k++) {
        assert_int_equal(es_srgb_encode8(thresholds, (float)(thresholds[k] * (1 - 1e-6))), k);
        assert_int_equal(es_srgb_encode8(thresholds, (float)(thresholds[k] * (1 + 1e-6))), k + 1);
    }
    assert_int_equal(es_srgb_encode8(thresholds, -1.0f), 0);
    assert_int_equal(es_srgb_encode8(thresholds, NAN), 0);
    assert_int_equal(es_srgb_encode8(thresholds, INFINITY), 255);
}

/* ---- round trips ------------------------------------------------------------------------------------------------------ */

static void assert_same_image(const es_image* a, const es_image* b)
{
    assert_true(a->width == b->width && a->height == b->height && a->channels == b->channels);
    for (uint32_t c = 0; c < a->channels; c++) assert_string_equal(a->channel_names[c], b->channel_names[c]);
    size_t count = (size_t)a->width * a->height * a->channels;
    for (size_t i = 0; i < count; i++) assert_int_equal(bits_of(a->pixels[i]), bits_of(b->pixels[i]));
    assert_true(es_image_hash(a) == es_image_hash(b));
}

static void exr_float(void** state)
{
    static const uint32_t sizes[][3] = {{1, 1, 1}, {1, 40, 2}, {17, 1, 3}, {33, 35, 4}, {64, 48, 9}, {3, 5, 64}};
    es_context* context = make_context(0, NULL);
    need(context, ".exr");
    uint64_t seed = 7;
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        es_image image, back;
        assert_int_equal(es_image_create(context, sizes[s][0], sizes[s][1], sizes[s][2], &image), ES_OK);
        size_t count = (size_t)image.width * image.height * image.channels;
        for (size_t i = 0; i < count; i++) image.pixels[i] = float_of(random_bits(&seed) << 1 ^ random_bits(&seed));
        image.pixels[0] = float_of(0x7f800001u);  /* a signalling NaN */
        if (count > 3) image.pixels[1] = INFINITY, image.pixels[2] = -INFINITY, image.pixels[3] = -0.0f;
        if (image.channels == 9) {
            static const char* const names[9] = {"R", "G", "B", "A", "depth.Z", "id", "normal.X", "normal.Y", "normal.Z"};
            for (int c = 0; c < 9; c++) snprintf(image.channel_names[c], ES_CHANNEL_NAME_SIZE, "%s", names[c]);
        }
        const es_image_save_desc desc = {.sample_type = ES_SAMPLE_FLOAT};
        assert_int_equal(es_image_save(context, &image, path_of("float.exr"), &desc), ES_OK);
        assert_int_equal(es_image_load(context, path_of("float.exr"), &back), ES_OK);
        if (image.channels < 64) {
            assert_same_image(&image, &back);
        } else {  /* more than ten numbered names: the file sorts them as text */
            for (uint32_t c = 0; c < 64; c++) {
                int from = es_image_channel(&back, image.channel_names[c]);
                assert_true(from >= 0);
                for (uint32_t i = 0; i < image.width * image.height; i++) {
                    assert_int_equal(bits_of(back.pixels[i * 64 + (uint32_t)from]), bits_of(image.pixels[i * 64 + c]));
                }
            }
        }
        es_image_destroy(context, &back);
        es_image_destroy(context, &image);
    }
    end_context(context);
}

/* Noise after enough that is even for compressing to gain nothing and lose nothing: among these sizes it comes out exactly as large as it was. */
static void exr_hardly_compressible(void** state)
{
    es_context* context = make_context(0, NULL);
    need(context, ".exr");
    uint64_t seed = 11;
    for (uint32_t width = 12; width < 32; width++)
        for (uint32_t even = 5; even < 12; even++) {
            es_image image, back;
            assert_int_equal(es_image_create(context, width, 4, 1, &image), ES_OK);
            for (uint32_t i = 0; i < width * 4; i++) image.pixels[i] = i < even ? 0.0f : float_of(random_bits(&seed) & 0x7f7fffffu);
            const es_image_save_desc desc = {.sample_type = ES_SAMPLE_FLOAT};
            assert_int_equal(es_image_save(context, &image, path_of("hardly.exr"), &desc), ES_OK);
            assert_int_equal(es_image_load(context, path_of("hardly.exr"), &back), ES_OK);
            assert_same_image(&image, &back);
            es_image_destroy(context, &back);
            es_image_destroy(context, &image);
        }
    end_context(context);
}

static void exr_half(void** state)
{
    es_context* context = make_context(0, NULL);
    need(context, ".exr");
    es_image image, back;
    assert_int_equal(es_image_create(context, 61, 37, 3, &image), ES_OK);
    uint64_t seed = 3;
    for (uint32_t i = 0; i < 61 * 37 * 3; i++) image.pixels[i] = (random_float(&seed) - 0.5f) * ldexpf(1.0f, (int)(i % 30) - 15);
    image.pixels[5] = NAN, image.pixels[6] = INFINITY, image.pixels[7] = 1e30f;
    assert_int_equal(es_image_save(context, &image, path_of("half.EXR"), NULL), ES_OK);
    assert_int_equal(es_image_load(context, path_of("half.EXR"), &back), ES_OK);
    for (uint32_t i = 0; i < 61 * 37 * 3; i++) {
        assert_int_equal(bits_of(back.pixels[i]), bits_of(es_half_to_float(es_float_to_half(image.pixels[i]))));
    }
    es_image_destroy(context, &back);
    es_image_destroy(context, &image);
    end_context(context);
}

static void png_round_trip(void** state)
{
    es_context* context = make_context(0, NULL);
    need(context, ".png");
    for (uint32_t channels = 1; channels <= 4; channels++) {
        es_image image, back, again;
        assert_int_equal(es_image_create(context, 256, 3, channels, &image), ES_OK);
        for (uint32_t i = 0; i < 256 * 3 * channels; i++) image.pixels[i] = (float)((i * 7 + i / 256) % 256) / 255.0f;
        const es_image_save_desc display = {.already_srgb = true};
        assert_int_equal(es_image_save(context, &image, path_of("a.png"), &display), ES_OK);
        assert_int_equal(es_image_load(context, path_of("a.png"), &back), ES_OK);
        assert_int_equal(back.channels, channels);
        uint32_t colours = channels - (channels % 2 == 0);
        for (uint32_t i = 0; i < 256 * 3 * channels; i++) {
            float want = i % channels < colours ? (float)es_srgb_decode((double)((i * 7 + i / 256) % 256) / 255.0) : image.pixels[i];
            assert_int_equal(bits_of(back.pixels[i]), bits_of(want));
        }
        /* linear values through the curve and back give the same codes */
        assert_int_equal(es_image_save(context, &back, path_of("b.png"), NULL), ES_OK);
        assert_int_equal(es_image_load(context, path_of("b.png"), &again), ES_OK);
        assert_same_image(&back, &again);
        es_image_destroy(context, &again);
        es_image_destroy(context, &back);
        es_image_destroy(context, &image);
    }
    end_context(context);
}

static const uint8_t png_rgba16[81] = {
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 2, 0, 0, 0, 1,
    16, 6, 0, 0, 0, 164, 178, 163, 201, 0, 0, 0, 24, 73, 68, 65, 84, 120, 218, 99, 248, 255, 191, 129,
    129, 129, 241, 255, 127, 32, 193, 56, 199, 193, 216, 24, 0, 60, 190, 5, 194, 64, 162, 99, 185, 0, 0, 0,
    0, 73, 69, 78, 68, 174, 66, 96, 130,
};
static const uint8_t png_palette[105] = {
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 4, 0, 0, 0, 1,
    2, 3, 0, 0, 0, 132, 82, 231, 94, 0, 0, 0, 12, 80, 76, 84, 69, 255, 0, 0, 0, 255, 0, 0,
    0, 255, 128, 128, 128, 204, 176, 70, 15, 0, 0, 0, 2, 116, 82, 78, 83, 0, 51, 201, 67, 172, 46, 0,
    0, 0, 10, 73, 68, 65, 84, 120, 218, 99, 144, 6, 0, 0, 29, 0, 28, 35, 124, 143, 172, 0, 0, 0,
    0, 73, 69, 78, 68, 174, 66, 96, 130,
};
static const uint8_t png_interlaced[74] = {
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 3, 0, 0, 0, 3,
    1, 0, 0, 0, 1, 9, 84, 184, 132, 0, 0, 0, 17, 73, 68, 65, 84, 120, 218, 99, 104, 96, 104, 96,
    56, 192, 0, 2, 14, 0, 15, 140, 2, 1, 148, 178, 57, 236, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66,
    96, 130,
};
static const uint8_t png_huge[69] = {
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 1, 134, 160, 0, 1, 134, 160,
    8, 2, 0, 0, 0, 39, 48, 156, 159, 0, 0, 0, 12, 73, 68, 65, 84, 120, 218, 99, 96, 96, 96, 0,
    0, 0, 4, 0, 1, 200, 234, 235, 249, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
};

static void png_kinds(void** state)
{
    es_context* context = make_context(64u << 20, NULL);
    need(context, ".png");
    es_image image;
    assert_int_equal(es_image_load_memory(context, png_rgba16, sizeof png_rgba16, "rgba16", &image), ES_OK);
    assert_true(image.width == 2 && image.height == 1 && image.channels == 4);
    const double codes[8] = {65535, 32768, 1, 65535, 0, 257, 40000, 13107};
    for (int i = 0; i < 8; i++) {
        double want = i % 4 == 3 ? codes[i] / 65535 : es_srgb_decode(codes[i] / 65535);
        assert_true(image.pixels[i] == (float)want);
    }
    es_image_destroy(context, &image);

    assert_int_equal(es_image_load_memory(context, png_palette, sizeof png_palette, "palette", &image), ES_OK);
    assert_true(image.width == 4 && image.height == 1 && image.channels == 4);
    assert_true(image.pixels[0] == 1 && image.pixels[1] == 0 && image.pixels[3] == 0);
    assert_true(image.pixels[5] == 1 && image.pixels[7] == 51 / 255.0f);
    assert_true(image.pixels[12] == (float)es_srgb_decode(128 / 255.0) && image.pixels[15] == 1);
    es_image_destroy(context, &image);

    assert_int_equal(es_image_load_memory(context, png_interlaced, sizeof png_interlaced, "interlaced", &image), ES_OK);
    assert_true(image.width == 3 && image.height == 3 && image.channels == 1);
    for (int i = 0; i < 9; i++) assert_true(image.pixels[i] == (i % 2 ? 0.0f : 1.0f));
    es_image_destroy(context, &image);

    assert_int_equal(es_image_load_memory(context, png_huge, sizeof png_huge, "huge", &image), ES_IMAGE_SIZE);
    assert_true(es_context_peak_bytes(context) < 16u << 20);
    end_context(context);
}

static void hdr_round_trip(void** state)
{
    es_context* context = make_context(0, NULL);
    static const uint32_t widths[] = {1, 7, 8, 200, 1000};
    uint64_t seed = 11;
    for (size_t w = 0; w < sizeof widths / sizeof *widths; w++) {
        es_image image, back;
        assert_int_equal(es_image_create(context, widths[w], 9, 3, &image), ES_OK);
        for (uint32_t i = 0; i < widths[w] * 9; i++) {
            float scale = i % 5 == 0 ? 1.0f : ldexpf(1.0f, (int)(random_bits(&seed) % 60) - 30);
            for (int c = 0; c < 3; c++) image.pixels[3 * i + (uint32_t)c] = i % 5 == 0 ? 0.25f : random_float(&seed) * scale;  /* runs too */
        }
        image.pixels[0] = 1.0f, image.pixels[1] = 2.0f, image.pixels[2] = 0.5f;  /* powers of two are exact */
        assert_int_equal(es_image_save(context, &image, path_of("a.hdr"), NULL), ES_OK);
        assert_int_equal(es_image_load(context, path_of("a.hdr"), &back), ES_OK);
        assert_true(back.width == widths[w] && back.height == 9 && back.channels == 3);
        for (uint32_t i = 0; i < widths[w] * 9; i++) {
            const float *a = image.pixels + 3 * i, *b = back.pixels + 3 * i;
            float largest = fmaxf(a[0], fmaxf(a[1], a[2]));
            for (int c = 0; c < 3; c++) assert_true(fabsf(a[c] - b[c]) <= largest / 256);
        }
        assert_true(back.pixels[0] == 1.0f && back.pixels[1] == 2.0f && back.pixels[2] == 0.5f);
        es_image_destroy(context, &back);
        es_image_destroy(context, &image);
    }
    es_image image, back;
    assert_int_equal(es_image_create(context, 8, 1, 3, &image), ES_OK);
    const float odd[24] = {NAN, -1, 0, INFINITY, 1, 1, 3.4e38f, 0, 0, 1e-39f, 0, 0, 1e-38f, 0, 0, 0.999999f, 0, 0, 255.9999f, 255.9f, 0};
    memcpy(image.pixels, odd, sizeof odd);
    assert_int_equal(es_image_save(context, &image, path_of("odd.hdr"), NULL), ES_OK);
    assert_int_equal(es_image_load(context, path_of("odd.hdr"), &back), ES_OK);
    assert_true(back.pixels[0] == 0 && back.pixels[1] == 0 && back.pixels[3] == 255 * 0x1p119f && back.pixels[6] == 255 * 0x1p119f);
    assert_true(back.pixels[9] == 0 && back.pixels[15] == 1.0f && back.pixels[18] == 256.0f);
    es_image_destroy(context, &back);
    es_image_destroy(context, &image);
    end_context(context);
}

static es_result load_text(es_context* context, const char* header, const void* pixels, size_t size, es_image* image)
{
    uint8_t bytes[1024];
    size_t n = strlen(header);
    memcpy(bytes, header, n);
    if (size) memcpy(bytes + n, pixels, size);
    return es_image_load_memory(context, bytes, n + size, "text.hdr", image);
}

static void hdr_kinds(void** state)
{
    es_context* context = make_context(64u << 20, NULL);
    static const char* const orientation[8] = {"-Y 2 +X 3", "+Y 2 +X 3", "-Y 2 -X 3", "+Y 2 -X 3", "+X 3 -Y 2", "+X 3 +Y 2", "-X 3 -Y 2", "-X 3 +Y 2"};
    for (int o = 0; o < 8; o++) {
        /* the pixel at (x, y) of the shown image has the red mantissa 10 y + x + 1, wherever the file keeps it */
        uint8_t pixels[24];
        bool columns = o >= 4, x_minus = strstr(orientation[o], "-X") != NULL, y_plus = strstr(orientation[o], "+Y") != NULL;
        for (int k = 0; k < 6; k++) {
            int x = columns ? k / 2 : k % 3, y = columns ? k % 2 : k / 3;
            if (x_minus) x = 2 - x;
            if (y_plus) y = 1 - y;
            memcpy(pixels + 4 * k, (uint8_t[4]){(uint8_t)(10 * y + x + 1), 0, 0, 136}, 4);
        }
        char header[128];
        snprintf(header, sizeof header, "#?RGBE\n# comment\nFORMAT=32-bit_rle_rgbe\n\n%s\n", orientation[o]);
        es_image image;
        assert_int_equal(load_text(context, header, pixels, sizeof pixels, &image), ES_OK);
        assert_true(image.width == 3 && image.height == 2);
        for (int i = 0; i < 6; i++) assert_true(image.pixels[3 * i] == (float)(10 * (i / 3) + i % 3 + 1));
        es_image_destroy(context, &image);
    }
    es_image image;
    /* old runs: one pixel, then three more, then 256 more with a second count */
    const uint8_t old_runs[] = {7, 8, 9, 136, 1, 1, 1, 3, 1, 1, 1, 1, 5, 5, 5, 136};
    assert_int_equal(load_text(context, "#?RADIANCE\nEXPOSURE=2\nEXPOSURE= 2.5e-1\n\n-Y 1 +X 261\n", old_runs, sizeof old_runs, &image), ES_OK);
    assert_true(image.pixels[0] == 14 && image.pixels[3 * 259 + 2] == 18 && image.pixels[3 * 260] == 10);
    es_image_destroy(context, &image);

    assert_int_equal(load_text(context, "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "abcd", 4, &image), ES_FILE_UNSUPPORTED);
    assert_int_equal(load_text(context, "#?RADIANCE\n\n-Y 99999 +X 99999\n", "abcd", 4, &image), ES_IMAGE_SIZE);
    assert_int_equal(load_text(context, "#?RADIANCE\n\n-Y 0 +X 5\n", "abcd", 4, &image), ES_IMAGE_SIZE);
    assert_int_equal(load_text(context, "#?RADIANCE\n\n-Y 16384 +X 16384\n", "abcd", 4, &image), ES_FILE_DAMAGED);
    assert_int_equal(load_text(context, "#?RADIANCE\n\n-Y 4 -Y 4\n", "abcd", 4, &image), ES_FILE_DAMAGED);
    assert_int_equal(load_text(context, "#?RADIANCE\n\n-Y 1 +X 2\n", "\1\1\1\2abcd", 8, &image), ES_FILE_DAMAGED);
    assert_int_equal(load_text(context, "#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n", "abcd", 4, &image), ES_FILE_DAMAGED);
    assert_int_equal(load_text(context, "#?RADIANCE\n", "", 0, &image), ES_FILE_DAMAGED);
    assert_null(image.pixels);
    end_context(context);
}

/* ---- refusals --------------------------------------------------------------------------------------------------------- */

static int files_in_folder(void)
{
    DIR* dir = opendir(folder);
    int count = 0;
    for (struct dirent* entry; (entry = readdir(dir));) count += entry->d_name[0] != '.';
    closedir(dir);
    return count;
}

static void write_file(const char* path, const void* bytes, size_t size)
{
    FILE* file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    fclose(file);
}

static void refused_loads(void** state)
{
    int messages = 0;
    es_context* context = make_context(0, &messages);
    es_image image;
    write_file(path_of("empty.exr"), "", 0);
    write_file(path_of("text.png"), "hello, world", 12);
    const struct { const char* path; es_result want; } cases[] = {{"missing.exr", ES_FILE_NOT_FOUND}, {"empty.exr", ES_FILE_EMPTY},
        {"text.png", ES_FILE_TYPE}, {".", ES_FILE_READ}, {"text.png/x.exr", ES_FILE_NOT_FOUND}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        memset(&image, 0xff, sizeof image);
        messages = 0;
        assert_int_equal(es_image_load(context, path_of(cases[i].path), &image), cases[i].want);
        assert_int_equal(messages, 1);
        assert_non_null(strstr(es_context_message(context), folder));
        assert_null(image.pixels);
    }
    assert_int_equal(es_image_load(context, "/dev/zero", &image), ES_FILE_READ);
    assert_int_equal(es_image_load_memory(context, NULL, 0, "nothing", &image), ES_FILE_EMPTY);
    assert_int_equal(es_image_load(context, NULL, &image), ES_INVALID_ARGUMENT);
    unlink(path_of("empty.exr"));
    unlink(path_of("text.png"));
    end_context(context);
}

static void refused_saves(void** state)
{
    int messages = 0;
    es_context* context = make_context(0, &messages);
    es_image image;
    assert_int_equal(es_image_create(context, 64, 64, 5, &image), ES_OK);
    int before = files_in_folder();
    messages = 0;
    assert_int_equal(es_image_save(context, &image, path_of("five.hdr"), NULL), ES_INVALID_ARGUMENT);
    assert_int_equal(messages, 1);
    es_result png = es_image_save(context, &image, path_of("five.png"), NULL);
    assert_true(png == ES_INVALID_ARGUMENT || png == ES_NOT_BUILT);
    assert_int_equal(es_image_save(context, &image, path_of("five.jpg"), NULL), ES_FILE_TYPE);
    assert_int_equal(es_image_save(context, &image, path_of("no/such/folder.hdr"), NULL), ES_FILE_WRITE);
    memcpy(image.channel_names[1], image.channel_names[0], ES_CHANNEL_NAME_SIZE);
    es_result exr = es_image_save(context, &image, path_of("same.exr"), NULL);
    assert_true(exr == ES_INVALID_ARGUMENT || exr == ES_NOT_BUILT);

    es_image wrong = image;
    wrong.width = 0;
    assert_int_equal(es_image_save(context, &wrong, path_of("zero.hdr"), NULL), ES_IMAGE_SIZE);
    wrong.width = 20000;
    assert_int_equal(es_image_save(context, &wrong, path_of("large.hdr"), NULL), ES_IMAGE_SIZE);
    wrong = image;
    wrong.channels = 0;
    assert_int_equal(es_image_save(context, &wrong, path_of("none.hdr"), NULL), ES_IMAGE_SIZE);
    assert_int_equal(es_image_save(context, NULL, path_of("null.hdr"), NULL), ES_INVALID_ARGUMENT);
    assert_int_equal(files_in_folder(), before);
    es_image_destroy(context, &image);

    /* a folder has the target's name */
    assert_int_equal(es_image_create(context, 512, 512, 3, &image), ES_OK);
    uint64_t seed = 5;
    for (uint32_t i = 0; i < 512 * 512 * 3; i++) image.pixels[i] = random_float(&seed);
    static const char* const names[3] = {"folder.exr", "folder.png", "folder.hdr"};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(mkdir(path_of(names[i]), 0777), 0);
        before = files_in_folder();
        assert_int_equal(es_image_save(context, &image, path_of(names[i]), NULL), ES_FILE_WRITE);
        assert_int_equal(files_in_folder(), before);
        assert_int_equal(rmdir(path_of(names[i])), 0);
    }
    assert_int_equal(es_image_create(context, 0, 5, 1, &(es_image){0}), ES_IMAGE_SIZE);
    assert_int_equal(es_image_create(context, 20000, 20000, 1, &(es_image){0}), ES_IMAGE_SIZE);
    es_image_destroy(context, &image);
    end_context(context);
}

/* Writing beyond `bytes` fails as on a full disk; 0 takes the limit away. */
static void limit_file_size(rlim_t bytes)
{
    struct rlimit limit;
    getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = bytes ? bytes : limit.rlim_max;
    signal(SIGXFSZ, bytes ? SIG_IGN : SIG_DFL);
    setrlimit(RLIMIT_FSIZE, &limit);
}

/* An existing file survives a failing save, and a good one replaces it. */
static void full_disk(void** state)
{
    es_context* context = make_context(0, NULL);
    es_image image, back;
    assert_int_equal(es_image_create(context, 512, 512, 3, &image), ES_OK);
    uint64_t seed = 5;
    for (uint32_t i = 0; i < 512 * 512 * 3; i++) image.pixels[i] = random_float(&seed);
    static const char* const names[3] = {"full.exr", "full.png", "full.hdr"};
    for (int i = 0; i < 3; i++) {
        if (es_image_save(context, &image, path_of(names[i]), NULL) == ES_NOT_BUILT) continue;
        es_image small;
        assert_int_equal(es_image_create(context, 4, 4, 3, &small), ES_OK);
        assert_int_equal(es_image_save(context, &small, path_of(names[i]), NULL), ES_OK);
        int before = files_in_folder();
        limit_file_size(20000);
        es_result result = es_image_save(context, &image, path_of(names[i]), NULL);
        limit_file_size(0);
        assert_int_equal(result, ES_FILE_WRITE);
        assert_int_equal(files_in_folder(), before);
        assert_int_equal(es_image_load(context, path_of(names[i]), &back), ES_OK);
        assert_int_equal(back.width, 4);
        es_image_destroy(context, &back);
        es_image_destroy(context, &small);
        unlink(path_of(names[i]));
    }
    es_image_destroy(context, &image);
    end_context(context);
}

/* ---- memory ----------------------------------------------------------------------------------------------------------- */

/* Every allocation in turn fails: the result is OUT_OF_MEMORY, one message, nothing leaks. */
typedef struct failing_allocator { int left; } failing_allocator;

static void* failing_allocate(void* user, size_t size, size_t alignment)
{
    failing_allocator* allocator = user;
    if (allocator->left-- <= 0) return NULL;
    void* pointer = NULL;
    return posix_memalign(&pointer, alignment < sizeof(void*) ? sizeof(void*) : alignment, size ? size : 1) == 0 ? pointer : NULL;
}

static void failing_release(void* user, void* pointer, size_t size) { free(pointer); }

static void out_of_memory(void** state)
{
    failing_allocator allocator = {1 << 30};
    int messages = 0;
    es_context_desc desc = es_default_context_desc();
    desc.allocator = (es_allocator){failing_allocate, failing_release, &allocator};
    desc.logger = (es_logger){no_log, &messages};
    desc.threads = 1;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    static const char* const names[3] = {"m.exr", "m.png", "m.hdr"};
    es_image image, back;
    assert_int_equal(es_image_create(context, 40, 40, 3, &image), ES_OK);
    for (int i = 0; i < 3; i++) {
        if (es_image_save(context, &image, path_of(names[i]), NULL) == ES_NOT_BUILT) continue;
        for (int load = 0; load < 2; load++) {
            for (int allowed = 0;; allowed++) {
                assert_true(allowed < 1000);
                allocator.left = allowed;
                messages = 0;
                es_result result = load ? es_image_load(context, path_of(names[i]), &back) : es_image_save(context, &image, path_of(names[i]), NULL);
                allocator.left = 1 << 30;
                if (result == ES_OK) break;
                assert_int_equal(result, ES_OUT_OF_MEMORY);
                assert_int_equal(messages, 1);
            }
            if (load) es_image_destroy(context, &back);
        }
        unlink(path_of(names[i]));
    }
    es_image_destroy(context, &image);
    end_context(context);
}

/* ---- damaged files ---------------------------------------------------------------------------------------------------- */

static uint8_t* read_bytes(const char* path, size_t* size)
{
    FILE* file = fopen(path, "rb");
    if (!file) return NULL;
    fseek(file, 0, SEEK_END);
    *size = (size_t)ftell(file);
    rewind(file);
    uint8_t* bytes = malloc(*size + 1);
    assert_int_equal(fread(bytes, 1, *size, file), *size);
    fclose(file);
    return bytes;
}

/* Loads a copy of its own exact size, so that a sanitizer sees a read past its end. */
static es_result try_load(es_context* context, const uint8_t* bytes, size_t size)
{
    uint8_t* copy = malloc(size ? size : 1);
    memcpy(copy, bytes, size);
    es_image image;
    es_result result = es_image_load_memory(context, copy, size, "damaged", &image);
    free(copy);
    if (result == ES_OK) es_image_destroy(context, &image);
    else assert_null(image.pixels);
    assert_int_equal(es_context_bytes(context), 0);
    return result;
}

static void damage(es_context* context, const char* path, uint32_t truncations, uint32_t flips)
{
    size_t size;
    uint8_t* bytes = read_bytes(path, &size);
    assert_non_null(bytes);
    assert_int_equal(try_load(context, bytes, size), ES_OK);
    for (uint32_t i = 0; i < truncations; i++) {
        assert_int_not_equal(try_load(context, bytes, (size_t)((uint64_t)size * i / truncations)), ES_OK);
    }
    uint64_t seed = 42;
    for (uint32_t i = 0; i < flips; i++) {
        uint8_t* hurt = malloc(size);
        memcpy(hurt, bytes, size);
        uint32_t count = 1 + i % 4;
        for (uint32_t k = 0; k < count; k++) {
            /* half of the damage goes to the first 400 bytes, where the headers are */
            size_t at = random_bits(&seed) % (random_bits(&seed) % 2 && size > 400 ? 400 : size);
            hurt[at] = (uint8_t)(random_bits(&seed) % 3 ? random_bits(&seed) : 255 * (random_bits(&seed) % 2));
        }
        try_load(context, hurt, size);
        free(hurt);
    }
    free(bytes);
}

static void damaged_files(void** state)
{
    es_context* context = make_context(64u << 20, NULL);
    static const char* const names[4] = {"d.exr", "d.png", "d.hdr", "f.exr"};
    for (int i = 0; i < 4; i++) {
        es_image image;
        assert_int_equal(es_image_create(context, 24, 40, i == 3 ? 7 : 3, &image), ES_OK);
        uint64_t seed = 9;
        for (uint32_t k = 0; k < 24 * 40 * image.channels; k++) image.pixels[k] = k % 17 < 9 ? 0.5f : random_float(&seed);
        const es_image_save_desc desc = {.sample_type = i == 3 ? ES_SAMPLE_FLOAT : ES_SAMPLE_HALF};
        es_result result = es_image_save(context, &image, path_of(names[i]), &desc);
        es_image_destroy(context, &image);
        if (result == ES_NOT_BUILT) continue;
        assert_int_equal(result, ES_OK);
        damage(context, path_of(names[i]), 400, 1200);
        unlink(path_of(names[i]));
    }
    end_context(context);
}

/* ---- shared assets ---------------------------------------------------------------------------------------------------- */

static bool shared_folder(char* out, size_t size)
{
    const char* shared = getenv("EARTHSHINE_SHARED");
    snprintf(out, size, "%s/assets", shared && shared[0] ? shared : ES_TEST_SOURCE_DIR "/../shared");
    return access(out, R_OK) == 0;
}

static void shared_assets(void** state)
{
    char assets[512], path[1024], line[4096];
    es_context* context = make_context(512u << 20, NULL);
    need(context, ".exr");
    if (!shared_folder(assets, sizeof assets)) {
        print_message("no shared assets: skipped\n");
        end_context(context);
        skip();
    }
    snprintf(path, sizeof path, "%s/EXPECTED.tsv", assets);
    FILE* list = fopen(path, "r");
    assert_non_null(list);
    int seen = 0;
    while (fgets(line, sizeof line, list)) {
        char* name = strtok(line, "\t");
        char* kind = strtok(NULL, "\t");
        char* expected = strtok(NULL, "\t");
        if (!name || !kind || !expected || (strncmp(kind, "EXR", 3) != 0 && strncmp(kind, "HDR", 3) != 0)) continue;
        snprintf(path, sizeof path, "%s/%s", assets, name);
        if (access(path, R_OK) != 0) continue;
        seen++;
        es_image image;
        es_result result = es_image_load(context, path, &image);
        if (strcmp(expected, "load") == 0 && result != ES_OK) fail_msg("%s: %s", name, es_context_message(context));
        if (strcmp(expected, "load") != 0) assert_int_not_equal(result, ES_OK);
        if (strstr(name, "memory_DOS_1")) assert_int_equal(result, ES_IMAGE_SIZE);
        if (strstr(name, "LowResLeftView")) assert_int_equal(result, ES_FILE_UNSUPPORTED);
        if (strstr(name, "AllHalfValues")) {  /* each half, in order, in every channel */
            assert_true(image.width == 256 && image.height == 256 && image.channels == 3);
            bool present[65536] = {false};
            for (uint32_t i = 0; i < 65536; i++) present[es_float_to_half(image.pixels[3 * i])] = true;
            for (uint32_t i = 0; i < 65536; i++) assert_true(present[i]);
        }
        if (result == ES_OK) es_image_destroy(context, &image);
        assert_int_equal(es_context_bytes(context), 0);
    }
    fclose(list);
    assert_true(seen > 0);
    end_context(context);
}

/* Damage to real files: other compressions, tiles, parts, luminance and chroma. */
static void damaged_assets(void** state)
{
    static const struct { const char* name; uint32_t truncations, flips; } files[] = {{"exr/manifest_id.exr", 100, 600},
        {"exr/DisplayWindow-t08.exr", 20, 60}, {"exr/MultiResolution-ColorCodedLevels.exr", 0, 30}, {"env/night.exr", 10, 60}};
    char assets[512], path[1024];
    es_context* context = make_context(256u << 20, NULL);
    need(context, ".exr");
    if (!shared_folder(assets, sizeof assets)) {
        print_message("no shared assets: skipped\n");
        end_context(context);
        skip();
    }
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        snprintf(path, sizeof path, "%s/%s", assets, files[i].name);
        if (access(path, R_OK) == 0) damage(context, path, files[i].truncations, files[i].flips);
    }
    end_context(context);
}

int main(void)
{
    snprintf(folder, sizeof folder, "/tmp/earthshine-images-XXXXXX");
    if (!mkdtemp(folder)) return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(halves),
        cmocka_unit_test(srgb_curve),
        cmocka_unit_test(exr_float),
        cmocka_unit_test(exr_hardly_compressible),
        cmocka_unit_test(exr_half),
        cmocka_unit_test(png_round_trip),
        cmocka_unit_test(png_kinds),
        cmocka_unit_test(hdr_round_trip),
        cmocka_unit_test(hdr_kinds),
        cmocka_unit_test(refused_loads),
        cmocka_unit_test(refused_saves),
        cmocka_unit_test(full_disk),
        cmocka_unit_test(out_of_memory),
        cmocka_unit_test(damaged_files),
        cmocka_unit_test(shared_assets),
        cmocka_unit_test(damaged_assets),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    char* const names[] = {"float.exr", "half.EXR", "a.png", "b.png", "a.hdr", "odd.hdr"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) unlink(path_of(names[i]));
    rmdir(folder);
    return failed;
}
