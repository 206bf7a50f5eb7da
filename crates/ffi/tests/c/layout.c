/*
 * The layout of the structures of ecrt.h, checked by the compiler, for the processors that the tests are not run on:
 * with pointers of 64 bits as in the facts (tests/facts), with those of 32 bits (armhf) what the same declarations give
 * there. Only enumerations of four bytes fit.
 */
#include <stddef.h>

#include "ecrt.h"

/* With pointers of 64 and of 32 bits. */
#define HAS(got, wide, narrow) _Static_assert((got) == (sizeof(void *) == 8 ? (wide) : (narrow)), #got)

HAS(sizeof(ec_master_state_t), 8, 8);
HAS(sizeof(ec_master_link_state_t), 8, 8);
HAS(sizeof(ec_slave_config_state_t), 4, 4);
HAS(sizeof(ec_master_info_t), 16, 16);
HAS(offsetof(ec_master_info_t, scan_busy), 5, 5);
HAS(offsetof(ec_master_info_t, app_time), 8, 8);
HAS(sizeof(ec_master_scan_progress_t), 8, 8);
HAS(sizeof(ec_slave_port_link_t), 3, 3);
HAS(sizeof(ec_slave_info_t), 176, 176);
HAS(offsetof(ec_slave_info_t, vendor_id), 4, 4);
HAS(offsetof(ec_slave_info_t, alias), 20, 20);
HAS(offsetof(ec_slave_info_t, current_on_ebus), 22, 22);
HAS(offsetof(ec_slave_info_t, ports), 24, 24);
HAS(offsetof(ec_slave_info_t, al_state), 104, 104);
HAS(offsetof(ec_slave_info_t, error_flag), 105, 105);
HAS(offsetof(ec_slave_info_t, sync_count), 106, 106);
HAS(offsetof(ec_slave_info_t, sdo_count), 108, 108);
HAS(offsetof(ec_slave_info_t, name), 110, 110);
HAS(sizeof(ec_domain_state_t), 12, 12);
HAS(sizeof(ec_pdo_entry_info_t), 4, 4);
HAS(sizeof(ec_pdo_info_t), 16, 12);
HAS(offsetof(ec_pdo_info_t, n_entries), 4, 4);
HAS(offsetof(ec_pdo_info_t, entries), 8, 8);
HAS(sizeof(ec_sync_info_t), 32, 20);
HAS(offsetof(ec_sync_info_t, dir), 4, 4);
HAS(offsetof(ec_sync_info_t, n_pdos), 8, 8);
HAS(offsetof(ec_sync_info_t, pdos), 16, 12);
HAS(offsetof(ec_sync_info_t, watchdog_mode), 24, 16);
HAS(sizeof(ec_pdo_entry_reg_t), 32, 24);
HAS(offsetof(ec_pdo_entry_reg_t, vendor_id), 4, 4);
HAS(offsetof(ec_pdo_entry_reg_t, index), 12, 12);
HAS(offsetof(ec_pdo_entry_reg_t, subindex), 14, 14);
HAS(offsetof(ec_pdo_entry_reg_t, offset), 16, 16);
HAS(offsetof(ec_pdo_entry_reg_t, bit_position), 24, 20);
