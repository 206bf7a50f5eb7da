//! Segments with distributed clocks that have errors, and their true values, which a MainDevice cannot read.

use std::time::Duration;

use ringcat::{ClockConfig, Declaration, Options, Scan, automatic};
use ringcat_sim::cable::{CableSpec, DeviceIndex, Endpoint, HostLink};
use ringcat_sim::controller::Wander;
use ringcat_sim::description::{DcDescription, DeviceDescription};
use ringcat_sim::device::Device;
use ringcat_sim::frame::Port;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::register::{PortKind, map};
use ringcat_wire::sii::DcMode;

use crate::segments::{describe, devices};
use crate::world::{CYCLE, World};

/// System time at the start of scenarios: not a round number, and more than 32 bits.
pub const EPOCH: u64 = 0x0B13_5799_0123_4567;

/// Devices with clocks: drift up to `ppm` to either side, a slow wander of a hundredth of it, 40 ns of jitter.
/// Each fourth has a clock of 32 bits; some begin just before it wraps.
pub fn clocked(count: usize, ppm: i64) -> Vec<DeviceDescription> {
    (0..count).map(|number| one(number, ppm)).collect()
}

fn one(number: usize, ppm: i64) -> DeviceDescription {
    let mut device = describe("digital-input-8", &format!("clock-{number}"));
    let mode = DcMode { assign_activate: 0x0300, sync0_cycle_factor: 1, ..DcMode::default() };
    let modes = vec![mode, DcMode { assign_activate: 0x0700, ..mode }];
    device.dc = Some(DcDescription { wide: number % 4 != 3, modes, minimum_cycle_ns: 0 });
    // Spread over the whole range, neighbours far apart.
    let share = (number as i64 * 7_919) % 2_001 - 1_000;
    device.clock_drift_ppb = ppm * share;
    let period = Duration::from_secs(20 + number as u64 % 7);
    device.clock_wander = Wander { amplitude_ppb: ppm * 10, period };
    device.receive_jitter = Duration::from_nanos(40);
    let wraps_soon = 0xFFFF_FFFF - 1_000_000 * (number as u64 % 3_000);
    device.clock_start_ns = if number % 5 == 1 { wraps_soon } else { 0x0123_4567_89AB * (number as u64 + 1) };
    device
}

/// Device `n` is connected to device `(n - 1) / 3`, with cables of different lengths.
///
/// # Panics
/// When the tree cannot be built.
pub fn clock_tree(mut descriptions: Vec<DeviceDescription>) -> Network {
    for description in &mut descriptions {
        description.ports = [PortKind::Mii; 4];
    }
    let count = descriptions.len();
    let port = |number: usize| [Port::D, Port::B, Port::C][number % 3];
    let mut cables = vec![CableSpec {
        a: Endpoint::Host(HostLink::Main),
        b: Endpoint::Device(DeviceIndex(0), Port::A),
        delay: Duration::from_nanos(50),
    }];
    cables.extend((1..count).map(|number| CableSpec {
        a: Endpoint::Device(DeviceIndex((number - 1) / 3), port(number - 1)),
        b: Endpoint::Device(DeviceIndex(number), Port::A),
        delay: Duration::from_nanos(50 + 10 * (number as u64 % 50)),
    }));
    Network::new(descriptions.into_iter().map(Device::new).collect(), cables, NetworkOptions::default())
        .expect("the tree can be built")
}

/// All scanned SubDevices in one domain, with clocks.
pub fn with_clocks(scan: &Scan, config: ClockConfig) -> Declaration {
    automatic(&scan.subdevices, CYCLE).with_clocks(config)
}

/// Usual settings of scenarios.
pub fn config() -> ClockConfig {
    ClockConfig::default().with_epoch(EPOCH)
}

/// A world in which the clocks begin to synchronise.
///
/// # Panics
/// When scan or activation fail.
pub fn world(seed: u64, network: Network, config: ClockConfig) -> World {
    World::with(seed, network, &Options::default(), |scan| with_clocks(scan, config))
        .unwrap_or_else(|error| panic!("seed {seed}: {error}"))
}

/// Runs until all clocks are locked.
///
/// # Panics
/// When they are not locked within a time.
pub fn lock(world: &mut World, limit: Duration) {
    world.until(limit, "all clocks locked", |world| world.application().engine().clocks_locked());
}

/// Differences of the clocks of these devices to the first one, in nanoseconds. Clocks of 32 bits are compared in 32
/// bits.
pub fn differences(network: &Network, devices: &[usize]) -> Vec<i64> {
    let time = |device: usize| network.device(DeviceIndex(device)).controller.system_time(network.now());
    let first = devices.first().map_or(0, |first| time(*first));
    devices.iter().map(|device| i64::from((time(*device) as u32).wrapping_sub(first as u32) as i32)).collect()
}

/// From the slowest to the fastest of these clocks, in nanoseconds.
pub fn spread(network: &Network, devices: &[usize]) -> i64 {
    let all = differences(network, devices);
    all.iter().max().unwrap_or(&0) - all.iter().min().unwrap_or(&0)
}

/// Largest spread in this many cycles.
pub fn largest_spread(world: &mut World, devices: &[usize], cycles: u64) -> i64 {
    let mut largest = 0;
    for _ in 0..cycles {
        world.cycle();
        largest = largest.max(spread(world.network(), devices));
    }
    largest
}

/// Register DC_SYSTEM_TIME_DELAY of a device.
pub fn delay(network: &Network, device: usize) -> u32 {
    let bytes = network.device(DeviceIndex(device)).controller.register(map::DC_SYSTEM_TIME_DELAY, 4);
    bytes.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes))
}

/// Devices with clocks and four ports each, on cables of different lengths.
///
/// # Panics
/// When the cables do not fit.
pub fn wired(mut descriptions: Vec<DeviceDescription>, cables: &[(Endpoint, Endpoint)]) -> Network {
    for description in &mut descriptions {
        description.ports = [PortKind::Mii; 4];
    }
    let delay = |number: usize| Duration::from_nanos(50 + 70 * (number as u64 * 5 % 11));
    let cable = |(number, (a, b)): (usize, &(Endpoint, Endpoint))| CableSpec { a: *a, b: *b, delay: delay(number) };
    let cables = cables.iter().enumerate().map(cable).collect();
    Network::new(devices(descriptions), cables, NetworkOptions::default()).expect("the cables fit")
}

/// Runs this many cycles; returns the largest spread of each of these groups.
pub fn watch<const N: usize>(world: &mut World, groups: [&[usize]; N], cycles: u64) -> [i64; N] {
    let mut worst = [0; N];
    for _ in 0..cycles {
        world.cycle();
        for (worst, group) in worst.iter_mut().zip(groups) {
            *worst = (*worst).max(spread(world.network(), group));
        }
    }
    worst
}
