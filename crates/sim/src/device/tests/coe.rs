//! Protocol 6.3 from the view of a MainDevice: segmented transfers, SDO information, emergencies, diagnosis history.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::coe::{
    AccessRights, CoeHeader, CoeService, DataType, DiagnosisFlags, DiagnosisHistory, DiagnosisKind, DiagnosisMessage,
    DiagnosisParameter, Emergency, EntryDescription, EntryRequest, InformationOpcode, ListType, ObjectCode,
    ObjectDescription, SdoInformation, ValueInfo,
};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{ErrorReply, Header, Protocol};

use super::client::{ANSWER, Client};
use crate::catalogue::LARGE_OBJECT_BYTES;

const LARGE: u16 = 0x2002;

fn client() -> Client {
    Client::new("all-protocols", AlState::PreOp)
}

fn respond(client: &mut Client, request: &SdoRequest<'_>) -> Vec<u8> {
    client.post_sdo(request);
    let (header, payload) = client.answer();
    assert_eq!(header.protocol, Protocol::Coe);
    payload
}

/// Reads an object of any size; `tamper` returns for each segment whether its toggle is wrong.
fn upload(
    client: &mut Client,
    index: u16,
    complete_access: bool,
    mut tamper: impl FnMut(usize) -> bool,
) -> Result<Vec<u8>, AbortCode> {
    let first = respond(client, &SdoRequest::Upload { index, sub_index: 0, complete_access });
    let (total, mut object) = match SdoResponse::decode(&first).unwrap() {
        SdoResponse::UploadExpedited { data, .. } => return Ok(data.to_vec()),
        SdoResponse::UploadNormal { total, data, .. } => (total as usize, data.to_vec()),
        SdoResponse::Abort { code, .. } => return Err(code),
        other => panic!("{other:?}"),
    };
    let mut toggle = false;
    for number in 0.. {
        if object.len() >= total {
            break;
        }
        let wrong = tamper(number);
        let segment = respond(client, &SdoRequest::UploadSegment { toggle: toggle ^ wrong });
        match SdoResponse::decode(&segment).unwrap() {
            SdoResponse::UploadSegment { toggle: answered, last, data } => {
                assert_eq!(answered, toggle);
                object.extend_from_slice(data);
                assert_eq!(last, object.len() == total);
            }
            SdoResponse::Abort { code, .. } => return Err(code),
            other => panic!("{other:?}"),
        }
        toggle = !toggle;
    }
    Ok(object)
}

fn download(client: &mut Client, index: u16, total: usize, data: &[u8]) -> Result<(), AbortCode> {
    let mut pieces = data.chunks(1009);
    let first = pieces.next().unwrap_or_default();
    let start = SdoRequest::DownloadNormal {
        index,
        sub_index: 0,
        complete_access: false,
        total: total as u32,
        data: &first[..first.len().min(1008)],
    };
    let mut answers = vec![respond(client, &start)];
    let rest: Vec<&[u8]> = data[first.len().min(1008)..].chunks(1015).collect();
    for (number, piece) in rest.iter().enumerate() {
        if matches!(SdoResponse::decode(answers.last().unwrap()), Ok(SdoResponse::Abort { .. })) {
            break;
        }
        let last = number + 1 == rest.len();
        answers.push(respond(client, &SdoRequest::DownloadSegment { toggle: number % 2 == 1, last, data: piece }));
    }
    match SdoResponse::decode(answers.last().unwrap()).unwrap() {
        SdoResponse::DownloadDone { .. } => Ok(()),
        SdoResponse::DownloadSegmentDone { toggle } => {
            assert_eq!(toggle, rest.len().is_multiple_of(2));
            Ok(())
        }
        SdoResponse::Abort { code, .. } => Err(code),
        other => panic!("{other:?}"),
    }
}

// covers: 6.3, sim-mailbox
#[test]
fn an_object_of_100_kb_is_uploaded_in_segments() {
    let mut client = client();
    let object = upload(&mut client, LARGE, false, |_| false).unwrap();
    assert_eq!(object.len(), LARGE_OBJECT_BYTES);
    assert!(object.iter().enumerate().all(|(place, byte)| usize::from(*byte) == place % 251));
}

// covers: 6.3, sim-mailbox
#[test]
fn any_length_is_downloaded_and_read_back() {
    let mut client = client();
    // Around the limits of the first message and of the segments, complete and one byte less.
    for length in [5, 1007, 1008, 1009, 1010, 2022, 2023, 2024, 3038, 3039, 60_000] {
        let data: Vec<u8> = (0..length).map(|place| (place * 7 % 253) as u8).collect();
        assert_eq!(download(&mut client, LARGE, length, &data), Ok(()), "{length}");
        assert_eq!(upload(&mut client, LARGE, false, |_| false), Ok(data), "{length}");
    }
}

// covers: 6.3, sim-mailbox
#[test]
fn a_wrong_toggle_ends_the_transfer() {
    let mut client = client();
    let result = upload(&mut client, LARGE, false, |number| number == 3);
    assert_eq!(result, Err(AbortCode::TOGGLE_NOT_ALTERNATED));
    let more = respond(&mut client, &SdoRequest::UploadSegment { toggle: true });
    let unknown = SdoResponse::Abort { index: 0, sub_index: 0, code: AbortCode::UNKNOWN_COMMAND };
    assert_eq!(SdoResponse::decode(&more), Ok(unknown));
}

#[test]
fn a_download_has_the_announced_number_of_bytes() {
    let mut client = client();
    assert_eq!(download(&mut client, LARGE, 3000, &[1; 2500]), Err(AbortCode::LENGTH_TOO_SHORT));
    assert_eq!(download(&mut client, LARGE, 2000, &[1; 2500]), Err(AbortCode::LENGTH_TOO_LONG));
    assert_eq!(download(&mut client, LARGE, 10_000_000, &[1; 2500]), Err(AbortCode::OUT_OF_MEMORY));
    assert_eq!(download(&mut client, 0x1008, 2000, &[1; 2000]), Err(AbortCode::READ_ONLY));
    assert_eq!(download(&mut client, 0x2004, 2000, &[1; 2000]), Err(AbortCode::LENGTH_TOO_LONG));
    assert_eq!(upload(&mut client, LARGE, false, |_| false).unwrap().len(), LARGE_OBJECT_BYTES, "unchanged");
}

// covers: 6.3
#[test]
fn an_abort_ends_a_transfer_and_is_not_answered() {
    let mut client = client();
    respond(&mut client, &SdoRequest::Upload { index: LARGE, sub_index: 0, complete_access: false });
    client.post_sdo(&SdoRequest::Abort { index: LARGE, sub_index: 0, code: AbortCode::GENERAL });
    client.bench.pass(ANSWER);
    assert!(client.bench.fetch_mail().is_none());
    let more = respond(&mut client, &SdoRequest::UploadSegment { toggle: false });
    assert!(matches!(SdoResponse::decode(&more), Ok(SdoResponse::Abort { code: AbortCode::UNKNOWN_COMMAND, .. })));
}

// covers: sim-mailbox
#[test]
fn complete_access_reads_a_record_with_every_data_type() {
    let mut client = client();
    let bytes = upload(&mut client, 0x2000, true, |_| false).unwrap();
    let sizes = DataType::ALL.iter().map(|kind| kind.bits().map_or(4, |bits| usize::from(bits).div_ceil(8)));
    assert_eq!(bytes.len(), 2 + sizes.sum::<usize>());
    assert_eq!(usize::from(bytes[0]), DataType::ALL.len());
    let array = upload(&mut client, 0x2001, true, |_| false).unwrap();
    assert_eq!((array.len(), &array[..6]), (402, &[200, 0, 1, 0, 2, 0][..]));
    assert_eq!(upload(&mut client, 0x2003, true, |_| false), Err(AbortCode::WRITE_ONLY));
}

// covers: sim-mailbox
#[test]
fn ranges_and_rights_of_an_entry_are_kept() {
    let mut client = client();
    assert_eq!(client.download(0x2003, 1, &(-100i16).to_le_bytes()), Ok(Vec::new()));
    assert_eq!(client.download(0x2003, 1, &(-101i16).to_le_bytes()), Err(AbortCode::VALUE_TOO_LOW));
    assert_eq!(client.download(0x2003, 1, &101i16.to_le_bytes()), Err(AbortCode::VALUE_TOO_HIGH));
    assert_eq!(client.upload(0x2003, 1), Ok((-100i16).to_le_bytes().to_vec()));
    assert_eq!(client.download(0x2003, 3, &[1; 4]), Ok(Vec::new()));
    assert_eq!(client.upload(0x2003, 3), Err(AbortCode::WRITE_ONLY));
}

/// Requests SDO information and reassembles the fragments.
fn information(client: &mut Client, opcode: InformationOpcode, data: &[u8]) -> (InformationOpcode, Vec<u8>, usize) {
    let mut payload = [0; 64];
    let length = SdoInformation::whole(opcode, data).encode(&mut payload).unwrap();
    client.post(Protocol::Coe, &payload[..length]);
    let mut whole = Vec::new();
    for number in 1.. {
        let (_, payload) = client.answer();
        let fragment = SdoInformation::decode(&payload).unwrap();
        whole.extend_from_slice(fragment.data);
        assert_eq!(fragment.incomplete, fragment.fragments_left > 0);
        if !fragment.incomplete {
            return (fragment.opcode, whole, number);
        }
    }
    unreachable!("every list has an end")
}

fn indices(bytes: &[u8]) -> Vec<u16> {
    bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect()
}

// covers: 6.3, sim-mailbox
#[test]
fn lists_of_objects_follow_their_access_rights() {
    let mut client = client();
    let mut list = |kind: ListType| {
        let (opcode, data, _) = information(&mut client, InformationOpcode::ListRequest, &kind.code().to_le_bytes());
        assert_eq!(opcode, InformationOpcode::ListResponse);
        let mut numbers = indices(&data);
        assert_eq!(numbers.remove(0), kind.code());
        numbers
    };
    let all = list(ListType::All);
    assert!(
        all.is_sorted() && [0x1000, 0x1018, 0x10F3, 0x1C12, 0x2000, 0x7000].iter().all(|index| all.contains(index))
    );
    assert_eq!((list(ListType::RxMappable), list(ListType::TxMappable)), (vec![0x7000], vec![0x6000]));
    assert_eq!((list(ListType::Backup), list(ListType::Settings)), (vec![0x2003], vec![0x2003]));
    assert_eq!(list(ListType::Lengths), [all.len() as u16, 1, 1, 1, 1]);
}

// covers: 6.3, sim-mailbox
#[test]
fn a_list_that_does_not_fit_is_sent_in_fragments() {
    let mut client = Client::new("servo", AlState::PreOp);
    let (_, data, fragments) = information(&mut client, InformationOpcode::ListRequest, &[1, 0]);
    let dictionary = client.bench.device.application.dictionary();
    let expected: Vec<u16> = dictionary.objects().iter().map(|object| object.index).collect();
    assert_eq!(indices(&data)[1..], expected);
    assert_eq!(fragments, data.len().div_ceil(116), "128 bytes minus 6 of the mailbox header and 6 of the message");
    let mut client = self::client();
    let (_, data, fragments) = information(&mut client, InformationOpcode::ObjectRequest, &[0x04, 0x20]);
    assert_eq!((data.len(), fragments), (6 + 300, 1));
}

// covers: 6.3, sim-mailbox
#[test]
fn objects_and_entries_are_described() {
    let mut client = client();
    let mut object = |index: u16| information(&mut client, InformationOpcode::ObjectRequest, &index.to_le_bytes()).1;
    let kinds = [
        (0x1000, ObjectCode::Variable, 0, DataType::UNSIGNED32),
        (0x1018, ObjectCode::Array, 4, DataType::IDENTITY),
        (0x1600, ObjectCode::Record, 1, DataType::PDO_MAPPING),
        (0x2000, ObjectCode::Record, 50, DataType(0)),
        (0x2001, ObjectCode::Array, 200, DataType::UNSIGNED16),
        (LARGE, ObjectCode::Domain, 0, DataType::DOMAIN),
    ];
    for (index, code, max_sub_index, data_type) in kinds {
        let bytes = object(index);
        let description = ObjectDescription::decode(&bytes).unwrap();
        let got = (description.index, description.code, description.max_sub_index, description.data_type);
        assert_eq!(got, (index, code, max_sub_index, data_type), "{index:#06x}");
    }
    let mut entry = |index, sub_index, value_info| {
        let request = EntryRequest { index, sub_index, value_info }.encode();
        information(&mut client, InformationOpcode::EntryRequest, &request)
    };
    let (opcode, bytes, _) = entry(0x2003, 2, ValueInfo::ALL);
    assert_eq!(opcode, InformationOpcode::EntryResponse);
    let ramp = EntryDescription::decode(&bytes).unwrap();
    assert_eq!((ramp.name, ramp.data_type, ramp.bit_length), (&b"Ramp"[..], DataType::UNSIGNED32, 32));
    let range = (ramp.default, ramp.minimum, ramp.maximum);
    assert_eq!(range, (Some(&[0x50, 0xC3, 0, 0][..]), Some(&[1, 0, 0, 0][..]), Some(&[0x40, 0x42, 0x0F, 0][..])));
    assert!(ramp.access.has(AccessRights::READ | AccessRights::WRITE_PREOP | AccessRights::BACKUP));
    assert!(!ramp.access.has(AccessRights::WRITE_OP));
    let (_, bytes, _) = entry(0x2003, 2, ValueInfo(0));
    assert_eq!(EntryDescription::decode(&bytes).unwrap().default, None, "only the requested parts");
    let (_, bytes, _) = entry(LARGE, 0, ValueInfo::ALL);
    assert_eq!(EntryDescription::decode(&bytes).unwrap().bit_length, 0, "a domain has any length");
    let (_, bytes, _) = entry(0x7000, 1, ValueInfo::ALL);
    assert!(EntryDescription::decode(&bytes).unwrap().access.has(AccessRights::RX_MAPPABLE));
}

// covers: 6.3
#[test]
fn invalid_sdo_information_requests_are_errors_with_a_code() {
    let mut client = client();
    let mut error = |opcode, data: &[u8]| {
        let (opcode, bytes, _) = information(&mut client, opcode, data);
        assert_eq!(opcode, InformationOpcode::Error);
        SdoInformation::whole(opcode, &bytes).abort_code().unwrap()
    };
    use InformationOpcode::{EntryRequest, ListRequest, ObjectRequest, Other};
    assert_eq!(error(ObjectRequest, &[0x99, 0x99]), AbortCode::OBJECT_DOES_NOT_EXIST);
    assert_eq!(error(EntryRequest, &[0x18, 0x10, 9, 0]), AbortCode::SUB_INDEX_DOES_NOT_EXIST);
    assert_eq!(error(ListRequest, &[6, 0]), AbortCode::VALUE_RANGE);
    assert_eq!(error(Other(0x55), &[]), AbortCode::UNKNOWN_COMMAND);
}

fn emergency(code: u16) -> Emergency {
    Emergency { error_code: code, error_register: 0x11, data: [1, 2, 3, 4, 5] }
}

fn is_emergency(mail: &(Header, Vec<u8>), code: u16) -> bool {
    let (head, rest) = mail.1.split_first_chunk().unwrap();
    CoeHeader::decode(head).service == CoeService::Emergency
        && Emergency::decode(rest.first_chunk().unwrap()).error_code == code
}

// covers: 6.3, sim-mailbox
#[test]
fn an_emergency_is_sent_between_a_request_and_its_response() {
    let mut client = client();
    client.post_sdo(&SdoRequest::Upload { index: 0x1000, sub_index: 0, complete_access: false });
    assert!(client.bench.device.application.emergency(&emergency(0x3210)));
    let first = client.answer();
    assert!(is_emergency(&first, 0x3210));
    let second = client.answer();
    assert!(matches!(SdoResponse::decode(&second.1), Ok(SdoResponse::UploadExpedited { .. })));
    assert_eq!((first.0.counter, second.0.counter), (1, 2));
    assert_eq!(client.upload(0x1001, 0), Ok(vec![0x11]));
}

// covers: sim-mailbox
#[test]
fn emergencies_wait_for_the_mailbox_and_too_many_are_dropped() {
    let mut client = client();
    let sent = (0..100).filter(|code| client.bench.device.application.emergency(&emergency(*code))).count();
    assert_eq!(sent, 64);
    for code in 0..64 {
        let mail = client.answer();
        assert!(is_emergency(&mail, code));
        assert_eq!(u16::from(mail.0.counter), code % 7 + 1);
    }
    client.bench.request(AlState::Init);
    assert!(!client.bench.device.application.emergency(&emergency(1)), "no mailbox in INIT");
}

fn diagnose(client: &mut Client, code: u16) -> bool {
    let message = DiagnosisMessage {
        code: u32::from(code) << 16 | u32::from(DiagnosisMessage::VENDOR_CODE),
        kind: DiagnosisKind::Warning,
        local_time: false,
        reserved: 0,
        text: 7,
        time_ns: 0,
        parameter_count: 0,
        parameters: &[],
    };
    client.bench.device.application.diagnose(&message, &[DiagnosisParameter::Ascii(b"axis 3")])
}

fn history(client: &mut Client, sub_index: u8) -> Vec<u8> {
    client.upload(DiagnosisHistory::INDEX, sub_index).unwrap()
}

// covers: 6.3, sim-mailbox
#[test]
fn the_diagnosis_history_is_a_ring_buffer_with_acknowledgement() {
    let mut client = client();
    assert_eq!((history(&mut client, 1), history(&mut client, 2)), (vec![20], vec![0]));
    for code in 1..=22 {
        assert!(diagnose(&mut client, code));
    }
    assert_eq!((history(&mut client, 2), history(&mut client, 4)), (vec![7], vec![1]), "two entries after the wrap");
    assert_eq!(history(&mut client, 5), DiagnosisFlags::LOST.to_le_bytes());
    let bytes = history(&mut client, 7);
    let newest = DiagnosisMessage::decode(&bytes).unwrap();
    assert_eq!((newest.code, newest.kind, newest.text), (0x0016_E800, DiagnosisKind::Warning, 7));
    assert!(newest.time_ns > 0);
    assert_eq!(newest.parameters().collect::<Vec<_>>(), [DiagnosisParameter::Ascii(b"axis 3")]);
    assert_eq!(client.download(DiagnosisHistory::INDEX, 3, &[5]), Err(AbortCode::VALUE_TOO_LOW));
    assert_eq!(client.download(DiagnosisHistory::INDEX, 3, &[25]), Ok(Vec::new()));
    assert_eq!(history(&mut client, 4), [1], "two messages are newer");
    client.download(DiagnosisHistory::INDEX, 3, &[7]).unwrap();
    assert_eq!((history(&mut client, 4), history(&mut client, 5)), (vec![0], vec![0, 0]));
    client.download(DiagnosisHistory::INDEX, 3, &[0]).unwrap();
    assert_eq!((history(&mut client, 2), history(&mut client, 7)), (vec![0], Vec::new()));
}

// covers: 6.3, sim-mailbox
#[test]
fn flags_of_the_diagnosis_history_exclude_messages_or_send_emergencies() {
    let mut client = client();
    let flags = |client: &mut Client, bits: u16| client.download(DiagnosisHistory::INDEX, 5, &bits.to_le_bytes());
    flags(&mut client, DiagnosisFlags::NO_WARNINGS).unwrap();
    assert!(!diagnose(&mut client, 1));
    flags(&mut client, DiagnosisFlags::EMERGENCY | DiagnosisFlags::ACKNOWLEDGE).unwrap();
    assert!(diagnose(&mut client, 2));
    let mail = client.answer();
    assert!(is_emergency(&mail, 0xFF00));
    for code in 3..=21 {
        assert!(diagnose(&mut client, code));
        client.answer();
    }
    assert!(!diagnose(&mut client, 22), "full of unacknowledged messages");
    client.download(DiagnosisHistory::INDEX, 3, &[6]).unwrap();
    assert!(diagnose(&mut client, 23));
}

fn pdo(client: &mut Client, service: CoeService, number: u16, data: &[u8]) -> Option<(Header, Vec<u8>)> {
    let mut payload = CoeHeader { number, ..CoeHeader::new(service) }.encode().to_vec();
    payload.extend_from_slice(data);
    client.post(Protocol::Coe, &payload);
    client.bench.pass(ANSWER);
    client.bench.fetch_mail()
}

// covers: 6.3, sim-mailbox
#[test]
fn pdos_are_sent_and_received_by_mailbox() {
    let mut client = Client::new("servo", AlState::PreOp);
    // Controlword, target position, target velocity, mode, gap.
    let command = [0x0F, 0, 0x44, 0x33, 0x22, 0x11, 0, 0, 0, 0, 8, 0];
    assert_eq!(pdo(&mut client, CoeService::RxPdo, 0, &command), None, "an RxPDO is not answered");
    assert_eq!(client.upload(0x607A, 0), Ok(vec![0x44, 0x33, 0x22, 0x11]));
    assert_eq!(client.upload(0x6060, 0), Ok(vec![8]));
    let (_, back) = pdo(&mut client, CoeService::RxPdoRemote, 0, &[]).unwrap();
    assert_eq!((&back[..2], &back[2..]), (&[0x00, 0x50][..], &command[..]));
    let (_, status) = pdo(&mut client, CoeService::TxPdoRemote, 1, &[]).unwrap();
    assert_eq!((&status[..2], status.len()), (&[0x01, 0x40][..], 4), "0x1A01, the statusword alone");
    let mut refused = |service, number, data: &[u8]| {
        let (header, payload) = pdo(&mut client, service, number, data).unwrap();
        assert_eq!(header.protocol, Protocol::Error);
        ErrorReply::decode(payload.first_chunk().unwrap()).detail
    };
    assert_eq!(refused(CoeService::RxPdo, 0, &command[1..]), ErrorReply::INVALID_SIZE);
    assert_eq!(refused(CoeService::RxPdo, 2, &[]), ErrorReply::SERVICE_NOT_SUPPORTED);
    assert_eq!(refused(CoeService::TxPdoRemote, 0x1FF, &[]), ErrorReply::SERVICE_NOT_SUPPORTED);
}

// covers: 6.3, sim-mailbox
#[test]
fn a_pdo_by_mailbox_shows_process_data_and_does_not_touch_it_in_op() {
    let mut client = Client::new("all-protocols", AlState::Op);
    client.bench.output(&[1, 2, 3, 4]);
    client.bench.pass(ANSWER);
    let (_, inputs) = pdo(&mut client, CoeService::TxPdoRemote, 0, &[]).unwrap();
    assert_eq!(inputs[2..], [1, 2, 3, 4], "the inputs are the outputs");
    assert_eq!(pdo(&mut client, CoeService::RxPdo, 0, &[9; 4]), None);
    assert_eq!(client.bench.device.outputs(), [1, 2, 3, 4]);
    assert_eq!(client.upload(0x7000, 1), Ok(vec![1, 2, 3, 4]));
}
