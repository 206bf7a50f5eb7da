//! Lines for events of distributed clocks.

use ringcat_engine::event::Event;
use ringcat_engine::ring_status::Occupant;

use super::names::Names;

pub(super) fn describe(event: &Event, names: &Names, ends: [Option<Occupant>; 2]) -> Option<String> {
    Some(match event {
        Event::ClocksLocked { largest_ns } => format!("all clocks are locked, within {largest_ns} ns"),
        Event::ReferenceClock { position: Some(position) } => {
            format!("reference clock: {}", names.at(*position, ends[0]))
        }
        Event::ReferenceClock { position: None } => {
            "no reference clock: no SubDevice with a distributed clock answers".to_owned()
        }
        Event::DelaysChanged { clocks, largest_ns } => {
            format!("propagation delays of {clocks} clocks have changed, by {largest_ns} ns at most")
        }
        Event::DelayUnknown { position, fork, range, is_estimated } => {
            let why = fork.map_or_else(
                || "the path from the reference clock is unknown".to_owned(),
                |fork| format!("the fork at position {fork} has no clock"),
            );
            let range = range.map_or_else(String::new, |range| format!(", {range}"));
            let written = if *is_estimated { "the middle of the range is used" } else { "no delay is set" };
            let at = names.at(*position, ends[0]);
            format!("the propagation delay of {at} cannot be measured: {why}{range}; {written}")
        }
        Event::WentOnUnlocked { subdevice, reason } => {
            format!("{}: goes on although clocks are not locked: {reason}", names.of(*subdevice))
        }
        Event::ApplicationTime { jump_ns, shift_ns: 0 } => {
            format!("the system time of all clocks is the application's time: changed by {jump_ns} ns")
        }
        Event::ApplicationTime { shift_ns, .. } => {
            format!("the application's time has jumped, SYNC signals go on: it is the system time plus {shift_ns} ns")
        }
        Event::ClocksFailed { reason } => format!("distributed clocks: {reason}"),
        Event::SyncWindow { inside: true, spread_ns } => format!("clocks within the sync window: {spread_ns} ns"),
        Event::SyncWindow { inside: false, spread_ns } => format!("clocks outside the sync window: {spread_ns} ns"),
        _ => return None,
    })
}
