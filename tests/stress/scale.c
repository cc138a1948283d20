/* The same scene at other scales and places gives the same picture.
 *
 * Powers of two change no mantissa: those pictures are equal bit for bit, which a single absolute threshold anywhere would break. So does a
 * move by a multiple of what the world's origin snaps to. Other scales and moves round differently; where a pixel's centre, a shadow's edge
 * or a virtual point light's texel lies within rounding of a border, it may fall on the other side, and the bounds say how much that is. */
#include "tests/stress/stress.h"

enum { WIDTH = 96, HEIGHT = 72, COMPENSATED = ES_GI_VPL_TRACED + 1, METHODS };

typedef struct picture { es_image depth, direct, indirect, radiance, display, motion; } picture;

static picture frame_of(float scale, es_vec3 offset, uint32_t method, bool moving)
{
    stress s = stress_open(scale, offset);
    stress_room(&s);
    es_renderer_settings settings = stress_settings(WIDTH, HEIGHT, method == COMPENSATED ? ES_GI_VPL_TRACED : method);
    if (method >= ES_GI_VPL_TRACED) settings.vpls = 64;
    if (method == COMPENSATED) settings.traced_bias = ES_TRACED_COMPENSATED;
    settings.traced_samples = 4;
    es_renderer* renderer = stress_render(&s, &settings);
    if (moving) {
        /* the second frame of a world that moves: a ball by a hundredth, and the eye */
        es_node_desc ball = {.parent = s.root, .transform = {{0.07f * 0.5f, 0.0625f, 0}, {0, 0, 0, 1}, {1, 1, 1}}};
        es_node node;
        es_instance_desc instance;
        es_camera_desc camera;
        es_transform transform;
        uint32_t ids[16];
        size_t count = 16;
        assert_int_equal(es_world_enumerate(s.world, ES_OBJECT_INSTANCE, ids, &count), ES_OK);
        assert_int_equal(es_world_add_node(s.world, &ball, &node), ES_OK);
        assert_int_equal(es_world_get_instance(s.world, (es_instance){ids[5]}, &instance), ES_OK);
        instance.node = node;
        assert_int_equal(es_world_set_instance(s.world, (es_instance){ids[5]}, &instance), ES_OK);
        assert_int_equal(es_world_get_camera(s.world, s.camera, &camera), ES_OK);
        assert_int_equal(es_world_get_node_transform(s.world, camera.node, &transform), ES_OK);
        transform.translation.x += 0.03125f;
        assert_int_equal(es_world_set_node_transform(s.world, camera.node, &transform), ES_OK);
        assert_int_equal(es_renderer_render(renderer, s.world), ES_OK);
    }
    assert_all_finite(&s, renderer, "room");
    picture p;
    const char* const names[] = {"depth", "direct", "indirect", "radiance", "display", "motion"};
    es_image* const images[] = {&p.depth, &p.direct, &p.indirect, &p.radiance, &p.display, &p.motion};
    for (int i = 0; i < 6; i++) {
        /* the images outlive the context */
        es_image image = stress_image(renderer, names[i]);
        *images[i] = image;
        images[i]->pixels = malloc(values_of(&image) * sizeof(float));
        memcpy(images[i]->pixels, image.pixels, values_of(&image) * sizeof(float));
        es_image_destroy(s.context, &image);
    }
    es_renderer_destroy(renderer);
    stress_close(&s);
    return p;
}

static picture picture_of(float scale, es_vec3 offset, uint32_t method) { return frame_of(scale, offset, method, false); }

static void free_picture(picture* p)
{
    es_image* const images[] = {&p->depth, &p->direct, &p->indirect, &p->radiance, &p->display, &p->motion};
    for (int i = 0; i < 6; i++) free(images[i]->pixels);
}

static void assert_same(const picture* a, const picture* b, float scale, const char* what)
{
    const es_image* const now[] = {&a->depth, &a->direct, &a->indirect, &a->radiance, &a->display, &a->motion};
    const es_image* const then[] = {&b->depth, &b->direct, &b->indirect, &b->radiance, &b->display, &b->motion};
    const char* const names[] = {"depth", "direct", "indirect", "radiance", "display", "motion"};
    for (int i = 0; i < 6; i++) {
        size_t different = 0;
        for (size_t k = 0; k < values_of(now[i]); k++) different += now[i]->pixels[k] != then[i]->pixels[k] * (i == 0 ? scale : 1.0f);
        if (different) fail_msg("%s: %zu values of %s differ", what, different, names[i]);
    }
}

/* Depth and direct light are all but equal. Of the indirect light's 256 lights (64 of the classic and traced methods) some sit one texel of the light's
 * G-buffer further, which shows in the pixels whose phase they light, most in one that is close to such a light (`max`). Compensation is of
 * four rays a pixel here, each of which may pass an edge on the other side. */
static void assert_close(const char* what, uint32_t method, const picture* a, const picture* b, double scale)
{
    static const difference bounds[][2] = {[ES_GI_ISM] = {{0.2, 6}, {0.03, 1.5}}, [ES_GI_CLASSIC] = {{0.3, 12}, {0.06, 3}}, [ES_GI_VPL_TRACED] = {{0.3, 12}, {0.06, 3}}, [COMPENSATED] = {{1, 60}, {0.15, 12}}};
    const difference* bound = bounds[method];
    difference depth = difference_of(&a->depth, &b->depth, scale), direct = difference_of(&a->direct, &b->direct, 1);
    difference indirect = difference_of(&a->indirect, &b->indirect, 1), all = difference_of(&a->radiance, &b->radiance, 1);
    double share = mean_of_image(&a->indirect) / mean_of_image(&b->indirect) - 1;
    printf("    %-42s relRMSE/max: depth %.1e/%.1e direct %.1e/%.1e indirect %.1e/%.1e radiance %.1e/%.1e; mean of indirect %+.1e\n", what, depth.relrmse, depth.max, direct.relrmse,
        direct.max, indirect.relrmse, indirect.max, all.relrmse, all.max, share);
    if (!(depth.relrmse <= 3e-5 && depth.max <= 1e-3)) fail_msg("%s: the depth differs", what);
    if (!(direct.relrmse <= 1e-3 && direct.max <= 0.1)) fail_msg("%s: the direct light differs", what);
    if (!(indirect.relrmse <= bound[0].relrmse && indirect.max <= bound[0].max && fabs(share) < 0.025)) fail_msg("%s: the indirect light differs", what);
    if (!(all.relrmse <= bound[1].relrmse && all.max <= bound[1].max)) fail_msg("%s: the picture differs", what);
}

static void scales_by_powers_of_two(void** state)
{
    (void)state;
    for (uint32_t method = ES_GI_ISM; method < METHODS; method++) {
        picture one = picture_of(1, es_v3(0, 0, 0), method);
        const int exponents[] = {-14, -7, -1, 3, 14};
        for (size_t i = 0; i < 5; i = stress_next(i, 5)) {
            char what[40];
            snprintf(what, sizeof what, "method %u, scale 2^%d", method, exponents[i]);
            float scale = ldexpf(1, exponents[i]);
            picture other = picture_of(scale, es_v3(0, 0, 0), method);
            assert_same(&other, &one, scale, what);
            free_picture(&other);
        }
        free_picture(&one);
    }
}

static void scales(void** state)
{
    (void)state;
    for (uint32_t method = ES_GI_ISM; method < METHODS; method++) {
        picture one = picture_of(1, es_v3(0, 0, 0), method);
        const float scale[] = {1e-4f, 1e-3f, 0.1f, 10, 1e3f, 1e4f};
        for (size_t i = 0; i < 6; i = stress_next(i, 6)) {
            char what[40];
            snprintf(what, sizeof what, "method %u, scale %g", method, (double)scale[i]);
            picture other = picture_of(scale[i], es_v3(0, 0, 0), method);
            assert_close(what, method, &other, &one, (double)scale[i]);
            free_picture(&other);
        }
        free_picture(&one);
    }
}

/* Frames of a world that moves, motion included. Across powers of two they are equal, elsewhere as close as frames that stand. */
static void moving_frames(void** state)
{
    (void)state;
    const struct { float scale; es_vec3 to; bool exact; } cases[] = {{0x1p-14f, {0, 0, 0}, true}, {0x1p14f, {0, 0, 0}, true}, {1, {131072, -65536, 98304}, true}, {1e-4f, {0, 0, 0}, false}, {1e4f, {0, 0, 0}, false},
        {1, {-12345.67f, 3210.9f, 777.7f}, false}, {1, {1e5f, 1e5f, 1e5f}, false}};
    for (uint32_t method = ES_GI_ISM; method < METHODS; method++) {
        picture one = frame_of(1, es_v3(0, 0, 0), method, true);
        for (size_t i = 0; i < sizeof cases / sizeof *cases; i = stress_next(i, sizeof cases / sizeof *cases)) {
            char what[80];
            snprintf(what, sizeof what, "method %u, moving, scale %g, at %g", method, (double)cases[i].scale, (double)cases[i].to.x);
            picture other = frame_of(cases[i].scale, cases[i].to, method, true);
            if (cases[i].exact) assert_same(&other, &one, cases[i].scale, what);
            else assert_close(what, method, &other, &one, (double)cases[i].scale);
            size_t apart = 0, moved = 0;
            for (size_t k = 0; k < values_of(&one.motion); k++) {
                moved += fabsf(one.motion.pixels[k]) > 0.1f;
                apart += !(fabsf(other.motion.pixels[k] - one.motion.pixels[k]) < 0.05f);
            }
            assert_true(moved > 1000);
            if (apart > 20) fail_msg("%s: %zu values of the motion differ by a twentieth of a pixel", what, apart);
            free_picture(&other);
        }
        free_picture(&one);
    }
}

static void moves_by_powers_of_two(void** state)
{
    (void)state;
    picture one = picture_of(1, es_v3(0, 0, 0), ES_GI_ISM), small = picture_of(0x1p-7f, es_v3(0, 0, 0), ES_GI_ISM);
    picture other = picture_of(1, es_v3(131072, -65536, 98304), ES_GI_ISM);
    assert_same(&other, &one, 1, "moved by 2^17");
    free_picture(&other);
    other = picture_of(0x1p-7f, es_v3(131072, -65536, 98304), ES_GI_ISM);
    assert_same(&other, &small, 1, "of scale 2^-7, moved by 2^17");
    free_picture(&other);
    free_picture(&one);
    free_picture(&small);
}

static void moves(void** state)
{
    (void)state;
    for (uint32_t method = ES_GI_ISM; method < METHODS; method++) {
        picture one = picture_of(1, es_v3(0, 0, 0), method);
        const es_vec3 to[] = {{1.7f, -0.3f, 0.9f}, {100.1f, 50.7f, -33.3f}, {-12345.67f, 3210.9f, 777.7f}, {1e5f, 1e5f, 1e5f}, {-1e5f, 7.7f, 99999.9f}};
        for (size_t i = 0; i < 5; i = stress_next(i, 5)) {
            char what[60];
            snprintf(what, sizeof what, "method %u, moved to %g %g %g", method, (double)to[i].x, (double)to[i].y, (double)to[i].z);
            picture other = picture_of(1, to[i], method);
            assert_close(what, method, &other, &one, 1);
            free_picture(&other);
        }
        free_picture(&one);
    }
    /* small and far: millimetres, 141 km from zero */
    for (int i = 0; i < 2; i++) {
        float scale = i ? 1e4f : 1e-3f;
        picture one = picture_of(scale, es_v3(0, 0, 0), ES_GI_ISM), other = picture_of(scale, es_v3(-1e5f, 7.7f, 99999.9f), ES_GI_ISM);
        assert_close(i ? "scale 1e4, moved" : "scale 1e-3, moved", ES_GI_ISM, &other, &one, 1);
        free_picture(&one);
        free_picture(&other);
    }
}

/* ---- the reference ---------------------------------------------------------------------------------------------------------------- */

static float* traced(float scale, es_vec3 offset)
{
    enum { VALUES = 24 * 18 * 3 };
    stress s = stress_open(scale, offset);
    stress_room(&s);
    es_reference_settings settings = es_default_reference_settings();
    settings.width = 24;
    settings.height = 18;
    settings.bounces = 3;
    es_reference* reference;
    es_image image;
    assert_int_equal(es_reference_create(s.context, &settings, &reference), ES_OK);
    assert_int_equal(es_reference_begin(reference, s.world), ES_OK);
    assert_int_equal(es_reference_add(reference, 16), ES_OK);
    assert_int_equal(es_reference_image(reference, "radiance", &image), ES_OK);
    assert_int_equal(values_of(&image), VALUES);
    float* copy = malloc(VALUES * sizeof(float));
    memcpy(copy, image.pixels, VALUES * sizeof(float));
    es_image_destroy(s.context, &image);
    es_reference_destroy(reference);
    stress_close(&s);
    return copy;
}

/* Paths branch where rays pass within rounding of an edge: a few of them go elsewhere. */
static void references(void** state)
{
    (void)state;
    es_image one = {.width = 24, .height = 18, .channels = 3, .pixels = traced(1, es_v3(0, 0, 0))}, other = one;
    const struct { float scale; es_vec3 offset; } cases[] = {{0x1p-7f, {0, 0, 0}}, {1e-4f, {0, 0, 0}}, {1e-3f, {0, 0, 0}}, {10, {0, 0, 0}}, {1e4f, {0, 0, 0}}, {1, {131072, -65536, 98304}}, {1, {1e5f, 1e5f, 1e5f}}, {1, {-12345.67f, 3210.9f, 777.7f}}, {1e-3f, {-1e5f, 7.7f, 99999.9f}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        other.pixels = traced(cases[i].scale, cases[i].offset);
        difference d = difference_of(&other, &one, 1);
        printf("    reference, scale %g, moved to %g %g %g: relRMSE %.1e, max %.1e\n", (double)cases[i].scale, (double)cases[i].offset.x, (double)cases[i].offset.y, (double)cases[i].offset.z, d.relrmse, d.max);
        if (!(d.relrmse <= 0.05 && d.max < 5)) fail_msg("scale %g: the reference differs", (double)cases[i].scale);
        free(other.pixels);
    }
    free(one.pixels);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scales_by_powers_of_two),
        cmocka_unit_test(scales),
        cmocka_unit_test(moving_frames),
        cmocka_unit_test(moves_by_powers_of_two),
        cmocka_unit_test(moves),
        cmocka_unit_test(references),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
