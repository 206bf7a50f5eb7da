//! The register table: size, access rights, reset value and groups of every register (protocol 3).

use super::map;
use crate::address::RegisterAddress;

/// Access rights of one side to a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// Nothing.
    None,
    /// Read.
    Read,
    /// Write.
    Write,
    /// Both.
    ReadWrite,
}

impl Access {
    /// Whether reading is allowed.
    pub const fn reads(self) -> bool {
        matches!(self, Access::Read | Access::ReadWrite)
    }

    /// Whether writing is allowed.
    pub const fn writes(self) -> bool {
        matches!(self, Access::Write | Access::ReadWrite)
    }
}

/// Group of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RegisterGroup {
    /// Type and features of the controller (protocol 3.1).
    Information,
    /// Addresses, protection, reset (protocol 3.2).
    Addressing,
    /// Data link layer (protocol 3.3).
    DataLink,
    /// Application layer (protocol 3.4).
    ApplicationLayer,
    /// Process data interface (protocol 3.5).
    Pdi,
    /// Events (protocol 3.5).
    Event,
    /// Error counters (protocol 2.5).
    ErrorCounter,
    /// Watchdogs (protocol 3.7).
    Watchdog,
    /// EEPROM (protocol 3.8).
    Sii,
    /// PHYs (protocol 3.9).
    Mii,
    /// FMMUs (protocol 3.10).
    Fmmu,
    /// SyncManagers (protocol 3.11).
    SyncManager,
    /// Distributed clocks (protocol 3.12).
    DistributedClocks,
    /// Specific to the controller (protocol 3.13).
    EscSpecific,
    /// RAM (protocol 3.13).
    Ram,
}

/// Counters that any write to one of them clears together (protocol 2.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ClearGroup {
    /// 0x0300..0x030B.
    RxErrors,
    /// 0x030C.
    EpuErrors,
    /// 0x030D and 0x030E.
    PdiErrors,
    /// 0x0310..0x0313.
    LostLinks,
    /// 0x0442 and 0x0443.
    Watchdogs,
}

/// One row of the register table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegisterInfo {
    /// Address; the first address if the register repeats.
    pub address: RegisterAddress,
    /// Bytes of one register.
    pub size: u16,
    /// Maximum number of repetitions of the register (ports, FMMUs, SyncManagers).
    pub count: u8,
    /// Distance between repetitions in bytes.
    pub stride: u16,
    /// Data sheet name.
    pub name: &'static str,
    /// Access of the EtherCAT side. A counter that is cleared by a write is writable.
    pub ecat: Access,
    /// Access of the PDI side, unless another register assigns the access (EEPROM, SYNC and LATCH units).
    pub pdi: Access,
    /// Value after a reset; 0 if it depends on the device.
    pub reset: u64,
    /// Writes take effect after a valid FCS of the frame.
    pub shadowed: bool,
    /// Group of the register.
    pub group: RegisterGroup,
    /// Counters that are cleared together with this one.
    pub clear_group: Option<ClearGroup>,
}

impl RegisterInfo {
    /// The repetition of the register that contains this address; `None` if there is none.
    pub const fn instance(&self, address: RegisterAddress) -> Option<u8> {
        let Some(offset) = address.0.checked_sub(self.address.0) else { return None };
        let instance = offset / self.stride;
        if instance < self.count as u16 && offset % self.stride < self.size { Some(instance as u8) } else { None }
    }

    const fn reset(self, reset: u64) -> RegisterInfo {
        RegisterInfo { reset, ..self }
    }

    const fn shadowed(self) -> RegisterInfo {
        RegisterInfo { shadowed: true, ..self }
    }

    const fn repeated(self, count: u8, stride: u16) -> RegisterInfo {
        RegisterInfo { count, stride, ..self }
    }

    const fn cleared_with(self, group: ClearGroup) -> RegisterInfo {
        RegisterInfo { clear_group: Some(group), ..self }
    }
}

/// The register that contains this address; `None` in gaps.
pub fn find(address: RegisterAddress) -> Option<&'static RegisterInfo> {
    TABLE.iter().find(|info| info.instance(address).is_some())
}

const fn row(
    group: RegisterGroup,
    name: &'static str,
    address: RegisterAddress,
    size: u16,
    ecat: Access,
    pdi: Access,
) -> RegisterInfo {
    RegisterInfo {
        address,
        size,
        count: 1,
        stride: size,
        name,
        ecat,
        pdi,
        reset: 0,
        shadowed: false,
        group,
        clear_group: None,
    }
}

/// `NAME, size, EtherCAT access, PDI access` of a register of the map.
macro_rules! reg {
    ($group:ident, $name:ident, $size:literal, $ecat:ident, $pdi:ident) => {
        row(RegisterGroup::$group, stringify!($name), map::$name, $size, $ecat, $pdi)
    };
}

const N: Access = Access::None;
const R: Access = Access::Read;
const W: Access = Access::Write;
const RW: Access = Access::ReadWrite;

const fn sync_manager(name: &'static str, offset: u16, size: u16, ecat: Access, pdi: Access) -> RegisterInfo {
    let address = map::SYNC_MANAGER_BASE.offset(offset);
    row(RegisterGroup::SyncManager, name, address, size, ecat, pdi).repeated(16, 8)
}

/// All registers in ascending order; the repeating parts of SyncManagers are interleaved.
pub(super) static TABLE: &[RegisterInfo] = &[
    reg!(Information, TYPE, 1, R, R),
    reg!(Information, REVISION, 1, R, R),
    reg!(Information, BUILD, 2, R, R),
    reg!(Information, FMMU_COUNT, 1, R, R),
    reg!(Information, SYNC_MANAGER_COUNT, 1, R, R),
    reg!(Information, RAM_SIZE, 1, R, R),
    reg!(Information, PORT_DESCRIPTOR, 1, R, R),
    reg!(Information, FEATURES, 2, R, R),
    reg!(Addressing, STATION_ADDRESS, 2, RW, R).shadowed(),
    reg!(Addressing, STATION_ALIAS, 2, R, RW),
    reg!(Addressing, REGISTER_WRITE_ENABLE, 1, W, N),
    reg!(Addressing, REGISTER_WRITE_PROTECTION, 1, RW, R),
    reg!(Addressing, ESC_WRITE_ENABLE, 1, W, N),
    reg!(Addressing, ESC_WRITE_PROTECTION, 1, RW, R),
    reg!(Addressing, ESC_RESET_ECAT, 1, RW, R),
    reg!(Addressing, ESC_RESET_PDI, 1, R, RW),
    reg!(DataLink, DL_CONTROL, 4, RW, R).reset(0x0007_0001).shadowed(),
    reg!(DataLink, PHYSICAL_OFFSET, 2, RW, R).shadowed(),
    reg!(DataLink, DL_STATUS, 2, R, R),
    reg!(ApplicationLayer, AL_CONTROL, 2, RW, R).reset(0x0001).shadowed(),
    reg!(ApplicationLayer, AL_STATUS, 2, R, RW).reset(0x0001),
    reg!(ApplicationLayer, AL_STATUS_CODE, 2, R, RW),
    reg!(ApplicationLayer, RUN_LED, 1, RW, RW),
    reg!(ApplicationLayer, ERR_LED, 1, RW, RW),
    reg!(Pdi, PDI_CONTROL, 1, R, R),
    reg!(Pdi, ESC_CONFIGURATION, 1, R, R),
    reg!(Pdi, PDI_INFORMATION, 2, R, R),
    reg!(Pdi, PDI_CONFIGURATION, 1, R, R),
    reg!(Pdi, SYNC_LATCH_CONFIGURATION, 1, R, R),
    reg!(Pdi, EXTENDED_PDI_CONFIGURATION, 2, R, R),
    reg!(Event, ECAT_EVENT_MASK, 2, RW, R).shadowed(),
    reg!(Event, AL_EVENT_MASK, 4, R, RW).reset(0x00FF_FF0F),
    reg!(Event, ECAT_EVENT, 2, R, R),
    reg!(Event, AL_EVENT, 4, R, R),
    reg!(ErrorCounter, RX_ERROR_COUNTER, 2, RW, R).repeated(4, 2).cleared_with(ClearGroup::RxErrors),
    reg!(ErrorCounter, FORWARDED_RX_ERROR_COUNTER, 1, RW, R).repeated(4, 1).cleared_with(ClearGroup::RxErrors),
    reg!(ErrorCounter, EPU_ERROR_COUNTER, 1, RW, R).cleared_with(ClearGroup::EpuErrors),
    reg!(ErrorCounter, PDI_ERROR_COUNTER, 1, RW, R).cleared_with(ClearGroup::PdiErrors),
    reg!(ErrorCounter, PDI_ERROR_CODE, 1, RW, R).cleared_with(ClearGroup::PdiErrors),
    reg!(ErrorCounter, LOST_LINK_COUNTER, 1, RW, R).repeated(4, 1).cleared_with(ClearGroup::LostLinks),
    reg!(Watchdog, WATCHDOG_DIVIDER, 2, RW, R).reset(0x09C2).shadowed(),
    reg!(Watchdog, WATCHDOG_TIME_PDI, 2, RW, R).reset(0x03E8).shadowed(),
    reg!(Watchdog, WATCHDOG_TIME_PROCESS_DATA, 2, RW, R).reset(0x03E8).shadowed(),
    reg!(Watchdog, WATCHDOG_STATUS, 2, R, R),
    reg!(Watchdog, WATCHDOG_COUNTER_PROCESS_DATA, 1, RW, R).cleared_with(ClearGroup::Watchdogs),
    reg!(Watchdog, WATCHDOG_COUNTER_PDI, 1, RW, R).cleared_with(ClearGroup::Watchdogs),
    reg!(Sii, SII_CONFIGURATION, 1, RW, R),
    reg!(Sii, SII_PDI_ACCESS, 1, R, RW),
    reg!(Sii, SII_CONTROL, 2, RW, RW),
    reg!(Sii, SII_ADDRESS, 4, RW, RW),
    reg!(Sii, SII_DATA, 8, RW, RW),
    reg!(Mii, MII_CONTROL, 2, RW, RW),
    reg!(Mii, MII_PHY_ADDRESS, 1, RW, RW),
    reg!(Mii, MII_PHY_REGISTER, 1, RW, RW),
    reg!(Mii, MII_PHY_DATA, 2, RW, RW),
    reg!(Mii, MII_ECAT_ACCESS, 1, RW, R),
    reg!(Mii, MII_PDI_ACCESS, 1, RW, RW),
    reg!(Mii, MII_PHY_PORT_STATUS, 1, RW, RW).repeated(4, 1),
    row(RegisterGroup::Fmmu, "FMMU", map::FMMU_BASE, 16, RW, R).repeated(16, 16).shadowed(),
    sync_manager("SYNC_MANAGER_START", 0, 2, RW, R).shadowed(),
    sync_manager("SYNC_MANAGER_LENGTH", 2, 2, RW, R).shadowed(),
    sync_manager("SYNC_MANAGER_CONTROL", 4, 1, RW, R).shadowed(),
    sync_manager("SYNC_MANAGER_STATUS", 5, 1, R, R),
    sync_manager("SYNC_MANAGER_ACTIVATE", 6, 1, RW, R).shadowed(),
    sync_manager("SYNC_MANAGER_PDI_CONTROL", 7, 1, R, RW),
    reg!(DistributedClocks, DC_RECEIVE_TIME, 4, RW, R).repeated(4, 4),
    reg!(DistributedClocks, DC_SYSTEM_TIME, 8, RW, R),
    reg!(DistributedClocks, DC_RECEIVE_TIME_EPU, 8, R, R),
    reg!(DistributedClocks, DC_SYSTEM_TIME_OFFSET, 8, RW, R).shadowed(),
    reg!(DistributedClocks, DC_SYSTEM_TIME_DELAY, 4, RW, R).shadowed(),
    reg!(DistributedClocks, DC_SYSTEM_TIME_DIFFERENCE, 4, R, R),
    reg!(DistributedClocks, DC_SPEED_COUNTER_START, 2, RW, R).reset(0x1000).shadowed(),
    reg!(DistributedClocks, DC_SPEED_COUNTER_DIFFERENCE, 2, R, R),
    reg!(DistributedClocks, DC_FILTER_DIFFERENCE, 1, RW, R).reset(4),
    reg!(DistributedClocks, DC_FILTER_SPEED, 1, RW, R).reset(12),
    reg!(DistributedClocks, DC_LATCH_MODE, 1, RW, R),
    reg!(DistributedClocks, DC_CYCLIC_UNIT_CONTROL, 1, RW, R),
    reg!(DistributedClocks, DC_ACTIVATION, 1, RW, R).shadowed(),
    reg!(DistributedClocks, DC_PULSE_LENGTH, 2, R, R),
    reg!(DistributedClocks, DC_ACTIVATION_STATUS, 1, R, R),
    reg!(DistributedClocks, DC_SYNC0_STATUS, 1, R, R),
    reg!(DistributedClocks, DC_SYNC1_STATUS, 1, R, R),
    reg!(DistributedClocks, DC_START_TIME, 8, RW, R).shadowed(),
    reg!(DistributedClocks, DC_NEXT_SYNC1, 8, R, R),
    reg!(DistributedClocks, DC_SYNC0_CYCLE, 4, RW, R).shadowed(),
    reg!(DistributedClocks, DC_SYNC1_CYCLE, 4, RW, R).shadowed(),
    reg!(DistributedClocks, DC_LATCH0_CONTROL, 1, RW, R),
    reg!(DistributedClocks, DC_LATCH1_CONTROL, 1, RW, R),
    reg!(DistributedClocks, DC_LATCH0_STATUS, 1, R, R),
    reg!(DistributedClocks, DC_LATCH1_STATUS, 1, R, R),
    reg!(DistributedClocks, DC_LATCH0_POSITIVE_EDGE, 8, R, R),
    reg!(DistributedClocks, DC_LATCH0_NEGATIVE_EDGE, 8, R, R),
    reg!(DistributedClocks, DC_LATCH1_POSITIVE_EDGE, 8, R, R),
    reg!(DistributedClocks, DC_LATCH1_NEGATIVE_EDGE, 8, R, R),
    reg!(DistributedClocks, DC_ECAT_BUFFER_CHANGE, 4, R, R),
    reg!(DistributedClocks, DC_PDI_BUFFER_START, 4, R, R),
    reg!(DistributedClocks, DC_PDI_BUFFER_CHANGE, 4, R, R),
    reg!(EscSpecific, PRODUCT_ID, 8, R, R),
    reg!(EscSpecific, DIGITAL_OUTPUTS, 4, RW, RW),
    reg!(EscSpecific, GPO, 8, RW, RW),
    reg!(EscSpecific, GPI, 8, R, R),
    reg!(Ram, USER_RAM, 128, RW, RW),
    reg!(Ram, PROCESS_RAM, 0xF000, RW, RW),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::{AlControl, AlEvent, AlStatus, DcFilterDifference, DcFilterSpeed, DcSpeedCounterStart};
    use crate::register::{DlControl, WatchdogDivider, WatchdogTime};

    // covers: codec-registers
    #[test]
    fn every_address_of_the_map_has_its_row() {
        for &(name, address) in map::ALL {
            let info = find(address).unwrap_or_else(|| panic!("{name} has no row"));
            assert_eq!(info.address, address, "{name}");
            let base = ["FMMU_BASE", "SYNC_MANAGER_BASE"].contains(&name);
            assert!(base || info.name == name, "{name} is {}", info.name);
        }
    }

    // covers: codec-registers
    #[test]
    fn every_address_belongs_to_at_most_one_register() {
        for address in (0..=0xFFFF).map(RegisterAddress) {
            let owners = TABLE.iter().filter(|info| info.instance(address).is_some()).count();
            assert!(owners <= 1, "{address}");
        }
    }

    #[test]
    fn rows_are_in_ascending_order() {
        assert!(TABLE.windows(2).all(|pair| pair[0].address < pair[1].address));
    }

    #[test]
    fn an_address_inside_a_register_finds_it() {
        let name = |address| find(RegisterAddress(address)).map(|info| info.name);
        assert_eq!(name(0x0103), Some("DL_CONTROL"));
        assert_eq!(name(0x081E), Some("SYNC_MANAGER_ACTIVATE"));
        assert_eq!(find(RegisterAddress(0x081E)).and_then(|info| info.instance(RegisterAddress(0x081E))), Some(3));
        assert_eq!(name(0x06FF), Some("FMMU"));
        assert_eq!(name(0x0700), None);
        assert_eq!(name(0x030F), None);
        assert_eq!(name(0xFFFF), Some("PROCESS_RAM"));
    }

    // covers: codec-registers
    #[test]
    fn reset_values_agree_with_the_views() {
        let reset = |address| find(address).map(|info| info.reset);
        assert_eq!(reset(map::DL_CONTROL), Some(u64::from(DlControl::RESET)));
        assert_eq!(reset(map::AL_CONTROL), Some(u64::from(AlControl::RESET)));
        assert_eq!(reset(map::AL_STATUS), Some(u64::from(AlStatus::RESET)));
        assert_eq!(reset(map::AL_EVENT_MASK), Some(u64::from(AlEvent::MASK_RESET)));
        assert_eq!(reset(map::WATCHDOG_DIVIDER), Some(u64::from(WatchdogDivider::RESET)));
        assert_eq!(reset(map::WATCHDOG_TIME_PDI), Some(u64::from(WatchdogTime::RESET)));
        assert_eq!(reset(map::WATCHDOG_TIME_PROCESS_DATA), Some(u64::from(WatchdogTime::RESET)));
        assert_eq!(reset(map::DC_SPEED_COUNTER_START), Some(u64::from(DcSpeedCounterStart::RESET)));
        assert_eq!(reset(map::DC_FILTER_DIFFERENCE), Some(u64::from(DcFilterDifference::RESET)));
        assert_eq!(reset(map::DC_FILTER_SPEED), Some(u64::from(DcFilterSpeed::RESET)));
    }

    // covers: codec-registers
    #[test]
    fn access_rights_are_those_of_the_data_sheet() {
        let access = |address| find(address).map(|info| (info.ecat, info.pdi));
        assert_eq!(access(map::STATION_ADDRESS), Some((Access::ReadWrite, Access::Read)));
        assert_eq!(access(map::STATION_ALIAS), Some((Access::Read, Access::ReadWrite)));
        assert_eq!(access(map::REGISTER_WRITE_ENABLE), Some((Access::Write, Access::None)));
        assert_eq!(access(map::sync_manager(2).offset(7)), Some((Access::Read, Access::ReadWrite)));
        assert!(Access::ReadWrite.reads() && Access::ReadWrite.writes() && !Access::None.reads());
        assert!(!Access::Read.writes() && !Access::Write.reads() && Access::Write.writes());
    }
}
