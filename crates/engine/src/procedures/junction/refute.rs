//! Tests whether a declared ring closes as declared (JR-05, JR-06), before any SubDevice is configured.
//!
//! Open ports do not show it: the SubDevice behind the junction could as well be connected to the last member of its
//! ring. So it is tested as in [`super::learn()`]: with both ends of the closing cable closed for a moment all
//! SubDevices answer, and with only the end at the junction closed, all except those behind a break of the ring. If
//! only one end has communication there is no cable between the two. If neither has, the closing cable may be broken;
//! such a ring is accepted without a test.
//!
//! A segment that changes during the test gives no result, and a negative result is tested again.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::{DlStatus, map};

use super::learn::{Reached, first_behind_break, with_closed};
use crate::junction::ClosingEvidence;
use crate::order::InOrder;
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;
use crate::topology::{Closing, NodeStatus, PortOf, Topology};

/// Consecutive negative results that are required.
const TRIES: usize = 2;
/// Scans until all SubDevices answer.
const SCANS: u8 = 5;
const PAUSE: Duration = Duration::from_millis(2);

/// The number of a closing cable that is not where it was declared, and the evidence.
pub(crate) async fn refute(
    on @ (bus, _): (&Bus, &SharedSegment),
    scanned: Reached<'_>,
    main_count: usize,
    closings: &[Closing],
) -> Option<(usize, ClosingEvidence)> {
    let mut last = None;
    for _ in 0..TRIES {
        let nodes = present_ports(bus, scanned).await?;
        last = Some(attempt(on, Reached { nodes: &nodes, ..scanned }, main_count, closings).await?);
        if present_ports(bus, scanned).await? != nodes {
            return None;
        }
    }
    last
}

async fn attempt(
    on: (&Bus, &SharedSegment),
    Reached { nodes, stations }: Reached<'_>,
    main_count: usize,
    closings: &[Closing],
) -> Option<(usize, ClosingEvidence)> {
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
        let shown = match with_closed(on, ports, stations).await.ok()? {
            Some(answers) => {
                let odd = answers.iter().enumerate().find(|(node, answers)| **answers == silent(*node));
                match odd.map(|(node, answers)| (node, *answers)) {
                    Some((node, false)) => ClosingEvidence::CutOff { position: Position(node as u16) },
                    Some((node, true)) => ClosingEvidence::StillThere { position: Position(node as u16) },
                    None => continue,
                }
            }
            None => ClosingEvidence::NoFrame,
        };
        return Some((number, shown));
    }
    None
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
