//! A service of one SubDevice for the tool, its limits, and refusals.

use std::time::Duration;

use ringcat_control::message::Answer;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::MOST_FILE;
use ringcat_wire::address::Position;

use crate::limits::TransferLimits;
use crate::subdevice::SubDevice;
use crate::supervisor_thread::SupervisorThread;

/// Longest time for a service of a SubDevice.
const LIMIT: Duration = Duration::from_secs(20);
/// Longest time for what waits for flash memory; before the daemon gives up (`Query::limit`).
pub(super) const LONG: Duration = Duration::from_secs(590);

/// An answer with data that was read.
pub(super) type Answered = Result<(Answer, Vec<u8>), Refusal>;

/// A SubDevice whose services have a limit.
pub(super) fn subdevice(supervisor: &SupervisorThread, position: u16) -> SubDevice<&SupervisorThread> {
    supervisor.subdevice(Position(position)).within(LIMIT)
}

/// Limits for the largest value.
pub(super) fn largest() -> TransferLimits {
    TransferLimits::default().with_bytes(MOST_FILE)
}

/// The refusal of a wrong question.
pub(super) fn expected(expected: &str) -> Refusal {
    Refusal::Unexpected { expected: expected.to_owned() }
}
