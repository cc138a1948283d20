/* ThreadSanitizer makes a case thirty times slower: it is spared those that run on one thread, and those that repeat, over many lights or
 * frames, passes which other cases of the same program run on several. */
#ifndef EARTHSHINE_TESTS_RACES_H
#define EARTHSHINE_TESTS_RACES_H

static inline void es_no_new_race(void** state)
{
    (void)state;
    skip();
}

#if defined(__SANITIZE_THREAD__)
#define unit_test_without_races(test) {#test, ((void)test, es_no_new_race), NULL, NULL, NULL}
#define unit_test_without_races_setup_teardown(test, setup, teardown) unit_test_without_races(test)
#else
#define unit_test_without_races(test) cmocka_unit_test(test)
#define unit_test_without_races_setup_teardown(test, setup, teardown) cmocka_unit_test_setup_teardown(test, setup, teardown)
#endif

#endif
