//! The checker of the demonstration: runs the cycles with an application of its own, and compares the process image
//! with the simulated devices.
//!
//! Outputs: every cycle all output bytes change; one cycle later each device in OP must hold the bytes that were sent.
//! Inputs: what each device offers is noted before a frame passes; the image must show just that one cycle later.

use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::network::Network;
use ringcat::simulated::SimulatedSegment;
use ringcat::wire::al::{AlState, AlStatus};
use ringcat::wire::register::map;
use ringcat::{Application, Direction, DomainId, DomainState, DomainStatus, Freshness, ProcessData, SubDeviceId};

use super::drive::Drive;
use super::incident::Incident;

/// The only domain.
const DOMAIN: DomainId = DomainId(0);
/// Most disagreements that are described; further ones are only counted.
const DESCRIBED: usize = 5;

/// What was counted since an incident.
#[derive(Clone, Debug)]
pub struct Account {
    /// The incident.
    pub incident: Incident,
    /// Cycles.
    pub cycles: u64,
    /// Cycles in which SubDevices that have power did not answer: the working counter lacked more than the one without.
    pub incomplete: u64,
    /// Of the others, cycles in which inputs were held back because it was not known yet which SubDevice is missing.
    pub held_back: u64,
    /// Of the others, cycles that lacked just the SubDevice without power.
    pub without_one: u64,
}

/// A SubDevice's process data.
#[derive(Clone, Debug)]
struct Place {
    device: DeviceIndex,
    outputs: Vec<(usize, usize)>,
    inputs: Vec<(usize, usize)>,
    /// What the last frame to have passed carried.
    sent: Vec<u8>,
    /// What the frame that is under way carries.
    under_way: Vec<u8>,
    /// What the device offered when the last frame was sent.
    offered: Vec<u8>,
}

/// Runs cycles and keeps the accounts.
#[derive(Debug)]
pub struct Watch {
    places: Vec<Place>,
    /// One account per incident; before the first, nothing is checked.
    pub accounts: Vec<Account>,
    /// The SubDevice that lost its power, until it is back in OP.
    pub without_power: Option<usize>,
    /// SubDevices that left OP though they had power, with the status they had.
    pub left_op: Vec<(usize, AlStatus)>,
    /// Comparisons of outputs and inputs.
    pub compared: u64,
    /// Comparisons that failed.
    pub disagreements: u64,
    /// The first of them in words.
    pub described: Vec<String>,
    /// The drives among the SubDevices.
    pub drives: Vec<Drive>,
    last_complete: bool,
}

impl Watch {
    /// A checker of all declared SubDevices.
    pub fn new(application: &Application<SimulatedSegment>, count: usize) -> Watch {
        let places = (0..count).map(|subdevice| Place::new(application, subdevice)).collect();
        Watch {
            places,
            accounts: Vec::new(),
            without_power: None,
            left_op: Vec::new(),
            compared: 0,
            disagreements: 0,
            described: Vec::new(),
            drives: (0..count).filter_map(|subdevice| Drive::find(application, subdevice)).collect(),
            last_complete: false,
        }
    }

    /// Whether there is anything to compare.
    pub fn has_process_data(&self) -> bool {
        self.places.iter().any(|place| !(place.outputs.is_empty() && place.inputs.is_empty()))
    }

    /// The simulated device at a position.
    pub fn device(&self, position: usize) -> DeviceIndex {
        self.places[position].device
    }

    /// Opens the account of an incident.
    pub fn begin(&mut self, incident: Incident) {
        if let Incident::PowerOff { position, .. } = &incident {
            self.without_power = Some(*position);
        }
        self.accounts.push(Account { incident, cycles: 0, incomplete: 0, held_back: 0, without_one: 0 });
    }

    /// One cycle.
    pub fn cycle(&mut self, application: &mut Application<SimulatedSegment>) {
        let Watch { places, drives, .. } = self;
        let number = application.cyclic_counters().sent;
        let mut finding = Finding::default();
        let mut wrong_inputs = Vec::new();
        let without_power = self.without_power;
        application.cycle(|data| {
            finding.status = data.status(DOMAIN).unwrap_or_default();
            finding.missing =
                without_power.map_or(0, |subdevice| data.directory().contribution(SubDeviceId(subdevice)));
            for (subdevice, place) in places.iter_mut().enumerate() {
                let fresh = data.freshness(DOMAIN, SubDeviceId(subdevice)) == Freshness::Fresh;
                if !place.inputs.is_empty() {
                    finding.note(subdevice, fresh, without_power);
                    // Below SAFEOP a device offers nothing; it may have got there since.
                    if fresh && !place.offered.is_empty() {
                        finding.compared += 1;
                        let seen = gather(data.image(DOMAIN), &place.inputs);
                        if seen != place.offered {
                            wrong_inputs.push((subdevice, seen, place.offered.clone()));
                        }
                    }
                }
                place.write_pattern(data, number, subdevice);
            }
            for drive in drives {
                if without_power == Some(drive.subdevice) {
                    drive.note_absence();
                } else {
                    drive.cycle(data);
                }
                let place = &mut places[drive.subdevice];
                place.under_way = gather(data.image(DOMAIN), &place.outputs);
            }
        });
        if self.accounts.is_empty() {
            self.offer(application.links_mut().network_mut(), number);
            return;
        }
        self.compared += finding.compared;
        for (subdevice, seen, offered) in wrong_inputs {
            self.disagree(format!(
                "inputs of SubDevice {subdevice}: the device offered {offered:02x?}, seen {seen:02x?}"
            ));
        }
        self.keep_account(&finding);
        self.check_devices(application.links().network());
        self.offer(application.links_mut().network_mut(), number);
    }

    fn keep_account(&mut self, finding: &Finding) {
        self.last_complete = finding.all_with_power_answered();
        let Some(account) = self.accounts.last_mut() else { return };
        account.cycles += 1;
        if !finding.all_with_power_answered() {
            account.incomplete += 1;
        } else if finding.stale {
            account.held_back += 1;
        } else if finding.status.state != DomainState::Complete {
            account.without_one += 1;
        }
    }

    /// States and outputs of all devices, read inside the simulated device.
    fn check_devices(&mut self, network: &Network) {
        for subdevice in 0..self.places.len() {
            let device = network.device(self.places[subdevice].device);
            let status = device.al_status();
            let in_op = device.controller.is_powered() && status.al_state() == Some(AlState::Op) && !status.error;
            if self.without_power == Some(subdevice) {
                // Back in OP, but its first outputs there may still be under way.
                if in_op && self.accounts.last().is_some_and(|a| matches!(a.incident, Incident::PowerOn { .. })) {
                    self.without_power = None;
                }
                continue;
            }
            if !in_op {
                if !self.left_op.iter().any(|(known, _)| *known == subdevice) {
                    self.left_op.push((subdevice, status));
                }
                continue;
            }
            let place = &self.places[subdevice];
            if self.last_complete && !place.sent.is_empty() {
                self.compared += 1;
                if device.outputs() != place.sent {
                    let text = format!(
                        "outputs of SubDevice {subdevice}: sent {:02x?}, the device has {:02x?}",
                        place.sent,
                        device.outputs()
                    );
                    self.disagree(text);
                }
            }
        }
    }

    fn disagree(&mut self, text: String) {
        self.disagreements += 1;
        if self.described.len() < DESCRIBED {
            self.described.push(text);
        }
    }

    /// Gives every terminal new inputs and notes what the next frame will find, and what it carries.
    fn offer(&mut self, network: &mut Network, number: u64) {
        for (subdevice, place) in self.places.iter_mut().enumerate() {
            core::mem::swap(&mut place.sent, &mut place.under_way);
            if place.inputs.is_empty() {
                continue;
            }
            let device = network.device_mut(place.device);
            let length = device.inputs().len();
            let bytes: Vec<u8> = (0..length).map(|at| pattern(number, subdevice, at).wrapping_mul(3)).collect();
            device.set_inputs(&bytes);
            place.offered = device.inputs().to_vec();
        }
    }
}

/// What a cycle showed.
#[derive(Debug, Default)]
struct Finding {
    status: DomainStatus,
    /// What the SubDevice without power would add to the working counter.
    missing: u32,
    compared: u64,
    /// Inputs of a SubDevice with power are old.
    stale: bool,
}

impl Finding {
    fn note(&mut self, subdevice: usize, fresh: bool, without_power: Option<usize>) {
        if !fresh && without_power != Some(subdevice) {
            self.stale = true;
        }
    }

    /// The working counter lacks at most what the one without power would add.
    fn all_with_power_answered(&self) -> bool {
        (self.status.expected - self.missing..=self.status.expected).contains(&self.status.wkc)
    }
}

impl Place {
    fn new(application: &Application<SimulatedSegment>, subdevice: usize) -> Place {
        let areas = |direction| {
            let areas = application
                .directory()
                .areas(SubDeviceId(subdevice))
                .iter()
                .filter(move |area| area.direction == direction);
            areas.map(|area| (area.placed.image_offset as usize, usize::from(area.placed.area.length))).collect()
        };
        Place {
            device: device_at(application.links().network(), subdevice),
            outputs: areas(Direction::Outputs),
            inputs: areas(Direction::Inputs),
            sent: Vec::new(),
            under_way: Vec::new(),
            offered: Vec::new(),
        }
    }

    fn write_pattern(&mut self, data: &mut ProcessData<'_>, number: u64, subdevice: usize) {
        for (start, length) in &self.outputs {
            let bytes = data.outputs_mut(DOMAIN, *start..start + length).unwrap_or_default();
            for (at, byte) in bytes.iter_mut().enumerate() {
                *byte = pattern(number, subdevice, at);
            }
        }
        self.under_way = gather(data.image(DOMAIN), &self.outputs);
    }
}

/// A byte that differs from cycle to cycle and from SubDevice to SubDevice.
pub fn pattern(number: u64, subdevice: usize, at: usize) -> u8 {
    (number as u8).wrapping_add((subdevice as u8).wrapping_mul(31)).wrapping_add((at as u8).wrapping_mul(7))
}

fn gather(image: &[u8], areas: &[(usize, usize)]) -> Vec<u8> {
    areas.iter().flat_map(|(start, length)| &image[*start..start + length]).copied().collect()
}

/// The device that got the station address of a position: branches make its order differ from that of the file.
pub fn device_at(network: &Network, position: usize) -> DeviceIndex {
    let station = (ringcat::FIRST_STATION as usize + position) as u16;
    let has_it = |device: &ringcat::sim::device::Device| {
        device.controller.register(map::STATION_ADDRESS, 2) == station.to_le_bytes()
    };
    DeviceIndex(network.devices().position(has_it).unwrap_or(position))
}
