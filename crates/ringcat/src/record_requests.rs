//! Requests for a file with the last frames, without a fault.
//!
//! In: requests of any thread that has a handle of the acyclic half. Out: the same requests, for the thread that keeps
//! the frames, which answers each of them when the file is there. Not for the cyclic path.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::time::Duration;

/// Most requests that wait for the thread that keeps the frames.
const MOST: usize = 16;

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct WrittenRecord {
    /// Its path.
    pub path: PathBuf,
    /// Frames in it.
    pub frames: u64,
    /// Frames that were not recorded since the recording began.
    pub lost: u64,
}

/// The answer to a request; an error is for the operator.
pub(crate) type Written = Result<WrittenRecord, String>;

/// Why there is no file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum NoRecord {
    /// No frames are kept.
    NotKept,
    /// The recording has ended with what drove the bus.
    Ended,
    /// Too many requests wait, or the file takes too long.
    Busy,
    /// The file cannot be written; why.
    Failed(String),
}

/// Where requests are made. Clones are the same place.
#[derive(Clone, Debug)]
pub(crate) struct RecordRequests(SyncSender<Sender<Written>>);

impl RecordRequests {
    /// A place for requests, and its other end.
    pub fn new() -> (RecordRequests, Receiver<Sender<Written>>) {
        let (requests, requested) = sync_channel(MOST);
        (RecordRequests(requests), requested)
    }

    /// Requests a file, and waits for it.
    ///
    /// # Errors
    /// There is none.
    pub fn write(&self, limit: Duration) -> Result<WrittenRecord, NoRecord> {
        let (answer, answered) = channel();
        self.0.try_send(answer).map_err(|error| match error {
            TrySendError::Full(_) => NoRecord::Busy,
            TrySendError::Disconnected(_) => NoRecord::NotKept,
        })?;
        match answered.recv_timeout(limit) {
            Ok(written) => written.map_err(NoRecord::Failed),
            Err(RecvTimeoutError::Timeout) => Err(NoRecord::Busy),
            Err(RecvTimeoutError::Disconnected) => Err(NoRecord::Ended),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon, capture
    #[test]
    fn requests_are_few_and_end_with_what_keeps_the_frames() {
        let (requests, requested) = RecordRequests::new();
        for _ in 0..MOST {
            assert_eq!(requests.write(Duration::ZERO), Err(NoRecord::Busy));
        }
        assert_eq!((requests.write(Duration::from_secs(9)), requested.try_iter().count()), (Err(NoRecord::Busy), MOST));
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| requests.write(Duration::from_secs(60)));
            drop(requested.recv().expect("a request"));
            assert_eq!(waiting.join().expect("no panic"), Err(NoRecord::Ended));
        });
        drop(requested);
        assert_eq!(requests.write(Duration::from_secs(9)), Err(NoRecord::NotKept));
    }
}
