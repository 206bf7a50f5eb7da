//! Object dictionaries (protocol ES-20 to ES-24, ES-72 to ES-74).

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};

use super::pdo::slot_index;
use crate::esi::element::Element;
use crate::esi::error::{EsiError, EsiProblem};
use crate::esi::limits::MAX_ELEMENTS;
use crate::esi::model::{
    Access, ArrayBounds, DataType, Dictionary, Flags, Object, ObjectInfo, SlotIndex, SubItem, SubItemInfo,
};
use crate::esi::sii::code_of;
use crate::xml::shown;

/// All states with a mailbox: PREOP, SAFEOP, OP.
const ALL_STATES: u8 = 7;

pub(super) fn dictionary(element: Element<'_>) -> Result<Dictionary, EsiError> {
    let mut data_types: Vec<DataType> = Vec::new();
    for of in element.child("DataTypes").into_iter().flat_map(|types| types.children("DataType")) {
        data_types.push(data_type(of)?);
    }
    data_types.sort_by(|a, b| a.name.cmp(&b.name).then(a.line.cmp(&b.line)));
    for pair in data_types.windows(2).filter(|pair| pair[0].name == pair[1].name) {
        let (name, line) = (&pair[0].name, pair[0].line);
        element.note(format!("DataType \"{name}\" is defined several times: the one in line {line} is used"));
    }
    data_types.dedup_by(|later, first| later.name == first.name);
    let mut objects: Vec<Object> = Vec::new();
    let mut lines: HashMap<SlotIndex, u32> = HashMap::new();
    for of in element.child("Objects").into_iter().flat_map(|objects| objects.children("Object")) {
        let object = object(of)?;
        match lines.entry(object.index) {
            Entry::Occupied(first) => {
                let (index, line) = (object.index.index, first.get());
                of.note(format!("Object {index:#06x} is defined in line {line} already: not used"));
            }
            Entry::Vacant(place) => {
                place.insert(object.line);
                objects.push(object);
            }
        }
    }
    let dictionary = Dictionary { line: element.line(), file: None, data_types, objects };
    note_types(element, &dictionary);
    Ok(dictionary)
}

/// Adds a notice for each undefined type, once, and for each subindex that a type has twice (protocol ES-20).
fn note_types(element: Element<'_>, dictionary: &Dictionary) {
    let mut unknown: HashSet<&str> = HashSet::new();
    let look_up = |line: u32, name: &str, is_new: bool| {
        let is_known = name.is_empty() || code_of(name).is_some() || dictionary.data_type(name).is_some();
        if !is_known && is_new {
            element.note_at(line, format!("the type {} is not defined: its size is used", shown(name)));
        }
    };
    for object in &dictionary.objects {
        look_up(object.line, &object.data_type, unknown.insert(&object.data_type));
    }
    for of in &dictionary.data_types {
        let names = of.sub_items.iter().map(|item| item.data_type.as_str()).chain(of.base.as_deref());
        for name in names {
            look_up(of.line, name, unknown.insert(name));
        }
        let mut known = HashSet::new();
        let twice = of.sub_items.iter().filter_map(|item| item.sub_index).find(|number| !known.insert(*number));
        if let Some(number) = twice {
            let text = format!("DataType {}: SubIdx {number} is defined twice, the first one is used", shown(&of.name));
            element.note_at(of.line, text);
        }
    }
}

fn data_type(element: Element<'_>) -> Result<DataType, EsiError> {
    let array = element.child("ArrayInfo").map(array).transpose()?;
    let choice = |of: Element<'_>| -> Result<_, EsiError> {
        // Some enumerations have values of 64 bits; they are names for values that cannot occur.
        Ok((of.number_of::<i64>("Enum").ok().flatten().unwrap_or_default(), of.names("Text")?))
    };
    Ok(DataType {
        line: element.line(),
        name: element.text_of("Name").trim().to_owned(),
        base: element.child("BaseType").map(|base| base.raw().trim().to_owned()).filter(|base| !base.is_empty()),
        bit_size: element.number_of("BitSize")?.unwrap_or(0),
        array,
        sub_items: element.children("SubItem").map(sub_item).collect::<Result<_, _>>()?,
        choices: element.children("EnumInfo").map(choice).collect::<Result<_, _>>()?,
    })
}

fn array(element: Element<'_>) -> Result<ArrayBounds, EsiError> {
    let elements: u32 = element.number_of("Elements")?.unwrap_or(0);
    if elements > MAX_ELEMENTS {
        return Err(element.error(EsiProblem::TooMuch { what: "elements of an array", limit: MAX_ELEMENTS as usize }));
    }
    Ok(ArrayBounds { first: element.number_of("LBound")?.unwrap_or(0), elements })
}

fn sub_item(element: Element<'_>) -> Result<SubItem, EsiError> {
    Ok(SubItem {
        sub_index: element.number_of("SubIdx")?,
        name: element.text_of("Name").trim().to_owned(),
        data_type: element.text_of("Type").trim().to_owned(),
        bit_size: element.number_of("BitSize")?.unwrap_or(0),
        bit_offset: element.number_of("BitOffs")?.unwrap_or(0),
        flags: element.child("Flags").map(flags).transpose()?,
    })
}

fn object(element: Element<'_>) -> Result<Object, EsiError> {
    let index = element.required("Index")?;
    let mut object = Object {
        line: element.line(),
        index: slot_index(index)?,
        overwritten_by_module: index.is("OverwrittenByModule")?,
        name: element.names("Name")?,
        data_type: element.text_of("Type").trim().to_owned(),
        bit_size: element.number_of("BitSize")?.unwrap_or(0),
        flags: element.child("Flags").map(flags).transpose()?.unwrap_or_default(),
        ..Object::default()
    };
    if let Some(info) = element.child("Info") {
        object.info = values(info)?;
        for item in info.children("SubItem") {
            let info = item.child("Info").map(values).transpose()?.unwrap_or_default();
            object.sub_items.push(SubItemInfo { name: item.text_of("Name").trim().to_owned(), info });
        }
    }
    Ok(object)
}

fn values(element: Element<'_>) -> Result<ObjectInfo, EsiError> {
    // The old notation is a number, or a real number in some files, which is not used.
    let old = |name: &str| {
        let child = element.child(name)?;
        match child.number::<i64>() {
            Ok(number) => Some(number.to_le_bytes().to_vec()),
            Err(_) => {
                child.note(format!("{name} is not a whole number of 32 bits: not used"));
                None
            }
        }
    };
    let text = || element.child("DefaultString").map(|text| text.text().into_bytes());
    Ok(ObjectInfo {
        default: element.hex_of("DefaultData")?.or_else(text).or_else(|| old("DefaultValue")),
        minimum: element.hex_of("MinData")?.or_else(|| old("MinValue")),
        maximum: element.hex_of("MaxData")?.or_else(|| old("MaxValue")),
        unit: element.number_of("Unit")?,
    })
}

fn flags(element: Element<'_>) -> Result<Flags, EsiError> {
    let mut flags = Flags::default();
    if let Some(access) = element.child("Access") {
        flags.access = access_rights(access);
    }
    if let Some(mapping) = element.child("PdoMapping") {
        let text = mapping.raw().to_ascii_uppercase();
        flags.tx_mappable = text.contains('T');
        flags.rx_mappable = text.contains('R');
    }
    flags.is_backup = element.number_of::<u32>("Backup")?.is_some_and(|number| number != 0);
    flags.is_setting = element.number_of::<u32>("Setting")?.is_some_and(|number| number != 0);
    Ok(flags)
}

fn access_rights(element: Element<'_>) -> Access {
    let text = element.raw();
    let limited = |attribute: &str| element.attribute(attribute).map_or(ALL_STATES, states);
    let (read, write) = (limited("ReadRestrictions"), limited("WriteRestrictions"));
    match text.trim().to_ascii_lowercase().as_str() {
        "rw" => Access { read, write },
        "wo" => Access { read: 0, write },
        "ro" => Access { read, write: 0 },
        other => {
            element.note(format!("Access {}: taken as ro", shown(other)));
            Access { read, write: 0 }
        }
    }
}

/// The states of a restriction: bits of PREOP, SAFEOP, OP.
fn states(text: &str) -> u8 {
    let named = text.split('_').map(|state| match state.trim().to_ascii_lowercase().as_str() {
        "preop" => 1,
        "safeop" => 2,
        "op" => 4,
        _ => 0,
    });
    match named.fold(0, |all, one| all | one) {
        0 => ALL_STATES,
        states => states,
    }
}
