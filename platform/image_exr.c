/* OpenEXR files through OpenEXRCore, the C interface of OpenEXR 3.1 and later; the only file that knows it.
 *
 * Read: scan-line and tiled parts (level 0), half, float and uint samples, every compression. The library decompresses a
 * chunk; taking the samples apart is done here, since its unpackers convert halves differently from machine to machine.
 * Luminance and subsampled chroma (Y, RY, BY) become RGB as in the OpenEXR technical introduction: the missing chroma is
 * interpolated with its 27-tap half-band filter, first along rows, then along columns. Colours with other primaries than
 * Rec.709's, as the `chromaticities` attribute tells, are converted (Bradford adaptation of the white).
 *
 * The image is the data window. Its size, the chunk table and each chunk's place are checked against the file before the
 * image is allocated. OpenEXRCore's allocation callbacks carry no user pointer, so a context cannot be told through them;
 * instead all buffers that grow with the image are handed to it, and what it allocates itself is bounded by the file's
 * size (attributes, chunk table) or by constants.
 */
#include "platform/image_files.h"

#if ES_WITH_OPENEXR

#include "platform/image_exr_dwa.h"

#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct exr_reader {
    es_context* context;
    const es_image_source* source;
    exr_context_t file;
    char message[160];  /* the library's last message */
} exr_reader;

static void reader_error(exr_const_context_t file, exr_result_t code, const char* text)
{
    void* user = NULL;
    if (!file || exr_get_user_data(file, &user) != EXR_ERR_SUCCESS || !user) return;
    exr_reader* reader = user;
    size_t n = 0;
    for (; text && text[n] && n < sizeof reader->message - 1; n++) {
        reader->message[n] = text[n] >= 32 && text[n] < 127 ? text[n] : '?';  /* it may quote the file */
    }
    reader->message[n] = 0;
}

static int64_t reader_read(exr_const_context_t file, void* user, void* out, uint64_t size, uint64_t offset,
    exr_stream_error_func_ptr_t error)
{
    const es_image_source* source = ((exr_reader*)user)->source;
    if (offset >= source->size) return 0;
    if (size > source->size - offset) size = source->size - offset;
    memcpy(out, source->bytes + offset, size);
    return (int64_t)size;
}

static int64_t reader_size(exr_const_context_t file, void* user) { return (int64_t)((exr_reader*)user)->source->size; }

static es_result fail_read(exr_reader* reader, exr_result_t code, const char* what)
{
    es_result result = code == EXR_ERR_OUT_OF_MEMORY        ? ES_OUT_OF_MEMORY
        : code == EXR_ERR_FEATURE_NOT_IMPLEMENTED           ? ES_FILE_UNSUPPORTED
                                                            : ES_FILE_DAMAGED;
    const char* detail = reader->message[0] ? reader->message : exr_get_default_error_message(code);
    return es_fail(reader->context, result, "'%s': %s: %s", reader->source->label, what, detail);
}

/* ---- colour ----------------------------------------------------------------------------------------------------------- */

typedef struct primaries { double xy[4][2]; } primaries;  /* red, green, blue, white */

static const primaries rec709 = {{{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}}};

static bool invert3(const double m[9], double inverse[9])
{
    double c0 = m[4] * m[8] - m[5] * m[7], c1 = m[5] * m[6] - m[3] * m[8], c2 = m[3] * m[7] - m[4] * m[6];
    double determinant = m[0] * c0 + m[1] * c1 + m[2] * c2;
    if (!(determinant > 1e-9 || determinant < -1e-9)) return false;
    double d = 1.0 / determinant;
    inverse[0] = c0 * d, inverse[1] = (m[2] * m[7] - m[1] * m[8]) * d, inverse[2] = (m[1] * m[5] - m[2] * m[4]) * d;
    inverse[3] = c1 * d, inverse[4] = (m[0] * m[8] - m[2] * m[6]) * d, inverse[5] = (m[2] * m[3] - m[0] * m[5]) * d;
    inverse[6] = c2 * d, inverse[7] = (m[1] * m[6] - m[0] * m[7]) * d, inverse[8] = (m[0] * m[4] - m[1] * m[3]) * d;
    return true;
}

static void multiply3(const double a[9], const double b[9], double product[9])
{
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            product[3 * row + column] = a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column];
        }
    }
}

static void transform3(const double m[9], const double v[3], double out[3])
{
    for (int row = 0; row < 3; row++) out[row] = m[3 * row] * v[0] + m[3 * row + 1] * v[1] + m[3 * row + 2] * v[2];
}

/* XYZ of a chromaticity with Y = 1. */
static void xyz_of(const double xy[2], double xyz[3])
{
    xyz[0] = xy[0] / xy[1], xyz[1] = 1.0, xyz[2] = (1.0 - xy[0] - xy[1]) / xy[1];
}

/* Row-major RGB to XYZ with Y = 1 for white; false when the primaries span no triangle. */
static bool rgb_to_xyz(const primaries* p, double m[9])
{
    double inverse[9], white[3], scale[3];
    for (int i = 0; i < 4; i++) {
        for (int c = 0; c < 2; c++) {
            if (!(p->xy[i][c] > -10.0 && p->xy[i][c] < 10.0)) return false;
        }
        if (p->xy[i][1] > -1e-6 && p->xy[i][1] < 1e-6) {
            /* AP0's and similar blue primaries may lie at small y, none at zero */
            return false;
        }
    }
    for (int i = 0; i < 3; i++) {
        double xyz[3];
        xyz_of(p->xy[i], xyz);
        for (int row = 0; row < 3; row++) m[3 * row + i] = xyz[row];
    }
    xyz_of(p->xy[3], white);
    if (!invert3(m, inverse)) return false;
    transform3(inverse, white, scale);
    for (int k = 0; k < 9; k++) m[k] *= scale[k % 3];
    return true;
}

/* Row-major matrix from the given primaries to Rec.709's. */
static bool rgb_to_rec709(const primaries* from, double m[9])
{
    static const double bradford[9] = {0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685, 1.0296};
    double from_xyz[9], to_xyz[9], xyz_to[9], unbradford[9], white[3], cone_from[3], cone_to[3], scaled[9], adapt[9], chain[9];
    if (!rgb_to_xyz(from, from_xyz) || !rgb_to_xyz(&rec709, to_xyz) || !invert3(to_xyz, xyz_to) || !invert3(bradford, unbradford)) {
        return false;
    }
    xyz_of(from->xy[3], white);
    transform3(bradford, white, cone_from);
    xyz_of(rec709.xy[3], white);
    transform3(bradford, white, cone_to);
    for (int k = 0; k < 9; k++) {
        if (!(cone_from[k / 3] > 1e-6)) return false;
        scaled[k] = bradford[k] * (cone_to[k / 3] / cone_from[k / 3]);
    }
    multiply3(unbradford, scaled, adapt);
    multiply3(adapt, from_xyz, chain);
    multiply3(xyz_to, chain, m);
    return true;
}

static bool equals_rec709(const primaries* p)
{
    for (int i = 0; i < 8; i++) {
        double difference = p->xy[i / 2][i % 2] - rec709.xy[i / 2][i % 2];
        if (!(difference < 1e-3 && difference > -1e-3)) return false;
    }
    return true;
}

static bool is_finite(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

/* Colours with an infinity or a NaN stay as they are: mixing channels would spread it. */
static void convert_colours(es_image* image, const uint32_t channel[3], const double m[9])
{
    size_t pixels = (size_t)image->width * image->height;
    float* pixel = image->pixels;
    for (size_t i = 0; i < pixels; i++, pixel += image->channels) {
        float *r = pixel + channel[0], *g = pixel + channel[1], *b = pixel + channel[2];
        if (!is_finite(*r) || !is_finite(*g) || !is_finite(*b)) continue;
        double in[3] = {*r, *g, *b}, out[3];
        transform3(m, in, out);
        *r = (float)out[0], *g = (float)out[1], *b = (float)out[2];
    }
}

/* ---- subsampled channels ---------------------------------------------------------------------------------------------- */

/* Fills column or row positions between samples at multiples of two: `odd` positions from seven samples on each side,
 * those beyond the edge repeating the last. Coefficients: half-band filter of the OpenEXR luminance-chroma files. */
static void interpolate_odd(float* first, size_t stride, uint32_t count)
{
    static const float tap[7] = {0.627123f, -0.186077f, 0.087929f, -0.043159f, 0.019597f, -0.007540f, 0.002128f};
    int64_t last = (int64_t)((count - 1) & ~1u);
    for (int64_t i = 1; i < (int64_t)count; i += 2) {
        float sum = 0;
        for (int64_t k = 0; k < 7; k++) {
            int64_t low = i - 1 - 2 * k, high = i + 1 + 2 * k;
            low = low < 0 ? 0 : low;
            high = high > last ? last : high;
            sum += tap[k] * (first[(size_t)low * stride] + first[(size_t)high * stride]);
        }
        first[(size_t)i * stride] = sum;
    }
}

/* Samples stand at multiples of (step_x, step_y) of the full grid. Chroma is interpolated where the steps are 1 or 2;
 * everything else repeats the sample of its cell. */
static void fill_between_samples(es_image* image, uint32_t channel, uint32_t step_x, uint32_t step_y, bool chroma)
{
    uint32_t width = image->width, height = image->height;
    size_t pixel = image->channels, row = pixel * width;
    float* plane = image->pixels + channel;
    if (chroma && step_x <= 2 && step_y <= 2) {
        for (uint32_t y = 0; y < height && step_x == 2; y += step_y) interpolate_odd(plane + row * y, pixel, width);
        for (uint32_t x = 0; x < width && step_y == 2; x++) interpolate_odd(plane + pixel * x, row, height);
        return;
    }
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            if (x % step_x || y % step_y) plane[row * y + pixel * x] = plane[row * (y - y % step_y) + pixel * (x - x % step_x)];
        }
    }
}

/* RY = (R - Y) / Y, BY = (B - Y) / Y, Y = weights · RGB. */
static void luminance_chroma_to_rgb(es_image* image, const uint32_t channel[3], const double weights[3])
{
    float wr = (float)weights[0], wb = (float)weights[2], wg = (float)weights[1];
    size_t pixels = (size_t)image->width * image->height;
    float* pixel = image->pixels;
    for (size_t i = 0; i < pixels; i++, pixel += image->channels) {
        float y = pixel[channel[0]], ry = pixel[channel[1]], by = pixel[channel[2]];
        if (ry == 0 && by == 0) {  /* exactly gray, and no 0 × infinity */
            pixel[channel[1]] = pixel[channel[2]] = y;
            continue;
        }
        float r = (ry + 1.0f) * y, b = (by + 1.0f) * y;
        pixel[channel[0]] = r;
        pixel[channel[1]] = (y - r * wr - b * wb) / wg;
        pixel[channel[2]] = b;
    }
}

/* ---- parts ------------------------------------------------------------------------------------------------------------ */

typedef struct part_plan {
    int index;
    exr_attr_box2i_t window;
    uint32_t width, height;
    bool tiled;
    uint32_t tile_width, tile_height;
    int32_t lines_per_chunk;
    exr_compression_t compression;
    const exr_attr_chlist_t* channels;
    uint32_t first;                               /* channel of the image where this part begins */
    uint16_t place[ES_IMAGE_MAX_CHANNELS];        /* file channel to channel of the image */
    int luminance[3];                             /* file channels Y, RY, BY, or -1 */
    int rgb[3];                                   /* file channels R, G, B, or -1 */
} part_plan;

static int find_channel(const exr_attr_chlist_t* list, const char* name)
{
    for (int c = 0; c < list->num_channels; c++) {
        if (strcmp(list->entries[c].name.str, name) == 0) return c;
    }
    return -1;
}

static bool same_window(const part_plan* a, const part_plan* b) { return memcmp(&a->window, &b->window, sizeof a->window) == 0; }

/* Everything of a part's header, checked. `flat` is false for deep parts. */
static es_result plan_part(exr_reader* reader, int index, part_plan* plan, bool* flat)
{
    const char* label = reader->source->label;
    exr_context_t file = reader->file;
    exr_storage_t storage;
    *plan = (part_plan){.index = index};
    exr_result_t code = exr_get_storage(file, index, &storage);
    if (code != EXR_ERR_SUCCESS) return fail_read(reader, code, "damaged OpenEXR header");
    *flat = storage == EXR_STORAGE_SCANLINE || storage == EXR_STORAGE_TILED;
    if (!*flat) return ES_OK;
    plan->tiled = storage == EXR_STORAGE_TILED;

    int32_t chunks = 0;
    if ((code = exr_get_data_window(file, index, &plan->window)) != EXR_ERR_SUCCESS ||
        (code = exr_get_channels(file, index, &plan->channels)) != EXR_ERR_SUCCESS ||
        (code = exr_get_compression(file, index, &plan->compression)) != EXR_ERR_SUCCESS ||
        (code = exr_get_chunk_count(file, index, &chunks)) != EXR_ERR_SUCCESS) {
        return fail_read(reader, code, "damaged OpenEXR header");
    }
    int64_t width = (int64_t)plan->window.max.x - plan->window.min.x + 1, height = (int64_t)plan->window.max.y - plan->window.min.y + 1;
    if (width < 1 || height < 1 || width > ES_IMAGE_MAX_SIZE || height > ES_IMAGE_MAX_SIZE) {
        return es_fail(reader->context, ES_IMAGE_SIZE, "'%s': the data window is %lld x %lld; 1 to %d are accepted", label,
            (long long)width, (long long)height, ES_IMAGE_MAX_SIZE);
    }
    plan->width = (uint32_t)width, plan->height = (uint32_t)height;
    if (plan->channels->num_channels < 1 || plan->channels->num_channels > ES_IMAGE_MAX_CHANNELS) {
        return es_fail(reader->context, ES_FILE_UNSUPPORTED, "'%s' has %d channels; 1 to %d are accepted", label,
            plan->channels->num_channels, ES_IMAGE_MAX_CHANNELS);
    }
    if (chunks < 1 || (uint64_t)chunks > reader->source->size / 8) {
        return es_fail(reader->context, ES_FILE_DAMAGED, "'%s': a table of %d chunks does not fit the file", label, chunks);
    }
    if (plan->tiled) {
        exr_tile_level_mode_t level;
        exr_tile_round_mode_t rounding;
        code = exr_get_tile_descriptor(file, index, &plan->tile_width, &plan->tile_height, &level, &rounding);
        if (code != EXR_ERR_SUCCESS) return fail_read(reader, code, "damaged OpenEXR header");
        if (plan->tile_width == 0 || plan->tile_height == 0) {
            return es_fail(reader->context, ES_FILE_DAMAGED, "'%s': the tile size is zero", label);
        }
    } else {
        code = exr_get_scanlines_per_chunk(file, index, &plan->lines_per_chunk);
        if (code != EXR_ERR_SUCCESS) return fail_read(reader, code, "damaged OpenEXR header");
        if (plan->lines_per_chunk < 1) return es_fail(reader->context, ES_FILE_DAMAGED, "'%s': chunks without scan lines", label);
    }
    for (int c = 0; c < plan->channels->num_channels; c++) {
        const exr_attr_chlist_entry_t* entry = plan->channels->entries + c;
        if (entry->x_sampling < 1 || entry->y_sampling < 1 || plan->width % (uint32_t)entry->x_sampling ||
            plan->height % (uint32_t)entry->y_sampling || plan->window.min.x % entry->x_sampling ||
            plan->window.min.y % entry->y_sampling) {
            return es_fail(reader->context, ES_FILE_DAMAGED, "'%s': channel '%s' is subsampled %d x %d, which does not divide the window",
                label, entry->name.str, entry->x_sampling, entry->y_sampling);
        }
    }

    static const char* const yc[3] = {"Y", "RY", "BY"};
    static const char* const rgb[3] = {"R", "G", "B"};
    for (int k = 0; k < 3; k++) {
        plan->luminance[k] = find_channel(plan->channels, yc[k]);
        plan->rgb[k] = find_channel(plan->channels, rgb[k]);
    }
    bool luminance_chroma = plan->luminance[0] >= 0 && plan->luminance[1] >= 0 && plan->luminance[2] >= 0 && plan->rgb[0] < 0 &&
        plan->rgb[1] < 0 && plan->rgb[2] < 0;
    if (luminance_chroma) memcpy(plan->rgb, plan->luminance, sizeof plan->rgb);
    else plan->luminance[0] = plan->luminance[1] = plan->luminance[2] = -1;
    return ES_OK;
}

/* The file sorts channels by name; the image has the usual ones first in their usual order, then the file's order. */
static void place_channels(part_plan* plan, uint32_t first)
{
    bool placed[ES_IMAGE_MAX_CHANNELS] = {false};
    int leading[5] = {plan->rgb[0], plan->rgb[1], plan->rgb[2], find_channel(plan->channels, "Y"), find_channel(plan->channels, "A")};
    uint32_t next = plan->first = first;
    for (int k = 0; k < 5; k++) {
        if (leading[k] < 0 || placed[leading[k]]) continue;
        plan->place[leading[k]] = (uint16_t)next++;
        placed[leading[k]] = true;
    }
    for (int c = 0; c < plan->channels->num_channels; c++) {
        if (!placed[c]) plan->place[c] = (uint16_t)next++;
    }
}

static exr_result_t chunk_at(exr_reader* reader, const part_plan* plan, uint32_t column, uint32_t row, exr_chunk_info_t* chunk)
{
    memset(chunk, 0, sizeof *chunk);
    if (plan->tiled) return exr_read_tile_chunk_info(reader->file, plan->index, (int)column, (int)row, 0, 0, chunk);
    return exr_read_scanline_chunk_info(reader->file, plan->index, plan->window.min.y + (int)row * plan->lines_per_chunk, chunk);
}

static void chunk_grid(const part_plan* plan, uint32_t* columns, uint32_t* rows)
{
    uint32_t wide = plan->tiled ? plan->tile_width : plan->width, high = plan->tiled ? plan->tile_height : (uint32_t)plan->lines_per_chunk;
    *columns = (uint32_t)(((uint64_t)plan->width + wide - 1) / wide);
    *rows = (uint32_t)(((uint64_t)plan->height + high - 1) / high);
}

/* ---- pixels ----------------------------------------------------------------------------------------------------------- */

typedef struct unpacking {
    const part_plan* plan;
    es_image* image;
    es_dwa_scratch* dwa;
    uint32_t x, y;  /* of the image, where the chunk begins */
    bool no_memory; /* and the context has said so */
} unpacking;

static float sample_value(const uint8_t* p, exr_pixel_type_t type)
{
    if (type == EXR_PIXEL_HALF) return es_half_to_float((uint16_t)(p[0] | p[1] << 8));
    uint32_t bits = p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
    if (type == EXR_PIXEL_UINT) return (float)bits;
    float value;
    memcpy(&value, &bits, 4);
    return value;
}

/* A decompressed chunk holds, for each row, each channel's samples of that row, little-endian. */
static exr_result_t unpack_chunk(exr_decode_pipeline_t* decode)
{
    const unpacking* job = decode->decoding_user_data;
    const part_plan* plan = job->plan;
    const exr_chunk_info_t* chunk = &decode->chunk;
    const uint8_t* in = decode->unpacked_buffer;
    uint64_t left = chunk->unpacked_size;
    size_t pixel = job->image->channels, row_floats = pixel * plan->width;
    if (chunk->width < 0 || chunk->height < 0 || (uint32_t)chunk->width > plan->width - job->x ||
        (uint32_t)chunk->height > plan->height - job->y) {
        return EXR_ERR_CORRUPT_CHUNK;
    }
    for (int32_t y = 0; y < chunk->height; y++) {
        uint32_t row = job->y + (uint32_t)y;
        for (int c = 0; c < plan->channels->num_channels; c++) {
            const exr_attr_chlist_entry_t* entry = plan->channels->entries + c;
            if (row % (uint32_t)entry->y_sampling) continue;  /* the window's corner is a multiple of the steps, as checked */
            uint32_t count = (uint32_t)(chunk->width / entry->x_sampling), step = entry->pixel_type == EXR_PIXEL_HALF ? 2 : 4;
            if ((uint64_t)count * step > left) return EXR_ERR_CORRUPT_CHUNK;
            left -= (uint64_t)count * step;
            float* out = job->image->pixels + row_floats * row + pixel * job->x + plan->place[c];
            size_t out_step = pixel * (size_t)entry->x_sampling;
            for (uint32_t i = 0; i < count; i++, in += step, out += out_step) *out = sample_value(in, entry->pixel_type);
        }
    }
    return EXR_ERR_SUCCESS;
}

static exr_result_t decompress_dwa(exr_decode_pipeline_t* decode)
{
    unpacking* job = decode->decoding_user_data;
    es_dwa_channel channels[ES_IMAGE_MAX_CHANNELS];
    for (int c = 0; c < job->plan->channels->num_channels; c++) {
        const exr_attr_chlist_entry_t* entry = job->plan->channels->entries + c;
        channels[c] = (es_dwa_channel){entry->name.str, entry->pixel_type == EXR_PIXEL_HALF ? ES_DWA_HALF
                : entry->pixel_type == EXR_PIXEL_FLOAT                                      ? ES_DWA_FLOAT
                                                                                            : ES_DWA_UINT,
            (uint32_t)entry->x_sampling, (uint32_t)entry->y_sampling, entry->p_linear != 0};
    }
    const exr_chunk_info_t* chunk = &decode->chunk;
    if (chunk->packed_size == chunk->unpacked_size) return EXR_ERR_SUCCESS;  /* stored as it is; the buffers are one */
    switch (es_dwa_decode(job->dwa, decode->packed_buffer, chunk->packed_size, channels, (uint32_t)job->plan->channels->num_channels,
        (uint32_t)chunk->width, (uint32_t)chunk->height, chunk->start_y, decode->unpacked_buffer, chunk->unpacked_size)) {
    case ES_DWA_OK: return EXR_ERR_SUCCESS;
    case ES_DWA_NO_MEMORY: job->no_memory = true; return EXR_ERR_OUT_OF_MEMORY;
    default: return EXR_ERR_CORRUPT_CHUNK;
    }
}

/* The image-sized buffers are ours; the pipeline asks for memory only for the constant-sized second scratch buffer. */
static void* pipeline_allocate(exr_transcoding_pipeline_buffer_id_t id, size_t size)
{
    return id == EXR_TRANSCODE_BUFFER_SCRATCH2 && size <= (8u << 20) ? malloc(size) : NULL;
}

static void pipeline_release(exr_transcoding_pipeline_buffer_id_t id, void* pointer)
{
    if (id == EXR_TRANSCODE_BUFFER_SCRATCH2) free(pointer);
}

typedef struct chunk_buffers {
    uint8_t* memory;
    size_t packed_size, unpacked_size;  /* two of the latter: the chunk, and scratch of its size */
} chunk_buffers;

static size_t buffers_size(const chunk_buffers* buffers) { return buffers->packed_size + 2 * buffers->unpacked_size; }

static void lend_buffers(exr_decode_pipeline_t* decode, const chunk_buffers* buffers)
{
    decode->packed_buffer = buffers->memory;
    decode->packed_alloc_size = buffers->packed_size;
    decode->unpacked_buffer = buffers->memory + buffers->packed_size;
    decode->unpacked_alloc_size = buffers->unpacked_size;
    decode->scratch_buffer_1 = buffers->memory + buffers->packed_size + buffers->unpacked_size;
    decode->scratch_alloc_size_1 = buffers->unpacked_size;
}

static es_result decode_chunks(exr_reader* reader, unpacking* job, const chunk_buffers* buffers)
{
    const part_plan* plan = job->plan;
    exr_decode_pipeline_t decode = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t code = EXR_ERR_SUCCESS;
    uint32_t columns, rows;
    bool begun = false;
    chunk_grid(plan, &columns, &rows);
    for (uint32_t row = 0; row < rows && code == EXR_ERR_SUCCESS; row++) {
        for (uint32_t column = 0; column < columns && code == EXR_ERR_SUCCESS; column++) {
            exr_chunk_info_t chunk;
            if ((code = chunk_at(reader, plan, column, row, &chunk)) != EXR_ERR_SUCCESS) break;
            if (chunk.packed_size > buffers->packed_size || chunk.unpacked_size > buffers->unpacked_size) {
                code = EXR_ERR_CORRUPT_CHUNK;
                break;
            }
            if (!begun) {
                if ((code = exr_decoding_initialize(reader->file, plan->index, &chunk, &decode)) != EXR_ERR_SUCCESS) break;
                begun = true;
                decode.alloc_fn = pipeline_allocate;
                decode.free_fn = pipeline_release;
                decode.decoding_user_data = job;
                if ((code = exr_decoding_choose_default_routines(reader->file, plan->index, &decode)) != EXR_ERR_SUCCESS) break;
                decode.unpack_and_convert_fn = unpack_chunk;
                if (job->dwa) decode.decompress_fn = decompress_dwa;
            } else if ((code = exr_decoding_update(reader->file, plan->index, &chunk, &decode)) != EXR_ERR_SUCCESS) {
                break;
            }
            if (chunk.unpacked_size == 0) continue;  /* a row on which no channel has samples */
            lend_buffers(&decode, buffers);
            job->x = plan->tiled ? column * plan->tile_width : 0;
            job->y = row * (plan->tiled ? plan->tile_height : (uint32_t)plan->lines_per_chunk);
            code = exr_decoding_run(reader->file, plan->index, &decode);
        }
    }
    if (begun) {
        decode.packed_buffer = decode.unpacked_buffer = decode.scratch_buffer_1 = NULL;
        decode.packed_alloc_size = decode.unpacked_alloc_size = decode.scratch_alloc_size_1 = 0;
        exr_decoding_destroy(reader->file, &decode);
    }
    if (job->no_memory) return es_context_last_result(reader->context);
    return code == EXR_ERR_SUCCESS ? ES_OK : fail_read(reader, code, "damaged OpenEXR pixels");
}

/* Finds every chunk and the largest sizes, before memory is asked for. */
static es_result survey_chunks(exr_reader* reader, const part_plan* plan, chunk_buffers* buffers)
{
    uint32_t columns, rows;
    chunk_grid(plan, &columns, &rows);
    for (uint32_t row = 0; row < rows; row++) {
        for (uint32_t column = 0; column < columns; column++) {
            exr_chunk_info_t chunk;
            exr_result_t code = chunk_at(reader, plan, column, row, &chunk);
            if (code != EXR_ERR_SUCCESS) return fail_read(reader, code, "damaged OpenEXR chunk table");
            if (chunk.packed_size > reader->source->size) {
                return es_fail(reader->context, ES_FILE_DAMAGED, "'%s': a chunk is larger than the file", reader->source->label);
            }
            if (chunk.packed_size > buffers->packed_size) buffers->packed_size = (size_t)chunk.packed_size;
            if (chunk.unpacked_size > buffers->unpacked_size) buffers->unpacked_size = (size_t)chunk.unpacked_size;
        }
    }
    return ES_OK;
}

static es_result finish_colours(exr_reader* reader, const part_plan* plan, es_image* image)
{
    for (int c = 0; c < plan->channels->num_channels; c++) {
        const exr_attr_chlist_entry_t* entry = plan->channels->entries + c;
        if (entry->x_sampling == 1 && entry->y_sampling == 1) continue;
        bool chroma = c == plan->luminance[1] || c == plan->luminance[2];
        fill_between_samples(image, plan->place[c], (uint32_t)entry->x_sampling, (uint32_t)entry->y_sampling, chroma);
    }
    if (plan->rgb[0] < 0 || plan->rgb[1] < 0 || plan->rgb[2] < 0) return ES_OK;
    uint32_t rgb[3] = {plan->place[plan->rgb[0]], plan->place[plan->rgb[1]], plan->place[plan->rgb[2]]};

    primaries from = rec709;
    double to_xyz[9], to_rec709[9];
    exr_attr_chromaticities_t c;
    const char* label = reader->source->label;
    if (exr_attr_get_chromaticities(reader->file, plan->index, "chromaticities", &c) == EXR_ERR_SUCCESS) {
        from = (primaries){{{c.red_x, c.red_y}, {c.green_x, c.green_y}, {c.blue_x, c.blue_y}, {c.white_x, c.white_y}}};
        if (!rgb_to_rec709(&from, to_rec709)) {
            es_log(reader->context, ES_LOG_WARNING, ES_ASSET_WARNING, "'%s': unusable chromaticities, taken as Rec.709", label);
            from = rec709;
        }
    }
    if (plan->luminance[0] >= 0) {
        double weights[3] = {0.2126, 0.7152, 0.0722};
        if (rgb_to_xyz(&from, to_xyz)) memcpy(weights, to_xyz + 3, sizeof weights);
        if (!(weights[1] > 1e-3)) {
            es_log(reader->context, ES_LOG_WARNING, ES_ASSET_WARNING, "'%s': unusable chromaticities, taken as Rec.709", label);
            memcpy(weights, (double[3]){0.2126, 0.7152, 0.0722}, sizeof weights);
            from = rec709;
        }
        luminance_chroma_to_rgb(image, rgb, weights);
    }
    if (!equals_rec709(&from)) {
        convert_colours(image, rgb, to_rec709);
        es_log(reader->context, ES_LOG_INFO, ES_NOTE, "'%s': colours converted from its own primaries to Rec.709", label);
    }
    return ES_OK;
}

static void name_channels(exr_reader* reader, const part_plan* plan, bool prefixed, es_image* image)
{
    const char* part = NULL;
    if (prefixed && exr_get_name(reader->file, plan->index, &part) != EXR_ERR_SUCCESS) part = NULL;
    for (int c = 0; c < plan->channels->num_channels; c++) {
        const char* name = plan->channels->entries[c].name.str;
        for (int k = 0; k < 3; k++) {
            if (plan->luminance[k] == c) name = (const char* const[3]){"R", "G", "B"}[k];
        }
        char* out = image->channel_names[plan->place[c]];
        int length = part && part[0] ? snprintf(out, ES_CHANNEL_NAME_SIZE, "%s.%s", part, name)
                                     : snprintf(out, ES_CHANNEL_NAME_SIZE, "%s", name);
        if (length >= ES_CHANNEL_NAME_SIZE) {
            es_log(reader->context, ES_LOG_WARNING, ES_ASSET_WARNING, "'%s': the channel name '%s...' was cut to %d characters",
                reader->source->label, out, ES_CHANNEL_NAME_SIZE - 1);
        }
    }
}

static es_result read_part(exr_reader* reader, const part_plan* plan, const chunk_buffers* sizes, bool prefixed, es_image* image)
{
    name_channels(reader, plan, prefixed, image);
    chunk_buffers buffers = *sizes;
    buffers.memory = es_allocate(reader->context, buffers_size(&buffers));
    if (!buffers.memory) return es_context_last_result(reader->context);
    unpacking job = {.plan = plan, .image = image};
    es_dwa_scratch dwa = {.context = reader->context};
    if (plan->compression == EXR_COMPRESSION_DWAA || plan->compression == EXR_COMPRESSION_DWAB) job.dwa = &dwa;
    es_result result = decode_chunks(reader, &job, &buffers);
    es_dwa_scratch_free(&dwa);
    es_release(reader->context, buffers.memory, buffers_size(&buffers));
    return result == ES_OK ? finish_colours(reader, plan, image) : result;
}

/* Surveys and reads `count` parts of equal windows into one image. */
static es_result read_parts(exr_reader* reader, part_plan* plans, uint32_t count, bool prefixed, es_image* image)
{
    uint32_t channels = 0;
    chunk_buffers sizes = {0};
    for (uint32_t i = 0; i < count; i++) {
        place_channels(&plans[i], channels);
        channels += (uint32_t)plans[i].channels->num_channels;
        es_result result = survey_chunks(reader, &plans[i], &sizes);
        if (result != ES_OK) return result;
    }
    es_result result = es_image_create(reader->context, plans[0].width, plans[0].height, channels, image);
    for (uint32_t i = 0; i < count && result == ES_OK; i++) result = read_part(reader, &plans[i], &sizes, prefixed, image);
    return result;
}

static es_result read_file(exr_reader* reader, es_image* image)
{
    const char* label = reader->source->label;
    int parts = 0;
    exr_result_t code = exr_get_count(reader->file, &parts);
    if (code != EXR_ERR_SUCCESS || parts < 1) return fail_read(reader, code, "damaged OpenEXR header");

    /* A part has at least one channel, so no more than so many can share an image. */
    size_t plans_size = sizeof(part_plan) * ES_IMAGE_MAX_CHANNELS;
    part_plan* plans = es_allocate(reader->context, plans_size);
    if (!plans) return es_context_last_result(reader->context);
    uint32_t flat_parts = 0, deep_parts = 0, channels = 0;
    bool together = true;
    es_result result = ES_OK;
    for (int i = 0; i < parts && result == ES_OK; i++) {
        part_plan plan;
        bool flat = false;
        result = plan_part(reader, i, &plan, &flat);
        if (result != ES_OK) break;
        if (!flat) {
            deep_parts++;
            continue;
        }
        channels += (uint32_t)plan.channels->num_channels;
        if (channels > ES_IMAGE_MAX_CHANNELS || (flat_parts && !same_window(&plan, &plans[0]))) together = false;
        if (flat_parts < ES_IMAGE_MAX_CHANNELS) plans[flat_parts] = plan;
        flat_parts++;
    }
    if (result == ES_OK && flat_parts == 0) {
        result = es_fail(reader->context, ES_FILE_UNSUPPORTED, "'%s' holds deep data only; flat scan-line and tiled parts are accepted",
            label);
    }
    if (result == ES_OK) {
        if (deep_parts) {
            es_log(reader->context, ES_LOG_WARNING, ES_ASSET_WARNING, "'%s': %u deep parts were left out", label, deep_parts);
        }
        if (!together) {
            es_log(reader->context, ES_LOG_WARNING, ES_ASSET_WARNING,
                "'%s': only the first of %u parts was read; %s", label, flat_parts,
                channels > ES_IMAGE_MAX_CHANNELS ? "together they have too many channels" : "their data windows differ");
        }
        result = read_parts(reader, plans, together ? flat_parts : 1, together && flat_parts > 1, image);
    }
    es_release(reader->context, plans, plans_size);
    return result;
}

es_result es_image_read_exr(es_context* context, const es_image_source* source, es_image* image)
{
    exr_reader reader = {.context = context, .source = source};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = reader_error;
    init.user_data = &reader;
    init.read_fn = reader_read;
    init.size_fn = reader_size;
    /* Reconstruction would scan a broken file once per part; a file without its chunk table is damaged. */
    init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    exr_result_t code = exr_start_read(&reader.file, source->label, &init);
    if (code != EXR_ERR_SUCCESS) {
        if (reader.file) exr_finish(&reader.file);
        return fail_read(&reader, code, "damaged OpenEXR header");
    }
    es_result result = read_file(&reader, image);
    exr_finish(&reader.file);
    if (result != ES_OK) es_image_destroy(context, image);
    return result;
}

/* ---- write ------------------------------------------------------------------------------------------------------------ */

typedef struct exr_writer {
    es_context* context;
    const es_image* image;
    es_image_sink* sink;
    exr_context_t file;
    exr_pixel_type_t type;
    uint32_t sample_size;
    uint8_t* rows;  /* one chunk's samples, channel after channel */
    size_t rows_size;
    bool no_memory; /* and the context has said so */
    exr_result_t (*compress)(exr_encode_pipeline_t* encode); /* the library's */
} exr_writer;

/* A write context is locked while it reports, so nothing may be asked of it here; the code says enough. */
static void writer_error(exr_const_context_t file, exr_result_t code, const char* text) {}

static int64_t writer_write(exr_const_context_t file, void* user, const void* bytes, uint64_t size, uint64_t offset,
    exr_stream_error_func_ptr_t error)
{
    return es_sink_write_at(((exr_writer*)user)->sink, bytes, (size_t)size, offset) ? (int64_t)size : -1;
}

static void gather_rows(exr_writer* writer, uint32_t channel, uint32_t first_row, uint32_t rows, uint8_t* out)
{
    const es_image* image = writer->image;
    for (uint32_t y = first_row; y < first_row + rows; y++) {
        const float* in = image->pixels + (size_t)y * image->width * image->channels + channel;
        for (uint32_t x = 0; x < image->width; x++, in += image->channels, out += writer->sample_size) {
            if (writer->type == EXR_PIXEL_FLOAT) {
                memcpy(out, in, 4);
            } else {
                uint16_t half = es_float_to_half(*in);
                memcpy(out, &half, 2);
            }
        }
    }
}

/* The library stores what compressing makes larger as it was, and reads what is as large as it was as not compressed; but it leaves in the file what compressing
 * made exactly as large. */
static exr_result_t compress_to_less(exr_encode_pipeline_t* encode)
{
    const exr_result_t code = ((exr_writer*)encode->encoding_user_data)->compress(encode);
    if (code == EXR_ERR_SUCCESS && encode->compressed_bytes == encode->packed_bytes) memcpy(encode->compressed_buffer, encode->packed_buffer, (size_t)encode->packed_bytes);
    return code;
}

static exr_result_t write_chunks(exr_writer* writer)
{
    const es_image* image = writer->image;
    exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_result_t code = EXR_ERR_SUCCESS;
    int32_t lines = 0;
    if ((code = exr_get_scanlines_per_chunk(writer->file, 0, &lines)) != EXR_ERR_SUCCESS) return code;
    size_t plane = (size_t)image->width * (size_t)lines * writer->sample_size;
    writer->rows_size = plane * image->channels;
    writer->rows = es_allocate(writer->context, writer->rows_size);
    if (!writer->rows) {
        writer->no_memory = true;
        return EXR_ERR_OUT_OF_MEMORY;
    }
    for (uint32_t y = 0; y < image->height && code == EXR_ERR_SUCCESS; y += (uint32_t)lines) {
        exr_chunk_info_t chunk;
        if ((code = exr_write_scanline_chunk_info(writer->file, 0, (int)y, &chunk)) != EXR_ERR_SUCCESS) break;
        code = y == 0 ? exr_encoding_initialize(writer->file, 0, &chunk, &encode) : exr_encoding_update(writer->file, 0, &chunk, &encode);
        if (code != EXR_ERR_SUCCESS) break;
        uint32_t rows = image->height - y < (uint32_t)lines ? image->height - y : (uint32_t)lines;
        for (int c = 0; c < encode.channel_count; c++) {
            exr_coding_channel_info_t* info = encode.channels + c;
            uint8_t* out = writer->rows + plane * (size_t)c;
            gather_rows(writer, (uint32_t)es_image_channel(image, info->channel_name), y, rows, out);
            info->user_bytes_per_element = (int16_t)writer->sample_size;
            info->user_data_type = (uint16_t)writer->type;
            info->user_pixel_stride = (int32_t)writer->sample_size;
            info->user_line_stride = (int32_t)(writer->sample_size * image->width);
            info->encode_from_ptr = out;
        }
        if (y == 0) {
            if ((code = exr_encoding_choose_default_routines(writer->file, 0, &encode)) != EXR_ERR_SUCCESS) break;
            writer->compress = encode.compress_fn;
            encode.encoding_user_data = writer;
            if (encode.compress_fn) encode.compress_fn = compress_to_less;
        }
        code = exr_encoding_run(writer->file, 0, &encode);
    }
    if (encode.context) exr_encoding_destroy(writer->file, &encode);
    es_release(writer->context, writer->rows, writer->rows_size);
    return code;
}

static exr_result_t write_header(exr_writer* writer)
{
    const es_image* image = writer->image;
    int part = 0;
    exr_result_t code = exr_set_longname_support(writer->file, 1);
    if (code == EXR_ERR_SUCCESS) code = exr_add_part(writer->file, "main", EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS) {
        code = exr_initialize_required_attr_simple(writer->file, part, (int32_t)image->width, (int32_t)image->height, EXR_COMPRESSION_ZIP);
    }
    for (uint32_t c = 0; c < image->channels && code == EXR_ERR_SUCCESS; c++) {
        code = exr_add_channel(writer->file, part, image->channel_names[c], writer->type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    }
    if (code == EXR_ERR_SUCCESS) code = exr_write_header(writer->file);
    return code;
}

es_result es_image_write_exr(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink)
{
    for (uint32_t c = 0; c < image->channels; c++) {
        const char* name = image->channel_names[c];
        if (!memchr(name, 0, ES_CHANNEL_NAME_SIZE) || name[0] == 0 || es_image_channel(image, name) != (int)c) {
            return es_fail(context, ES_INVALID_ARGUMENT, "cannot write '%s': channel %u has no name of its own", label, c);
        }
    }
    if (desc->sample_type != ES_SAMPLE_HALF && desc->sample_type != ES_SAMPLE_FLOAT) {
        return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_save: the sample type is neither half nor float");
    }
    bool half = desc->sample_type == ES_SAMPLE_HALF;
    exr_writer writer = {.context = context, .image = image, .sink = sink};
    writer.type = half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
    writer.sample_size = half ? 2 : 4;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = writer_error;
    init.user_data = &writer;
    init.write_fn = writer_write;
    init.zip_level = 4;
    exr_result_t code = exr_start_write(&writer.file, label, EXR_WRITE_FILE_DIRECTLY, &init);
    if (code == EXR_ERR_SUCCESS) code = write_header(&writer);
    if (code == EXR_ERR_SUCCESS) code = write_chunks(&writer);
    if (writer.file) {
        exr_result_t finished = exr_finish(&writer.file);  /* writes the chunk table */
        if (code == EXR_ERR_SUCCESS) code = finished;
    }
    if (writer.no_memory) return es_context_last_result(context);
    if (es_sink_failed(sink)) return ES_FILE_WRITE;
    if (code == EXR_ERR_SUCCESS) return ES_OK;
    if (code == EXR_ERR_OUT_OF_MEMORY) return es_fail(context, ES_OUT_OF_MEMORY, "cannot write '%s': out of memory", label);
    return es_fail(context, ES_FILE_WRITE, "cannot write '%s': %s", label, exr_get_default_error_message(code));
}

#else

es_result es_image_read_exr(es_context* context, const es_image_source* source, es_image* image)
{
    return es_fail(context, ES_NOT_BUILT, "'%s' is an OpenEXR file; this build has no OpenEXR", source->label);
}

es_result es_image_write_exr(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink)
{
    return es_fail(context, ES_NOT_BUILT, "cannot write '%s': this build has no OpenEXR; .hdr is accepted", label);
}

#endif
