//! Mailboxes that another process goes on with: no mail is dropped as a duplicate, and no answer to the former owner is
//! taken for an answer to the next one.

use super::*;
use ringcat::{Limits, SdoAddress};
use ringcat_sim::application::mailbox::faults::MailFault;
use ringcat_sim::fault::Fault;
use scenarios::uploads::start_upload;

const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(500));
const SERVO: Position = Position(3);

/// Reads an object of the servo this many times.
fn read_times(main_device: &mut MainDevice<Tap>, times: usize) {
    for _ in 0..times {
        main_device.subdevice(SERVO).sdo_read::<u32>(0x1018, 1).expect("it answers");
    }
}

/// Begins to read an object, and lets a time pass.
fn begin(main_device: &mut MainDevice<Tap>, object: SdoAddress, time: Duration) {
    let pending = start_upload(main_device.engine_mut(), SERVO, object, LIMITS, 1_000);
    main_device.attend(time);
    drop(pending);
}

// covers: mailbox, states
#[test]
fn no_mail_is_dropped_as_a_duplicate_after_any_number_of_mails() {
    for handover in HANDOVERS {
        for network in networks() {
            let mut main_device = idle(network);
            for mails in 0..16 {
                let before = to_bytes(&main_device);
                read_times(&mut main_device, mails);
                let bytes = if handover == Handover::Orderly { to_bytes(&main_device) } else { before };
                main_device = resumed(main_device.into_links(), &bytes, handover);
                exchange_sdos(&mut main_device);
            }
        }
    }
}

// covers: mailbox, states
#[test]
fn counters_that_are_stale_would_lose_mail() {
    let mut lost = 0;
    for mails in 0..8 {
        let mut former = idle(networks().into_iter().next().expect("a line"));
        let bytes = to_bytes(&former);
        read_times(&mut former, mails);
        // After a crash, but the counters go on as if they were handed over: why `AfterCrash` is another way.
        let mut main_device = resumed(former.into_links(), &bytes, Handover::Orderly);
        let begun = main_device.now();
        let read = main_device.subdevice(SERVO).sdo_read::<u32>(0x1018, 1);
        lost += u32::from(read.is_err() || main_device.now().since(begun) > ANSWERED);
    }
    assert!(lost > 0, "a duplicate counter is what the other scenarios would see");
}

// covers: mailbox, states
#[test]
fn an_answer_to_the_former_owner_is_not_taken_for_another_one() {
    let (old, new) = (SdoAddress::new(0x1018, 2), SdoAddress::new(0x1018, 1));
    for handover in HANDOVERS {
        for (network, delay_ms) in networks().into_iter().zip([0, 7]).chain(networks().into_iter().zip([30, 0])) {
            let mut main_device = idle(network);
            let info = main_device.subdevices()[3].identity;
            for after_us in (0..3_000).step_by(50) {
                let before = to_bytes(&main_device);
                let (count, by) = (1, Duration::from_millis(delay_ms));
                let delay = Fault::Mail(DeviceIndex(3), MailFault::DelayAnswers { count, by });
                main_device.links_mut().network_mut().apply(delay);
                // Both the same object, whose value changes, and another one.
                begin(&mut main_device, old, Duration::from_micros(after_us));
                let bytes = if handover == Handover::Orderly { to_bytes(&main_device) } else { before };
                main_device = resumed(main_device.into_links(), &bytes, handover);
                let vendor = main_device.subdevice(SERVO).sdo_read::<u32>(new.index, new.sub_index);
                assert_eq!(vendor.expect("it answers"), info.vendor_id, "after {after_us} us");
                let product = main_device.subdevice(SERVO).sdo_read::<u32>(old.index, old.sub_index);
                assert_eq!(product.expect("it answers"), info.product_code, "after {after_us} us");
                main_device.attend(Duration::from_millis(50));
                exchange_sdos(&mut main_device);
            }
        }
    }
}

// covers: mailbox, states
#[test]
fn a_value_that_was_written_after_the_handover_is_read_back() {
    // A late answer to a read of the same object would have the value before.
    let object = SdoAddress::new(0x6065, 0);
    for handover in HANDOVERS {
        let mut main_device = idle(networks().into_iter().next().expect("a line"));
        for (value, after_us) in (1_u32..).zip((0..3_000).step_by(100)) {
            let before = to_bytes(&main_device);
            let (count, by) = (1, Duration::from_millis(u64::from(value % 4) * 5));
            let delay = Fault::Mail(DeviceIndex(3), MailFault::DelayAnswers { count, by });
            main_device.links_mut().network_mut().apply(delay);
            begin(&mut main_device, object, Duration::from_micros(after_us));
            let bytes = if handover == Handover::Orderly { to_bytes(&main_device) } else { before };
            main_device = resumed(main_device.into_links(), &bytes, handover);
            main_device.subdevice(SERVO).sdo_write(object.index, object.sub_index, value).expect("it is accepted");
            let read = main_device.subdevice(SERVO).sdo_read::<u32>(object.index, object.sub_index);
            assert_eq!(read.expect("it answers"), value, "{handover:?} after {after_us} us");
            main_device.attend(Duration::from_millis(50));
        }
    }
}

// covers: mailbox, states
#[test]
fn an_emergency_that_waits_is_reported_by_the_next_owner() {
    for handover in HANDOVERS {
        for network in networks() {
            let mut former = idle(network);
            let before = to_bytes(&former);
            let emergency = MailFault::EmergencyBefore { count: 1, code: 0x1234 };
            former.links_mut().network_mut().apply(Fault::Mail(DeviceIndex(3), emergency));
            begin(&mut former, SdoAddress::new(0x1018, 2), Duration::from_micros(150));
            let bytes = if handover == Handover::Orderly { to_bytes(&former) } else { before };
            let mut links = former.into_links();
            links.network_mut().advance_by(Duration::from_millis(20));
            let mut main_device = resumed(links, &bytes, handover);
            main_device.attend(Duration::from_millis(20));
            let all = events(&mut main_device);
            let is_it = |event: &&Event| format!("{event:?}").contains("Emergency");
            assert_eq!(all.iter().filter(is_it).count(), 1, "{all:?}");
            exchange_sdos(&mut main_device);
        }
    }
}
