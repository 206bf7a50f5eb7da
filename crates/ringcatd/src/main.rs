//! The program `ringcatd`: see `ringcatd --help`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use ringcat_control::socket::to_listen_at;
use ringcat_link::print::{error_line, line};
use ringcatd::conf::Conf;
use ringcatd::conf::place::Place;
use ringcatd::log::{flush, say};
use ringcatd::running;
use ringcatd::setup::{Setup, SetupOptions};
use ringcatd::{check, opener, segment_process, service_control};

/// Drives EtherCAT segments while no application does, and hands them over to applications.
#[derive(Debug, Parser)]
#[command(name = "ringcatd", version, max_term_width = 100)]
struct Arguments {
    /// Read this configuration file: the variables of IgH's ethercat.conf and those of RingCAT
    ///
    /// Options count before its variables.
    #[arg(long, value_name = "FILE")]
    conf: Option<PathBuf>,
    /// Say what of the configuration was understood, and end; change nothing
    ///
    /// Without --conf the file that counts is read: /etc/ethercat.conf under systemd, else /etc/sysconfig/ethercat. The
    /// exit code is 0 if nothing is wrong, otherwise 2.
    #[arg(long)]
    check: bool,
    #[command(flatten)]
    options: SetupOptions,
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
    /// A process that the daemon has started, which reports its failures.
    Part,
}

fn main() -> ExitCode {
    if is_called(service_control::NAME) {
        return service_control::main();
    }
    let arguments = Arguments::parse();
    if arguments.check {
        return match look(arguments) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                error_line(&error);
                ExitCode::from(2)
            }
        };
    }
    let (role, result) = match &arguments.simulate {
        Some(file) => (Role::Part, segment_process::run(file)),
        None if arguments.open_sockets => (Role::Part, opener::run()),
        None => (Role::Daemon, run(arguments)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // The daemon reports the error of the other process.
        Err(_) if role == Role::Part => ExitCode::from(2),
        Err(error) => {
            error.lines().for_each(|line| say(format_args!("{line}")));
            flush();
            ExitCode::from(2)
        }
    }
}

/// Whether this program was started under that name.
fn is_called(name: &str) -> bool {
    std::env::args_os().next().is_some_and(|called| Path::new(&called).file_name().is_some_and(|file| file == name))
}

fn run(arguments: Arguments) -> Result<(), String> {
    let conf =
        arguments.conf.as_deref().map(Conf::read_with_segments).transpose().map_err(|error| error.to_string())?;
    running::run(&Setup::new(arguments.options, conf.unwrap_or_default())?)
}

/// Says what was understood.
fn look(arguments: Arguments) -> Result<(), String> {
    let is_named = arguments.conf.is_some() || !arguments.options.masters.is_empty();
    let place = Place::find();
    let file = match arguments.conf {
        None if is_named => None,
        None => {
            print(&place.to_string())?;
            Some(place.path)
        }
        Some(named) => {
            print(&format!("{}, as --conf names it", named.display()))?;
            Some(named)
        }
    };
    let conf = file
        .as_deref()
        .map(Conf::read_with_segments)
        .transpose()
        .map_err(|error| error.to_string())?
        .unwrap_or_default();
    let setup = Setup::new(arguments.options, conf.clone())?;
    let socket = match &setup.socket {
        Some(path) => path.display().to_string(),
        None => to_listen_at(|name| std::env::var_os(name))?.display().to_string(),
    };
    for understood in check::lines(&conf, &setup, &socket) {
        print(&understood)?;
    }
    setup.check_interfaces()
}

fn print(text: &str) -> Result<(), String> {
    line(text).map_err(|error| format!("the standard output: {error}"))
}
