//! The structures of `ecrt.h`, with the layout that programs were compiled with.

use std::ffi::{c_char, c_int, c_uint};

/// `ec_master_state_t` and `ec_master_link_state_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SegmentState {
    /// SubDevices that processed the last frame.
    pub slaves_responding: c_uint,
    /// Bits 0 to 3: AL states, ORed. Bit 4: the link is up.
    pub bits: c_uint,
}

impl SegmentState {
    /// Bit fields as C compilers place them.
    pub fn new(responding: u16, al_states: u8, is_up: bool) -> SegmentState {
        let bits = c_uint::from(al_states & 0x0F) | c_uint::from(is_up) << 4;
        SegmentState { slaves_responding: responding.into(), bits }
    }
}

/// `ec_slave_config_state_t`: bit 0 online, bit 1 operational, bits 2 to 5 AL state.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlaveConfigState(pub c_uint);

/// `ec_master_info_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MasterInfo {
    /// Number of SubDevices on the bus.
    pub slave_count: c_uint,
    /// Bit 0: a link is up. `scan_busy` follows in the next byte.
    pub link_up: u8,
    /// A scan runs.
    pub scan_busy: u8,
    /// Unused.
    pub padding: [u8; 2],
    /// Application time.
    pub app_time: u64,
}

/// `ec_master_scan_progress_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScanProgress {
    /// Number of SubDevices.
    pub slave_count: c_uint,
    /// Index of the SubDevice that is scanned; the number of SubDevices after the scan.
    pub scan_index: c_uint,
}

/// One of `ec_slave_info_t.ports`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Port {
    /// `ec_slave_port_desc_t`.
    pub desc: c_int,
    /// Link, loop closed, signal.
    pub link: [u8; 3],
    /// Receive time in nanoseconds.
    pub receive_time: u32,
    /// Position of the next SubDevice; 0xffff: none.
    pub next_slave: u16,
    /// Delay to it in nanoseconds.
    pub delay_to_next_dc: u32,
}

/// `ec_slave_info_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlaveInfo {
    /// Position on the bus.
    pub position: u16,
    /// Vendor.
    pub vendor_id: u32,
    /// Product.
    pub product_code: u32,
    /// Revision.
    pub revision_number: u32,
    /// Serial number.
    pub serial_number: u32,
    /// Alias.
    pub alias: u16,
    /// Current from the EBUS in milliamperes.
    pub current_on_ebus: i16,
    /// Ports.
    pub ports: [Port; 4],
    /// AL state.
    pub al_state: u8,
    /// The SubDevice shows an error.
    pub error_flag: u8,
    /// Number of SyncManagers.
    pub sync_count: u8,
    /// Number of objects in the dictionary.
    pub sdo_count: u16,
    /// Name, with a zero at its end.
    pub name: [c_char; 64],
}

/// `ec_domain_state_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DomainState {
    /// Working counter of the last cycle.
    pub working_counter: c_uint,
    /// `ec_wc_state_t`.
    pub wc_state: c_int,
    /// The redundant link carries process data.
    pub redundancy_active: c_uint,
}

/// `ec_pdo_entry_info_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PdoEntryInfo {
    /// Index of the object.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Length in bits.
    pub bit_length: u8,
}

/// `ec_pdo_info_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PdoInfo {
    /// Index of the PDO.
    pub index: u16,
    /// Number of entries; 0: the default mapping.
    pub n_entries: c_uint,
    /// The entries.
    pub entries: *const PdoEntryInfo,
}

/// `ec_sync_info_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct SyncInfo {
    /// SyncManager; 0xff ends a list.
    pub index: u8,
    /// `ec_direction_t`.
    pub dir: c_int,
    /// Number of PDOs; 0: the default assignment.
    pub n_pdos: c_uint,
    /// The PDOs.
    pub pdos: *const PdoInfo,
    /// `ec_watchdog_mode_t`.
    pub watchdog_mode: c_int,
}

/// `ec_pdo_entry_reg_t`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PdoEntryReg {
    /// Alias.
    pub alias: u16,
    /// Position.
    pub position: u16,
    /// Vendor.
    pub vendor_id: u32,
    /// Product.
    pub product_code: u32,
    /// Index of the object; 0 ends a list.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Receives the byte.
    pub offset: *mut c_uint,
    /// Receives the bit; may be NULL.
    pub bit_position: *mut c_uint,
}

const _: () = assert!(size_of::<SegmentState>() == 8 && size_of::<SlaveConfigState>() == 4);
const _: () = assert!(size_of::<MasterInfo>() == 16 && size_of::<ScanProgress>() == 8);
const _: () = assert!(size_of::<SlaveInfo>() == 176 && size_of::<DomainState>() == 12);
#[cfg(target_pointer_width = "64")]
const _: () = assert!(size_of::<PdoInfo>() == 16 && size_of::<SyncInfo>() == 32 && size_of::<PdoEntryReg>() == 32);
