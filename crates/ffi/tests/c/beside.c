/*
 * A master that is opened beside the one that drives it: beside ask prints what a handle gets that was opened only;
 * beside drive brings a drive to OP, prints "op", then the same from a second handle of its own process, and goes on
 * until its input ends. Lines that begin with "state" change with the states of the SubDevices.
 */
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "ecrt.h"

enum { OUTPUTS = 1, DRIVE = 2, AXES = 4 };

static volatile int ends;

static void shapes(ec_master_t *m, uint16_t position, const ec_slave_info_t *slave)
{
    ec_sync_info_t sync;
    ec_pdo_info_t pdo;
    ec_pdo_entry_info_t entry;
    unsigned s, p, e;

    for (s = 0; s < slave->sync_count; s++) {
        if (ecrt_master_get_sync_manager(m, position, s, &sync))
            continue;
        printf(" sync %u: dir %d, %u PDOs, watchdog %d\n", s, sync.dir, sync.n_pdos, sync.watchdog_mode);
        for (p = 0; p < sync.n_pdos; p++) {
            if (ecrt_master_get_pdo(m, position, s, p, &pdo))
                continue;
            printf("  PDO 0x%04x:", pdo.index);
            for (e = 0; e < pdo.n_entries; e++)
                if (!ecrt_master_get_pdo_entry(m, position, s, p, e, &entry))
                    printf(" 0x%04x:%u/%u", entry.index, entry.subindex, entry.bit_length);
            printf("\n");
        }
    }
}

static void information(ec_master_t *m)
{
    ec_master_info_t info = {0};
    ec_master_scan_progress_t progress = {0};
    ec_master_state_t state = {0};
    ec_master_link_state_t link = {0};
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    unsigned position, port;
    int code;

    code = ecrt_master(m, &info);
    printf("master %d: %u slaves, up %d, busy %d\n", code, info.slave_count, info.link_up, info.scan_busy);
    code = ecrt_master_scan_progress(m, &progress);
    printf("progress %d: %u of %u\n", code, progress.scan_index, progress.slave_count);
    code = ecrt_master_state(m, &state);
    printf("all %d: %u, up %d\n", code, state.slaves_responding, state.link_up);
    printf("state all 0x%02x\n", state.al_states);
    code = ecrt_master_link_state(m, 0, &link);
    printf("link %d: %u, up %d\n", code, link.slaves_responding, link.link_up);
    printf("no link %d\n", ecrt_master_link_state(m, 1, &link));
    for (position = 0; position < info.slave_count; position++) {
        if (ecrt_master_get_slave(m, position, &slave))
            continue;
        printf("slave %u: %s, 0x%08x 0x%08x %u %u, alias %u, %d mA, error %u, %u objects, ports", slave.position,
               slave.name, slave.vendor_id, slave.product_code, slave.revision_number, slave.serial_number,
               slave.alias, slave.current_on_ebus, slave.error_flag, slave.sdo_count);
        for (port = 0; port < EC_MAX_PORTS; port++)
            printf(" %d/%u/%u", slave.ports[port].desc, slave.ports[port].link.link_up, slave.ports[port].next_slave);
        printf("\nstate of %u: %u\n", slave.position, slave.al_state);
        shapes(m, position, &slave);
    }
    printf("beyond: %d %d\n", ecrt_master_get_slave(m, 99, &slave), ecrt_master_get_sync_manager(m, DRIVE, 99, &sync));
}

static void services(ec_master_t *m)
{
    uint8_t data[8] = {0x34, 0x12}, got[16];
    size_t size = 0;
    uint32_t abort_code = 0;
    uint16_t error_code = 0;
    int code;

    printf("download: %d\n", ecrt_master_sdo_download(m, DRIVE, 0x6066, 0, data, 2, &abort_code));
    code = ecrt_master_sdo_upload(m, DRIVE, 0x6066, 0, got, sizeof got, &size, &abort_code);
    printf("upload: %d, %zu, 0x%02x%02x\n", code, size, got[1], got[0]);
    printf("short: %d\n", ecrt_master_sdo_upload(m, DRIVE, 0x1018, 1, got, 3, &size, &abort_code));
    code = ecrt_master_sdo_upload(m, DRIVE, 0x5fff, 0, got, sizeof got, &size, &abort_code);
    printf("abort: %d, 0x%08x\n", code, abort_code);
    code = ecrt_master_sdo_download_complete(m, DRIVE, 0x5fff, data, 2, &abort_code);
    printf("complete: %d, 0x%08x\n", code, abort_code);
    printf("no mailbox: %d\n", ecrt_master_sdo_upload(m, OUTPUTS, 0x1018, 1, got, sizeof got, &size, &abort_code));
    printf("no slave: %d\n", ecrt_master_sdo_upload(m, 99, 0x1018, 1, got, sizeof got, &size, &abort_code));
    printf("no data: %d\n", ecrt_master_sdo_download(m, DRIVE, 0x6066, 0, data, 0, &abort_code));
    printf("write idn: %d\n", ecrt_master_write_idn(m, AXES, 0, 134, data, 2, &error_code));
    code = ecrt_master_read_idn(m, AXES, 0, 134, got, sizeof got, &size, &error_code);
    printf("read idn: %d, %zu, 0x%02x%02x\n", code, size, got[1], got[0]);
    printf("no drive: %d\n", ecrt_master_read_idn(m, AXES, 8, 2, got, sizeof got, &size, &error_code));
    code = ecrt_master_read_idn(m, AXES, 0, 4095, got, sizeof got, &size, &error_code);
    printf("no idn: %d, 0x%04x\n", code, error_code);
}

/* What needs the reservation is refused. */
static void refused(ec_master_t *m)
{
    uint32_t time;

    printf("domain: %s\n", ecrt_master_create_domain(m) ? "pointer" : "NULL");
    printf("config: %s\n", ecrt_master_slave_config(m, 0, 0, 1, 2) ? "pointer" : "NULL");
    printf("activate: %d, deactivate: %d\n", ecrt_master_activate(m), ecrt_master_deactivate(m));
    printf("send: %d, receive: %d, time: %d\n", ecrt_master_send(m), ecrt_master_receive(m),
           ecrt_master_reference_clock_time(m, &time));
    printf("reset: %d, interval: %d\n", ecrt_master_reset(m), ecrt_master_set_send_interval(m, 1000));
}

static int ask(void)
{
    ec_master_t *m = ecrt_open_master(0), *second;
    int code;

    if (!m)
        return 1;
    information(m);
    services(m);
    refused(m);
    second = ecrt_request_master(0);
    printf("state request: %s\n", second ? "pointer" : "NULL");
    code = ecrt_master_reserve(m);
    printf("state reserve: %d\n", code);
    if (second)
        ecrt_release_master(second);
    ecrt_release_master(m);
    printf("end\n");
    return 0;
}

static void *until_input_ends(void *unused)
{
    (void) unused;
    while (getchar() != EOF)
        ;
    ends = 1;
    return NULL;
}

static void *ask_beside(void *code)
{
    *(int *) code = ask();
    fflush(stdout);
    return NULL;
}

static int drive(void)
{
    ec_master_t *m = ecrt_request_master(0);
    ec_slave_config_t *sc;
    ec_slave_config_state_t state;
    ec_domain_t *domain;
    ec_slave_info_t info;
    struct timespec pause = {0, 1000000};
    pthread_t input, beside;
    int is_op = 0, code = 0;

    if (!m || ecrt_master_get_slave(m, DRIVE, &info) || !(domain = ecrt_master_create_domain(m))
        || !(sc = ecrt_master_slave_config(m, 0, DRIVE, info.vendor_id, info.product_code))
        || ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, domain, NULL) < 0
        || ecrt_slave_config_reg_pdo_entry(sc, 0x6040, 0, domain, NULL) < 0 || ecrt_master_activate(m))
        return 1;
    pthread_create(&input, NULL, until_input_ends, NULL);
    while (!ends) {
        ecrt_master_receive(m);
        ecrt_domain_process(domain);
        ecrt_slave_config_state(sc, &state);
        if (state.operational && !is_op) {
            is_op = 1;
            printf("op\n");
            fflush(stdout);
            pthread_create(&beside, NULL, ask_beside, &code);
        }
        ecrt_domain_queue(domain);
        ecrt_master_send(m);
        nanosleep(&pause, NULL);
    }
    if (is_op)
        pthread_join(beside, NULL);
    ecrt_slave_config_state(sc, &state);
    printf("still operational: %u\n", state.operational);
    ecrt_release_master(m);
    return code;
}

int main(int argc, char **argv)
{
    return argc > 1 && !strcmp(argv[1], "drive") ? drive() : ask();
}
