//! Both controllers, each a thread with an application of the library: one dies again and again as ACTIVE, the other
//! one takes over, measures, and hands the role back.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::standby::{NotReady, Policy, RoleRequest, StandbyOptions};
use ringcat::{
    AlState, Application, CycleProbe, DomainId, DomainState, Instant, LastOutputs, MainDevice, MainDeviceRole, Options,
    automatic, realtime,
};

use super::timed_links::{Sent, TimedLinks};
use super::tried::{Tried, said};

/// Period of the cycles.
pub const CYCLE: Duration = Duration::from_millis(5);
/// Cycles without process data after which a controller takes over: a machine with two processors that spin stalls.
pub const TIME_OUT: u32 = 10;
/// The controller that takes over becomes ACTIVE first; the other one listens for as long as an ACTIVE may be silent.
const LISTEN: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(2)];
/// Cycles after a takeover of which round trips are measured.
const STEADY: usize = 20;
/// Cycles for which both are ready before one hands over, or dies.
const READY: usize = 5;
/// A controller waits with another request for a switchover for so many cycles.
const PATIENCE: usize = 40;
/// Priority of the controller that dies. It sleeps, so it does not keep a processor from the others.
const PRIORITY: i32 = 50;
/// A takeover has happened, and the next one is prepared, within this time.
const LIMIT: Duration = Duration::from_secs(20);
/// Takeovers whose first cycle is incomplete, for each that is measured: the machine stalls.
const MOST_INCOMPLETE: usize = 5;
const LOOK: Duration = Duration::from_millis(1);
const STOP_LIMIT: Duration = Duration::from_secs(5);

/// Interfaces of the controller that takes over, and of the one that dies.
const INTERFACES: [[&str; 2]; 2] = [["first0", "first1"], ["second0", "second1"]];

/// One takeover, in microseconds from the beginning of the cycle with which the role changes.
#[derive(Clone, Copy, Debug)]
pub struct Takeover {
    /// The first frame is handed to the kernel.
    pub handed: f64,
    /// The call that sends it has returned.
    pub returned: f64,
    /// The last frame with process data of this cycle is back.
    pub complete: f64,
}

/// What the controller that takes over has measured.
#[derive(Debug, Default)]
pub struct Measured {
    /// Takeovers with complete process data in their first cycle.
    pub takeovers: Vec<Takeover>,
    /// From the first frame of a later cycle to its last one with process data, in microseconds.
    pub round_trips: Vec<f64>,
    /// Takeovers whose first cycle was not complete when the next one began.
    pub incomplete: usize,
    /// Bytes of process data.
    pub bytes: usize,
}

/// What both know.
#[derive(Debug, Default)]
pub struct Shared {
    /// The one that dies is dead.
    is_dead: AtomicBool,
    /// Takeovers that were measured, or failed.
    played: AtomicUsize,
    /// All was measured, or one of them has failed.
    is_over: AtomicBool,
}

impl Shared {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }
}

/// Ends both when it is dropped.
struct EndsBoth<'a>(&'a Shared);

impl Drop for EndsBoth<'_> {
    fn drop(&mut self) {
        self.0.is_over.store(true, Ordering::Relaxed);
    }
}

/// Plays this many takeovers, and returns what was measured.
///
/// # Errors
/// A controller does not start, or a takeover does not come in time.
pub fn play(count: usize) -> Tried<Measured> {
    let shared = Shared::default();
    std::thread::scope(|scope| {
        let dies = scope.spawn(|| {
            let _ends = EndsBoth(&shared);
            die_again_and_again(&shared)
        });
        let measured = {
            let _ends = EndsBoth(&shared);
            take_over(&shared, count)
        };
        let died = dies.join().map_err(|_| "the controller that dies panics".to_owned())?;
        measured.and_then(|measured| died.map(|()| measured))
    })
}

/// Joins the ring with these interfaces.
fn join(controller: usize, mode: ReceiveMode) -> Tried<Application<TimedLinks>> {
    let [main, redundant] = INTERFACES[controller];
    let mut links = PacketLinks::open_forwarding(main, redundant, mode).map_err(said)?;
    links.switch(true).map_err(said)?;
    // The thread that dies switches its interfaces off itself.
    let options = Options::default().with_standby(StandbyOptions::default().with_needs_guard(false));
    let policy = Policy::default().with_time_out(TIME_OUT, Duration::ZERO).with_listen(LISTEN[controller]);
    let main_device = MainDevice::request(TimedLinks::new(links), &options);
    main_device.join(&policy, |scan| automatic(&scan.subdevices, CYCLE)).map_err(said)
}

/// Both are ready: a failure of either one costs no more than the time-out.
fn is_ready(application: &Application<TimedLinks>) -> bool {
    application.role() == MainDeviceRole::Active && application.takeover_readiness() == NotReady::NOTHING
}

/// The controller that dies: it follows, is handed the role, and dies when the other one is ready.
fn die_again_and_again(shared: &Shared) -> Tried<()> {
    // Without the permission it runs at the usual priority.
    let _ = realtime::fifo(PRIORITY);
    realtime::precise_timers();
    // The other one is ACTIVE first.
    while shared.played.load(Ordering::Acquire) == 0 && !shared.is_over() {
        std::thread::sleep(LOOK);
    }
    while !shared.is_over() {
        let mut application = join(1, ReceiveMode::Blocking)?;
        shared.is_dead.store(false, Ordering::Release);
        let mut ready = 0;
        while ready < READY && !shared.is_over() {
            application.cycle(|_| ());
            while application.pop_event().is_some() {}
            ready = if is_ready(&application) { ready + 1 } else { 0 };
        }
        let played = shared.played.load(Ordering::Acquire);
        shared.is_dead.store(true, Ordering::Release);
        application.links_mut().switch_off()?;
        drop(application);
        while shared.played.load(Ordering::Acquire) == played && !shared.is_over() {
            std::thread::sleep(LOOK);
        }
    }
    Ok(())
}

/// When the last frame with process data of a cycle is back.
#[derive(Debug, Default)]
struct LastFrame(Option<Instant>);

impl CycleProbe for LastFrame {
    const AWAITS_FRAMES: bool = true;

    fn frames_are_in(&mut self, at: Instant) {
        self.0.get_or_insert(at);
    }
}

/// A cycle of the controller that takes over.
#[derive(Clone, Copy, Debug)]
struct Cycle {
    begun_at: Instant,
    role: MainDeviceRole,
    sent: Option<Sent>,
    /// The other one was dead when it began.
    other_is_dead: bool,
    /// The one before was complete.
    is_complete: bool,
}

fn us(from: Instant, to: Instant) -> f64 {
    to.since(from).as_nanos() as f64 / 1e3
}

/// The controller that takes over: what it measures.
fn take_over(shared: &Shared, count: usize) -> Tried<Measured> {
    realtime::precise_timers();
    let mut application = join(0, ReceiveMode::BusyPoll)?;
    application.wait_until_op(LIMIT).map_err(said)?;
    let mut measured =
        Measured { bytes: application.cycle(|data| data.image(DomainId(0)).len()), ..Measured::default() };
    shared.played.store(1, Ordering::Release);
    let mut probe = LastFrame::default();
    let mut cycles = Follower::default();
    let mut since = application.now();
    while measured.takeovers.len() < count {
        let (begun_at, role, is_complete) = application.cycle_probed(&mut probe, |data| {
            let status = data.status(DomainId(0));
            (data.now(), data.role(), status.is_ok_and(|status| status.state == DomainState::Complete))
        });
        let sent = application.links_mut().take_first();
        let other_is_dead = shared.is_dead.load(Ordering::Acquire);
        let cycle = Cycle { begun_at, role, sent, other_is_dead, is_complete };
        if cycles.note(cycle, probe.0.take(), &mut measured) {
            shared.played.fetch_add(1, Ordering::AcqRel);
            since = application.now();
        }
        while application.pop_event().is_some() {}
        if cycles.hands_over(is_ready(&application))
            && let Some(control) = application.role_control()
        {
            control.request(RoleRequest::HandOver);
        }
        let is_late = application.now().since(since) > LIMIT;
        if shared.is_over() || is_late || measured.incomplete > MOST_INCOMPLETE * count {
            let Measured { takeovers, incomplete, .. } = &measured;
            return Err(format!(
                "only {} takeovers, and {incomplete} whose first cycle was incomplete",
                takeovers.len()
            ));
        }
    }
    if !application.all_settled() {
        return Err("SubDevices have left OP".to_owned());
    }
    application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).map_err(said)?;
    Ok(measured)
}

/// Follows the cycles of the controller that takes over.
#[derive(Debug, Default)]
struct Follower {
    last: Option<Cycle>,
    /// The first cycle of a takeover whose frames are under way.
    is_first: bool,
    /// Cycles since a takeover.
    steady: Option<usize>,
    /// Cycles for which both are ready, or since the last request for a switchover if that is negative.
    ready: isize,
}

impl Follower {
    /// Notes a cycle, and when the frames of the one before were back. True if a takeover has been measured.
    fn note(&mut self, cycle: Cycle, back_at: Option<Instant>, measured: &mut Measured) -> bool {
        let Some(last) = self.last.replace(cycle) else { return false };
        let frames = last.sent.zip(back_at.filter(|_| cycle.is_complete));
        if std::mem::take(&mut self.is_first) {
            match frames {
                Some((sent, back_at)) => measured.takeovers.push(Takeover {
                    handed: us(last.begun_at, sent.handed_at),
                    returned: us(last.begun_at, sent.returned_at),
                    complete: us(last.begun_at, back_at),
                }),
                None => measured.incomplete += 1,
            }
            self.steady = Some(0);
        } else if let (Some(steady), MainDeviceRole::Active) = (&mut self.steady, last.role) {
            *steady += 1;
            measured.round_trips.extend(frames.map(|(sent, back_at)| us(sent.handed_at, back_at)));
        }
        let is_active = cycle.role == MainDeviceRole::Active;
        self.is_first = is_active && last.role != MainDeviceRole::Active && cycle.other_is_dead;
        self.steady.take_if(|steady| *steady >= STEADY).is_some()
    }

    /// Whether the role is to be handed over now.
    fn hands_over(&mut self, is_ready: bool) -> bool {
        self.ready = if is_ready || self.ready < 0 { self.ready + 1 } else { 0 };
        let now = self.ready >= READY as isize;
        if now {
            self.ready = -(PATIENCE as isize);
        }
        now
    }
}
