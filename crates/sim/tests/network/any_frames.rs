//! No frame of a MainDevice crashes the simulator, and returned frames have the length of the sent ones.

use core::time::Duration;

use proptest::prelude::*;
use ringcat_sim::cable::{CableId, HostLink};
use ringcat_sim::catalogue;
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Header;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};

use crate::wiring::SETTLE;

/// One of each device of the catalogue in a ring, EEPROMs loaded.
fn everything() -> Network {
    let devices = catalogue::names().filter_map(catalogue::by_name).map(Device::new).collect();
    let mut network = SegmentBuilder::ring(devices).build().unwrap();
    network.advance_by(SETTLE);
    network
}

/// Registers with side effects, and any others.
fn place() -> impl Strategy<Value = u16> {
    prop_oneof![
        prop::sample::select(
            &[0x0010, 0x0040, 0x0100, 0x0108, 0x0120, 0x0200, 0x0400, 0x0500, 0x0502, 0x0600, 0x0800, 0x0808, 0x0900,]
                [..]
        ),
        0x0800u16..0x0880,
        0x1000u16..0x1200,
        any::<u16>(),
    ]
}

fn datagram() -> impl Strategy<Value = (u8, u16, u16, Vec<u8>)> {
    let length = prop_oneof![4 => 0usize..20, 1 => 20usize..600];
    let data = length.prop_flat_map(|length| prop::collection::vec(any::<u8>(), length));
    (0u8..16, prop_oneof![Just(0u16), Just(0xFFFF), 0u16..8, any::<u16>()], place(), data)
}

fn frame(datagrams: &[(u8, u16, u16, Vec<u8>)]) -> Vec<u8> {
    let mut buffer = vec![0; MAX_FRAME];
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, MacAddress::default()).unwrap();
    for (code, adp, ado, data) in datagrams {
        let header = Header {
            command: Command::from_code(*code),
            index: 0,
            address: u32::from(*adp) | u32::from(*ado) << 16,
            length: data.len() as u16,
            reserved: 0,
            circulating: false,
            more: false,
            irq: 0,
        };
        if let Some(at) = builder.header(header) {
            builder.data_mut(at, data.len()).unwrap().copy_from_slice(data);
        }
    }
    let length = builder.finish();
    buffer.truncate(length);
    buffer
}

/// Sends frames at short intervals and returns the lengths of the returned ones.
fn exchange(network: &mut Network, frames: &[Vec<u8>]) -> Vec<usize> {
    for frame in frames {
        for link in HostLink::ALL {
            network.send(link, frame);
        }
        network.advance_by(Duration::from_micros(300));
    }
    network.advance_by(Duration::from_millis(200));
    let lengths = HostLink::ALL.map(|link| {
        std::iter::from_fn(|| network.receive(link)).map(|received| received.bytes.len()).collect::<Vec<_>>()
    });
    lengths.concat()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    // covers: robust
    #[test]
    fn any_bytes_do_not_crash_the_simulator(
        frames in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 1..6),
    ) {
        let mut network = everything();
        exchange(&mut network, &frames);
    }

    // covers: robust
    #[test]
    fn any_datagrams_do_not_crash_the_simulator(
        frames in prop::collection::vec(prop::collection::vec(datagram(), 1..6), 1..12),
        corrupted in 0u32..4,
    ) {
        let mut network = everything();
        network.apply(Fault::Corrupt { cable: CableId(3), direction: None, count: corrupted });
        let frames: Vec<Vec<u8>> = frames.iter().map(|datagrams| frame(datagrams)).collect();
        let lengths = exchange(&mut network, &frames);
        prop_assert!(lengths.iter().all(|length| frames.iter().any(|frame| frame.len() == *length)));
    }
}
