//! Reports of single datagrams whose working counters differ; evaluated by the frames on the links.

use std::collections::BTreeMap;
use std::time::Duration;

use ringcat::{
    Application, DomainId, Error, Event, LogFilter, MainDevice, Options, Position, Services, SubDeviceId, Subject,
    Subjects, TimedEvent, TransferLimits, automatic, text,
};
use ringcat_engine::{Class, class_of};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{LogicalAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::Frame;
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::witness::{Frames, Passed, Witness};
use scenarios::world::CYCLE;

const FOLLOWED: Duration = Duration::from_millis(400);
const LIMIT: Duration = Duration::from_secs(5);
const LIMITS: TransferLimits = TransferLimits::new(Duration::from_secs(1), Duration::from_secs(5)).with_bytes(200_000);

type Links = Witness<Tap>;
/// Byte 1 of the source address, and Idx.
type FrameId = (u8, u8);
/// Logical address and working counter.
type Counters = Vec<(u32, u16)>;

/// The last SubDevice but one has inputs.
fn kinds(count: usize) -> Vec<&'static str> {
    let others = ["all-protocols", "digital-output-8"].into_iter().cycle();
    let first = ["coupler"].into_iter().chain(others).take(count - 2);
    first.chain(["digital-input-8", "digital-output-8"]).collect()
}

fn networks() -> Vec<Network> {
    let options = || NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    let of = |count| [line(descriptions(&kinds(count)), options()), ring(descriptions(&kinds(count)), options())];
    [4, 24].into_iter().flat_map(of).collect()
}

fn idle(network: Network) -> (MainDevice<Links>, Frames) {
    let (links, frames) = Witness::new(Tap::new(network));
    let mut main_device = MainDevice::request(links, &Options::default().with_idle_operation(true));
    main_device.attend(FOLLOWED);
    while main_device.pop_event().is_some() {}
    (main_device, frames)
}

fn in_op(network: Network) -> (Application<Links>, Frames) {
    let (main_device, frames) = idle(network);
    let declaration = automatic(&main_device.subdevices(), CYCLE);
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    application.wait_until_op(LIMIT).expect("all are well");
    while application.pop_event().is_some() {}
    (application, frames)
}

fn is_report(timed: &TimedEvent) -> bool {
    matches!(timed.event, Event::CyclicCommand { .. } | Event::AcyclicCommand { .. })
}

/// The reports in cycles.
fn run(application: &mut Application<Links>, cycles: usize) -> Vec<TimedEvent> {
    let mut reports = Vec::new();
    for _ in 0..cycles {
        application.cycle(|_| ());
        reports.extend(std::iter::from_fn(|| application.pop_event()).filter(is_report));
    }
    reports
}

/// Working counters of cyclic datagrams that came back, copies of a frame added, by logical address.
fn seen(passed: &[Passed]) -> BTreeMap<u32, Vec<u16>> {
    let mut frames: Vec<(FrameId, Counters)> = Vec::new();
    let cyclic = passed.iter().filter(|it| !it.is_sent && class_of(&it.frame) == Some(Class::Cyclic));
    for Passed { frame, .. } in cyclic {
        let parsed = Frame::parse(frame).expect("it is intact");
        let logical =
            parsed.datagrams().filter(|it| matches!(it.header.command, Command::Lrd | Command::Lwr | Command::Lrw));
        let counters: Counters = logical.map(|it| (it.header.logical().0, it.wkc.0)).collect();
        let id = (frame[7], frame[17]);
        match frames.iter_mut().rev().take(8).find(|(other, _)| *other == id) {
            Some((_, first)) => first.iter_mut().zip(counters).for_each(|(sum, (_, wkc))| sum.1 += wkc),
            None => frames.push((id, counters)),
        }
    }
    let mut all: BTreeMap<u32, Vec<u16>> = BTreeMap::new();
    for (logical, wkc) in frames.into_iter().flat_map(|(_, counters)| counters) {
        all.entry(logical).or_default().push(wkc);
    }
    all
}

// covers: jobs, no-allocation
#[test]
fn a_wrong_cyclic_working_counter_is_named_with_command_address_and_subdevice() {
    for network in networks() {
        let lost = SubDeviceId(network.devices().count() - 2);
        let (mut application, frames) = in_op(network);
        application.set_command_reports(true);
        assert_eq!(run(&mut application, 1_500).len(), 0, "nothing is wrong");
        let normal = seen(&frames.take());
        application.links_mut().links_mut().network_mut().power_off(DeviceIndex(lost.0));
        let reports = run(&mut application, 3_000);
        let wrong = seen(&frames.take());
        let mut last: BTreeMap<(u8, u32), u64> = BTreeMap::new();
        let mut named = 0;
        for TimedEvent { event, at, .. } in &reports {
            let Event::CyclicCommand { domain, command, logical, expected, got, cycles, subdevices, .. } = event else {
                continue;
            };
            let LogicalAddress(logical) = *logical;
            assert_eq!(*domain, DomainId(0));
            assert!(expected != got && *cycles > 0 && *cycles <= 3_000, "{event:?}");
            assert_eq!(normal[&logical].last(), Some(&expected.0), "{event:?}");
            let values = &wrong[&logical];
            assert!(values.contains(&got.0) || *got == Wkc(0), "{event:?}: {values:?}");
            let bad = values.iter().filter(|wkc| **wkc != expected.0).count() + usize::from(*got == Wkc(0)) * 3_000;
            assert!(*cycles as usize <= bad, "{event:?}: {bad}");
            if let Some(before) = last.insert((command.code(), logical), at.0) {
                assert!(at.0 - before >= 1_000_000_000, "at most one a second");
            }
            named += usize::from(subdevices.contains(&lost));
            let line = text::describe(&reports[0], &text::Names::default());
            assert!(line.contains("working counter"), "{line}");
        }
        assert!(named > 0, "{reports:#?}");
        application.set_command_reports(false);
        application.links_mut().links_mut().network_mut().power_on(DeviceIndex(lost.0));
        assert_eq!(run(&mut application, 2_000).len(), 0, "they are off");
    }
}

// covers: jobs
#[test]
fn an_acyclic_command_without_its_answer_is_reported_once_a_second_with_its_number() {
    for network in networks() {
        let device = network.devices().count() - 1;
        let (mut main_device, _) = idle(network);
        let station = main_device.subdevices()[device].station;
        let position = Position(device as u16);
        main_device.set_command_reports(true);
        let client = main_device.register_client(Subjects::NONE.with(Subject::Commands), 1000).expect("there is room");
        main_device.links_mut().links_mut().network_mut().power_off(DeviceIndex(device));
        // All begin before it is known that the SubDevice has left.
        let engine = main_device.engine_mut();
        let reads: Vec<_> = (0..5).map(|_| engine.start_register_read(position, map::BUILD, 2)).collect();
        main_device.attend(Duration::from_secs(3));
        for mut read in reads {
            assert!(read.take().is_some_and(|result| result.is_err()), "it has no power");
        }
        let events = main_device.client_events(client).expect("it is registered").events;
        let of_reads: Vec<(u64, u32)> = events
            .iter()
            .filter_map(|timed| match &timed.event {
                Event::AcyclicCommand { command: Command::Fprd, target, expected: Wkc(1), got: Wkc(0), count }
                    if *target == Target::Station(station, map::BUILD) =>
                {
                    assert_eq!(timed.occupants[0].map(|occupant| occupant.station), Some(station));
                    Some((timed.at.0, *count))
                }
                _ => None,
            })
            .collect();
        assert_eq!(of_reads.iter().map(|(_, count)| count).sum::<u32>(), 5, "{events:#?}");
        assert!(of_reads.len() <= 2, "{of_reads:?}");
        let line = text::describe(&events[0], &text::Names::default());
        assert!(line.contains("working counter 0 instead of 1"), "{line}");
    }
}

// covers: jobs, mailbox
#[test]
fn mail_states_and_polls_of_an_undisturbed_segment_give_no_report() {
    for network in networks() {
        let (mut main_device, _) = idle(network);
        main_device.set_command_reports(true);
        main_device.set_log_filter(LogFilter::default());
        let client = main_device.register_client(Subjects::NONE.with(Subject::Commands), 1000).expect("there is room");
        let read = main_device.subdevice(Position(1)).limits(LIMITS).sdo_read::<Vec<u8>>(0x2002, 0);
        assert_eq!(read.expect("it answers").len(), 100_000);
        main_device.attend(Duration::from_secs(2));
        let declaration = automatic(&main_device.subdevices(), CYCLE);
        let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
        application.wait_until_op(LIMIT).expect("all are well");
        run(&mut application, 2_000);
        let events = application.client_events(client).expect("it is registered").events;
        assert!(events.is_empty(), "{events:#?}");
    }
}
