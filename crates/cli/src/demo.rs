//! `ringcat demo`: a simulated segment goes from power-on to OP and exchanges process data at 1 kHz. A cable is cut and
//! repaired, a SubDevice loses its power and gets it back. The program compares all of it with the simulated devices.

mod arguments;
mod drive;
mod incident;
mod plan;
mod report;
#[cfg(feature = "standby")]
mod two;
mod watch;

use std::time::Duration;

use ringcat::sim::network::Network;
use ringcat::simulated::SimulatedSegment;
use ringcat::text::Names;
use ringcat::{Application, Error, Event, MainDevice, Options, Scan, automatic};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::demo;
use crate::json::scan::SubDevice;
use crate::json::values::State;
use crate::table;
use crate::verdict::{Report, Verdict};
pub use arguments::DemoArguments;
use incident::Incident;
use plan::Plan;
use report::Reporter;
use watch::Watch;

/// Up to this number of SubDevices, each one's way to OP is printed.
const LISTED: usize = 64;
/// From activation to OP of the last SubDevice at the most.
const OP_LIMIT: Duration = Duration::from_secs(30);

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
    let segment = arguments.load()?;
    let title = arguments.segment_title();
    let mut links = SimulatedSegment::new(Network::from_description(segment)?);
    if !arguments.fast {
        links.pace();
    }
    let mut reporter = Reporter::new();
    reporter.say(&format!("RingCAT demo on {title}, {}", arguments.pace()));
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan_with(|event| reporter.scan_event(event))?;
    let names = Names(scan.subdevices.iter().map(|info| info.name.clone()).collect());
    reporter.table(&scan);
    let cycle = arguments.cycle(scan.subdevices.len());
    let application = main_device.activate(automatic(&scan.subdevices, cycle))?;
    Ok(Demo::new(application, scan, names, cycle, reporter).run())
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
