/* Writing edits: as a glTF file of their own, or into a copy of one. */
#include "sim/edits/edit_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/edits/edit_state.h"
#include "sim/gltf_file.h"

typedef es_json_text text;

/* ---- edits as text ---------------------------------------------------------------------------------------------------- */

/* A member's name, with what parts it from the one before. */
static void member(text* out, bool* first, const char* name)
{
    es_json_write(out, "%s\"%s\": ", *first ? "" : ", ", name);
    *first = false;
}

static void write_floats(text* out, const float* values, int count)
{
    for (int i = 0; i < count; i++) {
        es_json_put(out, i ? ", " : "[", i ? 2 : 1);
        es_json_write_float(out, values[i]);
    }
    es_json_put(out, "]", 1);
}

static void write_doubles(text* out, const double* values, int count)
{
    for (int i = 0; i < count; i++) {
        es_json_put(out, i ? ", " : "[", i ? 2 : 1);
        es_json_write_double(out, values[i]);
    }
    es_json_put(out, "]", 1);
}

static void write_flag(text* out, bool* first, const char* name, bool value)
{
    if (!value) return;
    member(out, first, name);
    es_json_put(out, "true", 4);
}

static void write_float(text* out, bool* first, const char* name, float value)
{
    member(out, first, name);
    es_json_write_float(out, value);
}

static void write_text(text* out, bool* first, const char* name, const char* value)
{
    if (!value || !*value) return;
    member(out, first, name);
    es_json_write_string(out, value);
}

static uint32_t number_of(const es_world* world, es_object_kind kind, uint32_t id)
{
    uint32_t number = 0;
    for (uint32_t slot = 0; slot < es_slot_of(id); slot++) number += es_slots_at(&world->slots[kind], slot) != NULL;
    return number;
}

static void write_instance(const es_world* world, text* out, bool* first, es_instance instance)
{
    const es_instance_object* object = es_slots_get(&world->slots[ES_OBJECT_INSTANCE], instance.id);
    const es_object* node = es_slots_get(&world->slots[ES_OBJECT_NODE], object->desc.node.id);
    uint32_t which = 0;
    for (uint32_t slot = 0; slot < es_slot_of(instance.id); slot++) {
        const es_instance_object* other = es_slots_at(&world->slots[ES_OBJECT_INSTANCE], slot);
        which += other && other->desc.node.id == object->desc.node.id;
    }
    write_text(out, first, "node", node ? node->name : NULL);
    if (which) {
        member(out, first, "instance");
        es_json_write(out, "%u", which);
    }
    member(out, first, "index");
    es_json_write(out, "%u", number_of(world, ES_OBJECT_INSTANCE, instance.id));
}

static void write_anchor(const es_world* world, text* out, bool* first, const char* name, const es_anchor* a)
{
    if (a->kind == ES_ANCHOR_NONE) return;
    bool begins = true;
    member(out, first, name);
    es_json_put(out, "{", 1);
    if (a->instance.id) write_instance(world, out, &begins, a->instance);
    if (a->kind == ES_ANCHOR_POINT) {
        member(out, &begins, "point");
        write_doubles(out, a->point, 3);
    } else {
        member(out, &begins, "triangle");
        es_json_write(out, "%u", a->triangle);
        write_float(out, &begins, "u", a->u);
        write_float(out, &begins, "v", a->v);
    }
    es_json_put(out, "}", 1);
}

static void write_region(const es_world* world, text* out, const es_region_object* region)
{
    static const char* const types[] = {"euclidean", "geodesic", "freeForm"};
    const es_region_desc* d = &region->desc;
    bool first = true;
    es_json_put(out, "{", 1);
    write_text(out, &first, "name", region->object.name);
    write_text(out, &first, "type", types[d->type]);
    write_anchor(world, out, &first, "centre", &d->centre);
    write_float(out, &first, "radius", d->radius);
    write_float(out, &first, "border", d->border);
    write_flag(out, &first, "off", d->off);
    for (uint32_t i = 0; i < d->stroke_count; i++) {
        bool begins = true;
        if (i) es_json_put(out, ",\n      ", 8);
        else member(out, &first, "strokes");
        es_json_put(out, i ? "{" : "[{", i ? 1 : 2);
        write_anchor(world, out, &begins, "from", &d->strokes[i].from);
        write_anchor(world, out, &begins, "to", &d->strokes[i].to);
        write_float(out, &begins, "radius", d->strokes[i].radius);
        write_flag(out, &begins, "erase", d->strokes[i].erase);
        es_json_put(out, "}", 1);
    }
    if (d->stroke_count) es_json_put(out, "]", 1);
    es_json_put(out, "}", 1);
}

static bool some(const float* values, int count)
{
    for (int i = 0; i < count; i++)
        if (values[i] != 0) return true;
    return false;
}

static void write_parameter(const es_world* world, text* out, bool* first, const es_edit_parameter* p)
{
    static const char* const words[] = {"time", "camera", "node", "light", "named"};
    static const char* const axes[] = {"x", "y", "z"};
    if (p->kind == ES_EDIT_TIME) return;
    bool begins = true;
    member(out, first, "parameter");
    es_json_put(out, "{", 1);
    write_text(out, &begins, "kind", words[p->kind]);
    const es_object_kind kind = p->kind == ES_EDIT_CAMERA ? ES_OBJECT_CAMERA : p->kind == ES_EDIT_NODE ? ES_OBJECT_NODE : ES_OBJECT_LIGHT;
    const uint32_t id = p->kind == ES_EDIT_CAMERA ? p->camera.id : p->kind == ES_EDIT_NODE ? p->node.id : p->kind == ES_EDIT_LIGHT ? p->light.id : 0;
    if (id) {
        write_text(out, &begins, words[p->kind], ((const es_object*)es_slots_get(&world->slots[kind], id))->name);
        member(out, &begins, "index");
        es_json_write(out, "%u", number_of(world, kind, id));
    }
    if (p->kind == ES_EDIT_CAMERA || p->kind == ES_EDIT_NODE) write_text(out, &begins, "axis", axes[p->axis]);
    if (p->kind == ES_EDIT_NAMED) write_text(out, &begins, "name", p->name);
    es_json_put(out, "}", 1);
}

static void write_direction(text* out, bool* first, const es_vec3* direction)
{
    if (!some(&direction->x, 3)) return;
    member(out, first, "direction");
    write_floats(out, &direction->x, 3);
}

static void write_constraint(const es_world* world, text* out, const es_constraint_object* constraint)
{
    const es_constraint_desc* d = &constraint->desc;
    bool first = true;
    es_json_put(out, "{", 1);
    write_text(out, &first, "name", constraint->object.name);
    write_anchor(world, out, &first, "reflecting", &d->reflecting);
    write_anchor(world, out, &first, "reflected", &d->reflected);
    write_flag(out, &first, "refraction", d->refraction);
    write_direction(out, &first, &d->direction);
    member(out, &first, "eye");
    write_doubles(out, d->eye, 3);
    member(out, &first, "orientation");
    write_floats(out, &d->orientation.x, 4);
    if (d->fov_y != 0) write_float(out, &first, "fovY", d->fov_y);
    write_flag(out, &first, "followsView", d->follows_view);
    write_flag(out, &first, "geodesic", d->geodesic);
    write_flag(out, &first, "off", d->off);
    write_parameter(world, out, &first, &d->parameter);
    for (uint32_t i = 0; i < d->key_count; i++) {
        bool begins = true;
        if (i) es_json_put(out, ",\n      ", 8);
        else member(out, &first, "keys");
        es_json_put(out, i ? "{" : "[{", i ? 1 : 2);
        write_float(out, &begins, "at", d->keys[i].at);
        write_anchor(world, out, &begins, "reflecting", &d->keys[i].reflecting);
        write_anchor(world, out, &begins, "reflected", &d->keys[i].reflected);
        write_direction(out, &begins, &d->keys[i].direction);
        es_json_put(out, "}", 1);
    }
    if (d->key_count) es_json_put(out, "]", 1);
    es_json_put(out, "}", 1);
}

/* Can what it names be named in a file? */
static bool there(const es_world* world, const es_anchor* a)
{
    es_anchored found;
    if (a->kind == ES_ANCHOR_SURFACE) return es_anchor_find(world, a, &found);
    return !a->instance.id || es_slots_get(&world->slots[ES_OBJECT_INSTANCE], a->instance.id);
}

static bool region_there(const es_world* world, const es_region_desc* d)
{
    bool good = there(world, &d->centre);
    for (uint32_t i = 0; i < d->stroke_count && good; i++) good = there(world, &d->strokes[i].from) && there(world, &d->strokes[i].to);
    return good;
}

static bool constraint_there(const es_world* world, const es_constraint_desc* d)
{
    const es_edit_parameter* p = &d->parameter;
    bool good = there(world, &d->reflecting) && there(world, &d->reflected);
    if (p->kind == ES_EDIT_CAMERA && p->camera.id) good &= es_slots_get(&world->slots[ES_OBJECT_CAMERA], p->camera.id) != NULL;
    if (p->kind == ES_EDIT_NODE) good &= es_slots_get(&world->slots[ES_OBJECT_NODE], p->node.id) != NULL;
    if (p->kind == ES_EDIT_LIGHT) good &= es_slots_get(&world->slots[ES_OBJECT_LIGHT], p->light.id) != NULL;
    for (uint32_t i = 0; i < d->key_count && good; i++) good = there(world, &d->keys[i].reflecting) && there(world, &d->keys[i].reflected);
    return good;
}

static void write_edits(const es_world* world, text* out)
{
    const es_edits* edits = world->edits;
    es_json_write(out, "{\"version\": 1");
    for (size_t i = 0; edits && i < edits->parameter_count; i++) {
        es_json_write(out, i ? ", " : ",\n    \"parameters\": {");
        es_json_write_string(out, edits->parameters[i].name);
        es_json_put(out, ": ", 2);
        es_json_write_float(out, edits->parameters[i].value);
    }
    if (edits && edits->parameter_count) es_json_put(out, "}", 1);
    size_t left_out = 0;
    for (int k = 0; k < 2; k++) {
        const es_slots* slots = &world->slots[k ? ES_OBJECT_CONSTRAINT : ES_OBJECT_REGION];
        es_json_write(out, ",\n    \"%s\": [", k ? "constraints" : "regions");
        const char* parting = "\n      ";
        for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
            const es_object* object = es_slots_at(slots, slot);
            if (!object) continue;
            const bool kept = k ? constraint_there(world, &((const es_constraint_object*)object)->desc) : region_there(world, &((const es_region_object*)object)->desc);
            left_out += !kept;
            if (!kept) continue;
            es_json_write(out, "%s", parting);
            parting = ",\n      ";
            if (k) write_constraint(world, out, (const es_constraint_object*)object);
            else write_region(world, out, (const es_region_object*)object);
        }
        es_json_put(out, "]", 1);
    }
    es_json_put(out, "}", 1);
    if (left_out) es_log(world->context, ES_LOG_WARNING, ES_ASSET_WARNING, "saving edits: %zu of them %s on what is gone and left out", left_out, left_out == 1 ? "is" : "are");
}

/* ---- files -------------------------------------------------------------------------------------------------------------------- */

/* Under a name of its own beside `path` first, then in its place. */
static es_result write_file(es_context* context, const char* path, const char* const* parts, const size_t* sizes, int count)
{
    const size_t size = strlen(path) + 32;
    char* temporary = es_allocate(context, size);
    if (!temporary) return es_context_last_result(context);
    snprintf(temporary, size, "%s.%ld.part", path, (long)getpid());
    errno = 0;
    FILE* file = fopen(temporary, "wb");
    bool good = file != NULL;
    for (int i = 0; i < count && good; i++) good = !sizes[i] || fwrite(parts[i], 1, sizes[i], file) == sizes[i];
    if (file) good = fclose(file) == 0 && good;
    good = good && rename(temporary, path) == 0;
    es_result result = good ? ES_OK : es_fail(context, ES_FILE_WRITE, "cannot write '%s': %s", path, strerror(errno ? errno : EIO));
    if (!good && file) unlink(temporary);
    es_release(context, temporary, size);
    return result;
}

/* Of the folder a path is in; false where it cannot be looked at. */
static bool folder_of(es_context* context, const char* path, struct stat* status)
{
    const char* slash = strrchr(path, '/');
    const size_t length = slash ? (size_t)(slash - path) + 1 : 1;
    char* folder = es_allocate(context, length + 1);
    if (!folder) return false;
    memcpy(folder, slash ? path : ".", length);
    folder[length] = 0;
    bool good = stat(folder, status) == 0;
    es_release(context, folder, length + 1);
    return good;
}

/* Files that the source names must be found from the copy too, which looks for them in its own folder. */
static es_result check_companions(es_context* context, const es_json* json, const char* source, const char* path)
{
    struct stat from, to;
    if (folder_of(context, source, &from) && folder_of(context, path, &to) && from.st_dev == to.st_dev && from.st_ino == to.st_ino) return ES_OK;
    static const char* const lists[] = {"buffers", "images"};
    for (int k = 0; k < 2; k++) {
        const uint32_t list = es_json_member(json, 0, lists[k]);
        for (uint32_t i = list ? json->values[list].first : 0; i; i = json->values[i].next) {
            const uint32_t uri = es_json_member(json, i, "uri");
            char name[64] = "";
            if (!uri || (json->values[uri].end - json->values[uri].begin > 6 && memcmp(json->text + json->values[uri].begin, "\"data:", 6) == 0)) continue;
            es_json_string(json, uri, name, sizeof name);
            return es_fail(context, ES_FILE_UNSUPPORTED, "cannot write '%s': '%s' reads '%s' from its own folder; save the copy there", path, source, name);
        }
    }
    return ES_OK;
}

/* Where in the source's text the edits go: [begin, end) is replaced by `before`, them, `after`. */
typedef struct splice { size_t begin, end; const char *before, *after; } splice;

static bool find_splice(const es_json* json, splice* s)
{
    const es_edit_place place = es_edits_find(json);
    if (place.edits) {
        *s = (splice){json->values[place.edits].begin, json->values[place.edits].end, "", ""};
        return true;
    }
    const uint32_t in = place.earthshine ? place.earthshine : place.extras ? place.extras : place.scene;
    if (!in || json->values[in].type != ES_JSON_OBJECT) return false;
    static const char* const before[3][2] = {{"\"extras\": {\"earthshine\": {\"edits\": ", ", \"extras\": {\"earthshine\": {\"edits\": "}, {"\"earthshine\": {\"edits\": ", ", \"earthshine\": {\"edits\": "}, {"\"edits\": ", ", \"edits\": "}};
    static const char* const after[3] = {"}}", "}", ""};
    const int depth = place.earthshine ? 2 : place.extras ? 1 : 0;
    s->begin = s->end = json->values[in].end - 1; /* before its closing bracket */
    s->before = before[depth][json->values[in].count > 0];
    s->after = after[depth];
    return true;
}

static void put_little_endian(char* bytes, uint32_t value)
{
    for (int i = 0; i < 4; i++) bytes[i] = (char)(value >> 8 * i);
}

/* The whole file with its text replaced by before + edits + after. */
static es_result write_copy(es_context* context, const es_gltf_file* file, const splice* s, const text* edits, const char* path)
{
    const char* json = file->json;
    const char* bytes = (const char*)file->bytes;
    const bool glb = json != bytes && file->size >= 20 && memcmp(bytes, "glTF", 4) == 0;
    const size_t head = strlen(s->before), tail = strlen(s->after), rest = (size_t)((const char*)file->bytes + file->size - json) - s->end;
    if (!glb) {
        const char* parts[] = {bytes, s->before, edits->bytes, s->after, json + s->end};
        const size_t sizes[] = {(size_t)(json - bytes) + s->begin, head, edits->size, tail, rest};
        return write_file(context, path, parts, sizes, 5);
    }
    uint32_t old_length = 0;
    for (int i = 0; i < 4; i++) old_length |= (uint32_t)(uint8_t)bytes[12 + i] << 8 * i;
    const size_t after_chunk = 20 + (size_t)old_length; /* of the file: chunks that follow */
    const size_t length = file->json_size - (s->end - s->begin) + head + edits->size + tail, padding = (4 - length % 4) % 4, total = 20 + length + padding + (file->size - after_chunk);
    if (total > UINT32_MAX) return es_fail(context, ES_FILE_UNSUPPORTED, "cannot write '%s': it would have more than 4 GB", path);
    char header[20];
    memcpy(header, bytes, sizeof header);
    put_little_endian(header + 8, (uint32_t)total);
    put_little_endian(header + 12, (uint32_t)(length + padding));
    const char* parts[] = {header, json, s->before, edits->bytes, s->after, json + s->end, "   ", bytes + after_chunk};
    const size_t sizes[] = {sizeof header, s->begin, head, edits->size, tail, file->json_size - s->end, padding, file->size - after_chunk};
    return write_file(context, path, parts, sizes, 8);
}

static es_result save_alone(es_context* context, const text* edits, const char* path)
{
    static const char before[] = "{\n  \"asset\": {\"version\": \"2.0\", \"generator\": \"Earthshine\"},\n  \"scene\": 0,\n  \"scenes\": [{\"extras\": {\"earthshine\": {\"edits\": ", after[] = "}}}]\n}\n";
    const char* parts[] = {before, edits->bytes, after};
    const size_t sizes[] = {sizeof before - 1, edits->size, sizeof after - 1};
    return write_file(context, path, parts, sizes, 3);
}

static es_result save_copy(es_context* context, const text* edits, const char* source, const char* path)
{
    es_gltf_file file;
    es_json json;
    splice where;
    es_result result = es_gltf_file_open(context, source, &file);
    if (result != ES_OK) return result;
    result = es_json_parse(context, source, file.json, file.json_size, &json);
    if (result == ES_OK) {
        if (!find_splice(&json, &where)) result = es_fail(context, ES_FILE_UNSUPPORTED, "cannot keep edits in '%s': it has no scene, or extras that are no object", source);
        else result = check_companions(context, &json, source, path);
        if (result == ES_OK) result = write_copy(context, &file, &where, edits, path);
        es_json_free(&json);
    }
    es_gltf_file_close(&file);
    return result;
}

es_result es_world_save_edits(const es_world* world, const char* source, const char* path)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    if (!path) return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_save_edits: the path must not be NULL");
    es_fp_environment environment = es_fp_enter_untrapped();
    es_world_refresh(world);
    text edits = {.context = context};
    write_edits(world, &edits);
    es_result result = edits.failed ? es_context_last_result(context) : source ? save_copy(context, &edits, source, path) : save_alone(context, &edits, path);
    es_json_text_free(&edits);
    es_fp_leave(environment);
    return result;
}
