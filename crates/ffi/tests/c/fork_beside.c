/*
 * Forks while another thread requests and releases a master again and again. Each child requests a master of its own,
 * and ends by exit; one that waits for a lock of its parent is ended by its alarm.
 */
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

enum { CHILDREN = 40, LIMIT_S = 20 };

static atomic_int ends;
static atomic_int requests;

static void *request(void *unused)
{
    (void) unused;
    while (!atomic_load(&ends)) {
        ec_master_t *master = ecrt_request_master(0);
        if (master)
            atomic_fetch_add(&requests, 1);
        ecrt_release_master(master);
        /* Refused, with a line. */
        ecrt_release_master(ecrt_request_master(77));
    }
    return NULL;
}

static int in_child(void)
{
    ec_master_t *master;

    alarm(LIMIT_S);
    CHECK(master = ecrt_request_master(0));
    CHECK(!ecrt_request_master(77));
    return 0;
}

int main(void)
{
    int number, result, hung = 0, failed = 0;
    pthread_t other;

    CHECK(!pthread_create(&other, NULL, request, NULL));
    for (number = 0; number < CHILDREN && !hung; number++) {
        /* At another moment of the request each time. */
        struct timespec pause = {0, 1000000 + number * 1700000L % 23000000L};
        pid_t child;

        nanosleep(&pause, NULL);
        fflush(NULL);
        CHECK((child = fork()) >= 0);
        if (!child)
            exit(in_child());
        CHECK(waitpid(child, &result, 0) == child);
        hung += WIFSIGNALED(result) && WTERMSIG(result) == SIGALRM;
        failed += !WIFEXITED(result) || WEXITSTATUS(result);
    }
    atomic_store(&ends, 1);
    CHECK(!pthread_join(other, NULL));
    printf("%d children, %d requests beside them, %d hung, %d failed\n", number, atomic_load(&requests), hung, failed);
    CHECK(!hung && !failed && atomic_load(&requests) > 0);
    return 0;
}
