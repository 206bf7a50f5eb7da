//! Protocol 6.5 from the view of a MainDevice: frames in fragments, an IP stack, addresses, filter, time stamps.

use core::net::Ipv4Addr;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::eoe::{AddressFilter, EoeBody, EoeFragment, EoeMessage, EoeResult, IpParameters};
use smoltcp::iface::{Config, Interface, SocketSet};
use smoltcp::socket::tcp;
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, HardwareAddress, IpAddress, IpCidr};

use super::client::{ANSWER, Client};
use crate::application::eoe::frames::Frames;
use crate::application::eoe::reassembly::Reassembly;
use crate::catalogue;
use crate::description::{DeviceDescription, EoeEnd};

const DEVICE: Ipv4Addr = Ipv4Addr::new(10, 7, 0, 2);
const HOST: Ipv4Addr = Ipv4Addr::new(10, 7, 0, 1);
const HOST_MAC: [u8; 6] = [2, 0, 0, 0, 0, 9];
/// Data of a fragment in a mailbox of 1,024 bytes.
const FRAGMENT: usize = 992;

fn terminal() -> DeviceDescription {
    catalogue::by_name("ethernet-terminal").unwrap()
}

fn with_end(end: EoeEnd) -> Client {
    let mut description = terminal();
    description.services.eoe.end = end;
    Client::of(description, AlState::PreOp)
}

fn post(client: &mut Client, body: EoeBody<'_>) {
    let mut payload = [0; 1018];
    let length = EoeMessage { port: 0, body }.encode(&mut payload).unwrap();
    client.post(Protocol::Eoe, &payload[..length]);
}

fn send_frame(client: &mut Client, number: u8, frame: &[u8]) {
    let pieces = frame.chunks(FRAGMENT);
    let count = pieces.len();
    for (place, data) in pieces.enumerate() {
        let blocks = if place == 0 { frame.len().div_ceil(32) } else { place * FRAGMENT / 32 } as u8;
        let last = place + 1 == count;
        let (frame, number) = (number & 0x0F, place as u8);
        post(
            client,
            EoeBody::Fragment(EoeFragment { frame, number, blocks, last, time_requested: false, time_ns: None, data }),
        );
        client.bench.pass(Duration::from_micros(50));
    }
}

/// Frames waiting in the mailbox.
fn fetch_frames(client: &mut Client, reassembly: &mut Reassembly) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    while let Some((header, payload)) = client.bench.fetch_mail() {
        assert_eq!(header.protocol, Protocol::Eoe);
        let EoeBody::Fragment(fragment) = EoeMessage::decode(&payload).unwrap().body else {
            panic!("{payload:?}");
        };
        frames.extend(reassembly.take(&fragment));
        client.bench.pass(Duration::from_micros(50));
    }
    frames
}

fn answer(client: &mut Client) -> Vec<u8> {
    client.answer().1
}

/// A second IP stack on the MainDevice side.
struct Host {
    interface: Interface,
    sockets: SocketSet<'static>,
    frames: Frames,
    reassembly: Reassembly,
    number: u8,
}

impl Host {
    fn new() -> Host {
        let mut frames = Frames::new(16);
        let config = Config::new(HardwareAddress::Ethernet(EthernetAddress(HOST_MAC)));
        let mut interface = Interface::new(config, &mut frames, Instant::ZERO);
        interface.update_ip_addrs(|known| known.push(IpCidr::new(HOST.into(), 24)).unwrap());
        let sockets = SocketSet::new(Vec::new());
        Host { interface, sockets, frames, reassembly: Reassembly::default(), number: 0 }
    }

    /// Moves frames in both directions, then advances half a millisecond.
    fn step(&mut self, client: &mut Client) {
        let now = Instant::from_micros((client.bench.now.0 / 1000) as i64);
        self.interface.poll(now, &mut self.frames, &mut self.sockets);
        while let Some(frame) = self.frames.sent.pop_front() {
            self.number += 1;
            send_frame(client, self.number, &frame);
        }
        client.bench.pass(Duration::from_micros(500));
        self.frames.received.extend(fetch_frames(client, &mut self.reassembly));
    }
}

fn addressed() -> Client {
    let mut client = with_end(EoeEnd::Stack);
    let mask = Some(Ipv4Addr::new(255, 255, 255, 0));
    let parameters = IpParameters { address: Some(DEVICE), mask, ..IpParameters::default() };
    post(&mut client, EoeBody::SetIp(parameters));
    let bytes = answer(&mut client);
    assert_eq!(EoeMessage::decode(&bytes).unwrap().body, EoeBody::SetIpDone(EoeResult::OK));
    client
}

fn arp_request() -> Vec<u8> {
    let mut frame = vec![0xFF; 6];
    frame.extend(HOST_MAC);
    frame.extend([0x08, 0x06, 0, 1, 0x08, 0, 6, 4, 0, 1]);
    frame.extend(HOST_MAC);
    frame.extend(HOST.octets());
    frame.extend([0; 6]);
    frame.extend(DEVICE.octets());
    frame
}

/// Checksum of 16-bit words of IP and ICMP.
fn checksum(bytes: &[u8]) -> [u8; 2] {
    let words = bytes.chunks(2).map(|pair| u32::from(pair[0]) << 8 | u32::from(pair.get(1).copied().unwrap_or(0)));
    let sum: u32 = words.sum();
    let sum = (sum & 0xFFFF) + (sum >> 16);
    (!((sum & 0xFFFF) + (sum >> 16)) as u16).to_be_bytes()
}

fn ping(mac: &[u8], data: &[u8]) -> Vec<u8> {
    let mut icmp = vec![8, 0, 0, 0, 0x12, 0x34, 0, 1];
    icmp.extend(data);
    let sum = checksum(&icmp);
    icmp[2..4].copy_from_slice(&sum);
    let length = ((20 + icmp.len()) as u16).to_be_bytes();
    let mut ip = vec![0x45, 0, length[0], length[1], 0, 0, 0, 0, 64, 1, 0, 0];
    ip.extend(HOST.octets());
    ip.extend(DEVICE.octets());
    let sum = checksum(&ip);
    ip[10..12].copy_from_slice(&sum);
    let mut frame = mac.to_vec();
    frame.extend(HOST_MAC);
    frame.extend([0x08, 0x00]);
    frame.extend(ip);
    frame.extend(icmp);
    frame
}

// covers: 6.5, sim-mailbox
#[test]
fn the_stack_answers_arp_and_ping_of_any_size() {
    let mut client = addressed();
    let mut reassembly = Reassembly::default();
    send_frame(&mut client, 1, &arp_request());
    client.bench.pass(ANSWER);
    let frames = fetch_frames(&mut client, &mut reassembly);
    let mac = client.bench.device.description.services.eoe.mac;
    assert_eq!(frames.len(), 1);
    assert_eq!((&frames[0][..6], &frames[0][6..12], &frames[0][20..22]), (&HOST_MAC[..], &mac[..], &[0, 2][..]));
    // One fragment, exactly full ones, several.
    for size in [0, 32, FRAGMENT - 42, FRAGMENT - 41, 1472] {
        let data: Vec<u8> = (0..size).map(|place| place as u8).collect();
        send_frame(&mut client, 2, &ping(&mac, &data));
        client.bench.pass(ANSWER);
        let frames = fetch_frames(&mut client, &mut reassembly);
        assert_eq!(frames.len(), 1, "{size}");
        assert_eq!((frames[0][34], &frames[0][42..]), (0, &data[..]), "{size}");
    }
}

#[test]
fn the_stack_is_silent_without_an_address() {
    let mut client = with_end(EoeEnd::Stack);
    send_frame(&mut client, 1, &arp_request());
    client.bench.pass(ANSWER);
    assert!(client.bench.fetch_mail().is_none());
}

// covers: 6.5, sim-mailbox
#[test]
fn a_file_is_downloaded_over_tcp() {
    const BYTES: usize = 200_000;
    let mut client = addressed();
    let mut host = Host::new();
    let buffer = || tcp::SocketBuffer::new(vec![0; 16 * 1024]);
    let handle = host.sockets.add(tcp::Socket::new(buffer(), buffer()));
    let socket = host.sockets.get_mut::<tcp::Socket<'_>>(handle);
    socket.connect(host.interface.context(), (IpAddress::from(DEVICE), 80), 49_152).unwrap();
    let mut received = Vec::new();
    let mut asked = false;
    for step in 0.. {
        assert!(step < 20_000, "{} bytes so far", received.len());
        host.step(&mut client);
        let socket = host.sockets.get_mut::<tcp::Socket<'_>>(handle);
        if !asked && socket.may_send() {
            socket.send_slice(format!("GET /bytes/{BYTES} HTTP/1.0\r\n\r\n").as_bytes()).unwrap();
            asked = true;
        }
        let mut piece = [0; 4096];
        while let Ok(length @ 1..) = socket.recv_slice(&mut piece) {
            received.extend_from_slice(&piece[..length]);
        }
        if asked && !socket.may_recv() {
            break;
        }
    }
    let text = String::from_utf8(received).unwrap();
    let (head, body) = text.split_once("\r\n\r\n").unwrap();
    assert!(head.contains("200 OK") && head.contains(&format!("Content-Length: {BYTES}")), "{head}");
    assert!(body.len() == BYTES && body.bytes().enumerate().all(|(at, byte)| usize::from(byte) == 33 + at % 89));
}

// covers: 6.5, sim-mailbox
#[test]
fn a_loop_sends_frames_back_in_its_own_fragments() {
    let mut client = with_end(EoeEnd::Loop);
    let mut reassembly = Reassembly::default();
    for (number, size) in [(1, 60), (2, FRAGMENT), (3, FRAGMENT + 1), (4, 1514)] {
        let frame: Vec<u8> = (0..size).map(|place| (place * 3) as u8).collect();
        send_frame(&mut client, number, &frame);
        client.bench.pass(ANSWER);
        assert_eq!(fetch_frames(&mut client, &mut reassembly), [frame], "{size}");
    }
}

// covers: 6.5, sim-mailbox
#[test]
fn addresses_are_set_and_read() {
    let mut client = addressed();
    post(&mut client, EoeBody::GetIp);
    let bytes = answer(&mut client);
    let EoeBody::Ip(EoeResult::OK, reports) = EoeMessage::decode(&bytes).unwrap().body else {
        panic!("{bytes:?}");
    };
    assert_eq!((reports.address, reports.mask), (Some(DEVICE), Some(Ipv4Addr::new(255, 255, 255, 0))));
    assert_eq!(reports.mac, Some(client.bench.device.description.services.eoe.mac));
    let mut result = |parameters| {
        post(&mut client, EoeBody::SetIp(parameters));
        let bytes = answer(&mut client);
        match EoeMessage::decode(&bytes).unwrap().body {
            EoeBody::SetIpDone(result) => result,
            other => panic!("{other:?}"),
        }
    };
    let none = IpParameters::default();
    assert_eq!(result(IpParameters { mac: Some([1, 0, 0, 0, 0, 1]), ..none }), EoeResult::UNSPECIFIED);
    assert_eq!(result(IpParameters { mac: Some([0; 6]), ..none }), EoeResult::UNSPECIFIED);
    let multicast = Some(Ipv4Addr::new(224, 0, 0, 1));
    assert_eq!(result(IpParameters { address: multicast, ..none }), EoeResult::UNSPECIFIED);
    assert_eq!(result(IpParameters { mask: Some(Ipv4Addr::new(255, 0, 255, 0)), ..none }), EoeResult::UNSPECIFIED);
    assert_eq!(result(IpParameters { name: Some(b"axis"), gateway: Some(HOST), ..none }), EoeResult::OK);
    let addresses = client.bench.device.application.servers().eoe().unwrap().addresses().clone();
    assert_eq!((addresses.address, addresses.gateway, addresses.name), (DEVICE, HOST, b"axis".to_vec()));
}

// covers: 6.5
#[test]
fn unsupported_eoe_requests_are_refused_with_their_result() {
    let mut description = terminal();
    description.services.eoe.ip_support = false;
    description.services.eoe.filter_support = false;
    let mut client = Client::of(description, AlState::PreOp);
    let filter = AddressFilter::new(&[[2; 6]], &[], true).unwrap();
    let none = IpParameters::default();
    for (request, result) in [
        (EoeBody::SetIp(none), EoeBody::SetIpDone(EoeResult::NO_IP_SUPPORT)),
        (EoeBody::GetIp, EoeBody::Ip(EoeResult::NO_IP_SUPPORT, none)),
        (EoeBody::SetFilter(filter), EoeBody::SetFilterDone(EoeResult::NO_FILTER_SUPPORT)),
        (EoeBody::GetFilter, EoeBody::Filter(EoeResult::NO_FILTER_SUPPORT, AddressFilter::default())),
    ] {
        post(&mut client, request);
        let bytes = answer(&mut client);
        assert_eq!(EoeMessage::decode(&bytes).unwrap().body, result);
    }
}

// covers: 6.5
#[test]
fn a_filter_is_set_and_read() {
    let mut client = with_end(EoeEnd::Nothing);
    let filter = AddressFilter::new(&[[2; 6], [4; 6]], &[[0xF0; 6]], true).unwrap();
    post(&mut client, EoeBody::SetFilter(filter));
    let bytes = answer(&mut client);
    assert_eq!(EoeMessage::decode(&bytes).unwrap().body, EoeBody::SetFilterDone(EoeResult::OK));
    post(&mut client, EoeBody::GetFilter);
    let bytes = answer(&mut client);
    assert_eq!(EoeMessage::decode(&bytes).unwrap().body, EoeBody::Filter(EoeResult::OK, filter));
}

// covers: 6.5
#[test]
fn a_time_stamp_is_sent_on_request() {
    let mut client = with_end(EoeEnd::Nothing);
    let fragment =
        EoeFragment { frame: 9, number: 0, blocks: 2, last: true, time_requested: true, time_ns: None, data: &[1; 60] };
    let before = client.bench.now.0 as u32;
    post(&mut client, EoeBody::Fragment(fragment));
    let bytes = answer(&mut client);
    let EoeBody::TimeStamp { frame: 9, time_ns } = EoeMessage::decode(&bytes).unwrap().body else {
        panic!("{bytes:?}");
    };
    assert!((before..=client.bench.now.0 as u32).contains(&time_ns));
}

// covers: sim-mailbox
#[test]
fn frames_that_are_not_read_stop_only_the_stack() {
    let mut client = addressed();
    let mac = client.bench.device.description.services.eoe.mac;
    send_frame(&mut client, 1, &arp_request());
    for number in 0..200u8 {
        send_frame(&mut client, number, &ping(&mac, &[number; 1400]));
    }
    client.bench.pass(Duration::from_secs(2));
    let mut reassembly = Reassembly::default();
    let mut frames = 0;
    loop {
        let fetched = fetch_frames(&mut client, &mut reassembly).len();
        if fetched == 0 {
            break;
        }
        frames += fetched;
        client.bench.pass(ANSWER);
    }
    assert!((2..100).contains(&frames), "{frames}");
    assert_eq!(client.upload(0x1000, 0).map(|value| value.len()), Ok(4));
}
