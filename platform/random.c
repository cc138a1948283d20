/* Halton points, and the hash that names images and states.
 *
 * The radical inverse is computed as a ratio of two integers, digits reversed over base^digits (both below 2^40, exact in
 * double), so it has one rounding and no accumulated error (Halton 1960; Pharr et al., Physically Based Rendering, 8.6). */
#include <string.h>

#include "platform/random.h"

float es_radical_inverse(uint32_t base, uint32_t index)
{
    if (base < 2) return 0;
    uint64_t reversed = 0, scale = 1;
    for (; index != 0; index /= base) {
        reversed = reversed * base + index % base;
        scale *= base;
    }
    float value = (float)((double)reversed / (double)scale);
    return value < 1.0f ? value : 0x1.fffffep-1f; /* rounding to float may have reached 1 */
}

float es_halton(uint32_t dimension, uint32_t index)
{
    static const uint8_t primes[16] = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53};
    return es_radical_inverse(primes[dimension & 15], index);
}

static uint64_t rotate_left(uint64_t x, int n) { return x << n | x >> (64 - n); }

/* A multiply on each side of a rotation per word, and MurmurHash3's 64-bit finaliser (A. Appleby, public domain). The size
 * takes part, so trailing zero bytes count. */
uint64_t es_hash_bytes(uint64_t seed, const void* bytes, size_t size)
{
    const unsigned char* p = bytes;
    uint64_t h = seed ^ ((uint64_t)size * 0x9e3779b97f4a7c15u);
    for (size_t left = size; left > 0;) {
        uint64_t word = 0;
        size_t n = left < 8 ? left : 8;
        if (n == 8) {
            memcpy(&word, p, 8);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
            word = __builtin_bswap64(word);
#endif
        } else {
            for (size_t i = 0; i < n; i++) word |= (uint64_t)p[i] << 8 * i;
        }
        word *= 0x87c37b91114253d5u;
        h ^= rotate_left(word, 31) * 0x4cf5ad432745937fu;
        h = rotate_left(h, 27) * 5 + 0x52dce729u;
        p += n;
        left -= n;
    }
    h ^= h >> 33; h *= 0xff51afd7ed558ccdu;
    h ^= h >> 33; h *= 0xc4ceb9fe1a85ec53u;
    return h ^ h >> 33;
}
