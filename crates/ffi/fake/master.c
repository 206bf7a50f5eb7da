/* Life of a master, its cycle, and what it shows: as many SubDevices as were declared, all in OP. */
#include <errno.h>
#include <pthread.h>
#include <string.h>

#include "fake.h"

/* Bound of the differences of clocks, as observed with version 1.6.2. */
#define DIFFERENCE_NS 32U

/* Released masters whose memory is kept with that of their handles: a late call finds the missing mark. */
#define MOST_RELEASED 64U

/* Masters of this process; not touched by cyclic calls. */
static ec_master_t *masters;
/* Those that were released, the newest first. */
static ec_master_t *released;
static unsigned int released_count;
static pthread_mutex_t of_masters = PTHREAD_MUTEX_INITIALIZER;

ec_master_t *ecrt_open_master(unsigned int master_index)
{
    ec_master_t *master = calloc(1, sizeof *master);

    if (!master)
        return NULL;
    master->mark = MARK_MASTER;
    master->index = master_index;
    pthread_mutex_lock(&of_masters);
    master->next = masters;
    masters = master;
    pthread_mutex_unlock(&of_masters);
    return master;
}

int ecrt_master_reserve(ec_master_t *master)
{
    const ec_master_t *other;
    bool is_free = true;

    if (!is_living(master, MARK_MASTER))
        return -EINVAL;
    pthread_mutex_lock(&of_masters);
    for (other = masters; other; other = other->next)
        is_free &= other->index != master->index || !other->is_reserved;
    master->is_reserved |= is_free;
    pthread_mutex_unlock(&of_masters);
    return is_free ? 0 : -EBUSY;
}

ec_master_t *ecrt_request_master(unsigned int master_index)
{
    UNCANCELLED;
    ec_master_t *master = ecrt_open_master(master_index);

    if (master && ecrt_master_reserve(master)) {
        fake_report("Failed to reserve master %u: it is in use", master_index);
        ecrt_release_master(master);
        return NULL;
    }
    return master;
}

/* Keeps a released master; the oldest one of too many is freed. With the lock of the masters. */
static void keep_released(ec_master_t *master)
{
    ec_master_t **last = &released;

    master->next = released;
    released = master;
    if (released_count < MOST_RELEASED) {
        released_count++;
        return;
    }
    while ((*last)->next)
        last = &(*last)->next;
    children_free((*last)->ended);
    free(*last);
    *last = NULL;
}

void ecrt_release_master(ec_master_t *master)
{
    UNCANCELLED;
    ec_master_t **at;

    if (!is_living(master, MARK_MASTER))
        return;
    if (master->is_active)
        ecrt_master_deactivate(master);
    pthread_mutex_lock(&of_masters);
    for (at = &masters; *at && *at != master; at = &(*at)->next)
        ;
    /* Another thread may have released it meanwhile. */
    if (!*at) {
        pthread_mutex_unlock(&of_masters);
        return;
    }
    *at = master->next;
    children_end(master);
    master->mark = MARK_ENDED;
    keep_released(master);
    pthread_mutex_unlock(&of_masters);
}

static int check_reserved(const ec_master_t *master)
{
    if (!is_living(master, MARK_MASTER))
        return -EINVAL;
    return master->is_reserved ? 0 : -EPERM;
}

int ecrt_master_activate(ec_master_t *master)
{
    UNCANCELLED;
    int error = check_reserved(master);

    if (error || master->is_active)
        return error;
    error = shared_open(master->index, &master->shared);
    if (!error)
        error = fake_write_slaves(master);
    if (!error)
        error = domains_begin(master);
    if (error) {
        fake_report("Failed to activate master %u: %s", master->index, strerror(-error));
        shared_close(master->shared);
        master->shared = NULL;
        return error;
    }
    master->is_active = true;
    return 0;
}

int ecrt_master_deactivate(ec_master_t *master)
{
    UNCANCELLED;
    int error = check_reserved(master);

    if (error)
        return error;
    if (!master->is_active)
        return -EINVAL;
    domains_end(master);
    shared_close(master->shared);
    master->shared = NULL;
    master->is_active = false;
    master->app_time = 0;
    children_end(master);
    return 0;
}

int ecrt_master_receive(ec_master_t *master)
{
    return check_reserved(master);
}

int ecrt_master_send(ec_master_t *master)
{
    return check_reserved(master);
}

int ecrt_master_reset(ec_master_t *master)
{
    return check_reserved(master);
}

int ecrt_master_set_send_interval(ec_master_t *master, size_t send_interval)
{
    int error = check_reserved(master);

    (void) send_interval;
    return error ? error : master->is_active ? -EBUSY : 0;
}

int ecrt_master_application_time(ec_master_t *master, uint64_t app_time)
{
    int error = check_reserved(master);

    if (!error)
        master->app_time = app_time;
    return error;
}

int ecrt_master_select_reference_clock(ec_master_t *master, ec_slave_config_t *sc)
{
    int error = check_reserved(master);

    return !error && sc && !is_living(sc, MARK_SLAVE) ? -EINVAL : error;
}

int ecrt_master_sync_reference_clock(ec_master_t *master)
{
    return check_reserved(master);
}

int ecrt_master_sync_reference_clock_to(ec_master_t *master, uint64_t sync_time)
{
    (void) sync_time;
    return check_reserved(master);
}

int ecrt_master_sync_slave_clocks(ec_master_t *master)
{
    return check_reserved(master);
}

int ecrt_master_sync_monitor_queue(ec_master_t *master)
{
    return check_reserved(master);
}

uint32_t ecrt_master_sync_monitor_process(const ec_master_t *master)
{
    return check_reserved(master) ? UINT32_MAX : DIFFERENCE_NS;
}

/* The reference follows the application exactly. */
int ecrt_master_reference_clock_time(const ec_master_t *master, uint32_t *time)
{
    int error = check_reserved(master);

    if (!error && !time)
        error = -EFAULT;
    if (!error)
        *time = (uint32_t) master->app_time;
    return error;
}

static unsigned int slaves(const ec_master_t *master)
{
    const struct child *child;
    unsigned int count = 0;

    for (child = master->children; child; child = child->next)
        count += child->mark == MARK_SLAVE;
    return count;
}

int ecrt_master(ec_master_t *master, ec_master_info_t *master_info)
{
    if (!is_living(master, MARK_MASTER))
        return -EINVAL;
    if (!master_info)
        return -EFAULT;
    *master_info = (ec_master_info_t) {slaves(master), 1, 0, master->app_time};
    return 0;
}

int ecrt_master_scan_progress(ec_master_t *master, ec_master_scan_progress_t *progress)
{
    if (!is_living(master, MARK_MASTER))
        return -EINVAL;
    if (!progress)
        return -EFAULT;
    *progress = (ec_master_scan_progress_t) {slaves(master), slaves(master)};
    return 0;
}

int ecrt_master_state(const ec_master_t *master, ec_master_state_t *state)
{
    if (!is_living(master, MARK_MASTER))
        return -EINVAL;
    if (!state)
        return -EFAULT;
    *state = (ec_master_state_t) {slaves(master), EC_AL_STATE_OP, 1};
    return 0;
}

int ecrt_master_link_state(const ec_master_t *master, unsigned int dev_idx, ec_master_link_state_t *state)
{
    if (!is_living(master, MARK_MASTER) || dev_idx)
        return -EINVAL;
    if (!state)
        return -EFAULT;
    *state = (ec_master_link_state_t) {slaves(master), EC_AL_STATE_OP, 1};
    return 0;
}

static const ec_slave_config_t *at_position(const ec_master_t *master, uint16_t position)
{
    const struct child *child;

    for (child = is_living(master, MARK_MASTER) ? master->children : NULL; child; child = child->next) {
        const ec_slave_config_t *slave = (const ec_slave_config_t *) child;

        if (child->mark == MARK_SLAVE && !slave->alias && slave->position == position)
            return slave;
    }
    return NULL;
}

/* Declared SubDevices without an alias are found at their positions. */
int ecrt_master_get_slave(ec_master_t *master, uint16_t slave_position, ec_slave_info_t *slave_info)
{
    const ec_slave_config_t *slave = at_position(master, slave_position);
    size_t port;

    if (!slave)
        return -EINVAL;
    if (!slave_info)
        return -EFAULT;
    memset(slave_info, 0, sizeof *slave_info);
    slave_info->position = slave_position;
    slave_info->vendor_id = slave->vendor_id;
    slave_info->product_code = slave->product_code;
    slave_info->al_state = EC_AL_STATE_OP;
    for (port = 0; port < EC_MAX_PORTS; port++)
        slave_info->ports[port].next_slave = 0xffff;
    return 0;
}

int ecrt_slave_config_state(const ec_slave_config_t *sc, ec_slave_config_state_t *state)
{
    if (!is_living(sc, MARK_SLAVE))
        return -EINVAL;
    if (!state)
        return -EFAULT;
    *state = (ec_slave_config_state_t) {1, 1, EC_AL_STATE_OP};
    return 0;
}
