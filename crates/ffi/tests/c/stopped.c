/*
 * An application that loses its bus because it is stopped: brings digital outputs to OP, says "op", cycles until a call
 * fails, shows what each call returns then, requests the master again and brings it to OP again.
 */
#include <stdio.h>
#include <time.h>

#include "ecrt.h"

#define OUTPUTS 0, 0, 0x0c47, 0x07d80008
#define MOST_CYCLES 20000

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *outputs;

static int begin(void)
{
    unsigned int bit;

    if (!(master = ecrt_request_master(0)) || !(domain = ecrt_master_create_domain(master)))
        return -1;
    if (!(outputs = ecrt_master_slave_config(master, OUTPUTS)))
        return -1;
    if (ecrt_slave_config_reg_pdo_entry_pos(outputs, 0, 0, 0, domain, &bit) < 0)
        return -1;
    return ecrt_master_activate(master);
}

static int cycle(void)
{
    struct timespec period = {0, 1000000};
    int code = ecrt_master_receive(master);

    if (code)
        return code;
    if ((code = ecrt_domain_process(domain)) || (code = ecrt_domain_queue(domain)))
        return code;
    code = ecrt_master_send(master);
    nanosleep(&period, NULL);
    return code;
}

static int reach_op(void)
{
    ec_slave_config_state_t state = {0};
    int left = MOST_CYCLES;

    while (!state.operational && left--)
        if (cycle() || ecrt_slave_config_state(outputs, &state))
            return -1;
    return state.operational ? 0 : -1;
}

static void show(void)
{
    ec_domain_state_t domain_state;
    ec_master_state_t state;
    ec_slave_info_t slave;
    int codes[4];

    codes[0] = ecrt_master_receive(master);
    codes[1] = ecrt_domain_process(domain);
    codes[2] = ecrt_domain_queue(domain);
    codes[3] = ecrt_master_send(master);
    printf("cycle: %d %d %d %d\n", codes[0], codes[1], codes[2], codes[3]);
    printf("time: %d\n", ecrt_master_application_time(master, 1));
    codes[0] = ecrt_domain_state(domain, &domain_state);
    printf("domain: %d, counter %u, state %d\n", codes[0], domain_state.working_counter, (int) domain_state.wc_state);
    codes[0] = ecrt_master_state(master, &state);
    printf("master: %d, link %d\n", codes[0], state.link_up);
    printf("slave: %d\n", ecrt_master_get_slave(master, 0, &slave));
    printf("activate: %d\n", ecrt_master_activate(master));
    codes[0] = ecrt_master_deactivate(master);
    codes[1] = ecrt_master_activate(master);
    printf("deactivate: %d, activate: %d, receive: %d\n", codes[0], codes[1], ecrt_master_receive(master));
}

int main(void)
{
    int left = MOST_CYCLES, code = 0;

    if (begin() || reach_op())
        return 1;
    printf("op\n");
    fflush(stdout);
    while (!code && left--)
        code = cycle();
    printf("lost: %d\n", code);
    show();
    ecrt_release_master(master);
    if (begin() || reach_op())
        return 1;
    printf("op again\n");
    ecrt_release_master(master);
    return 0;
}
