//! Ethernet through mailboxes: IP stacks on the host and behind the SubDevice, frames beside every other protocol,
//! losses, SubDevices that leave and return.

use std::net::Ipv4Addr;
use std::time::Duration;

use ringcat::{Event, Limits, Options, SubDeviceId, automatic};
use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_engine::mail::eoe::{
    self, EoeFailure, EthernetCounters, EthernetPort, IpSettings, QUEUE, QueueError, TimeStamp,
};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_engine::mail::{MailboxError, Unsolicited};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::description::{DeviceDescription, EoeEnd};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::mailbox::eoe::{AddressFilter, EoeResult};
use scenarios::ethernet_host::{Addresses, Download, download};
use scenarios::loss::Loss;
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::{CYCLE, World};

const LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(2));
const KINDS: [&str; 4] = ["coupler", "digital-input-8", "ethernet-terminal", "all-protocols"];
/// The EoE devices.
const TERMINAL: usize = 2;
const ALL: usize = 3;
const ADDRESSES: Addresses = Addresses { mac: [2, 0, 0, 0, 0, 9], host: [10, 0, 0, 1], device: [10, 0, 0, 2] };
/// Longest mailbox that a datagram reads.
const LARGE_MAILBOX: u16 = 1486;

fn device(description: &mut DeviceDescription, address: [u8; 4]) {
    description.services.eoe.address = Some(address.into());
    description.services.eoe.mask = Some(Ipv4Addr::new(255, 255, 255, 0));
}

fn segment(mailbox_bytes: u16, end: EoeEnd) -> Vec<DeviceDescription> {
    let mut segment = descriptions(&KINDS);
    device(&mut segment[TERMINAL], [10, 0, 0, 2]);
    device(&mut segment[ALL], [10, 0, 0, 2]);
    for description in &mut segment[TERMINAL..] {
        assert!(description.set_mailbox_bytes(mailbox_bytes));
        description.services.eoe.end = end;
    }
    segment
}

fn world(seed: u64, mailbox_bytes: u16, end: EoeEnd) -> World {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    World::in_op(seed, ring(segment(mailbox_bytes, end), options))
}

fn start_download(
    world: &mut World,
    subdevice: usize,
    bytes: usize,
) -> ringcat_engine::main_device::Pending<(Result<Download, String>, EthernetCounters)> {
    let mailbox = world.mailbox(subdevice);
    let bus = mailbox.bus().clone();
    world.start(async move {
        let port = EthernetPort::open(&mailbox).expect("the port is free");
        let result = download(bus, &port, ADDRESSES, bytes, Duration::from_secs(30)).await;
        (result, port.status().counters)
    })
}

// covers: 6.5, eoe
#[test]
fn the_throughput_of_tcp_does_not_depend_on_the_cycle() {
    for cycle in [1, 10] {
        let network = line(segment(LARGE_MAILBOX, EoeEnd::Stack), NetworkOptions::default());
        let cycle = Duration::from_millis(cycle);
        let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, cycle);
        let mut world = World::with(1, network, &Options::default(), declare).expect("it can be activated");
        world.settle();
        let work = start_download(&mut world, TERMINAL, 200_000);
        let (result, counters) = world.finish(Duration::from_secs(30), work);
        let rate = result.expect("all of it").kilobytes_per_second();
        println!("cycle of {} ms: {rate:.0} kB/s; {counters:?}", cycle.as_millis());
        assert!(rate >= 300.0, "{rate:.0} kB/s at a cycle of {} ms", cycle.as_millis());
        assert_eq!((counters.rx_lost, counters.rx_overruns, counters.tx_dropped, counters.malformed), (0, 0, 0, 0));
    }
}

// covers: byte-budget, eoe
#[test]
fn a_download_shares_the_mailbox_with_objects_and_files() {
    let mut world = world(2, 512, EoeEnd::Stack);
    let mark = world.mark();
    let work = start_download(&mut world, ALL, 100_000);
    let mailbox = world.mailbox(ALL);
    let objects = world.start(async move {
        let data: Vec<u8> = (0..100_000).map(|at| (at * 7 % 253) as u8).collect();
        let large = SdoAddress::new(0x2002, 0);
        coe::write(&mailbox, large, &data, LIMITS).await.unwrap();
        assert_eq!(coe::read(&mailbox, large, LIMITS, data.len()).await.unwrap(), data);
        mailbox.bus().now()
    });
    let mailbox = world.mailbox(ALL);
    let files = world.start(async move {
        let data = vec![0x5A; 50_000];
        let options = FoeOptions::default().with_limits(LIMITS);
        foe::write(&mailbox, "recipe", options, &mut Bytes::new(&data), |_| ()).await.unwrap();
        let mut sink = Bounded::new(data.len());
        foe::read(&mailbox, "recipe", options, &mut sink, |_| ()).await.unwrap();
        assert_eq!(sink.into_bytes(), data);
        mailbox.bus().now()
    });
    let (result, counters) = world.finish(Duration::from_secs(30), work);
    let rate = result.expect("all of it").kilobytes_per_second();
    for other in [objects, files] {
        world.finish(Duration::from_secs(10), other);
    }
    println!("{rate:.0} kB/s beside objects and files; {counters:?}");
    assert!(rate >= 50.0, "{rate:.0} kB/s: the others take all of the mailbox");
    let mail = world.mailbox(ALL).counters();
    assert_eq!((mail.unclaimed, mail.duplicates, mail.repeats), (0, 0, 0));
    assert_eq!((counters.rx_lost, counters.rx_overruns), (0, 0));
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
}

// covers: 6.2, eoe
#[test]
fn cuts_and_lost_mail_lose_no_frame() {
    let mut world = world(3, LARGE_MAILBOX, EoeEnd::Stack);
    let station = world.station_of(TERMINAL);
    let mailbox = world.mailbox(TERMINAL);
    let send = 0x1000 + LARGE_MAILBOX;
    let work = start_download(&mut world, TERMINAL, 150_000);
    for round in 0..12 {
        world.lose(Loss::of_write(station, 0x1000).times(2, 3));
        world.lose(Loss::of_read(station, send).on_the_way_back().times(2, 5));
        world.lose(Loss::of_read(station, send).times(2, 11));
        let cable = CableId([2, 3, 0, 4, 1][round % 5]);
        world.run_cycles(3);
        world.cut(cable);
        world.run_cycles(5);
        world.heal(cable);
        world.run_cycles(3);
    }
    let (result, counters) = world.finish(Duration::from_secs(30), work);
    println!("{result:?}; {counters:?}");
    result.expect("all of it");
    assert_eq!((counters.rx_lost, counters.tx_dropped, counters.malformed), (0, 0, 0));
    let mail = mailbox.counters();
    assert!(mail.repeats > 0 && mail.rewritten > 0, "{mail:?}");
}

// covers: eoe
#[test]
fn an_ethernet_port_goes_down_and_up_with_its_subdevice() {
    let mut world = world(4, 256, EoeEnd::Loop);
    let mailbox = world.mailbox(TERMINAL);
    let port = EthernetPort::open(&mailbox).expect("the port is free");
    assert!(EthernetPort::open(&mailbox).is_none(), "there is one port");
    let frame: Vec<u8> = (0..1514u32).map(|at| (at % 251) as u8).collect();
    assert!(port.is_up());
    for _ in 0..QUEUE {
        port.send(&frame).expect("there is room");
    }
    assert_eq!((port.send(&frame), port.room()), (Err(QueueError::Full), 0));
    world.run_cycles(5);
    world.power_off(DeviceIndex(TERMINAL));
    world.run_cycles(20);
    assert_eq!((port.is_up(), port.room(), port.send(&frame)), (false, 0, Err(QueueError::Down)));
    let counters = port.status().counters;
    assert_eq!(counters.tx_frames + counters.tx_dropped, QUEUE as u64, "each is accounted for: {counters:?}");
    assert!(counters.tx_dropped > 10, "{counters:?}");
    world.power_on(DeviceIndex(TERMINAL));
    world.settle();
    while port.pop_frame().is_some() {}
    port.send(&frame).expect("it is up");
    world.run_cycles(50);
    let back = port.pop_frame().expect("it came back");
    assert_eq!((back.bytes == frame, back.time_ns, port.pop_frame()), (true, None, None));
    // Without a port, fragments are unsolicited mail; with a new port they are frames again.
    drop(port);
    let port = EthernetPort::open(&mailbox).expect("it is free again");
    port.send(&frame).expect("it is up");
    world.run_cycles(50);
    assert_eq!(port.pop_frame().map(|frame| frame.bytes.len()), Some(1514));
    assert_eq!(mailbox.pop_unsolicited(Unsolicited::Ethernet), None);
}

// covers: eoe
#[test]
fn a_subdevice_that_accepts_no_frames_blocks_its_queue_only() {
    let mut world = world(5, 256, EoeEnd::Loop);
    let port = EthernetPort::open(&world.mailbox(TERMINAL)).expect("the port is free");
    world.hang(DeviceIndex(TERMINAL), true);
    let mut taken = 0;
    for _ in 0..400 {
        taken += usize::from(port.send(&[0xAA; 60]).is_ok());
        world.cycle();
    }
    assert!(taken <= QUEUE + 2, "{taken} frames");
    // After its time limit a frame is dropped, and the next one is sent.
    world.run_cycles(800);
    let counters = port.status().counters;
    assert!((1..=4).contains(&counters.tx_dropped), "{counters:?}");
    world.hang(DeviceIndex(TERMINAL), false);
    world.run_cycles(100);
    let status = port.status();
    assert_eq!((status.queued, status.counters.tx_frames + status.counters.tx_dropped), (0, taken as u64));
}

// covers: 6.5, eoe
#[test]
fn addresses_and_filter_are_set_and_read_beside_frames() {
    let mut world = world(6, 256, EoeEnd::Stack);
    let work = start_download(&mut world, TERMINAL, 20_000);
    let mailbox = world.mailbox(TERMINAL);
    let settings = IpSettings::default()
        .with_gateway(Ipv4Addr::new(10, 0, 0, 254))
        .with_dns(Ipv4Addr::new(9, 9, 9, 9))
        .with_name(b"drive".to_vec());
    let (own, sent) = (mailbox.clone(), settings.clone());
    let reports = world.run(async move {
        eoe::set_ip(&own, 0, &sent, LIMITS).await?;
        eoe::read_ip(&own, 0, LIMITS).await
    });
    let reports = reports.expect("it has an IP stack");
    assert_eq!((reports.gateway, reports.dns, &reports.name), (settings.gateway, settings.dns, &settings.name));
    assert_eq!(reports.address, Some(Ipv4Addr::new(10, 0, 0, 2)), "what was not set stays");
    let filter = AddressFilter::new(&[[2, 0, 0, 0, 0, 1]], &[], true).expect("one address");
    let own = mailbox.clone();
    let back = world.run(async move {
        eoe::set_filter(&own, 0, filter, LIMITS).await?;
        eoe::read_filter(&own, 0, LIMITS).await
    });
    assert_eq!(back, Ok(filter));
    let own = mailbox.clone();
    let multicast = IpSettings::default().with_address(Ipv4Addr::new(224, 0, 0, 1));
    let refused = world.run(async move { eoe::set_ip(&own, 0, &multicast, LIMITS).await }).expect_err("no address");
    assert_eq!(refused.cause, EoeFailure::Refused(EoeResult::UNSPECIFIED));
    assert!(refused.to_string().contains("EoE port 0: the SubDevice refused: 0x0001 Unspecified"), "{refused}");
    let long = IpSettings::default().with_name(vec![b'x'; 33]);
    let refused = world.run(async move { eoe::set_ip(&mailbox, 0, &long, LIMITS).await }).expect_err("too long");
    assert_eq!(refused.cause, EoeFailure::LongName { bytes: 33 });
    world.finish(Duration::from_secs(10), work).0.expect("all of it");
    world.power_off(DeviceIndex(TERMINAL));
    world.run_cycles(20);
    let own = world.mailbox(TERMINAL);
    let closed = world.run(async move { eoe::read_ip(&own, 0, LIMITS).await }).expect_err("it has no power");
    assert_eq!(closed.cause, EoeFailure::Mailbox(MailboxError::Closed));
}

// covers: 6.5, eoe
#[test]
fn a_time_stamp_comes_with_the_number_of_its_frame() {
    let mut world = world(7, 128, EoeEnd::Nothing);
    let port = EthernetPort::open(&world.mailbox(TERMINAL)).expect("the port is free");
    let frame = vec![0x11; 300];
    let numbers: Vec<u8> = (0..3).map(|_| port.send_with_time(&frame).expect("there is room")).collect();
    port.send(&frame).expect("there is room");
    world.run_cycles(50);
    let stamps: Vec<TimeStamp> = std::iter::from_fn(|| port.pop_time_stamp()).collect();
    assert_eq!(stamps.iter().map(|stamp| stamp.frame).collect::<Vec<_>>(), numbers);
    assert!(stamps.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns), "{stamps:?}");
}

// covers: 6.5, eoe
#[test]
fn declared_addresses_are_set_at_each_start_and_refusals_reported() {
    let address = Some(Ipv4Addr::new(10, 0, 0, 7));
    let settings = IpSettings::default().with_address(address).with_name(b"axis".to_vec());
    let start = |settings: &IpSettings, subdevice: usize| {
        let network = line(segment(256, EoeEnd::Stack), NetworkOptions::default());
        World::with(8, network, &Options::default(), |scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.subdevices[subdevice] = declaration.subdevices[subdevice].clone().ip(settings.clone());
            declaration
        })
    };
    let mut world = start(&settings, TERMINAL).expect("it can be activated");
    for _ in 0..2 {
        world.settle();
        let own = world.mailbox(TERMINAL);
        let reports = world.run(async move { eoe::read_ip(&own, 0, LIMITS).await }).expect("it has an IP stack");
        assert_eq!((reports.address, &reports.name), (settings.address, &settings.name));
        // It loses them without power.
        world.power_off(DeviceIndex(TERMINAL));
        world.run_cycles(20);
        world.power_on(DeviceIndex(TERMINAL));
    }
    let multicast = IpSettings::default().with_address(Ipv4Addr::new(224, 0, 0, 1));
    let mut world = start(&multicast, TERMINAL).expect("it can be activated");
    let mark = world.mark();
    world.run_cycles(200);
    let reports = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(TERMINAL), reason }
        if reason.contains("EoE port 0: the SubDevice refused"))
    };
    assert!(world.saw(mark, reports), "{:?}", world.events(mark));
    let without = start(&settings, 1).expect_err("a terminal without a mailbox");
    assert!(without.to_string().contains("IP parameters are to be set, but the SubDevice has no EoE"), "{without}");
}
