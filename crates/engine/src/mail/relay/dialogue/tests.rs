//! Tracking of client transfers, message by message.

use super::*;
use ringcat_wire::mailbox::soe::SoeElements;

const SIZE: usize = 128;

fn sdo(request: SdoRequest<'_>) -> Vec<u8> {
    let mut out = vec![0; SIZE];
    let length = request.encode(&mut out).unwrap();
    out.truncate(length);
    out
}

fn reply(response: SdoResponse<'_>) -> Vec<u8> {
    let mut out = vec![0; SIZE];
    let length = response.encode(&mut out).unwrap();
    out.truncate(length);
    out
}

fn foe(message: FoeMessage<'_>) -> Vec<u8> {
    let mut out = vec![0; SIZE];
    let length = message.encode(&mut out).unwrap();
    out.truncate(length);
    out
}

fn filter(dialogue: &mut Dialogue, lane: Lane, payload: &[u8]) -> AnswerFilter {
    match dialogue.request(lane, payload, SIZE) {
        Ok(ExpectedAnswer::Matching(filter)) => filter,
        other => panic!("{other:?}"),
    }
}

// covers: gateway
#[test]
fn a_segmented_upload_is_in_progress_until_its_last_segment() {
    let mut dialogue = Dialogue::default();
    let upload = sdo(SdoRequest::Upload { index: 0x2000, sub_index: 1, complete_access: false });
    let expected = filter(&mut dialogue, Lane::Coe, &upload);
    let normal = |index| {
        reply(SdoResponse::UploadNormal { index, sub_index: 1, complete_access: false, total: 200, data: &[1; 100] })
    };
    assert!(expected.matches(&normal(0x2000)) && !expected.matches(&normal(0x2001)));
    dialogue.answered(&expected, &normal(0x2000), SIZE);
    assert!(dialogue.is_open());
    for (last, open) in [(false, true), (true, false)] {
        let expected = filter(&mut dialogue, Lane::Coe, &sdo(SdoRequest::UploadSegment { toggle: false }));
        let part = reply(SdoResponse::UploadSegment { toggle: false, last, data: &[2; 50] });
        assert!(expected.matches(&part));
        dialogue.answered(&expected, &part, SIZE);
        assert_eq!(dialogue.is_open(), open);
    }
    assert_eq!(dialogue.end(), None);
}

// Late answers may belong to other requests of the same kind.
// covers: 6.3, 6.6, gateway
#[test]
fn answers_are_matched_to_the_requested_object() {
    let mut dialogue = Dialogue::default();
    let upload = sdo(SdoRequest::Upload { index: 0x2001, sub_index: 110, complete_access: false });
    let expected = filter(&mut dialogue, Lane::Coe, &upload);
    let expedited =
        |index, sub_index| reply(SdoResponse::UploadExpedited { index, sub_index, complete_access: false, data: &[1] });
    assert!(expected.matches(&expedited(0x2001, 110)));
    assert!(!expected.matches(&expedited(0x2001, 73)) && !expected.matches(&expedited(0x2000, 110)));

    let information = |opcode, data: &[u8], fragments_left| {
        let mut out = vec![0; SdoInformation::OVERHEAD + data.len()];
        SdoInformation { opcode, fragments_left, data, incomplete: fragments_left > 0 }.encode(&mut out).unwrap();
        out
    };
    let entry = information(InformationOpcode::EntryRequest, &[0x01, 0x20, 7, 1], 0);
    let expected = filter(&mut dialogue, Lane::Coe, &entry);
    let answer = |key: [u8; 3]| information(InformationOpcode::EntryResponse, &[&key[..], &[1, 7, 0]].concat(), 1);
    assert!(expected.matches(&answer([0x01, 0x20, 7])) && !expected.matches(&answer([0x01, 0x20, 8])));
    assert!(!expected.matches(&information(InformationOpcode::ObjectResponse, &[0x01, 0x20, 7], 0)));
    assert!(expected.matches(&information(InformationOpcode::Error, &[0, 0, 2, 6], 0)));
    assert!(expected.continues(&information(InformationOpcode::EntryResponse, b"name", 0)));
    assert!(!expected.continues(&information(InformationOpcode::ListResponse, b"name", 0)));

    let soe = |operation, idn| {
        let message = SoeMessage::whole(operation, 1, SoeElements::VALUE, Idn::standard(0, idn), &[1, 2]);
        let mut out = vec![0; SIZE];
        let length = message.encode(&mut out).unwrap();
        out.truncate(length);
        out
    };
    let expected = filter(&mut dialogue, Lane::Soe, &soe(SoeOperation::ReadRequest, 47));
    assert!(
        expected.matches(&soe(SoeOperation::ReadResponse, 47))
            && !expected.matches(&soe(SoeOperation::ReadResponse, 48))
    );
    for nothing in [vec![0, 0x80], information(InformationOpcode::EntryRequest, &[1, 2], 0)] {
        assert_eq!(dialogue.request(Lane::Coe, &nothing, SIZE), Err(ErrorReply::SIZE_TOO_SHORT));
    }
    let answer = information(InformationOpcode::EntryResponse, &[1, 2, 3], 0);
    assert_eq!(dialogue.request(Lane::Coe, &answer, SIZE), Err(ErrorReply::SERVICE_NOT_SUPPORTED));
}

// covers: gateway
#[test]
fn an_interrupted_download_is_aborted_with_its_object() {
    let mut dialogue = Dialogue::default();
    let begin =
        SdoRequest::DownloadNormal { index: 0x2002, sub_index: 3, complete_access: false, total: 500, data: &[0; 90] };
    let expected = filter(&mut dialogue, Lane::Coe, &sdo(begin));
    dialogue.answered(&expected, &reply(SdoResponse::DownloadDone { index: 0x2002, sub_index: 3 }), SIZE);
    assert!(dialogue.is_open());
    let code = AbortCode::PROTOCOL_TIMEOUT;
    assert_eq!(dialogue.end(), Some(sdo(SdoRequest::Abort { index: 0x2002, sub_index: 3, code })));
    assert!(!dialogue.is_open());
    // Expedited and refused transfers are not in progress afterwards.
    let small = SdoRequest::DownloadExpedited { index: 1, sub_index: 0, complete_access: false, data: &[1] };
    let expected = filter(&mut dialogue, Lane::Coe, &sdo(small));
    dialogue.answered(&expected, &reply(SdoResponse::DownloadDone { index: 1, sub_index: 0 }), SIZE);
    assert!(!dialogue.is_open());
    let expected = filter(&mut dialogue, Lane::Coe, &sdo(begin));
    dialogue.answered(&expected, &reply(SdoResponse::Abort { index: 0x2002, sub_index: 3, code }), SIZE);
    assert!(!dialogue.is_open());
}

// covers: gateway
#[test]
fn a_file_transfer_is_in_progress_from_its_request_to_its_last_packet() {
    let mut dialogue = Dialogue::default();
    let expected = filter(&mut dialogue, Lane::Foe, &foe(FoeMessage::Read { password: 0, name: b"a" }));
    let (full, rest) = ([1; 116], [2; 5]);
    dialogue.answered(&expected, &foe(FoeMessage::Data { packet: 1, data: &full }), SIZE);
    assert!(dialogue.is_open());
    let expected = filter(&mut dialogue, Lane::Foe, &foe(FoeMessage::Acknowledge { packet: 1 }));
    let last = foe(FoeMessage::Data { packet: 2, data: &rest });
    assert!(expected.matches(&last) && !expected.matches(&foe(FoeMessage::Data { packet: 1, data: &full })));
    dialogue.answered(&expected, &last, SIZE);
    assert!(dialogue.is_open());
    let end = dialogue.request(Lane::Foe, &foe(FoeMessage::Acknowledge { packet: 2 }), SIZE);
    assert_eq!((end, dialogue.is_open()), (Ok(ExpectedAnswer::None), false));

    let expected = filter(&mut dialogue, Lane::Foe, &foe(FoeMessage::Write { password: 0, name: b"a" }));
    dialogue.answered(&expected, &foe(FoeMessage::Acknowledge { packet: 0 }), SIZE);
    let expected = filter(&mut dialogue, Lane::Foe, &foe(FoeMessage::Data { packet: 1, data: &full }));
    dialogue.answered(&expected, &foe(FoeMessage::Busy { done: 1, entire: 2, text: b"" }), SIZE);
    assert!(dialogue.is_open());
    let error = dialogue.end().unwrap();
    assert!(matches!(FoeMessage::decode(&error), Ok(FoeMessage::Error { .. })));
}

// covers: gateway
#[test]
fn messages_that_are_not_relayed_are_refused_with_their_error_code() {
    let mut dialogue = Dialogue::default();
    assert_eq!(lane(Protocol::Eoe, &[0, 1, 0, 0]), Err(ErrorReply::SERVICE_NOT_SUPPORTED));
    assert_eq!(lane(Protocol::Eoe, &[6, 1, 0, 0]), Ok(Lane::Eoe));
    assert_eq!(lane(Protocol::Error, &[1, 0, 2, 0]), Err(ErrorReply::UNSUPPORTED_PROTOCOL));
    assert_eq!(lane(Protocol::Other(9), &[]), Ok(Lane::Other(9)));
    assert_eq!(dialogue.request(Lane::Coe, &[0], SIZE), Err(ErrorReply::SIZE_TOO_SHORT));
    assert_eq!(dialogue.request(Lane::Coe, &[0, 0x10, 0, 0], SIZE), Err(ErrorReply::SERVICE_NOT_SUPPORTED));
    assert_eq!(dialogue.request(Lane::Voe, &[0, 0x10, 0], SIZE), Err(ErrorReply::SIZE_TOO_SHORT));
    for lane in Lane::ALL {
        for length in 0..40 {
            for byte in [0, 1, 2, 3, 4, 5, 6, 0x20, 0xFF] {
                // Random bytes.
                let _ = dialogue.request(lane, &vec![byte; length], SIZE);
                let _ = dialogue.end();
            }
        }
    }
}
