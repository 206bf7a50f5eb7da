//! `ringcat standby`: the second MainDevice of a ring, INACTIVE.
//!
//! It forwards the frames of the ACTIVE MainDevice between its interfaces. There is no takeover yet.

use std::time::Duration;

use clap::Args;
use ringcat::packet::PacketLinks;
use ringcat::standby::{ForwardingCounters, StoreAndForward};
use ringcat::{Instant, Link, Links};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{LinkNames, describe_down};
use crate::json::data::Data;
use crate::json::standby::Standby;
use crate::others::check_sockets;
use crate::output::{say, warn};
use crate::thread::ThreadArguments;
use crate::times::time;
use crate::verdict::{Report, Verdict};

/// Period of checks for the end.
const LOOK: Duration = Duration::from_millis(200);
/// No frame for this time: the ACTIVE MainDevice counts as silent.
const SILENT: Duration = Duration::from_secs(1);

/// What it is for, and what it is not.
const ABOUT_STANDBY: &str = "\
The ring leads through both MainDevices: from the main link of the ACTIVE
through the SubDevices into --redundant here, and from --main here to the
redundant link of the ACTIVE. Each frame is sent on at the other interface, or
back if that one is down.

It never sends on its own, and cannot take over yet: see docs/standby.md, which
begins with a note on patents.";

/// Options of `ringcat standby`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_STANDBY)]
pub struct StandbyArguments {
    #[command(flatten)]
    links: LinkNames,
    #[command(flatten)]
    thread: ThreadArguments,
    /// How long, such as 10s or 5min; until Ctrl-C by default
    #[arg(long = "for", value_name = "TIME", value_parser = time, help_heading = "Run")]
    lasts: Option<Duration>,
    /// Go on although another program on this host uses an interface
    #[arg(long, help_heading = "Run")]
    force: bool,
}

/// Forwards, and says what.
pub fn run(arguments: &StandbyArguments) -> Result<Report, Failure> {
    let end = EndRequest::watch(arguments.thread.priority)?;
    let names = &arguments.links;
    names.check()?;
    let Some(redundant) = names.redundant.as_deref() else {
        return Err(Failure::new("an INACTIVE MainDevice forwards between two interfaces: add --redundant"));
    };
    let mut links = PacketLinks::open(&names.main, Some(redundant), arguments.thread.mode())?;
    check_sockets(names.all(), arguments.force)?;
    let mut second = StoreAndForward::new(links.addresses()).map_err(|error| Failure::new(error.to_string()))?;
    let _awake = arguments.thread.apply();
    for link in Link::ALL.into_iter().filter(|link| links.carrier(*link) == Some(false)) {
        warn(describe_down(names.of(link)));
    }
    say!("INACTIVE: forwarding between {} and {redundant}; Ctrl-C ends it", names.main);
    let until = arguments.lasts.map_or(Instant::NEVER, |lasts| links.now() + lasts);
    let mut active = Activity::default();
    while !end.is_asked() && links.now() < until {
        links.wait(until.min(links.now() + LOOK));
        let taken = second.forward(&mut links);
        active.observe(links.now(), taken > 0);
    }
    let counters = second.counters();
    say!("{}", in_words(&counters));
    let forwarded = counters.on_main + counters.on_redundant;
    let none = (forwarded == 0).then(|| "no frame of another MainDevice came".to_owned());
    let verdict = Verdict::Held(format!("{forwarded} frames forwarded")).and(none).and(end.cut_short(arguments.lasts));
    Ok(Report { verdict, data: Data::Standby(Standby::from(&counters)) })
}

/// The counters in a line.
fn in_words(counters: &ForwardingCounters) -> String {
    let ForwardingCounters { on_main, on_redundant, sent_back, again, own, not_ethercat, no_link, .. } = counters;
    format!(
        "forwarded {on_main} on MAIN, {on_redundant} on RED, of these {sent_back} back; not forwarded: {again} again, \
         {own} own, {not_ethercat} not EtherCAT, {no_link} without a link"
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
