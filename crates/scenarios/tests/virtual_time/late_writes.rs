//! Copies of given-up configuration writes that arrive after later writes: overwritten registers are detected and
//! written again.

use std::time::Duration;

use ringcat::{DomainId, DomainState, Event, SubDeviceId};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::{Fmmu, SyncManager, map};
use ringcat_wire::sii::SiiSyncManager;
use scenarios::segments::{descriptions, line};
use scenarios::world::World;

/// Time limit until overwritten registers are detected and written again.
const HEALED: Duration = Duration::from_millis(2_500);

/// A terminal with outputs in OP only, and one with a mailbox.
fn world() -> World {
    let mut described = descriptions(&["emulated-output-8", "servo"]);
    described[0].sync_managers[0].enable = SiiSyncManager::ENABLE | SiiSyncManager::OP_ONLY;
    let mut world = World::in_op(1, line(described, NetworkOptions::default()));
    world.evaluate_latched(false);
    world
}

fn is_well(world: &World) -> bool {
    let status = world.application().exchange().status(DomainId(0)).expect("it is declared");
    world.all_in_op() && world.application().all_settled() && status.state == DomainState::Complete
}

/// Each group of configuration registers is cleared without the engine's knowledge in OP, SAFEOP and PREOP.
// covers: recovery
#[test]
fn a_configuration_overwritten_by_a_late_write_is_restored() {
    let registers: [(usize, AlState, RegisterAddress, usize); 8] = [
        (0, AlState::Op, map::sync_manager(0), SyncManager::LEN),
        (0, AlState::Op, map::fmmu(0), Fmmu::LEN),
        (1, AlState::Op, map::sync_manager(2), SyncManager::LEN),
        (1, AlState::Op, map::sync_manager(3), SyncManager::LEN),
        (1, AlState::Op, map::sync_manager(0), SyncManager::LEN),
        (1, AlState::SafeOp, map::sync_manager(3), SyncManager::LEN),
        (1, AlState::SafeOp, map::sync_manager(1), SyncManager::LEN),
        (1, AlState::PreOp, map::sync_manager(1), SyncManager::LEN),
    ];
    for (subdevice, state, register, length) in registers {
        let mut world = world();
        if state != AlState::Op {
            let request = world.application_mut().engine_mut().start_state_request(SubDeviceId(subdevice), state);
            world.finish(Duration::from_secs(1), request).expect("it goes there");
            world.run_cycles(50);
        }
        let what = format!("{subdevice} in {state}, {register}");
        let held = |world: &World| {
            let controller = &world.network().device(DeviceIndex(subdevice)).controller;
            let mut held = controller.register(register, length).to_vec();
            // The status byte of a SyncManager, and its PDI control.
            if length == SyncManager::LEN {
                (held[5], held[7]) = (0, 0);
            }
            held
        };
        let before = held(&world);
        let mark = world.mark();
        let write = world.application_mut().engine_mut().start_register_write(
            SubDeviceId(subdevice),
            register,
            vec![0; length],
        );
        world.finish(Duration::from_secs(1), write).expect("it is there");
        world.until(HEALED, &what, |world| held(world) == before && world.application().all_settled());
        // Some SubDevices detect it themselves.
        let reports = |event: &Event| match event {
            Event::ConfigurationFailed { subdevice: of, reason } => {
                *of == SubDeviceId(subdevice) && reason.contains("0x0")
            }
            Event::StateError { subdevice: of, .. } => *of == SubDeviceId(subdevice),
            _ => false,
        };
        assert!(world.saw(mark, reports), "{what}: {:?}", world.events(mark));
        world.run_cycles(3_000);
        let count = world.events(mark).iter().filter(|timed| reports(&timed.event)).count();
        assert_eq!(count, 1, "{what}: it is configured once");
    }
}

/// A SubDevice with outputs in OP only is right in a requested SAFEOP.
// covers: recovery
#[test]
fn outputs_for_op_only_are_not_reconfigured_in_safeop() {
    let mut world = world();
    let request = world.application_mut().engine_mut().start_state_request(SubDeviceId(0), AlState::SafeOp);
    world.finish(Duration::from_secs(1), request).expect("it goes there");
    let mark = world.mark();
    world.run_cycles(3_000);
    assert!(!world.saw(mark, |event| matches!(event, Event::ConfigurationFailed { .. })), "{:?}", world.events(mark));
    assert_eq!(world.steps(mark), []);
}

/// Frames are late by milliseconds while a SubDevice returns after a short power failure, beginning at different
/// moments.
// covers: recovery
#[test]
fn late_frames_during_a_return_have_no_lasting_effect() {
    for (seed, by) in (0..).zip([1_900, 2_900, 3_900, 5_900].map(Duration::from_micros)) {
        let mut world = world();
        for moment in 0..60 {
            let device = DeviceIndex(seed as usize % 2);
            world.power_off(device);
            world.run_cycles(3);
            world.power_on(device);
            let delay = Duration::from_micros(400 * moment);
            world.fault_in(delay, Fault::Delay { cable: CableId(0), direction: Some(Direction::AToB), count: 2, by });
            world.run_cycles(40);
            world.until(Duration::from_secs(8), "it is back", is_well);
            world.run_cycles(20);
            assert!(is_well(&world), "{by:?} late, {delay:?} behind its power");
        }
    }
}
