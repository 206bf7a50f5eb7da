//! SubDevices without a declaration: their requested states, the attempts to reach them, their mailboxes.

mod keeping;
mod observation;
mod upkeep;

pub(super) use keeping::Keeping;
pub use observation::{KeptState, ShownState, StateRead, UndeclaredObservation};
pub use upkeep::{AttemptFailure, PdoReading, Upkeep, UpkeepProgress};
