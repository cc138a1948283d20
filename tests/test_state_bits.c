/* Saved states to the bit: what is restored hashes as what was saved, whatever the caller's rounding mode; states that a file could hold but
 * no world could be in are refused; and cloth whose tearing runs out of memory stays whole. */
#include <fenv.h>

#include "platform/random.h"
#include "tests/rigid_tools.h"

typedef struct saved { char* bytes; size_t size; } saved;

static saved save(es_world* world)
{
    saved s = {0};
    assert_int_equal(es_world_save(world, NULL, &s.size), ES_OK);
    s.bytes = calloc(1, s.size + 1024);
    assert_int_equal(es_world_save(world, s.bytes, &s.size), ES_OK);
    return s;
}

/* magic, signature of the content, hash of the payload; then the payload */
enum { PAYLOAD = 24 };

static void sign(saved* s)
{
    uint64_t hash = es_hash_bytes(0, s->bytes + PAYLOAD, s->size - PAYLOAD);
    memcpy(s->bytes + 16, &hash, sizeof hash);
}

static float number(uint32_t* seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (float)(*seed >> 8) * (2.0f / 16777216.0f) - 1.0f;
}

static es_quat any_rotation(uint32_t* seed)
{
    es_quat q;
    float* c = &q.x;
    for (int k = 0; k < 4; k++) c[k] = number(seed);
    return q;
}

/* Normalising what is normalised changes the last bits of one in a hundred. */
static void rotations_are_restored_as_they_were(void** unused)
{
    enum { COUNT = 400 };
    arena a = make_arena(1, 0, true);
    uint32_t seed = 1;
    es_shape_desc ball = ball_shape(0.1f);
    for (int i = 0; i < COUNT; i++) {
        es_node node;
        es_mover mover;
        es_joint joint;
        assert_int_equal(es_world_add_node(a.world, &(es_node_desc){.name = "turned"}, &node), ES_OK);
        es_mover_desc orbit = es_default_mover_desc();
        orbit.node = node;
        orbit.axis = (es_vec3){number(&seed), number(&seed), number(&seed)};
        orbit.rotation = any_rotation(&seed);
        assert_int_equal(es_world_add_mover(a.world, &orbit, &mover), ES_OK);
        es_joint_desc hinge = es_default_joint_desc();
        hinge.type = ES_JOINT_HINGE;
        hinge.b = add_body(&a, ES_BODY_DYNAMIC, &ball, 2 * i, 0, 0, no_turn);
        hinge.rotation_a = any_rotation(&seed);
        hinge.rotation_b = any_rotation(&seed);
        assert_int_equal(es_world_add_joint(a.world, &hinge, &joint), ES_OK);
    }
    uint64_t hash = es_world_hash(a.world);
    saved s = save(a.world);
    step(&a, 1);
    assert_true(es_world_hash(a.world) != hash);
    assert_int_equal(es_world_restore(a.world, s.bytes, s.size), ES_OK);
    assert_true(es_world_hash(a.world) == hash);
    free(s.bytes);
    free_arena(&a);
}

/* What a user did to movers, played back. */
static void movers_are_replayed_as_they_were(void** unused)
{
    arena a = make_arena(1, 0, true);
    es_node node;
    es_mover mover;
    assert_int_equal(es_world_add_node(a.world, &(es_node_desc){.name = "turned"}, &node), ES_OK);
    es_mover_desc orbit = es_default_mover_desc();
    orbit.node = node;
    assert_int_equal(es_world_add_mover(a.world, &orbit, &mover), ES_OK);
    es_recording* recording;
    assert_int_equal(es_recording_begin(a.world, "", "", &recording), ES_OK);
    uint32_t seed = 7;
    for (int i = 0; i < 300; i++) {
        orbit.axis = (es_vec3){number(&seed), number(&seed), number(&seed)};
        orbit.rotation = any_rotation(&seed);
        assert_int_equal(es_world_set_mover(a.world, mover, &orbit), ES_OK);
        step(&a, 1);
    }
    es_recording_end(recording);
    assert_int_equal(es_recording_rewind(recording, a.world), ES_OK);
    for (uint32_t i = 0; i < es_recording_steps(recording); i++) {
        es_divergence divergence;
        assert_int_equal(es_recording_replay(recording, i, a.world, &divergence), ES_OK);
        assert_false(divergence.differs);
    }
    es_recording_destroy(recording);
    free_arena(&a);
}

static es_soft hang_cloth(arena* a, float tear_stretch)
{
    enum { SIDE = 7 };
    float places[3 * SIDE * SIDE];
    uint32_t indices[6 * (SIDE - 1) * (SIDE - 1)], count = 0;
    for (uint32_t j = 0; j < SIDE; j++)
        for (uint32_t i = 0; i < SIDE; i++) {
            float* p = places + 3 * (j * SIDE + i);
            p[0] = 0.1f * (float)i;
            p[1] = 2;
            p[2] = 0.1f * (float)j;
            if (i + 1 == SIDE || j + 1 == SIDE) continue;
            const uint32_t v = j * SIDE + i, two[6] = {v, v + SIDE, v + 1, v + 1, v + SIDE, v + SIDE + 1};
            memcpy(indices + count, two, sizeof two);
            count += 6;
        }
    es_mesh mesh;
    es_instance instance;
    assert_int_equal(es_world_add_mesh(a->world, &(es_mesh_desc){.name = "sheet", .vertex_count = SIDE * SIDE, .triangle_count = count / 3, .positions = places, .indices = indices}, &mesh), ES_OK);
    assert_int_equal(es_world_add_instance(a->world, &(es_instance_desc){.mesh = mesh}, &instance), ES_OK);
    es_soft_desc desc = es_default_soft_desc();
    const es_soft_attachment held[2] = {{.vertex = 0, .in_place = true}, {.vertex = SIDE - 1, .in_place = true}};
    desc.mesh = mesh;
    desc.attachments = held;
    desc.attachment_count = 2;
    desc.tearable = true;
    desc.tear_stretch = tear_stretch;
    es_soft soft;
    assert_int_equal(es_world_add_soft(a->world, &desc, &soft), ES_OK);
    return soft;
}

/* All that a user does to a world, and restoring it, in one rounding mode. */
static uint64_t hash_rounded(int mode)
{
    arena a = make_arena(1, 0, true);
    add_floor(&a);
    es_body box = add_box(&a, 0.3f, 0, 1, 0);
    es_soft soft = hang_cloth(&a, 0);
    es_node node;
    es_mover mover;
    assert_int_equal(es_world_add_node(a.world, &(es_node_desc){.name = "turned"}, &node), ES_OK);
    es_mover_desc orbit = es_default_mover_desc();
    orbit.node = node;
    orbit.axis = (es_vec3){0.3f, 0.7f, -0.2f};
    es_joint_desc rope = es_default_joint_desc();
    rope.b = box;
    rope.rotation_a = (es_quat){0.3f, 0.1f, 0.7f, 0.2f};
    rope.position_b = (es_vec3){0.17f, 0.3f, 0.1f};
    es_joint joint;
    step(&a, 2);
    fesetround(mode);
    assert_int_equal(es_world_add_mover(a.world, &orbit, &mover), ES_OK);
    assert_int_equal(es_world_add_joint(a.world, &rope, &joint), ES_OK);
    assert_int_equal(es_world_set_body_pose(a.world, box, (double[]){0.1, 1.3, 0.7}, (es_quat){0.3f, 0.2f, 0.9f, 0.4f}), ES_OK);
    for (int i = 1; i < 8; i++) {
        assert_int_equal(es_world_apply_impulse(a.world, box, (es_vec3){0.13f, 0.7f * (float)i, 0.21f}, (double[]){0.3, 0.11 * i, 0.2}), ES_OK);
        assert_int_equal(es_world_apply_force(a.world, box, (es_vec3){0.13f, 0.7f * (float)i, 0.21f}, (double[]){0.3, 0.11 * i, 0.2}), ES_OK);
        assert_int_equal(es_world_soft_impulse(a.world, soft, ES_SOFT_ALL, (es_vec3){0.13f, 0.01f * (float)i, 0.21f}), ES_OK);
    }
    assert_int_equal(es_world_soft_tear(a.world, soft, (double[]){0.31, 2, 0.29}, 0.11f), ES_OK);
    step(&a, 3);
    uint64_t hash = es_world_hash(a.world);
    saved s = save(a.world);
    step(&a, 5);
    uint64_t later = es_world_hash(a.world);
    assert_int_equal(es_world_restore(a.world, s.bytes, s.size), ES_OK);
    assert_true(es_world_hash(a.world) == hash);
    step(&a, 5);
    fesetround(FE_TONEAREST);
    assert_true(es_world_hash(a.world) == later);
    free(s.bytes);
    free_arena(&a);
    return later;
}

static void the_callers_rounding_does_not_matter(void** unused)
{
    const uint64_t expected = hash_rounded(FE_TONEAREST);
    assert_true(hash_rounded(FE_UPWARD) == expected);
    assert_true(hash_rounded(FE_TOWARDZERO) == expected);
}

static void expect_refusal(arena* a, saved* s)
{
    const uint64_t hash = es_world_hash(a->world);
    sign(s);
    assert_int_equal(es_world_restore(a->world, s->bytes, s->size), ES_FILE_DAMAGED);
    assert_true(es_world_hash(a->world) == hash);
    step(a, 2);
}

/* Bodies that lag behind for longer than a step can last would have to catch up for ever. */
static void time_that_cannot_be_caught_up_is_refused(void** unused)
{
    arena a = make_arena(1, 0, true);
    add_box(&a, 0.3f, 0, 1, 0);
    step(&a, 1);
    saved s = save(a.world);
    const double time = 1e9;
    memcpy(s.bytes + PAYLOAD, &time, sizeof time);
    expect_refusal(&a, &s);
    free(s.bytes);
    free_arena(&a);
}

/* The last words are the list of the sensor's one contact (counts; a, b, manifolds, touching) and that of what sleeps, which is empty. */
static void a_sensor_with_manifolds_is_refused(void** unused)
{
    arena a = make_arena(1, 0, false);
    set_gravity(&a, 0, 0, 0);
    es_shape_desc sensor = box_shape(1, 1, 1);
    sensor.sensor = true;
    add_body(&a, ES_BODY_STATIC, &sensor, 0, 0, 0, no_turn);
    add_box(&a, 0.3f, 0, 0, 0);
    step(&a, 2);
    saved s = save(a.world);
    uint32_t words[8];
    memcpy(words, s.bytes + s.size - sizeof words, sizeof words);
    const uint32_t expected[8] = {1, 0, words[2], words[3], 0, 1, 0, 0};
    assert_memory_equal(words, expected, sizeof words);
    uint32_t forged[6 + 21 + 2] = {1, 1, words[2], words[3], 1, 1};
    forged[6 + 4] = 1; /* one point; all numbers are 0 */
    memcpy(s.bytes + s.size - sizeof words, forged, sizeof forged);
    s.size += sizeof forged - sizeof words;
    expect_refusal(&a, &s);
    free(s.bytes);
    free_arena(&a);
}

/* Of a triangle that is gone no corner is left. */
static void half_a_triangle_is_refused(void** unused)
{
    arena a = make_arena(1, 0, true);
    es_soft soft = hang_cloth(&a, 0);
    assert_int_equal(es_world_soft_tear(a.world, soft, (double[]){0.3, 2, 0.3}, 5), ES_OK); /* all to pieces, more than the reserve is for */
    step(&a, 1);
    saved s = save(a.world);
    size_t at = PAYLOAD;
    uint32_t three[3] = {0, 0, 0};
    for (; at + sizeof three <= s.size && !(three[0] == UINT32_MAX && three[1] == UINT32_MAX && three[2] == UINT32_MAX); at += 4) memcpy(three, s.bytes + at, sizeof three);
    assert_true(at + sizeof three <= s.size);
    const uint32_t corner = 0;
    memcpy(s.bytes + at - 4, &corner, sizeof corner); /* the first; the others are still gone */
    expect_refusal(&a, &s);
    free(s.bytes);
    free_arena(&a);
}

/* ---- memory ---------------------------------------------------------------------------------------------------------------------------- */

typedef struct scarce { long left; } scarce; /* allocations; below 0: any number */

static void* scarce_allocate(void* user, size_t size, size_t alignment)
{
    scarce* s = user;
    if (s->left == 0) return NULL;
    if (s->left > 0) s->left--;
    return aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

static void scarce_release(void* user, void* pointer, size_t size) { free(pointer); }

static void cloth_survives_scarcity(void** unused)
{
    for (int kind = 0; kind < 2; kind++) {
        es_result result = ES_OUT_OF_MEMORY;
        for (long allowed = 0; result != ES_OK; allowed++) {
            scarce memory = {-1};
            arena a = {0};
            es_context_desc desc = es_default_context_desc();
            desc.threads = 1;
            desc.logger.log = quiet_log;
            desc.allocator.allocate = scarce_allocate;
            desc.allocator.release = scarce_release;
            desc.allocator.user = &memory;
            assert_int_equal(es_context_create(&desc, &a.context), ES_OK);
            assert_int_equal(es_world_create(a.context, NULL, &a.world), ES_OK);
            es_soft soft = hang_cloth(&a, 0);
            step(&a, 3);
            memory.left = allowed;
            const es_soft_attachment more = {.vertex = 24, .in_place = true};
            result = kind ? es_world_soft_attach(a.world, soft, &more) : es_world_soft_tear(a.world, soft, (double[]){0.3, 2, 0.3}, 0.25f);
            assert_true(result == ES_OK || result == ES_OUT_OF_MEMORY);
            memory.left = -1;
            step(&a, 3);
            assert_true(es_world_hash(a.world) != 0);
            assert_int_equal(es_world_soft_tear(a.world, soft, (double[]){0.1, 2, 0.4}, 0.15f), ES_OK);
            step(&a, 3);
            free_arena(&a);
            assert_true(allowed < 1000);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rotations_are_restored_as_they_were),
        cmocka_unit_test(movers_are_replayed_as_they_were),
        cmocka_unit_test(the_callers_rounding_does_not_matter),
        cmocka_unit_test(time_that_cannot_be_caught_up_is_refused),
        cmocka_unit_test(a_sensor_with_manifolds_is_refused),
        cmocka_unit_test(half_a_triangle_is_refused),
        cmocka_unit_test(cloth_survives_scarcity),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
