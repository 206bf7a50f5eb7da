/* Handles of the fake library after the release of their master, many times: each call is refused. */
#include <errno.h>
#include <stdio.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)
#define ROUNDS 100

static int round_of(int is_active)
{
    static const ec_pdo_entry_info_t entries[] = {{0x7000, 1, 8}};
    static const ec_pdo_info_t pdos[] = {{0x1600, 1, entries}};
    static const ec_sync_info_t syncs[] = {
        {2, EC_DIR_OUTPUT, 1, pdos, EC_WD_DEFAULT}, {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};
    static const uint8_t data[] = {1, 2};
    ec_master_t *master;
    ec_domain_t *domain;
    ec_slave_config_t *sc;
    ec_sdo_request_t *sdo;
    ec_master_state_t state;
    ec_domain_state_t domain_state;

    CHECK((master = ecrt_request_master(0)) && (domain = ecrt_master_create_domain(master)));
    CHECK((sc = ecrt_master_slave_config(master, 0, 1, 2, 3)) && ecrt_slave_config_pdos(sc, EC_END, syncs) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x7000, 1, domain, NULL) == 0);
    CHECK(ecrt_slave_config_sdo(sc, 0x8000, 1, data, sizeof data) == 0);
    CHECK(sdo = ecrt_slave_config_create_sdo_request(sc, 0x8000, 1, 2));
    /* As in libethercat: protocol 6.5 has 32 characters. */
    CHECK(ecrt_slave_config_eoe_hostname(sc, "abcdefghijklmnopqrstuvwxyz012345") == 0);
    CHECK(ecrt_slave_config_eoe_hostname(sc, "abcdefghijklmnopqrstuvwxyz0123456") == -EINVAL);
    if (is_active)
        CHECK(ecrt_master_activate(master) == 0);
    ecrt_release_master(master);
    ecrt_release_master(master);
    CHECK(ecrt_master_send(master) == -EINVAL && ecrt_master_state(master, &state) == -EINVAL);
    CHECK(ecrt_master_activate(master) == -EINVAL && !ecrt_master_create_domain(master));
    CHECK(ecrt_domain_process(domain) == -EINVAL && ecrt_domain_state(domain, &domain_state) == -EINVAL);
    CHECK(!ecrt_domain_data(domain) && ecrt_domain_size(domain) == 0);
    CHECK(ecrt_slave_config_sdo8(sc, 0x8000, 1, 1) == -EINVAL);
    CHECK(ecrt_sdo_request_state(sdo) == EC_REQUEST_ERROR && !ecrt_sdo_request_data(sdo));
    return 0;
}

int main(void)
{
    int count;

    for (count = 0; count < ROUNDS; count++)
        CHECK(round_of(count % 2) == 0);
    return 0;
}
