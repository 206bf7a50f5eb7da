//! EEPROM data (protocol ES-80, ES-81, ES-100).

use crate::esi::element::Element;
use crate::esi::error::{EsiError, EsiProblem};
use crate::esi::model::{Eeprom, EepromCategory, EepromContent};

/// The number behind the last category.
const CATEGORY_END: u16 = 0xFFFF;
/// Largest EEPROM: the size word counts units of 128 bytes.
const MAX_BYTES: u32 = 0x1_0000 * 128;

pub(super) fn eeprom(element: Element<'_>) -> Result<Eeprom, EsiError> {
    let byte_size: Option<u32> = element.number_of("ByteSize")?;
    if let Some(size) = byte_size.filter(|size| *size > MAX_BYTES || *size == 0) {
        let expected = format!("1 to {MAX_BYTES} bytes");
        return Err(element.required("ByteSize")?.error(EsiProblem::Value { expected, got: size.to_string() }));
    }
    let bootstrap = element.hex_of("BootStrap")?.filter(|bytes| !bytes.is_empty());
    Ok(Eeprom {
        line: element.line(),
        assign_to_pdi: element.is("AssignToPdi")?,
        data: element.hex_of("Data")?,
        byte_size,
        config_data: element.hex_of("ConfigData")?.unwrap_or_default(),
        bootstrap,
        categories: element.children("Category").map(category).collect::<Result<_, _>>()?,
    })
}

fn category(element: Element<'_>) -> Result<EepromCategory, EsiError> {
    let number: u16 = element.required_number("CatNo")?;
    if number == CATEGORY_END {
        let expected = format!("a category: {CATEGORY_END} is the end of an EEPROM");
        return Err(element.required("CatNo")?.error(EsiProblem::Value { expected, got: number.to_string() }));
    }
    let content = if let Some(data) = element.hex_of("Data")? {
        EepromContent::Data(data)
    } else if let Some(text) = element.child("DataString") {
        EepromContent::Text(text.text())
    } else if let Some(number) = element.number_of("DataUINT")? {
        EepromContent::U16(number)
    } else if let Some(number) = element.number_of("DataUDINT")? {
        EepromContent::U32(number)
    } else {
        EepromContent::Data(Vec::new())
    };
    Ok(EepromCategory { line: element.line(), number, content })
}
