/* `earthshine play` without a window: the frames go to files, and one line says where. */
#include "player.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* A scene's name or a file's stem, with letters that suit every file system. */
void play_stem(const char* scene, char stem[64])
{
    const char* slash = strrchr(scene, '/');
    snprintf(stem, 64, "%s", slash ? slash + 1 : scene);
    char* dot = strrchr(stem, '.');
    if (dot && dot != stem) *dot = 0;
    for (char* c = stem; *c; c++)
        if (!strchr("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-", *c)) *c = '_';
}

bool play_can_write_in(const char* directory)
{
    char probe[DEMO_PATH_SIZE + 32];
    snprintf(probe, sizeof probe, "%s/.earthshine-XXXXXX", directory);
    int file = mkstemp(probe);
    if (file < 0) return false;
    close(file);
    unlink(probe);
    return true;
}

/* ./frames where that can be written, otherwise a new directory for temporary files. */
static int choose_frames_directory(char directory[DEMO_PATH_SIZE])
{
    snprintf(directory, DEMO_PATH_SIZE, "./frames");
    if ((mkdir(directory, 0777) == 0 || errno == EEXIST) && play_can_write_in(directory)) return DEMO_OK;
    const char* temporary = getenv("TMPDIR");
    snprintf(directory, DEMO_PATH_SIZE, "%s/earthshine-XXXXXX", temporary && temporary[0] ? temporary : "/tmp");
    if (mkdtemp(directory)) return DEMO_OK;
    return demo_refuse("neither ./frames nor %s can be written: %s", directory, strerror(errno));
}

int play_to_files(const demo_options* given, const char* why)
{
    demo_options options = *given;
    char directory[DEMO_PATH_SIZE], pattern[DEMO_PATH_SIZE + 128], stem[64], first[DEMO_PATH_SIZE], last[DEMO_PATH_SIZE];
    if (!options.frames_given && !options.replay) options.end = 60; /* a replay has frames of its own */
    if (!options.size_given) {
        options.width = 640; /* sixty frames within a minute on a small machine */
        options.height = 480;
        options.size_given = true;
    }
    if (!options.out) {
        if (choose_frames_directory(directory) != DEMO_OK) return DEMO_BAD_INPUT;
        play_stem(options.scene ? options.scene : options.replay, stem);
        snprintf(pattern, sizeof pattern, "%s/%s-%%04d.png", directory, stem);
        for (char* c = pattern; c < pattern + strlen(directory); c++)
            if (*c == '%') return demo_refuse("%s: a directory with a percent sign cannot take frames", directory);
        options.out = pattern;
    }
    int code = demo_render_frames(&options, true);
    if (code != DEMO_OK) {
        if (!given->out) rmdir(directory); /* stays when it holds anything */
        return code;
    }
    demo_expand_pattern(options.out, options.first, first);
    char* path = realpath(first, NULL);
    const char* shown = path ? path : first;
    if (options.replay && !options.frames_given) {
        printf("%s%s replayed: %s and so on\n", why, options.replay, shown);
    } else {
        uint32_t frames = options.end - options.first;
        demo_expand_pattern(options.out, options.end - 1, last);
        const char* name = strrchr(last, '/') ? strrchr(last, '/') + 1 : last;
        printf("%s%u frame%s of %s rendered: %s%s%s\n", why, frames, frames > 1 ? "s" : "", options.scene ? options.scene : options.replay, shown,
            frames > 1 ? " to " : "", frames > 1 ? name : "");
    }
    free(path);
    return DEMO_OK;
}
