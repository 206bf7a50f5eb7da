use super::*;
use crate::message::{Answer, Numbered, Query};

fn upload() -> Message {
    let ask = Query::SdoUpload { position: 3, index: 0x1018, sub_index: Some(1) };
    Content::Query(Numbered { id: 7, master: 1, what: ask }).into()
}

// covers: daemon
#[test]
fn a_message_is_a_header_its_content_and_its_data() {
    let data = Content::Answer(Numbered { id: 1, master: 0, what: Ok(Answer::Data) });
    let bytes = encode(&Message { content: data, bytes: vec![0xAA, 0xBB] }).expect("it is short");
    let content = b"\xA1\x66Answer\xA3\x62id\x01\x66master\x00\x64what\xA1\x62Ok\x64Data";
    assert_eq!(
        &bytes[..16],
        [b'R', b'C', b'T', b'L', VERSION as u8, 0, 0, 0, content.len() as u8, 0, 0, 0, 2, 0, 0, 0]
    );
    assert_eq!(bytes[16..], [&content[..], &[0xAA, 0xBB]].concat());
}

// covers: daemon
#[test]
fn messages_are_decoded_as_they_were() {
    for content in [
        Content::Hello { program: "a \"quoted\" program".to_owned() },
        Content::Take { master: 3, ethernet: true },
        Content::Knowledge,
        Content::Refused(Refusal::Version { here: 1, there: 2 }),
        Content::Answer(Numbered { id: 9, master: 0, what: Err(Refusal::ReadOnly) }),
        Content::Answer(Numbered { id: 9, master: 0, what: Ok(Answer::State(Box::default())) }),
    ] {
        let message = Message { content, bytes: vec![1, 2, 3] };
        assert_eq!(decode(&encode(&message).expect("it is short"), Limits::OWNER), Ok(message));
    }
}

// covers: daemon
#[test]
fn another_version_is_detected_from_the_header_alone() {
    let mut bytes = encode(&upload()).expect("it is short");
    bytes[4] = 1;
    bytes[16..].fill(0xFF);
    let error = decode(&bytes, Limits::CLIENT).expect_err("it is refused");
    assert_eq!(error, WireError::Version { there: 1 });
    let text = error.refusal().to_string();
    assert_eq!(text, format!("expected control version {VERSION}, got 1: install ringcatd and library of one release"));
}

// covers: daemon
#[test]
fn no_change_of_a_byte_and_no_length_makes_the_decoder_panic() {
    let whole = encode(&upload()).expect("it is short");
    for length in 0..whole.len() {
        assert!(decode(&whole[..length], Limits::CLIENT).is_err());
    }
    for at in 0..whole.len() {
        for value in [0, 1, 0x22, 0x5B, 0x7B, 0x7F, 0x80, 0xFF] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            if let Ok(message) = decode(&bytes, Limits::CLIENT) {
                assert_eq!(decode(&encode(&message).expect("it is short"), Limits::CLIENT), Ok(message));
            }
        }
    }
    let mut deep = encode(&upload()).expect("it is short")[..16].to_vec();
    deep[8..12].copy_from_slice(&4000_u32.to_le_bytes());
    deep.extend([0x81; 4000]);
    assert!(matches!(decode(&deep, Limits::CLIENT), Err(WireError::Malformed(_))));
}

// covers: daemon
#[test]
fn lengths_beyond_the_limits_are_refused_from_the_header() {
    let mut header = [0; HEADER];
    header[..4].copy_from_slice(b"RCTL");
    header[4..6].copy_from_slice(&VERSION.to_le_bytes());
    header[12..].fill(0xFF);
    let limit = Limits::CLIENT.bytes;
    let error = Header::decode(&header, Limits::CLIENT).expect_err("it is refused");
    assert_eq!(error, WireError::TooLong { length: u32::MAX as usize, limit });
    header[8..12].copy_from_slice(&(Limits::CLIENT.content as u32 + 1).to_le_bytes());
    assert!(Header::decode(&header, Limits::CLIENT).is_err());
    header[0] = b'G';
    assert_eq!(Header::decode(&header, Limits::CLIENT), Err(WireError::NotRingcat));
}
