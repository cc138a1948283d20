/* What the fuzz targets share: a context that watches itself, a folder of its own, and a check that ends the program.
 *
 * A target is one function of some bytes. libFuzzer calls it (EARTHSHINE_FUZZ, see fuzz.cmake), and driver.c does with files, so that
 * what was once found is tried again by every build. Nothing a target does depends on anything but its input. */
#ifndef EARTHSHINE_TESTS_FUZZ_H
#define EARTHSHINE_TESTS_FUZZ_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <earthshine/platform.h>

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size);

/* Ends the program with a line that says what does not hold. */
#define FUZZ_CHECK(condition, ...)                                                                                                     \
    do {                                                                                                                               \
        if (!(condition)) {                                                                                                            \
            fprintf(stderr, "%s:%d: not so: %s: ", __FILE__, __LINE__, #condition);                                                    \
            fprintf(stderr, __VA_ARGS__);                                                                                              \
            fputc('\n', stderr);                                                                                                       \
            abort();                                                                                                                   \
        }                                                                                                                              \
    } while (0)

/* One input's context: one thread, capped, over an allocator whose blocks end exactly where they were asked to, so that a sanitizer sees
 * one byte too many, and which counts by itself. */
typedef struct fuzz_run {
    es_context* context;
    size_t cap, live, most; /* bytes */
    unsigned messages;      /* errors logged since the last fuzz_expect */
    es_result item;         /* of the last of them */
} fuzz_run;

void fuzz_start(fuzz_run* run, size_t cap);
/* Whatever happened: an error comes with exactly one message, which says the same; success with none. */
es_result fuzz_expect(fuzz_run* run, es_result result);
/* Everything must have been given back, and never more than the cap been held. */
void fuzz_end(fuzz_run* run);

/* "FOLDER/NAME" in a folder of this process that is removed at its end, in one of four buffers used by turns. */
const char* fuzz_path(const char* name);
void fuzz_write(const char* name, const void* bytes, size_t size);
/* Bytes of a file, from malloc; NULL when it cannot be read. */
uint8_t* fuzz_read(const char* path, size_t* size);

/* The next bytes of an input, zeros behind its end. */
typedef struct fuzz_bytes { const uint8_t* at; size_t left; } fuzz_bytes;
static inline uint32_t fuzz_take(fuzz_bytes* in, uint32_t bytes)
{
    uint32_t value = 0;
    for (uint32_t i = 0; i < bytes && in->left; i++, in->at++, in->left--) value |= (uint32_t)*in->at << 8 * i;
    return value;
}

#endif
