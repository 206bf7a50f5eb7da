//! A state of a SubDevice without a declaration, requested by the application.

use alloc::rc::Rc;

use core::future::Future;

use ringcat_wire::address::Position;
use ringcat_wire::al::AlState;

use super::keep::run;
use crate::info::SubDeviceInfo;
use crate::procedures::configure::ConfigureError;
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;

/// Brings the SubDevice at a position to a state. The procedure continues also if its result is not awaited.
pub(crate) fn request(
    bus: &Bus,
    segment: &SharedSegment,
    (position, info): (Position, &Rc<SubDeviceInfo>),
    state: AlState,
) -> impl Future<Output = Result<(), ConfigureError>> + use<> {
    let undeclared = segment.undeclared.clone();
    let (attempt, is_new) = undeclared.request(position, info, state);
    if is_new {
        bus.spawn(run(bus.clone(), undeclared.clone(), attempt.clone()));
    }
    async move { undeclared.result(&attempt).await }
}
