use std::format;
use std::string::ToString;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::datagram::Target;
use crate::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use crate::memory_write::{MemoryWrite, WriteKind};

/// The header of the golden bytes.
fn header() -> Header {
    Header {
        phase: Phase::Offers,
        state: 8,
        fragments: 7,
        first: 0x1234,
        frames: 2,
        session: 5,
        knowledge: 3,
        write: Some(MemoryWrite::new(WriteKind::Eeprom, false, 0x102)),
        knowledge_len: 0x0001_0203,
        period_ns: 1_000_000,
        identity: 0x0102_0304_0506_0708,
        item: Item { number: 9, count: 33, digest: 0xAABB_CCDD },
        lengths: Lengths { subdevices: 33, inputs: 5168, diagnosis: 57, to_inactive: 44, to_active: 13 },
        ..Header::new()
    }
}

const HEADER_BYTES: [u8; 64] = [
    b'R', b'C', b'm', b'r', 1, 1, 1, 8, 7, 0, 0x34, 0x12, 2, 0, 5, 0, 3, 0, 2, 0x81, 3, 2, 1, 0, 0x40, 0x42, 0x0F, 0,
    8, 7, 6, 5, 4, 3, 2, 1, 9, 0, 33, 0, 0xDD, 0xCC, 0xBB, 0xAA, 33, 0, 0, 0, 0x30, 0x14, 0, 0, 57, 0, 0, 0, 44, 0, 0,
    0, 13, 0, 0, 0,
];

// covers: 9.8, FR-03, standby
#[test]
fn a_header_of_a_cycle_has_the_expected_bytes() {
    let mut out = [0xEE; 70];
    assert_eq!(header().encode(&mut out), Some(Header::LEN));
    assert_eq!(out[..Header::LEN], HEADER_BYTES);
    assert_eq!(Header::decode(&HEADER_BYTES), Ok(header()));
    assert_eq!(header().encode(&mut out[..Header::LEN - 1]), None);
    let short = MasterFrameError::Short { what: "header of a master frame", expected: 64, got: 63 };
    assert_eq!(Header::decode(&HEADER_BYTES[..63]), Err(short));
    assert_eq!(short.to_string(), "header of a master frame too short: expected at least 64 bytes, got 63");
}

// covers: 9.8, FR-03, standby
#[test]
fn the_header_is_read_from_the_first_master_frame_of_a_cycle_only() {
    let frame_of = |area: Area, offset: u32, content: &[u8]| {
        let mut bytes = frame(&[(FragmentHead { offset, ..head(area, 0) }, content.len())]);
        let at = bytes.len() - 2 - content.len();
        bytes[at..at + content.len()].copy_from_slice(content);
        bytes
    };
    let whole = frame_of(Area::Header, 0, &HEADER_BYTES);
    assert_eq!(header_of_frame(&whole), Some(header()));
    assert_eq!(header_of_frame(&frame_of(Area::Diagnosis, 0, &HEADER_BYTES)), None);
    assert_eq!(header_of_frame(&frame_of(Area::Header, 4, &HEADER_BYTES)), None);
    assert_eq!(header_of_frame(&frame_of(Area::Header, 0, &HEADER_BYTES[..63])), None);
    for length in 0..whole.len() {
        let _ = header_of_frame(&whole[..length]);
    }
}

// covers: 9.8, FR-04, standby
#[test]
fn an_answer_of_the_inactive_has_the_expected_bytes() {
    let answer = Answer {
        stage: Stage::Follows,
        not_ready: NotReady::IDENTITY.with(NotReady::HELD, true),
        whole: 0x0102_0304,
        identity: 0x1112_1314_1516_1718,
        item: Item { number: 1, count: 2, digest: 3 },
        ..Answer::new()
    };
    let bytes = [
        b'R', b'C', b'm', b'a', 1, 1, 1, 0, 0x14, 0, 0, 0, 4, 3, 2, 1, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11,
        1, 0, 2, 0, 3, 0, 0, 0,
    ];
    let mut out = [0; Answer::LEN];
    assert_eq!(answer.encode(&mut out), Some(32));
    assert_eq!(out, bytes);
    assert_eq!(Answer::decode(&bytes), Ok(answer));
    assert_eq!(answer.not_ready.to_string(), "another configuration, held INACTIVE");
    assert!(NotReady::NOTHING.is_ready() && !answer.not_ready.is_ready());
}

// covers: FR-03, MR-13, MR-14, standby
#[test]
fn diagnosis_and_states_of_subdevices_have_the_expected_bytes() {
    let diagnosis = Diagnosis {
        ring: 1,
        carriers: 0b1010,
        al_states: [8, 2],
        answering: [0x0102, 3],
        sent: 4,
        lost: 5,
        incomplete: 6,
        skipped: 7,
        foreign: 8,
    };
    let mut out = [0; Diagnosis::LEN];
    assert_eq!(diagnosis.encode(&mut out), Some(48));
    let mut expected = [0; 48];
    expected[..8].copy_from_slice(&[1, 0b1010, 8, 2, 2, 1, 3, 0]);
    (4..9).enumerate().for_each(|(at, value)| expected[8 + 8 * at] = value);
    assert_eq!(out, expected);
    assert_eq!(Diagnosis::decode(&out), Ok(diagnosis));
    let domain = DomainRecord { state: 2, wkc: 99, expected: 0x0100 };
    let mut out = [0; DomainRecord::LEN];
    assert_eq!((domain.encode(&mut out), out), (Some(9), [2, 99, 0, 0, 0, 0, 1, 0, 0]));
    assert_eq!(DomainRecord::decode(&out), Ok(domain));
    let record = SubDeviceRecord::new(0xF4).with_answers(true).with_fresh(true);
    assert_eq!((record.0, record.al_status()), (0xB4, 0x14));
    assert!(record.answers() && record.is_fresh() && !record.is_settled());
    assert!(record.with_settled(true).is_settled() && !record.with_answers(false).answers());
}

/// A frame of NOP datagrams with these heads and bytes of data.
fn frame(fragments: &[(FragmentHead, usize)]) -> Vec<u8> {
    let mut bytes = std::vec![0; MAX_FRAME];
    let source = MacAddress([0x02, 0x77, 0x0E, 0x01, 0xBD, 0x9A]);
    let mut builder = FrameBuilder::ethernet(&mut bytes, MacAddress::ETHERCAT_GROUP, source).unwrap();
    for (head, length) in fragments {
        let target = Target::Broadcast(ADO);
        let at = builder.datagram(Command::Nop, 7, target, FragmentHead::LEN + length).unwrap();
        builder.data_mut(at, FragmentHead::LEN).unwrap().copy_from_slice(&head.encode());
    }
    let length = builder.finish();
    bytes.truncate(length);
    bytes
}

fn head(area: Area, number: u16) -> FragmentHead {
    FragmentHead { area, version: VERSION, number, cycle: 0x0A0B_0C0D, offset: 0x0102_0304 }
}

// covers: 9.8, FR-02, standby
#[test]
fn a_master_frame_is_a_frame_of_nop_datagrams_with_the_expected_bytes() {
    let bytes = frame(&[(head(Area::ToInactive, 2), 3), (head(Area::Answer, 3), 1)]);
    let first = [0, 7, 0, 0, 0x55, 0x41, 15, 0x80, 0, 0, 5, 1, 2, 0, 0x0D, 0x0C, 0x0B, 0x0A, 4, 3, 2, 1, 0, 0, 0, 0, 0];
    assert_eq!(bytes[16..43], first);
    assert_eq!(bytes[43..55], [0, 7, 0, 0, 0x55, 0x41, 13, 0, 0, 0, 0x81, 1]);
    assert!(is_master_frame(&bytes));
    for (at, bit) in [(12, 1), (15, 0x20), (16, 1), (18, 1), (20, 1)] {
        let mut other = bytes.clone();
        other[at] ^= bit;
        assert!(!is_master_frame(&other) && fragments_mut(&mut other).next().is_none(), "byte {at}");
    }
    assert!(!is_master_frame(&bytes[..27]));
}

// covers: FR-10, standby
#[test]
fn the_inactive_counts_2_for_what_it_takes_and_1_for_what_it_gives() {
    let heads = [head(Area::Header, 0), head(Area::Inputs, 1), head(Area::ToActive, 2), head(Area::Answer, 3)];
    let mut bytes = frame(&heads.map(|head| (head, 4)));
    for mut fragment in fragments_mut(&mut bytes) {
        fragment.data.fill(fragment.head.number as u8);
        fragment.count();
    }
    let seen: Vec<_> = fragments_mut(&mut bytes).map(|it| (it.head, it.data.to_vec(), it.wkc())).collect();
    let expected = heads.map(|head| (head, std::vec![head.number as u8; 4], if head.number < 2 { 2 } else { 1 }));
    assert_eq!(seen, expected);
}

// covers: FR-02, standby
#[test]
fn other_datagrams_in_a_master_frame_are_left_out() {
    let mut bytes = frame(&[(head(Area::Header, 0), 4), (head(Area::Inputs, 1), 4), (head(Area::Answer, 2), 4)]);
    let second = 16 + 12 + 16;
    bytes[second] = Command::Brd.code();
    let numbers: Vec<u16> = fragments_mut(&mut bytes).map(|it| it.head.number).collect();
    assert_eq!(numbers, [0, 2]);
}

// covers: 9.8, standby
#[test]
fn a_reader_takes_the_next_version_and_refuses_what_it_cannot_read() {
    let mut next = HEADER_BYTES.to_vec();
    next[4] = VERSION + 1;
    next.extend_from_slice(&[1, 2, 3, 4]);
    assert_eq!(Header::decode(&next), Ok(Header { version: VERSION + 1, ..header() }));
    next[5] = VERSION + 1;
    let error = Header::decode(&next).unwrap_err();
    assert_eq!(error, MasterFrameError::Version { least: VERSION + 1, got: VERSION + 1 });
    assert_eq!(error.to_string(), "master frames of version 2, readable from version 2 on: here is version 1");
    next[0] = b'X';
    assert_eq!(Header::decode(&next), Err(MasterFrameError::Magic(*b"XCmr")));
    assert!(Answer::decode(&next).is_err());
    assert!(format!("{:?}", NotReady(0x8001)).contains("no application"));
}

proptest! {
    // covers: 9.8, standby
    #[test]
    fn contents_of_areas_encode_back_to_the_bytes_that_they_were(
        bytes in proptest::collection::vec(any::<u8>(), 0..80),
        keep_magic in any::<bool>(),
    ) {
        let mut bytes = bytes;
        let mut out = [0; 96];
        for magic in [MAGIC, ANSWER_MAGIC] {
            if keep_magic && bytes.len() > 6 {
                bytes[..4].copy_from_slice(&magic);
                bytes[5] = 1;
            }
            if let Ok(header) = Header::decode(&bytes) {
                prop_assert_eq!(header.encode(&mut out), Some(Header::LEN));
                prop_assert_eq!(Header::decode(&out[..Header::LEN]), Ok(header));
            }
            if let Ok(answer) = Answer::decode(&bytes) {
                prop_assert_eq!(answer.encode(&mut out), Some(Answer::LEN));
                prop_assert_eq!(Answer::decode(&out[..Answer::LEN]), Ok(answer));
            }
        }
        if let Ok(diagnosis) = Diagnosis::decode(&bytes) {
            prop_assert_eq!(diagnosis.encode(&mut out), Some(Diagnosis::LEN));
            prop_assert_eq!(&out[..Diagnosis::LEN], &bytes[..Diagnosis::LEN]);
        }
        if let Ok(domain) = DomainRecord::decode(&bytes) {
            prop_assert_eq!(domain.encode(&mut out), Some(DomainRecord::LEN));
            prop_assert_eq!(&out[..DomainRecord::LEN], &bytes[..DomainRecord::LEN]);
        }
    }

    // covers: FR-10, 9.8, standby
    #[test]
    fn any_bytes_are_walked_without_a_change_but_to_data_and_counters(
        bytes in proptest::collection::vec(any::<u8>(), 0..200),
        head in any::<[u8; FragmentHead::LEN]>(),
    ) {
        prop_assert_eq!(FragmentHead::decode(&head).encode(), head);
        let mut frame = bytes.clone();
        if frame.len() > 27 {
            frame[12..14].copy_from_slice(&[0x88, 0xA4]);
            frame[15] = 0x10 | frame[15] & 0x07;
            frame[16] = 0;
            frame[18..22].copy_from_slice(&[0, 0, 0x55, 0x41]);
            // Short datagrams, mostly with more behind them.
            let length = 14 + frame[22] % 16;
            frame[22..24].copy_from_slice(&[length, 0x80]);
        }
        let before = frame.clone();
        let walked = fragments_mut(&mut frame).map(|mut fragment| {
            fragment.count();
            fragment.data.len() + FragmentHead::LEN + crate::datagram::OVERHEAD
        });
        let walked: Vec<usize> = walked.collect();
        prop_assert!(walked.iter().sum::<usize>() <= frame.len());
        let changed = before.iter().zip(&frame).filter(|(before, after)| before != after).count();
        prop_assert!(changed <= 2 * walked.len());
    }
}
