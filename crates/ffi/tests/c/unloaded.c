/* The library is opened and closed while the process goes on: unloaded LIBRARY */
#include <dirent.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)
#define ROUNDS 100

static int entries(const char *directory)
{
    DIR *opened = opendir(directory);
    int count = 0;

    while (opened && readdir(opened))
        count++;
    if (opened)
        closedir(opened);
    return count;
}

/* A thread that was joined stays in /proc for a moment: it is waited for, 1 s at most. */
static int ended(void)
{
    int waits;

    for (waits = 0; waits < 1000 && entries("/proc/self/task") != 3; waits++)
        usleep(1000);
    return waits < 1000;
}

int main(int argc, char **argv)
{
    int round, files = 0;

    CHECK(argc == 2);
    for (round = 0; round < ROUNDS; round++) {
        void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
        ec_master_t *(*request)(unsigned int);
        void (*release)(ec_master_t *);
        ec_master_t *master;

        CHECK(library);
        *(void **) &request = dlsym(library, "ecrt_request_master");
        *(void **) &release = dlsym(library, "ecrt_release_master");
        CHECK(request && release);
        CHECK(master = request(0));
        CHECK(entries("/proc/self/task") > 3);
        release(master);
        CHECK(ended());
        CHECK(!dlclose(library));
        if (round == 0)
            files = entries("/proc/self/fd");
        CHECK(entries("/proc/self/fd") == files);
    }
    printf("%d rounds\n", round);
    return 0;
}
