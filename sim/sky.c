/* The world's sky: what the sun's place at the world's time makes of the environment and of a directional light. Everything is a function of the state, so
 * that it is the same however it was come by: pictures are drawn for places of the sun ES_SKY_STEP apart, of which the nearest is shown. */
#include "sim/sky.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "sim/recording.h"
#include "sim/state_io.h"

#define DEGREE 0.017453292519943295

es_sky_desc es_default_sky_desc(void)
{
    return (es_sky_desc){.year = 2024, .month = 6, .day = 21, .seconds = 43200, .speed = 1, .turbidity = 3, .ground_albedo = {0.2f, 0.2f, 0.2f}, .intensity = 1};
}

const char* es_sky_what_is_wrong(const es_world* world, const es_sky_desc* d)
{
    static const int32_t lengths[12] = {31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    if (d->year < 1 || d->year > 9999) return "its year must lie in 1 … 9999";
    if (d->month < 1 || d->month > 12) return "its month must lie in 1 … 12";
    if (d->day < 1 || d->day > lengths[d->month - 1]) return "there is no such day in its month";
    if (!(__builtin_isgreaterequal(d->seconds, -1e10) && __builtin_islessequal(d->seconds, 1e10))) return "its seconds must lie in -1e10 … 1e10";
    if (!es_within(d->speed, 0, 1e6f)) return "its speed must lie in 0 … 1e6";
    if (!es_within(d->latitude, -0.5f * ES_PI, 0.5f * ES_PI)) return "its latitude must lie in -pi / 2 … pi / 2";
    if (!es_all_within(&d->longitude, 1, 2 * ES_PI)) return "its longitude must lie in -2 pi … 2 pi";
    if (!es_all_within(&d->north, 1, 1000)) return "its north must lie in -1000 … 1000 radians";
    if (!es_within(d->turbidity, 2, 10)) return "its turbidity must lie in 2 … 10";
    if (!es_within(d->intensity, 0, 1e6f)) return "its intensity must lie in 0 … 1e6";
    for (int k = 0; k < 3; k++)
        if (!es_within(d->ground_albedo[k], 0, 1)) return "its ground's albedo must lie in 0 … 1";
    if (d->sun.id) {
        const es_light_object* light = es_slots_get(&world->slots[ES_OBJECT_LIGHT], d->sun.id);
        if (!light || light->desc.type != ES_LIGHT_DIRECTIONAL || !light->desc.node.id) return "its sun must be a directional light with a node";
    }
    return NULL;
}

static double seconds_now(const es_world* world) { return world->sky.desc.seconds + (double)world->sky.desc.speed * (world->time - world->sky.since); }

es_sun es_world_sun(const es_world* world)
{
    es_sun sun = {0};
    if (!world || !world->sky.on) return sun;
    const es_sky_desc* d = &world->sky.desc;
    double e[3];
    es_sun_position(es_days_since_2000(d->year, d->month, d->day) + seconds_now(world) / 86400.0, (double)d->latitude, (double)d->longitude, e);
    const float up = es_clampf((float)e[1], -1.0f, 1.0f);
    sun.elevation = 0.5f * ES_PI - es_acos(up);
    sun.azimuth = es_atan2((float)e[0], (float)e[2]);
    es_sun_irradiance((double)sun.elevation, d->turbidity, sun.irradiance);
    for (int k = 0; k < 3; k++) sun.irradiance[k] *= d->intensity;
    /* north is -z turned about +y, east to its right */
    float sine, cosine;
    es_sincos(d->north, &sine, &cosine);
    const float east = (float)e[0], north = (float)e[2];
    sun.direction = es_v3_normalize(es_v3(east * cosine - north * sine, up, -(north * cosine + east * sine)), es_v3(0, 1, 0));
    return sun;
}

static void aim_sun(es_world* world, const es_sun* sun)
{
    es_light_object* light = es_slots_get(&world->slots[ES_OBJECT_LIGHT], world->sky.desc.sun.id);
    if (!light || light->desc.type != ES_LIGHT_DIRECTIONAL) return;
    es_node_object* node = es_slots_get(&world->slots[ES_OBJECT_NODE], light->desc.node.id);
    if (!node) return;
    /* from -z to where the light goes, x level */
    const es_vec3 d = es_v3_scale(sun->direction, -1.0f);
    const float yaw = es_atan2(-d.x, -d.z), pitch = es_atan2(d.y, es_sqrt(d.x * d.x + d.z * d.z));
    const es_quat rotation = es_quat_normalize(es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), yaw), es_quat_from_axis_angle(es_v3(1, 0, 0), pitch)));
    if (memcmp(&node->transform.rotation, &rotation, sizeof rotation) != 0) {
        node->transform.rotation = rotation;
        node->dirty = world->nodes_dirty = true;
    }
    memcpy(light->desc.color, sun->irradiance, sizeof light->desc.color);
    light->desc.intensity = 1.0f;
    world->lights_dirty = true;
}

void es_sky_refresh(es_world* world)
{
    es_sky* sky = &world->sky;
    if (!sky->on) return;
    const es_sun sun = es_world_sun(world);
    aim_sun(world, &sun);
    /* below -20 degrees the picture is the night's */
    const double elevation = es_maxf(sun.elevation, (float)(-20.0 * DEGREE)) / (ES_SKY_STEP * DEGREE), azimuth = (double)sun.azimuth / (ES_SKY_STEP * DEGREE);
    const int32_t step = (int32_t)(elevation + 1000.5) - 1000, turn = sun.elevation > (float)(-20.0 * DEGREE) ? (int32_t)(azimuth + 1000.5) - 1000 : 0;
    if (!sky->drawn || step != sky->drawn_step) {
        const es_sky_desc* d = &sky->desc;
        const es_sky_picture picture = {(float)(step * ES_SKY_STEP * DEGREE), d->turbidity, {d->ground_albedo[0], d->ground_albedo[1], d->ground_albedo[2]}};
        es_sky_draw(world->context, &picture, world->environment_image.pixels);
        sky->drawn_step = step;
        world->revisions.lights++;
        world->revisions.environment++;
    }
    /* the picture's middle, which is -z where nothing is turned, goes to the sun's azimuth */
    float rotation = (float)(-(double)turn * ES_SKY_STEP * DEGREE) + sky->desc.north;
    const float whole_turn = 2.0f * ES_PI, intensity = sky->desc.intensity;
    /* of any north it stays within what an environment may be turned by */
    if (rotation > whole_turn || rotation < -whole_turn) rotation -= whole_turn * (float)(int32_t)(rotation / whole_turn);
    const float radiance[3] = {intensity, intensity, intensity};
    if (sky->drawn && rotation == world->environment_rotation && memcmp(radiance, world->environment_radiance, sizeof radiance) == 0) return;
    sky->drawn = true;
    world->environment_rotation = rotation;
    memcpy(world->environment_radiance, radiance, sizeof radiance);
    world->revisions.lights++;
    world->revisions.environment++;
}

es_result es_world_set_sky(es_world* world, const es_sky_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc) {
        if (world->sky.on) return es_world_set_environment(world, NULL);
        return ES_OK;
    }
    const char* wrong = es_sky_what_is_wrong(world, desc);
    if (wrong) return es_fail(world->context, ES_INVALID_ARGUMENT, "sky: %s", wrong);
    if (!world->sky.on) {
        es_image image;
        if (es_image_create(world->context, ES_SKY_WIDTH, ES_SKY_HEIGHT, 3, &image) != ES_OK) return es_context_last_result(world->context);
        es_environment_free(world);
        world->environment_image = image;
    }
    world->sky = (es_sky){.on = true, .desc = *desc, .since = world->time};
    es_fp_environment environment = es_fp_enter();
    es_sky_refresh(world);
    es_fp_leave(environment);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_SKY, .sky = *desc});
    return ES_OK;
}

bool es_world_get_sky(const es_world* world, es_sky_desc* desc)
{
    if (desc) *desc = (es_sky_desc){0};
    if (!world || !desc || !world->sky.on) return false;
    *desc = world->sky.desc;
    desc->seconds = seconds_now(world);
    return true;
}

/* ---- state -------------------------------------------------------------------------------------------------------------------- */

void es_visit_sky_desc(state_io* io, es_sky_desc* d)
{
    uint32_t date[3] = {(uint32_t)d->year, (uint32_t)d->month, (uint32_t)d->day};
    for (int i = 0; i < 3; i++) visit_u32(io, &date[i]);
    if (reading(io)) d->year = (int32_t)date[0], d->month = (int32_t)date[1], d->day = (int32_t)date[2];
    transfer(io, &d->seconds, sizeof d->seconds);
    visit_floats(io, &d->speed, 1);
    visit_floats(io, &d->latitude, 1);
    visit_floats(io, &d->longitude, 1);
    visit_floats(io, &d->north, 1);
    visit_floats(io, &d->turbidity, 1);
    visit_floats(io, &d->intensity, 1);
    visit_floats(io, d->ground_albedo, 3);
    visit_u32(io, &d->sun.id);
}

/* A world with a sky and one without do not fit each other, see the signature of the content. */
void es_visit_sky(es_world* world, state_io* io)
{
    if (!world->sky.on) return;
    es_sky_desc desc = world->sky.desc;
    double since = world->sky.since;
    es_visit_sky_desc(io, &desc);
    transfer(io, &since, sizeof since);
    if (!reading(io) || !io->good) return;
    io->good = !es_sky_what_is_wrong(world, &desc) && since >= 0 && since <= 1e12;
    if (!io->good || io->mode != APPLY) return;
    world->sky = (es_sky){.on = true, .desc = desc, .since = since};
}
