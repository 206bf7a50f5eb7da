//! PDOs in mailbox messages instead of process data (protocol 6.3).
//!
//! Input: an RxPDO, which sets the mapped objects, or a request for a TxPDO or RxPDO. Output: the requested PDO with
//! the current values. An RxPDO has no response. The number in the CoE header is the offset of the PDO from 0x1600 or
//! 0x1A00.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::coe::{CoeHeader, CoeService};
use ringcat_wire::sii::PdoDirection;

use super::objects::Objects;
use crate::application::answer::Answer;
use crate::application::dictionary::{MappedEntry, ObjectRole};

const RX_BASE: u16 = 0x1600;
const TX_BASE: u16 = 0x1A00;

/// Accepts an RxPDO.
pub fn receive(number: u16, data: &[u8], objects: &mut Objects<'_>) -> Answer {
    let Some(mapped) = mapping(RX_BASE + number, PdoDirection::Rx, objects) else {
        return Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED);
    };
    let bits: usize = mapped.iter().map(|entry| usize::from(entry.bit_length)).sum();
    if data.len() != bits.div_ceil(8) {
        return Answer::Error(ErrorReply::INVALID_SIZE);
    }
    let mut at = 0;
    for entry in mapped {
        let length = usize::from(entry.bit_length);
        // In OP, process data overrides values received by mailbox.
        let cyclic = objects.state == AlState::Op && objects.process_data.is_output(entry.index, entry.sub_index);
        if entry.index != 0 && !cyclic {
            let mut value = vec![0; length.div_ceil(8)];
            copy_bits(data, at, &mut value, 0, length);
            objects.dictionary.set(entry.index, entry.sub_index, &value);
        }
        at += length;
    }
    Answer::Silence
}

/// Sends a requested PDO.
pub fn send(service: CoeService, number: u16, room: usize, objects: &Objects<'_>) -> Answer {
    let (base, direction) = match service {
        CoeService::TxPdo => (TX_BASE, PdoDirection::Tx),
        _ => (RX_BASE, PdoDirection::Rx),
    };
    let Some(mapped) = mapping(base + number, direction, objects) else {
        return Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED);
    };
    let bits: usize = mapped.iter().map(|entry| usize::from(entry.bit_length)).sum();
    let mut data = vec![0; bits.div_ceil(8)];
    let mut at = 0;
    for entry in mapped {
        let length = usize::from(entry.bit_length);
        let current =
            objects.process_data.value(entry.index, entry.sub_index).map(|value| value.to_le_bytes().to_vec());
        let kept = || objects.dictionary.read(entry.index, entry.sub_index).map(<[u8]>::to_vec).unwrap_or_default();
        copy_bits(&current.unwrap_or_else(kept), 0, &mut data, at, length);
        at += length;
    }
    let mut payload = CoeHeader { number, ..CoeHeader::new(service) }.encode().to_vec();
    payload.extend(data);
    if payload.len() > room { Answer::Error(ErrorReply::INVALID_SIZE) } else { Answer::payload(payload) }
}

/// The mapping of a PDO; `None` if there is no such PDO.
fn mapping(index: u16, direction: PdoDirection, objects: &Objects<'_>) -> Option<Vec<MappedEntry>> {
    objects.dictionary.object(index).filter(|object| object.role == ObjectRole::Mapping(direction))?;
    Some(objects.dictionary.mapped(index).collect())
}

/// Copies bits; those beyond the end of the source are zero.
fn copy_bits(from: &[u8], from_bit: usize, to: &mut [u8], to_bit: usize, length: usize) {
    for bit in 0..length {
        let (source, target) = (from_bit + bit, to_bit + bit);
        let set = from.get(source / 8).is_some_and(|byte| byte >> (source % 8) & 1 != 0);
        if set && let Some(byte) = to.get_mut(target / 8) {
            *byte |= 1 << (target % 8);
        }
    }
}
