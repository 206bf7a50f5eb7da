//! The matrix of rings: any cable of a ring of any length cut and repaired in any phase, with all checks
//! ([`Bed::run`]). Scenarios run a part of it, the bench of the ring all of it.

use std::cell::Cell;
use std::time::Duration;

use ringcat::{DomainId, Event, Options, Redundancy, RingState, SubDeviceId, automatic};
use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_engine::mail::eoe::EthernetPort;
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_engine::mail::{Limits, Mailbox};
use ringcat_engine::main_device::Pending;
use ringcat_sim::application::behaviours::{Behaviour, InputSource};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::description::{DeviceDescription, EoeEnd};
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use ringcat_wire::al::{AlState, AlStatus};

use crate::check::{Delivery, ring_events, troubles};
use crate::ethernet_host::{Addresses, download};
use crate::phases::{End, Phase as StartPhase, start_up};
use crate::segments::{cable_of_ring, descriptions, ring};
use crate::world::{CYCLE, Mark, World};

const LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(2));
const ADDRESSES: Addresses = Addresses { mac: [2, 0, 0, 0, 0, 9], host: [10, 0, 0, 1], device: [10, 0, 0, 2] };
/// Bytes of a download over TCP.
const STREAM: usize = 60_000;
const OBJECT: SdoAddress = SdoAddress::new(0x2002, 0);
/// Enough bytes for several segments of an SDO and several packets of a file.
const BYTES: usize = 12_000;
/// Cycles after an edge.
const AFTER_EDGE: u64 = 25;
/// Cycles in OP before the first fault.
const BEFORE: u64 = 5;
/// Cycles for which the application of the failing SubDevice hangs: a little longer than its watchdog.
const FALL: u64 = 110;
/// Inputs are functions of outputs: this many cycles after the last incomplete cycle they have their undisturbed
/// values.
const ECHO: usize = 2;

/// Activity during the cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Right after power-on.
    PowerOn,
    /// SII contents are being read.
    Scan,
    /// Transition to PREOP.
    ToPreOp,
    /// Transition to SAFEOP.
    ToSafeOp,
    /// Transition to OP.
    ToOp,
    /// All are in OP, mailboxes are idle.
    Idle,
    /// A segmented SDO is written and read back.
    Sdo,
    /// A file is written by FoE and read back.
    Foe,
    /// Ethernet frames by EoE: a download over TCP.
    Eoe,
    /// One SubDevice fell to SAFEOP and returns to OP.
    StateChange,
    /// PREOP is requested of one SubDevice, and OP when the cable is repaired.
    StateRequest,
}

impl Phase {
    /// In order of time.
    pub const ALL: [Phase; 11] = [
        Phase::PowerOn,
        Phase::Scan,
        Phase::ToPreOp,
        Phase::ToSafeOp,
        Phase::ToOp,
        Phase::Idle,
        Phase::Sdo,
        Phase::Foe,
        Phase::Eoe,
        Phase::StateChange,
        Phase::StateRequest,
    ];

    /// Before all are in OP.
    pub const fn is_start_up(self) -> bool {
        matches!(self, Phase::PowerOn | Phase::Scan | Phase::ToPreOp | Phase::ToSafeOp | Phase::ToOp)
    }
}

/// A run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// SubDevices.
    pub count: usize,
    /// The cable, from the main link on.
    pub cable: usize,
    /// Activity.
    pub phase: Phase,
    /// Moment of the edges within the cycle, or within the phase of the start-up, in thousandths.
    pub moment: u32,
    /// Detection delay of all ports.
    pub detection: Duration,
}

/// Result of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Incomplete cycles at the cut and at the repair; none are counted in a start-up.
    pub incomplete: [usize; 2],
    /// Allowed incomplete cycles each time, with the measured round trip.
    pub allowed: usize,
    /// From the first frames on the original path to the event.
    pub fixed_after: Duration,
    /// Bytes of inputs that were compared with the uncut twin.
    pub compared: u64,
    /// Number of cycles in which a SubDevice took over its outputs exactly once.
    pub taken: u64,
}

/// The device that has mailboxes with all protocols.
pub const fn mailbox_device(count: usize) -> usize {
    count / 2
}

thread_local! {
    /// Begin of the cycles of the world in this thread, in nanoseconds after a full period: in an open ring a SubDevice
    /// may process a frame some hundred microseconds later than in the twin, and this must not be in the next cycle.
    static GRID: Cell<u64> = const { Cell::new(0) };
}

/// Inputs from the number of the cycle and the last latched outputs.
fn echo(now: SimTime, outputs: &[u8], inputs: &mut [u8]) {
    let cycle = (now.0.wrapping_sub(GRID.get()) / CYCLE.as_nanos() as u64) as u8;
    for (at, input) in inputs.iter_mut().enumerate() {
        let output = if outputs.is_empty() { 0 } else { outputs[at % outputs.len()] };
        *input = output.rotate_left(3) ^ cycle.wrapping_mul(29).wrapping_add(at as u8);
    }
}

/// A ring of terminals and blocks whose inputs are functions of outputs and cycle.
pub fn segment(count: usize, detection: Duration) -> Network {
    const KINDS: [&str; 6] =
        ["digital-output-8", "digital-input-8", "block", "digital-output-16", "digital-input-16", "analog-output-4"];
    let mut kinds: Vec<&str> = KINDS.into_iter().cycle().take(count).collect();
    kinds[mailbox_device(count)] = "all-protocols";
    let mut described: Vec<DeviceDescription> = descriptions(&kinds);
    let ethernet = &mut described[mailbox_device(count)].services.eoe;
    (ethernet.address, ethernet.mask) = (Some(ADDRESSES.device.into()), Some([255, 255, 255, 0].into()));
    ethernet.end = EoeEnd::Stack;
    for it in &mut described {
        if let Behaviour::Terminal(source) = &mut it.behaviour {
            *source = InputSource::Function(echo);
        }
    }
    ring(described, NetworkOptions::default().with_detection_delay(detection))
}

/// The moment of a case in a start-up.
fn moment(case: &Case, phases: &[StartPhase]) -> SimTime {
    let end = |wanted: End| phases.iter().find(|phase| phase.end == wanted).map_or(Duration::ZERO, |phase| phase.at);
    use AlState::{Op, PreOp, SafeOp};
    let (from, to) = match case.phase {
        Phase::PowerOn => (Duration::ZERO, end(End::Addressed)),
        Phase::Scan => (end(End::Addressed), end(End::Scanned)),
        Phase::ToPreOp => (end(End::Scanned), end(End::State(PreOp))),
        Phase::ToSafeOp => (end(End::State(PreOp)), end(End::State(SafeOp))),
        _ => (end(End::State(SafeOp)), end(End::State(Op))),
    };
    SimTime::from_micros(((from + (to - from) * case.moment / 1000).as_nanos() / 1000) as u64)
}

/// A ring in OP.
fn in_op(count: usize, detection: Duration) -> World {
    GRID.set(0);
    let world = World::in_op(0, segment(count, detection));
    GRID.set(world.application().now().0 % CYCLE.as_nanos() as u64);
    world
}

/// Common data of the runs of one length: end times of the start-up phases, and the undisturbed twin.
#[derive(Debug)]
pub struct Bed {
    count: usize,
    detection: Duration,
    phases: Vec<StartPhase>,
    /// Inputs and outputs of each cycle in OP; also of a run with a failing SubDevice.
    twins: [Vec<Vec<u8>>; 2],
}

impl Bed {
    /// A test bed for rings of this many SubDevices.
    pub fn new(count: usize, detection: Duration) -> Bed {
        let phases = start_up(segment(count, detection), &Options::default(), CYCLE).expect("it starts");
        let cycles = 2 * wait(detection) + FALL + 40;
        let twins = [false, true].map(|falls| {
            let mut world = in_op(count, detection);
            let mut images = Vec::new();
            for cycle in 0..cycles {
                if falls && (cycle == BEFORE || cycle == BEFORE + FALL) {
                    world.hang(DeviceIndex(mailbox_device(count)), cycle == BEFORE);
                }
                world.cycle();
                images.push(world.application().exchange().image(DomainId(0)).to_vec());
            }
            images
        });
        Bed { count, detection, phases, twins }
    }

    /// Number of SubDevices of its rings.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Cuts and repairs a cable in a phase, at a moment of the cycle (or of the phase of the start-up) in thousandths.
    ///
    /// # Panics
    /// When something does not hold.
    pub fn run(&self, cable: usize, phase: Phase, moment: u32) -> Outcome {
        let case = Case { count: self.count, cable, phase, moment, detection: self.detection };
        if phase.is_start_up() { start(&case, &self.phases) } else { operate(&case, &self.twins[falls(phase)]) }
    }
}

fn falls(phase: Phase) -> usize {
    usize::from(phase == Phase::StateChange)
}

/// A break and its repair during the start of the ring.
fn start(case: &Case, phases: &[StartPhase]) -> Outcome {
    GRID.set(0);
    let mut network = segment(case.count, case.detection);
    let at = moment(case, phases);
    network.schedule(at, Fault::Cut(CableId(case.cable)));
    let healed = at + Duration::from_millis(40 + u64::from(case.moment) / 10);
    network.schedule(healed, Fault::Heal(CableId(case.cable)));
    let seed = case.cable as u64 * 1000 + u64::from(case.moment);
    let mut world = World::with(seed, network, &Options::default(), |scan| automatic(&scan.subdevices, CYCLE))
        .unwrap_or_else(|error| panic!("{case:?}: {error}"));
    world.settle();
    while world.now() < healed + case.detection {
        world.cycle();
    }
    world.run_cycles(AFTER_EDGE);
    let all = world.events(world.beginning());
    assert_eq!(troubles(all), Vec::<&Event>::new(), "{case:?}");
    let reports = ring_events(all);
    let opened = reports.iter().filter(|event| matches!(event, Event::RingOpened { .. })).count();
    let closed = reports.iter().filter(|event| matches!(event, Event::RingClosed { .. })).count();
    assert!(opened <= 1 && opened == closed, "{case:?}: {reports:?}");
    let cable = cable_of_ring(case.cable, case.count);
    let misplaced = reports.iter().find(|event| matches!(event, Event::BreakLocated { cable: at } if *at != cable));
    assert_eq!(misplaced, None, "{case:?}");
    is_whole(&world, case);
    Outcome::default()
}

/// The ring is closed, all SubDevices are in OP, all domains are complete.
fn is_whole(world: &World, case: &Case) {
    let status = world.application().ring_status();
    assert_eq!(
        (status.state, status.redundancy, status.place),
        (RingState::Closed, Redundancy::Ready, None),
        "{case:?}"
    );
    assert!(world.all_in_op() && world.application().all_settled(), "{case:?}");
    let last = world.evaluated(world.beginning()).last().map(|evaluated| evaluated.delivery);
    assert_eq!(last, Some(Delivery::Complete), "{case:?}");
}

/// A ring in OP, with the data of its undisturbed twin in each cycle.
struct Pair<'a> {
    cut: World,
    twin: std::slice::Iter<'a, Vec<u8>>,
    /// Complete cycles in a row.
    calm: usize,
    compared: u64,
    /// Number of times each device took over outputs.
    latched: Vec<u64>,
    /// Device without this check: it leaves OP in this phase.
    apart: Option<usize>,
    taken: u64,
}

impl Pair<'_> {
    /// One cycle. Outside the edges the inputs equal those of the twin, and outputs are taken over once.
    fn cycle(&mut self, case: &Case) {
        self.cut.cycle();
        let world = &self.cut;
        let last = world.evaluated(world.beginning()).last();
        self.calm = if last.is_some_and(|it| it.delivery == Delivery::Complete) { self.calm + 1 } else { 0 };
        self.taken += self.count_latches(case);
        let world = &self.cut;
        let Some(twin) = self.twin.next().filter(|_| self.calm > ECHO) else { return };
        let image = world.application().exchange().image(DomainId(0));
        assert_eq!(image, twin, "{case:?}: other inputs than the twin's, {}", world.now());
        self.compared += image.len() as u64;
    }

    /// Each SubDevice receives outputs once per cycle; at an edge never, once or twice. Returns the number of
    /// SubDevices with outputs.
    fn count_latches(&mut self, case: &Case) -> u64 {
        let now: Vec<u64> = self.cut.network().devices().map(Device::outputs_latched).collect();
        let before = std::mem::replace(&mut self.latched, now);
        // A copy that a SubDevice processed again made its cycle incomplete.
        let is_calm = self.calm > ECHO;
        let mut taken = 0;
        for (number, (before, now)) in before.iter().zip(&self.latched).enumerate() {
            let has_outputs = !self.cut.network().device(DeviceIndex(number)).outputs().is_empty();
            if !has_outputs || self.apart == Some(number) {
                continue;
            }
            let times = now - before;
            let (least, most) = if is_calm { (1, 1) } else { (0, 2) };
            assert!((least..=most).contains(&times), "{case:?}: device {number} took outputs {times} times");
            taken += u64::from(is_calm);
        }
        taken
    }

    fn cycles(&mut self, case: &Case, count: u64) {
        (0..count).for_each(|_| self.cycle(case));
    }
}

fn pattern() -> Vec<u8> {
    (0..BYTES).map(|at| (at * 11 % 251) as u8).collect()
}

async fn write_and_read_object(mailbox: Mailbox) -> Vec<u8> {
    coe::write(&mailbox, OBJECT, &pattern(), LIMITS).await.expect("a break is no error");
    coe::read(&mailbox, OBJECT, LIMITS, BYTES).await.expect("a break is no error")
}

async fn write_and_read_file(mailbox: Mailbox) -> Vec<u8> {
    let options = FoeOptions::default().with_limits(LIMITS);
    let data = pattern();
    foe::write(&mailbox, "recipe", options, &mut Bytes::new(&data), |_| ()).await.expect("a break is no error");
    let mut sink = Bounded::new(BYTES);
    foe::read(&mailbox, "recipe", options, &mut sink, |_| ()).await.expect("a break is no error");
    sink.into_bytes()
}

async fn stream(mailbox: Mailbox) -> Vec<u8> {
    let port = EthernetPort::open(&mailbox).expect("the port is free");
    let bus = mailbox.bus().clone();
    download(bus, &port, ADDRESSES, STREAM, Duration::from_secs(10)).await.expect("TCP repeats lost data");
    pattern()
}

/// Starts work that continues over both edges.
fn begin(world: &mut World, case: &Case) -> Option<Pending<Vec<u8>>> {
    let mailbox = world.mailbox(mailbox_device(case.count));
    match case.phase {
        Phase::Sdo => Some(world.start(write_and_read_object(mailbox))),
        Phase::Foe => Some(world.start(write_and_read_file(mailbox))),
        Phase::Eoe => Some(world.start(stream(mailbox))),
        _ => None,
    }
}

/// Incomplete cycles that an edge may cost.
pub fn allowed(detection: Duration, flight: Duration) -> usize {
    let time = detection + flight;
    if time < CYCLE / 2 { 1 } else { time.as_nanos().div_ceil(CYCLE.as_nanos()) as usize + 1 }
}

/// Cycles after an edge, detection included.
fn wait(detection: Duration) -> u64 {
    detection.as_nanos().div_ceil(CYCLE.as_nanos()) as u64 + AFTER_EDGE
}

fn operate(case: &Case, twin: &[Vec<u8>]) -> Outcome {
    let cut = in_op(case.count, case.detection);
    let apart = matches!(case.phase, Phase::StateChange | Phase::StateRequest).then(|| mailbox_device(case.count));
    let latched = cut.network().devices().map(Device::outputs_latched).collect();
    let mut pair = Pair { cut, twin: twin.iter(), calm: 0, compared: 0, latched, apart, taken: 0 };
    pair.cut.application_mut().links_mut().measure_flights();
    pair.cycles(case, BEFORE);
    let fallen = disturb(&mut pair, case);
    let work = begin(&mut pair.cut, case);
    pair.cycles(case, if work.is_some() { 8 } else { 0 });
    let flight = Duration::from_nanos(pair.cut.application().links().flight_ns());
    let bound = allowed(case.detection, flight);
    let (main, redundant) = (case.cable as u16, (case.count - case.cable) as u16);
    let cable = cable_of_ring(case.cable, case.count);
    let opened = [Event::RingOpened { main, redundant }, Event::BreakLocated { cable }];
    let closed = [Event::RingClosed { main: case.count as u16, redundant: 0, place: Some(cable) }];
    let mut outcome = Outcome { allowed: bound, ..Outcome::default() };
    for (at, fault) in [Fault::Cut(CableId(case.cable)), Fault::Heal(CableId(case.cable))].into_iter().enumerate() {
        let mark = pair.cut.mark();
        let state = [AlState::PreOp, AlState::Op][at];
        let mailbox_device = mailbox_device(case.count);
        let asked = (case.phase == Phase::StateRequest)
            .then(|| pair.cut.application_mut().engine_mut().start_state_request(SubDeviceId(mailbox_device), state));
        pair.cut.fault_in(CYCLE * case.moment / 1000, fault);
        pair.cycles(case, wait(case.detection));
        if let Some(asked) = asked {
            let reached = pair.cut.finish(Duration::from_secs(2), asked);
            reached.unwrap_or_else(|error| panic!("{case:?}: {state}: {error}"));
            assert_eq!(pair.cut.network().device(DeviceIndex(mailbox_device)).al_status(), AlStatus::new(state));
        }
        let world = &pair.cut;
        let expected: Vec<&Event> = if at == 0 { opened.iter().collect() } else { closed.iter().collect() };
        assert_eq!(ring_events(world.events(mark)), expected, "{case:?}");
        let left: Vec<usize> =
            world.left_op(mark).iter().map(|device| device.0).filter(|device| Some(*device) != fallen).collect();
        assert_eq!(left, Vec::<usize>::new(), "{case:?}: they left OP");
        if fallen.is_none() {
            assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new(), "{case:?}");
            outcome.incomplete[at] = world.incomplete(mark);
            assert!(outcome.incomplete[at] <= bound, "{case:?}: {} of {bound}", outcome.incomplete[at]);
        }
        if at == 1 {
            outcome.fixed_after = fixed_after(world, mark, &closed[0]);
        }
    }
    if let Some(work) = work {
        assert!(pair.cut.finish(Duration::from_secs(10), work) == pattern(), "{case:?}: other bytes were read");
    }
    let limit = Duration::from_secs(5);
    pair.cut.until(limit, "all in OP", |world| world.all_in_op() && world.application().all_settled());
    pair.cut.run_cycles(5);
    is_whole(&pair.cut, case);
    (outcome.compared, outcome.taken) = (pair.compared, pair.taken);
    outcome
}

/// Starts the activity of the phase. Returns the SubDevice that is not in OP meanwhile.
fn disturb(pair: &mut Pair<'_>, case: &Case) -> Option<usize> {
    let fallen = match case.phase {
        Phase::StateChange => Some(fall(pair, case)),
        Phase::StateRequest => Some(mailbox_device(case.count)),
        _ => None,
    };
    if case.phase == Phase::StateRequest {
        // Its inputs differ from the twin's while it is in another state.
        pair.twin = [].iter();
    }
    fallen
}

/// Time from the first cycle after a mark to an event.
fn fixed_after(world: &World, mark: Mark, event: &Event) -> Duration {
    let reports = world.events(mark).iter().find(|timed| timed.event == *event).map(|timed| timed.at);
    let since = world.evaluated(mark).first().map(|evaluated| evaluated.at);
    reports.zip(since).map_or(Duration::ZERO, |(reports, since)| reports.since(since))
}

/// The SubDevice with mailboxes loses OP, as in the twin, and returns.
fn fall(pair: &mut Pair<'_>, case: &Case) -> usize {
    let mailbox_device = mailbox_device(case.count);
    pair.cut.hang(DeviceIndex(mailbox_device), true);
    pair.cycles(case, FALL);
    pair.cut.hang(DeviceIndex(mailbox_device), false);
    pair.cycles(case, 2);
    mailbox_device
}
