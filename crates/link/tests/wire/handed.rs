//! Sockets with their rings that another process goes on with, the place in the ring given or found.

use std::fs;
use std::os::fd::AsFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::time::Duration;

use ringcat_link::descriptors;
use ringcat_link::{ClassFilter, HandedSocket, LinkError, PacketOptions, PacketSocket, ReceiveMode};

use crate::bench::{Bench, class, drain, ethercat, take};

/// Path of the Unix socket, for the process that goes on.
const PATH: &str = "RINGCAT_TEST_HANDED";

fn send(far: &mut PacketSocket, numbers: std::ops::Range<u16>) -> Vec<Vec<u8>> {
    numbers.map(|number| ethercat(0, number)).inspect(|frame| assert!(far.send(frame))).collect()
}

/// Goes on in this process.
fn adopt(bench: &Bench, socket: &PacketSocket, with_place: bool) -> PacketSocket {
    let handed = socket.handed();
    let handed = HandedSocket { next_slot: handed.next_slot.filter(|_| with_place), ..handed };
    let fd = socket.as_fd().try_clone_to_owned().expect("a duplicate");
    bench.near.run(|| PacketSocket::adopt(fd, &handed)).expect("it is a packet socket")
}

/// Takes frames as an owner does whose place may be in doubt.
fn take_searching(socket: &mut PacketSocket, count: usize) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    for _ in 0..200 {
        socket.find_place();
        frames.extend(drain(socket));
        if frames.len() >= count {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    frames
}

// covers: links
#[test]
fn frames_follow_each_other_whatever_was_read_before_and_waits_at_the_handover() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    for with_place in [true, false] {
        let mut near = bench.near_socket(PacketOptions::default().with_ring_frames(8));
        let mut number = 0;
        for read in 0..11 {
            for waiting in 0..8 {
                for one in number..number + read {
                    let sent = send(&mut far, one..one + 1);
                    assert_eq!(take(&mut near, 1), sent);
                }
                number += read;
                let before = send(&mut far, number..number + waiting);
                // They are in the ring when the next owner looks.
                std::thread::sleep(Duration::from_millis(2));
                let mut next = adopt(&bench, &near, with_place);
                drop(near);
                number += waiting;
                let mut frames = take_searching(&mut next, usize::from(waiting));
                let after = send(&mut far, number..number + 3);
                frames.extend(take_searching(&mut next, 3));
                assert_eq!(frames, [before, after].concat(), "{read} read, {waiting} wait, place {with_place}");
                number += 3;
                near = next;
            }
        }
        assert_eq!(near.counters().overrun, 0);
    }
}

// covers: links
#[test]
fn descriptors_that_are_no_ring_of_this_interface_are_refused() {
    let Some(bench) = Bench::make() else { return };
    let near = bench.near_socket(class(ClassFilter::Cyclic));
    let handed = near.handed();
    let adopt = |fd: std::os::fd::OwnedFd, handed: &HandedSocket| bench.near.run(|| PacketSocket::adopt(fd, handed));
    let duplicate = || near.as_fd().try_clone_to_owned().expect("a duplicate");
    let stream = UnixStream::pair().expect("a pair").0;
    let errno = |result: Result<PacketSocket, LinkError>| match result.expect_err("it is refused") {
        LinkError::Os { errno, .. } => errno,
        other => panic!("{other}"),
    };
    assert_eq!(errno(adopt(stream.into(), &handed)), libc::ENOTSOCK);
    assert_eq!(errno(adopt(fs::File::open("/dev/null").expect("it is there").into(), &handed)), libc::ENOTSOCK);
    let longer = HandedSocket { slots: 2 * handed.slots, ..handed.clone() };
    assert_eq!(errno(adopt(duplicate(), &longer)), libc::EINVAL);
    bench.near.ip(&["link", "add", "other", "type", "bridge"]);
    let elsewhere = HandedSocket { interface: "other".to_owned(), ..handed.clone() };
    assert_eq!(errno(adopt(duplicate(), &elsewhere)), libc::ENODEV);
    let none = HandedSocket { interface: "none".to_owned(), ..handed };
    assert!(matches!(adopt(duplicate(), &none), Err(LinkError::NoInterface { .. })));
}

// covers: links
#[test]
fn a_duplicate_of_a_socket_that_was_taken_back_neither_sends_nor_receives() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(PacketOptions::default());
    let mut other = adopt(&bench, &near, true);
    let fd = near.as_fd();
    bench.near.run(move || ringcat_link::revoke(fd)).expect("it is a packet socket");
    let mut fresh = bench.near_socket(PacketOptions::default());
    other.send(&ethercat(0, 1));
    near.send(&ethercat(0, 2));
    assert!(fresh.send(&ethercat(0, 3)));
    assert_eq!(take(&mut far, 1), [ethercat(0, 3)], "nothing was sent before");
    send(&mut far, 4..6);
    assert_eq!(take(&mut fresh, 2).len(), 2);
    assert!(drain(&mut other).is_empty());
    let stream = UnixStream::pair().expect("a pair").0;
    let fd = stream.as_fd();
    assert!(bench.near.run(move || ringcat_link::revoke(fd)).is_err());
}

/// What the other process does: it receives the socket, and reads frames until it is killed. For each it writes a byte.
fn other_process(path: &str) {
    let stream = UnixStream::connect(path).expect("the first process listens");
    let mut bytes = [0; 64];
    let (_, mut all) = descriptors::receive(&stream, &mut bytes).expect("it is sent");
    let slots = u32::from(bytes[0]);
    let handed = HandedSocket {
        interface: "near".to_owned(),
        absent_mac: None,
        slots,
        next_slot: Some(0),
        receive: ReceiveMode::Blocking,
    };
    let mut socket = PacketSocket::adopt(all.remove(0), &handed).expect("it is a packet socket");
    loop {
        for _ in take(&mut socket, 1) {
            descriptors::send(&stream, b".", &[]).expect("the first process reads");
        }
    }
}

/// Starts this test once more as the other process.
fn start(bench: &Bench, path: &PathBuf) -> Child {
    let this = "handed::a_killed_owner_leaves_a_ring_that_the_next_one_reads_on";
    let mut command = bench.near.command(std::env::current_exe().expect("this program"));
    command.args(["--exact", this, "--nocapture"]).env(PATH, path).stdout(Stdio::null());
    command.spawn().expect("this program once more")
}

// covers: links
#[test]
fn a_killed_owner_leaves_a_ring_that_the_next_one_reads_on() {
    if let Ok(path) = std::env::var(PATH) {
        return other_process(&path);
    }
    let Some(bench) = Bench::make() else { return };
    for round in 0..4_u16 {
        let path = std::env::temp_dir().join(format!("ringcat-handed-{}-{round}", std::process::id()));
        let listener = UnixListener::bind(&path).expect("a path of our own");
        let mut far = bench.far_socket();
        let near = bench.near_socket(PacketOptions::default().with_ring_frames(8));
        let mut owner = start(&bench, &path);
        let (stream, _) = listener.accept().expect("it connects");
        let slots = near.handed().slots as u8;
        descriptors::send(&stream, &[slots], &[near.fd()]).expect("it is taken");
        let read = 5 + 3 * round;
        for number in 0..read {
            send(&mut far, number..number + 1);
            let (count, _) = descriptors::receive(&stream, &mut [0; 1]).expect("it reads");
            assert_eq!(count, 1, "the owner reads each frame");
        }
        owner.kill().expect("it is writable");
        owner.wait().expect("it is writable");
        let before = send(&mut far, read..read + round);
        std::thread::sleep(Duration::from_millis(5));
        // What it had not reported it has not read; where it was is found.
        let mut next = adopt(&bench, &near, false);
        let mut frames = take_searching(&mut next, usize::from(round));
        let after = send(&mut far, read + round..read + round + 3);
        frames.extend(take_searching(&mut next, 3));
        assert_eq!(frames, [before, after].concat(), "round {round}");
        fs::remove_file(&path).expect("it is writable");
    }
}
