//! Protocol 6.6 from the view of a MainDevice: elements of IDNs, fragments in both directions, errors, procedure
//! commands.

use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::soe::{Idn, IdnAttribute, IdnLength, SoeElements, SoeErrorCode, SoeMessage, SoeOperation};

use super::client::{ANSWER, Client};

const VALUE: SoeElements = SoeElements::VALUE;
/// Data of a fragment in a mailbox of 1,024 bytes.
const FRAGMENT: usize = 1014;
const CHARACTERISTIC: Idn = Idn::product(0, 1);

fn client() -> Client {
    Client::new("soe-drive", AlState::PreOp)
}

fn post(client: &mut Client, message: &SoeMessage<'_>) {
    let mut payload = [0; 1018];
    let length = message.encode(&mut payload).unwrap();
    client.post(Protocol::Soe, &payload[..length]);
}

/// Reads a response and reassembles its fragments.
fn answer(client: &mut Client, operation: SoeOperation) -> Result<Vec<u8>, SoeErrorCode> {
    let mut data = Vec::new();
    let mut left = None;
    loop {
        let (header, payload) = client.answer();
        assert_eq!(header.protocol, Protocol::Soe);
        let message = SoeMessage::decode(&payload).unwrap();
        assert_eq!(message.operation, operation);
        if let Some(code) = message.error_code() {
            return Err(code);
        }
        assert!(left.is_none_or(|left: u16| left == message.fragments_left() + 1), "fragments count down");
        left = Some(message.fragments_left());
        data.extend_from_slice(message.data);
        if !message.incomplete {
            return Ok(data);
        }
    }
}

fn read(client: &mut Client, drive: u8, idn: Idn, elements: SoeElements) -> Result<Vec<u8>, SoeErrorCode> {
    post(client, &SoeMessage::whole(SoeOperation::ReadRequest, drive, elements, idn, &[]));
    answer(client, SoeOperation::ReadResponse)
}

fn write(client: &mut Client, drive: u8, idn: Idn, data: &[u8]) -> Result<Vec<u8>, SoeErrorCode> {
    let pieces: Vec<&[u8]> = if data.is_empty() { vec![data] } else { data.chunks(FRAGMENT).collect() };
    let count = pieces.len();
    for (place, piece) in pieces.into_iter().enumerate() {
        let left = (count - 1 - place) as u16;
        let whole = SoeMessage::whole(SoeOperation::WriteRequest, drive, VALUE, idn, piece);
        let number = if left > 0 { left } else { idn.0 };
        post(client, &SoeMessage { incomplete: left > 0, number, ..whole });
        if left > 0 {
            client.bench.pass(ANSWER);
            assert!(client.bench.fetch_mail().is_none(), "only the last fragment is answered");
        }
    }
    answer(client, SoeOperation::WriteResponse)
}

// covers: 6.6, sim-mailbox
#[test]
fn every_element_of_an_idn_is_read() {
    let mut client = client();
    let idn = Idn::standard(0, 36);
    let mut element = |element| read(&mut client, 0, idn, element);
    assert_eq!(element(SoeElements::DATA_STATE), Ok(vec![0, 0]));
    assert_eq!(element(SoeElements::NAME), Ok(b"\x16\x00\x16\x00Velocity command value".to_vec()));
    let attribute = element(SoeElements::ATTRIBUTE).unwrap();
    let attribute = IdnAttribute(u32::from_le_bytes(attribute.try_into().unwrap()));
    assert_eq!((attribute.length(), attribute.display_format()), (IdnLength::Fixed(4), 2));
    assert_eq!(element(SoeElements::UNIT), Ok(b"\x03\x00\x03\x00rpm".to_vec()));
    assert_eq!(element(SoeElements::MINIMUM), Ok((-6000i32).to_le_bytes().to_vec()));
    assert_eq!(element(SoeElements::MAXIMUM), Ok(6000i32.to_le_bytes().to_vec()));
    assert_eq!(element(VALUE), Ok(vec![0; 4]));
    assert_eq!(element(SoeElements::DEFAULT), Ok(vec![0; 4]));
    let several = SoeElements(VALUE.0 | SoeElements::UNIT.0);
    assert_eq!(element(several), Ok(b"\x03\x00\x03\x00rpm\0\0\0\0".to_vec()), "in the order of the bits");
}

// covers: 6.6
#[test]
fn drives_have_separate_values() {
    let mut client = client();
    let idn = Idn::standard(0, 36);
    assert_eq!(write(&mut client, 1, idn, &(-5i32).to_le_bytes()), Ok(Vec::new()));
    assert_eq!(read(&mut client, 1, idn, VALUE), Ok((-5i32).to_le_bytes().to_vec()));
    assert_eq!(read(&mut client, 0, idn, VALUE), Ok(vec![0; 4]));
    assert_eq!(read(&mut client, 2, idn, VALUE), Err(SoeErrorCode::INVALID_DRIVE));
}

// covers: 6.6, sim-mailbox
#[test]
fn long_values_are_read_and_written_in_fragments() {
    let mut client = client();
    let value = read(&mut client, 0, CHARACTERISTIC, VALUE).unwrap();
    assert_eq!((value.len(), &value[..6]), (5004, &[0x88, 0x13, 0x20, 0x4E, 0, 1][..]));
    for length in [0, 1, FRAGMENT - 4, FRAGMENT - 3, 2 * FRAGMENT - 4, 20_000] {
        let mut data = (length as u16).to_le_bytes().to_vec();
        data.extend([0x20, 0x4E]);
        data.extend((0..length).map(|place| (place * 3 % 239) as u8));
        assert_eq!(write(&mut client, 0, CHARACTERISTIC, &data), Ok(Vec::new()), "{length}");
        assert_eq!(read(&mut client, 0, CHARACTERISTIC, VALUE), Ok(data), "{length}");
    }
}

// covers: 6.6, sim-mailbox
#[test]
fn refused_soe_requests_are_reported_with_their_code() {
    let mut client = client();
    let idn = Idn::standard(0, 36);
    assert_eq!(read(&mut client, 0, Idn::standard(0, 999), VALUE), Err(SoeErrorCode::NO_IDN));
    assert_eq!(read(&mut client, 0, idn, SoeElements(0)), Err(SoeErrorCode::NO_ELEMENT));
    assert_eq!(read(&mut client, 0, Idn::standard(0, 134), SoeElements::UNIT), Err(SoeErrorCode::NO_UNIT));
    assert_eq!(read(&mut client, 0, Idn::standard(0, 134), SoeElements::MAXIMUM), Err(SoeErrorCode::NO_MAXIMUM));
    assert_eq!(write(&mut client, 0, idn, &[0; 3]), Err(SoeErrorCode::VALUE_TOO_SHORT));
    assert_eq!(write(&mut client, 0, idn, &[0; 5]), Err(SoeErrorCode::VALUE_TOO_LONG));
    assert_eq!(write(&mut client, 0, idn, &(-6001i32).to_le_bytes()), Err(SoeErrorCode::BELOW_MINIMUM));
    assert_eq!(write(&mut client, 0, idn, &6001i32.to_le_bytes()), Err(SoeErrorCode::ABOVE_MAXIMUM));
    assert_eq!(write(&mut client, 0, Idn::standard(0, 11), &[1, 0]), Err(SoeErrorCode::VALUE_READ_ONLY));
    assert_eq!(write(&mut client, 0, CHARACTERISTIC, &[0x21, 0x4E, 0, 0]), Err(SoeErrorCode::VALUE_TOO_LONG));
    assert_eq!(write(&mut client, 0, CHARACTERISTIC, &[2, 0, 0, 0, 1]), Err(SoeErrorCode::VALUE_TOO_SHORT));
    assert_eq!(write(&mut client, 0, Idn::standard(0, 16), &[3, 0, 3, 0, 1, 2, 3]), Err(SoeErrorCode::INVALID_VALUE));
    let name = SoeMessage::whole(SoeOperation::WriteRequest, 0, SoeElements::NAME, idn, b"x");
    post(&mut client, &name);
    assert_eq!(answer(&mut client, SoeOperation::WriteResponse), Err(SoeErrorCode::NAME_READ_ONLY));
}

// covers: 6.6
#[test]
fn configuration_is_written_in_preop_only() {
    let telegram = Idn::standard(0, 15);
    let mut client = client();
    assert_eq!(write(&mut client, 0, telegram, &[5, 0]), Ok(Vec::new()));
    let mut client = Client::new("soe-drive", AlState::SafeOp);
    assert_eq!(write(&mut client, 0, telegram, &[7, 0]), Err(SoeErrorCode::VALUE_PROTECTED));
    assert_eq!(write(&mut client, 0, Idn::standard(0, 36), &[7, 0, 0, 0]), Ok(Vec::new()));
}

// covers: 6.6
#[test]
fn the_list_of_all_idns_is_complete() {
    let mut client = client();
    let list = read(&mut client, 0, Idn::standard(0, 17), VALUE).unwrap();
    let idns: Vec<Idn> = list[4..].chunks(2).map(|pair| Idn(u16::from_le_bytes([pair[0], pair[1]]))).collect();
    assert_eq!(usize::from(u16::from_le_bytes([list[0], list[1]])), 2 * idns.len());
    assert!(idns.is_sorted() && idns.contains(&CHARACTERISTIC) && idns.contains(&Idn::standard(0, 17)));
    for idn in idns {
        assert!(read(&mut client, 0, idn, SoeElements::NAME).is_ok(), "{idn}");
    }
    let commands = read(&mut client, 0, Idn::standard(0, 25), VALUE);
    assert_eq!(commands, Ok(vec![2, 0, 2, 0, 99, 0]));
}

// covers: 6.6, sim-mailbox
#[test]
fn a_procedure_command_has_a_duration_and_is_notified() {
    let mut client = client();
    let reset = Idn::standard(0, 99);
    let state = |client: &mut Client| read(client, 0, reset, SoeElements::DATA_STATE).unwrap()[0];
    write(&mut client, 0, reset, &[3, 0]).unwrap();
    assert_eq!(state(&mut client), 0x07);
    assert_eq!(write(&mut client, 0, reset, &[3, 0]), Err(SoeErrorCode::COMMAND_ACTIVE));
    client.bench.pass(Duration::from_millis(6));
    let (header, payload) = client.bench.fetch_mail().unwrap();
    assert_eq!(header.protocol, Protocol::Soe);
    let message = SoeMessage::decode(&payload).unwrap();
    assert_eq!((message.operation, message.idn(), message.drive), (SoeOperation::Notification, Some(reset), 0));
    assert_eq!(state(&mut client), 0x03);
    write(&mut client, 0, reset, &[0, 0]).unwrap();
    assert_eq!(state(&mut client), 0x00);
}

// covers: 6.6
#[test]
fn a_procedure_command_can_be_cancelled() {
    let mut client = client();
    let reset = Idn::standard(0, 99);
    write(&mut client, 1, reset, &[3, 0]).unwrap();
    write(&mut client, 1, reset, &[0, 0]).unwrap();
    client.bench.pass(Duration::from_millis(20));
    assert!(client.bench.fetch_mail().is_none(), "no notification");
    assert_eq!(write(&mut client, 1, reset, &[9, 0]), Err(SoeErrorCode::INVALID_VALUE));
}
