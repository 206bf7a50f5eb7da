//! Reports each break of the ring once, when its neighbours have detected it, and breaks of rings behind junctions.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::register::DlStatus;

use crate::event::Event;
use crate::ring::RingState;
use crate::ring_status::Cable;
use crate::segment::breaks::{is_broken, locate_breaks};
use crate::segment::effect::Effects;
use crate::segment::model::Segment;
use crate::segment::reading::Reading;
use crate::segment::versions::Versions;
use crate::segment::words::Words;
use crate::time::Instant;
use crate::topology::{NodeStatus, are_doubtful, ends_of_break};

/// Rounds for the place of a break: its neighbours may detect the lost link later than frames show it.
const SCANS: u8 = 25;
/// Pause between two of these rounds, and between the first few.
const PAUSE: Duration = Duration::from_millis(10);
const FIRST_LOOKS: u8 = 5;
const FIRST_PAUSE: Duration = Duration::from_millis(1);

impl Segment {
    /// Port states of members, by their position in the cabling.
    pub(in crate::segment) fn by_position(&self, readings: &[Reading]) -> Vec<Option<NodeStatus>> {
        let mut by_position = vec![None; self.cabling.topology.nodes.len()];
        for (member, reading) in self.members().zip(readings) {
            let (Some(node), Reading::Answer { dl_status, .. }) = (member.node, reading) else { continue };
            let ports = member.info.map(|info| info.controller.ports).unwrap_or_default();
            if let Some(slot) = by_position.get_mut(node) {
                *slot = Some(NodeStatus { dl_status: *dl_status, receive_times: None, ports });
            }
        }
        by_position
    }

    /// Reports breaks that are located now. `reported` is the reported state of the ring when the round began.
    pub(in crate::segment) fn observe_breaks(
        &mut self,
        readings: &[Reading],
        reported: RingState,
        now: Instant,
        effects: &mut Effects,
    ) {
        if core::mem::replace(&mut self.breaks.state, reported) != reported {
            self.breaks.readings = SCANS;
        }
        // The ring may have closed during the round.
        if reported != RingState::Open || self.ring.reported() != RingState::Open {
            return;
        }
        let by_position: Vec<_> = self.by_position(readings).iter().map(|it| it.map(|node| node.dl_status)).collect();
        // A break at an interface's cable is reported together with the ring.
        match self.ring.status.place {
            None => self.breaks.reported.clear(),
            Some(place) if !self.breaks.reported.contains(&place) => self.breaks.reported = vec![place],
            Some(_) => {}
        }
        let broken = self.broken_cables(&by_position);
        for cable in &broken {
            if !self.breaks.reported.contains(cable) {
                self.breaks.reported.push(*cable);
                effects.report(Event::BreakLocated { cable: *cable });
            }
        }
        // The repair of the last broken cable is reported as the closing of the ring.
        let mended = |cable: &Cable| !broken.contains(cable) && is_broken(&by_position, cable) == Some(false);
        while let Some(at) = self.breaks.reported.iter().position(mended).filter(|_| self.breaks.reported.len() > 1) {
            self.breaks.reported.remove(at);
        }
        let place = self.breaks.reported.first().copied();
        self.ring.status.place = place;
        if place.is_none() && self.breaks.readings > 0 {
            let is_first = SCANS - self.breaks.readings < FIRST_LOOKS;
            self.breaks.readings -= 1;
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

    /// Reports events of rings behind junctions from port states of SubDevices, by position.
    pub(in crate::segment) fn observe_local_rings(
        &mut self,
        status: &[Option<NodeStatus>],
        now: Instant,
        effects: &mut Effects,
    ) {
        self.local_rings.follow(&self.cabling, &self.subdevices, status);
        if self.local_rings.is_empty() {
            return;
        }
        if let Some(pause) = self.local_rings.observe(now, status, |event| effects.report(event)) {
            self.attention.again_in(pause, now);
        }
        self.local_rings.complete_cabling(&mut self.cabling);
    }

    /// Rings have been examined; positions are those of the cabling of that version.
    pub(in crate::segment) fn observe_isolated(
        &mut self,
        versions: Versions,
        found: &[Option<NodeStatus>],
        (words, now): (&Words, Instant),
        effects: &mut Effects,
    ) {
        self.end_silence(words, now);
        if versions.cabling == self.cabling.version {
            self.observe_local_rings(found, now, effects);
        }
    }
}
