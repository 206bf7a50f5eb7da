//! An ENI and a network file on interfaces: `ringcat sim` simulates the segment of the file, `ringcat run` brings it to
//! OP (protocol 8).

use std::path::Path;

use crate::bench::Bench;
use crate::said;

// covers: CR-16, 8, eni-run
#[test]
fn an_eni_with_lrw_runs_on_a_ring_of_interfaces_only_if_split() {
    let Some(mut bench) = Bench::new(2) else { return };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../ringcat/examples/machine.eni.xml");
    let path = file.to_str().expect("its name is text");
    bench.simulate_file("--eni", &file, true);
    let run = ["run", "--main", "main0", "--redundant", "main1", "--eni", path];
    let refused = bench.ringcat(&run);
    let (_, errors) = said(&refused);
    assert_eq!(refused.status.code(), Some(2), "{errors}");
    for words in
        ["LRW of 8 bytes over 4 SubDevices (Lamps (1002), Valves (1003), Buttons (1004), Drive (1005))", "--split-lrw"]
    {
        assert!(errors.contains(words), "{errors}");
    }
    let more = ["--split-lrw", "--for", "200ms", "--set", "Drive.Target velocity=-1234", "--watch", "Drive.Position"];
    let (output, errors) = said(&bench.ringcat(&[&run[..], &more[..]].concat()));
    for words in ["all SubDevices are in OP", "Drive.Position = -1234", "stopped: outputs zero, all SubDevices in INIT"]
    {
        assert!(output.contains(words), "{words}: {output}{errors}");
    }
}

/// The file is that of a scan of another simulated segment.
// covers: network-file
#[test]
fn the_simulated_segment_of_a_network_file_runs_with_the_file() {
    let Some(mut bench) = Bench::new(2) else { return };
    let place = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (segment, network) = (place.join("of-network.segment.toml"), place.join("of-network.toml"));
    let devices = ["coupler", "digital-output-8", "servo"].map(|kind| format!("[[device]]\ntype = \"{kind}\"\n"));
    std::fs::write(&segment, format!("[segment]\nring = true\n{}", devices.concat())).expect("a file");
    let path = network.to_str().expect("its name is text");
    let init = ["init", "--sim", segment.to_str().expect("its name is text"), "--out", path, "--overwrite"];
    let (output, errors) = said(&bench.ringcat(&init));
    assert!(output.contains("result: ok: 3 SubDevices"), "{output}{errors}");
    bench.simulate_file("--network", &network, true);
    let run = ["run", "--main", "main0", "--redundant", "main1", "--network", path, "--for", "200ms"];
    let values = ["--set", "servo.Command.Target velocity=77", "--watch", "servo.Feedback.Velocity"];
    let (output, errors) = said(&bench.ringcat(&[&run[..], &values[..]].concat()));
    for words in ["all SubDevices are in OP", "servo.Feedback.Velocity = 77", "all SubDevices in INIT"] {
        assert!(output.contains(words), "{words}: {output}{errors}");
    }
}
