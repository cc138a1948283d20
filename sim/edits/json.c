/* JSON text to a tree and back. */
#include "sim/edits/json.h"

#include <locale.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_DEPTH = 128, NUMBER_SIZE = 512 };

typedef struct parser { es_json* json; const char *at, *begin, *end; es_result failed; } parser;

static bool wrong(parser* p, const char* wanted)
{
    uint32_t line = 1;
    for (const char* c = p->begin; c < p->at; c++) line += *c == '\n';
    p->failed = es_fail(p->json->context, ES_FILE_DAMAGED, "%s: JSON, line %u, byte %zu: %s%s", p->json->label, line, (size_t)(p->at - p->begin), p->at == p->end ? "the text ends; " : "", wanted);
    return false;
}

static void skip_blanks(parser* p)
{
    while (p->at < p->end && memchr(" \t\r\n", *p->at, 4)) p->at++;
}

static int hexadecimal(const char* text)
{
    int value = 0;
    for (int i = 0; i < 4; i++) {
        char c = text[i];
        int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
        if (digit < 0) return -1;
        value = value * 16 + digit;
    }
    return value;
}

/* Bytes of the UTF-8 character at `c`, which a byte that continues none follows; 0 when it is none (RFC 3629). */
static size_t character_size(const unsigned char* c)
{
    if (c[0] < 0x80) return 1;
    const size_t size = c[0] >= 0xc2 && c[0] < 0xe0 ? 2 : c[0] >= 0xe0 && c[0] < 0xf0 ? 3 : c[0] >= 0xf0 && c[0] < 0xf5 ? 4 : 0;
    for (size_t i = 1; i < size; i++)
        if ((c[i] & 0xc0) != 0x80) return 0;
    if ((c[0] == 0xe0 && c[1] < 0xa0) || (c[0] == 0xed && c[1] > 0x9f) || (c[0] == 0xf0 && c[1] < 0x90) || (c[0] == 0xf4 && c[1] > 0x8f)) return 0;
    return size;
}

static bool read_string(parser* p)
{
    for (p->at++;; p->at++) {
        if (p->at == p->end) return wrong(p, "a string needs its closing '\"'");
        unsigned char c = (unsigned char)*p->at;
        if (c == '"') break;
        if (c < 32) return wrong(p, "a control character in a string must be escaped");
        if (c >= 0x80) {
            unsigned char bytes[4] = {0};
            memcpy(bytes, p->at, (size_t)(p->end - p->at) < 4 ? (size_t)(p->end - p->at) : 4);
            const size_t size = character_size(bytes);
            if (!size) return wrong(p, "a string must be UTF-8");
            p->at += size - 1;
        }
        if (c != '\\') continue;
        if (++p->at == p->end) return wrong(p, "an escape is incomplete");
        if (*p->at == 'u') {
            if (p->end - p->at < 5 || hexadecimal(p->at + 1) < 0) return wrong(p, "\\u needs four hexadecimal digits");
            p->at += 4;
        } else if (!memchr("\"\\/bfnrt", *p->at, 8)) {
            return wrong(p, "no such escape");
        }
    }
    p->at++;
    return true;
}

static bool digits(parser* p)
{
    const char* begin = p->at;
    while (p->at < p->end && *p->at >= '0' && *p->at <= '9') p->at++;
    return p->at > begin;
}

static bool read_number(parser* p)
{
    if (*p->at == '-') p->at++;
    const char* whole = p->at;
    if (!digits(p)) return wrong(p, "a value is needed");
    if (*whole == '0' && p->at - whole > 1) return wrong(p, "a number must not begin with 0");
    if (p->at < p->end && *p->at == '.' && (p->at++, !digits(p))) return wrong(p, "a fraction needs digits");
    if (p->at < p->end && (*p->at == 'e' || *p->at == 'E')) {
        p->at++;
        if (p->at < p->end && (*p->at == '+' || *p->at == '-')) p->at++;
        if (!digits(p)) return wrong(p, "an exponent needs digits");
    }
    return true;
}

static bool read_word(parser* p, const char* word)
{
    size_t size = strlen(word);
    if ((size_t)(p->end - p->at) < size || memcmp(p->at, word, size) != 0) return wrong(p, "a value is needed");
    p->at += size;
    return true;
}

static bool read_value(parser* p, uint32_t depth, uint32_t* number);

/* Elements or members up to the closing bracket. */
static bool read_list(parser* p, uint32_t depth, uint32_t own, bool object)
{
    es_json* json = p->json;
    const char close = object ? '}' : ']';
    uint32_t last = 0;
    if (depth == MAX_DEPTH) return wrong(p, "values are nested too deeply");
    p->at++;
    for (skip_blanks(p); p->at == p->end || *p->at != close || last; skip_blanks(p)) {
        if (last) {
            if (p->at < p->end && *p->at == close) break;
            if (p->at == p->end || *p->at != ',') return wrong(p, object ? "',' or '}' is needed" : "',' or ']' is needed");
            p->at++;
            skip_blanks(p);
        }
        uint32_t key[2] = {0, 0}, child;
        if (object) {
            if (p->at == p->end || *p->at != '"') return wrong(p, "a member's name is needed");
            key[0] = (uint32_t)(p->at + 1 - p->begin);
            if (!read_string(p)) return false;
            key[1] = (uint32_t)(p->at - 1 - p->begin);
            skip_blanks(p);
            if (p->at == p->end || *p->at != ':') return wrong(p, "':' is needed");
            p->at++;
            skip_blanks(p);
        }
        if (!read_value(p, depth + 1, &child)) return false;
        json->values[child].key_begin = key[0];
        json->values[child].key_end = key[1];
        if (last) json->values[last].next = child;
        else json->values[own].first = child;
        json->values[own].count++;
        last = child;
    }
    p->at++;
    return true;
}

static bool read_value(parser* p, uint32_t depth, uint32_t* number)
{
    es_json* json = p->json;
    if (p->at == p->end) return wrong(p, "a value is needed");
    if (!es_grow(json->context, (void**)&json->values, &json->capacity, json->count, json->count + 1, sizeof *json->values)) {
        p->failed = es_context_last_result(json->context);
        return false;
    }
    const uint32_t own = *number = (uint32_t)json->count++;
    json->values[own] = (es_json_value){.begin = (uint32_t)(p->at - p->begin)};
    bool good;
    es_json_type type;
    switch (*p->at) {
    case '{': type = ES_JSON_OBJECT, good = read_list(p, depth, own, true); break;
    case '[': type = ES_JSON_ARRAY, good = read_list(p, depth, own, false); break;
    case '"': type = ES_JSON_STRING, good = read_string(p); break;
    case 't': type = ES_JSON_BOOLEAN, good = read_word(p, "true"); break;
    case 'f': type = ES_JSON_BOOLEAN, good = read_word(p, "false"); break;
    case 'n': type = ES_JSON_NULL, good = read_word(p, "null"); break;
    default: type = ES_JSON_NUMBER, good = read_number(p);
    }
    json->values[own].type = type;
    json->values[own].end = (uint32_t)(p->at - p->begin);
    return good;
}

es_result es_json_parse(es_context* context, const char* label, const char* text, size_t size, es_json* json)
{
    *json = (es_json){.context = context, .label = label, .text = text, .size = size};
    if (size >= UINT32_MAX) return es_fail(context, ES_FILE_UNSUPPORTED, "%s: more than 4 GB of text", label);
    parser p = {.json = json, .at = text, .begin = text, .end = text + size};
    if (size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0) p.at += 3;
    uint32_t root;
    skip_blanks(&p);
    bool good = read_value(&p, 0, &root);
    if (good) {
        skip_blanks(&p);
        if (p.at != p.end) good = wrong(&p, "nothing more is expected");
    }
    if (good) return ES_OK;
    es_json_free(json);
    return p.failed;
}

void es_json_free(es_json* json)
{
    es_release(json->context, json->values, json->capacity * sizeof *json->values);
    json->values = NULL;
    json->count = json->capacity = 0;
}

/* ---- reading -------------------------------------------------------------------------------------------------------------- */

static size_t put_code(char* out, uint32_t code)
{
    if (code < 0x80) {
        out[0] = (char)code;
        return 1;
    }
    static const uint32_t leads[4] = {0, 0xc0, 0xe0, 0xf0};
    const int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    out[0] = (char)(leads[more] | code >> 6 * more);
    for (int i = 1; i <= more; i++) out[i] = (char)(0x80 | (code >> 6 * (more - i) & 0x3f));
    return (size_t)more + 1;
}

/* Of text between quotes that the parser has accepted; false when it does not fit with a zero after it, or has a zero in it. */
static bool unescape(const char* text, size_t size, char* out, size_t room)
{
    size_t length = 0;
    for (size_t i = 0; i < size; i++) {
        char bytes[4] = {text[i]};
        size_t count = 1;
        if (text[i] == '\\') {
            char c = text[++i];
            static const char from[] = "bfnrt", to[] = "\b\f\n\r\t";
            const char* known = memchr(from, c, 5);
            bytes[0] = known ? to[known - from] : c;
            if (c == 'u') {
                uint32_t code = (uint32_t)hexadecimal(text + i + 1);
                i += 4;
                if (code >= 0xd800 && code < 0xdc00 && size - i > 6 && text[i + 1] == '\\' && text[i + 2] == 'u') {
                    uint32_t low = (uint32_t)hexadecimal(text + i + 3);
                    if (low >= 0xdc00 && low < 0xe000) {
                        code = 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
                        i += 6;
                    }
                }
                count = put_code(bytes, code >= 0xd800 && code < 0xe000 ? 0xfffd : code);
            }
        }
        if (length + count >= room || !bytes[0]) {
            out[length] = 0;
            return false;
        }
        memcpy(out + length, bytes, count);
        length += count;
    }
    out[length] = 0;
    return true;
}

static bool named(const es_json* json, const es_json_value* value, const char* name)
{
    const size_t size = value->key_end - value->key_begin, wanted = strlen(name);
    const char* key = json->text + value->key_begin;
    if (size == wanted && memcmp(key, name, size) == 0) return true;
    char text[64];
    return size > wanted && memchr(key, '\\', size) && unescape(key, size, text, sizeof text) && strcmp(text, name) == 0;
}

uint32_t es_json_member(const es_json* json, uint32_t object, const char* name)
{
    uint32_t found = 0;
    if (json->values[object].type != ES_JSON_OBJECT) return 0;
    for (uint32_t i = json->values[object].first; i; i = json->values[i].next)
        if (named(json, &json->values[i], name)) found = i;
    return found;
}

uint32_t es_json_element(const es_json* json, uint32_t array, uint32_t index)
{
    if (json->values[array].type != ES_JSON_ARRAY) return 0;
    uint32_t i = json->values[array].first;
    for (; i && index; index--) i = json->values[i].next;
    return i;
}

bool es_json_number(const es_json* json, uint32_t value, double* number)
{
    const es_json_value* v = &json->values[value];
    char text[NUMBER_SIZE];
    const size_t size = v->end - v->begin;
    if (v->type != ES_JSON_NUMBER || size >= sizeof text / 2) return false;
    /* the program's locale decides what stands for the point */
    const char* point = localeconv()->decimal_point;
    size_t length = 0;
    for (size_t i = 0; i < size; i++) {
        char c = json->text[v->begin + i];
        if (c != '.') text[length++] = c;
        else
            for (const char* each = point; *each && length + 1 < sizeof text; each++) text[length++] = *each;
    }
    text[length] = 0;
    *number = strtod(text, NULL);
    return *number >= -1.7976931348623157e308 && *number <= 1.7976931348623157e308;
}

bool es_json_boolean(const es_json* json, uint32_t value, bool* boolean)
{
    if (json->values[value].type != ES_JSON_BOOLEAN) return false;
    *boolean = json->text[json->values[value].begin] == 't';
    return true;
}

bool es_json_string(const es_json* json, uint32_t value, char* out, size_t size)
{
    const es_json_value* v = &json->values[value];
    return v->type == ES_JSON_STRING && unescape(json->text + v->begin + 1, v->end - v->begin - 2, out, size);
}

bool es_json_key(const es_json* json, uint32_t member, char* out, size_t size)
{
    const es_json_value* v = &json->values[member];
    return unescape(json->text + v->key_begin, v->key_end - v->key_begin, out, size);
}

/* ---- writing -------------------------------------------------------------------------------------------------------------- */

void es_json_put(es_json_text* text, const char* bytes, size_t size)
{
    if (text->failed || !size) return;
    if (!es_grow(text->context, (void**)&text->bytes, &text->capacity, text->size, text->size + size, 1)) {
        text->failed = true;
        return;
    }
    memcpy(text->bytes + text->size, bytes, size);
    text->size += size;
}

void es_json_write(es_json_text* text, const char* format, ...)
{
    char buffer[512];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(buffer, sizeof buffer, format, arguments);
    va_end(arguments);
    if (length > 0) es_json_put(text, buffer, (size_t)length < sizeof buffer ? (size_t)length : sizeof buffer - 1);
}

void es_json_write_string(es_json_text* text, const char* string)
{
    es_json_put(text, "\"", 1);
    for (const char* c = string; *c;) {
        const size_t size = character_size((const unsigned char*)c);
        if ((unsigned char)*c < 32) es_json_write(text, "\\u%04x", (unsigned)*c);
        else if (*c == '"' || *c == '\\') es_json_write(text, "\\%c", *c);
        else es_json_put(text, size ? c : "?", size ? size : 1);
        c += size ? size : 1;
    }
    es_json_put(text, "\"", 1);
}

static void write_number(es_json_text* text, const char* digits)
{
    for (const char* c = digits; *c; c++) {
        if (strchr("+-0123456789eE", *c)) {
            es_json_put(text, c, 1);
            continue;
        }
        es_json_put(text, ".", 1); /* whatever the locale has for it */
        while (c[1] && !strchr("+-0123456789eE", c[1])) c++;
    }
}

/* As few digits as do. */
void es_json_write_double(es_json_text* text, double number)
{
    char digits[64];
    for (int precision = 15; precision <= 17; precision++) {
        snprintf(digits, sizeof digits, "%.*g", precision, number);
        if (precision == 17 || strtod(digits, NULL) == number) break;
    }
    write_number(text, digits);
}

void es_json_write_float(es_json_text* text, float number)
{
    char digits[64];
    for (int precision = 6; precision <= 9; precision++) {
        snprintf(digits, sizeof digits, "%.*g", precision, (double)number);
        if (precision == 9 || (float)strtod(digits, NULL) == number) break;
    }
    write_number(text, digits);
}

void es_json_text_free(es_json_text* text)
{
    es_release(text->context, text->bytes, text->capacity);
    text->bytes = NULL;
    text->size = text->capacity = 0;
}
