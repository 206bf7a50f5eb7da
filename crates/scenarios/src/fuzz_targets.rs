//! Fuzz targets for arbitrary bytes: one per mailbox decoder (protocol 6, 10.1), and one each for ENI, ESI
//! and network files (protocol 8, 12), for knowledge of a segment (decision 0061), for messages of the daemon (decision
//! 0074) and of remote access (decision 0221), and for master frames (decision 0130).
//!
//! A target is a plain function. It panics if a decoder panics, or if a decoded value changes when it is encoded and
//! decoded again. `fuzz/` runs the targets under cargo-fuzz, `cargo test` with the corpora in `fuzz/corpus` and mutants
//! of them ([`mutate`]); the corpora are made by the encoders of `ringcat-wire` ([`seeds`]).

pub mod control;
pub mod eni;
pub mod esi;
pub mod knowledge;
pub mod master_frame;
pub mod network;
pub mod remote;
pub mod seeds;

use ringcat_wire::mailbox::aoe::{AdsRequest, AdsResponse, AmsHeader};
use ringcat_wire::mailbox::coe::{
    CoeHeader, CoeService, DiagnosisMessage, Emergency, EntryDescription, EntryRequest, InformationOpcode,
    ObjectDescription, SdoInformation,
};
use ringcat_wire::mailbox::eoe::EoeMessage;
use ringcat_wire::mailbox::foe::FoeMessage;
use ringcat_wire::mailbox::sdo::{SdoRequest, SdoResponse};
use ringcat_wire::mailbox::soe::SoeMessage;
use ringcat_wire::mailbox::voe::VoeMessage;
use ringcat_wire::mailbox::{ErrorReply, Header, Message, Protocol, gateway};

use crate::dice::Dice;

/// A decoder and its properties for any bytes.
pub type Target = fn(&[u8]);

/// All targets by the names of their corpora.
pub const TARGETS: [(&str, Target); 20] = [
    ("mailbox", mailbox),
    ("error_reply", error_reply),
    ("coe", coe),
    ("sdo_request", sdo_request),
    ("sdo_response", sdo_response),
    ("sdo_information", sdo_information),
    ("diagnosis", diagnosis),
    ("foe", foe),
    ("eoe", eoe),
    ("soe", soe),
    ("aoe", aoe),
    ("voe", voe),
    ("gateway", any_gateway),
    ("eni", eni::target),
    ("esi", esi::target),
    ("network", network::target),
    ("knowledge", knowledge::target),
    ("control", control::target),
    ("remote", remote::target),
    ("master_frame", master_frame::target),
];

/// Buffer size for any message: more than a mailbox, and the largest prefix of an encoder.
const ROOM: usize = 1 << 16;

/// A decoded value encodes to bytes that decode to the same value.
macro_rules! survives {
    ($what:ty, $bytes:expr) => {
        if let Ok(value) = <$what>::decode($bytes) {
            let mut out = vec![0; ROOM];
            let length = value.encode(&mut out).expect("what was decoded can be encoded");
            assert_eq!(<$what>::decode(&out[..length]), Ok(value));
            assert!(value.encode(&mut out[..length - 1]).is_none(), "one byte less does not do");
        }
    };
}

/// A whole mailbox: header, then the decoder of its protocol.
pub fn mailbox(bytes: &[u8]) {
    let Ok(Message { header, payload }) = Message::decode(bytes) else { return };
    assert_eq!(payload.len(), usize::from(header.length));
    assert_eq!(Header::decode(&header.encode()), header);
    match header.protocol {
        Protocol::Error => error_reply(payload),
        Protocol::Aoe => aoe(payload),
        Protocol::Eoe => eoe(payload),
        Protocol::Coe => coe(payload),
        Protocol::Foe => foe(payload),
        Protocol::Soe => soe(payload),
        Protocol::Voe => voe(payload),
        Protocol::Other(_) => {}
    }
}

/// The payload of an error reply.
pub fn error_reply(bytes: &[u8]) {
    if let Some(bytes) = bytes.first_chunk() {
        let reply = ErrorReply::decode(bytes);
        assert_eq!(reply.encode(), *bytes);
        let _ = reply.detail_name();
    }
}

/// The payload of CoE: the decoder of its service.
pub fn coe(bytes: &[u8]) {
    let Some((head, rest)) = bytes.split_first_chunk() else { return };
    let header = CoeHeader::decode(head);
    assert_eq!(header.encode(), *head);
    match header.service {
        CoeService::Emergency => {
            if let Some(rest) = rest.first_chunk() {
                assert_eq!(Emergency::decode(rest).encode(), *rest);
            }
        }
        CoeService::SdoRequest | CoeService::SdoResponse => {
            sdo_request(bytes);
            sdo_response(bytes);
        }
        CoeService::SdoInformation => sdo_information(bytes),
        CoeService::TxPdo
        | CoeService::RxPdo
        | CoeService::TxPdoRemote
        | CoeService::RxPdoRemote
        | CoeService::Other(_) => {}
    }
}

/// An SDO request.
pub fn sdo_request(bytes: &[u8]) {
    survives!(SdoRequest<'_>, bytes);
}

/// An SDO response.
pub fn sdo_response(bytes: &[u8]) {
    survives!(SdoResponse<'_>, bytes);
}

/// SDO information, and its data.
pub fn sdo_information(bytes: &[u8]) {
    survives!(SdoInformation<'_>, bytes);
    let Ok(message) = SdoInformation::decode(bytes) else { return };
    let _ = (message.list().map(|(_, indices)| indices.iter().count()), message.object(), message.abort_code());
    match message.opcode {
        InformationOpcode::ObjectResponse => survives!(ObjectDescription<'_>, message.data),
        InformationOpcode::EntryResponse => survives!(EntryDescription<'_>, message.data),
        InformationOpcode::EntryRequest => {
            if let Ok(request) = EntryRequest::decode(message.data) {
                assert_eq!(EntryRequest::decode(&request.encode()), Ok(request));
            }
        }
        InformationOpcode::ListRequest
        | InformationOpcode::ListResponse
        | InformationOpcode::ObjectRequest
        | InformationOpcode::Error
        | InformationOpcode::Other(_) => {}
    }
}

/// A message of the diagnosis history, and its parameters.
pub fn diagnosis(bytes: &[u8]) {
    survives!(DiagnosisMessage<'_>, bytes);
    if let Ok(message) = DiagnosisMessage::decode(bytes) {
        assert!(message.parameters().count() <= usize::from(message.parameter_count));
        for parameter in message.parameters() {
            let mut out = vec![0; ROOM];
            parameter.encode(&mut out).expect("what was decoded can be encoded");
        }
    }
}

/// The payload of FoE.
pub fn foe(bytes: &[u8]) {
    survives!(FoeMessage<'_>, bytes);
}

/// The payload of EoE. Fragments with impossible headers are not encoded.
pub fn eoe(bytes: &[u8]) {
    let Ok(message) = EoeMessage::decode(bytes) else { return };
    let mut out = vec![0; ROOM];
    if let Some(length) = message.encode(&mut out) {
        assert_eq!(EoeMessage::decode(&out[..length]), Ok(message));
    }
}

/// The payload of SoE.
pub fn soe(bytes: &[u8]) {
    survives!(SoeMessage<'_>, bytes);
}

/// The payload of AoE: header, then the data as a request and as a response.
pub fn aoe(bytes: &[u8]) {
    let Ok((header, data)) = AmsHeader::decode(bytes) else { return };
    assert_eq!(header.encode(), bytes[..AmsHeader::LEN]);
    let mut out = vec![0; ROOM];
    if let Ok(request) = AdsRequest::decode(header.command, data) {
        assert_eq!(request.command(), header.command);
        let length = request.encode(&mut out).expect("what was decoded can be encoded");
        assert_eq!(AdsRequest::decode(header.command, &out[..length]), Ok(request));
    }
    if let Ok(response) = AdsResponse::decode(header.command, data) {
        let length = response.encode(&mut out).expect("what was decoded can be encoded");
        assert_eq!(AdsResponse::decode(header.command, &out[..length]), Ok(response));
    }
}

/// The payload of VoE.
pub fn voe(bytes: &[u8]) {
    survives!(VoeMessage<'_>, bytes);
}

/// A message of the mailbox gateway, and the mailbox in it.
pub fn any_gateway(bytes: &[u8]) {
    let Ok(message) = gateway::decode(bytes) else { return };
    let mut out = vec![0; ROOM];
    let length = gateway::encode(&message, &mut out).expect("what was decoded can be encoded");
    assert_eq!(gateway::decode(&out[..length]), Ok(message));
    mailbox(&out[2..length]);
}

/// Boundary values of decoders.
const EDGES: [u32; 12] = [0, 1, 2, 4, 7, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0xFFFF_FFFF];
/// Longest mutant.
const LONGEST: usize = 2048;

/// Changes bytes like a fuzzer: bits, bytes and numbers, parts removed, duplicated, exchanged or added.
pub fn mutate(bytes: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    for _ in 0..=dice.below(4) {
        let at = dice.below(bytes.len() as u64) as usize;
        let piece = 1 + dice.below(8) as usize;
        match dice.below(9) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << dice.below(8),
            1 if !bytes.is_empty() => bytes[at] = dice.roll() as u8,
            2 => {
                let edge = dice.pick(&EDGES).to_le_bytes();
                let width = [1, 2, 4][dice.below(3) as usize].min(bytes.len() - at);
                bytes[at..at + width].copy_from_slice(&edge[..width]);
            }
            3 => bytes.truncate(at),
            4 => drop(bytes.drain(at..(at + piece).min(bytes.len()))),
            5 if bytes.len() + piece <= LONGEST => {
                let copy = bytes[at..(at + piece).min(bytes.len())].to_vec();
                bytes.splice(at..at, copy);
            }
            6 if bytes.len() + piece <= LONGEST => bytes.extend((0..piece).map(|_| dice.roll() as u8)),
            7 if !other.is_empty() && bytes.len() + other.len() <= LONGEST => {
                let from = dice.below(other.len() as u64) as usize;
                bytes.truncate(at);
                bytes.extend_from_slice(&other[from..]);
            }
            _ => {}
        }
    }
}
