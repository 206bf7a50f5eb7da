/*
 * Two drives with distributed clocks in a loop of any period: periods MICROSECONDS. Ends when both are operational and
 * their registers show that delays are measured and written; prints the largest difference of the last cycles.
 */
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)
#define NS_PER_S 1000000000U
#define SYNC0_NS 1000000U
#define DRIVES 2
#define CONTROLWORD 0x6040
#define STATUSWORD 0x6041
#define DELAY 0x0928
/* Longest start, and the time in which the clocks come together. */
#define LIMIT_NS 15000000000ULL
#define TOGETHER_NS 3000000000ULL

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *drives[DRIVES];
static ec_reg_request_t *delays[DRIVES];
static struct timespec next;
static uint64_t passed;
static int distributes = 1;

static uint64_t system_time(void)
{
    return ((uint64_t) next.tv_sec - 946684800U) * NS_PER_S + (uint64_t) next.tv_nsec;
}

static void cycle(uint64_t period)
{
    uint64_t ns = (uint64_t) next.tv_nsec + period;

    next.tv_sec += (time_t) (ns / NS_PER_S);
    next.tv_nsec = (long) (ns % NS_PER_S);
    passed += period;
    clock_nanosleep(CLOCK_REALTIME, TIMER_ABSTIME, &next, NULL);
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_master_application_time(master, system_time());
    ecrt_master_sync_reference_clock(master);
    if (distributes)
        ecrt_master_sync_slave_clocks(master);
    ecrt_master_sync_monitor_queue(master);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

static int are_operational(void)
{
    ec_slave_config_state_t state = {0, 0, 0};
    int number, count = 0;

    for (number = 0; number < DRIVES; number++) {
        ecrt_slave_config_state(drives[number], &state);
        count += state.operational;
    }
    return count == DRIVES;
}

/* On a busy machine the loop may keep a frame for so long that it counts as lost: it is asked again. */
static int read_delay(int number, uint64_t period, uint32_t *delay)
{
    uint64_t end = passed + LIMIT_NS;
    unsigned int asked = 0;

    do {
        asked++;
        CHECK(ecrt_reg_request_read(delays[number], DELAY, 4) == 0);
        while (ecrt_reg_request_state(delays[number]) == EC_REQUEST_BUSY && passed < end)
            cycle(period);
    } while (ecrt_reg_request_state(delays[number]) != EC_REQUEST_SUCCESS && passed < end);
    if (ecrt_reg_request_state(delays[number]) != EC_REQUEST_SUCCESS)
        fprintf(stderr, "asked %u times, state %u\n", asked, (unsigned int) ecrt_reg_request_state(delays[number]));
    CHECK(ecrt_reg_request_state(delays[number]) == EC_REQUEST_SUCCESS);
    *delay = EC_READ_U32(ecrt_reg_request_data(delays[number]));
    return 0;
}

int main(int argc, char **argv)
{
    uint64_t period, end;
    uint32_t first, second, largest = 0;
    int number;

    CHECK(argc == 2);
    period = strtoull(argv[1], NULL, 10) * 1000;
    CHECK(period >= 100000 && period < NS_PER_S);
    CHECK(master = ecrt_request_master(0));
    CHECK(domain = ecrt_master_create_domain(master));
    for (number = 0; number < DRIVES; number++) {
        ec_slave_info_t info;

        CHECK(!ecrt_master_get_slave(master, (uint16_t) (1 + number), &info));
        drives[number] = ecrt_master_slave_config(master, 0, info.position, info.vendor_id, info.product_code);
        CHECK(drives[number]);
        CHECK(ecrt_slave_config_reg_pdo_entry(drives[number], STATUSWORD, 0, domain, NULL) >= 0);
        CHECK(ecrt_slave_config_reg_pdo_entry(drives[number], CONTROLWORD, 0, domain, NULL) >= 0);
        CHECK(!ecrt_slave_config_dc(drives[number], 0x0300, SYNC0_NS, 440000, 0, 0));
        CHECK(delays[number] = ecrt_slave_config_create_reg_request(drives[number], 4));
    }
    CHECK(!ecrt_master_select_reference_clock(master, drives[0]));
    clock_gettime(CLOCK_REALTIME, &next);
    CHECK(!ecrt_master_activate(master));
    while (!are_operational() && passed < LIMIT_NS)
        cycle(period);
    CHECK(are_operational());
    printf("operational after %lu ms\n", (unsigned long) (passed / 1000000));
    for (end = passed + TOGETHER_NS; passed < end;)
        cycle(period);
    for (end = passed + TOGETHER_NS; passed < end;) {
        uint32_t difference;

        cycle(period);
        difference = ecrt_master_sync_monitor_process(master);
        if (difference != UINT32_MAX && difference > largest)
            largest = difference;
    }
    if (read_delay(0, period, &first) || read_delay(1, period, &second))
        return 1;
    printf("delay %u ns, difference at most %u ns\n", (unsigned int) second, (unsigned int) largest);
    /* One SubDevice and its cable. */
    CHECK(first == 0 && second > 100 && second < 10000);
    /* The time of the last distribution stays readable in cycles without one. */
    for (end = passed + LIMIT_NS; ecrt_master_reference_clock_time(master, &first) && passed < end;)
        cycle(period);
    distributes = 0;
    for (end = passed + 20 * period; passed < end;) {
        cycle(period);
        CHECK(!ecrt_master_reference_clock_time(master, &second));
    }
    ecrt_release_master(master);
    return 0;
}
