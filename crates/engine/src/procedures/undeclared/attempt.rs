//! One attempt to bring a SubDevice without a declaration to its requested state.

use alloc::string::ToString;
use core::future::{Future, poll_fn};
use core::pin::{Pin, pin};
use core::task::Poll;

use super::bring::Bringing;
use crate::procedures::configure::ConfigureError;
use crate::procedures::recover::is_of_bus;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::{AttemptFailure, SubDeviceKey, UndeclaredObservation};
use crate::supervisor::Bus;

/// Runs an attempt as long as it is the current one of its SubDevice.
pub(in crate::procedures) async fn bring_undeclared(
    bus: Bus,
    segment: SharedSegment,
    (key, attempt): (SubDeviceKey, u32),
) {
    let result = while_current(&segment, (key, attempt), pin!(run(&bus, &segment, key))).await;
    let Some(result) = result else { return };
    let failure =
        result.as_ref().err().map(|error| AttemptFailure { is_of_bus: is_of_bus(error), reason: error.to_string() });
    segment.undeclared.end(key, attempt, result);
    segment.observe_undeclared(UndeclaredObservation::AttemptEnded { key, attempt, failure });
}

async fn run(bus: &Bus, segment: &SharedSegment, key: SubDeviceKey) -> Result<(), ConfigureError> {
    let known = {
        let view = segment.view();
        let info = view.unassigned(key).and_then(|it| it.knowledge.info()).cloned();
        info.zip(view.upkeep(key).map(|upkeep| upkeep.target))
    };
    let (Some((info, target)), Some(mailbox)) = (known, segment.undeclared.of(key)) else {
        return Err(ConfigureError::NoSetup);
    };
    Bringing { bus, segment, key, info, mailbox }.bring(target).await
}

/// Runs an attempt until another one begins or the SubDevice has left. It is pinned by the caller: a future that an
/// async function takes by value is in that function's memory twice.
async fn while_current<T>(
    segment: &SharedSegment,
    (key, attempt): (SubDeviceKey, u32),
    mut work: Pin<&mut impl Future<Output = T>>,
) -> Option<T> {
    poll_fn(|context| {
        if !segment.view().upkeep(key).is_some_and(|upkeep| upkeep.is_under_way(attempt)) {
            return Poll::Ready(None);
        }
        work.as_mut().poll(context).map(Some)
    })
    .await
}
