//! Protocol 6.1, 6.2, 6.3 from the view of a MainDevice.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::coe::{CoeHeader, CoeService};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{ErrorReply, Header, Protocol};
use ringcat_wire::register::{SyncManager, map};
use ringcat_wire::sii::CoeDetails;

use super::bench::Bench;
use super::client::{ANSWER, Client};
use crate::catalogue;

#[test]
fn identity_and_names_are_uploaded() {
    let mut client = Client::new("servo", AlState::PreOp);
    let identity = client.bench.device.description.identity;
    assert_eq!(client.upload(0x1018, 0), Ok(vec![4]));
    assert_eq!(client.upload(0x1018, 1), Ok(identity.vendor_id.to_le_bytes().to_vec()));
    assert_eq!(client.upload(0x1018, 2), Ok(identity.product_code.to_le_bytes().to_vec()));
    assert_eq!(client.upload(0x1000, 0), Ok(vec![0x92, 0x01, 0x02, 0x00]));
    assert_eq!(client.upload(0x1008, 0), Ok(b"servo".to_vec()), "normal transfer");
    assert_eq!(client.upload(0x1C00, 4), Ok(vec![4]));
    assert_eq!(client.upload(0x1C12, 1), Ok(vec![0x00, 0x16]));
    assert_eq!(client.upload(0x1600, 1), Ok(vec![0x10, 0x00, 0x40, 0x60]));
}

// covers: sim-mailbox
#[test]
fn expedited_and_normal_downloads_are_kept() {
    let mut client = Client::new("analog-input-4", AlState::PreOp);
    assert_eq!(client.download(0x8000, 1, &[0x34, 0x12]), Ok(Vec::new()));
    assert_eq!(client.upload(0x8000, 1), Ok(vec![0x34, 0x12]));
    assert_eq!(client.download(0x8010, 3, b"sixteen letters!"), Ok(Vec::new()));
    assert_eq!(client.upload(0x8010, 3), Ok(b"sixteen letters!".to_vec()));
}

#[test]
fn refused_sdo_requests_are_aborted_with_their_code() {
    let mut client = Client::new("analog-input-4", AlState::SafeOp);
    assert_eq!(client.upload(0x5000, 0), Err(AbortCode::OBJECT_DOES_NOT_EXIST));
    assert_eq!(client.upload(0x1018, 5), Err(AbortCode::SUB_INDEX_DOES_NOT_EXIST));
    assert_eq!(client.download(0x1018, 1, &[0; 4]), Err(AbortCode::READ_ONLY));
    assert_eq!(client.download(0x8000, 1, &[0; 4]), Err(AbortCode::LENGTH_TOO_LONG));
    assert_eq!(client.download(0x8000, 1, &[0]), Err(AbortCode::LENGTH_TOO_SHORT));
    assert_eq!(client.download(0x8000, 2, &[0; 4]), Err(AbortCode::CANNOT_BE_STORED_DEVICE_STATE));
    assert_eq!(client.download(0x1C13, 0, &[0]), Err(AbortCode::CANNOT_BE_STORED_DEVICE_STATE));
    assert_eq!(client.sdo(&SdoRequest::UploadSegment { toggle: false }), Err(AbortCode::UNKNOWN_COMMAND));
}

// covers: sim-mailbox
#[test]
fn a_changed_assignment_changes_the_length_required_for_safeop() {
    let mut client = Client::new("analog-input-4", AlState::PreOp);
    assert_eq!(client.download(0x1C13, 1, &0x1A01u16.to_le_bytes()), Err(AbortCode::SUB_INDEX_0_FIRST));
    assert_eq!(client.download(0x1C13, 0, &[0]), Ok(Vec::new()));
    assert_eq!(client.download(0x1C13, 1, &0x1600u16.to_le_bytes()), Err(AbortCode::VALUE_RANGE));
    assert_eq!(client.download(0x1C13, 1, &0x1A01u16.to_le_bytes()), Ok(Vec::new()));
    assert_eq!(client.download(0x1C13, 0, &[1]), Ok(Vec::new()));
    client.bench.set_process_data();
    let (status, code) = client.bench.request(AlState::SafeOp);
    assert_eq!((status.bits(), code.0), (0x0012, 0x001E), "16 bytes instead of 2");
    client.bench.acknowledge(AlState::PreOp);
    let right = SyncManager { length: 2, ..client.bench.right(3) };
    client.bench.set_sync_manager(3, &right);
    assert_eq!(client.bench.request(AlState::SafeOp).0.bits(), 0x0004);
    assert_eq!(client.bench.device.inputs().len(), 2);
}

#[test]
fn a_pdo_assigned_twice_is_an_invalid_mapping() {
    for (assignment, pdo, code) in [(0x1C12, 0x1600u16, 0x0025), (0x1C13, 0x1A00, 0x0024)] {
        let mut client = Client::new("servo", AlState::PreOp);
        client.download(assignment, 0, &[0]).unwrap();
        client.download(assignment, 1, &pdo.to_le_bytes()).unwrap();
        client.download(assignment, 2, &pdo.to_le_bytes()).unwrap();
        client.download(assignment, 0, &[2]).unwrap();
        client.bench.set_process_data();
        assert_eq!(client.bench.request(AlState::SafeOp).1.0, code);
    }
}

// covers: sim-mailbox
#[test]
fn a_mapping_can_be_configured() {
    let mut client = Client::new("servo", AlState::PreOp);
    client.download(0x1A01, 0, &[0]).unwrap();
    assert_eq!(client.download(0x1A01, 1, &0x6064_0010u32.to_le_bytes()), Err(AbortCode::CANNOT_BE_MAPPED));
    assert_eq!(client.download(0x1A01, 1, &0x6999_0010u32.to_le_bytes()), Err(AbortCode::OBJECT_DOES_NOT_EXIST));
    client.download(0x1A01, 1, &0x6064_0020u32.to_le_bytes()).unwrap();
    client.download(0x1A01, 2, &0x6041_0010u32.to_le_bytes()).unwrap();
    assert_eq!(client.download(0x1A01, 0, &[3]), Err(AbortCode::VALUE_RANGE), "entry 3 is empty");
    client.download(0x1A01, 0, &[2]).unwrap();
    let complete = [1, 0, 0x01, 0x1A];
    let request = SdoRequest::DownloadExpedited { index: 0x1C13, sub_index: 0, complete_access: true, data: &complete };
    assert_eq!(client.sdo(&request), Ok(Vec::new()));
    let request = SdoRequest::Upload { index: 0x1C13, sub_index: 0, complete_access: true };
    assert_eq!(client.sdo(&request), Ok(complete.to_vec()));
    client.bench.set_process_data();
    let inputs = SyncManager { length: 6, ..client.bench.right(3) };
    client.bench.set_sync_manager(3, &inputs);
    assert_eq!(client.bench.request(AlState::SafeOp).0.bits(), 0x0004);
    assert_eq!(client.bench.device.inputs()[4..], [0x50, 0x00], "statusword after the position");
}

#[test]
fn a_failed_complete_access_download_changes_nothing() {
    let mut client = Client::new("servo", AlState::PreOp);
    let wrong = [2, 0, 0x01, 0x16, 0x00, 0x1A];
    let request = SdoRequest::DownloadNormal {
        index: 0x1C12,
        sub_index: 0,
        complete_access: true,
        total: wrong.len() as u32,
        data: &wrong,
    };
    assert_eq!(client.sdo(&request), Err(AbortCode::VALUE_RANGE));
    assert_eq!(client.upload(0x1C12, 1), Ok(vec![0x00, 0x16]));
    assert_eq!(client.upload(0x1C12, 0), Ok(vec![1]));
}

#[test]
fn mapped_outputs_are_read_from_the_process_data_and_not_written_in_op() {
    let mut client = Client::new("analog-output-4", AlState::Op);
    client.bench.output(&[0x11, 0x22, 0x33, 0x44, 0, 0, 0, 0]);
    assert_eq!(client.upload(0x7010, 1), Ok(vec![0x33, 0x44]));
    assert_eq!(client.download(0x7010, 1, &[0, 0]), Err(AbortCode::MAPPED_TO_RX_PDO));
}

#[test]
fn a_message_with_the_counter_of_the_previous_message_is_dropped() {
    let mut client = Client::new("servo", AlState::PreOp);
    client.upload(0x1000, 0).unwrap();
    client.counter -= 1;
    client.post_sdo(&SdoRequest::Upload { index: 0x1000, sub_index: 0, complete_access: false });
    client.bench.pass(ANSWER);
    assert!(client.bench.fetch_mail().is_none());
    client.upload(0x1000, 0).unwrap();
}

#[test]
fn messages_without_a_counter_are_never_duplicates() {
    let mut client = Client::new("servo", AlState::PreOp);
    let mut payload = [0; 16];
    let request = SdoRequest::Upload { index: 0x1000, sub_index: 0, complete_access: false };
    let length = request.encode(&mut payload).unwrap();
    for _ in 0..2 {
        let header = Header::new(Protocol::Coe, 0, length as u16);
        assert!(client.bench.send_mail(header, &payload[..length]));
        client.answer();
    }
}

#[test]
fn answers_count_from_1_to_7() {
    let mut client = Client::new("servo", AlState::PreOp);
    let request = SdoRequest::Upload { index: 0x1000, sub_index: 0, complete_access: false };
    for expected in [1, 2, 3, 4, 5, 6, 7, 1] {
        client.post_sdo(&request);
        assert_eq!(client.answer().0.counter, expected);
    }
}

// covers: sim-mailbox
#[test]
fn a_lost_answer_is_repeated_with_its_counter() {
    let mut client = Client::new("servo", AlState::PreOp);
    client.post_sdo(&SdoRequest::Upload { index: 0x1018, sub_index: 2, complete_access: false });
    let lost = client.answer();
    let toggled = client.toggle_repeat();
    assert_eq!(client.repeat_acknowledge(), toggled);
    assert_eq!(client.bench.fetch_mail(), Some(lost));
    assert!(client.bench.fetch_mail().is_none());
    client.upload(0x1000, 0).unwrap();
}

#[test]
fn a_waiting_response_follows_the_repeated_one() {
    let mut client = Client::new("servo", AlState::PreOp);
    client.post_sdo(&SdoRequest::Upload { index: 0x1018, sub_index: 1, complete_access: false });
    let lost = client.answer();
    client.post_sdo(&SdoRequest::Upload { index: 0x1018, sub_index: 2, complete_access: false });
    client.bench.pass(ANSWER);
    let toggled = client.toggle_repeat();
    assert_eq!(client.repeat_acknowledge(), toggled);
    assert_eq!(client.bench.fetch_mail(), Some(lost));
    let (header, payload) = client.bench.fetch_mail().unwrap();
    assert_eq!(header.counter, 2);
    assert!(matches!(SdoResponse::decode(&payload), Ok(SdoResponse::UploadExpedited { sub_index: 2, .. })));
}

#[test]
fn a_repeat_bit_set_before_preop_is_no_request() {
    let mut bench = Bench::named("servo");
    for number in [0, 1] {
        let mut manager = bench.right(number);
        manager.activate.repeat_request = number == 1;
        bench.set_sync_manager(number, &manager);
    }
    assert_eq!(bench.request(AlState::PreOp).0.bits(), 0x0002);
    assert_eq!(bench.read(map::sync_manager(1).offset(SyncManager::PDI_CONTROL), 1)[0], 0x02);
    assert!(bench.fetch_mail().is_none());
}

#[test]
fn consecutive_requests_are_answered_in_order_and_a_full_queue_fills_the_mailbox() {
    let mut client = Client::new("servo", AlState::PreOp);
    let mut payload = [0; 16];
    let mut accepted = 0;
    for number in 0..10u8 {
        let request = SdoRequest::Upload { index: 0x1018, sub_index: number % 5, complete_access: false };
        let length = request.encode(&mut payload).unwrap();
        let header = Header::new(Protocol::Coe, number % 7 + 1, length as u16);
        accepted += u8::from(client.bench.send_mail(header, &payload[..length]));
    }
    assert!((4..10).contains(&accepted), "{accepted}");
    for number in 0..accepted {
        let (header, payload) = client.answer();
        assert_eq!(header.counter, number % 7 + 1);
        let response = SdoResponse::decode(&payload).unwrap();
        let expected = number % 5;
        assert!(matches!(response, SdoResponse::UploadExpedited { sub_index, .. } if sub_index == expected));
    }
}

// covers: sim-mailbox
#[test]
fn other_protocols_services_and_broken_headers_get_an_error_reply() {
    let mut described = catalogue::by_name("analog-input-4").unwrap();
    let mailbox = described.mailbox.as_mut().unwrap();
    mailbox.coe_details.0 &= !CoeDetails::SDO_INFORMATION;
    let mut client = Client::of(described, AlState::PreOp);
    let mut refused = |header: Header, payload: &[u8]| {
        assert!(client.bench.send_mail(header, payload));
        let (header, payload) = client.answer();
        assert_eq!(header.protocol, Protocol::Error);
        ErrorReply::decode(payload.first_chunk().unwrap()).detail
    };
    let foe = Header::new(Protocol::Foe, 1, 12);
    assert_eq!(refused(foe, &[0; 12]), ErrorReply::UNSUPPORTED_PROTOCOL);
    let information = CoeHeader::new(CoeService::SdoInformation).encode();
    let service = Header::new(Protocol::Coe, 2, 2);
    assert_eq!(refused(service, &information), ErrorReply::SERVICE_NOT_SUPPORTED);
    let short = CoeHeader::new(CoeService::SdoRequest).encode();
    assert_eq!(refused(Header::new(Protocol::Coe, 3, 2), &short), ErrorReply::SIZE_TOO_SHORT);
    let channel = Header { channel: 5, ..Header::new(Protocol::Coe, 4, 2) };
    assert_eq!(refused(channel, &short), ErrorReply::INVALID_CHANNEL);
    let length = Header::new(Protocol::Coe, 5, 1000);
    assert_eq!(refused(length, &short), ErrorReply::INVALID_HEADER);
}

#[test]
fn the_mailbox_is_closed_in_init() {
    let mut client = Client::new("servo", AlState::PreOp);
    client.bench.request(AlState::Init);
    client.post_sdo(&SdoRequest::Upload { index: 0x1000, sub_index: 0, complete_access: false });
    client.bench.pass(ANSWER);
    assert!(client.bench.fetch_mail().is_none());
}
