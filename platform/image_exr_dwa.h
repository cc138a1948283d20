/* The lossy DCT compressions of OpenEXR, DWAA and DWAB, decoded; OpenEXRCore 3.1 names them but has no code for them. */
#ifndef EARTHSHINE_PLATFORM_IMAGE_EXR_DWA_H
#define EARTHSHINE_PLATFORM_IMAGE_EXR_DWA_H

#include "platform/context.h"

typedef enum es_dwa_type { ES_DWA_UINT, ES_DWA_HALF, ES_DWA_FLOAT } es_dwa_type;  /* the file's numbers */
typedef struct es_dwa_channel {
    const char* name;
    es_dwa_type type;
    uint32_t x_sampling, y_sampling;
    bool linear;  /* the channel's own mark: not to be encoded like a colour */
} es_dwa_channel;

/* Memory kept from chunk to chunk. Begin with zero but for the context. */
typedef struct es_dwa_scratch {
    es_context* context;
    uint8_t* memory;
    size_t size;
    uint16_t* to_linear;
} es_dwa_scratch;

typedef enum es_dwa_result { ES_DWA_OK, ES_DWA_NO_MEMORY, ES_DWA_DAMAGED } es_dwa_result;

/* Decodes one chunk of `width` × `height` pixels whose first row is `first_row` into `out_size` bytes: per row, each
 * channel's samples, little-endian. At most ES_IMAGE_MAX_CHANNELS channels, sorted by name as in the file. */
es_dwa_result es_dwa_decode(es_dwa_scratch* scratch, const uint8_t* packed, size_t packed_size, const es_dwa_channel* channels,
    uint32_t channel_count, uint32_t width, uint32_t height, int32_t first_row, uint8_t* out, size_t out_size);
void es_dwa_scratch_free(es_dwa_scratch* scratch);

#endif
