//! Configuration in steps: load what the application declares, add connections of local rings, apply (JR-05).
//!
//! [`MainDevice::activate`] is all of it at once, for applications that have nothing to add.

use alloc::vec::Vec;

use super::MainDevice;
use super::activate_error::ActivateError;
use super::active::Active;
use super::declaration::Declaration;
use super::loaded::{Loaded, closing};
use super::pending::Pending;
use super::prepare::check;
use crate::config::{Resolution, resolve};
use crate::info::SubDeviceInfo;
use crate::junction::{JunctionConnection, JunctionError};
use crate::procedures::junction::refute;
use crate::procedures::scan::node_status;
use crate::topology::{Closing, NodeStatus};

impl MainDevice {
    /// First step: takes a declaration. It takes the place of one that was loaded before, with all that was added to
    /// it.
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

    /// Before the last step, where connections were added: tries whether the rings close where they are said to, which
    /// takes some frames, and about two seconds where one does not. A ring whose closing cable is open at both ends, or
    /// whose SubDevices are not all there, is believed. What [`MainDevice::apply`] finds by itself is left to it.
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

/// Rings that were declared and whose SubDevices are there, among those that were scanned.
#[derive(Default)]
struct DeclaredClosings {
    closings: Vec<(JunctionConnection, Closing)>,
    nodes: Vec<NodeStatus>,
    main_count: usize,
}
