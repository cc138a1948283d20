/* Image files. FUZZ_ENDING is the format whose inputs are tried and which is written: ".exr", ".png" or ".hdr"; what the bytes are is
 * told by the bytes, so each target meets the other formats too.
 *
 * A file that loads is written and read again: EXR keeps every bit; what the others round stays the same when it is rounded once more. */
#include <string.h>

#include "tests/fuzz/fuzz.h"

/* Enough for some hundred thousand samples; it bounds the time of an input too. */
enum { CAP = 6 << 20 };

static bool same(const es_image* a, const es_image* b)
{
    return a->width == b->width && a->height == b->height && a->channels == b->channels &&
           memcmp(a->pixels, b->pixels, (size_t)a->width * a->height * a->channels * sizeof(float)) == 0;
}

/* Writes and reads; false when the image is none of this format, or there is no memory for it. */
static bool round_trip(fuzz_run* run, const es_image* image, es_image* back)
{
    const char* path = fuzz_path("image" FUZZ_ENDING);
    es_result result = fuzz_expect(run, es_image_save(run->context, image, path, &(es_image_save_desc){.sample_type = ES_SAMPLE_FLOAT}));
    FUZZ_CHECK(result == ES_OK || result == ES_INVALID_ARGUMENT || result == ES_MEMORY_CAP || result == ES_NOT_BUILT, "saving what was loaded: %s",
        es_context_message(run->context));
    if (result != ES_OK) return false;
    result = fuzz_expect(run, es_image_load(run->context, path, back));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "loading what was saved: %s", es_context_message(run->context));
    return result == ES_OK;
}

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size)
{
    fuzz_run run;
    fuzz_start(&run, CAP);
    es_image image, again, once, twice;
    es_result result = fuzz_expect(&run, es_image_load_memory(run.context, bytes, size, "input", &image));
    if (result != ES_OK) {
        FUZZ_CHECK(!image.pixels && !image.channel_names && !image.width, "a failure leaves an image");
        fuzz_end(&run);
        return 0;
    }
    FUZZ_CHECK(image.width >= 1 && image.height >= 1 && image.channels >= 1 && image.width <= ES_IMAGE_MAX_SIZE && image.height <= ES_IMAGE_MAX_SIZE &&
            image.channels <= ES_IMAGE_MAX_CHANNELS, "%u x %u, %u channels", image.width, image.height, image.channels);
    for (uint32_t c = 0; c < image.channels; c++) FUZZ_CHECK(memchr(image.channel_names[c], 0, ES_CHANNEL_NAME_SIZE), "a channel's name does not end");
    result = fuzz_expect(&run, es_image_load_memory(run.context, bytes, size, "input", &again));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "the second time it does not load: %s", es_context_message(run.context));
    FUZZ_CHECK(result != ES_OK || same(&image, &again), "the second time it is another image");
    if (result == ES_OK) es_image_destroy(run.context, &again);

    bool is_exr = !strcmp(FUZZ_ENDING, ".exr");
    if (round_trip(&run, &image, &once)) {
        FUZZ_CHECK(!is_exr || once.channels == image.channels, "channels are lost");
        if (is_exr)
            for (uint32_t c = 0; c < image.channels; c++) {
                int place = es_image_channel(&once, image.channel_names[c]);
                FUZZ_CHECK(place >= 0, "channel %s is lost", image.channel_names[c]);
                for (size_t i = 0; i < (size_t)image.width * image.height; i++)
                    FUZZ_CHECK(memcmp(&image.pixels[i * image.channels + c], &once.pixels[i * image.channels + (size_t)place], sizeof(float)) == 0,
                        "sample %zu of %s is another one", i, image.channel_names[c]);
            }
        if (round_trip(&run, &once, &twice)) {
            FUZZ_CHECK(same(&once, &twice), "written once more it is another image");
            es_image_destroy(run.context, &twice);
        }
        es_image_destroy(run.context, &once);
    }
    es_image_destroy(run.context, &image);
    fuzz_end(&run);
    return 0;
}
