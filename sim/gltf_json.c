/* Screens the JSON text of a glTF file before tinygltf parses it, in one pass without recursion.
 *
 * It is a complete parser for RFC 8259 (less the check of UTF-8, which the parser behind it makes) with an explicit stack of
 * limited depth, because values are turned into structures recursively later on. From the stack it knows each value's JSON
 * path. It checks the type of every index, size and count (tinygltf drops those of another type and truncates to 32 bits),
 * takes out buffers and images (see gltf_file.h), and finds version and required extensions.
 *
 * Order of complaints: syntax, then version, then required extensions, then wrong values: a glTF 1.0 file or one for a
 * feature that is not supported is named as such rather than called damaged. */
#include "sim/gltf_file.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Deepest nesting: core glTF needs 9, the rest is for extras and extensions. 128 frames of the recursive conversion take
 * some 50 KiB of stack. */
enum { MAX_DEPTH = 128 };

const char* const es_gltf_extensions[] = {"EXT_lights_image_based", "KHR_animation_pointer", "KHR_implicit_shapes", "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_specular",
    "KHR_materials_transmission", "KHR_materials_unlit", "KHR_mesh_quantization", "KHR_physics_rigid_bodies", "KHR_texture_transform", NULL};

typedef struct span { const char* begin; size_t size; } span;

typedef struct level { bool object; span key; uint64_t index; } level;

typedef struct parser {
    es_context* context;
    const char* path;
    es_gltf_document* document;
    const char *begin, *at, *end;
    const char* copied;         /* text up to here is in document->text */
    const char* taken;          /* begin of a value that is taken out; NULL: none */
    level stack[MAX_DEPTH];
    uint32_t depth;
    uint32_t ignored;           /* depth at which extras or an extension began; 0: outside */
    bool seen_buffers, seen_images, seen_meshes;
    bool target_names_node;     /* of the channel's target that is being read */
    bool has_version, has_minimum;
    uint32_t version[2], minimum[2];
    char extension[ES_GLTF_PRINTABLE];
    char issue[256];            /* the first wrong value */
    es_result failed;
} parser;

/* ---- what must be a whole number ------------------------------------------------------------------------------------------ */

static const uint64_t index_limit = INT32_MAX;        /* tinygltf keeps indices as int */
static const uint64_t size_limit = 1ull << 53;        /* the largest that JSON numbers carry exactly */

typedef struct rule { const char *section, *key; bool list, size; } rule;
static const rule rules[] = {
    {"buffers", "byteLength", false, true},
    {"bufferViews", "buffer", false, false},
    {"bufferViews", "byteOffset", false, true},
    {"bufferViews", "byteLength", false, true},
    {"bufferViews", "byteStride", false, false},
    {"bufferViews", "target", false, false},
    {"accessors", "bufferView", false, false},
    {"accessors", "byteOffset", false, false}, /* sparse offsets are kept as int */
    {"accessors", "componentType", false, false},
    {"accessors", "count", false, false},
    {"images", "bufferView", false, false},
    {"textures", "sampler", false, false},
    {"textures", "source", false, false},
    {"samplers", "magFilter", false, false},
    {"samplers", "minFilter", false, false},
    {"samplers", "wrapS", false, false},
    {"samplers", "wrapT", false, false},
    {"materials", "index", false, false},
    {"materials", "texCoord", false, false},
    {"meshes", "indices", false, false},
    {"meshes", "material", false, false},
    {"meshes", "mode", false, false},
    {"nodes", "mesh", false, false},
    {"nodes", "skin", false, false},
    {"nodes", "camera", false, false},
    {"nodes", "children", true, false},
    {"scenes", "nodes", true, false},
    {"skins", "inverseBindMatrices", false, false},
    {"skins", "skeleton", false, false},
    {"skins", "joints", true, false},
    {"animations", "sampler", false, false},
    {"animations", "input", false, false},
    {"animations", "output", false, false},
    {"animations", "node", false, false},
};
static const char* const sections[] = {"accessors", "animations", "bufferViews", "buffers", "cameras", "extensionsRequired",
    "extensionsUsed", "images", "materials", "meshes", "nodes", "samplers", "scenes", "skins", "textures"};

static bool is(span text, const char* word) { return text.size == strlen(word) && memcmp(text.begin, word, text.size) == 0; }

/* The largest number allowed where the stack points; 0: anything may stand there. */
static uint64_t integer_limit(const parser* p)
{
    const level* s = p->stack;
    uint32_t d = p->depth;
    if (p->ignored || d == 0 || !s[0].object) { return 0; }
    if (d == 1) { return is(s[0].key, "scene") ? index_limit : 0; }
    if (d < 3 || s[1].object) { return 0; }
    bool list = !s[d - 1].object;
    span key = list ? s[d - 2].key : s[d - 1].key;
    if (list && !s[d - 2].object) { return 0; }
    if (is(s[0].key, "meshes")) {
        if (d == 6 && is(s[4].key, "attributes")) { return index_limit; }
        if (d == 7 && is(s[4].key, "targets")) { return index_limit; }
    }
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++) {
        if (rules[i].list == list && is(s[0].key, rules[i].section) && is(key, rules[i].key)) {
            return rules[i].size ? size_limit : index_limit;
        }
    }
    return 0;
}

/* ---- messages ------------------------------------------------------------------------------------------------------------------ */

static void json_path(const parser* p, char* out, size_t size)
{
    size_t length = 0;
    out[0] = 0;
    for (uint32_t i = 0; i < p->depth && length + 1 < size; i++) {
        char shown[ES_GLTF_PRINTABLE];
        int added = p->stack[i].object
            ? snprintf(out + length, size - length, "%s%s", i ? "." : "", es_gltf_printable(p->stack[i].key.begin, p->stack[i].key.size, shown))
            : snprintf(out + length, size - length, "[%llu]", (unsigned long long)p->stack[i].index);
        if (added < 0) { return; }
        length += (size_t)added;
    }
}

ES_PRINTF(2, 3) static void note_issue(parser* p, const char* format, ...)
{
    if (p->issue[0]) { return; }
    char where[128];
    json_path(p, where, sizeof where);
    int length = snprintf(p->issue, sizeof p->issue, "%s: ", where);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(p->issue + length, sizeof p->issue - (size_t)length, format, arguments);
    va_end(arguments);
}

static bool syntax(parser* p, const char* wanted)
{
    uint32_t line = 1;
    for (const char* c = p->begin; c < p->at; c++) { line += *c == '\n'; }
    p->failed = es_fail(p->context, ES_FILE_DAMAGED, "%s: JSON, line %u, byte %zu: %s%s", p->path, line, (size_t)(p->at - p->begin),
        p->at == p->end ? "the text ends; " : "", wanted);
    return false;
}

/* ---- output text ------------------------------------------------------------------------------------------------------------------ */

static bool emit(parser* p, const char* text, size_t size)
{
    es_gltf_document* d = p->document;
    if (d->text_size + size > d->text_capacity &&
        !es_grow(p->context, (void**)&d->text, &d->text_capacity, d->text_size, d->text_size + size, 1)) {
        p->failed = es_context_last_result(p->context);
        return false;
    }
    if (size > 0) { memcpy(d->text + d->text_size, text, size); }
    d->text_size += size;
    return true;
}

static bool emit_up_to(parser* p, const char* at)
{
    const char* from = p->copied;
    p->copied = at;
    return emit(p, from, (size_t)(at - from));
}

/* ---- strings ------------------------------------------------------------------------------------------------------------------------ */

static int32_t hexadecimal4(const char* text)
{
    int32_t value = 0;
    for (int i = 0; i < 4; i++) {
        char c = text[i];
        int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
        if (digit < 0) { return -1; }
        value = value * 16 + digit;
    }
    return value;
}

/* At the opening quote; leaves `at` behind the closing one and gives what is between, still escaped. */
static bool read_string(parser* p, span* text, bool* escaped)
{
    const char* begin = ++p->at;
    *escaped = false;
    for (;;) {
        if (p->at == p->end) { return syntax(p, "a string needs its closing '\"'"); }
        unsigned char c = (unsigned char)*p->at;
        if (c == '"') { break; }
        if (c < 32) { return syntax(p, "a control character in a string must be escaped"); }
        if (c == '\\') {
            *escaped = true;
            p->at++;
            if (p->at == p->end) { return syntax(p, "an escape is incomplete"); }
            if (*p->at == 'u') {
                if (p->end - p->at < 5 || hexadecimal4(p->at + 1) < 0) { return syntax(p, "\\u needs four hexadecimal digits"); }
                p->at += 4;
            } else if (!memchr("\"\\/bfnrt", *p->at, 8)) {
                return syntax(p, "no such escape");
            }
        }
        p->at++;
    }
    *text = (span){begin, (size_t)(p->at - begin)};
    p->at++;
    return true;
}

/* Resolves the escapes of a string that read_string accepted; out has room for text.size bytes. */
static size_t unescape(span text, char* out)
{
    size_t length = 0;
    for (size_t i = 0; i < text.size; i++) {
        char c = text.begin[i];
        if (c != '\\') {
            out[length++] = c;
            continue;
        }
        c = text.begin[++i];
        switch (c) {
        case 'b': out[length++] = '\b'; break;
        case 'f': out[length++] = '\f'; break;
        case 'n': out[length++] = '\n'; break;
        case 'r': out[length++] = '\r'; break;
        case 't': out[length++] = '\t'; break;
        case 'u': {
            uint32_t code = (uint32_t)hexadecimal4(text.begin + i + 1);
            i += 4;
            if (code >= 0xd800 && code < 0xdc00 && text.size - i > 6 && text.begin[i + 1] == '\\' && text.begin[i + 2] == 'u') {
                uint32_t low = (uint32_t)hexadecimal4(text.begin + i + 3);
                if (low >= 0xdc00 && low < 0xe000) {
                    code = 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
                    i += 6;
                }
            }
            if (code < 0x80) {
                out[length++] = (char)code;
            } else if (code < 0x800) {
                out[length++] = (char)(0xc0 | code >> 6);
                out[length++] = (char)(0x80 | (code & 63));
            } else if (code < 0x10000) {
                out[length++] = (char)(0xe0 | code >> 12);
                out[length++] = (char)(0x80 | (code >> 6 & 63));
                out[length++] = (char)(0x80 | (code & 63));
            } else {
                out[length++] = (char)(0xf0 | code >> 18);
                out[length++] = (char)(0x80 | (code >> 12 & 63));
                out[length++] = (char)(0x80 | (code >> 6 & 63));
                out[length++] = (char)(0x80 | (code & 63));
            }
            break;
        }
        default: out[length++] = c; break;
        }
    }
    return length;
}

/* ---- what is found -------------------------------------------------------------------------------------------------------------------- */

typedef enum value_kind { VALUE_OBJECT, VALUE_ARRAY, VALUE_STRING, VALUE_NUMBER, VALUE_OTHER } value_kind;

static bool read_version(span text, uint32_t version[2])
{
    uint32_t part = 0, digits = 0;
    version[0] = version[1] = 0;
    for (size_t i = 0; i < text.size; i++) {
        char c = text.begin[i];
        if (c == '.' && part == 0 && digits > 0) {
            part = 1;
            digits = 0;
        } else if (c >= '0' && c <= '9' && digits < 6) {
            version[part] = version[part] * 10 + (uint32_t)(c - '0');
            digits++;
        } else {
            return false;
        }
    }
    return part == 1 && digits > 0;
}

/* A number without fraction and exponent; false: it is none, negative, or above the limit. */
static bool whole_number(span text, uint64_t limit, uint64_t* value)
{
    *value = 0;
    if (text.size == 0 || text.size > 16) { return false; }
    for (size_t i = 0; i < text.size; i++) {
        if (text.begin[i] < '0' || text.begin[i] > '9') { return false; }
        *value = *value * 10 + (uint64_t)(text.begin[i] - '0');
    }
    return *value <= limit;
}

static bool add_resource(parser* p, es_gltf_resource** list, size_t* count, size_t* capacity)
{
    if (*count == *capacity && !es_grow(p->context, (void**)list, capacity, *count, *count + 1, sizeof **list)) {
        p->failed = es_context_last_result(p->context);
        return false;
    }
    (*list)[(*count)++] = (es_gltf_resource){.buffer_view = -1};
    return true;
}

static bool found_in_resource(parser* p, es_gltf_resource* resource, value_kind kind, span text, bool escaped, uint64_t number)
{
    span key = p->stack[2].key;
    if (is(key, "uri")) {
        if (kind != VALUE_STRING) {
            note_issue(p, "must be a string");
            return true;
        }
        if (resource->uri) { es_release(p->context, resource->uri, resource->uri_size + 1); }
        resource->uri = NULL;
        char* uri = es_allocate(p->context, text.size + 1);
        if (!uri) {
            p->failed = es_context_last_result(p->context);
            return false;
        }
        size_t length = text.size;
        if (escaped) {
            length = unescape(text, uri);
            /* the block's size must be known when it is released */
            memset(uri + length, 0, text.size + 1 - length);
            if (length != text.size) {
                char* fitted = es_allocate(p->context, length + 1);
                if (fitted) { memcpy(fitted, uri, length + 1); }
                es_release(p->context, uri, text.size + 1);
                if (!fitted) {
                    p->failed = es_context_last_result(p->context);
                    return false;
                }
                uri = fitted;
            }
        } else {
            memcpy(uri, text.begin, text.size);
        }
        uri[length] = 0;
        resource->uri = uri;
        resource->uri_size = length;
    } else if (is(key, "byteLength") && kind == VALUE_NUMBER) {
        resource->byte_length = number;
    } else if (is(key, "bufferView") && kind == VALUE_NUMBER) {
        resource->buffer_view = (int64_t)number;
    }
    return true;
}

/* Called for each value, at its begin for objects and arrays; the stack says where. text: of a string or number. */
static bool found(parser* p, value_kind kind, span text, bool escaped)
{
    const level* s = p->stack;
    uint32_t d = p->depth;
    es_gltf_document* document = p->document;
    if (p->ignored || d == 0 || !s[0].object) { return true; }
    uint64_t limit = integer_limit(p), number = 0;
    if (limit > 0 && (kind != VALUE_NUMBER || !whole_number(text, limit, &number))) {
        char shown[ES_GLTF_PRINTABLE];
        note_issue(p, "%s%smust be a whole number from 0 to %llu", kind == VALUE_NUMBER ? es_gltf_printable(text.begin, text.size, shown) : "",
            kind == VALUE_NUMBER ? " is out of range, " : "", (unsigned long long)limit);
        number = 0;
    }
    if (d == 1) {
        for (size_t i = 0; i < sizeof sections / sizeof *sections; i++) {
            if (is(s[0].key, sections[i]) && kind != VALUE_ARRAY) { note_issue(p, "must be an array"); }
        }
        bool* seen = is(s[0].key, "buffers") ? &p->seen_buffers : is(s[0].key, "images") ? &p->seen_images
            : is(s[0].key, "meshes") ? &p->seen_meshes : NULL;
        if (seen && *seen) { note_issue(p, "is given twice"); }
        if (seen) { *seen = true; }
        return true;
    }
    if (d == 2 && s[1].object && is(s[0].key, "asset") && kind == VALUE_STRING) {
        if (is(s[1].key, "version")) {
            p->has_version = read_version(text, p->version);
        } else if (is(s[1].key, "minVersion")) {
            p->has_minimum = true;
            if (!read_version(text, p->minimum)) { note_issue(p, "must be two numbers with a '.' between"); }
        }
        return true;
    }
    if (s[1].object) { return true; }
    if (d == 2 && is(s[0].key, "extensionsRequired") && kind == VALUE_STRING && !p->extension[0]) {
        bool known = false;
        for (size_t i = 0; es_gltf_extensions[i]; i++) { known |= is(text, es_gltf_extensions[i]); }
        if (!known) { es_gltf_printable(text.size ? text.begin : "(unnamed)", text.size ? text.size : 9, p->extension); }
        return true;
    }
    bool buffers = is(s[0].key, "buffers"), images = is(s[0].key, "images");
    if (buffers || images) {
        if (d == 2) {
            if (kind != VALUE_OBJECT) { note_issue(p, "must be an object"); }
            return buffers ? add_resource(p, &document->buffers, &document->buffer_count, &document->buffer_capacity)
                           : add_resource(p, &document->images, &document->image_count, &document->image_capacity);
        }
        if (d == 3 && s[2].object) {
            es_gltf_resource* list = buffers ? document->buffers : document->images;
            return found_in_resource(p, &list[(buffers ? document->buffer_count : document->image_count) - 1], kind, text, escaped, number);
        }
        return true;
    }
    if (is(s[0].key, "meshes") && d >= 4 && s[2].object && is(s[2].key, "primitives") && !s[3].object) {
        if (d == 4) {
            if (kind != VALUE_OBJECT) { note_issue(p, "must be an object"); }
            if (document->primitive_count == document->primitive_capacity &&
                !es_grow(p->context, (void**)&document->primitives, &document->primitive_capacity, document->primitive_count,
                    document->primitive_count + 1, sizeof *document->primitives)) {
                p->failed = es_context_last_result(p->context);
                return false;
            }
            document->primitives[document->primitive_count++] = (es_gltf_primitive){(uint32_t)s[1].index, (uint32_t)s[3].index, -1};
        } else if (d == 5 && s[4].object && is(s[4].key, "indices") && kind == VALUE_NUMBER) {
            document->primitives[document->primitive_count - 1].indices = (int64_t)number;
        }
    }
    return true;
}

/* ---- the parser ---------------------------------------------------------------------------------------------------------------------------- */

static void skip_space(parser* p)
{
    while (p->at < p->end && (*p->at == ' ' || *p->at == '\t' || *p->at == '\n' || *p->at == '\r')) { p->at++; }
}

/* At the opening quote of a property's name; leaves `at` at its value. */
static bool read_key(parser* p)
{
    skip_space(p);
    if (p->at == p->end || *p->at != '"') { return syntax(p, "a property's name in '\"' is expected"); }
    bool escaped;
    level* top = &p->stack[p->depth - 1];
    if (!read_string(p, &top->key, &escaped)) { return false; }
    skip_space(p);
    if (p->at == p->end || *p->at != ':') { return syntax(p, "':' is expected"); }
    p->at++;
    if (p->ignored) { return true; }
    if (p->depth == 6 && is(top->key, "node")) { p->target_names_node = true; }
    if (is(top->key, "extras") || is(top->key, "extensions")) {
        p->ignored = p->depth;
    } else if (escaped) {
        /* glTF 2.0 §2.7 wants plain names; an escaped one would be seen by the parser behind this and not here */
        note_issue(p, "names of properties must be written without escapes");
    } else if (p->depth == 5 && is(top->key, "indices") && is(p->stack[0].key, "meshes")) {
        /* hidden: tinygltf refuses indices without a buffer view, which sparse ones need not have */
        return emit_up_to(p, top->key.begin) && emit(p, "_", 1);
    }
    return true;
}

/* Inside of an animation channel's target? */
static bool in_channel_target(const parser* p)
{
    return p->depth == 6 && !p->ignored && p->stack[5].object && is(p->stack[4].key, "target") && is(p->stack[2].key, "channels") && is(p->stack[0].key, "animations");
}

static bool read_number(parser* p, span* text)
{
    const char* begin = p->at;
#define DIGITS() do { if (p->at == p->end || *p->at < '0' || *p->at > '9') { return syntax(p, "a digit is expected"); } \
        while (p->at < p->end && *p->at >= '0' && *p->at <= '9') { p->at++; } } while (0)
    if (*p->at == '-') { p->at++; }
    if (p->at < p->end && *p->at == '0') {
        p->at++;
    } else {
        DIGITS();
    }
    if (p->at < p->end && *p->at == '.') {
        p->at++;
        DIGITS();
    }
    if (p->at < p->end && (*p->at == 'e' || *p->at == 'E')) {
        p->at++;
        if (p->at < p->end && (*p->at == '+' || *p->at == '-')) { p->at++; }
        DIGITS();
    }
#undef DIGITS
    *text = (span){begin, (size_t)(p->at - begin)};
    return true;
}

static bool read_word(parser* p)
{
    static const char* const words[] = {"true", "false", "null"};
    for (size_t i = 0; i < 3; i++) {
        size_t length = strlen(words[i]);
        if ((size_t)(p->end - p->at) >= length && memcmp(p->at, words[i], length) == 0) {
            p->at += length;
            return true;
        }
    }
    return syntax(p, "a value is expected");
}

/* What the structures made of the text will take depends on these. */
static void count_value(parser* p, char first)
{
    p->document->value_count++;
    if (first != '{' || p->ignored) { return; }
    p->document->object_count++;
    if (p->depth == 2 && !p->stack[1].object && is(p->stack[0].key, "materials")) { p->document->material_count++; }
}

static bool parse(parser* p)
{
    enum { BEFORE_VALUE, AFTER_VALUE } state = BEFORE_VALUE;
    for (;;) {
        skip_space(p);
        if (state == BEFORE_VALUE) {
            if (p->at == p->end) { return syntax(p, "a value is expected"); }
            if (p->depth == 1 && !p->ignored && (is(p->stack[0].key, "buffers") || is(p->stack[0].key, "images"))) { p->taken = p->at; }
            char c = *p->at;
            span text = {p->at, 0};
            bool escaped = false;
            state = AFTER_VALUE;
            count_value(p, c);
            if (c == '{' || c == '[') {
                if (!found(p, c == '{' ? VALUE_OBJECT : VALUE_ARRAY, text, false)) { return false; }
                if (p->depth == MAX_DEPTH) { return syntax(p, "is nested deeper than 128 levels"); }
                p->stack[p->depth++] = (level){.object = c == '{', .key = {"", 0}};
                if (p->depth == 6) { p->target_names_node = false; }
                p->at++;
                skip_space(p);
                if (p->at < p->end && *p->at == (c == '{' ? '}' : ']')) {
                    /* tinygltf drops empty objects of extensions and extras; "motion": {} has a meaning */
                    if (c == '{' && p->ignored && (!emit_up_to(p, p->at) || !emit(p, "\"\":0", 4))) { return false; }
                    continue;
                }
                if (c == '{' && !read_key(p)) { return false; }
                state = BEFORE_VALUE;
                continue;
            }
            value_kind kind = c == '"' ? VALUE_STRING : c == '-' || (c >= '0' && c <= '9') ? VALUE_NUMBER : VALUE_OTHER;
            bool good = kind == VALUE_STRING ? read_string(p, &text, &escaped) : kind == VALUE_NUMBER ? read_number(p, &text) : read_word(p);
            if (!good || !found(p, kind, text, escaped)) { return false; }
        } else {
            if (p->depth == 1 && p->taken) {
                /* behind a value that is taken out */
                const char* behind = p->at;
                if (!emit_up_to(p, p->taken) || !emit(p, "[]", 2)) { return false; }
                p->copied = behind;
                p->taken = NULL;
            }
            if (p->depth == 0) {
                if (p->at != p->end) { return syntax(p, "nothing may follow the document"); }
                return emit_up_to(p, p->end);
            }
            level* top = &p->stack[p->depth - 1];
            if (p->ignored == p->depth) { p->ignored = 0; }
            if (p->at == p->end) { return syntax(p, top->object ? "',' or '}' is expected" : "',' or ']' is expected"); }
            if (*p->at == ',') {
                p->at++;
                top->index++;
                if (top->object && !read_key(p)) { return false; }
                state = BEFORE_VALUE;
            } else if (*p->at == (top->object ? '}' : ']')) {
                if (in_channel_target(p) && !p->target_names_node) {
                    /* tinygltf drops channels without a node, as those of KHR_animation_pointer are */
                    const char* none = ",\"node\":-1";
                    if (top->key.size == 0) { none++; }
                    if (!emit_up_to(p, p->at) || !emit(p, none, strlen(none))) { return false; }
                }
                p->at++;
                p->depth--;
            } else {
                return syntax(p, top->object ? "',' or '}' is expected" : "',' or ']' is expected");
            }
        }
    }
}

es_result es_gltf_document_read(const es_gltf_file* file, es_gltf_document* document)
{
    es_context* context = file->context;
    *document = (es_gltf_document){0};
    /* the stack is too large to lie on the caller's */
    parser* p = es_allocate_zero(context, sizeof *p);
    if (!p) { return es_context_last_result(context); }
    p->context = context;
    p->path = file->path;
    p->document = document;
    p->begin = p->at = p->copied = file->json;
    p->end = file->json + file->json_size;
    es_result result = ES_OK;
    if (!parse(p)) {
        result = p->failed;
    } else if (p->has_version && p->version[0] < 2) {
        result = es_fail(context, ES_FILE_UNSUPPORTED, "%s: is glTF %u.%u, glTF 2.0 is read", file->path, p->version[0], p->version[1]);
    } else if (p->has_minimum && (p->minimum[0] > 2 || (p->minimum[0] == 2 && p->minimum[1] > 0))) {
        result = es_fail(context, ES_FILE_UNSUPPORTED, "%s: asks for glTF %u.%u at least (asset.minVersion), glTF 2.0 is read", file->path,
            p->minimum[0], p->minimum[1]);
    } else if (p->has_version && p->version[0] > 2 && !p->has_minimum) {
        result = es_fail(context, ES_FILE_UNSUPPORTED, "%s: is glTF %u.%u, glTF 2.0 is read", file->path, p->version[0], p->version[1]);
    } else if (p->extension[0]) {
        result = es_fail(context, ES_FILE_UNSUPPORTED, "%s: requires the extension %s, which is not supported", file->path, p->extension);
    } else if (!p->has_version) {
        result = es_fail(context, ES_FILE_DAMAGED, "%s: asset.version is absent or no string like \"2.0\"", file->path);
    } else if (p->issue[0]) {
        result = es_fail(context, ES_FILE_DAMAGED, "%s: %s", file->path, p->issue);
    }
    es_release(context, p, sizeof *p);
    if (result != ES_OK) { es_gltf_document_free(context, document); }
    return result;
}

static void free_resources(es_context* context, es_gltf_resource* list, size_t count, size_t capacity)
{
    for (size_t i = 0; i < count; i++) {
        if (list[i].uri) { es_release(context, list[i].uri, list[i].uri_size + 1); }
    }
    es_release(context, list, capacity * sizeof *list);
}

void es_gltf_document_free(es_context* context, es_gltf_document* document)
{
    es_release(context, document->text, document->text_capacity);
    free_resources(context, document->buffers, document->buffer_count, document->buffer_capacity);
    free_resources(context, document->images, document->image_count, document->image_capacity);
    es_release(context, document->primitives, document->primitive_capacity * sizeof *document->primitives);
    *document = (es_gltf_document){0};
}
