//! Data of the clocks of a segment (protocol 7): positions, measured and written values, the references, the
//! differences. The effects of observations are in [`super::rules`].

mod asked;
mod life;
mod node;
mod observation;
mod state;
mod status;
mod timeline;

pub use asked::{ClockKey, ClockVersions};
pub use life::Due;
pub(super) use life::{Compensation, Delays, Life, Lock, Running, Unwritten};
pub use node::Node;
#[cfg(feature = "standby")]
pub use observation::{AdoptedClock, AdoptedClocks};
pub use observation::{Answer, Answers, ClockFinding, ClockObservation, Difference, LatchedTimes};
pub use state::Clocks;
pub use status::{ClockStatus, HiddenDelay};
pub(super) use timeline::Step;
