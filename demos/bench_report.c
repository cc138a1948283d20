/* What a benchmark leaves: rows as a table for people, JSON and CSV for programs, plots, a section of the page. */
#include "bench.h"

#include <math.h>
#include <string.h>

const char* bench_verdict(const bench_row* row)
{
    if (row->judge == BENCH_NONE) return "";
    bool ratio = row->judge == BENCH_RATIO_AT_LEAST;
    double figure = ratio ? row->ratio : row->value;
    if (isnan(figure)) return "";
    bool most = row->judge == BENCH_VALUE_AT_MOST;
    if (most ? figure <= row->aim : figure >= row->aim) return "aim";
    if (most ? figure <= row->must : figure >= row->must) return "must";
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

static void add_json(demo_text* text, const bench_report* report, const bench_row* rows, size_t count, const es_context* context)
{
    char date[32];
    demo_date(date);
    demo_text_add(text, "{\"machine\":");
    demo_text_add_machine(text, context);
    demo_text_add(text, ",\n\"date\":\"%s\",\n\"rows\":[", date);
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
    demo_text_add(text, "\n],\n\"plots\":[");
    for (size_t i = 0; i < report->plot_count; i++) {
        demo_text_add(text, "%s\n{\"id\":\"%s\",\"headline\":", i ? "," : "", report->plots[i].id);
        demo_text_add_json_string(text, report->plots[i].headline);
        demo_text_add(text, "}");
    }
    demo_text_add(text, "\n]%s}\n", report->members.size ? report->members.bytes : "");
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

/* ---- the page's section ------------------------------------------------------------------------------------------ */

static void add_rows_table(demo_text* text, const bench_row* rows, size_t count)
{
    demo_text_add(text, "<table><thead><tr><th>row</th><th>work</th><th class=\"n\">value</th><th class=\"n\">peer</th><th class=\"n\">ratio</th>"
                        "<th class=\"n\">must</th><th class=\"n\">aim</th><th>reached</th></tr></thead><tbody>\n");
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
        demo_text_add(text, "<tr><td><code>%s</code></td><td>", row->id);
        plot_add_escaped(text, row->work);
        demo_text_add(text, "%s", row->note[0] ? "<br/><small>" : "");
        plot_add_escaped(text, row->note);
        demo_text_add(text, "%s</td><td class=\"n\">%s %s</td><td class=\"n\">%s", row->note[0] ? "</small>" : "", value, row->unit, peer);
        if (row->peer) {
            demo_text_add(text, "<br/><small>");
            plot_add_escaped(text, row->peer);
            demo_text_add(text, "</small>");
        }
        demo_text_add(text, "</td><td class=\"n\">%s</td><td class=\"n\">%s</td><td class=\"n\">%s</td><td class=\"%s\">%s</td></tr>\n", ratio, must, aim,
            bench_verdict(row), bench_verdict(row));
    }
    demo_text_add(text, "</tbody></table>\n");
}

typedef struct verdicts {
    unsigned targets, measured, aim, must, missed;
} verdicts;

static verdicts count_verdicts(const bench_row* rows, size_t count)
{
    verdicts v = {0};
    for (size_t i = 0; i < count; i++) {
        const char* verdict = bench_verdict(&rows[i]);
        v.targets += rows[i].judge != BENCH_NONE;
        v.measured += verdict[0] != 0;
        v.aim += !strcmp(verdict, "aim");
        v.must += !strcmp(verdict, "must");
        v.missed += !strcmp(verdict, "missed");
    }
    return v;
}

static void describe_verdicts(const verdicts* v, char text[200])
{
    if (!v->measured) {
        snprintf(text, 200, "None of %u targets was measured", v->targets);
        return;
    }
    int length = snprintf(text, 200, "%u of %u targets reach their aim", v->aim, v->targets);
    if (v->must) length += snprintf(text + length, 200 - (size_t)length, ", %u the must", v->must);
    if (v->missed) length += snprintf(text + length, 200 - (size_t)length, ", %u %s missed", v->missed, v->missed == 1 ? "is" : "are");
    if (v->measured < v->targets)
        snprintf(text + length, 200 - (size_t)length, ", %u %s not measured", v->targets - v->measured, v->targets - v->measured == 1 ? "was" : "were");
}

static void add_section(demo_text* text, const bench_report* report, const bench_row* rows, size_t count, const es_context* context)
{
    demo_text machine = {0};
    demo_text_add_machine_line(&machine, context);
    demo_text_add(text, "<section id=\"%s\" data-finding=\"", report->name);
    plot_add_escaped(text, report->finding);
    demo_text_add(text, "\">\n<h2>");
    plot_add_escaped(text, report->title);
    demo_text_add(text, "</h2>\n");
    if (report->about) {
        demo_text_add(text, "<p>");
        plot_add_escaped(text, report->about);
        demo_text_add(text, "</p>\n");
    }
    demo_text_add(text, "<p class=\"machine\">");
    plot_add_escaped(text, machine.bytes ? machine.bytes : "");
    demo_text_add(text, "</p>\n%s", report->figures.bytes ? report->figures.bytes : "");
    if (count) {
        enum { FEW_ROWS = 24 };
        demo_text_add(text, count > FEW_ROWS ? "<details><summary>All rows of bench %s</summary>\n" : "<h3>All rows of bench %s</h3>\n", report->name);
        add_rows_table(text, rows, count);
        if (count > FEW_ROWS) demo_text_add(text, "</details>\n");
    }
    demo_text_add(text, "</section>\n");
    text->failed |= machine.failed;
    demo_text_free(&machine);
}

/* ---- plots ------------------------------------------------------------------------------------------------------- */

/* A drawing on its own carries its headline, in as many lines as it takes. */
static void add_lone_svg(demo_text* text, const char* headline, const char* svg)
{
    enum { LINE_WIDTH = 850, FONT = 16, LINE_HEIGHT = 22 };
    double width = 880, height = 500;
    sscanf(svg, "<svg viewBox=\"0 0 %lf %lf\"", &width, &height);
    demo_text lines = {0};
    int top = 26;
    char line[PLOT_HEADLINE_SIZE] = "";
    for (const char* word = headline; *word;) {
        size_t length = strcspn(word, " ");
        char longer[2 * PLOT_HEADLINE_SIZE];
        snprintf(longer, sizeof longer, "%s%s%.*s", line, line[0] ? " " : "", (int)length, word);
        bool full = line[0] && plot_text_width(longer, FONT) * 1.12 > LINE_WIDTH;
        if (full) {
            demo_text_add(&lines, "<text x=\"14\" y=\"%d\">", top);
            plot_add_escaped(&lines, line);
            demo_text_add(&lines, "</text>");
            top += LINE_HEIGHT;
            snprintf(line, sizeof line, "%.*s", (int)length, word);
        } else {
            snprintf(line, sizeof line, "%.*s", (int)sizeof line - 1, longer);
        }
        word += length + (word[length] == ' ');
    }
    demo_text_add(&lines, "<text x=\"14\" y=\"%d\">", top);
    plot_add_escaped(&lines, line);
    demo_text_add(&lines, "</text>");
    top += 14;
    demo_text_add(text,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %g %g\"><rect width=\"%g\" height=\"%g\" fill=\"#fff\"/>"
        "<g font-family=\"system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif\" font-size=\"%d\" font-weight=\"600\" fill=\"#111\">%s</g>\n<svg y=\"%d\" width=\"%g\" "
        "height=\"%g\"%s</svg>\n",
        width, height + top, width, height + top, FONT, lines.bytes ? lines.bytes : "", top, width, height, svg + strlen("<svg"));
    text->failed |= lines.failed;
    demo_text_free(&lines);
}

void bench_report_figure(bench_report* report, const char* id, const char* headline, const char* caption, demo_text* svg, demo_text* table, demo_text* csv)
{
    demo_text* page = &report->figures;
    demo_text_add(page, "<figure id=\"%s-%s\">\n<h3>", report->name, id);
    plot_add_escaped(page, headline);
    demo_text_add(page, "</h3>\n%s<figcaption>", svg->bytes ? svg->bytes : "");
    plot_add_escaped(page, caption);
    demo_text_add(page, "</figcaption>\n");
    if (table->bytes) demo_text_add(page, "<details><summary>the numbers</summary>\n%s</details>\n", table->bytes);
    demo_text_add(page, "</figure>\n");
    report->failed |= svg->failed || table->failed || csv->failed || page->failed;
    if (!report->finding[0]) snprintf(report->finding, sizeof report->finding, "%s", headline);
    if (report->plot_count < BENCH_MAX_PLOTS && svg->bytes) {
        size_t k = report->plot_count++;
        snprintf(report->plots[k].id, sizeof report->plots[k].id, "%s", id);
        snprintf(report->plots[k].headline, sizeof report->plots[k].headline, "%s", headline);
        add_lone_svg(&report->plots[k].svg, headline, svg->bytes);
        report->plots[k].csv = *csv;
        *csv = (demo_text){0};
    }
    demo_text_free(svg);
    demo_text_free(table);
    demo_text_free(csv);
}

void bench_report_curves(bench_report* report, const plot_curves* plot)
{
    demo_text svg = {0}, table = {0}, csv = {0};
    plot_curves_add_svg(&svg, plot);
    plot_curves_add_table(&table, plot);
    plot_curves_add_csv(&csv, plot);
    report->failed |= plot->failed;
    bench_report_figure(report, plot->id, plot->headline, plot->caption, &svg, &table, &csv);
}

void bench_report_bars(bench_report* report, const plot_bars* plot)
{
    demo_text svg = {0}, table = {0}, csv = {0};
    plot_bars_add_svg(&svg, plot);
    plot_bars_add_table(&table, plot);
    plot_bars_add_csv(&csv, plot);
    report->failed |= plot->failed;
    bench_report_figure(report, plot->id, plot->headline, plot->caption, &svg, &table, &csv);
}

static void add_targets(bench_report* report, const bench_row* rows, size_t count)
{
    verdicts v = count_verdicts(rows, count);
    if (!v.targets) return;
    demo_text svg = {0}, table = {0}, csv = {0};
    char headline[200];
    describe_verdicts(&v, headline);
    bench_add_svg(&svg, rows, count);
    report->failed |= svg.failed;
    bench_report_figure(report, "targets", headline,
        "One bar for each figure that was asked for, as long as it is times better than it must be: the dashed line is the must, the black mark the aim.", &svg, &table, &csv);
}

/* ---- files ------------------------------------------------------------------------------------------------------- */

static int write_file(const bench_options* options, const char* name, const char* ending, const demo_text* text)
{
    char path[DEMO_PATH_SIZE];
    snprintf(path, sizeof path, "%s/%s%s", options->out, name, ending);
    return text->failed ? demo_refuse("%s: out of memory", path) : demo_write_text(path, text->bytes, text->size);
}

static int write_all(bench_report* report, const bench_options* options, const bench_row* rows, size_t count, const es_context* context)
{
    demo_text json = {0}, csv = {0}, section = {0};
    add_targets(report, rows, count);
    add_json(&json, report, rows, count, context);
    add_csv(&csv, rows, count);
    add_section(&section, report, rows, count, context);
    section.failed |= report->failed;
    json.failed |= report->members.failed;
    int code = write_file(options, report->name, ".json", &json);
    if (code == DEMO_OK) code = write_file(options, report->name, ".csv", &csv);
    for (size_t i = 0; i < report->plot_count && code == DEMO_OK; i++) {
        char name[128];
        snprintf(name, sizeof name, "%s-%s", report->name, report->plots[i].id);
        code = write_file(options, name, ".svg", &report->plots[i].svg);
        if (code == DEMO_OK && report->plots[i].csv.bytes) code = write_file(options, name, ".csv", &report->plots[i].csv);
    }
    if (code == DEMO_OK) code = bench_write_page(options->out, report->name, &section);
    demo_text_free(&json);
    demo_text_free(&csv);
    demo_text_free(&section);
    return code;
}

void bench_report_free(bench_report* report)
{
    demo_text_free(&report->figures);
    demo_text_free(&report->members);
    for (size_t i = 0; i < report->plot_count; i++) {
        demo_text_free(&report->plots[i].svg);
        demo_text_free(&report->plots[i].csv);
    }
    report->plot_count = 0;
}

int bench_report_write(bench_report* report, const bench_options* options, const bench_row* rows, size_t count, const es_context* context)
{
    int code = options->out ? write_all(report, options, rows, count, context) : DEMO_OK;
    bench_report_free(report);
    return code;
}
