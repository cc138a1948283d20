/* The part of cmocka's interface that the tests use, for cross builds: a Debian machine has cmocka for its own processor
 * only, and the kernels must be checked on the other one too. Same names, same meaning; no mocks, no memory checks. */
#ifndef EARTHSHINE_TESTS_WITHOUT_CMOCKA_H
#define EARTHSHINE_TESTS_WITHOUT_CMOCKA_H

#include <inttypes.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef int (*CMFixtureFunction)(void** state);
struct CMUnitTest {
    const char* name;
    void (*test_func)(void** state);
    CMFixtureFunction setup_func, teardown_func;
    void* initial_state;
};

#define cmocka_unit_test(f) {#f, f, NULL, NULL, NULL}
#define cmocka_unit_test_setup(f, setup) {#f, f, setup, NULL, NULL}
#define cmocka_unit_test_teardown(f, teardown) {#f, f, NULL, teardown, NULL}
#define cmocka_unit_test_setup_teardown(f, setup, teardown) {#f, f, setup, teardown, NULL}
#define cmocka_unit_test_prestate(f, state) {#f, f, NULL, NULL, state}
#define cmocka_unit_test_prestate_setup_teardown(f, setup, teardown, state) {#f, f, setup, teardown, state}

/* One test runs at a time: where to go when it ends early, 1 for failed and 2 for skipped. */
static jmp_buf cm_test_end;

#define print_message printf
#define print_error(...) fprintf(stderr, __VA_ARGS__)
#define cm_fail(...) (fprintf(stderr, "%s:%d: ", __FILE__, __LINE__), fprintf(stderr, __VA_ARGS__), fputc('\n', stderr), longjmp(cm_test_end, 1))
#define fail() cm_fail("failed")
#define fail_msg(...) cm_fail(__VA_ARGS__)
#define skip() longjmp(cm_test_end, 2)

#define assert_true(a) ((a) ? (void)0 : cm_fail("not true: %s", #a))
#define assert_false(a) (!(a) ? (void)0 : cm_fail("not false: %s", #a))
#define assert_non_null(a) ((a) != NULL ? (void)0 : cm_fail("null: %s", #a))
#define assert_null(a) ((a) == NULL ? (void)0 : cm_fail("not null: %s", #a))
#define assert_ptr_equal(a, b) ((const void*)(a) == (const void*)(b) ? (void)0 : cm_fail("%s is not %s", #a, #b))
#define assert_ptr_not_equal(a, b) ((const void*)(a) != (const void*)(b) ? (void)0 : cm_fail("%s is %s", #a, #b))
#define cm_bits(a) ((uintmax_t)(a))
#define assert_int_equal(a, b) \
    (cm_bits(a) == cm_bits(b) ? (void)0 : cm_fail("%s: %jd is not %s: %jd", #a, (intmax_t)cm_bits(a), #b, (intmax_t)cm_bits(b)))
#define assert_int_not_equal(a, b) (cm_bits(a) != cm_bits(b) ? (void)0 : cm_fail("%s is %s: %jd", #a, #b, (intmax_t)cm_bits(a)))
#define assert_float_equal(a, b, within) (cm_near(a, b, within) ? (void)0 : cm_fail("%s: %g is not %s: %g", #a, (double)(a), #b, (double)(b)))
#define assert_double_equal assert_float_equal
#define assert_string_equal(a, b) (strcmp(a, b) == 0 ? (void)0 : cm_fail("\"%s\" is not \"%s\"", a, b))
#define assert_string_not_equal(a, b) (strcmp(a, b) != 0 ? (void)0 : cm_fail("both are \"%s\"", a))
#define assert_memory_equal(a, b, size) (memcmp(a, b, size) == 0 ? (void)0 : cm_fail("%s differs from %s", #a, #b))
#define assert_memory_not_equal(a, b, size) (memcmp(a, b, size) != 0 ? (void)0 : cm_fail("%s equals %s", #a, #b))
#define assert_in_range(a, low, high) \
    (cm_bits(a) >= cm_bits(low) && cm_bits(a) <= cm_bits(high) ? (void)0 : cm_fail("%s: %ju is not in its range", #a, cm_bits(a)))
#define assert_return_code(a, error) ((a) >= 0 ? (void)0 : cm_fail("%s failed", #a))

static inline int cm_near(double a, double b, double within)
{
    double difference = a < b ? b - a : a - b;
    return difference <= within;
}

static inline int cm_run_tests(const char* group, const struct CMUnitTest* tests, size_t count, CMFixtureFunction setup, CMFixtureFunction teardown)
{
    void* group_state = NULL;
    int failed = 0;
    if (setup && setup(&group_state) != 0) {
        fprintf(stderr, "%s: the setup failed\n", group);
        return (int)count;
    }
    for (size_t i = 0; i < count; i++) {
        void* volatile state = tests[i].initial_state ? tests[i].initial_state : group_state;
        void* current = state;
        int outcome = 1;
        if (!tests[i].setup_func || tests[i].setup_func(&current) == 0) {
            state = current;
            outcome = setjmp(cm_test_end);
            if (outcome == 0) {
                void* given = state;
                tests[i].test_func(&given);
            }
            current = state;
            if (tests[i].teardown_func && tests[i].teardown_func(&current) != 0) outcome = 1;
        }
        printf("%s %s\n", outcome == 0 ? "passed" : outcome == 2 ? "skipped" : "FAILED", tests[i].name);
        failed += outcome == 1;
    }
    if (teardown && teardown(&group_state) != 0) failed++;
    return failed;
}

#define cmocka_run_group_tests(tests, setup, teardown) cm_run_tests(#tests, tests, sizeof(tests) / sizeof((tests)[0]), setup, teardown)
#define cmocka_run_group_tests_name(name, tests, setup, teardown) cm_run_tests(name, tests, sizeof(tests) / sizeof((tests)[0]), setup, teardown)

#endif
