//! Starts the procedures that the model of the segment requests. They are started only here.

use super::cabling::examine;
#[cfg(feature = "standby")]
use super::clocks::keep_adopted_clocks;
use super::clocks::{compensate_drift, keep_clocks};
use super::complete_siis::complete_in_background;
use super::error_watch::watch_errors;
use super::idle::{follow_change, read_states, scan_segment, watch};
use super::junction::isolate_rings;
use super::mail_watch::watch_mail;
use super::presence::prove_inputs;
use super::recover::bring_up_member;
use super::request_state::{change_state, repeat_state};
use super::scan::ScanOptions;
use super::serve_requests::{Requests, serve_requests};
use super::services::statistics::collect;
use super::shared_segment::{SharedSegment, until_active};
use super::supervise::{run_round, supervise};
use super::unassigned::read_unassigned;
use super::unassigned::rescan::follow_groups;
use super::undeclared::{bring_undeclared, keep, keep_outputs, read_dictionaries, read_pdos, watch_undeclared_mail};
use super::verify::verify;
use crate::segment::effect::{Task, Watch};
use crate::supervisor::Bus;

/// What some procedures need beside the model.
#[derive(Clone)]
pub(crate) struct Companions {
    /// Options of scans without an application.
    pub options: ScanOptions,
    /// Requests of the cyclic thread.
    pub requests: Requests,
}

/// Starts requested procedures until an application is active: then those that it needs are started with its data.
pub(crate) async fn reconcile_without_application(bus: Bus, segment: SharedSegment, companions: Companions) {
    until_active(&segment, reconcile(bus, segment.clone(), companions)).await;
}

/// Starts requested procedures. Runs until the MainDevice stops.
pub(crate) async fn reconcile(bus: Bus, segment: SharedSegment, companions: Companions) {
    loop {
        let (own_bus, own) = (bus.clone(), segment.clone());
        match segment.next_task().await {
            Task::Round { routine } => bus.spawn(run_round(own_bus, own, routine)),
            Task::BringUp { index, attempt, from, reported, check } => {
                bus.spawn(bring_up_member(own_bus, own, (index, attempt), from, reported, check));
            }
            Task::ChangeState { index, attempt, before } => {
                bus.spawn(change_state(own_bus, own, (index, attempt), before));
            }
            Task::RepeatState { index, attempt } => bus.spawn(repeat_state(own_bus, own, (index, attempt))),
            Task::ProveInputs { index, mapping } => bus.spawn(prove_inputs(own_bus, own, index, mapping)),
            Task::ReadUnassigned { key } => bus.spawn(read_unassigned(own_bus, own, key)),
            Task::BringUndeclared { key, attempt } => bus.spawn(bring_undeclared(own_bus, own, (key, attempt))),
            Task::ReadPdos { key, attempt } => bus.spawn(read_pdos(own_bus, own, (key, attempt))),
            Task::KeepOutputs { key, attempt } => bus.spawn(keep_outputs(own_bus, own, (key, attempt))),
            Task::ScanSegment { number } => {
                bus.spawn(scan_segment(own_bus, own, companions.options.clone(), number));
            }
            Task::FollowChange(change) => {
                bus.spawn(follow_change(own_bus, own, companions.options.clone(), change));
            }
            Task::ReadStates => bus.spawn(read_states(own_bus, own)),
            Task::Watch(watch) => start_watch(watch, own_bus, own, &companions),
            Task::ExamineCabling { in_control } => bus.spawn(examine(own_bus, own, in_control)),
            Task::IsolateRings => bus.spawn(isolate_rings(own_bus, own)),
            Task::CompensateDrift => bus.spawn(compensate_drift(own_bus, own)),
            Task::FollowGroups => bus.spawn(follow_groups(own_bus, own)),
        }
    }
}

fn start_watch(which: Watch, bus: Bus, segment: SharedSegment, companions: &Companions) {
    let own = bus.clone();
    match which {
        Watch::Clocks => bus.spawn(keep_clocks(own, segment)),
        #[cfg(feature = "standby")]
        Watch::AdoptedClocks => bus.spawn(keep_adopted_clocks(own, segment)),
        Watch::Supervision => bus.spawn(supervise(own, segment)),
        Watch::Registers => bus.spawn(verify(own, segment)),
        Watch::Errors => bus.spawn(watch_errors(own, segment)),
        Watch::Siis => bus.spawn(complete_in_background(own, segment)),
        Watch::Mail => bus.spawn(watch_mail(own, segment)),
        Watch::Requests => bus.spawn(serve_requests(own, segment, companions.requests.clone())),
        Watch::Statistics => bus.spawn(collect(own, segment)),
        Watch::Idle => bus.spawn(watch(own, segment)),
        Watch::Undeclared => bus.spawn(keep(own, segment)),
        Watch::UndeclaredMail => bus.spawn(watch_undeclared_mail(own, segment)),
        Watch::Dictionaries => bus.spawn(read_dictionaries(own, segment)),
    }
}
