/* Animation clips: keys of node transforms over time, interpolated as glTF 2.0 appendix C says.
 *
 * A clip loops over its duration, the last key time of all its channels; a channel holds its first value before its first
 * key and its last value after its last. */
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"

static const char* label(const char* name) { return name ? name : ""; }
static size_t components_of(const es_clip_channel* channel) { return channel->path == ES_CLIP_ROTATION ? 4 : 3; }
static size_t value_count(const es_clip_channel* channel)
{
    return (size_t)channel->key_count * components_of(channel) * (channel->interpolation == ES_INTERPOLATE_CUBIC_SPLINE ? 3 : 1);
}

static es_result check(es_world* world, const es_clip_desc* desc)
{
    es_context* context = world->context;
    const char* name = label(desc->name);
    if (desc->channel_count && !desc->channels) return es_misuse(context, ES_INVALID_ARGUMENT, "clip '%.64s': channels must not be NULL", name);
    for (uint32_t i = 0; i < desc->channel_count; i++) {
        const es_clip_channel* channel = &desc->channels[i];
        if (!es_world_object(world, ES_OBJECT_NODE, channel->node.id)) return ES_STALE_HANDLE;
        if ((uint32_t)channel->path > ES_CLIP_SCALE || (uint32_t)channel->interpolation > ES_INTERPOLATE_CUBIC_SPLINE)
            return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u has a path or interpolation that does not exist", name, i);
        if (channel->key_count < 1 || channel->key_count > 1u << 24 || !channel->times || !channel->values)
            return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u must have 1 … 2^24 keys with times and values", name, i);
        for (uint32_t k = 0; k < channel->key_count; k++)
            if (!es_within(channel->times[k], 0, 1e6f) || (k > 0 && channel->times[k] <= channel->times[k - 1]))
                return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u, key %u: times must increase, within 0 … 1e6 seconds", name, i, k);
        if (!es_all_within(channel->values, value_count(channel), ES_WORLD_EXTENT))
            return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u: values must be finite and within 1e9", name, i);
    }
    return ES_OK;
}

static void free_clip(es_world* world, es_clip_object* clip)
{
    es_release(world->context, clip->channels, clip->channel_count * sizeof *clip->channels);
    es_release(world->context, clip->data, clip->data_count * sizeof *clip->data);
}

es_result es_world_add_clip(es_world* world, const es_clip_desc* desc, es_clip* clip)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !clip) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_clip: desc and clip must not be NULL");
    *clip = (es_clip){0};
    es_result result = check(world, desc);
    if (result != ES_OK) return result;
    size_t total = 0;
    for (uint32_t i = 0; i < desc->channel_count; i++) total += desc->channels[i].key_count + value_count(&desc->channels[i]);
    es_clip_channel* channels = es_allocate_array(world->context, desc->channel_count, sizeof *channels);
    if (!channels) return es_context_last_result(world->context);
    float* data = es_allocate_array(world->context, total, sizeof *data);
    es_clip_object* object = data ? es_slots_add(world->context, &world->slots[ES_OBJECT_CLIP], "clip", desc->name) : NULL;
    if (!object) {
        es_release(world->context, data, total * sizeof *data);
        es_release(world->context, channels, desc->channel_count * sizeof *channels);
        return es_context_last_result(world->context);
    }
    object->channels = channels;
    object->channel_count = desc->channel_count;
    object->data = data;
    object->data_count = total;
    for (uint32_t i = 0; i < desc->channel_count; i++) {
        const es_clip_channel* from = &desc->channels[i];
        channels[i] = *from;
        channels[i].times = data;
        memcpy(data, from->times, from->key_count * sizeof *data);
        data += from->key_count;
        channels[i].values = data;
        memcpy(data, from->values, value_count(from) * sizeof *data);
        data += value_count(from);
        object->duration = es_maxf(object->duration, from->times[from->key_count - 1]);
        es_world_rereference(world, ES_OBJECT_NODE, 0, from->node.id);
    }
    clip->id = object->object.id;
    return ES_OK;
}

es_result es_world_destroy_clip(es_world* world, es_clip clip)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_clip_object* object = es_world_object(world, ES_OBJECT_CLIP, clip.id);
    if (!object) return ES_STALE_HANDLE;
    for (uint32_t i = 0; i < object->channel_count; i++) es_world_rereference(world, ES_OBJECT_NODE, object->channels[i].node.id, 0);
    free_clip(world, object);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_CLIP], &object->object);
    return ES_OK;
}

es_result es_world_play_clip(es_world* world, es_clip clip, bool play)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_clip_object* object = es_world_object(world, ES_OBJECT_CLIP, clip.id);
    if (!object) return ES_STALE_HANDLE;
    if (play && !object->playing) object->start = world->time;
    object->playing = play;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_CLIP, .id = clip.id, .flag = play});
    return ES_OK;
}

/* The value of a channel at clip time t: 3 or 4 components. */
static void sample(const es_clip_channel* channel, double t, float value[4])
{
    size_t n = components_of(channel);
    bool cubic = channel->interpolation == ES_INTERPOLATE_CUBIC_SPLINE;
    size_t stride = cubic ? 3 * n : n, middle = cubic ? n : 0;
    const float *times = channel->times, *values = channel->values;
    uint32_t low = 0, high = channel->key_count; /* the last key at or before t lies in [low, high) */
    while (high - low > 1) {
        uint32_t half = low + (high - low) / 2;
        if ((double)times[half] <= t) low = half;
        else high = half;
    }
    const float* a = values + low * stride + middle;
    if (low + 1 == channel->key_count || t <= (double)times[low] || channel->interpolation == ES_INTERPOLATE_STEP) {
        memcpy(value, a, n * sizeof *value);
        return;
    }
    const float* b = a + stride;
    float td = times[low + 1] - times[low];
    float u = (float)((t - (double)times[low]) / ((double)times[low + 1] - (double)times[low]));
    if (cubic) {
        /* appendix C.4: v(u) = (2u³−3u²+1) v_k + td (u³−2u²+u) b_k + (−2u³+3u²) v_k+1 + td (u³−u²) a_k+1, where b_k is the
         * out-tangent of the key before and a_k+1 the in-tangent of the key after */
        float u2 = u * u, u3 = u2 * u;
        float wa = 2 * u3 - 3 * u2 + 1, wb = 3 * u2 - 2 * u3, ta = td * (u3 - 2 * u2 + u), tb = td * (u3 - u2);
        const float *out = a + n, *in = b - n;
        for (size_t c = 0; c < n; c++) value[c] = (wa * a[c] + ta * out[c]) + (wb * b[c] + tb * in[c]);
    } else if (channel->path == ES_CLIP_ROTATION) {
        es_quat q = es_quat_slerp(es_quat_normalize((es_quat){a[0], a[1], a[2], a[3]}), es_quat_normalize((es_quat){b[0], b[1], b[2], b[3]}), u);
        memcpy(value, &q, sizeof q);
    } else {
        for (size_t c = 0; c < n; c++) value[c] = (1.0f - u) * a[c] + u * b[c];
    }
}

void es_clips_play(es_world* world, double time)
{
    const es_slots* slots = &world->slots[ES_OBJECT_CLIP];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_clip_object* clip = es_slots_at(slots, slot);
        if (!clip || !clip->playing) continue;
        double t = time - clip->start, duration = clip->duration;
        if (duration > __builtin_fabs(t) * 0x1p-52) { /* shorter ones have no phase that a double could hold */
            t -= duration * (double)(int64_t)(t / duration);
            if (t < 0) t += duration;
            if (t >= duration) t = 0;
        } else {
            t = 0;
        }
        for (uint32_t i = 0; i < clip->channel_count; i++) {
            const es_clip_channel* channel = &clip->channels[i];
            es_transform transform;
            if (es_world_get_node_transform(world, channel->node, &transform) != ES_OK) continue;
            float value[4];
            sample(channel, t, value);
            if (channel->path == ES_CLIP_TRANSLATION) transform.translation = es_v3(value[0], value[1], value[2]);
            else if (channel->path == ES_CLIP_SCALE) transform.scale = es_v3(value[0], value[1], value[2]);
            else transform.rotation = es_quat_normalize((es_quat){value[0], value[1], value[2], value[3]});
            es_world_set_node_transform(world, channel->node, &transform);
        }
    }
}
