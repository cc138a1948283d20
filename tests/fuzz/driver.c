/* Runs a fuzz target over files, and over the files of folders and of theirs: what libFuzzer found once is tried by every build, with
 * any compiler and any sanitizer.
 * usage: replay_TARGET FILE|FOLDER …      exit 1 when there was no file; a check that fails ends the program and names it */
#include "tests/fuzz/fuzz.h"

#include <dirent.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static unsigned files;

static void replay(const char* path);

static void replay_folder(const char* path)
{
    struct dirent** entries;
    int count = scandir(path, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        char inner[4096];
        snprintf(inner, sizeof inner, "%s/%s", path, entries[i]->d_name);
        if (entries[i]->d_name[0] != '.') replay(inner);
        free(entries[i]);
    }
    if (count >= 0) free(entries);
}

/* An input that takes longer than this would not be found by waiting for the end. */
enum { SECONDS_AT_MOST = 60 };

static void replay(const char* path)
{
    struct stat status;
    if (stat(path, &status) != 0) {
        fprintf(stderr, "%s: cannot be read\n", path);
        exit(1);
    }
    if (S_ISDIR(status.st_mode)) {
        replay_folder(path);
        return;
    }
    size_t size;
    uint8_t* bytes = fuzz_read(path, &size);
    FUZZ_CHECK(bytes, "%s cannot be read", path);
    static char line[4200];
    snprintf(line, sizeof line, "%s\n", path);
    /* not through stdio, whose buffer is lost when a check or a sanitizer ends the program */
    if (write(STDOUT_FILENO, line, strlen(line)) < 0) exit(1);
    alarm(SECONDS_AT_MOST);
    LLVMFuzzerTestOneInput(bytes, size);
    alarm(0);
    free(bytes);
    files++;
}

int main(int count, char** arguments)
{
    for (int i = 1; i < count; i++) replay(arguments[i]);
    printf("%u files\n", files);
    return files == 0;
}
