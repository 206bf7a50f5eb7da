//! Literal vectors and properties of frames.

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::address::{LogicalAddress, RegisterAddress};

const SOURCE: MacAddress = MacAddress([0x00, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);

fn brd_al_status() -> ([u8; MIN_FRAME], usize) {
    let mut buffer = [0xEE; MIN_FRAME];
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, SOURCE).unwrap();
    builder.datagram(Command::Brd, 0x11, Target::Broadcast(RegisterAddress(0x0130)), 2).unwrap();
    let length = builder.finish();
    (buffer, length)
}

// covers: 1.1, 1.2, codec-frames
#[test]
fn a_broadcast_read_of_al_status_has_the_expected_bytes() {
    let mut expected = vec![
        0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x00, 0x76, 0x0E, 0x01, 0xBD, 0x9A, 0x88, 0xA4, 0x0E, 0x10, 0x07, 0x11,
        0x00, 0x00, 0x30, 0x01, 0x02, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    ];
    expected.resize(MIN_FRAME, 0);
    let (buffer, length) = brd_al_status();
    assert_eq!(&buffer[..length], &expected[..]);
}

// covers: 1.3, codec-frames
#[test]
fn lengths_are_those_of_the_printed_traces() {
    // protocol 1.3, check values: n commands / sum of data -> frame length without FCS.
    assert_eq!(frame_len([59, 0, 0, 0, 0, 0, 0, 0]), 171);
    assert_eq!(frame_len([74, 0, 0, 0, 0, 0, 0]), 174);
    assert_eq!(frame_len([65, 1409]), 1514);
    assert_eq!(frame_len([1486]), 1514);
    assert_eq!(frame_len([787, 44, 13]), 896);
    assert_eq!(frame_len([2]), 60);
}

// covers: 1.3, codec-frames
#[test]
fn a_full_frame_takes_123_microseconds() {
    assert_eq!(wire_time_ns(MAX_FRAME), 123_040);
}

// covers: 1.3, codec-frames
#[test]
fn one_datagram_has_at_most_1486_bytes() {
    let mut buffer = [0; MAX_FRAME];
    let target = Target::Logical(LogicalAddress(0));
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, SOURCE).unwrap();
    assert_eq!(builder.room(), Some(1486));
    assert_eq!(builder.datagram(Command::Lrd, 0, target, 1487), None);
    assert!(builder.datagram(Command::Lrd, 0, target, 1486).is_some());
    assert_eq!(builder.room(), None);
    assert_eq!(builder.finish(), MAX_FRAME);
}

// covers: 1.3, codec-frames
#[test]
fn a_vlan_tag_is_read_and_kept() {
    let mut buffer = [0; 100];
    let tag = Encapsulation::Vlan { tci: 0xE005 };
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress::ETHERCAT_GROUP, SOURCE, &tag).unwrap();
    builder.datagram(Command::Brd, 1, Target::Broadcast(RegisterAddress(0)), 1).unwrap();
    let length = builder.finish();
    assert_eq!(&buffer[12..20], &[0x81, 0x00, 0xE0, 0x05, 0x88, 0xA4, 0x0D, 0x10]);
    let frame = Frame::parse(&buffer[..length]).unwrap();
    assert_eq!(frame.encapsulation, tag);
    assert_eq!(frame.datagrams().count(), 1);
}

// covers: 1.3, codec-frames
#[test]
fn ethercat_in_udp_is_read_and_kept() {
    let mut headers = [0; 28];
    headers[0] = 0x45;
    headers[9] = 17;
    headers[22..24].copy_from_slice(&UDP_PORT.to_be_bytes());
    let wrapping = Encapsulation::Udp { headers };
    let mut buffer = [0; 100];
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress::BROADCAST, SOURCE, &wrapping).unwrap();
    builder.datagram(Command::Nop, 1, Target::None, 4).unwrap();
    let length = builder.finish();
    let frame = Frame::parse(&buffer[..length]).unwrap();
    assert_eq!(frame.encapsulation, wrapping);
    assert_eq!(frame.datagrams().next().unwrap().data.len(), 4);
    buffer[23] = 6; // TCP
    assert_eq!(Frame::parse(&buffer[..length]), Err(FrameError::NotEthercatUdp));
}

// covers: codec-frames
#[test]
fn errors_contain_the_expected_and_the_received_value() {
    let (mut buffer, length) = brd_al_status();
    assert_eq!(
        Frame::parse(&buffer[..13]),
        Err(FrameError::Short { part: "the Ethernet header", expected: 14, got: 13 })
    );
    buffer[22] = 3;
    assert_eq!(Frame::parse(&buffer[..length]), Err(FrameError::Datagram { offset: 16, expected: 15, got: 14 }));
    buffer[22] = 2;
    buffer[12] = 0x86;
    buffer[13] = 0xDD;
    assert_eq!(Frame::parse(&buffer[..length]), Err(FrameError::NotEthercat { ethertype: 0x86DD }));
    buffer[12] = 0x88;
    buffer[13] = 0xA4;
    buffer[14] = 45;
    assert_eq!(Frame::parse(&buffer[..length]), Err(FrameError::Length { announced: 45, got: 44 }));
}

#[test]
fn padding_within_the_header_length_is_surplus_and_kept() {
    let (mut buffer, length) = brd_al_status();
    buffer[14] = 44;
    buffer[40] = 7;
    let frame = Frame::parse(&buffer[..length]).unwrap();
    assert_eq!((frame.payload.len(), frame.surplus.len(), frame.padding.len()), (14, 30, 0));
    assert_eq!(frame.datagrams().count(), 1);
    let mut again = [0; MIN_FRAME];
    assert_eq!(frame.encode(&mut again), Some(length));
    assert_eq!(again, buffer);
}

// covers: 1.1, codec-frames
#[test]
fn other_ethercat_types_are_kept_as_bytes() {
    let (mut buffer, length) = brd_al_status();
    buffer[15] = 0x40; // network variables
    let frame = Frame::parse(&buffer[..length]).unwrap();
    assert_eq!(frame.ethercat_type, EthercatType::Other(4));
    assert_eq!(frame.datagrams().count(), 0);
    let mut again = [0; MIN_FRAME];
    assert_eq!(frame.encode(&mut again), Some(length));
    assert_eq!(again, buffer);
}

proptest! {
    // covers: codec-frames
    #[test]
    fn parsing_any_bytes_never_panics_and_parsed_frames_encode_back(
        mut bytes in proptest::collection::vec(any::<u8>(), 0..200),
        ethertype in 0..4u8,
    ) {
        if bytes.len() > 24 && ethertype < 3 {
            let value = [ETHERTYPE, ETHERTYPE_VLAN, ETHERTYPE_IPV4][usize::from(ethertype)];
            bytes[12..14].copy_from_slice(&value.to_be_bytes());
            bytes[16..18].copy_from_slice(&ETHERTYPE.to_be_bytes());
        }
        if let Ok(frame) = Frame::parse(&bytes) {
            let mut again = vec![0; bytes.len()];
            prop_assert_eq!(frame.encode(&mut again), Some(bytes.len()));
            prop_assert_eq!(again, bytes);
        }
    }

    // covers: codec-frames
    #[test]
    fn built_frames_parse_back(
        datagrams in proptest::collection::vec((0..15u8, any::<u8>(), any::<u32>(), 0..60usize), 1..8),
    ) {
        let mut buffer = [0xAA; MAX_FRAME];
        let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, SOURCE).unwrap();
        for &(code, index, address, length) in &datagrams {
            let plain = Header::new(Command::from_code(code), index, Target::None, length as u16);
            let header = Header { address, ..plain };
            let at = builder.header(header).unwrap();
            builder.data_mut(at, length).unwrap().fill(index);
        }
        let length = builder.finish();
        prop_assert_eq!(length, frame_len(datagrams.iter().map(|d| d.3)));
        let frame = Frame::parse(&buffer[..length]).unwrap();
        let parsed: Vec<_> = frame.datagrams().collect();
        prop_assert_eq!(parsed.len(), datagrams.len());
        for (datagram, &(code, index, address, length)) in parsed.iter().zip(&datagrams) {
            prop_assert_eq!(datagram.header.command.code(), code);
            prop_assert_eq!(datagram.header.index, index);
            prop_assert_eq!(datagram.header.address, address);
            prop_assert_eq!(datagram.data, &vec![index; length][..]);
            prop_assert_eq!(datagram.wkc, Wkc(0));
        }
    }
}
