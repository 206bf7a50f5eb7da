//! Properties of a controller that differ between types and devices.
//!
//! [`ControllerConfig`] is the input of [`super::Controller::new`]; its default is like an ET1100 with two ports.

use core::time::Duration;

use ringcat_wire::register::{Features, PortKind};

use super::clock::ClockErrors;

/// Maximum number of FMMUs and SyncManagers of a controller (protocol 3.1).
pub const MAX_UNITS: u8 = 16;

/// Hardware of a controller and its EEPROM.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerConfig {
    /// TYPE (0x0000).
    pub type_code: u8,
    /// REVISION (0x0001).
    pub revision: u8,
    /// BUILD (0x0002).
    pub build: u16,
    /// FMMU_COUNT (0x0004), at most [`MAX_UNITS`].
    pub fmmu_count: u8,
    /// FMMU registers take effect when the application latches them, instead of at once.
    pub latches_fmmus: bool,
    /// SYNC_MANAGER_COUNT (0x0005), at most [`MAX_UNITS`].
    pub sync_manager_count: u8,
    /// RAM_SIZE (0x0006): KiB of process RAM from 0x1000, at most 60.
    pub ram_kib: u8,
    /// PORT_DESCRIPTOR (0x0007): physical layer of port 0..3.
    pub ports: [PortKind; 4],
    /// FEATURES (0x0008).
    pub features: Features,
    /// PRODUCT_ID (0x0E00).
    pub product_id: u64,
    /// EEPROM image; without one the device information is never loaded.
    pub sii: Vec<u8>,
    /// Duration of one read or write command of the SII interface.
    pub sii_busy: Duration,
    /// Duration of loading the configuration from the EEPROM after power-on, reset and reload.
    pub sii_load_time: Duration,
    /// One read command returns 8 bytes (otherwise 4).
    pub eight_byte_reads: bool,
    /// Imperfections of the local clock.
    pub clock_errors: ClockErrors,
    /// Value of the local clock at power-on.
    pub clock_start: u64,
    /// The controller has DC_LATCH_MODE (0x0936) and, while it is 0, does not latch the receive time of frames that
    /// arrive at a port other than 0 before they pass the processing unit (protocol 3.12, 7.5).
    pub receive_time_latch_mode: bool,
    /// The controller does not distinguish frames when it latches receive times: a port has the time of the last frame
    /// that arrived there before the latching frame reaches the processing unit, or of the next frame if none has
    /// arrived yet (protocol 7.1).
    pub latches_any_frame: bool,
    /// A word of the memory that has a value from power-on: address and value.
    pub data_word: Option<(u16, u16)>,
}

impl Default for ControllerConfig {
    fn default() -> ControllerConfig {
        ControllerConfig {
            type_code: 0x11,
            revision: 0,
            build: 2,
            fmmu_count: 8,
            latches_fmmus: false,
            sync_manager_count: 8,
            ram_kib: 8,
            ports: [PortKind::Mii, PortKind::Mii, PortKind::NotImplemented, PortKind::NotImplemented],
            features: Features::from_bits(0x00FC),
            product_id: 0,
            sii: Vec::new(),
            sii_busy: Duration::from_micros(500),
            sii_load_time: Duration::from_millis(1),
            eight_byte_reads: true,
            clock_errors: ClockErrors::default(),
            clock_start: 0,
            receive_time_latch_mode: false,
            latches_any_frame: false,
            data_word: None,
        }
    }
}
