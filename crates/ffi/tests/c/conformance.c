/*
 * Calls each function in each phase, and compares its result with the table of docs/ecrt.md, from which "tables.h" is
 * made. Prints "FUNCTION RESULT" for the version and for handles that were released, which the test checks.
 *
 * Results: 0, "positive", the name of an error, "NULL", "pointer", a request state. A function whose handle cannot
 * exist in a phase is not called there.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"
#include "names.h"

enum { OUTPUTS = 1, DRIVE = 2, PROTOCOLS = 3, AXES = 4 };

static const char *phase;

static const char *const states[] = {"UNUSED", "BUSY", "SUCCESS", "ERROR"};

#define CODE(function, arguments) got(#function, name_of((long) function arguments))
#define POINTER(function, arguments) got(#function, function arguments ? "pointer" : "NULL")
#define STATE(function, arguments) got(#function, states[function arguments])

/* A function without a handle is called in the phase "any". */
static void got(const char *function, const char *result)
{
    if (!strcmp(phase, "released") || !strcmp(phase, "any"))
        printf("%s %s\n", function, result);
    else
        compare(by_phase, sizeof by_phase / sizeof *by_phase, function, phase, result);
}

struct handles {
    ec_master_t *master;
    ec_slave_config_t *sc;
    ec_domain_t *domain;
    ec_sdo_request_t *sdo;
    ec_soe_request_t *soe;
    ec_reg_request_t *reg;
    ec_voe_handler_t *voe;
};

static ec_slave_info_t drive;

static void of_master(ec_master_t *m)
{
    ec_master_info_t info;
    ec_master_scan_progress_t progress;
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    ec_pdo_info_t pdo;
    ec_pdo_entry_info_t entry;
    ec_master_state_t state;
    ec_master_link_state_t link;
    uint8_t data[16] = {0x34, 0x12};
    size_t size;
    uint32_t abort_code, time;
    uint16_t error_code;

    CODE(ecrt_master, (m, &info));
    CODE(ecrt_master_scan_progress, (m, &progress));
    CODE(ecrt_master_get_slave, (m, DRIVE, &slave));
    CODE(ecrt_master_get_sync_manager, (m, DRIVE, 3, &sync));
    CODE(ecrt_master_get_pdo, (m, DRIVE, 3, 0, &pdo));
    CODE(ecrt_master_get_pdo_entry, (m, DRIVE, 3, 0, 0, &entry));
    CODE(ecrt_master_state, (m, &state));
    CODE(ecrt_master_link_state, (m, 0, &link));
    CODE(ecrt_master_sdo_upload, (m, DRIVE, 0x1018, 1, data, sizeof data, &size, &abort_code));
    CODE(ecrt_master_sdo_download, (m, DRIVE, 0x6066, 0, data, 2, &abort_code));
    CODE(ecrt_master_sdo_download_complete, (m, DRIVE, 0x5fff, data, 2, &abort_code));
    CODE(ecrt_master_read_idn, (m, AXES, 0, 2, data, sizeof data, &size, &error_code));
    CODE(ecrt_master_write_idn, (m, AXES, 0, 134, data, 2, &error_code));
    CODE(ecrt_master_set_send_interval, (m, 1000));
    CODE(ecrt_master_receive, (m));
    CODE(ecrt_master_application_time, (m, 1));
    CODE(ecrt_master_sync_reference_clock, (m));
    CODE(ecrt_master_sync_reference_clock_to, (m, 1));
    CODE(ecrt_master_sync_slave_clocks, (m));
    CODE(ecrt_master_sync_monitor_queue, (m));
    CODE(ecrt_master_sync_monitor_process, (m));
    CODE(ecrt_master_reference_clock_time, (m, &time));
    CODE(ecrt_master_send, (m));
    CODE(ecrt_master_reset, (m));
    CODE(ecrt_master_select_reference_clock, (m, NULL));
    POINTER(ecrt_master_create_domain, (m));
    POINTER(ecrt_master_slave_config, (m, 0, 9, 1, 2));
}

static void of_slave(const struct handles *h)
{
    static const ec_sync_info_t end = {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT};
    ec_slave_config_t *sc = h->sc;
    ec_slave_config_state_t state;
    struct in_addr address = {0};
    unsigned int bit;
    uint8_t data[8] = {1, 2, 3, 4};
    const unsigned char mac[6] = {2};

    CODE(ecrt_slave_config_sync_manager, (sc, 2, EC_DIR_OUTPUT, EC_WD_ENABLE));
    CODE(ecrt_slave_config_watchdog, (sc, 0, 0));
    CODE(ecrt_slave_config_pdos, (sc, EC_END, &end));
    /* No list is an empty one, in each phase. */
    if (ecrt_slave_config_pdos(sc, EC_END, NULL) != ecrt_slave_config_pdos(sc, EC_END, &end))
        got("ecrt_slave_config_pdos", "refuses NULL as list");
    CODE(ecrt_slave_config_pdo_assign_clear, (sc, 5));
    CODE(ecrt_slave_config_pdo_assign_add, (sc, 5, 0x1A05));
    CODE(ecrt_slave_config_pdo_mapping_clear, (sc, 0x1A05));
    CODE(ecrt_slave_config_pdo_mapping_add, (sc, 0x1A05, 0x6041, 0, 16));
    /* Without effect again, so that the drive can be configured. */
    ecrt_slave_config_pdo_assign_clear(sc, 5);
    CODE(ecrt_slave_config_reg_pdo_entry, (sc, 0x6041, 0, h->domain, &bit));
    CODE(ecrt_slave_config_reg_pdo_entry_pos, (sc, 3, 0, 0, h->domain, &bit));
    CODE(ecrt_slave_config_dc, (sc, 0, 0, 0, 0, 0));
    CODE(ecrt_slave_config_sdo, (sc, 0x6066, 0, data, 2));
    CODE(ecrt_slave_config_sdo8, (sc, 0x6060, 0, 8));
    CODE(ecrt_slave_config_sdo16, (sc, 0x6066, 0, 1));
    CODE(ecrt_slave_config_sdo32, (sc, 0x6065, 0, 1));
    CODE(ecrt_slave_config_complete_sdo, (sc, 0x1018, data, 2));
    CODE(ecrt_slave_config_idn, (sc, 0, 1, EC_AL_STATE_PREOP, data, 2));
    CODE(ecrt_slave_config_emerg_size, (sc, 2));
    CODE(ecrt_slave_config_emerg_pop, (sc, data));
    CODE(ecrt_slave_config_emerg_clear, (sc));
    CODE(ecrt_slave_config_emerg_overruns, (sc));
    CODE(ecrt_slave_config_flag, (sc, "AssignToPdi", 0));
    CODE(ecrt_slave_config_state_timeout, (sc, EC_AL_STATE_INIT, EC_AL_STATE_PREOP, 0));
    CODE(ecrt_slave_config_eoe_mac_address, (sc, mac));
    CODE(ecrt_slave_config_eoe_ip_address, (sc, address));
    CODE(ecrt_slave_config_eoe_subnet_mask, (sc, address));
    CODE(ecrt_slave_config_eoe_default_gateway, (sc, address));
    CODE(ecrt_slave_config_eoe_dns_address, (sc, address));
    CODE(ecrt_slave_config_eoe_hostname, (sc, "name"));
    CODE(ecrt_slave_config_state, (sc, &state));
    POINTER(ecrt_slave_config_create_sdo_request, (sc, 0x6041, 0, 2));
    POINTER(ecrt_slave_config_create_soe_request, (sc, 0, 1, 2));
    POINTER(ecrt_slave_config_create_reg_request, (sc, 2));
    POINTER(ecrt_slave_config_create_voe_handler, (sc, 2));
}

static void of_domain(const struct handles *h)
{
    ec_domain_t *domain = h->domain;
    static unsigned int at;
    const ec_pdo_entry_reg_t list[] = {
        {0, DRIVE, drive.vendor_id, drive.product_code, 0x6041, 0, &at, NULL},
        {0, 0, 0, 0, 0, 0, NULL, NULL},
    };
    ec_domain_state_t state;

    CODE(ecrt_domain_reg_pdo_entry_list, (domain, list));
    CODE(ecrt_domain_size, (domain));
    POINTER(ecrt_domain_data, (domain));
    CODE(ecrt_domain_process, (domain));
    CODE(ecrt_domain_queue, (domain));
    CODE(ecrt_domain_state, (domain, &state));
}

static void of_requests(const struct handles *h)
{
    uint32_t vendor;
    uint16_t type;

    STATE(ecrt_sdo_request_state, (h->sdo));
    CODE(ecrt_sdo_request_index, (h->sdo, 0x6041, 0));
    CODE(ecrt_sdo_request_timeout, (h->sdo, 100));
    POINTER(ecrt_sdo_request_data, (h->sdo));
    CODE(ecrt_sdo_request_data_size, (h->sdo));
    STATE(ecrt_soe_request_state, (h->soe));
    CODE(ecrt_soe_request_idn, (h->soe, 0, 2));
    CODE(ecrt_soe_request_timeout, (h->soe, 100));
    POINTER(ecrt_soe_request_data, (h->soe));
    CODE(ecrt_soe_request_data_size, (h->soe));
    STATE(ecrt_reg_request_state, (h->reg));
    POINTER(ecrt_reg_request_data, (h->reg));
    CODE(ecrt_voe_handler_send_header, (h->voe, 1, 2));
    CODE(ecrt_voe_handler_received_header, (h->voe, &vendor, &type));
    POINTER(ecrt_voe_handler_data, (h->voe));
    CODE(ecrt_voe_handler_data_size, (h->voe));
    STATE(ecrt_voe_handler_execute, (h->voe));
}

static void starts(const struct handles *h)
{
    CODE(ecrt_sdo_request_read, (h->sdo));
    CODE(ecrt_soe_request_read, (h->soe));
    CODE(ecrt_reg_request_read, (h->reg, 0x0130, 2));
    CODE(ecrt_voe_handler_read, (h->voe));
}

static void writes(const struct handles *h)
{
    CODE(ecrt_sdo_request_write, (h->sdo));
    CODE(ecrt_soe_request_write, (h->soe));
    CODE(ecrt_reg_request_write, (h->reg, 0x0420, 2));
    CODE(ecrt_voe_handler_write, (h->voe, 2));
}

static void direct_read(const struct handles *h)
{
    CODE(ecrt_voe_handler_read_nosync, (h->voe));
}

static void pause_ms(long ms)
{
    struct timespec pause = {ms / 1000, ms % 1000 * 1000000};
    nanosleep(&pause, NULL);
}

static void cycles(const struct handles *h, int count)
{
    while (count--) {
        ecrt_master_receive(h->master);
        ecrt_domain_process(h->domain);
        ecrt_master_sync_slave_clocks(h->master);
        ecrt_domain_queue(h->domain);
        ecrt_master_send(h->master);
        pause_ms(1);
    }
}

static int make(struct handles *h)
{
    ec_slave_config_t *drive_config;

    h->domain = ecrt_master_create_domain(h->master);
    h->sc = ecrt_master_slave_config(h->master, 0, DRIVE, drive.vendor_id, drive.product_code);
    drive_config = h->sc;
    h->sdo = ecrt_slave_config_create_sdo_request(drive_config, 0x6066, 0, 2);
    h->soe = ecrt_slave_config_create_soe_request(drive_config, 0, 2, 2);
    h->reg = ecrt_slave_config_create_reg_request(drive_config, 2);
    h->voe = ecrt_slave_config_create_voe_handler(drive_config, 8);
    return h->domain && h->sc && h->sdo && h->soe && h->reg && h->voe;
}

static void bad_arguments(ec_master_t *master)
{
    struct handles none = {NULL, NULL, NULL, NULL, NULL, NULL, NULL};

    phase = "NULL";
    of_master(NULL);
    of_slave(&none);
    of_domain(&none);
    of_requests(&none);
    starts(&none);
    writes(&none);
    direct_read(&none);
    CODE(ecrt_master_reserve, (NULL));
    CODE(ecrt_master_activate, (NULL));
    CODE(ecrt_master_deactivate, (NULL));
    ecrt_release_master(NULL);
    POINTER(ecrt_open_master, (77));
    POINTER(ecrt_request_master, (77));
    phase = "requested";
    CODE(ecrt_master_reserve, (master));
    POINTER(ecrt_request_master, (0));
}

/* From the activation to the end of the application. */
static void while_active(struct handles *h)
{
    uint32_t time;
    int rounds;

    CODE(ecrt_master_activate, (h->master));
    phase = "active";
    CODE(ecrt_master_activate, (h->master));
    /* The reference clock is read once the clocks are set up. */
    for (rounds = 0; rounds < 300 && ecrt_master_reference_clock_time(h->master, &time); rounds++)
        cycles(h, 100);
    of_domain(h);
    of_master(h->master);
    of_slave(h);
    of_requests(h);
    starts(h);
    cycles(h, 1500);
    writes(h);
    cycles(h, 1500);
    direct_read(h);
    CODE(ecrt_master_deactivate, (h->master));
}

int main(void)
{
    struct handles h = {NULL, NULL, NULL, NULL, NULL, NULL, NULL};

    phase = "any";
    CODE(ecrt_version_magic, ());
    phase = "opened";
    POINTER(ecrt_open_master, (0));
    h.master = ecrt_open_master(0);
    pause_ms(1500);
    of_master(h.master);
    CODE(ecrt_master_activate, (h.master));
    CODE(ecrt_master_deactivate, (h.master));
    CODE(ecrt_master_reserve, (h.master));
    if (ecrt_master_get_slave(h.master, DRIVE, &drive) || !make(&h))
        return 1;
    bad_arguments(h.master);
    phase = "requested";
    of_domain(&h);
    of_master(h.master);
    of_slave(&h);
    of_requests(&h);
    CODE(ecrt_master_deactivate, (h.master));
    /* Another application without the objects that the drive refuses. */
    ecrt_release_master(h.master);
    phase = "released";
    of_master(h.master);
    of_requests(&h);
    h.master = ecrt_request_master(0);
    if (!h.master || !make(&h) || ecrt_slave_config_reg_pdo_entry(h.sc, 0x6041, 0, h.domain, NULL) < 0
        || ecrt_slave_config_reg_pdo_entry(h.sc, 0x6040, 0, h.domain, NULL) < 0)
        return 1;
    phase = "requested";
    while_active(&h);
    phase = "deactivated";
    of_master(h.master);
    of_slave(&h);
    of_domain(&h);
    of_requests(&h);
    starts(&h);
    writes(&h);
    direct_read(&h);
    CODE(ecrt_master_deactivate, (h.master));
    ecrt_release_master(h.master);
    return end(by_phase, sizeof by_phase / sizeof *by_phase);
}
