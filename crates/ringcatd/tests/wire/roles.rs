//! Processes of this test program: the segment, and applications.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ringcat::daemon::OwnedBus;
use ringcat::sim::cable::HostLink;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::sim::time::SimTime;
use ringcat::{Event, Options, Services, automatic};
use ringcat_control::message::HandedBus;
use ringcat_control::{Client, Content, Limits};
use ringcat_engine::{Class, class_of};
use ringcat_link::{PacketOptions, PacketSocket, PresentInterface, ReceiveMode, Sniffer, monotonic, wait};

use crate::bench::LONG;

/// What a process of this test program is.
pub const ROLE: &str = "RINGCAT_TEST_ROLE";
/// The directory of a test.
pub const PLACE: &str = "RINGCAT_TEST_PLACE";
/// Links of the segment: `0`, or `0,1`.
pub const LINKS: &str = "RINGCAT_TEST_LINKS";
/// Address of a web server, for the process that connects to it.
pub const ADDRESS: &str = "RINGCAT_TEST_ADDRESS";
/// The test that is such a process.
pub const TEST: &str = "roles::a_process_of_another_test_plays_its_role";
/// Times of frames that the segment keeps.
const MOST_TIMES: usize = 100_000;
/// Bytes of memory that an application has in use: the kernel tears them down before its descriptors are closed.
pub const MEMORY: usize = 64 << 20;
/// A web server answers within this time.
const FETCH: Duration = Duration::from_secs(2);
/// Interval of checks for interfaces.
const LOOK: Duration = Duration::from_millis(5);

/// Without the variable that makes it one there is nothing to be done.
// covers: daemon
#[test]
fn a_process_of_another_test_plays_its_role() {
    let (Ok(role), Some(place)) = (std::env::var(ROLE), std::env::var_os(PLACE)) else { return };
    let place = PathBuf::from(place);
    match role.as_str() {
        "fetch" => fetch(),
        role => {
            std::thread::spawn(end_with_the_test);
            match role {
                "segment" => segment(&place),
                "listen" => listen(&place),
                "inject" => inject(),
                "switch" => switch(&place),
                role => application(&place, role),
            }
        }
    }
}

/// The test holds the other end of the input: it is closed when the test has ended, however it has.
fn end_with_the_test() {
    let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
    std::process::exit(1);
}

/// Sends a request to a web server: fails if it does not answer.
fn fetch() {
    let address = std::env::var(ADDRESS).expect("the test says which").parse().expect("it is one");
    let mut stream = TcpStream::connect_timeout(&address, FETCH).expect("it answers");
    stream.set_read_timeout(Some(FETCH)).expect("a socket");
    stream.write_all(b"GET / HTTP/1.0\r\n\r\n").expect("it reads");
    let mut said = String::new();
    stream.read_to_string(&mut said).expect("it answers");
    assert!(said.starts_with("HTTP/1"), "{said}");
}

/// Counts frames on an interface for half a second: sent cyclic ones, received cyclic ones, sent acyclic ones, received
/// acyclic ones. A SubDevice that executes a datagram changes its working counter.
fn listen(place: &Path) {
    let name = std::env::var(ADDRESS).expect("the test says which");
    let mut sniffer = Sniffer::open(&name, true).expect("it can be opened");
    let (mut counts, mut others) = ([[0_u32; 2]; 2], 0_u32);
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(500) {
        wait(&[sniffer.socket()], monotonic::now_ns() + 20_000_000, ReceiveMode::Blocking);
        while sniffer.next(&mut |passed| match (class_of(passed.frame), is_executed(passed.frame)) {
            (Some(class), Some(is_received)) => {
                counts[usize::from(class == Class::Acyclic)][usize::from(is_received)] += 1;
            }
            _ => others += 1,
        }) {}
    }
    let [[sent, received], [sent_acyclic, received_acyclic]] = counts;
    let text = format!("{sent} {received} {sent_acyclic} {received_acyclic} {others}");
    fs::write(place.join("listened"), text).expect("it can be written");
    std::process::exit(0);
}

/// Whether the first datagram of a frame has a working counter.
fn is_executed(frame: &[u8]) -> Option<bool> {
    let length = usize::from(u16::from_le_bytes(frame.get(22..24)?.try_into().ok()?) & 0x7FF);
    Some(frame.get(26 + length..28 + length)? != [0; 2])
}

/// Sends frames into an interface that request INIT of all SubDevices: the kernel may refuse them.
fn inject() {
    let name = std::env::var(ADDRESS).expect("the test says which");
    let mut socket = PacketSocket::open(&name, &PacketOptions::default()).expect("it can be opened");
    let mut frame = [0_u8; 60];
    frame[..6].fill(0xFF);
    frame[6] = 2;
    frame[12..14].copy_from_slice(&[0x88, 0xA4]);
    // One BWR of AL Control, 2 bytes.
    frame[14..16].copy_from_slice(&[14, 0x10]);
    frame[16..28].copy_from_slice(&[8, 0x7F, 0, 0, 0x20, 0x01, 2, 0, 0, 0, 1, 0]);
    for _ in 0..200 {
        socket.send(&frame);
    }
    std::process::exit(0);
}

/// An owner that orders the main link down, and ends without ordering it up.
fn switch(place: &Path) {
    let client = Client::connect(&place.join("socket"), "switch").expect("the daemon listens");
    let connection = client.into_connection();
    connection.send(&Content::Take { master: 0, ethernet: false }.into()).expect("it reads");
    let (taken, _descriptors) = connection.receive_with_descriptors(Limits::OWNER, Some(LONG)).expect("it is handed");
    assert!(matches!(taken.content, Content::Taken(HandedBus { can_switch: true, .. })), "{taken:?}");
    for (at, up) in [false, true, false].into_iter().enumerate() {
        connection.send(&Content::SwitchLink { is_redundant: false, up }.into()).expect("it reads");
        fs::write(place.join("switched"), format!("{at}")).expect("it can be written");
        std::thread::sleep(Duration::from_millis(500));
    }
}

/// The far end of a link, which may come and go.
struct Far {
    name: String,
    link: HostLink,
    /// The socket, and the number of its interface.
    socket: Option<(PacketSocket, u32)>,
}

impl Far {
    /// Without an interface the SubDevice at this end of the segment has no link there.
    fn follow(&mut self, network: &mut Network) {
        let was_there = self.socket.is_some();
        let found = PresentInterface::find(&self.name).ok().flatten();
        let is_same = |index: u32| found.is_some_and(|found| found.index == index);
        self.socket = self.socket.take().filter(|(_, index)| is_same(*index));
        if let Some(found) = found.filter(|_| self.socket.is_none()) {
            let socket = PacketSocket::open(&self.name, &PacketOptions::default()).ok();
            self.socket = socket.map(|socket| (socket, found.index));
        }
        if self.socket.is_some() != was_there {
            network.disconnect(self.link, was_there);
        }
    }
}

/// Times of acyclic frames since the last cyclic one.
#[derive(Default)]
struct Times {
    last_cyclic: u64,
    acyclic: Vec<u64>,
}

impl Times {
    fn take(&mut self, frame: &[u8]) {
        let now = monotonic::now_ns();
        match class_of(frame) {
            Some(Class::Acyclic) if self.acyclic.len() < MOST_TIMES => self.acyclic.push(now),
            Some(Class::Acyclic) => {}
            _ => {
                self.last_cyclic = now;
                self.acyclic.clear();
            }
        }
    }

    fn answer(&self, asked: &UnixDatagram) {
        let mut bytes = [0; 8];
        while let Ok((_, from)) = asked.recv_from(&mut bytes) {
            let after = u64::from_ne_bytes(bytes).max(self.last_cyclic);
            let first = self.acyclic.iter().find(|at| **at > after).copied().unwrap_or(0);
            let to = from.as_pathname().expect("it has a name");
            asked.send_to(&first.to_ne_bytes(), to).expect("it waits");
        }
    }
}

/// The segment: answers frames on its interfaces, and writes the states of its SubDevices whenever they change.
fn segment(place: &Path) {
    let text = fs::read_to_string(place.join("segment.toml")).expect("it is there");
    let described = Segment::from_toml(&text, Path::new(".")).expect("it is right");
    let mut network = Network::from_description(described).expect("it is right");
    let names = std::env::var(LINKS).expect("the test says which");
    let both = [HostLink::Main, HostLink::Redundant];
    let far = names.split(',').zip(both).map(|(link, end)| Far { name: format!("far{link}"), link: end, socket: None });
    let mut far: Vec<Far> = far.collect();
    far.iter().for_each(|far| network.disconnect(far.link, true));
    let begin = monotonic::now_ns();
    let (mut before, mut times, mut look_at) = (String::new(), Times::default(), Instant::now());
    let asked = UnixDatagram::bind(place.join("times")).expect("it can be made");
    asked.set_nonblocking(true).expect("a socket");
    loop {
        if Instant::now() >= look_at {
            look_at = Instant::now() + LOOK;
            far.iter_mut().for_each(|far| far.follow(&mut network));
        }
        let now = monotonic::now_ns();
        network.advance(SimTime(now - begin));
        for Far { link, socket, .. } in &mut far {
            let Some((socket, _)) = socket else { continue };
            while socket.receive(&mut |frame| {
                times.take(frame);
                network.send(*link, frame);
            }) {}
            while let Some(received) = network.receive(*link) {
                socket.send(&received.bytes);
                network.give_back(received.bytes);
            }
        }
        times.answer(&asked);
        let states: String = network.devices().map(|device| format!("{} ", device.al_status().state)).collect();
        if states != before {
            // Renamed, so that a reader never reads a part.
            fs::write(place.join("states.new"), &states).expect("it can be written");
            fs::rename(place.join("states.new"), place.join("states")).expect("it can be renamed");
            before = states;
        }
        let due = network.next_event().map_or(u64::MAX, |at| at.0.saturating_add(begin));
        let sockets: Vec<&PacketSocket> = far.iter().flat_map(|far| &far.socket).map(|(socket, _)| socket).collect();
        wait(&sockets, due.clamp(now, now + 300_000), ReceiveMode::Blocking);
    }
}

/// An application that brings all to OP and cycles: for 300 ms, or until it is killed.
fn application(place: &Path, role: &str) {
    let options = Options::default();
    let memory = std::hint::black_box(vec![1_u8; MEMORY]);
    let mut bus = OwnedBus::take(&place.join("socket"), 0, "application", &options, || ()).expect("it is driven");
    let since = bus.supervisor().events_since(0).expect("it runs");
    let is_resumed = |event: &Event| matches!(event, Event::Resumed { subdevices: 3, in_state: 3, differs: false });
    assert!(since.events.iter().any(|timed| is_resumed(&timed.event)), "{since:?}");
    let found = bus.supervisor().subdevices().expect("it runs");
    let links = bus.take_links().expect("they are unused");
    let declaration = automatic(&found, Duration::from_millis(4));
    let mut application = bus.supervisor().clone().activate(declaration, links).expect("it fits the scan");
    application.wait_until_op(LONG).expect("all reach OP");
    let begin = Instant::now();
    while role == "killed" || begin.elapsed() < Duration::from_millis(300) {
        application.cycle(|_| ());
    }
    drop((application, memory));
    bus.release().expect("the daemon takes it");
}
