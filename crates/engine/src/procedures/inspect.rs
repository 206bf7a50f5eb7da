//! Looking at all declared SubDevices: who answers, in which state, with which ports; and where a ring is broken.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::al::{AlStatus, AlStatusCode};
use ringcat_wire::register::{DlStatus, map};

use super::al_state::split_status;
use super::fleet::SharedFleet;
use crate::ring_status::Cable;
use crate::supervisor::{Bus, BusError, TURN, TURN_PAUSE};
use crate::topology::{PortOf, Topology, seam};

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
        Err(
            BusError::Lost { .. }
            | BusError::TooLong { .. }
            | BusError::Busy { .. }
            | BusError::Disturbed { .. }
            | BusError::Split { .. },
        ) => Look::Unknown,
    }
}

async fn read_both(bus: &Bus, station: StationAddress) -> Result<Look, BusError> {
    let bytes: [u8; 6] = bus.fprd_array(station, map::AL_STATUS).await?;
    let (status, code) = split_status(&bytes);
    let dl_status = DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?);
    Ok(Look::Answer { status, code, dl_status })
}

/// The cables of the ring that no longer have communication, in its order. Branches are none of it: who is behind one is told
/// as lost. `dl_status` by position.
pub(super) fn locate_breaks(topology: &Topology, dl_status: &[Option<DlStatus>]) -> Vec<Cable> {
    let Some(first) = topology.nodes.first() else { return Vec::new() };
    let trunk = trunk(topology);
    let first = Cable { near: None, far: Some(PortOf { node: 0, port: first.entry_port }) };
    let inner = (0..topology.nodes.len()).filter(|node| trunk[*node] && !topology.is_in_local_ring(*node));
    let inner = inner.filter_map(|node| topology.connection_to(node));
    let inner = inner.map(|it| Cable { near: Some(it.near), far: Some(it.far) });
    let last = topology.open_ports.iter().map(|at| Cable { near: Some(*at), far: None });
    // One end is enough: the other may have no power.
    let all = core::iter::once(first).chain(inner).chain(last);
    let mut broken: Vec<Cable> = all.filter(|cable| is_broken(dl_status, cable) == Some(true)).collect();
    if broken.is_empty() {
        broken.extend(seam(topology, dl_status).map(|(near, far)| Cable { near, far }));
    }
    broken
}

/// Whether a cable has no communication at one of its ends, as far as that is known.
pub(super) fn is_broken(dl_status: &[Option<DlStatus>], cable: &Cable) -> Option<bool> {
    let ends = [cable.near, cable.far].into_iter().flatten().filter_map(|at| communicates(dl_status, at));
    ends.reduce(|one, other| one && other).map(|communicates| !communicates)
}

/// Who is on the way between the interfaces, by position; everybody where that way is not known.
fn trunk(topology: &Topology) -> Vec<bool> {
    let mut trunk = vec![false; topology.nodes.len()];
    let mut follow = |end: Option<usize>| {
        let mut next = end;
        while let Some(node) = next.filter(|node| !core::mem::replace(&mut trunk[*node], true)) {
            next = topology.nodes[node].parent.map(|(parent, _)| parent);
        }
    };
    let end = topology.open_ports.last().map(|at| at.node);
    follow(end);
    if topology.redundant_head.is_some() {
        follow(topology.main_count.checked_sub(1));
    }
    if end.is_none() {
        trunk.fill(true);
    }
    trunk
}

/// Whether a port has communication, where that is known.
fn communicates(dl_status: &[Option<DlStatus>], at: PortOf) -> Option<bool> {
    let status = dl_status.get(at.node).copied().flatten()?;
    Some(status.ports[usize::from(at.port & 3)].communication)
}
