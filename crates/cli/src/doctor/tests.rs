//! Machines as directories: a good one, one with each fault, one that cannot be read, one whose files hold anything.

mod files;
mod interface;
mod specimen;

use std::collections::BTreeSet;
use std::fs;

use ringcat_link::interface::Unknown;
use ringcat_link::interface::ethtool::{NoAnswer, Settings};

use super::finding::{Finding, Level, lines};
use super::inspect::{HostFiles, Unseen};
use specimen::{GOOD, Specimen, of};

// covers: bench
#[test]
fn a_good_machine_has_good_findings_only_each_with_why_it_matters() {
    let findings = Specimen::good().checks();
    let others: Vec<&Finding> = findings.iter().filter(|finding| finding.level != Level::Good).collect();
    assert!(others.is_empty(), "{others:#?}");
    let ids: BTreeSet<&str> = findings.iter().map(|finding| finding.id).collect();
    assert_eq!((ids.len(), findings.len()), (29, 29), "{ids:?}");
    assert!(findings.iter().all(|finding| finding.why.len() > 20 && finding.mend.is_empty()));
    assert!(of(&findings, "isolated-processors").what.contains("--cpu 3"));
    assert!(of(&findings, "ethercat-program").what.starts_with("/usr/bin/ethercat is RingCAT's"));
}

// covers: bench
#[test]
fn a_machine_that_cannot_be_read_is_unknown_and_nothing_is_guessed() {
    let mut specimen = Specimen::empty();
    let none = || NoAnswer::Failed(22);
    specimen.settings = Settings {
        driver: Err(none()),
        link: Err(none()),
        coalescing: Err(none()),
        offloads: Err(none()),
        eee: Err(none()),
    };
    specimen.uses.unknown = vec![Unknown::Addresses, Unknown::Membership, Unknown::Sockets];
    specimen.variables.clear();
    let findings = specimen.checks();
    let known: BTreeSet<&str> =
        findings.iter().filter(|finding| finding.level != Level::Unknown).map(|finding| finding.id).collect();
    // Without these directories there is no such header or library; the MTU comes with the interface.
    let expected = ["ecrt-header", "ethercat-library", "mtu"];
    assert_eq!(known, BTreeSet::from(expected), "{findings:#?}");
    assert!(findings.iter().all(|finding| finding.mend.is_empty() && !finding.what.is_empty()));
}

// covers: bench
#[test]
fn files_that_hold_anything_are_unknown_and_never_a_panic() {
    let huge = vec![b'9'; (4 << 20) + 1];
    let binary: Vec<u8> = (0..=255u8).cycle().take(70_000).collect();
    let contents: [&[u8]; 8] = [
        b"",
        &huge,
        &binary,
        b"-1",
        b"99999999999999999999999",
        b"\xff\xfe\0",
        b"0-4294967295",
        b"flags : \nCapEff:\nMax locked memory\n",
    ];
    let strict =
        ["throttling", "processors", "raw-frames", "deferred-interrupts", "memory-locking", "real-time-priority"];
    for content in contents {
        let specimen = Specimen::good();
        GOOD.iter().for_each(|(path, _)| specimen.write(path, content));
        specimen.write("etc/ld.so.cache", content);
        let findings = specimen.checks();
        let short: Vec<u8> = content.iter().copied().take(40).collect();
        for id in strict.into_iter().filter(|_| content != b"-1") {
            assert_eq!(of(&findings, id).level, Level::Unknown, "{id} of {short:?}: {findings:#?}");
        }
        let lines = lines(&findings, true);
        assert!(lines.iter().all(|line| line.chars().count() <= 80 && !line.contains(char::is_control)), "{lines:#?}");
    }
}

// covers: bench
#[test]
fn directories_and_pipes_in_the_place_of_files_are_not_waited_for() {
    let specimen = Specimen::good();
    fs::create_dir_all(specimen.root.join("proc/a-directory")).expect("it is writable");
    let pipe = specimen.root.join("proc/a-pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|status| status.success()));
    for path in ["/proc/a-directory", "/proc/a-pipe"] {
        assert!(
            matches!(specimen.read(path), Err(Unseen::Unreadable(_, reason)) if reason == "it is no file"),
            "{path}"
        );
    }
    assert_eq!(specimen.read("/proc/no-such"), Err(Unseen::Missing("/proc/no-such".to_owned())));
    assert!(specimen.list("/proc/modules").is_err());
}

// covers: bench
#[test]
fn a_word_is_found_wherever_it_is_in_a_file() {
    let specimen = Specimen::empty();
    for before in [0, 65_535, 65_536, 65_533, 200_000] {
        let mut bytes = vec![b'R'; before];
        bytes.extend(b"RingCAT");
        specimen.write("file", &bytes);
        assert_eq!(specimen.holds("/file", b"RingCAT"), Ok(true), "{before}");
        assert_eq!(specimen.holds("/file", b"RingDOG"), Ok(false), "{before}");
    }
}
