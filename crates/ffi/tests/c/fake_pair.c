/*
 * Two programs on libfakeethercat: the machine has the directions inverted. fake_pair control|machine SLAVES CYCLES
 *
 * Control writes a number into all outputs and waits for it in all inputs; the machine copies. Blocks of 16 equal bytes
 * show torn copies, PDOs of single bits their places.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)
#define MOST 64
#define BLOCK 16

static ec_pdo_entry_info_t block_of_outputs[BLOCK], block_of_inputs[BLOCK];
static ec_pdo_entry_info_t output_bits[] = {{0x7001, 1, 1}, {0x7001, 2, 1}};
static ec_pdo_entry_info_t input_bits[] = {{0x6001, 1, 1}, {0x6001, 2, 1}};
static const ec_pdo_info_t outputs[] = {
    {0x1600, 1, output_bits}, {0x1601, 1, output_bits + 1}, {0x1602, BLOCK, block_of_outputs}};
static const ec_pdo_info_t inputs[] = {
    {0x1A00, 1, input_bits}, {0x1A01, 1, input_bits + 1}, {0x1A02, BLOCK, block_of_inputs}};

static ec_master_t *master;
static ec_domain_t *domain;
static uint8_t *data;
static int slaves, is_machine;
static struct { unsigned int bits, block; } out[MOST], in[MOST];

static int configure(void)
{
    ec_sync_info_t syncs[] = {
        {2, is_machine ? EC_DIR_INPUT : EC_DIR_OUTPUT, 3, outputs, EC_WD_DEFAULT},
        {3, is_machine ? EC_DIR_OUTPUT : EC_DIR_INPUT, 3, inputs, EC_WD_DEFAULT},
        {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT},
    };
    int number, byte;

    for (byte = 0; byte < BLOCK; byte++) {
        block_of_outputs[byte] = (ec_pdo_entry_info_t) {0x7000, (uint8_t) (byte + 1), 8};
        block_of_inputs[byte] = (ec_pdo_entry_info_t) {0x6000, (uint8_t) (byte + 1), 8};
    }
    CHECK(master = ecrt_request_master(0));
    CHECK(!ecrt_request_master(0));
    CHECK(domain = ecrt_master_create_domain(master));
    for (number = 0; number < slaves; number++) {
        ec_slave_config_t *sc = ecrt_master_slave_config(master, number % 2 ? 7 : 0, (uint16_t) number, 2, 0x1234);
        unsigned int bit, second_bit;
        int place;

        CHECK(sc && ecrt_slave_config_pdos(sc, EC_END, NULL) == 0);
        CHECK(ecrt_slave_config_pdos(sc, EC_END, syncs) == 0);
        CHECK(ecrt_slave_config_sdo16(sc, 0x8000, 3, 0x1234) == 0);
        CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x7000, 1, domain, NULL) == -EFAULT);
        CHECK((place = ecrt_slave_config_reg_pdo_entry(sc, 0x7001, 2, domain, &second_bit)) >= 0 && second_bit == 1);
        out[number].bits = (unsigned int) place;
        CHECK((place = ecrt_slave_config_reg_pdo_entry(sc, 0x7000, 1, domain, &bit)) >= 0 && bit == 2);
        out[number].block = (unsigned int) place;
        CHECK((place = ecrt_slave_config_reg_pdo_entry(sc, 0x6001, 1, domain, &bit)) >= 0 && bit == 0);
        in[number].bits = (unsigned int) place;
        CHECK((place = ecrt_slave_config_reg_pdo_entry(sc, 0x6000, 1, domain, &bit)) >= 0 && bit == 2);
        in[number].block = (unsigned int) place;
        CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x5000, 1, domain, NULL) == -ENOENT);
    }
    CHECK(!ecrt_domain_data(domain) && ecrt_domain_size(domain) == (size_t) slaves * 2 * (BLOCK + 1));
    CHECK(ecrt_master_activate(master) == 0);
    CHECK(data = ecrt_domain_data(domain));
    return 0;
}

/* The block begins with the third bit of its first byte. */
static uint8_t at(const uint8_t *block, int number)
{
    return (uint8_t) (block[number] >> 2 | block[number + 1] << 6);
}

static void fill(uint8_t *bits, uint8_t *block, uint8_t value)
{
    int number;

    for (number = 0; number < BLOCK; number++) {
        block[number] = (uint8_t) ((block[number] & 0x03) | value << 2);
        block[number + 1] = (uint8_t) ((block[number + 1] & 0xfc) | value >> 6);
    }
    EC_WRITE_BIT(bits, 0, value & 1);
    EC_WRITE_BIT(bits, 1, value >> 1 & 1);
}

/* The value of a block, or -1 while its bits and bytes differ: they are PDOs of their own. */
static int value_of(const uint8_t *bits, const uint8_t *block)
{
    int value = at(block, 0);

    return EC_READ_BIT(bits, 0) == (value & 1) && EC_READ_BIT(bits, 1) == (value >> 1 & 1) ? value : -1;
}

static int is_torn(const uint8_t *block)
{
    int number;

    for (number = 1; number < BLOCK; number++)
        if (at(block, number) != at(block, 0))
            return 1;
    return 0;
}

static int cycle(uint8_t wanted, int *arrived)
{
    int number;

    CHECK(ecrt_master_receive(master) == 0 && ecrt_domain_process(domain) == 0);
    for (*arrived = 0, number = 0; number < slaves; number++) {
        const uint8_t *from = data + (is_machine ? out[number].block : in[number].block);
        const uint8_t *bits = data + (is_machine ? out[number].bits : in[number].bits);
        uint8_t *to_bits = data + (is_machine ? in[number].bits : out[number].bits);
        int value = value_of(bits, from);

        CHECK(!is_torn(from));
        *arrived += value == wanted;
        if (!is_machine)
            fill(to_bits, to_bits, wanted);
        else if (value >= 0)
            fill(to_bits, to_bits, (uint8_t) value);
    }
    CHECK(ecrt_domain_queue(domain) == 0 && ecrt_master_send(master) == 0);
    return 0;
}

int main(int argc, char **argv)
{
    const struct timespec pause = {0, 20000};
    struct timespec now, end;
    ec_domain_state_t state;
    ec_master_state_t all;
    unsigned long cycles, number;
    int arrived;

    CHECK(argc == 4);
    alarm(60);
    is_machine = !strcmp(argv[1], "machine");
    slaves = atoi(argv[2]);
    cycles = strtoul(argv[3], NULL, 0);
    CHECK(slaves > 0 && slaves <= MOST);
    if (configure())
        return 1;
    CHECK(ecrt_domain_state(domain, &state) == 0 && state.wc_state == EC_WC_COMPLETE);
    CHECK(state.working_counter == (unsigned int) slaves);
    CHECK(ecrt_master_state(master, &all) == 0 && all.al_states == EC_AL_STATE_OP && all.link_up);
    printf("active\n");
    fflush(stdout);
    if (is_machine) {
        for (;;)
            if (cycle(0, &arrived))
                return 1;
    }
    for (number = 0; number < cycles; number++) {
        clock_gettime(CLOCK_MONOTONIC, &end);
        end.tv_sec += 10;
        do {
            if (cycle((uint8_t) (number % 255 + 1), &arrived))
                return 1;
            nanosleep(&pause, NULL);
            clock_gettime(CLOCK_MONOTONIC, &now);
            CHECK(now.tv_sec < end.tv_sec);
        } while (arrived < slaves);
    }
    CHECK(ecrt_master_deactivate(master) == 0 && ecrt_domain_process(domain) == -EINVAL);
    ecrt_release_master(master);
    printf("all values came back\n");
    return 0;
}
