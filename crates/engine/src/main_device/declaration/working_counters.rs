//! Working counters as other MainDevices count them.

use alloc::collections::BTreeSet;

use ringcat_wire::datagram::MAX_DATA;

use crate::declared::SubDeviceId;
use crate::info::Direction;

/// Expected working counter of an image whose areas follow each other: the image is cut before an area that does not
/// fit a datagram; an LRW where a piece has both directions, otherwise an LWR or an LRD. Each counts a SubDevice once
/// per direction: LRW 2 for outputs and 1 for inputs, LWR and LRD 1 (protocol 1.4).
pub(in crate::main_device) fn expected_as_igh(areas: impl Iterator<Item = (SubDeviceId, Direction, u16)>) -> u32 {
    let (mut sum, mut bytes, mut piece) = (0, 0, Piece::default());
    for (subdevice, direction, length) in areas.filter(|(.., length)| *length > 0) {
        if bytes + usize::from(length) > MAX_DATA {
            sum += core::mem::take(&mut piece).expected();
            bytes = 0;
        }
        bytes += usize::from(length);
        match direction {
            Direction::Outputs => piece.outputs.insert(subdevice),
            Direction::Inputs => piece.inputs.insert(subdevice),
        };
    }
    sum + piece.expected()
}

/// SubDevices of a datagram.
#[derive(Default)]
struct Piece {
    outputs: BTreeSet<SubDeviceId>,
    inputs: BTreeSet<SubDeviceId>,
}

impl Piece {
    fn expected(&self) -> u32 {
        let [outputs, inputs] = [&self.outputs, &self.inputs].map(|subdevices| subdevices.len() as u32);
        let is_lrw = outputs > 0 && inputs > 0;
        if is_lrw { 2 * outputs + inputs } else { outputs + inputs }
    }
}
