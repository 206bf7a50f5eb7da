/*
 * Programs of several kinds on one library: hosts MODE. "locked": little memory may be locked, "all-locked": that which
 * the program has already, too. "fork":
 * a child beside the application. "threads": signals. "exit": ends without a release. "open": only requests a master.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <dirent.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)
#define MIB (1024UL * 1024UL)
#define NO_RIGHTS 65534
#define MOST_CYCLES 20000

static ec_master_t *master;
static ec_domain_t *domain;

/* So many cycles, and more until one is complete: on a busy machine a frame is late, or a watchdog expires. */
static int run(int cycles)
{
    const struct timespec pause = {0, 1000000};
    ec_domain_state_t state = {0, EC_WC_ZERO, 0};
    int number;

    for (number = 0; number < cycles || (state.wc_state != EC_WC_COMPLETE && number < MOST_CYCLES); number++) {
        CHECK(ecrt_master_receive(master) == 0 && ecrt_domain_process(domain) == 0);
        CHECK(ecrt_domain_state(domain, &state) == 0);
        CHECK(ecrt_domain_queue(domain) == 0 && ecrt_master_send(master) == 0);
        nanosleep(&pause, NULL);
    }
    CHECK(state.wc_state == EC_WC_COMPLETE);
    return 0;
}

/* The digital outputs at position 1. */
static int begin(void)
{
    ec_slave_info_t info;
    ec_slave_config_t *sc;

    CHECK(master = ecrt_request_master(0));
    CHECK(domain = ecrt_master_create_domain(master));
    CHECK(ecrt_master_get_slave(master, 1, &info) == 0);
    CHECK(sc = ecrt_master_slave_config(master, 0, 1, info.vendor_id, info.product_code));
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x7000, 1, domain, NULL) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    return run(2000);
}

/* A line of /proc: its number. */
static unsigned long status(const char *file, const char *key, int base)
{
    char line[256];
    unsigned long value = 0;
    FILE *from = fopen(file, "r");

    while (from && fgets(line, sizeof line, from))
        if (!strncmp(line, key, strlen(key)))
            value = strtoul(line + strlen(key) + 1, NULL, base);
    if (from)
        fclose(from);
    return value;
}

/* What the library takes is locked as it comes; its code, which depends on how it was compiled, is not. */
static int locked(unsigned long more, int flags)
{
    struct rlimit limit = {more * MIB, more * MIB};

    CHECK(!setrlimit(RLIMIT_MEMLOCK, &limit));
    /* With CAP_IPC_LOCK the limit has no effect. */
    if (!geteuid())
        CHECK(!setresgid(NO_RIGHTS, NO_RIGHTS, NO_RIGHTS) && !setresuid(NO_RIGHTS, NO_RIGHTS, NO_RIGHTS));
    CHECK(!mlockall(flags));
    if (begin())
        return 1;
    printf("locked %lu of %lu kB\n", status("/proc/self/status", "VmLck", 10), more * MIB / 1024);
    ecrt_release_master(master);
    return 0;
}

static int in_child(void)
{
    CHECK(ecrt_master_receive(master) == -EINVAL && ecrt_domain_queue(domain) == -EINVAL);
    CHECK(!ecrt_domain_data(domain));
    ecrt_release_master(master);
    return begin();
}

static int with_child(void)
{
    pid_t child;
    int result;

    if (begin())
        return 1;
    fflush(stdout);
    CHECK((child = fork()) >= 0);
    if (!child)
        exit(in_child());
    if (run(500))
        return 1;
    CHECK(waitpid(child, &result, 0) == child && WIFEXITED(result) && !WEXITSTATUS(result));
    if (run(500))
        return 1;
    ecrt_release_master(master);
    return 0;
}

static int threads(void)
{
    unsigned long caught = status("/proc/self/status", "SigCgt", 16);
    int others = 0, left;
    struct dirent *entry;
    DIR *tasks;

    if (begin())
        return 1;
    /* The C library handles two signals of its own once there are threads. */
    CHECK((status("/proc/self/status", "SigCgt", 16) & ~(3UL << 31)) == (caught & ~(3UL << 31)));
    CHECK(status("/proc/self/status", "SigBlk", 16) == 0);
    CHECK(tasks = opendir("/proc/self/task"));
    while ((entry = readdir(tasks))) {
        char file[300];
        unsigned long blocked;
        int number;

        if (entry->d_name[0] == '.' || strtol(entry->d_name, NULL, 10) == getpid())
            continue;
        others++;
        snprintf(file, sizeof file, "/proc/self/task/%s/status", entry->d_name);
        blocked = status(file, "SigBlk", 16);
        for (number = 1; number < SIGSYS; number++)
            CHECK(number == SIGKILL || number == SIGSTOP || blocked >> (number - 1) & 1);
    }
    closedir(tasks);
    CHECK(others > 0);
    ecrt_release_master(master);
    /* The kernel counts a thread for a moment after another one has waited for its end. */
    for (left = MOST_CYCLES; left && status("/proc/self/status", "Threads", 10) != 1; left--)
        usleep(1000);
    CHECK(status("/proc/self/status", "Threads", 10) == 1);
    return 0;
}

int main(int argc, char **argv)
{
    CHECK(argc >= 2);
    if (!strcmp(argv[1], "locked"))
        return locked(argc > 2 ? strtoul(argv[2], NULL, 10) : 4, MCL_FUTURE);
    if (!strcmp(argv[1], "all-locked"))
        return locked(argc > 2 ? strtoul(argv[2], NULL, 10) : 8, MCL_CURRENT | MCL_FUTURE);
    if (!strcmp(argv[1], "fork"))
        return with_child();
    if (!strcmp(argv[1], "threads"))
        return threads();
    /* In OP for longer than the log looks away. */
    if (!strcmp(argv[1], "exit"))
        return begin() || run(500);
    CHECK(master = ecrt_request_master(0));
    ecrt_release_master(master);
    return 0;
}
