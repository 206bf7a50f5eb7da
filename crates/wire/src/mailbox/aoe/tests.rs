use super::*;
use proptest::prelude::*;
use std::string::ToString;

fn address(last: u8, port: u16) -> AmsAddress {
    AmsAddress { net_id: NetId([192, 168, 0, 1, 3, last]), port }
}

const COMMANDS: [AdsCommand; 6] = [
    AdsCommand::ReadDeviceInfo,
    AdsCommand::Read,
    AdsCommand::Write,
    AdsCommand::ReadState,
    AdsCommand::WriteControl,
    AdsCommand::ReadWrite,
];

// covers: 6.7, codec-mailbox
#[test]
fn the_header_has_32_bytes() {
    let header = AmsHeader {
        target: address(2, 1000),
        source: address(1, 0x8001),
        command: AdsCommand::Read,
        flags: AmsHeader::REQUEST,
        length: 3,
        error: AdsErrorCode::NO_ERROR,
        invoke_id: 0x0403_0201,
    };
    let bytes = *b"\xC0\xA8\x00\x01\x03\x02\xE8\x03\xC0\xA8\x00\x01\x03\x01\x01\x80\x02\x00\x04\x00\
                   \x03\x00\x00\x00\x00\x00\x00\x00\x01\x02\x03\x04abcd";
    assert_eq!(header.encode(), bytes[..32]);
    assert_eq!(AmsHeader::decode(&bytes), Ok((header, &b"abc"[..])));
    let short = PayloadError::Short { what: "AMS data", expected: 3, got: 2 };
    assert_eq!(AmsHeader::decode(&bytes[..34]), Err(short));
    assert_eq!(
        AmsHeader::decode(&bytes[..31]).unwrap_err().to_string(),
        "AMS header too short: expected at least 32 bytes, got 31"
    );
    let response = header.response(8);
    assert_eq!(
        (response.target, response.source, response.invoke_id),
        (header.source, header.target, header.invoke_id)
    );
    assert!(response.is_response() && !header.is_response());
    assert_eq!(header.target.net_id.to_string(), "192.168.0.1.3.2");
}

// covers: 6.7, codec-mailbox
#[test]
fn one_vector_for_every_request() {
    let vectors: [(AdsRequest<'_>, &[u8]); 6] = [
        (AdsRequest::ReadDeviceInfo, &[]),
        (
            AdsRequest::Read { group: index_group::SDO, offset: 0x1018_0001, length: 4 },
            &[0x02, 0xF3, 0, 0, 0x01, 0, 0x18, 0x10, 4, 0, 0, 0],
        ),
        (
            AdsRequest::Write { group: 0xF302, offset: 0x8000_0001, data: &[0x34, 0x12] },
            &[0x02, 0xF3, 0, 0, 0x01, 0, 0, 0x80, 2, 0, 0, 0, 0x34, 0x12],
        ),
        (AdsRequest::ReadState, &[]),
        (AdsRequest::WriteControl { ads_state: 5, device_state: 6, data: &[9] }, &[5, 0, 6, 0, 1, 0, 0, 0, 9]),
        (
            AdsRequest::ReadWrite { group: 1, offset: 2, read_length: 3, data: &[4] },
            &[1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 4],
        ),
    ];
    for ((request, bytes), command) in vectors.into_iter().zip(COMMANDS) {
        let mut out = [0xEE; 32];
        let length = request.encode(&mut out).unwrap();
        assert_eq!(&out[..length], bytes);
        assert_eq!(request.command(), command);
        assert_eq!(AdsRequest::decode(command, bytes), Ok(request));
    }
}

// covers: 6.7, codec-mailbox
#[test]
fn one_vector_for_every_response() {
    let result = AdsErrorCode::NO_ERROR;
    let name = *b"Simulated slave\0";
    let vectors: [(AdsCommand, AdsResponse<'_>, &[u8]); 6] = [
        (
            AdsCommand::ReadDeviceInfo,
            AdsResponse::DeviceInfo { result, major: 1, minor: 2, build: 0x0304, name },
            b"\0\0\0\0\x01\x02\x04\x03Simulated slave\0",
        ),
        (AdsCommand::Read, AdsResponse::Data { result, data: &[7, 8] }, &[0, 0, 0, 0, 2, 0, 0, 0, 7, 8]),
        (AdsCommand::ReadWrite, AdsResponse::Data { result, data: &[] }, &[0, 0, 0, 0, 0, 0, 0, 0]),
        (AdsCommand::Write, AdsResponse::Done { result: AdsErrorCode::INVALID_SIZE }, &[5, 7, 0, 0]),
        (
            AdsCommand::ReadState,
            AdsResponse::State { result, ads_state: 5, device_state: 8 },
            &[0, 0, 0, 0, 5, 0, 8, 0],
        ),
        (AdsCommand::WriteControl, AdsResponse::Done { result }, &[0, 0, 0, 0]),
    ];
    for (command, response, bytes) in vectors {
        let mut out = [0xEE; 32];
        let length = response.encode(&mut out).unwrap();
        assert_eq!(&out[..length], bytes);
        assert_eq!(AdsResponse::decode(command, bytes), Ok(response));
    }
    let failed = AdsResponse::decode(AdsCommand::Read, &[0x02, 7, 0, 0]).unwrap();
    assert_eq!(failed.result().to_string(), "0x0702 Invalid index group");
}

// covers: codec-mailbox
#[test]
fn commands_without_a_known_layout_are_refused_with_their_code() {
    for code in [6, 7, 8, 99] {
        let command = AdsCommand::from_code(code);
        assert_eq!(command.code(), code);
        let unknown = PayloadError::Code { what: "ADS command", got: code };
        assert_eq!(AdsRequest::decode(command, &[0; 40]), Err(unknown));
        assert_eq!(AdsResponse::decode(command, &[0; 40]), Err(unknown));
    }
    let short = PayloadError::Short { what: "ADS data", expected: 9, got: 1 };
    assert_eq!(AdsRequest::decode(AdsCommand::WriteControl, &[5, 0, 6, 0, 9, 0, 0, 0, 1]), Err(short));
}

proptest! {
    #[test]
    fn any_bytes_never_panic_and_decoded_messages_read_back(
        command in 0usize..6,
        length in 0u8..16,
        mut bytes in proptest::collection::vec(any::<u8>(), 0..80),
    ) {
        if let Ok((header, data)) = AmsHeader::decode(&bytes) {
            prop_assert_eq!(&header.encode()[..], &bytes[..32]);
            prop_assert_eq!(data.len(), header.length as usize);
        }
        // A length that may be valid.
        for at in [4, 8, 12] {
            if let Some(field) = bytes.get_mut(at..at + 4) {
                field.copy_from_slice(&[length, 0, 0, 0]);
            }
        }
        let command = COMMANDS[command];
        let mut out = [0; 128];
        if let Ok(request) = AdsRequest::decode(command, &bytes) {
            let written = request.encode(&mut out).unwrap();
            prop_assert_eq!(AdsRequest::decode(command, &out[..written]), Ok(request));
        }
        if let Ok(response) = AdsResponse::decode(command, &bytes) {
            let written = response.encode(&mut out).unwrap();
            prop_assert_eq!(AdsResponse::decode(command, &out[..written]), Ok(response));
        }
    }
}
