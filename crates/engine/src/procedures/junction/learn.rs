//! Determines where local rings close, during a scan in mode automatic (JR-03).
//!
//! Open ports allow several possibilities ([`candidates_with`]), so each is tested: both ends of a supposed closing
//! cable are closed for a moment, in one frame. If it is that cable, the ring is open there and all SubDevices still
//! answer; with any other pair of ports some SubDevices are cut off. If the ring is broken already, only the end at the
//! junction is closed, and exactly the SubDevices between the break and the closing cable must stop answering. The
//! loops revert in any case: the setting is temporary (protocol 2.2, DL control bit 1).
//!
//! A failed test gives more information: if a ring is closed at its junction and in the middle, the members behind the
//! middle stop answering, up to the last one. So the cable of the last one is tested next, and a ring takes two or
//! three tests, however long it is.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::map;

use crate::order::InOrder;
use crate::procedures::loops::{settings, while_closed};
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::{Bus, BusError};
use crate::topology::{Closing, NodeStatus, PortOf, Topology, candidates_with};

/// Maximum number of failed tests.
const TRIES: usize = 256;
/// Maximum number of failed tests without a returned frame: these may cost more than a second each.
const SLOW_TRIES: usize = 16;

/// SubDevices by position: their ports, and their station addresses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reached<'a> {
    pub nodes: &'a [NodeStatus],
    pub stations: &'a [StationAddress],
}

/// The closing cables of all local rings, whole or broken; none if they cannot be determined.
pub(in super::super) async fn learn(
    on: (&Bus, &SharedSegment),
    reached: Reached<'_>,
    main_count: usize,
    ring_closed: bool,
) -> Result<Vec<Closing>, BusError> {
    let Reached { nodes, .. } = reached;
    // With a ring that was not recognised, receive times would show crossed lines that do not exist.
    let untimed: Vec<NodeStatus> = nodes.iter().map(|node| NodeStatus { receive_times: None, ..*node }).collect();
    let (mut right, mut wrong) = (Vec::new(), Vec::new());
    let (mut slow, mut likely): (usize, Vec<Closing>) = (0, Vec::new());
    'sets: while wrong.len() < TRIES && slow < SLOW_TRIES {
        let with = |likely: &[Closing]| {
            let right = [&right[..], likely].concat();
            candidates_with(nodes, main_count, ring_closed, 1, (&right, &wrong)).into_iter().next()
        };
        let hinted = likely.drain(..).find_map(|likely| with(&[likely]).filter(|set| set.contains(&likely)));
        let Some(mut set) = hinted.or_else(|| with(&[])) else { break };
        let topology = Topology::with_local_rings(&untimed, main_count, &set);
        // Which SubDevices are behind a break depends on the inner rings, which are tested first.
        set.put_in_order_by_key(|closing| core::cmp::Reverse(closing.head.node));
        for closing in set.iter().filter(|closing| !right.contains(closing)).copied().collect::<Vec<_>>() {
            match attempt(on, reached, &topology, closing).await? {
                Tried::Right => right.push(closing),
                Tried::Wrong { last_silent } => {
                    wrong.push(closing);
                    let tail = |node: usize| [1, 3, 2].map(|port| PortOf { node, port });
                    let ends = last_silent.into_iter().flat_map(tail);
                    likely = ends.map(|tail| Closing { head: closing.head, tail }).collect();
                    likely.retain(|likely| !wrong.contains(likely));
                    continue 'sets;
                }
                Tried::NoFrame => {
                    wrong.push(closing);
                    slow += 1;
                    continue 'sets;
                }
                Tried::NotClosed => break 'sets,
            }
        }
        set.put_in_order();
        return Ok(set);
    }
    Ok(Vec::new())
}

/// Result of a test.
enum Tried {
    /// The ring closes here.
    Right,
    /// It does not. The last of the SubDevices that stopped answering behind the supposed last member.
    Wrong { last_silent: Option<usize> },
    /// No frame returned.
    NoFrame,
    /// The ports are being set by the application or another program.
    NotClosed,
}

/// Tests whether a ring closes here.
async fn attempt(
    on: (&Bus, &SharedSegment),
    reached: Reached<'_>,
    topology: &Topology,
    closing: Closing,
) -> Result<Tried, BusError> {
    let Closing { head, tail } = closing;
    let broken = first_behind_break(reached.nodes, topology, closing);
    // SubDevices behind a break are reached through the closing cable only.
    let silent = |node: usize| broken.is_some_and(|first| topology.is_behind(node, first));
    let ports = if broken.is_some() { Vec::from([head]) } else { Vec::from([head, tail]) };
    let answers = match with_closed(on, &ports, reached.stations).await? {
        WithClosed::Answers(answers) => answers,
        WithClosed::NoFrame => return Ok(Tried::NoFrame),
        WithClosed::NotClosed => return Ok(Tried::NotClosed),
    };
    if answers.iter().enumerate().all(|(node, is)| *is != silent(node)) {
        return Ok(Tried::Right);
    }
    let behind = answers.iter().enumerate().skip(tail.node + 1).take_while(|(_, answers)| !**answers);
    Ok(Tried::Wrong { last_silent: behind.last().map(|(node, _)| node) })
}

/// The member behind the break of a ring that is open elsewhere than at its closing cable.
pub(super) fn first_behind_break(nodes: &[NodeStatus], topology: &Topology, closing: Closing) -> Option<usize> {
    let ring = topology.local_rings.iter().find(|ring| ring.closing == closing)?;
    let first = ring.cables.first().filter(|cable| cable.near.is_none())?;
    let is_open = |node: &usize| !nodes[*node].dl_status.ports[0].communication;
    Some(first.far.node).filter(is_open)
}

/// Result of a test with closed ports.
pub(super) enum WithClosed {
    /// Which SubDevices answered, by position.
    Answers(Vec<bool>),
    /// No frame returned, or one of the ends was not reached.
    NoFrame,
    /// The ports were not closed: they are being set by the application or another program.
    NotClosed,
}

/// Which SubDevices with these station addresses answer while these ports are closed for a moment. An error if the
/// present settings cannot be read.
pub(super) async fn with_closed(
    (bus, segment): (&Bus, &SharedSegment),
    ports: &[PortOf],
    stations: &[StationAddress],
) -> Result<WithClosed, BusError> {
    let of = |port: &PortOf| stations.get(port.node).map(|station| (*station, port.port));
    let ports: Vec<(StationAddress, u8)> = ports.iter().filter_map(of).collect();
    let Some(before) = settings(bus, segment, &ports).await? else { return Ok(WithClosed::NotClosed) };
    let (result, _) = while_closed(bus, segment, &before, &ports, answering(bus, stations)).await;
    Ok(result.and_then(|answers| answers).map_or(WithClosed::NoFrame, WithClosed::Answers))
}

/// Which SubDevices answer, by position.
async fn answering(bus: &Bus, stations: &[StationAddress]) -> Result<Vec<bool>, BusError> {
    // If no frame returns at all, this detects it faster.
    bus.brd(map::TYPE, 1).await?;
    let answers = bus.gather(stations.iter().copied(), |bus, station| async move {
        match bus.fprd(station, map::TYPE, 1).await {
            Ok(_) => Ok(true),
            Err(BusError::Wkc { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    });
    answers.await.into_iter().collect()
}
