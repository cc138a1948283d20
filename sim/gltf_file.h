/* What the glTF importer reads before any parser of others sees it: the container, the resources it names, the JSON text.
 *
 * tinygltf turns JSON into structures, but it trusts the file in three places that a hostile one can use: it reads image
 * bytes before the buffer view is checked, looks for resources outside of the file's folder, and silently drops or
 * truncates numbers of the wrong type. So containers, buffers and images are handled here, and the text is screened. */
#ifndef EARTHSHINE_SIM_GLTF_FILE_H
#define EARTHSHINE_SIM_GLTF_FILE_H

#include "platform/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- the container: text or GLB ------------------------------------------------------------------------------------- */

typedef struct es_gltf_file {
    es_context* context;
    const char* path;       /* as given; must outlive the file */
    uint8_t* bytes;
    size_t size;
    const char* json;       /* inside of bytes */
    size_t json_size;
    const uint8_t* binary;  /* GLB's BIN chunk, inside of bytes; NULL: none */
    size_t binary_size;
} es_gltf_file;

/* By content. Checks that every chunk lies in the file. */
es_result es_gltf_file_open(es_context* context, const char* path, es_gltf_file* file);
void es_gltf_file_close(es_gltf_file* file);

/* Bytes of a data URI or of a file in the folder of `file` or below it. needed > 0: exactly so many, failing when the
 * resource has fewer; 0: all. `where` is the JSON path for messages. Release with es_release(context, *bytes, *size). */
es_result es_gltf_resource_load(
    const es_gltf_file* file, const char* where, const char* uri, size_t uri_size, size_t needed, uint8_t** bytes, size_t* size);

enum { ES_GLTF_PRINTABLE = 72 };
/* Text out of the file, fit for one line of a message: control characters replaced, shortened. */
const char* es_gltf_printable(const char* text, size_t size, char buffer[ES_GLTF_PRINTABLE]);

/* ---- the text --------------------------------------------------------------------------------------------------------- */

typedef struct es_gltf_resource {
    char* uri;              /* decoded; NULL: absent */
    size_t uri_size;
    uint64_t byte_length;   /* buffers; 0: absent */
    int64_t buffer_view;    /* images; -1: absent */
} es_gltf_resource;

typedef struct es_gltf_primitive { uint32_t mesh, primitive; int64_t indices; /* accessor; -1: absent */ } es_gltf_primitive;

typedef struct es_gltf_document {
    char* text;             /* for tinygltf: `buffers` and `images` are empty, primitives' `indices` renamed */
    size_t text_size, text_capacity;
    es_gltf_resource *buffers, *images;
    size_t buffer_count, buffer_capacity, image_count, image_capacity;
    es_gltf_primitive* primitives; /* in the order of the file */
    size_t primitive_count, primitive_capacity;
    size_t value_count, object_count, material_count; /* of the text: all values, objects outside of extras and extensions, materials */
} es_gltf_document;

/* Refuses what is not JSON, is nested too deeply, is no glTF 2.0, requires an extension that is not supported, or has
 * something else than a whole number where glTF has an index, a size or a count. */
es_result es_gltf_document_read(const es_gltf_file* file, es_gltf_document* document);
void es_gltf_document_free(es_context* context, es_gltf_document* document);
/* NULL-terminated list of the extensions that may be required. */
extern const char* const es_gltf_extensions[];

/* ---- images -------------------------------------------------------------------------------------------------------------- */

typedef struct es_gltf_image_header { uint32_t width, height, bits; } es_gltf_image_header;
/* Of a PNG or JPEG file, without decoding it; false when it is neither or ends before its size is known. */
bool es_gltf_image_header_read(const uint8_t* bytes, size_t size, es_gltf_image_header* header);

#ifdef __cplusplus
}
#endif
#endif
