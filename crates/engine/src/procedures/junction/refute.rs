//! Tests whether a declared ring closes as declared (JR-05, JR-06), before any SubDevice is configured.
//!
//! Open ports do not show it: the SubDevice behind the junction could as well be connected to the last member of its
//! ring. So it is tested as in [`super::learn()`]: with both ends of the closing cable closed for a moment all
//! SubDevices answer, and with only the end at the junction closed, all except those behind a break of the ring. If
//! only one end has communication there is no cable between the two. If neither has, the closing cable may be broken;
//! such a ring is accepted without a test.
//!
//! If the segment changes during the test, the test has no result and is repeated. A negative result is valid only if
//! the next test confirms it.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DlStatus, map};

use super::learn::{Reached, WithClosed, first_behind_break, with_closed};
use crate::junction::ClosingEvidence;
use crate::order::InOrder;
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;
use crate::topology::{Closing, NodeStatus, PortOf, Topology};

/// Maximum number of tests, if the segment changes during each.
const TESTS: usize = 5;
/// Scans until all SubDevices answer, and until all ports are open again.
const SCANS: u8 = 5;
const PAUSE: Duration = Duration::from_millis(2);
/// Pause before another test where SubDevices did not answer.
const BETWEEN: Duration = Duration::from_millis(50);
/// After this time no further test begins.
const LIMIT: Duration = Duration::from_secs(5);

/// Result of a test of connections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refuted {
    /// All closing cables are where they were declared, or broken.
    None,
    /// The closing cable with this number is not where it was declared, with the evidence.
    Closing(usize, ClosingEvidence),
    /// The segment changed during each test or did not answer, or a scan or an application has begun.
    NotTested,
}

/// Whether a closing cable is not where it was declared.
pub(crate) async fn refute(
    on @ (bus, segment): (&Bus, &SharedSegment),
    scanned: Reached<'_>,
    main_count: usize,
    closings: &[Closing],
) -> Refuted {
    let (scan, until) = (segment.view().scan_number(), bus.now() + LIMIT);
    // The closing cable that the last test has not found.
    let mut refuted = None;
    for test in 0..TESTS {
        let is_in_use = {
            let view = segment.view();
            view.is_active() || view.is_scanning() || view.scan_number() != scan
        };
        if is_in_use || (test > 0 && bus.now() >= until) {
            break;
        }
        let Some(nodes) = present_ports(bus, scanned).await else {
            refuted = None;
            bus.sleep(BETWEEN).await;
            continue;
        };
        let tested = attempt(on, Reached { nodes: &nodes, ..scanned }, main_count, closings).await;
        refuted = match tested {
            _ if !are_ports_as(bus, scanned, &nodes).await => None,
            Refuted::None => return tested,
            Refuted::Closing(number, _) if refuted == Some(number) => return tested,
            Refuted::Closing(number, _) => Some(number),
            Refuted::NotTested => None,
        };
    }
    Refuted::NotTested
}

async fn attempt(
    on: (&Bus, &SharedSegment),
    Reached { nodes, stations }: Reached<'_>,
    main_count: usize,
    closings: &[Closing],
) -> Refuted {
    let topology = Topology::with_local_rings(nodes, main_count, closings);
    let mut numbers: Vec<usize> = (0..closings.len()).collect();
    // Which SubDevices are behind a break depends on the inner rings.
    numbers.put_in_order_by_key(|number| core::cmp::Reverse(closings[*number].head.node));
    for number in numbers {
        let closing = closings[number];
        let has_link = |at: &PortOf| nodes[at.node].dl_status.ports[usize::from(at.port & 3)].communication;
        let ends = [closing.head, closing.tail];
        let linked: Vec<PortOf> = ends.into_iter().filter(has_link).collect();
        if linked.is_empty() {
            continue;
        }
        let broken = if linked.len() == 2 { first_behind_break(nodes, &topology, closing) } else { None };
        let silent = |node: usize| broken.is_some_and(|first| topology.is_behind(node, first));
        let ports = if broken.is_some() { &linked[..1] } else { &linked[..] };
        let shown = match with_closed(on, ports, stations).await {
            Err(_) | Ok(WithClosed::NotClosed) => return Refuted::NotTested,
            Ok(WithClosed::NoFrame) => ClosingEvidence::NoFrame,
            Ok(WithClosed::Answers(answers)) => {
                let odd = answers.iter().enumerate().find(|(node, answers)| **answers == silent(*node));
                match odd.map(|(node, answers)| (node, *answers)) {
                    Some((node, false)) => ClosingEvidence::CutOff { position: Position(node as u16) },
                    Some((node, true)) => ClosingEvidence::StillThere { position: Position(node as u16) },
                    None => continue,
                }
            }
        };
        return Refuted::Closing(number, shown);
    }
    Refuted::None
}

/// Whether all ports are as before; ports that were opened again may take a moment.
async fn are_ports_as(bus: &Bus, scanned: Reached<'_>, before: &[NodeStatus]) -> bool {
    for _ in 0..SCANS {
        let now = present_ports(bus, scanned).await;
        let ports = |nodes: &[NodeStatus]| nodes.iter().map(|it| it.dl_status.ports).collect::<Vec<_>>();
        if now.is_some_and(|now| ports(&now) == ports(before)) {
            return true;
        }
        bus.sleep(PAUSE).await;
    }
    false
}

/// Present port states; `None` if not all SubDevices answer.
async fn present_ports(bus: &Bus, scanned: Reached<'_>) -> Option<Vec<NodeStatus>> {
    // After frames of a link were lost for a while, the bus does not wait for that link until one has returned.
    for _ in 0..SCANS {
        if bus.brd(map::TYPE, 1).await.is_ok_and(|counted| usize::from(counted.wkc().0) == scanned.nodes.len()) {
            break;
        }
        bus.sleep(PAUSE).await;
    }
    let each: Vec<(StationAddress, NodeStatus)> =
        scanned.stations.iter().copied().zip(scanned.nodes.iter().copied()).collect();
    let read = bus.gather(each, |bus, (station, before)| async move {
        let bytes = bus.fprd_array(station, map::DL_STATUS).await.ok()?;
        Some(NodeStatus { dl_status: DlStatus::decode(&bytes), receive_times: None, ..before })
    });
    read.await.into_iter().collect()
}
