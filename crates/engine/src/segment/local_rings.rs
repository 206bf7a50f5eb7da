//! Local rings in operation: broken cables according to the DL status of the SubDevices at both ends (JR-09).

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;

use super::cabling::{Cabling, End};
use super::subdevices::SubDevices;
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::ring_status::{Cable, CableErrors};
use crate::time::Instant;
use crate::topology::{Closing, LocalRing, NodeStatus, PortOf, RingCable, Topology};

/// A cable counts as whole again after this time: a plug with bad contact must not cause a flood of events.
const STEADY: Duration = Duration::from_millis(50);
/// A cable and its state.
#[derive(Clone, Debug)]
struct Watched {
    cable: RingCable,
    /// It was reported as broken.
    reported: bool,
    /// It has been whole again since then.
    whole_since: Option<Instant>,
}

/// Monitors the cables of all local rings.
#[derive(Debug)]
pub(super) struct LocalRings {
    rings: Vec<Vec<Watched>>,
    closings: Vec<Closing>,
    main_count: usize,
    /// The SubDevices at the places of the cabling, and the version of that cabling.
    places: Places,
    version: u32,
    /// Cables that have become known: the port where they begin, and the SubDevice behind them.
    completed: Vec<(PortOf, usize)>,
    /// How many cables are broken.
    broken: usize,
}

impl LocalRings {
    /// Monitors the rings of a cabling.
    pub fn new(cabling: &Cabling, subdevices: &SubDevices) -> LocalRings {
        let stations = cabling.stations.clone();
        let places =
            Places { declared: (0..stations.len()).map(|node| subdevices.member_at(node)).collect(), stations };
        LocalRings { version: cabling.version, ..LocalRings::over(&cabling.topology, places) }
    }

    fn over(topology: &Topology, places: Places) -> LocalRings {
        LocalRings {
            rings: topology.local_rings.iter().map(watched).collect(),
            closings: topology.local_rings.iter().map(|ring| ring.closing).collect(),
            main_count: topology.main_count,
            places,
            version: 0,
            completed: Vec::new(),
            broken: 0,
        }
    }

    /// Takes over the cabling of a new rescan, if there is one. `status` is by the positions of that rescan.
    pub fn follow(&mut self, cabling: &Cabling, subdevices: &SubDevices, status: &[Option<NodeStatus>]) {
        if self.version != cabling.version {
            self.go_over(LocalRings::new(cabling, subdevices), status);
        }
    }

    /// Carries reported breaks over to the new cabling. A reported break is assigned to, in this order: a broken cable
    /// with one end in common with the reported cable; a broken cable of the same ring; a cable with a common end, or
    /// of the same ring, that is whole again. Without any of these the cable no longer exists.
    fn go_over(&mut self, new: LocalRings, status: &[Option<NodeStatus>]) {
        let before = core::mem::replace(self, new);
        let places = &self.places;
        let reported = before.rings.iter().zip(&before.closings).flat_map(|(ring, closing)| {
            let head = before.places.end(closing.head);
            ring.iter().filter(|watched| watched.reported).map(move |watched| (watched, head))
        });
        for (reported, head) in reported {
            let ends = before.places.ends(&reported.cable);
            let rank = |watched: &Watched, is_of_ring: bool| {
                let shares = places.ends(&watched.cable).iter().flatten().any(|end| ends.contains(&Some(*end)));
                match (is_down(&watched.cable, status) == Some(true), shares, is_of_ring) {
                    (true, true, _) => Some(0),
                    (true, false, true) => Some(1),
                    (false, true, _) => Some(2),
                    (true, false, false) | (false, false, _) => None,
                }
            };
            let of_rings = self.rings.iter_mut().zip(&self.closings).flat_map(|(ring, closing)| {
                let is_of_ring = head.is_some() && places.end(closing.head) == head;
                ring.iter_mut().map(move |watched| (watched, is_of_ring))
            });
            let ranked = of_rings
                .filter(|(watched, _)| !watched.reported)
                .filter_map(|(watched, is_of_ring)| Some((rank(watched, is_of_ring)?, watched)));
            if let Some((_, watched)) = ranked.min_by_key(|(rank, _)| *rank) {
                (watched.reported, watched.whole_since) = (true, reported.whole_since);
            }
        }
        self.broken = self.rings.iter().flatten().filter(|watched| watched.reported).count();
    }

    /// Adds cables that have become known to the cabling.
    pub fn complete_cabling(&mut self, cabling: &mut Cabling) {
        for (near, node) in self.completed.drain(..) {
            cabling.topology.attach_behind_break(near, node);
            let known = cabling.topology.cable_to(node).map(|it| Cable { near: Some(it.near), far: Some(it.far) });
            if let Some(cable) = known.filter(|known| cabling.cables.iter().all(|(cable, _)| cable != known)) {
                // Cables to SubDevices come first, in their order.
                let closes = |it: &Cable| {
                    self.closings.iter().any(|closing| (it.near, it.far) == (Some(closing.tail), Some(closing.head)))
                };
                let is_behind = |it: &Cable| it.far.is_none_or(|far| far.node > node) || closes(it);
                let at = cabling.cables.iter().position(|(it, _)| is_behind(it)).unwrap_or(cabling.cables.len());
                cabling.cables.insert(at, (cable, CableErrors::default()));
            }
            cabling.version = cabling.version.wrapping_add(1);
        }
    }

    /// Whether there is any cable to monitor.
    pub fn is_empty(&self) -> bool {
        self.rings.is_empty()
    }

    /// How many cables are known to be broken.
    pub fn broken(&self) -> usize {
        self.broken
    }

    /// Processes the port states of SubDevices, by position; reports each edge once. Returns when to evaluate again
    /// though nothing changes.
    pub fn observe(
        &mut self,
        now: Instant,
        status: &[Option<NodeStatus>],
        mut report: impl FnMut(Event),
    ) -> Option<Duration> {
        let mut again = None;
        for watched in self.rings.iter_mut().flatten() {
            match (is_down(&watched.cable, status), watched.reported) {
                (Some(true), false) => {
                    watched.reported = true;
                    self.broken += 1;
                    report(self.places.changed(&watched.cable, true, self.broken));
                }
                (Some(true), true) | (None, _) => watched.whole_since = None,
                (Some(false), true) => {
                    let since = *watched.whole_since.get_or_insert(now);
                    if now.since(since) < STEADY {
                        again = Some(STEADY);
                        continue;
                    }
                    (watched.reported, watched.whole_since) = (false, None);
                    self.broken = self.broken.saturating_sub(1);
                    report(self.places.changed(&watched.cable, false, self.broken));
                }
                (Some(false), false) => {}
            }
        }
        self.complete(status);
        again
    }

    /// A ring that was open at the scan is completely known as soon as it is whole.
    fn complete(&mut self, status: &[Option<NodeStatus>]) {
        let is_unknown = |watched: &Watched| watched.cable.near.is_none() && !watched.reported;
        if !self.rings.iter().flatten().any(is_unknown) {
            return;
        }
        let Some(nodes) = status.iter().copied().collect::<Option<Vec<NodeStatus>>>() else { return };
        let topology = Topology::with_local_rings(&nodes, self.main_count, &self.closings);
        for (ring, known) in topology.local_rings.iter().zip(&mut self.rings) {
            let is_whole = ring.cables.iter().all(|cable| cable.near.is_some());
            if is_whole && known.iter().any(is_unknown) && !known.iter().any(|watched| watched.reported) {
                let unknown = ring
                    .cables
                    .iter()
                    .filter(|cable| known.iter().any(|it| is_unknown(it) && it.cable.far == cable.far));
                self.completed.extend(unknown.filter_map(|cable| Some((cable.near?, cable.far.node))));
                *known = watched(ring);
            }
        }
    }
}

fn watched(ring: &LocalRing) -> Vec<Watched> {
    ring.cables.iter().map(|cable| Watched { cable: *cable, reported: false, whole_since: None }).collect()
}

/// SubDevices by position.
#[derive(Clone, Debug, Default)]
struct Places {
    stations: Vec<StationAddress>,
    /// Index in the declaration.
    declared: Vec<Option<usize>>,
}

impl Places {
    /// Both ends of a cable, with the SubDevices there.
    fn ends(&self, cable: &RingCable) -> [Option<End>; 2] {
        [cable.near, Some(cable.far)].map(|at| self.end(at?))
    }

    fn end(&self, at: PortOf) -> Option<End> {
        Some((*self.stations.get(at.node)?, at.port))
    }

    fn changed(&self, cable: &RingCable, broken: bool, breaks: usize) -> Event {
        let RingCable { near, far } = *cable;
        let declared = |at: Option<PortOf>| at.and_then(|at| *self.declared.get(at.node)?);
        let station = self.stations.get(far.node).copied();
        let declared = [declared(near), declared(Some(far))];
        Event::JunctionChanged {
            near,
            far,
            station,
            declared: declared.map(|end| end.map(SubDeviceId)),
            broken,
            breaks,
        }
    }
}

/// Whether a cable has no communication at one end; `None` if neither end answers.
pub fn is_down(cable: &RingCable, status: &[Option<NodeStatus>]) -> Option<bool> {
    let end = |at: PortOf| {
        let status = status.get(at.node).copied().flatten()?;
        Some(!status.dl_status.ports[usize::from(at.port & 3)].communication)
    };
    match (cable.near.and_then(end), end(cable.far)) {
        (None, None) => None,
        (near, far) => Some(near == Some(true) || far == Some(true)),
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use ringcat_wire::register::{DlStatus, PortKind};

    use super::*;

    fn node(open: &[u8]) -> NodeStatus {
        let bits = (0..4u8).map(|port| if open.contains(&port) { 0x0200 << (2 * port) } else { 0x0100 << (2 * port) });
        NodeStatus { dl_status: DlStatus::from_bits(bits.sum::<u16>()), receive_times: None, ports: [PortKind::Mii; 4] }
    }

    const fn at(node: usize, port: u8) -> PortOf {
        PortOf { node, port }
    }

    /// J, and 1 to 3 from its port 3 back to its port 1.
    const WHOLE: [&[u8]; 4] = [&[0, 1, 3], &[0, 1], &[0, 1], &[0, 1]];
    const CUT_1_2: [&[u8]; 4] = [&[0, 1, 3], &[0], &[1], &[0, 1]];

    fn nodes(open: [&[u8]; 4]) -> Vec<NodeStatus> {
        open.into_iter().map(node).collect()
    }

    fn watch(open: [&[u8]; 4]) -> LocalRings {
        let closing = Closing { head: at(0, 1), tail: at(3, 1) };
        let stations = (0x1001..0x1005).map(StationAddress).collect();
        let places = Places { stations, declared: vec![Some(0), None, Some(7), Some(8)] };
        LocalRings::over(&Topology::with_local_rings(&nodes(open), 4, &[closing]), places)
    }

    fn seen(watch: &mut LocalRings, ms: u64, open: [&[u8]; 4]) -> Vec<Event> {
        let status: Vec<Option<NodeStatus>> = nodes(open).into_iter().map(Some).collect();
        let mut events = Vec::new();
        watch.observe(Instant(ms * 1_000_000), &status, |event| events.push(event));
        events
    }

    fn event(near: Option<PortOf>, far: PortOf, broken: bool, breaks: usize) -> Event {
        let declared = |node: usize| [Some(0), None, Some(7), Some(8)][node];
        let station = Some(StationAddress(0x1001 + far.node as u16));
        let declared = [near.and_then(|near| declared(near.node)), declared(far.node)];
        Event::JunctionChanged {
            near,
            far,
            station,
            declared: declared.map(|end| end.map(SubDeviceId)),
            broken,
            breaks,
        }
    }

    // covers: JR-07
    #[test]
    fn each_edge_is_reported_once_with_both_ends() {
        let mut watch = watch(WHOLE);
        assert_eq!(seen(&mut watch, 0, WHOLE), []);
        assert_eq!(seen(&mut watch, 1, CUT_1_2), [event(Some(at(1, 1)), at(2, 0), true, 1)]);
        assert_eq!(seen(&mut watch, 2, CUT_1_2), []);
        assert_eq!(seen(&mut watch, 3, WHOLE), []);
        assert_eq!(seen(&mut watch, 60, WHOLE), [event(Some(at(1, 1)), at(2, 0), false, 0)]);
        assert_eq!(seen(&mut watch, 61, WHOLE), []);
    }

    // covers: junctions
    #[test]
    fn a_plug_with_bad_contact_is_one_break() {
        let mut watch = watch(WHOLE);
        let events: usize =
            (0..1000).map(|ms| seen(&mut watch, ms, if ms % 7 < 3 { CUT_1_2 } else { WHOLE }).len()).sum();
        assert_eq!(events, 1);
        assert_eq!(seen(&mut watch, 1_000, WHOLE).len() + seen(&mut watch, 2_000, WHOLE).len(), 1);
    }

    #[test]
    fn a_ring_broken_at_the_scan_is_completely_known_once_it_is_whole() {
        let mut watch = watch(CUT_1_2);
        assert_eq!(seen(&mut watch, 0, CUT_1_2), [event(None, at(2, 0), true, 1)]);
        assert_eq!(seen(&mut watch, 10, WHOLE), []);
        assert_eq!(seen(&mut watch, 100, WHOLE), [event(None, at(2, 0), false, 0)]);
        let at_its_beginning: [&[u8]; 4] = [&[0, 1], &[1], &[0, 1], &[0, 1]];
        assert_eq!(seen(&mut watch, 200, at_its_beginning), [event(Some(at(0, 3)), at(1, 0), true, 1)]);
    }

    #[test]
    fn a_member_without_power_is_two_breaks_and_a_missing_answer_is_none() {
        let mut watch = watch(WHOLE);
        let mut status: Vec<Option<NodeStatus>> = nodes([&[0, 1, 3], &[0], &[], &[1]]).into_iter().map(Some).collect();
        status[2] = None;
        let mut events = vec![];
        watch.observe(Instant(0), &status, |event| events.push(event));
        assert_eq!(events, [event(Some(at(1, 1)), at(2, 0), true, 1), event(Some(at(2, 1)), at(3, 0), true, 2)]);
        assert_eq!(watch.broken(), 2);
        watch.observe(Instant(1), &[None; 4], |event| panic!("{event:?}"));
    }
}
