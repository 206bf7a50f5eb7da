//! The SII interface: commands to the EEPROM, its owner, loading the configuration (protocol 3.8, 4.7).
//!
//! Input: writes to 0x0500..0x050F and virtual time. Output: data, busy and error bits, and after loading the registers
//! that come from the EEPROM. A command starts at the end of its frame and takes the configured time.

mod interface;

use core::time::Duration;

use ringcat_wire::register::{SiiCommand, SiiControl, SiiPdiAccess, map};
use ringcat_wire::sii;

use super::Controller;
use super::memory::Side;
use super::spoilt_write::SpoiltWrite;
use crate::time::SimTime;
use interface::Task;

pub(super) use interface::SiiInterface;

/// Bytes of the loaded words 0 to 7.
const CONFIGURATION_AREA: usize = 16;
/// Bytes covered by the checksum.
const CHECKED: usize = 14;
/// Images larger than 16 KBit need two address bytes.
const ONE_ADDRESS_BYTE: usize = 2048;
/// Value of bytes beyond the end of the image.
const ERASED: u8 = 0xFF;

impl Controller {
    /// The content of the EEPROM.
    pub fn sii_image(&self) -> &[u8] {
        &self.config.sii
    }

    /// The content of the EEPROM, for damage. Loaded values stay until the next loading.
    pub fn sii_image_mut(&mut self) -> &mut Vec<u8> {
        &mut self.config.sii
    }

    fn sii_control(&self) -> SiiControl {
        SiiControl::decode(&self.memory.array(map::SII_CONTROL))
    }

    fn set_sii_control(&mut self, control: SiiControl) {
        self.memory.store(map::SII_CONTROL.0.into(), &control.encode());
    }

    pub(super) fn sii_owned_by_pdi(&self) -> bool {
        self.memory.u8(map::SII_PDI_ACCESS) & 1 != 0
    }

    /// Whether a side may write control, address and data: it owns the interface, and the interface is not busy.
    pub(super) fn sii_writable(&self, side: Side) -> bool {
        let offered = self.memory.u8(map::SII_CONFIGURATION) & 1 != 0;
        let owner = match side {
            Side::Ecat => !offered && !self.sii_owned_by_pdi(),
            Side::Pdi => self.sii_owned_by_pdi(),
        };
        owner && !self.sii.is_busy()
    }

    /// Write enable applies to one frame (protocol 3.8).
    pub(super) fn clear_sii_write_enable(&mut self) {
        if self.sii.write_enabled {
            self.set_sii_write_enable(false);
        }
    }

    fn set_sii_write_enable(&mut self, enabled: bool) {
        self.sii.write_enabled = enabled;
        let low = self.memory.u8(map::SII_CONTROL);
        self.memory.set_u8(map::SII_CONTROL, low & !1 | u8::from(enabled));
    }

    /// Applies a write to 0x0500..0x0503; address and data are plain registers.
    pub(super) fn sii_written(&mut self, side: Side, at: u32, bytes: &[(u8, u8)], now: SimTime) {
        const CONFIGURATION: u32 = map::SII_CONFIGURATION.0 as u32;
        const PDI_ACCESS: u32 = map::SII_PDI_ACCESS.0 as u32;
        const CONTROL: u32 = map::SII_CONTROL.0 as u32;
        const COMMAND: u32 = CONTROL + 1;
        for (address, &(value, _)) in (at..).zip(bytes) {
            match address {
                CONFIGURATION => self.sii_configuration_written(value),
                PDI_ACCESS => self.sii_pdi_access_written(value),
                CONTROL => self.set_sii_write_enable(value & 1 != 0),
                COMMAND => self.sii.command = Some(SiiControl::from_bits(u16::from(value) << 8).command),
                _ => {}
            }
        }
        if side == Side::Pdi {
            self.run_sii_command(side, now);
        }
    }

    fn sii_configuration_written(&mut self, value: u8) {
        self.memory.set_u8(map::SII_CONFIGURATION, value & 3);
        if value & 2 != 0 {
            self.memory.set_u8(map::SII_PDI_ACCESS, 0);
        }
    }

    /// The PDI can accept the offered interface and return it.
    fn sii_pdi_access_written(&mut self, value: u8) {
        let wanted = SiiPdiAccess::from_bits(value).pdi_access;
        let offered = self.memory.u8(map::SII_CONFIGURATION) & 1 != 0;
        self.memory.set_u8(map::SII_PDI_ACCESS, u8::from(wanted && (offered || self.sii_owned_by_pdi())));
    }

    /// Starts a written command. Any valid command clears the error bits of the last one.
    pub(super) fn run_sii_command(&mut self, side: Side, now: SimTime) {
        let Some(command) = self.sii.command.take() else { return };
        let mut control = self.sii_control();
        control.command_error = matches!(command, SiiCommand::Reserved(_));
        control.write_enable_error = command == SiiCommand::Write && side == Side::Ecat && !control.write_enable;
        let refused = control.command_error || control.write_enable_error;
        self.set_sii_control(control);
        match command {
            SiiCommand::Read => self.start_sii_task(Task::Read, command, now),
            SiiCommand::Write if !refused => self.start_sii_task(Task::Write, command, now),
            SiiCommand::Reload => self.start_loading(false, now),
            SiiCommand::Idle | SiiCommand::Write | SiiCommand::Reserved(_) => {}
        }
    }

    fn start_sii_task(&mut self, task: Task, command: SiiCommand, now: SimTime) {
        let time = match task {
            Task::Load { .. } => self.config.sii_load_time,
            Task::Idle | Task::Read | Task::Write => self.sii_busy(),
        };
        (self.sii.task, self.sii.until) = (task, now + time);
        self.set_sii_control(SiiControl { busy: true, command, ..self.sii_control() });
    }

    /// Duration of the next command.
    fn sii_busy(&mut self) -> Duration {
        let (times, busy) = &mut self.sii.slow;
        match times.checked_sub(1) {
            Some(rest) => {
                *times = rest;
                *busy
            }
            None => self.config.sii_busy,
        }
    }

    /// Sets the duration of this number of commands.
    pub fn slow_sii(&mut self, busy: Duration, times: u32) {
        self.sii.slow = (times, busy);
    }

    /// Makes this number of writes fail.
    pub fn spoil_sii_writes(&mut self, how: SpoiltWrite, times: u32) {
        self.sii.spoilt = (times, how);
    }

    /// Starts loading the configuration.
    pub(super) fn start_loading(&mut self, first: bool, now: SimTime) {
        (self.sii.command, self.sii.write_enabled) = (None, false);
        self.set_sii_control(SiiControl {
            write_enable: false,
            eight_byte_reads: self.config.eight_byte_reads,
            two_address_bytes: self.config.sii.len() > ONE_ADDRESS_BYTE,
            ..self.sii_control()
        });
        self.start_sii_task(Task::Load { first }, SiiCommand::Reload, now);
    }

    /// Ends the running command.
    pub(super) fn finish_sii_task(&mut self) {
        let task = self.sii.task;
        (self.sii.task, self.sii.until) = (Task::Idle, SimTime::NEVER);
        self.set_sii_control(SiiControl { busy: false, command: SiiCommand::Idle, ..self.sii_control() });
        match task {
            Task::Idle => {}
            Task::Load { first } => self.load_configuration(first),
            Task::Read => self.read_sii(),
            Task::Write => self.write_sii(),
        }
    }

    /// Offset in the image of the word at SII_ADDRESS.
    fn sii_offset(&self) -> usize {
        usize::try_from(self.memory.u32(map::SII_ADDRESS)).map_or(usize::MAX, |word| word.saturating_mul(2))
    }

    fn read_sii(&mut self) {
        let len = if self.config.eight_byte_reads { 8 } else { 4 };
        let mut data = [ERASED; 8];
        let rest = self.config.sii.get(self.sii_offset()..).unwrap_or(&[]);
        let there = rest.len().min(len);
        data[..there].copy_from_slice(&rest[..there]);
        self.memory.store(map::SII_DATA.0.into(), &data[..len]);
    }

    fn write_sii(&mut self) {
        if let Some(rest) = self.sii.spoilt.0.checked_sub(1) {
            self.sii.spoilt.0 = rest;
            match self.sii.spoilt.1 {
                SpoiltWrite::NotStored => {}
                SpoiltWrite::NotAcknowledged => {
                    self.set_sii_control(SiiControl { command_error: true, ..self.sii_control() });
                }
            }
            return;
        }
        let offset = self.sii_offset();
        let word: [u8; 2] = self.memory.array(map::SII_DATA);
        match self.config.sii.get_mut(offset..offset.saturating_add(2)) {
            Some(bytes) => bytes.copy_from_slice(&word),
            // An EEPROM does not respond to addresses beyond its end.
            None => self.set_sii_control(SiiControl { command_error: true, ..self.sii_control() }),
        }
    }

    /// Applies words 0 to 7 if their checksum is valid. The alias is applied only the first time (protocol 2.7).
    fn load_configuration(&mut self, first: bool) {
        let area =
            self.config.sii.get(..CONFIGURATION_AREA).and_then(|area| <[u8; CONFIGURATION_AREA]>::try_from(area).ok());
        let valid = area.filter(checksum_matches);
        let control = self.sii_control();
        self.set_sii_control(SiiControl {
            checksum_error: valid.is_none(),
            device_info_not_loaded: valid.is_none(),
            ..control
        });
        if let Some(area) = valid {
            self.memory.store(map::PDI_CONTROL.0.into(), &area[0..2]);
            self.memory.store(map::PDI_CONFIGURATION.0.into(), &area[2..4]);
            self.memory.store(map::EXTENDED_PDI_CONFIGURATION.0.into(), &area[6..8]);
            if self.config.features.dc {
                self.memory.store(map::DC_PULSE_LENGTH.0.into(), &area[4..6]);
            }
            if first {
                self.memory.store(map::STATION_ALIAS.0.into(), &area[8..10]);
            }
        }
        self.memory.process_ram_open = valid.is_some();
        self.set_data_word();
        self.compiled.forget();
        self.refresh_dl_status();
    }

    /// The application writes its data word to the memory, once the memory exists.
    pub fn set_data_word(&mut self) {
        if let Some((address, value)) = self.config.data_word.filter(|_| self.memory.process_ram_open) {
            self.memory.store(address.into(), &value.to_le_bytes());
        }
    }
}

fn checksum_matches(area: &[u8; CONFIGURATION_AREA]) -> bool {
    let mut checked = [0; CHECKED];
    checked.copy_from_slice(&area[..CHECKED]);
    let stored = u16::from_le_bytes([area[CHECKED], area[CHECKED + 1]]);
    stored == sii::CHECKSUM_DISABLED || stored as u8 == sii::checksum(&checked)
}
