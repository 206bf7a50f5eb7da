//! `ringcat scan`: who is on the wire. All SubDevices are in INIT afterwards.

use clap::Args;
use ringcat::text::{Names, describe};
use ringcat::{Event, MainDevice, Options};

use crate::interfaces::{Failure, InterfaceArguments, ThreadArguments};
use crate::output::say;
use crate::table;

/// Options of `ringcat scan`.
#[derive(Args, Debug)]
pub struct ScanArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

/// Scans and prints what was found; what happens meanwhile goes to the standard error output.
pub fn run(arguments: &ScanArguments) -> Result<(), Failure> {
    let links = arguments.interfaces.open(arguments.thread)?;
    let _awake = arguments.thread.apply();
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan_with(|event| {
        if !matches!(event.event, Event::ScanProgress { .. } | Event::ScanFailed { .. }) {
            eprintln!("{}", describe(&event.event, &Names::default()));
        }
    })?;
    if arguments.json {
        say!("{:#}", table::json(&scan));
    } else {
        for line in table::lines(&scan) {
            say!("{line}");
        }
    }
    Ok(())
}
