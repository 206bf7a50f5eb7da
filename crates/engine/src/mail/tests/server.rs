//! An application that supports CoE, FoE, SoE, AoE and VoE, for a [`Device`](super::device::Device).

use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::mailbox::aoe::{AdsErrorCode, AdsRequest, AdsResponse, AmsHeader};
use ringcat_wire::mailbox::coe::{
    AccessRights, CoeHeader, CoeService, DataType, EntryDescription, EntryRequest, InformationOpcode, ObjectCode,
    ObjectDescription, SdoInformation,
};
use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::soe::{SoeErrorCode, SoeMessage, SoeOperation};
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::device::Server;

/// Objects, files and IDNs, kept in memory.
#[derive(Default)]
pub struct AllProtocols {
    /// Largest payload in bytes.
    capacity: usize,
    pub objects: BTreeMap<(u16, u8), Vec<u8>>,
    pub idns: BTreeMap<(u8, u16), Vec<u8>>,
    pub files: BTreeMap<Vec<u8>, Vec<u8>>,
    pub memory: BTreeMap<(u32, u32), Vec<u8>>,
    /// Aborts received.
    pub aborts: Vec<AbortCode>,
    pub foe_errors: Vec<(u32, String)>,
    /// The next messages of FoE are answered with BUSY.
    pub busy: u32,
    /// Whole objects are read with complete access; without, it is ignored.
    pub complete_access: bool,
    /// Objects and entries that were read.
    pub uploads: u32,
    /// The toggle bit of the next segment is wrong.
    pub wrong_toggle: bool,
    sdo: Option<Sdo>,
    reading: Option<(Vec<u8>, u32)>,
    writing: Option<(Vec<u8>, Vec<u8>, u32)>,
    idn: Vec<u8>,
}

struct Sdo {
    key: (u16, u8),
    data: Vec<u8>,
    at: usize,
    total: usize,
    toggle: bool,
}

impl Server for AllProtocols {
    fn serve(&mut self, protocol: Protocol, payload: &[u8]) -> Vec<(Protocol, Vec<u8>)> {
        match protocol {
            Protocol::Coe => {
                let service = payload.first_chunk().map(|header| CoeHeader::decode(header).service);
                match service {
                    Some(CoeService::SdoRequest) => self.sdo(payload),
                    Some(CoeService::SdoInformation) => self.information(payload),
                    // A vendor-specific service.
                    Some(CoeService::Other(9)) => vec![(Protocol::Coe, payload.to_vec())],
                    _ => Vec::new(),
                }
            }
            Protocol::Foe => self.foe(payload),
            Protocol::Soe => self.soe(payload),
            Protocol::Aoe => self.aoe(payload),
            Protocol::Voe => vec![(Protocol::Voe, payload.to_vec())],
            // A vendor-specific protocol: no answer for a first byte of 0.
            Protocol::Other(9) if payload.first() == Some(&0) => Vec::new(),
            Protocol::Other(9) => vec![(Protocol::Other(9), payload.to_vec())],
            _ => vec![(Protocol::Error, ErrorReply::new(ErrorReply::UNSUPPORTED_PROTOCOL).encode().to_vec())],
        }
    }
}

impl AllProtocols {
    pub fn new(capacity: usize) -> AllProtocols {
        AllProtocols { capacity, ..AllProtocols::default() }
    }

    fn upload(&mut self, index: u16, sub_index: u8, complete_access: bool) -> Vec<(Protocol, Vec<u8>)> {
        let mut out = vec![0; self.capacity];
        self.uploads += 1;
        let Some(mut data) = self.objects.get(&(index, sub_index)).cloned() else {
            return abort(index, sub_index, AbortCode::OBJECT_DOES_NOT_EXIST);
        };
        if complete_access && self.complete_access {
            data.push(0);
            data.extend(self.objects.range((index, 1)..=(index, 255)).flat_map(|(_, entry)| entry));
        }
        if (1..=4).contains(&data.len()) {
            let response = SdoResponse::UploadExpedited { index, sub_index, complete_access, data: &data };
            return encoded(&response, &mut out);
        }
        let total = data.len();
        let at = total.min(self.capacity - 10);
        let first = data[..at].to_vec();
        self.sdo = Some(Sdo { key: (index, sub_index), data, at, total, toggle: false });
        let total = total as u32;
        let response = SdoResponse::UploadNormal { index, sub_index, complete_access, total, data: &first };
        encoded(&response, &mut out)
    }

    fn sdo(&mut self, payload: &[u8]) -> Vec<(Protocol, Vec<u8>)> {
        let Ok(request) = SdoRequest::decode(payload) else { return Vec::new() };
        let mut out = vec![0; self.capacity];
        let response = match request {
            SdoRequest::DownloadExpedited { index, sub_index, data, .. } => {
                self.objects.insert((index, sub_index), data.to_vec());
                SdoResponse::DownloadDone { index, sub_index }
            }
            SdoRequest::DownloadNormal { index, sub_index, total, data, .. } => {
                let (key, total) = ((index, sub_index), total as usize);
                if data.len() >= total {
                    self.objects.insert(key, data.to_vec());
                } else {
                    self.sdo = Some(Sdo { key, data: data.to_vec(), at: 0, total, toggle: false });
                }
                SdoResponse::DownloadDone { index, sub_index }
            }
            SdoRequest::Upload { index, sub_index, complete_access } => {
                return self.upload(index, sub_index, complete_access);
            }
            SdoRequest::DownloadSegment { toggle, last, data } => {
                let Some(sdo) = self.sdo.as_mut().filter(|sdo| sdo.toggle == toggle) else {
                    return abort(0, 0, AbortCode::TOGGLE_NOT_ALTERNATED);
                };
                sdo.data.extend_from_slice(data);
                sdo.toggle = !sdo.toggle;
                if last {
                    assert_eq!(sdo.data.len(), sdo.total);
                    let Some(sdo) = self.sdo.take() else { return Vec::new() };
                    self.objects.insert(sdo.key, sdo.data);
                }
                SdoResponse::DownloadSegmentDone { toggle }
            }
            SdoRequest::UploadSegment { toggle } => {
                let Some(sdo) = self.sdo.as_mut().filter(|sdo| sdo.toggle == toggle) else {
                    return abort(0, 0, AbortCode::TOGGLE_NOT_ALTERNATED);
                };
                let end = sdo.total.min(sdo.at + self.capacity - 3);
                let data = sdo.data[sdo.at..end].to_vec();
                (sdo.at, sdo.toggle) = (end, !sdo.toggle);
                let toggle = toggle ^ core::mem::take(&mut self.wrong_toggle);
                return encoded(&SdoResponse::UploadSegment { toggle, last: end == sdo.total, data: &data }, &mut out);
            }
            SdoRequest::Abort { code, .. } => {
                self.aborts.push(code);
                self.sdo = None;
                return Vec::new();
            }
        };
        encoded(&response, &mut out)
    }

    fn information(&mut self, payload: &[u8]) -> Vec<(Protocol, Vec<u8>)> {
        let Ok(request) = SdoInformation::decode(payload) else { return Vec::new() };
        let mut out = vec![0; 256];
        let (opcode, data) = match request.opcode {
            InformationOpcode::ListRequest => {
                let mut indices: Vec<u16> = self.objects.keys().map(|(index, _)| *index).collect();
                indices.dedup();
                let mut data = request.data[..2].to_vec();
                data.extend(indices.iter().flat_map(|index| index.to_le_bytes()));
                (InformationOpcode::ListResponse, data)
            }
            InformationOpcode::ObjectRequest => {
                let index = request.object().unwrap();
                let Some((_, sub_index)) = self.objects.keys().rfind(|(i, _)| *i == index) else {
                    let code = AbortCode::OBJECT_DOES_NOT_EXIST.0.to_le_bytes().to_vec();
                    return fragments(InformationOpcode::Error, &code, self.capacity);
                };
                let (max_sub_index, code) = (*sub_index, ObjectCode::Variable);
                let description =
                    ObjectDescription { index, data_type: DataType(7), max_sub_index, code, name: b"An object" };
                let length = description.encode(&mut out).unwrap();
                (InformationOpcode::ObjectResponse, out[..length].to_vec())
            }
            InformationOpcode::EntryRequest => {
                let requested = EntryRequest::decode(request.data).unwrap();
                let length = self.objects[&(requested.index, requested.sub_index)].len();
                let description = EntryDescription {
                    index: requested.index,
                    sub_index: requested.sub_index,
                    value_info: requested.value_info,
                    data_type: DataType(7),
                    bit_length: 8 * length as u16,
                    access: AccessRights(AccessRights::READ),
                    unit: None,
                    default: None,
                    minimum: None,
                    maximum: None,
                    name: b"An entry with a name that is longer than some mailboxes are",
                };
                let length = description.encode(&mut out).unwrap();
                (InformationOpcode::EntryResponse, out[..length].to_vec())
            }
            _ => return Vec::new(),
        };
        fragments(opcode, &data, self.capacity)
    }

    fn foe(&mut self, payload: &[u8]) -> Vec<(Protocol, Vec<u8>)> {
        let full = self.capacity - FoeMessage::OVERHEAD;
        let message = FoeMessage::decode(payload).unwrap();
        let mut out = vec![0; self.capacity];
        let needs_answer = !matches!(message, FoeMessage::Error { .. });
        if self.busy > 0 && needs_answer {
            self.busy -= 1;
            let done = 100 - self.busy.min(100) as u16;
            let length = FoeMessage::Busy { done, entire: 100, text: b"thinking" }.encode(&mut out).unwrap();
            return vec![(Protocol::Foe, out[..length].to_vec())];
        }
        let answer = match message {
            FoeMessage::Read { password: 0, name } => match self.files.get(name) {
                Some(file) => {
                    self.reading = Some((file.clone(), 1));
                    Ok(())
                }
                None => Err((FoeErrorCode::NOT_FOUND, "no such file")),
            },
            FoeMessage::Write { password: 0, name } => {
                self.writing = Some((name.to_vec(), Vec::new(), 0));
                Ok(())
            }
            FoeMessage::Read { .. } | FoeMessage::Write { .. } => Err((FoeErrorCode::NO_RIGHTS, "password")),
            FoeMessage::Acknowledge { packet } => match &mut self.reading {
                Some((file, next)) if *next == packet => {
                    let sent = full * packet as usize;
                    if sent > file.len() {
                        self.reading = None;
                        return Vec::new();
                    }
                    *next += 1;
                    Ok(())
                }
                _ => Err((FoeErrorCode::PACKET_NUMBER_WRONG, "acknowledge")),
            },
            FoeMessage::Data { packet, data } => match &mut self.writing {
                Some((name, file, last)) if *last + 1 == packet => {
                    file.extend_from_slice(data);
                    *last = packet;
                    if data.len() < full {
                        let (name, file) = (core::mem::take(name), core::mem::take(file));
                        self.files.insert(name, file);
                    }
                    Ok(())
                }
                _ => Err((FoeErrorCode::PACKET_NUMBER_WRONG, "data")),
            },
            FoeMessage::Error { code, text } => {
                self.foe_errors.push((code.0, String::from_utf8_lossy(text).into_owned()));
                (self.reading, self.writing) = (None, None);
                return Vec::new();
            }
            FoeMessage::Busy { .. } => return Vec::new(),
        };
        let packets = matches!(message, FoeMessage::Read { .. } | FoeMessage::Acknowledge { .. });
        self.foe_reply(answer, packets)
    }

    /// The next packet, an acknowledgement or an error.
    fn foe_reply(&self, answer: Result<(), (FoeErrorCode, &str)>, packets: bool) -> Vec<(Protocol, Vec<u8>)> {
        let full = self.capacity - FoeMessage::OVERHEAD;
        let mut out = vec![0; self.capacity];
        let reply = match (answer, &self.reading, &self.writing) {
            (Err((code, text)), _, _) => FoeMessage::Error { code, text: text.as_bytes() },
            (Ok(()), Some((file, next)), _) if packets => {
                let start = full * (*next as usize - 1);
                FoeMessage::Data { packet: *next, data: &file[start..file.len().min(start + full)] }
            }
            (Ok(()), _, Some((_, _, packet))) => FoeMessage::Acknowledge { packet: *packet },
            (Ok(()), _, None) => return Vec::new(),
        };
        let length = reply.encode(&mut out).unwrap();
        vec![(Protocol::Foe, out[..length].to_vec())]
    }

    fn soe(&mut self, payload: &[u8]) -> Vec<(Protocol, Vec<u8>)> {
        let message = SoeMessage::decode(payload).unwrap();
        let mut out = vec![0; self.capacity];
        let full = self.capacity - SoeMessage::OVERHEAD;
        match message.operation {
            SoeOperation::ReadRequest => {
                let base = SoeMessage { operation: SoeOperation::ReadResponse, data: &[], ..message };
                let Some(data) = self.idns.get(&(message.drive, message.number)) else {
                    let code = SoeErrorCode::NO_IDN.0.to_le_bytes();
                    let length = SoeMessage { error: true, data: &code, ..base }.encode(&mut out).unwrap();
                    return vec![(Protocol::Soe, out[..length].to_vec())];
                };
                let pieces: Vec<&[u8]> = if data.is_empty() { vec![&[]] } else { data.chunks(full).collect() };
                let count = pieces.len();
                let fragment = |(at, data): (usize, &&[u8])| {
                    let left = (count - 1 - at) as u16;
                    let number = if left > 0 { left } else { message.number };
                    let length = SoeMessage { incomplete: left > 0, number, data, ..base }.encode(&mut out).unwrap();
                    (Protocol::Soe, out[..length].to_vec())
                };
                pieces.iter().enumerate().map(fragment).collect()
            }
            SoeOperation::WriteRequest => {
                self.idn.extend_from_slice(message.data);
                if message.incomplete {
                    return Vec::new();
                }
                self.idns.insert((message.drive, message.number), core::mem::take(&mut self.idn));
                let reply = SoeMessage { operation: SoeOperation::WriteResponse, data: &[], ..message };
                let length = reply.encode(&mut out).unwrap();
                vec![(Protocol::Soe, out[..length].to_vec())]
            }
            _ => Vec::new(),
        }
    }

    fn aoe(&mut self, payload: &[u8]) -> Vec<(Protocol, Vec<u8>)> {
        let (header, data) = AmsHeader::decode(payload).unwrap();
        let mut out = vec![0; self.capacity];
        let result = AdsErrorCode::NO_ERROR;
        let response = match AdsRequest::decode(header.command, data).unwrap() {
            AdsRequest::Write { group, offset, data } => {
                self.memory.insert((group, offset), data.to_vec());
                AdsResponse::Done { result }
            }
            AdsRequest::Read { group, offset, .. } => match self.memory.get(&(group, offset)) {
                Some(data) => AdsResponse::Data { result, data },
                None => AdsResponse::Data { result: AdsErrorCode(0x703), data: &[] },
            },
            AdsRequest::ReadWrite { data, .. } => AdsResponse::Data { result, data },
            AdsRequest::ReadState => AdsResponse::State { result, ads_state: 5, device_state: 8 },
            AdsRequest::WriteControl { .. } => AdsResponse::Done { result },
            AdsRequest::ReadDeviceInfo => {
                AdsResponse::DeviceInfo { result, major: 3, minor: 1, build: 77, name: *b"device\0\0\0\0\0\0\0\0\0\0" }
            }
        };
        let length = response.encode(&mut out[AmsHeader::LEN..]).unwrap();
        out[..AmsHeader::LEN].copy_from_slice(&header.response(length as u32).encode());
        vec![(Protocol::Aoe, out[..AmsHeader::LEN + length].to_vec())]
    }
}

fn encoded(response: &SdoResponse<'_>, out: &mut [u8]) -> Vec<(Protocol, Vec<u8>)> {
    let length = response.encode(out).unwrap();
    vec![(Protocol::Coe, out[..length].to_vec())]
}

fn abort(index: u16, sub_index: u8, code: AbortCode) -> Vec<(Protocol, Vec<u8>)> {
    encoded(&SdoResponse::Abort { index, sub_index, code }, &mut [0; 10])
}

/// SDO information in as many fragments as needed.
fn fragments(opcode: InformationOpcode, data: &[u8], capacity: usize) -> Vec<(Protocol, Vec<u8>)> {
    let pieces: Vec<&[u8]> = data.chunks(capacity - SdoInformation::OVERHEAD).collect();
    let count = pieces.len();
    let fragment = |(at, data): (usize, &&[u8])| {
        let left = (count - 1 - at) as u16;
        let mut out = vec![0; capacity];
        let message = SdoInformation { opcode, fragments_left: left, data, incomplete: left > 0 };
        let length = message.encode(&mut out).unwrap();
        (Protocol::Coe, out[..length].to_vec())
    };
    pieces.iter().enumerate().map(fragment).collect()
}
