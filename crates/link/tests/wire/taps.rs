//! TAP interfaces: names, addresses, carrier, frames both ways.

use std::process::Command;
use std::time::Duration;

use ringcat_link::interface;
use ringcat_link::tap::{TapError, TapInterface};

use crate::bench::Bench;

const MAC: [u8; 6] = [2, 0xEC, 1, 2, 3, 4];

// covers: eoe-interfaces
#[test]
fn a_tap_interface_has_its_name_address_and_carrier_and_passes_frames_both_ways() {
    let Some(bench) = Bench::make() else { return };
    if std::fs::OpenOptions::new().read(true).write(true).open("/dev/net/tun").is_err() {
        println!("skipped: /dev/net/tun cannot be opened");
        return;
    }
    bench.near.run(|| {
        let tap = TapInterface::create("eoe0s7", MAC).expect("root may create it");
        assert_eq!(
            TapInterface::create("eoe0s7", MAC).err(),
            Some(TapError::Taken { name: "eoe0s7".to_owned() }),
            "one owner"
        );
        let found = || interface::list().into_iter().find(|found| found.name == "eoe0s7");
        let is = found().expect("the interface exists");
        assert_eq!((is.mac, is.mtu, is.up, is.carrier), (MAC, 1500, false, false));
        let output = Command::new("ip").args(["-n", &bench.near.name, "-o", "link", "show", "eoe0s7"]).output();
        let output = String::from_utf8(output.expect("ip starts").stdout).expect("text");
        assert!(output.contains("qlen 64"), "{output}");
        bench.near.ip(&["link", "set", "eoe0s7", "up"]);
        assert_eq!(found().map(|found| (found.up, found.carrier)), Some((true, false)));
        assert!(tap.set_carrier(true));
        assert_eq!(found().map(|found| found.carrier), Some(true));
        bench.near.ip(&["addr", "add", "192.0.2.1/24", "dev", "eoe0s7"]);
        // A datagram to an unused address: the host sends an ARP request.
        let socket = std::net::UdpSocket::bind("192.0.2.1:0").expect("the address exists");
        socket.send_to(b"x", "192.0.2.9:9").expect("it is queued");
        let mut room = [0; 2048];
        let until = std::time::Instant::now() + Duration::from_secs(2);
        let question = loop {
            if let Some(length) = tap.receive(&mut room).filter(|_| room[12..14] == [0x08, 0x06]) {
                break room[..length].to_vec();
            }
            assert!(std::time::Instant::now() < until, "the host sends no ARP request");
            std::thread::sleep(Duration::from_millis(1));
        };
        assert_eq!((&question[..6], &question[6..12], question[21]), (&[0xFF; 6][..], &MAC[..], 1));
        // The test answers it, and the datagram follows.
        let peer = [2, 0, 0, 0, 0, 9];
        let mut answer = question.clone();
        answer[..6].copy_from_slice(&MAC);
        answer[6..12].copy_from_slice(&peer);
        answer[21] = 2;
        answer[22..28].copy_from_slice(&peer);
        answer[28..32].copy_from_slice(&question[38..42]);
        answer[32..42].copy_from_slice(&question[22..32]);
        assert!(tap.send(&answer));
        let datagram = loop {
            if let Some(length) = tap.receive(&mut room).filter(|_| room[12..14] == [0x08, 0x00]) {
                break room[..length].to_vec();
            }
            assert!(std::time::Instant::now() < until, "the answer did not arrive");
            std::thread::sleep(Duration::from_millis(1));
        };
        assert_eq!((&datagram[..6], datagram.last()), (&peer[..], Some(&b'x')));
        drop(tap);
        assert_eq!(found(), None, "the interface disappears with its owner");
    });
}
