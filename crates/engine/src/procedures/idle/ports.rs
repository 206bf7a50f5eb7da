//! The ports of all SubDevices, compared with the last scan, after work that has closed ports or read their states.
//!
//! Reading DL status clears the ECAT event by which a broadcast shows a change of ports: a procedure that reads it must
//! ensure that idle operation follows the change.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{DlStatus, map};

use crate::procedures::shared_segment::SharedSegment;
use crate::segment::{IdleObservation, Observation};
use crate::supervisor::{Bus, BusError};

/// DL status of each SubDevice, by position, as a scan has found it.
pub(crate) type Scanned = [(StationAddress, DlStatus)];

/// Whether all SubDevices answer with the ports that the scan has found. If not, they are scanned again
/// ([`follow_ports`]).
pub(crate) async fn are_ports_as_scanned(bus: &Bus, segment: &SharedSegment, scanned: &Scanned) -> bool {
    compare_ports(bus, segment, scanned).await.unwrap_or_else(|_| {
        follow_ports(segment, false);
        false
    })
}

/// As [`are_ports_as_scanned`], for a scan, which is repeated after an error.
pub(super) async fn compare_ports(bus: &Bus, segment: &SharedSegment, scanned: &Scanned) -> Result<bool, BusError> {
    let is_same = are_same(bus, scanned).await?;
    follow_ports(segment, is_same);
    Ok(is_same)
}

async fn are_same(bus: &Bus, scanned: &Scanned) -> Result<bool, BusError> {
    let read = bus.gather(scanned.to_vec(), |bus, (station, before)| async move {
        Ok::<_, BusError>(DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?).ports == before.ports)
    });
    let read = read.await.into_iter().collect::<Result<Vec<bool>, BusError>>()?;
    Ok(read.into_iter().all(|is_same| is_same))
}

/// The ECAT events of the ports were cleared by reading DL status. `is_same`: the ports are as the last scan has found
/// them. If not, idle operation scans again; an application reads all ports itself.
pub(crate) fn follow_ports(segment: &SharedSegment, is_same: bool) {
    if segment.view().is_active() {
        segment.observe(Observation::RoundWanted);
    } else if !is_same {
        segment.observe_idle(IdleObservation::RescanAsked);
    }
}
