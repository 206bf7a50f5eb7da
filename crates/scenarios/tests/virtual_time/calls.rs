//! Calls of the shape of `ecrt.h` in every order that its clients use, through [`scenarios::calls`].

mod clocks;
mod cycles;
mod mailbox;
mod misfits;
mod orders;
mod pdos;
mod seeds;

use ringcat::{DomainId, SubDeviceId};
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::calls::configure::syncs_of;
use scenarios::calls::master::Ecrt;
use scenarios::calls::witness::is_idle;
use scenarios::segments::{describe, descriptions, line, ring};

/// Sizes of segments.
const SIZES: [usize; 4] = [1, 2, 5, 12];
/// SubDevices in the order of their positions: the first `n` are a segment of `n`.
const KINDS: [&str; 12] = [
    "servo",
    "digital-output-8",
    "all-protocols",
    "digital-input-8",
    "emulated-output-8",
    "coupler",
    "analog-output-4",
    "servo",
    "analog-input-4",
    "digital-output-16",
    "emulated-input-8",
    "digital-input-16",
];
/// Object of a drive's inputs, and of its outputs.
const POSITION: (u16, u8) = (0x6064, 0);
const TARGET: (u16, u8) = (0x607A, 0);

/// A line and a ring of the first kinds.
fn networks(count: usize) -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&KINDS[..count]), options()), ring(descriptions(&KINDS[..count]), options())]
}

/// Masters without a reservation, by size.
fn masters() -> impl Iterator<Item = (usize, Ecrt)> {
    SIZES.into_iter().flat_map(|count| networks(count).map(|network| (count, Ecrt::new(network))))
}

/// Masters that were requested, by size.
fn requested() -> impl Iterator<Item = (usize, Ecrt)> {
    masters().map(|(count, mut ecrt)| {
        ecrt.request().expect("it is free");
        (count, ecrt)
    })
}

/// Configures what is there at these positions, with all default entries in one domain.
fn configure(ecrt: &mut Ecrt, positions: impl IntoIterator<Item = usize>) -> (DomainId, Vec<SubDeviceId>) {
    let domain = ecrt.create_domain().expect("it is requested");
    let found = ecrt.side.engine().subdevices();
    let mut configs = Vec::new();
    for at in positions {
        let Some(info) = found.get(at) else { continue };
        let identity = (info.identity.vendor_id, info.identity.product_code);
        let config = ecrt.slave_config(0, at as u16, identity).expect("it is new");
        for entry in ecrt.default_entries(config) {
            ecrt.reg_pdo_entry(config, entry, domain, Some(&mut 0)).expect("it is mapped");
        }
        configs.push(config);
    }
    (domain, configs)
}

/// Configures and activates all, and runs until they are in OP.
fn run_all(ecrt: &mut Ecrt, count: usize) -> (DomainId, Vec<SubDeviceId>) {
    let all = configure(ecrt, 0..count);
    assert_eq!(all.1.len(), count);
    ecrt.activate().expect("it fits");
    ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}: {error}"));
    all
}

/// Limit of a start.
const LIMIT: std::time::Duration = std::time::Duration::from_secs(3);

/// All devices are as without an application.
fn assert_idle(ecrt: &mut Ecrt, text: &str) {
    let count = ecrt.network().devices().len();
    for device in 0..count {
        if let Err(error) = is_idle(ecrt.network(), device) {
            panic!("{text}: {error}");
        }
    }
    ecrt.pulses_may_come = false;
    ecrt.look();
}

/// Vendor and product of a kind.
fn identity(kind: &str) -> (u32, u32) {
    let description = describe(kind, kind);
    (description.identity.vendor_id, description.identity.product_code)
}

/// Configures a kind at a position with the PDOs that a program names, absent or not. Outputs and inputs are in the
/// domain.
fn configure_named(ecrt: &mut Ecrt, position: u16, kind: &str, domain: DomainId) -> SubDeviceId {
    let config = ecrt.slave_config(0, position, identity(kind)).expect("it is new");
    let syncs = syncs_of(&describe(kind, kind));
    ecrt.pdos(config, &syncs);
    for entry in Ecrt::entries_of(&syncs) {
        ecrt.reg_pdo_entry(config, entry, domain, Some(&mut 0)).expect("it is declared");
    }
    config
}
