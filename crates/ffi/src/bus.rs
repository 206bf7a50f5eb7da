//! The buses of this process: one for each master that is open, shared by all its handles.
//!
//! A bus has its links and the thread of the acyclic half, which scans and keeps all SubDevices in PREOP while no
//! application is active. One handle reserves it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use ringcat::wire::command::Command;
use ringcat::wire::datagram::Target;
use ringcat::wire::register::map;
use ringcat::{Activity, Links, Options, RawDatagram, Retries, Services, SubDeviceInfo, SupervisorThread};

use crate::any_links::AnyLinks;
use crate::code::{Code, Outcome, report};
use crate::environment::source;
use crate::host::{HeldSignals, be_an_ordinary_thread, variable};

/// Longest wait of a request for the scan and for PREOP of all SubDevices.
const READY_LIMIT: Duration = Duration::from_secs(20);
/// A request waits so long for the first SubDevice to answer.
const SILENCE: Duration = Duration::from_millis(300);
/// Interval of looks at the progress.
const PAUSE: Duration = Duration::from_millis(2);
/// PREOP alone, as an OR of AL states.
const PREOP: u8 = 2;
/// The bits of AL states in AL status.
const AL_STATES: u8 = 0x0F;

static BUSES: Mutex<Vec<Weak<Bus>>> = Mutex::new(Vec::new());

/// The bus of a master.
#[derive(Debug)]
pub struct Bus {
    master: u32,
    supervisor: SupervisorThread,
    /// Links of the cyclic half while no application uses them.
    cyclic_links: Mutex<Option<AnyLinks>>,
    is_ring: bool,
    is_reserved: AtomicBool,
}

/// What a broadcast read of the AL status shows now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// SubDevices that processed the copy on the main link, and on the redundant link.
    pub counts: [u16; 2],
    /// Their AL states, ORed.
    pub al_states: u8,
    /// Which links are up.
    pub is_up: [bool; 2],
}

impl Seen {
    /// SubDevices on both links.
    pub fn responding(&self) -> u16 {
        self.counts[0].saturating_add(self.counts[1])
    }
}

/// Locks a mutex. A panic of another holder leaves plain data, which stays usable.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Bus {
    /// The bus of a master; opened if no handle has it open.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn open(master: u32) -> Result<Arc<Bus>, String> {
        let mut buses = locked(&BUSES);
        buses.retain(|bus| bus.strong_count() > 0);
        if let Some(bus) = buses.iter().filter_map(Weak::upgrade).find(|bus| bus.master == master) {
            return Ok(bus);
        }
        let bus = Arc::new(Bus::start(master)?);
        buses.push(Arc::downgrade(&bus));
        Ok(bus)
    }

    fn start(master: u32) -> Result<Bus, String> {
        let suffix = if master == 0 { String::new() } else { format!("_{master}") };
        let source = source(master, variable).ok_or_else(|| {
            format!("expected RINGCAT_MAIN{suffix} (an interface) or RINGCAT_SIM{suffix} (a segment file), got neither")
        })?;
        let _held = HeldSignals::hold();
        let (cyclic, acyclic) = AnyLinks::open(&source)?;
        let is_ring = cyclic.addresses().redundant.is_some();
        let options = Options::default().with_idle_operation(true).with_retries(Retries::OnRequest);
        let started = SupervisorThread::start(acyclic, &options, be_an_ordinary_thread);
        let supervisor = started.map_err(|error| error.to_string())?;
        let cyclic_links = Mutex::new(Some(cyclic));
        Ok(Bus { master, supervisor, cyclic_links, is_ring, is_reserved: AtomicBool::new(false) })
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
        let ring = self.supervisor.with(|engine| engine.ring_status()).map_err(|_| Code::GONE)?;
        let read = RawDatagram::new(Command::Brd, Target::Broadcast(map::AL_STATUS), [0; 2]);
        let replies = self.supervisor.datagrams(vec![read.with_resend(true)]).unwrap_or_default();
        let mut seen = Seen::default();
        if let Some(Ok(reply)) = replies.first() {
            seen.counts = [reply.main.0, reply.redundant.0];
            seen.al_states = reply.data.first().copied().unwrap_or(0) & AL_STATES;
        }
        for (number, link) in ring.links.iter().enumerate() {
            seen.is_up[number] = link.carrier.unwrap_or(seen.counts[number] > 0);
        }
        Ok(seen)
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
