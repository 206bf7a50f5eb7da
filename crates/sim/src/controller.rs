//! One SubDevice controller (ESC), register by register (facts 2, 3, 4.7, 11.4).

mod config;

pub use config::{ControllerConfig, MAX_UNITS};

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::{AlControl, AlStatus, AlStatusCode};

use crate::frame::{Port, SimFrame};
use crate::time::SimTime;

/// What becomes of a frame that a controller received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// It leaves by this port, which may be forced open without a link: the frame is lost then.
    Leaves {
        /// The port.
        port: Port,
        /// Whether the processing unit was on the way.
        processed: bool,
    },
    /// It ends here.
    Destroyed,
}

/// A SubDevice controller.
#[derive(Clone, Debug)]
pub struct Controller {
    config: ControllerConfig,
}

#[allow(unused_variables, missing_docs)]
impl Controller {
    pub fn new(config: ControllerConfig) -> Controller {
        Controller { config }
    }
    pub fn power_on(&mut self, now: SimTime) {}
    pub fn power_off(&mut self, now: SimTime) {}
    pub fn is_powered(&self) -> bool {
        false
    }
    /// Counts resets (0x0040, 0x0041) and power-ons: a change means the application starts anew.
    pub fn starts(&self) -> u32 {
        0
    }
    pub fn link_changed(&mut self, port: Port, up: bool, now: SimTime) {}
    pub fn receive(&mut self, frame: &mut SimFrame, port: Port, now: SimTime) -> Passage {
        Passage::Destroyed
    }
    pub fn loop_closed(&self, port: Port) -> bool {
        true
    }
    /// Reads for the PDI: false where any byte is blocked (SM direction, mailbox empty, no complete buffer, watchdog).
    pub fn pdi_read(&mut self, address: RegisterAddress, out: &mut [u8], now: SimTime) -> bool {
        false
    }
    pub fn pdi_write(&mut self, address: RegisterAddress, data: &[u8], now: SimTime) -> bool {
        false
    }
    /// AL_EVENT (0x0220) without the mask.
    pub fn al_event(&self) -> u32 {
        0
    }
    /// PDI reads AL control: clears event bit 0.
    pub fn al_control(&mut self, now: SimTime) -> AlControl {
        AlControl::from_bits(0)
    }
    pub fn set_al_status(&mut self, status: AlStatus, code: AlStatusCode, now: SimTime) {}
    /// The PDI watchdog only runs while the application is not alive (hangs); default alive.
    pub fn set_pdi_alive(&mut self, alive: bool, now: SimTime) {}
    pub fn sii_image(&self) -> &[u8] {
        &self.config.sii
    }
    pub fn sii_image_mut(&mut self) -> &mut Vec<u8> {
        &mut self.config.sii
    }
    /// Next instant at which something the application or network must react to happens by itself.
    pub fn next_deadline(&self) -> Option<SimTime> {
        None
    }
    pub fn tick(&mut self, now: SimTime) {}
    pub fn local_time(&self, now: SimTime) -> u64 {
        0
    }
    pub fn system_time(&self, now: SimTime) -> u64 {
        0
    }
    /// Raw view of registers and RAM; empty where the range leaves the memory.
    pub fn register(&self, address: RegisterAddress, len: usize) -> &[u8] {
        &[]
    }
    /// DIGITAL_OUTPUTS (0x0F00); `None` while the process data watchdog keeps them from the terminals.
    pub fn digital_outputs(&self) -> Option<[u8; 4]> {
        None
    }
    /// SII loaded: PDI and process RAM are open.
    pub fn pdi_operational(&self) -> bool {
        false
    }
    /// Process data watchdog: false when expired.
    pub fn process_data_watchdog_ok(&self) -> bool {
        true
    }
    pub fn config(&self) -> &ControllerConfig {
        &self.config
    }
}
