/* Writes inputs to begin fuzzing with, small and valid, as files FOLDER/TARGET/NAME: what the library's own writers make, what OpenEXRCore
 * makes with every compression, GLB files around the glTF text of seeds/, chunks of the DWA compressions, changes to a reference's file.
 * usage: fuzz_seeds FOLDER [ASSETS]      ASSETS: the shared assets, of which the small ones are copied */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dirent.h>
#include <errno.h>
#include <ftw.h>
#include <string.h>
#include <sys/stat.h>

#include "tests/fuzz/fuzz.h"

#if ES_WITH_OPENEXR
#include <openexr.h>
#endif

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) { return 0; } /* for a link with libFuzzer's main */

static const char* out;

static const char* place(const char* target, const char* name)
{
    static char path[4096];
    snprintf(path, sizeof path, "%s/%s", out, target);
    FUZZ_CHECK(mkdir(path, 0777) == 0 || errno == EEXIST, "%s cannot be made", path);
    snprintf(path, sizeof path, "%s/%s/%s", out, target, name);
    return path;
}

static void put(const char* target, const char* name, const void* bytes, size_t size)
{
    FILE* file = fopen(place(target, name), "wb");
    FUZZ_CHECK(file && fwrite(bytes, 1, size, file) == size && fclose(file) == 0, "%s/%s cannot be written", target, name);
}

/* ---- images --------------------------------------------------------------------------------------------------------------------------- */

static void write_images(es_context* context)
{
    static const struct { const char *target, *name; uint32_t width, height, channels; es_sample_type type; } images[] = {
        {"exr", "half.exr", 9, 7, 3, ES_SAMPLE_HALF}, {"exr", "float.exr", 5, 20, 4, ES_SAMPLE_FLOAT}, {"exr", "one.exr", 1, 1, 1, ES_SAMPLE_HALF},
        {"exr", "many.exr", 3, 3, 9, ES_SAMPLE_FLOAT}, {"png", "gray.png", 7, 5, 1, 0}, {"png", "gray-alpha.png", 5, 5, 2, 0}, {"png", "rgb.png", 9, 9, 3, 0},
        {"png", "rgba.png", 16, 3, 4, 0}, {"hdr", "runs.hdr", 24, 6, 3, 0}, {"hdr", "flat.hdr", 5, 4, 3, 0}, {"hdr", "line.hdr", 200, 1, 3, 0}};
    for (size_t i = 0; i < sizeof images / sizeof images[0]; i++) {
        es_image image;
        FUZZ_CHECK(es_image_create(context, images[i].width, images[i].height, images[i].channels, &image) == ES_OK, "no image");
        for (uint32_t k = 0; k < image.width * image.height * image.channels; k++)
            image.pixels[k] = k % 11 < 6 ? 0.25f : (float)(k * 7919 % 257) / 200.0f;
        es_result result = es_image_save(context, &image, place(images[i].target, images[i].name), &(es_image_save_desc){.sample_type = images[i].type});
        FUZZ_CHECK(result == ES_OK || result == ES_NOT_BUILT, "%s", es_context_message(context));
        es_image_destroy(context, &image);
    }
    static const char xyz[] = "#?RADIANCE\n# a comment\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2.5\nCOLORCORR=1 0.5 2\nPRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329\n\n"
                              "+X 2 -Y 3\n\x80\x40\x20\x81\x10\x80\xff\x7e\x01\x01\x01\x01\x90\x80\x70\x82\x01\x01\x01\x02";
    put("hdr", "turned.hdr", xyz, sizeof xyz - 1);
}

#if ES_WITH_OPENEXR
/* One chunk after another of samples that some compressions can do something with. */
static void write_chunks(exr_context_t file, int part, bool tiled, exr_pixel_type_t type)
{
    static const uint16_t halves[] = {0x3c00, 0x3800, 0x3555, 0x0001, 0xbc00, 0x4248, 0x7bff, 0x0000};
    exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_attr_box2i_t window;
    int32_t lines = 1;
    exr_get_data_window(file, part, &window);
    if (!tiled) exr_get_scanlines_per_chunk(file, part, &lines);
    int height = window.max.y - window.min.y + 1, width = window.max.x - window.min.x + 1, begun = 0;
    static uint8_t samples[8][64 * 64 * 4];
    for (int c = 0; c < 8; c++)
        for (size_t i = 0; i < sizeof samples[0]; i += 4) {
            float number = (float)((i / 4 * 37 + (size_t)c) % 19) * 0.125f;
            if (type == EXR_PIXEL_HALF) memcpy(&samples[c][i], (uint16_t[2]){halves[i / 16 % 8], halves[(i / 4 + (size_t)c) % 8]}, 4);
            else if (type == EXR_PIXEL_UINT) memcpy(&samples[c][i], &(uint32_t){(uint32_t)i * 13u % 300u}, 4);
            else memcpy(&samples[c][i], &number, 4);
        }
    int step_y = tiled ? 8 : lines, step_x = tiled ? 8 : width;
    for (int y = 0; y < height; y += step_y)
        for (int x = 0; x < width; x += step_x) {
            exr_chunk_info_t chunk;
            exr_result_t code = tiled ? exr_write_tile_chunk_info(file, part, x / 8, y / 8, 0, 0, &chunk) : exr_write_scanline_chunk_info(file, part, window.min.y + y, &chunk);
            FUZZ_CHECK(code == EXR_ERR_SUCCESS, "%s", exr_get_default_error_message(code));
            code = begun ? exr_encoding_update(file, part, &chunk, &encode) : exr_encoding_initialize(file, part, &chunk, &encode);
            FUZZ_CHECK(code == EXR_ERR_SUCCESS, "%s", exr_get_default_error_message(code));
            for (int c = 0; c < encode.channel_count; c++) {
                exr_coding_channel_info_t* info = &encode.channels[c];
                info->user_bytes_per_element = info->bytes_per_element;
                info->user_data_type = info->data_type;
                info->user_pixel_stride = info->bytes_per_element;
                info->user_line_stride = info->width * info->bytes_per_element;
                info->encode_from_ptr = samples[c];
            }
            if (!begun) code = exr_encoding_choose_default_routines(file, part, &encode);
            begun = 1;
            if (code == EXR_ERR_SUCCESS) code = exr_encoding_run(file, part, &encode);
            FUZZ_CHECK(code == EXR_ERR_SUCCESS, "%s", exr_get_default_error_message(code));
        }
    if (begun) exr_encoding_destroy(file, &encode);
}

typedef struct exr_seed {
    const char* name;
    exr_compression_t compression;
    exr_pixel_type_t type;
    bool tiled;
    int parts;
    const char* channels; /* one letter each; "c": Y, RY and BY at half size */
} exr_seed;

static void silence(exr_const_context_t file, exr_result_t code, const char* text) {}

static void write_exr(const exr_seed* seed)
{
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = silence;
    exr_context_t file;
    exr_result_t code = exr_start_write(&file, place("exr", seed->name), EXR_WRITE_FILE_DIRECTLY, &init);
    FUZZ_CHECK(code == EXR_ERR_SUCCESS, "%s: %s", seed->name, exr_get_default_error_message(code));
    for (int p = 0; p < seed->parts && code == EXR_ERR_SUCCESS; p++) {
        int part;
        char name[16];
        snprintf(name, sizeof name, "part%d", p);
        code = exr_add_part(file, name, seed->tiled ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE, &part);
        if (code == EXR_ERR_SUCCESS) code = exr_initialize_required_attr_simple(file, part, 18, 20, seed->compression);
        if (code == EXR_ERR_SUCCESS && seed->tiled) code = exr_set_tile_descriptor(file, part, 8, 8, EXR_TILE_ONE_LEVEL, EXR_TILE_ROUND_DOWN);
        if (seed->channels[0] == 'c') {
            if (code == EXR_ERR_SUCCESS) code = exr_add_channel(file, part, "BY", seed->type, EXR_PERCEPTUALLY_LOGARITHMIC, 2, 2);
            if (code == EXR_ERR_SUCCESS) code = exr_add_channel(file, part, "RY", seed->type, EXR_PERCEPTUALLY_LOGARITHMIC, 2, 2);
            if (code == EXR_ERR_SUCCESS) code = exr_add_channel(file, part, "Y", seed->type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
        } else {
            for (const char* c = seed->channels; *c && code == EXR_ERR_SUCCESS; c++)
                code = exr_add_channel(file, part, (char[2]){*c, 0}, seed->type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
        }
    }
    if (code == EXR_ERR_SUCCESS) code = exr_write_header(file);
    FUZZ_CHECK(code == EXR_ERR_SUCCESS, "%s: %s", seed->name, exr_get_default_error_message(code));
    for (int p = 0; p < seed->parts; p++) write_chunks(file, p, seed->tiled, seed->type);
    code = exr_finish(&file);
    FUZZ_CHECK(code == EXR_ERR_SUCCESS, "%s: %s", seed->name, exr_get_default_error_message(code));
}

static void write_exrs(void)
{
    static const exr_seed seeds[] = {
        {"none.exr", EXR_COMPRESSION_NONE, EXR_PIXEL_HALF, false, 1, "RGB"}, {"rle.exr", EXR_COMPRESSION_RLE, EXR_PIXEL_HALF, false, 1, "RGBA"},
        {"zips.exr", EXR_COMPRESSION_ZIPS, EXR_PIXEL_UINT, false, 1, "Z"}, {"zip.exr", EXR_COMPRESSION_ZIP, EXR_PIXEL_FLOAT, false, 1, "RG"},
        {"piz.exr", EXR_COMPRESSION_PIZ, EXR_PIXEL_HALF, false, 1, "BGR"}, {"piz-float.exr", EXR_COMPRESSION_PIZ, EXR_PIXEL_FLOAT, false, 1, "Y"},
        {"pxr24.exr", EXR_COMPRESSION_PXR24, EXR_PIXEL_FLOAT, false, 1, "RGB"}, {"pxr24-uint.exr", EXR_COMPRESSION_PXR24, EXR_PIXEL_UINT, false, 1, "Y"},
        {"b44.exr", EXR_COMPRESSION_B44, EXR_PIXEL_HALF, false, 1, "RGB"}, {"b44a.exr", EXR_COMPRESSION_B44A, EXR_PIXEL_HALF, false, 1, "YA"},
        {"chroma.exr", EXR_COMPRESSION_NONE, EXR_PIXEL_HALF, false, 1, "c"}, {"chroma-zip.exr", EXR_COMPRESSION_ZIP, EXR_PIXEL_HALF, false, 1, "c"},
        {"tiles.exr", EXR_COMPRESSION_NONE, EXR_PIXEL_HALF, true, 1, "RGB"}, {"tiles-zip.exr", EXR_COMPRESSION_ZIP, EXR_PIXEL_FLOAT, true, 1, "RA"},
        {"tiles-piz.exr", EXR_COMPRESSION_PIZ, EXR_PIXEL_HALF, true, 1, "RGB"}, {"parts.exr", EXR_COMPRESSION_RLE, EXR_PIXEL_HALF, false, 3, "RGB"}};
    for (size_t i = 0; i < sizeof seeds / sizeof seeds[0]; i++) write_exr(&seeds[i]);
}
#endif

/* ---- chunks of DWA, as fuzz_dwa reads them ---------------------------------------------------------------------------------------------- */

static void write_dwa(void)
{
    enum { SIDE = 20, BLOCKS = 9 };
    for (int version = 0; version < 3; version++)
        for (int mode = 0; mode < 3; mode++) {
            uint8_t bytes[4096];
            size_t n = 0;
            /* R, G and B of halves as a set, A without loss, Z kept as it is */
            const uint8_t channels[][2] = {{0 + 16, 0}, {1 + 16, 0}, {2 + 16, 0}, {3 + 16, 0}, {6 + 32, 0}};
            static const uint8_t rules[] = {'R', 0, 1 << 4 | 1 << 2, 1, 'G', 0, 2 << 4 | 1 << 2, 1, 'B', 0, 3 << 4 | 1 << 2, 1, 'A', 0, 2 << 2, 1};
            bytes[n++] = 4, bytes[n++] = SIDE - 1, bytes[n++] = SIDE - 1, bytes[n++] = 0;
            memcpy(bytes + n, channels, sizeof channels);
            n += sizeof channels;
            bytes[n++] = (uint8_t)version;
            /* every stream deflated; AC deflated or, given as it is, Huffman coded */
            bytes[n++] = mode == 0 ? 0x1f : mode == 1 ? 0x0d : 0x1d;
            bytes[n++] = version == 2 ? sizeof rules : 0;
            if (version == 2) memcpy(bytes + n, rules, sizeof rules), n += sizeof rules;
            /* unknown: Z, four bytes each */
            size_t size = SIDE * SIDE * 4;
            bytes[n++] = (uint8_t)size, bytes[n++] = (uint8_t)(size >> 8);
            for (size_t i = 0; i < size; i++) bytes[n++] = (uint8_t)(i % 4 == 3 ? 0x3f : i / 40);
            if (mode == 1) {
                /* symbols 0xff00 (end of a block), 0x3800 and the run, which is the last: one, two and two bits */
                uint8_t code[64] = {0};
                uint32_t first = 0x3800, last = 0xff01, at = 0;
                uint8_t table[32] = {0};
                uint32_t bit = 0;
#define BITS(value, count)                                                                                                             \
    for (int k = (count)-1; k >= 0; k--, bit++) table[bit >> 3] |= (uint8_t)(((uint32_t)(value) >> k & 1u) << (7 - (bit & 7)))
                BITS(2, 6);
                /* 0x3801 … 0xfeff are unused: runs of at most 261 are too many here, so the first symbol is near the end instead */
                bit = 0, memset(table, 0, sizeof table);
                first = 0xff00;
                BITS(1, 6);
                BITS(1, 6);
                at = (bit + 7) / 8;
                /* 27 blocks that end at once: codes are one bit each, the lower symbol has the lower code */
                for (int i = 0; i < 4; i++) code[i] = (uint8_t)(first >> 8 * i), code[4 + i] = (uint8_t)(last >> 8 * i);
                code[12] = 27;
                memcpy(code + 20, table, at);
                size = 20 + at + 4;
                bytes[n++] = (uint8_t)size, bytes[n++] = (uint8_t)(size >> 8);
                memcpy(bytes + n, code, size);
                n += size;
                bytes[n++] = 27, bytes[n++] = 0; /* AC_COUNT */
#undef BITS
            } else {
                size_t begin = n;
                n += 2;
                for (int b = 0; b < 3 * BLOCKS; b++) {
                    const uint8_t block[] = {0x00, 0x38, 0x04, 0xff, 0x00, 0xb4, 0x00, 0xff}; /* 0.5, four zeros, -0.25, end */
                    memcpy(bytes + n, block, sizeof block);
                    n += sizeof block;
                }
                size = n - begin - 2;
                bytes[begin] = (uint8_t)size, bytes[begin + 1] = (uint8_t)(size >> 8);
                if (mode == 2) bytes[n++] = (uint8_t)(size / 2), bytes[n++] = 0;
            }
            /* DC: halves, differences of bytes */
            size = 3 * BLOCKS * 2;
            bytes[n++] = (uint8_t)size, bytes[n++] = 0;
            for (size_t i = 0; i < size; i++) bytes[n++] = (uint8_t)(128 + (i == size / 2 ? 0x3c : 0));
            /* A: runs */
            size_t begin = n;
            n += 2;
            for (size_t left = SIDE * SIDE * 2; left; left -= left < 100 ? left : 100) bytes[n++] = (uint8_t)((left < 100 ? left : 100) - 1), bytes[n++] = 0x3c;
            bytes[begin] = (uint8_t)(n - begin - 2), bytes[begin + 1] = 0;
            /* the run-length coded size is not what it stands for */
            bytes[4 + sizeof channels + 1] |= 64;
            bytes[n++] = (uint8_t)(SIDE * SIDE * 2), bytes[n++] = (uint8_t)(SIDE * SIDE * 2 >> 8);
            char name[32];
            snprintf(name, sizeof name, "version%d-%s", version, mode == 0 ? "deflated" : mode == 1 ? "huffman" : "damaged");
            put("dwa", name, bytes, n);
        }
}

/* ---- shapes of bodies ---------------------------------------------------------------------------------------------------------------- */

/* Numbers without a pattern; the byte that says which shape takes every value in turn. */
static void write_shapes(void)
{
    uint32_t state = 1;
    for (uint32_t seed = 0; seed < 25; seed++) {
        uint8_t bytes[600];
        for (size_t i = 0; i < sizeof bytes; i++) {
            state = state * 1664525u + 1013904223u;
            bytes[i] = (uint8_t)(state >> 24);
            if (i % 3 == 1 && bytes[i] == 255) bytes[i] = 0; /* any bits at all are for the fuzzer to find */
        }
        bytes[0] = 1; /* two triangles: 18 numbers of 3 bytes, then the first shape's kind */
        bytes[1 + 18 * 3] = (uint8_t)(seed % 5 + 5 * (seed / 5));
        char name[16];
        snprintf(name, sizeof name, "pair-%02u", seed);
        put("shapes", name, bytes, sizeof bytes);
    }
}

/* ---- glTF, settings, references -------------------------------------------------------------------------------------------------------- */

/* GLB around a text and 1 KiB of data. */
static void write_glb(const char* target, const char* name, const uint8_t* text, size_t size)
{
    size_t json = (size + 3) / 4 * 4, binary = 1024, total = 12 + 8 + json + 8 + binary;
    uint8_t* glb = calloc(1, total);
    const uint32_t head[] = {0x46546c67, 2, (uint32_t)total, (uint32_t)json, 0x4e4f534a};
    memcpy(glb, head, sizeof head);
    memcpy(glb + 20, text, size);
    memset(glb + 20 + size, ' ', json - size);
    memcpy(glb + 20 + json, (uint32_t[]){(uint32_t)binary, 0x004e4942}, 8);
    for (uint32_t i = 0; i < binary / 4; i++) memcpy(glb + 28 + json + 4 * i, &(float){(float)(i * 37 % 17) * 0.25f - 2}, 4);
    put(target, name, glb, total);
    free(glb);
}

static void write_resumes(void)
{
    static const struct { const char* name; uint8_t bytes[16]; size_t size; } seeds[] = {
        {"as-it-is", {1}, 1}, {"one-sample", {1, 0, 30, 2, 0, 0, 128, 63}, 8}, {"a-letter", {1, 1, 20, 6, 'x'}, 5}, {"swapped", {1, 2, 3, 4}, 4},
        {"more-samples", {1, 8, 0, 0, 4}, 5}, {"gone", {1, 4, 40}, 3}, {"no-number", {1, 0, 30, 0, 0, 0, 0xc0, 0x7f}, 8}, {"no-file", {0, 'E', 'X', 'R'}, 4}};
    for (size_t i = 0; i < sizeof seeds / sizeof seeds[0]; i++) put("resume", seeds[i].name, seeds[i].bytes, seeds[i].size);
}

/* ---- shared assets ----------------------------------------------------------------------------------------------------------------------- */

static int copy_asset(const char* path, const struct stat* status, int kind, struct FTW* where)
{
    enum { LARGEST = 24 << 10 };
    if (kind != FTW_F || status->st_size > LARGEST || status->st_size == 0) return 0;
    const char* ending = strrchr(path, '.');
    if (!ending || strchr(ending, '/')) ending = "";
    const char* target = !strcmp(ending, ".gltf") || !strcmp(ending, ".glb") ? "gltf"
        : !strcmp(ending, ".hdr")                                          ? "hdr"
        : !strcmp(ending, ".png")                                          ? "png"
        : !strcmp(ending, ".exr") || strstr(path, "/exr-damaged/")         ? "exr"
                                                                           : NULL;
    size_t size;
    uint8_t* bytes = target ? fuzz_read(path, &size) : NULL;
    if (!bytes) return 0;
    if (size > 24 && !memcmp(bytes + 12, "IHDR", 4) && (bytes[16] | bytes[17] | bytes[18] | bytes[20] | bytes[21] | bytes[22])) {
        free(bytes); /* 256 pixels or more in a row or column: every try would take long */
        return 0;
    }
    char name[256];
    static unsigned number;
    snprintf(name, sizeof name, "asset-%u-%.200s", number++, path + where->base);
    put(target, name, bytes, size);
    free(bytes);
    return 0;
}

int main(int count, char** arguments)
{
    if (count < 2 || count > 3) {
        fprintf(stderr, "usage: fuzz_seeds FOLDER [ASSETS]\n");
        return 2;
    }
    out = arguments[1];
    FUZZ_CHECK(mkdir(out, 0777) == 0 || errno == EEXIST, "%s cannot be made", out);
    es_context* context;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    FUZZ_CHECK(es_context_create(&desc, &context) == ES_OK, "no context");
    write_images(context);
    es_context_destroy(context);
#if ES_WITH_OPENEXR
    write_exrs();
#endif
    write_dwa();
    write_resumes();
    write_shapes();
    put("settings", "one", "cornell\n--size=16x16\n--hash", 27);
    static const char glb_text[] =
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":9,\"type\":\"VEC3\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":108}],"
        "\"buffers\":[{\"byteLength\":1024}]}";
    write_glb("gltf", "triangles.glb", (const uint8_t*)glb_text, sizeof glb_text - 1);
    static const char edits_text[] =
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"extras\":{\"earthshine\":{\"edits\":{\"regions\":[{\"type\":\"geodesic\",\"centre\":{\"node\":\"pot\",\"triangle\":2}}],"
        "\"constraints\":[{\"reflecting\":{\"node\":\"pot\",\"triangle\":2,\"u\":0.5},\"reflected\":{\"point\":[1,2,3]},\"geodesic\":true}]}}}}]}";
    write_glb("edits", "edits.glb", (const uint8_t*)edits_text, sizeof edits_text - 1);
    if (count == 3) FUZZ_CHECK(nftw(arguments[2], copy_asset, 16, FTW_PHYS) == 0, "%s cannot be read", arguments[2]);
    return 0;
}
