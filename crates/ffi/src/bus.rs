//! The buses of this process: one for each master that is open, shared by all its handles.
//!
//! A bus has its links and the thread of the acyclic half, which scans and keeps all SubDevices in PREOP while no
//! application is active. One handle reserves it. It comes from a daemon where one answers, and goes back to it.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use ringcat::daemon::OwnedBus;
use ringcat::{Activity, Links, Options, Retries, SubDeviceInfo, SupervisorThread};

use crate::any_links::AnyLinks;
use crate::code::{Code, Outcome, report};
use crate::environment::{socket, source};
use crate::host::{HeldSignals, be_an_ordinary_thread, generation, memory_hint, variable, watch_forks};
use crate::messages::Messenger;
use crate::seen::{Seen, look};

/// Longest wait of a request for the scan and for PREOP of all SubDevices.
const READY_LIMIT: Duration = Duration::from_secs(20);
/// A request waits so long for the first SubDevice to answer.
const SILENCE: Duration = Duration::from_millis(300);
/// Interval of looks at the progress.
const PAUSE: Duration = Duration::from_millis(2);
/// PREOP alone, as an OR of AL states.
const PREOP: u8 = 2;

static BUSES: Mutex<Vec<Weak<Bus>>> = Mutex::new(Vec::new());

/// The bus of a master.
#[derive(Debug)]
pub struct Bus {
    master: u32,
    /// In a child of the process it is not used: its thread is in the parent.
    generation: u64,
    /// Ends before the acyclic half.
    _messenger: Messenger,
    supervisor: SupervisorThread,
    /// Links of the cyclic half while no application uses them.
    cyclic_links: Mutex<Option<AnyLinks>>,
    /// Gives the bus back to the daemon that it came from, when it is dropped.
    _owned: Mutex<Option<OwnedBus>>,
    is_ring: bool,
    is_reserved: AtomicBool,
}

/// Locks a mutex. A panic of another holder leaves plain data, which stays usable.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes a master from the daemon at this socket. `None` if no variable names the socket and no daemon answers there.
fn take(socket: &Path, master: u32, options: &Options) -> Result<Option<OwnedBus>, String> {
    let program = std::env::args_os().next().unwrap_or_default();
    let program = Path::new(&program).file_name().unwrap_or(program.as_os_str()).to_string_lossy();
    match OwnedBus::take(socket, master, &program, options, be_an_ordinary_thread) {
        Ok(owned) => Ok(Some(owned)),
        Err(error) if error.is_no_daemon() && variable("RINGCAT_SOCKET").is_none() => Ok(None),
        Err(error) => Err(error.to_string()),
    }
}

impl Bus {
    /// The bus of a master; opened if no handle has it open.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn open(master: u32) -> Result<Arc<Bus>, String> {
        watch_forks();
        let mut buses = locked(&BUSES);
        buses.retain(|bus| bus.strong_count() > 0);
        if let Some(bus) = buses.iter().filter_map(Weak::upgrade).find(|bus| bus.is(master)) {
            return Ok(bus);
        }
        let bus = Arc::new(Bus::start(master)?);
        buses.push(Arc::downgrade(&bus));
        Ok(bus)
    }

    fn is(&self, master: u32) -> bool {
        self.master == master && self.generation == generation()
    }

    fn start(master: u32) -> Result<Bus, String> {
        let _held = HeldSignals::hold();
        let options = Options::default().with_idle_operation(true).with_retries(Retries::OnRequest);
        let socket = socket(master, variable);
        if let Some(owned) = socket.as_deref().map(|path| take(path, master, &options)).transpose()?.flatten() {
            return Bus::of_daemon(master, owned);
        }
        let suffix = if master == 0 { String::new() } else { format!("_{master}") };
        let source = source(master, variable).ok_or_else(|| {
            format!(
                "expected a daemon (ringcatd), or RINGCAT_MAIN{suffix} (an interface) or RINGCAT_SIM{suffix} (a \
                 segment file), got neither"
            )
        })?;
        let (cyclic, acyclic) = AnyLinks::open(&source)?;
        let started = SupervisorThread::start(acyclic, &options, be_an_ordinary_thread);
        let supervisor = started.map_err(|error| format!("{error}{}", memory_hint()))?;
        Bus::with(master, supervisor, cyclic, None)
    }

    /// The bus that a daemon has handed over.
    fn of_daemon(master: u32, mut owned: OwnedBus) -> Result<Bus, String> {
        let links = owned.take_links().ok_or("the daemon has handed over no links")?;
        Bus::with(master, owned.supervisor().clone(), AnyLinks::Daemon(links), Some(owned))
    }

    fn with(
        master: u32,
        supervisor: SupervisorThread,
        cyclic: AnyLinks,
        owned: Option<OwnedBus>,
    ) -> Result<Bus, String> {
        let is_ring = cyclic.addresses().redundant.is_some();
        let messenger = Messenger::begin(master, supervisor.clone());
        let _messenger = messenger.map_err(|error| format!("a thread cannot be started: {error}{}", memory_hint()))?;
        let cyclic_links = Mutex::new(Some(cyclic));
        let generation = generation();
        let is_reserved = AtomicBool::new(false);
        let _owned = Mutex::new(owned);
        Ok(Bus { master, generation, _messenger, supervisor, cyclic_links, _owned, is_ring, is_reserved })
    }

    /// Number of the master.
    pub fn master(&self) -> u32 {
        self.master
    }

    /// The acyclic half.
    pub fn supervisor(&self) -> &SupervisorThread {
        &self.supervisor
    }

    /// It has two links.
    pub fn is_ring(&self) -> bool {
        self.is_ring
    }

    /// Reserves the bus for a handle.
    ///
    /// # Errors
    /// [`Code::BUSY`]: another handle has it.
    pub fn reserve(&self) -> Outcome {
        if self.is_reserved.swap(true, Ordering::AcqRel) { Err(Code::BUSY) } else { Ok(()) }
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
        self.supervisor.with(|engine| engine.subdevices()).map_err(|_| Code::GONE)
    }

    /// Asks all SubDevices for their states. A lost frame counts as no answer.
    ///
    /// # Errors
    /// [`Code::GONE`].
    pub fn look(&self) -> Outcome<Seen> {
        look(&self.supervisor).ok_or(Code::GONE)
    }

    /// Waits until the scan has ended and all SubDevices are in PREOP.
    pub fn wait_until_ready(&self) {
        let begin = Instant::now();
        loop {
            let asked = self.supervisor.with(|engine| (engine.snapshot().activity, engine.subdevices().len()));
            let (Ok((activity, found)), Ok(seen)) = (asked, self.look()) else { return };
            let (responding, states) = (seen.responding(), seen.al_states);
            let is_scanned = activity == Activity::Scanned && found == usize::from(responding);
            if is_scanned && found > 0 && states == PREOP {
                return;
            }
            let elapsed = begin.elapsed();
            if responding == 0 && found == 0 && activity != Activity::Scanning && elapsed >= SILENCE {
                return;
            }
            if elapsed >= READY_LIMIT {
                report(format_args!(
                    "master {}: expected {responding} SubDevices in PREOP, found {found}, AL states {states:#04x}",
                    self.master
                ));
                return;
            }
            std::thread::sleep(PAUSE);
        }
    }
}
