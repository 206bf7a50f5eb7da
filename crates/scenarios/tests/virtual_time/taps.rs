//! A tap of all frames that is switched on and off in operation, with and without an application; checked by the frames
//! on the links. Ethernet debug messages.

use std::time::Duration;

use ringcat::tee::Tee;
use ringcat::{
    AlState, Application, EngineKey, Error, FrameDirection, FrameReader, Instant, LastOutputs, Link, Links, MainDevice,
    Options, Position, ServiceError, Services, Taps, automatic,
};
use ringcat_engine::{Class, class_of};
use ringcat_sim::cable::{CableId, DeviceIndex, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::witness::{Frames, Passed, Witness};
use scenarios::world::CYCLE;

const LIMIT: Duration = Duration::from_secs(2);
const FOLLOWED: Duration = Duration::from_millis(400);
/// For local experiments (IEEE 802).
const ETHERTYPE: u16 = 0x88B5;
/// Bit of DL_CONTROL: frames that are not EtherCAT are destroyed (protocol 2.6).
const DESTROY_OTHERS: u8 = 1;

type Tapped = Tee<Witness<Tap>>;

fn networks() -> [Network; 3] {
    let (few, many) = (["coupler", "all-protocols", "digital-input-8"], ["digital-output-8"; 40]);
    let options = NetworkOptions::default;
    [line(descriptions(&few), options()), ring(descriptions(&few), options()), ring(descriptions(&many), options())]
}

fn idle(network: Network, taps: &Taps) -> (MainDevice<Tapped>, Frames) {
    let (links, frames) = Witness::new(Tap::new(network));
    let options = Options::default().with_idle_operation(true);
    let mut main_device = MainDevice::request(Tee::new(links, taps.tap()), &options);
    main_device.attend(FOLLOWED);
    (main_device, frames)
}

/// Whether both classes are among them.
fn classes(passed: &[Passed]) -> (bool, bool) {
    let has = |class| passed.iter().any(|passed| class_of(&passed.frame) == Some(class));
    (has(Class::Cyclic), has(Class::Acyclic))
}

/// The frames of a reader, with times relative to the first one.
fn read(reader: &mut FrameReader) -> Vec<Passed> {
    let mut frames = Vec::new();
    let all = reader.read_all(|note, frame| {
        let is_sent = note.direction == FrameDirection::Out;
        let frame = frame.to_vec();
        assert_eq!(note.length, frame.len());
        frames.push(Passed { at: Instant(note.time_ns), link: Link::ALL[note.interface], is_sent, frame });
        Ok::<(), ()>(())
    });
    all.expect("nothing fails");
    frames
}

fn since_first(mut frames: Vec<Passed>) -> Vec<Passed> {
    let first = frames.first().map_or(0, |passed| passed.at.0);
    frames.iter_mut().for_each(|passed| passed.at = Instant(passed.at.0 - first));
    frames
}

/// The reader has each frame of the links, with its time; returns them.
fn compare(reader: &mut FrameReader, frames: &Frames) -> Vec<Passed> {
    let (read, passed) = (since_first(read(reader)), since_first(frames.take()));
    assert_eq!((reader.lost(0), reader.lost(1)), (0, 0));
    assert_eq!(read.len(), passed.len());
    assert!(read == passed, "frames differ");
    passed
}

// covers: capture
#[test]
fn a_tap_follows_from_idle_to_operation_and_back_and_pauses_between() {
    for network in networks() {
        let has_ring = network.host_cable(HostLink::Redundant).is_some();
        let taps = Taps::new(2);
        let (mut main_device, frames) = idle(network, &taps);
        frames.take();
        let mut reader = taps.read().expect("it is the only one");
        main_device.attend(Duration::from_millis(50));
        let passed = compare(&mut reader, &frames);
        assert_eq!(classes(&passed), (false, true));
        drop(reader);
        // Without a reader.
        let declaration = automatic(&main_device.subdevices(), CYCLE);
        let mut application: Application<_> = main_device.activate(declaration).map_err(Error::from).expect("it fits");
        application.wait_until_op(LIMIT).expect("all are well");
        frames.take();
        let mut reader = taps.read().expect("the first one has ended");
        (0..100).for_each(|_| application.cycle(|_| ()));
        let passed = compare(&mut reader, &frames);
        assert_eq!(classes(&passed), (true, true));
        assert_eq!(passed.iter().any(|passed| passed.link == Link::Redundant), has_ring);
        // A fault, and its repair, while it records.
        let network = application.links_mut().links_mut().links_mut().network_mut();
        network.apply(Fault::Cut(CableId(1)));
        (0..100).for_each(|_| application.cycle(|_| ()));
        application.links_mut().links_mut().links_mut().network_mut().apply(Fault::Heal(CableId(1)));
        (0..300).for_each(|_| application.cycle(|_| ()));
        compare(&mut reader, &frames);
        let main_device = application.deactivate(LastOutputs::Zero, LIMIT).map_err(Error::from);
        main_device.expect("all go to PREOP").attend(FOLLOWED);
        assert!(!compare(&mut reader, &frames).is_empty());
    }
}

// covers: capture
#[test]
fn a_reader_that_is_too_slow_loses_counted_frames_only() {
    let taps = Taps::new(1);
    let [network, ..] = networks();
    let (links, frames) = Witness::new(Tap::new(network));
    let tee = Tee::new(links, taps.tap_with(8192));
    let mut main_device = MainDevice::request(tee, &Options::default().with_idle_operation(true));
    let mut reader = taps.read().expect("it is the only one");
    for _ in 0..5 {
        let before = reader.lost(0);
        main_device.attend(FOLLOWED);
        let (kept, passed) = (read(&mut reader), frames.take());
        assert_eq!(kept.len() as u64 + reader.lost(0) - before, passed.len() as u64);
        // A short frame may fit where a long one did not: the order stays.
        let mut rest = passed.iter();
        assert!(kept.iter().all(|kept| rest.any(|passed| passed.frame == kept.frame)), "they are in order and whole");
    }
    assert!(reader.lost(0) > 0);
}

/// The debug messages of this text on each link: sent ones, and those that have come back.
fn debug_messages(passed: &[Passed], text: &[u8]) -> [[usize; 2]; 2] {
    let is_message = |it: &&Passed| it.frame[12..14] == ETHERTYPE.to_be_bytes();
    let messages: Vec<&Passed> = passed.iter().filter(is_message).collect();
    for message in &messages {
        let (body, padding) = message.frame[14..].split_at(text.len());
        assert!(body == text && padding.iter().all(|byte| *byte == 0));
    }
    let count = |link, is_sent| messages.iter().filter(|it| (it.link, it.is_sent) == (link, is_sent)).count();
    Link::ALL.map(|link| [count(link, true), count(link, false)])
}

// covers: capture, 9.11
#[test]
fn a_debug_message_leaves_on_each_link_and_disturbs_nothing() {
    for network in networks() {
        let taps = Taps::new(2);
        let (mut main_device, frames) = idle(network, &taps);
        let links = 1 + usize::from(main_device.links_mut().addresses().redundant.is_some());
        let count = main_device.subdevices().len();
        let before = main_device.acyclic_counters();
        let states = states(&mut main_device);
        let mut reader = taps.read().expect("it is the only one");
        for forwarded in [false, true] {
            if forwarded {
                for position in 0..count {
                    let subdevice = main_device.subdevice(Position(position as u16));
                    let rule = subdevice.register_read::<u8>(map::DL_CONTROL).expect("it answers");
                    let subdevice = main_device.subdevice(Position(position as u16));
                    subdevice.register_write(map::DL_CONTROL, rule & !DESTROY_OTHERS).expect("it answers");
                }
            }
            frames.take();
            read(&mut reader);
            for length in [0, 5, 1500] {
                let text = vec![b'x'; length];
                main_device.debug_message(ETHERTYPE, text.clone()).expect("it is allowed");
                main_device.attend(Duration::from_millis(5));
                let passed = compare(&mut reader, &frames);
                let back = usize::from(forwarded);
                // In a ring the copy on REDUNDANT comes back on MAIN without passing a processing unit.
                let expected = if links == 2 { [[1, 1], [1, back]] } else { [[1, back], [0, 0]] };
                assert_eq!(debug_messages(&passed, &text), expected, "{length} bytes, forwarded: {forwarded}");
            }
        }
        let after = main_device.acyclic_counters();
        assert_eq!((after.foreign, after.corrupt, after.lost), (before.foreign, before.corrupt, before.lost));
        assert_eq!(self::states(&mut main_device), states);
    }
}

fn states(main_device: &mut MainDevice<Tapped>) -> Vec<Option<AlState>> {
    let count = main_device.subdevices().len();
    let network = main_device.links_mut().links_mut().links_mut().network();
    (0..count).map(|at| network.device(DeviceIndex(at)).al_status().al_state()).collect()
}

// covers: capture
#[test]
fn a_debug_message_that_is_not_allowed_is_refused_and_nothing_is_sent() {
    let taps = Taps::new(2);
    let [network, ..] = networks();
    let (mut main_device, frames) = idle(network, &taps);
    frames.take();
    for ethertype in [0, 0x05FF, 0x88A4, 0x8100] {
        let error = main_device.debug_message(ethertype, vec![1]).expect_err("it would be another kind of frame");
        assert!(error.to_string().contains("take another"), "{error}");
    }
    let error = main_device.debug_message(ETHERTYPE, vec![0; 1501]).expect_err("it fits no frame");
    assert!(error.to_string().contains("at most 1500"), "{error}");
    assert!(frames.take().iter().all(|passed| passed.frame[12..14] == [0x88, 0xA4]));
    // Those that wait are bounded; each is sent once.
    let queued = Services::call(&mut main_device, EngineKey, |engine| {
        let started: Vec<_> = (0..20).map(|_| engine.start_debug_message(ETHERTYPE, b"x")).collect();
        engine.start(async move {
            let mut queued = 0;
            for message in started {
                queued += usize::from(message.ended().await.is_ok());
            }
            Ok::<_, ServiceError>(queued)
        })
    });
    assert_eq!(queued.expect("it is answered"), 16);
    main_device.attend(Duration::from_millis(5));
    let sent = frames.take().iter().filter(|it| it.is_sent && it.frame[12..14] == [0x88, 0xB5]).count();
    assert_eq!(sent, 16);
    main_device.subdevice(Position(1)).sdo_read::<u32>(0x1018, 1).expect("mail goes on");
}
