/* Edits in saved states, hashes, recordings and undo.
 *
 * One function visits the fields of an object, in whatever mode. Objects are written whole, with handle and name: what is read makes them anew, under those handles, in
 * slots of its own that then take the place of the world's, so that nothing can fail half-way. */
#include "sim/edits/edit_state.h"
#include "sim/recording.h"

/* ---- fields ---------------------------------------------------------------------------------------------------------- */

static void visit_anchor(state_io* io, es_anchor* a)
{
    uint32_t kind = a->kind;
    visit_u32(io, &kind);
    if (reading(io)) io->good &= kind <= ES_ANCHOR_SURFACE;
    a->kind = (es_anchor_kind)(kind <= ES_ANCHOR_SURFACE ? kind : 0);
    visit_u32(io, &a->instance.id);
    visit_u32(io, &a->triangle);
    visit_floats(io, &a->u, 1);
    visit_floats(io, &a->v, 1);
    transfer(io, a->point, sizeof a->point);
}

/* The number of strokes too, not they. */
static void visit_region_desc(state_io* io, es_region_desc* d)
{
    uint32_t type = d->type;
    visit_u32(io, &type);
    d->type = (es_region_type)type;
    visit_anchor(io, &d->centre);
    visit_floats(io, &d->radius, 1);
    visit_floats(io, &d->border, 1);
    visit_flag(io, &d->off);
    visit_u32(io, &d->stroke_count);
}

static void visit_stroke(state_io* io, es_region_stroke* s)
{
    visit_anchor(io, &s->from);
    visit_anchor(io, &s->to);
    visit_floats(io, &s->radius, 1);
    visit_flag(io, &s->erase);
}

static void visit_constraint_desc(state_io* io, es_constraint_desc* d, char parameter_name[ES_EDIT_NAME])
{
    visit_anchor(io, &d->reflecting);
    visit_anchor(io, &d->reflected);
    visit_flag(io, &d->refraction);
    visit_floats(io, &d->direction.x, 3);
    transfer(io, d->eye, sizeof d->eye);
    visit_floats(io, &d->orientation.x, 4);
    visit_floats(io, &d->fov_y, 1);
    visit_flag(io, &d->follows_view);
    visit_flag(io, &d->geodesic);
    uint32_t kind = d->parameter.kind;
    visit_u32(io, &kind);
    d->parameter.kind = (es_edit_parameter_kind)kind;
    visit_u32(io, &d->parameter.camera.id);
    visit_u32(io, &d->parameter.node.id);
    visit_u32(io, &d->parameter.light.id);
    visit_u32(io, &d->parameter.axis);
    transfer(io, parameter_name, ES_EDIT_NAME);
    visit_flag(io, &d->off);
    visit_u32(io, &d->key_count);
}

static void visit_key(state_io* io, es_constraint_key* k)
{
    visit_floats(io, &k->at, 1);
    visit_anchor(io, &k->reflecting);
    visit_anchor(io, &k->reflected);
    visit_floats(io, &k->direction.x, 3);
}

static void visit_name(state_io* io, const char* name)
{
    uint32_t length = name ? (uint32_t)strlen(name) : 0;
    visit_u32(io, &length);
    transfer(io, (void*)name, length);
}

void es_visit_region(state_io* io, es_region_object* region)
{
    es_region_desc d = region->desc;
    visit_name(io, region->object.name);
    visit_region_desc(io, &d);
    for (uint32_t i = 0; i < d.stroke_count; i++) visit_stroke(io, (es_region_stroke*)&d.strokes[i]);
}

void es_visit_constraint(state_io* io, es_constraint_object* constraint)
{
    es_constraint_desc d = constraint->desc;
    visit_name(io, constraint->object.name);
    visit_constraint_desc(io, &d, constraint->parameter_name);
    for (uint32_t i = 0; i < d.key_count; i++) visit_key(io, (es_constraint_key*)&d.keys[i]);
}

/* ---- writing and hashing ---------------------------------------------------------------------------------------------- */

static const es_object_kind kinds[2] = {ES_OBJECT_REGION, ES_OBJECT_CONSTRAINT};

static void visit_object(state_io* io, es_object_kind kind, void* object)
{
    if (kind == ES_OBJECT_REGION) es_visit_region(io, object);
    else es_visit_constraint(io, object);
}

static void visit_objects(const es_world* world, state_io* io)
{
    for (int k = 0; k < 2; k++) {
        const es_slots* slots = &world->slots[kinds[k]];
        uint32_t count = slots->live;
        visit_u32(io, &count);
        for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
            es_object* object = es_slots_at(slots, slot);
            if (!object) continue;
            uint32_t id = io->mode == HASH ? slot : object->id; /* how often a slot was used before says nothing about the world */
            visit_u32(io, &id);
            visit_object(io, kinds[k], object);
        }
    }
}

static void visit_values(state_io* io, const es_edits* edits)
{
    uint32_t count = (uint32_t)edits->parameter_count;
    bool frozen = edits->frozen;
    visit_u32(io, &count);
    for (uint32_t i = 0; i < count; i++) {
        transfer(io, edits->parameters[i].name, ES_EDIT_NAME);
        visit_floats(io, &edits->parameters[i].value, 1);
    }
    visit_flag(io, &frozen);
    transfer(io, (void*)edits->eye, sizeof edits->eye);
}

static bool nothing(const es_world* world)
{
    const es_edits* edits = world->edits;
    return !edits || (!edits->parameter_count && !edits->frozen && !world->slots[ES_OBJECT_REGION].live && !world->slots[ES_OBJECT_CONSTRAINT].live);
}

static size_t write_with(const es_world* world, state_io* io, bool values)
{
    if (values && nothing(world)) return 0;
    if (values) visit_values(io, world->edits);
    visit_objects(world, io);
    return io->at;
}

size_t es_edits_write(const es_world* world, bool values, void* bytes)
{
    state_io io = {.mode = bytes ? WRITE : COUNT, .bytes = bytes, .good = true};
    return write_with(world, &io, values);
}

uint64_t es_edits_hash(const es_world* world, uint64_t hash)
{
    state_io io = {.mode = HASH, .hash = hash, .good = true};
    write_with(world, &io, true);
    return io.hash;
}

/* ---- reading -------------------------------------------------------------------------------------------------------------- */

struct es_edit_stage {
    es_slots slots[2];
    bool values;              /* the three below are of meaning */
    es_parameter* parameters;
    uint32_t parameter_count;
    bool frozen;
    double eye[3];
    size_t strokes;
};

static void free_objects(es_context* context, es_slots slots[2])
{
    for (uint32_t slot = 0; slot < slots[0].slot_count; slot++) {
        es_region_object* region = es_slots_at(&slots[0], slot);
        if (region) es_region_object_free(context, region);
    }
    for (uint32_t slot = 0; slot < slots[1].slot_count; slot++) {
        es_constraint_object* constraint = es_slots_at(&slots[1], slot);
        if (constraint) es_constraint_object_free(context, constraint);
    }
    for (int k = 0; k < 2; k++) es_slots_free(context, &slots[k]);
}

void es_edit_stage_free(es_world* world, es_edit_stage* stage)
{
    if (!stage) return;
    free_objects(world->context, stage->slots);
    es_release(world->context, stage->parameters, stage->parameter_count * sizeof *stage->parameters);
    es_release(world->context, stage, sizeof *stage);
}

/* A count of what takes at least `least` bytes each; 0 and not good when there cannot be so many. */
static uint32_t read_count(state_io* io, uint32_t most, size_t least)
{
    uint32_t count = 0;
    visit_u32(io, &count);
    io->good = io->good && count <= most && count <= (io->size - io->at) / least;
    return io->good ? count : 0;
}

static bool no_memory(state_io* io)
{
    io->good = false;
    io->no_memory = true;
    return false;
}

/* *name is released by the caller with its length and one. */
static bool read_name(es_context* context, state_io* io, char** name, uint32_t* length)
{
    *length = read_count(io, UINT32_MAX, 1);
    if (!io->good) return false;
    *name = es_allocate(context, *length + (size_t)1);
    if (!*name) return no_memory(io);
    transfer(io, *name, *length);
    (*name)[*length] = 0;
    io->good = io->good && strlen(*name) == *length;
    return io->good;
}

static bool read_region(es_context* context, state_io* io, es_region_object* region)
{
    es_region_desc d = {0};
    visit_region_desc(io, &d);
    if (!io->good || d.stroke_count > ES_EDIT_STROKES || d.stroke_count > (io->size - io->at) / sizeof(uint32_t)) return io->good = false;
    es_region_stroke* strokes = es_allocate_zero(context, (d.stroke_count + (size_t)1) * sizeof *strokes);
    if (!strokes) return no_memory(io);
    for (uint32_t i = 0; i < d.stroke_count; i++) visit_stroke(io, &strokes[i]);
    d.strokes = strokes;
    uint32_t which;
    io->good = io->good && es_region_valid(&d, &which) == NULL;
    if (io->good && !es_region_put(context, region, &d)) no_memory(io);
    es_release(context, strokes, (d.stroke_count + (size_t)1) * sizeof *strokes);
    return io->good;
}

static bool read_constraint(es_context* context, state_io* io, es_constraint_object* constraint)
{
    es_constraint_desc d = {0};
    char name[ES_EDIT_NAME];
    visit_constraint_desc(io, &d, name);
    if (!io->good || !memchr(name, 0, sizeof name) || d.key_count > ES_EDIT_KEYS || d.key_count > (io->size - io->at) / sizeof(uint32_t)) return io->good = false;
    d.parameter.name = name[0] ? name : NULL;
    es_constraint_key* keys = es_allocate_zero(context, (d.key_count + (size_t)1) * sizeof *keys);
    if (!keys) return no_memory(io);
    for (uint32_t i = 0; i < d.key_count; i++) visit_key(io, &keys[i]);
    d.keys = keys;
    uint32_t which;
    io->good = io->good && es_constraint_valid(&d, &which) == NULL;
    if (io->good && !es_constraint_put(context, constraint, &d)) no_memory(io);
    es_release(context, keys, (d.key_count + (size_t)1) * sizeof *keys);
    return io->good;
}

/* Name and fields into an object under handle `id` of `slots`, which must not be there yet. The object or NULL. */
static void* read_object(es_context* context, state_io* io, es_slots* slots, int kind, uint32_t id)
{
    char* name = NULL;
    uint32_t length = 0;
    es_object* object = NULL;
    if (!(id >> ES_SLOT_BITS) || es_slots_at(slots, es_slot_of(id)) || es_slot_of(id) >= slots->limit) io->good = false;
    else if (read_name(context, io, &name, &length)) {
        object = es_slots_put(context, slots, kind ? "constraint" : "region", id, name);
        if (!object) no_memory(io);
        else if (!(kind ? read_constraint(context, io, (es_constraint_object*)object) : read_region(context, io, (es_region_object*)object))) {
            es_slots_remove(context, slots, object);
            object = NULL;
        }
    }
    if (name) es_release(context, name, length + (size_t)1);
    return object;
}

static void read_values(es_context* context, state_io* io, es_edit_stage* stage)
{
    stage->parameter_count = read_count(io, ES_EDIT_PARAMETERS, sizeof(es_parameter));
    if (stage->parameter_count) stage->parameters = es_allocate_zero(context, stage->parameter_count * sizeof *stage->parameters);
    if (stage->parameter_count && !stage->parameters) {
        stage->parameter_count = 0;
        no_memory(io);
        return;
    }
    for (uint32_t i = 0; i < stage->parameter_count && io->good; i++) {
        es_parameter* p = &stage->parameters[i];
        transfer(io, p->name, ES_EDIT_NAME);
        visit_floats(io, &p->value, 1);
        io->good = io->good && p->name[0] && memchr(p->name, 0, ES_EDIT_NAME) && es_within(p->value, -ES_WORLD_EXTENT, ES_WORLD_EXTENT) && (!i || strcmp(p[-1].name, p->name) < 0);
    }
    visit_flag(io, &stage->frozen);
    transfer(io, stage->eye, sizeof stage->eye);
    io->good = io->good && es_anchor_valid(&(es_anchor){.kind = ES_ANCHOR_POINT, .point = {stage->eye[0], stage->eye[1], stage->eye[2]}});
    stage->values = true;
}

static size_t more(size_t wanted, size_t present) { return wanted > present ? wanted - present : 0; }

bool es_edit_stage_reserve(es_world* world, const es_edit_stage* stage)
{
    return es_edits_of(world) && es_edits_reserve(world, more(stage->slots[0].live, world->slots[kinds[0]].live), more(stage->slots[1].live, world->slots[kinds[1]].live), more(stage->strokes, world->edits->strokes));
}

/* Slots that go on from the world's. False after es_fail. */
static bool begin_slots(es_world* world, es_edit_stage* stage)
{
    for (int k = 0; k < 2; k++) {
        const es_slots* old = &world->slots[kinds[k]];
        es_slots_init(&stage->slots[k], old->object_size, old->limit);
        if (!es_slots_succeed(world->context, &stage->slots[k], old)) return false;
    }
    return true;
}

es_edit_stage* es_edit_stage_begin(es_world* world)
{
    es_edit_stage* stage = es_allocate_zero(world->context, sizeof *stage);
    if (stage && begin_slots(world, stage)) return stage;
    es_edit_stage_free(world, stage);
    return NULL;
}

bool es_edit_stage_add_region(es_world* world, es_edit_stage* stage, const es_region_desc* desc)
{
    es_region_object* object = es_slots_add(world->context, &stage->slots[0], "region", desc->name);
    if (!object) return false;
    stage->strokes += desc->stroke_count;
    return es_region_put(world->context, object, desc);
}

bool es_edit_stage_add_constraint(es_world* world, es_edit_stage* stage, const es_constraint_desc* desc)
{
    es_constraint_object* object = es_slots_add(world->context, &stage->slots[1], "constraint", desc->name);
    return object && es_constraint_put(world->context, object, desc);
}

bool es_edit_stage_set_parameter(es_world* world, es_edit_stage* stage, const char* name, float value)
{
    es_context* context = world->context;
    if (!stage->values) { /* from now on the stage's own: those the world has, to begin with */
        const es_edits* edits = world->edits;
        const size_t count = edits ? edits->parameter_count : 0;
        if (count) stage->parameters = es_allocate(context, count * sizeof *stage->parameters);
        if (count && !stage->parameters) return false;
        if (count) memcpy(stage->parameters, edits->parameters, count * sizeof *stage->parameters);
        stage->parameter_count = (uint32_t)count;
        stage->frozen = edits && edits->frozen;
        if (edits) memcpy(stage->eye, edits->eye, sizeof stage->eye);
        stage->values = true;
    }
    uint32_t at = 0;
    while (at < stage->parameter_count && strcmp(stage->parameters[at].name, name) < 0) at++;
    if (at < stage->parameter_count && strcmp(stage->parameters[at].name, name) == 0) {
        stage->parameters[at].value = value;
        return true;
    }
    if (stage->parameter_count == ES_EDIT_PARAMETERS) {
        es_fail(context, ES_INVALID_ARGUMENT, "parameter '%s': a world has at most %d", name, ES_EDIT_PARAMETERS);
        return false;
    }
    es_parameter* more_parameters = es_allocate_zero(context, (stage->parameter_count + (size_t)1) * sizeof *more_parameters);
    if (!more_parameters) return false;
    memcpy(more_parameters, stage->parameters ? stage->parameters : more_parameters, at * sizeof *more_parameters);
    strncpy(more_parameters[at].name, name, ES_EDIT_NAME - 1);
    more_parameters[at].value = value;
    for (uint32_t i = at; i < stage->parameter_count; i++) more_parameters[i + 1] = stage->parameters[i];
    es_release(context, stage->parameters, stage->parameter_count * sizeof *stage->parameters);
    stage->parameters = more_parameters;
    stage->parameter_count++;
    return true;
}

es_result es_edits_stage(es_world* world, bool values, const void* bytes, size_t size, es_edit_stage** out)
{
    es_context* context = world->context;
    *out = NULL;
    if (!size && nothing(world)) return ES_OK;
    es_edit_stage* stage = es_allocate_zero(context, sizeof *stage);
    if (!stage) return es_context_last_result(context);
    state_io io = {.mode = CHECK, .bytes = (char*)bytes, .size = size, .good = true};
    stage->values = values;
    if (size && values) read_values(context, &io, stage);
    if (io.good && !begin_slots(world, stage)) no_memory(&io);
    for (int k = 0; k < 2 && size && io.good; k++) {
        const uint32_t count = read_count(&io, stage->slots[k].limit, sizeof(uint32_t));
        for (uint32_t i = 0; i < count && io.good; i++) {
            uint32_t id = 0;
            visit_u32(&io, &id);
            const void* object = io.good ? read_object(context, &io, &stage->slots[k], k, id) : NULL;
            if (object && !k) stage->strokes += ((const es_region_object*)object)->desc.stroke_count;
        }
    }
    io.good = io.good && io.at == size;
    if (io.good && !es_edit_stage_reserve(world, stage)) no_memory(&io);
    if (io.good) {
        *out = stage;
        return ES_OK;
    }
    es_edit_stage_free(world, stage);
    return io.no_memory ? es_context_last_result(context) : ES_FILE_DAMAGED;
}

/* Distances that are still those of the same edit need not be computed again. */
static void keep_field(es_geodesic_field* into, es_geodesic_field* from)
{
    *into = *from;
    *from = (es_geodesic_field){0};
}

void es_edits_take(es_world* world, es_edit_stage* stage)
{
    if (!stage) return;
    es_context* context = world->context;
    es_edits* edits = world->edits;
    for (int k = 0; k < 2; k++) {
        es_slots *old = &world->slots[kinds[k]], *new = &stage->slots[k];
        for (uint32_t slot = 0; slot < new->slot_count; slot++) {
            es_object *a = es_slots_at(new, slot), *b = a ? es_slots_get(old, a->id) : NULL;
            if (!b) continue;
            if (k) keep_field(&((es_constraint_object*)a)->field, &((es_constraint_object*)b)->field);
            else keep_field(&((es_region_object*)a)->field, &((es_region_object*)b)->field);
            new->generations[slot] = old->generations[slot];
        }
        es_slots swap = *old;
        *old = *new;
        *new = swap;
    }
    if (stage->values) {
        es_release(context, edits->parameters, edits->parameter_capacity * sizeof *edits->parameters);
        edits->parameters = stage->parameters;
        edits->parameter_count = edits->parameter_capacity = stage->parameter_count;
        edits->frozen = stage->frozen;
        memcpy(edits->eye, stage->eye, sizeof edits->eye);
        stage->parameters = NULL;
        stage->parameter_count = 0;
    }
    edits->strokes = stage->strokes;
    edits->changes++;
    es_edit_stage_free(world, stage);
}

/* ---- notes -------------------------------------------------------------------------------------------------------------- */

void es_edits_note(es_world* world, es_object_kind kind, uint32_t id)
{
    if (!world->recording || world->in_step) return;
    es_object* object = es_slots_get(&world->slots[kind], id);
    state_io io = {.mode = COUNT, .good = true};
    if (object) visit_object(&io, kind, object);
    const size_t size = io.at;
    char* bytes = es_allocate(world->context, size + 1);
    if (!bytes) {
        es_recording_fail(world);
        return;
    }
    io = (state_io){.mode = WRITE, .bytes = bytes, .good = true};
    if (object) visit_object(&io, kind, object);
    es_note(world, &(es_input){.type = kind == ES_OBJECT_REGION ? ES_INPUT_REGION : ES_INPUT_CONSTRAINT, .id = id, .state = {bytes, size}});
    es_release(world->context, bytes, size + 1);
}

void es_edits_note_all(es_world* world)
{
    if (!world->recording || world->in_step) return;
    const size_t size = es_edits_write(world, false, NULL);
    char* bytes = es_allocate(world->context, size + 1);
    if (!bytes) {
        es_recording_fail(world);
        return;
    }
    es_edits_write(world, false, bytes);
    es_note(world, &(es_input){.type = ES_INPUT_EDITS, .state = {bytes, size}});
    es_release(world->context, bytes, size + 1);
}

void es_edits_note_parameters(es_world* world)
{
    if (!world->recording || world->in_step) return;
    for (size_t i = 0; i < world->edits->parameter_count; i++) {
        const es_parameter* p = &world->edits->parameters[i];
        es_note(world, &(es_input){.type = ES_INPUT_PARAMETER, .number = p->value, .state = {p->name, strlen(p->name)}});
    }
}

/* As it was noted: made anew under its handle, or, of no bytes, destroyed. */
es_result es_edits_apply_note(es_world* world, es_object_kind kind, uint32_t id, const void* bytes, size_t size)
{
    es_context* context = world->context;
    es_edits* edits = es_edits_of(world);
    if (!edits) return es_context_last_result(context);
    es_slots* slots = &world->slots[kind];
    if (!size) return kind == ES_OBJECT_REGION ? es_world_destroy_region(world, (es_region){id}) : es_world_destroy_constraint(world, (es_constraint){id});
    /* beside what is there first, so that a failure leaves that */
    es_slots beside;
    es_slots_init(&beside, slots->object_size, slots->limit);
    state_io io = {.mode = CHECK, .bytes = (char*)bytes, .size = size, .good = true};
    es_object* object = read_object(context, &io, &beside, kind == ES_OBJECT_CONSTRAINT, id);
    es_result result = io.no_memory ? es_context_last_result(context) : io.good && io.at == size ? ES_OK : ES_FILE_DAMAGED;
    const uint32_t strokes = object && kind == ES_OBJECT_REGION ? ((es_region_object*)object)->desc.stroke_count : 0;
    if (result == ES_OK && !es_edits_reserve(world, 1, 1, strokes)) result = es_context_last_result(context);
    es_object* present = result == ES_OK ? es_slots_get(slots, id) : NULL;
    if (result == ES_OK && !present && es_slots_at(slots, es_slot_of(id))) result = ES_FILE_DAMAGED;
    if (result == ES_OK && !present) {
        present = es_slots_put(context, slots, kind == ES_OBJECT_REGION ? "region" : "constraint", id, object->name);
        if (!present) result = es_context_last_result(context);
    }
    if (result == ES_OK && kind == ES_OBJECT_REGION) {
        es_region_object *from = (es_region_object*)object, *to = (es_region_object*)present;
        const es_region_desc swap = to->desc;
        edits->strokes = edits->strokes - swap.stroke_count + from->desc.stroke_count;
        to->desc = from->desc;
        from->desc = swap;
    } else if (result == ES_OK) {
        es_constraint_object *from = (es_constraint_object*)object, *to = (es_constraint_object*)present;
        const es_constraint_desc swap = to->desc;
        to->desc = from->desc;
        from->desc = swap;
        memcpy(to->parameter_name, from->parameter_name, sizeof to->parameter_name);
        if (to->desc.parameter.name) to->desc.parameter.name = to->parameter_name;
    }
    if (object && kind == ES_OBJECT_REGION) es_region_object_free(context, (es_region_object*)object);
    else if (object) es_constraint_object_free(context, (es_constraint_object*)object);
    es_slots_free(context, &beside);
    edits->changes++;
    if (result == ES_FILE_DAMAGED) return es_fail(context, result, "the recording is damaged: a noted %s cannot be made", kind == ES_OBJECT_REGION ? "region" : "constraint");
    return result;
}

es_result es_edits_apply_all(es_world* world, const void* bytes, size_t size)
{
    es_edit_stage* stage;
    es_result result = es_edits_stage(world, false, bytes, size, &stage);
    if (result == ES_FILE_DAMAGED) return es_fail(world->context, result, "the recording is damaged: noted edits cannot be made");
    if (result == ES_OK) es_edits_take(world, stage);
    return result;
}
