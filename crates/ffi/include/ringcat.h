/** @file
 * ringcat.h: what RingCAT adds to ecrt.h. Networks from a network file (docs/network-file.md of RingCAT) or from an ENI
 * of a configuration tool (docs/eni.md); lost frames that are sent again within their cycle (docs/redundancy.md).
 *
 * A program that loads one of them declares nothing itself: SubDevices with their PDOs, start-up commands and SYNC
 * signals, and the domains, are those of the file. The other functions of ecrt.h work as ever: requests and mailbox
 * services with the SubDevices, queue, process, state and data with the domains, clocks and the cycle with the master.
 * The library is libethercat of RingCAT; libfakeethercat does not have these functions.
 */
#ifndef RINGCAT_H
#define RINGCAT_H

#include "ecrt.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A variable of the file. Its domain has the byte at ecrt_domain_data(domain) + offset. */
typedef struct {
    ec_domain_t *domain;
    unsigned int offset; /**< byte in the image of the domain */
    unsigned int bit;    /**< bit in this byte, 0 to 7 */
    unsigned int bits;   /**< number of bits */
    int is_output;       /**< 1: the program writes it */
} ringcat_variable_t;

/**
 * Declares the network of a file, on a master that is requested and not active.
 *
 * Returns 0, or -EINVAL: the file cannot be read or is wrong, or it does not fit the bus (standard error has file, line
 * and reason); -EBUSY: SubDevices or domains were declared before, or the master is active; -EPERM: not reserved;
 * -EFAULT: path is NULL; -ENODEV: the threads of the library have ended. If it fails nothing is declared. After
 * ecrt_master_deactivate() nothing is declared either.
 *
 * Settings of its SubDevices cannot be changed by the program: the functions ecrt_slave_config_*() that do return
 * -EBUSY. SubDevices and domains of its own can be added.
 */
EC_PUBLIC_API int ringcat_master_load_network(ec_master_t *master, const char *path);

/**
 * The same with the contents of a network file in memory, of `size` bytes; it is read once. Returns as
 * ringcat_master_load_network(); -EFAULT: data is NULL. Messages name the file "network file in memory".
 */
EC_PUBLIC_API int ringcat_master_load_network_data(ec_master_t *master, const void *data, size_t size);

/**
 * Declares the network of an ENI. Returns as ringcat_master_load_network().
 *
 * Settings of the file that are not followed, or done in another way, are no error: standard error has a line for each
 * of the first 20, with file, line and reason; `ringcat eni FILE` lists all.
 *
 * Its domains have their numbers as names, from "0", in the order of the tasks (`Cyclic`) that exchange process data;
 * variables have the names of the file, those that reach past the process data of a SyncManager none. Copies from
 * inputs to outputs (`CopyInfos`) are the program's own.
 */
EC_PUBLIC_API int ringcat_master_load_eni(ec_master_t *master, const char *path);

/**
 * The same with the contents of an ENI in memory, of `size` bytes; it is read once. Returns as
 * ringcat_master_load_network(); -EFAULT: data is NULL. Messages name the file "ENI in memory".
 */
EC_PUBLIC_API int ringcat_master_load_eni_data(ec_master_t *master, const void *data, size_t size);

/**
 * The SubDevice with a name in the file, the first one if several have it; NULL if there is none.
 * ecrt_master_slave_config() finds it, too.
 */
EC_PUBLIC_API ec_slave_config_t *ringcat_master_subdevice(ec_master_t *master, const char *name);

/** The domain with a name in the file; NULL if there is none. */
EC_PUBLIC_API ec_domain_t *ringcat_master_domain(ec_master_t *master, const char *name);

/**
 * Finds the variable with a name in the file, as in "Drive.Feedback.Statusword"; the first one if several have it.
 *
 * Returns 0, or -ENOENT: there is none, or no domain exchanges it; -EPERM: not reserved; -EFAULT: NULL.
 */
EC_PUBLIC_API int ringcat_master_variable(ec_master_t *master, const char *name, ringcat_variable_t *variable);

/**
 * Lost frames of a domain are sent again within their cycle (1), or not (0, as without this call). The key of a network
 * file is `send_again`. The second try must be back before the next ecrt_master_send(), which is expected after the
 * time of ecrt_master_set_send_interval(); without it after the shortest period of the network file, or 1 ms.
 *
 * Returns 0, or -EBUSY: the master is active; -EINVAL: the handle has ended or is NULL.
 */
EC_PUBLIC_API int ringcat_domain_send_again(ec_domain_t *domain, int on);

/**
 * The time at which ecrt_master_receive() has to be called again, so that a frame that is lost by then is sent again:
 * in nanoseconds of CLOCK_MONOTONIC, UINT64_MAX if no frame is waited for. A cycle then is: send; receive when frames
 * usually are back; receive at this time, as long as it is before the next cycle; receive, process, queue. A real-time
 * thread may call it.
 *
 * Returns 0, or -EPERM: not reserved; -EBUSY: another thread makes a cyclic call; -EFAULT: time_ns is NULL; -ENODEV:
 * the daemon has taken the bus back; -EINVAL: the handle has ended or is NULL.
 */
EC_PUBLIC_API int ringcat_master_receive_again_at(ec_master_t *master, uint64_t *time_ns);

#ifdef __cplusplus
}
#endif

#endif
