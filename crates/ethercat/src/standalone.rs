//! A bus for the length of one command: `--main`, `--redundant` and `--sim`.
//!
//! The daemon `ringcatd` drives it, as a process of this command with a socket of its own. It is killed at the end, and
//! ends by itself with the command, however that ends. All SubDevices stay as they are then: in PREOP, unless the
//! command has asked for another state.

use std::fs;
use std::io::{ErrorKind, Read};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ringcat_control::Client;
use ringcat_control::client::ClientError;
use ringcat_control::message::{Answer, Query};
use ringcat_control::tool::{MasterReport, Piece, ToolAnswer, ToolQuery};

use crate::arguments::Arguments;
use crate::failure::{Failure, unexpected};

/// The daemon's program.
const PROGRAM: &str = "ringcatd";
/// A segment is scanned, and its SubDevices are in PREOP, within this time.
const START: Duration = Duration::from_secs(20);
/// SubDevices whose states do not change for this time stay as they are.
const STILL: Duration = Duration::from_millis(500);
/// Interval of looks.
const LOOK: Duration = Duration::from_millis(2);
/// An interface that was just switched on has a link within this time.
const LINK: Duration = Duration::from_secs(3);
/// Register AL Status in PREOP without an error (ETG.1000.6).
const PREOP: u16 = 2;
/// The master that the daemon drives.
const MASTER: u32 = 0;

/// The daemon of one command.
#[derive(Debug)]
pub struct Standalone(Child);

/// The links that the options name, as the option of the daemon; `None` without such an option.
///
/// # Errors
/// Options do not fit together.
pub fn links(arguments: &Arguments) -> Result<Option<String>, String> {
    match (&arguments.main, &arguments.redundant, &arguments.sim) {
        (None, None, None) => Ok(None),
        (Some(main), None, None) => Ok(Some(main.clone())),
        (Some(main), Some(redundant), None) => Ok(Some(format!("{main},{redundant}"))),
        (None, None, Some(file)) => Ok(Some(format!("sim:{file}"))),
        (None, Some(_), _) => Err("option --redundant needs --main".to_owned()),
        (Some(_), _, Some(_)) => Err("options --main and --sim exclude each other".to_owned()),
    }
}

impl Standalone {
    /// Starts the daemon on these links, and waits until the segment is known and its SubDevices are in PREOP or stay
    /// where they are. The daemon, and the connection to it.
    ///
    /// # Errors
    /// The daemon cannot be started, or cannot drive the bus.
    pub fn start(links: &str) -> Result<(Standalone, Client), Failure> {
        let begin = Instant::now();
        let directory = PrivateDirectory::new()?;
        let socket = directory.0.join("control");
        let spawned = Command::new(program())
            .args(["--while-input-is-open", "--no-eoe", "--master"])
            .arg(format!("{MASTER}={links}"))
            .arg("--socket")
            .arg(&socket)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let cannot = |error| Failure::failed(format!("'{}' cannot be started: {error}", program().display()));
        let mut standalone = Standalone(spawned.map_err(cannot)?);
        let mut client = standalone.connect(&socket, begin)?;
        // The connection is enough: nothing is left where the command is ended by a signal.
        drop(directory);
        check(&mut client)?;
        settle(&mut client, begin)?;
        Ok((standalone, client))
    }

    /// Waits until the daemon answers.
    fn connect(&mut self, socket: &Path, begin: Instant) -> Result<Client, Failure> {
        loop {
            match Client::connect(socket, "ethercat") {
                Ok(client) => return Ok(client),
                Err(ClientError::NoDaemon { .. }) => {}
                Err(error) => return Err(error.into()),
            }
            if let Ok(Some(_)) = self.0.try_wait() {
                return Err(Failure::failed(self.said()));
            }
            if begin.elapsed() >= START {
                return Err(late("ringcatd does not answer"));
            }
            std::thread::sleep(LOOK);
        }
    }

    /// What the daemon has said before its end.
    fn said(&mut self) -> String {
        let mut text = String::new();
        if let Some(stderr) = &mut self.0.stderr {
            // What cannot be read was not said.
            let _ = stderr.read_to_string(&mut text);
        }
        match text.trim_end() {
            "" => "ringcatd has ended".to_owned(),
            text => text.to_owned(),
        }
    }
}

impl Drop for Standalone {
    fn drop(&mut self) {
        // It may have ended. Nothing is under way: the command has its answers.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
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

/// Waits until the segment is known and its SubDevices are in PREOP, or stay where they are.
fn settle(client: &mut Client, begin: Instant) -> Result<(), Failure> {
    let (mut last, mut since) = (None, Instant::now());
    loop {
        let report = master(client)?;
        let states = states(client)?;
        let are_in_preop = !states.is_empty() && states.iter().all(|state| *state == Some(PREOP));
        if last.as_ref() != Some(&states) {
            (last, since) = (Some(states), Instant::now());
        }
        let has_link = report.links.iter().any(|link| link.carrier != Some(false));
        if has_link && !report.is_scanning && (are_in_preop || since.elapsed() >= STILL) {
            return Ok(());
        }
        if !has_link && begin.elapsed() >= LINK {
            return Err(Failure::failed("no link: is the cable plugged in, and has the first slave power?"));
        }
        if begin.elapsed() >= START {
            return Err(late("the slaves are not in PREOP"));
        }
        std::thread::sleep(LOOK);
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
        for number in 0..u32::MAX {
            let path = std::env::temp_dir().join(format!("ethercat-{}-{number}", std::process::id()));
            match fs::DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => return Ok(PrivateDirectory(path)),
                // One of an earlier process with this number.
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
        for wrong in [named(None, Some("eth2"), None), named(Some("eth1"), None, Some("a.toml"))] {
            assert!(wrong.is_err_and(|text| text.contains("--main")));
        }
    }
}
