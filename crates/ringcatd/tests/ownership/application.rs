//! The first application of the guide, on the bus of a daemon: only the constructor differs.

use std::time::Duration;

use ringcat::daemon::OwnedBus;
use ringcat::{AlState, Declaration, LastOutputs, Options, SubDeviceConfig};

use crate::bench::Bench;

// covers: daemon, api
#[test]
fn the_first_application_needs_another_constructor_only() {
    let bench = Bench::start(4);
    for _ in 0..2 {
        let taken = OwnedBus::take(&bench.socket, 0, "first", &Options::default(), || ());
        let mut main_device = taken.expect("the daemon drives it");
        let found = main_device.scan().expect("it is known").subdevices;
        assert_eq!(found.len(), 4);
        let mut declaration = Declaration::new(Duration::from_millis(1));
        let lamps = declaration.add(SubDeviceConfig::at_position(0).expect_product(0x0C47, 0x07D8_0008));
        let buttons = declaration.add(SubDeviceConfig::at_position(1));
        let mut application = main_device.activate(declaration).expect("it fits");
        let again = main_device.activate(Declaration::new(Duration::from_millis(1)));
        assert!(again.is_err(), "an application has the links");
        let lamp = application.output::<bool>(lamps, 0x7000, 1).expect("it is there");
        let button = application.input_named::<bool>(buttons, "Channel 1.Input").expect("it is there");
        application.wait_until_op(Duration::from_secs(10)).expect("all reach OP");
        for _ in 0..20 {
            application.cycle(|data| {
                let pressed = data.get(button);
                data.set(lamp, !pressed);
            });
        }
        assert_eq!(bench.states()[0].al_state(), Some(AlState::Op));
        application.stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(5)).expect("it stops");
        main_device.release().expect("the daemon takes it");
        bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
    }
}

// covers: daemon
#[test]
fn a_declaration_that_does_not_fit_leaves_the_links_for_another_attempt() {
    let bench = Bench::start(2);
    let mut bus = bench.take();
    let mut wrong = Declaration::new(Duration::from_millis(1));
    wrong.add(SubDeviceConfig::at_position(0).expect_product(1, 2));
    bus.activate(wrong).expect_err("it is another product");
    let right = ringcat::automatic(&bus.scan().expect("it is known").subdevices, Duration::from_millis(1));
    bus.activate(right).expect("it fits").wait_until_op(Duration::from_secs(10)).expect("all reach OP");
}
