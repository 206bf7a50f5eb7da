//! Start-up commands beside the way to OP: on the ways to INIT, to BOOT and back, and at a state that is requested
//! again. Mail is evaluated by what the SubDevice has served and in which state, registers by their contents.

use std::time::Duration;

use ringcat::{
    ConfigureError, Event, Options, RegisterAccess, RegisterCommand, Scan, StartupAction, SubDeviceConfig, SubDeviceId,
    Transition, automatic,
};
use ringcat_sim::application::ServedMail;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::sdo::SdoRequest;
use ringcat_wire::register::map;
use scenarios::check::troubles;
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "all-protocols", "digital-input-8"];
/// The SubDevice with commands.
const DRIVE: usize = 2;
/// A register that shows which command came last: nothing else writes it.
const LAST: RegisterAddress = map::WATCHDOG_TIME_PDI;
const LIMIT: Duration = Duration::from_secs(10);

fn world(change: impl Fn(SubDeviceConfig) -> SubDeviceConfig) -> World {
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[DRIVE] = change(declaration.subdevices[DRIVE].clone());
        declaration
    };
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut world = World::with(1, network, &Options::default(), declare).expect("scan and activation");
    world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
    world.settle();
    world
}

/// Writes the register, and checks that the SubDevice is in a state then.
fn registers(config: SubDeviceConfig, transition: Transition, value: u8, state: AlState) -> SubDeviceConfig {
    let at = |access, address| {
        StartupAction::Register(RegisterCommand::new(address, access).with_retries(3).with_required(true))
    };
    let (data, mask) = (vec![state.code(), 0], Some(vec![0x0F, 0]));
    let check = RegisterAccess::Check { data, mask, limit: Duration::ZERO };
    let config = config.startup(transition, at(check, map::AL_STATUS));
    config.startup(transition, at(RegisterAccess::Write(vec![value, 0x77]), LAST))
}

fn last(world: &World) -> u8 {
    world.network().device(DeviceIndex(DRIVE)).controller.register(LAST, 2)[0]
}

/// Subindices of object 0x2001 that the device got in downloads, and the states in which it served them.
fn served(world: &World) -> Vec<(AlState, u8)> {
    let download = |mail: &ServedMail| match SdoRequest::decode(&mail.payload).ok()? {
        SdoRequest::DownloadExpedited { index: 0x2001, sub_index, .. } => Some((mail.state, sub_index)),
        _ => None,
    };
    let device = world.network().device(DeviceIndex(DRIVE));
    device.application.served_mail().iter().filter_map(download).collect()
}

fn request(world: &mut World, state: AlState) -> Result<(), ConfigureError> {
    let requested = world.application_mut().engine_mut().start_state_request(SubDeviceId(DRIVE), state);
    world.finish(LIMIT, requested)
}

fn go(world: &mut World, states: &[AlState]) {
    for state in states {
        request(world, *state).unwrap_or_else(|error| panic!("{state}: {error}"));
        let is = world.network().device(DeviceIndex(DRIVE)).al_status().al_state();
        assert_eq!(is, Some(*state));
    }
}

/// Mail at each way to INIT, and registers.
fn ways_to_init(config: SubDeviceConfig) -> SubDeviceConfig {
    let ways = [(Transition::Pi, 1), (Transition::Si, 2), (Transition::Oi, 3)];
    ways.into_iter().fold(config, |config, (transition, number)| {
        // The registers first: each kind is sent in the state that suits it.
        let config = registers(config, transition, number, AlState::Init);
        config.sdo_at(transition, 0x2001, number, [number, 0])
    })
}

// covers: 5.1, 8.2, startup-commands
#[test]
fn on_the_ways_to_init_mail_is_sent_before_it_and_registers_in_it() {
    use AlState::{Init, Op, PreOp, SafeOp};
    let mut world = world(ways_to_init);
    assert_eq!((served(&world), last(&world) > 3), (Vec::new(), true), "nothing on the way up");
    for (state, number) in [(PreOp, 1), (SafeOp, 2), (Op, 3)] {
        world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
        go(&mut world, &[state, Init]);
        assert_eq!((served(&world), last(&world)), (vec![(state, number)], number), "{state}");
    }
    go(&mut world, &[Op]);
    world.settle();
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
}

// covers: 5.1, startup-commands
#[test]
fn neither_the_recovery_nor_a_change_to_preop_sends_commands_of_ways_to_init() {
    let mut world = world(ways_to_init);
    let before = last(&world);
    world.power_off(DeviceIndex(DRIVE));
    world.run_cycles(20);
    world.power_on(DeviceIndex(DRIVE));
    world.settle();
    go(&mut world, &[AlState::PreOp, AlState::Op]);
    // Its watchdog expires.
    world.stall(Duration::from_millis(150));
    world.run_cycles(5);
    world.settle();
    assert_eq!((served(&world), last(&world)), (Vec::new(), before));
}

// covers: 5.1, 8.2, startup-commands
#[test]
fn commands_of_init_to_init_are_sent_at_each_bring_up_but_not_behind_a_way_to_init() {
    use AlState::{Init, Op};
    let all = |config| registers(ways_to_init(config), Transition::Ii, 9, Init);
    let mut world = world(all);
    assert_eq!(last(&world), 9, "from the scan");
    go(&mut world, &[Init]);
    assert_eq!(last(&world), 3, "OI alone");
    go(&mut world, &[Init]);
    assert_eq!(last(&world), 9, "INIT was requested again");
    go(&mut world, &[Op, Init, Op]);
    assert_eq!(last(&world), 9, "from INIT to OP");
    go(&mut world, &[Init]);
    world.power_off(DeviceIndex(DRIVE));
    world.run_cycles(20);
    world.power_on(DeviceIndex(DRIVE));
    world.until(LIMIT, "it is back", |world| last(world) == 9);
}

// covers: 5.1, 8.2, startup-commands
#[test]
fn a_state_that_is_requested_again_gets_its_commands_each_time() {
    use AlState::{Op, PreOp, SafeOp};
    let again = |config: SubDeviceConfig| {
        let config = registers(config, Transition::Pp, 4, PreOp).sdo_at(Transition::Pp, 0x2001, 4, [4, 0]);
        registers(config, Transition::Ss, 5, SafeOp).sdo_at(Transition::Ss, 0x2001, 5, [5, 0])
    };
    let mut world = world(again);
    go(&mut world, &[PreOp, SafeOp, Op, Op]);
    assert_eq!(served(&world), [], "no state was requested again that has commands");
    go(&mut world, &[PreOp, PreOp, PreOp]);
    assert_eq!((served(&world), last(&world)), (vec![(PreOp, 4); 2], 4));
    go(&mut world, &[SafeOp]);
    world.run_cycles(50);
    let mark = world.mark();
    go(&mut world, &[SafeOp]);
    world.run_cycles(50);
    assert_eq!(world.incomplete(mark), 0, "process data goes on");
    assert_eq!((served(&world), last(&world)), (vec![(PreOp, 4), (PreOp, 4), (SafeOp, 5)], 5));
    go(&mut world, &[Op]);
    world.settle();
}

// covers: 5.1, startup-commands
#[test]
fn a_refused_command_at_a_repeated_request_is_an_error_and_the_state_stays() {
    let mut world = world(|config| config.sdo_at(Transition::Pp, 0x5FFF, 1, [1]));
    go(&mut world, &[AlState::PreOp]);
    let error = request(&mut world, AlState::PreOp).expect_err("there is no such object").to_string();
    assert!(error.starts_with("start-up command 0 (PREOP to PREOP): SDO 0x5fff:01: aborted"), "{error}");
    world.run_cycles(100);
    assert_eq!(world.network().device(DeviceIndex(DRIVE)).al_status().al_state(), Some(AlState::PreOp));
    go(&mut world, &[AlState::Op]);
    world.settle();
}

// covers: 5.1, startup-commands
#[test]
fn a_refused_command_on_the_way_to_init_is_an_error_and_the_subdevice_stays_in_op() {
    let mut world = world(|config| config.sdo_at(Transition::Oi, 0x5FFF, 1, [1]));
    let mark = world.mark();
    let error = request(&mut world, AlState::Init).expect_err("there is no such object").to_string();
    assert!(error.starts_with("start-up command 0 (OP to INIT): SDO 0x5fff:01: aborted"), "{error}");
    world.run_cycles(200);
    assert_eq!(world.network().device(DeviceIndex(DRIVE)).al_status().al_state(), Some(AlState::Op));
    assert_eq!(world.left_op(mark), [], "its outputs went on");
}

// covers: 5.1, 8.2, startup-commands
#[test]
fn commands_to_boot_and_back_are_sent_in_init_and_through_the_mailbox_of_boot() {
    use AlState::{Boot, Init, Op};
    let boots = |config| registers(registers(config, Transition::Ib, 6, Init), Transition::Bi, 7, Init);
    let mut world = self::world(boots);
    go(&mut world, &[Boot]);
    assert_eq!(last(&world), 6);
    go(&mut world, &[Init]);
    assert_eq!(last(&world), 7);
    go(&mut world, &[Boot, Op]);
    assert_eq!(last(&world), 7);
    world.settle();
    // A boot loader without CoE gets the command, and refuses it.
    for (transition, path) in [(Transition::Ib, "INIT to BOOT"), (Transition::Bi, "BOOT to INIT")] {
        let mut world = self::world(|config| config.sdo_at(transition, 0x2001, 8, [8, 0]));
        let result = request(&mut world, Boot).and_then(|()| request(&mut world, Init));
        let error = result.expect_err("there is no CoE in BOOT").to_string();
        assert!(error.starts_with(&format!("start-up command 0 ({path}): SDO 0x2001:08")), "{error}");
        assert_eq!(served(&world).first(), Some(&(Boot, 8)));
    }
}
