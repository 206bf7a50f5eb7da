//! Stalls of the host: a thread on each processor sleeps for a millisecond at a time, with the priority of the
//! controllers, and records how late it wakes up.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat::realtime;

const NAP: Duration = Duration::from_millis(1);
/// A wake-up is late from this delay on.
const LATE: Duration = Duration::from_micros(300);
const PRIORITY: i32 = 50;

/// When a wake-up was late, and by how much.
type Late = Arc<Mutex<Vec<(Instant, Duration)>>>;

/// The threads, while this lives.
pub struct Stalls {
    late: Vec<Late>,
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Stalls {
    /// Begins to record.
    pub fn record() -> Stalls {
        let is_over = Arc::new(AtomicBool::new(false));
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let late: Vec<Late> = (0..processors).map(|_| Late::default()).collect();
        let threads = late.iter().cloned().zip(0..).map(|(late, processor)| {
            let is_over = is_over.clone();
            std::thread::spawn(move || watch(processor, &late, &is_over))
        });
        Stalls { threads: threads.collect(), late, is_over }
    }

    /// Delays since a moment: those of the processor that has the most.
    pub fn since(&self, begin: Instant) -> Duration {
        let of = |late: &Late| -> Duration {
            let late = late.lock().unwrap_or_else(PoisonError::into_inner);
            late.iter().rev().take_while(|(at, _)| *at >= begin).map(|(_, delay)| *delay).sum()
        };
        self.late.iter().map(of).max().unwrap_or_default()
    }
}

fn watch(processor: usize, late: &Late, is_over: &AtomicBool) {
    realtime::affinity(processor).expect("the processor is there");
    realtime::fifo(PRIORITY).expect("root may have a priority");
    while !is_over.load(Ordering::Relaxed) {
        let begin = Instant::now();
        std::thread::sleep(NAP);
        let delay = begin.elapsed().saturating_sub(NAP);
        if delay > LATE {
            late.lock().unwrap_or_else(PoisonError::into_inner).push((Instant::now(), delay));
        }
    }
}

impl Drop for Stalls {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // A panic of the thread was printed.
            let _ = thread.join();
        }
    }
}
