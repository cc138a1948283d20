/* Output files: names with a frame number, refusals before the work, nothing half-written. */
#include "demo.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

bool demo_has_image_ending(const char* path)
{
    const char* dot = strrchr(path, '.');
    return dot && (!strcasecmp(dot, ".exr") || !strcasecmp(dot, ".png") || !strcasecmp(dot, ".hdr"));
}

/* Length of the conversion at `percent` ("%d" or "%0Nd" with N one digit), 0 when it is not one. */
static size_t conversion_length(const char* percent)
{
    if (percent[1] == 'd') return 2;
    if (percent[1] == '0' && percent[2] >= '1' && percent[2] <= '9' && percent[3] == 'd') return 4;
    return 0;
}

int demo_check_numbers(const char* option, const char* pattern, unsigned* numbers)
{
    if (strlen(pattern) > DEMO_PATH_SIZE - 64) return demo_refuse("%s: the name is longer than %d bytes", option, DEMO_PATH_SIZE - 64);
    unsigned found = 0;
    for (const char* c = pattern; *c; c++) {
        if (*c != '%') continue;
        if (c[1] == '%') {
            c++;
            continue;
        }
        size_t length = conversion_length(c);
        if (!length)
            return demo_refuse("%s %s: after %% only d or 0Nd (N from 1 to 9) may stand for the frame's number, %%%% for a percent sign", option, pattern);
        found++;
        c += length - 1;
    }
    if (found > 1) return demo_refuse("%s %s: one frame number at most", option, pattern);
    *numbers += found;
    return DEMO_OK;
}

int demo_check_pattern(const char* option, const char* pattern, uint32_t frames)
{
    unsigned numbers = 0;
    if (!demo_has_image_ending(pattern)) return demo_refuse("%s %s: the name must end in .exr, .png or .hdr", option, pattern);
    if (demo_check_numbers(option, pattern, &numbers) != DEMO_OK) return DEMO_BAD_INPUT;
    if (!numbers && frames > 1) return demo_refuse("%s %s: %u frames would overwrite one file; put %%04d into the name", option, pattern, frames);
    return DEMO_OK;
}

void demo_expand_pattern(const char* pattern, uint32_t frame, char path[DEMO_PATH_SIZE])
{
    size_t at = 0;
    for (const char* c = pattern; *c && at < DEMO_PATH_SIZE - 16; c++) {
        size_t length = *c == '%' ? conversion_length(c) : 0;
        if (length) {
            at += (size_t)snprintf(path + at, DEMO_PATH_SIZE - at, "%0*u", length == 4 ? c[2] - '0' : 1, frame);
            c += length - 1;
        } else {
            path[at++] = *c;
            if (*c == '%') c++;
        }
    }
    path[at] = 0;
}

int demo_check_writable(const char* path)
{
    struct stat status;
    if (!path[0]) return demo_refuse("an output file's name is empty");
    if (stat(path, &status) == 0 && !S_ISREG(status.st_mode))
        return demo_refuse("%s: exists and is not a file; name a file", path);
    char directory[DEMO_PATH_SIZE], probe[DEMO_PATH_SIZE + 64];
    snprintf(directory, sizeof directory, "%s", path);
    char* slash = strrchr(directory, '/');
    const char* name = slash ? slash + 1 : directory;
    if (!*name) return demo_refuse("%s: names a directory; name a file", path);
    if (strlen(name) > 200) return demo_refuse("%s: the file's name is longer than 200 bytes", path);
    if (slash)
        slash[slash == directory] = 0;
    else
        snprintf(directory, sizeof directory, ".");
    if (stat(directory, &status) != 0) return demo_refuse("%s: there is no directory %s", path, directory);
    if (!S_ISDIR(status.st_mode)) return demo_refuse("%s: %s is not a directory", path, directory);
    if (access(path, F_OK) == 0 && access(path, W_OK) != 0)
        return demo_refuse("%s: cannot be written: %s", path, strerror(errno));
    /* access() says yes to root on much that cannot be written, so a file is tried. */
    snprintf(probe, sizeof probe, "%s/.earthshine-%ld", directory, (long)getpid());
    int file = open(probe, O_CREAT | O_EXCL | O_WRONLY, 0600);
    if (file < 0) return demo_refuse("%s: cannot be written: %s", path, strerror(errno));
    close(file);
    unlink(probe);
    return DEMO_OK;
}

es_image_save_desc demo_save_desc(void) { return (es_image_save_desc){.sample_type = ES_SAMPLE_FLOAT}; }

int demo_write_text(const char* path, const char* text, size_t size)
{
    char temporary[DEMO_PATH_SIZE + 32];
    snprintf(temporary, sizeof temporary, "%s.tmp%ld", path, (long)getpid());
    FILE* file = fopen(temporary, "wb");
    bool written = file && fwrite(text, 1, size, file) == size;
    if (file && fclose(file) != 0) written = false;
    if (written && rename(temporary, path) == 0) return DEMO_OK;
    int error = errno;
    if (file) unlink(temporary);
    return demo_refuse("%s: cannot be written: %s", path, strerror(error));
}
