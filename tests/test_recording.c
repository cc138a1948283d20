/* Recording and replay: what was done to a pile of bodies, its light and its camera comes back bit for bit, through a file, in another world;
 * a replay that goes astray names the step and the object; damaged files are refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "sim/sim.h"

enum { BODIES = 12, STEPS = 90 };

typedef struct scene { es_context* context; es_world* world; es_body bodies[BODIES]; es_node lamp_node; es_light lamp; es_mover mover; es_soft cloth; es_camera camera; } scene;

static void no_log(void* user, es_log_level level, es_result item, const char* message) { (void)user, (void)level, (void)item, (void)message; }

static scene open_scene(void)
{
    scene s;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger.log = no_log;
    assert_int_equal(es_context_create(&desc, &s.context), ES_OK);
    assert_int_equal(es_world_create(s.context, NULL, &s.world), ES_OK);
    es_shape_desc floor = es_default_shape_desc(), box = es_default_shape_desc();
    floor.half_extents = es_v3(10, 0.5f, 10);
    floor.position = es_v3(0, -0.5f, 0);
    box.half_extents = es_v3(0.2f, 0.2f, 0.2f);
    es_body_desc ground = es_default_body_desc();
    ground.type = ES_BODY_STATIC;
    ground.shapes = &floor;
    ground.shape_count = 1;
    es_body body;
    assert_int_equal(es_world_add_body(s.world, &ground, &body), ES_OK);
    for (int i = 0; i < BODIES; i++) {
        char name[16];
        snprintf(name, sizeof name, "box %d", i);
        es_node node;
        es_node_desc at = {.name = name, .transform = es_identity_transform()};
        at.transform.translation = es_v3(0.05f * (float)(i % 3), 0.3f + 0.45f * (float)i, 0.03f * (float)(i % 2));
        assert_int_equal(es_world_add_node(s.world, &at, &node), ES_OK);
        es_body_desc dynamic = es_default_body_desc();
        dynamic.name = name;
        dynamic.node = node;
        dynamic.shapes = &box;
        dynamic.shape_count = 1;
        assert_int_equal(es_world_add_body(s.world, &dynamic, &s.bodies[i]), ES_OK);
    }
    es_node_desc plain = {.transform = es_identity_transform()};
    assert_int_equal(es_world_add_node(s.world, &plain, &s.lamp_node), ES_OK);
    es_light_desc lamp = es_default_light_desc();
    lamp.node = s.lamp_node;
    assert_int_equal(es_world_add_light(s.world, &lamp, &s.lamp), ES_OK);
    es_mover_desc orbit = es_default_mover_desc();
    orbit.node = s.lamp_node;
    orbit.arm = es_v3(1, 2, 0);
    assert_int_equal(es_world_add_mover(s.world, &orbit, &s.mover), ES_OK);
    enum { SIDE = 9 };
    float places[SIDE * SIDE * 3];
    uint32_t triangles[(SIDE - 1) * (SIDE - 1) * 6], *index = triangles;
    for (int i = 0; i < SIDE * SIDE; i++) {
        places[3 * i] = 2 + 0.1f * (float)(i % SIDE);
        places[3 * i + 1] = 2;
        places[3 * i + 2] = 0.1f * (float)(i / SIDE);
    }
    for (uint32_t j = 0; j + 1 < SIDE; j++)
        for (uint32_t i = 0; i + 1 < SIDE; i++) {
            const uint32_t corner = SIDE * j + i, quad[6] = {corner, corner + 1, corner + SIDE, corner + 1, corner + SIDE + 1, corner + SIDE};
            for (int k = 0; k < 6; k++) *index++ = quad[k];
        }
    es_mesh mesh;
    es_mesh_desc sheet = {.name = "sheet", .vertex_count = SIDE * SIDE, .triangle_count = (SIDE - 1) * (SIDE - 1) * 2, .positions = places, .indices = triangles};
    assert_int_equal(es_world_add_mesh(s.world, &sheet, &mesh), ES_OK);
    es_soft_desc cloth = es_default_soft_desc();
    cloth.mesh = mesh;
    cloth.tearable = true;
    es_soft_attachment corner = {.vertex = 0, .in_place = true};
    cloth.attachments = &corner;
    cloth.attachment_count = 1;
    assert_int_equal(es_world_add_soft(s.world, &cloth, &s.cloth), ES_OK);
    es_camera_desc lens = es_default_camera_desc();
    assert_int_equal(es_world_add_camera(s.world, &lens, &s.camera), ES_OK);
    return s;
}

static void close_scene(scene* s)
{
    es_world_destroy(s->world);
    assert_int_equal(es_context_bytes(s->context), 0);
    es_context_destroy(s->context);
}

/* What a player does before step `step`. */
static void play(scene* s, int step, char** rewound, size_t* rewound_size)
{
    if (step == 10) es_world_apply_impulse(s->world, s->bodies[3], es_v3(20, 3, 0), NULL);
    if (step == 12) es_world_apply_force(s->world, s->bodies[2], es_v3(0, 0, 500), (const double[3]){0, 1, 0});
    if (step == 15) es_world_grab_body(s->world, 0, s->bodies[7], es_v3(0.1f, 0, 0), (const double[3]){1, 3, 0}, 0);
    if (step > 15 && step < 40) es_world_move_hand(s->world, 0, (const double[3]){1 + 0.05 * (step - 15), 3, 0});
    if (step == 40) es_world_release(s->world, 0);
    if (step == 20) {
        es_mover_desc orbit;
        es_world_get_mover(s->world, s->mover, &orbit);
        orbit.period = 3;
        es_world_set_mover(s->world, s->mover, &orbit);
        es_light_desc lamp;
        es_world_get_light(s->world, s->lamp, &lamp);
        lamp.intensity = 5;
        es_world_set_light(s->world, s->lamp, &lamp);
        es_camera_desc lens;
        es_world_get_camera(s->world, s->camera, &lens);
        lens.fov_y = 1;
        es_world_set_camera(s->world, s->camera, &lens);
    }
    if (step == 30) {
        es_world_settings settings = es_world_get_settings(s->world);
        settings.speed = 0.5f;
        settings.gravity.x = 1;
        es_world_configure(s->world, &settings);
        es_world_set_body_pose(s->world, s->bodies[0], (const double[3]){-2, 1, 0}, es_quat_identity());
        es_world_set_body_velocity(s->world, s->bodies[0], es_v3(3, 0, 0), es_v3(0, 1, 0));
    }
    if (step == 5) assert_int_equal(es_world_grab_soft(s->world, 1, s->cloth, 80, (const double[3]){2.5, 2.5, 1}), ES_OK);
    if (step == 14) assert_int_equal(es_world_release(s->world, 1), ES_OK);
    if (step == 16) assert_int_equal(es_world_soft_attach(s->world, s->cloth, &(es_soft_attachment){.vertex = 8, .body = s->bodies[9], .in_place = true}), ES_OK);
    if (step == 22) {
        es_soft_desc cloth;
        assert_int_equal(es_world_get_soft(s->world, s->cloth, &cloth), ES_OK);
        cloth.wind = es_v3(0, 0, 5);
        assert_int_equal(es_world_set_soft(s->world, s->cloth, &cloth), ES_OK);
        assert_int_equal(es_world_soft_impulse(s->world, s->cloth, ES_SOFT_ALL, es_v3(0.1f, 0, 0)), ES_OK);
    }
    if (step == 35) {
        double middle[3];
        assert_int_equal(es_world_get_soft_vertex(s->world, s->cloth, 40, middle, NULL), ES_OK);
        assert_int_equal(es_world_soft_tear(s->world, s->cloth, middle, 0.12f), ES_OK);
    }
    if (step == 45) assert_int_equal(es_world_soft_detach(s->world, s->cloth, 0), ES_OK);
    if (step == 50) assert_int_equal(es_world_wake_soft(s->world, s->cloth), ES_OK);
    if (step == 25) {
        assert_int_equal(es_world_save(s->world, NULL, rewound_size), ES_OK);
        *rewound = malloc(*rewound_size);
        assert_int_equal(es_world_save(s->world, *rewound, rewound_size), ES_OK);
    }
    if (step == 60) assert_int_equal(es_world_restore(s->world, *rewound, *rewound_size), ES_OK);
}

static es_recording* record(scene* s, uint64_t hashes[STEPS])
{
    es_recording* recording;
    char* rewound = NULL;
    size_t size;
    for (int step = 0; step < 5; step++) assert_int_equal(es_world_step(s->world, 1.0f / 60), ES_OK); /* it need not begin at the beginning */
    assert_int_equal(es_recording_begin(s->world, "pile", "world.speed=1\n", &recording), ES_OK);
    for (int step = 0; step < STEPS; step++) {
        play(s, step, &rewound, &size);
        assert_int_equal(es_world_step(s->world, step % 7 == 6 ? 0.03f : 1.0f / 60), ES_OK);
        hashes[step] = es_world_hash(s->world);
    }
    free(rewound);
    es_recording_end(recording);
    return recording;
}

static void file_name(char path[64]) { snprintf(path, 64, "recording-%ld.es", (long)getpid()); }

static void test_a_replay_gives_the_same_bits(void** state)
{
    (void)state;
    scene first = open_scene(), second = open_scene();
    uint64_t hashes[STEPS];
    es_recording *recording = record(&first, hashes), *loaded;
    char path[64];
    file_name(path);
    assert_int_equal(es_recording_save(recording, path), ES_OK);
    assert_int_equal(es_recording_load(second.context, path, &loaded), ES_OK);
    assert_int_equal(es_recording_steps(loaded), STEPS);
    assert_string_equal(es_recording_scene(loaded), "pile");
    assert_string_equal(es_recording_settings(loaded), "world.speed=1\n");
    assert_int_equal(es_recording_rewind(loaded, second.world), ES_OK);
    for (uint32_t step = 0; step < STEPS; step++) {
        es_divergence divergence;
        assert_int_equal(es_recording_replay(loaded, step, second.world, &divergence), ES_OK);
        assert_false(divergence.differs);
        assert_true(es_world_hash(second.world) == hashes[step]);
    }
    es_recording_destroy(loaded);
    es_recording_destroy(recording);
    unlink(path);
    close_scene(&first);
    close_scene(&second);
}

static void test_a_divergence_names_step_and_object(void** state)
{
    (void)state;
    scene first = open_scene(), second = open_scene();
    uint64_t hashes[STEPS];
    es_recording* recording = record(&first, hashes);
    for (int what = 0; what < 2; what++) {
        assert_int_equal(es_recording_rewind(recording, second.world), ES_OK);
        es_divergence divergence = {0};
        for (uint32_t step = 0; step < STEPS && !divergence.differs; step++) {
            if (step == 18 && what == 0) es_world_apply_impulse(second.world, second.bodies[5], es_v3(1e-3f, 0, 0), NULL);
            if (step == 33 && what == 1) {
                es_light_desc lamp;
                es_world_get_light(second.world, second.lamp, &lamp);
                lamp.color[1] = 0.5f;
                es_world_set_light(second.world, second.lamp, &lamp);
            }
            assert_int_equal(es_recording_replay(recording, step, second.world, &divergence), ES_OK);
        }
        assert_true(divergence.differs);
        assert_int_equal(divergence.step, what ? 33 : 18);
        assert_int_equal(divergence.kind, what ? ES_OBJECT_LIGHT : ES_OBJECT_BODY);
        if (what) assert_int_equal(divergence.id, second.lamp.id);
    }
    es_recording_destroy(recording);
    close_scene(&first);
    close_scene(&second);
}

static void test_another_world_is_refused(void** state)
{
    (void)state;
    scene first = open_scene(), second = open_scene();
    uint64_t hashes[STEPS];
    es_recording* recording = record(&first, hashes);
    es_node node;
    assert_int_equal(es_world_add_node(second.world, &(es_node_desc){.transform = es_identity_transform()}, &node), ES_OK);
    assert_int_equal(es_recording_rewind(recording, second.world), ES_WRONG_STATE);
    es_recording_destroy(recording);
    close_scene(&first);
    close_scene(&second);
}

static void test_damaged_files_are_refused(void** state)
{
    (void)state;
    scene s = open_scene();
    uint64_t hashes[STEPS];
    es_recording *recording = record(&s, hashes), *loaded;
    char path[64];
    file_name(path);
    assert_int_equal(es_recording_load(s.context, path, &loaded), ES_FILE_NOT_FOUND);
    assert_int_equal(es_recording_save(recording, path), ES_OK);
    FILE* file = fopen(path, "rb");
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    char* bytes = malloc((size_t)size);
    rewind(file);
    assert_int_equal(fread(bytes, 1, (size_t)size, file), size);
    fclose(file);
    for (int damage = 0; damage < 40; damage++) {
        long at = damage < 20 ? damage * 4 : size * (damage - 20) / 20, length = damage % 4 == 3 ? at : size;
        file = fopen(path, "wb");
        char kept = bytes[at];
        bytes[at] = (char)(bytes[at] ^ 0x41);
        fwrite(bytes, 1, (size_t)length, file);
        bytes[at] = kept;
        fclose(file);
        es_result result = es_recording_load(s.context, path, &loaded);
        assert_true(result == ES_FILE_DAMAGED || result == ES_FILE_TYPE);
        assert_null(loaded);
    }
    free(bytes);
    unlink(path);
    assert_int_equal(es_recording_save(recording, "/no such folder/x"), ES_FILE_WRITE);
    es_recording_destroy(recording);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_replay_gives_the_same_bits),
        cmocka_unit_test(test_a_divergence_names_step_and_object),
        cmocka_unit_test(test_another_world_is_refused),
        cmocka_unit_test(test_damaged_files_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
