//! SDO information about the objects of the MainDevice itself: lists, objects, entries, in fragments (protocol 6.3).

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::{
    AccessRights, EntryDescription, EntryRequest, InformationOpcode, ListType, ObjectDescription, SdoInformation,
    ValueInfo,
};
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::mailbox::{ErrorReply, PayloadError};

use super::catalogue::Object;

/// Bytes of a description beside its name.
const DESCRIPTION_ROOM: usize = 16;

/// The messages that answer a request, with this number of declared SubDevices; each fits into `room`. The error is
/// that of a mailbox error reply.
pub(super) fn answer(payload: &[u8], room: usize, declared: usize) -> Result<Vec<Vec<u8>>, u16> {
    match respond(payload, declared) {
        Ok((opcode, Ok(data))) => Ok(fragments(opcode, &data, room)),
        Ok((_, Err(code))) => Ok(fragments(InformationOpcode::Error, &code.0.to_le_bytes(), room)),
        Err(PayloadError::Short { .. }) => Err(ErrorReply::SIZE_TOO_SHORT),
        Err(PayloadError::Service { .. } | PayloadError::Code { .. }) => Err(ErrorReply::SERVICE_NOT_SUPPORTED),
    }
}

type Data = Result<Vec<u8>, AbortCode>;

fn respond(payload: &[u8], declared: usize) -> Result<(InformationOpcode, Data), PayloadError> {
    let request = SdoInformation::decode(payload)?;
    Ok(match request.opcode {
        InformationOpcode::ListRequest => (InformationOpcode::ListResponse, list(request.list()?.0, declared)),
        InformationOpcode::ObjectRequest => (InformationOpcode::ObjectResponse, object(request.object()?, declared)),
        InformationOpcode::EntryRequest => {
            (InformationOpcode::EntryResponse, entry(EntryRequest::decode(request.data)?, declared))
        }
        opcode @ (InformationOpcode::ListResponse
        | InformationOpcode::ObjectResponse
        | InformationOpcode::EntryResponse
        | InformationOpcode::Error
        | InformationOpcode::Other(_)) => (opcode, Err(AbortCode::UNKNOWN_COMMAND)),
    })
}

/// No object can be mapped, stored or set at start-up: those lists are empty.
fn list(kind: ListType, declared: usize) -> Data {
    let numbers: Vec<u16> = match kind {
        ListType::Lengths => vec![Object::indices(declared).count() as u16, 0, 0, 0, 0],
        ListType::All => Object::indices(declared).collect(),
        ListType::RxMappable | ListType::TxMappable | ListType::Backup | ListType::Settings => Vec::new(),
        ListType::Other(_) => return Err(AbortCode::VALUE_RANGE),
    };
    Ok(core::iter::once(kind.code()).chain(numbers).flat_map(u16::to_le_bytes).collect())
}

fn object(index: u16, declared: usize) -> Data {
    let object = Object::at(index, declared).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)?;
    let description = ObjectDescription {
        index,
        data_type: object.data_type(),
        max_sub_index: object.max_sub_index(),
        code: object.code(),
        name: object.name().as_bytes(),
    };
    let mut bytes = vec![0; DESCRIPTION_ROOM + object.name().len()];
    let length = description.encode(&mut bytes).ok_or(AbortCode::OUT_OF_MEMORY)?;
    bytes.truncate(length);
    Ok(bytes)
}

fn entry(request: EntryRequest, declared: usize) -> Data {
    let EntryRequest { index, sub_index, value_info } = request;
    let object = Object::at(index, declared).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)?;
    let entry = object.entry(sub_index).ok_or(AbortCode::SUB_INDEX_DOES_NOT_EXIST)?;
    let rights = if entry.writable { AccessRights::READ | AccessRights::WRITE } else { AccessRights::READ };
    let description = EntryDescription {
        index,
        sub_index,
        value_info: ValueInfo(value_info.0 & (ValueInfo::ACCESS | ValueInfo::CATEGORY | ValueInfo::PDO)),
        data_type: entry.data_type,
        bit_length: entry.bits,
        access: AccessRights(rights),
        unit: None,
        default: None,
        minimum: None,
        maximum: None,
        name: entry.name.as_bytes(),
    };
    let mut bytes = vec![0; DESCRIPTION_ROOM + entry.name.len()];
    let length = description.encode(&mut bytes).ok_or(AbortCode::OUT_OF_MEMORY)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// The data in as many messages as needed. Each has an even number of bytes, so that no index is split.
fn fragments(opcode: InformationOpcode, data: &[u8], room: usize) -> Vec<Vec<u8>> {
    let most = (room.saturating_sub(SdoInformation::OVERHEAD) & !1).max(2);
    let count = data.len().div_ceil(most).max(1);
    let message = |number: usize| {
        let piece = &data[number * most..data.len().min((number + 1) * most)];
        let left = count - 1 - number;
        let fragments_left = left as u16;
        let message = SdoInformation { opcode, fragments_left, data: piece, incomplete: left > 0 };
        let mut bytes = vec![0; SdoInformation::OVERHEAD + piece.len()];
        // The buffer has the length of the message.
        let length = message.encode(&mut bytes).unwrap_or(0);
        bytes.truncate(length);
        bytes
    };
    (0..count).map(message).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::mailbox::coe::{DataType, Indices, ObjectCode};

    fn ask(opcode: InformationOpcode, data: &[u8], room: usize) -> Vec<Vec<u8>> {
        let mut bytes = vec![0; SdoInformation::OVERHEAD + data.len()];
        SdoInformation::whole(opcode, data).encode(&mut bytes).unwrap();
        answer(&bytes, room, 40).unwrap()
    }

    // covers: 6.3
    #[test]
    fn the_list_is_complete_in_fragments() {
        let messages = ask(InformationOpcode::ListRequest, &ListType::All.code().to_le_bytes(), 64);
        let mut data = Vec::new();
        for (number, message) in messages.iter().enumerate() {
            assert!(message.len() <= 64);
            let part = SdoInformation::decode(message).unwrap();
            assert_eq!(usize::from(part.fragments_left), messages.len() - 1 - number);
            assert_eq!(part.incomplete, part.fragments_left > 0);
            data.extend_from_slice(part.data);
        }
        assert!(messages.len() > 5);
        assert_eq!(data[..2], [1, 0]);
        assert!(Indices(&data[2..]).iter().eq(Object::indices(40)));
    }

    // covers: 10.2
    #[test]
    fn objects_and_entries_are_described_or_refused() {
        let messages = ask(InformationOpcode::ObjectRequest, &0xA027_u16.to_le_bytes(), 506);
        let part = SdoInformation::decode(&messages[0]).unwrap();
        let described = ObjectDescription::decode(part.data).unwrap();
        assert_eq!(
            (described.max_sub_index, described.code, described.name),
            (19, ObjectCode::Record, &b"Diagnosis data"[..])
        );
        let request = EntryRequest { index: 0xF002, sub_index: 1, value_info: ValueInfo::ALL };
        let messages = ask(InformationOpcode::EntryRequest, &request.encode(), 506);
        let part = SdoInformation::decode(&messages[0]).unwrap();
        let described = EntryDescription::decode(part.data).unwrap();
        assert_eq!(
            (described.data_type, described.bit_length, described.name),
            (DataType::OCTET_STRING, 16, &b"Request"[..])
        );
        assert!(described.access.has(AccessRights::WRITE));
        for (index, sub_index, code) in
            [(0xA028, 1, AbortCode::OBJECT_DOES_NOT_EXIST), (0xA000, 20, AbortCode::SUB_INDEX_DOES_NOT_EXIST)]
        {
            let request = EntryRequest { index, sub_index, value_info: ValueInfo::ALL };
            let messages = ask(InformationOpcode::EntryRequest, &request.encode(), 506);
            let part = SdoInformation::decode(&messages[0]).unwrap();
            assert_eq!((part.opcode, part.data), (InformationOpcode::Error, &code.0.to_le_bytes()[..]));
        }
    }
}
