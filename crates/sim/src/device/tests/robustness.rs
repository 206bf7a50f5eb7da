//! A device neither panics nor enters an invalid state, whatever a MainDevice writes.

use core::time::Duration;

use proptest::prelude::*;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::{Header, Protocol, next_counter};

use super::bench::Bench;
use super::client::Client;
use crate::catalogue;

/// A possible access of a MainDevice, valid or not.
#[derive(Clone, Debug)]
enum Act {
    Write(u16, Vec<u8>),
    Read(u16, usize),
    Pass(u64),
    Right,
    Hang(bool),
}

fn act() -> impl Strategy<Value = Act> {
    let bytes = prop::collection::vec(any::<u8>(), 1..40);
    let control = prop::sample::select(vec![0x01u8, 0x02, 0x03, 0x04, 0x08, 0x11, 0x12, 0x14, 0x18, 0x22, 0x07]);
    prop_oneof![
        4 => control.prop_map(|value| Act::Write(0x0120, vec![value, 0])),
        2 => (0x0800u16..0x0828, bytes.clone()).prop_map(|(address, data)| Act::Write(address, data)),
        2 => bytes.clone().prop_map(|mut data| {
            // A message with a plausible header of protocol CoE that fills the mailbox.
            data.resize(128, 0);
            data[..2].copy_from_slice(&[10, 0]);
            data[5] = data[5] & 0x70 | 0x03;
            data[7] = 0x20;
            Act::Write(0x1000, data)
        }),
        1 => (0x1000u16..0x1300, bytes).prop_map(|(address, data)| Act::Write(address, data)),
        2 => Just(Act::Read(0x1080, 128)),
        1 => (0u16..0x1300, 1usize..200).prop_map(|(address, length)| Act::Read(address, length)),
        2 => (0u64..4_000).prop_map(Act::Pass),
        2 => Just(Act::Right),
        1 => any::<bool>().prop_map(Act::Hang),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    // covers: robust
    #[test]
    fn any_sequence_of_writes_keeps_a_device_in_a_valid_state(
        name in prop::sample::select(catalogue::names().collect::<Vec<_>>()),
        acts in prop::collection::vec(act(), 0..60),
    ) {
        let mut bench = Bench::named(name);
        let emulated = bench.device.description.emulation;
        for act in acts {
            match act {
                Act::Write(address, data) => {
                    bench.try_write(RegisterAddress(address), &data);
                }
                Act::Read(address, length) => {
                    bench.try_read(RegisterAddress(address), length);
                }
                Act::Pass(us) => bench.pass(Duration::from_micros(us)),
                Act::Right => {
                    bench.try_set_all();
                }
                Act::Hang(hanging) => bench.device.hang(hanging, bench.now),
            }
            if !emulated {
                prop_assert!(bench.device.al_status().al_state().is_some());
            }
        }
        bench.device.hang(false, bench.now);
        bench.power_cycle();
        bench.climb(AlState::Op);
    }
}

/// A message of any protocol with a beginning that may be valid.
fn mail() -> impl Strategy<Value = (Protocol, Vec<u8>)> {
    let protocols = (0u8..16).prop_map(Protocol::from_code);
    let beginnings = prop::sample::select(vec![
        &[][..],
        // CoE: upload, download of 4096 bytes, segments, SDO information.
        &[0, 0x20, 0x40, 0x02, 0x20, 0],
        &[0, 0x20, 0x21, 0x02, 0x20, 0, 0, 0x10, 0, 0],
        &[0, 0x20, 0x10],
        &[0, 0x20, 0x60],
        &[0, 0x80, 1, 0, 0, 0],
        &[0, 0x80, 5, 0, 0, 0, 0x18, 0x10],
        // FoE: reading, writing, a packet, an acknowledgement, BUSY.
        b"\x01\0\0\0\0\0log.txt",
        b"\x02\0\0\0\0\0file",
        &[3, 0, 1, 0, 0, 0],
        &[4, 0, 1, 0, 0, 0],
        &[6, 0],
        // EoE: a whole frame, a first and a second fragment, addresses, a filter.
        &[0, 1, 0xC0, 0x00],
        &[0, 0, 0xC0, 0x00],
        &[0, 1, 0x41, 0x00],
        &[2, 1, 0, 0, 0xFF, 0, 0, 0],
        &[4, 1, 0, 0],
        // SoE: reading all elements, writing, a fragment.
        &[1, 0xFF, 36, 0],
        &[3, 0x40, 99, 0],
        &[0x0B, 0x40, 1, 0],
    ]);
    (protocols, beginnings, prop::collection::vec(any::<u8>(), 0..200)).prop_map(|(protocol, start, rest)| {
        let mut payload = start.to_vec();
        payload.extend(rest);
        (protocol, payload)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]
    // covers: 6, robust, sim-mailbox
    #[test]
    fn any_mail_is_answered_within_limits_and_the_device_continues(
        letters in prop::collection::vec((mail(), any::<bool>()), 0..60),
    ) {
        let mut client = Client::new("all-protocols", AlState::PreOp);
        for ((protocol, payload), fetch) in letters {
            let counter = next_counter(client.counter);
            // A full mailbox is a valid result too, but the device has not received the counter.
            if client.bench.send_mail(Header::new(protocol, counter, payload.len() as u16), &payload) {
                client.counter = counter;
            }
            client.bench.pass(Duration::from_millis(1));
            if fetch {
                client.bench.fetch_mail();
            }
        }
        let waiting = (0..2_000).find(|_| {
            client.bench.pass(Duration::from_micros(300));
            client.bench.fetch_mail().is_none()
        });
        prop_assert!(waiting.is_some(), "the device sends without end");
        prop_assert_eq!(client.upload(0x1018, 0), Ok(vec![4]));
    }
}
