/* Sixteen bits of depth against more. Maps of virtual lights hold distances in 49151 steps of the extent, rounded to the nearest: what exact
 * distances would show lies between the pictures with half a step more bias and with half a step less, pair by pair, because a larger
 * bias only ever lights more. How far those two are apart bounds what rounding to sixteen bits can cost: relRMSE below 2e-3. Filling the
 * holes of imperfect maps rounds again, which is not part of it. */
#include "tests/stress/stress.h"

static void sixteen_bits(void** state)
{
    (void)state;
    const float half_step = 0.5f / 49151, bias = 0.002f;
    for (uint32_t method = ES_GI_ISM; method <= ES_GI_CLASSIC; method++) {
        stress s = stress_open(1, es_v3(0, 0, 0));
        stress_room(&s);
        es_renderer_settings settings = stress_settings(96, 72, method);
        settings.interleave = 1;
        settings.vpls = 64;
        es_image image[3];
        for (int i = 0; i < 3; i++) {
            settings.ism_bias = bias + (float)(i - 1) * half_step;
            es_renderer* renderer = stress_render(&s, &settings);
            image[i] = stress_image(renderer, "indirect");
            es_renderer_destroy(renderer);
        }
        size_t falling = 0;
        for (size_t k = 0; k < values_of(&image[0]); k++) falling += image[0].pixels[k] > image[1].pixels[k] || image[1].pixels[k] > image[2].pixels[k];
        difference d = difference_of(&image[2], &image[0], 1);
        printf("    %s: exact distances within relRMSE %.1e, max %.1e, mean %.1e\n", method == ES_GI_ISM ? "ism" : "classic", d.relrmse, d.max, mean_of_image(&image[2]) / mean_of_image(&image[0]) - 1);
        assert_int_equal(falling, 0);
        if (!(d.relrmse <= 2e-3)) fail_msg("method %u: sixteen bits may cost relRMSE %g", method, d.relrmse);
        for (int i = 0; i < 3; i++) es_image_destroy(s.context, &image[i]);
        stress_close(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sixteen_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
