//! The AoE server of a device: a memory, the dictionary by ADS, states (protocol 6.7).
//!
//! Input: the payload of an AoE message, the dictionary. Output: the answer. Index group [`MEMORY`] is a memory of
//! [`MEMORY_BYTES`] bytes, group 0xF302 the object dictionary. The header of the answer reports a missing port.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::aoe::{AdsErrorCode, AdsRequest, AdsResponse, AmsHeader, index_group};
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::mailbox::{ErrorReply, PayloadError};

use super::answer::Answer;
use super::dictionary::Dictionary;
use crate::description::AoeDescription;

/// Index group of the memory.
pub const MEMORY: u32 = 0x4020;
/// Bytes of the memory.
pub const MEMORY_BYTES: usize = 4096;

/// ADS states: after start-up, running, stopped.
const ADS_RUN: u16 = 5;
const ADS_STOP: u16 = 6;
const COMPLETE_ACCESS: u32 = 1 << 8;

/// The server with its state between messages.
#[derive(Clone, Debug)]
pub struct AoeServer {
    ports: Vec<u16>,
    name: [u8; 16],
    memory: Vec<u8>,
    ads_state: u16,
}

impl AoeServer {
    /// The server of a device when its mailbox is opened.
    pub fn new(description: &AoeDescription, device_name: &str) -> AoeServer {
        let mut name = [0; 16];
        for (place, byte) in name[..15].iter_mut().zip(device_name.bytes()) {
            *place = byte;
        }
        AoeServer { ports: description.ports.clone(), name, memory: vec![0; MEMORY_BYTES], ads_state: ADS_RUN }
    }

    /// Serves one message. `room` is the largest length of the answer after the mailbox header.
    pub fn serve(&mut self, payload: &[u8], room: usize, state: AlState, dictionary: &mut Dictionary) -> Answer {
        let (header, data) = match AmsHeader::decode(payload) {
            Ok(message) => message,
            Err(_) => return Answer::Error(ErrorReply::SIZE_TOO_SHORT),
        };
        if header.is_response() {
            return Answer::Silence;
        }
        if !self.ports.contains(&header.target.port) {
            return refused(&header, AdsErrorCode::TARGET_PORT_NOT_FOUND);
        }
        let request = match AdsRequest::decode(header.command, data) {
            Ok(request) => request,
            Err(PayloadError::Short { .. }) => return refused(&header, AdsErrorCode::INVALID_SIZE),
            Err(PayloadError::Code { .. } | PayloadError::Service { .. }) => {
                return refused(&header, AdsErrorCode::UNKNOWN_COMMAND);
            }
        };
        let most = room.saturating_sub(AmsHeader::LEN + 8);
        let done = |result: Result<(), AdsErrorCode>| AdsResponse::Done { result: code(result) };
        let bytes;
        let response = match request {
            AdsRequest::ReadDeviceInfo => AdsResponse::DeviceInfo {
                result: AdsErrorCode::NO_ERROR,
                major: 1,
                minor: 0,
                build: 1,
                name: self.name,
            },
            AdsRequest::ReadState => AdsResponse::State {
                result: AdsErrorCode::NO_ERROR,
                ads_state: self.ads_state,
                device_state: u16::from(state.code()),
            },
            AdsRequest::WriteControl { ads_state, .. } => done(self.control(ads_state)),
            AdsRequest::Write { group, offset, data } => done(self.write(group, offset, data, state, dictionary)),
            AdsRequest::Read { group, offset, length } => {
                bytes = self.read(group, offset, length, most, dictionary);
                read_response(&bytes)
            }
            AdsRequest::ReadWrite { group, offset, read_length, data } => {
                bytes = self
                    .write(group, offset, data, state, dictionary)
                    .and_then(|()| self.read(group, offset, read_length, most, dictionary));
                read_response(&bytes)
            }
        };
        let mut out = vec![0; AmsHeader::LEN + 32 + most];
        match response.encode(&mut out[AmsHeader::LEN..]) {
            Some(length) => {
                out[..AmsHeader::LEN].copy_from_slice(&header.response(length as u32).encode());
                out.truncate(AmsHeader::LEN + length);
                Answer::payload(out)
            }
            None => Answer::Error(ErrorReply::NO_MORE_MEMORY),
        }
    }

    fn control(&mut self, ads_state: u16) -> Result<(), AdsErrorCode> {
        if !matches!(ads_state, ADS_RUN | ADS_STOP) {
            return Err(AdsErrorCode::INVALID_PARAMETER);
        }
        self.ads_state = ads_state;
        Ok(())
    }

    fn read(
        &self,
        group: u32,
        offset: u32,
        length: u32,
        most: usize,
        dictionary: &Dictionary,
    ) -> Result<Vec<u8>, AdsErrorCode> {
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        match group {
            MEMORY => {
                let place = place(offset, length.min(most))?;
                if length > most { Err(AdsErrorCode::INVALID_SIZE) } else { Ok(self.memory[place].to_vec()) }
            }
            index_group::SDO => {
                let (index, sub_index, complete) = object(offset);
                let value = if complete {
                    dictionary.read_complete(index, sub_index)
                } else {
                    dictionary.read(index, sub_index).map(<[u8]>::to_vec)
                };
                let value = value.map_err(ads_error)?;
                if value.len() > length.min(most) { Err(AdsErrorCode::INVALID_SIZE) } else { Ok(value) }
            }
            _ => Err(AdsErrorCode::INVALID_INDEX_GROUP),
        }
    }

    fn write(
        &mut self,
        group: u32,
        offset: u32,
        data: &[u8],
        state: AlState,
        dictionary: &mut Dictionary,
    ) -> Result<(), AdsErrorCode> {
        match group {
            MEMORY => {
                let place = place(offset, data.len())?;
                self.memory[place].copy_from_slice(data);
                Ok(())
            }
            index_group::SDO => {
                let (index, sub_index, complete) = object(offset);
                let result = if complete {
                    dictionary.write_complete(index, sub_index, data, state)
                } else {
                    dictionary.write(index, sub_index, data, state)
                };
                result.map_err(ads_error)
            }
            _ => Err(AdsErrorCode::INVALID_INDEX_GROUP),
        }
    }
}

fn place(offset: u32, length: usize) -> Result<core::ops::Range<usize>, AdsErrorCode> {
    let start = usize::try_from(offset).unwrap_or(usize::MAX);
    let end = start.checked_add(length).filter(|end| *end <= MEMORY_BYTES).ok_or(AdsErrorCode::INVALID_INDEX_OFFSET)?;
    Ok(start..end)
}

/// Index, subindex, complete access.
const fn object(offset: u32) -> (u16, u8, bool) {
    ((offset >> 16) as u16, offset as u8, offset & COMPLETE_ACCESS != 0)
}

fn ads_error(code: AbortCode) -> AdsErrorCode {
    match code {
        AbortCode::OBJECT_DOES_NOT_EXIST | AbortCode::SUB_INDEX_DOES_NOT_EXIST => AdsErrorCode::INVALID_INDEX_OFFSET,
        AbortCode::READ_ONLY | AbortCode::WRITE_ONLY | AbortCode::CANNOT_BE_STORED_DEVICE_STATE => {
            AdsErrorCode::ACCESS_DENIED
        }
        AbortCode::LENGTH_TOO_LONG | AbortCode::LENGTH_TOO_SHORT => AdsErrorCode::INVALID_SIZE,
        AbortCode::VALUE_TOO_HIGH | AbortCode::VALUE_TOO_LOW | AbortCode::VALUE_RANGE => AdsErrorCode::INVALID_DATA,
        _ => AdsErrorCode::GENERAL,
    }
}

fn code(result: Result<(), AdsErrorCode>) -> AdsErrorCode {
    result.err().unwrap_or(AdsErrorCode::NO_ERROR)
}

fn read_response(bytes: &Result<Vec<u8>, AdsErrorCode>) -> AdsResponse<'_> {
    match bytes {
        Ok(data) => AdsResponse::Data { result: AdsErrorCode::NO_ERROR, data },
        Err(code) => AdsResponse::Data { result: *code, data: &[] },
    }
}

/// An answer with only an error in its header.
fn refused(header: &AmsHeader, error: AdsErrorCode) -> Answer {
    Answer::payload(AmsHeader { error, ..header.response(0) }.encode().to_vec())
}
