//! The options of every command that works with a segment: its interfaces or a master of the daemon, the thread that
//! sends and receives, a recording.

mod arguments;

use ringcat::daemon::{DaemonError, DaemonLinks, HandedLink, HandedLinks, OwnedBus, socket};
use ringcat::tee::Tee;
use ringcat::{EitherLinks, Options, Scan, SupervisorThread};
use ringcat_link::realtime::CpuLatency;

pub use self::arguments::AccessArguments;
use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, LinkNames};
use crate::recording::Recording;
use crate::surroundings::Surroundings;

/// Links of a command: interfaces that it has opened, or those of a daemon; with a possible recording.
pub type WireLinks = Tee<DaemonLinks>;

/// A segment, with a thread for its acyclic half.
#[derive(Debug)]
pub struct Access {
    /// The interfaces, also where a daemon has opened them.
    pub interfaces: InterfaceArguments,
    /// The acyclic half.
    pub supervisor: SupervisorThread,
    /// Links of the cyclic half.
    pub cyclic: WireLinks,
    /// What is noticed around the segment.
    pub surroundings: Surroundings,
    /// The recording.
    pub recording: Recording,
    /// What the command has of a daemon.
    pub daemon_bus: DaemonBus,
    /// Keeps processors awake.
    pub awake: Option<CpuLatency>,
}

/// The bus of a daemon, until it is given back; or none.
#[derive(Debug)]
pub struct DaemonBus(Option<OwnedBus>);

impl DaemonBus {
    /// What the daemon knew of the segment; `None` where this command scans.
    pub fn scan(&self) -> Option<Scan> {
        self.0.as_ref().and_then(|bus| bus.scan().ok())
    }

    /// Gives the bus back. The reason, where the daemon does not have it from this command.
    pub fn end(self) -> Option<String> {
        self.0.and_then(|bus| bus.release().err()).map(|error| error.to_string())
    }
}

impl From<DaemonError> for Failure {
    fn from(error: DaemonError) -> Failure {
        Failure::new(error.to_string())
    }
}

impl AccessArguments {
    /// Opens the interfaces, or takes the bus of a master from a daemon, and starts the acyclic half.
    pub fn begin(&self, options: &Options) -> Result<Access, Failure> {
        match self.master {
            Some(master) => self.take(master, options),
            None => self.open(options),
        }
    }

    fn open(&self, options: &Options) -> Result<Access, Failure> {
        let (interfaces, thread) = (self.interfaces.clone(), self.thread);
        let (cyclic, acyclic) = interfaces.open_halves(thread)?;
        let surroundings = Surroundings::watch(&interfaces, &cyclic);
        let recording = self.recording.start(&interfaces)?;
        let (cyclic, acyclic) = (recording.tee(Tee::new(EitherLinks::First(cyclic), None)), recording.tee(acyclic));
        let awake = thread.prepare_process();
        let supervisor = SupervisorThread::start(acyclic, options, move || thread.prepare_supervisor())?;
        Ok(Access { interfaces, supervisor, cyclic, surroundings, recording, daemon_bus: DaemonBus(None), awake })
    }

    fn take(&self, master: u32, options: &Options) -> Result<Access, Failure> {
        let thread = self.thread;
        let awake = thread.prepare_process();
        let path = self.socket.clone().unwrap_or_else(socket);
        let mut begun = None;
        let around = |handed: &HandedLinks, links| {
            let mut interfaces = self.interfaces.clone();
            interfaces.links = names(handed, master);
            let recording = self.recording.start(&interfaces);
            Ok(match begun.insert((interfaces, recording)) {
                (_, Ok(recording)) => recording.tee(links),
                (_, Err(_)) => Tee::new(links, None),
            })
        };
        let taken = OwnedBus::take_with(&path, master, "ringcat", options, move || thread.prepare_supervisor(), around);
        let mut bus = taken?;
        let (interfaces, recording) = begun.ok_or_else(|| Failure::new("the daemon has handed over no links"))?;
        let recording = recording?;
        let links = bus.take_links().ok_or_else(|| Failure::new("the daemon has handed over no links"))?;
        let surroundings = match links.links() {
            EitherLinks::First(links) => Surroundings::watch(&interfaces, links),
            EitherLinks::Second(_) => Surroundings::unwatched(&interfaces),
        };
        let (cyclic, supervisor) = (recording.tee(links), bus.supervisor().clone());
        Ok(Access { interfaces, supervisor, cyclic, surroundings, recording, daemon_bus: DaemonBus(Some(bus)), awake })
    }
}

/// Names of links that a daemon has opened.
fn names(handed: &HandedLinks, master: u32) -> LinkNames {
    let name = |link: &HandedLink, end| match link {
        HandedLink::Interface { name, .. } => name.clone(),
        _ => format!("master {master}, {end}"),
    };
    let redundant = handed.redundant.as_ref().map(|link| name(link, "redundant link"));
    LinkNames { main: name(&handed.main, "main link"), redundant }
}
