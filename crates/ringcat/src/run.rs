//! `ringcat run`: everything on the wire to OP as its SII says, process data in a fixed cycle, and an orderly stop.
//!
//! Outputs stay zero: this command knows of no application. What keeps the cycle from its time is told apart: wake-ups
//! that came late and cycles that were left out are this machine's, lost frames are the wire's.

use std::io::{IsTerminal, stdout};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;
use ringcat::histogram::Histogram;
use ringcat::packet::PacketLinks;
use ringcat::text::{Names, describe};
use ringcat::{
    Application, DomainId, DomainStatus, Event, Instant, LastOutputs, Link, MainDevice, Options, SubDeviceState,
    automatic,
};
use ringcat_wire::al::AlState;

use crate::interfaces::{Failure, InterfaceArguments, ThreadArguments, end_request, is_asked};
use crate::output::{say, write};
use crate::surroundings::Surroundings;

/// From activation to OP of the last SubDevice at the most.
const OP_LIMIT: Duration = Duration::from_secs(60);
/// SubDevices have this long to get to INIT in the end.
const STOP_LIMIT: Duration = Duration::from_secs(5);
/// The live line is written anew so often.
const LIVE: Duration = Duration::from_millis(500);

/// Changes of the process data's judgement are told so often; all are counted.
const JUDGEMENTS_TOLD: u32 = 20;

/// How to read what it prints.
const SUMMARY_HELP: &str = "\
All outputs stay zero. Watchdogs, process data and mailboxes are set up as each SubDevice's EEPROM (SII) says.

Ctrl-C ends it in order: outputs zero, all SubDevices to INIT. Exit status 0: all reached OP and no frame was lost.

The summary tells three things apart:
  this machine   wake-ups that came late and cycles that were left out for that. Nothing on the cable is wrong: try
                 --priority 80, a --cpu of its own, a real-time kernel
  the wire       frames that did not come back, came back late, or damaged: cables, plugs, power, other MainDevices
  round trips    from sending a frame to its return: what is left of the cycle is yours";

/// Options of `ringcat run`.
#[derive(Args, Debug)]
#[command(after_help = SUMMARY_HELP)]
pub struct RunArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
    /// Cycle time, with its unit: 250us, 1ms.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = time)]
    cycle: Duration,
    /// How long to exchange process data once all are in OP, such as 10s or 5min; until Ctrl-C by default.
    #[arg(long = "for", value_name = "TIME", value_parser = time)]
    lasts: Option<Duration>,
}

/// A time with its unit.
fn time(text: &str) -> Result<Duration, String> {
    let at = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(at);
    let unit_ns = match unit {
        "us" => 1_000,
        "ms" => 1_000_000,
        "s" => 1_000_000_000,
        "min" => 60_000_000_000,
        _ => 0u64,
    };
    let ns = number.parse::<u64>().ok().and_then(|number| number.checked_mul(unit_ns)).filter(|ns| *ns > 0);
    ns.map(Duration::from_nanos).ok_or_else(|| "expected a number with us, ms, s or min behind it, as in 500us".into())
}

/// Runs cycles; true where all SubDevices reached OP and no frame was lost afterwards.
pub fn run(arguments: &RunArguments) -> Result<bool, Failure> {
    let end = end_request();
    let links = arguments.interfaces.open(arguments.thread)?;
    let mut surroundings = Surroundings::watch(&arguments.interfaces, &links);
    let _awake = arguments.thread.apply();
    let mut main_device = MainDevice::request(links, &Options::default());
    let begin = ringcat_link::monotonic::now_ns();
    let result = main_device.scan_with(|event| {
        tell_of_others(&mut surroundings, &event.event);
    });
    let foreign = main_device.acyclic_counters().foreign;
    let scan = result.map_err(|error| surroundings.explain(error, foreign))?;
    say!("{} SubDevices; cycle {} us", scan.subdevices.len(), arguments.cycle.as_micros());
    let names = Names(scan.subdevices.iter().map(|info| info.name.clone()).collect());
    let application =
        main_device.activate(automatic(&scan.subdevices, arguments.cycle)).map_err(ringcat::Error::from)?;
    let mut run = Run {
        application,
        names,
        begin: Instant(begin),
        wake_ups: Histogram::default(),
        live: Live { terminal: stdout().is_terminal(), next: Instant(0), open: false },
        judgements_told: 0,
        surroundings,
    };
    let in_op = run.reach_op(&end);
    let before = run.application.cyclic_counters();
    if in_op {
        let until = arguments.lasts.map_or(Instant::NEVER, |lasts| run.application.now() + lasts);
        run.exchange(until, &end);
    }
    let counters = run.application.cyclic_counters();
    run.summary();
    let application = run.application;
    application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT)?;
    say!("  stopped: outputs zero, all SubDevices in INIT");
    Ok(in_op && counters.lost == before.lost)
}

struct Run {
    application: Application<PacketLinks>,
    names: Names,
    begin: Instant,
    wake_ups: Histogram,
    live: Live,
    judgements_told: u32,
    surroundings: Surroundings,
}

/// Tells of a MainDevice that has not been told of; whether the event was a frame of one.
fn tell_of_others(surroundings: &mut Surroundings, event: &Event) -> bool {
    let noted = surroundings.note(event);
    noted.iter().flatten().for_each(|words| eprintln!("ringcat: {words}"));
    noted.is_some()
}

impl Run {
    /// One cycle; its domain's judgement.
    fn cycle(&mut self) -> DomainStatus {
        let status = self.application.cycle(|data| data.status(DomainId(0)));
        self.wake_ups.record(self.application.pace().last_delay);
        while let Some(event) = self.application.pop_event() {
            match event.event {
                Event::Skipped { .. } => continue,
                Event::ForeignFrame { .. } => {
                    tell_of_others(&mut self.surroundings, &event.event);
                    continue;
                }
                Event::Domain { .. } if self.judgements_told == JUDGEMENTS_TOLD => continue,
                Event::Domain { .. } => self.judgements_told += 1,
                _ => {}
            }
            self.live.end();
            say!("{:>12.3} ms  {}", self.since_begin(event.at), describe(&event.event, &self.names));
        }
        status
    }

    fn since_begin(&self, at: Instant) -> f64 {
        at.since(self.begin).as_secs_f64() * 1e3
    }

    /// Cycles until all SubDevices are in OP; false where somebody does not get there, or the user does not want it.
    fn reach_op(&mut self, end: &AtomicBool) -> bool {
        let until = self.application.now() + OP_LIMIT;
        while !self.application.all_settled() {
            if is_asked(end) {
                return false;
            }
            if self.application.now() >= until {
                say!("not all SubDevices reached OP within {} s:", OP_LIMIT.as_secs());
                for (subdevice, state) in self.application.states().iter().enumerate() {
                    let state = match state {
                        SubDeviceState::Absent => "does not answer".to_owned(),
                        SubDeviceState::Configuring => "is being configured".to_owned(),
                        SubDeviceState::Settled(state) => state.to_string(),
                    };
                    let name = self.names.0.get(subdevice).map_or("", String::as_str);
                    say!("  SubDevice {subdevice} \"{name}\": {state}");
                }
                return false;
            }
            self.cycle();
        }
        let now = self.application.now();
        say!("{:>12.3} ms  all SubDevices are in OP", self.since_begin(now));
        self.application.reset_round_trips();
        self.wake_ups = Histogram::default();
        true
    }

    fn exchange(&mut self, until: Instant, end: &AtomicBool) {
        while self.application.now() < until && !is_asked(end) {
            let status = self.cycle();
            self.live.show(&self.application, status);
        }
        self.live.end();
    }

    fn summary(&self) {
        let application = &self.application;
        let (pace, cyclic, acyclic) =
            (application.pace(), application.cyclic_counters(), application.acyclic_counters());
        say!("\nsummary");
        say!(
            "  cycles: {}, judged not complete: {}, frames still out: {}",
            pace.cycles,
            cyclic.incomplete,
            cyclic.skipped
        );
        say!(
            "  this machine: {} late wake-ups (more than a tenth of the cycle), {} cycles left out, the latest by {:.3} ms",
            pace.late,
            pace.skipped,
            pace.longest_delay.as_secs_f64() * 1e3
        );
        say!(
            "  the wire: {} frames sent, {} lost, {} copies lost, {} late, {} corrupt",
            cyclic.sent,
            cyclic.lost,
            cyclic.copies_lost + cyclic.half,
            cyclic.late,
            cyclic.corrupt
        );
        say!(
            "  everything else: {} frames with {} datagrams, {} sent again",
            acyclic.sent,
            acyclic.datagrams,
            acyclic.resent
        );
        if cyclic.foreign + acyclic.foreign > 0 {
            let (frames, senders) = (cyclic.foreign + acyclic.foreign, self.surroundings.senders());
            say!("  other MainDevices: {frames} frames, {senders}");
        }
        for link in [Link::Main, Link::Redundant] {
            let Some(counters) = application.links().counters(link) else { continue };
            say!(
                "  {link}: {} sent, {} received; not sent: {} interface down, {} queue full, {} refused; {} overrun",
                counters.sent,
                counters.received,
                counters.down,
                counters.busy,
                counters.refused,
                counters.overrun
            );
        }
        say!("  round trips of process data: {}", application.round_trips());
        say!("  wake-ups after their time: {}", self.wake_ups);
    }
}

/// A line on a terminal that shows how it goes.
struct Live {
    terminal: bool,
    next: Instant,
    open: bool,
}

impl Live {
    fn show(&mut self, application: &Application<PacketLinks>, status: DomainStatus) {
        let now = application.now();
        if !self.terminal || now < self.next {
            return;
        }
        self.next = now + LIVE;
        let (pace, cyclic) = (application.pace(), application.cyclic_counters());
        write(format_args!(
            "\r{:>9} cycles  wkc {}/{}  ring {:?}  late {}  left out {}  lost {}  round trip {:.1} us ",
            pace.cycles,
            status.wkc,
            status.expected,
            application.ring(),
            pace.late,
            pace.skipped,
            cyclic.lost,
            application.round_trips().quantile(500_000).as_nanos() as f64 / 1e3
        ));
        self.open = true;
    }

    fn end(&mut self) {
        if self.open {
            say!();
            self.open = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_a_unit() {
        assert_eq!(time("250us"), Ok(Duration::from_micros(250)));
        assert_eq!(time("10s"), Ok(Duration::from_secs(10)));
        for wrong in ["", "1", "ms", "0ms", "1.5ms", "-1s", "99999999999999999999s", "18446744073709551615s"] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
    }
}
