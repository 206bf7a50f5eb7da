//! `ringcat run`: everything on the wire to OP as its SII says, process data in a fixed cycle, and an orderly stop.
//!
//! Cycles have a thread of their own, and so has everything else; this one only tells. Outputs stay zero: this command
//! knows of no application. What keeps the cycle from its time is told apart: wake-ups
//! that came late and cycles that were left out are this machine's, lost frames are the wire's.

use std::io::{IsTerminal, stdout};
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;
use std::thread::sleep;
use std::time::Duration;

use clap::Args;
use ringcat::news::News;
use ringcat::packet::PacketLinks;
use ringcat::tee::Tee;
use ringcat::text::{Names, address_of_sender, describe};
use ringcat::{
    Application, CyclicThread, DomainId, Event, Instant, LastOutputs, Link, Links, Options, SubDeviceState,
    SupervisorThread, automatic,
};
use ringcat_wire::al::AlState;

use crate::interfaces::{Failure, InterfaceArguments, ThreadArguments, end_request, is_asked};
use crate::output::{say, write};
use crate::recording::RecordingArguments;
use crate::surroundings::Surroundings;

/// From activation to OP of the last SubDevice at the most.
const OP_LIMIT: Duration = Duration::from_secs(60);
/// SubDevices have this long to get to INIT in the end.
const STOP_LIMIT: Duration = Duration::from_secs(5);
/// Pause between two looks at what the threads do.
const LOOK: Duration = Duration::from_millis(1);
/// The live line is written anew so often.
const LIVE: Duration = Duration::from_millis(500);

/// Changes of the process data's judgement are told so often; all are counted.
const JUDGEMENTS_TOLD: u32 = 200;

/// Cycles that were left out are told at most this often, and so many times at most; all are counted.
const STALL_PAUSE: Duration = Duration::from_millis(100);
const STALLS_TOLD: u32 = 200;
/// What is under way when the last frame was sent is back within.
const LAST_FRAMES: Duration = Duration::from_millis(20);

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
    #[command(flatten)]
    recording: RecordingArguments,
    /// Cycle time, with its unit: 250us, 1ms.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = time)]
    cycle: Duration,
    /// How long to exchange process data once all are in OP, such as 10s or 5min; until Ctrl-C by default.
    #[arg(long = "for", value_name = "TIME", value_parser = time)]
    lasts: Option<Duration>,
}

/// A time with its unit.
pub fn time(text: &str) -> Result<Duration, String> {
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
    let thread = arguments.thread;
    let (cyclic, acyclic) = arguments.interfaces.open_halves(thread)?;
    let mut surroundings = Surroundings::watch(&arguments.interfaces, &cyclic);
    let recording = arguments.recording.start(&arguments.interfaces)?;
    let (mut cyclic, acyclic) = (recording.tee(cyclic), recording.tee(acyclic));
    let _awake = thread.prepare_process();
    let begin = now();
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), move || thread.prepare_supervisor())?;
    let mut others = 0;
    let result = supervisor.scan_while(|| {
        tell_events(&supervisor, &mut surroundings);
        others += tell_of_others(&mut cyclic, &mut surroundings);
    });
    let scan = result.map_err(|error| surroundings.explain(error, others + supervisor.counters().foreign))?;
    say!("{} SubDevices; cycle {} us", scan.subdevices.len(), arguments.cycle.as_micros());
    let names = Names(scan.subdevices.iter().map(|info| info.name.clone()).collect());
    let declaration = automatic(&scan.subdevices, arguments.cycle);
    let application = supervisor.activate(declaration, cyclic).map_err(ringcat::Error::from)?;
    let cycles = application.start_cycles(move || thread.prepare_cycles(), |_| ControlFlow::Continue(()))?;
    let live = Live { terminal: stdout().is_terminal(), next: Instant(0), open: false };
    let mut run = Run { cycles, names, begin, live, judgements_told: 0, stalls: Stalls::default(), surroundings };
    let in_op = run.reach_op(&end);
    let before = run.cycles.news().counters();
    if in_op {
        let until = arguments.lasts.map_or(Instant::NEVER, |lasts| now() + lasts);
        run.exchange(until, &end);
    }
    let application = run.cycles.end()?;
    summary(&application, &run.surroundings);
    let lost = application.cyclic_counters().lost - before.lost;
    let (supervisor, mut links) = application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT)?;
    final_account(&mut links, &supervisor);
    say!("  stopped: outputs zero, all SubDevices in INIT");
    Ok(in_op && lost == 0)
}

fn now() -> Instant {
    Instant(ringcat_link::monotonic::now_ns())
}

struct Run {
    cycles: CyclicThread<Tee<PacketLinks>>,
    names: Names,
    begin: Instant,
    live: Live,
    judgements_told: u32,
    stalls: Stalls,
    surroundings: Surroundings,
}

/// Cycles that this machine was too late for, as far as they have been told.
#[derive(Default)]
struct Stalls {
    told: u64,
    lines: u32,
    next: Instant,
}

impl Stalls {
    /// How many there are that have not been told, if it is time to.
    fn news(&mut self, skipped: u64, now: Instant) -> Option<u64> {
        let more = skipped - self.told;
        if more == 0 || now < self.next || self.lines == STALLS_TOLD {
            return None;
        }
        *self = Stalls { told: skipped, lines: self.lines + 1, next: now + STALL_PAUSE };
        Some(more)
    }
}

/// Tells of other MainDevices among the events of a scan.
fn tell_events(supervisor: &SupervisorThread, surroundings: &mut Surroundings) {
    while let Some(event) = supervisor.pop_event() {
        surroundings.note(&event.event).iter().flatten().for_each(|words| eprintln!("ringcat: {words}"));
    }
}

/// Frames that arrive for the cyclic half before it sends any are those of other MainDevices. Returns how many.
fn tell_of_others(links: &mut impl Links, surroundings: &mut Surroundings) -> u64 {
    let mut count = 0;
    while links.receive(&mut |link, frame| {
        count += 1;
        if let Some(source) = address_of_sender(frame) {
            surroundings.tell_sender(link, source);
        }
    }) {}
    count
}

impl Run {
    /// Tells what has happened since the last look.
    fn look(&mut self) {
        if let Some((link, source)) = self.cycles.news().foreign() {
            self.surroundings.tell_sender(link, source);
        }
        while let Some(event) = self.cycles.supervisor().pop_event() {
            match event.event {
                Event::Skipped { .. } => continue,
                Event::ForeignFrame { arrived_on, bytes } => {
                    if let Some(source) = address_of_sender(&bytes) {
                        self.surroundings.tell_sender(arrived_on, source);
                    }
                    continue;
                }
                Event::Domain { .. } if self.judgements_told == JUDGEMENTS_TOLD => continue,
                Event::Domain { .. } => self.judgements_told += 1,
                _ => {}
            }
            self.live.end();
            say!("{:>12.3} ms  {}", self.since_begin(event.at), describe(&event.event, &self.names));
        }
        if let Some(left_out) = self.stalls.news(self.cycles.news().pace().skipped, now()) {
            self.live.end();
            say!("{:>12.3} ms  this machine: {left_out} cycles left out", self.since_begin(now()));
        }
    }

    fn since_begin(&self, at: Instant) -> f64 {
        at.since(self.begin).as_secs_f64() * 1e3
    }

    /// Until all SubDevices are in OP; false where somebody does not get there, or the user does not want it.
    fn reach_op(&mut self, end: &AtomicBool) -> bool {
        let until = now() + OP_LIMIT;
        while !self.cycles.supervisor().all_settled() {
            if is_asked(end) || self.cycles.has_ended() {
                return false;
            }
            if now() >= until {
                self.tell_states();
                return false;
            }
            self.look();
            sleep(LOOK);
        }
        let reached = now();
        self.look();
        say!("{:>12.3} ms  all SubDevices are in OP", self.since_begin(reached));
        self.cycles.news().restart_histograms();
        true
    }

    fn tell_states(&self) {
        say!("not all SubDevices reached OP within {} s:", OP_LIMIT.as_secs());
        for (subdevice, state) in self.cycles.supervisor().states().iter().enumerate() {
            let state = match state {
                SubDeviceState::Absent => "does not answer".to_owned(),
                SubDeviceState::Configuring => "is being configured".to_owned(),
                SubDeviceState::Settled(state) => state.to_string(),
            };
            let name = self.names.0.get(subdevice).map_or("", String::as_str);
            say!("  SubDevice {subdevice} \"{name}\": {state}");
        }
    }

    fn exchange(&mut self, until: Instant, end: &AtomicBool) {
        while now() < until && !is_asked(end) && !self.cycles.has_ended() {
            self.look();
            self.live.show(self.cycles.news());
            sleep(LOOK.min(until.since(now())));
        }
        self.look();
        self.live.end();
    }
}

fn summary(application: &Application<Tee<PacketLinks>, SupervisorThread>, surroundings: &Surroundings) {
    let (pace, cyclic, acyclic) = (application.pace(), application.cyclic_counters(), application.acyclic_counters());
    say!("\nsummary");
    say!("  cycles: {}, judged not complete: {}, frames still out: {}", pace.cycles, cyclic.incomplete, cyclic.skipped);
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
    if cyclic.foreign + acyclic.foreign > 0 {
        let (frames, senders) = (cyclic.foreign + acyclic.foreign, surroundings.senders());
        say!("  other MainDevices: {frames} frames, {senders}");
    }
    say!("  round trips of process data: {}", application.round_trips());
    say!("  wake-ups after their time: {}", application.news().wake_ups());
}

/// What the interfaces have carried from the first frame to the last, the stop included.
fn final_account(links: &mut Tee<PacketLinks>, supervisor: &SupervisorThread) {
    let until = now() + LAST_FRAMES;
    while now() < until {
        while links.receive(&mut |_, _| ()) {}
        links.wait(until);
    }
    for link in [Link::Main, Link::Redundant] {
        let Some(counters) = links.links().counters(link) else { continue };
        say!(
            "  process data on {link}: {} sent, {} received; not sent: {} interface down, {} queue full, {} refused; {} overrun",
            counters.sent,
            counters.received,
            counters.down,
            counters.busy,
            counters.refused,
            counters.overrun
        );
    }
    let acyclic = supervisor.counters();
    say!(
        "  everything else: {} frames sent with {} datagrams, {} lost, {} copies lost, {} late; {} datagrams sent again",
        acyclic.sent,
        acyclic.datagrams,
        acyclic.lost,
        acyclic.half,
        acyclic.late,
        acyclic.resent
    );
}

/// A line on a terminal that shows how it goes.
struct Live {
    terminal: bool,
    next: Instant,
    open: bool,
}

impl Live {
    fn show(&mut self, news: &News) {
        let now = now();
        if !self.terminal || now < self.next {
            return;
        }
        self.next = now + LIVE;
        let (pace, cyclic, status) = (news.pace(), news.counters(), news.status(DomainId(0)));
        write(format_args!(
            "\r{:>9} cycles  wkc {}/{}  ring {:?}  late {}  left out {}  lost {}  round trip {:.1} us ",
            pace.cycles,
            status.wkc,
            status.expected,
            news.ring(),
            pace.late,
            pace.skipped,
            cyclic.lost,
            news.round_trips().quantile(500_000).as_nanos() as f64 / 1e3
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
    fn cycles_that_were_left_out_are_told_once_and_not_too_often() {
        let mut stalls = Stalls::default();
        let ms = |ms: u64| Instant(ms * 1_000_000);
        assert_eq!((stalls.news(0, ms(1)), stalls.news(3, ms(2)), stalls.news(3, ms(3))), (None, Some(3), None));
        assert_eq!((stalls.news(4, ms(50)), stalls.news(9, ms(103)), stalls.news(9, ms(500))), (None, Some(6), None));
        let told = (0..1_000).filter(|at| stalls.news(10 + at, ms(1_000 + 1_000 * at)).is_some()).count();
        assert_eq!(told + 2, STALLS_TOLD as usize);
    }

    #[test]
    fn times_have_a_unit() {
        assert_eq!(time("250us"), Ok(Duration::from_micros(250)));
        assert_eq!(time("10s"), Ok(Duration::from_secs(10)));
        for wrong in ["", "1", "ms", "0ms", "1.5ms", "-1s", "99999999999999999999s", "18446744073709551615s"] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
    }
}
