/* What is taken hold of: lights, dragged with the mouse in the plane of the picture or moved with the arrow keys.
 *
 * A light that a clip moves would be back in the next step; so one that is dragged moves to a node of its own, made when the scene was
 * opened (what exists must not change, or the past could not be gone back to). */
#include "player.h"

#include <math.h>
#include <string.h>

int player_hand_open(player* p)
{
    player_hand* h = &p->hand;
    uint32_t ids[256];
    size_t count = sizeof ids / sizeof ids[0];
    if (es_world_enumerate(p->session.world, ES_OBJECT_LIGHT, ids, &count) != ES_OK) return DEMO_BAD_INPUT;
    if (count > sizeof ids / sizeof ids[0]) count = sizeof ids / sizeof ids[0];
    for (size_t i = 0; i < count && h->light_count < PLAYER_MAX_LIGHTS; i++) {
        es_light_desc desc;
        es_light light = {ids[i]};
        es_node_desc node = {.name = "dragged light", .transform = es_identity_transform()};
        if (es_world_get_light(p->session.world, light, &desc) != ES_OK || es_world_add_node(p->session.world, &node, &h->lights[h->light_count].own) != ES_OK)
            return DEMO_BAD_INPUT;
        h->lights[h->light_count].light = light;
        h->lights[h->light_count++].scenes = desc.node;
    }
    return DEMO_OK;
}

/* ---- between the picture and the world ------------------------------------------------------------------------------------------------ */

typedef struct eye {
    es_raster_view view;
    double origin[3];
    float width, height;
} eye;

static bool look(const player* p, eye* e)
{
    if (!p->canvas.width || !p->canvas.height) return false;
    e->width = (float)p->canvas.width;
    e->height = (float)p->canvas.height;
    es_world_origin(p->session.world, e->origin);
    return es_world_camera_view(p->session.world, es_world_active_camera(p->session.world), p->canvas.width, p->canvas.height, &e->view) == ES_OK;
}

/* x to the right, y up, z towards us. */
static es_vec3 to_eye(const eye* e, const double position[3])
{
    const float* m = e->view.view.m;
    float x = (float)(position[0] - e->origin[0]), y = (float)(position[1] - e->origin[1]), z = (float)(position[2] - e->origin[2]);
    return (es_vec3){m[0] * x + m[4] * y + m[8] * z + m[12], m[1] * x + m[5] * y + m[9] * z + m[13], m[2] * x + m[6] * y + m[10] * z + m[14]};
}

static void to_world(const eye* e, es_vec3 v, double position[3])
{
    const float* m = e->view.view.m;
    float x = v.x - m[12], y = v.y - m[13], z = v.z - m[14];
    position[0] = e->origin[0] + (double)(m[0] * x + m[1] * y + m[2] * z);
    position[1] = e->origin[1] + (double)(m[4] * x + m[5] * y + m[6] * z);
    position[2] = e->origin[2] + (double)(m[8] * x + m[9] * y + m[10] * z);
}

/* False behind the eye. */
static bool to_pixel(const eye* e, es_vec3 v, float* x, float* y)
{
    const float* m = e->view.projection.m;
    float w = m[3] * v.x + m[7] * v.y + m[11] * v.z + m[15];
    if (!(w > 1e-6f)) return false;
    *x = ((m[0] * v.x + m[4] * v.y + m[8] * v.z + m[12]) / w * 0.5f + 0.5f) * e->width;
    *y = (0.5f - (m[1] * v.x + m[5] * v.y + m[9] * v.z + m[13]) / w * 0.5f) * e->height;
    return true;
}

/* Where the pixel's ray is `distance` ahead of the eye. */
static es_vec3 from_pixel(const eye* e, float x, float y, float distance)
{
    const float* m = e->view.projection.m;
    float w = m[11] * -distance + m[15]; /* perspective: the distance; orthographic: 1 */
    float nx = (2 * x / e->width - 1) * w, ny = (1 - 2 * y / e->height) * w;
    return (es_vec3){(nx + m[8] * distance - m[12]) / m[0], (ny + m[9] * distance - m[13]) / m[5], -distance};
}

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

static int index_of(const player_hand* h, es_light light)
{
    for (size_t i = 0; i < h->light_count; i++)
        if (h->lights[i].light.id == light.id) return (int)i;
    return -1;
}

static void hold_light(player* p, es_light light, bool by_keyboard)
{
    player_hand* h = &p->hand;
    eye e;
    es_light_desc desc;
    double position[3];
    int index = index_of(h, light);
    if (index < 0 || !look(p, &e) || !light_position(p, light, position) || es_world_get_light(p->session.world, light, &desc) != ES_OK) return;
    es_node own = h->lights[index].own;
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
    h->distance = -to_eye(&e, position).z;
    h->show_lights = true;
}

void player_hold_next_light(player* p)
{
    player_hand* h = &p->hand;
    int at = h->what == HELD_LIGHT ? index_of(h, h->light) + 1 : 0;
    player_release(p);
    double position[3];
    for (; at < (int)h->light_count; at++) {
        if (!light_position(p, h->lights[at].light, position)) continue;
        hold_light(p, h->lights[at].light, true);
        const char* name = es_world_name(p->session.world, ES_OBJECT_LIGHT, h->light.id);
        player_notice(p, "holding light %d%s%s: arrow keys, Page Up and Down; K next, Esc lets go", at + 1, name && name[0] ? " " : "", name ? name : "");
        return;
    }
    player_notice(p, h->light_count ? "no further light" : "there is no light to hold");
}

void player_lights_home(player* p)
{
    player_hand* h = &p->hand;
    player_release(p);
    for (size_t i = 0; i < h->light_count; i++) {
        es_light_desc desc;
        if (es_world_get_light(p->session.world, h->lights[i].light, &desc) != ES_OK || desc.node.id != h->lights[i].own.id) continue;
        desc.node = h->lights[i].scenes;
        es_world_set_light(p->session.world, h->lights[i].light, &desc);
    }
}

void player_release(player* p) { p->hand.what = HELD_NOTHING; }

/* ---- mouse and keys -------------------------------------------------------------------------------------------------------------------------- */

enum { GRASP = 14 }; /* pixels of the font from a light's mark that still take it */

static bool take_light_at(player* p, float x, float y)
{
    player_hand* h = &p->hand;
    eye e;
    if (!h->show_lights || !look(p, &e)) return false;
    int nearest = -1;
    float best = (float)(GRASP * p->ui.scale);
    for (size_t i = 0; i < h->light_count; i++) {
        double position[3];
        float px, py;
        if (!light_position(p, h->lights[i].light, position) || !to_pixel(&e, to_eye(&e, position), &px, &py)) continue;
        float away = hypotf(px - x, py - y);
        if (away < best) best = away, nearest = (int)i;
    }
    if (nearest >= 0) hold_light(p, h->lights[nearest].light, false);
    return nearest >= 0;
}

static void move_by_keys(player* p, const eye* e, const es_window_input* input)
{
    player_hand* h = &p->hand;
    float right = (float)input->down[ES_KEY_RIGHT] - (float)input->down[ES_KEY_LEFT], up = (float)input->down[ES_KEY_UP] - (float)input->down[ES_KEY_DOWN];
    float away = (float)input->down[ES_KEY_PAGE_UP] - (float)input->down[ES_KEY_PAGE_DOWN];
    if (right == 0 && up == 0 && away == 0) return;
    float step = p->fly.speed * p->seconds * (input->down[ES_KEY_SHIFT] ? 4.0f : 1.0f);
    es_vec3 place = to_eye(e, h->target);
    place = (es_vec3){place.x + right * step, place.y + up * step, place.z - away * step};
    to_world(e, place, h->target);
}

bool player_hand_update(player* p, const es_window_input* input)
{
    player_hand* h = &p->hand;
    eye e;
    bool had = h->what != HELD_NOTHING && !h->by_keyboard;
    if (h->what == HELD_NOTHING || h->by_keyboard)
        if (input->mouse_pressed[0] && take_light_at(p, input->press_x[0], input->press_y[0])) had = true;
    if (h->what == HELD_NOTHING || !look(p, &e)) return false;
    if (input->scroll != 0) {
        es_vec3 place = to_eye(&e, h->target);
        float grown = powf(1.1f, input->scroll);
        h->distance *= grown;
        if (h->by_keyboard) to_world(&e, (es_vec3){place.x, place.y, place.z * grown}, h->target);
    }
    if (h->by_keyboard) {
        move_by_keys(p, &e, input);
        return false;
    }
    if (had && (input->mouse_dx != 0 || input->mouse_dy != 0 || input->scroll != 0)) to_world(&e, from_pixel(&e, input->mouse_x, input->mouse_y, h->distance), h->target);
    if (!input->mouse_down[0]) player_release(p);
    return true;
}

int player_hand_apply(player* p)
{
    player_hand* h = &p->hand;
    int index = h->what == HELD_LIGHT ? index_of(h, h->light) : -1;
    if (index < 0) return DEMO_OK;
    es_transform transform;
    if (es_world_get_node_transform(p->session.world, h->lights[index].own, &transform) != ES_OK) return DEMO_BAD_INPUT;
    es_vec3 to = {(float)h->target[0], (float)h->target[1], (float)h->target[2]};
    if (transform.translation.x == to.x && transform.translation.y == to.y && transform.translation.z == to.z) return DEMO_OK;
    transform.translation = to;
    return es_world_set_node_transform(p->session.world, h->lights[index].own, &transform) == ES_OK ? DEMO_OK : DEMO_BAD_INPUT;
}

void player_hand_draw(player* p)
{
    player_hand* h = &p->hand;
    eye e;
    if (p->hide_all || !h->show_lights || !look(p, &e)) return;
    int s = p->ui.scale;
    for (size_t i = 0; i < h->light_count; i++) {
        double position[3];
        float x, y;
        if (!light_position(p, h->lights[i].light, position) || !to_pixel(&e, to_eye(&e, position), &x, &y)) continue;
        bool held = h->what == HELD_LIGHT && h->light.id == h->lights[i].light.id;
        canvas_rect mark = {(int)x - 5 * s, (int)y - 5 * s, 11 * s, 11 * s};
        canvas_blend(&p->canvas, mark, 0, 128);
        canvas_frame(&p->canvas, mark, s, held ? UI_FOCUS : UI_TEXT);
        canvas_dot(&p->canvas, (int)x - s, (int)y - s, 3 * s, held ? UI_FOCUS : UI_CHANGED);
    }
}
