//! The summary of `ringcat run`, as text and as the keys of JSON.

use std::time::Duration;

use ringcat::cyclic_status::CyclicStatus;
use ringcat::text::Names;
use ringcat::{AcyclicCounters, Application, ClockStatus, EitherLinks, Link, Links, SupervisorThread, SyncSignals};

use super::reasons::Exchanged;
use crate::access::WireLinks;
use crate::clock_options::farthest;
use crate::clocks;
use crate::interfaces::{LinkNames, now};
use crate::json::run;
use crate::json::values::{State, Times};
use crate::output::say;
use crate::surroundings::Surroundings;

/// Frames that are under way when the last frame was sent are back within this time.
const LAST_FRAMES: Duration = Duration::from_millis(20);

/// What is known at the end of the exchange of process data, before the stop.
pub struct End {
    /// Cycle time.
    pub cycle: Duration,
    /// Whether all SubDevices reached OP.
    pub reached_op: bool,
    /// SYNC signals by SubDevice.
    pub signals: Vec<Option<SyncSignals>>,
    /// SubDevices of which not all process data is sent again.
    pub sent_once: Vec<run::SentOnce>,
    /// States, ring and clocks.
    pub exchanged: Exchanged,
}

/// The keys of JSON, as of the end of the exchange.
pub fn json(
    application: &Application<WireLinks, SupervisorThread>,
    end: &End,
    names: &Names,
    clocks_in_use: bool,
) -> run::Run {
    let (pace, cyclic, cyclic_status) =
        (application.pace(), application.cyclic_counters(), application.cyclic_status());
    let exchanged = &end.exchanged;
    let locked = !exchanged.clocks().iter().any(ClockStatus::is_awaited);
    run::Run {
        cycle_ns: end.cycle.as_nanos() as u64,
        reached_op: end.reached_op,
        states: State::of_all(exchanged.states(), &names.0),
        ring: exchanged.ring().map(Into::into),
        cycles: run::Cycles {
            count: pace.cycles,
            incomplete: cyclic.incomplete,
            frames_still_out: cyclic.skipped,
            left_out: pace.skipped,
            late_wake_ups: pace.late,
            longest_delay_ns: pace.longest_delay.as_nanos() as u64,
            postponed: pace.paused,
        },
        process_data: run::ProcessData {
            sent_frames: cyclic.sent,
            missing_frames: cyclic.missing(),
            late_frames: cyclic.lost_late,
            damaged_frames: cyclic.lost_damaged,
            lost_copies: cyclic.copies_lost + cyclic.half,
            late_copies: cyclic.late,
            damaged_copies: cyclic.corrupt,
            foreign_frames: cyclic.foreign,
            resent_frames: cyclic.sent_again,
            saved_cycles: cyclic.saved,
        },
        sent_once: end.sent_once.clone(),
        acyclic: application.acyclic_counters().into(),
        round_trips: Times::of(application.round_trips()),
        wake_ups: Times::of(cyclic_status.wake_ups()),
        jobs: Vec::new(),
        clocks: clocks_in_use
            .then(|| clocks::json(exchanged.clocks(), names, &end.signals, locked, cyclic_status.phase_errors())),
        interfaces: Vec::new(),
        ethernet: Vec::new(),
        gateway: None,
        variables: Vec::new(),
        stopped: false,
    }
}

impl From<AcyclicCounters> for run::Acyclic {
    fn from(counters: AcyclicCounters) -> run::Acyclic {
        run::Acyclic {
            sent_frames: counters.sent,
            lost_frames: counters.lost,
            lost_copies: counters.half,
            late_copies: counters.late,
            datagrams: counters.datagrams,
            resent_datagrams: counters.resent,
            dropped_mails: counters.mails_dropped,
            foreign_frames: counters.foreign,
        }
    }
}

/// Prints how the exchange of process data went.
pub fn summary(application: &Application<WireLinks, SupervisorThread>, surroundings: &Surroundings) {
    let (pace, cyclic, acyclic) = (application.pace(), application.cyclic_counters(), application.acyclic_counters());
    say!("\nsummary");
    say!("  cycles: {}, incomplete: {}, frames still out: {}", pace.cycles, cyclic.incomplete, cyclic.skipped);
    say!(
        "  this machine: {} late wake-ups, the latest by {:.3} ms; {} cycles left out",
        pace.late,
        pace.longest_delay.as_secs_f64() * 1e3,
        pace.skipped
    );
    if pace.paused > 0 {
        say!(
            "  clocks: {} cycles began later, so that propagation delays could be measured on an empty wire",
            pace.paused
        );
    }
    say!(
        "  the wire: {} frames sent; {} missing, {} too late, {} damaged",
        cyclic.sent,
        cyclic.missing(),
        cyclic.lost_late,
        cyclic.lost_damaged
    );
    say!(
        "  copies: {} lost of frames that came, {} late, {} corrupt",
        cyclic.copies_lost + cyclic.half,
        cyclic.late,
        cyclic.corrupt
    );
    if application.exchange().sends_again() {
        say!("  lost frames: {} sent again, {} cycles complete because of that", cyclic.sent_again, cyclic.saved);
    }
    if cyclic.foreign + acyclic.foreign > 0 {
        let (frames, senders) = (cyclic.foreign + acyclic.foreign, surroundings.senders());
        say!("  other MainDevices: {frames} frames, {senders}");
    }
    say!("  round trips: {}", application.round_trips());
    say!("  wake-ups: {}", application.cyclic_status().wake_ups());
}

/// Prints how the clocks kept together.
pub fn clock_account(clocks: &[ClockStatus], cyclic_status: &CyclicStatus, names: &Names) {
    let locked = clocks.iter().filter(|clock| clock.is_locked || clock.is_reference).count();
    let unused = clocks.iter().filter(|clock| !clock.is_required).count();
    let unused = if unused > 0 { format!(", {unused} not used") } else { String::new() };
    say!("  clocks: {locked} of {} locked{unused}", clocks.len());
    if let Some(clock) = farthest(clocks).filter(|_| locked > 0) {
        let name = clock.subdevice.and_then(|subdevice| names.0.get(subdevice.0)).map_or("", String::as_str);
        say!(
            "  farthest from the reference since its lock: position {} \"{name}\", {} ns",
            clock.position,
            clock.worst_ns
        );
    }
    if cyclic_status.phase_errors().count() > 0 {
        say!("  cycles from their phase: {}", cyclic_status.phase_errors());
    }
}

/// Prints what the interfaces have carried from the first frame to the last, the stop included; the same as keys of
/// JSON.
pub fn final_account(links: &mut WireLinks, supervisor: &SupervisorThread, names: &LinkNames) -> Vec<run::Interface> {
    let mut interfaces = Vec::new();
    let until = now() + LAST_FRAMES;
    while now() < until {
        while links.receive(&mut |_, _| ()) {}
        links.wait(until);
    }
    for link in [Link::Main, Link::Redundant] {
        // Pipes to a simulated segment have none.
        let EitherLinks::First(packets) = links.links().links() else { break };
        let Some(counters) = packets.counters(link) else { continue };
        say!(
            "  process data on {link}: {} sent, {} received, {} overrun",
            counters.sent,
            counters.received,
            counters.overrun
        );
        let (down, busy, refused) = (counters.down, counters.busy, counters.refused);
        interfaces.push(run::Interface {
            link: if link == Link::Main { "main" } else { "redundant" },
            interface: names.of(link).to_owned(),
            sent_frames: counters.sent,
            received_frames: counters.received,
            overrun_frames: counters.overrun,
            unsent_frames: down + busy + refused,
        });
        if down + busy + refused > 0 {
            say!("    not sent: {down} interface down, {busy} queue full, {refused} refused");
        }
    }
    let acyclic = supervisor.counters();
    say!(
        "  everything else: {} frames sent, {} lost, {} copies lost, {} late",
        acyclic.sent,
        acyclic.lost,
        acyclic.half,
        acyclic.late
    );
    say!("    {} datagrams, {} of them sent again", acyclic.datagrams, acyclic.resent);
    if acyclic.mails_dropped > 0 {
        say!("    {} mailbox messages dropped: they arrived when no read waited for them", acyclic.mails_dropped);
    }
    interfaces
}
