//! What makes a cycle begin, and cycles whose steps the application takes itself, in virtual time.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Application, DomainId, DomainState, Links, MainDevice, Options, SubDeviceId, Trigger, automatic};
use ringcat_sim::cable::HostLink;
use ringcat_sim::fault::Fault;

const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\n\
                       [[device]]\ntype = \"digital-input-8\"\n[[device]]\ntype = \"servo\"\n";
const PERIOD: Duration = Duration::from_millis(1);

fn activated() -> Application<SimulatedSegment> {
    let links = SimulatedSegment::from_toml(SEGMENT).expect("a good segment");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("four SubDevices");
    main_device.activate(automatic(&scan.subdevices, PERIOD)).expect("fits a frame")
}

fn in_op() -> Application<SimulatedSegment> {
    let mut application = activated();
    for _ in 0..5_000 {
        if application.all_settled() {
            break;
        }
        application.cycle(|_| ());
    }
    assert!(application.all_settled());
    application
}

/// Times between the beginnings of so many cycles.
fn gaps(application: &mut Application<SimulatedSegment>, count: usize) -> Vec<Duration> {
    let begins: Vec<_> = (0..=count).map(|_| application.cycle(|data| data.now())).collect();
    begins.windows(2).map(|pair| pair[1].since(pair[0])).collect()
}

// covers: cycles
#[test]
fn cycles_follow_each_other_as_soon_as_their_frames_have_returned() {
    let mut application = in_op();
    application.set_trigger(Trigger::FramesReturned { at_least: Duration::ZERO });
    gaps(&mut application, 5);
    let before = application.cyclic_counters();
    let gaps = gaps(&mut application, 100);
    let round_trip = application.round_trips().shortest();
    assert!(round_trip > Duration::ZERO && round_trip < PERIOD / 10, "{round_trip:?}");
    for gap in gaps {
        assert!(gap >= round_trip && gap < PERIOD / 5, "{gap:?}");
    }
    let after = application.cyclic_counters();
    assert_eq!((after.lost, after.skipped, after.incomplete), (before.lost, before.skipped, before.incomplete));
    assert_eq!(
        application.cycle(|data| data.status(DomainId(0))).expect("it is declared").state,
        DomainState::Complete
    );
    assert_eq!(application.pace().skipped, 0);
}

// covers: cycles
#[test]
fn the_least_time_between_two_cycles_is_kept() {
    let mut application = in_op();
    let at_least = Duration::from_micros(400);
    application.set_trigger(Trigger::FramesReturned { at_least });
    gaps(&mut application, 5);
    for gap in gaps(&mut application, 100) {
        assert!(gap >= at_least && gap < at_least + PERIOD / 10, "{gap:?}");
    }
}

// covers: cycles
#[test]
fn frames_that_do_not_return_are_waited_for_a_period_and_no_longer() {
    let mut application = in_op();
    application.set_trigger(Trigger::FramesReturned { at_least: Duration::ZERO });
    gaps(&mut application, 5);
    let network = application.links_mut().network_mut();
    let cable = network.host_cable(HostLink::Main).expect("it is plugged in");
    network.apply(Fault::Cut(cable));
    gaps(&mut application, 3);
    for gap in gaps(&mut application, 20) {
        assert_eq!(gap, PERIOD);
    }
    assert_eq!(application.cycle(|data| data.status(DomainId(0))).expect("it is declared").state, DomainState::Zero);
    application.links_mut().network_mut().apply(Fault::Heal(cable));
    gaps(&mut application, 3);
    let healed = gaps(&mut application, 20);
    assert!(healed.iter().any(|gap| *gap < PERIOD / 5), "{healed:?}");
}

// covers: cycles
#[test]
fn everything_else_goes_on_beside_cycles_that_leave_no_pause() {
    let mut application = activated();
    application.set_trigger(Trigger::FramesReturned { at_least: Duration::ZERO });
    let limit = application.now() + Duration::from_secs(5);
    while !application.all_settled() {
        assert!(application.now() < limit, "{:?}", application.states());
        application.cycle(|_| ());
    }
}

// covers: cycles
#[test]
fn an_application_may_take_the_steps_of_a_cycle_itself() {
    let mut application = activated();
    let output = application.entry(SubDeviceId(1), 0x7000, 1).expect("the terminal's first channel");
    let domain = DomainId(0);
    let mut next = application.now();
    for cycle in 0..1_000 {
        next += PERIOD;
        while application.now() < next {
            application.links_mut().wait(next);
            application.receive();
        }
        let status = application.process(domain);
        application.process_data().write(&output, 1).expect("it is an output");
        assert!(application.queue(domain));
        application.send();
        if application.all_settled() && status.state == DomainState::Complete && cycle > 100 {
            let devices = application.links().network().devices();
            assert_eq!(devices.map(|device| device.outputs().to_vec()).nth(1), Some(vec![1]));
            assert_eq!(application.pace().cycles, cycle + 1);
            return;
        }
    }
    panic!("{:?}", application.states());
}
