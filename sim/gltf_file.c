/* A glTF file's container and the resources it names.
 *
 * GLB: a 12-byte header (magic, version, length) and chunks of length, type and data (glTF 2.0 §4.4); anything else must be
 * JSON text. Resources are data URIs (RFC 2397, base64 of RFC 4648) or percent-encoded relative paths (RFC 3986) that stay
 * in the file's folder: a model from elsewhere has no business reading other files of its user. */
#include "sim/gltf_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

enum { GLB_MAGIC = 0x46546c67, GLB_JSON = 0x4e4f534a, GLB_BIN = 0x004e4942 };

const char* es_gltf_printable(const char* text, size_t size, char buffer[ES_GLTF_PRINTABLE])
{
    size_t length = 0;
    for (size_t i = 0; i < size; i++) {
        if (length == ES_GLTF_PRINTABLE - 4) {
            memcpy(buffer + length, "...", 4);
            return buffer;
        }
        unsigned char c = (unsigned char)text[i];
        buffer[length++] = c < 32 || c == 127 ? '?' : (char)c;
    }
    buffer[length] = 0;
    return buffer;
}

/* Reads the first `needed` bytes of a regular file, or all when 0. `where` precedes the message. */
static es_result read_bytes(es_context* context, const char* path, const char* where, size_t needed, uint8_t** bytes, size_t* size)
{
    *bytes = NULL;
    *size = 0;
    struct stat status;
    if (stat(path, &status) != 0) {
        return es_fail(context, ES_FILE_NOT_FOUND, "%s: '%s' cannot be opened: %s", where, path, strerror(errno));
    }
    if (!S_ISREG(status.st_mode)) {
        return es_fail(context, ES_FILE_TYPE, "%s: '%s' is %s, a regular file is needed", where, path,
            S_ISDIR(status.st_mode) ? "a folder" : "a device or pipe");
    }
    if (status.st_size == 0) { return es_fail(context, ES_FILE_EMPTY, "%s: '%s' is empty", where, path); }
    uint64_t length = (uint64_t)status.st_size;
    if (needed > 0 && length < needed) {
        return es_fail(context, ES_FILE_DAMAGED, "%s: '%s' has %llu bytes, byteLength says %zu", where, path,
            (unsigned long long)length, needed);
    }
    if (needed > 0) { length = needed; }
    if (length > UINT32_MAX) {
        return es_fail(context, ES_FILE_UNSUPPORTED, "%s: '%s' has %llu bytes, at most 4294967295 are read", where, path,
            (unsigned long long)length);
    }
    FILE* stream = fopen(path, "rb");
    if (!stream) {
        return es_fail(context, ES_FILE_NOT_FOUND, "%s: '%s' cannot be opened: %s", where, path, strerror(errno));
    }
    uint8_t* memory = es_allocate(context, (size_t)length);
    if (!memory) {
        fclose(stream);
        return es_context_last_result(context);
    }
    size_t got = fread(memory, 1, (size_t)length, stream);
    fclose(stream);
    if (got != length) {
        es_release(context, memory, (size_t)length);
        return es_fail(context, ES_FILE_READ, "%s: reading '%s' ended after %zu of %llu bytes", where, path, got,
            (unsigned long long)length);
    }
    *bytes = memory;
    *size = (size_t)length;
    return ES_OK;
}

static uint32_t little_endian(const uint8_t* bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static es_result open_glb(es_gltf_file* file)
{
    es_context* context = file->context;
    const uint8_t* bytes = file->bytes;
    if (file->size < 12) {
        return es_fail(context, ES_FILE_DAMAGED, "%s: ends in the GLB header, after %zu of 12 bytes", file->path, file->size);
    }
    uint32_t version = little_endian(bytes + 4), length = little_endian(bytes + 8);
    if (version != 2) {
        return es_fail(context, ES_FILE_UNSUPPORTED, "%s: is GLB version %u, version 2 (glTF 2.0) is read", file->path, version);
    }
    if (length != file->size) {
        return es_fail(context, ES_FILE_DAMAGED, "%s: the GLB header says %u bytes, the file has %zu%s", file->path, length,
            file->size, length > file->size ? ": it was cut short" : "");
    }
    size_t offset = 12;
    for (uint32_t chunk = 0; offset < file->size; chunk++) {
        if (file->size - offset < 8) {
            return es_fail(context, ES_FILE_DAMAGED, "%s: ends in the header of GLB chunk %u", file->path, chunk);
        }
        uint32_t chunk_length = little_endian(bytes + offset), type = little_endian(bytes + offset + 4);
        offset += 8;
        if (chunk_length > file->size - offset) {
            return es_fail(context, ES_FILE_DAMAGED, "%s: GLB chunk %u says %u bytes, %zu are left in the file", file->path, chunk,
                chunk_length, file->size - offset);
        }
        if (chunk == 0 && type != GLB_JSON) {
            return es_fail(context, ES_FILE_DAMAGED, "%s: the first GLB chunk is not JSON", file->path);
        }
        if (chunk == 0) {
            file->json = (const char*)bytes + offset;
            file->json_size = chunk_length;
        } else if (type == GLB_BIN && !file->binary) {
            file->binary = bytes + offset;
            file->binary_size = chunk_length;
        }
        offset += chunk_length;
    }
    if (!file->json) { return es_fail(context, ES_FILE_DAMAGED, "%s: has no GLB chunk, a JSON chunk is needed", file->path); }
    /* the standard pads with spaces; zeros are met too */
    while (file->json_size > 0 && file->json[file->json_size - 1] == 0) { file->json_size--; }
    return ES_OK;
}

es_result es_gltf_file_open(es_context* context, const char* path, es_gltf_file* file)
{
    *file = (es_gltf_file){.context = context, .path = path};
    es_result result = read_bytes(context, path, "glTF file", 0, &file->bytes, &file->size);
    if (result != ES_OK) { return result; }
    if (file->size >= 4 && little_endian(file->bytes) == GLB_MAGIC) {
        result = open_glb(file);
        if (result != ES_OK) { es_gltf_file_close(file); }
        return result;
    }
    size_t start = file->size >= 3 && memcmp(file->bytes, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
    size_t first = start;
    while (first < file->size && memchr(" \t\r\n", file->bytes[first], 4)) { first++; }
    if (first == file->size || file->bytes[first] != '{') {
        es_gltf_file_close(file);
        return es_fail(context, ES_FILE_TYPE, "%s: is neither glTF text (it would begin with '{') nor GLB (with 'glTF')", path);
    }
    file->json = (const char*)file->bytes + start;
    file->json_size = file->size - start;
    return ES_OK;
}

void es_gltf_file_close(es_gltf_file* file)
{
    if (file->bytes) { es_release(file->context, file->bytes, file->size); }
    *file = (es_gltf_file){0};
}

static int hexadecimal(char c)
{
    if (c >= '0' && c <= '9') { return c - '0'; }
    if (c >= 'a' && c <= 'f') { return c - 'a' + 10; }
    if (c >= 'A' && c <= 'F') { return c - 'A' + 10; }
    return -1;
}

/* Percent-decodes; -1 when a '%' is not followed by two digits. */
static int64_t percent_decode(const char* text, size_t size, char* out)
{
    size_t length = 0;
    for (size_t i = 0; i < size; i++) {
        if (text[i] != '%') {
            out[length++] = text[i];
            continue;
        }
        int high = i + 1 < size ? hexadecimal(text[i + 1]) : -1, low = i + 2 < size ? hexadecimal(text[i + 2]) : -1;
        if (high < 0 || low < 0) { return -1; }
        out[length++] = (char)(high * 16 + low);
        i += 2;
    }
    return (int64_t)length;
}

static int base64_value(char c)
{
    if (c >= 'A' && c <= 'Z') { return c - 'A'; }
    if (c >= 'a' && c <= 'z') { return c - 'a' + 26; }
    if (c >= '0' && c <= '9') { return c - '0' + 52; }
    if (c == '+' || c == '-') { return 62; } /* '-' and '_': the alphabet for URLs */
    if (c == '/' || c == '_') { return 63; }
    return -1;
}

static es_result load_data_uri(
    const es_gltf_file* file, const char* where, const char* uri, size_t uri_size, size_t needed, uint8_t** bytes, size_t* size)
{
    es_context* context = file->context;
    const char* comma = memchr(uri, ',', uri_size);
    if (!comma) { return es_fail(context, ES_FILE_DAMAGED, "%s: %s: the data URI has no ','", file->path, where); }
    size_t head = (size_t)(comma - uri), count = uri_size - head - 1;
    const char* text = comma + 1;
    bool base64 = head >= 7 && memcmp(comma - 7, ";base64", 7) == 0;
    size_t have = count;
    if (base64) {
        while (count > 0 && text[count - 1] == '=') { count--; }
        if (count % 4 == 1) {
            return es_fail(context, ES_FILE_DAMAGED, "%s: %s: the base64 text has a length that no data gives", file->path, where);
        }
        have = count / 4 * 3 + (count % 4 ? count % 4 - 1 : 0);
    }
    if (have == 0) { return es_fail(context, ES_FILE_EMPTY, "%s: %s: the data URI is empty", file->path, where); }
    if (base64 && have < needed) {
        return es_fail(context, ES_FILE_DAMAGED, "%s: %s: the data URI has %zu bytes, byteLength says %zu", file->path, where, have,
            needed);
    }
    uint8_t* memory = es_allocate(context, have);
    if (!memory) { return es_context_last_result(context); }
    size_t length = 0;
    if (base64) {
        uint32_t bits = 0;
        for (size_t i = 0; i < count; i++) {
            int value = base64_value(text[i]);
            if (value < 0) {
                es_release(context, memory, have);
                return es_fail(context, ES_FILE_DAMAGED, "%s: %s: character %zu of the base64 text is none of its alphabet",
                    file->path, where, i);
            }
            bits = (bits << 6 | (uint32_t)value) & 0xffffff;
            switch (i % 4) {
            case 1: memory[length++] = (uint8_t)(bits >> 4); break;
            case 2: memory[length++] = (uint8_t)(bits >> 2); break;
            case 3: memory[length++] = (uint8_t)bits; break;
            default: break;
            }
        }
    } else {
        int64_t decoded = percent_decode(text, count, (char*)memory);
        if (decoded < 0 || (size_t)decoded < needed) {
            es_release(context, memory, have);
            return es_fail(context, ES_FILE_DAMAGED, "%s: %s: the data URI is too short or has a broken %% sequence", file->path, where);
        }
        length = (size_t)decoded;
    }
    size_t kept = needed > 0 ? needed : length;
    if (kept != have) {
        uint8_t* fitted = es_allocate(context, kept);
        if (fitted) { memcpy(fitted, memory, kept); }
        es_release(context, memory, have);
        if (!fitted) { return es_context_last_result(context); }
        memory = fitted;
    }
    *bytes = memory;
    *size = kept;
    return ES_OK;
}

/* True when some ".." of the path leads out of the folder it starts in. */
static bool leaves_folder(const char* path)
{
    int64_t depth = 0;
    while (*path) {
        size_t length = strcspn(path, "/\\");
        if (length == 2 && path[0] == '.' && path[1] == '.') {
            if (--depth < 0) { return true; }
        } else if (length > 0 && !(length == 1 && path[0] == '.')) {
            depth++;
        }
        path += length + (path[length] ? 1 : 0);
    }
    return false;
}

static bool has_scheme(const char* path)
{
    size_t i = 0;
    while ((path[i] >= 'a' && path[i] <= 'z') || (path[i] >= 'A' && path[i] <= 'Z') ||
           (i > 0 && ((path[i] >= '0' && path[i] <= '9') || path[i] == '+' || path[i] == '.' || path[i] == '-'))) {
        i++;
    }
    return i > 0 && path[i] == ':';
}

es_result es_gltf_resource_load(
    const es_gltf_file* file, const char* where, const char* uri, size_t uri_size, size_t needed, uint8_t** bytes, size_t* size)
{
    es_context* context = file->context;
    char shown[ES_GLTF_PRINTABLE];
    *bytes = NULL;
    *size = 0;
    if (uri_size >= 5 && memcmp(uri, "data:", 5) == 0) { return load_data_uri(file, where, uri, uri_size, needed, bytes, size); }
    es_gltf_printable(uri, uri_size, shown);
    if (uri_size == 0 || uri_size > 4000) {
        return es_fail(context, ES_FILE_DAMAGED, "%s: %s: '%s' is no path of 1 to 4000 bytes", file->path, where, shown);
    }
    const char* slash = strrchr(file->path, '/');
    size_t folder = slash ? (size_t)(slash - file->path) + 1 : 0;
    size_t capacity = folder + uri_size + 1;
    char* path = es_allocate(context, capacity);
    if (!path) { return es_context_last_result(context); }
    memcpy(path, file->path, folder);
    int64_t length = percent_decode(uri, uri_size, path + folder);
    char* name = path + folder;
    es_result result = ES_OK;
    if (length < 0 || memchr(name, 0, (size_t)length)) {
        result = es_fail(context, ES_FILE_DAMAGED, "%s: %s: '%s' has a broken %% sequence", file->path, where, shown);
    } else {
        name[length] = 0;
        if (name[0] == '/' || name[0] == '\\' || has_scheme(name) || leaves_folder(name)) {
            result = es_fail(context, ES_FILE_UNSUPPORTED,
                "%s: %s: '%s' leads out of the file's folder, only data URIs and relative paths inside of it are read", file->path,
                where, shown);
        } else {
            char place[192];
            snprintf(place, sizeof place, "%.100s: %.80s", file->path, where);
            result = read_bytes(context, path, place, needed, bytes, size);
        }
    }
    es_release(context, path, capacity);
    return result;
}
