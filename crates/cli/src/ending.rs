//! How commands end that go on until they are asked to: by a signal, or at a time that passes while the command is held
//! up.
//!
//! A thread of its own waits for the signals, with a real-time priority above that of the cycles where they have one:
//! it runs whatever starves. Cycles look at the request themselves ([`EndRequest::is_asked`] is an atomic), so they
//! end, and then there is a processor for the orderly stop. A second signal ends the program at once, and so does a
//! stop that takes too long.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use ringcat::Instant;
use ringcat_link::{HeldSignals, Signal, realtime};

use crate::failure::Failure;
use crate::interfaces::now;
use crate::times::in_words;

/// The thread looks at the time so often.
const LOOK: Duration = Duration::from_millis(100);
/// A limit that has passed for so long is not looked at by the command itself: it does not run.
const GRACE: Duration = Duration::from_secs(2);
/// From the request to the end of the program at the most: longer than all limits of an orderly stop together.
const STOP_LIMIT: Duration = Duration::from_secs(30);
/// Exit status of a program that could not stop in order.
const NOT_IN_ORDER: i32 = 1;
/// Ended because a limit had passed, in the place of a signal's number.
const OVERDUE: i32 = -1;

/// Whether the end is asked for. Clones are one.
#[derive(Clone, Debug)]
pub struct EndRequest(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    /// Number of the signal; [`OVERDUE`]; zero where nothing has asked.
    asked: AtomicI32,
    /// When the command has to end by itself.
    limit: AtomicU64,
}

impl EndRequest {
    /// SIGINT, SIGTERM and SIGHUP ask for an orderly end from now on. `priority` is the one that cycles have. To be
    /// called before there are other threads.
    pub fn watch(priority: Option<i32>) -> Result<EndRequest, Failure> {
        let held = HeldSignals::hold();
        let shared = Arc::new(Shared { asked: AtomicI32::new(0), limit: AtomicU64::new(u64::MAX) });
        let request = EndRequest(shared.clone());
        let body = move || {
            if let Some(priority) = priority {
                // Where it is not permitted, the cycles have no priority either, and tell so.
                let _ = realtime::fifo(priority + 1);
            }
            shared.watch(&held);
        };
        let thread = thread::Builder::new().name("signals".to_owned()).spawn(body);
        thread.map_err(|error| Failure::new(format!("a thread cannot be started: {error}")))?;
        Ok(request)
    }

    /// Whether that has happened. Cheap enough for each cycle.
    pub fn is_asked(&self) -> bool {
        self.0.asked.load(Ordering::Relaxed) != 0
    }

    /// What has asked, in a word.
    pub fn by(&self) -> Option<String> {
        let asked = self.0.asked.load(Ordering::Relaxed);
        if asked == OVERDUE {
            return Some("a limit that had passed".to_owned());
        }
        Signal::ALL.into_iter().find(|signal| signal.number() == asked).map(|signal| signal.to_string())
    }

    /// A reason against success where a command that was to last for a time was asked to end earlier.
    pub fn cut_short(&self, lasts: Option<Duration>) -> Option<String> {
        let (by, lasts) = (self.by()?, lasts?);
        Some(format!("ended by {by} before --for {} had passed", in_words(lasts)))
    }

    /// The command ends by itself at this time. Should it be held up then, the end is asked for a little later.
    pub fn limit(&self, until: Instant) {
        self.0.limit.store(until.0, Ordering::Relaxed);
    }

    /// No limit is watched any more.
    pub fn no_limit(&self) {
        self.limit(Instant::NEVER);
    }
}

impl Shared {
    fn watch(&self, held: &HeldSignals) {
        let mut asked_at: Option<Instant> = None;
        loop {
            let signal = held.wait(LOOK);
            let now = now();
            if let (Some(signal), Some(_)) = (signal, asked_at) {
                leave(&format!("ended at once by a second signal, {signal}: SubDevices were not stopped in order"));
            }
            let limit = Instant(self.limit.load(Ordering::Relaxed));
            let is_overdue = limit != Instant::NEVER && now >= limit + GRACE;
            if asked_at.is_none() && (signal.is_some() || is_overdue) {
                self.asked.store(signal.map_or(OVERDUE, Signal::number), Ordering::Relaxed);
                asked_at = Some(now);
            }
            if asked_at.is_some_and(|at| now >= at + STOP_LIMIT) {
                let limit = STOP_LIMIT.as_secs();
                leave(&format!("no orderly stop within {limit} s: this program's threads got no processor time"));
            }
        }
    }
}

/// Ends the program as it is.
fn leave(words: &str) -> ! {
    eprintln!("result: FAILED: {words}");
    std::process::exit(NOT_IN_ORDER);
}
