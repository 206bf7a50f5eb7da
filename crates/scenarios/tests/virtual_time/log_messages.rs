//! Messages of levels 1 and 2, set while the MainDevice runs, with a mask of subjects; evaluated by the frames on the
//! links.

use std::time::Duration;

use ringcat::{
    AlState, Application, Error, LastOutputs, Link, LogFilter, LogLevel, MainDevice, Message, MessageContent, Options,
    Position, Services, StateScope, Subject, Subjects, automatic, text,
};
use ringcat_engine::{Class, class_of};
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::witness::{Frames, Passed, Witness};
use scenarios::world::CYCLE;

const KINDS: [&str; 3] = ["coupler", "all-protocols", "digital-input-8"];
const LIMIT: Duration = Duration::from_secs(2);
const FOLLOWED: Duration = Duration::from_millis(400);
const DRIVE: Position = Position(1);

type Watched = MainDevice<Witness<Tap>>;

fn idle(network: Network) -> (Watched, Frames) {
    let (links, frames) = Witness::new(Tap::new(network));
    let mut main_device = MainDevice::request(links, &Options::default().with_idle_operation(true));
    main_device.attend(FOLLOWED);
    (main_device, frames)
}

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default();
    [line(descriptions(&KINDS), options.clone()), ring(descriptions(&KINDS), options)]
}

/// The words of steps.
fn steps(messages: &[Message]) -> Vec<&str> {
    let words = messages.iter().filter_map(|message| match &message.content {
        MessageContent::Step(text) => Some(text.as_str()),
        _ => None,
    });
    words.collect()
}

/// Link, direction and bytes of the frames in messages.
fn in_messages(messages: &[Message]) -> Vec<(bool, Link, &[u8])> {
    let frames = messages.iter().filter_map(|message| match &message.content {
        MessageContent::Sent { link, frame } => Some((true, *link, frame.as_slice())),
        MessageContent::Received { link, frame } => Some((false, *link, frame.as_slice())),
        _ => None,
    });
    frames.collect()
}

/// The same of the acyclic frames on the links.
fn on_the_links(passed: &[Passed]) -> Vec<(bool, Link, &[u8])> {
    let acyclic = passed.iter().filter(|passed| class_of(&passed.frame) == Some(Class::Acyclic));
    acyclic.map(|passed| (passed.is_sent, passed.link, passed.frame.as_slice())).collect()
}

// covers: jobs
#[test]
fn each_level_reports_its_messages_from_the_call_that_sets_it() {
    for network in networks() {
        let (mut main_device, frames) = idle(network);
        assert_eq!(main_device.log_filter().level, LogLevel::Quiet);
        assert_eq!(main_device.messages_since(0).next, 0, "a scan at level 0");
        // Level 1: steps, no frame.
        main_device.set_log_filter(LogFilter::new(LogLevel::Steps));
        main_device.request_state_of_all(AlState::SafeOp, StateScope::All, LIMIT).expect("all follow");
        let since = main_device.messages_since(0);
        assert!(in_messages(&since.messages).is_empty() && since.missed == 0);
        let words = steps(&since.messages);
        for station in ["0x1001", "0x1002", "0x1003"] {
            let at = |end: &str| {
                let wanted = |line: &&str| line.starts_with(station) && line.contains(end);
                words.iter().position(wanted).unwrap_or_else(|| panic!("{station} {end}: {words:#?}"))
            };
            assert!(at("SAFEOP requested") < at("SAFEOP after"), "{words:#?}");
        }
        // Level 2: also each acyclic frame, byte for byte.
        main_device.set_log_filter(LogFilter::new(LogLevel::from_number(2)));
        frames.take();
        // A frame each 20 ms has the broadcast and the states.
        main_device.attend(Duration::from_millis(100));
        let since = main_device.messages_since(since.next);
        let passed = frames.take();
        assert_eq!(in_messages(&since.messages), on_the_links(&passed));
        assert!(passed.len() > 4 && since.missed == 0, "{}", passed.len());
        assert!(text::message(&since.messages[0]).contains("BRD"), "{}", text::message(&since.messages[0]));
        // Level 0 again.
        main_device.set_log_filter(LogFilter::new(LogLevel::Quiet));
        main_device.request_state_of_all(AlState::PreOp, StateScope::All, LIMIT).expect("all follow");
        assert_eq!(main_device.messages_since(since.next).next, since.next);
    }
}

// covers: jobs
#[test]
fn the_mask_selects_subjects_of_steps_and_frames() {
    let (mut main_device, frames) = idle(networks().into_iter().next().expect("one"));
    let mask = |subject| Subjects::NONE.with(subject);
    let work = |main_device: &mut Watched| {
        main_device.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1).expect("it answers");
        main_device.subdevice(DRIVE).request_state(AlState::SafeOp).expect("it follows");
        main_device.subdevice(DRIVE).request_state(AlState::PreOp).expect("it follows");
    };
    let mut next = 0;
    for subject in [Subject::Mail, Subject::States, Subject::Frames] {
        main_device.set_log_filter(LogFilter::new(LogLevel::Frames).with_subjects(mask(subject)));
        frames.take();
        work(&mut main_device);
        let since = main_device.messages_since(next);
        next = since.next;
        assert!(!since.messages.is_empty(), "{subject:?}");
        assert!(since.messages.iter().all(|message| message.subject == subject), "{subject:?}");
        let passed = frames.take();
        let expected = if subject == Subject::Frames { on_the_links(&passed) } else { Vec::new() };
        assert_eq!(in_messages(&since.messages), expected);
        let words = steps(&since.messages).join("\n");
        assert_eq!(words.contains("Coe mail"), subject == Subject::Mail, "{words}");
        assert_eq!(words.contains("SAFEOP requested"), subject == Subject::States, "{words}");
    }
    main_device.set_log_filter(LogFilter::new(LogLevel::Frames).with_subjects(Subjects::NONE));
    work(&mut main_device);
    assert_eq!(main_device.messages_since(0).next, next);
}

// covers: jobs, no-allocation
#[test]
fn messages_outlast_applications_and_never_hold_cyclic_frames() {
    for network in networks() {
        let (mut main_device, frames) = idle(network);
        main_device.set_log_filter(LogFilter::new(LogLevel::Frames));
        frames.take();
        let declaration = automatic(&main_device.subdevices(), CYCLE);
        let mut application: Application<_> = main_device.activate(declaration).map_err(Error::from).expect("it fits");
        application.wait_until_op(LIMIT).expect("all are well");
        let since = application.messages_since(0);
        let passed = frames.take();
        assert!(passed.iter().any(|passed| class_of(&passed.frame) == Some(Class::Cyclic)));
        assert_eq!(since.missed, 0);
        assert_eq!(in_messages(&since.messages), on_the_links(&passed));
        assert!(steps(&since.messages).iter().any(|line| line.contains("configuration begins, target OP")));
        let ended = application.deactivate(LastOutputs::Zero, LIMIT).map_err(Error::from);
        let mut main_device = ended.expect("all go to PREOP");
        let after = main_device.messages_since(since.next);
        assert!(after.messages.len() > 10 && main_device.log_filter().level == LogLevel::Frames);
        assert_eq!(after.messages[0].number, since.next);
    }
}

// covers: jobs, robust
#[test]
fn a_flood_of_frames_keeps_the_newest_and_counts_the_others() {
    let (mut main_device, frames) = idle(networks().into_iter().next().expect("one"));
    main_device.set_log_filter(LogFilter::new(LogLevel::Frames));
    frames.take();
    for _ in 0..10 {
        main_device.attend(Duration::from_secs(10));
        let since = main_device.messages_since(0);
        let bytes: usize = in_messages(&since.messages).iter().map(|(.., frame)| frame.len()).sum();
        assert!(since.messages.len() <= 4096 && bytes <= 1 << 20, "{} messages, {bytes} bytes", since.messages.len());
        assert_eq!(since.missed + since.messages.len() as u64, since.next);
    }
    let since = main_device.messages_since(0);
    assert!(since.missed > 0);
    let passed = frames.take();
    let newest = on_the_links(&passed);
    let kept = in_messages(&since.messages);
    assert_eq!(kept, newest[newest.len() - kept.len()..]);
}
