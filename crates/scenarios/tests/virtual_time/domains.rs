//! Process data in several domains, in more than one frame, with absent SubDevices.

use std::time::Duration;

use ringcat::{
    Declaration, Direction, DomainConfig, DomainId, DomainMember, DomainState, Event, Options, PdoEntry, PdoMapping,
    Scan, SubDeviceConfig, SubDeviceId, SubDeviceState, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::AlState;
use ringcat_wire::register::{SyncManager, map};
use scenarios::check::{Delivery, ring_events};
use scenarios::segments::{SIXTEEN, descriptions, line, ring, ring_of_16};
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);

// covers: domains
#[test]
fn process_data_in_several_frames_is_complete_in_line_and_ring_through_a_cut() {
    let kinds = ["block", "digital-output-8", "block", "block", "servo", "block", "block", "block", "digital-input-8"];
    let mut world = World::in_op(1, line(descriptions(&kinds), NetworkOptions::default()));
    let sent = world.application().cyclic_counters().sent;
    let mark = world.mark();
    world.run_cycles(100);
    let frames = (world.application().cyclic_counters().sent - sent) / 100;
    assert!(frames >= 4, "{frames} frames per cycle for 4.8 kB");
    assert_eq!(world.incomplete(mark), 0);

    let mut world = World::in_op(2, ring(descriptions(&kinds), NetworkOptions::default()));
    for cable in 0..=kinds.len() {
        let mark = world.mark();
        world.cut(CableId(cable));
        world.run_cycles(40);
        world.heal(CableId(cable));
        world.run_cycles(40);
        assert_eq!(world.left_op(mark), []);
        assert_eq!(ring_events(world.events(mark)).len(), 3);
        // Frames of 4.8 kB take 0.4 ms.
        assert!(world.incomplete(mark) <= 4, "cable {cable}: {}", world.incomplete(mark));
    }
    println!("{} bytes of process data compared in {frames} frames per cycle", world.compared());
}

/// The SubDevices one after the other in domains of these periods.
fn in_turn(scan: &Scan, periods: &[u32]) -> Declaration {
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    declaration.domains = periods
        .iter()
        .enumerate()
        .map(|(number, period)| {
            let members = (number..scan.subdevices.len()).step_by(periods.len());
            let members = members.into_iter().map(|subdevice| DomainMember::new(SubDeviceId(subdevice)));
            DomainConfig::new(*period * CYCLE, members.collect())
        })
        .collect();
    declaration
}

// covers: domains
#[test]
fn domains_with_different_periods_are_exchanged_at_their_own_rate() {
    let declare = |scan: &Scan| in_turn(scan, &[1, 4, 10]);
    let mut world = World::with(3, ring_of_16(FAST), &Options::default(), declare).expect("activation");
    world.settle();
    let mark = world.mark();
    world.run_cycles(400);
    for (domain, expected) in [400, 100, 40].into_iter().enumerate() {
        let evaluated = world.evaluated(mark).iter().filter(|evaluated| evaluated.domain == DomainId(domain)).count();
        assert_eq!(evaluated, expected, "domain {domain}");
    }
    assert_eq!(world.incomplete(mark), 0);
    for cable in [0, 5, 16] {
        let mark = world.mark();
        world.cut(CableId(cable));
        world.run_cycles(60);
        world.heal(CableId(cable));
        world.run_cycles(60);
        assert_eq!((world.left_op(mark), ring_events(world.events(mark)).len()), (vec![], 3));
    }
    assert!(world.compared() > 10_000);
}

// covers: domains
#[test]
fn outputs_and_inputs_of_one_subdevice_may_be_in_different_domains() {
    let kinds = ["block", "servo", "digital-input-8"];
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let member = |subdevice, sync_managers: &[u8]| {
            DomainMember::new(subdevice).with_sync_managers((!sync_managers.is_empty()).then(|| sync_managers.to_vec()))
        };
        declaration.domains = vec![
            DomainConfig::new(CYCLE, vec![member(SubDeviceId(0), &[0]), member(SubDeviceId(1), &[2])]),
            DomainConfig::new(
                2 * CYCLE,
                vec![member(SubDeviceId(0), &[1]), member(SubDeviceId(1), &[3]), member(SubDeviceId(2), &[])],
            ),
        ];
        declaration
    };
    for network in
        [line(descriptions(&kinds), NetworkOptions::default()), ring(descriptions(&kinds), NetworkOptions::default())]
    {
        let mut world = World::with(4, network, &Options::default(), declare).expect("activation");
        world.settle();
        // The block copies outputs to inputs; its outputs are now newer than those that the slow domain read.
        world.evaluate_latched(false);
        let mark = world.mark();
        world.run_cycles(200);
        assert_eq!(world.incomplete(mark), 0);
        assert_eq!(world.evaluated(mark).len(), 300);
    }
}

/// Declares an absent analogue input of four channels with known process data.
fn optional_analog_input(position: u16) -> SubDeviceConfig {
    let channel = |channel: u16| {
        let index = 0x6000 + 0x10 * channel;
        PdoMapping::of(0x1A00 + 2 * channel, [PdoEntry::new(index, 1, 16), PdoEntry::new(index, 0x11, 16)])
    };
    let pdos = (0..4).map(channel).collect();
    SubDeviceConfig::at_position(position).optional().assign(3, Direction::Inputs, pdos)
}

// covers: domains
#[test]
fn an_optional_subdevice_that_is_absent_at_first_joins_when_it_appears() {
    let kinds = ["coupler", "digital-output-8", "analog-input-4"];
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices.push(optional_analog_input(2));
        declaration.domains[0].members.push(DomainMember::new(SubDeviceId(2)));
        declaration
    };
    let mut network = line(descriptions(&kinds), NetworkOptions::default());
    network.power_off(DeviceIndex(2));
    let mut world = World::with(5, network, &Options::default(), declare).expect("activation");
    world.until(Duration::from_secs(1), "the others settled", |world| world.application().all_settled());
    world.run_cycles(20);
    assert!(
        world.saw(world.beginning(), |event| *event == Event::Missing { subdevice: SubDeviceId(2), optional: true })
    );
    assert_eq!(world.application().states()[2], SubDeviceState::Absent);
    assert!(!world.evaluated(world.beginning()).last().expect("cycles went by").delivery.is_incomplete());
    let mark = world.mark();
    world.power_on(DeviceIndex(2));
    world.until(Duration::from_secs(1), "all in OP", |world| {
        world.all_in_op() && world.application().states()[2] == SubDeviceState::Settled(AlState::Op)
    });
    world.recognise();
    world.run_cycles(50);
    assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
    assert_eq!(world.left_op(mark), []);
    assert!(world.saw(mark, |event| *event == Event::Returned { subdevice: SubDeviceId(2) }));
    let status = world.evaluated(mark).last().expect("cycles went by").status;
    assert_eq!((status.wkc, status.expected), (2, 2));
}

#[test]
fn an_undeclared_subdevice_is_reported_and_not_configured() {
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices.truncate(15);
        declaration.domains[0].members.truncate(15);
        declaration
    };
    let mut world = World::with(6, ring_of_16(FAST), &Options::default(), declare).expect("activation");
    world.settle();
    world.run_cycles(1_500);
    let unexpected = world.events(world.beginning()).iter().filter(|timed| {
        matches!(timed.event, Event::Unexpected { position, identity }
            if position.0 == 15 && identity.product_code == 0x1B96_0402)
    });
    assert_eq!(unexpected.count(), 1);
    assert_eq!(world.network().device(DeviceIndex(15)).al_status().al_state(), Some(AlState::Init));
    // It does not prevent the return of others.
    let mark = world.mark();
    world.power_off(DeviceIndex(3));
    world.run_cycles(30);
    world.power_on(DeviceIndex(3));
    world.until(Duration::from_secs(2), "back", |world| world.application().all_settled());
    assert!(!world.saw(mark, |event| matches!(event, Event::Unexpected { .. })));
    assert_eq!(SIXTEEN.len() - 1, world.application().states().len());
}

/// The PDI has disabled the SyncManager of the only inputs from the beginning (protocol 3.5): the state of the domain
/// is always Zero.
// covers: lost-frames
#[test]
fn a_domain_without_a_response_from_the_start_is_reported_once() {
    let network = line(descriptions(&["digital-input-8"]), NetworkOptions::default());
    let mut world = World::new(1, network);
    let mark = world.beginning();
    for _ in 0..3_000 {
        let now = world.now();
        let controller = &mut world.network_mut().device_mut(DeviceIndex(0)).controller;
        for number in 0..4 {
            let pdi_control = map::sync_manager(number).offset(SyncManager::PDI_CONTROL);
            controller.pdi_write(pdi_control, &[1], now);
        }
        world.cycle();
    }
    assert!(
        world.saw(mark, |event| matches!(event, Event::StateReached { subdevice: SubDeviceId(0), .. })),
        "it does not know of it"
    );
    let reports = world.events(mark).iter().filter_map(|timed| match timed.event {
        Event::Domain { domain, status, .. } => Some((domain, status.state, status.wkc, status.returned)),
        _ => None,
    });
    assert_eq!(reports.collect::<Vec<_>>(), [(DomainId(0), DomainState::Zero, 0, true)]);
}
