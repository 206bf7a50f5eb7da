//! `ringcat scan`: who is on the wire. All SubDevices are in INIT afterwards.

use clap::Args;
use ringcat::text::{Names, describe};
use ringcat::{Event, MainDevice};

use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, ThreadArguments};
use crate::output::{counted, say};
use crate::recording::RecordingArguments;
use crate::surroundings::Surroundings;
use crate::table;
use crate::verdict::Verdict;

/// What else there is to know.
const ABOUT_SCAN: &str = "\
A scan takes a segment that is in operation out of it: all SubDevices go to INIT. So it refuses to begin where another
MainDevice uses the interface or sends into the segment; --force goes on all the same. It waits up to 5 s for the first
SubDevice to answer. What is odd about the cables and EEPROMs goes to the standard error output, the table or JSON to
the standard output.";

/// Options of `ringcat scan`.
#[derive(Args, Debug)]
#[command(after_help = ABOUT_SCAN)]
pub struct ScanArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
    #[command(flatten)]
    recording: RecordingArguments,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

/// Scans and prints what was found; what happens meanwhile goes to the standard error output.
pub fn run(arguments: &ScanArguments) -> Result<Verdict, Failure> {
    let links = arguments.interfaces.open(arguments.thread)?;
    let mut surroundings = Surroundings::watch(&arguments.interfaces, &links);
    let recording = arguments.recording.start(&arguments.interfaces)?;
    let links = recording.tee(links);
    let _awake = arguments.thread.apply();
    let mut main_device = MainDevice::request(links, &arguments.interfaces.options());
    let result = main_device.scan_with(|event| match &event.event {
        Event::ScanProgress { .. } | Event::ScanFailed { .. } => {}
        _ => match surroundings.note(&event.event) {
            None => eprintln!("{}", describe(event, &Names::default())),
            Some(words) => words.into_iter().for_each(|words| eprintln!("ringcat: {words}")),
        },
    });
    let foreign = main_device.acyclic_counters().foreign;
    let scan = result.map_err(|error| surroundings.explain(error, foreign))?;
    if foreign > 0 {
        eprintln!("{foreign} frames of another MainDevice arrived during the scan: {}", surroundings.senders());
    }
    if arguments.json {
        say!("{:#}", table::json(&scan));
    } else {
        for line in table::lines(&scan) {
            say!("{line}");
        }
    }
    drop(main_device);
    Ok(Verdict::Held(counted(scan.subdevices.len(), "SubDevice", "SubDevices")).and(recording.finish()))
}
