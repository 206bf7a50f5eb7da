//! The handle of a SubDevice in all its forms, and what its errors say.

use std::error::Error as StdError;
use std::ops::ControlFlow;
use std::path::Path;
use std::thread;
use std::time::Duration;

use ringcat::shared_segment::SharedSegment;
use ringcat::sim::application::foe::firmware;
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{
    AlState, Declaration, Error, Idn, LastOutputs, LoopControl, MainDevice, Options, Position, RegisterAddress,
    SubDeviceConfig, SubDeviceFailure, SubDeviceId, SupervisorThread, TransferLimits,
};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n\
                       [[device]]\ntype = \"servo\"\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);
const MAILBOX_DEVICE: Position = Position(1);
/// Memory that nothing uses.
const USER_RAM: RegisterAddress = RegisterAddress(0x0F80);

fn declaration() -> (Declaration, [SubDeviceId; 3]) {
    let mut declaration = Declaration::new(PERIOD);
    let subdevices = [0, 1, 2].map(|at| declaration.add(SubDeviceConfig::at_position(at)));
    (declaration, subdevices)
}

fn main_device() -> Result<MainDevice<SimulatedSegment>, Error> {
    Ok(MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default()))
}

fn failure<T: std::fmt::Debug>(result: Result<T, Error>) -> SubDeviceFailure {
    match result {
        Err(Error::SubDevice(error)) => error.failure,
        other => panic!("expected an error of a SubDevice, got {other:?}"),
    }
}

// covers: api
#[test]
fn before_a_scan_without_a_mailbox_and_not_declared_are_different_errors() -> Result<(), Box<dyn StdError>> {
    let mut main_device = main_device()?;
    let early = main_device.subdevice(MAILBOX_DEVICE).sdo_read::<u16>(0x2001, 7);
    assert_eq!(failure(early), SubDeviceFailure::NotScanned);
    main_device.scan()?;
    let nowhere = main_device.subdevice(Position(99)).sdo_read::<u16>(0x2001, 7);
    assert_eq!(failure(nowhere), SubDeviceFailure::NoPosition { scanned: 3 });
    let coupler = main_device.subdevice(Position(0)).sdo_read::<u16>(0x2001, 7).expect_err("no mailbox");
    let text = coupler.to_string();
    assert!(text.starts_with("SubDevice at position 0 \"") && text.ends_with(": it has no mailbox"), "{text}");

    let (declaration, [coupler, ..]) = declaration();
    let mut application = main_device.activate(declaration)?;
    application.wait_until_op(LIMIT)?;
    let mut read = |subdevice| {
        let pending = application.subdevice(subdevice).sdo_read::<u16>(0x2001, 7);
        failure(application.cycle_until(pending, LIMIT, |_| ()))
    };
    assert_eq!(read(SubDeviceId(99)), SubDeviceFailure::NotDeclared { declared: 3 });
    assert_eq!(read(coupler), SubDeviceFailure::NoMailbox);
    Ok(())
}

// covers: api
#[test]
fn objects_files_idns_and_registers_before_activation_by_position() -> Result<(), Box<dyn StdError>> {
    let mut main_device = main_device()?;
    main_device.scan()?;
    main_device.subdevice(MAILBOX_DEVICE).sdo_write(0x2001, 7, 0x1234u16)?;
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_read::<u16>(0x2001, 7)?, 0x1234);
    let wrong = main_device.subdevice(MAILBOX_DEVICE).sdo_read::<u32>(0x2001, 7).expect_err("it has two bytes");
    assert!(wrong.to_string().ends_with("SDO 0x2001:07: expected 4 bytes, got 2"), "{wrong}");
    let objects = main_device.subdevice(MAILBOX_DEVICE).sdo_info()?;
    assert!(objects.contains(&0x2001) && objects.contains(&0x1018), "{objects:?}");
    assert!(!main_device.subdevice(MAILBOX_DEVICE).sdo_object(0x1018)?.name.is_empty());
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_entry(0x2001, 7)?.bit_length, 16);
    let refused = main_device.subdevice(MAILBOX_DEVICE).sdo_read::<u8>(0x7777, 0).expect_err("there is none");
    assert!(refused.to_string().contains("0x06020000"), "{refused}");
    let Error::SubDevice(refused) = refused else { panic!("{refused:?}") };
    assert!(matches!(refused.failure, SubDeviceFailure::Sdo(_)), "{refused:?}");
    let short = TransferLimits::default().with_bytes(10);
    let long = main_device.subdevice(MAILBOX_DEVICE).limits(short).sdo_read::<Vec<u8>>(0x2002, 0);
    assert!(matches!(failure(long), SubDeviceFailure::Sdo(_)));

    let drive = Idn::standard(0, 47);
    main_device.subdevice(MAILBOX_DEVICE).soe_write(0, drive, -5i32)?;
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).soe_read::<i32>(0, drive)?, -5);
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).foe_write("recipe", vec![7; 3000])?, 3000);
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).foe_read("recipe")?, [7; 3000]);
    let unknown = main_device.subdevice(MAILBOX_DEVICE).foe_read("nothing").expect_err("no such file");
    assert!(unknown.to_string().contains("FoE \"nothing\": refused"), "{unknown}");

    main_device.subdevice(Position(0)).register_write(USER_RAM, 0xBEEFu16)?;
    assert_eq!(main_device.subdevice(Position(0)).register_read::<u16>(USER_RAM)?, 0xBEEF);
    assert_eq!(main_device.subdevice(Position(0)).port(0)?, LoopControl::Auto);
    let registers = main_device.subdevice(MAILBOX_DEVICE).state()?;
    assert_eq!(registers.status.al_state(), Some(AlState::PreOp), "its mailbox was used");
    Ok(())
}

// covers: api
#[test]
fn firmware_is_written_through_boot_and_the_new_version_is_reported() -> Result<(), Box<dyn StdError>> {
    let mut main_device = main_device()?;
    main_device.scan()?;
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_read::<String>(0x100A, 0)?, "1.0");
    main_device.subdevice(MAILBOX_DEVICE).request_state(AlState::Boot)?;
    main_device.subdevice(MAILBOX_DEVICE).foe_write("firmware.bin", firmware::image("2.7", &[0x5A; 20_000]))?;
    main_device.subdevice(MAILBOX_DEVICE).request_state(AlState::Init)?;
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_read::<String>(0x100A, 0)?, "2.7");
    Ok(())
}

// covers: api
#[test]
fn an_overall_limit_ends_what_takes_too_long() -> Result<(), Box<dyn StdError>> {
    let mut main_device = main_device()?;
    main_device.scan()?;
    let limit = Duration::from_millis(3);
    let late = main_device.subdevice(MAILBOX_DEVICE).within(limit).sdo_read::<Vec<u8>>(0x2002, 0);
    assert_eq!(failure(late), SubDeviceFailure::TimedOut { limit });
    assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_read::<Vec<u8>>(0x2002, 0)?.len(), 100_000);
    Ok(())
}

#[test]
fn work_that_does_not_end_in_time_beside_cycles_is_given_up() -> Result<(), Box<dyn StdError>> {
    let mut main_device = main_device()?;
    main_device.scan()?;
    let (declaration, [_, mailbox_device, drive]) = declaration();
    let mut application = main_device.activate(declaration)?;
    application.wait_until_op(LIMIT)?;
    let large = application.subdevice(mailbox_device).sdo_read::<Vec<u8>>(0x2002, 0);
    let late = application.cycle_until(large, 5 * PERIOD, |_| ());
    assert!(matches!(late, Err(Error::TimedOut { .. })), "{late:?}");
    let position = application.subdevice(drive).sdo_read::<i32>(0x6064, 0);
    application.cycle_until(position, LIMIT, |_| ())?;
    application.links_mut().network_mut().power_off(DeviceIndex(2));
    for _ in 0..50 {
        application.cycle(|_| ());
    }
    let gone = application.subdevice(drive).sdo_read::<i32>(0x6064, 0);
    let text = application.cycle_until(gone, LIMIT, |_| ()).expect_err("it is off").to_string();
    assert!(text.starts_with("SubDevice 2 \"") && text.contains("mailbox is not in use"), "{text}");
    Ok(())
}

// covers: api
#[test]
fn any_thread_uses_a_subdevice_while_cycles_run() -> Result<(), Box<dyn StdError>> {
    let segment = Segment::from_toml(SEGMENT, Path::new("."))?;
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment)?);
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    assert_eq!(failure(supervisor.subdevice(MAILBOX_DEVICE).sdo_read::<u16>(0x2001, 7)), SubDeviceFailure::NotScanned);
    supervisor.scan()?;
    assert_eq!(failure(supervisor.subdevice(SubDeviceId(1)).sdo_info()), SubDeviceFailure::NotActive);
    let (declaration, [_, mailbox_device, drive]) = declaration();
    let cycles = supervisor.activate(declaration, cyclic)?.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    cycles.supervisor().wait_until_op(LIMIT)?;
    assert_eq!(failure(cycles.supervisor().subdevice(MAILBOX_DEVICE).sdo_info()), SubDeviceFailure::Active);
    let patient = TransferLimits::default().with_request(LIMIT).with_answer(LIMIT);
    thread::scope(|scope| {
        let threads = [mailbox_device, drive].map(|subdevice| {
            let supervisor = cycles.supervisor().clone();
            scope.spawn(move || {
                let subdevice = supervisor.subdevice(subdevice).limits(patient);
                // A handle is used again and again.
                (0..5).map(|_| subdevice.sdo_read::<u32>(0x1018, 1)).collect::<Result<Vec<u32>, Error>>()
            })
        });
        for thread in threads {
            assert_eq!(thread.join().expect("no panic").expect("it answers"), [0x0C47; 5]);
        }
    });
    let background = cycles.supervisor().background();
    let jobs = [0x1018, 0x1000]
        .map(|index| background.subdevice(drive).limits(patient).sdo_read::<u32>(index, u8::from(index == 0x1018)));
    let values: Vec<u32> = jobs.into_iter().map(|job| job.finish()).collect::<Result<_, Error>>()?;
    assert_eq!(values, [0x0C47, 0x0002_0192]);
    let drive = cycles.supervisor().subdevice(drive);
    drive.request_state(AlState::PreOp)?;
    assert_eq!(drive.state()?.status.al_state(), Some(AlState::PreOp));
    drive.request_state(AlState::Op)?;
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}
