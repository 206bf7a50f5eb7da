//! The output of the demonstration.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{Application, Event, Instant, Scan, SubDeviceState, TimedEvent};

use super::incident::Incident;
use super::plan::Plan;
use super::watch::{Account, Watch};
use crate::json::demo::Check;
use crate::output::{draw, is_terminal, say, write, write_event};
use crate::run_log::name_of;
use crate::table;
use crate::verdict::Verdict;

/// Columns of the output.
const WIDTH: usize = 80;
/// Columns of time and mark before the text of an event.
const INDENT: usize = 16;

/// The lines of a text that is broken at blanks; a longer word has a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut().filter(|line| line.chars().count() + 1 + word.chars().count() <= width) {
            Some(line) => {
                line.push(' ');
                line.push_str(word);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Writes lines with the time before them.
#[derive(Debug, Default)]
pub struct Reporter {
    terminal: bool,
    /// A progress line is on the screen and has not been ended.
    line_open: bool,
    reached_op: Option<Instant>,
    checks: Vec<Check>,
}

impl Reporter {
    /// A reporter on the standard output.
    pub fn new() -> Reporter {
        Reporter { terminal: is_terminal(), line_open: false, reached_op: None, checks: Vec::new() }
    }

    /// A line without a time.
    pub fn say(&mut self, text: &str) {
        self.end_line();
        say!("{text}");
    }

    fn end_line(&mut self) {
        if self.line_open {
            say!();
            self.line_open = false;
        }
    }

    /// When all SubDevices were in OP.
    pub fn reached_op_at(&self) -> Option<Instant> {
        self.reached_op
    }

    /// A check and its result.
    pub fn check(&mut self, check: Check) {
        self.say(&format!("  {} {}", if check.held { "ok    " } else { "FAILED" }, check.text));
        self.checks.push(check);
    }

    /// The checks so far.
    #[cfg(feature = "standby")]
    pub fn checks(&self) -> &[Check] {
        &self.checks
    }

    /// What was checked in the end.
    pub fn into_checks(self) -> Vec<Check> {
        self.checks
    }

    /// A line with a time and a mark before the text.
    pub fn timed(&mut self, at: Instant, mark: &str, name: Option<String>, text: &str) {
        write_event(at.since(Instant(0)), name, text);
        self.end_line();
        let mut lines = wrapped(text, WIDTH - INDENT).into_iter();
        say!("{:>10.3} ms {mark} {}", at.0 as f64 / 1e6, lines.next().unwrap_or_default());
        lines.for_each(|line| say!("{:INDENT$}{line}", ""));
    }

    /// An event of the scan; progress stays on one line of a terminal.
    pub fn scan_event(&mut self, event: &TimedEvent) {
        let text = describe(event, &Names::default());
        if matches!(event.event, Event::ScanProgress { .. }) && self.terminal {
            draw(format_args!("\r"));
            write(format_args!("{:>10.3} ms   {text}", event.at.0 as f64 / 1e6));
            self.line_open = true;
        } else {
            self.timed(event.at, " ", Some(name_of(&event.event)), &text);
        }
    }

    /// Any other event.
    pub fn event(&mut self, event: &TimedEvent, names: &Names) {
        self.timed(event.at, " ", Some(name_of(&event.event)), &describe(event, names));
    }

    /// An event of one of two controllers.
    #[cfg(feature = "standby")]
    pub fn event_of(&mut self, controller: &str, event: &TimedEvent, names: &Names) {
        let text = format!("{controller}: {}", describe(event, names));
        self.timed(event.at, " ", Some(name_of(&event.event)), &text);
    }

    /// Something the demonstration does.
    pub fn incident(&mut self, at: Instant, text: &str) {
        self.timed(at, ">", None, text);
    }

    /// All SubDevices are in OP.
    pub fn reached_op(&mut self, at: Instant, cycle: Duration) {
        self.reached_op = Some(at);
        self.timed(at, ">", None, &format!("all SubDevices are in OP; cycle {} us", cycle.as_micros()));
    }

    /// The SubDevices that were found.
    pub fn table(&mut self, scan: &Scan) {
        self.say("");
        for line in table::lines(scan) {
            self.say(&line);
        }
        self.say("");
    }

    /// The state of every SubDevice.
    pub fn states(&mut self, application: &Application<SimulatedSegment>, names: &Names) {
        for (subdevice, state) in application.states().iter().enumerate() {
            let state = match state {
                SubDeviceState::Absent => "does not answer".to_owned(),
                SubDeviceState::Settled(state) => state.to_string(),
                _ => "is being configured".to_owned(),
            };
            let name = names.0.get(subdevice).map_or("", String::as_str);
            self.say(&format!("  SubDevice {subdevice} \"{name}\": {state}"));
        }
    }

    /// The closing summary, with the failed checks.
    pub fn summary(&mut self, application: &Application<SimulatedSegment>, watch: &Watch, plan: &Plan) -> Verdict {
        self.say("\nsummary");
        self.totals(application);
        if let Some(remark) = plan.remark {
            self.say(&format!("  {remark}"));
        }
        self.say("\n  cycles  incomplete  allowed  held back  without power  after");
        for account in &watch.accounts {
            self.say(&format!(
                "  {:>6}  {:>10}  {:>7}  {:>9}  {:>13}  {}",
                account.cycles,
                account.incomplete,
                account.incident.edges(plan.cables_of_device),
                account.held_back,
                account.without_one,
                account.incident.summarize()
            ));
        }
        self.say("");
        self.verdicts(application, watch, plan)
    }

    fn totals(&mut self, application: &Application<SimulatedSegment>) {
        let cyclic = application.cyclic_counters();
        let acyclic = application.acyclic_counters();
        if let Some(at) = self.reached_op {
            self.say(&format!("  power-on to OP of all SubDevices: {:.3} ms", at.0 as f64 / 1e6));
        }
        self.say(&format!(
            "  process data: {} frames, {} bytes on each link, {} lost, {} late",
            cyclic.sent, cyclic.bytes, cyclic.lost, cyclic.late
        ));
        self.say(&format!(
            "  everything else: {} frames, {} bytes on each link\n    {} datagrams, {} of them sent again",
            acyclic.sent, acyclic.bytes, acyclic.datagrams, acyclic.resent
        ));
        let stalled = application.links().stalled();
        if stalled > Duration::ZERO {
            self.say(&format!(
                "  this machine was at most {:.3} ms late; the simulator waited, so nothing was lost by that",
                stalled.as_secs_f64() * 1e3
            ));
        }
    }

    fn verdicts(&mut self, application: &Application<SimulatedSegment>, watch: &Watch, plan: &Plan) -> Verdict {
        let cycled = watch.accounts.iter().any(|account| matches!(account.incident, Incident::PowerOff { .. }));
        let within = |account: &Account| account.incomplete <= account.incident.edges(plan.cables_of_device);
        let mut failed = Vec::new();
        let mut verdict = |reporter: &mut Reporter, held: bool, text: String| {
            if !held {
                failed.push(text.clone());
            }
            reporter.check(Check { held, text });
        };
        let left: Vec<String> =
            watch.left_op.iter().map(|(subdevice, status)| format!("{subdevice} ({status})")).collect();
        let text = if left.is_empty() {
            "no SubDevice left OP except the one without power".to_owned()
        } else {
            format!("left OP: SubDevices {}", left.join(", "))
        };
        verdict(self, left.is_empty(), text);
        if cycled {
            let back = watch.without_power.is_none() && application.all_settled();
            verdict(self, back, "the SubDevice that lost its power is back in OP".to_owned());
        }
        let held = watch.accounts.iter().all(within);
        verdict(self, held, "at most one incomplete cycle per edge of a cable".to_owned());
        if watch.has_process_data() {
            let text = format!(
                "process data agrees with the devices: {} comparisons, {} failed",
                watch.compared, watch.disagreements
            );
            verdict(self, watch.compared > 0 && watch.disagreements == 0, text);
        } else {
            verdict(self, true, "no SubDevice has process data, so none was compared".to_owned());
        }
        for text in &watch.described {
            self.say(&format!("         {text}"));
        }
        for drive in &watch.drives {
            let text = format!(
                "drive {}: enabled for {} cycles, at {}, following error up to {}",
                drive.subdevice, drive.enabled_cycles, drive.position, drive.lag
            );
            verdict(self, drive.follows(), text);
        }
        Verdict::of(failed, "everything held")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: demo
    #[test]
    fn a_long_text_is_broken_at_blanks() {
        assert_eq!(wrapped("ring closed, 19 SubDevices", 12), ["ring closed,", "19", "SubDevices"]);
        assert_eq!(wrapped("a", 12), ["a"]);
        assert_eq!(wrapped("aaaaaaaaaaaaaaaa b", 12), ["aaaaaaaaaaaaaaaa", "b"]);
    }
}
