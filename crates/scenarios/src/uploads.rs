//! Reads of objects that go on beside a scenario.

use ringcat_engine::mail::Limits;
use ringcat_engine::mail::coe::{self, SdoAddress, SdoError};
use ringcat_engine::main_device::{Address, MainDevice, Pending};

/// Starts a read of an object of at most `limit` bytes.
///
/// # Panics
/// When the SubDevice has no mailbox.
pub fn start_upload(
    engine: &mut MainDevice,
    subdevice: impl Into<Address>,
    object: SdoAddress,
    limits: Limits,
    limit: usize,
) -> Pending<Result<Vec<u8>, SdoError>> {
    let mailbox = engine.mailbox(subdevice).expect("it has a mailbox");
    engine.start(async move { coe::read(&mailbox, object, limits, limit).await })
}
