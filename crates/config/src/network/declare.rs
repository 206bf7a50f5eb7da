//! From a network file to the declaration for the engine, with the process image and its variables.
//!
//! Addresses and control bytes of SyncManagers and mailboxes come from the SII of the SubDevice; the file decides which
//! PDOs there are. The image has a whole number of bytes per SyncManager, in the order of the file.

use std::collections::HashMap;
use std::time::Duration;

use ringcat_engine::config::{
    ClockConfig, ConfigAddress, Passage, PdoAssignment, PdoEntry, PdoMapping, ReferenceClock, Repetition,
    SubDeviceConfig, SyncSignals, Timeouts, Watchdog, WhenUnlocked,
};
use ringcat_engine::declared::{GroupId, SubDeviceId};
use ringcat_engine::info::Direction;
use ringcat_engine::layout::LrwPolicy;
use ringcat_engine::main_device::{Declaration, DomainConfig, DomainMember, Required};
use ringcat_engine::{JunctionConnection, JunctionMode};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;

use super::commands;
use super::model::{self, CheckRevision, Junctions, Lrw, NetworkFile, Repeat, SubDevice, SyncManager, Target};
use super::stated::stated;
use super::unique::Names;
use super::values::{Shift, Time};
use super::write::next_position;
use crate::compare::StatedProperties;
use crate::configuration::{Configuration, DeclaredRings, ImageArea, ProcessImage, SubDeviceFacts, Variable};
use crate::eni::Port;
use crate::follow::{HIGH_WORD, LOW_WORD};

/// Parts of the name of a variable are separated by this.
const SEPARATOR: char = '.';

impl NetworkFile {
    /// The declaration of the network, the process image and its variables.
    ///
    /// A file that [`NetworkFile::read`] has accepted has one; in a file that the application has changed, names that
    /// it lacks are ignored.
    pub fn configuration(&self) -> Configuration {
        let index: HashMap<&str, usize> = (0..).zip(&self.subdevice).map(|(at, it)| (it.name.as_str(), at)).collect();
        let mut declaration = Declaration::default().with_clocks(self.clocks(&index));
        declaration.subdevices = self.declared();
        declaration.domains = self.domains();
        declaration.lrw = match self.lrw {
            Lrw::Automatic => LrwPolicy::Automatic,
            Lrw::Always => LrwPolicy::Explicit,
            Lrw::PerSubdevice => LrwPolicy::PerSubDevice,
        };
        declaration.required = self.declared_required();
        let facts = |subdevice: &SubDevice| SubDeviceFacts {
            name: subdevice.name.clone(),
            station: None,
            plugged_into: subdevice.plugged_into.as_ref().and_then(|into| {
                let port = [Port::A, Port::B, Port::C, Port::D].get(usize::from(into.port)).copied()?;
                Some((*index.get(into.subdevice.as_str())?, port))
            }),
            net_id: None,
        };
        Configuration {
            declaration,
            subdevices: self.subdevice.iter().map(facts).collect(),
            groups: self.configs().0,
            image: self.image(),
            cycle: self.domain.iter().map(|domain| domain.period.0).min(),
            notices: Vec::new(),
            rings: DeclaredRings {
                is_ring: self.redundancy.ring,
                junctions: self.junction_mode(),
                connections: self.junction_connections(),
            },
        }
    }

    /// The SubDevices as declared.
    pub(super) fn declared(&self) -> Vec<SubDeviceConfig> {
        let (_, mut configs) = self.configs();
        for (config, subdevice) in configs.iter_mut().zip(&self.subdevice) {
            fill(config, subdevice);
        }
        configs
    }

    /// The absent SubDevices that prevent the activation.
    pub(super) const fn declared_required(&self) -> Required {
        match self.required {
            model::Required::All => Required::All,
            model::Required::Mandatory => Required::Mandatory,
            model::Required::Nothing => Required::Nothing,
        }
    }

    /// How rings behind junctions are handled.
    pub fn junction_mode(&self) -> JunctionMode {
        match self.redundancy.junctions {
            Junctions::Disabled => JunctionMode::Disabled,
            Junctions::Automatic => JunctionMode::Automatic,
            Junctions::Strict => JunctionMode::Strict,
        }
    }

    /// The connections of rings behind junctions.
    pub fn junction_connections(&self) -> Vec<JunctionConnection> {
        let index = |name: &str| self.subdevice.iter().position(|subdevice| subdevice.name == name).map(SubDeviceId);
        let connections = self.redundancy.connection.iter().filter_map(|it| {
            Some(JunctionConnection::new(index(&it.head)?, it.head_port, index(&it.tail)?, it.tail_port))
        });
        connections.collect()
    }

    /// What the file states of each SubDevice besides the declaration, for
    /// [`Configuration::differences`](crate::Configuration::differences).
    pub fn stated(&self) -> Vec<StatedProperties> {
        self.subdevice.iter().map(stated).collect()
    }

    /// Names of the groups, and the SubDevices at their places.
    fn configs(&self) -> (Vec<String>, Vec<SubDeviceConfig>) {
        let mut groups: Vec<String> = Vec::new();
        let mut head = ConfigAddress::Position(0);
        let (mut behind, mut position) = (0, 0);
        let mut configs = Vec::with_capacity(self.subdevice.len());
        for subdevice in &self.subdevice {
            let own = address(subdevice).unwrap_or(ConfigAddress::Position(position));
            let mut config = SubDeviceConfig::at(own);
            if let Some(group) = &subdevice.group {
                if groups.last() == Some(group) {
                    behind += 1;
                    config.address = head.behind(behind);
                } else {
                    groups.push(group.clone());
                    (head, behind) = (own, 0);
                }
                config.group = Some(GroupId(groups.len() - 1));
            }
            config.optional = subdevice.optional || subdevice.group.is_some();
            position = next_position(position, subdevice);
            configs.push(config);
        }
        (groups, configs)
    }

    fn clocks(&self, index: &HashMap<&str, usize>) -> Option<ClockConfig> {
        let of = self.clocks.as_ref()?;
        let reference = of.reference.as_deref().and_then(|name| index.get(name));
        let default = ClockConfig::default();
        let (sync_window, lock_window) = (default.sync_window_ns, default.lock_window_ns);
        let lock_limit = default.lock_limit;
        let config = default
            .with_reference(
                reference.map_or(ReferenceClock::default(), |at| ReferenceClock::Declared(SubDeviceId(*at))),
            )
            .with_bus_shift(of.bus_shift)
            .with_sync_window_ns(of.sync_window_ns.unwrap_or(sync_window))
            .with_lock_window_ns(of.lock_window_ns.unwrap_or(lock_window))
            .with_lock_limit(of.lock_limit.map_or(lock_limit, |limit| limit.0))
            .with_estimated_delays(of.estimate_delays);
        Some(if of.go_on_unlocked { config.with_when_unlocked(WhenUnlocked::GoOn) } else { config })
    }

    fn domains(&self) -> Vec<DomainConfig> {
        let first = self.domain.first().map(|domain| domain.name.as_str());
        let domain = |domain: &model::Domain| {
            let member = |(at, subdevice): (usize, &SubDevice)| member(at, subdevice, &domain.name, first);
            let members = self.subdevice.iter().enumerate().filter_map(member).collect();
            DomainConfig::new(domain.period.0, members)
                .with_under_way(domain.under_way)
                .with_sends_again(domain.send_again)
        };
        self.domain.iter().map(domain).collect()
    }

    /// The process image: the SyncManagers with known PDOs, and the entries with names.
    fn image(&self) -> ProcessImage {
        let mut image = ProcessImage::default();
        let mut names = Names::default();
        for (at, subdevice) in self.subdevice.iter().enumerate() {
            for sync_manager in subdevice.sync_manager.iter().filter(|it| bits_of(it).is_some_and(|bits| bits > 0)) {
                area(&mut image, &mut names, at, subdevice, sync_manager);
            }
        }
        image.areas.sort_by_key(|area| (area.direction == Direction::Inputs, area.image_bit));
        image
    }
}

/// Bits of a SyncManager's process data; `None` if the file leaves the entries of a PDO to the SII.
fn bits_of(sync_manager: &SyncManager) -> Option<u32> {
    let bits = sync_manager
        .pdo
        .iter()
        .map(|pdo| pdo.entries.as_ref().map(|entries| entries.iter().map(|entry| u32::from(entry.bits)).sum::<u32>()));
    bits.sum()
}

/// Appends the process data of a SyncManager to its image.
fn area(image: &mut ProcessImage, names: &mut Names, at: usize, subdevice: &SubDevice, sync_manager: &SyncManager) {
    let direction = direction(sync_manager);
    let length = match direction {
        Direction::Inputs => &mut image.inputs_len,
        Direction::Outputs => &mut image.outputs_len,
    };
    let bits = bits_of(sync_manager).unwrap_or(0);
    let image_bit = (*length * 8) as u32;
    *length += bits.div_ceil(8) as usize;
    let number = Some(sync_manager.number);
    image.areas.push(ImageArea { subdevice: at, direction, sync_manager: number, bit_offset: 0, image_bit, bits });
    let mut bit = image_bit;
    for pdo in &sync_manager.pdo {
        for entry in pdo.entries.iter().flatten() {
            let bits = u32::from(entry.bits);
            if entry.index != 0 {
                let own = match entry.name.is_empty() {
                    false => entry.name.clone(),
                    true => format!("{:04x}:{:02x}", entry.index, entry.sub),
                };
                let parts = [subdevice.name.as_str(), pdo.name.as_str(), own.as_str()];
                let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
                image.variables.push(Variable {
                    name: names.unique(parts.join(&SEPARATOR.to_string())),
                    data_type: entry.data_type.clone(),
                    direction,
                    image_bit: bit,
                    bits,
                    subdevice: Some(at),
                });
            }
            bit += bits;
        }
    }
}

const fn direction(sync_manager: &SyncManager) -> Direction {
    match sync_manager.direction {
        model::Direction::Outputs => Direction::Outputs,
        model::Direction::Inputs => Direction::Inputs,
    }
}

/// The place that a SubDevice names.
fn address(subdevice: &SubDevice) -> Option<ConfigAddress> {
    let offset = subdevice.offset.unwrap_or(0);
    let alias = subdevice.alias.map(|alias| ConfigAddress::Alias { alias, offset });
    let identification = subdevice.identification.map(|value| match subdevice.identification_word {
        Some(word) => ConfigAddress::DataWord { register: RegisterAddress(word), value, offset },
        None => ConfigAddress::Identification { value, offset },
    });
    subdevice.position.map(ConfigAddress::Position).or(alias).or(identification)
}

/// The part of a SubDevice in a domain: SyncManagers name their domain, others have that of the SubDevice.
fn member(at: usize, subdevice: &SubDevice, domain: &str, first: Option<&str>) -> Option<DomainMember> {
    let own = subdevice.domain.as_deref().or(first);
    let is_own = own == Some(domain);
    let member = DomainMember::new(SubDeviceId(at));
    if subdevice.sync_manager.iter().all(|it| it.domain.is_none()) {
        return is_own.then_some(member);
    }
    let here = |it: &&SyncManager| it.domain.as_deref().map_or(is_own, |name| name == domain);
    let numbers: Vec<u8> = subdevice.sync_manager.iter().filter(here).map(|it| it.number).collect();
    (!numbers.is_empty()).then(|| member.with_sync_managers(numbers))
}

/// Everything besides the place.
fn fill(config: &mut SubDeviceConfig, of: &SubDevice) {
    config.expected.vendor_id = of.vendor;
    config.expected.product_code = of.product;
    let expected = &mut config.expected;
    match of.check_revision {
        CheckRevision::None => {}
        CheckRevision::Equal => expected.revision = of.revision,
        CheckRevision::EqualOrGreater => expected.minimum_revision = of.revision,
        CheckRevision::LowEqual => (expected.revision, expected.revision_mask) = (of.revision, LOW_WORD),
        CheckRevision::LowEqualHighEqualOrGreater => {
            (expected.revision, expected.revision_mask) = (of.revision, LOW_WORD);
            expected.minimum_revision = of.revision;
        }
        CheckRevision::HighEqual => (expected.revision, expected.revision_mask) = (of.revision, HIGH_WORD),
        CheckRevision::HighEqualLowEqualOrGreater => {
            (expected.revision, expected.revision_mask) = (of.revision, HIGH_WORD);
            expected.minimum_revision = of.revision;
        }
    }
    config.expected.serial = of.serial;
    config.expected.identification = of.check_identification;
    config.watchdog_divider = of.watchdog_divider;
    config.watchdog_intervals = of.watchdog_process_data;
    config.pdi_watchdog_intervals = of.watchdog_pdi;
    config.sii_to_pdi = of.eeprom_to_pdi;
    config.wait_before_safeop = of.wait_before_safeop.map_or(Duration::ZERO, |time| time.0);
    config.sync = of.sync.as_ref().map(signals);
    config.repetition = match of.repeat {
        Repeat::Automatic => Repetition::Automatic,
        Repeat::Everything => Repetition::Everything,
        Repeat::Inputs => Repetition::Inputs,
        Repeat::Nothing => Repetition::Nothing,
    };
    config.passage = of.passage.map(|passage| Passage::new(passage.processing_ns, passage.forwarding_ns));
    config.timeouts = timeouts(&of.timeouts);
    config.target = match of.target {
        Target::Init => AlState::Init,
        Target::Preop => AlState::PreOp,
        Target::Safeop => AlState::SafeOp,
        Target::Op => AlState::Op,
    };
    config.startup = of.startup.iter().filter_map(commands::command).collect();
    let with_pdos = of.sync_manager.iter().filter(|it| !it.pdo.is_empty() || it.length.is_none());
    let assignments: Vec<PdoAssignment> = with_pdos.map(assignment).collect();
    config.pdos = (!assignments.is_empty()).then_some(assignments);
    for it in &of.sync_manager {
        if let Some(is_on) = it.watchdog {
            let watchdog = if is_on { Watchdog::On } else { Watchdog::Off };
            *config = std::mem::take(config).sync_manager(it.number, direction(it), watchdog);
        }
    }
}

fn assignment(of: &SyncManager) -> PdoAssignment {
    PdoAssignment::new(of.number, direction(of), of.pdo.iter().map(mapping).collect())
}

pub(super) fn mapping(pdo: &model::Pdo) -> PdoMapping {
    let mapping = match &pdo.entries {
        None => PdoMapping::from_sii(pdo.index),
        Some(entries) => {
            let entries = entries.iter().map(|entry| PdoEntry::new(entry.index, entry.sub, entry.bits));
            PdoMapping::of(pdo.index, entries.collect::<Vec<_>>())
        }
    };
    mapping.with_fixed(pdo.fixed)
}

impl From<SyncSignals> for model::Sync {
    fn from(of: SyncSignals) -> model::Sync {
        model::Sync {
            assign_activate: of.assign_activate,
            sync0_cycle: Shift(of.sync0_cycle_ns.into()),
            sync0_shift: Shift(of.sync0_shift_ns.into()),
            sync1_cycle: Shift(of.sync1_cycle_ns.into()),
            sync1_shift: Shift(of.sync1_shift_ns.into()),
        }
    }
}

fn signals(of: &model::Sync) -> SyncSignals {
    let unsigned = |shift: Shift| u32::try_from(shift.0).unwrap_or(0);
    let signed = |shift: Shift| i32::try_from(shift.0).unwrap_or(0);
    SyncSignals::sync0(unsigned(of.sync0_cycle), signed(of.sync0_shift))
        .with_assign_activate(of.assign_activate)
        .with_sync1(unsigned(of.sync1_cycle), signed(of.sync1_shift))
}

fn timeouts(of: &model::Timeouts) -> Timeouts {
    let mut timeouts = Timeouts::default();
    for (given, time) in [
        (of.preop, &mut timeouts.preop),
        (of.safeop_op, &mut timeouts.safeop_op),
        (of.back_to_init, &mut timeouts.back_to_init),
        (of.back_to_safeop, &mut timeouts.back_to_safeop),
        (of.mailbox_request, &mut timeouts.mailbox_request),
        (of.sdo, &mut timeouts.sdo),
        (of.soe, &mut timeouts.soe),
        (of.eoe, &mut timeouts.eoe),
    ] {
        if let Some(Time(given)) = given {
            *time = given;
        }
    }
    timeouts
}
