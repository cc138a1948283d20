/* Reflections edited by mouse and keyboard. The red handle is where in the mirror, the green one what is to be seen there, the blue one a region's middle; all stay on
 * the surfaces that they are dragged over. Of a refraction the green handle is a step along the way on which light is to go on. */
#include "player.h"
#include "player_edits.h"
#include "player_eye.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { GRASP = 12, HANDLE = 4, RING = 48, MOST = 256 }; /* pixels of the font from a handle that take it; half its side; corners of a region's ring; edits shown */
static const float reach = 1e6f;
enum { RED = 0xff4a3c, GREEN = 0x3ccf4e, BLUE = 0x4a90ff };

static const char* const tool_names[] = {"Move", "+Constraint", "+Region", "Brush", "Eraser"};

static void complain(player* p) { player_notice(p, "%s", es_context_message(p->session.context)); }

/* Before the first change: what there was can be gone back to. */
static void begin(player* p)
{
    player_edits* e = &p->edits;
    if (!e->history && es_edit_history_create(p->session.world, 0, &e->history) != ES_OK) complain(p);
}

static void committed(player* p, const char* what)
{
    begin(p);
    if (p->edits.history && es_edit_history_commit(p->edits.history, what) != ES_OK) complain(p);
}

/* ---- places --------------------------------------------------------------------------------------------------------------------- */

static bool anchor_at(const player* p, float x, float y, es_anchor* anchor)
{
    player_eye e;
    double origin[3];
    es_vec3 direction;
    if (!player_look(p, &e)) return false;
    eye_pixel_ray(&e, x, y, origin, &direction);
    return es_world_anchor_of_ray(p->session.world, origin, direction, reach, anchor) == ES_OK && anchor->kind == ES_ANCHOR_SURFACE;
}

/* Unit, in the world, of a refraction's edited direction. */
static es_vec3 turned(es_quat q, es_vec3 v)
{
    es_vec3 t = {2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x)};
    return (es_vec3){v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z, v.z + q.w * t.z + q.x * t.y - q.y * t.x};
}

static bool node_matrix(const player* p, es_instance instance, es_mat4* m)
{
    es_instance_desc desc;
    if (es_world_get_instance(p->session.world, instance, &desc) != ES_OK) return false;
    if (desc.node.id) return es_world_get_node_matrix(p->session.world, desc.node, m) == ES_OK;
    *m = (es_mat4){{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
    return true;
}

static es_vec3 to_node(const es_mat4* m, es_vec3 d)
{
    /* the inverse of its 3 × 3 part, by cofactors */
    const float *a = m->m, *b = m->m + 4, *c = m->m + 8;
    float x[3] = {b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]}, det = a[0] * x[0] + a[1] * x[1] + a[2] * x[2];
    if (!(fabsf(det) > 0)) return d;
    float y[3] = {c[1] * a[2] - c[2] * a[1], c[2] * a[0] - c[0] * a[2], c[0] * a[1] - c[1] * a[0]}, z[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    return (es_vec3){(x[0] * d.x + x[1] * d.y + x[2] * d.z) / det, (y[0] * d.x + y[1] * d.y + y[2] * d.z) / det, (z[0] * d.x + z[1] * d.y + z[2] * d.z) / det};
}

/* Where the green handle of a refraction is shown: a fifth of the way from the eye beyond the red one. */
static bool green_place(const player* p, es_constraint constraint, const es_constraint_state* state, double place[3])
{
    es_constraint_desc desc;
    es_mat4 m;
    memcpy(place, state->target, sizeof state->target);
    if (es_world_get_constraint(p->session.world, constraint, &desc) != ES_OK) return false;
    if (!desc.refraction) return true;
    if (!node_matrix(p, state->reflecting.instance, &m)) return false;
    double away = 0;
    float d[3], length = 0;
    for (int k = 0; k < 3; k++) {
        away += (state->position[k] - desc.eye[k]) * (state->position[k] - desc.eye[k]);
        d[k] = m.m[k] * desc.direction.x + m.m[4 + k] * desc.direction.y + m.m[8 + k] * desc.direction.z;
        length += d[k] * d[k];
    }
    for (int k = 0; k < 3; k++) place[k] = state->position[k] + 0.2 * sqrt(away) * (double)(d[k] / fmaxf(sqrtf(length), 1e-20f));
    return true;
}

static bool handle_place(const player* p, edits_handle handle, es_constraint constraint, es_region region, double place[3])
{
    if (handle == HANDLE_BLUE) {
        es_region_state state;
        if (es_world_get_region_state(p->session.world, region, &state) != ES_OK || state.effect == ES_EDIT_UNPLACED || state.effect == ES_EDIT_STALE) return false;
        memcpy(place, state.centre, sizeof state.centre);
        return true;
    }
    es_constraint_state state;
    if (es_world_get_constraint_state(p->session.world, constraint, &state) != ES_OK || state.effect == ES_EDIT_UNPLACED || state.effect == ES_EDIT_STALE) return false;
    memcpy(place, state.position, sizeof state.position);
    return handle == HANDLE_RED || green_place(p, constraint, &state, place);
}

static size_t list(const player* p, es_object_kind kind, uint32_t ids[MOST])
{
    size_t count = MOST;
    if (es_world_enumerate(p->session.world, kind, ids, &count) != ES_OK) return 0;
    return count < MOST ? count : MOST;
}

/* ---- making ---------------------------------------------------------------------------------------------------------------------- */

/* The generating view: the camera that looks now. */
static bool view_of(const player* p, es_constraint_desc* desc)
{
    player_eye e;
    es_camera_desc camera;
    if (!player_look(p, &e) || es_world_get_camera(p->session.world, es_world_active_camera(p->session.world), &camera) != ES_OK) return false;
    world_of_eye(&e, (es_vec3){0, 0, 0}, desc->eye);
    /* the camera's axes are the rows of the view */
    const float* m = e.view.view.m;
    const float r[3][3] = {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}};
    const float trace = r[0][0] + r[1][1] + r[2][2];
    float w = sqrtf(fmaxf(1 + trace, 0)) / 2, x = sqrtf(fmaxf(1 + r[0][0] - r[1][1] - r[2][2], 0)) / 2, y = sqrtf(fmaxf(1 - r[0][0] + r[1][1] - r[2][2], 0)) / 2, z = sqrtf(fmaxf(1 - r[0][0] - r[1][1] + r[2][2], 0)) / 2;
    /* r[k][i]: component i of the camera's axis k, i.e. the rotation's element in row i, column k */
    desc->orientation = (es_quat){copysignf(x, r[1][2] - r[2][1]), copysignf(y, r[2][0] - r[0][2]), copysignf(z, r[0][1] - r[1][0]), w};
    desc->fov_y = camera.orthographic ? 0 : camera.fov_y;
    return true;
}

static bool is_transmissive(const player* p, es_instance instance)
{
    es_instance_desc desc;
    es_material_desc material;
    return es_world_get_instance(p->session.world, instance, &desc) == ES_OK && es_world_get_material(p->session.world, desc.material, &material) == ES_OK && material.transmission > 0.5f;
}

/* A reflection begins with what is seen there now, a refraction with the way straight on. */
static void add_constraint_at(player* p, float x, float y)
{
    player_edits* e = &p->edits;
    es_constraint_desc desc = es_default_constraint_desc();
    double position[3];
    es_vec3 normal, i, r;
    if (!anchor_at(p, x, y, &desc.reflecting) || !view_of(p, &desc) || !es_world_resolve_anchor(p->session.world, &desc.reflecting, position, &normal)) {
        player_notice(p, "no surface there");
        return;
    }
    float length = 0;
    float* to[3] = {&i.x, &i.y, &i.z};
    for (int k = 0; k < 3; k++) {
        *to[k] = (float)(position[k] - desc.eye[k]);
        length += *to[k] * *to[k];
    }
    length = fmaxf(sqrtf(length), 1e-20f);
    i = (es_vec3){i.x / length, i.y / length, i.z / length};
    const float twice = 2 * (i.x * normal.x + i.y * normal.y + i.z * normal.z);
    r = (es_vec3){i.x - twice * normal.x, i.y - twice * normal.y, i.z - twice * normal.z};
    desc.refraction = is_transmissive(p, desc.reflecting.instance);
    if (desc.refraction) {
        es_mat4 m;
        desc.direction = node_matrix(p, desc.reflecting.instance, &m) ? to_node(&m, i) : i;
    } else {
        double origin[3];
        const float off = 1e-4f * length;
        for (int k = 0; k < 3; k++) origin[k] = position[k] + (double)((&r.x)[k] * off);
        if (es_world_anchor_of_ray(p->session.world, origin, r, reach, &desc.reflected) != ES_OK || desc.reflected.kind != ES_ANCHOR_SURFACE) {
            desc.reflected = (es_anchor){.kind = ES_ANCHOR_POINT};
            for (int k = 0; k < 3; k++) desc.reflected.point[k] = position[k] + (double)((&r.x)[k] * 10 * length);
        }
    }
    begin(p);
    if (es_world_add_constraint(p->session.world, &desc, &e->constraint) != ES_OK) return complain(p);
    es_constraint_state state;
    const bool inside = es_world_get_constraint_state(p->session.world, e->constraint, &state) == ES_OK && state.influence > 0;
    player_notice(p, inside ? "a constraint: drag its red or green handle" : "a constraint in no region, without effect yet: Ctrl G makes a region");
    committed(p, "constraint added");
}

static void add_region_at(player* p, float x, float y)
{
    player_edits* e = &p->edits;
    player_eye look;
    es_region_desc desc = es_default_region_desc();
    double position[3];
    if (!anchor_at(p, x, y, &desc.centre) || !player_look(p, &look) || !es_world_resolve_anchor(p->session.world, &desc.centre, position, NULL)) {
        player_notice(p, "no surface there");
        return;
    }
    desc.radius = -eye_of_world(&look, position).z / 5;
    desc.border = desc.radius / 3;
    begin(p);
    if (es_world_add_region(p->session.world, &desc, &e->region) != ES_OK) return complain(p);
    player_notice(p, "a region: drag its blue handle, the wheel over it makes it wider or narrower");
    committed(p, "region added");
}

/* A quarter of the brush: a stroke is as short as that, and no shorter. */
static bool far_enough(const player* p, const es_anchor* from, const es_anchor* to)
{
    double a[3], b[3], square = 0;
    if (!es_world_resolve_anchor(p->session.world, from, a, NULL) || !es_world_resolve_anchor(p->session.world, to, b, NULL)) return false;
    for (int k = 0; k < 3; k++) square += (a[k] - b[k]) * (a[k] - b[k]);
    return sqrt(square) > 0.25 * (double)p->edits.brush;
}

/* From where the brush was to where it is. */
static void paint(player* p, float x, float y, bool erase)
{
    player_edits* e = &p->edits;
    es_anchor to;
    if (!anchor_at(p, x, y, &to)) return;
    es_region_desc desc;
    player_eye look;
    double position[3];
    const bool goes_on = e->region.id && es_world_get_region(p->session.world, e->region, &desc) == ES_OK && desc.type == ES_REGION_FREE_FORM && (!desc.stroke_count || desc.strokes[0].from.instance.id == to.instance.id);
    if (!goes_on) {
        desc = es_default_region_desc();
        desc.type = ES_REGION_FREE_FORM;
        if (!player_look(p, &look) || !es_world_resolve_anchor(p->session.world, &to, position, NULL)) return;
        e->brush = -eye_of_world(&look, position).z / 20;
        desc.border = e->brush / 2;
    }
    if (e->painting && !far_enough(p, &e->last, &to)) return;
    es_region_stroke* strokes = malloc((desc.stroke_count + 1) * sizeof *strokes);
    if (!strokes) return;
    if (desc.stroke_count) memcpy(strokes, desc.strokes, desc.stroke_count * sizeof *strokes);
    strokes[desc.stroke_count++] = (es_region_stroke){e->painting ? e->last : to, to, e->brush, erase};
    desc.strokes = strokes;
    if (!e->painting) begin(p);
    if ((goes_on ? es_world_set_region(p->session.world, e->region, &desc) : es_world_add_region(p->session.world, &desc, &e->region)) != ES_OK) complain(p);
    free(strokes);
    e->painting = true;
    e->last = to;
}

void player_add_constraint(player* p) { p->edits.shown = true, add_constraint_at(p, (float)p->canvas.width / 2, (float)p->canvas.height / 2); }
void player_add_region(player* p) { p->edits.shown = true, add_region_at(p, (float)p->canvas.width / 2, (float)p->canvas.height / 2); }

/* ---- moving ---------------------------------------------------------------------------------------------------------------------- */

/* A free form goes along as it is: each end of a stroke to the place of the surface that is nearest to where it would be. */
static bool move_strokes(player* p, es_region region, es_region_desc* desc, const es_anchor* to, es_region_stroke* strokes)
{
    es_world* world = p->session.world;
    es_region_state state;
    double target[3];
    if (es_world_get_region_state(world, region, &state) != ES_OK || !es_world_resolve_anchor(world, to, target, NULL)) return false;
    for (uint32_t i = 0; i < desc->stroke_count; i++) {
        strokes[i] = desc->strokes[i];
        es_anchor* const ends[2] = {&strokes[i].from, &strokes[i].to};
        for (int k = 0; k < 2; k++) {
            double place[3];
            if (!es_world_resolve_anchor(world, ends[k], place, NULL)) return false;
            for (int c = 0; c < 3; c++) place[c] += target[c] - state.centre[c];
            if (es_world_anchor_of_point(world, to->instance, place, ends[k]) != ES_OK) return false;
        }
    }
    desc->strokes = strokes;
    return true;
}

static void move_region(player* p, const es_anchor* to)
{
    es_region_desc desc;
    if (es_world_get_region(p->session.world, p->edits.region, &desc) != ES_OK) return;
    es_region_stroke* strokes = malloc((desc.stroke_count + 1) * sizeof *strokes);
    bool moves = strokes != NULL;
    if (desc.type == ES_REGION_FREE_FORM) moves = moves && move_strokes(p, p->edits.region, &desc, to, strokes);
    else desc.centre = *to;
    if (moves && es_world_set_region(p->session.world, p->edits.region, &desc) != ES_OK) complain(p);
    free(strokes);
}

/* What has keys gets one more where its parameter is now, or another in the place of that which is there. */
static bool add_key(const player* p, es_constraint constraint, es_constraint_desc* desc, es_constraint_key* keys)
{
    es_constraint_state state;
    if (es_world_get_constraint_state(p->session.world, constraint, &state) != ES_OK) return false;
    const es_constraint_key key = {desc->key_count ? state.parameter : (float)es_world_time(p->session.world), desc->reflecting, desc->reflected, desc->direction};
    uint32_t before = 0;
    while (before < desc->key_count && desc->keys[before].at < key.at) before++;
    const uint32_t replaced = before < desc->key_count && desc->keys[before].at == key.at;
    if (before) memcpy(keys, desc->keys, before * sizeof *keys);
    keys[before] = key;
    if (before + replaced < desc->key_count) memcpy(keys + before + 1, desc->keys + before + replaced, (desc->key_count - before - replaced) * sizeof *keys);
    desc->keys = keys;
    desc->key_count += 1 - replaced;
    return true;
}

static void set_constraint(player* p, es_constraint constraint, es_constraint_desc* desc, bool key)
{
    es_constraint_key* keys = malloc((desc->key_count + 1) * sizeof *keys);
    const bool works = keys && (!(key || desc->key_count) || add_key(p, constraint, desc, keys));
    if (works && es_world_set_constraint(p->session.world, constraint, desc) != ES_OK) complain(p);
    free(keys);
}

/* Where its handles are now, between keys too. */
static void take_present(const player* p, es_constraint constraint, es_constraint_desc* desc)
{
    es_constraint_state state;
    if (!desc->key_count || es_world_get_constraint_state(p->session.world, constraint, &state) != ES_OK) return;
    desc->reflecting = state.reflecting;
    if (!desc->refraction) {
        desc->reflected = (es_anchor){.kind = ES_ANCHOR_POINT};
        memcpy(desc->reflected.point, state.target, sizeof state.target);
    } else {
        uint32_t last = 0;
        while (last + 1 < desc->key_count && desc->keys[last + 1].at <= state.parameter) last++;
        desc->direction = desc->keys[last].direction;
    }
}

static void move_held(player* p, float x, float y)
{
    player_edits* e = &p->edits;
    es_world* world = p->session.world;
    es_anchor anchor;
    const bool on_surface = anchor_at(p, x, y, &anchor);
    if (e->held == HANDLE_BLUE) {
        if (on_surface) move_region(p, &anchor);
        return;
    }
    es_constraint_desc desc;
    if (es_world_get_constraint(world, e->constraint, &desc) != ES_OK) return;
    take_present(p, e->constraint, &desc);
    if (e->held == HANDLE_RED) {
        if (!on_surface) return;
        desc.reflecting = anchor;
    } else if (desc.refraction) {
        player_eye look;
        es_constraint_state state;
        es_mat4 m;
        double place[3];
        if (!player_look(p, &look) || es_world_get_constraint_state(world, e->constraint, &state) != ES_OK || !node_matrix(p, state.reflecting.instance, &m)) return;
        world_of_eye(&look, eye_of_pixel(&look, x, y, e->distance), place);
        const es_vec3 d = {(float)(place[0] - state.position[0]), (float)(place[1] - state.position[1]), (float)(place[2] - state.position[2])};
        if (d.x == 0 && d.y == 0 && d.z == 0) return;
        desc.direction = to_node(&m, d);
    } else if (on_surface) {
        desc.reflected = anchor;
    } else {
        player_eye look;
        if (!player_look(p, &look)) return;
        desc.reflected = (es_anchor){.kind = ES_ANCHOR_POINT};
        world_of_eye(&look, eye_of_pixel(&look, x, y, e->distance), desc.reflected.point);
    }
    set_constraint(p, e->constraint, &desc, false);
}

static bool hold(player* p, edits_handle handle, es_constraint constraint, es_region region, bool by_keyboard)
{
    player_edits* e = &p->edits;
    player_eye look;
    double place[3];
    if (!player_look(p, &look) || !handle_place(p, handle, constraint, region, place) || !eye_to_pixel(&look, eye_of_world(&look, place), &e->x, &e->y)) return false;
    if (constraint.id) e->constraint = constraint;
    if (region.id) e->region = region;
    e->held = handle;
    e->by_keyboard = by_keyboard;
    e->distance = -eye_of_world(&look, place).z;
    begin(p);
    return true;
}

typedef struct handle_entry { edits_handle handle; es_constraint constraint; es_region region; } handle_entry;

static size_t handles(const player* p, handle_entry entries[3 * MOST])
{
    uint32_t ids[MOST];
    size_t n = 0, count = list(p, ES_OBJECT_CONSTRAINT, ids);
    for (size_t i = 0; i < count; i++)
        for (int h = HANDLE_RED; h <= HANDLE_GREEN; h++) entries[n++] = (handle_entry){(edits_handle)h, {ids[i]}, {0}};
    count = list(p, ES_OBJECT_REGION, ids);
    for (size_t i = 0; i < count; i++) entries[n++] = (handle_entry){HANDLE_BLUE, {0}, {ids[i]}};
    return n;
}

/* The nearest to the pixel within the grasp. */
static bool nearest_handle(player* p, float x, float y, handle_entry* found)
{
    handle_entry entries[3 * MOST];
    const size_t count = handles(p, entries);
    player_eye look;
    float best = (float)(GRASP * p->ui.scale);
    bool any = false;
    if (!player_look(p, &look)) return false;
    for (size_t i = 0; i < count; i++) {
        double place[3];
        float px, py;
        if (!handle_place(p, entries[i].handle, entries[i].constraint, entries[i].region, place) || !eye_to_pixel(&look, eye_of_world(&look, place), &px, &py)) continue;
        const float away = hypotf(px - x, py - y);
        if (away < best) best = away, *found = entries[i], any = true;
    }
    return any;
}

void player_hold_next_handle(player* p)
{
    player_edits* e = &p->edits;
    handle_entry entries[3 * MOST];
    const size_t count = handles(p, entries);
    static const char* const names[] = {"", "red handle: where in the mirror", "green handle: what is seen there", "region"};
    size_t at = 0;
    e->shown = true;
    for (size_t i = 0; i < count && e->held; i++)
        if (entries[i].handle == e->held && (e->held == HANDLE_BLUE ? entries[i].region.id == e->region.id : entries[i].constraint.id == e->constraint.id)) at = i + 1;
    for (; at < count; at++)
        if (hold(p, entries[at].handle, entries[at].constraint, entries[at].region, true)) {
            player_notice(p, "%s; arrow keys move it, Ctrl H the next, Esc lets go", names[e->held]);
            return;
        }
    e->held = HANDLE_NONE;
    player_notice(p, count ? "no further handle" : "nothing is edited: Ctrl N makes a constraint, Ctrl G a region");
}

static void widen(player* p, float factor)
{
    es_region_desc desc;
    if (es_world_get_region(p->session.world, p->edits.region, &desc) != ES_OK) return;
    desc.radius *= factor;
    desc.border *= factor;
    begin(p);
    if (es_world_set_region(p->session.world, p->edits.region, &desc) == ES_OK) committed(p, "region changed");
}

static void by_keys(player* p, const es_window_input* input)
{
    player_edits* e = &p->edits;
    const float step = 120 * p->seconds * (input->down[ES_KEY_SHIFT] ? 4.0f : 1.0f);
    const float right = (float)input->down[ES_KEY_RIGHT] - (float)input->down[ES_KEY_LEFT], down = (float)input->down[ES_KEY_DOWN] - (float)input->down[ES_KEY_UP];
    if (e->held == HANDLE_BLUE && input->repeated[ES_KEY_PAGE_UP]) widen(p, 1.1f);
    if (e->held == HANDLE_BLUE && input->repeated[ES_KEY_PAGE_DOWN]) widen(p, 1 / 1.1f);
    if (right == 0 && down == 0) {
        if (e->moved) committed(p, "moved"); /* one step of the history for one way */
        e->moved = false;
        return;
    }
    e->x += right * step;
    e->y += down * step;
    e->moved = true;
    move_held(p, e->x, e->y);
}

bool player_edits_update(player* p, const es_window_input* input)
{
    player_edits* e = &p->edits;
    if (!e->shown) return false;
    const float x = input->mouse_pressed[0] ? input->press_x[0] : input->mouse_x, y = input->mouse_pressed[0] ? input->press_y[0] : input->mouse_y;
    handle_entry found;
    if (input->mouse_pressed[0]) {
        if (e->tool == TOOL_CONSTRAINT || e->tool == TOOL_REGION) {
            if (e->tool == TOOL_CONSTRAINT) add_constraint_at(p, x, y);
            else add_region_at(p, x, y);
            e->tool = TOOL_MOVE;
            return true;
        }
        if (e->tool == TOOL_MOVE && nearest_handle(p, x, y, &found)) hold(p, found.handle, found.constraint, found.region, false);
    }
    if (e->tool == TOOL_BRUSH || e->tool == TOOL_ERASER) {
        if (input->mouse_down[0] || input->mouse_pressed[0]) {
            paint(p, x, y, e->tool == TOOL_ERASER);
            return true;
        }
        if (e->painting) committed(p, "painted");
        e->painting = false;
        return false;
    }
    if (input->scroll != 0 && nearest_handle(p, input->mouse_x, input->mouse_y, &found) && found.handle == HANDLE_BLUE) {
        e->region = found.region;
        widen(p, powf(1.1f, input->scroll));
    }
    if (!e->held) return false;
    if (e->by_keyboard) {
        by_keys(p, input);
        return false;
    }
    if (input->mouse_dx != 0 || input->mouse_dy != 0) move_held(p, input->mouse_x, input->mouse_y);
    if (!input->mouse_down[0]) {
        e->held = HANDLE_NONE;
        committed(p, "moved");
    }
    return true;
}

/* ---- the rest --------------------------------------------------------------------------------------------------------------------- */

void player_delete_edit(player* p)
{
    player_edits* e = &p->edits;
    begin(p);
    const bool region = e->held == HANDLE_BLUE || !e->constraint.id;
    const es_result result = region ? es_world_destroy_region(p->session.world, e->region) : es_world_destroy_constraint(p->session.world, e->constraint);
    if (result != ES_OK) {
        player_notice(p, "no constraint or region is chosen");
        return;
    }
    if (region) e->region.id = 0;
    else e->constraint.id = 0;
    e->held = HANDLE_NONE;
    committed(p, "deleted");
}

void player_freeze(player* p)
{
    double eye[3];
    es_constraint_desc desc;
    const bool frozen = es_world_frozen_reflections(p->session.world, NULL);
    if (!frozen && !view_of(p, &desc)) return;
    if (!frozen) memcpy(eye, desc.eye, sizeof eye);
    if (es_world_freeze_reflections(p->session.world, frozen ? NULL : eye) != ES_OK) return complain(p);
    player_notice(p, frozen ? "reflections follow the camera again" : "reflections stay as they are seen from here");
}

void player_return_to_view(player* p)
{
    es_constraint_desc desc;
    if (es_world_get_constraint(p->session.world, p->edits.constraint, &desc) != ES_OK) {
        player_notice(p, "no constraint is chosen");
        return;
    }
    const es_quat q = desc.orientation.w == 0 && desc.orientation.x == 0 && desc.orientation.y == 0 && desc.orientation.z == 0 ? (es_quat){0, 0, 0, 1} : desc.orientation;
    if (fly_camera_go(&p->nodes.fly, p->session.world, desc.eye, turned(q, (es_vec3){0, 0, -1}), desc.fov_y) != DEMO_OK) complain(p);
}

static void step_history(player* p, bool back)
{
    es_edit_history* h = p->edits.history;
    if (h && back) committed(p, "moved"); /* what is still held */
    const char* label = !h ? NULL : back ? es_edit_history_undo_label(h) : es_edit_history_redo_label(h);
    p->edits.held = HANDLE_NONE;
    if (!label) {
        player_notice(p, back ? "nothing to undo" : "nothing to redo");
        return;
    }
    player_notice(p, "%s: %s", back ? "undone" : "done again", label);
    if ((back ? es_edit_history_undo(h) : es_edit_history_redo(h)) != ES_OK) complain(p);
}
/* What is edited is no part of the time that is wound. */
void player_keep_edits(player* p, bool after)
{
    static const char wound[] = "wound";
    if (!p->edits.history) return;
    committed(p, after ? wound : "moved");
    const char* label = es_edit_history_undo_label(p->edits.history);
    if (after && label && !strcmp(label, wound) && es_edit_history_undo(p->edits.history) != ES_OK) complain(p);
}

void player_undo_edit(player* p) { step_history(p, true); }
void player_redo_edit(player* p) { step_history(p, false); }

/* The file that was given, or one beside the screenshots, by the scene's name. */
static void edits_path(const player* p, char path[DEMO_PATH_SIZE])
{
    char stem[64];
    play_stem(p->scene, stem);
    if (p->options.edits) snprintf(path, DEMO_PATH_SIZE, "%s", p->options.edits);
    else snprintf(path, DEMO_PATH_SIZE, "%s-edits.gltf", stem);
}

void player_save_edits(player* p)
{
    char path[DEMO_PATH_SIZE];
    edits_path(p, path);
    if (es_world_save_edits(p->session.world, NULL, path) != ES_OK) return complain(p);
    player_notice(p, "saved: earthshine render SCENE --edits %s", path);
}

static bool is_file(const player* p)
{
    for (size_t i = 0; i < es_scene_count(); i++)
        if (!strcmp(p->scene, es_scene_name(i))) return false;
    return true;
}

/* A copy of the scene's file with the edits in it, beside it: what it refers to is still found. */
void player_save_edited_scene(player* p)
{
    char path[DEMO_PATH_SIZE];
    const char *slash = strrchr(p->scene, '/'), *dot = strrchr(p->scene, '.');
    if (!is_file(p)) {
        player_notice(p, "%s is built in: its edits are saved alone (Ctrl W)", p->scene);
        return;
    }
    if (!dot || (slash && dot < slash)) dot = p->scene + strlen(p->scene);
    snprintf(path, sizeof path, "%.*s-edited%s", (int)(dot - p->scene), p->scene, dot);
    if (es_world_save_edits(p->session.world, p->scene, path) != ES_OK) return complain(p);
    player_notice(p, "saved: %s", path);
}

void player_load_edits(player* p)
{
    char path[DEMO_PATH_SIZE];
    edits_path(p, path);
    begin(p);
    if (es_world_load_edits(p->session.world, path) != ES_OK) return complain(p);
    p->edits.held = HANDLE_NONE;
    committed(p, "loaded");
    player_notice(p, "loaded %s", path);
}

void player_edits_close(player* p)
{
    es_edit_history_destroy(p->edits.history);
    const bool shown = p->edits.shown;
    p->edits = (player_edits){.shown = shown};
}

/* ---- drawing ---------------------------------------------------------------------------------------------------------------------- */

static bool pixel_of(const player_eye* look, const double place[3], int* x, int* y)
{
    float fx, fy;
    if (!eye_to_pixel(look, eye_of_world(look, place), &fx, &fy) || fabsf(fx) + fabsf(fy) > 1e5f) return false;
    *x = (int)fx;
    *y = (int)fy;
    return true;
}

static void draw_handle(player* p, int x, int y, uint32_t colour, bool chosen)
{
    const int s = p->ui.scale, half = HANDLE * s;
    const canvas_rect mark = {x - half, y - half, 2 * half + 1, 2 * half + 1};
    canvas_fill(&p->canvas, mark, colour);
    canvas_frame(&p->canvas, mark, s, chosen ? UI_FOCUS : UI_GROUND);
}

/* A circle of the region's radius across its normal, and the free form's strokes. */
static void draw_region(player* p, const player_eye* look, es_region region)
{
    es_region_desc desc;
    es_region_state state;
    int x, y, x1, y1;
    if (es_world_get_region(p->session.world, region, &desc) != ES_OK || es_world_get_region_state(p->session.world, region, &state) != ES_OK) return;
    const bool chosen = region.id == p->edits.region.id;
    const uint32_t colour = state.effect == ES_EDIT_ACTIVE ? BLUE : UI_DIM;
    for (uint32_t i = 0; i < desc.stroke_count && desc.type == ES_REGION_FREE_FORM; i++) {
        double from[3], to[3];
        if (es_world_resolve_anchor(p->session.world, &desc.strokes[i].from, from, NULL) && es_world_resolve_anchor(p->session.world, &desc.strokes[i].to, to, NULL) && pixel_of(look, from, &x, &y) && pixel_of(look, to, &x1, &y1))
            canvas_line(&p->canvas, x, y, x1, y1, 2 * p->ui.scale, desc.strokes[i].erase ? UI_DIM : colour);
    }
    if (desc.type != ES_REGION_FREE_FORM) {
        es_vec3 n = state.normal, t = fabsf(n.y) < 0.9f ? (es_vec3){n.z, 0, -n.x} : (es_vec3){0, -n.z, n.y};
        if (n.x == 0 && n.y == 0 && n.z == 0) n = (es_vec3){0, 0, 1}, t = (es_vec3){1, 0, 0};
        const float length = sqrtf(t.x * t.x + t.y * t.y + t.z * t.z);
        t = (es_vec3){t.x / length, t.y / length, t.z / length};
        const es_vec3 b = {n.y * t.z - n.z * t.y, n.z * t.x - n.x * t.z, n.x * t.y - n.y * t.x};
        bool last = false;
        for (int i = 0; i <= RING; i++) {
            const double a = 6.283185307 * i / RING, c = cos(a) * (double)desc.radius, s = sin(a) * (double)desc.radius;
            const double place[3] = {state.centre[0] + (double)t.x * c + (double)b.x * s, state.centre[1] + (double)t.y * c + (double)b.y * s, state.centre[2] + (double)t.z * c + (double)b.z * s};
            const bool now = pixel_of(look, place, &x1, &y1);
            if (now && last) canvas_line(&p->canvas, x, y, x1, y1, p->ui.scale, colour);
            x = x1, y = y1, last = now;
        }
    }
    if (pixel_of(look, state.centre, &x, &y)) draw_handle(p, x, y, colour, chosen);
}

static void draw_constraint(player* p, const player_eye* look, es_constraint constraint)
{
    es_constraint_state state;
    double green[3];
    int x0, y0, x1, y1;
    if (es_world_get_constraint_state(p->session.world, constraint, &state) != ES_OK || state.effect == ES_EDIT_STALE || state.effect == ES_EDIT_UNPLACED) return;
    const bool chosen = constraint.id == p->edits.constraint.id, works = state.effect == ES_EDIT_ACTIVE && state.influence > 0;
    const bool red_seen = pixel_of(look, state.position, &x0, &y0), green_seen = green_place(p, constraint, &state, green) && pixel_of(look, green, &x1, &y1);
    if (red_seen && green_seen) canvas_line(&p->canvas, x0, y0, x1, y1, p->ui.scale, chosen ? UI_FOCUS : UI_DIM);
    if (green_seen) draw_handle(p, x1, y1, works ? GREEN : UI_DIM, chosen);
    if (red_seen) draw_handle(p, x0, y0, works ? RED : UI_DIM, chosen);
}

void player_edits_draw(player* p)
{
    player_eye look;
    uint32_t ids[MOST];
    if (p->hide_all || !p->edits.shown || !player_look(p, &look)) return;
    size_t count = list(p, ES_OBJECT_REGION, ids);
    for (size_t i = 0; i < count; i++) draw_region(p, &look, (es_region){ids[i]});
    count = list(p, ES_OBJECT_CONSTRAINT, ids);
    for (size_t i = 0; i < count; i++) draw_constraint(p, &look, (es_constraint){ids[i]});
}

/* ---- the panel ---------------------------------------------------------------------------------------------------------------------- */

static void region_rows(player* p)
{
    static const char* const types[] = {"Euclidean", "Geodesic", "Free form"};
    ui* u = &p->ui;
    es_region_desc desc;
    if (es_world_get_region(p->session.world, p->edits.region, &desc) != ES_OK) return;
    char text[64];
    bool changed = false;
    ui_label(u, 8, UI_DIM, "Region");
    if (ui_button(u, "type", 11, types[desc.type]) && desc.type != ES_REGION_FREE_FORM) desc.type = desc.type == ES_REGION_EUCLIDEAN ? ES_REGION_GEODESIC : ES_REGION_EUCLIDEAN, changed = true;
    if (ui_switch(u, "region on", 4, "On", !desc.off)) desc.off = !desc.off, changed = true;
    ui_next_row(u);
    float* const sizes[] = {desc.type == ES_REGION_FREE_FORM ? &p->edits.brush : &desc.radius, &desc.border};
    static const char* const names[] = {"radius", "border"};
    for (int i = 0; i < 2; i++) {
        /* a millimetre to a kilometre */
        float fraction = (log10f(fmaxf(*sizes[i], 1e-3f)) + 3) / 6;
        int steps = 0;
        snprintf(text, sizeof text, "%s %.3g m", i == 0 && desc.type == ES_REGION_FREE_FORM ? "brush" : names[i], (double)*sizes[i]);
        const ui_slider_act act = ui_slider(u, names[i], 0, &fraction, &steps, text, UI_TEXT);
        if (act == UI_SLIDER_MOVED) *sizes[i] = powf(10, fraction * 6 - 3), changed = true;
        if (act == UI_SLIDER_STEPPED) *sizes[i] *= powf(1.05f, (float)steps), changed = true;
        ui_next_row(u);
    }
    if (!changed) return;
    begin(p);
    if (es_world_set_region(p->session.world, p->edits.region, &desc) != ES_OK) complain(p);
    else committed(p, "region changed");
}

static void constraint_rows(player* p)
{
    ui* u = &p->ui;
    es_constraint_desc desc;
    es_constraint_state state;
    if (es_world_get_constraint(p->session.world, p->edits.constraint, &desc) != ES_OK || es_world_get_constraint_state(p->session.world, p->edits.constraint, &state) != ES_OK) return;
    bool changed = false;
    ui_label(u, 12, UI_DIM, "Constraint");
    if (ui_switch(u, "constraint on", 4, "On", !desc.off)) desc.off = !desc.off, changed = true;
    if (ui_switch(u, "follows", 13, "Follows view", desc.follows_view)) desc.follows_view = !desc.follows_view, changed = true;
    ui_next_row(u);
    if (ui_switch(u, "surface", 14, "Over surface", desc.geodesic)) desc.geodesic = !desc.geodesic, changed = true;
    if (ui_button(u, "view", 16, "Return to view")) player_return_to_view(p);
    if (ui_button(u, "key", 5, "Key")) { /* from then on dragging a handle sets one */
        take_present(p, p->edits.constraint, &desc);
        begin(p);
        set_constraint(p, p->edits.constraint, &desc, true);
        committed(p, "key");
        player_notice(p, "a key; dragging a handle at other times sets further ones");
        return;
    }
    if (desc.key_count && ui_button(u, "no keys", 9, "No keys")) {
        take_present(p, p->edits.constraint, &desc);
        desc.keys = NULL;
        desc.key_count = 0;
        changed = true;
    }
    ui_next_row(u);
    if (state.effect != ES_EDIT_ACTIVE) ui_label(u, 0, UI_CHANGED, es_edit_effect_text(state.effect));
    else if (!(state.influence > 0)) ui_label(u, 0, UI_CHANGED, "in no region: without effect");
    else ui_label(u, 0, UI_DIM, desc.refraction ? "refraction: the green handle turns it" : "red: where, green: what is seen");
    ui_next_row(u);
    if (!changed) return;
    begin(p);
    if (es_world_set_constraint(p->session.world, p->edits.constraint, &desc) != ES_OK) complain(p);
    else committed(p, "constraint changed");
}

void player_edits_panel(player* p, canvas_rect rect)
{
    ui* u = &p->ui;
    player_edits* e = &p->edits;
    if (!ui_panel_begin(u, "reflections", rect, "Reflections")) e->shown = false;
    for (int i = 0; i < (int)(sizeof tool_names / sizeof *tool_names); i++) {
        if (ui_switch(u, tool_names[i], (int)strlen(tool_names[i]) + 2, tool_names[i], e->tool == (edits_tool)i)) e->tool = (edits_tool)i;
        if (i == TOOL_REGION) ui_next_row(u);
    }
    ui_next_row(u);
    region_rows(p);
    constraint_rows(p);
    if (ui_switch(u, "freeze", 8, "Freeze", es_world_frozen_reflections(p->session.world, NULL))) player_freeze(p);
    if (ui_button(u, "undo", 6, "Undo")) player_undo_edit(p);
    if (ui_button(u, "redo", 6, "Redo")) player_redo_edit(p);
    if (ui_button(u, "delete", 8, "Delete")) player_delete_edit(p);
    ui_next_row(u);
    if (ui_button(u, "save", 6, "Save")) player_save_edits(p);
    if (ui_button(u, "load", 6, "Load")) player_load_edits(p);
    if (is_file(p) && ui_button(u, "scene", 22, "Save a copy of the scene")) player_save_edited_scene(p);
    ui_panel_end(u);
}
