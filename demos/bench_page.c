/* index.html: a section for each benchmark that ran into the folder. A run replaces its own section and keeps the others, so the
 * page is read back before it is written. It loads nothing: style and drawings stand in it, and it needs no script. */
#include "bench.h"

#include <stdlib.h>
#include <string.h>

static const char head[] =
    "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"/>\n"
    "<title>Earthshine: benchmarks</title>\n<style>\n"
    "body{font:16px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif;margin:0 auto;max-width:60rem;padding:2rem 1.2rem 5rem;color:#1c1c1c;background:#fbfbf9}\n"
    "h1{font-size:2rem;margin:0 0 .3rem;letter-spacing:-.01em}h2{font-size:1.5rem;margin:4.5rem 0 .4rem;padding-top:1rem;border-top:3px solid #1c1c1c}\n"
    "h3{font-size:1.12rem;line-height:1.35;margin:0 0 .7rem}section>h3{margin:2.6rem 0 .7rem}\n"
    "figure{margin:2rem 0;padding:1.1rem 1.3rem;background:#fff;border:1px solid #e4e4e0;border-radius:8px}\n"
    "svg{display:block;width:100%;height:auto}figcaption{color:#555;font-size:.9rem;margin-top:.6rem}\n"
    "nav ul{list-style:none;padding:0;margin:1.4rem 0}nav li{margin:.55rem 0}nav a{color:inherit;text-decoration:none;display:block;padding:.6rem .9rem;background:#fff;border:1px solid "
    "#e4e4e0;border-left:5px solid #0072b2;border-radius:6px}nav a:hover{border-color:#0072b2}nav b{display:inline-block;min-width:4.5rem}\n"
    ".machine{color:#555;font-size:.82rem;overflow-wrap:anywhere}\n"
    "table{border-collapse:collapse;width:100%;font-size:.88rem}th,td{text-align:left;vertical-align:top;padding:.32rem .6rem;border-bottom:1px solid #e4e4e0}th{color:#555;font-weight:600}\n"
    ".n{text-align:right;font-variant-numeric:tabular-nums}small{color:#666}code{font-size:.92em}\n"
    ".aim{color:#006b4e;font-weight:600}.must{color:#855b00;font-weight:600}.missed{color:#a84600;font-weight:600}\n"
    "details{margin-top:.7rem;font-size:.9rem;overflow-x:auto}summary{cursor:pointer;color:#005a8e}\n"
    "</style></head>\n<body>\n<header><h1>Earthshine: what it costs and how wrong it is</h1>\n"
    "<p>Every figure here was measured by <code>earthshine bench</code>. Rest the pointer on a mark or a bar to see what it is; the numbers are folded below each plot.</p>\n";

/* The text of a section in an earlier page, between its two comments; NULL when there is none. */
static char* find_section(const char* page, const char* name)
{
    char begin[96], end[96];
    snprintf(begin, sizeof begin, "<!-- section %s -->\n", name);
    snprintf(end, sizeof end, "<!-- end %s -->\n", name);
    const char* from = page ? strstr(page, begin) : NULL;
    const char* to = from ? strstr(from, end) : NULL;
    return to ? strndup(from + strlen(begin), (size_t)(to - from) - strlen(begin)) : NULL;
}

static char* read_page(const char* path)
{
    enum { MOST = 64 << 20 };
    FILE* file = fopen(path, "rb");
    if (!file) return NULL;
    char* page = NULL;
    long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    if (size > 0 && size < MOST && fseek(file, 0, SEEK_SET) == 0 && (page = malloc((size_t)size + 1)) != NULL) page[fread(page, 1, (size_t)size, file)] = 0;
    fclose(file);
    return page;
}

static void add_entry(demo_text* text, const char* name, const char* section)
{
    static const char key[] = "data-finding=\"";
    const char* finding = strstr(section, key);
    size_t length = finding ? strcspn(finding + strlen(key), "\"") : 0;
    demo_text_add(text, "<li><a href=\"#%s\"><b>%s</b> %.*s</a></li>\n", name, name, (int)length, finding ? finding + strlen(key) : "");
}

int bench_write_page(const char* directory, const char* name, const demo_text* section)
{
    char path[DEMO_PATH_SIZE];
    snprintf(path, sizeof path, "%s/index.html", directory);
    if (section->failed) return demo_refuse("%s: out of memory", path);
    char* earlier = read_page(path);
    demo_text entries = {0}, sections = {0}, page = {0};
    const char* known;
    for (size_t i = 0; (known = bench_name(i)) != NULL; i++) {
        char* kept = strcmp(known, name) ? find_section(earlier, known) : NULL;
        const char* text = strcmp(known, name) ? kept : section->bytes;
        if (text) {
            add_entry(&entries, known, text);
            demo_text_add(&sections, "<!-- section %s -->\n%s<!-- end %s -->\n", known, text, known);
        }
        free(kept);
    }
    demo_text_add(&page, "%s<nav><ul>\n%s</ul></nav></header>\n%s</body></html>\n", head, entries.bytes ? entries.bytes : "", sections.bytes ? sections.bytes : "");
    bool failed = entries.failed || sections.failed || page.failed;
    int code = failed ? demo_refuse("%s: out of memory", path) : demo_write_text(path, page.bytes, page.size);
    demo_text_free(&entries);
    demo_text_free(&sections);
    demo_text_free(&page);
    free(earlier);
    return code;
}
