/* Points that stand for the scene in imperfect shadow maps: how evenly they lie, whose they are, and what they do while things move. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/scene_points.h"
#include "tests/small_worlds.h"

enum { SIZE = 256, SUBSETS = 16, GRID = 8 };

typedef struct stage { small_world w; es_mesh sheet; es_instance instances[4]; uint32_t count; es_scene_points points; } stage;

/* GRID × GRID quads over a unit square in the plane y = 0. */
static void sheet_vertices(float p[(GRID + 1) * (GRID + 1) * 3])
{
    for (int j = 0; j <= GRID; j++)
        for (int i = 0; i <= GRID; i++, p += 3) {
            p[0] = (float)i / GRID;
            p[1] = 0;
            p[2] = (float)-j / GRID;
        }
}

static es_mesh add_sheet(small_world* w)
{
    float p[(GRID + 1) * (GRID + 1) * 3];
    uint32_t indices[GRID * GRID * 6], n = 0;
    sheet_vertices(p);
    for (uint32_t j = 0; j < GRID; j++)
        for (uint32_t i = 0; i < GRID; i++) {
            uint32_t a = j * (GRID + 1) + i, b = a + 1, c = a + GRID + 1, d = c + 1;
            const uint32_t quad[6] = {a, b, d, a, d, c};
            memcpy(indices + n, quad, sizeof quad);
            n += 6;
        }
    es_mesh mesh;
    es_mesh_desc desc = {.vertex_count = (GRID + 1) * (GRID + 1), .triangle_count = GRID * GRID * 2, .positions = p, .indices = indices, .flat_normals = true};
    assert_int_equal(es_world_add_mesh(w->world, &desc, &mesh), ES_OK);
    return mesh;
}

static void add_to_stage(stage* s, es_mesh mesh, es_vec3 at, es_vec3 scale, float weight)
{
    es_node_desc node = {.transform = {at, es_quat_identity(), scale}};
    es_instance_desc desc = {.mesh = mesh, .point_weight = weight};
    assert_int_equal(es_world_add_node(s->w.world, &node, &desc.node), ES_OK);
    assert_int_equal(es_world_add_instance(s->w.world, &desc, &s->instances[s->count++]), ES_OK);
}

/* A sheet, and two others of a mesh of their own, one of them twice as long. */
static stage open_stage(void)
{
    stage s = {.w = small_world_create()};
    s.sheet = add_sheet(&s.w);
    es_mesh other = add_sheet(&s.w);
    add_to_stage(&s, s.sheet, es_v3(0, 0, 0), es_v3(1, 1, 1), 0);
    add_to_stage(&s, other, es_v3(2, 0, 0), es_v3(1, 1, 1), 0);
    add_to_stage(&s, other, es_v3(5, 0, 0), es_v3(2, 1, 1), 0);
    assert_int_equal(es_world_step(s.w.world, 0), ES_OK);
    return s;
}

static uint64_t update(stage* s, float detail)
{
    uint64_t moved;
    const es_point_request request = {SIZE, SUBSETS, detail};
    assert_int_equal(es_scene_points_update(s->w.context, &s->points, es_world_draw_list(s->w.world), &request, &moved), ES_OK);
    return moved;
}

static void close_stage(stage* s)
{
    es_scene_points_free(s->w.context, &s->points);
    small_world_destroy(&s->w);
}

static uint32_t points_in_subset(const stage* s, uint32_t instance, uint32_t subset)
{
    const es_point_source* source = &s->points.sources[instance];
    return es_scene_points_border(&s->points, subset, source->end) - es_scene_points_border(&s->points, subset, source->begin);
}

static double points_of(const stage* s, uint32_t instance)
{
    double count = 0;
    for (uint32_t subset = 0; subset < SUBSETS; subset++) count += points_in_subset(s, instance, subset);
    return count;
}

/* Largest difference between the share of points in a box [0, a) × [0, b) and its area, over 32 × 32 boxes. */
static double discrepancy(const double (*p)[2], uint32_t count)
{
    double worst = 0;
    for (int i = 1; i <= 32; i++)
        for (int j = 1; j <= 32; j++) {
            uint32_t inside = 0;
            for (uint32_t k = 0; k < count; k++) inside += p[k][0] < i / 32.0 && p[k][1] < j / 32.0;
            worst = fmax(worst, fabs((double)inside / count - i * j / 1024.0));
        }
    return worst;
}

/* On a square of two triangles and on a sheet of many, a subset's points and all of them, against as many random ones. */
static void test_points_lie_evenly(void** state)
{
    (void)state;
    static double places[SIZE * SUBSETS][2], random[SIZE * SUBSETS][2];
    uint32_t bits = 12345;
    for (uint32_t i = 0; i < SIZE * SUBSETS; i++)
        for (int k = 0; k < 2; k++) {
            bits = bits * 1664525u + 1013904223u;
            random[i][k] = (bits >> 8) / 16777216.0;
        }
    for (int many = 0; many < 2; many++) {
        stage s = {.w = small_world_create()};
        if (many) {
            add_to_stage(&s, add_sheet(&s.w), es_v3(0, 0, 0), es_v3(1, 1, 1), 0);
        } else {
            es_material_desc grey = lambert(0.5f, 0);
            add_rectangle(&s.w, es_v3(0, 0, 0), es_v3(1, 0, 0), es_v3(0, 0, -1), &grey);
        }
        assert_int_equal(es_world_step(s.w.world, 0), ES_OK);
        assert_int_equal(update(&s, 0), SIZE * SUBSETS);
        for (uint32_t i = 0; i < SIZE * SUBSETS; i++) {
            places[i][0] = (double)s.points.x[i];
            places[i][1] = (double)-s.points.z[i];
        }
        double subset = 0, of_random = 0;
        for (uint32_t k = 0; k < SUBSETS; k++) {
            subset += discrepancy((const double(*)[2])places + k * SIZE, SIZE) / SUBSETS;
            of_random += discrepancy((const double(*)[2])random + k * SIZE, SIZE) / SUBSETS;
        }
        double all = discrepancy((const double(*)[2])places, SIZE * SUBSETS), all_random = discrepancy((const double(*)[2])random, SIZE * SUBSETS);
        print_message("%s: subsets %.4f (random %.4f), all %.4f (random %.4f)\n", many ? "sheet" : "square", subset, of_random, all, all_random);
        assert_true(subset < 0.6 * of_random);
        assert_true(all < 0.5 * all_random);
        close_stage(&s);
    }
}

/* Numbers follow area, weight and ism.detail; every subset has them to one. */
static void test_objects_have_their_shares(void** state)
{
    (void)state;
    static const struct { float weights[3], detail; double shares[3]; } cases[] = {
        {{0, 0, 0}, 0, {1, 1, 2}}, {{1, 4, 1}, 0, {1, 4, 2}}, {{0, -1, 0}, 0, {1, 0, 2}}, {{0, 0, 0}, 1, {1, 1, 1}}, {{2, 0, 0.5f}, 0.5f, {2, 1, 0.70710678}}};
    stage s = open_stage();
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        for (int i = 0; i < 3; i++) {
            es_instance_desc desc;
            assert_int_equal(es_world_get_instance(s.w.world, s.instances[i], &desc), ES_OK);
            desc.point_weight = cases[c].weights[i];
            assert_int_equal(es_world_set_instance(s.w.world, s.instances[i], &desc), ES_OK);
        }
        update(&s, cases[c].detail);
        double sum = cases[c].shares[0] + cases[c].shares[1] + cases[c].shares[2];
        /* 0.7: twice the area, at 2^-0.5 times the density, times 0.5 */
        for (uint32_t i = 0; i < 3; i++)
            for (uint32_t k = 0; k < SUBSETS; k++)
                if (!(fabs(points_in_subset(&s, i, k) - SIZE * cases[c].shares[i] / sum) <= 1.001)) fail_msg("case %zu, object %u: %u points, %.2f expected", c, i, points_in_subset(&s, i, k), SIZE * cases[c].shares[i] / sum);
        /* what a point stands for: the squares of each rank cover the area of its objects */
        double covered = 0, area = 0, from = 0;
        for (uint32_t k = 0; k < s.points.rank_count; k++) {
            covered += (s.points.rank_end[k] - from) * (double)s.points.rank_width[k] * (double)s.points.rank_width[k];
            from = s.points.rank_end[k];
        }
        for (uint32_t i = 0; i < 3; i++) area += cases[c].shares[i] > 0 ? i == 2 ? 2 : 1 : 0;
        assert_true(fabs(covered / area - 1) < 0.01);
    }
    es_instance_desc desc;
    assert_int_equal(es_world_get_instance(s.w.world, s.instances[0], &desc), ES_OK);
    desc.point_weight = NAN;
    assert_int_equal(es_world_set_instance(s.w.world, s.instances[0], &desc), ES_INVALID_ARGUMENT);
    desc.point_weight = 2e6f;
    assert_int_equal(es_world_set_instance(s.w.world, s.instances[0], &desc), ES_INVALID_ARGUMENT);
    close_stage(&s);
}

/* x drawn out to x^power over the sheet, and bent upwards */
static void deform(stage* s, double power, double bend)
{
    float p[(GRID + 1) * (GRID + 1) * 3];
    sheet_vertices(p);
    for (int v = 0; v < (GRID + 1) * (GRID + 1); v++) {
        p[3 * v + 1] = (float)(bend * (double)p[3 * v] * (double)p[3 * v]);
        p[3 * v] = (float)pow((double)p[3 * v], power);
    }
    assert_int_equal(es_world_deform_mesh(s->w.world, s->sheet, p, NULL), ES_OK);
}

typedef struct places { uint32_t triangle[SIZE * SUBSETS], barycentric[SIZE * SUBSETS]; float x[SIZE * SUBSETS], y[SIZE * SUBSETS], z[SIZE * SUBSETS]; } places;
static places places_of(const es_scene_points* p)
{
    places copy;
    memcpy(copy.triangle, p->triangle, sizeof copy.triangle);
    memcpy(copy.barycentric, p->barycentric, sizeof copy.barycentric);
    memcpy(copy.x, p->x, sizeof copy.x);
    memcpy(copy.y, p->y, sizeof copy.y);
    memcpy(copy.z, p->z, sizeof copy.z);
    return copy;
}

/* Points ride on a mesh that deforms little; one that deforms strongly has its own spread anew, as if it had been so from the start, and no
 * other's are touched. */
static void test_points_follow_meshes(void** state)
{
    (void)state;
    static places first, now, alone;
    stage s = open_stage();
    update(&s, 0);
    first = places_of(&s.points);
    const uint64_t own = (uint64_t)points_of(&s, 0);

    deform(&s, 1.2, 0.3);
    assert_int_equal(update(&s, 0), own);
    assert_int_equal(s.points.redistributed, 0);
    assert_false(s.points.sources[0].strong);
    now = places_of(&s.points);
    assert_memory_equal(now.triangle, first.triangle, sizeof now.triangle);
    assert_memory_equal(now.barycentric, first.barycentric, sizeof now.barycentric);
    const es_raster_mesh* mesh = es_world_mesh(s.w.world, s.sheet);
    for (uint32_t k = 0; k < SUBSETS; k++)
        for (uint32_t i = es_scene_points_border(&s.points, k, s.points.sources[0].begin); i < es_scene_points_border(&s.points, k, s.points.sources[0].end); i++) {
            const size_t at = (size_t)k * SIZE + i;
            const float *a = mesh->positions + 4 * (size_t)mesh->indices[3 * now.triangle[at]], *b = mesh->positions + 4 * (size_t)mesh->indices[3 * now.triangle[at] + 1],
                        *c = mesh->positions + 4 * (size_t)mesh->indices[3 * now.triangle[at] + 2];
            double u = (now.barycentric[at] & 0xffff) / 65535.0, v = (now.barycentric[at] >> 16) / 65535.0;
            const double place[3] = {(double)now.x[at], (double)now.y[at], (double)now.z[at]};
            for (int d = 0; d < 3; d++) assert_true(fabs(place[d] - ((1 - u - v) * (double)a[d] + u * (double)b[d] + v * (double)c[d])) < 1e-5);
        }

    deform(&s, 4, 0);
    update(&s, 0);
    assert_int_equal(s.points.redistributed, own);
    assert_true(s.points.sources[0].strong);
    now = places_of(&s.points);
    uint32_t elsewhere = 0, right = 0;
    for (uint32_t k = 0; k < SUBSETS; k++)
        for (uint32_t i = 0; i < SIZE; i++) {
            const size_t at = (size_t)k * SIZE + i;
            const bool sheet = i < es_scene_points_border(&s.points, k, s.points.sources[0].end);
            elsewhere += !sheet && (now.triangle[at] != first.triangle[at] || now.barycentric[at] != first.barycentric[at] || now.x[at] != first.x[at] || now.y[at] != first.y[at] || now.z[at] != first.z[at]);
            right += sheet && now.x[at] >= 0.5f;
        }
    assert_int_equal(elsewhere, 0);
    /* x^4 puts half of the sheet beyond x = 0.5, where 16 % of its points at rest are; what exceeds the stretch by two has come */
    print_message("points on the stretched half: %.3f of its share\n", right / (0.5 * (double)own));
    assert_true(right > 0.6 * 0.5 * (double)own && right < 1.05 * 0.5 * (double)own);

    es_scene_points fresh = {0};
    uint64_t moved;
    assert_int_equal(es_scene_points_update(s.w.context, &fresh, es_world_draw_list(s.w.world), &(es_point_request){SIZE, SUBSETS, 0}, &moved), ES_OK);
    alone = places_of(&fresh);
    assert_memory_equal(&alone, &now, sizeof now);
    es_scene_points_free(s.w.context, &fresh);

    deform(&s, 1, 0);
    update(&s, 0);
    now = places_of(&s.points);
    assert_memory_equal(&now, &first, sizeof now);
    assert_int_equal(update(&s, 0), 0);
    close_stage(&s);
}

/* Turning and moving things, on and on, spreads nothing anew, and a renderer that has seen it all has the points of one that has not. */
static void test_rigid_motion_spreads_nothing(void** state)
{
    (void)state;
    static places now, alone;
    stage s = open_stage();
    es_instance_desc desc;
    assert_int_equal(es_world_get_instance(s.w.world, s.instances[1], &desc), ES_OK);
    update(&s, 0);
    for (int frame = 0; frame < 40; frame++) {
        es_transform transform = {es_v3((float)frame * 0.1f, 1, 0), es_quat_from_axis_angle(es_v3_normalize(es_v3(1, 2, (float)frame * 0.3f), es_v3(0, 1, 0)), (float)frame * 0.37f), es_v3(1, 1, 1)};
        assert_int_equal(es_world_set_node_transform(s.w.world, desc.node, &transform), ES_OK);
        assert_int_equal(es_world_step(s.w.world, 1.0f / 60), ES_OK);
        assert_int_equal(update(&s, 0), (uint64_t)points_of(&s, 1));
        assert_int_equal(s.points.redistributed, 0);
    }
    es_scene_points fresh = {0};
    uint64_t moved;
    assert_int_equal(es_scene_points_update(s.w.context, &fresh, es_world_draw_list(s.w.world), &(es_point_request){SIZE, SUBSETS, 0}, &moved), ES_OK);
    now = places_of(&s.points);
    alone = places_of(&fresh);
    assert_memory_equal(&alone, &now, sizeof now);
    es_scene_points_free(s.w.context, &fresh);
    close_stage(&s);
}

/* A frame of a built-in scene that moves: drawn alone, and after the frames before it. */
static void test_a_frame_alone_and_in_a_sequence(void** state)
{
    (void)state;
    enum { FRAMES = 3 };
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = 96;
    settings.height = 72;
    settings.vpls = 32;
    settings.interleave = 4;
    settings.ism_size = 64;
    settings.ism_points = 1024;
    settings.ism_pool = 8192;
    settings.shadow_size = settings.light_size = 64;
    uint64_t hashes[2][3];
    for (int run = 0; run < 2; run++) {
        es_context_desc context_desc = es_default_context_desc();
        context_desc.threads = 2;
        es_context* context;
        es_world* world;
        es_renderer* renderer;
        assert_int_equal(es_context_create(&context_desc, &context), ES_OK);
        assert_int_equal(es_world_create_scene(context, "cornell", NULL, &world), ES_OK);
        assert_int_equal(es_renderer_create(context, &settings, &renderer), ES_OK);
        for (int frame = 0; frame <= FRAMES; frame++) {
            assert_int_equal(es_world_step(world, frame ? 0.5f : 0), ES_OK);
            if (run == 0 || frame == FRAMES) assert_int_equal(es_renderer_render(renderer, world), ES_OK);
        }
        static const char* const names[3] = {"radiance", "indirect", "ism"};
        for (int i = 0; i < 3; i++) {
            es_image image;
            assert_int_equal(es_renderer_image(renderer, names[i], &image), ES_OK);
            hashes[run][i] = es_image_hash(&image);
            es_image_destroy(context, &image);
        }
        es_renderer_destroy(renderer);
        es_world_destroy(world);
        es_context_destroy(context);
    }
    for (int i = 0; i < 3; i++) assert_int_equal(hashes[0][i], hashes[1][i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_lie_evenly),
        cmocka_unit_test(test_objects_have_their_shares),
        cmocka_unit_test(test_points_follow_meshes),
        cmocka_unit_test(test_rigid_motion_spreads_nothing),
        cmocka_unit_test(test_a_frame_alone_and_in_a_sequence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
