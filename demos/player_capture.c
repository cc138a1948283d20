/* Pictures kept: screenshots and sequences, without what lies over the picture. */
#include "player.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* ./pictures where that can be written, otherwise a new directory for temporary files. */
static bool choose_directory(player* p)
{
    player_capture* c = &p->capture;
    if (c->directory[0]) return true;
    snprintf(c->directory, sizeof c->directory, "./pictures");
    if ((mkdir(c->directory, 0777) == 0 || errno == EEXIST) && play_can_write_in(c->directory)) return true;
    const char* temporary = getenv("TMPDIR");
    snprintf(c->directory, sizeof c->directory, "%s/earthshine-XXXXXX", temporary && temporary[0] ? temporary : "/tmp");
    if (mkdtemp(c->directory)) return true;
    c->directory[0] = 0;
    player_notice(p, "neither ./pictures nor a temporary directory can be written");
    return false;
}

/* A name that nothing has yet: pictures of earlier runs stay. */
static void free_name(player* p, const char* ending, char path[DEMO_PATH_SIZE + 128])
{
    char stem[64];
    play_stem(p->scene, stem);
    do snprintf(path, DEMO_PATH_SIZE + 128, "%s/%s-%04u.%s", p->capture.directory, stem, ++p->capture.picture, ending);
    while (access(path, F_OK) == 0 && p->capture.picture < 9999);
}

static es_result save_canvas(player* p, const char* path)
{
    es_image image;
    es_result result = es_image_create(p->session.context, p->canvas.width, p->canvas.height, 3, &image);
    if (result != ES_OK) return result;
    for (size_t i = 0; i < (size_t)image.width * image.height; i++)
        for (int c = 0; c < 3; c++) image.pixels[3 * i + (size_t)c] = (float)(p->canvas.pixels[i] >> (16 - 8 * c) & 255) / 255.0f;
    es_image_save_desc desc = {.already_srgb = true};
    result = es_image_save(p->session.context, &image, path, &desc);
    es_image_destroy(p->session.context, &image);
    return result;
}

/* Of the displayed image the radiance before the tone map; of any other what it is. */
static es_result save_floats(player* p, const char* path)
{
    es_image image = {0};
    es_result result = es_renderer_image(p->session.renderer, p->image ? es_image_name(p->image) : "radiance", &image);
    if (result != ES_OK) return result;
    es_image_save_desc desc = demo_save_desc();
    result = es_image_save(p->session.context, &image, path, &desc);
    es_image_destroy(p->session.context, &image);
    return result;
}

void player_screenshot(player* p, bool exr)
{
    char path[DEMO_PATH_SIZE + 128];
    if (!choose_directory(p)) return;
    free_name(p, exr ? "exr" : "png", path);
    if (!exr) { /* of the next frame, before the panels are drawn over it */
        snprintf(p->capture.wanted, sizeof p->capture.wanted, "%s", path);
        return;
    }
    if (save_floats(p, path) == ES_OK) player_notice(p, "%s", path);
    else player_notice(p, "%s", es_context_message(p->session.context));
}

void player_toggle_sequence(player* p)
{
    player_capture* c = &p->capture;
    if (c->recording) {
        c->recording = false;
        player_notice(p, "%u frames: %s", c->frame, c->pattern);
        return;
    }
    char stem[64], first[DEMO_PATH_SIZE + 160];
    if (!choose_directory(p)) return;
    play_stem(p->scene, stem);
    do {
        snprintf(c->pattern, sizeof c->pattern, "%s/%s-%02u", c->directory, stem, ++c->sequence);
        snprintf(first, sizeof first, "%s-00000.png", c->pattern);
    } while (access(first, F_OK) == 0 && c->sequence < 99);
    c->recording = true;
    c->frame = 0;
}

void player_capture_frame(player* p)
{
    player_capture* c = &p->capture;
    if (c->wanted[0]) {
        es_result result = save_canvas(p, c->wanted);
        player_notice(p, "%s", result == ES_OK ? c->wanted : es_context_message(p->session.context));
        c->wanted[0] = 0;
    }
    if (!c->recording) return;
    char path[DEMO_PATH_SIZE + 160];
    snprintf(path, sizeof path, "%s-%05u.png", c->pattern, c->frame);
    if (save_canvas(p, path) == ES_OK) {
        c->frame++;
        return;
    }
    c->recording = false;
    player_notice(p, "%s", es_context_message(p->session.context));
}

/* A sequence is played at the frame rate it was rendered for, not at the pace of its making. */
float player_capture_step(const player* p) { return p->capture.recording ? (float)(1.0 / p->options.fps) : 0; }
