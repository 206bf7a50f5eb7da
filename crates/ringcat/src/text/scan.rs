//! Lines for events of a scan and for faults of the cabling.

use ringcat_engine::event::Event;
use ringcat_engine::ring_status::Occupant;

use super::names::Names;

pub(super) fn describe(event: &Event, names: &Names, ends: [Option<Occupant>; 2]) -> Option<String> {
    let at = |position| names.at(position, ends[0]);
    Some(match event {
        Event::Counted { main, redundant } => format!("SubDevices answering: {main} on MAIN, {redundant} on REDUNDANT"),
        Event::ScanProgress { done, total } => format!("scanning: {done} of {total} SubDevices read"),
        Event::SegmentChanged { subdevices, added, removed } => {
            format!("the segment has changed: {subdevices} SubDevices, {added} added, {removed} removed")
        }
        Event::Resumed { subdevices, in_state, differs } => {
            let found = if *differs { "it has changed, and what differs was scanned" } else { "it is as known" };
            format!("going on with the segment of another process: {found}; {in_state} of {subdevices} SubDevices stay")
        }
        Event::ConversationCut { position, protocol } => {
            format!("{}: a conversation of the former owner in {protocol:?} was cut by the hand-over", at(*position))
        }
        Event::ScanFinished { subdevices } => format!("scan finished: {subdevices} SubDevices"),
        Event::ScanFailed { reason } => format!("scan failed: {reason}"),
        Event::SiiWarning { position, what } => format!("{}: SII: {what}", at(*position)),
        Event::CablingWarning { position, what } => format!("{}: {what}", at(*position)),
        Event::UnconnectedPort0 { position } => format!("{}: port 0 is not connected", at(*position)),
        Event::LineCrossed { position: Some(position), entry_port: Some(port) } => {
            format!("{}: line crossed, frames enter at port {port}", at(*position))
        }
        Event::LineCrossed { .. } => {
            "line crossed: SubDevices answer on REDUNDANT although the ring is closed. At one \
                                      SubDevice IN and OUT are swapped, or a branch is connected to port 2"
                .to_owned()
        }
        Event::CannotDisconnect { link } => format!(
            "{link} cannot be taken down (CAP_NET_ADMIN is missing): crossed lines in a closed ring cannot be located"
        ),
        Event::InterfacesSwapped => {
            "interfaces swapped: MAIN is connected to the end of the ring, REDUNDANT to its beginning".to_owned()
        }
        Event::DuplicateAlias { alias, first, second } => {
            let [first, second] = [first, second].map(|position| names.at(*position, None));
            format!("alias {alias} is used twice: {first} and {second}")
        }
        Event::FrameLimit { limit } => limit.to_string(),
        _ => return None,
    })
}
