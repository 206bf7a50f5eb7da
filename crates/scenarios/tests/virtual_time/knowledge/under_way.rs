//! The segment is handed over in the middle of a transfer: it ends at the SubDevice, the next owner names it, and every
//! mailbox can be used at once.

use super::*;
use ringcat::{Limits, Pending, SdoAddress, SdoError};
use ringcat_engine::mail::Mailbox;
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_sim::application::foe::firmware;
use ringcat_wire::mailbox::Protocol;
use scenarios::segments::describe;
use scenarios::uploads::start_upload;

const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(500));
const DRIVE: Position = Position(1);
const KINDS: [&str; 3] = ["coupler", "all-protocols", "digital-output-8"];
/// An object of 100,000 bytes.
const LARGE: SdoAddress = SdoAddress::new(0x2002, 0);
/// A file of so many bytes needs many mails.
const FILE: usize = 40_000;

fn owner(is_ring: bool) -> MainDevice<Tap> {
    let devices = KINDS.map(|kind| describe(kind, kind));
    let network = if is_ring { ring } else { line };
    idle(network(devices.into(), NetworkOptions::default()))
}

fn upload(main_device: &mut MainDevice<Tap>) -> Pending<Result<Vec<u8>, SdoError>> {
    start_upload(main_device.engine_mut(), DRIVE, LARGE, LIMITS, 200_000)
}

fn file_options() -> FoeOptions {
    FoeOptions::default()
}

/// Writes a file with the work of a procedure.
fn write_file(mailbox: Mailbox, name: &'static str) {
    mailbox.bus().clone().spawn(async move {
        let image = firmware::image("2.6", &[0x5A; FILE]);
        let mut source = Bytes::new(&image);
        let _ = foe::write(&mailbox, name, file_options(), &mut source, |_| ()).await;
    });
}

fn mailbox(main_device: &MainDevice<Tap>) -> Mailbox {
    main_device.engine().mailbox(DRIVE).expect("it has one")
}

/// Protocols whose conversations were cut, as reported.
fn cut(main_device: &mut MainDevice<Tap>) -> Vec<Protocol> {
    let of = |event: Event| match event {
        Event::ConversationCut { position: DRIVE, protocol } => Some(protocol),
        Event::ConversationCut { position, .. } => panic!("{position} had no conversation"),
        _ => None,
    };
    events(main_device).into_iter().filter_map(of).collect()
}

/// The mailbox works in both protocols.
fn check(main_device: &mut MainDevice<Tap>, text: &str) {
    let vendor = main_device.subdevices()[1].identity.vendor_id;
    let read = main_device.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1);
    assert_eq!(read.unwrap_or_else(|error| panic!("{text}: {error}")), vendor, "{text}");
    let large = start_upload(main_device.engine_mut(), DRIVE, LARGE, LIMITS, 200_000);
    main_device.attend(Duration::from_secs(5));
    let mut large = large;
    assert!(large.take().is_some_and(|read| read.is_ok_and(|bytes| bytes.len() == 100_000)), "{text}: in segments");
    let handle = mailbox(main_device);
    let work = main_device.engine_mut().start(async move {
        let mut source = Bytes::new(&[0xA5; 3_000]);
        foe::write(&handle, "settings.bin", file_options(), &mut source, |_| ())
            .await
            .map_err(|error| error.to_string())?;
        let mut sink = Bounded::new(10_000);
        foe::read(&handle, "settings.bin", file_options(), &mut sink, |_| ())
            .await
            .map_err(|error| error.to_string())?;
        Ok::<_, String>(sink.into_bytes())
    });
    main_device.attend(Duration::from_secs(5));
    let mut work = work;
    let file = work.take().unwrap_or_else(|| panic!("{text}: the file ends"));
    assert_eq!(file.unwrap_or_else(|error| panic!("{text}: {error}")), [0xA5; 3_000], "{text}");
}

fn after_us() -> impl Iterator<Item = u64> {
    (50..12_000).step_by(1_370)
}

// covers: mailbox, sdo, states
#[test]
fn a_handover_within_segments_of_an_object_is_named_and_leaves_the_mailbox_usable() {
    for is_ring in [false, true] {
        for after_us in after_us() {
            let mut former = owner(is_ring);
            let reading = upload(&mut former);
            former.attend(Duration::from_micros(after_us));
            assert!(reading.is_running());
            let mut next = hand_over(former, Handover::Orderly);
            let text = format!("ring {is_ring}, after {after_us} us");
            assert_eq!(cut(&mut next), [Protocol::Coe], "{text}");
            check(&mut next, &text);
            assert_eq!(cut(&mut next), [], "{text}");
        }
    }
}

// covers: mailbox, foe, states
#[test]
fn a_handover_within_a_file_is_named_and_another_file_can_be_written_at_once() {
    for is_ring in [false, true] {
        for after_us in after_us() {
            let mut former = owner(is_ring);
            write_file(mailbox(&former), "large.bin");
            former.attend(Duration::from_micros(after_us));
            let mut next = hand_over(former, Handover::Orderly);
            let text = format!("ring {is_ring}, after {after_us} us");
            assert_eq!(cut(&mut next), [Protocol::Foe], "{text}");
            check(&mut next, &text);
        }
    }
}

// covers: mailbox, foe, states
#[test]
fn a_handover_of_a_subdevice_in_boot_keeps_it_there_with_its_mailbox() {
    for is_ring in [false, true] {
        for after_us in after_us() {
            let mut former = owner(is_ring);
            former.subdevice(DRIVE).request_state(AlState::Boot).expect("it follows");
            write_file(mailbox(&former), "firmware.bin");
            former.attend(Duration::from_micros(after_us));
            let mut next = hand_over(former, Handover::Orderly);
            let text = format!("ring {is_ring}, after {after_us} us");
            assert_eq!(statuses(&mut next)[1], AlStatus::new(AlState::Boot), "{text}");
            assert_eq!(cut(&mut next), [Protocol::Foe], "{text}");
            let handle = mailbox(&next);
            let mut work = next.engine_mut().start(async move {
                let image = firmware::image("2.7", &[0x11; 2_000]);
                let mut source = Bytes::new(&image);
                let done = foe::write(&handle, "firmware.bin", file_options(), &mut source, |_| ()).await;
                done.map_err(|error| error.to_string())
            });
            next.attend(Duration::from_secs(5));
            let written = work.take().unwrap_or_else(|| panic!("{text}: the file ends"));
            assert!(written.is_ok(), "{text}: {written:?}");
            next.subdevice(DRIVE).request_state(AlState::PreOp).expect("it follows");
            check(&mut next, &text);
        }
    }
}

// covers: states
#[test]
fn a_handover_on_the_way_to_boot_or_op_goes_on_with_it() {
    for is_ring in [false, true] {
        for state in [AlState::Boot, AlState::SafeOp, AlState::Init] {
            for after_us in after_us() {
                let mut former = owner(is_ring);
                let request = former.engine_mut().start_state_request(DRIVE, state);
                former.attend(Duration::from_micros(after_us));
                let bytes = to_bytes(&former);
                drop(request);
                let mut next = resumed(former.into_links(), &bytes, Handover::Orderly);
                next.attend(FOLLOWED);
                let text = format!("ring {is_ring}, {state:?} after {after_us} us");
                assert_eq!(statuses(&mut next)[1], AlStatus::new(state), "{text}");
                next.subdevice(DRIVE).request_state(AlState::PreOp).expect("it follows");
                check(&mut next, &text);
            }
        }
    }
}
