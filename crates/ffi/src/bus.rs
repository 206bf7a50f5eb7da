//! The buses of this process: one for each master that is open, shared by all its handles.
//!
//! A bus has its links and the thread of the acyclic half, which scans and keeps all SubDevices in PREOP while no
//! application is active. One handle reserves it. Where a daemon answers, it comes from there when a handle reserves
//! it, and goes back with that handle; others send queries to the daemon ([`crate::responder`]).

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use ringcat::daemon::{
    BusLog, BusSettings, ClientError, DaemonError, Followed, FrameRecord, OwnedBus, OwnershipWatch, Refusal,
    options_with,
};
use ringcat::{Options, Retries, SubDeviceInfo, SupervisorThread, Taps, realtime};

use crate::any_links::{self, AnyLinks};
use crate::code::{Code, Outcome, report, report_as};
use crate::environment::{program_name, settings, source};
use crate::host::{HeldSignals, generation, memory_hint, variable};
use crate::locks::{OfProcess, locked};
use crate::responder::{DaemonResponder, Responder, code_of};

/// Longest wait of a request for the scan.
const READY_LIMIT: Duration = Duration::from_secs(20);
/// A request waits so long for the first SubDevice to answer.
const SILENCE: Duration = Duration::from_millis(300);
/// Interval of checks at the progress.
const PAUSE: Duration = Duration::from_micros(500);
/// Longest wait of a request while the master passes from one process to another.
const CHANGE: Duration = Duration::from_secs(5);
/// Why a master cannot be opened after a failure.
const ABANDONED: &str = "an application on it failed in this process; release the other handles of this master first";
static BUSES: OfProcess<Mutex<Vec<Weak<Bus>>>> = OfProcess::new();

/// The bus of a master.
#[derive(Debug)]
pub struct Bus {
    master: u32,
    /// In a child of the process it is not used: its thread is in the parent.
    generation: u64,
    /// Its lines end before the acyclic half, its files after the bus was given back.
    log: BusLog,
    supervisor: SupervisorThread,
    /// Links of the cyclic half while no application uses them.
    cyclic_links: Mutex<Option<AnyLinks>>,
    /// Gives the bus back to the daemon that it came from, when it is dropped.
    owned: Mutex<Option<OwnedBus>>,
    /// Of a bus from a daemon.
    ownership: Option<OwnershipWatch>,
    settings: BusSettings,
    responder: Arc<Responder>,
    is_reserved: AtomicBool,
    is_abandoned: AtomicBool,
}

/// Where a bus comes from.
enum Origin {
    /// This process has opened its links; the settings of variables.
    Here(BusSettings),
    /// A daemon.
    Daemon(Box<OwnedBus>),
}

/// Why a daemon does not hand a bus over.
#[derive(Debug)]
enum TakeError {
    /// It passes from one process to another.
    Changing,
    /// Something else.
    Other(Code, String),
}

impl From<DaemonError> for TakeError {
    fn from(error: DaemonError) -> TakeError {
        match &error {
            DaemonError::Client(ClientError::Refused(Refusal::Changing { .. })) => TakeError::Changing,
            DaemonError::Client(ClientError::Refused(refusal)) => TakeError::Other(code_of(refusal), error.to_string()),
            DaemonError::Bus(_) => TakeError::Other(Code::GONE, format!("{error}{}", memory_hint())),
            _ => TakeError::Other(Code::GONE, error.to_string()),
        }
    }
}

impl TakeError {
    /// The code, after a line for the operator.
    fn reported(self) -> Code {
        let (code, text) = match self {
            TakeError::Changing => (Code::BUSY, "it passes from one process to another".to_owned()),
            TakeError::Other(code, text) => (code, text),
        };
        report(format_args!("Failed to reserve master: {text}"));
        code
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        self.log.end_lines();
        drop(locked(&self.owned).take());
    }
}

impl Bus {
    /// The bus of a master whose links this process opens; opened if no handle has it open.
    ///
    /// # Errors
    /// What is wrong, for the operator. Also: an application on it failed, and another handle has the bus still.
    pub fn open(master: u32) -> Result<Arc<Bus>, String> {
        let mut buses = BUSES.lock();
        buses.retain(|bus| bus.strong_count() > 0);
        if let Some(bus) = buses.iter().filter_map(Weak::upgrade).find(|bus| bus.is(master)) {
            // A second MainDevice on the same links would disturb it.
            return if bus.is_abandoned.load(Ordering::Acquire) { Err(ABANDONED.to_owned()) } else { Ok(bus) };
        }
        let bus = Arc::new(Bus::start(master)?);
        buses.push(Arc::downgrade(&bus));
        Ok(bus)
    }

    /// The bus of a master from a daemon, for one handle.
    ///
    /// # Errors
    /// Another handle or process drives it, or this user may not. The reason was reported.
    pub fn take(responder: &DaemonResponder) -> Outcome<Arc<Bus>> {
        let begin = Instant::now();
        let bus = loop {
            let mut buses = BUSES.lock();
            buses.retain(|bus| bus.strong_count() > 0);
            match Bus::of_daemon(responder.socket(), responder.master()) {
                Ok(bus) => {
                    let bus = Arc::new(bus);
                    buses.push(Arc::downgrade(&bus));
                    break bus;
                }
                Err(TakeError::Changing) if begin.elapsed() < CHANGE => {
                    drop(buses);
                    std::thread::sleep(PAUSE);
                }
                Err(error) => return Err(error.reported()),
            }
        };
        Ok(bus)
    }

    fn is(&self, master: u32) -> bool {
        self.master == master && self.generation == generation()
    }

    /// No further handle gets this bus, whose cyclic links are lost with an application that failed. When the last
    /// handle is released it ends, and the next one opens a new bus.
    pub fn abandon(&self) {
        self.is_abandoned.store(true, Ordering::Release);
    }

    fn start(master: u32) -> Result<Bus, String> {
        let _held = HeldSignals::hold();
        let options = Options::default().with_idle_operation(true).with_retries(Retries::OnRequest);
        let suffix = if master == 0 { String::new() } else { format!("_{master}") };
        let source = source(master, variable).ok_or_else(|| {
            format!(
                "expected a daemon (ringcatd), or RINGCAT_MAIN{suffix} (an interface) or RINGCAT_SIM{suffix} (a \
                 segment file), got neither"
            )
        })?;
        let (settings, mistakes) = settings(variable);
        if !mistakes.is_empty() {
            return Err(mistakes.join("; "));
        }
        let names = any_links::names(&source);
        let taps = settings.debug_ring.is_on.then(|| Taps::new(names.len()));
        let (cyclic, acyclic) = any_links::open(&source, taps.as_ref())?;
        let started = SupervisorThread::start(acyclic, &options_with(&settings, &options), realtime::leave);
        let supervisor = started.map_err(|error| format!("{error}{}", memory_hint()))?;
        Bus::with(master, supervisor, cyclic, (Origin::Here(settings), taps, names))
    }

    fn of_daemon(socket: &Path, master: u32) -> Result<Bus, TakeError> {
        let _held = HeldSignals::hold();
        let options = Options::default().with_idle_operation(true).with_retries(Retries::OnRequest);
        let mut owned = OwnedBus::take(socket, master, &program_name(), &options, realtime::leave)?;
        let other = |text: String| TakeError::Other(Code::GONE, text);
        let links = owned.take_links().ok_or_else(|| other("the daemon has handed over no links".to_owned()))?;
        let taps = owned.taps().filter(|_| owned.settings().debug_ring.is_on).cloned();
        let (supervisor, names) = (owned.supervisor().clone(), owned.handed().names());
        let cyclic = AnyLinks::First(links);
        Bus::with(master, supervisor, cyclic, (Origin::Daemon(Box::new(owned)), taps, names)).map_err(other)
    }

    fn with(
        master: u32,
        supervisor: SupervisorThread,
        cyclic: AnyLinks,
        (origin, taps, names): (Origin, Option<Taps>, Vec<String>),
    ) -> Result<Bus, String> {
        let (settings, mut owned) = match origin {
            Origin::Here(settings) => (settings, None),
            Origin::Daemon(owned) => (owned.settings().clone(), Some(*owned)),
        };
        let debug = owned.as_mut().and_then(OwnedBus::take_debug_interfaces);
        let ownership = owned.as_ref().map(|owned| owned.ownership().clone());
        let followed = Followed::new(supervisor.clone()).with_ownership(ownership.clone());
        let record = taps.and_then(|taps| {
            let started = FrameRecord::start(&taps, master, names, settings.debug_ring.clone());
            // The application runs without it.
            started.inspect_err(|error| report(format_args!("frames are not kept: {error}{}", memory_hint()))).ok()
        });
        let followed = followed.with_cyclic_lines(settings.prints_cyclic_lines).with_record(record);
        let followed = followed.with_debug_interfaces(debug);
        let log = BusLog::start(followed, realtime::leave, move |priority, line| match master {
            0 => report_as(priority, format_args!("{line}")),
            _ => report_as(priority, format_args!("master {master}: {line}")),
        });
        let log = log.map_err(|error| format!("a thread cannot be started: {error}{}", memory_hint()))?;
        let cyclic_links = Mutex::new(Some(cyclic));
        let generation = generation();
        let (responder, is_reserved) = (Arc::new(Responder::Here(supervisor.clone())), AtomicBool::new(false));
        let owned = Mutex::new(owned);
        Ok(Bus {
            master,
            generation,
            log,
            supervisor,
            cyclic_links,
            owned,
            ownership,
            settings,
            responder,
            is_reserved,
            is_abandoned: AtomicBool::new(false),
        })
    }

    /// Number of the master.
    pub fn master(&self) -> u32 {
        self.master
    }

    /// Settings of the master.
    pub fn settings(&self) -> &BusSettings {
        &self.settings
    }

    /// The acyclic half.
    pub fn supervisor(&self) -> &SupervisorThread {
        &self.supervisor
    }

    /// Whether this process has the bus still; `None` if it did not come from a daemon.
    pub fn ownership(&self) -> Option<OwnershipWatch> {
        self.ownership.clone()
    }

    /// Checks that the daemon has not taken the bus back.
    ///
    /// # Errors
    /// [`Code::GONE`]: it has.
    pub fn check_held(&self) -> Outcome {
        let is_lost = self.ownership.as_ref().is_some_and(OwnershipWatch::is_taken_back);
        if is_lost { Err(Code::GONE) } else { Ok(()) }
    }

    /// Reserves the bus for a handle.
    ///
    /// # Errors
    /// [`Code::BUSY`]: another handle has it.
    pub fn reserve(&self) -> Outcome {
        if self.is_reserved.swap(true, Ordering::AcqRel) {
            report(format_args!("Failed to reserve master: it is in use"));
            return Err(Code::BUSY);
        }
        Ok(())
    }

    /// Ends the reservation.
    pub fn unreserve(&self) {
        self.is_reserved.store(false, Ordering::Release);
    }

    /// Takes the links of the cyclic half.
    pub fn take_links(&self) -> Option<AnyLinks> {
        locked(&self.cyclic_links).take()
    }

    /// Gives the links of the cyclic half back.
    pub fn give_links_back(&self, links: AnyLinks) {
        *locked(&self.cyclic_links) = Some(links);
    }

    /// The SubDevices of the last scan.
    ///
    /// # Errors
    /// [`Code::GONE`].
    pub fn found(&self) -> Outcome<Vec<SubDeviceInfo>> {
        self.supervisor.subdevices().map_err(|_| Code::GONE)
    }

    /// Where questions are answered.
    pub fn responder(&self) -> Arc<Responder> {
        self.responder.clone()
    }

    /// Waits until the scan has ended and the PDOs of the dictionaries are known. SubDevices that are not in PREOP yet
    /// are on their way; what needs their mailboxes waits for that, and an activation continues from their present
    /// states.
    pub fn wait_until_scanned(&self) {
        let begin = Instant::now();
        loop {
            let Ok(seen) = self.responder.overview() else { return };
            let (responding, found) = (seen.responding(), seen.found);
            let is_found = seen.is_scanned && found == u32::from(responding) && found > 0;
            if is_found && !self.supervisor.are_pdos_awaited().unwrap_or(false) {
                return;
            }
            let elapsed = begin.elapsed();
            if responding == 0 && found == 0 && !seen.scans && elapsed >= SILENCE {
                return;
            }
            if elapsed >= READY_LIMIT {
                report(format_args!("master {}: expected {responding} SubDevices, found {found}", self.master));
                return;
            }
            std::thread::sleep(PAUSE);
        }
    }
}
