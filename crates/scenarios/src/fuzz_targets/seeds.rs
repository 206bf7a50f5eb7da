//! Initial messages, one or more of each kind, from the encoders of `ringcat-wire`.

use std::net::Ipv4Addr;

use ringcat_wire::mailbox::aoe::{AdsCommand, AdsErrorCode, AdsRequest, AdsResponse, AmsAddress, AmsHeader, NetId};
use ringcat_wire::mailbox::coe::{
    AccessRights, CoeHeader, CoeService, DataType, DiagnosisKind, DiagnosisMessage, DiagnosisParameter, Emergency,
    EntryDescription, EntryRequest, InformationOpcode, ObjectCode, ObjectDescription, SdoInformation, ValueInfo,
};
use ringcat_wire::mailbox::eoe::{AddressFilter, EoeBody, EoeFragment, EoeMessage, EoeResult, IpParameters};
use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::soe::{SoeElements, SoeMessage, SoeOperation};
use ringcat_wire::mailbox::voe::VoeMessage;
use ringcat_wire::mailbox::{ErrorReply, Header, Message, Protocol, gateway};

const ROOM: usize = 256;

/// What an encoder writes.
fn written(encode: impl FnOnce(&mut [u8]) -> Option<usize>) -> Vec<u8> {
    let mut out = vec![0; ROOM];
    let length = encode(&mut out).expect("seeds are short");
    out.truncate(length);
    out
}

/// The seeds of a target.
///
/// # Panics
/// For an unknown name.
pub fn of(target: &str) -> Vec<Vec<u8>> {
    match target {
        "mailbox" => payloads().into_iter().map(|(protocol, payload)| in_mailbox(protocol, &payload)).collect(),
        "error_reply" => (1..=9).map(|detail| ErrorReply::new(detail).encode().to_vec()).collect(),
        "coe" => coe(),
        "sdo_request" => sdo_requests(),
        "sdo_response" => sdo_responses(),
        "sdo_information" => information(),
        "diagnosis" => diagnosis(),
        "foe" => foe(),
        "eoe" => eoe(),
        "soe" => soe(),
        "aoe" => aoe(),
        "voe" => vec![written(|out| VoeMessage { vendor_id: 7, vendor_type: 3, data: b"vendor" }.encode(out))],
        "gateway" => payloads().into_iter().map(|(protocol, payload)| in_gateway(protocol, &payload)).collect(),
        "eni" => [super::eni::GROUP, super::eni::COMMANDS].map(|text| text.as_bytes().to_vec()).to_vec(),
        "esi" => vec![super::esi::SMALL.as_bytes().to_vec()],
        "control" => super::control::seeds(),
        "remote" => super::remote::seeds(),
        "master_frame" => super::master_frame::seeds(),
        "knowledge" => vec![super::knowledge::SMALL.to_vec()],
        "network" => vec![super::network::WHOLE.as_bytes().to_vec()],
        other => panic!("no target \"{other}\""),
    }
}

/// One or two payloads of each protocol.
fn payloads() -> Vec<(Protocol, Vec<u8>)> {
    let kinds = [
        (Protocol::Error, "error_reply"),
        (Protocol::Aoe, "aoe"),
        (Protocol::Eoe, "eoe"),
        (Protocol::Coe, "coe"),
        (Protocol::Foe, "foe"),
        (Protocol::Soe, "soe"),
        (Protocol::Voe, "voe"),
    ];
    kinds.into_iter().flat_map(|(protocol, name)| of(name).into_iter().take(2).map(move |it| (protocol, it))).collect()
}

fn in_mailbox(protocol: Protocol, payload: &[u8]) -> Vec<u8> {
    let header = Header::new(protocol, 3, payload.len() as u16);
    [&header.encode()[..], payload, &[0; 8]].concat()
}

fn in_gateway(protocol: Protocol, payload: &[u8]) -> Vec<u8> {
    let header = Header { address: 1001, ..Header::new(protocol, 3, payload.len() as u16) };
    written(|out| gateway::encode(&Message { header, payload }, out))
}

fn coe() -> Vec<Vec<u8>> {
    let emergency = Emergency { error_code: 0x8130, error_register: 0x10, data: [1, 2, 3, 4, 5] };
    let mut seeds = vec![[&CoeHeader::new(CoeService::Emergency).encode()[..], &emergency.encode()].concat()];
    let some = |seeds: Vec<Vec<u8>>| seeds.into_iter().take(3);
    seeds.extend(some(sdo_requests()).chain(some(sdo_responses())).chain(some(information())));
    seeds
}

fn sdo_requests() -> Vec<Vec<u8>> {
    let (index, sub_index, complete_access) = (0x1C12, 1, false);
    let requests = [
        SdoRequest::Upload { index, sub_index, complete_access },
        SdoRequest::DownloadExpedited { index, sub_index, complete_access, data: &[1, 2, 3] },
        SdoRequest::DownloadNormal { index, sub_index: 0, complete_access: true, total: 20, data: &[7; 14] },
        SdoRequest::DownloadSegment { toggle: true, last: true, data: &[1, 2, 3] },
        SdoRequest::DownloadSegment { toggle: false, last: false, data: &[9; 30] },
        SdoRequest::UploadSegment { toggle: true },
        SdoRequest::Abort { index, sub_index, code: AbortCode::GENERAL },
    ];
    requests.iter().map(|request| written(|out| request.encode(out))).collect()
}

fn sdo_responses() -> Vec<Vec<u8>> {
    let (index, sub_index, complete_access) = (0x1018, 4, false);
    let responses = [
        SdoResponse::UploadExpedited { index, sub_index, complete_access, data: &[1, 2, 3, 4] },
        SdoResponse::UploadNormal { index, sub_index, complete_access, total: 30, data: b"a part of a text" },
        SdoResponse::UploadSegment { toggle: false, last: true, data: b"rest" },
        SdoResponse::DownloadDone { index, sub_index },
        SdoResponse::DownloadSegmentDone { toggle: true },
        SdoResponse::Abort { index, sub_index, code: AbortCode::OBJECT_DOES_NOT_EXIST },
    ];
    responses.iter().map(|response| written(|out| response.encode(out))).collect()
}

fn information() -> Vec<Vec<u8>> {
    let object = ObjectDescription {
        index: 0x1018,
        data_type: DataType(0x23),
        max_sub_index: 4,
        code: ObjectCode::Record,
        name: b"Identity",
    };
    let entry = EntryDescription {
        index: 0x1018,
        sub_index: 1,
        value_info: ValueInfo::ALL,
        data_type: DataType(7),
        bit_length: 32,
        access: AccessRights(AccessRights::READ),
        unit: Some(0),
        default: Some(&[1, 0, 0, 0]),
        minimum: Some(&[0; 4]),
        maximum: Some(&[9; 4]),
        name: b"Vendor",
    };
    let request = EntryRequest { index: 0x1018, sub_index: 1, value_info: ValueInfo(ValueInfo::ACCESS) };
    let message = |opcode, data: &[u8]| written(|out| SdoInformation::whole(opcode, data).encode(out));
    let part = SdoInformation {
        incomplete: true,
        fragments_left: 2,
        ..SdoInformation::whole(InformationOpcode::ListResponse, &[1, 0, 0, 0x10])
    };
    vec![
        message(InformationOpcode::ListRequest, &[1, 0]),
        written(|out| part.encode(out)),
        message(InformationOpcode::ObjectRequest, &[0x18, 0x10]),
        message(InformationOpcode::ObjectResponse, &written(|out| object.encode(out))),
        message(InformationOpcode::EntryRequest, &request.encode()),
        message(InformationOpcode::EntryResponse, &written(|out| entry.encode(out))),
        message(InformationOpcode::Error, &AbortCode::OBJECT_DOES_NOT_EXIST.0.to_le_bytes()),
    ]
}

fn diagnosis() -> Vec<Vec<u8>> {
    let parameters = [
        DiagnosisParameter::Value(DataType(6), &[1, 2]),
        DiagnosisParameter::Bytes(&[1, 2, 3]),
        DiagnosisParameter::Ascii(b"text"),
        DiagnosisParameter::Unicode(&[0x41, 0]),
        DiagnosisParameter::Text(17),
    ];
    let encoded: Vec<u8> = parameters.iter().flat_map(|parameter| written(|out| parameter.encode(out))).collect();
    let message = |parameter_count, parameters: &[u8]| {
        let (code, kind, text, time_ns) = (0x1234_E800, DiagnosisKind::Warning, 5, 1_000_000);
        let message =
            DiagnosisMessage { code, kind, local_time: true, reserved: 0, text, time_ns, parameter_count, parameters };
        written(|out| message.encode(out))
    };
    vec![message(0, &[]), message(5, &encoded)]
}

fn foe() -> Vec<Vec<u8>> {
    let messages = [
        FoeMessage::Read { password: 0, name: b"firmware" },
        FoeMessage::Write { password: 0x1234_5678, name: b"firmware" },
        FoeMessage::Data { packet: 1, data: &[0x55; 40] },
        FoeMessage::Acknowledge { packet: 2 },
        FoeMessage::Error { code: FoeErrorCode::NOT_FOUND, text: b"no such file" },
        FoeMessage::Busy { done: 20, entire: 100, text: b"erasing" },
    ];
    messages.iter().map(|message| written(|out| message.encode(out))).collect()
}

fn eoe() -> Vec<Vec<u8>> {
    let fragment = |number, blocks, last, time_ns, data| {
        EoeBody::Fragment(EoeFragment { frame: 5, number, blocks, last, time_requested: false, time_ns, data })
    };
    let address = |last| Some(Ipv4Addr::new(192, 168, 0, last));
    let ip = IpParameters { address: address(1), mask: address(255), ..IpParameters::default() };
    let bodies = [
        fragment(0, 2, false, None, &[0xAA; 32]),
        fragment(1, 1, true, Some(77), &[0xBB; 20]),
        EoeBody::TimeStamp { frame: 5, time_ns: 99 },
        EoeBody::SetIp(ip),
        EoeBody::SetIpDone(EoeResult::OK),
        EoeBody::SetFilter(AddressFilter::default()),
        EoeBody::SetFilterDone(EoeResult(0x0401)),
        EoeBody::GetIp,
        EoeBody::Ip(EoeResult::OK, ip),
        EoeBody::GetFilter,
        EoeBody::Filter(EoeResult::OK, AddressFilter::default()),
    ];
    bodies.iter().map(|body| written(|out| EoeMessage { port: 1, body: *body }.encode(out))).collect()
}

fn soe() -> Vec<Vec<u8>> {
    let message = SoeMessage {
        operation: SoeOperation::ReadRequest,
        incomplete: false,
        error: false,
        drive: 1,
        elements: SoeElements::VALUE,
        number: 0x8001,
        data: &[],
    };
    let messages = [
        message,
        SoeMessage { operation: SoeOperation::ReadResponse, incomplete: true, number: 2, data: &[4; 20], ..message },
        SoeMessage { operation: SoeOperation::ReadResponse, error: true, data: &[0x01, 0x10], ..message },
        SoeMessage { operation: SoeOperation::WriteRequest, data: &[1, 2], ..message },
        SoeMessage { operation: SoeOperation::WriteResponse, ..message },
        SoeMessage { operation: SoeOperation::Notification, ..message },
    ];
    messages.iter().map(|message| written(|out| message.encode(out))).collect()
}

fn aoe() -> Vec<Vec<u8>> {
    let address = |port| AmsAddress { net_id: NetId([5, 18, 2, 3, 2, 1]), port };
    let message = |command: AdsCommand, flags: u16, data: &[u8]| {
        let (error, length) = (AdsErrorCode::NO_ERROR, data.len() as u32);
        let (target, source) = (address(1000), address(0x8000));
        let header = AmsHeader { target, source, command, flags, length, error, invoke_id: 42 };
        [&header.encode()[..], data].concat()
    };
    let result = AdsErrorCode::NO_ERROR;
    let requests = [
        AdsRequest::Read { group: 0xF302, offset: 0x1018_0001, length: 4 },
        AdsRequest::Write { group: 0xF302, offset: 0x2000_0001, data: &[1, 2] },
        AdsRequest::ReadWrite { group: 1, offset: 2, read_length: 8, data: b"write" },
        AdsRequest::ReadState,
        AdsRequest::WriteControl { ads_state: 5, device_state: 0, data: &[] },
        AdsRequest::ReadDeviceInfo,
    ];
    let name = *b"device\0\0\0\0\0\0\0\0\0\0";
    let responses = [
        (AdsCommand::Read, AdsResponse::Data { result, data: &[1, 2, 3, 4] }),
        (AdsCommand::Write, AdsResponse::Done { result: AdsErrorCode(0x703) }),
        (AdsCommand::ReadState, AdsResponse::State { result, ads_state: 5, device_state: 8 }),
        (AdsCommand::ReadDeviceInfo, AdsResponse::DeviceInfo { result, major: 3, minor: 1, build: 77, name }),
    ];
    let asked = requests
        .iter()
        .map(|request| message(request.command(), AmsHeader::REQUEST, &written(|out| request.encode(out))));
    let answered = responses
        .iter()
        .map(|(command, response)| message(*command, AmsHeader::RESPONSE, &written(|out| response.encode(out))));
    asked.chain(answered).collect()
}
