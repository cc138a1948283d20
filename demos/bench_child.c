/* Another program, run and measured: its output, how long it took, how much memory it held at most. */
#include "bench.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

static void read_all(int pipe, bench_child* child)
{
    size_t capacity = 0;
    for (;;) {
        if (child->size + 4096 > capacity) {
            capacity = capacity ? capacity * 2 : 65536;
            char* grown = realloc(child->output, capacity);
            if (!grown) return;
            child->output = grown;
        }
        ssize_t got = read(pipe, child->output + child->size, capacity - child->size - 1);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break;
        child->size += (size_t)got;
    }
    child->output[child->size] = 0;
}

bench_child bench_run_child(const char* const* arguments, const char* variable, const char* value, bool quiet)
{
    bench_child child = {.status = -1};
    int ends[2];
    fflush(stdout);
    double start = demo_seconds();
    if (pipe(ends) != 0) return child;
    pid_t process = fork();
    if (process == 0) {
        int nothing = open("/dev/null", O_RDWR);
        dup2(nothing, STDIN_FILENO);
        dup2(ends[1], STDOUT_FILENO);
        if (quiet) dup2(nothing, STDERR_FILENO);
        close(ends[0]);
        close(ends[1]);
        if (variable) setenv(variable, value, 1);
        execvp(arguments[0], (char* const*)arguments);
        _exit(127);
    }
    close(ends[1]);
    if (process > 0) {
        read_all(ends[0], &child);
        int status = 0;
        struct rusage usage = {0};
        while (wait4(process, &status, 0, &usage) < 0 && errno == EINTR) {}
        child.status = WIFEXITED(status) ? (WEXITSTATUS(status) == 127 ? -1 : WEXITSTATUS(status)) : 128;
        child.peak_mebibytes = (double)usage.ru_maxrss / 1024; /* KiB on Linux */
    }
    close(ends[0]);
    child.seconds = demo_seconds() - start;
    return child;
}
