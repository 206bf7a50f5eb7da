/*
 * An ENI in C, by path and from memory, and a network file from memory: eni FILE.xml FILE.toml
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "ringcat.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

static ec_master_t *master;

/* The contents of a file, with its size. */
static char *contents(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    char *data = NULL;

    if (file && fseek(file, 0, SEEK_END) == 0 && (data = malloc(*size = (size_t) ftell(file))) != NULL) {
        rewind(file);
        if (fread(data, 1, *size, file) != *size)
            abort();
    }
    if (file)
        fclose(file);
    return data;
}

/* Brings the network to OP with the variables of its file, and takes it down again. */
static int check_lamp(const char *name_of_domain)
{
    const struct timespec pause = {0, 1000000};
    ec_domain_t *domain = ringcat_master_domain(master, name_of_domain);
    ec_slave_config_t *servo = ringcat_master_subdevice(master, "servo");
    ringcat_variable_t lamp, status;
    ec_slave_config_state_t state = {0, 0, 0};
    ec_domain_state_t complete;
    int rounds;

    CHECK(domain && servo);
    CHECK(ringcat_master_variable(master, "nothing", &lamp) == -ENOENT);
    CHECK(ringcat_master_variable(master, "digital-output-8.Channel 3.Output", &lamp) == 0);
    CHECK(lamp.domain == domain && lamp.bits == 1 && lamp.bit == 2 && lamp.is_output);
    CHECK(ringcat_master_variable(master, "servo.Feedback.Statusword", &status) == 0);
    CHECK(status.domain == domain && status.bits == 16 && !status.is_output);
    /* Settings of the file stay. */
    CHECK(ecrt_slave_config_sdo8(servo, 0x6060, 0, 3) == -EBUSY);
    CHECK(ecrt_master_activate(master) == 0);
    for (rounds = 0; rounds < 15000 && !state.operational; rounds++) {
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        EC_WRITE_BIT(ecrt_domain_data(domain) + lamp.offset, lamp.bit, 1);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        nanosleep(&pause, NULL);
        ecrt_slave_config_state(servo, &state);
    }
    CHECK(state.operational);
    ecrt_domain_state(domain, &complete);
    CHECK(complete.wc_state == EC_WC_COMPLETE);
    CHECK(EC_READ_U16(ecrt_domain_data(domain) + status.offset) != 0);
    CHECK(ecrt_master_deactivate(master) == 0);
    CHECK(ringcat_master_variable(master, "servo.Feedback.Statusword", &status) == -ENOENT);
    return 0;
}

int main(int argc, char **argv)
{
    size_t eni_size = 0, network_size = 0;
    char *eni, *network;

    CHECK(argc == 3);
    CHECK((eni = contents(argv[1], &eni_size)) && (network = contents(argv[2], &network_size)));
    CHECK(master = ecrt_open_master(0));
    CHECK(ringcat_master_load_eni(master, argv[1]) == -EPERM);
    CHECK(ringcat_master_load_eni_data(master, eni, eni_size) == -EPERM);
    CHECK(ringcat_master_load_network_data(master, network, network_size) == -EPERM);
    CHECK(ecrt_master_reserve(master) == 0);
    CHECK(ringcat_master_load_eni(master, NULL) == -EFAULT);
    CHECK(ringcat_master_load_eni_data(master, NULL, 0) == -EFAULT);
    CHECK(ringcat_master_load_network_data(master, NULL, 7) == -EFAULT);
    CHECK(ringcat_master_load_eni(master, "no such file") == -EINVAL);
    CHECK(ringcat_master_load_eni(master, argv[2]) == -EINVAL);
    CHECK(ringcat_master_load_eni_data(master, eni, eni_size / 2) == -EINVAL);
    CHECK(ringcat_master_load_eni_data(master, eni, 0) == -EINVAL);
    CHECK(ringcat_master_load_network_data(master, eni, eni_size) == -EINVAL);
    /* Nothing of a refused file is declared. */
    CHECK(ringcat_master_load_eni(master, argv[1]) == 0);
    CHECK(ringcat_master_load_eni(master, argv[1]) == -EBUSY);
    CHECK(ringcat_master_load_network_data(master, network, network_size) == -EBUSY);
    CHECK(check_lamp("0") == 0);
    /* The memory is read once. */
    CHECK(ringcat_master_load_eni_data(master, eni, eni_size) == 0);
    free(eni);
    CHECK(check_lamp("0") == 0);
    CHECK(ringcat_master_load_network_data(master, network, network_size) == 0);
    free(network);
    CHECK(check_lamp("cycle") == 0);
    ecrt_release_master(master);
    return 0;
}
