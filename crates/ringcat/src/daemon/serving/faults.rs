//! What questions may contain, and how long their answers may take.

use std::time::Duration;

use ringcat_control::refusal::Refusal;

/// Longest time for a service of a SubDevice, and for a scan.
pub(super) const LIMIT: Duration = Duration::from_secs(20);
/// Highest drive behind a SubDevice.
const MAX_DRIVE: u8 = 7;

/// Something else was expected.
pub(super) fn expected(expected: &str) -> Refusal {
    Refusal::Unexpected { expected: expected.to_owned() }
}

/// The number of a drive behind a SubDevice.
///
/// # Errors
/// There is no drive with this number.
pub(super) fn drive(number: u8) -> Result<u8, Refusal> {
    if number <= MAX_DRIVE {
        Ok(number)
    } else {
        Err(expected(&format!("a drive from 0 to {MAX_DRIVE}, not {number}")))
    }
}
