//! The daemon from its start to its end, as a service: what it is to do, masters, notifications to the service manager.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ringcat::Activity;
use ringcat_control::message::{Answer, Query};
use ringcat_control::socket::to_listen_at;
use ringcat_link::HeldSignals;
use ringcat_link::capabilities::{Capabilities, keep};
use ringcat_link::interface::{UseWarning, exclusive_use};
use ringcat_link::operator::Priority;
use ringcat_link::process::raise_descriptors;

use crate::daemon::Daemon;
use crate::debug_interfaces::DebugTaps;
use crate::device::Device;
use crate::ethernet::EthernetInterfaces;
use crate::installed;
use crate::listening::Prepared;
use crate::log::{flush, print, say};
use crate::master::{Master, Settings};
use crate::opener::Opener;
use crate::owner_lock::OwnerLock;
use crate::service_manager::ServiceManager;
use crate::setup::Setup;
use crate::source::{MasterOption, Source};
use crate::up_down::UpDown;
use crate::wires::Wires;

/// Descriptors that are enough for all clients and many masters; limits are often lower.
const DESCRIPTORS: u64 = 4096;
/// Interval of attempts at what was not possible before.
const LOOK: Duration = Duration::from_secs(1);
/// Interval at which the first scans are checked.
const SOON: Duration = Duration::from_millis(20);
/// The daemon is ready after this time, also if a segment is still being scanned.
const FIRST_SCAN: Duration = Duration::from_secs(20);

/// Runs the daemon until a signal ends it.
///
/// # Errors
/// Why it cannot begin, for the operator.
pub fn run(setup: &Setup) -> Result<(), String> {
    setup.check_interfaces()?;
    let held = HeldSignals::hold();
    raise_descriptors(DESCRIPTORS);
    std::panic::set_hook(Box::new(|panic| say(format_args!("{panic}"))));
    let path = match &setup.socket {
        Some(path) => path.clone(),
        None => to_listen_at(|name| std::env::var_os(name))?,
    };
    let socket = Prepared::new(&path, setup.rights)?;
    // Before there are threads and segments, which inherit what is left.
    let has_interfaces = setup.masters.iter().any(|it| matches!(it.source, Source::Interfaces(..)));
    let opener = Arc::new(if has_interfaces { Opener::start()? } else { Opener::Here });
    keep(Capabilities::ADMIN).map_err(|error| format!("capabilities cannot be given up: {error}"))?;
    if setup.ends_with_input {
        end_with_input()?;
    }
    let mut up_down = UpDown::start(&setup.up_down);
    let mut masters = Vec::new();
    for option in &setup.masters {
        warn_of_others(option, setup.ends_with_input);
        let started = master(setup, option, &path, &opener);
        masters.push(started.map_err(|error| format!("master {}: {error}", option.master))?);
    }
    // The command that has started it waits itself.
    if !setup.ends_with_input {
        masters.iter().for_each(Master::listen);
        installed::report();
    }
    let daemon = Daemon::serve(masters, socket, Duration::from_millis(setup.stop_limit))?;
    say(format_args!("listens at {}", path.display()));
    serve(&daemon, &mut up_down, &held);
    let is_driven = daemon.masters().iter().any(|master| master.state().owner.is_some());
    drop(daemon);
    up_down.end(is_driven);
    flush();
    Ok(())
}

/// The daemon of one command ends with that command, however that ends: only the command has the path of its socket.
fn end_with_input() -> Result<(), String> {
    let body = || {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        std::process::exit(0);
    };
    let started = std::thread::Builder::new().name("input".into()).spawn(body);
    started.map(drop).map_err(|error| format!("a thread cannot be started: {error}"))
}

/// Reports what else uses the interfaces of a master, before it has sockets of its own. An interface that is to be
/// chosen is one that nothing else uses. A service reports kernel modules with all else that is installed.
fn warn_of_others(option: &MasterOption, with_modules: bool) {
    let named = option.source.devices().filter(|device| **device != Device::First);
    // An interface that does not exist yet has no users.
    let found = named.filter_map(|device| device.find(&[]).ok().flatten());
    let warnings = found.flat_map(|found| exclusive_use(&found.name));
    for warning in warnings.filter(|it| with_modules || !matches!(it, UseWarning::KernelModule { .. })) {
        print(Priority::Warning, format!("ringcatd: master {}: {warning}", option.master));
    }
}

/// Starts a master.
fn master(
    setup: &Setup,
    option: &MasterOption,
    socket: &std::path::Path,
    opener: &Arc<Opener>,
) -> Result<Master, String> {
    let lock = OwnerLock::open(socket, option.master)?;
    let mut wires = Wires::of(&option.source, &setup.others(option.master), opener)?;
    if setup.needs_backup {
        wires.need_all();
    }
    let mut settings = Settings::new(option.master, option.source.to_string());
    settings.lock = Some(lock);
    settings.interfaces = setup.has_eoe.then(|| EthernetInterfaces::new(option.master));
    settings.debug = setup.has_debug_interfaces.then(|| DebugTaps::new(option.master));
    settings.debug_level = setup.debug_level;
    settings.bus = setup.bus.clone();
    if let Some(safe) = setup.safe_states.iter().find(|it| it.master == option.master) {
        settings.safe_state = safe.state;
    }
    Ok(Master::start(settings, wires))
}

/// Supervises the masters until a signal comes, and reports their states to the service manager.
fn serve(daemon: &Daemon, up_down: &mut UpDown, held: &HeldSignals) {
    let mut manager = ServiceManager::new(std::process::id(), |name| std::env::var_os(name));
    let begin = Instant::now();
    let mut looked = begin;
    let mut is_ready = !manager.is_there();
    loop {
        if manager.is_there() {
            let all: Vec<Status> = daemon.masters().iter().map(Status::of).collect();
            is_ready |= begin.elapsed() >= FIRST_SCAN || all.iter().all(|it| it.is_ready);
            let shown: Vec<&str> = all.iter().map(|it| it.text.as_str()).collect();
            manager.report(&shown.join("; "), is_ready);
            manager.live();
        }
        let until_look = LOOK.saturating_sub(looked.elapsed());
        if held.wait(manager.interval(if is_ready { until_look } else { SOON })).is_some() {
            break;
        }
        if looked.elapsed() >= LOOK {
            looked = Instant::now();
            up_down.look();
            daemon.supervise();
        }
    }
    manager.stop();
}

/// How a master is, for the operator.
#[derive(Debug, PartialEq, Eq)]
struct Status {
    text: String,
    /// It answers, or waits for something that was reported.
    is_ready: bool,
}

impl Status {
    fn of(master: &Master) -> Status {
        let number = master.number();
        let state = master.state();
        let (text, is_ready) = match (state.owner, state.fault) {
            (_, Some(fault)) => (format!("master {number} is not driven: {fault}"), true),
            (Some(owner), None) => (format!("master {number} is driven by {owner}"), true),
            (None, None) => match master.ask(Query::State, Vec::new()) {
                Ok((Answer::State(state), _)) => {
                    let is_scanned = !matches!(state.activity, Activity::Unscanned | Activity::Scanning);
                    let count = state.subdevices.len();
                    let said = if is_scanned { format!("{count} SubDevices") } else { "scans".to_owned() };
                    (format!("master {number}: {said}"), is_scanned)
                }
                _ => (format!("master {number} changes hands"), false),
            },
        };
        Status { text, is_ready }
    }
}
