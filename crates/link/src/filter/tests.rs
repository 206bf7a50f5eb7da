use super::*;

/// Runs a program on a frame as the kernel does; returns the number of bytes that pass.
fn run(program: &[libc::sock_filter], frame: &[u8]) -> u32 {
    let (mut at, mut accumulator) = (0, 0u32);
    loop {
        let libc::sock_filter { code, jt, jf, k } = program[at];
        at += 1;
        let load = |size: usize| frame.get(k as usize..k as usize + size);
        match code {
            LOAD_HALF => match load(2) {
                Some(bytes) => accumulator = u32::from(u16::from_be_bytes([bytes[0], bytes[1]])),
                None => return 0,
            },
            LOAD_BYTE => match load(1) {
                Some(bytes) => accumulator = u32::from(bytes[0]),
                None => return 0,
            },
            JUMP_EQUAL => at += usize::from(if accumulator == k { jt } else { jf }),
            JUMP_SET => at += usize::from(if accumulator & k != 0 { jt } else { jf }),
            JUMP => at += k as usize,
            RETURN => return k,
            other => panic!("instruction {other:#06x} is not implemented in this test"),
        }
    }
}

fn passes(filter: ClassFilter, frame: &[u8]) -> bool {
    let program = program(filter);
    assert!(program.iter().enumerate().all(|(at, i)| at + 1 + usize::from(i.jt.max(i.jf)) <= program.len()));
    let length = run(&program, frame);
    assert!(length == 0 || length as usize >= frame.len(), "a frame passes completely or not at all");
    length != 0
}

/// Broadcast with a datagram BRD of AL_STATUS with this Idx.
fn ethercat(idx: u8) -> Vec<u8> {
    let mut frame = vec![0xff; 6];
    frame.extend([0x02, 0, 0, 0, 0, 1, 0x88, 0xa4, 0x0e, 0x10, 0x07, idx, 0, 0, 0x30, 0x01, 2, 0, 0, 0, 0, 0, 0, 0]);
    frame.resize(60, 0);
    frame
}

fn tagged(mut frame: Vec<u8>, tag: [u8; 4]) -> Vec<u8> {
    frame.splice(12..12, tag);
    frame
}

#[test]
fn both_classes_pass_the_filter_for_all() {
    for idx in [0, 0x7f, 0x80, 0xff] {
        assert!(passes(ClassFilter::All, &ethercat(idx)), "{idx:#x}");
    }
}

#[test]
fn the_class_bit_of_the_first_idx_decides_which_class_filter_a_frame_passes() {
    for (idx, acyclic) in [(0, false), (0x7f, false), (0x80, true), (0xff, true)] {
        assert_eq!(passes(ClassFilter::Acyclic, &ethercat(idx)), acyclic, "{idx:#x}");
        assert_eq!(passes(ClassFilter::Cyclic, &ethercat(idx)), !acyclic, "{idx:#x}");
    }
}

#[test]
fn a_frame_with_one_vlan_tag_is_filtered_by_the_idx_behind_the_tag() {
    for (idx, acyclic) in [(0x01, false), (0x81, true)] {
        let frame = tagged(ethercat(idx), [0x81, 0x00, 0xe0, 0x05]);
        assert!(passes(ClassFilter::All, &frame));
        assert_eq!(passes(ClassFilter::Acyclic, &frame), acyclic);
        assert_eq!(passes(ClassFilter::Cyclic, &frame), !acyclic);
    }
}

#[test]
fn other_traffic_never_passes() {
    let with_type = |ether_type: [u8; 2]| {
        let mut frame = ethercat(0x80);
        frame[12..14].copy_from_slice(&ether_type);
        frame
    };
    let others = [
        ("IPv4", with_type([0x08, 0x00])),
        ("ARP", with_type([0x08, 0x06])),
        ("IPv6", with_type([0x86, 0xdd])),
        ("Profinet", with_type([0x88, 0x92])),
        ("tagged IPv4", tagged(with_type([0x08, 0x00]), [0x81, 0x00, 0, 5])),
        ("two tags", tagged(tagged(ethercat(0x80), [0x81, 0x00, 0, 5]), [0x81, 0x00, 0, 6])),
        ("service tag", tagged(ethercat(0x80), [0x88, 0xa8, 0, 5])),
    ];
    for (name, frame) in others {
        for filter in [ClassFilter::All, ClassFilter::Cyclic, ClassFilter::Acyclic] {
            assert!(!passes(filter, &frame), "{name} passes {filter:?}");
        }
    }
}

#[test]
fn frames_that_end_before_the_idx_do_not_pass() {
    let frame = ethercat(0);
    for length in 0..18 {
        assert!(!passes(ClassFilter::All, &frame[..length]), "{length}");
    }
    assert!(passes(ClassFilter::Cyclic, &frame[..18]));
}
