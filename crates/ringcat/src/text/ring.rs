//! Lines for events of the ring, of its cables, and of rings behind junctions.

use ringcat_engine::event::Event;
use ringcat_engine::ring_status::Occupant;

use super::names::Names;

pub(super) fn describe(event: &Event, names: &Names, ends: [Option<Occupant>; 2]) -> Option<String> {
    Some(match event {
        Event::RingOpened { main, redundant } => {
            format!("ring open: {main} SubDevices on MAIN, {redundant} on REDUNDANT")
        }
        Event::BreakLocated { cable } => format!("Line break {}", names.cable(*cable, ends)),
        Event::RingClosed { main, place, .. } => {
            let place = place.map_or_else(String::new, |cable| format!(" {}", names.cable(cable, ends)));
            format!("Line is fixed{place}: ring closed, {main} SubDevices on MAIN")
        }
        Event::RingUnsteady { changes } => {
            format!("ring unsteady: {changes} changes so far, the next report follows after one stable second")
        }
        Event::RedundancyLost { cause } => format!("redundancy lost: {cause}"),
        Event::RedundancyRegained => "redundancy restored: the ring tolerates one break".to_owned(),
        Event::CableErrors { cable, errors } => format!("CRC errors {}: {errors}", names.cable(*cable, ends)),
        Event::LinkDown { link } => format!("{link}: no carrier"),
        Event::LinkUp { link } => format!("{link}: the carrier is back"),
        _ => return None,
    })
}

/// Rings behind junctions.
pub(super) fn junction(event: &Event, names: &Names) -> Option<String> {
    Some(match event {
        Event::JunctionLearned { closing } => {
            let (head, tail) = (names.port(closing.head, None), names.port(closing.tail, None));
            format!("ring behind a junction found: its closing cable is from {tail} back to {head}")
        }
        Event::JunctionChanged { near, far, station, declared: [before, behind], broken, breaks } => {
            let before = near.map_or_else(|| "an unknown SubDevice".to_owned(), |near| names.port(near, *before));
            let station = station.map_or_else(String::new, |station| format!(" ({station})"));
            let place = format!("between {before} and {}{station}", names.port(*far, *behind));
            match (broken, breaks) {
                (true, 0 | 1) => format!("Line break {place}: the ring behind the junction works without this cable"),
                (true, _) => format!(
                    "Line break {place}: {breaks} cables of rings behind junctions are broken, only one is tolerated"
                ),
                (false, 0) => format!("Line is fixed {place}"),
                (false, _) => format!("Line is fixed {place}: broken cables left: {breaks}"),
            }
        }
        Event::JunctionsNotLearned { rings } => format!(
            "rings behind junctions without a known closing cable: {rings}. Scan again when no frames are lost, or \
             declare their connections (--junction strict)"
        ),
        Event::JunctionUnknown { rings } => format!(
            "{rings} rings behind junctions closed that are not known: their breaks are reported as crossed lines \
             until the next scan"
        ),
        Event::JunctionsBlocked { blocked: true, breaks: 0 } => {
            "no frame comes back: two rings behind junctions broke at once, or the first SubDevice failed. Each ring \
             is now examined while the others are isolated"
                .to_owned()
        }
        Event::JunctionsBlocked { blocked: true, .. } => {
            "no frame comes back while a ring behind a junction is open: a second one is open too, or the cable of the \
             interface is broken"
                .to_owned()
        }
        Event::JunctionsBlocked { blocked: false, .. } => "frames come back again".to_owned(),
        _ => return None,
    })
}
