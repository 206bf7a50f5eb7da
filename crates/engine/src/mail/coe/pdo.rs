//! PDO assignment and mapping of a SubDevice (protocol 6.3: 0x1C10 + SyncManager, 0x16xx, 0x1Axx).

use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::pdo_objects::ASSIGNMENT_BASE;

use super::{SdoAddress, SdoError, read, write};
use crate::config::{PdoEntry, PdoMapping};
use crate::mail::{Limits, Mailbox};

/// Longest list with complete access: subindex 0 padded to 16 bit, and the most entries of the longest kind.
const LONGEST: usize = 2 + u8::MAX as usize * MAPPED;
/// Bytes of an entry of a mapping.
const MAPPED: usize = 4;

/// Reads the lists of PDOs of a SubDevice.
#[derive(Debug)]
pub(crate) struct Lists<'a> {
    mailbox: &'a Mailbox,
    limits: Limits,
    complete_access: bool,
}

impl<'a> Lists<'a> {
    /// Reads each entry by itself.
    pub(crate) fn new(mailbox: &'a Mailbox, limits: Limits) -> Lists<'a> {
        Lists { mailbox, limits, complete_access: false }
    }

    /// Reads each list at once, if the SubDevice has complete access. From the first answer on that is no list, entries
    /// are read.
    pub(crate) fn with_complete_access(self, complete_access: bool) -> Lists<'a> {
        Lists { complete_access, ..self }
    }

    /// The PDOs assigned to a SyncManager, with their mapping.
    pub(crate) async fn assignment(&mut self, sync_manager: u8) -> Result<Vec<PdoMapping>, SdoError> {
        let mut pdos = Vec::new();
        for index in self.list::<2>(ASSIGNMENT_BASE + u16::from(sync_manager)).await? {
            let index = u16::from_le_bytes(index);
            pdos.push(PdoMapping::of(index, self.mapping(index).await?));
        }
        Ok(pdos)
    }

    /// The mapping of a PDO.
    pub(crate) async fn mapping(&mut self, pdo: u16) -> Result<Vec<PdoEntry>, SdoError> {
        let entry = |[bit_length, sub_index, low, high]: [u8; MAPPED]| {
            PdoEntry::new(u16::from_le_bytes([low, high]), sub_index, bit_length)
        };
        Ok(self.list(pdo).await?.into_iter().map(entry).collect())
    }

    /// The entries of a list.
    async fn list<const N: usize>(&mut self, object: u16) -> Result<Vec<[u8; N]>, SdoError> {
        if self.complete_access {
            match read(self.mailbox, SdoAddress::complete(object, 0), self.limits, LONGEST).await {
                Ok(bytes) => {
                    if let Some(entries) = entries_of(&bytes) {
                        return Ok(entries);
                    }
                }
                Err(error) if error.is_interrupted() => return Err(error),
                // Subindex 0 shows whether the object is missing.
                Err(_) => {}
            }
            self.complete_access = false;
        }
        let mut entries = Vec::new();
        let [count] = self.value(SdoAddress::new(object, 0)).await?;
        for sub_index in 1..=count {
            entries.push(self.value(SdoAddress::new(object, sub_index)).await?);
        }
        Ok(entries)
    }

    /// The first bytes of a value; missing bytes are 0.
    async fn value<const N: usize>(&self, object: SdoAddress) -> Result<[u8; N], SdoError> {
        let bytes = read(self.mailbox, object, self.limits, MAPPED).await?;
        let mut value = [0; N];
        value.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
        Ok(value)
    }
}

/// The PDOs assigned to a SyncManager, with their mapping.
pub async fn read_assignment(mailbox: &Mailbox, sync_manager: u8, limits: Limits) -> Result<Vec<PdoMapping>, SdoError> {
    Lists::new(mailbox, limits).assignment(sync_manager).await
}

/// The mapping of a PDO.
pub async fn read_mapping(mailbox: &Mailbox, pdo: u16, limits: Limits) -> Result<Vec<PdoEntry>, SdoError> {
    Lists::new(mailbox, limits).mapping(pdo).await
}

/// The entries of a list that was read with complete access; `None` if it has not exactly as many as its subindex 0
/// says, padded: with a tail an unpadded one might be taken for another list.
fn entries_of<const N: usize>(bytes: &[u8]) -> Option<Vec<[u8; N]>> {
    let (&[count, 0], rest) = bytes.split_first_chunk()? else { return None };
    let (entries, tail) = rest.as_chunks();
    (entries.len() == usize::from(count) && tail.is_empty()).then(|| entries.to_vec())
}

/// Assigns PDOs to a SyncManager, and maps those with given entries. The SubDevice must be in PREOP. After an error the
/// assignment may be incomplete; the next call starts again.
pub async fn write_assignment(
    mailbox: &Mailbox,
    sync_manager: u8,
    pdos: &[PdoMapping],
    limits: Limits,
) -> Result<(), SdoError> {
    let object = ASSIGNMENT_BASE + u16::from(sync_manager);
    // The mapping of an assigned PDO cannot be changed.
    write(mailbox, SdoAddress::new(object, 0), &[0], limits).await?;
    for pdo in pdos {
        if let Some(entries) = &pdo.entries {
            write_mapping(mailbox, pdo.index, entries, limits).await?;
        }
    }
    for (sub_index, pdo) in (1..=u8::MAX).zip(pdos) {
        write(mailbox, SdoAddress::new(object, sub_index), &pdo.index.to_le_bytes(), limits).await?;
    }
    write(mailbox, SdoAddress::new(object, 0), &[pdos.len().min(255) as u8], limits).await
}

/// Maps entries into a PDO that is not assigned. The SubDevice must be in PREOP.
pub async fn write_mapping(mailbox: &Mailbox, pdo: u16, entries: &[PdoEntry], limits: Limits) -> Result<(), SdoError> {
    write(mailbox, SdoAddress::new(pdo, 0), &[0], limits).await?;
    for (sub_index, entry) in (1..=u8::MAX).zip(entries) {
        let [low, high] = entry.index.to_le_bytes();
        let object = [entry.bit_length, entry.sub_index, low, high];
        write(mailbox, SdoAddress::new(pdo, sub_index), &object, limits).await?;
    }
    write(mailbox, SdoAddress::new(pdo, 0), &[entries.len().min(255) as u8], limits).await
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::entries_of;

    #[test]
    fn a_list_is_padded_and_has_as_many_entries_as_it_says() {
        assert_eq!(entries_of(&[2, 0, 0x00, 0x1A, 0x01, 0x1A]), Some(vec![[0x00, 0x1A], [0x01, 0x1A]]));
        assert_eq!(entries_of::<4>(&[0, 0]), Some(vec![]));
        assert_eq!(entries_of(&[1, 0, 16, 0, 0x40, 0x60]), Some(vec![[16, 0, 0x40, 0x60]]));
        // Entries that are not in use, or no padding and a tail.
        assert_eq!(entries_of::<4>(&[1, 0, 16, 0, 0x40, 0x60, 0, 0, 0, 0]), None);
        assert_eq!(entries_of::<2>(&[2, 0x00, 0x1A, 0x01, 0x1A, 0, 0]), None);
        // Too short, without the padding.
        for bytes in [&[][..], &[1], &[1, 0, 0x00], &[2, 0, 0x00, 0x1A], &[1, 0x00, 0x1A], &[2, 0x00, 0x1A, 1, 0x1A]] {
            assert_eq!(entries_of::<2>(bytes), None, "{bytes:?}");
        }
    }
}
