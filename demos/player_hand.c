/* What is taken hold of: bodies and cloth, which a hand pulls by a spring and which fly on when they are let go, and lights, which are just
 * put elsewhere. All are moved in the plane of the picture by the mouse or the arrow keys, and to and fro by the wheel or Page Up and Down.
 *
 * A light that a clip moves would be back in the next step; so one that is dragged moves to a node of its own, made when the scene was
 * opened (what exists must not change, or the past could not be gone back to). */
#include "player.h"
#include "player_eye.h"

#include <math.h>
#include <string.h>

/* ---- lights ------------------------------------------------------------------------------------------------------------------------------- */

static bool light_position(const player* p, es_light light, double position[3])
{
    es_light_desc desc;
    es_mat4 pose;
    if (es_world_get_light(p->session.world, light, &desc) != ES_OK || desc.type == ES_LIGHT_DIRECTIONAL) return false;
    if (!desc.node.id) {
        memset(position, 0, 3 * sizeof *position);
        return true;
    }
    if (es_world_get_node_matrix(p->session.world, desc.node, &pose) != ES_OK) return false;
    for (int k = 0; k < 3; k++) position[k] = (double)pose.m[12 + k];
    return true;
}

/* The rotation of a matrix whose columns may be scaled (Shepperd's method). */
static es_quat rotation_of(const es_mat4* pose)
{
    float r[3][3];
    for (int c = 0; c < 3; c++) {
        const float* column = pose->m + 4 * c;
        float length = sqrtf(column[0] * column[0] + column[1] * column[1] + column[2] * column[2]);
        for (int k = 0; k < 3; k++) r[k][c] = length > 0 ? column[k] / length : (float)(k == c);
    }
    float trace = r[0][0] + r[1][1] + r[2][2];
    if (trace > 0) {
        float s = sqrtf(trace + 1) * 2;
        return (es_quat){(r[2][1] - r[1][2]) / s, (r[0][2] - r[2][0]) / s, (r[1][0] - r[0][1]) / s, s / 4};
    }
    int i = r[0][0] > r[1][1] ? (r[0][0] > r[2][2] ? 0 : 2) : (r[1][1] > r[2][2] ? 1 : 2), j = (i + 1) % 3, k = (i + 2) % 3;
    float s = sqrtf(1 + r[i][i] - r[j][j] - r[k][k]) * 2, q[3];
    q[i] = s / 4;
    q[j] = (r[j][i] + r[i][j]) / s;
    q[k] = (r[k][i] + r[i][k]) / s;
    return (es_quat){q[0], q[1], q[2], (r[k][j] - r[j][k]) / s};
}

static int index_of(const player* p, es_light light)
{
    for (size_t i = 0; i < p->nodes.light_count; i++)
        if (p->nodes.lights[i].light.id == light.id) return (int)i;
    return -1;
}

static void hold_light(player* p, es_light light, bool by_keyboard)
{
    player_hand* h = &p->hand;
    player_eye e;
    es_light_desc desc;
    double position[3];
    int index = index_of(p, light);
    if (index < 0 || !player_look(p, &e) || !light_position(p, light, position) || es_world_get_light(p->session.world, light, &desc) != ES_OK) return;
    es_node own = p->nodes.lights[index].own;
    if (desc.node.id != own.id) {
        es_mat4 pose;
        es_transform transform = es_identity_transform();
        if (desc.node.id && es_world_get_node_matrix(p->session.world, desc.node, &pose) == ES_OK) transform.rotation = rotation_of(&pose);
        transform.translation = (es_vec3){(float)position[0], (float)position[1], (float)position[2]};
        desc.node = own;
        if (es_world_set_node_transform(p->session.world, own, &transform) != ES_OK || es_world_set_light(p->session.world, light, &desc) != ES_OK) {
            player_notice(p, "%s", es_context_message(p->session.context));
            return;
        }
    }
    h->what = HELD_LIGHT;
    h->by_keyboard = by_keyboard;
    h->light = light;
    memcpy(h->target, position, sizeof h->target);
    h->distance = -eye_of_world(&e, position).z;
    h->show_lights = true;
}

void player_hold_next_light(player* p)
{
    player_hand* h = &p->hand;
    int at = h->what == HELD_LIGHT ? index_of(p, h->light) + 1 : 0;
    player_release(p);
    double position[3];
    for (; at < (int)p->nodes.light_count; at++) {
        if (!light_position(p, p->nodes.lights[at].light, position)) continue;
        hold_light(p, p->nodes.lights[at].light, true);
        const char* name = es_world_name(p->session.world, ES_OBJECT_LIGHT, h->light.id);
        player_notice(p, "holding light %d%s%s: arrow keys, Page Up and Down; K next, Esc lets go", at + 1, name && name[0] ? " " : "", name ? name : "");
        return;
    }
    player_notice(p, p->nodes.light_count ? "no further light" : "there is no light to hold");
}

void player_lights_home(player* p)
{
    player_release(p);
    for (size_t i = 0; i < p->nodes.light_count; i++) {
        es_light_desc desc;
        if (es_world_get_light(p->session.world, p->nodes.lights[i].light, &desc) != ES_OK || desc.node.id != p->nodes.lights[i].own.id) continue;
        desc.node = p->nodes.lights[i].scenes;
        es_world_set_light(p->session.world, p->nodes.lights[i].light, &desc);
    }
}

/* ---- bodies and cloth ---------------------------------------------------------------------------------------------------------------------- */

enum { HAND = 0 };
static const float reach = 1e6f; /* metres that a hand can look */

static es_vec3 rotate(es_quat q, es_vec3 v)
{
    es_vec3 t = {2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x)};
    return (es_vec3){v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z, v.z + q.w * t.z + q.x * t.y - q.y * t.x};
}

/* Where the held thing is held; false when it is not held any more. */
static bool held_point(const player* p, double point[3])
{
    es_hand_state state;
    es_body_state body;
    if (es_world_get_hand(p->session.world, HAND, &state) != ES_OK) return false;
    if (state.soft) return es_world_get_soft_vertex(p->session.world, (es_soft){state.soft}, state.vertex, point, NULL) == ES_OK;
    if (!state.body.id || es_world_get_body(p->session.world, state.body, &body) != ES_OK) return false;
    es_vec3 arm = rotate(body.rotation, state.local_point);
    point[0] = body.position[0] + (double)arm.x;
    point[1] = body.position[1] + (double)arm.y;
    point[2] = body.position[2] + (double)arm.z;
    return true;
}

static void hold(player* p, player_held what, const player_eye* e, const double point[3], bool by_keyboard)
{
    player_hand* h = &p->hand;
    h->what = what;
    h->by_keyboard = by_keyboard;
    memcpy(h->target, point, sizeof h->target);
    h->distance = -eye_of_world(e, point).z;
}

/* How far ahead of the eye what the pixel shows is; 0: nothing is there. */
static float seen_at(player* p, float x, float y)
{
    es_image depth = {0};
    float seen = 0;
    if (es_renderer_image(p->session.renderer, "depth", &depth) != ES_OK) return 0;
    uint32_t px = (uint32_t)(fmaxf(x, 0) * (float)depth.width / (float)p->canvas.width), py = (uint32_t)(fmaxf(y, 0) * (float)depth.height / (float)p->canvas.height);
    if (px < depth.width && py < depth.height) seen = depth.pixels[((size_t)py * depth.width + px) * depth.channels];
    es_image_destroy(p->session.context, &depth);
    return seen > 0 && isfinite(seen) ? seen : 0;
}

/* A body that can be moved at a point that is seen. Shapes and what shows them differ, so its surroundings count, the nearest first; and
 * bodies that nothing shows (walls that keep things in) are no obstacle, as they would be to a ray. */
static bool movable_at(player* p, const double point[3], float radius, es_body* found, es_body_state* state)
{
    for (int attempt = 0; attempt < 3; attempt++, radius *= 3) {
        es_shape_desc sphere = {.type = ES_SHAPE_SPHERE, .radius = radius};
        es_body bodies[64];
        size_t count = sizeof bodies / sizeof bodies[0];
        if (es_world_overlap(p->session.world, &sphere, point, (es_quat){0, 0, 0, 1}, 0, bodies, &count) != ES_OK) return false;
        for (size_t i = 0; i < count && i < sizeof bodies / sizeof bodies[0]; i++)
            if (es_world_get_body(p->session.world, bodies[i], state) == ES_OK && state->type == ES_BODY_DYNAMIC) {
                *found = bodies[i];
                return true;
            }
    }
    return false;
}

/* What the pixel shows, when it is cloth or a body that can be moved. */
static bool grab_at(player* p, float x, float y, bool by_keyboard)
{
    es_world* world = p->session.world;
    player_eye e;
    double origin[3], point[3];
    es_vec3 direction;
    es_soft_contact soft = {0};
    es_body body;
    es_body_state state;
    float seen = seen_at(p, x, y);
    if (!(seen > 0) || !player_look(p, &e)) return false;
    eye_pixel_ray(&e, x, y, origin, &direction);
    if (es_world_soft_pick(world, origin, direction, reach, &soft) == ES_OK && soft.soft.id && -eye_of_world(&e, soft.point).z <= seen * 1.02f + 0.02f) {
        if (es_world_grab_soft(world, HAND, soft.soft, soft.vertex, soft.point) != ES_OK) return false;
        hold(p, HELD_SOFT, &e, soft.point, by_keyboard);
        return true;
    }
    world_of_eye(&e, eye_of_pixel(&e, x, y, seen), point);
    if (!movable_at(p, point, 0.004f * seen, &body, &state)) return false;
    es_vec3 arm = {(float)(point[0] - state.position[0]), (float)(point[1] - state.position[1]), (float)(point[2] - state.position[2])};
    es_quat back = {-state.rotation.x, -state.rotation.y, -state.rotation.z, state.rotation.w};
    if (es_world_grab_body(world, HAND, body, rotate(back, arm), point, 0) != ES_OK) return false;
    hold(p, HELD_BODY, &e, point, by_keyboard);
    return true;
}

/* Also what a state that was gone back to holds. */
void player_release(player* p)
{
    es_hand_state state;
    if (es_world_get_hand(p->session.world, HAND, &state) == ES_OK && (state.body.id || state.soft)) es_world_release(p->session.world, HAND);
    p->hand.what = HELD_NOTHING;
}

void player_grab(player* p)
{
    if (p->hand.what) player_release(p);
    else if (grab_at(p, (float)p->canvas.width / 2, (float)p->canvas.height / 2, true)) player_notice(p, "held: arrow keys, Page Up and Down; Enter throws, F lets go");
    else player_notice(p, "nothing to hold in the middle of the picture");
    p->hand.cross_until = demo_seconds() + 4;
}

/* Away from the eye, at a speed that crosses the scene in a second. */
void player_throw(player* p)
{
    player_eye e;
    double origin[3];
    es_vec3 direction;
    es_hand_state hand;
    if (p->hand.what != HELD_BODY || !player_look(p, &e) || es_world_get_hand(p->session.world, HAND, &hand) != ES_OK) return;
    player_release(p);
    eye_pixel_ray(&e, e.width / 2, e.height / 2, origin, &direction);
    float speed = 6 * p->nodes.fly.speed;
    es_world_set_body_velocity(p->session.world, hand.body, (es_vec3){direction.x * speed, direction.y * speed, direction.z * speed}, (es_vec3){0, 0, 0});
}

static bool pick_soft(player* p, float x, float y, es_soft_contact* contact)
{
    player_eye e;
    double origin[3];
    es_vec3 direction;
    if (!player_look(p, &e)) return false;
    eye_pixel_ray(&e, x, y, origin, &direction);
    return es_world_soft_pick(p->session.world, origin, direction, reach, contact) == ES_OK && contact->soft.id;
}

/* A hole as wide as a twentieth of the way to it; cloth that does not tear comes off its hooks. */
static void tear_at(player* p, float x, float y)
{
    es_soft_contact contact = {0};
    if (!pick_soft(p, x, y, &contact)) {
        player_notice(p, "no cloth there");
        return;
    }
    if (es_world_soft_tear(p->session.world, contact.soft, contact.point, contact.distance / 20) == ES_OK) player_notice(p, "torn");
    else if (es_world_soft_detach(p->session.world, contact.soft, ES_SOFT_ALL) == ES_OK) player_notice(p, "off its hooks");
}

void player_tear(player* p)
{
    tear_at(p, (float)p->canvas.width / 2, (float)p->canvas.height / 2);
    p->hand.cross_until = demo_seconds() + 4;
}

/* What is held, else what is in the middle of the picture. */
void player_unhook(player* p)
{
    es_hand_state hand;
    es_soft_contact contact = {0};
    bool held = p->hand.what == HELD_SOFT && es_world_get_hand(p->session.world, HAND, &hand) == ES_OK && hand.soft;
    if (!held && !pick_soft(p, (float)p->canvas.width / 2, (float)p->canvas.height / 2, &contact)) player_notice(p, "no cloth there");
    else if (es_world_soft_detach(p->session.world, held ? (es_soft){hand.soft} : contact.soft, ES_SOFT_ALL) == ES_OK) player_notice(p, "off its hooks");
    else player_notice(p, "%s", es_context_message(p->session.context));
}

/* ---- mouse and keys -------------------------------------------------------------------------------------------------------------------------- */

enum { GRASP = 14 }; /* pixels of the font from a light's mark that still take it */

static bool take_light_at(player* p, float x, float y)
{
    player_hand* h = &p->hand;
    player_eye e;
    if (!h->show_lights || !player_look(p, &e)) return false;
    int nearest = -1;
    float best = (float)(GRASP * p->ui.scale);
    for (size_t i = 0; i < p->nodes.light_count; i++) {
        double position[3];
        float px, py;
        if (!light_position(p, p->nodes.lights[i].light, position) || !eye_to_pixel(&e, eye_of_world(&e, position), &px, &py)) continue;
        float away = hypotf(px - x, py - y);
        if (away < best) best = away, nearest = (int)i;
    }
    if (nearest >= 0) hold_light(p, p->nodes.lights[nearest].light, false);
    return nearest >= 0;
}

static void move_by_keys(player* p, const player_eye* e, const es_window_input* input)
{
    player_hand* h = &p->hand;
    float right = (float)input->down[ES_KEY_RIGHT] - (float)input->down[ES_KEY_LEFT], up = (float)input->down[ES_KEY_UP] - (float)input->down[ES_KEY_DOWN];
    float away = (float)input->down[ES_KEY_PAGE_UP] - (float)input->down[ES_KEY_PAGE_DOWN];
    if (right == 0 && up == 0 && away == 0) return;
    float step = p->nodes.fly.speed * p->seconds * (input->down[ES_KEY_SHIFT] ? 4.0f : 1.0f);
    es_vec3 place = eye_of_world(e, h->target);
    place = (es_vec3){place.x + right * step, place.y + up * step, place.z - away * step};
    world_of_eye(e, place, h->target);
}

/* What is held may be gone: torn, or the scene rewound. */
static void move_hand(player* p)
{
    player_hand* h = &p->hand;
    es_hand_state state;
    if (h->what != HELD_BODY && h->what != HELD_SOFT) return;
    if (es_world_get_hand(p->session.world, HAND, &state) != ES_OK || (!state.body.id && !state.soft)) {
        h->what = HELD_NOTHING;
        return;
    }
    if (memcmp(state.target, h->target, sizeof state.target) != 0) es_world_move_hand(p->session.world, HAND, h->target);
}

bool player_hand_update(player* p, const es_window_input* input)
{
    player_hand* h = &p->hand;
    player_eye e;
    bool had = h->what != HELD_NOTHING && !h->by_keyboard;
    if (h->what == HELD_NOTHING || h->by_keyboard)
        if (input->mouse_pressed[0] && (take_light_at(p, input->press_x[0], input->press_y[0]) || grab_at(p, input->press_x[0], input->press_y[0], false))) had = true;
    if (input->mouse_pressed[2]) tear_at(p, input->press_x[2], input->press_y[2]);
    if (h->what == HELD_NOTHING || !player_look(p, &e)) return false;
    if (input->scroll != 0) {
        es_vec3 place = eye_of_world(&e, h->target);
        float grown = powf(1.1f, input->scroll);
        h->distance *= grown;
        if (h->by_keyboard) world_of_eye(&e, (es_vec3){place.x, place.y, place.z * grown}, h->target);
    }
    if (h->by_keyboard) {
        move_by_keys(p, &e, input);
        return false;
    }
    if (had && (input->mouse_dx != 0 || input->mouse_dy != 0 || input->scroll != 0)) world_of_eye(&e, eye_of_pixel(&e, input->mouse_x, input->mouse_y, h->distance), h->target);
    if (!input->mouse_down[0]) {
        move_hand(p); /* the last of the way before it lets go */
        player_release(p);
    }
    return true;
}

int player_hand_pull(player* p)
{
    if (p->hand.what == HELD_BODY || p->hand.what == HELD_SOFT) move_hand(p);
    return DEMO_OK;
}

int player_hand_apply(player* p)
{
    player_hand* h = &p->hand;
    int index = h->what == HELD_LIGHT ? index_of(p, h->light) : -1;
    if (index < 0) return DEMO_OK;
    es_transform transform;
    if (es_world_get_node_transform(p->session.world, p->nodes.lights[index].own, &transform) != ES_OK) return DEMO_BAD_INPUT;
    es_vec3 to = {(float)h->target[0], (float)h->target[1], (float)h->target[2]};
    if (transform.translation.x == to.x && transform.translation.y == to.y && transform.translation.z == to.z) return DEMO_OK;
    transform.translation = to;
    return es_world_set_node_transform(p->session.world, p->nodes.lights[index].own, &transform) == ES_OK ? DEMO_OK : DEMO_BAD_INPUT;
}

/* A line from where it is held to where the hand is. */
static void draw_pull(player* p, const player_eye* e)
{
    double point[3];
    float x0, y0, x1, y1;
    int s = p->ui.scale;
    if (!held_point(p, point) || !eye_to_pixel(e, eye_of_world(e, point), &x0, &y0) || !eye_to_pixel(e, eye_of_world(e, p->hand.target), &x1, &y1)) return;
    if (fabsf(x0) + fabsf(y0) + fabsf(x1) + fabsf(y1) > 1e5f) return;
    canvas_line(&p->canvas, (int)x0, (int)y0, (int)x1, (int)y1, s, UI_FOCUS);
    canvas_dot(&p->canvas, (int)x0 - 2 * s, (int)y0 - 2 * s, 5 * s, UI_FOCUS);
}

void player_hand_draw(player* p)
{
    player_hand* h = &p->hand;
    player_eye e;
    if (p->hide_all || !player_look(p, &e)) return;
    int s = p->ui.scale, cx = (int)p->canvas.width / 2, cy = (int)p->canvas.height / 2;
    if (h->what == HELD_BODY || h->what == HELD_SOFT) draw_pull(p, &e);
    if (demo_seconds() < h->cross_until) {
        canvas_line(&p->canvas, cx - 8 * s, cy, cx + 8 * s, cy, s, UI_TEXT);
        canvas_line(&p->canvas, cx, cy - 8 * s, cx, cy + 8 * s, s, UI_TEXT);
    }
    if (!h->show_lights) return;
    for (size_t i = 0; i < p->nodes.light_count; i++) {
        double position[3];
        float x, y;
        if (!light_position(p, p->nodes.lights[i].light, position) || !eye_to_pixel(&e, eye_of_world(&e, position), &x, &y)) continue;
        bool held = h->what == HELD_LIGHT && h->light.id == p->nodes.lights[i].light.id;
        canvas_rect mark = {(int)x - 5 * s, (int)y - 5 * s, 11 * s, 11 * s};
        canvas_blend(&p->canvas, mark, 0, 128);
        canvas_frame(&p->canvas, mark, s, held ? UI_FOCUS : UI_TEXT);
        canvas_dot(&p->canvas, (int)x - s, (int)y - s, 3 * s, held ? UI_FOCUS : UI_CHANGED);
    }
}
