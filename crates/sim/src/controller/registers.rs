//! Effects of writes to registers (protocol 2.2, 2.5, 3).
//!
//! Input: bytes that take effect, from a frame with a good FCS or from the PDI. Output: the new register contents and
//! their effects on other parts of the controller.

use core::time::Duration;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::{DlControl, Fmmu, SyncManager, map};

use super::Controller;
use super::counters::is_counter;
use super::event_bits::{EVENT_AL_CONTROL, EVENT_AL_STATUS, EVENT_SYNC_MANAGER_ACTIVATION};
use super::memory::Side;
use crate::frame::Port;
use crate::time::SimTime;

/// Duration of temporary loop settings (protocol 2.2).
const TEMPORARY_LOOPS: Duration = Duration::from_secs(1);
/// Bit 0 of ESC_CONFIGURATION: AL status follows AL control in hardware (protocol 3.4).
const DEVICE_EMULATION: u8 = 0x01;
/// Byte of DL_CONTROL with the loop settings.
const DL_CONTROL_LOOPS: RegisterAddress = map::DL_CONTROL.offset(1);
const TEMPORARY: u8 = 0x02;

/// Registers affected by a write.
#[derive(Clone, Copy)]
struct Touched {
    at: u32,
    end: u32,
}

impl Touched {
    fn is(self, register: RegisterAddress, len: u32) -> bool {
        self.at < u32::from(register.0) + len && u32::from(register.0) < self.end
    }
}

impl Controller {
    /// Applies a write of (value, mask) bytes inside one run of registers; `frame` is the frame that contained it.
    pub(super) fn apply(&mut self, side: Side, at: u32, bytes: &[(u8, u8)], now: SimTime, frame: Option<u64>) {
        let touched = Touched { at, end: at + bytes.len() as u32 };
        let al_control_pending = !self.emulates() && self.al_event() & EVENT_AL_CONTROL != 0;
        for (address, &(value, mask)) in (at..).zip(bytes) {
            if self.takes_value(address, al_control_pending) {
                let register = RegisterAddress(address as u16);
                let old = self.memory.u8(register);
                self.memory.set_u8(register, old & !mask | value & mask);
            }
        }
        let first = bytes.first().map_or(0, |&(value, _)| value);
        if matches!(at >> 8, 0x00 | 0x06 | 0x08) {
            self.compiled.forget();
        }
        match at >> 8 {
            0x00 => self.addressing_written(touched, first, now, frame),
            0x01 => self.layers_written(touched, al_control_pending, now, frame),
            0x02 => self.refresh_irq(),
            0x03 => self.clear_counters(touched.at, touched.end),
            0x04 => {
                self.clear_counters(touched.at, touched.end);
                self.configure_watchdogs();
            }
            0x05 => self.sii_written(side, at, bytes, now),
            0x06 if !self.config.latches_fmmus => self.configure_fmmus(),
            0x08 => self.sync_managers_written(touched),
            0x09 => self.clock_written(at, bytes, self.pass.start, now),
            _ => {}
        }
        if side == Side::Pdi {
            self.schedule();
        }
    }

    /// Whether the byte stores written values.
    fn takes_value(&self, address: u32, al_control_pending: bool) -> bool {
        let block =
            |start: RegisterAddress, len: u32| (u32::from(start.0)..u32::from(start.0) + len).contains(&address);
        match address >> 8 {
            0x00 => {
                let keys = [map::REGISTER_WRITE_ENABLE, map::ESC_WRITE_ENABLE, map::ESC_RESET_ECAT, map::ESC_RESET_PDI];
                !keys.iter().any(|key| u32::from(key.0) == address)
            }
            0x01 => !(al_control_pending && block(map::AL_CONTROL, 2)),
            0x03 | 0x04 => !is_counter(address),
            0x05 => !block(map::SII_CONFIGURATION, 4),
            // Start and length are writable only while the SyncManager is disabled (protocol 3.11).
            0x08 => address & 7 > 3 || !self.sync_managers.enabled((address as usize & 0xFF) / SyncManager::LEN),
            0x09 => !block(map::DC_RECEIVE_TIME, 16) && !block(map::DC_SYSTEM_TIME, 8),
            _ => true,
        }
    }

    fn addressing_written(&mut self, touched: Touched, value: u8, now: SimTime, frame: Option<u64>) {
        if touched.is(map::STATION_ADDRESS, 2) {
            self.station = self.memory.u16(map::STATION_ADDRESS);
        }
        for register in [map::ESC_RESET_ECAT, map::ESC_RESET_PDI] {
            if touched.is(register, 1) {
                self.reset_written(register, value, now, frame);
            }
        }
    }

    fn layers_written(&mut self, touched: Touched, al_control_pending: bool, now: SimTime, frame: Option<u64>) {
        if touched.is(map::DL_CONTROL, 4) {
            let control = DlControl::decode(&self.memory.array(map::DL_CONTROL));
            (self.alias_enabled, self.forwarding_rule) = (control.alias_enable, control.forwarding_rule);
            if touched.is(DL_CONTROL_LOOPS, 1) {
                self.loops_written(now, frame);
            } else if self.memory.u8(map::DL_CONTROL) & TEMPORARY == 0 {
                // The bit was cleared: the settings become permanent.
                self.temporary_loops = None;
            }
        }
        if touched.is(map::AL_CONTROL, 1) && !al_control_pending {
            if self.emulates() {
                self.memory.set_u16(map::AL_STATUS, self.memory.u16(map::AL_CONTROL));
                self.set_ecat_event(EVENT_AL_STATUS);
            } else {
                self.set_al_event(EVENT_AL_CONTROL);
            }
        }
        if touched.is(map::AL_STATUS, 2) {
            self.set_ecat_event(EVENT_AL_STATUS);
        }
    }

    /// Device emulation: no application responds to state requests.
    fn emulates(&self) -> bool {
        self.memory.u8(map::ESC_CONFIGURATION) & DEVICE_EMULATION != 0
    }

    fn loops_written(&mut self, now: SimTime, frame: Option<u64>) {
        let control = DlControl::decode(&self.memory.array(map::DL_CONTROL));
        if control.temporary {
            let before = self.temporary_loops.map_or(self.lasting_loops, |(_, before)| before);
            self.temporary_loops = Some((now + TEMPORARY_LOOPS, before));
        } else {
            self.temporary_loops = None;
        }
        self.lasting_loops = control.loops;
        self.ports.set_modes(control.loops, frame);
        self.refresh_dl_status();
    }

    /// Restores the loop settings from before the temporary ones.
    pub(super) fn end_temporary_loops(&mut self) {
        let Some((_, loops)) = self.temporary_loops.take() else { return };
        let control = DlControl { loops, temporary: false, ..DlControl::decode(&self.memory.array(map::DL_CONTROL)) };
        self.memory.store(map::DL_CONTROL.0.into(), &control.encode());
        self.lasting_loops = loops;
        self.ports.set_modes(loops, None);
        self.refresh_dl_status();
    }

    /// Applies divider and times of the watchdogs.
    pub(super) fn configure_watchdogs(&mut self) {
        let divider = self.memory.u16(map::WATCHDOG_DIVIDER);
        self.process_data_watchdog.configure(divider, self.memory.u16(map::WATCHDOG_TIME_PROCESS_DATA));
        self.pdi_watchdog.configure(divider, self.memory.u16(map::WATCHDOG_TIME_PDI));
        self.refresh_watchdog_status();
    }

    pub(super) fn refresh_watchdog_status(&mut self) {
        self.memory.set_u16(map::WATCHDOG_STATUS, u16::from(self.process_data_watchdog.ok()));
    }

    /// A complete write of a SyncManager with watchdog trigger (protocol 3.7).
    pub(super) fn trigger_process_data_watchdog(&mut self, now: SimTime) {
        self.process_data_watchdog.trigger(now);
        self.refresh_watchdog_status();
        self.schedule();
    }

    /// Latched FMMUs take their register values now if `active`, otherwise they are disabled.
    pub(crate) fn latch_fmmus(&mut self, active: bool) {
        if !self.config.latches_fmmus {
            return;
        }
        self.compiled.forget();
        if active { self.configure_fmmus() } else { self.fmmus.clear() }
    }

    fn configure_fmmus(&mut self) {
        self.fmmus.clear();
        for n in 0..self.config.fmmu_count.min(super::MAX_UNITS) {
            let fmmu = Fmmu::decode(&self.memory.array(map::fmmu(n)));
            self.fmmus.push(&fmmu, self.config.features.fmmu_byte_oriented);
        }
        if self.fmmus.reach_registers() {
            self.ports.note_change();
        }
    }

    fn sync_managers_written(&mut self, touched: Touched) {
        for n in 0..self.sync_managers.count() {
            let register = map::sync_manager(n as u8);
            if !touched.is(register, SyncManager::LEN as u32) {
                continue;
            }
            let registers = SyncManager::decode(&self.memory.array(register));
            if self.sync_managers.configure(n, &registers) {
                self.set_al_event(EVENT_SYNC_MANAGER_ACTIVATION);
            }
            self.refresh_sync_manager(n);
        }
    }

    /// Latches the receive times of the ports at which the frame arrived, and of the processing unit (protocol 3.12).
    pub(super) fn latch_receive_times(&mut self, frame: u64, at_unit: SimTime) {
        let forwarding = !self.config.receive_time_latch_mode || self.memory.u8(map::DC_LATCH_MODE) & 1 != 0;
        for (port, at) in self.clock.latch(frame, at_unit, self.config.latches_any_frame) {
            if forwarding || port == Port::A {
                self.store_receive_time(port, at);
            }
        }
        let local = self.clock.stamp(Port::A, at_unit);
        if self.config.features.dc_64bit {
            self.memory.set_u64(map::DC_RECEIVE_TIME_EPU, local);
        } else {
            self.memory.set_u32(map::DC_RECEIVE_TIME_EPU, local as u32);
        }
    }

    /// The last frame that latched receive times, by its number in the simulation, and the exact time at which the
    /// processing unit processed it; a MainDevice cannot read these values.
    pub const fn latched(&self) -> Option<(u64, SimTime)> {
        self.clock.latched()
    }

    pub(super) fn store_receive_time(&mut self, port: Port, at: SimTime) {
        let register = map::dc_receive_time(port.index() as u8);
        self.memory.set_u32(register, self.clock.stamp(port, at) as u32);
    }
}
