/* Planes of words between guards, for checks of kernels: what is written before or past the end shows. */
#ifndef EARTHSHINE_TESTS_GUARDED_PLANES_H
#define EARTHSHINE_TESTS_GUARDED_PLANES_H

#include <stdint.h>
#include <stdlib.h>

enum { GUARD = 64 };
static const uint32_t guard_word = 0xdeadbeef;

typedef struct plane { uint32_t* memory; size_t count; } plane;

static inline plane new_plane(size_t count)
{
    plane p = {malloc((count + 2 * GUARD) * 4), count};
    assert_non_null(p.memory);
    for (size_t i = 0; i < count + 2 * GUARD; i++) p.memory[i] = guard_word;
    return p;
}

static inline float* at(plane p) { return (float*)(p.memory + GUARD); }

static inline void check_guards(plane p)
{
    for (size_t i = 0; i < GUARD; i++) {
        assert_int_equal(p.memory[i], guard_word);
        assert_int_equal(p.memory[GUARD + p.count + i], guard_word);
    }
}

#endif
