//! Requests that a cyclic thread makes and reuses: registers, IDNs, vendor messages; cancelled, timed out, to
//! unreachable SubDevices.

use std::time::Duration;

use ringcat::{
    RegisterRequest, RequestFailure, RequestRefused, RequestState, SdoRequest, SoeRequest, SubDeviceId, VoeHandler,
};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::mailbox::soe::{Idn, SoeElements, SoeErrorCode};
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

const KINDS: [&str; 4] = ["coupler", "digital-input-8", "all-protocols", "digital-output-8"];
/// The device with all protocols.
const ALL: usize = 2;
const VENDOR: u32 = 0x0C47;
/// Unused memory: user RAM.
const USER_RAM: RegisterAddress = RegisterAddress(0x0F80);

fn world(seed: u64) -> World {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    World::in_op(seed, ring(descriptions(&KINDS), options))
}

/// Cycles until a request is not busy; returns their number.
fn wait(world: &mut World, state: impl Fn() -> RequestState) -> u32 {
    let mut cycles = 0;
    while state() == RequestState::Busy {
        world.cycle();
        cycles += 1;
        assert!(cycles < 3000);
    }
    cycles
}

// covers: jobs
#[test]
fn registers_are_read_and_written_from_the_cyclic_thread_within_two_cycles() {
    let mut world = world(1);
    let mut request: RegisterRequest = world.application_mut().engine_mut().create_register_request(SubDeviceId(3), 64);
    let mark = world.mark();
    for round in 0..20u8 {
        request.write(USER_RAM, &[round, 1, 2, 3]).unwrap();
        assert_eq!(request.read(USER_RAM, 4), Err(RequestRefused::Busy));
        assert!(wait(&mut world, || request.state()) <= 2);
        request.read(USER_RAM, 4).unwrap();
        assert!(wait(&mut world, || request.state()) <= 2);
        let mut data = [0; 64];
        assert_eq!((request.state(), request.data(&mut data)), (RequestState::Success, 4));
        assert_eq!(data[..4], [round, 1, 2, 3]);
    }
    let device = world.network().device(DeviceIndex(3));
    assert_eq!(device.controller.register(USER_RAM, 4), [19, 1, 2, 3]);
    assert_eq!(request.read(USER_RAM, 65), Err(RequestRefused::TooLong { bytes: 65, limit: 64 }));
    assert_eq!(request.write(USER_RAM, &[0; 65]), Err(RequestRefused::TooLong { bytes: 65, limit: 64 }));
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
    // A missing SubDevice.
    world.power_off(DeviceIndex(3));
    request.read(map::TYPE, 2).unwrap();
    wait(&mut world, || request.state());
    assert_eq!(request.failure(), Some(RequestFailure::Failed));
    let mut absent = world.application_mut().engine_mut().create_register_request(SubDeviceId(99), 4);
    absent.read(map::TYPE, 1).unwrap();
    wait(&mut world, || absent.state());
    assert_eq!(absent.failure(), Some(RequestFailure::Failed));
}

// covers: registers
#[test]
fn registers_of_any_length_are_read_and_written_by_a_service() {
    let mut world = world(2);
    let data: Vec<u8> = (0..4000).map(|at| (at * 7 % 251) as u8).collect();
    let engine = world.application_mut().engine_mut();
    // Three datagrams, in memory behind the SyncManagers.
    let write = engine.start_register_write(SubDeviceId(3), RegisterAddress(0x2000), data.clone());
    assert_eq!(world.finish(Duration::from_secs(1), write), Ok(()));
    let read = world.application_mut().engine_mut().start_register_read(SubDeviceId(3), RegisterAddress(0x2000), 4000);
    assert_eq!(world.finish(Duration::from_secs(1), read), Ok(data));
    let read = world.application_mut().engine_mut().start_register_read(SubDeviceId(3), RegisterAddress(0xFFFF), 2);
    let error = world.finish(Duration::from_secs(1), read).expect_err("beyond the end");
    assert!(error.to_string().contains("the memory ends at 0xffff"), "{error}");
    let read = world.application_mut().engine_mut().start_register_read(SubDeviceId(99), map::TYPE, 1);
    let error = world.finish(Duration::from_secs(1), read).expect_err("absent");
    assert!(error.to_string().contains("there is no SubDevice 99"), "{error}");
}

// covers: jobs
#[test]
fn idns_are_read_and_written_from_the_cyclic_thread() {
    let mut world = world(3);
    let mut request: SoeRequest = world.application_mut().engine_mut().create_soe_request(SubDeviceId(ALL), 8000);
    request.set_idn(1, Idn::product(0, 1)).unwrap();
    request.read().unwrap();
    wait(&mut world, || request.state());
    let mut list = vec![0; 8000];
    let length = request.data(&mut list);
    assert!(request.state() == RequestState::Success && length >= 5000, "in fragments: {length} bytes");
    list.truncate(length);
    list[10] ^= 0xFF;
    request.write(&list).unwrap();
    wait(&mut world, || request.state());
    request.read().unwrap();
    wait(&mut world, || request.state());
    let mut again = vec![0; 8000];
    assert_eq!((request.data(&mut again), &again[..length]), (length, &list[..]));
    request.set_elements(0, Idn::standard(7, 4095), SoeElements::VALUE).unwrap();
    request.read().unwrap();
    wait(&mut world, || request.state());
    assert_eq!(request.failure(), Some(RequestFailure::Refused(SoeErrorCode::NO_IDN)));
}

// covers: jobs
#[test]
fn a_handler_moves_vendor_messages_with_and_without_the_mailbox_status() {
    let mut world = world(4);
    let mut handler: VoeHandler = world.application_mut().engine_mut().create_voe_handler(SubDeviceId(ALL), 200);
    assert_eq!(handler.received_header(), None);
    let mut sent = [0; 200];
    for round in 0..20u8 {
        sent.fill(round);
        let length = usize::from(round) * 10;
        handler.set_send_header(VENDOR, round.into()).unwrap();
        handler.write(&sent[..length]).unwrap();
        wait(&mut world, || handler.state());
        assert_eq!(handler.execute(), RequestState::Success);
        assert_eq!(handler.received_header(), None, "it was written");
        // The device sends each message back.
        if round % 2 == 0 { handler.read() } else { handler.read_directly() }.unwrap();
        let cycles = wait(&mut world, || handler.state());
        assert!(cycles <= 4, "{cycles} cycles of 1 ms");
        let mut got = [0; 200];
        assert_eq!((handler.execute(), handler.data(&mut got)), (RequestState::Success, length));
        let header = handler.received_header().map(|header| (header.vendor_id, header.vendor_type));
        assert_eq!((header, &got[..length]), (Some((VENDOR, round.into())), &sent[..length]));
    }
    for direct in [false, true] {
        handler.set_timeout(Duration::from_millis(20)).unwrap();
        if direct { handler.read_directly() } else { handler.read() }.unwrap();
        let cycles = wait(&mut world, || handler.state());
        assert!((19..25).contains(&cycles), "{cycles} cycles of 1 ms");
        assert_eq!(handler.failure(), Some(RequestFailure::Timeout), "there is no message");
    }
}

// covers: jobs
#[test]
fn a_request_that_is_cancelled_ends_and_the_next_one_is_not_disturbed() {
    let mut world = world(5);
    let mut request: SdoRequest = world.application_mut().engine_mut().create_sdo_request(SubDeviceId(ALL), 200_000);
    for cycles in [0, 1, 5, 10, 20] {
        request.set_object(0x2002, 0, false).unwrap();
        request.read().unwrap();
        world.run_cycles(cycles);
        assert_eq!(request.state(), RequestState::Busy, "100 kB in segments");
        request.cancel();
        assert!(wait(&mut world, || request.state()) <= 2);
        assert_eq!(request.failure(), Some(RequestFailure::Cancelled));
        request.set_object(0x2001, 7, false).unwrap();
        request.write(&[cycles as u8, 0]).unwrap();
        wait(&mut world, || request.state());
        request.read().unwrap();
        wait(&mut world, || request.state());
        let mut value = [0; 2];
        assert_eq!((request.state(), request.data(&mut value)), (RequestState::Success, 2));
        assert_eq!(value, [cycles as u8, 0]);
    }
}
