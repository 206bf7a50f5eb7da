//! What an application may learn of the steps of its cycles: the time of each job, and the return of the last frame.
//!
//! A probe is a type parameter of the cycle. `()` is the usual, empty one: the compiler leaves out all code for it. A
//! probe runs in the cyclic path: it neither allocates nor locks nor waits.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ringcat_engine::time::Instant;

use crate::histogram::Histogram;

/// A job of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum CycleJob {
    /// Taking the frames that have arrived; waiting for them does not count.
    Receive,
    /// Evaluating the domains.
    Process,
    /// The work of the application.
    Work,
    /// Copying outputs into frames.
    Queue,
    /// Sending, with the system calls for it, and publishing.
    Send,
}

impl CycleJob {
    /// All jobs, in the order of a cycle.
    pub const ALL: [CycleJob; 5] =
        [CycleJob::Receive, CycleJob::Process, CycleJob::Work, CycleJob::Queue, CycleJob::Send];
}

/// Follows the steps of cycles.
///
/// ```
/// use ringcat::{CycleProbe, Instant};
///
/// /// Counts the cycles of which all frames came back.
/// struct Returned(u64);
///
/// impl CycleProbe for Returned {
///     const AWAITS_FRAMES: bool = true;
///
///     fn frames_are_in(&mut self, _at: Instant) {
///         self.0 += 1;
///     }
/// }
/// ```
pub trait CycleProbe {
    /// Whether [`CycleProbe::job_done`] is called: the clock is read before and after each job.
    const TIMES_JOBS: bool = false;
    /// Whether [`CycleProbe::frames_are_in`] is called.
    const AWAITS_FRAMES: bool = false;

    /// A part of a job has taken this time. A job may have several parts in a cycle, or none.
    #[inline]
    fn job_done(&mut self, _job: CycleJob, _took: Duration) {}

    /// The frames of a cycle have been sent: the cycle has ended. Called after each cycle if jobs are timed.
    #[inline]
    fn cycle_ended(&mut self) {}

    /// The last frame of the oldest cycle under way is in, and its domains can be evaluated. `at`: when the frame was
    /// taken. Called once per cycle, in the thread of the cycles, before they are evaluated; not for a cycle with a
    /// lost frame.
    #[inline]
    fn frames_are_in(&mut self, _at: Instant) {}
}

impl CycleProbe for () {}

/// Both probes, in their order.
impl<A: CycleProbe, B: CycleProbe> CycleProbe for (A, B) {
    const TIMES_JOBS: bool = A::TIMES_JOBS || B::TIMES_JOBS;
    const AWAITS_FRAMES: bool = A::AWAITS_FRAMES || B::AWAITS_FRAMES;

    fn job_done(&mut self, job: CycleJob, took: Duration) {
        self.0.job_done(job, took);
        self.1.job_done(job, took);
    }

    fn cycle_ended(&mut self) {
        self.0.cycle_ended();
        self.1.cycle_ended();
    }

    fn frames_are_in(&mut self, at: Instant) {
        self.0.frames_are_in(at);
        self.1.frames_are_in(at);
    }
}

/// A probe that calls a function when the last frame of a cycle is in: to wake another thread, for example.
///
/// ```
/// use std::thread::Thread;
/// use ringcat::{CycleProbe, FramesIn, Instant};
///
/// fn waking(reader: Thread) -> impl CycleProbe {
///     FramesIn::new(move |_at: Instant| reader.unpark())
/// }
/// ```
#[derive(Clone, Debug)]
pub struct FramesIn<F>(F);

impl<F: FnMut(Instant)> FramesIn<F> {
    /// Calls this function, in the cyclic path.
    pub fn new(call: F) -> FramesIn<F> {
        FramesIn(call)
    }
}

impl<F: FnMut(Instant)> CycleProbe for FramesIn<F> {
    const AWAITS_FRAMES: bool = true;

    #[inline]
    fn frames_are_in(&mut self, at: Instant) {
        (self.0)(at);
    }
}

/// Times of a job, one per cycle in which it ran.
#[derive(Debug, Default)]
pub struct JobTime {
    histogram: Histogram,
    sum_ns: AtomicU64,
}

impl JobTime {
    /// Minimum, maximum and distribution.
    pub fn histogram(&self) -> &Histogram {
        &self.histogram
    }

    /// Mean; zero before the first cycle.
    pub fn mean(&self) -> Duration {
        let sum = self.sum_ns.load(Ordering::Relaxed);
        Duration::from_nanos(sum.checked_div(self.histogram.count()).unwrap_or_default())
    }

    fn record(&self, ns: u64) {
        self.histogram.record_ns(ns);
        // Single writer.
        self.sum_ns.store(self.sum_ns.load(Ordering::Relaxed).saturating_add(ns), Ordering::Relaxed);
    }
}

/// Times of all jobs, readable in any thread.
#[derive(Debug, Default)]
pub struct JobTimes([JobTime; CycleJob::ALL.len()]);

impl JobTimes {
    /// Times of a job.
    pub fn of(&self, job: CycleJob) -> &JobTime {
        &self.0[job as usize]
    }
}

/// A probe that records the time of each job.
///
/// ```
/// use ringcat::{AcyclicHalf, Application, CycleJob, JobProbe, Links};
///
/// fn show<L: Links, H: AcyclicHalf>(application: &mut Application<L, H>) {
///     let mut probe = JobProbe::default();
///     for _ in 0..1_000 {
///         application.cycle_probed(&mut probe, |data| data.zero_outputs());
///     }
///     for job in CycleJob::ALL {
///         let time = probe.times().of(job);
///         println!("{job:?}: mean {:?}, {}", time.mean(), time.histogram());
///     }
/// }
/// ```
#[derive(Debug, Default)]
pub struct JobProbe {
    times: Arc<JobTimes>,
    /// Of the present cycle; `None` for jobs that did not run.
    running: [Option<u64>; CycleJob::ALL.len()],
}

impl JobProbe {
    /// The times; other threads may keep them.
    pub fn times(&self) -> &Arc<JobTimes> {
        &self.times
    }
}

impl CycleProbe for JobProbe {
    const TIMES_JOBS: bool = true;

    fn job_done(&mut self, job: CycleJob, took: Duration) {
        let took = u64::try_from(took.as_nanos()).unwrap_or(u64::MAX);
        let running = &mut self.running[job as usize];
        *running = Some(running.unwrap_or_default().saturating_add(took));
    }

    fn cycle_ended(&mut self) {
        for (time, running) in self.times.0.iter().zip(&mut self.running) {
            if let Some(ns) = running.take() {
                time.record(ns);
            }
        }
    }
}

/// The time since the last job, where jobs are timed.
pub(crate) struct JobTimer(Instant);

impl JobTimer {
    /// Begins a job.
    #[inline(always)]
    pub fn begin<P: CycleProbe>(now: impl FnOnce() -> Instant) -> JobTimer {
        JobTimer(if P::TIMES_JOBS { now() } else { Instant(0) })
    }

    /// A job has ended, and the next one begins.
    #[inline(always)]
    pub fn done<P: CycleProbe>(&mut self, probe: &mut P, job: CycleJob, now: impl FnOnce() -> Instant) {
        if P::TIMES_JOBS {
            let now = now();
            probe.job_done(job, now.since(self.0));
            self.0 = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ns(ns: u64) -> Duration {
        Duration::from_nanos(ns)
    }

    // covers: cycles
    #[test]
    fn parts_of_a_job_in_one_cycle_are_one_time() {
        let mut probe = JobProbe::default();
        for cycle in 1..=4 {
            probe.job_done(CycleJob::Receive, ns(100));
            probe.job_done(CycleJob::Receive, ns(100 * cycle));
            if cycle == 2 {
                probe.job_done(CycleJob::Work, ns(7));
            }
            probe.cycle_ended();
        }
        let times = probe.times();
        let receive = times.of(CycleJob::Receive);
        assert_eq!((receive.histogram().count(), receive.mean()), (4, ns(350)));
        assert_eq!((receive.histogram().shortest(), receive.histogram().longest()), (ns(200), ns(500)));
        assert_eq!((times.of(CycleJob::Work).histogram().count(), times.of(CycleJob::Work).mean()), (1, ns(7)));
        assert_eq!((times.of(CycleJob::Send).histogram().count(), times.of(CycleJob::Send).mean()), (0, ns(0)));
    }

    #[test]
    fn two_probes_together_need_what_either_needs() {
        type Both = (JobProbe, FramesIn<fn(Instant)>);
        const {
            assert!(Both::TIMES_JOBS && Both::AWAITS_FRAMES);
            assert!(!<(JobProbe, ())>::AWAITS_FRAMES && !<((), FramesIn<fn(Instant)>)>::TIMES_JOBS);
        }
        let mut count = 0;
        let mut both = (JobProbe::default(), FramesIn::new(|_: Instant| count += 1));
        both.job_done(CycleJob::Send, ns(5));
        both.frames_are_in(Instant(1));
        both.cycle_ended();
        assert_eq!(both.0.times().of(CycleJob::Send).mean(), ns(5));
        assert_eq!(count, 1);
    }
}
