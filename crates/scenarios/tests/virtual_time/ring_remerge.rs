//! An independent merge (`remerge.py`, from the capture of both links alone) gives the same inputs and the same
//! incomplete cycles as the engine, in runs with random breaks. CR-05, CR-06, CR-07, protocol 9.3.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::tee::Tee;
use ringcat::{Direction, DomainId, DomainState, MainDevice, Options, SubDeviceId, automatic};
use ringcat_link::Recorder;
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::dice::Dice;
use scenarios::segments::{MAIN, REDUNDANT, at, descriptions, devices, ring};

const CYCLE: Duration = Duration::from_millis(1);
const KINDS: [&str; 6] =
    ["coupler", "analog-input-4", "digital-output-8", "digital-input-16", "servo", "emulated-input-8"];
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/virtual_time/remerge.py");
const CYCLES: usize = 400;

/// Result of a cycle.
#[derive(Debug)]
struct Cycle {
    complete: bool,
    inputs: String,
}

/// A straight ring, or a ring with crossed SubDevices and branches on ports 3 and 2, of which the latter processes the
/// redundant copy even in the closed ring; with the number of cables of the ring.
fn segment(shape: u64, options: NetworkOptions) -> (Network, usize) {
    if shape == 0 {
        return (ring(descriptions(&KINDS), options), KINDS.len() + 1);
    }
    use Port::{A, B, C, D};
    let kinds = ["junction", "analog-input-4", "digital-output-8", "junction", "servo", "digital-input-16", "coupler"];
    let (entry, exit) = if shape == 1 { (A, B) } else { (B, A) };
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, entry)),
        (at(1, exit), at(2, A)),
        (at(2, B), at(3, A)),
        (at(3, B), at(4, entry)),
        (at(4, exit), REDUNDANT),
        (at(0, C), at(5, A)),
        (at(3, D), at(6, A)),
    ];
    let builder = devices(descriptions(&kinds)).into_iter().fold(SegmentBuilder::new(), SegmentBuilder::device);
    let builder = cables.iter().fold(builder, |builder, (one, other)| builder.cable(*one, *other));
    (builder.options(options).build().expect("the cables fit"), 6)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Runs with random breaks; returns the engine's result of each cycle in OP, with the number of the first one.
fn run(seed: u64, path: &Path) -> (usize, Vec<Cycle>) {
    let mut dice = Dice::new(seed);
    let detection = Duration::from_micros(*dice.pick(&[10, 600, 3_000]));
    let (network, cables) = segment(seed % 3, NetworkOptions::default().with_detection_delay(detection));
    let recorder = Recorder::start(path, &[("main", "main link"), ("redundant", "redundant link")]).expect("a file");
    let links = Tee::new(SimulatedSegment::new(network), recorder.tap());
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("a segment");
    let mut application =
        main_device.activate(automatic(&scan.subdevices, CYCLE).with_lost_frames_sent_again(false)).expect("it fits");
    let areas: Vec<_> = (0..scan.subdevices.len())
        .flat_map(|subdevice| application.directory().areas(SubDeviceId(subdevice)).to_vec())
        .collect();
    let mut inputs: Vec<_> = areas
        .iter()
        .filter(|area| area.direction == Direction::Inputs)
        .map(|area| {
            area.placed.image_offset as usize..(area.placed.image_offset + u32::from(area.placed.area.length)) as usize
        })
        .collect();
    inputs.sort_by_key(|range| range.start);
    let (mut cycles, mut first, mut cut) = (Vec::new(), None, None);
    while first.is_none_or(|first| cycles.len() < first + CYCLES) {
        if first.is_some() && dice.one_in(12) {
            let fault = match cut.take() {
                Some(cable) => Fault::Heal(cable),
                None => Fault::Cut(*cut.insert(CableId(dice.below(cables as u64) as usize))),
            };
            let network = application.links_mut().links_mut().network_mut();
            let at = network.now() + Duration::from_micros(dice.below(1_000));
            network.schedule(at, fault);
        }
        let status = application.cycle(|data| data.status(DomainId(0)));
        while application.pop_event().is_some() {}
        let image = application.exchange().image(DomainId(0));
        let text = inputs.iter().map(|range| hex(&image[range.clone()])).collect();
        cycles.push(Cycle { complete: status.state == DomainState::Complete, inputs: text });
        if first.is_none() && application.all_settled() && cycles.last().is_some_and(|cycle| cycle.complete) {
            first = Some(cycles.len());
        }
        assert!(cycles.len() < 5_000, "not in OP: {:?}", application.states());
    }
    drop(application);
    let recorded = recorder.finish().expect("it was written");
    assert!(recorded.iter().all(|interface| interface.lost == 0), "{recorded:?}");
    (first.unwrap_or_default(), cycles)
}

/// The engine's results of all cycles, in the format of the script.
fn json(first: usize, cycles: &[Cycle]) -> String {
    let one = |Cycle { complete, inputs }: &Cycle| format!("{{\"complete\": {complete}, \"inputs\": \"{inputs}\"}}");
    let cycles: Vec<String> = cycles.iter().map(one).collect();
    format!("{{\"first\": {first}, \"cycles\": [\n{}\n]}}\n", cycles.join(",\n"))
}

/// Number of cycles that the script compared, and of incomplete ones; `None` without Python.
fn remerged(capture: &Path, images: &Path, seed: u64) -> Option<(usize, usize)> {
    let output = Command::new("python3").arg(SCRIPT).args([capture, images]).output().ok()?;
    assert!(output.status.success(), "seed {seed}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("two numbers are text");
    let mut numbers = text.split_whitespace().map(|number| number.parse().expect("a number"));
    numbers.next().zip(numbers.next())
}

// covers: CR-05, CR-06, CR-07, 9.3, ring-merge
#[test]
fn an_independent_merge_gives_the_same_inputs_and_cycles() {
    let (mut compared, mut incomplete) = (0, 0);
    for seed in 0..12 {
        let capture: PathBuf =
            std::env::temp_dir().join(format!("ringcat-remerge-{}-{seed}.pcapng", std::process::id()));
        let images = capture.with_extension("json");
        let (first, cycles) = run(seed, &capture);
        std::fs::write(&images, json(first, &cycles)).expect("the temporary directory is writable");
        let result = remerged(&capture, &images, seed);
        for file in [capture, images] {
            std::fs::remove_file(file).expect("it was written");
        }
        let Some((all, of_them)) = result else { return println!("skipped: there is no python3") };
        assert_eq!(all, cycles.len() - first, "seed {seed}");
        (compared, incomplete) = (compared + all, incomplete + of_them);
    }
    println!("{compared} cycles merged twice, {incomplete} of them incomplete by both");
    assert!(compared >= 12 * CYCLES && incomplete > 50);
}
