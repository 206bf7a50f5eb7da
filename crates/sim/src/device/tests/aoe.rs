//! Protocol 6.7 from the view of a MainDevice: memory, dictionary, states and device info by ADS.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::aoe::{
    AdsCommand, AdsErrorCode, AdsRequest, AdsResponse, AmsAddress, AmsHeader, NetId, index_group,
};

use super::client::Client;
use crate::application::aoe::{MEMORY, MEMORY_BYTES};

const PORT: u16 = 1000;
const DEVICE: NetId = NetId([10, 0, 0, 1, 2, 1]);
const HOST: AmsAddress = AmsAddress { net_id: NetId([10, 0, 0, 1, 1, 1]), port: 0x8001 };

fn client() -> Client {
    Client::new("all-protocols", AlState::PreOp)
}

fn send(client: &mut Client, port: u16, command: AdsCommand, data: &[u8]) -> (AmsHeader, Vec<u8>) {
    let header = AmsHeader {
        target: AmsAddress { net_id: DEVICE, port },
        source: HOST,
        command,
        flags: AmsHeader::REQUEST,
        length: data.len() as u32,
        error: AdsErrorCode::NO_ERROR,
        invoke_id: 77,
    };
    let mut payload = header.encode().to_vec();
    payload.extend_from_slice(data);
    client.post(Protocol::Aoe, &payload);
    let (mail, payload) = client.answer();
    assert_eq!(mail.protocol, Protocol::Aoe);
    let (answered, data) = AmsHeader::decode(&payload).unwrap();
    assert!(answered.is_response() && answered.invoke_id == 77);
    assert_eq!((answered.target, answered.source.port, answered.command), (HOST, port, command));
    (answered, data.to_vec())
}

/// Sends a request; returns the data of the response or its error.
fn request(client: &mut Client, request: &AdsRequest<'_>) -> Result<Vec<u8>, AdsErrorCode> {
    let mut data = [0; 980];
    let length = request.encode(&mut data).unwrap();
    let (header, data) = send(client, PORT, request.command(), &data[..length]);
    assert_eq!(header.error, AdsErrorCode::NO_ERROR);
    let response = AdsResponse::decode(request.command(), &data).unwrap();
    match (response.result(), response) {
        (AdsErrorCode::NO_ERROR, AdsResponse::Data { data, .. }) => Ok(data.to_vec()),
        (AdsErrorCode::NO_ERROR, _) => Ok(Vec::new()),
        (code, _) => Err(code),
    }
}

// covers: 6.7, sim-mailbox
#[test]
fn a_memory_is_written_and_read() {
    let mut client = client();
    let read = |offset, length| AdsRequest::Read { group: MEMORY, offset, length };
    assert_eq!(request(&mut client, &AdsRequest::Write { group: MEMORY, offset: 8, data: &[1, 2, 3] }), Ok(Vec::new()));
    assert_eq!(request(&mut client, &read(7, 5)), Ok(vec![0, 1, 2, 3, 0]));
    let both = AdsRequest::ReadWrite { group: MEMORY, offset: 9, read_length: 2, data: &[9] };
    assert_eq!(request(&mut client, &both), Ok(vec![9, 3]));
    assert_eq!(request(&mut client, &read(0, 900)).map(|data| data.len()), Ok(900));
    assert_eq!(request(&mut client, &read(MEMORY_BYTES as u32 - 1, 2)), Err(AdsErrorCode::INVALID_INDEX_OFFSET));
    assert_eq!(request(&mut client, &read(u32::MAX, u32::MAX)), Err(AdsErrorCode::INVALID_INDEX_OFFSET));
    assert_eq!(request(&mut client, &read(0, 2000)), Err(AdsErrorCode::INVALID_SIZE), "more than the mailbox holds");
    let foreign = AdsRequest::Read { group: 1, offset: 0, length: 1 };
    assert_eq!(request(&mut client, &foreign), Err(AdsErrorCode::INVALID_INDEX_GROUP));
}

// covers: 6.7, sim-mailbox
#[test]
fn objects_are_read_and_written_by_ads() {
    let mut client = client();
    let group = index_group::SDO;
    let read = |offset, length| AdsRequest::Read { group, offset, length };
    assert_eq!(request(&mut client, &read(0x1018_0000, 1)), Ok(vec![4]));
    let write = AdsRequest::Write { group, offset: 0x2001_0007, data: &[0x34, 0x12] };
    assert_eq!(request(&mut client, &write), Ok(Vec::new()));
    assert_eq!(request(&mut client, &read(0x2001_0007, 100)), Ok(vec![0x34, 0x12]));
    assert_eq!(request(&mut client, &read(0x2001_0100, 500)).map(|data| data.len()), Ok(402), "complete access");
    assert_eq!(request(&mut client, &read(0x2001_0007, 1)), Err(AdsErrorCode::INVALID_SIZE));
    assert_eq!(request(&mut client, &read(0x5000_0000, 4)), Err(AdsErrorCode::INVALID_INDEX_OFFSET));
    let fixed = AdsRequest::Write { group, offset: 0x1018_0001, data: &[0; 4] };
    assert_eq!(request(&mut client, &fixed), Err(AdsErrorCode::ACCESS_DENIED));
}

// covers: 6.7, sim-mailbox
#[test]
fn states_and_device_info_are_reported() {
    let mut client = client();
    let (_, data) = send(&mut client, PORT, AdsCommand::ReadState, &[]);
    let result = AdsErrorCode::NO_ERROR;
    let running = AdsResponse::State { result, ads_state: 5, device_state: 2 };
    assert_eq!(AdsResponse::decode(AdsCommand::ReadState, &data), Ok(running));
    let control = |ads_state| AdsRequest::WriteControl { ads_state, device_state: 0, data: &[] };
    assert_eq!(request(&mut client, &control(6)), Ok(Vec::new()));
    assert_eq!(request(&mut client, &control(99)), Err(AdsErrorCode::INVALID_PARAMETER));
    let (_, data) = send(&mut client, PORT, AdsCommand::ReadState, &[]);
    let stopped = AdsResponse::State { result, ads_state: 6, device_state: 2 };
    assert_eq!(AdsResponse::decode(AdsCommand::ReadState, &data), Ok(stopped));
    let (_, data) = send(&mut client, PORT, AdsCommand::ReadDeviceInfo, &[]);
    let name = *b"all-protocols\0\0\0";
    let info = AdsResponse::DeviceInfo { result, major: 1, minor: 0, build: 1, name };
    assert_eq!(AdsResponse::decode(AdsCommand::ReadDeviceInfo, &data), Ok(info));
}

// covers: 6.7
#[test]
fn an_undeliverable_request_is_reported_in_the_header() {
    let mut client = client();
    assert_eq!(send(&mut client, 9, AdsCommand::ReadState, &[]).0.error, AdsErrorCode::TARGET_PORT_NOT_FOUND);
    assert_eq!(send(&mut client, PORT, AdsCommand::AddNotification, &[]).0.error, AdsErrorCode::UNKNOWN_COMMAND);
    assert_eq!(send(&mut client, PORT, AdsCommand::Read, &[1, 2]).0.error, AdsErrorCode::INVALID_SIZE);
}
