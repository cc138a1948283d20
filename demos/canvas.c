/* Drawing into a picture in memory. */
#include "canvas.h"
#include "font.h"

#include <limits.h>
#include <stdlib.h>

bool canvas_inside(canvas_rect rect, int x, int y)
{
    return x >= rect.x && y >= rect.y && x < rect.x + rect.width && y < rect.y + rect.height;
}

canvas_rect canvas_intersect(canvas_rect a, canvas_rect b)
{
    int x0 = a.x > b.x ? a.x : b.x, y0 = a.y > b.y ? a.y : b.y;
    int x1 = a.x + a.width < b.x + b.width ? a.x + a.width : b.x + b.width;
    int y1 = a.y + a.height < b.y + b.height ? a.y + a.height : b.y + b.height;
    return (canvas_rect){x0, y0, x1 > x0 ? x1 - x0 : 0, y1 > y0 ? y1 - y0 : 0};
}

void canvas_clip_all(demo_canvas* canvas) { canvas->clip = (canvas_rect){0, 0, (int)canvas->width, (int)canvas->height}; }

canvas_rect canvas_narrow_clip(demo_canvas* canvas, canvas_rect rect)
{
    canvas_rect former = canvas->clip;
    canvas->clip = canvas_intersect(former, rect);
    return former;
}

static uint32_t* row_of(const demo_canvas* canvas, int y) { return canvas->pixels + (size_t)y * canvas->width; }

void canvas_fill(demo_canvas* canvas, canvas_rect rect, uint32_t colour)
{
    canvas_rect r = canvas_intersect(canvas->clip, rect);
    for (int y = r.y; y < r.y + r.height; y++) {
        uint32_t* row = row_of(canvas, y);
        for (int x = r.x; x < r.x + r.width; x++) row[x] = colour;
    }
}

/* Red and blue together, green alone: each product stays within its 16 bits. */
void canvas_blend(demo_canvas* canvas, canvas_rect rect, uint32_t colour, uint32_t share)
{
    canvas_rect r = canvas_intersect(canvas->clip, rect);
    uint32_t rest = 256 - share, red_blue = (colour & 0xff00ff) * share, green = (colour & 0x00ff00) * share;
    for (int y = r.y; y < r.y + r.height; y++) {
        uint32_t* row = row_of(canvas, y);
        for (int x = r.x; x < r.x + r.width; x++)
            row[x] = ((((row[x] & 0xff00ff) * rest + red_blue) >> 8) & 0xff00ff) | ((((row[x] & 0x00ff00) * rest + green) >> 8) & 0x00ff00);
    }
}

void canvas_frame(demo_canvas* canvas, canvas_rect rect, int thickness, uint32_t colour)
{
    canvas_fill(canvas, (canvas_rect){rect.x, rect.y, rect.width, thickness}, colour);
    canvas_fill(canvas, (canvas_rect){rect.x, rect.y + rect.height - thickness, rect.width, thickness}, colour);
    canvas_fill(canvas, (canvas_rect){rect.x, rect.y, thickness, rect.height}, colour);
    canvas_fill(canvas, (canvas_rect){rect.x + rect.width - thickness, rect.y, thickness, rect.height}, colour);
}

void canvas_dot(demo_canvas* canvas, int x, int y, int size, uint32_t colour)
{
    canvas_fill(canvas, (canvas_rect){x, y, size, size}, colour);
}

void canvas_line(demo_canvas* canvas, int x0, int y0, int x1, int y1, int size, uint32_t colour)
{
    int steps = abs(x1 - x0) > abs(y1 - y0) ? abs(x1 - x0) : abs(y1 - y0);
    for (int i = 0; i <= steps; i++)
        canvas_dot(canvas, steps ? x0 + (x1 - x0) * i / steps : x0, steps ? y0 + (y1 - y0) * i / steps : y0, size, colour);
}

static void draw_character(demo_canvas* canvas, int x, int y, int scale, uint32_t colour, uint32_t character)
{
    const char* rows = font_rows(character);
    for (int r = 0; rows && r < 8; r++)
        for (int c = 0; c < 5; c++) {
            int run = 0;
            while (c + run < 5 && rows[6 * r + c + run] == '#') run++;
            if (run) canvas_fill(canvas, (canvas_rect){x + c * scale, y + r * scale, run * scale, scale}, colour);
            c += run;
        }
}

void canvas_text(demo_canvas* canvas, int x, int y, int scale, uint32_t colour, const char* text, int columns)
{
    int total = font_columns(text);
    for (int i = 0; *text && i < columns; i++, x += FONT_WIDTH * scale) {
        uint32_t character = font_next(&text);
        draw_character(canvas, x, y, scale, colour, total > columns && i == columns - 1 ? 0x2026 : character);
    }
}

void canvas_label(demo_canvas* canvas, int x, int y, int scale, uint32_t colour, const char* text)
{
    canvas_blend(canvas, (canvas_rect){x - 2 * scale, y - scale, (font_columns(text) * FONT_WIDTH + 3) * scale, (FONT_HEIGHT + 1) * scale}, 0, 192);
    canvas_text(canvas, x, y, scale, colour, text, INT_MAX);
}
