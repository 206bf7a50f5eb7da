/*
 * ecrt.h: the realtime interface of EtherCAT masters on Linux, version 1.6, as RingCAT provides it.
 *
 * A program requests a master, declares the SubDevices that it uses and places their process data in domains,
 * activates, and then cycles: receive, process, its own work, queue, send. docs/ecrt.md of RingCAT has each function
 * with its return codes. Functions return 0 or a value, and a negative error number if they fail, unless
 * stated otherwise.
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

/** Number of SubDevices, link, scan, application time. */
EC_PUBLIC_API int ecrt_master(ec_master_t *master, ec_master_info_t *master_info);
/** Starts the application with what was declared. SubDevices go to OP while the program cycles. */
EC_PUBLIC_API int ecrt_master_activate(ec_master_t *master);
/** Sets the time of the application in nanoseconds since 2000. The first one aligns SYNC pulses. */
EC_PUBLIC_API int ecrt_master_application_time(ec_master_t *master, uint64_t app_time);
EC_PUBLIC_API ec_domain_t *ecrt_master_create_domain(ec_master_t *master);
/** Ends the application: SubDevices go to PREOP, handles and process data of it are gone.
  * -EINVAL: nothing is active. */
EC_PUBLIC_API int ecrt_master_deactivate(ec_master_t *master);
EC_PUBLIC_API int ecrt_master_get_pdo(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t sync_index,
        uint16_t pos,
        ec_pdo_info_t *pdo);
EC_PUBLIC_API int ecrt_master_get_pdo_entry(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t sync_index,
        uint16_t pdo_pos,
        uint16_t entry_pos,
        ec_pdo_entry_info_t *entry);
/** Identity, ports, state and name of the SubDevice at a position. */
EC_PUBLIC_API int ecrt_master_get_slave(
        ec_master_t *master,
        uint16_t slave_position,
        ec_slave_info_t *slave_info);
EC_PUBLIC_API int ecrt_master_get_sync_manager(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t sync_index,
        ec_sync_info_t *sync);
/** The same for one link: 0 main, 1 redundant. */
EC_PUBLIC_API int ecrt_master_link_state(
        const ec_master_t *master,
        unsigned int dev_idx,
        ec_master_link_state_t *state);
EC_PUBLIC_API int ecrt_master_read_idn(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t drive_no,
        uint16_t idn,
        uint8_t *target,
        size_t target_size,
        size_t *result_size,
        uint16_t *error_code);
/** Takes the frames that have arrived. First call of a cycle. */
EC_PUBLIC_API int ecrt_master_receive(ec_master_t *master);
/** Lower 32 bits of the time of the reference clock. -ENXIO: there is none; -EIO: its datagram was lost. */
EC_PUBLIC_API int ecrt_master_reference_clock_time(const ec_master_t *master, uint32_t *time);
/** Reserves a master that was opened. */
EC_PUBLIC_API int ecrt_master_reserve(ec_master_t *master);
/** Tries failed configurations again. */
EC_PUBLIC_API int ecrt_master_reset(ec_master_t *master);
/** Progress of the scan: SubDevices, and how many of them are scanned. */
EC_PUBLIC_API int ecrt_master_scan_progress(ec_master_t *master, ec_master_scan_progress_t *progress);
EC_PUBLIC_API int ecrt_master_sdo_download(
        ec_master_t *master,
        uint16_t slave_position,
        uint16_t index,
        uint8_t subindex,
        const uint8_t *data,
        size_t data_size,
        uint32_t *abort_code);
EC_PUBLIC_API int ecrt_master_sdo_download_complete(
        ec_master_t *master,
        uint16_t slave_position,
        uint16_t index,
        const uint8_t *data,
        size_t data_size,
        uint32_t *abort_code);
EC_PUBLIC_API int ecrt_master_sdo_upload(
        ec_master_t *master,
        uint16_t slave_position,
        uint16_t index,
        uint8_t subindex,
        uint8_t *target,
        size_t target_size,
        size_t *result_size,
        uint32_t *abort_code);
EC_PUBLIC_API int ecrt_master_select_reference_clock(ec_master_t *master, ec_slave_config_t *sc);
/** Sends what was queued. Last call of a cycle. */
EC_PUBLIC_API int ecrt_master_send(ec_master_t *master);
EC_PUBLIC_API int ecrt_master_set_send_interval(ec_master_t *master, size_t send_interval);
EC_PUBLIC_API ec_slave_config_t *ecrt_master_slave_config(
        ec_master_t *master,
        uint16_t alias,
        uint16_t position,
        uint32_t vendor_id,
        uint32_t product_code);
/** SubDevices that answer, their AL states ORed, link. */
EC_PUBLIC_API int ecrt_master_state(const ec_master_t *master, ec_master_state_t *state);
/** Upper bound of the differences in nanoseconds; (uint32_t) -1 if it is not known. */
EC_PUBLIC_API uint32_t ecrt_master_sync_monitor_process(const ec_master_t *master);
/** The next frame reads the differences of all clocks. */
EC_PUBLIC_API int ecrt_master_sync_monitor_queue(ec_master_t *master);
/** The next frame sets the reference clock to the time of the application. -ENXIO: there is none. */
EC_PUBLIC_API int ecrt_master_sync_reference_clock(ec_master_t *master);
/** The next frame sets the reference clock to a time. -ENXIO: there is none. */
EC_PUBLIC_API int ecrt_master_sync_reference_clock_to(ec_master_t *master, uint64_t sync_time);
/** The next frame distributes the time of the reference clock. -ENXIO: there is none. */
EC_PUBLIC_API int ecrt_master_sync_slave_clocks(ec_master_t *master);
EC_PUBLIC_API int ecrt_master_write_idn(
        ec_master_t *master,
        uint16_t slave_position,
        uint8_t drive_no,
        uint16_t idn,
        const uint8_t *data,
        size_t data_size,
        uint16_t *error_code);
/** Opens a master for information and mailboxes, beside the program that has reserved it. */
EC_PUBLIC_API ec_master_t *ecrt_open_master(unsigned int master_index);
/** Ends the application of this handle, and the handle with all that came from it. */
EC_PUBLIC_API void ecrt_release_master(ec_master_t *master);
/** Opens a master and reserves it. Returns once the bus is scanned; SubDevices may still be on their way to PREOP, and
  * what needs a mailbox waits for that. NULL: no such master, or it is reserved. */
EC_PUBLIC_API ec_master_t *ecrt_request_master(unsigned int master_index);
/** Version of the interface of the library, as ECRT_VERSION_MAGIC. */
EC_PUBLIC_API unsigned int ecrt_version_magic(void);

/* Configuration of SubDevices. */

EC_PUBLIC_API int ecrt_slave_config_complete_sdo(
        ec_slave_config_t *sc,
        uint16_t index,
        const uint8_t *data,
        size_t size);
EC_PUBLIC_API ec_reg_request_t *ecrt_slave_config_create_reg_request(ec_slave_config_t *sc, size_t size);
EC_PUBLIC_API ec_sdo_request_t *ecrt_slave_config_create_sdo_request(
        ec_slave_config_t *sc,
        uint16_t index,
        uint8_t subindex,
        size_t size);
EC_PUBLIC_API ec_soe_request_t *ecrt_slave_config_create_soe_request(
        ec_slave_config_t *sc,
        uint8_t drive_no,
        uint16_t idn,
        size_t size);
EC_PUBLIC_API ec_voe_handler_t *ecrt_slave_config_create_voe_handler(ec_slave_config_t *sc, size_t size);
/** SYNC signals of a distributed clock; assign_activate 0: none. sync1_shift has no effect. */
EC_PUBLIC_API int ecrt_slave_config_dc(
        ec_slave_config_t *sc,
        uint16_t assign_activate,
        uint32_t sync0_cycle,
        int32_t sync0_shift,
        uint32_t sync1_cycle,
        int32_t sync1_shift);
EC_PUBLIC_API int ecrt_slave_config_emerg_clear(ec_slave_config_t *sc);
EC_PUBLIC_API int ecrt_slave_config_emerg_overruns(const ec_slave_config_t *sc);
/** Takes the oldest emergency: EC_COE_EMERGENCY_MSG_SIZE bytes. -ENOENT: there is none. */
EC_PUBLIC_API int ecrt_slave_config_emerg_pop(ec_slave_config_t *sc, uint8_t *target);
EC_PUBLIC_API int ecrt_slave_config_emerg_size(ec_slave_config_t *sc, size_t elements);
EC_PUBLIC_API int ecrt_slave_config_eoe_default_gateway(
        ec_slave_config_t *sc,
        struct in_addr gateway_address);
EC_PUBLIC_API int ecrt_slave_config_eoe_dns_address(ec_slave_config_t *sc, struct in_addr dns_address);
EC_PUBLIC_API int ecrt_slave_config_eoe_hostname(ec_slave_config_t *sc, const char *name);
EC_PUBLIC_API int ecrt_slave_config_eoe_ip_address(ec_slave_config_t *sc, struct in_addr ip_address);
EC_PUBLIC_API int ecrt_slave_config_eoe_mac_address(ec_slave_config_t *sc, const unsigned char *mac_address);
EC_PUBLIC_API int ecrt_slave_config_eoe_subnet_mask(ec_slave_config_t *sc, struct in_addr subnet_mask);
/** Sets AssignToPdi or WaitBeforeSAFEOPms. */
EC_PUBLIC_API int ecrt_slave_config_flag(ec_slave_config_t *sc, const char *key, int32_t value);
EC_PUBLIC_API int ecrt_slave_config_idn(
        ec_slave_config_t *sc,
        uint8_t drive_no,
        uint16_t idn,
        ec_al_state_t state,
        const uint8_t *data,
        size_t size);
EC_PUBLIC_API int ecrt_slave_config_pdo_assign_add(ec_slave_config_t *sc, uint8_t sync_index, uint16_t index);
EC_PUBLIC_API int ecrt_slave_config_pdo_assign_clear(ec_slave_config_t *sc, uint8_t sync_index);
EC_PUBLIC_API int ecrt_slave_config_pdo_mapping_add(
        ec_slave_config_t *sc,
        uint16_t pdo_index,
        uint16_t entry_index,
        uint8_t entry_subindex,
        uint8_t entry_bit_length);
EC_PUBLIC_API int ecrt_slave_config_pdo_mapping_clear(ec_slave_config_t *sc, uint16_t pdo_index);
/** Configures SyncManagers with their PDOs; the list ends after n_syncs entries, or with index 0xff. */
EC_PUBLIC_API int ecrt_slave_config_pdos(
        ec_slave_config_t *sc,
        unsigned int n_syncs,
        const ec_sync_info_t syncs[]);
/** Places an object in a domain. Returns its byte; the bit goes to bit_position.
  * -ENOENT: it is not mapped; -EFAULT: no bit_position and not at the start of a byte. */
EC_PUBLIC_API int ecrt_slave_config_reg_pdo_entry(
        ec_slave_config_t *sc,
        uint16_t entry_index,
        uint8_t entry_subindex,
        ec_domain_t *domain,
        unsigned int *bit_position);
EC_PUBLIC_API int ecrt_slave_config_reg_pdo_entry_pos(
        ec_slave_config_t *sc,
        uint8_t sync_index,
        unsigned int pdo_pos,
        unsigned int entry_pos,
        ec_domain_t *domain,
        unsigned int *bit_position);
EC_PUBLIC_API int ecrt_slave_config_sdo(
        ec_slave_config_t *sc,
        uint16_t index,
        uint8_t subindex,
        const uint8_t *data,
        size_t size);
EC_PUBLIC_API int ecrt_slave_config_sdo16(
        ec_slave_config_t *sc,
        uint16_t sdo_index,
        uint8_t sdo_subindex,
        uint16_t value);
EC_PUBLIC_API int ecrt_slave_config_sdo32(
        ec_slave_config_t *sc,
        uint16_t sdo_index,
        uint8_t sdo_subindex,
        uint32_t value);
EC_PUBLIC_API int ecrt_slave_config_sdo8(
        ec_slave_config_t *sc,
        uint16_t sdo_index,
        uint8_t sdo_subindex,
        uint8_t value);
EC_PUBLIC_API int ecrt_slave_config_state(const ec_slave_config_t *sc, ec_slave_config_state_t *state);
/** Limit of a state change in milliseconds; 0: the default. */
EC_PUBLIC_API int ecrt_slave_config_state_timeout(
        ec_slave_config_t *sc,
        ec_al_state_t from_state,
        ec_al_state_t to_state,
        unsigned int timeout_ms);
EC_PUBLIC_API int ecrt_slave_config_sync_manager(
        ec_slave_config_t *sc,
        uint8_t sync_index,
        ec_direction_t direction,
        ec_watchdog_mode_t watchdog_mode);
EC_PUBLIC_API int ecrt_slave_config_watchdog(
        ec_slave_config_t *sc,
        uint16_t watchdog_divider,
        uint16_t watchdog_intervals);

/* Domains. */

/** Process data of the domain, while the application is active; otherwise NULL. */
EC_PUBLIC_API uint8_t *ecrt_domain_data(const ec_domain_t *domain);
EC_PUBLIC_API int ecrt_domain_process(ec_domain_t *domain);
EC_PUBLIC_API int ecrt_domain_queue(ec_domain_t *domain);
/** Places the objects of a list, which ends with index 0, in a domain. */
EC_PUBLIC_API int ecrt_domain_reg_pdo_entry_list(
        ec_domain_t *domain,
        const ec_pdo_entry_reg_t *pdo_entry_regs);
/** Bytes of the process data, as registered so far. */
EC_PUBLIC_API size_t ecrt_domain_size(const ec_domain_t *domain);
EC_PUBLIC_API int ecrt_domain_state(const ec_domain_t *domain, ec_domain_state_t *state);

/* SDO requests. */

EC_PUBLIC_API uint8_t *ecrt_sdo_request_data(const ec_sdo_request_t *req);
EC_PUBLIC_API size_t ecrt_sdo_request_data_size(const ec_sdo_request_t *req);
EC_PUBLIC_API int ecrt_sdo_request_index(ec_sdo_request_t *req, uint16_t index, uint8_t subindex);
EC_PUBLIC_API int ecrt_sdo_request_read(ec_sdo_request_t *req);
EC_PUBLIC_API ec_request_state_t ecrt_sdo_request_state(ec_sdo_request_t *req);
EC_PUBLIC_API int ecrt_sdo_request_timeout(ec_sdo_request_t *req, uint32_t timeout);
EC_PUBLIC_API int ecrt_sdo_request_write(ec_sdo_request_t *req);

/* SoE requests. */

EC_PUBLIC_API uint8_t *ecrt_soe_request_data(const ec_soe_request_t *req);
EC_PUBLIC_API size_t ecrt_soe_request_data_size(const ec_soe_request_t *req);
EC_PUBLIC_API int ecrt_soe_request_idn(ec_soe_request_t *req, uint8_t drive_no, uint16_t idn);
EC_PUBLIC_API int ecrt_soe_request_read(ec_soe_request_t *req);
EC_PUBLIC_API ec_request_state_t ecrt_soe_request_state(ec_soe_request_t *req);
EC_PUBLIC_API int ecrt_soe_request_timeout(ec_soe_request_t *req, uint32_t timeout);
EC_PUBLIC_API int ecrt_soe_request_write(ec_soe_request_t *req);

/* VoE handlers. */

EC_PUBLIC_API uint8_t *ecrt_voe_handler_data(const ec_voe_handler_t *voe);
EC_PUBLIC_API size_t ecrt_voe_handler_data_size(const ec_voe_handler_t *voe);
EC_PUBLIC_API ec_request_state_t ecrt_voe_handler_execute(ec_voe_handler_t *voe);
EC_PUBLIC_API int ecrt_voe_handler_read(ec_voe_handler_t *voe);
EC_PUBLIC_API int ecrt_voe_handler_read_nosync(ec_voe_handler_t *voe);
EC_PUBLIC_API int ecrt_voe_handler_received_header(
        const ec_voe_handler_t *voe,
        uint32_t *vendor_id,
        uint16_t *vendor_type);
EC_PUBLIC_API int ecrt_voe_handler_send_header(
        ec_voe_handler_t *voe,
        uint32_t vendor_id,
        uint16_t vendor_type);
EC_PUBLIC_API int ecrt_voe_handler_write(ec_voe_handler_t *voe, size_t size);

/* Register requests. */

EC_PUBLIC_API uint8_t *ecrt_reg_request_data(const ec_reg_request_t *req);
EC_PUBLIC_API int ecrt_reg_request_read(ec_reg_request_t *req, uint16_t address, size_t size);
EC_PUBLIC_API ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t *req);
EC_PUBLIC_API int ecrt_reg_request_write(ec_reg_request_t *req, uint16_t address, size_t size);

/* Floating point numbers. */

EC_PUBLIC_API double ecrt_read_lreal(const void *data);
EC_PUBLIC_API float ecrt_read_real(const void *data);
EC_PUBLIC_API void ecrt_write_lreal(void *data, double value);
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
