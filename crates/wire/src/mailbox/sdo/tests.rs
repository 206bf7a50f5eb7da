use super::*;
use proptest::prelude::*;
use std::string::ToString;
use std::vec::Vec;

const OBJECT: u16 = 0x1C12;

fn encoded_request(request: &SdoRequest<'_>) -> Vec<u8> {
    let mut out = [0xEE; 256];
    let length = request.encode(&mut out).unwrap();
    out[..length].to_vec()
}

fn encoded_response(response: &SdoResponse<'_>) -> Vec<u8> {
    let mut out = [0xEE; 256];
    let length = response.encode(&mut out).unwrap();
    out[..length].to_vec()
}

// covers: 6.7, codec-mailbox
#[test]
fn one_vector_for_every_request() {
    use SdoRequest::*;
    let (index, sub_index, complete_access) = (OBJECT, 1, false);
    let vectors: [(SdoRequest<'_>, &[u8]); 14] = [
        (
            DownloadExpedited { index, sub_index, complete_access, data: &[0xAA] },
            &[0x00, 0x20, 0x2F, 0x12, 0x1C, 1, 0xAA, 0, 0, 0],
        ),
        (
            DownloadExpedited { index, sub_index, complete_access, data: &[0xAA, 0xBB] },
            &[0x00, 0x20, 0x2B, 0x12, 0x1C, 1, 0xAA, 0xBB, 0, 0],
        ),
        (
            DownloadExpedited { index, sub_index, complete_access, data: &[0xAA, 0xBB, 0xCC] },
            &[0x00, 0x20, 0x27, 0x12, 0x1C, 1, 0xAA, 0xBB, 0xCC, 0],
        ),
        (
            DownloadExpedited { index, sub_index: 0, complete_access: true, data: &[1, 2, 3, 4] },
            &[0x00, 0x20, 0x33, 0x12, 0x1C, 0, 1, 2, 3, 4],
        ),
        (
            DownloadNormal { index, sub_index, complete_access, total: 0x0102, data: &[1, 2, 3, 4, 5] },
            &[0x00, 0x20, 0x21, 0x12, 0x1C, 1, 0x02, 0x01, 0, 0, 1, 2, 3, 4, 5],
        ),
        (
            DownloadNormal {
                index,
                sub_index: 0,
                complete_access: true,
                total: 6,
                data: &[2, 0, 0x01, 0x16, 0x02, 0x16],
            },
            &[0x00, 0x20, 0x31, 0x12, 0x1C, 0, 6, 0, 0, 0, 2, 0, 0x01, 0x16, 0x02, 0x16],
        ),
        (Upload { index, sub_index, complete_access }, &[0x00, 0x20, 0x40, 0x12, 0x1C, 1, 0, 0, 0, 0]),
        (Upload { index, sub_index: 0, complete_access: true }, &[0x00, 0x20, 0x50, 0x12, 0x1C, 0, 0, 0, 0, 0]),
        (
            DownloadSegment { toggle: false, last: false, data: &[1, 2, 3, 4, 5, 6, 7, 8] },
            &[0x00, 0x20, 0x00, 1, 2, 3, 4, 5, 6, 7, 8],
        ),
        (DownloadSegment { toggle: true, last: true, data: &[1, 2, 3] }, &[0x00, 0x20, 0x19, 1, 2, 3, 0, 0, 0, 0]),
        (DownloadSegment { toggle: false, last: true, data: &[] }, &[0x00, 0x20, 0x0F, 0, 0, 0, 0, 0, 0, 0]),
        (UploadSegment { toggle: false }, &[0x00, 0x20, 0x60, 0, 0, 0, 0, 0, 0, 0]),
        (UploadSegment { toggle: true }, &[0x00, 0x20, 0x70, 0, 0, 0, 0, 0, 0, 0]),
        (
            Abort { index, sub_index, code: AbortCode::PROTOCOL_TIMEOUT },
            &[0x00, 0x20, 0x80, 0x12, 0x1C, 1, 0x00, 0x00, 0x04, 0x05],
        ),
    ];
    for (request, bytes) in vectors {
        assert_eq!(encoded_request(&request), bytes, "{request:?}");
        assert_eq!(SdoRequest::decode(bytes), Ok(request), "{bytes:02x?}");
    }
}

// covers: 6.7, codec-mailbox
#[test]
fn one_vector_for_every_response() {
    use SdoResponse::*;
    let (index, sub_index, complete_access) = (OBJECT, 1, false);
    let vectors: [(SdoResponse<'_>, &[u8]); 10] = [
        (DownloadDone { index, sub_index }, &[0x00, 0x30, 0x60, 0x12, 0x1C, 1, 0, 0, 0, 0]),
        (
            UploadExpedited { index, sub_index, complete_access, data: &[0x05] },
            &[0x00, 0x30, 0x4F, 0x12, 0x1C, 1, 0x05, 0, 0, 0],
        ),
        (
            UploadExpedited { index, sub_index: 0, complete_access: true, data: &[1, 2, 3, 4] },
            &[0x00, 0x30, 0x53, 0x12, 0x1C, 0, 1, 2, 3, 4],
        ),
        (
            UploadNormal { index, sub_index, complete_access, total: 6, data: b"EL3004" },
            &[0x00, 0x30, 0x41, 0x12, 0x1C, 1, 6, 0, 0, 0, b'E', b'L', b'3', b'0', b'0', b'4'],
        ),
        (
            UploadNormal { index, sub_index, complete_access, total: 0x0001_0000, data: &[] },
            &[0x00, 0x30, 0x41, 0x12, 0x1C, 1, 0, 0, 1, 0],
        ),
        (DownloadSegmentDone { toggle: false }, &[0x00, 0x30, 0x20, 0, 0, 0, 0, 0, 0, 0]),
        (DownloadSegmentDone { toggle: true }, &[0x00, 0x30, 0x30, 0, 0, 0, 0, 0, 0, 0]),
        (
            UploadSegment { toggle: false, last: false, data: &[1, 2, 3, 4, 5, 6, 7] },
            &[0x00, 0x30, 0x00, 1, 2, 3, 4, 5, 6, 7],
        ),
        (UploadSegment { toggle: true, last: true, data: &[9] }, &[0x00, 0x30, 0x1D, 9, 0, 0, 0, 0, 0, 0]),
        (
            Abort { index, sub_index, code: AbortCode::OBJECT_DOES_NOT_EXIST },
            &[0x00, 0x20, 0x80, 0x12, 0x1C, 1, 0x00, 0x00, 0x02, 0x06],
        ),
    ];
    for (response, bytes) in vectors {
        assert_eq!(encoded_response(&response), bytes, "{response:?}");
        assert_eq!(SdoResponse::decode(bytes), Ok(response), "{bytes:02x?}");
    }
}

#[test]
fn an_abort_of_a_subdevice_is_decoded_with_both_services() {
    let abort = SdoResponse::Abort { index: OBJECT, sub_index: 1, code: AbortCode::READ_ONLY };
    let mut bytes = [0x00, 0x20, 0x80, 0x12, 0x1C, 1, 0x02, 0x00, 0x01, 0x06];
    assert_eq!(SdoResponse::decode(&bytes), Ok(abort));
    bytes[1] = 0x30;
    assert_eq!(SdoResponse::decode(&bytes), Ok(abort));
}

#[test]
fn expedited_data_without_an_indicated_size_is_four_bytes() {
    let bytes = [0x00, 0x30, 0x42, 0x12, 0x1C, 1, 1, 2, 3, 4];
    let expected =
        SdoResponse::UploadExpedited { index: OBJECT, sub_index: 1, complete_access: false, data: &[1, 2, 3, 4] };
    assert_eq!(SdoResponse::decode(&bytes), Ok(expected));
}

#[test]
fn bytes_beyond_the_total_of_a_normal_transfer_are_padding() {
    let bytes = [0x00, 0x30, 0x41, 0x12, 0x1C, 1, 2, 0, 0, 0, 7, 8, 0, 0];
    let expected =
        SdoResponse::UploadNormal { index: OBJECT, sub_index: 1, complete_access: false, total: 2, data: &[7, 8] };
    assert_eq!(SdoResponse::decode(&bytes), Ok(expected));
}

#[test]
fn a_short_segment_without_padding_is_decoded() {
    let bytes = [0x00, 0x30, 0x0B, 1, 2];
    assert_eq!(
        SdoResponse::decode(&bytes),
        Ok(SdoResponse::UploadSegment { toggle: false, last: true, data: &[1, 2] })
    );
    assert_eq!(SdoResponse::decode(&bytes[..4]), Err(SdoError::Short { expected: 5, got: 4 }));
}

#[test]
fn invalid_messages_are_not_encoded() {
    let expedited = |data| SdoRequest::DownloadExpedited { index: OBJECT, sub_index: 0, complete_access: false, data };
    let mut out = [0; 64];
    assert_eq!(expedited(&[]).encode(&mut out), None);
    assert_eq!(expedited(&[1, 2, 3, 4, 5]).encode(&mut out), None);
    assert_eq!(expedited(&[1]).encode(&mut out[..9]), None);
    let too_much =
        SdoResponse::UploadNormal { index: OBJECT, sub_index: 0, complete_access: false, total: 1, data: &[1, 2] };
    assert_eq!(too_much.encode(&mut out), None);
}

#[test]
fn another_service_and_an_unknown_command_are_refused_with_expected_and_received() {
    let emergency = [0x00, 0x10, 0, 0, 0, 0, 0, 0, 0, 0];
    let error = SdoResponse::decode(&emergency).unwrap_err();
    assert_eq!(error.to_string(), "expected SDO response, got emergency");
    assert_eq!(
        SdoRequest::decode(&[0x00, 0x30, 0x40, 0, 0, 0]).unwrap_err().to_string(),
        "expected SDO request, got SDO response"
    );
    assert_eq!(SdoRequest::decode(&[0x00, 0x20, 0xE0]), Err(SdoError::Command { got: 0xE0 }));
    assert_eq!(SdoResponse::decode(&[0x00, 0x30]), Err(SdoError::Short { expected: 3, got: 2 }));
    assert_eq!(SdoResponse::decode(&[0x00, 0x30, 0x60, 0x12]), Err(SdoError::Short { expected: 6, got: 4 }));
}

proptest! {
    #[test]
    fn any_normal_download_reads_back(
        object in any::<(u16, u8, bool)>(),
        data in proptest::collection::vec(any::<u8>(), 0..200),
        more in any::<u16>(),
    ) {
        let (index, sub_index, complete_access) = object;
        let total = data.len() as u32 + u32::from(more);
        let request = SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data: &data };
        let bytes = encoded_request(&request);
        prop_assert_eq!(bytes.len(), INITIATE_LEN + data.len());
        prop_assert_eq!(SdoRequest::decode(&bytes), Ok(request));
        let response = SdoResponse::UploadNormal { index, sub_index, complete_access, total, data: &data };
        let bytes = encoded_response(&response);
        prop_assert_eq!(SdoResponse::decode(&bytes), Ok(response));
    }

    #[test]
    fn any_expedited_transfer_reads_back(
        object in any::<(u16, u8, bool)>(),
        data in proptest::collection::vec(any::<u8>(), 1..=EXPEDITED_MAX_DATA),
    ) {
        let (index, sub_index, complete_access) = object;
        let request = SdoRequest::DownloadExpedited { index, sub_index, complete_access, data: &data };
        let bytes = encoded_request(&request);
        prop_assert_eq!(SdoRequest::decode(&bytes), Ok(request));
        let response = SdoResponse::UploadExpedited { index, sub_index, complete_access, data: &data };
        let bytes = encoded_response(&response);
        prop_assert_eq!(SdoResponse::decode(&bytes), Ok(response));
    }

    #[test]
    fn any_segment_reads_back(
        toggle in any::<bool>(),
        last in any::<bool>(),
        data in proptest::collection::vec(any::<u8>(), 0..200),
    ) {
        let request = SdoRequest::DownloadSegment { toggle, last, data: &data };
        let bytes = encoded_request(&request);
        prop_assert_eq!(bytes.len(), SEGMENT_OVERHEAD + data.len().max(SEGMENT_MIN_DATA));
        prop_assert_eq!(SdoRequest::decode(&bytes), Ok(request));
        let response = SdoResponse::UploadSegment { toggle, last, data: &data };
        let bytes = encoded_response(&response);
        prop_assert_eq!(SdoResponse::decode(&bytes), Ok(response));
    }

    #[test]
    fn any_message_without_data_reads_back(object in any::<(u16, u8, bool)>(), code in any::<u32>()) {
        let (index, sub_index, flag) = object;
        let code = AbortCode(code);
        for request in [
            SdoRequest::Upload { index, sub_index, complete_access: flag },
            SdoRequest::UploadSegment { toggle: flag },
            SdoRequest::Abort { index, sub_index, code },
        ] {
            let bytes = encoded_request(&request);
            prop_assert_eq!(SdoRequest::decode(&bytes), Ok(request));
        }
        for response in [
            SdoResponse::DownloadDone { index, sub_index },
            SdoResponse::DownloadSegmentDone { toggle: flag },
            SdoResponse::Abort { index, sub_index, code },
        ] {
            let bytes = encoded_response(&response);
            prop_assert_eq!(SdoResponse::decode(&bytes), Ok(response));
        }
    }

    // covers: codec-mailbox
    #[test]
    fn any_bytes_never_panic_and_decoded_messages_can_be_encoded(
        service in 2_u8..4,
        rest in proptest::collection::vec(any::<u8>(), 0..40),
    ) {
        let mut bytes = std::vec![0, service << 4];
        bytes.extend(&rest);
        for length in 0..=bytes.len() {
            let payload = &bytes[..length];
            if let Ok(request) = SdoRequest::decode(payload) {
                let bytes = encoded_request(&request);
                prop_assert_eq!(SdoRequest::decode(&bytes), Ok(request));
            }
            if let Ok(response) = SdoResponse::decode(payload) {
                let bytes = encoded_response(&response);
                prop_assert_eq!(SdoResponse::decode(&bytes), Ok(response));
            }
        }
    }
}
