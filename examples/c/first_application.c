/*
 * A first application: a running light on digital outputs, an analogue input that is printed once a second.
 *
 * It uses the SubDevices at positions 0, 2, 3 and 4: EK1100, EL2032, EL3102, EL4102. What is at position 1 stays in
 * PREOP. An argument limits the number of cycles of 1 ms.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "ecrt.h"

#define PERIOD_NS 1000000L
#define NS_PER_S 1000000000L
#define CYCLES_PER_S (NS_PER_S / PERIOD_NS)

#define COUPLER 0, 0, 2, 0x044c2c52
#define DIGITAL_OUT 0, 2, 2, 0x07f03052
#define ANALOGUE_IN 0, 3, 2, 0x0c1e3052
#define ANALOGUE_OUT 0, 4, 2, 0x10063052

static ec_pdo_entry_info_t digital_out_entries[] = {
    {0x3001, 1, 1}, {0x3001, 2, 1}, {0x3001, 3, 1}, {0x3001, 4, 1},
};
static ec_pdo_info_t digital_out_pdos[] = {
    {0x1600, 1, &digital_out_entries[0]},
    {0x1601, 1, &digital_out_entries[1]},
    {0x1602, 1, &digital_out_entries[2]},
    {0x1603, 1, &digital_out_entries[3]},
};
static ec_sync_info_t digital_out_syncs[] = {
    {0, EC_DIR_OUTPUT, 4, digital_out_pdos, EC_WD_DEFAULT},
    {1, EC_DIR_INPUT, 0, NULL, EC_WD_DEFAULT},
    {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT},
};

static ec_pdo_entry_info_t analogue_in_entries[] = {
    {0x3101, 1, 8}, {0x3101, 2, 16}, {0x3102, 1, 8}, {0x3102, 2, 16},
};
static ec_pdo_info_t analogue_in_pdos[] = {
    {0x1A00, 2, &analogue_in_entries[0]},
    {0x1A01, 2, &analogue_in_entries[2]},
};
static ec_sync_info_t analogue_in_syncs[] = {
    {2, EC_DIR_OUTPUT, 0, NULL, EC_WD_DEFAULT},
    {3, EC_DIR_INPUT, 2, analogue_in_pdos, EC_WD_DEFAULT},
    {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT},
};

static ec_pdo_entry_info_t analogue_out_entries[] = {{0x3001, 1, 16}, {0x3002, 1, 16}};
static ec_pdo_info_t analogue_out_pdos[] = {
    {0x1600, 1, &analogue_out_entries[0]},
    {0x1601, 1, &analogue_out_entries[1]},
};
static ec_sync_info_t analogue_out_syncs[] = {
    {2, EC_DIR_OUTPUT, 2, analogue_out_pdos, EC_WD_DEFAULT},
    {3, EC_DIR_INPUT, 0, NULL, EC_WD_DEFAULT},
    {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT},
};

static unsigned int at_digital_out, at_status, at_value, at_analogue_out;
static const ec_pdo_entry_reg_t places[] = {
    {DIGITAL_OUT, 0x3001, 1, &at_digital_out, NULL},
    {ANALOGUE_IN, 0x3101, 1, &at_status, NULL},
    {ANALOGUE_IN, 0x3101, 2, &at_value, NULL},
    {ANALOGUE_OUT, 0x3001, 1, &at_analogue_out, NULL},
    {0, 0, 0, 0, 0, 0, NULL, NULL},
};

static ec_master_t *master;
static ec_domain_t *domain1;
static ec_slave_config_t *analogue_in;
static uint8_t *data;
static volatile sig_atomic_t ended;

static void end(int number)
{
    (void) number;
    ended = 1;
}

static void show_domain(void)
{
    static ec_domain_state_t last;
    ec_domain_state_t now;

    ecrt_domain_state(domain1, &now);
    if (now.working_counter != last.working_counter)
        printf("Domain1: WC %u.\n", now.working_counter);
    if (now.wc_state != last.wc_state)
        printf("Domain1: State %u.\n", now.wc_state);
    last = now;
}

static void show_master(void)
{
    static ec_master_state_t last;
    ec_master_state_t now;

    ecrt_master_state(master, &now);
    if (now.slaves_responding != last.slaves_responding)
        printf("%u slave(s).\n", now.slaves_responding);
    if (now.al_states != last.al_states)
        printf("AL states: 0x%02X.\n", now.al_states);
    if (now.link_up != last.link_up)
        printf("Link is %s.\n", now.link_up ? "up" : "down");
    last = now;
}

static void show_analogue_in(void)
{
    static ec_slave_config_state_t last;
    ec_slave_config_state_t now;

    ecrt_slave_config_state(analogue_in, &now);
    if (now.al_state != last.al_state)
        printf("AnaIn: State 0x%02X.\n", now.al_state);
    if (now.online != last.online)
        printf("AnaIn: %s.\n", now.online ? "online" : "offline");
    if (now.operational != last.operational)
        printf("AnaIn: %soperational.\n", now.operational ? "" : "Not ");
    last = now;
}

static void cycle(unsigned long number)
{
    static unsigned int light;

    ecrt_master_receive(master);
    ecrt_domain_process(domain1);
    show_domain();
    if (number % CYCLES_PER_S == 0) {
        light = !light;
        show_master();
        show_analogue_in();
        printf("AnaIn: state %u value %u\n", EC_READ_U8(data + at_status), EC_READ_U16(data + at_value));
        fflush(stdout);
    }
    EC_WRITE_U8(data + at_digital_out, light ? 0x06 : 0x09);
    EC_WRITE_S16(data + at_analogue_out, (int16_t) (number % 1000));
    ecrt_domain_queue(domain1);
    ecrt_master_send(master);
}

static int configure(void)
{
    ec_slave_config_t *sc;

    if (!(domain1 = ecrt_master_create_domain(master)))
        return -1;
    if (!(analogue_in = ecrt_master_slave_config(master, ANALOGUE_IN)))
        return -1;
    if (ecrt_slave_config_pdos(analogue_in, EC_END, analogue_in_syncs))
        return -1;
    sc = ecrt_master_slave_config(master, ANALOGUE_OUT);
    if (!sc || ecrt_slave_config_pdos(sc, EC_END, analogue_out_syncs))
        return -1;
    sc = ecrt_master_slave_config(master, DIGITAL_OUT);
    if (!sc || ecrt_slave_config_pdos(sc, EC_END, digital_out_syncs))
        return -1;
    if (!ecrt_master_slave_config(master, COUPLER))
        return -1;
    return ecrt_domain_reg_pdo_entry_list(domain1, places);
}

int main(int argc, char **argv)
{
    unsigned long cycles = argc > 1 ? strtoul(argv[1], NULL, 0) : 0, number;
    struct timespec next;

    if (!(master = ecrt_request_master(0)))
        return 1;
    printf("Configuring PDOs...\n");
    if (configure()) {
        fprintf(stderr, "Failed to configure PDOs.\n");
        return 1;
    }
    printf("Activating master...\n");
    if (ecrt_master_activate(master) || !(data = ecrt_domain_data(domain1)))
        return 1;
    if (mlockall(MCL_CURRENT))
        fprintf(stderr, "Warning: Failed to lock memory: %s\n", strerror(errno));
    signal(SIGINT, end);
    signal(SIGTERM, end);
    printf("Starting cyclic task with dt=%ld ns.\n", PERIOD_NS);
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
    return 0;
}
