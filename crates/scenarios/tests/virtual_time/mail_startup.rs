//! Start-up lists of many drives at once: how their mail shares the wire.

use std::time::Duration;

use ringcat::{Options, Scan, automatic};
use ringcat_sim::network::NetworkOptions;
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const DRIVES: usize = 100;
const OBJECTS: u32 = 50;
/// Nanoseconds of a byte at 100 Mbit/s.
const BYTE_NS: u64 = 80;
/// Bytes of a frame that a counter does not see: preamble, FCS, gap.
const FRAME_OVERHEAD: u64 = 24;

/// From activation to OP, and the wire time of all acyclic frames meanwhile.
fn start_up(drives: usize, objects: u32) -> (Duration, Duration) {
    let mut devices = descriptions(&vec!["servo"; drives]);
    for device in &mut devices {
        device.mailbox.as_mut().expect("it has one").response_time = Duration::from_millis(1);
    }
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        for config in &mut declaration.subdevices {
            for number in 0..objects {
                *config = config.clone().sdo(0x6065, 0, number.to_le_bytes());
            }
        }
        declaration
    };
    let network = line(devices, NetworkOptions::default());
    let mut world = World::with(1, network, &Options::default(), declare).expect("activation");
    let (start, before) = (world.now(), world.application().acyclic_counters());
    world.settle();
    let after = world.application().acyclic_counters();
    let (mut empty, mut looks) = (0, 0);
    for drive in 0..drives {
        let counters = world.mailbox(drive).counters();
        assert_eq!(counters.unclaimed, 0);
        empty += counters.empty_reads;
        looks += counters.looks;
    }
    println!("{drives} drives, {objects} objects each: {empty} empty reads, {looks} looks");
    let bytes = after.bytes - before.bytes + (after.sent - before.sent) * FRAME_OVERHEAD;
    (world.now() - start, Duration::from_nanos(bytes * BYTE_NS))
}

#[test]
fn a_hundred_drives_with_fifty_objects_each_start_in_little_more_than_one_of_them() {
    let (nothing, _) = start_up(DRIVES, 0);
    let (one, _) = start_up(1, OBJECTS);
    let (all, wire) = start_up(DRIVES, OBJECTS);
    let ratio = all.as_secs_f64() / one.max(wire).as_secs_f64();
    println!(
        "activation to OP: {DRIVES} drives without objects {} ms; with {OBJECTS} objects each, 1 ms per answer: one drive \
         {} ms, {DRIVES} drives {} ms, wire time of their frames {} ms, ratio to the larger {ratio:.2}",
        nothing.as_millis(),
        one.as_millis(),
        all.as_millis(),
        wire.as_millis()
    );
    assert!(ratio < 2.5, "{ratio}");
}
