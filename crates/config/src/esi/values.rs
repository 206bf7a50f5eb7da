//! Objects of a dictionary with their parts: type, access and default of each subindex (protocol ES-22, ES-72, ES-73).
//!
//! A few elements of a file can describe many large values (a type that many objects share, with 256 texts of a
//! megabyte): what the parts take is counted, and refused above a limit.

use std::borrow::Cow;
use std::collections::HashMap;

use super::error::EsiProblem;
use super::limits::{MAX_PARTS, MAX_PARTS_BYTES};
use super::model::{DataType, Dictionary, Flags, Object, ObjectInfo, SubItem};
use super::sii::code_of;

/// Types that name each other, at most.
const MAX_CHAIN: usize = 8;
/// Bytes of a value, at most: what no mailbox transfers in one service is no default.
const MAX_VALUE: usize = 1 << 20;
/// Bytes that a part takes besides its name and its values.
const PART_BYTES: usize = 64;
/// CoE types by size, for types without a code: unsigned numbers, else bytes.
const OCTETS: u16 = 0x0A;
/// Code of BIT1; up to BIT16 they follow each other.
const BIT1: u16 = 0x30;

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

/// Room for the parts of several objects, for instance those of a device with its modules: [`MAX_PARTS_BYTES`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartsRoom {
    left: usize,
}

impl Default for PartsRoom {
    fn default() -> PartsRoom {
        PartsRoom { left: MAX_PARTS_BYTES }
    }
}

impl PartsRoom {
    fn take(&mut self, bytes: usize) -> Result<(), EsiProblem> {
        const WHAT: &str = "bytes of values and names of the objects of a device with its modules";
        match self.left.checked_sub(bytes) {
            Some(left) => self.left = left,
            None => return Err(EsiProblem::TooMuch { what: WHAT, limit: MAX_PARTS_BYTES }),
        }
        Ok(())
    }
}

/// The parts of an object, subindices ascending; what they take is taken from `room`.
///
/// # Errors
/// [`EsiProblem::TooMuch`]: the room is not sufficient, or the type of the object has more than [`MAX_PARTS`] parts.
pub fn parts(dictionary: &Dictionary, object: &Object, room: &mut PartsRoom) -> Result<Vec<Part>, EsiProblem> {
    let mut sources = Vec::new();
    let data_type = dictionary.data_type(&object.data_type);
    let items = data_type.map_or(&[][..], |of| &of.sub_items);
    if items.is_empty() {
        sources.push(Source {
            sub_index: 0,
            name: object.name.english().into(),
            data_type: &object.data_type,
            bit_size: object.bit_size,
            flags: object.flags,
            info: Some(&object.info),
        });
    } else {
        collect(dictionary, object, items, &mut sources)?;
        // The first one of a subindex counts.
        sources.sort_by_key(|source| source.sub_index);
        sources.dedup_by_key(|source| source.sub_index);
    }
    sources.iter().map(|source| source.part(dictionary, room)).collect()
}

/// A part before its values are copied.
struct Source<'a> {
    sub_index: u8,
    name: Cow<'a, str>,
    data_type: &'a str,
    bit_size: u32,
    flags: Flags,
    info: Option<&'a ObjectInfo>,
}

/// What the items of a record or an array describe.
fn collect<'a>(
    dictionary: &'a Dictionary,
    object: &'a Object,
    items: &'a [SubItem],
    sources: &mut Vec<Source<'a>>,
) -> Result<(), EsiProblem> {
    let mut infos = HashMap::with_capacity(object.sub_items.len());
    for info in &object.sub_items {
        infos.entry(info.name.as_str()).or_insert(&info.info);
    }
    for item in items {
        match (item.sub_index, dictionary.data_type(&item.data_type)) {
            (None, Some(array)) if array.array.is_some() => sources.extend(elements(object, item, array)),
            (sub_index, _) => sources.push(Source {
                sub_index: sub_index.unwrap_or(0),
                name: item.name.as_str().into(),
                data_type: &item.data_type,
                bit_size: item.bit_size,
                flags: item.flags.unwrap_or(object.flags),
                info: infos.get(item.name.as_str()).copied(),
            }),
        }
        if sources.len() > MAX_PARTS {
            return Err(EsiProblem::TooMuch { what: "parts of an object", limit: MAX_PARTS });
        }
    }
    Ok(())
}

/// Elements of an array; their values follow each other from position 1 on.
fn elements<'a>(object: &'a Object, item: &SubItem, array: &'a DataType) -> impl Iterator<Item = Source<'a>> {
    let bounds = array.array.unwrap_or(super::model::ArrayBounds { first: 1, elements: 0 });
    let base = array.base.as_deref().unwrap_or_default();
    let bits = array.bit_size.checked_div(bounds.elements).unwrap_or(0);
    let flags = item.flags.unwrap_or(object.flags);
    let one = move |sub_index: u8| {
        let info = object.sub_items.get(usize::from(sub_index));
        let name = info.map(|info| Cow::Borrowed(info.name.as_str()));
        Source {
            sub_index,
            name: name.unwrap_or_else(|| format!("SubIndex {sub_index:03}").into()),
            data_type: base,
            bit_size: bits,
            flags,
            info: info.map(|info| &info.info),
        }
    };
    (1..=u8::MAX).take(bounds.elements as usize).map(one)
}

impl Source<'_> {
    fn part(&self, dictionary: &Dictionary, room: &mut PartsRoom) -> Result<Part, EsiProblem> {
        let of_type = || dictionary.data_type(self.data_type).map_or(0, |of| of.bit_size);
        let bit_size = if self.bit_size == 0 { of_type() } else { self.bit_size };
        let length = (bit_size.div_ceil(8) as usize).min(MAX_VALUE);
        let given = |of: fn(&ObjectInfo) -> &Option<Vec<u8>>| self.info.and_then(|info| of(info).as_ref());
        let (default, minimum, maximum) =
            (given(|info| &info.default), given(|info| &info.minimum), given(|info| &info.maximum));
        let values = 1 + usize::from(minimum.is_some()) + usize::from(maximum.is_some());
        room.take(PART_BYTES + self.name.len() + self.data_type.len() + values * length)?;
        let sized = |bytes: &Vec<u8>| {
            let mut sized = bytes[..bytes.len().min(length)].to_vec();
            sized.resize(length, 0);
            sized
        };
        Ok(Part {
            sub_index: self.sub_index,
            name: self.name.clone().into_owned(),
            data_type: code(dictionary, self.data_type, bit_size),
            bit_size,
            flags: self.flags,
            default: default.map_or_else(|| vec![0; length], sized),
            minimum: minimum.map(sized),
            maximum: maximum.map(sized),
        })
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
        // BIT2 to BIT7, BIT9 to BIT15.
        2..=7 | 9..=15 => BIT1 + bits as u16 - 1,
        8 => 0x05,
        16 => 0x06,
        32 => 0x07,
        64 => 0x1B,
        _ => OCTETS,
    }
}
