//! Frames that a socket receives and frames that it rejects.

use std::time::Duration;

use ringcat_link::interface;
use ringcat_link::monotonic::now_ns;
use ringcat_link::packet_socket::GROUP_ADDRESS;
use ringcat_link::{ClassFilter, LinkError, PacketOptions, PacketSocket, ReceiveMode, wait};

use crate::bench::{Bench, FAR_INDEX, NEAR_INDEX, class, drain, ethercat, take};

#[test]
fn each_class_of_frames_reaches_its_own_socket_and_ip_reaches_none() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let filters = [ClassFilter::All, ClassFilter::Cyclic, ClassFilter::Acyclic];
    let mut near = filters.map(|filter| bench.near_socket(class(filter)));
    let (cyclic, acyclic) = (ethercat(0x05, 1), ethercat(0x85, 2));
    let mut ip = ethercat(0x05, 3);
    ip[12..14].copy_from_slice(&[0x08, 0x00]);
    for frame in [&cyclic, &ip, &acyclic] {
        assert!(far.send(frame));
    }
    assert_eq!(take(&mut near[0], 2), [cyclic.clone(), acyclic.clone()]);
    assert_eq!(take(&mut near[1], 1), [cyclic]);
    assert_eq!(take(&mut near[2], 1), [acyclic]);
    assert_eq!((far.counters().sent, near[0].counters().received), (3, 2));
}

#[test]
fn frames_of_every_length_return_whole_and_in_order_while_the_ring_wraps() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(PacketOptions::default().with_ring_frames(8));
    for round in 0..200u16 {
        let sent: Vec<Vec<u8>> = (0..5)
            .map(|i| {
                let mut frame = ethercat(0, round * 5 + i);
                frame.resize(60 + usize::from(round * 5 + i) * 1454 / 999, i as u8);
                frame
            })
            .collect();
        assert!(sent.iter().all(|frame| far.send(frame)));
        assert_eq!(take(&mut near, sent.len()), sent);
    }
    assert_eq!(near.counters().received, 1000);
}

#[test]
fn frames_for_a_full_ring_are_counted_and_earlier_frames_kept() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(PacketOptions::default().with_ring_frames(4));
    for number in 0..10 {
        assert!(far.send(&ethercat(0, number)));
    }
    let until = now_ns() + 2_000_000_000;
    while near.counters().overrun < 6 && now_ns() < until {}
    let kept: Vec<u8> = drain(&mut near).iter().map(|frame| frame[26]).collect();
    assert_eq!(kept, [0, 1, 2, 3]);
    assert_eq!(near.counters().overrun, 6);
    assert!(far.send(&ethercat(0, 10)));
    assert_eq!(take(&mut near, 1).len(), 1);
    assert_eq!(near.counters().overrun, 6);
}

#[test]
fn frames_sent_by_this_host_arrive_only_at_the_other_end() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let (mut one, mut other) = (bench.near_socket(class(ClassFilter::All)), bench.near_socket(class(ClassFilter::All)));
    assert!(one.send(&ethercat(0, 1)));
    assert_eq!(take(&mut far, 1).len(), 1);
    assert!(drain(&mut one).is_empty() && drain(&mut other).is_empty());
}

#[test]
fn a_frame_beyond_the_mtu_is_refused_and_the_next_one_sent() {
    let Some(bench) = Bench::make() else { return };
    let mut near = bench.near_socket(PacketOptions::default());
    assert!(!near.send(&[0; 1600]));
    assert!(!near.send(&[]));
    assert!(near.send(&ethercat(0, 1)));
    assert_eq!((near.counters().refused, near.counters().sent), (2, 1));
}

#[test]
fn a_tagged_frame_reaches_the_sockets_of_its_class_and_keeps_its_tag_on_request() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let open = |filter, keep_vlan_tags| bench.near_socket(class(filter).with_keep_vlan_tags(keep_vlan_tags));
    let mut cyclic = [false, true].map(|keep| open(ClassFilter::Cyclic, keep));
    let [mut without, mut with] = [false, true].map(|keep| open(ClassFilter::Acyclic, keep));
    let plain = ethercat(0x81, 7);
    // Priority 7 in VLAN 5, and priority alone.
    for tci in [0xe005, 0xe000u16] {
        let mut tagged = plain.clone();
        tagged.splice(12..12, [&[0x81, 0x00], &tci.to_be_bytes()[..]].concat());
        assert!(far.send(&tagged));
        assert_eq!(take(&mut without, 1), std::slice::from_ref(&plain));
        assert_eq!(take(&mut with, 1), [tagged]);
    }
    assert!(far.send(&plain));
    assert_eq!((take(&mut without, 1), take(&mut with, 1)), (vec![plain.clone()], vec![plain]));
    assert!(cyclic.iter_mut().all(|socket| drain(socket).is_empty()));
}

#[test]
fn a_socket_that_keeps_tags_receives_neither_ip_nor_what_this_host_sends() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(PacketOptions::default().with_keep_vlan_tags(true));
    let mut sender = bench.near_socket(PacketOptions::default());
    let mut ip = ethercat(0x05, 3);
    ip[12..14].copy_from_slice(&[0x08, 0x00]);
    assert!(far.send(&ip) && sender.send(&ethercat(0, 1)) && near.send(&ethercat(0, 2)));
    assert_eq!(take(&mut far, 2).len(), 2);
    assert!(far.send(&ethercat(0, 3)));
    assert_eq!(take(&mut near, 1), [ethercat(0, 3)]);
}

#[test]
fn a_socket_accepts_the_group_address_or_all_frames() {
    let Some(bench) = Bench::make() else { return };
    let group: String = GROUP_ADDRESS.iter().map(|byte| format!("{byte:02x}")).collect();
    let groups = || bench.near.run(|| std::fs::read_to_string("/proc/thread-self/net/dev_mcast")).expect("a table");
    let promiscuous = || bench.near.ask_ip(&["-d", "link", "show", "near"]).contains("promiscuity 1");

    let member = bench.near_socket(PacketOptions::default().with_promiscuous(false));
    assert!(groups().contains(&group) && !promiscuous());
    drop(member);
    let all = bench.near_socket(PacketOptions::default().with_promiscuous(true));
    assert!(!groups().contains(&group) && promiscuous());
    drop(all);
    assert!(!groups().contains(&group) && !promiscuous());
}

#[test]
fn a_socket_returns_name_and_address_of_its_interface() {
    let Some(bench) = Bench::make() else { return };
    let socket = bench.near_socket(PacketOptions::default().with_receive(ReceiveMode::BusyPoll));
    let list = bench.near.run(interface::list);
    let near = list.iter().find(|interface| interface.name == "near").expect("in the list");
    assert_eq!((socket.interface(), socket.mac(), socket.mode()), ("near", near.mac, ReceiveMode::BusyPoll));
    assert_eq!((near.index, near.mtu, near.up, near.loopback), (NEAR_INDEX, 1500, true, false));
    assert!(near.mac != [0; 6]);
    let far = bench.far.run(interface::list);
    assert!(far.iter().any(|interface| interface.name == "far" && interface.index == FAR_INDEX));
}

#[test]
fn each_cause_of_a_failed_open_is_a_separate_error() {
    let Some(bench) = Bench::make() else { return };
    let open = |name: &'static str| {
        bench.near.run(move || PacketSocket::open(name, &PacketOptions::default()).map(|_| ())).expect_err("no link")
    };
    match open("nirvana") {
        LinkError::NoInterface { name, present } => {
            assert_eq!(name, "nirvana");
            assert!(present.contains(&"near".to_owned()) && present.contains(&"lo".to_owned()), "{present:?}");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(open("lo"), LinkError::NotEthernet { name: "lo".to_owned() });
    let refused = bench.near.run(|| {
        // SAFETY: no pointers are passed; the bare system call drops root in this thread alone.
        let result = unsafe { libc::syscall(libc::SYS_setresuid, 65534, 65534, 65534) };
        assert_eq!(result, 0);
        PacketSocket::open("near", &PacketOptions::default()).map(|_| ()).expect_err("not permitted")
    });
    assert_eq!(refused, LinkError::Permission { name: "near".to_owned() });
}

#[test]
fn a_socket_works_in_another_thread_than_the_one_that_opened_it() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(PacketOptions::default());
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let until = now_ns() + 2_000_000_000;
            assert!(wait(&[&far], until, ReceiveMode::Hybrid { spin: Duration::from_micros(20) }));
            let frames = drain(&mut far);
            assert!(far.send(&frames[0]));
        });
        assert!(near.send(&ethercat(0, 9)));
        assert!(wait(&[&near], now_ns() + 2_000_000_000, ReceiveMode::Blocking));
    });
    assert_eq!(drain(&mut near), [ethercat(0, 9)]);
}
