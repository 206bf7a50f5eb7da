//! Properties for any frame: no panic, and only fields that a controller may change are changed (protocol 1.5).

use super::*;
use proptest::prelude::*;
use ringcat_wire::command::Addressing;

/// Any frame: noise, or EtherCAT with datagrams that often address existing registers.
fn frames() -> impl Strategy<Value = Vec<u8>> {
    let address = prop_oneof![0u16..0x0200, 0x0300u16..0x0A00, 0x0F00u16..0x1040, any::<u16>()];
    let adp = prop_oneof![Just(0u16), any::<u16>()];
    let datagram = (0u8..=16, adp, address, prop::collection::vec(any::<u8>(), 0..40));
    let ethercat = prop::collection::vec(datagram, 1..8).prop_map(|datagrams| {
        let sent: Vec<Sent> = datagrams
            .iter()
            .map(|(code, adp, ado, data)| (Command::from_code(*code), *adp, *ado, data.as_slice()))
            .collect();
        frame_bytes(&sent)
    });
    let damaged = (ethercat.clone(), prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6))
        .prop_map(|(mut bytes, damage)| {
            let len = bytes.len();
            damage.iter().for_each(|(at, value)| bytes[at.index(len)] = *value);
            bytes
        });
    prop_oneof![4 => ethercat, 2 => damaged, 1 => prop::collection::vec(any::<u8>(), 0..200)]
}

fn fcs() -> impl Strategy<Value = Fcs> {
    prop_oneof![4 => Just(Fcs::Good), 1 => Just(Fcs::Bad), 1 => Just(Fcs::Marked)]
}

/// Clears the fields that a processing unit may change, so that the rest can be compared.
fn fixed_part(frame: &SimFrame) -> Vec<u8> {
    let mut bytes = frame.bytes.clone();
    if bytes.len() > 6 {
        bytes[6] |= 0x02;
    }
    if crate::frame::is_udp(&bytes) && bytes.len() >= 42 {
        bytes[40..42].fill(0);
    }
    for place in &frame.datagrams {
        let header = usize::from(place.header);
        let command = Command::from_code(bytes[header]);
        if matches!(command.addressing(), Addressing::AutoIncrement | Addressing::Broadcast) {
            bytes[header + 2..header + 4].fill(0);
        }
        bytes[header + 7] |= 0x40;
        bytes[header + 8..header + 10].fill(0xFF);
        if command.reads() {
            bytes[place.data()..place.wkc()].fill(0);
        }
        bytes[place.wkc()..place.end()].fill(0);
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    // covers: 1.5
    #[test]
    fn any_frames_pass_without_panic_and_keep_all_other_fields(
        run in prop::collection::vec((frames(), fcs(), 0usize..4, any::<bool>()), 1..40),
        links in any::<[bool; 4]>(),
    ) {
        let mut bench = Bench::new();
        for (port, up) in Port::ALL.into_iter().zip(links) {
            bench.link(port, up);
        }
        for (bytes, fcs, port, pdi) in run {
            let port = Port::ALL[port];
            let mut frame = SimFrame { fcs, ..SimFrame::new(bench.next_id, bytes) };
            bench.next_id += 1;
            let before = frame.clone();
            let passage = bench.receive(&mut frame, port);
            prop_assert_eq!(fixed_part(&before), fixed_part(&frame));
            if !matches!(passage, Passage::Leaves { processed: true, .. }) && frame.bytes != before.bytes {
                prop_assert!(false, "changed without processing: {passage:?}");
            }
            prop_assert_eq!(frame.fcs == Fcs::Good, fcs == Fcs::Good);
            if pdi {
                let at = u16::from(before.bytes.last().copied().unwrap_or(0)) * 16;
                bench.pdi_read(at, 20);
                bench.pdi_write(at, &[0x21; 9]);
            }
        }
    }

    // covers: 2.1
    #[test]
    fn a_frame_ends_or_passes_the_processing_unit_at_most_once(
        links in any::<[bool; 4]>(),
        loops in any::<u8>(),
        port in 0usize..4,
    ) {
        let mut bench = Bench::new();
        bench.write(0x0101, &[loops]);
        for (port, up) in Port::ALL.into_iter().zip(links) {
            bench.link(port, up);
        }
        let mut frame = bench.frame(&[(Command::Brd, 0, 0, &[0])]);
        let passage = bench.receive(&mut frame, Port::ALL[port]);
        let visits = returned(&frame, 0).1;
        prop_assert_eq!(visits, u16::from(matches!(passage, Passage::Leaves { processed: true, .. })));
    }
}
