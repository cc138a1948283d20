/* Plots as SVG, without a script or a font to load: curves and points on plain or logarithmic axes, and stacked bars. Colours are
 * told apart by red-blind and green-blind eyes (Okabe and Ito 2008), shapes repeat what they say, names stand at the curves. */
#ifndef EARTHSHINE_DEMO_PLOT_H
#define EARTHSHINE_DEMO_PLOT_H

#include "demo.h"

enum { PLOT_COLOURS = 8, PLOT_MAX_SERIES = 24, PLOT_MAX_LINES = 6, PLOT_MAX_PARTS = 14, PLOT_NAME_SIZE = 96, PLOT_NOTE_SIZE = 200, PLOT_HEADLINE_SIZE = 700, PLOT_CAPTION_SIZE = 700 };

/* ---- curves (plot_curves.c) -------------------------------------------------------------------------------------- */

typedef struct plot_point {
    double x, y;
    bool front; /* set by plot_mark_front */
    char note[PLOT_NOTE_SIZE]; /* what stands behind the point: in its tooltip and in the table */
} plot_point;

typedef struct plot_series {
    char name[PLOT_NAME_SIZE];
    uint32_t colour; /* 0 … PLOT_COLOURS - 1; the marks' shape goes with it */
    bool line;       /* joined in order; otherwise single points */
    bool dashed;     /* a peer's, by custom: its line is dashed, its marks are hollow */
    bool competes;   /* for the Pareto front */
    plot_point* points;
    size_t count, capacity;
} plot_series;

typedef struct plot_rule { /* a line across the plot */
    bool vertical;
    double at;
    char name[PLOT_NAME_SIZE];
} plot_rule;

typedef struct plot_curves {
    const char* id;                    /* ends the names of its files: letters, digits, hyphens */
    char headline[PLOT_HEADLINE_SIZE]; /* the finding, computed from what is drawn */
    char caption[PLOT_CAPTION_SIZE];   /* what is drawn and how to read it */
    const char *x_name, *y_name;       /* with the unit */
    bool x_log, y_log;                 /* then what is not above zero is left out */
    plot_series series[PLOT_MAX_SERIES];
    size_t series_count;
    plot_rule rules[PLOT_MAX_LINES];
    size_t rule_count;
    bool failed; /* memory ran out */
} plot_curves;

/* The new series, to be filled; it stays where it is. The last one again when there are too many. */
plot_series* plot_add_series(plot_curves* plot, uint32_t colour, const char* name_format, ...) ES_PRINTF(3, 4);
/* Points that are not finite are left out. */
void plot_add_point(plot_curves* plot, plot_series* series, double x, double y, const char* note_format, ...) ES_PRINTF(5, 6);
void plot_add_rule(plot_curves* plot, bool vertical, double at, const char* name_format, ...) ES_PRINTF(4, 5);
/* Marks the points of competing series that no other such point beats in both x and y, where less is better. */
void plot_mark_front(plot_curves* plot);
/* y at x on a series whose x rise, straight in the logarithms of both; NaN outside of it. plot_x_at: x at y, the first crossing. */
double plot_y_at(const plot_series* series, double x);
double plot_x_at(const plot_series* series, double y);
/* d log y / d log x by least squares; NaN with fewer than two points. */
double plot_log_slope(const plot_series* series);
void plot_curves_free(plot_curves* plot);

/* ---- stacked bars (plot_bars.c) ---------------------------------------------------------------------------------- */

typedef struct plot_bar {
    char name[PLOT_NAME_SIZE];
    double parts[PLOT_MAX_PARTS]; /* negative ones are drawn leftwards from zero, NaN is none */
    double total;                 /* a mark of its own, for a total that was measured and not summed; NaN: none */
    char note[PLOT_NOTE_SIZE];
} plot_bar;

typedef struct plot_bars {
    const char* id;
    char headline[PLOT_HEADLINE_SIZE], caption[PLOT_CAPTION_SIZE];
    const char* value_name; /* with the unit */
    const char* total_name; /* what the marks of the totals are; NULL: none */
    const char* part_names[PLOT_MAX_PARTS];
    size_t part_count;
    plot_bar* bars;
    size_t bar_count, capacity;
    bool failed;
} plot_bars;

/* A bar of NaN parts and total; valid until the next is added. NULL when memory ran out. */
plot_bar* plot_add_bar(plot_bars* plot, const char* name_format, ...) ES_PRINTF(2, 3);
void plot_bars_free(plot_bars* plot);

/* ---- output ------------------------------------------------------------------------------------------------------ */

/* <svg …> … </svg>, to stand in a page. */
void plot_curves_add_svg(demo_text* text, const plot_curves* plot);
void plot_bars_add_svg(demo_text* text, const plot_bars* plot);
/* The same numbers as an HTML table and as CSV. */
void plot_curves_add_table(demo_text* text, const plot_curves* plot);
void plot_curves_add_csv(demo_text* text, const plot_curves* plot);
void plot_bars_add_table(demo_text* text, const plot_bars* plot);
void plot_bars_add_csv(demo_text* text, const plot_bars* plot);

/* ---- what the plots share (plot_svg.c) --------------------------------------------------------------------------- */

extern const char* const plot_colours[PLOT_COLOURS];      /* of marks and lines */
extern const char* const plot_text_colours[PLOT_COLOURS]; /* the same hues, dark enough to read on white */
void plot_open_svg(demo_text* text, double width, double height);
/* With &, <, > and quotation marks escaped: for HTML and SVG, in text and attributes. */
void plot_add_escaped(demo_text* text, const char* string);
void plot_add_csv_string(demo_text* text, const char* string);
/* Estimated, in pixels. */
double plot_text_width(const char* string, double font_size);
/* "0.05", "12.5", "10k", "1M" */
void plot_format_tick(char text[32], double value);
/* Three significant digits, never an exponent where it can be helped. */
void plot_format_value(char text[32], double value);

/* From numbers to pixels. */
typedef struct plot_axis {
    bool logarithmic;
    double low, high;      /* of the numbers */
    double begin, end;     /* pixels */
    double ticks[64];      /* with labels */
    size_t tick_count;
    double small_ticks[96];
    size_t small_tick_count;
} plot_axis;
/* Makes room beside low and high, and chooses the ticks; a range that is empty or not finite becomes 1 … 10. */
plot_axis plot_make_axis(bool logarithmic, double low, double high, double begin, double end);
double plot_position(const plot_axis* axis, double value);

#endif
