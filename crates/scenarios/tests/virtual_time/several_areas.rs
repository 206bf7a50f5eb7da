//! SubDevices with several areas of inputs: a disabled SyncManager is not hidden by an enabled one, although a
//! SubDevice adds to a working counter only once (protocol 1.4).

use std::time::Duration;

use ringcat::{DomainId, DomainState, Freshness, SubDeviceId};
use ringcat_sim::application::{Behaviour, InputSource};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::register::{SyncManager, map};
use ringcat_wire::sii::FmmuUsage;
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::World;

const DOMAIN: DomainId = DomainId(0);

/// Sixteen inputs, eight in each of two SyncManagers, between two other SubDevices.
fn described(fmmus: Option<u8>) -> Vec<DeviceDescription> {
    let mut described = descriptions(&["digital-input-8", "digital-input-16", "digital-output-8"]);
    let two = &mut described[1];
    two.behaviour = Behaviour::Terminal(InputSource::Constant(vec![0xAA; 2]));
    two.controller_fmmus = fmmus;
    two.fmmus = vec![FmmuUsage::Inputs; 2];
    let mut first = two.sync_managers[0];
    first.length = 1;
    let mut second = first;
    second.start += 0x100;
    two.sync_managers = vec![first, second];
    for pdo in &mut two.pdos[8..] {
        pdo.sync_manager = Some(1);
    }
    described
}

// covers: freshness
#[test]
fn inputs_of_a_disabled_sync_manager_are_not_fresh() {
    for fmmus in [None, Some(2)] {
        for closed in [false, true] {
            for dead in 0..2u8 {
                let (described, options) = (described(fmmus), NetworkOptions::default());
                let mut world =
                    World::in_op(1, if closed { ring(described, options) } else { line(described, options) });
                let what = format!("ring: {closed}, SyncManager {dead}, FMMUs {fmmus:?}");
                let inputs = world.application().directory().areas(SubDeviceId(1)).to_vec();
                assert_eq!(inputs.len(), 2, "{what}");
                let now = world.now();
                let controller = &mut world.network_mut().device_mut(DeviceIndex(1)).controller;
                let control = map::sync_manager(dead).offset(SyncManager::PDI_CONTROL);
                assert!(controller.pdi_write(control, &[1], now));
                world.run_cycles(3);
                for _ in 0..50 {
                    world.cycle();
                    let exchange = world.application().exchange();
                    for area in &inputs {
                        assert_eq!(exchange.image(DOMAIN)[area.placed.image_offset as usize], 0xAA, "{what}");
                    }
                    assert!(matches!(exchange.freshness(DOMAIN, SubDeviceId(1)), Freshness::Stale { .. }), "{what}");
                    // With a presence datagram the first area shares its datagram with others, whose inputs are then
                    // stale too.
                    if dead == 1 || fmmus.is_some() {
                        assert_eq!(exchange.freshness(DOMAIN, SubDeviceId(0)), Freshness::Fresh, "{what}");
                    }
                    assert_eq!(
                        exchange.status(DOMAIN).expect("it is declared").state,
                        DomainState::Incomplete,
                        "{what}"
                    );
                }
                let now = world.now();
                assert!(world.network_mut().device_mut(DeviceIndex(1)).controller.pdi_write(control, &[0], now));
                world.until(Duration::from_secs(1), &what, |world| {
                    let exchange = world.application().exchange();
                    let is_fresh = exchange.freshness(DOMAIN, SubDeviceId(1)) == Freshness::Fresh;
                    is_fresh && exchange.status(DOMAIN).expect("it is declared").state == DomainState::Complete
                });
            }
        }
    }
}
