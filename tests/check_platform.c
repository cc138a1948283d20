/* The platform floor: kernels of every instruction set against scalar, elementary functions against libm, random numbers,
 * linear algebra, contexts, threads.
 *
 * check_platform --time prints nanoseconds per element of every kernel and instruction set instead. */
#include <fenv.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <dirent.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

#include <cmocka.h>

#include "platform/context.h"
#include "platform/kernel_table.h"
#include "platform/maths.h"
#include "platform/random.h"

static float from_bits(uint32_t bits)
{
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}
static uint32_t to_bits(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

/* ---- helpers: a context whose log is kept ------------------------------------------------------------------------ */

typedef struct log_record {
    atomic_int count, errors, warnings;
    es_result last;
    char message[1100];
} log_record;

static void record(void* user, es_log_level level, es_result item, const char* message)
{
    log_record* r = user;
    r->count++;
    if (level == ES_LOG_ERROR) r->errors++;
    if (level == ES_LOG_WARNING) r->warnings++;
    r->last = item;
    snprintf(r->message, sizeof r->message, "%s", message);
}

static es_context* new_context(es_context_desc desc, log_record* log)
{
    memset(log, 0, sizeof *log);
    desc.logger = (es_logger){record, log};
    es_context* context = NULL;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    assert_non_null(context);
    return context;
}

static int thread_count(void)
{
    int count = 0;
    DIR* folder = opendir("/proc/self/task");
    if (!folder) return -1;
    for (struct dirent* entry; (entry = readdir(folder));) count += entry->d_name[0] != '.';
    closedir(folder);
    return count;
}

/* ---- results, context ----------------------------------------------------------------------------------------------- */

static void test_result_names(void** state)
{
    (void)state;
    assert_string_equal(es_result_name(ES_OK), "OK");
    assert_string_equal(es_result_name(ES_FILE_DAMAGED), "FILE_DAMAGED");
    assert_string_equal(es_result_name(ES_RESULT_COUNT), "?");
    assert_string_equal(es_result_name((es_result)-1), "?");
    for (int i = 0; i < ES_RESULT_COUNT; i++) {
        assert_true(strlen(es_result_name((es_result)i)) > 1);
        assert_true(strlen(es_result_text((es_result)i)) > 5);
    }
}

static void test_isa_names(void** state)
{
    (void)state;
    for (int i = 0; i < ES_ISA_COUNT; i++) {
        es_isa isa = ES_ISA_COUNT;
        assert_true(es_isa_from_name(es_isa_name((es_isa)i), &isa));
        assert_int_equal(isa, i);
    }
    es_isa isa = ES_ISA_NEON;
    assert_false(es_isa_from_name("mmx", &isa));
    assert_false(es_isa_from_name(NULL, &isa));
    assert_int_equal(isa, ES_ISA_NEON);
    assert_true(es_isa_available_mask() & 1u << ES_ISA_SCALAR);
    for (int i = 0; i < ES_ISA_COUNT; i++) {
        if (es_isa_available_mask() >> i & 1) assert_non_null(es_platform_kernel_table((es_isa)i));
    }
    assert_null(es_platform_kernel_table(ES_ISA_COUNT));
}

static void test_context_defaults(void** state)
{
    (void)state;
    es_context* context = NULL;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    es_context_desc d = es_context_resolved_desc(context);
    assert_non_null(d.allocator.allocate);
    assert_non_null(d.allocator.release);
    assert_non_null(d.logger.log);
    assert_non_null(d.tasks.run);
    assert_non_null(d.assert_hook.failed);
    assert_true(d.threads >= 1 && d.threads <= 64);
    assert_int_equal(d.threads, es_context_workers(context));
    assert_int_equal(d.isa_mask, es_isa_available_mask());
    assert_true(d.memory_cap > 0);
    assert_string_equal(es_context_message(context), "");
    assert_int_equal(es_context_last_result(context), ES_OK);
    assert_int_equal(es_context_bytes(context), 0);

    /* a resolved desc makes an independent context: its loops must not run on the first one's pool */
    es_context* second = NULL;
    assert_int_equal(es_context_create(&d, &second), ES_OK);
    assert_ptr_equal(es_context_resolved_desc(second).tasks.user, second);
    es_context_destroy(second);
    es_context_destroy(context);
    es_context_destroy(NULL);

    for (int i = 0; i < ES_ISA_COUNT; i++) {
        if (!(es_isa_available_mask() >> i & 1)) continue;
        log_record log;
        context = new_context((es_context_desc){.threads = 1, .isa_mask = 1u << i}, &log);
        assert_int_equal(es_context_isa(context), i);
        es_context_destroy(context);
    }
}

static void* no_memory(void* user, size_t size, size_t alignment)
{
    (void)size;
    (void)alignment;
    int* left = user;
    return (*left)-- > 0 ? aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment) : NULL;
}
static void free_memory(void* user, void* pointer, size_t size)
{
    (void)user;
    (void)size;
    free(pointer);
}

static void test_context_bad_desc(void** state)
{
    (void)state;
    log_record log = {0};
    es_context* context = (es_context*)&log;
    es_context_desc desc = {.logger = {record, &log}, .threads = 65};
    assert_int_equal(es_context_create(&desc, &context), ES_INVALID_ARGUMENT);
    assert_null(context);
    assert_int_equal(log.last, ES_INVALID_ARGUMENT);
    assert_non_null(strstr(log.message, "65"));

    desc = (es_context_desc){.logger = {record, &log}, .isa_mask = 1u << 30};
    assert_int_equal(es_context_create(&desc, &context), ES_ISA_UNAVAILABLE);
    assert_null(context);
    assert_int_equal(log.last, ES_ISA_UNAVAILABLE);

    desc = (es_context_desc){.logger = {record, &log}, .allocator = {.allocate = no_memory}};
    assert_int_equal(es_context_create(&desc, &context), ES_INVALID_ARGUMENT);

    int left = 0;
    desc = (es_context_desc){.logger = {record, &log}, .allocator = {no_memory, free_memory, &left}};
    assert_int_equal(es_context_create(&desc, &context), ES_OUT_OF_MEMORY);
    assert_null(context);
    assert_int_equal(log.errors, 4);
}

static void test_memory(void** state)
{
    (void)state;
    log_record log;
    es_context* context = new_context((es_context_desc){.threads = 1, .memory_cap = 1000}, &log);
    void* a = es_allocate(context, 600);
    assert_non_null(a);
    assert_int_equal((uintptr_t)a % 64, 0);
    assert_int_equal(es_context_bytes(context), 600);
    assert_null(es_allocate(context, 401));
    assert_int_equal(es_context_last_result(context), ES_MEMORY_CAP);
    assert_non_null(strstr(es_context_message(context), "401"));
    assert_non_null(strstr(es_context_message(context), "1000"));
    assert_int_equal(log.last, ES_MEMORY_CAP);
    assert_string_equal(log.message, es_context_message(context));
    assert_int_equal(es_context_bytes(context), 600);
    char* b = es_allocate_zero(context, 400);
    assert_non_null(b);
    for (int i = 0; i < 400; i++) assert_int_equal(b[i], 0);
    assert_null(es_allocate(context, SIZE_MAX));
    assert_null(es_allocate_array(context, SIZE_MAX / 2, 3));
    assert_int_equal(es_context_last_result(context), ES_OUT_OF_MEMORY);
    es_release(context, a, 600);
    es_release(context, NULL, 12345);
    assert_int_equal(es_context_bytes(context), 400);
    assert_int_equal(es_context_peak_bytes(context), 1000);
    es_release(context, b, 400);
    void *z1 = es_allocate(context, 0), *z2 = es_allocate(context, 0);
    assert_non_null(z1);
    assert_ptr_not_equal(z1, z2);
    es_release(context, z1, 0);
    es_release(context, z2, 0);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
    assert_int_equal(log.warnings, 0);

    int left = 1; /* the context itself */
    context = new_context((es_context_desc){.threads = 1, .allocator = {no_memory, free_memory, &left}}, &log);
    assert_null(es_allocate(context, 10));
    assert_int_equal(es_context_last_result(context), ES_OUT_OF_MEMORY);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static void test_leak_report(void** state)
{
    (void)state;
    log_record log;
    es_context* context = new_context((es_context_desc){.threads = 1}, &log);
    void* leaked = es_allocate(context, 77);
    es_context_count_object(context, +3);
    es_context_count_object(context, -1);
    es_context_destroy(context);
    free(leaked);
    assert_int_equal(log.warnings, 1);
    assert_non_null(strstr(log.message, "2 objects"));
    assert_non_null(strstr(log.message, "77 bytes"));
}

static void hooked(void* user, es_result item, const char* message)
{
    (void)message;
    *(es_result*)user = item;
}

static void test_messages(void** state)
{
    (void)state;
    log_record log;
    es_result seen = ES_OK;
    es_context* context = new_context((es_context_desc){.threads = 1, .assert_hook = {hooked, &seen}}, &log);
    assert_int_equal(es_fail(context, ES_FILE_DAMAGED, "a%sb", "\n\r\t\x1b"), ES_FILE_DAMAGED);
    assert_string_equal(es_context_message(context), "a    b");
    assert_int_equal(seen, ES_OK);
    assert_int_equal(es_misuse(context, ES_STALE_HANDLE, "mesh %d", 7), ES_STALE_HANDLE);
    assert_int_equal(seen, ES_STALE_HANDLE);
    assert_string_equal(es_context_message(context), "mesh 7");
    es_log(context, ES_LOG_INFO, ES_NOTE, "by the way");
    assert_string_equal(log.message, "by the way");
    assert_string_equal(es_context_message(context), "mesh 7");
    static char longest[5000];
    memset(longest, 'x', sizeof longest - 1);
    es_fail(context, ES_FILE_READ, "%s", longest);
    assert_true(strlen(es_context_message(context)) > 500);
    es_context_destroy(context);
}

static void test_grow(void** state)
{
    (void)state;
    log_record log;
    es_context* context = new_context((es_context_desc){.threads = 1, .memory_cap = 4096}, &log);
    void* array = NULL;
    size_t capacity = 0, used = 0;
    for (; used < 200; used++) {
        assert_true(es_grow(context, &array, &capacity, used, used + 1, sizeof(int)));
        ((int*)array)[used] = (int)(used * used);
    }
    for (size_t i = 0; i < used; i++) assert_int_equal(((int*)array)[i], i * i);
    assert_int_equal(es_context_bytes(context), capacity * sizeof(int));
    void* before = array;
    assert_false(es_grow(context, &array, &capacity, used, 100000, sizeof(int)));
    assert_ptr_equal(before, array);
    es_release(context, array, capacity * sizeof(int));
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static void test_arena(void** state)
{
    (void)state;
    log_record log;
    es_context* context = new_context((es_context_desc){.threads = 1}, &log);
    es_arena arena;
    es_arena_init(&arena, context, 1000);
    size_t steady = 0;
    char* first_time[40];
    for (int frame = 0; frame < 3; frame++) {
        for (int i = 0; i < 40; i++) {
            size_t size = (size_t)(i * 53 % 7) * 177; /* 0 … 1062: some larger than a block */
            char* p = es_arena_allocate(&arena, size);
            assert_non_null(p);
            assert_int_equal((uintptr_t)p % 64, 0);
            memset(p, i, size);
            if (frame == 0) first_time[i] = p;
            assert_ptr_equal(first_time[i], p);
        }
        for (int i = 0; i < 40; i++) {
            size_t size = (size_t)(i * 53 % 7) * 177;
            for (size_t k = 0; k < size; k++) assert_int_equal(first_time[i][k], i);
        }
        if (frame == 0) steady = es_context_bytes(context);
        assert_int_equal(es_context_bytes(context), steady);
        es_arena_reset(&arena);
    }
    assert_null(es_arena_allocate(&arena, SIZE_MAX - 10));
    es_arena_free(&arena);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* ---- threads ------------------------------------------------------------------------------------------------------------ */

static void test_thread_counts(void** state)
{
    (void)state;
    int before = thread_count();
    if (before < 0) skip(); /* no /proc */
    log_record log;
    es_context* one = new_context((es_context_desc){.threads = 1}, &log);
    assert_int_equal(thread_count(), before);
    es_context* four = new_context((es_context_desc){.threads = 4}, &log);
    assert_int_equal(thread_count(), before + 3);
    es_context_destroy(four);
    /* a joined thread leaves /proc a moment later */
    for (int i = 0; i < 100 && thread_count() != before; i++) usleep(1000);
    assert_int_equal(thread_count(), before);
    es_context_destroy(one);
}

enum { LOOP_COUNT = 10007, LOOP_GRAIN = 13, LOOP_CHUNKS = (LOOP_COUNT + LOOP_GRAIN - 1) / LOOP_GRAIN };

typedef struct loop_record {
    atomic_int visits[LOOP_COUNT];
    atomic_int chunk_ends[LOOP_COUNT + 1]; /* by begin */
    atomic_int inside[64];
    atomic_int bad;
    uint32_t workers;
    float chunk_sums[LOOP_CHUNKS];
} loop_record;

static void visit(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    loop_record* r = user;
    if (worker >= r->workers || atomic_fetch_add(&r->inside[worker], 1) != 0) r->bad++;
    r->chunk_ends[begin] = (int)end;
    float sum = 0;
    for (uint32_t i = begin; i < end; i++) {
        r->visits[i]++;
        sum += es_random_float(1, i) / 3.0f;
    }
    r->chunk_sums[begin / LOOP_GRAIN] = sum;
    atomic_fetch_sub(&r->inside[worker % 64], 1);
}

static uint64_t run_loop(es_context* context)
{
    loop_record* r = calloc(1, sizeof *r);
    r->workers = es_context_workers(context);
    es_parallel_for(context, LOOP_COUNT, LOOP_GRAIN, visit, r);
    assert_int_equal(r->bad, 0);
    for (int i = 0; i < LOOP_COUNT; i++) {
        assert_int_equal(r->visits[i], 1);
        int end = i + LOOP_GRAIN < LOOP_COUNT ? i + LOOP_GRAIN : LOOP_COUNT;
        assert_int_equal(r->chunk_ends[i], i % LOOP_GRAIN == 0 ? end : 0);
    }
    float total = 0;
    for (int i = 0; i < LOOP_CHUNKS; i++) total += r->chunk_sums[i];
    uint64_t hash = es_hash_bytes(to_bits(total), r->chunk_sums, sizeof r->chunk_sums);
    free(r);
    return hash;
}

static void count_chunks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    (void)worker;
    atomic_fetch_add((atomic_uint*)user, end - begin);
}

static void test_parallel_for(void** state)
{
    (void)state;
    const uint32_t threads[] = {1, 2, 3, 8};
    uint64_t expected = 0;
    for (int i = 0; i < 4; i++) {
        log_record log;
        es_context* context = new_context((es_context_desc){.threads = threads[i]}, &log);
        for (int repeat = 0; repeat < 5; repeat++) {
            uint64_t hash = run_loop(context);
            if (i == 0 && repeat == 0) expected = hash;
            assert_true(hash == expected);
        }
        /* short loops in quick succession, and after the pool went to sleep */
        for (int repeat = 0; repeat < 2000; repeat++) {
            atomic_uint sum = 0;
            es_parallel_for(context, (uint32_t)repeat % 17, 1 + (uint32_t)repeat % 3, count_chunks, &sum);
            assert_int_equal(sum, repeat % 17);
            if (repeat % 500 == 0) usleep(2000);
        }
        atomic_uint sum = 0;
        es_parallel_for(context, 0, 4, count_chunks, &sum);
        assert_int_equal(sum, 0);
        es_parallel_for(context, UINT32_MAX, 1u << 30, count_chunks, &sum); /* borders beyond 32 bits */
        assert_int_equal(sum, UINT32_MAX);
        es_parallel_for(context, 5, 0, count_chunks, &sum);
        assert_int_equal(sum, 4); /* UINT32_MAX + 5 */
        es_context_destroy(context);
        assert_int_equal(log.count, 0);
    }
}

static void nested(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    (void)begin;
    (void)end;
    (void)worker;
    atomic_uint never = 0;
    es_parallel_for(user, 8, 1, count_chunks, &never);
}

static void test_nesting_is_misuse(void** state)
{
    (void)state;
    log_record log;
    es_context* context = new_context((es_context_desc){.threads = 1}, &log);
    es_parallel_for(context, 1, 1, nested, context);
    assert_int_equal(log.last, ES_WRONG_STATE);
    atomic_uint sum = 0;
    es_parallel_for(context, 8, 1, count_chunks, &sum); /* the outer loop has ended */
    assert_int_equal(sum, 8);
    es_context_destroy(context);
}

typedef struct runner {
    int calls;
    uint32_t largest;
} runner;

static void run_backwards(void* user, uint32_t count, void (*task)(void*, uint32_t), void* data)
{
    runner* r = user;
    r->calls++;
    if (count > r->largest) r->largest = count;
    while (count-- > 0) task(data, count);
}

typedef struct own_thread {
    void (*task)(void*, uint32_t);
    void* data;
    uint32_t index;
} own_thread;

static void* own_thread_main(void* data)
{
    own_thread* t = data;
    t->task(t->data, t->index);
    return NULL;
}

static void run_on_own_threads(void* user, uint32_t count, void (*task)(void*, uint32_t), void* data)
{
    ((runner*)user)->calls++;
    pthread_t threads[64];
    own_thread own[64];
    for (uint32_t i = 0; i < count; i++) {
        own[i] = (own_thread){task, data, i};
        pthread_create(&threads[i], NULL, own_thread_main, &own[i]);
    }
    for (uint32_t i = 0; i < count; i++) pthread_join(threads[i], NULL);
}

static void test_user_tasks(void** state)
{
    (void)state;
    log_record log;
    es_context* context = new_context((es_context_desc){.threads = 1}, &log);
    uint64_t expected = run_loop(context);
    es_context_destroy(context);

    void (*const runs[])(void*, uint32_t, void (*)(void*, uint32_t), void*) = {run_backwards, run_on_own_threads};
    for (int i = 0; i < 2; i++) {
        runner r = {0};
        int before = thread_count();
        context = new_context((es_context_desc){.threads = 5, .tasks = {runs[i], &r}}, &log);
        assert_int_equal(thread_count(), before); /* their threads, not ours */
        assert_int_equal(es_context_workers(context), 5);
        assert_true(run_loop(context) == expected);
        assert_int_equal(r.calls, 1);
        if (i == 0) assert_int_equal(r.largest, 5);
        atomic_uint sum = 0;
        es_parallel_for(context, 3, 8, count_chunks, &sum); /* one chunk needs no task */
        assert_int_equal(r.calls, 1);
        es_context_destroy(context);
    }
}

/* ---- floating-point environment --------------------------------------------------------------------------------------- */

static volatile float one = 1.0f, three = 3.0f, minus_three = -3.0f, smallest_normal = 0x1p-126f, half = 0.5f;

static void check_environment(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    (void)begin;
    (void)end;
    (void)worker;
    /* asked of the arithmetic: fegetround() reads x87's control word, which no float here goes through */
    bool good = one / three == 0x1.555556p-2f && one / minus_three == -0x1.555556p-2f; /* rounding up and down would differ */
    good &= smallest_normal * half == 0x1p-127f;                                   /* flush to zero */
    volatile float denormal = 0x1p-140f;
    good &= denormal * 2.0f == 0x1p-139f; /* denormals are zero */
    if (!good) atomic_fetch_add((atomic_int*)user, 1);
    usleep(200); /* let every worker have a chunk */
}

static void test_fp_environment(void** state)
{
    (void)state;
    runner r = {0};
    const es_context_desc descs[] = {{.threads = 1}, {.threads = 4}, {.threads = 4, .tasks = {run_backwards, &r}}};
    for (int i = 0; i < 3; i++) {
        log_record log;
        es_context* context = new_context(descs[i], &log);
        atomic_int bad = 0;
        int rounding = fegetround();
        fesetround(FE_DOWNWARD);
#if defined(__x86_64__)
        unsigned csr = _mm_getcsr();
        _mm_setcsr(csr | 0x8040); /* FTZ, DAZ */
        unsigned odd = _mm_getcsr();
#endif
        es_parallel_for(context, 16, 1, check_environment, &bad);
        int after = fegetround();
#if defined(__x86_64__)
        unsigned csr_after = _mm_getcsr();
        _mm_setcsr(csr);
#endif
        fesetround(rounding);
        assert_int_equal(after, FE_DOWNWARD);
#if defined(__x86_64__)
        assert_int_equal(csr_after, odd);
#endif
        assert_int_equal(bad, 0);
        es_context_destroy(context);
    }
}

/* ---- elementary functions -------------------------------------------------------------------------------------------------- */

static double ulp_of(double reference)
{
    int e;
    frexp(reference, &e);
    e = e - 24 < -149 ? -149 : e - 24;
    return ldexp(1.0, e);
}

typedef struct accuracy {
    const char* name;
    float (*function)(float);
    double (*reference)(double);
    float low, high;  /* tested over floats of this range */
    double ulp;       /* the most that is accepted */
} accuracy;

static const accuracy accuracies[] = {
    {"sin", es_sin, sin, -8192.0f, 8192.0f, 0.95},
    {"cos", es_cos, cos, -8192.0f, 8192.0f, 0.95},
    {"tan", es_tan, tan, -8192.0f, 8192.0f, 2.5},
    {"exp2", es_exp2, exp2, -126.0f, 127.99999f, 1.2},
    {"log2", es_log2, log2, 0x1p-126f, 0x1.fffffep127f, 1.6},
    {"log2 near 1", es_log2, log2, 0.5f, 2.0f, 1.6},
    {"exp", es_exp, exp, -87.0f, 88.7f, 0.51},
    {"acos", es_acos, acos, -1.0f, 1.0f, 0.51},
    {"floor", es_floor, floor, -0x1p40f, 0x1p40f, 0},
};

/* Floats in [low, high] by stepping through the ordered bit patterns; a prime step meets every exponent and last bit. */
static int64_t ordered(float f)
{
    int32_t bits = (int32_t)to_bits(f);
    return bits < 0 ? -(int64_t)(bits & 0x7fffffff) : bits;
}
static float unordered(int64_t o) { return from_bits(o < 0 ? (uint32_t)-o | 0x80000000u : (uint32_t)o); }

static int64_t accuracy_samples = 1000000;

static void test_accuracy(void** state)
{
    (void)state;
    bool good = true;
    for (size_t i = 0; i < sizeof accuracies / sizeof accuracies[0]; i++) {
        const accuracy* a = &accuracies[i];
        int64_t low = ordered(a->low), high = ordered(a->high), step = (high - low) / accuracy_samples | 1;
        double worst = 0;
        float worst_at = 0;
        for (int64_t o = low; o <= high; o += step) {
            float x = unordered(o);
            double expected = a->reference(x), e = fabs(a->function(x) - expected) / ulp_of(expected);
            if (!(e <= worst)) worst = e, worst_at = x;
        }
        printf("%-12s %.3f ulp at %a (limit %g)\n", a->name, worst, worst_at, a->ulp);
        good &= worst <= a->ulp;
    }
    assert_true(good);
}

static void test_accuracy_two_arguments(void** state)
{
    (void)state;
    double worst_atan2 = 0, worst_pow = 0;
    for (uint32_t i = 0; i < accuracy_samples; i++) {
        float y = (es_random_float(3, i) * 2 - 1) * es_exp2(es_random_float(4, i) * 60 - 30);
        float x = (es_random_float(5, i) * 2 - 1) * es_exp2(es_random_float(6, i) * 60 - 30);
        double expected = atan2(y, x), e = fabs(es_atan2(y, x) - expected) / ulp_of(expected);
        if (!(e <= worst_atan2)) worst_atan2 = e;

        /* the error of pow grows with the exponent: in ulp, at most 1.5 + 2 |y log2 x| */
        float base = es_exp2(es_random_float(7, i) * 40 - 20), exponent = es_random_float(8, i) * 12 - 6;
        if (i & 1) base = es_random_float(9, i), exponent = es_random_float(10, i) * 50; /* Phong lobes */
        double power = (double)exponent * log2(base);
        if (!(fabs(power) < 125)) continue;
        expected = pow(base, exponent);
        e = fabs(es_pow(base, exponent) - expected) / ulp_of(expected) / (1.5 + 2 * fabs(power));
        if (!(e <= worst_pow)) worst_pow = e;
    }
    printf("%-12s %.3f ulp (limit 0.51)\n%-12s %.3f of 1.5 + 2 |y log2 x| ulp (limit 1)\n", "atan2", worst_atan2, "pow", worst_pow);
    assert_true(worst_atan2 <= 0.51);
    assert_true(worst_pow <= 1);
}

static const float infinity = __builtin_inff();
#define assert_same(value, expected) assert_int_equal(to_bits(value), to_bits(expected))
#define assert_nan(value) assert_int_equal(to_bits(value), 0x7fc00000u)

static void test_special_values(void** state)
{
    (void)state;
    const float nan = from_bits(0xffc12345u);
    assert_same(es_sin(0.0f), 0.0f);
    assert_same(es_sin(-0.0f), -0.0f);
    assert_same(es_cos(0.0f), 1.0f);
    assert_nan(es_sin(nan));
    assert_nan(es_sin(infinity));
    assert_nan(es_cos(-infinity));
    for (uint32_t i = 0; i < 200000; i++) {
        float x = from_bits(es_random_u32(11, i) & 0x7fffffffu);
        if (!(x < infinity)) continue;
        assert_true(fabsf(es_sin(x)) <= 1 && fabsf(es_cos(x)) <= 1);
        assert_same(es_sin(-x), -es_sin(x));
        assert_same(es_cos(-x), es_cos(x));
        float s, c;
        es_sincos(x, &s, &c);
        assert_same(s, es_sin(x));
        assert_same(c, es_cos(x));
    }
    for (int n = -126; n < 128; n++) {
        assert_same(es_exp2((float)n), ldexpf(1, n));
        assert_same(es_log2(ldexpf(1, n)), (float)n);
    }
    assert_same(es_exp2(128.0f), infinity);
    assert_same(es_exp2(infinity), infinity);
    assert_true(es_exp2(127.99999f) < infinity);
    assert_true(es_exp2(-126.0f) == 0x1p-126f);
    assert_same(es_exp2(-126.00001f), 0.0f);
    assert_same(es_exp2(-infinity), 0.0f);
    assert_nan(es_exp2(nan));
    assert_same(es_log2(0.0f), -infinity);
    assert_same(es_log2(-0.0f), -infinity);
    assert_same(es_log2(infinity), infinity);
    assert_same(es_log2(0x1p-149f), -126.0f);
    assert_nan(es_log2(-1.0f));
    assert_nan(es_log2(nan));
    assert_same(es_pow(0.0f, 0.0f), 1.0f);
    assert_same(es_pow(0.0f, 2.5f), 0.0f);
    assert_same(es_pow(0.0f, -1.0f), infinity);
    assert_same(es_pow(1.0f, infinity), 1.0f);
    assert_same(es_pow(4.0f, 0.5f), 2.0f);
    assert_same(es_pow(infinity, 1.0f), infinity);
    assert_nan(es_pow(-1.0f, 2.0f));
    assert_nan(es_pow(2.0f, nan));
    assert_same(es_exp(0.0f), 1.0f);
    assert_same(es_exp(-infinity), 0.0f);
    assert_same(es_exp(infinity), infinity);
    assert_nan(es_exp(nan));
    assert_same(es_acos(1.0f), 0.0f);
    assert_same(es_acos(2.0f), 0.0f);
    assert_same(es_acos(-2.0f), ES_PI);
    assert_same(es_acos(0.0f), ES_PI / 2);
    assert_nan(es_acos(nan));
    assert_same(es_atan2(0.0f, 1.0f), 0.0f);
    assert_same(es_atan2(-0.0f, 1.0f), -0.0f);
    assert_same(es_atan2(0.0f, -1.0f), ES_PI);
    assert_same(es_atan2(-0.0f, -0.0f), -ES_PI);
    assert_same(es_atan2(infinity, infinity), ES_PI / 4);
    assert_same(es_atan2(1.0f, -infinity), ES_PI);
    assert_nan(es_atan2(nan, 1.0f));
    assert_same(es_floor(-0.0f), -0.0f);
    assert_same(es_floor(-0.25f), -1.0f);
    assert_same(es_floor(infinity), infinity);
    assert_same(es_floor(8388607.5f), 8388607.0f);
}

/* One hash per function over bit patterns of every kind: the same on every machine, compiler and optimisation level. */
static void test_maths_hashes(void** state)
{
    (void)state;
    enum { COUNT = 1 << 16 };
    static float results[COUNT];
    float (*const unary[])(float) = {es_sin, es_cos, es_tan, es_exp2, es_log2, es_exp, es_acos, es_floor};
    float (*const binary[])(float, float) = {es_pow, es_atan2};
    static const char* const names[] = {"sin", "cos", "tan", "exp2", "log2", "exp", "acos", "floor", "pow", "atan2"};
    static const uint64_t expected[] = {
        0x30fa29a051ac8d67u, 0xbc253bea5a32ca56u, 0x50ff7fb678786edbu, 0x18b9663cd61fd80cu, 0x48d90fb26961819bu,
        0xcdf15b1515aadf81u, 0x5c52f4b3a59dd12du, 0xbe5f31ceb0f7ac1cu, 0x70182451a64f2e82u, 0x3783f39c26eb81c6u,
    };
    bool good = true;
    for (int f = 0; f < 10; f++) {
        for (uint32_t i = 0; i < COUNT; i++) {
            float x = from_bits(i * 65521u + 12345u), y = from_bits(es_random_u32(12, i));
            if (i & 1) x = (float)(int32_t)(i - COUNT / 2) * 0x1p-10f, y = es_random_float(13, i) * 20 - 10; /* and usual ones */
            float r = f < 8 ? unary[f](x) : binary[f - 8](x, y);
            results[i] = r == r ? r : from_bits(0x7fc00000u);
        }
        uint64_t hash = es_hash_bytes(0, results, sizeof results);
        bool same = hash == expected[f];
        if (!same) printf("%-6s hash 0x%016" PRIx64 "u\n", names[f], hash);
        good &= same;
    }
    assert_true(good);
}

/* ---- random numbers ---------------------------------------------------------------------------------------------------------- */

/* Chi-square with n equally likely cells, as a normal deviate (Wilson and Hilferty 1931). */
static double chi_square_deviate(const uint32_t* cells, int n, double total)
{
    double expected = total / n, sum = 0;
    for (int i = 0; i < n; i++) sum += (cells[i] - expected) * (cells[i] - expected) / expected;
    double k = n - 1;
    return (cbrt(sum / k) - (1 - 2 / (9 * k))) / sqrt(2 / (9 * k));
}

static void test_random(void** state)
{
    (void)state;
    enum { COUNT = 1 << 18 };
    /* 4.5 standard deviations: fails one time in 150,000 for good numbers, and these are always the same */
    const double limit = 4.5;
    for (uint32_t seed = 0; seed < 6; seed++) {
        uint32_t high[256] = {0}, low[256] = {0}, pairs[256] = {0}, seeds[256] = {0}, strided[256] = {0};
        double sum = 0, sum2 = 0, serial = 0, across = 0;
        double previous = es_random_float(seed, UINT32_MAX); /* counters wrap */
        for (uint32_t i = 0; i < COUNT; i++) {
            uint32_t bits = es_random_u32(seed, i), next = es_random_u32(seed, i + 1);
            high[bits >> 24]++;
            low[bits & 255]++;
            pairs[(bits >> 28) << 4 | next >> 28]++;
            seeds[(es_random_u32(i, seed) >> 28) << 4 | es_random_u32(i + 1, seed) >> 28]++;
            strided[es_random_u32(seed, i << 10) >> 24]++;
            double value = es_unit_float(bits);
            assert_true(value >= 0 && value < 1);
            sum += value - 0.5;
            sum2 += (value - 0.5) * (value - 0.5);
            serial += (value - 0.5) * (previous - 0.5);
            across += (value - 0.5) * (es_random_float(seed + 1, i) - 0.5);
            previous = value;
        }
        assert_true(fabs(chi_square_deviate(high, 256, COUNT)) < limit);
        assert_true(fabs(chi_square_deviate(low, 256, COUNT)) < limit);
        assert_true(fabs(chi_square_deviate(pairs, 256, COUNT)) < limit);
        assert_true(fabs(chi_square_deviate(seeds, 256, COUNT)) < limit);
        assert_true(fabs(chi_square_deviate(strided, 256, COUNT)) < limit);
        assert_true(fabs(sum) < limit * sqrt(COUNT / 12.0));
        assert_true(fabs(sum2 / COUNT - 1 / 12.0) < limit * sqrt(1 / 180.0 / COUNT));
        assert_true(fabs(serial) < limit * sqrt((double)COUNT) / 12);
        assert_true(fabs(across) < limit * sqrt((double)COUNT) / 12);
    }
    assert_true(es_unit_float(UINT32_MAX) < 1);
    /* the tests above can fail: a counter's top byte is not random */
    uint32_t counter[256] = {0};
    for (uint32_t i = 0; i < COUNT; i++) counter[i * 0x9e3779b9u >> 24]++;
    assert_true(fabs(chi_square_deviate(counter, 256, COUNT)) > limit);
}

/* Largest difference between area and share of points over boxes [0, a) × [0, b), a and b multiples of 1/64. */
static double discrepancy(const float* x, const float* y, int count)
{
    static int cells[65][65];
    memset(cells, 0, sizeof cells);
    for (int i = 0; i < count; i++) cells[(int)(x[i] * 64) + 1][(int)(y[i] * 64) + 1]++;
    double worst = 0;
    for (int a = 1; a <= 64; a++) {
        for (int b = 1; b <= 64; b++) {
            cells[a][b] += cells[a - 1][b] + cells[a][b - 1] - cells[a - 1][b - 1];
            worst = fmax(worst, fabs(cells[a][b] / (double)count - a * b / 4096.0));
        }
    }
    return worst;
}

static void test_halton(void** state)
{
    (void)state;
    assert_same(es_radical_inverse(2, 1), 0.5f);
    assert_same(es_radical_inverse(2, 6), 0.375f);
    assert_same(es_radical_inverse(3, 5), (float)(7.0 / 9));
    assert_same(es_radical_inverse(251, 1), (float)(1.0 / 251));
    assert_same(es_radical_inverse(7, 0), 0.0f);
    assert_true(es_radical_inverse(2, UINT32_MAX) < 1);
    assert_same(es_halton(0, 12345), es_radical_inverse(2, 12345));
    assert_same(es_halton(15, 12345), es_radical_inverse(53, 12345));

    enum { COUNT = 1024 };
    static float points[16][COUNT];
    for (uint32_t d = 0; d < 16; d++) {
        for (uint32_t i = 0; i < COUNT; i++) {
            points[d][i] = es_halton(d, i);
            assert_true(points[d][i] >= 0 && points[d][i] < 1);
        }
    }
    /* dimensions 0 and 1 measure 0.0046; random points 0.03; later pairs correlate more, up to 0.018 */
    assert_true(discrepancy(points[0], points[1], COUNT) < 0.006);
    for (int d = 0; d + 1 < 6; d++) assert_true(discrepancy(points[d], points[d + 1], COUNT) < 0.012);
    for (uint32_t i = 0; i < COUNT; i++) points[0][i] = es_random_float(1, i), points[1][i] = es_random_float(2, i);
    assert_true(discrepancy(points[0], points[1], COUNT) > 0.012);
}

static void test_hash_bytes(void** state)
{
    (void)state;
    unsigned char bytes[64] = {0};
    for (int i = 0; i < 64; i++) bytes[i] = (unsigned char)(i * 7);
    static uint64_t seen[65 + 512];
    int count = 0;
    for (size_t size = 0; size <= 64; size++) seen[count++] = es_hash_bytes(1, bytes, size);
    for (int bit = 0; bit < 512; bit++) {
        bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
        seen[count++] = es_hash_bytes(1, bytes, 64);
        bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
        int changed = __builtin_popcountll(seen[count - 1] ^ seen[64]);
        assert_in_range(changed, 8, 56);
    }
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < i; j++) assert_true(seen[i] != seen[j]);
    }
    assert_true(es_hash_bytes(1, bytes, 64) != es_hash_bytes(2, bytes, 64));
    unsigned char shifted[65];
    memcpy(shifted + 1, bytes, 64);
    assert_true(es_hash_bytes(1, shifted + 1, 64) == es_hash_bytes(1, bytes, 64));
}

/* ---- linear algebra ------------------------------------------------------------------------------------------------------------- */

static es_vec3 random_v3(uint32_t i)
{
    return es_v3(es_random_float(20, i) * 2 - 1, es_random_float(21, i) * 2 - 1, es_random_float(22, i) * 2 - 1);
}
static es_quat random_quat(uint32_t i)
{
    es_vec3 axis = es_v3_normalize(random_v3(i), es_v3(1, 0, 0));
    return es_quat_from_axis_angle(axis, es_random_float(23, i) * 6);
}
static double distance3(es_vec3 a, es_vec3 b) { return sqrt((double)es_v3_dot(es_v3_sub(a, b), es_v3_sub(a, b))); }

static void test_vectors(void** state)
{
    (void)state;
    const es_vec3 fallback = {1, 2, 3};
    const es_vec3 without[] = {{0, 0, 0}, {-0.0f, 0, 0}, {from_bits(0x7fc00000u), 0, 0}, {infinity, 1, 1}, {0x1p-130f, 0, 0}};
    for (size_t i = 0; i < sizeof without / sizeof without[0]; i++) {
        es_vec3 n = es_v3_normalize(without[i], fallback);
        assert_memory_equal(&n, &fallback, sizeof n);
    }
    const float scales[] = {0x1p-120f, 1e-20f, 1, 1e20f, 3e38f};
    for (uint32_t i = 0; i < 1000; i++) {
        es_vec3 v = random_v3(i);
        for (int s = 0; s < 5; s++) {
            es_vec3 n = es_v3_normalize(es_v3_scale(v, scales[s]), fallback);
            assert_true(fabs((double)n.x * n.x + (double)n.y * n.y + (double)n.z * n.z - 1) < 2.5e-7);
            assert_true(distance3(n, es_v3_normalize(v, fallback)) < 1e-6);
        }
        es_vec3 n = es_v3_normalize(v, fallback), t, b;
        es_orthonormal_basis(n, &t, &b);
        assert_true(fabs(es_v3_dot(t, t) - 1) < 1e-6 && fabs(es_v3_dot(b, b) - 1) < 1e-6);
        assert_true(fabs(es_v3_dot(t, b)) < 1e-6 && distance3(es_v3_cross(t, b), n) < 1e-6);
    }
    es_vec3 t, b;
    es_orthonormal_basis(es_v3(0, 0, -1), &t, &b);
    assert_true(distance3(es_v3_cross(t, b), es_v3(0, 0, -1)) < 1e-6);
}

static void test_quaternions(void** state)
{
    (void)state;
    es_quat quarter = es_quat_from_axis_angle(es_v3(0, 1, 0), ES_PI / 2);
    assert_true(distance3(es_quat_rotate(quarter, es_v3(0, 0, 1)), es_v3(1, 0, 0)) < 1e-6); /* right-handed, y up */
    for (uint32_t i = 0; i < 1000; i++) {
        es_quat a = random_quat(2 * i), b = random_quat(2 * i + 1);
        es_vec3 v = random_v3(i + 5000);
        assert_true(distance3(es_quat_rotate(es_quat_mul(a, b), v), es_quat_rotate(a, es_quat_rotate(b, v))) < 2e-6);
        es_mat4 m = es_mat4_from_trs(es_v3(0, 0, 0), a, es_v3(1, 1, 1));
        assert_true(distance3(es_mat4_point(&m, v), es_quat_rotate(a, v)) < 1e-6);

        /* slerp: the ends, and equal angles for equal steps along the shorter arc */
        float d = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
        double whole = 2 * acos(fmin(1, fabs((double)d)));
        for (int k = 0; k <= 4; k++) {
            es_quat q = es_quat_slerp(a, b, (float)k / 4);
            double c = fabs((double)q.x * a.x + (double)q.y * a.y + (double)q.z * a.z + (double)q.w * a.w);
            assert_true(fabs(2 * acos(fmin(1, c)) - whole * k / 4) < 2e-3);
        }
    }
    es_quat none = es_quat_normalize((es_quat){0, 0, 0, 0}), identity = es_quat_identity();
    assert_memory_equal(&none, &identity, sizeof identity);
    es_quat same = es_quat_slerp(quarter, quarter, 0.3f);
    assert_true(fabs(same.y - quarter.y) < 1e-6 && fabs(same.w - quarter.w) < 1e-6);
}

static void test_matrices(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < 1000; i++) {
        es_vec3 scale = random_v3(i + 10000), v = random_v3(i + 30000);
        scale = es_v3(scale.x + copysignf(0.1f, scale.x), scale.y + copysignf(0.1f, scale.y), scale.z + copysignf(0.1f, scale.z));
        es_mat4 m = es_mat4_from_trs(es_v3_scale(random_v3(i), 100), random_quat(i), scale), inverse;
        assert_true(es_mat4_inverse(&m, &inverse));
        assert_true(distance3(es_mat4_point(&inverse, es_mat4_point(&m, v)), v) < 5e-4);
        es_mat4 product = es_mat4_mul(inverse, m);
        for (int k = 0; k < 15; k++) assert_true(fabs(product.m[k] - (k % 5 == 0)) < 5e-4);
        assert_true(fabs(es_mat4_determinant3(&m) / (scale.x * scale.y * scale.z) - 1) < 1e-5);

        /* the normal of a transformed plane stays perpendicular to transformed tangents, mirrored or not */
        float n9[9];
        es_mat4_normal_matrix(&m, n9);
        es_vec3 n = es_v3_normalize(v, es_v3(0, 1, 0)), t, b;
        es_orthonormal_basis(n, &t, &b);
        es_vec3 tn = es_v3(n9[0] * n.x + n9[3] * n.y + n9[6] * n.z, n9[1] * n.x + n9[4] * n.y + n9[7] * n.z, n9[2] * n.x + n9[5] * n.y + n9[8] * n.z);
        tn = es_v3_normalize(tn, es_v3(0, 0, 0));
        es_vec3 across = es_v3_normalize(es_v3_cross(es_mat4_direction(&m, t), es_mat4_direction(&m, b)), es_v3(0, 0, 0));
        assert_true(distance3(tn, across) < 1e-4);

        es_vec4 h = es_mat4_vec4(&m, (es_vec4){v.x, v.y, v.z, 1});
        es_vec3 p = es_mat4_point(&m, v);
        assert_true(h.x == p.x && h.y == p.y && h.z == p.z && h.w == 1);
    }
    const es_mat4 identity = es_mat4_identity();
    es_mat4 any = {{1, 7, 3, -2, 0.5f, 2, -4, 1, 3, 3, 9, -6, 2, 0, 1, 5}}, inverse;
    assert_true(es_mat4_inverse(&any, &inverse));
    es_mat4 product = es_mat4_mul(any, inverse);
    for (int k = 0; k < 16; k++) assert_true(fabs(product.m[k] - (k % 5 == 0)) < 1e-5);

    es_mat4 flat = es_mat4_from_trs(es_v3(1, 2, 3), random_quat(1), es_v3(1, 0, 1));
    assert_false(es_mat4_inverse(&flat, &inverse));
    assert_memory_equal(&inverse, &identity, sizeof inverse);
    es_mat4 dependent = {{1, 2, 3, 0, 0.1f, 0.2f, 0.3f, 0, 1, 1, 0, 0, 0, 0, 0, 1}};
    for (int k = 0; k < 3; k++) dependent.m[4 + k] = dependent.m[k] * 0.5f;
    assert_false(es_mat4_inverse(&dependent, &inverse));
    es_mat4 not_a_number = es_mat4_identity();
    not_a_number.m[5] = from_bits(0x7fc00000u);
    assert_false(es_mat4_inverse(&not_a_number, &inverse));
}

static void test_views(void** state)
{
    (void)state;
    es_mat4 look = es_mat4_look(es_v3(1, 2, 3), es_v3(0, 0, -2), es_v3(0, 1, 0));
    assert_true(distance3(es_mat4_point(&look, es_v3(1, 2, -7)), es_v3(0, 0, -10)) < 1e-5);
    assert_true(distance3(es_mat4_point(&look, es_v3(2, 3, 3)), es_v3(1, 1, 0)) < 1e-5);
    const es_vec3 steep[] = {{0, 1, 0}, {0, -1, 0}, {0, -3, 0}, {1, 0, 0}};
    for (int i = 0; i < 4; i++) { /* up parallel to the direction, or nothing at all */
        look = es_mat4_look(es_v3(5, 6, 7), steep[i], i < 3 ? es_v3(0, 1, 0) : es_v3(2, 0, 0));
        assert_true(fabs(es_mat4_determinant3(&look) - 1) < 1e-5);
        es_vec3 ahead = es_v3_add(es_v3(5, 6, 7), es_v3_normalize(steep[i], es_v3(0, 0, 0)));
        assert_true(distance3(es_mat4_point(&look, ahead), es_v3(0, 0, -1)) < 1e-5);
    }
    look = es_mat4_look(es_v3(0, 0, 0), es_v3(0, 0, 0), es_v3(0, 0, 0));
    assert_true(fabs(es_mat4_determinant3(&look) - 1) < 1e-5);

    es_mat4 p = es_mat4_perspective(ES_PI / 2, 2, 0.1f);
    es_vec4 at_near = es_mat4_vec4(&p, (es_vec4){0, 0, -0.1f, 1}), edge = es_mat4_vec4(&p, (es_vec4){20, 10, -10, 1});
    assert_true(at_near.z / at_near.w == 1);
    assert_true(fabs(edge.x / edge.w - 1) < 1e-6 && fabs(edge.y / edge.w - 1) < 1e-6 && fabs(edge.z / edge.w - 0.01) < 1e-8);
    es_mat4 o = es_mat4_orthographic(4, 2, 1, 11);
    es_vec3 front = es_mat4_point(&o, es_v3(4, -2, -1)), back = es_mat4_point(&o, es_v3(0, 0, -11));
    assert_true(fabs(front.x - 1) < 1e-6 && fabs(front.y + 1) < 1e-6 && fabs(front.z - 1) < 1e-6 && fabs(back.z) < 1e-6);
}

/* ---- images --------------------------------------------------------------------------------------------------------------------------- */

static void test_images(void** state)
{
    (void)state;
    log_record log;
    es_context* context = new_context((es_context_desc){.threads = 1, .memory_cap = 1 << 20}, &log);
    es_image image, other;
    const uint32_t bad[][3] = {{0, 1, 1}, {1, 0, 1}, {16385, 1, 1}, {1, UINT32_MAX, 1}, {1, 1, 0}, {1, 1, ES_IMAGE_MAX_CHANNELS + 1}};
    for (int i = 0; i < 6; i++) {
        assert_int_equal(es_image_create(context, bad[i][0], bad[i][1], bad[i][2], &image), ES_IMAGE_SIZE);
        assert_null(image.pixels);
    }
    assert_int_equal(es_image_create(context, 16384, 16384, 64, &image), ES_MEMORY_CAP);
    assert_int_equal(es_context_bytes(context), 0);
    const char* const names[] = {"Y", "YA", "RGB", "RGBA"};
    for (uint32_t channels = 1; channels <= 6; channels++) {
        assert_int_equal(es_image_create(context, 5, 3, channels, &image), ES_OK);
        for (uint32_t c = 0; c < channels; c++) {
            char name[3] = {channels <= 4 ? names[channels - 1][c] : 'C', channels <= 4 ? 0 : (char)('0' + c), 0};
            assert_int_equal(es_image_channel(&image, name), c);
        }
        assert_int_equal(es_image_channel(&image, "Z"), -1);
        for (uint32_t i = 0; i < 15 * channels; i++) assert_same(image.pixels[i], 0.0f);
        es_image_destroy(context, &image);
        assert_null(image.pixels);
        es_image_destroy(context, &image);
    }
    assert_int_equal(es_image_create(context, 4, 2, 3, &image), ES_OK);
    assert_int_equal(es_image_create(context, 2, 4, 3, &other), ES_OK);
    assert_true(es_image_hash(&image) != es_image_hash(&other)); /* the same pixels in another shape */
    uint64_t zero = es_image_hash(&image);
    image.pixels[23] = -0.0f;
    assert_true(es_image_hash(&image) != zero);
    image.pixels[23] = 0;
    assert_true(es_image_hash(&image) == zero);
    es_image_destroy(context, &image);
    es_image_destroy(context, &other);
    es_context_destroy(context);
    assert_int_equal(log.warnings, 0);
}

/* ---- kernels against scalar --------------------------------------------------------------------------------------------------------- */

/* `size` bytes that end where an unreadable page begins. */
typedef struct guarded {
    unsigned char* map;
    size_t map_size;
    void* bytes;
} guarded;

static guarded guarded_new(size_t size)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), body = (size + page - 1) / page * page;
    guarded g = {.map_size = body + 2 * page};
    g.map = mmap(NULL, g.map_size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(g.map != MAP_FAILED);
    memset(g.map, 0xa5, g.map_size);
    mprotect(g.map, page, PROT_NONE);
    mprotect(g.map + page + body, page, PROT_NONE);
    g.bytes = g.map + page + body - size;
    return g;
}
static void guarded_free(guarded g)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE);
    for (unsigned char* p = g.map + page; p < (unsigned char*)g.bytes; p++) assert_int_equal(*p, 0xa5);
    munmap(g.map, g.map_size);
}

static const uint32_t extremes[] = {
    0x00000000, 0x80000000, 0x00000001, 0x80000001, 0x007fffff, 0x00800000, 0x80800000, /* zeros, denormals, the smallest */
    0x3f800000, 0xbf800000, 0x3f7fffff, 0x3f800001, 0x3f000000, 0xbf000000, 0x3effffff, 0x3f000001, /* 1 and 1/2, and beside */
    0x40200000, 0xc0200000, 0x3fc00000, 0x40600000,                                     /* ties: 2.5, -2.5, 1.5, 3.5 */
    0x4affffff, 0x4b000000, 0x4b000001, 0xcaffffff, 0xcb000000, 0x4b7fffff, 0x4b800000, /* about 2^23 and 2^24 */
    0x4effffff, 0x4f000000, 0x4f000001, 0xceffffff, 0xcf000000, 0xcf000001, 0x4f800000, /* about 2^31 and 2^32 */
    0x42fe0000, 0x42fffffe, 0x43000000, 0xc2fc0000, 0xc2fc0001, 0xc3160000, 0x46000000, 0x46000001, /* ends of exp2 and sin */
    0x3f3504f3, 0x3f3504f2, 0x3fb504f3, 0x3fc90fdb, 0x40490fdb,                         /* sqrt(1/2), sqrt(2), pi/2, pi */
    0x7f7fffff, 0xff7fffff, 0x7f800000, 0xff800000, 0x7fc00000, 0xffc00000, 0x7fc12345, 0xffffffff, /* the largest, infinities, NaN */
};
enum { EXTREMES = sizeof extremes / sizeof extremes[0] };

/* A third any bits, a third usual values, a third extremes. */
static float kernel_input(uint32_t seed, uint32_t i)
{
    uint32_t bits = es_random_u32(seed, 2 * i), choice = es_random_u32(seed, 2 * i + 1) % 3;
    if (choice == 0) return from_bits((bits & 0x7f800000) == 0x7f800000 ? bits | 0x00400000 : bits); /* no signalling NaN */
    if (choice == 1) return (es_unit_float(bits) - 0.5f) * 64;
    return from_bits(extremes[bits % EXTREMES]);
}

static void test_elementary_kernels(void** state)
{
    (void)state;
    const size_t counts[] = {0, 1, 7, 8, 9, 31, EXTREMES * EXTREMES, 40000};
    for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++) {
        size_t count = counts[c];
        guarded gx = guarded_new(count * 4), gy = guarded_new(count * 4), gr = guarded_new(count * 4);
        float *x = gx.bytes, *y = gy.bytes, *r = gr.bytes;
        for (uint32_t i = 0; i < count; i++) x[i] = kernel_input(30, i), y[i] = kernel_input(31, i);
        if (count == EXTREMES * EXTREMES) {
            for (uint32_t i = 0; i < count; i++) x[i] = from_bits(extremes[i / EXTREMES]), y[i] = from_bits(extremes[i % EXTREMES]);
        }
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            const struct es_platform_kernels* k = es_platform_kernel_table((es_isa)isa);
            void (*const kernels[])(const float*, float*, size_t) = {k->sin, k->cos, k->exp2, k->log2};
            float (*const scalar[])(float) = {es_sin, es_cos, es_exp2, es_log2};
            const char* const names[] = {"sin", "cos", "exp2", "log2"};
            for (int f = 0; f < 5; f++) {
                memset(r, 0x5a, count * 4);
                if (f < 4) kernels[f](x, r, count);
                else k->pow(x, y, r, count);
                for (size_t i = 0; i < count; i++) {
                    float expected = f < 4 ? scalar[f](x[i]) : es_pow(x[i], y[i]);
                    if (to_bits(r[i]) != to_bits(expected)) {
                        fail_msg("%s, %s(%a, %a): %a, but es_%s gives %a", es_isa_name((es_isa)isa), f < 4 ? names[f] : "pow", x[i],
                            y[i], r[i], f < 4 ? names[f] : "pow", expected);
                    }
                }
            }
        }
        guarded_free(gx);
        guarded_free(gy);
        guarded_free(gr);
    }
}

static const struct { const char* name; bool exact; } simd_operations[] = {
#define OPERATION(name, exact) {#name, exact},
    ES_SIMD_OPERATIONS(OPERATION)
};

/* What the header promises of one operation at element i, in plain C; false when this test has no opinion beyond equality. */
static bool simd_expected(int operation, float a, float b, float c, uint32_t* bits)
{
    uint32_t ua = to_bits(a), ub = to_bits(b);
    int32_t ia = (int32_t)ua, ib = (int32_t)ub;
    bool fits = a >= -2147483648.0f && a < 2147483648.0f;
    switch (operation) {
    case ES_SIMD_vf_min: *bits = a < b ? ua : ub; return true;
    case ES_SIMD_vf_max: *bits = a > b ? ua : ub; return true;
    case ES_SIMD_vf_clamp: {
        float m = a > b ? a : b;
        *bits = m < c ? to_bits(m) : to_bits(c);
        return true;
    }
    case ES_SIMD_vf_select: *bits = a < b ? ua : to_bits(c); return true;
    case ES_SIMD_vi_select: *bits = a < b ? ua : to_bits(c); return true;
    case ES_SIMD_vf_and: *bits = a < b ? ua : 0; return true;
    case ES_SIMD_vf_abs: *bits = ua & 0x7fffffff; return true;
    case ES_SIMD_vf_neg: *bits = ua ^ 0x80000000; return true;
    case ES_SIMD_vf_copysign: *bits = (ua & 0x7fffffff) | (ub & 0x80000000); return true;
    case ES_SIMD_vi_min: *bits = ia < ib ? ua : ub; return true;
    case ES_SIMD_vi_max: *bits = ia > ib ? ua : ub; return true;
    case ES_SIMD_vi_truncate: *bits = fits ? (uint32_t)(int32_t)a : 0x80000000u; return true;
    case ES_SIMD_vi_round: *bits = fits ? (uint32_t)(int32_t)lrint(a) : 0x80000000u; return true;
    case ES_SIMD_vf_from_int: *bits = to_bits((float)ia); return true;
    case ES_SIMD_vf_floor: *bits = to_bits(floorf(a)); return true;
    case ES_SIMD_vf_sqrt: *bits = to_bits(sqrtf(a)); return true;
    case ES_SIMD_vf_add: *bits = to_bits(a + b); return true;
    case ES_SIMD_vf_subtract: *bits = to_bits(a - b); return true;
    case ES_SIMD_vf_multiply: *bits = to_bits(a * b); return true;
    case ES_SIMD_vf_divide: *bits = to_bits(a / b); return true;
    case ES_SIMD_vm_lt: *bits = a < b ? UINT32_MAX : 0; return true;
    case ES_SIMD_vm_le: *bits = a <= b ? UINT32_MAX : 0; return true;
    case ES_SIMD_vm_gt: *bits = a > b ? UINT32_MAX : 0; return true;
    case ES_SIMD_vm_ge: *bits = a >= b ? UINT32_MAX : 0; return true;
    case ES_SIMD_vm_eq: *bits = a == b ? UINT32_MAX : 0; return true;
    case ES_SIMD_vm_ne: *bits = a != b ? UINT32_MAX : 0; return true;
    case ES_SIMD_vi_lt: *bits = ia < ib ? UINT32_MAX : 0; return true;
    case ES_SIMD_vi_gt: *bits = ia > ib ? UINT32_MAX : 0; return true;
    case ES_SIMD_vi_eq: *bits = ia == ib ? UINT32_MAX : 0; return true;
    default: return false;
    }
}

static bool is_nan_bits(uint32_t bits) { return (bits & 0x7fffffff) > 0x7f800000; }

static void test_simd_operations(void** state)
{
    (void)state;
    enum { COUNT = EXTREMES * EXTREMES / 8 * 8 + 8 * 1024 };
    size_t size = COUNT * 4, result_size = size * ES_SIMD_OPERATION_COUNT;
    guarded ga = guarded_new(size), gb = guarded_new(size), gc = guarded_new(size);
    guarded gr = guarded_new(result_size), gs = guarded_new(result_size);
    float *a = ga.bytes, *b = gb.bytes, *c = gc.bytes;
    for (uint32_t i = 0; i < COUNT; i++) {
        bool grid = i < EXTREMES * EXTREMES;
        a[i] = grid ? from_bits(extremes[i / EXTREMES]) : kernel_input(40, i);
        b[i] = grid ? from_bits(extremes[i % EXTREMES]) : kernel_input(41, i);
        c[i] = kernel_input(42, i);
        if (i >= COUNT - 512) a[i] = -es_random_float(43, i), b[i] = i % 1024 < 768 ? 1.0f : b[i]; /* masks with all lanes set */
    }
    const struct es_platform_kernels* scalar = es_platform_kernel_table(ES_ISA_SCALAR);
    uint32_t *expected = gs.bytes, *result = gr.bytes;
    scalar->simd_operations(a, b, c, expected, COUNT);
    uint32_t tree_tested = 0;
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        memset(result, 0x5a, result_size);
        es_platform_kernel_table((es_isa)isa)->simd_operations(a, b, c, result, COUNT);
        for (int operation = 0; operation < ES_SIMD_OPERATION_COUNT; operation++) {
            for (size_t i = 0; i < COUNT; i++) {
                uint32_t got = result[(size_t)operation * COUNT + i], want = expected[(size_t)operation * COUNT + i], plain;
                bool nan_allowed = !simd_operations[operation].exact && is_nan_bits(got);
                if (got != want && !(nan_allowed && is_nan_bits(want))) {
                    fail_msg("%s, %s(%a, %a, %a): 0x%08x, but scalar gives 0x%08x", es_isa_name((es_isa)isa),
                        simd_operations[operation].name, a[i], b[i], c[i], got, want);
                }
                if (simd_expected(operation, a[i], b[i], c[i], &plain) && got != plain && !(nan_allowed && is_nan_bits(plain))) {
                    fail_msg("%s, %s(%a, %a, %a): 0x%08x, but plain C gives 0x%08x", es_isa_name((es_isa)isa),
                        simd_operations[operation].name, a[i], b[i], c[i], got, plain);
                }
            }
        }
        /* across lanes: mask bits and the reduction tree, written out once more */
        for (size_t i = 0; i < COUNT; i += 8) {
            uint32_t bits = 0;
            for (int lane = 0; lane < 8; lane++) bits |= (uint32_t)(a[i + lane] < b[i + lane]) << lane;
            assert_int_equal(result[(size_t)ES_SIMD_vm_bits * COUNT + i], bits);
            assert_int_equal(result[(size_t)ES_SIMD_vm_any * COUNT + i], bits != 0);
            assert_int_equal(result[(size_t)ES_SIMD_vm_all * COUNT + i], bits == 255);
            tree_tested |= bits == 255 ? 2 : bits == 0 ? 1 : 0;
            float s0 = a[i] + a[i + 4], s1 = a[i + 1] + a[i + 5], s2 = a[i + 2] + a[i + 6], s3 = a[i + 3] + a[i + 7];
            float sum = (s0 + s2) + (s1 + s3);
            uint32_t got = result[(size_t)ES_SIMD_vf_sum * COUNT + i];
            assert_true(got == to_bits(sum) || (sum != sum && is_nan_bits(got)));
            for (int lane = 0, packed = 0; lane < 8; lane++)
                if (bits >> lane & 1) assert_int_equal(result[(size_t)ES_SIMD_vf_store_packed * COUNT + i + packed++], to_bits(c[i + lane]));
            for (int lane = 0; lane < 8; lane++) assert_int_equal(result[(size_t)ES_SIMD_vf_store_packed_behind * COUNT + i + lane], to_bits(a[i + lane]));
            for (int lane = 0; lane < 8; lane++) {
                uint32_t index = to_bits(b[i + lane]) >> 3 & 15;
                assert_int_equal(result[(size_t)ES_SIMD_vf_gather * COUNT + i + lane], to_bits(a[index]));
                assert_int_equal(result[(size_t)ES_SIMD_vi_gather * COUNT + i + lane], to_bits(a[index]));
                assert_int_equal(result[(size_t)ES_SIMD_vm_first * COUNT + i + lane], lane < (int)(i / 8 % 9) ? UINT32_MAX : 0);
                for (int word = 0; word < 4; word++) {
                    size_t at = i + 32 <= COUNT ? i : COUNT - 32;
                    assert_int_equal(result[(size_t)(ES_SIMD_vi_gather4_a + word) * COUNT + i + lane], to_bits(a[index + word]));
                    assert_int_equal(result[(size_t)(ES_SIMD_vf_load4_a + word) * COUNT + i + lane], to_bits(a[at + 4 * lane + word]));
                    const float record[4] = {a[i + 2 * word + lane / 4], b[i + 2 * word + lane / 4], c[i + 2 * word + lane / 4], (float)(2 * word + lane / 4)};
                    assert_int_equal(result[(size_t)(ES_SIMD_vf_store4_0 + word) * COUNT + i + lane], to_bits(record[lane % 4]));
                    const float others[4] = {record[1], record[2], record[0], record[3]};
                    assert_int_equal(result[(size_t)(ES_SIMD_vf_store3_0 + word) * COUNT + i + lane], to_bits(others[lane % 4]));
                }
            }
        }
    }
    assert_int_equal(tree_tested, 3);
    guarded_free(ga);
    guarded_free(gb);
    guarded_free(gc);
    guarded_free(gr);
    guarded_free(gs);
}

/* ---- timing -------------------------------------------------------------------------------------------------------------------------------- */

static void print_times(void)
{
    enum { COUNT = 4096 };
    static float x[COUNT], y[COUNT], r[COUNT];
    for (uint32_t i = 0; i < COUNT; i++) x[i] = es_random_float(50, i) * 20, y[i] = es_random_float(51, i) * 5;
    printf("ns per element, %d in cache\n%-8s %8s %8s %8s %8s %8s\n", COUNT, "isa", "sin", "cos", "exp2", "log2", "pow");
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        const struct es_platform_kernels* k = es_platform_kernel_table((es_isa)isa);
        void (*const kernels[])(const float*, float*, size_t) = {k->sin, k->cos, k->exp2, k->log2};
        printf("%-8s", es_isa_name((es_isa)isa));
        for (int f = 0; f < 5; f++) {
            double best = 1;
            for (int repeat = 0; repeat < 200; repeat++) {
                double start = es_seconds();
                if (f < 4) kernels[f](x, r, COUNT);
                else k->pow(x, y, r, COUNT);
                best = fmin(best, es_seconds() - start);
            }
            printf(" %8.3f", best * 1e9 / COUNT);
        }
        printf("\n");
    }
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        print_times();
        return 0;
    }
    if (argc > 2 && strcmp(argv[1], "--samples") == 0) accuracy_samples = atoll(argv[2]); /* per function; e.g. 300000000 */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_result_names),
        cmocka_unit_test(test_isa_names),
        cmocka_unit_test(test_context_defaults),
        cmocka_unit_test(test_context_bad_desc),
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_leak_report),
        cmocka_unit_test(test_messages),
        cmocka_unit_test(test_grow),
        cmocka_unit_test(test_arena),
        cmocka_unit_test(test_thread_counts),
        cmocka_unit_test(test_parallel_for),
        cmocka_unit_test(test_nesting_is_misuse),
        cmocka_unit_test(test_user_tasks),
        cmocka_unit_test(test_fp_environment),
        cmocka_unit_test(test_accuracy),
        cmocka_unit_test(test_accuracy_two_arguments),
        cmocka_unit_test(test_special_values),
        cmocka_unit_test(test_maths_hashes),
        cmocka_unit_test(test_random),
        cmocka_unit_test(test_halton),
        cmocka_unit_test(test_hash_bytes),
        cmocka_unit_test(test_vectors),
        cmocka_unit_test(test_quaternions),
        cmocka_unit_test(test_matrices),
        cmocka_unit_test(test_views),
        cmocka_unit_test(test_images),
        cmocka_unit_test(test_elementary_kernels),
        cmocka_unit_test(test_simd_operations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
