//! A scan on interfaces or of a simulated segment, for commands that only look at a network: `init`, `compare`.

use std::cell::RefCell;
use std::path::PathBuf;

use clap::Args;
use ringcat::config::Configuration;
use ringcat::esi::load_segment;
use ringcat::sim::network::Network;
use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{AlState, Event, JunctionError, Links, MainDevice, Options, Scan, SubDeviceInfo};

use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, LinkNames, SourceAddress};
use crate::modules::{self, Detected, Failed, List};
use crate::output::{complain, warn};
use crate::surroundings::Surroundings;
use crate::thread::ThreadArguments;
use crate::warnings::SiiWarnings;

/// Object with the version of the firmware (protocol 6.3, ETG.1000.6).
const FIRMWARE: u16 = 0x100A;

/// Where the network is.
#[derive(Args, Clone, Debug)]
pub struct BusArguments {
    /// Network interface of the main link
    #[arg(long, value_name = "IF", required_unless_present = "sim", conflicts_with = "sim", help_heading = "Links")]
    main: Option<String>,
    /// Network interface at the other end of a ring
    #[arg(long, value_name = "IF", requires = "main", help_heading = "Links")]
    redundant: Option<String>,
    /// A simulated segment from a segment file, in virtual time
    #[arg(long, value_name = "FILE.toml", help_heading = "Segment")]
    sim: Option<PathBuf>,
    /// Go on although another MainDevice uses the interface
    ///
    /// Its SubDevices then leave OP.
    #[arg(long, help_heading = "Links")]
    force: bool,
    #[command(flatten)]
    thread: ThreadArguments,
}

/// A network that was found.
#[derive(Debug)]
pub struct Bus {
    /// The scan.
    pub scan: Scan,
    /// Whether the scan used two links.
    pub ring: bool,
    /// Version of the firmware of each SubDevice, where it was read.
    pub firmware: Vec<Option<String>>,
    /// Idents of the modules in the slots of each SubDevice, where they were read.
    pub modules: Vec<Vec<u32>>,
    /// Idents of the modules of each SubDevice if its list was read completely.
    pub lists: Vec<Option<Vec<u32>>>,
    /// Whether each SubDevice has answered that it has no list of modules.
    pub unlisted: Vec<bool>,
    /// A declared ring behind a junction that does not close.
    pub not_closed: Option<JunctionError>,
    /// Faults of the SIIs, which are to be printed.
    pub warnings: SiiWarnings,
}

/// What is read of a SubDevice besides the scan.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// The version of its firmware.
    pub firmware: bool,
    /// The modules in its slots.
    pub modules: bool,
}

impl BusArguments {
    /// Scans. `declared` is the network that is expected: its rings behind junctions are tested. `wanted` decides what
    /// else is read from each SubDevice, which is brought to PREOP for this, and back to INIT.
    pub fn scan(
        &self,
        declared: Option<&Configuration>,
        wanted: impl FnOnce(&[SubDeviceInfo]) -> Vec<Wanted>,
    ) -> Result<Bus, Failure> {
        if let Some(path) = &self.sim {
            let segment = load_segment(path)?;
            let links = SimulatedSegment::new(Network::from_description(segment)?);
            let ring = links.addresses().redundant.is_some();
            return scan(links, Options::default(), ring, (declared, wanted), print);
        }
        let interfaces = InterfaceArguments {
            links: LinkNames { main: self.main.clone().unwrap_or_default(), redundant: self.redundant.clone() },
            source_address: SourceAddress::default(),
            max_datagrams: None,
            force: self.force,
        };
        let links = interfaces.open(self.thread)?;
        let mut surroundings = Surroundings::watch(&interfaces, &links);
        let _awake = self.thread.apply();
        scan(links, interfaces.options(), self.redundant.is_some(), (declared, wanted), |event| {
            match surroundings.note(&event.event) {
                None => print(event),
                Some(words) => words.into_iter().for_each(warn),
            }
        })
    }
}

fn print(event: &ringcat::TimedEvent) {
    match &event.event {
        Event::ScanProgress { .. } | Event::ScanFailed { .. } => {}
        _ => complain(describe(event, &Names::default())),
    }
}

fn scan<L: Links>(
    links: L,
    options: Options,
    ring: bool,
    (declared, wanted): (Option<&Configuration>, impl FnOnce(&[SubDeviceInfo]) -> Vec<Wanted>),
    mut on_event: impl FnMut(&ringcat::TimedEvent),
) -> Result<Bus, Failure> {
    let junctions = declared.map(|declared| declared.rings.junctions).unwrap_or_default();
    let mut main_device = MainDevice::request(links, &options.with_junctions(junctions));
    let mut warnings = SiiWarnings::default();
    let scan = main_device.scan_with(|event| {
        if !warnings.keep(event) {
            on_event(event);
        }
    });
    let mut scan = scan.inspect_err(|_| warnings.print(&[]))?;
    if let Some(declared) = declared {
        main_device.read_data_words(&declared.declaration.subdevices, &mut scan);
    }
    let not_closed = declared.and_then(|declared| not_closed(&mut main_device, declared));
    let (mut firmware, mut modules, mut lists, mut unlisted) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (info, wanted) in scan.subdevices.iter().zip(wanted(&scan.subdevices)) {
        let has_objects = info.protocols.coe() && info.mailbox.is_some();
        let wanted = if has_objects { wanted } else { Wanted::default() };
        let (version, detected) = read_besides(&mut main_device, info, wanted);
        detected.warn_of(info);
        firmware.push(version);
        lists.push(detected.whole().map(<[u32]>::to_vec));
        unlisted.push(detected.list == List::Missing || !has_objects);
        modules.push(detected.idents);
    }
    Ok(Bus { scan, ring, firmware, modules, lists, unlisted, not_closed, warnings })
}

/// A declared ring behind a junction that does not close, by the test of an activation.
fn not_closed<L: Links>(main_device: &mut MainDevice<L>, declared: &Configuration) -> Option<JunctionError> {
    if declared.rings.connections.is_empty() {
        return None;
    }
    // Errors of the file itself are reported as other differences.
    main_device.load(declared.declaration.clone()).ok()?;
    for connection in &declared.rings.connections {
        main_device.add_junction_connection(*connection).ok()?;
    }
    main_device.check_connections().err()
}

/// Version of the firmware and idents of modules, read in PREOP; it is in INIT afterwards. A SubDevice that does not
/// answer is reported.
pub fn read_besides<L: Links>(
    main_device: &mut MainDevice<L>,
    info: &SubDeviceInfo,
    wanted: Wanted,
) -> (Option<String>, Detected) {
    if !wanted.firmware && !wanted.modules {
        return (None, Detected::default());
    }
    let position = info.position;
    let read = main_device.subdevice(position).request_state(AlState::PreOp).map(|()| {
        let firmware = wanted.firmware.then(|| main_device.subdevice(position).sdo_read::<String>(FIRMWARE, 0));
        let firmware = firmware.and_then(|read| read.map_err(warn).ok());
        if !wanted.modules {
            return (firmware, Detected::default());
        }
        let main_device = RefCell::new(&mut *main_device);
        let begin = main_device.borrow().now();
        let modules = modules::detected(
            || main_device.borrow().now().since(begin),
            |limit| {
                main_device
                    .borrow_mut()
                    .subdevice(position)
                    .within(limit)
                    .sdo_read(modules::DETECTED, 0)
                    .map_err(Failed::from)
            },
            |slot, limit| {
                main_device
                    .borrow_mut()
                    .subdevice(position)
                    .within(limit)
                    .sdo_read(modules::DETECTED, slot)
                    .map_err(Failed::from)
            },
        );
        (firmware, modules)
    });
    if let Err(error) = main_device.subdevice(position).request_state(AlState::Init) {
        warn(error);
    }
    read.map_err(warn).unwrap_or_default()
}
