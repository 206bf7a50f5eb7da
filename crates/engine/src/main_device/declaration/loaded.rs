//! A loaded declaration that is not applied yet, and connections of local rings compared with a scan.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::PortKind;

use crate::declared::SubDeviceId;
use crate::info::SubDeviceInfo;
use crate::junction::{JunctionConnection, JunctionError, JunctionMode, START_PORT};
use crate::main_device::activate::activate_error::ActivateError;
use crate::main_device::declaration::Declaration;
use crate::procedures::scan::{Scan, cabling_findings, node_status};
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::findings::{DeclarationFinding, SettingFinding};
use crate::segment::{Found, Observation, SubDevices};
use crate::supervisor::Bus;
use crate::topology::{Closing, NodeStatus, PortOf, Topology};

/// A loaded declaration that is not applied yet.
#[derive(Clone, Debug)]
pub(in crate::main_device) struct Loaded {
    pub declaration: Declaration,
    pub connections: Vec<JunctionConnection>,
}

impl Loaded {
    /// The topology with the declared local rings, if any; otherwise that of the scan.
    pub(in crate::main_device) fn topology(
        &self,
        (bus, segment): (&Bus, &SharedSegment),
        mode: JunctionMode,
        scan: &Found,
        found: &[Option<Rc<SubDeviceInfo>>],
    ) -> Result<Topology, ActivateError> {
        check_connections(mode, &self.connections)?;
        if self.connections.is_empty() {
            return Ok(scan.topology.clone());
        }
        let mut closings = Vec::new();
        for connection in &self.connections {
            match closing(connection, found).map_err(ActivateError::Junction)? {
                Ok(closing) => closings.push(closing),
                Err(subdevice) => {
                    let warning = SettingFinding::AbsentEnd(*connection);
                    segment.observe(Observation::Compared(DeclarationFinding::SettingFinding(subdevice, warning)));
                }
            }
        }
        let nodes: Vec<NodeStatus> = scan.subdevices.iter().map(|info| node_status(info)).collect();
        let topology = Topology::with_local_rings(&nodes, scan.main_count, &closings);
        if mode == JunctionMode::Strict {
            // The scan has not reported it.
            let scan = Scan { topology: topology.clone(), ..scan.scan() };
            let finding = DeclarationFinding::Cabling(cabling_findings(bus, &scan, false));
            segment.observe(Observation::Compared(finding));
        }
        Ok(topology)
    }

    /// Both ends of the closing cables of the declared rings, if any, at the present positions of their SubDevices;
    /// otherwise those of the topology.
    pub(in crate::main_device) fn closings(
        &self,
        topology: &Topology,
        subdevices: &SubDevices,
        stations: &[StationAddress],
    ) -> Vec<[(StationAddress, u8); 2]> {
        if self.connections.is_empty() {
            let end = |at: PortOf| Some((*stations.get(at.node)?, at.port));
            let rings = topology.local_rings.iter().map(|ring| ring.closing);
            return rings.filter_map(|closing| Some([end(closing.head)?, end(closing.tail)?])).collect();
        }
        let end = |subdevice: SubDeviceId, port: u8| Some((subdevices.member(subdevice.0)?.station, port));
        let ends = |it: &JunctionConnection| Some([end(it.head, it.head_port)?, end(it.tail, it.tail_port)?]);
        self.connections.iter().filter_map(ends).collect()
    }
}

/// The mode strict needs a connection.
pub(in crate::main_device) fn check_connections(
    mode: JunctionMode,
    connections: &[JunctionConnection],
) -> Result<(), ActivateError> {
    match mode {
        JunctionMode::Strict if connections.is_empty() => Err(ActivateError::Junction(JunctionError::NoConnection)),
        JunctionMode::Disabled | JunctionMode::Automatic | JunctionMode::Strict => Ok(()),
    }
}

/// The place of a declared connection in the segment; otherwise the optional SubDevice of it that does not answer.
pub(in crate::main_device) fn closing(
    connection: &JunctionConnection,
    found: &[Option<Rc<SubDeviceInfo>>],
) -> Result<Result<Closing, SubDeviceId>, JunctionError> {
    let JunctionConnection { head, head_port, tail, tail_port } = *connection;
    for (subdevice, port) in [(head, head_port), (head, START_PORT), (tail, tail_port)] {
        let Some(info) = found.get(subdevice.0).and_then(Option::as_ref) else {
            return Ok(Err(subdevice));
        };
        let ports = &info.controller.ports;
        if ports[usize::from(port)] == PortKind::NotImplemented && *ports != [PortKind::NotImplemented; 4] {
            return Err(JunctionError::NoSuchPort { connection: *connection, subdevice, port });
        }
    }
    let node = |subdevice: SubDeviceId| found[subdevice.0].as_ref().map_or(0, |info| usize::from(info.position.0));
    let closing = Closing {
        head: PortOf { node: node(head), port: head_port },
        tail: PortOf { node: node(tail), port: tail_port },
    };
    if closing.tail.node <= closing.head.node {
        return Err(JunctionError::NotBehind(*connection));
    }
    Ok(Ok(closing))
}
