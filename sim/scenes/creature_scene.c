/* A creature walks in a circle past a curved light: after Ritschel's thesis, figure 5.16. The light, a bent strip whose colour runs from
 * amber to blue, is approximated by lights along it; balls that lie in the way are kicked about. */
#include "sim/scenes/creature.h"

#include "platform/maths.h"

enum { LAMPS = 16, BALLS = 7 };
static const float ring = 1.9f, arc_radius = 3.1f, walk_period = 1.3f;

static es_vec3 arc_point(float share, float beyond)
{
    float angle = 0.42f + 2.3f * share, r = arc_radius + beyond;
    return es_v3(-r * es_sin(angle) + 0.7f, 1.5f + 0.7f * es_sin(5.2f * share), -r * es_cos(angle) - 0.1f);
}

static void arc_color(float share, float color[3])
{
    color[0] = 1.0f - 0.80f * share;
    color[1] = 0.50f + 0.14f * es_sin(3.1415927f * share);
    color[2] = 0.16f + 0.84f * share;
}

static void add_lamps(es_scene_builder* builder)
{
    for (int i = 0; i < LAMPS; i++) {
        float share = ((float)i + 0.5f) / LAMPS;
        es_vec3 place = arc_point(share, 0);
        es_node node = es_build_node(builder, "lamp", place, es_look_rotation(es_v3_sub(es_v3(0, 0.7f, 0), place)));
        es_light_desc lamp = es_default_light_desc();
        arc_color(share, lamp.color);
        lamp.intensity = 64.0f / LAMPS;
        lamp.outer_cone = 1.25f;
        es_build_light(builder, "lamp", node, &lamp);
    }
    /* what is seen of it glows, in eight pieces of one colour each */
    for (int i = 0; i < 8; i++) {
        float color[3], here = (float)i / 8, there = (float)(i + 1) / 8;
        arc_color(0.5f * (here + there), color);
        es_material_desc glow = es_default_material_desc();
        glow.specular = 0;
        glow.double_sided = true;
        for (int c = 0; c < 3; c++) {
            glow.base_color[c] = 0;
            glow.emission[c] = 2 * color[c];
        }
        es_shape strip = es_build_shape(builder);
        for (int k = 0; k < 6; k++) {
            es_vec3 a = arc_point(here + (there - here) * (float)k / 6, 0.12f), b = arc_point(here + (there - here) * (float)(k + 1) / 6, 0.12f);
            es_vec3 up = {0, 0.12f, 0}, inwards = es_v3_normalize(es_v3(-a.x, 0, -a.z), es_v3(1, 0, 0));
            es_shape_quad(&strip, es_v3_sub(a, up), es_v3_sub(b, up), es_v3_add(b, up), es_v3_add(a, up), inwards);
        }
        es_build_object(builder, "strip", &strip, es_build_material(builder, "glow", &glow), es_v3(0, 0, 0));
    }
}

es_result es_scene_creature(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    es_material floor = es_build_lambert(&builder, "floor", 0.58f, 0.56f, 0.53f), wall = es_build_lambert(&builder, "wall", 0.66f, 0.64f, 0.60f);
    es_build_static_box(&builder, "floor", es_v3(-5, -0.2f, -5), es_v3(5, 0, 5), floor);
    es_build_hidden_wall(&builder, es_v3(-5, -2, -5), es_v3(5, -0.1f, 5)); /* a foot that steps on a ball presses it no deeper than out again */
    es_build_hidden_wall(&builder, es_v3(4.4f, 0, -5), es_v3(5, 4, 5));
    es_build_hidden_wall(&builder, es_v3(-5, 0, 3.6f), es_v3(5, 4, 5)); /* before the camera, so that what is kicked stays in the picture */
    es_build_static_box(&builder, "back wall", es_v3(-5, 0, -4.3f), es_v3(5, 4, -4.1f), wall);
    es_build_static_box(&builder, "left wall", es_v3(-4.2f, 0, -4.1f), es_v3(-4.0f, 4, 5), wall);

    es_material_desc hide = es_default_material_desc();
    hide.model = ES_SURFACE_PHONG;
    hide.base_color[0] = 0.42f;
    hide.base_color[1] = 0.40f;
    hide.base_color[2] = 0.39f;
    hide.specular = 0.25f;
    hide.exponent = 20;
    es_node root = es_build_node(&builder, "creature", es_v3(ring, 0, 0), es_quat_identity());
    es_build_creature(&builder, root, es_build_material(&builder, "hide", &hide), triangles ? es_sqrt((float)triangles / 14400.0f) : 1, walk_period);
    es_mover_desc walk = es_default_mover_desc();
    walk.name = "walk";
    walk.node = root;
    walk.arm = es_v3(ring, 0, 0);
    walk.period = 6.2831853f * ring / es_creature_speed(walk_period);
    walk.phase = 0.06f;
    es_build_mover(&builder, &walk);
    es_shape_desc bulk = es_capsule_shape(0.42f, 0.55f);
    bulk.position = es_v3(0, 0.7f, -0.2f);
    bulk.rotation = es_quat_from_axis_angle(es_v3(1, 0, 0), 0.5f * ES_PI);
    es_build_body(&builder, root, ES_BODY_KINEMATIC, &bulk, NULL);

    for (int i = 0; i < BALLS; i++) {
        float angle = 1.2f + 0.75f * (float)i, r = 0.14f + 0.03f * (float)(i % 3);
        es_shape ball = es_build_shape(&builder);
        es_shape_sphere(&ball, es_v3(0, 0, 0), r, 28, 15);
        es_material paint = es_build_lambert(&builder, "paint", i % 3 == 0 ? 0.7f : 0.25f, i % 3 == 1 ? 0.6f : 0.3f, i % 3 == 2 ? 0.65f : 0.2f);
        es_shape_desc sphere = es_sphere_shape(r);
        sphere.density = 120;
        sphere.restitution = 0.5f;
        sphere.rolling_resistance = 0.03f * r;
        es_node node = es_build_object(&builder, "ball", &ball, paint, es_v3((ring + 0.2f * (float)(i % 2)) * es_cos(angle), r, -(ring + 0.2f * (float)(i % 2)) * es_sin(angle)));
        es_build_body(&builder, node, ES_BODY_DYNAMIC, &sphere, NULL);
    }
    add_lamps(&builder);
    es_build_camera(&builder, es_v3(1.6f, 2.3f, 5.4f), es_v3(-0.30f, -0.27f, -1), 0.78f, 0.1f);
    return builder.result;
}
