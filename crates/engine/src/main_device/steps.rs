//! Configuration in steps: load a declaration, add connections of local rings, apply (JR-05).
//!
//! [`MainDevice::activate`] does all at once, for applications without connections to add.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress};

use super::MainDevice;
use super::activate::activate_error::ActivateError;
use super::activate::prepare::check;
use super::active::Active;
use super::declaration::Declaration;
use super::declaration::loaded::{Loaded, closing};
use super::declaration::memories::Memories;
use super::pending::Pending;
use crate::config::{Resolution, data_words, resolve};
use crate::domain::DomainId;
#[cfg(feature = "standby")]
use crate::exchange::PartnerMemory;
use crate::info::SubDeviceInfo;
use crate::junction::{JunctionConnection, JunctionError};
use crate::procedures::data_words::{read_of_scan, scanned};
use crate::procedures::idle::{are_ports_as_scanned, without_watch};
use crate::procedures::junction::{Reached, Refuted, refute};
use crate::procedures::loops::restore_for_application;
use crate::procedures::scan::node_status;
use crate::role::Function;
use crate::segment::Found;
use crate::topology::{Closing, NodeStatus};

impl MainDevice {
    /// First step: loads a declaration. It replaces a previously loaded one, with all added connections. After an error
    /// in the declaration nothing is loaded, and the memory of its images can be taken ([`MainDevice::unused_memory`]);
    /// memory that a copy of the declaration has too stays with the copy. If it is not permitted, what was loaded
    /// before stays, and the memory of the refused declaration does not come back.
    ///
    /// # Errors
    /// [`ActivateError::NotPermitted`], and errors in the declaration alone.
    pub fn load(&mut self, declaration: Declaration) -> Result<(), ActivateError> {
        self.permit(Function::Activate)?;
        self.load_permitted(declaration)
    }

    /// As [`MainDevice::load`], once it is permitted.
    pub(super) fn load_permitted(&mut self, mut declaration: Declaration) -> Result<(), ActivateError> {
        self.loaded = None;
        self.memories = Memories::of(&mut declaration)?;
        check(&declaration)?;
        self.loaded = Some(Loaded { declaration, connections: Vec::new() });
        Ok(())
    }

    /// Gives back the memory of a declaration that was not activated: after an error in the declaration, or of the
    /// activation.
    pub fn unused_memory(&mut self, domain: DomainId) -> Option<&'static mut [u8]> {
        self.memories.images.get_mut(domain.0)?.take()
    }

    /// The same of the memory for process data between both MainDevices ([`Declaration::place_partner_data`]).
    #[cfg(feature = "standby")]
    pub fn unused_partner_memory(&mut self) -> Option<PartnerMemory> {
        self.memories.partner.take()
    }

    /// Second step, as often as needed: adds the connection of a local ring. The mode is then strict, whatever the
    /// options are. After an error nothing is added.
    ///
    /// # Errors
    /// [`JunctionError`]: nothing is loaded, or the connection is wrong (JR-06).
    pub fn add_junction_connection(&mut self, connection: JunctionConnection) -> Result<(), JunctionError> {
        let loaded = self.loaded.as_mut().ok_or(JunctionError::NotLoaded)?;
        connection.check(&loaded.connections, loaded.declaration.subdevices.len())?;
        loaded.connections.push(connection);
        Ok(())
    }

    /// Reads words of the memory of each SubDevice of the last scan, by which declared SubDevices are found
    /// ([`ConfigAddress::DataWord`](crate::config::ConfigAddress)). The result is all that is known of the SubDevices
    /// after that.
    pub fn start_data_words(&mut self, words: Vec<RegisterAddress>) -> Pending<Vec<SubDeviceInfo>> {
        let (bus, segment) = (self.supervisor.bus(), self.segment.clone());
        let own = bus.clone();
        Pending::start(&own, async move {
            read_of_scan(&bus, &segment, &words).await;
            scanned(&segment)
        })
    }

    /// Before the last step, if SubDevices are declared by data words
    /// ([`ConfigAddress::DataWord`](crate::config::ConfigAddress)): reads these words of each SubDevice of the scan.
    ///
    /// The result is [`ActivateError::DataWords`] if frames are lost, or if a scan or an application begins meanwhile.
    pub fn start_loaded_data_words(&mut self) -> Pending<Result<(), ActivateError>> {
        let (bus, segment) = (self.supervisor.bus(), self.segment.clone());
        let loaded = self.loaded.as_ref().filter(|_| self.active().is_none());
        let words = loaded.map(|loaded| data_words(&loaded.declaration.subdevices)).unwrap_or_default();
        let (own, reading, of) = (bus.clone(), bus.clone(), segment.clone());
        Pending::start(&own, async move {
            if words.is_empty() {
                return Ok(());
            }
            let read = async move { read_of_scan(&reading, &of, &words).await };
            let are_read = without_watch(&bus, &segment, read).await == Some(true);
            if are_read { Ok(()) } else { Err(ActivateError::DataWords) }
        })
    }

    /// Before the last step, if connections were added: tests whether the rings close as declared. This takes some
    /// frames, and up to some seconds if no frame returns meanwhile. A ring whose closing cable is open at both ends,
    /// or whose SubDevices are not all present, is accepted without a test. Errors that [`MainDevice::apply`] detects
    /// are not checked here.
    ///
    /// The result is [`JunctionError::NotThere`] if a ring does not close as declared, [`JunctionError::NotTested`] if
    /// the segment changes during each of five tests, if a SubDevice of the scan does not answer, if a scan or an
    /// application begins meanwhile, or if a scan or another procedure uses the segment for longer than five seconds
    /// each.
    pub fn start_connection_check(&mut self) -> Pending<Result<(), JunctionError>> {
        let bus = self.supervisor.bus();
        let is_permitted = self.active().is_none() && self.permit(Function::Activate).is_ok();
        let loaded = self.loaded.clone().filter(|loaded| is_permitted && !loaded.connections.is_empty());
        let (own, segment) = (bus.clone(), self.segment.clone());
        Pending::start(&own, async move {
            let Some(loaded) = loaded else { return Ok(()) };
            let (testing, of) = (bus.clone(), segment.clone());
            let test = async move {
                // Positions and addresses are those of the scan that is valid after idle operation has ended its work.
                let declared = DeclaredClosings::of(&loaded, of.view().found()?);
                let closings: Vec<Closing> = declared.closings.iter().map(|(_, closing)| *closing).collect();
                let reached = Reached { nodes: &declared.nodes, stations: &declared.stations };
                let refuted = refute((&testing, &of), reached, declared.main_count, &closings).await;
                // The test has read the ports, which has cleared the events that show a change.
                let ports = declared.nodes.iter().map(|node| node.dl_status);
                let scanned: Vec<_> = declared.stations.iter().copied().zip(ports).collect();
                are_ports_as_scanned(&testing, &of, &scanned).await;
                Some(match refuted {
                    Refuted::None => Ok(()),
                    Refuted::Closing(number, shown) => {
                        Err(JunctionError::NotThere { connection: declared.closings[number].0, shown })
                    }
                    Refuted::NotTested => Err(JunctionError::NotTested),
                })
            };
            without_watch(&bus, &segment, test).await.flatten().unwrap_or(Err(JunctionError::NotTested))
        })
    }

    /// Last step: lays out process data, starts configuration and supervision, and returns the cyclic half. If it fails
    /// the declaration stays loaded, and may be applied after another scan or with another connection.
    ///
    /// # Errors
    /// [`ActivateError`]: nothing is loaded or scanned, or the declaration does not fit the scan.
    pub fn apply(&mut self) -> Result<Active, ActivateError> {
        self.permit(Function::Activate)?;
        let loaded = self.loaded.clone().ok_or(ActivateError::NotLoaded)?;
        self.segment.observe_written_pdos();
        let session = self.next_session(self.supervisor.bus().now());
        let (active, segment) = self.prepare_loaded(loaded, session)?;
        restore_for_application(&self.supervisor.bus(), &self.segment);
        self.start_procedures(segment);
        self.loaded = None;
        Ok(active)
    }

    /// Lays out process data, starts configuration and supervision, and returns the cyclic half: [`MainDevice::load`]
    /// and [`MainDevice::apply`] in one call.
    pub fn activate(&mut self, declaration: Declaration) -> Result<Active, ActivateError> {
        self.load(declaration)?;
        let result = self.apply();
        self.loaded = None;
        result
    }
}

/// Declared rings whose SubDevices are present, with the SubDevices of the scan.
struct DeclaredClosings {
    closings: Vec<(JunctionConnection, Closing)>,
    nodes: Vec<NodeStatus>,
    stations: Vec<StationAddress>,
    main_count: usize,
}

impl DeclaredClosings {
    fn of(loaded: &Loaded, scan: &Found) -> DeclaredClosings {
        let mut found: Vec<Option<Rc<SubDeviceInfo>>> = alloc::vec![None; loaded.declaration.subdevices.len()];
        for resolution in resolve(&loaded.declaration.subdevices, &scan.subdevices) {
            if let Resolution::Found { config, info } = resolution {
                found[config] = Some(scan.subdevices[info].clone());
            }
        }
        let placed = |connection: &JunctionConnection| Some((*connection, closing(connection, &found).ok()?.ok()?));
        DeclaredClosings {
            closings: loaded.connections.iter().filter_map(placed).collect(),
            nodes: scan.subdevices.iter().map(|info| node_status(info)).collect(),
            stations: scan.stations(),
            main_count: scan.main_count,
        }
    }
}
