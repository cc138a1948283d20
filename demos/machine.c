/* The machine a figure was measured on, as JSON: without it a number means nothing. */
#include "demo.h"
#include "demo_build.h"

#include <string.h>
#include <time.h>
#include <unistd.h>

double demo_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void demo_processor_name(char* name, size_t size)
{
    snprintf(name, size, "unknown");
    FILE* file = fopen("/proc/cpuinfo", "r");
    if (!file) return;
    char line[512];
    while (fgets(line, sizeof line, file)) {
        char* colon = strchr(line, ':');
        /* x86 writes "model name"; ARM kernels name the part by number only, or "Hardware" on small boards. */
        if (!colon || (strncmp(line, "model name", 10) != 0 && strncmp(line, "Hardware", 8) != 0)) continue;
        char* value = colon + 1 + strspn(colon + 1, " \t");
        value[strcspn(value, "\n")] = 0;
        snprintf(name, size, "%s", value);
        break;
    }
    fclose(file);
}

void demo_text_add_machine(demo_text* text, const es_context* context)
{
    char processor[256];
    demo_processor_name(processor, sizeof processor);
    demo_text_add(text, "{\"processor\":");
    demo_text_add_json_string(text, processor);
    demo_text_add(text, ",\"isa\":\"%s\",\"threads\":%u,\"compiler\":", es_isa_name(es_context_isa(context)),
        es_context_resolved_desc(context).threads);
    demo_text_add_json_string(text, DEMO_COMPILER);
    demo_text_add(text, ",\"commit\":");
    demo_text_add_json_string(text, DEMO_COMMIT);
    demo_text_add(text, ",\"flags\":");
    demo_text_add_json_string(text, DEMO_FLAGS);
    demo_text_add(text, ",\"version\":\"%d.%d.%d\"}", ES_VERSION_MAJOR, ES_VERSION_MINOR, ES_VERSION_PATCH);
}

void demo_date(char date[32])
{
    time_t now = time(NULL);
    struct tm parts;
    date[0] = 0;
    if (gmtime_r(&now, &parts)) strftime(date, 32, "%Y-%m-%d %H:%M UTC", &parts);
}

void demo_text_add_machine_line(demo_text* text, const es_context* context)
{
    char processor[256], date[32];
    demo_processor_name(processor, sizeof processor);
    demo_date(date);
    demo_text_add(text, "%s, %ld processors online · instruction set %s · %u threads · compiler %s · commit %s · version %d.%d.%d · %s · flags %s", processor,
        sysconf(_SC_NPROCESSORS_ONLN), es_isa_name(es_context_isa(context)), es_context_resolved_desc(context).threads, DEMO_COMPILER, DEMO_COMMIT, ES_VERSION_MAJOR,
        ES_VERSION_MINOR, ES_VERSION_PATCH, date, DEMO_FLAGS);
}
