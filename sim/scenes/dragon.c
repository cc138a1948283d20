/* A dragon wound about a column: see dragon.h.
 *
 * Every part is a closed tube along a curve (sweep.h): the body from the tip of the tail to the nape, the skull, the lower jaw, four legs with four
 * toes each, spines, mane, horns, whiskers. Parts overlap where they meet. Its scales are relief: two staggered nets of shields, of
 * which each point takes the higher, rise towards the tail's end of each shield and drop there. */
#include "sim/scenes/dragon.h"

#include "platform/maths.h"
#include "sim/scenes/sweep.h"

enum { MAX_STATIONS = 24, SPINES = 92, TUFTS = 18, LEGS = 4, TOES = 4, TEETH = 7 };
static const float two_pi = 6.2831853f;

typedef struct artist { es_scene_builder* builder; es_shape *skin, *ivory, *eyes; float scale; } artist;

static uint32_t steps(const artist* a, uint32_t count, uint32_t least)
{
    const uint32_t n = (uint32_t)((float)count * a->scale + 0.5f);
    return n < least ? least : n;
}

/* Angle from +z towards +x, about the column. */
static es_vec3 about(float angle, float radius, float y)
{
    float sine, cosine;
    es_sincos(angle, &sine, &cosine);
    return es_v3(radius * sine, y, radius * cosine);
}

static es_vec3 mix(es_vec3 a, es_vec3 b, float t) { return es_v3_add(a, es_v3_scale(es_v3_sub(b, a), t)); }
static float fraction(float x) { return x - es_floor(x); }

/* ---- scales ------------------------------------------------------------------------------------------------------------ */

typedef struct hide { float columns, pitch, height, fineness; } hide; /* shields around; their length in half axes; height likewise; 0 … 1: how much of it the mesh can carry */

static float shield(float across, float along)
{
    const float edge = 1 - 4 * across * across;
    const float rise = fraction(along - 1.2f * across * across); /* its lower end is round */
    return edge <= 0 ? 0 : edge * (0.30f + 0.70f * (1 - rise));
}

static float scales(const void* parameters, float lengths, float angle, float radius)
{
    const hide* h = parameters;
    const float x = angle / two_pi * h->columns, y = lengths / h->pitch;
    const float first = shield(x - es_floor(x + 0.5f), y), second = shield(x - es_floor(x) - 0.5f, y + 0.5f);
    const float upper = es_maxf(first, second), belly = 0.8f * (1 - fraction(0.7f * y));
    /* plates under the belly, where the angle is three quarters of a turn */
    const float under = es_clampf(3.5f * (-es_sin(angle) - 0.62f), 0, 1);
    return h->fineness * h->height * radius * (upper + under * (belly - upper));
}

/* ---- body -------------------------------------------------------------------------------------------------------------- */

/* Turns about the column, distance from its axis, height, half width. */
static const float coil[][4] = {
    {-2.95f, 1.18f, 0.09f, 0.0f}, {-2.86f, 1.13f, 0.08f, 0.040f}, {-2.72f, 0.98f, 0.09f, 0.070f}, {-2.52f, 0.78f, 0.13f, 0.105f}, {-2.27f, 0.63f, 0.26f, 0.14f}, {-2.0f, 0.57f, 0.50f, 0.165f},
    {-1.75f, 0.56f, 0.74f, 0.185f}, {-1.5f, 0.57f, 0.99f, 0.20f}, {-1.25f, 0.58f, 1.25f, 0.21f}, {-1.0f, 0.58f, 1.51f, 0.215f}, {-0.75f, 0.58f, 1.76f, 0.215f}, {-0.5f, 0.57f, 2.0f, 0.21f},
    {-0.28f, 0.565f, 2.22f, 0.20f}};
enum { COIL = sizeof coil / sizeof coil[0] };
/* From where it leaves the column to inside the skull. */
static const es_sweep_station neck[] = {
    {{-0.38f, 2.42f, 0.43f}, 0.185f, 0.185f, {-0.55f, 0.35f, 0.65f}},
    {{-0.08f, 2.58f, 0.60f}, 0.170f, 0.170f, {-0.40f, 0.75f, 0.45f}},
    {{0.17f, 2.80f, 0.55f}, 0.160f, 0.160f, {-0.75f, 0.45f, -0.35f}},
    {{0.23f, 3.04f, 0.48f}, 0.152f, 0.152f, {-0.25f, 0.30f, -0.90f}},
    {{0.14f, 3.22f, 0.58f}, 0.145f, 0.145f, {-0.05f, 0.75f, -0.60f}},
    {{0.03f, 3.23f, 0.80f}, 0.140f, 0.140f, {0, 1, -0.10f}},
    {{0.0f, 3.15f, 0.98f}, 0.125f, 0.125f, {0, 1, 0.25f}},
    {{0.0f, 3.13f, 1.06f}, 0, 0, {0, 1, 0.25f}}};
enum { NECK = sizeof neck / sizeof neck[0], BODY = COIL + NECK };

static void body_stations(es_sweep_station stations[BODY])
{
    for (int i = 0; i < COIL; i++) {
        const float angle = two_pi * coil[i][0];
        stations[i] = (es_sweep_station){about(angle, coil[i][1], coil[i][2]), coil[i][3], coil[i][3], about(angle, 1, 0.35f)};
        if (i < 4) stations[i].back = es_v3_add(es_v3_scale(stations[i].back, 0.3f), es_v3(0, 1, 0)); /* the tail lies on its belly */
    }
    for (int i = 0; i < NECK; i++) stations[COIL + i] = neck[i];
}

/* Blades along the back, leaning towards the tail; wide along the body, thin across. */
static void add_spines(const artist* a, const es_sweep* body)
{
    for (int k = 0; k < SPINES; k++) {
        const float share = 0.05f + 0.89f * ((float)k + 0.5f) / SPINES;
        const es_sweep_frame f = es_sweep_at(body, share);
        const float height = (k % 2 ? 0.60f : 0.85f) * f.deep, length = 0.30f * f.deep;
        const es_vec3 root = es_v3_add(f.at, es_v3_scale(f.back, 0.90f * f.deep)), lean = es_v3_scale(f.along, -0.65f * height);
        const es_vec3 middle = es_v3_add(root, es_v3_add(es_v3_scale(f.back, 0.55f * height), es_v3_scale(lean, 0.30f)));
        const es_vec3 tip = es_v3_add(root, es_v3_add(es_v3_scale(f.back, height), lean));
        const es_sweep_station stations[] = {{root, 0, 0, f.along}, {mix(root, middle, 0.25f), 0.28f * length, length, f.along}, {middle, 0.20f * length, 0.62f * length, f.along},
            {mix(middle, tip, 0.6f), 0.10f * length, 0.30f * length, f.along}, {tip, 0, 0, f.along}};
        es_shape_sweep(a->skin, &(es_sweep){.stations = stations, .count = 5, .along = steps(a, 16, 4), .around = steps(a, 14, 4)});
    }
}

/* ---- legs -------------------------------------------------------------------------------------------------------------- */

static void add_claw(const artist* a, es_vec3 root, es_vec3 along, es_vec3 down, float length)
{
    const es_vec3 middle = es_v3_add(root, es_v3_scale(along, 0.55f * length));
    const es_vec3 tip = es_v3_add(es_v3_add(root, es_v3_scale(along, 0.95f * length)), es_v3_scale(down, 0.35f * length));
    const float r = 0.20f * length;
    const es_sweep_station stations[] = {{root, 0, 0, down}, {mix(root, middle, 0.15f), r, r, down}, {middle, 0.75f * r, 0.75f * r, down}, {mix(middle, tip, 0.6f), 0.4f * r, 0.4f * r, down}, {tip, 0, 0, down}};
    es_shape_sweep(a->ivory, &(es_sweep){.stations = stations, .count = 5, .along = steps(a, 14, 4), .around = steps(a, 12, 4)});
}

/* Grips the column: from the body at an angle and height, up (1) or down (-1). */
static void add_leg(const artist* a, float turns, float y, float up, float size)
{
    const float angle = two_pi * turns;
    const es_vec3 out = about(angle, 1, 0);
    const es_vec3 hip = about(angle, 0.60f, y), knee = about(angle + 0.42f, 0.92f, y + 0.16f * up), shin = about(angle + 0.36f, 0.72f, y + 0.34f * up), ankle = about(angle + 0.20f, 0.47f, y + 0.44f * up),
                  paw = about(angle + 0.16f, 0.395f, y + 0.50f * up);
    const es_sweep_station stations[] = {{hip, 0, 0, out}, {mix(hip, knee, 0.12f), 0.115f * size, 0.135f * size, out}, {mix(hip, knee, 0.55f), 0.105f * size, 0.125f * size, out},
        {knee, 0.075f * size, 0.080f * size, out}, {shin, 0.062f * size, 0.066f * size, out}, {ankle, 0.050f * size, 0.048f * size, out}, {paw, 0.068f * size, 0.045f * size, out},
        {mix(paw, about(angle + 0.16f, 0.385f, y + 0.56f * up), 1), 0, 0, out}};
    const hide fine = {12, 0.55f, 0.07f, es_clampf(a->scale * 1.4f, 0, 1)};
    es_shape_sweep(a->skin, &(es_sweep){stations, sizeof stations / sizeof stations[0], steps(a, 150, 10), steps(a, 60, 6), scales, &fine});
    for (int k = 0; k < TOES; k++) {
        const float spread = 0.17f * ((float)k - 0.5f * (TOES - 1)), reach = k == 0 ? 0.13f : 0.17f;
        const es_vec3 a0 = about(angle + 0.16f + 0.35f * spread, 0.405f, y + 0.49f * up), a1 = about(angle + 0.16f + 1.3f * spread, 0.425f, y + (0.49f + 0.5f * reach) * up),
                      a2 = about(angle + 0.16f + 1.8f * spread, 0.395f, y + (0.49f + reach) * up);
        const es_vec3 normal = es_v3_normalize(es_v3(a2.x, 0, a2.z), out);
        const float r = 0.028f * size;
        const es_sweep_station toe[] = {{a0, 0, 0, normal}, {mix(a0, a1, 0.3f), 1.05f * r, 1.05f * r, normal}, {a1, 1.15f * r, 1.15f * r, normal}, {mix(a1, a2, 0.5f), 0.85f * r, 0.85f * r, normal},
            {a2, 0.9f * r, 0.9f * r, normal}, {mix(a1, a2, 1.25f), 0, 0, normal}};
        es_shape_sweep(a->skin, &(es_sweep){.stations = toe, .count = 6, .along = steps(a, 28, 6), .around = steps(a, 18, 4)});
        add_claw(a, a2, es_v3_normalize(es_v3_sub(a2, a1), out), es_v3_scale(normal, -1), 0.085f * size);
    }
}

/* ---- head -------------------------------------------------------------------------------------------------------------- */

/* The head's own axes: x to its left, y up, z forward. */
static const es_vec3 head_at = {0, 3.13f, 1.02f}, head_left = {1, 0, 0}, head_up = {0, 0.966f, 0.259f}, head_forward = {0, -0.259f, 0.966f};

static es_vec3 head_direction(float x, float y, float z) { return es_v3_add(es_v3_scale(head_left, x), es_v3_add(es_v3_scale(head_up, y), es_v3_scale(head_forward, z))); }
static es_vec3 head_place(float x, float y, float z) { return es_v3_add(head_at, head_direction(x, y, z)); }

typedef struct head_station { float x, y, z, wide, deep; } head_station;

/* A tube in the head's axes, once as it is or mirrored. */
static void add_head_part(const artist* a, es_shape* shape, const head_station* places, uint32_t count, es_vec3 back, float mirror, uint32_t along, uint32_t around)
{
    es_sweep_station stations[MAX_STATIONS];
    for (uint32_t i = 0; i < count; i++)
        stations[i] = (es_sweep_station){head_place(mirror * places[i].x, places[i].y, places[i].z), places[i].wide, places[i].deep, head_direction(mirror * back.x, back.y, back.z)};
    es_shape_sweep(shape, &(es_sweep){.stations = stations, .count = count, .along = steps(a, along, 6), .around = steps(a, around, 5)});
}

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static void add_skull(const artist* a)
{
    static const head_station skull[] = {{0, 0.01f, -0.20f, 0, 0}, {0, 0.02f, -0.17f, 0.10f, 0.10f}, {0, 0.03f, -0.10f, 0.155f, 0.15f}, {0, 0.04f, 0.0f, 0.185f, 0.165f}, {0, 0.04f, 0.10f, 0.165f, 0.14f},
        {0, 0.02f, 0.21f, 0.120f, 0.100f}, {0, 0.005f, 0.32f, 0.105f, 0.080f}, {0, 0.005f, 0.42f, 0.110f, 0.080f}, {0, 0.015f, 0.49f, 0.105f, 0.078f}, {0, 0.01f, 0.535f, 0.070f, 0.055f}, {0, 0.0f, 0.55f, 0, 0}};
    static const head_station jaw[] = {{0, -0.05f, -0.10f, 0, 0}, {0, -0.07f, -0.06f, 0.10f, 0.05f}, {0, -0.11f, 0.05f, 0.115f, 0.055f}, {0, -0.16f, 0.18f, 0.092f, 0.040f}, {0, -0.205f, 0.31f, 0.080f, 0.034f},
        {0, -0.235f, 0.41f, 0.070f, 0.034f}, {0, -0.24f, 0.45f, 0.040f, 0.024f}, {0, -0.235f, 0.465f, 0, 0}};
    static const head_station tongue[] = {{0, -0.09f, 0.02f, 0, 0}, {0, -0.10f, 0.08f, 0.05f, 0.016f}, {0, -0.135f, 0.22f, 0.045f, 0.013f}, {0, -0.15f, 0.36f, 0.036f, 0.010f}, {0, -0.13f, 0.46f, 0.022f, 0.007f}, {0, -0.10f, 0.50f, 0, 0}};
    static const head_station brow[] = {{0.05f, 0.135f, 0.19f, 0, 0}, {0.075f, 0.15f, 0.16f, 0.022f, 0.020f}, {0.125f, 0.175f, 0.09f, 0.036f, 0.030f}, {0.165f, 0.18f, 0.0f, 0.036f, 0.028f}, {0.19f, 0.20f, -0.10f, 0.022f, 0.020f}, {0.215f, 0.235f, -0.19f, 0, 0}};
    static const head_station nostril[] = {{0.030f, 0.06f, 0.40f, 0, 0}, {0.045f, 0.085f, 0.43f, 0.030f, 0.024f}, {0.060f, 0.090f, 0.475f, 0.036f, 0.032f}, {0.060f, 0.075f, 0.51f, 0.024f, 0.022f}, {0.055f, 0.06f, 0.525f, 0, 0}};
    static const head_station cheek[] = {{0.10f, 0.0f, 0.16f, 0, 0}, {0.125f, -0.01f, 0.10f, 0.035f, 0.05f}, {0.165f, -0.02f, 0.0f, 0.04f, 0.075f}, {0.20f, -0.01f, -0.10f, 0.022f, 0.06f}, {0.26f, 0.03f, -0.24f, 0, 0}};
    static const head_station ear[] = {{0.15f, 0.10f, -0.08f, 0, 0}, {0.19f, 0.12f, -0.12f, 0.022f, 0.045f}, {0.26f, 0.15f, -0.21f, 0.016f, 0.055f}, {0.32f, 0.16f, -0.31f, 0.010f, 0.030f}, {0.36f, 0.15f, -0.39f, 0, 0}};
    add_head_part(a, a->skin, skull, COUNT(skull), es_v3(0, 1, 0), 1, 110, 90);
    add_head_part(a, a->skin, jaw, COUNT(jaw), es_v3(0, 1, 0), 1, 80, 60);
    add_head_part(a, a->skin, tongue, COUNT(tongue), es_v3(0, 1, 0), 1, 50, 30);
    for (float mirror = -1; mirror <= 1; mirror += 2) {
        add_head_part(a, a->skin, brow, COUNT(brow), es_v3(0, 1, 0), mirror, 48, 30);
        add_head_part(a, a->skin, nostril, COUNT(nostril), es_v3(0, 1, 0), mirror, 40, 32);
        add_head_part(a, a->skin, cheek, COUNT(cheek), es_v3(0, 1, 0), mirror, 40, 32);
        add_head_part(a, a->skin, ear, COUNT(ear), es_v3(0, 1, 0), mirror, 40, 26);
        es_shape_sphere(a->eyes, head_place(mirror * 0.122f, 0.112f, 0.105f), 0.043f, steps(a, 48, 8), steps(a, 32, 5));
    }
}

static void add_horns(const artist* a)
{
    static const head_station horn[] = {{0.085f, 0.13f, -0.04f, 0, 0}, {0.090f, 0.16f, -0.06f, 0.038f, 0.038f}, {0.115f, 0.28f, -0.14f, 0.034f, 0.034f}, {0.165f, 0.40f, -0.26f, 0.028f, 0.028f}, {0.205f, 0.48f, -0.42f, 0.020f, 0.020f},
        {0.205f, 0.57f, -0.56f, 0.012f, 0.012f}, {0.175f, 0.67f, -0.62f, 0, 0}};
    static const head_station branch[] = {{0.120f, 0.29f, -0.15f, 0, 0}, {0.125f, 0.31f, -0.14f, 0.022f, 0.022f}, {0.145f, 0.39f, -0.09f, 0.018f, 0.018f}, {0.175f, 0.47f, -0.07f, 0.012f, 0.012f}, {0.185f, 0.56f, -0.08f, 0, 0}};
    static const head_station whisker[] = {{0.085f, 0.02f, 0.46f, 0, 0}, {0.110f, 0.02f, 0.47f, 0.013f, 0.013f}, {0.22f, 0.06f, 0.53f, 0.011f, 0.011f}, {0.34f, 0.06f, 0.46f, 0.010f, 0.010f}, {0.40f, -0.03f, 0.32f, 0.009f, 0.009f},
        {0.43f, -0.13f, 0.22f, 0.007f, 0.007f}, {0.52f, -0.17f, 0.16f, 0.005f, 0.005f}, {0.60f, -0.12f, 0.10f, 0, 0}};
    for (float mirror = -1; mirror <= 1; mirror += 2) {
        add_head_part(a, a->ivory, horn, COUNT(horn), es_v3(0, 1, 0.5f), mirror, 90, 28);
        add_head_part(a, a->ivory, branch, COUNT(branch), es_v3(0, 0.3f, 1), mirror, 40, 20);
        add_head_part(a, a->skin, whisker, COUNT(whisker), es_v3(0, 1, 0.3f), mirror, 120, 14);
        for (int k = 0; k < TEETH; k++) {
            const float z = 0.50f - 0.045f * (float)k, x = mirror * (k == 0 ? 0.055f : 0.080f), length = k == 1 ? 0.075f : 0.042f;
            add_claw(a, head_place(x, -0.045f, z), head_direction(0, -1, 0), head_direction(0, 0, -1), length);
            if (k > 0) add_claw(a, head_place(0.85f * x, -0.185f + 0.014f * (float)k, z - 0.07f), head_direction(0, 1, 0), head_direction(0, 0, -1), k == 1 ? 0.065f : 0.038f);
        }
    }
}

/* Flames about the back of the head and under the jaw. */
static void add_mane(const artist* a)
{
    for (int k = 0; k < TUFTS; k++) {
        const float angle = two_pi * ((float)k + 0.5f) / TUFTS, long_one = k % 2 ? 0.30f : 0.42f;
        float sine, cosine;
        es_sincos(angle, &sine, &cosine);
        const float x = 0.135f * cosine, y = 0.03f + 0.135f * sine, wave = k % 3 == 0 ? 0.06f : -0.03f;
        const es_vec3 across = head_direction(-sine, cosine, 0);
        const es_vec3 p0 = head_place(x, y, -0.06f), p1 = head_place(1.35f * x, 0.03f + 1.35f * (y - 0.03f), -0.14f);
        const es_vec3 p2 = es_v3_add(head_place(1.95f * x, 0.03f + 1.95f * (y - 0.03f), -0.12f - 0.5f * long_one), es_v3_scale(across, wave)), p3 = head_place(2.4f * x, 0.06f + 2.3f * (y - 0.03f), -0.12f - long_one);
        const es_sweep_station stations[] = {{p0, 0, 0, across}, {mix(p0, p1, 0.3f), 0.020f, 0.038f, across}, {p1, 0.018f, 0.044f, across}, {p2, 0.012f, 0.030f, across}, {mix(p2, p3, 0.6f), 0.006f, 0.014f, across}, {p3, 0, 0, across}};
        es_shape_sweep(a->skin, &(es_sweep){.stations = stations, .count = 6, .along = steps(a, 40, 6), .around = steps(a, 16, 4)});
    }
}

/* ---- all of it --------------------------------------------------------------------------------------------------------- */

void es_build_dragon(es_scene_builder* builder, es_node node, const es_dragon_materials* materials, float scale)
{
    es_shape skin = es_build_shape(builder), ivory = es_build_shape(builder), eyes = es_build_shape(builder);
    const artist a = {builder, &skin, &ivory, &eyes, scale};
    es_sweep_station stations[BODY];
    body_stations(stations);
    const hide hide = {18, 0.44f, 0.085f, es_clampf(scale * 1.4f, 0, 1)};
    const es_sweep body = {stations, BODY, steps(&a, 1600, 40), steps(&a, 104, 8), scales, &hide};
    es_shape_sweep(&skin, &body);
    add_spines(&a, &body);
    add_leg(&a, -0.44f, 2.06f, 1, 1);
    add_leg(&a, -0.62f, 1.89f, -1, 1);
    add_leg(&a, -1.92f, 0.57f, 1, 0.9f);
    add_leg(&a, -1.58f, 0.92f, -1, 0.9f);
    add_skull(&a);
    add_horns(&a);
    add_mane(&a);
    es_build_instance(builder, node, es_build_mesh(builder, "dragon", &skin), materials->scales);
    es_build_instance(builder, node, es_build_mesh(builder, "horns and claws", &ivory), materials->ivory);
    es_build_instance(builder, node, es_build_mesh(builder, "eyes", &eyes), materials->eyes);
}
