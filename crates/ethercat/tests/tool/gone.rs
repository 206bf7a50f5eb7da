//! A SubDevice, a cable, a file or the daemon that is gone while a command works.

use std::os::unix::net::UnixListener;
use std::time::Duration;

use ringcat::automatic;
use ringcat::sim::cable::{CableId, DeviceIndex};
use ringcat::sim::fault::Fault;

use crate::bench::{Bench, Driver, directory, tool};
use crate::dot;
use crate::golden_bus::{COE_FOE, segment};
use crate::several::ring;

// covers: daemon
#[test]
fn a_broken_cable_has_no_neighbours_and_parts_of_a_graph_hang_on_links() {
    let bench = Bench::start(vec![ring(4, true)]);
    let edges = |bench: &Bench| dot::parse(&bench.good(&["graph"])).expect("it is a graph").edges;
    assert_eq!(edges(&bench).len(), 4);
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Cut(CableId(2))));
    bench.wait_until("the break", || bench.good(&["slaves"]).contains("xxx LINK FAILURE xxx"));
    let details = bench.good(&["slaves", "-v"]);
    let cut: Vec<&str> = details.lines().filter(|line| line.contains("  down  ")).collect();
    assert!(cut.len() >= 2 && cut.iter().all(|line| line.split_whitespace().nth(5) == Some("-")), "{details}");
    let text = bench.good(&["graph"]);
    assert!(text.contains("    slave1 -- slave2 [label=\"LINK FAILURE\""), "{text}");
    let edges = edges(&bench);
    let wanted = [("master", "slave0"), ("slave1", "slave2"), ("master", "slave3"), ("slave0", "slave1")];
    for (near, far) in wanted.into_iter().chain([("slave2", "slave3")]) {
        assert!(edges.contains(&(near.to_owned(), far.to_owned())), "{near} {far}: {text}");
    }
    assert_eq!(edges.len(), 5, "{text}");
}

// covers: daemon
#[test]
fn dictionaries_are_listed_behind_one_that_does_not_answer() {
    let directory = directory();
    let segment = segment(&directory, COE_FOE);
    let bench = Bench::start_in(directory, vec![segment]);
    let hang = |is_hanging| {
        bench.inside(0, move |segment| {
            let now = segment.network_mut().now();
            segment.network_mut().device_mut(DeviceIndex(1)).hang(is_hanging, now);
        });
    };
    hang(true);
    let listed = bench.tool(&["sdos"]);
    assert_eq!((listed.code, listed.out.matches("=== Master 0, Slave ").count()), (Some(1), 4), "{listed:?}");
    assert!(listed.err.starts_with("Master 0, slave 1: ") && listed.err.lines().count() == 1, "{listed:?}");
    let json = bench.tool(&["sdos", "--json"]);
    assert_eq!((json.code, json.out.lines().count()), (Some(1), 3), "{json:?}");
    hang(false);
}

// covers: daemon
#[test]
fn aliases_and_counters_are_written_behind_a_slave_without_power() {
    let bench = Bench::start(vec![ring(4, true)]);
    let _driver = Driver::start(&bench, |found| automatic(found, Duration::from_millis(1)));
    bench.inside(0, |segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(1))));
    bench.wait_until("it is gone", || bench.good(&["slaves", "-p1"]).contains("???"));
    for words in [&["alias", "-f", "7"][..], &["crc", "reset"]] {
        let failed = bench.bad(words);
        assert!(failed.starts_with("Master 0, slave 1: ") && failed.lines().count() == 1, "{words:?}: {failed}");
    }
    for position in ["-p0", "-p2", "-p3"] {
        assert_eq!(bench.tool(&["sii_read", position]).bytes.get(8..10), Some(&[7, 0][..]), "{position}");
    }
}

// covers: daemon
#[test]
fn surplus_words_are_refused_with_the_help_of_the_command() {
    let nowhere = directory().join("nothing");
    for command in ["slaves", "config", "sii_read", "rescan", "eoe", "version", "watch", "xml"] {
        let done = tool(&nowhere, &[command, "1"]);
        let wanted = format!("'{command}' takes no arguments!\n\nethercat {command} [OPTIONS]\n");
        assert!(done.code == Some(1) && done.out.is_empty() && done.err.starts_with(&wanted), "{done:?}");
    }
}

// covers: daemon
#[test]
fn a_file_that_cannot_be_written_is_not_one_that_cannot_be_opened() {
    let directory = directory();
    let segment = segment(&directory, COE_FOE);
    let bench = Bench::start_in(directory, vec![segment]);
    let full = bench.bad(&["foe_read", "-p1", "fw.bin", "-o", "/dev/full"]);
    assert!(full.starts_with("Failed to write '/dev/full'! ("), "{full}");
    let missing = bench.bad(&["foe_read", "-p1", "fw.bin", "-o", "/nothing/there"]);
    assert!(missing.starts_with("Failed to open '/nothing/there'! ("), "{missing}");
    let unknown = bench.bad(&["reg_read", "-p1", "0xffff", "1"]);
    assert!(!unknown.starts_with("ringcatd"), "{unknown}");
}

// covers: daemon
#[test]
fn a_daemon_that_ends_is_named_with_what_starts_it() {
    let directory = directory();
    let socket = directory.join("socket");
    let listener = UnixListener::bind(&socket).expect("it is free");
    let thread = std::thread::spawn(move || drop(listener.accept().expect("the tool comes")));
    let done = tool(&socket, &["slaves"]);
    thread.join().expect("no panic");
    let wanted = "connection to ringcatd: the other side has closed the connection; the daemon has ended: \
                  'ethercatctl status' shows whether it runs, 'ethercatctl start' starts it\n";
    assert_eq!((done.code, done.err.as_str()), (Some(1), wanted));
    std::fs::remove_dir_all(directory).expect("it is writable");
}
