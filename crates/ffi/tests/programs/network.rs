//! Network files in C: `ringcat.h`.

use std::path::PathBuf;
use std::time::Duration;

use ringcat::config::ExportOptions;
use ringcat::network::{NetworkFile, ScanOptions};
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options};

use crate::library::{here, on_segment, outputs, program, root, workshop};

const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\n[[device]]\n\
                       type = \"servo\"\n";

/// A segment, the network file that a scan of it makes, with a following error window as a start-up command, and the
/// same with a fault in its line 2.
fn files(name: &str) -> [PathBuf; 3] {
    let links = SimulatedSegment::from_toml(SEGMENT).expect("the segment is valid");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("it is scanned");
    let options = ScanOptions::new("machine", Duration::from_millis(1));
    let text = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &options).to_text();
    let text = text + "\n[[subdevice.startup]]\nsdo = { index = 0x6065, data = \"d0 07 00 00\" }\n";
    let wrong = text.replacen('\n', "\nnaem = \"x\"\n", 1);
    let file = |end: &str, contents: &str| {
        let path = workshop().join(format!("{name}-{end}"));
        std::fs::write(&path, contents).expect("a file");
        path
    };
    [file("segment.toml", SEGMENT), file("network.toml", &text), file("wrong.toml", &wrong)]
}

// covers: c-interface, network-file
#[test]
fn a_loaded_network_is_that_of_the_file_and_its_codes_are_those_of_the_header() {
    let Some(checks) = program(&here().join("tests/c/network.c"), &[]) else { return };
    let [segment, network, wrong] = files("codes");
    let arguments = [&network, &wrong].map(|path| path.to_str().expect("a path"));
    let (said, reported, status) = outputs(&checks, &segment, &arguments);
    assert!(status.success(), "{said}\n{reported}");
    assert!(reported.contains("no such file: cannot be read: "), "{reported}");
    assert!(reported.contains("codes-wrong.toml:2: naem: unknown key `naem`"), "{reported}");
}

// covers: c-interface, network-file
#[test]
fn the_example_with_a_network_file_enables_the_drive() {
    let Some(example) = program(&root().join("examples/c/network.c"), &[]) else { return };
    let [segment, network, _] = files("example");
    let (output, ended) = on_segment(&example, &segment, &[network.to_str().expect("a path"), "20000"]);
    assert_eq!(ended, Ok(()), "{output}");
    assert_eq!(output.trim(), "enabled in mode 9.");
}

/// A ring without its second interface is refused.
// covers: c-interface, network-file
#[test]
fn a_network_that_does_not_fit_the_links_is_refused() {
    let Some(example) = program(&root().join("examples/c/network.c"), &[]) else { return };
    let [segment, network, _] = files("ring");
    let text = std::fs::read_to_string(&network).expect("it is there");
    let at = text.find("\n[[domain]]").expect("a domain");
    std::fs::write(&network, format!("{}\n[redundancy]\nring = true\n{}", &text[..at], &text[at..])).expect("a file");
    let (said, reported, status) = outputs(&example, &segment, &[network.to_str().expect("a path"), "10"]);
    assert!(!status.success(), "{said}");
    assert!(reported.contains("declares a ring: it needs a redundant interface"), "{reported}");
}

// covers: c-interface, network-file, eni-run
#[test]
fn an_eni_by_path_and_both_files_from_memory_bring_a_segment_to_op() {
    let Some(checks) = program(&here().join("tests/c/eni.c"), &[]) else { return };
    let [segment, network, _] = files("eni");
    let file = NetworkFile::read("eni.toml", &std::fs::read(&network).expect("it is there")).expect("it is valid");
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let eni = network.with_extension("xml");
    // An element that is not followed: a notice each time that the file is loaded.
    let text = export.text.replacen("<Config>", "<Config><Oddity/>", 1);
    std::fs::write(&eni, text).expect("a file");
    let arguments = [&eni, &network].map(|path| path.to_str().expect("a path"));
    let (said, reported, status) = outputs(&checks, &segment, &arguments);
    assert!(status.success(), "{said}\n{reported}");
    for name in [arguments[0], "ENI in memory"] {
        let notice =
            format!("{name}: not followed, or done in another way: Config/Oddity: this element is not known (line");
        assert!(reported.contains(&notice), "{notice}: {reported}");
    }
    for reason in ["no such file: cannot be read: ", "ENI in memory: ", "network file in memory:"] {
        assert!(reported.contains(reason), "{reason}: {reported}");
    }
}
