/* Chunks of the DWA compressions, without the file around them, whose checks would stop most of what is damaged.
 *
 * Input: channels, size and the chunk's streams. A stream may be given as it is when inflated, since no mutation keeps a deflated one's
 * checksum. A chunk decodes the same whatever its scratch memory was used for before. */
#include <string.h>
#include <zlib.h>

#include "platform/image_exr_dwa.h"
#include "tests/fuzz/fuzz.h"

enum { CAP = 32 << 20, CHANNELS = 8, SIDE = 64, STREAMS = 4, PACKED = 5 << 16 };
enum { VERSION, UNKNOWN_RAW, UNKNOWN_PACKED, AC_PACKED, DC_PACKED, RLE_PACKED, RLE_CODED, RLE_RAW, AC_COUNT, DC_COUNT, AC_COMPRESSION, NUMBERS };

static const char* const names[] = {"A", "B", "G", "R", "RY", "Y", "Z", "a.R", "a.G", "a.B", "left.blue", "left.GRN", "left.red", "x", "BY", "id"};

static size_t put_numbers(uint8_t* out, const uint64_t numbers[NUMBERS])
{
    for (int i = 0; i < NUMBERS; i++)
        for (int k = 0; k < 8; k++) *out++ = (uint8_t)(numbers[i] >> 8 * k);
    return NUMBERS * 8;
}

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size)
{
    static uint8_t packed[PACKED];
    fuzz_bytes in = {bytes, size};
    es_dwa_channel channels[CHANNELS];
    uint32_t count = 1 + fuzz_take(&in, 1) % CHANNELS, width = 1 + fuzz_take(&in, 1) % SIDE, height = 1 + fuzz_take(&in, 1) % SIDE;
    int32_t first_row = (int8_t)fuzz_take(&in, 1);
    for (uint32_t c = 0; c < count; c++) {
        uint32_t kind = fuzz_take(&in, 1), sampling = fuzz_take(&in, 1);
        channels[c] = (es_dwa_channel){names[kind % 16], (es_dwa_type)(kind / 16 % 3), 1 + (sampling & 3), 1 + (sampling >> 2 & 3), kind >= 128};
        /* the caller divides the window by the steps and refuses what leaves a rest */
        while (width % channels[c].x_sampling) channels[c].x_sampling--;
    }
    size_t out_size = 0;
    for (uint32_t c = 0; c < count; c++)
        for (uint32_t y = 0; y < height; y++)
            if ((first_row + (int64_t)y) % channels[c].y_sampling == 0) out_size += (size_t)(width / channels[c].x_sampling) * (channels[c].type == ES_DWA_HALF ? 2 : 4);

    uint64_t numbers[NUMBERS] = {0};
    numbers[VERSION] = fuzz_take(&in, 1) % 4;
    uint32_t how = fuzz_take(&in, 1);
    numbers[AC_COMPRESSION] = how >> 4 & 3;
    uint32_t rules = fuzz_take(&in, 1);
    size_t at = NUMBERS * 8;
    if (numbers[VERSION] == 2) {
        packed[at++] = (uint8_t)(rules + 2);
        packed[at++] = (uint8_t)((rules + 2) >> 8);
        for (uint32_t i = 0; i < rules; i++) packed[at++] = (uint8_t)fuzz_take(&in, 1);
    }
    /* unknown, AC, DC, run-length coded: the sizes are honest unless the input says otherwise */
    for (int s = 0; s < STREAMS; s++) {
        size_t raw = fuzz_take(&in, 2);
        if (raw > in.left) raw = in.left;
        size_t stored = raw;
        if (how >> s & 1) {
            uLongf length = PACKED - at;
            if (compress2(packed + at, &length, in.at, raw, 1) != Z_OK) return 0;
            stored = length;
        } else {
            memcpy(packed + at, in.at, raw);
        }
        in.at += raw, in.left -= raw;
        at += stored;
        numbers[UNKNOWN_PACKED + s] = stored;
        if (s == 0) numbers[UNKNOWN_RAW] = raw;
        if (s == 1) numbers[AC_COUNT] = how & 2 ? raw / 2 : fuzz_take(&in, 2);
        if (s == 2) numbers[DC_COUNT] = raw / 2;
        if (s == 3) numbers[RLE_CODED] = raw, numbers[RLE_RAW] = how & 64 ? fuzz_take(&in, 2) : raw;
    }
    if (how & 128) {
        uint32_t which = fuzz_take(&in, 1) % NUMBERS;
        numbers[which] = (uint64_t)fuzz_take(&in, 4) << (fuzz_take(&in, 1) % 33);
    }
    put_numbers(packed, numbers);

    /* of their exact sizes, so that a sanitizer sees what lies beyond */
    uint8_t *chunk = malloc(at), *first = malloc(out_size ? out_size : 1), *second = malloc(out_size ? out_size : 1);
    memcpy(chunk, packed, at);
    memset(first, 0, out_size);
    memset(second, 0, out_size);
    /* kept from input to input, as from chunk to chunk of a file: its table takes longer to make than a chunk to decode */
    static fuzz_run run;
    static es_dwa_scratch scratch;
    if (!run.context) {
        fuzz_start(&run, CAP);
        scratch.context = run.context;
    }
    es_dwa_result a = es_dwa_decode(&scratch, chunk, at, channels, count, width, height, first_row, first, out_size);
    es_dwa_result b = es_dwa_decode(&scratch, chunk, at, channels, count, width, height, first_row, second, out_size);
    FUZZ_CHECK(a == b && (a != ES_DWA_OK || memcmp(first, second, out_size) == 0), "the second time the chunk is another one");
    FUZZ_CHECK(a != ES_DWA_NO_MEMORY, "no memory for a chunk of %zu bytes", out_size);
    FUZZ_CHECK(es_context_bytes(run.context) == scratch.size + (scratch.to_linear ? 65536 * sizeof(uint16_t) : 0), "%zu bytes are held", es_context_bytes(run.context));
    FUZZ_CHECK(run.messages == 0 && run.most <= CAP, "%u messages, %zu bytes", run.messages, run.most);
    free(chunk);
    free(first);
    free(second);
    return 0;
}
