/*
 * Two drives with distributed clocks: SYNC0 each 2 ms, their positions in step with the reference clock.
 *
 * The first drive is the reference clock; it follows the clock of the host. An argument limits the number of cycles.
 */
#include <stdio.h>
#include <time.h>

#include "ecrt.h"

#define PERIOD_NS 2000000U
#define NS_PER_S 1000000000U
#define DRIVES 2
#define CONTROLWORD 0x6040
#define POSITION 0x6064

static uint64_t system_time(const struct timespec *at)
{
    /* Nanoseconds since 2000. */
    return ((uint64_t) at->tv_sec - 946684800U) * NS_PER_S + (uint64_t) at->tv_nsec;
}

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *drives[DRIVES];
static int controlword[DRIVES], position[DRIVES];

/* Declares the drives; 0 if all is right. */
static int declare(void)
{
    int i;

    for (i = 0; i < DRIVES; i++) {
        ec_slave_info_t info;

        if (ecrt_master_get_slave(master, (uint16_t) (1 + i), &info))
            return 1;
        drives[i] = ecrt_master_slave_config(master, 0, info.position, info.vendor_id, info.product_code);
        if (!drives[i])
            return 1;
        controlword[i] = ecrt_slave_config_reg_pdo_entry(drives[i], CONTROLWORD, 0, domain, NULL);
        position[i] = ecrt_slave_config_reg_pdo_entry(drives[i], POSITION, 0, domain, NULL);
        if (controlword[i] < 0 || position[i] < 0)
            return 1;
        if (ecrt_slave_config_dc(drives[i], 0x0300, PERIOD_NS, 440000, 0, 0))
            return 1;
    }
    return ecrt_master_select_reference_clock(master, drives[0]);
}

static void print_clocks(const uint8_t *data)
{
    uint32_t reference = 0, difference = ecrt_master_sync_monitor_process(master);
    int has_reference = ecrt_master_reference_clock_time(master, &reference);
    ec_master_state_t state = {0, 0, 0};

    ecrt_master_state(master, &state);
    printf("AL states: 0x%02X, reference %s, difference at most %d ns, position %d.\n", state.al_states,
        has_reference == 0 ? "read" : "not read", (int) difference, (int) EC_READ_S32(data + position[0]));
    fflush(stdout);
}

/* One cycle at its time; the number of drives in OP. */
static unsigned int cycle(uint8_t *data, struct timespec *next)
{
    unsigned int operational = 0;
    int i;

    next->tv_nsec += PERIOD_NS;
    if (next->tv_nsec >= (long) NS_PER_S) {
        next->tv_nsec -= (long) NS_PER_S;
        next->tv_sec++;
    }
    clock_nanosleep(CLOCK_REALTIME, TIMER_ABSTIME, next, NULL);
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    for (i = 0; i < DRIVES; i++) {
        ec_slave_config_state_t drive;

        EC_WRITE_U16(data + controlword[i], 0);
        ecrt_slave_config_state(drives[i], &drive);
        operational += drive.operational;
    }
    return operational;
}

static void send_cycle(const struct timespec *now)
{
    ecrt_master_application_time(master, system_time(now));
    ecrt_master_sync_reference_clock(master);
    ecrt_master_sync_slave_clocks(master);
    ecrt_master_sync_monitor_queue(master);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

int main(int argc, char **argv)
{
    unsigned long cycles = argc > 1 ? strtoul(argv[1], NULL, 0) : 0, number;
    unsigned int were_operational = 0;
    uint8_t *data;
    struct timespec next;

    master = ecrt_request_master(0);
    if (!master || !(domain = ecrt_master_create_domain(master)) || declare())
        return 1;
    clock_gettime(CLOCK_REALTIME, &next);
    ecrt_master_application_time(master, system_time(&next));
    if (ecrt_master_activate(master) || !(data = ecrt_domain_data(domain)))
        return 1;
    for (number = 0; !cycles || number < cycles; number++) {
        unsigned int operational = cycle(data, &next);

        if (operational != were_operational)
            printf("%u of %u drives operational.\n", operational, DRIVES);
        were_operational = operational;
        if (number % 500 == 499)
            print_clocks(data);
        send_cycle(&next);
    }
    ecrt_release_master(master);
    return were_operational == DRIVES ? 0 : 2;
}
