//! Events as `tracing` events, for an application that logs by a subscriber (feature `tracing`).
//!
//! The acyclic half reports each event once, in its own thread if it has one, with the target `ringcat`, the text of
//! [`describe`] and the field `at_ns`. Events that impair process data or redundancy are warnings, states of single
//! cycles are debug messages, all others are information. The cyclic half itself reports nothing. Messages have the
//! target `ringcat::messages`: steps are debug messages, frames are traces; their level and subjects are those of
//! `Services::set_log_filter`.

use ringcat_engine::event::{Event, MessageContent, TimedEvent};
use ringcat_engine::main_device::MainDevice as Engine;
use tracing::{Level, enabled, event};

use crate::text::{Names, describe, message};

const TARGET: &str = "ringcat";
const MESSAGES: &str = "ringcat::messages";

/// Records an event.
pub(crate) fn record(timed: &TimedEvent) {
    match level(&timed.event) {
        Level::WARN if enabled!(target: TARGET, Level::WARN) => {
            event!(target: TARGET, Level::WARN, at_ns = timed.at.0, "{}", describe(timed, &Names::default()));
        }
        Level::DEBUG if enabled!(target: TARGET, Level::DEBUG) => {
            event!(target: TARGET, Level::DEBUG, at_ns = timed.at.0, "{}", describe(timed, &Names::default()));
        }
        Level::INFO if enabled!(target: TARGET, Level::INFO) => {
            event!(target: TARGET, Level::INFO, at_ns = timed.at.0, "{}", describe(timed, &Names::default()));
        }
        _ => {}
    }
}

/// Records the messages since the last call.
pub(crate) fn record_messages(engine: &mut Engine) {
    while let Some(next) = engine.pop_message() {
        match next.content {
            MessageContent::Step(_) if enabled!(target: MESSAGES, Level::DEBUG) => {
                event!(target: MESSAGES, Level::DEBUG, at_ns = next.at.0, "{}", message(&next));
            }
            MessageContent::Sent { .. } | MessageContent::Received { .. } if enabled!(target: MESSAGES, Level::TRACE) =>
            {
                event!(target: MESSAGES, Level::TRACE, at_ns = next.at.0, "{}", message(&next));
            }
            _ => {}
        }
    }
}

const fn level(event: &Event) -> Level {
    match event {
        Event::Domain { .. } | Event::Skipped { .. } | Event::ScanProgress { .. } => Level::DEBUG,
        Event::ScanFailed { .. }
        | Event::RingOpened { .. }
        | Event::BreakLocated { .. }
        | Event::RedundancyLost { .. }
        | Event::CableErrors { .. }
        | Event::LinkDown { .. }
        | Event::LineCrossed { .. }
        | Event::StateError { .. }
        | Event::ConfigurationFailed { .. }
        | Event::Lost { .. }
        | Event::Missing { .. }
        | Event::Mismatch { .. }
        | Event::ClocksFailed { .. }
        | Event::WentOnUnlocked { .. }
        | Event::Emergency { .. }
        | Event::ForeignFrame { .. } => Level::WARN,
        _ => Level::INFO,
    }
}
