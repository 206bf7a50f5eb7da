//! Findings of a scan about the cabling: crossed lines, swapped interfaces, unexpected ports (protocol 9.5).

use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::PortKind;

use super::Scan;
use crate::link::LinkSet;
use crate::order::InOrder;
use crate::procedures::cabling::{Known, cabling, stays_closed};
use crate::procedures::shared_segment::SharedSegment;
use crate::ring::RingState;
use crate::segment::findings::CablingFindings;
use crate::segment::{LineCheck, is_swapped};
use crate::supervisor::Bus;
use crate::topology::{Closing, Finding, PortOf};

/// Finds crossed SubDevices while the redundant link is down; false if the ring is not closed or changes meanwhile.
pub(super) async fn locate_crossings(bus: &Bus, segment: &SharedSegment, scan: &mut Scan) -> bool {
    if !stays_closed(bus).await {
        return false;
    }
    let seen = cabling(bus, &Scanned { scan, segment }, true, &LineCheck::default()).await;
    let Some(found) = seen.map(|seen| seen.crossings) else { return false };
    let node = |station: StationAddress| scan.subdevices.iter().position(|info| info.station == station);
    let exact = found.iter().filter_map(|crossing| {
        Some(Finding::CrossedLine { node: node(crossing.subdevice?.0)?, entry_port: crossing.entry_port? })
    });
    let mut exact: Vec<Finding> = exact.collect();
    if exact.len() < found.len() {
        // The link could not be disconnected: only the fact of a crossing is known.
        return false;
    }
    let others = scan.topology.findings.iter().filter(|finding| !matches!(finding, Finding::CrossedLine { .. }));
    exact.extend(others);
    exact.put_in_order_by_key(Finding::node);
    scan.topology.findings = exact;
    true
}

/// What the scan under way has found.
struct Scanned<'a> {
    scan: &'a Scan,
    segment: &'a SharedSegment,
}

impl Known for Scanned<'_> {
    fn segment(&self) -> &SharedSegment {
        self.segment
    }

    fn note_port_scan(&self) {}

    fn are_measuring(&self) -> bool {
        false
    }

    fn is_outranked(&self) -> bool {
        false
    }

    fn ports(&self, station: StationAddress) -> [PortKind; 4] {
        let info = self.scan.subdevices.iter().find(|info| info.station == station);
        info.map(|info| info.controller.ports).unwrap_or_default()
    }

    fn closings(&self, stations: &[StationAddress]) -> Vec<Closing> {
        // Positions are unchanged so shortly after the scan.
        let place = |at: PortOf| {
            let station = self.scan.subdevices.get(at.node)?.station;
            Some(PortOf { node: stations.iter().position(|it| *it == station)?, port: at.port })
        };
        let rings = self.scan.topology.local_rings.iter().map(|ring| ring.closing);
        rings.filter_map(|it| Some(Closing { head: place(it.head)?, tail: place(it.tail)? })).collect()
    }

    fn are_known(&self, _: &[StationAddress]) -> bool {
        true
    }
}

/// Unusual cabling. `exact`: the places of crossings are known, also in a closed ring.
pub(crate) fn cabling_findings(bus: &Bus, scan: &Scan, exact: bool) -> CablingFindings {
    let is_ring = bus.links() == LinkSet::Ring;
    let position = |node: usize| scan.subdevices.get(node).map_or(Position(node as u16), |info| info.position);
    CablingFindings {
        findings: scan.topology.findings.iter().map(|finding| (position(finding.node()), *finding)).collect(),
        are_swapped: is_ring && is_swapped(&scan.topology),
        // In a closed ring only branches on port 2 and crossed SubDevices process the redundant copy (protocol LC-04).
        is_redundant_processed: is_ring && bus.ring() == RingState::Closed && scan.redundant_count > 0 && !exact,
    }
}
