//! Inspects a ring without changing it: which SubDevices answer on which link, their cabling, their error counters. It
//! only reads, so a segment operated by another MainDevice is not disturbed.

use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::AlStatus;
use ringcat_wire::register::{DlStatus, ErrorCounters, Information, map};

use super::scan::{ScanError, explain};
use crate::link::LinkSet;
use crate::ring::RingState;
use crate::ring_status::{Cable, CableReport, LinkCounts, cables, port_errors};
use crate::supervisor::{Bus, BusError};
use crate::topology::{NodeStatus, PortOf, Topology, ends_of_earlier_break};

/// Result of an inspection.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RingInspection {
    /// Closed or open.
    pub state: RingState,
    /// SubDevices on the main and on the redundant link.
    pub counts: LinkCounts,
    /// Station addresses by position, as assigned by the MainDevice that operates the segment; 0 if none is assigned.
    pub stations: Vec<StationAddress>,
    /// AL states by position.
    pub states: Vec<AlStatus>,
    /// Their cabling.
    pub topology: Topology,
    /// Error counters by position.
    pub counters: Vec<ErrorCounters>,
    /// Every cable with the error counts of the ports at its ends since the counters were cleared. The counters
    /// saturate at 255.
    pub cables: Vec<CableReport>,
    /// The place of the break, if the ring is open.
    pub place: Option<Cable>,
}

/// Inspects the ring once. SubDevices are addressed by position, which needs no station addresses.
///
/// # Errors
/// Frames that are lost repeatedly, no answer of any SubDevice, or SubDevices that are added or lost meanwhile.
pub async fn inspect_ring(bus: Bus) -> Result<RingInspection, ScanError> {
    let counted = match bus.brd(map::TYPE, 1).await {
        Ok(counted) if counted.wkc().0 == 0 => return Err(ScanError::NoSubDevices),
        Err(BusError::Lost { .. }) => return Err(ScanError::NoAnswer),
        counted => counted.map_err(ScanError::Bus)?,
    };
    let counts = LinkCounts { main: counted.main.0, redundant: counted.redundant.0 };
    let positions = (0..counted.wkc().0).map(Position);
    let readings = bus.gather_in_turns(positions.collect(), read_seen).await;
    let mut statuses = Vec::with_capacity(readings.len());
    let (mut stations, mut states, mut counters) = (Vec::new(), Vec::new(), Vec::new());
    for reading in readings {
        let (station, status, state, counted) = match reading {
            Ok(seen) => seen,
            Err(error) => {
                explain(&bus).await?;
                return Err(ScanError::Bus(error));
            }
        };
        stations.push(station);
        statuses.push(status);
        states.push(state);
        counters.push(counted);
    }
    let state = bus.ring();
    let topology = Topology::build(&statuses, usize::from(counts.main));
    let dl_status: Vec<_> = statuses.iter().map(|status| Some(status.dl_status)).collect();
    let place = broken(&topology, bus.links(), state, &dl_status);
    let errors = |end: Option<PortOf>| {
        let end = end.and_then(|at| Some(port_errors(counters.get(at.node)?, at.port)));
        end.unwrap_or_default()
    };
    let cables = cables(&topology, bus.links());
    let report = |cable: Cable| CableReport { cable, errors: errors(cable.near).plus(errors(cable.far)) };
    let cables = cables.into_iter().map(report).collect();
    Ok(RingInspection { state, counts, stations, states, topology, counters, cables, place })
}

type Seen = (StationAddress, NodeStatus, AlStatus, ErrorCounters);

async fn read_seen(bus: Bus, position: Position) -> Result<Seen, BusError> {
    let (station, (ports, (state, (dl_status, counters)))) = bus
        .both(
            bus.aprd(position, map::STATION_ADDRESS, 2),
            bus.both(
                bus.aprd(position, map::TYPE, Information::LEN),
                bus.both(
                    bus.aprd(position, map::AL_STATUS, AlStatus::LEN),
                    bus.both(
                        bus.aprd(position, map::DL_STATUS, DlStatus::LEN),
                        bus.aprd(position, map::RX_ERROR_COUNTER, ErrorCounters::LEN),
                    ),
                ),
            ),
        )
        .await;
    let status = NodeStatus {
        dl_status: DlStatus::decode(&array(&dl_status?)),
        // Latching receive times would disturb the clocks of a segment in operation.
        receive_times: None,
        ports: Information::decode(&array(&ports?)).port_descriptor.ports,
    };
    let station = StationAddress(u16::from_le_bytes(array(&station?)));
    Ok((station, status, AlStatus::decode(&array(&state?)), ErrorCounters::decode(&array(&counters?))))
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

/// The cable at which the ring is open.
fn broken(topology: &Topology, links: LinkSet, state: RingState, dl_status: &[Option<DlStatus>]) -> Option<Cable> {
    if links != LinkSet::Ring || state != RingState::Open {
        return None;
    }
    ends_of_earlier_break(topology, dl_status).map(|(near, far)| Cable { near, far })
}
