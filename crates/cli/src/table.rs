//! The result of a scan, as a table for people and as the keys of JSON.

use ringcat::{Direction, Scan, SubDeviceConfig, SubDeviceInfo, plan};

use crate::json::scan;
use crate::json::values::Port;

/// Bytes of outputs and inputs that a MainDevice exchanges without a declaration; `None` where the SII contradicts
/// itself.
fn bytes(info: &SubDeviceInfo) -> Option<[u32; 2]> {
    let plan = plan(&SubDeviceConfig::from_info(info), info).ok()?;
    let of = |direction: Direction| {
        let areas = plan.process_data.iter().filter(|area| area.direction == direction);
        areas.map(|area| u32::from(area.length)).sum()
    };
    Some([of(Direction::Outputs), of(Direction::Inputs)])
}

/// One line per SubDevice, below a heading.
pub fn lines(scan: &Scan) -> Vec<String> {
    let heading = "pos  station  alias  vendor      product     out   in  connected to  name".to_owned();
    let line = |info: &SubDeviceInfo| {
        let position = usize::from(info.position.0);
        let parent = match scan.topology.connection_to(info.position) {
            Some(connection) => format!("{} port {}", connection.near.position(), connection.near.port()),
            None if position == 0 && scan.topology.main_count > 0 => "MAIN".to_owned(),
            None => "REDUNDANT".to_owned(),
        };
        let bytes = bytes(info).map_or(["?".to_owned(), "?".to_owned()], |both| both.map(|bytes| bytes.to_string()));
        format!(
            "{:>3}  {}  {:>5}  {:#010x}  {:#010x} {:>4} {:>4}  {parent:<12}  {}",
            position,
            info.station,
            info.alias,
            info.identity.vendor_id,
            info.identity.product_code,
            bytes[0],
            bytes[1],
            info.name
        )
    };
    std::iter::once(heading).chain(scan.subdevices.iter().map(line)).collect()
}

/// The result of a scan as JSON.
pub fn json(scan: &Scan) -> scan::Scan {
    scan::Scan {
        main_subdevices: scan.main_count,
        redundant_subdevices: scan.redundant_count,
        subdevices: json_subdevices(scan),
    }
}

/// The SubDevices that a scan found.
pub fn json_subdevices(scan: &Scan) -> Vec<scan::SubDevice> {
    let subdevice = |info: &SubDeviceInfo| {
        let bytes = bytes(info);
        let connection = scan.topology.connection_to(info.position);
        scan::SubDevice {
            position: info.position.0,
            station: info.station.0,
            alias: info.alias,
            name: info.name.clone(),
            vendor_id: info.identity.vendor_id,
            product_code: info.identity.product_code,
            revision: info.identity.revision,
            serial: info.identity.serial,
            output_bytes: bytes.map(|both| both[0]),
            input_bytes: bytes.map(|both| both[1]),
            connected_to: connection.map(|c| Port { position: usize::from(c.near.position().0), port: c.near.port() }),
            pdos: None,
        }
    };
    scan.subdevices.iter().map(subdevice).collect()
}
