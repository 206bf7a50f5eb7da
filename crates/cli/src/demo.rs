//! `ringcat demo`: a simulated segment goes from power-on to OP and exchanges process data at 1 kHz. A cable is cut and
//! repaired, a SubDevice loses its power and gets it back. The program compares all of it with the simulated devices.

mod drive;
mod incident;
mod plan;
mod report;
#[cfg(feature = "standby")]
mod two;
mod watch;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use ringcat::sim::network::Network;
use ringcat::sim::segment::{DEMO, Segment};
use ringcat::simulated::SimulatedSegment;
use ringcat::text::Names;
use ringcat::{Application, Error, Event, MainDevice, Options, Scan, automatic};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::demo;
use crate::json::scan::SubDevice;
use crate::json::values::State;
use crate::numbers::number;
use crate::table;
use crate::verdict::{Report, Verdict};
use incident::Incident;
use plan::Plan;
use report::Reporter;
use watch::Watch;

/// Above this number of SubDevices a frame takes longer than a millisecond to come back.
const SLOW_ABOVE: usize = 200;
/// Cycle of such a segment.
const SLOW_CYCLE: Duration = Duration::from_millis(4);
/// Cycle of any other.
const CYCLE: Duration = Duration::from_millis(1);
/// Up to this number of SubDevices, each one's way to OP is printed.
const LISTED: usize = 64;
/// From activation to OP of the last SubDevice at the most.
const OP_LIMIT: Duration = Duration::from_secs(30);

/// Options of `ringcat demo`.
#[derive(Args, Debug, Default)]
pub struct DemoArguments {
    /// Segment file (see docs/segments.md); an embedded ring by default
    #[arg(long, value_name = "FILE.toml", help_heading = "Segment")]
    segment: Option<PathBuf>,
    /// Cycle time in microseconds; 1000 by default, 4000 above 200 SubDevices
    #[arg(
        long,
        value_name = "US",
        help_heading = "Cycle",
        value_parser = number(50u64..=1_000_000, 1_000)
    )]
    cycle_us: Option<u64>,
    /// Run in virtual time, as fast as the machine can
    #[arg(long, help_heading = "Cycle")]
    fast: bool,
    /// Show two controllers at the ring, one of which is killed
    ///
    /// Both run with the library, and either takes over from the other: when it is killed, loses its power, or hands
    /// its role over while a cable is cut. See docs/standby.md, which begins with a note on patents.
    #[cfg(feature = "standby")]
    #[arg(long, help_heading = "Two controllers")]
    pub standby: bool,
    /// Cycles without the ACTIVE after which the other one takes over, 3
    ///
    /// Where the watchdogs of the SubDevices expire before that, they leave OP and the demonstration fails.
    #[cfg(feature = "standby")]
    #[arg(
        long,
        value_name = "CYCLES",
        requires = "standby",
        value_parser = number(3_u32..=1000, 10),
        help_heading = "Two controllers"
    )]
    timeout: Option<u32>,
}

/// Runs the demonstration.
pub fn run(arguments: &DemoArguments) -> Result<Report, Failure> {
    EndRequest::at_once()?;
    #[cfg(feature = "standby")]
    if arguments.standby {
        return two::run(arguments);
    }
    Ok(show(arguments)?)
}

fn show(arguments: &DemoArguments) -> Result<Report, Error> {
    let segment = load(arguments)?;
    let title = segment_title(arguments);
    let mut links = SimulatedSegment::new(Network::from_description(segment)?);
    if !arguments.fast {
        links.pace();
    }
    let mut reporter = Reporter::new();
    reporter.say(&format!("RingCAT demo on {title}, {}", pace(arguments)));
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan_with(|event| reporter.scan_event(event))?;
    let names = Names(scan.subdevices.iter().map(|info| info.name.clone()).collect());
    reporter.table(&scan);
    let cycle = cycle(arguments, &scan);
    let application = main_device.activate(automatic(&scan.subdevices, cycle))?;
    Ok(Demo::new(application, scan, names, cycle, reporter).run())
}

fn load(arguments: &DemoArguments) -> Result<Segment, Error> {
    Ok(match &arguments.segment {
        Some(path) => ringcat::esi::load_segment(path)?,
        None => Segment::from_toml(DEMO, Path::new("."))?,
    })
}

fn segment_title(arguments: &DemoArguments) -> String {
    arguments.segment.as_ref().map_or_else(|| "its embedded ring".to_owned(), |path| path.display().to_string())
}

fn pace(arguments: &DemoArguments) -> &'static str {
    if arguments.fast { "in virtual time" } else { "in real time" }
}

fn cycle(arguments: &DemoArguments, scan: &Scan) -> Duration {
    match arguments.cycle_us {
        Some(us) => Duration::from_micros(us),
        None if scan.subdevices.len() > SLOW_ABOVE => SLOW_CYCLE,
        None => CYCLE,
    }
}

struct Demo {
    application: Application<SimulatedSegment>,
    names: Names,
    cycle: Duration,
    plan: Plan,
    watch: Watch,
    reporter: Reporter,
    /// The SubDevices as keys of JSON.
    found: Vec<SubDevice>,
}

impl Demo {
    fn new(
        application: Application<SimulatedSegment>,
        scan: Scan,
        names: Names,
        cycle: Duration,
        reporter: Reporter,
    ) -> Demo {
        let watch = Watch::new(&application, scan.subdevices.len());
        let plan = Plan::new(&scan, &watch, application.links().network());
        let found = table::json_subdevices(&scan);
        Demo { application, names, cycle, plan, watch, reporter, found }
    }

    fn run(mut self) -> Report {
        if !self.reach_op() {
            let verdict = Verdict::Failed(format!("not all SubDevices reached OP within {} s", OP_LIMIT.as_secs()));
            return self.report(verdict);
        }
        let steps = self.plan.steps.clone();
        for step in &steps {
            if step.incident != Incident::Calm {
                self.reporter.incident(self.application.now(), &step.incident.describe(&self.names));
            }
            self.watch.begin(step.incident.clone());
            self.plan.bring_about(&step.incident, self.application.links_mut().network_mut());
            let until = self.application.now() + step.lasts;
            while self.application.now() < until {
                self.one_cycle();
            }
        }
        let verdict = self.reporter.summary(&self.application, &self.watch, &self.plan);
        self.report(verdict)
    }

    /// The verdict with the keys of JSON.
    fn report(self, verdict: Verdict) -> Report {
        let Demo { application, names, cycle, plan, watch, reporter, found } = self;
        let incidents = watch.accounts.iter().map(|account| demo::Incident {
            text: account.incident.describe(&names),
            cycles: account.cycles,
            incomplete_cycles: account.incomplete,
            allowed_cycles: account.incident.edges(plan.cables_of_device),
            held_back_cycles: account.held_back,
            lacking_one_cycles: account.without_one,
        });
        let data = demo::Demo {
            cycle_ns: cycle.as_nanos() as u64,
            subdevices: found,
            states: State::of_all(&application.states(), &names.0),
            op_after_ns: reporter.reached_op_at().map(|at| at.0),
            incidents: incidents.collect(),
            checks: reporter.into_checks(),
        };
        Report { verdict, data: Data::Demo(data) }
    }

    /// Cycles until all SubDevices are in OP. False where that takes too long.
    fn reach_op(&mut self) -> bool {
        let until = self.application.now() + OP_LIMIT;
        while !self.application.all_settled() {
            if self.application.now() >= until {
                self.reporter.say(&format!("not all SubDevices reached OP within {} s:", OP_LIMIT.as_secs()));
                self.reporter.states(&self.application, &self.names);
                return false;
            }
            self.one_cycle();
        }
        // A few more cycles, so that the outputs of the last SubDevice have arrived.
        for _ in 0..3 {
            self.one_cycle();
        }
        self.reporter.reached_op(self.application.now(), self.cycle);
        true
    }

    fn one_cycle(&mut self) {
        self.watch.cycle(&mut self.application);
        while let Some(event) = self.application.pop_event() {
            // A thousand SubDevices reaching OP are counted, not listed.
            let listed = self.names.0.len() <= LISTED || !matches!(event.event, Event::StateReached { .. });
            if listed || !self.watch.accounts.is_empty() {
                self.reporter.event(&event, &self.names);
            }
        }
    }
}
