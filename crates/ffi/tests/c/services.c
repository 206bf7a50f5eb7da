/* Each service once on simulated SubDevices; a failed check ends the program with its line. */
#include <errno.h>
#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

enum { COUPLER, OUTPUTS, DRIVE, PROTOCOLS, AXES, COUNT };

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *configs[COUNT];

static void pause_ms(long ms)
{
    struct timespec pause = {0, ms * 1000000};
    nanosleep(&pause, NULL);
}

static void cycle(void)
{
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
    pause_ms(1);
}

static int questions(void)
{
    ec_master_info_t info;
    ec_master_state_t state;
    ec_master_link_state_t link;
    ec_master_scan_progress_t progress;
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    ec_pdo_info_t pdo;
    ec_pdo_entry_info_t entry;
    ec_slave_config_state_t config;

    CHECK(ecrt_master(master, &info) == 0 && info.slave_count == COUNT && info.link_up && !info.scan_busy);
    CHECK(ecrt_master_state(master, &state) == 0 && state.slaves_responding == COUNT);
    CHECK(state.al_states == EC_AL_STATE_PREOP && state.link_up);
    CHECK(ecrt_master_link_state(master, 0, &link) == 0 && link.slaves_responding == COUNT && link.link_up);
    CHECK(ecrt_master_link_state(master, 1, &link) == -EINVAL && ecrt_master_link_state(master, 2, &link) == -EINVAL);
    CHECK(ecrt_master_scan_progress(master, &progress) == 0);
    CHECK(progress.slave_count == COUNT && progress.scan_index == COUNT);
    CHECK(ecrt_master_get_slave(master, DRIVE, &slave) == 0 && slave.position == DRIVE && slave.vendor_id);
    CHECK(slave.al_state == EC_AL_STATE_PREOP && !slave.error_flag && slave.sync_count == 4 && slave.sdo_count > 10);
    CHECK(slave.ports[0].link.link_up && slave.ports[1].next_slave == PROTOCOLS && strlen(slave.name) > 0);
    CHECK(ecrt_master_get_slave(master, PROTOCOLS, &slave) == 0 && slave.alias == 77);
    CHECK(ecrt_master_get_slave(master, COUNT, &slave) == -EINVAL);
    CHECK(ecrt_master_get_sync_manager(master, DRIVE, 3, &sync) == 0 && sync.dir == EC_DIR_INPUT && sync.n_pdos == 1);
    CHECK(ecrt_master_get_sync_manager(master, DRIVE, 9, &sync) == -EINVAL);
    CHECK(ecrt_master_get_pdo(master, DRIVE, 3, 0, &pdo) == 0 && pdo.n_entries > 1);
    CHECK(ecrt_master_get_pdo_entry(master, DRIVE, 3, 0, 0, &entry) == 0 && entry.index == 0x6041);
    CHECK(entry.bit_length == 16 && ecrt_master_get_pdo(master, DRIVE, 3, 7, &pdo) == -EINVAL);
    CHECK(ecrt_slave_config_state(configs[DRIVE], &config) == 0 && config.online && !config.operational);
    CHECK(config.al_state == EC_AL_STATE_PREOP);
    return 0;
}

static int blocking_transfers(void)
{
    uint8_t data[64];
    size_t size = 0;
    uint32_t abort_code = 0;
    uint16_t error_code = 0;
    uint8_t value[2] = {0x34, 0x12};

    CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x1018, 1, data, sizeof data, &size, &abort_code) == 0);
    CHECK(size == 4 && EC_READ_U32(data) != 0);
    CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x1018, 1, data, 3, &size, &abort_code) == -EOVERFLOW);
    CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x1018, 9, data, sizeof data, &size, &abort_code) == -EIO);
    CHECK(abort_code == 0x06090011);
    CHECK(ecrt_master_sdo_upload(master, COUNT, 0x1018, 1, data, sizeof data, &size, &abort_code) == -EINVAL);
    CHECK(ecrt_master_sdo_upload(master, OUTPUTS, 0x1018, 1, data, 9, &size, &abort_code) == -EPROTONOSUPPORT);
    CHECK(ecrt_master_sdo_download(master, DRIVE, 0x6066, 0, value, 2, &abort_code) == 0);
    CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x6066, 0, data, sizeof data, &size, &abort_code) == 0);
    CHECK(size == 2 && memcmp(data, value, 2) == 0);
    CHECK(ecrt_master_sdo_download(master, DRIVE, 0x1018, 1, value, 2, &abort_code) == -EIO);
    CHECK(ecrt_master_sdo_download_complete(master, DRIVE, 0x5fff, value, 2, &abort_code) == -EIO);
    CHECK(ecrt_master_read_idn(master, AXES, 1, 2, data, sizeof data, &size, &error_code) == 0);
    CHECK(size == 2 && EC_READ_U16(data) == 1000);
    EC_WRITE_U16(data, 2000);
    CHECK(ecrt_master_write_idn(master, AXES, 1, 2, data, 2, &error_code) == 0);
    EC_WRITE_U16(data, 0);
    CHECK(ecrt_master_read_idn(master, AXES, 1, 2, data, 2, &size, &error_code) == 0 && EC_READ_U16(data) == 2000);
    CHECK(ecrt_master_write_idn(master, AXES, 1, 11, data, 2, &error_code) == -EIO && error_code != 0);
    CHECK(ecrt_master_read_idn(master, AXES, 8, 2, data, 2, &size, &error_code) == -EINVAL);
    return 0;
}

/* Waits while cycles run. */
#define AWAIT(state, handle) \
    do { int rounds = 3000; while (state(handle) == EC_REQUEST_BUSY && rounds--) cycle(); } while (0)

static int objects(ec_sdo_request_t *sdo)
{
    uint8_t *data = ecrt_sdo_request_data(sdo);

    CHECK(ecrt_sdo_request_state(sdo) == EC_REQUEST_UNUSED && ecrt_sdo_request_data_size(sdo) == 4);
    CHECK(ecrt_sdo_request_timeout(sdo, 500) == 0 && ecrt_sdo_request_read(sdo) == 0);
    CHECK(ecrt_sdo_request_state(sdo) == EC_REQUEST_BUSY && ecrt_sdo_request_read(sdo) == -EBUSY);
    AWAIT(ecrt_sdo_request_state, sdo);
    CHECK(ecrt_sdo_request_state(sdo) == EC_REQUEST_SUCCESS && data == ecrt_sdo_request_data(sdo));
    CHECK(ecrt_sdo_request_data_size(sdo) == 2 && EC_READ_U16(data) == 0x1234);
    EC_WRITE_U16(data, 0x4321);
    CHECK(ecrt_sdo_request_write(sdo) == 0);
    AWAIT(ecrt_sdo_request_state, sdo);
    CHECK(ecrt_sdo_request_state(sdo) == EC_REQUEST_SUCCESS);
    EC_WRITE_U16(data, 0);
    CHECK(ecrt_sdo_request_read(sdo) == 0);
    AWAIT(ecrt_sdo_request_state, sdo);
    CHECK(ecrt_sdo_request_state(sdo) == EC_REQUEST_SUCCESS && EC_READ_U16(data) == 0x4321);
    CHECK(ecrt_sdo_request_index(sdo, 0x1018, 9) == 0 && ecrt_sdo_request_read(sdo) == 0);
    AWAIT(ecrt_sdo_request_state, sdo);
    CHECK(ecrt_sdo_request_state(sdo) == EC_REQUEST_ERROR);
    return 0;
}

static int registers(ec_reg_request_t *reg)
{
    /* AL status. */
    CHECK(ecrt_reg_request_read(reg, 0x0130, 2) == 0);
    AWAIT(ecrt_reg_request_state, reg);
    CHECK(ecrt_reg_request_state(reg) == EC_REQUEST_SUCCESS);
    CHECK((EC_READ_U16(ecrt_reg_request_data(reg)) & 0x0f) == EC_AL_STATE_OP);
    CHECK(ecrt_reg_request_read(reg, 0x0130, 5) == -ENOBUFS && ecrt_reg_request_read(reg, 0x0130, 0) == -EINVAL);
    EC_WRITE_U16(ecrt_reg_request_data(reg), 0x0102);
    CHECK(ecrt_reg_request_write(reg, 0x0420, 2) == 0);
    AWAIT(ecrt_reg_request_state, reg);
    EC_WRITE_U16(ecrt_reg_request_data(reg), 0);
    CHECK(ecrt_reg_request_state(reg) == EC_REQUEST_SUCCESS && ecrt_reg_request_read(reg, 0x0420, 2) == 0);
    AWAIT(ecrt_reg_request_state, reg);
    CHECK(ecrt_reg_request_state(reg) == EC_REQUEST_SUCCESS);
    CHECK(EC_READ_U16(ecrt_reg_request_data(reg)) == 0x0102);
    return 0;
}

static int requests(ec_sdo_request_t *sdo, ec_reg_request_t *reg, ec_soe_request_t *soe, ec_voe_handler_t *voe)
{
    uint32_t vendor;
    uint16_t type;

    CHECK(objects(sdo) == 0 && registers(reg) == 0);
    CHECK(ecrt_soe_request_timeout(soe, 500) == 0 && ecrt_soe_request_read(soe) == 0);
    AWAIT(ecrt_soe_request_state, soe);
    CHECK(ecrt_soe_request_state(soe) == EC_REQUEST_SUCCESS && ecrt_soe_request_data_size(soe) == 2);
    CHECK(ecrt_soe_request_idn(soe, 0, 36) == 0 && ecrt_soe_request_read(soe) == 0);
    AWAIT(ecrt_soe_request_state, soe);
    CHECK(ecrt_soe_request_state(soe) == EC_REQUEST_SUCCESS && ecrt_soe_request_data_size(soe) == 4);
    EC_WRITE_U32(ecrt_soe_request_data(soe), 123);
    CHECK(ecrt_soe_request_write(soe) == 0);
    AWAIT(ecrt_soe_request_state, soe);
    CHECK(ecrt_soe_request_state(soe) == EC_REQUEST_SUCCESS && ecrt_soe_request_read(soe) == 0);
    AWAIT(ecrt_soe_request_state, soe);
    CHECK(EC_READ_U32(ecrt_soe_request_data(soe)) == 123 && ecrt_soe_request_idn(soe, 8, 1) == -EINVAL);

    /* The SubDevice sends back what comes from its vendor. */
    memcpy(ecrt_voe_handler_data(voe), "hello", 5);
    CHECK(ecrt_voe_handler_write(voe, 5) == 0);
    AWAIT(ecrt_voe_handler_execute, voe);
    CHECK(ecrt_voe_handler_execute(voe) == EC_REQUEST_SUCCESS);
    memset(ecrt_voe_handler_data(voe), 0, 5);
    CHECK(ecrt_voe_handler_read(voe) == 0);
    AWAIT(ecrt_voe_handler_execute, voe);
    CHECK(ecrt_voe_handler_execute(voe) == EC_REQUEST_SUCCESS && ecrt_voe_handler_data_size(voe) == 5);
    CHECK(memcmp(ecrt_voe_handler_data(voe), "hello", 5) == 0);
    CHECK(ecrt_voe_handler_received_header(voe, &vendor, &type) == 0 && type == 7);
    CHECK(ecrt_voe_handler_write(voe, 3) == 0);
    AWAIT(ecrt_voe_handler_execute, voe);
    CHECK(ecrt_voe_handler_execute(voe) == EC_REQUEST_SUCCESS && ecrt_voe_handler_read_nosync(voe) == 0);
    AWAIT(ecrt_voe_handler_execute, voe);
    CHECK(ecrt_voe_handler_execute(voe) == EC_REQUEST_SUCCESS && ecrt_voe_handler_data_size(voe) == 3);
    return 0;
}

static int settings(void)
{
    struct in_addr address;
    uint8_t value[4] = {7, 0, 0, 0};
    const unsigned char mac[6] = {2, 0, 0, 0, 0, 9};

    CHECK(inet_aton("10.1.2.3", &address));
    CHECK(ecrt_slave_config_eoe_mac_address(configs[PROTOCOLS], mac) == 0);
    CHECK(ecrt_slave_config_eoe_ip_address(configs[PROTOCOLS], address) == 0);
    CHECK(inet_aton("255.255.255.0", &address) && ecrt_slave_config_eoe_subnet_mask(configs[PROTOCOLS], address) == 0);
    CHECK(inet_aton("10.1.2.1", &address) && ecrt_slave_config_eoe_default_gateway(configs[PROTOCOLS], address) == 0);
    CHECK(ecrt_slave_config_eoe_dns_address(configs[PROTOCOLS], address) == 0);
    CHECK(ecrt_slave_config_eoe_hostname(configs[PROTOCOLS], "protocols") == 0);
    CHECK(ecrt_slave_config_sdo32(configs[DRIVE], 0x6065, 0, 4711) == 0);
    CHECK(ecrt_slave_config_sdo16(configs[DRIVE], 0x6066, 0, 0x1234) == 0);
    CHECK(ecrt_slave_config_sdo8(configs[DRIVE], 0x6060, 0, 8) == 0);
    CHECK(ecrt_slave_config_sdo(configs[DRIVE], 0x6065, 0, value, 4) == 0);
    CHECK(ecrt_slave_config_idn(configs[AXES], 1, 1, EC_AL_STATE_PREOP, (const uint8_t *) "\xe8\x03", 2) == 0);
    CHECK(ecrt_slave_config_idn(configs[AXES], 1, 36, EC_AL_STATE_SAFEOP, value, 4) == 0);
    CHECK(ecrt_slave_config_watchdog(configs[DRIVE], 2498, 1000) == 0);
    CHECK(ecrt_slave_config_flag(configs[DRIVE], "WaitBeforeSAFEOPms", 5) == 0);
    CHECK(ecrt_slave_config_state_timeout(configs[DRIVE], EC_AL_STATE_PREOP, EC_AL_STATE_SAFEOP, 4000) == 0);
    CHECK(ecrt_slave_config_emerg_size(configs[DRIVE], 4) == 0);
    return 0;
}

static int after_activation(void)
{
    uint8_t data[16];
    size_t size;
    uint32_t abort_code;
    uint16_t error_code;
    ec_domain_state_t state;
    int rounds;

    /* A cycle may be left out while the delays of clocks are measured. */
    for (rounds = 0; rounds < 500; rounds++) {
        cycle();
        CHECK(ecrt_domain_state(domain, &state) == 0 && !state.redundancy_active);
        if (state.wc_state == EC_WC_COMPLETE)
            break;
    }
    CHECK(state.wc_state == EC_WC_COMPLETE);
    CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x6065, 0, data, sizeof data, &size, &abort_code) == 0);
    CHECK(size == 4 && EC_READ_U32(data) == 7);
    CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x6066, 0, data, sizeof data, &size, &abort_code) == 0);
    CHECK(EC_READ_U16(data) == 0x1234);
    CHECK(ecrt_master_read_idn(master, AXES, 1, 36, data, sizeof data, &size, &error_code) == 0);
    CHECK(EC_READ_U32(data) == 7);
    CHECK(ecrt_slave_config_emerg_pop(configs[DRIVE], data) == -ENOENT);
    CHECK(ecrt_slave_config_emerg_overruns(configs[DRIVE]) == 0 && ecrt_slave_config_emerg_clear(configs[DRIVE]) == 0);
    CHECK(ecrt_master_reset(master) == 0);
    return 0;
}

static int life(void)
{
    ec_sdo_request_t *sdo;
    ec_reg_request_t *reg;
    ec_soe_request_t *soe;
    ec_voe_handler_t *voe;
    ec_slave_config_state_t state = {0, 0, 0};
    ec_slave_info_t info;
    int i, operational = 0, rounds, output;

    CHECK(domain = ecrt_master_create_domain(master));
    for (i = 0; i < COUNT; i++) {
        CHECK(ecrt_master_get_slave(master, (uint16_t) i, &info) == 0);
        configs[i] = ecrt_master_slave_config(master, info.alias, info.alias ? 0 : info.position, info.vendor_id,
            info.product_code);
        CHECK(configs[i]);
    }
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[DRIVE], 0x6041, 0, domain, NULL) == 0);
    for (i = DRIVE; i < COUNT; i++) {
        CHECK(ecrt_slave_config_reg_pdo_entry_pos(configs[i], 2, 0, 0, domain, NULL) >= 0);
        CHECK(ecrt_slave_config_reg_pdo_entry_pos(configs[i], 3, 0, 0, domain, NULL) >= 0);
    }
    CHECK((output = ecrt_slave_config_reg_pdo_entry(configs[OUTPUTS], 0x7000, 1, domain, NULL)) > 0);
    CHECK(ecrt_domain_size(domain) == (size_t) output + 1 && !ecrt_domain_data(domain));
    if (questions() || settings())
        return 1;
    CHECK(sdo = ecrt_slave_config_create_sdo_request(configs[DRIVE], 0x6066, 0, 4));
    CHECK(reg = ecrt_slave_config_create_reg_request(configs[DRIVE], 4));
    CHECK(soe = ecrt_slave_config_create_soe_request(configs[AXES], 1, 2, 8));
    CHECK(voe = ecrt_slave_config_create_voe_handler(configs[PROTOCOLS], 64));
    CHECK(ecrt_master_get_slave(master, PROTOCOLS, &info) == 0);
    CHECK(ecrt_voe_handler_send_header(voe, info.vendor_id, 7) == 0);
    CHECK(ecrt_master_activate(master) == 0 && ecrt_domain_data(domain));
    for (rounds = 0; rounds < 20000 && operational < COUNT; rounds++) {
        EC_WRITE_U8(ecrt_domain_data(domain) + output, 1);
        cycle();
        for (operational = 0, i = 0; i < COUNT; i++) {
            ecrt_slave_config_state(configs[i], &state);
            operational += state.operational;
        }
    }
    CHECK(operational == COUNT);
    for (rounds = 0; rounds < 20; rounds++)
        cycle();
    if (after_activation() || requests(sdo, reg, soe, voe))
        return 1;
    CHECK(ecrt_master_deactivate(master) == 0 && ecrt_master_deactivate(master) == -EINVAL);
    CHECK(ecrt_domain_process(domain) == -EINVAL && ecrt_sdo_request_state(sdo) == EC_REQUEST_ERROR);
    return 0;
}

int main(void)
{
    float real = 1.5F;
    double lreal = -2.25;
    uint8_t bytes[9];
    int round;

    ecrt_write_real(bytes + 1, real);
    CHECK(ecrt_read_real(bytes + 1) == real);
    ecrt_write_lreal(bytes + 1, lreal);
    CHECK(ecrt_read_lreal(bytes + 1) == lreal);
    CHECK(ecrt_version_magic() == ECRT_VERSION_MAGIC && !ecrt_request_master(5));
    CHECK(master = ecrt_request_master(0));
    CHECK(!ecrt_request_master(0));
    if (blocking_transfers())
        return 1;
    /* Twice: an application after another one on the same handle. */
    for (round = 0; round < 2; round++) {
        if (life())
            return 1;
        printf("round %d\n", round);
    }
    ecrt_release_master(master);
    CHECK(ecrt_master_send(master) == -EINVAL);
    printf("all services work\n");
    return 0;
}
