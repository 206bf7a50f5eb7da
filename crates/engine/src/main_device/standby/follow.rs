//! An application that follows the ACTIVE MainDevice of the ring: everything is prepared for a takeover, and nothing is
//! sent (protocol 9.10).
//!
//! In: the declaration, the same as on the ACTIVE, and its knowledge of the segment. The layout of process data
//! follows from both, and is that of the ACTIVE: the SubDevices keep their FMMUs.

use alloc::rc::Rc;
use alloc::vec::Vec;

use crate::info::SubDeviceInfo;
use crate::knowledge::Knowledge;
use crate::main_device::MainDevice;
use crate::main_device::activate::activate_error::ActivateError;
use crate::main_device::active::Active;
use crate::main_device::declaration::Declaration;
use crate::procedures::mirror::mirror;
use crate::role::Function;
use crate::segment::clocks::ClockObservation;
use crate::segment::{Found, Observation, Scan};

impl MainDevice {
    /// Prepares an application that follows the ACTIVE, in role INACTIVE: its process data has the places that it has
    /// there. `knowledge` and `session` are those of the ACTIVE ([`MainDevice::partner_knowledge`],
    /// [`MainDevice::partner_configuration`]). No frame is sent; when the role becomes ACTIVE, the exchange goes on
    /// with the next cycle, and the SubDevices stay as they are.
    ///
    /// # Errors
    /// This MainDevice is ACTIVE, has an application, or the declaration does not fit what is known of the segment.
    pub fn follow(
        &mut self,
        declaration: Declaration,
        knowledge: Knowledge,
        session: u16,
    ) -> Result<Active, ActivateError> {
        self.permit(Function::Follow)?;
        self.assume(knowledge);
        self.load_permitted(declaration)?;
        let loaded = self.loaded.take().ok_or(ActivateError::NotLoaded)?;
        let (active, segment) = self.prepare_loaded(loaded, session.into())?;
        self.statistics = Some(segment.statistics.clone());
        self.segment = segment;
        self.begin_mirror();
        Ok(active)
    }

    /// Takes over the knowledge of another MainDevice about the segment, as if a scan had found it.
    fn assume(&mut self, knowledge: Knowledge) {
        self.supervisor.assume_ring(knowledge.ring);
        self.segment.observe(Observation::ScanBegun);
        *self.scan_error.borrow_mut() = None;
        if let Some(known) = &knowledge.clocks {
            self.segment.observe_clocks(ClockObservation::Known(Rc::new(known.clone())));
        }
        let scan = scan_of(&knowledge);
        self.cache.learn(knowledge.siis);
        self.segment.observe(Observation::ScanEnded(Ok(scan)));
    }

    /// The SubDevices in the knowledge of the ACTIVE, to declare them; `None` before all of it has arrived.
    pub fn partner_scan(&self) -> Option<Scan> {
        self.partner_knowledge().map(|knowledge| scan_of(&knowledge))
    }

    /// From now on the model shows the states reported by the ACTIVE.
    pub(in crate::main_device) fn begin_mirror(&mut self) {
        let (bus, segment) = (self.supervisor.bus(), self.segment.clone());
        self.supervisor.spawn(mirror(bus, segment, self.requests.clone()));
    }
}

/// What a scan would have found.
fn scan_of(knowledge: &Knowledge) -> Scan {
    let subdevices: Vec<Rc<SubDeviceInfo>> =
        knowledge.subdevices.iter().map(|known| Rc::new(known.info.clone())).collect();
    Found { subdevices, topology: knowledge.topology.clone(), main_count: knowledge.main_count }.scan()
}
