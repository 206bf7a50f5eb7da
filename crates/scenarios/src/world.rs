//! A MainDevice and a simulated segment in virtual time, with actions and faults.
//!
//! Every cycle writes new outputs, takes all events, compares images with devices ([`Mirror`]) and records devices that
//! left OP. A failing test prints the seed and the log.

mod faults;
mod journal;

use std::fmt::Display;
use std::ops::Range;
use std::time::Duration;

use ringcat::{
    Application, Declaration, Direction, DomainId, Error, Event, Instant, JunctionConnection, Links, MainDevice,
    Options, ProcessData, Scan, SubDeviceId, TimedEvent, automatic,
};
use ringcat_engine::mail::Mailbox;
use ringcat_engine::main_device::{Directory, Pending};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;

use self::journal::Journal;
pub use self::journal::Step;
use crate::check::{Delivery, Evaluated, Mirror};
use crate::once::Declared;
use crate::seeds;
use crate::tap::{Fingerprint, Tap};
use crate::truth::{Departure, Truth};

/// Default cycle time of scenarios.
pub const CYCLE: Duration = Duration::from_millis(1);
/// Largest segment that is checked inside the devices.
const MOST_LOGGED: usize = 80;
/// Limit of the virtual time of a scan.
const SCAN_LIMIT: Duration = Duration::from_secs(20);

/// A point in the history of a world.
#[derive(Clone, Copy, Debug)]
pub struct Mark {
    events: usize,
    evaluated: usize,
    steps: usize,
}

/// Engine, segment and time.
#[derive(Debug)]
pub struct World {
    seed: u64,
    application: Application<Tap>,
    /// Result of the scan.
    pub scan: Scan,
    devices: Vec<Option<DeviceIndex>>,
    mirror: Mirror,
    truth: Truth,
    journal: Journal,
    /// Bytes of outputs, by domain.
    outputs: Vec<Vec<Range<usize>>>,
    domains: usize,
    cycles: u64,
    /// Number of the application's last cycle.
    last_cycle: u64,
}

impl World {
    /// Scans, declares all found SubDevices in one domain at [`CYCLE`], activates.
    ///
    /// # Panics
    /// When scan or activation fail.
    pub fn new(seed: u64, network: Network) -> World {
        World::with(seed, network, &Options::default(), |scan| automatic(&scan.subdevices, CYCLE))
            .unwrap_or_else(|error| panic!("seed {seed}: {error}"))
    }

    /// As [`World::new`], and runs until all devices are in OP and the process data is complete.
    ///
    /// # Panics
    /// When this takes more than 5 s.
    pub fn in_op(seed: u64, network: Network) -> World {
        let mut world = World::new(seed, network);
        world.settle();
        world
    }

    /// Scans, declares, activates.
    ///
    /// # Errors
    /// As [`MainDevice::scan`] and [`MainDevice::activate`].
    pub fn with(
        seed: u64,
        network: Network,
        options: &Options,
        declare: impl FnOnce(&Scan) -> Declaration,
    ) -> Result<World, Error> {
        World::with_junctions(seed, network, options, declare, &[])
    }

    /// As [`World::with`], with connections of rings behind junctions.
    ///
    /// # Errors
    /// As [`World::with`], and [`MainDevice::add_junction_connection`].
    pub fn with_junctions(
        seed: u64,
        network: Network,
        options: &Options,
        declare: impl FnOnce(&Scan) -> Declaration,
        connections: &[JunctionConnection],
    ) -> Result<World, Error> {
        let mut network = network;
        if network.devices().len() <= MOST_LOGGED {
            let devices = (0..network.devices().len()).map(DeviceIndex);
            devices.for_each(|device| network.device_mut(device).controller.log_logical());
        }
        let mut tap = Tap::new(network);
        if seeds::has_arrival_times(seed) {
            tap.know_arrivals();
        }
        tap.set_limit(tap.now() + SCAN_LIMIT);
        let mut main_device = MainDevice::request(tap, options);
        let mut journal = Journal::default();
        let scan = main_device.scan_with(|event| journal.event(event.clone()))?;
        main_device.links_mut().set_limit(Instant::NEVER);
        let declaration = declare(&scan);
        let under_way = declaration.domains.iter().map(|domain| domain.under_way).max().unwrap_or(1);
        let once = declaration.subdevices.iter().map(Declared::of).collect();
        let (domains, declared) = (declaration.domains.len(), declaration.subdevices.len());
        main_device.load(declaration)?;
        connections.iter().try_for_each(|connection| main_device.add_junction_connection(*connection))?;
        let application = main_device.apply()?;
        let network = application.links().network();
        let devices: Vec<Option<DeviceIndex>> = Vec::new();
        let mirror = Mirror::new(application.directory(), &devices, domains);
        let truth = Truth::new(once, domains, under_way.into());
        journal.status = network.devices().map(|device| device.al_status()).collect();
        let outputs = output_ranges(application.directory(), domains, declared);
        let last_cycle = application.pace().cycles;
        let mut world =
            World { seed, application, scan, devices, mirror, truth, journal, outputs, domains, cycles: 0, last_cycle };
        world.recognise();
        Ok(world)
    }

    /// Determines the device of each declared SubDevice by its station address, and checks these devices from now on.
    pub fn recognise(&mut self) {
        self.devices = self.by_station(|_| true);
        let evaluated = self.mirror.evaluates_latched;
        self.mirror = Mirror::new(self.application.directory(), &self.devices, self.domains);
        self.mirror.evaluates_latched = evaluated;
        self.truth.follow(self.application.directory(), &self.devices);
    }

    /// The device of each declared SubDevice, by its station address.
    fn by_station(&self, counts: impl Fn(&Device) -> bool) -> Vec<Option<DeviceIndex>> {
        let network = self.application.links().network();
        let by_station: Vec<Option<u16>> = network.devices().map(|it| counts(it).then(|| station(it))).collect();
        let found = self.application.engine().stations();
        let of = |wanted: &ringcat_wire::address::StationAddress| {
            by_station.iter().position(|station| *station == Some(wanted.0)).map(DeviceIndex)
        };
        found.iter().map(of).collect()
    }

    /// Runs until all declared SubDevices are settled and all domains complete.
    ///
    /// # Panics
    /// When this takes more than 5 s.
    pub fn settle(&mut self) {
        self.until(Duration::from_secs(5), "everything settled and complete", |world| {
            let last = world.journal.evaluated.iter().rev().take(world.domains);
            world.application.all_settled()
                && world.journal.evaluated.len() >= world.domains
                && last.clone().all(|evaluated| evaluated.delivery == Delivery::Complete)
        });
    }

    /// One cycle.
    pub fn cycle(&mut self) {
        self.cycle_with(|_| ());
    }

    /// One cycle, with `work` after the pattern is written to all outputs.
    pub fn cycle_with<R>(&mut self, work: impl FnOnce(&mut ProcessData<'_>) -> R) -> R {
        let number = self.cycles;
        let mut due = Vec::new();
        let result = self.application.cycle(|data| {
            for (domain, outputs) in (0..).map(DomainId).zip(&self.outputs) {
                if data.is_due(domain) {
                    due.push((domain, data.status(domain).expect("it is declared")));
                    write_pattern(data, domain, outputs, number);
                }
            }
            work(data)
        });
        self.cycles += 1;
        let at = self.application.now();
        let (begun_at, sent) = (self.application.begun_at(), self.application.links_mut().take_departed());
        // Frames from before the beginning of this cycle belong to the last one, unless other cycles were between.
        let count = self.application.pace().cycles;
        let follows = count == std::mem::replace(&mut self.last_cycle, count) + 1;
        let (again, departed): (Vec<_>, Vec<_>) = sent.into_iter().partition(|(at, _)| follows && *at < begun_at);
        let marks =
            |sent: Vec<(Instant, (u8, u8))>| -> Departure { sent.into_iter().map(|(_, frame)| frame).collect() };
        let (again, departed) = (marks(again), marks(departed));
        self.truth.send_again(&again);
        self.mirror.was_sent_again = !again.is_empty();
        let network = self.application.links().network();
        for (domain, status) in due {
            self.truth.evaluate(status, domain, self.application.exchange(), network);
            let exchange = self.application.exchange();
            let delivery = self.mirror.evaluate(status, domain, exchange, network);
            if delivery != Delivery::None {
                let stale = self.mirror.stale(domain, exchange);
                self.journal.evaluate(Evaluated { domain, at, status, delivery, stale });
            }
            if exchange.status(domain).is_some_and(|now| now.skipped == status.skipped) {
                self.mirror.depart(domain, exchange, network);
                self.truth.depart(domain, &departed);
            }
        }
        self.journal.watch(at, network);
        let mut has_events = false;
        while let Some(event) = self.application.pop_event() {
            has_events = true;
            self.journal.event(event);
        }
        if has_events {
            let devices = self.by_station(|device| device.controller.is_powered());
            self.truth.follow(self.application.directory(), &devices);
        }
        result
    }

    /// Some cycles.
    pub fn run_cycles(&mut self, cycles: u64) {
        (0..cycles).for_each(|_| self.cycle());
    }

    /// Cycles until a condition holds.
    ///
    /// # Panics
    /// When it does not hold within a time.
    pub fn until(&mut self, limit: Duration, what: &str, condition: impl Fn(&World) -> bool) {
        let end = self.application.now() + limit;
        while !condition(self) {
            assert!(self.application.now() < end, "not within {} ms: {what}", limit.as_millis());
            self.cycle();
        }
    }

    /// The mailbox of a declared SubDevice.
    ///
    /// # Panics
    /// When no SubDevice is declared there.
    pub fn mailbox(&self, subdevice: usize) -> Mailbox {
        self.application.engine().mailbox(SubDeviceId(subdevice)).expect("it is declared")
    }

    /// Starts work in the acyclic half.
    pub fn start<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> Pending<T> {
        self.application.engine_mut().start(work)
    }

    /// Cycles until work has ended.
    ///
    /// # Panics
    /// When it has not ended within a time.
    pub fn finish<T: 'static>(&mut self, limit: Duration, mut work: Pending<T>) -> T {
        let end = self.application.now() + limit;
        loop {
            if let Some(result) = work.take() {
                return result;
            }
            assert!(self.application.now() < end, "not within {} ms", limit.as_millis());
            self.cycle();
        }
    }

    /// Runs work in the acyclic half and cycles meanwhile, for 60 s at most.
    pub fn run<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> T {
        let work = self.start(work);
        self.finish(Duration::from_secs(60), work)
    }

    /// Puts a line into the log.
    pub fn say(&mut self, what: impl Display) {
        let at = self.application.now();
        self.journal.lines.push((at, format!("> {what}")));
    }

    /// The application.
    pub fn application(&self) -> &Application<Tap> {
        &self.application
    }

    /// The application.
    pub fn application_mut(&mut self) -> &mut Application<Tap> {
        &mut self.application
    }

    /// The segment.
    pub fn network(&self) -> &Network {
        self.application.links().network()
    }

    /// The segment.
    pub fn network_mut(&mut self) -> &mut Network {
        self.application.links_mut().network_mut()
    }

    /// The device of a declared SubDevice, if it was present at the last check.
    pub fn device_of(&self, subdevice: usize) -> Option<DeviceIndex> {
        self.devices.get(subdevice).copied().flatten()
    }

    /// The station address of a device.
    pub fn station_of(&self, device: usize) -> u16 {
        station(self.network().device(DeviceIndex(device)))
    }

    /// Whether latched outputs of devices are compared with the image, too. Late and duplicated frames change them; the
    /// devices' logs are checked at all times.
    pub fn evaluate_latched(&mut self, evaluated: bool) {
        self.mirror.evaluates_latched = evaluated;
    }

    /// From now on outputs of all tries of a cycle must be alike, and follow in the order of cycles: for worlds with
    /// one cycle under way in which no frame is damaged or delayed.
    pub fn compare_tries(&mut self) {
        self.truth.compares_outputs = true;
    }

    /// Amount of compared process data: latched bytes, areas in the devices' logs.
    pub fn compared(&self) -> u64 {
        self.mirror.compared() + self.truth.proven()
    }

    /// Areas of fresh inputs and of outputs of complete cycles that were found in a device's log.
    pub fn proven(&self) -> u64 {
        self.truth.proven()
    }

    /// Areas of cycles with second tries that were not transferred by these, because their SubDevice must not receive
    /// them twice.
    pub fn spared(&self) -> u64 {
        self.truth.spared()
    }

    /// Time of the simulation.
    pub fn now(&self) -> SimTime {
        self.network().now()
    }

    /// The present point in the history.
    pub fn mark(&self) -> Mark {
        let Journal { events, evaluated, steps, .. } = &self.journal;
        Mark { events: events.len(), evaluated: evaluated.len(), steps: steps.len() }
    }

    /// The beginning of the history.
    pub fn beginning(&self) -> Mark {
        Mark { events: 0, evaluated: 0, steps: 0 }
    }

    /// Events since a point.
    pub fn events(&self, since: Mark) -> &[TimedEvent] {
        &self.journal.events[since.events..]
    }

    /// Whether an event was reported since a point.
    pub fn saw(&self, since: Mark, wanted: impl Fn(&Event) -> bool) -> bool {
        self.events(since).iter().any(|timed| wanted(&timed.event))
    }

    /// Evaluations of domains since a point.
    pub fn evaluated(&self, since: Mark) -> &[Evaluated] {
        &self.journal.evaluated[since.evaluated..]
    }

    /// Evaluations since a point with missing data of a SubDevice that could have responded.
    pub fn incomplete(&self, since: Mark) -> usize {
        self.evaluated(since).iter().filter(|evaluated| evaluated.delivery.is_incomplete()).count()
    }

    /// Devices that left OP since a point.
    pub fn left_op(&self, since: Mark) -> Vec<DeviceIndex> {
        self.journal.steps[since.steps..].iter().filter(|step| step.leaves_op()).map(|step| step.device).collect()
    }

    /// Changes of AL status since a point.
    pub fn steps(&self, since: Mark) -> &[Step] {
        &self.journal.steps[since.steps..]
    }

    /// Whether all devices are in OP, by their own registers.
    pub fn all_in_op(&self) -> bool {
        self.network().devices().all(|device| device.al_status() == AlStatus::new(AlState::Op))
    }

    /// Hash of all frames and events so far.
    pub fn fingerprint(&self) -> Fingerprint {
        let mut fingerprint = self.application.links().fingerprint();
        for event in &self.journal.events {
            fingerprint.take(format!("{event:?}").as_bytes());
        }
        fingerprint
    }

    /// State of all devices, by their own registers and in the engine.
    pub fn condition(&self) -> String {
        let mut text = String::new();
        for (number, device) in self.network().devices().enumerate() {
            let (name, station, power) = (device.name(), station(device), device.controller.is_powered());
            let status = device.al_status();
            text += &format!("device {number} ({name}): station {station:#06x}, power {power}, {status}\n");
        }
        let engine = self.application.engine();
        for (number, (state, station)) in engine.states().into_iter().zip(engine.stations()).enumerate() {
            text += &format!("declared {number}: station {station}, {state:?}\n");
        }
        let last =
            self.journal.evaluated.last().map(|evaluated| (evaluated.delivery, evaluated.status, &evaluated.stale));
        text + &format!("ring {:?}, last cycle {last:?}\n", self.application.ring())
    }

    /// The log as text.
    pub fn log(&self) -> String {
        let line = |(at, what): &(Instant, String)| format!("{:>12.3} us  {what}\n", at.0 as f64 / 1e3);
        self.journal.lines.iter().map(line).collect()
    }
}

impl Drop for World {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let again = if self.application.exchange().sends_again() { ", lost frames are sent again" } else { "" };
            let (seed, now, log, condition) = (self.seed, self.now(), self.log(), self.condition());
            println!("seed {seed}{again}, at {now}; what happened:\n{log}\n{condition}");
        }
    }
}

pub(crate) fn station(device: &Device) -> u16 {
    let bytes = device.controller.register(map::STATION_ADDRESS, 2);
    u16::from_le_bytes([bytes[0], bytes[1]])
}

/// Ranges of the outputs in each domain's image.
fn output_ranges(directory: &Directory, domains: usize, declared: usize) -> Vec<Vec<Range<usize>>> {
    let mut ranges = vec![Vec::new(); domains];
    for area in (0..declared).flat_map(|subdevice| directory.areas(SubDeviceId(subdevice))) {
        if area.direction == Direction::Outputs {
            let start = area.placed.image_offset as usize;
            ranges[area.domain.0].push(start..start + usize::from(area.placed.area.length));
        }
    }
    ranges
}

/// New outputs in every cycle, different from byte to byte.
fn write_pattern(data: &mut ProcessData<'_>, domain: DomainId, outputs: &[Range<usize>], number: u64) {
    for range in outputs {
        let bytes = data.outputs_mut(domain, range.clone()).expect("they are outputs");
        let pattern = |at: usize| (number as u8).wrapping_mul(31).wrapping_add((at as u8).wrapping_mul(7));
        bytes.iter_mut().zip(range.clone()).for_each(|(byte, at)| *byte = pattern(at));
    }
}
