//! What commands with `--json` print that read from one SubDevice: `upload`, `reg_read`, `soe_read`, `sii_read`,
//! `foe_read`.

use serde::Serialize;

use super::values::{Hex, List};
use crate::data_types::{DataType, Scalar};
use crate::failure::Failure;
use crate::sii_image::{Category as Found, category_name};

/// A value in the form of its data type.
pub struct Value<'a> {
    /// Name of the data type.
    pub data_type: Option<&'static str>,
    /// The value.
    pub value: Scalar,
    /// Its bytes in hexadecimal digits.
    pub data: Hex<'a>,
}

impl<'a> Value<'a> {
    /// The value of these bytes.
    ///
    /// # Errors
    /// They have another size than the data type.
    pub fn new(data_type: Option<DataType>, bytes: &'a [u8]) -> Result<Value<'a>, Failure> {
        let value = data_type.map_or(Ok(Scalar::Nothing), |it| it.value(bytes))?;
        Ok(Value { data_type: data_type.map(|it| it.name), value, data: Hex(bytes) })
    }
}

/// An entry of an object.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Upload<'a> {
    /// Number of the master
    pub master: u32,
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Index of the object
    pub index: u16,
    /// Sub-index of the entry
    pub subindex: u8,
    /// Name of the data type, as `--type` takes it; null without one
    pub data_type: Option<&'static str>,
    /// The value: a number, or a text of type `string`; null for types of bytes, without a type, and where it is no
    /// finite number or no UTF-8
    pub value: Scalar,
    /// Its bytes as they are, in hexadecimal digits
    pub data: Hex<'a>,
}

/// Registers.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Registers<'a> {
    /// Number of the master
    pub master: u32,
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Address of the first register
    pub address: u16,
    /// Name of the data type, as `--type` takes it; null without one
    pub data_type: Option<&'static str>,
    /// The value: a number, or a text of type `string`; null for types of bytes, without a type, and where it is no
    /// finite number or no UTF-8
    pub value: Scalar,
    /// Its bytes as they are, in hexadecimal digits
    pub data: Hex<'a>,
}

/// An IDN.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Idn<'a> {
    /// Number of the master
    pub master: u32,
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Drive behind the SubDevice, 0 to 7
    pub drive: u8,
    /// Number of the IDN; bit 15: it is specific to the product (`P`)
    pub idn: u16,
    /// Name of the data type, as `--type` takes it; null without one
    pub data_type: Option<&'static str>,
    /// The value: a number, or a text of type `string`; null for types of bytes, without a type, and where it is no
    /// finite number or no UTF-8
    pub value: Scalar,
    /// Its bytes as they are, in hexadecimal digits
    pub data: Hex<'a>,
}

/// An SII.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Sii<'a> {
    /// Number of the master
    pub master: u32,
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Length of the SII, in bytes
    pub length_bytes: usize,
    /// Its categories, in their order; null where they do not end within the SII
    pub categories: Option<List<'a, Found<'a>, (), Category<'a>>>,
    /// The whole SII, in hexadecimal digits
    pub data: Hex<'a>,
}

/// A category of an SII.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Category<'a> {
    /// Number of the category
    pub category: u16,
    /// Its name in the text, such as `TXPDO`; `unknown` for those unknown to the tool
    pub name: &'static str,
    /// Its bytes without number and length, in hexadecimal digits
    pub data: Hex<'a>,
}

impl<'a> Sii<'a> {
    /// An image, with its categories where they end within it.
    pub fn new(master: u32, position: u16, image: &'a [u8], categories: Option<&'a [Found<'a>]>) -> Sii<'a> {
        let categories = categories.map(|all| List { all, context: (), make: category });
        Sii { master, position, length_bytes: image.len(), categories, data: Hex(image) }
    }
}

fn category<'a>(_: usize, (category, data): &Found<'a>, _: ()) -> Category<'a> {
    Category { category: *category, name: category_name(*category), data: Hex(data) }
}

/// A file.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct File<'a> {
    /// Number of the master
    pub master: u32,
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Name of the file on the SubDevice
    pub file: &'a str,
    /// Its length, in bytes
    pub length_bytes: usize,
    /// Its bytes, in hexadecimal digits; null where --output-file names a file for them
    pub data: Option<Hex<'a>>,
}
