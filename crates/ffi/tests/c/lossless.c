/*
 * A cyclic loop on a ring whose cables are cut and repaired: lossless PERIOD_US again|once|late|file [FILE].
 * "again": lost frames are sent again; "late": as well, but the loop receives once, before it processes; "file": the
 * domains are those of a network file. Prints "op" when frames can be sent again, then the times of CLOCK_MONOTONIC at
 * which cycles were incomplete, without those in which this thread was late. At the end of its input it prints the
 * number of cycles, and of those in which it was late.
 */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "ringcat.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)
#define LEARNING 130
/* Frames usually are back after this time. */
#define USUAL_NS 1000000U
#define LONGEST_START 5000

static ec_master_t *master;
static ec_domain_t *domain;
static uint64_t period_ns, next_ns, sent_ns;
static int receives_again = 1, is_late;
static atomic_int ends;

static uint64_t now_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t) now.tv_sec * 1000000000U + (uint64_t) now.tv_nsec;
}

/* A thread that wakes up late by more than a tenth of the period is not in time. */
static void sleep_until(uint64_t at_ns)
{
    struct timespec at = {(time_t) (at_ns / 1000000000U), (long) (at_ns % 1000000000U)};

    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR)
        ;
    is_late |= now_ns() > at_ns + period_ns / 10;
}

/* Returns whether the domain is complete. */
static int cycle(void)
{
    ec_domain_state_t state;
    uint64_t at;

    if (receives_again) {
        sleep_until(sent_ns + USUAL_NS);
        ecrt_master_receive(master);
        while (ringcat_master_receive_again_at(master, &at) == 0 && at < next_ns) {
            sleep_until(at);
            ecrt_master_receive(master);
        }
    }
    sleep_until(next_ns);
    next_ns += period_ns;
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_state(domain, &state);
    ecrt_domain_queue(domain);
    sent_ns = now_ns();
    ecrt_master_send(master);
    return state.wc_state == EC_WC_COMPLETE;
}

static int declare(const char *file)
{
    ec_master_info_t info;
    ec_slave_info_t slave;
    ec_slave_config_t *sc;
    uint16_t position;
    unsigned int bit;

    if (file) {
        CHECK(!ringcat_master_load_network(master, file));
        CHECK(domain = ringcat_master_domain(master, "cycle"));
        return 0;
    }
    CHECK(!ecrt_master(master, &info));
    CHECK(domain = ecrt_master_create_domain(master));
    CHECK(!ecrt_master_set_send_interval(master, period_ns / 1000));
    for (position = 0; position < info.slave_count; position++) {
        CHECK(!ecrt_master_get_slave(master, position, &slave));
        CHECK(sc = ecrt_master_slave_config(master, 0, position, slave.vendor_id, slave.product_code));
        CHECK(ecrt_slave_config_reg_pdo_entry_pos(sc, 0, 0, 0, domain, &bit) >= 0);
    }
    return 0;
}

static void *read_input(void *unused)
{
    (void) unused;
    while (getchar() != EOF)
        ;
    atomic_store(&ends, 1);
    return NULL;
}

int main(int argc, char **argv)
{
    unsigned long cycles = 0, late = 0;
    ec_domain_t *ended;
    pthread_t reader;
    uint64_t at = 0;
    int number, complete, was_late;

    CHECK(argc >= 3);
    period_ns = strtoull(argv[1], NULL, 10) * 1000;
    CHECK(master = ecrt_request_master(0));
    if (declare(argc > 3 ? argv[3] : NULL))
        return 1;
    if (!strcmp(argv[2], "again") || !strcmp(argv[2], "late"))
        CHECK(!ringcat_domain_send_again(domain, 1));
    receives_again = strcmp(argv[2], "late") != 0;
    CHECK(ringcat_domain_send_again(NULL, 1) == -EINVAL);
    CHECK(ringcat_master_receive_again_at(NULL, &at) == -EINVAL);
    CHECK(ringcat_master_receive_again_at(master, NULL) == -EFAULT);
    CHECK(!ringcat_master_receive_again_at(master, &at) && at == UINT64_MAX);
    CHECK(!ecrt_master_activate(master));
    CHECK(ringcat_domain_send_again(domain, 1) == -EBUSY);
    CHECK(!pthread_create(&reader, NULL, read_input, NULL));
    sent_ns = now_ns();
    next_ns = sent_ns + period_ns;
    for (number = 0; number < LONGEST_START && !cycle(); number++)
        ;
    for (number = 0; number < LEARNING; number++)
        cycle();
    printf("op\n");
    fflush(stdout);
    for (was_late = is_late = 0; !atomic_load(&ends); was_late = is_late, is_late = 0) {
        complete = cycle();
        cycles++;
        /* A cycle is evaluated at its end, when the next one may be late already. */
        late += was_late || is_late;
        if (!complete && !was_late && !is_late)
            printf("incomplete %llu\n", (unsigned long long) now_ns());
    }
    printf("cycles %lu, late %lu\n", cycles, late);
    ended = domain;
    CHECK(!ecrt_master_deactivate(master));
    CHECK(ringcat_domain_send_again(ended, 1) == -EINVAL);
    ecrt_release_master(master);
    return 0;
}
