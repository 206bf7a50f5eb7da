/* Configuration of SubDevices: what a program declares is kept as it is, for the layout of domains and the file. */
#include <errno.h>
#include <string.h>

#include "fake.h"

static void clear_sync(struct sync *sync)
{
    struct pdo *pdos = sync->pdos.elements;
    size_t number;

    for (number = 0; number < sync->pdos.count; number++)
        list_drop(&pdos[number].entries);
    list_drop(&sync->pdos);
}

static void drop_slave(struct child *child)
{
    ec_slave_config_t *slave = (ec_slave_config_t *) child;
    struct sdo *sdos = slave->sdos.elements;
    size_t number;

    for (number = 0; number < EC_MAX_SYNC_MANAGERS; number++)
        clear_sync(slave->syncs + number);
    for (number = 0; number < slave->sdos.count; number++)
        free(sdos[number].data);
    list_drop(&slave->sdos);
}

ec_slave_config_t *ecrt_master_slave_config(ec_master_t *master, uint16_t alias, uint16_t position, uint32_t vendor_id,
        uint32_t product_code)
{
    struct child *child;
    ec_slave_config_t *slave;

    if (!is_living(master, MARK_MASTER) || !master->is_reserved)
        return NULL;
    for (child = master->children; child; child = child->next) {
        slave = (ec_slave_config_t *) child;
        if (child->mark == MARK_SLAVE && slave->alias == alias && slave->position == position)
            return slave->vendor_id == vendor_id && slave->product_code == product_code ? slave : NULL;
    }
    if (master->is_active)
        return NULL;
    slave = child_new(master, sizeof *slave, MARK_SLAVE, drop_slave);
    if (!slave)
        return NULL;
    slave->alias = alias;
    slave->position = position;
    slave->vendor_id = vendor_id;
    slave->product_code = product_code;
    return slave;
}

static struct pdo *find_pdo(ec_slave_config_t *sc, uint16_t index)
{
    size_t sync, number;

    for (sync = 0; sync < EC_MAX_SYNC_MANAGERS; sync++) {
        struct pdo *pdos = sc->syncs[sync].pdos.elements;

        for (number = 0; number < sc->syncs[sync].pdos.count; number++)
            if (pdos[number].index == index)
                return pdos + number;
    }
    return NULL;
}

static size_t pdo_bits(const struct pdo *pdo, size_t before)
{
    const ec_pdo_entry_info_t *entries = pdo->entries.elements;
    size_t bits = 0, number;

    for (number = 0; number < before; number++)
        bits += entries[number].bit_length;
    return bits;
}

size_t sync_bits(const struct sync *sync)
{
    const struct pdo *pdos = sync->pdos.elements;
    size_t bits = 0, number;

    for (number = 0; number < sync->pdos.count; number++)
        bits += pdo_bits(pdos + number, pdos[number].entries.count);
    return bits;
}

int ecrt_slave_config_sync_manager(ec_slave_config_t *sc, uint8_t sync_index, ec_direction_t direction,
        ec_watchdog_mode_t watchdog_mode)
{
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (sync_index >= EC_MAX_SYNC_MANAGERS)
        return -ENOENT;
    if ((direction != EC_DIR_OUTPUT && direction != EC_DIR_INPUT) || (unsigned int) watchdog_mode > EC_WD_DISABLE)
        return -EINVAL;
    sc->syncs[sync_index].direction = direction;
    return 0;
}

int ecrt_slave_config_pdo_assign_add(ec_slave_config_t *sc, uint8_t sync_index, uint16_t index)
{
    struct pdo *pdo;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (sync_index >= EC_MAX_SYNC_MANAGERS)
        return -ENOENT;
    if (find_pdo(sc, index))
        return -EEXIST;
    pdo = list_add(&sc->syncs[sync_index].pdos, sizeof *pdo);
    if (!pdo)
        return -ENOMEM;
    pdo->index = index;
    return 0;
}

int ecrt_slave_config_pdo_assign_clear(ec_slave_config_t *sc, uint8_t sync_index)
{
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (sync_index >= EC_MAX_SYNC_MANAGERS)
        return -ENOENT;
    clear_sync(sc->syncs + sync_index);
    return 0;
}

int ecrt_slave_config_pdo_mapping_add(ec_slave_config_t *sc, uint16_t pdo_index, uint16_t entry_index,
        uint8_t entry_subindex, uint8_t entry_bit_length)
{
    struct pdo *pdo;
    ec_pdo_entry_info_t *entry;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (!(pdo = find_pdo(sc, pdo_index)))
        return -ENOENT;
    if (!(entry = list_add(&pdo->entries, sizeof *entry)))
        return -ENOMEM;
    *entry = (ec_pdo_entry_info_t) {entry_index, entry_subindex, entry_bit_length};
    return 0;
}

int ecrt_slave_config_pdo_mapping_clear(ec_slave_config_t *sc, uint16_t pdo_index)
{
    struct pdo *pdo;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (!(pdo = find_pdo(sc, pdo_index)))
        return -ENOENT;
    list_drop(&pdo->entries);
    return 0;
}

static int take_pdo(ec_slave_config_t *sc, uint8_t sync, const ec_pdo_info_t *pdo)
{
    unsigned int number;
    int error = ecrt_slave_config_pdo_assign_add(sc, sync, pdo->index);

    if (error)
        return error;
    if (!pdo->n_entries || !pdo->entries) {
        fake_report("PDO 0x%04X: expected its entries, got none: there is no SubDevice that has defaults", pdo->index);
        return -EINVAL;
    }
    for (number = 0; number < pdo->n_entries; number++) {
        const ec_pdo_entry_info_t *entry = pdo->entries + number;

        error = ecrt_slave_config_pdo_mapping_add(sc, pdo->index, entry->index, entry->subindex, entry->bit_length);
        if (error)
            return error;
    }
    return 0;
}

int ecrt_slave_config_pdos(ec_slave_config_t *sc, unsigned int n_syncs, const ec_sync_info_t syncs[])
{
    unsigned int number, pdo;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (!syncs)
        return 0;
    for (number = 0; number < n_syncs && syncs[number].index != 0xff; number++) {
        const ec_sync_info_t *sync = syncs + number;

        error = ecrt_slave_config_sync_manager(sc, sync->index, sync->dir, sync->watchdog_mode);
        if (!error && sync->n_pdos && sync->pdos)
            clear_sync(sc->syncs + sync->index);
        for (pdo = 0; !error && sync->pdos && pdo < sync->n_pdos; pdo++)
            error = take_pdo(sc, sync->index, sync->pdos + pdo);
        if (error)
            return error;
    }
    return 0;
}

static int place(ec_slave_config_t *sc, ec_domain_t *domain, uint8_t sync, size_t bit, unsigned int *bit_position)
{
    if (!is_living(domain, MARK_DOMAIN) || domain->child.master != sc->child.master)
        return -EINVAL;
    return domain_place(domain, sc, sync, bit, bit_position);
}

int ecrt_slave_config_reg_pdo_entry(ec_slave_config_t *sc, uint16_t entry_index, uint8_t entry_subindex,
        ec_domain_t *domain, unsigned int *bit_position)
{
    size_t sync, number, entry, bit;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    for (sync = 0; sync < EC_MAX_SYNC_MANAGERS; sync++) {
        const struct pdo *pdos = sc->syncs[sync].pdos.elements;

        for (bit = 0, number = 0; number < sc->syncs[sync].pdos.count; number++) {
            const ec_pdo_entry_info_t *entries = pdos[number].entries.elements;

            for (entry = 0; entry < pdos[number].entries.count; entry++) {
                if (entries[entry].index == entry_index && entries[entry].subindex == entry_subindex)
                    return place(sc, domain, (uint8_t) sync, bit, bit_position);
                bit += entries[entry].bit_length;
            }
        }
    }
    return -ENOENT;
}

int ecrt_slave_config_reg_pdo_entry_pos(ec_slave_config_t *sc, uint8_t sync_index, unsigned int pdo_pos,
        unsigned int entry_pos, ec_domain_t *domain, unsigned int *bit_position)
{
    const struct pdo *pdos;
    size_t bit = 0, number;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (sync_index >= EC_MAX_SYNC_MANAGERS || pdo_pos >= sc->syncs[sync_index].pdos.count)
        return -ENOENT;
    pdos = sc->syncs[sync_index].pdos.elements;
    if (entry_pos >= pdos[pdo_pos].entries.count)
        return -ENOENT;
    for (number = 0; number < pdo_pos; number++)
        bit += pdo_bits(pdos + number, pdos[number].entries.count);
    return place(sc, domain, sync_index, bit + pdo_bits(pdos + pdo_pos, entry_pos), bit_position);
}

static int add_sdo(ec_slave_config_t *sc, uint16_t index, int subindex, const uint8_t *data, size_t size)
{
    struct sdo *sdo;
    uint8_t *copy;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error))
        return error;
    if (!data || !size || size > MOST_SDO_BYTES)
        return -EINVAL;
    copy = malloc(size);
    if (!copy || !(sdo = list_add(&sc->sdos, sizeof *sdo))) {
        free(copy);
        return -ENOMEM;
    }
    memcpy(copy, data, size);
    *sdo = (struct sdo) {index, subindex, copy, size};
    return 0;
}

int ecrt_slave_config_sdo(ec_slave_config_t *sc, uint16_t index, uint8_t subindex, const uint8_t *data, size_t size)
{
    return add_sdo(sc, index, subindex, data, size);
}

int ecrt_slave_config_complete_sdo(ec_slave_config_t *sc, uint16_t index, const uint8_t *data, size_t size)
{
    return add_sdo(sc, index, -1, data, size);
}

int ecrt_slave_config_sdo8(ec_slave_config_t *sc, uint16_t sdo_index, uint8_t sdo_subindex, uint8_t value)
{
    return add_sdo(sc, sdo_index, sdo_subindex, &value, 1);
}

int ecrt_slave_config_sdo16(ec_slave_config_t *sc, uint16_t sdo_index, uint8_t sdo_subindex, uint16_t value)
{
    uint16_t data = cpu_to_le16(value);

    return add_sdo(sc, sdo_index, sdo_subindex, (const uint8_t *) &data, sizeof data);
}

int ecrt_slave_config_sdo32(ec_slave_config_t *sc, uint16_t sdo_index, uint8_t sdo_subindex, uint32_t value)
{
    uint32_t data = cpu_to_le32(value);

    return add_sdo(sc, sdo_index, sdo_subindex, (const uint8_t *) &data, sizeof data);
}
