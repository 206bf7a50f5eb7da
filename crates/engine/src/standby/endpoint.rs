//! The end of the Ethernet between both MainDevices, for any thread.

use alloc::sync::Arc;
use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use ringcat_wire::master_frame::{MAX_ETHERNET, MIN_ETHERNET};

use super::frame_queue::{FrameConsumer, FrameProducer};

/// Frames that may wait in each direction; further ones are dropped and counted.
pub const ETHERNET_QUEUE: usize = 64;

/// Why a frame was not queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NotQueued {
    /// The other MainDevice does not answer, or no MainDevice is ACTIVE.
    Down,
    /// The queue is full.
    Full,
    /// Not an Ethernet frame that fits into a master frame.
    Length {
        /// Its length in bytes.
        bytes: usize,
    },
}

impl fmt::Display for NotQueued {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotQueued::Down => f.write_str("the other MainDevice does not answer"),
            NotQueued::Full => write!(f, "{ETHERNET_QUEUE} frames wait to be sent"),
            NotQueued::Length { bytes } => {
                write!(f, "an Ethernet frame between both MainDevices has {MIN_ETHERNET} to {MAX_ETHERNET} bytes, ")?;
                write!(f, "got {bytes}")
            }
        }
    }
}

impl core::error::Error for NotQueued {}

/// Counters of the Ethernet between both MainDevices, since the MainDevice began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PartnerTraffic {
    /// Ethernet frames that have left in a master frame.
    pub sent: u64,
    /// Their bytes.
    pub sent_bytes: u64,
    /// Ethernet frames that have arrived.
    pub received: u64,
    /// Their bytes.
    pub received_bytes: u64,
    /// Not queued: too long, or too short.
    pub refused_length: u64,
    /// Not queued: the queue was full.
    pub refused_full: u64,
    /// Not queued, or dropped from the queue: the other MainDevice did not answer.
    pub dropped_down: u64,
    /// Arrived, and dropped: they were not taken in time.
    pub overflowed: u64,
    /// Sent by the other MainDevice, and not arrived.
    pub missed: u64,
    /// Acyclic master frames that were sent as ACTIVE.
    pub master_frames: u64,
    /// Acyclic master frames that the other MainDevice has filled, as seen as ACTIVE.
    pub answers: u64,
}

/// What both sides of the queues share.
#[derive(Debug, Default)]
pub(super) struct Figures {
    pub is_up: AtomicBool,
    pub sent: AtomicU64,
    pub sent_bytes: AtomicU64,
    pub received: AtomicU64,
    pub received_bytes: AtomicU64,
    pub refused_length: AtomicU64,
    pub refused_full: AtomicU64,
    pub dropped_down: AtomicU64,
    pub overflowed: AtomicU64,
    pub missed: AtomicU64,
    pub master_frames: AtomicU64,
    pub answers: AtomicU64,
}

/// Adds to a counter.
pub(super) fn add(counter: &AtomicU64, more: u64) {
    counter.fetch_add(more, Ordering::Relaxed);
}

/// The end of the Ethernet between both MainDevices, for any thread. Frames are sent in acyclic master frames, at any
/// EtherCAT state, in both roles; there has to be an ACTIVE. They arrive in their order and once, or not at all.
#[derive(Debug)]
pub struct PartnerEndpoint {
    pub(super) outgoing: FrameProducer,
    pub(super) incoming: FrameConsumer,
    pub(super) figures: Arc<Figures>,
}

impl PartnerEndpoint {
    /// Whether the other MainDevice answers, or has done so within the last second.
    pub fn is_up(&self) -> bool {
        self.figures.is_up.load(Ordering::Relaxed)
    }

    /// Frames that may be queued now.
    pub fn room(&self) -> usize {
        self.outgoing.room()
    }

    /// Queues a frame, without check sequence. Neither waits nor allocates.
    ///
    /// # Errors
    /// It is too long or too short, the queue is full, or the other MainDevice does not answer. Each is counted.
    pub fn send(&mut self, frame: &[u8]) -> Result<(), NotQueued> {
        let Figures { refused_length, refused_full, dropped_down, .. } = &*self.figures;
        let (counter, refused) = if !(MIN_ETHERNET..=MAX_ETHERNET).contains(&frame.len()) {
            (refused_length, NotQueued::Length { bytes: frame.len() })
        } else if !self.is_up() {
            (dropped_down, NotQueued::Down)
        } else if !self.outgoing.push(frame) {
            (refused_full, NotQueued::Full)
        } else {
            return Ok(());
        };
        add(counter, 1);
        Err(refused)
    }

    /// Takes the oldest received frame; its length. `out` needs room for `MAX_ETHERNET` bytes.
    pub fn receive(&mut self, out: &mut [u8]) -> Option<usize> {
        self.incoming.pop(out)
    }

    /// Its counters.
    pub fn traffic(&self) -> PartnerTraffic {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let figures = &*self.figures;
        PartnerTraffic {
            sent: count(&figures.sent),
            sent_bytes: count(&figures.sent_bytes),
            received: count(&figures.received),
            received_bytes: count(&figures.received_bytes),
            refused_length: count(&figures.refused_length),
            refused_full: count(&figures.refused_full),
            dropped_down: count(&figures.dropped_down),
            overflowed: count(&figures.overflowed),
            missed: count(&figures.missed),
            master_frames: count(&figures.master_frames),
            answers: count(&figures.answers),
        }
    }
}
