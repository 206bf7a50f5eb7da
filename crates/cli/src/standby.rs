//! `ringcat standby`: one of two MainDevices in a ring.
//!
//! It forwards the frames of the ACTIVE MainDevice between its interfaces. With a declaration it follows the ACTIVE,
//! and takes over ([`takeover`]).
//!
//! Its interfaces are up only while it forwards (protocol MR-21): an interface that is up and does not forward takes
//! the whole bus from the ACTIVE, one that is down leaves it a line.

mod beating;
mod counters;
mod ethernet;
mod event_report;
pub mod guarding;
mod joining;
mod options;
pub mod remote;
mod schedule;
mod takeover;

use std::time::Duration;

use ringcat::packet::PacketLinks;
use ringcat::standby::StoreAndForward;
use ringcat::{Instant, Link, Links};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::describe_down;
use crate::json::data::Data;
use crate::json::standby::Standby;
use crate::others::check_sockets;
use crate::output::{say, warn};
use crate::verdict::{Report, Verdict};

use counters::{in_line, same_identity};
use guarding::Guarded;
pub use options::StandbyArguments;

/// No frame for this time: the ACTIVE MainDevice counts as silent.
const SILENT: Duration = Duration::from_secs(1);
/// An interface without a carrier this long after it was switched on is reported.
const CARRIER_LIMIT: Duration = Duration::from_secs(5);

/// Forwards, and reports what; takes over with a declaration.
pub fn run(arguments: &StandbyArguments) -> Result<Report, Failure> {
    if arguments.automatic || arguments.declared.configured.is_given() {
        return takeover::run(arguments);
    }
    if arguments.declared.clocks || arguments.declared.clock_options.are_given() {
        return Err(Failure::new("clocks need a declaration: add --eni, --network or --automatic"));
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
    use ringcat::standby::{MAX_AGE, MasterSizes};

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
    fn clocks_without_a_declaration_are_refused_before_anything_is_opened() {
        for option in ["--clocks", "--bus-shift"] {
            let line = Line::try_parse_from(["standby", "--main", "a", "--redundant", "b", option]);
            let refused = run(&line.expect("it is complete").standby).expect_err("it is refused").to_string();
            assert!(refused.starts_with("clocks need a declaration"), "{option}: {refused}");
        }
    }

    // covers: standby, REQ009
    #[test]
    fn options_for_the_sizes_of_master_frames_are_those_of_the_library() {
        let sizes = |more: &[&str]| {
            let line = ["standby", "--main", "a", "--redundant", "b", "--automatic"];
            Line::try_parse_from(line.iter().chain(more)).map(|line| line.standby.sizes.sizes())
        };
        assert_eq!(sizes(&[]).ok(), Some(MasterSizes::default()));
        let given = ["--master-out", "16", "--master-in", "8", "--no-update-in", "--knowledge", "256"];
        let mut expected = MasterSizes::default();
        (expected.to_inactive, expected.to_active, expected.inputs, expected.knowledge) = (16, 8, false, 256);
        assert_eq!(sizes(&given).ok(), Some(expected));
        for wrong in [["--knowledge", "0"], ["--knowledge", "1473"], ["--master-out", "65536"]] {
            assert!(sizes(&wrong).is_err(), "{wrong:?}");
        }
    }

    // covers: standby
    #[test]
    fn frames_are_forwarded_up_to_the_age_that_the_library_has_by_default() {
        let line = Line::try_parse_from(["standby", "--main", "a", "--redundant", "b"]).expect("it is complete");
        assert_eq!(line.standby.max_age, MAX_AGE);
    }
}
