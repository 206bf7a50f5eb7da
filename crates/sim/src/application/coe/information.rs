//! SDO information: lists, objects and entries, in fragments if they do not fit (protocol 6.3).
//!
//! Input: a request. Output: one message per fragment, or an error with an abort code.

use ringcat_wire::mailbox::coe::{
    AccessRights, DataType, EntryDescription, EntryRequest, InformationOpcode, ListType, ObjectDescription,
    SdoInformation, ValueInfo,
};
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::mailbox::{ErrorReply, PayloadError};

use super::Answer;
use crate::application::dictionary::{Dictionary, Object};

/// Bytes of an object or entry description in addition to name and values.
const DESCRIPTION_ROOM: usize = 16;

/// Serves one request.
pub fn serve(payload: &[u8], room: usize, dictionary: &Dictionary) -> Answer {
    match respond(payload, dictionary) {
        Ok((opcode, Ok(data))) => fragments(opcode, &data, room),
        Ok((_, Err(code))) => fragments(InformationOpcode::Error, &code.0.to_le_bytes(), room),
        Err(PayloadError::Short { .. }) => Answer::Error(ErrorReply::SIZE_TOO_SHORT),
        Err(PayloadError::Service { .. } | PayloadError::Code { .. }) => {
            Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED)
        }
    }
}

type Data = Result<Vec<u8>, AbortCode>;

/// Opcode and data of the response.
fn respond(payload: &[u8], dictionary: &Dictionary) -> Result<(InformationOpcode, Data), PayloadError> {
    let request = SdoInformation::decode(payload)?;
    Ok(match request.opcode {
        InformationOpcode::ListRequest => (InformationOpcode::ListResponse, list(request.list()?.0, dictionary)),
        InformationOpcode::ObjectRequest => (InformationOpcode::ObjectResponse, object(request.object()?, dictionary)),
        InformationOpcode::EntryRequest => {
            (InformationOpcode::EntryResponse, entry(EntryRequest::decode(request.data)?, dictionary))
        }
        opcode @ (InformationOpcode::ListResponse
        | InformationOpcode::ObjectResponse
        | InformationOpcode::EntryResponse
        | InformationOpcode::Error
        | InformationOpcode::Other(_)) => (opcode, Err(AbortCode::UNKNOWN_COMMAND)),
    })
}

/// The access rights that an object of a list has in at least one of its entries.
const fn rights(list: ListType) -> u16 {
    match list {
        ListType::RxMappable => AccessRights::RX_MAPPABLE,
        ListType::TxMappable => AccessRights::TX_MAPPABLE,
        ListType::Backup => AccessRights::BACKUP,
        ListType::Settings => AccessRights::SETTING,
        ListType::Lengths | ListType::All | ListType::Other(_) => 0,
    }
}

fn belongs(object: &Object, list: ListType) -> bool {
    let wanted = rights(list);
    wanted == 0 || object.entries.iter().any(|entry| entry.rights().has(wanted))
}

fn list(kind: ListType, dictionary: &Dictionary) -> Data {
    let indices = |kind| dictionary.objects().iter().filter(move |object| belongs(object, kind));
    let numbers: Vec<u16> = match kind {
        ListType::Lengths => {
            ListType::LISTS.map(|kind| u16::try_from(indices(kind).count()).unwrap_or(u16::MAX)).into()
        }
        ListType::Other(_) => return Err(AbortCode::VALUE_RANGE),
        kind => indices(kind).map(|object| object.index).collect(),
    };
    Ok(core::iter::once(kind.code()).chain(numbers).flat_map(u16::to_le_bytes).collect())
}

fn object(index: u16, dictionary: &Dictionary) -> Data {
    let object = dictionary.object(index).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)?;
    let description = ObjectDescription {
        index,
        data_type: object.data_type(),
        max_sub_index: object.entries.last().map_or(0, |entry| entry.sub_index),
        code: object.code(),
        name: object.name.as_bytes(),
    };
    let mut bytes = vec![0; DESCRIPTION_ROOM + object.name.len()];
    let length = description.encode(&mut bytes).ok_or(AbortCode::OUT_OF_MEMORY)?;
    bytes.truncate(length);
    Ok(bytes)
}

fn entry(request: EntryRequest, dictionary: &Dictionary) -> Data {
    let EntryRequest { index, sub_index, value_info: wanted } = request;
    let object = dictionary.object(index).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)?;
    let Some(entry) = object.entry(sub_index) else {
        let last = object.entries.last().map_or(0, |entry| entry.sub_index);
        return if sub_index < last { gap(request) } else { Err(AbortCode::SUB_INDEX_DOES_NOT_EXIST) };
    };
    let (minimum, maximum) = entry.range_bytes().unzip();
    let part = |bit, value| if wanted.has(bit) { value } else { None };
    let default = entry.default_bytes().map(<[u8]>::to_vec);
    let parts =
        [part(ValueInfo::DEFAULT, default), part(ValueInfo::MINIMUM, minimum), part(ValueInfo::MAXIMUM, maximum)];
    let unit = entry.unit().filter(|_| wanted.has(ValueInfo::UNIT));
    let [default, minimum, maximum] = parts.each_ref().map(Option::as_deref);
    let name = if entry.name.is_empty() { &object.name } else { &entry.name };
    let description = EntryDescription {
        index,
        sub_index,
        value_info: ValueInfo(wanted.0 & (ValueInfo::ACCESS | ValueInfo::CATEGORY | ValueInfo::PDO)),
        data_type: entry.data_type(),
        bit_length: entry.bit_length(),
        access: entry.rights(),
        unit,
        default,
        minimum,
        maximum,
        name: name.as_bytes(),
    };
    let values: usize = parts.iter().flatten().map(Vec::len).sum();
    let mut bytes = vec![0; DESCRIPTION_ROOM + values + name.len()];
    let length = description.encode(&mut bytes).ok_or(AbortCode::OUT_OF_MEMORY)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// A gap between two entries of a record: an entry without type and bits. MainDevices that list an object read each
/// subindex up to the last, and treat an error as a fault of the device.
fn gap(request: EntryRequest) -> Data {
    let EntryRequest { index, sub_index, value_info } = request;
    let name = format!("SubIndex {sub_index:03}");
    let description = EntryDescription {
        index,
        sub_index,
        value_info: ValueInfo(value_info.0 & ValueInfo::ACCESS),
        data_type: DataType(0),
        bit_length: 0,
        access: AccessRights(0),
        unit: None,
        default: None,
        minimum: None,
        maximum: None,
        name: name.as_bytes(),
    };
    let mut bytes = vec![0; DESCRIPTION_ROOM + name.len()];
    let length = description.encode(&mut bytes).ok_or(AbortCode::OUT_OF_MEMORY)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// The data in the required number of messages. Each has an even number of bytes, so that no index is split.
fn fragments(opcode: InformationOpcode, data: &[u8], room: usize) -> Answer {
    let most = (room.saturating_sub(SdoInformation::OVERHEAD) & !1).max(2);
    let pieces: Vec<&[u8]> = if data.is_empty() { vec![data] } else { data.chunks(most).collect() };
    let count = pieces.len();
    let messages = pieces.into_iter().enumerate().map(|(number, piece)| {
        let left = count - 1 - number;
        let fragments_left = u16::try_from(left).unwrap_or(u16::MAX);
        let message = SdoInformation { opcode, fragments_left, data: piece, incomplete: left > 0 };
        let mut bytes = vec![0; SdoInformation::OVERHEAD + piece.len()];
        let length = message.encode(&mut bytes).unwrap_or(0);
        bytes.truncate(length);
        bytes
    });
    Answer::Payloads(messages.collect())
}
