//! Copies between two domains of two SubDevices, three bytes each way.

use std::string::ToString;
use std::vec;

use proptest::prelude::*;
use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::MacCodec;

use super::*;
use crate::board::Board;
use crate::direction::Direction;
use crate::domain::DomainId;
use crate::exchange::Exchange;
use crate::layout::{AreaSpec, DomainSpec, ImageOrder, Layout};
use crate::link::{Link, LinkSet};
use crate::queue::queue;
use crate::ring::Identity;
use crate::time::Instant;

const BYTES: u16 = 30;
/// First bit of the inputs of each domain.
const INPUTS: u32 = BYTES as u32 * 8;

fn exchange() -> Exchange {
    let spec = |subdevice| {
        let area = |direction| AreaSpec { subdevice, sync_manager: direction as u8, direction, length: BYTES };
        let areas = vec![area(Direction::Outputs), area(Direction::Inputs)];
        DomainSpec {
            period: core::time::Duration::from_millis(1),
            under_way: 1,
            lrw: true,
            areas,
            image: ImageOrder::Packed,
        }
    };
    let layout = Layout::new(&[spec(0), spec(1)], LinkSet::Single, false).unwrap();
    let board = alloc::sync::Arc::new(Board::new(2));
    (0..2).for_each(|subdevice| board.set_taking_part(subdevice, true));
    let identity = Identity::new(MacCodec::FlagsFirst, MacAddress([0, 1, 2, 3, 4, 5]), None);
    Exchange::new(identity, LinkSet::Single, &layout, board, queue(4).0)
}

fn entry(domain: usize, bit_offset: u32, bit_length: u16) -> Entry {
    Entry { domain: DomainId(domain), bit_offset, bit_length }
}

/// One cycle: evaluates, queues, sends; each SubDevice answers with these inputs, `None` for no answer. Returns the
/// outputs that left.
fn cycle(exchange: &mut Exchange, now: &mut Instant, inputs: [Option<&[u8]>; 2]) -> [Vec<u8>; 2] {
    now.0 += 1_000_000;
    for domain in [0, 1] {
        exchange.process(DomainId(domain), *now);
        exchange.queue(DomainId(domain), *now);
    }
    let mut sent = Vec::new();
    exchange.send(*now, &mut |_, bytes| sent.push(bytes.to_vec()));
    let outputs = [0, 1].map(|domain: usize| sent[domain][26..26 + usize::from(BYTES)].to_vec());
    for (mut frame, inputs) in sent.into_iter().zip(inputs) {
        let Some(inputs) = inputs else { continue };
        let at = 26 + usize::from(BYTES);
        frame[at..at + inputs.len()].copy_from_slice(inputs);
        frame[at + usize::from(BYTES)] = 3;
        exchange.receive(Link::Main, &frame, *now);
    }
    outputs
}

// covers: copy
#[test]
fn copied_inputs_leave_with_the_cycle_whatever_the_application_wrote() {
    let (mut exchange, mut now) = (exchange(), Instant(0));
    // Eleven bits at bit 3 of SubDevice 0 to bit 5 of SubDevice 1.
    exchange.set_copies(&[CopyRule::new(entry(0, INPUTS + 3, 11), entry(1, 5, 11))]).unwrap();
    let first = cycle(&mut exchange, &mut now, [Some(&[0xFF, 0xFF]), Some(&[])]);
    assert_eq!((&first[1][..2], exchange.is_copy_stale(CopyId(0))), (&[0, 0][..], true));
    exchange.image_mut(DomainId(1))[..3].fill(0xA5);
    let second = cycle(&mut exchange, &mut now, [Some(&[0, 0]), Some(&[])]);
    // 0xA5 with bits 5 to 15 set.
    assert_eq!((&second[1][..3], exchange.is_copy_stale(CopyId(0))), (&[0xE5, 0xFF, 0xA5][..], false));
    let third = cycle(&mut exchange, &mut now, [Some(&[0, 0]), Some(&[])]);
    assert_eq!(third[1][..3], [0x05, 0x00, 0xA5]);
    assert_eq!(exchange.counters().stale_copies, 1);
}

// covers: copy
#[test]
fn a_stale_source_is_refused_its_target_holds_the_last_value_or_is_zero() {
    let (mut exchange, mut now) = (exchange(), Instant(0));
    let hold = CopyRule::new(entry(0, INPUTS, 8), entry(1, 0, 8));
    let zero = CopyRule { when_stale: WhenStale::Zero, ..CopyRule::new(entry(0, INPUTS + 8, 8), entry(1, 8, 8)) };
    let older = CopyRule { max_age: 2, ..CopyRule::new(entry(0, INPUTS + 16, 8), entry(1, 16, 8)) };
    let to_outputs =
        CopyRule { max_age: 2, when_stale: WhenStale::Zero, ..CopyRule::new(entry(0, INPUTS, 8), entry(0, 0, 8)) };
    exchange.set_copies(&[hold, zero, older, to_outputs]).unwrap();
    cycle(&mut exchange, &mut now, [Some(&[1, 2, 3]), Some(&[])]);
    let fresh = cycle(&mut exchange, &mut now, [None, Some(&[])]);
    assert_eq!((&fresh[1][..3], fresh[0][0]), (&[1, 2, 3][..], 1));
    for age in 1..5u64 {
        // The application cannot write a value of its own there.
        exchange.image_mut(DomainId(1))[..3].fill(0x77);
        let outputs = cycle(&mut exchange, &mut now, [None, Some(&[])]);
        assert_eq!(outputs[1][..3], [1, 0, 3]);
        assert_eq!(outputs[0][0], if age <= 2 { 1 } else { 0 }, "age {age}");
        let stale = [0, 1, 2].map(|rule| exchange.is_copy_stale(CopyId(rule)));
        assert_eq!(stale, [true, true, age > 2]);
    }
    cycle(&mut exchange, &mut now, [Some(&[7, 8, 9]), Some(&[])]);
    assert_eq!(cycle(&mut exchange, &mut now, [None, None])[1][..3], [7, 8, 9]);
}

// covers: copy
#[test]
fn a_table_that_makes_no_sense_is_refused_and_the_one_before_stays() {
    let mut exchange = exchange();
    let good = CopyRule::new(entry(0, INPUTS, 8), entry(1, 0, 8));
    exchange.set_copies(&[good]).unwrap();
    let rule = |source, target| exchange_error(&[good, CopyRule::new(source, target)]);
    assert_eq!(rule(entry(0, 0, 8), entry(1, 8, 8)), CopyError::Source { rule: CopyId(1) });
    assert_eq!(rule(entry(0, INPUTS - 1, 8), entry(1, 8, 8)), CopyError::Source { rule: CopyId(1) });
    assert_eq!(rule(entry(0, 2 * INPUTS - 7, 8), entry(1, 8, 8)), CopyError::Source { rule: CopyId(1) });
    assert_eq!(rule(entry(9, INPUTS, 8), entry(1, 8, 8)), CopyError::Source { rule: CopyId(1) });
    assert_eq!(rule(entry(0, INPUTS, 8), entry(1, INPUTS, 8)), CopyError::Target { rule: CopyId(1) });
    assert_eq!(rule(entry(0, INPUTS, 8), entry(9, 8, 8)), CopyError::Target { rule: CopyId(1) });
    assert_eq!(rule(entry(0, INPUTS, 8), entry(1, 7, 8)), CopyError::Overlap { rule: CopyId(1), with: CopyId(0) });
    let length = CopyError::Length { rule: CopyId(1), source: 8, target: 7 };
    assert_eq!(rule(entry(0, INPUTS, 8), entry(1, 8, 7)), length);
    assert_eq!(length.to_string(), "copy 1: expected as many bits in source and target, got 8 and 7");
    assert_eq!(rule(entry(0, INPUTS, 0), entry(1, 8, 0)), CopyError::Length { rule: CopyId(1), source: 0, target: 0 });
    assert!(exchange.set_copies(&[good, good]).is_err());
    let mut now = Instant(0);
    cycle(&mut exchange, &mut now, [Some(&[5]), Some(&[])]);
    assert_eq!(cycle(&mut exchange, &mut now, [None, None])[1][0], 5);
}

fn exchange_error(rules: &[CopyRule]) -> CopyError {
    exchange().set_copies(rules).expect_err("it makes no sense")
}

proptest! {
    // covers: copy
    #[test]
    fn any_bits_are_copied_and_no_other_bit_changes(
        inputs in any::<[u8; 30]>(), outputs in any::<[u8; 30]>(),
        (from, to, length) in (1u16..=240).prop_flat_map(|length| {
            let last = 240 - u32::from(length);
            (0..=last, 0..=last, Just(length))
        }),
    ) {
        let (mut exchange, mut now) = (exchange(), Instant(0));
        exchange.set_copies(&[CopyRule::new(entry(0, INPUTS + from, length), entry(1, to, length))]).unwrap();
        cycle(&mut exchange, &mut now, [Some(&inputs), Some(&[])]);
        exchange.image_mut(DomainId(1))[..30].copy_from_slice(&outputs);
        let sent = cycle(&mut exchange, &mut now, [None, None]);
        let bit = |bytes: &[u8], at: u32| bytes[at as usize / 8] >> (at % 8) & 1;
        for at in 0..240 {
            let copied = (to..to + u32::from(length)).contains(&at);
            let expected = if copied { bit(&inputs, from + at - to) } else { bit(&outputs, at) };
            prop_assert_eq!(bit(&sent[1], at), expected);
        }
    }
}
