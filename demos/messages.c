/* Messages of the program: one line on stderr each, and the name that was probably meant. */
#include "demo.h"

#include <stdarg.h>
#include <string.h>

int demo_refuse(const char* format, ...)
{
    char line[2048];
    va_list arguments;
    va_start(arguments, format);
    if (vsnprintf(line, sizeof line, format, arguments) < 0) line[0] = 0;
    va_end(arguments);
    for (char* c = line; *c; c++)
        if ((unsigned char)*c < ' ' || *c == 127) *c = '?'; /* one line, whatever an argument holds */
    fprintf(stderr, "earthshine: %s\n", line);
    return DEMO_BAD_INPUT;
}

int demo_refuse_context(const es_context* context)
{
    const char* message = context ? es_context_message(context) : "no context could be created";
    return demo_refuse("%s", message[0] ? message : es_result_text(es_context_last_result(context)));
}

static void log_warning(void* user, es_log_level level, es_result item, const char* message)
{
    (void)user;
    if (level == ES_LOG_WARNING) fprintf(stderr, "earthshine: warning: %s [%s]\n", message, es_result_name(item));
}

es_logger demo_logger(void) { return (es_logger){log_warning, NULL}; }

/* Levenshtein distance over the first 63 characters; names are shorter. */
static size_t edit_distance(const char* a, const char* b)
{
    enum { LONGEST = 63 };
    size_t n = strnlen(a, LONGEST), m = strnlen(b, LONGEST), row[LONGEST + 1];
    for (size_t j = 0; j <= m; j++) row[j] = j;
    for (size_t i = 1; i <= n; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= m; j++) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);
            if (row[j] + 1 < best) best = row[j] + 1;
            if (row[j - 1] + 1 < best) best = row[j - 1] + 1;
            diagonal = row[j];
            row[j] = best;
        }
    }
    return row[m];
}

/* "vpls" for what begins with "vpl.": the name of a group, for its first setting. */
static bool names_group(const char* name, const char* candidate)
{
    size_t length = strcspn(candidate, ".");
    return candidate[length] && strncmp(name, candidate, length) == 0 && !strcmp(name + length, "s");
}

const char* demo_nearest(const char* name, const char* const* candidates, size_t count)
{
    const char* nearest = NULL;
    const size_t length = strlen(name + strspn(name, "-"));
    size_t least = (length + 2) / 3 + 1; /* farther away than a third it is another word */
    for (size_t i = 0; i < count; i++) {
        size_t distance = edit_distance(name, candidates[i]);
        /* The part behind a group's prefix alone is a common slip: "size" for "ism.size". */
        const char* tail = strrchr(candidates[i], '.');
        if (tail && edit_distance(name, tail + 1) + 1 < distance) distance = edit_distance(name, tail + 1) + 1;
        if (names_group(name, candidates[i])) distance = 0;
        if (distance < least) {
            least = distance;
            nearest = candidates[i];
        }
    }
    return nearest;
}
