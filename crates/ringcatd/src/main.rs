//! The program `ringcatd`: see `ringcatd --help`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use ringcat_control::socket::to_listen_at;
use ringcat_link::HeldSignals;
use ringcat_link::capabilities::{Capabilities, keep};
use ringcat_link::process::raise_descriptors;
use ringcatd::daemon::Daemon;
use ringcatd::ethernet::EthernetInterfaces;
use ringcatd::listening::Prepared;
use ringcatd::log::{flush, say};
use ringcatd::master::{Master, Settings};
use ringcatd::opener::{self, Opener};
use ringcatd::owner_lock::OwnerLock;
use ringcatd::rights::{Rights, group, mode};
use ringcatd::segment_process;
use ringcatd::source::{MasterOption, SafeState, Source, check};
use ringcatd::wires::Wires;

/// Descriptors that are enough for all clients and many masters; limits are often lower.
const DESCRIPTORS: u64 = 4096;
/// Interval of attempts at what was not possible before.
const LOOK: Duration = Duration::from_secs(1);

/// Drives EtherCAT segments while no application does, and hands them over to applications.
#[derive(Debug, Parser)]
#[command(name = "ringcatd", version, max_term_width = 100)]
struct Arguments {
    /// A master and its links: 0=eth1, 0=eth1,eth2 (a ring), 0=sim:FILE (a simulated segment)
    ///
    /// Can be given several times. A simulated segment runs in a process of its own and needs no permission.
    #[arg(long = "master", value_name = "NUMBER=LINKS", required_unless_present_any = ["simulate", "open_sockets"])]
    masters: Vec<MasterOption>,
    /// Where the daemon listens
    ///
    /// By default /run/ringcat/control as root; as another user ringcat/control in XDG_RUNTIME_DIR or /run/user/UID, or
    /// /tmp/ringcat-UID/control where there is neither.
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Mode of the socket, in octal: which users can connect, and read
    #[arg(long, default_value = "0660", value_parser = mode)]
    mode: u32,
    /// Group of the socket; its members may also change the bus and drive masters
    ///
    /// Root and the user of the daemon may do that anyway.
    #[arg(long, value_name = "GROUP", value_parser = group)]
    group: Option<u32>,
    /// An application that is stopped (SIGSTOP, a debugger) for this time loses its master
    #[arg(long, value_name = "MS", default_value_t = 100)]
    stop_limit: u64,
    /// State of all SubDevices of a master after the end of an application: INIT, PREOP, SAFEOP
    ///
    /// PREOP by default. Can be given once for each master.
    #[arg(long = "safe-state", value_name = "NUMBER=STATE")]
    safe_states: Vec<SafeState>,
    /// Make no network interfaces for SubDevices with Ethernet over EtherCAT
    ///
    /// Otherwise they are eoeXsY with the master's number X and the position Y, or eoeXaY with the alias Y. They stay
    /// when applications begin and end. Needs CAP_NET_ADMIN.
    #[arg(long)]
    no_eoe: bool,
    /// The process of a simulated segment
    #[arg(long = "simulate", hide = true, value_name = "FILE")]
    simulate: Option<PathBuf>,
    /// The process that opens packet sockets
    #[arg(long = "open-sockets", hide = true)]
    open_sockets: bool,
}

/// What a process with this program does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Daemon,
    /// A process of the daemon, which tells the operator itself.
    Part,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let (role, result) = match &arguments.simulate {
        Some(file) => (Role::Part, segment_process::run(file)),
        None if arguments.open_sockets => (Role::Part, opener::run()),
        None => (Role::Daemon, run(&arguments)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // The daemon says what the other process has said.
        Err(_) if role == Role::Part => ExitCode::from(2),
        Err(error) => {
            say(format_args!("{error}"));
            flush();
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), String> {
    check(&arguments.masters)?;
    let is_known = |safe: &&SafeState| arguments.masters.iter().any(|it| it.master == safe.master);
    if let Some(safe) = arguments.safe_states.iter().find(|safe| !is_known(safe)) {
        return Err(format!("--safe-state names master {}, which no --master gives", safe.master));
    }
    let held = HeldSignals::hold();
    raise_descriptors(DESCRIPTORS);
    std::panic::set_hook(Box::new(|panic| say(format_args!("{panic}"))));
    let rights = Rights { group: arguments.group, mode: arguments.mode };
    let path = match &arguments.socket {
        Some(path) => path.clone(),
        None => to_listen_at(|name| std::env::var_os(name))?,
    };
    let socket = Prepared::new(&path, rights)?;
    // Before there are threads and segments, which inherit what is left.
    let has_interfaces = arguments.masters.iter().any(|it| matches!(it.source, Source::Interfaces(..)));
    let opener = Arc::new(if has_interfaces { Opener::start()? } else { Opener::Here });
    keep(Capabilities::ADMIN).map_err(|error| format!("capabilities cannot be given up: {error}"))?;
    let mut masters = Vec::new();
    for option in &arguments.masters {
        let failed = |error| format!("master {}: {error}", option.master);
        let lock = OwnerLock::open(&path, option.master).map_err(failed)?;
        let wires = Wires::of(&option.source, &opener).map_err(failed)?;
        let mut settings = Settings::new(option.master, option.source.to_string());
        settings.lock = Some(lock);
        settings.interfaces = (!arguments.no_eoe).then(|| EthernetInterfaces::new(option.master));
        if let Some(safe) = arguments.safe_states.iter().find(|it| it.master == option.master) {
            settings.safe_state = safe.state;
        }
        masters.push(Master::start(settings, wires));
    }
    let stop_limit = Duration::from_millis(arguments.stop_limit);
    let daemon = Daemon::serve(masters, socket, stop_limit)?;
    say(format_args!("listens at {}", path.display()));
    while held.wait(LOOK).is_none() {
        daemon.look_after();
    }
    drop(daemon);
    flush();
    Ok(())
}
