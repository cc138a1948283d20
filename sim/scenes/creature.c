/* A four-legged animal with a trunk: see creature.h.
 *
 * Its mesh is a handful of closed tubes that overlap, each swept along stations with a radius; a vertex follows the bones its part lists,
 * by the inverse sixth power of its distance to them, at most 1e6. */
#include "sim/scenes/creature.h"

#include "platform/maths.h"

static const float turn = 6.2831853f;

enum { HIPS, CHEST, NECK, HEAD, TRUNK_1, TRUNK_2, TRUNK_3, TAIL, LEFT_EAR, RIGHT_EAR, LEGS, BONES = LEGS + 8, NONE = 255 };
/* front left, front right, hind left, hind right; upper and lower each */
#define UPPER(leg) (LEGS + 2 * (leg))
#define LOWER(leg) (LEGS + 2 * (leg) + 1)

typedef struct bone { const char* name; uint8_t parent; es_vec3 head, tail; } bone;
static const bone bones[BONES] = {
    [HIPS] = {"hips", NONE, {0, 0.95f, 0.45f}, {0, 0.98f, 0}},
    [CHEST] = {"chest", HIPS, {0, 0.98f, 0}, {0, 1.0f, -0.5f}},
    [NECK] = {"neck", CHEST, {0, 1.05f, -0.5f}, {0, 1.25f, -0.78f}},
    [HEAD] = {"head", NECK, {0, 1.25f, -0.78f}, {0, 1.2f, -1.08f}},
    [TRUNK_1] = {"trunk", HEAD, {0, 1.15f, -1.08f}, {0, 0.85f, -1.25f}},
    [TRUNK_2] = {"trunk", TRUNK_1, {0, 0.85f, -1.25f}, {0, 0.5f, -1.31f}},
    [TRUNK_3] = {"trunk", TRUNK_2, {0, 0.5f, -1.31f}, {0, 0.2f, -1.16f}},
    [TAIL] = {"tail", HIPS, {0, 1.05f, 0.66f}, {0, 0.55f, 0.8f}},
    [LEFT_EAR] = {"ear", HEAD, {-0.2f, 1.33f, -0.86f}, {-0.52f, 1.12f, -0.72f}},
    [RIGHT_EAR] = {"ear", HEAD, {0.2f, 1.33f, -0.86f}, {0.52f, 1.12f, -0.72f}},
    [UPPER(0)] = {"leg", CHEST, {-0.23f, 0.86f, -0.42f}, {-0.23f, 0.46f, -0.42f}},
    [LOWER(0)] = {"foot", UPPER(0), {-0.23f, 0.46f, -0.42f}, {-0.23f, 0.04f, -0.42f}},
    [UPPER(1)] = {"leg", CHEST, {0.23f, 0.86f, -0.42f}, {0.23f, 0.46f, -0.42f}},
    [LOWER(1)] = {"foot", UPPER(1), {0.23f, 0.46f, -0.42f}, {0.23f, 0.04f, -0.42f}},
    [UPPER(2)] = {"leg", HIPS, {-0.23f, 0.86f, 0.42f}, {-0.23f, 0.46f, 0.42f}},
    [LOWER(2)] = {"foot", UPPER(2), {-0.23f, 0.46f, 0.42f}, {-0.23f, 0.04f, 0.42f}},
    [UPPER(3)] = {"leg", HIPS, {0.23f, 0.86f, 0.42f}, {0.23f, 0.46f, 0.42f}},
    [LOWER(3)] = {"foot", UPPER(3), {0.23f, 0.46f, 0.42f}, {0.23f, 0.04f, 0.42f}},
};

/* ---- the skin's tubes -------------------------------------------------------------------------------------------------- */

typedef struct station { es_vec3 at; float wide, deep; } station; /* half axes across: along `side` of the part, and at right angles to it */
enum { STATIONS = 8, INFLUENCES = 4 };
typedef struct part { uint32_t count; station stations[STATIONS]; es_vec3 side; uint8_t follows[INFLUENCES]; uint32_t around, along; } part;

static const part trunk_and_body[] = {
    {8, {{{0, 0.98f, 0.72f}, 0, 0}, {{0, 0.99f, 0.66f}, 0.22f, 0.24f}, {{0, 0.98f, 0.45f}, 0.34f, 0.37f}, {{0, 0.95f, 0.1f}, 0.39f, 0.40f}, {{0, 0.96f, -0.25f}, 0.37f, 0.39f},
            {{0, 1.0f, -0.5f}, 0.31f, 0.33f}, {{0, 1.02f, -0.66f}, 0.17f, 0.2f}, {{0, 1.02f, -0.7f}, 0, 0}}, {1, 0, 0}, {HIPS, CHEST, HIPS, CHEST}, 40, 36},
    {7, {{{0, 1.02f, -0.38f}, 0, 0}, {{0, 1.06f, -0.5f}, 0.22f, 0.25f}, {{0, 1.19f, -0.72f}, 0.21f, 0.24f}, {{0, 1.26f, -0.9f}, 0.22f, 0.22f}, {{0, 1.25f, -1.04f}, 0.17f, 0.17f},
            {{0, 1.22f, -1.13f}, 0.1f, 0.1f}, {{0, 1.21f, -1.17f}, 0, 0}}, {1, 0, 0}, {CHEST, NECK, HEAD, NECK}, 32, 28},
    {7, {{{0, 1.24f, -1.0f}, 0, 0}, {{0, 1.13f, -1.1f}, 0.11f, 0.11f}, {{0, 0.85f, -1.25f}, 0.085f, 0.08f}, {{0, 0.5f, -1.31f}, 0.06f, 0.06f}, {{0, 0.3f, -1.26f}, 0.047f, 0.047f},
            {{0, 0.2f, -1.17f}, 0.036f, 0.036f}, {{0, 0.18f, -1.14f}, 0, 0}}, {1, 0, 0}, {HEAD, TRUNK_1, TRUNK_2, TRUNK_3}, 20, 44},
    {5, {{{0, 1.12f, 0.6f}, 0, 0}, {{0, 1.06f, 0.68f}, 0.04f, 0.04f}, {{0, 0.8f, 0.76f}, 0.025f, 0.025f}, {{0, 0.56f, 0.79f}, 0.04f, 0.04f}, {{0, 0.46f, 0.8f}, 0, 0}},
        {1, 0, 0}, {HIPS, TAIL, TAIL, TAIL}, 12, 16},
    {4, {{{-0.16f, 1.36f, -0.88f}, 0, 0}, {{-0.28f, 1.30f, -0.82f}, 0.2f, 0.025f}, {{-0.44f, 1.18f, -0.75f}, 0.19f, 0.02f}, {{-0.56f, 1.06f, -0.7f}, 0, 0}},
        {0, 0.85f, 0.5f}, {HEAD, LEFT_EAR, LEFT_EAR, LEFT_EAR}, 20, 18},
    {4, {{{0.16f, 1.36f, -0.88f}, 0, 0}, {{0.28f, 1.30f, -0.82f}, 0.2f, 0.025f}, {{0.44f, 1.18f, -0.75f}, 0.19f, 0.02f}, {{0.56f, 1.06f, -0.7f}, 0, 0}},
        {0, 0.85f, 0.5f}, {HEAD, RIGHT_EAR, RIGHT_EAR, RIGHT_EAR}, 20, 18},
};
enum { BODY_PARTS = sizeof trunk_and_body / sizeof trunk_and_body[0], PARTS = BODY_PARTS + 4 };

static part leg_part(uint32_t leg)
{
    const es_vec3 top = bones[UPPER(leg)].head;
    const float x = top.x, z = top.z;
    part p = {6, {{{x, 1.02f, z}, 0, 0}, {{x, 0.9f, z}, 0.16f, 0.19f}, {{x, 0.5f, z}, 0.115f, 0.12f}, {{x, 0.14f, z}, 0.11f, 0.11f}, {{x, 0.03f, z}, 0.13f, 0.13f}, {{x, 0.0f, z}, 0, 0}},
        {1, 0, 0}, {bones[UPPER(leg)].parent, UPPER(leg), LOWER(leg), LOWER(leg)}, 22, 24};
    return p;
}

static float catmull(float a, float b, float c, float d, float t) { return b + 0.5f * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))); }

/* Exact at both ends, where the tube closes in a point. */
static station station_at(const part* p, float v)
{
    if (v >= 1) return p->stations[p->count - 1];
    float along = v * (float)(p->count - 1);
    uint32_t i = (uint32_t)along;
    if (i > p->count - 2) i = p->count - 2;
    float t = along - (float)i;
    const station *b = &p->stations[i], *c = b + 1, *a = i ? b - 1 : b, *d = i + 2 < p->count ? c + 1 : c;
    station s;
    for (int k = 0; k < 3; k++) (&s.at.x)[k] = catmull((&a->at.x)[k], (&b->at.x)[k], (&c->at.x)[k], (&d->at.x)[k], t);
    float least = v > 0 ? 0.003f : 0;
    s.wide = es_maxf(least, catmull(a->wide, b->wide, c->wide, d->wide, t));
    s.deep = es_maxf(least, catmull(a->deep, b->deep, c->deep, d->deep, t));
    return s;
}

static es_vec3 skin_point(const part* p, float u, float v)
{
    station s = station_at(p, v), before = station_at(p, es_maxf(v - 0.01f, 0)), after = station_at(p, es_minf(v + 0.01f, 1));
    es_vec3 forward = es_v3_normalize(es_v3_sub(after.at, before.at), es_v3(0, 0, 1));
    es_vec3 across = es_v3_normalize(es_v3_cross(forward, p->side), es_v3(0, 1, 0)), side = es_v3_cross(across, forward);
    return es_v3_add(s.at, es_v3_add(es_v3_scale(side, s.wide * es_cos(turn * u)), es_v3_scale(across, s.deep * es_sin(turn * u))));
}

static void skin_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const part* p = parameters;
    const float h = 2e-3f;
    *position = skin_point(p, u, v);
    if (v <= 0 || v >= 1) { /* a pole: along the tube, outwards */
        es_vec3 inside = station_at(p, v > 0 ? 0.98f : 0.02f).at;
        *normal = es_v3_normalize(es_v3_sub(*position, inside), es_v3(0, 1, 0));
        return;
    }
    es_vec3 du = es_v3_sub(skin_point(p, u + h, v), skin_point(p, u - h, v));
    es_vec3 dv = es_v3_sub(skin_point(p, u, es_minf(v + h, 1)), skin_point(p, u, es_maxf(v - h, 0)));
    *normal = es_v3_normalize(es_v3_cross(du, dv), es_v3_sub(*position, station_at(p, v).at)); /* outwards: across × forward = side */
}

/* Inverse sixth power of the distance to the bone. */
static float pull(const bone* b, es_vec3 p)
{
    es_vec3 along = es_v3_sub(b->tail, b->head), from = es_v3_sub(p, b->head);
    float t = es_clampf(es_v3_dot(from, along) / es_v3_dot(along, along), 0, 1);
    es_vec3 d = es_v3_sub(from, es_v3_scale(along, t));
    float squared = es_v3_dot(d, d) + 0.011f;
    return 1.0f / (squared * squared * squared);
}

static void add_skin(es_scene_builder* builder, es_node root, es_mesh mesh, const es_node nodes[BONES], const uint32_t* joints, const float* weights)
{
    es_mat4 binds[BONES];
    for (int i = 0; i < BONES; i++) {
        binds[i] = es_mat4_identity();
        for (int k = 0; k < 3; k++) binds[i].m[12 + k] = -(&bones[i].head.x)[k];
    }
    es_skin skin;
    es_skin_desc desc = {.name = "creature", .mesh = mesh, .node = root, .joint_count = BONES, .joints = nodes, .inverse_binds = binds, .influences = INFLUENCES, .vertex_joints = joints, .vertex_weights = weights};
    if (builder->result == ES_OK) builder->result = es_world_add_skin(builder->world, &desc, &skin);
}

static void build_skin(es_scene_builder* builder, es_node root, const es_node nodes[BONES], es_material hide, float scale)
{
    es_context* context = es_world_context(builder->world);
    es_shape shape = es_build_shape(builder);
    size_t ends[PARTS];
    part parts[PARTS];
    for (uint32_t i = 0; i < PARTS; i++) {
        parts[i] = i < BODY_PARTS ? trunk_and_body[i] : leg_part(i - BODY_PARTS);
        es_shape_patch(&shape, skin_surface, &parts[i], (uint32_t)es_maxf(6, (float)parts[i].around * scale), (uint32_t)es_maxf(6, (float)parts[i].along * scale), true, false);
        ends[i] = shape.vertex_count;
    }
    size_t count = shape.vertex_count * INFLUENCES;
    uint32_t* joints = builder->result == ES_OK ? es_allocate_array(context, count, sizeof *joints) : NULL;
    float* weights = joints ? es_allocate_array(context, count, sizeof *weights) : NULL;
    if (builder->result == ES_OK && !weights) builder->result = es_context_last_result(context);
    for (size_t v = 0, i = 0; weights && v < shape.vertex_count; v++) {
        while (v >= ends[i]) i++;
        for (int k = 0; k < INFLUENCES; k++) {
            uint8_t b = parts[i].follows[k];
            bool repeated = false;
            for (int before = 0; before < k; before++) repeated |= parts[i].follows[before] == b;
            joints[v * INFLUENCES + (size_t)k] = b;
            weights[v * INFLUENCES + (size_t)k] = repeated ? 0 : pull(&bones[b], es_v3(shape.positions[3 * v], shape.positions[3 * v + 1], shape.positions[3 * v + 2]));
        }
    }
    es_mesh mesh = es_build_mesh(builder, "creature", &shape);
    es_build_instance(builder, root, mesh, hide);
    if (weights) add_skin(builder, root, mesh, nodes, joints, weights);
    es_release(context, weights, count * sizeof *weights);
    es_release(context, joints, count * sizeof *joints);
}

/* ---- the walk ------------------------------------------------------------------------------------------------------------ */

static const float stride = 0.40f; /* radians a leg swings to either side */

float es_creature_speed(float period) { return 4.0f * 0.86f * es_sin(stride) / period; }

/* angle = mean + amplitude sin(turn × (times × phase + offset)) about the axis */
typedef struct swing { uint8_t bone; es_vec3 axis; float mean, amplitude, times, offset; } swing;
static const swing swings[] = {
    {UPPER(2), {1, 0, 0}, 0, 0.40f, 1, 0}, {UPPER(0), {1, 0, 0}, 0, 0.40f, 1, 0.25f}, {UPPER(3), {1, 0, 0}, 0, 0.40f, 1, 0.5f}, {UPPER(1), {1, 0, 0}, 0, 0.40f, 1, 0.75f},
    /* a knee is bent most while its leg comes forward */
    {LOWER(2), {1, 0, 0}, -0.28f, 0.28f, 1, 0.5f}, {LOWER(0), {1, 0, 0}, -0.28f, 0.28f, 1, 0.75f}, {LOWER(3), {1, 0, 0}, -0.28f, 0.28f, 1, 0}, {LOWER(1), {1, 0, 0}, -0.28f, 0.28f, 1, 0.25f},
    {CHEST, {0, 1, 0}, 0, 0.04f, 1, 0.1f}, {NECK, {1, 0, 0}, -0.04f, 0.06f, 2, 0}, {HEAD, {1, 0, 0}, 0, 0.05f, 2, 0.2f}, {TRUNK_1, {0, 0, 1}, 0, 0.16f, 1, 0}, {TRUNK_2, {0, 0, 1}, 0, 0.22f, 1, -0.12f},
    {TRUNK_3, {1, 0, 0}, 0.2f, 0.3f, 1, 0.3f}, {TAIL, {0, 0, 1}, 0, 0.35f, 1, 0}, {LEFT_EAR, {0, 1, 0}, 0, 0.22f, 2, 0.1f}, {RIGHT_EAR, {0, 1, 0}, 0, -0.22f, 2, 0.1f},
};
enum { SWINGS = sizeof swings / sizeof swings[0], KEYS = 24 };

static void build_walk(es_scene_builder* builder, const es_node nodes[BONES], float period)
{
    float times[KEYS + 1], turned[SWINGS][4 * (KEYS + 1)], bob[3 * (KEYS + 1)];
    es_clip_channel channels[SWINGS + 1];
    for (int k = 0; k <= KEYS; k++) {
        float phase = (float)(k % KEYS) / KEYS;
        times[k] = period * (float)k / KEYS;
        for (int i = 0; i < SWINGS; i++) {
            es_quat q = es_quat_from_axis_angle(swings[i].axis, swings[i].mean + swings[i].amplitude * es_sin(turn * (swings[i].times * phase + swings[i].offset)));
            for (int c = 0; c < 4; c++) turned[i][4 * k + c] = (&q.x)[c];
        }
        bob[3 * k] = 0;
        bob[3 * k + 1] = bones[HIPS].head.y + 0.018f * es_sin(2 * turn * phase);
        bob[3 * k + 2] = bones[HIPS].head.z;
    }
    for (int i = 0; i < SWINGS; i++)
        channels[i] = (es_clip_channel){.node = nodes[swings[i].bone], .path = ES_CLIP_ROTATION, .interpolation = ES_INTERPOLATE_LINEAR, .key_count = KEYS + 1, .times = times, .values = turned[i]};
    channels[SWINGS] = (es_clip_channel){.node = nodes[HIPS], .path = ES_CLIP_TRANSLATION, .interpolation = ES_INTERPOLATE_LINEAR, .key_count = KEYS + 1, .times = times, .values = bob};
    es_clip clip;
    if (builder->result == ES_OK) builder->result = es_world_add_clip(builder->world, &(es_clip_desc){"walk", SWINGS + 1, channels}, &clip);
}

void es_build_creature(es_scene_builder* builder, es_node root, es_material hide, float scale, float period)
{
    es_node nodes[BONES];
    for (int i = 0; i < BONES; i++) {
        es_vec3 from = bones[i].parent == NONE ? es_v3(0, 0, 0) : bones[bones[i].parent].head;
        nodes[i] = es_build_child(builder, bones[i].name, bones[i].parent == NONE ? root : nodes[bones[i].parent], es_v3_sub(bones[i].head, from), es_quat_identity());
    }
    build_skin(builder, root, nodes, hide, scale);
    build_walk(builder, nodes, period);
    for (uint32_t leg = 0; leg < 4; leg++) {
        const bone* shin = &bones[LOWER(leg)];
        const float length = shin->head.y - shin->tail.y, r = 0.12f;
        es_shape_desc foot = es_capsule_shape(r, 0.5f * length - r + 0.02f);
        foot.position = es_v3(0, -0.5f * length, 0);
        es_build_body(builder, nodes[LOWER(leg)], ES_BODY_KINEMATIC, &foot, NULL);
    }
}
