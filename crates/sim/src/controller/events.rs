//! ECAT and AL events, and the registers that mirror states: DL status and SyncManager status (protocol 2.3, 3.5).
//!
//! Input: changes of state. Output: registers 0x0110, 0x0210, 0x0220, 0x0805 + 8n, and the bits that the processing
//! unit writes to the IRQ field of datagrams.

use ringcat_wire::register::{DlStatus, map};

use super::Controller;
use super::event_bits::{EVENT_DL_STATUS, EVENT_SYNC_MANAGER_ECAT, EVENT_SYNC_MANAGER_PDI, MIRRORED};

/// Bits of ESC_CONFIGURATION that enable enhanced link detection (protocol 2.8).
const ENHANCED_LINK_DETECTION: u8 = 0xF2;

impl Controller {
    pub(super) fn set_ecat_event(&mut self, bits: u16) {
        let pending = self.memory.u16(map::ECAT_EVENT);
        if pending & bits != bits {
            self.memory.set_u16(map::ECAT_EVENT, pending | bits);
            self.refresh_irq();
        }
    }

    pub(super) fn clear_ecat_event(&mut self, bits: u16) {
        let pending = self.memory.u16(map::ECAT_EVENT);
        if pending & bits != 0 {
            self.memory.set_u16(map::ECAT_EVENT, pending & !bits);
            self.refresh_irq();
        }
    }

    /// The bits for datagrams: pending and enabled by the mask (protocol 1.2).
    pub(super) fn refresh_irq(&mut self) {
        self.irq = self.memory.u16(map::ECAT_EVENT) & self.memory.u16(map::ECAT_EVENT_MASK);
    }

    pub(super) fn set_al_event(&mut self, bits: u32) {
        self.memory.set_u32(map::AL_EVENT, self.memory.u32(map::AL_EVENT) | bits);
    }

    pub(super) fn clear_al_event(&mut self, bits: u32) {
        self.memory.set_u32(map::AL_EVENT, self.memory.u32(map::AL_EVENT) & !bits);
    }

    /// Updates DL_STATUS and raises the event if it changed.
    pub(super) fn refresh_dl_status(&mut self) {
        let loaded = self.memory.process_ram_open;
        let configuration = self.memory.u8(map::ESC_CONFIGURATION);
        let status = DlStatus {
            pdi_operational: loaded,
            pdi_watchdog_ok: loaded && !self.pdi_watchdog.expired(),
            // Active by default until the EEPROM is loaded (protocol 2.8).
            enhanced_link_detection: !loaded || configuration & ENHANCED_LINK_DETECTION != 0,
            ports: self.ports.status(),
            reserved: 0,
        };
        if status.bits() != self.memory.u16(map::DL_STATUS) {
            self.memory.set_u16(map::DL_STATUS, status.bits());
            self.set_ecat_event(EVENT_DL_STATUS);
        }
    }

    /// Updates the status byte and the events of SyncManager `n`.
    pub(super) fn refresh_sync_manager(&mut self, n: usize) {
        let Some((status, ecat, pdi)) = self.sync_managers.show(n) else { return };
        let register = map::sync_manager(n as u8).offset(ringcat_wire::register::SyncManager::STATUS);
        self.memory.set_u8(register, status);
        let bit = 1 << (EVENT_SYNC_MANAGER_PDI + n as u32);
        let pending = self.memory.u32(map::AL_EVENT);
        if (pending & bit != 0) != pdi {
            self.memory.set_u32(map::AL_EVENT, pending ^ bit);
        }
        if n < MIRRORED {
            let bit = 1 << (EVENT_SYNC_MANAGER_ECAT + n as u32);
            if ecat { self.set_ecat_event(bit) } else { self.clear_ecat_event(bit) }
        }
    }
}
