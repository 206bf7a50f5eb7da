//! The daemon drives a master: the acyclic half in this process, and its lines for the operator.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use ringcat::daemon::{
    BusLog, BusSettings, DebugInterfaces, Followed, FrameRecord, LastWritten, Lines, RecordReason, adopt_links,
    options_with, serving,
};
use ringcat::eoe::{Ethernet, EthernetEvent, EthernetOptions};
use ringcat::foreign::{ListeningPhase, ListeningState, QuietLinks};
use ringcat::tee::Tee;
use ringcat::{
    Activity, AlState, Error, Handover, Knowledge, Links, LogFilter, LogLevel, Options, Retries, Services, Snapshot,
    StateScope, SupervisorThread, Taps,
};
use ringcat_link::TapInterface;

use crate::debug_interfaces::DebugTaps;
use crate::ethernet::EthernetInterfaces;
use crate::log::{print, say};
use crate::opened::Opened;

/// Longest wait of a hand-over for the end of a scan.
const SCAN: Duration = Duration::from_secs(20);
/// Longest wait of a hand-over for a scan that has not begun.
const FIRST_SCAN: Duration = Duration::from_millis(200);
/// Longest wait of a hand-over for SubDevices that change their states.
const SETTLE: Duration = Duration::from_secs(3);
/// States that do not change for this time stay as they are.
const STILL: Duration = Duration::from_millis(100);
/// SubDevices reach their safe state within this time.
const LEAD: Duration = Duration::from_secs(10);
/// Memory for frames on their way to the record, in which a frame stays for up to 200 ms.
const QUEUE: usize = 4 << 20;
/// Interval at which the progress of a scan is read.
const LOOK: Duration = Duration::from_millis(1);

/// What outlasts hand-overs of a master.
#[derive(Debug)]
pub struct Lasting<'a> {
    /// Number of the master.
    pub number: u32,
    /// What is known of the segment; empty if nothing is.
    pub knowledge: &'a [u8],
    /// What was printed of the bus before.
    pub lines: Arc<Mutex<Lines>>,
    /// When frames before a fault were written last.
    pub last_written: LastWritten,
    /// Level of messages.
    pub debug_level: u32,
    /// Settings, for the daemon and for applications.
    pub settings: &'a BusSettings,
    /// Network interfaces of EoE; `None`: there are none.
    pub interfaces: Option<Arc<EthernetInterfaces>>,
    /// Debug interfaces; `None`: there are none.
    pub debug: Option<&'a DebugTaps>,
    /// Frames received on the links: nothing is sent before.
    pub listened: Arc<ListeningState>,
}

/// The daemon drives a master.
#[derive(Debug)]
pub struct Driving {
    supervisor: SupervisorThread,
    log: BusLog,
    listened: Arc<ListeningState>,
    /// Moves frames of EoE.
    ethernet: Option<Ethernet>,
}

impl Driving {
    /// Drives a master on fresh links, and goes on with what is known.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn start(opened: &Arc<Opened>, lasting: &Lasting<'_>, handover: Handover) -> Result<Driving, String> {
        let adopted = adopt_links(opened.links(), opened.duplicates()?);
        let (cyclic, acyclic) = adopted.map_err(|error| error.to_string())?;
        let main_address = acyclic.addresses().main.0;
        let acyclic = QuietLinks::new(acyclic, cyclic, lasting.listened.clone(), opened.clone());
        let (acyclic, record, debug) = observed(acyclic, opened, lasting, handover);
        let options = Options::default().with_idle_operation(true).with_retries(Retries::OnRequest);
        let options = options_with(lasting.settings, &options).with_dictionaries(true);
        let supervisor = match Knowledge::from_bytes(lasting.knowledge) {
            Ok(knowledge) => SupervisorThread::start_resumed(acyclic, &options, (knowledge, handover), || ()),
            // Nothing is known yet.
            Err(_) => SupervisorThread::start(acyclic, &options, || ()),
        };
        let supervisor = supervisor.map_err(|error| error.to_string())?;
        let level = LogFilter::new(LogLevel::from_number(lasting.debug_level));
        supervisor.set_log_filter(level).map_err(|error| error.to_string())?;
        let followed = Followed::new(supervisor.clone()).with_lines(lasting.lines.clone());
        let followed = followed.with_cyclic_lines(lasting.settings.prints_cyclic_lines).with_record(record);
        let followed = followed.with_debug_interfaces(debug);
        let number = lasting.number;
        let log = BusLog::start(
            followed,
            || (),
            move |priority, line| match number {
                0 => print(priority, format!("EtherCAT: {line}")),
                _ => print(priority, format!("EtherCAT: master {number}: {line}")),
            },
        );
        let log = log.map_err(|error| format!("a thread cannot be started: {error}"))?;
        let ethernet = lasting.interfaces.clone().zip(u16::try_from(number).ok());
        let ethernet = ethernet.map(|(interfaces, index)| {
            let options = EthernetOptions::new(index, main_address);
            supervisor.start_lasting_ethernet(options, move |name, mac| interfaces.make(name, mac).map(Some))
        });
        let ethernet = ethernet.transpose().map_err(|error| error.to_string())?;
        Ok(Driving { supervisor, log, listened: lasting.listened.clone(), ethernet })
    }

    /// The acyclic half, for questions.
    pub fn supervisor(&self) -> &SupervisorThread {
        &self.supervisor
    }

    /// What has changed with network interfaces of EoE, for the operator.
    pub fn changes(&self) -> Vec<EthernetEvent> {
        self.ethernet.as_ref().map(Ethernet::take_events).unwrap_or_default()
    }

    /// Ends it without a further frame. What is known of the segment; empty if nothing is.
    pub fn hand_over(self) -> Vec<u8> {
        let Driving { supervisor, log, listened, ethernet: _ethernet } = self;
        if listened.phase() == ListeningPhase::Free {
            wait_for_first_scan(&supervisor);
        }
        wait_for_scan(&supervisor);
        wait_until_settled(&supervisor);
        // What has changed last is printed by the next process that drives the master.
        log.end_soon();
        // A thread that has ended has no knowledge.
        let knowledge = supervisor.hand_over().ok().flatten();
        knowledge.as_ref().map(Knowledge::to_bytes).unwrap_or_default()
    }

    /// Brings all SubDevices to the safe state, in a thread: PREOP needs none.
    pub fn lead_to(&self, state: AlState, number: u32) {
        if state == AlState::PreOp {
            return;
        }
        let supervisor = self.supervisor.clone();
        let lead = move || {
            wait_for_scan(&supervisor);
            match supervisor.request_state_of_all(state, StateScope::All, LEAD) {
                // The next application has the master already.
                Ok(()) | Err(Error::Gone) => {}
                Err(error) => say(format_args!("master {number}: not all SubDevices are in {state}: {error}")),
            }
        };
        if let Err(error) = std::thread::Builder::new().name("safe state".into()).spawn(lead) {
            say(format_args!("master {number}: all SubDevices stay in PREOP: {error}"));
        }
    }
}

/// Links whose frames are recorded for a file at a fault, and are on debug interfaces, if the settings require it.
fn observed<L: Links>(
    links: L,
    opened: &Opened,
    lasting: &Lasting<'_>,
    handover: Handover,
) -> (Tee<L>, Option<FrameRecord>, Option<DebugInterfaces>) {
    let names = opened.links().names();
    let made = lasting.debug.map(|debug| debug.all(names.len())).unwrap_or_default();
    // One that was removed meanwhile is no interface any more.
    let interfaces: Vec<TapInterface> =
        made.into_iter().filter_map(|(_, descriptor)| TapInterface::adopt(descriptor).ok()).collect();
    if !lasting.settings.debug_ring.is_on && interfaces.is_empty() {
        return (Tee::new(links, None), None, None);
    }
    let taps = Taps::new(names.len());
    let debug = (!interfaces.is_empty()).then(|| DebugInterfaces::new(&taps, interfaces));
    (Tee::new(links, taps.tap_with(QUEUE)), record(&taps, names, lasting, handover), debug)
}

/// The record of the last frames, if the settings require it. The end of an application without a release is a fault.
fn record(taps: &Taps, names: Vec<String>, lasting: &Lasting<'_>, handover: Handover) -> Option<FrameRecord> {
    let ring = &lasting.settings.debug_ring;
    if !ring.is_on {
        return None;
    }
    let mut record = match FrameRecord::start(taps, lasting.number, names, ring.clone()) {
        Ok(record) => record.with_last_written(lasting.last_written.clone()),
        Err(error) => {
            // The master is driven without it.
            say(format_args!("master {}: frames are not kept: {error}", lasting.number));
            return None;
        }
    };
    if handover == Handover::AfterCrash && !lasting.knowledge.is_empty() {
        record.note(RecordReason::OwnerLost, Instant::now());
    }
    Some(record)
}

/// Waits until no SubDevice changes its state any more, and until the PDOs of dictionaries are read that are about to
/// be: after the end of an application, or when they have just got power, they are on their way to PREOP, and this is
/// not interrupted. An application reaches OP without this wait, since its activation continues from the present state
/// of each SubDevice; one that requests mailboxes first finds them in use.
fn wait_until_settled(supervisor: &SupervisorThread) {
    let settled = AlState::PreOp.code();
    let (begin, mut last, mut since) = (Instant::now(), 0, Instant::now());
    while let Ok(seen) = serving::overview(supervisor) {
        if seen.al_states != last {
            (last, since) = (seen.al_states, Instant::now());
        }
        // Some may be in a safe state, or in an error that nothing ends.
        let is_still = seen.al_states == settled || since.elapsed() >= STILL;
        let is_reading = || supervisor.are_pdos_awaited().unwrap_or(false);
        if seen.responding() == 0 || begin.elapsed() >= SETTLE || is_still && !is_reading() {
            return;
        }
        std::thread::sleep(LOOK);
    }
}

/// A segment whose cable was just plugged in is about to be scanned.
fn wait_for_first_scan(supervisor: &SupervisorThread) {
    let begin = Instant::now();
    while begin.elapsed() < FIRST_SCAN {
        match supervisor.snapshot() {
            Ok(seen) if seen.activity == Activity::Unscanned && has_carrier(&seen) => std::thread::sleep(LOOK),
            _ => return,
        }
    }
}

fn has_carrier(seen: &Snapshot) -> bool {
    seen.ring.links.iter().any(|link| link.carrier == Some(true))
}

/// Waits for the end of a scan that runs.
fn wait_for_scan(supervisor: &SupervisorThread) {
    let begin = Instant::now();
    while begin.elapsed() < SCAN {
        match supervisor.snapshot().map(|seen| seen.activity) {
            Ok(Activity::Scanning) => std::thread::sleep(LOOK),
            _ => return,
        }
    }
}
