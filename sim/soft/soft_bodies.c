/* Cloth and soft bodies as objects of the world: made, changed, held, destroyed. */
#include "sim/soft/soft.h"
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/hands.h"

static const char* label(const char* name) { return name ? name : ""; }

es_soft_desc es_default_soft_desc(void)
{
    return (es_soft_desc){.mass = 1, .bend_compliance = 0.1f, .damping = 0.3f, .thickness = 0.02f, .friction = 0.4f, .drag = 0.1f, .gravity_scale = 1};
}

/* The numbers that es_world_set_soft takes; NULL, or what is wrong. */
static const char* wrong_numbers(const es_soft_desc* d)
{
    if (!es_within(d->stretch_compliance, 0, 1e6f) || !es_within(d->shear_compliance, 0, 1e6f)) return "stretch and shear compliance must lie in 0 … 1e6 m/N";
    if (!es_within(d->bend_compliance, -1e6f, 1e6f)) return "bend_compliance must be at most 1e6 m/N";
    if (!es_within(d->volume_compliance, 0, 1e6f)) return "volume_compliance must lie in 0 … 1e6";
    if (!es_within(d->damping, 0, 1e3f)) return "damping must lie in 0 … 1000 1/s";
    if (!es_within(d->thickness, 0, 10)) return "thickness must lie in 0 … 10 m";
    if (!es_within(d->friction, 0, 10)) return "friction must lie in 0 … 10";
    if (!es_within(d->drag, 0, 1e3f)) return "drag must lie in 0 … 1000 kg/(m² s)";
    if (!es_within(d->wind.x, -1e3f, 1e3f) || !es_within(d->wind.y, -1e3f, 1e3f) || !es_within(d->wind.z, -1e3f, 1e3f)) return "wind must lie within 1000 m/s";
    if (!es_within(d->pressure, -1e6f, 1e6f)) return "pressure must lie within 1e6 Pa";
    if (!es_within(d->gravity_scale, -100, 100)) return "gravity_scale must lie within 100";
    if (d->tear_stretch != 0 && !es_within(d->tear_stretch, 1.01f, 1e3f)) return "tear_stretch must be 0 or lie in 1.01 … 1000";
    return NULL;
}

bool es_soft_numbers_valid(const es_soft_desc* desc) { return wrong_numbers(desc) == NULL; }

static es_result check_solid(es_world* world, const char* name, const es_soft_solid* solid)
{
    es_context* context = world->context;
    if (solid->particle_count == 0 || solid->particle_count > ES_SOFT_VERTICES || solid->tetrahedron_count == 0 || solid->tetrahedron_count > 8 * ES_SOFT_VERTICES || !solid->particles || !solid->tetrahedra)
        return es_fail(context, ES_INVALID_ARGUMENT, "soft body '%.64s': a solid has 1 … %d particles and at least one tetrahedron", name, ES_SOFT_VERTICES);
    if (!es_all_within(solid->particles, 3 * (size_t)solid->particle_count, 1e6f))
        return es_fail(context, ES_INVALID_ARGUMENT, "soft body '%.64s': particles must be finite and within 1e6 m", name);
    for (size_t i = 0; i < 4 * (size_t)solid->tetrahedron_count; i++)
        if (solid->tetrahedra[i] >= solid->particle_count)
            return es_fail(context, ES_INVALID_ARGUMENT, "soft body '%.64s': tetrahedron %zu names particle %u of %u", name, i / 4, solid->tetrahedra[i], solid->particle_count);
    return ES_OK;
}

static es_result check_desc(es_world* world, const es_soft_desc* desc)
{
    es_context* context = world->context;
    const char* name = label(desc->name);
    const es_mesh_object* mesh = es_world_object(world, ES_OBJECT_MESH, desc->mesh.id);
    if (!mesh) return ES_STALE_HANDLE;
    if (desc->node.id && !es_world_object(world, ES_OBJECT_NODE, desc->node.id)) return ES_STALE_HANDLE;
    const char* wrong = wrong_numbers(desc);
    if (!wrong && !es_within(desc->mass, 1e-6f, 1e6f)) wrong = "mass must lie in 1e-6 … 1e6 kg";
    if (!wrong && desc->substeps > 1024) wrong = "substeps must be at most 1024";
    if (!wrong && desc->attachment_count && !desc->attachments) wrong = "attachments must not be NULL";
    if (!wrong && desc->solid && (desc->self_collision || desc->tear_stretch != 0 || desc->tearable)) wrong = "only a cloth collides with itself and tears";
    if (wrong) return es_fail(context, ES_INVALID_ARGUMENT, "soft body '%.64s': %s", name, wrong);
    if (mesh->soft) return es_fail(context, ES_WRONG_STATE, "soft body '%.64s': mesh '%.64s' already is another one's", name, label(mesh->object.name));
    if (mesh->drive) return es_fail(context, ES_WRONG_STATE, "soft body '%.64s': mesh '%.64s' already follows a skin or morph targets", name, label(mesh->object.name));
    if (mesh->raster.triangle_count == 0 || mesh->raster.vertex_count > ES_SOFT_VERTICES)
        return es_fail(context, ES_INVALID_ARGUMENT, "soft body '%.64s': mesh '%.64s' has %u triangles and %u vertices; at least one triangle and at most %d vertices are accepted", name,
            label(mesh->object.name), mesh->raster.triangle_count, mesh->raster.vertex_count, ES_SOFT_VERTICES);
    const es_mat4* matrix = es_node_world(world, desc->node);
    for (int k = 0; k < 3; k++)
        for (int end = 0; end < 2; end++) {
            const es_vec3 p = end ? mesh->raster.bounds_max : mesh->raster.bounds_min;
            double reach = 0;
            for (int c = 0; c < 3; c++) reach += __builtin_fabs((double)matrix->m[4 * c + k] * (double)(&p.x)[c]);
            if (!(reach < 1e6)) return es_fail(context, ES_INVALID_ARGUMENT, "soft body '%.64s': mesh '%.64s' reaches beyond 1e6 m from its node", name, label(mesh->object.name));
        }
    return desc->solid ? check_solid(world, name, desc->solid) : ES_OK;
}

/* A place where nothing is held: the particle number, or ES_SOFT_NONE after a message. */
static uint32_t particle_for(const es_world* world, const es_soft_object* soft, uint32_t vertex)
{
    const uint32_t count = soft->tetrahedron_count ? soft->particle_count : soft->first_vertices;
    if (vertex < count) return soft->tetrahedron_count ? vertex : soft->particle_at[vertex];
    es_fail(world->context, ES_INVALID_ARGUMENT, "soft body '%.64s' has no vertex %u; it has %u", label(soft->object.name), vertex, count);
    return ES_SOFT_NONE;
}

static void release_hold(es_world* world, const es_soft_hold* hold)
{
    es_world_rereference(world, ES_OBJECT_NODE, hold->node, 0);
    es_world_rereference(world, ES_OBJECT_BODY, hold->body, 0);
}

/* In the order of particles, so that it does not matter in which order they were held. `replaced` is the hold that was there, or none: its
 * references are the caller's to release, or to keep when he takes the new one back. */
static es_result add_hold(es_world* world, es_soft_object* soft, const es_soft_attachment* attachment, es_soft_hold* replaced)
{
    *replaced = (es_soft_hold){.particle = ES_SOFT_NONE};
    uint32_t particle = particle_for(world, soft, attachment->vertex);
    if (particle == ES_SOFT_NONE) return ES_INVALID_ARGUMENT;
    if (attachment->node.id && attachment->body.id)
        return es_fail(world->context, ES_INVALID_ARGUMENT, "soft body '%.64s': a vertex is held by a node or a body, not by both", label(soft->object.name));
    if (attachment->node.id && !es_world_object(world, ES_OBJECT_NODE, attachment->node.id)) return ES_STALE_HANDLE;
    if (attachment->body.id && !es_world_object(world, ES_OBJECT_BODY, attachment->body.id)) return ES_STALE_HANDLE;
    if (!attachment->in_place && !es_all_within(&attachment->local.x, 3, 1e6f))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "soft body '%.64s': the place of an attachment must be finite and within 1e6 m", label(soft->object.name));
    es_soft_hold hold = {particle, attachment->node.id, attachment->body.id, attachment->local};
    if (attachment->in_place) hold.local = es_soft_local_place(world, soft, &hold);
    if (!es_grow(world->context, (void**)&soft->holds, &soft->hold_capacity, soft->hold_count, soft->hold_count + (size_t)1, sizeof *soft->holds)) return es_context_last_result(world->context);
    uint32_t at = 0;
    while (at < soft->hold_count && soft->holds[at].particle < particle) at++;
    if (at < soft->hold_count && soft->holds[at].particle == particle) {
        *replaced = soft->holds[at];
    } else {
        memmove(soft->holds + at + 1, soft->holds + at, (soft->hold_count - at) * sizeof *soft->holds);
        soft->hold_count++;
    }
    soft->holds[at] = hold;
    es_world_rereference(world, ES_OBJECT_NODE, 0, hold.node);
    es_world_rereference(world, ES_OBJECT_BODY, 0, hold.body);
    return ES_OK;
}

static void take_back_hold(es_world* world, es_soft_object* soft, uint32_t particle, const es_soft_hold* replaced)
{
    uint32_t at = 0;
    while (soft->holds[at].particle != particle) at++;
    release_hold(world, &soft->holds[at]);
    if (replaced->particle == particle) {
        soft->holds[at] = *replaced;
    } else {
        soft->hold_count--;
        memmove(soft->holds + at, soft->holds + at + 1, (soft->hold_count - at) * sizeof *soft->holds);
    }
}

static bool fill(es_world* world, es_soft_object* soft, es_mesh_object* mesh, const es_soft_desc* desc)
{
    es_context* context = world->context;
    const bool tears = !desc->solid && soft->desc.tearable;
    soft->first_vertices = soft->vertex_used = mesh->raster.vertex_count;
    soft->vertex_count = mesh->raster.vertex_count + (tears ? mesh->raster.vertex_count + 64 : 0); /* reserved when all else is there */
    soft->weld = NULL;
    memcpy(soft->origin, es_node_position(world, desc->node), sizeof soft->origin);
    if (!(desc->solid ? es_soft_embed(world, soft, mesh, desc->solid) : es_soft_weld(world, soft, mesh))) return false;
    if (!desc->solid) {
        soft->parent = es_soft_room(&soft->arena, soft->particle_room - soft->first_particles, sizeof *soft->parent);
        soft->weld = es_soft_room(&soft->arena, soft->vertex_count, sizeof *soft->weld);
        if (!soft->parent || !soft->weld || !es_soft_make_mesh_fans(world, soft, mesh)) return false;
    }
    if (!es_soft_lay_out(context, soft, NULL)) return false;
    for (uint32_t p = 0; p < soft->particle_count; p++)
        for (int k = 0; k < 3; k++) soft->x[4 * (size_t)soft->layout.slot_of[p] + k] = soft->rest[3 * (size_t)p + k];
    memcpy(soft->before, soft->x, 4 * (size_t)soft->layout.slot_count * sizeof(float));
    return true;
}

es_result es_world_add_soft(es_world* world, const es_soft_desc* desc, es_soft* handle)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !handle) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_soft: desc and soft must not be NULL");
    *handle = (es_soft){0};
    es_world_refresh(world);
    es_result result = check_desc(world, desc);
    if (result != ES_OK) return result;
    es_soft_object* soft = es_slots_add(world->context, &world->slots[ES_OBJECT_SOFT], "soft body", desc->name);
    if (!soft) return es_context_last_result(world->context);
    es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], desc->mesh.id);
    es_arena_init(&soft->arena, world->context, 1 << 16);
    soft->desc = *desc;
    soft->desc.name = NULL;
    soft->desc.solid = NULL;
    soft->desc.attachments = NULL;
    soft->desc.attachment_count = 0;
    soft->desc.tearable |= desc->tear_stretch > 0;
    es_world_rereference(world, ES_OBJECT_MESH, 0, desc->mesh.id);
    es_world_rereference(world, ES_OBJECT_NODE, 0, desc->node.id);
    es_fp_environment environment = es_fp_enter();
    bool good = fill(world, soft, mesh, desc);
    if (!good) result = es_context_last_result(world->context);
    for (uint32_t i = 0; i < desc->attachment_count && result == ES_OK; i++) {
        es_soft_hold replaced;
        result = add_hold(world, soft, &desc->attachments[i], &replaced);
        if (result == ES_OK) release_hold(world, &replaced);
    }
    if (result == ES_OK && !es_soft_make_anchors(world->context, soft)) result = es_context_last_result(world->context);
    const uint32_t reserve = soft->vertex_count - mesh->raster.vertex_count;
    if (result == ES_OK && reserve && !es_mesh_reserve(world, mesh, reserve)) result = es_context_last_result(world->context);
    es_fp_leave(environment);
    if (result != ES_OK) {
        es_soft_free(world, soft);
        es_slots_remove(world->context, &world->slots[ES_OBJECT_SOFT], &soft->object);
        return result;
    }
    mesh->soft = soft->object.id;
    handle->id = soft->object.id;
    return ES_OK;
}

void es_soft_free(es_world* world, es_soft_object* soft)
{
    es_context* context = world->context;
    for (uint32_t i = 0; i < soft->hold_count; i++) release_hold(world, &soft->holds[i]);
    es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], soft->desc.mesh.id);
    if (mesh) mesh->soft = 0;
    es_world_rereference(world, ES_OBJECT_MESH, soft->desc.mesh.id, 0);
    es_world_rereference(world, ES_OBJECT_NODE, soft->desc.node.id, 0);
    es_soft_layout_free(&soft->layout);
    if (soft->anchors.arena.context) es_arena_free(&soft->anchors.arena);
    if (soft->mesh_fans.first_row) es_vertex_fans_free(context, &soft->mesh_fans);
    es_release(context, soft->holds, soft->hold_capacity * sizeof *soft->holds);
    es_release(context, soft->planes, soft->plane_capacity * sizeof *soft->planes);
    es_release(context, soft->plane_count, soft->plane_count_capacity);
    es_release(context, soft->keys, soft->key_capacity * sizeof *soft->keys);
    es_release(context, soft->obstacles, soft->obstacle_capacity * sizeof *soft->obstacles);
    es_release(context, soft->surfaces, soft->surface_capacity * sizeof *soft->surfaces);
    es_release(context, soft->pushes, soft->push_capacity * sizeof *soft->pushes);
    es_release(context, soft->pulls, soft->pull_capacity * sizeof *soft->pulls);
    es_release(context, soft->pairs, soft->pair_capacity * sizeof *soft->pairs);
    es_release(context, soft->cells, soft->cell_capacity * sizeof *soft->cells);
    es_release(context, soft->progress, soft->progress_capacity);
    es_release(context, soft->shown, soft->shown_capacity * sizeof *soft->shown);
    es_arena_free(&soft->arena);
}

static es_soft_object* object_of(const es_world* world, es_soft soft) { return es_world_object(world, ES_OBJECT_SOFT, soft.id); }

es_result es_world_destroy_soft(es_world* world, es_soft handle)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    es_hands_forget(world, ES_OBJECT_SOFT, soft->object.id);
    es_soft_free(world, soft);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_SOFT], &soft->object);
    return ES_OK;
}

es_result es_world_get_soft(const es_world* world, es_soft handle, es_soft_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    *desc = soft->desc;
    desc->name = soft->object.name;
    return ES_OK;
}

es_result es_world_set_soft(es_world* world, es_soft handle, const es_soft_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_soft: desc must not be NULL");
    const char* wrong = wrong_numbers(desc);
    es_soft_desc* now = &soft->desc;
    if (!wrong && soft->tetrahedron_count && desc->self_collision) wrong = "only a cloth collides with itself and tears";
    if (!wrong && desc->tear_stretch != 0 && !now->tearable) wrong = "it does not tear: tearable was not set when it was added";
    if (!wrong && (desc->bend_compliance < 0) != (now->bend_compliance < 0)) wrong = "whether it resists bending is decided when it is added";
    if (wrong) return es_fail(world->context, ES_INVALID_ARGUMENT, "soft body '%.64s': %s", label(soft->object.name), wrong);
    const bool reach = (desc->stretch_compliance == 0) != (now->stretch_compliance == 0);
    const es_soft_desc before = *now;
    es_soft_take_numbers(now, desc);
    if (reach) {
        es_fp_environment environment = es_fp_enter();
        const bool good = es_soft_make_anchors(world->context, soft);
        es_fp_leave(environment);
        if (!good) {
            *now = before;
            return es_context_last_result(world->context);
        }
    }
    es_soft_set_compliances(soft);
    es_soft_wake(soft);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_SOFT, .id = handle.id, .soft = *desc});
    return ES_OK;
}

void es_soft_take_numbers(es_soft_desc* now, const es_soft_desc* desc)
{
    now->stretch_compliance = desc->stretch_compliance;
    now->shear_compliance = desc->shear_compliance;
    now->bend_compliance = desc->bend_compliance;
    now->volume_compliance = desc->volume_compliance;
    now->damping = desc->damping;
    now->thickness = desc->thickness;
    now->friction = desc->friction;
    now->drag = desc->drag;
    now->wind = desc->wind;
    now->pressure = desc->pressure;
    now->gravity_scale = desc->gravity_scale;
    now->self_collision = desc->self_collision;
    now->tear_stretch = desc->tear_stretch;
}

es_result es_world_soft_attach(es_world* world, es_soft handle, const es_soft_attachment* attachment)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    if (!attachment) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_soft_attach: attachment must not be NULL");
    es_world_refresh(world);
    es_fp_environment environment = es_fp_enter();
    es_soft_hold replaced;
    es_result result = add_hold(world, soft, attachment, &replaced);
    if (result == ES_OK && !es_soft_make_anchors(world->context, soft)) {
        result = es_context_last_result(world->context);
        take_back_hold(world, soft, particle_for(world, soft, attachment->vertex), &replaced); /* the anchors have no room for it */
    } else if (result == ES_OK) {
        release_hold(world, &replaced);
    }
    es_fp_leave(environment);
    if (result != ES_OK) return result;
    es_soft_wake(soft);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_SOFT_ATTACH, .id = handle.id, .attachment = *attachment});
    return result;
}

es_result es_world_soft_detach(es_world* world, es_soft handle, uint32_t vertex)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    const uint32_t particle = vertex == ES_SOFT_ALL ? ES_SOFT_NONE : particle_for(world, soft, vertex), count = soft->hold_count;
    if (particle == ES_SOFT_NONE && vertex != ES_SOFT_ALL) return ES_INVALID_ARGUMENT;
    /* a vertex is held once: what is let go is one hold, or all of them */
    uint32_t first = 0, end = count;
    if (vertex != ES_SOFT_ALL) {
        while (first < count && soft->holds[first].particle != particle) first++;
        end = first < count ? first + 1 : first;
    }
    if (first == end) return ES_OK;
    const es_soft_hold let_go = soft->holds[first];
    if (vertex != ES_SOFT_ALL) memmove(soft->holds + first, soft->holds + end, (count - end) * sizeof *soft->holds);
    soft->hold_count = count - (end - first);
    es_fp_environment environment = es_fp_enter();
    const bool good = es_soft_make_anchors(world->context, soft);
    es_fp_leave(environment);
    if (!good) { /* all is held as it was */
        if (vertex != ES_SOFT_ALL) {
            memmove(soft->holds + end, soft->holds + first, (count - end) * sizeof *soft->holds);
            soft->holds[first] = let_go;
        }
        soft->hold_count = count;
        return es_context_last_result(world->context);
    }
    if (vertex != ES_SOFT_ALL) release_hold(world, &let_go);
    for (uint32_t i = 0; vertex == ES_SOFT_ALL && i < count; i++) release_hold(world, &soft->holds[i]);
    es_soft_wake(soft);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_SOFT_DETACH, .id = handle.id, .vertex = vertex});
    return ES_OK;
}

es_result es_world_wake_soft(es_world* world, es_soft handle)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    es_soft_wake(soft);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_SOFT_WAKE, .id = handle.id});
    return ES_OK;
}

es_result es_world_soft_impulse(es_world* world, es_soft handle, uint32_t vertex, es_vec3 impulse)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    if (!es_all_within(&impulse.x, 3, 1e12f)) return es_fail(world->context, ES_INVALID_ARGUMENT, "soft body '%.64s': an impulse must be finite and within 1e12 N s", label(soft->object.name));
    uint32_t particle = vertex == ES_SOFT_ALL ? 0 : particle_for(world, soft, vertex);
    if (particle == ES_SOFT_NONE) return ES_INVALID_ARGUMENT;
    es_fp_environment environment = es_fp_enter();
    double mass = 0;
    for (uint32_t p = 0; p < soft->particle_count; p++) mass += vertex == ES_SOFT_ALL || p == particle ? (double)soft->mass[p] : 0;
    const float by[3] = {impulse.x, impulse.y, impulse.z};
    for (uint32_t p = 0; p < soft->particle_count; p++) {
        if (vertex != ES_SOFT_ALL && p != particle) continue;
        float* v = soft->velocity + 4 * (size_t)soft->layout.slot_of[p];
        for (int k = 0; k < 3; k++) v[k] = es_clampf((float)((double)v[k] + (double)by[k] / mass), -ES_SOFT_SPEED, ES_SOFT_SPEED);
    }
    es_fp_leave(environment);
    es_soft_wake(soft);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_SOFT_IMPULSE, .id = handle.id, .vertex = vertex, .a = impulse});
    return ES_OK;
}

es_result es_world_get_soft_vertex(const es_world* world, es_soft handle, uint32_t vertex, double position[3], es_vec3* velocity)
{
    if (!world || !position) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    uint32_t particle = particle_for(world, soft, vertex);
    if (particle == ES_SOFT_NONE) return ES_INVALID_ARGUMENT;
    const size_t at = 4 * (size_t)soft->layout.slot_of[particle];
    for (int k = 0; k < 3; k++) position[k] = soft->origin[k] + (double)soft->x[at + k];
    if (velocity) *velocity = es_v3(soft->velocity[at], soft->velocity[at + 1], soft->velocity[at + 2]);
    return ES_OK;
}

es_result es_world_grab_soft(es_world* world, uint32_t hand, es_soft handle, uint32_t vertex, const double target[3])
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (hand >= ES_HANDS) return es_fail(world->context, ES_INVALID_ARGUMENT, "hand %u: there are hands 0 … %d", hand, ES_HANDS - 1);
    es_soft_object* soft = object_of(world, handle);
    if (!soft) return ES_STALE_HANDLE;
    if (particle_for(world, soft, vertex) == ES_SOFT_NONE) return ES_INVALID_ARGUMENT;
    bool good = target != NULL;
    for (int k = 0; k < 3 && good; k++) good = target[k] >= -(double)ES_WORLD_EXTENT && target[k] <= (double)ES_WORLD_EXTENT;
    if (!good) return es_fail(world->context, ES_INVALID_ARGUMENT, "holding soft body '%.64s': the place must be finite and within 1e9", label(soft->object.name));
    es_world_release(world, hand);
    world->hands[hand] = (es_hand_state){.soft = handle.id, .vertex = vertex, .target = {target[0], target[1], target[2]}};
    es_soft_wake(soft);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_GRAB_SOFT, .id = hand, .other = handle.id, .vertex = vertex, .place = {target[0], target[1], target[2]}});
    return ES_OK;
}
