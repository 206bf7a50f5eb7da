//! Descriptions of an object and of an entry in SDO information (protocol 6.3).
//!
//! Converts the data of an [`SdoInformation`](super::SdoInformation) after the reassembly of fragments.

use super::DataType;
use crate::mailbox::payload::{FieldWriter, PayloadError, split};

/// Object code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ObjectCode {
    /// 2: DOMAIN.
    Domain,
    /// 5: DEFTYPE.
    DefType,
    /// 6: DEFSTRUCT.
    DefStruct,
    /// 7: VAR, one value at subindex 0.
    Variable,
    /// 8: ARRAY, entries of one type.
    Array,
    /// 9: RECORD, entries of several types.
    Record,
    /// Any other code.
    Other(u8),
}

impl ObjectCode {
    /// From the code.
    pub const fn from_code(code: u8) -> ObjectCode {
        match code {
            2 => ObjectCode::Domain,
            5 => ObjectCode::DefType,
            6 => ObjectCode::DefStruct,
            7 => ObjectCode::Variable,
            8 => ObjectCode::Array,
            9 => ObjectCode::Record,
            code => ObjectCode::Other(code),
        }
    }

    /// The code.
    pub const fn code(self) -> u8 {
        match self {
            ObjectCode::Domain => 2,
            ObjectCode::DefType => 5,
            ObjectCode::DefStruct => 6,
            ObjectCode::Variable => 7,
            ObjectCode::Array => 8,
            ObjectCode::Record => 9,
            ObjectCode::Other(code) => code,
        }
    }
}

/// An object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectDescription<'a> {
    /// Index.
    pub index: u16,
    /// Data type of the whole object.
    pub data_type: DataType,
    /// Largest subindex.
    pub max_sub_index: u8,
    /// Object code.
    pub code: ObjectCode,
    /// Name, without terminating NUL.
    pub name: &'a [u8],
}

impl<'a> ObjectDescription<'a> {
    /// Bytes before the name.
    pub const OVERHEAD: usize = 6;

    /// Decodes data of an object response.
    pub fn decode(data: &'a [u8]) -> Result<ObjectDescription<'a>, PayloadError> {
        let (&[a, b, c, d, max_sub_index, code], name) = split(data, "object description")?;
        Ok(ObjectDescription {
            index: u16::from_le_bytes([a, b]),
            data_type: DataType(u16::from_le_bytes([c, d])),
            max_sub_index,
            code: ObjectCode::from_code(code),
            name,
        })
    }

    /// Encodes data of an object response and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        writer.put_u16(self.index)?;
        writer.put_u16(self.data_type.0)?;
        writer.put(&[self.max_sub_index, self.code.code()])?;
        writer.put(self.name)?;
        Some(writer.length())
    }
}

/// The optional parts of an entry description, requested or present.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ValueInfo(pub u8);

impl ValueInfo {
    /// Bit: access rights.
    pub const ACCESS: u8 = 1 << 0;
    /// Bit: category.
    pub const CATEGORY: u8 = 1 << 1;
    /// Bit: PDO mapping.
    pub const PDO: u8 = 1 << 2;
    /// Bit: unit.
    pub const UNIT: u8 = 1 << 3;
    /// Bit: default value.
    pub const DEFAULT: u8 = 1 << 4;
    /// Bit: smallest value.
    pub const MINIMUM: u8 = 1 << 5;
    /// Bit: largest value.
    pub const MAXIMUM: u8 = 1 << 6;
    /// All parts.
    pub const ALL: ValueInfo = ValueInfo(0x7F);

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u8) -> bool {
        self.0 & bits == bits
    }
}

/// Access rights of an entry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AccessRights(pub u16);

impl AccessRights {
    /// Bit: read in PREOP.
    pub const READ_PREOP: u16 = 1 << 0;
    /// Bit: read in SAFEOP.
    pub const READ_SAFEOP: u16 = 1 << 1;
    /// Bit: read in OP.
    pub const READ_OP: u16 = 1 << 2;
    /// Bit: write in PREOP.
    pub const WRITE_PREOP: u16 = 1 << 3;
    /// Bit: write in SAFEOP.
    pub const WRITE_SAFEOP: u16 = 1 << 4;
    /// Bit: write in OP.
    pub const WRITE_OP: u16 = 1 << 5;
    /// Bit: can be mapped to an RxPDO.
    pub const RX_MAPPABLE: u16 = 1 << 6;
    /// Bit: can be mapped to a TxPDO.
    pub const TX_MAPPABLE: u16 = 1 << 7;
    /// Bit: stored for the replacement of a device (backup).
    pub const BACKUP: u16 = 1 << 8;
    /// Bit: is a start-up parameter.
    pub const SETTING: u16 = 1 << 9;
    /// Readable in every state.
    pub const READ: u16 = Self::READ_PREOP | Self::READ_SAFEOP | Self::READ_OP;
    /// Writable in every state.
    pub const WRITE: u16 = Self::WRITE_PREOP | Self::WRITE_SAFEOP | Self::WRITE_OP;

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }
}

/// An entry request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EntryRequest {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// Requested parts.
    pub value_info: ValueInfo,
}

impl EntryRequest {
    /// Bytes of the data.
    pub const LEN: usize = 4;

    /// Decodes data of an entry request.
    pub fn decode(data: &[u8]) -> Result<EntryRequest, PayloadError> {
        let (&[a, b, sub_index, value_info], _) = split::<{ Self::LEN }>(data, "entry request")?;
        Ok(EntryRequest { index: u16::from_le_bytes([a, b]), sub_index, value_info: ValueInfo(value_info) })
    }

    /// Encodes data of an entry request.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let [a, b] = self.index.to_le_bytes();
        [a, b, self.sub_index, self.value_info.0]
    }
}

/// An entry of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntryDescription<'a> {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// The parts that the SubDevice declares as present. The bits of unit, default, minimum and maximum match the
    /// fields.
    pub value_info: ValueInfo,
    /// Data type.
    pub data_type: DataType,
    /// Length of a value in bits.
    pub bit_length: u16,
    /// Access rights.
    pub access: AccessRights,
    /// Unit (ETG.1004).
    pub unit: Option<u16>,
    /// Default value, little-endian, with the length of the entry.
    pub default: Option<&'a [u8]>,
    /// Smallest value, in the same format.
    pub minimum: Option<&'a [u8]>,
    /// Largest value, in the same format.
    pub maximum: Option<&'a [u8]>,
    /// Name, without terminating NUL.
    pub name: &'a [u8],
}

impl<'a> EntryDescription<'a> {
    /// Bytes before the optional parts.
    pub const OVERHEAD: usize = 10;

    /// Decodes data of an entry response.
    pub fn decode(data: &'a [u8]) -> Result<EntryDescription<'a>, PayloadError> {
        let what = "entry description";
        let (&[a, b, sub_index, value_info, c, d, e, f, g, h], mut rest) = split(data, what)?;
        let value_info = ValueInfo(value_info);
        let bit_length = u16::from_le_bytes([e, f]);
        let mut part = |bit: u8, length: usize| {
            if !value_info.has(bit) {
                return Ok(None);
            }
            let short = PayloadError::Short { what, expected: data.len() - rest.len() + length, got: data.len() };
            let (part, tail) = rest.split_at_checked(length).ok_or(short)?;
            rest = tail;
            Ok(Some(part))
        };
        let bytes = usize::from(bit_length).div_ceil(8);
        let unit = part(ValueInfo::UNIT, 2)?;
        let default = part(ValueInfo::DEFAULT, bytes)?;
        let minimum = part(ValueInfo::MINIMUM, bytes)?;
        let maximum = part(ValueInfo::MAXIMUM, bytes)?;
        Ok(EntryDescription {
            index: u16::from_le_bytes([a, b]),
            sub_index,
            value_info,
            data_type: DataType(u16::from_le_bytes([c, d])),
            bit_length,
            access: AccessRights(u16::from_le_bytes([g, h])),
            unit: unit.and_then(|unit| Some(u16::from_le_bytes(*unit.first_chunk()?))),
            default,
            minimum,
            maximum,
            name: rest,
        })
    }

    /// Encodes data of an entry response and returns its length; `None` if it does not fit `out`, or if default,
    /// minimum or maximum does not have the length of the entry.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let bytes = usize::from(self.bit_length).div_ceil(8);
        let mut info =
            self.value_info.0 & !(ValueInfo::UNIT | ValueInfo::DEFAULT | ValueInfo::MINIMUM | ValueInfo::MAXIMUM);
        if self.unit.is_some() {
            info |= ValueInfo::UNIT;
        }
        let values = [
            (self.default, ValueInfo::DEFAULT),
            (self.minimum, ValueInfo::MINIMUM),
            (self.maximum, ValueInfo::MAXIMUM),
        ];
        for (value, bit) in values {
            if let Some(value) = value {
                info |= bit;
                if value.len() != bytes {
                    return None;
                }
            }
        }
        let mut writer = FieldWriter::new(out);
        writer.put_u16(self.index)?;
        writer.put(&[self.sub_index, info])?;
        writer.put_u16(self.data_type.0)?;
        writer.put_u16(self.bit_length)?;
        writer.put_u16(self.access.0)?;
        if let Some(unit) = self.unit {
            writer.put_u16(unit)?;
        }
        for value in values.into_iter().filter_map(|(value, _)| value) {
            writer.put(value)?;
        }
        writer.put(self.name)?;
        Some(writer.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    // covers: 6.3, codec-mailbox
    #[test]
    fn an_object_description_has_the_expected_bytes() {
        let object = ObjectDescription {
            index: 0x1018,
            data_type: DataType::IDENTITY,
            max_sub_index: 4,
            code: ObjectCode::Record,
            name: b"Identity",
        };
        let bytes = b"\x18\x10\x23\x00\x04\x09Identity";
        let mut out = [0; 32];
        let length = object.encode(&mut out).unwrap();
        assert_eq!(&out[..length], bytes);
        assert_eq!(ObjectDescription::decode(bytes), Ok(object));
        for code in [2, 5, 6, 7, 8, 9] {
            assert_eq!(ObjectCode::from_code(code).code(), code);
            assert_ne!(ObjectCode::from_code(code), ObjectCode::Other(code));
        }
    }

    // covers: 6.3, codec-mailbox
    #[test]
    fn an_entry_description_has_the_expected_bytes() {
        let entry = EntryDescription {
            index: 0x8010,
            sub_index: 1,
            value_info: ValueInfo::ALL,
            data_type: DataType::UNSIGNED16,
            bit_length: 16,
            access: AccessRights(AccessRights::READ | AccessRights::WRITE_PREOP | AccessRights::SETTING),
            unit: Some(0x0102),
            default: Some(&[5, 0]),
            minimum: Some(&[1, 0]),
            maximum: Some(&[0xE8, 0x03]),
            name: b"Filter",
        };
        let bytes = b"\x10\x80\x01\x7F\x06\x00\x10\x00\x0F\x02\x02\x01\x05\x00\x01\x00\xE8\x03Filter";
        let mut out = [0; 32];
        let length = entry.encode(&mut out).unwrap();
        assert_eq!(&out[..length], bytes);
        assert_eq!(EntryDescription::decode(bytes), Ok(entry));
        let wrong = EntryDescription { default: Some(&[5]), ..entry };
        assert_eq!(wrong.encode(&mut out), None);
        let cut = PayloadError::Short { what: "entry description", expected: 16, got: 15 };
        assert_eq!(EntryDescription::decode(&bytes[..15]), Err(cut));
    }

    #[test]
    fn a_one_bit_entry_has_a_default_value_of_one_byte() {
        let bytes = b"\x00\x60\x01\x17\x01\x00\x01\x00\x87\x00\x01In";
        let entry = EntryDescription::decode(bytes).unwrap();
        assert_eq!((entry.bit_length, entry.default, entry.name), (1, Some(&[1][..]), &b"In"[..]));
        assert!(entry.access.has(AccessRights::READ | AccessRights::TX_MAPPABLE));
        assert!(!entry.access.has(AccessRights::WRITE_OP));
    }

    proptest! {
        #[test]
        fn any_bytes_never_panic_and_decoded_messages_read_back(data in proptest::collection::vec(any::<u8>(), 0..60)) {
            let mut out = [0; 64];
            if let Ok(object) = ObjectDescription::decode(&data) {
                let length = object.encode(&mut out).unwrap();
                prop_assert_eq!(&out[..length], &data[..]);
            }
            if let Ok(entry) = EntryDescription::decode(&data) {
                let length = entry.encode(&mut out).unwrap();
                prop_assert_eq!(&out[..length], &data[..]);
            }
            if let Ok(request) = EntryRequest::decode(&data) {
                prop_assert_eq!(&request.encode()[..], &data[..4]);
            }
        }

        // covers: codec-mailbox
        #[test]
        fn any_short_entry_reads_back(
            info in any::<u8>(),
            bits in 0u16..40,
            name in proptest::collection::vec(any::<u8>(), 0..20)
        ) {
            let value = [0x5A; 5];
            let value = &value[..usize::from(bits).div_ceil(8)];
            let part = |bit| ValueInfo(info).has(bit).then_some(value);
            let entry = EntryDescription {
                index: 0x2000,
                sub_index: 3,
                value_info: ValueInfo(info),
                data_type: DataType(0x0800),
                bit_length: bits,
                access: AccessRights(0x003F),
                unit: ValueInfo(info).has(ValueInfo::UNIT).then_some(7),
                default: part(ValueInfo::DEFAULT),
                minimum: part(ValueInfo::MINIMUM),
                maximum: part(ValueInfo::MAXIMUM),
                name: &name,
            };
            let mut out = [0; 64];
            let length = entry.encode(&mut out).unwrap();
            prop_assert_eq!(EntryDescription::decode(&out[..length]), Ok(entry));
        }
    }
}
