//! Mail that belongs to no request of RingCAT: error replies beside Ethernet frames, types for a gateway's client
//! only, vendor messages and emergencies that a SubDevice sends by itself.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use ringcat::{Event, MainDevice, Options, Position, SubDevice, SubDeviceId, TransferLimits, Unsolicited, automatic};
use ringcat_engine::mail::eoe::EthernetPort;
use ringcat_engine::mail::voe::{self, Voe};
use ringcat_engine::mail::{Limits, MailboxError};
use ringcat_engine::main_device::Pending;
use ringcat_sim::application::mailbox::faults::MailFault;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::mailbox::{ErrorReply, Header, Message, Protocol, gateway};
use scenarios::ethernet_host::{Addresses, download};
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(2));
const KINDS: [&str; 3] = ["coupler", "digital-input-8", "all-protocols"];
/// The device with all protocols.
const ALL: usize = 2;
const VENDOR: u32 = 0x0C47;
const OTHER_VENDOR: u32 = VENDOR + 1;
const ADDRESSES: Addresses = Addresses { mac: [2, 0, 0, 0, 0, 9], host: [10, 0, 0, 1], device: [10, 0, 0, 2] };
const CLIENT: u64 = 7;
/// A mailbox type that no standard names.
const UNKNOWN: Protocol = Protocol::Other(9);

fn world(seed: u64) -> World {
    let mut devices = descriptions(&KINDS);
    devices[ALL].services.eoe.address = Some(ADDRESSES.device.into());
    devices[ALL].services.eoe.mask = Some([255, 255, 255, 0].into());
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    World::in_op(seed, ring(devices, options))
}

fn message(vendor_id: u32, text: &[u8]) -> Voe {
    Voe { vendor_id, vendor_type: 1, data: text.to_vec() }
}

fn emergency(error_code: u16) -> Emergency {
    Emergency { error_code, error_register: 1, data: [1, 2, 3, 4, 5] }
}

fn send_emergency(world: &mut World, device: usize, code: u16) {
    assert!(world.network_mut().device_mut(DeviceIndex(device)).application.emergency(&emergency(code)));
    world.run_cycles(20);
}

/// Downloads through the Ethernet port, one after the other.
fn start_downloads(world: &mut World, stop: &Rc<Cell<bool>>) -> Pending<u32> {
    let (mailbox, stop) = (world.mailbox(ALL), stop.clone());
    world.start(async move {
        let port = EthernetPort::open(&mailbox).expect("the port is free");
        let mut done = 0;
        while !stop.get() {
            let got = download(mailbox.bus().clone(), &port, ADDRESSES, 20_000, Duration::from_secs(2)).await;
            done += u32::from(got.is_ok());
        }
        done
    })
}

// covers: 6.1, mailbox
#[test]
fn an_error_reply_beside_ethernet_frames_delays_no_other_request() {
    let mut world = world(1);
    let stop = Rc::new(Cell::new(false));
    let downloads = start_downloads(&mut world, &stop);
    world.run_cycles(30);
    let refused = ErrorReply::new(ErrorReply::SERVICE_NOT_SUPPORTED);
    let no_memory = ErrorReply::new(ErrorReply::NO_MORE_MEMORY);
    // The refusal of a service cannot belong to a frame; that of memory can, for a short time.
    for (reply, longest) in [(refused, Duration::from_millis(20)), (no_memory, Duration::from_millis(300))] {
        let mailbox = world.mailbox(ALL);
        let (mut longest_wait, mut refusals) = (Duration::ZERO, 0);
        for round in 0..20 {
            let vendor_id = if reply == refused { OTHER_VENDOR } else { VENDOR };
            if reply == no_memory {
                let fault = MailFault::Refuse { count: 1, detail: reply.detail };
                world.fault(Fault::Mail(DeviceIndex(ALL), fault));
            }
            let own = mailbox.clone();
            let first = world.run(async move { voe::exchange(&own, &message(vendor_id, b"first"), LIMITS).await });
            if first.is_ok() {
                assert_eq!(reply, no_memory, "round {round}: a frame was refused");
                continue;
            }
            assert_eq!(first, Err(MailboxError::Error(reply)), "round {round}");
            refusals += 1;
            let (own, begin) = (mailbox.clone(), world.now());
            let second = message(VENDOR, format!("second {round}").as_bytes());
            let wanted = second.clone();
            let got = world.run(async move { voe::exchange(&own, &second, LIMITS).await });
            assert_eq!(got, Ok(wanted), "round {round}");
            longest_wait = longest_wait.max(world.now() - begin);
        }
        println!("{refusals} refusals {:#06x}, next response after at most {longest_wait:?}", reply.detail);
        assert!(refusals > 0 && longest_wait < longest, "{refusals} refusals, {longest_wait:?}");
    }
    stop.set(true);
    assert!(world.finish(Duration::from_secs(10), downloads) > 0, "frames were under way");
}

/// Passes a client's message of a type to the device.
fn relay(world: &mut World, protocol: Protocol, payload: &[u8]) {
    let address = world.station_of(ALL);
    let header = Header { address, ..Header::new(protocol, 5, payload.len() as u16) };
    let mut bytes = vec![0; gateway::HEADER_LEN + Header::LEN + payload.len()];
    gateway::encode(&Message { header, payload }, &mut bytes).expect("it fits");
    world.application_mut().engine_mut().relay(CLIENT, &bytes);
}

/// Protocol, counter and payload of the next message to the client, if one arrives.
fn relayed(world: &mut World, cycles: u32) -> Option<(Protocol, u8, Vec<u8>)> {
    for _ in 0..cycles {
        world.cycle();
        if let Some(relayed) = world.application_mut().engine_mut().pop_relayed() {
            let Message { header, payload } = gateway::decode(&relayed.bytes).expect("a message");
            return Some((header.protocol, header.counter, payload.to_vec()));
        }
    }
    None
}

// covers: 10.1, gateway
#[test]
fn a_gateway_client_exchanges_mail_of_a_type_that_ringcat_does_not_know() {
    let mut world = world(2);
    let before = world.mailbox(ALL).counters().written;
    // The device itself refuses a type that it does not support.
    relay(&mut world, UNKNOWN, b"question");
    let unsupported = ErrorReply::new(ErrorReply::UNSUPPORTED_PROTOCOL).encode().to_vec();
    assert_eq!(relayed(&mut world, 100), Some((Protocol::Error, 5, unsupported)));
    let counters = world.application_mut().engine_mut().relay_counters();
    assert_eq!((counters.answers, counters.refused), (1, 0), "the reply is from the device");
    assert_eq!(world.mailbox(ALL).counters().written, before + 1);
    // Another type shares the lane, and each client's message has the response of its own type.
    for (protocol, text) in [(UNKNOWN, b"first"), (Protocol::Other(12), b"other")] {
        world.fault(Fault::Mail(DeviceIndex(ALL), MailFault::LoseRequests { count: 1 }));
        relay(&mut world, protocol, b"question");
        world.run_cycles(5);
        for (kind, payload) in [(Protocol::Other(11), &b"not this"[..]), (protocol, &text[..])] {
            assert!(world.network_mut().device_mut(DeviceIndex(ALL)).application.post(kind, payload.to_vec()));
        }
        assert_eq!(relayed(&mut world, 100), Some((protocol, 5, text.to_vec())));
    }
    // Error replies are not requests.
    relay(&mut world, Protocol::Error, &[1, 0, 2, 0]);
    assert_eq!(relayed(&mut world, 2).map(|(protocol, ..)| protocol), Some(Protocol::Error));
    assert_eq!(world.application_mut().engine_mut().relay_counters().refused, 1);
}

// covers: 6.8, pdo-mail
#[test]
fn vendor_messages_without_a_request_reach_the_application_by_its_handle() {
    let mut world = world(3);
    let post = |world: &mut World, protocol: Protocol, payload: &[u8]| {
        let device = world.network_mut().device_mut(DeviceIndex(ALL));
        assert!(device.application.post(protocol, payload.to_vec()));
    };
    let limits = TransferLimits::new(LIMITS.request, Duration::from_millis(100));
    // Received before and after the call.
    for early in [true, false] {
        if early {
            post(&mut world, Protocol::Voe, &[0x47, 0x0C, 0, 0, 1, 0, b'h', b'i']);
            world.run_cycles(20);
        }
        let receiving = world.application_mut().subdevice(SubDeviceId(ALL)).limits(limits).voe_receive();
        if !early {
            world.run_cycles(20);
            post(&mut world, Protocol::Voe, &[0x47, 0x0C, 0, 0, 1, 0, b'h', b'i']);
        }
        assert_eq!(world.finish(Duration::from_secs(1), receiving).expect("a message"), message(VENDOR, b"hi"));
    }
    let receiving = world.application_mut().subdevice(SubDeviceId(ALL)).limits(limits).voe_receive();
    let error = world.finish(Duration::from_secs(1), receiving).expect_err("no message");
    assert!(error.to_string().contains("100 ms"), "{error}");
    // Mail of an unknown type is kept as it is.
    post(&mut world, UNKNOWN, b"note");
    world.run_cycles(20);
    let mut take = |kind| world.application_mut().subdevice(SubDeviceId(ALL)).take_unsolicited(kind);
    assert_eq!(take(Unsolicited::Other).map(|mail| (mail.protocol, mail.payload)), Some((UNKNOWN, b"note".to_vec())));
    assert_eq!((take(Unsolicited::Other), take(Unsolicited::Voe)), (None, None));
}

// covers: 6.3, sdo-information
#[test]
fn the_application_chooses_how_many_emergencies_of_a_subdevice_are_kept() {
    let mut world = world(4);
    let mark = world.mark();
    let codes = |ring: &ringcat::EmergencyRing| -> Vec<u16> {
        std::iter::from_fn(|| ring.pop()).map(|received| received.emergency.error_code).collect()
    };
    let before = world.application_mut().subdevice(SubDeviceId(ALL)).emergencies();
    send_emergency(&mut world, ALL, 1);
    let ring = world.application_mut().subdevice(SubDeviceId(ALL)).create_emergency_ring(3);
    (2..=7).for_each(|code| send_emergency(&mut world, ALL, code));
    assert_eq!((ring.len(), ring.overruns()), (3, 3));
    // Another thread reads while this thread does not run the engine.
    let own = ring.clone();
    assert_eq!(std::thread::spawn(move || codes(&own)).join().expect("it ends"), [2, 3, 4]);
    assert_eq!(codes(&before), [1], "the ring before keeps its content and gets no more");
    send_emergency(&mut world, ALL, 8);
    ring.clear();
    assert_eq!((codes(&ring), ring.overruns()), (vec![], 0));
    let none = world.application_mut().subdevice(SubDeviceId(ALL)).create_emergency_ring(0);
    send_emergency(&mut world, ALL, 9);
    assert_eq!((codes(&none), none.overruns()), (vec![], 1));
    let reported = world.events(mark).iter().filter(|timed| matches!(timed.event, Event::Emergency { .. })).count();
    assert_eq!(reported, 9, "each is also an event");
}

// covers: 6.3, sdo-information
#[test]
fn emergencies_are_kept_by_position_and_wait_in_an_undeclared_subdevice() {
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
    let scan = main_device.scan().expect("a scan");
    let position = Position(ALL as u16);
    let by_position = main_device.subdevice(position).create_emergency_ring(5);
    // Its mailbox is open from the first request on.
    main_device.subdevice(position).sdo_read::<u32>(0x1000, 0).expect("a device type");
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    let post = |main_device: &mut MainDevice<Tap>, code| {
        let network = main_device.links_mut().network_mut();
        assert!(network.device_mut(DeviceIndex(ALL)).application.emergency(&emergency(code)));
    };
    post(&mut main_device, 1);
    main_device.subdevice(position).sdo_read::<u32>(0x1000, 0).expect("a device type");
    assert_eq!(by_position.pop().map(|received| received.emergency), Some(emergency(1)));
    // Declared without it: its mailbox is closed, so it cannot send.
    declaration.subdevices.truncate(ALL);
    declaration.domains.iter_mut().for_each(|domain| domain.members.retain(|member| member.subdevice.0 < ALL));
    let mut application = main_device.activate(declaration).expect("activation");
    (0..2000).for_each(|_| application.cycle(|_| ()));
    assert!(application.all_settled() && by_position.is_empty());
}

/// With idle operation, one device after the other; in a ring, positions change behind a device without power.
// covers: 6.3, sdo-information
#[test]
fn emergencies_of_a_position_continue_after_a_power_cycle_without_a_declaration() {
    const AT: [u16; 2] = [1, 3];
    let kinds = ["coupler", "all-protocols", "digital-input-8", "all-protocols"];
    for off in AT.map(|at| DeviceIndex(at.into())) {
        for build in [line, ring] {
            let network = build(descriptions(&kinds), NetworkOptions::default());
            let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
            main_device.attend(Duration::from_millis(400));
            let rings = AT.map(|at| main_device.subdevice(Position(at)).create_emergency_ring(5));
            for round in 1..=3 {
                main_device.links_mut().network_mut().apply(Fault::PowerOff(off));
                main_device.attend(Duration::from_millis(400));
                main_device.links_mut().network_mut().apply(Fault::PowerOn(off));
                main_device.attend(Duration::from_secs(1));
                for at in AT {
                    let device = main_device.links_mut().network_mut().device_mut(DeviceIndex(at.into()));
                    assert!(device.application.emergency(&emergency(at + round)), "{at} is in PREOP");
                }
                main_device.attend(Duration::from_millis(100));
                let codes = rings.each_ref().map(|ring| ring.pop().map(|received| received.emergency.error_code));
                assert_eq!(codes, AT.map(|at| Some(at + round)), "{off:?}, round {round}");
            }
        }
    }
}

/// More emergencies than rings hold, of a declared and an undeclared SubDevice, beside transfers, with and without lost
/// frames: each that was sent is read, cleared or counted once, and is one event.
// covers: 6.3, sdo-information, mailbox
#[test]
fn each_emergency_of_a_flood_is_read_cleared_or_counted_once() {
    const AT: [usize; 2] = [1, 2];
    for (lost, sizes) in [0, 20].into_iter().flat_map(|lost| [[0, 1], [8, 0], [1, 300]].map(|sizes| (lost, sizes))) {
        let network = ring(descriptions(&["coupler", "all-protocols", "all-protocols"]), NetworkOptions::default());
        let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
        main_device.attend(Duration::from_millis(400));
        let declaration = automatic(&main_device.subdevices()[..2], CYCLE);
        let mut application = main_device.activate(declaration).map_err(ringcat::Error::from).expect("it fits");
        (0..800).for_each(|_| application.cycle(|_| ()));
        let next = application.engine_mut().snapshot().next_event;
        let position = |at: usize| Position(at as u16);
        let mut create = |at, size| SubDevice::new(&mut application, position(at)).create_emergency_ring(size);
        let rings: Vec<ringcat::EmergencyRing> = AT.into_iter().zip(sizes).map(|(at, size)| create(at, size)).collect();
        application.links_mut().lose_per_mille(lost, 7);
        let (mut sent, mut got) = ([0; 2], [0; 2]);
        for step in 0..1_500_u16 {
            for (number, ring) in rings.iter().enumerate() {
                let device = application.links_mut().network_mut().device_mut(DeviceIndex(AT[number]));
                sent[number] += u64::from(device.application.emergency(&emergency(step)));
                if step % 20 == 0 {
                    got[number] += std::iter::from_fn(|| ring.pop()).take(3).count() as u64;
                }
                if step % 400 == 399 {
                    got[number] += ring.len() as u64 + ring.overruns();
                    ring.clear();
                }
            }
            if step % 50 == 0 {
                let read = SubDevice::new(&mut application, position(AT[0])).sdo_read::<u32>(0x1018, 1);
                let read = application.cycle_until(read, Duration::from_secs(1), |_| ());
                assert!(read.is_ok() || lost > 0, "{sizes:?}: {read:?}");
            }
            application.cycle(|_| ());
        }
        application.links_mut().lose_per_mille(0, 7);
        (0..2_000).for_each(|_| application.cycle(|_| ()));
        for (number, ring) in rings.iter().enumerate() {
            got[number] += ring.len() as u64 + ring.overruns();
        }
        assert_eq!(got, sent, "rings of {sizes:?}, {lost} of 1,000 frames lost");
        let since = application.engine_mut().events_since(next);
        let reported =
            since.events.iter().filter(|timed| matches!(timed.event, Event::Emergency { .. })).count() as u64;
        assert_eq!((since.missed, reported), (0, sent[0] + sent[1]), "rings of {sizes:?}");
        assert!(sent.iter().all(|sent| *sent > 1_000), "{sent:?}");
    }
}
