/*
 * A network file in place of declarations: a drive is enabled with a target velocity.
 *
 *     network FILE.toml [CYCLES]
 *
 * The file is made by `ringcat init`; it names the SubDevices, their PDOs and start-up commands, and the variables.
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "ringcat.h"

enum { PERIOD_NS = 1000000, VELOCITY = 1000, VELOCITY_MODE = 9, ENABLED = 0x27 };

static ringcat_variable_t controlword, statusword, target_velocity, mode, mode_display;

static int find(ec_master_t *master, const char *name, ringcat_variable_t *variable)
{
    int result = ringcat_master_variable(master, name, variable);

    if (result)
        fprintf(stderr, "%s: no such variable (%i)\n", name, result);
    return result;
}

static uint8_t *byte_of(const ringcat_variable_t *variable)
{
    return ecrt_domain_data(variable->domain) + variable->offset;
}

/* The next step of a CiA 402 drive on its way to "operation enabled". */
static uint16_t command_for(uint16_t status)
{
    if ((status & 0x6f) == 0x27 || (status & 0x6f) == 0x23)
        return 0x0f;
    if ((status & 0x6f) == 0x21)
        return 0x07;
    return status & 0x08 ? 0x80 : 0x06;
}

int main(int argc, char **argv)
{
    ec_master_t *master = ecrt_request_master(0);
    long cycle, cycles = argc > 2 ? atol(argv[2]) : 10000;
    struct timespec next;
    ec_domain_t *domain;
    uint16_t status = 0;

    if (argc < 2 || !master || ringcat_master_load_network(master, argv[1]))
        return 1;
    domain = ringcat_master_domain(master, "cycle");
    if (!domain || find(master, "servo.Command.Controlword", &controlword)
        || find(master, "servo.Command.Target velocity", &target_velocity)
        || find(master, "servo.Command.Mode of operation", &mode)
        || find(master, "servo.Feedback.Statusword", &statusword)
        || find(master, "servo.Feedback.Mode display", &mode_display) || ecrt_master_activate(master))
        return 1;
    clock_gettime(CLOCK_MONOTONIC, &next);
    for (cycle = 0; cycle < cycles; cycle++) {
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        status = EC_READ_U16(byte_of(&statusword));
        EC_WRITE_U16(byte_of(&controlword), command_for(status));
        EC_WRITE_S32(byte_of(&target_velocity), VELOCITY);
        EC_WRITE_S8(byte_of(&mode), VELOCITY_MODE);
        if ((status & 0x6f) == ENABLED) {
            printf("enabled in mode %i.\n", EC_READ_S8(byte_of(&mode_display)));
            break;
        }
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        next.tv_nsec += PERIOD_NS;
        if (next.tv_nsec >= 1000000000) {
            next.tv_nsec -= 1000000000;
            next.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    }
    ecrt_release_master(master);
    if ((status & 0x6f) != ENABLED) {
        fprintf(stderr, "not enabled within %li cycles, statusword 0x%04x\n", cycles, status);
        return 1;
    }
    return 0;
}
