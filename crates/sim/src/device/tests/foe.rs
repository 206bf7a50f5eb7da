//! Protocol 6.4 from the view of a MainDevice: reading and writing files, BUSY, errors, firmware update in BOOT.

use core::time::Duration;

use ringcat_wire::al::{AlState, AlStatusCode};
use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::bench::Bench;
use super::client::Client;
use crate::application::foe::firmware;
use crate::application::mailbox::faults::MailFault;
use crate::catalogue;

/// Data of a packet in a mailbox of 1,024 and of 512 bytes.
const PACKET: usize = 1012;
const BOOT_PACKET: usize = 500;
const FIRMWARE: &[u8] = b"firmware.bin";

fn client() -> Client {
    Client::new("all-protocols", AlState::PreOp)
}

/// Sends a message and reads the response; `None` if there is none.
fn send(client: &mut Client, message: &FoeMessage<'_>) -> Option<Vec<u8>> {
    let mut payload = vec![0; 1018];
    let length = message.encode(&mut payload).unwrap();
    client.post(Protocol::Foe, &payload[..length]);
    client.bench.pass(super::client::ANSWER);
    let (header, payload) = client.bench.fetch_mail()?;
    assert_eq!(header.protocol, Protocol::Foe);
    Some(payload)
}

fn request(client: &mut Client, message: &FoeMessage<'_>) -> Vec<u8> {
    send(client, message).expect("an answer")
}

fn failure(bytes: &[u8]) -> (FoeErrorCode, String) {
    match FoeMessage::decode(bytes).unwrap() {
        FoeMessage::Error { code, text } => (code, String::from_utf8(text.to_vec()).unwrap()),
        other => panic!("{other:?}"),
    }
}

/// Writes a file; returns the number of BUSY responses.
fn write(client: &mut Client, name: &[u8], data: &[u8], most: usize) -> Result<usize, (FoeErrorCode, String)> {
    let first = request(client, &FoeMessage::Write { password: 0, name });
    if FoeMessage::decode(&first) != Ok(FoeMessage::Acknowledge { packet: 0 }) {
        return Err(failure(&first));
    }
    let mut pieces: Vec<&[u8]> = data.chunks(most).collect();
    if data.len().is_multiple_of(most) {
        pieces.push(&[]);
    }
    let mut busy = 0;
    for (packet, piece) in (1..).zip(pieces) {
        loop {
            let answer = request(client, &FoeMessage::Data { packet, data: piece });
            match FoeMessage::decode(&answer).unwrap() {
                FoeMessage::Acknowledge { packet: acknowledged } => {
                    assert_eq!(acknowledged, packet);
                    break;
                }
                FoeMessage::Busy { done, entire, .. } => {
                    assert!(done < entire);
                    busy += 1;
                }
                _ => return Err(failure(&answer)),
            }
        }
    }
    Ok(busy)
}

/// Reads a file.
fn read(client: &mut Client, name: &[u8], most: usize) -> Result<Vec<u8>, (FoeErrorCode, String)> {
    let mut file = Vec::new();
    let mut answer = request(client, &FoeMessage::Read { password: 0, name });
    for number in 1.. {
        let FoeMessage::Data { packet, data } = FoeMessage::decode(&answer).unwrap() else {
            return Err(failure(&answer));
        };
        assert_eq!(packet, number);
        file.extend_from_slice(data);
        let acknowledge = FoeMessage::Acknowledge { packet };
        if data.len() < most {
            assert_eq!(send(client, &acknowledge), None, "the last acknowledgement has no response");
            break;
        }
        answer = request(client, &acknowledge);
    }
    Ok(file)
}

// covers: 6.4, sim-mailbox
#[test]
fn files_of_any_size_are_written_and_read_back() {
    let mut client = client();
    for size in [0, 1, PACKET - 1, PACKET, PACKET + 1, 3 * PACKET, 40_000] {
        let file: Vec<u8> = (0..size).map(|place| (place * 5 % 241) as u8).collect();
        assert_eq!(write(&mut client, b"parameters.txt", &file, PACKET), Ok(0), "{size}");
        assert_eq!(read(&mut client, b"parameters.txt", PACKET), Ok(file), "{size}");
    }
}

// covers: sim-mailbox
#[test]
fn files_are_kept_over_a_power_cycle() {
    let mut client = client();
    write(&mut client, b"kept", b"still here", PACKET).unwrap();
    client.bench.power_cycle();
    client.bench.climb(AlState::PreOp);
    client.counter = 0;
    assert_eq!(read(&mut client, b"kept", PACKET), Ok(b"still here".to_vec()));
    assert_eq!(client.bench.device.application.files().names().count(), 2);
}

// covers: 6.4, sim-mailbox
#[test]
fn refused_file_requests_have_code_and_text() {
    let mut client = client();
    let mut error = |message: &FoeMessage<'_>| failure(&request(&mut client, message));
    let read = |name| FoeMessage::Read { password: 0, name };
    let write = |name| FoeMessage::Write { password: 0, name };
    assert_eq!(error(&read(b"nothing")), (FoeErrorCode::NOT_FOUND, "no such file".into()));
    assert_eq!(error(&read(b"")), (FoeErrorCode::ILLEGAL, "no name".into()));
    assert_eq!(error(&write(FIRMWARE)), (FoeErrorCode::BOOTSTRAP_ONLY, "firmware is written in BOOT".into()));
    assert_eq!(error(&FoeMessage::Data { packet: 1, data: &[] }).0, FoeErrorCode::ILLEGAL);
    assert_eq!(error(&FoeMessage::Acknowledge { packet: 1 }).0, FoeErrorCode::ILLEGAL);
}

// covers: 6.4
#[test]
fn a_wrong_packet_number_ends_the_transfer() {
    let mut client = client();
    request(&mut client, &FoeMessage::Write { password: 0, name: b"a" });
    let error = request(&mut client, &FoeMessage::Data { packet: 2, data: &[1] });
    assert_eq!(failure(&error).0, FoeErrorCode::PACKET_NUMBER_WRONG);
    let over = request(&mut client, &FoeMessage::Data { packet: 1, data: &[1] });
    assert_eq!(failure(&over).0, FoeErrorCode::ILLEGAL);
    request(&mut client, &FoeMessage::Read { password: 0, name: b"log.txt" });
    let error = request(&mut client, &FoeMessage::Acknowledge { packet: 3 });
    assert_eq!(failure(&error).0, FoeErrorCode::PACKET_NUMBER_WRONG);
}

// covers: 6.4
#[test]
fn a_file_that_is_too_large_fills_the_disk() {
    let mut description = catalogue::by_name("all-protocols").unwrap();
    description.services.foe.capacity = 3000;
    let mut client = Client::of(description, AlState::PreOp);
    let result = write(&mut client, b"large", &[1; 4000], PACKET);
    assert_eq!(result, Err((FoeErrorCode::DISK_FULL, "no room".into())));
    assert!(client.bench.device.application.files().file(b"large").is_none());
}

// covers: 6.4
#[test]
fn a_password_is_required() {
    let mut description = catalogue::by_name("all-protocols").unwrap();
    description.services.foe.password = 0x1234;
    let mut client = Client::of(description, AlState::PreOp);
    let error = request(&mut client, &FoeMessage::Read { password: 0x1235, name: b"log.txt" });
    assert_eq!(failure(&error).0, FoeErrorCode::ACCESS_DENIED);
    let right = request(&mut client, &FoeMessage::Read { password: 0x1234, name: b"log.txt" });
    assert!(matches!(FoeMessage::decode(&right), Ok(FoeMessage::Data { packet: 1, .. })));
}

// covers: 6.4, sim-mailbox
#[test]
fn busy_and_errors_are_injected_on_demand() {
    let mut client = client();
    request(&mut client, &FoeMessage::Write { password: 0, name: b"a" });
    let now = client.bench.now;
    client.bench.device.disturb_mail(MailFault::BusyFoe { count: 3 }, now);
    let mut progress = Vec::new();
    for _ in 0..3 {
        let answer = request(&mut client, &FoeMessage::Data { packet: 1, data: b"x" });
        let Ok(FoeMessage::Busy { done, entire: 100, text: b"erasing" }) = FoeMessage::decode(&answer) else {
            panic!("{answer:?}");
        };
        progress.push(done);
    }
    assert!(progress.is_sorted_by(|a, b| a < b), "{progress:?}");
    let answer = request(&mut client, &FoeMessage::Data { packet: 1, data: b"x" });
    assert_eq!(FoeMessage::decode(&answer), Ok(FoeMessage::Acknowledge { packet: 1 }));
    client.bench.device.disturb_mail(MailFault::FailFoe { code: FoeErrorCode::PROGRAM_ERROR }, now);
    let error = request(&mut client, &FoeMessage::Read { password: 0, name: b"a" });
    assert_eq!(failure(&error), (FoeErrorCode::PROGRAM_ERROR, "injected failure".into()));
}

// covers: 6.4
#[test]
fn a_busy_reader_receives_the_packet_again() {
    let mut client = client();
    let first = request(&mut client, &FoeMessage::Read { password: 0, name: b"log.txt" });
    assert_eq!(request(&mut client, &FoeMessage::Busy { done: 0, entire: 0, text: b"" }), first);
    let cancel = FoeMessage::Error { code: FoeErrorCode::NOT_DEFINED, text: b"enough" };
    assert_eq!(send(&mut client, &cancel), None);
    let over = request(&mut client, &FoeMessage::Acknowledge { packet: 1 });
    assert_eq!(failure(&over).0, FoeErrorCode::ILLEGAL);
}

/// In BOOT, with the mailboxes of BOOT.
fn booted() -> Client {
    let description = catalogue::by_name("all-protocols").unwrap();
    let mut bench = Bench::new(description);
    bench.use_bootstrap(true);
    bench.set_mailbox();
    assert_eq!(bench.request(AlState::Boot).0.bits(), 0x0003);
    Client::on(bench)
}

/// Back to PREOP with the mailboxes of PREOP.
fn leave_boot(client: &mut Client) -> (u16, AlStatusCode) {
    client.bench.request(AlState::Init);
    client.bench.use_bootstrap(false);
    client.bench.set_mailbox();
    client.counter = 0;
    let (status, code) = client.bench.request(AlState::PreOp);
    (status.bits(), code)
}

// covers: 6.4, sim-mailbox
#[test]
fn firmware_is_written_in_boot_and_changes_the_version() {
    let mut client = booted();
    let image = firmware::image("2.7.1", &[0x5A; 4 * BOOT_PACKET]);
    let busy = write(&mut client, FIRMWARE, &image, BOOT_PACKET).unwrap();
    assert!(busy > 10, "{busy}: erasing takes time");
    assert_eq!(leave_boot(&mut client), (0x0002, AlStatusCode::NO_ERROR));
    assert_eq!(client.upload(0x100A, 0), Ok(b"2.7.1".to_vec()));
    client.bench.power_cycle();
    client.bench.climb(AlState::PreOp);
    client.counter = 0;
    assert_eq!(client.upload(0x100A, 0), Ok(b"2.7.1".to_vec()));
    assert_eq!(read(&mut client, FIRMWARE, PACKET), Ok(image));
}

// covers: 5.5, sim-mailbox
#[test]
fn incomplete_firmware_leaves_the_device_without_firmware() {
    let mut client = booted();
    let image = firmware::image("2.7.1", &[0x5A; 4 * BOOT_PACKET]);
    let mut broken = image.clone();
    broken[1000] ^= 1;
    let error = write(&mut client, FIRMWARE, &broken, BOOT_PACKET).unwrap_err();
    assert_eq!(error, (FoeErrorCode::CHECKSUM_WRONG, "checksum wrong".into()));
    assert_eq!(leave_boot(&mut client), (0x0011, AlStatusCode::NO_VALID_FIRMWARE));
    client.bench.acknowledge(AlState::Init);
    client.bench.use_bootstrap(true);
    client.bench.set_mailbox();
    client.counter = 0;
    client.bench.request(AlState::Boot);
    let foreign = write(&mut client, FIRMWARE, b"something else", BOOT_PACKET).unwrap_err();
    assert_eq!(foreign.0, FoeErrorCode::FIRMWARE_DOES_NOT_FIT);
    write(&mut client, FIRMWARE, &image, BOOT_PACKET).unwrap();
    assert_eq!(leave_boot(&mut client).0, 0x0002);
}

// covers: 6.4
#[test]
fn only_the_firmware_is_served_in_boot() {
    let mut client = booted();
    let error = request(&mut client, &FoeMessage::Read { password: 0, name: b"log.txt" });
    assert_eq!(failure(&error).0, FoeErrorCode::NOT_BOOTSTRAP);
    client.post(Protocol::Coe, &[0, 0x20, 0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    client.bench.pass(Duration::from_millis(1));
    let (header, payload) = client.bench.fetch_mail().unwrap();
    assert_eq!(header.protocol, Protocol::Error);
    assert_eq!(ErrorReply::decode(payload.first_chunk().unwrap()).detail, ErrorReply::UNSUPPORTED_PROTOCOL);
}
