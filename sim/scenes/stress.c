/* Everything fast, after Knecht 2009, figure 5.5: bodies that bounce about the Cornell box without gravity or loss, and a light that
 * sweeps it from side to side about twice a second and flickers besides. What temporal methods find hardest. */
#include "sim/scenes/box_room.h"

#include "platform/maths.h"
#include "platform/random.h"

enum { BODIES = 12, SEED = 5 };

static float signed_random(uint32_t counter) { return 2 * es_random_float(SEED, counter) - 1; }

es_result es_scene_stress(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    es_build_box_room(&builder);
    uint32_t nv = 16;
    if (triangles) nv = (uint32_t)es_maxf(3, es_sqrt((float)triangles / (float)(2 * BODIES)));
    for (uint32_t i = 0; i < BODIES; i++) {
        const float hue = (float)i / (float)BODIES;
        es_material paint = es_build_lambert(&builder, "paint", 0.45f + 0.3f * es_cos(6.2831853f * hue), 0.45f + 0.3f * es_cos(6.2831853f * (hue - 0.3333f)), 0.45f + 0.3f * es_cos(6.2831853f * (hue - 0.6667f)));
        float size = 0.11f + 0.05f * es_random_float(SEED, 8 * i);
        es_shape shape = es_build_shape(&builder);
        es_shape_desc body;
        if (i % 2) {
            es_shape_box(&shape, es_v3(-size, -size, -size), es_v3(size, size, size));
            body = es_box_shape(es_v3(size, size, size));
        } else {
            es_shape_sphere(&shape, es_v3(0, 0, 0), size, 2 * nv, nv);
            body = es_sphere_shape(size);
        }
        body.friction = 0;
        body.restitution = 1;
        es_vec3 place = {-0.6f + 0.6f * (float)(i % 3), 0.4f + 0.6f * (float)(i / 3 % 2), -0.6f + 0.7f * (float)(i / 6)};
        es_body_desc desc = es_default_body_desc();
        desc.gravity_scale = 0;
        desc.no_sleep = true;
        desc.continuous = true;
        desc.velocity = es_v3(6 * signed_random(8 * i + 1), 6 * signed_random(8 * i + 2), 6 * signed_random(8 * i + 3));
        desc.angular_velocity = es_v3(9 * signed_random(8 * i + 4), 9 * signed_random(8 * i + 5), 9 * signed_random(8 * i + 6));
        es_build_body(&builder, es_build_object(&builder, i % 2 ? "cube" : "ball", &shape, paint, place), ES_BODY_DYNAMIC, &body, &desc);
    }
    es_build_box_camera(&builder);
    es_build_swaying_spot(&builder, 60, 0.6f, 0.45f);
    size_t count = 1;
    es_light lamp = {0};
    if (builder.result == ES_OK) builder.result = es_world_enumerate(world, ES_OBJECT_LIGHT, &lamp.id, &count);
    es_build_mover(&builder, &(es_mover_desc){.name = "flicker", .type = ES_MOVER_FLICKER, .light = lamp, .period = 0.11f, .amplitude = 0.6f, .seed = SEED});
    return builder.result;
}
