//! What `ringcat doctor --json` prints.

use serde::Serialize;

use super::values::Times;

/// Settings of this machine that disturb a MainDevice.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Doctor {
    /// Number of findings that are bad
    pub bad: usize,
    /// Number of findings that cost microseconds, or concern only some uses
    pub minor: usize,
    /// Number of checks that were not possible
    pub unknown: usize,
    /// Number of findings that are good
    pub good: usize,
    /// The findings, the worst first
    pub findings: Vec<Finding>,
    /// How late a thread wakes up; null with --latency 0
    pub latency: Option<Latency>,
}

/// How a thing is on this machine.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Finding {
    /// Name of what was checked, as in docs/doctor.md
    pub id: &'static str,
    /// `bad`, `minor`, `unknown` or `good`
    pub level: &'static str,
    /// The network interface; null where it is not about one
    pub interface: Option<String>,
    /// How it is, for people
    pub what: String,
    /// Why it matters, for people
    pub why: &'static str,
    /// Commands and steps that correct it, one each; empty for good and unknown findings
    pub mend: Vec<String>,
}

/// How late a thread wakes up that sleeps from cycle to cycle.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Latency {
    /// Time from one wake-up to the next, in nanoseconds
    pub period_ns: u64,
    /// Real-time priority (SCHED_FIFO) of the thread; null where it is not permitted
    pub priority: Option<i32>,
    /// Processor that the thread was bound to; null for any
    pub cpu: Option<usize>,
    /// Whether memory was locked
    pub memory_locked: bool,
    /// Whether processors were kept awake
    pub processors_awake: bool,
    /// How late the wake-ups came; null where none was measured
    pub delays: Option<Times>,
    /// Wake-ups that were left out because the one before came later
    pub skipped: u64,
    /// Number of wake-ups by how late they came, in doublings
    pub counts: Vec<Count>,
}

/// Wake-ups of a range.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Count {
    /// They came less late than this, in nanoseconds, and at least half as late; the first range begins at 0
    pub below_ns: u64,
    /// How many
    pub count: u64,
}
