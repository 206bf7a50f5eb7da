/* Cycles until its input ends; prints "op" when all are in OP. Each hundredth cycle queues the domain once more. */
#include <poll.h>
#include <stdio.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

static ec_master_t *master;
static ec_domain_t *domain;

static void cycle(void)
{
    const struct timespec pause = {0, 1000000};
    static int count;

    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
    /* Its frame is on the wire. */
    if (++count % 100 == 0)
        ecrt_domain_queue(domain);
    nanosleep(&pause, NULL);
}

int main(void)
{
    struct pollfd input = {0, POLLIN, 0};
    ec_master_info_t info;
    ec_master_state_t state = {0, 0, 0};
    ec_slave_info_t slave;
    ec_slave_config_t *sc;
    unsigned int position, count;

    CHECK((master = ecrt_request_master(0)) && (domain = ecrt_master_create_domain(master)));
    CHECK(ecrt_master(master, &info) == 0);
    for (position = 0; position < info.slave_count; position++) {
        CHECK(ecrt_master_get_slave(master, (uint16_t) position, &slave) == 0);
        sc = ecrt_master_slave_config(master, 0, (uint16_t) position, slave.vendor_id, slave.product_code);
        CHECK(sc && ecrt_slave_config_reg_pdo_entry_pos(sc, 0, 0, 0, domain, NULL) >= 0);
    }
    CHECK(ecrt_master_activate(master) == 0);
    for (count = 0; state.al_states != EC_AL_STATE_OP; count++) {
        CHECK(count < 20000);
        cycle();
        ecrt_master_state(master, &state);
    }
    printf("op\n");
    fflush(stdout);
    while (poll(&input, 1, 0) == 0)
        cycle();
    ecrt_release_master(master);
    return 0;
}
