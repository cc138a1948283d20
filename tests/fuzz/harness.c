/* Contexts, folders and files of the fuzz targets. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include "tests/fuzz/fuzz.h"

#include <dirent.h>
#include <malloc.h>
#include <string.h>
#include <unistd.h>

/* gcc defines a macro, clang answers */
#if defined(__SANITIZE_ADDRESS__)
#define ADDRESS_SANITIZER 1
#elif defined(__has_feature)
#define ADDRESS_SANITIZER __has_feature(address_sanitizer)
#else
#define ADDRESS_SANITIZER 0
#endif

static void* run_allocate(void* user, size_t size, size_t alignment)
{
    fuzz_run* run = user;
    void* pointer = NULL;
    if (posix_memalign(&pointer, alignment, size)) return NULL;
    run->live += size;
    if (run->live > run->most) run->most = run->live;
    return pointer;
}

static void run_release(void* user, void* pointer, size_t size)
{
    fuzz_run* run = user;
    FUZZ_CHECK(size <= run->live, "%zu bytes are released, %zu are held", size, run->live);
#if ADDRESS_SANITIZER
    FUZZ_CHECK(malloc_usable_size(pointer) == size, "a block of %zu bytes is released as %zu", malloc_usable_size(pointer), size);
#endif
    run->live -= size;
    free(pointer);
}

static void run_log(void* user, es_log_level level, es_result item, const char* message)
{
    fuzz_run* run = user;
    FUZZ_CHECK(message[0] && !strpbrk(message, "\n\r"), "a message is one line: '%s'", message);
    if (level != ES_LOG_ERROR) return;
    run->messages++;
    run->item = item;
}

void fuzz_start(fuzz_run* run, size_t cap)
{
    *run = (fuzz_run){.cap = cap};
    es_context_desc desc = es_default_context_desc();
    desc.allocator = (es_allocator){run_allocate, run_release, run};
    desc.logger = (es_logger){run_log, run};
    desc.threads = 1;
    desc.memory_cap = cap;
    FUZZ_CHECK(es_context_create(&desc, &run->context) == ES_OK, "no context");
    /* the context's own block is not part of what it counts */
    run->live = run->most = 0;
}

es_result fuzz_expect(fuzz_run* run, es_result result)
{
    FUZZ_CHECK((uint32_t)result < ES_RESULT_COUNT, "result %d", (int)result);
    if (result == ES_OK) {
        FUZZ_CHECK(run->messages == 0, "success with an error: %s", es_context_message(run->context));
        return result;
    }
    FUZZ_CHECK(run->messages == 1, "%s with %u messages, the last is: %s", es_result_name(result), run->messages, es_context_message(run->context));
    FUZZ_CHECK(run->item == result, "%s, but the message is of %s: %s", es_result_name(result), es_result_name(run->item), es_context_message(run->context));
    FUZZ_CHECK(es_context_last_result(run->context) == result, "the last result is %s", es_result_name(es_context_last_result(run->context)));
    run->messages = 0;
    return result;
}

void fuzz_end(fuzz_run* run)
{
    FUZZ_CHECK(run->messages == 0, "a message that no result came with: %s", es_context_message(run->context));
    FUZZ_CHECK(es_context_bytes(run->context) == 0 && run->live == 0, "%zu bytes are not given back, by the allocator's count %zu",
        es_context_bytes(run->context), run->live);
    /* the context also counts what libraries allocate by themselves */
    FUZZ_CHECK(run->most <= es_context_peak_bytes(run->context) && es_context_peak_bytes(run->context) <= run->cap, "the most was %zu bytes, by the context's count %zu, the cap is %zu",
        run->most, es_context_peak_bytes(run->context), run->cap);
    run->live = 1 << 20; /* room for the context's own block, which goes through the same function */
    es_context_destroy(run->context);
    FUZZ_CHECK(run->messages == 0, "the end of the context is not silent");
}

/* ---- files -------------------------------------------------------------------------------------------------------------------------- */

static char folder[64];

static void remove_folder(void)
{
    DIR* list = opendir(folder);
    if (!list) return;
    char path[512];
    for (struct dirent* entry; (entry = readdir(list));) {
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (entry->d_name[0] != '.') unlink(path);
    }
    closedir(list);
    rmdir(folder);
}

const char* fuzz_path(const char* name)
{
    static char paths[4][256];
    static unsigned turn;
    if (!folder[0]) {
        /* in memory where there is such a place: a target writes its input thousands of times */
        snprintf(folder, sizeof folder, "%s/earthshine-fuzz-XXXXXX", access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
        FUZZ_CHECK(mkdtemp(folder), "no folder can be made: %s", folder);
        atexit(remove_folder);
    }
    char* path = paths[turn++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

void fuzz_write(const char* name, const void* bytes, size_t size)
{
    FILE* file = fopen(fuzz_path(name), "wb");
    FUZZ_CHECK(file && fwrite(bytes, 1, size, file) == size && fclose(file) == 0, "%s cannot be written", fuzz_path(name));
}

uint8_t* fuzz_read(const char* path, size_t* size)
{
    FILE* file = fopen(path, "rb");
    if (!file) return NULL;
    uint8_t* bytes = NULL;
    long length = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    rewind(file);
    /* of its exact size, so that a sanitizer sees a read past its end */
    if (length >= 0 && (bytes = malloc(length ? (size_t)length : 1)) && fread(bytes, 1, (size_t)length, file) != (size_t)length) {
        free(bytes);
        bytes = NULL;
    }
    fclose(file);
    if (bytes) *size = (size_t)length;
    return bytes;
}
