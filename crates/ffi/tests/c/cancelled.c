/*
 * cancelled: a thread whose cancellation is pending calls functions of all kinds. Cancellation is on within each call
 * and off between them, so that it takes effect in a call if that has a cancellation point. No call has one: the thread
 * comes to its end, and is cancelled there. "fake": the library has no SubDevices, and calls for them are left out.
 */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return NULL; } } while (0)
/* A statement with one call, in which the thread may be cancelled. */
#define IN(statement) \
    do { \
        pthread_setcancelstate(PTHREAD_CANCEL_ENABLE, NULL); \
        statement; \
        pthread_setcancelstate(PTHREAD_CANCEL_DISABLE, NULL); \
    } while (0)

enum { DRIVE = 2, MOST_CYCLES = 20000 };

static int is_fake;

struct machine {
    ec_master_t *master, *second;
    ec_domain_t *domain;
    ec_slave_config_t *drive;
    ec_sdo_request_t *request;
    ec_reg_request_t *reg;
};

static void cycle(struct machine *machine)
{
    const struct timespec pause = {0, 1000000};
    ec_domain_state_t state;
    uint32_t time;

    IN(ecrt_master_receive(machine->master));
    IN(ecrt_domain_process(machine->domain));
    IN(ecrt_domain_state(machine->domain, &state));
    IN(ecrt_master_application_time(machine->master, 1000000));
    IN(ecrt_master_sync_reference_clock(machine->master));
    IN(ecrt_master_sync_slave_clocks(machine->master));
    IN(ecrt_master_sync_monitor_queue(machine->master));
    IN(ecrt_master_sync_monitor_process(machine->master));
    IN(ecrt_master_reference_clock_time(machine->master, &time));
    IN(ecrt_domain_queue(machine->domain));
    IN(ecrt_master_send(machine->master));
    nanosleep(&pause, NULL);
}

/* Calls before the activation. */
static void *declare(struct machine *machine)
{
    ec_master_info_t info;
    ec_master_state_t state;
    ec_slave_config_state_t slave_state;
    ec_slave_info_t slave;
    ec_pdo_entry_reg_t entries[3];
    unsigned int places[2];
    uint32_t abort_code;
    uint8_t value[8];
    size_t size;
    int result = -1, number;

    IN(machine->master = ecrt_request_master(0));
    CHECK(machine->master);
    IN(machine->second = ecrt_open_master(0));
    CHECK(machine->second);
    IN(ecrt_request_master(0));
    IN(result = ecrt_master(machine->master, &info));
    CHECK(!result);
    IN(ecrt_master_state(machine->master, &state));
    IN(ecrt_master_state(machine->second, &state));
    IN(result = ecrt_master_get_slave(machine->master, DRIVE, &slave));
    CHECK(!result);
    IN(ecrt_master_get_slave(machine->second, DRIVE, &slave));
    IN(result = ecrt_master_sdo_upload(machine->master, DRIVE, 0x6041, 0, value, sizeof value, &size, &abort_code));
    CHECK(!result);
    IN(ecrt_master_sdo_upload(machine->second, DRIVE, 0x6041, 0, value, sizeof value, &size, &abort_code));
    value[0] = 1;
    IN(ecrt_master_sdo_download(machine->master, DRIVE, 0x6060, 0, value, 1, &abort_code));
    IN(machine->domain = ecrt_master_create_domain(machine->master));
    CHECK(machine->domain);
    IN(machine->drive = ecrt_master_slave_config(machine->master, 0, DRIVE, slave.vendor_id, slave.product_code));
    CHECK(machine->drive);
    memset(entries, 0, sizeof entries);
    for (number = 0; number < 2; number++) {
        entries[number].position = DRIVE;
        entries[number].vendor_id = slave.vendor_id;
        entries[number].product_code = slave.product_code;
        entries[number].index = (uint16_t) (0x6040 + number);
        entries[number].offset = places + number;
    }
    IN(result = ecrt_domain_reg_pdo_entry_list(machine->domain, entries));
    CHECK(!result);
    IN(ecrt_slave_config_sdo8(machine->drive, 0x6060, 0, 1));
    IN(ecrt_slave_config_dc(machine->drive, 0x0300, 1000000, 0, 0, 0));
    IN(ecrt_slave_config_emerg_size(machine->drive, 4));
    IN(ecrt_slave_config_state(machine->drive, &slave_state));
    IN(machine->request = ecrt_slave_config_create_sdo_request(machine->drive, 0x6041, 0, 2));
    IN(machine->reg = ecrt_slave_config_create_reg_request(machine->drive, 8));
    CHECK(machine->request && machine->reg);
    return machine;
}

/* Requests, declares, activates and releases, three times, as libfakeethercat can. */
static void *all_of_fake(void)
{
    int round, result = -1;

    for (round = 0; round < 3; round++) {
        ec_master_t *master;

        IN(master = ecrt_request_master(0));
        CHECK(master);
        IN(ecrt_request_master(0));
        IN(ecrt_master_create_domain(master));
        IN(ecrt_master_slave_config(master, 0, DRIVE, 1, 2));
        IN(result = ecrt_master_activate(master));
        CHECK(!result);
        IN(ecrt_master_receive(master));
        IN(ecrt_master_send(master));
        IN(result = ecrt_master_deactivate(master));
        CHECK(!result);
        IN(ecrt_release_master(master));
    }
    return &is_fake;
}

/* The end of the thread. */
static void *end(void)
{
    printf("no call was cancelled\n");
    fflush(stdout);
    pthread_setcancelstate(PTHREAD_CANCEL_ENABLE, NULL);
    pthread_testcancel();
    fprintf(stderr, "the thread was not cancelled\n");
    return NULL;
}

static void *all_calls(void *argument)
{
    struct machine machine;
    ec_slave_config_state_t state;
    ec_master_state_t master_state;
    uint8_t emergency[8];
    int result = -1, left;

    (void) argument;
    pthread_setcancelstate(PTHREAD_CANCEL_DISABLE, NULL);
    pthread_cancel(pthread_self());
    if (is_fake)
        return all_of_fake() ? end() : NULL;
    CHECK(declare(&machine));
    IN(result = ecrt_master_activate(machine.master));
    CHECK(!result);
    memset(&state, 0, sizeof state);
    for (left = MOST_CYCLES; left && !state.operational; left--) {
        cycle(&machine);
        IN(ecrt_slave_config_state(machine.drive, &state));
        IN(ecrt_master_state(machine.master, &master_state));
    }
    CHECK(state.operational);
    IN(result = ecrt_sdo_request_read(machine.request));
    CHECK(!result);
    IN(ecrt_reg_request_read(machine.reg, 0x0130, 2));
    for (left = MOST_CYCLES; left && ecrt_sdo_request_state(machine.request) == EC_REQUEST_BUSY; left--) {
        cycle(&machine);
        IN(ecrt_sdo_request_state(machine.request));
        IN(ecrt_reg_request_state(machine.reg));
        IN(ecrt_slave_config_emerg_pop(machine.drive, emergency));
    }
    CHECK(ecrt_sdo_request_state(machine.request) == EC_REQUEST_SUCCESS);
    IN(ecrt_master_state(machine.second, &master_state));
    IN(ecrt_master_reset(machine.master));
    IN(ecrt_release_master(machine.second));
    IN(result = ecrt_master_deactivate(machine.master));
    CHECK(!result);
    IN(ecrt_release_master(machine.master));
    return end();
}

int main(int argc, char **argv)
{
    pthread_t thread;
    void *result = NULL;

    is_fake = argc > 1 && !strcmp(argv[1], "fake");
    if (pthread_create(&thread, NULL, all_calls, NULL) || pthread_join(thread, &result))
        return 1;
    return result == PTHREAD_CANCELED ? 0 : 1;
}
