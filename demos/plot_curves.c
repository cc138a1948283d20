/* Curves and points on two axes. */
#include "plot.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* ---- data -------------------------------------------------------------------------------------------------------- */

plot_series* plot_add_series(plot_curves* plot, uint32_t colour, const char* name_format, ...)
{
    if (plot->series_count == PLOT_MAX_SERIES) return &plot->series[PLOT_MAX_SERIES - 1];
    plot_series* series = &plot->series[plot->series_count++];
    *series = (plot_series){.colour = colour % PLOT_COLOURS};
    va_list arguments;
    va_start(arguments, name_format);
    vsnprintf(series->name, sizeof series->name, name_format, arguments);
    va_end(arguments);
    return series;
}

void plot_add_point(plot_curves* plot, plot_series* series, double x, double y, const char* note_format, ...)
{
    if (!isfinite(x) || !isfinite(y)) return;
    if (series->count == series->capacity) {
        size_t capacity = series->capacity ? 2 * series->capacity : 16;
        plot_point* grown = realloc(series->points, capacity * sizeof *grown);
        if (!grown) {
            plot->failed = true;
            return;
        }
        series->points = grown;
        series->capacity = capacity;
    }
    plot_point* point = &series->points[series->count++];
    *point = (plot_point){.x = x, .y = y};
    va_list arguments;
    va_start(arguments, note_format);
    vsnprintf(point->note, sizeof point->note, note_format, arguments);
    va_end(arguments);
}

void plot_add_rule(plot_curves* plot, bool vertical, double at, const char* name_format, ...)
{
    if (plot->rule_count == PLOT_MAX_LINES || !isfinite(at)) return;
    plot_rule* rule = &plot->rules[plot->rule_count++];
    *rule = (plot_rule){.vertical = vertical, .at = at};
    va_list arguments;
    va_start(arguments, name_format);
    vsnprintf(rule->name, sizeof rule->name, name_format, arguments);
    va_end(arguments);
}

static bool is_beaten(const plot_curves* plot, const plot_point* point)
{
    for (size_t s = 0; s < plot->series_count; s++)
        for (size_t i = 0; plot->series[s].competes && i < plot->series[s].count; i++) {
            const plot_point* other = &plot->series[s].points[i];
            if (other->x <= point->x && other->y <= point->y && (other->x < point->x || other->y < point->y)) return true;
        }
    return false;
}

void plot_mark_front(plot_curves* plot)
{
    for (size_t s = 0; s < plot->series_count; s++)
        for (size_t i = 0; plot->series[s].competes && i < plot->series[s].count; i++)
            plot->series[s].points[i].front = !is_beaten(plot, &plot->series[s].points[i]);
}

static double between(double x, double x0, double y0, double x1, double y1)
{
    return x0 == x1 ? y0 : exp(log(y0) + (log(y1) - log(y0)) * (log(x) - log(x0)) / (log(x1) - log(x0)));
}

double plot_y_at(const plot_series* series, double x)
{
    for (size_t i = 0; i + 1 < series->count; i++) {
        const plot_point *p = &series->points[i], *q = p + 1;
        if (x >= p->x && x <= q->x) return between(x, p->x, p->y, q->x, q->y);
    }
    return NAN;
}

double plot_x_at(const plot_series* series, double y)
{
    for (size_t i = 0; i + 1 < series->count; i++) {
        const plot_point *p = &series->points[i], *q = p + 1;
        if ((y >= p->y && y <= q->y) || (y <= p->y && y >= q->y)) return between(y, p->y, p->x, q->y, q->x);
    }
    return NAN;
}

double plot_log_slope(const plot_series* series)
{
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (size_t i = 0; i < series->count; i++) {
        double x = log(series->points[i].x), y = log(series->points[i].y);
        if (!isfinite(x) || !isfinite(y)) continue;
        n++, sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    double spread = n * sxx - sx * sx;
    return n < 2 || !(spread > 0) ? NAN : (n * sxy - sx * sy) / spread;
}

void plot_curves_free(plot_curves* plot)
{
    for (size_t s = 0; s < plot->series_count; s++) free(plot->series[s].points);
    plot->series_count = 0;
}

/* ---- drawing ----------------------------------------------------------------------------------------------------- */

enum { WIDTH = 880, HEIGHT = 500, LEFT = 66, RIGHT = 18, TOP = 12, BOTTOM = 50, FONT = 12 };

typedef struct box {
    double x0, y0, x1, y1;
} box;

/* What has been drawn where, so that names find a free place. */
typedef struct drawing {
    demo_text* text;
    const plot_curves* plot;
    plot_axis x, y;
    box taken[1024];
    size_t taken_count;
} drawing;

static bool is_drawn(const drawing* d, const plot_point* p) { return (!d->x.logarithmic || p->x > 0) && (!d->y.logarithmic || p->y > 0); }

static void take(drawing* d, box b)
{
    if (d->taken_count < sizeof d->taken / sizeof d->taken[0]) d->taken[d->taken_count++] = b;
}

static double overlap(const drawing* d, box b)
{
    double area = 0;
    for (size_t i = 0; i < d->taken_count; i++) {
        const box* t = &d->taken[i];
        double w = fmin(b.x1, t->x1) - fmax(b.x0, t->x0), h = fmin(b.y1, t->y1) - fmax(b.y0, t->y0);
        if (w > 0 && h > 0) area += w * h + 20;
    }
    return area;
}

static void find_ranges(drawing* d)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    const plot_curves* plot = d->plot;
    d->x.logarithmic = plot->x_log;
    d->y.logarithmic = plot->y_log;
    for (size_t s = 0; s < plot->series_count; s++)
        for (size_t i = 0; i < plot->series[s].count; i++) {
            const plot_point* p = &plot->series[s].points[i];
            if (!is_drawn(d, p)) continue;
            low[0] = fmin(low[0], p->x), high[0] = fmax(high[0], p->x);
            low[1] = fmin(low[1], p->y), high[1] = fmax(high[1], p->y);
        }
    for (size_t i = 0; i < plot->rule_count; i++) {
        int k = plot->rules[i].vertical ? 0 : 1;
        low[k] = fmin(low[k], plot->rules[i].at), high[k] = fmax(high[k], plot->rules[i].at);
    }
    if (!plot->y_log) low[1] = fmin(low[1], 0);
    if (!plot->x_log) low[0] = fmin(low[0], 0);
    d->x = plot_make_axis(plot->x_log, low[0], high[0], LEFT, WIDTH - RIGHT);
    d->y = plot_make_axis(plot->y_log, low[1], high[1], HEIGHT - BOTTOM, TOP);
}

static void draw_axes(drawing* d)
{
    demo_text* text = d->text;
    char label[32];
    for (size_t i = 0; i < d->x.small_tick_count; i++)
        demo_text_add(text, "<path d=\"M%.1f %dv%d\" stroke=\"#f3f3f1\"/>", plot_position(&d->x, d->x.small_ticks[i]), TOP, HEIGHT - TOP - BOTTOM);
    for (size_t i = 0; i < d->y.small_tick_count; i++)
        demo_text_add(text, "<path d=\"M%d %.1fh%d\" stroke=\"#f3f3f1\"/>", LEFT, plot_position(&d->y, d->y.small_ticks[i]), WIDTH - LEFT - RIGHT);
    for (size_t i = 0; i < d->x.tick_count; i++) {
        double x = plot_position(&d->x, d->x.ticks[i]);
        plot_format_tick(label, d->x.ticks[i]);
        demo_text_add(text, "<path d=\"M%.1f %dv%d\" stroke=\"#e4e4e0\"/><text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\" fill=\"#666\">%s</text>\n", x, TOP,
            HEIGHT - TOP - BOTTOM, x, HEIGHT - BOTTOM + 18, label);
    }
    for (size_t i = 0; i < d->y.tick_count; i++) {
        double y = plot_position(&d->y, d->y.ticks[i]);
        plot_format_tick(label, d->y.ticks[i]);
        demo_text_add(text, "<path d=\"M%d %.1fh%d\" stroke=\"#e4e4e0\"/><text x=\"%d\" y=\"%.1f\" text-anchor=\"end\" fill=\"#666\">%s</text>\n", LEFT, y,
            WIDTH - LEFT - RIGHT, LEFT - 8, y + 4, label);
    }
    demo_text_add(text, "<path d=\"M%d %dV%dH%d\" fill=\"none\" stroke=\"#999\"/>", LEFT, TOP, HEIGHT - BOTTOM, WIDTH - RIGHT);
    demo_text_add(text, "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\" fill=\"#333\">", (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 10);
    plot_add_escaped(text, d->plot->x_name);
    demo_text_add(text, "</text><text transform=\"translate(16 %d) rotate(-90)\" text-anchor=\"middle\" fill=\"#333\">", (TOP + HEIGHT - BOTTOM) / 2);
    plot_add_escaped(text, d->plot->y_name);
    demo_text_add(text, "</text>\n");
}

static void draw_rules(drawing* d)
{
    for (size_t i = 0; i < d->plot->rule_count; i++) {
        const plot_rule* rule = &d->plot->rules[i];
        double w = plot_text_width(rule->name, FONT);
        if (rule->vertical) {
            double x = plot_position(&d->x, rule->at);
            bool left = x + w + 8 > WIDTH - RIGHT;
            demo_text_add(d->text, "<path d=\"M%.1f %dV%d\" stroke=\"#444\" stroke-dasharray=\"2 4\"/><text x=\"%.1f\" y=\"%d\" text-anchor=\"%s\" fill=\"#444\">", x, TOP,
                HEIGHT - BOTTOM, left ? x - 6 : x + 6, TOP + 12, left ? "end" : "start");
            take(d, left ? (box){x - 6 - w, TOP, x + 1, TOP + 16} : (box){x - 1, TOP, x + 6 + w, TOP + 16});
        } else {
            double y = plot_position(&d->y, rule->at);
            demo_text_add(d->text, "<path d=\"M%d %.1fH%d\" stroke=\"#444\" stroke-dasharray=\"2 4\"/><text x=\"%d\" y=\"%.1f\" text-anchor=\"end\" fill=\"#444\">", LEFT, y,
                WIDTH - RIGHT, WIDTH - RIGHT - 4, y - 5);
            take(d, (box){WIDTH - RIGHT - 4 - w, y - 17, WIDTH - RIGHT, y + 1});
        }
        plot_add_escaped(d->text, rule->name);
        demo_text_add(d->text, "</text>\n");
    }
}

static int by_x(const void* a, const void* b)
{
    const plot_point *p = *(const plot_point**)(uintptr_t)a, *q = *(const plot_point**)(uintptr_t)b;
    return p->x != q->x ? (p->x > q->x) - (p->x < q->x) : (p->y < q->y) - (p->y > q->y);
}

static void draw_front(drawing* d)
{
    const plot_point* front[512];
    size_t count = 0;
    for (size_t s = 0; s < d->plot->series_count; s++)
        for (size_t i = 0; i < d->plot->series[s].count && count < 512; i++)
            if (d->plot->series[s].points[i].front && is_drawn(d, &d->plot->series[s].points[i])) front[count++] = &d->plot->series[s].points[i];
    if (!count) return;
    qsort(front, count, sizeof front[0], by_x);
    demo_text_add(d->text, "<path d=\"");
    for (size_t i = 0; i < count; i++) demo_text_add(d->text, "%c%.1f %.1f", i ? 'L' : 'M', plot_position(&d->x, front[i]->x), plot_position(&d->y, front[i]->y));
    demo_text_add(d->text, "\" fill=\"none\" stroke=\"#f0d264\" stroke-width=\"9\" stroke-opacity=\"0.55\" stroke-linejoin=\"round\" stroke-linecap=\"round\"/>\n");
}

/* A mark of about 8 pixels: circle, square, triangle, diamond, in turn. */
static void draw_mark(demo_text* text, uint32_t colour, bool hollow, double x, double y, double r)
{
    const char* fill = hollow ? "#fff" : plot_colours[colour];
    switch (colour % 4) {
    case 0:
        demo_text_add(text, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"", x, y, r);
        break;
    case 1:
        demo_text_add(text, "<path d=\"M%.1f %.1fh%.1fv%.1fh%.1fz\"", x - r * 0.9, y - r * 0.9, r * 1.8, r * 1.8, -r * 1.8);
        break;
    case 2:
        demo_text_add(text, "<path d=\"M%.1f %.1fl%.1f %.1fh%.1fz\"", x, y - r * 1.2, r * 1.15, r * 2, -r * 2.3);
        break;
    default:
        demo_text_add(text, "<path d=\"M%.1f %.1fl%.1f %.1fl%.1f %.1fl%.1f %.1fz\"", x, y - r * 1.25, r * 1.25, r * 1.25, -r * 1.25, r * 1.25, -r * 1.25, -r * 1.25);
    }
    demo_text_add(text, " fill=\"%s\" stroke=\"%s\" stroke-width=\"%s\"", fill, hollow ? plot_colours[colour] : "#fff", hollow ? "1.8" : "1");
}

static void draw_series(drawing* d, const plot_series* series)
{
    demo_text* text = d->text;
    bool begun = false;
    double last_x = 0, last_y = 0;
    if (series->line) demo_text_add(text, "<path d=\"");
    for (size_t i = 0; i < series->count && series->line; i++) {
        if (!is_drawn(d, &series->points[i])) continue;
        double x = plot_position(&d->x, series->points[i].x), y = plot_position(&d->y, series->points[i].y);
        demo_text_add(text, "%c%.1f %.1f", begun ? 'L' : 'M', x, y);
        int steps = begun ? (int)(hypot(x - last_x, y - last_y) / 10) : 0;
        for (int k = 1; k < steps; k++) {
            double px = last_x + (x - last_x) * k / steps, py = last_y + (y - last_y) * k / steps;
            take(d, (box){px - 2, py - 2, px + 2, py + 2});
        }
        last_x = x, last_y = y, begun = true;
    }
    if (series->line)
        demo_text_add(text, "%s\" fill=\"none\" stroke=\"%s\" stroke-width=\"2.2\" stroke-linejoin=\"round\"%s/>\n", begun ? "" : "M0 0", plot_colours[series->colour],
            series->dashed ? " stroke-dasharray=\"7 4\"" : "");
    for (size_t i = 0; i < series->count; i++) {
        const plot_point* p = &series->points[i];
        if (!is_drawn(d, p)) continue;
        double x = plot_position(&d->x, p->x), y = plot_position(&d->y, p->y);
        char x_text[32], y_text[32];
        plot_format_value(x_text, p->x);
        plot_format_value(y_text, p->y);
        draw_mark(text, series->colour, series->dashed, x, y, p->front ? 6 : 4.2);
        demo_text_add(text, "><title>");
        plot_add_escaped(text, series->name);
        if (p->note[0]) demo_text_add(text, "\n");
        plot_add_escaped(text, p->note);
        demo_text_add(text, "\n%s, %s%s</title></%s>\n", x_text, y_text, p->front ? "\non the Pareto front" : "", series->colour % 4 ? "path" : "circle");
        take(d, (box){x - 5, y - 5, x + 5, y + 5});
    }
}

/* The free place nearest to one of the curve's points, the last first. */
static void draw_name(drawing* d, const plot_series* series)
{
    /* x, y, share of the width to its left; the far ones are joined to their point by a line */
    static const double offsets[][3] = {{10, 4, 0}, {8, -8, 0}, {8, 16, 0}, {0, -11, 0.5}, {0, 20, 0.5}, {-10, 4, 1}, {-8, -8, 1}, {-8, 16, 1}, {0, -29, 0.5}, {0, 38, 0.5},
        {8, -29, 0}, {8, 38, 0}, {-8, -29, 1}, {-8, 38, 1}, {0, -47, 0.5}, {0, 56, 0.5}, {8, -47, 0}, {8, 56, 0}, {-8, -47, 1}, {-8, 56, 1}};
    enum { OFFSETS = sizeof offsets / sizeof offsets[0], NEAR_OFFSETS = 8 };
    static const char* const anchors[3] = {"start", "middle", "end"};
    double w = plot_text_width(series->name, FONT) * 1.14, best = INFINITY, best_x = 0, best_y = 0, best_share = 0, leader_x = NAN, leader_y = NAN;
    for (size_t i = 0; i < series->count; i++) {
        const plot_point* p = &series->points[series->count - 1 - i];
        if (!is_drawn(d, p)) continue;
        for (int k = 0; k < OFFSETS; k++) {
            double x = plot_position(&d->x, p->x) + offsets[k][0] - offsets[k][2] * w, y = plot_position(&d->y, p->y) + offsets[k][1];
            box b = {x, y - 11, x + w, y + 3};
            bool outside = b.x0 < LEFT + 2 || b.x1 > WIDTH - RIGHT + 12 || b.y0 < TOP || b.y1 > HEIGHT - BOTTOM - 2;
            double cost = overlap(d, b) + 6.0 * (i == 0 ? 0 : i == series->count - 1 ? 1 : 2) + k * 0.5 + (k < NEAR_OFFSETS ? 0 : 8) + (outside ? 1e5 : 0);
            if (!(cost < best)) continue;
            best = cost, best_x = x, best_y = y, best_share = offsets[k][2];
            leader_x = k < NEAR_OFFSETS ? NAN : plot_position(&d->x, p->x);
            leader_y = plot_position(&d->y, p->y);
        }
    }
    if (!isfinite(best)) return;
    take(d, (box){best_x, best_y - 11, best_x + w, best_y + 3});
    if (isfinite(leader_x))
        demo_text_add(d->text, "<path d=\"M%.1f %.1fL%.1f %.1f\" stroke=\"%s\" stroke-width=\"1\"/>\n", leader_x, leader_y + (best_y < leader_y ? -6 : 6),
            best_x + best_share * w, best_y < leader_y ? best_y + 3 : best_y - 11, plot_text_colours[series->colour]);
    demo_text_add(d->text,
        "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" fill=\"%s\" font-weight=\"600\" stroke=\"#fff\" stroke-width=\"3.5\" stroke-linejoin=\"round\" paint-order=\"stroke\">",
        best_x + best_share * w, best_y, anchors[(int)(best_share * 2)], plot_text_colours[series->colour]);
    plot_add_escaped(d->text, series->name);
    demo_text_add(d->text, "</text>\n");
}

void plot_curves_add_svg(demo_text* text, const plot_curves* plot)
{
    drawing d = {.text = text, .plot = plot};
    find_ranges(&d);
    plot_open_svg(text, WIDTH, HEIGHT);
    demo_text_add(text, "<title>");
    plot_add_escaped(text, plot->headline);
    demo_text_add(text, "</title><rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n", WIDTH, HEIGHT);
    draw_axes(&d);
    draw_rules(&d);
    draw_front(&d);
    for (size_t s = 0; s < plot->series_count; s++) draw_series(&d, &plot->series[s]);
    for (size_t s = 0; s < plot->series_count; s++) draw_name(&d, &plot->series[s]);
    demo_text_add(text, "</svg>\n");
}

void plot_curves_add_table(demo_text* text, const plot_curves* plot)
{
    demo_text_add(text, "<table><thead><tr><th>curve</th><th></th><th class=\"n\">");
    plot_add_escaped(text, plot->x_name);
    demo_text_add(text, "</th><th class=\"n\">");
    plot_add_escaped(text, plot->y_name);
    demo_text_add(text, "</th><th></th></tr></thead><tbody>\n");
    for (size_t s = 0; s < plot->series_count; s++)
        for (size_t i = 0; i < plot->series[s].count; i++) {
            const plot_point* p = &plot->series[s].points[i];
            demo_text_add(text, "<tr><td>");
            plot_add_escaped(text, plot->series[s].name);
            demo_text_add(text, "</td><td>");
            plot_add_escaped(text, p->note);
            demo_text_add(text, "</td><td class=\"n\">%.4g</td><td class=\"n\">%.4g</td><td>%s</td></tr>\n", p->x, p->y, p->front ? "front" : "");
        }
    demo_text_add(text, "</tbody></table>\n");
}

void plot_curves_add_csv(demo_text* text, const plot_curves* plot)
{
    demo_text_add(text, "curve,note,");
    plot_add_csv_string(text, plot->x_name);
    demo_text_add(text, ",");
    plot_add_csv_string(text, plot->y_name);
    demo_text_add(text, ",front\n");
    for (size_t s = 0; s < plot->series_count; s++)
        for (size_t i = 0; i < plot->series[s].count; i++) {
            const plot_point* p = &plot->series[s].points[i];
            plot_add_csv_string(text, plot->series[s].name);
            demo_text_add(text, ",");
            plot_add_csv_string(text, p->note);
            demo_text_add(text, ",%.9g,%.9g,%d\n", p->x, p->y, p->front);
        }
}
