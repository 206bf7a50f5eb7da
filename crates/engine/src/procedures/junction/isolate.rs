//! Locates breaks of rings behind junctions when no frame returns, because two of them are broken (JR-02).
//!
//! The second SubDevice without a link on port 0 destroys every frame, but all SubDevices before it process the frame
//! first, among them the junction where its ring begins. So a junction can get a command without a reply to exclude its
//! ring, by closing both ports of the ring. One ring after the other is examined while all others are excluded; then
//! frames return, and the other SubDevices are in reach. The settings are temporary (protocol 2.2, DL control bit 1):
//! if frames are lost, the loops revert within about a second. A write sets all loops of a junction, and the previous
//! ones cannot be read at this time: ports that were closed on purpose are known from before ([`super::orders`]), and
//! stay closed.
//!
//! If a ring is connected to a member of another broken ring, it is reached through one side of the outer ring: the
//! side on which the outer ring begins, if frames enter all SubDevices there at port 0, otherwise the side on which it
//! closes. Then its own closing side is excluded: frames may pass only one unconnected port 0, which is the break of
//! the outer ring.
//!
//! During the examination most SubDevices are out of reach for some time, and must not be reported as lost
//! ([`Disturbance::IsolateRings`]).

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlControl, DlStatus, LoopControl, map};

use super::super::loops::write_of;
use super::super::shared_segment::SharedSegment;
use crate::order::InOrder;
use crate::segment::disturbance::Disturbance;
use crate::segment::{Observation, Segment, is_down};
use crate::supervisor::{Bus, BusError};
use crate::topology::{Closing, LocalRing, NodeStatus, PortOf};

/// Maximum number of examined rings: each takes some frames, and the settings last for about a second.
const MOST: usize = 16;
/// Pause after the examination.
const PAUSE: Duration = Duration::from_millis(5);
/// Commands that return without the junction's answer before it counts as out of reach: the first ones restore the path
/// for the next.
const TRIES: usize = 4;

/// Data of a ring.
#[derive(Clone, Debug)]
struct Ring {
    /// Its junction, by position and by station address.
    head: usize,
    junction: StationAddress,
    /// Ports of the junction at which it begins, and the port at which it closes.
    begins: Vec<u8>,
    closes: u8,
    ring: LocalRing,
}

/// The sides from which frames enter a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sides {
    /// From neither side.
    Neither,
    /// From both sides, as in normal operation: at its beginning, and at its end if it is broken.
    Both,
    /// From its beginning only. If the ring is whole, frames do not return.
    Beginning,
    /// From its end only. If the ring is whole, frames do not return.
    End,
}

impl Ring {
    /// `None` if its junction is not declared.
    fn new(segment: &Segment, ring: &LocalRing) -> Option<Ring> {
        let Closing { head: PortOf { node: head, port: closes }, tail } = ring.closing;
        let junction = segment.station_of(head)?;
        let children = segment.cabling().topology.nodes.get(head)?.children;
        let begins = (0..4).filter(|port| {
            let child = children[usize::from(*port)];
            child.is_some_and(|child| head < child && child <= tail.node)
        });
        Some(Ring { head, junction, begins: begins.collect(), closes, ring: ring.clone() })
    }

    fn holds(&self, node: usize) -> bool {
        self.head < node && node <= self.ring.closing.tail.node
    }

    /// Whether a break of one of its cables was found.
    fn is_broken(&self, found: &[Option<NodeStatus>]) -> bool {
        self.ring.cables.iter().any(|cable| is_down(cable, found) == Some(true))
    }

    /// The ports of its junction to close.
    fn closed(&self, sides: Sides) -> Vec<u8> {
        let begins = self.begins.iter().copied().filter(|_| matches!(sides, Sides::Neither | Sides::End));
        begins.chain((matches!(sides, Sides::Neither | Sides::Beginning)).then_some(self.closes)).collect()
    }
}

/// Examines all local rings, and passes the port states of their members to the model. As long as no frame returns,
/// waits for the end of any other disturbance, which has its own limit.
pub(in super::super) async fn isolate_rings(bus: Bus, segment: SharedSegment) {
    let Some(turn) = segment.disturb_while(Disturbance::IsolateRings, Segment::is_blocked).await else { return };
    let versions = segment.view().versions();
    let found = examine_rings(&bus, &segment).await;
    // Frames sent before the last loop opened may still be on the wire.
    bus.sleep(PAUSE).await;
    drop(turn);
    segment.observe(Observation::Isolated { versions, found: &found, words: segment.words() });
}

/// Returns the port states of members, by position. Empty if the examination is impossible: there is only one ring, or
/// a junction is not declared.
async fn examine_rings(bus: &Bus, segment: &SharedSegment) -> Vec<Option<NodeStatus>> {
    let (rings, count) = {
        let view = segment.view();
        let topology = &view.cabling().topology;
        let rings = topology.local_rings.iter().map(|ring| Ring::new(&view, ring));
        let mut rings: Vec<Ring> = rings.collect::<Option<_>>().unwrap_or_default();
        // Outer rings first.
        rings.put_in_order_by_key(|ring| ring.head);
        let is_possible = (2..=MOST).contains(&rings.len());
        (if is_possible { rings } else { Vec::new() }, topology.nodes.len())
    };
    let mut found = vec![None; if rings.is_empty() { 0 } else { count }];
    let before: Vec<(StationAddress, DlControl)> = {
        let view = segment.view();
        rings.iter().map(|ring| (ring.junction, view.control_of(ring.junction))).collect()
    };
    segment.observe(Observation::PortsAltered(&before));
    for ring in &rings {
        // Frames reach it through the rings around it.
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
        // The frame does not return if two rings are open. Settings that are not restored expire.
        let open = loops(segment, &rings, |_| Sides::Both);
        let write = |bus: Bus, (command, target, data)| async move { bus.transfer_once(command, target, data).await };
        let _ = bus.gather(open, write).await;
    }
    segment.observe(Observation::PortsAltered(&[]));
    found
}

/// Opens or closes rings at their junctions for a moment. A junction executes the command even if the frame does not
/// return. So the commands are repeated until a frame returns: a lost frame may have been the one that makes the next
/// return, and a returned frame may have opened the path to the wanted junction. False if that junction stays out of
/// reach.
async fn set_loops(
    bus: &Bus,
    segment: &SharedSegment,
    rings: &[Ring],
    sides: impl Fn(&Ring) -> Sides,
    wanted: &Ring,
) -> Result<bool, BusError> {
    for number in 0..TRIES {
        let replies = bus.transfer_together(loops(segment, rings, &sides), Some(Wkc(1))).await?;
        let mut all = rings.iter().zip(&replies);
        // The first frame took the path of the previous loops.
        if number > 0 && all.any(|(ring, reply)| ring.head == wanted.head && reply.wkc() == Wkc(1)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The datagrams with these commands.
fn loops(segment: &SharedSegment, rings: &[Ring], sides: impl Fn(&Ring) -> Sides) -> Vec<(Command, Target, Vec<u8>)> {
    let controls = rings.iter().map(|ring| {
        // The application may order something meanwhile.
        let mut control = DlControl { temporary: true, ..segment.view().control_of(ring.junction) };
        for port in ring.closed(sides(ring)) {
            control.loops[usize::from(port & 3)] = LoopControl::Closed;
        }
        (ring.junction, control)
    });
    controls.map(write_of).collect()
}

/// Reads the port states of a ring's junction and members.
async fn read(bus: &Bus, segment: &SharedSegment, ring: &Ring, found: &mut [Option<NodeStatus>]) {
    let members: Vec<_> = {
        let access = segment.view();
        let of_ring = access.members().filter_map(|member| {
            let node = member.node.filter(|node| *node == ring.head || ring.holds(*node))?;
            let ports = member.info.map(|info| info.controller.ports).unwrap_or_default();
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
