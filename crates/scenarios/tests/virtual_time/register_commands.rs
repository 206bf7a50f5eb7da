//! Start-up commands of a configuration file: registers that are written and checked, objects that are read, time
//! limits and comments (protocol 8.2).

use std::time::Duration;

use ringcat::{
    Event, Options, RegisterAccess, RegisterCommand, Scan, SdoUpload, StartupAction, StartupCommand, StartupSource,
    SubDeviceId, Transition, automatic,
};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::map;
use scenarios::check::troubles;
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "all-protocols", "digital-input-8"];
/// The SubDevice with commands.
const DRIVE: usize = 2;
/// Registers of no function.
const UNUSED: RegisterAddress = RegisterAddress(0x0E80);

fn world_of(change: impl FnOnce(&mut DeviceDescription), commands: &[StartupCommand]) -> World {
    let mut devices = descriptions(&KINDS);
    change(&mut devices[DRIVE]);
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let config = &mut declaration.subdevices[DRIVE];
        config.startup = commands.to_vec();
        declaration
    };
    let network = line(devices, NetworkOptions::default());
    World::with(1, network, &Options::default(), declare).expect("scan and activation")
}

fn world(commands: &[StartupCommand]) -> World {
    world_of(|_| (), commands)
}

fn command(transition: Transition, address: RegisterAddress, access: RegisterAccess) -> StartupCommand {
    let command = RegisterCommand::new(address, access).with_retries(3).with_required(true);
    StartupCommand::new(transition, StartupAction::Register(command))
}

fn write(transition: Transition, address: RegisterAddress, data: &[u8]) -> StartupCommand {
    command(transition, address, RegisterAccess::Write(data.to_vec()))
}

fn check(transition: Transition, address: RegisterAddress, data: &[u8], mask: &[u8], limit_ms: u64) -> StartupCommand {
    let (data, mask, limit) = (data.to_vec(), Some(mask.to_vec()), Duration::from_millis(limit_ms));
    command(transition, address, RegisterAccess::Check { data, mask, limit })
}

/// The reason of the failed configuration; the others are in OP then.
fn failure(mut world: World) -> String {
    world.run_cycles(600);
    let others = world.network().devices().enumerate().filter(|(number, _)| *number != DRIVE);
    assert!(others.into_iter().all(|(_, device)| device.al_status().al_state() == Some(AlState::Op)));
    let reasons = world.events(world.beginning()).iter().find_map(|timed| match &timed.event {
        Event::ConfigurationFailed { subdevice: SubDeviceId(DRIVE), reason } => Some(reason.clone()),
        _ => None,
    });
    reasons.unwrap_or_else(|| panic!("{:?}", troubles(world.events(world.beginning()))))
}

// covers: 8.2, startup-commands
#[test]
fn registers_are_written_and_checked_at_their_transitions() {
    let state = |transition, state: u8| check(transition, map::AL_STATUS, &[state, 0], &[0x0F, 0], 0);
    let mut world = world(&[
        state(Transition::So, 4),
        state(Transition::Ip, 1),
        write(Transition::Ip, map::WATCHDOG_DIVIDER, &[0x34, 0x12]),
        state(Transition::Ps, 2),
        write(Transition::Ps, map::WATCHDOG_TIME_PDI, &[0x78, 0x56]),
        // The SyncManagers of the mailbox follow the commands of IP.
        check(Transition::Ip, map::sync_manager(0), &[0; 8], &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0xFF, 0xFF], 0),
        state(Transition::Os, 8),
    ]);
    world.settle();
    let register = |world: &World, address| {
        let controller = &world.network().device(DeviceIndex(DRIVE)).controller;
        *controller.register(address, 2).first_chunk().expect("two bytes")
    };
    assert_eq!(register(&world, map::WATCHDOG_DIVIDER), [0x34, 0x12]);
    assert_eq!(register(&world, map::WATCHDOG_TIME_PDI), [0x78, 0x56]);
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
    // Again after its return.
    world.power_off(DeviceIndex(DRIVE));
    world.run_cycles(20);
    world.power_on(DeviceIndex(DRIVE));
    world.settle();
    assert_eq!(register(&world, map::WATCHDOG_DIVIDER), [0x34, 0x12]);
}

// covers: 8.2, startup-commands
#[test]
fn a_wrong_register_value_is_reported_with_comment_and_both_values() {
    let mut wrong = check(Transition::Ps, map::AL_STATUS, &[0x04, 0x00], &[0x0F, 0x00], 20);
    wrong.comment = Some("check device state for SAFEOP".to_owned());
    let text = failure(world(&[write(Transition::Ip, map::WATCHDOG_DIVIDER, &[0x34, 0x12]), wrong]));
    let expected = "start-up command 1 (PREOP to SAFEOP) \"check device state for SAFEOP\": register 0x0130: \
                    expected 04 00 (mask 0f 00) within 20 ms, got 02 00";
    assert_eq!(text, expected);
}

// covers: 8.2, startup-commands
#[test]
fn a_register_may_reach_its_value_until_the_time_limit() {
    // Outputs arrive some cycles after SAFEOP: bit 0 of the watchdog status is set then.
    let watched = |limit| check(Transition::So, map::WATCHDOG_STATUS, &[1, 0], &[1, 0], limit);
    let mut patient = world(&[watched(200)]);
    patient.settle();
    assert_eq!(troubles(patient.events(patient.beginning())), Vec::<&Event>::new());
    let text = failure(world(&[check(Transition::So, map::WATCHDOG_STATUS, &[0xF0, 0], &[0xF0, 0], 30)]));
    assert!(text.contains("expected f0 00 (mask f0 00) within 30 ms, got 01 00"), "{text}");
}

// covers: 8.2, startup-commands
#[test]
fn a_write_without_a_response_fails_only_if_required() {
    let text = failure(world(&[write(Transition::Ps, UNUSED, &[0; 4])]));
    assert!(text.starts_with("start-up command 0 (PREOP to SAFEOP): register 0x0e80:"), "{text}");
    let mut may = write(Transition::Ps, UNUSED, &[0; 4]);
    if let StartupAction::Register(command) = &mut may.action {
        command.required = false;
    }
    let mut world = world(&[may]);
    world.settle();
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
}

// covers: startup-commands
#[test]
fn impossible_register_commands_are_refused_before_anything_is_sent() {
    let refused = |wrong: &StartupCommand| {
        let declare = |scan: &Scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.subdevices[DRIVE].startup.push(wrong.clone());
            declaration
        };
        let network = line(descriptions(&KINDS), NetworkOptions::default());
        World::with(0, network, &Options::default(), declare).expect_err("it was taken").to_string()
    };
    let text = refused(&check(Transition::Ps, map::AL_STATUS, &[4, 0], &[0x0F], 0));
    assert!(text.contains("register 0x0130 has 2 bytes of data and 1 of mask"), "{text}");
    let text = refused(&write(Transition::Ps, RegisterAddress(0xFFFF), &[0, 0]));
    assert!(text.contains("register 0xffff has 2 bytes of data"), "{text}");
    assert!(refused(&write(Transition::Ps, map::AL_STATUS, &[])).contains("has 0 bytes"));
}

fn upload(index: u16, sub_index: u8, expected: Option<&[u8]>) -> StartupCommand {
    let expected = expected.map(<[u8]>::to_vec);
    let upload = SdoUpload::new(index, sub_index).with_expected(expected);
    let command = StartupCommand::new(Transition::Ps, StartupAction::Upload(upload));
    command.with_comment("a look".to_owned())
}

// covers: 8.2, startup-commands
#[test]
fn objects_are_read_and_compared_or_reported() {
    let mut world = world(&[upload(0x2001, 7, Some(&[7, 0])), upload(0x2003, 2, None)]);
    world.settle();
    let read = world.events(world.beginning()).iter().filter_map(|timed| match &timed.event {
        Event::StartupRead { subdevice: SubDeviceId(DRIVE), number, source, comment, data } => {
            Some((*number, source.clone(), comment.clone(), data.clone()))
        }
        _ => None,
    });
    let source = StartupSource::Object { index: 0x2003, sub_index: 2 };
    let reports = (1, source, Some("a look".to_owned()), 50_000u32.to_le_bytes().to_vec());
    assert_eq!(read.collect::<Vec<_>>(), [reports]);
    let text = failure(self::world(&[upload(0x2001, 7, Some(&[8, 0]))]));
    assert_eq!(text, "start-up command 0 (PREOP to SAFEOP) \"a look\": SDO 0x2001:07: expected 08 00, got 07 00");
}

// covers: 8.2, startup-commands
#[test]
fn a_command_may_have_its_own_time_limit() {
    let slow = |device: &mut DeviceDescription| {
        device.mailbox.as_mut().expect("it has one").response_time = Duration::from_millis(60);
    };
    let download = |limit: Option<u64>| {
        let sdo = ringcat::SdoDownload::new(0x2001, 1, vec![1, 0]);
        let command = StartupCommand::new(Transition::Ps, StartupAction::Sdo(sdo));
        [command.with_limit(limit.map(Duration::from_millis))]
    };
    let mut usual = world_of(slow, &download(None));
    usual.settle();
    let text = failure(world_of(slow, &download(Some(25))));
    assert!(text.starts_with("start-up command 0 (PREOP to SAFEOP): SDO 0x2001:01: "), "{text}");
    assert!(text.contains("25 ms"), "{text}");
}

// covers: 8.2, eni-image
#[test]
fn a_register_check_ends_when_its_subdevice_loses_power() {
    let mut world = world(&[check(Transition::Ps, map::AL_STATUS, &[8, 0], &[0x0F, 0], 3_600_000)]);
    world.run_cycles(400);
    let state = |world: &World| world.network().device(DeviceIndex(DRIVE)).al_status().al_state();
    assert_eq!(state(&world), Some(AlState::PreOp), "its register is polled");
    world.power_off(DeviceIndex(DRIVE));
    world.run_cycles(100);
    world.power_on(DeviceIndex(DRIVE));
    assert_eq!(state(&world), Some(AlState::Init), "its power is back");
    world.run_cycles(400);
    assert_eq!(state(&world), Some(AlState::PreOp), "it is brought up again, to the same check");
}
