/* One bar per row on a logarithmic axis: how many times better than what must be reached. 1 is the must, the tick the aim. */
#include "bench.h"

#include <math.h>
#include <string.h>

static double score(const bench_row* row)
{
    if (row->judge == BENCH_RATIO_AT_LEAST) return row->ratio / row->must;
    if (row->judge == BENCH_VALUE_AT_MOST && !isnan(row->value)) return row->must / fmax(row->value, row->must * 1e-3);
    if (row->judge == BENCH_VALUE_AT_LEAST) return row->value / row->must;
    return NAN;
}

static double aim_score(const bench_row* row)
{
    return row->judge == BENCH_VALUE_AT_MOST ? row->must / row->aim : row->aim / row->must;
}

enum { WIDTH = 880, ROW = 26, TOP = 40, RIGHT = 90 };
static const double lowest = 0.1, highest = 20;

static double position(double value, double left)
{
    double t = log(fmin(fmax(value, lowest), highest) / lowest) / log(highest / lowest);
    return left + t * (WIDTH - left - RIGHT);
}

void bench_add_svg(demo_text* text, const bench_row* rows, size_t count)
{
    static const double ticks[] = {0.1, 0.2, 0.5, 1, 2, 5, 10, 20};
    size_t shown = 0;
    double left = 170;
    for (size_t i = 0; i < count; i++) {
        if (rows[i].judge == BENCH_NONE) continue;
        shown++;
        left = fmax(left, plot_text_width(rows[i].id, 12) * 1.06 + 16);
    }
    double bottom = TOP + (double)shown * ROW;
    plot_open_svg(text, WIDTH, bottom + 12);
    demo_text_add(text, "<rect width=\"%d\" height=\"%g\" fill=\"#fff\"/>\n", WIDTH, bottom + 12);
    demo_text_add(text, "<text x=\"%.1f\" y=\"14\" fill=\"#333\">times better than it must be</text>\n", left);
    for (size_t i = 0; i < sizeof ticks / sizeof ticks[0]; i++) {
        double x = position(ticks[i], left);
        demo_text_add(text,
            "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%d\" y2=\"%g\" stroke=\"%s\"%s/><text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\" "
            "fill=\"#777\">%g</text>\n",
            x, x, TOP - 4, bottom, ticks[i] == 1 ? "#333" : "#e3e3e3", ticks[i] == 1 ? " stroke-dasharray=\"4 3\"" : "", x,
            TOP - 8, ticks[i]);
    }
    size_t k = 0;
    for (size_t i = 0; i < count; i++) {
        const bench_row* row = &rows[i];
        if (row->judge == BENCH_NONE) continue;
        double y = TOP + (double)k++ * ROW, s = score(row), a = position(aim_score(row), left);
        const char* verdict = bench_verdict(row);
        const char* colour = !strcmp(verdict, "aim") ? "#009e73" : !strcmp(verdict, "must") ? "#e69f00" : "#d55e00";
        demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\" fill=\"#333\">%s</text>\n", left - 8, y + 17, row->id);
        if (isnan(s)) {
            demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" fill=\"#999\">not measured</text>\n", left + 6, y + 17);
            continue;
        }
        double x = position(s, left);
        char figure[48];
        if (row->judge == BENCH_RATIO_AT_LEAST)
            snprintf(figure, sizeof figure, "%.3gx", row->ratio);
        else
            snprintf(figure, sizeof figure, "%.3g %s", row->value, row->unit);
        demo_text_add(text, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%d\" fill=\"%s\"/>", left, y + 4,
            fmax(x - left, 1), ROW - 8, colour);
        demo_text_add(text, "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"#111\" stroke-width=\"2\"/>", a, a,
            y + 2, y + ROW - 2);
        double end = fmax(x, a) + 6;
        bool inside = end + plot_text_width(figure, 12) * 1.06 > WIDTH; /* beside the bar there is no room */
        demo_text_add(text, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" fill=\"%s\">%s</text>\n", inside ? x - 6 : end, y + 17, inside ? "end" : "start",
            inside ? "#fff" : "#333", figure);
    }
    demo_text_add(text, "</svg>\n");
}
