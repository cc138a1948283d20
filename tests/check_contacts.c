/* The kernels of rigid contacts: every instruction set against scalar, bit for bit, over substeps of random contacts of random bodies, in all
 * of what they write: velocities, impulses and the manifolds between steps. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "platform/context.h"
#include "platform/random.h"
#include "sim/kernel_table.h"
#include "sim/rigid/solver.h"

enum { CONTACTS = 6, DYNAMIC = 2 * 8 * CONTACTS, RECORDS = DYNAMIC + 8, MANIFOLDS = 8 * CONTACTS, STILL = DYNAMIC + 1 };

static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(es_random_u32(43, counter++)); }
static es_vec3 place(float size) { return (es_vec3){uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }

typedef struct world {
    float velocity[8 * RECORDS], moved[8 * RECORDS], mass[8 * RECORDS];
    es_wide_contact contacts[CONTACTS];
    es_contact_manifold manifolds[MANIFOLDS];
} world;

/* Bodies of 2^-10 to 2^10 kg; each contact's lanes have two of their own, or one and what never moves; some lanes are not used. */
static void fill(world* w)
{
    memset(w, 0, sizeof *w);
    for (uint32_t i = 0; i < RECORDS; i++) {
        for (int k = 0; k < 3; k++) {
            w->velocity[8 * i + (size_t)k] = i < STILL ? uniform(-5, 5) : 0;
            w->velocity[8 * i + 4 + (size_t)k] = i < STILL ? uniform(-5, 5) : 0;
            w->moved[8 * i + (size_t)k] = i < STILL ? uniform(-0.01f, 0.01f) : 0;
            w->moved[8 * i + 4 + (size_t)k] = i < STILL ? uniform(-0.02f, 0.02f) : 0;
        }
        if (i >= DYNAMIC) continue;
        const float inverse = ldexpf(uniform(1, 2), (int)(es_random_u32(44, i) % 20) - 10);
        for (int k = 0; k < 3; k++) w->mass[8 * i + (size_t)k] = inverse * uniform(5, 20);
        for (int k = 3; k < 6; k++) w->mass[8 * i + (size_t)k] = inverse * uniform(-1, 1);
        w->mass[8 * i + 6] = inverse;
    }
    for (uint32_t c = 0; c < CONTACTS; c++) {
        es_wide_contact* contact = &w->contacts[c];
        contact->used = c == 1 ? 3 : 8;
        contact->bouncy = c % 2;
        contact->rolls = c % 3 == 0;
        for (uint32_t lane = 0; lane < 8; lane++) {
            const uint32_t number = 8 * c + lane;
            const bool used = lane < contact->used;
            contact->a[lane] = used ? 2 * number : STILL;
            contact->b[lane] = used && lane % 4 ? 2 * number + 1 : STILL;
            contact->manifold[lane] = used ? number : 0;
            contact->friction[lane] = uniform(0, 1);
            contact->restitution[lane] = uniform(0, 1);
            contact->rolling[lane] = uniform(0, 0.1f);
            es_contact_manifold* m = &w->manifolds[number];
            m->count = m->geometry.count = 1 + number % 4;
            if (used && m->count > contact->point_count) contact->point_count = m->count;
            es_vec3 n = place(1);
            const float length = sqrtf(n.x * n.x + n.y * n.y + n.z * n.z) + 1e-3f;
            m->geometry.normal = number % 7 ? (es_vec3){n.x / length, n.y / length, n.z / length} : (es_vec3){0, 0, number % 2 ? 1.0f : -1.0f};
            m->apart = place(1);
            m->friction = place(0.1f);
            m->twist = uniform(-0.1f, 0.1f);
            m->rolling = place(0.01f);
            for (uint32_t k = 0; k < m->count; k++) {
                m->geometry.points[k].point = place(1);
                m->geometry.points[k].separation = uniform(-0.02f, 0.01f);
                m->geometry.points[k].normal_impulse = k ? uniform(0, 2) : 0;
            }
        }
    }
}

static void run(world* w, int isa)
{
    const es_sim_kernels* kernels = es_sim_kernel_table((es_isa)isa);
    es_solver_job job = {.bodies = {.velocity = w->velocity, .moved = w->moved, .mass = w->mass, .dynamic = DYNAMIC, .count = RECORDS, .still = STILL},
        .contacts = w->contacts, .manifolds = w->manifolds, .h = 1.0f / 240, .inverse_h = 240, .up = {0, 1, 0}, .burden_scale = 0.5f};
    for (int k = 0; k < 4; k++) job.soft[k][0] = 20 + (float)k, job.soft[k][1] = 0.9f - 0.1f * (float)k, job.soft[k][2] = 0.1f + 0.1f * (float)k;
    es_fp_environment environment = es_fp_enter();
    kernels->contacts_prepare(&job, 0, CONTACTS);
    for (int substep = 0; substep < 4; substep++) {
        kernels->contacts_warm_start(&job, 0, CONTACTS);
        kernels->contacts_solve(&job, 0, CONTACTS);
        kernels->contacts_relax(&job, 0, CONTACTS / 2); /* parts of the range add up to it */
        kernels->contacts_relax(&job, CONTACTS / 2, CONTACTS);
    }
    kernels->contacts_bounce(&job, 0, CONTACTS);
    kernels->contacts_store(&job, 0, CONTACTS);
    es_fp_leave(environment);
}

static void check_contacts(void** state)
{
    (void)state;
    static world first, expected, result;
    for (int round = 0; round < 50; round++) {
        fill(&first);
        expected = first;
        run(&expected, ES_ISA_SCALAR);
        assert_memory_not_equal(expected.velocity, first.velocity, 8 * DYNAMIC * sizeof(float));
        /* what contacts may not push is not written */
        assert_memory_equal(expected.velocity + 8 * DYNAMIC, first.velocity + 8 * DYNAMIC, 8 * (RECORDS - DYNAMIC) * sizeof(float));
        for (size_t i = 0; i < 8 * DYNAMIC; i++) assert_true(fabsf(expected.velocity[i]) < 1e6f);
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            result = first;
            run(&result, isa);
            assert_memory_equal(result.velocity, expected.velocity, sizeof result.velocity);
            assert_memory_equal(result.contacts, expected.contacts, sizeof result.contacts);
            assert_memory_equal(result.manifolds, expected.manifolds, sizeof result.manifolds);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(check_contacts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
