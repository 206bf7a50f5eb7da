/*
 * Settings whose effects a test checks inside the SubDevices. Prints "refused" while the drive, which refuses SAFEOP
 * once, waits for a reset, and "op" when all are in OP. After a line of its input it continues with emergencies, a
 * complete object and a jump of the reference clock.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

enum { OUTPUTS = 1, DRIVE = 2, PROTOCOLS = 3, COUNT = 4, WAIT_MS = 400, JUMP_NS = 1000000000 };

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *configs[COUNT];

static unsigned long long now_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (unsigned long long) now.tv_sec * 1000000000U + (unsigned long long) now.tv_nsec;
}

static void cycle(void)
{
    const struct timespec pause = {0, 1000000};

    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
    nanosleep(&pause, NULL);
}

static int is_operational(int slave)
{
    ec_slave_config_state_t state = {0, 0, 0};

    return ecrt_slave_config_state(configs[slave], &state) == 0 && state.operational;
}

static int addresses(ec_slave_config_t *sc)
{
    const unsigned char mac[6] = {2, 0, 0, 0, 0, 9};
    struct in_addr address;

    CHECK(ecrt_slave_config_eoe_mac_address(sc, mac) == 0);
    CHECK(inet_aton("10.1.2.3", &address) && ecrt_slave_config_eoe_ip_address(sc, address) == 0);
    CHECK(inet_aton("255.255.255.0", &address) && ecrt_slave_config_eoe_subnet_mask(sc, address) == 0);
    CHECK(inet_aton("10.1.2.1", &address) && ecrt_slave_config_eoe_default_gateway(sc, address) == 0);
    CHECK(inet_aton("10.1.2.53", &address) && ecrt_slave_config_eoe_dns_address(sc, address) == 0);
    CHECK(ecrt_slave_config_eoe_hostname(sc, "protocols") == 0);
    return 0;
}

/* Other PDOs and another mapping, which replace those before. */
static int pdos(void)
{
    static const ec_pdo_info_t outputs[] = {{0x1600, 0, NULL}};
    static const ec_sync_info_t syncs[] = {
        {2, EC_DIR_OUTPUT, 1, outputs, EC_WD_DEFAULT}, {3, EC_DIR_INPUT, 0, NULL, EC_WD_DEFAULT},
        {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};
    ec_slave_config_t *sc = configs[DRIVE];

    CHECK(ecrt_slave_config_pdo_assign_clear(sc, 2) == 0 && ecrt_slave_config_pdo_assign_add(sc, 2, 0x1601) == 0);
    CHECK(ecrt_slave_config_pdo_mapping_clear(sc, 0x1601) == 0);
    CHECK(ecrt_slave_config_pdo_mapping_add(sc, 0x1601, 0x6060, 0, 8) == 0);
    CHECK(ecrt_slave_config_pdo_mapping_add(sc, 0x1601, 0, 0, 8) == 0);
    CHECK(ecrt_slave_config_pdo_mapping_add(sc, 0x1601, 0x6040, 0, 16) == 0);
    /* After the PDO that is assigned already, with its default mapping. */
    CHECK(ecrt_slave_config_pdo_assign_add(sc, 3, 0x1A01) == 0);
    /* No entries: the default mapping stays. No PDOs: the default assignment stays. */
    CHECK(ecrt_slave_config_pdos(configs[PROTOCOLS], EC_END, syncs) == 0);

    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6060, 0, domain, NULL) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6040, 0, domain, NULL) == 2);
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, domain, NULL) == 4);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[PROTOCOLS], 0x7000, 1, domain, NULL) > 4);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[PROTOCOLS], 0x6000, 1, domain, NULL) > 4);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[OUTPUTS], 0x7000, 1, domain, NULL) > 4);
    return 0;
}

static int configure(void)
{
    static const uint8_t elements[] = {200, 0, 0x11, 0x22, 0x33, 0x44};
    ec_slave_info_t info;
    int at;

    CHECK(master = ecrt_request_master(0));
    CHECK(domain = ecrt_master_create_domain(master));
    for (at = OUTPUTS; at < COUNT; at++) {
        CHECK(ecrt_master_get_slave(master, (uint16_t) at, &info) == 0);
        CHECK(configs[at] = ecrt_master_slave_config(master, 0, (uint16_t) at, info.vendor_id, info.product_code));
    }
    if (pdos() || addresses(configs[PROTOCOLS]))
        return 1;
    CHECK(ecrt_slave_config_complete_sdo(configs[PROTOCOLS], 0x2001, elements, sizeof elements) == 0);
    CHECK(ecrt_slave_config_flag(configs[OUTPUTS], "AssignToPdi", 1) == 0);
    CHECK(ecrt_slave_config_flag(configs[OUTPUTS], "NoSuchFlag", 1) == 0);
    CHECK(ecrt_slave_config_flag(configs[DRIVE], "WaitBeforeSAFEOPms", WAIT_MS) == 0);
    CHECK(ecrt_slave_config_emerg_size(configs[DRIVE], 2) == 0);
    CHECK(ecrt_master_select_reference_clock(master, configs[DRIVE]) == 0);
    return ecrt_master_activate(master);
}

static int starts(void)
{
    unsigned long long begin;
    int rounds;

    for (rounds = 0; rounds < 20000 && !(is_operational(OUTPUTS) && is_operational(PROTOCOLS)); rounds++)
        cycle();
    CHECK(is_operational(OUTPUTS) && is_operational(PROTOCOLS));
    for (begin = now_ns(); now_ns() - begin < 1000000000U;)
        cycle();
    /* A failed configuration waits for a reset. */
    CHECK(!is_operational(DRIVE));
    printf("refused\n");
    begin = now_ns();
    CHECK(ecrt_master_reset(master) == 0);
    for (rounds = 0; rounds < 20000 && !is_operational(DRIVE); rounds++)
        cycle();
    CHECK(is_operational(DRIVE) && now_ns() - begin >= WAIT_MS * 1000000ULL);
    printf("op\n");
    return fflush(stdout);
}

static void wait_for_line(void)
{
    struct pollfd input = {0, POLLIN, 0};
    char line[16];

    while (poll(&input, 1, 0) == 0)
        cycle();
    if (!fgets(line, sizeof line, stdin))
        fprintf(stderr, "the input has ended\n");
}

/* Three are sent, each before the answer to a read, and two fit. */
static int emergencies(void)
{
    ec_slave_config_t *sc = configs[DRIVE];
    uint8_t data[EC_COE_EMERGENCY_MSG_SIZE];
    uint32_t abort_code;
    size_t size;
    int count;

    for (count = 0; count < 3; count++)
        CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x6066, 0, data, sizeof data, &size, &abort_code) == 0);
    CHECK(ecrt_slave_config_emerg_overruns(sc) == 1);
    for (count = 0; count < 2; count++) {
        CHECK(ecrt_slave_config_emerg_pop(sc, data) == 0);
        CHECK(EC_READ_U16(data) == 0x8611 && data[2] == 0x01 && data[3] == 0 && data[7] == 0);
    }
    CHECK(ecrt_slave_config_emerg_pop(sc, data) == -ENOENT && ecrt_slave_config_emerg_overruns(sc) == 1);
    CHECK(ecrt_slave_config_emerg_clear(sc) == 0 && ecrt_slave_config_emerg_overruns(sc) == 0);
    /* One more is sent, and is dropped before the program takes it. */
    CHECK(ecrt_master_sdo_upload(master, DRIVE, 0x6066, 0, data, sizeof data, &size, &abort_code) == 0);
    CHECK(ecrt_slave_config_emerg_clear(sc) == 0 && ecrt_slave_config_emerg_pop(sc, data) == -ENOENT);
    return 0;
}

static int whole_object(void)
{
    static const uint8_t elements[] = {200, 0, 0x55, 0x66};
    uint8_t data[4];
    uint32_t abort_code;
    size_t size;

    CHECK(ecrt_master_sdo_download_complete(master, PROTOCOLS, 0x2001, elements, sizeof elements, &abort_code) == 0);
    CHECK(ecrt_master_sdo_upload(master, PROTOCOLS, 0x2001, 1, data, sizeof data, &size, &abort_code) == 0);
    CHECK(size == 2 && EC_READ_U16(data) == 0x6655);
    return 0;
}

/* The time that the program gives to the reference clock: a second more than what the clock had at first. */
static uint64_t given_time(uint32_t first_time, unsigned long long first_ns)
{
    return first_time + (now_ns() - first_ns) + JUMP_NS;
}

static int jump_of_the_clock(void)
{
    uint32_t first_time, time;
    unsigned long long first_ns;
    int rounds, result = -1;
    long long difference = JUMP_NS;

    for (rounds = 0; rounds < 20000 && result; rounds++) {
        CHECK(ecrt_master_sync_slave_clocks(master) == 0);
        cycle();
        result = ecrt_master_reference_clock_time(master, &first_time);
    }
    first_ns = now_ns();
    CHECK(result == 0);
    for (rounds = 0; rounds < 20000 && llabs(difference) > JUMP_NS / 50; rounds++) {
        CHECK(ecrt_master_sync_reference_clock_to(master, given_time(first_time, first_ns)) == 0);
        CHECK(ecrt_master_sync_slave_clocks(master) == 0);
        cycle();
        if (ecrt_master_reference_clock_time(master, &time) == 0)
            difference = (int32_t) (time - (uint32_t) given_time(first_time, first_ns));
    }
    printf("difference %lld ns after %d cycles\n", difference, rounds);
    CHECK(llabs(difference) <= JUMP_NS / 50);
    return 0;
}

int main(void)
{
    if (configure() || starts())
        return 1;
    wait_for_line();
    if (emergencies() || whole_object() || jump_of_the_clock())
        return 1;
    ecrt_release_master(master);
    printf("done\n");
    return 0;
}
