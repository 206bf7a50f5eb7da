//! The address space of a controller: bytes, existing ranges, and write access of each side (protocol 3).
//!
//! Input: addresses. Output: runs of addresses with equal rights, and little-endian access to the bytes.
//! [`super::registers`] implements the effects of writes; SyncManagers, protection and the SII interface add
//! restrictions in [`super::access`].

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::map;

use super::config::{ControllerConfig, MAX_UNITS};

/// First address of user RAM: writes below it take effect only after a good FCS (protocol 2.5).
pub(super) const USER_RAM: u32 = map::USER_RAM.0 as u32;
/// First address of process RAM.
pub(super) const PROCESS_RAM: u32 = map::PROCESS_RAM.0 as u32;
/// Maximum size of process RAM in the address space.
const MAX_RAM_KIB: u8 = 60;

/// The side of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Ecat,
    Pdi,
}

/// A condition for the existence of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Needs {
    Nothing,
    Dc,
    Dc64,
    LatchMode,
    Fmmu,
    SyncManager,
}

/// A block of addresses with equal rights.
#[derive(Clone, Copy, Debug)]
struct Region {
    start: u16,
    end: u16,
    ecat_writes: bool,
    pdi_writes: bool,
    needs: Needs,
}

impl Region {
    const fn writable(&self, side: Side) -> bool {
        match side {
            Side::Ecat => self.ecat_writes,
            Side::Pdi => self.pdi_writes,
        }
    }
}

const fn region(address: RegisterAddress, len: u16, ecat_writes: bool, pdi_writes: bool, needs: Needs) -> Region {
    Region { start: address.0, end: address.0 + len, ecat_writes, pdi_writes, needs }
}

const fn fixed(address: RegisterAddress, len: u16) -> Region {
    region(address, len, false, false, Needs::Nothing)
}

const fn ecat(address: RegisterAddress, len: u16) -> Region {
    region(address, len, true, false, Needs::Nothing)
}

const fn pdi(address: RegisterAddress, len: u16) -> Region {
    region(address, len, false, true, Needs::Nothing)
}

const fn both(address: RegisterAddress, len: u16) -> Region {
    region(address, len, true, true, Needs::Nothing)
}

const fn dc(address: RegisterAddress, len: u16, ecat_writes: bool) -> Region {
    region(address, len, ecat_writes, false, Needs::Dc)
}

/// The upper half of a 64-bit time.
const fn dc64(address: RegisterAddress, ecat_writes: bool) -> Region {
    region(address.offset(4), 4, ecat_writes, false, Needs::Dc64)
}

/// All registers up to user RAM, ascending. The blocks of FMMUs and SyncManagers are limited by their number.
static REGIONS: [Region; 69] = [
    fixed(map::TYPE, 10),
    ecat(map::STATION_ADDRESS, 2),
    pdi(map::STATION_ALIAS, 2),
    ecat(map::REGISTER_WRITE_ENABLE, 1),
    ecat(map::REGISTER_WRITE_PROTECTION, 1),
    ecat(map::ESC_WRITE_ENABLE, 1),
    ecat(map::ESC_WRITE_PROTECTION, 1),
    ecat(map::ESC_RESET_ECAT, 1),
    pdi(map::ESC_RESET_PDI, 1),
    ecat(map::DL_CONTROL, 4),
    ecat(map::PHYSICAL_OFFSET, 2),
    fixed(map::DL_STATUS, 2),
    ecat(map::AL_CONTROL, 2),
    pdi(map::AL_STATUS, 2),
    pdi(map::AL_STATUS_CODE, 2),
    both(map::RUN_LED, 2),
    fixed(map::PDI_CONTROL, 2),
    fixed(map::PDI_INFORMATION, 2),
    fixed(map::PDI_CONFIGURATION, 4),
    ecat(map::ECAT_EVENT_MASK, 2),
    pdi(map::AL_EVENT_MASK, 4),
    fixed(map::ECAT_EVENT, 2),
    fixed(map::AL_EVENT, 4),
    ecat(map::RX_ERROR_COUNTER, 15),
    ecat(map::LOST_LINK_COUNTER, 4),
    ecat(map::WATCHDOG_DIVIDER, 2),
    ecat(map::WATCHDOG_TIME_PDI, 2),
    ecat(map::WATCHDOG_TIME_PROCESS_DATA, 2),
    fixed(map::WATCHDOG_STATUS, 2),
    ecat(map::WATCHDOG_COUNTER_PROCESS_DATA, 2),
    ecat(map::SII_CONFIGURATION, 1),
    pdi(map::SII_PDI_ACCESS, 1),
    both(map::SII_CONTROL, 14),
    region(map::FMMU_BASE, 16 * MAX_UNITS as u16, true, false, Needs::Fmmu),
    region(map::SYNC_MANAGER_BASE, 8 * MAX_UNITS as u16, true, true, Needs::SyncManager),
    dc(map::DC_RECEIVE_TIME, 16, true),
    dc(map::DC_SYSTEM_TIME, 4, true),
    dc64(map::DC_SYSTEM_TIME, true),
    dc(map::DC_RECEIVE_TIME_EPU, 4, false),
    dc64(map::DC_RECEIVE_TIME_EPU, false),
    dc(map::DC_SYSTEM_TIME_OFFSET, 4, true),
    dc64(map::DC_SYSTEM_TIME_OFFSET, true),
    dc(map::DC_SYSTEM_TIME_DELAY, 4, true),
    dc(map::DC_SYSTEM_TIME_DIFFERENCE, 4, false),
    dc(map::DC_SPEED_COUNTER_START, 2, true),
    dc(map::DC_SPEED_COUNTER_DIFFERENCE, 2, false),
    dc(map::DC_FILTER_DIFFERENCE, 2, true),
    region(map::DC_LATCH_MODE, 1, true, false, Needs::LatchMode),
    dc(map::DC_CYCLIC_UNIT_CONTROL, 1, true),
    dc(map::DC_ACTIVATION, 1, true),
    dc(map::DC_PULSE_LENGTH, 2, false),
    dc(map::DC_ACTIVATION_STATUS, 1, false),
    dc(map::DC_SYNC0_STATUS, 2, false),
    dc(map::DC_START_TIME, 4, true),
    dc64(map::DC_START_TIME, true),
    dc(map::DC_NEXT_SYNC1, 4, false),
    dc64(map::DC_NEXT_SYNC1, false),
    dc(map::DC_SYNC0_CYCLE, 8, true),
    dc(map::DC_LATCH0_CONTROL, 2, true),
    dc(map::DC_LATCH0_STATUS, 2, false),
    dc(map::DC_LATCH0_POSITIVE_EDGE, 4, false),
    dc64(map::DC_LATCH0_POSITIVE_EDGE, false),
    dc(map::DC_LATCH0_NEGATIVE_EDGE, 4, false),
    dc64(map::DC_LATCH0_NEGATIVE_EDGE, false),
    dc(map::DC_LATCH1_POSITIVE_EDGE, 4, false),
    dc64(map::DC_LATCH1_POSITIVE_EDGE, false),
    dc(map::DC_LATCH1_NEGATIVE_EDGE, 4, false),
    dc64(map::DC_LATCH1_NEGATIVE_EDGE, false),
    dc(map::DC_ECAT_BUFFER_CHANGE, 4, false),
];

/// The rest of [`REGIONS`], separate because none of its registers is optional.
static UPPER_REGIONS: [Region; 5] = [
    dc(map::DC_PDI_BUFFER_START, 8, false),
    fixed(map::PRODUCT_ID, 8),
    ecat(map::DIGITAL_OUTPUTS, 4),
    both(map::GPO, 8),
    fixed(map::GPI, 8),
];

/// First address of [`UPPER_REGIONS`].
const UPPER_START: u32 = map::DC_PDI_BUFFER_START.0 as u32;

/// For each address below user RAM, the index of the first region that ends after it, in [`REGIONS`] or, above
/// [`UPPER_START`], in [`UPPER_REGIONS`]: every register read uses it.
static NEXT_REGION: [u8; USER_RAM as usize] = {
    let mut next = [0; USER_RAM as usize];
    let (mut place, mut address) = (0, 0);
    while address < next.len() {
        if address == UPPER_START as usize {
            place = 0;
        }
        let all: &[Region] = if address < UPPER_START as usize { &REGIONS } else { &UPPER_REGIONS };
        while place < all.len() && all[place].end as usize <= address {
            place += 1;
        }
        next[address] = place as u8;
        address += 1;
    }
    next
};

/// A run of addresses with equal rights, starting at the requested address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    /// First address after the run.
    pub end: u32,
    /// Whether the addresses exist.
    pub exists: bool,
    /// Whether the requesting side may write.
    pub writable: bool,
}

/// The bytes of a controller.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    bytes: Box<[u8]>,
    fmmus_end: u32,
    sync_managers_end: u32,
    dc: bool,
    dc_64bit: bool,
    latch_mode: bool,
    /// Whether process RAM can be accessed: the SII is loaded (protocol 3.13).
    pub process_ram_open: bool,
}

impl Memory {
    pub fn new(config: &ControllerConfig) -> Memory {
        let ram = usize::from(config.ram_kib.min(MAX_RAM_KIB)) * 1024;
        Memory {
            bytes: vec![0; PROCESS_RAM as usize + ram].into_boxed_slice(),
            fmmus_end: u32::from(map::FMMU_BASE.0) + 16 * u32::from(config.fmmu_count.min(MAX_UNITS)),
            sync_managers_end: u32::from(map::SYNC_MANAGER_BASE.0)
                + 8 * u32::from(config.sync_manager_count.min(MAX_UNITS)),
            dc: config.features.dc,
            dc_64bit: config.features.dc && config.features.dc_64bit,
            latch_mode: config.features.dc && config.receive_time_latch_mode,
            process_ram_open: false,
        }
    }

    pub fn clear(&mut self) {
        self.bytes.fill(0);
    }

    /// Bytes of the whole address space.
    pub fn len(&self) -> u32 {
        self.bytes.len() as u32
    }

    /// The run of equal rights that starts at `address`.
    #[inline]
    pub fn run(&self, address: u32, side: Side) -> Run {
        if address < UPPER_START {
            // Most registers always exist: the case of nearly every access.
            let place = usize::from(NEXT_REGION[address as usize]);
            return match REGIONS.get(place) {
                Some(region) if region.needs == Needs::Nothing && u32::from(region.start) <= address => {
                    Run { end: region.end.into(), exists: true, writable: region.writable(side) }
                }
                _ => self.register_run(address, side),
            };
        }
        if address < USER_RAM {
            return self.register_run(address, side);
        }
        if address < PROCESS_RAM {
            return Run { end: PROCESS_RAM, exists: true, writable: true };
        }
        let inside = address < self.len();
        let open = inside && self.process_ram_open;
        Run { end: if inside { self.len() } else { u32::MAX }, exists: open, writable: open }
    }

    fn register_run(&self, address: u32, side: Side) -> Run {
        let all = if address < UPPER_START { &REGIONS[..] } else { &UPPER_REGIONS[..] };
        let next = NEXT_REGION.get(address as usize).map_or(usize::MAX, |next| usize::from(*next));
        let Some(region) = all.get(next) else {
            let end = if address < UPPER_START { UPPER_START } else { USER_RAM };
            return Run { end, exists: false, writable: false };
        };
        if address < u32::from(region.start) {
            return Run { end: region.start.into(), exists: false, writable: false };
        }
        let exists = self.has(region.needs);
        let mut run = Run { end: region.end.into(), exists, writable: exists && region.writable(side) };
        match region.needs {
            Needs::Fmmu => run.limit(address, self.fmmus_end),
            Needs::SyncManager => {
                run.limit(address, self.sync_managers_end);
                sync_manager_run(&mut run, address, side);
            }
            _ => {}
        }
        run
    }

    fn has(&self, needs: Needs) -> bool {
        match needs {
            Needs::Nothing | Needs::Fmmu | Needs::SyncManager => true,
            Needs::Dc => self.dc,
            Needs::Dc64 => self.dc_64bit,
            Needs::LatchMode => self.latch_mode,
        }
    }

    /// The bytes from `address`; empty if they exceed the address space.
    pub fn span(&self, address: u32, len: usize) -> &[u8] {
        let start = address as usize;
        start.checked_add(len).and_then(|end| self.bytes.get(start..end)).unwrap_or(&[])
    }

    /// Overwrites bytes; those outside of the address space are dropped.
    pub fn store(&mut self, address: u32, data: &[u8]) {
        let start = (address as usize).min(self.bytes.len());
        let len = data.len().min(self.bytes.len() - start);
        self.bytes[start..start + len].copy_from_slice(&data[..len]);
    }

    pub fn u8(&self, address: RegisterAddress) -> u8 {
        self.bytes[usize::from(address.0)]
    }

    pub fn u16(&self, address: RegisterAddress) -> u16 {
        u16::from_le_bytes(self.array(address))
    }

    pub fn u32(&self, address: RegisterAddress) -> u32 {
        u32::from_le_bytes(self.array(address))
    }

    pub fn u64(&self, address: RegisterAddress) -> u64 {
        u64::from_le_bytes(self.array(address))
    }

    pub fn array<const N: usize>(&self, address: RegisterAddress) -> [u8; N] {
        self.bytes.get(usize::from(address.0)..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
    }

    fn set_array<const N: usize>(&mut self, address: RegisterAddress, value: [u8; N]) {
        let bytes = self.bytes.get_mut(usize::from(address.0)..).and_then(<[u8]>::first_chunk_mut);
        if let Some(bytes) = bytes {
            *bytes = value;
        }
    }

    pub fn set_u8(&mut self, address: RegisterAddress, value: u8) {
        self.bytes[usize::from(address.0)] = value;
    }

    pub fn set_u16(&mut self, address: RegisterAddress, value: u16) {
        self.set_array(address, value.to_le_bytes());
    }

    pub fn set_u32(&mut self, address: RegisterAddress, value: u32) {
        self.set_array(address, value.to_le_bytes());
    }

    pub fn set_u64(&mut self, address: RegisterAddress, value: u64) {
        self.set_array(address, value.to_le_bytes());
    }

    /// Increments an 8-bit counter up to 0xFF (protocol 2.5).
    pub fn count(&mut self, address: RegisterAddress) {
        self.set_u8(address, self.u8(address).saturating_add(1));
    }
}

impl Run {
    /// Ends the existing part at `limit`.
    fn limit(&mut self, address: u32, limit: u32) {
        if address >= limit {
            (self.exists, self.writable) = (false, false);
        } else {
            self.end = self.end.min(limit);
        }
    }
}

/// Rights inside the eight bytes of a SyncManager: EtherCAT writes +0..+4 and +6, the PDI +7 (protocol 3.11).
fn sync_manager_run(run: &mut Run, address: u32, side: Side) {
    let base = address & !7;
    let (end, writable) = match (address & 7, side) {
        (0..=4, side) => (5, side == Side::Ecat),
        (5, _) => (6, false),
        (6, side) => (7, side == Side::Ecat),
        (_, side) => (8, side == Side::Pdi),
    };
    run.end = run.end.min(base + end);
    run.writable &= writable;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_ascend_without_overlap() {
        let all: Vec<_> = REGIONS.iter().chain(&UPPER_REGIONS).collect();
        assert!(all.windows(2).all(|pair| pair[0].end <= pair[1].start));
        assert!(u32::from(all.last().unwrap().end) <= USER_RAM);
    }

    #[test]
    fn the_address_table_matches_a_search() {
        for address in 0..USER_RAM {
            let all = if address < UPPER_START { &REGIONS[..] } else { &UPPER_REGIONS[..] };
            let next = all.partition_point(|region| u32::from(region.end) <= address);
            assert_eq!(usize::from(NEXT_REGION[address as usize]), next, "{address:#06x}");
        }
    }

    #[test]
    fn fmmus_and_sync_managers_end_with_their_count() {
        // protocol 3.1: an ET1200 has 3 FMMUs and 4 SyncManagers.
        let config = ControllerConfig { fmmu_count: 3, sync_manager_count: 4, ..ControllerConfig::default() };
        let memory = Memory::new(&config);
        assert_eq!(memory.run(0x0600, Side::Ecat), Run { end: 0x0630, exists: true, writable: true });
        assert!(!memory.run(0x0630, Side::Ecat).exists);
        assert!(memory.run(0x081E, Side::Ecat).writable && !memory.run(0x081F, Side::Ecat).writable);
        assert!(!memory.run(0x0820, Side::Ecat).exists);
    }

    #[test]
    fn a_32_bit_clock_has_only_the_low_halves() {
        // protocol 3.12.
        let mut config = ControllerConfig::default();
        config.features.dc_64bit = false;
        let memory = Memory::new(&config);
        assert!(memory.run(0x0910, Side::Ecat).exists && !memory.run(0x0914, Side::Ecat).exists);
    }
}
