//! Events in words, for programs that show them to people.

use std::fmt;

use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::link::Link;
use ringcat_engine::ring_status::{Cable, Occupant};
use ringcat_engine::topology::PortOf;
use ringcat_wire::address::Position;
use ringcat_wire::frame::MacAddress;

/// Names of declared SubDevices, by their index in the declaration. Positions are none: who is at one is told with it.
#[derive(Clone, Debug, Default)]
pub struct Names(pub Vec<String>);

impl Names {
    fn of(&self, subdevice: usize) -> impl fmt::Display {
        match self.0.get(subdevice) {
            Some(name) => format!("SubDevice {subdevice} \"{name}\""),
            None => format!("SubDevice {subdevice}"),
        }
    }

    /// A position, and who is there, as far as that is known.
    fn at(&self, position: Position, who: Option<Occupant>) -> impl fmt::Display {
        let station = who.map_or_else(String::new, |who| format!(" ({})", who.station));
        format!("position {position}{}{station}", self.called(who.and_then(|who| who.declared)))
    }

    /// The name of a declared SubDevice behind a space, if there is one.
    fn called(&self, declared: Option<usize>) -> String {
        declared.and_then(|index| self.0.get(index)).map_or_else(String::new, |name| format!(" \"{name}\""))
    }

    /// A port of a SubDevice, by its position and by who it is in the declaration.
    fn port(&self, at: PortOf, declared: Option<usize>) -> String {
        format!("SubDevice {}{} port {}", at.node, self.called(declared), at.port)
    }

    /// A cable by its ends, and by who is there: the station address is that of the last SubDevice.
    pub fn cable(&self, cable: Cable, ends: [Option<Occupant>; 2]) -> String {
        let station = |who: Option<Occupant>| who.map_or_else(String::new, |who| format!(" ({})", who.station));
        let port = |at: PortOf, who: Option<Occupant>| self.port(at, who.and_then(|who| who.declared));
        let [near, far] = ends;
        let is_last = cable.far.is_none();
        let before = cable.near.map_or_else(
            || format!("the {} interface", Link::Main),
            |at| format!("{}{}", port(at, near), station(near.filter(|_| is_last))),
        );
        let behind = cable.far.map_or_else(
            || format!("the {} interface", Link::Redundant),
            |at| format!("{}{}", port(at, far), station(far)),
        );
        format!("between {before} and {behind}")
    }
}

/// The source address of a frame, if it is long enough to have one.
pub fn address_of_sender(frame: &[u8]) -> Option<MacAddress> {
    frame.get(6..12)?.try_into().ok().map(MacAddress)
}

/// An address as people write it.
pub fn address(mac: MacAddress) -> String {
    let bytes = mac.0.map(|byte| format!("{byte:02x}"));
    bytes.join(":")
}

/// An event in one line.
pub fn describe(timed: &TimedEvent, names: &Names) -> String {
    let ends = timed.occupants;
    match &timed.event {
        Event::Counted { main, redundant } => format!("SubDevices answering: {main} on MAIN, {redundant} on REDUNDANT"),
        Event::ScanProgress { done, total } => format!("scanning: {done} of {total} SubDevices read"),
        Event::ScanFinished { subdevices } => format!("scan finished: {subdevices} SubDevices"),
        Event::ScanFailed { reason } => format!("scan failed: {reason}"),
        Event::SiiOddity { position, what } => format!("{}: SII: {what}", names.at(*position, ends[0])),
        Event::CablingOddity { position, what } => format!("{}: {what}", names.at(*position, ends[0])),
        Event::UnconnectedPort0 { position } => format!("{}: port 0 is not connected", names.at(*position, ends[0])),
        Event::LineCrossed { position: Some(position), entry_port: Some(port) } => {
            format!("{}: line crossed, frames enter at port {port}", names.at(*position, ends[0]))
        }
        Event::CannotDisconnect { link } => {
            format!(
                "{link} cannot be taken down (CAP_NET_ADMIN): where a line is crossed stays unknown in a closed ring"
            )
        }
        Event::LineCrossed { .. } => {
            let causes = "IN and OUT of one are swapped, or a branch is on port 2 of one";
            format!("line crossed: SubDevices answer on REDUNDANT in a closed ring, so {causes}")
        }
        Event::InterfacesSwapped => {
            "interfaces swapped: MAIN is plugged in at the end of the ring, REDUNDANT at its beginning".to_owned()
        }
        Event::DuplicateAlias { alias, first, second } => {
            format!("alias {alias} is used twice: {} and {}", names.at(*first, None), names.at(*second, None))
        }
        Event::RingOpened { main, redundant } => {
            format!("ring open: {main} SubDevices on MAIN, {redundant} on REDUNDANT")
        }
        Event::BreakLocated { cable } => format!("Line break {}", names.cable(*cable, ends)),
        Event::RingClosed { main, place, .. } => {
            let place = place.map_or_else(String::new, |cable| format!(" {}", names.cable(cable, ends)));
            format!("Line is fixed{place}: ring closed, {main} SubDevices on MAIN")
        }
        Event::RingUnsteady { changes } => {
            format!("ring unsteady: {changes} changes so far, the next is told when it has held for a second")
        }
        Event::JunctionLearned { closing } => {
            let (head, tail) = (names.port(closing.head, None), names.port(closing.tail, None));
            format!("ring behind a junction: from {tail} back to {head}")
        }
        Event::JunctionChanged { near, far, station, declared: [before, behind], broken, breaks } => {
            let before = near.map_or_else(|| "an unknown SubDevice".to_owned(), |near| names.port(near, *before));
            let station = station.map_or_else(String::new, |station| format!(" ({station})"));
            let place = format!("between {before} and {}{station}", names.port(*far, *behind));
            match (broken, breaks) {
                (true, 0 | 1) => format!("Line break {place}: the ring behind the junction goes on without this cable"),
                (true, _) => {
                    format!(
                        "Line break {place}: {breaks} cables of rings behind junctions are broken, one is tolerated"
                    )
                }
                (false, 0) => format!("Line is fixed {place}"),
                (false, _) => format!("Line is fixed {place}: broken cables left: {breaks}"),
            }
        }
        Event::JunctionsNotLearned { rings } => {
            format!(
                "rings behind junctions of which it was not found out where they close: {rings}; scan again without frames \
                 that get lost, or declare their connections (--junction strict)"
            )
        }
        Event::JunctionUnknown { rings } => {
            let what = "rings behind junctions closed that are not known";
            format!("{rings} {what}: their breaks read as crossed lines until the segment is scanned anew")
        }
        Event::JunctionsBlocked { blocked: true, breaks: 0 } => {
            let why = "two rings behind junctions broke at once, or the first SubDevice is dead";
            format!("no frame comes back: {why}. Each ring is looked into while the others are left out")
        }
        Event::JunctionsBlocked { blocked: true, .. } => {
            let why = "a second one is open too, or the cable of the interface";
            format!("no frame comes back while a ring behind a junction is open: {why}")
        }
        Event::JunctionsBlocked { blocked: false, .. } => "frames come back again".to_owned(),
        Event::RedundancyLost { cause } => format!("redundancy lost: {cause}"),
        Event::RedundancyRegained => "redundancy regained: the ring stands a break".to_owned(),
        Event::CableErrors { cable, errors } => format!("CRC errors rise {}: {errors}", names.cable(*cable, ends)),
        Event::LinkDown { link } => format!("{link}: no carrier"),
        Event::LinkUp { link } => format!("{link}: the carrier is back"),
        Event::StateReached { subdevice, state } => format!("{}: {state}", names.of(*subdevice)),
        Event::StateError { subdevice, requested: Some(state), status, code } => {
            format!("{}: refused {state}: {status}, {code}", names.of(*subdevice))
        }
        Event::StateError { subdevice, requested: None, status, code } => {
            format!("{}: is in {status}: {code}", names.of(*subdevice))
        }
        Event::StartupRead { subdevice, number, index, sub_index, comment, data } => {
            let bytes: Vec<String> = data.iter().map(|byte| format!("{byte:02x}")).collect();
            let comment = comment.as_ref().map_or(String::new(), |comment| format!(" \"{comment}\""));
            let bytes = bytes.join(" ");
            format!(
                "{}: start-up command {number}{comment} read {index:#06x}:{sub_index:02x}: {bytes}",
                names.of(*subdevice)
            )
        }
        Event::PlanOddity { subdevice, what } => format!("{}: {what}", names.of(*subdevice)),
        Event::Lost { subdevice } => format!("{}: no longer answers", names.of(*subdevice)),
        Event::Returned { subdevice } => format!("{}: answers again", names.of(*subdevice)),
        Event::ConfigurationFailed { subdevice, reason } => {
            format!("{}: configuration failed: {reason}", names.of(*subdevice))
        }
        Event::Unexpected { position, identity } => format!(
            "{}: not declared: vendor {:#010x}, product {:#010x}",
            names.at(*position, ends[0]),
            identity.vendor_id,
            identity.product_code
        ),
        Event::Moved { subdevice, from, to } => {
            format!("{}: moved from position {} to {}", names.of(*subdevice), from.0, to.0)
        }
        Event::Mismatch { subdevice, position, field, expected, got } => {
            let (name, place) = (names.of(*subdevice), names.at(*position, ends[0]));
            format!("{name}: expected {field} {expected:#010x}, {place} has {got:#010x}: it is left alone")
        }
        Event::GroupJoined { group } => format!("group {group}: all of it is there and in its state"),
        Event::GroupLeft { group } => format!("group {group}: not all of it is there and in its state"),
        Event::Missing { subdevice, optional } => {
            let what = if *optional { "optional, not there" } else { "missing" };
            format!("{}: {what}", names.of(*subdevice))
        }
        Event::FrameLimit { limit } => limit.to_string(),
        Event::ForeignFrame { arrived_on, bytes } => {
            let source = address_of_sender(bytes).map_or_else(String::new, |mac| format!(" from {}", address(mac)));
            format!("another MainDevice sends: {} bytes on {arrived_on}{source}", bytes.len())
        }
        Event::Domain { domain, status } => {
            let state = status.in_words();
            format!("domain {domain}: {state}, working counter {} of {}", status.wkc, status.expected)
        }
        Event::Skipped { domain } => format!("domain {domain}: skipped, its frames are still out"),
        Event::ClocksLocked { largest_ns } => format!("all clocks are locked, within {largest_ns} ns"),
        Event::ReferenceClock { position: Some(position) } => {
            format!("the clock of {} is the reference", names.at(*position, ends[0]))
        }
        Event::ReferenceClock { position: None } => "no clock is left that could be the reference".into(),
        Event::DelaysChanged { clocks, largest_ns } => {
            format!("propagation delays of {clocks} clocks have changed, by {largest_ns} ns at most")
        }
        Event::DelayUnknown { position, fork, range_ns, is_estimated } => {
            let why = fork.map_or_else(
                || "it is not known what is between it and the reference".into(),
                |fork| format!("the fork at position {fork} has no clock"),
            );
            let range = range_ns.map_or_else(String::new, |(least, most)| format!(", {least} to {most} ns"));
            let written = if *is_estimated { "the middle is written" } else { "none is written" };
            let at = names.at(*position, ends[0]);
            format!("the propagation delay of {at} cannot be measured, {why}{range}: {written}")
        }
        Event::ClocksFailed { reason } => format!("distributed clocks: {reason}"),
        Event::SyncWindow { inside: true, spread_ns } => format!("clocks came into their window: {spread_ns} ns"),
        Event::SyncWindow { inside: false, spread_ns } => format!("clocks left their window: {spread_ns} ns"),
        Event::Emergency { subdevice, emergency } => {
            let data: Vec<String> = emergency.data.iter().map(|byte| format!("{byte:02x}")).collect();
            let (code, register) = (emergency.error_code, emergency.error_register);
            let data = data.join(" ");
            format!("{}: emergency {code:#06x}, error register {register:#04x}, data {data}", names.of(*subdevice))
        }
        // Events that this crate does not know yet: it is built with the engine whose events it knows.
        _ => "an event without a description".to_owned(),
    }
}
