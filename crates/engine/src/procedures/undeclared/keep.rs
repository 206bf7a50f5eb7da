//! Keeps SubDevices without a declaration in their requested states.

use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::AlState;

use super::bring::{bring, keep_outputs};
use super::registry::{Attempt, Undeclared};
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::procedures::recover::is_of_bus;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::{Reading, Segment};
use crate::supervisor::Bus;

/// Starts attempts as soon as they are due. Runs until the MainDevice stops.
pub(crate) async fn keep(bus: Bus, undeclared: Undeclared) {
    loop {
        for attempt in undeclared.take_due() {
            bus.spawn(run(bus.clone(), undeclared.clone(), attempt));
        }
        undeclared.until_due().await;
    }
}

/// Runs attempts as they fall due, until all are in their requested states.
pub(crate) async fn run_due(bus: &Bus, undeclared: &Undeclared) {
    while !undeclared.are_settled() {
        for attempt in undeclared.take_due() {
            bus.spawn(run(bus.clone(), undeclared.clone(), attempt));
        }
        undeclared.until_due().await;
    }
}

/// States were read: reports those that were left without a request.
pub(crate) fn report_left(bus: &Bus, undeclared: &Undeclared, readings: &[(StationAddress, Reading)]) {
    for (position, status, code) in undeclared.observe(readings) {
        bus.report(Event::UndeclaredState { position, status, code });
    }
}

/// One attempt, as long as it is the current one.
pub(super) async fn run(bus: Bus, undeclared: Undeclared, attempt: Attempt) {
    let Some(result) = while_current(&undeclared, &attempt, bring(&bus, &attempt)).await else { return };
    let is_bus = result.as_ref().is_err_and(is_of_bus);
    let reason = result.as_ref().err().map(ToString::to_string);
    let place = undeclared.position_of(&attempt);
    if result.is_ok() && attempt.target == AlState::Op {
        bus.spawn(keep_outputs(bus.clone(), undeclared.clone(), attempt.clone()));
    }
    if undeclared.end(&attempt, result, is_bus)
        && undeclared.is_kept()
        && let (Some(position), Some(reason)) = (place, reason)
    {
        bus.report(Event::UndeclaredFailed { position, reason });
    }
}

/// Runs an attempt until another one begins or the SubDevice is gone.
async fn while_current<T>(undeclared: &Undeclared, attempt: &Attempt, work: impl Future<Output = T>) -> Option<T> {
    let mut work = pin!(work);
    poll_fn(|context| {
        if !undeclared.is_current(attempt) {
            return Poll::Ready(None);
        }
        work.as_mut().poll(context).map(Some)
    })
    .await
}

/// While an application is active: keeps the SubDevices that its declaration does not name. Runs until the MainDevice
/// stops.
pub(crate) async fn follow_unassigned(segment: SharedSegment) {
    let undeclared = segment.undeclared.clone();
    loop {
        let present = segment.until(|model| Some(without_declaration(model)).filter(|it| !undeclared.is_of(it))).await;
        undeclared.follow(&present);
    }
}

/// SubDevices that are known to be undeclared.
pub(crate) fn without_declaration(segment: &Segment) -> Vec<(Position, Rc<SubDeviceInfo>)> {
    let known = segment.subdevices().unassigned().filter(|it| it.is_undeclared());
    known.filter_map(|it| Some((it.position, it.knowledge.info()?.clone()))).collect()
}
