//! Progress of long transfers of SubDevices: EEPROMs, files, objects in segments.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};

use ringcat_wire::address::StationAddress;

/// Kind of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TransferKind {
    /// A whole EEPROM is read.
    EepromRead,
    /// An EEPROM is written.
    EepromWrite,
    /// A file is read by FoE.
    FileRead,
    /// A file is written by FoE.
    FileWrite,
    /// An object is read in segments.
    ObjectRead,
    /// An object is written in segments.
    ObjectWrite,
}

/// Progress of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TransferProgress {
    /// Its kind.
    pub kind: TransferKind,
    /// Bytes that are done.
    pub done: u64,
    /// All its bytes; `None` if they are not known in advance.
    pub total: Option<u64>,
}

#[derive(Debug)]
struct Transfer {
    station: StationAddress,
    kind: TransferKind,
    done: Cell<u64>,
    total: Option<u64>,
}

/// Transfers that are under way, the oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct LongTransfers(Rc<RefCell<Vec<Rc<Transfer>>>>);

impl LongTransfers {
    /// A transfer begins; it ends when what is returned is dropped.
    pub(crate) fn begin(&self, station: StationAddress, kind: TransferKind, total: Option<u64>) -> UnderWayTransfer {
        let transfer = Rc::new(Transfer { station, kind, done: Cell::new(0), total });
        self.0.borrow_mut().push(transfer.clone());
        UnderWayTransfer { transfers: self.clone(), transfer }
    }

    /// Progress of those of a SubDevice.
    pub(crate) fn of(&self, station: StationAddress) -> Vec<TransferProgress> {
        let transfers = self.0.borrow();
        let its = transfers.iter().filter(|it| it.station == station);
        its.map(|it| TransferProgress { kind: it.kind, done: it.done.get(), total: it.total }).collect()
    }
}

/// A transfer that is under way.
#[derive(Debug)]
pub(crate) struct UnderWayTransfer {
    transfers: LongTransfers,
    transfer: Rc<Transfer>,
}

impl UnderWayTransfer {
    /// So many bytes are done.
    pub(crate) fn done(&self, bytes: u64) {
        self.transfer.done.set(bytes);
    }
}

impl Drop for UnderWayTransfer {
    fn drop(&mut self) {
        self.transfers.0.borrow_mut().retain(|it| !Rc::ptr_eq(it, &self.transfer));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_transfer_shows_its_progress_until_its_guard_is_dropped() {
        let transfers = LongTransfers::default();
        let [one, other] = [1001, 1002].map(StationAddress);
        let file = transfers.begin(one, TransferKind::FileRead, None);
        let eeprom = transfers.begin(one, TransferKind::EepromWrite, Some(8));
        let _third = transfers.begin(other, TransferKind::ObjectRead, Some(9));
        file.done(3);
        let progress = |kind, done, total| TransferProgress { kind, done, total };
        let wanted = [progress(TransferKind::FileRead, 3, None), progress(TransferKind::EepromWrite, 0, Some(8))];
        assert_eq!(transfers.of(one), wanted);
        drop(file);
        assert_eq!(transfers.of(one), wanted[1..]);
        drop(eeprom);
        assert_eq!((transfers.of(one).len(), transfers.of(other).len()), (0, 1));
    }
}
