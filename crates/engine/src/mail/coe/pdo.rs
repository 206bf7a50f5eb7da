//! PDO assignment and mapping of a SubDevice (protocol 6.3: 0x1C10 + SyncManager, 0x16xx, 0x1Axx).

use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::pdo_objects::ASSIGNMENT_BASE;

use super::{SdoAddress, SdoError, read, write};
use crate::config::{PdoEntry, PdoMapping};
use crate::mail::{Limits, Mailbox};

/// The PDOs assigned to a SyncManager, with their mapping.
pub async fn read_assignment(mailbox: &Mailbox, sync_manager: u8, limits: Limits) -> Result<Vec<PdoMapping>, SdoError> {
    let object = ASSIGNMENT_BASE + u16::from(sync_manager);
    let mut pdos = Vec::new();
    for sub_index in 1..=count(mailbox, object, limits).await? {
        let index: [u8; 2] = value(mailbox, SdoAddress::new(object, sub_index), limits).await?;
        let index = u16::from_le_bytes(index);
        pdos.push(PdoMapping::of(index, read_mapping(mailbox, index, limits).await?));
    }
    Ok(pdos)
}

/// The mapping of a PDO.
pub async fn read_mapping(mailbox: &Mailbox, pdo: u16, limits: Limits) -> Result<Vec<PdoEntry>, SdoError> {
    let mut entries = Vec::new();
    for sub_index in 1..=count(mailbox, pdo, limits).await? {
        let [bit_length, sub_index, low, high] = value(mailbox, SdoAddress::new(pdo, sub_index), limits).await?;
        entries.push(PdoEntry::new(u16::from_le_bytes([low, high]), sub_index, bit_length));
    }
    Ok(entries)
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

/// Subindex 0 of a list.
async fn count(mailbox: &Mailbox, object: u16, limits: Limits) -> Result<u8, SdoError> {
    value::<1>(mailbox, SdoAddress::new(object, 0), limits).await.map(|[count]| count)
}

/// The first bytes of a value; missing bytes are 0.
async fn value<const N: usize>(mailbox: &Mailbox, object: SdoAddress, limits: Limits) -> Result<[u8; N], SdoError> {
    let bytes = read(mailbox, object, limits, 4).await?;
    let mut value = [0; N];
    value.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
    Ok(value)
}
