//! A state of one SubDevice requested by the application while the others continue; it is kept until another one is
//! requested.
//!
//! The SubDevice changes to it by the shortest path. All of its process data ends or begins at the same time, and no
//! domain expects it meanwhile. A SubDevice that loses its power is brought back to the last requested state. After a
//! refusal it is brought back to its previous state.

use core::future::Future;
use core::pin::pin;

use ringcat_wire::al::AlState;

use super::configure::ConfigureError;
use super::read_again::read_again;
use super::recover::{bring_up, is_of_bus, keep_up, no_setup, problem, while_current};
use super::shared_segment::SharedSegment;
use crate::segment::member::Phase;
use crate::segment::start::Start;
use crate::segment::{Addressed, MemberFinding, Observation};
use crate::supervisor::Bus;

/// Whether process data may be exchanged in a state.
pub(crate) const fn exchanges(state: AlState) -> bool {
    matches!(state, AlState::SafeOp | AlState::Op)
}

/// Brings a SubDevice to a state. The procedure continues also if its result is not awaited.
pub(crate) fn request_state(
    segment: &SharedSegment,
    index: usize,
    state: AlState,
) -> impl Future<Output = Result<(), ConfigureError>> + use<> {
    let mut decided = match check(segment, index, state) {
        Ok(()) => begin(segment, index, state),
        Err(error) => Some(Err(error)),
    };
    let segment = segment.clone();
    let attempt = segment.view().member(index).map_or(0, |member| member.attempt);
    async move {
        segment
            .until(|model| {
                let is_over = model.member(index).is_none_or(|member| member.attempt != attempt);
                let result = decided.take().or_else(|| segment.results.of(index, attempt));
                result.or_else(|| is_over.then_some(Err(ConfigureError::Interrupted)))
            })
            .await
    }
}

/// Errors that are detected before anything is changed.
fn check(segment: &SharedSegment, index: usize, state: AlState) -> Result<(), ConfigureError> {
    let view = segment.view();
    let member = view.member(index).ok_or(ConfigureError::NoSetup)?;
    match &member.setup {
        Some(setup) if state == AlState::Boot && setup.plan.bootstrap.is_empty() => Err(ConfigureError::NoBoot),
        None if member.unfit.is_some() => Err(no_setup(&member)),
        Some(_) | None => Ok(()),
    }
}

/// The result, if it is known at once.
fn begin(segment: &SharedSegment, index: usize, state: AlState) -> Option<Result<(), ConfigureError>> {
    let phase = segment.view().member(index).map(|member| member.phase);
    segment.observe(Observation::Requested { subdevice: Addressed::Member(index), state });
    match phase? {
        Phase::Absent => Some(Err(ConfigureError::Absent)),
        Phase::Settled(is) if is == state && !segment.view().member(index)?.has_commands_within(state) => Some(Ok(())),
        Phase::Settled(_) | Phase::Configuring => None,
    }
}

/// Sends the commands of a member whose state is requested again.
pub(super) async fn repeat_state(bus: Bus, segment: SharedSegment, (index, attempt): (usize, u32)) {
    let procedure = pin!(async {
        let stayed = match bring_up(&bus, &segment, (index, attempt)) {
            Ok(bring_up) => bring_up.stay().await.map(|()| bring_up.target),
            Err(error) => Err(error),
        };
        finish(&bus, &segment, (index, attempt), None, stayed).await;
    });
    while_current(&segment, index, attempt, procedure).await;
}

/// Changes a member to its new target state while the attempt is the current one; after a refusal back to the state
/// before.
pub(super) async fn change_state(bus: Bus, segment: SharedSegment, (index, attempt): (usize, u32), before: AlState) {
    let procedure = pin!(go(&bus, &segment, (index, attempt), before));
    while_current(&segment, index, attempt, procedure).await;
}

async fn go(bus: &Bus, segment: &SharedSegment, (index, attempt): (usize, u32), before: AlState) {
    let travelled = travel(bus, segment, (index, attempt), before).await;
    finish(bus, segment, (index, attempt), Some(before), travelled).await;
}

/// The result for the application, and for the model. A SubDevice that has refused is brought back to its target state
/// `before`, if that was another one.
async fn finish(
    bus: &Bus,
    segment: &SharedSegment,
    (index, attempt): (usize, u32),
    before: Option<AlState>,
    result: Result<AlState, ConfigureError>,
) {
    match result {
        Ok(state) => {
            segment.results.end(index, attempt, Ok(()));
            segment.observe_member((index, attempt), MemberFinding::Reached(state));
        }
        Err(error) => {
            // A SubDevice that the frames did not reach has not refused.
            let has_refused = !is_of_bus(&error);
            let failed = MemberFinding::Failed(problem(&error));
            segment.results.end(index, attempt, Err(error));
            segment.observe_member((index, attempt), failed);
            if let Some(before) = before.filter(|_| has_refused) {
                segment.observe_member((index, attempt), MemberFinding::Refused(before));
            }
            keep_up(bus, segment, (index, attempt), Start::Unknown, None).await;
        }
    }
}

async fn travel(
    bus: &Bus,
    segment: &SharedSegment,
    member: (usize, u32),
    before: AlState,
) -> Result<AlState, ConfigureError> {
    if before == AlState::Boot {
        bring_up(bus, segment, member)?.leave_boot().await?;
        read_again(bus, segment, member).await;
        let bring_up = bring_up(bus, segment, member)?;
        return bring_up.up_from_boot().await.map(|()| bring_up.target);
    }
    let bring_up = bring_up(bus, segment, member)?;
    bring_up.travel().await.map(|()| bring_up.target)
}
