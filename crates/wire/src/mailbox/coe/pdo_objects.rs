//! Objects of a dictionary that describe PDOs (protocol 6.3).

use core::ops::RangeInclusive;

/// Mappings of the PDOs that a SubDevice receives.
pub const RX_MAPPINGS: RangeInclusive<u16> = 0x1600..=0x17FF;
/// Mappings of the PDOs that a SubDevice sends.
pub const TX_MAPPINGS: RangeInclusive<u16> = 0x1A00..=0x1BFF;
/// Assignment of SyncManager 0; those of the others follow it.
pub const ASSIGNMENT_BASE: u16 = 0x1C10;
/// Assignments of PDOs to SyncManagers.
pub const ASSIGNMENTS: RangeInclusive<u16> = ASSIGNMENT_BASE..=0x1C2F;

/// Whether an object is the mapping of a PDO.
pub const fn is_mapping(index: u16) -> bool {
    matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF)
}

/// Whether an object is the mapping of a PDO, or the assignment of a SyncManager.
pub const fn is_of_pdos(index: u16) -> bool {
    is_mapping(index) || matches!(index, ASSIGNMENT_BASE..=0x1C2F)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 6.3, codec-mailbox
    #[test]
    fn objects_of_pdos_are_those_of_the_ranges() {
        for index in 0..=u16::MAX {
            let mapping = RX_MAPPINGS.contains(&index) || TX_MAPPINGS.contains(&index);
            assert_eq!(is_mapping(index), mapping, "{index:#06x}");
            assert_eq!(is_of_pdos(index), mapping || ASSIGNMENTS.contains(&index), "{index:#06x}");
        }
    }
}
