//! Looking at all declared SubDevices: who answers, in which state, with which ports; and where a ring is broken.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::al::{AlStatus, AlStatusCode};
use ringcat_wire::register::{DlStatus, map};

use super::al_state::split_status;
use super::fleet::SharedFleet;
use crate::supervisor::{Bus, BusError, TURN, TURN_PAUSE};
use crate::topology::Topology;

/// Between two reports of what looks have brought so far: most answers are there by then.
const STEP: Duration = Duration::from_micros(300);

/// What a SubDevice said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Look {
    /// Its frames were lost: nothing is known.
    #[default]
    Unknown,
    /// Frames came back, it did not answer.
    Silent,
    /// Several answered: somebody else has its address too.
    Doubled,
    /// It answered.
    Answer { status: AlStatus, code: AlStatusCode, dl_status: DlStatus },
}

/// Looks at all members: a few at a time while `is_calm`, at once otherwise. What there is after each step is shown to
/// `so_far`, because looks at SubDevices that are not there take longer.
pub(super) async fn look_at_all(
    bus: &Bus,
    fleet: &SharedFleet,
    is_calm: impl Fn() -> bool,
    mut so_far: impl FnMut(&[Look]),
) -> Vec<Look> {
    let stations: Vec<StationAddress> = fleet.access().members.iter().map(|member| member.station).collect();
    let looks = Rc::new(RefCell::new(vec![Look::Unknown; stations.len()]));
    let mut next = 0;
    while next < stations.len() {
        let end = if is_calm() { stations.len().min(next + TURN) } else { stations.len() };
        let group = bus.group();
        for (index, station) in stations.iter().copied().enumerate().take(end).skip(next) {
            let (bus, looks) = (bus.clone(), looks.clone());
            group.spawn(async move {
                let look = look_at(&bus, station).await;
                looks.borrow_mut()[index] = look;
            });
        }
        while bus.within(STEP, group.done()).await.is_err() {
            so_far(&looks.borrow());
        }
        next = end;
        if next < stations.len() && is_calm() {
            bus.sleep(TURN_PAUSE).await;
        }
    }
    looks.take()
}

/// Looks at all that are nobody's, by their addresses.
pub(super) async fn look_at_strangers(bus: &Bus, fleet: &SharedFleet) -> Vec<(StationAddress, Look)> {
    let stations: Vec<StationAddress> = fleet.access().strangers.iter().map(|s| s.station).collect();
    bus.gather(stations, |bus, station| async move { (station, look_at(&bus, station).await) }).await
}

async fn look_at(bus: &Bus, station: StationAddress) -> Look {
    match read_both(bus, station).await {
        Ok(look) => look,
        Err(BusError::Wkc { got: Wkc(0), .. }) => Look::Silent,
        Err(BusError::Wkc { .. }) => Look::Doubled,
        Err(BusError::Lost { .. } | BusError::TooLong { .. }) => Look::Unknown,
    }
}

async fn read_both(bus: &Bus, station: StationAddress) -> Result<Look, BusError> {
    let bytes: [u8; 6] = bus.fprd_array(station, map::AL_STATUS).await?;
    let (status, code) = split_status(&bytes);
    let dl_status = DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?);
    Ok(Look::Answer { status, code, dl_status })
}

/// Neighbours of a break: the last SubDevice before it and the first behind it, in the order of the scan. `None` on a
/// side is the link itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Break {
    pub after: Option<Position>,
    pub before: Option<Position>,
}

/// The place where a connection of the scan no longer has communication. `dl_status` by position.
pub(super) fn locate_break(topology: &Topology, dl_status: &[Option<DlStatus>]) -> Option<Break> {
    let down = |node: usize, port: u8| {
        let status = dl_status.get(node).copied().flatten()?;
        Some(!status.ports[usize::from(port & 3)].communication)
    };
    let position = |node: usize| Some(Position(u16::try_from(node).unwrap_or(u16::MAX)));
    if down(0, topology.nodes.first()?.entry_port) == Some(true) {
        return Some(Break { after: None, before: position(0) });
    }
    for node in 0..topology.nodes.len() {
        // Breaks in rings behind junctions are told apart.
        if topology.is_in_local_ring(node) {
            continue;
        }
        let Some(connection) = topology.connection_to(node) else { continue };
        let near = down(connection.near.node, connection.near.port);
        let far = down(connection.far.node, connection.far.port);
        // One end is enough: the other may have no power.
        if near == Some(true) || far == Some(true) {
            return Some(Break { after: position(connection.near.node), before: position(node) });
        }
    }
    match topology.open_ports.iter().find(|at| down(at.node, at.port) == Some(true)) {
        Some(lost) => Some(Break { after: position(lost.node), before: None }),
        None => seam(topology, dl_status),
    }
}

/// A connection that the scan did not see, because the ring was broken there already.
fn seam(topology: &Topology, dl_status: &[Option<DlStatus>]) -> Option<Break> {
    let position = |node: usize| Position(u16::try_from(node).unwrap_or(u16::MAX));
    let last = topology.main_count.checked_sub(1);
    let communicates = |node: usize, port: u8| {
        let status = dl_status.get(node).copied().flatten()?;
        Some(status.ports[usize::from(port & 3)].communication)
    };
    if let Some(head) = topology.redundant_head {
        let broken = communicates(head, topology.nodes.get(head)?.entry_port) == Some(false);
        return broken.then(|| Break { after: last.map(position), before: Some(position(head)) });
    }
    // Only then was nothing seen of the redundant link.
    let last = last.filter(|_| topology.open_ports.is_empty())?;
    let node = topology.nodes.get(last)?;
    let known = |port: u8| port == node.entry_port || node.children[usize::from(port)].is_some();
    let broken = (0..4).filter(|port| !known(*port)).all(|port| communicates(last, port) == Some(false));
    broken.then(|| Break { after: Some(position(last)), before: None })
}
