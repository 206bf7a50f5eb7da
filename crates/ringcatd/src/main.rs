//! The program `ringcatd`: see `ringcatd --help`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use ringcat_control::DEFAULT_SOCKET;
use ringcat_link::HeldSignals;
use ringcatd::daemon::Daemon;
use ringcatd::log::say;
use ringcatd::master::Master;
use ringcatd::rights::{Rights, group, mode};
use ringcatd::segment_process;
use ringcatd::source::{MasterOption, check};
use ringcatd::wires::Wires;

/// Interval of attempts at what was not possible before.
const LOOK: Duration = Duration::from_secs(1);

/// Drives EtherCAT segments while no application does, and hands them over to applications.
#[derive(Debug, Parser)]
#[command(name = "ringcatd", version, max_term_width = 100)]
struct Arguments {
    /// A master and its links: 0=eth1, 0=eth1,eth2 (a ring), 0=sim:FILE (a simulated segment)
    ///
    /// Can be given several times. A simulated segment runs in a process of its own and needs no permission.
    #[arg(long = "master", value_name = "NUMBER=LINKS", required_unless_present = "simulate")]
    masters: Vec<MasterOption>,
    /// Where the daemon listens
    #[arg(long, value_name = "PATH", default_value = DEFAULT_SOCKET)]
    socket: PathBuf,
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
    /// The process of a simulated segment
    #[arg(long = "simulate", hide = true, value_name = "FILE")]
    simulate: Option<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match &arguments.simulate {
        Some(file) => segment_process::run(file),
        None => run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // The daemon says what its segment has said.
        Err(_) if arguments.simulate.is_some() => ExitCode::from(2),
        Err(error) => {
            say(format_args!("{error}"));
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), String> {
    check(&arguments.masters)?;
    let held = HeldSignals::hold();
    let mut masters = Vec::new();
    for option in &arguments.masters {
        let wires = Wires::of(&option.source).map_err(|error| format!("master {}: {error}", option.master))?;
        masters.push(Master::new(option.master, option.source.to_string(), wires));
    }
    let rights = Rights { group: arguments.group, mode: arguments.mode };
    let stop_limit = Duration::from_millis(arguments.stop_limit);
    let daemon = Daemon::start(masters, &arguments.socket, rights, stop_limit)?;
    say(format_args!("listens at {}", arguments.socket.display()));
    while held.wait(LOOK).is_none() {
        daemon.look_after();
    }
    Ok(())
}
