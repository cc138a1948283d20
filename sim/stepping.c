/* Time: a frame is as long as its caller says, bodies and cloth step by a fixed one.
 *
 * The dynamics stand at fixed_base + fixed_count × step, the first such time at or after the world's own; what is shown lies between
 * their last two states. Counting instead of adding keeps the steps where they are however time is cut into frames. */
#include "sim/dynamics.h"
#include "sim/recording.h"

#include "platform/context.h"

double es_fixed_time(const es_world* world) { return world->fixed_base + (double)world->fixed_count * (double)world->settings.step; }

/* Sums of a frame's dt differ from multiples of the step by rounding; a step is not made for that little. */
static double tolerance(const es_world* world) { return 1e-4 * (double)world->settings.step; }

bool es_dynamics_present(const es_world* world)
{
    return world->slots[ES_OBJECT_BODY].live > 0 || world->slots[ES_OBJECT_SOFT].live > 0;
}

/* What bodies stand on and cloth hangs from is taken to where it is at the step's end. */
static void pose_at(es_world* world, double time)
{
    es_clips_play(world, time);
    es_movers_play(world, time);
}

static es_result fixed_step(es_world* world)
{
    world->fixed_count++;
    pose_at(world, es_fixed_time(world));
    es_nodes_refresh(world);
    es_result result = es_rigid_step(world, world->settings.step, world->settings.substeps);
    if (result == ES_OK) return es_soft_step(world, world->settings.step, world->settings.substeps);
    world->fixed_count--; /* bodies are as they were: the next call makes the step */
    return result;
}

float es_step_phase(const es_world* world)
{
    double ahead = es_fixed_time(world) - world->time;
    if (!world->settings.interpolate || ahead <= tolerance(world)) return 1.0f;
    double share = 1.0 - ahead / (double)world->settings.step;
    return share > 0 ? (float)share : 0.0f;
}

static es_result advance(es_world* world)
{
    double step = (double)world->settings.step, left = world->time - tolerance(world) - es_fixed_time(world);
    es_rigid_begin_frame(world);
    if (!es_dynamics_present(world)) {
        if (left > 0) world->fixed_count += (uint64_t)(left / step) + 1;
        return ES_OK;
    }
    while (es_fixed_time(world) < world->time - tolerance(world)) {
        es_result result = fixed_step(world);
        if (result != ES_OK) return result;
    }
    return ES_OK;
}

es_result es_world_step(es_world* world, float dt)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (world->in_step) return es_misuse(world->context, ES_WRONG_STATE, "es_world_step: called from a step function");
    if (!es_within(dt, 0, 10)) return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_step: dt is %g; it must lie in 0 … 10 seconds", (double)dt);
    es_world_settle(world);
    world->stepped = true;
    world->revisions.steps++;
    double seconds = (double)dt * (double)world->settings.speed;
    es_result result = ES_OK;
    if (seconds > 0) {
        world->time += seconds;
        world->in_step = true;
        es_fp_environment environment = es_fp_enter();
        result = advance(world);
        pose_at(world, world->time);
        es_sky_refresh(world);
        es_clips_retire(world);
        es_nodes_refresh(world); /* what bodies' nodes are below */
        es_rigid_pose(world, es_step_phase(world));
        if (result == ES_OK) result = es_soft_pose(world, es_step_phase(world));
        es_fp_leave(environment);
        if (world->step_function) world->step_function(world, world->step_user, world->time, (float)seconds);
        world->in_step = false;
    }
    es_world_refresh(world);
    if (world->recording) es_recording_note_step(world, dt);
    return result;
}
