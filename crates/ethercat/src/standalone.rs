//! A bus for the length of one command: `--main`, `--redundant` and `--sim`.
//!
//! The daemon `ringcatd` drives it, as a process of this command with a socket of its own. It is killed at the end, and
//! ends by itself with the command, however that ends. All SubDevices stay as they are then: in PREOP, unless the
//! command has brought them to another state.

use std::fs;
use std::io::{ErrorKind, Read};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat_control::Client;
use ringcat_control::client::ClientError;
use ringcat_control::message::{Activity, Answer, Query};
use ringcat_control::tool::{MasterReport, Piece, ToolAnswer, ToolQuery};
use ringcat_link::job::leave_to_others;

use crate::arguments::Arguments;
use crate::failure::{Failure, unexpected};
use crate::progress;

/// The daemon's program.
const PROGRAM: &str = "ringcatd";
/// A segment is scanned, and its SubDevices are in PREOP, within this time.
const START: Duration = Duration::from_secs(20);
/// SubDevices whose states do not change for this time stay as they are.
const STILL: Duration = Duration::from_millis(500);
/// Interval of checks.
const LOOK: Duration = Duration::from_millis(2);
/// An interface that was just switched on has a link, and a segment with a link was scanned, within this time.
const LINK: Duration = Duration::from_secs(3);
/// Register AL Status in PREOP without an error (ETG.1000.6).
const PREOP: u16 = 2;
/// Beginning of the event of a scan that failed.
const FAILED_SCAN: &str = "scan failed";
/// Where no frame returns there is no scan.
const NO_SLAVE: &str = "no slave answers: is the cable plugged in at its input, and does it have power? A ring needs \
                        its second interface too: --redundant";
/// The master that the daemon drives.
const MASTER: u32 = 0;

/// Longest path of a socket that the kernel takes, without what is behind the directory.
const LONGEST_DIRECTORY: usize = 64;
/// Longest name of an interface.
const LONGEST_NAME: usize = 15;
/// Wait for the standard error of a daemon that has ended.
const READ_LIMIT: Duration = Duration::from_millis(500);
const MOST_WORDS: usize = 4096;

/// The daemon of one command.
#[derive(Debug)]
pub struct Standalone {
    daemon: Child,
    /// Its messages before its end.
    standard_error: Option<JoinHandle<String>>,
}

/// A bus that a daemon of this command drives.
#[derive(Debug)]
pub struct Started {
    /// The daemon.
    pub standalone: Standalone,
    /// The connection to it.
    pub client: Client,
    /// Another one, where bars are shown.
    pub second: Option<Client>,
}

/// The links that the options name, as the option of the daemon; `None` without such an option.
///
/// # Errors
/// Options do not fit together.
pub fn links(arguments: &Arguments) -> Result<Option<String>, String> {
    for (option, name) in [("--main", &arguments.main), ("--redundant", &arguments.redundant)] {
        let Some(name) = name.as_deref().filter(|name| !is_interface(name)) else { continue };
        return Err(format!("option {option}: '{name}' is neither the name nor the address of an interface"));
    }
    match (&arguments.main, &arguments.redundant, &arguments.sim) {
        (None, None, None) => Ok(None),
        (.., Some(file)) if file.is_empty() => Err("option --sim needs the name of a file".to_owned()),
        (Some(main), None, None) => Ok(Some(main.clone())),
        (Some(main), Some(redundant), None) if main == redundant => {
            Err("options --main and --redundant name the same interface".to_owned())
        }
        (Some(main), Some(redundant), None) => Ok(Some(format!("{main},{redundant}"))),
        (None, None, Some(file)) => Ok(Some(format!("sim:{file}"))),
        (None, Some(_), _) => Err("option --redundant needs --main".to_owned()),
        (Some(_), _, Some(_)) => Err("options --main and --sim exclude each other".to_owned()),
    }
}

/// Whether it can be the name of an interface, or is an address.
fn is_interface(name: &str) -> bool {
    let is_address = name.split(':').count() == 6 && name.len() <= 17;
    let is_name = (1..=LONGEST_NAME).contains(&name.len());
    let has_separator = |byte: u8| matches!(byte, b',' | b'/' | b'=' | b':') || byte.is_ascii_whitespace();
    is_address || is_name && !name.bytes().any(has_separator)
}

impl Standalone {
    /// Starts the daemon on these links, and waits until the segment is known and its SubDevices are in PREOP or stay
    /// where they are.
    ///
    /// # Errors
    /// The daemon cannot be started, or cannot drive the bus.
    pub fn start(links: &str) -> Result<Started, Failure> {
        let begin = Instant::now();
        let directory = PrivateDirectory::new()?;
        let socket = directory.0.join("control");
        let spawned = Command::new(program())
            .args(["--while-input-is-open", "--needs-backup", "--no-eoe", "--master"])
            .arg(format!("{MASTER}={links}"))
            .arg("--socket")
            .arg(&socket)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let cannot = |error| Failure::failed(format!("'{}' cannot be started: {error}", program().display()));
        let mut daemon = spawned.map_err(cannot)?;
        let standard_error = listen_to(daemon.stderr.take());
        let mut standalone = Standalone { daemon, standard_error };
        let mut client = standalone.connect(&socket, begin)?;
        let second = progress::is_shown().then(|| Client::connect(&socket, "ethercat").ok()).flatten();
        // The connections are enough: nothing is left where the command is ended by a signal.
        drop(directory);
        check(&mut client)?;
        settle(&mut client, begin)?;
        Ok(Started { standalone, client, second })
    }

    /// Waits until the daemon answers.
    fn connect(&mut self, socket: &Path, begin: Instant) -> Result<Client, Failure> {
        loop {
            match Client::connect(socket, "ethercat") {
                Ok(client) => return Ok(client),
                Err(ClientError::NoDaemon { .. }) => {}
                Err(error) => return Err(error.into()),
            }
            if let Ok(Some(_)) = self.daemon.try_wait() {
                return Err(Failure::failed(self.daemon_errors()));
            }
            if begin.elapsed() >= START {
                return Err(late("ringcatd does not answer"));
            }
            std::thread::sleep(LOOK);
        }
    }

    /// The standard error of the daemon, once it has ended.
    fn daemon_errors(&mut self) -> String {
        let begin = Instant::now();
        // A process that it has started may still have its standard error.
        while self.standard_error.as_ref().is_some_and(|reader| !reader.is_finished()) && begin.elapsed() < READ_LIMIT {
            std::thread::sleep(LOOK);
        }
        let reader = self.standard_error.take().filter(JoinHandle::is_finished);
        let text = reader.and_then(|reader| reader.join().ok()).unwrap_or_default();
        match text.trim_end() {
            "" => "ringcatd has ended".to_owned(),
            text => text.to_owned(),
        }
    }
}

impl Drop for Standalone {
    fn drop(&mut self) {
        // It may have ended. Nothing is under way: the command has its answers.
        let _ = self.daemon.kill();
        let _ = self.daemon.wait();
    }
}

/// Reads the messages of the daemon, to its end. The beginning is kept: it shows why the daemon does not start.
fn listen_to(stderr: Option<ChildStderr>) -> Option<JoinHandle<String>> {
    let mut stderr = stderr?;
    let read = move || {
        // `watch` gives the terminal back before a signal takes effect.
        leave_to_others();
        let (mut kept, mut part) = (Vec::new(), [0; 1024]);
        while let Ok(count @ 1..) = stderr.read(&mut part) {
            let room = MOST_WORDS - kept.len();
            kept.extend(&part[..count.min(room)]);
        }
        String::from_utf8_lossy(&kept).into_owned()
    };
    // If the thread cannot be started, the output of the daemon is not shown.
    std::thread::Builder::new().name("ringcatd".into()).spawn(read).ok()
}

fn late(what: &str) -> Failure {
    Failure::failed(format!("{what} after {} s", START.as_secs()))
}

/// Whether the daemon drives the bus.
fn check(client: &mut Client) -> Result<(), Failure> {
    match client.ask_patiently(MASTER, &Query::Masters, &[])? {
        (Answer::Masters(masters), _) => match masters.into_iter().find_map(|master| master.fault) {
            Some(fault) => Err(Failure::failed(fault)),
            None => Ok(()),
        },
        _ => Err(unexpected()),
    }
}

/// Waits until the segment is scanned and its SubDevices are in PREOP, or stay where they are.
fn settle(client: &mut Client, begin: Instant) -> Result<(), Failure> {
    let (mut last, mut since, mut linked) = (None, Instant::now(), None);
    loop {
        let report = master(client)?;
        let states = states(client)?;
        let are_in_preop = !states.is_empty() && states.iter().all(|state| *state == Some(PREOP));
        let has_link = report.links.iter().any(|link| link.carrier != Some(false));
        linked = linked.filter(|_| has_link).or_else(|| has_link.then(Instant::now));
        if last.as_ref() != Some(&states) {
            (last, since) = (Some(states), Instant::now());
        }
        let is_settled = are_in_preop || since.elapsed() >= STILL;
        if has_link && !report.is_scanning && is_settled {
            match activity(client)? {
                Activity::Scanned => return Ok(()),
                Activity::Unscanned if linked.is_some_and(|since: Instant| since.elapsed() >= LINK) => {
                    return Err(Failure::failed(why_no_scan(client)?));
                }
                _ => {}
            }
        }
        if !has_link && begin.elapsed() >= LINK {
            return Err(Failure::failed("no link: is the cable plugged in, and does the first slave have power?"));
        }
        if begin.elapsed() >= START {
            return Err(late("the slaves are not in PREOP"));
        }
        std::thread::sleep(LOOK);
    }
}

fn activity(client: &mut Client) -> Result<Activity, Failure> {
    match client.ask_patiently(MASTER, &Query::State, &[])? {
        (Answer::State(state), _) => Ok(state.activity),
        _ => Err(unexpected()),
    }
}

/// The error of the last failed scan.
fn why_no_scan(client: &mut Client) -> Result<String, Failure> {
    let (mut from, mut last) = (0, None);
    loop {
        let (answer, _) = client.ask_patiently(MASTER, &Query::Events { from }, &[])?;
        let Answer::Events { next, events, .. } = answer else { return Err(unexpected()) };
        let failed = events.iter().rev().find(|event| event.text.starts_with(FAILED_SCAN));
        last = failed.map(|event| event.text.clone()).or(last);
        if events.is_empty() || next <= from {
            return Ok(last.unwrap_or_else(|| NO_SLAVE.to_owned()));
        }
        from = next;
    }
}

fn master(client: &mut Client) -> Result<Box<MasterReport>, Failure> {
    match client.ask_patiently(MASTER, &Query::Tool(ToolQuery::Master), &[])? {
        (Answer::Tool(ToolAnswer::Master(report)), _) => Ok(report),
        _ => Err(unexpected()),
    }
}

/// AL Status of the first SubDevices, as many as an answer has.
fn states(client: &mut Client) -> Result<Vec<Option<u16>>, Failure> {
    let ask = Query::Tool(ToolQuery::SubDevices { from: 0 });
    match client.ask_patiently(MASTER, &ask, &[])? {
        (Answer::Tool(ToolAnswer::SubDevices(Piece { these, .. })), _) => {
            Ok(these.iter().map(|line| line.status).collect())
        }
        _ => Err(unexpected()),
    }
}

/// The program beside this one, or that of the search path.
fn program() -> PathBuf {
    let beside = std::env::current_exe().ok().map(|this| this.with_file_name(PROGRAM));
    beside.filter(|path| path.is_file()).unwrap_or_else(|| PathBuf::from(PROGRAM))
}

/// A new directory that only this user can enter. It is removed with what is in it when this is dropped.
struct PrivateDirectory(PathBuf);

impl PrivateDirectory {
    fn new() -> Result<PrivateDirectory, Failure> {
        // The path of a socket is short.
        let named = Some(std::env::temp_dir()).filter(|path| path.as_os_str().len() <= LONGEST_DIRECTORY);
        let place = named.unwrap_or_else(|| PathBuf::from("/tmp"));
        for number in 0..u32::MAX {
            let path = place.join(format!("ethercat-{}-{number}", std::process::id()));
            match fs::DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => return Ok(PrivateDirectory(path)),
                // An earlier process with this number has left its directory.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(Failure::failed(format!("'{}' cannot be made: {error}", path.display()))),
            }
        }
        Err(Failure::failed("there is no name for a temporary directory"))
    }
}

impl Drop for PrivateDirectory {
    fn drop(&mut self) {
        // What stays is a socket that nothing listens at.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn options_name_one_bus_or_say_what_does_not_fit() {
        let named = |main: Option<&str>, redundant: Option<&str>, sim: Option<&str>| {
            let text = |it: Option<&str>| it.map(str::to_owned);
            let (main, redundant, sim) = (text(main), text(redundant), text(sim));
            links(&Arguments { main, redundant, sim, ..Arguments::default() })
        };
        assert_eq!(named(None, None, None), Ok(None));
        assert_eq!(named(Some("eth1"), None, None), Ok(Some("eth1".to_owned())));
        assert_eq!(named(Some("eth1"), Some("eth2"), None), Ok(Some("eth1,eth2".to_owned())));
        assert_eq!(named(None, None, Some("a.toml")), Ok(Some("sim:a.toml".to_owned())));
        assert_eq!(named(Some("00:00:08:44:ab:66"), None, None), Ok(Some("00:00:08:44:ab:66".to_owned())));
        for name in ["a,b", "sim:a.toml", "", "sixteen-letters-", "a/b", "0=a", "a b"] {
            assert!(named(Some(name), None, None).is_err_and(|text| text.contains(&format!("'{name}' is neither"))));
        }
        assert!(named(None, None, Some("")).is_err_and(|text| text.contains("--sim")));
        for wrong in [named(None, Some("eth2"), None), named(Some("eth1"), None, Some("a.toml"))] {
            assert!(wrong.is_err_and(|text| text.contains("--main")));
        }
    }
}
