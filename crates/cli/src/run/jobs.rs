//! Times of the jobs of a cycle (`--jobs`), as text and as keys of JSON.

use std::sync::Arc;

use ringcat::{CycleJob, JobTimes};

use crate::json::run;
use crate::json::values::Times;
use crate::output::say;

/// Times that are taken, if they are asked for.
#[derive(Debug, Default)]
pub struct Jobs(pub Option<Arc<JobTimes>>);

const NAMES: [(CycleJob, &str); CycleJob::ALL.len()] = [
    (CycleJob::Receive, "receive"),
    (CycleJob::Process, "process"),
    (CycleJob::Work, "work"),
    (CycleJob::Queue, "queue"),
    (CycleJob::Send, "send"),
];

impl Jobs {
    /// Prints them.
    pub fn account(&self) {
        let Some(times) = &self.0 else { return };
        for (job, name) in NAMES {
            let time = times.of(job);
            say!("  {name}: mean {:.1}, {}", time.mean().as_nanos() as f64 / 1e3, time.histogram());
        }
    }

    /// The same for JSON.
    pub fn json(&self) -> Vec<run::Job> {
        let of = |times: &Arc<JobTimes>, (job, name): (CycleJob, &'static str)| {
            let time = times.of(job);
            run::Job { job: name, mean_ns: time.mean().as_nanos() as u64, times: Times::of(time.histogram()) }
        };
        self.0.iter().flat_map(|times| NAMES.map(|job| of(times, job))).collect()
    }
}
