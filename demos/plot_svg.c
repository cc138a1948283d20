/* What the plots share: colours, escaped text, numbers, axes. */
#include "plot.h"

#include <math.h>
#include <string.h>

const char* const plot_colours[PLOT_COLOURS] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#6b6b6b", "#5b3a9e"};
const char* const plot_text_colours[PLOT_COLOURS] = {"#005a8e", "#a84600", "#006b4e", "#97446f", "#855b00", "#1c6a97", "#4a4a4a", "#4a2e86"};

void plot_open_svg(demo_text* text, double width, double height)
{
    demo_text_add(text, "<svg viewBox=\"0 0 %g %g\" font-family=\"system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif\" font-size=\"12\" role=\"img\">\n",
        width, height);
}

void plot_add_escaped(demo_text* text, const char* string)
{
    for (const char* c = string; *c; c++) {
        if (*c == '&') demo_text_add(text, "&amp;");
        else if (*c == '<') demo_text_add(text, "&lt;");
        else if (*c == '>') demo_text_add(text, "&gt;");
        else if (*c == '"') demo_text_add(text, "&quot;");
        else demo_text_add(text, "%c", *c);
    }
}

void plot_add_csv_string(demo_text* text, const char* string)
{
    demo_text_add(text, "\"");
    for (const char* c = string; *c; c++) demo_text_add(text, *c == '"' ? "\"\"" : "%c", *c);
    demo_text_add(text, "\"");
}

double plot_text_width(const char* string, double font_size)
{
    double width = 0;
    for (const unsigned char* c = (const unsigned char*)string; *c; c++) {
        if ((*c & 0xC0) == 0x80) continue; /* the rest of a character of several bytes */
        width += strchr("ijl.,:;'|!()[] ", *c) ? 0.32 : strchr("mwMW%@", *c) ? 0.88 : *c >= 'A' && *c <= 'Z' ? 0.68 : 0.56;
    }
    return width * font_size;
}

void plot_format_tick(char text[32], double value)
{
    double size = fabs(value);
    if (size >= 1e6) snprintf(text, 32, "%gM", value / 1e6);
    else if (size >= 1e4) snprintf(text, 32, "%gk", value / 1e3);
    else snprintf(text, 32, "%.6g", value);
}

void plot_format_value(char text[32], double value)
{
    double size = fabs(value);
    if (!isfinite(value)) snprintf(text, 32, "–");
    else if (size >= 1e6) snprintf(text, 32, "%.3gM", value / 1e6);
    else if (size >= 99950) snprintf(text, 32, "%.0fk", value / 1e3);
    else if (size >= 1e4) snprintf(text, 32, "%.3gk", value / 1e3);
    else if (size >= 100) snprintf(text, 32, "%.0f", value);
    else snprintf(text, 32, "%.3g", value);
}

static void add_tick(plot_axis* axis, double value, bool small)
{
    double slack = 1e-9 * (axis->high - axis->low);
    if (value < axis->low - slack || value > axis->high + slack) return;
    if (small && axis->small_tick_count < sizeof axis->small_ticks / sizeof axis->small_ticks[0]) axis->small_ticks[axis->small_tick_count++] = value;
    if (!small && axis->tick_count < sizeof axis->ticks / sizeof axis->ticks[0]) axis->ticks[axis->tick_count++] = value;
}

static void choose_plain_ticks(plot_axis* axis)
{
    double rough = (axis->high - axis->low) / fmax(3, fabs(axis->end - axis->begin) / 90), power = pow(10, floor(log10(rough)));
    double step = power * (rough / power > 5 ? 10 : rough / power > 2 ? 5 : rough / power > 1 ? 2 : 1);
    for (double k = ceil(axis->low / step - 1e-9); k * step <= axis->high * (1 + 1e-9); k++) add_tick(axis, k * step == 0 ? 0 : k * step, false);
}

static void choose_log_ticks(plot_axis* axis)
{
    if (axis->high < 5 * axis->low) { /* too short for powers of ten */
        choose_plain_ticks(axis);
        return;
    }
    double decades = log10(axis->high / axis->low), per_decade = fabs(axis->end - axis->begin) / fmax(decades, 1e-6);
    for (int k = (int)floor(log10(axis->low)); k <= (int)ceil(log10(axis->high)); k++)
        for (int m = 1; m <= 9; m++) {
            bool labelled = m == 1 || (per_decade > 110 && (m == 2 || m == 5)) || (per_decade > 260 && (m == 3 || m == 7));
            add_tick(axis, m * pow(10, k), !labelled);
        }
}

plot_axis plot_make_axis(bool logarithmic, double low, double high, double begin, double end)
{
    plot_axis axis = {.logarithmic = logarithmic, .begin = begin, .end = end};
    if (!isfinite(low) || !isfinite(high) || low > high || (logarithmic && !(low > 0))) low = 1, high = 10;
    if (logarithmic) {
        double room = pow(high / low, 0.05) * 1.12;
        axis.low = low / room;
        axis.high = high * room;
        choose_log_ticks(&axis);
    } else {
        if (low == high) high = low + fmax(fabs(low), 1);
        double room = 0.06 * (high - low);
        axis.low = low == 0 ? 0 : low - room;
        axis.high = high == 0 ? 0 : high + room;
        choose_plain_ticks(&axis);
    }
    return axis;
}

double plot_position(const plot_axis* axis, double value)
{
    double t = axis->logarithmic ? log(value / axis->low) / log(axis->high / axis->low) : (value - axis->low) / (axis->high - axis->low);
    return axis->begin + t * (axis->end - axis->begin);
}
