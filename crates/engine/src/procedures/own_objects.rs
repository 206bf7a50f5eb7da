//! Objects of the MainDevice itself: what a client of the mailbox gateway reads at address 0 (protocol 10.1, 10.2).
//!
//! Inputs are CoE messages of clients, outputs the answers: SDOs and SDO information. Values are current: SubDevices
//! are read when a client requests a value. Nothing of this is on the cyclic path.

mod catalogue;
mod detection;
mod in_its_dictionary;
mod information;
mod messages;
mod rates;
mod seen;
mod shared;
mod upload;
mod values;

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::{CoeHeader, CoeService, ObjectCode};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoError, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{ErrorReply, Header};

use self::catalogue::Object;
use self::detection::Detection;
pub(crate) use self::seen::Seen;
use self::shared::Shared;
use self::upload::{Upload, abort, begin, encode};
use super::services::statistics;
use crate::mail::coe::SdoAddress;
use crate::segment::Observation;
use crate::supervisor::Bus;

/// Bytes of a message to or from address 0, mailbox header included: a long list is sent in segments.
const MAILBOX: usize = 512;
const ROOM: usize = MAILBOX - Header::LEN;
/// Clients that may have an upload in segments under way.
const UPLOADS: usize = 64;

/// All entries of an object in sequence, after their number in 16 bits if it is requested. Texts have their full
/// length, and entries longer than a byte begin at an even offset, so a client can compute the offsets from the
/// descriptions.
fn whole(object: Object, values: &[(u8, Vec<u8>)], count: Option<u8>) -> Vec<u8> {
    let mut bytes: Vec<u8> = count.into_iter().flat_map(|count| [count, 0]).collect();
    for (sub_index, value) in values {
        let length = object.entry(*sub_index).map_or(0, |entry| usize::from(entry.bits.div_ceil(8)));
        if length > 1 && bytes.len() % 2 == 1 {
            bytes.push(0);
        }
        let end = bytes.len() + length;
        bytes.extend_from_slice(value);
        bytes.resize(end, 0);
    }
    bytes
}

/// Answers clients, and stores uploads that need several messages.
#[derive(Clone, Debug, Default)]
pub(crate) struct OwnObjects {
    shared: Rc<Shared>,
}

impl OwnObjects {
    /// A client has disconnected.
    pub(crate) fn forget(&self, client: u64) {
        self.shared.uploads.borrow_mut().remove(&client);
    }

    /// The payloads that answer the payload of a client's CoE message. The error is that of a mailbox error reply.
    pub(crate) async fn answer(&self, seen: &Seen, client: u64, payload: &[u8]) -> Result<Vec<Vec<u8>>, u16> {
        if payload.len() > ROOM {
            return Err(ErrorReply::INVALID_SIZE);
        }
        let head = payload.first_chunk().ok_or(ErrorReply::SIZE_TOO_SHORT)?;
        match CoeHeader::decode(head).service {
            CoeService::SdoInformation => information::answer(payload, ROOM, seen.declared()),
            CoeService::SdoRequest => match SdoRequest::decode(payload) {
                Ok(request) => Ok(self.sdo(seen, client, &request).await.into_iter().collect()),
                Err(SdoError::Short { .. }) => Err(ErrorReply::SIZE_TOO_SHORT),
                Err(SdoError::Command { .. }) => Ok(vec![abort(SdoAddress::new(0, 0), AbortCode::UNKNOWN_COMMAND)]),
                Err(_) => Err(ErrorReply::SERVICE_NOT_SUPPORTED),
            },
            _ => Err(ErrorReply::SERVICE_NOT_SUPPORTED),
        }
    }

    /// The answer to an SDO request; none to an abort. A new transfer ends the previous one.
    async fn sdo(&self, seen: &Seen, client: u64, request: &SdoRequest<'_>) -> Option<Vec<u8>> {
        let upload = self.shared.uploads.borrow_mut().remove(&client);
        let (address, result) = match *request {
            SdoRequest::Abort { .. } => return None,
            SdoRequest::UploadSegment { toggle } => return Some(self.segment(client, upload, toggle)),
            SdoRequest::DownloadSegment { .. } => (SdoAddress::new(0, 0), Err(AbortCode::UNKNOWN_COMMAND)),
            SdoRequest::Upload { index, sub_index, complete_access } => {
                let address = SdoAddress { index, sub_index, complete_access };
                let data = self.read(seen, address).await;
                (address, data.map(|data| self.begin(client, address, data)))
            }
            SdoRequest::DownloadExpedited { index, sub_index, complete_access, data } => {
                let address = SdoAddress { index, sub_index, complete_access };
                (address, self.write(seen, address, data, data.len()).await)
            }
            SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data } => {
                let address = SdoAddress { index, sub_index, complete_access };
                (address, self.write(seen, address, data, total as usize).await)
            }
        };
        Some(result.unwrap_or_else(|code| abort(address, code)))
    }

    fn begin(&self, client: u64, address: SdoAddress, data: Vec<u8>) -> Vec<u8> {
        let (first, upload) = begin(address, data, ROOM);
        self.keep(client, upload);
        first
    }

    fn keep(&self, client: u64, upload: Option<Upload>) {
        let Some(upload) = upload else { return };
        let mut uploads = self.shared.uploads.borrow_mut();
        if uploads.len() >= UPLOADS {
            // The oldest upload is probably abandoned; its client can repeat the request.
            uploads.pop_first();
        }
        uploads.insert(client, upload);
    }

    fn segment(&self, client: u64, upload: Option<Upload>, toggle: bool) -> Vec<u8> {
        let Some(mut upload) = upload else { return abort(SdoAddress::new(0, 0), AbortCode::UNKNOWN_COMMAND) };
        match upload.segment(toggle, ROOM) {
            Ok((answer, last)) => {
                self.keep(client, (!last).then_some(upload));
                answer
            }
            Err(code) => abort(upload.address(), code),
        }
    }

    async fn read(&self, seen: &Seen, address: SdoAddress) -> Result<Vec<u8>, AbortCode> {
        let SdoAddress { index, sub_index, complete_access } = address;
        let object = Object::at(index, seen.declared()).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)?;
        if complete_access && !object.has_complete_access() {
            return Err(AbortCode::COMPLETE_ACCESS_NOT_SUPPORTED);
        }
        if object.entry(sub_index).is_none() || (complete_access && sub_index > 1) {
            return Err(AbortCode::SUB_INDEX_DOES_NOT_EXIST);
        }
        let values = values::read(seen, &self.shared, object, (!complete_access).then_some(sub_index)).await;
        // An array has as many entries as there are values.
        let count = match object.code() {
            ObjectCode::Array => values.last().map_or(0, |(last, _)| *last),
            _ => object.max_sub_index(),
        };
        if complete_access {
            return Ok(whole(object, &values, (sub_index == 0).then_some(count)));
        }
        if sub_index == 0 && object.code() != ObjectCode::Variable {
            return Ok(vec![count]);
        }
        let value = values.into_iter().find(|(number, _)| *number == sub_index);
        value.map(|(_, value)| value).ok_or(AbortCode::SUB_INDEX_DOES_NOT_EXIST)
    }

    async fn write(&self, seen: &Seen, address: SdoAddress, data: &[u8], total: usize) -> Result<Vec<u8>, AbortCode> {
        let SdoAddress { index, sub_index, complete_access } = address;
        let object = Object::at(index, seen.declared()).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)?;
        let entry = object.entry(sub_index).ok_or(AbortCode::SUB_INDEX_DOES_NOT_EXIST)?;
        if complete_access {
            return Err(AbortCode::COMPLETE_ACCESS_NOT_SUPPORTED);
        }
        if !entry.writable {
            return Err(AbortCode::READ_ONLY);
        }
        let expected = usize::from(entry.bits.div_ceil(8));
        match total.cmp(&expected) {
            core::cmp::Ordering::Less => return Err(AbortCode::LENGTH_TOO_SHORT),
            core::cmp::Ordering::Greater => return Err(AbortCode::LENGTH_TOO_LONG),
            core::cmp::Ordering::Equal => {}
        }
        match object {
            Object::DiagnosisHistory => messages::write(&seen.bus, sub_index, data)?,
            Object::DetectModules => Detection::start(&self.shared.detection, seen)?,
            Object::DiagnosisControl if data.first().is_some_and(|reset| *reset != 0) => self.reset(seen).await,
            _ => {}
        }
        Ok(encode(&SdoResponse::DownloadDone { index, sub_index }))
    }

    /// Clears the counters of 0xAnnn and 0xF120.
    async fn reset(&self, seen: &Seen) {
        self.shared.forgotten.set(rates::lost(seen));
        let Some(segment) = &seen.segment else { return };
        segment.observe(Observation::IncidentsForgotten);
        segment.mailboxes().iter().for_each(|mailbox| mailbox.forget_protocol_error(0));
        let stations: Vec<_> = segment.view().members().map(|member| member.station).enumerate().collect();
        let wrong = stations.iter().map(|(subdevice, _)| segment.board.wkc_errors(*subdevice));
        *self.shared.forgotten_wkc.borrow_mut() = wrong.collect();
        let statistics = segment.statistics.clone();
        let clear = move |bus: Bus, (subdevice, station)| {
            let statistics = statistics.clone();
            async move {
                // An absent SubDevice has no counters to clear.
                let _ = statistics::clear(&bus, &statistics, subdevice, station).await;
            }
        };
        seen.bus.gather_in_turns(stations, clear).await;
    }
}
