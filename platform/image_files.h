/* Readers and writers of image files, one per format: internal to the platform floor.
 *
 * A reader gets the whole file as bytes and fills a zero image, which it leaves zero when it fails. It has called es_fail
 * by then. A writer has checked nothing but what its format restricts; es_image_save checks the rest. When the sink fails
 * a writer returns FILE_WRITE without a message: es_image_save knows the path and the system's reason.
 */
#ifndef EARTHSHINE_PLATFORM_IMAGE_FILES_H
#define EARTHSHINE_PLATFORM_IMAGE_FILES_H

#include "platform/context.h"

typedef struct es_image_source {
    const uint8_t* bytes;
    size_t size;
    const char* label;  /* how messages name the file */
} es_image_source;

es_result es_image_read_exr(es_context* context, const es_image_source* source, es_image* image);
es_result es_image_read_png(es_context* context, const es_image_source* source, es_image* image);
es_result es_image_read_hdr(es_context* context, const es_image_source* source, es_image* image);

typedef struct es_image_sink es_image_sink;
/* False after the first failure, which sticks. */
bool es_sink_write(es_image_sink* sink, const void* bytes, size_t size);
bool es_sink_write_at(es_image_sink* sink, const void* bytes, size_t size, uint64_t offset);
bool es_sink_failed(const es_image_sink* sink);

es_result es_image_write_exr(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink);
es_result es_image_write_png(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink);
es_result es_image_write_hdr(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink);

/* ---- sample encodings, exact on every machine ------------------------------------------------------------------------- */

/* Every half is a float; NaN payloads and the sign are kept. */
float es_half_to_float(uint16_t half);
/* Nearest, ties to even; beyond 65519.99… infinity; NaN stays NaN. */
uint16_t es_float_to_half(float value);

/* IEC 61966-2-1, encoded in [0, 1] to linear. Error below 1e-15, so its float is the correctly rounded one. */
double es_srgb_decode(double encoded);
/* thresholds[k]: the linear value at which code k + 1 begins, i.e. the decoded (k + 0.5) / 255. */
void es_srgb_thresholds(double thresholds[255]);
/* Nearest 8-bit code; NaN and negative give 0, above one 255. */
uint8_t es_srgb_encode8(const double thresholds[255], float linear);

#endif
