/*
 * A running light on a ring of two links whose cables may be cut while it runs.
 *
 * It uses every SubDevice of the type of the first one, and prints each change of the links and of the ring, and at its
 * end the number of cycles without complete process data. An argument limits the number of cycles of 1 ms. The
 * exit status is 0 only if no SubDevice left OP after all had reached it.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <time.h>

#include "ecrt.h"

#define PERIOD_NS 1000000L
#define NS_PER_S 1000000000L
#define LINKS 2
#define MOST_LIGHTS 64
#define OUTPUT 0x7000, 1

static ec_master_t *master;
static ec_domain_t *domain;
static uint8_t *data;
static int lights[MOST_LIGHTS];
static unsigned int count, incomplete, left_op, were_in_op;
static volatile sig_atomic_t ended;

static void end(int number)
{
    (void) number;
    ended = 1;
}

/* Declares every SubDevice of the type at position 0. Returns 0 if all calls succeed. */
static int declare(void)
{
    ec_master_info_t bus;
    ec_slave_info_t first, info;
    ec_slave_config_t *sc;
    uint16_t position;

    if (ecrt_master(master, &bus) || ecrt_master_get_slave(master, 0, &first))
        return 1;
    for (position = 0; position < bus.slave_count && count < MOST_LIGHTS; position++) {
        if (ecrt_master_get_slave(master, position, &info))
            return 1;
        if (info.vendor_id != first.vendor_id || info.product_code != first.product_code)
            continue;
        sc = ecrt_master_slave_config(master, 0, position, info.vendor_id, info.product_code);
        lights[count] = sc ? ecrt_slave_config_reg_pdo_entry(sc, OUTPUT, domain, NULL) : -1;
        if (lights[count++] < 0)
            return 1;
    }
    return 0;
}

static void show_links(unsigned long number)
{
    static const char *const names[LINKS] = {"Main", "Redundant"};
    static ec_master_link_state_t last[LINKS];
    ec_master_link_state_t now;
    unsigned int link;

    for (link = 0; link < LINKS; link++) {
        if (ecrt_master_link_state(master, link, &now))
            continue;
        if (now.link_up != last[link].link_up || now.slaves_responding != last[link].slaves_responding)
            printf("%lu ms: %s link: %s, %u SubDevice(s).\n", number, names[link], now.link_up ? "up" : "down",
                now.slaves_responding);
        last[link] = now;
    }
}

static void show_ring(unsigned long number)
{
    static unsigned int was_open = 2;
    static int was_complete;
    ec_domain_state_t now;
    ec_master_state_t state;

    ecrt_domain_state(domain, &now);
    ecrt_master_state(master, &state);
    if (were_in_op) {
        incomplete += now.wc_state != EC_WC_COMPLETE;
        /* None in a cycle whose frames were lost. */
        left_op += (state.al_states & ~(unsigned int) EC_AL_STATE_OP) != 0;
        if (now.redundancy_active != was_open)
            printf("%lu ms: The ring is %s.\n", number, now.redundancy_active ? "open" : "closed");
        was_open = now.redundancy_active;
    }
    if (!were_in_op && state.al_states == EC_AL_STATE_OP && now.wc_state == EC_WC_COMPLETE) {
        printf("%lu ms: %u SubDevice(s) in OP.\n", number, count);
        were_in_op = 1;
    }
    if (was_complete != (now.wc_state == EC_WC_COMPLETE))
        printf("%lu ms: Process data %s.\n", number, was_complete ? "incomplete" : "complete");
    was_complete = now.wc_state == EC_WC_COMPLETE;
}

static void cycle(unsigned long number)
{
    unsigned int light;

    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    show_links(number);
    show_ring(number);
    fflush(stdout);
    for (light = 0; light < count; light++)
        EC_WRITE_U8(data + lights[light], number / 100 % count == light ? 0xff : 0);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

int main(int argc, char **argv)
{
    unsigned long cycles = argc > 1 ? strtoul(argv[1], NULL, 0) : 0, number;
    struct timespec next;

    if (!(master = ecrt_request_master(0)))
        return 1;
    if (!(domain = ecrt_master_create_domain(master)) || declare()) {
        fprintf(stderr, "Failed to configure the lights.\n");
        return 1;
    }
    if (ecrt_master_activate(master) || !(data = ecrt_domain_data(domain)))
        return 1;
    signal(SIGINT, end);
    signal(SIGTERM, end);
    clock_gettime(CLOCK_MONOTONIC, &next);
    for (number = 0; !ended && (!cycles || number < cycles); number++) {
        cycle(number);
        next.tv_nsec += PERIOD_NS;
        if (next.tv_nsec >= NS_PER_S) {
            next.tv_nsec -= NS_PER_S;
            next.tv_sec++;
        }
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL) == EINTR && !ended)
            ;
    }
    ecrt_release_master(master);
    printf("%u cycle(s) without complete process data in OP, %u with a SubDevice out of OP.\n", incomplete, left_op);
    return were_in_op && !left_op ? 0 : 2;
}
