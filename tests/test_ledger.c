/* The arithmetic of `earthshine bench ledger` on pictures whose parts are known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>
#include <math.h>

#include "demos/ledger_split.h"
#include "platform/random.h"

enum { FLOATS = 6000 };

static float reference[FLOATS], method[FLOATS];

static float random_value(uint32_t stream, size_t k) { return es_unit_float(es_hash_u32((uint32_t)k * 0x9e3779b9u ^ es_hash_u32(stream))) - 0.5f; }

static void assert_near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%.9g, expected %.9g", value, expected);
}

/* ---- shares ----------------------------------------------------------------------------------------------------------------------------- */

static float part_a[FLOATS], part_b[FLOATS], part_c[FLOATS];

/* The parts overlap nowhere, and something is left over: shares are those of the squares, and gains the same. */
static void test_separate_parts(void** state)
{
    static float none[FLOATS];
    for (size_t k = 0; k < FLOATS; k++) {
        part_a[k] = k % 4 == 0 ? 0.3f : 0.0f;
        part_b[k] = k % 4 == 1 ? (k % 8 == 1 ? 0.4f : -0.4f) : 0.0f;
        reference[k] = 2.0f + random_value(1, k);
        method[k] = reference[k] + part_a[k] + part_b[k] + (k % 4 == 2 ? 0.1f : 0.0f);
    }
    ledger_picture m = {{method, method}}, r = {{reference, reference}};
    ledger_picture d[] = {{{part_a, part_a}}, {{part_b, part_b}}, {{none, none}}}, lost[] = {{{part_a, part_a}}, {{part_b, part_b}}, {{none, none}}};
    ledger_sums sums = {0};
    for (int twice = 0; twice < 2; twice++) ledger_add(&sums, &m, &r, d, lost, 3, NULL, FLOATS); /* sums of two pictures alike are of one */
    const double squares = 0.09 + 0.16 + 0.01, mean = sums.reference / sums.values;
    assert_int_equal(sums.part_count, 4);
    assert_near(ledger_total(&sums), sqrt(squares / 4) / mean, 1e-6);
    assert_near(mean, 2, 0.02);
    assert_near(ledger_noise(&sums), 0, 0);
    static const double expected[] = {0.09, 0.16, 0, 0.01};
    for (size_t i = 0; i < 4; i++) {
        assert_near(ledger_share(&sums, i), 100 * expected[i] / squares, 1e-3);
        assert_near(ledger_share_noise(&sums, i), 0, 1e-9);
        assert_near(ledger_own(&sums, i), sqrt(expected[i] / 4) / mean, 1e-6);
        if (i < 3) assert_near(ledger_gain(&sums, i), 100 * expected[i] / squares, 1e-3);
    }
    assert_true(isnan(ledger_gain(&sums, 3)));
    assert_near(ledger_gains_missing(&sums), 100 * 0.01 / squares, 1e-3);
    assert_int_equal(ledger_costliest(&sums), 1);
    assert_near(ledger_share(&sums, 2), 0, 0); /* a cause of nothing: zero to the last bit */
    assert_near(ledger_own(&sums, 2), 0, 0);
    assert_near(ledger_gain(&sums, 2), 0, 0);
}

/* Half of what one cause does is hidden by another: the shares are 200 % and -100 %, and fixing the second alone makes it four times worse. */
static void test_cancelling_parts(void** state)
{
    for (size_t k = 0; k < FLOATS; k++) {
        part_a[k] = random_value(2, k);
        part_b[k] = -0.5f * part_a[k];
        reference[k] = 1.0f;
        method[k] = reference[k] + part_a[k] + part_b[k];
    }
    ledger_picture m = {{method, method}}, r = {{reference, reference}}, d[] = {{{part_a, part_a}}, {{part_b, part_b}}};
    ledger_sums sums = {0};
    ledger_add(&sums, &m, &r, d, d, 2, NULL, FLOATS);
    assert_near(ledger_share(&sums, 0), 200, 1e-3);
    assert_near(ledger_share(&sums, 1), -100, 1e-3);
    assert_near(ledger_share(&sums, 2), 0, 1e-3);
    assert_near(ledger_gain(&sums, 0), 0, 1e-3);
    assert_near(ledger_gain(&sums, 1), -300, 1e-3);
    assert_near(ledger_gains_missing(&sums), 400, 1e-2);
    assert_int_equal(ledger_costliest(&sums), 0);
}

/* Whatever the pictures, shares with the rest sum to a hundred. */
static void test_shares_sum(void** state)
{
    static float other[FLOATS], half[FLOATS];
    for (size_t k = 0; k < FLOATS; k++) {
        part_a[k] = random_value(3, k);
        part_b[k] = random_value(4, k) + 0.7f * part_a[k];
        part_c[k] = random_value(5, k);
        other[k] = part_c[k] + 0.1f * random_value(6, k);
        reference[k] = 1.5f + random_value(7, k);
        half[k] = reference[k] + 0.2f * random_value(8, k);
        method[k] = 1.5f + random_value(9, k);
    }
    ledger_picture m = {{method, method}}, r = {{reference, half}}, d[] = {{{part_a, part_a}}, {{part_b, part_b}}, {{part_c, other}}}, none[3] = {0};
    ledger_sums sums = {0};
    ledger_add(&sums, &m, &r, d, none, 3, NULL, FLOATS);
    double sum = 0;
    for (size_t i = 0; i < 4; i++) sum += ledger_share(&sums, i);
    assert_near(sum, 100, 1e-9);
    assert_true(fabs(ledger_share(&sums, 3)) > 5);
    assert_near(ledger_gains_missing(&sums), 100, 0); /* nothing was switched */
}

/* The noise of a reference is no error of the method: with halves the total is the true one, where the mean of both would add the noise. */
static void test_noise_of_the_reference(void** state)
{
    enum { REPEATS = 40 };
    static float halves[2][FLOATS];
    ledger_sums sums = {0};
    double naive = 0;
    for (uint32_t repeat = 0; repeat < REPEATS; repeat++) {
        for (size_t k = 0; k < FLOATS; k++) {
            part_a[k] = 0.05f;
            part_b[k] = k % 2 ? 0.03f : -0.03f;
            method[k] = 1.0f + part_a[k] + part_b[k];
            for (uint32_t h = 0; h < 2; h++) halves[h][k] = 1.0f + random_value(100 + 2 * repeat + h, k);
            double d = (double)method[k] - ((double)halves[0][k] + (double)halves[1][k]) / 2;
            naive += d * d;
        }
        ledger_picture m = {{method, method}}, r = {{halves[0], halves[1]}}, d[] = {{{part_a, part_a}}, {{part_b, part_b}}};
        ledger_add(&sums, &m, &r, d, d, 2, NULL, FLOATS);
    }
    /* a half's variance is 1/12, that of their mean 1/24; a product of halves has the standard deviation 1/12 */
    const double truth = 0.05 * 0.05 + 0.03 * 0.03, sure = 4 * (1.0 / 12) / sqrt((double)REPEATS * FLOATS);
    assert_near(sums.total / sums.values, truth, sure);
    assert_near(naive / sums.values, truth + 1.0 / 24, 1e-3);
    assert_near(ledger_noise(&sums), sqrt(1.0 / 24), 1e-3);
    assert_near(ledger_share(&sums, 0), 100 * 0.0025 / truth, 100 * sure / truth);
    assert_near(ledger_share(&sums, 1), 100 * 0.0009 / truth, 100 * sure / truth);
    assert_near(ledger_share(&sums, 2), 0, 100 * sure / truth);
    assert_true(ledger_share_noise(&sums, 0) > 0);
}

/* What has no weight is not there; what has more counts as if it were there more often. */
static void test_weights(void** state)
{
    static float weights[FLOATS];
    for (size_t k = 0; k < FLOATS; k++) {
        weights[k] = k % 3 == 0 ? 0.0f : k % 3 == 1 ? 1.0f : 3.0f;
        part_a[k] = k % 3 == 0 ? 100.0f : k % 3 == 1 ? 0.2f : 0.0f;
        part_b[k] = k % 3 == 2 ? 0.1f : 0.0f;
        reference[k] = 1.0f;
        method[k] = reference[k] + part_a[k] + part_b[k];
    }
    ledger_picture m = {{method, method}}, r = {{reference, reference}}, d[] = {{{part_a, part_a}}, {{part_b, part_b}}};
    ledger_sums sums = {0};
    ledger_add(&sums, &m, &r, d, d, 2, weights, FLOATS);
    const double squares = 0.04 + 3 * 0.01;
    assert_near(ledger_total(&sums), sqrt(squares / 3), 1e-6);
    assert_near(ledger_share(&sums, 0), 100 * 0.04 / squares, 1e-4);
    assert_near(ledger_own(&sums, 1), sqrt(0.03 / 3), 1e-6);
    assert_near(ledger_gain(&sums, 1), 100 * 0.03 / squares, 1e-4);
}

/* A half that is four times as bright: there an error of four times the size counts about as much. */
static void test_relative_weights(void** state)
{
    enum { WIDTH = 50, HEIGHT = 40, CHANNELS = 3 };
    static float weights[WIDTH * HEIGHT * CHANNELS];
    for (size_t k = 0; k < WIDTH * HEIGHT * CHANNELS; k++) reference[k] = k / CHANNELS % WIDTH < WIDTH / 2 ? 0.4f : 1.6f;
    ledger_picture r = {{reference, reference}};
    ledger_relative_weights(&r, WIDTH, HEIGHT, CHANNELS, weights);
    for (size_t y = 0; y < HEIGHT; y++)
        for (size_t c = 0; c < CHANNELS; c++) {
            assert_near((double)weights[(y * WIDTH + 3) * CHANNELS + c], 1 / (0.16 + 0.1), 1e-4);
            assert_near((double)weights[(y * WIDTH + WIDTH - 1) * CHANNELS + c], 1 / (2.56 + 0.1), 1e-4);
            assert_near((double)weights[(y * WIDTH + WIDTH / 2) * CHANNELS + c], 1 / (1.12 * 1.12 + 0.1), 1e-4); /* two columns of five are dark */
        }
}

/* ---- orders ----------------------------------------------------------------------------------------------------------------------------- */

enum { CAUSES = 4, SETS = 1 << CAUSES };
static float pictures[SETS][2][FLOATS], found[CAUSES][2][FLOATS];

static void average(uint32_t causes)
{
    ledger_picture of_sets[SETS];
    float* parts[CAUSES][2];
    for (uint32_t s = 0; s < SETS; s++)
        for (int h = 0; h < 2; h++) of_sets[s].half[h] = pictures[s][h];
    for (uint32_t i = 0; i < CAUSES; i++)
        for (int h = 0; h < 2; h++) parts[i][h] = found[i][h];
    ledger_average_orders(of_sets, causes, FLOATS, parts);
}

/* Causes that do not act on each other: their parts are what they were made of, in both halves. */
static void test_orders_of_independent_causes(void** state)
{
    for (uint32_t s = 0; s < SETS; s++)
        for (uint32_t h = 0; h < 2; h++)
            for (size_t k = 0; k < FLOATS; k++) {
                pictures[s][h][k] = 1;
                for (uint32_t i = 0; i < CAUSES; i++)
                    if (!(s >> i & 1)) pictures[s][h][k] += random_value(10 * i + h, k);
            }
    average(CAUSES);
    for (uint32_t i = 0; i < CAUSES; i++)
        for (uint32_t h = 0; h < 2; h++)
            for (size_t k = 0; k < FLOATS; k++) assert_near((double)found[i][h][k], (double)random_value(10 * i + h, k), 2e-6);
}

/* Causes that act on each other: against the mean over all orders written out; parts sum to the whole; causes 0 and 1 are alike. */
static void test_orders_of_dependent_causes(void** state)
{
    for (uint32_t s = 0; s < SETS; s++)
        for (size_t k = 0; k < FLOATS; k++) {
            /* nothing in it tells 0 from 1 */
            uint32_t alike = (s & ~3u) | ((s & 3) == 2 ? 1 : s & 3);
            pictures[s][0][k] = pictures[s][1][k] = random_value(200 + alike, k);
        }
    average(CAUSES);
    for (size_t k = 0; k < FLOATS; k += 37) {
        double mean[CAUSES] = {0}, sum = 0;
        int orders = 0;
        for (uint32_t code = 0; code < CAUSES * CAUSES * CAUSES * CAUSES; code++) {
            uint32_t set = 0, order[CAUSES];
            for (uint32_t i = 0, rest = code; i < CAUSES; i++, rest /= CAUSES) {
                order[i] = rest % CAUSES;
                set |= 1u << order[i];
            }
            if (set != SETS - 1) continue; /* not a permutation */
            orders++;
            set = 0;
            for (uint32_t i = 0; i < CAUSES; i++) {
                mean[order[i]] += (double)pictures[set][0][k] - (double)pictures[set | 1u << order[i]][0][k];
                set |= 1u << order[i];
            }
        }
        assert_int_equal(orders, 24);
        for (uint32_t i = 0; i < CAUSES; i++) {
            assert_near((double)found[i][0][k], mean[i] / orders, 1e-6);
            sum += (double)found[i][0][k];
        }
        assert_near(sum, (double)pictures[0][0][k] - (double)pictures[SETS - 1][0][k], 1e-6);
        assert_near((double)found[0][0][k], (double)found[1][0][k], 1e-6);
        assert_near((double)found[2][1][k], (double)found[2][0][k], 0);
    }
}

/* A cause that nothing depends on has no part, to the last bit or nearly; fewer causes use the first pictures alone. */
static void test_order_of_an_idle_cause(void** state)
{
    for (uint32_t s = 0; s < SETS; s++)
        for (int h = 0; h < 2; h++)
            for (size_t k = 0; k < FLOATS; k++) pictures[s][h][k] = s < 8 ? random_value(300 + (s & 5), k) : NAN;
    average(3);
    for (size_t k = 0; k < FLOATS; k++) assert_near((double)found[1][0][k], 0, 1e-7);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_separate_parts),
        cmocka_unit_test(test_cancelling_parts),
        cmocka_unit_test(test_shares_sum),
        cmocka_unit_test(test_noise_of_the_reference),
        cmocka_unit_test(test_weights),
        cmocka_unit_test(test_relative_weights),
        cmocka_unit_test(test_orders_of_independent_causes),
        cmocka_unit_test(test_orders_of_dependent_causes),
        cmocka_unit_test(test_order_of_an_idle_cause),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
