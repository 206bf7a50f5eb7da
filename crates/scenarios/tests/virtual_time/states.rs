//! One SubDevice in another state while the others continue: no cycle is incomplete, and it returns with its whole
//! configuration.

use std::time::Duration;

use ringcat::{
    DomainId, Event, Freshness, Limits, Options, Scan, SdoAddress, SubDeviceId, SubDeviceState, Transition, automatic,
};
use ringcat_engine::ConfigureError;
use ringcat_engine::mail::coe;
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::Bytes;
use ringcat_sim::application::foe::firmware;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::{DeviceDescription, SyncManagerDescription};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::register::{SyncManager, map};
use ringcat_wire::sii::{MailboxLayout, SiiSyncManager, SyncManagerKind};
use scenarios::loss::Loss;
use scenarios::segments::{descriptions, line, ring_of_16};
use scenarios::world::{CYCLE, Mark, World};

const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
const LIMIT: Duration = Duration::from_secs(5);
const KINDS: [&str; 4] = ["coupler", "digital-output-8", "all-protocols", "digital-input-8"];
/// The SubDevice with a mailbox and a boot loader.
const DRIVE: usize = 2;

fn request(world: &mut World, subdevice: usize, state: AlState) -> Result<(), ConfigureError> {
    let work = world.application_mut().engine_mut().start_state_request(SubDeviceId(subdevice), state);
    world.finish(LIMIT, work)
}

fn state(world: &World, device: usize) -> AlStatus {
    world.network().device(DeviceIndex(device)).al_status()
}

/// Only one SubDevice has left OP, and no cycle was incomplete.
fn assert_undisturbed(world: &World, since: Mark, but: usize) {
    assert_eq!(world.incomplete(since), 0, "incomplete cycles");
    assert!(world.evaluated(since).iter().all(|evaluated| evaluated.status.state == ringcat::DomainState::Complete));
    assert!(world.evaluated(since).iter().all(|evaluated| evaluated.stale.iter().all(|stale| *stale == but)));
    assert!(world.left_op(since).iter().all(|device| device.0 == but), "{:?}", world.left_op(since));
}

fn registers(world: &World, device: usize) -> Vec<u8> {
    let controller = &world.network().device(DeviceIndex(device)).controller;
    let sync_managers = (0..8).flat_map(|number| controller.register(map::sync_manager(number), 5).to_vec());
    controller.register(map::FMMU_BASE, 64).iter().copied().chain(sync_managers).collect()
}

// covers: states
#[test]
fn state_changes_of_each_of_16_leave_all_cycles_complete() {
    let mut world = World::in_op(1, ring_of_16(Duration::from_micros(10)));
    for device in 0..16 {
        let before = registers(&world, device);
        for to in [AlState::PreOp, AlState::Init, AlState::SafeOp] {
            let mark = world.mark();
            assert_eq!(request(&mut world, device, to), Ok(()), "device {device} to {to}");
            world.run_cycles(20);
            assert_eq!(state(&world, device), AlStatus::new(to));
            assert_eq!(world.application().states()[device], SubDeviceState::Settled(to));
            assert_eq!(request(&mut world, device, AlState::Op), Ok(()), "device {device} from {to}");
            world.run_cycles(20);
            assert_eq!(state(&world, device), AlStatus::new(AlState::Op));
            assert_undisturbed(&world, mark, device);
            assert_eq!(registers(&world, device), before, "the whole configuration is back");
            let last = world.evaluated(mark).last().expect("cycles");
            assert_eq!((last.status.wkc, last.stale.len()), (last.status.expected, 0));
        }
    }
}

// covers: states
#[test]
fn in_preop_the_mailbox_works_and_inputs_are_not_fresh() {
    let mut world = World::in_op(2, line(descriptions(&KINDS), NetworkOptions::default()));
    assert_eq!(request(&mut world, DRIVE, AlState::PreOp), Ok(()));
    world.run_cycles(5);
    let exchange = world.application().exchange();
    assert!(matches!(exchange.freshness(DomainId(0), SubDeviceId(DRIVE)), Freshness::Stale { .. }));
    assert_eq!(exchange.freshness(DomainId(0), SubDeviceId(3)), Freshness::Fresh);
    // This may be written only in PREOP.
    let mailbox = world.mailbox(DRIVE);
    let ramp = SdoAddress::new(0x2003, 2);
    let written = world.run(async move { coe::write(&mailbox, ramp, &7u32.to_le_bytes(), LIMITS).await });
    assert_eq!(written, Ok(()));
    assert_eq!(request(&mut world, DRIVE, AlState::Op), Ok(()));
    world.run_cycles(2);
    assert_eq!(world.application().exchange().freshness(DomainId(0), SubDeviceId(DRIVE)), Freshness::Fresh);
    let dictionary = world.network().device(DeviceIndex(DRIVE)).application.dictionary();
    assert_eq!(dictionary.read(0x2003, 2), Ok(7u32.to_le_bytes().as_slice()), "it never left PREOP downwards");
}

// covers: 6.4, states
#[test]
fn firmware_is_updated_in_boot_while_the_others_stay_in_op() {
    let mut world = World::in_op(3, line(descriptions(&KINDS), NetworkOptions::default()));
    let mark = world.mark();
    assert_eq!(request(&mut world, DRIVE, AlState::Boot), Ok(()));
    assert_eq!(state(&world, DRIVE), AlStatus::new(AlState::Boot));
    let image = firmware::image("2.7", &[0x5A; 20_000]);
    let mailbox = world.mailbox(DRIVE);
    let written = world.run(async move {
        foe::write(&mailbox, "firmware.bin", FoeOptions::default(), &mut Bytes::new(&image), |_| ()).await
    });
    assert_eq!(written, Ok(20_000 + 4 + 1 + 3 + 4));
    assert_eq!(request(&mut world, DRIVE, AlState::Op), Ok(()));
    let mailbox = world.mailbox(DRIVE);
    let version = world.run(async move { coe::read(&mailbox, SdoAddress::new(0x100A, 0), LIMITS, 50).await });
    assert_eq!(version, Ok(b"2.7".to_vec()));
    world.run_cycles(20);
    assert!(world.all_in_op());
    assert_undisturbed(&world, mark, DRIVE);
}

/// Start, length and whether it is enabled of a SyncManager of the drive.
fn manager(world: &World, number: u8) -> (u16, u16, bool) {
    let controller = &world.network().device(DeviceIndex(DRIVE)).controller;
    let bytes = controller.register(map::sync_manager(number), 8);
    let register = SyncManager::decode(bytes.first_chunk().expect("eight bytes"));
    (register.start, register.length, register.activate.enable)
}

// covers: 3.11, odd-sii
#[test]
fn firmware_update_uses_the_boot_sync_managers_of_the_sii() {
    for own in [false, true] {
        let mut devices = descriptions(&KINDS);
        let device = &mut devices[DRIVE];
        let mailbox = device.mailbox.as_mut().expect("it has one");
        let (receive, send) = if own {
            // Behind all others, at separate addresses, the send mailbox first.
            mailbox.bootstrap.receive_offset = 0x2000;
            mailbox.bootstrap.send_offset = 0x2400;
            let of = |start, kind| {
                let like = device.sync_managers.iter().find(|manager| manager.kind == kind).expect("it has one");
                SyncManagerDescription { start, length: mailbox.bootstrap.receive_size, ..*like }
            };
            let more = [of(0x2400, SyncManagerKind::MailboxIn), of(0x2000, SyncManagerKind::MailboxOut)];
            device.sync_managers.extend(more);
            (5, 4)
        } else {
            // Process data on 0 and 1, then the mailboxes of all states.
            device.sync_managers.rotate_left(2);
            for pdo in &mut device.pdos {
                pdo.sync_manager = pdo.sync_manager.map(|number| number - 2);
            }
            (2, 3)
        };
        let boot = mailbox_of(device);
        let mut world = World::in_op(6, line(devices, NetworkOptions::default()));
        let mark = world.mark();
        let before = registers(&world, DRIVE);
        let mailboxes = world.scan.subdevices[DRIVE].boot_sync_managers();
        assert_eq!((mailboxes.written, mailboxes.read), (receive, send));
        assert_eq!(request(&mut world, DRIVE, AlState::Boot), Ok(()));
        assert_eq!(manager(&world, receive), (boot.receive_offset, boot.receive_size, true), "own: {own}");
        assert_eq!(manager(&world, send), (boot.send_offset, boot.send_size, true), "own: {own}");
        // A lost response is repeated at the right SyncManager.
        world.lose(Loss::of_read(world.station_of(DRIVE), boot.send_offset).on_the_way_back());
        let image = firmware::image("3.1", &[0x5A; 20_000]);
        let mailbox = world.mailbox(DRIVE);
        let own_mailbox = mailbox.clone();
        let written = world.run(async move {
            foe::write(&own_mailbox, "firmware.bin", FoeOptions::default(), &mut Bytes::new(&image), |_| ()).await
        });
        assert!(written.is_ok(), "own: {own}: {written:?}");
        assert_eq!((mailbox.counters().repeats, world.application().links().losses_left()), (1, 0));
        assert_eq!(request(&mut world, DRIVE, AlState::Op), Ok(()));
        let own_mailbox = world.mailbox(DRIVE);
        let version = world.run(async move { coe::read(&own_mailbox, SdoAddress::new(0x100A, 0), LIMITS, 50).await });
        assert_eq!(version, Ok(b"3.1".to_vec()));
        world.run_cycles(20);
        assert!(world.all_in_op());
        assert_eq!(registers(&world, DRIVE), before, "own: {own}: all is as before");
        assert_undisturbed(&world, mark, DRIVE);
        // Unsolicited mail is found again at the SyncManager of the other states.
        let emergency = Emergency { error_code: 0x8130, error_register: 1, data: [0; 5] };
        assert!(world.network_mut().device_mut(DeviceIndex(DRIVE)).application.emergency(&emergency));
        world.run_cycles(50);
        assert_eq!(mailbox.pop_emergency().map(|received| received.emergency), Some(emergency), "own: {own}");
    }
}

fn mailbox_of(device: &DeviceDescription) -> MailboxLayout {
    device.mailbox.as_ref().expect("it has one").bootstrap
}

// covers: startup-commands
#[test]
fn commands_of_the_way_down_and_up_are_sent_in_order() {
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let config = declaration.subdevices[DRIVE].clone();
        declaration.subdevices[DRIVE] = config
            .sdo_at(Transition::Os, 0x2001, 1, [1, 0])
            .sdo_at(Transition::Sp, 0x2001, 2, [2, 0])
            .sdo_at(Transition::Ip, 0x2001, 3, [3, 0])
            .sdo_at(Transition::Ps, 0x2001, 4, [4, 0])
            .sdo_at(Transition::So, 0x2001, 5, [5, 0]);
        declaration
    };
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut world = World::with(4, network, &Options::default(), declare).expect("scan and activation");
    world.settle();
    let device = DeviceIndex(DRIVE);
    world.network_mut().device_mut(device).application.record_mail();
    for to in [AlState::PreOp, AlState::Op, AlState::SafeOp, AlState::Op] {
        assert_eq!(request(&mut world, DRIVE, to), Ok(()));
    }
    let served = world.network().device(device).application.served_mail();
    let coe = served.iter().filter(|mail| mail.protocol == Protocol::Coe);
    let got: Vec<(AlState, u8)> = coe.map(|mail| (mail.state, mail.payload[5])).collect();
    let expected = [
        (AlState::Op, 1),
        (AlState::SafeOp, 2),
        (AlState::PreOp, 4),
        (AlState::SafeOp, 5),
        (AlState::Op, 1),
        (AlState::SafeOp, 5),
    ];
    assert_eq!(got, expected);
}

/// Outputs of a terminal without a state machine: only the SyncManager disables them in SAFEOP.
// covers: 4.4, sync-managers-declared, ES-43
#[test]
fn a_sync_manager_for_op_only_is_off_in_safeop_on_the_way_up_and_down() {
    let mut devices = descriptions(&["coupler", "emulated-output-8", "digital-input-8"]);
    devices[1].sync_managers[0].enable = SiiSyncManager::ENABLE | SiiSyncManager::OP_ONLY;
    let mut world = World::in_op(6, line(devices, NetworkOptions::default()));
    let is_on = |world: &World| {
        let register = map::sync_manager(0).offset(SyncManager::ACTIVATE);
        world.network().device(DeviceIndex(1)).controller.register(register, 1)[0] & 1 == 1
    };
    assert!(is_on(&world));
    for way in [&[AlState::SafeOp][..], &[AlState::PreOp, AlState::SafeOp], &[AlState::Init, AlState::SafeOp]] {
        let mark = world.mark();
        for to in way {
            assert_eq!(request(&mut world, 1, *to), Ok(()));
            world.run_cycles(20);
            assert!(!is_on(&world), "on in {to}, by {way:?}");
        }
        assert_eq!(request(&mut world, 1, AlState::Op), Ok(()));
        world.run_cycles(20);
        assert!(is_on(&world), "off in OP, by {way:?}");
        assert_undisturbed(&world, mark, 1);
    }
}

// covers: states
#[test]
fn a_refused_state_is_reported_and_the_former_state_restored() {
    let mut world = World::in_op(5, line(descriptions(&KINDS), NetworkOptions::default()));
    assert_eq!(request(&mut world, 3, AlState::Boot), Err(ConfigureError::NoBoot), "nothing happens to it");
    assert_eq!(state(&world, 3), AlStatus::new(AlState::Op));
    let code = AlStatusCode(0x8123);
    world.fault(Fault::RefuseTransition { device: DeviceIndex(DRIVE), to: AlState::Boot, code, times: 1 });
    let mark = world.mark();
    let error = request(&mut world, DRIVE, AlState::Boot).expect_err("it refuses");
    assert!(error.to_string().contains("refused BOOT"), "{error}");
    assert!(world.saw(mark, |event| matches!(event, Event::StateError { subdevice: SubDeviceId(DRIVE), .. })));
    world.settle();
    assert_eq!(state(&world, DRIVE), AlStatus::new(AlState::Op));
}

// covers: states
#[test]
fn the_state_that_was_requested_is_kept_over_a_loss_of_power() {
    let mut world = World::in_op(6, line(descriptions(&KINDS), NetworkOptions::default()));
    let last = KINDS.len() - 1;
    assert_eq!(request(&mut world, last, AlState::PreOp), Ok(()));
    let mark = world.mark();
    world.power_off(DeviceIndex(last));
    world.run_cycles(50);
    assert_eq!(request(&mut world, last, AlState::SafeOp), Err(ConfigureError::Absent));
    assert_eq!(request(&mut world, last, AlState::PreOp), Err(ConfigureError::Absent));
    world.power_on(DeviceIndex(last));
    world.until(LIMIT, "back in PREOP", |world| {
        world.application().states()[last] == SubDeviceState::Settled(AlState::PreOp)
    });
    world.run_cycles(100);
    assert_eq!(state(&world, last), AlStatus::new(AlState::PreOp));
    assert_eq!(request(&mut world, last, AlState::Op), Ok(()));
    world.settle();
    assert!(world.left_op(mark).iter().all(|device| device.0 == last));
}

// covers: states
#[test]
fn a_subdevice_lost_during_its_bring_up_makes_cycles_incomplete() {
    let mut world = World::in_op(8, line(descriptions(&KINDS), NetworkOptions::default()));
    let last = KINDS.len() - 1;
    let is_missed = |world: &World| {
        let evaluated = world.evaluated(world.beginning()).last().expect("cycles went by");
        evaluated.status.state != ringcat::DomainState::Complete
    };
    assert_eq!(request(&mut world, last, AlState::PreOp), Ok(()));
    world.run_cycles(5);
    assert!(!is_missed(&world));
    let work = world.application_mut().engine_mut().start_state_request(SubDeviceId(last), AlState::Op);
    world.run_cycles(1);
    world.power_off(DeviceIndex(last));
    assert!(world.finish(LIMIT, work).is_err());
    world.run_cycles(20);
    assert!(is_missed(&world), "while it is gone");
    world.power_on(DeviceIndex(last));
    world.settle();
    world.power_off(DeviceIndex(last));
    world.run_cycles(20);
    assert!(is_missed(&world), "when it goes again");
}

// covers: states
#[test]
fn a_later_request_ends_an_earlier_one() {
    let mut world = World::in_op(7, line(descriptions(&KINDS), NetworkOptions::default()));
    let first = world.application_mut().engine_mut().start_state_request(SubDeviceId(DRIVE), AlState::Init);
    world.cycle();
    let second = world.application_mut().engine_mut().start_state_request(SubDeviceId(DRIVE), AlState::Op);
    assert_eq!(world.finish(LIMIT, first), Err(ConfigureError::Interrupted));
    assert_eq!(world.finish(LIMIT, second), Ok(()));
    world.settle();
}
