//! Bytes of the areas that the ACTIVE sends in each cycle.

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::master_frame::{Area, Lengths};

/// The areas.
#[derive(Debug, Default)]
pub(crate) struct Content {
    pub subdevices: Box<[u8]>,
    pub inputs: Box<[u8]>,
    pub diagnosis: Box<[u8]>,
    pub to_inactive: Box<[u8]>,
}

impl Content {
    pub fn new(lengths: &Lengths) -> Content {
        let zeros = |length: u32| vec![0; length as usize].into_boxed_slice();
        Content {
            subdevices: zeros(lengths.subdevices),
            inputs: zeros(lengths.inputs),
            diagnosis: zeros(lengths.diagnosis),
            to_inactive: zeros(lengths.to_inactive),
        }
    }

    /// Takes a part of an area, if it has its place here. `is_wanted`: it was not taken from the other copy.
    pub fn take(&mut self, area: Area, offset: u32, bytes: &[u8], is_wanted: bool) -> bool {
        let whole = match area {
            Area::SubDevices => &mut self.subdevices,
            Area::Inputs => &mut self.inputs,
            Area::Diagnosis => &mut self.diagnosis,
            Area::ToInactive => &mut self.to_inactive,
            _ => return false,
        };
        let place = (offset as usize).checked_add(bytes.len()).and_then(|end| whole.get_mut(offset as usize..end));
        let Some(place) = place else { return false };
        if is_wanted {
            place.copy_from_slice(bytes);
        }
        true
    }
}
