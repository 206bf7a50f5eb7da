/*
 * A configuration is for the SubDevice at its position, and for no other one: places. The bus has outputs of 8 bits at
 * position 0 and of 16 bits at position 1.
 */
#include <stdio.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

int main(void)
{
    const struct timespec pause = {0, 1000000};
    ec_master_t *master = ecrt_request_master(0);
    ec_slave_config_state_t state;
    ec_slave_config_t *wrong, *right;
    ec_slave_info_t bits_8, bits_16;
    int rounds;

    CHECK(master);
    CHECK(ecrt_master_get_slave(master, 0, &bits_8) == 0 && ecrt_master_get_slave(master, 1, &bits_16) == 0);
    CHECK(wrong = ecrt_master_slave_config(master, 0, 1, bits_8.vendor_id, bits_8.product_code));
    CHECK(right = ecrt_master_slave_config(master, 0, 7, bits_16.vendor_id, bits_16.product_code));
    CHECK(ecrt_master_activate(master) == 0);
    for (rounds = 0; rounds < 3000; rounds++) {
        ecrt_master_receive(master);
        ecrt_master_send(master);
        nanosleep(&pause, NULL);
        CHECK(ecrt_slave_config_state(wrong, &state) == 0 && !state.online && !state.operational);
        CHECK(ecrt_slave_config_state(right, &state) == 0 && !state.online && !state.operational);
    }
    ecrt_release_master(master);
    return 0;
}
