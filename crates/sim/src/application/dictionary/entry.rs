//! One entry of an object: its value and the conditions of writes (protocol 6.3).

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::coe::{AccessRights, DataType};
use ringcat_wire::mailbox::sdo::AbortCode;

/// Largest object in bytes: the announced length of a download is buffered until its end.
pub const MAX_TRANSFER_BYTES: usize = 1 << 20;
/// Longest value that has a default and a range: one number.
const MAX_NUMBER: usize = 8;

/// Access rights of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Cannot be written.
    ReadOnly,
    /// Writable in every state with a mailbox.
    ReadWrite,
    /// Writable in PREOP.
    ReadWritePreOp,
    /// Writable in every state with a mailbox, not readable.
    WriteOnly,
}

/// One subindex of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Subindex.
    pub sub_index: u8,
    /// Data type code of CoE.
    pub data_type: u8,
    /// Access rights.
    pub access: Access,
    /// The value, little-endian, of fixed length except for a domain.
    pub value: Vec<u8>,
    /// Name; if empty, the name of the object applies.
    pub name: String,
    /// Access rights in addition to `access`: mappable, backup, setting.
    more_rights: u16,
    /// Smallest and largest value of a number.
    range: Option<(i64, i64)>,
    /// The only allowed numbers, if there are few.
    choices: &'static [i64],
    /// Unit for SDO information.
    unit: Option<u16>,
    default: Option<Vec<u8>>,
    /// Bits of the value, if they are neither those of the type nor those of all its bytes.
    bits: Option<u16>,
    /// Data type and access rights of SDO information, if they are not those of `data_type` and `access`.
    stated: Option<(DataType, AccessRights)>,
}

impl Entry {
    /// An entry. The value is also the default value.
    pub fn new(sub_index: u8, data_type: u8, access: Access, value: &[u8]) -> Entry {
        let default = (1..=MAX_NUMBER).contains(&value.len()).then(|| value.to_vec());
        let value = value.into();
        Entry {
            sub_index,
            data_type,
            access,
            value,
            name: String::new(),
            more_rights: 0,
            range: None,
            choices: &[],
            unit: None,
            default,
            bits: None,
            stated: None,
        }
    }

    /// The same entry at another subindex.
    pub fn at(self, sub_index: u8) -> Entry {
        Entry { sub_index, ..self }
    }

    /// The same entry with a name.
    pub fn named(self, name: &str) -> Entry {
        Entry { name: name.into(), ..self }
    }

    /// The same entry with additional access rights: bits of [`AccessRights`].
    pub fn allow(self, rights: u16) -> Entry {
        Entry { more_rights: self.more_rights | rights, ..self }
    }

    /// The same entry with this number of bits, for example 3 for an enumeration in a byte; 0: not stated.
    pub fn of_bits(self, bits: u16) -> Entry {
        Entry { bits: Some(bits).filter(|bits| *bits != 0), ..self }
    }

    /// The same entry with this data type and these bits of [`AccessRights`] in SDO information, as devices state them:
    /// types of their own, no rights at all.
    pub fn stated(self, data_type: u16, rights: u16) -> Entry {
        Entry { stated: Some((DataType(data_type), AccessRights(rights))), ..self }
    }

    /// The same entry as a number that can only be written within this range.
    pub fn within(self, minimum: i64, maximum: i64) -> Entry {
        Entry { range: Some((minimum, maximum)), ..self }
    }

    /// The same entry as a number that accepts only one of these values.
    pub fn one_of(self, choices: &'static [i64]) -> Entry {
        Entry { choices, ..self }
    }

    /// The same entry with a unit: prefix (a power of ten) and unit of ETG.1004, for example 0xFD03 for milliseconds.
    pub fn in_unit(self, unit: u16) -> Entry {
        Entry { unit: Some(unit), ..self }
    }

    /// The unit, if there is one.
    pub const fn unit(&self) -> Option<u16> {
        self.unit
    }

    /// Data type.
    pub fn data_type(&self) -> DataType {
        self.stated.map_or(DataType(self.data_type.into()), |(data_type, _)| data_type)
    }

    /// Length of the value in bits; 0 if it varies (domains) or exceeds the field in SDO information.
    pub fn bit_length(&self) -> u16 {
        if self.data_type() == DataType::DOMAIN {
            return 0;
        }
        let whole = || u16::try_from(self.value.len() * 8).unwrap_or(0);
        self.bits.or(self.data_type().bits()).unwrap_or_else(whole)
    }

    /// Access rights in the format of SDO information.
    pub fn rights(&self) -> AccessRights {
        let by_access = match self.access {
            Access::ReadOnly => AccessRights::READ,
            Access::ReadWrite => AccessRights::READ | AccessRights::WRITE,
            Access::ReadWritePreOp => AccessRights::READ | AccessRights::WRITE_PREOP,
            Access::WriteOnly => AccessRights::WRITE,
        };
        self.stated.map_or(AccessRights(by_access | self.more_rights), |(_, rights)| rights)
    }

    /// Default value, if it has the length of the type.
    pub fn default_bytes(&self) -> Option<&[u8]> {
        self.default.as_deref().filter(|default| default.len() == usize::from(self.bit_length()).div_ceil(8))
    }

    /// Smallest and largest value, if defined.
    pub fn range_bytes(&self) -> Option<(Vec<u8>, Vec<u8>)> {
        let length = usize::from(self.bit_length()).div_ceil(8);
        let bytes = |value: i64| value.to_le_bytes().get(..length).map(<[u8]>::to_vec);
        let (minimum, maximum) = self.range?;
        Some((bytes(minimum)?, bytes(maximum)?))
    }

    /// Whether this number of bytes may be written in `state`, for any values.
    pub(super) fn check_access(&self, length: usize, state: AlState) -> Result<(), AbortCode> {
        match self.access {
            Access::ReadOnly => return Err(AbortCode::READ_ONLY),
            Access::ReadWritePreOp if state != AlState::PreOp => return Err(AbortCode::CANNOT_BE_STORED_DEVICE_STATE),
            Access::ReadWritePreOp | Access::ReadWrite | Access::WriteOnly => {}
        }
        let (least, most) = match self.data_type() {
            DataType::DOMAIN => (0, MAX_TRANSFER_BYTES),
            _ => (self.value.len(), self.value.len()),
        };
        if length > most {
            return Err(AbortCode::LENGTH_TOO_LONG);
        }
        if length < least { Err(AbortCode::LENGTH_TOO_SHORT) } else { Ok(()) }
    }

    /// Whether the entry accepts the value.
    pub(super) fn check_value(&self, data: &[u8]) -> Result<(), AbortCode> {
        let value = self.number(data);
        if !self.choices.is_empty() && !self.choices.contains(&value) {
            return Err(AbortCode::VALUE_RANGE);
        }
        let Some((minimum, maximum)) = self.range else {
            return Ok(());
        };
        if value > maximum {
            return Err(AbortCode::VALUE_TOO_HIGH);
        }
        if value < minimum { Err(AbortCode::VALUE_TOO_LOW) } else { Ok(()) }
    }

    /// The bytes as a number, from the first eight bytes of longer values.
    pub(super) fn number(&self, data: &[u8]) -> i64 {
        let signed = matches!(
            self.data_type(),
            DataType::INTEGER8 | DataType::INTEGER16 | DataType::INTEGER24 | DataType::INTEGER32 | DataType::INTEGER64
        );
        let negative = signed && data.last().is_some_and(|byte| byte & 0x80 != 0);
        let mut bytes = [if negative { 0xFF } else { 0 }; MAX_NUMBER];
        let length = data.len().min(MAX_NUMBER);
        bytes[..length].copy_from_slice(&data[..length]);
        i64::from_le_bytes(bytes)
    }
}
