/* Text that grows: what JSON, CSV, SVG and HTML files are put together in before they are written at once. */
#include "demo.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

void demo_text_add(demo_text* text, const char* format, ...)
{
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    int length = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);
    if (length >= 0 && text->size + (size_t)length + 1 > text->capacity) {
        size_t capacity = (text->size + (size_t)length + 1) * 2;
        char* grown = realloc(text->bytes, capacity);
        if (grown) {
            text->bytes = grown;
            text->capacity = capacity;
        } else {
            length = -1;
        }
    }
    if (length < 0) {
        text->failed = true;
    } else {
        vsnprintf(text->bytes + text->size, text->capacity - text->size, format, again);
        text->size += (size_t)length;
    }
    va_end(again);
}

void demo_text_add_json_string(demo_text* text, const char* string)
{
    demo_text_add(text, "\"");
    for (const unsigned char* c = (const unsigned char*)string; *c; c++) {
        if (*c == '"' || *c == '\\')
            demo_text_add(text, "\\%c", *c);
        else if (*c < 0x20)
            demo_text_add(text, "\\u%04x", *c);
        else
            demo_text_add(text, "%c", *c);
    }
    demo_text_add(text, "\"");
}

void demo_text_free(demo_text* text)
{
    free(text->bytes);
    *text = (demo_text){0};
}
