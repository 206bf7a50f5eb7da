//! Two MainDevices at one ring: the INACTIVE follows, takes over while all SubDevices stay in OP, and is handed the
//! role over (protocol 9.6 to 9.10).

mod adoption;
mod alarm;
mod clocks;
mod collisions;
mod ethernet;
mod first_calls;
mod following;
mod hot_connect;
mod library;
mod library_ethernet;
mod memory_writes;
mod outside_links;
mod partner_memory;
mod random_runs;
mod readiness;
mod requests;
mod rows;
mod same_identity;
mod taking_over;
mod threads;
mod watchdogs;
mod wire_time;

use std::time::Duration;

use ringcat::standby::MasterSizes;
use ringcat::standby::StandbyOptions;
use ringcat::{Declaration, Scan, automatic};
use ringcat_sim::cable::Host;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::counting_allocator::CountingAllocator;
use scenarios::segments::{descriptions, devices};
use scenarios::two::CYCLE;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const KINDS: [&str; 8] = [
    "coupler",
    "digital-output-8",
    "digital-input-8",
    "servo",
    "emulated-output-8",
    "analog-input-4",
    "digital-output-16",
    "block",
];

/// A ring through both; the line begins at the main link of `near`.
fn ring_of_two(count: usize, near: Host) -> Network {
    let kinds: Vec<&str> = KINDS.into_iter().cycle().take(count).collect();
    ring_of(&kinds, near)
}

/// The same with SubDevices of these kinds.
fn ring_of(kinds: &[&str], near: Host) -> Network {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    SegmentBuilder::ring_of_two(devices(descriptions(kinds)), near).options(options).build().expect("the cables fit")
}

fn declare(scan: &Scan) -> Declaration {
    automatic(&scan.subdevices, CYCLE)
}

fn standby() -> StandbyOptions {
    let mut sizes = MasterSizes::default();
    (sizes.to_inactive, sizes.to_active) = (8, 8);
    StandbyOptions::default().with_sizes(sizes).with_needs_guard(false)
}
