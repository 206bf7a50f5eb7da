//! Events as lines of text for operators: which SubDevice or cable, what happened, expected and found values.
//!
//! Positions are places on the bus, indices are places in the declaration; a line names which of the two it gives.

mod clocks;
mod messages;
mod names;
mod ring;
mod scan;
#[cfg(feature = "standby")]
mod standby;
mod subdevices;

use ringcat_engine::domain::DomainState;
use ringcat_engine::event::{Event, TimedEvent};
use ringcat_wire::frame::MacAddress;

pub use messages::message;
pub use names::{Names, address};

/// The source address of a frame, if it is long enough to have one.
pub fn address_of_sender(frame: &[u8]) -> Option<MacAddress> {
    frame.get(6..12)?.try_into().ok().map(MacAddress)
}

/// An event in one line.
pub fn describe(timed: &TimedEvent, names: &Names) -> String {
    let TimedEvent { event, occupants, .. } = timed;
    let line = scan::describe(event, names, *occupants)
        .or_else(|| ring::describe(event, names, *occupants))
        .or_else(|| ring::junction(event, names))
        .or_else(|| subdevices::describe(event, names, *occupants))
        .or_else(|| clocks::describe(event, names, *occupants))
        .or_else(|| messages::of_command(event, names, *occupants))
        .or_else(|| of_process_data(event));
    #[cfg(feature = "standby")]
    let line = line.or_else(|| standby::describe(event, names));
    // Every known event has a line; a newer engine may report others.
    line.unwrap_or_else(|| format!("{event:?}"))
}

fn of_process_data(event: &Event) -> Option<String> {
    Some(match event {
        Event::Domain { domain, status, incomplete } => {
            let ended = match (status.state, *incomplete) {
                (DomainState::Complete, 1) => ", after 1 incomplete cycle".to_owned(),
                (DomainState::Complete, cycles @ 2..) => format!(", after {cycles} incomplete cycles"),
                _ => String::new(),
            };
            let state = status.in_words();
            format!("domain {domain}: {state}, working counter {} of {}{ended}", status.wkc, status.expected)
        }
        Event::Skipped { domain } => {
            format!("domain {domain}: cycle skipped, the frames of the previous cycle have not come back")
        }
        Event::ForeignFrame { arrived_on, bytes } => {
            let source = address_of_sender(bytes).map_or_else(String::new, |mac| format!(" from {}", address(mac)));
            format!("another MainDevice sends: {} bytes on {arrived_on}{source}", bytes.len())
        }
        _ => return None,
    })
}
