//! Effects of the incidents, measured inside the simulated devices and on the interfaces of both controllers.
//!
//! In: the segment, after each cycle or less. Out: per SubDevice the longest time between outputs in each incident,
//! changes of its state, watchdogs that expired; outputs that were older than those before; how long both controllers
//! have sent.

use std::time::Duration;

use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::controller::LogicalAccess;
use ringcat::sim::device::Device;
use ringcat::sim::network::Network;
use ringcat::sim::network::host_log::HostFrame;
use ringcat::sim::time::SimTime;
use ringcat::wire::al::{AlState, AlStatus};
use ringcat::wire::register::map;

use super::super::drive::Drive;
use super::super::watch::{device_at, pattern};
use super::controller::{Place, number_at};

/// Outputs may be taken up to this many cycles after the beginning of their cycle.
const MAX_AGE: i64 = 3;
/// Most faults that are described; further ones are only counted.
const DESCRIBED: usize = 3;

/// A SubDevice.
#[derive(Debug)]
pub struct Watched {
    /// The simulated device.
    pub device: DeviceIndex,
    place: Place,
    /// The last access that is known.
    known: SimTime,
    /// When it took outputs last; without outputs, when inputs were read.
    last: Option<SimTime>,
    newest: Newest,
    status: AlStatus,
    expired: u8,
    /// It is a drive, and was enabled.
    pub was_enabled: bool,
    /// Longest time between outputs, per incident; empty without process data.
    pub longest: Vec<Duration>,
    /// New target positions that a drive has taken, per incident.
    targets: Vec<u32>,
    /// Changes of its state.
    pub state_changes: u32,
    /// Watchdogs that expired.
    pub watchdogs: u32,
}

/// The newest outputs that a SubDevice has taken.
#[derive(Clone, Copy, Debug, Default)]
struct Newest {
    /// The number of their cycle.
    cycle: Option<i64>,
    /// Target position of a drive.
    target: Option<i32>,
}

/// Watches all SubDevices and both controllers.
#[derive(Debug)]
pub struct Measurement {
    cycle: Duration,
    identities: [[u8; 3]; 2],
    /// The SubDevices.
    pub watched: Vec<Watched>,
    incidents: usize,
    /// When each host sent a frame of its own last.
    sent: [Option<SimTime>; 2],
    together_since: Option<SimTime>,
    /// Longest time for which both controllers have sent.
    pub together: Duration,
    /// Outputs that were checked.
    pub checked: u64,
    /// Outputs that were older than those before, or older than allowed.
    pub outdated: u64,
    /// How often a drive was not enabled that had been enabled before.
    pub disabled: u64,
    /// Texts of the first faults.
    pub described: Vec<String>,
}

impl Measurement {
    /// Begins now, with these areas of process data.
    pub fn new(network: &mut Network, places: &[Place], cycle: Duration, identities: [[u8; 3]; 2]) -> Measurement {
        // What was logged before belongs to no incident.
        drop(network.take_host_log());
        let watched = places.iter().enumerate().map(|(position, place)| {
            let device = device_at(network, position);
            Watched::new(network.device(device), device, place.clone())
        });
        Measurement {
            cycle,
            identities,
            watched: watched.collect(),
            incidents: 0,
            sent: [None; 2],
            together_since: None,
            together: Duration::ZERO,
            checked: 0,
            outdated: 0,
            disabled: 0,
            described: Vec::new(),
        }
    }

    /// An incident begins; times between outputs that end from now on belong to it.
    pub fn begin(&mut self) {
        self.incidents += 1;
        let areas = |place: &Place| place.outputs.len() + place.inputs.len();
        for watched in self.watched.iter_mut().filter(|watched| areas(&watched.place) > 0) {
            watched.longest.push(Duration::ZERO);
        }
        self.watched.iter_mut().filter(|watched| watched.is_drive()).for_each(|drive| drive.targets.push(0));
    }

    /// Evaluates everything since the last call, and gives the SubDevices new inputs.
    pub fn look(&mut self, network: &mut Network) {
        for frame in network.take_host_log() {
            self.frame(&frame);
        }
        let number = number_at(network.now().0, self.cycle);
        let mut watched = std::mem::take(&mut self.watched);
        for (position, it) in watched.iter_mut().enumerate() {
            self.look_at(network, position, it);
            if it.place.drive.is_none() && !it.place.inputs.is_empty() {
                let device = network.device_mut(it.device);
                let length = device.inputs().len();
                let bytes: Vec<u8> = (0..length).map(|at| pattern(number.into(), position, at)).collect();
                device.set_inputs(&bytes);
            }
        }
        self.watched = watched;
    }

    fn look_at(&mut self, network: &Network, position: usize, it: &mut Watched) {
        let (device, now) = (network.device(it.device), network.now());
        let status = device.al_status();
        if status != it.status {
            it.state_changes += 1;
            let (from, code) = (std::mem::replace(&mut it.status, status), device.al_status_code());
            self.describe(|| format!("SubDevice {position}: {from} to {status}, {code}"));
        }
        let expired = expired(device);
        it.watchdogs += u32::from(expired.wrapping_sub(std::mem::replace(&mut it.expired, expired)));
        let known = it.known;
        for access in device.controller.logical_accesses().filter(|access| access.is_valid && access.at > known) {
            it.known = access.at;
            if it.place.outputs.is_empty() {
                if access.read {
                    it.note(access.at);
                }
            } else if access.written {
                it.note(access.at);
                self.outputs(position, it, access);
            }
        }
        // If a SubDevice takes no more outputs, the time since the last ones counts.
        if let (Some(longest), Some(last)) = (it.longest.last_mut(), it.last) {
            *longest = (*longest).max(now - last);
        }
        if let Some((_, at)) = it.place.drive {
            let word = device.inputs().get(at..at + 2).map_or(0, |word| u16::from_le_bytes([word[0], word[1]]));
            if Drive::is_enabled(word) {
                it.was_enabled = true;
            } else {
                // A drive that is not enabled has its own position as target.
                it.newest.target = None;
                if it.was_enabled {
                    self.disabled += 1;
                    self.describe(|| format!("drive {position} is not enabled: statusword {word:#06x}"));
                }
            }
        }
    }

    /// Outputs that a SubDevice has taken: none is older than one before, nor than a few cycles.
    fn outputs(&mut self, position: usize, it: &mut Watched, access: &LogicalAccess) {
        let now = (access.at.0 / self.cycle.as_nanos().max(1) as u64) as i64;
        for moved in access.moved.iter().filter(|moved| moved.write) {
            let bytes = access.data.get(moved.at..moved.at + moved.len).unwrap_or_default();
            self.checked += 1;
            let before = it.newest.target;
            let fault = match it.place.drive {
                Some((at, _)) => it.newest.target_fault(bytes, at),
                None => it.newest.cycle_fault(bytes, now),
            };
            if let Some(targets) = it.targets.last_mut() {
                *targets += u32::from(it.newest.target != before);
            }
            if let Some(fault) = fault {
                self.outdated += 1;
                self.describe(|| format!("outputs of SubDevice {position} {fault}, at {}", access.at));
            }
        }
    }

    /// Processes a frame on an interface of a controller. A controller that sends frames of its own is ACTIVE.
    fn frame(&mut self, frame: &HostFrame) {
        let host = frame.link.host();
        if !frame.is_sent || frame.head[9..12] != self.identities[host as usize] {
            return;
        }
        self.sent[host as usize] = Some(frame.at);
        // An ACTIVE sends in each cycle.
        let other_sends = self.sent[host.other() as usize].is_some_and(|last| frame.at - last <= self.cycle);
        if !other_sends {
            self.together_since = None;
            return;
        }
        let since = *self.together_since.get_or_insert(frame.at);
        self.together = self.together.max(frame.at - since);
    }

    fn describe(&mut self, words: impl FnOnce() -> String) {
        if self.described.len() < DESCRIBED {
            self.described.push(words());
        }
    }

    /// Whether all SubDevices are in OP.
    pub fn all_in_op(&self) -> bool {
        self.watched.iter().all(|it| it.status == AlStatus::new(AlState::Op))
    }

    /// Longest time between outputs in an incident, over all SubDevices.
    pub fn longest(&self, incident: usize) -> Duration {
        self.watched.iter().filter_map(|it| it.longest.get(incident).copied()).max().unwrap_or_default()
    }
}

impl Watched {
    fn new(device: &Device, index: DeviceIndex, place: Place) -> Watched {
        Watched {
            device: index,
            place,
            known: device.controller.logical_accesses().map(|access| access.at).last().unwrap_or_default(),
            last: None,
            newest: Newest::default(),
            status: device.al_status(),
            expired: expired(device),
            was_enabled: false,
            longest: Vec::new(),
            targets: Vec::new(),
            state_changes: 0,
            watchdogs: 0,
        }
    }

    /// Whether it has outputs.
    pub fn has_outputs(&self) -> bool {
        !self.place.outputs.is_empty()
    }

    /// Incidents in which a drive has taken no new target position.
    pub fn still(&self) -> usize {
        self.targets.iter().filter(|targets| **targets == 0).count()
    }

    /// Whether it is a drive.
    pub fn is_drive(&self) -> bool {
        self.place.drive.is_some()
    }

    /// It has taken outputs, or inputs were read.
    fn note(&mut self, at: SimTime) {
        let before = self.last.replace(at);
        if let (Some(longest), Some(before)) = (self.longest.last_mut(), before) {
            *longest = (*longest).max(at - before);
        }
    }
}

impl Newest {
    /// What is wrong with outputs that have as much of the number of their cycle as fits in, taken in cycle `now`.
    fn cycle_fault(&mut self, outputs: &[u8], now: i64) -> Option<String> {
        let age = match outputs {
            [byte] => i64::from((now as u8).wrapping_sub(*byte) as i8),
            [low, high, ..] => i64::from((now as u16).wrapping_sub(u16::from_le_bytes([*low, *high])) as i16),
            [] => return None,
        };
        let cycle = now - age;
        let before = self.cycle.replace(cycle).unwrap_or(cycle);
        if cycle < before {
            return Some(format!("go back by {} cycles", before - cycle));
        }
        (!(0..=MAX_AGE).contains(&age)).then(|| format!("are {age} cycles old"))
    }

    /// What is wrong with outputs of a drive that has its target position at this byte.
    fn target_fault(&mut self, outputs: &[u8], at: usize) -> Option<String> {
        let target = i32::from_le_bytes(*outputs.get(at..)?.first_chunk()?);
        let before = self.target.replace(target).unwrap_or(target);
        let back = before.wrapping_sub(target);
        (back > 0).then(|| format!("go back from target {before} to {target}"))
    }
}

/// Watchdogs of process data that have expired, as the SubDevice counts them.
fn expired(device: &Device) -> u8 {
    device.controller.register(map::WATCHDOG_COUNTER_PROCESS_DATA, 1).first().copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use ringcat::sim::cable::Host;
    use ringcat::sim::catalogue;

    use super::*;

    // covers: demo, standby
    #[test]
    fn outputs_that_go_back_or_are_too_old_are_found() {
        let mut newest = Newest::default();
        assert_eq!(newest.cycle_fault(&[0x10, 0x01, 0x10], 0x10110), None, "one cycle old");
        assert_eq!(newest.cycle_fault(&[0x10, 0x01], 0x10110), None, "the same again");
        let back = newest.cycle_fault(&[0x0F, 0x01], 0x10110);
        assert_eq!(back.as_deref(), Some("go back by 1 cycles"));
        let old = Newest::default().cycle_fault(&[0xF0], 0x1F4);
        assert_eq!(old.as_deref(), Some("are 4 cycles old"));
        let early = Newest::default().cycle_fault(&[0x02], 0x01);
        assert_eq!(early.as_deref(), Some("are -1 cycles old"), "of a cycle that has not begun");
        assert!(Newest::default().cycle_fault(&[0x00, 0x00], 0x5000).is_some(), "zeros are an old cycle");
        let mut drive = Newest::default();
        let mut take = |target: i32| drive.target_fault(&[&[0x0F, 0][..], &target.to_le_bytes()].concat(), 2);
        assert_eq!(
            (take(i32::MAX - 1), take(i32::MAX), take(i32::MIN)),
            (None, None, None),
            "the position wraps around"
        );
        assert!(take(i32::MAX).is_some_and(|fault| fault.starts_with("go back from target")));
    }

    // covers: demo, standby
    #[test]
    fn a_drive_that_gets_no_new_target_in_an_incident_is_found() {
        let device = Device::new(catalogue::by_name("servo").expect("it is in the catalogue"));
        let place = Place { drive: Some((0, 0)), ..Place::default() };
        let mut drive = Watched::new(&device, DeviceIndex(0), place);
        drive.targets = vec![3, 1];
        assert_eq!(drive.still(), 0);
        drive.targets.push(0);
        assert_eq!(drive.still(), 1);
    }

    // covers: demo, standby, MR-10
    #[test]
    fn both_controllers_send_from_the_first_frame_of_the_second_one_on() {
        let identities = [[0, 0x53, 0x01], [0, 0x53, 0x11]];
        let mut network = Network::new(Vec::new(), Vec::new(), Default::default()).expect("it is empty");
        let mut measurement = Measurement::new(&mut network, &[], Duration::from_millis(1), identities);
        let mut send = |us: u64, host: Host, is_sent: bool| {
            let mut head = [0; 26];
            head[9..12].copy_from_slice(&identities[host as usize]);
            measurement.frame(&HostFrame { at: SimTime::from_micros(us), link: host.main(), is_sent, head });
            measurement.together
        };
        assert_eq!(send(0, Host::First, true), Duration::ZERO);
        assert_eq!(send(100, Host::Second, false), Duration::ZERO, "it was received");
        assert_eq!(send(400, Host::Second, true), Duration::ZERO);
        assert_eq!(send(1_000, Host::Second, true), Duration::from_micros(600), "the first one has sent a cycle ago");
        assert_eq!(send(1_400, Host::Second, true), Duration::from_micros(600), "it is the only one now");
    }
}
