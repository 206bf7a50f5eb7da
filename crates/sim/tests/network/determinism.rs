//! The same seed gives the same run, bit for bit; and the steady state reuses its buffers.

use core::time::Duration;

use ringcat_sim::cable::HostLink::{Main, Redundant};
use ringcat_sim::cable::{CableId, DeviceIndex, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use crate::wiring::{command, probe, ring, segment, segment_with, shortest};

/// FNV-1a of all received frames with their times.
fn digest(network: &mut Network, digest: &mut u64) {
    let mut feed = |bytes: &[u8]| {
        for byte in bytes {
            *digest = (*digest ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
    };
    for link in HostLink::ALL {
        while let Some(received) = network.receive(link) {
            feed(&[link as u8]);
            feed(&received.at.0.to_le_bytes());
            feed(&received.bytes);
            network.give_back(received.bytes);
        }
    }
}

/// A run with all kinds of faults; damaged writes to process RAM depend on the seed.
fn run(seed: u64) -> u64 {
    let cables = format!("{} 2.2-9.0 9.1-10.0 3.3-11.0", ring(8));
    let mut network = segment_with(&cables, NetworkOptions::default().with_seed(seed));
    let mut hash = 0xCBF2_9CE4_8422_2325;
    let start = network.now();
    for (step, cable) in [3usize, 0, 8, 5, 9].into_iter().enumerate() {
        let at = start + Duration::from_micros(700 + 3_000 * step as u64);
        let cable = CableId(cable);
        network.schedule(at, Fault::Cut(cable));
        network.schedule(at + Duration::from_micros(1_000), Fault::Heal(cable));
        network.schedule(at, Fault::Corrupt { cable: CableId(1), direction: None, count: 3 });
        network.schedule(at, Fault::Duplicate { cable: CableId(2), direction: None, count: 2 });
        let by = Duration::from_micros(137);
        network.schedule(at, Fault::Delay { cable: CableId(4), direction: None, count: 1, by });
    }
    network.schedule(start + Duration::from_micros(8_123), Fault::PowerOff(DeviceIndex(4)));
    network.schedule(start + Duration::from_micros(12_345), Fault::PowerOn(DeviceIndex(4)));
    for cycle in 0..200u32 {
        for link in [Main, Redundant] {
            network.send(link, &probe(link, 12));
            network.send(link, &command(Command::Bwr, Target::Broadcast(map::PROCESS_RAM), &cycle.to_le_bytes()));
            network.send(link, &command(Command::Brd, Target::Broadcast(map::PROCESS_RAM), &[0; 40]));
        }
        network.advance_by(Duration::from_micros(100));
        digest(&mut network, &mut hash);
    }
    hash
}

// covers: determinism
#[test]
fn the_same_seed_gives_the_same_run() {
    let first = run(7);
    assert_eq!(first, run(7));
    assert_eq!(first, run(7));
}

// covers: determinism
#[test]
fn steps_of_any_size_give_the_same_run() {
    let times = |step_ns: u64| {
        let mut network = segment(&ring(5));
        let start = network.now();
        for link in HostLink::ALL {
            network.send(link, &shortest());
        }
        network.schedule(start + Duration::from_micros(7), Fault::Cut(CableId(2)));
        let end = start + Duration::from_micros(200);
        while network.now() < end {
            network.advance_by(Duration::from_nanos(step_ns));
        }
        let mut hash = 0;
        digest(&mut network, &mut hash);
        (hash, *network.statistics())
    };
    assert_eq!(times(7), times(200_000));
    assert_eq!(times(333), times(200_000));
}

#[test]
fn returned_buffers_are_reused() {
    let mut network = segment(&ring(4));
    let mut buffers = Vec::new();
    for _ in 0..50 {
        network.send(Main, &shortest());
        network.send(Redundant, &shortest());
        network.advance_by(Duration::from_millis(1));
        for link in HostLink::ALL {
            let bytes = network.receive(link).unwrap().bytes;
            buffers.push(bytes.as_ptr());
            network.give_back(bytes);
        }
    }
    buffers.sort_unstable();
    buffers.dedup();
    assert!(buffers.len() <= 4, "{} buffers for two frames at a time", buffers.len());
}
