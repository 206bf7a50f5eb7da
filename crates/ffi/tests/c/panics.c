/*
 * A panic within a call, which a build for tests provokes with the flag "RingcatTestPanic": the call returns -EIO, all
 * handles of its master are refused from then on, and another master goes on. The master is released, requested again,
 * and brought to OP.
 */
#include <errno.h>
#include <stdio.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

enum { DRIVE = 2, MOST_CYCLES = 20000 };

struct machine {
    ec_master_t *master;
    ec_domain_t *domain;
    ec_slave_config_t *drive;
    ec_sdo_request_t *request;
};

static int declare(struct machine *machine, unsigned int index)
{
    ec_slave_info_t info;

    CHECK(machine->master = ecrt_request_master(index));
    CHECK(machine->domain = ecrt_master_create_domain(machine->master));
    CHECK(!ecrt_master_get_slave(machine->master, DRIVE, &info));
    CHECK(machine->drive = ecrt_master_slave_config(machine->master, 0, DRIVE, info.vendor_id, info.product_code));
    CHECK(ecrt_slave_config_reg_pdo_entry(machine->drive, 0x6040, 0, machine->domain, NULL) >= 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(machine->drive, 0x6041, 0, machine->domain, NULL) >= 0);
    CHECK(machine->request = ecrt_slave_config_create_sdo_request(machine->drive, 0x6066, 0, 2));
    return 0;
}

static int reach_op(struct machine *machine)
{
    const struct timespec pause = {0, 1000000};
    ec_slave_config_state_t state = {0, 0, 0};
    int left = MOST_CYCLES;

    CHECK(!ecrt_master_activate(machine->master));
    while (!state.operational && left--) {
        CHECK(!ecrt_master_receive(machine->master) && !ecrt_domain_process(machine->domain));
        CHECK(!ecrt_slave_config_state(machine->drive, &state));
        CHECK(!ecrt_domain_queue(machine->domain) && !ecrt_master_send(machine->master));
        nanosleep(&pause, NULL);
    }
    CHECK(state.operational);
    return 0;
}

static int is_refused(struct machine *machine)
{
    ec_master_state_t state;
    ec_domain_state_t domain_state;

    CHECK(ecrt_master_receive(machine->master) == -EIO && ecrt_master_state(machine->master, &state) == -EIO);
    CHECK(ecrt_master_activate(machine->master) == -EIO && ecrt_master_deactivate(machine->master) == -EIO);
    CHECK(!ecrt_master_create_domain(machine->master));
    CHECK(ecrt_domain_process(machine->domain) == -EIO && ecrt_domain_queue(machine->domain) == -EIO);
    CHECK(ecrt_domain_state(machine->domain, &domain_state) == -EIO && ecrt_domain_size(machine->domain) == 0);
    CHECK(ecrt_slave_config_sdo8(machine->drive, 0x6060, 0, 8) == -EIO);
    CHECK(ecrt_sdo_request_read(machine->request) == -EIO && !ecrt_sdo_request_data(machine->request));
    CHECK(ecrt_sdo_request_state(machine->request) == EC_REQUEST_ERROR);
    return 0;
}

int main(void)
{
    struct machine machine, other;

    CHECK(!declare(&machine, 0) && !declare(&other, 1));
    CHECK(ecrt_slave_config_flag(machine.drive, "RingcatTestPanic", 1) == -EIO);
    CHECK(!is_refused(&machine) && !reach_op(&other));
    CHECK(!ecrt_request_master(0));
    ecrt_release_master(machine.master);
    CHECK(ecrt_master_receive(machine.master) == -EINVAL);
    ecrt_release_master(machine.master);
    CHECK(!declare(&machine, 0) && !reach_op(&machine));
    ecrt_release_master(machine.master);
    ecrt_release_master(other.master);
    printf("all as expected\n");
    return 0;
}
