//! Turns at the EEPROM of one SubDevice: its registers hold one address and one word, so that a read between the steps
//! of a write would move the write to another word.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;

use ringcat_wire::address::StationAddress;

use crate::supervisor::{Bus, Signal};

/// EEPROMs that procedures use at the moment.
#[derive(Clone, Debug)]
pub struct EepromTurns {
    used: Rc<RefCell<Vec<StationAddress>>>,
    changed: Signal,
}

impl EepromTurns {
    /// No EEPROM is used yet.
    pub fn new(bus: &Bus) -> EepromTurns {
        EepromTurns { used: Rc::default(), changed: bus.signal() }
    }

    /// Waits until no other procedure uses this EEPROM. Each use has limits of its own.
    pub async fn take(&self, station: StationAddress) -> EepromTurn {
        let free = || {
            let mut used = self.used.borrow_mut();
            (!used.contains(&station)).then(|| used.push(station))
        };
        self.changed.until(free).await;
        EepromTurn { turns: self.clone(), station }
    }
}

/// The use of an EEPROM, until it is dropped, also together with its procedure.
#[derive(Debug)]
pub struct EepromTurn {
    turns: EepromTurns,
    station: StationAddress,
}

impl Drop for EepromTurn {
    fn drop(&mut self) {
        self.turns.used.borrow_mut().retain(|used| *used != self.station);
        self.turns.changed.notify();
    }
}
