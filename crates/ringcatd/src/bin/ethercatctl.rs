//! The program `ethercatctl`: start, stop, restart, status and check of the EtherCAT service.
//!
//! Under systemd it calls `systemctl`; without it, or with `--conf`, it starts and ends `ringcatd` itself.
#![forbid(unsafe_code)]

use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use clap::{Parser, ValueEnum};
use ringcat_control::client::ClientError;
use ringcat_control::message::{Answer, MasterState, Query};
use ringcat_control::socket::to_listen_at;
use ringcat_control::{Client, visible};
use ringcat_link::process::{wait_readable, watch};
use ringcatd::conf::Conf;
use ringcatd::conf::place::Place;

/// The unit of the service.
const UNIT: &str = "ethercat.service";
/// `ringcatd` is ready within this time.
const START: Duration = Duration::from_secs(60);
/// It has ended within this time after a signal.
const STOP: Duration = Duration::from_secs(10);
/// Interval of checks whether it has ended early.
const LOOK: Duration = Duration::from_millis(100);
/// Exit code of the LSB for a service that does not run.
const NOT_RUNNING: u8 = 3;

/// Starts and stops EtherCAT masters, and says how they are.
#[derive(Debug, Parser)]
#[command(name = "ethercatctl", version, max_term_width = 100)]
struct Arguments {
    #[arg(value_enum)]
    verb: Verb,
    /// Use this configuration file, and ringcatd without the service manager
    #[arg(long, value_name = "FILE")]
    conf: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Verb {
    /// Starts ringcatd, and waits until its masters are ready
    Start,
    /// Ends ringcatd; an application that drives a bus goes on
    Stop,
    /// Stop, then start
    Restart,
    /// Says what drives each master; exit code 3 if ringcatd does not run
    Status,
    /// Says what of the configuration was understood; changes nothing
    Check,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("ethercatctl: {}", visible(&error));
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode, String> {
    let place = Place::find();
    let is_of_manager = place.is_systemd() && arguments.conf.is_none();
    let conf = arguments.conf.clone().unwrap_or(place.path);
    match arguments.verb {
        Verb::Check => check(arguments.conf.as_deref()),
        Verb::Status => status(&conf),
        Verb::Start if is_of_manager => systemctl("start"),
        Verb::Stop if is_of_manager => systemctl("stop"),
        Verb::Restart if is_of_manager => systemctl("restart"),
        Verb::Start => start(&conf),
        Verb::Stop => stop(&conf),
        Verb::Restart => {
            // With a wrong configuration the daemon that runs goes on.
            Conf::read(&conf).map_err(|error| error.to_string())?;
            stop(&conf)?;
            start(&conf)
        }
    }
}

fn systemctl(verb: &str) -> Result<ExitCode, String> {
    done(Command::new("systemctl").args([verb, UNIT]))
}

fn done(command: &mut Command) -> Result<ExitCode, String> {
    let status = command.status().map_err(|error| format!("{}: {error}", command.get_program().display()))?;
    Ok(ExitCode::from(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)))
}

/// `ringcatd` beside this program.
fn daemon() -> Result<PathBuf, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    Ok(own.with_file_name("ringcatd"))
}

fn check(conf: Option<&Path>) -> Result<ExitCode, String> {
    let mut command = Command::new(daemon()?);
    command.arg("--check");
    if let Some(conf) = conf {
        command.arg("--conf").arg(conf);
    }
    done(&mut command)
}

/// Where the daemon of this configuration listens.
fn socket(conf: &Path) -> Result<PathBuf, String> {
    match Conf::read(conf).ok().and_then(|conf| conf.own.socket) {
        Some(socket) => Ok(socket),
        None => to_listen_at(|name| std::env::var_os(name)),
    }
}

/// A connection to the daemon; `None`: it does not run.
fn connect(conf: &Path) -> Result<Option<Client>, String> {
    match Client::connect(&socket(conf)?, "ethercatctl") {
        Ok(client) => Ok(Some(client)),
        Err(ClientError::NoDaemon { .. }) => Ok(None),
        Err(error) => Err(error.to_string()),
    }
}

fn status(conf: &Path) -> Result<ExitCode, String> {
    let Some(mut client) = connect(conf)? else {
        println!("ringcatd does not run");
        return Ok(ExitCode::from(NOT_RUNNING));
    };
    println!("ringcatd runs (process {})", client.daemon_pid());
    let Ok((Answer::Masters(masters), _)) = client.ask(0, Query::Masters, Vec::new()) else {
        return Err("ringcatd does not say which masters it has".to_owned());
    };
    for MasterState { master, links, owner, fault, .. } in masters {
        let state = match (owner, fault) {
            (_, Some(fault)) => format!("not driven: {fault}"),
            (Some(owner), None) => format!("driven by {owner}"),
            (None, None) => "idle".to_owned(),
        };
        println!("{}", visible(&format!("master {master} ({links}): {state}")));
    }
    Ok(ExitCode::SUCCESS)
}

fn start(conf: &Path) -> Result<ExitCode, String> {
    if let Some(client) = connect(conf)? {
        println!("ringcatd runs already (process {})", client.daemon_pid());
        return Ok(ExitCode::SUCCESS);
    }
    Conf::read(conf).map_err(|error| error.to_string())?;
    let failed = |error: std::io::Error| format!("ringcatd: {error}");
    let name = format!("ringcat-ethercatctl-{}", std::process::id());
    let address = SocketAddr::from_abstract_name(&name).map_err(failed)?;
    let ready = UnixDatagram::bind_addr(&address).map_err(failed)?;
    ready.set_read_timeout(Some(LOOK)).map_err(failed)?;
    let mut command = Command::new(daemon()?);
    command.arg("--conf").arg(conf).env("NOTIFY_SOCKET", format!("@{name}"));
    // Its lines go to the log of the system, where there is one.
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).current_dir("/").process_group(0);
    let mut child = command.spawn().map_err(failed)?;
    let lines = child.stderr.take().map_or_else(Stdio::null, Stdio::from);
    let mut logger = Command::new("logger");
    logger.args(["-t", "ringcatd", "-p", "daemon.info"]).stdin(lines).stdout(Stdio::null()).stderr(Stdio::null());
    if logger.process_group(0).spawn().is_err() {
        println!("logger is not there: lines of ringcatd are lost");
    }
    wait_until_ready(&ready, &mut child)
}

fn wait_until_ready(ready: &UnixDatagram, child: &mut Child) -> Result<ExitCode, String> {
    let begin = Instant::now();
    let mut buffer = [0; 1024];
    while begin.elapsed() < START {
        match ready.recv(&mut buffer) {
            Ok(length) => {
                let text = String::from_utf8_lossy(&buffer[..length]).into_owned();
                if text.lines().any(|line| line == "READY=1") {
                    let status = text.lines().find_map(|line| line.strip_prefix("STATUS="));
                    println!("{}", visible(status.unwrap_or("ready")));
                    return Ok(ExitCode::SUCCESS);
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error.to_string()),
        }
        if let Ok(Some(status)) = child.try_wait() {
            return Err(format!("ringcatd has ended ({status}); the log of the system says why"));
        }
    }
    Err(format!("ringcatd is not ready after {} s; it runs (process {})", START.as_secs(), child.id()))
}

fn stop(conf: &Path) -> Result<ExitCode, String> {
    let Some(client) = connect(conf)? else {
        println!("ringcatd does not run");
        return Ok(ExitCode::SUCCESS);
    };
    let pid = client.daemon_pid();
    let end = watch(pid).map_err(|error| format!("process {pid}: {error}"))?;
    let sent = Command::new("kill").args(["-TERM", &pid.to_string()]).status();
    if !sent.is_ok_and(|status| status.success()) {
        return Err(format!("process {pid} cannot be ended"));
    }
    match wait_readable(&[end.as_fd()], STOP) {
        0 => Err(format!("process {pid} has not ended after {} s", STOP.as_secs())),
        _ => Ok(ExitCode::SUCCESS),
    }
}
