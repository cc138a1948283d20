/* Stacked bars, lying, one below the other; negative parts to the left of zero. */
#include "plot.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

plot_bar* plot_add_bar(plot_bars* plot, const char* name_format, ...)
{
    if (plot->bar_count == plot->capacity) {
        size_t capacity = plot->capacity ? 2 * plot->capacity : 16;
        plot_bar* grown = realloc(plot->bars, capacity * sizeof *grown);
        if (!grown) {
            plot->failed = true;
            return NULL;
        }
        plot->bars = grown;
        plot->capacity = capacity;
    }
    plot_bar* bar = &plot->bars[plot->bar_count++];
    *bar = (plot_bar){.total = NAN};
    for (int k = 0; k < PLOT_MAX_PARTS; k++) bar->parts[k] = NAN;
    va_list arguments;
    va_start(arguments, name_format);
    vsnprintf(bar->name, sizeof bar->name, name_format, arguments);
    va_end(arguments);
    return bar;
}

void plot_bars_free(plot_bars* plot)
{
    free(plot->bars);
    plot->bars = NULL;
    plot->bar_count = plot->capacity = 0;
}

enum { WIDTH = 880, RIGHT = 64, BAR = 26, STEP = 38, FONT = 12, LEGEND_ROW = 20, LEGEND_TOP = 18 };

/* Lightness alternates through the table, so that neighbours differ without colour too; parts beyond it repeat it, hatched. */
static const char* const fills[PLOT_COLOURS] = {"#0072b2", "#e69f00", "#009e73", "#e3a5c6", "#d55e00", "#9fd3f0", "#5b3a9e", "#bdbdbd"};
static const bool is_dark[PLOT_COLOURS] = {true, false, true, false, true, false, true, false};

static bool is_drawn(double part) { return isfinite(part) && part != 0; }

static double legend_width(const plot_bars* plot, size_t k) { return 18 + plot_text_width(plot->part_names[k], FONT) * 1.06 + 16; }

static bool is_used(const plot_bars* plot, size_t part)
{
    for (size_t i = 0; i < plot->bar_count; i++)
        if (is_drawn(plot->bars[i].parts[part])) return true;
    return false;
}

static void draw_swatch(demo_text* text, size_t part, double x, double y, double width, double height)
{
    demo_text_add(text, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\" stroke=\"#fff\"", x, y, width, height, fills[part % PLOT_COLOURS]);
}

static void hatch(demo_text* text, size_t part, double x, double y, double width, double height)
{
    if (part < PLOT_COLOURS) return;
    demo_text_add(text, "<path d=\"");
    for (double at = -height; at < width; at += 6) {
        double begin = fmax(at, 0), end = fmin(at + height, width);
        if (end > begin) demo_text_add(text, "M%.1f %.1fL%.1f %.1f", x + begin, y + height - (begin - at), x + end, y + height - (end - at));
    }
    demo_text_add(text, "\" stroke=\"#fff\" stroke-opacity=\"0.7\" pointer-events=\"none\"/>");
}

/* The parts' names in the order of the stack; the height they take. */
static double draw_legend(demo_text* text, const plot_bars* plot, double left, bool draw)
{
    double x = left, y = LEGEND_TOP;
    for (size_t k = 0; k <= plot->part_count; k++) {
        bool total = k == plot->part_count;
        if (total ? !plot->total_name : !is_used(plot, k)) continue;
        double w = total ? 18 + plot_text_width(plot->total_name, FONT) : legend_width(plot, k);
        if (x + w > WIDTH - 8 && x > left) x = left, y += LEGEND_ROW;
        if (draw) {
            if (total) demo_text_add(text, "<path d=\"M%.1f %.1fl5 5l-5 5l-5 -5z\" fill=\"#111\" stroke=\"#fff\"/>", x + 6, y - 9);
            else {
                draw_swatch(text, k, x, y - 10, 12, 12);
                demo_text_add(text, "/>");
                hatch(text, k, x, y - 10, 12, 12);
            }
            demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" fill=\"#333\">", x + 18, y);
            plot_add_escaped(text, total ? plot->total_name : plot->part_names[k]);
            demo_text_add(text, "</text>\n");
        }
        x += w;
    }
    return y + 14;
}

static void draw_part(demo_text* text, const plot_bars* plot, const plot_bar* bar, size_t k, double x0, double x1, double y)
{
    char figure[32];
    plot_format_value(figure, bar->parts[k]);
    double left = fmin(x0, x1), width = fabs(x1 - x0);
    draw_swatch(text, k, left, y, width, BAR);
    demo_text_add(text, "><title>");
    plot_add_escaped(text, bar->name);
    demo_text_add(text, "\n");
    plot_add_escaped(text, plot->part_names[k]);
    demo_text_add(text, ": %s%s", figure, bar->note[0] ? "\n" : "");
    plot_add_escaped(text, bar->note);
    demo_text_add(text, "</title></rect>");
    hatch(text, k, left, y, width, BAR);
    double text_width = plot_text_width(figure, 11) + 8, name_width = plot_text_width(plot->part_names[k], 11) + 6;
    if (width > text_width && k < PLOT_COLOURS) {
        demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\" font-size=\"11\" fill=\"%s\" pointer-events=\"none\">", left + width / 2, y + BAR / 2 + 4,
            is_dark[k] ? "#fff" : "#111");
        if (width > text_width + name_width) {
            plot_add_escaped(text, plot->part_names[k]);
            demo_text_add(text, " ");
        }
        demo_text_add(text, "%s</text>", figure);
    }
    demo_text_add(text, "\n");
}

static void draw_bar(demo_text* text, const plot_bars* plot, const plot_bar* bar, const plot_axis* axis, double y)
{
    double up = 0, down = 0, sum = 0;
    demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\" fill=\"#333\">", axis->begin - 10, y + BAR / 2 + 4);
    plot_add_escaped(text, bar->name);
    demo_text_add(text, "</text>\n");
    for (size_t k = 0; k < plot->part_count; k++) {
        if (!is_drawn(bar->parts[k])) continue;
        double* at = bar->parts[k] < 0 ? &down : &up;
        draw_part(text, plot, bar, k, plot_position(axis, *at), plot_position(axis, *at + bar->parts[k]), y);
        *at += bar->parts[k];
        sum += bar->parts[k];
    }
    char figure[32];
    double end = plot_position(axis, up);
    plot_format_value(figure, isfinite(bar->total) ? bar->total : sum);
    if (isfinite(bar->total)) {
        double x = plot_position(axis, bar->total);
        demo_text_add(text, "<path d=\"M%.1f %.1fl7 7l-7 7l-7 -7z\" fill=\"#111\" stroke=\"#fff\" stroke-width=\"1.5\"><title>%s: %s</title></path>", x, y + BAR / 2 - 7,
            plot->total_name ? plot->total_name : "total", figure);
        end = fmax(end, x + 7);
    }
    demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" fill=\"#111\" font-weight=\"600\">%s</text>\n", end + 6, y + BAR / 2 + 4, figure);
}

static plot_axis make_axis(const plot_bars* plot, double left)
{
    double low = 0, high = 0;
    for (size_t i = 0; i < plot->bar_count; i++) {
        double up = 0, down = 0;
        for (size_t k = 0; k < plot->part_count; k++) {
            double part = plot->bars[i].parts[k];
            if (is_drawn(part)) *(part < 0 ? &down : &up) += part;
        }
        if (isfinite(plot->bars[i].total)) up = fmax(up, plot->bars[i].total), down = fmin(down, plot->bars[i].total);
        low = fmin(low, down), high = fmax(high, up);
    }
    return plot_make_axis(false, low, high, left, WIDTH - RIGHT);
}

void plot_bars_add_svg(demo_text* text, const plot_bars* plot)
{
    double left = 40;
    for (size_t i = 0; i < plot->bar_count; i++) left = fmax(left, plot_text_width(plot->bars[i].name, FONT) * 1.06 + 18);
    plot_axis axis = make_axis(plot, left);
    double top = draw_legend(text, plot, left, false), bottom = top + (double)plot->bar_count * STEP;
    plot_open_svg(text, WIDTH, bottom + 44);
    demo_text_add(text, "<title>");
    plot_add_escaped(text, plot->headline);
    demo_text_add(text, "</title><rect width=\"%d\" height=\"%.0f\" fill=\"#fff\"/>\n", WIDTH, bottom + 44);
    draw_legend(text, plot, left, true);
    for (size_t i = 0; i < axis.tick_count; i++) {
        char label[32];
        double x = plot_position(&axis, axis.ticks[i]);
        plot_format_tick(label, axis.ticks[i]);
        demo_text_add(text, "<path d=\"M%.1f %.1fV%.1f\" stroke=\"%s\"/><text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\" fill=\"#666\">%s</text>\n", x, top - 2, bottom,
            axis.ticks[i] == 0 ? "#888" : "#e4e4e0", x, bottom + 16, label);
    }
    for (size_t i = 0; i < plot->bar_count; i++) draw_bar(text, plot, &plot->bars[i], &axis, top + (double)i * STEP + (STEP - BAR) / 2);
    demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\" fill=\"#333\">", (left + WIDTH - RIGHT) / 2, bottom + 36);
    plot_add_escaped(text, plot->value_name);
    demo_text_add(text, "</text>\n</svg>\n");
}

void plot_bars_add_table(demo_text* text, const plot_bars* plot)
{
    demo_text_add(text, "<table><thead><tr><th>");
    plot_add_escaped(text, plot->value_name);
    demo_text_add(text, "</th>");
    for (size_t k = 0; k < plot->part_count; k++) {
        demo_text_add(text, "<th class=\"n\">");
        plot_add_escaped(text, plot->part_names[k]);
        demo_text_add(text, "</th>");
    }
    if (plot->total_name) {
        demo_text_add(text, "<th class=\"n\">");
        plot_add_escaped(text, plot->total_name);
        demo_text_add(text, "</th>");
    }
    demo_text_add(text, "<th></th></tr></thead><tbody>\n");
    for (size_t i = 0; i < plot->bar_count; i++) {
        const plot_bar* bar = &plot->bars[i];
        char figure[32];
        demo_text_add(text, "<tr><td>");
        plot_add_escaped(text, bar->name);
        demo_text_add(text, "</td>");
        for (size_t k = 0; k < plot->part_count; k++) {
            plot_format_value(figure, bar->parts[k]);
            demo_text_add(text, "<td class=\"n\">%s</td>", figure);
        }
        plot_format_value(figure, bar->total);
        if (plot->total_name) demo_text_add(text, "<td class=\"n\">%s</td>", figure);
        demo_text_add(text, "<td>");
        plot_add_escaped(text, bar->note);
        demo_text_add(text, "</td></tr>\n");
    }
    demo_text_add(text, "</tbody></table>\n");
}

static void add_csv_number(demo_text* text, double value)
{
    if (isfinite(value)) demo_text_add(text, ",%.9g", value);
    else demo_text_add(text, ",");
}

void plot_bars_add_csv(demo_text* text, const plot_bars* plot)
{
    plot_add_csv_string(text, plot->value_name);
    for (size_t k = 0; k < plot->part_count; k++) {
        demo_text_add(text, ",");
        plot_add_csv_string(text, plot->part_names[k]);
    }
    demo_text_add(text, ",total,note\n");
    for (size_t i = 0; i < plot->bar_count; i++) {
        const plot_bar* bar = &plot->bars[i];
        plot_add_csv_string(text, bar->name);
        for (size_t k = 0; k < plot->part_count; k++) add_csv_number(text, bar->parts[k]);
        add_csv_number(text, bar->total);
        demo_text_add(text, ",");
        plot_add_csv_string(text, bar->note);
        demo_text_add(text, "\n");
    }
}
