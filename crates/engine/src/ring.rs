//! The ring: every frame is sent on all links with a frame id; its copies are recognised, paired and merged.
//!
//! * [`frame_limit`]: largest number of datagrams in a frame;
//! * [`identity`]: marks in the source address and in Idx, which identify received frames;
//! * [`merge`]: combines the data of two copies, by command (protocol 9.3);
//! * [`monitor`]: whether the ring is closed, from the links on which the copies arrive (protocol 9.2.1).
//!
//! With a single link the same code runs, and waits for one copy.

pub mod frame_limit;
pub mod identity;
pub mod merge;
pub mod monitor;

pub use frame_limit::{FrameLimit, MIN_DATAGRAMS_PER_FRAME};
pub use identity::{Class, Classified, FrameCopy, Identity, Sequence};
#[cfg(feature = "standby")]
pub(crate) use identity::{foreign_frame, is_forwarded};
pub use merge::MergeRule;
pub use monitor::{Arrivals, RingMonitor, RingState};

/// Frames of a class that may be on the wire at once. Ids are compared within 15 bits, so recognition needs no such
/// limit (protocol SM-03); it bounds memory and the number of frames that a broken segment can delay.
pub const MAX_IN_FLIGHT: usize = 96;
