/* The room of ../shared/peers: its direct light and its one bounce, by a program that shares no code with this project, and ours.
 *
 * The peer's bounce has 4096 samples a pixel and no word about its error. Both draw the hemisphere by its cosine and connect to the one
 * lamp, so a sample of theirs is taken to vary as one of ours: their variance is ours × our samples / 4096.
 *
 * The two differ by more than noise in one thing, which is made up for here. On a smoothly shaded mesh some directions are above the
 * interpolated normal's horizon and below the triangle's own plane. Our paths end there (gi/reference/path.c). The peer follows them through
 * the triangle into the ball, takes the inside of its far wall for its outside and, where that is in the light, for lit: the ball lights
 * itself, which brightens the bounce by about 1 % of the whole picture. What the peer sees in these directions, and in no other, is traced
 * here in its way and added to ours.
 *
 * `test_peer_room SAMPLES [BLOCK [0]]` takes as many samples, prints every channel's figures and the blocks beyond three standard errors,
 * and fails when there are more than chance allows; the last 0 leaves out what is made up for. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/light_view.h"
#include "gi/pixel_rays.h"
#include "gi/reference/path.h"
#include "platform/context.h"
#include "platform/random.h"
#include "tests/reference_runs.h"

enum { WIDTH = 1024, HEIGHT = 768, PEER_SAMPLES = 4096 };

#define PEERS ES_TEST_SOURCE_DIR "/../shared/peers/"

typedef struct block { double ours[3], theirs[3], variance[3]; } block;

typedef struct comparison {
    es_context* context;
    es_world* world;
    es_trace_scene scene;
    es_pixel_rays rays;
    es_image direct, indirect;         /* theirs */
    uint32_t samples, size;            /* of a pixel; blocks of size × size */
    bool inside;                       /* make up for what the peer sees below triangles */
    float (*seen_inside)[2][3];        /* per pixel: mean, its variance */
} comparison;

static bool exists(const char* path)
{
    FILE* file = fopen(path, "rb");
    if (file) fclose(file);
    return file;
}

static bool open_room(comparison* c)
{
    memset(c, 0, sizeof *c);
#if !defined(ES_WITH_OPENEXR) || !defined(ES_WITH_TINYGLTF)
    return false;
#endif
    if (!exists(PEERS "room_70k.glb") || !exists(PEERS "room_direct_reference.exr") || !exists(PEERS "room_indirect_reference.exr")) return false;
    es_context_desc desc = es_default_context_desc();
    assert_int_equal(es_context_create(&desc, &c->context), ES_OK);
    assert_int_equal(es_world_open(c->context, PEERS "room_70k.glb", NULL, &c->world), ES_OK);
    assert_int_equal(es_world_step(c->world, 0), ES_OK);
    assert_int_equal(es_image_load(c->context, PEERS "room_direct_reference.exr", &c->direct), ES_OK);
    assert_int_equal(es_image_load(c->context, PEERS "room_indirect_reference.exr", &c->indirect), ES_OK);
    const es_image* images[] = {&c->direct, &c->indirect};
    for (int i = 0; i < 2; i++) assert_true(images[i]->width == WIDTH && images[i]->height == HEIGHT && images[i]->channels == 3);
    assert_int_equal(es_trace_scene_take(&c->scene, c->world, true), ES_OK);
    es_raster_view view;
    assert_int_equal(es_world_camera_view(c->world, es_world_active_camera(c->world), WIDTH, HEIGHT, &view), ES_OK);
    c->rays = es_pixel_rays_of_view(&view);
    c->seen_inside = calloc((size_t)WIDTH * HEIGHT, sizeof *c->seen_inside);
    return true;
}

static void close_room(comparison* c)
{
    free(c->seen_inside);
    es_trace_scene_free(&c->scene);
    es_image_destroy(c->context, &c->direct);
    es_image_destroy(c->context, &c->indirect);
    es_world_destroy(c->world);
    assert_int_equal(es_context_bytes(c->context), 0);
    es_context_destroy(c->context);
}

/* A file's channels may come in another order than R, G, B. */
static double channel_of(const es_image* image, size_t pixel, int k)
{
    static const char* const names[] = {"R", "G", "B"};
    int channel = es_image_channel(image, names[k]);
    return (double)image->pixels[3 * pixel + (size_t)(channel < 0 ? k : channel)];
}

/* The peer's light at what a ray hits: the interpolated normal as it is, whichever side was hit; rays begin 1 mm after their origin. */
static es_vec3 light_of_peer(const es_trace_scene* scene, const es_hit* hit, es_vec3 direction)
{
    es_trace_surface s;
    es_vec3 back = es_v3_scale(direction, -1), corner[3];
    es_trace_surface_at(scene, hit, back, false, &s);
    es_bvh_triangle(scene->bvh, hit->primitive, corner);
    bool front = es_v3_dot(es_v3_cross(es_v3_sub(corner[1], corner[0]), es_v3_sub(corner[2], corner[0])), back) >= 0;
    es_vec3 normal = front ? s.normal : es_v3_scale(s.normal, -1);
    const es_light_state* lamp = &scene->lights[0];
    es_vec3 towards = es_v3_sub(lamp->position, s.position);
    float distance = es_v3_length(towards);
    towards = es_v3_scale(towards, 1 / distance);
    float cosine = es_v3_dot(towards, normal), strength = es_light_falloff(lamp, es_v3_scale(towards, -1), distance);
    es_ray shadow = {{s.position.x, s.position.y, s.position.z}, 1e-3f, {towards.x, towards.y, towards.z}, distance - 1e-3f};
    if (cosine <= 0 || strength <= 0 || es_trace_blocked(scene, shadow)) return es_v3(0, 0, 0);
    return es_v3_scale(s.base, cosine * strength * lamp->radiant[0] / (distance * distance) / ES_PI);
}

static void trace_inside(void* user, uint32_t begin_row, uint32_t end_row, uint32_t worker)
{
    comparison* c = user;
    for (uint32_t pixel = begin_row * WIDTH; pixel < end_row * WIDTH; pixel++) {
        es_vec3 d = es_pixel_rays_direction(&c->rays, (float)(pixel % WIDTH), (float)(pixel / WIDTH)), o = es_pixel_rays_position(&c->rays, (float)(pixel % WIDTH), (float)(pixel / WIDTH), 0);
        es_ray ray = {{o.x, o.y, o.z}, 0, {d.x, d.y, d.z}, 3e38f};
        es_hit hit;
        if (!es_trace_closest(&c->scene, ray, true, &hit)) continue;
        es_trace_surface s;
        es_trace_surface_at(&c->scene, &hit, es_v3_normalize(es_v3_scale(d, -1), es_v3(0, 0, 1)), false, &s);
        if (es_v3_dot(s.normal, s.geometric) > 0.999999f) continue;
        es_vec3 t, b;
        es_orthonormal_basis(s.normal, &t, &b);
        double sums[3] = {0}, squares[3] = {0}, n = c->samples;
        for (uint32_t i = 0; i < c->samples; i++) {
            float u[2], sine, cosine;
            es_path_numbers(es_random_u32(41, pixel), 0, i, u);
            es_sincos(2 * ES_PI * u[1], &sine, &cosine);
            es_vec3 wi = es_v3_add(es_v3_scale(s.normal, es_sqrt(1 - u[0])), es_v3_scale(es_v3_add(es_v3_scale(t, cosine), es_v3_scale(b, sine)), es_sqrt(u[0])));
            if (es_v3_dot(s.geometric, wi) > 0) continue;
            ray = (es_ray){{s.position.x, s.position.y, s.position.z}, 1e-3f, {wi.x, wi.y, wi.z}, 3e38f};
            if (!es_trace_closest(&c->scene, ray, false, &hit)) continue;
            es_vec3 light = es_v3_mul(s.base, light_of_peer(&c->scene, &hit, wi));
            const double values[3] = {(double)light.x, (double)light.y, (double)light.z};
            for (int k = 0; k < 3; k++) {
                sums[k] += values[k];
                squares[k] += values[k] * values[k];
            }
        }
        for (int k = 0; k < 3; k++) {
            c->seen_inside[pixel][0][k] = (float)(sums[k] / n);
            c->seen_inside[pixel][1][k] = (float)(fmax(squares[k] / n - sums[k] * sums[k] / (n * n), 0) / (n - 1));
        }
    }
}

typedef struct outcome { uint32_t blocks, beyond, different; double worst, whole[3], relative_error, inside, direct; } outcome;

static outcome compare(comparison* c, uint32_t samples, uint32_t size, bool inside, bool verbose)
{
    c->samples = samples;
    outcome o = {.blocks = (WIDTH / size) * (HEIGHT / size)};
    if (inside) es_parallel_for(c->context, HEIGHT, 8, trace_inside, c);
    small_world w = {c->context, c->world, {0}};
    es_reference_settings settings = reference_settings(WIDTH, HEIGHT, 1);
    es_reference* reference = trace(&w, &settings, samples);
    es_image direct = traced(reference, "direct"), indirect = traced(reference, "indirect"), error = traced(reference, "indirect-error");
    es_reference_destroy(reference);
    double all_direct[2] = {0};
    block whole = {0};
    for (uint32_t b = 0; b < o.blocks; b++) {
        block block = {0};
        uint32_t left = b % (WIDTH / size) * size, top = b / (WIDTH / size) * size;
        for (uint32_t i = 0; i < size * size; i++) {
            size_t pixel = (size_t)(top + i / size) * WIDTH + left + i % size;
            double largest = 0, scale = 0;
            for (int k = 0; k < 3; k++) {
                double e = (double)error.pixels[3 * pixel + (size_t)k], mine = (double)direct.pixels[3 * pixel + (size_t)k], theirs = channel_of(&c->direct, pixel, k);
                block.ours[k] += (double)indirect.pixels[3 * pixel + (size_t)k] + (double)c->seen_inside[pixel][0][k];
                block.theirs[k] += channel_of(&c->indirect, pixel, k);
                block.variance[k] += (e * e + (double)c->seen_inside[pixel][1][k]) * (1 + samples / (double)PEER_SAMPLES);
                o.inside += (double)c->seen_inside[pixel][0][k];
                largest = fmax(largest, fabs(mine - theirs));
                scale = fmax(scale, theirs);
                all_direct[0] += mine;
                all_direct[1] += theirs;
            }
            /* float's rounding, and a tenth of a percent for the lamp's position and cone in a file's decimals */
            o.different += largest > 1e-3 * scale + 1e-6;
        }
        for (int k = 0; k < 3; k++) {
            double z = (block.ours[k] - block.theirs[k]) / sqrt(block.variance[k] + 1e-30);
            o.beyond += fabs(z) > 3;
            o.worst = fmax(o.worst, fabs(z));
            if (verbose && fabs(z) > 3) printf("block %u %u, channel %d: %.6f, theirs %.6f, %+.2f standard errors\n", left, top, k, block.ours[k] / (size * size), block.theirs[k] / (size * size), z);
            whole.ours[k] += block.ours[k];
            whole.theirs[k] += block.theirs[k];
            whole.variance[k] += block.variance[k];
        }
    }
    for (int k = 0; k < 3; k++) o.whole[k] = (whole.ours[k] - whole.theirs[k]) / sqrt(whole.variance[k]);
    o.relative_error = sqrt(whole.variance[1]) / whole.theirs[1];
    o.inside /= whole.theirs[0] + whole.theirs[1] + whole.theirs[2];
    o.direct = all_direct[0] / all_direct[1] - 1;
    if (verbose) {
        const double pixels = (double)WIDTH * HEIGHT;
        printf("indirect: %u blocks × 3 channels, %u beyond 3 standard errors, worst %.2f; seen inside: %.3f %% of all\n", o.blocks, o.beyond, o.worst, 100 * o.inside);
        for (int k = 0; k < 3; k++)
            printf("indirect, whole picture, channel %d: %.7f ± %.7f, theirs %.7f, %+.2f standard errors\n", k, whole.ours[k] / pixels, sqrt(whole.variance[k]) / pixels, whole.theirs[k] / pixels, o.whole[k]);
        printf("direct: %u of %.0f pixels differ, all of it by %+.6f\n", o.different, pixels, o.direct);
    }
    es_image_destroy(c->context, &direct);
    es_image_destroy(c->context, &indirect);
    es_image_destroy(c->context, &error);
    return o;
}

/* Of n standard normal deviates 0.0027 n are expected beyond 3; this many or fewer are with probability 0.999 (Poisson). */
static uint32_t allowed_beyond(uint32_t n)
{
    double mean = 0.0027 * n, term = exp(-mean), sum = term;
    uint32_t k = 0;
    while (sum < 0.999) sum += term *= mean / ++k;
    return k;
}

static void test_room(void** state)
{
    comparison c;
    if (FEWER > 1) skip(); /* a million paths take a sanitizer minutes; the other tests take the same code through it */
    if (!open_room(&c)) {
        print_message("no peers' room: skipped\n");
        skip();
    }
    outcome o = compare(&c, 2, 64, true, false);
    /* 576 deviates: 5 is passed once in three thousand runs */
    if (!(o.beyond <= allowed_beyond(3 * o.blocks) && o.worst < 5)) fail_msg("%u of %u blocks are beyond 3 standard errors, the worst %.2f", o.beyond, 3 * o.blocks, o.worst);
    for (int k = 0; k < 3; k++)
        if (!(fabs(o.whole[k]) < 3.5)) fail_msg("channel %d of the whole picture is off by %.2f standard errors", k, o.whole[k]);
    assert_true(o.relative_error < 0.004);
    /* direct light has no noise: pixels differ where a shadow's or an object's edge passes within rounding of their centres */
    if (!(o.different < WIDTH * HEIGHT / 1000 && fabs(o.direct) < 5e-4)) fail_msg("direct light: %u pixels differ, all of it by %g", o.different, o.direct);
    close_room(&c);
}

int main(int count, char** arguments)
{
    if (count > 1) {
        comparison c;
        if (!open_room(&c)) return 77;
        outcome o = compare(&c, (uint32_t)strtoul(arguments[1], NULL, 10), count > 2 ? (uint32_t)strtoul(arguments[2], NULL, 10) : 32, count < 4 || arguments[3][0] != '0', true);
        close_room(&c);
        return o.beyond > allowed_beyond(3 * o.blocks);
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_room)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
