//! Where rings behind junctions are broken when no frame comes back: two of them broke (JR-02).
//!
//! The second SubDevice with nothing on its port 0 destroys every frame, but all that are passed before it take part in
//! it, among them the junction at which its ring begins. So a junction can get a blind order to leave its ring out,
//! by closing both ports of the ring. One ring after the other is looked into while all others are left out; then the
//! others are reached again, too. The settings are temporary (protocol 2.2, DL control bit 1): what becomes of frames
//! meanwhile, the loops return to what they were within about a second. All loops of a junction are written at once,
//! and they cannot be read any more: those that were closed on purpose are known from before ([`super::orders`]), and
//! stay closed.
//!
//! A ring behind a member of another one that is broken too is reached from one side of that one: from the side on
//! which it begins, where all are entered at port 0, or else from the one on which it closes. Then its own closing side
//! is left out: the break of the outer ring is the one unconnected port 0 that frames may pass.
//!
//! While it goes on, most SubDevices are out of reach at one time or another, which must not mean that they are lost
//! ([`Disturbance::IsolateRings`]).

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlControl, DlStatus, LoopControl, map};

use super::super::shared_segment::SharedSegment;
use crate::segment::disturbance::Disturbance;
use crate::segment::{Observation, Segment, is_down};
use crate::supervisor::{Bus, BusError};
use crate::topology::{Closing, LocalRing, NodeStatus, PortOf};

/// Bytes of DL_CONTROL that are written: forwarding rule and temporary bit, loops.
const WRITTEN: usize = 2;
/// Rings that are looked into; each takes some frames, and what the settings last for is about a second.
const MOST: usize = 16;
/// Pause after it.
const PAUSE: Duration = Duration::from_millis(5);
/// Orders that come back without the junction's answer before it is out of reach: the first ones open the way for the
/// next.
const TRIES: usize = 4;

/// A ring, as far as it has to be known here.
#[derive(Clone, Debug)]
struct Ring {
    /// Its junction, by position and by station address.
    head: usize,
    junction: StationAddress,
    /// Ports of the junction at which it begins, and the one at which it closes.
    begins: Vec<u8>,
    closes: u8,
    ring: LocalRing,
}

/// How far frames get into a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sides {
    /// Not at all.
    Neither,
    /// As they do: in at its beginning, and in at its end where it is broken.
    Both,
    /// At its beginning only. Where it is whole they do not come back.
    Beginning,
    /// At its end only. Where it is whole they do not come back.
    End,
}

impl Ring {
    /// `None` where its junction is not declared.
    fn new(segment: &Segment, ring: &LocalRing) -> Option<Ring> {
        let Closing { head: PortOf { node: head, port: closes }, tail } = ring.closing;
        let junction = segment.station_of(head)?;
        let children = segment.cabling.topology.nodes.get(head)?.children;
        let begins = (0..4).filter(|port| {
            let child = children[usize::from(*port)];
            child.is_some_and(|child| head < child && child <= tail.node)
        });
        Some(Ring { head, junction, begins: begins.collect(), closes, ring: ring.clone() })
    }

    fn holds(&self, node: usize) -> bool {
        self.head < node && node <= self.ring.closing.tail.node
    }

    /// Whether one of its cables was seen to be broken.
    fn is_broken(&self, found: &[Option<NodeStatus>]) -> bool {
        self.ring.cables.iter().any(|cable| is_down(cable, found) == Some(true))
    }

    /// The ports of its junction to close.
    fn closed(&self, sides: Sides) -> Vec<u8> {
        let begins = self.begins.iter().copied().filter(|_| matches!(sides, Sides::Neither | Sides::End));
        begins.chain((matches!(sides, Sides::Neither | Sides::Beginning)).then_some(self.closes)).collect()
    }
}

/// Examines all local rings, and hands the ports of their members to the model. Waits for the end of any other
/// disturbance, which has a limit of its own, as long as no frame comes back.
pub(in super::super) async fn isolate_rings(bus: Bus, segment: SharedSegment) {
    let Some(turn) = segment.disturb_while(Disturbance::IsolateRings, Segment::is_blocked).await else { return };
    let asked = segment.view().asked();
    let found = look_inside(&bus, &segment).await;
    // Frames that left before the last loop opened may still be on their way.
    bus.sleep(PAUSE).await;
    drop(turn);
    segment.observe(Observation::Isolated { asked, found: &found, words: segment.words() });
}

/// Returns what members said about their ports, by position. Empty where that cannot be done: there is one ring only,
/// or a junction is not declared.
async fn look_inside(bus: &Bus, segment: &SharedSegment) -> Vec<Option<NodeStatus>> {
    let (rings, count) = {
        let view = segment.view();
        let topology = &view.cabling.topology;
        let rings = topology.local_rings.iter().map(|ring| Ring::new(&view, ring));
        let mut rings: Vec<Ring> = rings.collect::<Option<_>>().unwrap_or_default();
        // Those around others first.
        rings.sort_by_key(|ring| ring.head);
        let is_possible = (2..=MOST).contains(&rings.len());
        (if is_possible { rings } else { Vec::new() }, topology.nodes.len())
    };
    let mut found = vec![None; if rings.is_empty() { 0 } else { count }];
    for ring in &rings {
        // Rings around it lead there.
        let broken_around = |other: &Ring| other.holds(ring.head) && other.is_broken(&found);
        let broken: Vec<usize> = rings.iter().filter(|other| broken_around(other)).map(|other| other.head).collect();
        let ways: &[(Sides, Sides)] = match broken[..] {
            [] => &[(Sides::Both, Sides::Both)],
            _ => &[(Sides::Beginning, Sides::Both), (Sides::End, Sides::Beginning)],
        };
        for (around, own) in ways.iter().copied() {
            let sides = |other: &Ring| match other {
                _ if other.head == ring.head => own,
                _ if broken.contains(&other.head) => around,
                _ if other.holds(ring.head) => Sides::Both,
                _ => Sides::Neither,
            };
            if let Ok(true) = set_loops(bus, segment, &rings, sides, ring).await {
                read(bus, segment, ring, &mut found).await;
                break;
            }
        }
    }
    if !rings.is_empty() {
        // It need not come back, and will not where two are open. What it does not reach ends by itself.
        let open = loops(segment, &rings, |_| Sides::Both);
        let write = |bus: Bus, (command, target, data)| async move { bus.transfer_once(command, target, data).await };
        let _ = bus.gather(open, write).await;
    }
    found
}

/// Has junctions let frames into their rings or not, for a moment. Frames that do not come back have done it all the
/// same, so it is done when one does: each that is lost may have been the one that makes the next one return. And each
/// that comes back may have opened the way to the junction that is wanted; false where it is out of reach all the same.
async fn set_loops(
    bus: &Bus,
    segment: &SharedSegment,
    rings: &[Ring],
    sides: impl Fn(&Ring) -> Sides,
    wanted: &Ring,
) -> Result<bool, BusError> {
    for number in 0..TRIES {
        let replies = bus.transfer_all(loops(segment, rings, &sides), Some(Wkc(1))).await?;
        let mut all = rings.iter().zip(&replies);
        // The first one went where the loops of before let it.
        if number > 0 && all.any(|(ring, reply)| ring.head == wanted.head && reply.wkc() == Wkc(1)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What has them do that.
fn loops(segment: &SharedSegment, rings: &[Ring], sides: impl Fn(&Ring) -> Sides) -> Vec<(Command, Target, Vec<u8>)> {
    let controls = rings.iter().map(|ring| {
        // The application may order something meanwhile.
        let mut control = DlControl { temporary: true, ..segment.view().control_of(ring.junction) };
        for port in ring.closed(sides(ring)) {
            control.loops[usize::from(port & 3)] = LoopControl::Closed;
        }
        (ring.junction, control)
    });
    let writes = controls.map(|(station, control)| {
        (Command::Fpwr, Target::Station(station, map::DL_CONTROL), control.encode()[..WRITTEN].to_vec())
    });
    writes.collect()
}

/// Reads the ports of a ring's junction and members.
async fn read(bus: &Bus, segment: &SharedSegment, ring: &Ring, found: &mut [Option<NodeStatus>]) {
    let members: Vec<_> = {
        let access = segment.view();
        let of_ring = access.members.iter().filter_map(|member| {
            let node = member.node.filter(|node| *node == ring.head || ring.holds(*node))?;
            let ports = member.info.as_ref().map(|info| info.controller.ports).unwrap_or_default();
            Some((node, member.station, ports))
        });
        of_ring.collect()
    };
    let read = bus.gather(members, |bus, (node, station, ports)| async move {
        let bytes = bus.fprd(station, map::DL_STATUS, DlStatus::LEN).await.ok()?;
        let dl_status = DlStatus::decode(bytes.first_chunk()?);
        Some((node, NodeStatus { dl_status, receive_times: None, ports }))
    });
    for (node, status) in read.await.into_iter().flatten() {
        if let Some(slot) = found.get_mut(node) {
            *slot = Some(status);
        }
    }
}
