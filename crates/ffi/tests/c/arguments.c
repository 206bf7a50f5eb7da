/*
 * Calls functions with arguments that are wrong or extreme, and compares the results with the second table of
 * docs/ecrt.md, from which "tables.h" is made. A call may come several times, with the same result. What the manual
 * allows in any phase is called from two threads at once, before and while the application is active.
 */
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"
#include "names.h"

enum { OUTPUTS = 1, DRIVE = 2, PROTOCOLS = 3, AXES = 4, COUNT = 5 };

#define CODE(function, what, arguments) got(#function, what, name_of((long) function arguments))
#define POINTER(function, what, arguments) got(#function, what, function arguments ? "pointer" : "NULL")

static void got(const char *function, const char *what, const char *result)
{
    compare(by_argument, sizeof by_argument / sizeof *by_argument, function, what, result);
}

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *configs[COUNT], *absent;
static ec_sdo_request_t *sdo, *empty_sdo;
static ec_soe_request_t *soe;
static ec_reg_request_t *reg;
static ec_voe_handler_t *voe;

static void of_positions(ec_master_t *m)
{
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    ec_pdo_info_t pdo;
    ec_pdo_entry_info_t entry;

    CODE(ecrt_master_get_slave, "position behind the last", (m, COUNT, &slave));
    CODE(ecrt_master_get_slave, "position 65535", (m, 65535, &slave));
    CODE(ecrt_master_get_slave, "result NULL", (m, DRIVE, NULL));
    CODE(ecrt_master_get_sync_manager, "position behind the last", (m, COUNT, 0, &sync));
    CODE(ecrt_master_get_sync_manager, "SyncManager 4 of 4", (m, DRIVE, 4, &sync));
    CODE(ecrt_master_get_sync_manager, "SyncManager 16", (m, DRIVE, 16, &sync));
    CODE(ecrt_master_get_sync_manager, "SyncManager 255", (m, DRIVE, 255, &sync));
    CODE(ecrt_master_get_sync_manager, "result NULL", (m, DRIVE, 3, NULL));
    CODE(ecrt_master_get_pdo, "position behind the last", (m, COUNT, 3, 0, &pdo));
    CODE(ecrt_master_get_pdo, "SyncManager 16", (m, DRIVE, 16, 0, &pdo));
    CODE(ecrt_master_get_pdo, "PDO 65535", (m, DRIVE, 3, 65535, &pdo));
    CODE(ecrt_master_get_pdo, "result NULL", (m, DRIVE, 3, 0, NULL));
    CODE(ecrt_master_get_pdo_entry, "position behind the last", (m, COUNT, 3, 0, 0, &entry));
    CODE(ecrt_master_get_pdo_entry, "SyncManager 16", (m, DRIVE, 16, 0, 0, &entry));
    CODE(ecrt_master_get_pdo_entry, "PDO 65535", (m, DRIVE, 3, 65535, 0, &entry));
    CODE(ecrt_master_get_pdo_entry, "entry 65535", (m, DRIVE, 3, 0, 65535, &entry));
    CODE(ecrt_master_get_pdo_entry, "result NULL", (m, DRIVE, 3, 0, 0, NULL));
}

static void of_transfers(ec_master_t *m)
{
    uint8_t data[16] = {1};
    size_t size;
    uint32_t abort_code;

    CODE(ecrt_master_sdo_upload, "position behind the last", (m, COUNT, 0x1018, 1, data, 16, &size, &abort_code));
    CODE(ecrt_master_sdo_upload, "SubDevice without CoE", (m, OUTPUTS, 0x1018, 1, data, 16, &size, &abort_code));
    CODE(ecrt_master_sdo_upload, "subindex 255", (m, DRIVE, 0x1018, 255, data, 16, &size, &abort_code));
    CODE(ecrt_master_sdo_upload, "size 0", (m, DRIVE, 0x1018, 1, data, 0, &size, &abort_code));
    CODE(ecrt_master_sdo_upload, "size 3 of 4", (m, DRIVE, 0x1018, 1, data, 3, &size, &abort_code));
    CODE(ecrt_master_sdo_upload, "size maximal", (m, DRIVE, 0x1018, 1, data, SIZE_MAX, &size, &abort_code));
    CODE(ecrt_master_sdo_upload, "target NULL", (m, DRIVE, 0x1018, 1, NULL, 16, &size, &abort_code));
    CODE(ecrt_master_sdo_upload, "size of the result NULL", (m, DRIVE, 0x1018, 1, data, 16, NULL, &abort_code));
    CODE(ecrt_master_sdo_upload, "abort code NULL", (m, DRIVE, 0x1018, 255, data, 16, &size, NULL));
    CODE(ecrt_master_sdo_download, "position behind the last", (m, COUNT, 0x6066, 0, data, 2, &abort_code));
    CODE(ecrt_master_sdo_download, "size 0", (m, DRIVE, 0x6066, 0, data, 0, &abort_code));
    CODE(ecrt_master_sdo_download, "size maximal", (m, DRIVE, 0x6066, 0, data, SIZE_MAX, &abort_code));
    CODE(ecrt_master_sdo_download, "more than the object has", (m, DRIVE, 0x6066, 0, data, 16, &abort_code));
    CODE(ecrt_master_sdo_download, "data NULL", (m, DRIVE, 0x6066, 0, NULL, 2, &abort_code));
    CODE(ecrt_master_sdo_download, "abort code NULL", (m, DRIVE, 0x1018, 1, data, 4, NULL));
    CODE(ecrt_master_sdo_download_complete, "size 0", (m, DRIVE, 0x6066, data, 0, &abort_code));
    CODE(ecrt_master_sdo_download_complete, "data NULL", (m, DRIVE, 0x6066, NULL, 2, &abort_code));
    CODE(ecrt_master_sdo_download_complete, "size maximal", (m, DRIVE, 0x6066, data, SIZE_MAX, &abort_code));
}

static void of_idns(ec_master_t *m)
{
    uint8_t data[16] = {1};
    size_t size;
    uint16_t error_code;

    CODE(ecrt_master_read_idn, "position behind the last", (m, COUNT, 0, 2, data, 16, &size, &error_code));
    CODE(ecrt_master_read_idn, "SubDevice without SoE", (m, DRIVE, 0, 2, data, 16, &size, &error_code));
    CODE(ecrt_master_read_idn, "drive 8", (m, AXES, 8, 2, data, 16, &size, &error_code));
    CODE(ecrt_master_read_idn, "drive 255", (m, AXES, 255, 2, data, 16, &size, &error_code));
    CODE(ecrt_master_read_idn, "size 1 of 2", (m, AXES, 0, 2, data, 1, &size, &error_code));
    CODE(ecrt_master_read_idn, "target NULL", (m, AXES, 0, 2, NULL, 16, &size, &error_code));
    CODE(ecrt_master_read_idn, "error code NULL", (m, AXES, 0, 65535, data, 16, &size, NULL));
    CODE(ecrt_master_write_idn, "drive 8", (m, AXES, 8, 2, data, 2, &error_code));
    CODE(ecrt_master_write_idn, "size 0", (m, AXES, 0, 2, data, 0, &error_code));
    CODE(ecrt_master_write_idn, "data NULL", (m, AXES, 0, 2, NULL, 2, &error_code));
    CODE(ecrt_master_write_idn, "size maximal", (m, AXES, 0, 2, data, SIZE_MAX, &error_code));
}

static void of_states(ec_master_t *m)
{
    ec_master_link_state_t link;

    CODE(ecrt_master, "result NULL", (m, NULL));
    CODE(ecrt_master_scan_progress, "result NULL", (m, NULL));
    CODE(ecrt_master_state, "result NULL", (m, NULL));
    CODE(ecrt_master_link_state, "dev_idx 1 with one link", (m, 1, &link));
    CODE(ecrt_master_link_state, "dev_idx 2", (m, 2, &link));
    CODE(ecrt_master_link_state, "dev_idx maximal", (m, UINT_MAX, &link));
    CODE(ecrt_master_link_state, "result NULL", (m, 0, NULL));
    CODE(ecrt_master_link_state, "a domain as handle", ((ec_master_t *) domain, 0, &link));
    CODE(ecrt_domain_state, "result NULL", (domain, NULL));
    CODE(ecrt_slave_config_state, "result NULL", (configs[DRIVE], NULL));
    CODE(ecrt_domain_size, "a master as handle", ((ec_domain_t *) m));
}

static void *any_phase(void *unused)
{
    (void) unused;
    of_positions(master);
    of_transfers(master);
    of_idns(master);
    of_states(master);
    return NULL;
}

/* Two threads at once; a cycle keeps the application alive meanwhile. */
static int from_two_threads(void)
{
    pthread_t other;

    if (pthread_create(&other, NULL, any_phase, NULL))
        return 1;
    any_phase(NULL);
    return pthread_join(other, NULL);
}

static void of_pdos(ec_slave_config_t *sc)
{
    static const ec_pdo_entry_info_t entries[] = {{0x6040, 0, 16}};
    static const ec_pdo_info_t pdos[] = {{0x1601, 1, entries}}, no_entries[] = {{0x1601, 1, NULL}};
    const ec_sync_info_t no_pdos = {2, EC_DIR_OUTPUT, 1, NULL, EC_WD_DEFAULT};
    const ec_sync_info_t far = {16, EC_DIR_OUTPUT, 1, pdos, EC_WD_DEFAULT};
    const ec_sync_info_t no_direction = {2, EC_DIR_INVALID, 1, pdos, EC_WD_DEFAULT};
    const ec_sync_info_t no_list = {2, EC_DIR_OUTPUT, 1, no_entries, EC_WD_DEFAULT};

    CODE(ecrt_slave_config_sync_manager, "SyncManager 16", (sc, 16, EC_DIR_OUTPUT, EC_WD_DEFAULT));
    CODE(ecrt_slave_config_sync_manager, "SyncManager 255", (sc, 255, EC_DIR_OUTPUT, EC_WD_DEFAULT));
    CODE(ecrt_slave_config_sync_manager, "direction INVALID", (sc, 2, EC_DIR_INVALID, EC_WD_DEFAULT));
    CODE(ecrt_slave_config_sync_manager, "direction COUNT", (sc, 2, EC_DIR_COUNT, EC_WD_DEFAULT));
    CODE(ecrt_slave_config_sync_manager, "watchdog mode 3", (sc, 2, EC_DIR_OUTPUT, (ec_watchdog_mode_t) 3));
    CODE(ecrt_slave_config_pdo_assign_add, "SyncManager 16", (sc, 16, 0x1601));
    CODE(ecrt_slave_config_pdo_assign_add, "the same PDO twice", (sc, 2, 0x1600));
    CODE(ecrt_slave_config_pdo_assign_clear, "SyncManager 16", (sc, 16));
    CODE(ecrt_slave_config_pdo_mapping_add, "PDO that is not assigned", (sc, 0x17ff, 0x6040, 0, 16));
    CODE(ecrt_slave_config_pdo_mapping_clear, "PDO that is not assigned", (sc, 0x17ff));
    CODE(ecrt_slave_config_pdos, "n_syncs 0", (sc, 0, &far));
    CODE(ecrt_slave_config_pdos, "SyncManager 16", (sc, 1, &far));
    CODE(ecrt_slave_config_pdos, "direction INVALID", (sc, 1, &no_direction));
    CODE(ecrt_slave_config_pdos, "n_pdos 1, pdos NULL", (sc, 1, &no_pdos));
    CODE(ecrt_slave_config_pdos, "n_entries 1, entries NULL", (sc, 1, &no_list));
}

static void of_places(ec_slave_config_t *sc)
{
    unsigned int bit, offset;
    const ec_pdo_entry_reg_t end = {0, 0, 0, 0, 0, 0, NULL, NULL};
    ec_pdo_entry_reg_t list[] = {{0, DRIVE, 0, 0, 0x6041, 0, &offset, &bit}, {0, 0, 0, 0, 0, 0, NULL, NULL}};
    ec_slave_info_t drive;

    CODE(ecrt_slave_config_reg_pdo_entry, "object that is not mapped", (sc, 0x5fff, 0, domain, &bit));
    CODE(ecrt_slave_config_reg_pdo_entry, "index 0, a gap of the mapping", (sc, 0, 0, domain, &bit));
    CODE(ecrt_slave_config_reg_pdo_entry, "absent SubDevice", (absent, 0x6041, 0, domain, &bit));
    CODE(ecrt_slave_config_reg_pdo_entry, "bit_position NULL within a byte",
        (configs[OUTPUTS], 0x7010, 1, domain, NULL));
    CODE(ecrt_slave_config_reg_pdo_entry, "a master as domain", (sc, 0x6041, 0, (ec_domain_t *) master, &bit));
    CODE(ecrt_slave_config_reg_pdo_entry_pos, "SyncManager 16", (sc, 16, 0, 0, domain, &bit));
    CODE(ecrt_slave_config_reg_pdo_entry_pos, "PDO maximal", (sc, 3, UINT_MAX, 0, domain, &bit));
    CODE(ecrt_slave_config_reg_pdo_entry_pos, "entry maximal", (sc, 3, 0, UINT_MAX, domain, &bit));
    CODE(ecrt_domain_reg_pdo_entry_list, "empty list", (domain, &end));
    CODE(ecrt_domain_reg_pdo_entry_list, "other product at a declared place", (domain, list));
    if (ecrt_master_get_slave(master, DRIVE, &drive))
        return;
    list[0].vendor_id = drive.vendor_id;
    list[0].product_code = drive.product_code;
    list[0].offset = NULL;
    CODE(ecrt_domain_reg_pdo_entry_list, "offset NULL", (domain, list));
    list[0].offset = &offset;
    list[0].index = 0x5fff;
    CODE(ecrt_domain_reg_pdo_entry_list, "object that is not mapped", (domain, list));
}

static void of_start_up(ec_slave_config_t *sc)
{
    const uint8_t data[4] = {1};

    CODE(ecrt_slave_config_sdo, "size 0", (sc, 0x6066, 0, data, 0));
    CODE(ecrt_slave_config_sdo, "data NULL", (sc, 0x6066, 0, NULL, 2));
    CODE(ecrt_slave_config_sdo, "size maximal", (sc, 0x6066, 0, data, SIZE_MAX));
    CODE(ecrt_slave_config_complete_sdo, "size 0", (sc, 0x6066, data, 0));
    CODE(ecrt_slave_config_complete_sdo, "data NULL", (sc, 0x6066, NULL, 2));
    CODE(ecrt_slave_config_complete_sdo, "size maximal", (sc, 0x6066, data, SIZE_MAX));
    CODE(ecrt_slave_config_idn, "drive 8", (sc, 8, 1, EC_AL_STATE_PREOP, data, 2));
    CODE(ecrt_slave_config_idn, "drive 255", (sc, 255, 1, EC_AL_STATE_PREOP, data, 2));
    CODE(ecrt_slave_config_idn, "state INIT", (sc, 0, 1, EC_AL_STATE_INIT, data, 2));
    CODE(ecrt_slave_config_idn, "state OP", (sc, 0, 1, EC_AL_STATE_OP, data, 2));
    CODE(ecrt_slave_config_idn, "size 0", (sc, 0, 1, EC_AL_STATE_PREOP, data, 0));
    CODE(ecrt_slave_config_idn, "data NULL", (sc, 0, 1, EC_AL_STATE_PREOP, NULL, 2));
    CODE(ecrt_slave_config_state_timeout, "from state 0", (sc, (ec_al_state_t) 0, EC_AL_STATE_PREOP, 5));
    CODE(ecrt_slave_config_state_timeout, "from BOOT", (sc, (ec_al_state_t) 3, EC_AL_STATE_INIT, 5));
    CODE(ecrt_slave_config_state_timeout, "to state 16", (sc, EC_AL_STATE_PREOP, (ec_al_state_t) 16, 5));
    CODE(ecrt_slave_config_state_timeout, "maximal", (sc, EC_AL_STATE_SAFEOP, EC_AL_STATE_OP, UINT_MAX));
    CODE(ecrt_slave_config_flag, "unknown key", (sc, "NoSuchFlag", 1));
    CODE(ecrt_slave_config_flag, "empty key", (sc, "", 1));
    CODE(ecrt_slave_config_flag, "key NULL", (sc, NULL, 1));
    CODE(ecrt_slave_config_flag, "WaitBeforeSAFEOPms -1", (sc, "WaitBeforeSAFEOPms", -1));
    CODE(ecrt_slave_config_watchdog, "maximal", (configs[PROTOCOLS], 65535, 65535));
}

static void of_other_settings(ec_slave_config_t *sc)
{
    CODE(ecrt_slave_config_emerg_size, "0", (sc, 0));
    CODE(ecrt_slave_config_emerg_size, "maximal", (sc, SIZE_MAX));
    CODE(ecrt_slave_config_emerg_pop, "target NULL", (sc, NULL));
    CODE(ecrt_slave_config_eoe_mac_address, "address NULL", (sc, NULL));
    CODE(ecrt_slave_config_eoe_hostname, "name NULL", (sc, NULL));
    CODE(ecrt_slave_config_eoe_hostname, "32 characters",
        (configs[PROTOCOLS], "abcdefghijklmnopqrstuvwxyz012345"));
    CODE(ecrt_slave_config_eoe_hostname, "33 characters",
        (configs[PROTOCOLS], "abcdefghijklmnopqrstuvwxyz0123456"));
    CODE(ecrt_slave_config_dc, "SYNC0 without a cycle", (absent, 0x0300, 0, 0, 0, 0));
    CODE(ecrt_slave_config_dc, "extreme shift", (absent, 0x0300, UINT_MAX, INT_MIN, UINT_MAX, INT_MAX));
    POINTER(ecrt_slave_config_create_sdo_request, "size 0", (sc, 0x6041, 0, 0));
    POINTER(ecrt_slave_config_create_sdo_request, "size maximal", (sc, 0x6041, 0, SIZE_MAX));
    POINTER(ecrt_slave_config_create_soe_request, "drive 8", (sc, 8, 1, 2));
    POINTER(ecrt_slave_config_create_soe_request, "size maximal", (sc, 0, 1, SIZE_MAX));
    POINTER(ecrt_slave_config_create_reg_request, "size maximal", (sc, SIZE_MAX));
    POINTER(ecrt_slave_config_create_voe_handler, "size maximal", (sc, SIZE_MAX));
}

static void of_the_master(ec_slave_info_t *drive)
{
    CODE(ecrt_master_set_send_interval, "maximal", (master, SIZE_MAX));
    CODE(ecrt_master_set_send_interval, "0", (master, 0));
    CODE(ecrt_master_select_reference_clock, "SubDevice without a clock", (master, configs[PROTOCOLS]));
    CODE(ecrt_master_select_reference_clock, "a domain as SubDevice", (master, (ec_slave_config_t *) domain));
    CODE(ecrt_master_select_reference_clock, "NULL", (master, NULL));
    POINTER(ecrt_master_slave_config, "position 65535", (master, 0, 65535, 1, 2));
    POINTER(ecrt_master_slave_config, "alias 65535", (master, 65535, 0, 1, 2));
    POINTER(ecrt_master_slave_config, "other product at a declared place", (master, 0, DRIVE, drive->vendor_id, 1));
    POINTER(ecrt_master_slave_config, "the same again",
        (master, 0, DRIVE, drive->vendor_id, drive->product_code));
    POINTER(ecrt_open_master, "maximal", (UINT_MAX));
    POINTER(ecrt_request_master, "maximal", (UINT_MAX));
}

static void of_requests(void)
{
    CODE(ecrt_sdo_request_timeout, "maximal", (sdo, UINT32_MAX));
    CODE(ecrt_sdo_request_timeout, "0", (sdo, 0));
    CODE(ecrt_sdo_request_write, "request of size 0", (empty_sdo));
    CODE(ecrt_sdo_request_data_size, "request of size 0", (empty_sdo));
    CODE(ecrt_soe_request_idn, "drive 8", (soe, 8, 1));
    CODE(ecrt_soe_request_timeout, "maximal", (soe, UINT32_MAX));
    CODE(ecrt_reg_request_read, "size 0", (reg, 0x0130, 0));
    CODE(ecrt_reg_request_read, "more than the request has", (reg, 0x0130, 3));
    CODE(ecrt_reg_request_read, "size maximal", (reg, 0x0130, SIZE_MAX));
    CODE(ecrt_reg_request_write, "size 0", (reg, 0x0420, 0));
    CODE(ecrt_reg_request_write, "more than the request has", (reg, 0x0420, 3));
    CODE(ecrt_voe_handler_write, "size 0", (voe, 0));
    CODE(ecrt_voe_handler_write, "more than the handler has", (voe, 9));
    CODE(ecrt_voe_handler_write, "size maximal", (voe, SIZE_MAX));
    CODE(ecrt_voe_handler_send_header, "maximal", (voe, UINT32_MAX, 65535));
    CODE(ecrt_voe_handler_received_header, "results NULL, nothing was read", (voe, NULL, NULL));
    CODE(ecrt_sdo_request_data_size, "a domain as request", ((ec_sdo_request_t *) domain));
    CODE(ecrt_master_application_time, "maximal", (master, UINT64_MAX));
    CODE(ecrt_master_application_time, "0", (master, 0));
}

static int configure(void)
{
    ec_slave_info_t info, drive = {0};
    int at;

    if (!(master = ecrt_request_master(0)) || !(domain = ecrt_master_create_domain(master)))
        return 1;
    for (at = OUTPUTS; at < COUNT; at++) {
        if (ecrt_master_get_slave(master, (uint16_t) at, &info))
            return 1;
        if (at == DRIVE)
            drive = info;
        if (!(configs[at] = ecrt_master_slave_config(master, 0, (uint16_t) at, info.vendor_id, info.product_code)))
            return 1;
    }
    absent = ecrt_master_slave_config(master, 0, 40, 1, 2);
    of_the_master(&drive);
    of_pdos(configs[DRIVE]);
    of_places(configs[DRIVE]);
    of_start_up(configs[DRIVE]);
    of_other_settings(configs[DRIVE]);
    return from_two_threads();
}

/* A second configuration on the same handle, without what the drive refuses. */
static int activate(void)
{
    ec_slave_info_t info;
    int at;

    ecrt_release_master(master);
    if (!(master = ecrt_request_master(0)) || !(domain = ecrt_master_create_domain(master)))
        return 1;
    for (at = OUTPUTS; at < COUNT; at++)
        if (ecrt_master_get_slave(master, (uint16_t) at, &info)
            || !(configs[at] = ecrt_master_slave_config(master, 0, (uint16_t) at, info.vendor_id, info.product_code)))
            return 1;
    sdo = ecrt_slave_config_create_sdo_request(configs[DRIVE], 0x6066, 0, 2);
    empty_sdo = ecrt_slave_config_create_sdo_request(configs[DRIVE], 0x6066, 0, 0);
    soe = ecrt_slave_config_create_soe_request(configs[AXES], 0, 2, 2);
    reg = ecrt_slave_config_create_reg_request(configs[DRIVE], 2);
    voe = ecrt_slave_config_create_voe_handler(configs[PROTOCOLS], 8);
    if (!sdo || !empty_sdo || !soe || !reg || !voe)
        return 1;
    return ecrt_slave_config_reg_pdo_entry(configs[OUTPUTS], 0x7000, 1, domain, NULL) < 0
        || ecrt_master_activate(master);
}

int main(void)
{
    const struct timespec pause = {0, 1000000};
    int rounds;

    if (configure() || activate())
        return 1;
    for (rounds = 0; rounds < 500; rounds++) {
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        nanosleep(&pause, NULL);
    }
    of_requests();
    if (from_two_threads())
        return 1;
    ecrt_release_master(master);
    return end(by_argument, sizeof by_argument / sizeof *by_argument);
}
