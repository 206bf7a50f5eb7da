//! Settings of one SubDevice as a program for `ecrt.h` gives them, converted into a declaration.
//!
//! PDO assignments and mappings that the program does not change are those of the SubDevice.

use std::net::Ipv4Addr;
use std::time::Duration;

use ringcat::wire::sii::SyncManagerKind;
use ringcat::{
    AlState, ConfigAddress, Direction, Idn, IpSettings, PdoEntry, PdoMapping, RefusedPdos, SdoDownload, StartupAction,
    SubDeviceConfig, SubDeviceInfo, SyncSignals, Transition, Watchdog,
};

use crate::code::{Code, Outcome, report};

/// SyncManagers of a SubDevice (`EC_MAX_SYNC_MANAGERS`).
pub const MAX_SYNC_MANAGERS: usize = 16;
/// PDOs from here on are inputs.
const FIRST_INPUT_PDO: u16 = 0x1A00;
/// A vendor or a product that stands for any, where there are wildcards.
const ANY: u32 = 0xFFFF_FFFF;
/// Drives behind a SubDevice.
const MAX_DRIVE: u8 = 7;

/// A PDO; `None` as entries: those of the SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Pdo {
    index: u16,
    entries: Option<Vec<PdoEntry>>,
}

/// A SyncManager; `None`: as in the SubDevice.
#[derive(Clone, Debug, Default)]
struct SyncManager {
    direction: Option<Direction>,
    watchdog: Watchdog,
    pdos: Option<Vec<Pdo>>,
}

/// Name of a SubDevice: alias and position, vendor and product.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    /// Alias; 0: the position counts from the start of the bus.
    pub alias: u16,
    /// Position, or offset behind the alias.
    pub position: u16,
    /// Vendor.
    pub vendor: u32,
    /// Product.
    pub product: u32,
}

/// Settings of one SubDevice.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Its name.
    pub name: Name,
    sync_managers: [SyncManager; MAX_SYNC_MANAGERS],
    sdos: Vec<SdoDownload>,
    idns: Vec<(Transition, u8, Idn, Vec<u8>)>,
    ip: Option<IpSettings>,
    watchdog: (Option<u16>, Option<u16>),
    state_timeouts: Vec<(AlState, AlState, Duration)>,
    /// SYNC signals.
    pub sync: Option<SyncSignals>,
    sii_to_pdi: bool,
    wait_before_safeop: Duration,
    /// Vendor and product [`ANY`] stand for any.
    has_wildcards: bool,
    /// All of them, from a network file.
    of_file: Option<Box<SubDeviceConfig>>,
}

impl Settings {
    /// Everything as in the SubDevice.
    pub fn new(name: Name) -> Settings {
        Settings {
            name,
            sync_managers: Default::default(),
            sdos: Vec::new(),
            idns: Vec::new(),
            ip: None,
            watchdog: (None, None),
            state_timeouts: Vec::new(),
            sync: None,
            sii_to_pdi: false,
            wait_before_safeop: Duration::ZERO,
            has_wildcards: false,
            of_file: None,
        }
    }

    /// Whether vendor and product 0xFFFFFFFF stand for any.
    #[must_use]
    pub fn with_wildcards(mut self, has_wildcards: bool) -> Settings {
        self.has_wildcards = has_wildcards;
        self
    }

    /// Those of a network file.
    pub fn of_file(name: Name, config: SubDeviceConfig) -> Settings {
        Settings { of_file: Some(Box::new(config)), ..Settings::new(name) }
    }

    /// Whether they are those of a network file, which the program does not change.
    pub const fn is_of_file(&self) -> bool {
        self.of_file.is_some()
    }

    fn sync_manager_mut(&mut self, index: u8) -> Outcome<&mut SyncManager> {
        self.sync_managers.get_mut(usize::from(index)).ok_or(Code::NOT_FOUND)
    }

    /// Sets direction (1 outputs, 2 inputs) and watchdog (0 default, 1 on, 2 off) of a SyncManager.
    ///
    /// # Errors
    /// No such SyncManager, no such direction or watchdog mode.
    pub fn set_sync_manager(&mut self, index: u8, direction: i32, watchdog: i32) -> Outcome {
        let direction = match direction {
            1 => Direction::Outputs,
            2 => Direction::Inputs,
            _ => return Err(Code::INVALID),
        };
        let watchdog = match watchdog {
            0 => Watchdog::Default,
            1 => Watchdog::On,
            2 => Watchdog::Off,
            _ => return Err(Code::INVALID),
        };
        let sync_manager = self.sync_manager_mut(index)?;
        (sync_manager.direction, sync_manager.watchdog) = (Some(direction), watchdog);
        Ok(())
    }

    /// Removes all PDOs from a SyncManager.
    ///
    /// # Errors
    /// No such SyncManager.
    pub fn clear_assignment(&mut self, index: u8) -> Outcome {
        self.sync_manager_mut(index)?.pdos = Some(Vec::new());
        Ok(())
    }

    /// Adds a PDO with its default mapping to a SyncManager.
    ///
    /// # Errors
    /// No such SyncManager; it has the PDO already.
    pub fn assign(&mut self, index: u8, pdo: u16, info: Option<&SubDeviceInfo>) -> Outcome {
        let sync_manager = self.sync_manager_mut(index)?;
        let pdos = sync_manager.pdos.get_or_insert_with(|| inherited(index, info));
        if pdos.iter().any(|other| other.index == pdo) {
            return Err(Code::EXISTS);
        }
        pdos.push(Pdo { index: pdo, entries: None });
        Ok(())
    }

    /// The PDO with an index, in whatever SyncManager it is assigned.
    fn pdo_mut(&mut self, pdo: u16, info: Option<&SubDeviceInfo>) -> Outcome<&mut Pdo> {
        for (number, sync_manager) in (0u8..).zip(&mut self.sync_managers) {
            if sync_manager.pdos.is_none() && inherited(number, info).iter().any(|own| own.index == pdo) {
                sync_manager.pdos = Some(inherited(number, info));
            }
        }
        let all = self.sync_managers.iter_mut().filter_map(|sync_manager| sync_manager.pdos.as_mut()).flatten();
        all.into_iter().find(|own| own.index == pdo).ok_or(Code::NOT_FOUND)
    }

    /// Removes all entries from an assigned PDO.
    ///
    /// # Errors
    /// The PDO is not assigned.
    pub fn clear_mapping(&mut self, pdo: u16, info: Option<&SubDeviceInfo>) -> Outcome {
        self.pdo_mut(pdo, info)?.entries = Some(Vec::new());
        Ok(())
    }

    /// Adds an entry to an assigned PDO.
    ///
    /// # Errors
    /// The PDO is not assigned.
    pub fn map(&mut self, pdo: u16, entry: PdoEntry, info: Option<&SubDeviceInfo>) -> Outcome {
        let default = info.and_then(|info| info.pdo(pdo)).map_or_else(Vec::new, |found| {
            found.entries.iter().map(|entry| PdoEntry::new(entry.index, entry.sub_index, entry.bit_length)).collect()
        });
        self.pdo_mut(pdo, info)?.entries.get_or_insert(default).push(entry);
        Ok(())
    }

    /// Adds an SDO download in PREOP.
    ///
    /// # Errors
    /// There is no data.
    pub fn add_sdo(&mut self, sdo: SdoDownload) -> Outcome {
        if sdo.data.is_empty() {
            return Err(Code::INVALID);
        }
        self.sdos.push(sdo);
        Ok(())
    }

    /// Adds the write of an IDN in PREOP (2) or SAFEOP (4).
    ///
    /// # Errors
    /// Another state, a drive above 7, no data.
    pub fn add_idn(&mut self, drive: u8, idn: u16, state: i32, data: Vec<u8>) -> Outcome {
        let transition = match state {
            2 => Transition::Ps,
            4 => Transition::So,
            _ => return Err(Code::INVALID),
        };
        if drive > MAX_DRIVE || data.is_empty() {
            return Err(Code::INVALID);
        }
        self.idns.push((transition, drive, Idn(idn), data));
        Ok(())
    }

    /// Changes the IP parameters.
    pub fn change_ip(&mut self, change: impl FnOnce(IpSettings) -> IpSettings) {
        self.ip = Some(change(self.ip.take().unwrap_or_default()));
    }

    /// Sets divider and intervals of the watchdog; 0: not written.
    pub fn set_watchdog(&mut self, divider: u16, intervals: u16) {
        let given = |value: u16| (value != 0).then_some(value);
        self.watchdog = (given(divider), given(intervals));
    }

    /// Sets the limit of a state change; zero: the default again.
    ///
    /// # Errors
    /// Unknown states.
    pub fn set_state_timeout(&mut self, from: i32, to: i32, limit: Duration) -> Outcome {
        let (from, to) = (al_state(from)?, al_state(to)?);
        self.state_timeouts.retain(|(known, next, _)| (*known, *next) != (from, to));
        if !limit.is_zero() {
            self.state_timeouts.push((from, to, limit));
        }
        Ok(())
    }

    /// Sets SYNC signals; without an activation word there are none. The shift of SYNC1 has no effect.
    pub fn set_sync(&mut self, assign_activate: u16, sync0: (u32, i32), sync1_cycle_ns: u32) {
        let signals = SyncSignals::sync0(sync0.0, sync0.1).with_assign_activate(assign_activate);
        self.sync = (assign_activate != 0).then(|| signals.with_sync1(sync1_cycle_ns, 0));
    }

    /// Sets a feature flag. Unknown keys are accepted and reported.
    ///
    /// # Errors
    /// A negative time.
    pub fn set_flag(&mut self, key: &str, value: i32) -> Outcome {
        match key {
            "AssignToPdi" => self.sii_to_pdi = value != 0,
            "WaitBeforeSAFEOPms" => {
                let pause = u64::try_from(value).map_err(|_| Code::INVALID)?;
                self.wait_before_safeop = Duration::from_millis(pause);
            }
            // For tests alone: no release has it.
            #[cfg(debug_assertions)]
            "RingcatTestPanic" => panic!("provoked by a test"),
            _ => report(format_args!("flag \"{}\" is unknown and has no effect", key.escape_debug())),
        }
        Ok(())
    }

    /// The declaration: SDOs in the order of the calls, then IDNs, then IP parameters.
    pub fn config(&self, info: Option<&SubDeviceInfo>) -> SubDeviceConfig {
        if let Some(config) = &self.of_file {
            return (**config).clone();
        }
        let Name { alias, position, vendor, product } = self.name;
        // Alias 0 is the exact position.
        let address = ConfigAddress::Alias { alias, offset: position };
        let mut config = SubDeviceConfig::at(address).refused_pdos(RefusedPdos::Warn);
        let expected = |value: u32| Some(value).filter(|value| !(self.has_wildcards && *value == ANY));
        (config.expected.vendor_id, config.expected.product_code) = (expected(vendor), expected(product));
        for (number, sync_manager) in (0u8..).zip(&self.sync_managers) {
            config = sync_manager.declare(number, config, info);
        }
        for sdo in &self.sdos {
            config = config.startup(Transition::Ps, StartupAction::Sdo(sdo.clone()));
        }
        for (transition, drive, idn, data) in &self.idns {
            config = config.idn_at(*transition, *drive, *idn, data.clone());
        }
        if let Some(ip) = &self.ip {
            config = config.ip(ip.clone());
        }
        for (from, to, limit) in &self.state_timeouts {
            config = config.state_timeout(*from, *to, *limit);
        }
        config = config.watchdog(self.watchdog.0, self.watchdog.1).wait_before_safeop(self.wait_before_safeop);
        config.sync = self.sync;
        if self.sii_to_pdi { config.sii_to_pdi() } else { config }
    }
}

impl SyncManager {
    fn declare(&self, number: u8, config: SubDeviceConfig, info: Option<&SubDeviceInfo>) -> SubDeviceConfig {
        let own = inherited(number, info);
        let pdos = self.pdos.as_ref().unwrap_or(&own);
        let direction = self.direction.unwrap_or_else(|| usual_direction(number, pdos, info));
        let config = match self.direction {
            // A SyncManager without PDOs need not exist.
            Some(_) if !pdos.is_empty() => config.sync_manager(number, direction, self.watchdog),
            _ => config,
        };
        match &self.pdos {
            None => config,
            // There was nothing to clear.
            Some(pdos) if pdos.is_empty() && own.is_empty() => config,
            Some(pdos) => {
                let mapping = |pdo: &Pdo| match &pdo.entries {
                    None => PdoMapping::from_sii(pdo.index),
                    Some(entries) => PdoMapping::of(pdo.index, entries.clone()),
                };
                config.assign(number, direction, pdos.iter().map(mapping).collect())
            }
        }
    }
}

/// The default assignment of a SyncManager.
fn inherited(number: u8, info: Option<&SubDeviceInfo>) -> Vec<Pdo> {
    let pdos = info.into_iter().flat_map(|info| info.assigned_pdos(number));
    pdos.map(|pdo| Pdo { index: pdo.index, entries: None }).collect()
}

/// Direction of a SyncManager without one of its own: that of the SII, otherwise that of its PDOs.
fn usual_direction(number: u8, pdos: &[Pdo], info: Option<&SubDeviceInfo>) -> Direction {
    match info.and_then(|info| info.sync_managers.get(usize::from(number))).map(|own| own.kind) {
        Some(SyncManagerKind::Outputs) => Direction::Outputs,
        Some(SyncManagerKind::Inputs) => Direction::Inputs,
        _ if pdos.first().is_some_and(|pdo| pdo.index < FIRST_INPUT_PDO) => Direction::Outputs,
        _ => Direction::Inputs,
    }
}

/// An AL state by its number in C.
fn al_state(number: i32) -> Outcome<AlState> {
    match number {
        1 => Ok(AlState::Init),
        2 => Ok(AlState::PreOp),
        4 => Ok(AlState::SafeOp),
        8 => Ok(AlState::Op),
        _ => Err(Code::INVALID),
    }
}

/// An address from a `struct in_addr`, which is in network byte order.
pub fn address(in_addr: u32) -> Ipv4Addr {
    Ipv4Addr::from(in_addr.to_ne_bytes())
}
