/* Reading edits from glTF extras. All is read and checked before anything is changed. */
#include "sim/edits/edit_file.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "sim/edits/edit_state.h"
#include "sim/gltf_file.h"

enum { WHERE = 96, PART = 32, NAME = 512 }; /* of places in the file: those of edits, of parts of edits, and theirs are longer by PART each */

typedef struct reader {
    es_world* world;
    const es_json* json;
    es_edit_stage* stage;
    es_result failed;
    uint32_t* instances;      /* handles in slot order */
    size_t instance_count;
} reader;

/* ---- values ------------------------------------------------------------------------------------------------------------ */

ES_PRINTF(3, 4) static bool refuse(reader* r, const char* where, const char* format, ...)
{
    char what[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (r->failed == ES_OK) r->failed = es_fail(r->world->context, ES_FILE_DAMAGED, "%s: %s%s", r->json->label, where, what);
    return false;
}

static bool no_memory(reader* r)
{
    r->failed = es_context_last_result(r->world->context);
    return false;
}

/* An object, whose members are among `known`; others are warned of. */
static bool object(reader* r, uint32_t value, const char* where, const char* const* known)
{
    const es_json* json = r->json;
    if (json->values[value].type != ES_JSON_OBJECT) return refuse(r, where, ": must be an object");
    for (uint32_t i = json->values[value].first; i; i = json->values[i].next) {
        char name[64], shown[ES_GLTF_PRINTABLE];
        es_json_key(json, i, name, sizeof name);
        bool found = false;
        for (const char* const* each = known; *each && !found; each++) found = strcmp(*each, name) == 0;
        if (!found) es_log(r->world->context, ES_LOG_WARNING, ES_ASSET_WARNING, "%s: %s.%s: no such member is known, it is left out", json->label, where, es_gltf_printable(name, strlen(name), shown));
    }
    return true;
}

static bool list(reader* r, uint32_t owner, const char* name, const char* where, uint32_t most, uint32_t* value)
{
    *value = es_json_member(r->json, owner, name);
    if (!*value) return true;
    if (r->json->values[*value].type != ES_JSON_ARRAY) return refuse(r, where, ".%s: must be an array", name);
    if (r->json->values[*value].count > most) return refuse(r, where, ".%s: has %u elements, up to %u are accepted", name, r->json->values[*value].count, most);
    return true;
}

static bool number(reader* r, uint32_t owner, const char* name, const char* where, double low, double high, double* out)
{
    const uint32_t value = es_json_member(r->json, owner, name);
    double x;
    if (!value) return true;
    if (!es_json_number(r->json, value, &x)) return refuse(r, where, ".%s: must be a number", name);
    if (!(x >= low && x <= high)) return refuse(r, where, ".%s: is %g, must lie in %g … %g", name, x, low, high);
    *out = x;
    return true;
}

static bool single(reader* r, uint32_t owner, const char* name, const char* where, double low, double high, float* out)
{
    double x = (double)*out;
    if (!number(r, owner, name, where, low, high, &x)) return false;
    *out = (float)x;
    return true;
}

static bool whole(reader* r, uint32_t owner, const char* name, const char* where, int64_t* out)
{
    double x = (double)*out;
    if (!number(r, owner, name, where, 0, 4294967294.0, &x)) return es_json_member(r->json, owner, name) == 0;
    if (x != (double)(int64_t)x) return refuse(r, where, ".%s: must be a whole number", name);
    *out = (int64_t)x;
    return true;
}

static bool numbers(reader* r, uint32_t owner, const char* name, const char* where, uint32_t count, double* out)
{
    const uint32_t value = es_json_member(r->json, owner, name);
    if (!value) return true;
    bool good = r->json->values[value].type == ES_JSON_ARRAY && r->json->values[value].count == count;
    for (uint32_t i = 0; i < count && good; i++) good = es_json_number(r->json, es_json_element(r->json, value, i), &out[i]) && out[i] >= -(double)ES_WORLD_EXTENT && out[i] <= (double)ES_WORLD_EXTENT;
    return good || refuse(r, where, ".%s: must be an array of %u numbers within 1e9", name, count);
}

static bool flag(reader* r, uint32_t owner, const char* name, const char* where, bool* out)
{
    const uint32_t value = es_json_member(r->json, owner, name);
    return !value || es_json_boolean(r->json, value, out) || refuse(r, where, ".%s: must be true or false", name);
}

/* out: empty where there is none. */
static bool text(reader* r, uint32_t owner, const char* name, const char* where, char* out, size_t size)
{
    const uint32_t value = es_json_member(r->json, owner, name);
    out[0] = 0;
    return !value || es_json_string(r->json, value, out, size) || refuse(r, where, ".%s: must be a text of up to %zu bytes", name, size - 1);
}

static bool word(reader* r, uint32_t owner, const char* name, const char* where, const char* const* words, uint32_t* out)
{
    char given[32];
    const uint32_t value = es_json_member(r->json, owner, name);
    if (!value) return true;
    bool is_text = es_json_string(r->json, value, given, sizeof given);
    for (uint32_t i = 0; words[i]; i++)
        if (is_text && strcmp(words[i], given) == 0) {
            *out = i;
            return true;
        }
    char accepted[96] = "";
    for (uint32_t i = 0; words[i]; i++) snprintf(accepted + strlen(accepted), sizeof accepted - strlen(accepted), "%s%s", i ? ", " : "", words[i]);
    return refuse(r, where, ".%s: must be one of %s", name, accepted);
}

/* ---- what is referred to ------------------------------------------------------------------------------------------------ */

static const char* name_of(const es_world* world, es_object_kind kind, uint32_t id)
{
    const es_object* object = es_slots_get(&world->slots[kind], id);
    return object && object->name ? object->name : "";
}

static const char* node_name(const es_world* world, uint32_t instance)
{
    const es_instance_object* object = es_slots_get(&world->slots[ES_OBJECT_INSTANCE], instance);
    return name_of(world, ES_OBJECT_NODE, object->desc.node.id);
}

static bool on_same_node(const es_world* world, uint32_t a, uint32_t b)
{
    const es_instance_object *x = es_slots_get(&world->slots[ES_OBJECT_INSTANCE], a), *y = es_slots_get(&world->slots[ES_OBJECT_INSTANCE], b);
    return x->desc.node.id == y->desc.node.id;
}

/* By the name of its node and which of that node's instances it is; "index", its number among all, says which of several nodes by one name is meant, or alone which of all. */
static bool instance(reader* r, uint32_t value, const char* where, es_instance* out)
{
    char name[NAME];
    int64_t index = -1, which = 0;
    const es_world* world = r->world;
    if (!text(r, value, "node", where, name, sizeof name) || !whole(r, value, "index", where, &index) || !whole(r, value, "instance", where, &which)) return false;
    uint32_t found = 0;
    for (size_t i = 0; i < r->instance_count; i++) {
        if (name[0] && strcmp(node_name(world, r->instances[i]), name) != 0) continue;
        if ((int64_t)i == index) { /* exactly that */
            found = r->instances[i];
            break;
        }
        if (found || !name[0]) continue;
        int64_t before = 0;
        for (size_t k = 0; k < i; k++) before += on_same_node(world, r->instances[k], r->instances[i]);
        if (before == which) found = r->instances[i];
    }
    out->id = found;
    if (found) return true;
    char shown[ES_GLTF_PRINTABLE];
    if (name[0]) return refuse(r, where, ": there is no node '%s' with an instance number %lld", es_gltf_printable(name, strlen(name), shown), (long long)which);
    return refuse(r, where, ": there is no instance number %lld", (long long)index);
}

/* A node, camera or light likewise. */
static bool named_object(reader* r, uint32_t value, const char* where, const char* member, es_object_kind kind, uint32_t* out)
{
    char name[NAME];
    int64_t index = -1;
    if (!text(r, value, member, where, name, sizeof name) || !whole(r, value, "index", where, &index)) return false;
    const es_slots* slots = &r->world->slots[kind];
    int64_t count = 0;
    *out = 0;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_object* object = es_slots_at(slots, slot);
        if (!object) continue;
        const bool same = !name[0] || strcmp(object->name ? object->name : "", name) == 0, exact = count++ == index;
        if (!same || (!exact && (*out || !name[0]))) continue;
        *out = object->id;
        if (exact) break;
    }
    char shown[ES_GLTF_PRINTABLE];
    return *out || refuse(r, where, ": there is no %s '%s'", member, es_gltf_printable(name, strlen(name), shown));
}

static bool anchor(reader* r, uint32_t owner, const char* name, const char* where_owner, es_anchor* out)
{
    static const char* const known[] = {"node", "instance", "index", "triangle", "u", "v", "point", NULL};
    const uint32_t value = es_json_member(r->json, owner, name);
    char where[WHERE + 2 * PART];
    *out = (es_anchor){0};
    if (!value) return true;
    snprintf(where, sizeof where, "%s.%s", where_owner, name);
    if (!object(r, value, where, known)) return false;
    const bool point = es_json_member(r->json, value, "point") != 0, on = es_json_member(r->json, value, "node") != 0 || es_json_member(r->json, value, "index") != 0;
    if (on && !instance(r, value, where, &out->instance)) return false;
    out->kind = point ? ES_ANCHOR_POINT : ES_ANCHOR_SURFACE;
    if (point) return numbers(r, value, "point", where, 3, out->point);
    int64_t triangle = -1;
    if (!whole(r, value, "triangle", where, &triangle) || !single(r, value, "u", where, 0, 1, &out->u) || !single(r, value, "v", where, 0, 1, &out->v)) return false;
    if (!on || triangle < 0) return refuse(r, where, ": needs a point, or a node and a triangle");
    out->triangle = (uint32_t)triangle;
    es_anchored found;
    if (!es_anchor_find(r->world, out, &found)) return refuse(r, where, ".triangle: is %lld, the instance has %u", (long long)triangle, found.mesh->raster.triangle_count);
    return es_anchor_valid(out) || refuse(r, where, ": u and v must not sum to more than 1");
}

/* ---- edits ------------------------------------------------------------------------------------------------------------------ */

static bool parameters(reader* r, uint32_t edits, const char* where)
{
    const uint32_t value = es_json_member(r->json, edits, "parameters");
    if (!value) return true;
    if (r->json->values[value].type != ES_JSON_OBJECT) return refuse(r, where, ".parameters: must be an object of numbers");
    for (uint32_t i = r->json->values[value].first; i; i = r->json->values[i].next) {
        char name[ES_EDIT_NAME], shown[ES_GLTF_PRINTABLE];
        double x;
        if (!es_json_key(r->json, i, name, sizeof name) || !name[0]) return refuse(r, where, ".parameters: names must have 1 … %d bytes", ES_EDIT_NAME - 1);
        es_gltf_printable(name, strlen(name), shown);
        if (!es_json_number(r->json, i, &x) || !(x >= -(double)ES_WORLD_EXTENT && x <= (double)ES_WORLD_EXTENT)) return refuse(r, where, ".parameters.%s: must be a number within 1e9", shown);
        if (!es_edit_stage_set_parameter(r->world, r->stage, name, (float)x)) return no_memory(r);
    }
    return true;
}

static bool region(reader* r, uint32_t value, const char* where)
{
    static const char* const known[] = {"name", "type", "centre", "radius", "border", "strokes", "off", NULL};
    static const char* const stroke_known[] = {"from", "to", "radius", "erase", NULL};
    static const char* const types[] = {"euclidean", "geodesic", "freeForm", NULL};
    char name[NAME];
    es_region_desc d = es_default_region_desc();
    uint32_t type = d.type, strokes;
    if (!object(r, value, where, known) || !text(r, value, "name", where, name, sizeof name) || !word(r, value, "type", where, types, &type) || !anchor(r, value, "centre", where, &d.centre) ||
        !single(r, value, "radius", where, 0, 1e9, &d.radius) || !single(r, value, "border", where, 0, 1e9, &d.border) || !flag(r, value, "off", where, &d.off) ||
        !list(r, value, "strokes", where, ES_EDIT_STROKES, &strokes))
        return false;
    d.type = (es_region_type)type;
    d.name = name;
    const uint32_t count = strokes ? r->json->values[strokes].count : 0;
    es_region_stroke* drawn = es_allocate_zero(r->world->context, (count + (size_t)1) * sizeof *drawn);
    if (!drawn) return no_memory(r);
    bool good = true;
    for (uint32_t i = strokes ? r->json->values[strokes].first : 0; i && good; i = r->json->values[i].next) {
        char at[WHERE + PART];
        es_region_stroke* s = &drawn[d.stroke_count];
        snprintf(at, sizeof at, "%s.strokes[%u]", where, d.stroke_count++);
        good = object(r, i, at, stroke_known) && anchor(r, i, "from", at, &s->from) && anchor(r, i, "to", at, &s->to) && single(r, i, "radius", at, 0, 1e9, &s->radius) && flag(r, i, "erase", at, &s->erase);
    }
    d.strokes = d.stroke_count ? drawn : NULL;
    uint32_t stroke;
    const char* wrong = good ? es_region_valid(&d, &stroke) : NULL;
    if (wrong) good = stroke == UINT32_MAX ? refuse(r, where, ": %s", wrong) : refuse(r, where, ".strokes[%u]: %s", stroke, wrong);
    if (good && !es_edit_stage_add_region(r->world, r->stage, &d)) good = no_memory(r);
    es_release(r->world->context, drawn, (count + (size_t)1) * sizeof *drawn);
    return good;
}

static bool direction(reader* r, uint32_t owner, const char* where, es_vec3* out)
{
    double d[3] = {(double)out->x, (double)out->y, (double)out->z};
    if (!numbers(r, owner, "direction", where, 3, d)) return false;
    *out = (es_vec3){(float)d[0], (float)d[1], (float)d[2]};
    return true;
}

static bool parameter(reader* r, uint32_t owner, const char* where_owner, char name[ES_EDIT_NAME], es_edit_parameter* out)
{
    static const char* const known[] = {"kind", "camera", "node", "light", "index", "axis", "name", NULL};
    static const char* const words[] = {"time", "camera", "node", "light", "named", NULL};
    static const char* const axes[] = {"x", "y", "z", NULL};
    const uint32_t value = es_json_member(r->json, owner, "parameter");
    char where[WHERE + PART];
    if (!value) return true;
    snprintf(where, sizeof where, "%s.parameter", where_owner);
    uint32_t kind = 0;
    if (!object(r, value, where, known) || !word(r, value, "kind", where, words, &kind) || !word(r, value, "axis", where, axes, &out->axis) || !text(r, value, "name", where, name, ES_EDIT_NAME)) return false;
    out->kind = (es_edit_parameter_kind)kind;
    out->name = name[0] ? name : NULL;
    if (kind == ES_EDIT_NODE) return named_object(r, value, where, "node", ES_OBJECT_NODE, &out->node.id);
    if (kind == ES_EDIT_LIGHT) return named_object(r, value, where, "light", ES_OBJECT_LIGHT, &out->light.id);
    const bool active = !es_json_member(r->json, value, "camera") && !es_json_member(r->json, value, "index");
    return kind != ES_EDIT_CAMERA || active || named_object(r, value, where, "camera", ES_OBJECT_CAMERA, &out->camera.id);
}

static bool constraint(reader* r, uint32_t value, const char* where)
{
    static const char* const known[] = {"name", "reflecting", "reflected", "refraction", "direction", "eye", "orientation", "fovY", "followsView", "geodesic", "parameter", "keys", "off", NULL};
    static const char* const key_known[] = {"at", "reflecting", "reflected", "direction", NULL};
    char name[NAME], parameter_name[ES_EDIT_NAME];
    es_constraint_desc d = es_default_constraint_desc();
    double orientation[4] = {0, 0, 0, 1};
    uint32_t keys;
    if (!object(r, value, where, known) || !text(r, value, "name", where, name, sizeof name) || !anchor(r, value, "reflecting", where, &d.reflecting) || !anchor(r, value, "reflected", where, &d.reflected) ||
        !flag(r, value, "refraction", where, &d.refraction) || !direction(r, value, where, &d.direction) || !numbers(r, value, "eye", where, 3, d.eye) ||
        !numbers(r, value, "orientation", where, 4, orientation) || !single(r, value, "fovY", where, 0, 3.1, &d.fov_y) || !flag(r, value, "followsView", where, &d.follows_view) ||
        !flag(r, value, "geodesic", where, &d.geodesic) || !flag(r, value, "off", where, &d.off) || !parameter(r, value, where, parameter_name, &d.parameter) ||
        !list(r, value, "keys", where, ES_EDIT_KEYS, &keys))
        return false;
    d.name = name;
    d.orientation = (es_quat){(float)orientation[0], (float)orientation[1], (float)orientation[2], (float)orientation[3]};
    const uint32_t count = keys ? r->json->values[keys].count : 0;
    es_constraint_key* all = es_allocate_zero(r->world->context, (count + (size_t)1) * sizeof *all);
    if (!all) return no_memory(r);
    bool good = true;
    for (uint32_t i = keys ? r->json->values[keys].first : 0; i && good; i = r->json->values[i].next) {
        char at[WHERE + PART];
        es_constraint_key* k = &all[d.key_count];
        snprintf(at, sizeof at, "%s.keys[%u]", where, d.key_count++);
        good = object(r, i, at, key_known) && single(r, i, "at", at, -1e9, 1e9, &k->at) && anchor(r, i, "reflecting", at, &k->reflecting) && anchor(r, i, "reflected", at, &k->reflected) &&
               direction(r, i, at, &k->direction);
    }
    d.keys = d.key_count ? all : NULL;
    uint32_t key;
    const char* wrong = good ? es_constraint_valid(&d, &key) : NULL;
    if (wrong) good = key == UINT32_MAX ? refuse(r, where, ": %s", wrong) : refuse(r, where, ".keys[%u]: %s", key, wrong);
    if (good && !es_edit_stage_add_constraint(r->world, r->stage, &d)) good = no_memory(r);
    es_release(r->world->context, all, (count + (size_t)1) * sizeof *all);
    return good;
}

static bool edits_of_file(reader* r, uint32_t edits)
{
    static const char* const known[] = {"version", "parameters", "regions", "constraints", NULL};
    static const char where[] = "extras.earthshine.edits";
    const es_json* json = r->json;
    uint32_t regions, constraints, count = 0;
    int64_t version = 1;
    if (!object(r, edits, where, known) || !whole(r, edits, "version", where, &version)) return false;
    if (version != 1) return refuse(r, where, ".version: is %lld, 1 is read", (long long)version);
    if (!parameters(r, edits, where) || !list(r, edits, "regions", where, ES_EDIT_REGIONS, &regions) || !list(r, edits, "constraints", where, ES_EDIT_CONSTRAINTS, &constraints)) return false;
    char at[WHERE];
    for (uint32_t i = regions ? json->values[regions].first : 0; i; i = json->values[i].next) {
        snprintf(at, sizeof at, "%s.regions[%u]", where, count++);
        if (!region(r, i, at)) return false;
    }
    count = 0;
    for (uint32_t i = constraints ? json->values[constraints].first : 0; i; i = json->values[i].next) {
        snprintf(at, sizeof at, "%s.constraints[%u]", where, count++);
        if (!constraint(r, i, at)) return false;
    }
    return true;
}

static es_result read_edits(es_world* world, const es_json* json, uint32_t edits)
{
    es_context* context = world->context;
    reader r = {.world = world, .json = json};
    r.instance_count = world->slots[ES_OBJECT_INSTANCE].live;
    const size_t bytes = (r.instance_count + 1) * sizeof *r.instances;
    r.instances = es_allocate(context, bytes);
    if (!r.instances) return es_context_last_result(context);
    es_world_enumerate(world, ES_OBJECT_INSTANCE, r.instances, &r.instance_count);
    r.stage = es_edit_stage_begin(world);
    bool good = r.stage ? edits_of_file(&r, edits) : no_memory(&r);
    if (good && !es_edit_stage_reserve(world, r.stage)) good = no_memory(&r);
    if (good) {
        es_edits_take(world, r.stage);
        es_edits_note_all(world);
        es_edits_note_parameters(world);
    } else {
        es_edit_stage_free(world, r.stage);
    }
    es_release(context, r.instances, bytes);
    return good ? ES_OK : r.failed;
}

es_edit_place es_edits_find(const es_json* json)
{
    es_edit_place place = {0};
    const uint32_t shown = es_json_member(json, 0, "scene");
    double number = 0;
    if (shown && (!es_json_number(json, shown, &number) || !(number >= 0 && number < 1e9))) return place;
    place.scene = es_json_element(json, es_json_member(json, 0, "scenes"), (uint32_t)number);
    if (place.scene) place.extras = es_json_member(json, place.scene, "extras");
    if (place.extras) place.earthshine = es_json_member(json, place.extras, "earthshine");
    if (place.earthshine) place.edits = es_json_member(json, place.earthshine, "edits");
    return place;
}

static bool mentions_edits(const char* text, size_t size)
{
    static const char word[] = "\"edits\"";
    for (const char* at = text; (at = memchr(at, '"', size - (size_t)(at - text))) != NULL; at++) {
        if (size - (size_t)(at - text) < sizeof word - 1) return false;
        if (memcmp(at, word, sizeof word - 1) == 0) return true;
    }
    return false;
}

es_result es_edits_import(es_world* world, const char* path, const char* text, size_t size)
{
    if (!mentions_edits(text, size)) return ES_OK; /* most do not, and may be large */
    es_json json;
    es_result result = es_json_parse(world->context, path, text, size, &json);
    if (result != ES_OK) return result;
    const es_edit_place place = es_edits_find(&json);
    if (place.edits) result = read_edits(world, &json, place.edits);
    es_json_free(&json);
    return result;
}

es_result es_world_load_edits(es_world* world, const char* path)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!path) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_load_edits: the path must not be NULL");
    es_context* context = world->context;
    es_fp_environment environment = es_fp_enter_untrapped();
    es_world_refresh(world);
    es_gltf_file file;
    es_json json;
    es_result result = es_gltf_file_open(context, path, &file);
    if (result == ES_OK) {
        result = es_json_parse(context, path, file.json, file.json_size, &json);
        if (result == ES_OK) {
            const es_edit_place place = es_edits_find(&json);
            if (place.edits) result = read_edits(world, &json, place.edits);
            else result = es_fail(context, ES_FILE_TYPE, "%s: has no edits, which the extras of its scene would have in earthshine.edits", path);
            es_json_free(&json);
        }
        es_gltf_file_close(&file);
    }
    es_fp_leave(environment);
    return result;
}
