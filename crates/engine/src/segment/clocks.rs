//! What is known of the clocks of a segment (protocol 7): where they are, what was measured and written, which are the
//! references, how far the others are from them. What follows from observations is in [`super::rules`].

mod life;
mod measured;
mod node;
mod observation;
mod state;
mod status;

pub use life::Due;
pub(super) use life::{Compensation, Delays, Life, Lock, Running, Unwritten};
pub use measured::Measured;
pub use node::Node;
pub use observation::{Answer, ClockObservation, Difference};
pub use state::Clocks;
pub use status::{ClockStatus, HiddenDelay};
