/* Rolling plots. */
#include "ui_plot.h"

#include <math.h>
#include <stdio.h>

void ui_series_add(ui_series* series, float value)
{
    series->values[series->next] = value;
    series->next = (series->next + 1) % UI_PLOT_LENGTH;
    if (series->count < UI_PLOT_LENGTH) series->count++;
}

float ui_series_at(const ui_series* series, uint32_t age)
{
    return age < series->count ? series->values[(series->next + UI_PLOT_LENGTH - 1 - age) % UI_PLOT_LENGTH] : 0;
}

void ui_series_text(const ui_series* series, const char* format, char* text, size_t size)
{
    float newest = ui_series_at(series, 0);
    if (series->count && isfinite(newest)) snprintf(text, size, format, (double)newest);
    else snprintf(text, size, "-");
}

float ui_series_largest(const ui_series* series)
{
    float largest = 0;
    for (uint32_t i = 0; i < series->count; i++)
        if (isfinite(series->values[i]) && series->values[i] > largest) largest = series->values[i];
    return largest;
}

float ui_series_mean(const ui_series* series)
{
    double sum = 0;
    uint32_t counted = 0;
    for (uint32_t i = 0; i < series->count; i++)
        if (isfinite(series->values[i])) sum += series->values[i], counted++;
    return counted ? (float)(sum / counted) : 0;
}

float ui_plot_top(float value)
{
    if (!(value > 1e-30f) || !isfinite(value)) return 1;
    double decade = pow(10, floor(log10((double)value)));
    const double steps[] = {1, 2, 5, 10};
    for (int i = 0; i < 4; i++)
        if (steps[i] * decade >= (double)value * (1 - 1e-6)) return (float)(steps[i] * decade);
    return (float)(10 * decade);
}

static int row_of(canvas_rect rect, float value, float top)
{
    float share = fminf(fmaxf(value / top, 0), 1);
    return rect.y + rect.height - 1 - (int)(share * (float)(rect.height - 1) + 0.5f);
}

void ui_plot(demo_canvas* canvas, canvas_rect rect, const ui_series* series, float top, int thickness, uint32_t colour)
{
    canvas_rect former = canvas_narrow_clip(canvas, rect);
    for (uint32_t age = 0; age + 1 < series->count; age++) {
        float newer = ui_series_at(series, age), older = ui_series_at(series, age + 1);
        if (!isfinite(newer) || !isfinite(older)) continue;
        int x1 = rect.x + rect.width - 1 - (int)((int64_t)age * rect.width / UI_PLOT_LENGTH);
        int x0 = rect.x + rect.width - 1 - (int)((int64_t)(age + 1) * rect.width / UI_PLOT_LENGTH);
        canvas_line(canvas, x0, row_of(rect, older, top), x1, row_of(rect, newer, top), thickness, colour);
    }
    canvas->clip = former;
}
