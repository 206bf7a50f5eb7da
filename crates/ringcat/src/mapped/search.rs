//! Finds an object in the process data of a SubDevice, by index or name.

use ringcat_engine::exchange::Entry;
use ringcat_engine::info::{Direction, PdoInfo, SiiExtent, SubDeviceInfo};
use ringcat_engine::main_device::{Directory, ObjectOf, SubDeviceId};

use super::bits::OutputBits;
use super::error::{MapError, MappedObject, Wanted};
use crate::value::Number;

/// Between the names of a PDO and of its entry.
const SEPARATOR: char = '.';

/// All mapped objects of one SubDevice.
pub(super) struct Search {
    subdevice: SubDeviceId,
    name: String,
    /// How much of its SII is known.
    extent: SiiExtent,
    mapped: Vec<MappedObject>,
}

impl Search {
    /// `info` gives the names, where the SubDevice was found.
    pub fn new(directory: &Directory, subdevice: SubDeviceId, info: Option<SubDeviceInfo>) -> Result<Search, MapError> {
        let declared = directory.subdevice_count();
        if subdevice.0 >= declared {
            return Err(MapError::NotDeclared { subdevice, declared });
        }
        let (name, pdos, extent) = info.map_or_else(Default::default, |info| (info.name, info.pdos, info.extent));
        let areas = directory.areas(subdevice).iter();
        let mapped = areas.flat_map(|area| {
            let direction = area.direction;
            area.entries.iter().map(move |entry| (direction, entry.index, entry.sub_index, entry.place))
        });
        let mapped = mapped.map(|(direction, index, sub_index, entry)| {
            let (pdo, name) = names(&pdos, direction, (index, sub_index));
            MappedObject { index, sub_index, direction, entry, name, pdo }
        });
        Ok(Search { subdevice, name, extent, mapped: mapped.collect() })
    }

    pub fn into_mapped(self) -> Vec<MappedObject> {
        self.mapped
    }

    /// The place of a number.
    pub fn typed<T: Number>(self, wanted: &Wanted, direction: Direction) -> Result<Entry, MapError> {
        let (subdevice, name) = (self.subdevice, self.name.clone());
        let object = self.find(wanted, direction)?;
        if object.entry.bit_length != T::BITS {
            let (number, expected, is) = (T::NAME, T::BITS, object.entry.bit_length);
            return Err(MapError::Width { subdevice, name, object: Box::new(object), number, expected, is });
        }
        Ok(object.entry)
    }

    /// The place of any number of bits.
    pub fn bits(self, wanted: &Wanted, direction: Direction) -> Result<OutputBits, MapError> {
        let subdevice = self.subdevice;
        let object = self.find(wanted, direction)?;
        Ok(OutputBits::new(object.entry, ObjectOf::new(subdevice, object.index, object.sub_index)))
    }

    /// Finds a mapped object. If it is mapped in both directions, the wanted direction counts. If it is mapped there
    /// more than once, a search by index returns the first place.
    fn find(self, wanted: &Wanted, direction: Direction) -> Result<MappedObject, MapError> {
        let Search { subdevice, name, extent, mapped } = self;
        if matches!(wanted, Wanted::Name(_)) && extent < SiiExtent::Complete {
            return Err(MapError::NamesNotRead { subdevice, wanted: wanted.clone() });
        }
        let fits = |object: &&MappedObject| match wanted {
            Wanted::Index { index, sub_index } => (object.index, object.sub_index) == (*index, *sub_index),
            Wanted::Name(name) => is_called(object, name),
        };
        let found: Vec<&MappedObject> = mapped.iter().filter(fits).collect();
        let with_direction = || found.iter().filter(|object| object.direction == direction);
        let wanted_again = wanted.clone();
        match (with_direction().count(), wanted) {
            (1, _) | (2.., Wanted::Index { .. }) => Ok(with_direction().next().map_or(found[0], |it| *it).clone()),
            (0, _) => match found.first() {
                Some(other) => Err(MapError::Direction { subdevice, name, object: Box::new((*other).clone()) }),
                None => Err(MapError::NotMapped { subdevice, name, wanted: wanted_again, mapped }),
            },
            (_, Wanted::Name(_)) => {
                let found = with_direction().map(|object| (*object).clone()).collect();
                Err(MapError::Ambiguous { subdevice, name, wanted: wanted_again, found })
            }
        }
    }
}

fn is_called(object: &MappedObject, name: &str) -> bool {
    let with_pdo = || name.strip_prefix(object.pdo.as_str()).and_then(|rest| rest.strip_prefix(SEPARATOR));
    !object.name.is_empty() && (object.name == name || with_pdo() == Some(object.name.as_str()))
}

/// Names of a PDO and of the entry in it that is this object; if several PDOs contain it, those of the PDO that is
/// assigned by default.
fn names(pdos: &[PdoInfo], direction: Direction, object: (u16, u8)) -> (String, String) {
    let of_direction = || pdos.iter().filter(|pdo| pdo.direction == direction);
    let assigned = of_direction().filter(|pdo| pdo.sync_manager.is_some());
    let others = of_direction().filter(|pdo| pdo.sync_manager.is_none());
    let named = assigned.chain(others).find_map(|pdo| {
        let entry = pdo.entries.iter().find(|entry| (entry.index, entry.sub_index) == object)?;
        Some((pdo.name.clone(), entry.name.clone()))
    });
    named.unwrap_or_default()
}
