/* Rows as a table for people, JSON and CSV for programs, a page with a plot for the browser. */
#include "bench.h"

#include <math.h>
#include <string.h>

const char* bench_verdict(const bench_row* row)
{
    if (row->judge == BENCH_NONE) return "";
    bool ratio = row->judge == BENCH_RATIO_AT_LEAST;
    double figure = ratio ? row->ratio : row->value;
    if (isnan(figure)) return "";
    if (ratio ? figure >= row->aim : figure <= row->aim) return "aim";
    if (ratio ? figure >= row->must : figure <= row->must) return "must";
    return "missed";
}

static void number(char text[32], double value, const char* suffix)
{
    if (isnan(value))
        snprintf(text, 32, "-");
    else
        snprintf(text, 32, "%.4g%s", value, suffix);
}

void bench_print(const bench_row* rows, size_t count)
{
    printf("%-16s %10s %-8s %10s %8s %8s %8s  %-7s %s\n", "row", "value", "unit", "peer", "ratio", "must", "aim", "reached",
        "peer's name, notes");
    for (size_t i = 0; i < count; i++) {
        const bench_row* row = &rows[i];
        char value[32], peer[32], ratio[32], must[32] = "-", aim[32] = "-";
        const char* suffix = row->judge == BENCH_RATIO_AT_LEAST ? "x" : "";
        number(value, row->value, "");
        number(peer, row->peer_value, "");
        number(ratio, row->ratio, "x");
        if (row->judge != BENCH_NONE) {
            number(must, row->must, suffix);
            number(aim, row->aim, suffix);
        }
        printf("%-16s %10s %-8s %10s %8s %8s %8s  %-7s %s%s%s\n", row->id, value, row->unit, peer, ratio, must, aim,
            bench_verdict(row), row->peer ? row->peer : "", row->peer && row->note[0] ? "; " : "", row->note);
    }
    fflush(stdout);
}

static void add_json_number(demo_text* text, const char* key, double value)
{
    if (isfinite(value))
        demo_text_add(text, ",\"%s\":%.9g", key, value);
    else
        demo_text_add(text, ",\"%s\":null", key);
}

static void add_json(demo_text* text, const bench_row* rows, size_t count, const es_context* context)
{
    demo_text_add(text, "{\"machine\":");
    demo_text_add_machine(text, context);
    demo_text_add(text, ",\n\"rows\":[");
    for (size_t i = 0; i < count; i++) {
        const bench_row* row = &rows[i];
        demo_text_add(text, "%s\n{\"id\":\"%s\"", i ? "," : "", row->id);
        add_json_number(text, "value", row->value);
        demo_text_add(text, ",\"unit\":\"%s\",\"peer\":", row->unit);
        if (row->peer)
            demo_text_add_json_string(text, row->peer);
        else
            demo_text_add(text, "null");
        add_json_number(text, "peer_value", row->peer_value);
        add_json_number(text, "ratio", row->ratio);
        add_json_number(text, "must", row->judge == BENCH_NONE ? NAN : row->must);
        add_json_number(text, "aim", row->judge == BENCH_NONE ? NAN : row->aim);
        demo_text_add(text, ",\"reached\":\"%s\",\"work\":", bench_verdict(row));
        demo_text_add_json_string(text, row->work);
        demo_text_add(text, ",\"note\":");
        demo_text_add_json_string(text, row->note);
        demo_text_add(text, "}");
    }
    demo_text_add(text, "\n]}\n");
}

static void add_csv_number(demo_text* text, double value)
{
    if (isfinite(value))
        demo_text_add(text, ",%.9g", value);
    else
        demo_text_add(text, ",");
}

static void add_csv(demo_text* text, const bench_row* rows, size_t count)
{
    demo_text_add(text, "id,value,unit,peer,peer_value,ratio,must,aim,reached\n");
    for (size_t i = 0; i < count; i++) {
        const bench_row* row = &rows[i];
        demo_text_add(text, "%s", row->id);
        add_csv_number(text, row->value);
        demo_text_add(text, ",%s,\"%s\"", row->unit, row->peer ? row->peer : "");
        add_csv_number(text, row->peer_value);
        add_csv_number(text, row->ratio);
        add_csv_number(text, row->judge == BENCH_NONE ? NAN : row->must);
        add_csv_number(text, row->judge == BENCH_NONE ? NAN : row->aim);
        demo_text_add(text, ",%s\n", bench_verdict(row));
    }
}

static void add_html(demo_text* text, const char* name, const bench_row* rows, size_t count, const es_context* context)
{
    demo_text_add(text,
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Earthshine: bench %s</title>\n"
        "<style>body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:66em;padding:0 "
        "1em;color:#222}table{border-collapse:collapse;width:100%%}"
        "th,td{text-align:left;padding:.3em .6em;border-bottom:1px solid "
        "#ddd}td.n{text-align:right;font-variant-numeric:tabular-nums}"
        ".aim{color:#07703a}.must{color:#8a6100}.missed{color:#b3261e}pre{white-space:pre-wrap;color:#555}svg{width:100%%;height:"
        "auto}</style>\n"
        "<h1>bench %s</h1>\n",
        name, name);
    bench_add_svg(text, rows, count);
    demo_text_add(text, "<table><tr><th>row<th>work<th>value<th>peer<th>ratio<th>must<th>aim<th>reached</tr>\n");
    for (size_t i = 0; i < count; i++) {
        const bench_row* row = &rows[i];
        const char* suffix = row->judge == BENCH_RATIO_AT_LEAST ? "x" : "";
        char value[32], peer[32], ratio[32], must[32] = "-", aim[32] = "-";
        number(value, row->value, "");
        number(peer, row->peer_value, "");
        number(ratio, row->ratio, "x");
        if (row->judge != BENCH_NONE) {
            number(must, row->must, suffix);
            number(aim, row->aim, suffix);
        }
        demo_text_add(text,
            "<tr><td>%s<td>%s%s%s<td class=n>%s %s<td class=n title=\"%s\">%s<td class=n>%s<td class=n>%s<td class=n>%s<td "
            "class=\"%s\">%s</tr>\n",
            row->id, row->work, row->note[0] ? "<br><small>" : "", row->note, value, row->unit, row->peer ? row->peer : "", peer,
            ratio, must, aim, bench_verdict(row), bench_verdict(row));
    }
    demo_text_add(text, "</table>\n<pre>");
    demo_text_add_machine(text, context);
    demo_text_add(text, "</pre></html>\n");
}

int bench_write(const char* name, const bench_options* options, const bench_row* rows, size_t count, const es_context* context)
{
    if (!options->out) return DEMO_OK;
    static const char* const endings[] = {"json", "csv", "svg", "html"};
    int code = DEMO_OK;
    for (int i = 0; i < 4 && code == DEMO_OK; i++) {
        demo_text text = {0};
        char path[DEMO_PATH_SIZE];
        snprintf(path, sizeof path, "%s/%s.%s", options->out, name, endings[i]);
        if (i == 0) add_json(&text, rows, count, context);
        if (i == 1) add_csv(&text, rows, count);
        if (i == 2) bench_add_svg(&text, rows, count);
        if (i == 3) add_html(&text, name, rows, count, context);
        code = text.failed ? demo_refuse("%s: out of memory", path) : demo_write_text(path, text.bytes, text.size);
        demo_text_free(&text);
    }
    return code;
}
