//! The local side of the controller, as the application sees it (protocol 3.4, 3.5, 3.7, 3.11).
//!
//! In: reads and writes of the application. Out: bytes, under the rules of SyncManagers and the watchdog, and the
//! events that reading and writing clears and raises.

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::{AlControl, AlStatus, AlStatusCode};
use ringcat_wire::register::map;

use super::Controller;
use super::event_bits::EVENT_AL_STATUS;
use super::memory::Side;
use crate::time::SimTime;

impl Controller {
    /// Reads for the PDI. `false`, and unspecified bytes in `out`, where any of them is blocked: no such register, a
    /// SyncManager of the other direction, switched off, with an empty mailbox or without a complete buffer, outputs
    /// behind an expired watchdog, or the EEPROM not loaded.
    pub fn pdi_read(&mut self, address: RegisterAddress, out: &mut [u8], now: SimTime) -> bool {
        self.begin_pdi_access(now) && self.read(Side::Pdi, address.0.into(), out, false) == out.len()
    }

    /// Writes for the PDI. `false` where any byte is blocked; the others are written.
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

    /// Whether the EEPROM is loaded, so that PDI and process RAM are open (protocol 3.13).
    pub fn pdi_operational(&self) -> bool {
        self.memory.process_ram_open
    }

    /// AL_EVENT (0x0220), not masked.
    pub fn al_event(&self) -> u32 {
        self.memory.u32(map::AL_EVENT)
    }

    /// Reads AL_CONTROL, which clears its AL event and lets EtherCAT write it again.
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

    /// Whether the application serves its PDI. While it does, the PDI watchdog is retriggered all the time; from when
    /// it stops, the watchdog runs.
    pub fn set_pdi_alive(&mut self, alive: bool, now: SimTime) {
        if alive {
            self.pdi_watchdog.rest();
        } else {
            self.pdi_watchdog.trigger(now);
        }
        self.refresh_dl_status();
        self.schedule();
    }

    /// Whether the process data watchdog is running or switched off.
    pub fn process_data_watchdog_ok(&self) -> bool {
        self.process_data_watchdog.ok()
    }

    /// DIGITAL_OUTPUTS (0x0F00..0x0F03); `None` while the process data watchdog keeps them from the terminals.
    pub fn digital_outputs(&self) -> Option<[u8; 4]> {
        self.process_data_watchdog.ok().then(|| self.memory.array(map::DIGITAL_OUTPUTS))
    }
}
