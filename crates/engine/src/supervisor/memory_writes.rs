//! Writes into memory of SubDevices that are under way, and that a change of the role would cut off.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;

use ringcat_wire::memory_write::MemoryWrite;

/// The writes, the oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct MemoryWrites(Rc<RefCell<Vec<MemoryWrite>>>);

impl MemoryWrites {
    /// A write begins; it ends when what is returned is dropped.
    pub(crate) fn begin(&self, write: MemoryWrite) -> UnderWayWrite {
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
    use ringcat_wire::memory_write::WriteKind;

    use super::*;

    // covers: standby, 9.6
    #[test]
    fn a_write_is_under_way_until_its_guard_is_dropped() {
        let writes = MemoryWrites::default();
        assert_eq!(writes.oldest(), None);
        let [first, second] = [(WriteKind::File, false, 3), (WriteKind::Eeprom, true, 9)];
        let [first, second] = [first, second].map(|(kind, at, number)| MemoryWrite::new(kind, at, number));
        let [file, eeprom] = [first, second].map(|write| writes.begin(write));
        assert_eq!(writes.oldest(), Some(first));
        drop(file);
        assert_eq!(writes.oldest(), Some(second));
        drop(eeprom);
        assert_eq!(writes.oldest(), None);
    }
}
