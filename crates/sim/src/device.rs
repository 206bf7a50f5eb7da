//! A SubDevice: a controller and its application.
//!
//! Input: a [`DeviceDescription`] or a real SII image; frames through [`Device::controller`], virtual time, faults.
//! Output: the device's reactions, its inputs and outputs for inspection. The network handles cables and frames between
//! devices.

use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::{Features, map};

use crate::application::mailbox::faults::MailFault;
use crate::application::{Application, InputSource};
use crate::controller::{Controller, ControllerConfig};
use crate::description::DeviceDescription;
use crate::sii_image::{self, DescriptionError};
use crate::time::SimTime;

/// Features without distributed clocks: bit-wise FMMUs, enhanced link detection, separate FCS errors.
const FEATURES_PLAIN: u16 = 0x00E0;
/// Feature bits of a clock with 32 and with 64 bits.
const FEATURES_DC_32: u16 = 0x0004;
const FEATURES_DC_64: u16 = 0x000C;

/// A SubDevice with power supply, controller and application.
#[derive(Clone, Debug)]
pub struct Device {
    /// The controller: ports, registers, EEPROM.
    pub controller: Controller,
    /// The application at the PDI.
    pub application: Application,
    /// Its description. Changes to it have no effect on registers and EEPROM.
    pub description: DeviceDescription,
    starts: u32,
}

impl Device {
    /// A device without power.
    pub fn new(description: DeviceDescription) -> Device {
        let controller = Controller::new(controller_config(&description));
        let starts = controller.starts();
        Device { application: Application::new(&description), controller, description, starts }
    }

    /// A device with this SII image.
    pub fn from_sii(image: Vec<u8>, name: &str) -> Result<Device, DescriptionError> {
        Ok(Device::new(DeviceDescription::from_sii(image, name)?))
    }

    /// Name in the segment.
    pub fn name(&self) -> &str {
        &self.description.name
    }

    /// Switches the power on.
    pub fn power_on(&mut self, now: SimTime) {
        self.controller.power_on(now);
        self.follow_restart(now);
    }

    /// Switches the power off.
    pub fn power_off(&mut self, now: SimTime) {
        self.controller.power_off(now);
        self.application.restart(&self.description, now);
    }

    /// Makes the application hang, or continue.
    pub fn hang(&mut self, hanging: bool, now: SimTime) {
        self.application.hang(hanging);
        self.controller.set_pdi_alive(!hanging, now);
    }

    /// The next `times` requests for `to` are refused with `code`; no effect if the controller emulates the device.
    pub fn refuse_transition(&mut self, to: AlState, code: AlStatusCode, times: u32) {
        self.application.refuse(to, code, times);
    }

    /// Sets a fault of the device's mail.
    pub fn disturb_mail(&mut self, fault: MailFault, now: SimTime) {
        self.application.disturb_mail(fault, now);
    }

    /// Runs controller and application up to now.
    pub fn run(&mut self, now: SimTime) {
        if !self.controller.is_powered() {
            return;
        }
        self.controller.catch_up(now);
        self.follow_restart(now);
        self.application.run(&self.description, &mut self.controller, now);
    }

    /// The application restarts with the controller.
    fn follow_restart(&mut self, now: SimTime) {
        let starts = self.controller.starts();
        if starts != self.starts {
            self.starts = starts;
            self.application.restart(&self.description, now);
        }
    }

    /// Whether [`Device::run`] has something to do now, after a frame.
    pub fn needs_run(&self) -> bool {
        self.controller.starts() != self.starts || self.application.needs_run(self.controller.al_event())
    }

    /// Next time at which [`Device::run`] has work without a frame.
    pub fn next_deadline(&self) -> Option<SimTime> {
        if !self.controller.is_powered() {
            return None;
        }
        match (self.controller.next_deadline(), self.application.next_deadline()) {
            (Some(controller), Some(application)) => Some(controller.min(application)),
            (controller, application) => controller.or(application),
        }
    }

    /// AL status as EtherCAT reads it.
    pub fn al_status(&self) -> AlStatus {
        let bytes = self.controller.register(map::AL_STATUS, AlStatus::LEN);
        bytes.first_chunk().map_or(AlStatus::new(AlState::Init), AlStatus::decode)
    }

    /// AL status code as EtherCAT reads it.
    pub fn al_status_code(&self) -> AlStatusCode {
        let bytes = self.controller.register(map::AL_STATUS_CODE, AlStatusCode::LEN);
        bytes.first_chunk().map_or(AlStatusCode::NO_ERROR, AlStatusCode::decode)
    }

    /// Valid outputs: zero in the safe state, empty below SAFEOP.
    pub fn outputs(&self) -> &[u8] {
        self.application.process_data().outputs()
    }

    /// Inputs as EtherCAT reads them, empty below SAFEOP.
    pub fn inputs(&self) -> &[u8] {
        self.application.process_data().inputs()
    }

    /// Number of times that outputs were latched in OP. If a SyncManager raises no event, only changes are counted.
    pub const fn outputs_latched(&self) -> u64 {
        self.application.process_data().latched()
    }

    /// Sets the inputs. A drive computes its own inputs and ignores them.
    pub fn set_inputs(&mut self, bytes: &[u8]) {
        self.set_input_source(InputSource::Constant(bytes.into()));
    }

    /// Sets the source of the inputs. A drive computes its own inputs and ignores it.
    pub fn set_input_source(&mut self, source: InputSource) {
        self.application.set_source(source, &self.description, &mut self.controller);
    }
}

/// The configuration of the controller for a description.
fn controller_config(description: &DeviceDescription) -> ControllerConfig {
    let clock = match &description.dc {
        None => 0,
        Some(dc) if dc.wide => FEATURES_DC_64,
        Some(_) => FEATURES_DC_32,
    };
    ControllerConfig {
        ports: description.ports,
        ram_kib: description.ram_kib(),
        sync_manager_count: description.sync_manager_count(),
        features: Features::from_bits(FEATURES_PLAIN | clock),
        sii: sii_image::build(description),
        sii_busy: description.sii_busy,
        eight_byte_reads: description.eight_byte_sii,
        clock_errors: description.clock_errors(),
        clock_start: description.clock_start_ns,
        receive_time_latch_mode: description.latches_processing_only,
        latches_fmmus: description.latches_fmmus,
        fmmu_count: description.controller_fmmus.unwrap_or(ControllerConfig::default().fmmu_count),
        latches_any_frame: description.latches_any_frame,
        data_word: description.data_word,
        ..ControllerConfig::default()
    }
}

#[cfg(test)]
mod tests;
