//! The PDI side of the controller (protocol 3.4, 3.5, 3.7, 3.11).
//!
//! Input: reads and writes of the application. Output: bytes, according to SyncManagers and watchdog, and the events
//! that reads and writes clear and raise.

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::{AlControl, AlStatus, AlStatusCode};
use ringcat_wire::register::map;

use super::Controller;
use super::event_bits::EVENT_AL_STATUS;
use super::memory::Side;
use crate::time::SimTime;

impl Controller {
    /// Reads for the PDI. `false`, with unspecified bytes in `out`, if any byte is blocked: no such register; a
    /// SyncManager of the other direction, disabled, with an empty mailbox or without a complete buffer; outputs with
    /// an expired watchdog; or the EEPROM not loaded.
    pub fn pdi_read(&mut self, address: RegisterAddress, out: &mut [u8], now: SimTime) -> bool {
        self.begin_pdi_access(now) && self.read(Side::Pdi, address.0.into(), out, false) == out.len()
    }

    /// Writes for the PDI. `false` if any byte is blocked; the others are written.
    pub fn pdi_write(&mut self, address: RegisterAddress, data: &[u8], now: SimTime) -> bool {
        self.begin_pdi_access(now) && self.write(Side::Pdi, address.0.into(), data, 0xFF) == data.len()
    }

    fn begin_pdi_access(&mut self, now: SimTime) -> bool {
        if now >= self.deadline {
            self.tick(now);
        }
        self.pass.start = now;
        self.powered && self.pdi_operational()
    }

    /// Whether the EEPROM is loaded, so that PDI and process RAM are accessible (protocol 3.13).
    pub fn pdi_operational(&self) -> bool {
        self.memory.process_ram_open
    }

    /// AL_EVENT (0x0220), without the mask.
    pub fn al_event(&self) -> u32 {
        self.memory.u32(map::AL_EVENT)
    }

    /// Reads AL_CONTROL, which clears its AL event and allows EtherCAT to write it again.
    pub fn al_control(&mut self, now: SimTime) -> AlControl {
        let mut bytes = [0; AlControl::LEN];
        self.pdi_read(map::AL_CONTROL, &mut bytes, now);
        AlControl::decode(&bytes)
    }

    /// Writes AL_STATUS_CODE and AL_STATUS, which raises the ECAT event.
    pub fn set_al_status(&mut self, status: AlStatus, code: AlStatusCode, _now: SimTime) {
        self.memory.set_u16(map::AL_STATUS_CODE, code.0);
        self.memory.set_u16(map::AL_STATUS, status.bits());
        self.set_ecat_event(EVENT_AL_STATUS);
    }

    /// Sets whether the application serves its PDI. If it does, it retriggers the PDI watchdog continuously; otherwise
    /// the watchdog runs.
    pub fn set_pdi_alive(&mut self, alive: bool, now: SimTime) {
        if alive {
            self.pdi_watchdog.rest();
        } else {
            self.pdi_watchdog.trigger(now);
        }
        self.refresh_dl_status();
        self.schedule();
    }

    /// Whether the process data watchdog is running or disabled.
    pub fn process_data_watchdog_ok(&self) -> bool {
        self.process_data_watchdog.ok()
    }

    /// DIGITAL_OUTPUTS (0x0F00..0x0F03); `None` if the process data watchdog has expired.
    pub fn digital_outputs(&self) -> Option<[u8; 4]> {
        self.process_data_watchdog.ok().then(|| self.memory.array(map::DIGITAL_OUTPUTS))
    }
}
