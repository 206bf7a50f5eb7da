//! The image of a domain in memory that two processes map: one writes outputs and reads inputs, the other runs the
//! cycles. Evaluated by what the simulated SubDevices report of themselves.
//!
//! The second process is this test program again, with one test and the memory's path in its environment. The
//! processes take turns by lines on a pipe.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{AlState, Application, Direction, DomainId, LastOutputs, MainDevice, Options, SubDeviceId, automatic};
use ringcat_sim::network::NetworkOptions;
use scenarios::segments::{descriptions, line, ring};
use scenarios::shared_memory;
use scenarios::world::CYCLE;

/// Environment of the second process: path of the memory, and whether its segment is a ring.
const MEMORY: &str = "RINGCAT_SHARED_IMAGE";
const IN_RING: &str = "RINGCAT_SHARED_IMAGE_IN_RING";
const KINDS: [&str; 4] = ["digital-output-16", "block", "digital-output-8", "block"];
const BYTES: usize = 4096;
const LIMIT: Duration = Duration::from_secs(5);
/// Marks the lines of the second process among those of its test program.
const MARK: &str = "> ";

/// Outputs or inputs of all SubDevices by their own memory, in the order of the declaration.
fn inside(application: &Application<SimulatedSegment>, direction: Direction) -> Vec<u8> {
    let devices = application.links().network().devices();
    devices.flat_map(|it| if direction == Direction::Outputs { it.outputs() } else { it.inputs() }).copied().collect()
}

/// Places of all outputs or inputs in the image.
fn places(application: &Application<SimulatedSegment>, direction: Direction) -> Vec<usize> {
    let areas = (0..KINDS.len()).flat_map(|at| application.directory().areas(SubDeviceId(at)));
    let areas = areas.filter(|area| area.direction == direction).map(|area| {
        let start = area.placed.image_offset as usize;
        start..start + usize::from(area.placed.area.length)
    });
    areas.flatten().collect()
}

/// The second process: it runs a cycle for each line, never touches the image, and reports what the SubDevices have.
#[test]
fn the_process_with_the_cycles() {
    let Ok((path, in_ring)) = std::env::var(MEMORY).and_then(|path| Ok((path, std::env::var(IN_RING)?))) else {
        println!("skipped: it is started by `an_image_is_shared_by_two_processes`");
        return;
    };
    let network = if in_ring == "true" { ring } else { line };
    let network = network(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let scan = main_device.scan().expect("all are there");
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    let memory =
        shared_memory::open(&path).and_then(|memory| shared_memory::map(&memory)).expect("the other process has it");
    declaration.place_image(DomainId(0), memory);
    let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("it fits");
    application.wait_until_op(LIMIT).expect("it settles");
    let [outputs, inputs] = [Direction::Outputs, Direction::Inputs].map(|direction| places(&application, direction));
    println!("\n{MARK}{outputs:?} {inputs:?}");
    for line in std::io::stdin().lines() {
        if line.expect("the other process is there").as_str() == "end" {
            break;
        }
        // The outputs leave with the first cycle; the inputs that follow from them come back with the next two.
        (0..3).for_each(|_| application.cycle(|_| ()));
        let [outputs, inputs] =
            [Direction::Outputs, Direction::Inputs].map(|direction| inside(&application, direction));
        println!("{MARK}{outputs:?} {inputs:?}");
    }
    application.stop(LastOutputs::Held, AlState::Init, LIMIT).expect("it stops");
}

/// The second process, ended with this value.
struct Other {
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Other {
    fn start(path: &str, in_ring: bool) -> Other {
        let program = std::env::current_exe().expect("it runs");
        let test = "shared_image::the_process_with_the_cycles";
        let mut child = Command::new(program)
            .args(["--exact", test, "--nocapture", "--test-threads", "1"])
            .env(MEMORY, path)
            .env(IN_RING, in_ring.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it starts");
        let (requests, answers) = (child.stdin.take().expect("a pipe"), child.stdout.take().expect("a pipe"));
        Other { child, requests, answers: BufReader::new(answers) }
    }

    /// The next two lists of numbers.
    fn answer<T: std::str::FromStr>(&mut self) -> [Vec<T>; 2] {
        let mut line = String::new();
        while self.answers.read_line(&mut line).expect("a pipe") > 0 {
            if let Some(answer) = line.strip_prefix(MARK) {
                let (first, second) = answer.split_once("] [").expect("two lists");
                return [first, second].map(|list| {
                    let numbers = list.split([',', ' ', '[', ']', '\n']).filter(|word| !word.is_empty());
                    numbers.map(|word| word.parse().ok().expect("a number")).collect()
                });
            }
            line.clear();
        }
        panic!("the other process has ended: {:?}", self.child.wait());
    }

    fn ask(&mut self, what: &str) {
        writeln!(self.requests, "{what}").expect("the other process waits");
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

// covers: layout
#[test]
fn an_image_is_shared_by_two_processes() {
    for in_ring in [false, true] {
        let memory = shared_memory::make(BYTES).expect("the kernel makes it");
        let path = shared_memory::path_of(&memory);
        let image = shared_memory::map(&memory).expect("it is mapped");
        let mut other = Other::start(&path, in_ring);
        let [outputs, inputs]: [Vec<usize>; 2] = other.answer();
        assert!(outputs.len() > 800 && inputs.len() >= 800, "{} {}", outputs.len(), inputs.len());
        for cycle in 0..50_usize {
            let pattern = |at: usize| (cycle * 31 + at * 7) as u8;
            outputs.iter().for_each(|at| image[*at] = pattern(*at));
            other.ask("cycle");
            let [taken, given]: [Vec<u8>; 2] = other.answer();
            let written: Vec<u8> = outputs.iter().map(|at| pattern(*at)).collect();
            assert_eq!(taken, written, "cycle {cycle}, ring {in_ring}: outputs in the SubDevices");
            let read: Vec<u8> = inputs.iter().map(|at| image[*at]).collect();
            assert_eq!(read, given, "cycle {cycle}, ring {in_ring}: inputs of the SubDevices");
        }
        other.ask("end");
        assert!(other.child.wait().expect("it ends").success());
        let last: Vec<u8> = outputs.iter().map(|at| image[*at]).collect();
        let pattern = |at: &usize| (49 * 31 + at * 7) as u8;
        assert_eq!(last, outputs.iter().map(pattern).collect::<Vec<u8>>(), "the memory outlives the other process");
    }
}
