/*
 * Cyclic calls beside another thread. Those that touch no link allocate nothing; a second caller at the same time gets
 * -EBUSY and nothing breaks. Receive and send are not counted: the simulated segment allocates in them.
 */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

enum { DRIVE = 2 };

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *memory, size_t size);

static _Thread_local int counts;
static _Thread_local unsigned long allocations;

void *malloc(size_t size)
{
    allocations += (unsigned long) counts;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    allocations += (unsigned long) counts;
    return __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size)
{
    allocations += (unsigned long) counts;
    return __libc_realloc(memory, size);
}

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *sc;
static ec_sdo_request_t *sdo;
static atomic_int ends;
static unsigned long refused, wrong;

static void pause_us(long us)
{
    struct timespec pause = {0, us * 1000};
    nanosleep(&pause, NULL);
}

static void *disturb(void *unused)
{
    (void) unused;
    while (!atomic_load(&ends)) {
        int results[] = {
            ecrt_master_receive(master), ecrt_domain_process(domain), ecrt_master_application_time(master, 5)};
        size_t i;

        for (i = 0; i < sizeof results / sizeof *results; i++) {
            refused += results[i] == -EBUSY;
            wrong += results[i] != -EBUSY && results[i] != 0;
        }
    }
    return NULL;
}

static int cycle(void)
{
    ec_domain_state_t state;
    ec_master_state_t segment;
    ec_master_link_state_t link;
    ec_slave_config_state_t drive;
    int wrongs = 0;

    ecrt_master_receive(master);
    counts = 1;
    wrongs += ecrt_domain_process(domain) != 0;
    wrongs += ecrt_domain_state(domain, &state) != 0;
    wrongs += ecrt_master_state(master, &segment) != 0;
    wrongs += ecrt_master_link_state(master, 0, &link) != 0;
    wrongs += ecrt_slave_config_state(sc, &drive) != 0;
    wrongs += ecrt_master_application_time(master, 7) != 0;
    wrongs += ecrt_master_sync_reference_clock(master) != 0;
    wrongs += ecrt_master_sync_slave_clocks(master) != 0;
    wrongs += ecrt_master_sync_monitor_queue(master) != 0;
    ecrt_master_sync_monitor_process(master);
    if (ecrt_sdo_request_state(sdo) != EC_REQUEST_BUSY) {
        wrongs += ecrt_sdo_request_index(sdo, 0x6041, 0) != 0;
        wrongs += ecrt_sdo_request_read(sdo) != 0;
    }
    EC_WRITE_U16(ecrt_domain_data(domain), 0);
    wrongs += ecrt_domain_size(domain) == 0;
    wrongs += ecrt_domain_queue(domain) != 0;
    counts = 0;
    ecrt_master_send(master);
    pause_us(1000);
    return wrongs;
}

/* A cycle may be left out while the delays of clocks are measured. */
static int is_complete(void)
{
    ec_domain_state_t state;

    return ecrt_domain_state(domain, &state) == 0 && state.wc_state == EC_WC_COMPLETE;
}

int main(void)
{
    ec_slave_info_t info;
    ec_slave_config_state_t drive = {0, 0, 0};
    pthread_t other;
    int i;

    CHECK(master = ecrt_request_master(0));
    CHECK(domain = ecrt_master_create_domain(master));
    CHECK(ecrt_master_get_slave(master, DRIVE, &info) == 0);
    CHECK(sc = ecrt_master_slave_config(master, 0, DRIVE, info.vendor_id, info.product_code));
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6040, 0, domain, NULL) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, domain, NULL) > 0);
    CHECK(sdo = ecrt_slave_config_create_sdo_request(sc, 0x6041, 0, 2));
    CHECK(ecrt_master_activate(master) == 0);
    for (i = 0; i < 10000 && !drive.operational; i++) {
        CHECK(cycle() == 0);
        CHECK(ecrt_slave_config_state(sc, &drive) == 0);
    }
    CHECK(drive.operational);
    allocations = 0;
    for (i = 0; i < 500; i++)
        CHECK(cycle() == 0);
    CHECK(allocations == 0);
    for (i = 0; i < 10000 && !is_complete(); i++)
        cycle();
    CHECK(is_complete());

    CHECK(pthread_create(&other, NULL, disturb, NULL) == 0);
    for (i = 0; i < 1000; i++)
        cycle();
    atomic_store(&ends, 1);
    CHECK(pthread_join(other, NULL) == 0);
    CHECK(wrong == 0);
    for (i = 0; i < 100; i++)
        CHECK(cycle() == 0);
    for (i = 0; i < 10000 && !is_complete(); i++)
        cycle();
    CHECK(is_complete());
    printf("refused %lu calls\n", refused);
    ecrt_release_master(master);
    return 0;
}
