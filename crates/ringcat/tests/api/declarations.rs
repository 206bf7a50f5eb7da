//! Declarations that do not fit, that need no domain, or that leave something open.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{
    Application, Declaration, Direction, DomainConfig, DomainId, DomainMember, DomainState, Error, Event, MainDevice,
    Options, PdoEntry, PdoMapping, SubDeviceConfig, SubDeviceId, SubDeviceState, SyncSignals, automatic,
};
use ringcat_wire::al::AlState;

const SEGMENT: &str = r#"
[segment]
ring = true
[[device]]
type = "coupler"
[[device]]
type = "digital-output-8"
[[device]]
type = "digital-input-8"
"#;

const MILLISECOND: Duration = Duration::from_millis(1);

fn scanned(segment: &str) -> (MainDevice<SimulatedSegment>, Declaration) {
    let links = SimulatedSegment::from_toml(segment).expect("the segment is right");
    let mut main_device = MainDevice::request(links, &Options::default());
    let found = main_device.scan().expect("all answer");
    let declaration = automatic(&found.subdevices, MILLISECOND);
    (main_device, declaration)
}

fn refusal(
    main_device: MainDevice<SimulatedSegment>,
    declaration: Declaration,
) -> (String, MainDevice<SimulatedSegment>) {
    let refused = main_device.activate(declaration).expect_err("this cannot be activated");
    (refused.error.to_string(), refused.main_device)
}

fn run(application: &mut Application<SimulatedSegment>, cycles: usize) -> Vec<Event> {
    let mut events = Vec::new();
    for _ in 0..cycles {
        application.cycle(|_| ());
        events.extend(std::iter::from_fn(|| application.pop_event()).map(|timed| timed.event));
    }
    events
}

// covers: declaration
#[test]
fn what_is_wrong_is_named_and_the_main_device_is_there_for_another_try() -> Result<(), Error> {
    let (main_device, good) = scanned(SEGMENT);

    let mut twice = good.clone();
    let again = vec![DomainMember::new(SubDeviceId(1))];
    twice.domains.push(DomainConfig::new(MILLISECOND, again));
    let (text, mut main_device) = refusal(main_device, twice);
    assert_eq!(text, "activation: SubDevice 1: process data of SyncManager 0 is in domain 0 and in domain 1");

    for under_way in [0, 5] {
        let (text, again) = refusal(main_device, good.clone().with_under_way(under_way));
        main_device = again;
        assert_eq!(text, format!("activation: domain 0: expected 1 to 4 cycles under way, got {under_way}"));
    }

    let mut boot = good.clone();
    boot.subdevices[2].target = AlState::Boot;
    let (text, main_device) = refusal(main_device, boot);
    assert!(text.contains("SubDevice 2: expected target INIT, PREOP, SAFEOP or OP, got BOOT"), "{text}");

    let mut wrong = good.clone();
    wrong.subdevices[1] = SubDeviceConfig::at_position(1).expect_product(0xC47, 0x1234);
    let (text, main_device) = refusal(main_device, wrong);
    assert!(text.contains("position 1: expected product code 0x00001234, got 0x07d80008"), "{text}");

    let mut wrong = good.clone();
    wrong.domains.clear();
    let (text, main_device) = refusal(main_device, wrong);
    assert!(text.contains("SubDevice 1 has process data and there is no domain to exchange it"), "{text}");

    let mut sync = good.clone();
    sync.subdevices[1].sync = Some(SyncSignals::sync0(300_000, 0));
    let (text, main_device) = refusal(main_device, sync);
    let expected = "activation: SubDevice 1: SYNC0 every 300 us does not go with cycles of 1000 us: one must be a \
                    multiple of the other";
    assert_eq!(text, expected);

    let mut application = main_device.activate(good)?;
    run(&mut application, 100);
    assert!(application.all_settled());
    Ok(())
}

// covers: declaration
#[test]
fn domains_without_a_period_or_with_odd_ones_are_activated() -> Result<(), Error> {
    for period in [Duration::ZERO, Duration::from_micros(2500)] {
        let (main_device, mut declaration) = scanned(SEGMENT);
        declaration.domains.push(DomainConfig::new(period, Vec::new()));
        let mut application = main_device.activate(declaration)?;
        run(&mut application, 100);
        assert!(application.all_settled(), "{period:?}");
    }
    Ok(())
}

// covers: declaration
#[test]
fn outputs_that_come_slower_than_their_watchdog_are_named() -> Result<(), Error> {
    let (main_device, mut declaration) = scanned("[[device]]\ntype = \"servo\"\n");
    declaration.domains[0].period = Duration::from_millis(150);
    let mut application = main_device.activate(declaration)?;
    let events = run(&mut application, 1);
    let text = "its outputs come every 150 ms, its watchdog expires after 100 ms".to_owned();
    assert!(events.contains(&Event::DeclarationWarning { subdevice: SubDeviceId(0), what: text }), "{events:?}");
    Ok(())
}

// covers: declaration
#[test]
fn without_a_domain_subdevices_are_still_supervised() -> Result<(), Error> {
    let (main_device, found) = scanned(SEGMENT);
    let mut declaration = Declaration::default();
    declaration.subdevices = found.subdevices.into_iter().map(|config| config.target(AlState::PreOp)).collect();
    let mut application = main_device.activate(declaration)?;
    run(&mut application, 20);
    assert!(application.all_settled());
    let device = ringcat_sim::cable::DeviceIndex(1);
    application.links_mut().network_mut().power_off(device);
    let events = run(&mut application, 20);
    assert!(events.contains(&Event::Lost { subdevice: SubDeviceId(1) }), "{events:?}");
    application.links_mut().network_mut().power_on(device);
    run(&mut application, 20);
    assert!(application.all_settled());
    Ok(())
}

// covers: declaration
#[test]
fn a_subdevice_that_stays_in_preop_does_not_keep_a_domain_incomplete() -> Result<(), Error> {
    let (main_device, mut declaration) = scanned(SEGMENT);
    declaration.subdevices[1].target = AlState::PreOp;
    let mut application = main_device.activate(declaration)?;
    run(&mut application, 100);
    assert_eq!(application.states()[1], SubDeviceState::Settled(AlState::PreOp));
    assert_eq!(application.exchange_mut().status(DomainId(0)).expect("it is declared").state, DomainState::Complete);
    Ok(())
}

// covers: declaration
#[test]
fn an_absent_optional_subdevice_has_its_place_and_leaves_the_domain_complete() -> Result<(), Error> {
    let (main_device, mut declaration) = scanned(SEGMENT);
    let entries: Vec<PdoEntry> = (1..=8).map(|sub_index| PdoEntry::new(0x6000, sub_index, 1)).collect();
    let pdos = vec![PdoMapping::of(0x1A00, entries)];
    let absent =
        SubDeviceConfig::at_position(3).expect_product(0xC47, 0x4711).optional().assign(0, Direction::Inputs, pdos);
    declaration.subdevices.push(absent);
    declaration.subdevices.push(SubDeviceConfig::at_position(4).expect_product(0xC47, 0x4712).optional());
    let members = [3, 4].map(|subdevice| DomainMember::new(SubDeviceId(subdevice)));
    declaration.domains[0].members.extend(members);
    let mut application = main_device.activate(declaration)?;
    let entry = application.entry(SubDeviceId(3), 0x6000, 3).expect("the declaration says where it lies");
    assert_eq!((entry.bit_length, entry.bit_offset % 8), (1, 2));
    let events = run(&mut application, 100);
    let without_place = |event: &Event| matches!(event, Event::DeclarationWarning { subdevice: SubDeviceId(4), .. });
    assert!(events.iter().any(without_place), "{events:?}");
    assert!(application.all_settled());
    assert_eq!(application.exchange_mut().status(DomainId(0)).expect("it is declared").state, DomainState::Complete);
    Ok(())
}
