/* Image files by content (load) and by name (save).
 *
 * Loading reads the whole file first: every reader then works on bytes it can bound, and es_image_load_memory is the same
 * path. Saving writes to a name beside the target, opened exclusively, and renames it when everything is on disk.
 */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include "platform/image_files.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* 16384 × 16384 RGBA floats without compression are 4 GiB; nothing a renderer reads is larger. */
#define FILE_SIZE_MAX ((uint64_t)5 << 30)

/* strerror may use a static buffer and the locale. */
static const char* system_reason(int error)
{
    switch (error) {
    case ENOENT: return "no such file or folder";
    case EACCES: case EPERM: return "permission denied";
    case ENOTDIR: return "a part of the path is not a folder";
    case EISDIR: return "it is a folder";
    case ENOSPC: case EDQUOT: return "no space left on the device";
    case EROFS: return "the file system is read-only";
    case ENAMETOOLONG: return "the name is too long";
    case EMFILE: case ENFILE: return "too many open files";
    case ELOOP: return "too many symbolic links";
    case EFBIG: return "the file would be too large";
    case EIO: return "input/output error";
    default: return "the system refused it";
    }
}

/* ---- load ------------------------------------------------------------------------------------------------------------- */

static es_result read_source(es_context* context, const es_image_source* source, es_image* image)
{
    static const uint8_t exr[4] = {0x76, 0x2f, 0x31, 0x01}, png[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    static const char lfs[] = "version https://git-lfs";
    if (source->size == 0) return es_fail(context, ES_FILE_EMPTY, "'%s' is empty; OpenEXR, PNG and Radiance HDR are accepted", source->label);
    if (source->size >= sizeof exr && memcmp(source->bytes, exr, sizeof exr) == 0) return es_image_read_exr(context, source, image);
    if (source->size >= sizeof png && memcmp(source->bytes, png, sizeof png) == 0) return es_image_read_png(context, source, image);
    if (source->size >= 2 && memcmp(source->bytes, "#?", 2) == 0) return es_image_read_hdr(context, source, image);
    if (source->size >= sizeof lfs - 1 && memcmp(source->bytes, lfs, sizeof lfs - 1) == 0) {
        return es_fail(context, ES_FILE_TYPE, "'%s' is a Git LFS pointer, not the image it stands for; fetch the file with git lfs",
            source->label);
    }
    return es_fail(context, ES_FILE_TYPE, "'%s' is not an image of a known type; OpenEXR, PNG and Radiance HDR are accepted",
        source->label);
}

es_result es_image_load_memory(es_context* context, const void* bytes, size_t size, const char* label, es_image* image)
{
    if (!context) return ES_INVALID_ARGUMENT;
    if (!image || (!bytes && size)) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_load_memory: bytes and image must not be NULL");
    *image = (es_image){0};
    es_image_source source = {bytes, size, label && label[0] ? label : "memory"};
    es_fp_environment environment = es_fp_enter_untrapped();
    es_result result = read_source(context, &source, image);
    es_fp_leave(environment);
    return result;
}

static es_result read_open_file(es_context* context, FILE* file, const char* path, size_t size, es_image* image)
{
    uint8_t* bytes = es_allocate(context, size);
    if (!bytes) return es_context_last_result(context);
    es_result result;
    size_t got = fread(bytes, 1, size, file);
    if (got != size) result = es_fail(context, ES_FILE_READ, "reading '%s' stopped after %zu of %zu bytes", path, got, size);
    else result = es_image_load_memory(context, bytes, size, path, image);
    es_release(context, bytes, size);
    return result;
}

es_result es_image_load(es_context* context, const char* path, es_image* image)
{
    if (!context) return ES_INVALID_ARGUMENT;
    if (!path || !image) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_load: path and image must not be NULL");
    *image = (es_image){0};
    /* Without O_NONBLOCK opening a pipe would wait for a writer before it can be refused. */
    int descriptor = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor < 0) return es_fail(context, ES_FILE_NOT_FOUND, "cannot open '%s': %s", path, system_reason(errno));
    struct stat status;
    es_result result = ES_OK;
    if (fstat(descriptor, &status) != 0) result = es_fail(context, ES_FILE_READ, "cannot read '%s': %s", path, system_reason(errno));
    else if (S_ISDIR(status.st_mode)) result = es_fail(context, ES_FILE_READ, "'%s' is a folder; an image file is accepted", path);
    else if (!S_ISREG(status.st_mode)) result = es_fail(context, ES_FILE_READ, "'%s' is not a regular file", path);
    else if ((uint64_t)status.st_size > FILE_SIZE_MAX) {
        result = es_fail(context, ES_FILE_UNSUPPORTED, "'%s' has %llu bytes; image files up to 5 GiB are read", path,
            (unsigned long long)status.st_size);
    } else if (status.st_size == 0) {
        result = es_image_load_memory(context, "", 0, path, image);
    } else {
        FILE* file = fdopen(descriptor, "rb");
        if (file) {
            result = read_open_file(context, file, path, (size_t)status.st_size, image);
            fclose(file);
            return result;
        }
        result = es_fail(context, ES_FILE_READ, "cannot read '%s': %s", path, system_reason(errno));
    }
    close(descriptor);
    return result;
}

/* ---- save ------------------------------------------------------------------------------------------------------------- */

struct es_image_sink {
    FILE* file;
    int error;  /* errno of the first failure */
};

bool es_sink_failed(const es_image_sink* sink) { return sink->error != 0; }

bool es_sink_write(es_image_sink* sink, const void* bytes, size_t size)
{
    if (sink->error) return false;
    errno = 0;
    if (fwrite(bytes, 1, size, sink->file) != size) sink->error = errno ? errno : EIO;
    return !sink->error;
}

bool es_sink_write_at(es_image_sink* sink, const void* bytes, size_t size, uint64_t offset)
{
    if (sink->error) return false;
    /* Seeking flushes the buffer, so it is done only where the position differs. */
    if (ftello(sink->file) != (off_t)offset && fseeko(sink->file, (off_t)offset, SEEK_SET) != 0) {
        sink->error = errno ? errno : EIO;
        return false;
    }
    return es_sink_write(sink, bytes, size);
}

static bool ends_with(const char* path, const char* ending)
{
    size_t length = strlen(path), n = strlen(ending);
    if (length < n) return false;
    for (size_t i = 0; i < n; i++) {
        char c = path[length - n + i];
        if (c >= 'A' && c <= 'Z') c = (char)(c - 'A' + 'a');
        if (c != ending[i]) return false;
    }
    return true;
}

typedef es_result (*image_writer)(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink);

static es_result write_file(es_context* context, const es_image* image, const char* path, const es_image_save_desc* desc,
    image_writer writer, char* temporary, size_t temporary_size)
{
    int descriptor = -1;
    for (unsigned attempt = 0; attempt < 100; attempt++) {
        snprintf(temporary, temporary_size, "%s.%ld-%u.part", path, (long)getpid(), attempt);
        descriptor = open(temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (descriptor >= 0 || errno != EEXIST) break;
    }
    if (descriptor < 0) return es_fail(context, ES_FILE_WRITE, "cannot write '%s': %s", path, system_reason(errno));
    es_image_sink sink = {fdopen(descriptor, "wb"), 0};
    if (!sink.file) {
        int error = errno;
        close(descriptor);
        unlink(temporary);
        return es_fail(context, ES_FILE_WRITE, "cannot write '%s': %s", path, system_reason(error));
    }
    es_fp_environment environment = es_fp_enter_untrapped();
    es_result result = writer(context, image, desc, path, &sink);
    es_fp_leave(environment);
    errno = 0;
    if (fclose(sink.file) != 0 && !sink.error) sink.error = errno ? errno : EIO;
    if (result == ES_OK && !sink.error && rename(temporary, path) != 0) sink.error = errno ? errno : EIO;
    if (sink.error && (result == ES_OK || result == ES_FILE_WRITE)) result = es_fail(context, ES_FILE_WRITE, "cannot write '%s': %s", path, system_reason(sink.error));
    if (result != ES_OK) unlink(temporary);
    return result;
}

es_result es_image_save(es_context* context, const es_image* image, const char* path, const es_image_save_desc* desc)
{
    static const es_image_save_desc defaults = {0};
    if (!context) return ES_INVALID_ARGUMENT;
    if (!image || !path) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_save: image and path must not be NULL");
    if (!desc) desc = &defaults;
    image_writer writer = ends_with(path, ".exr") ? es_image_write_exr
        : ends_with(path, ".png")                 ? es_image_write_png
        : ends_with(path, ".hdr")                 ? es_image_write_hdr
                                                  : NULL;
    if (!writer) return es_fail(context, ES_FILE_TYPE, "'%s' does not end in .exr, .png or .hdr, which tell the type to write", path);
    if (image->width < 1 || image->height < 1 || image->width > ES_IMAGE_MAX_SIZE || image->height > ES_IMAGE_MAX_SIZE ||
        image->channels < 1 || image->channels > ES_IMAGE_MAX_CHANNELS) {
        return es_fail(context, ES_IMAGE_SIZE, "cannot write '%s': %u x %u with %u channels; 1 to %d and 1 to %d channels are accepted",
            path, image->width, image->height, image->channels, ES_IMAGE_MAX_SIZE, ES_IMAGE_MAX_CHANNELS);
    }
    if (!image->pixels || !image->channel_names) {
        return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_save: the image has no pixels or no channel names");
    }
    struct stat status;
    if (stat(path, &status) == 0 && S_ISDIR(status.st_mode)) {
        return es_fail(context, ES_FILE_WRITE, "cannot write '%s': it is a folder", path);
    }
    size_t temporary_size = strlen(path) + 64;
    char* temporary = es_allocate(context, temporary_size);
    if (!temporary) return es_context_last_result(context);
    es_result result = write_file(context, image, path, desc, writer, temporary, temporary_size);
    es_release(context, temporary, temporary_size);
    return result;
}
