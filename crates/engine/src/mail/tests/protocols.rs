//! Each protocol without disturbances.

use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::mailbox::aoe::{AmsAddress, NetId};
use ringcat_wire::mailbox::coe::{DataType, Emergency, ListType, ValueInfo};
use ringcat_wire::mailbox::foe::FoeErrorCode;
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::mailbox::soe::Idn;
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::device::pattern;
use super::{Bench, Fate, LIMITS};
use crate::config::{PdoEntry, PdoMapping};
use crate::declared::{Address, SubDeviceId};
use crate::link::LinkSet;
use crate::mail::aoe::{AoeError, AoeRoute, AoeStates};
use crate::mail::coe::pdo::{self, Lists};
use crate::mail::coe::{SdoAddress, SdoFailure, information, read, write};
use crate::mail::foe::{FoeFailure, FoeOptions, FoeProgress};
use crate::mail::soe::{SoeAddress, SoeFailure};
use crate::mail::stream::{Bounded, Bytes};
use crate::mail::voe::Voe;
use crate::mail::{Lane, MailboxError, aoe, foe, raw, soe, voe};

// covers: 6.3, sdo
#[test]
fn objects_of_any_size_are_written_and_read_in_segments() {
    for size in [24, 64, 128, 1024] {
        let mut bench = Bench::new(LinkSet::Single, size);
        // Around the limits: expedited, normal, first segment, less than seven bytes in the last one, and large.
        let normal = usize::from(size) - 16;
        let segment = usize::from(size) - 9;
        let mut lengths = vec![0, 1, 4, 5, 7, normal - 1, normal, normal + 1, normal + 6, normal + 7];
        lengths.extend([normal + segment - 1, normal + segment, normal + segment + 1, normal + 2 * segment, 10_000]);
        for length in lengths {
            let mailbox = bench.mailbox.clone();
            let data = pattern(length as u32, length);
            let expected = data.clone();
            let object = SdoAddress::new(0x2000, 1);
            let result = bench.run(async move {
                write(&mailbox, object, &data, LIMITS).await?;
                read(&mailbox, object, LIMITS, 20_000).await
            });
            assert_eq!(bench.device.server.objects[&(0x2000, 1)], expected, "{length} bytes, mailbox of {size}");
            assert_eq!(result, Ok(expected), "{length} bytes, mailbox of {size}");
        }
        assert_eq!(bench.device.server.aborts, []);
        assert_eq!(bench.mailbox.counters().unclaimed, 0);
    }
}

// covers: 6.3, sdo
#[test]
fn an_upload_beyond_the_limit_of_the_receiver_is_aborted() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    bench.device.server.objects.insert((0x2000, 1), pattern(1, 500));
    let mailbox = bench.mailbox.clone();
    let error = bench.run(async move { read(&mailbox, SdoAddress::new(0x2000, 1), LIMITS, 499).await }).unwrap_err();
    assert_eq!(error.to_string(), "SDO 0x2000:01: 500 bytes, at most 499 were expected");
    bench.pass(Duration::from_millis(5));
    assert_eq!(bench.device.server.aborts, [AbortCode::OUT_OF_MEMORY]);
}

// covers: 6.3, sdo
#[test]
fn a_toggle_bit_that_does_not_alternate_aborts_the_transfer() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    bench.device.server.objects.insert((0x2000, 1), pattern(1, 500));
    bench.device.server.wrong_toggle = true;
    let mailbox = bench.mailbox.clone();
    let result = bench.run(async move { read(&mailbox, SdoAddress::new(0x2000, 1), LIMITS, 500).await });
    assert_eq!(result.unwrap_err().cause, SdoFailure::Toggle);
    bench.pass(Duration::from_millis(5));
    assert_eq!(bench.device.server.aborts, [AbortCode::TOGGLE_NOT_ALTERNATED]);
}

// covers: sdo
#[test]
fn a_dropped_transfer_is_aborted_and_does_not_disturb_the_next_one() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let data = pattern(3, 5000);
    bench.device.server.objects.insert((0x2000, 1), data.clone());
    for cycles in 1..40 {
        let mailbox = bench.mailbox.clone();
        let bus = bench.supervisor.bus();
        let object = SdoAddress::new(0x2000, 1);
        let limit = Duration::from_micros(100 * cycles);
        bench.run(async move {
            let own = mailbox.clone();
            let _ = bus.within(limit, read(&own, object, LIMITS, 5000)).await;
        });
        let mailbox = bench.mailbox.clone();
        assert_eq!(bench.run(async move { read(&mailbox, object, LIMITS, 5000).await }), Ok(data.clone()));
    }
    assert!(bench.device.server.aborts.iter().all(|code| *code == AbortCode::GENERAL));
    assert!(bench.device.server.aborts.len() > 30);
}

// covers: 6.3, sdo-information
#[test]
fn lists_objects_and_entries_are_joined_from_fragments() {
    let mut bench = Bench::new(LinkSet::Single, 40);
    for index in 0..300 {
        bench.device.server.objects.insert((0x2000 + index, 0), vec![0; 4]);
    }
    let mailbox = bench.mailbox.clone();
    let list = bench.run(async move { information::list(&mailbox, ListType::All, LIMITS).await });
    assert_eq!(list, Ok((0x2000..0x2000 + 300).collect()));
    let mailbox = bench.mailbox.clone();
    let object = bench.run(async move { information::object(&mailbox, 0x2007, LIMITS).await }).unwrap();
    assert_eq!((object.index, object.data_type, object.name.as_str()), (0x2007, DataType(7), "An object"));
    let mailbox = bench.mailbox.clone();
    let entry = bench.run(async move { information::entry(&mailbox, (0x2007, 0), ValueInfo::ALL, LIMITS).await });
    let entry = entry.unwrap();
    assert_eq!((entry.index, entry.sub_index, entry.bit_length), (0x2007, 0, 32));
    assert_eq!(entry.name, "An entry with a name that is longer than some mailboxes are");
    let mailbox = bench.mailbox.clone();
    let error = bench.run(async move { information::object(&mailbox, 0x7777, LIMITS).await }).unwrap_err();
    assert_eq!(error.to_string(), "SDO information: refused by the SubDevice: 0x06020000 Object does not exist");
}

// covers: 6.3, sdo-information
#[test]
fn assignment_and_mapping_are_written_and_read_back() {
    let mut bench = Bench::new(LinkSet::Single, 128);
    let entries = [PdoEntry::new(0x6040, 0, 16), PdoEntry::new(0, 0, 8), PdoEntry::new(0x607A, 2, 32)];
    let pdos = vec![PdoMapping::of(0x1600, entries), PdoMapping::of(0x1601, [PdoEntry::new(0x6060, 0, 8)])];
    let (mailbox, written) = (bench.mailbox.clone(), pdos.clone());
    let result = bench.run(async move {
        pdo::write_assignment(&mailbox, 2, &written, LIMITS).await?;
        pdo::read_assignment(&mailbox, 2, LIMITS).await
    });
    assert_eq!(result, Ok(pdos));
    assert_eq!(bench.device.server.objects[&(0x1600, 3)], [32, 2, 0x7A, 0x60]);
}

// covers: 6.3, sdo-information
#[test]
fn lists_are_read_whole_or_by_entries_if_the_answer_is_no_list() {
    let entries = [PdoEntry::new(0x6040, 0, 16), PdoEntry::new(0, 0, 8), PdoEntry::new(0x607A, 2, 32)];
    let pdos = vec![PdoMapping::of(0x1600, entries), PdoMapping::of(0x1601, [])];
    // Whether complete access works, and the uploads: without it one is in vain.
    for (complete_access, uploads) in [(true, 3), (false, 1 + 3 + 4 + 1)] {
        let mut bench = Bench::new(LinkSet::Single, 128);
        bench.device.server.complete_access = complete_access;
        let (mailbox, written) = (bench.mailbox.clone(), pdos.clone());
        let result = bench.run(async move {
            pdo::write_assignment(&mailbox, 2, &written, LIMITS).await.unwrap();
            Lists::new(&mailbox, LIMITS).with_complete_access(true).assignment(2).await
        });
        assert_eq!(result, Ok(pdos.clone()), "{complete_access}");
        assert_eq!(bench.device.server.uploads, uploads, "{complete_access}");
    }
    // What is missing is reported as such once its subindex 0 is missing, too.
    let mut bench = Bench::new(LinkSet::Single, 128);
    let mailbox = bench.mailbox.clone();
    let error = bench
        .run(async move { Lists::new(&mailbox, LIMITS).with_complete_access(true).assignment(3).await.unwrap_err() });
    assert!(error.is_missing_object() && bench.device.server.uploads == 2, "{error}");
}

// covers: 6.3, sdo-information
#[test]
fn an_emergency_between_request_and_response_is_kept_and_is_an_event() {
    let mut bench = Bench::new(LinkSet::Single, 128);
    bench.device.server.objects.insert((0x2000, 1), vec![1, 2, 3]);
    let emergency = Emergency { error_code: 0x5112, error_register: 4, data: [1, 2, 3, 4, 5] };
    let mut mail = vec![0x00, 0x10];
    mail.extend(emergency.encode());
    bench.device.queue_mail(Protocol::Coe, &mail, bench.now);
    let mailbox = bench.mailbox.clone();
    assert_eq!(
        bench.run(async move { read(&mailbox, SdoAddress::new(0x2000, 1), LIMITS, 4).await }),
        Ok(vec![1, 2, 3])
    );
    assert_eq!(bench.mailbox.pop_emergency().map(|received| received.emergency), Some(emergency));
    assert_eq!(bench.mailbox.pop_emergency(), None);
    let subdevice = Address::Declared(SubDeviceId(0));
    let expected = crate::event::Event::Emergency { subdevice, emergency };
    let reported = core::iter::from_fn(|| bench.supervisor.pop_event()).any(|timed| timed.event == expected);
    assert!(reported);
    for _ in 0..40 {
        bench.device.queue_mail(Protocol::Coe, &mail, bench.now);
    }
    bench.mailbox.mail_available();
    bench.pass(Duration::from_millis(50));
    assert_eq!(bench.mailbox.emergencies().overruns(), 8);
}

// covers: 6.4, foe
#[test]
fn files_of_any_size_are_written_and_read() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let full = 64 - 12;
    for length in [0, 1, full - 1, full, full + 1, 2 * full, 10 * full, 5000] {
        let data = pattern(length as u32, length);
        let (mailbox, written) = (bench.mailbox.clone(), data.clone());
        let result = bench.run(async move {
            let options = FoeOptions::default();
            foe::write(&mailbox, "firmware.efw", options, &mut Bytes::new(&written), |_| ()).await?;
            let mut sink = Bounded::new(5000);
            foe::read(&mailbox, "firmware.efw", options, &mut sink, |_| ()).await?;
            Ok::<Vec<u8>, foe::FoeError>(sink.into_bytes())
        });
        assert_eq!(bench.device.server.files[b"firmware.efw".as_slice()], data, "{length} bytes");
        assert_eq!(result, Ok(data), "{length} bytes");
    }
    assert_eq!(bench.device.server.foe_errors, []);
}

// covers: 6.4, foe
#[test]
fn messages_to_a_busy_subdevice_are_repeated_and_its_progress_is_reported() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let data = pattern(9, 200);
    bench.device.server.busy = 3;
    let (mailbox, written) = (bench.mailbox.clone(), data.clone());
    let reported = alloc::rc::Rc::new(core::cell::RefCell::new(Vec::new()));
    let notes = reported.clone();
    let result = bench.run(async move {
        let note = |progress| notes.borrow_mut().push(progress);
        foe::write(&mailbox, "a", FoeOptions::default(), &mut Bytes::new(&written), note).await
    });
    assert_eq!(result, Ok(200));
    assert_eq!(bench.device.server.files[b"a".as_slice()], data);
    let busy = |done| FoeProgress::Busy { done, entire: 100, text: "thinking".into() };
    assert_eq!(reported.borrow()[..3], [busy(98), busy(99), busy(100)]);
    assert_eq!(reported.borrow().last(), Some(&FoeProgress::Bytes(200)));
    bench.device.server.busy = u32::MAX;
    let mailbox = bench.mailbox.clone();
    let error = bench.run(async move {
        let options = FoeOptions { busy_limit: Duration::from_millis(200), ..FoeOptions::default() };
        foe::read(&mailbox, "a", options, &mut Bounded::new(200), |_| ()).await
    });
    assert_eq!(error.unwrap_err().to_string(), "FoE \"a\": the SubDevice was busy for 200 ms without progress");
    bench.pass(Duration::from_millis(5));
    assert_eq!(bench.device.server.foe_errors.len(), 1, "the transfer is aborted");
}

// covers: 6.4, foe
#[test]
fn code_and_text_of_a_refused_file_are_in_the_error() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let mailbox = bench.mailbox.clone();
    let error = bench
        .run(async move { foe::read(&mailbox, "nothing", FoeOptions::default(), &mut Bounded::new(1), |_| ()).await });
    let error = error.unwrap_err();
    let text = "no such file".to_string();
    assert_eq!(error.cause, FoeFailure::Refused { code: FoeErrorCode::NOT_FOUND, text });
    let mailbox = bench.mailbox.clone();
    let error = bench.run(async move {
        let options = FoeOptions { password: 0x1234, ..FoeOptions::default() };
        foe::write(&mailbox, "a", options, &mut Bytes::new(b"abc"), |_| ()).await
    });
    assert!(matches!(error.unwrap_err().cause, FoeFailure::Refused { code: FoeErrorCode::NO_RIGHTS, .. }));
}

// covers: 6.6, soe
#[test]
fn idns_are_written_and_read_in_fragments() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    for length in [0, 2, 53, 54, 55, 108, 109, 3000] {
        let data = pattern(length as u32, length);
        let address = SoeAddress::value(5, Idn::product(1, 77));
        let (mailbox, written) = (bench.mailbox.clone(), data.clone());
        let result = bench.run(async move {
            soe::write(&mailbox, address, &written, LIMITS).await?;
            soe::read(&mailbox, address, LIMITS, 4000).await
        });
        assert_eq!(result, Ok(data), "{length} bytes");
    }
    let mailbox = bench.mailbox.clone();
    let address = SoeAddress::value(5, Idn::standard(0, 1));
    let error = bench.run(async move { soe::read(&mailbox, address, LIMITS, 4000).await }).unwrap_err();
    assert!(error.to_string().contains("refused by the drive: 0x1001"), "{error}");
    let mailbox = bench.mailbox.clone();
    let no_drive = SoeAddress::value(8, Idn::standard(0, 1));
    let error = bench.run(async move { soe::read(&mailbox, no_drive, LIMITS, 4000).await }).unwrap_err();
    assert_eq!(error.cause, SoeFailure::Drive);
}

// covers: 6.7, aoe
#[test]
fn ads_requests_are_answered_by_their_invoke_id() {
    let mut bench = Bench::new(LinkSet::Single, 128);
    let address = |port| AmsAddress { net_id: NetId([1, 2, 3, 4, 5, 6]), port };
    let route = AoeRoute { target: address(0x1001), source: address(0x8000) };
    let mailbox = bench.mailbox.clone();
    bench.run(async move {
        aoe::write(&mailbox, route, (0xF302, 7), b"value", LIMITS).await.unwrap();
        assert_eq!(aoe::read(&mailbox, route, (0xF302, 7), 5, LIMITS).await.unwrap(), b"value");
        assert_eq!(aoe::read_write(&mailbox, route, (1, 2), 4, b"echo", LIMITS).await.unwrap(), b"echo");
        assert_eq!(aoe::read_state(&mailbox, route, LIMITS).await, Ok(AoeStates::new(5, 8)));
        aoe::write_control(&mailbox, route, AoeStates::new(5, 0), &[], LIMITS).await.unwrap();
        let info = aoe::read_device_info(&mailbox, route, LIMITS).await.unwrap();
        assert_eq!((info.major, info.minor, info.build, info.name.as_str()), (3, 1, 77, "device"));
        let error = aoe::read(&mailbox, route, (1, 1), 5, LIMITS).await.unwrap_err();
        assert!(matches!(error, AoeError::Refused(code) if code.0 == 0x703));
    });
}

// covers: 6.8, voe
#[test]
fn vendor_messages_are_exchanged_and_received_unsolicited() {
    let mut bench = Bench::new(LinkSet::Single, 128);
    let message = Voe { vendor_id: 0x0C47, vendor_type: 3, data: b"hello".to_vec() };
    let (mailbox, sent) = (bench.mailbox.clone(), message.clone());
    assert_eq!(bench.run(async move { voe::exchange(&mailbox, &sent, LIMITS).await }), Ok(message.clone()));
    // The echo of a message that was sent without waiting is unsolicited.
    let (mailbox, sent) = (bench.mailbox.clone(), message.clone());
    let result = bench.run(async move {
        voe::send(&mailbox, &sent, LIMITS.request).await?;
        mailbox.bus().sleep(Duration::from_millis(2)).await;
        mailbox.mail_available();
        voe::receive(&mailbox, LIMITS.answer).await
    });
    assert_eq!(result, Ok(message));
}

// covers: 6.1, mailbox-faults
#[test]
fn an_error_reply_goes_to_the_request_of_an_unsupported_protocol() {
    let mut bench = Bench::new(LinkSet::Single, 128);
    bench.device.server.objects.insert((0x2000, 1), pattern(1, 2000));
    let mailbox = bench.mailbox.clone();
    let object = bench.start(async move { read(&mailbox, SdoAddress::new(0x2000, 1), LIMITS, 2000).await });
    bench.pass(Duration::from_millis(3));
    let mailbox = bench.mailbox.clone();
    // The simulated server does not support EoE.
    let refused = bench.run(async move {
        let mut conversation = mailbox.conversation(Lane::Eoe).await?;
        conversation.request(&[6, 0, 0, 0], LIMITS, |_| Some(())).await
    });
    assert!(matches!(refused, Err(MailboxError::Error(reply)) if reply.detail == 2), "{refused:?}");
    bench.pass(Duration::from_millis(100));
    assert_eq!(object.borrow_mut().take(), Some(Ok(pattern(1, 2000))));
}

// Only the last fragment has an answer: an earlier error reply may belong to any fragment, or to another message.
// covers: 6.6, mailbox-faults
#[test]
fn an_error_reply_while_fragments_are_written_fails_the_write() {
    let mut bench = Bench::new(LinkSet::Single, 64);
    let address = SoeAddress::value(1, Idn::standard(0, 7));
    let mailbox = bench.mailbox.clone();
    // A CoE message of this kind has no answer.
    let other = bench.start(async move { raw::exchange(&mailbox, Lane::Coe, &[0, 0x60, 0, 0], LIMITS).await });
    let mailbox = bench.mailbox.clone();
    let write = bench.start(async move { soe::write(&mailbox, address, &pattern(1, 900), LIMITS).await });
    while bench.device.served.len() < 4 {
        bench.step(|| Fate::Passes);
    }
    let reply = ErrorReply::new(ErrorReply::NO_MORE_MEMORY);
    bench.device.queue_mail(Protocol::Error, &reply.encode(), bench.now);
    bench.pass(Duration::from_millis(100));
    assert_eq!(other.borrow_mut().take(), Some(Err(MailboxError::Error(reply))));
    let cause = SoeFailure::Mailbox(MailboxError::Error(reply));
    assert_eq!(write.borrow_mut().take(), Some(Err(soe::SoeError { address, cause })));
    assert_eq!(bench.mailbox.counters().unclaimed, 0);
}
