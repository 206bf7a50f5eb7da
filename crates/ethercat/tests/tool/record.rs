//! `ethercat record`: the last frames in a file, without a fault.

use std::path::Path;
use std::time::Duration;

use ringcat::automatic;
use ringcat::daemon::BusSettings;

use crate::bench::{Bench, Driver, directory};
use crate::several::ring;

const CYCLE: Duration = Duration::from_millis(1);

// covers: daemon, capture
#[test]
fn the_last_frames_are_written_where_the_printed_path_says() {
    let directory = directory();
    let mut settings = BusSettings::default();
    (settings.debug_ring.is_on, settings.debug_ring.directory) = (true, directory.clone());
    let bench = Bench::start_set(directory.clone(), vec![ring(3, true), ring(1, false)], &settings);
    let path = bench.good(&["record", "-m0"]);
    let path = Path::new(path.strip_suffix('\n').expect("a line"));
    assert_eq!(path.parent(), Some(&*directory));
    let name = path.file_name().and_then(|name| name.to_str()).expect("text");
    assert!(name.starts_with("ringcat-0-") && name.ends_with("-requested.pcapng"), "{name}");
    // A scan has more frames than this; each has 60 bytes or more.
    assert!(std::fs::metadata(path).expect("it is there").len() > 6_000);
    // At once, without the pause between files of faults, and each master its own.
    let lines = bench.json(&["record"]);
    let masters: Vec<Option<u64>> = lines.iter().map(|line| line["master"].as_u64()).collect();
    assert_eq!(masters, [Some(0), Some(1)]);
    for line in &lines {
        assert!(line["path"].as_str().is_some_and(|path| Path::new(path).is_file()), "{line}");
        assert!(line["frames"].as_u64().is_some_and(|frames| frames > 10) && line["lost"] == 0, "{line}");
    }
    let before = std::fs::read_dir(&directory).expect("it is there").count();
    // This application is one in Rust, which records with a FrameRecord only.
    let driver = Driver::start(&bench, |found| automatic(found, CYCLE));
    let refused = bench.bad(&["record", "-m0"]);
    assert!(refused.contains("the program that drives the bus keeps no frames"), "{refused}");
    driver.end();
    assert_eq!(std::fs::read_dir(&directory).expect("it is there").count(), before);
}

// covers: daemon, capture
#[test]
fn without_a_record_the_setting_is_named_that_switches_it_on() {
    let bench = Bench::start(vec![ring(1, false)]);
    let refused = bench.bad(&["record"]);
    assert!(refused.contains("RINGCAT_DEBUG_RING=\"yes\" in /etc/ethercat.conf switches the record on"), "{refused}");
}
