//! The report at the end of the demonstration with two controllers: a table with the effects on each SubDevice, the
//! checks, and the keys of JSON.

use std::time::Duration;

use ringcat::sim::cable::Host;
use ringcat::text::Names;
use ringcat::{Instant, MainDeviceRole};

use super::super::report::Reporter;
use super::controller::Shared;
use super::measurement::{Measurement, Watched};
use super::steps::{STEPS, Step, Times, name};
use crate::json::demo::Check;
use crate::json::demo_standby::{DemoStandby, Noticed, StandbyIncident};
use crate::verdict::Verdict;

/// Up to this number of SubDevices each has a line.
const LISTED: usize = 64;
/// Columns of a name.
const NAME: usize = 12;
/// Cycles in which both controllers may send: one yields.
const MOST_TOGETHER: u32 = 2;

/// An incident that has happened.
#[derive(Debug)]
pub struct Incident {
    /// Its number, from 1.
    pub number: usize,
    /// What it is.
    pub step: Step,
    /// When it began.
    pub at: Instant,
    /// Text for people.
    pub text: String,
    /// Difference from the expected state at its end.
    pub failure: Option<String>,
}

/// Results of the demonstration.
#[derive(Debug)]
pub struct Outcome<'a> {
    /// Effects on the SubDevices; `None` if not all reached OP.
    pub measurement: Option<&'a Measurement>,
    /// The incidents.
    pub incidents: &'a [Incident],
    /// Times on which limits depend.
    pub times: Times,
    /// Names of the SubDevices.
    pub names: &'a Names,
    /// States and images of the controllers.
    pub shared: &'a Shared,
    /// Largest delay of virtual time behind the wall clock, if it waited for that.
    pub late: Option<Duration>,
}

impl Outcome<'_> {
    /// Prints the table and what was checked.
    pub fn summary(&self, reporter: &mut Reporter) -> Verdict {
        let Some(measurement) = self.measurement else { return Verdict::Failed("nothing was measured".to_owned()) };
        self.table(measurement, reporter);
        let checks = self.checks(measurement);
        let failed = checks.iter().filter(|check| !check.held).map(|check| check.text.clone()).collect();
        reporter.say("");
        checks.into_iter().for_each(|check| reporter.check(check));
        for text in &measurement.described {
            reporter.say(&format!("         {text}"));
        }
        Verdict::of(failed, "everything held")
    }

    fn table(&self, measurement: &Measurement, reporter: &mut Reporter) {
        let limits = self.limits();
        reporter.say("\nlongest time between outputs in each SubDevice, in ms; without outputs: between");
        reporter.say("inputs. AL: changes of its state. WD: watchdogs that expired.\n");
        let cells = |cells: &[String]| cells.iter().map(|cell| format!("{cell:>7}")).collect::<String>();
        let numbers: Vec<String> = (1..=STEPS.len()).map(|number| number.to_string()).collect();
        let words: Vec<String> = STEPS.iter().map(|step| step.word().to_owned()).collect();
        reporter.say(&format!("{:16}{}", "", cells(&numbers)));
        reporter.say(&format!("{:<16}{}  AL  WD", "SubDevice", cells(&words)));
        let line = |head: &str, longest: &[Duration], changes: u32, watchdogs: u32| {
            let times: Vec<String> = (0..STEPS.len()).map(|at| longest.get(at).map_or("-".to_owned(), ms)).collect();
            format!("{head:<16}{}{changes:>4}{watchdogs:>4}", cells(&times))
        };
        if measurement.watched.len() <= LISTED {
            for (position, it) in measurement.watched.iter().enumerate() {
                let name: String = self.names.0.get(position).map_or("", String::as_str).chars().take(NAME).collect();
                reporter.say(&line(&format!("{position:>3} {name}"), &it.longest, it.state_changes, it.watchdogs));
            }
        } else {
            let longest: Vec<Duration> = (0..STEPS.len()).map(|at| measurement.longest(at)).collect();
            let sum = |of: fn(&Watched) -> u32| measurement.watched.iter().map(of).sum();
            let head = format!("all {}", measurement.watched.len());
            reporter.say(&line(&head, &longest, sum(|it| it.state_changes), sum(|it| it.watchdogs)));
        }
        let limits: Vec<String> = limits.iter().map(ms).collect();
        reporter.say(&format!("{:<16}{}   0   0", "at most", cells(&limits)));
        if let Some(late) = self.late {
            let late = late.as_secs_f64() * 1e3;
            reporter.say(&format!("\nthis machine was at most {late:.3} ms late; virtual time waited"));
        }
    }

    fn limits(&self) -> Vec<Duration> {
        STEPS.iter().map(|step| step.limit(&self.times)).collect()
    }

    fn checks(&self, measurement: &Measurement) -> Vec<Check> {
        let mut checks = of_subdevices(measurement);
        checks.extend(self.of_times(measurement));
        checks.extend(self.of_controllers(measurement));
        checks
    }

    /// Times between outputs.
    fn of_times(&self, measurement: &Measurement) -> Vec<Check> {
        let limits = self.limits();
        let longest: Vec<Duration> = (0..STEPS.len()).map(|at| measurement.longest(at)).collect();
        let beyond = (0..STEPS.len()).filter(|at| longest[*at] > limits[*at]);
        let mut checks: Vec<Check> = beyond
            .map(|at| {
                let (longest, limit) = (ms(&longest[at]), ms(&limits[at]));
                let which = format!("{} ({})", at + 1, STEPS[at].word());
                Check { held: false, text: format!("{which}: {longest} ms between outputs, at most {limit}") }
            })
            .collect();
        if checks.is_empty() {
            let text = "the time between outputs was within its limit in each incident".to_owned();
            checks.push(Check { held: true, text });
        }
        let switched = STEPS.iter().position(|step| *step == Step::HandOver).map_or(Duration::ZERO, |at| longest[at]);
        checks.push(Check {
            held: switched < 2 * self.times.cycle,
            text: format!("the switchover cost no cycle: {} ms between outputs", ms(&switched)),
        });
        checks
    }

    /// Roles and images of both controllers.
    fn of_controllers(&self, measurement: &Measurement) -> Vec<Check> {
        let (together, images) = (measurement.together, self.shared.images());
        let (compared, different) = (images.compared, images.different);
        let mut checks = vec![
            Check {
                held: together <= self.times.cycle * MOST_TOGETHER,
                text: format!("both controllers sent together for {} ms at most", ms(&together)),
            },
            Check {
                held: compared > 0 && different == 0,
                text: format!("the image of the INACTIVE is the ACTIVE's: {compared} compared, {different} differ"),
            },
        ];
        let unexpected = self.incidents.iter().filter_map(|incident| Some((incident, incident.failure.as_ref()?)));
        let text = |(incident, why): (&Incident, &String)| {
            format!("after {} ({}): {why}", incident.number, incident.step.word())
        };
        let unexpected: Vec<String> = unexpected.map(text).collect();
        if unexpected.is_empty() {
            let text = "after each incident the expected controller was ACTIVE".to_owned();
            checks.push(Check { held: true, text });
        }
        checks.extend(unexpected.into_iter().map(|text| Check { held: false, text }));
        checks
    }

    /// The keys of JSON.
    pub fn data(&self, checks: &[Check]) -> DemoStandby {
        let measurement = self.measurement;
        let incidents = self.incidents.iter().enumerate().map(|(at, incident)| StandbyIncident {
            time_ns: incident.at.since(Instant(0)).as_nanos() as u64,
            text: incident.text.clone(),
            longest_ns: measurement.map_or(0, |measurement| nanoseconds(measurement.longest(at))),
            limit_ns: nanoseconds(incident.step.limit(&self.times)),
        });
        let noticed =
            measurement.iter().flat_map(|measurement| &measurement.watched).enumerate().map(|(subdevice, it)| {
                Noticed {
                    subdevice,
                    name: self.names.0.get(subdevice).cloned().unwrap_or_default(),
                    longest_ns: it.longest.iter().copied().map(nanoseconds).collect(),
                    state_changes: it.state_changes,
                    expired_watchdogs: it.watchdogs,
                }
            });
        let is_active = |host| self.shared.board(host).role == Some(MainDeviceRole::Active);
        DemoStandby {
            cycle_ns: nanoseconds(self.times.cycle),
            time_out_cycles: self.times.time_out_cycles,
            active: Host::ALL.into_iter().find(|host| is_active(*host)).map(name),
            incidents: incidents.collect(),
            subdevices: noticed.collect(),
            checks: checks.to_vec(),
        }
    }
}

/// Checks of the values measured inside the SubDevices.
fn of_subdevices(measurement: &Measurement) -> Vec<Check> {
    let sum = |of: fn(&Watched) -> u32| -> u32 { measurement.watched.iter().map(of).sum() };
    let (changes, watchdogs) = (sum(|it| it.state_changes), sum(|it| it.watchdogs));
    let text = match (changes, watchdogs) {
        (0, 0) => "no SubDevice left OP, no watchdog expired".to_owned(),
        _ => format!("changes of states: {changes}, expired watchdogs: {watchdogs}"),
    };
    let mut checks = vec![Check { held: changes == 0 && watchdogs == 0, text }];
    let drives: Vec<&Watched> = measurement.watched.iter().filter(|it| it.is_drive()).collect();
    if !drives.is_empty() {
        let still: usize = drives.iter().map(|drive| drive.still()).sum();
        let are_enabled = measurement.disabled == 0 && drives.iter().all(|drive| drive.was_enabled);
        let held = are_enabled && still == 0;
        let text = match (are_enabled, still) {
            (true, 0) => "the drives stayed enabled and got new targets in each incident".to_owned(),
            (true, _) => format!("drives got no new target in {still} incidents"),
            (false, _) => format!("drives were not enabled, in {} cycles in all", measurement.disabled),
        };
        checks.push(Check { held, text });
    }
    let (checked, outdated) = (measurement.checked, measurement.outdated);
    if measurement.watched.iter().any(Watched::has_outputs) {
        let text = format!("no output went back: {checked} checked, {outdated} older than allowed");
        checks.push(Check { held: checked > 0 && outdated == 0, text });
    } else {
        checks.push(Check { held: true, text: "no SubDevice has outputs, so none was checked".to_owned() });
    }
    checks
}

/// Milliseconds in at most six characters.
fn ms(time: &Duration) -> String {
    let ms = time.as_secs_f64() * 1e3;
    if ms < 100.0 { format!("{ms:.3}") } else { format!("{ms:.1}") }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
