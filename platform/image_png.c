/* PNG files through libpng: 1 … 16 bit, gray, palette, colour, alpha, interlaced, to linear floats; 8-bit sRGB out.
 *
 * Colour is taken as sRGB whatever gAMA and iCCP say, alpha as it is. The curve comes from es_srgb_decode, through a table
 * of every code, and back through its thresholds, so neither direction meets libm. libpng's memory goes through the
 * context; its errors come back by longjmp, so everything that must survive lives in `png_job`.
 */
#include "platform/image_files.h"

#if ES_WITH_PNG

#include <png.h>
#include <setjmp.h>
#include <string.h>

typedef struct png_job {
    es_context* context;
    const es_image_source* source;
    size_t offset;
    es_image_sink* sink;
    png_structp png;
    png_infop info;
    bool out_of_memory;
    char message[128];
    uint8_t* samples;
    size_t samples_size;
    png_bytep* rows;
    size_t rows_size;
    float* table;
    size_t table_size;
} png_job;

/* libpng does not say how large what it frees was. */
typedef struct png_block { size_t size; } png_block;
enum { PNG_BLOCK_HEADER = 64 };

static png_voidp job_malloc(png_structp png, png_alloc_size_t size)
{
    png_job* job = png_get_mem_ptr(png);
    if (job->out_of_memory) return NULL;  /* zlib asks for several blocks before it looks at the first: one message is enough */
    png_block* block = size < SIZE_MAX - PNG_BLOCK_HEADER ? es_allocate(job->context, size + PNG_BLOCK_HEADER) : NULL;
    if (!block) {
        job->out_of_memory = true;
        return NULL;
    }
    block->size = size + PNG_BLOCK_HEADER;
    return (uint8_t*)block + PNG_BLOCK_HEADER;
}

static void job_free(png_structp png, png_voidp pointer)
{
    if (!pointer) return;
    png_job* job = png_get_mem_ptr(png);
    png_block* block = (png_block*)((uint8_t*)pointer - PNG_BLOCK_HEADER);
    es_release(job->context, block, block->size);
}

static void job_error(png_structp png, png_const_charp text)
{
    png_job* job = png_get_error_ptr(png);
    size_t n = 0;
    for (; text && text[n] && n < sizeof job->message - 1; n++) job->message[n] = text[n] >= 32 && text[n] < 127 ? text[n] : '?';
    job->message[n] = 0;
    png_longjmp(png, 1);
}

/* libpng warns of oddities in optional chunks, none of which is used here. */
static void job_warning(png_structp png, png_const_charp text) {}

static void job_read(png_structp png, png_bytep out, size_t size)
{
    png_job* job = png_get_io_ptr(png);
    if (size > job->source->size - job->offset) png_error(png, "the file ends too early");
    memcpy(out, job->source->bytes + job->offset, size);
    job->offset += size;
}

static void job_write(png_structp png, png_bytep bytes, size_t size)
{
    png_job* job = png_get_io_ptr(png);
    if (!es_sink_write(job->sink, bytes, size)) png_error(png, "writing failed");
}

static void job_flush(png_structp png) {}

static void release_buffers(png_job* job)
{
    es_release(job->context, job->samples, job->samples_size);
    es_release(job->context, job->rows, job->rows_size);
    es_release(job->context, job->table, job->table_size);
}

/* Memory that a failing libpng call must not leak: NULL raises libpng's error, the result comes from the context. */
static void* job_allocate(png_job* job, size_t size, size_t* kept)
{
    void* block = es_allocate(job->context, size);
    if (!block) {
        job->out_of_memory = true;
        png_error(job->png, "out of memory");
    }
    *kept = size;
    return block;
}

static void convert(const png_job* job, es_image* image, uint32_t depth)
{
    size_t pixels = (size_t)image->width * image->height;
    uint32_t channels = image->channels, colours = channels - (channels == 2 || channels == 4);
    const uint8_t* in = job->samples;
    float* out = image->pixels;
    for (size_t i = 0; i < pixels; i++) {
        for (uint32_t c = 0; c < channels; c++, out++) {
            uint32_t code;
            if (depth == 16) {
                code = (uint32_t)in[0] << 8 | in[1];
                in += 2;
            } else {
                code = *in++;
            }
            *out = c < colours ? job->table[code] : (float)code / (depth == 16 ? 65535.0f : 255.0f);
        }
    }
}

static void read_all(png_job* job, es_image* image)
{
    png_structp png = job->png;
    png_set_read_fn(png, job, job_read);
    /* The limits are checked below too, with a better message; here they bound what libpng does before it returns. */
    png_set_user_limits(png, 1000000, 1000000);
    png_set_chunk_malloc_max(png, 8u << 20);
    png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, NULL, 0);
    png_read_info(png, job->info);
    uint32_t width = png_get_image_width(png, job->info), height = png_get_image_height(png, job->info);
    if (width > ES_IMAGE_MAX_SIZE || height > ES_IMAGE_MAX_SIZE) {
        image->width = width;
        image->height = height;
        png_error(png, "too large");
    }
    png_set_expand(png);  /* palettes to RGB, fewer than 8 bits to 8, tRNS to alpha */
    png_set_interlace_handling(png);
    png_read_update_info(png, job->info);
    uint32_t depth = png_get_bit_depth(png, job->info), channels = png_get_channels(png, job->info);
    size_t row_size = png_get_rowbytes(png, job->info);
    if (row_size != (size_t)width * channels * (depth / 8)) png_error(png, "the row size contradicts the header");

    if (es_image_create(job->context, width, height, channels, image) != ES_OK) {
        job->out_of_memory = true;
        png_error(png, "out of memory");
    }
    job->samples = job_allocate(job, row_size * height, &job->samples_size);
    job->rows = job_allocate(job, sizeof *job->rows * height, &job->rows_size);
    for (uint32_t y = 0; y < height; y++) job->rows[y] = job->samples + row_size * y;
    png_read_image(png, job->rows);
    png_read_end(png, NULL);

    uint32_t codes = 1u << depth;
    job->table = job_allocate(job, sizeof *job->table * codes, &job->table_size);
    for (uint32_t code = 0; code < codes; code++) job->table[code] = (float)es_srgb_decode((double)code / (codes - 1));
    convert(job, image, depth);
}

es_result es_image_read_png(es_context* context, const es_image_source* source, es_image* image)
{
    png_job job = {.context = context, .source = source};
    job.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &job, job_error, job_warning, &job, job_malloc, job_free);
    if (job.png) job.info = png_create_info_struct(job.png);
    if (!job.png || !job.info) {
        if (job.png) png_destroy_read_struct(&job.png, NULL, NULL);
        return job.out_of_memory ? es_context_last_result(context)
                                 : es_fail(context, ES_NOT_BUILT, "libpng at run time does not fit the one built against");
    }
    es_result result = ES_OK;
    bool done = setjmp(png_jmpbuf(job.png)) == 0;
    if (done) read_all(&job, image);
    if (job.out_of_memory) {  /* libpng does without some optional things; a file read for less is still a failure */
        result = es_context_last_result(context);
    } else if (done) {
        result = ES_OK;
    } else if (image->width > ES_IMAGE_MAX_SIZE || image->height > ES_IMAGE_MAX_SIZE) {
        result = es_fail(context, ES_IMAGE_SIZE, "'%s' is %u x %u; 1 to %d are accepted", source->label, image->width, image->height,
            ES_IMAGE_MAX_SIZE);
        *image = (es_image){0};
    } else {
        result = es_fail(context, ES_FILE_DAMAGED, "'%s' is a damaged PNG file: %s", source->label, job.message);
    }
    png_destroy_read_struct(&job.png, &job.info, NULL);
    release_buffers(&job);
    if (result != ES_OK) es_image_destroy(context, image);
    return result;
}

/* ---- write ------------------------------------------------------------------------------------------------------------ */

static void write_all(png_job* job, const es_image* image, bool already_srgb)
{
    static const int types[5] = {0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB, PNG_COLOR_TYPE_RGB_ALPHA};
    png_structp png = job->png;
    uint32_t channels = image->channels, colours = channels - (channels == 2 || channels == 4);
    double thresholds[255];
    es_srgb_thresholds(thresholds);
    png_set_write_fn(png, job, job_write, job_flush);
    png_set_IHDR(png, job->info, image->width, image->height, 8, types[channels], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
        PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png, job->info, PNG_sRGB_INTENT_PERCEPTUAL);
    png_set_compression_level(png, 4);
    png_write_info(png, job->info);
    size_t row_samples = (size_t)image->width * channels;
    job->samples = job_allocate(job, row_samples, &job->samples_size);
    for (uint32_t y = 0; y < image->height; y++) {
        const float* in = image->pixels + row_samples * y;
        for (size_t i = 0; i < row_samples; i++) {
            uint32_t c = (uint32_t)(i % channels);
            if (c < colours && !already_srgb) {
                job->samples[i] = es_srgb_encode8(thresholds, in[i]);
            } else {
                float value = in[i] > 0 ? in[i] : 0;  /* NaN: 0 */
                job->samples[i] = value < 1 ? (uint8_t)(value * 255.0f + 0.5f) : 255;
            }
        }
        png_write_row(png, job->samples);
    }
    png_write_end(png, NULL);
}

es_result es_image_write_png(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink)
{
    if (image->channels > 4) {
        return es_fail(context, ES_INVALID_ARGUMENT, "cannot write '%s': a PNG file has 1 to 4 channels, the image %u", label, image->channels);
    }
    png_job job = {.context = context, .sink = sink};
    job.png = png_create_write_struct_2(PNG_LIBPNG_VER_STRING, &job, job_error, job_warning, &job, job_malloc, job_free);
    if (job.png) job.info = png_create_info_struct(job.png);
    if (!job.png || !job.info) {
        if (job.png) png_destroy_write_struct(&job.png, NULL);
        return job.out_of_memory ? es_context_last_result(context)
                                 : es_fail(context, ES_NOT_BUILT, "libpng at run time does not fit the one built against");
    }
    es_result result = ES_OK;
    bool done = setjmp(png_jmpbuf(job.png)) == 0;
    if (done) write_all(&job, image, desc->already_srgb);
    if (job.out_of_memory) result = es_context_last_result(context);
    else if (es_sink_failed(sink)) result = ES_FILE_WRITE;
    else if (!done) result = es_fail(context, ES_FILE_WRITE, "cannot write '%s': %s", label, job.message);
    png_destroy_write_struct(&job.png, &job.info);
    release_buffers(&job);
    return result;
}

#else

es_result es_image_read_png(es_context* context, const es_image_source* source, es_image* image)
{
    return es_fail(context, ES_NOT_BUILT, "'%s' is a PNG file; this build has no libpng", source->label);
}

es_result es_image_write_png(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink)
{
    return es_fail(context, ES_NOT_BUILT, "cannot write '%s': this build has no libpng; .hdr is accepted", label);
}

#endif
