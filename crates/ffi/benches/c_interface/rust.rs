//! The program in Rust that does what `tests/c/cost.c` does.

use std::hint::black_box;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use ringcat::daemon::{DaemonLinks, OwnedBus, socket};
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;
use ringcat::{
    Activity, Application, ClockConfig, DomainId, DomainState, Links, Options, Required, SubDeviceInfo,
    SupervisorThread, automatic,
};

const DOMAIN: DomainId = DomainId(0);
const LIMIT: Duration = Duration::from_secs(60);
const PERIOD: Duration = Duration::from_millis(1);
/// As in `ecrt_request_master`.
const POLL: Duration = Duration::from_micros(500);

type App = Application<DaemonLinks, SupervisorThread>;

/// What callgrind counts.
#[inline(never)]
#[unsafe(no_mangle)]
fn measured(application: &mut App) -> DomainState {
    application.receive();
    let status = application.process(DOMAIN);
    application.queue(DOMAIN);
    application.send();
    status.state
}

#[inline(never)]
fn receive(application: &mut App) {
    application.receive();
}

#[inline(never)]
fn process(application: &mut App) -> DomainState {
    application.process(DOMAIN).state
}

#[inline(never)]
fn queue(application: &mut App) {
    application.queue(DOMAIN);
}

#[inline(never)]
fn send(application: &mut App) {
    application.send();
}

/// The same with each step in a function, for its share.
#[inline(never)]
#[unsafe(no_mangle)]
fn measured_steps(application: &mut App) -> DomainState {
    receive(application);
    let state = process(application);
    queue(application);
    send(application);
    state
}

/// How a program starts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Start {
    /// As the C interface does: idle operation, whose PDOs come from the dictionaries, then the activation.
    LikeC,
    /// Scan and activation, with the PDOs of the SIIs.
    Scan,
    /// The same in one step.
    BringUp,
}

/// `[steps] cycles PERIOD_US COUNT`, `start-like-c`, `start`, `bring-up`.
pub fn run(words: &[&str]) {
    match words {
        ["steps", "cycles", period, count] => cycles(measured_steps, period, count),
        ["cycles", period, count] => cycles(measured, period, count),
        ["start-like-c"] => start(Start::LikeC),
        ["start"] => start(Start::Scan),
        ["bring-up"] => start(Start::BringUp),
        _ => panic!("{words:?}"),
    }
}

fn cycles(step: fn(&mut App) -> DomainState, period_us: &str, count: &str) {
    let period = Duration::from_micros(period_us.parse().expect("a number"));
    let count: u64 = count.parse().expect("a number");
    let mut bus = OwnedBus::take(&socket(), 0, "rust", &Options::default(), || ()).expect("the daemon drives it");
    let found = bus.scan().expect("it is known").subdevices;
    // As in C: no period, in each cycle.
    let mut application = bus.activate(automatic(&found, Duration::ZERO)).expect("it fits");
    while !application.all_settled() {
        step(&mut application);
        std::thread::sleep(period);
    }
    for _ in 0..20 {
        step(&mut application);
        std::thread::sleep(period);
    }
    println!("op");
    std::io::stdout().flush().expect("it is read");
    std::io::stdin().read_line(&mut String::new()).expect("a line");
    let mut incomplete = 0;
    for _ in 0..count {
        incomplete += u64::from(black_box(step(&mut application)) != DomainState::Complete);
        std::thread::sleep(period);
    }
    println!("incomplete {incomplete}");
    drop(application);
    bus.release().expect("the daemon takes it");
}

/// Cycles until all SubDevices are in OP.
fn to_op<L: Links>(application: &mut Application<L, SupervisorThread>, begin: Instant) {
    while !application.all_settled() {
        application.receive();
        application.process(DOMAIN);
        application.queue(DOMAIN);
        // As in C: while delays are measured nothing is sent.
        if !application.pauses() {
            application.send();
        }
        assert!(begin.elapsed() < LIMIT, "not in OP");
        std::thread::sleep(PERIOD);
    }
    println!("{}", begin.elapsed().as_nanos());
}

/// From nothing to OP of all SubDevices.
fn start(way: Start) {
    let begin = Instant::now();
    let file = std::env::var("RINGCAT_SIM").expect("a segment file");
    let segment = ringcat::esi::load_segment(Path::new(&file)).expect("it is right");
    let halves = SharedSegment::halves(Network::from_description(segment).expect("it is right"));
    // Programs in C always have the clocks of the bus set up.
    let declare = |found: &[SubDeviceInfo]| {
        let mut declaration = automatic(found, Duration::ZERO).with_required(Required::Nothing);
        if found.iter().any(|info| info.receive_times.is_some()) {
            declaration.clocks = Some(ClockConfig::default().as_igh().with_drift_distributions(0));
        }
        declaration
    };
    let options = Options::default().with_idle_operation(way == Start::LikeC);
    let supervisor = SupervisorThread::start(halves.1, &options, || ()).expect("a thread");
    let mut application = match way {
        Start::BringUp => supervisor.bring_up(|scan| declare(&scan.subdevices), halves.0).expect("it fits"),
        Start::Scan => {
            let found = supervisor.scan().expect("they answer").subdevices;
            supervisor.activate(declare(&found), halves.0).expect("it fits")
        }
        Start::LikeC => {
            let found = scanned(&supervisor, begin);
            supervisor.activate(declare(&found), halves.0).expect("it fits")
        }
    };
    to_op(&mut application, begin);
}

/// What idle operation has found, once all PDOs are known.
fn scanned(supervisor: &SupervisorThread, begin: Instant) -> Vec<SubDeviceInfo> {
    loop {
        assert!(begin.elapsed() < LIMIT, "it is not scanned");
        let is_scanned = supervisor.snapshot().expect("it runs").activity == Activity::Scanned;
        if is_scanned && !supervisor.are_pdos_awaited().expect("it runs") {
            return supervisor.subdevices().expect("it runs");
        }
        std::thread::sleep(POLL);
    }
}
