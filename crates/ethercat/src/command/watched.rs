//! What `watch` shows of a master, in lines of at most 80 columns.

use ringcat_control::message::{MasterState, Snapshot};
use ringcat_control::tool::{CycleReport, DomainLine, LinkReport, MasterReport, TrafficRate};

use super::ring::{LINKS, cable, state_of};
use crate::append::append;
use crate::selection::Slave;

/// Longest text that says what drives a master.
const LONGEST: usize = 60;
/// Columns of a difference of clocks.
const CLOCK: usize = 10;

/// All that is shown of a master.
pub struct Watched {
    /// The master as a whole.
    pub report: Box<MasterReport>,
    /// Its state.
    pub state: Box<Snapshot>,
    /// SubDevices that answer on each link.
    pub counts: [u16; 2],
    /// Domains of the application.
    pub domains: Vec<DomainLine>,
    /// Selected SubDevices.
    pub slaves: Vec<Slave>,
}

/// The lines of a master; `last` are its cycles at the previous request.
pub fn lines(master: &MasterState, watched: &Watched, last: Option<CycleReport>) -> Vec<String> {
    let Watched { report, state, counts, domains, slaves } = watched;
    let ring = format!("  ring        {}\n", state_of(&state.ring, report.links.len()));
    let mut all = vec![title(master, report), ring];
    if !report.links.is_empty() {
        all.push(links(state, *counts, report.links.len()));
        all.push(frames(&report.links));
    }
    all.extend(state.ring.break_at.iter().map(|place| format!("  line break  {}\n", cable(place))));
    all.extend(report.cycles.map(|now| cycles(now, last)));
    all.extend((0..).zip(domains).map(|(number, domain)| working_counter(number, domain)));
    all.extend(clocks(state));
    all.extend(table(slaves, state));
    all
}

fn title(master: &MasterState, report: &MasterReport) -> String {
    let phase = match (report.is_orphaned, report.is_active, report.is_scanning) {
        (true, ..) => "waiting for its interface",
        (_, true, _) => "operation",
        (.., true) => "scanning",
        _ => "idle",
    };
    let owner = master.owner.as_ref().map(|owner| format!(", {owner}")).unwrap_or_default();
    let shown: String = format!("{phase}{owner}").chars().take(LONGEST).collect();
    format!("Master{}  {shown}\n", master.master)
}

fn links(state: &Snapshot, counts: [u16; 2], links: usize) -> String {
    let mut text = String::new();
    for ((name, link), count) in LINKS.iter().zip(&state.ring.links).zip(counts).take(links) {
        text += if text.is_empty() { "  links       " } else { ", " };
        let carrier = if link.carrier == Some(false) { " (no carrier)" } else { "" };
        append!(text, "{name} {count} slaves{carrier}");
    }
    text + "\n"
}

fn frames(links: &[LinkReport]) -> String {
    let sum = |value: fn(&TrafficRate) -> f64| -> f64 {
        links.iter().map(|link| value(&link.traffic.rates[0])).sum::<f64>().max(0.0)
    };
    let (sent, lost) = (sum(|rate| rate.frames_per_s), sum(|rate| rate.lost_per_s));
    let all: u64 = links.iter().map(|link| link.traffic.lost).sum();
    format!("  frames      {sent:.0}/s, {lost:.0}/s lost, {all} lost in all\n")
}

/// The mean cycle time since the previous request, or only the number of cycles.
fn cycles(now: CycleReport, last: Option<CycleReport>) -> String {
    let [late, skipped, incomplete] = now.late_skipped_incomplete;
    let mean = last.and_then(|last| {
        let (count, time) = (now.number.checked_sub(last.number)?, now.at_ns.checked_sub(last.at_ns)?);
        (count > 0).then(|| format!("{:.3} ms", time as f64 / count as f64 / 1e6))
    });
    let mean = mean.unwrap_or_else(|| format!("{} done", now.number));
    let delay = now.longest_delay_ns as f64 / 1e6;
    let late = match now.longest_delay_ns {
        0 => String::new(),
        _ => format!(", {late} late by at most {delay:.3} ms, {skipped} left out"),
    };
    format!("  cycles      {mean}{late}, {incomplete} incomplete\n")
}

fn working_counter(number: u32, domain: &DomainLine) -> String {
    let DomainLine { wkc, expected, by_link, .. } = domain;
    let by_link = by_link.map(|[main, backup]| format!(" ({main}+{backup})")).unwrap_or_default();
    let wrong = if wkc == expected { "" } else { "  INCOMPLETE" };
    format!("  Domain{number:<6}working counter {wkc}/{expected}{by_link}{wrong}\n")
}

fn clocks(state: &Snapshot) -> Option<String> {
    let reference = state.clocks.iter().find(|clock| clock.is_reference)?;
    let followers = || state.clocks.iter().filter(|clock| !clock.is_reference);
    let (all, locked) = (followers().count(), followers().filter(|clock| clock.is_locked).count());
    let largest = followers().filter_map(|clock| clock.difference_ns.map(|it| it.unsigned_abs())).max();
    let largest = largest.map(|it| format!(", differences up to {it} ns")).unwrap_or_default();
    Some(format!("  clocks      {locked} of {all} follow slave {}{largest}\n", reference.position))
}

/// A line for each SubDevice, with the difference of its clock where one is known.
fn table(slaves: &[Slave], state: &Snapshot) -> Vec<String> {
    let difference = |slave: &Slave| {
        let clock = state.clocks.iter().find(|clock| clock.position == slave.line.position)?;
        if clock.is_reference { Some("reference".to_owned()) } else { clock.difference_ns.map(|it| format!("{it} ns")) }
    };
    let row =
        |slave: &Slave| [slave.line.position.to_string(), format!("{}:{}", slave.alias, slave.relative), slave.state()];
    let rows: Vec<[String; 3]> = slaves.iter().map(row).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].len()).max().unwrap_or(0);
    let [a, b, c] = [0, 1, 2].map(width);
    let clock = if state.clocks.is_empty() { 0 } else { CLOCK };
    let line = |(slave, [position, alias, state]): (&Slave, &[String; 3])| {
        let mut text = format!("  {position:>a$}  {alias:>b$}  {state:<c$}  {}", slave.flag());
        if clock > 0 {
            append!(text, "  {:>clock$}", difference(slave).unwrap_or_default());
        }
        append!(text, "  {}\n", slave.name());
        text
    };
    slaves.iter().zip(&rows).map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(number: u64, at_ns: u64, delay: u64) -> CycleReport {
        CycleReport { number, at_ns, late_skipped_incomplete: [3, 2, 1], longest_delay_ns: delay }
    }

    // covers: daemon
    #[test]
    fn a_cycle_time_is_the_mean_since_the_previous_request() {
        let last = report(1_000, 5_000_000, 0);
        let now = cycles(report(1_500, 505_500_000, 12_000), Some(last));
        assert_eq!(now, "  cycles      1.001 ms, 3 late by at most 0.012 ms, 2 left out, 1 incomplete\n");
        // The first request; another application since, whose cycles begin at 0.
        assert_eq!(cycles(last, None), "  cycles      1000 done, 1 incomplete\n");
        assert_eq!(cycles(report(7, 1, 0), Some(last)), "  cycles      7 done, 1 incomplete\n");
        assert_eq!(cycles(last, Some(last)), "  cycles      1000 done, 1 incomplete\n");
    }

    // covers: daemon
    #[test]
    fn wrong_working_counters_are_marked() {
        let domain = DomainLine { wkc: 2, expected: 3, by_link: Some([2, 0]), ..DomainLine::default() };
        assert_eq!(working_counter(0, &domain), "  Domain0     working counter 2/3 (2+0)  INCOMPLETE\n");
        let domain = DomainLine { wkc: 3, by_link: None, ..domain };
        assert_eq!(working_counter(12, &domain), "  Domain12    working counter 3/3\n");
    }
}
