/*
 * What was configured is in the registers of the SubDevices: effects usual|short. With "short" the limit of a state
 * change is shorter than the SubDevice takes, and it does not become operational.
 */
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

enum { DRIVE = 1, OUTPUTS = 2, COUNT = 3 };

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *configs[COUNT];
static ec_reg_request_t *registers[COUNT];

static void cycle(void)
{
    const struct timespec pause = {0, 1000000};

    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
    nanosleep(&pause, NULL);
}

/* A register inside the SubDevice, or -1. */
static int64_t read_register(int slave, uint16_t address, size_t bytes)
{
    ec_reg_request_t *reg = registers[slave];
    int rounds = 3000;

    if (ecrt_reg_request_read(reg, address, bytes))
        return -1;
    while (ecrt_reg_request_state(reg) == EC_REQUEST_BUSY && rounds--)
        cycle();
    if (ecrt_reg_request_state(reg) != EC_REQUEST_SUCCESS)
        return -1;
    return bytes == 1 ? EC_READ_U8(ecrt_reg_request_data(reg)) : bytes == 2 ? EC_READ_U16(ecrt_reg_request_data(reg))
        : (int64_t) EC_READ_U32(ecrt_reg_request_data(reg));
}

static int configure(int is_short)
{
    int at;

    CHECK(master = ecrt_request_master(0));
    CHECK(domain = ecrt_master_create_domain(master));
    for (at = DRIVE; at < COUNT; at++) {
        ec_slave_info_t info;

        CHECK(ecrt_master_get_slave(master, (uint16_t) at, &info) == 0);
        CHECK(configs[at] = ecrt_master_slave_config(master, 0, (uint16_t) at, info.vendor_id, info.product_code));
        CHECK(registers[at] = ecrt_slave_config_create_reg_request(configs[at], 4));
    }
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[DRIVE], 0x6040, 0, domain, NULL) >= 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[DRIVE], 0x6041, 0, domain, NULL) >= 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[OUTPUTS], 0x7000, 1, domain, NULL) >= 0);
    CHECK(ecrt_slave_config_watchdog(configs[DRIVE], 1234, 567) == 0);
    CHECK(ecrt_slave_config_sync_manager(configs[OUTPUTS], 0, EC_DIR_OUTPUT, EC_WD_DISABLE) == 0);
    CHECK(ecrt_slave_config_dc(configs[DRIVE], 0x0700, 1000000, 0, 2000000, 0) == 0);
    CHECK(ecrt_slave_config_state_timeout(configs[DRIVE], EC_AL_STATE_PREOP, EC_AL_STATE_SAFEOP,
        is_short ? 200 : 3000) == 0);
    return ecrt_master_activate(master);
}

int main(int argc, char **argv)
{
    ec_slave_config_state_t drive = {0, 0, 0};
    int rounds, is_short;

    CHECK(argc == 2);
    is_short = !strcmp(argv[1], "short");
    CHECK(configure(is_short) == 0);
    for (rounds = 0; rounds < (is_short ? 4000 : 15000) && !drive.operational; rounds++) {
        cycle();
        ecrt_slave_config_state(configs[DRIVE], &drive);
    }
    printf("AL state %u\n", drive.al_state);
    CHECK(drive.operational == !is_short);
    if (!is_short) {
        CHECK(read_register(DRIVE, 0x0400, 2) == 1234 && read_register(DRIVE, 0x0420, 2) == 567);
        CHECK(read_register(DRIVE, 0x09a0, 4) == 1000000 && read_register(DRIVE, 0x09a4, 4) == 1000000);
        CHECK(read_register(DRIVE, 0x0981, 1) == 0x07);
        /* Watchdog trigger of SyncManager 0 is off; of the drive's outputs it is on. */
        CHECK((read_register(OUTPUTS, 0x0804, 1) & 0x40) == 0);
        CHECK((read_register(DRIVE, 0x0814, 1) & 0x40) == 0x40);
    }
    ecrt_release_master(master);
    return 0;
}
