//! The ring: every frame leaves on all links with a frame id, its copies are recognised, paired and merged.
//!
//! * [`frame_limit`]: how many datagrams a frame may hold;
//! * [`identity`]: marks in the source address and in Idx; which received frame is which of ours;
//! * [`merge`]: what becomes of the data of two copies, by command (protocol 9.3);
//! * [`monitor`]: whether the ring is closed, from where the copies arrive (protocol 9.2.1).
//!
//! A single link is a ring of one: same code, one copy to wait for.

pub mod frame_limit;
pub mod identity;
pub mod merge;
pub mod monitor;

pub use frame_limit::{FrameLimit, MIN_DATAGRAMS_PER_FRAME};
pub use identity::{Class, Classified, FrameCopy, Identity, Sequence};
pub use merge::MergeRule;
pub use monitor::{Arrivals, RingMonitor, RingState};

/// Frames of a class that may be in flight at once. Ids are compared within 15 bits, so this is not what limits
/// recognition (protocol SM-03); it bounds memory and what a broken segment can keep waiting.
pub const MAX_IN_FLIGHT: usize = 96;
