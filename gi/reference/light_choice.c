#include "gi/reference/light_choice.h"

#include "gi/light_view.h"

/* Lights that are weighed against each other; of more, every n-th is, from a random first one on. */
enum { MAX_WEIGHED = 32 };

bool es_trace_towards_light(const es_light_state* light, es_vec3 point, es_vec3* direction, float* distance, float* strength)
{
    *strength = 1.0f;
    *distance = __builtin_inff();
    *direction = es_v3_scale(light->direction, -1.0f);
    if (light->type == ES_LIGHT_DIRECTIONAL) return true;
    es_vec3 d = es_v3_sub(light->position, point);
    float length = es_v3_length(d);
    if (!(length > 0.0f)) return false;
    *distance = length;
    *direction = es_v3_scale(d, 1.0f / length);
    *strength = es_light_falloff(light, es_v3_scale(*direction, -1.0f), length) / length / length;
    return true;
}

es_ray es_trace_shadow_ray(const es_light_state* light, const es_trace_surface* s, es_vec3 direction)
{
    es_vec3 o = es_offset_origin(s->position, s->geometric);
    if (light->type == ES_LIGHT_DIRECTIONAL) return (es_ray){{o.x, o.y, o.z}, 0.0f, {direction.x, direction.y, direction.z}, 3e38f};
    es_vec3 d = es_v3_sub(light->position, o);
    return (es_ray){{o.x, o.y, o.z}, 0.0f, {d.x, d.y, d.z}, 0.99999f};
}

static double weight_of(const es_light_state* light, const es_trace_surface* s)
{
    es_vec3 direction;
    float distance, strength;
    if (!es_trace_towards_light(light, s->position, &direction, &distance, &strength)) return 0.0;
    float cosine = es_v3_dot(s->normal, direction);
    if (!(cosine > 0.0f && es_v3_dot(s->geometric, direction) > 0.0f && strength > 0.0f)) return 0.0;
    const float* r = light->radiant;
    return (double)strength * (double)cosine * (0.2126 * (double)r[0] + 0.7152 * (double)r[1] + 0.0722 * (double)r[2]);
}

static uint32_t stride_of(uint32_t count) { return (count + MAX_WEIGHED - 1) / MAX_WEIGHED; }

bool es_trace_choose_light(const es_trace_scene* scene, const es_trace_surface* s, float u, uint32_t* light, float* probability)
{
    uint32_t count = scene->light_count;
    *light = 0;
    *probability = 1.0f;
    if (count < 2) return count == 1;
    uint32_t stride = stride_of(count), first = (uint32_t)(u * (float)stride), lights[MAX_WEIGHED], n = 0;
    u = u * (float)stride - (float)first;
    double weights[MAX_WEIGHED], total = 0.0, sum = 0.0;
    for (uint32_t i = first; i < count; i += stride, n++) {
        lights[n] = i;
        total += weights[n] = weight_of(&scene->lights[i], s);
    }
    if (!(total > 0.0)) return false;
    uint32_t chosen = n;
    for (uint32_t i = 0; i < n; i++) {
        if (!(weights[i] > 0.0)) continue;
        chosen = i;
        sum += weights[i];
        if ((double)u * total < sum) break;
    }
    *light = lights[chosen];
    *probability = (float)(weights[chosen] / total) / (float)stride;
    return *probability > 0.0f;
}

float es_trace_light_probability(const es_trace_scene* scene, const es_trace_surface* s, uint32_t light)
{
    uint32_t count = scene->light_count, stride = stride_of(count);
    if (count < 2) return 1.0f;
    double total = 0.0, own = 0.0;
    for (uint32_t i = light % stride; i < count; i += stride) {
        double weight = weight_of(&scene->lights[i], s);
        total += weight;
        if (i == light) own = weight;
    }
    return own > 0.0 ? (float)(own / total) / (float)stride : 0.0f;
}
