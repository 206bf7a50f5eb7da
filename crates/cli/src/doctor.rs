//! `ringcat doctor`: settings of this machine that disturb a MainDevice, why, and the command that corrects each.
//!
//! It checks and measures; it changes nothing. Every check gives a [`Finding`]: bad, minor, unknown or good. A check
//! that is not possible is unknown, never a guess. docs/doctor.md explains each.

mod finding;
mod foreign;
mod inspect;
mod interface;
mod kernel;
mod latency;
mod limits;
mod picture;
mod processor_list;
mod processors;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::LinkNames;
use crate::json::data::Data;
use crate::json::doctor::Doctor;
use crate::numbers::number;
use crate::output::{counted, say};
use crate::svg::Picture;
use crate::verdict::{Report, Verdict};
use finding::{Finding, Level};
use inspect::{Inspect, Machine};
use latency::Latency;

/// Options of `ringcat doctor`.
#[derive(Args, Debug)]
pub struct DoctorArguments {
    /// Network interface of the main link, to check it too
    #[arg(long, value_name = "IF", help_heading = "Links")]
    main: Option<String>,
    /// Network interface at the other end of a ring, to check it too
    #[arg(long, value_name = "IF", requires = "main", help_heading = "Links")]
    redundant: Option<String>,
    /// Measure for so long how late a thread wakes up; 0 leaves it out
    ///
    /// A thread sleeps from one cycle of 1 ms to the next, with the settings of a cycle: real-time priority, locked
    /// memory, processors that stay awake. Put the load of operation on the machine meanwhile.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value = "10",
        help_heading = "Latency",
        value_parser = number(0..=86_400u32, 10)
    )]
    latency: u32,
    /// Real-time priority (SCHED_FIFO) of this thread
    #[arg(long, value_name = "1-98", default_value = "80", value_parser = number(1..=98, 80), help_heading = "Latency")]
    priority: i32,
    /// Processor that this thread is bound to
    #[arg(long, value_name = "NUMBER", value_parser = number(0..=8_191usize, 3), help_heading = "Latency")]
    cpu: Option<usize>,
    /// Draw how late the wake-ups came into this file
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    svg: Option<PathBuf>,
    /// Print the good findings one by one too
    #[arg(long, help_heading = "Output")]
    all: bool,
}

impl DoctorArguments {
    fn check(&self) -> Result<(), Failure> {
        if let Some(main) = self.main.clone() {
            LinkNames { main, redundant: self.redundant.clone() }.check()?;
        }
        if self.svg.is_some() && self.latency == 0 {
            return Err(Failure::new("--svg draws what --latency measures: expected at least 1 second"));
        }
        Ok(())
    }

    fn names(&self) -> Vec<&str> {
        self.main.iter().chain(&self.redundant).map(String::as_str).collect()
    }
}

/// Checks and measures. The verdict is good if no finding is bad.
pub fn run(arguments: &DoctorArguments) -> Result<Report, Failure> {
    arguments.check()?;
    let lasts = Duration::from_secs(u64::from(arguments.latency));
    let end = EndRequest::watch(Some(arguments.priority))?;
    let mut findings = check_all(&Machine, &arguments.names())?;
    // An unwritable file shows before the measurement.
    let picture = arguments.svg.as_ref().map(|path| Picture::create(path)).transpose()?;
    let latency = match arguments.latency {
        0 => None,
        seconds => {
            say!("measuring how late a thread wakes up: {}", counted(seconds as usize, "second", "seconds"));
            Some(latency::measure(lasts, arguments.priority, arguments.cpu, &end)?)
        }
    };
    let mut reasons: Vec<String> = end.by().map(|by| format!("ended by {by} before its time")).into_iter().collect();
    if let Some(latency) = &latency {
        findings.push(latency.finding());
        reasons.extend(show(latency, picture));
        say!();
    }
    findings.sort_by_key(|finding| finding.level);
    finding::lines(&findings, arguments.all).iter().for_each(|line| say!("{line}"));
    Ok(Report { verdict: verdict(&findings, reasons), data: Data::Doctor(json(&findings, latency.as_ref())) })
}

/// All checks of a machine and the interfaces of a segment.
fn check_all(machine: &dyn Inspect, names: &[&str]) -> Result<Vec<Finding>, Failure> {
    let mut findings = Vec::new();
    for name in names {
        let Some(interface) = machine.interface(name) else {
            return Err(ringcat_link::interface::missing(name).into());
        };
        findings.extend(interface::checks(machine, &interface));
    }
    findings.extend(kernel::checks(machine));
    findings.extend(processors::checks(machine, names));
    findings.extend(limits::checks(machine));
    findings.extend(foreign::checks(machine));
    Ok(findings)
}

/// Prints a measurement, and draws it. Why that was not possible.
fn show(latency: &Latency, picture: Option<Picture>) -> Option<String> {
    latency.lines().iter().for_each(|line| say!("{line}"));
    say!("late: {}", latency.delays);
    if latency.skipped > 0 {
        say!(
            "{} were left out because the one before came later",
            counted(latency.skipped as usize, "wake-up", "wake-ups")
        );
    }
    let mut picture = picture?;
    match picture.draw(&picture::draw(latency)) {
        Ok(()) => {
            say!("picture: {picture}");
            None
        }
        Err(reason) => Some(reason),
    }
}

fn count(findings: &[Finding], level: Level) -> usize {
    findings.iter().filter(|finding| finding.level == level).count()
}

fn verdict(findings: &[Finding], mut reasons: Vec<String>) -> Verdict {
    let counts = finding::counted(findings);
    if count(findings, Level::Bad) > 0 {
        reasons.insert(0, counts.clone());
    }
    Verdict::of(reasons, format!("nothing is bad: {counts}"))
}

fn json(findings: &[Finding], latency: Option<&Latency>) -> Doctor {
    Doctor {
        bad: count(findings, Level::Bad),
        minor: count(findings, Level::Minor),
        unknown: count(findings, Level::Unknown),
        good: count(findings, Level::Good),
        findings: findings.iter().map(Finding::json).collect(),
        latency: latency.map(Latency::json),
    }
}
