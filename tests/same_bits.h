/* What is computed is the same, bit for bit, on every instruction set that this machine has and on one thread as on several:
 *     same_bits same = {.most_threads = 3};
 *     for (es_context* context; (context = next_context(&same));) {
 *         …
 *         expect_same_bits(&same, result, sizeof result);
 *         es_context_destroy(context);
 *     }
 * Each turn is on another instruction set, or on the most threads instead of one; the first, on scalar kernels and one thread, is what the others are held against.
 * A turn may expect several results, in the order of the first. */
#ifndef EARTHSHINE_TESTS_SAME_BITS_H
#define EARTHSHINE_TESTS_SAME_BITS_H

#include <stdlib.h>
#include <string.h>

#include "platform/context.h"

typedef struct same_bits {
    uint32_t most_threads;
    uint32_t turns;            /* begun */
    uint32_t threads;          /* of this one */
    int isa;
    unsigned char* first;      /* of the first turn, one result after the other */
    size_t bytes, at;
} same_bits;

/* The turn's context, which the caller destroys; NULL: there are no more. */
static inline es_context* next_context(same_bits* s)
{
    if (s->turns > 1) assert_int_equal(s->at, s->bytes);
    s->at = 0;
    if (s->turns == 0) s->threads = 1;
    else if (s->threads == 1 && s->most_threads > 1) s->threads = s->most_threads;
    else {
        s->threads = 1;
        s->isa++;
    }
    while (s->isa < ES_ISA_COUNT && !(es_isa_available_mask() >> s->isa & 1)) s->isa++;
    if (s->isa >= ES_ISA_COUNT) {
        assert_true(s->turns && s->bytes);
        free(s->first);
        s->first = NULL;
        return NULL;
    }
    s->turns++;
    es_context_desc desc = es_default_context_desc();
    desc.threads = s->threads;
    desc.isa_mask = 1u << s->isa;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static inline void expect_same_bits(same_bits* s, const void* result, size_t bytes)
{
    if (s->turns == 1) {
        s->first = realloc(s->first, s->bytes + bytes + 1);
        assert_non_null(s->first);
        memcpy(s->first + s->bytes, result, bytes);
        s->bytes += bytes;
        return;
    }
    assert_true(bytes <= s->bytes - s->at);
    if (memcmp(s->first + s->at, result, bytes) != 0) {
        size_t at = 0;
        while (s->first[s->at + at] == ((const unsigned char*)result)[at]) at++;
        fail_msg("%s on %u threads: byte %zu of %zu is another than with %s on one", es_isa_name((es_isa)s->isa), s->threads, at, bytes, es_isa_name(ES_ISA_SCALAR));
    }
    s->at += bytes;
}

#endif
