//! The program `ethercatctl`: start, stop, restart, status and check of the EtherCAT service.
//!
//! Under systemd it calls `systemctl`; without it, or with `--conf`, it starts and ends `ringcatd` itself. A daemon of
//! another control version is found by its socket, so that it can be ended.

use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram, UnixStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use clap::{Parser, ValueEnum};
use ringcat_control::client::ClientError;
use ringcat_control::message::{Answer, MasterState, Query};
use ringcat_control::socket::to_listen_at;
use ringcat_control::{Client, Refusal};
use ringcat_link::print::{error_line, line};
use ringcat_link::process::{Peer, wait_readable, watch};

use crate::conf::Conf;
use crate::conf::place::Place;

/// Name of this program.
pub const NAME: &str = "ethercatctl";
/// Name of the daemon: of its file, and of its process.
const DAEMON: &str = "ringcatd";
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

/// Starts and stops EtherCAT masters, and reports their state.
#[derive(Debug, Parser)]
#[command(name = NAME, version, max_term_width = 100)]
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
    /// Reports what drives each master; exit code 3 if ringcatd does not run
    Status,
    /// Reports the settings of the configuration and its mistakes; changes nothing
    Check,
}

/// Runs the program.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(code) => code,
        Err(error) => {
            error_line(&format!("{NAME}: {error}"));
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode, String> {
    let place = Place::find();
    let is_of_manager = place.is_systemd() && arguments.conf.is_none();
    // The daemon is started in another directory.
    let conf =
        std::path::absolute(arguments.conf.as_ref().unwrap_or(&place.path)).map_err(|error| error.to_string())?;
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
            Conf::read_with_segments(&conf).map_err(|error| error.to_string())?;
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

/// `ringcatd` beside this program, which may be the same file.
fn program() -> Result<PathBuf, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    Ok(own.with_file_name(DAEMON))
}

fn say(text: &str) -> Result<(), String> {
    line(text).map_err(|error| format!("the standard output: {error}"))
}

fn check(conf: Option<&Path>) -> Result<ExitCode, String> {
    let mut command = Command::new(program()?);
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

/// A daemon that runs.
struct Daemon {
    pid: u32,
    /// A connection to it; an error where it is of another version, or does not answer.
    client: Result<Client, ClientError>,
}

/// The daemon of this configuration; `None`: it does not run.
fn find(conf: &Path) -> Result<Option<Daemon>, String> {
    let socket = socket(conf)?;
    match Client::connect(&socket, NAME) {
        Ok(client) => Ok(Some(Daemon { pid: client.daemon_pid(), client: Ok(client) })),
        Err(ClientError::NoDaemon { .. }) => Ok(None),
        Err(error @ ClientError::NotPermitted { .. }) => Err(error.to_string()),
        Err(error) => {
            let pid = listener(&socket).map_err(|reason| format!("{error}; {reason}"))?;
            Ok(Some(Daemon { pid, client: Err(error) }))
        }
    }
}

/// The process that listens at this socket, if it is a daemon.
fn listener(socket: &Path) -> Result<u32, String> {
    let peer = UnixStream::connect(socket).and_then(|stream| Peer::of(&stream));
    let pid = peer.map_err(|error| format!("{}: {error}", socket.display()))?.pid;
    let name = std::fs::read_to_string(format!("/proc/{pid}/comm"));
    let name = name.map_err(|error| format!("process {pid}, which listens at {}: {error}", socket.display()))?;
    match name.trim_end() {
        DAEMON => Ok(pid),
        other => Err(format!("process {pid}, which listens at {}, is {other} and not {DAEMON}", socket.display())),
    }
}

fn status(conf: &Path) -> Result<ExitCode, String> {
    let Some(Daemon { pid, client }) = find(conf)? else {
        say("ringcatd does not run")?;
        return Ok(ExitCode::from(NOT_RUNNING));
    };
    say(&format!("ringcatd runs (process {pid})"))?;
    let mut client = match client {
        Ok(client) => client,
        Err(ClientError::Refused(Refusal::Version { here, there })) => {
            say(&format!(
                "it has control version {there}, this program {here}: its masters are not shown; {NAME} restart starts \
                 the ringcatd that is installed"
            ))?;
            return Ok(ExitCode::SUCCESS);
        }
        Err(error) => return Err(error.to_string()),
    };
    let Ok((Answer::Masters(masters), _)) = client.ask(0, Query::Masters, Vec::new()) else {
        return Err("ringcatd does not report its masters".to_owned());
    };
    for MasterState { master, links, owner, fault, .. } in masters {
        let state = match (owner, fault) {
            (_, Some(fault)) => format!("not driven: {fault}"),
            (Some(owner), None) => format!("driven by {owner}"),
            (None, None) => "idle".to_owned(),
        };
        say(&format!("master {master} ({links}): {state}"))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn start(conf: &Path) -> Result<ExitCode, String> {
    if let Some(Daemon { pid, client }) = find(conf)? {
        let of_another_version = match client {
            Ok(_) => "",
            Err(ClientError::Refused(Refusal::Version { .. })) => {
                ", in another version: ethercatctl restart starts the one that is installed"
            }
            Err(error) => return Err(format!("ringcatd runs already (process {pid}): {error}")),
        };
        say(&format!("ringcatd runs already (process {pid}){of_another_version}"))?;
        return Ok(ExitCode::SUCCESS);
    }
    Conf::read_with_segments(conf).map_err(|error| error.to_string())?;
    let failed = |error: std::io::Error| format!("ringcatd: {error}");
    let name = format!("ringcat-ethercatctl-{}", std::process::id());
    let address = SocketAddr::from_abstract_name(&name).map_err(failed)?;
    let ready = UnixDatagram::bind_addr(&address).map_err(failed)?;
    ready.set_read_timeout(Some(LOOK)).map_err(failed)?;
    let mut command = Command::new(program()?);
    command.arg("--conf").arg(conf).env("NOTIFY_SOCKET", format!("@{name}"));
    // Its lines go to the log of the system, where there is one.
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).current_dir("/").process_group(0);
    let mut child = command.spawn().map_err(failed)?;
    let lines = child.stderr.take().map_or_else(Stdio::null, Stdio::from);
    let mut logger = Command::new("logger");
    logger.args(["-t", "ringcatd", "-p", "daemon.info"]).stdin(lines).stdout(Stdio::null()).stderr(Stdio::null());
    if logger.process_group(0).spawn().is_err() {
        say("logger is not there: lines of ringcatd are lost")?;
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
                    say(status.unwrap_or("ready"))?;
                    return Ok(ExitCode::SUCCESS);
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error.to_string()),
        }
        if let Ok(Some(status)) = child.try_wait() {
            return Err(format!("ringcatd has ended ({status}); see the log of the system"));
        }
    }
    Err(format!("ringcatd is not ready after {} s; it runs (process {})", START.as_secs(), child.id()))
}

fn stop(conf: &Path) -> Result<ExitCode, String> {
    let Some(Daemon { pid, .. }) = find(conf)? else {
        say("ringcatd does not run")?;
        return Ok(ExitCode::SUCCESS);
    };
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
