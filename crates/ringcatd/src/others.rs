//! Another MainDevice on the segment of a master: detected before the daemon sends anything.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ringcat::foreign::{ListeningPhase, ListeningState};
use ringcat_control::Refusal;

use crate::log::say;

/// Listening on the links ends within this time after they have a carrier.
const LISTENED: Duration = Duration::from_secs(1);

/// What is known of other MainDevices on a segment.
#[derive(Debug)]
pub struct Others {
    master: u32,
    listened: Arc<ListeningState>,
    /// One was reported to the operator.
    is_reported: AtomicBool,
}

impl Others {
    /// No other MainDevice is known. A segment that is not shared has none.
    pub fn new(master: u32, is_shared: bool) -> Others {
        let listened = Arc::new(if is_shared { ListeningState::default() } else { ListeningState::not_shared() });
        Others { master, listened, is_reported: AtomicBool::new(false) }
    }

    /// For links that listen.
    pub fn listened(&self) -> Arc<ListeningState> {
        self.listened.clone()
    }

    /// Why the daemon sends nothing, although it has the links: another MainDevice drives the segment.
    pub fn cause(&self) -> Option<String> {
        self.listened.foreign_frame().map(|frame| frame.to_string())
    }

    /// Waits until it is known whether another MainDevice drives the segment. Without a carrier there is nothing to
    /// wait for.
    pub fn listen(&self) {
        self.listened.wait(LISTENED);
        self.tell();
    }

    /// Whether an application may have the segment; waits until it is known.
    ///
    /// # Errors
    /// Another MainDevice drives it, or carriers come and go.
    pub fn permit(&self) -> Result<(), Refusal> {
        self.listen();
        let master = self.master;
        match self.cause() {
            Some(cause) => Err(Refusal::Fault { master, cause }),
            None if self.listened.phase() == ListeningPhase::Listening => Err(Refusal::Changing { master }),
            None => Ok(()),
        }
    }

    /// An application drives the segment: its frames are not those of another MainDevice when it ends.
    pub fn is_ours(&self) {
        self.listened.set_free();
    }

    /// The links are others from now on.
    pub fn forget(&self) {
        self.listened.forget();
    }

    /// Reports once that another MainDevice drives the segment, and once that it no longer does.
    pub fn tell(&self) {
        let (master, cause) = (self.master, self.cause());
        if self.is_reported.swap(cause.is_some(), Ordering::AcqRel) != cause.is_some() {
            match cause {
                Some(cause) => say(format_args!("master {master} is not driven: {cause}")),
                None => say(format_args!("master {master}: the other MainDevice is silent")),
            }
        }
    }
}
