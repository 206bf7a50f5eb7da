//! A state of one SubDevice requested by the application while the others continue; it is kept until another one is
//! requested.
//!
//! The SubDevice changes to it by the shortest path. All of its process data ends or begins at the same time, and no
//! domain expects it meanwhile. A SubDevice that loses its power is brought back to the last requested state. After a
//! refusal it is brought back to its previous state.

use alloc::rc::Rc;
use core::cell::RefCell;
use core::future::Future;
use core::pin::pin;

use ringcat_wire::al::AlState;

use super::configure::{BringUp, ConfigureError};
use super::read_again::read_again;
use super::recover::{bring_up, failure, is_of_bus, keep_up, no_setup, while_current};
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
    bus: &Bus,
    segment: &SharedSegment,
    index: usize,
    state: AlState,
) -> impl Future<Output = Result<(), ConfigureError>> + use<> {
    let segment = segment.clone();
    let result = Slot::default();
    match check(&segment, index, state) {
        Ok(()) => begin(bus, &segment, index, state, &result),
        Err(error) => *result.borrow_mut() = Some(Err(error)),
    }
    let attempt = attempt_of(&segment, index);
    async move {
        segment
            .until(|model| {
                let is_over = model.member(index).is_none_or(|member| member.attempt != attempt);
                result.borrow_mut().take().or_else(|| is_over.then_some(Err(ConfigureError::Interrupted)))
            })
            .await
    }
}

fn attempt_of(segment: &SharedSegment, index: usize) -> u32 {
    segment.view().member(index).map_or(0, |member| member.attempt)
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

type Slot = Rc<RefCell<Option<Result<(), ConfigureError>>>>;

fn begin(bus: &Bus, segment: &SharedSegment, index: usize, state: AlState, result: &Slot) {
    let (phase, before) = {
        let view = segment.view();
        let Some(member) = view.member(index) else { return };
        (member.phase, member.target)
    };
    segment.observe(Observation::Requested { subdevice: Addressed::Member(index), state });
    match phase {
        Phase::Absent => *result.borrow_mut() = Some(Err(ConfigureError::Absent)),
        Phase::Settled(is) if is == state => *result.borrow_mut() = Some(Ok(())),
        Phase::Settled(_) | Phase::Configuring => {
            let attempt = attempt_of(segment, index);
            let (bus, segment, result) = (bus.clone(), segment.clone(), result.clone());
            bus.clone().spawn(async move {
                let procedure = pin!(go(&bus, &segment, (index, attempt), before, &result));
                while_current(&segment, index, attempt, procedure).await;
            });
        }
    }
}

async fn go(bus: &Bus, segment: &SharedSegment, (index, attempt): (usize, u32), before: AlState, result: &Slot) {
    match travel(bus, segment, (index, attempt), before).await {
        Ok(state) => {
            *result.borrow_mut() = Some(Ok(()));
            segment.observe_member((index, attempt), MemberFinding::Reached(state));
        }
        Err(error) => {
            bus.report(failure(index, &error));
            // A SubDevice that the frames did not reach has not refused.
            let has_refused = !is_of_bus(&error);
            *result.borrow_mut() = Some(Err(error));
            if has_refused {
                segment.observe_member((index, attempt), MemberFinding::Refused(before));
            } else {
                segment.notify();
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
        let to_init = BringUp { target: AlState::Init, ..bring_up(bus, segment, member)? };
        to_init.run(Start::Unknown).await?;
        read_again(bus, segment, member).await;
    }
    let bring_up = bring_up(bus, segment, member)?;
    bring_up.travel().await.map(|()| bring_up.target)
}
