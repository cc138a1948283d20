/* Settings as sliders. */
#include "setting_slider.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

double setting_value(const es_setting* setting, const void* settings)
{
    const char* at = (const char*)settings + setting->offset;
    if (setting->type == ES_SETTING_BOOL) return *(const bool*)(const void*)at;
    if (setting->type == ES_SETTING_FLOAT) return (double)*(const float*)(const void*)at;
    return *(const uint32_t*)(const void*)at;
}

void setting_store(const es_setting* setting, void* settings, double value)
{
    char* at = (char*)settings + setting->offset;
    if (setting->type == ES_SETTING_BOOL) *(bool*)(void*)at = value != 0;
    else if (setting->type == ES_SETTING_FLOAT) *(float*)(void*)at = (float)value;
    else *(uint32_t*)(void*)at = (uint32_t)value;
}

uint32_t setting_choice_count(const es_setting* setting)
{
    uint32_t count = 1;
    for (const char* c = setting->choices ? setting->choices : ""; *c; c++) count += *c == '|';
    return count;
}

static double lowest(const es_setting* setting) { return setting->type == ES_SETTING_INT || setting->type == ES_SETTING_FLOAT ? setting->minimum : 0; }
static double highest(const es_setting* setting)
{
    if (setting->type == ES_SETTING_BOOL) return 1;
    return setting->type == ES_SETTING_CHOICE ? setting_choice_count(setting) - 1 : setting->maximum;
}

static double within(const es_setting* setting, double value) { return fmin(fmax(value, lowest(setting)), highest(setting)); }

/* The n-th of names separated by '|'. */
static const char* choice_name(const es_setting* setting, uint32_t index, size_t* length)
{
    const char* name = setting->choices;
    for (; index && strchr(name, '|'); index--) name = strchr(name, '|') + 1;
    *length = strcspn(name, "|");
    return name;
}

void setting_text(const es_setting* setting, double value, char text[SETTING_TEXT_SIZE])
{
    size_t length;
    const char* name;
    switch (setting->type) {
    case ES_SETTING_BOOL:
        snprintf(text, SETTING_TEXT_SIZE, "%s", value != 0 ? "true" : "false");
        return;
    case ES_SETTING_INT:
        snprintf(text, SETTING_TEXT_SIZE, "%.0f", value);
        return;
    case ES_SETTING_CHOICE:
        name = choice_name(setting, (uint32_t)value, &length);
        snprintf(text, SETTING_TEXT_SIZE, "%.*s", (int)length, name);
        return;
    case ES_SETTING_FLOAT:
        for (int digits = 1; digits <= 9; digits++) {
            snprintf(text, SETTING_TEXT_SIZE, "%.*g", digits, value);
            if ((float)strtod(text, NULL) == (float)value) break;
        }
        if (strchr(text, 'e') && fabs(value) >= 1 && fabs(value) < 1e8 && value == floor(value)) snprintf(text, SETTING_TEXT_SIZE, "%.0f", value);
        return;
    }
}

bool setting_parse(const es_setting* setting, const char* text, double* value)
{
    char* end;
    size_t length;
    double number;
    switch (setting->type) {
    case ES_SETTING_BOOL:
        if (strcmp(text, "true") && strcmp(text, "false") && strcmp(text, "1") && strcmp(text, "0")) return false;
        *value = !strcmp(text, "true") || !strcmp(text, "1");
        return true;
    case ES_SETTING_CHOICE:
        for (uint32_t i = 0; i < setting_choice_count(setting); i++) {
            const char* name = choice_name(setting, i, &length);
            if (strlen(text) != length || strncmp(text, name, length) != 0) continue;
            *value = i;
            return true;
        }
        return false;
    default:
        number = strtod(text, &end);
        if (end == text || *end || !(number >= setting->minimum && number <= setting->maximum)) return false;
        if (setting->type == ES_SETTING_INT && number != floor(number)) return false;
        *value = setting->type == ES_SETTING_FLOAT ? (double)(float)number : number; /* what the struct will hold */
        return true;
    }
}

double setting_default(const es_setting* setting)
{
    double value = lowest(setting);
    setting_parse(setting, setting->default_text, &value);
    return value;
}

/* ---- along the bar ------------------------------------------------------------------------------------------------------- */

/* Below this the bar is even, above it logarithmic; infinite: even everywhere. */
static double even_part(const es_setting* setting)
{
    if (setting->type == ES_SETTING_BOOL || setting->type == ES_SETTING_CHOICE) return INFINITY;
    double range = setting->maximum - setting->minimum, usual = fabs(setting_default(setting));
    if (usual * 20 >= range) return INFINITY;
    if (usual == 0) return range <= 100 && setting->type == ES_SETTING_INT ? INFINITY : range / 1000;
    return usual / 4;
}

/* Odd, so that ranges with both signs work; monotonic. */
static double along(double even, double value) { return isinf(even) ? value : copysign(log1p(fabs(value) / even), value); }
static double back(double even, double place) { return isinf(even) ? place : copysign(expm1(fabs(place)) * even, place); }

float setting_fraction(const es_setting* setting, double value)
{
    double even = even_part(setting), low = along(even, lowest(setting)), high = along(even, highest(setting));
    if (!(high > low)) return 0;
    return (float)((along(even, within(setting, value)) - low) / (high - low));
}

static double round_digits(double value, int digits)
{
    if (value == 0 || !isfinite(value)) return value;
    char text[64];
    snprintf(text, sizeof text, "%.*g", digits, value);
    return strtod(text, NULL);
}

double setting_at_fraction(const es_setting* setting, float fraction)
{
    if (fraction <= 0) return lowest(setting);
    if (fraction >= 1) return highest(setting);
    double even = even_part(setting), low = along(even, lowest(setting)), high = along(even, highest(setting));
    double value = back(even, low + (high - low) * (double)fraction);
    if (setting->type != ES_SETTING_FLOAT) return within(setting, floor(value + 0.5));
    /* what is nearer to zero than a thousandth of the even part is meant as zero where the range has both signs or begins there */
    if (fabs(value) < (isinf(even) ? (high - low) / 1000 : even / 1000) && lowest(setting) <= 0) value = 0;
    return within(setting, round_digits(value, 3));
}

/* A tenth of the value's decade: 1024 goes by 100, 0.026 by 0.001; near zero by a thousandth of what is usual. */
static double step_size(const es_setting* setting, double value)
{
    if (setting->type == ES_SETTING_BOOL || setting->type == ES_SETTING_CHOICE) return 1;
    double usual = fabs(setting_default(setting)), range = setting->maximum - setting->minimum;
    double least = usual > 0 ? usual / 100 : range / 100;
    double size = fmax(fabs(value), least);
    double step = pow(10, floor(log10(size) + 1e-9) - 1);
    return setting->type == ES_SETTING_INT ? fmax(step, 1) : step;
}

double setting_stepped(const es_setting* setting, double value, int steps)
{
    double step = step_size(setting, value), next = value + step * steps;
    if (setting->type == ES_SETTING_FLOAT) next = floor(next / step + 0.5) * step;
    next = setting->type == ES_SETTING_FLOAT ? round_digits(next, 6) : floor(next + 0.5);
    return within(setting, next);
}

double setting_accepted(const es_setting* setting, double now, double wanted, bool (*accepts)(void* user, double value), void* user)
{
    if (wanted == now) return now;
    if (accepts(user, wanted)) return wanted;
    if (setting->type != ES_SETTING_INT) return now;
    double power = exp2(floor(log2(fmax(wanted, 1)) + 0.5)), multiple = floor(wanted / 64 + 0.5) * 64;
    /* the nearest first; then onwards, since a small step would always fall back to where it came from */
    double way = wanted > now ? 1 : -1;
    double onward = way > 0 ? exp2(floor(log2(fmax(now, 1))) + 1) : exp2(ceil(log2(fmax(now, 1))) - 1);
    double next_multiple = (way > 0 ? floor(now / 64) + 1 : ceil(now / 64) - 1) * 64;
    double candidates[] = {multiple, power, next_multiple, onward};
    for (size_t i = 0; i < sizeof candidates / sizeof candidates[0]; i++) {
        double c = candidates[i];
        if ((c - now) * way > 0 && c >= setting->minimum && c <= setting->maximum && accepts(user, c)) return c;
    }
    return now;
}
