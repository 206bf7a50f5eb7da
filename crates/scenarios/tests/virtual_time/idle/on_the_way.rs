//! An application is activated while SubDevices are on their way to PREOP: by the same MainDevice, or by the next
//! owner, which does not wait for them.

use ringcat::{AlState, Handover, Knowledge, Required};
use ringcat_sim::description::{DeviceDescription, TransitionTimes};
use ringcat_sim::network::Network;
use scenarios::calls::configure::syncs_of;
use scenarios::segments::describe;

use super::*;

/// Step between two moments.
const STEP: Duration = Duration::from_micros(700);
/// SubDevices with a mailbox, and one without.
const WITH_MAILBOXES: [&str; 4] = ["servo", "all-protocols", "digital-output-8", "analog-input-4"];
/// SubDevices with outputs and without a mailbox; the state machine of two is in the controller.
const WITH_OUTPUTS: [&str; 4] = ["digital-output-8", "emulated-output-8", "digital-output-16", "emulated-output-8"];
/// Longest way from the activation to OP, besides slow transitions.
const START: Duration = Duration::from_millis(1_500);

/// What happens at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Moment {
    /// The MainDevice itself activates an application.
    Activated,
    /// Another process goes on, and activates an application at once.
    HandedOver,
    /// The same after a crash.
    Crashed,
}

const MOMENTS: [Moment; 3] = [Moment::Activated, Moment::HandedOver, Moment::Crashed];

/// A declaration that names all devices by their positions, with their PDOs, present or not.
fn declaration(devices: &[DeviceDescription]) -> Declaration {
    let mut declaration = Declaration::new(CYCLE).with_required(Required::Nothing);
    for (at, device) in (0..).zip(devices) {
        let (vendor, product) = (device.identity.vendor_id, device.identity.product_code);
        let config = SubDeviceConfig::at_alias(0, at).expect_product(vendor, product);
        let assign = |config: SubDeviceConfig, sync: scenarios::calls::configure::SyncInfo| {
            config.assign(sync.index, sync.direction, sync.pdos)
        };
        declaration.add(syncs_of(device).into_iter().fold(config, assign));
    }
    declaration
}

fn networks_of(devices: &[DeviceDescription]) -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(devices.to_vec(), options()), ring(devices.to_vec(), options())]
}

/// The application of the moment.
fn begin(main_device: MainDevice<Tap>, moment: Moment, declared: Declaration) -> Application<Tap> {
    let handover = match moment {
        Moment::Activated => None,
        Moment::HandedOver => Some(Handover::Orderly),
        Moment::Crashed => Some(Handover::AfterCrash),
    };
    let next = match (handover, main_device.knowledge()) {
        (Some(handover), Some(knowledge)) => {
            let knowledge = Knowledge::from_bytes(&knowledge.to_bytes()).expect("they were written");
            let mut next = MainDevice::request(Tap::new(main_device.into_links().into_network()), &options());
            next.resume(knowledge, handover).expect("the segment answers");
            next
        }
        // Nothing is known yet, or the same goes on.
        _ => main_device,
    };
    next.activate(declared).map_err(Error::from).expect("it fits")
}

/// Runs until all are in OP with complete data, also inside the devices.
fn reach_op(application: &mut Application<Tap>, limit: Duration, text: &str) {
    let end = application.now() + limit;
    let op = AlStatus::new(AlState::Op);
    let is_running = |application: &mut Application<Tap>| {
        let status = application.process(DomainId(0));
        application.all_settled() && status.wkc == status.expected
    };
    while !is_running(application) {
        let states: Vec<AlStatus> = application.links().network().devices().map(|it| it.al_status()).collect();
        let events: Vec<TimedEvent> = std::iter::from_fn(|| application.pop_event()).collect();
        assert!(application.now() < end, "{text}: {:?}, {states:?}, {events:?}", application.states());
        cycles(application, 10);
    }
    cycles(application, 10);
    assert!(application.links().network().devices().all(|it| it.al_status() == op), "{text}");
}

/// All moments from power-on until all are in PREOP.
fn at_every_moment(devices: &[DeviceDescription], until: Duration, mut each: impl FnMut(&mut MainDevice<Tap>, u32)) {
    let mut number = 0;
    for moment in MOMENTS {
        for network in 0..2 {
            let mut at = Duration::ZERO;
            while at < until {
                let network = networks_of(devices).into_iter().nth(network).expect("two");
                let mut main_device = MainDevice::request(Tap::new(network), &options());
                main_device.attend(at);
                each(&mut main_device, number);
                let text = format!("{moment:?} after {at:?}");
                let mut application = begin(main_device, moment, declaration(devices));
                let slowest = devices.iter().map(|it| it.transitions.to_init + it.transitions.to_preop).max();
                reach_op(&mut application, START + 4 * slowest.unwrap_or_default(), &text);
                // And at every moment after the end of an application.
                let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
                ended.attend(at / 4);
                let mut application = ended.activate(declaration(devices)).map_err(Error::from).expect("it fits");
                reach_op(&mut application, START + 4 * slowest.unwrap_or_default(), &format!("{text}, again"));
                at += STEP * (1 + number % 3);
                number += 1;
            }
        }
    }
}

fn described(kinds: &[&str]) -> Vec<DeviceDescription> {
    kinds.iter().enumerate().map(|(at, kind)| describe(kind, &format!("{kind}-{at}"))).collect()
}

// covers: states, mailbox
#[test]
fn mailboxes_on_their_way_to_preop_reach_op_at_every_moment() {
    at_every_moment(&described(&WITH_MAILBOXES), Duration::from_millis(110), |_, _| ());
}

// covers: states
#[test]
fn outputs_on_their_way_to_preop_reach_op_at_every_moment() {
    at_every_moment(&described(&WITH_OUTPUTS), Duration::from_millis(60), |_, _| ());
}

// covers: states
#[test]
fn slow_and_quick_transitions_to_preop_are_followed_at_every_moment() {
    let times = [0, 100, 7_000, 45_000].map(Duration::from_micros);
    for round in 0..times.len() {
        let mut devices = described(&WITH_MAILBOXES);
        for (at, device) in devices.iter_mut().enumerate() {
            let [quick, slow] = [times[(at + round) % 4], times[(at + round + 2) % 4]];
            device.transitions = TransitionTimes { to_init: quick, to_preop: slow, back: quick, ..Default::default() };
        }
        at_every_moment(&devices, Duration::from_millis(160), |_, _| ());
    }
}

// covers: states, lost-frames
#[test]
fn losses_on_the_way_to_preop_are_no_obstacle() {
    at_every_moment(&described(&WITH_MAILBOXES), Duration::from_millis(110), |main_device, number| {
        let count = 1 + number % 4;
        apply(main_device, Fault::Drop { cable: CableId(number as usize % 4), direction: None, count });
        main_device.attend(Duration::from_micros(u64::from(number % 7) * 100));
    });
}

// covers: states, eeprom
#[test]
fn an_eeprom_that_is_read_on_the_way_to_preop_is_no_obstacle() {
    at_every_moment(&described(&WITH_MAILBOXES), Duration::from_millis(110), |main_device, number| {
        let position = Position((number % 4) as u16);
        let reading = main_device.engine_mut().start_sii_read(position);
        main_device.attend(Duration::from_micros(u64::from(number % 11) * 300));
        drop(reading);
    });
}

/// One SubDevice does not react to a request: the others answer and reach OP as without it, and it follows when it
/// does.
// covers: states, refused-states
#[test]
fn a_request_that_is_never_followed_delays_others_by_its_limit_only() {
    let devices = described(&WITH_MAILBOXES);
    for network in networks_of(&devices) {
        let mut main_device = MainDevice::request(Tap::new(network), &options());
        apply(&mut main_device, Fault::Hang(DeviceIndex(1), true));
        main_device.attend(FOLLOWED);
        let limit = Duration::from_millis(100);
        let begun = main_device.now();
        let asked = main_device.request_state_of_all(AlState::PreOp, ringcat::StateScope::All, limit);
        let took = main_device.now().since(begun);
        assert!(asked.is_err() && took < limit + Duration::from_millis(10), "{asked:?} after {took:?}");
        for at in [0, 3] {
            let begun = main_device.now();
            main_device.subdevice(Position(at)).sdo_read::<u32>(0x1018, 1).expect("it answers");
            assert!(main_device.now().since(begun) < Duration::from_millis(20));
        }
        let mut application = begin(main_device, Moment::Activated, declaration(&devices));
        cycles(&mut application, 150);
        let op = AlStatus::new(AlState::Op);
        let others = [0, 2, 3].map(|at| application.links().network().device(DeviceIndex(at)).al_status());
        assert_eq!(others, [op; 3], "within 150 ms");
        // A deactivation waits for it as long as its limit permits, and the others are in PREOP.
        let begun = application.now();
        let refused = application.deactivate(LastOutputs::Zero, limit).expect_err("device 1 hangs");
        let mut ended = refused.main_device;
        assert!(ended.now().since(begun) < limit + Duration::from_millis(30));
        let others = statuses(&mut ended);
        assert_eq!([others[0], others[2], others[3]], [PREOP; 3]);
        apply(&mut ended, Fault::Hang(DeviceIndex(1), false));
        let mut application = begin(ended, Moment::Activated, declaration(&devices));
        reach_op(&mut application, Duration::from_secs(8), "it reacts again");
    }
}
