/* The earthshine program: finds the command, prints help. */
#include "demo.h"
#include "demo_build.h"

#include <string.h>

static const char usage[] =
    "usage:\n"
    "  earthshine scenes [--settings]                   list the built-in scenes, and the settings each is shown with\n"
    "  earthshine play   [SCENE|FILE.gltf|FILE.glb]     a window; H lists the keys\n"
    "  earthshine render SCENE|FILE --out PATTERN       headless: .exr .png .hdr; %04d takes the frame number\n"
    "             --size WxH --frames A:B (B not included; default 0:1) --fps N (30) --threads N (all)\n"
    "             --isa scalar|sse4|avx2|avx512|neon    instruction set to use; the result is the same\n"
    "             --no-skip                             do all work again in every frame; the result is the same\n"
    "             --gi none|ism|classic|vpl-traced|vpl-sampled|micro|second-order  direct light only, imperfect shadow maps, accurate ones (slow),\n"
    "                                                   rays to every light (slower) or to one a pixel, micro-buffers,\n"
    "                                                   lights without shadows and negative ones (fast, one matt bounce, leaks)\n"
    "             --set key=value …                     any setting\n"
    "             --image NAME                          which image (default: display)\n"
    "             --hash                                prints `frame N NAME HASH` per frame\n"
    "             --stats FILE.json                     milliseconds and counts per frame and pass\n"
    "             --record FILE                         keeps what happens: each step, what was done before it, hashes\n"
    "             --environment FILE                    light from all around, an EXR or HDR picture in lat-long; for --replay too\n"
    "             --environment-rotation RADIANS --environment-intensity X    turned about y, times X\n"
    "             --edits FILE                          reflection edits, in place of those the scene has\n"
    "             --replay FILE                         does it again; exit 1 and the first step and object that differ\n"
    "  earthshine reference SCENE|FILE --out FILE.exr   the truth by path tracing; .exr with all layers, .hdr, .png exposed as the scene is shown\n"
    "             --spp N --seconds S --error E         when to stop: samples per pixel, time, relRMSE by its own\n"
    "                                                   estimate; whichever comes first (256 samples when none is given)\n"
    "             --bounces N                           indirect bounces (1)\n"
    "             --resume FILE.exr                     goes on where that file stopped\n"
    "             --image NAME                          radiance, emission, direct, indirect, bounce-N, and -error of each\n"
    "             --size --frames --fps --threads --isa --set --hash --stats --environment… --edits as above\n"
    "  earthshine settings                              list the settings: name, default, range, meaning\n"
    "  earthshine images                                list the images a frame can give\n"
    "  earthshine compare A B                           error of A against the reference B, a `name value` a line: rmse relrmse\n"
    "                                                   relmse rell1 flip hdr_flip max; PNGs are compared as displayed\n"
    "             --max-NAME X                          exit 1 when that one is above X\n"
    "             --frames A:B                          A and B are sequences, as render's --out: means, the largest max, and\n"
    "                                                   flicker; --each prints every frame's too\n"
    "             --image NAME                          of files that hold several: direct, indirect, bounce-1 …\n"
    "             --diff OUT.png --scale X              where the error lies, in false colour, brightest at X\n"
    "             --map absolute|relative|signed|flip|hdr-flip    what --diff shows\n"
    "             --display-referred --threads N        0 … 1 as displayed, not radiance; all threads unless said\n"
    "  earthshine bench  [NAME …] [--out DIR]           measures: speed (default), error, ledger, bounces, micro, lamps, screen,\n"
    "                                                   compensation, second-order, combinations, reflections, edits,\n"
    "                                                   geodesic, glare, fft, scale, frame, moving, scenes, time, rays,\n"
    "                                                   dynamics, all;\n"
    "                                                   tables, JSON, CSV, SVG and one page, DIR/index.html\n"
    "             --threads N (2) --runs N (5) --only ROW --no-peer --quick\n"
    "             --scene NAME|FILE … --size WxH --spp N    what error and ledger look at, samples of their truths\n"
    "  earthshine soak   --scene S|all --seconds S (3600) --threads N --no-sleep    runs scenes without a picture; exit 1 when\n"
    "                                                   anything is no number, is lost, or gains energy\n"
    "  earthshine help | --version\n"
    "play takes render's options too; with --frames or --out it needs no window.\n";

typedef struct command {
    const char* name;
    int (*run)(int count, char** arguments);
} command;

static const command commands[] = {
    {"scenes", demo_scenes},
    {"play", demo_play},
    {"render", demo_render},
    {"reference", demo_reference},
    {"settings", demo_settings},
    {"images", demo_images},
    {"compare", demo_compare},
    {"bench", demo_bench},
    {"soak", demo_soak},
};
enum { COMMAND_COUNT = sizeof commands / sizeof commands[0] };

static bool asks_for_help(const char* argument) { return !strcmp(argument, "--help") || !strcmp(argument, "-h"); }

int main(int count, char** arguments)
{
    if (count < 2) {
        fputs(usage, stderr);
        return DEMO_BAD_INPUT;
    }
    const char* name = arguments[1];
    if (!strcmp(name, "help") || asks_for_help(name)) {
        fputs(usage, stdout);
        return DEMO_OK;
    }
    if (!strcmp(name, "--version")) {
        printf("earthshine %d.%d.%d (%s)\n", ES_VERSION_MAJOR, ES_VERSION_MINOR, ES_VERSION_PATCH, DEMO_COMMIT);
        return DEMO_OK;
    }
    for (int i = 0; i < COMMAND_COUNT; i++) {
        if (strcmp(commands[i].name, name) != 0) continue;
        for (int k = 2; k < count && strcmp(arguments[k], "--") != 0; k++)
            if (asks_for_help(arguments[k])) {
                fputs(usage, stdout);
                return DEMO_OK;
            }
        return commands[i].run(count - 2, arguments + 2);
    }
    const char* names[COMMAND_COUNT];
    for (int i = 0; i < COMMAND_COUNT; i++) names[i] = commands[i].name;
    const char* nearest = demo_nearest(name, names, COMMAND_COUNT);
    if (nearest) return demo_refuse("unknown command %s; did you mean %s?", name, nearest);
    return demo_refuse("unknown command %s; `earthshine help` lists all", name);
}
