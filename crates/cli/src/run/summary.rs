//! What `ringcat run` tells in the end.

use std::time::Duration;

use ringcat::news::News;
use ringcat::packet::PacketLinks;
use ringcat::tee::Tee;
use ringcat::text::Names;
use ringcat::{Application, ClockStatus, Link, Links, SupervisorThread};

use crate::clock_options::farthest;
use crate::interfaces::now;
use crate::output::say;
use crate::surroundings::Surroundings;

/// What is under way when the last frame was sent is back within.
const LAST_FRAMES: Duration = Duration::from_millis(20);

/// How the exchange of process data went.
pub fn summary(application: &Application<Tee<PacketLinks>, SupervisorThread>, surroundings: &Surroundings) {
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
    if cyclic.foreign + acyclic.foreign > 0 {
        let (frames, senders) = (cyclic.foreign + acyclic.foreign, surroundings.senders());
        say!("  other MainDevices: {frames} frames, {senders}");
    }
    say!("  round trips: {}", application.round_trips());
    say!("  wake-ups: {}", application.news().wake_ups());
}

/// How the clocks kept together.
pub fn clock_account(clocks: &[ClockStatus], news: &News, names: &Names) {
    let locked = clocks.iter().filter(|clock| clock.is_locked || clock.is_reference).count();
    say!("  clocks: {locked} of {} locked", clocks.len());
    if let Some(clock) = farthest(clocks).filter(|_| locked > 0) {
        let name = clock.subdevice.and_then(|subdevice| names.0.get(subdevice)).map_or("", String::as_str);
        say!(
            "  farthest from the reference since its lock: position {} \"{name}\", {} ns",
            clock.position,
            clock.worst_ns
        );
    }
    if news.phase_errors().count() > 0 {
        say!("  cycles from their phase: {}", news.phase_errors());
    }
}

/// What the interfaces have carried from the first frame to the last, the stop included.
pub fn final_account(links: &mut Tee<PacketLinks>, supervisor: &SupervisorThread) {
    let until = now() + LAST_FRAMES;
    while now() < until {
        while links.receive(&mut |_, _| ()) {}
        links.wait(until);
    }
    for link in [Link::Main, Link::Redundant] {
        let Some(counters) = links.links().counters(link) else { continue };
        say!(
            "  process data on {link}: {} sent, {} received, {} overrun",
            counters.sent,
            counters.received,
            counters.overrun
        );
        let (down, busy, refused) = (counters.down, counters.busy, counters.refused);
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
}
