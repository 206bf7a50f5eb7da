//! `ringcat clocks`: brings the distributed clocks of a segment together and shows how well they keep.
//!
//! Everything on the wire goes to OP as its SII says, without SYNC signals. Once all clocks are locked their differences
//! are watched for a while; then comes a table, and a picture if one is wanted.

mod plot;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::thread::sleep;
use std::time::Duration;

use clap::Args;
use ringcat::text::{Names, describe};
use ringcat::{
    ClockConfig, ClockStatus, Declaration, Instant, LastOutputs, Options, SupervisorThread, Trigger, automatic,
    system_time,
};
use ringcat_wire::al::AlState;

use crate::interfaces::{Failure, InterfaceArguments, ThreadArguments, end_request, is_asked};
use crate::output::say;
use crate::recording::RecordingArguments;
use crate::times::time;
use plot::{Course, plot};

/// From activation to the lock at the most.
const LOCK_LIMIT: Duration = Duration::from_secs(60);
/// SubDevices have this long to get to INIT in the end.
const STOP_LIMIT: Duration = Duration::from_secs(5);
/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(10);

/// How to read what it prints.
const TABLE_HELP: &str = "\
  delay       nanoseconds from the reference clock, as measured (register 0x0928)
  offset      from the clock's own time to system time (0x0920)
  drift       how much faster than the reference it ran while it was free
  now, worst  its difference to the reference (0x092C): when it was read last, and the largest since it was locked

Exit status: 0 all clocks locked and stayed within 1 us, 1 they did not.";

/// Options of `ringcat clocks`.
#[derive(Args, Debug)]
#[command(after_help = TABLE_HELP)]
pub struct ClocksArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
    #[command(flatten)]
    recording: RecordingArguments,
    /// Cycle time, with its unit: 250us, 1ms.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = time)]
    cycle: Duration,
    /// How long to watch once all clocks are locked, such as 10s; until Ctrl-C with a time that long.
    #[arg(long = "for", value_name = "TIME", default_value = "5s", value_parser = time)]
    lasts: Duration,
    /// The reference clock follows this host (bus shift); otherwise the cycles follow the reference clock (master shift).
    #[arg(long)]
    bus_shift: bool,
    /// Draw the differences over time into this file.
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// Runs; true where all clocks locked and stayed together.
pub fn run(arguments: &ClocksArguments) -> Result<bool, Failure> {
    let end = end_request();
    let thread = arguments.thread;
    let (cyclic, acyclic) = arguments.interfaces.open_halves(thread)?;
    let recording = arguments.recording.start(&arguments.interfaces)?;
    let (cyclic, acyclic) = (recording.tee(cyclic), recording.tee(acyclic));
    let _awake = thread.prepare_process();
    let begin = now();
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), move || thread.prepare_supervisor())?;
    let scan = supervisor.scan()?;
    if !scan.subdevices.iter().any(|info| info.controller.features.dc) {
        return Err(Failure::new("no SubDevice of this segment has a distributed clock"));
    }
    let names = Names(scan.subdevices.iter().map(|info| info.name.clone()).collect());
    let config =
        ClockConfig { bus_shift: arguments.bus_shift, epoch: system_time::epoch(now()), ..ClockConfig::default() };
    let declaration = Declaration { clocks: Some(config), ..automatic(&scan.subdevices, arguments.cycle) };
    let mut application = supervisor.activate(declaration, cyclic).map_err(ringcat::Error::from)?;
    if !arguments.bus_shift {
        application.set_trigger(Trigger::ReferenceClock { phase_ns: 0 });
    }
    let cycles = application.start_cycles(move || thread.prepare_cycles(), |_| ControlFlow::Continue(()))?;
    let watch = Watch { begin, names: &names, end: &end };
    let mut course = Course::default();
    let locked = watch.until(cycles.supervisor(), &mut course, now() + LOCK_LIMIT, true)?;
    if locked {
        watch.until(cycles.supervisor(), &mut course, now() + arguments.lasts, false)?;
    }
    let clocks = cycles.supervisor().with(|engine| engine.clocks())?;
    lines(&clocks, &names).iter().for_each(|line| say!("{line}"));
    if let Some(path) = &arguments.plot {
        std::fs::write(path, plot(&course, &clocks))
            .map_err(|error| Failure::new(format!("{} cannot be written: {error}", path.display())))?;
        say!("differences over time: {}", path.display());
    }
    let application = cycles.end()?;
    application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT)?;
    let kept = clocks.iter().all(|clock| clock.worst_ns <= ClockConfig::default().sync_window_ns);
    Ok(locked && kept)
}

fn now() -> Instant {
    Instant(ringcat_link::monotonic::now_ns())
}

struct Watch<'a> {
    begin: Instant,
    names: &'a Names,
    end: &'a AtomicBool,
}

impl Watch<'_> {
    /// Tells events and notes differences until a time, or until all clocks are locked; whether they are.
    fn until(
        &self,
        supervisor: &SupervisorThread,
        course: &mut Course,
        until: Instant,
        ends_with_lock: bool,
    ) -> Result<bool, Failure> {
        loop {
            while let Some(event) = supervisor.pop_event() {
                let at = event.at.since(self.begin).as_secs_f64() * 1e3;
                say!("{at:>12.3} ms  {}", describe(&event.event, self.names));
            }
            let (locked, clocks) = supervisor.with(|engine| (engine.clocks_locked(), engine.clocks()))?;
            course.note(now().since(self.begin), &clocks);
            if (locked && ends_with_lock) || now() >= until || is_asked(self.end) {
                return Ok(locked);
            }
            sleep(LOOK);
        }
    }
}

/// One line per clock, below a heading.
fn lines(clocks: &[ClockStatus], names: &Names) -> Vec<String> {
    let heading =
        "pos  station  delay/ns  drift/ppm   now/ns  worst/ns  locked              offset/ns  name".to_owned();
    let line = |clock: &ClockStatus| {
        let name = clock.subdevice.and_then(|subdevice| names.0.get(subdevice)).map_or("", String::as_str);
        let difference = clock.difference_ns.map_or_else(|| "-".to_owned(), |ns| ns.to_string());
        let state = match (clock.is_reference, clock.is_locked) {
            (true, _) => "reference",
            (false, true) => "yes",
            (false, false) => "no",
        };
        format!(
            "{:>3}  {}  {:>8}  {:>9.3}  {:>7}  {:>8}  {:<9}  {:>20}  {}",
            clock.position,
            clock.station,
            clock.delay_ns,
            clock.drift_ppb as f64 / 1e3,
            difference,
            clock.worst_ns,
            state,
            clock.offset_ns,
            name
        )
    };
    std::iter::once(heading).chain(clocks.iter().map(line)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::address::StationAddress;

    #[test]
    fn a_line_says_what_is_known_of_a_clock() {
        let clock = ClockStatus {
            position: 3,
            station: StationAddress(0x1004),
            subdevice: Some(0),
            is_reference: false,
            delay_ns: 1_050,
            offset_ns: -7,
            drift_ppb: -12_345,
            difference_ns: Some(-9),
            worst_ns: 31,
            is_locked: true,
        };
        let lines = lines(&[clock], &Names(vec!["servo".to_owned()]));
        let words: Vec<&str> = lines[1].split_whitespace().collect();
        assert_eq!(words, ["3", "0x1004", "1050", "-12.345", "-9", "31", "yes", "-7", "servo"]);
    }
}
