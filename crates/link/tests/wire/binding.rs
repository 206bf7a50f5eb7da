//! Interfaces given to sockets and taken away from them, and what that costs.

use std::os::fd::AsFd;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

use ringcat_link::packet_socket::binding::{give, given};
use ringcat_link::packet_socket::prepared::Prepared;
use ringcat_link::{ClassFilter, HandedSocket, PacketOptions, PacketSocket, PresentInterface, ReceiveMode, revoke};

use crate::bench::{Bench, class, drain, ethercat, take};

/// Slots of a ring, as the daemon makes them.
const SLOTS: u32 = 128;
/// Measurements of each.
const ROUNDS: usize = 50;

fn prepared() -> OwnedFd {
    let options = class(ClassFilter::Cyclic).with_ring_frames(SLOTS);
    Prepared::new(&options).expect("root may").into_descriptor()
}

fn find(name: &str) -> PresentInterface {
    PresentInterface::find(name).expect("it is Ethernet").expect("it is there")
}

fn shown(what: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    println!("{what}: median {:?}, longest {:?} of {}", times[times.len() / 2], times[times.len() - 1], times.len());
}

/// The descriptors are those that another process has, too: a take-back binds them away.
// covers: links
#[test]
fn the_cost_of_taking_an_interface_away_and_of_giving_one_is_shown() {
    let Some(bench) = Bench::make() else { return };
    bench.near.run(|| {
        let near = find("near");
        let (mut made, mut gave, mut took) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let begin = Instant::now();
            let socket = prepared();
            made.push(begin.elapsed());
            assert_eq!(given(socket.as_fd()), Ok(None));
            let begin = Instant::now();
            give(socket.as_fd(), "near", near).expect("it is there");
            gave.push(begin.elapsed());
            assert_eq!(given(socket.as_fd()), Ok(Some(near.index)));
            let begin = Instant::now();
            revoke(socket.as_fd()).expect("it is a packet socket");
            took.push(begin.elapsed());
            assert_ne!(given(socket.as_fd()), Ok(Some(near.index)));
        }
        shown("a socket with a ring of 128 slots is made", made);
        shown("an interface is given to it", gave);
        shown("the interface is taken away (bind to the loopback interface)", took);
    });
}

// covers: links
#[test]
fn a_socket_whose_interface_was_removed_works_on_with_the_one_that_comes_back() {
    let Some(bench) = Bench::make() else { return };
    let socket = bench.near.run(prepared);
    let duplicate = socket.try_clone().expect("a descriptor");
    // Another process goes on with it before the interface is there.
    let absent_mac = Some([2, 0, 0, 0, 0, 9]);
    let handed = HandedSocket {
        interface: "later".to_owned(),
        absent_mac,
        slots: SLOTS,
        next_slot: None,
        receive: ReceiveMode::Blocking,
    };
    let mut owner = bench.near.run(move || PacketSocket::adopt(duplicate, &handed)).expect("it needs no interface");
    assert_eq!(Some(owner.mac()), absent_mac);
    assert!(!owner.send(&ethercat(0, 1)) && owner.counters().down == 1, "it leads nowhere");
    for round in 0..3 {
        bench.near.ip(&["link", "add", "later", "type", "veth", "peer", "name", "other", "netns", &bench.far.name]);
        bench.near.ip(&["link", "set", "later", "up"]);
        bench.far.ip(&["link", "set", "other", "up"]);
        let options = PacketOptions::default();
        let mut far = bench.far.run(|| PacketSocket::open("other", &options)).expect("it is there");
        let fd = socket.as_fd();
        bench.near.run(move || give(fd, "later", find("later"))).expect("it is there");
        let frame = ethercat(0, 10 + round);
        assert!(owner.send(&frame), "round {round}: {:?}, {:?}", owner.counters(), given(socket.as_fd()));
        assert_eq!(take(&mut far, 1), std::slice::from_ref(&frame));
        assert!(far.send(&frame));
        // The place in the ring stays where it was.
        owner.find_place();
        assert_eq!(take(&mut owner, 1), [frame]);
        bench.near.ip(&["link", "del", "later"]);
        assert_eq!(given(socket.as_fd()), Ok(None), "it was removed");
        assert!(!owner.send(&ethercat(0, 2)) && drain(&mut owner).is_empty());
    }
}
