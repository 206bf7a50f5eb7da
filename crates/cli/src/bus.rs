//! A scan on interfaces or of a simulated segment, for commands that only look at a network: `init`, `compare`.

use std::path::PathBuf;

use clap::Args;
use ringcat::esi::load_segment;
use ringcat::sim::network::Network;
use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{AlState, Event, Links, MainDevice, Options, Scan, SubDeviceInfo};

use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, LinkNames, SourceAddress};
use crate::output::warn;
use crate::surroundings::Surroundings;
use crate::thread::ThreadArguments;

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
    /// It has two links.
    pub ring: bool,
    /// Version of the firmware of each SubDevice, where it was read.
    pub firmware: Vec<Option<String>>,
}

impl BusArguments {
    /// Scans. `reads_firmware` decides of which SubDevices the version of the firmware is read; they go to PREOP and
    /// back to INIT.
    pub fn scan(&self, reads_firmware: impl Fn(&SubDeviceInfo) -> bool) -> Result<Bus, Failure> {
        if let Some(path) = &self.sim {
            let segment = load_segment(path)?;
            let links = SimulatedSegment::new(Network::from_description(segment)?);
            let ring = links.addresses().redundant.is_some();
            return scan(links, &Options::default(), ring, reads_firmware, print);
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
        scan(links, &interfaces.options(), self.redundant.is_some(), reads_firmware, |event| {
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
        _ => eprintln!("{}", describe(event, &Names::default())),
    }
}

fn scan<L: Links>(
    links: L,
    options: &Options,
    ring: bool,
    reads_firmware: impl Fn(&SubDeviceInfo) -> bool,
    on_event: impl FnMut(&ringcat::TimedEvent),
) -> Result<Bus, Failure> {
    let mut main_device = MainDevice::request(links, options);
    let scan = main_device.scan_with(on_event)?;
    let mut firmware = Vec::with_capacity(scan.subdevices.len());
    for info in &scan.subdevices {
        let is_wanted = info.protocols.coe() && info.mailbox.is_some() && reads_firmware(info);
        firmware.push(if is_wanted { read_firmware(&mut main_device, info) } else { None });
    }
    Ok(Bus { scan, ring, firmware })
}

/// The version of the firmware; a SubDevice that does not answer is reported.
fn read_firmware<L: Links>(main_device: &mut MainDevice<L>, info: &SubDeviceInfo) -> Option<String> {
    let position = info.position;
    let read = main_device
        .subdevice(position)
        .request_state(AlState::PreOp)
        .and_then(|()| main_device.subdevice(position).sdo_read::<String>(FIRMWARE, 0));
    if let Err(error) = main_device.subdevice(position).request_state(AlState::Init) {
        warn(error);
    }
    read.map_err(warn).ok()
}
