//! Writes into memory of SubDevices that are under way, and that a change of the role would cut off.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;

use ringcat_wire::memory_write::{MemoryWrite, WriteKind};

use crate::declared::Address;

/// The writes, the oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct MemoryWrites(Rc<RefCell<Vec<MemoryWrite>>>);

impl MemoryWrites {
    /// A write begins; it ends when what is returned is dropped.
    pub(crate) fn begin(&self, kind: WriteKind, subdevice: Address) -> UnderWayWrite {
        let (is_position, number) = match subdevice {
            Address::Declared(subdevice) => (false, subdevice.0),
            Address::Scanned(position) => (true, usize::from(position.0)),
        };
        let write = MemoryWrite::new(kind, is_position, number);
        self.0.borrow_mut().push(write);
        UnderWayWrite { writes: self.clone(), write }
    }

    /// The oldest one.
    #[cfg(any(test, feature = "standby"))]
    pub(crate) fn oldest(&self) -> Option<MemoryWrite> {
        self.0.borrow().first().copied()
    }
}

/// A write that is under way.
#[derive(Debug)]
pub(crate) struct UnderWayWrite {
    writes: MemoryWrites,
    write: MemoryWrite,
}

impl Drop for UnderWayWrite {
    fn drop(&mut self) {
        let mut writes = self.writes.0.borrow_mut();
        // Two writes of one SubDevice are equal: either may go.
        if let Some(at) = writes.iter().position(|write| *write == self.write) {
            writes.remove(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use ringcat_wire::address::Position;

    use super::*;
    use crate::declared::SubDeviceId;

    // covers: standby, 9.6
    #[test]
    fn a_write_is_under_way_until_its_guard_is_dropped() {
        let writes = MemoryWrites::default();
        assert_eq!(writes.oldest(), None);
        let file = writes.begin(WriteKind::File, SubDeviceId(3).into());
        let eeprom = writes.begin(WriteKind::Eeprom, Position(9).into());
        assert_eq!(writes.oldest(), Some(MemoryWrite::new(WriteKind::File, false, 3)));
        drop(file);
        assert_eq!(writes.oldest(), Some(MemoryWrite::new(WriteKind::Eeprom, true, 9)));
        drop(eeprom);
        assert_eq!(writes.oldest(), None);
    }
}
