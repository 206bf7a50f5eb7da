//! Power and resets (protocol 3.2, 4.7).
//!
//! Input: power, and the sequence R, E, S written to ESC_RESET_ECAT or ESC_RESET_PDI in three frames. Output: registers
//! at their reset values and a first loading of the EEPROM. Other frames between those of the sequence are ignored; a
//! wrong letter restarts the sequence.

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::{DlControl, Information, LoopControl, PortDescriptor, map};

use super::Controller;
use crate::time::SimTime;

/// Values to write to a reset register, in three frames.
const SEQUENCE: [u8; 3] = *b"RES";
const WATCHDOG_DIVIDER_RESET: u16 = 0x09C2;
const WATCHDOG_TIME_RESET: u16 = 0x03E8;
const SPEED_COUNTER_START_RESET: u16 = 0x1000;
const FILTER_DEPTHS_RESET: u16 = 0x0C04;
const AL_EVENT_MASK_RESET: u32 = 0x00FF_FF0F;

impl Controller {
    /// Power-on: reset values, no links yet, EEPROM loading.
    pub fn power_on(&mut self, now: SimTime) {
        self.powered = true;
        self.ports.unplug();
        self.restart(now);
    }

    /// Power-off, which also removes the links.
    pub fn power_off(&mut self, _now: SimTime) {
        self.powered = false;
        self.ports.unplug();
        self.deadline = SimTime::NEVER;
    }

    /// Whether there is power.
    pub fn is_powered(&self) -> bool {
        self.powered
    }

    /// Number of starts of the controller by power-on or reset. If it changes, the application restarts.
    pub fn starts(&self) -> u32 {
        self.starts
    }

    /// A letter of the reset sequence. Each frame can contain only one.
    pub(super) fn reset_written(&mut self, register: RegisterAddress, letter: u8, now: SimTime, frame: Option<u64>) {
        if frame.is_some() && frame == self.reset_frame {
            return;
        }
        self.reset_frame = frame;
        let progress = self.memory.u8(register);
        let expected = SEQUENCE.get(usize::from(progress)) == Some(&letter);
        match (expected, progress) {
            (true, 2) => self.restart(now),
            (true, _) => self.memory.set_u8(register, progress + 1),
            (false, _) => self.memory.set_u8(register, u8::from(letter == SEQUENCE[0])),
        }
    }

    /// Restarts everything except the links.
    fn restart(&mut self, now: SimTime) {
        self.starts = self.starts.wrapping_add(1);
        self.memory.clear();
        self.memory.process_ram_open = false;
        self.sync_managers.reset();
        self.fmmus.clear();
        self.compiled.forget();
        self.pass.clear();
        self.clock.restart(now);
        (self.sync_unit, self.latch_units) = Default::default();
        self.lasting_loops = [LoopControl::Auto; 4];
        self.temporary_loops = None;
        self.reset_frame = None;
        (self.station, self.alias_enabled, self.forwarding_rule, self.irq) = (0, false, true, 0);
        self.process_data_watchdog.rest();
        self.pdi_watchdog.rest();
        self.store_reset_values();
        self.configure_watchdogs();
        self.ports.set_modes([LoopControl::Auto; 4], None);
        for n in 0..self.sync_managers.count() {
            self.refresh_sync_manager(n);
        }
        self.start_loading(true, now);
        self.refresh_dl_status();
        self.schedule();
    }

    fn store_reset_values(&mut self) {
        let config = &self.config;
        let information = Information {
            controller_type: config.type_code,
            revision: config.revision,
            build: config.build,
            fmmu_count: config.fmmu_count,
            sync_manager_count: config.sync_manager_count,
            ram_kib: config.ram_kib,
            port_descriptor: PortDescriptor { ports: config.ports },
            features: config.features,
        };
        let memory = &mut self.memory;
        memory.store(map::TYPE.0.into(), &information.encode());
        memory.set_u32(map::DL_CONTROL, DlControl::RESET);
        memory.set_u16(map::AL_CONTROL, u16::from(AlState::Init.code()));
        memory.set_u16(map::AL_STATUS, u16::from(AlState::Init.code()));
        memory.set_u32(map::AL_EVENT_MASK, AL_EVENT_MASK_RESET);
        memory.set_u16(map::WATCHDOG_DIVIDER, WATCHDOG_DIVIDER_RESET);
        memory.set_u16(map::WATCHDOG_TIME_PDI, WATCHDOG_TIME_RESET);
        memory.set_u16(map::WATCHDOG_TIME_PROCESS_DATA, WATCHDOG_TIME_RESET);
        memory.set_u64(map::PRODUCT_ID, config.product_id);
        if config.features.dc {
            memory.set_u16(map::DC_SPEED_COUNTER_START, SPEED_COUNTER_START_RESET);
            memory.set_u16(map::DC_FILTER_DIFFERENCE, FILTER_DEPTHS_RESET);
        }
    }
}
