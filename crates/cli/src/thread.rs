//! How the thread that sends and receives works: waiting, real-time priority, processor.

use std::sync::{LazyLock, Once};
use std::thread::available_parallelism;
use std::time::Duration;

use clap::{Args, ValueEnum};
use ringcat_link::ReceiveMode;
use ringcat_link::realtime::{self, CpuLatency};

use crate::numbers::number;
use crate::output::warn;

/// A hybrid wait spins for this time: most segments answer within.
const SPIN: Duration = Duration::from_micros(200);

/// How to wait for frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Receive {
    /// Spin: fastest, takes a whole processor
    Busy,
    /// Sleep: saves the processor, costs tens of microseconds per frame
    Block,
    /// Sleep until shortly before the usual return of a frame, then spin for up to 200 us, then sleep
    Hybrid,
}

/// Largest number of a processor that the kernel can be built for, less one.
const MOST_PROCESSORS: usize = 8_191;

/// The options of the thread that sends and receives.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Thread")]
pub struct ThreadArguments {
    /// How to wait for frames
    #[arg(long, value_enum, default_value = "hybrid")]
    receive: Receive,
    /// Real-time priority (SCHED_FIFO) of the thread that sends and receives
    ///
    /// Memory is then locked, and processors are kept awake. A spinning thread with a priority takes its processor
    /// from all others. 99 is left to the kernel and to the thread that handles signals.
    #[arg(long, value_name = "1-98", value_parser = number(1..=98, 80))]
    pub priority: Option<i32>,
    /// Processor that this thread is bound to
    #[arg(long, value_name = "NUMBER", value_parser = number(0..=MOST_PROCESSORS, 3))]
    cpu: Option<usize>,
}

/// Number of processors that this process may use, as it was before the first thread was bound to one.
fn processors() -> usize {
    static PROCESSORS: LazyLock<usize> = LazyLock::new(|| available_parallelism().map_or(1, usize::from));
    *PROCESSORS
}

impl ThreadArguments {
    /// The receive mode of the links.
    pub fn mode(self) -> ReceiveMode {
        match self.receive() {
            Receive::Busy => ReceiveMode::BusyPoll,
            Receive::Block => ReceiveMode::Blocking,
            Receive::Hybrid => ReceiveMode::Hybrid { spin: SPIN },
        }
    }

    /// The receive mode, as text for the summary.
    pub fn mode_in_words(self) -> &'static str {
        match self.receive() {
            Receive::Busy => "waiting busy",
            Receive::Block => "waiting blocked",
            Receive::Hybrid => "waiting hybrid",
        }
    }

    /// The effective way to wait. A thread that spins needs a processor of its own: on the only one it would keep
    /// everything else in this program from running, and with a priority for ever.
    fn receive(self) -> Receive {
        static WARNED: Once = Once::new();
        if self.receive == Receive::Block || processors() > 1 {
            return self.receive;
        }
        WARNED.call_once(|| {
            warn("this process may use one processor only, so no thread spins on it: as with --receive block");
        });
        Receive::Block
    }

    /// Applies the options to the calling thread and the process. The result keeps processors awake while it lives.
    pub fn apply(self) -> Option<CpuLatency> {
        self.prepare_cycles();
        self.prepare_process()
    }

    /// Applies the options to the calling thread, which runs the cycles. A missing permission is a warning.
    pub fn prepare_cycles(self) {
        // Before this thread has one of them only.
        let _ = processors();
        realtime::precise_timers();
        if let Some(cpu) = self.cpu {
            let _ = realtime::affinity(cpu).map_err(warn);
        }
        if let Some(priority) = self.priority
            && realtime::fifo(priority).map_err(warn).is_ok()
            && self.receive() == Receive::Busy
            && let Some(warning) = realtime::throttling()
        {
            warn(warning);
        }
    }

    /// Gives the calling thread, which does everything but the cycles, a priority just below theirs.
    pub fn prepare_supervisor(self) {
        realtime::precise_timers();
        if let Some(priority) = self.priority {
            // Where it is not permitted, the thread of the cycles warns.
            let _ = realtime::fifo((priority - 1).max(1));
        }
    }

    /// Locks memory and, while the result lives, keeps processors awake, where a priority is given.
    pub fn prepare_process(self) -> Option<CpuLatency> {
        self.priority?;
        let _ = realtime::lock_memory().map_err(warn);
        CpuLatency::request(0).map_err(warn).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: run, bench
    #[test]
    fn a_thread_that_is_bound_to_one_processor_spins_where_there_are_others() {
        let expected = match available_parallelism().map_or(1, usize::from) {
            1 => ReceiveMode::Blocking,
            _ => ReceiveMode::BusyPoll,
        };
        let bound = std::thread::spawn(|| {
            let arguments = ThreadArguments { receive: Receive::Busy, priority: None, cpu: Some(0) };
            arguments.prepare_cycles();
            arguments.mode()
        });
        assert_eq!(bound.join().expect("it ends"), expected);
    }
}
