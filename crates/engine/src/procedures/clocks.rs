//! Distributed clocks: set up, brought together, watched (protocol 7).
//!
//! * `measure`: who is connected to whom now, and what frames take from clock to clock;
//! * `set_up`: propagation delays, offsets, filters;
//! * `signals`: SYNC signals of one SubDevice;
//! * `watch`: the static drift phase, who is locked, whose time each link distributes.
//!
//! What they know about the clocks is in [`SharedClocks`](super::shared_clocks::SharedClocks), which the bring-up of
//! SubDevices looks at too.

mod changes;
mod measure;
mod not_locked;
mod set_up;
mod signals;
mod watch;

pub use not_locked::NotLocked;
pub(super) use not_locked::SignalsError;
pub(super) use signals::{restore, start_signals, wait_for_lock};
pub(crate) use watch::{begin, keep};
