//! The mailbox of a device in a segment: responses become ready without a frame, scheduled mailbox faults.

use core::time::Duration;

use ringcat_sim::application::mailbox::faults::MailFault;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::cable::HostLink::{Main, Redundant};
use ringcat_sim::catalogue;
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::Frame;
use ringcat_wire::mailbox::coe::{CoeService, Emergency};
use ringcat_wire::mailbox::sdo::{SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{Header, Message, Protocol};
use ringcat_wire::register::map;

use crate::wiring::{SETTLE, command};

const SERVO: DeviceIndex = DeviceIndex(0);
const MAILBOX: usize = 128;
const MILLISECOND: Duration = Duration::from_millis(1);

fn exchange(network: &mut Network, code: Command, address: RegisterAddress, data: &[u8]) -> (u16, Vec<u8>) {
    let target = Target::Position(Position(SERVO.0 as u16), address);
    network.send(Main, &command(code, target, data));
    network.advance_by(MILLISECOND);
    let received = network.receive(Redundant).expect("a frame returned");
    let frame = Frame::parse(&received.bytes).unwrap();
    let datagram = frame.datagrams().next().unwrap();
    (datagram.wkc.0, datagram.data.to_vec())
}

/// A servo in PREOP.
fn ready() -> Network {
    let devices = vec![Device::new(catalogue::by_name("servo").unwrap())];
    let mut network = SegmentBuilder::ring(devices).build().unwrap();
    network.advance_by(SETTLE);
    for (number, bytes) in [(0, [0x00, 0x10, 128, 0, 0x26, 0, 1, 0]), (1, [0x80, 0x10, 128, 0, 0x22, 0, 1, 0])] {
        assert_eq!(exchange(&mut network, Command::Apwr, map::sync_manager(number), &bytes).0, 1);
    }
    exchange(&mut network, Command::Apwr, map::AL_CONTROL, &[0x02, 0]);
    network.advance_by(SETTLE);
    assert_eq!(network.device(SERVO).al_status().bits(), 0x02);
    network
}

/// Writes a request to the mailbox; returns the working counter.
fn request(network: &mut Network, counter: u8) -> u16 {
    let mut mail = [0; MAILBOX];
    let request = SdoRequest::Upload { index: 0x1018, sub_index: 0, complete_access: false };
    let length = request.encode(&mut mail[Header::LEN..]).unwrap();
    mail[..Header::LEN].copy_from_slice(&Header::new(Protocol::Coe, counter, length as u16).encode());
    exchange(network, Command::Apwr, RegisterAddress(0x1000), &mail).0
}

/// Reads the mailbox.
fn fetch(network: &mut Network) -> Option<Vec<u8>> {
    let (wkc, mail) = exchange(network, Command::Aprd, RegisterAddress(0x1080), &[0; MAILBOX]);
    (wkc == 1).then(|| Message::decode(&mail).unwrap().payload.to_vec())
}

fn answers(mail: Option<Vec<u8>>) -> bool {
    mail.is_some_and(|mail| matches!(SdoResponse::decode(&mail), Ok(SdoResponse::UploadExpedited { data: [4], .. })))
}

// covers: 6.1, sim-mailbox
#[test]
fn mail_faults_occur_at_their_time_in_a_segment() {
    let mut network = ready();
    assert_eq!(request(&mut network, 1), 1);
    assert!(answers(fetch(&mut network)));
    let at = network.now() + 5 * MILLISECOND;
    network.schedule(at, Fault::Mail(SERVO, MailFault::Full { during: 20 * MILLISECOND }));
    assert_eq!(request(&mut network, 2), 1);
    assert!(answers(fetch(&mut network)), "not yet");
    network.advance_by(5 * MILLISECOND);
    assert_eq!(
        [request(&mut network, 3), request(&mut network, 4)],
        [1, 0],
        "the mailbox accepts one message and stays full"
    );
    assert!(!answers(fetch(&mut network)));
    network.advance_by(20 * MILLISECOND);
    assert!(answers(fetch(&mut network)));
    network.apply(Fault::Mail(SERVO, MailFault::LoseAnswers { count: 1 }));
    assert_eq!(request(&mut network, 5), 1);
    assert!(fetch(&mut network).is_none());
}

// covers: 6.3, sim-mailbox
#[test]
fn an_emergency_needs_no_frame_to_wait_in_the_mailbox() {
    let mut network = ready();
    let emergency = Emergency { error_code: 0x7500, error_register: 1, data: [0; 5] };
    assert!(network.device_mut(SERVO).application.emergency(&emergency));
    let mail = fetch(&mut network).expect("an emergency");
    assert_eq!(mail[1] >> 4, CoeService::Emergency.code());
    assert_eq!(mail[2..4], [0x00, 0x75]);
}
