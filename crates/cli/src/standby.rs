//! `ringcat standby`: one of two MainDevices in a ring.
//!
//! It forwards the frames of the ACTIVE MainDevice between its interfaces. With a declaration it follows the ACTIVE,
//! and takes over ([`takeover`]).
//!
//! Its interfaces are up only while it forwards (protocol MR-21): an interface that is up and does not forward takes
//! the whole bus from the ACTIVE, one that is down leaves it a line.

mod beating;
pub mod guarding;
mod joining;
mod news;
mod takeover;

use std::time::Duration;

use clap::Args;
use ringcat::packet::PacketLinks;
use ringcat::standby::{ForwardingCounters, Policy, StoreAndForward};
use ringcat::{Instant, Link, Links};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{LinkNames, describe_down};
use crate::json::data::Data;
use crate::json::standby::Standby;
use crate::numbers::number;
use crate::others::check_sockets;
use crate::output::{say, warn};
use crate::run::declared::DeclarationArguments;
use crate::thread::ThreadArguments;
use crate::times::time;
use crate::verdict::{Report, Verdict};

use guarding::Guarded;

/// No frame for this time: the ACTIVE MainDevice counts as silent.
const SILENT: Duration = Duration::from_secs(1);
/// An interface without a carrier this long after it was switched on is reported.
const CARRIER_LIMIT: Duration = Duration::from_secs(5);
/// From the limit of a guard to the takeover at least: it sees that, and switches two interfaces off.
const GUARD_ACTS: Duration = Duration::from_millis(2);

/// What it is for, and what it is not.
const ABOUT_STANDBY: &str = "\
The ring leads through both MainDevices: from the main link of the ACTIVE
through the SubDevices into --redundant here, and from --main here to the
redundant link of the ACTIVE. Each frame is sent on at the other interface, or
back if that one is down.

Both interfaces are switched on when it forwards, and off at its end: then the
ACTIVE has a line. Leave them off before: an interface that is up and does not
forward takes the whole bus from the ACTIVE. Switching needs cap_net_admin.
Another process guards that: it switches both off when this one is killed,
hangs, or is stopped for longer than --guard.

Without a declaration it never sends on its own. With --eni, --network or
--automatic it is one of two controllers with the same declaration: INACTIVE
where it hears an ACTIVE, otherwise ACTIVE. As INACTIVE it takes over when it
has heard no process data for --timeout cycles. At its end an ACTIVE hands the
role over if the other one is ready; otherwise it stops the bus as `ringcat run`
does. Exit status 1 if something did not hold, and the last line says what.

See docs/standby.md, which begins with a note on patents.";

/// Options of `ringcat standby`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_STANDBY)]
pub struct StandbyArguments {
    #[command(flatten)]
    links: LinkNames,
    #[command(flatten)]
    thread: ThreadArguments,
    #[command(flatten)]
    declared: DeclarationArguments,
    /// Take over with the SubDevices found as their SIIs say
    #[arg(long, conflicts_with = "file", group = "declaration", help_heading = "Segment")]
    automatic: bool,
    #[command(flatten)]
    policy: PolicyArguments,
    /// Age from which frames are not forwarded
    ///
    /// Frames wait where this computer is too busy, or where this program was stopped. They would bring SubDevices back
    /// to earlier outputs; the ACTIVE has given them up.
    #[arg(
        long,
        value_name = "TIME",
        value_parser = time,
        default_value = "5ms",
        conflicts_with = "declaration",
        help_heading = "Run"
    )]
    max_age: Duration,
    /// Time after which both interfaces are switched off if this program hangs
    ///
    /// Another process does that, and at once when this program is killed. The ACTIVE then has a line instead of no
    /// bus. A time below the pauses that this computer makes switches them off without need: this program then ends.
    #[arg(long, value_name = "TIME", value_parser = guarding::limit, default_value = "20ms", help_heading = "Run")]
    guard: Duration,
    /// Without such a process
    #[arg(long, conflicts_with = "guard", help_heading = "Run")]
    no_guard: bool,
    /// How long, such as 10s or 5min; until Ctrl-C by default
    #[arg(long = "for", value_name = "TIME", value_parser = time, help_heading = "Run")]
    lasts: Option<Duration>,
    /// Go on although another program on this host uses an interface
    #[arg(long, help_heading = "Run")]
    force: bool,
}

/// When the role changes.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Role")]
pub struct PolicyArguments {
    /// Cycles without process data of the ACTIVE after which this one takes over
    ///
    /// But not before 15 ms, and not before --guard and 2 ms: the guard of an ACTIVE that hangs has to have acted.
    #[arg(
        long,
        value_name = "CYCLES",
        default_value = "3",
        value_parser = number(3_u32..=1000, 10),
        requires = "declaration"
    )]
    timeout: u32,
    /// How long this one listens before it becomes ACTIVE at its start; a random pause up to this time follows
    #[arg(long, value_name = "TIME", value_parser = time, default_value = "2s", requires = "declaration")]
    listen: Duration,
    /// Stay INACTIVE: neither take over, nor be handed the role over
    #[arg(long, requires = "declaration")]
    permanent_standby: bool,
}

impl PolicyArguments {
    /// The policy, where both controllers have a guard with this limit.
    fn policy(self, guard: Duration) -> Policy {
        let policy = if self.permanent_standby { Policy::permanent_standby() } else { Policy::default() };
        let least = policy.least_time_out.max(guard + GUARD_ACTS);
        policy.with_time_out(self.timeout, least).with_listen(self.listen)
    }
}

/// Forwards, and says what; takes over with a declaration.
pub fn run(arguments: &StandbyArguments) -> Result<Report, Failure> {
    if arguments.automatic || arguments.declared.configured.is_given() {
        return takeover::run(arguments);
    }
    let end = EndRequest::watch(arguments.thread.priority)?;
    let names = &arguments.links;
    names.check()?;
    let Some(redundant) = names.redundant.as_deref() else {
        return Err(Failure::new("an INACTIVE MainDevice forwards between two interfaces: add --redundant"));
    };
    let links = PacketLinks::open_forwarding(&names.main, redundant, arguments.thread.mode())?;
    check_sockets(names.all(), arguments.force)?;
    let second = StoreAndForward::new(links.addresses()).map_err(|error| Failure::new(error.to_string()))?;
    let mut second = second.with_max_age(arguments.max_age);
    let mut guarded = if arguments.no_guard {
        Guarded::unguarded()
    } else {
        Guarded::start(arguments.guard, arguments.thread.priority, [&names.main, redundant])?
    };
    let _awake = arguments.thread.apply();
    let mut links = LinksUp::new(links)?;
    say!("INACTIVE: forwarding between {} and {redundant}; Ctrl-C ends it", names.main);
    let until = arguments.lasts.map_or(Instant::NEVER, |lasts| links.0.now() + lasts);
    let mut active = Activity::default();
    let mut carriers_due = Some(links.0.now() + CARRIER_LIMIT);
    while !end.is_asked() && links.0.now() < until && second.counters().same_identity == 0 && guarded.beat() {
        links.0.wait(until.min(links.0.now() + guarded.look()));
        let taken = second.forward(&mut links.0);
        let now = links.0.now();
        active.observe(now, taken > 0);
        guarded.check(now);
        if carriers_due.take_if(|at| now >= *at).is_some() {
            let down = Link::ALL.into_iter().filter(|link| links.0.carrier(*link) == Some(false));
            down.for_each(|link| warn(describe_down(names.of(link))));
        }
    }
    guarded.end();
    links.down()?;
    let unguarded = guarded.release();
    say!("{} and {redundant} are switched off: the ACTIVE has a line", names.main);
    let counters = second.counters();
    say!("{}", in_line(&counters));
    let forwarded = counters.on_main + counters.on_redundant;
    let none = (forwarded == 0).then(|| "no frame of another MainDevice came".to_owned());
    let verdict = Verdict::Held(format!("{forwarded} frames forwarded"));
    let verdict = verdict.and(none).and(same_identity(&counters)).and(unguarded).and(end.cut_short(arguments.lasts));
    Ok(Report { verdict, data: Data::Standby(Standby::from(&counters)) })
}

/// Why this MainDevice and the ACTIVE cannot be two of one ring.
fn same_identity(counters: &ForwardingCounters) -> Option<String> {
    let reason = "the ACTIVE has the same bytes 3 to 5 in its address as an interface here, so neither can tell its \
                  frames from those of the other: give that interface another address (ip link set IF address ...)";
    (counters.same_identity > 0).then(|| reason.to_owned())
}

/// Links that are up as long as this lives, also if the program panics.
struct LinksUp(PacketLinks);

impl LinksUp {
    fn new(mut links: PacketLinks) -> Result<LinksUp, Failure> {
        if let Err(error) = links.switch(true) {
            // One of them may be on already.
            let _ = links.switch(false);
            return Err(error.into());
        }
        Ok(LinksUp(links))
    }

    /// Takes them down.
    fn down(mut self) -> Result<(), Failure> {
        Ok(self.0.switch(false)?)
    }
}

impl Drop for LinksUp {
    fn drop(&mut self) {
        // Where it is not permitted, it was not permitted to begin either.
        let _ = self.0.switch(false);
    }
}

/// The counters in a line.
fn in_line(counters: &ForwardingCounters) -> String {
    let ForwardingCounters { on_main, on_redundant, sent_back, again, own, not_ethercat, too_old, no_link, .. } =
        counters;
    format!(
        "forwarded {on_main} on MAIN, {on_redundant} on RED, of these {sent_back} back; not forwarded: {again} again, \
         {own} own, {not_ethercat} not EtherCAT, {too_old} too old, {no_link} without a link"
    )
}

/// Whether frames of the ACTIVE come.
#[derive(Debug, Default)]
struct Activity {
    /// Arrival of the last frames, while they come.
    last: Option<Instant>,
}

impl Activity {
    /// Says when frames begin and end.
    fn observe(&mut self, now: Instant, has_come: bool) {
        match self.last {
            None if has_come => say!("frames of another MainDevice come"),
            Some(last) if !has_come && now.since(last) >= SILENT => {
                say!("no frames for {} s", SILENT.as_secs());
                self.last = None;
                return;
            }
            _ => {}
        }
        if has_come {
            self.last = Some(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use ringcat::standby::MAX_AGE;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        standby: StandbyArguments,
    }

    // covers: standby
    #[test]
    fn a_guard_has_a_limit_that_a_host_can_keep_or_is_left_out() {
        let parse = |more: &[&str]| {
            Line::try_parse_from(["standby", "--main", "a", "--redundant", "b"].iter().chain(more))
                .map(|line| (line.standby.guard, line.standby.no_guard))
        };
        assert_eq!(parse(&[]).ok(), Some((Duration::from_millis(20), false)));
        assert_eq!(parse(&["--guard", "1ms"]).ok(), Some((Duration::from_millis(1), false)));
        assert_eq!(parse(&["--no-guard"]).map(|(_, none)| none).ok(), Some(true));
        for wrong in [&["--guard", "999us"][..], &["--guard", "0ms"], &["--guard", "5ms", "--no-guard"]] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    // covers: standby
    #[test]
    fn frames_are_forwarded_up_to_the_age_that_the_library_has_by_default() {
        let line = Line::try_parse_from(["standby", "--main", "a", "--redundant", "b"]).expect("it is complete");
        assert_eq!(line.standby.max_age, MAX_AGE);
    }
}
