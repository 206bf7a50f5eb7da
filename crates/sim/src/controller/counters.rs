//! Error and lost-link counters (protocol 2.5).
//!
//! Input: damaged frames, PDI errors and writes. Output: counters that saturate at 0xFF; any write by EtherCAT clears a
//! group.

use core::ops::Range;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::map;

use super::Controller;
use crate::frame::{Fcs, Port, SimFrame};

/// Counters that are cleared together.
const GROUPS: [Range<u16>; 5] = [
    map::RX_ERROR_COUNTER.0..map::EPU_ERROR_COUNTER.0,
    map::EPU_ERROR_COUNTER.0..map::PDI_ERROR_COUNTER.0,
    map::PDI_ERROR_COUNTER.0..map::PDI_ERROR_CODE.0 + 1,
    map::LOST_LINK_COUNTER.0..map::LOST_LINK_COUNTER.0 + 4,
    map::WATCHDOG_COUNTER_PROCESS_DATA.0..map::WATCHDOG_COUNTER_PDI.0 + 1,
];

/// Whether the address is a counter, which does not store written values.
pub(super) fn is_counter(address: u32) -> bool {
    GROUPS.iter().any(|group| (u32::from(group.start)..u32::from(group.end)).contains(&address))
}

impl Controller {
    /// Counts a damaged frame at a port, and marks it for the following controllers: only the first one counts an
    /// invalid frame, the others a forwarded error.
    pub(super) fn count_damage(&mut self, frame: &mut SimFrame, port: Port) {
        if frame.fcs == Fcs::Good {
            return;
        }
        let p = port.index() as u16;
        if core::mem::take(&mut frame.symbol_error) {
            self.count_symbol_error(port);
        }
        match frame.fcs {
            Fcs::Good => {}
            Fcs::Bad => {
                self.memory.count(map::RX_ERROR_COUNTER.offset(2 * p));
                frame.fcs = Fcs::Marked;
            }
            Fcs::Marked => self.memory.count(map::FORWARDED_RX_ERROR_COUNTER.offset(p)),
        }
    }

    /// Counts an invalid symbol, within a frame or between frames.
    pub fn count_symbol_error(&mut self, port: Port) {
        self.memory.count(map::RX_ERROR_COUNTER.offset(2 * port.index() as u16 + 1));
    }

    /// Counts a failed access of the PDI, as on a disturbed SPI bus; `code` is the error code of the PDI type.
    pub fn count_pdi_error(&mut self, code: u8) {
        self.memory.count(map::PDI_ERROR_COUNTER);
        self.memory.set_u8(map::PDI_ERROR_CODE, code);
    }

    /// Clears the groups with a counter in `address..end`.
    pub(super) fn clear_counters(&mut self, address: u32, end: u32) {
        for group in GROUPS {
            if address < group.end.into() && u32::from(group.start) < end {
                group.for_each(|counter| self.memory.set_u8(RegisterAddress(counter), 0));
            }
        }
    }
}
