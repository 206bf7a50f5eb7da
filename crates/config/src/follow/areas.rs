//! Maps bits of SyncManagers to logical bits: the FMMUs after all commands, split at the borders of SyncManagers
//! (protocol 3.10).

use ringcat_engine::config::{DeclaredArea, DeclaredSyncManager};
use ringcat_engine::info::Direction;
use ringcat_wire::register::Fmmu;

use super::messages::contradiction;
use super::notices::Notices;
use super::registers::Registers;
use crate::eni::{Eni, EniError, Place};

/// Process data of a SyncManager with its logical position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub direction: Direction,
    pub sync_manager: u8,
    /// First bit in the SyncManager's area.
    pub bit_offset: u32,
    pub bits: u32,
    /// First logical bit.
    pub logical_bit: u64,
    pub place: Place,
}

/// The pieces of a SubDevice, in the order of SyncManagers.
pub(super) fn pieces(
    eni: &Eni,
    index: usize,
    declared: &[DeclaredSyncManager],
    registers: &Registers,
    notices: &mut Notices,
) -> Result<Vec<Piece>, EniError> {
    let mut pieces = Vec::new();
    for (number, fmmu, place) in registers.fmmus() {
        if (0x0800..0x0880).contains(&fmmu.physical_start) {
            // A mailbox status bit: `MailboxStates` handles it.
            continue;
        }
        let subject = format!("FMMU {number}");
        let direction = match (fmmu.read, fmmu.write) {
            (false, true) => Direction::Outputs,
            (true, false) => Direction::Inputs,
            (true, true) | (false, false) => {
                let reason = "it maps outputs and inputs at once, or neither: not followed";
                notices.add(Some(place), Some(index), subject, reason);
                continue;
            }
        };
        let begin = u64::from(fmmu.physical_start) * 8 + u64::from(fmmu.physical_start_bit);
        let end = begin + u64::from(fmmu.bit_length());
        let first = pieces.len();
        let in_part = map(&fmmu, direction, declared, place, &mut pieces);
        let mapped: u64 = pieces[first..].iter().map(|piece| u64::from(piece.bits)).sum();
        match in_part {
            _ if mapped == end - begin => {}
            Some((sync_manager, length)) => {
                let expected = format!("bits within SyncManager {sync_manager} ({length} bytes)");
                let got = format!("{} bits from {:#06x}", end - begin, fmmu.physical_start);
                let hint = "SyncManager and FMMU must agree: export the file again";
                return Err(contradiction(eni, index, place, subject, expected, got, hint));
            }
            None => {
                let reason = format!(
                    "memory at {:#06x} is in no SyncManager of its direction: not exchanged",
                    fmmu.physical_start
                );
                notices.add(Some(place), Some(index), subject, reason);
            }
        }
    }
    pieces.sort_by_key(|piece| (piece.sync_manager, piece.bit_offset));
    Ok(pieces)
}

/// Appends the areas of its direction that an FMMU maps. Returns number and length of the last area.
fn map(
    fmmu: &Fmmu,
    direction: Direction,
    declared: &[DeclaredSyncManager],
    place: Place,
    pieces: &mut Vec<Piece>,
) -> Option<(u8, u16)> {
    let begin = u64::from(fmmu.physical_start) * 8 + u64::from(fmmu.physical_start_bit);
    let end = begin + u64::from(fmmu.bit_length());
    let mut in_part = None;
    for one in declared {
        let Some(DeclaredArea { sync_manager, length, .. }) =
            one.area().filter(|area| area.direction == direction && area.length > 0)
        else {
            continue;
        };
        let start = u64::from(one.register.start) * 8;
        let (from, to) = (begin.max(start), end.min(start + u64::from(length) * 8));
        if from >= to {
            continue;
        }
        in_part = Some((sync_manager, length));
        pieces.push(Piece {
            direction,
            sync_manager,
            bit_offset: (from - start) as u32,
            bits: (to - from) as u32,
            logical_bit: logical_bit(fmmu) + (from - begin),
            place,
        });
    }
    in_part
}

fn logical_bit(fmmu: &Fmmu) -> u64 {
    u64::from(fmmu.logical_start.0) * 8 + u64::from(fmmu.logical_start_bit)
}
