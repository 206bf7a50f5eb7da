//! The end of commands that run until a signal comes or a time has passed.
//!
//! A thread of its own waits for the signals. Its real-time priority is above that of the cycles, so it runs even where
//! they take the whole processor. Cycles check the request themselves ([`EndRequest::is_asked`] is an atomic), so they
//! end and leave the processor to the orderly stop. A second signal ends the program at once, and so does a stop that
//! takes too long.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use ringcat::Instant;
use ringcat_link::{HeldSignals, Signal, realtime};

use crate::failure::Failure;
use crate::interfaces::now;
use crate::times::in_words;
use crate::verdict::end_at_once;

/// Period of the thread's checks.
const LOOK: Duration = Duration::from_millis(100);
/// A command that has not ended this time after its limit does not run.
const GRACE: Duration = Duration::from_secs(2);
/// From the request to the end of the program at the most: longer than all limits of an orderly stop together.
const STOP_LIMIT: Duration = Duration::from_secs(30);
/// Ended because a limit had passed, in the place of a signal's number.
const OVERDUE: i32 = -1;

/// A request to end. Clones share it.
#[derive(Clone, Debug)]
pub struct EndRequest(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    /// Number of the signal; [`OVERDUE`]; zero without a request.
    asked: AtomicI32,
    /// When the command has to end by itself.
    limit: AtomicU64,
}

impl EndRequest {
    /// SIGINT, SIGTERM and SIGHUP request an orderly end from now on. `priority` is that of the cycles. To be called
    /// before there are other threads.
    pub fn watch(priority: Option<i32>) -> Result<EndRequest, Failure> {
        let held = HeldSignals::hold();
        let shared = Arc::new(Shared { asked: AtomicI32::new(0), limit: AtomicU64::new(u64::MAX) });
        let request = EndRequest(shared.clone());
        let body = move || {
            if let Some(priority) = priority {
                // Where it is not permitted, the thread of the cycles warns.
                let _ = realtime::fifo(priority + 1);
            }
            shared.watch(&held);
        };
        start("signals", body)?;
        Ok(request)
    }

    /// For commands that end by themselves within seconds: SIGINT, SIGTERM and SIGHUP end the program at once, with a
    /// last line that names the signal. To be called before there are other threads.
    pub fn at_once() -> Result<(), Failure> {
        let held = HeldSignals::hold();
        let body = move || loop {
            if let Some(signal) = held.wait(LOOK) {
                end_at_once(&format!("ended by {signal} before the command had finished"));
            }
        };
        start("signals", body)
    }

    /// Whether the end is requested. Cheap enough for each cycle.
    pub fn is_asked(&self) -> bool {
        self.0.asked.load(Ordering::Relaxed) != 0
    }

    /// The signal, or the limit that has passed, in words.
    pub fn by(&self) -> Option<String> {
        let asked = self.0.asked.load(Ordering::Relaxed);
        if asked == OVERDUE {
            return Some("a limit that had passed".to_owned());
        }
        Signal::ALL.into_iter().find(|signal| signal.number() == asked).map(|signal| signal.to_string())
    }

    /// A reason against success where a command was ended before its time had passed.
    pub fn cut_short(&self, lasts: Option<Duration>) -> Option<String> {
        let (by, lasts) = (self.by()?, lasts?);
        Some(format!("ended by {by} before --for {} had passed", in_words(lasts)))
    }

    /// The command ends by itself at this time. If it does not, the end is requested a little later.
    pub fn limit(&self, until: Instant) {
        self.0.limit.store(until.0, Ordering::Relaxed);
    }

    /// No limit is watched any more.
    pub fn no_limit(&self) {
        self.limit(Instant::NEVER);
    }
}

fn start(name: &str, body: impl FnOnce() + Send + 'static) -> Result<(), Failure> {
    let thread = thread::Builder::new().name(name.to_owned()).spawn(body);
    thread.map_err(|error| Failure::new(format!("a thread cannot be started: {error}")))?;
    Ok(())
}

impl Shared {
    fn watch(&self, held: &HeldSignals) {
        let mut asked_at: Option<Instant> = None;
        loop {
            let signal = held.wait(LOOK);
            let now = now();
            if let (Some(signal), Some(_)) = (signal, asked_at) {
                end_at_once(&format!("ended at once by a second signal, {signal}, before the orderly end"));
            }
            let limit = Instant(self.limit.load(Ordering::Relaxed));
            let is_overdue = limit != Instant::NEVER && now >= limit + GRACE;
            if asked_at.is_none() && (signal.is_some() || is_overdue) {
                self.asked.store(signal.map_or(OVERDUE, Signal::number), Ordering::Relaxed);
                asked_at = Some(now);
            }
            if asked_at.is_some_and(|at| now >= at + STOP_LIMIT) {
                let limit = STOP_LIMIT.as_secs();
                end_at_once(&format!("no orderly stop within {limit} s: this program's threads got no processor time"));
            }
        }
    }
}
