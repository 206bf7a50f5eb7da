/* Domains: whole SyncManagers in the order of their registration, each from a byte on. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "fake.h"

/* First index of input PDOs. */
#define FIRST_INPUT_PDO 0x1A00
/* Largest domain. */
#define MOST_DOMAIN_BYTES (1U << 20)

static void drop_domain(struct child *child)
{
    ec_domain_t *domain = (ec_domain_t *) child;

    free(domain->data);
    list_drop(&domain->mapped);
    list_drop(&domain->links);
}

ec_domain_t *ecrt_master_create_domain(ec_master_t *master)
{
    ec_domain_t *domain;
    struct child *child;
    unsigned int created = 0;
    int number;

    if (!is_living(master, MARK_MASTER) || !master->is_reserved || master->is_active)
        return NULL;
    for (child = master->children; child; child = child->next)
        created += child->mark == MARK_DOMAIN;
    number = fake_domain_number(created);
    if (number < 0)
        return NULL;
    domain = child_new(master, sizeof *domain, MARK_DOMAIN, drop_domain);
    if (domain)
        domain->number = (unsigned int) number;
    return domain;
}

int domain_place(struct ec_domain *domain, struct ec_slave_config *slave, uint8_t sync, size_t bit_in_sync,
        unsigned int *bit_position)
{
    struct mapped *mapped = domain->mapped.elements;
    size_t number, bytes = (sync_bits(slave->syncs + sync) + 7) / 8;

    if (!bit_position && bit_in_sync % 8)
        return -EFAULT;
    for (number = 0; number < domain->mapped.count; number++)
        if (mapped[number].slave == slave && mapped[number].sync == sync)
            break;
    if (number == domain->mapped.count) {
        if (domain->size + bytes > MOST_DOMAIN_BYTES || !(mapped = list_add(&domain->mapped, sizeof *mapped)))
            return -EOVERFLOW;
        *mapped = (struct mapped) {slave, sync, domain->size, bytes};
        domain->size += bytes;
    } else {
        mapped += number;
    }
    if (bit_position)
        *bit_position = bit_in_sync % 8;
    return (int) (mapped->byte + bit_in_sync / 8);
}

static bool is_output(const struct sync *sync, const struct pdo *pdo)
{
    return sync->direction == EC_DIR_INVALID ? pdo->index < FIRST_INPUT_PDO : sync->direction == EC_DIR_OUTPUT;
}

/* Finds the areas of a SyncManager, one for each PDO with bits. */
static int connect_sync(ec_domain_t *domain, const struct mapped *mapped)
{
    const struct sync *sync = mapped->slave->syncs + mapped->sync;
    const struct pdo *pdos = sync->pdos.elements;
    size_t bit = 8 * mapped->byte, number, entry;

    if ((sync_bits(sync) + 7) / 8 != mapped->bytes)
        return -EINVAL;
    for (number = 0; number < sync->pdos.count; number++) {
        const struct pdo *pdo = pdos + number;
        const ec_pdo_entry_info_t *entries = pdo->entries.elements;
        struct link *link;
        char name[128];
        size_t bits = 0;
        int error;

        for (entry = 0; entry < pdo->entries.count; entry++)
            bits += entries[entry].bit_length;
        if (!bits)
            continue;
        snprintf(name, sizeof name, "%.64s/%u/%u/%08X/%04X", fake_prefix(), domain->child.master->index, domain->number,
            (unsigned int) mapped->slave->alias << 16 | mapped->slave->position, pdo->index);
        link = list_add(&domain->links, sizeof *link);
        if (!link)
            return -ENOMEM;
        *link = (struct link) {NULL, bit, bits, is_output(sync, pdo)};
        error = shared_area(domain->child.master->shared, name, (bits + 7) / 8, &link->area);
        if (error)
            return error;
        bit += bits;
    }
    return 0;
}

static int begin(ec_domain_t *domain)
{
    const struct mapped *mapped = domain->mapped.elements;
    size_t number;
    int error;

    for (number = 0; number < domain->mapped.count; number++)
        if ((error = connect_sync(domain, mapped + number)))
            return error;
    if (domain->size && !(domain->data = calloc(1, domain->size)))
        return -ENOMEM;
    return 0;
}

/* Memory and areas of all domains; outputs are 0. */
int domains_begin(struct ec_master *master)
{
    struct child *child;

    for (child = master->children; child; child = child->next) {
        int error = child->mark == MARK_DOMAIN ? begin((ec_domain_t *) child) : 0;

        if (!error && child->mark == MARK_DOMAIN)
            error = ecrt_domain_queue((ec_domain_t *) child);
        if (error) {
            domains_end(master);
            return error;
        }
    }
    return 0;
}

/* Outputs become 0 for the other program, memory and areas are given back. */
void domains_end(struct ec_master *master)
{
    struct child *child;

    for (child = master->children; child; child = child->next) {
        ec_domain_t *domain = (ec_domain_t *) child;

        if (child->mark != MARK_DOMAIN)
            continue;
        if (domain->data) {
            memset(domain->data, 0, domain->size);
            ecrt_domain_queue(domain);
        }
        free(domain->data);
        domain->data = NULL;
        list_drop(&domain->links);
    }
}

int ecrt_domain_reg_pdo_entry_list(ec_domain_t *domain, const ec_pdo_entry_reg_t *regs)
{
    int error;

    if (!is_configurable(&domain->child, MARK_DOMAIN, &error))
        return error;
    if (!regs)
        return -EFAULT;
    for (; regs->index; regs++) {
        ec_slave_config_t *sc = ecrt_master_slave_config(domain->child.master, regs->alias, regs->position,
            regs->vendor_id, regs->product_code);
        int offset;

        if (!sc)
            return -ENOENT;
        offset = ecrt_slave_config_reg_pdo_entry(sc, regs->index, regs->subindex, domain, regs->bit_position);
        if (offset < 0)
            return offset;
        if (!regs->offset)
            return -EFAULT;
        *regs->offset = (unsigned int) offset;
    }
    return 0;
}

size_t ecrt_domain_size(const ec_domain_t *domain)
{
    return is_living(domain, MARK_DOMAIN) ? domain->size : 0;
}

uint8_t *ecrt_domain_data(const ec_domain_t *domain)
{
    return is_living(domain, MARK_DOMAIN) ? domain->data : NULL;
}

/* Takes what the other program has published. */
int ecrt_domain_process(ec_domain_t *domain)
{
    struct link *link, *end;

    if (!is_living(domain, MARK_DOMAIN))
        return -EINVAL;
    if (!domain->data)
        return 0;
    for (link = domain->links.elements, end = link + domain->links.count; link < end; link++)
        if (!link->is_published)
            area_take(link->area, domain->data, link->bit, link->bits);
    return 0;
}

/* Publishes the outputs. */
int ecrt_domain_queue(ec_domain_t *domain)
{
    struct link *link, *end;

    if (!is_living(domain, MARK_DOMAIN))
        return -EINVAL;
    if (!domain->data)
        return 0;
    for (link = domain->links.elements, end = link + domain->links.count; link < end; link++)
        if (link->is_published)
            area_publish(link->area, domain->data, link->bit, link->bits);
    return 0;
}

/* The working counter is the number of SubDevices in the domain. */
int ecrt_domain_state(const ec_domain_t *domain, ec_domain_state_t *state)
{
    const struct mapped *mapped;
    size_t number, earlier, slaves = 0;

    if (!is_living(domain, MARK_DOMAIN))
        return -EINVAL;
    if (!state)
        return -EFAULT;
    mapped = domain->mapped.elements;
    for (number = 0; number < domain->mapped.count; number++) {
        for (earlier = 0; earlier < number && mapped[earlier].slave != mapped[number].slave; earlier++)
            ;
        slaves += earlier == number;
    }
    *state = (ec_domain_state_t) {(unsigned int) slaves, EC_WC_COMPLETE, 0};
    return 0;
}
