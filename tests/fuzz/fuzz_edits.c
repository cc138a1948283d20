/* Reflection edits: the input is a glTF file (text or GLB) whose scene's extras hold edits for a small world. What is refused changes nothing; what is taken is saved, read again,
 * restored and undone with the same state, and what comes of it are numbers. */
#include <math.h>
#include <string.h>

#include <earthshine/sim.h>

#include "tests/fuzz/fuzz.h"

enum { CAP = 32 << 20 };

static es_world* small_world(fuzz_run* run)
{
    static const float positions[] = {-2, 0, -2, 2, 0, -2, 2, 0, 2, -2, 0, 2, -1, 0, -1, 1, 0, -1, 0, 2, -1};
    static const uint32_t indices[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 1, 1, 2};
    es_world* world;
    es_mesh mesh;
    es_instance instance;
    es_light light;
    es_camera camera;
    es_node nodes[3];
    es_camera_desc lens = es_default_camera_desc();
    es_light_desc lamp = es_default_light_desc();
    lens.name = "camera";
    lamp.name = "lamp";
    bool made = es_world_create(run->context, NULL, &world) == ES_OK && es_world_add_mesh(world, &(es_mesh_desc){.vertex_count = 7, .triangle_count = 4, .positions = positions, .indices = indices}, &mesh) == ES_OK;
    static const char* const names[] = {"pot", "mirror", ""};
    for (int i = 0; i < 3 && made; i++) made = es_world_add_node(world, &(es_node_desc){.name = names[i], .transform = {.translation = {(float)i, 1, 0}}}, &nodes[i]) == ES_OK && es_world_add_instance(world, &(es_instance_desc){.node = nodes[i], .mesh = mesh}, &instance) == ES_OK;
    lens.node = lamp.node = nodes[2];
    made = made && es_world_add_camera(world, &lens, &camera) == ES_OK && es_world_add_light(world, &lamp, &light) == ES_OK && es_world_step(world, 0) == ES_OK;
    FUZZ_CHECK(made, "%s", es_context_message(run->context));
    return world;
}

static bool number(es_vec3 v) { return isfinite(v.x) && isfinite(v.y) && isfinite(v.z); }

static void look(es_world* world)
{
    const es_edit_list* list = es_world_edits(world);
    for (uint32_t i = 0; i < list->constraint_count; i++) {
        const es_resolved_constraint* c = &list->constraints[i];
        FUZZ_CHECK(number(c->position) && number(c->normal) && number(c->direction) && number(c->target), "constraint %u", i);
        for (int k = 0; c->distances && k < 7; k++) FUZZ_CHECK(c->distances[k] >= 0, "distance %d of constraint %u", k, i);
    }
    for (uint32_t i = 0; i < list->region_count; i++) {
        const es_resolved_region* r = &list->regions[i];
        FUZZ_CHECK(number(r->centre), "region %u", i);
        for (int k = 0; r->distances && k < 7; k++) FUZZ_CHECK(r->distances[k] >= 0, "distance %d of region %u", k, i);
    }
}

/* Saved, read, and saved again it is the same text. (Parameters stay when edits are replaced, so that the world's hash says no more.) */
static void save_and_read(fuzz_run* run, es_world* world, uint64_t hash)
{
    es_result result = fuzz_expect(run, es_world_save_edits(world, NULL, fuzz_path("saved.gltf")));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "%s", es_context_message(run->context));
    if (result != ES_OK) return;
    result = fuzz_expect(run, es_world_load_edits(world, fuzz_path("saved.gltf")));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "%s", es_context_message(run->context));
    FUZZ_CHECK(result != ES_OK || es_world_hash(world) == hash, "what is saved is not what there was");
}

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size)
{
    fuzz_write("edits.gltf", bytes, size);
    fuzz_run run;
    fuzz_start(&run, CAP);
    es_world* world = small_world(&run);
    const uint64_t before = es_world_hash(world);
    es_edit_history* history;
    FUZZ_CHECK(fuzz_expect(&run, es_edit_history_create(world, 0, &history)) == ES_OK, "%s", es_context_message(run.context));
    es_result result = fuzz_expect(&run, es_world_load_edits(world, fuzz_path("edits.gltf")));
    const uint64_t hash = es_world_hash(world);
    FUZZ_CHECK(result == ES_OK || hash == before, "%s, and the world is another", es_result_name(result));
    if (result == ES_OK) {
        look(world);
        save_and_read(&run, world, hash);
        FUZZ_CHECK(fuzz_expect(&run, es_world_step(world, 0.5f)) == ES_OK, "%s", es_context_message(run.context));
        look(world);
        result = fuzz_expect(&run, es_edit_history_undo(history));
        size_t count = 0;
        FUZZ_CHECK(es_world_enumerate(world, ES_OBJECT_CONSTRAINT, NULL, &count) == ES_OK && (result != ES_OK || !count), "%zu constraints are left", count);
    }
    es_edit_history_destroy(history);
    es_world_destroy(world);
    fuzz_end(&run);
    return 0;
}
