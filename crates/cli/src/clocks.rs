//! `ringcat clocks`: brings the distributed clocks of a segment together and shows how well they keep.
//!
//! All SubDevices go to OP as their SII says, with the SYNC signals of the options. Once all clocks are locked their
//! differences are recorded for a while; then comes a table and, with `--plot`, a picture.

mod plot;
mod table;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::thread::sleep;
use std::time::Duration;

use clap::Args;
use ringcat::event_log::EventLog;
use ringcat::text::Names;
use ringcat::{
    AlState, Application, ClockConfig, ClockStatus, CyclicThread, Instant, LastOutputs, SupervisorThread, SyncSignals,
    automatic,
};

use crate::access::{Access, AccessArguments, WireLinks};
use crate::clock_options::{ClockOptions, farthest};
use crate::descriptions::{EsiArgument, complete_by};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::now;
use crate::json::data::Data;
use crate::output::{counted, say, warn, write_event};
use crate::run_log::{RunLog, Shown};
use crate::svg::Picture;
use crate::times::{cycle, time};
use crate::verdict::{Report, Verdict};
use plot::{Course, plot};
pub use table::json;
use table::lines;

/// From activation to the lock at the most.
const LOCK_LIMIT: Duration = Duration::from_secs(60);
/// SubDevices have this long to get to INIT in the end.
const STOP_LIMIT: Duration = Duration::from_secs(5);
/// Pause between two readings.
const LOOK: Duration = Duration::from_millis(10);

/// How to read what it prints.
const TABLE_HELP: &str = "\
Columns of the table:
  delay       from the reference clock, as measured (register 0x0928);
              -: a fork without a clock hides it and none was written;
              ~: the middle of what it can be (--estimate-delays)
  drift       how much faster than the reference the clock would run by itself
              (register 0x0932)
  now, worst  difference to the reference (register 0x092C): at the last
              reading, and the largest since the lock
  offset      from the clock's own time to system time (register 0x0920)
  SYNC        signals: cycle, and shift with its sign

Exit status: 0 all clocks locked and stayed within 1 us, their delays are known
or estimated, and all SubDevices were in OP in the end; 1 otherwise.";

/// Options of `ringcat clocks`.
#[derive(Args, Debug)]
#[command(after_long_help = TABLE_HELP)]
pub struct ClocksArguments {
    #[command(flatten)]
    access: AccessArguments,
    #[command(flatten)]
    options: ClockOptions,
    /// Cycle time, with its unit: 250us, 1ms; 10us to 1s
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = cycle, help_heading = "Cycle")]
    cycle: Duration,
    /// How long to record differences once all clocks are locked, such as 10s
    #[arg(long = "for", value_name = "TIME", default_value = "5s", value_parser = time, help_heading = "Cycle")]
    lasts: Duration,
    /// Draw the differences over time into this file
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    esi: EsiArgument,
}

/// Runs the command. It succeeds if all clocks locked and stayed in the window.
pub fn run(arguments: &ClocksArguments) -> Result<Report, Failure> {
    let thread = arguments.access.thread;
    arguments.access.interfaces.links.check()?;
    // An unwritable file shows before the measurement.
    let mut picture = arguments.plot.as_ref().map(|path| Picture::create(path)).transpose()?;
    let mut descriptions = arguments.esi.open()?;
    let end = EndRequest::watch(thread.priority)?;
    let access = arguments.access.begin(&arguments.access.interfaces.options())?;
    let Access { supervisor, cyclic, surroundings, recording, daemon_bus, awake: _awake, .. } = access;
    let begin = now();
    let mut scan = match daemon_bus.scan() {
        Some(scan) => scan,
        None => supervisor.scan().map_err(|error| surroundings.explain(error, supervisor.counters().foreign))?,
    };
    let objects = complete_by(&supervisor, descriptions.as_mut(), &mut scan.subdevices)?;
    let names = Names(scan.subdevices.iter().map(|info| info.name.clone()).collect());
    let mut declaration = automatic(&scan.subdevices, arguments.cycle);
    arguments.options.declare(&mut declaration, &scan.subdevices)?;
    let signals: Vec<Option<SyncSignals>> = declaration.subdevices.iter().map(|config| config.sync).collect();
    let application = supervisor.activate(declaration, cyclic).map_err(ringcat::Error::from)?;
    let cycles = start_cycles(arguments, application, &end)?;
    let log = RunLog::new(begin, EventLog::new(begin, names), surroundings).with_objects(objects);
    let mut watch = Watch { begin, log, end: &end };
    let mut course = Course::default();
    let locked = watch.until(&cycles, &mut course, now() + LOCK_LIMIT, true)?;
    cycles.cyclic_status().restart_histograms();
    if locked {
        watch.until(&cycles, &mut course, now() + arguments.lasts, false)?;
    }
    end.no_limit();
    let clocks = cycles.supervisor().clocks()?;
    let settled = cycles.supervisor().all_settled();
    let mut reasons = reasons(&clocks, locked, settled);
    reasons.extend(end.cut_short(Some(arguments.lasts)));
    let cyclic_status = cycles.cyclic_status_handle();
    if let Some(picture) = &mut picture {
        reasons.extend(picture.draw(&plot(&course, &clocks)).err());
        say!("differences over time: {picture}");
    }
    let application = cycles.end().unwrap_or_else(|panicked| {
        reasons.push(panicked.to_string());
        panicked.application
    });
    reasons.extend(application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).err().map(|error| error.to_string()));
    reasons.extend(daemon_bus.end());
    reasons.extend(recording.finish());
    let verdict = Verdict::of(reasons, format!("{} locked and together", counted(clocks.len(), "clock", "clocks")));
    let phase_errors = cyclic_status.phase_errors();
    let names = watch.log.events().names();
    lines(&clocks, names, &signals).iter().for_each(|line| say!("{line}"));
    if phase_errors.count() > 0 {
        say!("cycles from their phase: {phase_errors}");
    }
    Ok(Report { verdict, data: Data::Clocks(json(&clocks, names, &signals, locked, phase_errors)) })
}

/// Gives the cycles a thread.
fn start_cycles(
    arguments: &ClocksArguments,
    mut application: Application<WireLinks, SupervisorThread>,
    end: &EndRequest,
) -> Result<CyclicThread<WireLinks>, Failure> {
    application.set_trigger(arguments.options.trigger(arguments.options.bus_shift));
    let (thread, asked) = (arguments.access.thread, end.clone());
    Ok(application.start_cycles(
        move || thread.prepare_cycles(),
        // Here too: this thread runs where others get no processor time.
        move |_| if asked.is_asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) },
    )?)
}

/// Reasons why the command has failed.
fn reasons(clocks: &[ClockStatus], locked: bool, settled: bool) -> Vec<String> {
    let mut reasons = Vec::new();
    if !locked {
        let count = clocks.iter().filter(|clock| clock.is_awaited()).count();
        reasons.push(format!("{count} of {} clocks not locked", clocks.len()));
    }
    let window = ClockConfig::default().sync_window_ns;
    if let Some(clock) = farthest(clocks).filter(|clock| clock.worst_ns > window) {
        let (position, worst) = (clock.position, clock.worst_ns);
        reasons
            .push(format!("the clock of position {position} was {worst} ns from the reference, {window} ns allowed"));
    }
    let unknown = clocks.iter().filter(|clock| clock.hidden.is_some_and(|hidden| !hidden.is_estimated)).count();
    if unknown > 0 {
        reasons.push(format!("the propagation delay of {unknown} of {} clocks is not known", clocks.len()));
    }
    if !settled {
        reasons.push("not all SubDevices are in OP".to_owned());
    }
    reasons
}

struct Watch<'a> {
    begin: Instant,
    log: RunLog,
    end: &'a EndRequest,
}

impl Watch<'_> {
    /// Prints events and records differences until a time or, with `ends_with_lock`, until all clocks are locked and
    /// all SubDevices, which may wait for that, are in their state. Whether clocks are locked.
    fn until(
        &mut self,
        cycles: &CyclicThread<WireLinks>,
        course: &mut Course,
        until: Instant,
        ends_with_lock: bool,
    ) -> Result<bool, Failure> {
        self.end.limit(until);
        loop {
            self.log.report(cycles, now(), |shown| match shown {
                Shown::Event { line, time, name, text } => {
                    say!("{line}");
                    write_event(time, name, &text);
                }
                Shown::Warning(words) => warn(words),
            });
            let supervisor = cycles.supervisor();
            let (locked, clocks) = (supervisor.clocks_locked()?, supervisor.clocks()?);
            course.note(now().since(self.begin), &clocks);
            if (locked && ends_with_lock && supervisor.all_settled()) || now() >= until || self.end.is_asked() {
                return Ok(locked);
            }
            sleep(LOOK);
        }
    }
}
