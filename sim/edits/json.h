/* JSON text (RFC 8259) as a tree that knows where in the text each value stands: to read edits out of a glTF file, and to put them into one without changing the rest. */
#ifndef EARTHSHINE_SIM_EDIT_JSON_H
#define EARTHSHINE_SIM_EDIT_JSON_H

#include "platform/context.h"

typedef enum es_json_type { ES_JSON_NULL, ES_JSON_BOOLEAN, ES_JSON_NUMBER, ES_JSON_STRING, ES_JSON_ARRAY, ES_JSON_OBJECT } es_json_type;
typedef struct es_json_value {
    es_json_type type;
    uint32_t begin, end;      /* bytes of the text, quotes and brackets among them */
    uint32_t key_begin, key_end; /* of a member: without the quotes */
    uint32_t first, next;     /* its first element or member, and the next one beside it; 0: none */
    uint32_t count;           /* of those below it */
} es_json_value;

/* Values are known by number: 0, the whole, is below nothing and stands for "none" elsewhere. */
typedef struct es_json {
    es_context* context;
    const char* label;        /* of messages: the file */
    const char* text;
    size_t size;
    es_json_value* values;
    size_t count, capacity;
} es_json;

/* label and text must outlive it. FILE_DAMAGED with line and byte where it is no JSON, nested more than 128 deep or larger than 4 GB. */
es_result es_json_parse(es_context* context, const char* label, const char* text, size_t size, es_json* json);
void es_json_free(es_json* json);

/* 0: no object, or it has none. Of several by one name the last. */
uint32_t es_json_member(const es_json* json, uint32_t object, const char* name);
/* 0: no array, or it is shorter. */
uint32_t es_json_element(const es_json* json, uint32_t array, uint32_t index);
/* False when it is no number, or one beyond what a double holds. */
bool es_json_number(const es_json* json, uint32_t value, double* number);
bool es_json_boolean(const es_json* json, uint32_t value, bool* boolean);
/* UTF-8 with escapes resolved, zero-terminated; false when it is no string, takes more than `size` bytes or has a zero in it. */
bool es_json_string(const es_json* json, uint32_t value, char* out, size_t size);
/* The same of a member's name. Where false, out has as much of it as fits. */
bool es_json_key(const es_json* json, uint32_t member, char* out, size_t size);

/* ---- writing ---------------------------------------------------------------------------------------------------------- */

typedef struct es_json_text { es_context* context; char* bytes; size_t size, capacity; bool failed; } es_json_text;
void es_json_put(es_json_text* text, const char* bytes, size_t size);
void es_json_write(es_json_text* text, const char* format, ...) ES_PRINTF(2, 3); /* up to 512 bytes */
void es_json_write_string(es_json_text* text, const char* string); /* quoted and escaped; bytes that are no UTF-8 become '?' */
/* So that reading them gives the same bits. Finite. */
void es_json_write_float(es_json_text* text, float number);
void es_json_write_double(es_json_text* text, double number);
void es_json_text_free(es_json_text* text);

#endif
