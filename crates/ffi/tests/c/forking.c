/*
 * Requests a master and forks. The parent waits for a signal; the child outlives it with all descriptors until its
 * input ends, releases the handle that it has inherited, and ends.
 */
#include <stdio.h>
#include <unistd.h>

#include "ecrt.h"

int main(void)
{
    ec_master_t *master = ecrt_request_master(0);
    if (!master) {
        return 1;
    }
    pid_t child = fork();
    if (child < 0) {
        return 1;
    }
    if (child == 0) {
        while (getchar() != EOF)
            ;
        ecrt_release_master(master);
        printf("child released\n");
        fflush(stdout);
        _exit(0);
    }
    printf("forked\n");
    fflush(stdout);
    for (;;) {
        pause();
    }
}
