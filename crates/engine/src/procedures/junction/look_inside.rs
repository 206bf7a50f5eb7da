//! Where rings behind junctions are broken when no frame comes back: two of them broke (JR-02).
//!
//! The second SubDevice with nothing on its port 0 destroys every frame, but all that are passed before it take part in
//! it, among them the junction at which its ring begins. So a junction can be told blindly to leave its ring out, by closing
//! both ports of the ring. One ring after the other is looked into while all others are left out; then the others are
//! reached again, too. The settings are temporary (facts 2.2, DL control bit 1): what becomes of frames meanwhile, the
//! loops return to what they were within about a second. All loops of a junction are written at once, and nobody can be
//! asked for them any more: those that somebody had closed on purpose are known from before ([`note_controls`]), and stay
//! closed.
//!
//! While it goes on, most SubDevices are out of reach at one time or another, which must tell nobody that they are lost
//! ([`super::super::fleet::SharedFleet::is_looking_inside`]).

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlControl, DlStatus, LoopControl, map};

use super::super::fleet::{Fleet, SharedFleet};
use crate::supervisor::{Bus, BusError};
use crate::topology::{LocalRing, NodeStatus};

/// Bytes of DL_CONTROL that are written: forwarding rule and temporary bit, loops.
const WRITTEN: usize = 2;
/// Rings that are looked into; each takes some frames, and what the settings last for is about a second.
const MOST: usize = 16;

/// A ring, as far as it has to be known here.
#[derive(Clone, Debug)]
struct Ring {
    /// What its junction had been told to do.
    control: DlControl,
    /// Its junction, by position and by station address.
    head: usize,
    junction: StationAddress,
    /// The last of its members.
    tail: usize,
    /// Ports of the junction that belong to it.
    ports: Vec<u8>,
}

impl Ring {
    /// `None` where its junction is not declared.
    fn new(fleet: &Fleet, ring: &LocalRing) -> Option<Ring> {
        let (head, tail) = (ring.closing.head.node, ring.closing.tail.node);
        let junction = station_of(fleet, head)?;
        let known = fleet.junction_controls.iter().find(|(station, _)| *station == junction);
        let control = known.map_or_else(DlControl::default, |(_, control)| *control);
        let children = fleet.topology.nodes.get(head)?.children;
        let begins = (0..4).filter(|port| {
            let child = children[usize::from(*port)];
            child.is_some_and(|child| head < child && child <= tail)
        });
        let mut ports: Vec<u8> = begins.collect();
        ports.push(ring.closing.head.port);
        Some(Ring { control, head, junction, tail, ports })
    }

    fn holds(&self, node: usize) -> bool {
        self.head < node && node <= self.tail
    }
}

fn station_of(fleet: &Fleet, node: usize) -> Option<StationAddress> {
    fleet.members.iter().find(|member| member.node == Some(node)).map(|member| member.station)
}

/// Looks into all local rings; returns what members said about their ports, by position. Empty where that cannot be
/// done: there is one ring only, or a junction is not declared.
///
/// With the number of the cabling to which the positions belong.
pub(super) async fn look_inside(bus: &Bus, fleet: &SharedFleet) -> (u32, Vec<Option<NodeStatus>>) {
    let (rings, count, recablings) = {
        let access = fleet.access();
        let rings = access.topology.local_rings.iter().map(|ring| Ring::new(&access, ring));
        let rings: Vec<Ring> = rings.collect::<Option<_>>().unwrap_or_default();
        let is_possible = (2..=MOST).contains(&rings.len());
        (if is_possible { rings } else { Vec::new() }, access.topology.nodes.len(), access.recablings)
    };
    let mut found = vec![None; if rings.is_empty() { 0 } else { count }];
    for ring in &rings {
        // Rings around it lead there. Where one of these is broken too nothing comes back, and this one keeps its secret.
        let is_left_out = |other: &Ring| other.head != ring.head && !other.holds(ring.head);
        if set_loops(bus, &rings, is_left_out).await.is_ok() {
            read(bus, fleet, ring, &mut found).await;
        }
    }
    if !rings.is_empty() {
        // Nobody may be able to answer this.
        let _ = set_loops(bus, &rings, |_| false).await;
    }
    (recablings, found)
}

/// Reads what the junctions of all local rings were told to do about their ports, while they can be asked. Where there is
/// one ring only it never has to be known.
pub(in super::super) async fn note_controls(bus: &Bus, fleet: &SharedFleet) {
    let junctions: Vec<StationAddress> = {
        let access = fleet.access();
        let heads = access.topology.local_rings.iter().map(|ring| ring.closing.head.node);
        if access.topology.local_rings.len() > 1 {
            heads.filter_map(|head| station_of(&access, head)).collect()
        } else {
            Vec::new()
        }
    };
    let read = bus.gather(junctions, |bus, station| async move {
        let control = DlControl::decode(&bus.fprd_array(station, map::DL_CONTROL).await.ok()?);
        // What holds for a moment is our own order.
        (!control.temporary).then_some((station, control))
    });
    for (station, control) in read.await.into_iter().flatten() {
        let known = &mut fleet.access().junction_controls;
        match known.iter_mut().find(|(junction, _)| *junction == station) {
            Some((_, before)) => *before = control,
            None => known.push((station, control)),
        }
    }
}

/// Has junctions leave their rings out or not, for a moment. Frames that do not come back have done it all the same, so it
/// is done when one does: each that is lost may have been the one that makes the next one return.
async fn set_loops(bus: &Bus, rings: &[Ring], is_left_out: impl Fn(&Ring) -> bool) -> Result<(), BusError> {
    let controls = rings.iter().map(|ring| {
        let mut control = DlControl { temporary: true, ..ring.control };
        if is_left_out(ring) {
            ring.ports.iter().for_each(|port| control.loops[usize::from(port & 3)] = LoopControl::Closed);
        }
        (ring.junction, control)
    });
    let writes = controls.map(|(station, control)| {
        (Command::Fpwr, Target::Station(station, map::DL_CONTROL), control.encode()[..WRITTEN].to_vec())
    });
    bus.transfer_all(writes, Some(Wkc(1))).await.map(drop)
}

/// Reads the ports of a ring's junction and members.
async fn read(bus: &Bus, fleet: &SharedFleet, ring: &Ring, found: &mut [Option<NodeStatus>]) {
    let members: Vec<_> = {
        let access = fleet.access();
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
