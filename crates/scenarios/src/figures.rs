//! Figures with their bars: a readable table, and a verdict for CI.

use std::fmt::Display;
use std::process::ExitCode;

/// Blocks of one program that differ by more than this show a machine that is too noisy for times (decision 0048).
pub const NOISY: f64 = 1.5;

/// A table under a heading.
#[derive(Debug)]
pub struct Figures {
    rows: Vec<[String; 4]>,
    missed: bool,
}

impl Figures {
    /// A table without rows; the heading is printed at once.
    pub fn new(heading: &str) -> Figures {
        println!("\n== {heading}");
        Figures { rows: Vec::new(), missed: false }
    }

    /// A figure without a bar.
    pub fn show(&mut self, name: &str, value: impl Display) {
        self.row(name, value.to_string(), String::new(), "");
    }

    /// A figure that must not exceed its bar.
    pub fn at_most(&mut self, name: &str, value: f64, bar: f64, unit: &str) {
        let met = value <= bar;
        self.missed |= !met;
        let verdict = if met { "ok" } else { "MISSED" };
        self.row(name, format!("{} {unit}", short(value)), format!("<= {} {unit}", short(bar)), verdict);
    }

    /// A figure with a bar that it must not exceed, and a goal below that is known not to be reached yet.
    pub fn at_most_towards(&mut self, name: &str, value: f64, bar: f64, goal: f64, unit: &str) {
        let met = value <= bar;
        self.missed |= !met;
        let verdict = match met {
            false => "MISSED".to_owned(),
            true if value <= goal => "ok".to_owned(),
            true => format!("ok; the goal of {} is not reached yet", short(goal)),
        };
        self.row(name, format!("{} {unit}", short(value)), format!("<= {} {unit}", short(bar)), &verdict);
    }

    /// A figure that must reach its bar.
    pub fn at_least(&mut self, name: &str, value: f64, bar: f64, unit: &str) {
        let met = value >= bar;
        self.missed |= !met;
        let verdict = if met { "ok" } else { "MISSED" };
        self.row(name, format!("{} {unit}", short(value)), format!(">= {} {unit}", short(bar)), verdict);
    }

    /// A figure with a bar that is known not to be reached yet: it is shown and is not a failure.
    pub fn goal_at_least(&mut self, name: &str, value: f64, bar: f64, unit: &str) {
        let verdict = if value >= bar { "ok" } else { "not reached yet" };
        self.row(name, format!("{} {unit}", short(value)), format!(">= {} {unit}", short(bar)), verdict);
    }

    /// A ratio of wall-clock times, one value per block of alternating programs. It misses its bar only where all
    /// blocks agree on that.
    pub fn at_most_in_blocks(&mut self, name: &str, blocks: &[f64], bar: f64, unit: &str) {
        self.at_most_in_blocks_towards(name, blocks, (bar, f64::INFINITY), unit);
    }

    /// As [`Self::at_most_in_blocks`], with a bar and a goal that is known not to be reached everywhere.
    pub fn at_most_in_blocks_towards(&mut self, name: &str, blocks: &[f64], (bar, goal): (f64, f64), unit: &str) {
        let verdict = match in_blocks(blocks, bar) {
            "ok" if median(blocks) > goal => format!("ok; the goal of {} is not reached yet", short(goal)),
            other => other.to_owned(),
        };
        self.missed |= verdict == "MISSED";
        self.row(name, of_blocks(blocks, unit), format!("<= {} {unit}", short(bar)), &verdict);
    }

    /// As [`Self::at_most_in_blocks`] with a goal that is known not to be reached yet, or not everywhere: no failure.
    pub fn goal_at_most_in_blocks(&mut self, name: &str, blocks: &[f64], goal: f64, unit: &str) {
        let verdict = match in_blocks(blocks, goal) {
            "MISSED" => "not reached",
            other => other,
        };
        self.row(name, of_blocks(blocks, unit), format!("<= {} {unit}", short(goal)), verdict);
    }

    /// A time of one program, one value per block of alternating programs, with a bar, and a goal that is known not to
    /// be reached everywhere. Blocks that differ by more than [`NOISY`] are not judged. It misses its bar only where
    /// all blocks agree on that.
    pub fn at_most_in_quiet_blocks(&mut self, name: &str, blocks: &[f64], bar: f64, goal: f64, unit: &str) {
        let verdict = match in_quiet_blocks(blocks, bar) {
            "ok" if median(blocks) > goal => format!("ok; the goal of {} is not reached yet", short(goal)),
            other => other.to_owned(),
        };
        self.missed |= verdict == "MISSED";
        self.row(name, of_blocks(blocks, unit), format!("<= {} {unit}", short(bar)), &verdict);
    }

    fn row(&mut self, name: &str, value: String, bar: String, verdict: &str) {
        self.rows.push([name.to_owned(), value, bar, verdict.to_owned()]);
    }

    /// Prints the table. True if every bar was met.
    pub fn print(&self) -> bool {
        let width = |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let [first, second, third] = [0, 1, 2].map(width);
        for [name, value, bar, verdict] in &self.rows {
            let line = format!("  {name:<first$}  {value:>second$}  {bar:<third$}  {verdict}");
            println!("{}", line.trim_end());
        }
        !self.missed
    }
}

/// Verdict about ratios of blocks: their median counts, but a failure needs all of them.
fn in_blocks(blocks: &[f64], bar: f64) -> &'static str {
    match () {
        () if blocks.is_empty() => "not measured",
        () if blocks.iter().all(|ratio| *ratio > bar) => "MISSED",
        () if median(blocks) <= bar => "ok",
        () => "not evaluated: the blocks disagree",
    }
}

/// Verdict about times of blocks, which have to agree.
fn in_quiet_blocks(blocks: &[f64], bar: f64) -> &'static str {
    if noise(blocks) > NOISY { "not judged: too noisy" } else { in_blocks(blocks, bar) }
}

/// The largest of these blocks as a multiple of the smallest.
pub fn noise(blocks: &[f64]) -> f64 {
    let least = blocks.iter().copied().fold(f64::INFINITY, f64::min);
    blocks.iter().copied().fold(0.0, f64::max) / least
}

/// The median of blocks, with all of them.
pub fn of_blocks(blocks: &[f64], unit: &str) -> String {
    let all: Vec<String> = blocks.iter().map(|value| short(*value)).collect();
    format!("{} {unit} (of {})", short(median(blocks)), all.join(", "))
}

/// The median of values in any order; of an even number the upper one.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// Says that something cannot be measured here. Where `CI` is `true` that is a failure: the result is false.
pub fn skipped(reason: &str) -> bool {
    let is_ci = std::env::var("CI").is_ok_and(|value| value == "true");
    println!("skipped: {reason}{}", if is_ci { "; with CI=true this is a failure" } else { "" });
    !is_ci
}

/// Success, or failure if a bar was missed.
pub fn verdict(met: bool) -> ExitCode {
    if met { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Rounds to the significant digits.
fn short(value: f64) -> String {
    if value.fract() == 0.0 || value.abs() >= 1000.0 { format!("{value:.0}") } else { format!("{value:.2}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: bench
    #[test]
    fn a_ratio_misses_its_bar_only_where_all_blocks_agree() {
        assert_eq!(in_blocks(&[1.1, 1.2, 3.0], 1.0), "MISSED");
        assert_eq!(in_blocks(&[1.1, 0.9, 3.0], 1.0), "not evaluated: the blocks disagree");
        assert_eq!(in_blocks(&[0.8, 0.9, 3.0], 1.0), "ok");
        assert_eq!(in_blocks(&[], 1.0), "not measured");
        assert_eq!(in_quiet_blocks(&[1.1, 1.2, 3.0], 1.0), "not judged: too noisy");
        assert_eq!(in_quiet_blocks(&[1.1, 1.2, 1.6], 1.0), "MISSED");
        assert_eq!(in_quiet_blocks(&[0.8, 0.9, 1.1], 1.0), "ok");
        assert_eq!(of_blocks(&[3.0, 0.8, 0.9], "x"), "0.90 x (of 3, 0.80, 0.90)");
    }
}
