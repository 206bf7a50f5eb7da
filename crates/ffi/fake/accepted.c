/* Settings that are accepted without effect, information that nothing has, and numbers in process data. */
#include <errno.h>
#include <string.h>

#include "fake.h"

/* SDO abort code: the object does not exist. */
#define NO_OBJECT 0x06020000U
/* Longest name of a host, and drives behind a SubDevice. */
#define MOST_NAME 32
#define LAST_DRIVE 7

unsigned int ecrt_version_magic(void)
{
    return ECRT_VERSION_MAGIC;
}

static int accepted(const ec_slave_config_t *sc)
{
    int error;

    is_configurable(&sc->child, MARK_SLAVE, &error);
    return error;
}

int ecrt_slave_config_watchdog(ec_slave_config_t *sc, uint16_t watchdog_divider, uint16_t watchdog_intervals)
{
    (void) watchdog_divider, (void) watchdog_intervals;
    return accepted(sc);
}

int ecrt_slave_config_dc(ec_slave_config_t *sc, uint16_t assign_activate, uint32_t sync0_cycle, int32_t sync0_shift,
        uint32_t sync1_cycle, int32_t sync1_shift)
{
    (void) assign_activate, (void) sync0_cycle, (void) sync0_shift, (void) sync1_cycle, (void) sync1_shift;
    return accepted(sc);
}

int ecrt_slave_config_flag(ec_slave_config_t *sc, const char *key, int32_t value)
{
    int error = accepted(sc);

    (void) value;
    return error ? error : key ? 0 : -EFAULT;
}

static bool is_state(ec_al_state_t state)
{
    return state == EC_AL_STATE_INIT || state == EC_AL_STATE_PREOP || state == EC_AL_STATE_SAFEOP
        || state == EC_AL_STATE_OP;
}

int ecrt_slave_config_state_timeout(ec_slave_config_t *sc, ec_al_state_t from_state, ec_al_state_t to_state,
        unsigned int timeout_ms)
{
    int error = accepted(sc);

    (void) timeout_ms;
    return error ? error : is_state(from_state) && is_state(to_state) ? 0 : -EINVAL;
}

int ecrt_slave_config_idn(ec_slave_config_t *sc, uint8_t drive_no, uint16_t idn, ec_al_state_t state,
        const uint8_t *data, size_t size)
{
    int error = accepted(sc);

    (void) idn;
    if (error)
        return error;
    return drive_no <= LAST_DRIVE && (state == EC_AL_STATE_PREOP || state == EC_AL_STATE_SAFEOP) && data && size
        ? 0 : -EINVAL;
}

int ecrt_slave_config_emerg_size(ec_slave_config_t *sc, size_t elements)
{
    (void) elements;
    return accepted(sc);
}

int ecrt_slave_config_emerg_pop(ec_slave_config_t *sc, uint8_t *target)
{
    (void) target;
    return is_living(sc, MARK_SLAVE) ? -ENOENT : -EINVAL;
}

int ecrt_slave_config_emerg_clear(ec_slave_config_t *sc)
{
    return is_living(sc, MARK_SLAVE) ? 0 : -EINVAL;
}

int ecrt_slave_config_emerg_overruns(const ec_slave_config_t *sc)
{
    return is_living(sc, MARK_SLAVE) ? 0 : -EINVAL;
}

int ecrt_slave_config_eoe_mac_address(ec_slave_config_t *sc, const unsigned char *mac_address)
{
    int error = accepted(sc);

    return error ? error : mac_address ? 0 : -EFAULT;
}

int ecrt_slave_config_eoe_ip_address(ec_slave_config_t *sc, struct in_addr ip_address)
{
    (void) ip_address;
    return accepted(sc);
}

int ecrt_slave_config_eoe_subnet_mask(ec_slave_config_t *sc, struct in_addr subnet_mask)
{
    (void) subnet_mask;
    return accepted(sc);
}

int ecrt_slave_config_eoe_default_gateway(ec_slave_config_t *sc, struct in_addr gateway_address)
{
    (void) gateway_address;
    return accepted(sc);
}

int ecrt_slave_config_eoe_dns_address(ec_slave_config_t *sc, struct in_addr dns_address)
{
    (void) dns_address;
    return accepted(sc);
}

int ecrt_slave_config_eoe_hostname(ec_slave_config_t *sc, const char *name)
{
    int error = accepted(sc);

    if (error)
        return error;
    return !name ? -EFAULT : strlen(name) > MOST_NAME ? -EINVAL : 0;
}

static int nothing(const ec_master_t *master)
{
    return is_living(master, MARK_MASTER) ? -ENOENT : -EINVAL;
}

int ecrt_master_get_sync_manager(ec_master_t *master, uint16_t slave_position, uint8_t sync_index,
        ec_sync_info_t *sync)
{
    (void) slave_position, (void) sync_index, (void) sync;
    return nothing(master);
}

int ecrt_master_get_pdo(ec_master_t *master, uint16_t slave_position, uint8_t sync_index, uint16_t pos,
        ec_pdo_info_t *pdo)
{
    (void) slave_position, (void) sync_index, (void) pos, (void) pdo;
    return nothing(master);
}

int ecrt_master_get_pdo_entry(ec_master_t *master, uint16_t slave_position, uint8_t sync_index, uint16_t pdo_pos,
        uint16_t entry_pos, ec_pdo_entry_info_t *entry)
{
    (void) slave_position, (void) sync_index, (void) pdo_pos, (void) entry_pos, (void) entry;
    return nothing(master);
}

static int abort_transfer(const ec_master_t *master, uint32_t *abort_code)
{
    if (!is_living(master, MARK_MASTER))
        return -EINVAL;
    if (abort_code)
        *abort_code = NO_OBJECT;
    return -EIO;
}

int ecrt_master_sdo_download(ec_master_t *master, uint16_t slave_position, uint16_t index, uint8_t subindex,
        const uint8_t *data, size_t data_size, uint32_t *abort_code)
{
    (void) slave_position, (void) index, (void) subindex, (void) data, (void) data_size;
    return abort_transfer(master, abort_code);
}

int ecrt_master_sdo_download_complete(ec_master_t *master, uint16_t slave_position, uint16_t index,
        const uint8_t *data, size_t data_size, uint32_t *abort_code)
{
    (void) slave_position, (void) index, (void) data, (void) data_size;
    return abort_transfer(master, abort_code);
}

int ecrt_master_sdo_upload(ec_master_t *master, uint16_t slave_position, uint16_t index, uint8_t subindex,
        uint8_t *target, size_t target_size, size_t *result_size, uint32_t *abort_code)
{
    (void) slave_position, (void) index, (void) subindex, (void) target, (void) target_size, (void) result_size;
    return abort_transfer(master, abort_code);
}

int ecrt_master_read_idn(ec_master_t *master, uint16_t slave_position, uint8_t drive_no, uint16_t idn,
        uint8_t *target, size_t target_size, size_t *result_size, uint16_t *error_code)
{
    (void) slave_position, (void) drive_no, (void) idn, (void) target, (void) target_size, (void) result_size;
    (void) error_code;
    return abort_transfer(master, NULL);
}

int ecrt_master_write_idn(ec_master_t *master, uint16_t slave_position, uint8_t drive_no, uint16_t idn,
        const uint8_t *data, size_t data_size, uint16_t *error_code)
{
    (void) slave_position, (void) drive_no, (void) idn, (void) data, (void) data_size, (void) error_code;
    return abort_transfer(master, NULL);
}

float ecrt_read_real(const void *data)
{
    uint32_t bits;
    float value;

    memcpy(&bits, data, sizeof bits);
    bits = le32_to_cpu(bits);
    memcpy(&value, &bits, sizeof value);
    return value;
}

double ecrt_read_lreal(const void *data)
{
    uint64_t bits;
    double value;

    memcpy(&bits, data, sizeof bits);
    bits = le64_to_cpu(bits);
    memcpy(&value, &bits, sizeof value);
    return value;
}

void ecrt_write_real(void *data, float value)
{
    uint32_t bits;

    memcpy(&bits, &value, sizeof bits);
    bits = cpu_to_le32(bits);
    memcpy(data, &bits, sizeof bits);
}

void ecrt_write_lreal(void *data, double value)
{
    uint64_t bits;

    memcpy(&bits, &value, sizeof bits);
    bits = cpu_to_le64(bits);
    memcpy(data, &bits, sizeof bits);
}
