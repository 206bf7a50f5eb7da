use super::*;

#[test]
fn a_capture_of_one_frame_has_the_expected_bytes() {
    let mut writer = Writer::new(Vec::new(), &[("eth0", "main")]).expect("writing to memory succeeds");
    writer
        .frame(0, Direction::Out, 0x0123_4567_89ab_cdef, &[0xaa, 0xbb, 0xcc, 0xdd, 0xee])
        .expect("writing to memory succeeds");
    #[rustfmt::skip]
    let expected = [
        // Section header: length 44, byte order, version 1.0, open length, application.
        0x0a, 0x0d, 0x0d, 0x0a, 44, 0, 0, 0, 0x4d, 0x3c, 0x2b, 0x1a, 1, 0, 0, 0,
        0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff,
        4, 0, 7, 0, b'R', b'i', b'n', b'g', b'C', b'A', b'T', 0, 0, 0, 0, 0, 44, 0, 0, 0,
        // Interface: length 48, Ethernet, no limit, name, description, resolution.
        1, 0, 0, 0, 48, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0,
        2, 0, 4, 0, b'e', b't', b'h', b'0', 3, 0, 4, 0, b'm', b'a', b'i', b'n',
        9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0, 48, 0, 0, 0,
        // Packet: length 52, interface 0, time high and low, both lengths, padded frame, outbound.
        6, 0, 0, 0, 52, 0, 0, 0, 0, 0, 0, 0, 0x67, 0x45, 0x23, 0x01, 0xef, 0xcd, 0xab, 0x89,
        5, 0, 0, 0, 5, 0, 0, 0, 0xaa, 0xbb, 0xcc, 0xdd, 0xee, 0, 0, 0,
        2, 0, 4, 0, 2, 0, 0, 0, 0, 0, 0, 0, 52, 0, 0, 0,
    ];
    assert_eq!(writer.into_inner(), expected);
}

#[test]
fn statistics_and_the_beginning_of_a_long_frame_have_the_expected_bytes() {
    let mut writer = Writer::new(Vec::new(), &[("a", "")]).expect("writing to memory succeeds");
    let before = writer.out.len();
    writer.beginning(0, Direction::In, 1 << 32, &[0xaa; 4], 9000).expect("writing to memory succeeds");
    let statistics = Statistics { seen: 7, dropped: 2, dropped_by_kernel: 0x0102 };
    writer.statistics(0, 5, statistics).expect("writing to memory succeeds");
    #[rustfmt::skip]
    let expected = [
        // Packet: length 48, interface 0, time, 4 bytes of 9000, inbound.
        6, 0, 0, 0, 48, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0, 0x28, 0x23, 0, 0,
        0xaa, 0xaa, 0xaa, 0xaa, 2, 0, 4, 0, 1, 0, 0, 0, 0, 0, 0, 0, 48, 0, 0, 0,
        // Statistics: length 64, interface 0, time, seen, dropped, dropped by the kernel.
        5, 0, 0, 0, 64, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0,
        4, 0, 8, 0, 7, 0, 0, 0, 0, 0, 0, 0, 5, 0, 8, 0, 2, 0, 0, 0, 0, 0, 0, 0,
        7, 0, 8, 0, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 64, 0, 0, 0,
    ];
    assert_eq!(writer.into_inner()[before..], expected);
}

/// Kind and body of each block; checks both lengths.
fn blocks(mut bytes: &[u8]) -> Vec<(u32, Vec<u8>)> {
    let word = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
    let mut blocks = Vec::new();
    while !bytes.is_empty() {
        let length = word(bytes, 4) as usize;
        assert_eq!(length % 4, 0);
        assert_eq!(word(bytes, length - 4) as usize, length);
        blocks.push((word(bytes, 0), bytes[8..length - 4].to_vec()));
        bytes = &bytes[length..];
    }
    blocks
}

#[test]
fn frames_of_two_interfaces_are_read_back_with_length_direction_and_time() {
    let mut writer = Writer::new(Vec::new(), &[("a", ""), ("bc", "red")]).expect("writing to memory succeeds");
    let frames: Vec<(usize, Direction, u64, Vec<u8>)> = (0..70u8)
        .map(|i| {
            let direction = if i % 3 == 0 { Direction::In } else { Direction::Out };
            (usize::from(i) % 2, direction, 1_700_000_000_000_000_000 + u64::from(i), vec![i; usize::from(i)])
        })
        .collect();
    for (interface, direction, time, frame) in &frames {
        writer.frame(*interface, *direction, *time, frame).expect("writing to memory succeeds");
    }
    let blocks = blocks(&writer.into_inner());
    let kinds: Vec<u32> = blocks.iter().map(|(kind, _)| *kind).take(4).collect();
    assert_eq!(kinds, [SECTION_HEADER, INTERFACE_DESCRIPTION, INTERFACE_DESCRIPTION, ENHANCED_PACKET]);
    assert_eq!(blocks.len(), 3 + frames.len());
    for ((_, body), (interface, direction, time, frame)) in blocks[3..].iter().zip(&frames) {
        let word = |at: usize| u32::from_le_bytes(body[at..at + 4].try_into().expect("four bytes"));
        assert_eq!(word(0) as usize, *interface);
        assert_eq!(u64::from(word(4)) << 32 | u64::from(word(8)), *time);
        assert_eq!((word(12) as usize, word(16) as usize), (frame.len(), frame.len()));
        assert_eq!(&body[20..20 + frame.len()], frame);
        let options = 20 + frame.len().next_multiple_of(4);
        assert_eq!(word(options), 0x0004_0002);
        assert_eq!(word(options + 4), direction.flags());
        assert_eq!((word(options + 8), body.len()), (0, options + 12));
    }
}

#[test]
fn a_frame_of_an_interface_that_was_not_declared_is_refused() {
    let mut writer = Writer::new(Vec::new(), &[("a", "")]).expect("writing to memory succeeds");
    let error = writer.frame(1, Direction::In, 0, &[]).expect_err("there is no interface 1");
    assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
}
