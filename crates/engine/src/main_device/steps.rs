//! Configuration in steps: load what the application declares, add connections of local rings, apply (JR-05).
//!
//! [`MainDevice::activate`] is all of it at once, for those who have nothing to add.

use alloc::vec::Vec;

use super::activate_error::ActivateError;
use super::declaration::{Declaration, check};
use super::pending::Pending;
use super::{Active, MainDevice};
use crate::config::{Resolution, resolve};
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::junction::{JunctionConnection, JunctionError, JunctionMode, START_PORT};
use crate::procedures::junction::refute;
use crate::procedures::scan::{Scan, node_status, report_cabling};
use crate::segment::member::Member;
use crate::supervisor::Bus;
use crate::topology::{Closing, NodeStatus, PortOf, Topology};

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::PortKind;

/// What was loaded and is not applied yet.
#[derive(Clone, Debug)]
pub(super) struct Loaded {
    pub declaration: Declaration,
    connections: Vec<JunctionConnection>,
}

impl MainDevice {
    /// First step: takes a declaration. It takes the place of one that was loaded before, with all that was added to it.
    ///
    /// # Errors
    /// [`ActivateError::Active`], and what is wrong with the declaration by itself.
    pub fn load(&mut self, declaration: Declaration) -> Result<(), ActivateError> {
        if self.segment.is_some() {
            return Err(ActivateError::Active);
        }
        check(&declaration)?;
        self.loaded = Some(Loaded { declaration, connections: Vec::new() });
        Ok(())
    }

    /// Second step, as often as needed: adds the connection of a local ring. The mode is strict then, whatever the
    /// options say. Nothing is added with an error.
    ///
    /// # Errors
    /// [`JunctionError`]: nothing is loaded, or what is wrong with the connection (JR-06).
    pub fn add_junction_connection(&mut self, connection: JunctionConnection) -> Result<(), JunctionError> {
        let loaded = self.loaded.as_mut().ok_or(JunctionError::NotLoaded)?;
        connection.check(&loaded.connections, loaded.declaration.subdevices.len())?;
        loaded.connections.push(connection);
        Ok(())
    }

    /// Before the last step, where connections were added: tries whether the rings close where they are said to, which takes
    /// some frames, and about two seconds where one does not. A ring whose closing cable is open at both ends, or whose
    /// SubDevices are not all there, is believed. What [`MainDevice::apply`] finds by itself is left to it.
    ///
    /// The result is [`JunctionError::NotThere`] where one does not.
    pub fn start_connection_check(&mut self) -> Pending<Result<(), JunctionError>> {
        let bus = self.supervisor.bus();
        let declared = self.declared_closings().unwrap_or_default();
        let own = bus.clone();
        Pending::start(&own, async move {
            if declared.closings.is_empty() {
                return Ok(());
            }
            let closings: Vec<Closing> = declared.closings.iter().map(|(_, closing)| *closing).collect();
            match refute(&bus, &declared.nodes, declared.main_count, &closings).await {
                Some((number, shown)) => {
                    Err(JunctionError::NotThere { connection: declared.closings[number].0, shown })
                }
                None => Ok(()),
            }
        })
    }

    /// What was declared of rings, where it is in what was scanned; `None` where nothing can be said of that.
    fn declared_closings(&self) -> Option<DeclaredClosings> {
        let loaded = self.loaded.as_ref().filter(|_| self.segment.is_none())?;
        let scan = self.scan.borrow().as_ref()?.as_ref().ok()?.clone();
        let mut found: Vec<Option<SubDeviceInfo>> = alloc::vec![None; loaded.declaration.subdevices.len()];
        for resolution in resolve(&loaded.declaration.subdevices, &scan.subdevices) {
            if let Resolution::Found { config, info } = resolution {
                found[config] = Some(scan.subdevices[info].clone());
            }
        }
        let placed = |connection: &JunctionConnection| Some((*connection, closing(connection, &found).ok()?.ok()?));
        Some(DeclaredClosings {
            closings: loaded.connections.iter().filter_map(placed).collect(),
            nodes: scan.subdevices.iter().map(node_status).collect(),
            main_count: scan.main_count,
        })
    }

    /// Last step: lays out process data, starts configuration and supervision, and hands out the cyclic half. What was
    /// loaded stays so if it cannot be applied: after another scan, or with another connection, it may be.
    ///
    /// # Errors
    /// [`ActivateError`]: nothing is loaded or scanned, or what does not fit what was found.
    pub fn apply(&mut self) -> Result<Active, ActivateError> {
        if self.segment.is_some() {
            return Err(ActivateError::Active);
        }
        let loaded = self.loaded.clone().ok_or(ActivateError::NotLoaded)?;
        let active = self.start_loaded(loaded)?;
        self.loaded = None;
        Ok(active)
    }

    /// Lays out process data, starts configuration and supervision, and hands out the cyclic half: [`MainDevice::load`]
    /// and [`MainDevice::apply`], with nothing in between.
    pub fn activate(&mut self, declaration: Declaration) -> Result<Active, ActivateError> {
        self.load(declaration)?;
        let result = self.apply();
        self.loaded = None;
        result
    }
}

impl Loaded {
    /// The topology with the local rings that were declared, if any were; otherwise that of the scan.
    pub(super) fn topology(
        &self,
        bus: &Bus,
        mode: JunctionMode,
        scan: &Scan,
        found: &[Option<SubDeviceInfo>],
    ) -> Result<Topology, ActivateError> {
        if self.connections.is_empty() {
            return match mode {
                JunctionMode::Strict => Err(ActivateError::Junction(JunctionError::NoConnection)),
                JunctionMode::Disabled | JunctionMode::Automatic => Ok(scan.topology.clone()),
            };
        }
        let mut closings = Vec::new();
        for connection in &self.connections {
            match closing(connection, found).map_err(ActivateError::Junction)? {
                Ok(closing) => closings.push(closing),
                Err(subdevice) => {
                    let what = alloc::format!("not there: its {connection} is not watched until a rescan finds it");
                    bus.report(Event::PlanOddity { subdevice, what });
                }
            }
        }
        let nodes: Vec<NodeStatus> = scan.subdevices.iter().map(node_status).collect();
        let topology = Topology::with_local_rings(&nodes, scan.main_count, &closings);
        if mode == JunctionMode::Strict {
            // The scan has kept it back.
            report_cabling(bus, &Scan { topology: topology.clone(), ..scan.clone() }, false);
        }
        Ok(topology)
    }

    /// Both ends of the closing cables of the rings that were declared, if any were, wherever their SubDevices are;
    /// otherwise of those of the topology.
    pub(super) fn closings(
        &self,
        topology: &Topology,
        members: &[Member],
        stations: &[StationAddress],
    ) -> Vec<[(StationAddress, u8); 2]> {
        if self.connections.is_empty() {
            let end = |at: PortOf| Some((*stations.get(at.node)?, at.port));
            let rings = topology.local_rings.iter().map(|ring| ring.closing);
            return rings.filter_map(|closing| Some([end(closing.head)?, end(closing.tail)?])).collect();
        }
        let end = |subdevice: usize, port: u8| Some((members.get(subdevice)?.station, port));
        let ends = |it: &JunctionConnection| Some([end(it.head, it.head_port)?, end(it.tail, it.tail_port)?]);
        self.connections.iter().filter_map(ends).collect()
    }
}

/// Rings that were declared and whose SubDevices are there, among those that were scanned.
#[derive(Default)]
struct DeclaredClosings {
    closings: Vec<(JunctionConnection, Closing)>,
    nodes: Vec<NodeStatus>,
    main_count: usize,
}

/// Where a declared connection is in the segment; otherwise who of its SubDevices is optional and not there.
fn closing(
    connection: &JunctionConnection,
    found: &[Option<SubDeviceInfo>],
) -> Result<Result<Closing, usize>, JunctionError> {
    let JunctionConnection { head, head_port, tail, tail_port } = *connection;
    for (subdevice, port) in [(head, head_port), (head, START_PORT), (tail, tail_port)] {
        let Some(info) = found.get(subdevice).and_then(Option::as_ref) else {
            return Ok(Err(subdevice));
        };
        let ports = &info.controller.ports;
        if ports[usize::from(port)] == PortKind::NotImplemented && *ports != [PortKind::NotImplemented; 4] {
            return Err(JunctionError::NoSuchPort { connection: *connection, subdevice, port });
        }
    }
    let node = |subdevice: usize| found[subdevice].as_ref().map_or(0, |info| usize::from(info.position.0));
    let closing = Closing {
        head: PortOf { node: node(head), port: head_port },
        tail: PortOf { node: node(tail), port: tail_port },
    };
    if closing.tail.node <= closing.head.node {
        return Err(JunctionError::NotBehind(*connection));
    }
    Ok(Ok(closing))
}
