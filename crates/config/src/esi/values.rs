//! Objects of a dictionary with their parts: type, access and default of each subindex (protocol ES-22, ES-72, ES-73).

use super::model::{DataType, Dictionary, Flags, Object, ObjectInfo, SubItem};
use super::sii::code_of;

/// Types that name each other, at most.
const MAX_CHAIN: usize = 8;
/// Bytes of a value, at most: what no mailbox transfers in one service is no default.
const MAX_VALUE: usize = 1 << 20;
/// CoE types by size, for types without a code: unsigned numbers, else bytes.
const OCTETS: u16 = 0x0A;

/// A subindex of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Subindex.
    pub sub_index: u8,
    /// Name; that of the object for a single value.
    pub name: String,
    /// CoE code of its type.
    pub data_type: u16,
    /// Number of bits.
    pub bit_size: u32,
    /// Access, mapping, backup.
    pub flags: Flags,
    /// Default value, little-endian, of the length of the type.
    pub default: Vec<u8>,
    /// Smallest value.
    pub minimum: Option<Vec<u8>>,
    /// Largest value.
    pub maximum: Option<Vec<u8>>,
}

/// The parts of an object, subindices ascending.
pub fn parts(dictionary: &Dictionary, object: &Object) -> Vec<Part> {
    let data_type = dictionary.data_type(&object.data_type);
    let items = data_type.map_or(&[][..], |of| &of.sub_items);
    if items.is_empty() {
        let name = object.name.english();
        return vec![part(dictionary, 0, name, &object.data_type, object.bit_size, object.flags, Some(&object.info))];
    }
    let mut parts = Vec::new();
    for item in items {
        match (item.sub_index, dictionary.data_type(&item.data_type)) {
            (None, Some(array)) if array.array.is_some() => parts.extend(elements(dictionary, object, item, array)),
            (sub_index, _) => {
                let info = object.sub_items.iter().find(|info| info.name == item.name).map(|info| &info.info);
                let flags = item.flags.unwrap_or(object.flags);
                let sub_index = sub_index.unwrap_or(0);
                parts.push(part(dictionary, sub_index, &item.name, &item.data_type, item.bit_size, flags, info));
            }
        }
    }
    parts.sort_by_key(|part| part.sub_index);
    parts.dedup_by_key(|part| part.sub_index);
    parts
}

/// Elements of an array; their values follow each other from position 1 on.
fn elements(dictionary: &Dictionary, object: &Object, item: &SubItem, array: &DataType) -> Vec<Part> {
    let bounds = array.array.unwrap_or(super::model::ArrayBounds { first: 1, elements: 0 });
    let base = array.base.as_deref().unwrap_or_default();
    let bits = array.bit_size.checked_div(bounds.elements).unwrap_or(0);
    let flags = item.flags.unwrap_or(object.flags);
    let one = |sub_index: u8| {
        let info = object.sub_items.get(usize::from(sub_index)).map(|info| &info.info);
        let name = object.sub_items.get(usize::from(sub_index)).map(|info| info.name.clone());
        let name = name.unwrap_or_else(|| format!("SubIndex {sub_index:03}"));
        part(dictionary, sub_index, &name, base, bits, flags, info)
    };
    (1..=u8::MAX).take(bounds.elements as usize).map(one).collect()
}

fn part(
    dictionary: &Dictionary,
    sub_index: u8,
    name: &str,
    data_type: &str,
    bit_size: u32,
    flags: Flags,
    info: Option<&ObjectInfo>,
) -> Part {
    let bit_size = if bit_size == 0 { dictionary.data_type(data_type).map_or(0, |of| of.bit_size) } else { bit_size };
    let length = (bit_size.div_ceil(8) as usize).min(MAX_VALUE);
    let sized = |bytes: &Vec<u8>| {
        let mut bytes = bytes.clone();
        bytes.resize(length, 0);
        bytes
    };
    let default = info.and_then(|info| info.default.as_ref()).map_or_else(|| vec![0; length], sized);
    Part {
        sub_index,
        name: name.to_owned(),
        data_type: code(dictionary, data_type, bit_size),
        bit_size,
        flags,
        default,
        minimum: info.and_then(|info| info.minimum.as_ref()).map(sized),
        maximum: info.and_then(|info| info.maximum.as_ref()).map(sized),
    }
}

/// The CoE code of a type, through its base types; by its size if none has a code.
fn code(dictionary: &Dictionary, name: &str, bits: u32) -> u16 {
    let mut name = name;
    for _ in 0..MAX_CHAIN {
        if let Some(code) = code_of(name) {
            return code;
        }
        let Some(base) = dictionary.data_type(name).filter(|of| of.array.is_none()).and_then(|of| of.base.as_deref())
        else {
            break;
        };
        name = base;
    }
    match bits {
        1 => 0x01,
        8 => 0x05,
        16 => 0x06,
        32 => 0x07,
        64 => 0x1B,
        _ => OCTETS,
    }
}
