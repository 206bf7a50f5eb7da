//! Hand-over of a segment between processes: the thread begins with the data of another process, and returns its own
//! at its end.

use std::sync::atomic::Ordering;
use std::time::Duration;

use ringcat_engine::Scan;
use ringcat_engine::knowledge::{Handover, Knowledge};
use ringcat_engine::main_device::MainDevice as Engine;

use super::SupervisorThread;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::Options;

/// Longest wait of a hand-over until temporarily closed ports are open again: their temporary settings have expired by
/// then.
const OPENED: Duration = Duration::from_secs(3);

impl SupervisorThread {
    /// Starts the thread as [`SupervisorThread::start`], and goes on with a segment that another process has known,
    /// before anything else is done on it. Does not wait for the result: until then a scan runs.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start_resumed<L>(
        links: L,
        options: &Options,
        (knowledge, handover): (Knowledge, Handover),
        prepare: impl FnOnce() + Send + 'static,
    ) -> Result<Self, Error>
    where
        L: Links + Send + 'static,
    {
        let resume = move |engine: &mut Engine| {
            // A new engine is neither active nor scans, so it does not refuse.
            let _ = engine.resume(knowledge, handover);
        };
        Self::start_with(links, options, prepare, resume)
    }

    /// Goes on with a segment that another process has known, as [`crate::MainDevice::resume`].
    ///
    /// # Errors
    /// As [`crate::MainDevice::resume`].
    pub fn resume(&self, knowledge: Knowledge, handover: Handover) -> Result<Scan, Error> {
        self.act(move |engine| engine.resume(knowledge, handover))??;
        Ok(self.ask(|engine| engine.scan_result()).wait()??)
    }

    /// What is known of the segment, for another process that goes on with it; `None` without a successful scan.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn knowledge(&self) -> Result<Option<Knowledge>, Error> {
        self.act(|engine| engine.knowledge())
    }

    /// Ends the thread without a further frame, and returns what is known of the segment, for another process that goes
    /// on with it. All handles get [`Error::Gone`] from then on. If ports are closed for a measurement of delays, waits
    /// until they are open again, at most 3 s.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn hand_over(&self) -> Result<Option<Knowledge>, Error> {
        let (published, mut until) = (self.0.published.clone(), None);
        let handed_over = self.ask(move |engine: &mut Engine| {
            let now = engine.bus().now();
            if engine.are_ports_altered() && now < *until.get_or_insert(now + OPENED) {
                return None;
            }
            published.is_handed_over.store(true, Ordering::Release);
            Some(engine.knowledge())
        });
        handed_over.wait()
    }
}
