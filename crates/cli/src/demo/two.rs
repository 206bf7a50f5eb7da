//! `ringcat demo --standby`: two controllers at one simulated ring. A controller is killed and started again, roles are
//! handed over, once while a cable is cut, and a controller loses its power. The effects are measured inside the
//! simulated devices.
//!
//! Both controllers are programs with the library, each in a thread of its own; virtual time passes only while all of
//! them wait, so delays of the machine do not change the result.

mod controller;
mod measurement;
mod report;
mod steps;

use std::sync::Arc;
use std::time::{Duration, Instant as WallClock};

use ringcat::sim::cable::{CableId, CableSpec, DeviceIndex, Endpoint, Host, HostLink};
use ringcat::sim::fault::Fault;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::two_hosts::TwoHosts;
use ringcat::standby::{Policy, RoleRequest};
use ringcat::text::Names;
use ringcat::{Event, Instant, MainDeviceRole, RingState};

use super::arguments::DemoArguments;
use super::report::Reporter;
use super::watch::device_at;
use crate::failure::Failure;
use crate::json::data::Data;
use crate::verdict::{Report, Verdict};
use controller::{Settings, Shared};
use measurement::Measurement;
use report::{Incident, Outcome};
use steps::{STEPS, Step, Times, cable_to_cut, name};

/// Cycles without the ACTIVE after which the other one takes over, by default.
const TIME_OUT_CYCLES: u32 = 3;
/// How long the first controller listens at the start.
const FIRST_LISTENS: Duration = Duration::from_millis(10);
/// How long each of them listens later on, at least, and in cycles.
const LISTEN: (Duration, u32) = (Duration::from_millis(500), 10);
/// How long an incident lasts at least, in milliseconds, and in cycles.
const LASTS: (u64, u32) = (400, 50);
/// Time limit until all SubDevices are in OP, and until an incident is over; some time-outs are added.
const LIMIT: Duration = Duration::from_secs(30);
/// Bytes of process data that fit into the frame of a cycle.
const ONE_FRAME: usize = 1_400;

/// The demonstration while it runs.
struct Two {
    hosts: TwoHosts,
    shared: Arc<Shared>,
    times: Times,
    /// Wall clock at the beginning of virtual time; `None`: virtual time does not wait for it.
    began: Option<WallClock>,
    late: Duration,
    cable: CableId,
    active: Host,
    measurement: Option<Measurement>,
    reporter: Reporter,
    names: Names,
    incidents: Vec<Incident>,
}

/// Runs the demonstration.
pub fn run(arguments: &DemoArguments) -> Result<Report, Failure> {
    let segment = arguments.load().map_err(|error| Failure::new(error.to_string()))?;
    let cycle = arguments.cycle(segment.devices.len());
    let mut network =
        Network::from_description(with_two_hosts(segment)?).map_err(|error| Failure::new(error.to_string()))?;
    network.log_hosts();
    let devices = network.devices().len();
    (0..devices).for_each(|at| network.device_mut(DeviceIndex(at)).controller.log_logical());
    let cable = cable_to_cut(&network).ok_or_else(no_ring)?;
    let time_out_cycles = arguments.timeout.unwrap_or(TIME_OUT_CYCLES);
    let mut reporter = Reporter::new();
    reporter.say(&format!("RingCAT demo on {} with two controllers, {}", arguments.segment_title(), arguments.pace()));
    reporter.say(&format!("cycle {} us, time-out {time_out_cycles} cycles", cycle.as_micros()));
    let two = Two {
        hosts: TwoHosts::new(network),
        shared: Arc::default(),
        times: Times { cycle, time_out_cycles, several_frames: false },
        began: (!arguments.fast).then(WallClock::now),
        late: Duration::ZERO,
        cable,
        active: Host::First,
        measurement: None,
        reporter,
        names: Names::default(),
        incidents: Vec::new(),
    };
    two.run()
}

fn no_ring() -> Failure {
    Failure::new("two controllers need a ring: expected a segment with `ring`, got a line")
}

/// The ring of a segment, led through a second host.
fn with_two_hosts(mut segment: Segment) -> Result<Segment, Failure> {
    let redundant = Endpoint::Host(HostLink::Redundant);
    let ends = segment.cables.iter_mut().flat_map(|cable| [&mut cable.a, &mut cable.b]);
    let closing = ends.filter(|end| **end == redundant).map(|end| *end = Endpoint::Host(HostLink::SecondRedundant));
    if closing.count() == 0 {
        return Err(no_ring());
    }
    // A tree has a cable per device, a ring one more.
    if segment.cables.len() > segment.devices.len() + 1 {
        return Err(Failure::new("two controllers need a single ring: got a segment with rings behind junctions"));
    }
    let delay = ringcat::sim::cable::DEFAULT_CABLE_DELAY;
    segment.cables.push(CableSpec { a: Endpoint::Host(HostLink::SecondMain), b: redundant, delay });
    Ok(segment)
}

impl Two {
    fn run(mut self) -> Result<Report, Failure> {
        self.start(Host::First, FIRST_LISTENS)?;
        self.start(Host::Second, self.listen())?;
        if !self.until(Duration::ZERO, true, true) {
            let why = self.why_not(true, true).unwrap_or_default();
            let text =
                format!("not all SubDevices in OP with two controllers within {} s: {why}", self.limit().as_secs());
            return Ok(self.report(Verdict::Failed(text)));
        }
        self.begin_to_measure();
        for step in STEPS {
            self.step(step)?;
        }
        let mut reporter = std::mem::take(&mut self.reporter);
        let verdict = self.outcome().summary(&mut reporter);
        self.reporter = reporter;
        Ok(self.report(verdict))
    }

    fn report(self, verdict: Verdict) -> Report {
        let data = self.outcome().data(self.reporter.checks());
        Report { verdict, data: Data::DemoStandby(data) }
    }

    fn outcome(&self) -> Outcome<'_> {
        Outcome {
            measurement: self.measurement.as_ref(),
            incidents: &self.incidents,
            times: self.times,
            names: &self.names,
            shared: &self.shared,
            late: self.began.map(|_| self.late),
        }
    }

    /// Begins the measurement: all SubDevices are in OP, and the other controller is ready.
    fn begin_to_measure(&mut self) {
        let identities = Host::ALL.map(|host| self.shared.board(host).identity);
        let Some(layout) = self.shared.layout.get() else { return };
        let count = layout.places.len();
        self.names = self.hosts.with_network(|network| {
            let device = |position| network.device(device_at(network, position));
            Names((0..count).map(|position| device(position).name().to_owned()).collect())
        });
        self.times.several_frames = layout.bytes > ONE_FRAME;
        let cycle = self.times.cycle;
        self.measurement =
            Some(self.hosts.with_network(|network| Measurement::new(network, &layout.places, cycle, identities)));
    }

    fn start(&mut self, host: Host, listen: Duration) -> Result<(), Failure> {
        let policy = Policy::default().with_time_out(self.times.time_out_cycles, Duration::ZERO).with_listen(listen);
        let (settings, shared) = (Settings { cycle: self.times.cycle, policy }, self.shared.clone());
        self.hosts.dismiss_guard(host);
        let started = self.hosts.start(host, move |links| controller::run(links, &settings, &shared));
        started.map_err(|error| Failure::new(format!("a thread cannot be started: {error}")))?;
        self.hosts.guard(host, self.times.cycle);
        Ok(())
    }

    /// An incident, until it is over.
    fn step(&mut self, step: Step) -> Result<(), Failure> {
        // At a moment within a cycle.
        self.pass(self.times.cycle * 3 / 10);
        let text = step.describe(self.active, &self.cable_in_words());
        self.reporter.timed(self.hosts.now(), ">", None, &format!("{}: {text}", self.incidents.len() + 1));
        self.incidents.push(Incident {
            number: self.incidents.len() + 1,
            step,
            at: self.hosts.now(),
            text,
            failure: None,
        });
        if let Some(measurement) = &mut self.measurement {
            measurement.begin();
        }
        let active = self.active;
        match step {
            Step::Calm => {}
            Step::Kill => self.kill(active),
            Step::Restart => self.start(active.other(), self.listen())?,
            Step::HandOver => self.hand_over(),
            Step::HandOverAndCut => {
                self.hand_over();
                self.pass(self.times.cycle * 3 / 2);
                self.hosts.apply(Fault::Cut(self.cable));
                self.reporter.timed(self.hosts.now(), ">", None, "the cable is cut");
            }
            Step::Repair => self.hosts.apply(Fault::Heal(self.cable)),
            Step::PowerOff => {
                self.hosts.apply(Fault::PowerHostOff(active));
                self.kill(active);
            }
            Step::PowerOn => {
                self.hosts.dismiss_guard(active.other());
                self.hosts.apply(Fault::PowerHostOn(active.other()));
                self.start(active.other(), self.listen())?;
            }
        }
        if step.changes_role() {
            self.active = active.other();
        }
        let least = Duration::from_millis(LASTS.0).max(self.times.cycle * LASTS.1);
        if !self.until(least, step.leaves_two(), step.leaves_ring()) {
            let failure = self.why_not(step.leaves_two(), step.leaves_ring());
            if let Some(incident) = self.incidents.last_mut() {
                incident.failure = failure;
            }
        }
        Ok(())
    }

    fn kill(&mut self, host: Host) {
        self.hosts.kill(host);
        let mut board = self.shared.board(host);
        (board.role, board.control) = (None, None);
    }

    fn hand_over(&mut self) {
        if let Some(control) = &self.shared.board(self.active).control {
            control.request(RoleRequest::HandOver);
        }
    }

    fn listen(&self) -> Duration {
        let (least, cycles) = LISTEN;
        least.max(self.times.cycle * cycles)
    }

    fn limit(&self) -> Duration {
        LIMIT + self.times.cycle * self.times.time_out_cycles.saturating_mul(4)
    }

    /// Lets at least this time pass, until the expected state is reached. False if the time limit expires.
    fn until(&mut self, least: Duration, two: bool, ring: bool) -> bool {
        let begin = self.hosts.now();
        while self.hosts.now().since(begin) < self.limit().max(least) {
            self.pass(self.times.cycle);
            if self.hosts.now().since(begin) >= least && self.why_not(two, ring).is_none() {
                return true;
            }
            if Host::ALL.iter().any(|host| self.shared.board(*host).failure.is_some()) {
                return false;
            }
        }
        false
    }

    /// What differs from the expected state.
    fn why_not(&self, two: bool, ring: bool) -> Option<String> {
        for host in Host::ALL {
            if let Some(failure) = &self.shared.board(host).failure {
                return Some(format!("controller {}: {failure}", name(host)));
            }
        }
        let board = self.shared.board(self.active);
        let active = name(self.active);
        if board.role != Some(MainDeviceRole::Active) {
            return Some(format!("controller {active} is not ACTIVE"));
        }
        if !board.is_settled || self.measurement.as_ref().is_some_and(|measurement| !measurement.all_in_op()) {
            return Some("not all SubDevices are in OP".to_owned());
        }
        if board.is_other_ready != two {
            let other = name(self.active.other());
            return Some(format!("controller {other} is {}ready to take over", if two { "not " } else { "" }));
        }
        let expected = if ring { RingState::Closed } else { RingState::Open };
        (board.ring != expected)
            .then(|| format!("the ring of controller {active} is not {}", if ring { "closed" } else { "open" }))
    }

    /// Lets time pass, measures each cycle, and waits for the wall clock.
    fn pass(&mut self, time: Duration) {
        let end = self.hosts.now() + time;
        while self.hosts.now() < end {
            self.hosts.run_until(end.min(self.hosts.now() + self.times.cycle));
            if let Some(measurement) = &mut self.measurement {
                self.hosts.with_network(|network| measurement.look(network));
            } else {
                drop(self.hosts.with_network(Network::take_host_log));
            }
            self.print_events();
            let Some(began) = self.began else { continue };
            let (ahead, elapsed) = (self.hosts.now().since(Instant(0)), began.elapsed());
            match ahead.checked_sub(elapsed) {
                Some(early) => std::thread::sleep(early),
                None => self.late = self.late.max(elapsed - ahead),
            }
        }
    }

    /// Prints the events of both controllers, except those of every cut.
    fn print_events(&mut self) {
        for host in Host::ALL {
            let events = std::mem::take(&mut self.shared.board(host).events);
            for event in events {
                let is_shown = match &event.event {
                    Event::Standby(_) => true,
                    Event::ForeignFrame { .. } | Event::Domain { .. } | Event::Skipped { .. } => false,
                    _ => self.measurement.is_some(),
                };
                if is_shown {
                    self.reporter.event_of(name(host), &event, &self.names);
                }
            }
        }
    }

    /// The cable that is cut, in words.
    fn cable_in_words(&self) -> String {
        let positions: Vec<usize> =
            self.measurement.iter().flat_map(|measurement| measurement.watched.iter().map(|it| it.device.0)).collect();
        let end = |end: Endpoint| match end {
            Endpoint::Device(device, _) => {
                let position = positions.iter().position(|at| *at == device.0).unwrap_or(device.0);
                format!("SubDevice {position}")
            }
            Endpoint::Host(link) => format!("controller {}", name(link.host())),
        };
        let spec = self.hosts.with_network(|network| network.cables().nth(self.cable.0).copied());
        spec.map_or_else(String::new, |spec| format!("the cable between {} and {}", end(spec.a), end(spec.b)))
    }
}
