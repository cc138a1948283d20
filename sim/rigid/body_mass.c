/* Mass and inertia of a body from its shapes. */
#include "platform/maths.h"
#include "sim/rigid/rigid.h"

/* Inverse of a symmetric matrix (xx yy zz xy xz yz) in double; false when it is not positive definite to 1e-7 of its size. */
static bool invert(const float m[6], float inverse[6])
{
    double xx = m[0], yy = m[1], zz = m[2], xy = m[3], xz = m[4], yz = m[5];
    double a = yy * zz - yz * yz, b = xz * yz - xy * zz, c = xy * yz - xz * yy;
    double d = xx * a + xy * b + xz * c, size = (xx + yy + zz) / 3;
    if (!(d > 1e-7 * size * size * size)) return false;
    double i[6] = {a / d, (xx * zz - xz * xz) / d, (xx * yy - xy * xy) / d, b / d, c / d, (xy * xz - xx * yz) / d};
    for (int k = 0; k < 6; k++) {
        if (!(__builtin_fabs(i[k]) <= 1e18)) return false;
        inverse[k] = (float)i[k];
    }
    return true;
}

/* How far from the centre of mass the body reaches, and how much of it cannot be passed through unnoticed. */
static void measure(es_body_object* body)
{
    body->reach = 0;
    body->thickness = 0;
    for (uint32_t i = 0; i < body->shape_count; i++) {
        const es_rigid_shape* shape = &body->shapes[i];
        es_vec3 low = es_v3_sub(shape->low, body->local_centre), high = es_v3_sub(shape->high, body->local_centre);
        es_vec3 far = es_v3(es_maxf(-low.x, high.x), es_maxf(-low.y, high.y), es_maxf(-low.z, high.z));
        body->reach = es_maxf(body->reach, es_v3_length(far));
        if (!shape->sensor && (body->thickness == 0 || shape->inner_radius < body->thickness)) body->thickness = shape->inner_radius;
    }
}

bool es_body_set_mass(es_world* world, es_body_object* body, float mass, const char* name)
{
    es_mass sum = {0};
    for (uint32_t i = 0; i < body->shape_count; i++) {
        if (body->shapes[i].sensor) continue;
        es_mass part = es_rigid_shape_mass(&body->shapes[i]);
        sum = es_mass_add(&sum, &part);
    }
    body->mass = body->inverse_mass = 0;
    body->local_centre = sum.mass > 0 ? sum.centre : es_v3(0, 0, 0);
    measure(body);
    if (body->type != ES_BODY_DYNAMIC) return true;
    if (!(sum.mass > 0)) {
        if (!(mass > 0)) {
            es_fail(world->context, ES_INVALID_ARGUMENT, "body '%.64s': its shapes have no volume; a dynamic body needs some, or a mass", name);
            return false;
        }
        float i = 0.4f * 0.25f * mass;
        sum = (es_mass){.mass = mass, .inertia = {i, i, i, 0, 0, 0}};
    }
    float scale = mass > 0 ? mass / sum.mass : 1.0f;
    body->mass = mass > 0 ? mass : sum.mass;
    for (int k = 0; k < 6; k++) body->inertia[k] = sum.inertia[k] * scale;
    if (!es_within(body->mass, 1e-6f, 1e9f) || !invert(body->inertia, body->inverse_inertia)) {
        es_fail(world->context, ES_INVALID_ARGUMENT, "body '%.64s': its mass is %g kg and must lie in 1e-6 … 1e9, with an inertia", name, (double)body->mass);
        return false;
    }
    body->inverse_mass = 1.0f / body->mass;
    return true;
}
