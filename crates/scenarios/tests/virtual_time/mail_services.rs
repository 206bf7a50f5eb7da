//! Mailbox services of the MainDevice: before activation, from the cyclic thread, and firmware in BOOT.

use std::time::Duration;

use ringcat::{
    Limits, MainDevice, Options, Position, RequestFailure, RequestState, SubDeviceId, TransferLimits, automatic,
};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::Bytes;
use ringcat_sim::application::foe::firmware;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::sdo::AbortCode;
use scenarios::segments::{descriptions, line, ring_of_16};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
const TRANSFER: TransferLimits = TransferLimits::new(LIMITS.request, LIMITS.answer);
const KINDS: [&str; 3] = ["coupler", "all-protocols", "digital-output-8"];

type Device<'a> = ringcat::SubDevice<&'a mut MainDevice<Tap>>;

fn device(main_device: &mut MainDevice<Tap>, position: u16) -> Device<'_> {
    main_device.subdevice(Position(position)).limits(TRANSFER.with_bytes(200_000))
}

// covers: jobs, sdo
#[test]
fn objects_are_accessible_before_activation_which_reconfigures_all() {
    let mut main_device =
        MainDevice::request(Tap::new(line(descriptions(&KINDS), NetworkOptions::default())), &Options::default());
    let scan = main_device.scan().expect("a scan");
    device(&mut main_device, 1).sdo_write(0x2001, 7, vec![0x34u8, 0x12]).expect("it is there");
    assert_eq!(device(&mut main_device, 1).sdo_read::<Vec<u8>>(0x2001, 7).expect("it is there"), [0x34, 0x12]);
    let large = device(&mut main_device, 1).sdo_read::<Vec<u8>>(0x2002, 0).expect("in segments");
    assert_eq!(large.len(), 100_000);
    let error = device(&mut main_device, 1).sdo_read::<u16>(0x7777, 0).expect_err("there is no such object");
    assert!(error.to_string().contains("0x06020000 Object does not exist"), "{error}");
    let error = device(&mut main_device, 2).sdo_read::<u16>(0x2001, 7).expect_err("it has no mailbox");
    assert!(error.to_string().contains("mailbox"), "{error}");
    let mut application = main_device.activate(automatic(&scan.subdevices, CYCLE)).expect("activation");
    for _ in 0..2000 {
        application.cycle(|_| ());
    }
    assert!(application.all_settled());
}

// covers: jobs, sdo
#[test]
fn requests_are_reused_from_the_cyclic_thread() {
    let mut world = World::in_op(1, ring_of_16(Duration::from_micros(10)));
    let mut request = world.application_mut().engine_mut().create_sdo_request(SubDeviceId(3), 16);
    let busy = |world: &mut World, request: &ringcat::SdoRequest| {
        let mut cycles = 0;
        while request.state() == RequestState::Busy {
            world.cycle();
            cycles += 1;
            assert!(cycles < 3000);
        }
        cycles
    };
    for round in 0..5u16 {
        request.set_object(0x8000 + 0x10 * (round % 4), 1, false).unwrap();
        request.write(&round.to_le_bytes()).unwrap();
        busy(&mut world, &request);
        assert_eq!(request.state(), RequestState::Success);
        request.read().unwrap();
        let cycles = busy(&mut world, &request);
        assert!(cycles <= 4, "{cycles} cycles of 1 ms");
        let mut value = [0; 16];
        assert_eq!(request.data(&mut value), 2);
        assert_eq!(value[..2], round.to_le_bytes());
    }
    request.set_object(0x7777, 0, false).unwrap();
    request.read().unwrap();
    busy(&mut world, &request);
    assert_eq!(request.failure(), Some(RequestFailure::Aborted(AbortCode::OBJECT_DOES_NOT_EXIST)));
    request.set_timeout(Duration::from_millis(20)).unwrap();
    request.set_object(0x8000, 1, false).unwrap();
    world.hang(DeviceIndex(3), true);
    request.read().unwrap();
    let cycles = busy(&mut world, &request);
    assert_eq!(request.failure(), Some(RequestFailure::Timeout));
    assert!((19..25).contains(&cycles), "{cycles} cycles of 1 ms");
    world.hang(DeviceIndex(3), false);
    world.power_off(DeviceIndex(3));
    world.run_cycles(20);
    request.read().unwrap();
    busy(&mut world, &request);
    assert_eq!(request.failure(), Some(RequestFailure::Failed));
}

// covers: 6.4, foe
#[test]
fn firmware_is_written_in_boot_and_the_new_version_is_reported() {
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
    main_device.scan().expect("a scan");
    let version = |main_device: &mut MainDevice<_>| {
        main_device.subdevice(Position(1)).sdo_read::<Vec<u8>>(0x100A, 0).expect("a version")
    };
    assert_eq!(version(&mut main_device), b"1.0");
    main_device.subdevice(Position(1)).request_state(AlState::Boot).expect("it has a boot loader");
    let image = firmware::image("2.7", &[0x5A; 20_000]);
    let mailbox = main_device.engine().mailbox(Position(1)).expect("it was visited");
    let written = main_device.run(async move {
        foe::write(&mailbox, "firmware.bin", FoeOptions::default(), &mut Bytes::new(&image), |_| ()).await
    });
    assert_eq!(written, Ok(20_000 + 4 + 1 + 3 + 4));
    main_device.subdevice(Position(1)).request_state(AlState::Init).expect("it leaves the boot loader");
    assert_eq!(version(&mut main_device), b"2.7");
}
