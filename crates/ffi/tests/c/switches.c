/*
 * Declares one SubDevice and prints whether it reaches OP: switches ALIAS POSITION VENDOR PRODUCT. A vendor or a
 * product "own" is that of the SubDevice at position 1.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)
#define ROUNDS 3000

static uint32_t number(const char *text, uint32_t own)
{
    return strcmp(text, "own") ? (uint32_t) strtoul(text, NULL, 0) : own;
}

int main(int argc, char **argv)
{
    const struct timespec pause = {0, 1000000};
    ec_slave_config_state_t state;
    ec_slave_info_t slave;
    ec_slave_config_t *sc;
    ec_domain_t *domain;
    ec_master_t *master;
    unsigned int bit;
    int rounds;

    CHECK(argc == 5);
    CHECK(master = ecrt_request_master(0));
    CHECK(!ecrt_master_get_slave(master, 1, &slave));
    CHECK(sc = ecrt_master_slave_config(master, number(argv[1], 0), number(argv[2], 0),
                number(argv[3], slave.vendor_id), number(argv[4], slave.product_code)));
    CHECK(domain = ecrt_master_create_domain(master));
    memset(&state, 0, sizeof(state));
    /* The PDOs of a SubDevice that is not there are not known. */
    if (ecrt_slave_config_reg_pdo_entry_pos(sc, 0, 0, 0, domain, &bit) < 0) {
        printf("alias %u, not there\n", slave.alias);
        ecrt_release_master(master);
        return 0;
    }
    CHECK(!ecrt_master_activate(master));
    for (rounds = 0; rounds < ROUNDS && !state.operational; rounds++) {
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        nanosleep(&pause, NULL);
        CHECK(!ecrt_slave_config_state(sc, &state));
    }
    printf("alias %u, %s\n", slave.alias, state.operational ? "operational" : "not in OP");
    ecrt_release_master(master);
    return 0;
}
