//! The expected answers to a client's message (none, one or several), and whether a transfer is in progress afterwards.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::mailbox::aoe::AmsHeader;
use ringcat_wire::mailbox::coe::{CoeHeader, CoeService, InformationOpcode, SdoInformation};
use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};
use ringcat_wire::mailbox::sdo::{AbortCode, INITIATE_LEN, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::soe::{Idn, SoeMessage, SoeOperation};
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use crate::mail::lane::Lane;

/// EoE types that are requests: set IP, set filter, get IP, get filter. The types of their answers follow them.
const EOE_REQUESTS: [u8; 4] = [2, 4, 6, 8];
const EOE_TYPE: u8 = 0x0F;
/// Bytes of the vendor before a vendor message.
const VENDOR_LEN: usize = 4;
/// Longest message that ends a transfer, in bytes.
const END_LEN: usize = 64;

/// The answer that a client's message expects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ExpectedAnswer {
    /// An answer that [`AnswerFilter`] recognises.
    Matching(AnswerFilter),
    /// No answer.
    None,
}

/// Recognises an answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum AnswerFilter {
    /// Beginning of an SDO transfer, with index and subindex.
    Initiate(u16, u8),
    /// Part of an SDO transfer.
    Segment,
    /// SDO information: the answer, and its first bytes.
    Information(InformationOpcode, Vec<u8>),
    /// A packet of a file, or its acknowledgement.
    File {
        /// Number of the expected packet.
        data: Option<u32>,
        /// Number to be acknowledged.
        acknowledge: Option<u32>,
    },
    /// SoE of an IDN of a drive.
    Soe(SoeOperation, u8, Idn),
    /// AoE, with the invoke id.
    Aoe(u32),
    /// A message of the same vendor.
    Voe([u8; VENDOR_LEN]),
    /// EoE of this type.
    Eoe(u8),
    /// Any message of the same mailbox type, which the lane checks.
    SameType,
}

/// A transfer of a client.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum Transfer {
    #[default]
    None,
    /// An object: index and subindex.
    Object(u16, u8),
    /// A file.
    File,
    /// The last packet of a file was read; its acknowledgement ends the transfer.
    FileRead,
    /// Fragments of an SoE request.
    Fragments,
}

/// State of a client's transfer in one lane.
#[derive(Debug, Default)]
pub(super) struct Dialogue {
    transfer: Transfer,
    /// The transfer that is in progress if the answer is a success.
    pending: Transfer,
}

/// The lane for messages of a protocol, or the error reply for the client.
pub(super) fn lane(protocol: Protocol, payload: &[u8]) -> Result<Lane, u16> {
    match protocol {
        Protocol::Aoe => Ok(Lane::Aoe),
        Protocol::Coe => Ok(Lane::Coe),
        Protocol::Foe => Ok(Lane::Foe),
        Protocol::Soe => Ok(Lane::Soe),
        Protocol::Voe => Ok(Lane::Voe),
        // Ethernet frames pass through the network interface of the host, not the gateway.
        Protocol::Eoe if payload.first().is_some_and(|first| EOE_REQUESTS.contains(&(first & EOE_TYPE))) => {
            Ok(Lane::Eoe)
        }
        Protocol::Eoe => Err(ErrorReply::SERVICE_NOT_SUPPORTED),
        // The SubDevice decides whether it supports a type unknown to RingCAT.
        Protocol::Other(code) => Ok(Lane::Other(code)),
        // Error replies are never answered: two ends could answer each other endlessly.
        Protocol::Error => Err(ErrorReply::UNSUPPORTED_PROTOCOL),
    }
}

impl Dialogue {
    /// A transfer is in progress.
    pub(super) fn is_open(&self) -> bool {
        self.transfer != Transfer::None
    }

    /// Takes a message that is about to be written into a receive mailbox of this size. The error is the detail of an
    /// error reply: the service is not relayed.
    pub(super) fn request(&mut self, lane: Lane, payload: &[u8], mailbox_size: usize) -> Result<ExpectedAnswer, u16> {
        self.pending = self.transfer.clone();
        match lane {
            Lane::Coe => self.request_coe(payload),
            Lane::Foe => self.request_foe(payload, mailbox_size),
            Lane::Soe => self.request_soe(payload),
            Lane::Aoe => {
                let (header, _) = AmsHeader::decode(payload).map_err(|_| ErrorReply::SIZE_TOO_SHORT)?;
                // Bit 0 marks a response.
                let request = header.flags & AmsHeader::REQUEST != 0 && header.flags & 0x0001 == 0;
                Ok(if request {
                    ExpectedAnswer::Matching(AnswerFilter::Aoe(header.invoke_id))
                } else {
                    ExpectedAnswer::None
                })
            }
            Lane::Voe => {
                let vendor = payload.first_chunk().ok_or(ErrorReply::SIZE_TOO_SHORT)?;
                Ok(ExpectedAnswer::Matching(AnswerFilter::Voe(*vendor)))
            }
            Lane::Other(_) => Ok(ExpectedAnswer::Matching(AnswerFilter::SameType)),
            Lane::Eoe | Lane::Frames => {
                let kind = payload.first().ok_or(ErrorReply::SIZE_TOO_SHORT)? & EOE_TYPE;
                Ok(ExpectedAnswer::Matching(AnswerFilter::Eoe(kind + 1)))
            }
        }
    }

    fn request_coe(&mut self, payload: &[u8]) -> Result<ExpectedAnswer, u16> {
        let bytes = payload.first_chunk().ok_or(ErrorReply::SIZE_TOO_SHORT)?;
        match CoeHeader::decode(bytes).service {
            CoeService::SdoInformation => return request_information(payload),
            CoeService::SdoRequest => {}
            _ => return Err(ErrorReply::SERVICE_NOT_SUPPORTED),
        }
        let request = SdoRequest::decode(payload).map_err(|_| ErrorReply::SIZE_TOO_SHORT)?;
        Ok(match request {
            SdoRequest::Upload { index, sub_index, .. } => self.initiate(index, sub_index, true),
            SdoRequest::DownloadExpedited { index, sub_index, .. } => self.initiate(index, sub_index, false),
            SdoRequest::DownloadNormal { index, sub_index, total, data, .. } => {
                self.initiate(index, sub_index, (data.len() as u64) < u64::from(total))
            }
            SdoRequest::DownloadSegment { last, .. } => {
                if last {
                    self.pending = Transfer::None;
                }
                ExpectedAnswer::Matching(AnswerFilter::Segment)
            }
            SdoRequest::UploadSegment { .. } => ExpectedAnswer::Matching(AnswerFilter::Segment),
            SdoRequest::Abort { .. } => {
                self.transfer = Transfer::None;
                ExpectedAnswer::None
            }
        })
    }

    fn initiate(&mut self, index: u16, sub_index: u8, may_go_on: bool) -> ExpectedAnswer {
        self.transfer = Transfer::None;
        self.pending = if may_go_on { Transfer::Object(index, sub_index) } else { Transfer::None };
        ExpectedAnswer::Matching(AnswerFilter::Initiate(index, sub_index))
    }

    fn request_foe(&mut self, payload: &[u8], mailbox_size: usize) -> Result<ExpectedAnswer, u16> {
        let message = FoeMessage::decode(payload).map_err(|_| ErrorReply::SIZE_TOO_SHORT)?;
        let answer = |data, acknowledge| ExpectedAnswer::Matching(AnswerFilter::File { data, acknowledge });
        Ok(match message {
            FoeMessage::Read { .. } => {
                self.pending = Transfer::File;
                answer(Some(1), None)
            }
            FoeMessage::Write { .. } => {
                self.pending = Transfer::File;
                answer(None, Some(0))
            }
            FoeMessage::Data { packet, data } => {
                let last = data.len() < FoeMessage::max_data(mailbox_size);
                self.pending = if last { Transfer::None } else { Transfer::File };
                answer(None, Some(packet))
            }
            FoeMessage::Acknowledge { .. } if self.transfer == Transfer::FileRead => {
                self.transfer = Transfer::None;
                ExpectedAnswer::None
            }
            FoeMessage::Acknowledge { packet } => answer(Some(packet.wrapping_add(1)), None),
            // The SubDevice repeats the packet for a busy client.
            FoeMessage::Busy { .. } => answer(None, None),
            FoeMessage::Error { .. } => {
                self.transfer = Transfer::None;
                ExpectedAnswer::None
            }
        })
    }

    fn request_soe(&mut self, payload: &[u8]) -> Result<ExpectedAnswer, u16> {
        let message = SoeMessage::decode(payload).map_err(|_| ErrorReply::SIZE_TOO_SHORT)?;
        let idn = Idn(message.number);
        self.pending = Transfer::None;
        Ok(match message.operation {
            SoeOperation::WriteRequest if message.incomplete => {
                self.transfer = Transfer::Fragments;
                ExpectedAnswer::None
            }
            SoeOperation::ReadRequest => {
                ExpectedAnswer::Matching(AnswerFilter::Soe(SoeOperation::ReadResponse, message.drive, idn))
            }
            SoeOperation::WriteRequest => {
                ExpectedAnswer::Matching(AnswerFilter::Soe(SoeOperation::WriteResponse, message.drive, idn))
            }
            _ => return Err(ErrorReply::SERVICE_NOT_SUPPORTED),
        })
    }

    /// Takes an answer from a send mailbox of this size; true if more parts follow.
    pub(super) fn answered(&mut self, filter: &AnswerFilter, payload: &[u8], mailbox_size: usize) -> bool {
        let pending = core::mem::take(&mut self.pending);
        let mut more = false;
        self.transfer = match filter {
            AnswerFilter::Initiate(..) | AnswerFilter::Segment => match SdoResponse::decode(payload) {
                Ok(SdoResponse::UploadNormal { total, data, .. }) if (data.len() as u64) < u64::from(total) => pending,
                Ok(SdoResponse::UploadSegment { last: false, .. }) => pending,
                Ok(SdoResponse::DownloadDone { .. } | SdoResponse::DownloadSegmentDone { .. }) => pending,
                _ => Transfer::None,
            },
            AnswerFilter::File { .. } => match FoeMessage::decode(payload) {
                Ok(FoeMessage::Data { data, .. }) if data.len() < FoeMessage::max_data(mailbox_size) => {
                    Transfer::FileRead
                }
                Ok(FoeMessage::Data { .. }) => Transfer::File,
                Ok(FoeMessage::Acknowledge { .. }) => pending,
                // The client repeats its message.
                Ok(FoeMessage::Busy { .. }) => Transfer::File,
                _ => Transfer::None,
            },
            AnswerFilter::Information(..) => {
                more = SdoInformation::decode(payload).is_ok_and(|part| part.incomplete || part.fragments_left > 0);
                Transfer::None
            }
            AnswerFilter::Soe(..) => {
                more = SoeMessage::decode(payload).is_ok_and(|part| part.incomplete && !part.error);
                Transfer::None
            }
            AnswerFilter::Aoe(_) | AnswerFilter::Voe(_) | AnswerFilter::Eoe(_) | AnswerFilter::SameType => {
                Transfer::None
            }
        };
        more
    }

    /// The message that ends the transfer in the SubDevice; `None` if no transfer is in progress or no such message
    /// exists.
    pub(super) fn end(&mut self) -> Option<Vec<u8>> {
        let mut out = vec![0; END_LEN];
        let length = match core::mem::take(&mut self.transfer) {
            Transfer::Object(index, sub_index) => {
                let code = AbortCode::PROTOCOL_TIMEOUT;
                SdoRequest::Abort { index, sub_index, code }.encode(&mut out[..INITIATE_LEN])
            }
            Transfer::File => {
                let text = b"the gateway client has ended";
                FoeMessage::Error { code: FoeErrorCode::ILLEGAL, text }.encode(&mut out)
            }
            Transfer::None | Transfer::FileRead | Transfer::Fragments => None,
        }?;
        out.truncate(length);
        Some(out)
    }

    /// The answer to the written request is missing: the SubDevice may be in the middle of the transfer.
    pub(super) fn unanswered(&mut self) {
        let pending = core::mem::take(&mut self.pending);
        if !self.is_open() {
            self.transfer = pending;
        }
    }
}

impl AnswerFilter {
    /// Index of the requested object, if known.
    pub(super) fn index(&self) -> Option<u16> {
        match self {
            AnswerFilter::Initiate(index, _) => Some(*index),
            _ => None,
        }
    }

    /// Whether a mail is a further part of the answer. For SDO information, only the first part names its object.
    pub(super) fn continues(&self, payload: &[u8]) -> bool {
        match self {
            AnswerFilter::Information(answer, _) => SdoInformation::decode(payload)
                .is_ok_and(|part| part.opcode == *answer || part.opcode == InformationOpcode::Error),
            _ => self.matches(payload),
        }
    }

    /// Whether a mail is an answer, or the first part of it.
    pub(super) fn matches(&self, payload: &[u8]) -> bool {
        match self {
            AnswerFilter::Initiate(object, entry) => match SdoResponse::decode(payload) {
                Ok(
                    SdoResponse::DownloadDone { index, sub_index, .. }
                    | SdoResponse::UploadExpedited { index, sub_index, .. }
                    | SdoResponse::UploadNormal { index, sub_index, .. }
                    | SdoResponse::Abort { index, sub_index, .. },
                ) => (index, sub_index) == (*object, *entry),
                _ => false,
            },
            AnswerFilter::Segment => matches!(
                SdoResponse::decode(payload),
                Ok(SdoResponse::DownloadSegmentDone { .. }
                    | SdoResponse::UploadSegment { .. }
                    | SdoResponse::Abort { .. })
            ),
            AnswerFilter::Information(answer, key) => SdoInformation::decode(payload).is_ok_and(|part| {
                part.opcode == InformationOpcode::Error || (part.opcode == *answer && part.data.starts_with(key))
            }),
            AnswerFilter::File { data, acknowledge } => match FoeMessage::decode(payload) {
                Ok(FoeMessage::Data { packet, .. }) => {
                    *data == Some(packet) || (data.is_none() && acknowledge.is_none())
                }
                Ok(FoeMessage::Acknowledge { packet }) => *acknowledge == Some(packet),
                Ok(FoeMessage::Error { .. } | FoeMessage::Busy { .. }) => true,
                _ => false,
            },
            AnswerFilter::Soe(operation, drive, idn) => SoeMessage::decode(payload).is_ok_and(|message| {
                let ours = message.idn().is_none_or(|answered| answered == *idn);
                message.operation == *operation && message.drive == *drive && ours
            }),
            AnswerFilter::Aoe(invoke_id) => {
                AmsHeader::decode(payload).is_ok_and(|(header, _)| header.invoke_id == *invoke_id)
            }
            AnswerFilter::Voe(vendor) => payload.starts_with(vendor),
            AnswerFilter::Eoe(kind) => payload.first().is_some_and(|first| first & EOE_TYPE == *kind),
            AnswerFilter::SameType => true,
        }
    }
}

/// Filter for the answer to an SDO information request. The answer starts with the data of the request: the kind of a
/// list, an index, a subindex.
fn request_information(payload: &[u8]) -> Result<ExpectedAnswer, u16> {
    let request = SdoInformation::decode(payload).map_err(|_| ErrorReply::SIZE_TOO_SHORT)?;
    let (answer, length) = match request.opcode {
        InformationOpcode::ListRequest => (InformationOpcode::ListResponse, 2),
        InformationOpcode::ObjectRequest => (InformationOpcode::ObjectResponse, 2),
        InformationOpcode::EntryRequest => (InformationOpcode::EntryResponse, 3),
        InformationOpcode::ListResponse
        | InformationOpcode::ObjectResponse
        | InformationOpcode::EntryResponse
        | InformationOpcode::Error
        | InformationOpcode::Other(_) => return Err(ErrorReply::SERVICE_NOT_SUPPORTED),
    };
    let key = request.data.get(..length).ok_or(ErrorReply::SIZE_TOO_SHORT)?;
    Ok(ExpectedAnswer::Matching(AnswerFilter::Information(answer, key.to_vec())))
}

#[cfg(test)]
mod tests;
