//! Other users of an interface.

use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;

use ringcat_link::interface::{UseWarning, exclusive_use};
use ringcat_link::{PacketOptions, PacketSocket};

use crate::bench::Bench;

fn warnings(bench: &Bench) -> Vec<UseWarning> {
    bench.near.run(|| exclusive_use("near"))
}

#[test]
fn an_interface_for_ethercat_alone_gives_no_warning_even_with_our_own_sockets() {
    let Some(bench) = Bench::make() else { return };
    let _socket = bench.near_socket(PacketOptions::default());
    assert_eq!(warnings(&bench), []);
}

#[test]
fn addresses_and_a_small_mtu_cause_warnings() {
    let Some(bench) = Bench::make() else { return };
    bench.near.ip(&["address", "add", "192.0.2.7/24", "dev", "near"]);
    let address = UseWarning::Address { interface: "near".to_owned(), address: [192, 0, 2, 7].into() };
    assert_eq!(warnings(&bench), [address]);
    bench.near.ip(&["address", "flush", "dev", "near"]);
    bench.near.ip(&["link", "set", "near", "mtu", "1000"]);
    assert_eq!(warnings(&bench), [UseWarning::SmallMtu { interface: "near".to_owned(), mtu: 1000 }]);
}

#[test]
fn a_bridge_warning_contains_the_name_of_the_bridge() {
    let Some(bench) = Bench::make() else { return };
    bench.near.ip(&["link", "add", "bridge7", "type", "bridge"]);
    bench.near.ip(&["link", "set", "near", "master", "bridge7"]);
    let expected = UseWarning::Member {
        interface: "near".to_owned(),
        controller: "bridge7".to_owned(),
        kind: "bridge".to_owned(),
    };
    assert_eq!(warnings(&bench), [expected]);
}

/// Set for the test below when it runs in another process to hold the socket.
const HOLD: &str = "RINGCAT_LINK_TEST_HOLDS_A_SOCKET";

#[test]
fn a_socket_of_another_process_causes_a_warning_with_the_process() {
    if std::env::var_os(HOLD).is_some() {
        let _socket = PacketSocket::open("near", &PacketOptions::default()).expect("a socket");
        println!("\nready");
        let _ = std::io::stdin().read(&mut [0]);
        return;
    }
    let Some(bench) = Bench::make() else { return };
    let this = "exclusive::a_socket_of_another_process_causes_a_warning_with_the_process";
    let mut other = bench
        .near
        .command(std::env::current_exe().expect("this program"))
        .args(["--exact", this, "--nocapture"])
        .env(HOLD, "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("this program once more");
    let output = other.stdout.take().expect("piped");
    // Kept until the other process has ended: its output needs a reader.
    let mut lines = BufReader::new(output).lines().map_while(Result::ok);
    let ready = lines.any(|line| line == "ready");
    let warnings_found = warnings(&bench);
    drop(other.stdin.take());
    assert!(ready && other.wait().expect("a process of ours").success());
    match &warnings_found[..] {
        [UseWarning::Socket { interface, owner: Some((process, _)) }] => {
            assert_eq!((interface.as_str(), *process), ("near", other.id()));
        }
        unexpected => panic!("{unexpected:?}"),
    }
    assert_eq!(warnings(&bench), []);
}
