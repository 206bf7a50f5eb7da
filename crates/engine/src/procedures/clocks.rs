//! Distributed clocks: set-up, lock, supervision (protocol 7).
//!
//! * `measure`: the present connections of the SubDevices, and the times of frames from clock to clock;
//! * `adopt`: clocks that another MainDevice has set up (feature `standby`);
//! * `set_up`: propagation delays, offsets, filters;
//! * `offsets`: another time of the application;
//! * `slide`: the rest of a jump of that time while SYNC signals run;
//! * `signals`: SYNC signals of one SubDevice;
//! * `drift`: the static drift compensation;
//! * `watch`: the set-up, the differences, the links of the references.
//!
//! They pass measured, written and read values to the model of the segment (`segment`), which contains the
//! state of the clocks and decides the next step.

#[cfg(feature = "standby")]
mod adopt;
mod changes;
mod drift;
mod measure;
mod not_locked;
mod offsets;
mod set_up;
mod signals;
mod slide;
mod watch;

#[cfg(feature = "standby")]
pub(super) use adopt::keep_adopted_clocks;
pub(super) use drift::compensate_drift;
pub use not_locked::NotLocked;
pub(super) use not_locked::SignalsError;
pub(super) use signals::{restore, start_signals, wait_for_lock};
pub(super) use watch::keep_clocks;
