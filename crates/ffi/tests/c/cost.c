/*
 * The cost of the C interface: cost cycles PERIOD_US COUNT brings all SubDevices with process data to OP, says "op",
 * waits for a line of its input, and calls the four functions of a cycle COUNT times in `measured`; cost start
 * PRODUCT prints the nanoseconds from the request to OP of all SubDevices. Ends with the incomplete cycles.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define MOST 64
#define VENDOR 0x0c47
#define OUTPUTS 0x07d80008

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *slaves[MOST];
static int count;
static unsigned long incomplete;
static struct timespec period = {0, 1000000};

static unsigned long long now_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (unsigned long long) now.tv_sec * 1000000000U + (unsigned long long) now.tv_nsec;
}

/* The whole process data of each SubDevice, as its SII assigns it. All are of one product: digital outputs with one
 * SyncManager, or drives with outputs in SyncManager 2 and inputs in 3. */
static int declare(uint32_t product)
{
    ec_master_info_t info;
    const unsigned first = product == OUTPUTS ? 0 : 2, last = product == OUTPUTS ? 0 : 3;
    unsigned position, sm;

    if (ecrt_master(master, &info) || info.slave_count > MOST || !(domain = ecrt_master_create_domain(master)))
        return -1;
    for (position = 0; position < info.slave_count; position++) {
        ec_slave_config_t *sc = ecrt_master_slave_config(master, 0, (uint16_t) position, VENDOR, product);

        if (!sc)
            return -1;
        for (sm = first; sm <= last; sm++) {
            unsigned int bit;

            if (ecrt_slave_config_reg_pdo_entry_pos(sc, (uint8_t) sm, 0, 0, domain, &bit) < 0)
                return -1;
        }
        slaves[count++] = sc;
    }
    return 0;
}

static int are_operational(void)
{
    ec_slave_config_state_t state;
    int number;

    for (number = 0; number < count; number++) {
        ecrt_slave_config_state(slaves[number], &state);
        if (!state.operational)
            return 0;
    }
    return 1;
}

void measured(void);

__attribute__((noinline)) void measured(void)
{
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

static void cycles(unsigned long number)
{
    ec_domain_state_t state;

    while (number--) {
        measured();
        ecrt_domain_state(domain, &state);
        incomplete += state.wc_state != EC_WC_COMPLETE;
        nanosleep(&period, NULL);
    }
}

int main(int argc, char **argv)
{
    unsigned long long begin = now_ns(), requested, declared, activated;
    char line[16];

    int is_start = argc == 3 && !strcmp(argv[1], "start");

    if (argc < 3 || !(master = ecrt_request_master(0)))
        return 1;
    requested = now_ns();
    if (declare(is_start ? (uint32_t) strtoul(argv[2], NULL, 0) : OUTPUTS))
        return 1;
    declared = now_ns();
    if (ecrt_master_activate(master))
        return 1;
    activated = now_ns();
    if (argc > 3)
        period.tv_nsec = atol(argv[2]) * 1000;
    while (!are_operational())
        cycles(1);
    if (is_start) {
        printf("%llu\n", now_ns() - begin);
        fprintf(stderr, "request %llu us, declare %llu us, activate %llu us, OP %llu us\n", (requested - begin) / 1000,
                (declared - requested) / 1000, (activated - declared) / 1000, (now_ns() - activated) / 1000);
    } else {
        cycles(20);
        printf("op\n");
        fflush(stdout);
        if (!fgets(line, sizeof line, stdin))
            return 1;
        incomplete = 0;
        cycles(strtoul(argv[3], NULL, 0));
        printf("incomplete %lu\n", incomplete);
    }
    ecrt_release_master(master);
    return 0;
}
