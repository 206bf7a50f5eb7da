//! Inputs of one SubDevice that are copied to outputs of another within the cycle: across domains, during cuts, while
//! the source is absent.

use std::time::Duration;

use ringcat::{
    CopyRule, DomainConfig, DomainId, DomainMember, Entry, Freshness, Options, Scan, SubDeviceId, WhenStale, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use scenarios::segments::{descriptions, ring};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 5] = ["coupler", "digital-input-8", "digital-output-8", "digital-input-16", "digital-output-16"];
const FAST_IN: usize = 1;
const FAST_OUT: usize = 2;
const SLOW_IN: usize = 3;
const OUT_16: usize = 4;

/// All SubDevices in one domain except the 16 inputs, which are in a domain with four times the period.
fn world(seed: u64) -> World {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let member = DomainMember::new;
        declaration.domains = vec![
            DomainConfig::new(
                CYCLE,
                vec![member(SubDeviceId(FAST_IN)), member(SubDeviceId(FAST_OUT)), member(SubDeviceId(OUT_16))],
            ),
            DomainConfig::new(4 * CYCLE, vec![member(SubDeviceId(SLOW_IN))]),
        ];
        declaration
    };
    let network = ring(descriptions(&KINDS), options);
    let mut world = World::with(seed, network, &Options::default(), declare).expect("activation");
    // Inputs are changed directly in the device.
    world.evaluate_latched(false);
    world
}

/// The whole of a SubDevice's process data.
fn whole(world: &World, subdevice: usize) -> Entry {
    let area = &world.application().directory().areas(SubDeviceId(subdevice))[0];
    let bit_length = 8 * area.placed.area.length;
    Entry { domain: area.domain, bit_offset: 8 * area.placed.image_offset, bit_length }
}

fn bits(of: Entry, first: u32, bit_length: u16) -> Entry {
    Entry { bit_offset: of.bit_offset + first, bit_length, ..of }
}

fn outputs(world: &World, device: usize) -> u16 {
    let bytes = world.network().device(DeviceIndex(device)).outputs();
    u16::from(bytes[0]) | bytes.get(1).map_or(0, |high| u16::from(*high) << 8)
}

// covers: copy
#[test]
fn inputs_become_outputs_of_another_subdevice_in_the_same_cycle_across_cuts() {
    let mut world = world(1);
    let (fast, slow) = (whole(&world, FAST_IN), whole(&world, SLOW_IN));
    let (out, wide) = (whole(&world, FAST_OUT), whole(&world, OUT_16));
    let rules = [
        CopyRule::new(bits(fast, 1, 6), bits(out, 2, 6)),
        // From the slow domain into the fast one, across a byte boundary.
        CopyRule::new(bits(slow, 3, 12), bits(wide, 2, 12)),
    ];
    world.application_mut().set_copies(&rules).expect("inputs to outputs");
    world.settle();
    let mark = world.mark();
    for cycle in 0..400u16 {
        let (a, b) = ((cycle * 37) as u8, cycle.wrapping_mul(2_749));
        let network = world.network_mut();
        network.device_mut(DeviceIndex(FAST_IN)).set_inputs(&[a]);
        network.device_mut(DeviceIndex(SLOW_IN)).set_inputs(&b.to_le_bytes());
        match cycle {
            100 => world.cut(CableId(2)),
            200 => world.heal(CableId(2)),
            _ => {}
        }
        let (read, seen) = world.cycle_with(|data| {
            let fresh = data.freshness(DomainId(0), SubDeviceId(FAST_IN)) == Freshness::Fresh;
            ((data.read(&fast) as u16, data.read(&slow) as u16), fresh)
        });
        // Inputs read in a cycle have reached the outputs when the next one begins.
        world.network_mut().advance_by(Duration::from_micros(300));
        if seen && !(100..110).contains(&cycle) && !(200..210).contains(&cycle) {
            assert_eq!(outputs(&world, FAST_OUT) >> 2, read.0 >> 1 & 0x3F, "cycle {cycle}");
            assert_eq!(outputs(&world, OUT_16) >> 2 & 0xFFF, read.1 >> 3 & 0xFFF, "cycle {cycle}");
        }
    }
    assert_eq!(world.left_op(mark), []);
    let refused = world.application().cyclic_counters().stale_copies;
    println!("{refused} words refused at start and around a cut and a healing");
}

// covers: copy
#[test]
fn outputs_hold_or_are_zero_while_their_source_is_away_and_follow_it_again() {
    let mut world = world(2);
    let (fast, slow) = (whole(&world, FAST_IN), whole(&world, SLOW_IN));
    let (out, wide) = (whole(&world, FAST_OUT), whole(&world, OUT_16));
    let zero = CopyRule::new(slow, wide).with_when_stale(WhenStale::Zero);
    world.application_mut().set_copies(&[CopyRule::new(fast, out), zero]).expect("inputs to outputs");
    world.settle();
    let feed = |world: &mut World, value: u8| {
        let network = world.network_mut();
        network.device_mut(DeviceIndex(FAST_IN)).set_inputs(&[value]);
        network.device_mut(DeviceIndex(SLOW_IN)).set_inputs(&[value, !value]);
        world.run_cycles(12);
    };
    feed(&mut world, 0x5A);
    assert_eq!((outputs(&world, FAST_OUT), outputs(&world, OUT_16)), (0x5A, 0xA55A));
    world.power_off(DeviceIndex(FAST_IN));
    world.power_off(DeviceIndex(SLOW_IN));
    // One cycle until the loss is detected, and the period of the slow domain.
    world.run_cycles(10);
    assert_eq!((outputs(&world, FAST_OUT), outputs(&world, OUT_16)), (0x5A, 0));
    let exchange = world.application().exchange();
    assert!(exchange.is_copy_stale(ringcat::CopyId(0)) && exchange.is_copy_stale(ringcat::CopyId(1)));
    world.power_on(DeviceIndex(FAST_IN));
    world.power_on(DeviceIndex(SLOW_IN));
    world.settle();
    feed(&mut world, 0xC3);
    assert_eq!((outputs(&world, FAST_OUT), outputs(&world, OUT_16)), (0xC3, 0x3CC3));
    let exchange = world.application().exchange();
    assert!(!exchange.is_copy_stale(ringcat::CopyId(0)) && !exchange.is_copy_stale(ringcat::CopyId(1)));
}
