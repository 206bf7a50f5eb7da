//! What a scan found, as a table for people and as JSON for programs.

use ringcat::{Direction, Scan, SubDeviceInfo};
use ringcat_wire::sii::{SiiSyncManager, SyncManagerKind};
use serde_json::{Value, json};

/// Bytes of process data in one direction as the SII says: of the assigned PDOs, or of the SyncManagers where it
/// describes no PDOs.
fn sii_bytes(info: &SubDeviceInfo, direction: Direction) -> u32 {
    let kind = match direction {
        Direction::Outputs => SyncManagerKind::Outputs,
        Direction::Inputs => SyncManagerKind::Inputs,
    };
    let bytes = |(number, sync_manager): (u8, &SiiSyncManager)| {
        let bits: Vec<u32> = info.assigned_pdos(number).map(|pdo| pdo.bit_length()).collect();
        if bits.is_empty() { u32::from(sync_manager.length) } else { bits.iter().sum::<u32>().div_ceil(8) }
    };
    let of_kind = (0..).zip(&info.sync_managers).filter(|(_, sync_manager)| sync_manager.kind == kind);
    of_kind.map(bytes).sum()
}

/// One line per SubDevice, below a heading.
pub fn lines(scan: &Scan) -> Vec<String> {
    let heading = "pos  station  alias  vendor      product     out   in  connected to       name".to_owned();
    let line = |info: &SubDeviceInfo| {
        let position = usize::from(info.position.0);
        let parent = match scan.topology.connection_to(position) {
            Some(connection) => format!("{} port {}", connection.near.node, connection.near.port),
            None if position == 0 && scan.topology.main_count > 0 => "MAIN".to_owned(),
            None => "REDUNDANT".to_owned(),
        };
        format!(
            "{:>3}  {}  {:>5}  {:#010x}  {:#010x} {:>4} {:>4}  {parent:<17}  {}",
            position,
            info.station,
            info.alias,
            info.identity.vendor_id,
            info.identity.product_code,
            sii_bytes(info, Direction::Outputs),
            sii_bytes(info, Direction::Inputs),
            info.name
        )
    };
    std::iter::once(heading).chain(scan.subdevices.iter().map(line)).collect()
}

/// The same as JSON.
pub fn json(scan: &Scan) -> Value {
    let subdevice = |info: &SubDeviceInfo| {
        let connection = scan.topology.connection_to(usize::from(info.position.0));
        json!({
            "position": info.position.0,
            "station": info.station.0,
            "alias": info.alias,
            "name": info.name,
            "vendor_id": info.identity.vendor_id,
            "product_code": info.identity.product_code,
            "revision": info.identity.revision,
            "serial": info.identity.serial,
            "output_bytes": sii_bytes(info, Direction::Outputs),
            "input_bytes": sii_bytes(info, Direction::Inputs),
            "connected_to": connection.map(|c| json!({ "position": c.near.node, "port": c.near.port })),
        })
    };
    json!({
        "main_count": scan.main_count,
        "redundant_count": scan.redundant_count,
        "subdevices": scan.subdevices.iter().map(subdevice).collect::<Vec<_>>(),
    })
}
