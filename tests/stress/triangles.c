/* Triangles no one would model: slivers, needles, without area, in one place twice, as big as the world, smaller than a pixel. Seen by the
 * rasterizer, by rays, by points and by virtual lights they are what their plane is, and where two lie in one place, the first one wins. */
#include "tests/stress/stress.h"
#include "tests/races.h"
#include "gi/reference/bvh.h"
#include "sim/world.h"

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT };

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { SIDE = 120 };
#else
enum { SIDE = 708 };
#endif

/* ---- what is compared ----------------------------------------------------------------------------------------------------------------- */

typedef struct setting { const char* name; uint32_t method, bias; } setting;
static const setting methods[] = {{"ism", ES_GI_ISM, 0}, {"classic", ES_GI_CLASSIC, 0}, {"traced", ES_GI_VPL_TRACED, ES_TRACED_BOUNDED}, {"compensated", ES_GI_VPL_TRACED, ES_TRACED_COMPENSATED}};
enum { METHODS = 4, REFERENCE = METHODS };

static es_renderer_settings settings_of(size_t method)
{
    es_renderer_settings settings = stress_settings(WIDTH, HEIGHT, methods[method].method);
    settings.vpls = 128;
    settings.traced_bias = methods[method].bias;
    settings.traced_samples = 4;
    return settings;
}

static es_image reference_of(stress* s)
{
    es_reference_settings settings = es_default_reference_settings();
    settings.width = WIDTH;
    settings.height = HEIGHT;
    settings.antialias = false;
    es_reference* reference;
    es_image image;
    assert_int_equal(es_reference_create(s->context, &settings, &reference), ES_OK);
    assert_int_equal(es_reference_begin(reference, s->world), ES_OK);
    assert_int_equal(es_reference_add(reference, 4), ES_OK);
    assert_int_equal(es_reference_image(reference, "radiance", &image), ES_OK);
    es_reference_destroy(reference);
    return image;
}

/* ---- a mesh by hand ------------------------------------------------------------------------------------------------------------------- */

typedef struct mesh { float* positions; uint32_t *indices, vertices, triangles, vertex_room, triangle_room; } mesh;

static uint32_t vertex(mesh* m, es_vec3 p)
{
    if (m->vertices == m->vertex_room) m->positions = realloc(m->positions, (m->vertex_room = 2 * m->vertex_room + 64) * 3 * sizeof(float));
    memcpy(m->positions + 3 * m->vertices, &p, 3 * sizeof(float));
    return m->vertices++;
}

static void triangle(mesh* m, uint32_t a, uint32_t b, uint32_t c)
{
    if (m->triangles == m->triangle_room) m->indices = realloc(m->indices, (m->triangle_room = 2 * m->triangle_room + 64) * 3 * sizeof(uint32_t));
    const uint32_t corners[3] = {a, b, c};
    memcpy(m->indices + 3 * m->triangles++, corners, sizeof corners);
}

static void add(stress* s, mesh* m, const es_material_desc* material)
{
    stress_mesh(s, &(es_mesh_desc){.vertex_count = m->vertices, .triangle_count = m->triangles, .positions = m->positions, .indices = m->indices, .flat_normals = true}, material, s->root);
    free(m->positions);
    free(m->indices);
    *m = (mesh){0};
}

/* ---- one plane, cut up in different ways ------------------------------------------------------------------------------------------------ */

typedef enum cut { WHOLE, NEEDLES, FAN, GRADED, MILLION, DEGENERATE, CUTS } cut;
static const char* const cut_names[] = {"two triangles", "needles", "a fan of slivers", "strips from 2 m down to 1e-7 m", "a million triangles", "triangles without area between"};

static float unevenly(uint32_t i) { return (float)es_random_u32(7, i) / 4294967296.0f; }

/* 4 × 4 m on the floor about the origin, facing up. */
static mesh floor_of(cut how)
{
    mesh m = {0};
    if (how == NEEDLES) { /* 2048 strips of 4 m × 2 mm, their ends slightly apart: aspect ratios of 2000 and more */
        enum { STRIPS = 2048 };
        for (uint32_t i = 0; i <= STRIPS; i++) {
            float x = -2 + 4 * ((float)i + (i > 0 && i < STRIPS ? 0.8f * unevenly(i) : 0)) / STRIPS, x2 = -2 + 4 * ((float)i + (i > 0 && i < STRIPS ? 0.8f * unevenly(i + STRIPS) : 0)) / STRIPS;
            uint32_t a = vertex(&m, es_v3(x, 0, 2)), b = vertex(&m, es_v3(x2, 0, -2));
            if (i) triangle(&m, a - 2, a, b), triangle(&m, a - 2, b, b - 2);
        }
    } else if (how == FAN) { /* all from one corner: as thin as they come near it */
        enum { BLADES = 3000 };
        uint32_t corner = vertex(&m, es_v3(-2, 0, 2)), last = vertex(&m, es_v3(2, 0, 2));
        for (uint32_t i = 1; i <= 2 * BLADES; i++) {
            float t = (float)(i <= BLADES ? i : i - BLADES) / BLADES;
            uint32_t next = vertex(&m, i <= BLADES ? es_v3(2, 0, 2 - 4 * t) : es_v3(2 - 4 * t, 0, -2));
            triangle(&m, corner, last, next);
            last = next;
        }
    } else if (how == GRADED) { /* each strip half as wide as the one before it, to where floats end, then the rest */
        float x = -2, width = 2;
        uint32_t a = vertex(&m, es_v3(x, 0, 2)), b = vertex(&m, es_v3(x, 0, -2));
        while (x < 2) {
            x = width > 1e-7f ? x + width : 2;
            width *= 0.5f;
            uint32_t c = vertex(&m, es_v3(x, 0, 2)), d = vertex(&m, es_v3(x, 0, -2));
            triangle(&m, a, c, d);
            triangle(&m, a, d, b);
            a = c;
            b = d;
        }
    } else if (how == MILLION) {
        for (uint32_t j = 0; j <= SIDE; j++)
            for (uint32_t i = 0; i <= SIDE; i++) {
                vertex(&m, es_v3(-2 + 4 * (float)i / SIDE, 0, 2 - 4 * (float)j / SIDE));
                if (!i || !j) continue;
                uint32_t d = m.vertices - 1, c = d - 1, b = d - SIDE - 1, a = b - 1;
                triangle(&m, a, b, d);
                triangle(&m, a, d, c);
            }
    } else {
        uint32_t a = vertex(&m, es_v3(-2, 0, 2)), b = vertex(&m, es_v3(2, 0, 2)), c = vertex(&m, es_v3(2, 0, -2)), d = vertex(&m, es_v3(-2, 0, -2));
        if (how == DEGENERATE) { /* a point, lines, corners on a line, and as much of it between the two that are whole */
            uint32_t e = vertex(&m, es_v3(0, 0, 0)), f = vertex(&m, es_v3(1, 0, -1)), g = vertex(&m, es_v3(0, 1, 0)), h = vertex(&m, es_v3(0, 2, 0));
            for (int i = 0; i < 50; i++) {
                triangle(&m, e, e, e);
                triangle(&m, a, a, c);
                triangle(&m, a, c, a);
                triangle(&m, e, f, c);
                triangle(&m, e, g, h);
                if (i == 20) triangle(&m, a, b, c);
                if (i == 40) triangle(&m, a, c, d);
            }
        } else {
            triangle(&m, a, b, c);
            triangle(&m, a, c, d);
        }
    }
    return m;
}

/* Above the floor a ball, beside it a wall; the eye sees the floor fill the lower half. */
static stress scene_of(cut how)
{
    stress s = stress_open(1, es_v3(0, 0, 0));
    const es_material_desc white = matte(0.8f, 0.8f, 0.8f), red = matte(0.7f, 0.2f, 0.1f);
    mesh floor = floor_of(how);
    add(&s, &floor, &white);
    stress_rectangle(&s, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 2, 0), &red);
    stress_ball(&s, es_v3(0.3f, 0.6f, -0.2f), 0.45f, 16, false, &white);
    stress_light(&s, ES_LIGHT_SPOT, 30, es_v3(0.3f, 2.8f, 1.4f), es_v3(-0.1f, -1, -0.6f));
    stress_light(&s, ES_LIGHT_POINT, 2, es_v3(-1.3f, 1.4f, 0.9f), es_v3(0, -1, 0));
    stress_look(&s, es_v3(0.1f, 1.6f, 3.4f), es_v3(0, 0.5f, 0), 0.8f, 0.05f);
    return s;
}

typedef struct picture { es_image depth, instance, direct, indirect, radiance; } picture;

static es_image kept(stress* s, es_renderer* renderer, const char* name)
{
    es_image image = stress_image(renderer, name), copy = image;
    copy.pixels = malloc(values_of(&image) * sizeof(float));
    memcpy(copy.pixels, image.pixels, values_of(&image) * sizeof(float));
    es_image_destroy(s->context, &image);
    return copy;
}

static picture picture_of(cut how, size_t method)
{
    picture p = {{0}};
    stress s = scene_of(how);
    if (method == REFERENCE) {
        es_image image = reference_of(&s);
        p.radiance = image;
        p.radiance.pixels = malloc(values_of(&image) * sizeof(float));
        memcpy(p.radiance.pixels, image.pixels, values_of(&image) * sizeof(float));
        es_image_destroy(s.context, &image);
    } else {
        es_renderer_settings settings = settings_of(method);
        es_renderer* renderer = stress_render(&s, &settings);
        assert_all_finite(&s, renderer, cut_names[how]);
        p = (picture){kept(&s, renderer, "depth"), kept(&s, renderer, "instance"), kept(&s, renderer, "direct"), kept(&s, renderer, "indirect"), kept(&s, renderer, "radiance")};
        es_renderer_destroy(renderer);
    }
    stress_close(&s);
    return p;
}

static void free_picture(picture* p)
{
    es_image* const images[] = {&p->depth, &p->instance, &p->direct, &p->indirect, &p->radiance};
    for (int i = 0; i < 5; i++) free(images[i]->pixels);
}

/* However the floor is cut, no pixel shows something else, and triangles without area change no bit. What the cuts share is a plane whose
 * corners are rounded: depths agree to 1e-4, direct light to 1e-3, and indirect light to 5 %: where a texel lies on a border a virtual light
 * moves to the next, and imperfect maps are drawn from other points. The few rays of the compensation that pass within rounding of an edge
 * go elsewhere, which leaves a spot where their pixel is close to what they hit. */
static void cuts_of_a_plane(void** state)
{
    (void)state;
    for (size_t method = 0; method <= REFERENCE; method++) {
        picture whole = picture_of(WHOLE, method);
        for (cut how = NEEDLES; how < CUTS; how++) {
            if (how == MILLION && method == 1) continue; /* 640 half cubes of a million triangles */
            picture other = picture_of(how, method);
            const char* name = method == REFERENCE ? "reference" : methods[method].name;
            difference all = difference_of(&other.radiance, &whole.radiance, 1);
            if (method == REFERENCE) {
                printf("    %-12s %-32s relRMSE: radiance %.1e\n", name, cut_names[how], all.relrmse);
                if (!(all.relrmse <= (how == DEGENERATE ? 0 : 0.05))) fail_msg("%s, %s: another picture", name, cut_names[how]);
            } else {
                size_t elsewhere = 0, spots = 0;
                for (size_t i = 0; i < PIXELS; i++) {
                    elsewhere += other.instance.pixels[i] != whole.instance.pixels[i];
                    spots += fabsf(other.radiance.pixels[3 * i] - whole.radiance.pixels[3 * i]) > 0.1f;
                }
                difference depth = difference_of(&other.depth, &whole.depth, 1), direct = difference_of(&other.direct, &whole.direct, 1), indirect = difference_of(&other.indirect, &whole.indirect, 1);
                printf("    %-12s %-32s relRMSE: depth %.1e direct %.1e indirect %.1e radiance %.1e, %zu pixels elsewhere, %zu spots\n", name, cut_names[how], depth.relrmse, direct.relrmse, indirect.relrmse, all.relrmse, elsewhere, spots);
                if (how == DEGENERATE && (depth.max > 0 || direct.max > 0 || indirect.max > 0)) fail_msg("%s: triangles without area change the picture", name);
                if (!(elsewhere <= 4 && spots <= 4 && depth.relrmse <= 1e-4 && direct.relrmse <= 1e-3 && (methods[method].bias || indirect.relrmse <= 0.05) && all.relrmse <= 0.03)) fail_msg("%s, %s: another picture", name, cut_names[how]);
            }
            free_picture(&other);
        }
        free_picture(&whole);
    }
}

/* ---- rays through cuts ----------------------------------------------------------------------------------------------------------------- */

/* Straight down on a grid that does not keep to the cuts, and on their very edges and corners: no ray falls through. */
static void rays_fall_through_no_cut(void** state)
{
    (void)state;
    for (cut how = WHOLE; how < CUTS; how++) {
        stress s = stress_open(1, es_v3(0, 0, 0));
        const es_material_desc white = matte(0.8f, 0.8f, 0.8f);
        mesh m = floor_of(how);
        const uint32_t vertices = m.vertices;
        float* corners = malloc(3 * vertices * sizeof(float));
        memcpy(corners, m.positions, 3 * vertices * sizeof(float));
        add(&s, &m, &white);
        assert_int_equal(es_world_step(s.world, 0), ES_OK);
        es_bvh* bvh;
        assert_int_equal(es_bvh_create(s.context, &bvh), ES_OK);
        assert_int_equal(es_bvh_build(bvh, es_world_draw_list(s.world)), ES_OK);
        enum { RAYS = 20000 };
        for (uint32_t i = 0; i < RAYS; i++) {
            const float* c = corners + 3 * (es_random_u32(3, i) % vertices);
            float x = i % 2 ? c[0] : 4 * unevenly(3 * i) - 2, z = i % 2 ? c[2] : 4 * unevenly(3 * i + 1) - 2;
            if (i % 2 && (fabsf(x) >= 2 || fabsf(z) >= 2)) continue; /* the border is an edge of one triangle: either way is right */
            es_vec3 from = es_v3(x + 0.3f * (i % 4 > 1), 5, z - 0.2f * (i % 4 > 1));
            es_ray ray = {{from.x, from.y, from.z}, 0, {x - from.x, -5, z - from.z}, 10};
            es_hit hit;
            uint8_t blocked;
            es_bvh_closest(bvh, ES_RAYS_COHERENT, &ray, 1, &hit);
            es_bvh_any(bvh, ES_RAYS_COHERENT, &ray, 1, &blocked);
            if (hit.primitive == ES_NO_PRIMITIVE || !blocked || !(hit.t < 1.0001f)) fail_msg("%s: a ray to %g %g falls through, t %g", cut_names[how], (double)x, (double)z, (double)hit.t);
            if (how != DEGENERATE && !(hit.t > 0.9999f)) fail_msg("%s: a ray to %g %g stops at %g", cut_names[how], (double)x, (double)z, (double)hit.t);
        }
        es_bvh_destroy(bvh);
        free(corners);
        stress_close(&s);
    }
}

/* ---- in one place twice ----------------------------------------------------------------------------------------------------------------- */

static stress doubled(int copies, bool red_first, float turn)
{
    stress s = stress_open(1, es_v3(0, 0, 0));
    const es_material_desc red = matte(0.8f, 0.1f, 0.1f), blue = matte(0.1f, 0.1f, 0.8f);
    for (int i = 0; i < copies; i++) {
        const es_material_desc* material = (i == 0) == red_first ? &red : &blue;
        stress_rectangle(&s, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), material);
        stress_rectangle(&s, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 2, 0), material);
        stress_ball(&s, es_v3(0.3f, 0.6f, -0.2f), 0.45f, 16, false, material);
    }
    stress_light(&s, ES_LIGHT_SPOT, 30, es_v3(0.3f, 2.8f, 1.4f), es_v3(-0.1f, -1, -0.6f));
    stress_light(&s, ES_LIGHT_POINT, 2, es_v3(-1.3f, 1.4f, 0.9f), es_v3(0, -1, 0));
    stress_look(&s, es_v3(0.1f + turn, 1.6f, 3.4f - 0.7f * turn), es_v3(0, 0.5f - 0.2f * turn, 0), 0.8f, 0.05f);
    return s;
}

/* The first of what lies in one place is the one that is seen, in every pixel of every frame, by eye, lamp and ray: with the copies' colours
 * exchanged the picture is another, without the copies it is the same, bit for bit. Points are spread over the copies as well, so that
 * imperfect maps are drawn from fewer of each; their picture is the same but for these. */
static void duplicated(void** state)
{
    (void)state;
    for (size_t method = 0; method <= REFERENCE; method++)
        for (size_t view = 0; view < 4; view = stress_next(view, 4)) {
            const float turn = 0.37f * (float)view;
            es_image image[3];
            uint64_t hash[3];
            stress s[3] = {doubled(1, true, turn), doubled(3, true, turn), doubled(2, false, turn)};
            for (int i = 0; i < 3; i++) {
                if (method == REFERENCE) {
                    image[i] = reference_of(&s[i]);
                } else {
                    es_renderer_settings settings = settings_of(method);
                    es_renderer* renderer = stress_render(&s[i], &settings);
                    assert_all_finite(&s[i], renderer, "duplicates");
                    image[i] = stress_image(renderer, methods[method].method == ES_GI_ISM ? "direct" : "radiance");
                    if (i == 1) {
                        es_image instance = stress_image(renderer, "instance");
                        for (size_t k = 0; k < PIXELS; k++) assert_true(instance.pixels[k] <= 3);
                        es_image_destroy(s[i].context, &instance);
                    }
                    es_renderer_destroy(renderer);
                }
                hash[i] = es_image_hash(&image[i]);
            }
            if (hash[0] != hash[1]) fail_msg("%s, view %d: copies in the same place change the picture, relRMSE %g", method == REFERENCE ? "reference" : methods[method].name, (int)view, difference_of(&image[1], &image[0], 1).relrmse);
            assert_true(hash[0] != hash[2]);
            for (int i = 0; i < 3; i++) {
                es_image_destroy(s[i].context, &image[i]);
                stress_close(&s[i]);
            }
        }
}

/* Coplanar, but cut differently: which one is seen depends on how the depths round. Twice the same view gives twice the same picture, and
 * the same for one thread as for two, whatever was drawn before. */
static void coplanar(void** state)
{
    (void)state;
    uint64_t hash[3];
    size_t second = 0;
    for (int run = 0; run < 3; run++) {
        es_context_desc desc = es_default_context_desc();
        desc.threads = run ? 2 : 1;
        stress s = stress_open_in(&desc, 1, es_v3(0, 0, 0));
        const es_material_desc red = matte(0.8f, 0.1f, 0.1f), blue = matte(0.1f, 0.1f, 0.8f);
        mesh m = floor_of(WHOLE);
        add(&s, &m, &red);
        m = floor_of(FAN);
        add(&s, &m, &blue);
        stress_light(&s, ES_LIGHT_POINT, 2, es_v3(-1.3f, 1.4f, 0.9f), es_v3(0, -1, 0));
        stress_look(&s, es_v3(0.1f, 1.6f, 3.4f), es_v3(0, 0.5f, 0), 0.8f, 0.05f);
        es_renderer_settings settings = settings_of(0);
        es_renderer* renderer = stress_render(&s, &settings);
        if (run == 2) { /* another view between */
            es_light_desc lamp;
            uint32_t id;
            size_t count = 1;
            assert_int_equal(es_world_enumerate(s.world, ES_OBJECT_LIGHT, &id, &count), ES_OK);
            assert_int_equal(es_world_get_light(s.world, (es_light){id}, &lamp), ES_OK);
            lamp.off = true;
            assert_int_equal(es_world_set_light(s.world, (es_light){id}, &lamp), ES_OK);
            assert_int_equal(es_renderer_render(renderer, s.world), ES_OK);
            lamp.off = false;
            assert_int_equal(es_world_set_light(s.world, (es_light){id}, &lamp), ES_OK);
            assert_int_equal(es_renderer_render(renderer, s.world), ES_OK);
        }
        es_image radiance = stress_image(renderer, "radiance"), instance = stress_image(renderer, "instance");
        hash[run] = es_image_hash(&radiance);
        second = 0;
        for (size_t i = 0; i < PIXELS; i++) second += instance.pixels[i] == 2;
        es_image_destroy(s.context, &radiance);
        es_image_destroy(s.context, &instance);
        es_renderer_destroy(renderer);
        stress_close(&s);
    }
    printf("    coplanar, cut differently: the second is seen in %zu of %d pixels\n", second, PIXELS);
    assert_true(hash[0] == hash[1] && hash[1] == hash[2]);
}

/* ---- one for the whole picture ------------------------------------------------------------------------------------------------------------ */

/* A triangle of up to a million kilometres through which the eye looks: each pixel is its, as far away as the plane is. */
static void one_covers_the_picture(void** state)
{
    (void)state;
    const float sizes[] = {10, 1e4f, 9e8f};
    for (int i = 0; i < 3; i++)
        for (size_t method = 0; method < METHODS; method++) {
            stress s = stress_open(1, es_v3(0, 0, 0));
            const es_material_desc white = matte(0.8f, 0.8f, 0.8f);
            mesh m = {0};
            uint32_t a = vertex(&m, es_v3(-sizes[i], -sizes[i], -2)), b = vertex(&m, es_v3(sizes[i], -sizes[i], -2)), c = vertex(&m, es_v3(0, sizes[i], -2));
            triangle(&m, a, b, c);
            add(&s, &m, &white);
            stress_light(&s, ES_LIGHT_POINT, 5, es_v3(0.3f, 0.2f, 0), es_v3(0, 0, -1));
            stress_look(&s, es_v3(0, 0, 0), es_v3(0, 0, -1), 0.8f, 0.05f);
            es_renderer_settings settings = settings_of(method);
            es_renderer* renderer = stress_render(&s, &settings);
            assert_all_finite(&s, renderer, "one triangle");
            es_image depth = stress_image(renderer, "depth"), number = stress_image(renderer, "triangle"), direct = stress_image(renderer, "direct");
            double worst = 0;
            for (size_t k = 0; k < PIXELS; k++) {
                assert_true(number.pixels[k] == 1);
                worst = fmax(worst, fabs((double)depth.pixels[k] / 2 - 1));
                if (sizes[i] <= 10) assert_true(direct.pixels[3 * k] > 0);
            }
            if (method == 0) printf("    one triangle of %g m: depth within %.1e\n", 2 * (double)sizes[i], worst);
            assert_true(worst <= 1e-4);
            es_image_destroy(s.context, &depth);
            es_image_destroy(s.context, &number);
            es_image_destroy(s.context, &direct);
            es_renderer_destroy(renderer);
            stress_close(&s);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(cuts_of_a_plane),
        unit_test_without_races(rays_fall_through_no_cut),
        unit_test_without_races(duplicated),
        cmocka_unit_test(coplanar),
        cmocka_unit_test(one_covers_the_picture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
