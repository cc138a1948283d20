/* Recordings on disk: a header with the sizes of what follows and a hash of all, then the parts one after another, little-endian.
 *
 * A file is written beside its name and renamed, so it is whole or not there. One that is read is checked in all its parts before any
 * of it is used: sizes against the file, the hash, every step's ranges, every input. */
#include "sim/recording.h"

#include <errno.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "platform/random.h"

typedef struct file_header {
    char magic[8];
    uint64_t payload;         /* hash of everything else */
    uint64_t scene_size, settings_size, first_size, first_hash, step_count, input_size, hash_count;
} file_header;

static const char magic[8] = {'E', 'S', 'I', 'N', 'P', 'U', 'T', '1'};
enum { PARTS = 6 };
/* Beyond this a file is no recording anyone made: 2 GiB. */
#define SIZE_LIMIT (1ull << 31)

typedef struct part { void* bytes; size_t size; } part;

static void parts_of(const es_recording* r, const file_header* h, part parts[PARTS])
{
    parts[0] = (part){r->scene, (size_t)h->scene_size};
    parts[1] = (part){r->settings, (size_t)h->settings_size};
    parts[2] = (part){r->first, (size_t)h->first_size};
    parts[3] = (part){r->steps, (size_t)h->step_count * sizeof *r->steps};
    parts[4] = (part){r->inputs, (size_t)h->input_size};
    parts[5] = (part){r->hashes, (size_t)h->hash_count * sizeof *r->hashes};
}

/* Of the header without it, and of all parts. */
static uint64_t payload_of(const file_header* header, const part parts[PARTS])
{
    file_header h = *header;
    h.payload = 0;
    uint64_t hash = es_hash_bytes(0, &h, sizeof h);
    for (int i = 0; i < PARTS; i++) hash = es_hash_bytes(hash, parts[i].bytes, parts[i].size);
    return hash;
}

es_result es_recording_save(const es_recording* recording, const char* path)
{
    if (!recording || !path) return ES_INVALID_ARGUMENT;
    es_context* context = recording->context;
    if (recording->failed) return es_fail(context, recording->failed, "cannot write '%s': the recording ran out of memory after step %zu", path, recording->step_count);
    struct stat status;
    if (stat(path, &status) == 0 && S_ISDIR(status.st_mode)) return es_fail(context, ES_FILE_WRITE, "cannot write '%s': it is a folder", path);
    size_t size = strlen(path) + 64;
    char* temporary = es_allocate(context, size);
    if (!temporary) return es_context_last_result(context);
    snprintf(temporary, size, "%s.%ld.part", path, (long)getpid());
    file_header header = {.scene_size = strlen(recording->scene), .settings_size = strlen(recording->settings), .first_size = recording->first_size, .first_hash = recording->first_hash,
        .step_count = recording->step_count, .input_size = recording->noted, .hash_count = recording->hash_count};
    memcpy(header.magic, magic, sizeof magic);
    part parts[PARTS];
    parts_of(recording, &header, parts);
    header.payload = payload_of(&header, parts);
    errno = 0;
    FILE* file = fopen(temporary, "wb");
    bool good = file && fwrite(&header, sizeof header, 1, file) == 1;
    for (int i = 0; i < PARTS && good; i++) good = !parts[i].size || fwrite(parts[i].bytes, 1, parts[i].size, file) == parts[i].size;
    if (file) good = fclose(file) == 0 && good;
    good = good && rename(temporary, path) == 0;
    es_result result = good ? ES_OK : es_fail(context, ES_FILE_WRITE, "cannot write '%s': %s", path, strerror(errno ? errno : EIO));
    if (!good && file) unlink(temporary);
    es_release(context, temporary, size);
    return result;
}

static bool header_valid(const file_header* h, uint64_t file_size)
{
    if (memcmp(h->magic, magic, sizeof magic) != 0) return false;
    const uint64_t sizes[] = {h->scene_size, h->settings_size, h->first_size, h->step_count, h->input_size, h->hash_count};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        if (sizes[i] > SIZE_LIMIT) return false;
    return h->scene_size + h->settings_size + h->first_size + h->step_count * sizeof(es_recorded_step) + h->input_size + h->hash_count * sizeof(uint32_t) + sizeof *h == file_size;
}

/* Steps' ranges follow each other without gaps, and every input can be read. */
static bool content_valid(const es_recording* r)
{
    uint64_t inputs = 0, hashes = 0;
    for (size_t i = 0; i < r->step_count; i++) {
        const es_recorded_step* step = &r->steps[i];
        if (!es_within(step->dt, 0, 10) || step->inputs != inputs || step->input_end < inputs || step->input_end > r->noted || step->first_hash != hashes) return false;
        for (size_t at = (size_t)step->inputs; at < step->input_end;) {
            es_input input;
            if (!es_input_read(r, &at, (size_t)step->input_end, &input)) return false;
        }
        inputs = step->input_end;
        hashes += step->objects;
    }
    return inputs == r->noted && hashes == r->hash_count;
}

static es_result read_parts(es_context* context, FILE* file, const char* path, const file_header* h, es_recording** out)
{
    es_recording* r = es_recording_make(context, "", 0, "", 0);
    if (!r) return es_context_last_result(context);
    es_release(context, r->scene, 1);
    es_release(context, r->settings, 1);
    r->settings = NULL;
    r->scene = es_allocate_zero(context, (size_t)h->scene_size + 1);
    if (r->scene) memset(r->scene, ' ', (size_t)h->scene_size); /* strlen is the size that is released */
    if (r->scene) r->settings = es_allocate_zero(context, (size_t)h->settings_size + 1);
    if (r->settings) memset(r->settings, ' ', (size_t)h->settings_size);
    bool memory = r->settings && es_grow(context, (void**)&r->steps, &r->step_capacity, 0, (size_t)h->step_count, sizeof *r->steps) &&
                  es_grow(context, (void**)&r->inputs, &r->input_capacity, 0, (size_t)h->input_size, 1) &&
                  es_grow(context, (void**)&r->hashes, &r->hash_capacity, 0, (size_t)h->hash_count, sizeof *r->hashes) &&
                  (r->first = es_allocate(context, (size_t)h->first_size)) != NULL;
    if (!memory) {
        es_recording_destroy(r);
        return es_context_last_result(context);
    }
    r->first_size = (size_t)h->first_size;
    r->first_hash = h->first_hash;
    r->step_count = (size_t)h->step_count;
    r->input_count = r->noted = (size_t)h->input_size;
    r->hash_count = (size_t)h->hash_count;
    part parts[PARTS];
    parts_of(r, h, parts);
    bool good = true;
    for (int i = 0; i < PARTS && good; i++) good = !parts[i].size || fread(parts[i].bytes, 1, parts[i].size, file) == parts[i].size;
    good = good && payload_of(h, parts) == h->payload && !memchr(r->scene, 0, (size_t)h->scene_size) && !memchr(r->settings, 0, (size_t)h->settings_size) && content_valid(r);
    if (good) {
        *out = r;
        return ES_OK;
    }
    for (size_t i = 0; i < h->scene_size; i++) r->scene[i] = ' ';
    for (size_t i = 0; i < h->settings_size; i++) r->settings[i] = ' ';
    es_recording_destroy(r);
    return es_fail(context, ES_FILE_DAMAGED, "'%s' is a damaged recording", path);
}

es_result es_recording_load(es_context* context, const char* path, es_recording** recording)
{
    if (!context || !recording) return ES_INVALID_ARGUMENT;
    *recording = NULL;
    if (!path) return es_misuse(context, ES_INVALID_ARGUMENT, "es_recording_load: the path must not be NULL");
    struct stat status;
    if (stat(path, &status) != 0) return es_fail(context, ES_FILE_NOT_FOUND, "cannot read '%s': %s", path, strerror(errno));
    if (!S_ISREG(status.st_mode)) return es_fail(context, ES_FILE_TYPE, "cannot read '%s': it is no regular file", path);
    FILE* file = fopen(path, "rb");
    if (!file) return es_fail(context, ES_FILE_READ, "cannot read '%s': %s", path, strerror(errno));
    file_header header = {0};
    es_result result;
    if (fread(&header, sizeof header, 1, file) != 1 || memcmp(header.magic, magic, sizeof magic) != 0)
        result = es_fail(context, ES_FILE_TYPE, "'%s' is no recording of this program", path);
    else if (!header_valid(&header, (uint64_t)status.st_size))
        result = es_fail(context, ES_FILE_DAMAGED, "'%s' is a damaged recording: its sizes do not fit the file's %llu bytes", path, (unsigned long long)status.st_size);
    else
        result = read_parts(context, file, path, &header, recording);
    fclose(file);
    return result;
}
