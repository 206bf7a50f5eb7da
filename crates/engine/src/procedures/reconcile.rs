//! Starts the procedures that the model of the segment requests. They are started only here.

use super::cabling::examine;
use super::clocks::compensate_drift;
use super::junction::isolate_rings;
use super::presence::prove_inputs;
use super::recover::bring_up_member;
use super::shared_segment::{SharedSegment, until_active};
use super::supervise::run_round;
use super::unassigned::read_unassigned;
use super::unassigned::rescan::follow_groups;
use super::undeclared::{bring_undeclared, keep_outputs};
use crate::segment::effect::Task;
use crate::supervisor::Bus;

/// Starts requested procedures until an application is active: then those that it needs are started with its data.
pub(crate) async fn reconcile_without_application(bus: Bus, segment: SharedSegment) {
    until_active(&segment, reconcile(bus, segment.clone())).await;
}

/// Starts requested procedures. Runs until the MainDevice stops.
pub(crate) async fn reconcile(bus: Bus, segment: SharedSegment) {
    loop {
        let (own_bus, own) = (bus.clone(), segment.clone());
        match segment.next_task().await {
            Task::Round { routine } => bus.spawn(run_round(own_bus, own, routine)),
            Task::BringUp { index, attempt, from, reported, check } => {
                bus.spawn(bring_up_member(own_bus, own, (index, attempt), from, reported, check));
            }
            Task::ProveInputs { index, mapping } => bus.spawn(prove_inputs(own_bus, own, index, mapping)),
            Task::ReadUnassigned { key } => bus.spawn(read_unassigned(own_bus, own, key)),
            Task::BringUndeclared { key, attempt } => bus.spawn(bring_undeclared(own_bus, own, (key, attempt))),
            Task::KeepOutputs { key, attempt } => bus.spawn(keep_outputs(own_bus, own, (key, attempt))),
            Task::ExamineCabling { in_control } => bus.spawn(examine(own_bus, own, in_control)),
            Task::IsolateRings => bus.spawn(isolate_rings(own_bus, own)),
            Task::CompensateDrift => bus.spawn(compensate_drift(own_bus, own)),
            Task::FollowGroups => bus.spawn(follow_groups(own_bus, own)),
        }
    }
}
