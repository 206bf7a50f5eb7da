//! Where the ring is broken: one event per break, when its neighbours have noticed it.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::register::DlStatus;

use super::effect::Effects;
use super::look::Look;
use super::{Asked, Segment};
use crate::event::Event;
use crate::ring::RingState;
use crate::ring_status::Cable;
use crate::time::Instant;
use crate::topology::{NodeStatus, PortOf, Topology, are_doubtful, ends_of_break, seam};

/// Looks for the place of a break: its neighbours may notice the lost link later than frames do.
const LOOKS: u8 = 25;
/// Pause between two of them, and between the first few.
const PAUSE: Duration = Duration::from_millis(10);
const FIRST_LOOKS: u8 = 5;
const FIRST_PAUSE: Duration = Duration::from_millis(1);

/// What was told of breaks.
#[derive(Debug, Default)]
pub(super) struct Breaks {
    /// The state of the ring when it was looked at last.
    state: RingState,
    /// Looks for a place that are left.
    looks: u8,
    /// Broken cables of the open ring that were told.
    told: Vec<Cable>,
}

impl Segment {
    /// What members said about their ports, by their position in the cabling.
    pub(super) fn by_position(&self, looks: &[Look]) -> Vec<Option<NodeStatus>> {
        let mut by_position = vec![None; self.cabling.topology.nodes.len()];
        for (member, look) in self.members.iter().zip(looks) {
            let (Some(node), Look::Answer { dl_status, .. }) = (member.node, look) else { continue };
            let ports = member.info.as_ref().map(|info| info.controller.ports).unwrap_or_default();
            if let Some(slot) = by_position.get_mut(node) {
                *slot = Some(NodeStatus { dl_status: *dl_status, receive_times: None, ports });
            }
        }
        by_position
    }

    /// Tells breaks that have a place now. `reported` is the state of the ring that had been told when the looks began.
    pub(super) fn observe_breaks(&mut self, looks: &[Look], reported: RingState, now: Instant, effects: &mut Effects) {
        if core::mem::replace(&mut self.breaks.state, reported) != reported {
            self.breaks.looks = LOOKS;
        }
        // While all were looked at, the ring may have closed.
        if reported != RingState::Open || self.ring.reported() != RingState::Open {
            return;
        }
        let by_position: Vec<_> = self.by_position(looks).iter().map(|it| it.map(|node| node.dl_status)).collect();
        // An interface's cable is told together with the ring.
        match self.ring.status.place {
            None => self.breaks.told.clear(),
            Some(place) if !self.breaks.told.contains(&place) => self.breaks.told = vec![place],
            Some(_) => {}
        }
        let broken = self.broken_cables(&by_position);
        for cable in &broken {
            if !self.breaks.told.contains(cable) {
                self.breaks.told.push(*cable);
                effects.report(Event::BreakLocated { cable: *cable });
            }
        }
        // The last one that is mended closes the ring.
        let mended = |cable: &Cable| !broken.contains(cable) && is_broken(&by_position, cable) == Some(false);
        while let Some(at) = self.breaks.told.iter().position(mended).filter(|_| self.breaks.told.len() > 1) {
            self.breaks.told.remove(at);
        }
        let place = self.breaks.told.first().copied();
        self.ring.status.place = place;
        if place.is_none() && self.breaks.looks > 0 {
            let is_first = LOOKS - self.breaks.looks < FIRST_LOOKS;
            self.breaks.looks -= 1;
            self.attention.again_in(if is_first { FIRST_PAUSE } else { PAUSE }, now);
        }
    }

    fn broken_cables(&self, by_position: &[Option<DlStatus>]) -> Vec<Cable> {
        let topology = &self.cabling.topology;
        if !are_doubtful(topology) {
            return locate_breaks(topology, by_position);
        }
        let counts = self.ring.status.links.map(|link| link.answering);
        let ends = ends_of_break(topology, by_position, counts);
        ends.map(|(near, far)| Cable { near, far }).into_iter().collect()
    }

    /// Events of rings behind junctions, from what SubDevices said about their ports, by position.
    pub(super) fn observe_local_rings(&mut self, status: &[Option<NodeStatus>], now: Instant, effects: &mut Effects) {
        self.local_rings.follow(&self.cabling, &self.members, status);
        if self.local_rings.is_empty() {
            return;
        }
        if let Some(pause) = self.local_rings.observe(now, status, |event| effects.report(event)) {
            self.attention.again_in(pause, now);
        }
        self.local_rings.complete_cabling(&mut self.cabling);
    }

    /// Rings have been looked into; positions are those of the cabling that was asked about.
    pub(super) fn observe_isolated(
        &mut self,
        asked: Asked,
        found: &[Option<NodeStatus>],
        now: Instant,
        effects: &mut Effects,
    ) {
        if asked.cabling == self.cabling.version {
            self.observe_local_rings(found, now, effects);
        }
    }
}

/// The cables of the ring that no longer have communication, in its order. Branches are none of it: what is behind one
/// is told as lost. `dl_status` by position.
fn locate_breaks(topology: &Topology, dl_status: &[Option<DlStatus>]) -> Vec<Cable> {
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
fn is_broken(dl_status: &[Option<DlStatus>], cable: &Cable) -> Option<bool> {
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
