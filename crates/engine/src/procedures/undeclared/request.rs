//! A state of a SubDevice without a declaration, requested by the application.

use core::future::Future;

use ringcat_wire::al::AlState;

use crate::procedures::configure::ConfigureError;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::{Addressed, Observation, SubDeviceKey, UpkeepProgress};

/// Brings a SubDevice to a state. The procedure continues also if its result is not awaited.
pub(crate) fn request(
    segment: &SharedSegment,
    key: SubDeviceKey,
    state: AlState,
) -> impl Future<Output = Result<(), ConfigureError>> + use<> {
    segment.observe(Observation::Requested { subdevice: Addressed::Undeclared(key), state });
    // The same request may be under way: then this is its attempt.
    let attempt = segment.view().upkeep(key).map(|upkeep| upkeep.attempt);
    let segment = segment.clone();
    async move {
        let attempt = attempt.ok_or(ConfigureError::NoSetup)?;
        segment
            .until(|model| {
                let is_over = model.upkeep(key).is_none_or(|upkeep| upkeep.attempt != attempt);
                let result = segment.undeclared.result(key, attempt);
                result.or_else(|| is_over.then_some(Err(ConfigureError::Interrupted)))
            })
            .await
    }
}

/// Waits until a SubDevice has reached a requested state (true), or another one is requested (false).
pub(crate) async fn until_decided(segment: &SharedSegment, key: SubDeviceKey, state: AlState) -> bool {
    segment
        .until(|model| {
            let upkeep = model.upkeep(key)?;
            (upkeep.target != state || upkeep.progress == UpkeepProgress::Reached).then_some(upkeep.target == state)
        })
        .await
}
