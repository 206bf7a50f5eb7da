//! Object dictionaries as bytes.

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::{AccessRights, DataType, ObjectCode};

use super::code::{Code, Input, by_number, fields};
use super::error::KnowledgeError;
use crate::info::{Entry, KnownDictionary, Object, place};

by_number!(DataType, u16, |kind| kind.0, DataType);
by_number!(AccessRights, u16, |rights| rights.0, AccessRights);
by_number!(ObjectCode, u8, |code| code.code(), ObjectCode::from_code);

fields!(Object { index: u16, data_type: DataType, max_sub_index: u8, code: ObjectCode, name: String });
fields!(Entry {
    index: u16,
    sub_index: u8,
    data_type: DataType,
    bit_length: u16,
    access: AccessRights,
    unit: Option<u16>,
    default: Option<Vec<u8>>,
    minimum: Option<Vec<u8>>,
    maximum: Option<Vec<u8>>,
    name: String,
});

impl Code for KnownDictionary {
    /// Three numbers, two options or flags, and four lists.
    const LEAST: usize = 3 * 4 + 2 + 4 * 4;

    fn put(&self, out: &mut Vec<u8>) {
        self.vendor_id.put(out);
        self.product_code.put(out);
        self.revision.put(out);
        self.version.put(out);
        self.indices.put(out);
        self.is_complete.put(out);
        self.objects.len().put(out);
        self.objects.values().for_each(|object| object.put(out));
        self.entries.len().put(out);
        self.entries.values().for_each(|entry| entry.put(out));
        self.missing.len().put(out);
        self.missing.iter().for_each(|missing| missing.put(out));
    }

    fn take(input: &mut Input<'_>) -> Result<KnownDictionary, KnowledgeError> {
        let [vendor_id, product_code, revision] = [u32::take(input)?, u32::take(input)?, u32::take(input)?];
        let (version, indices, is_complete) =
            (<Option<Vec<u8>> as Code>::take(input)?, Vec::take(input)?, bool::take(input)?);
        let objects: Vec<Object> = Vec::take(input)?;
        let entries: Vec<Entry> = Vec::take(input)?;
        let missing: Vec<u32> = Vec::take(input)?;
        let objects = objects.into_iter().map(|object| (object.index, object)).collect();
        let entries = entries.into_iter().map(|entry| (place(entry.index, entry.sub_index), entry)).collect();
        let missing = missing.into_iter().collect();
        Ok(KnownDictionary {
            vendor_id,
            product_code,
            revision,
            version,
            indices,
            objects,
            entries,
            missing,
            is_complete,
        })
    }
}
