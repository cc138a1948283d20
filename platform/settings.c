/* Settings tables: numbers from and to text without the locale, ranges, and the nearest known name for a wrong one. */
#include "platform/settings.h"

#include <stdio.h>
#include <string.h>

#include "platform/context.h"

enum { NAME_MAX_LENGTH = 63 };

/* ---- numbers ---------------------------------------------------------------------------------------------------- */

static bool digit(char c) { return c >= '0' && c <= '9'; }

/* [+-]digits[.digits][e[+-]digits], the whole text. Up to 19 significant digits are kept in an integer; a mantissa below
 * 2^53 with a power of ten up to 22 is rounded once and therefore correctly, anything else to within a few ulp of double,
 * far below the float and integer precision of settings. */
static bool parse_number(const char* text, double* number)
{
    const char* p = text;
    bool negative = *p == '-', any = false, dot = false;
    uint64_t mantissa = 0;
    int significant = 0, exponent = 0;
    if (*p == '-' || *p == '+') p++;
    for (;; p++) {
        if (*p == '.' && !dot) {
            dot = true;
        } else if (digit(*p)) {
            any = true;
            if (significant < 19) {
                mantissa = mantissa * 10 + (uint64_t)(*p - '0');
                significant += mantissa != 0;
                exponent -= dot;
            } else if (exponent < 10000) {
                exponent += !dot;
            }
        } else {
            break;
        }
    }
    if (!any) return false;
    if (*p == 'e' || *p == 'E') {
        p++;
        bool minus = *p == '-';
        int e = 0;
        if (*p == '-' || *p == '+') p++;
        if (!digit(*p)) return false;
        for (; digit(*p); p++) e = e < 100000 ? e * 10 + (*p - '0') : e;
        exponent += minus ? -e : e;
    }
    if (*p != '\0') return false;
    if (exponent < -400) exponent = -400;
    if (exponent > 400) exponent = 400;
    double value = (double)mantissa, scale = 1.0, base = 10.0;
    for (int e = exponent < 0 ? -exponent : exponent; e > 0; e >>= 1, base *= base)
        if (e & 1) scale *= base;
    value = mantissa == 0 ? 0.0 : exponent < 0 ? value / scale : value * scale;
    if (!(value <= 1e300)) return false;
    *number = negative ? -value : value;
    return true;
}

/* snprintf writes the locale's decimal point, whatever bytes that is. */
static void point_out(char* text)
{
    char* to = text;
    bool point = false;
    for (const char* from = text; *from; from++) {
        if (digit(*from) || *from == '-' || *from == '+' || *from == 'e') {
            *to++ = *from;
        } else if (!point) {
            *to++ = '.';
            point = true;
        }
    }
    *to = '\0';
}

/* The shortest text that reads back as the same float. */
static void print_float(char* text, size_t size, float value)
{
    for (int precision = 1; precision <= 9; precision++) {
        double back;
        snprintf(text, size, "%.*g", precision, (double)value);
        point_out(text);
        if (parse_number(text, &back) && (float)back == value) return;
    }
}

/* ---- names ---------------------------------------------------------------------------------------------------------- */

static char fold(char c) { return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c == '_' ? '-' : c; }

/* Levenshtein distance with capitals and underscores folded; both cut at NAME_MAX_LENGTH. */
static int edit_distance(const char* a, const char* b)
{
    int row[NAME_MAX_LENGTH + 1];
    int columns = 0;
    while (columns < NAME_MAX_LENGTH && b[columns]) columns++;
    for (int j = 0; j <= columns; j++) row[j] = j;
    for (int i = 1; i <= NAME_MAX_LENGTH && a[i - 1]; i++) {
        int diagonal = row[0];
        row[0] = i;
        for (int j = 1; j <= columns; j++) {
            int replace = diagonal + (fold(a[i - 1]) != fold(b[j - 1]));
            diagonal = row[j];
            int best = row[j - 1] < row[j] ? row[j - 1] + 1 : row[j] + 1;
            row[j] = replace < best ? replace : best;
        }
    }
    return row[columns];
}

const char* es_settings_nearest(const es_setting* const* tables, const size_t* counts, size_t table_count, const char* name)
{
    const char* nearest = "";
    int best = 2 * NAME_MAX_LENGTH;
    for (size_t t = 0; t < table_count; t++)
        for (size_t i = 0; i < counts[t]; i++) {
            int distance = edit_distance(name, tables[t][i].name);
            if (distance < best) {
                best = distance;
                nearest = tables[t][i].name;
            }
        }
    return nearest;
}

const es_setting* es_settings_find(const es_setting* table, size_t count, const char* name)
{
    for (size_t i = 0; i < count; i++)
        if (strcmp(table[i].name, name) == 0) return &table[i];
    return NULL;
}

/* ---- values ---------------------------------------------------------------------------------------------------------- */

typedef union setting_value { bool b; uint32_t u; float f; } setting_value;

static bool parse_bool(const char* text, bool* value)
{
    static const char* const yes[] = {"true", "on", "yes", "1"};
    static const char* const no[] = {"false", "off", "no", "0"};
    for (int i = 0; i < 4; i++) {
        if (strcmp(text, yes[i]) == 0) return *value = true, true;
        if (strcmp(text, no[i]) == 0) return *value = false, true;
    }
    return false;
}

static bool parse_choice(const char* choices, const char* text, uint32_t* index)
{
    size_t length = strlen(text);
    uint32_t i = 0;
    for (const char* p = choices; p; i++) {
        const char* end = strchr(p, '|');
        size_t n = end ? (size_t)(end - p) : strlen(p);
        if (n == length && memcmp(p, text, n) == 0) return *index = i, true;
        p = end ? end + 1 : NULL;
    }
    return false;
}

static uint32_t choice_count(const char* choices)
{
    uint32_t count = 1;
    for (const char* p = choices; *p; p++) count += *p == '|';
    return count;
}

static bool parse_value(const es_setting* setting, const char* text, setting_value* value)
{
    double number;
    switch (setting->type) {
    case ES_SETTING_BOOL: return parse_bool(text, &value->b);
    case ES_SETTING_CHOICE: return parse_choice(setting->choices, text, &value->u);
    case ES_SETTING_INT:
        if (!parse_number(text, &number) || number < setting->minimum || number > setting->maximum || number < 0 || number > 4294967295.0)
            return false;
        value->u = (uint32_t)number;
        return (double)value->u == number;
    case ES_SETTING_FLOAT:
        if (!parse_number(text, &number) || number < setting->minimum || number > setting->maximum) return false;
        value->f = (float)number;
        return true;
    }
    return false;
}

static void store_value(const es_setting* setting, void* settings, setting_value value)
{
    char* at = (char*)settings + setting->offset;
    if (setting->type == ES_SETTING_BOOL) memcpy(at, &value.b, sizeof value.b);
    else if (setting->type == ES_SETTING_FLOAT) memcpy(at, &value.f, sizeof value.f);
    else memcpy(at, &value.u, sizeof value.u);
}

static setting_value load_value(const es_setting* setting, const void* settings)
{
    const char* at = (const char*)settings + setting->offset;
    setting_value value = {0};
    if (setting->type == ES_SETTING_BOOL) value.b = *(const unsigned char*)at != 0;
    else if (setting->type == ES_SETTING_FLOAT) memcpy(&value.f, at, sizeof value.f);
    else memcpy(&value.u, at, sizeof value.u);
    return value;
}

static es_result refuse_value(es_context* context, const es_setting* setting, const char* text)
{
    char low[32], high[32];
    switch (setting->type) {
    case ES_SETTING_BOOL: return es_fail(context, ES_SETTING_VALUE, "setting %s: '%.64s' is not true or false", setting->name, text);
    case ES_SETTING_CHOICE:
        return es_fail(context, ES_SETTING_VALUE, "setting %s: '%.64s' is not one of %s", setting->name, text, setting->choices);
    case ES_SETTING_INT:
        return es_fail(context, ES_SETTING_VALUE, "setting %s: '%.64s' is not a whole number from %.0f to %.0f", setting->name, text,
            setting->minimum, setting->maximum);
    case ES_SETTING_FLOAT: break;
    }
    print_float(low, sizeof low, (float)setting->minimum);
    print_float(high, sizeof high, (float)setting->maximum);
    return es_fail(context, ES_SETTING_VALUE, "setting %s: '%.64s' is not a number from %s to %s", setting->name, text, low, high);
}

void es_settings_defaults(const es_setting* table, size_t count, void* settings)
{
    for (size_t i = 0; i < count; i++) {
        setting_value value = {0};
        if (parse_value(&table[i], table[i].default_text, &value)) store_value(&table[i], settings, value);
    }
}

es_result es_settings_set(es_context* context, const es_setting* table, size_t count, void* settings, const char* name, const char* value)
{
    if (!settings || !name || !value) return es_misuse(context, ES_INVALID_ARGUMENT, "setting: the struct, the name and the value must not be NULL");
    const es_setting* setting = es_settings_find(table, count, name);
    if (!setting)
        return es_fail(context, ES_SETTING_UNKNOWN, "no setting is named '%.64s'; the nearest is '%s'", name, es_settings_nearest(&table, &count, 1, name));
    setting_value parsed = {0};
    if (!parse_value(setting, value, &parsed)) return refuse_value(context, setting, value);
    store_value(setting, settings, parsed);
    return ES_OK;
}

bool es_settings_get(const es_setting* setting, const void* settings, char* text, size_t size)
{
    setting_value value = load_value(setting, settings);
    char number[64];
    const char* from = number;
    size_t length;
    switch (setting->type) {
    case ES_SETTING_BOOL: from = value.b ? "true" : "false"; break;
    case ES_SETTING_INT: snprintf(number, sizeof number, "%lu", (unsigned long)value.u); break;
    case ES_SETTING_FLOAT: print_float(number, sizeof number, value.f); break;
    case ES_SETTING_CHOICE:
        from = setting->choices;
        for (uint32_t i = 0; i < value.u && from; i++) {
            from = strchr(from, '|');
            if (from) from++;
        }
        if (!from) return false;
        break;
    }
    length = setting->type == ES_SETTING_CHOICE ? strcspn(from, "|") : strlen(from);
    if (length >= size) return false;
    memcpy(text, from, length);
    text[length] = '\0';
    return true;
}

es_result es_settings_check(es_context* context, const es_setting* table, size_t count, const void* settings)
{
    for (size_t i = 0; i < count; i++) {
        const es_setting* setting = &table[i];
        setting_value value = load_value(setting, settings);
        bool good = true;
        /* the bounds are rounded like the value, so that a bound itself is always inside */
        if (setting->type == ES_SETTING_FLOAT) good = value.f >= (float)setting->minimum && value.f <= (float)setting->maximum;
        if (setting->type == ES_SETTING_INT) good = (double)value.u >= setting->minimum && (double)value.u <= setting->maximum;
        if (setting->type == ES_SETTING_CHOICE) good = value.u < choice_count(setting->choices);
        if (!good) {
            char text[64];
            if (setting->type == ES_SETTING_FLOAT) snprintf(text, sizeof text, "%g", (double)value.f);
            else snprintf(text, sizeof text, "%lu", (unsigned long)value.u);
            return refuse_value(context, setting, text);
        }
    }
    return ES_OK;
}
