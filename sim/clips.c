/* Animation clips: keys over time, interpolated as glTF 2.0 appendix C says.
 *
 * A clip's duration is the last key time of all its channels; a channel holds its first value before its first key and its last value
 * after its last. Where a playing clip stands and what it weighs follow from the world's time and from when it was told to play, so that a
 * clip can be looked at for any time. */
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"

static const char* label(const char* name) { return name ? name : ""; }
static size_t value_count(const es_clip_channel* channel, uint32_t components)
{
    return (size_t)channel->key_count * components * (channel->interpolation == ES_INTERPOLATE_CUBIC_SPLINE ? 3 : 1);
}

static es_result check(es_world* world, const es_clip_desc* desc)
{
    es_context* context = world->context;
    const char* name = label(desc->name);
    if (desc->channel_count && !desc->channels) return es_misuse(context, ES_INVALID_ARGUMENT, "clip '%.64s': channels must not be NULL", name);
    for (uint32_t i = 0; i < desc->channel_count; i++) {
        const es_clip_channel* channel = &desc->channels[i];
        if ((uint32_t)channel->path >= ES_CLIP_PATHS || (uint32_t)channel->interpolation > ES_INTERPOLATE_CUBIC_SPLINE)
            return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u has a path or interpolation that does not exist", name, i);
        if (!es_clip_target_exists(world, channel)) return ES_STALE_HANDLE;
        uint32_t components = es_clip_components(world, channel);
        if (!components) return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u: its mesh has no morph targets", name, i);
        if (channel->key_count < 1 || channel->key_count > 1u << 24 || !channel->times || !channel->values)
            return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u must have 1 … 2^24 keys with times and values", name, i);
        for (uint32_t k = 0; k < channel->key_count; k++)
            if (!es_within(channel->times[k], 0, 1e6f) || (k > 0 && channel->times[k] <= channel->times[k - 1]))
                return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u, key %u: times must increase, within 0 … 1e6 seconds", name, i, k);
        if (!es_all_within(channel->values, value_count(channel, components), ES_WORLD_EXTENT))
            return es_fail(context, ES_INVALID_ARGUMENT, "clip '%.64s': channel %u: values must be finite and within 1e9", name, i);
    }
    return ES_OK;
}

static void free_clip(es_world* world, es_clip_object* clip)
{
    es_release(world->context, clip->tracks, clip->track_count * sizeof *clip->tracks);
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
    for (uint32_t i = 0; i < desc->channel_count; i++)
        total += desc->channels[i].key_count + value_count(&desc->channels[i], es_clip_components(world, &desc->channels[i]));
    es_clip_track* tracks = es_allocate_array(world->context, desc->channel_count, sizeof *tracks);
    if (!tracks) return es_context_last_result(world->context);
    float* data = es_allocate_array(world->context, total, sizeof *data);
    es_clip_object* object = data ? es_slots_add(world->context, &world->slots[ES_OBJECT_CLIP], "clip", desc->name) : NULL;
    if (!object) {
        es_release(world->context, data, total * sizeof *data);
        es_release(world->context, tracks, desc->channel_count * sizeof *tracks);
        return es_context_last_result(world->context);
    }
    object->tracks = tracks;
    object->track_count = desc->channel_count;
    object->data = data;
    object->data_count = total;
    object->play = (es_clip_playing){.speed = 1, .from = 1, .to = 1};
    for (uint32_t i = 0; i < desc->channel_count; i++) {
        const es_clip_channel* from = &desc->channels[i];
        tracks[i] = (es_clip_track){*from, es_clip_components(world, from)};
        size_t values = value_count(from, tracks[i].components);
        tracks[i].channel.times = data;
        memcpy(data, from->times, from->key_count * sizeof *data);
        data += from->key_count;
        tracks[i].channel.values = data;
        memcpy(data, from->values, values * sizeof *data);
        data += values;
        object->duration = es_maxf(object->duration, from->times[from->key_count - 1]);
        es_clip_hold_target(world, from, true);
    }
    clip->id = object->object.id;
    return ES_OK;
}

es_result es_world_destroy_clip(es_world* world, es_clip clip)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_clip_object* object = es_world_object(world, ES_OBJECT_CLIP, clip.id);
    if (!object) return ES_STALE_HANDLE;
    for (uint32_t i = 0; i < object->track_count; i++) es_clip_hold_target(world, &object->tracks[i].channel, false);
    free_clip(world, object);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_CLIP], &object->object);
    return ES_OK;
}

/* ---- playing --------------------------------------------------------------------------------------------------------------------- */

static bool faded(const es_clip_playing* play, double time) { return time - play->fade_start >= (double)play->fade; }

static float weight_at(const es_clip_playing* play, double time)
{
    if (faded(play, time)) return play->to;
    double passed = time - play->fade_start;
    if (passed <= 0) return play->from;
    float share = (float)(passed / (double)play->fade);
    return (1.0f - share) * play->from + share * play->to;
}

/* Where in the clip it stands. */
static double phase_at(const es_clip_object* clip, double time)
{
    double t = (time - clip->play.start) * (double)clip->play.speed + clip->play.offset, duration = clip->duration;
    if (clip->play.once) return t < 0 ? 0 : t > duration ? duration : t;
    if (!(duration > __builtin_fabs(t) * 0x1p-52)) return 0; /* shorter ones have no phase that a double could hold */
    t -= duration * (double)(int64_t)(t / duration);
    if (t < 0) t += duration;
    return t >= duration ? 0 : t;
}

es_clip_play es_default_clip_play(void) { return (es_clip_play){.weight = 1, .speed = 1, .start = -1}; }

es_result es_world_play_clip_with(es_world* world, es_clip clip, const es_clip_play* how)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_clip_object* object = es_world_object(world, ES_OBJECT_CLIP, clip.id);
    if (!object) return ES_STALE_HANDLE;
    es_clip_play play = how ? *how : es_default_clip_play();
    const char* wrong = !es_within(play.weight, 0, 1000)   ? "its weight must lie in 0 … 1000"
                        : !es_within(play.speed, -100, 100) ? "its speed must lie in -100 … 100"
                        : !es_within(play.start, -1e6f, 1e6f) ? "its start must lie within 1e6 seconds"
                        : !es_within(play.fade, 0, 1e6f)    ? "its fade must lie in 0 … 1e6 seconds"
                                                            : NULL;
    if (wrong) return es_fail(world->context, ES_INVALID_ARGUMENT, "clip '%.64s': %s", label(object->object.name), wrong);
    es_fp_environment environment = es_fp_enter();
    double phase = play.start >= 0 ? (double)play.start : object->playing ? phase_at(object, world->time) : play.speed < 0 ? (double)object->duration : 0;
    es_clip_playing next = {.start = world->time, .offset = phase, .speed = play.speed, .once = play.once, .to = play.weight, .fade_start = world->time, .fade = play.fade};
    next.from = play.fade == 0 ? play.weight : object->playing ? weight_at(&object->play, world->time) : 0;
    es_fp_leave(environment);
    object->play = next;
    object->playing = true;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_PLAY_CLIP, .id = clip.id, .clip = play});
    return ES_OK;
}

es_result es_world_play_clip(es_world* world, es_clip clip, bool play)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_clip_object* object = es_world_object(world, ES_OBJECT_CLIP, clip.id);
    if (!object) return ES_STALE_HANDLE;
    if (play && !object->playing) return es_world_play_clip_with(world, clip, NULL);
    object->playing = play;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_CLIP, .id = clip.id, .flag = play});
    return ES_OK;
}

es_result es_world_stop_clip(es_world* world, es_clip clip, float fade)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_clip_object* object = es_world_object(world, ES_OBJECT_CLIP, clip.id);
    if (!object) return ES_STALE_HANDLE;
    if (!es_within(fade, 0, 1e6f)) return es_fail(world->context, ES_INVALID_ARGUMENT, "clip '%.64s': its fade must lie in 0 … 1e6 seconds", label(object->object.name));
    if (!object->playing) return ES_OK;
    es_fp_environment environment = es_fp_enter();
    object->play.from = weight_at(&object->play, world->time);
    es_fp_leave(environment);
    object->play.to = 0;
    object->play.fade_start = world->time;
    object->play.fade = fade;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_STOP_CLIP, .id = clip.id, .number = fade});
    return ES_OK;
}

es_result es_world_get_clip(const es_world* world, es_clip clip, es_clip_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    const es_clip_object* object = es_world_object(world, ES_OBJECT_CLIP, clip.id);
    if (!object) return ES_STALE_HANDLE;
    const es_clip_playing* play = &object->play;
    *state = (es_clip_state){
        .playing = object->playing,
        .once = play->once,
        .weight = object->playing ? weight_at(play, world->time) : 0,
        .target_weight = object->playing ? play->to : 0,
        .speed = play->speed,
        .time = object->playing ? phase_at(object, world->time) : 0,
        .duration = object->duration,
        .channel_count = object->track_count,
    };
    return ES_OK;
}

bool es_clip_playing_valid(const es_clip_playing* p)
{
    return p->start >= -1e12 && p->start <= 1e12 && p->offset >= -1e12 && p->offset <= 1e12 && p->fade_start >= -1e12 && p->fade_start <= 1e12 && es_within(p->speed, -100, 100) &&
           es_within(p->from, 0, 1000) && es_within(p->to, 0, 1000) && es_within(p->fade, 0, 1e6f);
}

/* ---- values ---------------------------------------------------------------------------------------------------------------------- */

es_clip_segment es_clip_find(const es_clip_track* track, double t)
{
    const es_clip_channel* channel = &track->channel;
    const float* times = channel->times;
    uint32_t low = 0, high = channel->key_count; /* the last key at or before t lies in [low, high) */
    while (high - low > 1) {
        uint32_t half = low + (high - low) / 2;
        if ((double)times[half] <= t) low = half;
        else high = half;
    }
    es_clip_segment segment = {.key = low, .hold = low + 1 == channel->key_count || t <= (double)times[low] || channel->interpolation == ES_INTERPOLATE_STEP};
    if (segment.hold) return segment;
    segment.length = times[low + 1] - times[low];
    segment.u = (float)((t - (double)times[low]) / ((double)times[low + 1] - (double)times[low]));
    return segment;
}

void es_clip_value(const es_clip_track* track, const es_clip_segment* segment, uint32_t first, uint32_t count, float* value)
{
    const es_clip_channel* channel = &track->channel;
    const size_t n = track->components;
    bool cubic = channel->interpolation == ES_INTERPOLATE_CUBIC_SPLINE;
    size_t stride = cubic ? 3 * n : n, middle = cubic ? n : 0;
    const float* a = channel->values + segment->key * stride + middle + first;
    if (segment->hold) {
        memcpy(value, a, count * sizeof *value);
        return;
    }
    const float *b = a + stride, u = segment->u, td = segment->length;
    if (cubic) {
        /* appendix C.4: v(u) = (2u³−3u²+1) v_k + td (u³−2u²+u) b_k + (−2u³+3u²) v_k+1 + td (u³−u²) a_k+1, where b_k is the
         * out-tangent of the key before and a_k+1 the in-tangent of the key after */
        float u2 = u * u, u3 = u2 * u;
        float wa = 2 * u3 - 3 * u2 + 1, wb = 3 * u2 - 2 * u3, ta = td * (u3 - 2 * u2 + u), tb = td * (u3 - u2);
        const float *out = a + n, *in = b - n;
        for (size_t c = 0; c < count; c++) value[c] = (wa * a[c] + ta * out[c]) + (wb * b[c] + tb * in[c]);
    } else if (channel->path == ES_CLIP_ROTATION) {
        es_quat q = es_quat_slerp(es_quat_normalize((es_quat){a[0], a[1], a[2], a[3]}), es_quat_normalize((es_quat){b[0], b[1], b[2], b[3]}), u);
        memcpy(value, &q, sizeof q);
    } else {
        for (size_t c = 0; c < count; c++) value[c] = (1.0f - u) * a[c] + u * b[c];
    }
}

void es_clips_play(es_world* world, double time)
{
    const es_slots* slots = &world->slots[ES_OBJECT_CLIP];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_clip_object* clip = es_slots_at(slots, slot);
        if (!clip || !clip->playing) continue;
        float weight = weight_at(&clip->play, time);
        double t = phase_at(clip, time);
        for (uint32_t i = 0; i < clip->track_count; i++) es_clip_add_value(world, &clip->tracks[i], t, weight);
    }
    /* each target once, at its first channel: what was added up is used up by it */
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_clip_object* clip = es_slots_at(slots, slot);
        for (uint32_t i = 0; clip && clip->playing && i < clip->track_count; i++) es_clip_apply(world, &clip->tracks[i].channel);
    }
}

void es_clips_retire(es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_CLIP];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_clip_object* clip = es_slots_at(slots, slot);
        if (clip && clip->playing && clip->play.to == 0 && faded(&clip->play, world->time)) clip->playing = false;
    }
}
