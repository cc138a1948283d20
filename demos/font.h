/* A pixel font: what is over the picture is read on any background and at any whole scale. */
#ifndef EARTHSHINE_DEMO_FONT_H
#define EARTHSHINE_DEMO_FONT_H

#include <stdint.h>

enum { FONT_WIDTH = 6, FONT_HEIGHT = 9 }; /* of a cell, gaps included */

/* Eight rows of five, '#' is set, a blank between rows; NULL for a blank, a box for what the font lacks. */
const char* font_rows(uint32_t character);
/* The next character of a UTF-8 text, which is not at its end. */
uint32_t font_next(const char** text);
/* Characters of a UTF-8 text. */
int font_columns(const char* text);

#endif
