/* Micro-buffers to look at: what es_renderer_micro_buffer shows is what light was gathered from, and lies where it should on the hemisphere. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include <earthshine/gi.h>

#include "gi/micro/view.h"

enum { WIDTH = 32, HEIGHT = 24, SIZE = 16 };

static void no_log(void* user, es_log_level level, es_result item, const char* message)
{
    (void)user;
    (void)level;
    (void)item;
    (void)message;
}

typedef struct stage { es_context* context; es_world* world; es_renderer* renderer; } stage;

static int open_stage(void** state)
{
    static stage s;
    es_context_desc desc = es_default_context_desc();
    es_renderer_settings settings = es_default_renderer_settings();
    desc.logger.log = no_log;
    settings.width = WIDTH;
    settings.height = HEIGHT;
    settings.method = ES_GI_MICRO;
    settings.micro_points = 2048;
    settings.micro_size = SIZE;
    settings.micro_lobes = false; /* the mean of fifty pixels is less sure with single ones that are a hundred times as bright */
    if (es_context_create(&desc, &s.context) != ES_OK || es_world_open(s.context, "cornell", NULL, &s.world) != ES_OK || es_renderer_create(s.context, &settings, &s.renderer) != ES_OK) return 1;
    *state = &s;
    return 0;
}

static int close_stage(void** state)
{
    stage* s = *state;
    es_renderer_destroy(s->renderer);
    es_world_destroy(s->world);
    es_context_destroy(s->context);
    return 0;
}

static void test_refusals(void** state)
{
    stage* s = *state;
    es_image radiance, distance;
    assert_int_equal(es_renderer_micro_buffer(s->renderer, 0, 0, false, true, &radiance, &distance), ES_WRONG_STATE);
    assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK);
    assert_int_equal(es_renderer_micro_buffer(s->renderer, WIDTH, 0, false, true, &radiance, &distance), ES_INVALID_ARGUMENT);
    assert_int_equal(es_renderer_micro_buffer(s->renderer, 0, HEIGHT, false, true, &radiance, NULL), ES_INVALID_ARGUMENT);
    assert_null(radiance.pixels);
}

/* All pixels are worth the same: their mean times pi is the irradiance of the frame, whose cut was another. */
static void test_its_mean_is_the_irradiance(void** state)
{
    stage* s = *state;
    es_image irradiance, specular;
    assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK);
    assert_int_equal(es_renderer_image(s->renderer, "irradiance", &irradiance), ES_OK);
    assert_int_equal(es_renderer_image(s->renderer, "specular", &specular), ES_OK);
    double of_buffers = 0, of_frame = 0;
    uint32_t compared = 0;
    for (uint32_t y = 2; y < HEIGHT; y += 4)
        for (uint32_t x = 2; x < WIDTH; x += 4) {
            es_image radiance, distance;
            if (specular.pixels[y * WIDTH + x] > 0) continue; /* less what its interface keeps */
            assert_int_equal(es_renderer_micro_buffer(s->renderer, x, y, false, true, &radiance, &distance), ES_OK);
            if (radiance.width == SIZE) {
                assert_int_equal(radiance.height, SIZE);
                assert_int_equal(radiance.channels, 3);
                assert_int_equal(distance.width, SIZE);
                assert_int_equal(distance.channels, 1);
                for (uint32_t i = 0; i < SIZE * SIZE; i++) {
                    of_buffers += 3.14159265 * (double)radiance.pixels[3 * i] / (SIZE * SIZE);
                    if (radiance.pixels[3 * i] > 0) assert_true(distance.pixels[i] > 0);
                }
                of_frame += (double)irradiance.pixels[3 * (y * WIDTH + x)];
                compared++;
            } else {
                assert_int_equal(radiance.width, 1);
            }
            es_image_destroy(s->context, &radiance);
            es_image_destroy(s->context, &distance);
        }
    assert_true(compared > 10 && of_frame > 0);
    if (fabs(of_buffers / of_frame - 1) > 0.05) fail_msg("buffers %.4f, frame %.4f", of_buffers, of_frame);
    es_image_destroy(s->context, &irradiance);
    es_image_destroy(s->context, &specular);
}

static void test_over_the_hemisphere(void** state)
{
    stage* s = *state;
    es_image radiance, distance;
    bool seen = false;
    assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK);
    assert_int_equal(es_renderer_micro_buffer(s->renderer, WIDTH / 2, HEIGHT - 3, false, false, &radiance, &distance), ES_OK);
    assert_int_equal(radiance.width, ES_MICRO_VIEW_SIZE);
    assert_int_equal(distance.height, ES_MICRO_VIEW_SIZE);
    for (uint32_t y = 0; y < ES_MICRO_VIEW_SIZE; y++)
        for (uint32_t x = 0; x < ES_MICRO_VIEW_SIZE; x++) {
            const float a = (float)x + 0.5f - ES_MICRO_VIEW_SIZE / 2, b = (float)y + 0.5f - ES_MICRO_VIEW_SIZE / 2, d = distance.pixels[y * ES_MICRO_VIEW_SIZE + x];
            if (a * a + b * b > ES_MICRO_VIEW_SIZE * ES_MICRO_VIEW_SIZE / 4) assert_true(d == 0);
            seen |= d > 0;
        }
    assert_true(seen);
    es_image_destroy(s->context, &radiance);
    es_image_destroy(s->context, &distance);
}

static void test_nothing_to_show(void** state)
{
    stage* s = *state;
    es_renderer_settings settings = es_renderer_get_settings(s->renderer), other = settings;
    es_image image;
    other.method = ES_GI_NONE;
    assert_int_equal(es_renderer_configure(s->renderer, &other), ES_OK);
    assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK);
    assert_int_equal(es_renderer_image(s->renderer, "micro-buffer", &image), ES_OK);
    assert_int_equal(image.width, 1);
    assert_true(image.pixels[0] == 0);
    es_image_destroy(s->context, &image);
    assert_int_equal(es_renderer_configure(s->renderer, &settings), ES_OK);
    assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK);
    assert_int_equal(es_renderer_image(s->renderer, "micro-buffer-distance", &image), ES_OK);
    assert_int_equal(image.channels, 1);
    assert_true(image.width == SIZE || image.width == 1);
    es_image_destroy(s->context, &image);
}

/* Pixels whose radiance is their direction: each place of the disc shows its own. */
static void test_directions(void** state)
{
    stage* s = *state;
    enum { SIDE = 32 };
    static es_micro_pixel pixels[SIDE * SIDE];
    const float normal[3] = {0, 1, 0}, right[3] = {1, 0.3f, 0};
    for (int i = 0; i < SIDE * SIDE; i++) {
        const float u = ((float)(i % SIDE) + 0.5f) / SIDE, r = sqrtf(((float)(i / SIDE) + 0.5f) / SIDE), angle = 6.2831853f * u;
        pixels[i] = (es_micro_pixel){.node = 1, .distance = 2, .direction = {r * cosf(angle), sqrtf(1 - r * r), r * sinf(angle)}};
        memcpy(pixels[i].radiance, pixels[i].direction, sizeof pixels[i].direction);
    }
    es_image radiance;
    assert_int_equal(es_micro_view(s->context, pixels, SIDE, normal, right, true, &radiance, NULL), ES_OK);
    uint32_t shown = 0;
    for (int y = 0; y < ES_MICRO_VIEW_SIZE; y++)
        for (int x = 0; x < ES_MICRO_VIEW_SIZE; x++) {
            const float a = ((float)x + 0.5f) / (ES_MICRO_VIEW_SIZE / 2) - 1, b = 1 - ((float)y + 0.5f) / (ES_MICRO_VIEW_SIZE / 2), r = sqrtf(a * a + b * b);
            const float* d = radiance.pixels + 3 * ((size_t)y * ES_MICRO_VIEW_SIZE + (size_t)x);
            if (r > 0.95f || (d[0] == 0 && d[1] == 0 && d[2] == 0)) continue;
            shown++;
            const float sine = sinf(1.5707963f * r) / r, cosine = cosf(1.5707963f * r);
            /* who looks out along y and has x to the right has z above */
            const float dot = d[0] * sine * a + d[1] * cosine + d[2] * sine * b;
            if (dot < 0.96f) fail_msg("%d, %d shows what is %.3f rad away", x, y, (double)acosf(dot));
        }
    assert_true(shown > ES_MICRO_VIEW_SIZE * ES_MICRO_VIEW_SIZE / 2);
    es_image_destroy(s->context, &radiance);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_refusals), cmocka_unit_test(test_its_mean_is_the_irradiance), cmocka_unit_test(test_over_the_hemisphere), cmocka_unit_test(test_nothing_to_show),
        cmocka_unit_test(test_directions)};
    return cmocka_run_group_tests(tests, open_stage, close_stage);
}
