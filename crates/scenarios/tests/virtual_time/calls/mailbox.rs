//! Mailbox calls and requests of the shape of `ecrt.h`: before activation, in OP, after it, to absent SubDevices.

use std::time::Duration;

use ringcat::{RequestState, SubDeviceId};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::register::map;
use scenarios::calls::errno::Errno;
use scenarios::calls::master::Ecrt;

use super::{LIMIT, assert_idle, configure, requested, run_all};

const IDENTITY: u16 = 0x1018;
/// A read-only object.
const DEVICE_TYPE: u16 = 0x1000;

fn answers(ecrt: &mut Ecrt, text: &str) {
    let vendor = ecrt.sdo_upload(0, IDENTITY, 1, 4);
    assert_eq!(vendor.map(|data| data.len()), Ok(4), "{text}");
    assert_eq!(ecrt.sdo_upload(0, IDENTITY, 1, 3), Err(Errno::NoBufs), "{text}");
    assert_eq!(ecrt.sdo_upload(99, IDENTITY, 1, 4), Err(Errno::Inval), "{text}");
    assert!(matches!(ecrt.sdo_upload(0, 0x5FFF, 0, 4), Err(Errno::Io(Some(_)))), "{text}: no such object");
    assert!(matches!(ecrt.sdo_download(0, DEVICE_TYPE, 0, &[0; 4]), Err(Errno::Io(Some(_)))), "{text}: read only");
}

// covers: api, sdo, jobs
#[test]
fn sdo_calls_answer_before_activation_in_op_and_after_it() {
    for (count, mut ecrt) in requested() {
        answers(&mut ecrt, "requested");
        configure(&mut ecrt, 0..count);
        answers(&mut ecrt, "configured");
        ecrt.activate().expect("it fits");
        // During the configuration the mailbox may be closed; the call ends in time nevertheless.
        let _ = ecrt.sdo_upload(0, IDENTITY, 1, 4);
        ecrt.cycle_until_op(LIMIT).expect("all are there");
        answers(&mut ecrt, "in OP");
        assert!(ecrt.is_running(), "{count}: {}", ecrt.describe());
        ecrt.deactivate().expect("all follow");
        answers(&mut ecrt, "deactivated");
        ecrt.release();
        ecrt.request().expect("it is free");
        answers(&mut ecrt, "requested again");
        assert_idle(&mut ecrt, "at the end");
    }
}

// covers: api, sdo
#[test]
fn sdo_calls_to_a_subdevice_without_power_end_in_time() {
    for (count, mut ecrt) in requested() {
        ecrt.network().apply(Fault::PowerOff(DeviceIndex(0)));
        assert!(ecrt.sdo_upload(0, IDENTITY, 1, 4).is_err(), "{count}, idle");
        ecrt.network().apply(Fault::PowerOn(DeviceIndex(0)));
        ecrt.pause(Duration::from_secs(1));
        answers(&mut ecrt, "it is back");
        run_all(&mut ecrt, count);
        ecrt.network().apply(Fault::PowerOff(DeviceIndex(0)));
        assert!(ecrt.sdo_upload(0, IDENTITY, 1, 4).is_err(), "{count}, active");
        ecrt.network().apply(Fault::PowerOn(DeviceIndex(0)));
        ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}: {error}"));
    }
}

/// Runs the usual loop until no request is busy.
fn wait(ecrt: &mut Ecrt) -> usize {
    let is_busy = |ecrt: &Ecrt| {
        let requests = &ecrt.requests;
        let sdo = requests.sdo.iter().any(|it| it.state() == RequestState::Busy);
        sdo || requests.register.iter().any(|it| it.state() == RequestState::Busy)
            || requests.soe.iter().any(|it| it.state() == RequestState::Busy)
            || requests.voe.iter().any(|it| it.state() == RequestState::Busy)
    };
    let mut cycles = 0;
    while is_busy(ecrt) {
        ecrt.cycle();
        cycles += 1;
        assert!(cycles < 2_500, "a request stays busy");
    }
    cycles
}

// covers: api, jobs
#[test]
fn requests_go_from_unused_through_busy_to_success_or_error() {
    for (count, mut ecrt) in requested() {
        let (_, configs) = configure(&mut ecrt, 0..count);
        ecrt.create_sdo_request(configs[0], IDENTITY, 1).expect("before activation");
        ecrt.create_sdo_request(configs[0], 0x5FFF, 0).expect("before activation");
        // Of a configuration that no SubDevice has.
        ecrt.create_sdo_request(SubDeviceId(99), IDENTITY, 1).expect("before activation");
        ecrt.create_reg_request(configs[0]).expect("before activation");
        ecrt.create_soe_request(configs[0]).expect("before activation");
        ecrt.create_voe_handler(configs[0]).expect("before activation");
        ecrt.activate().expect("it fits");
        assert_eq!(ecrt.create_sdo_request(configs[0], IDENTITY, 1), Err(Errno::Inval), "too late");
        ecrt.cycle_until_op(LIMIT).expect("all are there");
        for _ in 0..3 {
            for request in &mut ecrt.requests.sdo {
                request.read().expect("it is not busy");
            }
            ecrt.requests.register[0].read(map::TYPE, 1).expect("it is not busy");
            // A drive without SoE and VoE.
            ecrt.requests.soe[0].read().expect("it is not busy");
            ecrt.requests.voe[0].read().expect("it is not busy");
            assert_eq!(ecrt.requests.sdo[0].state(), RequestState::Busy);
            wait(&mut ecrt);
            let states: Vec<RequestState> = ecrt.requests.sdo.iter().map(|it| it.state()).collect();
            assert_eq!(states, [RequestState::Success, RequestState::Error, RequestState::Error], "{count}");
            assert_eq!(ecrt.requests.sdo[0].len(), 4);
            assert_eq!(ecrt.requests.register[0].state(), RequestState::Success);
            assert_eq!(ecrt.requests.soe[0].state(), RequestState::Error);
            assert_eq!(ecrt.requests.voe[0].state(), RequestState::Error);
        }
        assert!(ecrt.is_running(), "{count}: {}", ecrt.describe());
        // A request that is under way at the deactivation does not stay busy.
        let mut request = ecrt.requests.sdo.remove(0);
        request.read().expect("it is not busy");
        ecrt.deactivate().expect("all follow");
        ecrt.pause(Duration::from_secs(2));
        assert_ne!(request.state(), RequestState::Busy, "{count}: it stays busy after the application");
    }
}

// covers: api, sdo-information
#[test]
fn a_ring_of_emergencies_has_the_chosen_size_and_counts_overruns() {
    for (count, mut ecrt) in requested() {
        let (_, configs) = configure(&mut ecrt, 0..count);
        let ring = ecrt.emerg_size(configs[0], 3).expect("before activation");
        assert_eq!(Ecrt::emerg_pop(&ring), Err(Errno::NoEnt));
        ecrt.activate().expect("it fits");
        assert!(ecrt.emerg_size(configs[0], 5).is_err(), "too late");
        ecrt.cycle_until_op(LIMIT).expect("all are there");
        for code in 1..=5 {
            let emergency = Emergency { error_code: 0x1000 + code, error_register: 1, data: [0; 5] };
            assert!(ecrt.network().device_mut(DeviceIndex(0)).application.emergency(&emergency));
            ecrt.cycles(30);
        }
        assert_eq!((ring.len(), ring.overruns()), (3, 2), "{count}");
        let popped: Vec<u16> = std::iter::from_fn(|| Ecrt::emerg_pop(&ring).ok()).collect();
        assert_eq!(popped.len(), 3);
        ring.clear();
        assert_eq!((ring.overruns(), Ecrt::emerg_pop(&ring)), (0, Err(Errno::NoEnt)));
    }
}
