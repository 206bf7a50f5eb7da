/** @file
 * ecrt.h: the realtime interface of EtherCAT masters on Linux, version 1.6, as RingCAT provides it.
 *
 * A program requests a master, declares the SubDevices that it uses and places their process data in domains,
 * activates, and then cycles: receive, process, its own work, queue, send. docs/ecrt.md of RingCAT has tables of all
 * functions with their return codes. Functions return 0 or a value, and a negative error number if they fail.
 *
 * The phases of a handle: it is opened (ecrt_open_master()), reserved (ecrt_request_master(), ecrt_master_reserve()),
 * active (ecrt_master_activate()), and reserved again after the deactivation (ecrt_master_deactivate()). In any other
 * phase than those it names a function returns a code of its list, and changes nothing.
 *
 * After an internal error each function returns -EIO (NULL, 0, EC_REQUEST_ERROR) for the master in which it happened,
 * until ecrt_release_master(); a line on standard error names the reason.
 */
#ifndef __ECRT_H__
#define __ECRT_H__

#ifdef __KERNEL__
#include <asm/byteorder.h>
#include <linux/in.h>
#include <linux/time.h>
#include <linux/types.h>
#else
#include <netinet/in.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/time.h>
#endif

/* Version and features of this interface. */

#define ECRT_VER_MAJOR 1
#define ECRT_VER_MINOR 6
#define ECRT_VERSION(a, b) (((a) << 8) + (b))
#define ECRT_VERSION_MAGIC ECRT_VERSION(ECRT_VER_MAJOR, ECRT_VER_MINOR)

#define EC_HAVE_EMERGENCY
#define EC_HAVE_FLAGS
#define EC_HAVE_REDUNDANCY
#define EC_HAVE_REF_CLOCK_TIME
#define EC_HAVE_REG_ACCESS
#define EC_HAVE_REG_BY_POS
#define EC_HAVE_SCAN_PROGRESS
#define EC_HAVE_SELECT_REF_CLOCK
#define EC_HAVE_SET_IP
#define EC_HAVE_SOE_REQUESTS
#define EC_HAVE_STATE_TIMEOUT
#define EC_HAVE_SYNC_TO

#ifdef __KERNEL__
#define EC_PUBLIC_API
#else
#define EC_PUBLIC_API __attribute__((visibility("default")))
#endif

/* Sizes, and the end of lists. */

#define EC_END ~0U
#define EC_MAX_SYNC_MANAGERS 16
#define EC_MAX_STRING_LENGTH 64
#define EC_MAX_PORTS 4
#define EC_COE_EMERGENCY_MSG_SIZE 8

/* Nanoseconds since 2000 of a struct timeval. */
#define EC_TIMEVAL2NANO(TV) (((TV).tv_sec - 946684800ULL) * 1000000000ULL + (TV).tv_usec * 1000ULL)

#ifdef __cplusplus
extern "C" {
#endif

/* Handles. */

typedef struct ec_domain ec_domain_t;
typedef struct ec_master ec_master_t;
typedef struct ec_reg_request ec_reg_request_t;
typedef struct ec_sdo_request ec_sdo_request_t;
typedef struct ec_slave_config ec_slave_config_t;
typedef struct ec_soe_request ec_soe_request_t;
typedef struct ec_voe_handler ec_voe_handler_t;

/* Enumerations. */

typedef enum {
    EC_AL_STATE_INIT = 1,
    EC_AL_STATE_PREOP = 2,
    EC_AL_STATE_SAFEOP = 4,
    EC_AL_STATE_OP = 8
} ec_al_state_t;

typedef enum {
    EC_DIR_INVALID,
    EC_DIR_OUTPUT,
    EC_DIR_INPUT,
    EC_DIR_COUNT
} ec_direction_t;

typedef enum {
    EC_REQUEST_UNUSED,
    EC_REQUEST_BUSY,
    EC_REQUEST_SUCCESS,
    EC_REQUEST_ERROR
} ec_request_state_t;

typedef enum {
    EC_PORT_NOT_IMPLEMENTED,
    EC_PORT_NOT_CONFIGURED,
    EC_PORT_EBUS,
    EC_PORT_MII
} ec_slave_port_desc_t;

typedef enum {
    EC_WD_DEFAULT,
    EC_WD_ENABLE,
    EC_WD_DISABLE
} ec_watchdog_mode_t;

typedef enum {
    EC_WC_ZERO = 0,
    EC_WC_INCOMPLETE,
    EC_WC_COMPLETE
} ec_wc_state_t;

/* Structures. Their layout is fixed. */

typedef struct {
    unsigned int slaves_responding;
    unsigned int al_states : 4;
    unsigned int link_up : 1;
} ec_master_state_t;

typedef struct {
    unsigned int slaves_responding;
    unsigned int al_states : 4;
    unsigned int link_up : 1;
} ec_master_link_state_t;

typedef struct {
    unsigned int online : 1;
    unsigned int operational : 1;
    unsigned int al_state : 4;
} ec_slave_config_state_t;

typedef struct {
    unsigned int slave_count;
    unsigned int link_up : 1;
    uint8_t scan_busy;
    uint64_t app_time;
} ec_master_info_t;

typedef struct {
    unsigned int slave_count;
    unsigned int scan_index;
} ec_master_scan_progress_t;

typedef struct {
    uint8_t link_up;
    uint8_t loop_closed;
    uint8_t signal_detected;
} ec_slave_port_link_t;

typedef struct {
    uint16_t position;
    uint32_t vendor_id;
    uint32_t product_code;
    uint32_t revision_number;
    uint32_t serial_number;
    uint16_t alias;
    int16_t current_on_ebus;
    struct {
        ec_slave_port_desc_t desc;
        ec_slave_port_link_t link;
        uint32_t receive_time;
        uint16_t next_slave;
        uint32_t delay_to_next_dc;
    } ports[4];
    uint8_t al_state;
    uint8_t error_flag;
    uint8_t sync_count;
    uint16_t sdo_count;
    char name[64];
} ec_slave_info_t;

typedef struct {
    unsigned int working_counter;
    ec_wc_state_t wc_state;
    unsigned int redundancy_active;
} ec_domain_state_t;

typedef struct {
    uint16_t index;
    uint8_t subindex;
    uint8_t bit_length;
} ec_pdo_entry_info_t;

typedef struct {
    uint16_t index;
    unsigned int n_entries;
    const ec_pdo_entry_info_t *entries;
} ec_pdo_info_t;

typedef struct {
    uint8_t index;
    ec_direction_t dir;
    unsigned int n_pdos;
    const ec_pdo_info_t *pdos;
    ec_watchdog_mode_t watchdog_mode;
} ec_sync_info_t;

typedef struct {
    uint16_t alias;
    uint16_t position;
    uint32_t vendor_id;
    uint32_t product_code;
    uint16_t index;
    uint8_t subindex;
    unsigned int *offset;
    unsigned int *bit_position;
} ec_pdo_entry_reg_t;

/* Masters. */

/** Number of SubDevices, link, whether a scan runs, and the time of the application.
  * Phases: any, also a master that was opened only.
  * @return 0; -EFAULT: master_info is NULL; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_master(ec_master_t *master, ec_master_info_t *master_info);
/** Starts the application with what was declared, and gives the domains their memory. It returns at once:
  * SubDevices go to OP while the program cycles. After an error another activation may follow.
  * Phases: reserved; while the application is active it does nothing.
  * @return 0; -EINVAL: the declaration does not fit the bus (a line has the reason), or the handle has ended or is
  *         NULL; -EPERM: the master was opened only; -EBUSY: a cyclic call of another thread does not end; -ENODEV:
  *         the daemon has taken the bus back, or the acyclic half has ended. */
EC_PUBLIC_API int ecrt_master_activate(ec_master_t *master);
/** Sets the time of the application in nanoseconds since 2000; it wraps, and 0 is no time. The first one aligns
  * SYNC pulses. Call it once in a cycle, with the time at which the cycle was to begin.
  * Phases: reserved, active, after the deactivation.
  * @return 0; -EPERM: the master was opened only; -EBUSY: another cyclic call runs; -EINVAL: the handle has ended
  *         or is NULL. */
EC_PUBLIC_API int ecrt_master_application_time(ec_master_t *master, uint64_t app_time);
/** Declares a domain: process data that is exchanged together.
  * Phases: reserved, before the activation.
  * @return the domain, which ends with the deactivation; NULL: the application is active, the master is not
  *         reserved, or the handle has ended or is NULL. */
EC_PUBLIC_API ec_domain_t *ecrt_master_create_domain(ec_master_t *master);
/** Ends the application: SubDevices go to PREOP. All handles but that of the master end, and the memory of process
  * data is not to be used any more. The program may declare and activate again.
  * Phases: active.
  * @return 0; -EINVAL: nothing is active, or the handle has ended or is NULL; -EPERM: the master was opened only;
  *         -EBUSY: a cyclic call of another thread does not end. */
EC_PUBLIC_API int ecrt_master_deactivate(ec_master_t *master);
/** A PDO of a SyncManager, by its place in the assignment. Its entries are NULL: ecrt_master_get_pdo_entry() has
  * them.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice, SyncManager or place, or the handle has ended or is NULL;
  *         -EFAULT: the pointer for the result is NULL. */
EC_PUBLIC_API int ecrt_master_get_pdo(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t sync_index,
        uint16_t pos,
        ec_pdo_info_t *pdo);
/** An entry of a PDO, by its place in the mapping.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice, SyncManager or place, or the handle has ended or is NULL;
  *         -EFAULT: the pointer for the result is NULL. */
EC_PUBLIC_API int ecrt_master_get_pdo_entry(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t sync_index,
        uint16_t pdo_pos,
        uint16_t entry_pos,
        ec_pdo_entry_info_t *entry);
/** Identity, ports, state and name of the SubDevice at a position of the ring.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice, or the handle has ended or is NULL; -EFAULT: the pointer for the
  *         result is NULL. */
EC_PUBLIC_API int ecrt_master_get_slave(
        ec_master_t *master,
        uint16_t slave_position,
        ec_slave_info_t *slave_info);
/** A SyncManager of a SubDevice: direction, watchdog, number of PDOs. Its list of PDOs is NULL:
  * ecrt_master_get_pdo() has them.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice, SyncManager or place, or the handle has ended or is NULL;
  *         -EFAULT: the pointer for the result is NULL. */
EC_PUBLIC_API int ecrt_master_get_sync_manager(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t sync_index,
        ec_sync_info_t *sync);
/** SubDevices that answer on one link, with their states: dev_idx 0 is the main link, 1 the redundant one of a
  * ring.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such link, or the handle has ended or is NULL; -EFAULT: state is NULL; -EBUSY:
  *         another thread activates or deactivates the application. */
EC_PUBLIC_API int ecrt_master_link_state(
        const ec_master_t *master,
        unsigned int dev_idx,
        ec_master_link_state_t *state);
/** Reads an IDN by SoE, and waits for the answer. It also works while nothing cycles.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice or drive (0 to 7), or the handle has ended or is NULL;
  *         -EPROTONOSUPPORT: it has no SoE; -EIO: the SubDevice refuses, with its reason in error_code; -EOVERFLOW:
  *         target is too small; -ETIMEDOUT: it does not answer; -EFAULT: target or result_size is NULL. */
EC_PUBLIC_API int ecrt_master_read_idn(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t drive_no,
        uint16_t idn,
        uint8_t *target,
        size_t target_size,
        size_t *result_size,
        uint16_t *error_code);
/** Takes the frames that have arrived: the first call of a cycle.
  * Phases: active; before, nothing is exchanged and it returns 0.
  * @return 0; -EPERM: the master was opened only; -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken
  *         the bus back; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_master_receive(ec_master_t *master);
/** Lower 32 bits of the time of the reference clock, in nanoseconds, as read by the last frame that distributed it
  * (ecrt_master_sync_slave_clocks()).
  * Phases: active.
  * @return 0; -ENXIO: there is no reference clock, or nothing is active; -EIO: its datagram was lost; -EFAULT: time
  *         is NULL; -EPERM: the master was opened only; -EBUSY: another cyclic call runs; -EINVAL: the handle has
  *         ended or is NULL. */
EC_PUBLIC_API int ecrt_master_reference_clock_time(const ec_master_t *master, uint32_t *time);
/** Reserves a master that was opened, and takes its bus from the daemon. Returns once the bus is scanned.
  * Phases: opened.
  * @return 0; -EBUSY: this handle, another one or another process has it (a line names the process); -EPERM: this
  *         user may only read; -ENODEV: nothing drives the master; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_master_reserve(ec_master_t *master);
/** Tries failed configurations again.
  * Phases: reserved, active, after the deactivation.
  * @return 0; -EPERM: the master was opened only; -EBUSY: another thread activates or deactivates the application;
  *         -ENODEV: the acyclic half has ended; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_master_reset(ec_master_t *master);
/** Progress of a scan: scan_index is 0 while one runs, afterwards the number of SubDevices.
  * Phases: any, also a master that was opened only.
  * @return 0; -EFAULT: progress is NULL; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_master_scan_progress(ec_master_t *master, ec_master_scan_progress_t *progress);
/** Writes an object by CoE, and waits for the answer. It also works while nothing cycles.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice, no data, or the handle has ended or is NULL; -EPROTONOSUPPORT:
  *         it has no CoE; -EIO: the SubDevice aborts, with its reason in abort_code; -ETIMEDOUT: it does not
  *         answer; -EFAULT: data is NULL; -EPERM: this user may only read. */
EC_PUBLIC_API int ecrt_master_sdo_download(
        ec_master_t *master,
        uint16_t slave_position,
        uint16_t index,
        uint8_t subindex,
        const uint8_t *data,
        size_t data_size,
        uint32_t *abort_code);
/** Writes all subindices of an object by CoE (complete access), and waits for the answer.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice, no data, or the handle has ended or is NULL; -EPROTONOSUPPORT:
  *         it has no CoE; -EIO: the SubDevice aborts, with its reason in abort_code; -ETIMEDOUT: it does not
  *         answer; -EFAULT: data is NULL; -EPERM: this user may only read. */
EC_PUBLIC_API int ecrt_master_sdo_download_complete(
        ec_master_t *master,
        uint16_t slave_position,
        uint16_t index,
        const uint8_t *data,
        size_t data_size,
        uint32_t *abort_code);
/** Reads an object by CoE, and waits for the answer. It also works while nothing cycles.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice, or the handle has ended or is NULL; -EPROTONOSUPPORT: it has no
  *         CoE; -EIO: the SubDevice aborts, with its reason in abort_code; -EOVERFLOW: target is too small;
  *         -ETIMEDOUT: it does not answer; -EFAULT: target or result_size is NULL. */
EC_PUBLIC_API int ecrt_master_sdo_upload(
        ec_master_t *master,
        uint16_t slave_position,
        uint16_t index,
        uint8_t subindex,
        uint8_t *target,
        size_t target_size,
        size_t *result_size,
        uint32_t *abort_code);
/** Chooses the reference clock; NULL: the first SubDevice with a clock.
  * Phases: reserved, active, after the deactivation.
  * @return 0; -EINVAL: the SubDevice has no clock, or a handle has ended; -ENXIO: no SubDevice has a clock; -EPERM:
  *         the master was opened only. */
EC_PUBLIC_API int ecrt_master_select_reference_clock(ec_master_t *master, ec_slave_config_t *sc);
/** Sends what was queued: the last call of a cycle.
  * Phases: active; before, nothing is exchanged and it returns 0.
  * @return 0; -EPERM: the master was opened only; -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken
  *         the bus back; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_master_send(ec_master_t *master);
/** Microseconds from one ecrt_master_send() to the next: frames that are sent again have to be back before its end.
  * 0, or no call: the shortest period of a network file; without one 1000.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active; -EPERM: the master was opened only; -EINVAL: the handle has ended
  *         or is NULL. */
EC_PUBLIC_API int ecrt_master_set_send_interval(ec_master_t *master, size_t send_interval);
/** Declares a SubDevice: position counts from the SubDevice with this alias, or with alias 0 from the first one. An
  * absent one is declared too. The same declaration again returns the same handle.
  * Phases: reserved, before the activation; one that is declared also while active.
  * @return the configuration, which ends with the deactivation; NULL: another vendor or product is declared there,
  *         the application is active, the master is not reserved, or the handle has ended or is NULL. */
EC_PUBLIC_API ec_slave_config_t *ecrt_master_slave_config(
        ec_master_t *master,
        uint16_t alias,
        uint16_t position,
        uint32_t vendor_id,
        uint32_t product_code);
/** SubDevices that answer, their AL states ORed, and the link.
  * Phases: any, also a master that was opened only.
  * @return 0; -EFAULT: state is NULL; -EBUSY: another thread activates or deactivates the application; -EINVAL: the
  *         handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_master_state(const ec_master_t *master, ec_master_state_t *state);
/** Upper bound of the differences between the clocks and the reference clock, in nanoseconds, as the last
  * ecrt_master_sync_monitor_queue() has read them.
  * Phases: active.
  * @return the bound; (uint32_t) -1: it is not known. */
EC_PUBLIC_API uint32_t ecrt_master_sync_monitor_process(const ec_master_t *master);
/** The next frame reads the differences of all clocks.
  * Phases: active.
  * @return 0; -ENXIO: there is no reference clock, or nothing is active; -EPERM: the master was opened only;
  *         -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken the bus back; -EINVAL: the handle has
  *         ended or is NULL. */
EC_PUBLIC_API int ecrt_master_sync_monitor_queue(ec_master_t *master);
/** The next frame sets the reference clock to the time of the application.
  * Phases: active.
  * @return 0; -ENXIO: there is no reference clock, or nothing is active; -EPERM: the master was opened only;
  *         -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken the bus back; -EINVAL: the handle has
  *         ended or is NULL. */
EC_PUBLIC_API int ecrt_master_sync_reference_clock(ec_master_t *master);
/** The next frame sets the reference clock to a time in nanoseconds since 2000.
  * Phases: active.
  * @return 0; -ENXIO: there is no reference clock, or nothing is active; -EPERM: the master was opened only;
  *         -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken the bus back; -EINVAL: the handle has
  *         ended or is NULL. */
EC_PUBLIC_API int ecrt_master_sync_reference_clock_to(ec_master_t *master, uint64_t sync_time);
/** The next frame distributes the time of the reference clock to all other clocks.
  * Phases: active.
  * @return 0; -ENXIO: there is no reference clock, or nothing is active; -EPERM: the master was opened only;
  *         -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken the bus back; -EINVAL: the handle has
  *         ended or is NULL. */
EC_PUBLIC_API int ecrt_master_sync_slave_clocks(ec_master_t *master);
/** Writes an IDN by SoE, and waits for the answer. It also works while nothing cycles.
  * Phases: any, also a master that was opened only.
  * @return 0; -EINVAL: there is no such SubDevice or drive (0 to 7), no data, or the handle has ended or is NULL;
  *         -EPROTONOSUPPORT: it has no SoE; -EIO: the SubDevice refuses, with its reason in error_code; -ETIMEDOUT:
  *         it does not answer; -EFAULT: data is NULL; -EPERM: this user may only read. */
EC_PUBLIC_API int ecrt_master_write_idn(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t drive_no,
        uint16_t idn,
        const uint8_t *data,
        size_t data_size,
        uint16_t *error_code);
/** Opens a master for information and mailboxes, beside the program that has reserved it.
  * Phases: none is needed.
  * @return the master, for ecrt_release_master(); NULL: there is no such master (a line has the reason). */
EC_PUBLIC_API ec_master_t *ecrt_open_master(unsigned int master_index);
/** Ends the application of this handle, and the handle with all that came from it. The bus goes back to the daemon.
  * A second call does nothing.
  * Phases: any, also after an internal error. */
EC_PUBLIC_API void ecrt_release_master(ec_master_t *master);
/** Opens a master and reserves it. Returns once the bus is scanned; SubDevices may still be on their way to PREOP,
  * and what needs a mailbox waits for that.
  * Phases: none is needed.
  * @return the master, for ecrt_release_master(); NULL: there is no such master, or it is reserved (a line has
  *         the reason). */
EC_PUBLIC_API ec_master_t *ecrt_request_master(unsigned int master_index);
/** Version of the interface of the library.
  * Phases: any.
  * @return ECRT_VERSION_MAGIC of the library. */
EC_PUBLIC_API unsigned int ecrt_version_magic(void);

/* Configuration of SubDevices. */

/** Writes all subindices of an object in PREOP whenever the SubDevice is configured (complete access). Downloads
  * run in the order of the calls.
  * Phases: reserved, before the activation.
  * @return 0; -EFAULT: data is NULL; -EBUSY: the application is active, or the settings are those of a network
  *         file; -EINVAL: there are no data, the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_complete_sdo(
        ec_slave_config_t *sc,
        uint16_t index,
        const uint8_t *data,
        size_t size);
/** Makes a request for registers, with memory for size bytes.
  * Phases: reserved, before the activation.
  * @return the request, which ends with the deactivation; NULL: the application is active, size is above 16 MiB, or
  *         the handle has ended or is NULL. */
EC_PUBLIC_API ec_reg_request_t *ecrt_slave_config_create_reg_request(ec_slave_config_t *sc, size_t size);
/** Makes a request for objects, with memory for size bytes.
  * Phases: reserved, before the activation.
  * @return the request, which ends with the deactivation; NULL: the application is active, size is above 16 MiB, or
  *         the handle has ended or is NULL. */
EC_PUBLIC_API ec_sdo_request_t *ecrt_slave_config_create_sdo_request(
        ec_slave_config_t *sc,
        uint16_t index,
        uint8_t subindex,
        size_t size);
/** Makes a request for IDNs, with memory for size bytes.
  * Phases: reserved, before the activation.
  * @return the request, which ends with the deactivation; NULL: the application is active, there is no such drive
  *         (0 to 7), size is above 16 MiB, or the handle has ended or is NULL. */
EC_PUBLIC_API ec_soe_request_t *ecrt_slave_config_create_soe_request(
        ec_slave_config_t *sc,
        uint8_t drive_no,
        uint16_t idn,
        size_t size);
/** Makes a handler for messages of vendors, with memory for size bytes behind their header.
  * Phases: reserved, before the activation.
  * @return the handler, which ends with the deactivation; NULL: the application is active, size is above 16 MiB, or
  *         the handle has ended or is NULL. */
EC_PUBLIC_API ec_voe_handler_t *ecrt_slave_config_create_voe_handler(ec_slave_config_t *sc, size_t size);
/** SYNC signals of a distributed clock: the word for the register at 0x0980, cycles and shift in nanoseconds;
  * assign_activate 0: none. sync1_shift has no effect.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_dc(
        ec_slave_config_t *sc,
        uint16_t assign_activate,
        uint32_t sync0_cycle,
        int32_t sync0_shift,
        uint32_t sync1_cycle,
        int32_t sync1_shift);
/** Drops all emergencies, and sets the number of lost ones to 0.
  * Phases: reserved, active, after the deactivation.
  * @return 0; -ENOENT: ecrt_slave_config_emerg_size() was not called; -EBUSY: another thread uses them; -EINVAL:
  *         the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_emerg_clear(ec_slave_config_t *sc);
/** Number of emergencies that were lost because there was no room.
  * Phases: reserved, active, after the deactivation.
  * @return the number; -ENOENT: ecrt_slave_config_emerg_size() was not called; -EBUSY: another thread uses them;
  *         -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_emerg_overruns(const ec_slave_config_t *sc);
/** Takes the oldest emergency: EC_COE_EMERGENCY_MSG_SIZE bytes.
  * Phases: reserved, active, after the deactivation.
  * @return 0; -ENOENT: there is none; -EFAULT: target is NULL; -EBUSY: another thread uses them; -EINVAL: the
  *         handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_emerg_pop(ec_slave_config_t *sc, uint8_t *target);
/** Number of emergencies that are kept, 65536 at most; 0: all are dropped.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active; -ENODEV: the acyclic half has ended; -EINVAL: the handle has ended
  *         or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_emerg_size(ec_slave_config_t *sc, size_t elements);
/** Default gateway of the SubDevice for Ethernet over EtherCAT, written in PREOP.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_eoe_default_gateway(
        ec_slave_config_t *sc,
        struct in_addr gateway_address);
/** Address of the name server of the SubDevice for Ethernet over EtherCAT, written in PREOP.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_eoe_dns_address(ec_slave_config_t *sc, struct in_addr dns_address);
/** Name of the SubDevice for Ethernet over EtherCAT, 32 characters at most, written in PREOP.
  * Phases: reserved, before the activation.
  * @return 0; -EFAULT: name is NULL; -EBUSY: the application is active, or the settings are those of a network
  *         file; -EINVAL: the name is longer, the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_eoe_hostname(ec_slave_config_t *sc, const char *name);
/** IP address of the SubDevice for Ethernet over EtherCAT, written in PREOP.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_eoe_ip_address(ec_slave_config_t *sc, struct in_addr ip_address);
/** MAC address of the SubDevice for Ethernet over EtherCAT: six bytes, written in PREOP.
  * Phases: reserved, before the activation.
  * @return 0; -EFAULT: mac_address is NULL; -EBUSY: the application is active, or the settings are those of a
  *         network file; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_eoe_mac_address(ec_slave_config_t *sc, const unsigned char *mac_address);
/** Subnet mask of the SubDevice for Ethernet over EtherCAT, written in PREOP.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_eoe_subnet_mask(ec_slave_config_t *sc, struct in_addr subnet_mask);
/** Sets AssignToPdi (the EEPROM belongs to the SubDevice from PREOP on) or WaitBeforeSAFEOPms. Another key has no
  * effect, and a line names it.
  * Phases: reserved, before the activation.
  * @return 0; -EFAULT: key is NULL; -EBUSY: the application is active, or the settings are those of a network file;
  *         -EINVAL: the value is negative, the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_flag(ec_slave_config_t *sc, const char *key, int32_t value);
/** Writes an IDN in PREOP or SAFEOP whenever the SubDevice is configured.
  * Phases: reserved, before the activation.
  * @return 0; -EFAULT: data is NULL; -EBUSY: the application is active, or the settings are those of a network
  *         file; -EINVAL: there is no such drive (0 to 7), the state is another one, there are no data, the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_idn(
        ec_slave_config_t *sc,
        uint8_t drive_no,
        uint16_t idn,
        ec_al_state_t state,
        const uint8_t *data,
        size_t size);
/** Assigns a PDO to a SyncManager, behind those that are assigned.
  * Phases: reserved, before the activation.
  * @return 0; -ENOENT: there is no such SyncManager; -EEXIST: it is assigned already; -EBUSY: the application is
  *         active, or the settings are those of a network file; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_pdo_assign_add(ec_slave_config_t *sc, uint8_t sync_index, uint16_t index);
/** Removes all PDOs of a SyncManager.
  * Phases: reserved, before the activation.
  * @return 0; -ENOENT: there is no such SyncManager; -EBUSY: the application is active, or the settings are those
  *         of a network file; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_pdo_assign_clear(ec_slave_config_t *sc, uint8_t sync_index);
/** Maps an object to a PDO, behind those that are mapped. Index 0 is a gap.
  * Phases: reserved, before the activation.
  * @return 0; -ENOENT: the PDO is not assigned; -EBUSY: the application is active, or the settings are those of a
  *         network file; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_pdo_mapping_add(
        ec_slave_config_t *sc,
        uint16_t pdo_index,
        uint16_t entry_index,
        uint8_t entry_subindex,
        uint8_t entry_bit_length);
/** Removes all entries of a PDO.
  * Phases: reserved, before the activation.
  * @return 0; -ENOENT: the PDO is not assigned; -EBUSY: the application is active, or the settings are those of a
  *         network file; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_pdo_mapping_clear(ec_slave_config_t *sc, uint16_t pdo_index);
/** Configures SyncManagers with their PDOs; the list ends after n_syncs entries, or with index 0xff. A SyncManager
  * without PDOs and a PDO without entries keep what they have.
  * Phases: reserved, before the activation.
  * @return 0; -ENOENT: there is no such SyncManager; -EEXIST: a PDO is there twice; -EFAULT: a list is NULL and not
  *         empty; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: a
  *         direction is wrong, the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_pdos(
        ec_slave_config_t *sc,
        unsigned int n_syncs,
        const ec_sync_info_t syncs[]);
/** Places an object in a domain. Its bit goes to bit_position.
  * Phases: reserved, before the activation.
  * @return the byte; -ENOENT: it is not mapped, or the SubDevice is absent; -EFAULT: bit_position is NULL and the
  *         place is not the start of a byte; -EOVERFLOW: there are too few FMMUs; -EBUSY: the application is
  *         active; -EINVAL: the domain is of another master, or a handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_reg_pdo_entry(
        ec_slave_config_t *sc,
        uint16_t entry_index,
        uint8_t entry_subindex,
        ec_domain_t *domain,
        unsigned int *bit_position);
/** Places an entry in a domain, by SyncManager and places in assignment and mapping. Its bit goes to bit_position.
  * Phases: reserved, before the activation.
  * @return the byte; -ENOENT: there is no such entry, or the SubDevice is absent; -EFAULT: bit_position is NULL and
  *         the place is not the start of a byte; -EOVERFLOW: there are too few FMMUs; -EBUSY: the application is
  *         active; -EINVAL: the domain is of another master, or a handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_reg_pdo_entry_pos(
        ec_slave_config_t *sc,
        uint8_t sync_index,
        unsigned int pdo_pos,
        unsigned int entry_pos,
        ec_domain_t *domain,
        unsigned int *bit_position);
/** Writes an object in PREOP whenever the SubDevice is configured. Downloads run in the order of the calls.
  * Phases: reserved, before the activation.
  * @return 0; -EFAULT: data is NULL; -EBUSY: the application is active, or the settings are those of a network
  *         file; -EINVAL: there are no data, the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_sdo(
        ec_slave_config_t *sc,
        uint16_t index,
        uint8_t subindex,
        const uint8_t *data,
        size_t size);
/** As ecrt_slave_config_sdo(), with a value of 16 bits.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_sdo16(
        ec_slave_config_t *sc,
        uint16_t sdo_index,
        uint8_t sdo_subindex,
        uint16_t value);
/** As ecrt_slave_config_sdo(), with a value of 32 bits.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_sdo32(
        ec_slave_config_t *sc,
        uint16_t sdo_index,
        uint8_t sdo_subindex,
        uint32_t value);
/** As ecrt_slave_config_sdo(), with a value of 8 bits.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_sdo8(
        ec_slave_config_t *sc,
        uint16_t sdo_index,
        uint8_t sdo_subindex,
        uint8_t value);
/** Whether the SubDevice answers, whether it is in OP with its configuration, and its AL state.
  * Phases: reserved, active, after the deactivation.
  * @return 0; -EFAULT: state is NULL; -EBUSY: another thread activates or deactivates the application; -EINVAL: the
  *         handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_state(const ec_slave_config_t *sc, ec_slave_config_state_t *state);
/** Limit of a state change in milliseconds; 0: the default.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: a state is
  *         not one of ec_al_state_t, the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_state_timeout(
        ec_slave_config_t *sc,
        ec_al_state_t from_state,
        ec_al_state_t to_state,
        unsigned int timeout_ms);
/** Direction and watchdog of a SyncManager.
  * Phases: reserved, before the activation.
  * @return 0; -ENOENT: there is no such SyncManager; -EBUSY: the application is active, or the settings are those
  *         of a network file; -EINVAL: direction or mode are wrong, the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_sync_manager(
        ec_slave_config_t *sc,
        uint8_t sync_index,
        ec_direction_t direction,
        ec_watchdog_mode_t watchdog_mode);
/** Watchdog of the SubDevice: divider (register 0x0400) and intervals (0x0420); 0: as the SubDevice has them.
  * Phases: reserved, before the activation.
  * @return 0; -EBUSY: the application is active, or the settings are those of a network file; -EINVAL: the handle
  *         has ended or is NULL. */
EC_PUBLIC_API int ecrt_slave_config_watchdog(
        ec_slave_config_t *sc,
        uint16_t watchdog_divider,
        uint16_t watchdog_intervals);

/* Domains. */

/** Process data of the domain. The memory stays in place until the deactivation; outputs in it are not overwritten
  * at receive.
  * Phases: active.
  * @return the memory, of ecrt_domain_size() bytes; NULL: nothing is active, the domain is empty, or the handle has
  *         ended or is NULL. */
EC_PUBLIC_API uint8_t *ecrt_domain_data(const ec_domain_t *domain);
/** Evaluates the datagrams that have arrived: inputs, working counter, state. After ecrt_master_receive().
  * Phases: active; before, nothing is exchanged and it returns 0.
  * @return 0; -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken the bus back; -EINVAL: the handle has
  *         ended or is NULL. */
EC_PUBLIC_API int ecrt_domain_process(ec_domain_t *domain);
/** Queues the datagrams of the domain for the next ecrt_master_send().
  * Phases: active; before, nothing is exchanged and it returns 0.
  * @return 0; -EBUSY: another cyclic call runs; -ENODEV: the daemon has taken the bus back; -EINVAL: the handle has
  *         ended or is NULL. */
EC_PUBLIC_API int ecrt_domain_queue(ec_domain_t *domain);
/** Places the objects of a list, which ends with index 0, in a domain; SubDevices that are not declared yet are
  * declared. Bytes and bits go to the pointers of the list.
  * Phases: reserved, before the activation.
  * @return 0; -ENOENT: an object is not mapped, or another product is declared there; -EFAULT: offset is NULL, or
  *         bit_position is and the place is not the start of a byte; -EOVERFLOW: there are too few FMMUs; -EBUSY:
  *         the application is active; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_domain_reg_pdo_entry_list(
        ec_domain_t *domain,
        const ec_pdo_entry_reg_t *pdo_entry_regs);
/** Bytes of the process data, as registered so far.
  * Phases: reserved, active.
  * @return the number; 0: nothing is registered, or the handle has ended or is NULL. */
EC_PUBLIC_API size_t ecrt_domain_size(const ec_domain_t *domain);
/** Working counter and state of the last ecrt_domain_process(), and whether the ring of two links is open.
  * Phases: reserved, active.
  * @return 0; -EFAULT: state is NULL; -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_domain_state(const ec_domain_t *domain, ec_domain_state_t *state);

/* SDO requests. */

/** Memory of the request: what is written, and what was read once the state is EC_REQUEST_SUCCESS. It stays in
  * place.
  * Phases: reserved, active.
  * @return the memory; NULL: the handle has ended or is NULL. */
EC_PUBLIC_API uint8_t *ecrt_sdo_request_data(const ec_sdo_request_t *req);
/** Bytes of the last read or write; at first those of the memory.
  * Phases: reserved, active.
  * @return the number; 0: the handle has ended or is NULL. */
EC_PUBLIC_API size_t ecrt_sdo_request_data_size(const ec_sdo_request_t *req);
/** Chooses the object of the next read or write.
  * Phases: reserved, active.
  * @return 0; -EBUSY: the request is in progress, or another thread uses it; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_sdo_request_index(ec_sdo_request_t *req, uint16_t index, uint8_t subindex);
/** Starts to read an object.
  * Phases: active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the request; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_sdo_request_read(ec_sdo_request_t *req);
/** State of the request. It stays until the next read or write; a SubDevice that is missing ends it with an error.
  * Phases: reserved, active.
  * @return the state; EC_REQUEST_ERROR: also of a handle that has ended or is NULL. */
EC_PUBLIC_API ec_request_state_t ecrt_sdo_request_state(ec_sdo_request_t *req);
/** Limit of the request in milliseconds; 0: an hour.
  * Phases: reserved, active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the request; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_sdo_request_timeout(ec_sdo_request_t *req, uint32_t timeout);
/** Starts to write ecrt_sdo_request_data_size() bytes of the memory.
  * Phases: active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the request; -EINVAL: there are no data, or the
  *         handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_sdo_request_write(ec_sdo_request_t *req);

/* SoE requests. */

/** Memory of the request: what is written, and what was read once the state is EC_REQUEST_SUCCESS. It stays in
  * place.
  * Phases: reserved, active.
  * @return the memory; NULL: the handle has ended or is NULL. */
EC_PUBLIC_API uint8_t *ecrt_soe_request_data(const ec_soe_request_t *req);
/** Bytes of the last read or write; at first those of the memory.
  * Phases: reserved, active.
  * @return the number; 0: the handle has ended or is NULL. */
EC_PUBLIC_API size_t ecrt_soe_request_data_size(const ec_soe_request_t *req);
/** Chooses drive and IDN of the next read or write.
  * Phases: reserved, active.
  * @return 0; -EBUSY: the request is in progress, or another thread uses it; -EINVAL: there is no such drive (0 to
  *         7), or the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_soe_request_idn(ec_soe_request_t *req, uint8_t drive_no, uint16_t idn);
/** Starts to read an IDN.
  * Phases: active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the request; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_soe_request_read(ec_soe_request_t *req);
/** State of the request. It stays until the next read or write; a SubDevice that is missing ends it with an error.
  * Phases: reserved, active.
  * @return the state; EC_REQUEST_ERROR: also of a handle that has ended or is NULL. */
EC_PUBLIC_API ec_request_state_t ecrt_soe_request_state(ec_soe_request_t *req);
/** Limit of the request in milliseconds; 0: an hour.
  * Phases: reserved, active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the request; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_soe_request_timeout(ec_soe_request_t *req, uint32_t timeout);
/** Starts to write ecrt_soe_request_data_size() bytes of the memory.
  * Phases: active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the request; -EINVAL: there are no data, or the
  *         handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_soe_request_write(ec_soe_request_t *req);

/* VoE handlers. */

/** Memory of the handler, without the header: what is sent, and what was received. It stays in place.
  * Phases: reserved, active.
  * @return the memory; NULL: the handle has ended or is NULL. */
EC_PUBLIC_API uint8_t *ecrt_voe_handler_data(const ec_voe_handler_t *voe);
/** Bytes of the last message; at first those of the memory.
  * Phases: reserved, active.
  * @return the number; 0: the handle has ended or is NULL. */
EC_PUBLIC_API size_t ecrt_voe_handler_data_size(const ec_voe_handler_t *voe);
/** State of the handler: call it once in a cycle. An answer is waited for 500 ms.
  * Phases: reserved, active.
  * @return the state; EC_REQUEST_ERROR: also of a handle that has ended or is NULL. */
EC_PUBLIC_API ec_request_state_t ecrt_voe_handler_execute(ec_voe_handler_t *voe);
/** Starts to read a message, once the SubDevice shows that it has one.
  * Phases: active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the handler; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_voe_handler_read(ec_voe_handler_t *voe);
/** Starts to read a message at once.
  * Phases: active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the handler; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_voe_handler_read_nosync(ec_voe_handler_t *voe);
/** Vendor and type of the message that was received.
  * Phases: reserved, active.
  * @return 0; -ENOENT: nothing was received; -EFAULT: a pointer is NULL; -EBUSY: another thread uses the handler;
  *         -EINVAL: the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_voe_handler_received_header(
        const ec_voe_handler_t *voe,
        uint32_t *vendor_id,
        uint16_t *vendor_type);
/** Vendor and type of the messages that are sent.
  * Phases: reserved, active.
  * @return 0; -EBUSY: it is in progress, or another thread uses the handler; -EINVAL: the handle has ended or is
  *         NULL. */
EC_PUBLIC_API int ecrt_voe_handler_send_header(
        ec_voe_handler_t *voe,
        uint32_t vendor_id,
        uint16_t vendor_type);
/** Starts to send size bytes of the memory.
  * Phases: active.
  * @return 0; -ENOBUFS: size is larger than the memory; -EBUSY: it is in progress, or another thread uses the
  *         handler; -EINVAL: size is 0, or the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_voe_handler_write(ec_voe_handler_t *voe, size_t size);

/* Register requests. */

/** Memory of the request: what is written, and what was read once the state is EC_REQUEST_SUCCESS. It stays in
  * place.
  * Phases: reserved, active.
  * @return the memory; NULL: the handle has ended or is NULL. */
EC_PUBLIC_API uint8_t *ecrt_reg_request_data(const ec_reg_request_t *req);
/** Starts to read size bytes of registers.
  * Phases: active.
  * @return 0; -ENOBUFS: size is larger than the memory; -EBUSY: it is in progress, or another thread uses the
  *         request; -EINVAL: size is 0, or the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_reg_request_read(ec_reg_request_t *req, uint16_t address, size_t size);
/** State of the request. It stays until the next read or write.
  * Phases: reserved, active.
  * @return the state; EC_REQUEST_ERROR: also of a handle that has ended or is NULL. */
EC_PUBLIC_API ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t *req);
/** Starts to write size bytes of the memory to registers.
  * Phases: active.
  * @return 0; -ENOBUFS: size is larger than the memory; -EBUSY: it is in progress, or another thread uses the
  *         request; -EINVAL: size is 0, or the handle has ended or is NULL. */
EC_PUBLIC_API int ecrt_reg_request_write(ec_reg_request_t *req, uint16_t address, size_t size);

/* Floating point numbers. */

/** Reads a little-endian number of 64 bits at any address.
  * Phases: any.
  * @return the number; 0: data is NULL. */
EC_PUBLIC_API double ecrt_read_lreal(const void *data);
/** Reads a little-endian number of 32 bits at any address.
  * Phases: any.
  * @return the number; 0: data is NULL. */
EC_PUBLIC_API float ecrt_read_real(const void *data);
/** Writes a little-endian number of 64 bits at any address; nothing at NULL.
  * Phases: any. */
EC_PUBLIC_API void ecrt_write_lreal(void *data, double value);
/** Writes a little-endian number of 32 bits at any address; nothing at NULL.
  * Phases: any. */
EC_PUBLIC_API void ecrt_write_real(void *data, float value);

#ifdef __KERNEL__

EC_PUBLIC_API void ecrt_domain_external_memory(ec_domain_t *domain, uint8_t *memory);
EC_PUBLIC_API void ecrt_master_callbacks(
        ec_master_t *master,
        void (*send_cb)(void *),
        void (*receive_cb)(void *),
        void *cb_data);
EC_PUBLIC_API int ecrt_master_send_ext(ec_master_t *master);

#endif

#ifdef __cplusplus
}
#endif

/* Process data is little-endian. */

#ifndef __KERNEL__
#ifdef __BYTE_ORDER__
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
#define EC_BIG_ENDIAN_HOST 1
#endif
#endif

#ifdef EC_BIG_ENDIAN_HOST
#define swap16(x) ((uint16_t) (((uint16_t) (x) << 8) | ((uint16_t) (x) >> 8)))
#define swap32(x) (((uint32_t) swap16((uint16_t) (x)) << 16) | swap16((uint16_t) ((uint32_t) (x) >> 16)))
#define swap64(x) (((uint64_t) swap32((uint32_t) (x)) << 32) | swap32((uint32_t) ((uint64_t) (x) >> 32)))
#define le16_to_cpu(x) swap16(x)
#define le32_to_cpu(x) swap32(x)
#define le64_to_cpu(x) swap64(x)
#define cpu_to_le16(x) swap16(x)
#define cpu_to_le32(x) swap32(x)
#define cpu_to_le64(x) swap64(x)
#else
#define le16_to_cpu(x) x
#define le32_to_cpu(x) x
#define le64_to_cpu(x) x
#define cpu_to_le16(x) x
#define cpu_to_le32(x) x
#define cpu_to_le64(x) x
#endif

#define le16_to_cpup(x) le16_to_cpu(*((uint16_t *) (x)))
#define le32_to_cpup(x) le32_to_cpu(*((uint32_t *) (x)))
#define le64_to_cpup(x) le64_to_cpu(*((uint64_t *) (x)))
#endif

#define EC_READ_BIT(DATA,POS) ((*((uint8_t *) (DATA)) >> (POS)) & 0x01)
#ifndef __KERNEL__
#define EC_READ_LREAL(DATA) ecrt_read_lreal(DATA)
#endif
#ifndef __KERNEL__
#define EC_READ_REAL(DATA) ecrt_read_real(DATA)
#endif
#define EC_READ_S16(DATA) ((int16_t) le16_to_cpup((void *) (DATA)))
#define EC_READ_S32(DATA) ((int32_t) le32_to_cpup((void *) (DATA)))
#define EC_READ_S64(DATA) ((int64_t) le64_to_cpup((void *) (DATA)))
#define EC_READ_S8(DATA) ((int8_t) *((uint8_t *) (DATA)))
#define EC_READ_U16(DATA) ((uint16_t) le16_to_cpup((void *) (DATA)))
#define EC_READ_U32(DATA) ((uint32_t) le32_to_cpup((void *) (DATA)))
#define EC_READ_U64(DATA) ((uint64_t) le64_to_cpup((void *) (DATA)))
#define EC_READ_U8(DATA) ((uint8_t) *((uint8_t *) (DATA)))
#define EC_WRITE_BIT(DATA,POS,VAL) \
    do { if (VAL) *((uint8_t *) (DATA)) |= (1 << (POS)); else *((uint8_t *) (DATA)) &= ~(1 << (POS)); } while (0)
#ifndef __KERNEL__
#define EC_WRITE_LREAL(DATA,VAL) ecrt_write_lreal(DATA, VAL)
#endif
#ifndef __KERNEL__
#define EC_WRITE_REAL(DATA,VAL) ecrt_write_real(DATA, VAL)
#endif
#define EC_WRITE_S16(DATA,VAL) EC_WRITE_U16(DATA, VAL)
#define EC_WRITE_S32(DATA,VAL) EC_WRITE_U32(DATA, VAL)
#define EC_WRITE_S64(DATA,VAL) EC_WRITE_U64(DATA, VAL)
#define EC_WRITE_S8(DATA,VAL) EC_WRITE_U8(DATA, VAL)
#define EC_WRITE_U16(DATA,VAL) \
    do { *((uint16_t *) (DATA)) = cpu_to_le16((uint16_t) (VAL)); } while (0)
#define EC_WRITE_U32(DATA,VAL) \
    do { *((uint32_t *) (DATA)) = cpu_to_le32((uint32_t) (VAL)); } while (0)
#define EC_WRITE_U64(DATA,VAL) \
    do { *((uint64_t *) (DATA)) = cpu_to_le64((uint64_t) (VAL)); } while (0)
#define EC_WRITE_U8(DATA,VAL) \
    do { *((uint8_t *)(DATA)) = ((uint8_t) (VAL)); } while (0)

#endif
