/*
 * Codes of ringcat.h, and what a loaded network is for ecrt.h: network FILE.toml WRONG.toml
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ringcat.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

static ec_master_t *master;

static int check_names(void)
{
    ringcat_variable_t variable;
    ec_slave_config_t *drive = ringcat_master_subdevice(master, "servo");
    ec_domain_t *domain = ringcat_master_domain(master, "cycle");
    ec_slave_info_t info;
    uint8_t data[4] = {5, 0, 0, 0};
    uint32_t abort_code;
    unsigned int bit = 9;
    int offset;

    CHECK(drive && domain);
    CHECK(!ringcat_master_subdevice(master, "nothing") && !ringcat_master_subdevice(master, NULL));
    CHECK(!ringcat_master_domain(master, "nothing") && !ringcat_master_domain(NULL, "cycle"));
    CHECK(ringcat_master_variable(master, "nothing", &variable) == -ENOENT);
    CHECK(ringcat_master_variable(master, NULL, &variable) == -EFAULT);
    CHECK(ringcat_master_variable(master, "servo.Feedback.Statusword", NULL) == -EFAULT);
    /* The same SubDevice and the same place for the functions of ecrt.h. */
    CHECK(ecrt_master_get_slave(master, 2, &info) == 0);
    CHECK(ecrt_master_slave_config(master, 0, 2, info.vendor_id, info.product_code) == drive);
    CHECK(ringcat_master_variable(master, "servo.Feedback.Statusword", &variable) == 0);
    CHECK(variable.domain == domain && variable.bits == 16 && variable.bit == 0 && !variable.is_output);
    offset = ecrt_slave_config_reg_pdo_entry(drive, 0x6041, 0, domain, &bit);
    CHECK(offset == (int) variable.offset && bit == variable.bit);
    CHECK(ringcat_master_variable(master, "digital-output-8.Channel 3.Output", &variable) == 0);
    CHECK(variable.bits == 1 && variable.bit == 2 && variable.is_output);
    /* Settings of the file stay. */
    CHECK(ecrt_slave_config_sdo8(drive, 0x6060, 0, 3) == -EBUSY);
    CHECK(ecrt_slave_config_pdo_assign_clear(drive, 2) == -EBUSY);
    CHECK(ecrt_slave_config_dc(drive, 0x0300, 1000000, 0, 0, 0) == -EBUSY);
    CHECK(ecrt_slave_config_create_sdo_request(drive, 0x6061, 0, 1) != NULL);
    CHECK(ecrt_master_sdo_download(master, 2, 0x6065, 0, data, 4, &abort_code) == 0);
    return 0;
}

static int check_lamp(void)
{
    const struct timespec pause = {0, 1000000};
    ringcat_variable_t lamp;
    ec_slave_config_state_t state = {0, 0, 0};
    ec_domain_state_t complete;
    int rounds;

    CHECK(ringcat_master_variable(master, "digital-output-8.Channel 3.Output", &lamp) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    for (rounds = 0; rounds < 15000 && !state.operational; rounds++) {
        ecrt_master_receive(master);
        ecrt_domain_process(lamp.domain);
        EC_WRITE_BIT(ecrt_domain_data(lamp.domain) + lamp.offset, lamp.bit, 1);
        ecrt_domain_queue(lamp.domain);
        ecrt_master_send(master);
        nanosleep(&pause, NULL);
        ecrt_slave_config_state(ringcat_master_subdevice(master, "servo"), &state);
    }
    CHECK(state.operational);
    ecrt_domain_state(lamp.domain, &complete);
    CHECK(complete.wc_state == EC_WC_COMPLETE);
    CHECK(ringcat_master_load_network(master, "any") == -EBUSY);
    return 0;
}

int main(int argc, char **argv)
{
    ringcat_variable_t variable;
    uint8_t data[4];
    size_t size = 0;
    uint32_t abort_code;

    CHECK(argc == 3);
    CHECK(master = ecrt_open_master(0));
    CHECK(ringcat_master_load_network(master, argv[1]) == -EPERM);
    CHECK(ringcat_master_variable(master, "servo", &variable) == -EPERM);
    CHECK(ecrt_master_reserve(master) == 0);
    CHECK(ringcat_master_load_network(master, NULL) == -EFAULT);
    CHECK(ringcat_master_load_network(master, "no such file") == -EINVAL);
    CHECK(ringcat_master_load_network(master, argv[2]) == -EINVAL);
    CHECK(ringcat_master_load_network(master, argv[1]) == 0);
    CHECK(ringcat_master_load_network(master, argv[1]) == -EBUSY);
    CHECK(check_names() == 0 && check_lamp() == 0);
    /* With the application the network ends. */
    CHECK(ecrt_master_deactivate(master) == 0);
    /* The start-up command of the file came behind the write of this program. */
    CHECK(ecrt_master_sdo_upload(master, 2, 0x6065, 0, data, 4, &size, &abort_code) == 0);
    CHECK(size == 4 && EC_READ_U32(data) == 2000);
    CHECK(ringcat_master_variable(master, "servo.Feedback.Statusword", &variable) == -ENOENT);
    CHECK(ringcat_master_load_network(master, argv[1]) == 0);
    CHECK(check_lamp() == 0);
    ecrt_release_master(master);
    return 0;
}
