/*
 * An application that ends without a release: brings digital outputs to OP and sets them, says "op", cycles 100 times,
 * and ends by "exit", "_exit" or "return", as its argument says.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "ecrt.h"

#define OUTPUTS 0, 0, 0x0c47, 0x07d80008
#define MOST_CYCLES 20000

static ec_master_t *master;
static ec_domain_t *domain;

static int cycle(void)
{
    struct timespec period = {0, 1000000};

    if (ecrt_master_receive(master) || ecrt_domain_process(domain))
        return -1;
    *ecrt_domain_data(domain) = 0xff;
    if (ecrt_domain_queue(domain) || ecrt_master_send(master))
        return -1;
    nanosleep(&period, NULL);
    return 0;
}

int main(int argc, char **argv)
{
    ec_slave_config_state_t state = {0};
    ec_slave_config_t *outputs;
    unsigned int bit;
    int left;

    if (argc < 2 || !(master = ecrt_request_master(0)) || !(domain = ecrt_master_create_domain(master)))
        return 1;
    if (!(outputs = ecrt_master_slave_config(master, OUTPUTS)))
        return 1;
    if (ecrt_slave_config_reg_pdo_entry_pos(outputs, 0, 0, 0, domain, &bit) < 0 || ecrt_master_activate(master))
        return 1;
    for (left = MOST_CYCLES; left && !state.operational; left--)
        if (cycle() || ecrt_slave_config_state(outputs, &state))
            return 1;
    printf("op: %d\n", state.operational);
    fflush(stdout);
    for (left = 100; left; left--)
        if (cycle())
            return 1;
    if (!strcmp(argv[1], "_exit"))
        _exit(0);
    if (!strcmp(argv[1], "exit"))
        exit(0);
    return 0;
}
